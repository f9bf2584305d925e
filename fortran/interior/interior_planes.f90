!> Stress or displacement at the nodes of planes parallel to the surface, by zero-padded convolution.
!>
!> At one depth the stress is a sum over lattice offsets with fifteen tables: six components of three loads less the
!> three that are equal by reciprocity, zz of q_a = az of p and xz of q_y = yz of q_x; the displacement is one with eight,
!> since x of q_y = y of q_x. However slowly they decay, the padded sum is exact. In a coated body zz of q_a is not az of p: the
!> stress has seventeen tables.
!>
!> Equations: docs/theory/interior.md, (I11).
module hc_interior_planes
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_memory, only: require_memory
  use hc_lattice, only: lattice_t, check_lattice
  use hc_field_space, only: field_space_t, space_over
  use hc_layer_response, only: layered_body_t
  use hc_interior_fields, only: check_interior, xx, yy, zz, xy, yz, xz
  use hc_depth_fields, only: depth_fields_t, new_depth_fields, check_inside
  use hc_interior_pyramid, only: interior_pyramid_t, new_interior_pyramid, most_points
  use hc_interior_points, only: check_body
  use hc_periodic_interior, only: periodic_interior_t, new_periodic_interior, periodic_memory
  use hc_fftw, only: good_size
  use hc_fft_layout, only: convolution_memory, transform_memory
  use hc_convolution, only: convolution_t, new_convolution, kernel_source_t
  use hc_spectrum, only: new_depth_key, of_stress, of_displacement
  use hc_spectrum_cache, only: kernel_cache_t
  implicit none
  private

  public :: interior_planes_t, new_interior_planes, planes_memory

  !> The tables of a quantity.
  type :: tables_t
    !> Kind of their spectra, number of components, and the first odd table
    integer :: kind = of_stress, n_component = 6, first_odd = 8
    !> Component and load of each table
    integer, allocatable :: component(:), load(:)
    !> Table of a component by each load
    integer, allocatable :: table(:, :)
    !> Sign of each table under x -> -x, which equilateral lattices have as a symmetry
    real(wp), allocatable :: mirror(:)
    !> Components that change their sign in body 2, whose frame is mirrored
    integer, allocatable :: turned(:)
  end type tables_t

  !> Planes of a window at any depth.
  type :: interior_planes_t
    private
    type(lattice_t) :: lattice
    type(interior_pyramid_t) :: pyramid
    type(convolution_t) :: convolution
    type(tables_t) :: tables
    integer :: body = 1
    type(layered_body_t) :: inside
    type(field_space_t) :: space
    !> Tractions in the frame of the body
    real(wp), allocatable :: loads(:, :, :)
  contains
    !> Bytes of the spectra of a plane
    procedure :: spectra_memory
    !> Take the tables of a depth
    procedure :: set_depth
    !> Stress or displacement at the nodes of the plane
    procedure :: apply
    !> The same at several depths for a history of load steps, also of a window that repeats
    procedure :: of_history
  end type interior_planes_t

  !> The tables at one depth.
  type, extends(kernel_source_t) :: plane_tables_t
    type(interior_pyramid_t) :: pyramid
    type(tables_t) :: tables
    real(wp) :: basis(2, 2) = 0.0_wp
    type(depth_fields_t) :: fields
    !> Longest edge [m]
    real(wp) :: spacing = 1.0_wp
    !> x -> -x maps the lattice to itself, column i of row j to -i - j
    logical :: mirrored = .false.
  contains
    procedure :: row => table_row
  end type plane_tables_t

