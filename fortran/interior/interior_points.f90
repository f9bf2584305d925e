!> Displacement and stress at single points of a body: the exact sum over the pyramids that carry traction.
!>
!> The frame is that of the contact: z points into body 1, p >= 0 pushes the bodies apart, q acts on body 1 and -q on
!> body 2. A point is given by its depth below the surface of its body; body 2 is computed in the frame mirrored at
!> z = 0, in which the loads are (p, -q), and its fields are turned back.
!>
!> In a window that repeats the sum is one over waves (hc_periodic_interior).
!>
!> Equations: docs/theory/interior.md, (I10).
module hc_interior_points
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_lattice, only: lattice_t, check_lattice
  use hc_field_space, only: field_space_t, space_over
  use hc_layer_response, only: layered_body_t
  use hc_interior_fields, only: n_derivative, check_interior, yz, xz
  use hc_interior_pyramid, only: interior_pyramid_t, new_interior_pyramid
  use hc_depth_fields, only: depth_fields_t, new_depth_fields, check_inside
  use hc_periodic_interior, only: periodic_interior_t, new_periodic_interior
  !$ use omp_lib, only: omp_get_thread_num
  implicit none
  private

  public :: fields_at_points, check_body

  !> Nodes that carry traction in any step.
  type :: loaded_nodes_t
    !> Pyramid of one of them
    type(interior_pyramid_t) :: pyramid
    !> Positions (node, direction) [m]
    real(wp), allocatable :: position(:, :)
    !> Tractions in the frame of the body (node, component of the steps one after the other) [Pa]
    real(wp), allocatable :: traction(:, :)
  end type loaded_nodes_t

  !> Error at one of several depths, which threads compute.
  type :: fault_t
    type(error_t), allocatable :: error
  end type fault_t

