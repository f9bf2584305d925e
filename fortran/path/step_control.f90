!> Size of the load steps of a segment: the change by one step is bounded.
!>
!> Each load step is solved as a whole and in two halves. Their difference (hc_step_error) decides whether the step is
!> accepted, and how large the next one is. Sizes are parts of a segment of the load history. With a `control`, the
!> change `change` of an attempt and the tolerance `tolerance`, a step is
!>
!>     attempt = control%first_attempt(fraction, largest)
!>     do
!>       ... solve from attempt%start to attempt%end ...
!>       call control%decide(attempt, converged, change, tolerance, verdict)
!>       if (verdict /= rejected) exit
!>     end do
!>     call control%accept(attempt, change, tolerance, verdict)
!>
!> Equations: docs/theory/step_control.md, (S2) to (S4).
module hc_step_control
  use hc_precision, only: wp
  use hc_options, only: step_options_t
  use hc_step_error, only: step_change_t
  implicit none
  private

  public :: step_control_t, step_attempt_t, rejected, accepted, limited, failed, outgrown, pending

  !> Verdict on an attempt: a smaller one follows; it is within the tolerance; it is not, but smaller ones are of no
  !> use; it did not converge, and is the smallest there is; it reached the rim of a window that grows; it is not solved to its end.
  integer, parameter :: rejected = 0, accepted = 1, limited = 2, failed = 3, outgrown = 4, pending = 5

  !> One attempt at a load step.
  type :: step_attempt_t
    !> Where it begins and ends
    real(wp) :: start = 0.0_wp, end = 1.0_wp
    !> Attempts before it
    integer :: n_rejected = 0
    !> Excess and size of the last one that converged; infinite if there is none
    real(wp) :: last_excess = huge(1.0_wp), last_size = huge(1.0_wp)
  end type step_attempt_t

  !> Control of the load steps.
  type :: step_control_t
    !> Size of the next load step
    real(wp) :: size = 1.0_wp
    !> That of the first load step of the present segment
    real(wp) :: first = 0.5_wp
    !> Changes of stick area and tractions at the end of the last load step
    real(wp) :: stick = 0.0_wp, traction = 0.0_wp
    !> The same as means over all steps, with decaying weights
    real(wp) :: past_stick = 0.0_wp, past_traction = 0.0_wp
    !> Sums over the steps: dissipated energy, and the part that is uncertain since tractions turn
    real(wp) :: spent = 0.0_wp, turned = 0.0_wp
    !> Tuning numbers
    type(step_options_t) :: options
  contains
    !> Return whether there is no smaller attempt
    procedure :: is_least
    !> Start a segment
    procedure :: start_segment
    !> The first attempt at a load step
    procedure :: first_attempt
    !> Verdict on an attempt; the next one, if it is rejected
    procedure :: decide
    !> Take over an attempt, and choose the size of the next load step
    procedure :: accept
    !> Bound on the error of the stick area
    procedure :: bound
    !> Bound on the error of the tractions
    procedure :: traction_bound
    procedure, private :: end_of_step, excess, growth
  end type step_control_t