contains

  !> Return the tables of the stress, or of the displacement.
  pure type(tables_t) function tables_of(displaced, coated)
    !> Of the displacement; of a coated body
    logical, intent(in) :: displaced, coated

    if (displaced) then
      tables_of%kind = of_displacement
      tables_of%n_component = 3
      tables_of%first_odd = 5
      tables_of%component = [3, 1, 2, 2, 1, 2, 3, 3]
      tables_of%load = [1, 2, 2, 3, 1, 1, 2, 3]
      tables_of%table = reshape([5, 6, 1, 2, 3, 7, 3, 4, 8], [3, 3])
      tables_of%mirror = real([1, 1, -1, 1, -1, 1, -1, 1], wp)
      tables_of%turned = [3]
    else if (coated) then
      tables_of%component = [xx, yy, zz, xy, xz, yz, yz, xz, yz, xx, yy, xy, zz, xx, yy, xy, zz]
      tables_of%load = [1, 1, 1, 1, 2, 2, 3, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3]
      tables_of%table = reshape([1, 2, 3, 4, 9, 8, 10, 11, 13, 12, 6, 5, 14, 15, 17, 16, 7, 6], [6, 3])
      tables_of%mirror = real([1, 1, 1, -1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1, 1, -1, 1], wp)
      tables_of%turned = [yz, xz]
    else
      tables_of%component = [xx, yy, zz, xy, xz, yz, yz, xz, yz, xx, yy, xy, xx, yy, xy]
      tables_of%load = [1, 1, 1, 1, 2, 2, 3, 1, 1, 2, 2, 2, 3, 3, 3]
      tables_of%table = reshape([1, 2, 3, 4, 9, 8, 10, 11, 8, 12, 6, 5, 13, 14, 9, 15, 7, 6], [6, 3])
      tables_of%mirror = real([1, 1, 1, -1, 1, -1, 1, -1, 1, -1, -1, 1, 1, 1, -1], wp)
      tables_of%turned = [yz, xz]
    end if
  end function tables_of

  !> Make plans and scratch space.
  subroutine new_interior_planes(planes, lattice, body, inside, error, space, displaced)
    !> Planes to be set up
    type(interior_planes_t), intent(out) :: planes
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Number of the body, 1 or 2
    integer, intent(in) :: body
    !> Its layers and the body below them
    type(layered_body_t), intent(in) :: inside
    !> Allocated on failure: a lattice of no use, no such body or material, not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Who shares the work; absent: as many threads as OpenMP would take
    type(field_space_t), intent(in), optional :: space
    !> Compute the displacement, not the stress
    logical, intent(in), optional :: displaced

    integer :: n_even, stat
    logical :: coated

    call check_lattice(lattice, error)
    if (.not. allocated(error)) call check_body(body, error)
    if (.not. allocated(error)) call check_interior([0.0_wp], [0.0_wp], [0.0_wp], inside%base%poisson_ratio, error)
    if (allocated(error)) return
    planes%space = space_over(lattice%extent)
    if (present(space)) planes%space = space
    coated = size(inside%layer) > 0
    planes%tables = tables_of(.false., coated)
    if (present(displaced)) planes%tables = tables_of(displaced, coated)
    planes%lattice = lattice
    planes%body = body
    planes%inside = inside
    if (lattice%is_periodic()) return
    call require_memory(planes_memory(lattice%extent, coated, planes%space%threads), error, planes%space%threads)
    if (allocated(error)) return
    call new_interior_pyramid(planes%pyramid, lattice%unit_basis(), sharp=coated)
    allocate (planes%loads(lattice%extent(1), lattice%extent(2), 3), stat=stat)
    if (stat /= 0) then
      call raise(error, status%resources, 'not enough memory for the stress: use a smaller window')
      return
    end if
    n_even = planes%tables%first_odd - 1
    call new_convolution(planes%convolution, lattice%extent, good_size(2*lattice%extent - 1), &
                         [n_even, size(planes%tables%load) - n_even], max(planes%tables%n_component, 3), planes%space, error)
  end subroutine new_interior_planes

  !> Bytes that planes take, the setting up of their tables included.
  pure integer(selected_int_kind(18)) function planes_memory(extent, coated, threads)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> The body has layers
    logical, intent(in) :: coated
    !> Threads to use
    integer, intent(in) :: threads
    integer, parameter :: long = selected_int_kind(18)
    integer :: n_table

    ! those of the stress, which are more
    n_table = merge(17, 15, coated)
    planes_memory = convolution_memory(extent, good_size(2*extent - 1), n_table, 6, threads) &
                    + transform_memory(extent, good_size(2*extent - 1), n_table) &
                    + 3*product(int(extent, long))*(storage_size(1.0_wp)/8)
  end function planes_memory

  !> Bytes of the spectra of a plane.
  pure integer(selected_int_kind(18)) function spectra_memory(self)
    class(interior_planes_t), intent(in) :: self
    integer, parameter :: long = selected_int_kind(18)

    associate (c => self%convolution)
      spectra_memory = product(int([c%width, c%padded(2), c%n_block, size(self%tables%load)], long))*(storage_size(1.0_wp)/8)
    end associate
  end function spectra_memory

  !> Take the tables of a depth, from a cache, or compute them.
  subroutine set_depth(self, depth, error, cache)
    class(interior_planes_t), intent(inout) :: self
    !> Depth below the surface of the body [m]
    real(wp), intent(in) :: depth
    !> Allocated on failure: a depth above the surface, not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Spectra that are kept
    type(kernel_cache_t), pointer, intent(in), optional :: cache

    type(plane_tables_t) :: source
    logical :: found

    call check_interior([0.0_wp], [0.0_wp], [depth], self%inside%base%poisson_ratio, error)
    if (.not. allocated(error)) call check_inside(self%inside, [depth], error)
    if (.not. allocated(error)) call new_depth_fields(source%fields, self%inside, depth, error)
    if (allocated(error)) return
    source%basis = self%lattice%unit_basis()
    source%spacing = self%lattice%spacing()
    source%pyramid = self%pyramid
    source%tables = self%tables
    source%mirrored = all(abs([source%basis(2, 1), source%basis(1, 2) - 0.5_wp*source%basis(1, 1)]) <= 0.0_wp)
    if (size(self%inside%layer) > 0) then
      call self%convolution%find_spectra(found, error)
      if (.not. allocated(error)) call self%convolution%transform_kernels(source, error)
      return
    end if
    associate (key => new_depth_key(self%tables%kind, self%lattice, depth/source%spacing, self%inside%base%poisson_ratio))
      call self%convolution%find_spectra(found, error, cache, key)
      if (found .or. allocated(error)) return
      call self%convolution%transform_kernels(source, error)
      if (.not. allocated(error)) call self%convolution%store_spectra(cache, key)
    end associate
  end subroutine set_depth

  !> Compute the stress, or displacement times the shear modulus, at the nodes of the plane.
  subroutine apply(self, traction, field, error)
    class(interior_planes_t), intent(inout) :: self
    !> Pressure and traction on body 1 along x and y (n_col, n_row, component) [Pa]
    real(wp), intent(in), contiguous :: traction(:, :, :)
    !> Stress [Pa] or displacement [Pa m] (n_col, n_row, component xx, yy, zz, xy, yz, xz or x, y, z)
    real(wp), intent(out), contiguous :: field(:, :, :)
    !> Allocated on failure: arrays of other shapes than the window
    type(error_t), allocatable, intent(out) :: error

    associate (n => self%lattice%extent, tables => self%tables)
      if (any(shape(traction) /= [n, 3]) .or. any(shape(field) /= [n, tables%n_component])) then
        call raise(error, status%invalid_input, 'the arrays do not have the shape of the lattice window')
        return
      end if
      self%loads(:, :, 1) = traction(:, :, 1)
      self%loads(:, :, 2:3) = merge(1.0_wp, -1.0_wp, self%body == 1)*traction(:, :, 2:3)
      call self%convolution%convolve(tables%table, self%loads, field)
      if (self%body == 2) field(:, :, tables%turned) = -field(:, :, tables%turned)
      if (tables%kind == of_displacement) field = self%lattice%spacing()*field
    end associate
  end subroutine apply

  !> Compute the stress, or displacement times the shear modulus, at the nodes of several planes for a history of steps.
  subroutine of_history(self, traction, depth, field, error, cache)
    class(interior_planes_t), intent(inout) :: self
    !> Pressure and traction on body 1 along x and y (n_col, n_row, component, step) [Pa]
    real(wp), intent(in), contiguous :: traction(:, :, :, :)
    !> Depths below the surface of the body [m]
    real(wp), intent(in) :: depth(:)
    !> Stress [Pa] or displacement [Pa m] (n_col, n_row, component, depth, step)
    real(wp), intent(inout) :: field(:, :, :, :, :)
    !> Allocated on failure: a depth above the surface, not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Spectra that are kept
    type(kernel_cache_t), pointer, intent(in) :: cache
    type(kernel_cache_t), pointer :: kept
    integer :: i, step

    if (self%lattice%is_periodic()) then
      call repeat_history(self, traction, depth, field, error)
      return
    end if
    ! too many planes evict spectra, also of the surface, that are still needed
    kept => null()
    if (associated(cache)) then
      if (cache%holds(size(depth)*self%spectra_memory())) kept => cache
    end if
    do i = 1, size(depth)
      if (.not. allocated(error)) call self%set_depth(depth(i), error, kept)
      do step = 1, size(traction, 4)
        if (.not. allocated(error)) call self%apply(traction(:, :, :, step), field(:, :, :, i, step), error)
      end do
    end do
  end subroutine of_history

  !> Compute `of_history` below a window that repeats.
  subroutine repeat_history(self, traction, depth, field, error)
    class(interior_planes_t), intent(in) :: self
    real(wp), intent(in) :: traction(:, :, :, :), depth(:)
    real(wp), intent(inout) :: field(:, :, :, :, :)
    type(error_t), allocatable, intent(out) :: error
    type(periodic_interior_t) :: repeating
    integer :: i

    call check_interior(0.0_wp*depth, 0.0_wp*depth, depth, self%inside%base%poisson_ratio, error)
    if (.not. allocated(error)) call check_inside(self%inside, depth, error)
    if (.not. allocated(error)) call require_memory(periodic_memory(self%lattice%extent, size(traction, 4)), error, &
                                                    self%space%threads)
    if (.not. allocated(error)) call new_periodic_interior(repeating, self%lattice, self%body, self%inside, traction, self%space, &
                                                           error)
    do i = 1, size(depth)
      if (.not. allocated(error)) call repeating%on_plane(depth(i), field(:, :, :, i, :), error)
    end do
    if (allocated(error) .or. self%body == 1) return
    field(:, :, self%tables%turned, :, :) = -field(:, :, self%tables%turned, :, :)
  end subroutine repeat_history

  pure subroutine table_row(self, j, k)
    class(plane_tables_t), intent(in) :: self
    integer, intent(in) :: j
    real(wp), intent(out) :: k(:, :)

    real(wp), allocatable :: u(:, :, :), s(:, :, :)
    real(wp) :: x(most_points), y(most_points)
    integer :: i, n, m, middle, first, t

    n = size(k, 2)/2
    middle = n + 1
    ! columns of which the mirror images are in the row, too, are copies
    first = -n
    if (self%mirrored) first = -(j/2)
    do while (first <= n)
      m = min(n - first + 1, most_points)
      do i = 1, m
        x(i) = (first + i - 1)*self%basis(1, 1) + j*self%basis(1, 2)
        y(i) = (first + i - 1)*self%basis(2, 1) + j*self%basis(2, 2)
      end do
      allocate (u(m, 3, 3), s(m, 6, 3))
      call self%fields%of_pyramid(self%pyramid, self%spacing, x(:m), y(:m), u, s)
      if (self%tables%kind == of_displacement) s(:, :3, :) = u
      do t = 1, size(k, 1)
        k(t, middle + first:middle + first + m - 1) = s(:, self%tables%component(t), self%tables%load(t))
      end do
      deallocate (u, s)
      first = first + m
    end do
    if (self%mirrored) then
      do i = -n, -(j/2) - 1
        k(:, middle + i) = self%tables%mirror*k(:, middle - i - j)
      end do
    end if
  end subroutine table_row

end module hc_interior_planes
