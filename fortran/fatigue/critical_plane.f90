!> The plane on which a fatigue parameter is largest.
!>
!> Three faces of a cube contain all normals up to their sign; a face is a square of cells. A parameter is the largest of
!> smooth functions, each of a few times of the history, so that it is stationary at its maximum in one of them. With a
!> bound K of their curvature the value at the center of a cell, at an angle r from the maximum, is less by at most
!>
!>     K r^2/2.
!>
!> Cells below the best value by more than this are left out, the others are divided into four until the loss is negligible.
!> Where more cells are left than can be kept, as on a ridge of equal values, the best of them are divided. On a narrow ridge,
!> as where a history under pressure has next to no tension, these need not contain the maximum: if the loss is not negligible
!> in the end, planes of tension are compared as well. At each time these are an arc about the axis e_3 of the largest
!> principal stress, towards that of the middle one:
!>
!>     n = cos(phi) e_3 + sin(phi) e_2,   sigma_3 cos(phi)^2 + sigma_2 sin(phi)^2 >= 0.
module hc_critical_plane
  use hc_precision, only: wp, pi
  use hc_plane_criteria, only: plane_criterion_t, stress_extent_t
  use hc_invariant_criteria, only: deviator_coordinates, hydrostatic
  implicit none
  private

  public :: find_critical_plane

  !> Cells along a side of a face at first: 11 degrees.
  integer, parameter :: n_side = 8
  !> Most cells that are divided at a time: all of the first ones, and half of that many later.
  integer, parameter :: n_most = 3*n_side**2, n_small = 96, small = 2
  !> Most divisions: down to 1.4e-3 degrees.
  integer, parameter :: n_division = 13
  !> Loss that is negligible, as a share of the value.
  real(wp), parameter :: negligible = 1.0e-6_wp
  !> Largest angle between center and corner of a cell, in that from the middle of a face to its side times the cell's share.
  real(wp), parameter :: corner = 1.7_wp*0.25_wp*pi
  !> Planes of an arc on either side of its middle.
  integer, parameter :: n_arc = 12

  !> A search: the best plane so far, and the cells that may contain a better one.
  type :: search_t
    real(wp) :: value = -0.5_wp*huge(1.0_wp), normal(3) = [0.0_wp, 0.0_wp, 1.0_wp]
    !> Most that the maximum exceeds the value at the center of its cell
    real(wp) :: loss = 0.0_wp
    integer :: number = 0, most = n_most
    !> Face of each cell, place of its center there (-1 to 1) and value
    integer :: face(n_most) = 0
    real(wp) :: place(2, n_most) = 0.0_wp, values(n_most) = 0.0_wp
  contains
    procedure :: compare
    procedure, private :: add
  end type search_t

