!> Pressure and shear traction at any point of a contact, to the edges of the contact and of the stick area.
!>
!> Joined linearly, the nodal tractions end one link beyond the last nodes in contact, and those next to an edge carry the layer
!> of the lattice. Here the pressure, and the reserve of friction L - |q| that vanishes at the edge of the stick area, go to
!> zero like square roots between the nodes, and the layer is off them. The shear traction is as large as friction allows where
!> a contact slips, and at most that elsewhere. Away from the edges the field is linear between the nodal values.
!>
!> Equations: docs/theory/edges.md, (B6) and (B7).
module hc_traction_field
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  use hc_precision, only: wp
  use hc_options, only: edge_options_t
  use hc_lattice, only: lattice_t, neighbors
  use hc_interpolation, only: place_t, place_of, root_at
  use hc_contact_edges, only: contact_edges_t
  use hc_friction_law, only: friction_law_t
  implicit none
  private

  public :: traction_field_t, new_traction_field, field_of_arrays

  !> Number of fields that make a traction field as plain arrays.
  integer, parameter, public :: n_part = 11

  !> Tractions of a contact over the plane.
  type :: traction_field_t
    type(lattice_t) :: lattice
    !> Pressure, and shear traction if there is one, as solved (n_col, n_row, 1 or 3) [Pa]
    real(wp), allocatable :: nodal(:, :, :)
    !> Pressure at the nodes, and its squares near the edge, NaN elsewhere (n_col, n_row) [Pa], [Pa^2]
    real(wp), allocatable :: pressure(:, :), squares(:, :)
    !> Law of friction; without one the shear traction is that of the nodes, and nothing follows
    class(friction_law_t), allocatable :: friction
    !> Shear traction over its limit; nodes next to the contact have the mean of their neighbors (n_col, n_row, direction)
    real(wp), allocatable :: direction(:, :, :)
    !> Nodes that stick (n_col, n_row)
    logical, allocatable :: stick(:, :)
    !> Their reserve as solved, its squares near the edge of the stick area, NaN elsewhere, and the shear traction
    !> after the corrections of the limit and of the reserve (n_col, n_row) [Pa], [Pa^2], [Pa]
    real(wp), allocatable :: reserve(:, :), stick_squares(:, :), taken(:, :)
  contains
    !> Tractions at a point
    procedure :: at
    !> Tractions at all nodes
    procedure :: at_nodes
    !> Their difference from the hats of the nodal values at a point
    procedure :: beyond_hats
    !> Renew the values at the nodes after a change of the squares
    procedure :: renew
    !> The field as plain arrays
    procedure :: arrays
    procedure, private :: at_place, limits
  end type traction_field_t

