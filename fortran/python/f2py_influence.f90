!> Influence functions for Python: flat procedures for f2py, no mathematics.
!>
!> Every procedure ends with an integer code (0: done, else one of hc_error's)
!> and a message. The module has no state, so that several threads may call at a time.
module hc_f2py_influence
  use iso_c_binding, only: c_double, c_int
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_f2py_handles, only: report
  use hc_lattice, only: equilateral_basis
  use hc_triangle_integrals, only: evaluate_integral, evaluate_displacement, evaluate_linear_displacement
  use hc_pyramid_influence, only: pyramid_t, new_pyramid
  use hc_interior_pyramid, only: interior_pyramid_t, new_interior_pyramid
  use hc_interior_triangle, only: triangle_fields, mesh_fields
  use hc_load_shapes, only: load_potential, displacement_errors, pressure_errors
  use ieee_arithmetic, only: ieee_is_finite
  implicit none
  private

  public :: triangle_integral, triangle_displacement, linear_triangle_displacement, pyramid_kernels, pyramid_fields
  public :: triangle_interior, mesh_interior
  public :: potential_of_load, errors_of_displacement, errors_of_pressure

contains

  !> Compute I_jkm of a triangle at many points.
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

  !> Compute the displacement by the load (x - xi)^k (y - eta)^m on a triangle at many points.
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

  !> Compute the displacement by tractions that vary linearly over a triangle at many points.
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

  !> Compute the five kernels of the unit pyramid of the equilateral lattice at many points.
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

  !> Compute displacement and stress below the surface by the unit pyramid of the equilateral lattice at many points.
  subroutine pyramid_fields(n, x, y, z, poisson_ratio, displacement, stress, code, message)
    !f2py threadsafe
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Field points relative to the node, in spacings; Poisson's ratio
    real(c_double), intent(in) :: x(n), y(n), z(n), poisson_ratio
    !> Displacement times the shear modulus (direction, load, point), in spacings
    real(c_double), intent(out) :: displacement(3, 3, n)
    !> Stress (component, load, point)
    real(c_double), intent(out) :: stress(6, 3, n)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message

    type(error_t), allocatable :: error
    type(interior_pyramid_t) :: pyramid

    displacement = 0.0_c_double
    stress = 0.0_c_double
    call new_interior_pyramid(pyramid, equilateral_basis(1.0_wp))
    call pyramid%fields(x, y, z, poisson_ratio, displacement, stress, error)
    call report(error, code, message)
  end subroutine pyramid_fields

  !> Compute displacement and stress below the surface by a linear load on a triangle, in each of the three directions.
  subroutine triangle_interior(vertices, values, n, x, y, z, poisson_ratio, displacement, stress, code, message)
    !f2py threadsafe
    !> Vertices, as columns, and the load there
    real(c_double), intent(in) :: vertices(2, 3), values(3)
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Field points; Poisson's ratio
    real(c_double), intent(in) :: x(n), y(n), z(n), poisson_ratio
    !> Displacement times the shear modulus (direction, load, point)
    real(c_double), intent(out) :: displacement(3, 3, n)
    !> Stress (component, load, point)
    real(c_double), intent(out) :: stress(6, 3, n)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message

    type(error_t), allocatable :: error

    displacement = 0.0_c_double
    stress = 0.0_c_double
    call triangle_fields(vertices, values, x, y, z, poisson_ratio, displacement, stress, error)
    call report(error, code, message)
  end subroutine triangle_interior

  !> Compute displacement and stress below the surface by tractions that are linear on each triangle of a set.
  subroutine mesh_interior(n_triangle, vertices, tractions, n, x, y, z, poisson_ratio, displacement, stress, code, message)
    !f2py threadsafe
    !> Number of triangles
    integer(c_int), intent(in) :: n_triangle
    !> Vertices (direction, vertex, triangle) and tractions (p, q_x, q_y; vertex; triangle)
    real(c_double), intent(in) :: vertices(2, 3, n_triangle), tractions(3, 3, n_triangle)
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Field points; Poisson's ratio
    real(c_double), intent(in) :: x(n), y(n), z(n), poisson_ratio
    !> Displacement times the shear modulus (direction, point)
    real(c_double), intent(out) :: displacement(3, n)
    !> Stress (component, point)
    real(c_double), intent(out) :: stress(6, n)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message

    type(error_t), allocatable :: error

    displacement = 0.0_c_double
    stress = 0.0_c_double
    call mesh_fields(vertices, tractions, x, y, z, poisson_ratio, displacement, stress, error)
    call report(error, code, message)
  end subroutine mesh_interior

  !> Compute the potential of a load on a node.
  subroutine potential_of_load(shape_number, n, x, y, potential, code, message)
    !f2py threadsafe
    !> 1: point force, 2: constant on the cell, 3: pyramid
    integer(c_int), intent(in) :: shape_number
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Points relative to the node, in spacings
    real(c_double), intent(in) :: x(n), y(n)
    !> Integral of the load over the distance
    real(c_double), intent(out) :: potential(n)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error

    potential = load_potential(shape_number, x, y)
    call report(error, code, message)
  end subroutine potential_of_load

  !> Compute the errors of the displacement in Hertz's contact.
  subroutine errors_of_displacement(shape_number, radius, n, x, y, errors, code, message)
    !f2py threadsafe
    !> 1: point force, 2: constant on the cell, 3: pyramid
    integer(c_int), intent(in) :: shape_number
    !> Contact radius, in spacings
    real(c_double), intent(in) :: radius
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Points, in spacings
    real(c_double), intent(in) :: x(n), y(n)
    !> Errors over the approach
    real(c_double), intent(out) :: errors(n)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error

    errors = displacement_errors(shape_number, radius, x, y)
    call report(error, code, message)
  end subroutine errors_of_displacement

  !> Compute the largest errors of Hertz's pressure between the nodes.
  subroutine errors_of_pressure(radius, errors)
    !f2py threadsafe
    !> Contact radius, in spacings
    real(c_double), intent(in) :: radius
    !> Of a pressure that is constant on cells, and linear between the nodes, over its peak
    real(c_double), intent(out) :: errors(2)
    errors = pressure_errors(radius)
  end subroutine errors_of_pressure

end module hc_f2py_influence
