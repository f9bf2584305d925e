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
  use hc_layer_response, only: layer_t, layered_body_t
  use hc_depth_fields, only: check_inside
  use hc_interior_fields, only: check_interior, yz, xz
  use hc_interior_points, only: check_body
  use hc_periodic_interior, only: periodic_interior_t, new_periodic_interior, periodic_memory
  use hc_interior_planes, only: interior_planes_t, new_interior_planes, planes_memory
  use hc_spectrum_cache, only: kernel_cache_t
  implicit none
  private

  public :: evaluate_kernels, solve_planes, stack_of

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

  !> Return a body of its layers.
  pure type(layered_body_t) function stack_of(layers) result(body)
    !> Thickness [m], shear modulus [Pa] and Poisson's ratio, outermost first; last the body below, rigid if its modulus is 0
    real(wp), intent(in) :: layers(:, :)
    integer :: i

    associate (n => size(layers, 2))
      allocate (body%layer(n - 1))
      do i = 1, n - 1
        body%layer(i) = layer_t(layers(1, i), layers(2, i), layers(3, i))
      end do
      body%base = layer_t(0.0_wp, layers(2, n), layers(3, n))
    end associate
  end function stack_of

  !> Compute stress or displacement at the nodes of planes of a body, for a history of steps.
  subroutine solve_planes(lattice, traction, body, inside, depth, threads, field, error)
    type(lattice_t), intent(in) :: lattice
    !> Pressure and traction on body 1 along x and y (n_col, n_row, 3, step) [Pa]
    real(wp), intent(in) :: traction(:, :, :, :)
    !> Number of the body
    integer, intent(in) :: body
    !> Its layers and the body below them
    type(layered_body_t), intent(in) :: inside
    !> Depths below the surface of the body [m]
    real(wp), intent(in) :: depth(:)
    integer, intent(in) :: threads
    !> Stress [Pa], or displacement times the shear modulus of the surface [Pa m] (n_col, n_row, component, depth, step)
    real(wp), intent(inout) :: field(:, :, :, :, :)
    type(error_t), allocatable, intent(out) :: error
    type(interior_planes_t) :: planes
    type(kernel_cache_t), pointer :: cache
    type(field_space_t) :: space
    integer :: i, step

    space = space_over([huge(1), 1], threads)
    if (lattice%is_periodic()) then
      call solve_periodic_planes(lattice, traction, body, inside, depth, space, field, error)
      return
    end if
    call require_memory(planes_memory(lattice%extent, size(inside%layer) > 0, space%threads), error, space%threads)
    if (.not. allocated(error)) call new_interior_planes(planes, lattice, body, inside, error, space, size(field, 3) == 3)
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

  !> Compute them below a window that repeats.
  subroutine solve_periodic_planes(lattice, traction, body, inside, depth, space, field, error)
    type(lattice_t), intent(in) :: lattice
    real(wp), intent(in) :: traction(:, :, :, :)
    integer, intent(in) :: body
    type(layered_body_t), intent(in) :: inside
    real(wp), intent(in) :: depth(:)
    type(field_space_t), intent(in) :: space
    real(wp), intent(inout) :: field(:, :, :, :, :)
    type(error_t), allocatable, intent(out) :: error
    type(periodic_interior_t) :: repeating
    integer :: i

    call check_body(body, error)
    if (.not. allocated(error)) call check_interior(0.0_wp*depth, 0.0_wp*depth, depth, inside%base%poisson_ratio, error)
    if (.not. allocated(error)) call check_inside(inside, depth, error)
    if (.not. allocated(error)) call require_memory(periodic_memory(lattice%extent, size(traction, 4)), error, space%threads)
    if (.not. allocated(error)) call new_periodic_interior(repeating, lattice, body, inside, traction, space, error)
    do i = 1, size(depth)
      if (.not. allocated(error)) call repeating%on_plane(depth(i), field(:, :, :, i, :), error)
    end do
    if (body == 1 .or. allocated(error)) return
    if (size(field, 3) == 3) field(:, :, 3, :, :) = -field(:, :, 3, :, :)
    if (size(field, 3) == 6) field(:, :, [yz, xz], :, :) = -field(:, :, [yz, xz], :, :)
  end subroutine solve_periodic_planes

end module hc_f2py_influence
