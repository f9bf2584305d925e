!> A path through a load history in adaptive load steps.
!>
!> Each load step is solved as a whole and in two halves, on two paths that never meet; the one in halves is the
!> solution. A segment of the history leads from the loads and motions at its beginning straight to a target:
!>
!>     call path%initialize(state, largest_contact_area)
!>     do segment = 1, n
!>       do
!>         call path%advance(solver, target(segment), step_tolerance, tolerance, max_sweeps, max_cuts, error)
!>         if (allocated(error) .or. .not. path%state%converged .or. path%fraction >= 1) exit
!>       end do
!>     end do
!>
!> Equations: docs/theory/step_control.md, (S1) to (S4).
module hc_adaptive_path
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_contact_state, only: contact_state_t, load_target_t, force_control, n_motion, rim_reached, separated
  use hc_contact_solver, only: friction_solver_t
  use hc_contact_edges, only: contact_edges_t, new_contact_edges
  use hc_zone_edge, only: zone_edge_t
  use hc_load_path, only: advance, join_steps
  use hc_step_control, only: step_attempt_t, step_control_t, failed, limited, rejected
  use hc_step_error, only: compare_halves, shear_free, step_change_t
  implicit none
  private

  public :: adaptive_path_t

  !> The two paths, and the control of their load steps.
  type :: adaptive_path_t
    !> End of the last load step; its slip is that of both halves, and its R_t is of this slip
    type(contact_state_t) :: state
    !> Part of the present segment that is done
    real(wp) :: fraction = 1.0_wp
    !> Bound on the error of the stick area by the size of all load steps [m^2]
    real(wp) :: stick_area_error = 0.0_wp
    !> The same of the shear tractions, over what friction can carry
    real(wp) :: traction_error = 0.0_wp
    !> What the halves of the last load step changed
    type(step_change_t) :: change
    !> Attempts at the last load step that were rejected
    integer :: n_rejected = 0
    !> The last load step changes more than the tolerance, and smaller ones are of no use
    logical :: limited = .false.
    type(step_control_t), private :: control
    !> End of the path in whole steps; the same as `state` where they are one
    type(contact_state_t), private :: whole
    logical, private :: one_path = .true.
    !> Largest contact area of the history [m^2]
    real(wp), private :: area = 0.0_wp
    !> Loads and motions at the beginning of the segment
    real(wp), private :: load(n_motion) = 0.0_wp, motion(n_motion) = 0.0_wp
  contains
    !> Start a load history
    procedure :: initialize
    !> Advance by one load step
    procedure :: advance => advance_step
    procedure, private :: solve_attempt, solve_part
  end type adaptive_path_t

