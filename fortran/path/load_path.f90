!> From one load to the next.
!>
!> A load step that does not converge is cut in half, again and again up to a
!> bound; a state is only taken over when it has converged. In an incremental
!> path every part starts from the relative displacement that the last one left; the slip
!> increment that is recorded is that of all parts, and the residual of the friction conditions is that of this
!> record, so that it shows how far the parts are from one implicit step.
!> A static load is applied at once: parts only serve as starts, and the relative
!> displacement counts from the undeformed bodies. So it is tried with a step that begins without contact, which no
!> path precedes: it is the same problem as a static load.
!>
!> Theory: docs/theory/load_path.md.
module hc_load_path
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_contact_state, only: contact_state_t, load_target_t, check_state, check_target, force_control, rim_reached, &
                              separated, slip, stick
  use hc_contact_residuals, only: tangential_residual
  use hc_friction_law, only: friction_law_t
  use hc_rolling, only: rolling_t
  use hc_step_error, only: turned_part
  use hc_contact_problem, only: friction_problem_t
  use hc_contact_solver, only: friction_solver_t
  use hc_contact_entry, only: solve_with_entry
  use hc_few_nodes, only: solve_step
  use hc_rolled_step, only: check_rolling, begin_rolling, add_rolled_slip
  implicit none
  private

  public :: step_settings_t, advance, join_steps, between

  !> How a load step is solved.
  type :: step_settings_t
    !> Bound of all residuals
    real(wp) :: tolerance = 1.0e-8_wp
    !> Active sets that may be tried
    integer :: max_sweeps = 40
    !> Times that a step may be halved
    integer :: max_cuts = 6
    !> The load is applied to the undeformed bodies at once
    logical :: static = .false.
    !> Slip of a node that enters counts from where it stood when its gap closed, not from the beginning of the step
    logical :: interpolated = .false.
  end type step_settings_t

  !> The way through the parts of a load step.
  type :: way_t
    !> Part of the step that is done, and size of the next one
    real(wp) :: done = 0.0_wp, part = 1.0_wp
    !> Work so far, in applications of the full operator
    real(wp) :: work = 0.0_wp
    !> Times that the step was halved; active sets that were tried
    integer :: cuts = 0, sweeps = 0
  end type way_t

  !> Traction over its bound from which a node slips
  real(wp), parameter :: at_bound = 1.0_wp - 1.0e-6_wp

