!> Edges of contact and stick areas between the nodes, from how tractions vanish there.
!>
!> At the edge of a contact the pressure vanishes like the square root of the distance, and beyond it the gap opens like
!> its power 3/2; at the edge of a stick area the reserve of friction, mu p - |q|, vanishes like the pressure. So p^2,
!> gap^(2/3) and (mu p - |q|)^2, each divided by its slope, are distances from the edge. The edge runs where they change
!> sign: a polygon through the triangles of the lattice, for zones of any shape.
!>
!> Distances are in spacings, positive inside. Fields have the shape (n_col, n_row).
!>
!> Equations: docs/theory/edges.md, (B2) to (B4).
module hc_contact_edges
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use, intrinsic :: iso_fortran_env, only: int8
  use hc_precision, only: wp, pi
  use hc_lattice, only: lattice_t
  use hc_edge_band, only: edge_band_t, new_edge_band, to_neighbors
  implicit none
  private

  public :: zone_edge_t, contact_edges_t, new_contact_edges, cut_triangles

  !> Least distance of a node inside.
  real(wp), parameter :: least = 1.0e-9_wp
  !> Distance of a node where there is no slope: the zone is too small, or not sharply bounded.
  real(wp), parameter :: half_way = 0.5_wp
  !> Least square of the slope at the edge over that further inside: for (distance^m)^2 it is 1/m - 1.
  real(wp), parameter :: least_slope = 0.5_wp
  !> Slopes below this part of a value are rounding errors.
  real(wp), parameter :: no_slope = 1.0e-9_wp
  !> How far inside the true edge pressure and gap see it in the mean, where the layer below is not taken off.
  real(wp), parameter :: inward = 0.04_wp

  !> Next to an edge the solution on the lattice has a layer of its own: nodes at `layer_distance` have squares (of the
  !> pressure, of the reserve of friction) as if they were at `layer_square`. Measured on the contacts of Hertz and of
  !> Cattaneo and Mindlin with 14 to 60 spacings in the radius at random places on the lattice: it is the same for both
  !> and for all directions of the edge, up to a scatter of 0.03.
  real(wp), parameter :: layer_distance(14) = &
    [-0.05_wp, 0.0_wp, 0.05_wp, 0.1_wp, 0.15_wp, 0.2_wp, 0.3_wp, 0.5_wp, 0.7_wp, 0.9_wp, 1.1_wp, 1.3_wp, 1.5_wp, 2.0_wp]
  real(wp), parameter :: layer_square(14) = [0.0_wp, 0.006_wp, 0.021_wp, 0.046_wp, 0.076_wp, 0.118_wp, 0.216_wp, &
                                             0.464_wp, 0.740_wp, 0.985_wp, 1.164_wp, 1.334_wp, 1.513_wp, 2.0_wp]
  !> Square beyond which there is no layer.
  real(wp), parameter :: layer_end = layer_square(size(layer_square))

  !> An area of the plane whose edge runs between the nodes.
  type :: zone_edge_t
    !> Area [m^2]
    real(wp) :: area = 0.0_wp
    !> Pieces of the edge, in no order: x and y, first and last point; none where the zone ends at nodes that can never
    !> touch (2, 2, n) [m]
    real(wp), allocatable :: segments(:, :, :)
  contains
    !> Radius of the disc with the same area [m]
    procedure :: radius
    !> Length of the edge [m]
    procedure :: length
  end type zone_edge_t

  !> A contact of which edges are wanted.
  type :: contact_edges_t
    private
    type(lattice_t) :: lattice
    !> Nodes in contact, and those that can touch (n_col, n_row)
    logical, allocatable :: contact(:, :), candidate(:, :)
    !> Nodes about the edge of the contact, their pressure and their distance from it
    type(edge_band_t) :: band
    real(wp), allocatable :: pressure(:), distance(:)
  contains
    !> The edge of the contact area
    procedure :: contact_edge
    !> The edge of the part of it that sticks
    procedure :: stick_edge
    !> Squares of the pressure near the edge, good to interpolate
    procedure :: squares
    procedure, private :: edge_of
  end type contact_edges_t

  !> What is known about the edge of a zone from its own nodes.
  type :: one_sided_t
    !> Distances from the edge, slopes there, and directions inwards
    real(wp), allocatable :: distance(:), slope(:), direction(:, :)
    !> Nodes where they are known
    logical, allocatable :: has_distance(:), has_slope(:), has_direction(:)
  end type one_sided_t

