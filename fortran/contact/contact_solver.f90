!> Abstract solvers: frictionless and with friction, on LAPACK and on FFTs.
!>
!> Equations: docs/theory/conditions.md, (C1) to (C4).
module hc_contact_solver
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_contact_state, only: contact_state_t, load_target_t
  use hc_normal_problem, only: normal_problem_t
  use hc_contact_problem, only: friction_problem_t
  implicit none
  private

  public :: contact_solver_t, friction_solver_t

  !> A method of solving contact problems.
  type, abstract :: contact_solver_t
  contains
    !> One load step
    procedure(solve_step), deferred :: solve_step
    !> The normal part of the problem: lattice, gap and candidates
    procedure(solver_problem), deferred :: normal_part
    !> Gap before loading, without the wear
    procedure :: copy_gap
  end type contact_solver_t

  !> A method of solving one with friction.
  type, abstract, extends(contact_solver_t) :: friction_solver_t
    type(friction_problem_t) :: problem
    !> Tractions and motions that a method may start from: those that the next step is likely to end with
    type(contact_state_t), allocatable :: guess
    !> Gap before loading of surfaces that are worn by now, without the wear (n_col, n_row) [m]
    real(wp), allocatable :: unworn_gap(:, :)
  contains
    !> Worn depth, which adds to the gap before loading
    procedure :: wear
    !> Another gap before loading
    procedure :: set_gap
    procedure :: normal_part
    !> Relative displacements (w, u_x, u_y) of given tractions
    procedure(solver_displacements), deferred :: displacements
  end type friction_solver_t

  abstract interface
    !> Solve for tractions and motions at the end of a load step.
    !>
    !> `state%converged`: all residuals are within the tolerance. The
    !> accumulated quantities (slip path, dissipated energy) are not set.
    subroutine solve_step(self, start, reference, target, tolerance, max_sweeps, state, error)
      import :: contact_solver_t, contact_state_t, load_target_t, wp, error_t
      class(contact_solver_t), intent(inout), target :: self
      !> State to start the iteration from; without pressure anywhere, or without fields: none
      type(contact_state_t), intent(in) :: start
      !> Relative displacement s^n at the beginning of the step (n_col, n_row, 2) [m]; of no use without friction
      real(wp), intent(in), contiguous, target :: reference(:, :, :)
      !> Loads or motions to be reached
      type(load_target_t), intent(in) :: target
      !> Bound of all residuals
      real(wp), intent(in) :: tolerance
      !> Active sets that may be tried
      integer, intent(in) :: max_sweeps
      !> State at the end of the step, converged or not
      type(contact_state_t), intent(out) :: state
      !> Allocated on failure: memory, an operator that is not positive definite
      type(error_t), allocatable, intent(out) :: error
    end subroutine solve_step

    !> Point to the normal part of the problem.
    function solver_problem(self) result(problem)
      import :: contact_solver_t, normal_problem_t
      class(contact_solver_t), intent(in), target :: self
      class(normal_problem_t), pointer :: problem
    end function solver_problem

    !> Compute the relative displacements (w, u_x, u_y) of given tractions.
    subroutine solver_displacements(self, pressure, traction, displacement, error)
      import :: friction_solver_t, wp, error_t
      class(friction_solver_t), intent(inout) :: self
      !> Pressure (n_col, n_row) and shear traction (n_col, n_row, 2) [Pa]
      real(wp), intent(in) :: pressure(:, :), traction(:, :, :)
      !> w, u_x, u_y (n_col, n_row, 3) [m]
      real(wp), intent(out), contiguous :: displacement(:, :, :)
      !> Allocated on failure
      type(error_t), allocatable, intent(out) :: error
    end subroutine solver_displacements
  end interface

contains

  !> Point to the normal part of the problem.
  function normal_part(self) result(problem)
    class(friction_solver_t), intent(in), target :: self
    class(normal_problem_t), pointer :: problem

    problem => self%problem
  end function normal_part

  !> Set the worn depth of the surfaces.
  subroutine wear(self, depth)
    class(friction_solver_t), intent(inout) :: self
    !> Depth of both bodies together (n_col, n_row) [m]
    real(wp), intent(in) :: depth(:, :)

    if (.not. allocated(self%unworn_gap)) self%unworn_gap = self%problem%initial_gap
    call self%set_gap(merge(self%unworn_gap + depth, self%unworn_gap, self%problem%candidate))
  end subroutine wear

  !> Set the gap before loading; methods that derive something from it do so again.
  subroutine set_gap(self, gap)
    class(friction_solver_t), intent(inout) :: self
    !> Gap before loading (n_col, n_row) [m]
    real(wp), intent(in) :: gap(:, :)

    self%problem%initial_gap = gap
  end subroutine set_gap

  !> Copy the gap before loading, without the wear.
  subroutine copy_gap(self, gap)
    class(contact_solver_t), intent(in), target :: self
    !> The gap (n_col, n_row) [m]
    real(wp), intent(out), contiguous :: gap(:, :)
    class(normal_problem_t), pointer :: problem

    problem => self%normal_part()
    gap = problem%initial_gap
    select type (self)
    class is (friction_solver_t)
      if (allocated(self%unworn_gap)) gap = self%unworn_gap
    end select
  end subroutine copy_gap

end module hc_contact_solver
