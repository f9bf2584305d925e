!> A load step with friction on one lattice.
!>
!> Sweeps that find pressure and shear traction one after the other (staggered_newton, which states the equations),
!> and where that is not enough both together (coupled_newton), until the residuals of the recorded state are within the
!> tolerance.
!>
!> Equations: docs/theory/friction.md, (F2) to (F4).
module hc_lattice_solver
  use hc_precision, only: wp, pi
  use hc_build_options, only: debug_checks
  use hc_error, only: error_t
  use hc_memory, only: give_back
  use hc_contact_state, only: contact_state_t, add_fields, add_history, load_step_t, sweeps_used_up, &
    no_progress, loads_not_carried, out_of_range
  use hc_contact_problem, only: friction_problem_t
  use hc_load_constraints, only: overloads
  use hc_operator_set, only: operators_t
  use hc_friction_iterate, only: friction_iterate_t
  use hc_displacement_check, only: check_displacements
  use hc_staggered_newton, only: staggered_sweep
  use hc_coupled_newton, only: coupled_sweep
  use hc_linear_system, only: solution_broke_off
  implicit none
  private

  public :: solve_on_lattice

contains

  !> Sweep on one lattice, on the rows of this rank, until the residuals are small.
  subroutine solve_on_lattice(problem, operators, start, step, state, error, estimate, as_start)
    !> The problem
    type(friction_problem_t), intent(in), target :: problem
    !> Operator and preconditioners
    type(operators_t), intent(inout), target :: operators
    !> State to start from, whose tractions are freed once they are taken over
    type(contact_state_t), intent(inout) :: start
    !> The load step
    type(load_step_t), intent(in) :: step
    !> Solution, converged or not
    type(contact_state_t), intent(out) :: state
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    !> w, u_x, u_y of the start but for an error of interpolation (n_col, n_row, 3), if known: saves their product; those of
    !> the solution, if that is a start itself, else freed [m]
    real(wp), allocatable, intent(inout), optional :: estimate(:, :, :)
    !> The solution is only a start of another one: judged by the displacements that the solvers carry along
    logical, intent(in), optional :: as_start

    type(friction_iterate_t), target :: now
    integer :: sweep, fixed
    logical :: judged

    fixed = 0
    judged = .true.
    if (present(as_start)) judged = .not. as_start
    call operators%reset()
    call give_back(problem%own_size())
    call now%set_start(problem, operators, start, step, error, estimate)
    if (allocated(error)) return
    associate (options => problem%options%newton)
      if (problem%couples_strongly(step%target)) call now%cut_parameter(options%cautious_share)
      do sweep = 1, step%max_sweeps
        call make_sweep(now, sweep, step%max_sweeps, error)
        if (allocated(error)) return
        if (.not. now%is_finite()) exit
        if (debug_checks) call check_displacements(now, error)
        if (allocated(error)) return
        if (now%fixed) then
          fixed = fixed + 1
          state%sliding = overloads(problem, step%target, reshape(now%p, [problem%lattice%extent(1), problem%own_rows()]), &
                                    now%residual_normal)
          if (state%sliding) fixed = options%max_fixed_sweeps
        end if
        state%sweeps = sweep
        if (max(now%residual_normal, now%residual_tangential) > step%tolerance .and. sweep < step%max_sweeps &
            .and. .not. now%unsupported .and. fixed < options%max_fixed_sweeps) cycle
        call judge(now, step, judged, state, error, estimate)
        if (allocated(error)) return
        if (state%converged .or. now%unsupported .or. fixed >= options%max_fixed_sweeps) exit
        call now%refresh(error)
        if (allocated(error)) return
      end do
    end associate
    call finish(now, step, state)
  end subroutine solve_on_lattice

  !> Make one sweep: for the pressure, then for the shear traction, or for both at once where that is not enough.
  subroutine make_sweep(now, sweep, max_sweeps, error)
    type(friction_iterate_t), intent(inout), target :: now
    !> Number of the sweep, from 1 on; sweeps that may be made
    integer, intent(in) :: sweep, max_sweeps
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    integer :: staggered
    logical :: failed

    failed = .true.
    associate (options => now%problem%options%newton)
      staggered = max_sweeps
      if (now%pressure_feels_shear) staggered = options%staggered_sweeps
      if (now%problem%couples_strongly(now%target)) staggered = options%staggered_sweeps_strong
      if (sweep > staggered) then
        call coupled_sweep(now, failed, error)
        if (allocated(error)) return
      end if
    end associate
    if (failed) call staggered_sweep(now, error)
  end subroutine make_sweep

  !> Record an iterate, with admissible tractions, and judge it by the displacements that were carried along, if their errors are
  !> small, or by a product of its own.
  subroutine judge(now, step, judged, state, error, estimate)
    type(friction_iterate_t), intent(inout) :: now
    !> The load step
    type(load_step_t), intent(in) :: step
    !> False: the solution is only a start of another one
    logical, intent(in) :: judged
    !> The record
    type(contact_state_t), intent(inout) :: state
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    !> w, u_x, u_y of a solution that is only a start (n_col, n_row, 3) [m]
    real(wp), allocatable, intent(inout), optional :: estimate(:, :, :)
    real(wp) :: less
    logical :: known

    associate (problem => now%problem, options => now%problem%options%newton)
      known = .not. judged .or. step%tolerance >= options%carried_tolerance
      ! steady rolling carries the slip of a spacing along, and not u
      if (step%target%rolling%steady) known = .false.
      ! without friction no sweep finds u, which follows the pressure
      if (judged .and. .not. problem%friction%resists()) known = .false.
      if (.not. known) call now%forget()
      call give_back(size(now%p))
      if (.not. allocated(state%pressure)) call add_fields(state, problem%lattice, now%operators%space)
      call record(now, state)
      state%motion = now%motion
      less = 0.0_wp
      ! errors of carried displacements: those of the cut, and rounding errors
      if (known .and. judged) less = cut_off(now, state) + 2*options%displacement_rounding
      known = known .and. less <= options%cut_share*step%tolerance
      if (known) then
        call collect(now, state)
        if (present(estimate) .and. .not. judged) then
          if (.not. allocated(estimate)) allocate (estimate(problem%lattice%extent(1), problem%own_rows(), 3))
          estimate(:, :, 1) = state%gap
          estimate(:, :, 2:) = state%relative_displacement
        end if
        call problem%complete_state(step%target, step%tolerance - less, step%reference, state)
      end if
      if (.not. known .or. (judged .and. .not. state%converged)) then
        call problem%displace(now%operators%flexibility, state, error)
        if (allocated(error)) return
        call problem%complete_state(step%target, step%tolerance, step%reference, state)
      end if
    end associate
  end subroutine judge

  !> Record work and reason of the end, and free the iterate.
  subroutine finish(now, step, state)
    type(friction_iterate_t), intent(inout) :: now
    !> The load step
    type(load_step_t), intent(in) :: step
    !> The record
    type(contact_state_t), intent(inout) :: state
    logical :: finite

    ! numbers that are not finite: no tractions
    if (.not. allocated(state%pressure)) call add_fields(state, now%problem%lattice, now%operators%space)
    if (.not. (state%converged .or. state%sliding)) then
      state%sliding = overloads(now%problem, step%target, state%pressure, state%residual_normal)
    end if
    state%sliding = state%sliding .and. .not. state%converged
    state%operator_applications = now%operators%work()
    call now%operators%clear()
    finite = now%is_finite()
    deallocate (now%p, now%q)
    call add_history(state)
    if (state%converged) return
    state%stopped = merge(no_progress, sweeps_used_up, now%outcome == solution_broke_off)
    if (state%sliding) state%stopped = loads_not_carried
    if (.not. finite) state%stopped = out_of_range
  end subroutine finish

  !> Record the tractions of an iterate, without tension and within the admissible set.
  subroutine record(now, state)
    type(friction_iterate_t), intent(in) :: now
    type(contact_state_t), intent(inout), target :: state
    real(wp), pointer, contiguous :: q(:)
    integer :: row, from, to

    q(1:size(state%traction)) => state%traction
    call now%project_to_cone(q)
    !$omp parallel do schedule(static) num_threads(now%operators%space%threads) private(from, to)
    do row = 1, size(state%pressure, 2)
      to = row*size(state%pressure, 1)
      from = to - size(state%pressure, 1) + 1
      call now%problem%normal_law%project(now%p(from:to), state%pressure(:, row))
    end do
    !$omp end parallel do
  end subroutine record

  !> Collect the displacements that the solvers carry along.
  subroutine collect(now, state)
    type(friction_iterate_t), intent(in) :: now
    !> State whose gap and relative displacement they become, for `complete_state`
    type(contact_state_t), intent(inout), target :: state
    real(wp), pointer, contiguous :: gap(:), displacement(:)

    gap(1:size(now%w)) => state%gap
    displacement(1:size(now%u)) => state%relative_displacement
    associate (space => now%operators%space)
      call space%copy(now%w, gap)
      if (now%pressure_feels_shear) call space%add(now%closing, gap)
      call space%copy(now%u, displacement)
    end associate
  end subroutine collect

  !> Bound the displacement by the difference of the recorded tractions from those of the iterate, and by rounded directions, as a
  !> residual.
  !>
  !> No distribution of a traction that is nowhere larger than t, and in the sum T, displaces more than the disc of radius
  !> (T/(pi t))^1/2 on which it is t.
  real(wp) function cut_off(now, state)
    type(friction_iterate_t), intent(in) :: now
    type(contact_state_t), intent(in) :: state
    real(wp) :: part(size(state%pressure, 2)), largest, less, displaced
    integer :: n, row, col, i

    n = size(now%p)
    largest = 0.0_wp
    !$omp parallel do schedule(static) num_threads(now%operators%space%threads) private(col, i, less) reduction(max: largest)
    do row = 1, size(part)
      part(row) = 0.0_wp
      do col = 1, size(state%pressure, 1)
        i = (row - 1)*size(state%pressure, 1) + col
        less = abs(state%pressure(col, row) - now%p(i)) + abs(state%traction(col, row, 1) - now%q(i)) &
               + abs(state%traction(col, row, 2) - now%q(n + i))
        largest = max(largest, less)
        part(row) = part(row) + less
      end do
    end do
    !$omp end parallel do
    largest = now%operators%space%largest(largest)
    displaced = 2.0_wp*now%problem%medium%largest_point(now%problem%lattice%spacing()) &
                *sqrt(pi*now%problem%lattice%cell_area()*now%operators%space%total(part)*largest) + now%rounding
    cut_off = displaced/(now%problem%normal_compliance*max(now%operators%space%max(state%pressure), tiny(1.0_wp)))
    if (.not. now%problem%friction%resists()) return
    displaced = displaced + now%problem%medium%spring_compliance()*largest
    cut_off = max(cut_off, displaced/(now%problem%tangential_compliance*now%traction_scale()))
  end function cut_off

end module hc_lattice_solver
