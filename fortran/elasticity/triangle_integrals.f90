!> Surface integrals over a triangle and the displacements of triangle loads.
!>
!>     I_jkm = iint (x - xi)^k (y - eta)^m / rho^j dxi deta      (4.5), (4.7)
!>
!> over a triangle of either orientation, for a field point (x, y) anywhere on
!> the surface: inside, outside, on an edge, at a vertex, on the prolongation of
!> an edge. Supported are j = 1, 2, 3 with 1 <= k + m + 2 - j <= 3, which serves
!> loads up to the second degree. The error is below 1e-13 of
!> I_100 d^(k+m+1-j), d the distance of the farthest vertex, which bounds I_jkm.
!>
!> Up to 1.5 longest edges from the centroid: edge form, in extended precision
!> for slivers; a compiler that has none (flang) loses there as many digits as
!> the aspect ratio has. Beyond: the edges cancel, and a conical product rule of
!> 12 x 12 Gauss points is exact to rounding. A triangle without area gives zero.
!>
!> The pure procedures expect valid arguments; evaluate_* check them, work on
!> many points at a time, and share the points out over threads.
!>
!> Equations: docs/theory/elasticity.md, (E1), (E2).
module hc_triangle_integrals
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_value, ieee_quiet_nan
  use hc_precision, only: wp, xp, pi
  use hc_error, only: error_t, status, raise
  use hc_conical_rule, only: n_node, node_1, node_2, node_3, node, one, node_weight
  use hc_edge_form, only: edge_form, vertex_loads, twice_area
  use hc_edge_form_extended, only: edge_form_extended => edge_form, &
    vertex_loads_extended => vertex_loads, twice_area_extended => twice_area
  implicit none
  private

  public :: triangle_integral, triangle_integrals, is_supported
  public :: vertex_kernels, load_displacement, linear_load_displacement
  public :: evaluate_integral, evaluate_displacement, evaluate_linear_displacement, check_points

  !> Exponents (j, k, m) of the six kernels of the point loads (3.10)-(3.18):
  !> 1/rho, x/rho^2, y/rho^2, x^2/rho^3, x y/rho^3, y^2/rho^3.
  integer, parameter :: kernel(3, 6) = reshape([1, 0, 0, 2, 1, 0, 2, 0, 1, 3, 2, 0, 3, 1, 1, 3, 0, 2], [3, 6])

  !> From here on, in longest edges from the centroid, quadrature replaces the edge form.
  real(wp), parameter :: far_distance = 1.5_wp
  !> Longest edge over the height from which a triangle is a sliver.
  real(wp), parameter :: sliver_aspect = 8.0_wp

  !> A triangle seen from a field point, scaled to a size of 1 or so.
  type :: view_t
    !> Lengths are in units of 2**unit
    integer :: unit = 0
    !> Vertices relative to the field point, as columns
    real(wp) :: corner(2, 3) = 0.0_wp
    !> The same with all digits; set if near and sliver
    real(xp) :: corner_extended(2, 3) = 0.0_xp
    !> Area, not negative
    real(wp) :: area = 0.0_wp
    !> Beyond far_distance
    logical :: far = .false.
    !> Beyond sliver_aspect
    logical :: sliver = .false.
  end type view_t