contains

  !> Advance a state to given loads or motions.
  subroutine advance(solver, state, target, settings, next, error)
    !> Method
    class(friction_solver_t), intent(inout) :: solver
    !> Initial state
    type(contact_state_t), intent(in), target :: state
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target
    !> How the step is solved
    type(step_settings_t), intent(in) :: settings
    !> The new state; not converged: the attempt that failed, or a part of the step that reached the rim of the window,
    !> where the run cannot continue (stopped is rim_reached, and the residuals of the loads are those of the whole step)
    type(contact_state_t), intent(out) :: next
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    type(contact_state_t), target :: now
    type(contact_state_t), pointer :: from
    type(load_target_t) :: goal
    real(wp), allocatable :: slipped(:, :, :)
    real(wp), allocatable, target :: ahead(:, :, :)
    real(wp), pointer, contiguous :: origin(:, :, :)
    logical :: at_once
    type(way_t) :: way

    call check_step(solver, state, target, settings, error)
    if (allocated(error)) return
    goal = target
    origin => state%relative_displacement
    if (target%rolling%rolls()) then
      call begin_rolling(solver%problem, state, goal, ahead)
      origin => ahead
    end if
    at_once = settings%static .or. target%rolling%rolls()
    if (.not. (at_once .or. settings%interpolated)) at_once = .not. solver%problem%space%max(state%pressure) > 0.0_wp
    allocate (slipped(0, 0, 0))
    if (settings%interpolated) slipped = 0.0_wp*state%relative_displacement
    from => state
    do
      call solve_part(solver, origin, from, between(state, goal, way%done + way%part), settings, at_once, next, error)
      ! the guess holds for the whole step only
      if (allocated(solver%guess)) deallocate (solver%guess)
      if (allocated(error)) return
      way%work = way%work + next%operator_applications
      way%sweeps = way%sweeps + next%sweeps
      if (next%converged) then
        if (at_once) then
          call add_slip(solver%problem, state, settings%static, target%rolling, next)
        else
          call add_slip(solver%problem, from, settings%static, target%rolling, next)
        end if
        if (settings%interpolated) slipped = slipped + next%slip_increment
        way%done = way%done + way%part
        if (way%done >= 1.0_wp .or. next%clipped) exit
        now = next
        from => now
      else
        ! the contact of a failed attempt has no meaning
        next%clipped = .false.
        ! no path leads to loads that full sliding does not carry
        if (next%sliding .and. way%done + way%part >= 1.0_wp) exit
        if (way%cuts >= settings%max_cuts) then
          ! sub-steps become accepted states, no longer initial guesses, unless the load cannot be carried anyway
          if (settings%static .or. target%rolling%rolls() .or. .not. at_once .or. settings%max_cuts == 0 .or. next%sliding) exit
          at_once = .false.
          from => state
          way%done = 0.0_wp
          way%part = 1.0_wp
          way%cuts = 0
        end if
        way%cuts = way%cuts + 1
        way%part = 0.5_wp*way%part
      end if
    end do
    call record_way(solver%problem, state, goal, way, at_once, slipped, next)
  end subroutine advance

  !> Record work, slip of all parts, and a way that ended at the rim of the window.
  subroutine record_way(problem, state, goal, way, at_once, slipped, next)
    type(friction_problem_t), intent(in) :: problem
    !> State at the beginning of the step
    type(contact_state_t), intent(in) :: state
    !> Loads or motions of the whole step
    type(load_target_t), intent(in) :: goal
    !> The way, and whether its parts only served as starts
    type(way_t), intent(in) :: way
    logical, intent(in) :: at_once
    !> Slip of all parts, if it does not count from where nodes stood at the beginning [m]
    real(wp), intent(in) :: slipped(:, :, :)
    !> State at the end of the last part
    type(contact_state_t), intent(inout) :: next

    next%cuts = way%cuts
    next%sweeps = way%sweeps
    next%operator_applications = way%work
    if (.not. next%converged) return
    if (.not. at_once .and. way%cuts > 0) then
      ! the slip of the step is that of all its parts
      next%slip_increment = next%relative_displacement - state%relative_displacement
      if (size(slipped) > 0) next%slip_increment = slipped
      call find_slip_residual(problem, next)
    end if
    if (way%done >= 1.0_wp) return
    next%converged = .false.
    next%stopped = rim_reached
    call problem%find_load_residuals(goal, next)
  end subroutine record_way

  !> Refuse a load step whose target, settings or state are of no use.
  subroutine check_step(solver, state, target, settings, error)
    !> Method
    class(friction_solver_t), intent(in) :: solver
    !> Initial state
    type(contact_state_t), intent(in) :: state
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target
    !> How the step is solved
    type(step_settings_t), intent(in) :: settings
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    call check_target(target%control, target%value, settings%tolerance, settings%max_sweeps, error)
    if (allocated(error)) return
    call solver%problem%check_approach(target, error)
    if (allocated(error)) return
    call check_rolling(solver%problem, target, error)
    if (allocated(error)) return
    if (settings%max_cuts < 0) then
      call raise(error, status%invalid_input, 'the times that a step may be halved: a number of at least 0 expected')
      return
    end if
    call check_state(state, solver%problem%own_extent(), error)
    call solver%problem%space%agree(error)
  end subroutine check_step

  !> Solve a part of a load step.
  subroutine solve_part(solver, origin, from, goal, settings, at_once, next, error)
    !> Method
    class(friction_solver_t), intent(inout) :: solver
    !> Displacement that slip counts from where parts before only serve as starts (n_col, n_row, 2) [m]
    real(wp), intent(in), contiguous, target :: origin(:, :, :)
    !> State at the beginning of the part
    type(contact_state_t), intent(in) :: from
    !> Loads or motions at its end
    type(load_target_t), intent(in) :: goal
    !> How the step is solved
    type(step_settings_t), intent(in) :: settings
    !> Parts before only serve as starts
    logical, intent(in) :: at_once
    !> State at its end, converged or not
    type(contact_state_t), intent(out) :: next
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: undeformed(:, :, :)

    if (settings%static) then
      allocate (undeformed, source=0.0_wp*origin)
      call solve_step(solver, from, undeformed, goal, settings%tolerance, settings%max_sweeps, next, error)
    else if (at_once) then
      call solve_step(solver, from, origin, goal, settings%tolerance, settings%max_sweeps, next, error)
    else if (settings%interpolated) then
      call solve_with_entry(solver, from, goal, settings%tolerance, settings%max_sweeps, next, error)
    else
      call solve_step(solver, from, from%relative_displacement, goal, settings%tolerance, settings%max_sweeps, next, error)
    end if
    call solver%problem%space%agree(error)
  end subroutine solve_part

  !> Record two steps as one, which ends as the second: its slip is that of both, and R_t (R3) is of this slip.
  subroutine join_steps(problem, first, last)
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> End of the first step
    type(contact_state_t), intent(in) :: first
    !> End of the second step; then that of both
    type(contact_state_t), intent(inout) :: last

    last%slip_increment = first%slip_increment + last%slip_increment
    last%cuts = first%cuts + last%cuts
    call find_slip_residual(problem, last)
  end subroutine join_steps

  !> Compute R_t (R3) of a state whose slip is that of several parts, at the nodes in contact at their end.
  subroutine find_slip_residual(problem, state)
    type(friction_problem_t), intent(in) :: problem
    !> State at the end of the last part
    type(contact_state_t), intent(inout) :: state

    where (spread(state%pressure <= 0.0_wp, 3, 2)) state%slip_increment = 0.0_wp
    state%residual_tangential = tangential_residual(state%traction, state%slip_increment, state%pressure, problem%friction, &
                                                    problem%tangential_compliance, problem%space)
  end subroutine find_slip_residual

  !> Add slip path, dissipated energy of a step, sum of A (-q . ds) [J], and the bound on its error to those before; where a node
  !> sticks ds is nothing but rounding errors.
  subroutine add_slip(problem, before, static, rolling, state)
    type(friction_problem_t), intent(in) :: problem
    !> State at the beginning of the step
    type(contact_state_t), intent(in) :: before
    !> Nothing was before
    logical, intent(in) :: static
    !> Rolling, if the bodies roll
    type(rolling_t), intent(in) :: rolling
    !> State at its end
    type(contact_state_t), intent(inout) :: state
    real(wp) :: part(size(state%pressure, 2)), error(size(state%pressure, 2)), spent(size(state%pressure, 1))
    integer :: row

    if (rolling%rolls()) then
      call add_rolled_slip(problem, before, rolling, state)
      return
    end if
    !$omp parallel do schedule(static) num_threads(problem%space%threads) private(spent)
    do row = 1, size(part)
      error(row) = row_error(problem%friction, row, before, state)
      associate (q => state%traction(:, row, :), ds => state%slip_increment(:, row, :))
        state%accumulated_slip(:, row) = norm2(ds, dim=2)
        if (.not. static) state%accumulated_slip(:, row) = before%accumulated_slip(:, row) + state%accumulated_slip(:, row)
        spent = merge(0.0_wp, -(q(:, 1)*ds(:, 1) + q(:, 2)*ds(:, 2)), state%zone(:, row) == stick)
        part(row) = sum(spent)
        state%dissipation_density(:, row) = spent
        if (.not. static) state%dissipation_density(:, row) = before%dissipation_density(:, row) + spent
      end associate
    end do
    !$omp end parallel do
    state%dissipated_energy = problem%lattice%cell_area()*problem%space%total(part)
    state%path_error = 0.0_wp  ! without a path
    if (static) return
    state%dissipated_energy = before%dissipated_energy + state%dissipated_energy
    state%path_error = before%path_error + problem%lattice%cell_area()*problem%space%total(error)
  end subroutine add_slip

  !> Bound the error of the energy that a row of nodes dissipates in a step, by area, (W4): slip at the traction of the end of the
  !> step may have been at any between both ends, of another direction or under another pressure. Where a traction only
  !> grows, or reverses, a node slips at its bound alone.
  pure real(wp) function row_error(friction, row, before, state)
    !> Friction law
    class(friction_law_t), intent(in) :: friction
    !> Number of the row
    integer, intent(in) :: row
    !> Beginning and end of the step
    type(contact_state_t), intent(in) :: before, state
    real(wp) :: bound(size(state%pressure, 1), 2), reached(size(bound, 1)), length, turned
    integer :: col, first

    row_error = 0.0_wp
    if (.not. friction%is_bounded()) return
    first = (row - 1)*size(bound, 1) + 1
    call friction%find_bounds(first, before%pressure(:, row), bound(:, 1))
    call friction%find_bounds(first, state%pressure(:, row), bound(:, 2))
    call friction%find_lengths(before%traction(:, row, 1), before%traction(:, row, 2), reached)
    do col = 1, size(bound, 1)
      associate (q => state%traction(col, row, :), q_before => before%traction(col, row, :))
        length = norm2(q)
        if (state%zone(col, row) == slip .and. bound(col, 2) > 0.0_wp .and. length > 0.0_wp) then
          turned = 0.0_wp
          if (reached(col) >= at_bound*bound(col, 1)) then
            turned = abs(turned_part(q_before(1), q_before(2), q(1), q(2)))
          end if
          row_error = row_error + norm2(state%slip_increment(col, row, :)) &
                      *(turned + length*abs(bound(col, 2) - bound(col, 1))/bound(col, 2))
        else if (state%zone(col, row) == separated .and. bound(col, 1) > 0.0_wp) then
          row_error = row_error + bound(col, 1)*norm2(state%relative_displacement(col, row, :) &
                                                      - before%relative_displacement(col, row, :))
        end if
      end associate
    end do
  end function row_error

  !> Return part of the way from a state to a target.
  pure type(load_target_t) function between(state, target, fraction)
    !> State at the beginning
    type(contact_state_t), intent(in) :: state
    !> Target at the end
    type(load_target_t), intent(in) :: target
    !> Fraction of the way
    real(wp), intent(in) :: fraction

    between = target
    if (fraction < 1.0_wp) then
      associate (start => merge(state%load, state%motion, target%control == force_control))
        between%value = start + fraction*(target%value - start)
      end associate
    end if
  end function between

end module hc_load_path
