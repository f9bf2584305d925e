!> What no public procedure may take: each is answered by an error, none by a solution or a loop without end.
module test_arguments
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan, ieee_positive_inf
  use hc_precision, only: wp
  use hc_error, only: error_t, status
  use hc_lattice, only: lattice_t, new_lattice, equilateral_basis
  use hc_field_space, only: field_space_t
  use hc_elastic_pair, only: elastic_pair_t
  use hc_flexibility_dense, only: dense_flexibility_t, new_dense_flexibility
  use hc_flexibility_fft, only: fft_flexibility_t, new_fft_flexibility
  use hc_contact_state, only: contact_state_t, new_friction_state, load_target_t, force_control, displacement_control, normal, &
    within_tolerance, sweeps_used_up
  use hc_contact_residuals, only: normal_residual, force_residual
  use hc_coulomb, only: coulomb_t
  use hc_contact_problem, only: friction_problem_t, new_friction_problem
  use hc_normal_contact, only: normal_contact_t, new_normal_contact
  use hc_direct_contact, only: direct_contact_t, new_direct_contact
  use hc_subwindow_solver, only: windowed_friction_t, new_windowed_friction
  use hc_direct_friction, only: direct_friction_t, new_direct_friction
  use hc_load_path, only: advance, step_settings_t
  use testing, only: test_t, new_test, check, check_true, check_raised
  implicit none
  private

  public :: collect_arguments

  !> Nodes on each side of the apex, and of a row.
  integer, parameter :: n = 6, side = 2*n + 1
  type(elastic_pair_t), parameter :: pair = elastic_pair_t(1.0_wp, 0.1_wp, 0.4_wp)

