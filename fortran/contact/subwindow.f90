!> The part of the window around the contact, and what is done where it fails: one policy for all solvers.
!>
!> Where the contact that is known fills much less than the window, a problem is solved on the part around it, and judged by
!> one product over the window (docs/theory/multilevel.md, "Part of the window"). A part that has a solution fails where
!> the bodies overlap outside of it: the next part is around these nodes, too. The whole window is next where a part has no
!> solution, where it is not worth it any more, or after some parts.
module hc_subwindow
  use hc_precision, only: wp
  use hc_options, only: multilevel_options_t
  use hc_lattice, only: lattice_t
  use hc_contact_state, only: contact_state_t
  implicit none
  private

  public :: next_part

contains

  !> First and last column and row of the part to be tried next.
  subroutine next_part(try, options, lattice, candidate, state, low, high, found)
    !> Number of the part, from 1 on
    integer, intent(in) :: try
    type(multilevel_options_t), intent(in) :: options
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Nodes that may come into contact (n_col, n_row)
    logical, intent(in) :: candidate(:, :)
    !> State to start from at first; then that of the last part over the window, with its gap
    type(contact_state_t), intent(in) :: state
    !> Columns and rows, from 1 on
    integer, intent(out) :: low(2), high(2)
    !> False: the whole window is next
    logical, intent(out) :: found

    found = try <= options%max_parts
    low = 1
    high = lattice%extent
    if (.not. found) return
    if (try == 1) then
      call lattice%enclose(state%pressure > 0.0_wp, low, high)
    else
      call lattice%enclose(state%pressure > 0.0_wp .or. (state%gap < 0.0_wp .and. candidate), low, high)
    end if
    found = lattice%is_worth_parting(low, high)
  end subroutine next_part

end module hc_subwindow
