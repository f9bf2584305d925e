!> A start for a load step: the change that a coarser lattice finds.
!>
!> The coarse problem is set up so that the present fine state, at the coarse
!> nodes, solves it exactly under the present loads: what coarse tractions
!> displace too much or too little is put into the initial gap and into the relative
!> displacement at the beginning of the step,
!>
!>     h_c = g + approach - w_c,     s_c = u_c - shift - twist x r - (s - s^n).
!>
!> The new loads are then applied to it (full approximation scheme, Brandt, Math. Comput. 31, 1977), after the
!> same on a still coarser lattice, and the change of its
!> tractions and motions is added to the fine ones. Nodes between coarse ones that slip are put
!> onto the cone. The fronts of contact, stick and slip are where
!> they should be then but for a node or two, without any stored history.
!>
!> Equations: docs/theory/multilevel.md, (M1).
module hc_fas_predictor
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_contact_state, only: contact_state_t, new_friction_state, copy_tractions, load_target_t, slip, normal, force_control
  use hc_contact_problem, only: friction_problem_t
  use hc_elastic_operators, only: operators_t
  use hc_lattice_solver, only: solve_on_lattice
  use hc_transfer, only: prolong, prolong_vector, restrict_field, restrict_vector
  implicit none
  private

  public :: predict

contains

  !> Find tractions and motions to start a step from.
  recursive subroutine predict(problem, coarse, operators, start, reference, target, guess, &
                               predicted, work, error)
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> The problem on the coarser lattices, and their operators
    type(friction_problem_t), intent(in) :: coarse(:)
    type(operators_t), intent(inout) :: operators(:)
    !> State at the beginning of the step, in balance
    type(contact_state_t), intent(in) :: start
    !> Relative displacement s^n at the beginning of the step (n_col, n_row, 2) [m]
    real(wp), intent(in), contiguous :: reference(:, :, :)
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target
    !> State to start from: the old one with new tractions and motions, or unchanged if the coarse lattices do not help
    type(contact_state_t), intent(out) :: guess
    !> There is something better
    logical, intent(out) :: predicted
    !> Work, in applications of the full operator
    real(wp), intent(out) :: work
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    type(friction_problem_t) :: model
    type(contact_state_t) :: before, first, after
    type(load_target_t) :: coarse_target
    real(wp), allocatable :: origin(:, :, :), displacement(:, :, :)
    real(wp) :: coarser_work
    logical :: helped

    work = 0.0_wp
    predicted = .false.
    call copy_tractions(start, guess, problem%space)
    if (size(coarse) == 0) return
    model = coarse(1)
    call restrict_state(problem, start, model, before)
    if (model%space%count(before%pressure > 0.0_wp) < problem%options%multilevel%least_contact) return

    allocate (displacement(model%lattice%extent(1), model%lattice%extent(2), 3))
    operators(1)%flexibility%applications = 0.0_wp
    call model%displacements(operators(1)%flexibility, before%pressure, before%traction, displacement, error)
    if (allocated(error)) return
    work = operators(1)%flexibility%applications
    model%initial_gap = merge(before%gap + before%motion(normal) - displacement(:, :, 1), model%initial_gap, model%candidate)
    origin = displacement(:, :, 2:) - model%rigid_displacement(before%motion) &
             - (before%relative_displacement - restrict_vector(problem%lattice, reference, model%lattice))
    coarse_target = target
    where (target%control == force_control) coarse_target%value = before%load + (target%value - start%load)
    if (model%is_pressed(coarse_target)) then
      call predict(model, coarse(2:), operators(2:), before, origin, coarse_target, first, helped, coarser_work, error)
      if (allocated(error)) return
      work = work + coarser_work
      call solve_on_lattice(model, operators(1), first, origin, coarse_target, model%options%multilevel%change_tolerance, &
                            model%options%multilevel%change_sweeps, after, error)
      if (allocated(error)) return
      work = work + after%operator_applications
      predicted = after%converged
      if (predicted) call add_change(model, before, after, problem, guess)
    end if
    work = work*model%lattice%size()/problem%lattice%size()
  end subroutine predict

  !> Restrict a state to the coarse nodes.
  subroutine restrict_state(problem, fine, coarse_problem, coarse)
    type(friction_problem_t), intent(in) :: problem, coarse_problem
    type(contact_state_t), intent(in) :: fine
    type(contact_state_t), intent(out) :: coarse

    associate (from => problem%lattice, to => coarse_problem%lattice)
      call new_friction_state(coarse, to, coarse_problem%space)
      coarse%pressure = restrict_field(from, fine%pressure, to)
      coarse%gap = restrict_field(from, fine%gap, to)
      coarse%traction = restrict_vector(from, fine%traction, to)
      coarse%relative_displacement = restrict_vector(from, fine%relative_displacement, to)
    end associate
    coarse%motion = fine%motion
    coarse%load = coarse_problem%resultants(coarse%pressure, coarse%traction)
  end subroutine restrict_state

  !> Add the change of a coarse state to a fine one.
  subroutine add_change(coarse_problem, before, after, problem, state)
    type(friction_problem_t), intent(in) :: coarse_problem
    !> Coarse states
    type(contact_state_t), intent(in) :: before, after
    type(friction_problem_t), intent(in) :: problem
    !> Fine state: tractions and motions change
    type(contact_state_t), intent(inout) :: state
    real(wp), allocatable :: change(:, :), change_of_traction(:, :, :), slipping(:, :)
    real(wp), dimension(size(state%pressure, 1)) :: bound, length
    integer :: col, row

    allocate (change, mold=state%pressure)
    allocate (change_of_traction, mold=state%traction)
    call prolong(coarse_problem%lattice, after%pressure - before%pressure, problem%lattice, change, problem%space)
    call prolong_vector(coarse_problem%lattice, after%traction - before%traction, problem%lattice, change_of_traction, &
                        problem%space)
    allocate (slipping, mold=state%pressure)
    call prolong(coarse_problem%lattice, merge(1.0_wp, 0.0_wp, after%zone == slip), problem%lattice, slipping, &
                 problem%space)
    !$omp parallel do schedule(static) num_threads(problem%space%threads) private(col, bound, length)
    do row = 1, size(slipping, 2)
      do col = 1, size(slipping, 1)
        state%pressure(col, row) = merge(max(state%pressure(col, row) + change(col, row), 0.0_wp), 0.0_wp, &
                                         problem%candidate(col, row))
      end do
      call problem%friction%find_bounds((row - 1)*size(bound) + 1, state%pressure(:, row), bound)
      do col = 1, size(slipping, 1)
        if (state%pressure(col, row) <= 0.0_wp) then
          state%traction(col, row, :) = 0.0_wp
          cycle
        end if
        state%traction(col, row, :) = state%traction(col, row, :) + change_of_traction(col, row, :)
      end do
      ! what is interpolated between tractions on the cone lies inside, and would stick
      call problem%friction%find_lengths(state%traction(:, row, 1), state%traction(:, row, 2), length)
      do col = 1, size(slipping, 1)
        if (slipping(col, row) < 1.0_wp .or. state%pressure(col, row) <= 0.0_wp) cycle
        if (length(col) > 0.0_wp .and. length(col) < bound(col)) then
          state%traction(col, row, :) = state%traction(col, row, :)*(bound(col)/length(col))
        end if
      end do
    end do
    !$omp end parallel do
    state%motion = state%motion + (after%motion - before%motion)
  end subroutine add_change

end module hc_fas_predictor