contains

  subroutine collect_arguments(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('lattices', test_lattices), &
      new_test('pairs', test_pairs), &
      new_test('gaps', test_gaps), &
      new_test('threads', test_threads), &
      new_test('friction', test_friction), &
      new_test('targets', test_targets), &
      new_test('steps', test_steps), &
      new_test('states', test_states), &
      new_test('not_finite', test_not_finite), &
      new_test('any_tolerance', test_any_tolerance), &
      new_test('clipped', test_clipped), &
      new_test('no_load', test_no_load), &
      new_test('reasons', test_reasons) &
    ]
  end subroutine collect_arguments

  !> NaN and infinity: functions, since a constant of them would be trapped.
  function odd_numbers() result(odd)
    real(wp) :: odd(3)

    odd(1) = ieee_value(1.0_wp, ieee_quiet_nan)
    odd(2) = ieee_value(1.0_wp, ieee_positive_inf)
    odd(3) = -odd(2)
  end function odd_numbers

  !> A paraboloid; the contact of a load of 0.05 fits into the window, of 2 it does not.
  subroutine paraboloid(lattice, gap, candidate, error)
    type(lattice_t), intent(out) :: lattice
    real(wp), intent(out) :: gap(side, side)
    logical, intent(out) :: candidate(side, side)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: x(side, side), y(side, side)

    call new_lattice(lattice, equilateral_basis(1.0_wp/n), [-n, -n], [side, side], error)
    if (allocated(error)) return
    call lattice%coordinates(x, y)
    gap = 0.5_wp*(x**2 + y**2)
    candidate = .true.
  end subroutine paraboloid

  !> Basis, origin and window.
  subroutine test_lattices(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: caught
    type(lattice_t) :: lattice
    type(fft_flexibility_t) :: fft
    type(dense_flexibility_t) :: dense
    real(wp) :: basis(2, 2), odd(3)
    integer :: i

    odd = odd_numbers()
    do i = 1, 3
      basis = equilateral_basis(1.0_wp)
      basis(1, 2) = odd(i)
      call new_lattice(lattice, basis, [0, 0], [3, 3], caught)
      call check_raised(error, caught, status%invalid_input, 'a basis that is not finite')
      if (allocated(error)) return
      call new_lattice(lattice, equilateral_basis(1.0_wp), [0, 0], [3, 3], caught, origin=[0.0_wp, odd(i)])
      call check_raised(error, caught, status%invalid_input, 'an origin that is not finite')
      if (allocated(error)) return
    end do
    call new_lattice(lattice, equilateral_basis(1.0_wp), [0, 0], [3, 0], caught)
    call check_raised(error, caught, status%invalid_input, 'no row')
    if (allocated(error)) return
    call new_lattice(lattice, equilateral_basis(1.0_wp), [0, 0], [100000, 100000], caught)
    call check_raised(error, caught, status%invalid_input, 'more nodes than integers')
    if (allocated(error)) return
    call new_lattice(lattice, equilateral_basis(1.0_wp), [0, -huge(1)], [3, 3], caught)
    call check_raised(error, caught, status%invalid_input, 'indices out of range')
    if (allocated(error)) return
    ! a window that was never set up
    call new_fft_flexibility(fft, lattice_t(), pair, caught)
    call check_raised(error, caught, status%invalid_input, 'convolutions without a window')
    if (allocated(error)) return
    call new_dense_flexibility(dense, lattice_t(extent=[3, 3]), pair, caught)
    call check_raised(error, caught, status%invalid_input, 'a matrix without a basis')
    if (allocated(error)) return
    lattice = lattice_t(equilateral_basis(1.0_wp), extent=[4, 3], periodic=[.true., .true.])
    call new_dense_flexibility(dense, lattice, pair, caught)
    call check_raised(error, caught, status%invalid_input, 'a matrix of a window that repeats')
    if (allocated(error)) return
    call new_lattice(lattice, equilateral_basis(1.0_wp), [0, 0], [40000, 12000], caught)
    call check_true(error, .not. allocated(caught), 'as many nodes as integers')
    if (allocated(error)) return
    call new_dense_flexibility(dense, lattice, pair, caught)
    call check_raised(error, caught, status%resources, 'a matrix beyond all memory')
  end subroutine test_lattices

  !> Constants that were not made by new_elastic_pair.
  subroutine test_pairs(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: caught
    type(lattice_t) :: lattice
    type(normal_contact_t) :: contact
    type(direct_contact_t) :: direct
    type(friction_problem_t) :: problem
    type(fft_flexibility_t) :: fft
    type(elastic_pair_t) :: wrong(12)
    real(wp) :: gap(side, side), odd(3)
    logical :: candidate(side, side)
    integer :: i

    odd = odd_numbers()
    do i = 1, 3
      wrong(i) = elastic_pair_t(odd(i), 0.0_wp, 0.0_wp)
      wrong(3 + i) = elastic_pair_t(1.0_wp, odd(i), 0.0_wp)
      wrong(6 + i) = elastic_pair_t(1.0_wp, 0.0_wp, odd(i))
    end do
    wrong(10:) = [elastic_pair_t(), elastic_pair_t(-1.0_wp, 0.0_wp, 0.0_wp), elastic_pair_t(1.0_wp, 1.5_wp, -2.0_wp)]
    call paraboloid(lattice, gap, candidate, error)
    if (allocated(error)) return
    do i = 1, size(wrong)
      call new_normal_contact(contact, lattice, wrong(i), gap, candidate, caught)
      call check_raised(error, caught, status%invalid_input, 'convolutions without friction')
      if (allocated(error)) return
      call new_direct_contact(direct, lattice, wrong(i), gap, candidate, caught)
      call check_raised(error, caught, status%invalid_input, 'a matrix without friction')
      if (allocated(error)) return
      call new_friction_problem(problem, lattice, wrong(i), gap, candidate, coulomb_t(0.3_wp), .false., caught)
      call check_raised(error, caught, status%invalid_input, 'friction')
      if (allocated(error)) return
      call new_fft_flexibility(fft, lattice, wrong(i), caught)
      call check_raised(error, caught, status%invalid_input, 'an operator')
      if (allocated(error)) return
    end do
  end subroutine test_pairs

  !> A gap that is not finite may only stand where nothing can touch.
  subroutine test_gaps(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: caught
    type(lattice_t) :: lattice
    type(normal_contact_t) :: contact
    type(direct_contact_t) :: direct
    type(friction_problem_t) :: problem
    type(contact_state_t) :: state
    real(wp) :: gap(side, side), odd(3)
    logical :: candidate(side, side)
    integer :: i

    odd = odd_numbers()
    do i = 1, 3
      call paraboloid(lattice, gap, candidate, error)
      if (allocated(error)) return
      gap(2, 3) = odd(i)
      call new_normal_contact(contact, lattice, pair, gap, candidate, caught)
      call check_raised(error, caught, status%invalid_input, 'convolutions without friction')
      if (allocated(error)) return
      call new_direct_contact(direct, lattice, pair, gap, candidate, caught)
      call check_raised(error, caught, status%invalid_input, 'a matrix without friction')
      if (allocated(error)) return
      call new_friction_problem(problem, lattice, pair, gap, candidate, coulomb_t(0.3_wp), .false., caught)
      call check_raised(error, caught, status%invalid_input, 'friction')
      if (allocated(error)) return
    end do
    gap(2, 3) = odd(2)
    candidate(2, 3) = .false.
    call new_normal_contact(contact, lattice, pair, gap, candidate, error)
    if (allocated(error)) return
    call contact%solve(force_control, 0.05_wp, 1.0e-8_wp, 60, state, error)
    if (allocated(error)) return
    call check_true(error, state%converged, 'an infinite gap where nothing can touch')
  end subroutine test_gaps

  !> A number of threads that no machine has.
  subroutine test_threads(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: caught
    type(lattice_t) :: lattice
    type(normal_contact_t) :: contact
    type(friction_problem_t) :: problem
    type(windowed_friction_t) :: windowed
    real(wp) :: gap(side, side)
    logical :: candidate(side, side)
    integer :: i
    integer, parameter :: wrong(3) = [-1, 1000000, huge(1)]

    call paraboloid(lattice, gap, candidate, error)
    if (allocated(error)) return
    call new_friction_problem(problem, lattice, pair, gap, candidate, coulomb_t(0.3_wp), .false., error)
    if (allocated(error)) return
    do i = 1, size(wrong)
      call new_normal_contact(contact, lattice, pair, gap, candidate, caught, n_threads=wrong(i))
      call check_raised(error, caught, status%invalid_input, 'without friction')
      if (allocated(error)) return
      call new_windowed_friction(windowed, problem, caught, n_threads=wrong(i))
      call check_raised(error, caught, status%invalid_input, 'with friction')
      if (allocated(error)) return
    end do
  end subroutine test_threads

  !> Coefficients of friction.
  subroutine test_friction(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: caught
    type(lattice_t) :: lattice
    type(friction_problem_t) :: problem
    real(wp) :: gap(side, side), wrong(4)
    logical :: candidate(side, side)
    integer :: i

    wrong = [odd_numbers(), -0.1_wp]
    call paraboloid(lattice, gap, candidate, error)
    if (allocated(error)) return
    do i = 1, size(wrong)
      call new_friction_problem(problem, lattice, pair, gap, candidate, coulomb_t(wrong(i)), .false., caught)
      call check_raised(error, caught, status%invalid_input, 'coefficient of friction')
      if (allocated(error)) return
    end do
    call new_friction_problem(problem, lattice, pair, gap, candidate, coulomb_t(odd_number_without_meaning(), .true.), .false., &
                              error)
  contains
    real(wp) function odd_number_without_meaning()
      odd_number_without_meaning = ieee_value(1.0_wp, ieee_quiet_nan)
    end function odd_number_without_meaning
  end subroutine test_friction

  !> Loads, tolerances and sweeps of both frictionless solvers.
  subroutine test_targets(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: caught
    type(lattice_t) :: lattice
    type(normal_contact_t) :: contact
    type(direct_contact_t) :: direct
    type(contact_state_t) :: state
    real(wp) :: gap(side, side), value(11), tolerance(11)
    logical :: candidate(side, side)
    integer :: i, control(11), sweeps(11)

    control = force_control
    value = 0.05_wp
    tolerance = 1.0e-8_wp
    sweeps = 60
    control(1:2) = [0, 3]
    value(3:6) = [odd_numbers(), -1.0_wp]
    tolerance(7:9) = [ieee_value(1.0_wp, ieee_quiet_nan), 0.0_wp, 1.0_wp]
    sweeps(10:11) = [0, -1]
    call paraboloid(lattice, gap, candidate, error)
    if (allocated(error)) return
    call new_normal_contact(contact, lattice, pair, gap, candidate, error)
    if (allocated(error)) return
    call new_direct_contact(direct, lattice, pair, gap, candidate, error)
    if (allocated(error)) return
    do i = 1, size(value)
      call contact%solve(control(i), value(i), tolerance(i), sweeps(i), state, caught)
      call check_raised(error, caught, status%invalid_input, 'target by convolutions')
      if (allocated(error)) return
      call direct%solve(control(i), value(i), tolerance(i), sweeps(i), state, caught)
      call check_raised(error, caught, status%invalid_input, 'target by a matrix')
      if (allocated(error)) return
    end do
    call direct%solve(force_control, 0.05_wp, 1.0e-8_wp, 60, state, caught, start=candidate(2:, :))
    call check_raised(error, caught, status%invalid_input, 'an area of another shape')
  end subroutine test_targets

  !> Loads, tolerances, sweeps and cuts of a load step with friction.
  subroutine test_steps(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: caught
    type(direct_friction_t) :: contact
    type(contact_state_t) :: state, next
    type(load_target_t) :: target(10)
    real(wp) :: tolerance(10), odd(3)
    integer :: i, sweeps(10), cuts(10)

    odd = odd_numbers()
    target%value(normal) = 0.05_wp
    tolerance = 1.0e-8_wp
    sweeps = 40
    cuts = 6
    target(1)%control(2) = 3
    do i = 1, 3
      target(1 + i)%value(i) = odd(i)
    end do
    target(5)%value(normal) = -1.0_wp
    tolerance(6:8) = [odd(1), 0.0_wp, -1.0_wp]
    sweeps(9) = 0
    cuts(10) = -1
    call small_contact(contact, state, error)
    if (allocated(error)) return
    do i = 1, size(target)
      call advance(contact, state, target(i), step_settings_t(tolerance(i), sweeps(i), cuts(i)), next, caught)
      call check_raised(error, caught, status%invalid_input, 'target of a step')
      if (allocated(error)) return
    end do
  end subroutine test_steps

  !> A frictional contact, before the first load.
  subroutine small_contact(contact, state, error)
    type(direct_friction_t), intent(out) :: contact
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem
    type(lattice_t) :: lattice
    real(wp) :: gap(side, side)
    logical :: candidate(side, side)

    call paraboloid(lattice, gap, candidate, error)
    if (allocated(error)) return
    call new_friction_problem(problem, lattice, pair, gap, candidate, coulomb_t(0.3_wp), .false., error)
    if (allocated(error)) return
    call new_direct_friction(contact, problem, error)
    call new_friction_state(state, lattice)
  end subroutine small_contact

  !> States that a step cannot start from.
  subroutine test_states(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: caught
    type(direct_friction_t) :: contact
    type(contact_state_t) :: virgin, state, next
    type(load_target_t) :: target
    real(wp) :: odd(3)
    integer :: i

    odd = odd_numbers()
    target%value(normal) = 0.05_wp
    call small_contact(contact, virgin, error)
    if (allocated(error)) return
    do i = 1, 6
      state = virgin
      select case (i)
      case (1)
        state%pressure(3, 3) = odd(1)
      case (2)
        state%relative_displacement(3, 3, 2) = odd(2)
      case (3)
        state%traction(3, 3, 1) = odd(3)
      case (4)
        state%motion(2) = odd(1)
      case (5)
        deallocate (state%traction)
      case default
        state%pressure = virgin%pressure(2:, :)
      end select
      call advance(contact, state, target, step_settings_t(), next, caught)
      call check_raised(error, caught, status%invalid_input, 'initial state')
      if (allocated(error)) return
    end do
  end subroutine test_states

  !> A residual never hides a number that is not finite.
  subroutine test_not_finite(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: pressure(9, 3), gap(9, 3), odd(3)
    logical :: candidate(9, 3)
    integer :: i

    odd = odd_numbers()
    candidate = .true.
    candidate(9, 3) = .false.
    do i = 1, 3
      pressure = 0.0_wp
      pressure(2, 2) = 1.0_wp
      gap = 0.0_wp
      gap(9, 3) = odd(i)
      call check(error, normal_residual(pressure, gap, candidate, 1.0_wp, field_space_t()), 0.0_wp, 0.0_wp, &
                 'where nothing can touch')
      if (allocated(error)) return
      gap(4, 1) = odd(i)
      call check_true(error, normal_residual(pressure, gap, candidate, 1.0_wp, field_space_t()) >= huge(1.0_wp), 'gap')
      if (allocated(error)) return
      gap(4, 1) = 0.0_wp
      pressure(8, 1) = odd(i)
      call check_true(error, normal_residual(pressure, gap, candidate, 1.0_wp, field_space_t()) >= huge(1.0_wp), 'pressure')
      if (allocated(error)) return
    end do
  end subroutine test_not_finite

  !> A tolerance that rounding errors exceed: the iteration ends, with a solution that is as good as it gets.
  subroutine test_any_tolerance(error)
    type(error_t), allocatable, intent(out) :: error
    ! a tolerance below rounding errors is never met: residuals of the last of 60 iterations are 1e-16 to 8e-9, by compiler and FFT
    real(wp), parameter :: as_good = 1.0e-7_wp
    type(lattice_t) :: lattice
    type(normal_contact_t) :: contact
    type(contact_state_t) :: state
    real(wp) :: gap(side, side)
    logical :: candidate(side, side)
    integer :: i

    call paraboloid(lattice, gap, candidate, error)
    if (allocated(error)) return
    ! a few pillars, whose gaps and load come out as zero or nearly so
    gap = 0.0_wp
    candidate = .false.
    do i = 0, 4
      candidate(1 + modulo(5*i, side), 1 + modulo(7*i*i, side)) = .true.
    end do
    call new_normal_contact(contact, lattice, pair, gap, candidate, error)
    if (allocated(error)) return
    do i = 1, 60
      call contact%solve(force_control, 0.05_wp*1.37_wp**i, 5.0e-16_wp, 60, state, error)
      if (allocated(error)) return
      call check(error, max(state%residual_normal, state%residual_force), 0.0_wp, as_good, 'as good as it gets')
      if (allocated(error)) return
    end do
  end subroutine test_any_tolerance

  !> Contact at the rim of the window is flagged by every solver.
  subroutine test_clipped(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(normal_contact_t) :: contact
    type(direct_contact_t) :: direct
    type(direct_friction_t) :: friction
    type(contact_state_t) :: state, virgin
    type(load_target_t) :: target
    real(wp) :: gap(side, side), load
    logical :: candidate(side, side), clipped
    integer :: i

    call paraboloid(lattice, gap, candidate, error)
    if (allocated(error)) return
    call new_normal_contact(contact, lattice, pair, gap, candidate, error)
    if (allocated(error)) return
    call new_direct_contact(direct, lattice, pair, gap, candidate, error)
    if (allocated(error)) return
    call small_contact(friction, virgin, error)
    if (allocated(error)) return
    do i = 1, 2
      clipped = i == 2
      load = merge(2.0_wp, 0.05_wp, clipped)
      call contact%solve(force_control, load, 1.0e-8_wp, 60, state, error)
      if (allocated(error)) return
      call check_true(error, state%converged .and. (state%clipped .eqv. clipped), 'convolutions without friction')
      if (allocated(error)) return
      call direct%solve(force_control, load, 1.0e-8_wp, 60, state, error)
      if (allocated(error)) return
      call check_true(error, state%converged .and. (state%clipped .eqv. clipped), 'a matrix without friction')
      if (allocated(error)) return
      target%value(normal) = load
      call advance(friction, virgin, target, step_settings_t(1.0e-8_wp, 60, 6), state, error)
      if (allocated(error)) return
      call check_true(error, state%clipped .eqv. clipped, 'friction')
      if (allocated(error)) return
    end do
  end subroutine test_clipped

  !> Without a load the residual of the load is no force: any pressure at all is as wrong as a load that is not carried.
  subroutine test_no_load(error)
    type(error_t), allocatable, intent(out) :: error

    call check(error, force_residual([0.0_wp, 1.0e-9_wp, 1.0e9_wp], 0.0_wp), [0.0_wp, 1.0_wp, 1.0_wp], 0.0_wp, 'no load')
    if (allocated(error)) return
    call check(error, force_residual(0.0_wp, 5.0_wp), 1.0_wp, 0.0_wp, 'a load that is not carried')
  end subroutine test_no_load

  !> Solvers say why they stopped.
  subroutine test_reasons(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(normal_contact_t) :: contact
    type(direct_contact_t) :: direct
    type(direct_friction_t) :: friction
    type(contact_state_t) :: state(6), virgin
    type(load_target_t) :: target
    real(wp) :: gap(side, side)
    logical :: candidate(side, side)

    call paraboloid(lattice, gap, candidate, error)
    if (allocated(error)) return
    call new_normal_contact(contact, lattice, pair, gap, candidate, error)
    if (allocated(error)) return
    call new_direct_contact(direct, lattice, pair, gap, candidate, error)
    if (allocated(error)) return
    call small_contact(friction, virgin, error)
    if (allocated(error)) return
    target%value(normal) = 0.05_wp
    call contact%solve(displacement_control, 0.05_wp, 1.0e-8_wp, 60, state(1), error)
    if (.not. allocated(error)) call direct%solve(force_control, 0.05_wp, 1.0e-8_wp, 60, state(2), error)
    if (.not. allocated(error)) call advance(friction, virgin, target, step_settings_t(1.0e-8_wp, 60, 0), state(3), error)
    if (.not. allocated(error)) call contact%solve(force_control, 0.05_wp, 1.0e-12_wp, 1, state(4), error)
    if (.not. allocated(error)) call direct%solve(force_control, 0.05_wp, 1.0e-8_wp, 1, state(5), error)
    if (.not. allocated(error)) call advance(friction, virgin, target, step_settings_t(1.0e-8_wp, 1, 0), state(6), error)
    if (allocated(error)) return
    call check_true(error, all(state(:3)%converged) .and. .not. any(state(4:)%converged), 'three that converge, three that do not')
    if (allocated(error)) return
    call check_true(error, all(state(:3)%stopped == within_tolerance) .and. all(state(4:)%stopped == sweeps_used_up), 'reasons')
  end subroutine test_reasons

end module test_arguments
