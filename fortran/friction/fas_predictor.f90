!> A start for a load step by coarser lattices: the change that they find, or without an earlier state a first guess.
!>
!> The new loads are applied to the problem of hc_coarse_change, after the same on a still coarser lattice, and the change of its
!> tractions and motions is added to the fine ones. The fronts of contact, stick and slip are where
!> they should be then but for a node or two, without any stored history.
!>
!> Equations: docs/theory/multilevel.md, (M1).
module hc_fas_predictor
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_memory, only: give_back
  use hc_contact_state, only: contact_state_t, new_friction_state, copy_tractions, load_target_t, load_step_t
  use hc_contact_problem, only: friction_problem_t
  use hc_operator_set, only: operators_t
  use hc_lattice_solver, only: solve_on_lattice
  use hc_coarse_change, only: restrict_state, restricted, balance, add_change, add_displacement, find_displacements, &
    prolong_state, prolong_displacement
  implicit none
  private

  public :: predict, find_first

contains

  !> Find tractions and motions to start a step from.
  recursive subroutine predict(problem, coarse, operators, start, step, guess, error, estimate)
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> The problem on the coarser lattices, and their operators
    type(friction_problem_t), intent(in) :: coarse(:)
    type(operators_t), intent(inout) :: operators(:)
    !> State at the beginning of the step, in balance
    type(contact_state_t), intent(in) :: start
    !> The load step
    type(load_step_t), intent(in) :: step
    !> State to start from: the old one with new tractions and motions, if the coarse lattices converged, else unchanged; with the
    !> work, in applications of the full operator
    type(contact_state_t), intent(out) :: guess
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    !> w, u_x, u_y of the state at the beginning of the step, on return of that to start from, but for an error of interpolation;
    !> found here where it is not given (n_col, n_row, 3) [m]
    real(wp), allocatable, intent(inout) :: estimate(:, :, :)

    type(friction_problem_t) :: model
    type(contact_state_t) :: before, first, after
    type(load_target_t) :: coarse_target
    type(load_step_t) :: coarse_step
    real(wp), allocatable, target :: origin(:, :, :)
    real(wp), allocatable :: displacement(:, :, :), moved(:, :, :)
    real(wp) :: work

    call copy_tractions(start, guess, problem%space)
    if (size(coarse) == 0) return
    model = coarse(1)
    call restrict_state(problem, start, model, before)
    if (model%space%count_positive(before%pressure) < problem%options%multilevel%least_contact) return

    allocate (displacement(model%lattice%extent(1), model%own_rows(), 3))
    operators(1)%flexibility%applications = 0.0_wp
    call model%displacements(operators(1)%flexibility, before%pressure, before%traction, displacement, error)
    if (allocated(error)) return
    work = operators(1)%flexibility%applications
    call balance(problem, start, step, before, displacement, model, origin, coarse_target)
    if (model%is_pressed(coarse_target)) then
      moved = displacement
      associate (options => model%options%multilevel)
        call predict(model, coarse(2:), operators(2:), before, load_step_t(coarse_target, origin), first, error, moved)
        work = work + first%operator_applications
        coarse_step = load_step_t(coarse_target, origin, options%change_tolerance, options%change_sweeps)
        if (.not. allocated(error)) then
          call solve_on_lattice(model, operators(1), first, coarse_step, after, error, moved, as_start=.true.)
        end if
      end associate
      ! each rank may have solved all of the coarser lattice
      call problem%space%agree(error)
      if (allocated(error)) return
      work = work + after%operator_applications
      guess%converged = after%converged
      if (guess%converged) then
        moved = moved - displacement
        ! fields of the coarse lattice take as much memory as one of the window
        deallocate (displacement, origin, before%gap, before%relative_displacement, after%gap, after%relative_displacement, &
                    after%slip_increment, after%accumulated_slip, after%dissipation_density)
        call give_back(problem%own_size())
        call add_change(model, before, after, problem, guess)
        if (.not. allocated(estimate)) call find_displacements(problem, start, estimate)
        call add_displacement(model, moved, problem, estimate)
      end if
    end if
    guess%operator_applications = work*model%lattice%size()/problem%lattice%size()
  end subroutine predict

  !> Find a first guess on the coarser lattices, each of which starts from the next one.
  recursive subroutine find_first(problem, coarse, operators, step, guess, error, estimate)
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> The problem on the coarser lattices, and their operators
    type(friction_problem_t), intent(in) :: coarse(:)
    type(operators_t), intent(inout) :: operators(:)
    !> The load step
    type(load_step_t), intent(in) :: step
    !> On entry a state without contact, on return one to start from, if the coarse lattices converged; with the work, in
    !> applications of the full operator
    type(contact_state_t), intent(inout) :: guess
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    !> w, u_x, u_y of that state, but for an error of interpolation, if it has any tractions (n_col, n_row, 3) [m]
    real(wp), allocatable, intent(out) :: estimate(:, :, :)

    type(contact_state_t) :: first, found
    type(load_step_t) :: coarse_step
    real(wp), allocatable, target :: origin(:, :, :)
    real(wp), allocatable :: known(:, :, :)

    if (size(coarse) == 0) return
    associate (model => coarse(1))
      if (model%space%count(model%candidate) == 0) return
      if (.not. model%is_pressed(step%target)) return
      origin = restricted(problem, step%reference, model)
      coarse_step = load_step_t(step%target, origin, model%options%multilevel%nested_tolerance, step%max_sweeps)
      coarse_step%target%rolling%share = 0.5_wp*step%target%rolling%share
      call new_friction_state(first, model%lattice, model%space)
      first%motion = guess%motion
      call find_first(model, coarse(2:), operators(2:), coarse_step, first, error, known)
      guess%operator_applications = first%operator_applications
      if (.not. allocated(error)) then
        call solve_on_lattice(model, operators(1), first, coarse_step, found, error, known, as_start=.true.)
      end if
      ! each rank may have solved all of the coarser lattice
      call problem%space%agree(error)
      if (allocated(error)) return
      guess%operator_applications = (guess%operator_applications + found%operator_applications) &
                                    *model%lattice%size()/problem%lattice%size()
      ! a start from an unconverged solution saves nothing
      if (.not. found%converged) return
      call prolong_state(model, found, problem, guess)
      if (.not. allocated(known)) return
      allocate (estimate(problem%lattice%extent(1), problem%own_rows(), 3))
      call prolong_displacement(model, known, problem, estimate)
    end associate
  end subroutine find_first

end module hc_fas_predictor
