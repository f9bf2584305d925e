!> Sums, residuals and the two frictionless solvers.
module test_contact
  use hc_precision, only: wp, pi
  use hc_error, only: error_t, status
  use hc_lattice, only: lattice_t, new_lattice, equilateral_basis
  use hc_elastic_pair, only: elastic_pair_t
  use hc_contact_state, only: contact_state_t, force_control, displacement_control, normal
  use hc_field_space, only: field_space_t
  use hc_contact_residuals, only: normal_residual, force_residual
  use hc_normal_contact, only: normal_contact_t, new_normal_contact
  use hc_direct_contact, only: direct_contact_t, new_direct_contact
  use testing, only: test_t, new_test, check, check_raised, check_true
  implicit none
  private

  public :: collect_contact

contains

  subroutine collect_contact(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('residuals', test_residuals), &
      new_test('hertz', test_hertz), &
      new_test('any_approach', test_any_approach), &
      new_test('flat_punch', test_flat_punch), &
      new_test('methods_agree', test_methods_agree), &
      new_test('coarse_area', test_coarse_area), &
      new_test('any_start', test_any_start), &
      new_test('nothing_touches', test_nothing_touches), &
      new_test('threads', test_threads), &
      new_test('not_converged', test_not_converged), &
      new_test('bad_input', test_bad_input) &
    ]
  end subroutine collect_contact

  !> Hand-made violations: penetration, tension, pressure across a gap, a node that may not touch.
  subroutine test_residuals(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: p(3, 1), g(3, 1)
    logical :: candidate(3, 1)

    candidate = .true.
    p(:, 1) = [10.0_wp, 4.0_wp, 0.0_wp]
    g(:, 1) = [0.0_wp, 0.0_wp, 1.0_wp]
    call check(error, normal_residual(p, g, candidate, 0.5_wp, field_space_t()), 0.0_wp, 0.0_wp, 'no violation')
    if (allocated(error)) return
    g(1, 1) = -0.05_wp
    call check(error, normal_residual(p, g, candidate, 0.5_wp, field_space_t()), 0.01_wp, 1.0e-15_wp, 'penetration')
    if (allocated(error)) return
    g(1, 1) = 0.25_wp
    call check(error, normal_residual(p, g, candidate, 0.5_wp, field_space_t()), 0.05_wp, 1.0e-15_wp, 'pressure across a gap')
    if (allocated(error)) return
    g(1, 1) = 0.0_wp
    p(2, 1) = -3.0_wp
    call check(error, normal_residual(p, g, candidate, 0.5_wp, field_space_t()), 0.3_wp, 1.0e-15_wp, 'tension')
    if (allocated(error)) return
    candidate(2, 1) = .false.
    call check(error, normal_residual(p, g, candidate, 0.5_wp, field_space_t()), 0.0_wp, 0.0_wp, 'not a candidate')
    if (allocated(error)) return
    call check(error, force_residual(99.0_wp, 100.0_wp), 0.01_wp, 1.0e-15_wp, 'load')
  end subroutine test_residuals

  !> A paraboloid on a window of n nodes a side; contact radius 1 for E* = 1, R = 1, P = 4/3.
  subroutine paraboloid(n, lattice, gap, candidate, error)
    !> Nodes on each side of the apex
    integer, intent(in) :: n
    type(lattice_t), intent(out) :: lattice
    real(wp), intent(out) :: gap(:, :)
    logical, intent(out) :: candidate(:, :)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: x(2*n + 1, 2*n + 1), y(2*n + 1, 2*n + 1)

    call new_lattice(lattice, equilateral_basis(1.2_wp/n), [-n, -n], [2*n + 1, 2*n + 1], error)
    if (allocated(error)) return
    call lattice%coordinates(x, y)
    gap = 0.5_wp*(x**2 + y**2)
    candidate = .true.
  end subroutine paraboloid

  !> Hertz: p0 = 2/pi, approach 1. At 25 spacings in the radius the error is 1e-4 (second order).
  subroutine test_hertz(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(normal_contact_t) :: contact
    type(contact_state_t) :: state, again
    real(wp) :: gap(61, 61)
    logical :: candidate(61, 61)

    call paraboloid(30, lattice, gap, candidate, error)
    if (allocated(error)) return
    call new_normal_contact(contact, lattice, elastic_pair_t(1.0_wp/pi, 0.0_wp, 0.0_wp), gap, candidate, error)
    if (allocated(error)) return
    call contact%solve(force_control, 4.0_wp/3.0_wp, 1.0e-9_wp, 50, state, error)
    if (allocated(error)) return
    call check_true(error, state%converged .and. state%residual_normal <= 1.0e-9_wp, 'converged')
    if (allocated(error)) return
    call check(error, maxval(state%pressure), 2.0_wp/pi, 8.6e-5_wp, 'largest pressure')
    if (allocated(error)) return
    call check(error, state%motion(normal), 1.0_wp, 8.6e-5_wp, 'approach')
    if (allocated(error)) return
    ! control of the approach leads to the same solution
    call contact%solve(displacement_control, state%motion(normal), 1.0e-9_wp, 50, again, error)
    if (allocated(error)) return
    call check(error, again%load(normal), 4.0_wp/3.0_wp, 1.0e-8_wp, 'load under a given approach')
    if (allocated(error)) return
    call check(error, reshape(again%pressure, [3721]), reshape(state%pressure, [3721]), 1.0e-8_wp, 'same pressure')
  end subroutine test_hertz

  !> Approaches from first touch to contact everywhere, on windows much wider than the contact, too.
  subroutine test_any_approach(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(normal_contact_t) :: contact
    type(contact_state_t) :: state
    real(wp) :: gap(41, 41), load
    logical :: candidate(41, 41)
    integer :: i

    call paraboloid(20, lattice, gap, candidate, error)
    if (allocated(error)) return
    call new_normal_contact(contact, lattice, elastic_pair_t(1.0_wp/pi, 0.0_wp, 0.0_wp), gap, candidate, error)
    if (allocated(error)) return
    load = 0.0_wp
    do i = 1, 200
      call contact%solve(displacement_control, 0.01_wp*i, 1.0e-8_wp, 50, state, error)
      if (allocated(error)) return
      call check_true(error, state%converged .and. state%load(normal) > load, 'converged, and the load rises')
      if (allocated(error)) return
      call check_true(error, state%operator_applications < 6.0_wp, 'no work wasted')
      if (allocated(error)) return
      load = state%load(normal)
    end do
  end subroutine test_any_approach

  !> Rigid flat punch: P = 2 E* a approach, with the radius of the area of its nodes.
  subroutine test_flat_punch(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(normal_contact_t) :: contact
    type(contact_state_t) :: state
    real(wp) :: gap(61, 61), radius
    logical :: candidate(61, 61)

    call paraboloid(30, lattice, gap, candidate, error)
    if (allocated(error)) return
    candidate = gap <= 0.5_wp
    gap = 0.0_wp
    call new_normal_contact(contact, lattice, elastic_pair_t(1.0_wp/pi, 0.0_wp, 0.0_wp), gap, candidate, error)
    if (allocated(error)) return
    call contact%solve(force_control, 1.0_wp, 1.0e-8_wp, 50, state, error)
    if (allocated(error)) return
    radius = sqrt(lattice%cell_area()*count(candidate)/pi)
    call check_true(error, state%converged, 'converged')
    if (allocated(error)) return
    call check(error, 2.0_wp*radius*state%motion(normal), 1.0_wp, 2.4e-3_wp, 'approach')
    if (allocated(error)) return
    call check_true(error, all((state%pressure > 0.0_wp) .eqv. candidate), 'contact on the punch and nowhere else')
  end subroutine test_flat_punch

  !> Rough surfaces: the convolution solver ends at the solution of the direct one.
  subroutine test_methods_agree(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(normal_contact_t) :: contact
    type(direct_contact_t) :: direct
    type(contact_state_t) :: state, exact
    type(elastic_pair_t) :: pair
    real(wp) :: gap(25, 25), noise(25, 25)
    logical :: candidate(25, 25)
    integer :: i

    pair = elastic_pair_t(1.0_wp/pi, 0.0_wp, 0.0_wp)
    do i = 1, 40
      call paraboloid(12, lattice, gap, candidate, error)
      if (allocated(error)) return
      call random_number(noise)
      gap = gap + 0.05_wp*i*noise**3
      candidate = noise < 0.9_wp
      call new_normal_contact(contact, lattice, pair, gap, candidate, error)
      if (allocated(error)) return
      call new_direct_contact(direct, lattice, pair, gap, candidate, error)
      if (allocated(error)) return
      call contact%solve(force_control, 1.0_wp, 1.0e-10_wp, 80, state, error)
      if (allocated(error)) return
      call direct%solve(force_control, 1.0_wp, 1.0e-10_wp, 80, exact, error)
      if (allocated(error)) return
      call check_true(error, state%converged .and. exact%converged, 'both converge')
      if (allocated(error)) return
      call check(error, reshape(state%pressure, [625]), reshape(exact%pressure, [625]), &
                 1.0e-8_wp*maxval(exact%pressure), 'pressure')
      if (allocated(error)) return
      call check(error, state%motion(normal), exact%motion(normal), 1.0e-9_wp, 'approach')
      if (allocated(error)) return
    end do
  end subroutine test_methods_agree

  !> The lattice of every second node gives the direct method nearly the area of a first contact.
  subroutine test_coarse_area(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(direct_contact_t) :: direct
    type(contact_state_t) :: state, again
    real(wp) :: gap(51, 51)
    logical :: candidate(51, 51)

    call paraboloid(25, lattice, gap, candidate, error)
    if (allocated(error)) return
    call new_direct_contact(direct, lattice, elastic_pair_t(1.0_wp/pi, 0.0_wp, 0.0_wp), gap, candidate, error)
    if (allocated(error)) return
    call direct%solve(force_control, 1.2_wp, 1.0e-10_wp, 20, state, error)
    if (allocated(error)) return
    call check_true(error, state%converged .and. state%sweeps <= 4, 'areas: five from where the bodies would overlap')
    if (allocated(error)) return
    call direct%solve(force_control, 1.2_wp, 1.0e-10_wp, 20, again, error, candidate)
    if (allocated(error)) return
    call check(error, maxval(abs(again%pressure - state%pressure)), 0.0_wp, 1.0e-12_wp*maxval(state%pressure), 'pressure')
  end subroutine test_coarse_area

  !> Nodes enter and leave: one node, its complement and a random half lead to the same contact.
  subroutine test_any_start(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(direct_contact_t) :: direct
    type(contact_state_t) :: state, expected
    real(wp) :: gap(25, 25), noise(25, 25)
    logical :: candidate(25, 25), start(25, 25)
    integer :: i

    call paraboloid(12, lattice, gap, candidate, error)
    if (allocated(error)) return
    call random_number(noise)
    call new_direct_contact(direct, lattice, elastic_pair_t(1.0_wp/pi, 0.0_wp, 0.0_wp), gap + 0.1_wp*noise, candidate, error)
    if (allocated(error)) return
    call direct%solve(force_control, 1.0_wp, 1.0e-10_wp, 80, expected, error)
    if (allocated(error)) return
    do i = 1, 3
      start = .false.
      start(1, 1) = .true.
      if (i == 2) start = .not. start
      if (i == 3) start = noise < 0.5_wp
      call direct%solve(force_control, 1.0_wp, 1.0e-10_wp, 80, state, error, start)
      if (allocated(error)) return
      call check_true(error, state%converged, 'converged')
      if (allocated(error)) return
      call check(error, reshape(state%pressure, [625]), reshape(expected%pressure, [625]), &
                 1.0e-10_wp*maxval(expected%pressure), 'pressure')
      if (allocated(error)) return
    end do
  end subroutine test_any_start

  !> No load, and an approach short of first touch.
  subroutine test_nothing_touches(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(normal_contact_t) :: contact
    type(direct_contact_t) :: direct
    type(contact_state_t) :: state(4)
    type(elastic_pair_t) :: pair
    real(wp) :: gap(25, 25)
    logical :: candidate(25, 25)
    integer :: i

    pair = elastic_pair_t(1.0_wp/pi, 0.0_wp, 0.0_wp)
    call paraboloid(12, lattice, gap, candidate, error)
    if (allocated(error)) return
    gap = gap + 0.1_wp
    call new_normal_contact(contact, lattice, pair, gap, candidate, error)
    if (allocated(error)) return
    call new_direct_contact(direct, lattice, pair, gap, candidate, error)
    if (allocated(error)) return
    call contact%solve(force_control, 0.0_wp, 1.0e-8_wp, 50, state(1), error)
    if (allocated(error)) return
    call contact%solve(displacement_control, 0.05_wp, 1.0e-8_wp, 50, state(2), error)
    if (allocated(error)) return
    call direct%solve(force_control, 0.0_wp, 1.0e-8_wp, 50, state(3), error)
    if (allocated(error)) return
    call direct%solve(displacement_control, 0.05_wp, 1.0e-8_wp, 50, state(4), error)
    if (allocated(error)) return
    do i = 1, 4
      call check_true(error, state(i)%converged .and. all(state(i)%zone == 0), 'converged without contact')
      if (allocated(error)) return
      call check(error, state(i)%motion(normal), merge(0.1_wp, 0.05_wp, modulo(i, 2) == 1), 1.0e-15_wp, 'approach')
      if (allocated(error)) return
      call check(error, minval(state(i)%gap), merge(0.0_wp, 0.05_wp, modulo(i, 2) == 1), 1.0e-15_wp, 'gap')
      if (allocated(error)) return
    end do
  end subroutine test_nothing_touches

  !> One and three threads end at the same bits.
  subroutine test_threads(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(normal_contact_t) :: contact
    type(contact_state_t) :: state(2)
    real(wp) :: gap(61, 61)
    logical :: candidate(61, 61)
    integer :: i

    call paraboloid(30, lattice, gap, candidate, error)
    if (allocated(error)) return
    do i = 1, 2
      call new_normal_contact(contact, lattice, elastic_pair_t(1.0_wp/pi, 0.0_wp, 0.0_wp), gap, candidate, error, &
                              n_threads=2*i - 1)
      if (allocated(error)) return
      call contact%solve(force_control, 1.0_wp, 1.0e-8_wp, 50, state(i), error)
      if (allocated(error)) return
    end do
    call check_true(error, maxval(state(1)%pressure) > 0.0_wp, 'a pressure')
    if (allocated(error)) return
    call check(error, reshape(state(2)%pressure, [3721]), reshape(state(1)%pressure, [3721]), 0.0_wp, 'pressure')
    if (allocated(error)) return
    call check(error, reshape(state(2)%gap, [3721]), reshape(state(1)%gap, [3721]), 0.0_wp, 'gap')
    if (allocated(error)) return
    call check(error, state(2)%motion, state(1)%motion, 0.0_wp, 'approach')
  end subroutine test_threads

  !> A solver that is stopped too early says so.
  subroutine test_not_converged(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(normal_contact_t) :: contact
    type(direct_contact_t) :: direct
    type(contact_state_t) :: state
    type(elastic_pair_t) :: pair
    real(wp) :: gap(61, 61)
    logical :: candidate(61, 61)

    pair = elastic_pair_t(1.0_wp/pi, 0.0_wp, 0.0_wp)
    call paraboloid(30, lattice, gap, candidate, error)
    if (allocated(error)) return
    call new_normal_contact(contact, lattice, pair, gap, candidate, error)
    if (allocated(error)) return
    call contact%solve(force_control, 1.0_wp, 1.0e-8_wp, 1, state, error)
    if (allocated(error)) return
    call check_true(error, .not. state%converged .and. state%residual_normal > 1.0e-8_wp, 'one sweep does not suffice')
    if (allocated(error)) return
    call new_direct_contact(direct, lattice, pair, gap, candidate, error)
    if (allocated(error)) return
    call direct%solve(force_control, 1.0_wp, 1.0e-8_wp, 1, state, error)
    if (allocated(error)) return
    call check_true(error, .not. state%converged .and. state%residual_normal > 1.0e-8_wp, 'one solve does not suffice')
  end subroutine test_not_converged

  subroutine test_bad_input(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: raised
    type(lattice_t) :: lattice
    type(normal_contact_t) :: contact
    type(direct_contact_t) :: direct
    real(wp) :: gap(25, 25)
    logical :: candidate(25, 25)

    call paraboloid(12, lattice, gap, candidate, error)
    if (allocated(error)) return
    call new_normal_contact(contact, lattice, elastic_pair_t(), gap(:, :20), candidate, raised)
    call check_raised(error, raised, status%invalid_input, 'a gap of another shape')
    if (allocated(error)) return
    candidate = .false.
    call new_direct_contact(direct, lattice, elastic_pair_t(), gap, candidate, raised)
    call check_raised(error, raised, status%invalid_input, 'no candidate')
  end subroutine test_bad_input

end module test_contact
