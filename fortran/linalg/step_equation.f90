!> The linear equation of a step of Newton's method, by the solver that fits its operator.
!>
!> Conjugate gradients solve it where the operator is symmetric and positive definite, as that of two half-spaces at rest. GMRES
!> solves it otherwise: steadily rolling bodies carry tractions from node to node in one direction only.
!>
!> Equations: docs/theory/friction.md, (F11).
module hc_step_equation
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_active_set, only: active_set_t
  use hc_linear_system, only: linear_system_t, solution_broke_off
  use hc_projected_cg, only: projected_cg
  use hc_projected_gmres, only: projected_gmres
  implicit none
  private

  public :: solve_step_equation

  !> Directions that GMRES stores before it begins anew.
  integer, parameter :: max_directions = 50

contains

  !> Solve with linear constraints B^T x, by conjugate gradients or GMRES.
  subroutine solve_step_equation(system, nodes, b, m_b, rhs, x, ax, tolerance, max_iterations, &
                                 multiplier, residual, iterations, outcome, error, drift)
    !> Operator and preconditioner
    class(linear_system_t), intent(inout) :: system
    !> Nodes that carry unknowns
    type(active_set_t), intent(in) :: nodes
    !> Constraint vectors B and M B, at these nodes (n_active, number of constraints, may be 0)
    real(wp), intent(in), contiguous :: b(:, :), m_b(:, :)
    !> Right-hand side (n); freed, once there is a copy of its active part
    real(wp), allocatable, intent(inout) :: rhs(:)
    !> Unknowns (n), on entry a start that satisfies the constraints
    real(wp), intent(inout), contiguous :: x(:)
    !> Product A x (n), everywhere, on entry and on return
    real(wp), intent(inout), contiguous :: ax(:)
    !> The largest residual that is allowed on an active node
    real(wp), intent(in) :: tolerance
    !> Iterations allowed
    integer, intent(in) :: max_iterations
    !> Multipliers of the constraints
    real(wp), intent(out) :: multiplier(:)
    !> The largest residual on an active node; of GMRES the root of the sum of their squares, which is a bound of it
    real(wp), intent(out) :: residual
    !> Iterations taken; why it stopped: solution_accurate, iterations_used_up or solution_broke_off
    integer, intent(out) :: iterations, outcome
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    !> What rounding errors may have left in A x
    real(wp), intent(out), optional :: drift
    logical :: independent

    if (system%symmetric) then
      call projected_cg(system, nodes, b, m_b, rhs, x, ax, tolerance, max_iterations, multiplier, residual, iterations, outcome, &
                        error, drift)
      return
    end if
    multiplier = 0.0_wp
    call projected_gmres(system, nodes, b, m_b, b, [1.0_wp], rhs, x, ax, tolerance, max_iterations, max_directions, multiplier, &
                         independent, residual, iterations, outcome, error, drift)
    if (.not. independent) outcome = solution_broke_off
  end subroutine solve_step_equation

end module hc_step_equation
