!> A path through a load history in adaptive load steps.
!>
!> Each load step is solved as a whole and in two halves, on two paths that never meet; the one in halves is the
!> solution. A segment of the history leads from the loads and motions at its beginning straight to a target:
!>
!>     call path%initialize(state, largest_contact_area)
!>     do segment = 1, n
!>       do
!>         call path%advance(solver, target(segment), settings, error)
!>         if (allocated(error) .or. .not. path%state%converged .or. path%fraction >= 1) exit
!>       end do
!>     end do
!>
!> A program with loads of another kind, or with a window that grows, makes the attempts itself:
!>
!>     call steps%begin(largest)
!>     do
!>       call steps%attempt_step(solver, [target half-way, target at the end], settings, before, after, error)
!>       if (allocated(error) .or. steps%verdict /= rejected) exit
!>     end do
!>
!> Equations: docs/theory/step_control.md, (S1) to (S4).
module hc_adaptive_path
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_lattice, only: lattice_t
  use hc_contact_state, only: contact_state_t, load_target_t, rim_reached, separated
  use hc_contact_solver, only: friction_solver_t
  use hc_contact_problem, only: friction_problem_t
  use hc_edges_by_rows, only: edges_by_rows_t
  use hc_zone_edge, only: zone_edge_t
  use hc_load_path, only: advance, between, join_steps, step_settings_t
  use hc_step_control, only: step_attempt_t, step_control_t, failed, limited, outgrown, rejected
  use hc_window_growth, only: extend_state, grown_window
  use hc_step_error, only: compare_halves, edges_of, shear_free, step_change_t
  implicit none
  private

  public :: adaptive_path_t, adaptive_steps_t, two_paths_t

  !> Ends of the two paths.
  type :: two_paths_t
    !> That of the path in halves; the slip of its last load step is that of both halves, and its R_t is of this slip
    type(contact_state_t), pointer :: halves => null()
    !> That of the path in whole steps; none: both paths are one
    type(contact_state_t), pointer :: whole => null()
  contains
    !> End of the path in whole steps
    procedure :: end_of_whole
    !> Free both
    procedure :: free
  end type two_paths_t

  !> Choice of the load steps.
  type :: adaptive_steps_t
    !> Largest change by a load step, over the largest contact area
    real(wp) :: tolerance = 0.02_wp
    !> The window grows: an attempt that reaches its rim is made again on a larger one
    logical :: grows = .false.
    !> Part of the present segment that is done
    real(wp) :: fraction = 1.0_wp
    !> Largest contact area of the history [m^2]
    real(wp) :: area = 0.0_wp
    !> Size of the steps
    type(step_control_t) :: control
    !> Present attempt, and its verdict: accepted, rejected (the next one follows), limited, failed or outgrown
    type(step_attempt_t) :: attempt
    integer :: verdict = rejected
    !> Part of the segment where the last solution ends
    real(wp) :: reached = 0.0_wp
    !> Window that an outgrown attempt needs
    type(lattice_t) :: larger
    !> Change by the halves of the last load step
    type(step_change_t) :: change
    !> Bounds on the errors by the size of all load steps: of the stick area [m^2], of the shear tractions over the
    !> friction limit
    real(wp) :: stick_area_error = 0.0_wp, traction_error = 0.0_wp
    !> Work of all attempts at the load step
    integer :: sweeps = 0
    real(wp) :: operator_applications = 0.0_wp
  contains
    !> Begin a load step
    procedure :: begin
    !> Parts of the segment where the present attempt has its middle and its end
    procedure :: parts
    !> Make an attempt
    procedure :: attempt_step
    !> Go on after a load step of given size
    procedure :: forget
    procedure, private :: solve_halves, solve_part, accept
  end type adaptive_steps_t

  !> The two paths, and the choice of their load steps.
  type, extends(adaptive_steps_t) :: adaptive_path_t
    !> End of the last load step; its slip is that of both halves, and its R_t is of this slip
    type(contact_state_t) :: state
    !> Attempts at the last load step that were rejected
    integer :: n_rejected = 0
    !> The last load step changes more than the tolerance, and smaller ones are of no use
    logical :: limited = .false.
    !> End of the path in whole steps, unless both are one
    type(contact_state_t), allocatable, private :: whole
    !> Loads and motions at the beginning of the segment
    type(contact_state_t), private :: begun
  contains
    !> Start a load history
    procedure :: initialize
    !> Advance by one load step
    procedure :: advance => advance_path
    !> Go on with the solver of a larger window
    procedure :: carry
  end type adaptive_path_t

