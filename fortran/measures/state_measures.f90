!> Measures of a state: residuals node by node, energy, areas of contact and stick and their extent.
!>
!> Equations: docs/theory/residuals.md, (R1) to (R3).
module hc_state_measures
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_quiet_nan, ieee_value
  use hc_precision, only: wp, lk
  use hc_lattice, only: lattice_t
  use hc_field_space, only: field_space_t
  use hc_elastic_medium, only: elastic_medium_t
  use hc_contact_state, only: contact_state_t, separated, stick, normal, remote_displacement
  use hc_options, only: edge_options_t
  use hc_edges_by_rows, only: edges_by_rows_t, new_edges_by_rows
  use hc_zone_edge, only: zone_edge_t
  use hc_contact_residuals, only: normal_self_compliance, tangential_self_compliance, tangential_scale
  use hc_normal_law, only: normal_law_t
  use hc_friction_law, only: friction_law_t
  use hc_zone_estimators, only: area_radius
  implicit none
  private

  public :: nodal_normal_residual, nodal_tangential_residual, elastic_energy, zone_extent
  public :: state_measures_t, zone_measures_t, measure_state, measure_contact, friction_reserve, rises_to_end

  !> Size of a zone: of the cells of its nodes, and to its edge between the nodes.
  type :: zone_measures_t
    !> Areas [m^2], and radii of the discs with these areas [m]
    real(wp) :: area = 0.0_wp, radius = 0.0_wp, area_fit = 0.0_wp, radius_fit = 0.0_wp
    !> Half-axes of the ellipse with the moments of the area to the edge [m]
    real(wp) :: semi_major = 0.0_wp, semi_minor = 0.0_wp
    !> In a window that repeats, where the edge stays unknown: a fifth of the cells along it. The distance from the limit of fine
    !> lattices was at most 0.18 of them, with 4 to 32 spacings in the shortest wave of rough surfaces [m^2]
    real(wp) :: area_error = 0.0_wp
  end type zone_measures_t

  !> Quantities of a state that a load history records.
  type :: state_measures_t
    !> Contact area, and the part of it that sticks
    type(zone_measures_t) :: contact, stick
    !> Centroid of the pressure [m]
    real(wp) :: pressure_center(2) = 0.0_wp
    !> Centroid, smallest and largest coordinates of the stick area; NaN without stick [m]
    real(wp) :: stick_center(2) = 0.0_wp, stick_lower(2) = 0.0_wp, stick_upper(2) = 0.0_wp
    !> Largest pressure and shear traction [Pa]
    real(wp) :: max_pressure = 0.0_wp, max_traction = 0.0_wp
    !> Elastic energy of both bodies [J]
    real(wp) :: elastic_energy = 0.0_wp
    !> Mean gap of a window that repeats [m]
    real(wp) :: mean_gap = 0.0_wp
  end type state_measures_t