contains

  !> Set up the tractions of a contact.
  subroutine new_traction_field(field, lattice, edges, traction, contact, stick, friction, options)
    !> Field to be set up
    type(traction_field_t), intent(out) :: field
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Edges of the contact
    type(contact_edges_t), intent(in) :: edges
    !> Pressure, and shear traction if there is one, at the nodes (n_col, n_row, 1 or 3) [Pa]
    real(wp), intent(in) :: traction(:, :, :)
    !> Nodes in contact, and those of them that stick (n_col, n_row)
    logical, intent(in) :: contact(:, :), stick(:, :)
    !> Law of friction that bounds the traction in all directions alike; absent: the shear traction is that of the nodes, joined
    !> linearly
    class(friction_law_t), intent(in), optional :: friction
    !> Tuning numbers; absent: the usual ones
    type(edge_options_t), intent(in), optional :: options
    type(edge_options_t) :: tuning
    real(wp), allocatable :: limit(:, :)

    if (present(options)) tuning = options
    field%lattice = lattice
    field%nodal = traction
    field%squares = edges%squares()
    if (size(traction, 3) == 3 .and. present(friction)) then
      allocate (field%friction, source=friction)
      field%stick = stick
      limit = friction%bounds_of(traction(:, :, 1))
      field%reserve = merge(max(limit - norm2(traction(:, :, 2:3), dim=3), 0.0_wp), 0.0_wp, stick)
      field%direction = directions(lattice, traction(:, :, 2:3), limit, contact)
      field%stick_squares = edges%stick_squares(stick, field%reserve)
      ! where stick reaches the edge of the contact that is its edge, too, and the reserve says no more than the pressure
      where (stick .and. .not. near(contact .and. .not. stick, tuning%reach)) &
        field%stick_squares = ieee_value(1.0_wp, ieee_quiet_nan)
    end if
    call field%renew()
  end subroutine new_traction_field

  !> Set up a field from plain arrays, see `arrays`.
  subroutine field_of_arrays(field, lattice, parts, friction)
    !> Field to be set up
    type(traction_field_t), intent(out) :: field
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Its arrays (n_col, n_row, part), the first five without a law of friction
    real(wp), intent(in) :: parts(:, :, :)
    !> Law of friction
    class(friction_law_t), intent(in) :: friction

    field%lattice = lattice
    field%nodal = parts(:, :, 1:3)
    field%pressure = parts(:, :, 4)
    field%squares = parts(:, :, 5)
    if (size(parts, 3) < n_part) return
    allocate (field%friction, source=friction)
    field%direction = parts(:, :, 6:7)
    field%stick = parts(:, :, 8) > 0.5_wp
    field%reserve = parts(:, :, 9)
    field%stick_squares = parts(:, :, 10)
    field%taken = parts(:, :, 11)
  end subroutine field_of_arrays

  !> Return the field as plain arrays, the first of them without a law of friction.
  pure subroutine arrays(self, parts)
    class(traction_field_t), intent(in) :: self
    !> The arrays (n_col, n_row, part)
    real(wp), intent(out) :: parts(:, :, :)

    parts(:, :, 1:3) = 0.0_wp
    parts(:, :, :size(self%nodal, 3)) = self%nodal
    parts(:, :, 4) = self%pressure
    parts(:, :, 5) = self%squares
    if (.not. allocated(self%friction)) return
    parts(:, :, 6:7) = self%direction
    parts(:, :, 8) = merge(1.0_wp, 0.0_wp, self%stick)
    parts(:, :, 9) = self%reserve
    parts(:, :, 10) = self%stick_squares
    parts(:, :, 11) = self%taken
  end subroutine arrays

  !> Renew the values at the nodes after a change of the squares.
  pure subroutine renew(self)
    class(traction_field_t), intent(inout) :: self
    real(wp) :: limit(2)
    integer :: col, row

    self%pressure = self%nodal(:, :, 1)
    if (allocated(self%friction) .and. .not. allocated(self%taken)) allocate (self%taken, mold=self%pressure)
    do row = 1, size(self%pressure, 2)
      do col = 1, size(self%pressure, 1)
        associate (square => self%squares(col, row))
          if (.not. ieee_is_nan(square)) self%pressure(col, row) = sqrt(max(square, 0.0_wp))
        end associate
        if (.not. allocated(self%friction)) cycle
        self%taken(col, row) = 0.0_wp
        associate (square => self%stick_squares(col, row))
          if (ieee_is_nan(square) .or. .not. self%stick(col, row)) cycle
          limit = self%limits(place_at(col, row), [self%pressure(col, row), self%nodal(col, row, 1)])
          self%taken(col, row) = sqrt(max(square, 0.0_wp)) - self%reserve(col, row) &
                                 - (1.0_wp - norm2(self%direction(col, row, :)))*(limit(1) - limit(2))
        end associate
      end do
    end do
  end subroutine renew

  !> Return pressure and shear traction at a point [Pa].
  pure function at(self, point) result(traction)
    class(traction_field_t), intent(in) :: self
    !> x and y [m]
    real(wp), intent(in) :: point(2)
    real(wp) :: traction(size(self%nodal, 3))

    traction = self%at_place(place_of(self%lattice, point))
  end function at

  !> Return pressure and shear traction at all nodes (n_col, n_row, component) [Pa].
  pure function at_nodes(self) result(traction)
    class(traction_field_t), intent(in) :: self
    real(wp) :: traction(size(self%nodal, 1), size(self%nodal, 2), size(self%nodal, 3))
    integer :: col, row

    traction = self%nodal
    do row = 1, size(traction, 2)
      do col = 1, size(traction, 1)
        if (ieee_is_nan(self%squares(col, row))) then
          if (.not. allocated(self%friction)) cycle
          if (ieee_is_nan(self%stick_squares(col, row))) cycle
        end if
        traction(col, row, :) = self%at_place(place_at(col, row))
      end do
    end do
  end function at_nodes

  !> Compute the difference of the field from the hats of the nodal values at a point [Pa].
  pure function beyond_hats(self, point) result(more)
    class(traction_field_t), intent(in) :: self
    !> x and y [m]
    real(wp), intent(in) :: point(2)
    real(wp) :: more(size(self%nodal, 3))
    type(place_t) :: place
    integer :: k

    place = place_of(self%lattice, point)
    more = self%at_place(place) - [(place%mean(self%nodal(:, :, k), 0.0_wp), k=1, size(more))]
  end function beyond_hats

  !> Return pressure and shear traction at a place, (B6) and (B7) [Pa].
  pure function at_place(self, place) result(traction)
    class(traction_field_t), intent(in) :: self
    !> The place
    type(place_t), intent(in) :: place
    real(wp) :: traction(size(self%nodal, 3))
    !> Share of the limit below which the direction of a shear traction is not to be trusted
    real(wp), parameter :: least_share = 0.05_wp
    real(wp) :: along(2), limit(2), part(2), square, taken, share, length
    logical :: sticks
    integer :: k

    do k = 1, size(traction)
      traction(k) = place%mean(self%nodal(:, :, k), 0.0_wp)
    end do
    part = [root_at(place, self%pressure, self%squares), traction(1)]
    traction(1) = part(1)
    if (.not. allocated(self%friction)) return
    limit = self%limits(place, part)
    along = [(place%mean(self%direction(:, :, k), 0.0_wp), k=1, 2)]
    share = norm2(along)
    sticks = place%touches(self%stick)
    taken = 0.0_wp
    if (sticks) then
      square = place%mean(self%stick_squares, 0.0_wp)
      if (ieee_is_nan(square)) then
        taken = place%mean(self%taken, 0.0_wp)
      else
        taken = sqrt(max(square, 0.0_wp)) - place%mean(self%reserve, 0.0_wp) - (1.0_wp - share)*(limit(1) - limit(2))
        sticks = square > 0.0_wp
      end if
    end if
    traction(2:3) = traction(2:3) + along*(limit(1) - limit(2) - taken/max(share, least_share))
    length = norm2(traction(2:3))
    if (length > limit(1) .or. (length > 0.0_wp .and. .not. sticks)) traction(2:3) = limit(1)/length*traction(2:3)
  end function at_place

  !> Compute the largest shear tractions that friction allows under pressures at a place, the mean of its nodes [Pa].
  pure function limits(self, place, pressure) result(limit)
    class(traction_field_t), intent(in) :: self
    !> The place
    type(place_t), intent(in) :: place
    !> Pressures [Pa]
    real(wp), intent(in) :: pressure(2)
    real(wp) :: limit(2), bound(1)
    integer :: i, k, first

    limit = 0.0_wp
    if (.not. place%near) return
    do k = 1, size(place%weight)
      associate (node => place%node(:, k), n => shape(self%pressure))
        if (.not. place%weight(k) > 0.0_wp .or. any(node < 1 .or. node > n)) cycle
        first = (node(2) - 1)*n(1) + node(1)
      end associate
      do i = 1, size(pressure)
        call self%friction%find_bounds(first, pressure(i:i), bound)
        limit(i) = limit(i) + place%weight(k)*bound(1)
      end do
    end do
  end function limits

  !> Return the place of a node.
  pure type(place_t) function place_at(col, row) result(place)
    !> Column and row, counted from 1
    integer, intent(in) :: col, row

    place%near = .true.
    place%weight(1) = 1.0_wp
    place%node(:, 1) = [col, row]
  end function place_at

  !> Compute the shear traction over its limit at the nodes in contact, and the mean of them at those next to the contact.
  pure function directions(lattice, shear, limit, contact) result(direction)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Shear traction (n_col, n_row, direction) and its limit [Pa]
    real(wp), intent(in) :: shear(:, :, :), limit(:, :)
    !> Nodes in contact
    logical, intent(in) :: contact(:, :)
    real(wp) :: direction(size(shear, 1), size(shear, 2), 2)
    real(wp) :: total(2)
    integer :: col, row, k, beside

    do k = 1, 2
      direction(:, :, k) = merge(shear(:, :, k)/max(limit, tiny(1.0_wp)), 0.0_wp, contact .and. limit > 0.0_wp)
    end do
    do row = 1, size(contact, 2)
      do col = 1, size(contact, 1)
        if (contact(col, row)) cycle
        total = 0.0_wp
        beside = 0
        do k = 1, size(neighbors, 2)
          associate (at => lattice%neighbor([col, row], k))
            if (at(1) == 0) cycle
            if (.not. contact(at(1), at(2))) cycle
            total = total + direction(at(1), at(2), :)
            beside = beside + 1
          end associate
        end do
        if (beside > 0) direction(col, row, :) = total/beside
      end do
    end do
  end function directions

  !> Find the nodes within some steps of a zone.
  pure function near(zone, steps) result(there)
    !> Nodes of the zone (n_col, n_row)
    logical, intent(in) :: zone(:, :)
    !> Steps
    integer, intent(in) :: steps
    logical :: there(size(zone, 1), size(zone, 2))
    integer :: step, n(2)

    there = zone
    n = shape(zone)
    do step = 1, steps
      there(2:, :) = there(2:, :) .or. there(:n(1) - 1, :)
      there(:n(1) - 1, :) = there(:n(1) - 1, :) .or. there(2:, :)
      there(:, 2:) = there(:, 2:) .or. there(:, :n(2) - 1)
      there(:, :n(2) - 1) = there(:, :n(2) - 1) .or. there(:, 2:)
    end do
  end function near

end module hc_traction_field
