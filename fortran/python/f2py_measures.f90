!> Measures of a solution for Python: flat procedures for f2py, no mathematics.
!>
!> Fields have the shape (n_col, n_row), and zones are integers: not zero at nodes of the zone. The module has no state,
!> so that several threads may call at a time.
module hc_f2py_measures
  use iso_c_binding, only: c_double, c_int
  use hc_error, only: error_t, status, raise
  use hc_f2py_handles, only: report, pair_of, friction_of, normal_law_of
  use hc_elastic_pair, only: material_t, find_bulk_strain
  use hc_field_space, only: field_space_t
  use hc_lattice, only: lattice_t, new_lattice
  use hc_interpolation, only: interpolate, nearest_node
  use hc_zone_estimators, only: boundary, boundary_circle, area_radius, edge_radius, pressure_center, moment_ellipse, &
    edge_ellipse, circle_fit_t, ellipse_t
  use hc_friction_law, only: friction_law_t
  use hc_contact_edges, only: contact_edges_t
  use hc_contact_state, only: contact_state_t, separated, normal
  use hc_state_measures, only: nodal_normal_residual, nodal_tangential_residual, measure_state, measure_contact, state_measures_t
  use hc_discretization_error, only: limits_of_error, is_slip_zone_unresolved
  use hc_load_cycles, only: turning_points, find_cycles, loop_area
  implicit none
  private

  public :: zone_boundary, circle_of_zone, radius_of_area, radius_of_pressure, center_of_pressure, ellipse_of_zone
  public :: ellipse_of_pressure, turns_of_history, cycles_of_history
  public :: field_between_nodes, nodes_next_to, errors_of_limits, unresolved_slip_zones
  public :: nodal_residuals, measures_of_state
  public :: strain_of_bulk

