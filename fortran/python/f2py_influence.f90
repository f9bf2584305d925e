!> Kernels of the pyramid and stress on planes for Python.
module hc_f2py_influence
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_memory, only: require_memory
  use hc_f2py_handles, only: kernel_cache
  use hc_lattice, only: lattice_t, equilateral_basis
  use hc_field_space, only: field_space_t, space_over
  use hc_pyramid_influence, only: pyramid_t, new_pyramid
  use hc_interior_planes, only: interior_planes_t, new_interior_planes, planes_memory
  use hc_spectrum_cache, only: kernel_cache_t
  implicit none
  private

  public :: evaluate_kernels, solve_planes

contains

  !> Compute the five kernels of the unit pyramid of the equilateral lattice at points.
  subroutine evaluate_kernels(x, y, kernels, error)
    !> Points relative to the node, in spacings
    real(wp), intent(in) :: x(:), y(:)
    !> K1, K_xx, K_xy, K_x, K_y at each point, in spacings
    real(wp), intent(inout) :: kernels(:, :)
    type(error_t), allocatable, intent(out) :: error
    type(pyramid_t) :: pyramid
    integer :: i

    if (.not. (all(ieee_is_finite(x)) .and. all(ieee_is_finite(y)))) then
      call raise(error, status%invalid_input, 'field points: finite coordinates expected')
      return
    end if
    call new_pyramid(pyramid, equilateral_basis(1.0_wp))
    !$omp parallel do schedule(static) if (size(x) > 256)
    do i = 1, size(x)
      kernels(:, i) = pyramid%kernels(x(i), y(i))
    end do
    !$omp end parallel do
  end subroutine evaluate_kernels

  !> Compute stress or displacement at the nodes of planes of a body, for a history of steps.
  subroutine solve_planes(lattice, traction, body, poisson_ratio, depth, threads, field, error)
    type(lattice_t), intent(in) :: lattice
    !> Pressure and traction on body 1 along x and y (n_col, n_row, 3, step) [Pa]
    real(wp), intent(in) :: traction(:, :, :, :)
    !> Number of the body and its Poisson's ratio
    integer, intent(in) :: body
    real(wp), intent(in) :: poisson_ratio
    !> Depths below the surface of the body [m]
    real(wp), intent(in) :: depth(:)
    integer, intent(in) :: threads
    !> Stress [Pa], or displacement times the shear modulus [Pa m] (n_col, n_row, component, depth, step)
    real(wp), intent(inout) :: field(:, :, :, :, :)
    type(error_t), allocatable, intent(out) :: error
    type(interior_planes_t) :: planes
    type(kernel_cache_t), pointer :: cache
    type(field_space_t) :: space
    integer :: i, step

    space = space_over([huge(1), 1], threads)
    call require_memory(planes_memory(lattice%extent, space%threads), error, space%threads)
    if (.not. allocated(error)) call new_interior_planes(planes, lattice, body, poisson_ratio, error, space, &
                                                         size(field, 3) == 3)
    ! of too many planes each would drop another one, and the surface, before it is used again
    cache => null()
    if (associated(kernel_cache) .and. .not. allocated(error)) then
      if (kernel_cache%holds(size(depth)*planes%spectra_memory())) cache => kernel_cache
    end if
    do i = 1, size(depth)
      if (.not. allocated(error)) call planes%set_depth(depth(i), error, cache)
      do step = 1, size(traction, 4)
        if (.not. allocated(error)) call planes%apply(traction(:, :, :, step), field(:, :, :, i, step), error)
      end do
    end do
  end subroutine solve_planes

end module hc_f2py_influence
