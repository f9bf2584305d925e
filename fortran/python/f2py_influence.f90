!> Influence functions for Python: flat procedures for f2py, no mathematics.
!>
!> Every procedure ends with an integer code (0: done, else one of hc_error's)
!> and a message. Nothing here keeps state, so that threads may call at will.
module hc_f2py_influence
  use iso_c_binding, only: c_double, c_int
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_f2py_handles, only: report
  use hc_lattice, only: equilateral_basis
  use hc_triangle_integrals, only: evaluate_integral, evaluate_displacement, evaluate_linear_displacement
  use hc_pyramid_influence, only: pyramid_t, new_pyramid
  use ieee_arithmetic, only: ieee_is_finite
  implicit none
  private

  public :: triangle_integral, triangle_displacement, linear_triangle_displacement, pyramid_kernels

contains

  !> I_jkm of a triangle at many points.
  subroutine triangle_integral(vertices, n, x, y, j, k, m, integral, code, message)
    !f2py threadsafe
    !> Vertices, as columns [m]
    real(c_double), intent(in) :: vertices(2, 3)
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Field points [m]
    real(c_double), intent(in) :: x(n), y(n)
    !> Exponents of 1/rho, x - xi, y - eta
    integer(c_int), intent(in) :: j, k, m
    !> Value at each point [m^(k+m+2-j)]
    real(c_double), intent(out) :: integral(n)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message

    type(error_t), allocatable :: error

    integral = 0.0_c_double
    call evaluate_integral(vertices, x, y, j, k, m, integral, error)
    call report(error, code, message)
  end subroutine triangle_integral

  !> Displacement by the load (x - xi)^k (y - eta)^m on a triangle at many points.
  subroutine triangle_displacement(vertices, n, x, y, direction, k, m, shear_modulus, poisson_ratio, u, code, message)
    !f2py threadsafe
    !> Vertices, as columns [m]
    real(c_double), intent(in) :: vertices(2, 3)
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Field points [m]
    real(c_double), intent(in) :: x(n), y(n)
    !> Direction of the load: 1 (x), 2 (y), 3 (normal)
    integer(c_int), intent(in) :: direction
    !> Degree of the load
    integer(c_int), intent(in) :: k, m
    !> Shear modulus [Pa], Poisson's ratio
    real(c_double), intent(in) :: shear_modulus, poisson_ratio
    !> Displacement along x, y, z at each point [m]
    real(c_double), intent(out) :: u(3, n)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message

    type(error_t), allocatable :: error

    u = 0.0_c_double
    call evaluate_displacement(vertices, x, y, direction, k, m, shear_modulus, poisson_ratio, u, error)
    call report(error, code, message)
  end subroutine triangle_displacement

  !> Displacement by tractions that vary linearly over a triangle at many points.
  subroutine linear_triangle_displacement(vertices, n, x, y, traction, shear_modulus, poisson_ratio, u, code, message)
    !f2py threadsafe
    !> Vertices, as columns [m]
    real(c_double), intent(in) :: vertices(2, 3)
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Field points [m]
    real(c_double), intent(in) :: x(n), y(n)
    !> Traction along x, y, z at the vertices (3, vertex) [Pa]
    real(c_double), intent(in) :: traction(3, 3)
    !> Shear modulus [Pa], Poisson's ratio
    real(c_double), intent(in) :: shear_modulus, poisson_ratio
    !> Displacement along x, y, z at each point [m]
    real(c_double), intent(out) :: u(3, n)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message

    type(error_t), allocatable :: error

    u = 0.0_c_double
    call evaluate_linear_displacement(vertices, x, y, traction, shear_modulus, poisson_ratio, u, error)
    call report(error, code, message)
  end subroutine linear_triangle_displacement

  !> The five kernels of the unit pyramid of the equilateral lattice at many points.
  subroutine pyramid_kernels(n, x, y, kernels, code, message)
    !f2py threadsafe
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Field points relative to the node, in spacings
    real(c_double), intent(in) :: x(n), y(n)
    !> K1, K_xx, K_xy, K_x, K_y at each point, in spacings
    real(c_double), intent(out) :: kernels(5, n)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message

    type(error_t), allocatable :: error
    type(pyramid_t) :: pyramid
    integer :: i

    kernels = 0.0_c_double
    if (.not. (all(ieee_is_finite(x)) .and. all(ieee_is_finite(y)))) then
      call raise(error, status%invalid_input, 'field points: finite coordinates expected')
    else
      call new_pyramid(pyramid, equilateral_basis(1.0_wp))
      !$omp parallel do schedule(static) if (n > 256)
      do i = 1, n
        kernels(:, i) = pyramid%kernels(x(i), y(i))
      end do
      !$omp end parallel do
    end if
    call report(error, code, message)
  end subroutine pyramid_kernels

end module hc_f2py_influence