contains

  !> Return whether I_jkm is one of the 27 integrals of this module.
  elemental logical function is_supported(j, k, m)
    !> Exponents of 1/rho, x - xi, y - eta
    integer, intent(in) :: j, k, m

    is_supported = j >= 1 .and. j <= 3 .and. k >= 0 .and. m >= 0 .and. k + m + 2 - j >= 1 .and. k + m + 2 - j <= 3
  end function is_supported

  !> Compute I_jkm; NaN for exponents that are not supported.
  pure real(wp) function triangle_integral(vertices, x, y, j, k, m)
    !> Vertices, as columns [m]
    real(wp), intent(in) :: vertices(2, 3)
    !> Field point [m]
    real(wp), intent(in) :: x, y
    !> Exponents of 1/rho, x - xi, y - eta
    integer, intent(in) :: j, k, m

    real(wp) :: integral(1)

    if (is_supported(j, k, m)) then
      integral = triangle_integrals(vertices, x, y, reshape([j, k, m], [3, 1]))
      triangle_integral = integral(1)
    else
      triangle_integral = ieee_value(1.0_wp, ieee_quiet_nan)
    end if
  end function triangle_integral

  !> Compute several I_jkm of one triangle and field point.
  pure function triangle_integrals(vertices, x, y, exponents) result(integral)
    !> Vertices, as columns [m]
    real(wp), intent(in) :: vertices(2, 3)
    !> Field point [m]
    real(wp), intent(in) :: x, y
    !> Columns (j, k, m), all of them supported
    integer, intent(in) :: exponents(:, :)
    !> Value for each column [m^(k+m+2-j)]
    real(wp) :: integral(size(exponents, 2))

    type(view_t) :: view

    view = seen_from(vertices, x, y)
    if (.not. view%area > 0.0_wp) then
      integral = 0.0_wp
    else if (view%far) then
      integral = view%area*reshape(quadrature(view, one, exponents), shape(integral))
    else if (view%sliver) then
      integral = real(edge_form_extended(view%corner_extended, exponents), wp)
    else
      integral = edge_form(view%corner, exponents)
    end if
    integral = scale(integral, view%unit*(exponents(2, :) + exponents(3, :) + 2 - exponents(1, :)))
  end function triangle_integrals

  !> Compute the six kernels of the point loads, integrated with the linear loads that
  !> are 1 at one vertex and 0 at the two others.
  pure function vertex_kernels(vertices, x, y) result(kernels)
    !> Vertices, as columns [m]
    real(wp), intent(in) :: vertices(2, 3)
    !> Field point [m]
    real(wp), intent(in) :: x, y
    !> Kernels 1/rho, x/rho^2, y/rho^2, x^2/rho^3, x y/rho^3, y^2/rho^3 (6, vertex) [m]
    real(wp) :: kernels(6, 3)

    !> The kernels times 1, x - xi, y - eta
    integer, parameter :: exponents(3, 18) = reshape([ &
      kernel, &
      kernel + spread([0, 1, 0], 2, 6), &
      kernel + spread([0, 0, 1], 2, 6)], [3, 18])
    type(view_t) :: view

    view = seen_from(vertices, x, y)
    if (.not. view%area > 0.0_wp) then
      kernels = 0.0_wp
    else if (view%far) then
      kernels = view%area*quadrature(view, node, kernel)
    else if (view%sliver) then
      kernels = real(matmul(reshape(edge_form_extended(view%corner_extended, exponents), [6, 3]), &
                            vertex_loads_extended(view%corner_extended)), wp)
    else
      kernels = matmul(reshape(edge_form(view%corner, exponents), [6, 3]), vertex_loads(view%corner))
    end if
    kernels = scale(kernels, view%unit)
  end function vertex_kernels

  !> Compute the displacement by the load (x - xi)^k (y - eta)^m in one direction on a
  !> triangle: the lines of Tables 4.1 and 4.2, with k, m = 0 or 1.
  pure function load_displacement(vertices, x, y, direction, k, m, shear_modulus, poisson_ratio) result(u)
    !> Vertices, as columns [m]
    real(wp), intent(in) :: vertices(2, 3)
    !> Field point [m]
    real(wp), intent(in) :: x, y
    !> Direction of the load: 1, 2 tangential along x, y; 3 normal, into the body
    integer, intent(in) :: direction
    !> Degree of the load in x - xi and in y - eta, not negative, k + m <= 2
    integer, intent(in) :: k, m
    !> Shear modulus [Pa]
    real(wp), intent(in) :: shear_modulus
    !> Poisson's ratio
    real(wp), intent(in) :: poisson_ratio
    !> Displacement along x, y, z for a load of 1 Pa/m^(k+m) [m]
    real(wp) :: u(3)

    real(wp) :: kernels(6, 3)

    kernels = 0.0_wp
    kernels(:, direction) = triangle_integrals(vertices, x, y, kernel + spread([0, k, m], 2, 6))
    u = displacement(kernels, shear_modulus, poisson_ratio)
  end function load_displacement

  !> Compute the displacement by tractions that vary linearly over a triangle.
  pure function linear_load_displacement(vertices, x, y, traction, shear_modulus, poisson_ratio) result(u)
    !> Vertices, as columns [m]
    real(wp), intent(in) :: vertices(2, 3)
    !> Field point [m]
    real(wp), intent(in) :: x, y
    !> Traction along x, y, z at the vertices (3, vertex) [Pa]
    real(wp), intent(in) :: traction(3, 3)
    !> Shear modulus [Pa]
    real(wp), intent(in) :: shear_modulus
    !> Poisson's ratio
    real(wp), intent(in) :: poisson_ratio
    !> Displacement along x, y, z [m]
    real(wp) :: u(3)

    real(wp) :: kernels(6, 3)

    kernels = vertex_kernels(vertices, x, y)
    kernels = matmul(kernels, transpose(traction))
    u = displacement(kernels, shear_modulus, poisson_ratio)
  end function linear_load_displacement

  !> Evaluate I_jkm at many points.
  subroutine evaluate_integral(vertices, x, y, j, k, m, integral, error)
    !> Vertices, as columns [m]
    real(wp), intent(in) :: vertices(2, 3)
    !> Field points [m]
    real(wp), intent(in) :: x(:), y(:)
    !> Exponents of 1/rho, x - xi, y - eta
    integer, intent(in) :: j, k, m
    !> Value at each point [m^(k+m+2-j)]
    real(wp), intent(out) :: integral(:)
    !> Allocated on failure: exponents not supported, coordinates not finite, sizes differ
    type(error_t), allocatable, intent(out) :: error

    character(len=120) :: message
    integer :: i

    call check_points(x, y, size(integral), error, vertices)
    if (allocated(error)) return
    if (.not. is_supported(j, k, m)) then
      write (message, '(a,3(i0,a))') 'triangle integral (j, k, m) = (', j, ', ', k, ', ', m, &
        '): j = 1, 2 or 3, k, m >= 0 and 1 <= k + m + 2 - j <= 3 expected'
      call raise(error, status%invalid_input, trim(message))
      return
    end if
    !$omp parallel do schedule(static) if (size(x) > 256)
    do i = 1, size(x)
      integral(i) = triangle_integral(vertices, x(i), y(i), j, k, m)
    end do
    !$omp end parallel do
  end subroutine evaluate_integral

  !> Evaluate load_displacement at many points.
  subroutine evaluate_displacement(vertices, x, y, direction, k, m, shear_modulus, poisson_ratio, u, error)
    !> Vertices, as columns [m]
    real(wp), intent(in) :: vertices(2, 3)
    !> Field points [m]
    real(wp), intent(in) :: x(:), y(:)
    !> Direction of the load: 1, 2 tangential along x, y; 3 normal, into the body
    integer, intent(in) :: direction
    !> Degree of the load in x - xi and in y - eta, not negative, k + m <= 2
    integer, intent(in) :: k, m
    !> Shear modulus [Pa]
    real(wp), intent(in) :: shear_modulus
    !> Poisson's ratio
    real(wp), intent(in) :: poisson_ratio
    !> Displacement along x, y, z at each point for a load of 1 Pa/m^(k+m) [m]
    real(wp), intent(out) :: u(:, :)
    !> Allocated on failure: an argument out of range, coordinates not finite, sizes differ
    type(error_t), allocatable, intent(out) :: error

    integer :: i

    call check_points(x, y, size(u, 2), error, vertices)
    if (.not. allocated(error)) call check_material(shear_modulus, poisson_ratio, error)
    if (allocated(error)) return
    if (direction < 1 .or. direction > 3) then
      call raise(error, status%invalid_input, 'direction of a triangle load: 1 (x), 2 (y) or 3 (normal) expected')
    else if (k < 0 .or. m < 0 .or. k + m > 2) then
      call raise(error, status%invalid_input, &
                 'degree of a triangle load (k, m): not negative and k + m at most 2 expected')
    end if
    if (allocated(error)) return
    !$omp parallel do schedule(static) if (size(x) > 256)
    do i = 1, size(x)
      u(:, i) = load_displacement(vertices, x(i), y(i), direction, k, m, shear_modulus, poisson_ratio)
    end do
    !$omp end parallel do
  end subroutine evaluate_displacement

  !> Evaluate linear_load_displacement at many points.
  subroutine evaluate_linear_displacement(vertices, x, y, traction, shear_modulus, poisson_ratio, u, error)
    !> Vertices, as columns [m]
    real(wp), intent(in) :: vertices(2, 3)
    !> Field points [m]
    real(wp), intent(in) :: x(:), y(:)
    !> Traction along x, y, z at the vertices (3, vertex) [Pa]
    real(wp), intent(in) :: traction(3, 3)
    !> Shear modulus [Pa]
    real(wp), intent(in) :: shear_modulus
    !> Poisson's ratio
    real(wp), intent(in) :: poisson_ratio
    !> Displacement along x, y, z at each point [m]
    real(wp), intent(out) :: u(:, :)
    !> Allocated on failure: an argument out of range or not finite, sizes differ
    type(error_t), allocatable, intent(out) :: error

    integer :: i

    call check_points(x, y, size(u, 2), error, vertices)
    if (.not. allocated(error)) call check_material(shear_modulus, poisson_ratio, error)
    if (allocated(error)) return
    if (.not. all(ieee_is_finite(traction))) then
      call raise(error, status%invalid_input, 'tractions at the vertices of a triangle: finite numbers expected')
      return
    end if
    !$omp parallel do schedule(static) if (size(x) > 256)
    do i = 1, size(x)
      u(:, i) = linear_load_displacement(vertices, x(i), y(i), traction, shear_modulus, poisson_ratio)
    end do
    !$omp end parallel do
  end subroutine evaluate_linear_displacement

  !> Return the triangle relative to a field point.
  pure function seen_from(vertices, x, y) result(view)
    !> Vertices, as columns [m]
    real(wp), intent(in) :: vertices(2, 3)
    !> Field point [m]
    real(wp), intent(in) :: x, y
    type(view_t) :: view

    real(wp) :: edge(2, 3), longest, centroid(2)
    real(xp) :: exact(2, 3)

    view%corner(1, :) = vertices(1, :) - x
    view%corner(2, :) = vertices(2, :) - y
    view%unit = exponent(maxval(abs(view%corner)))
    view%corner = scale(view%corner, -view%unit)
    ! differences of the vertices themselves: the corners are rounded
    edge = scale(cshift(vertices, 1, dim=2) - vertices, -view%unit)
    longest = sqrt(maxval(edge(1, :)**2 + edge(2, :)**2))
    centroid = sum(view%corner, dim=2)/3.0_wp
    view%far = hypot(centroid(1), centroid(2)) >= far_distance*longest
    view%area = 0.5_wp*abs(edge(1, 1)*edge(2, 2) - edge(2, 1)*edge(1, 2))
    view%sliver = 2.0_wp*sliver_aspect*view%area < longest**2
    if (.not. view%sliver) return

    exact = scale(real(vertices, xp), -view%unit)
    view%area = real(0.5_xp*abs(twice_area_extended(exact)), wp)
    view%corner_extended(1, :) = exact(1, :) - scale(real(x, xp), -view%unit)
    view%corner_extended(2, :) = exact(2, :) - scale(real(y, xp), -view%unit)
  end function seen_from

  !> Average load times (x - xi)^k (y - eta)^m / rho^j over the triangle.
  pure function quadrature(view, load, exponents) result(mean)
    !> Triangle, far from the field point
    type(view_t), intent(in) :: view
    !> Loads at the nodes of the rule, one in each column
    real(wp), intent(in) :: load(:, :)
    !> Columns (j, k, m), all of them supported
    integer, intent(in) :: exponents(:, :)
    !> Value for each column of exponents and each load
    real(wp) :: mean(size(exponents, 2), size(load, 2))

    !> Powers of the direction cosines of (x - xi, y - eta) and of rho
    real(wp) :: cosine(n_node, 0:4), sine(n_node, 0:4), rho(n_node, -1:1)
    real(wp) :: integrand(n_node)
    integer :: e, i

    cosine(:, 1) = -(node_1*view%corner(1, 1) + node_2*view%corner(1, 2) + node_3*view%corner(1, 3))
    sine(:, 1) = -(node_1*view%corner(2, 1) + node_2*view%corner(2, 2) + node_3*view%corner(2, 3))
    rho(:, 1) = sqrt(cosine(:, 1)**2 + sine(:, 1)**2)
    rho(:, 0) = 1.0_wp
    rho(:, -1) = 1.0_wp/rho(:, 1)
    cosine(:, 0) = 1.0_wp
    cosine(:, 1) = cosine(:, 1)*rho(:, -1)
    sine(:, 0) = 1.0_wp
    sine(:, 1) = sine(:, 1)*rho(:, -1)
    do e = 2, maxval(exponents(2:, :))
      cosine(:, e) = cosine(:, e - 1)*cosine(:, 1)
      sine(:, e) = sine(:, e - 1)*sine(:, 1)
    end do
    do e = 1, size(exponents, 2)
      associate (j => exponents(1, e), k => exponents(2, e), m => exponents(3, e))
        integrand = node_weight*cosine(:, k)*sine(:, m)*rho(:, k + m - j)
      end associate
      do i = 1, size(load, 2)
        mean(e, i) = dot_product(integrand, load(:, i))
      end do
    end do
  end function quadrature

  !> Compute the displacement from the integrals of the six kernels with the load.
  !> z points into the body, and loads act along the axes: (3.13)-(3.15), (3.19)-(3.21).
  pure function displacement(kernels, shear_modulus, poisson_ratio) result(u)
    !> Kernels times the load along x, y, z (6, direction of the load)
    real(wp), intent(in) :: kernels(6, 3)
    !> Shear modulus
    real(wp), intent(in) :: shear_modulus
    !> Poisson's ratio
    real(wp), intent(in) :: poisson_ratio
    !> Displacement along x, y, z
    real(wp) :: u(3)

    real(wp) :: a, b, c

    a = (1.0_wp - poisson_ratio)/(2.0_wp*pi*shear_modulus)
    b = (1.0_wp - 2.0_wp*poisson_ratio)/(4.0_wp*pi*shear_modulus)
    c = poisson_ratio/(2.0_wp*pi*shear_modulus)
    u(1) = a*kernels(1, 1) + c*(kernels(4, 1) + kernels(5, 2)) - b*kernels(2, 3)
    u(2) = a*kernels(1, 2) + c*(kernels(5, 1) + kernels(6, 2)) - b*kernels(3, 3)
    u(3) = a*kernels(1, 3) + b*(kernels(2, 1) + kernels(3, 2))
  end function displacement

  !> Refuse coordinates that are not finite or differ in number.
  pure subroutine check_points(x, y, n, error, vertices)
    !> Field points
    real(wp), intent(in) :: x(:), y(:)
    !> Number of results
    integer, intent(in) :: n
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    !> Vertices of a triangle, as columns
    real(wp), intent(in), optional :: vertices(2, 3)
    logical :: finite

    finite = .true.
    if (present(vertices)) finite = all(ieee_is_finite(vertices))
    if (size(x) /= size(y) .or. size(x) /= n) then
      call raise(error, status%invalid_input, 'field points: as many x as y as results expected')
    else if (.not. finite) then
      call raise(error, status%invalid_input, 'vertices of a triangle: finite coordinates expected')
    else if (.not. (all(ieee_is_finite(x)) .and. all(ieee_is_finite(y)))) then
      call raise(error, status%invalid_input, 'field points: finite coordinates expected')
    end if
  end subroutine check_points

  !> Refuse elastic constants that make no sense.
  pure subroutine check_material(shear_modulus, poisson_ratio, error)
    !> Shear modulus
    real(wp), intent(in) :: shear_modulus
    !> Poisson's ratio
    real(wp), intent(in) :: poisson_ratio
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    logical :: right(2)

    ! comparing NaN is an invalid operation
    right = ieee_is_finite([shear_modulus, poisson_ratio])
    if (right(1)) right(1) = shear_modulus > 0.0_wp
    if (right(2)) right(2) = poisson_ratio > -1.0_wp .and. poisson_ratio <= 0.5_wp
    if (.not. right(1)) then
      call raise(error, status%invalid_input, 'shear modulus: a positive, finite number expected')
    else if (.not. right(2)) then
      call raise(error, status%invalid_input, 'Poisson''s ratio: a number above -1 and at most 0.5 expected')
    end if
  end subroutine check_material

end module hc_triangle_integrals
