!> Fields between a lattice and the lattice of its every second node.
!>
!> Node (i, j) of the coarse lattice is node (2 i, 2 j) of the fine one. The
!> interpolation is that of the piecewise linear pyramids themselves: the other
!> fine nodes are the midpoints of coarse edges.
module hc_multilevel
  use hc_precision, only: wp
  use hc_lattice, only: lattice_t
  implicit none
  private

  public :: level_count, prolong, restrict_field, restrict_mask

contains

  !> Number of lattices, the given one included, when no window gets smaller than it should.
  pure integer function level_count(extent, smallest_side)
    !> Number of columns and rows of the finest window
    integer, intent(in) :: extent(2)
    !> Nodes that a side should have at least
    integer, intent(in) :: smallest_side
    integer :: side

    level_count = 1
    side = minval(extent)
    do while (side >= 2*smallest_side)
      side = side/2
      level_count = level_count + 1
    end do
  end function level_count

  !> Interpolate a field from the coarse to the fine lattice; zero outside the coarse window.
  pure subroutine prolong(coarse_lattice, coarse, fine_lattice, fine)
    !> Coarse lattice and window
    type(lattice_t), intent(in) :: coarse_lattice
    !> Coarse field (n_col, n_row)
    real(wp), intent(in) :: coarse(:, :)
    !> Fine lattice and window
    type(lattice_t), intent(in) :: fine_lattice
    !> Fine field (n_col, n_row)
    real(wp), intent(out) :: fine(:, :)
    integer :: col, row, i, j

    do row = 1, size(fine, 2)
      j = fine_lattice%first(2) + row - 1
      do col = 1, size(fine, 1)
        i = fine_lattice%first(1) + col - 1
        if (modulo(i, 2) == 0 .and. modulo(j, 2) == 0) then
          fine(col, row) = at(i, j)
        else if (modulo(j, 2) == 0) then
          fine(col, row) = 0.5_wp*(at(i - 1, j) + at(i + 1, j))
        else if (modulo(i, 2) == 0) then
          fine(col, row) = 0.5_wp*(at(i, j - 1) + at(i, j + 1))
        else
          fine(col, row) = 0.5_wp*(at(i + 1, j - 1) + at(i - 1, j + 1))
        end if
      end do
    end do

  contains

    !> Coarse value at an even fine node
    pure real(wp) function at(fine_col, fine_row)
      !> Absolute indices of the fine node
      integer, intent(in) :: fine_col, fine_row
      integer :: c(2)

      c = [fine_col, fine_row]/2 - coarse_lattice%first + 1
      at = 0.0_wp
      if (all(c >= 1) .and. all(c <= coarse_lattice%extent)) at = coarse(c(1), c(2))
    end function at

  end subroutine prolong

  !> Values of a field at the coarse nodes.
  pure function restrict_field(fine_lattice, fine, coarse_lattice) result(coarse)
    !> Fine lattice and window
    type(lattice_t), intent(in) :: fine_lattice
    !> Fine field (n_col, n_row)
    real(wp), intent(in) :: fine(:, :)
    !> Coarse lattice and window, inside the fine one
    type(lattice_t), intent(in) :: coarse_lattice
    !> Coarse field (n_col, n_row)
    real(wp) :: coarse(coarse_lattice%extent(1), coarse_lattice%extent(2))
    integer :: start(2)

    start = 2*coarse_lattice%first - fine_lattice%first + 1
    coarse = fine(start(1)::2, start(2)::2)
  end function restrict_field

  !> Values of a mask at the coarse nodes.
  pure function restrict_mask(fine_lattice, fine, coarse_lattice) result(coarse)
    !> Fine lattice and window
    type(lattice_t), intent(in) :: fine_lattice
    !> Fine mask (n_col, n_row)
    logical, intent(in) :: fine(:, :)
    !> Coarse lattice and window, inside the fine one
    type(lattice_t), intent(in) :: coarse_lattice
    !> Coarse mask (n_col, n_row)
    logical :: coarse(coarse_lattice%extent(1), coarse_lattice%extent(2))
    integer :: start(2)

    start = 2*coarse_lattice%first - fine_lattice%first + 1
    coarse = fine(start(1)::2, start(2)::2)
  end function restrict_mask

end module hc_multilevel
