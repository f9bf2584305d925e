!> Sizes and edges of zones, and fields between the nodes: made-up fields whose answer is known.
module test_edges
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use hc_precision, only: wp, pi
  use hc_options, only: edge_options_t
  use hc_error, only: error_t, status
  use hc_lattice, only: lattice_t, new_lattice, equilateral_basis
  use hc_lapack, only: least_squares
  use hc_interpolation, only: interpolate, interpolate_pressure, nearest_node
  use hc_zone_estimators, only: area_radius, boundary, boundary_circle, circle_fit_t, edge_ellipse, edge_radius, &
    ellipse_t, moment_ellipse, pressure_center
  use hc_edge_fit, only: fit_squares
  use hc_edge_band, only: edge_band_t, new_edge_band
  use hc_contact_edges, only: contact_edges_t, new_contact_edges
  use hc_coulomb, only: coulomb_t
  use hc_nodal_coulomb, only: nodal_coulomb_t
  use hc_traction_field, only: new_traction_field, traction_field_t
  use hc_zone_edge, only: cut_triangles, zone_edge_t, zone_mesh_t
  use hc_elastic_pair, only: elastic_pair_t
  use hc_contact_state, only: contact_state_t, force_control
  use hc_normal_contact, only: normal_contact_t, new_normal_contact
  use testing, only: test_t, new_test, check, check_raised, check_true
  implicit none
  private

  public :: collect_edges

  !> Windows of 2 n + 1 nodes along both sides.
  integer, parameter :: n = 50
  !> Semi-axes, direction and center of an elliptic contact, in spacings.
  real(wp), parameter :: semi_major = 24.3_wp, semi_minor = 15.7_wp, angle = 0.4_wp, center(2) = [0.3_wp, -0.4_wp]

