!> Displacement and stress below the surface for Python: flat procedures for f2py, no mathematics.
!>
!> Every procedure ends with an integer code (0: done, else one of hc_error's) and a message.
module hc_f2py_interior
  use iso_c_binding, only: c_double, c_int, c_int64_t
  use hc_error, only: error_t
  use hc_memory, only: require_memory
  use hc_lattice, only: lattice_t, new_lattice
  use hc_field_space, only: field_space_t, space_over
  use hc_interior_points, only: fields_at_points
  use hc_interior_planes, only: interior_planes_t, new_interior_planes, planes_memory
  use hc_stress_invariants, only: stress_invariants
  use hc_f2py_handles, only: report, kernel_cache
  use hc_spectrum_cache, only: kernel_cache_t
  implicit none
  private

  public :: interior_at_points, interior_on_planes, memory_of_planes, invariants_of_stress

contains

  !> Compute displacement and stress at points of a body, for a history of steps.
  subroutine interior_at_points(n_col, n_row, n_step, n_point, basis, start, traction, body, poisson_ratio, x, y, depth, &
                                threads, displacement, stress, code, message)
    !f2py threadsafe
    !> Number of columns and rows, of load steps, of points
    integer(c_int), intent(in) :: n_col, n_row, n_step, n_point
    !> Basis vectors as columns, position of the first node [m]
    real(c_double), intent(in) :: basis(2, 2), start(2)
    !> Pressure and traction on body 1 along x and y [Pa]
    real(c_double), intent(in) :: traction(n_col, n_row, 3, n_step)
    !> Number of the body and its Poisson's ratio
    integer(c_int), intent(in) :: body
    real(c_double), intent(in) :: poisson_ratio
    !> Points and their depths below the surface of the body [m]
    real(c_double), intent(in) :: x(n_point), y(n_point), depth(n_point)
    !> Threads to use; 0: as many as OpenMP would take
    integer(c_int), intent(in) :: threads
    !> Displacement times the shear modulus (direction, point, step) [Pa m]
    real(c_double), intent(out) :: displacement(3, n_point, n_step)
    !> Stress (component, point, step) [Pa]
    real(c_double), intent(out) :: stress(6, n_point, n_step)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(lattice_t) :: lattice

    displacement = 0.0_c_double
    stress = 0.0_c_double
    call new_lattice(lattice, basis, [0, 0], [n_col, n_row], error, start)
    if (.not. allocated(error)) then
      call fields_at_points(lattice, traction, body, poisson_ratio, x, y, depth, displacement, stress, error, &
                            space_for(threads))
    end if
    call report(error, code, message)
  end subroutine interior_at_points

  !> Compute stress or displacement at the nodes of planes of a body, for a history of steps.
  subroutine interior_on_planes(n_col, n_row, n_step, n_depth, n_component, basis, start, traction, body, poisson_ratio, &
                                depth, threads, field, code, message)
    !f2py threadsafe
    !> Number of columns and rows, of load steps, of planes; 6 components are those of the stress, 3 of the displacement
    integer(c_int), intent(in) :: n_col, n_row, n_step, n_depth, n_component
    !> Basis vectors as columns, position of the first node [m]
    real(c_double), intent(in) :: basis(2, 2), start(2)
    !> Pressure and traction on body 1 along x and y [Pa]
    real(c_double), intent(in) :: traction(n_col, n_row, 3, n_step)
    !> Number of the body and its Poisson's ratio
    integer(c_int), intent(in) :: body
    real(c_double), intent(in) :: poisson_ratio
    !> Depths below the surface of the body [m]
    real(c_double), intent(in) :: depth(n_depth)
    !> Threads to use; 0: as many as OpenMP would take
    integer(c_int), intent(in) :: threads
    !> Stress [Pa], or displacement times the shear modulus [Pa m]
    real(c_double), intent(out) :: field(n_col, n_row, n_component, n_depth, n_step)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(lattice_t) :: lattice
    type(interior_planes_t) :: planes
    type(kernel_cache_t), pointer :: cache
    type(field_space_t) :: space
    integer :: i, step

    field = 0.0_c_double
    call new_lattice(lattice, basis, [0, 0], [n_col, n_row], error, start)
    space = space_for(threads)
    if (.not. allocated(error)) call require_memory(planes_memory(lattice%extent, space%threads), error, space%threads)
    if (.not. allocated(error)) call new_interior_planes(planes, lattice, body, poisson_ratio, error, space, &
                                                         n_component == 3)
    ! of too many planes each would drop another one, and the surface, before it is used again
    cache => null()
    if (associated(kernel_cache) .and. .not. allocated(error)) then
      if (kernel_cache%holds(n_depth*planes%spectra_memory())) cache => kernel_cache
    end if
    do i = 1, n_depth
      if (.not. allocated(error)) call planes%set_depth(depth(i), error, cache)
      do step = 1, n_step
        if (.not. allocated(error)) call planes%apply(traction(:, :, :, step), field(:, :, :, i, step), error)
      end do
    end do
    call report(error, code, message)
  end subroutine interior_on_planes

  !> Count the bytes that planes of a window take besides their results.
  subroutine memory_of_planes(n_col, n_row, threads, bytes)
    !> Number of columns and rows; threads to use, 0: as many as OpenMP would take
    integer(c_int), intent(in) :: n_col, n_row, threads
    integer(c_int64_t), intent(out) :: bytes
    type(field_space_t) :: space

    space = space_for(threads)
    bytes = planes_memory([n_col, n_row], space%threads)
  end subroutine memory_of_planes

  !> Compute principal stresses, the largest first, and the equivalent stresses of von Mises and Tresca.
  subroutine invariants_of_stress(n, stress, scalars)
    !f2py threadsafe
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Stress (component, point) [Pa]
    real(c_double), intent(in) :: stress(6, n)
    !> Principal stresses 1 to 3, von Mises, Tresca (scalar, point) [Pa]
    real(c_double), intent(out) :: scalars(5, n)

    call stress_invariants(stress, scalars)
  end subroutine invariants_of_stress

  !> Return the space of a number of threads.
  type(field_space_t) function space_for(threads) result(space)
    integer(c_int), intent(in) :: threads
    space = space_over([huge(1), 1], threads)
  end function space_for

end module hc_f2py_interior
