!> What a coarser lattice predicts of a load step.
module test_fas_predictor
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_field_space, only: field_space_t
  use hc_contact_state, only: contact_state_t, load_target_t, load_step_t, new_friction_state, slip, &
    force_control, displacement_control
  use hc_coulomb, only: coulomb_t
  use hc_contact_problem, only: friction_problem_t
  use hc_operator_set, only: operators_t, new_operators
  use hc_lattice_solver, only: solve_on_lattice
  use hc_fas_predictor, only: predict
  use hc_frictional_contact, only: frictional_contact_t
  use test_friction, only: new_sphere
  use testing, only: test_t, new_test, check, check_true, largest
  implicit none
  private

  public :: collect_fas_predictor

  integer, parameter :: f = force_control, d = displacement_control
  real(wp), parameter :: load = 4.0_wp/3.0_wp, mu = 0.3_wp

contains

  subroutine collect_fas_predictor(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('nothing_new', test_nothing_new), &
      new_test('change', test_change), &
      new_test('too_few_nodes', test_too_few_nodes), &
      new_test('astray', test_astray), &
      new_test('cold_start', test_cold_start) &
    ]
  end subroutine collect_fas_predictor

  !> A sphere that was pressed and pushed, and its coarser lattice.
  subroutine set_up(n, contact, state, coarse, operators, error)
    !> Nodes on each side of the apex
    integer, intent(in) :: n
    type(frictional_contact_t), intent(out) :: contact
    type(contact_state_t), intent(out) :: state
    type(friction_problem_t), intent(out) :: coarse(1)
    type(operators_t), intent(out) :: operators(1)
    type(error_t), allocatable, intent(out) :: error

    call new_sphere(contact, n, 0.4_wp, -0.2_wp, coulomb_t(mu), error, n_threads=1)
    if (allocated(error)) return
    call contact%problem%coarsen(coarse(1))
    call new_operators(operators(1), coarse(1)%lattice, coarse(1)%medium, field_space_t(), error)
    if (allocated(error)) return
    call new_friction_state(state, contact%problem%lattice)
    call go(contact, state, [f, f, f, d], [load, 0.0_wp, 0.0_wp, 0.0_wp], error)
    if (allocated(error)) return
    call go(contact, state, [f, f, f, d], [load, 0.5_wp*mu*load, 0.0_wp, 0.0_wp], error)
  end subroutine set_up

  !> One load step.
  subroutine go(contact, state, control, value, error)
    type(frictional_contact_t), intent(inout) :: contact
    type(contact_state_t), intent(inout) :: state
    integer, intent(in) :: control(4)
    real(wp), intent(in) :: value(4)
    type(error_t), allocatable, intent(out) :: error
    type(contact_state_t) :: next

    call contact%solve_step(state, state%relative_displacement, load_target_t(control, value), 1.0e-9_wp, 40, next, error)
    if (allocated(error)) return
    call check_true(error, next%converged, 'the step converges')
    state = next
  end subroutine go

  !> Under the loads that it carries already a state is its own prediction, driven by forces or by motions.
  subroutine test_nothing_new(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t), target :: state
    type(contact_state_t) :: guess
    type(friction_problem_t) :: coarse(1)
    type(operators_t) :: operators(1)
    type(load_target_t) :: target
    real(wp) :: p_max
    real(wp), allocatable :: estimate(:, :, :)
    integer :: i

    call set_up(24, contact, state, coarse, operators, error)
    if (allocated(error)) return
    p_max = maxval(state%pressure)
    do i = 1, 2
      if (i == 1) target = load_target_t([f, f, f, d], state%load)
      if (i == 2) target = load_target_t([d, d, d, d], state%motion)
      target%value(4) = 0.0_wp
      call predict(contact%problem, coarse, operators, state, load_step_t(target, state%relative_displacement), guess, error, &
                   estimate)
      if (allocated(error)) return
      call check_true(error, guess%converged, 'a prediction')
      if (allocated(error)) return
      call check(error, largest(guess%pressure - state%pressure), 0.0_wp, 1.0e-12_wp*p_max, 'pressure')
      if (allocated(error)) return
      call check(error, largest(guess%traction - state%traction), 0.0_wp, 1.0e-12_wp*p_max, 'shear traction')
      if (allocated(error)) return
      call check(error, guess%motion, state%motion, 1.0e-7_wp, 'motions')
      if (allocated(error)) return
      call check_true(error, guess%operator_applications > 0.8_wp .and. guess%operator_applications < 1.1_wp, &
                      'work, in applications on the fine lattice')
      if (allocated(error)) return
    end do
  end subroutine test_nothing_new

  !> Of the change of a step, mostly that at the fronts is left to be found; of the motions less than a hundredth.
  subroutine test_change(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t), target :: state
    type(contact_state_t) :: guess, after
    type(friction_problem_t) :: coarse(1)
    type(operators_t) :: operators(1), fine
    real(wp), parameter :: value(4, 3) = reshape([ &
      load, 0.6_wp*mu*load, 0.0_wp, 0.0_wp, &
      1.2_wp*load, 0.5_wp*mu*load, 0.0_wp, 0.0_wp, &
      load, 0.3_wp*mu*load, 0.1_wp*mu*load, 0.0_wp], [4, 3])
    real(wp), allocatable :: estimate(:, :, :), exact(:, :, :), old(:, :, :)
    integer :: i, inside

    call set_up(24, contact, state, coarse, operators, error)
    if (allocated(error)) return
    call new_operators(fine, contact%problem%lattice, contact%problem%medium, field_space_t(), error)
    if (allocated(error)) return
    allocate (exact(contact%problem%lattice%extent(1), contact%problem%lattice%extent(2), 3))
    allocate (old, mold=exact)
    call contact%problem%displacements(fine%flexibility, state%pressure, state%traction, old, error)
    if (allocated(error)) return
    do i = 1, 3
      after = state
      if (allocated(estimate)) deallocate (estimate)
      call go(contact, after, [f, f, f, d], value(:, i), error)
      if (allocated(error)) return
      call predict(contact%problem, coarse, operators, state, &
                   load_step_t(load_target_t([f, f, f, d], value(:, i)), state%relative_displacement), guess, error, estimate)
      if (allocated(error)) return
      call check_true(error, guess%converged, 'a prediction')
      if (allocated(error)) return
      call check_true(error, norm2(guess%traction - after%traction) < 0.58_wp*norm2(state%traction - after%traction), &
                      'shear traction')
      if (allocated(error)) return
      call check_true(error, norm2(guess%motion - after%motion) < 0.01_wp*norm2(state%motion - after%motion), 'motions')
      if (allocated(error)) return
      ! interpolated, not multiplied
      call contact%problem%displacements(fine%flexibility, guess%pressure, guess%traction, exact, error)
      if (allocated(error)) return
      call check_true(error, norm2(estimate - exact) < 0.03_wp*norm2(old - exact), 'displacements')
      if (allocated(error)) return
      if (i > 1) cycle
      ! where the slip zone only grows
      inside = count(after%zone == slip .and. &
                     hypot(guess%traction(:, :, 1), guess%traction(:, :, 2)) < 0.999_wp*mu*guess%pressure)
      call check_true(error, inside < 0.042_wp*count(after%zone == slip), 'slip on the cone')
      if (allocated(error)) return
    end do
  end subroutine test_change

  !> A few nodes predict nothing: the state itself is the start, at no cost.
  subroutine test_too_few_nodes(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t), target :: state
    type(contact_state_t) :: guess
    type(friction_problem_t) :: coarse(1)
    type(operators_t) :: operators(1)
    real(wp), allocatable :: estimate(:, :, :)

    call set_up(10, contact, state, coarse, operators, error)
    if (allocated(error)) return
    call predict(contact%problem, coarse, operators, state, &
                 load_step_t(load_target_t([f, f, f, d], [load, 0.0_wp, 0.0_wp, 0.0_wp]), state%relative_displacement), guess, &
                 error, estimate)
    if (allocated(error)) return
    call check_true(error, .not. (guess%converged .or. guess%operator_applications > 0.0_wp), 'no prediction')
    if (allocated(error)) return
    call check(error, largest(guess%traction - state%traction), 0.0_wp, 0.0_wp, 'the old state')
  end subroutine test_too_few_nodes

  !> A step that does not converge from its prediction starts once more from the old state, and the work counts twice.
  subroutine test_astray(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t), target :: state
    type(contact_state_t) :: next, alone
    type(friction_problem_t) :: coarse(1)
    type(operators_t) :: operators(1)
    type(load_target_t) :: target
    real(wp), parameter :: unreachable = 1.0e-30_wp

    call set_up(24, contact, state, coarse, operators, error)
    if (allocated(error)) return
    target = load_target_t([f, f, f, d], [load, 0.7_wp*mu*load, 0.0_wp, 0.0_wp])
    call contact%solve_step(state, state%relative_displacement, target, unreachable, 1, next, error)
    if (allocated(error)) return
    call new_operators(operators(1), contact%problem%lattice, contact%problem%medium, field_space_t(), error)
    if (allocated(error)) return
    call solve_on_lattice(contact%problem, operators(1), state, &
                          load_step_t(target, state%relative_displacement, unreachable, 1), alone, error)
    if (allocated(error)) return
    call check_true(error, .not. next%converged, 'one sweep is not enough')
    if (allocated(error)) return
    call check(error, next%sweeps, 2*alone%sweeps, 'sweeps from both starts')
    if (allocated(error)) return
    call check_true(error, next%operator_applications > 1.5_wp*alone%operator_applications, 'work from both starts')
    if (allocated(error)) return
    call check(error, maxval(abs(next%traction - alone%traction)), 0.0_wp, 0.0_wp, 'the state is that from the old one')
  end subroutine test_astray

  !> Without an earlier state the coarser lattices, here two, give a start that saves work; the answer is the same.
  subroutine test_cold_start(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t), target :: virgin
    type(contact_state_t) :: cold, alone
    type(operators_t) :: operators
    type(load_target_t) :: target

    call new_sphere(contact, 40, 0.4_wp, -0.2_wp, coulomb_t(mu), error, n_threads=1)
    if (allocated(error)) return
    call new_friction_state(virgin, contact%problem%lattice)
    target = load_target_t([f, f, f, d], [load, 0.4_wp*mu*load, 0.2_wp*mu*load, 0.0_wp])
    call contact%solve_step(virgin, virgin%relative_displacement, target, 1.0e-9_wp, 60, cold, error)
    if (allocated(error)) return
    call new_operators(operators, contact%problem%lattice, contact%problem%medium, field_space_t(), error)
    if (allocated(error)) return
    call solve_on_lattice(contact%problem, operators, virgin, &
                          load_step_t(target, virgin%relative_displacement, 1.0e-9_wp, 60), alone, error)
    if (allocated(error)) return
    call check_true(error, cold%converged .and. alone%converged, 'converged')
    if (allocated(error)) return
    call check(error, maxval(abs(cold%traction - alone%traction)), 0.0_wp, 1.0e-7_wp*mu, 'same traction')
    if (allocated(error)) return
    call check(error, cold%motion, alone%motion, 1.0e-8_wp, 'same motions')
    if (allocated(error)) return
    ! measured: 0.60
    call check_true(error, cold%operator_applications < 0.8_wp*alone%operator_applications, 'less work')
  end subroutine test_cold_start

end module test_fas_predictor
