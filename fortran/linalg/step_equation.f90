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
  use hc_linear_system, only: linear_system_t, constraints_t, iteration_t
  use hc_projected_cg, only: projected_cg
  use hc_projected_gmres, only: projected_gmres
  implicit none
  private

  public :: solve_step_equation

  !> Directions that GMRES stores before it begins anew.
  integer, parameter :: max_directions = 50

contains

  !> Solve with linear constraints B^T x, by conjugate gradients or GMRES.
  subroutine solve_step_equation(system, nodes, constraints, rhs, x, ax, iteration, error)
    !> Operator and preconditioner
    class(linear_system_t), intent(inout) :: system
    !> Nodes that carry unknowns
    type(active_set_t), intent(in) :: nodes
    !> Constraints, with C = B; on return their multipliers
    type(constraints_t), intent(inout) :: constraints
    !> Right-hand side at the active nodes; used up
    real(wp), allocatable, intent(inout) :: rhs(:)
    !> Unknowns (n_active), on entry a start that satisfies the constraints
    real(wp), intent(inout), contiguous :: x(:)
    !> Product A x (n), everywhere, on entry and on return
    real(wp), intent(inout), contiguous :: ax(:)
    !> How far it may go, and how it ended; the residual of GMRES is the root of the sum of squares, a bound of the largest one
    type(iteration_t), intent(inout) :: iteration
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    if (system%symmetric) then
      call projected_cg(system, nodes, constraints, rhs, x, ax, iteration, error)
      return
    end if
    if (allocated(constraints%multiplier)) deallocate (constraints%multiplier)
    allocate (constraints%multiplier(size(constraints%columns, 2)), source=0.0_wp)
    iteration%most_directions = max_directions
    iteration%weight = [1.0_wp]
    call projected_gmres(system, nodes, constraints, rhs, x, ax, iteration, error)
  end subroutine solve_step_equation

end module hc_step_equation
