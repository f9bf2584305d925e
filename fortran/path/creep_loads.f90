!> Loads of many creepages in the steady state: the entries of a creep table.
!>
!> Operators and pressure are those of one contact. Each case starts from the tractions of the case before, so the order of the
!> creepages is that of neighbours.
!>
!> Equations: docs/theory/rolling.md, (K2), (K4).
module hc_creep_loads
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_contact_state, only: contact_state_t, load_target_t, displacement_control, along_x, about_z
  use hc_contact_solver, only: friction_solver_t
  use hc_load_path, only: advance, step_settings_t
  implicit none
  private

  public :: creep_loads_t, find_creep_loads

  !> Loads of cases, up to the first that did not converge.
  type :: creep_loads_t
    !> Tangential loads along x and y [N], and torque [N m] (3, n)
    real(wp), allocatable :: load(:, :)
    !> Applications of the operator (n)
    real(wp), allocatable :: work(:)
    !> Cases that were solved
    integer :: n_solved = 0
  end type creep_loads_t

contains

  !> Solve the steady state for each of many creepages, up to the first that does not converge.
  subroutine find_creep_loads(solver, state, target, creepage, settings, found, error)
    !> Method
    class(friction_solver_t), intent(inout) :: solver
    !> State to start from; then that of the last case that was solved
    type(contact_state_t), intent(inout) :: state
    !> Normal load or approach, and direction of rolling
    type(load_target_t), intent(in) :: target
    !> Creepage along x and y, and spin [1/m], of each case (3, n)
    real(wp), intent(in) :: creepage(:, :)
    !> How a case is solved
    type(step_settings_t), intent(in) :: settings
    !> Their loads
    type(creep_loads_t), intent(out) :: found
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    type(contact_state_t) :: first, next
    type(load_target_t) :: goal
    integer :: k

    allocate (found%load(3, size(creepage, 2)), found%work(size(creepage, 2)), source=0.0_wp)
    if (.not. (target%rolling%rolls() .and. target%rolling%steady)) then
      call raise(error, status%invalid_input, 'a creep table: the steady state of rolling bodies expected')
      return
    end if
    first = state
    goal = target
    goal%control(along_x:about_z) = displacement_control
    do k = 1, size(creepage, 2)
      goal%value(along_x:about_z) = creepage(:, k)
      call advance(solver, state, goal, settings, next, error)
      if (allocated(error)) return
      found%work(k) = next%operator_applications
      if (.not. next%converged) then
        ! the neighbour is no start that helps
        call advance(solver, first, goal, settings, next, error)
        if (allocated(error)) return
        found%work(k) = found%work(k) + next%operator_applications
      end if
      if (.not. next%converged) return
      found%load(:, k) = next%load(along_x:about_z)
      found%n_solved = k
      state = next
    end do
  end subroutine find_creep_loads

end module hc_creep_loads
