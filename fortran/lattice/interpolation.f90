!> Fields between the nodes of a lattice.
!>
!> A field of the solution is a sum of hat functions, linear on each triangle. The pressure vanishes like a square root
!> at the edge of the contact, so there its square is interpolated: docs/theory/edges.md.
module hc_interpolation
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use hc_precision, only: wp
  use hc_lattice, only: lattice_t
  implicit none
  private

  public :: place_t, place_of, root_at, interpolate, interpolate_pressure, nearest_node

  !> Positions along a spacing that differ: a point that is closer to a node is that node.
  real(wp), parameter :: places = 1.0e9_wp
  !> Nodes of a cell, as steps in column and row from its first one.
  integer, parameter :: cell(2, 4) = reshape([0, 0, 1, 0, 0, 1, 1, 1], [2, 4])

  !> A point in a cell of the lattice.
  type :: place_t
    !> Nodes of the cell, column and row counted from 1
    integer :: node(2, 4) = 0
    !> Their weights for linear interpolation on the triangles, none below 0; 0: not a corner of the triangle
    real(wp) :: weight(4) = 0.0_wp
    !> It is within a spacing of the window
    logical :: near = .false.
  contains
    !> Values at the nodes, weighted
    procedure :: mean
    !> Whether a corner of its triangle is in a zone
    procedure :: touches
  end type place_t

contains

  !> Find the place of a point; a window that repeats has places for all points.
  pure type(place_t) function place_of(lattice, point) result(place)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> x and y [m]
    real(wp), intent(in) :: point(2)
    real(wp) :: at(2)
    integer :: k

    at = anint(coordinates_of(lattice, point)*places)/places
    where (lattice%periodic) at = modulo(at, real(lattice%extent, wp))
    place%near = all(lattice%periodic .or. (at > -1.0_wp .and. at < lattice%extent))
    if (.not. place%near) return
    associate (u => at(1) - floor(at(1)), v => at(2) - floor(at(2)))
      if (u + v <= 1.0_wp) then
        place%weight = [max(1.0_wp - u - v, 0.0_wp), u, v, 0.0_wp]
      else
        place%weight = [0.0_wp, 1.0_wp - v, 1.0_wp - u, u + v - 1.0_wp]
      end if
    end associate
    do k = 1, size(cell, 2)
      place%node(:, k) = floor(at) + cell(:, k) + 1
      where (lattice%periodic) place%node(:, k) = modulo(place%node(:, k) - 1, lattice%extent) + 1
    end do
  end function place_of

  !> Return the values at the nodes of a place, weighted.
  pure real(wp) function mean(self, values, outside)
    class(place_t), intent(in) :: self
    !> Values at the nodes (n_col, n_row)
    real(wp), intent(in) :: values(:, :)
    !> Value at nodes outside the window
    real(wp), intent(in) :: outside
    integer :: k

    mean = outside
    if (.not. self%near) return
    mean = 0.0_wp
    do k = 1, size(self%weight)
      if (self%weight(k) > 0.0_wp) mean = mean + self%weight(k)*value_at(values, self%node(:, k), outside)
    end do
  end function mean

  !> Return whether a corner of the triangle of a place is in a zone.
  pure logical function touches(self, zone)
    class(place_t), intent(in) :: self
    !> Nodes of the zone (n_col, n_row)
    logical, intent(in) :: zone(:, :)
    integer :: k

    touches = .false.
    do k = 1, size(self%weight)
      associate (node => self%node(:, k))
        if (.not. self%weight(k) > 0.0_wp .or. any(node < 1 .or. node > shape(zone))) cycle
        touches = touches .or. zone(node(1), node(2))
      end associate
    end do
  end function touches

  !> Interpolate a field at a point, linearly on the triangles.
  pure real(wp) function interpolate(lattice, values, point, outside) result(value)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Values at the nodes (n_col, n_row)
    real(wp), intent(in) :: values(:, :)
    !> x and y [m]
    real(wp), intent(in) :: point(2)
    !> Value at nodes outside the window
    real(wp), intent(in) :: outside
    type(place_t) :: place

    place = place_of(lattice, point)
    value = place%mean(values, outside)
  end function interpolate

  !> Interpolate a field that vanishes like a square root at an edge: near it the square is linear, elsewhere it is itself.
  pure real(wp) function interpolate_pressure(lattice, pressure, squares, point) result(value)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Pressure at the nodes (n_col, n_row) [Pa]
    real(wp), intent(in) :: pressure(:, :)
    !> Its squares near the edge, NaN elsewhere: see hc_contact_edges [Pa^2]
    real(wp), intent(in) :: squares(:, :)
    !> x and y [m]
    real(wp), intent(in) :: point(2)
    type(place_t) :: place

    place = place_of(lattice, point)
    value = root_at(place, pressure, squares)
  end function interpolate_pressure

  !> Return the root of squares at a place, where all its nodes have one; else the mean of other values.
  pure real(wp) function root_at(place, values, squares) result(value)
    !> The place
    type(place_t), intent(in) :: place
    !> Values at the nodes, and their squares or NaN (n_col, n_row)
    real(wp), intent(in) :: values(:, :), squares(:, :)

    value = place%mean(squares, 0.0_wp)
    if (ieee_is_nan(value)) then
      value = place%mean(values, 0.0_wp)
    else
      value = sqrt(max(value, 0.0_wp))
    end if
  end function root_at

  !> Find the node next to a point, and whether it is in the window; else that at the rim.
  pure subroutine nearest_node(lattice, point, node, inside)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> x and y [m]
    real(wp), intent(in) :: point(2)
    !> Column and row, counted from 0 at the first node of the window
    integer, intent(out) :: node(2)
    !> It is the next one
    logical, intent(out) :: inside
    real(wp) :: at(2), distance(4)
    integer :: k

    ! beyond the rim all nodes are outside, and far ones have no index
    at = coordinates_of(lattice, point)
    at = merge(modulo(at, real(lattice%extent, wp)), min(max(at, -2.0_wp), lattice%extent + 1.0_wp), lattice%periodic)
    do k = 1, size(distance)
      distance(k) = norm2(matmul(lattice%basis, floor(at) + cell(:, k) - at))
    end do
    associate (next => floor(at) + cell(:, minloc(distance, dim=1)))
      node = merge(modulo(next, lattice%extent), min(max(next, 0), lattice%extent - 1), lattice%periodic)
      inside = all(lattice%periodic .or. node == next)
    end associate
  end subroutine nearest_node

  !> Return column and row of a point, counted from 0 at the first node of the window.
  pure function coordinates_of(lattice, point) result(at)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> x and y [m]
    real(wp), intent(in) :: point(2)
    real(wp) :: at(2), away(2)

    away = point - lattice%origin - matmul(lattice%basis, real(lattice%first, wp))
    associate (b => lattice%basis)
      at = [b(2, 2)*away(1) - b(1, 2)*away(2), b(1, 1)*away(2) - b(2, 1)*away(1)]/lattice%cell_area()
    end associate
  end function coordinates_of

  !> Return the value at a node.
  pure real(wp) function value_at(values, node, outside)
    !> Values at the nodes (n_col, n_row)
    real(wp), intent(in) :: values(:, :)
    !> Column and row, counted from 1
    integer, intent(in) :: node(2)
    !> Value outside the window
    real(wp), intent(in) :: outside

    value_at = outside
    if (all(node >= 1 .and. node <= shape(values))) value_at = values(node(1), node(2))
  end function value_at

end module hc_interpolation