contains

  !> Find the plane on which a parameter is largest, and its value there.
  pure subroutine find_critical_plane(criterion, history, value, normal)
    !> The parameter
    class(plane_criterion_t), intent(in) :: criterion
    !> Stress (6, times): xx, yy, zz, xy, yz, xz [Pa]
    real(wp), intent(in), contiguous :: history(:, :)
    !> Largest value, in the unit of the parameter
    real(wp), intent(out) :: value
    !> Normal of the critical plane (3), its last component not negative
    real(wp), intent(out) :: normal(3)
    type(search_t) :: search, before
    real(wp) :: path(size(history, 2), 6), half, enough
    integer :: i, j, face, division
    logical :: crowded

    path = transpose(history)
    crowded = .false.
    half = 1.0_wp/n_side
    search%loss = 0.5_wp*criterion%curvature(extent_of(history))*(corner*half)**2
    do face = 1, 3
      do j = 1, n_side
        do i = 1, n_side
          call search%compare(criterion, path, face, half*[2*i - 1 - n_side, 2*j - 1 - n_side])
        end do
      end do
    end do
    do division = 1, n_division
      if (search%number == 0 .or. search%loss <= negligible*abs(search%value)) exit
      before = search
      enough = max(search%value, criterion%least()) - search%loss
      search%loss = 0.25_wp*search%loss
      search%number = 0
      if (division >= small) search%most = n_small
      half = 0.5_wp*half
      do i = 1, before%number
        if (before%values(i) < enough) cycle
        do j = 0, 3
          call search%compare(criterion, path, before%face(i), before%place(:, i) + half*[1 - 2*mod(j, 2), 1 - 2*(j/2)])
        end do
      end do
      crowded = crowded .or. search%number == search%most
    end do
    if ((search%number > 0 .or. crowded) .and. search%loss > negligible*abs(search%value)) then
      call search_ridges(search, criterion, path)
    end if
    value = max(search%value, criterion%least())
    normal = sign(1.0_wp, search%normal(3))*search%normal
  end subroutine find_critical_plane

  !> Compare the planes of tension at each time, among which a narrow ridge lies.
  pure subroutine search_ridges(search, criterion, path)
    type(search_t), intent(inout) :: search
    class(plane_criterion_t), intent(in) :: criterion
    !> Stress (times, 6) [Pa]
    real(wp), intent(in), contiguous :: path(:, :)
    real(wp) :: normals(3, -n_arc:n_arc), value
    integer :: i, k

    do i = 1, size(path, 1)
      call find_arc(path(i, :), normals)
      if (norm2(normals(:, 0)) <= 0.0_wp) cycle ! no tension
      do k = -n_arc, n_arc
        value = value_on(criterion, path, normals(:, k), search%value)
        if (value <= search%value) cycle
        search%value = value
        search%normal = normals(:, k)
      end do
    end do
  end subroutine search_ridges

  !> Find the arc of the planes of tension at a time; zeros without tension.
  pure subroutine find_arc(stress, normals)
    !> xx, yy, zz, xy, yz, xz [Pa]
    real(wp), intent(in) :: stress(6)
    real(wp), intent(out) :: normals(3, -n_arc:n_arc)
    integer, parameter :: n_sweep = 8
    real(wp) :: a(3, 3), axes(3, 3), rotation(3, 3), angle, most
    integer :: sweep, i, j, largest, middle

    normals = 0.0_wp
    a = reshape(stress([1, 4, 6, 4, 2, 5, 6, 5, 3]), [3, 3])
    axes = identity()
    do sweep = 1, n_sweep ! of Jacobi
      do i = 1, 2
        do j = i + 1, 3
          angle = 0.5_wp*atan2(2.0_wp*a(i, j), a(j, j) - a(i, i))
          rotation = identity()
          rotation([i, j], [i, j]) = reshape([cos(angle), -sin(angle), sin(angle), cos(angle)], [2, 2])
          a = matmul(transpose(rotation), matmul(a, rotation))
          axes = matmul(axes, rotation)
        end do
      end do
    end do
    largest = maxloc([a(1, 1), a(2, 2), a(3, 3)], dim=1)
    middle = 6 - largest - minloc([a(1, 1), a(2, 2), a(3, 3)], dim=1)
    if (a(largest, largest) <= 0.0_wp .or. middle < 1 .or. middle > 3) return
    most = 0.5_wp*pi
    if (a(middle, middle) < 0.0_wp) most = atan(sqrt(-a(largest, largest)/a(middle, middle)))
    do i = -n_arc, n_arc
      angle = most*i/n_arc
      normals(:, i) = cos(angle)*axes(:, largest) + sin(angle)*axes(:, middle)
    end do
  end subroutine find_arc

  !> Return the unit matrix.
  pure function identity()
    real(wp) :: identity(3, 3)

    identity = 0.0_wp
    identity(1, 1) = 1.0_wp
    identity(2, 2) = 1.0_wp
    identity(3, 3) = 1.0_wp
  end function identity

  !> Compare the center of a cell with the best plane, and keep the cell if a better one may lie in it.
  pure subroutine compare(self, criterion, path, face, place)
    class(search_t), intent(inout) :: self
    class(plane_criterion_t), intent(in) :: criterion
    !> Stress (times, 6) [Pa]
    real(wp), intent(in), contiguous :: path(:, :)
    integer, intent(in) :: face
    real(wp), intent(in) :: place(2)
    real(wp) :: here, normal(3), enough

    normal = normal_at(face, place)
    enough = max(self%value, criterion%least()) - self%loss
    here = value_on(criterion, path, normal, enough)
    if (here < enough) return
    call self%add(face, place, here)
    if (.not. here > self%value) return
    self%value = here
    self%normal = normal
  end subroutine compare

  !> Add a cell, in place of the worst one if there is no place left.
  pure subroutine add(self, face, place, value)
    class(search_t), intent(inout) :: self
    integer, intent(in) :: face
    real(wp), intent(in) :: place(2), value
    integer :: k

    if (self%number < self%most) then
      self%number = self%number + 1
      k = self%number
    else
      k = minloc(self%values(:self%most), dim=1)
      if (.not. value > self%values(k)) return
    end if
    self%face(k) = face
    self%place(:, k) = place
    self%values(k) = value
  end subroutine add

  !> Return the normal at a place of a face: the cubic makes the angles between neighbors nearly equal.
  pure function normal_at(face, place) result(normal)
    integer, intent(in) :: face
    real(wp), intent(in) :: place(2)
    real(wp) :: normal(3)

    normal = unit(cshift([place*(0.25_wp*pi + (1.0_wp - 0.25_wp*pi)*place**2), 1.0_wp], face))
  end function normal_at

  !> Return the vector of length 1 along another one.
  pure function unit(vector)
    real(wp), intent(in) :: vector(3)
    real(wp) :: unit(3)
    unit = vector/norm2(vector)
  end function unit

  !> Bound the stresses of a history by its deviators: principal stresses differ by at most 2 sqrt(J2), and a normal
  !> stress is at most the hydrostatic one and 2 sqrt(J2/3).
  pure function extent_of(history) result(extent)
    real(wp), intent(in), contiguous :: history(:, :)
    type(stress_extent_t) :: extent
    real(wp) :: path(5, size(history, 2)), middle(5), pressure(size(history, 2)), size_of
    integer :: i

    do i = 1, size(history, 2)
      path(:, i) = deviator_coordinates(history(:, i))
      pressure(i) = hydrostatic(history(:, i))
    end do
    middle = 0.5_wp*(maxval(path, dim=2) + minval(path, dim=2))
    extent%hydrostatic = maxval(pressure) - minval(pressure)
    do i = 1, size(history, 2)
      size_of = norm2(path(:, i))
      extent%normal = max(extent%normal, pressure(i) + 2.0_wp/sqrt(3.0_wp)*size_of)
      extent%spread = max(extent%spread, 2.0_wp*size_of)
      extent%change = max(extent%change, 4.0_wp*norm2(path(:, i) - middle))
    end do
  end function extent_of

  !> Evaluate the parameter on the plane of a normal.
  pure real(wp) function value_on(criterion, path, normal, floor)
    class(plane_criterion_t), intent(in) :: criterion
    !> Stress (times, 6) [Pa]
    real(wp), intent(in), contiguous :: path(:, :)
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
    value_on = criterion%value(sigma, shear, path(:, 1) + path(:, 2) + path(:, 3), floor)
  end function value_on

  !> Compute n . sigma m at all times.
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

  !> Return the weights of the six stresses in n . sigma m.
  pure function weights(n, m)
    real(wp), intent(in) :: n(3), m(3)
    real(wp) :: weights(6)
    weights = [n*m, n(1)*m(2) + n(2)*m(1), n(2)*m(3) + n(3)*m(2), n(1)*m(3) + n(3)*m(1)]
  end function weights

  !> Return two unit vectors at right angles to a normal and to each other.
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
