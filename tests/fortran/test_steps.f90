!> Adaptive load steps: what halving changes, what becomes of attempts, and paths of the real method.
module test_steps
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  use hc_precision, only: wp, pi
  use hc_error, only: error_t, status
  use hc_contact_state, only: contact_state_t, new_friction_state, load_target_t, normal, along_x, about_z, &
    displacement_control, force_control, rim_reached, separated, slip, stick
  use hc_contact_problem, only: friction_problem_t, new_friction_problem
  use hc_coulomb, only: coulomb_t
  use hc_field_space, only: field_space_t
  use hc_frictional_contact, only: frictional_contact_t, new_frictional_contact
  use hc_load_path, only: advance, step_settings_t
  use hc_options, only: step_options_t
  use hc_step_error, only: compare_halves, shear_free, step_change_t
  use hc_step_control, only: accepted, failed, limited, outgrown, pending, rejected, step_attempt_t, step_control_t
  use hc_adaptive_path, only: adaptive_path_t
  use hc_state_measures, only: elastic_energy, nodal_normal_residual, nodal_tangential_residual, zone_extent
  use hc_discretization_error, only: limits_of_error, is_slip_zone_unresolved
  use hc_load_cycles, only: find_cycles, loop_area, turning_points
  use hc_contact_residuals, only: normal_self_compliance
  use hc_elastic_pair, only: elastic_pair_t
  use hc_lattice, only: lattice_t, new_lattice, equilateral_basis
  use hc_contact_search, only: contact_search_t, find_rough_pressure
  use hc_normal_law, only: unilateral_t
  use hc_normal_problem, only: normal_problem_t, new_normal_problem
  use hc_wear_ahead, only: energy_ahead, worn_cycle_t
  use hc_wear_path, only: cycle_step_t, wear_path_t
  use hc_wear_jumps, only: energy_of_second_jump, jump_change, two_jumps_t, wear_by, wear_law_t, wear_left
  use hc_expected_error, only: entry_error, entry_steps, even_steps, lattice_errors, lattice_errors_t, lattice_spacings, &
    oblique_error, oblique_steps, slip_ring, turning_error
  use test_friction, only: new_sphere
  use testing, only: test_t, new_test, check, check_raised, check_true, fail, largest
  implicit none
  private

  public :: collect_steps

  real(wp), parameter :: thr = 1.0e-14_wp, mu = 0.3_wp, load = 4.0_wp/3.0_wp

