!> Size and shape of a contact or stick zone from its nodes.
!>
!> Fields have the shape (n_col, n_row). The area and the moments count nodes; circle and ellipse of the edge come from
!> the pressure, whose square is a polynomial of second degree about the edge of a Hertzian contact.
!>
!> Equations: docs/theory/edges.md, (B1).
module hc_zone_estimators
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use hc_precision, only: wp, pi
  use hc_options, only: edge_options_t
  use hc_error, only: error_t, status, raise
  use hc_lapack, only: eliminate, least_squares
  use hc_lattice, only: neighbors
  implicit none
  private

  public :: circle_fit_t, ellipse_t
  public :: boundary, is_boundary, boundary_circle, area_radius, edge_radius, pressure_center, moment_ellipse, edge_ellipse, &
    ellipse_of_moments

  !> Cell area of the equilateral lattice over the square of the spacing.
  real(wp), parameter :: unit_cell = sqrt(0.75_wp)

  !> Circle through the boundary nodes, equations (9.1)-(9.4).
  type :: circle_fit_t
    !> a, mean of the radii r_i = |X_i - X_0| + l_e/2 of the boundary nodes [m]
    real(wp) :: radius = 0.0_wp
    !> E_a, mean of |r_i - a|/a
    real(wp) :: mean_deviation = 0.0_wp
    !> sigma, root of the mean of (r_i - a)^2, over a
    real(wp) :: standard_deviation = 0.0_wp
    !> Number of boundary nodes
    integer :: count = 0
  end type circle_fit_t

  !> An ellipse.
  type :: ellipse_t
    !> Semi-axes [m]
    real(wp) :: semi_major = 0.0_wp, semi_minor = 0.0_wp
    !> Direction of the major axis from x, in (-pi/2, pi/2] [rad]
    real(wp) :: angle = 0.0_wp
    !> Center [m]
    real(wp) :: center(2) = 0.0_wp
  end type ellipse_t

