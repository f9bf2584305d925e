!> Edges of contact and stick areas between the nodes, from how tractions vanish there.
!>
!> At the edge of a contact the pressure vanishes like the square root of the distance, and beyond it the gap opens like
!> its power 3/2; at the edge of a stick area the reserve of friction, mu p - |q|, vanishes like the pressure. So p^2,
!> gap^(2/3) and (mu p - |q|)^2, each divided by its slope, are distances from the edge. The edge runs where they change
!> sign: a polygon through the triangles of the lattice, for zones of any shape.
!>
!> Distances are in spacings of the equilateral lattice to which a linear map takes the nodes, positive inside. Fields
!> have the shape (n_col, n_row).
!>
!> Equations: docs/theory/edges.md, (B2) to (B4).
module hc_contact_edges
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use hc_precision, only: wp
  use hc_options, only: edge_options_t
  use hc_lattice, only: lattice_t
  use hc_edge_band, only: edge_band_t, new_edge_band, to_neighbors
  use hc_zone_edge, only: edged_zone_t, zone_edge_t
  implicit none
  private

  public :: contact_edges_t, new_contact_edges

  !> The zone in contact, and its edge.
  type, extends(edged_zone_t) :: contact_edges_t
    !> Pressure at the nodes about the edge
    real(wp), allocatable, private :: pressure(:)
  contains
    !> The part of the contact that sticks; its edge, and that of the contact
    procedure :: find_stick, stick_edge, contact_edge
    !> Squares of the pressure near the edge of the contact, and of the reserve near that of the stick area, good to
    !> interpolate
    procedure :: squares, stick_squares
  end type contact_edges_t

  !> Data about the edge of a zone from its own nodes.
  type :: one_sided_t
    !> Distances from the edge, slopes there, and directions inwards
    real(wp), allocatable :: distance(:), slope(:), direction(:, :)
    !> Nodes where they are known; the direction may be none, in the middle of few nodes
    logical, allocatable :: has_distance(:), has_slope(:), has_direction(:), is_guessed(:)
  end type one_sided_t