contains

  !> Return the end of the path in whole steps.
  function end_of_whole(self) result(state)
    class(two_paths_t), intent(in) :: self
    type(contact_state_t), pointer :: state

    state => self%whole
    if (.not. associated(state)) state => self%halves
  end function end_of_whole

  !> Free both ends.
  subroutine free(self)
    class(two_paths_t), intent(inout) :: self

    if (associated(self%halves)) deallocate (self%halves)
    if (associated(self%whole)) deallocate (self%whole)
  end subroutine free

  !> Begin a load step; at the beginning of a segment its size follows from the segment before.
  pure subroutine begin(self, largest)
    class(adaptive_steps_t), intent(inout) :: self
    !> Largest load step, as a part of the segment
    real(wp), intent(in) :: largest

    if (self%fraction >= 1.0_wp) self%fraction = 0.0_wp
    if (self%fraction <= 0.0_wp) call self%control%start_segment()
    self%attempt = self%control%first_attempt(self%fraction, largest)
    self%verdict = rejected
    self%sweeps = 0
    self%operator_applications = 0.0_wp
  end subroutine begin

  !> Return the parts of the segment where the present attempt has its middle and its end.
  pure function parts(self)
    class(adaptive_steps_t), intent(in) :: self
    real(wp) :: parts(2)
    parts = [0.5_wp*(self%attempt%start + self%attempt%end), self%attempt%end]
  end function parts

  !> Continue after a load step of given size: both paths coincide, and there are no earlier changes.
  pure subroutine forget(self)
    class(adaptive_steps_t), intent(inout) :: self
    type(step_control_t) :: control

    control%size = self%control%size
    control%first = self%control%first
    control%options = self%control%options
    self%control = control
  end subroutine forget

  !> Make the present attempt at a load step, and judge it.
  subroutine attempt_step(self, solver, targets, settings, before, after, error)
    class(adaptive_steps_t), intent(inout) :: self
    !> Method
    class(friction_solver_t), intent(inout) :: solver
    !> Loads or motions in the middle and at the end of the attempt, `parts`
    type(load_target_t), intent(in) :: targets(2)
    !> How its parts are solved
    type(step_settings_t), intent(in) :: settings
    !> Ends of the paths before the load step
    type(two_paths_t), intent(in) :: before
    !> Ends after it. Unless the step is accepted or limited, the end of the path in halves is the last solution, which did not
    !> converge, or reached the rim.
    type(two_paths_t), intent(out) :: after
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    logical :: converged

    self%control%options = solver%problem%options%steps
    self%area = max(self%area, solver%problem%lattice%cell_area())
    self%verdict = rejected
    call self%solve_halves(solver, targets, settings, before, after, error)
    if (allocated(error)) then
      call after%free()
    else if (self%verdict /= outgrown) then
      converged = after%halves%converged
      call self%control%decide(self%attempt, converged, self%change, self%tolerance, self%verdict)
      ! a window that does not grow ends the path
      if (.not. self%grows .and. after%halves%stopped == rim_reached) self%verdict = failed
    end if
    if (allocated(error)) return
    if (any(self%verdict == [outgrown, rejected, failed])) then
      if (associated(after%whole)) deallocate (after%whole)
    else
      call self%accept(solver%problem, after%halves)
    end if
  end subroutine attempt_step

  !> Solve a load step as a whole and in halves, and compare them; the last solution is that where one fails.
  subroutine solve_halves(self, solver, targets, settings, before, after, error)
    class(adaptive_steps_t), intent(inout) :: self
    !> Method
    class(friction_solver_t), intent(inout) :: solver
    !> Loads or motions in the middle and at the end
    type(load_target_t), intent(in) :: targets(2)
    !> How the parts are solved
    type(step_settings_t), intent(in) :: settings
    !> Ends of the paths before the load step, and after it
    type(two_paths_t), intent(in) :: before
    type(two_paths_t), intent(inout) :: after
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    type(contact_state_t), pointer :: whole_before, half
    real(wp) :: ends(2)
    logical :: solved

    self%change = step_change_t()
    ends = self%parts()
    self%reached = ends(2)
    whole_before => before%end_of_whole()
    call self%solve_part(solver, whole_before, targets(2), settings, after%halves, solved, error)
    if (.not. solved) return
    if (.not. associated(before%whole)) then
      associate (space => solver%problem%space, options => self%control%options)
        solved = shear_free(before%halves, space, options)
        if (solved) solved = shear_free(after%halves, space, options)
      end associate
      ! without shear there is no history
      if (solved) return
    end if
    after%whole => after%halves
    self%reached = ends(1)
    call self%solve_part(solver, before%halves, targets(1), settings, after%halves, solved, error)
    if (.not. solved) return
    half => after%halves
    self%reached = ends(2)
    call self%solve_part(solver, half, targets(2), settings, after%halves, solved, error)
    if (solved) then
      call join_steps(solver%problem, half, after%halves)
      call compare_halves(solver%problem, after%whole, half, after%halves, whole_before, before%halves, self%area, self%change)
    end if
    deallocate (half)
  end subroutine solve_halves

  !> Solve a part of a load step.
  subroutine solve_part(self, solver, state, target, settings, next, solved, error)
    class(adaptive_steps_t), intent(inout) :: self
    !> Method
    class(friction_solver_t), intent(inout) :: solver
    !> Initial state
    type(contact_state_t), intent(in) :: state
    !> Loads or motions at its end
    type(load_target_t), intent(in) :: target
    !> How it is solved
    type(step_settings_t), intent(in) :: settings
    !> The new state
    type(contact_state_t), pointer, intent(out) :: next
    !> It converged, and the window is large enough
    logical, intent(out) :: solved
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    allocate (next)
    call advance(solver, state, target, settings, next, error)
    solved = .not. allocated(error)
    if (.not. solved) return
    self%sweeps = self%sweeps + next%sweeps
    self%operator_applications = self%operator_applications + next%operator_applications
    if (self%grows .and. next%clipped) then
      self%verdict = outgrown
      self%larger = grown_window(solver%problem%lattice, next%zone /= separated, solver%problem%space)
    end if
    solved = next%converged .and. self%verdict /= outgrown
  end subroutine solve_part

  !> Take over an attempt, with the work of all attempts, and bound the errors by the size of the load steps.
  subroutine accept(self, problem, state)
    class(adaptive_steps_t), intent(inout) :: self
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> End of the load step
    type(contact_state_t), intent(inout) :: state
    type(edges_by_rows_t) :: edges
    type(zone_edge_t) :: edge

    state%sweeps = self%sweeps
    state%operator_applications = self%operator_applications
    self%fraction = self%attempt%end
    call self%control%accept(self%attempt, self%change, self%tolerance, self%verdict)
    call edges_of(problem, state, edges)
    edge = edges%contact_edge()
    self%area = max(self%area, edge%area)
    self%stick_area_error = min(self%control%bound(self%change)*self%area, edge%area)
    self%traction_error = self%control%traction_bound(self%tolerance)
  end subroutine accept

  !> Start a load history.
  subroutine initialize(self, state, area)
    class(adaptive_path_t), intent(out) :: self
    !> Where it begins; new_friction_state gives the state before the first load
    type(contact_state_t), intent(in) :: state
    !> Largest contact area of the history, which changes are compared with; an estimate will do [m^2]
    real(wp), intent(in) :: area

    self%state = state
    self%area = area
  end subroutine initialize

  !> Advance by one load step towards the end of a segment; after its end a new one begins.
  subroutine advance_path(self, solver, target, settings, error, largest)
    class(adaptive_path_t), intent(inout), target :: self
    !> Method
    class(friction_solver_t), intent(inout) :: solver
    !> Loads or motions at the end of the segment
    type(load_target_t), intent(in) :: target
    !> How the parts of the load step are solved
    type(step_settings_t), intent(in) :: settings
    !> Allocated on failure. No failure: `state` is not converged, and says why, if the smallest step does not converge or
    !> the contact reaches the rim of a window that does not grow; the path ends there. If one that grows is too small
    !> the verdict is `outgrown`, and `state` that before the step, which goes on after `carry` to the window `larger`.
    type(error_t), allocatable, intent(out) :: error
    !> Largest load step, as a part of the segment
    real(wp), intent(in), optional :: largest
    type(two_paths_t) :: before, after
    real(wp) :: most, parts(2)

    most = 1.0_wp
    if (present(largest)) most = largest
    if (.not. (self%tolerance > 0.0_wp .and. most > 0.0_wp)) then
      call raise(error, status%invalid_input, 'tolerance and largest size of load steps: numbers above 0 expected')
      return
    end if
    if (self%fraction >= 1.0_wp) then
      self%begun%load = self%state%load
      self%begun%motion = self%state%motion
    end if
    if (self%verdict /= outgrown) call self%begin(most)
    before%halves => self%state
    if (allocated(self%whole)) before%whole => self%whole
    do
      parts = self%parts()
      call self%attempt_step(solver, [between(self%begun, target, parts(1)), between(self%begun, target, parts(2))], settings, &
                             before, after, error)
      if (allocated(error)) return
      if (self%verdict /= rejected) exit
      call after%free()
    end do
    if (self%verdict == outgrown) then
      call after%free()
      return
    end if
    self%state = after%halves
    self%n_rejected = self%attempt%n_rejected
    self%limited = self%verdict == limited
    if (self%verdict /= failed .and. allocated(self%whole)) deallocate (self%whole)
    if (associated(after%whole)) allocate (self%whole, source=after%whole)
    call after%free()
  end subroutine advance_path

  !> Go on with the solver of a larger window, at the present attempt.
  subroutine carry(self, solver, lattice, error)
    class(adaptive_path_t), intent(inout) :: self
    !> Method on the larger window
    class(friction_solver_t), intent(inout) :: solver
    !> The smaller window
    type(lattice_t), intent(in) :: lattice
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    type(contact_state_t) :: extended

    if (allocated(self%whole)) then
      call extend_state(solver, lattice, self%whole, extended, error)
      if (allocated(error)) return
      self%whole = extended
    end if
    call extend_state(solver, lattice, self%state, extended, error)
    if (.not. allocated(error)) self%state = extended
  end subroutine carry

end module hc_adaptive_path