contains

  !> Compute displacement and stress at points for a history of load steps.
  subroutine fields_at_points(lattice, traction, body, inside, points, displacement, stress, error, space)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Pressure and traction on body 1 along x and y (n_col, n_row, component, step) [Pa]
    real(wp), intent(in), contiguous :: traction(:, :, :, :)
    !> Number of the body, 1 or 2
    integer, intent(in) :: body
    !> Its layers and the body below them
    type(layered_body_t), intent(in) :: inside
    !> Points, x, y and depth below the surface of the body (3, n) [m]
    real(wp), intent(in) :: points(:, :)
    !> Displacement times the shear modulus of the surface (direction, point, step) [Pa m]
    real(wp), intent(out) :: displacement(:, :, :)
    !> Stress (component xx, yy, zz, xy, yz, xz; point; step) [Pa]
    real(wp), intent(out) :: stress(:, :, :)
    !> Allocated on failure: a lattice of no use, no such body or material, points above the surface, not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Who shares the work; absent: as many threads as OpenMP would take
    type(field_space_t), intent(in), optional :: space

    type(field_space_t) :: shared
    type(periodic_interior_t) :: repeating
    type(loaded_nodes_t) :: loaded

    call check_lattice(lattice, error)
    if (.not. allocated(error)) call check_body(body, error)
    if (.not. allocated(error)) call check_interior(points(1, :), points(2, :), points(3, :), inside%base%poisson_ratio, error)
    if (.not. allocated(error)) call check_inside(inside, points(3, :), error)
    if (allocated(error)) return
    shared = space_over(lattice%extent)
    if (present(space)) shared = space
    if (lattice%is_periodic()) then
      call new_periodic_interior(repeating, lattice, body, inside, traction, shared, error)
      if (.not. allocated(error)) call repeating%at_points(points, displacement, stress, error)
    else
      call new_loaded_nodes(loaded, lattice, traction, body, size(inside%layer) > 0, error)
      if (.not. allocated(error)) call sum_at_points(loaded, inside, points, displacement, stress, shared, error)
    end if
    if (allocated(error)) return
    if (body == 2) then
      displacement(3, :, :) = -displacement(3, :, :)
      stress([yz, xz], :, :) = -stress([yz, xz], :, :)
    end if
  end subroutine fields_at_points

  !> Sum over the pyramids of a window that ends. The influence of a pyramid on a point is worked out once for all steps.
  subroutine sum_at_points(loaded, inside, points, displacement, stress, space, error)
    type(loaded_nodes_t), intent(in) :: loaded
    type(layered_body_t), intent(in) :: inside
    real(wp), intent(in) :: points(:, :)
    real(wp), intent(out) :: displacement(:, :, :), stress(:, :, :)
    type(field_space_t), intent(in) :: space
    !> Allocated on failure: layers that images do not describe, not enough memory
    type(error_t), allocatable, intent(out) :: error

    type(depth_fields_t), allocatable :: fields(:)
    real(wp), allocatable :: sums(:, :, :)
    integer, allocatable :: level(:)
    integer :: i, thread, stat

    call find_levels(inside, points(3, :), level, fields, error)
    if (allocated(error)) return
    ! of each thread; no stack holds those of many steps
    allocate (sums(n_derivative, size(loaded%traction, 2), space%threads), stat=stat)
    if (stat /= 0) then
      call raise(error, status%resources, 'not enough memory for the stress: use fewer load steps')
      return
    end if
    !$omp parallel do num_threads(space%threads) schedule(dynamic) private(thread) if (size(points, 2) > 1)
    do i = 1, size(points, 2)
      thread = 1
      !$ thread = omp_get_thread_num() + 1
      associate (spacing => loaded%pyramid%spacing, node => loaded%position)
        call fields(level(i))%of_nodes(loaded%pyramid, (points(1, i) - node(:, 1))/spacing, (points(2, i) - node(:, 2))/spacing, &
                                       loaded%traction, sums(:, :, thread), displacement(:, i, :), stress(:, i, :))
      end associate
    end do
    !$omp end parallel do
  end subroutine sum_at_points

  !> Set up the fields at all depths, each once in a coated body.
  subroutine find_levels(inside, depth, level, fields, error)
    type(layered_body_t), intent(in) :: inside
    !> Depths of the points [m]
    real(wp), intent(in) :: depth(:)
    !> Number of the depth of each point
    integer, allocatable, intent(out) :: level(:)
    !> Fields at the depths
    type(depth_fields_t), allocatable, intent(out) :: fields(:)
    !> Allocated on failure: layers that images do not describe
    type(error_t), allocatable, intent(out) :: error
    type(fault_t), allocatable :: fault(:)
    integer, allocatable :: first(:)
    integer :: i, n

    allocate (level(size(depth)), first(size(depth)))
    n = 0
    do i = 1, size(depth)
      if (size(inside%layer) > 0) level(i) = findloc(abs(depth(first(:n)) - depth(i)) <= 0.0_wp, .true., dim=1)
      if (size(inside%layer) > 0 .and. level(i) > 0) cycle
      n = n + 1
      first(n) = i
      level(i) = n
    end do
    allocate (fields(n), fault(n))
    !$omp parallel do schedule(dynamic)
    do i = 1, n
      call new_depth_fields(fields(i), inside, depth(first(i)), fault(i)%error)
    end do
    !$omp end parallel do
    do i = 1, n
      if (allocated(fault(i)%error)) error = fault(i)%error
    end do
  end subroutine find_levels

  !> Refuse the number of a body that there is not.
  pure subroutine check_body(body, error)
    !> Number of the body
    integer, intent(in) :: body
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    if (body /= 1 .and. body /= 2) call raise(error, status%invalid_input, 'the number of the body: 1 or 2 expected')
  end subroutine check_body

  !> Find the nodes that carry traction.
  subroutine new_loaded_nodes(self, lattice, traction, body, coated, error)
    type(loaded_nodes_t), intent(out) :: self
    type(lattice_t), intent(in) :: lattice
    !> Pressure and traction on body 1 (n_col, n_row, component, step) [Pa]
    real(wp), intent(in) :: traction(:, :, :, :)
    !> Number of the body, and whether it has layers
    integer, intent(in) :: body
    logical, intent(in) :: coated
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error

    real(wp) :: index(2), side
    integer :: col, row, n, n_step, stat

    n_step = size(traction, 4)
    n = count(any(any(abs(traction) > 0.0_wp, dim=4), dim=3))
    allocate (self%position(n, 2), self%traction(n, 3*n_step), stat=stat)
    if (stat /= 0) then
      call raise(error, status%resources, 'not enough memory for the tractions: use fewer load steps')
      return
    end if
    call new_interior_pyramid(self%pyramid, lattice%basis, coated)
    side = merge(1.0_wp, -1.0_wp, body == 1)
    n = 0
    do row = 1, size(traction, 2)
      do col = 1, size(traction, 1)
        if (.not. any(abs(traction(col, row, :, :)) > 0.0_wp)) cycle
        n = n + 1
        index = real(lattice%first + [col, row] - 1, wp)
        self%position(n, :) = lattice%origin + matmul(lattice%basis, index)
        self%traction(n, 1::3) = traction(col, row, 1, :)
        self%traction(n, 2::3) = side*traction(col, row, 2, :)
        self%traction(n, 3::3) = side*traction(col, row, 3, :)
      end do
    end do
  end subroutine new_loaded_nodes

end module hc_interior_points
