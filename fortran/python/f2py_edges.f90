!> Edges of contact and stick areas, for Python: flat procedures for f2py, no mathematics.
!>
!> Fields have the shape (n_col, n_row), and zones are integers: not zero at nodes of the zone. The module has no state,
!> so that several threads may call at a time.
!>
!> `fields` are the pressure [Pa], the gap [m] and the reserve of friction [Pa]; `zones` the nodes in contact, those that can
!> touch and those that stick. The third of each matters to the edge of the stick area only.
module hc_f2py_edges
  use iso_c_binding, only: c_double, c_int, c_int64_t
  use hc_error, only: error_t, status, raise
  use hc_memory, only: require_memory
  use hc_f2py_handles, only: report, kernel_cache
  use hc_field_space, only: field_space_t, space_over
  use hc_elastic_pair, only: elastic_pair_t
  use hc_lattice, only: lattice_t, new_lattice
  use hc_contact_edges, only: contact_edges_t, new_contact_edges
  use hc_edge_tractions, only: correct_at_edges, edge_tractions_memory
  use hc_traction_field, only: traction_field_t, new_traction_field, field_of_arrays
  use hc_stress_at_edges, only: edge_traction_t, correct_stress_at_edges
  use hc_edge_roots_of_contact, only: new_edge_of_contact, new_edge_of_stick
  use hc_zone_edge, only: zone_edge_t, zone_mesh_t, cut_triangles
  implicit none
  private

  public :: count_cut_triangles, edge_of_zone, mesh_of_zone, distances_of_zone, tractions_to_edges, memory_of_edges, &
            stress_to_edges, field_of_tractions, tractions_at_points, tractions_at_nodes