contains

  !> Find the distances of the nodes from the edge of a contact.
  pure subroutine new_contact_edges(edges, lattice, pressure, gap, contact, candidate, options)
    !> Edges to be set up
    type(contact_edges_t), intent(out) :: edges
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Contact pressure [Pa] and gap [m]; the gap of nodes that can never touch does not matter
    real(wp), intent(in) :: pressure(:, :), gap(:, :)
    !> Nodes in contact
    logical, intent(in) :: contact(:, :)
    !> Nodes that can touch. Where a contact ends at others, as at the rim of a punch, its pressure does not vanish;
    !> there the cells of its nodes count.
    logical, intent(in) :: candidate(:, :)
    !> Tuning numbers; absent: the usual ones
    type(edge_options_t), intent(in), optional :: options
    real(wp), allocatable :: opening(:)
    logical, allocatable :: inside(:), opened(:)

    if (present(options)) edges%options = options
    edges%lattice = lattice
    edges%zone = contact
    edges%candidate = candidate
    call new_edge_band(edges%band, contact, edges%options)
    associate (band => edges%band, options => edges%options)
      inside = band%part_of(contact)
      opened = band%part_of(candidate) .and. .not. inside
      edges%pressure = band%values_of(pressure)
      opening = band%values_of(gap)
      where (.not. opened) opening = 0.0_wp
      opening = (opening**2)**(1.0_wp/3.0_wp)
      edges%distance = -max(distances(band, options, opened, opening) - options%inward, 0.0_wp)
      opening = max(distances(band, options, inside, edges%pressure**2) + options%inward, options%least_distance)
      where (inside) edges%distance = opening
    end associate
  end subroutine new_contact_edges

  !> Find the part of the contact that sticks, and the distances of nodes from its edge.
  pure subroutine find_stick(self, stick, reserve, sticking)
    class(contact_edges_t), intent(in) :: self
    !> Nodes that stick, all in contact
    logical, intent(in) :: stick(:, :)
    !> Reserve of friction, mu p - |q|; only its values at these nodes matter [Pa]
    real(wp), intent(in) :: reserve(:, :)
    !> The part
    type(edged_zone_t), intent(out) :: sticking
    type(one_sided_t) :: seen
    real(wp), allocatable :: square(:)
    logical, allocatable :: inside(:), slipping(:), at_slip(:)
    real(wp) :: total, to(2, 6)
    integer :: k, j, n_seen

    to = to_neighbors()
    sticking%lattice = self%lattice
    sticking%options = self%options
    sticking%zone = stick
    sticking%candidate = self%candidate
    call new_edge_band(sticking%band, stick, self%options)
    allocate (sticking%distance(sticking%band%n), source=huge(1.0_wp))
    associate (band => sticking%band, distance => sticking%distance)
      inside = band%part_of(stick)
      slipping = band%part_of(self%zone) .and. .not. inside
      square = band%values_of(reserve)
      where (.not. inside) square = 0.0_wp
      call find_inner_slopes(band, self%options, inside, square**2, seen)
      at_slip = inside .and. band%next_to(slipping)
      do k = 1, band%n
        if (at_slip(k)) then
          distance(k) = self%options%unknown_distance
          if (seen%has_distance(k)) distance(k) = max(seen%distance(k), self%options%least_distance)
        else if (slipping(k)) then
          ! The power of the slip depends on how far the edge moved in the step, so that slip is no measure of the distance:
          ! nodes outside have that of the nodes inside.
          total = 0.0_wp
          n_seen = 0
          do j = 1, size(to, 2)
            associate (m => band%beside(j, k))
              if (m == 0) cycle
              if (.not. (inside(m) .and. seen%has_distance(m) .and. seen%has_direction(m))) cycle
              total = total + seen%distance(m) - dot_product(to(:, j), seen%direction(:, m))
              n_seen = n_seen + 1
            end associate
          end do
          distance(k) = -self%options%unknown_distance
          if (n_seen > 0) distance(k) = min(total/n_seen, 0.0_wp)
        end if
        ! where the stick area reaches the edge of the contact, that is its edge
        associate (at => band%node(:, k))
          j = self%band%place(at(1), at(2))
          if (j > 0) distance(k) = min(distance(k), self%distance(j))
        end associate
      end do
    end associate
  end subroutine find_stick

  !> Find the edge of the contact area.
  pure type(zone_edge_t) function contact_edge(self)
    class(contact_edges_t), intent(in) :: self

    contact_edge = self%edge()
  end function contact_edge

  !> Find the edge of the part of the contact that sticks.
  pure type(zone_edge_t) function stick_edge(self, stick, reserve)
    class(contact_edges_t), intent(in) :: self
    !> Nodes that stick, and their reserve of friction, see `find_stick` [Pa]
    logical, intent(in) :: stick(:, :)
    real(wp), intent(in) :: reserve(:, :)
    type(edged_zone_t) :: sticking

    call self%find_stick(stick, reserve, sticking)
    stick_edge = sticking%edge()
  end function stick_edge

  !> Return squares of the pressure that are good to interpolate linearly (n_col, n_row) [Pa^2].
  !>
  !> At nodes in contact the layer of the lattice next to the edge is subtracted; beyond the edge the squares continue below
  !> zero. They are NaN away from the edge, and where it is not defined.
  pure function squares(self) result(field)
    class(contact_edges_t), intent(in) :: self
    real(wp) :: field(size(self%zone, 1), size(self%zone, 2))

    field = squares_near_edge(self%edged_zone_t, self%candidate, self%pressure**2, known_beyond=.true.)
  end function squares

  !> Return squares of the reserve of friction that are good to interpolate linearly, see `squares`.
  pure function stick_squares(self, stick, reserve) result(field)
    class(contact_edges_t), intent(in) :: self
    !> Nodes that stick, and their reserve of friction, see `find_stick` [Pa]
    logical, intent(in) :: stick(:, :)
    real(wp), intent(in) :: reserve(:, :)
    real(wp) :: field(size(stick, 1), size(stick, 2))
    type(edged_zone_t) :: sticking

    call self%find_stick(stick, reserve, sticking)
    field = squares_near_edge(sticking, self%zone .or. self%candidate, sticking%band%values_of(reserve)**2, known_beyond=.false.)
  end function stick_squares

  !> Compute squares, good to interpolate, of a field that vanishes at the edge of a zone.
  pure function squares_near_edge(self, around, square, known_beyond) result(field)
    !> The zone
    type(edged_zone_t), intent(in) :: self
    !> Nodes to which it could extend (n_col, n_row)
    logical, intent(in) :: around(:, :)
    !> Squares at the nodes about the edge
    real(wp), intent(in) :: square(:)
    !> Distances of nodes beyond the edge are given, and do not follow from the direction of the edge at nodes inside
    logical, intent(in) :: known_beyond
    real(wp) :: field(size(self%zone, 1), size(self%zone, 2))
    type(one_sided_t) :: seen
    real(wp) :: inwards(2, self%band%n), rises(self%band%n)
    logical :: inside(self%band%n), beyond(self%band%n), known(self%band%n)
    integer :: k

    associate (band => self%band)
      inside = band%part_of(self%zone)
      beyond = band%part_of(around) .and. .not. inside
      call find_inner_slopes(band, self%options, inside, merge(square, 0.0_wp, inside), seen)
      ! under the rim of a punch the pressure rises towards the edge: its square has no zero there
      known = inside .and. band%next_to(.not. inside)
      inwards = band%gradient(merge(1.0_wp, 0.0_wp, inside), known)
      rises = merge(1.0_wp, 0.0_wp, seen%has_direction .and. sum(inwards*seen%direction, dim=1) < 0.0_wp)
      call band%extend(1, rises, known)
      field = ieee_value(1.0_wp, ieee_quiet_nan)
      do k = 1, band%n
        if (.not. (known(k) .and. seen%has_slope(k)) .or. any(band%node(:, k) < 1 .or. band%node(:, k) > shape(field))) cycle
        if (rises(k) >= 0.5_wp .or. (seen%is_guessed(k) .and. .not. known_beyond)) cycle
        associate (there => field(band%node(1, k), band%node(2, k)))
          if (inside(k)) then
            there = square(k)
            if (seen%has_distance(k) .and. seen%distance(k) < layer_end(self%options)) there = seen%slope(k)*seen%distance(k)
          else if (beyond(k)) then
            there = seen%slope(k)*min(self%distance(k), 0.0_wp)
          end if
        end associate
      end do
    end associate
  end function squares_near_edge

  !> Find the distances of the nodes of a part from its edge, where some values vanish in proportion to them.
  pure function distances(band, options, part, values) result(away)
    !> Nodes about the edge
    type(edge_band_t), intent(in) :: band
    type(edge_options_t), intent(in) :: options
    !> Those of the part
    logical, intent(in) :: part(:)
    !> Values at the nodes
    real(wp), intent(in) :: values(:)
    real(wp) :: away(band%n), slope(band%n)
    logical :: known(band%n)

    known = band%surrounded(part)
    slope = norm2(band%gradient(values, known), dim=1)
    call band%extend(1, slope, known)
    away = options%unknown_distance
    where (known .and. slope > options%least_relative_slope*abs(values)) away = values/slope
  end function distances

  !> Find distances from the edge, slopes there and directions inwards, from the nodes of one side only.
  !>
  !> The layer at the edge is taken off first, with the slope further inside. The slope at the edge itself then follows
  !> from those of the parabola that the squares S are along the normal n: k^4 = S'^2 - 2 S S". Where this is little or
  !> negative they vanish with a higher power than the first, and there is no slope.
  pure subroutine find_inner_slopes(band, options, part, square, seen)
    !> Nodes about the edge
    type(edge_band_t), intent(in) :: band
    type(edge_options_t), intent(in) :: options
    !> Those on that side
    logical, intent(in) :: part(:)
    !> Values at the nodes, squares of fields that vanish like a square root
    real(wp), intent(in) :: square(:)
    !> Squares at the nodes
    type(one_sided_t), intent(out) :: seen
    logical :: whole(band%n), known(band%n)
    ! direction, 1 where it is guessed, 1 where there is no slope
    real(wp) :: carried(4, band%n)
    real(wp) :: slope(band%n), smooth(band%n), steepness, bend, to(2, 6)
    integer :: k

    to = to_neighbors()
    whole = band%surrounded(part)
    known = whole
    slope = norm2(band%gradient(square, whole), dim=1)
    call band%extend(1, slope, known)
    smooth = square
    do k = 1, band%n
      if (.not. known(k) .or. slope(k) <= options%least_relative_slope*square(k)) cycle
      associate (away => from_square(options, square(k)/slope(k)))
        if (away < layer_end(options)) smooth(k) = slope(k)*away
      end associate
    end do

    seen%direction = band%gradient(smooth, whole)
    carried(3:4, :) = 0.0_wp
    seen%has_slope = whole
    do k = 1, band%n
      steepness = norm2(seen%direction(:, k))
      if (.not. whole(k)) cycle
      if (steepness > options%least_relative_slope*smooth(k)) then
        seen%direction(:, k) = seen%direction(:, k)/steepness
      else
        ! but a rounding error, as in the middle of few nodes: one direction is as good as another
        seen%direction(:, k) = [1.0_wp, 0.0_wp]
        carried(3, k) = 1.0_wp
      end if
      ! second derivative along n from those along the three lines of nodes at angles t to n, with weights 1 + 2 cos 2t
      bend = sum((4.0_wp*matmul(seen%direction(:, k), to)**2 - 1.0_wp)*(smooth(band%beside(:, k)) - smooth(k)))/3.0_wp
      slope(k) = steepness**2 - 2.0_wp*smooth(k)*bend
      if (slope(k) < options%least_slope*steepness**2) carried(4, k) = 1.0_wp
      slope(k) = sqrt(max(slope(k), options%least_slope*steepness**2))
      seen%has_slope(k) = slope(k) > 0.0_wp
    end do
    carried(1:2, :) = seen%direction
    call band%extend(4, carried, whole)
    seen%has_direction = whole
    seen%direction = carried(1:2, :)
    seen%is_guessed = carried(3, :) > 0.5_wp
    call band%extend(1, slope, seen%has_slope)
    seen%slope = slope
    seen%has_slope = seen%has_slope .and. .not. (whole .and. carried(4, :) > 0.5_wp)

    seen%distance = square
    seen%has_distance = seen%has_slope
    do k = 1, band%n
      seen%has_distance(k) = seen%has_slope(k) .and. slope(k) > options%least_relative_slope*square(k)
      if (seen%has_distance(k)) seen%distance(k) = from_square(options, square(k)/slope(k))
      associate (n => norm2(seen%direction(:, k)))
        seen%has_direction(k) = seen%has_direction(k) .and. n > options%least_relative_slope
        if (seen%has_direction(k)) seen%direction(:, k) = seen%direction(:, k)/n
      end associate
    end do
  end subroutine find_inner_slopes

  !> Compute the square beyond which there is no layer.
  pure real(wp) function layer_end(options)
    type(edge_options_t), intent(in) :: options
    layer_end = options%layer_square(size(options%layer_square))
  end function layer_end

  !> Compute the distance of a node from the edge at which the solution on the lattice has a square, both in slopes.
  pure real(wp) function from_square(options, square)
    type(edge_options_t), intent(in) :: options
    !> Square, at least 0
    real(wp), intent(in) :: square
    integer :: k

    from_square = square
    if (square >= layer_end(options)) return
    associate (at => options%layer_distance, squares => options%layer_square)
      k = findloc(squares <= square, .true., dim=1, back=.true.)
      from_square = at(k) + (square - squares(k))/(squares(k + 1) - squares(k))*(at(k + 1) - at(k))
    end associate
  end function from_square

end module hc_contact_edges