contains

  subroutine collect_edges(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('least_squares', test_least_squares), &
      new_test('boundary', test_boundary), &
      new_test('circle', test_circle), &
      new_test('ellipses', test_ellipses), &
      new_test('no_ellipse', test_no_ellipse), &
      new_test('ring', test_ring), &
      new_test('rim_of_a_punch', test_punch), &
      new_test('mesh_of_an_ellipse', test_mesh), &
      new_test('stick', test_stick), &
      new_test('few_nodes_stick', test_few_nodes), &
      new_test('symmetric_nodes', test_symmetric_nodes), &
      new_test('between_nodes', test_between), &
      new_test('pressure_between_nodes', test_pressure_between), &
      new_test('shear_between_nodes', test_shear_between), &
      new_test('band', test_band), &
      new_test('fit_of_squares', test_fit) &
    ]
  end subroutine collect_edges

  !> A lattice of unit spacing, and the coordinates of its nodes.
  subroutine new_window(lattice, x, y, error)
    type(lattice_t), intent(out) :: lattice
    real(wp), allocatable, intent(out) :: x(:, :), y(:, :)
    type(error_t), allocatable, intent(out) :: error

    call new_lattice(lattice, equilateral_basis(1.0_wp), [-n, -n], [2*n + 1, 2*n + 1], error)
    allocate (x(2*n + 1, 2*n + 1), y(2*n + 1, 2*n + 1))
    call lattice%coordinates(x, y)
  end subroutine new_window

  !> Square of the pressure of Hertz over an ellipse; negative beyond it.
  elemental real(wp) function hertz_square(x, y)
    real(wp), intent(in) :: x, y

    associate (dx => x - center(1), dy => y - center(2))
      hertz_square = 1.0_wp - ((dx*cos(angle) + dy*sin(angle))/semi_major)**2 - ((dy*cos(angle) - dx*sin(angle))/semi_minor)**2
    end associate
  end function hertz_square

  !> The mean of three equations that contradict each other.
  subroutine test_least_squares(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: a(3, 2), x(2)

    a = reshape([1.0_wp, 1.0_wp, 1.0_wp, 0.0_wp, 1.0_wp, 2.0_wp], [3, 2])
    call least_squares(a, [1.0_wp, 0.0_wp, 5.0_wp], x, error)
    if (.not. allocated(error)) call check(error, x, [0.0_wp, 2.0_wp], 1.0e-14_wp, 'line through three points')
  end subroutine test_least_squares

  !> The rim of a hexagon is its outermost ring; at the rim of the window every node has a neighbor outside.
  subroutine test_boundary(error)
    type(error_t), allocatable, intent(out) :: error
    integer :: distance(13, 13), col, row

    do row = 1, 13
      do col = 1, 13
        distance(col, row) = max(abs(row - 7), abs(col - 7), abs(row + col - 14))
      end do
    end do
    call check_true(error, all(boundary(distance <= 3) .eqv. distance == 3), 'rim of a hexagon')
    if (allocated(error)) return
    call check(error, count(boundary(distance >= 0)), 4*12, 'rim of the window')
    if (allocated(error)) return
    call check(error, cut_triangles(distance <= 0), 6, 'triangles about a node')
  end subroutine test_boundary

  !> Six nodes around one; and p^2 that is linear in r^2.
  subroutine test_circle(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(circle_fit_t) :: fit
    real(wp), allocatable :: x(:, :), y(:, :), pressure(:, :)
    real(wp) :: radii(6)
    integer :: k

    call new_window(lattice, x, y, error)
    if (allocated(error)) return
    radii = 0.5_wp + [(hypot(cos(k*pi/3) - 0.2_wp, sin(k*pi/3)), k=1, 6)]
    fit = boundary_circle(x, y, hypot(x, y) < 1.1_wp, 1.0_wp, [0.2_wp, 0.0_wp])
    associate (mean => sum(radii)/6)
      call check(error, [fit%radius, fit%mean_deviation, fit%standard_deviation], &
                 [mean, sum(abs(radii - mean))/(6*mean), sqrt(sum((radii - mean)**2)/6)/mean], 1.0e-14_wp, 'circle')
    end associate
    if (allocated(error)) return
    call check(error, fit%count, 6, 'boundary nodes')
    if (allocated(error)) return
    call check(error, area_radius(100, pi), 10.0_wp, 1.0e-14_wp, 'radius of an area')
    if (allocated(error)) return
    allocate (pressure, source=sqrt(max(0.0_wp, 1.0_wp - ((x - center(1))**2 + (y - center(2))**2)/11.37_wp**2)))
    call check(error, edge_radius(x, y, pressure, 1.0_wp, center), 11.37_wp, 1.0e-12_wp, 'radius of the edge')
    if (allocated(error)) return
    call check(error, pressure_center(x, y, merge(3.0_wp, 0.0_wp, abs(x - 4.0_wp) + abs(y) < 0.1_wp) + &
                                      merge(1.0_wp, 0.0_wp, abs(x) + abs(y) < 0.1_wp)), [3.0_wp, 0.0_wp], 1.0e-14_wp, 'centroid')
    if (allocated(error)) return
    pressure = 0.0_wp
    call check_true(error, ieee_is_nan(edge_radius(x, y, pressure, 1.0_wp, center)) .and. &
                    all(ieee_is_nan(pressure_center(x, y, pressure))), 'nothing is known without pressure')
  end subroutine test_circle

  !> The ellipse of Hertz, exactly from the pressure and roughly from the nodes.
  subroutine test_ellipses(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(ellipse_t) :: edge, nodes
    real(wp), allocatable :: x(:, :), y(:, :)

    call new_window(lattice, x, y, error)
    if (allocated(error)) return
    call edge_ellipse(x, y, sqrt(max(hertz_square(x, y), 0.0_wp)), 1.0_wp, edge, error)
    if (allocated(error)) return
    call check(error, [edge%semi_major, edge%semi_minor, edge%angle, edge%center], &
               [semi_major, semi_minor, angle, center], 1.0e-9_wp, 'ellipse of the edge')
    if (allocated(error)) return
    nodes = moment_ellipse(x, y, hertz_square(x, y) > 0.0_wp)
    call check(error, [nodes%semi_major, nodes%semi_minor, nodes%angle], [semi_major, semi_minor, angle], 0.1_wp, &
               'ellipse of the nodes')
    if (allocated(error)) return
    nodes = moment_ellipse(x, y, abs(x) < 0.1_wp)
    call check(error, [nodes%angle, nodes%semi_minor], [0.5_wp*pi, 0.0_wp], 1.0e-6_wp, 'a line along y')
  end subroutine test_ellipses

  !> A few nodes are no ellipse, nor is a saddle.
  subroutine test_no_ellipse(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: failure
    type(lattice_t) :: lattice
    type(ellipse_t) :: ellipse
    real(wp), allocatable :: x(:, :), y(:, :)

    call new_window(lattice, x, y, error)
    if (allocated(error)) return
    call edge_ellipse(x, y, merge(1.0_wp, 0.0_wp, hypot(x, y) < 1.5_wp), 1.0_wp, ellipse, failure)
    call check_raised(error, failure, status%invalid_input, 'too few nodes')
    if (allocated(error)) return
    call edge_ellipse(x, y, merge(sqrt(max(1.0_wp + (x/12)**2 - (y/13)**2, 0.0_wp)), 0.0_wp, hypot(x, y) < 12.0_wp), 1.0_wp, &
                      ellipse, failure)
    call check_raised(error, failure, status%invalid_input, 'a saddle')
  end subroutine test_no_ellipse

  !> Outer and inner edges of a ring, from the exact squares: only the layer of the lattice, 0.04, is in the way.
  subroutine test_ring(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(contact_edges_t) :: edges
    type(zone_edge_t) :: edge
    real(wp), allocatable :: x(:, :), y(:, :), inside(:, :)
    real(wp), parameter :: outer = 30.7_wp, inner = 10.2_wp, layer = 0.04_wp

    call new_window(lattice, x, y, error)
    if (allocated(error)) return
    allocate (inside, source=min(hypot(x, y) - inner, outer - hypot(x, y)))
    call new_contact_edges(edges, lattice, sqrt(max(inside, 0.0_wp)), 3.0_wp*max(-inside, 0.0_wp)**1.5_wp, &
                           inside > 0.0_wp, inside < huge(1.0_wp))
    edge = edges%contact_edge()
    call check(error, edge%area, pi*((outer + layer)**2 - (inner - layer)**2), 0.03_wp, 'area of a ring')
    if (allocated(error)) return
    call check(error, edge%radius(), sqrt(edge%area/pi), 1.0e-12_wp, 'its radius')
    if (allocated(error)) return
    call check(error, edge%length, 2.0_wp*pi*(outer + inner), 0.04_wp, 'length of its edges')
    if (allocated(error)) return
    associate (r => norm2(edge%segments, dim=1))
      call check_true(error, maxval(min(abs(r - outer), abs(r - inner))) < 0.052_wp, 'its edges are circles')
    end associate
  end subroutine test_ring

  !> Where a contact ends at nodes that can never touch it has the cells of its nodes, and no edge.
  subroutine test_punch(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(contact_edges_t) :: edges
    type(zone_edge_t) :: edge
    real(wp), allocatable :: x(:, :), y(:, :)
    logical, allocatable :: punch(:, :)

    call new_window(lattice, x, y, error)
    if (allocated(error)) return
    allocate (punch, source=hypot(x, y) < 20.3_wp)
    call new_contact_edges(edges, lattice, merge(1.0_wp, 0.0_wp, punch), 0.0_wp*x, punch, punch)
    edge = edges%contact_edge()
    call check(error, edge%area, count(punch)*lattice%cell_area(), 1.0e-9_wp, 'area of a punch')
    if (allocated(error)) return
    call check(error, size(edge%segments), 0, 'pieces of its edge')
    if (allocated(error)) return
    edge = edges%stick_edge(punch, 1.0_wp + 0.0_wp*x)
    call check(error, edge%area, count(punch)*lattice%cell_area(), 1.0e-9_wp, 'area, all of it stuck')
    if (allocated(error)) return
    ! its outline is straight between the middles of links, so that a convex zone has a quarter of a cell less
    call check(error, area_of(edges%mesh(x, vanishes=.false.)), edge%area - 0.25_wp*lattice%cell_area(), &
               1.0e-9_wp*edge%area, 'mesh of the cells')
  end subroutine test_punch

  !> Area of the triangles of a mesh.
  pure real(wp) function area_of(mesh) result(total)
    type(zone_mesh_t), intent(in) :: mesh
    integer :: k

    total = 0.0_wp
    do k = 1, size(mesh%triangles, 2)
      associate (at => mesh%points(:, mesh%triangles(:, k)))
        associate (a => at(:, 2) - at(:, 1), b => at(:, 3) - at(:, 1))
          total = total + 0.5_wp*(a(1)*b(2) - a(2)*b(1))
        end associate
      end associate
    end do
  end function area_of

  !> Of an elliptic contact: half-axes of its edge, area of its mesh, fields that vanish at its edge or go on there.
  subroutine test_mesh(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(contact_edges_t) :: edges
    type(zone_edge_t) :: edge
    type(zone_mesh_t) :: mesh
    real(wp), allocatable :: x(:, :), y(:, :), u(:, :), v(:, :), square(:, :), distance(:, :)

    call new_window(lattice, x, y, error)
    if (allocated(error)) return
    allocate (u, source=(cos(angle)*(x - center(1)) + sin(angle)*(y - center(2)))/semi_major)
    allocate (v, source=(cos(angle)*(y - center(2)) - sin(angle)*(x - center(1)))/semi_minor)
    allocate (square, source=1.0_wp - u**2 - v**2)
    call new_contact_edges(edges, lattice, sqrt(max(square, 0.0_wp)), max(-square, 0.0_wp)**1.5_wp, &
                           square > 0.0_wp, square < huge(1.0_wp))
    edge = edges%contact_edge()
    associate (found => edge%ellipse)
      call check(error, [found%semi_major, found%semi_minor, found%center], [semi_major, semi_minor, center], 0.08_wp, &
                 'half-axes and center of an ellipse')
      if (allocated(error)) return
      call check(error, found%angle, angle, 1.0e-3_wp, 'its direction')
      if (allocated(error)) return
      call check(error, pi*found%semi_major*found%semi_minor, edge%area, 1.0e-3_wp*edge%area, 'its area')
      if (allocated(error)) return
    end associate

    mesh = edges%mesh(square, vanishes=.true.)
    call check(error, area_of(mesh), edge%area, 1.0e-9_wp*edge%area, 'area of the mesh')
    if (allocated(error)) return
    call check(error, count(mesh%values > 0.0_wp), count(square > 0.0_wp), 'nodes of the mesh')
    if (allocated(error)) return
    mesh = edges%mesh(3.0_wp - 2.0_wp*x + y, vanishes=.false.)
    associate (off => abs(mesh%values - (3.0_wp - 2.0_wp*mesh%points(1, :) + mesh%points(2, :))))
      ! but where only one node of a line lies inside
      call check_true(error, count(off > 1.0e-9_wp) <= 8 .and. maxval(off) < 3.0_wp, 'a linear field goes on to the edge')
    end associate
    if (allocated(error)) return
    allocate (distance, source=edges%distances())
    call check_true(error, all((distance > 0.0_wp) .eqv. (square > 0.0_wp)), 'distances are positive inside')
  end subroutine test_mesh

  !> The reserve of friction within a contact: a disc, from the inside alone; where all sticks, the edge of the contact.
  subroutine test_stick(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(contact_edges_t) :: edges
    type(zone_edge_t) :: edge, contact
    real(wp), allocatable :: x(:, :), y(:, :), inside(:, :), square(:, :)
    real(wp), parameter :: radius = 11.4_wp

    call new_window(lattice, x, y, error)
    if (allocated(error)) return
    allocate (inside, source=30.7_wp - hypot(x, y))
    call new_contact_edges(edges, lattice, sqrt(max(inside, 0.0_wp)), 3.0_wp*max(-inside, 0.0_wp)**1.5_wp, &
                           inside > 0.0_wp, inside < huge(1.0_wp))
    contact = edges%contact_edge()
    edge = edges%stick_edge(inside > 0.0_wp, 0.0_wp*x + 1.0_wp)
    call check(error, edge%area, contact%area, 1.0e-9_wp, 'stick up to the edge of the contact')
    if (allocated(error)) return
    allocate (square, source=1.0_wp - (x**2 + y**2)/radius**2)
    edge = edges%stick_edge(square > 0.0_wp, sqrt(max(square, 0.0_wp)))
    call check(error, edge%radius(), radius, 0.12_wp, 'a disc that sticks')
    if (allocated(error)) return
    edge = edges%stick_edge(square > 2.0_wp, square)
    call check(error, edge%area, 0.0_wp, 0.0_wp, 'no node sticks')
  end subroutine test_stick

  !> Of a node with its neighbors the gradient is zero but for rounding, which must not turn the edge.
  subroutine test_few_nodes(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(contact_edges_t) :: edges
    type(zone_edge_t) :: edge, again
    real(wp), allocatable :: x(:, :), y(:, :), reserve(:, :)

    call new_window(lattice, x, y, error)
    if (allocated(error)) return
    call new_contact_edges(edges, lattice, 0.0_wp*x + 1.0_wp, 0.0_wp*x, x < huge(1.0_wp), x < huge(1.0_wp))
    allocate (reserve, source=sqrt(max(1.0_wp - (x**2 + y**2)/1.4_wp**2, 0.0_wp)))
    edge = edges%stick_edge(hypot(x, y) < 1.1_wp, reserve)
    call check(error, edge%radius(), 1.4_wp, 0.3_wp, 'seven nodes that stick')
    if (allocated(error)) return
    again = edges%stick_edge(hypot(x, y) < 1.1_wp, reserve*(1.0_wp + 1.0e-15_wp*sin(9.0_wp*x + 5.0_wp*y)))
    call check(error, again%area, edge%area, 1.0e-13_wp, 'the same, with other rounding errors')
  end subroutine test_few_nodes

  !> Areas of symmetric contacts of 7, 13 and 19 nodes follow the pressure: an error of 1e-6 is one of 1e-5.
  subroutine test_symmetric_nodes(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(contact_edges_t) :: edges
    type(zone_edge_t) :: contact(2), sticking(2)
    real(wp), allocatable :: x(:, :), y(:, :), pressure(:, :), gap(:, :)
    real(wp), parameter :: radius(3) = [1.4_wp, 1.9_wp, 2.3_wp], noise = 1.0e-6_wp
    integer :: i, k

    call new_window(lattice, x, y, error)
    if (allocated(error)) return
    allocate (pressure, gap, mold=x)
    do i = 1, size(radius)
      gap = max(hypot(x, y) - radius(i), 0.0_wp)**1.5_wp
      do k = 1, 2
        pressure = sqrt(max(1.0_wp - (x**2 + y**2)/radius(i)**2, 0.0_wp))*(1.0_wp + (k - 1)*noise*sin(9.0_wp*x + 5.0_wp*y))
        call new_contact_edges(edges, lattice, pressure, gap, pressure > 0.0_wp, x < huge(1.0_wp))
        contact(k) = edges%contact_edge()
        sticking(k) = edges%stick_edge(pressure > 0.0_wp, 0.3_wp*pressure)
      end do
      call check(error, contact(1)%radius(), radius(i), 0.3_wp, 'radius')
      if (allocated(error)) return
      call check(error, contact(2)%area, contact(1)%area, 10.0_wp*noise, 'contact area')
      if (allocated(error)) return
      call check(error, sticking(2)%area, sticking(1)%area, 10.0_wp*noise, 'stick area')
      if (allocated(error)) return
    end do
  end subroutine test_symmetric_nodes

  !> Linear fields are met anywhere; zones are those of the nearest node.
  subroutine test_between(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    real(wp), allocatable :: x(:, :), y(:, :), values(:, :)
    integer :: node(2)
    logical :: inside
    real(wp), parameter :: point(2) = [1.23_wp, -4.56_wp], away = -7.0_wp

    call new_window(lattice, x, y, error)
    if (allocated(error)) return
    allocate (values, source=2.0_wp*x - 3.0_wp*y)
    call check(error, interpolate(lattice, values, point, away), 2.0_wp*point(1) - 3.0_wp*point(2), 1.0e-7_wp, 'a linear field')
    if (allocated(error)) return
    call check(error, interpolate(lattice, values, [x(7, 9), y(7, 9)], away), values(7, 9), 1.0e-12_wp, 'at a node')
    if (allocated(error)) return
    call check(error, interpolate(lattice, values, [1.0e9_wp, 0.0_wp], away), away, 0.0_wp, 'outside')
    if (allocated(error)) return
    call check(error, interpolate(lattice, 0.0_wp*x + 1.0_wp, [x(1, 9) - 0.25_wp, y(1, 9)], away), &
               0.75_wp + 0.25_wp*away, 1.0e-8_wp, 'a quarter of the way to a node outside')
    if (allocated(error)) return
    associate (near => minloc(hypot(x - point(1), y - point(2))))
      call nearest_node(lattice, point, node, inside)
      call check_true(error, inside .and. all(node == near - 1), 'the nearest node')
    end associate
    if (allocated(error)) return
    call nearest_node(lattice, [x(1, 9) - 0.6_wp, y(1, 9)], node, inside)
    call check_true(error, .not. inside .and. all(node == [0, 8]), 'the nearest is outside')
    if (allocated(error)) return
    call nearest_node(lattice, [1.0e30_wp, y(1, 9)], node, inside)
    call check_true(error, .not. inside, 'a point far away')
  end subroutine test_between

  !> Between the nodes at the edge the pressure of Hertz, of unit radius: three times closer than straight lines.
  subroutine test_pressure_between(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(normal_contact_t) :: contact
    type(contact_state_t) :: state
    type(contact_edges_t) :: edges
    real(wp), allocatable :: x(:, :), y(:, :), squares(:, :)
    real(wp) :: at(2), off(2), exact
    integer :: k

    call new_lattice(lattice, equilateral_basis(1.0_wp/20), [-30, -30], [61, 61], error, origin=[0.011_wp, 0.007_wp])
    if (allocated(error)) return
    allocate (x(61, 61), y(61, 61))
    call lattice%coordinates(x, y)
    call new_normal_contact(contact, lattice, elastic_pair_t(1.0_wp/pi, 0.0_wp, 0.0_wp), 0.5_wp*(x**2 + y**2), x < 9.0_wp, error)
    if (allocated(error)) return
    call contact%solve(force_control, 4.0_wp/3.0_wp, 1.0e-9_wp, 60, state, error)
    if (allocated(error)) return
    call new_contact_edges(edges, lattice, state%pressure, state%gap, state%pressure > 0.0_wp, x < 9.0_wp)
    allocate (squares, source=edges%squares())
    call check_true(error, ieee_is_nan(squares(31, 31)), 'in the middle there are no squares')
    if (allocated(error)) return
    off = 0.0_wp
    do k = 1, 2000
      at = (0.85_wp + 0.0001_wp*k)*[cos(1.7_wp*k), sin(1.7_wp*k)]
      exact = 2.0_wp/pi*sqrt(max(1.0_wp - norm2(at)**2, 0.0_wp))
      off(1) = off(1) + (interpolate_pressure(lattice, state%pressure, squares, at) - exact)**2
      off(2) = off(2) + (interpolate(lattice, state%pressure, at, 0.0_wp) - exact)**2
    end do
    call check_true(error, 3.0_wp*sqrt(off(1)) < sqrt(off(2)), 'pressure near the edge')
    if (allocated(error)) return
    at = [0.12_wp, 0.34_wp]
    call check(error, interpolate_pressure(lattice, state%pressure, squares, at), &
               interpolate(lattice, state%pressure, at, 0.0_wp), 0.0_wp, 'pressure in the middle')
  end subroutine test_pressure_between

  !> Cattaneo and Mindlin: q = mu p0 (sqrt(1 - r^2) - c sqrt(1 - r^2/c^2)) on Hertz' pressure, stick within c; between the nodes,
  !> too, and where the shear traction has a bound, and friction a reserve of its own.
  subroutine test_shear_between(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(contact_edges_t) :: edges
    type(traction_field_t) :: field
    real(wp), allocatable :: x(:, :), y(:, :), r(:, :), traction(:, :, :), reserve(:, :)
    type(nodal_coulomb_t) :: law
    real(wp), parameter :: radius = 31.3_wp, stick = 17.6_wp, bound = 0.4_wp, coefficient = 0.5_wp
    real(wp) :: at(2), found(3)
    integer :: k

    call new_window(lattice, x, y, error)
    if (allocated(error)) return
    r = hypot(x, y)
    allocate (traction(size(x, 1), size(x, 2), 3), source=0.0_wp)
    traction(:, :, 1) = pressure(r)
    traction(:, :, 2) = shear(r)
    allocate (law%coefficient(size(x)), source=coefficient)
    law%shear_limit = bound
    call new_contact_edges(edges, lattice, traction(:, :, 1), max(r - radius, 0.0_wp)**1.5_wp, r < radius, x < huge(1.0_wp))
    call new_traction_field(field, lattice, edges, traction, r < radius, r < stick, coulomb_t(coefficient))
    reserve = merge(coefficient*pressure(r) - shear(r), 0.0_wp, r < stick)
    call check(error, maxval(abs(field%reserve - reserve)), 0.0_wp, 1.0e-14_wp, 'reserve of the nodes that stick')
    if (allocated(error)) return
    do k = 1, 500
      at = 0.07_wp*k*[cos(1.7_wp*k), sin(1.7_wp*k)]
      found = field%at(at)
      call check(error, found(2:3), [shear(norm2(at)), 0.0_wp], 0.03_wp, 'shear traction between the nodes')
      if (allocated(error)) return
      call check_true(error, norm2(found(2:3)) <= coefficient*found(1) + 1.0e-15_wp, 'within friction')
      if (allocated(error)) return
    end do
    ! a bound below mu p in the middle
    traction(:, :, 2) = min(traction(:, :, 2), bound - 0.1_wp)
    call new_traction_field(field, lattice, edges, traction, r < radius, r < stick, law)
    reserve = merge(min(coefficient*pressure(r), bound) - traction(:, :, 2), 0.0_wp, r < stick)
    call check(error, maxval(abs(field%reserve - reserve)), 0.0_wp, 1.0e-14_wp, 'reserve below a bound')

  contains

    elemental real(wp) function pressure(r)
      real(wp), intent(in) :: r
      pressure = sqrt(max(1.0_wp - (r/radius)**2, 0.0_wp))
    end function pressure

    elemental real(wp) function shear(r)
      real(wp), intent(in) :: r
      shear = coefficient*(pressure(r) - stick/radius*sqrt(max(1.0_wp - (r/stick)**2, 0.0_wp)))
    end function shear

  end subroutine test_shear_between

  !> About the edge of a disc: nodes whose neighbors are all in a part, and nodes beside it, are those of rings of the lattice.
  subroutine test_band(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(edge_band_t) :: band
    real(wp), allocatable :: x(:, :), y(:, :)
    logical, allocatable :: part(:), hole(:, :)

    call new_window(lattice, x, y, error)
    if (allocated(error)) return
    call new_edge_band(band, hypot(x, y) < 20.0_wp, edge_options_t())
    ! the whole band but for one node, which lies in the middle of it
    allocate (hole(size(x, 1), size(x, 2)), source=.true.)
    hole(51 + 20, 51) = .false.
    part = band%part_of(hole)
    call check(error, count(.not. part), 1, 'the hole is in the band')
    if (allocated(error)) return
    call check_true(error, all(band%surrounded(part) .eqv. surrounded(part)), 'nodes that are surrounded')
    if (allocated(error)) return
    call check_true(error, all(band%next_to(.not. part) .eqv. beside(.not. part)), 'nodes beside the hole')
    if (allocated(error)) return
    call check(error, count(band%next_to(.not. part)), 6, 'six of them')

  contains

    !> Distances of one spacing make neighbors.
    pure function neighbors_of(k) result(is)
      integer, intent(in) :: k
      logical :: is(band%n)
      integer :: j

      do j = 1, band%n
        associate (step => matmul(equilateral_basis(1.0_wp), real(band%node(:, j) - band%node(:, k), wp)))
          is(j) = abs(norm2(step) - 1.0_wp) < 1.0e-9_wp
        end associate
      end do
    end function neighbors_of

    function surrounded(part) result(is)
      logical, intent(in) :: part(:)
      logical :: is(size(part))
      integer :: k

      do k = 1, size(part)
        is(k) = part(k) .and. count(neighbors_of(k) .and. part) == 6
      end do
    end function surrounded

    function beside(part) result(is)
      logical, intent(in) :: part(:)
      logical :: is(size(part))
      integer :: k

      do k = 1, size(part)
        is(k) = any(neighbors_of(k) .and. part)
      end do
    end function beside

  end subroutine test_band

  !> Squares that are a paraboloid are met exactly, whatever errors the nodes had; a half turn of the window, which cuts the
  !> contact, turns the fit of any others.
  subroutine test_fit(error)
    type(error_t), allocatable, intent(out) :: error
    type(edge_options_t) :: options
    type(lattice_t) :: lattice
    integer, parameter :: m = 14, l = 11
    real(wp), dimension(m, l) :: x, y, distance, exact, squares, turned
    logical :: inner(m, l)
    integer :: k

    call new_lattice(lattice, equilateral_basis(1.0_wp), [0, 0], [m, l], error)
    if (allocated(error)) return
    call lattice%coordinates(x, y)
    ! the edge runs from one side of the window to the opposite one
    distance = 0.8_wp*(x - y) - 1.1_wp
    exact = 3.0_wp + 0.5_wp*x - 0.7_wp*y + 0.02_wp*x**2 - 0.03_wp*x*y + 0.01_wp*y**2
    options%fit_share = 1.0_wp
    squares = exact + 0.1_wp
    call fit_squares(squares, sign(sqrt(abs(exact)), exact), distance, options)
    ! in the corners there are too few nodes
    inner = .false.
    inner(4:m - 3, 4:l - 3) = .true.
    associate (near => inner .and. distance <= options%fit_depth .and. distance >= 0.0_wp)
      call check_true(error, count(near) > 5, 'there are nodes to be fitted')
      if (allocated(error)) return
      call check(error, maxval(abs(squares - exact), mask=near), 0.0_wp, 1.0e-9_wp, 'a paraboloid')
      if (allocated(error)) return
      call check(error, maxval(abs(squares - exact - 0.1_wp), mask=distance > options%fit_depth), 0.0_wp, 1.0e-14_wp, &
                 'nothing else is touched')
    end associate
    if (allocated(error)) return
    exact = sqrt(max(distance, 0.0_wp))*(1.0_wp + 0.1_wp*reshape(sin([(1.3_wp*k, k=1, m*l)]), [m, l]))
    ! edges everywhere, on all sides of the window
    distance = 1.5_wp + sin(x + 2.0_wp*y)
    squares = exact**2
    call fit_squares(squares, exact, distance, options)
    turned = half_turn(exact**2)
    call fit_squares(turned, half_turn(exact), half_turn(distance), options)
    call check(error, maxval(abs(half_turn(turned) - squares)), 0.0_wp, 1.0e-9_wp, 'a half turn')

  contains

    pure function half_turn(field) result(turned)
      real(wp), intent(in) :: field(m, l)
      real(wp) :: turned(m, l)
      turned = field(m:1:-1, l:1:-1)
    end function half_turn

  end subroutine test_fit

end module test_edges
