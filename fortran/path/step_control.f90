!> Size of the load steps of a segment: what one may change is bounded.
!>
!> Each load step is solved as a whole and in two halves. What they change (hc_step_error) decides whether the step is
!> accepted, and how large the next one is. Sizes are parts of a segment of the load history. With a `control`, the
!> change `change` of an attempt and the tolerance `tolerance`, a step is
!>
!>     attempt = control%first_attempt(fraction, largest)
!>     do
!>       ... solve from attempt%begin to attempt%end ...
!>       call control%judge(attempt, converged, change, tolerance, verdict)
!>       if (verdict /= rejected) exit
!>     end do
!>     call control%accept(attempt, change, tolerance, verdict)
!>
!> Equations: docs/theory/step_control.md, (S2), (S3).
module hc_step_control
  use hc_precision, only: wp
  use hc_step_error, only: step_change_t
  implicit none
  private

  public :: step_control_t, step_attempt_t, least_step, rejected, accepted, limited, failed

  !> What becomes of an attempt: a smaller one follows; it is within the tolerance; it is not, but smaller ones are of no
  !> use; it did not converge, and is the smallest there is.
  integer, parameter :: rejected = 0, accepted = 1, limited = 2, failed = 3

  !> Smallest load step.
  real(wp), parameter :: least_step = 1.0e-3_wp
  !> Most attempts at one load step.
  integer, parameter :: most_attempts = 6
  !> Largest and smallest growth from one load step to the next.
  real(wp), parameter :: most_growth = 2.0_wp, least_growth = 0.3_wp
  !> Smallest and largest size of an attempt over that of the one before.
  real(wp), parameter :: most_shrinkage = 0.1_wp, least_shrinkage = 0.6_wp
  !> The same after an attempt that did not converge.
  real(wp), parameter :: not_converged = 0.25_wp
  !> Part of what is allowed that a step is meant to change.
  real(wp), parameter :: aim = 0.8_wp
  !> Part of the tolerance by which one step may add to the change of the tractions.
  real(wp), parameter :: budget = 0.5_wp
  !> Part of a change of the stick area from which on it is that of the step itself.
  real(wp), parameter :: own_part = 0.25_wp
  !> A smaller step that leaves more than this part of the excess was of no use.
  real(wp), parameter :: helpful = 0.8_wp
  !> Least excess, where a factor is found from it.
  real(wp), parameter :: least_excess = 1.0e-9_wp
  !> Rounding errors of sizes.
  real(wp), parameter :: rounding = 1.0e-9_wp
  !> Factors from changes to the bound: of the stick area; of the tractions, times what they are worth in stick area.
  real(wp), parameter :: stick_safety = 2.0_wp, traction_safety = 1.5_wp
  !> Part of a change that is still there after the next load step: errors do not vanish at once where a change is zero.
  real(wp), parameter :: stick_memory = 0.5_wp, traction_memory = 0.8_wp

  !> One attempt at a load step.
  type :: step_attempt_t
    !> Where it begins and ends
    real(wp) :: begin = 0.0_wp, end = 1.0_wp
    !> Attempts before it
    integer :: n_rejected = 0
    !> Excess and size of the last one that converged; infinite if there is none
    real(wp) :: last_excess = huge(1.0_wp), last_size = huge(1.0_wp)
  contains
    !> There is no smaller one
    procedure :: is_least
  end type step_attempt_t

  !> What decides about load steps.
  type :: step_control_t
    !> Size of the next load step
    real(wp) :: size = 1.0_wp
    !> That of the first load step of the present segment
    real(wp) :: first = 0.5_wp
    !> Changes of stick area and tractions at the end of the last load step
    real(wp) :: stick = 0.0_wp, traction = 0.0_wp
    !> Those of all steps, fading
    real(wp) :: past_stick = 0.0_wp, past_traction = 0.0_wp
  contains
    !> Begin a segment
    procedure :: begin_segment
    !> The first attempt at a load step
    procedure :: first_attempt
    !> What becomes of an attempt; the next one, if it is rejected
    procedure :: judge
    !> Take over an attempt, and choose the size of the next load step
    procedure :: accept
    !> Bound on the error of the stick area
    procedure :: bound
    procedure, private :: excess, growth
  end type step_control_t