contains

  !> Find the nodes of a zone that have a neighbor outside it, or outside the window.
  pure function boundary(zone) result(rim)
    !> Nodes of the zone
    logical, intent(in) :: zone(:, :)
    logical :: rim(size(zone, 1), size(zone, 2))
    integer :: col, row

    do row = 1, size(zone, 2)
      do col = 1, size(zone, 1)
        rim(col, row) = zone(col, row)
        if (zone(col, row)) rim(col, row) = is_boundary(zone, col, row)
      end do
    end do
  end function boundary

  !> Return whether a node of a zone has a neighbor outside it, or outside the window.
  pure logical function is_boundary(zone, col, row)
    !> Nodes of the zone
    logical, intent(in) :: zone(:, :)
    !> Column and row of the node
    integer, intent(in) :: col, row
    integer :: k

    is_boundary = col == 1 .or. row == 1 .or. col == size(zone, 1) .or. row == size(zone, 2)
    if (is_boundary) return
    do k = 1, size(neighbors, 2)
      is_boundary = is_boundary .or. .not. zone(col + neighbors(1, k), row + neighbors(2, k))
    end do
  end function is_boundary

  !> Fit a circle through the boundary nodes of a zone, equations (9.1)-(9.4).
  pure type(circle_fit_t) function boundary_circle(x, y, zone, spacing, center) result(fit)
    !> Coordinates of the nodes [m]
    real(wp), intent(in) :: x(:, :), y(:, :)
    !> Nodes of the zone; not empty
    logical, intent(in) :: zone(:, :)
    !> l_e [m]
    real(wp), intent(in) :: spacing
    !> X_0 [m]
    real(wp), intent(in) :: center(2)
    real(wp), allocatable :: radii(:)

    associate (rim => boundary(zone))
      allocate (radii, source=hypot(pack(x, rim) - center(1), pack(y, rim) - center(2)) + 0.5_wp*spacing)
    end associate
    fit%count = size(radii)
    if (fit%count == 0) return
    fit%radius = sum(radii)/fit%count
    radii = (radii - fit%radius)/fit%radius
    fit%mean_deviation = sum(abs(radii))/fit%count
    fit%standard_deviation = sqrt(sum(radii**2)/fit%count)
  end function boundary_circle

  !> Compute the radius of the circle with as much area as the cells of some nodes [m].
  elemental real(wp) function area_radius(n_node, cell_area)
    !> Number of nodes
    integer, intent(in) :: n_node
    !> Area of a cell [m^2]
    real(wp), intent(in) :: cell_area

    area_radius = sqrt(n_node*cell_area/pi)
  end function area_radius

  !> Find the radius at which the pressure vanishes, to a fraction of the spacing [m]; NaN if there are too few nodes.
  !>
  !> Near the edge p^2 is linear in r^2, since p grows like the square root of the distance. A straight line through the
  !> nodes with a_A - 6 l_e <= r <= a_A - l_e gives the zero; a_A is the area-equivalent radius.
  pure real(wp) function edge_radius(x, y, pressure, spacing, center, cell_area)
    !> Coordinates of the nodes [m]
    real(wp), intent(in) :: x(:, :), y(:, :)
    !> Contact pressure [Pa]
    real(wp), intent(in) :: pressure(:, :)
    !> l_e [m]
    real(wp), intent(in) :: spacing
    !> Center of the contact [m]
    real(wp), intent(in) :: center(2)
    !> Area of a cell; absent: that of the equilateral lattice [m^2]
    real(wp), intent(in), optional :: cell_area
    type(edge_options_t) :: options
    real(wp), allocatable :: distance(:), square(:)
    real(wp) :: around, inner, outer, slope, start, cell

    edge_radius = ieee_value(1.0_wp, ieee_quiet_nan)
    cell = unit_cell*spacing**2
    if (present(cell_area)) cell = cell_area
    around = area_radius(count(pressure > 0.0_wp), cell)
    inner = max(around - options%inner_ring*spacing, 0.0_wp)
    outer = around - options%outer_ring*spacing
    if (outer <= 0.0_wp) return
    associate (r2 => (x - center(1))**2 + (y - center(2))**2)
      associate (near => pressure > 0.0_wp .and. r2 >= inner**2 .and. r2 <= outer**2)
        allocate (distance, source=pack(r2, near)/around**2)
        allocate (square, source=(pack(pressure, near)/maxval(pressure))**2)
      end associate
    end associate
    if (size(distance) < 3) return
    associate (mean_distance => sum(distance)/size(distance), mean_square => sum(square)/size(square))
      slope = sum((distance - mean_distance)*(square - mean_square))
      if (slope >= 0.0_wp) return
      slope = slope/sum((distance - mean_distance)**2)
      start = mean_square - slope*mean_distance
    end associate
    if (start > 0.0_wp) edge_radius = sqrt(-start/slope)*around
  end function edge_radius

  !> Compute the centroid of a pressure [m]; NaN if there is none.
  pure function pressure_center(x, y, pressure) result(center)
    !> Coordinates of the nodes [m]
    real(wp), intent(in) :: x(:, :), y(:, :)
    !> Contact pressure [Pa]
    real(wp), intent(in) :: pressure(:, :)
    real(wp) :: center(2), total

    total = sum(pressure)
    center = ieee_value(1.0_wp, ieee_quiet_nan)
    if (total > 0.0_wp) center = [sum(pressure*x), sum(pressure*y)]/total
  end function pressure_center

  !> Find the ellipse with the second moments of the nodes of a zone: a uniform ellipse has the variance a^2/4 along a.
  pure type(ellipse_t) function moment_ellipse(x, y, zone) result(ellipse)
    !> Coordinates of the nodes [m]
    real(wp), intent(in) :: x(:, :), y(:, :)
    !> Nodes of the zone; not empty
    logical, intent(in) :: zone(:, :)
    real(wp), allocatable :: along(:), across(:)

    allocate (along, source=pack(x, zone))
    allocate (across, source=pack(y, zone))
    associate (n => size(along))
      if (n == 0) return
      associate (center => [sum(along), sum(across)]/n)
        along = along - center(1)
        across = across - center(2)
        ellipse = ellipse_of_moments(center, sum(along**2)/n, sum(along*across)/n, sum(across**2)/n)
      end associate
    end associate
  end function moment_ellipse

  !> Find the ellipse with the second moments of an area, each over the area and about its center.
  pure type(ellipse_t) function ellipse_of_moments(center, xx, xy, yy) result(ellipse)
    !> Center of area [m]
    real(wp), intent(in) :: center(2)
    !> Moments [m^2]
    real(wp), intent(in) :: xx, xy, yy
    real(wp) :: variance(2)

    ellipse%center = center
    call principal_axes(xx, xy, yy, variance, ellipse%angle)
    ellipse%semi_major = 2.0_wp*sqrt(max(variance(1), 0.0_wp))
    ellipse%semi_minor = 2.0_wp*sqrt(max(variance(2), 0.0_wp))
  end function ellipse_of_moments

  !> Find the ellipse on which the pressure vanishes, to a fraction of the spacing.
  !>
  !> The square of the pressure is a quadratic polynomial near the edge. It is fitted to the nodes between 1 - 6 l_e/b
  !> and 1 - l_e/b of the way from the center to the moment ellipse with the minor semi-axis b.
  subroutine edge_ellipse(x, y, pressure, spacing, ellipse, error)
    !> Coordinates of the nodes [m]
    real(wp), intent(in) :: x(:, :), y(:, :)
    !> Contact pressure [Pa]
    real(wp), intent(in) :: pressure(:, :)
    !> l_e [m]
    real(wp), intent(in) :: spacing
    !> The ellipse
    type(ellipse_t), intent(out) :: ellipse
    !> Allocated if there are fewer than six nodes to fit, or the fit is no ellipse
    type(error_t), allocatable, intent(out) :: error
    type(edge_options_t) :: options
    type(ellipse_t) :: around
    real(wp), allocatable :: u(:), v(:), square(:), terms(:, :)
    logical, allocatable :: near(:)
    real(wp) :: c(6), turn(2, 2), form(2, 2), slope(2), matrix(2, 2), middle(2, 1), top, curvature(2)

    around = moment_ellipse(x, y, pressure > 0.0_wp)
    if (around%semi_minor > 0.0_wp) then
      turn(1, :) = [cos(around%angle), sin(around%angle)]/around%semi_major
      turn(2, :) = [-sin(around%angle), cos(around%angle)]/around%semi_minor
      square = pack(pressure, pressure > 0.0_wp)/maxval(pressure)
      u = pack(x, pressure > 0.0_wp) - around%center(1)
      v = pack(y, pressure > 0.0_wp) - around%center(2)
      terms = reshape([turn(1, 1)*u + turn(1, 2)*v, turn(2, 1)*u + turn(2, 2)*v], [size(u), 2])
      associate (way => norm2(terms, dim=2), ring => spacing/around%semi_minor)
        near = way >= 1.0_wp - options%inner_ring*ring .and. way <= 1.0_wp - options%outer_ring*ring
      end associate
    else
      allocate (near(0), terms(0, 2), square(0))
    end if
    if (count(near) < size(c)) then
      call raise(error, status%invalid_input, 'too few nodes in contact to fit an ellipse to the pressure')
      return
    end if
    u = pack(terms(:, 1), near)
    v = pack(terms(:, 2), near)
    terms = reshape([0.0_wp*u + 1.0_wp, u, v, u*u, u*v, v*v], [size(u), size(c)])
    call least_squares(terms, pack(square, near)**2, c, error)
    if (allocated(error)) return
    ! back to metres from the center: p^2 = c_1 + slope . r + r . form . r
    form = matmul(transpose(turn), matmul(reshape([c(4), 0.5_wp*c(5), 0.5_wp*c(5), c(6)], [2, 2]), turn))
    slope = matmul(transpose(turn), c(2:3))
    matrix = form
    middle(:, 1) = -0.5_wp*slope
    call eliminate(matrix, middle)
    top = c(1) + 0.5_wp*dot_product(slope, middle(:, 1))
    ! the major axis is that of the smallest curvature downwards
    curvature = 0.0_wp
    if (top > 0.0_wp) call principal_axes(form(1, 1)/top, form(1, 2)/top, form(2, 2)/top, curvature, ellipse%angle)
    if (curvature(1) >= 0.0_wp) then
      call raise(error, status%invalid_input, 'the pressure does not vanish on an ellipse')
      return
    end if
    ellipse%semi_major = 1.0_wp/sqrt(-curvature(1))
    ellipse%semi_minor = 1.0_wp/sqrt(-curvature(2))
    ellipse%center = around%center + middle(:, 1)
  end subroutine edge_ellipse

  !> Compute the eigenvalues of a symmetric matrix, the larger one first, and the direction of its axis in (-pi/2, pi/2] [rad].
  pure subroutine principal_axes(xx, xy, yy, values, angle)
    !> Elements of the matrix
    real(wp), intent(in) :: xx, xy, yy
    !> Eigenvalues
    real(wp), intent(out) :: values(2)
    !> Direction of the axis of the larger one
    real(wp), intent(out) :: angle
    real(wp) :: half_difference

    half_difference = hypot(0.5_wp*(xx - yy), xy)
    values = 0.5_wp*(xx + yy) + [half_difference, -half_difference]
    angle = 0.0_wp
    if (half_difference > 0.0_wp) angle = 0.5_wp*atan2(2.0_wp*xy, xx - yy)
    if (angle <= -0.5_wp*pi) angle = 0.5_wp*pi
  end subroutine principal_axes

end module hc_zone_estimators
