!> A load step with friction on one lattice.
!>
!> Sweeps that find pressure and shear traction one after the other (staggered_newton, which states the equations),
!> and where that is not enough both together (coupled_newton), until the residuals of what is recorded are within the
!> tolerance.
!>
!> Equations: docs/theory/friction.md, (F2) to (F4).
module hc_lattice_solver
  use hc_precision, only: wp
  use hc_build_options, only: debug_checks
  use hc_error, only: error_t
  use hc_options, only: newton_options_t
  use hc_contact_state, only: contact_state_t, add_fields, load_target_t, sweeps_used_up, &
    no_progress, loads_not_carried, out_of_range
  use hc_contact_problem, only: friction_problem_t
  use hc_load_constraints, only: overloads
  use hc_elastic_operators, only: operators_t
  use hc_friction_iterate, only: friction_iterate_t
  use hc_staggered_newton, only: staggered_sweep
  use hc_coupled_newton, only: coupled_sweep
  use hc_linear_system, only: solution_broke_off
  implicit none
  private

  public :: solve_on_lattice

contains

  !> Sweep on one lattice until the residuals are small.
  subroutine solve_on_lattice(problem, operators, start, reference, target, tolerance, max_sweeps, state, error)
    !> The problem
    type(friction_problem_t), intent(in), target :: problem
    !> Operator and preconditioners
    type(operators_t), intent(inout), target :: operators
    !> State to start from, whose tractions are freed once they are taken over
    type(contact_state_t), intent(inout) :: start
    !> Relative displacement at the beginning of the step (n_col, n_row, 2) [m]
    real(wp), intent(in), contiguous, target :: reference(:, :, :)
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target
    !> Bound of all residuals
    real(wp), intent(in) :: tolerance
    !> Sweeps that may be made
    integer, intent(in) :: max_sweeps
    !> Solution, converged or not
    type(contact_state_t), intent(out) :: state
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    type(friction_iterate_t), target :: now
    real(wp), allocatable :: displacement(:, :, :)
    type(newton_options_t) :: options
    integer :: sweep, fixed, staggered
    logical :: failed

    options = problem%options%newton
    fixed = 0
    call operators%reset()
    call now%set_start(problem, operators, start, reference, target, tolerance, error)
    if (allocated(error)) return
    deallocate (start%pressure, start%traction)
    ! sweeps that find pressure and shear traction one after the other
    staggered = max_sweeps
    if (now%pressure_feels_shear) staggered = options%staggered_sweeps
    if (problem%couples_strongly()) then
      staggered = options%staggered_sweeps_strong
      call now%globalization%cut(options%cautious_share, options)
    end if
    do sweep = 1, max_sweeps
      failed = .true.
      if (sweep > staggered .and. (max(now%residual_normal, now%residual_tangential) < options%coupled_residual .or. &
                              sweep > staggered + options%coupled_delay)) then
        call coupled_sweep(now, failed, error)
        if (allocated(error)) return
      end if
      if (failed) call staggered_sweep(now, error)
      if (allocated(error)) return
      if (.not. now%is_finite()) exit
      if (debug_checks) call now%check_displacements(error)
      if (allocated(error)) return
      if (now%fixed) then
        fixed = fixed + 1
        state%sliding = overloads(problem, target, reshape(now%p, problem%lattice%extent), now%residual_normal)
        if (state%sliding) fixed = options%max_fixed_sweeps
      end if
      state%sweeps = sweep
      if (max(now%residual_normal, now%residual_tangential) > tolerance .and. sweep < max_sweeps &
          .and. .not. now%unsupported .and. fixed < options%max_fixed_sweeps) cycle

      ! the recorded tractions are admissible exactly, and judged by a product of their own
      call now%forget_displacements()
      if (.not. allocated(state%pressure)) call add_fields(state, problem%lattice, operators%space)
      call record(now, state)
      state%motion = now%motion
      allocate (displacement(problem%lattice%extent(1), problem%lattice%extent(2), 3))
      call problem%displacements(operators%flexibility, state%pressure, state%traction, displacement, error)
      if (allocated(error)) return
      call problem%complete_state(target, tolerance, reference, displacement, state)
      deallocate (displacement)
      if (state%converged .or. now%unsupported .or. fixed >= options%max_fixed_sweeps) exit
      call now%refresh(error)
      if (allocated(error)) return
    end do
    ! numbers that are not finite: no tractions
    if (.not. allocated(state%pressure)) call add_fields(state, problem%lattice, operators%space)
    if (.not. (state%converged .or. state%sliding)) then
      state%sliding = overloads(problem, target, state%pressure, state%residual_normal)
    end if
    state%sliding = state%sliding .and. .not. state%converged
    state%operator_applications = operators%work()
    call operators%clear()
    if (state%converged) return
    state%stopped = merge(no_progress, sweeps_used_up, now%outcome == solution_broke_off)
    if (state%sliding) state%stopped = loads_not_carried
    if (.not. now%is_finite()) state%stopped = out_of_range
  end subroutine solve_on_lattice

  !> Record the tractions of an iterate, without tension and within the admissible set.
  subroutine record(now, state)
    type(friction_iterate_t), intent(in) :: now
    type(contact_state_t), intent(inout) :: state
    real(wp), allocatable :: q(:)
    integer :: n, row, from, to

    n = size(now%p)
    call now%project_to_cone(q)
    !$omp parallel do schedule(static) num_threads(now%operators%space%threads) private(from, to)
    do row = 1, size(state%pressure, 2)
      to = row*size(state%pressure, 1)
      from = to - size(state%pressure, 1) + 1
      call now%problem%normal_law%project(now%p(from:to), state%pressure(:, row))
      state%traction(:, row, 1) = q(from:to)
      state%traction(:, row, 2) = q(n + from:n + to)
    end do
    !$omp end parallel do
  end subroutine record

end module hc_lattice_solver