contains

  subroutine collect_steps(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('first_attempts', test_first_attempts), &
      new_test('verdicts', test_verdicts), &
      new_test('no_convergence', test_no_convergence), &
      new_test('next_size', test_next_size), &
      new_test('halving', test_halving), &
      new_test('path', test_path), &
      new_test('path_to_the_rim', test_rim), &
      new_test('path_on_a_growing_window', test_growing), &
      new_test('nodal_residuals', test_nodal_residuals), &
      new_test('energy', test_energy), &
      new_test('limits_of_error', test_limits), &
      new_test('cycles', test_cycles), &
      new_test('expected_errors', test_expected), &
      new_test('wear_jumps', test_wear_jumps), &
      new_test('wear_ahead', test_wear_ahead), &
      new_test('wear_path', test_wear_path), &
      new_test('wear_without_slip', test_no_wear), &
      new_test('change_by_halves', test_change_by_halves), &
      new_test('wear_left', test_wear_left), &
      new_test('turning_limits_a_step', test_turning), &
      new_test('search', test_search), &
      new_test('search_without_end', test_search_without_end) &
    ]
  end subroutine collect_steps

  !> Cycles that wear a sphere, on a window that grows on the way and on one that is large from the beginning: the worn volume is
  !> that of the dissipated work, (V2), and a smaller part of it is solved twice.
  subroutine test_wear_path(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(wear_path_t) :: growing, fixed
    type(lattice_t) :: large
    integer :: n_grown, low(2), high(2)

    call new_sphere(contact, 7, 0.0_wp, 0.0_wp, coulomb_t(mu), error)
    if (allocated(error)) return
    large = contact%problem%lattice
    large%first = 2*large%first
    large%extent = 2*large%extent - 1
    growing%grows = .true.
    call wear_sphere(contact, growing, n_grown, error)
    if (allocated(error)) return
    call check_true(error, n_grown > 0, 'the window grew')
    if (allocated(error)) return
    low = contact%problem%lattice%first - large%first + 1
    high = low + contact%problem%lattice%extent - 1
    call on_window(contact%problem, large, contact, error)
    if (allocated(error)) return
    call wear_sphere(contact, fixed, n_grown, error)
    if (allocated(error)) return
    associate (energy => fixed%cycle%state%dissipation_density, depth => fixed%cycle%worn, area => large%cell_area())
      call check(error, largest(depth - fixed%coefficient*energy/mu), 0.0_wp, 1.0e-12_wp*fixed%deepest, 'depth of the work')
      if (allocated(error)) return
      call check(error, fixed%volume, area*sum(depth), 1.0e-12_wp*fixed%volume, 'volume')
      if (allocated(error)) return
      call check(error, largest(growing%cycle%worn - depth(low(1):high(1), low(2):high(2))), 0.0_wp, 1.0e-2_wp*fixed%deepest, &
                 'depth on the growing window')
      if (allocated(error)) return
    end associate
    call check_true(error, fixed%unworn == 1 .and. fixed%depth_error > 0.0_wp .and. fixed%depth_error < 0.5_wp*fixed%deepest, &
                    'bound on the error')
  end subroutine test_wear_path

  !> Solve the wear of a sphere under an alternating shear load; the window grows if the path allows it.
  subroutine wear_sphere(contact, path, n_grown, error)
    type(frictional_contact_t), intent(inout) :: contact
    type(wear_path_t), intent(inout) :: path
    !> How often the window grew
    integer, intent(out) :: n_grown
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: shear(3) = 0.6_wp*mu*load*[0.0_wp, 1.0_wp, -1.0_wp]
    type(contact_state_t) :: state, next
    type(cycle_step_t) :: steps(3)
    type(lattice_t) :: small
    integer :: i

    n_grown = 0
    call new_friction_state(state, contact%problem%lattice)
    do i = 1, 3
      steps(i)%target = load_target_t(value=[load, shear(i)])
      call advance(contact, state, steps(i)%target, step_settings_t(), next, error)
      if (allocated(error)) return
      state = next
    end do
    ! the work of the history wears nothing
    state%dissipation_density = 0.0_wp
    path%coefficient = 1.0_wp
    path%cycles = 20.0_wp
    path%tolerance = 0.1_wp
    call path%initialize(state, steps([3, 2, 3]))
    do
      call path%advance(contact, error)
      if (allocated(error)) return
      select case (path%verdict)
      case (pending)
      case (outgrown)
        n_grown = n_grown + 1
        small = contact%problem%lattice
        call on_window(contact%problem, path%larger, contact, error)
        if (.not. allocated(error)) call path%carry(contact, small, error)
        if (allocated(error)) return
      case (failed)
        call fail(error, 'no convergence')
        return
      case default
        if (path%cycle%cycles >= path%cycles) exit
      end select
    end do
  end subroutine wear_sphere

  !> A cycle in which nothing slips wears nothing, and says so.
  subroutine test_no_wear(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(wear_path_t) :: path
    type(contact_state_t) :: state, next
    type(cycle_step_t) :: steps(2)
    type(error_t), allocatable :: raised

    call new_sphere(contact, 6, 0.0_wp, 0.0_wp, coulomb_t(mu), error)
    if (allocated(error)) return
    steps%target = load_target_t(value=[load])
    call new_friction_state(state, contact%problem%lattice)
    call advance(contact, state, steps(1)%target, step_settings_t(), next, error)
    if (allocated(error)) return
    path%coefficient = 1.0_wp
    call path%initialize(next, steps)
    do
      call path%advance(contact, raised)
      if (allocated(raised) .or. path%verdict /= pending) exit
    end do
    call check_raised(error, raised, status%invalid_input, 'a cycle without slip')
  end subroutine test_no_wear

  !> Depth of cycles that are all alike, and what two jumps change: by hand, with nodes that cannot wear.
  subroutine test_wear_jumps(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: energy(2, 2) = reshape([3.0_wp, 0.0_wp, 1.0_wp, 4.0_wp], [2, 2]), &
                           friction(2, 2) = reshape([0.5_wp, 0.5_wp, 0.25_wp, 0.0_wp], [2, 2])
    type(lattice_t) :: lattice
    type(step_change_t) :: change
    type(step_options_t) :: options
    type(wear_law_t) :: law
    real(wp) :: depth(2, 2), slower(2, 2), second(2, 2)

    law = wear_law_t(2.0_wp, friction)
    depth = 1.0_wp
    call wear_by(energy, 2.0_wp, friction, 10.0_wp, depth)
    call check(error, reshape(depth, [4]), [121.0_wp, 1.0_wp, 81.0_wp, 1.0_wp], thr, 'depth')
    if (allocated(error)) return
    call new_lattice(lattice, equilateral_basis(0.3_wp), [0, 0], [2, 2], error)
    if (allocated(error)) return
    associate (pair => elastic_pair_t(0.2_wp, 0.0_wp, 0.0_wp), after => energy + reshape([-1.0_wp, 0.0_wp, 0.5_wp, 0.0_wp], [2, 2]))
      ! 40 and 40 more or less at two of the three nodes where friction dissipates
      call jump_change(lattice, pair, law, two_jumps_t(energy, after, energy, 10.0_wp), 5.0_wp, slower, change, field_space_t())
      call check(error, reshape(slower, [4]), [-40.0_wp, 0.0_wp, 40.0_wp, 0.0_wp], thr, 'depth')
      if (allocated(error)) return
      call check(error, change%added/options%added_share*5.0_wp*normal_self_compliance(lattice, pair), &
                 40.0_wp*sqrt(2.0_wp/3.0_wp), thr, 'root mean square')
      if (allocated(error)) return
      call jump_change(lattice, pair, law, two_jumps_t(energy, after, energy, 10.0_wp), 0.0_wp, slower, change, field_space_t())
      call check(error, change%added, 0.0_wp, 0.0_wp, 'without pressure')
      if (allocated(error)) return
      ! 1 less, to 1; 0.5 more, of which what is left of the pressure allows 0.01 times 1.5; a node that does not slip as it is
      associate (path => reshape([1.0_wp, 1.0_wp, normal_self_compliance(lattice, pair)/0.01_wp, 0.0_wp], [2, 2]))
        law%coefficient = 1.0_wp
        call energy_of_second_jump(lattice, pair, law, two_jumps_t(energy, after, energy, 1.0_wp), path, second)
      end associate
      call check(error, reshape(second, [4]), [1.0_wp, 0.0_wp, 1.515_wp, 4.0_wp], thr, 'second jump')
    end associate
  end subroutine test_wear_jumps

  !> What further cycles change: from the tractions at first, then from the last two changes, which fade or do not.
  subroutine test_wear_left(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: friction(2, 1) = reshape([0.5_wp, 0.25_wp], [2, 1]), pressure(2, 1) = 4.0_wp
    type(step_options_t) :: options
    real(wp) :: energies(2, 1, 3), traction(2, 1, 2, 2)

    ! depths 8, 0; 4, 0; 2, 8 with the coefficient 1: changes of 4, then of 8
    energies = reshape([4.0_wp, 0.0_wp, 2.0_wp, 0.0_wp, 1.0_wp, 2.0_wp], [2, 1, 3])
    traction = 0.0_wp
    traction(1, 1, :, 2) = [0.3_wp, -0.4_wp]
    ! only the first node slips, whose friction carries 2
    call check(error, wear_left(energies(:, :, :2), traction, pressure, friction, field_space_t()), &
               options%closing_gain*0.25_wp, thr, 'tractions')
    if (allocated(error)) return
    call check(error, wear_left(energies, traction, pressure, friction, field_space_t()), &
               options%closing_safety/(1.0_wp - options%slowest_closing), 1.0e-12_wp, 'changes that grow')
    if (allocated(error)) return
    energies(:, 1, 3) = [1.5_wp, 0.0_wp]
    call check(error, wear_left(energies, traction, pressure, friction, field_space_t()), &
               options%closing_safety/3.0_wp/0.75_wp, thr, 'a quarter')
    if (allocated(error)) return
    energies(:, :, 2) = energies(:, :, 3)
    call check(error, wear_left(energies, traction, pressure, friction, field_space_t()), 0.0_wp, 0.0_wp, 'closed')
  end subroutine test_wear_left

  !> A step in which tractions turn by more than the tolerance is rejected; the next one is smaller in proportion.
  subroutine test_turning(error)
    type(error_t), allocatable, intent(out) :: error
    type(step_control_t) :: control
    type(step_attempt_t) :: attempt
    integer :: verdict

    attempt = step_attempt_t(start=0.0_wp, end=1.0_wp)
    call control%decide(attempt, .true., step_change_t(spent=1.0_wp, turned=0.04_wp), 0.02_wp, verdict)
    call check(error, verdict, rejected, 'turned too far')
    if (allocated(error)) return
    call check(error, [attempt%end, attempt%last_excess], [0.4_wp, 2.0_wp], thr, 'a smaller step')
    if (allocated(error)) return
    call control%decide(attempt, .true., step_change_t(spent=1.0_wp, turned=0.016_wp), 0.02_wp, verdict)
    call check(error, verdict, accepted, 'turned by less')
    if (allocated(error)) return
    ! a quarter of a turn in three steps, there and back; no load after none
    call check(error, turning_error(reshape([0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, cos(0.5_wp), sin(0.5_wp), 0.0_wp, &
                                             -cos(0.5_wp), -sin(0.5_wp), 0.0_wp], [3, 4])), sin(0.5_wp), thr, 'angle')
    if (allocated(error)) return
    call check(error, turning_error(reshape([0.0_wp, 0.0_wp, 0.0_wp], [3, 1])), 0.0_wp, 0.0_wp, 'no load')
  end subroutine test_turning

  !> Turning points and cycles of a motion that goes to and fro, and the area of an elliptic loop.
  subroutine test_cycles(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 400
    real(wp) :: angle(0:n)
    integer, allocatable :: first(:), last(:)
    integer :: k

    associate (to_and_fro => [0.0_wp, 0.0_wp, 1.0_wp, 2.0_wp, 0.0_wp, -2.0_wp, -1.0_wp, -1.001_wp, 2.0_wp, 0.5_wp])
      call check_true(error, all(turning_points(to_and_fro) == [2, 4, 6, 9, 10]), 'noise is no turning point')
      if (allocated(error)) return
      call find_cycles(to_and_fro, 0.0_wp*to_and_fro, first, last)
      call check_true(error, all([size(first), first, last] == [1, 4, 9]), 'the first loading is no cycle')
      if (allocated(error)) return
    end associate
    associate (pulses => [0.0_wp, 1.0_wp, 0.0_wp, 1.0_wp, 0.01_wp])
      call find_cycles(pulses, pulses, first, last)
      call check_true(error, all([first, last] == [1, 3, 3, 5]), 'pulses')
      if (allocated(error)) return
    end associate
    ! the motion drifts, its load does not
    call find_cycles([0.0_wp, 1.0_wp, -0.5_wp, 1.2_wp], [0.0_wp, 1.0_wp, -1.0_wp, 1.0_wp], first, last)
    call check_true(error, all([first, last] == [2, 4]), 'a load that comes back')
    if (allocated(error)) return
    ! gross sliding: the load is back halfway
    call find_cycles([0.0_wp, 1.0_wp, -1.0_wp, 0.0_wp], [0.0_wp, 1.0_wp, -1.0_wp, 1.0_wp], first, last)
    call check(error, size(first), 0, 'a motion that does not come back')
    if (allocated(error)) return
    call check_true(error, size(turning_points([1.0_wp, 1.0_wp, 1.0_wp])) == 0, 'a constant does not turn')
    if (allocated(error)) return

    angle = [(2.0_wp*pi*k/n, k=0, n)]
    call check(error, loop_area(3.0_wp*cos(angle), -2.0_wp*sin(angle)), 6.0_wp*pi, 1.0e-3_wp, 'area of a loop')
  end subroutine test_cycles

  !> The first step of a segment follows from that of the last one; the last two steps are equally large.
  subroutine test_first_attempts(error)
    type(error_t), allocatable, intent(out) :: error
    type(step_control_t) :: control
    type(step_attempt_t) :: attempt

    call control%start_segment()
    attempt = control%first_attempt(0.0_wp, 1.0_wp)
    call check(error, [attempt%start, attempt%end], [0.0_wp, 1.0_wp], thr, 'a whole segment')
    if (allocated(error)) return
    attempt = control%first_attempt(0.0_wp, 0.2_wp)
    call check(error, attempt%end, 0.2_wp, thr, 'the largest step that is allowed')
    if (allocated(error)) return
    control%first = 0.2_wp
    call control%start_segment()
    attempt = control%first_attempt(0.3_wp, 1.0_wp)
    call check(error, attempt%end, 0.65_wp, thr, 'half of what is left')
  end subroutine test_first_attempts

  !> Within the tolerance; above it; no smaller by a smaller step; by an error that earlier steps have left.
  subroutine test_verdicts(error)
    type(error_t), allocatable, intent(out) :: error
    type(step_control_t) :: control
    type(step_attempt_t) :: attempt
    integer :: verdict
    real(wp), parameter :: tolerance = 0.02_wp

    call control%decide(attempt, .true., step_change_t(stick=0.009_wp, added=0.009_wp), tolerance, verdict)
    call check(error, verdict, accepted, 'below the tolerance')
    if (allocated(error)) return
    call control%decide(attempt, .true., step_change_t(stick=-0.02_wp), tolerance, verdict)
    call check(error, verdict, rejected, 'twice the tolerance')
    if (allocated(error)) return
    call check(error, [attempt%end, attempt%last_excess, attempt%last_size], [0.4_wp, 2.0_wp, 1.0_wp], thr, 'a smaller step')
    if (allocated(error)) return
    call control%decide(attempt, .true., step_change_t(stick=-0.0195_wp), tolerance, verdict)
    call check(error, verdict, limited, 'the smaller one changes as much')
    if (allocated(error)) return
    call control%decide(attempt, .true., step_change_t(stick=0.02_wp, lattice=0.05_wp), tolerance, verdict)
    call check(error, verdict, accepted, 'rings of nodes')
    if (allocated(error)) return
    call control%decide(attempt, .true., step_change_t(stick=0.009_wp, added=0.011_wp), tolerance, verdict)
    call check_true(error, verdict /= accepted, 'tractions')
    if (allocated(error)) return
    control%stick = -0.018_wp
    attempt = step_attempt_t()
    call control%decide(attempt, .true., step_change_t(stick=-0.02_wp), tolerance, verdict)
    call check(error, verdict, accepted, 'the steps before have left it')
  end subroutine test_verdicts

  !> A step that does not converge is made four times smaller, down to the least.
  subroutine test_no_convergence(error)
    type(error_t), allocatable, intent(out) :: error
    type(step_control_t) :: control
    type(step_attempt_t) :: attempt
    integer :: verdict, k

    do k = 1, 5
      call control%decide(attempt, .false., step_change_t(), 0.02_wp, verdict)
      call check(error, verdict, rejected, 'a smaller step is tried')
      if (allocated(error)) return
      call check(error, attempt%end, max(control%options%least_step, 0.25_wp**k), thr, 'its size')
      if (allocated(error)) return
    end do
    call control%decide(attempt, .false., step_change_t(), 0.02_wp, verdict)
    call check(error, verdict, failed, 'there is no smaller one')
    if (allocated(error)) return
    call check(error, attempt%n_rejected, 5, 'attempts before')
  end subroutine test_no_convergence

  !> The next step aims at 0.8 of what is allowed, and grows by two at most; changes fade from the bound.
  subroutine test_next_size(error)
    type(error_t), allocatable, intent(out) :: error
    type(step_control_t) :: control
    type(step_attempt_t) :: attempt
    type(step_change_t) :: change
    real(wp), parameter :: tolerance = 0.02_wp

    attempt = step_attempt_t(start=0.0_wp, end=0.1_wp)
    change = step_change_t(stick=0.008_wp, traction=0.001_wp, gain=2.0_wp, lattice=0.003_wp)
    call control%accept(attempt, change, tolerance, accepted)
    call check(error, [control%size, control%first], [0.1_wp, 0.1_wp], thr, 'on the aim')
    if (allocated(error)) return
    call check(error, control%bound(change), 2.0_wp*0.008_wp + 2.0_wp*2.0_wp*0.001_wp + 0.003_wp, thr, 'bound')
    if (allocated(error)) return
    call check(error, control%traction_bound(0.01_wp), 0.01_wp + 3.0_wp*0.001_wp, thr, 'bound of the tractions')
    if (allocated(error)) return
    attempt = step_attempt_t(start=0.1_wp, end=0.2_wp, n_rejected=1)
    call control%accept(attempt, step_change_t(), tolerance, accepted)
    call check(error, [control%size, control%first], [0.1_wp, 0.1_wp], thr, 'no growth after a rejection')
    if (allocated(error)) return
    call check(error, control%bound(step_change_t()), 2.0_wp*0.0072_wp + 2.0_wp*0.0008_wp, thr, 'changes fade')
    if (allocated(error)) return
    call control%accept(attempt, step_change_t(added=10.0_wp), tolerance, limited)
    call check(error, control%size, 0.2_wp, thr, 'larger where smaller ones are of no use')
  end subroutine test_next_size

  !> One step against two: the change of the tractions as it is defined, of the stick area with the right sign.
  subroutine test_halving(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: virgin, whole, half, halves
    type(step_change_t) :: change
    real(wp) :: expected

    call new_sphere(contact, 12, 0.5_wp, 0.3_wp, coulomb_t(mu), error)
    if (allocated(error)) return
    call new_friction_state(virgin, contact%problem%lattice)
    call check_true(error, shear_free(virgin, field_space_t(), step_options_t()), 'no shear before the first load')
    if (allocated(error)) return
    call press(contact, virgin, load, whole, error)
    if (.not. allocated(error)) call press(contact, virgin, 0.5_wp*load, half, error)
    if (.not. allocated(error)) call press(contact, half, load, halves, error)
    if (allocated(error)) return
    call check_true(error, .not. shear_free(whole, field_space_t(), step_options_t()), 'unlike bodies shear each other')
    if (allocated(error)) return
    associate (p => contact%problem)
      call compare_halves(p, whole, half, halves, virgin, virgin, 4.0_wp, change)
      expected = sum(norm2(whole%traction - halves%traction, dim=3))/(mu*sum(halves%pressure))
      ! of a contact area of pi, where the largest one is 4
      call check(error, change%traction, expected*pi/4.0_wp, 0.05_wp*expected, 'change of the tractions')
      if (allocated(error)) return
      call check(error, change%added, change%traction, thr, 'all of it in this step')
      if (allocated(error)) return
      call check(error, change%stick, p%lattice%cell_area()*(count(halves%zone == stick) - count(whole%zone == stick))/4.0_wp, &
                 0.06_wp, 'change of the stick area, against that of its nodes')
      if (allocated(error)) return
      call check_true(error, change%lattice > 0.0_wp .and. change%gain >= 1.0_wp, 'rings of nodes enter')
      if (allocated(error)) return
      call compare_halves(p, whole, half, halves, whole, halves, 4.0_wp, change)
      call check(error, [change%added, change%lattice], [0.0_wp, 0.0_wp], thr, 'nothing added, no node entered')
    end associate
  end subroutine test_halving

  !> Press to a normal load in one step.
  subroutine press(contact, state, force, next, error)
    type(frictional_contact_t), intent(inout) :: contact
    type(contact_state_t), intent(in) :: state
    real(wp), intent(in) :: force
    type(contact_state_t), intent(out) :: next
    type(error_t), allocatable, intent(out) :: error

    call advance(contact, state, load_target_t(value=[force, 0.0_wp, 0.0_wp, 0.0_wp]), step_settings_t(1.0e-9_wp, 60, 0), next, &
                 error)
    if (.not. allocated(error)) call check_true(error, next%converged, 'the step converges')
  end subroutine press

  !> Pressed and sheared: bodies alike need one step for the pressure; smaller tolerances make more steps, smaller bounds.
  subroutine test_path(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(error_t), allocatable :: failure
    type(adaptive_path_t) :: path
    integer :: steps(2), k
    real(wp) :: bound(2), tolerance
    logical :: within

    call new_sphere(contact, 12, 0.0_wp, 0.3_wp, coulomb_t(mu), error)
    if (allocated(error)) return
    do k = 1, 2
      tolerance = merge(0.2_wp, 0.02_wp, k == 1)
      call run(contact, tolerance, path, steps(k), within, error)
      if (allocated(error)) return
      bound(k) = path%stick_area_error
      call check_true(error, within .or. path%limited, 'each step is within the tolerance')
      if (allocated(error)) return
      call check(error, path%state%load(along_x), 0.3_wp*mu*load, 1.0e-8_wp, 'end of the path')
      if (allocated(error)) return
      associate (p => contact%problem)
        call check(error, path%state%residual_tangential, &
                   largest(nodal_tangential_residual(p%lattice, p%medium, p%friction, path%state, field_space_t())), 1.0e-12_wp, &
                   'residual of the step as it is recorded')
      end associate
      if (allocated(error)) return
      call check_true(error, path%state%residual_tangential > 1.0e-4_wp, 'which is more than that of its halves')
      if (allocated(error)) return
    end do
    call check_true(error, steps(2) > steps(1), 'a smaller tolerance needs more steps')
    if (allocated(error)) return
    call check_true(error, bound(2) < bound(1), 'and has the smaller bound')
    if (allocated(error)) return
    path%tolerance = 0.0_wp
    call path%advance(contact, load_target_t(), step_settings_t(), failure)
    call check_raised(error, failure, status%invalid_input, 'no tolerance')
  end subroutine test_path

  !> A path up to a normal load, then along x.
  subroutine run(contact, tolerance, path, n_step, within, error)
    type(frictional_contact_t), intent(inout) :: contact
    !> What a step may change
    real(wp), intent(in) :: tolerance
    type(adaptive_path_t), intent(out) :: path
    !> Steps
    integer, intent(out) :: n_step
    !> No step added more to the change of the tractions than it may
    logical, intent(out) :: within
    type(error_t), allocatable, intent(out) :: error
    type(contact_state_t) :: state
    type(load_target_t) :: target
    integer :: segment

    call new_friction_state(state, contact%problem%lattice)
    call path%initialize(state, pi)
    path%tolerance = tolerance
    n_step = 0
    within = .true.
    do segment = 1, 2
      target%value(:4) = [load, merge(0.0_wp, 0.3_wp*mu*load, segment == 1), 0.0_wp, 0.0_wp]
      do
        call path%advance(contact, target, step_settings_t(max_sweeps=60), error)
        if (allocated(error)) return
        call check_true(error, path%state%converged, 'the step converges')
        if (allocated(error)) return
        n_step = n_step + 1
        within = within .and. (path%limited .or. path%change%added <= 0.5_wp*tolerance)
        if (path%fraction >= 1.0_wp) exit
      end do
    end do
  end subroutine run

  !> A path ends where the contact reaches the rim of the window in a part of a step.
  subroutine test_rim(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(adaptive_path_t) :: path
    type(contact_state_t) :: state
    type(load_target_t) :: target

    call new_sphere(contact, 8, 0.5_wp, 0.3_wp, coulomb_t(mu), error)
    if (allocated(error)) return
    call new_friction_state(state, contact%problem%lattice)
    call path%initialize(state, pi)
    target%value(normal) = 20.0_wp*load
    path%tolerance = 0.05_wp
    call path%advance(contact, target, step_settings_t(max_sweeps=60), error)
    if (allocated(error)) return
    call check_true(error, path%state%clipped .or. path%state%stopped == rim_reached, 'contact at the rim')
  end subroutine test_rim

  !> A path on a window that grows is that on a large window: its steps, its tractions and the slip of all its nodes.
  subroutine test_growing(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact, large
    type(adaptive_path_t) :: path, reference
    type(contact_state_t) :: state
    type(lattice_t) :: small
    type(load_target_t) :: target
    integer :: n_grown, low(2), high(2)

    call new_sphere(contact, 8, 0.5_wp, 0.3_wp, coulomb_t(mu), error)
    if (allocated(error)) return
    small = contact%problem%lattice
    small%first = 2*small%first
    small%extent = 2*small%extent - 1
    call on_window(contact%problem, small, large, error)
    if (allocated(error)) return
    call new_friction_state(state, contact%problem%lattice)
    call path%initialize(state, 2.0_wp*pi)
    call new_friction_state(state, small)
    call reference%initialize(state, 2.0_wp*pi)
    path%grows = .true.
    ! so large that the step which needs a larger window is not made smaller there
    path%tolerance = 10.0_wp
    reference%tolerance = 10.0_wp
    n_grown = 0
    target = load_target_t(value=[load])
    do
      call path%advance(contact, target, step_settings_t(max_sweeps=60), error)
      if (allocated(error)) return
      if (path%verdict == outgrown) then
        n_grown = n_grown + 1
        small = contact%problem%lattice
        call on_window(contact%problem, path%larger, contact, error)
        if (.not. allocated(error)) call path%carry(contact, small, error)
        if (allocated(error)) return
        cycle
      end if
      call reference%advance(large, target, step_settings_t(max_sweeps=60), error)
      if (allocated(error)) return
      call check(error, path%fraction, reference%fraction, 1.0e-6_wp, 'end of the step')
      if (allocated(error)) return
      if (path%fraction < 1.0_wp) cycle
      if (target%value(normal) > load) exit
      ! the first window held the contact so far
      call check(error, n_grown, 0, 'growth')
      if (allocated(error)) return
      target%value(normal) = 6.0_wp*load
    end do
    call check_true(error, n_grown > 0 .and. all(path%state%zone(1, :) == separated), 'the window grew')
    if (allocated(error)) return
    low = contact%problem%lattice%first - large%problem%lattice%first + 1
    high = low + contact%problem%lattice%extent - 1
    associate (whole => reference%state, part => path%state)
      call check(error, largest(part%traction - whole%traction(low(1):high(1), low(2):high(2), :)), 0.0_wp, 1.0e-6_wp, 'tractions')
      if (allocated(error)) return
      call check(error, largest(part%accumulated_slip - whole%accumulated_slip(low(1):high(1), low(2):high(2))), 0.0_wp, &
                 1.0e-6_wp, 'slip')
      if (allocated(error)) return
      call check(error, part%dissipated_energy, whole%dissipated_energy, 1.0e-6_wp, 'energy')
    end associate
  end subroutine test_growing

  !> The same sphere on another window.
  subroutine on_window(problem, lattice, contact, error)
    type(friction_problem_t), intent(in) :: problem
    type(lattice_t), intent(in) :: lattice
    type(frictional_contact_t), intent(inout) :: contact
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: same
    real(wp) :: x(lattice%extent(1), lattice%extent(2)), y(lattice%extent(1), lattice%extent(2))

    call lattice%coordinates(x, y)
    call new_friction_problem(same, lattice, problem%medium, 0.5_wp*(x**2 + y**2), x < 100.0_wp, problem%friction, .false., error)
    if (.not. allocated(error)) call new_frictional_contact(contact, same, error)
  end subroutine on_window

  !> The largest of them are the residuals of the state; away from the contact they are zero.
  subroutine test_nodal_residuals(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: virgin, state
    type(coulomb_t) :: friction
    real(wp), allocatable :: along_normal(:, :), tangential(:, :)
    integer :: k

    do k = 1, 2
      friction = merge(coulomb_t(mu), coulomb_t(no_slip=.true.), k == 1)
      call new_sphere(contact, 10, 0.5_wp, 0.3_wp, friction, error)
      if (allocated(error)) return
      call new_friction_state(virgin, contact%problem%lattice)
      call advance(contact, virgin, load_target_t(value=[load, 0.2_wp, 0.0_wp, 0.0_wp]), &
                   step_settings_t(1.0e-5_wp, 60, 0, static=.true.), state, error)
      if (allocated(error)) return
      allocate (along_normal, source=nodal_normal_residual(contact%problem%lattice, contact%problem%medium, &
                                                           contact%problem%normal_law, state, field_space_t()))
      allocate (tangential, source=nodal_tangential_residual(contact%problem%lattice, contact%problem%medium, friction, state, &
                                                             field_space_t()))
      call check(error, [maxval(along_normal), maxval(tangential)], [state%residual_normal, state%residual_tangential], &
                 1.0e-12_wp, 'largest residuals')
      if (allocated(error)) return
      call check_true(error, state%residual_normal > 0.0_wp .and. all(tangential <= 0.0_wp .or. state%zone > 0), 'in contact')
      if (allocated(error)) return
      deallocate (along_normal, tangential)
    end do
    call check(error, largest(nodal_tangential_residual(contact%problem%lattice, contact%problem%medium, coulomb_t(), state, &
                                                        field_space_t())), &
               0.0_wp, 0.0_wp, 'nothing to satisfy without friction')
  end subroutine test_nodal_residuals

  !> Pressed, U = 2/5 P delta of Hertz; a twist adds M beta/2 when all sticks, wherever the origin lies.
  subroutine test_energy(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: virgin, pressed, twisted
    type(load_target_t) :: target
    real(wp) :: center(2), lower(2), upper(2), energy

    call new_sphere(contact, 12, 0.0_wp, 0.0_wp, coulomb_t(no_slip=.true.), error)
    if (allocated(error)) return
    call new_friction_state(virgin, contact%problem%lattice)
    call press(contact, virgin, load, pressed, error)
    if (allocated(error)) return
    energy = elastic_energy(contact%problem%lattice, contact%problem%initial_gap, pressed)
    call check(error, energy, 0.4_wp*load*pressed%motion(normal), 0.004_wp, 'energy of Hertz')
    if (allocated(error)) return
    target%control(about_z) = displacement_control
    target%value(:4) = [load, 0.0_wp, 0.0_wp, 0.01_wp]
    call advance(contact, pressed, target, step_settings_t(1.0e-9_wp, 60, 0), twisted, error)
    if (allocated(error)) return
    call check(error, elastic_energy(contact%problem%lattice, contact%problem%initial_gap, twisted) - energy, &
               0.5_wp*twisted%load(about_z)*0.01_wp, 1.0e-8_wp, 'energy of the twist')
    if (allocated(error)) return
    call zone_extent(contact%problem%lattice, pressed%zone == stick, center, lower, upper, field_space_t())
    call check(error, [center, lower + upper], [0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], 1.0e-13_wp, 'a zone about the origin')
    if (allocated(error)) return
    call check(error, upper, [1.0_wp, 1.0_wp], 0.09_wp, 'as large as the contact')
    if (allocated(error)) return
    call zone_extent(contact%problem%lattice, pressed%zone > 2, center, lower, upper, field_space_t())
    call check_true(error, all(ieee_is_nan([center, lower, upper])), 'no nodes')
  end subroutine test_energy

  !> q + c h^p: the extrapolation is exact, so that only the safety factor is left; scatter gives a floor.
  subroutine test_limits(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: failure
    real(wp) :: spacings(7), values(7, 5), errors(5)

    spacings = [1.0_wp, sqrt(2.0_wp), 2.0_wp, 2.0_wp, 2.0_wp, 2.0_wp, 2.0_wp]
    values(:, 1) = 3.0_wp + 0.1_wp*spacings
    values(:, 2) = 1.0e9_wp*(3.0_wp + 0.1_wp*spacings**2)
    values(:, 3) = [1.0_wp, 1.0_wp, 1.0_wp, 1.02_wp, 0.98_wp, 1.01_wp, 0.99_wp]
    values(:, 4) = 0.0_wp
    values(:, 5) = ieee_value(1.0_wp, ieee_quiet_nan)
    call limits_of_error(spacings, values, errors, error)
    if (allocated(error)) return
    call check(error, [errors(1), errors(2)/1.0e9_wp], [0.125_wp, 0.125_wp], 1.0e-6_wp, 'trends')
    if (allocated(error)) return
    call check_true(error, errors(3) > 0.005_wp .and. errors(3) < 0.0332_wp, 'scatter')
    if (allocated(error)) return
    call check_true(error, errors(4) <= 0.0_wp .and. ieee_is_nan(errors(5)), 'nothing, and no value')
    if (allocated(error)) return
    values(:, 1) = 3.0_wp + 0.1_wp*sqrt(spacings)
    call limits_of_error(spacings, values, errors, error, [.true., .false., .false., .true., .true.])
    if (allocated(error)) return
    call check(error, [errors(1), errors(2)/1.0e9_wp], [0.125_wp, 0.125_wp], 1.0e-6_wp, 'a trend of order 1/2')
    if (allocated(error)) return
    call check_true(error, errors(4) <= 0.0_wp .and. ieee_is_nan(errors(5)), 'rough, but nothing, and no value')
    if (allocated(error)) return
    values(:, 3) = 3.0_wp + 0.1_wp*spacings**0.15_wp
    call limits_of_error(spacings, values(:, :3), errors(:3), error, [.false., .false., .true.], [.true., .false., .true.])
    if (allocated(error)) return
    call check(error, [errors(1), errors(3)], [0.125_wp, 0.125_wp], 1.0e-6_wp, 'a slip zone that is not resolved')
    if (allocated(error)) return
    call limits_of_error(spacings(:3), values(:3, :), errors, failure)
    call check_raised(error, failure, status%invalid_input, 'three lattices')
    if (allocated(error)) return
    ! rings of 0.9 and 1.1 spacings about a disc of 20 (half a spacing of curvature is 2 % of their width), full slip, no shear
    call check_true(error, all(is_slip_zone_unresolved(1.0_wp, pi*400.0_wp, pi*[19.1_wp, 18.9_wp, 0.0_wp, 20.0_wp]**2, &
                                                       [1.0_wp, 1.0_wp, 1.0_wp, 0.0_wp], 4.0_wp) &
                           .eqv. [.true., .false., .false., .false.]), 'slip zones')
  end subroutine test_limits

  !> Rules for errors before a solution: docs/theory/expected_errors.md, the measured values of its tables, and inverses.
  subroutine test_expected(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_errors_t) :: found
    real(wp) :: radii(0:5), ring
    integer :: k

    ring = slip_ring(0.5_wp)
    call check(error, ring, 1.0_wp - 0.5_wp**(1.0_wp/3.0_wp), thr, 'slip ring')
    if (allocated(error)) return
    found = lattice_errors(5.0_wp, ring)
    call check(error, [found%max_pressure, found%contact_area, found%stick_area, found%dissipated_energy], &
               [0.0048_wp, 0.0224_wp, 0.04127_wp, 0.1787_wp], 1.0e-4_wp, 'five spacings')
    if (allocated(error)) return
    found = lattice_errors(lattice_spacings(0.05_wp, ring), ring)
    call check(error, max(found%stick_area, found%dissipated_energy), 0.05_wp, thr, 'spacings for an error')
    if (allocated(error)) return
    found = lattice_errors(2.0_wp, 0.0_wp)
    call check(error, [found%stick_area, found%dissipated_energy], [0.0_wp, 0.0_wp], thr, 'nothing slips')
    if (allocated(error)) return

    radii = [(real(k, wp)/5.0_wp, k=0, 5)]
    call check(error, even_steps(radii(:4), radii(1:)), 5.0_wp, thr, 'even radii')
    if (allocated(error)) return
    radii = radii**(1.0_wp/3.0_wp)
    call check(error, even_steps(radii(:4), radii(1:)), 5.0_wp, thr*10.0_wp, 'even loads')
    if (allocated(error)) return
    call check(error, even_steps(radii(1:0), radii(1:0)), 1.0_wp, thr, 'no growth')
    if (allocated(error)) return
    call check(error, entry_error([1.0_wp, 5.0_wp, 20.0_wp], 0.3_wp/0.1167_wp), [0.60_wp, 0.42_wp, 0.14_wp], 0.05_wp, &
               'dissimilar bodies pressed')
    if (allocated(error)) return
    call check(error, entry_error(entry_steps(0.1_wp, 2.0_wp), 2.0_wp), 0.1_wp, thr, 'steps for an error')
    if (allocated(error)) return
    call check(error, oblique_error([1.0_wp, 5.0_wp, 20.0_wp], 0.2_wp), [0.69_wp, 0.336_wp, 0.121_wp], 0.015_wp, 'oblique')
    if (allocated(error)) return
    call check(error, oblique_error(oblique_steps(0.1_wp, 0.2_wp), 0.2_wp), 0.1_wp, thr, 'oblique steps for an error')
  end subroutine test_expected

  !> Archard: flats that do not deform wear until every node wears alike, and carries a pressure that falls with its path.
  subroutine test_wear_ahead(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 12
    real(wp), dimension(n, n) :: energy, path, pressure, gap, friction, ahead
    logical :: carries(n, n)
    type(lattice_t) :: lattice
    type(normal_problem_t) :: problem
    integer :: k

    call new_lattice(lattice, equilateral_basis(1.0_wp), [0, 0], [n, n], error)
    if (allocated(error)) return
    path = 0.5_wp + 0.1_wp*reshape([(mod(7*k, 11), k=1, n*n)], [n, n])
    friction = 0.2_wp + 0.05_wp*reshape([(mod(3*k, 5), k=1, n*n)], [n, n])
    carries = .false.
    carries(4:9, 3:8) = .true.
    pressure = merge(1.0_wp + 0.1_wp*reshape([(mod(5*k, 13), k=1, n*n)], [n, n]), 0.0_wp, carries)
    energy = friction*pressure*path
    gap = merge(0.0_wp, 10.0_wp, carries)
    call new_normal_problem(problem, lattice, elastic_pair_t(1.0e-5_wp, 0.0_wp, 0.0_wp), gap, carries, error)
    if (allocated(error)) return
    call energy_ahead(worn_cycle_t(energy, path, pressure, gap, carries, friction, .true.), problem, 0.01_wp*100.0_wp, 1.0e-9_wp, &
                      ahead, error)
    if (allocated(error)) return
    ! the load stays: p = P/(A path) over the mean of 1/path
    pressure = merge(sum(pressure)/sum(1.0_wp/path, mask=carries)/path, 0.0_wp, carries)
    call check(error, maxval(abs(ahead - friction*pressure*path)), 0.0_wp, 1.0e-3_wp, 'energy of every node')
  end subroutine test_wear_ahead

  !> Cattaneo and Mindlin, c/a = 0.5 at the middle of a step and 0.2 at its end: Q = mu P (1 - (c/a)^3), so that the stick area
  !> changes by (0.5^2 - 0.2^2)/(0.5^3 - 0.2^3) of the change of the tractions.
  subroutine test_change_by_halves(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(friction_problem_t) :: problem
    type(contact_state_t) :: virgin, half, halves, whole
    type(step_change_t) :: change
    integer, parameter :: n = 30
    real(wp), parameter :: radius = 25.3_wp, c(2) = [0.5_wp, 0.2_wp], unit = 1.0e9_wp
    real(wp), allocatable :: x(:, :), y(:, :)

    call new_lattice(lattice, equilateral_basis(1.0_wp), [-n, -n], [2*n + 1, 2*n + 1], error)
    if (allocated(error)) return
    allocate (x(2*n + 1, 2*n + 1), y(2*n + 1, 2*n + 1))
    call lattice%coordinates(x, y)
    call new_friction_problem(problem, lattice, elastic_pair_t(0.2_wp, 0.0_wp, 0.0_wp), 0.0_wp*x, x < 100.0_wp, coulomb_t(mu), &
                              .false., error)
    if (allocated(error)) return
    call new_friction_state(virgin, lattice)
    half = sheared(c(1))
    halves = sheared(c(2))
    whole = halves
    whole%traction = whole%traction*1.01_wp
    associate (p => halves%pressure, area => pi*radius**2)
      call compare_halves(problem, whole, half, halves, virgin, virgin, area, change)
      if (allocated(error)) return
      call check(error, change%gain, (c(1)**2 - c(2)**2)/(c(1)**3 - c(2)**3), 0.03_wp, 'gain')
      if (allocated(error)) return
      call check(error, change%traction, 0.01_wp*(1.0_wp - c(2)**3), 1.0e-4_wp, 'change of the tractions')
      if (allocated(error)) return
      call check(error, change%added, change%traction, 1.0e-12_wp, 'all of it is new')
      if (allocated(error)) return
      call check(error, change%stick, 0.0_wp, 0.01_wp, 'the same stick area')
      if (allocated(error)) return
      ! an area that was twice as large halves everything
      call compare_halves(problem, whole, half, halves, whole, halves, 2.0_wp*area, change)
      call check(error, [change%traction, change%added], [0.005_wp*(1.0_wp - c(2)**3), 0.0_wp], 5.0e-5_wp, &
                 'beside a contact that was larger, inherited')
    end associate

  contains

    !> Tractions over Hertz' pressure, in pascal
    type(contact_state_t) function sheared(c)
      real(wp), intent(in) :: c
      real(wp) :: r(size(x, 1), size(x, 2))

      call new_friction_state(sheared, lattice)
      r = hypot(x, y)/radius
      sheared%pressure = unit*sqrt(max(1.0_wp - r**2, 0.0_wp))
      sheared%traction(:, :, 1) = mu*(sheared%pressure - unit*c*sqrt(max(1.0_wp - (r/c)**2, 0.0_wp)))
      sheared%gap = max(r - 1.0_wp, 0.0_wp)**1.5_wp
      sheared%zone = merge(separated, merge(stick, slip, r < c), r > 1.0_wp)
    end function sheared

  end subroutine test_change_by_halves

  !> A sphere off the origin whose contact radius by Hertz is 1: it is found from guesses that are far too small and too large, and
  !> the contact has eight spacings in its radius at least.
  subroutine test_search(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: guess(3) = [1.0e-3_wp, 1.0_wp, 40.0_wp], center(2) = [0.3_wp, -0.2_wp]
    type(contact_search_t) :: search
    type(lattice_t) :: lattice
    integer :: k

    do k = 1, size(guess)
      call search_contact(guess(k), center, [1.0_wp, 1.0_wp], search, lattice, error)
      if (.not. allocated(error)) call check(error, search%verdict, accepted, 'the contact is found')
      if (allocated(error)) return
      call check(error, sqrt(search%n_contact*lattice%cell_area()/pi), 1.0_wp, 0.06_wp, 'contact radius by Hertz')
      if (allocated(error)) return
      call check(error, 2.0_wp*sqrt(search%moment(:2)), [1.0_wp, 1.0_wp], 0.06_wp, 'half-axes of the moments')
      if (allocated(error)) return
      call check(error, search%max_pressure, 2.0_wp/pi**2, 0.05_wp*2.0_wp/pi**2, 'largest pressure by Hertz')
      if (allocated(error)) return
      call check(error, 0.5_wp*search%size, [1.0_wp, 1.0_wp], 0.15_wp, 'extent of the contact')
      if (allocated(error)) return
      call check_true(error, 8.0_wp*search%spacing < 1.06_wp, 'eight spacings in the radius')
      if (allocated(error)) return
    end do
  end subroutine test_search

  !> A cylinder touches along a line, so that no lattice holds the contact.
  subroutine test_search_without_end(error)
    type(error_t), allocatable, intent(out) :: error
    type(contact_search_t) :: search
    type(lattice_t) :: lattice

    call search_contact(1.0_wp, [0.0_wp, 0.0_wp], [1.0_wp, 0.0_wp], search, lattice, error)
    if (.not. allocated(error)) call check(error, search%verdict, failed, 'the contact has no end')
  end subroutine test_search_without_end

  !> Search for the contact of a paraboloid under 4/(3 pi), for E* = 1/pi.
  subroutine search_contact(guess, center, curvature, search, lattice, error)
    !> Guess of the radius, center, and curvatures along x and y
    real(wp), intent(in) :: guess, center(2), curvature(2)
    !> The search, and its last lattice
    type(contact_search_t), intent(out) :: search
    type(lattice_t), intent(out) :: lattice
    type(error_t), allocatable, intent(out) :: error
    type(load_target_t) :: target
    real(wp), allocatable :: x(:, :), y(:, :), pressure(:, :)
    real(wp) :: basis(2, 2)

    target%control(normal) = force_control
    target%value(normal) = 4.0_wp/(3.0_wp*pi)
    basis = equilateral_basis(1.0_wp)
    call search%begin(guess, [center(1) - center(2)*basis(1, 2)/basis(2, 2), center(2)/basis(2, 2)], 1.0_wp)
    do while (search%verdict == pending)
      call new_lattice(lattice, equilateral_basis(search%spacing), nint(search%first), nint(search%extent), error)
      if (allocated(error)) return
      associate (n => lattice%extent)
        if (allocated(x)) deallocate (x, y, pressure)
        allocate (x(n(1), n(2)), y(n(1), n(2)), pressure(n(1), n(2)))
      end associate
      call lattice%coordinates(x, y)
      call find_rough_pressure(lattice, elastic_pair_t(1.0_wp, 0.0_wp, 0.0_wp), unilateral_t(), &
                               0.5_wp*(curvature(1)*(x - center(1))**2 + curvature(2)*(y - center(2))**2), target, pressure, error)
      if (allocated(error)) return
      call search%judge(lattice, pressure)
    end do
  end subroutine search_contact

end module test_steps
