!> From one load to the next.
!>
!> A load step that does not converge is cut in half, again and again up to a
!> bound; a state is only taken over when it has converged. In an incremental
!> path every part starts from the relative displacement that the last one left.
!> A static load is applied at once: parts only serve as starts, and the relative
!> displacement counts from the undeformed bodies.
module hc_load_path
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_contact_state, only: contact_state_t, load_target_t, force_control
  use hc_friction_problem, only: friction_solver_t
  use hc_entry_state, only: solve_with_entry
  implicit none
  private

  public :: advance, touches_rim

contains

  !> Advance a state to given loads or motions.
  subroutine advance(solver, state, target, static, tolerance, max_sweeps, max_cuts, next, error, interpolated)
    !> Method
    class(friction_solver_t), intent(inout) :: solver
    !> State to go on from
    type(contact_state_t), intent(in) :: state
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target
    !> The load is applied to the undeformed bodies at once
    logical, intent(in) :: static
    !> Bound of all residuals
    real(wp), intent(in) :: tolerance
    !> Active sets that may be tried
    integer, intent(in) :: max_sweeps
    !> Times that a step may be halved
    integer, intent(in) :: max_cuts
    !> The new state; not converged: the attempt that failed; in contact at the rim: nothing was gone on with
    type(contact_state_t), intent(out) :: next
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    !> Slip of a node that enters counts from where it stood when its gap closed; default: from the beginning of the step
    logical, intent(in), optional :: interpolated

    type(contact_state_t) :: now, trial
    real(wp), allocatable :: undeformed(:, :, :), slipped(:, :, :)
    logical :: from_entry
    real(wp) :: done, part, work
    integer :: cuts, sweeps

    from_entry = .false.
    if (present(interpolated)) from_entry = interpolated
    now = state
    undeformed = 0.0_wp*state%relative_displacement
    allocate (slipped, source=undeformed)
    done = 0.0_wp
    part = 1.0_wp
    work = 0.0_wp
    cuts = 0
    sweeps = 0
    do
      if (static) then
        call solver%solve_step(now, undeformed, between(state, target, done + part), tolerance, max_sweeps, trial, error)
      else if (from_entry) then
        call solve_with_entry(solver, now, between(state, target, done + part), tolerance, max_sweeps, trial, error)
      else
        call solver%solve_step(now, now%relative_displacement, between(state, target, done + part), tolerance, &
                               max_sweeps, trial, error)
      end if
      if (allocated(error)) return
      work = work + trial%operator_applications
      sweeps = sweeps + trial%sweeps
      if (trial%converged) then
        if (static) then
          trial%accumulated_slip = norm2(trial%slip_increment, dim=3)
          trial%dissipated_energy = dissipation(solver, trial)
        else
          trial%accumulated_slip = now%accumulated_slip + norm2(trial%slip_increment, dim=3)
          trial%dissipated_energy = now%dissipated_energy + dissipation(solver, trial)
        end if
        slipped = slipped + trial%slip_increment
        now = trial
        done = done + part
        if (done >= 1.0_wp .or. touches_rim(now)) exit
      else
        if (cuts == max_cuts) then
          now = trial
          exit
        end if
        cuts = cuts + 1
        part = 0.5_wp*part
      end if
    end do
    next = now
    next%cuts = cuts
    next%sweeps = sweeps
    next%operator_applications = work
    if (.not. static .and. cuts > 0 .and. next%converged) then
      ! the slip of the step is that of all its parts
      next%slip_increment = next%relative_displacement - state%relative_displacement
      if (from_entry) next%slip_increment = slipped
      where (spread(next%pressure <= 0.0_wp, 3, 2)) next%slip_increment = 0.0_wp
    end if
  end subroutine advance

  !> Part of the way from a state to a target.
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

  !> Energy that friction takes during a step, sum of A (-q . ds) [J].
  real(wp) function dissipation(solver, state)
    class(friction_solver_t), intent(in) :: solver
    type(contact_state_t), intent(in) :: state
    dissipation = -solver%problem%lattice%cell_area()*sum(state%traction*state%slip_increment)
  end function dissipation

  !> Is there contact at the rim of the window?
  pure logical function touches_rim(state)
    !> State
    type(contact_state_t), intent(in) :: state

    associate (p => state%pressure)
      touches_rim = any(p(1, :) > 0.0_wp) .or. any(p(size(p, 1), :) > 0.0_wp) .or. &
                    any(p(:, 1) > 0.0_wp) .or. any(p(:, size(p, 2)) > 0.0_wp)
    end associate
  end function touches_rim

end module hc_load_path
