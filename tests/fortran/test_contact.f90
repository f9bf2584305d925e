!> Conjugate gradients, residuals and the two frictionless solvers.
module test_contact
  use hc_precision, only: wp, pi
  use hc_error, only: error_t, status
  use hc_lattice, only: lattice_t, new_lattice, equilateral_basis
  use hc_elastic_pair, only: elastic_pair_t
  use hc_contact_state, only: contact_state_t, force_control, displacement_control, normal
  use hc_contact_residuals, only: normal_residual, force_residual
  use hc_krylov, only: linear_system_t, projected_cg, projected_gmres, precondition_constraints, fulfil, solution_accurate, &
    iterations_used_up, solution_broke_off
  use hc_field_space, only: field_space_t
  use hc_normal_contact, only: normal_contact_t, new_normal_contact
  use hc_direct_contact, only: direct_contact_t, new_direct_contact
  use testing, only: test_t, new_test, check, check_raised, check_true
  implicit none
  private

  public :: collect_contact

  !> A small dense system, to test the iteration alone.
  type, extends(linear_system_t) :: dense_system_t
    real(wp) :: matrix(5, 5)
  contains
    procedure :: product => dense_product
    procedure :: precondition => dense_precondition
  end type dense_system_t

contains

  subroutine collect_contact(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('projected_cg', test_projected_cg), &
      new_test('three_constraints', test_three_constraints), &
      new_test('outcomes', test_outcomes), &
      new_test('norm_of_gmres', test_norm_of_gmres), &
      new_test('residuals', test_residuals), &
      new_test('hertz', test_hertz), &
      new_test('any_approach', test_any_approach), &
      new_test('flat_punch', test_flat_punch), &
      new_test('methods_agree', test_methods_agree), &
      new_test('any_start', test_any_start), &
      new_test('nothing_touches', test_nothing_touches), &
      new_test('threads', test_threads), &
      new_test('not_converged', test_not_converged), &
      new_test('bad_input', test_bad_input) &
    ]
  end subroutine collect_contact

  !> Minimum of x.Ax/2 - b.x under x_1 + x_2 + x_4 = 6, x_3 and x_5 fixed at zero, against Gauss elimination by hand.
  subroutine test_projected_cg(error)
    type(error_t), allocatable, intent(out) :: error
    type(dense_system_t) :: system
    real(wp) :: x(5), ax(5), multiplier(1), residual, constraint(5, 1)
    real(wp), allocatable :: mb(:, :)
    integer :: iterations, outcome, i

    system%matrix = 1.0_wp
    do i = 1, 5
      system%matrix(i, i) = 1.0_wp + i
    end do
    x = [6.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
    ax = matmul(system%matrix, x)
    constraint(:, 1) = [1.0_wp, 1.0_wp, 0.0_wp, 1.0_wp, 0.0_wp]
    call precondition_constraints(system, constraint(:, 1) > 0.0_wp, constraint, mb, error)
    if (allocated(error)) return
    call projected_cg(system, constraint(:, 1) > 0.0_wp, constraint, mb, [1.0_wp, 2.0_wp, 9.0_wp, 3.0_wp, 9.0_wp], x, ax, &
                      1.0e-12_wp, 20, multiplier, residual, iterations, outcome, error)
    if (allocated(error)) return
    ! i x_i + 6 = b_i + m on the active nodes and sum x = 6: m (1 + 1/2 + 1/4) = 6 + sum (6 - b_i)/i
    call check(error, multiplier(1), (6.0_wp + 5.0_wp + 2.0_wp + 0.75_wp)/1.75_wp, 1.0e-11_wp, 'multiplier')
    if (allocated(error)) return
    call check(error, x(2), (2.0_wp + multiplier(1) - 6.0_wp)/2.0_wp, 1.0e-11_wp, 'second unknown')
    if (allocated(error)) return
    call check(error, [sum(x), x(3), x(5)], [6.0_wp, 0.0_wp, 0.0_wp], 1.0e-12_wp, 'constraint and fixed nodes')
    if (allocated(error)) return
    call check_true(error, iterations <= 2 .and. residual <= 1.0e-12_wp .and. outcome == solution_accurate, &
                    'three unknowns, one constraint')
  end subroutine test_projected_cg

  !> Conjugate gradients say why they stopped: solved, out of iterations, a matrix that is not positive definite.
  subroutine test_outcomes(error)
    type(error_t), allocatable, intent(out) :: error
    type(dense_system_t) :: system
    real(wp) :: x(5), ax(5), multiplier(0), residual, none(5, 0)
    logical, parameter :: active(5) = .true.
    integer, parameter :: expected(3) = [solution_accurate, iterations_used_up, solution_broke_off], most(3) = [20, 2, 20]
    integer :: iterations, outcome, i, k

    do k = 1, 3
      system%matrix = 1.0_wp
      do i = 1, 5
        system%matrix(i, i) = 1.0_wp + i
      end do
      if (k == 3) system%matrix = -system%matrix
      x = 0.0_wp
      ax = 0.0_wp
      call projected_cg(system, active, none, none, [1.0_wp, 2.0_wp, 9.0_wp, 3.0_wp, -4.0_wp], x, ax, 1.0e-12_wp, most(k), &
                        multiplier, residual, iterations, outcome, error)
      if (allocated(error)) return
      call check(error, outcome, expected(k), 'outcome')
      if (allocated(error)) return
      call check_true(error, (residual <= 1.0e-12_wp) .eqv. outcome == solution_accurate, 'residual')
      if (allocated(error)) return
    end do
  end subroutine test_outcomes

  !> GMRES bounds the Euclidean norm of the weighted residuals, and returns it.
  subroutine test_norm_of_gmres(error)
    type(error_t), allocatable, intent(out) :: error
    type(dense_system_t) :: system
    real(wp) :: x(5), ax(5), multiplier(0), residual, none(5, 0), left, first
    real(wp), parameter :: rhs(5) = [1.0_wp, 2.0_wp, 9.0_wp, 3.0_wp, -4.0_wp], weight(5) = [1.0_wp, 2.0_wp, 1.0_wp, 0.5_wp, 1.0_wp]
    logical, parameter :: active(5) = .true.
    logical :: independent
    integer :: iterations, outcome, i, most

    first = norm2(weight*rhs)
    system%matrix = 1.0_wp
    do i = 1, 5
      system%matrix(i, i) = 1.0_wp + i
    end do
    system%matrix(2, 1) = -3.0_wp
    do most = 1, 5
      x = 0.0_wp
      ax = 0.0_wp
      call projected_gmres(system, active, none, none, none, weight, rhs, x, ax, 1.0e-10_wp, most, multiplier, independent, &
                           residual, iterations, outcome, error)
      if (allocated(error)) return
      left = norm2(weight*(rhs - matmul(system%matrix, x)))
      call check(error, residual, left, 1.0e-12_wp*first, 'the norm that is left')
      if (allocated(error)) return
      call check(error, outcome, merge(solution_accurate, iterations_used_up, left <= 1.0e-10_wp), 'outcome')
      if (allocated(error)) return
    end do
    call check(error, outcome, solution_accurate, 'as many directions as unknowns are enough')
  end subroutine test_norm_of_gmres

  !> Three constraints on four unknowns: the solution fulfils its own equations; dependent ones are told.
  subroutine test_three_constraints(error)
    type(error_t), allocatable, intent(out) :: error
    type(dense_system_t) :: system
    real(wp) :: x(5), ax(5), rhs(5), multiplier(3), residual, constraint(5, 3)
    real(wp), allocatable :: mb(:, :)
    real(wp), parameter :: wanted(3) = [6.0_wp, -1.0_wp, 2.0_wp]
    logical, parameter :: active(5) = [.true., .true., .false., .true., .true.]
    logical :: independent
    integer :: iterations, outcome, i

    system%matrix = 1.0_wp
    do i = 1, 5
      system%matrix(i, i) = 1.0_wp + i
    end do
    rhs = [1.0_wp, 2.0_wp, 9.0_wp, 3.0_wp, -4.0_wp]
    constraint(:, 1) = [1.0_wp, 1.0_wp, 0.0_wp, 1.0_wp, 1.0_wp]
    constraint(:, 2) = [0.0_wp, 1.0_wp, 0.0_wp, -2.0_wp, 0.0_wp]
    constraint(:, 3) = [3.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, -1.0_wp]
    call precondition_constraints(system, active, constraint, mb, error)
    if (allocated(error)) return
    call check(error, mb(:, 3), [1.5_wp, 0.0_wp, 0.0_wp, 0.2_wp, -1.0_wp/6.0_wp], 1.0e-15_wp, 'M B')
    if (allocated(error)) return
    x = [0.0_wp, 0.0_wp, 7.0_wp, 0.0_wp, 0.0_wp]
    call fulfil(constraint, mb, wanted, x, independent, field_space_t())
    call check_true(error, independent, 'independent constraints')
    if (allocated(error)) return
    call check(error, matmul(transpose(constraint), x), wanted, 1.0e-13_wp, 'constraints at the start')
    if (allocated(error)) return
    ax = matmul(system%matrix, x)
    call projected_cg(system, active, constraint, mb, rhs, x, ax, 1.0e-12_wp, 20, multiplier, residual, iterations, outcome, error)
    if (allocated(error)) return
    call check(error, matmul(transpose(constraint), x), wanted, 1.0e-12_wp, 'constraints')
    if (allocated(error)) return
    call check(error, x(3), 7.0_wp, 0.0_wp, 'an unknown that is fixed')
    if (allocated(error)) return
    call check(error, merge(matmul(system%matrix, x) - rhs - matmul(constraint, multiplier), 0.0_wp, active), &
               [(0.0_wp, i=1, 5)], 1.0e-11_wp, 'equations')
    if (allocated(error)) return

    constraint(:, 3) = 2.0_wp*constraint(:, 1)
    call precondition_constraints(system, active, constraint, mb, error)
    if (allocated(error)) return
    ax = x
    call fulfil(constraint, mb, wanted, x, independent, field_space_t())
    call check_true(error, .not. independent, 'constraints that depend on each other')
    if (allocated(error)) return
    call check(error, x, ax, 0.0_wp, 'the unknowns are left alone')
  end subroutine test_three_constraints

  subroutine dense_product(self, x, y, error)
    class(dense_system_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error
    y = matmul(self%matrix, x)
  end subroutine dense_product

  subroutine dense_precondition(self, x, y, error)
    class(dense_system_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error
    integer :: i
    y = [(x(i)/self%matrix(i, i), i=1, size(x))]
  end subroutine dense_precondition

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
