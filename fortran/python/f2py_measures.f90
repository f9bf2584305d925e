!> What measures a solution, for Python: flat procedures for f2py, no mathematics.
!>
!> Fields have the shape (n_col, n_row), and zones are integers: not zero at nodes of the zone. Nothing here keeps state,
!> so that threads may call at will.
module hc_f2py_measures
  use iso_c_binding, only: c_double, c_int
  use hc_error, only: error_t, status, raise
  use hc_f2py_handles, only: report, pair_of, friction_of
  use hc_lattice, only: lattice_t, new_lattice
  use hc_interpolation, only: interpolate, interpolate_pressure, nearest_node
  use hc_zone_estimators, only: boundary, boundary_circle, area_radius, edge_radius, pressure_center, moment_ellipse, &
    edge_ellipse, circle_fit_t, ellipse_t
  use hc_contact_edges, only: contact_edges_t, new_contact_edges, zone_edge_t, cut_triangles
  use hc_contact_state, only: contact_state_t
  use hc_state_measures, only: nodal_normal_residual, nodal_tangential_residual, elastic_energy, zone_extent
  use hc_discretization_error, only: limits_of_error
  implicit none
  private

  public :: zone_boundary, circle_of_zone, radius_of_area, radius_of_pressure, center_of_pressure, ellipse_of_zone
  public :: ellipse_of_pressure, count_cut_triangles, edge_of_zone, pressure_squares
  public :: field_between_nodes, pressure_between_nodes, nodes_next_to, errors_of_limits
  public :: nodal_residuals, energy_of_state, extent_of_zone