contains

  !> Measure how far pressure and gap of a node are from the law of contact, over p_max: R_n is the largest value.
  !> 0 where the gap is not finite.
  function nodal_normal_residual(lattice, medium, law, state, space) result(residual)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> Law of contact
    class(normal_law_t), intent(in) :: law
    !> State with pressure somewhere; its pressure and gap count
    type(contact_state_t), intent(in) :: state
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    real(wp) :: residual(size(state%pressure, 1), size(state%pressure, 2))
    real(wp) :: compliance
    integer :: col, row

    compliance = normal_self_compliance(lattice, medium)
    residual = 0.0_wp
    do row = 1, size(residual, 2)
      do col = 1, size(residual, 1)
        associate (p => state%pressure(col:col, row), g => state%gap(col:col, row))
          if (ieee_is_finite(g(1))) then
            call law%violation((row - 1)*size(residual, 1) + col, compliance, p, g, [.true.], residual(col, row))
          end if
        end associate
      end do
    end do
    residual = residual/space%max(state%pressure)
  end function nodal_normal_residual

  !> Measure |q - P(q - ds/d_t)|/tau at the nodes in contact, P the projection on the cone: R_t is the largest value.
  function nodal_tangential_residual(lattice, medium, friction, state, space) result(residual)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> Law of friction
    class(friction_law_t), intent(in) :: friction
    !> State with pressure somewhere; its pressure, traction and slip increment count
    type(contact_state_t), intent(in) :: state
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    real(wp) :: residual(size(state%pressure, 1), size(state%pressure, 2))
    real(wp) :: p_max, stiffness, largest
    integer :: col, row

    residual = 0.0_wp
    if (.not. friction%resists()) return
    p_max = space%max(state%pressure)
    stiffness = 1.0_wp/tangential_self_compliance(lattice, medium)
    largest = 0.0_wp
    do row = 1, size(residual, 2)
      do col = 1, size(residual, 1)
        if (state%pressure(col, row) <= 0.0_wp) cycle
        associate (node => [state%pressure(col, row), state%traction(col, row, :), state%slip_increment(col, row, :)])
          call friction%violation((row - 1)*size(residual, 1) + col, 1.0_wp/p_max, stiffness, node(1:1), node(2:2), node(3:3), &
                                  node(4:4), node(5:5), largest, residual(col, row))
        end associate
      end do
    end do
    residual = sqrt(residual)/tangential_scale(friction, p_max, largest)
  end function nodal_tangential_residual

  !> Compute U = sum A_p (p w + q . (u_1 - u_2))/2 with w = g - g_0 + approach and u_1 - u_2 = s + shift + twist x r [J].
  pure real(wp) function elastic_energy(lattice, initial_gap, state) result(energy)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Gap before loading (n_col, n_row) [m]
    real(wp), intent(in) :: initial_gap(:, :)
    !> State, with friction or without
    type(contact_state_t), intent(in) :: state

    energy = sum(normal_energy(lattice, initial_gap, state%zone /= separated, state%pressure, state%gap, state%motion(normal)))
    if (allocated(state%traction)) energy = energy + sum(shear_energy(lattice, state, 0))
  end function elastic_energy

  !> Compute the part of the pressure by row [J].
  pure function normal_energy(lattice, initial_gap, contact, pressure, gap, approach) result(energy)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Gap before loading [m], nodes in contact, pressure [Pa] and gap [m] (n_col, own rows)
    real(wp), intent(in) :: initial_gap(:, :), pressure(:, :), gap(:, :)
    logical, intent(in) :: contact(:, :)
    !> Approach [m]
    real(wp), intent(in) :: approach
    real(wp) :: energy(size(contact, 2))
    integer :: col, row

    energy = 0.0_wp
    do row = 1, size(contact, 2)
      do col = 1, size(contact, 1)
        if (contact(col, row)) then
          energy(row) = energy(row) + pressure(col, row)*(gap(col, row) - initial_gap(col, row) + approach)
        end if
      end do
    end do
    energy = 0.5_wp*lattice%cell_area()*energy
  end function normal_energy

  !> Compute the part of the shear tractions by row [J].
  pure function shear_energy(lattice, state, below) result(energy)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> State with friction
    type(contact_state_t), intent(in) :: state
    !> Rows of the window before those of the state
    integer, intent(in) :: below
    real(wp) :: energy(size(state%pressure, 2))
    real(wp), dimension(size(state%pressure, 1)) :: x, y
    real(wp) :: moved(2)
    integer :: col, row

    energy = 0.0_wp
    do row = 1, size(state%pressure, 2)
      call lattice%row_coordinates(below + row, x, y)
      do col = 1, size(x)
        if (state%zone(col, row) == separated) cycle
        moved = state%relative_displacement(col, row, :) + remote_displacement(state%motion, x(col), y(col))
        energy(row) = energy(row) + dot_product(state%traction(col, row, :), moved)
      end do
    end do
    energy = 0.5_wp*lattice%cell_area()*energy
  end function shear_energy

  !> Find the center of area of a zone, and smallest and largest coordinates of its nodes; NaN if there are none [m].
  subroutine zone_extent(lattice, zone, center, lower, upper, space)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Nodes of the zone (n_col, n_row)
    logical, intent(in), contiguous :: zone(:, :)
    !> Mean, smallest and largest x and y
    real(wp), intent(out) :: center(2), lower(2), upper(2)
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    real(wp) :: total(size(zone, 2), 2), least(2, size(zone, 2)), most(2, size(zone, 2)), bounds(4)
    real(wp), dimension(size(zone, 1)) :: x, y
    integer :: n, row, below

    center = ieee_value(1.0_wp, ieee_quiet_nan)
    lower = center
    upper = center
    n = space%count(logical(zone, lk))
    if (n == 0) return
    below = space%ranks%first_row(lattice%extent(2)) - 1
    !$omp parallel do schedule(static) num_threads(space%threads) private(x, y)
    do row = 1, size(zone, 2)
      call lattice%row_coordinates(below + row, x, y)
      total(row, :) = [sum(x, mask=zone(:, row)), sum(y, mask=zone(:, row))]
      least(:, row) = [minval(x, mask=zone(:, row)), minval(y, mask=zone(:, row))]
      most(:, row) = [maxval(x, mask=zone(:, row)), maxval(y, mask=zone(:, row))]
    end do
    !$omp end parallel do
    center = [space%total(total(:, 1)), space%total(total(:, 2))]/n
    bounds = [-minval(least, dim=2), maxval(most, dim=2)]
    call space%most(bounds)
    lower = -bounds(:2)
    upper = bounds(3:)
  end subroutine zone_extent

  !> Find the centroid of a pressure; NaN if there is none [m].
  function center_of(lattice, pressure, space) result(center)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Pressure (n_col, own rows) [Pa]
    real(wp), intent(in) :: pressure(:, :)
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    real(wp) :: center(2), total, part(size(pressure, 2), 3)
    real(wp), dimension(size(pressure, 1)) :: x, y
    integer :: row, below

    below = space%ranks%first_row(lattice%extent(2)) - 1
    do row = 1, size(pressure, 2)
      call lattice%row_coordinates(below + row, x, y)
      part(row, :) = [sum(pressure(:, row)), dot_product(pressure(:, row), x), dot_product(pressure(:, row), y)]
    end do
    total = space%total(part(:, 1))
    if (total > 0.0_wp) then
      center = [space%total(part(:, 2)), space%total(part(:, 3))]/total
    else
      center = ieee_value(1.0_wp, ieee_quiet_nan)
    end if
  end function center_of

  !> Measure areas of contact and stick, largest tractions and energy of a state, with friction or without.
  type(state_measures_t) function measure_state(lattice, friction, initial_gap, candidate, state, space) result(found)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Law of friction; of no use without shear tractions
    class(friction_law_t), intent(in) :: friction
    !> Gap before loading (n_col, n_row) [m]
    real(wp), intent(in) :: initial_gap(:, :)
    !> Nodes that can touch (n_col, n_row)
    logical, intent(in), contiguous :: candidate(:, :)
    !> State
    type(contact_state_t), intent(in) :: state
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    type(edges_by_rows_t) :: edges
    logical, allocatable :: zone(:, :)

    call measure_contact(lattice, initial_gap, candidate, state, space, found, edges)
    if (.not. allocated(state%traction)) return
    found%elastic_energy = found%elastic_energy + space%total(shear_energy(lattice, state, &
                                                                                  space%ranks%first_row(lattice%extent(2)) - 1))
    zone = state%zone == stick
    found%max_traction = space%max(norm2(state%traction, dim=3))
    found%stick_center = ieee_value(1.0_wp, ieee_quiet_nan)
    found%stick_lower = found%stick_center
    found%stick_upper = found%stick_center
    if (lattice%is_periodic()) then
      found%stick = size_of(lattice, space%count(logical(zone, lk)))
      return
    end if
    found%stick = size_of(lattice, space%count(logical(zone, lk)), edges%stick_edge(zone, friction_reserve(friction, state)))
    call zone_extent(lattice, zone, found%stick_center, found%stick_lower, found%stick_upper, space)
  end function measure_state

  !> Compute the reserve of friction, b(p) - |q|; 0, of no use, where nothing slips [Pa].
  function friction_reserve(friction, state) result(reserve)
    !> Law of friction
    class(friction_law_t), intent(in) :: friction
    !> State, of which pressure and shear traction matter
    type(contact_state_t), intent(in) :: state
    real(wp), allocatable :: reserve(:, :), length(:)
    integer :: row

    allocate (reserve, mold=state%pressure)
    reserve = 0.0_wp
    if (.not. friction%is_bounded()) return
    allocate (length(size(reserve, 1)))
    do row = 1, size(reserve, 2)
      call friction%find_bounds((row - 1)*size(reserve, 1) + 1, state%pressure(:, row), reserve(:, row))
      call friction%find_lengths(state%traction(:, row, 1), state%traction(:, row, 2), length)
      reserve(:, row) = reserve(:, row) - length
    end do
  end function friction_reserve

  !> Measure the area of contact, the pressure and its energy.
  subroutine measure_contact(lattice, initial_gap, candidate, state, space, found, edges)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Gap before loading (n_col, own rows) [m]
    real(wp), intent(in) :: initial_gap(:, :)
    !> Nodes that can touch (n_col, own rows)
    logical, intent(in), contiguous :: candidate(:, :)
    !> State, of which pressure, gap, zones and approach matter
    type(contact_state_t), intent(in) :: state
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Measures; those of shear are not set
    type(state_measures_t), intent(out) :: found
    !> Edges of the contact
    type(edges_by_rows_t), intent(out) :: edges
    type(edge_options_t) :: options

    found%max_pressure = space%max(state%pressure)
    associate (contact => state%zone /= separated)
      found%elastic_energy = space%total(normal_energy(lattice, initial_gap, contact, state%pressure, state%gap, &
                                                       state%motion(normal)))
      if (lattice%is_periodic()) then
        ! a contact across the end of the window has its edge on the other side, and there is no center
        found%pressure_center = ieee_value(1.0_wp, ieee_quiet_nan)
        found%contact = size_of(lattice, space%count(logical(contact, lk)))
        found%contact%area_error = lattice%cell_area()*cells_in_doubt(contact, lattice%extent(2), space)
        found%mean_gap = space%sum(state%gap)/lattice%size()
        return
      end if
      found%pressure_center = center_of(lattice, state%pressure, space)
      call new_edges_by_rows(edges, lattice, state, candidate, space, options)
      found%contact = size_of(lattice, space%count(logical(contact, lk)), edges%contact_edge())
    end associate
  end subroutine measure_contact

  !> Test whether the pressure rises to an end of the surface, where it has no bound.
  !>
  !> The last node before it has more pressure than its neighbor, or both together more than the next one. A node bears the length
  !> between the middle to its neighbor and the end, which is no whole cell.
  logical function rises_to_end(share, pressure, space, n_row) result(rises)
    !> Part of a cell that a node bears, 0 where nothing can touch (n_col, own rows)
    real(wp), intent(in), contiguous :: share(:, :)
    !> Pressure (n_col, own rows) [Pa]
    real(wp), intent(in), contiguous :: pressure(:, :)
    !> Space of the fields, and rows of the window
    type(field_space_t), intent(in) :: space
    integer, intent(in) :: n_row
    real(wp), allocatable :: near(:, :), shares(:, :)
    real(wp) :: found(1)
    integer :: own(2)

    if (space%ranks%size == 1) then
      rises = rises_in(share, pressure)
      return
    end if
    own = space%own_rows(n_row)
    own = [max(own(1) - 2, 1), min(own(2) + 2, n_row)]
    allocate (near(size(pressure, 1), own(2) - own(1) + 1), shares(size(pressure, 1), own(2) - own(1) + 1))
    call space%fetch(n_row, pressure, own(1), near)
    call space%fetch(n_row, share, own(1), shares)
    found = merge(1.0_wp, 0.0_wp, rises_in(shares, near))
    call space%most(found)
    rises = found(1) > 0.5_wp
  end function rises_to_end

  !> Test whether the pressure rises to an end of the surface in some rows.
  pure logical function rises_in(share, pressure) result(rises)
    real(wp), intent(in) :: share(:, :), pressure(:, :)
    integer :: n, m

    rises = .false.
    if (all(share > 0.0_wp)) return
    n = size(pressure, 1)
    m = size(pressure, 2)
    associate (s => share, p => pressure)
      rises = any(rises_before(s(3:, :), s(2:n - 1, :), s(:n - 2, :), p(2:n - 1, :), p(:n - 2, :))) .or. &
              any(rises_before(s(:n - 2, :), s(2:n - 1, :), s(3:, :), p(2:n - 1, :), p(3:, :))) .or. &
              any(rises_before(s(:, 3:), s(:, 2:m - 1), s(:, :m - 2), p(:, 2:m - 1), p(:, :m - 2))) .or. &
              any(rises_before(s(:, :m - 2), s(:, 2:m - 1), s(:, 3:), p(:, 2:m - 1), p(:, 3:)))
      if (rises) return
      rises = any(rises_before(s(4:, :), s(3:n - 1, :), s(2:n - 2, :), p(3:n - 1, :), p(2:n - 2, :), p(:n - 3, :))) .or. &
              any(rises_before(s(:n - 3, :), s(2:n - 2, :), s(3:n - 1, :), p(2:n - 2, :), p(3:n - 1, :), p(4:, :))) .or. &
              any(rises_before(s(:, 4:), s(:, 3:m - 1), s(:, 2:m - 2), p(:, 3:m - 1), p(:, 2:m - 2), p(:, :m - 3))) .or. &
              any(rises_before(s(:, :m - 3), s(:, 2:m - 2), s(:, 3:m - 1), p(:, 2:m - 2), p(:, 3:m - 1), p(:, 4:)))
    end associate
  end function rises_in

  !> Test whether the pressure of the last node before an end is larger than that of its neighbor, or with it than that of the next.
  elemental logical function rises_before(beyond, last_share, here_share, last, here, before) result(rises)
    !> Parts of a cell that the node beyond the end, the last one and its neighbor bear
    real(wp), intent(in) :: beyond, last_share, here_share
    !> Pressures of the last node, of its neighbor and of the next one [Pa]
    real(wp), intent(in) :: last, here
    real(wp), intent(in), optional :: before

    if (present(before)) then
      rises = before > 0.0_wp .and. last + here > (last_share + here_share)*before
    else
      rises = here > 0.0_wp .and. last > last_share*here
    end if
    rises = rises .and. .not. beyond > 0.0_wp .and. last_share > 0.0_wp .and. last > 0.0_wp
  end function rises_before

  !> Return how many cells the area of a zone may be wrong by, in a window that repeats.
  !>
  !> A fifth of the nodes that have a neighbor along a row or column beyond it; half of those of an edge along a whole row or
  !> column, which err alike.
  real(wp) function cells_in_doubt(zone, n_row, space) result(cells)
    !> Nodes of the zone (n_col, own rows)
    logical, intent(in), contiguous :: zone(:, :)
    !> Rows of the window
    integer, intent(in) :: n_row
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    logical(lk) :: around(size(zone, 1), 0:size(zone, 2) + 1)
    ! nodes at the edge, those of straight edges along rows, and nodes by column
    integer :: own(2), row, counts(2 + size(zone, 1))

    own = space%own_rows(n_row)
    around(:, 1:size(zone, 2)) = zone
    call space%fetch(n_row, logical(zone, lk), modulo(own(1) - 2, n_row) + 1, around(:, 0:0))
    call space%fetch(n_row, logical(zone, lk), modulo(own(2), n_row) + 1, around(:, size(zone, 2) + 1:))
    counts(:2) = 0
    counts(3:) = count(zone, dim=2)
    do row = 1, size(zone, 2)
      associate (here => around(:, row), below => around(:, row - 1), above => around(:, row + 1))
        counts(1) = counts(1) + count(here .and. .not. (cshift(here, 1) .and. cshift(here, -1) .and. below .and. above))
        if (all(here)) counts(2) = counts(2) + size(here)*count([.not. any(below), .not. any(above)])
      end associate
    end do
    call space%ranks%add_counts(counts)
    associate (columns => counts(3:))
      counts(2) = counts(2) + n_row*(count(columns == n_row .and. cshift(columns, 1) == 0) &
                                     + count(columns == n_row .and. cshift(columns, -1) == 0))
    end associate
    cells = 0.2_wp*counts(1) + 0.3_wp*counts(2)
  end function cells_in_doubt

  !> Measure a zone, whose edge may be unknown.
  pure type(zone_measures_t) function size_of(lattice, n_node, edge) result(found)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Nodes of the zone
    integer, intent(in) :: n_node
    !> Its edge; absent: unknown
    type(zone_edge_t), intent(in), optional :: edge
    real(wp) :: to_edge(4)

    to_edge = ieee_value(1.0_wp, ieee_quiet_nan)
    if (present(edge)) to_edge = [edge%area, edge%radius(), edge%ellipse%semi_major, edge%ellipse%semi_minor]
    found = zone_measures_t(lattice%cell_area()*n_node, area_radius(n_node, lattice%cell_area()), to_edge(1), to_edge(2), &
                            to_edge(3), to_edge(4))
  end function size_of

end module hc_state_measures