contains

  !> Return whether there is no smaller load step.
  elemental logical function is_least(self, attempt)
    class(step_control_t), intent(in) :: self
    type(step_attempt_t), intent(in) :: attempt
    is_least = attempt%end - attempt%start <= self%options%least_step*(1.0_wp + self%options%size_rounding)
  end function is_least

  !> Start a segment: its first load step is about as large as that of the last segment.
  elemental subroutine start_segment(self)
    class(step_control_t), intent(inout) :: self
    self%size = self%options%most_growth*self%first
  end subroutine start_segment

  !> Return the first attempt at a load step.
  elemental type(step_attempt_t) function first_attempt(self, fraction, largest) result(attempt)
    class(step_control_t), intent(in) :: self
    !> Part of the segment that is done
    real(wp), intent(in) :: fraction
    !> Largest load step
    real(wp), intent(in) :: largest

    attempt%start = fraction
    attempt%end = self%end_of_step(fraction, min(self%size, largest))
  end function first_attempt

  !> Return where a load step of a given size ends: the last two are equally large.
  elemental real(wp) function end_of_step(self, fraction, size) result(end)
    class(step_control_t), intent(in) :: self
    !> Part of the segment that is done
    real(wp), intent(in) :: fraction
    !> Size of the step
    real(wp), intent(in) :: size

    associate (parts => (1.0_wp - fraction)/size - self%options%size_rounding)
      if (parts <= 1.0_wp) then
        end = 1.0_wp
      else if (parts <= 2.0_wp) then
        end = fraction + 0.5_wp*(1.0_wp - fraction)
      else
        end = fraction + size
      end if
    end associate
  end function end_of_step

  !> Judge an attempt.
  elemental subroutine decide(self, attempt, converged, change, tolerance, verdict)
    class(step_control_t), intent(in) :: self
    !> The attempt; if it is rejected, the next one
    type(step_attempt_t), intent(inout) :: attempt
    !> It was solved, as a whole and in halves
    logical, intent(in) :: converged
    !> Change by the halves; of no use if it was not solved
    type(step_change_t), intent(in) :: change
    !> Largest change by a step, over the largest contact area
    real(wp), intent(in) :: tolerance
    !> rejected, accepted, limited or failed
    integer, intent(out) :: verdict
    real(wp) :: over(3), next
    logical :: useless, inherited

    associate (size => attempt%end - attempt%start)
      if (.not. converged) then
        verdict = merge(failed, rejected, self%is_least(attempt))
        next = self%options%unsolved_retry*size
        attempt%last_excess = huge(1.0_wp)
      else
        over = self%excess(change, tolerance)
        inherited = abs(change%stick - self%stick) <= self%options%own_share*abs(change%stick)
        useless = self%is_least(attempt) .or. attempt%n_rejected + 1 >= self%options%max_attempts .or. &
                  (maxval(over) > self%options%useful_share*attempt%last_excess .and. &
                   size < self%options%largest_retry*attempt%last_size)
        verdict = rejected
        if (useless) verdict = limited
        if (maxval(over(2:)) <= 1.0_wp .and. (over(1) <= 1.0_wp .or. inherited)) verdict = accepted
        next = size*min(self%options%largest_retry, max(self%options%smallest_retry, self%growth(change, tolerance)))
        if (verdict == rejected) then
          attempt%last_excess = maxval(over)
          attempt%last_size = size
        end if
      end if
    end associate
    if (verdict /= rejected) return
    attempt%n_rejected = attempt%n_rejected + 1
    attempt%end = self%end_of_step(attempt%start, max(self%options%least_step, next))
  end subroutine decide

  !> Take over an attempt, and choose the size of the next load step.
  elemental subroutine accept(self, attempt, change, tolerance, verdict)
    class(step_control_t), intent(inout) :: self
    !> The attempt
    type(step_attempt_t), intent(in) :: attempt
    !> Change by its halves
    type(step_change_t), intent(in) :: change
    !> Largest change by a step, over the largest contact area
    real(wp), intent(in) :: tolerance
    !> accepted or limited
    integer, intent(in) :: verdict
    real(wp) :: factor, over(3)

    factor = self%growth(change, tolerance)
    over = self%excess(change, tolerance)
    if (verdict == limited) then
      factor = self%options%most_growth
    else if (over(1) > 1.0_wp) then  ! the change of the stick area is that of the steps before
      factor = max(1.0_wp, factor)
    else if (attempt%n_rejected > 0) then
      factor = min(1.0_wp, factor)
    end if
    associate (size => attempt%end - attempt%start)
      self%size = size*min(self%options%most_growth, max(self%options%least_growth, factor))
      if (attempt%start <= 0.0_wp) self%first = size
    end associate
    self%spent = self%spent + change%spent
    self%turned = self%turned + change%turned
    self%stick = change%stick
    self%traction = change%traction
    self%past_stick = max(abs(change%stick), self%options%stick_memory*self%past_stick)
    self%past_traction = max(change%traction, self%options%traction_memory*self%past_traction)
  end subroutine accept

  !> Bound on the error of the stick area after a load step, over the largest contact area.
  elemental real(wp) function bound(self, change)
    class(step_control_t), intent(in) :: self
    !> Change by its halves
    type(step_change_t), intent(in) :: change
    bound = self%options%stick_safety*self%past_stick + self%options%traction_safety*change%gain*self%past_traction + change%lattice
  end function bound

  !> Bound on the error of the shear tractions after a load step, over the friction limit; (S4).
  elemental real(wp) function traction_bound(self, tolerance)
    class(step_control_t), intent(in) :: self
    !> Largest change by a step
    real(wp), intent(in) :: tolerance
    traction_bound = 0.0_wp  ! without a history
    if (self%past_traction > 0.0_wp) traction_bound = tolerance + self%options%own_safety*self%past_traction
  end function traction_bound

  !> Compute the changes in a load step over their limits: of the stick area, of the tractions, and of their direction.
  !>
  !> Smaller steps cannot help against the rings of the lattice, nor against tractions that differ from before.
  pure function excess(self, change, tolerance)
    class(step_control_t), intent(in) :: self
    !> Change by its halves
    type(step_change_t), intent(in) :: change
    !> Largest change by a step, over the largest contact area
    real(wp), intent(in) :: tolerance
    real(wp) :: excess(3)

    excess = [self%options%stick_safety*abs(change%stick)/max(tolerance, change%lattice, self%options%stick_safety*self%traction), &
              change%added/(self%options%added_share*tolerance), 0.0_wp]
    ! the energy of the step, or that of all steps, is accurate to the tolerance
    if (change%turned > 0.0_wp) excess(3) = min(change%turned/change%spent, &
                                                (self%turned + change%turned)/(self%spent + change%spent))/tolerance
  end function excess

  !> Estimate the factor by which a larger step would have changed the stick area and the direction of tractions, with the size, and
  !> the tractions, with its square.
  pure real(wp) function growth(self, change, tolerance)
    class(step_control_t), intent(in) :: self
    !> Change by its halves
    type(step_change_t), intent(in) :: change
    !> Largest change by a step, over the largest contact area
    real(wp), intent(in) :: tolerance

    associate (over => max(self%excess(change, tolerance), self%options%least_excess))
      growth = min(self%options%aim/over(1), self%options%aim/sqrt(over(2)), self%options%aim/over(3))
    end associate
  end function growth

end module hc_step_control
