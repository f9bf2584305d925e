!> Solution by LAPACK of a step with few nodes in contact that another solver did not solve.
!>
!> With two or three nodes in contact the zones decide the solution, and slip does not indicate them: sweeps of the
!> staggered method may oscillate. The direct method solves for pressure, traction and motions at once. It gets the part of
!> the window around the contact that the attempt found, and its solution is judged by one product over the window.
!>
!> Theory: docs/theory/load_path.md.
module hc_few_nodes
  use hc_precision, only: wp, lk
  use hc_error, only: error_t
  use hc_contact_state, only: contact_state_t, load_target_t, load_step_t
  use hc_contact_problem, only: friction_problem_t
  use hc_contact_solver, only: friction_solver_t
  use hc_direct_friction, only: direct_friction_t, new_direct_friction
  use hc_subwindow, only: enclose, solve_part
  implicit none
  private

  public :: solve_step

contains

  !> Solve one load step by a solver, and by LAPACK where that fails with few nodes in contact.
  subroutine solve_step(solver, start, reference, target, tolerance, max_sweeps, state, error)
    !> Method
    class(friction_solver_t), intent(inout) :: solver
    !> State at the beginning of the step
    type(contact_state_t), intent(in) :: start
    !> Displacement that slip counts from (n_col, n_row, 2) [m]
    real(wp), intent(in), contiguous, target :: reference(:, :, :)
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target
    !> Bound of all residuals
    real(wp), intent(in) :: tolerance
    !> Active sets that may be tried
    integer, intent(in) :: max_sweeps
    !> State at the end of the step, converged or not
    type(contact_state_t), intent(out) :: state
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    type(direct_friction_t) :: direct
    type(friction_problem_t) :: part
    type(contact_state_t) :: found
    logical, allocatable :: nodes(:, :)
    logical :: solved
    integer :: low(2), high(2), try, n

    call solver%solve_step(start, reference, target, tolerance, max_sweeps, state, error)
    if (allocated(error) .or. state%converged .or. state%sliding .or. target%rolling%steady) return
    select type (solver)
    type is (direct_friction_t)
      return
    end select
    associate (problem => solver%problem, options => solver%problem%options%multilevel)
      nodes = state%pressure > 0.0_wp
      n = problem%space%count(logical(nodes, lk))
      if (n == 0 .or. n > options%few_nodes) return
      do try = 1, options%max_parts
        call enclose(problem, nodes, low, high)
        if (any(high - low >= options%largest_direct_side)) return
        call problem%extract_part(low, high, part)
        call new_direct_friction(direct, part, error)
        call problem%space%agree(error)
        if (allocated(error)) return
        call solve_part(solver, direct, reshape([low, high], [2, 2]), start, &
                        load_step_t(target, reference, tolerance, max_sweeps), found, solved, error)
        if (allocated(error) .or. .not. solved) return
        if (found%converged) then
          found%sweeps = state%sweeps + found%sweeps
          found%operator_applications = state%operator_applications + found%operator_applications
          state = found
          return
        end if
        ! the bodies overlap outside of the part
        nodes = found%pressure > 0.0_wp .or. (found%gap < 0.0_wp .and. problem%candidate)
      end do
    end associate
  end subroutine solve_step

end module hc_few_nodes