contains

  !> Start a load history.
  subroutine initialize(self, state, area)
    class(adaptive_path_t), intent(out) :: self
    !> Where it begins; new_friction_state gives the state before the first load
    type(contact_state_t), intent(in) :: state
    !> Largest contact area of the history, which changes are compared with; an estimate will do [m^2]
    real(wp), intent(in) :: area

    self%state = state
    self%whole = state
    self%area = area
  end subroutine initialize

  !> Advance by one load step towards the end of a segment; after its end a new one begins.
  subroutine advance_step(self, solver, target, step_tolerance, tolerance, max_sweeps, max_cuts, error, largest)
    class(adaptive_path_t), intent(inout) :: self
    !> Method
    class(friction_solver_t), intent(inout) :: solver
    !> Loads or motions at the end of the segment
    type(load_target_t), intent(in) :: target
    !> What a load step may change, over the largest contact area
    real(wp), intent(in) :: step_tolerance
    !> Bound of all residuals
    real(wp), intent(in) :: tolerance
    !> Active sets that may be tried, times that a part of a step may be halved
    integer, intent(in) :: max_sweeps, max_cuts
    !> Allocated on failure. No failure: `state` is not converged, and says why, if the smallest step does not converge or
    !> the contact reaches the rim of the window; the path ends there.
    type(error_t), allocatable, intent(out) :: error
    !> Largest load step, as a part of the segment
    real(wp), intent(in), optional :: largest
    type(contact_state_t) :: whole, halves
    type(contact_edges_t) :: edges
    type(zone_edge_t) :: edge
    type(step_attempt_t) :: attempt
    real(wp) :: most, work
    logical :: one_path
    integer :: verdict

    most = 1.0_wp
    if (present(largest)) most = largest
    if (.not. (step_tolerance > 0.0_wp .and. most > 0.0_wp)) then
      call raise(error, status%invalid_input, 'tolerance and largest size of load steps: numbers above 0 expected')
      return
    end if
    self%control%options = solver%problem%options%steps
    if (self%fraction >= 1.0_wp) then
      self%fraction = 0.0_wp
      self%load = self%state%load
      self%motion = self%state%motion
      call self%control%start_segment()
    end if
    self%area = max(self%area, solver%problem%lattice%cell_area())

    attempt = self%control%first_attempt(self%fraction, most)
    work = 0.0_wp
    do
      call self%solve_attempt(solver, target, attempt, tolerance, max_sweeps, max_cuts, whole, halves, one_path, error)
      if (allocated(error)) return
      work = work + halves%operator_applications
      call self%control%decide(attempt, halves%converged, self%change, step_tolerance, verdict)
      if (halves%stopped == rim_reached) verdict = failed
      if (verdict /= rejected) exit
    end do
    halves%operator_applications = work
    self%state = halves
    self%n_rejected = attempt%n_rejected
    self%limited = verdict == limited
    if (verdict == failed) return
    self%whole = whole
    self%one_path = one_path
    self%fraction = attempt%end
    call self%control%accept(attempt, self%change, step_tolerance, verdict)
    associate (problem => solver%problem)
      call new_contact_edges(edges, problem%lattice, halves%pressure, halves%gap, halves%zone /= separated, problem%candidate, &
                             problem%options%edges)
    end associate
    edge = edges%contact_edge()
    self%area = max(self%area, edge%area)
    self%stick_area_error = min(self%control%bound(self%change)*self%area, edge%area)
    self%traction_error = self%control%traction_bound(step_tolerance)
  end subroutine advance_step

  !> Solve a load step as a whole and in halves, and compare them.
  subroutine solve_attempt(self, solver, target, attempt, tolerance, max_sweeps, max_cuts, whole, halves, one_path, error)
    class(adaptive_path_t), intent(inout) :: self
    !> Method
    class(friction_solver_t), intent(inout) :: solver
    !> Loads or motions at the end of the segment
    type(load_target_t), intent(in) :: target
    !> Where the step begins and ends
    type(step_attempt_t), intent(in) :: attempt
    !> Bound of all residuals
    real(wp), intent(in) :: tolerance
    !> Active sets that may be tried, times that a part of a step may be halved
    integer, intent(in) :: max_sweeps, max_cuts
    !> End of both paths, the second one with the slip of both halves and the work of all; not converged: the part that failed
    type(contact_state_t), intent(out) :: whole, halves
    !> Both are the same: without shear there is no history
    logical, intent(out) :: one_path
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    type(contact_state_t) :: half
    real(wp) :: work

    call self%solve_part(solver, self%whole, target, attempt%end, tolerance, max_sweeps, max_cuts, whole, error)
    one_path = .false.
    if (allocated(error)) return
    halves = whole
    if (.not. whole%converged) return
    self%change = step_change_t()
    associate (space => solver%problem%space, options => self%control%options)
      if (self%one_path) one_path = shear_free(self%state, space, options)
      if (one_path) one_path = shear_free(whole, space, options)
    end associate
    if (one_path) return
    work = whole%operator_applications
    call self%solve_part(solver, self%state, target, 0.5_wp*(attempt%start + attempt%end), tolerance, max_sweeps, max_cuts, &
                         half, error)
    if (allocated(error)) return
    work = work + half%operator_applications
    halves = half
    if (half%converged) then
      call self%solve_part(solver, half, target, attempt%end, tolerance, max_sweeps, max_cuts, halves, error)
      if (allocated(error)) return
      work = work + halves%operator_applications
    end if
    halves%operator_applications = work
    if (.not. halves%converged) return
    call join_steps(solver%problem, half, halves)
    associate (problem => solver%problem)
      call compare_halves(problem%lattice, problem%candidate, problem%friction, whole, half, halves, self%whole, self%state, &
                          self%area, self%change, problem%space, problem%options)
    end associate
  end subroutine solve_attempt

  !> Advance a state to a part of a segment.
  subroutine solve_part(self, solver, state, target, fraction, tolerance, max_sweeps, max_cuts, next, error)
    class(adaptive_path_t), intent(in) :: self
    !> Method
    class(friction_solver_t), intent(inout) :: solver
    !> State to go on from
    type(contact_state_t), intent(in) :: state
    !> Loads or motions at the end of the segment
    type(load_target_t), intent(in) :: target
    !> Part of the segment that is done then
    real(wp), intent(in) :: fraction
    !> Bound of all residuals
    real(wp), intent(in) :: tolerance
    !> Active sets that may be tried, times that the step may be halved
    integer, intent(in) :: max_sweeps, max_cuts
    !> The new state
    type(contact_state_t), intent(out) :: next
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    type(load_target_t) :: goal

    goal = target
    associate (start => merge(self%load, self%motion, target%control == force_control))
      if (fraction < 1.0_wp) goal%value = start + fraction*(target%value - start)
    end associate
    call advance(solver, state, goal, .false., tolerance, max_sweeps, max_cuts, next, error)
  end subroutine solve_part

end module hc_adaptive_path