contains

  !> Radius of the disc with the same area [m].
  pure real(wp) function radius(self)
    class(zone_edge_t), intent(in) :: self
    radius = sqrt(self%area/pi)
  end function radius

  !> Length of the edge [m].
  pure real(wp) function length(self)
    class(zone_edge_t), intent(in) :: self
    length = sum(norm2(self%segments(:, 2, :) - self%segments(:, 1, :), dim=1))
  end function length

  !> Find the distances of the nodes from the edge of a contact.
  pure subroutine new_contact_edges(edges, lattice, pressure, gap, contact, candidate)
    !> Edges to be set up
    type(contact_edges_t), intent(out) :: edges
    !> Equilateral lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Contact pressure [Pa] and gap [m]; the gap of nodes that can never touch does not matter
    real(wp), intent(in) :: pressure(:, :), gap(:, :)
    !> Nodes in contact
    logical, intent(in) :: contact(:, :)
    !> Nodes that can touch. Where a contact ends at others, as at the rim of a punch, its pressure does not vanish;
    !> there the cells of its nodes count.
    logical, intent(in) :: candidate(:, :)
    real(wp), allocatable :: opening(:)
    logical, allocatable :: inside(:), opened(:)

    edges%lattice = lattice
    edges%contact = contact
    edges%candidate = candidate
    call new_edge_band(edges%band, contact)
    associate (band => edges%band)
      inside = band%part_of(contact)
      opened = band%part_of(candidate) .and. .not. inside
      edges%pressure = band%values_of(pressure)
      opening = band%values_of(gap)
      where (.not. opened) opening = 0.0_wp
      opening = (opening**2)**(1.0_wp/3.0_wp)
      edges%distance = -max(distances(band, opened, opening) - inward, 0.0_wp)
      opening = max(distances(band, inside, edges%pressure**2) + inward, least)
      where (inside) edges%distance = opening
    end associate
  end subroutine new_contact_edges

  !> The edge of the contact area.
  pure function contact_edge(self) result(edge)
    class(contact_edges_t), intent(in) :: self
    type(zone_edge_t) :: edge
    edge = self%edge_of(self%contact, self%band, self%distance)
  end function contact_edge

  !> The edge of the part of the contact area that sticks.
  pure function stick_edge(self, stick, reserve) result(edge)
    class(contact_edges_t), intent(in) :: self
    !> Nodes that stick, all in contact
    logical, intent(in) :: stick(:, :)
    !> What friction could carry beyond the shear traction, mu p - |q|; only its values at these nodes matter [Pa]
    real(wp), intent(in) :: reserve(:, :)
    type(zone_edge_t) :: edge
    type(edge_band_t) :: band
    type(one_sided_t) :: seen
    real(wp), allocatable :: square(:), distance(:)
    logical, allocatable :: inside(:), slipping(:), at_slip(:)
    real(wp) :: total, to(2, 6)
    integer :: k, j, n_seen

    to = to_neighbors()
    call new_edge_band(band, stick)
    inside = band%part_of(stick)
    slipping = band%part_of(self%contact) .and. .not. inside
    square = band%values_of(reserve)
    where (.not. inside) square = 0.0_wp
    call see_from_inside(band, inside, square**2, seen)
    at_slip = inside .and. band%next_to(slipping)
    allocate (distance(band%n), source=huge(1.0_wp))
    do k = 1, band%n
      if (at_slip(k)) then
        distance(k) = half_way
        if (seen%has_distance(k)) distance(k) = max(seen%distance(k), least)
      else if (slipping(k)) then
        ! Slip tells little about the distance, since its power depends on how far the edge moved in the step; so nodes
        ! outside get theirs from those inside.
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
        distance(k) = -half_way
        if (n_seen > 0) distance(k) = min(total/n_seen, 0.0_wp)
      end if
      ! where the stick area reaches the edge of the contact, that is its edge
      associate (at => band%node(:, k))
        j = self%band%place(at(1), at(2))
        if (j > 0) distance(k) = min(distance(k), self%distance(j))
      end associate
    end do
    edge = self%edge_of(stick, band, distance)
  end function stick_edge

  !> Squares of the pressure that are good to interpolate linearly (n_col, n_row) [Pa^2].
  !>
  !> At nodes in contact the layer of the lattice next to the edge is taken off; beyond the edge the squares go on below
  !> zero. They are NaN away from the edge, and where nothing is known about it.
  pure function squares(self) result(field)
    class(contact_edges_t), intent(in) :: self
    real(wp) :: field(size(self%contact, 1), size(self%contact, 2))
    type(one_sided_t) :: seen
    real(wp) :: square(self%band%n), inwards(2, self%band%n), rises(self%band%n)
    logical :: inside(self%band%n), can_touch(self%band%n), known(self%band%n)
    integer :: k

    associate (band => self%band)
      inside = band%part_of(self%contact)
      can_touch = band%part_of(self%candidate)
      square = self%pressure**2
      call see_from_inside(band, inside, square, seen)
      ! under the rim of a punch the pressure rises towards the edge: its square has no zero there
      known = inside .and. band%next_to(.not. inside)
      inwards = band%gradient(merge(1.0_wp, 0.0_wp, inside), known)
      rises = merge(1.0_wp, 0.0_wp, seen%has_direction .and. sum(inwards*seen%direction, dim=1) < 0.0_wp)
      call band%extend(rises, known)
      field = ieee_value(1.0_wp, ieee_quiet_nan)
      do k = 1, band%n
        if (.not. (known(k) .and. seen%has_slope(k)) .or. any(band%node(:, k) < 1 .or. band%node(:, k) > shape(field))) cycle
        if (rises(k) >= 0.5_wp) cycle
        associate (there => field(band%node(1, k), band%node(2, k)))
          if (inside(k)) then
            there = square(k)
            if (seen%has_distance(k) .and. seen%distance(k) < layer_end) there = seen%slope(k)*seen%distance(k)
          else if (can_touch(k)) then
            there = seen%slope(k)*self%distance(k)
          end if
        end associate
      end do
    end associate
  end function squares

  !> Number of triangles that the edge of a zone cuts.
  pure integer function cut_triangles(zone)
    !> Nodes of the zone (n_col, n_row)
    logical, intent(in) :: zone(:, :)
    integer :: n_with(0:3)

    n_with = triangles(with_rim(zone))
    cut_triangles = n_with(1) + n_with(2)
  end function cut_triangles

  !> A zone with a rim of nodes outside it: 1 in the zone, else 0.
  pure function with_rim(zone) result(padded)
    !> Nodes of the zone (n_col, n_row)
    logical, intent(in) :: zone(:, :)
    integer(int8) :: padded(0:size(zone, 1) + 1, 0:size(zone, 2) + 1)

    padded = 0_int8
    padded(1:size(zone, 1), 1:size(zone, 2)) = merge(1_int8, 0_int8, zone)
  end function with_rim

  !> Number of triangles with no, one, two and three corners in a zone.
  pure function triangles(padded) result(n_with)
    !> Zone with a rim
    integer(int8), intent(in) :: padded(0:, 0:)
    integer :: n_with(0:3), col, row, half, inside(2)

    n_with = 0
    do row = 0, ubound(padded, 2) - 1
      do col = 0, ubound(padded, 1) - 1
        inside = nodes_inside(padded(col:col + 1, row:row + 1))
        do half = 1, 2
          n_with(inside(half)) = n_with(inside(half)) + 1
        end do
      end do
    end do
  end function triangles

  !> How many corners of the lower and of the upper triangle of a cell are in a zone.
  pure function nodes_inside(cell) result(inside)
    !> Its nodes: 1 in the zone, else 0
    integer(int8), intent(in) :: cell(2, 2)
    integer :: inside(2)
    inside = cell(2, 1) + cell(1, 2) + [cell(1, 1), cell(2, 2)]
  end function nodes_inside

  !> Cut the triangles at the edge of a zone where the distance, linear between the nodes, is zero.
  pure function edge_of(self, zone, band, distance) result(edge)
    class(contact_edges_t), intent(in) :: self
    !> Nodes of the zone
    logical, intent(in) :: zone(:, :)
    !> Nodes about its edge, and their distances from it
    type(edge_band_t), intent(in) :: band
    real(wp), intent(in) :: distance(:)
    type(zone_edge_t) :: edge
    integer(int8) :: padded(0:size(zone, 1) + 1, 0:size(zone, 2) + 1)
    real(wp), allocatable :: segments(:, :, :)
    logical, allocatable :: can_touch(:)
    real(wp) :: covered
    integer :: n_with(0:3), inside(2), corners(2, 3), at(3), col, row, half, n

    padded = with_rim(zone)
    n_with = triangles(padded)
    can_touch = band%part_of(self%candidate)
    allocate (segments(2, 2, n_with(1) + n_with(2)))
    n = 0
    covered = n_with(3)
    do row = 0, size(zone, 2)
      do col = 0, size(zone, 1)
        inside = nodes_inside(padded(col:col + 1, row:row + 1))
        do half = 1, 2
          if (mod(inside(half), 3) == 0) cycle
          corners = reshape([half - 1, half - 1, 1, 0, 0, 1], [2, 3]) + spread([col, row], 2, 3)
          at = [band%place(corners(1, 1), corners(2, 1)), band%place(corners(1, 2), corners(2, 2)), &
                band%place(corners(1, 3), corners(2, 3))]
          if (all(can_touch(at))) then
            n = n + 1
            call cut(real(corners, wp), distance(at), segments(:, :, n), covered)
          else
            covered = covered + inside(half)/3.0_wp
          end if
        end do
      end do
    end do
    edge%area = 0.5_wp*self%lattice%cell_area()*covered
    allocate (edge%segments(2, 2, n))
    associate (lattice => self%lattice)
      do half = 1, n
        do col = 1, 2
          edge%segments(:, col, half) = lattice%origin + matmul(lattice%basis, lattice%first - 1 + segments(:, col, half))
        end do
      end do
    end associate
  end function edge_of

  !> Cut one triangle: add its part inside, and return the ends of the piece of the edge.
  pure subroutine cut(corners, distance, ends, covered)
    !> Column and row of the corners, and their distances
    real(wp), intent(in) :: corners(2, 3), distance(3)
    !> Columns and rows of both ends
    real(wp), intent(out) :: ends(2, 2)
    !> Area inside so far, in triangles
    real(wp), intent(inout) :: covered
    real(wp) :: way
    integer :: order(3), k

    ! the corner that is on its own side goes first
    order = modulo(findloc(distance > 0.0_wp, count(distance > 0.0_wp) == 1, dim=1) + [-1, 0, 1], 3) + 1
    way = 1.0_wp
    do k = 1, 2
      associate (one => distance(order(1)), other => distance(order(k + 1)))
        way = way*(one/(one - other))
        ends(:, k) = corners(:, order(1)) + one/(one - other)*(corners(:, order(k + 1)) - corners(:, order(1)))
      end associate
    end do
    covered = covered + merge(way, 1.0_wp - way, distance(order(1)) > 0.0_wp)
  end subroutine cut

  !> Distances of the nodes of a part from its edge, where some values vanish in proportion to them.
  pure function distances(band, part, values) result(away)
    !> Nodes about the edge
    type(edge_band_t), intent(in) :: band
    !> Those of the part
    logical, intent(in) :: part(:)
    !> Values at the nodes
    real(wp), intent(in) :: values(:)
    real(wp) :: away(band%n), slope(band%n)
    logical :: known(band%n)

    known = band%surrounded(part)
    slope = norm2(band%gradient(values, known), dim=1)
    call band%extend(slope, known)
    away = half_way
    where (known .and. slope > no_slope*abs(values)) away = values/slope
  end function distances

  !> Distances from the edge, slopes there and directions inwards, from the nodes of one side only.
  !>
  !> The layer at the edge is taken off first, with the slope further inside. The slope at the edge itself then follows
  !> from those of the parabola that the squares S are along the normal n: k^4 = S'^2 - 2 S S". Where this is little or
  !> negative they vanish with a higher power than the first, and there is no slope.
  pure subroutine see_from_inside(band, part, square, seen)
    !> Nodes about the edge
    type(edge_band_t), intent(in) :: band
    !> Those on that side
    logical, intent(in) :: part(:)
    !> Values at the nodes, squares of what vanishes like a square root
    real(wp), intent(in) :: square(:)
    !> What is found
    type(one_sided_t), intent(out) :: seen
    logical :: whole(band%n), known(band%n)
    real(wp) :: slope(band%n), smooth(band%n), flat(band%n), steepness, bend, to(2, 6)
    integer :: k

    to = to_neighbors()
    whole = band%surrounded(part)
    known = whole
    slope = norm2(band%gradient(square, whole), dim=1)
    call band%extend(slope, known)
    smooth = square
    do k = 1, band%n
      if (.not. known(k) .or. slope(k) <= no_slope*square(k)) cycle
      associate (away => from_square(square(k)/slope(k)))
        if (away < layer_end) smooth(k) = slope(k)*away
      end associate
    end do

    seen%direction = band%gradient(smooth, whole)
    flat = 0.0_wp
    seen%has_slope = whole
    seen%has_direction = whole
    known = whole
    do k = 1, band%n
      steepness = norm2(seen%direction(:, k))
      if (.not. whole(k)) cycle
      if (steepness > no_slope*smooth(k)) then
        seen%direction(:, k) = seen%direction(:, k)/steepness
      else
        ! but a rounding error, as in the middle of few nodes: one direction is as good as another
        seen%direction(:, k) = [1.0_wp, 0.0_wp]
      end if
      ! second derivative along n from those along the three lines of nodes at angles t to n, with weights 1 + 2 cos 2t
      bend = sum((4.0_wp*matmul(seen%direction(:, k), to)**2 - 1.0_wp)*(smooth(band%beside(:, k)) - smooth(k)))/3.0_wp
      slope(k) = steepness**2 - 2.0_wp*smooth(k)*bend
      if (slope(k) < least_slope*steepness**2) flat(k) = 1.0_wp
      slope(k) = sqrt(max(slope(k), least_slope*steepness**2))
      seen%has_slope(k) = slope(k) > 0.0_wp
    end do
    call band%extend(flat, whole)
    call band%extend(slope, seen%has_slope)
    call band%extend(seen%direction(1, :), known)
    call band%extend(seen%direction(2, :), seen%has_direction)
    seen%slope = slope
    seen%has_slope = seen%has_slope .and. .not. (whole .and. flat > 0.5_wp)

    seen%distance = square
    seen%has_distance = seen%has_slope
    do k = 1, band%n
      seen%has_distance(k) = seen%has_slope(k) .and. slope(k) > no_slope*square(k)
      if (seen%has_distance(k)) seen%distance(k) = from_square(square(k)/slope(k))
      associate (n => norm2(seen%direction(:, k)))
        seen%has_direction(k) = seen%has_direction(k) .and. n > no_slope
        if (seen%has_direction(k)) seen%direction(:, k) = seen%direction(:, k)/n
      end associate
    end do
  end subroutine see_from_inside

  !> Distance of a node from the edge at which the solution on the lattice has a square, both in slopes.
  pure real(wp) function from_square(square)
    !> Square, at least 0
    real(wp), intent(in) :: square
    integer :: k

    from_square = square
    if (square >= layer_end) return
    k = findloc(layer_square <= square, .true., dim=1, back=.true.)
    associate (part => (square - layer_square(k))/(layer_square(k + 1) - layer_square(k)))
      from_square = layer_distance(k) + part*(layer_distance(k + 1) - layer_distance(k))
    end associate
  end function from_square

end module hc_contact_edges