contains

  !> There is no smaller load step.
  elemental logical function is_least(self)
    class(step_attempt_t), intent(in) :: self
    is_least = self%end - self%begin <= least_step*(1.0_wp + rounding)
  end function is_least

  !> Begin a segment: its first load step is about as large as that of the last segment.
  elemental subroutine begin_segment(self)
    class(step_control_t), intent(inout) :: self
    self%size = most_growth*self%first
  end subroutine begin_segment

  !> The first attempt at a load step.
  elemental type(step_attempt_t) function first_attempt(self, fraction, largest) result(attempt)
    class(step_control_t), intent(in) :: self
    !> Part of the segment that is done
    real(wp), intent(in) :: fraction
    !> Largest load step
    real(wp), intent(in) :: largest

    attempt%begin = fraction
    attempt%end = end_of_step(fraction, min(self%size, largest))
  end function first_attempt

  !> Where a load step of a given size ends: the last two are equally large.
  elemental real(wp) function end_of_step(fraction, size) result(end)
    !> Part of the segment that is done
    real(wp), intent(in) :: fraction
    !> Size of the step
    real(wp), intent(in) :: size

    associate (parts => (1.0_wp - fraction)/size - rounding)
      if (parts <= 1.0_wp) then
        end = 1.0_wp
      else if (parts <= 2.0_wp) then
        end = fraction + 0.5_wp*(1.0_wp - fraction)
      else
        end = fraction + size
      end if
    end associate
  end function end_of_step

  !> Decide what becomes of an attempt.
  elemental subroutine judge(self, attempt, converged, change, tolerance, verdict)
    class(step_control_t), intent(in) :: self
    !> The attempt; if it is rejected, the next one
    type(step_attempt_t), intent(inout) :: attempt
    !> It was solved, as a whole and in halves
    logical, intent(in) :: converged
    !> What the halves change; of no use if it was not solved
    type(step_change_t), intent(in) :: change
    !> What a step may change, over the largest contact area
    real(wp), intent(in) :: tolerance
    !> rejected, accepted, limited or failed
    integer, intent(out) :: verdict
    real(wp) :: over(2), next
    logical :: useless, inherited

    associate (size => attempt%end - attempt%begin)
      if (.not. converged) then
        verdict = merge(failed, rejected, attempt%is_least())
        next = not_converged*size
        attempt%last_excess = huge(1.0_wp)
      else
        over = self%excess(change, tolerance)
        inherited = abs(change%stick - self%stick) <= own_part*abs(change%stick)
        useless = attempt%is_least() .or. attempt%n_rejected + 1 >= most_attempts .or. &
                  (maxval(over) > helpful*attempt%last_excess .and. size < least_shrinkage*attempt%last_size)
        verdict = rejected
        if (useless) verdict = limited
        if (over(2) <= 1.0_wp .and. (over(1) <= 1.0_wp .or. inherited)) verdict = accepted
        next = size*min(least_shrinkage, max(most_shrinkage, self%growth(change, tolerance)))
        if (verdict == rejected) then
          attempt%last_excess = maxval(over)
          attempt%last_size = size
        end if
      end if
    end associate
    if (verdict /= rejected) return
    attempt%n_rejected = attempt%n_rejected + 1
    attempt%end = end_of_step(attempt%begin, max(least_step, next))
  end subroutine judge

  !> Take over an attempt, and choose the size of the next load step.
  elemental subroutine accept(self, attempt, change, tolerance, verdict)
    class(step_control_t), intent(inout) :: self
    !> The attempt
    type(step_attempt_t), intent(in) :: attempt
    !> What its halves change
    type(step_change_t), intent(in) :: change
    !> What a step may change, over the largest contact area
    real(wp), intent(in) :: tolerance
    !> accepted or limited
    integer, intent(in) :: verdict
    real(wp) :: factor, over(2)

    factor = self%growth(change, tolerance)
    over = self%excess(change, tolerance)
    if (verdict == limited) then
      factor = most_growth
    else if (over(1) > 1.0_wp) then  ! the change of the stick area is that of the steps before
      factor = max(1.0_wp, factor)
    else if (attempt%n_rejected > 0) then
      factor = min(1.0_wp, factor)
    end if
    associate (size => attempt%end - attempt%begin)
      self%size = size*min(most_growth, max(least_growth, factor))
      if (attempt%begin <= 0.0_wp) self%first = size
    end associate
    self%stick = change%stick
    self%traction = change%traction
    self%past_stick = max(abs(change%stick), stick_memory*self%past_stick)
    self%past_traction = max(change%traction, traction_memory*self%past_traction)
  end subroutine accept

  !> Bound on the error of the stick area after a load step, over the largest contact area.
  elemental real(wp) function bound(self, change)
    class(step_control_t), intent(in) :: self
    !> What its halves changed
    type(step_change_t), intent(in) :: change
    bound = stick_safety*self%past_stick + traction_safety*change%gain*self%past_traction + change%lattice
  end function bound

  !> What a load step changes over what it may, of the stick area and of the tractions.
  !>
  !> Smaller steps cannot help against the rings of the lattice, nor against tractions that differ from before.
  pure function excess(self, change, tolerance)
    class(step_control_t), intent(in) :: self
    !> What its halves change
    type(step_change_t), intent(in) :: change
    !> What a step may change, over the largest contact area
    real(wp), intent(in) :: tolerance
    real(wp) :: excess(2)

    excess = [stick_safety*abs(change%stick)/max(tolerance, change%lattice, stick_safety*self%traction), &
              change%added/(budget*tolerance)]
  end function excess

  !> How much larger a step would have changed what is aimed at: the stick area with the size, tractions with its square.
  pure real(wp) function growth(self, change, tolerance)
    class(step_control_t), intent(in) :: self
    !> What its halves change
    type(step_change_t), intent(in) :: change
    !> What a step may change, over the largest contact area
    real(wp), intent(in) :: tolerance

    associate (over => max(self%excess(change, tolerance), least_excess))
      growth = min(aim/over(1), aim/sqrt(over(2)))
    end associate
  end function growth

end module hc_step_control
