!> Fatigue quantities of many points at once, in parallel; each point by itself, so that any number of threads gives the same bits.
module hc_fatigue_fields
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp
  use hc_error, only: error_t, raise, status
  use hc_plane_criteria, only: plane_criterion_t
  use hc_critical_plane, only: find_critical_plane
  use hc_invariant_criteria, only: crossland
  implicit none
  private

  public :: find_critical_planes, find_invariants, find_ruiz_parameters, find_ruiz

contains

  !> Find the critical plane of every point.
  subroutine find_critical_planes(criterion, histories, values, normals, error)
    !> The parameter
    class(plane_criterion_t), intent(in) :: criterion
    !> Stress (6, times, points): xx, yy, zz, xy, yz, xz [Pa]
    real(wp), intent(in), contiguous :: histories(:, :, :)
    !> Largest value (points), in the unit of the parameter
    real(wp), intent(out), contiguous :: values(:)
    !> Normals of the planes (3, points)
    real(wp), intent(out), contiguous :: normals(:, :)
    !> Allocated if a stress is not finite, or there is none
    type(error_t), allocatable, intent(out) :: error
    integer :: i

    call require_stress(histories, error)
    if (allocated(error)) return
    !$omp parallel do schedule(dynamic, 16)
    do i = 1, size(values)
      call find_critical_plane(criterion, histories(:, :, i), values(i), normals(:, i))
    end do
    !$omp end parallel do
  end subroutine find_critical_planes

  !> Find a parameter of the stress invariants at every point: that of Crossland or of Dang Van.
  subroutine find_invariants(parameter, histories, slope, values, error)
    !> crossland or dang_van
    procedure(crossland) :: parameter
    !> Stress (6, times, points) [Pa]
    real(wp), intent(in), contiguous :: histories(:, :, :)
    !> Influence of the hydrostatic stress
    real(wp), intent(in) :: slope
    !> Parameter (points) [Pa]
    real(wp), intent(out), contiguous :: values(:)
    !> Allocated if a stress is not finite, or there is none
    type(error_t), allocatable, intent(out) :: error
    integer :: i

    call require_stress(histories, error)
    if (allocated(error)) return
    !$omp parallel do schedule(dynamic, 64)
    do i = 1, size(values)
      values(i) = parameter(histories(:, :, i), slope)
    end do
    !$omp end parallel do
  end subroutine find_invariants

  !> Find the parameters of Ruiz of every point.
  subroutine find_ruiz_parameters(traction, slip, histories, f_1, f_2, amplitude, error)
    !> Traction (2, times, points) [Pa] and slip (2, times, points) [m]
    real(wp), intent(in), contiguous :: traction(:, :, :), slip(:, :, :)
    !> Stress at the surface (6, times, points) [Pa]
    real(wp), intent(in), contiguous :: histories(:, :, :)
    !> F1 [Pa m], F2 [Pa^2 m] and slip amplitude [m] (points)
    real(wp), intent(out), contiguous :: f_1(:), f_2(:), amplitude(:)
    !> Allocated if a number is not finite, or there is none
    type(error_t), allocatable, intent(out) :: error
    integer :: i

    call require_stress(histories, error)
    if (.not. allocated(error)) call require_stress(traction, error)
    if (.not. allocated(error)) call require_stress(slip, error)
    if (allocated(error)) return
    do i = 1, size(f_1)
      call find_ruiz(traction(:, :, i), slip(:, :, i), histories(:, :, i), f_1(i), f_2(i), amplitude(i))
    end do
  end subroutine find_ruiz_parameters

  !> Find the fretting parameters F1 and F2 of a node from traction, slip and surface stress over a cycle (C. Ruiz,
  !> P. H. B. Boddington and K. C. Chen, Exp. Mech. 24 (1984) 208-217).
  !>
  !> With the main direction t of the slip path: slip amplitude delta_s = half the range of s.t; F1 = max |q| delta_s [Pa m];
  !> F2 = sigma_t F1 [Pa^2 m], sigma_t the largest surface stress along t, 0 if it is pressure. Both use values of one node.
  pure subroutine find_ruiz(traction, slip, stress, f_1, f_2, amplitude)
    !> Traction (2, times) [Pa] and slip (2, times) [m]
    real(wp), intent(in), contiguous :: traction(:, :), slip(:, :)
    !> Stress at the surface (6, times): xx, yy, zz, xy, yz, xz [Pa]
    real(wp), intent(in), contiguous :: stress(:, :)
    !> F1 [Pa m] and F2 [Pa^2 m]; slip amplitude [m]
    real(wp), intent(out) :: f_1, f_2, amplitude
    real(wp) :: t(2), along(size(slip, 2))

    t = main_direction(slip)
    along = matmul(t, slip)
    amplitude = 0.5_wp*(maxval(along) - minval(along))
    f_1 = sqrt(maxval(sum(traction**2, dim=1)))*amplitude
    f_2 = f_1*max(0.0_wp, maxval(t(1)**2*stress(1, :) + t(2)**2*stress(2, :) + 2.0_wp*t(1)*t(2)*stress(4, :)))
  end subroutine find_ruiz

  !> Find the direction along which a path extends most: the first axis of its scatter.
  pure function main_direction(path) result(t)
    real(wp), intent(in), contiguous :: path(:, :)
    real(wp) :: t(2), mean(2), xx, yy, xy, angle

    mean = sum(path, dim=2)/size(path, 2)
    xx = sum((path(1, :) - mean(1))**2)
    yy = sum((path(2, :) - mean(2))**2)
    xy = sum((path(1, :) - mean(1))*(path(2, :) - mean(2)))
    angle = 0.0_wp
    if (xx + yy > 0.0_wp) angle = 0.5_wp*atan2(2.0_wp*xy, xx - yy)
    t = [cos(angle), sin(angle)]
  end function main_direction

  !> Refuse histories without a time, and numbers that are not finite, or whose products are not.
  pure subroutine require_stress(histories, error)
    real(wp), intent(in), contiguous :: histories(:, :, :)
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: largest = 1.0e100_wp

    if (size(histories, 2) == 0) then
      call raise(error, status%invalid_input, 'a history of at least one time is expected')
    else if (.not. all(ieee_is_finite(histories))) then ! first: a comparison with NaN may be trapped
      call raise(error, status%invalid_input, 'finite numbers are expected in the history')
    else if (any(abs(histories) > largest)) then
      call raise(error, status%invalid_input, 'numbers of at most 1e100 are expected in the history')
    end if
  end subroutine require_stress

end module hc_fatigue_fields
