!> Edges of contact and stick areas for Python.
!>
!> `fields` are the pressure [Pa], the gap [m] and the reserve of friction [Pa]; `zones` the nodes in contact, those that can
!> touch and those that stick. The third of each matters to the edge of the stick area only.
module hc_f2py_edges
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_memory, only: require_memory
  use hc_f2py_handles, only: kernel_cache
  use hc_field_space, only: field_space_t, space_over
  use hc_elastic_medium, only: elastic_medium_t
  use hc_lattice, only: lattice_t
  use hc_friction_law, only: friction_law_t
  use hc_contact_edges, only: contact_edges_t, new_contact_edges
  use hc_flexibility_fft, only: spectra_of
  use hc_edge_tractions, only: correct_at_edges, edge_tractions_memory
  use hc_traction_field, only: traction_field_t, new_traction_field, n_part
  use hc_stress_at_edges, only: edge_traction_t, correct_stress_at_edges
  use hc_edge_roots_of_contact, only: new_edge_of_contact, new_edge_of_stick
  use hc_zone_edge, only: zone_edge_t, zone_mesh_t
  implicit none
  private

  public :: edges_of, edge_of, mesh_of, distances_of, field_of, correct_tractions, correct_stress

contains

  !> Find the edges of a contact.
  function edges_of(lattice, fields, zones) result(edges)
    type(lattice_t), intent(in) :: lattice
    real(wp), intent(in) :: fields(:, :, :)
    logical, intent(in) :: zones(:, :, :)
    type(contact_edges_t) :: edges

    call new_contact_edges(edges, lattice, fields(:, :, 1), fields(:, :, 2), zones(:, :, 1), zones(:, :, 2))
  end function edges_of

  !> Return the edge of the contact area, or of the part of it that sticks.
  function edge_of(edges, fields, zones, of_stick) result(edge)
    type(contact_edges_t), intent(in) :: edges
    real(wp), intent(in) :: fields(:, :, :)
    logical, intent(in) :: zones(:, :, :), of_stick
    type(zone_edge_t) :: edge

    if (of_stick) then
      edge = edges%stick_edge(zones(:, :, 3), fields(:, :, 3))
    else
      edge = edges%contact_edge()
    end if
  end function edge_of

  !> Fill the contact area, or the part of it that sticks, with triangles, and carry a field there.
  subroutine mesh_of(edges, fields, zones, of_stick, field, vanishes, points, values, triangles, n_used, error)
    type(contact_edges_t), intent(in) :: edges
    real(wp), intent(in) :: fields(:, :, :), field(:, :)
    !> vanishes: the field is zero at the edge of the contact
    logical, intent(in) :: zones(:, :, :), of_stick, vanishes
    !> Corners [m], and values there
    real(wp), intent(inout) :: points(:, :), values(:)
    !> Corners of each triangle, counted from 1
    integer, intent(inout) :: triangles(:, :)
    !> Number of points and of triangles
    integer, intent(out) :: n_used(2)
    !> Allocated if there is no room for them
    type(error_t), allocatable, intent(out) :: error
    type(zone_mesh_t) :: mesh

    if (of_stick) then
      mesh = edges%stick_mesh(zones(:, :, 3), fields(:, :, 3), field)
    else
      mesh = edges%contact_mesh(field, vanishes)
    end if
    n_used = [mesh%n_point, mesh%n_triangle]
    if (n_used(1) > size(values) .or. n_used(2) > size(triangles, 2)) then
      call raise(error, status%invalid_input, 'the zone has more triangles than were counted')
      return
    end if
    points(:, :n_used(1)) = mesh%points
    values(:n_used(1)) = mesh%values
    triangles(:, :n_used(2)) = mesh%triangles
  end subroutine mesh_of

  !> Return the distances of the nodes from the edge of the contact area, or of the part of it that sticks, in spacings.
  function distances_of(edges, fields, zones, of_stick) result(distances)
    type(contact_edges_t), intent(in) :: edges
    real(wp), intent(in) :: fields(:, :, :)
    logical, intent(in) :: zones(:, :, :), of_stick
    real(wp) :: distances(size(fields, 1), size(fields, 2))

    if (of_stick) then
      distances = edges%stick_distances(zones(:, :, 3), fields(:, :, 3))
    else
      distances = edges%contact_distances()
    end if
  end function distances_of

  !> Set up the tractions between the nodes as arrays: 5, or `n_part` with a law of friction.
  subroutine field_of(lattice, fields, zones, traction, friction, parts)
    type(lattice_t), intent(in) :: lattice
    real(wp), intent(in) :: fields(:, :, :)
    logical, intent(in) :: zones(:, :, :)
    !> Pressure and shear traction [Pa]
    real(wp), intent(in) :: traction(:, :, :)
    !> Law of friction, if it is known
    class(friction_law_t), intent(in) :: friction
    real(wp), intent(out) :: parts(:, :, :)
    type(contact_edges_t) :: edges
    type(traction_field_t) :: field

    edges = edges_of(lattice, fields, zones)
    if (size(parts, 3) == n_part) then
      call new_traction_field(field, lattice, edges, traction, zones(:, :, 1), zones(:, :, 3), friction)
    else
      call new_traction_field(field, lattice, edges, traction, zones(:, :, 1), zones(:, :, 3))
    end if
    call field%arrays(parts)
  end subroutine field_of

  !> Correct tractions at the edges of the contact and of the stick area.
  subroutine correct_tractions(lattice, bodies, fields, zones, friction, traction, corrected, error)
    type(lattice_t), intent(in) :: lattice
    class(elastic_medium_t), intent(in) :: bodies
    real(wp), intent(in) :: fields(:, :, :)
    logical, intent(in) :: zones(:, :, :)
    class(friction_law_t), intent(in) :: friction
    !> Pressure and shear traction [Pa], and the corrected ones
    real(wp), intent(in) :: traction(:, :, :)
    real(wp), intent(inout) :: corrected(:, :, :)
    type(error_t), allocatable, intent(out) :: error
    type(field_space_t) :: space

    corrected = traction
    space = space_over(lattice%extent)
    call require_memory(edge_tractions_memory(lattice%extent, count(zones(:, :, 1)), &
                                              friction%resists() .and. friction%is_bounded(), space%threads, spectra_of(bodies)), &
                        error, space%threads)
    if (allocated(error)) return
    call correct_at_edges(lattice, edges_of(lattice, fields, zones), bodies, zones(:, :, 1), zones(:, :, 3), friction, corrected, &
                          space, error, kernel_cache)
  end subroutine correct_tractions

  !> Correct the stress at points near the edges of contact and stick by the difference of the tractions there from hats.
  subroutine correct_stress(lattice, fields, zones, friction, traction, corrected, body, poisson_ratio, points, correction, &
                            refused)
    type(lattice_t), intent(in) :: lattice
    real(wp), intent(in) :: fields(:, :, :)
    logical, intent(in) :: zones(:, :, :)
    !> One without friction if shear tractions do not follow the pressure
    class(friction_law_t), intent(in) :: friction
    !> Tractions as solved and corrected [Pa]
    real(wp), intent(in) :: traction(:, :, :), corrected(:, :, :)
    !> Number of the body and its Poisson's ratio
    integer, intent(in) :: body
    real(wp), intent(in) :: poisson_ratio
    !> x, y and depth [m]
    real(wp), intent(in) :: points(:, :)
    !> Stress xx, yy, zz, xy, yz, xz [Pa], and the share of the edge of the contact whose pressure is no root
    real(wp), intent(inout) :: correction(:, :), refused
    type(contact_edges_t) :: edges
    type(edge_traction_t) :: near
    type(field_space_t) :: space
    real(wp) :: of_stick ! growing stick areas have none, and where they reach the edge of the contact that is their edge

    of_stick = 0.0_wp
    space = space_over(lattice%extent)
    edges = edges_of(lattice, fields, zones)
    call new_edge_of_contact(near, lattice, edges, zones, friction, traction, corrected)
    call correct_stress_at_edges(near, body, poisson_ratio, points, space%threads, correction, refused)
    if (friction%resists() .and. any(zones(:, :, 3))) then
      call new_edge_of_stick(near, lattice, edges, zones, friction, traction, corrected)
      call correct_stress_at_edges(near, body, poisson_ratio, points, space%threads, correction, of_stick)
    end if
  end subroutine correct_stress

end module hc_f2py_edges