contains

  !> Find the nodes of a zone that have a neighbor outside it.
  subroutine zone_boundary(n_col, n_row, zone, rim)
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Zone
    integer(c_int), intent(in) :: zone(n_col, n_row)
    !> Its boundary nodes
    integer(c_int), intent(out) :: rim(n_col, n_row)
    rim = merge(1, 0, boundary(zone /= 0))
  end subroutine zone_boundary

  !> Fit a circle through the boundary nodes of a zone.
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

  !> Compute the radius of the circle with as much area as some cells.
  subroutine radius_of_area(n_node, cell_area, radius)
    !> Number of nodes
    integer(c_int), intent(in) :: n_node
    !> Area of a cell [m^2]
    real(c_double), intent(in) :: cell_area
    !> Radius [m]
    real(c_double), intent(out) :: radius
    radius = area_radius(n_node, cell_area)
  end subroutine radius_of_area

  !> Find the radius at which the pressure vanishes.
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

  !> Compute the centroid of a pressure.
  subroutine center_of_pressure(n_col, n_row, x, y, pressure, center)
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Coordinates [m] and pressure [Pa]
    real(c_double), intent(in) :: x(n_col, n_row), y(n_col, n_row), pressure(n_col, n_row)
    !> Centroid; NaN if there is no pressure [m]
    real(c_double), intent(out) :: center(2)
    center = pressure_center(x, y, pressure)
  end subroutine center_of_pressure

  !> Find the ellipse with the second moments of a zone.
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

  !> Find the ellipse on which the pressure vanishes.
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

  !> Interpolate a field at points, linearly on the triangles.
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

  !> Find the nodes next to points.
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

  !> Estimate how far values on the finest lattice are from their limit.
  subroutine errors_of_limits(n_lattice, n_value, spacings, values, rough, unresolved, errors, code, message)
    !> Number of lattices and of quantities
    integer(c_int), intent(in) :: n_lattice, n_value
    !> Spacings, in units of the first
    real(c_double), intent(in) :: spacings(n_lattice)
    !> Quantities on each of the lattices
    real(c_double), intent(in) :: values(n_lattice, n_value)
    !> Not zero: of the quantities that a few nodes at the edge of a zone decide
    integer(c_int), intent(in) :: rough(n_value)
    !> Not zero: of those that depend on a slip zone narrower than the lattice resolves
    integer(c_int), intent(in) :: unresolved(n_value)
    !> Errors of those on the first
    real(c_double), intent(out) :: errors(n_value)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error

    call limits_of_error(spacings, values, errors, error, rough /= 0, unresolved /= 0)
    call report(error, code, message)
  end subroutine errors_of_limits

  !> Return whether the slip zones of load steps are narrower than the lattice resolves.
  subroutine unresolved_slip_zones(n, spacing, contact_area, stick_area, max_traction, max_pressure, unresolved, code, message)
    !> Number of load steps
    integer(c_int), intent(in) :: n
    !> Spacing [m]
    real(c_double), intent(in) :: spacing
    !> Areas to the edge between the nodes [m2]
    real(c_double), intent(in) :: contact_area(n), stick_area(n)
    !> Largest shear tractions and pressures [Pa]
    real(c_double), intent(in) :: max_traction(n), max_pressure(n)
    !> 1: narrower; else 0
    integer(c_int), intent(out) :: unresolved(n)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error

    unresolved = merge(1, 0, is_slip_zone_unresolved(spacing, contact_area, stick_area, max_traction, max_pressure))
    call report(error, code, message)
  end subroutine unresolved_slip_zones

  !> Compute the residuals of the contact conditions at the nodes.
  subroutine nodal_residuals(n_col, n_row, basis, lambda, n_coefficient, coefficient, law, interface, tangential, &
                             pressure, gap, vectors, residual, code, message)
    !f2py threadsafe
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Basis vectors as columns [m]; lambda_1, lambda_2, lambda_5 [1/Pa]
    real(c_double), intent(in) :: basis(2, 2), lambda(3)
    !> Coefficient of friction, one or that of each node, infinite or huge: no slip; numbers of the law: `friction_of`
    integer(c_int), intent(in) :: n_coefficient
    real(c_double), intent(in) :: coefficient(n_coefficient), law(4)
    !> Coefficient [Pa/m^m] and exponent m of the normal compliance, both 0: bodies do not penetrate; tangential stiffness
    !> [Pa/m], 0: no springs
    real(c_double), intent(in) :: interface(3)
    !> Not zero: of the friction conditions; else of those along the normal
    integer(c_int), intent(in) :: tangential
    !> Pressure [Pa] and gap [m]
    real(c_double), intent(in) :: pressure(n_col, n_row), gap(n_col, n_row)
    !> Traction along x and y [Pa], slip of the step along x and y [m]; of no use for those along the normal
    real(c_double), intent(in) :: vectors(n_col, n_row, 4)
    !> Residuals
    real(c_double), intent(out) :: residual(n_col, n_row)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(lattice_t) :: lattice
    class(friction_law_t), allocatable :: friction
    type(contact_state_t) :: state

    residual = 0.0_c_double
    call new_lattice(lattice, basis, [0, 0], [n_col, n_row], error)
    if (.not. allocated(error)) then
      allocate (state%pressure, source=pressure)
      if (tangential /= 0) then
        allocate (state%traction, source=vectors(:, :, 1:2))
        allocate (state%slip_increment, source=vectors(:, :, 3:4))
        call friction_of(coefficient, law, lattice%size(), friction)
        residual = nodal_tangential_residual(lattice, pair_of(lambda, interface), friction, state, field_space_t())
      else
        allocate (state%gap, source=gap)
        residual = nodal_normal_residual(lattice, pair_of(lambda), normal_law_of(interface), state, field_space_t())
      end if
    end if
    call report(error, code, message)
  end subroutine nodal_residuals

  !> Measure what a load history records of a state, in the order of variables.py.
  subroutine measures_of_state(n_col, n_row, basis, first, origin, n_coefficient, coefficient, law, frictional, pressure, &
                               gap, initial_gap, zone, candidate, motion, traction_x, traction_y, displacement_x, displacement_y, &
                               numbers, code, message)
    !f2py threadsafe
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Basis vectors as columns [m]
    real(c_double), intent(in) :: basis(2, 2)
    !> Smallest column and row index
    integer(c_int), intent(in) :: first(2)
    !> Position of node (0, 0) [m]
    real(c_double), intent(in) :: origin(2)
    !> Coefficient of friction, one or that of each node, infinite or huge: no slip; numbers of the law: `friction_of`
    integer(c_int), intent(in) :: n_coefficient
    real(c_double), intent(in) :: coefficient(n_coefficient), law(4)
    !> Not zero: with friction
    integer(c_int), intent(in) :: frictional
    !> Pressure [Pa], gap and gap before loading [m]
    real(c_double), intent(in) :: pressure(n_col, n_row), gap(n_col, n_row), initial_gap(n_col, n_row)
    !> Zones; not zero where a node can touch
    integer(c_int), intent(in) :: zone(n_col, n_row), candidate(n_col, n_row)
    !> Approach, shifts [m], twist [rad] and bulk strain
    real(c_double), intent(in) :: motion(7)
    !> Traction along x and y [Pa], relative displacement along x and y [m]; of no use without friction
    real(c_double), intent(in) :: traction_x(n_col, n_row), traction_y(n_col, n_row), displacement_x(n_col, n_row), &
                                  displacement_y(n_col, n_row)
    !> Areas [m^2], radii and places [m], tractions [Pa], energy [J]
    real(c_double), intent(out) :: numbers(21)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(lattice_t) :: lattice
    class(friction_law_t), allocatable :: friction
    type(contact_state_t) :: state
    type(state_measures_t) :: found
    type(contact_edges_t) :: edges

    numbers = 0.0_c_double
    call new_lattice(lattice, basis, first, [n_col, n_row], error, origin)
    if (.not. allocated(error)) then
      if (frictional /= 0) then
        allocate (state%pressure, source=pressure)
        allocate (state%gap, source=gap)
        allocate (state%zone, source=zone)
        state%motion = motion
        allocate (state%traction(n_col, n_row, 2), state%relative_displacement(n_col, n_row, 2))
        state%traction(:, :, 1) = traction_x
        state%traction(:, :, 2) = traction_y
        state%relative_displacement(:, :, 1) = displacement_x
        state%relative_displacement(:, :, 2) = displacement_y
        call friction_of(coefficient, law, lattice%size(), friction)
        found = measure_state(lattice, friction, initial_gap, candidate /= 0, state, field_space_t())
      else
        call measure_contact(lattice, initial_gap, candidate /= 0, zone /= separated, pressure, gap, motion(normal), &
                             field_space_t(), found, edges)
      end if
      numbers = [found%contact%area, found%stick%area, found%contact%radius, found%contact%area_fit, &
                 found%contact%radius_fit, found%contact%semi_major, found%contact%semi_minor, found%pressure_center, &
                 found%stick%radius, found%stick%area_fit, found%stick%radius_fit, found%stick_center, found%stick_lower(1), &
                 found%stick_upper(1), found%stick_lower(2), found%stick_upper(2), found%max_pressure, found%max_traction, &
                 found%elastic_energy]
    end if
    call report(error, code, message)
  end subroutine measures_of_state

  !> Compute the strain of a bulk stress.
  subroutine strain_of_bulk(moduli, plane_strain, stress, whole_stress, strain)
    !> Young's modulus [Pa] and Poisson's ratio
    real(c_double), intent(in) :: moduli(2)
    !> 0: free sides; 1, 2: no strain along x, along y
    integer(c_int), intent(in) :: plane_strain
    !> xx, yy, xy [Pa]
    real(c_double), intent(in) :: stress(3)
    !> The same with the stress of the direction without strain [Pa], and the strain
    real(c_double), intent(out) :: whole_stress(3), strain(3)
    whole_stress = stress
    call find_bulk_strain(material_t(moduli(1), moduli(2)), plane_strain, whole_stress, strain)
  end subroutine strain_of_bulk

  !> Find the steps at which a quantity turns back.
  subroutine turns_of_history(n, values, turns)
    !> Number of steps
    integer(c_int), intent(in) :: n
    !> Values of the steps
    real(c_double), intent(in) :: values(n)
    !> Not zero at the steps
    integer(c_int), intent(out) :: turns(n)
    turns = 0
    turns(turning_points(values)) = 1
  end subroutine turns_of_history

  !> Find the cycles of a load over its motion.
  subroutine cycles_of_history(n, motion, load, n_cycle, cycles, areas)
    !> Number of steps
    integer(c_int), intent(in) :: n
    !> Values of the steps [m, N or rad, N m]
    real(c_double), intent(in) :: motion(n), load(n)
    !> Number of cycles
    integer(c_int), intent(out) :: n_cycle
    !> First and last step of each, counted from 1
    integer(c_int), intent(out) :: cycles(2, n)
    !> Area of its loop [J]
    real(c_double), intent(out) :: areas(n)
    integer, allocatable :: first(:), last(:)
    integer :: k

    cycles = 0
    areas = 0.0_c_double
    call find_cycles(motion, load, first, last)
    n_cycle = size(first)
    do k = 1, n_cycle
      cycles(:, k) = [first(k), last(k)]
      areas(k) = loop_area(motion(first(k):last(k)), load(first(k):last(k)))
    end do
  end subroutine cycles_of_history

  !> Return an ellipse as numbers.
  pure function numbers_of(ellipse) result(numbers)
    type(ellipse_t), intent(in) :: ellipse
    real(c_double) :: numbers(5)
    numbers = [ellipse%semi_major, ellipse%semi_minor, ellipse%angle, ellipse%center]
  end function numbers_of

end module hc_f2py_measures