contains

  !> Count the triangles that the edge of a zone cuts.
  subroutine count_cut_triangles(n_col, n_row, zone, n_cut)
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Zone
    integer(c_int), intent(in) :: zone(n_col, n_row)
    !> Number of triangles
    integer(c_int), intent(out) :: n_cut
    n_cut = cut_triangles(zone /= 0)
  end subroutine count_cut_triangles

  !> Find the edge of the contact area, or of the part of it that sticks.
  subroutine edge_of_zone(n_col, n_row, basis, start, fields, zones, of_stick, &
                          n_cut, numbers, segments, n_segment, code, message)
    !f2py threadsafe
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Basis vectors as columns, position of the first node [m]
    real(c_double), intent(in) :: basis(2, 2), start(2)
    !> Pressure, gap, reserve of friction; nodes in contact, that can touch, that stick
    real(c_double), intent(in) :: fields(n_col, n_row, 3)
    integer(c_int), intent(in) :: zones(n_col, n_row, 3)
    !> Not zero: the edge of the stick area
    integer(c_int), intent(in) :: of_stick
    !> Triangles that the edge cuts
    integer(c_int), intent(in) :: n_cut
    !> Area [m^2]; radius of the disc with that area, length of the edge [m]; semi-axes [m], angle [rad] and center [m] of
    !> the ellipse with its moments
    real(c_double), intent(out) :: numbers(8)
    !> Pieces of the edge: x and y, first and last point [m]
    real(c_double), intent(out) :: segments(2, 2, n_cut)
    !> Number of pieces
    integer(c_int), intent(out) :: n_segment
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(contact_edges_t) :: edges
    type(zone_edge_t) :: edge

    numbers = 0.0_c_double
    segments = 0.0_c_double
    n_segment = 0
    call set_edges(basis, start, fields, zones, edges, error)
    if (.not. allocated(error)) then
      if (of_stick /= 0) then
        edge = edges%stick_edge(zones(:, :, 3) /= 0, fields(:, :, 3))
      else
        edge = edges%contact_edge()
      end if
      associate (ellipse => edge%ellipse)
        numbers = [edge%area, edge%radius(), edge%length(), ellipse%semi_major, ellipse%semi_minor, ellipse%angle, ellipse%center]
      end associate
      n_segment = size(edge%segments, 3)
      if (n_segment > n_cut) then
        call raise(error, status%invalid_input, 'the edge cuts more triangles than were counted')
      else
        segments(:, :, :n_segment) = edge%segments
      end if
    end if
    call report(error, code, message)
  end subroutine edge_of_zone

  !> Set up the tractions between the nodes, for `tractions_at_points` and `tractions_at_nodes`.
  subroutine field_of_tractions(n_col, n_row, basis, gap, zones, traction, limits, limited, n_part, parts, code, message)
    !f2py threadsafe
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Basis vectors as columns, gap [m]
    real(c_double), intent(in) :: basis(2, 2), gap(n_col, n_row)
    !> Nodes in contact, that can touch, that stick
    integer(c_int), intent(in) :: zones(n_col, n_row, 3)
    !> Pressure and shear traction [Pa]
    real(c_double), intent(in) :: traction(n_col, n_row, 3)
    !> Coefficient of friction, and bound of the shear traction [Pa]
    real(c_double), intent(in) :: limits(n_col, n_row, 2)
    !> Not zero: these are known
    integer(c_int), intent(in) :: limited
    !> Number of arrays: 5, or 13 with limits
    integer(c_int), intent(in) :: n_part
    !> The field as arrays
    real(c_double), intent(out) :: parts(n_col, n_row, n_part)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(lattice_t) :: lattice
    type(contact_edges_t) :: edges
    type(traction_field_t) :: field

    call new_lattice(lattice, basis, [0, 0], [n_col, n_row], error)
    if (.not. allocated(error)) then
      call new_contact_edges(edges, lattice, traction(:, :, 1), gap, zones(:, :, 1) /= 0, zones(:, :, 2) /= 0)
      if (limited /= 0) then
        call new_traction_field(field, lattice, edges, traction, zones(:, :, 1) /= 0, zones(:, :, 3) /= 0, limits(:, :, 1), &
                                limits(:, :, 2))
      else
        call new_traction_field(field, lattice, edges, traction, zones(:, :, 1) /= 0, zones(:, :, 3) /= 0)
      end if
      call field%arrays(parts)
    else
      parts = 0.0_c_double
    end if
    call report(error, code, message)
  end subroutine field_of_tractions

  !> Return pressure and shear traction at points.
  subroutine tractions_at_points(n_col, n_row, n_part, basis, start, parts, n, x, y, found, code, message)
    !f2py threadsafe
    !> Number of columns, rows and arrays
    integer(c_int), intent(in) :: n_col, n_row, n_part
    !> Basis vectors as columns, position of the first node [m]
    real(c_double), intent(in) :: basis(2, 2), start(2)
    !> The field, see `field_of_tractions`
    real(c_double), intent(in) :: parts(n_col, n_row, n_part)
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Points [m]
    real(c_double), intent(in) :: x(n), y(n)
    !> Pressure and shear traction there [Pa]
    real(c_double), intent(out) :: found(3, n)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(lattice_t) :: lattice
    type(traction_field_t) :: field
    integer :: i

    found = 0.0_c_double
    call new_lattice(lattice, basis, [0, 0], [n_col, n_row], error, start)
    if (.not. allocated(error)) then
      call field_of_arrays(field, lattice, parts, n_part > 5)
      do i = 1, n
        found(:, i) = field%at([x(i), y(i)])
      end do
    end if
    call report(error, code, message)
  end subroutine tractions_at_points

  !> Return pressure and shear traction at all nodes.
  subroutine tractions_at_nodes(n_col, n_row, n_part, parts, found)
    !f2py threadsafe
    !> Number of columns, rows and arrays
    integer(c_int), intent(in) :: n_col, n_row, n_part
    !> The field, see `field_of_tractions`
    real(c_double), intent(in) :: parts(n_col, n_row, n_part)
    !> Pressure and shear traction [Pa]
    real(c_double), intent(out) :: found(n_col, n_row, 3)
    type(traction_field_t) :: field

    call field_of_arrays(field, lattice_t(), parts, n_part > 5)
    found = field%at_nodes()
  end subroutine tractions_at_nodes

  !> Correct tractions at the edges of the contact and of the stick area.
  subroutine tractions_to_edges(n_col, n_row, basis, lambda, gap, zones, friction, traction, threads, corrected, code, message)
    !f2py threadsafe
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Basis vectors as columns [m]
    real(c_double), intent(in) :: basis(2, 2)
    !> Elastic constants lambda_1, lambda_2, lambda_5 [1/Pa]
    real(c_double), intent(in) :: lambda(3)
    !> Gap [m] and coefficient of friction
    real(c_double), intent(in) :: gap(n_col, n_row), friction(n_col, n_row)
    !> Nodes in contact, that can touch, that stick
    integer(c_int), intent(in) :: zones(n_col, n_row, 3)
    !> Pressure and shear traction [Pa], and the corrected ones
    real(c_double), intent(in) :: traction(n_col, n_row, 3)
    !> Threads to use; 0: as many as OpenMP would take
    integer(c_int), intent(in) :: threads
    real(c_double), intent(out) :: corrected(n_col, n_row, 3)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(lattice_t) :: lattice
    type(contact_edges_t) :: edges
    type(field_space_t) :: space

    corrected = traction
    space = space_over([n_col, n_row], threads)
    call new_lattice(lattice, basis, [0, 0], [n_col, n_row], error)
    if (.not. allocated(error)) then
      call require_memory(edge_tractions_memory([n_col, n_row], count(zones(:, :, 1) /= 0), maxval(friction) > 0.0_c_double, &
                                                space%threads, abs(lambda(2)) > 0.0_c_double), error, space%threads)
    end if
    if (.not. allocated(error)) then
      call new_contact_edges(edges, lattice, traction(:, :, 1), gap, zones(:, :, 1) /= 0, zones(:, :, 2) /= 0)
      call correct_at_edges(lattice, edges, elastic_pair_t(lambda(1), lambda(2), lambda(3)), zones(:, :, 1) /= 0, &
                            zones(:, :, 3) /= 0, friction, corrected, space, error, kernel_cache)
    end if
    call report(error, code, message)
  end subroutine tractions_to_edges

  !> Correct the stress at points near the edges of contact and stick for what hats miss of the tractions there.
  subroutine stress_to_edges(n_col, n_row, n_point, basis, start, gap, zones, friction, traction, corrected, body, poisson_ratio, &
                             points, threads, correction, refused, code, message)
    !f2py threadsafe
    !> Number of columns and rows, and of points
    integer(c_int), intent(in) :: n_col, n_row, n_point
    !> Basis vectors as columns, position of the first node [m]
    real(c_double), intent(in) :: basis(2, 2), start(2)
    !> Gap [m] and coefficient of friction, 0 if shear tractions do not follow the pressure
    real(c_double), intent(in) :: gap(n_col, n_row), friction(n_col, n_row)
    !> Nodes in contact, that can touch, that stick
    integer(c_int), intent(in) :: zones(n_col, n_row, 3)
    !> Pressure and shear traction at the nodes, and corrected at the edges [Pa]
    real(c_double), intent(in) :: traction(n_col, n_row, 3), corrected(n_col, n_row, 3)
    !> Number of the body and its Poisson's ratio
    integer(c_int), intent(in) :: body
    real(c_double), intent(in) :: poisson_ratio
    !> x, y and depth [m]
    real(c_double), intent(in) :: points(3, n_point)
    !> Threads to use; 0: as many as OpenMP would take
    integer(c_int), intent(in) :: threads
    !> Stress xx, yy, zz, xy, yz, xz [Pa], and the share of the edge of the contact whose pressure is no root
    real(c_double), intent(out) :: correction(6, n_point), refused
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(lattice_t) :: lattice
    type(contact_edges_t) :: edges
    type(edge_traction_t) :: near
    type(field_space_t) :: space
    real(c_double) :: of_stick ! growing stick areas have none, and where they reach the edge of the contact that is their edge

    correction = 0.0_c_double
    refused = 0.0_c_double
    of_stick = 0.0_c_double
    space = space_over([n_col, n_row], threads)
    call new_lattice(lattice, basis, [0, 0], [n_col, n_row], error, start)
    if (.not. allocated(error)) then
      call new_contact_edges(edges, lattice, traction(:, :, 1), gap, zones(:, :, 1) /= 0, zones(:, :, 2) /= 0)
      call new_edge_of_contact(near, lattice, edges, zones /= 0, friction, traction, corrected)
      call correct_stress_at_edges(near, body, poisson_ratio, points, space%threads, correction, refused)
      if (any(friction > 0.0_c_double) .and. any(zones(:, :, 3) /= 0)) then
        call new_edge_of_stick(near, lattice, edges, zones /= 0, friction, traction, corrected)
        call correct_stress_at_edges(near, body, poisson_ratio, points, space%threads, correction, of_stick)
      end if
    end if
    call report(error, code, message)
  end subroutine stress_to_edges

  !> Count the bytes that the correction at the edges takes.
  subroutine memory_of_edges(n_col, n_row, n_contact, sheared, unlike, threads, bytes)
    !> Number of columns and rows, and of nodes in contact
    integer(c_int), intent(in) :: n_col, n_row, n_contact
    !> Not zero: shear tractions are corrected, too; the materials are unlike
    integer(c_int), intent(in) :: sheared, unlike
    !> Threads to use; 0: as many as OpenMP would take
    integer(c_int), intent(in) :: threads
    integer(c_int64_t), intent(out) :: bytes
    type(field_space_t) :: space

    space = space_over([n_col, n_row], threads)
    bytes = edge_tractions_memory([n_col, n_row], n_contact, sheared /= 0, space%threads, unlike /= 0)
  end subroutine memory_of_edges

  !> Fill the contact area, or the part of it that sticks, with triangles, and carry a field there.
  subroutine mesh_of_zone(n_col, n_row, basis, start, fields, zones, of_stick, &
                          field, vanishes, n_point, n_triangle, points, values, triangles, numbers, code, message)
    !f2py threadsafe
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Basis vectors as columns, position of the first node [m]
    real(c_double), intent(in) :: basis(2, 2), start(2)
    !> Pressure, gap, reserve of friction; nodes in contact, that can touch, that stick
    real(c_double), intent(in) :: fields(n_col, n_row, 3)
    integer(c_int), intent(in) :: zones(n_col, n_row, 3)
    !> Not zero: the stick area
    integer(c_int), intent(in) :: of_stick
    !> Values at the nodes; not zero: they vanish at the edge of the contact
    real(c_double), intent(in) :: field(n_col, n_row)
    integer(c_int), intent(in) :: vanishes
    !> Room for points and triangles
    integer(c_int), intent(in) :: n_point, n_triangle
    !> Corners [m], and values there
    real(c_double), intent(out) :: points(2, n_point), values(n_point)
    !> Corners of each triangle, counted from 1
    integer(c_int), intent(out) :: triangles(3, n_triangle)
    !> Number of points and of triangles
    integer(c_int), intent(out) :: numbers(2)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(contact_edges_t) :: edges
    type(zone_mesh_t) :: mesh

    points = 0.0_c_double
    values = 0.0_c_double
    triangles = 0
    numbers = 0
    call set_edges(basis, start, fields, zones, edges, error)
    if (.not. allocated(error)) then
      if (of_stick /= 0) then
        mesh = edges%stick_mesh(zones(:, :, 3) /= 0, fields(:, :, 3), field)
      else
        mesh = edges%contact_mesh(field, vanishes /= 0)
      end if
      numbers = [mesh%n_point, mesh%n_triangle]
      if (numbers(1) > n_point .or. numbers(2) > n_triangle) then
        call raise(error, status%invalid_input, 'the zone has more triangles than were counted')
      else
        points(:, :numbers(1)) = mesh%points
        values(:numbers(1)) = mesh%values
        triangles(:, :numbers(2)) = mesh%triangles
      end if
    end if
    call report(error, code, message)
  end subroutine mesh_of_zone

  !> Return the distances of all nodes from the edge of the contact area, or of the part of it that sticks.
  subroutine distances_of_zone(n_col, n_row, basis, fields, zones, of_stick, &
                               distances, code, message)
    !f2py threadsafe
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Basis vectors as columns [m]
    real(c_double), intent(in) :: basis(2, 2)
    !> Pressure, gap, reserve of friction; nodes in contact, that can touch, that stick
    real(c_double), intent(in) :: fields(n_col, n_row, 3)
    integer(c_int), intent(in) :: zones(n_col, n_row, 3)
    !> Not zero: of the stick area
    integer(c_int), intent(in) :: of_stick
    !> Distances in spacings, positive inside
    real(c_double), intent(out) :: distances(n_col, n_row)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(contact_edges_t) :: edges

    distances = 0.0_c_double
    call set_edges(basis, [0.0_c_double, 0.0_c_double], fields, zones, edges, error)
    if (.not. allocated(error)) then
      if (of_stick /= 0) then
        distances = edges%stick_distances(zones(:, :, 3) /= 0, fields(:, :, 3))
      else
        distances = edges%contact_distances()
      end if
    end if
    call report(error, code, message)
  end subroutine distances_of_zone

  !> Find the edges of a contact, with the first node at a position.
  subroutine set_edges(basis, start, fields, zones, edges, error)
    real(c_double), intent(in) :: basis(2, 2), start(2), fields(:, :, :)
    integer(c_int), intent(in) :: zones(:, :, :)
    type(contact_edges_t), intent(out) :: edges
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice

    call new_lattice(lattice, basis, [0, 0], shape(fields(:, :, 1)), error, start)
    if (allocated(error)) return
    call new_contact_edges(edges, lattice, fields(:, :, 1), fields(:, :, 2), zones(:, :, 1) /= 0, zones(:, :, 2) /= 0)
  end subroutine set_edges

end module hc_f2py_edges
