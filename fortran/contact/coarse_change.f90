!> Contribution of a coarser lattice to a load step: the change that it finds, or an initial guess.
!>
!> The coarse problem is set up so that the present fine state, at the coarse
!> nodes, solves it exactly under the present loads: the error of the displacements
!> by the coarse tractions is added to the initial gap and to the relative
!> displacement at the beginning of the step,
!>
!>     h_c = g + approach - w_c,     s_c = u_c - shift - twist x r - (s - s^n).
!>
!> Under the new loads (full approximation scheme, Brandt, Math. Comput. 31, 1977) the change of its
!> tractions and motions is added to the fine ones. Nodes between coarse ones that slip are put onto the cone.
!>
!> Equations: docs/theory/multilevel.md, (M1).
module hc_coarse_change
  use hc_precision, only: wp, zk
  use hc_hierarchy, only: coarse_rows_t
  use hc_contact_state, only: contact_state_t, load_target_t, load_step_t, slip, normal, force_control
  use hc_contact_problem, only: friction_problem_t
  use hc_transfer, only: prolong, prolong_edge, prolong_shear
  implicit none
  private

  public :: restrict_state, restricted, balance, add_change, add_displacement, find_displacements, &
            prolong_state, prolong_displacement

contains

  !> Restrict a state to the coarse nodes, whose law of friction begins a step there.
  subroutine restrict_state(problem, fine, coarse_problem, coarse)
    type(friction_problem_t), intent(in) :: problem
    type(friction_problem_t), intent(inout) :: coarse_problem
    type(contact_state_t), intent(in) :: fine
    type(contact_state_t), intent(out) :: coarse

    real(wp), allocatable :: zone(:, :)

    call problem%restrict(fine%pressure, coarse_problem, coarse%pressure)
    call problem%restrict(fine%gap, coarse_problem, coarse%gap)
    call problem%restrict(real(fine%zone, wp), coarse_problem, zone)
    coarse%zone = nint(zone, zk)
    coarse%traction = restricted(problem, fine%traction, coarse_problem)
    coarse%relative_displacement = restricted(problem, fine%relative_displacement, coarse_problem)
    call coarse_problem%friction%begin_step(coarse%zone)
    coarse%motion = fine%motion
    coarse%load = coarse_problem%resultants(coarse%pressure, coarse%traction)
  end subroutine restrict_state

  !> Return the values of all components of a field at the coarse nodes.
  function restricted(problem, field, coarse_problem) result(values)
    type(friction_problem_t), intent(in) :: problem, coarse_problem
    !> Field (n_col, own rows, number of components)
    real(wp), intent(in), contiguous :: field(:, :, :)
    !> Field of the coarse lattice
    real(wp), allocatable :: values(:, :, :)
    real(wp), allocatable :: component(:, :)
    integer :: m

    allocate (values(coarse_problem%lattice%extent(1), coarse_problem%own_rows(), size(field, 3)))
    do m = 1, size(field, 3)
      call problem%restrict(field(:, :, m), coarse_problem, component)
      values(:, :, m) = component
    end do
  end function restricted

  !> Interpolate a field to the nodes of the finer lattice on this rank.
  subroutine prolong_field(coarse_problem, coarse, problem, fine, beyond)
    type(friction_problem_t), intent(in) :: coarse_problem, problem
    !> Field (n_col, own rows of the coarse lattice), and that of the finer one
    real(wp), intent(in), contiguous, target :: coarse(:, :)
    real(wp), intent(out), contiguous :: fine(:, :)
    !> Beyond the coarse window there are the values at its rim; default: zero
    logical, intent(in), optional :: beyond
    type(coarse_rows_t) :: below
    real(wp), allocatable, target :: own(:, :)
    real(wp), pointer, contiguous :: rows(:, :)

    below = coarse_problem%rows_below(problem)
    call coarse_problem%take_below(below, coarse, own, rows)
    call prolong(below%rows, rows, below%fine, fine, problem%space, beyond)
  end subroutine prolong_field

  !> Set the coarse problem up so that the present state solves it under the present loads.
  subroutine balance(problem, start, step, before, displacement, model, origin, coarse_target)
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> State at the beginning of the step, in balance
    type(contact_state_t), intent(in) :: start
    !> The load step
    type(load_step_t), intent(in) :: step
    !> That state at the coarse nodes, and w, u_x, u_y there under its tractions (n_col, n_row, 3) [m]
    type(contact_state_t), intent(in) :: before
    real(wp), intent(in) :: displacement(:, :, :)
    !> The problem on the coarse lattice: its initial gap changes
    type(friction_problem_t), intent(inout) :: model
    !> Relative displacement at the beginning of its step (n_col, n_row, 2) [m]
    real(wp), allocatable, intent(out) :: origin(:, :, :)
    !> Its loads or motions
    type(load_target_t), intent(out) :: coarse_target

    model%initial_gap = merge(before%gap + before%motion(normal) - displacement(:, :, 1), model%initial_gap, model%candidate)
    origin = displacement(:, :, 2:) - model%rigid_displacement(before%motion) &
             - (before%relative_displacement - restricted(problem, step%reference, model))
    coarse_target = step%target
    where (coarse_target%control == force_control) coarse_target%value = before%load + (coarse_target%value - start%load)
  end subroutine balance

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
    integer :: col, row, m

    allocate (change, mold=state%pressure)
    allocate (change_of_traction, mold=state%traction)
    call prolong_field(coarse_problem, after%pressure - before%pressure, problem, change)
    do m = 1, size(change_of_traction, 3)
      call prolong_field(coarse_problem, after%traction(:, :, m) - before%traction(:, :, m), problem, change_of_traction(:, :, m))
    end do
    allocate (slipping, mold=state%pressure)
    call prolong_field(coarse_problem, merge(1.0_wp, 0.0_wp, after%zone == slip), problem, slipping)
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
      ! tractions interpolated between those on the cone lie inside it, and would stick
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

  !> Add the change of coarse displacements to fine ones, by interpolation.
  subroutine add_displacement(coarse_problem, moved, problem, displacement)
    type(friction_problem_t), intent(in) :: coarse_problem, problem
    !> Change of w, u_x, u_y at the coarse nodes (n_col, n_row, 3) [m]
    real(wp), intent(in), contiguous :: moved(:, :, :)
    !> Fine ones
    real(wp), intent(inout) :: displacement(:, :, :)
    real(wp), allocatable :: change(:, :)
    integer :: m

    ! one by one: a window is too large for copies
    allocate (change(size(displacement, 1), size(displacement, 2)))
    do m = 1, size(displacement, 3)
      call prolong_field(coarse_problem, moved(:, :, m), problem, change, beyond=.true.)
      displacement(:, :, m) = displacement(:, :, m) + change
    end do
  end subroutine add_displacement

  !> Prolong displacements: smooth ones, that do not end with the window.
  subroutine prolong_displacement(coarse_problem, coarse, problem, fine)
    type(friction_problem_t), intent(in) :: coarse_problem, problem
    !> w, u_x, u_y (n_col, n_row, 3) [m]
    real(wp), intent(in), contiguous :: coarse(:, :, :)
    real(wp), intent(out), contiguous :: fine(:, :, :)
    integer :: m

    do m = 1, size(fine, 3)
      call prolong_field(coarse_problem, coarse(:, :, m), problem, fine(:, :, m), beyond=.true.)
    end do
  end subroutine prolong_displacement

  !> Find the displacements of a state that was solved for, from its gap and relative displacement.
  subroutine find_displacements(problem, state, displacement)
    type(friction_problem_t), intent(in) :: problem
    type(contact_state_t), intent(in) :: state
    !> w, u_x, u_y (n_col, n_row, 3) [m]
    real(wp), allocatable, intent(out) :: displacement(:, :, :)
    real(wp) :: remote(problem%lattice%extent(1), 2)
    integer :: row

    allocate (displacement(problem%lattice%extent(1), problem%own_rows(), 3))
    !$omp parallel do schedule(static) num_threads(problem%space%threads) private(remote)
    do row = 1, size(displacement, 2)
      call problem%rigid_displacement_row(state%motion, row, remote(:, 1), remote(:, 2))
      displacement(:, row, 1) = 0.0_wp
      where (problem%candidate(:, row)) displacement(:, row, 1) = state%gap(:, row) + state%motion(normal) &
                                                                  - problem%initial_gap(:, row)
      displacement(:, row, 2:) = state%relative_displacement(:, row, :) + remote
    end do
    !$omp end parallel do
  end subroutine find_displacements

  !> Prolong tractions and motions of a coarse state, to start on the finer lattice.
  subroutine prolong_state(coarse_problem, coarse, problem, state)
    type(friction_problem_t), intent(in) :: coarse_problem
    type(contact_state_t), intent(in), target :: coarse
    type(friction_problem_t), intent(in) :: problem
    type(contact_state_t), intent(inout) :: state
    type(coarse_rows_t) :: below
    real(wp), allocatable, target :: own(:, :), own_component(:, :), own_traction(:, :, :)
    real(wp), pointer, contiguous :: pressure(:, :), component(:, :), traction(:, :, :)
    integer :: m

    if (any(shape(coarse%pressure) /= coarse_problem%own_extent())) return
    if (.not. all(abs(coarse%load) <= huge(1.0_wp))) return
    below = coarse_problem%rows_below(problem)
    call coarse_problem%take_below(below, coarse%pressure, own, pressure)
    traction => coarse%traction
    if (problem%space%ranks%size > 1) then
      allocate (own_traction(size(pressure, 1), size(pressure, 2), 2))
      do m = 1, 2
        call coarse_problem%take_below(below, coarse%traction(:, :, m), own_component, component)
        own_traction(:, :, m) = component
      end do
      traction => own_traction
    end if
    call prolong_edge(below%rows, pressure, below%fine, state%pressure, problem%space)
    call prolong_shear(below%rows, pressure, traction, below%fine, state%pressure, state%traction, problem%space)
    state%motion = coarse%motion
  end subroutine prolong_state

end module hc_coarse_change