contains

  !> Nodes of a zone that have a neighbor outside it.
  subroutine zone_boundary(n_col, n_row, zone, rim)
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Zone
    integer(c_int), intent(in) :: zone(n_col, n_row)
    !> Its boundary nodes
    integer(c_int), intent(out) :: rim(n_col, n_row)
    rim = merge(1, 0, boundary(zone /= 0))
  end subroutine zone_boundary

  !> Circle through the boundary nodes of a zone.
  subroutine circle_of_zone(n_col, n_row, x, y, zone, spacing, center, numbers, n_boundary)
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Coordinates [m]
    real(c_double), intent(in) :: x(n_col, n_row), y(n_col, n_row)
    !> Zone
    integer(c_int), intent(in) :: zone(n_col, n_row)
    !> l_e and X_0 [m]
    real(c_double), intent(in) :: spacing, center(2)
    !> Radius [m], mean and standard deviation
    real(c_double), intent(out) :: numbers(3)
    !> Number of boundary nodes
    integer(c_int), intent(out) :: n_boundary
    type(circle_fit_t) :: fit

    fit = boundary_circle(x, y, zone /= 0, spacing, center)
    numbers = [fit%radius, fit%mean_deviation, fit%standard_deviation]
    n_boundary = fit%count
  end subroutine circle_of_zone

  !> Radius of the circle with as much area as some cells.
  subroutine radius_of_area(n_node, cell_area, radius)
    !> Number of nodes
    integer(c_int), intent(in) :: n_node
    !> Area of a cell [m^2]
    real(c_double), intent(in) :: cell_area
    !> Radius [m]
    real(c_double), intent(out) :: radius
    radius = area_radius(n_node, cell_area)
  end subroutine radius_of_area

  !> Radius at which the pressure vanishes.
  subroutine radius_of_pressure(n_col, n_row, x, y, pressure, spacing, center, radius)
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Coordinates [m] and pressure [Pa]
    real(c_double), intent(in) :: x(n_col, n_row), y(n_col, n_row), pressure(n_col, n_row)
    !> l_e and center [m]
    real(c_double), intent(in) :: spacing, center(2)
    !> Radius; NaN if there are too few nodes [m]
    real(c_double), intent(out) :: radius
    radius = edge_radius(x, y, pressure, spacing, center)
  end subroutine radius_of_pressure

  !> Centroid of a pressure.
  subroutine center_of_pressure(n_col, n_row, x, y, pressure, center)
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Coordinates [m] and pressure [Pa]
    real(c_double), intent(in) :: x(n_col, n_row), y(n_col, n_row), pressure(n_col, n_row)
    !> Centroid; NaN if there is no pressure [m]
    real(c_double), intent(out) :: center(2)
    center = pressure_center(x, y, pressure)
  end subroutine center_of_pressure

  !> Ellipse with the second moments of a zone.
  subroutine ellipse_of_zone(n_col, n_row, x, y, zone, numbers)
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Coordinates [m]
    real(c_double), intent(in) :: x(n_col, n_row), y(n_col, n_row)
    !> Zone
    integer(c_int), intent(in) :: zone(n_col, n_row)
    !> Semi-axes [m], angle [rad], center [m]
    real(c_double), intent(out) :: numbers(5)
    numbers = numbers_of(moment_ellipse(x, y, zone /= 0))
  end subroutine ellipse_of_zone

  !> Ellipse on which the pressure vanishes.
  subroutine ellipse_of_pressure(n_col, n_row, x, y, pressure, spacing, numbers, code, message)
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Coordinates [m] and pressure [Pa]
    real(c_double), intent(in) :: x(n_col, n_row), y(n_col, n_row), pressure(n_col, n_row)
    !> l_e [m]
    real(c_double), intent(in) :: spacing
    !> Semi-axes [m], angle [rad], center [m]
    real(c_double), intent(out) :: numbers(5)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(ellipse_t) :: ellipse

    call edge_ellipse(x, y, pressure, spacing, ellipse, error)
    numbers = numbers_of(ellipse)
    call report(error, code, message)
  end subroutine ellipse_of_pressure

  !> Number of triangles that the edge of a zone cuts.
  subroutine count_cut_triangles(n_col, n_row, zone, n_cut)
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Zone
    integer(c_int), intent(in) :: zone(n_col, n_row)
    !> Number of triangles
    integer(c_int), intent(out) :: n_cut
    n_cut = cut_triangles(zone /= 0)
  end subroutine count_cut_triangles

  !> Edge of the contact area, or of the part of it that sticks.
  subroutine edge_of_zone(n_col, n_row, basis, start, pressure, gap, contact, candidate, of_stick, stick, reserve, &
                          n_cut, numbers, segments, n_segment, code, message)
    !f2py threadsafe
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Basis vectors as columns, position of the first node [m]
    real(c_double), intent(in) :: basis(2, 2), start(2)
    !> Pressure [Pa] and gap [m]
    real(c_double), intent(in) :: pressure(n_col, n_row), gap(n_col, n_row)
    !> Nodes in contact, nodes that can touch
    integer(c_int), intent(in) :: contact(n_col, n_row), candidate(n_col, n_row)
    !> Not zero: the edge of the stick area
    integer(c_int), intent(in) :: of_stick
    !> Nodes that stick, reserve of friction [Pa]; not looked at for the edge of the contact
    integer(c_int), intent(in) :: stick(n_col, n_row)
    real(c_double), intent(in) :: reserve(n_col, n_row)
    !> Triangles that the edge cuts
    integer(c_int), intent(in) :: n_cut
    !> Area [m^2], radius of the disc with that area and length of the edge [m]
    real(c_double), intent(out) :: numbers(3)
    !> Pieces of the edge: x and y, first and last point [m]
    real(c_double), intent(out) :: segments(2, 2, n_cut)
    !> Number of pieces
    integer(c_int), intent(out) :: n_segment
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(lattice_t) :: lattice
    type(contact_edges_t) :: edges
    type(zone_edge_t) :: edge

    numbers = 0.0_c_double
    segments = 0.0_c_double
    n_segment = 0
    call new_lattice(lattice, basis, [0, 0], [n_col, n_row], error, start)
    if (.not. allocated(error)) then
      call new_contact_edges(edges, lattice, pressure, gap, contact /= 0, candidate /= 0)
      if (of_stick /= 0) then
        edge = edges%stick_edge(stick /= 0, reserve)
      else
        edge = edges%contact_edge()
      end if
      numbers = [edge%area, edge%radius(), edge%length()]
      n_segment = size(edge%segments, 3)
      if (n_segment > n_cut) then
        call raise(error, status%invalid_input, 'the edge cuts more triangles than were counted')
      else
        segments(:, :, :n_segment) = edge%segments
      end if
    end if
    call report(error, code, message)
  end subroutine edge_of_zone

  !> Squares of the pressure near the edge of the contact, good to interpolate.
  subroutine pressure_squares(n_col, n_row, basis, pressure, gap, contact, candidate, squares, code, message)
    !f2py threadsafe
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Basis vectors as columns [m]
    real(c_double), intent(in) :: basis(2, 2)
    !> Pressure [Pa] and gap [m]
    real(c_double), intent(in) :: pressure(n_col, n_row), gap(n_col, n_row)
    !> Nodes in contact, nodes that can touch
    integer(c_int), intent(in) :: contact(n_col, n_row), candidate(n_col, n_row)
    !> Squares; NaN away from the edge [Pa^2]
    real(c_double), intent(out) :: squares(n_col, n_row)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(lattice_t) :: lattice
    type(contact_edges_t) :: edges

    squares = 0.0_c_double
    call new_lattice(lattice, basis, [0, 0], [n_col, n_row], error)
    if (.not. allocated(error)) then
      call new_contact_edges(edges, lattice, pressure, gap, contact /= 0, candidate /= 0)
      squares = edges%squares()
    end if
    call report(error, code, message)
  end subroutine pressure_squares

  !> A field at points, linear on the triangles.
  subroutine field_between_nodes(n_col, n_row, basis, start, values, outside, n, x, y, found, code, message)
    !f2py threadsafe
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Basis vectors as columns, position of the first node [m]
    real(c_double), intent(in) :: basis(2, 2), start(2)
    !> Values at the nodes, and at nodes outside the window
    real(c_double), intent(in) :: values(n_col, n_row), outside
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Points [m]
    real(c_double), intent(in) :: x(n), y(n)
    !> Values there
    real(c_double), intent(out) :: found(n)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(lattice_t) :: lattice
    integer :: i

    found = 0.0_c_double
    call new_lattice(lattice, basis, [0, 0], [n_col, n_row], error, start)
    if (.not. allocated(error)) found = [(interpolate(lattice, values, [x(i), y(i)], outside), i=1, n)]
    call report(error, code, message)
  end subroutine field_between_nodes

  !> The pressure at points, like a square root at the edge of the contact.
  subroutine pressure_between_nodes(n_col, n_row, basis, start, pressure, squares, n, x, y, found, code, message)
    !f2py threadsafe
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Basis vectors as columns, position of the first node [m]
    real(c_double), intent(in) :: basis(2, 2), start(2)
    !> Pressure [Pa], and its squares near the edge [Pa^2]
    real(c_double), intent(in) :: pressure(n_col, n_row), squares(n_col, n_row)
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Points [m]
    real(c_double), intent(in) :: x(n), y(n)
    !> Pressure there [Pa]
    real(c_double), intent(out) :: found(n)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(lattice_t) :: lattice
    integer :: i

    found = 0.0_c_double
    call new_lattice(lattice, basis, [0, 0], [n_col, n_row], error, start)
    if (.not. allocated(error)) found = [(interpolate_pressure(lattice, pressure, squares, [x(i), y(i)]), i=1, n)]
    call report(error, code, message)
  end subroutine pressure_between_nodes

  !> The nodes next to points.
  subroutine nodes_next_to(basis, start, extent, n, x, y, col, row, inside, code, message)
    !f2py threadsafe
    !> Basis vectors as columns, position of the first node [m]
    real(c_double), intent(in) :: basis(2, 2), start(2)
    !> Number of columns and rows
    integer(c_int), intent(in) :: extent(2)
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Points [m]
    real(c_double), intent(in) :: x(n), y(n)
    !> Column and row of each, counted from 0; of one at the rim if the window does not have it
    integer(c_int), intent(out) :: col(n), row(n)
    !> Not zero: the window has it
    integer(c_int), intent(out) :: inside(n)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(lattice_t) :: lattice
    integer :: i, node(2)
    logical :: found

    col = 0
    row = 0
    inside = 0
    call new_lattice(lattice, basis, [0, 0], extent, error, start)
    if (.not. allocated(error)) then
      do i = 1, n
        call nearest_node(lattice, [x(i), y(i)], node, found)
        col(i) = node(1)
        row(i) = node(2)
        inside(i) = merge(1, 0, found)
      end do
    end if
    call report(error, code, message)
  end subroutine nodes_next_to

  !> How far values on the finest lattice are from their limit.
  subroutine errors_of_limits(n_lattice, n_value, spacings, values, errors, code, message)
    !> Number of lattices and of quantities
    integer(c_int), intent(in) :: n_lattice, n_value
    !> Spacings, in units of the first
    real(c_double), intent(in) :: spacings(n_lattice)
    !> Quantities on each of the lattices
    real(c_double), intent(in) :: values(n_lattice, n_value)
    !> Errors of those on the first
    real(c_double), intent(out) :: errors(n_value)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error

    call limits_of_error(spacings, values, errors, error)
    call report(error, code, message)
  end subroutine errors_of_limits

  !> Residuals of the contact conditions at the nodes.
  subroutine nodal_residuals(n_col, n_row, basis, lambda, coefficient, tangential, pressure, gap, vectors, residual, code, message)
    !f2py threadsafe
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Basis vectors as columns [m]; lambda_1, lambda_2, lambda_5 [1/Pa]
    real(c_double), intent(in) :: basis(2, 2), lambda(3)
    !> Coefficient of friction; infinite or huge: no slip
    real(c_double), intent(in) :: coefficient
    !> Not zero: of the friction conditions; else of those along the normal
    integer(c_int), intent(in) :: tangential
    !> Pressure [Pa] and gap [m]
    real(c_double), intent(in) :: pressure(n_col, n_row), gap(n_col, n_row)
    !> Traction along x and y [Pa], slip of the step along x and y [m]; not looked at for those along the normal
    real(c_double), intent(in) :: vectors(n_col, n_row, 4)
    !> Residuals
    real(c_double), intent(out) :: residual(n_col, n_row)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(lattice_t) :: lattice
    type(contact_state_t) :: state

    residual = 0.0_c_double
    call new_lattice(lattice, basis, [0, 0], [n_col, n_row], error)
    if (.not. allocated(error)) then
      allocate (state%pressure, source=pressure)
      if (tangential /= 0) then
        allocate (state%traction, source=vectors(:, :, 1:2))
        allocate (state%slip_increment, source=vectors(:, :, 3:4))
        residual = nodal_tangential_residual(lattice, pair_of(lambda), friction_of(coefficient), state)
      else
        allocate (state%gap, source=gap)
        residual = nodal_normal_residual(lattice, pair_of(lambda), state)
      end if
    end if
    call report(error, code, message)
  end subroutine nodal_residuals

  !> Elastic energy of a state.
  subroutine energy_of_state(n_col, n_row, basis, start, pressure, gap, initial_gap, zone, motion, frictional, vectors, &
                             energy, code, message)
    !f2py threadsafe
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Basis vectors as columns, position of the first node [m]
    real(c_double), intent(in) :: basis(2, 2), start(2)
    !> Pressure [Pa], gap and gap before loading [m]
    real(c_double), intent(in) :: pressure(n_col, n_row), gap(n_col, n_row), initial_gap(n_col, n_row)
    !> Not zero in contact
    integer(c_int), intent(in) :: zone(n_col, n_row)
    !> Approach, shifts [m] and twist [rad]
    real(c_double), intent(in) :: motion(4)
    !> Not zero: with friction
    integer(c_int), intent(in) :: frictional
    !> Traction along x and y [Pa], relative displacement along x and y [m]; not looked at without friction
    real(c_double), intent(in) :: vectors(n_col, n_row, 4)
    !> Energy [J]
    real(c_double), intent(out) :: energy
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(lattice_t) :: lattice
    type(contact_state_t) :: state

    energy = 0.0_c_double
    call new_lattice(lattice, basis, [0, 0], [n_col, n_row], error, start)
    if (.not. allocated(error)) then
      allocate (state%pressure, source=pressure)
      allocate (state%gap, source=gap)
      allocate (state%zone, source=zone)
      state%motion = motion
      if (frictional /= 0) then
        allocate (state%traction, source=vectors(:, :, 1:2))
        allocate (state%relative_displacement, source=vectors(:, :, 3:4))
      end if
      energy = elastic_energy(lattice, initial_gap, state)
    end if
    call report(error, code, message)
  end subroutine energy_of_state

  !> Center and bounds of a zone.
  subroutine extent_of_zone(n_col, n_row, x, y, zone, center, lower, upper)
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Coordinates [m]
    real(c_double), intent(in) :: x(n_col, n_row), y(n_col, n_row)
    !> Zone
    integer(c_int), intent(in) :: zone(n_col, n_row)
    !> Center of area, smallest and largest x and y; NaN if there are no nodes [m]
    real(c_double), intent(out) :: center(2), lower(2), upper(2)
    call zone_extent(x, y, zone /= 0, center, lower, upper)
  end subroutine extent_of_zone

  !> An ellipse as numbers.
  pure function numbers_of(ellipse) result(numbers)
    type(ellipse_t), intent(in) :: ellipse
    real(c_double) :: numbers(5)
    numbers = [ellipse%semi_major, ellipse%semi_minor, ellipse%angle, ellipse%center]
  end function numbers_of

end module hc_f2py_measures
