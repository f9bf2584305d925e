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

  public :: interpolate, interpolate_pressure, nearest_node

  !> Positions along a spacing that differ: a point that is closer to a node is that node.
  real(wp), parameter :: places = 1.0e9_wp
  !> Nodes of a cell, as steps in column and row from its first one.
  integer, parameter :: cell(2, 4) = reshape([0, 0, 1, 0, 0, 1, 1, 1], [2, 4])

contains

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
    real(wp) :: at(2), weight(4)
    integer :: k

    value = outside
    at = anint(coordinates_of(lattice, point)*places)/places
    if (.not. all(at > -1.0_wp .and. at < lattice%extent)) return
    associate (u => at(1) - floor(at(1)), v => at(2) - floor(at(2)))
      if (u + v <= 1.0_wp) then
        weight = [max(1.0_wp - u - v, 0.0_wp), u, v, 0.0_wp]
      else
        weight = [0.0_wp, 1.0_wp - v, 1.0_wp - u, u + v - 1.0_wp]
      end if
    end associate
    value = 0.0_wp
    do k = 1, size(weight)
      if (weight(k) > 0.0_wp) value = value + weight(k)*value_at(values, floor(at) + cell(:, k), outside)
    end do
  end function interpolate

  !> Interpolate the pressure at a point: its square is linear near the edge of the contact, elsewhere it is itself [Pa].
  pure real(wp) function interpolate_pressure(lattice, pressure, squares, point) result(value)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Pressure at the nodes (n_col, n_row) [Pa]
    real(wp), intent(in) :: pressure(:, :)
    !> Its squares near the edge, NaN elsewhere: see hc_contact_edges [Pa^2]
    real(wp), intent(in) :: squares(:, :)
    !> x and y [m]
    real(wp), intent(in) :: point(2)

    value = interpolate(lattice, squares, point, 0.0_wp)
    if (ieee_is_nan(value)) then
      value = interpolate(lattice, pressure, point, 0.0_wp)
    else
      value = sqrt(max(value, 0.0_wp))
    end if
  end function interpolate_pressure

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
    at = min(max(coordinates_of(lattice, point), -2.0_wp), lattice%extent + 1.0_wp)
    do k = 1, size(distance)
      distance(k) = norm2(matmul(lattice%basis, floor(at) + cell(:, k) - at))
    end do
    associate (next => floor(at) + cell(:, minloc(distance, dim=1)))
      node = min(max(next, 0), lattice%extent - 1)
      inside = all(node == next)
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
    !> Column and row, counted from 0
    integer, intent(in) :: node(2)
    !> Value outside the window
    real(wp), intent(in) :: outside

    value_at = outside
    if (all(node >= 0 .and. node < shape(values))) value_at = values(node(1) + 1, node(2) + 1)
  end function value_at

end module hc_interpolation
