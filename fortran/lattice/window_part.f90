!> The part of a window around a contact.
module hc_window_part
  use hc_precision, only: wp
  use hc_lattice, only: lattice_t
  implicit none
  private

  public :: frame, is_worth, part_of, worth

  !> A part is worth operators of its own below this share of the nodes of the window.
  real(wp), parameter :: worth = 0.6_wp
  !> Nodes around the contact: so many, and its extent over this.
  integer, parameter :: least_margin = 6, margin_part = 16
  !> Sides of parts grow in steps of about this share of them.
  integer, parameter :: step_part = 16

contains

  !> First and last column and row of the part around some nodes, with a margin as far as the window goes.
  !>
  !> It depends on nothing else, so that a load gives the same bits whatever came before it.
  pure subroutine frame(nodes, low, high)
    !> The nodes (n_col, n_row)
    logical, intent(in) :: nodes(:, :)
    !> Columns and rows, from 1 on
    integer, intent(out) :: low(2), high(2)
    integer :: d, margin, step
    logical :: line(maxval(shape(nodes)))

    do d = 1, 2
      line = .false.
      line(:size(nodes, d)) = any(nodes, dim=3 - d)
      low(d) = max(findloc(line, .true., dim=1), 1)
      high(d) = findloc(line, .true., dim=1, back=.true.)
      if (high(d) == 0) high(d) = size(nodes, d)
      margin = least_margin + (high(d) - low(d) + 1)/margin_part
      ! in steps of a power of two, so that loads that are alike share a part
      step = least_margin
      do while (step*step_part < high(d) - low(d))
        step = 2*step
      end do
      low(d) = max((low(d) - margin - 1)/step*step + 1, 1)
      high(d) = min((high(d) + margin + step - 1)/step*step, size(nodes, d))
    end do
  end subroutine frame

  !> Is the part so much smaller than the window that operators of its own pay?
  pure logical function is_worth(low, high, lattice)
    !> First and last column and row of the part
    integer, intent(in) :: low(2), high(2)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    is_worth = product(high - low + 1) <= worth*lattice%size()
  end function is_worth

  !> Lattice and window of a part.
  pure function part_of(lattice, low, high) result(part)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> First and last column and row of the part
    integer, intent(in) :: low(2), high(2)
    type(lattice_t) :: part

    part = lattice
    part%first = lattice%first + low - 1
    part%extent = high - low + 1
  end function part_of

end module hc_window_part
