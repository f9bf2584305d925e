!> Cycles of a load history: where a motion turns back, and the area of the loop of a load over its motion.
!>
!> Equations: docs/theory/load_path.md, (L3).
module hc_load_cycles
  use hc_precision, only: wp
  use hc_options, only: cycle_options_t
  implicit none
  private

  public :: turning_points, find_cycles, loop_area

contains

  !> Find the steps at which a quantity turns back, with the last one before it changes at all and its last extreme.
  pure function turning_points(values) result(turns)
    !> Values of the steps
    real(wp), intent(in) :: values(:)
    type(cycle_options_t) :: tuning
    integer, allocatable :: turns(:)
    real(wp) :: least, direction
    integer :: k, extreme

    allocate (turns(0))
    if (size(values) == 0) return
    least = tuning%noise*(maxval(values) - minval(values))
    direction = 0.0_wp
    extreme = 1
    do k = 2, size(values)
      associate (change => values(k) - values(merge(extreme, 1, direction**2 > 0.0_wp)))
        if (direction*change >= 0.0_wp .and. (direction**2 > 0.0_wp .or. abs(change) <= least)) then
          extreme = k
        else if (abs(change) > least) then
          turns = [turns, extreme]
          direction = sign(1.0_wp, change)
          extreme = k
        end if
      end associate
    end do
    if (size(turns) > 0) turns = [turns, extreme]
  end function turning_points

  !> Find the closed cycles of a load over its motion: from one turning point to the next but one, where either is back.
  pure subroutine find_cycles(motion, load, first, last)
    !> Values of the steps
    real(wp), intent(in) :: motion(:), load(:)
    !> First and last step of each cycle
    integer, allocatable, intent(out) :: first(:), last(:)
    type(cycle_options_t) :: tuning
    integer, allocatable :: turns(:)
    integer :: k

    allocate (turns, source=turning_points(motion))
    allocate (first(0), last(0))
    k = 1
    do while (k + 2 <= size(turns))
      if (is_back(motion(turns(k:k + 2)), tuning%closure) .or. (is_back(load(turns(k:k + 2)), tuning%closure) &
                                                                .and. is_back(motion(turns(k:k + 2)), tuning%drift))) then
        first = [first, turns(k)]
        last = [last, turns(k + 2)]
        k = k + 1
      end if
      k = k + 1
    end do
  end subroutine find_cycles

  !> Return whether a quantity comes back to where it was two turning points before.
  pure logical function is_back(turns, closure)
    !> Its values at three turning points
    real(wp), intent(in) :: turns(3)
    !> Share of their range that counts as nothing
    real(wp), intent(in) :: closure
    is_back = abs(turns(3) - turns(1)) < closure*abs(turns(2) - turns(1))
  end function is_back

  !> Compute the area of the loop of a load over its motion, closed by a straight line: the work of the load around it, (L3) [J].
  pure real(wp) function loop_area(motion, load)
    !> Displacement [m] or rotation [rad] of the steps of a cycle
    real(wp), intent(in) :: motion(:)
    !> Load [N] or torque [N m]
    real(wp), intent(in) :: load(:)
    loop_area = 0.5_wp*sum((load + cshift(load, 1))*(cshift(motion, 1) - motion))
  end function loop_area

end module hc_load_cycles
