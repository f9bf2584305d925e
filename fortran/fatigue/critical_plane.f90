!> The plane on which a fatigue parameter is largest.
!>
!> Planes spread evenly over the hemisphere of normals are compared first; the best two that are not neighbors are then
!> improved by steps that are halved where none of four directions leads higher. A smooth parameter is stationary at its
!> largest value, so that an angle of 2e-3 costs some 1e-6 of it.
module hc_critical_plane
  use hc_precision, only: wp, pi
  use hc_plane_criteria, only: plane_criterion_t
  implicit none
  private

  public :: plane_set_t, new_plane_set, find_critical_plane

  !> Number of planes that are compared: normals 7 degrees apart.
  integer, parameter :: n_spread = 400
  !> Angle below which no more steps are made [rad].
  real(wp), parameter :: least_angle = 2.0e-3_wp
  !> Cosine of the angle between normals that count as neighbors (20 degrees).
  real(wp), parameter :: neighbor = 0.94_wp
  !> Share of the best value from which a second plane is improved, too.
  real(wp), parameter :: rival = 0.9_wp

  !> Normals spread over a hemisphere.
  type :: plane_set_t
    !> Normals (3, number)
    real(wp), allocatable :: normals(:, :)
  end type plane_set_t

contains

  !> Spread normals evenly over a hemisphere, along a spiral.
  pure subroutine new_plane_set(planes)
    !> The set
    type(plane_set_t), intent(out) :: planes
    real(wp) :: height, azimuth
    integer :: i

    allocate (planes%normals(3, n_spread))
    do i = 1, n_spread
      height = (real(i, wp) - 0.5_wp)/n_spread
      azimuth = pi*(3.0_wp - sqrt(5.0_wp))*i
      planes%normals(:, i) = [sqrt(1.0_wp - height**2)*[cos(azimuth), sin(azimuth)], height]
    end do
  end subroutine new_plane_set

  !> Find the plane on which a parameter is largest, and its value there.
  pure subroutine find_critical_plane(criterion, planes, history, value, normal)
    !> The parameter
    class(plane_criterion_t), intent(in) :: criterion
    !> Planes to begin with
    type(plane_set_t), intent(in) :: planes
    !> Stress (6, times): xx, yy, zz, xy, yz, xz [Pa]
    real(wp), intent(in), contiguous :: history(:, :)
    !> Largest value, in the unit of the parameter
    real(wp), intent(out) :: value
    !> Normal of the critical plane (3), its last component not negative
    real(wp), intent(out) :: normal(3)
    real(wp) :: path(size(history, 2), 6), trace(size(history, 2)), found(size(planes%normals, 2)), second, other(3)
    integer :: i, best

    path = transpose(history)
    trace = sum(path(:, :3), dim=2)
    value = -0.5_wp*huge(value)
    do i = 1, size(found)
      found(i) = value_on(criterion, path, trace, planes%normals(:, i), value - (1.0_wp - rival)*abs(value))
      value = max(value, found(i))
    end do
    best = maxloc(found, dim=1)
    normal = planes%normals(:, best)
    call ascend(criterion, path, trace, normal, value)
    i = maxloc(found, dim=1, mask=abs(matmul(planes%normals(:, best), planes%normals)) < neighbor)
    if (found(i) > found(best) - (1.0_wp - rival)*abs(found(best))) then
      other = planes%normals(:, i)
      second = found(i)
      call ascend(criterion, path, trace, other, second)
      if (second > value) then
        value = second
        normal = other
      end if
    end if
    if (normal(3) < 0.0_wp) normal = -normal
  end subroutine find_critical_plane

  !> Improve a plane by steps of its normal.
  pure subroutine ascend(criterion, path, trace, normal, value)
    class(plane_criterion_t), intent(in) :: criterion
    !> Stress (times, 6) and its trace (times) [Pa]
    real(wp), intent(in), contiguous :: path(:, :), trace(:)
    !> Normal, and the value on its plane
    real(wp), intent(inout) :: normal(3), value
    real(wp) :: angle, axes(3, 2), trial(3), best(3), here, start, turn
    integer :: k, level

    angle = 0.5_wp*sqrt(2.0_wp*pi/n_spread)
    level = 0
    do while (angle > least_angle)
      axes = tangents(normal)
      start = value
      best = normal
      do k = 1, 4
        turn = 0.5_wp*pi*k + 0.25_wp*pi*level ! other directions at every size
        trial = normal + angle*(cos(turn)*axes(:, 1) + sin(turn)*axes(:, 2))
        trial = trial/norm2(trial)
        here = value_on(criterion, path, trace, trial, value)
        if (here > value) then
          value = here
          best = trial
        end if
      end do
      normal = best
      if (.not. value > start + 1.0e-9_wp*abs(start)) then
        angle = 0.5_wp*angle
        level = level + 1
      end if
    end do
  end subroutine ascend

  !> Parameter on the plane of a normal.
  pure real(wp) function value_on(criterion, path, trace, normal, floor)
    class(plane_criterion_t), intent(in) :: criterion
    real(wp), intent(in), contiguous :: path(:, :), trace(:)
    real(wp), intent(in) :: normal(3), floor
    real(wp) :: axes(3, 2), sigma(size(path, 1)), shear(size(path, 1), 2)
    integer :: k

    sigma = component(path, weights(normal, normal))
    if (criterion%uses_shear()) then
      axes = tangents(normal)
      do k = 1, 2
        shear(:, k) = component(path, weights(normal, axes(:, k)))
      end do
    else
      shear = 0.0_wp
    end if
    value_on = criterion%value(sigma, shear, trace, floor)
  end function value_on

  !> n . sigma m at all times.
  pure function component(path, weight)
    real(wp), intent(in), contiguous :: path(:, :)
    !> Weights of the six stresses
    real(wp), intent(in) :: weight(6)
    real(wp) :: component(size(path, 1))
    integer :: i

    do i = 1, size(path, 1) ! faster than matmul, which is a call of a library
      component(i) = weight(1)*path(i, 1) + weight(2)*path(i, 2) + weight(3)*path(i, 3) &
                     + weight(4)*path(i, 4) + weight(5)*path(i, 5) + weight(6)*path(i, 6)
    end do
  end function component

  !> Weights of the six stresses in n . sigma m.
  pure function weights(n, m)
    real(wp), intent(in) :: n(3), m(3)
    real(wp) :: weights(6)
    weights = [n*m, n(1)*m(2) + n(2)*m(1), n(2)*m(3) + n(3)*m(2), n(1)*m(3) + n(3)*m(1)]
  end function weights

  !> Two unit vectors at right angles to a normal and to each other.
  pure function tangents(normal) result(axes)
    real(wp), intent(in) :: normal(3)
    real(wp) :: axes(3, 2), along(3)

    along = 0.0_wp
    along(minloc(abs(normal), dim=1)) = 1.0_wp
    axes(:, 1) = along - dot_product(along, normal)*normal
    axes(:, 1) = axes(:, 1)/norm2(axes(:, 1))
    axes(:, 2) = [normal(2)*axes(3, 1) - normal(3)*axes(2, 1), normal(3)*axes(1, 1) - normal(1)*axes(3, 1), &
                  normal(1)*axes(2, 1) - normal(2)*axes(1, 1)]
  end function tangents

end module hc_critical_plane
