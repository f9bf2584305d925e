!> The direct method with friction: closed solutions, symmetries, controls, histories, and the other method.
!>
!> E* = 1, R = 1 and P = 4/3 make the contact radius of the sphere 1, its approach 1 and p0 = 2/pi.
module test_direct_friction
  use, intrinsic :: iso_fortran_env, only: real32
  use hc_precision, only: wp, pi, lk
  use hc_error, only: error_t
  use hc_lattice, only: lattice_t, new_lattice, equilateral_basis
  use hc_elastic_pair, only: elastic_pair_t
  use hc_contact_state, only: contact_state_t, new_friction_state, load_target_t, force_control, displacement_control, &
    stick, slip, normal, along_x, along_y, about_z, no_progress
  use hc_coulomb, only: coulomb_t
  use hc_contact_problem, only: friction_problem_t, new_friction_problem
  use hc_contact_solver, only: friction_solver_t
  use hc_frictional_contact, only: frictional_contact_t, new_frictional_contact
  use hc_direct_contact, only: direct_contact_t, new_direct_contact, exchange
  use hc_block_cholesky, only: solve_blocks
  use hc_direct_friction, only: direct_friction_t, new_direct_friction
  use hc_area_factors, only: area_factors_t, factored_area_t
  use hc_flexibility_dense, only: dense_flexibility_t, new_dense_flexibility
  use hc_lapack, only: dposv
  use hc_options, only: direct_options_t
  use testing, only: test_t, new_test, check, check_true, largest, coordinate
  implicit none
  private

  public :: collect_direct_friction

  integer, parameter :: f = force_control, d = displacement_control
  real(wp), parameter :: load = 4.0_wp/3.0_wp, tight = 1.0e-10_wp

contains

  subroutine collect_direct_friction(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('ring', test_ring), &
      new_test('exchange', test_exchange), &
      new_test('blocks', test_blocks), &
      new_test('kept_factors', test_kept_factors), &
      new_test('whole_matrix', test_whole_matrix), &
      new_test('cattaneo_mindlin', test_cattaneo_mindlin), &
      new_test('lubkin', test_lubkin), &
      new_test('dissimilar', test_dissimilar), &
      new_test('no_slip_punch', test_no_slip_punch), &
      new_test('no_friction', test_no_friction), &
      new_test('goodman', test_goodman), &
      new_test('swap', test_swap), &
      new_test('controls', test_controls), &
      new_test('far_away', test_far_away), &
      new_test('units', test_units), &
      new_test('strong_coupling', test_strong_coupling), &
      new_test('methods_agree', test_methods_agree), &
      new_test('as_written', test_as_written), &
      new_test('gross_sliding', test_gross_sliding), &
      new_test('nothing_touches', test_nothing_touches), &
      new_test('few_nodes', test_few_nodes), &
      new_test('mask', test_mask), &
      new_test('not_converged', test_not_converged) &
    ]
  end subroutine collect_direct_friction

  !> A sphere, its apex at `apex`; n nodes on each side of the apex, a_nodes spacings in the contact radius.
  subroutine sphere(problem, n, a_nodes, beta, gamma, friction, error, goodman, apex, first, scale)
    type(friction_problem_t), intent(out) :: problem
    integer, intent(in) :: n, a_nodes
    real(wp), intent(in) :: beta, gamma
    type(coulomb_t), intent(in) :: friction
    type(error_t), allocatable, intent(out) :: error
    logical, intent(in), optional :: goodman
    real(wp), intent(in), optional :: apex(2)
    !> Indices of the first node
    integer, intent(in), optional :: first(2)
    !> Length and pressure that stand for 1
    real(wp), intent(in), optional :: scale(2)
    type(lattice_t) :: lattice
    real(wp), dimension(2*n + 1, 2*n + 1) :: x, y
    logical :: candidate(2*n + 1, 2*n + 1), simple
    real(wp) :: center(2), unit(2)
    integer :: corner(2)

    simple = .false.
    if (present(goodman)) simple = goodman
    center = 0.0_wp
    if (present(apex)) center = apex
    corner = -n
    if (present(first)) corner = first
    unit = 1.0_wp
    if (present(scale)) unit = scale
    candidate = .true.
    call new_lattice(lattice, equilateral_basis(unit(1)/a_nodes), corner, [2*n + 1, 2*n + 1], error)
    if (allocated(error)) return
    call lattice%coordinates(x, y)
    call new_friction_problem(problem, lattice, elastic_pair_t(1.0_wp/pi/unit(2), beta/pi/unit(2), gamma/pi/unit(2)), &
                              0.5_wp*((x - center(1))**2 + (y - center(2))**2)/unit(1), candidate, friction, simple, &
                              error)
  end subroutine sphere

  !> One load step, incremental; it must converge.
  subroutine step(solver, state, control, value, error)
    class(friction_solver_t), intent(inout) :: solver
    !> From and to; before the first load not allocated
    type(contact_state_t), intent(inout) :: state
    integer, intent(in) :: control(4)
    real(wp), intent(in) :: value(4)
    type(error_t), allocatable, intent(out) :: error
    type(contact_state_t) :: next

    if (.not. allocated(state%pressure)) call new_friction_state(state, solver%problem%lattice)
    call solver%solve_step(state, state%relative_displacement, load_target_t(control, value), tight, 40, next, error)
    if (allocated(error)) return
    state = next
    call check_true(error, state%converged .and. .not. state%sliding, 'the step converges')
    if (allocated(error)) return
    call check(error, [state%residual_normal, state%residual_tangential, state%residual_force, &
                       state%residual_shear_force, state%residual_torque], spread(0.0_wp, 1, 5), tight, 'residuals')
  end subroutine step

  !> Largest difference of two sets of tractions, relative to the largest pressure.
  pure real(wp) function difference(a, b)
    type(contact_state_t), intent(in) :: a, b
    difference = largest([largest(a%pressure - b%pressure), largest(a%traction - b%traction)])/maxval(b%pressure)
  end function difference

  !> Radius of stick over that of contact, from the numbers of nodes.
  pure real(wp) function stick_ratio(state)
    type(contact_state_t), intent(in) :: state
    stick_ratio = sqrt(count(state%zone == stick)/real(count(state%pressure > 0.0_wp), wp))
  end function stick_ratio

  !> Six neighbours in the middle of the window, those inside of it at a corner; never around the rim.
  subroutine test_ring(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: window
    logical :: area(5, 4), line(3, 1)

    area = .false.
    area(3, 2) = .true.
    call check_true(error, all(pack(window%dilated(area), .true.) .eqv. [ &
                                 .false., .false., .true., .true., .false., &
                                 .false., .true., .true., .true., .false., &
                                 .false., .true., .true., .false., .false., &
                                 .false., .false., .false., .false., .false.]), 'a node and its neighbours')
    if (allocated(error)) return
    area = .false.
    area(1, 1) = .true.
    call check(error, count(window%dilated(area)), 3, 'the acute corner')
    if (allocated(error)) return
    area = .false.
    area(5, 1) = .true.
    call check(error, count(window%dilated(area)), 4, 'the obtuse corner')
    if (allocated(error)) return
    line(:, 1) = [.true., .false., .false.]
    call check_true(error, all(pack(window%dilated(line), .true.) .eqv. [.true., .true., .false.]), 'a window of one row')
  end subroutine test_ring

  !> Whole sets as long as the number of wrong nodes falls, then the last one alone.
  subroutine test_exchange(error)
    type(error_t), allocatable, intent(out) :: error
    logical(lk) :: active(4)
    logical :: wrong(4)
    integer, parameter :: most = 10
    integer :: fewest, left, i

    active = [.true., .true., .false., .false.]
    wrong = [.false., .true., .true., .false.]
    fewest = huge(1)
    left = most
    call exchange(wrong, most, fewest, left, active)
    call check_true(error, all(active .eqv. [.true., .false., .true., .false.]), 'all wrong nodes')
    if (allocated(error)) return
    do i = 1, most
      active = [.true., .true., .false., .false.]
      call exchange(wrong, most, fewest, left, active)
    end do
    call check_true(error, all(active .eqv. [.true., .true., .true., .false.]), 'one node after all exchanges of sets')
    if (allocated(error)) return
    call exchange([.false., .true., .false., .false.], most, fewest, left, active)
    call check(error, left, most, 'fewer wrong nodes than ever')
  end subroutine test_exchange

  !> Solutions to rounding of any size, none where the coupling is strong, one block alone.
  subroutine test_blocks(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 60, n_1 = 25
    real(wp), parameter :: coupling(3) = [0.0_wp, 0.1_wp, 3.0_wp], size_of(3) = [1.0_wp, 1.0e-60_wp, 1.0e60_wp]
    real(wp) :: base(n, n), matrix(n, n), x(n, 3), unknown(n, 3)
    real(real32) :: first(n_1, n_1)
    logical :: solved
    integer :: i, j

    call random_number(x)
    do i = 1, n
      base(:, i) = [(1.0_wp/(1.0_wp + abs(i - j)), j=1, n)]
    end do
    x = x*spread(size_of, 1, n)
    do i = 1, 3
      matrix = base
      matrix(:n_1, n_1 + 1:) = coupling(i)*base(:n_1, n_1 + 1:)
      matrix(n_1 + 1:, :n_1) = 0.7_wp*base(n_1 + 1:, :n_1)
      matrix(:n_1, 3) = matrix(:n_1, 3) + 0.1_wp*coupling(i)      ! friction makes the first block unsymmetric
      first = real(base(:n_1, :n_1), real32)
      call solve_blocks(n, n_1, first, matrix, matmul(matrix, x), unknown, solved)
      call check_true(error, solved .eqv. (i < 3), 'solved as long as the coupling is weak')
      if (allocated(error)) return
      do j = 1, merge(3, 0, solved)
        call check(error, unknown(:, j), x(:, j), 1.0e-13_wp*size_of(j), 'unknowns')
        if (allocated(error)) return
      end do
    end do
    ! pressures alone
    first = real(base(:n_1, :n_1), real32)
    call solve_blocks(n_1, n_1, first, base(:n_1, :n_1), matmul(base(:n_1, :n_1), x(:n_1, :1)), unknown(:n_1, :1), solved)
    call check_true(error, solved, 'one block')
    if (allocated(error)) return
    call check(error, unknown(:n_1, 1), x(:n_1, 1), 1.0e-13_wp, 'one block')
    if (allocated(error)) return
    ! a slip node that carries nothing, with a compliance beyond single precision
    matrix(n, n) = 1.0e50_wp
    first = real(base(:n_1, :n_1), real32)
    call solve_blocks(n, n_1, first, matrix, x, unknown, solved)
    call check_true(error, .not. solved, 'too large for single precision')
    if (allocated(error)) return
    matrix(n, n) = -1.0_wp
    first = real(base(:n_1, :n_1), real32)
    call solve_blocks(n, n_1, first, matrix, x, unknown, solved)
    call check_true(error, .not. solved, 'second block not positive definite')
    if (allocated(error)) return
    matrix(n, n) = base(n, n)
    first(n_1, n_1) = -1.0_real32
    call solve_blocks(n, n_1, first, matrix, x, unknown, solved)
    call check_true(error, .not. solved, 'first block not positive definite')
  end subroutine test_blocks

  !> Factors of an area, of one with other zones in which nodes have come and gone, and of one that has lost a node of the core:
  !> they invert the matrix of equal shear compliances to single precision, and the rows of the first serve the second.
  subroutine test_kept_factors(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: side = 15
    real(wp), parameter :: shear = 1.3_wp
    type(lattice_t) :: lattice
    type(dense_flexibility_t) :: flexibility
    type(area_factors_t) :: factors
    real(wp) :: unit, across(2, side**2), spring(side**2)
    integer :: i

    call new_lattice(lattice, equilateral_basis(0.1_wp), [0, 0], [side, side], error)
    if (allocated(error)) return
    call new_dense_flexibility(flexibility, lattice, elastic_pair_t(1.0_wp, 0.0_wp, 0.6_wp), error)
    if (allocated(error)) return
    unit = maxval(flexibility%normal_influence([1], 1))
    call random_number(spring)
    across(1, :) = cos([(0.1_wp*i, i=1, side**2)])
    across(2, :) = sin([(0.1_wp*i, i=1, side**2)])
    call check_area([(i, i=1, 120)], [(i, i=1, 80)], 70, 120, 'first area')
    if (allocated(error)) return
    call check_area([(i, i=1, 115), (i, i=121, 124)], [(i, i=1, 75), 121], 60, 124, 'others come, go and slip')
    if (allocated(error)) return
    call check_area([(i, i=1, 115), (i, i=121, 124)], [(i, i=3, 75)], 60, 124 + 119, 'the core has lost a node')
    if (allocated(error)) return
    call check(error, factors%wanted, 120 + 2*119, 'rows of all areas')

  contains

    !> Solve for random displacements, and compare with LAPACK in double precision.
    subroutine check_area(contact, stuck, last_sure, factorized, what)
      !> Nodes in contact, and those that stick; the others up to 100 slide
      integer, intent(in) :: contact(:), stuck(:)
      !> Last node that is of the core if L is made anew; rows that have been factorized by then
      integer, intent(in) :: last_sure, factorized
      character(len=*), intent(in) :: what
      real(wp), allocatable :: k(:, :), t(:, :), x(:, :), y(:, :), given(:), found(:), axis(:, :)
      integer, allocatable :: sliding(:), node(:)
      integer :: a, b, n, s, info
      logical :: done

      sliding = pack(contact, contact <= 100 .and. [(all(stuck /= contact(a)), a=1, size(contact))])
      n = size(contact)
      s = size(stuck)
      call factors%factorize(flexibility, unit, shear, direct_options_t(), &
                             factored_area_t(contact, stuck, stuck <= last_sure, sliding, across(:, sliding), spring(sliding)), &
                             done, error)
      if (allocated(error)) return
      call check_true(error, done, what//': positive definite')
      if (allocated(error)) return
      call check(error, factors%factorized, factorized, what//': rows')
      if (allocated(error)) return
      node = [stuck, stuck, sliding]
      allocate (k(n, n), t(size(node), size(node)), axis(2, size(node)), given(n + size(node)), found(n + size(node)))
      do a = 1, n
        k(:, a) = flexibility%normal_influence(contact, contact(a))/unit
      end do
      axis = 0.0_wp
      axis(1, :s) = 1.0_wp
      axis(2, s + 1:2*s) = 1.0_wp
      axis(:, 2*s + 1:) = across(:, sliding)
      do a = 1, size(node)
        t(:, a) = shear*flexibility%normal_influence(node, node(a))/unit
        do b = 1, size(node)
          t(b, a) = t(b, a)*dot_product(axis(:, a), axis(:, b))
        end do
        if (a > 2*s) t(a, a) = t(a, a) + spring(node(a))
      end do
      call random_number(given)
      call factors%apply(given, found)
      y = reshape(given(:n), [n, 1])
      x = reshape(given(n + 1:), [size(node), 1])
      call dposv('U', n, 1, k, n, y, n, info)
      call dposv('U', size(node), 1, t, size(node), x, size(node), info)
      ! condition 30, single precision
      call check(error, found, [y(:, 1), x(:, 1)], 3.0e-5_wp*largest(found), what//': unknowns')
    end subroutine check_area

  end subroutine test_kept_factors

  !> The whole matrix of each area leads to the same state as kept factors, in as many areas; these take few directions of GMRES.
  subroutine test_whole_matrix(error)
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem
    type(direct_friction_t) :: kept, whole
    type(contact_state_t) :: one, other
    integer :: i

    call sphere(problem, 12, 9, -0.19_wp, 0.47_wp, coulomb_t(0.3_wp), error)
    if (allocated(error)) return
    call new_direct_friction(kept, problem, error)
    if (allocated(error)) return
    problem%options%direct%most_explicit = huge(1)
    call new_direct_friction(whole, problem, error)
    if (allocated(error)) return
    do i = 1, 3
      call step(kept, one, [f, f, f, f], [load, 0.05_wp*i*load, 0.0_wp, 0.02_wp*i], error)
      if (allocated(error)) return
      call step(whole, other, [f, f, f, f], [load, 0.05_wp*i*load, 0.0_wp, 0.02_wp*i], error)
      if (allocated(error)) return
      call check(error, difference(one, other), 0.0_wp, 3.0e-10_wp, 'tractions')
      if (allocated(error)) return
      call check_true(error, one%sweeps <= other%sweeps + 3, 'as many areas')
      if (allocated(error)) return
      ! 5.7 to 7.5 of them measured
      call check_true(error, one%operator_applications <= 12.0_wp*one%sweeps, 'few products for each')
      if (allocated(error)) return
    end do
  end subroutine test_whole_matrix

  !> gamma = 0: c/a = (1 - Q/muP)^(1/3), shift = (3 mu P S/16 a) [1 - (1 - Q/muP)^(2/3)], S = 4 for E* = 1.
  !>
  !> At 12 spacings in the radius the shift is good to 2e-4, and c/a to a node or two on the circumference.
  subroutine test_cattaneo_mindlin(error)
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem
    type(direct_friction_t) :: solver
    type(contact_state_t) :: state, once
    real(wp), parameter :: mu = 0.5_wp, part(2) = [0.5_wp, 0.9_wp]
    real(wp) :: full
    integer :: i

    call sphere(problem, 15, 12, 0.0_wp, 0.0_wp, coulomb_t(mu), error)
    if (allocated(error)) return
    call new_direct_friction(solver, problem, error)
    if (allocated(error)) return
    call step(solver, state, [f, f, f, d], [load, 0.0_wp, 0.0_wp, 0.0_wp], error)
    if (allocated(error)) return
    call check(error, largest(state%traction), 0.0_wp, 1.0e-12_wp, 'no shear under a normal load')
    if (allocated(error)) return
    full = 0.75_wp*mu*load
    do i = 1, 2
      call step(solver, state, [f, f, f, d], [load, part(i)*mu*load, 0.0_wp, 0.0_wp], error)
      if (allocated(error)) return
      call check(error, state%motion(along_x)/full, 1.0_wp - (1.0_wp - part(i))**(2.0_wp/3.0_wp), 1.8e-4_wp, 'shift')
      if (allocated(error)) return
      call check(error, stick_ratio(state), (1.0_wp - part(i))**(1.0_wp/3.0_wp), 0.0216_wp, 'stick radius')
      if (allocated(error)) return
    end do
    ! at constant normal load one step leads to the same state as many
    call step(solver, once, [f, f, f, d], [load, part(2)*mu*load, 0.0_wp, 0.0_wp], error)
    if (allocated(error)) return
    call check(error, difference(once, state), 0.0_wp, 1.0e-9_wp, 'one step or many')
  end subroutine test_cattaneo_mindlin

  !> Lubkin's torsion at c/a = 0.8, mu = 0.5: twist (S_t mu p0/2) [K(k) - E(k)], k^2 = 1 - c^2/a^2, S_t = 2 (1 + gamma).
  subroutine test_lubkin(error)
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem
    type(direct_friction_t) :: solver
    type(contact_state_t) :: state, driven
    real(wp), parameter :: torque = 0.20701819680051448_wp, twist = 0.14824919179819687_wp

    call sphere(problem, 15, 12, 0.0_wp, 0.4_wp, coulomb_t(0.5_wp), error)
    if (allocated(error)) return
    call new_direct_friction(solver, problem, error)
    if (allocated(error)) return
    call step(solver, state, [f, f, f, f], [load, 0.0_wp, 0.0_wp, torque], error)
    if (allocated(error)) return
    ! 5e-4 is the error of a mesh with 12 spacings in the radius
    call check(error, state%motion(about_z)/twist, 1.0_wp, 5.2e-4_wp, 'twist')
    if (allocated(error)) return
    call check(error, stick_ratio(state), 0.8_wp, 0.0238_wp, 'stick radius')
    if (allocated(error)) return
    call step(solver, driven, [f, d, d, d], [load, 0.0_wp, 0.0_wp, state%motion(about_z)], error)
    if (allocated(error)) return
    call check(error, driven%load(about_z), torque, 1.0e-9_wp, 'torque of a prescribed twist')
  end subroutine test_lubkin

  !> Single step of beta = -0.18908, mu = 0.1: p_max 1.0350 p0, approach 0.9972, c/a 0.2155 (its discrete values
  !> scatter: 0.2128 at 15 spacings).
  subroutine test_dissimilar(error)
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem
    type(direct_friction_t) :: solver
    type(contact_state_t) :: state

    call sphere(problem, 17, 15, -0.1890756_wp, 0.4705882_wp, coulomb_t(0.1_wp), error)
    if (allocated(error)) return
    call new_direct_friction(solver, problem, error)
    if (allocated(error)) return
    call step(solver, state, [f, f, f, d], [load, 0.0_wp, 0.0_wp, 0.0_wp], error)
    if (allocated(error)) return
    call check(error, maxval(state%pressure)*pi/2.0_wp, 1.0350_wp, 4.6e-4_wp, 'largest pressure')
    if (allocated(error)) return
    call check(error, state%motion(normal), 0.9972_wp, 3.0e-4_wp, 'approach')
    if (allocated(error)) return
    call check(error, stick_ratio(state), 0.2155_wp, 0.003_wp, 'stick radius')
    if (allocated(error)) return
    call check_true(error, state%sweeps <= 20, 'a sensible number of linear solutions')
  end subroutine test_dissimilar

  !> Flat punch without slip: P = kappa 2 E* a approach, kappa = atanh(beta)/beta; kappa is the ratio to no friction.
  subroutine test_no_slip_punch(error)
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem
    type(direct_friction_t) :: solver
    type(lattice_t) :: lattice
    type(contact_state_t) :: rough, smooth
    real(wp), dimension(25, 25) :: x, y
    real(wp), parameter :: beta = 0.3_wp
    integer :: i

    call new_lattice(lattice, equilateral_basis(0.1_wp), [-12, -12], [25, 25], error)
    if (allocated(error)) return
    call lattice%coordinates(x, y)
    do i = 1, 2
      call new_friction_problem(problem, lattice, elastic_pair_t(1.0_wp/pi, beta/pi, 0.4_wp/pi), 0.0_wp*x, &
                                x**2 + y**2 <= 1.0_wp + 1.0e-9_wp, coulomb_t(no_slip=i == 1), .false., error)
      if (allocated(error)) return
      call new_direct_friction(solver, problem, error)
      if (allocated(error)) return
      if (i == 1) call step(solver, rough, [d, f, f, f], [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], error)
      if (i == 2) call step(solver, smooth, [d, f, f, f], [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], error)
      if (allocated(error)) return
    end do
    call check_true(error, all(rough%zone /= slip), 'no slip')
    if (allocated(error)) return
    ! the ratio is off by 7e-4 with 10 spacings in the radius
    call check(error, rough%load(normal)/smooth%load(normal), atanh(beta)/beta, 8.2e-4_wp, 'stiffness')
  end subroutine test_no_slip_punch

  !> mu = 0 is the frictionless method.
  subroutine test_no_friction(error)
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem
    type(direct_friction_t) :: solver
    type(direct_contact_t) :: smooth
    type(contact_state_t) :: state, expected

    call sphere(problem, 9, 7, -0.3_wp, 0.4_wp, coulomb_t(0.0_wp), error, apex=[0.2_wp, -0.1_wp])
    if (allocated(error)) return
    call new_direct_friction(solver, problem, error)
    if (allocated(error)) return
    call step(solver, state, [f, f, f, f], [load, 0.0_wp, 0.0_wp, 0.0_wp], error)
    if (allocated(error)) return
    call new_direct_contact(smooth, problem%lattice, problem%medium, problem%initial_gap, logical(problem%candidate), error)
    if (allocated(error)) return
    call smooth%solve(f, load, tight, 40, expected, error)
    if (allocated(error)) return
    call check(error, largest(state%pressure - expected%pressure), 0.0_wp, 1.0e-11_wp, 'pressure')
    if (allocated(error)) return
    call check(error, largest(state%traction), 0.0_wp, 0.0_wp, 'shear traction')
    if (allocated(error)) return
    ! shifts and twist that nothing determines stay where they are
    call step(solver, state, [f, d, d, d], [load, 0.3_wp, -0.2_wp, 0.1_wp], error)
    if (allocated(error)) return
    call step(solver, state, [f, f, f, f], [load, 0.0_wp, 0.0_wp, 0.0_wp], error)
    if (allocated(error)) return
    call check(error, state%motion(along_x:4), [0.3_wp, -0.2_wp, 0.1_wp], 1.0e-15_wp, 'motions')
  end subroutine test_no_friction

  !> Goodman: shear tractions as large as ever, but the pressure is that of Hertz.
  subroutine test_goodman(error)
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem
    type(direct_friction_t) :: solver
    type(direct_contact_t) :: smooth
    type(contact_state_t) :: state, expected

    call sphere(problem, 9, 7, 0.3_wp, 0.4_wp, coulomb_t(0.2_wp), error, goodman=.true.)
    if (allocated(error)) return
    call new_direct_friction(solver, problem, error)
    if (allocated(error)) return
    call step(solver, state, [f, f, f, d], [load, 0.1_wp, 0.0_wp, 0.0_wp], error)
    if (allocated(error)) return
    call new_direct_contact(smooth, problem%lattice, problem%medium, problem%initial_gap, logical(problem%candidate), error)
    if (allocated(error)) return
    call smooth%solve(f, load, tight, 40, expected, error)
    if (allocated(error)) return
    call check(error, largest(state%pressure - expected%pressure), 0.0_wp, 1.0e-9_wp, 'pressure')
    if (allocated(error)) return
    call check_true(error, largest(state%traction) > 0.1_wp*maxval(state%pressure), 'shear traction')
  end subroutine test_goodman

  !> Swap the bodies and reverse the tangential loads: same pressure and approach, shear, shifts and twist reversed.
  subroutine test_swap(error)
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem
    type(direct_friction_t) :: solver
    type(contact_state_t) :: one, other
    real(wp), parameter :: tangential(3) = [0.15_wp, -0.1_wp, 0.05_wp]

    call sphere(problem, 9, 7, 0.3_wp, 0.4_wp, coulomb_t(0.4_wp), error, apex=[0.1_wp, 0.05_wp])
    if (allocated(error)) return
    call new_direct_friction(solver, problem, error)
    if (allocated(error)) return
    call step(solver, one, [f, f, f, f], [load, tangential], error)
    if (allocated(error)) return
    call sphere(problem, 9, 7, -0.3_wp, 0.4_wp, coulomb_t(0.4_wp), error, apex=[0.1_wp, 0.05_wp])
    if (allocated(error)) return
    call new_direct_friction(solver, problem, error)
    if (allocated(error)) return
    call step(solver, other, [f, f, f, f], [load, -tangential], error)
    if (allocated(error)) return
    call check_true(error, any(one%zone == stick) .and. any(one%zone == slip), 'stick and slip')
    if (allocated(error)) return
    other%traction = -other%traction
    call check(error, difference(one, other), 0.0_wp, 1.0e-9_wp, 'tractions')
    if (allocated(error)) return
    call check(error, one%motion(:4)*[1, -1, -1, -1], other%motion(:4), 1.0e-9_wp, 'motions')
  end subroutine test_swap

  !> Every mixture of loads and motions leads to the same state, off the center of the twist, too.
  subroutine test_controls(error)
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem
    type(direct_friction_t) :: solver
    type(contact_state_t) :: expected, state, pressed
    integer :: control(4), mixture, i

    call sphere(problem, 8, 6, 0.2_wp, 0.4_wp, coulomb_t(0.4_wp), error, apex=[0.3_wp, -0.2_wp])
    if (allocated(error)) return
    call new_direct_friction(solver, problem, error)
    if (allocated(error)) return
    call step(solver, pressed, [f, f, f, f], [load, 0.0_wp, 0.0_wp, 0.0_wp], error)
    if (allocated(error)) return
    expected = pressed
    call step(solver, expected, [f, f, f, f], [1.1_wp*load, 0.15_wp, -0.1_wp, 0.02_wp], error)
    if (allocated(error)) return
    do mixture = 0, 15
      control = [(merge(d, f, btest(mixture, i)), i=0, 3)]
      state = pressed
      call step(solver, state, control, merge(expected%load(:4), expected%motion(:4), control == f), error)
      if (allocated(error)) return
      call check(error, difference(state, expected), 0.0_wp, 1.0e-8_wp, 'tractions')
      if (allocated(error)) return
      call check(error, state%motion, expected%motion, 1.0e-8_wp, 'motions')
      if (allocated(error)) return
      call check(error, state%load, expected%load, 1.0e-8_wp, 'loads')
      if (allocated(error)) return
    end do
  end subroutine test_controls

  !> A contact a thousand radii from the origin is as good as one there.
  subroutine test_far_away(error)
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem
    type(direct_friction_t) :: solver
    type(contact_state_t) :: near, far
    real(wp) :: r(2)
    real(wp), parameter :: q(2) = [0.15_wp, -0.1_wp], torque = 0.03_wp

    call sphere(problem, 8, 6, 0.2_wp, 0.4_wp, coulomb_t(0.4_wp), error)
    if (allocated(error)) return
    call new_direct_friction(solver, problem, error)
    if (allocated(error)) return
    call step(solver, near, [f, f, f, f], [load, q, torque], error)
    if (allocated(error)) return
    ! node (7200, -3000) is the apex
    r = 7200.0_wp/6.0_wp*[1.0_wp, 0.0_wp] - 3000.0_wp/6.0_wp*[0.5_wp, 0.5_wp*sqrt(3.0_wp)]
    call sphere(problem, 8, 6, 0.2_wp, 0.4_wp, coulomb_t(0.4_wp), error, apex=r, first=[7200, -3000] - 8)
    if (allocated(error)) return
    call new_direct_friction(solver, problem, error)
    if (allocated(error)) return
    call step(solver, far, [f, f, f, f], [load, q, torque + r(1)*q(2) - r(2)*q(1)], error)
    if (allocated(error)) return
    ! coordinates of 1e3 cost three digits of the initial gap
    call check(error, difference(far, near), 0.0_wp, 1.0e-9_wp, 'tractions')
    if (allocated(error)) return
    call check(error, far%motion(about_z), near%motion(about_z), 1.0e-9_wp, 'twist')
    if (allocated(error)) return
    call check(error, far%motion(along_x:along_y), near%motion(along_x:along_y) - near%motion(about_z)*[-r(2), r(1)], &
               1.0e-9_wp*norm2(r), 'shifts')
  end subroutine test_far_away

  !> Micrometers and gigapascals change nothing.
  subroutine test_units(error)
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem
    type(direct_friction_t) :: solver
    type(contact_state_t) :: one, real_life
    real(wp), parameter :: length = 1.0e-6_wp, pressure = 7.0e10_wp
    real(wp), parameter :: value(4) = [load, 0.2_wp, 0.1_wp, 0.02_wp]

    call sphere(problem, 8, 6, 0.2_wp, 0.4_wp, coulomb_t(0.4_wp), error)
    if (allocated(error)) return
    call new_direct_friction(solver, problem, error)
    if (allocated(error)) return
    call step(solver, one, [f, f, f, f], value, error)
    if (allocated(error)) return
    call sphere(problem, 8, 6, 0.2_wp, 0.4_wp, coulomb_t(0.4_wp), error, scale=[length, pressure])
    if (allocated(error)) return
    call new_direct_friction(solver, problem, error)
    if (allocated(error)) return
    call step(solver, real_life, [f, f, f, f], value*pressure*length**2*[1.0_wp, 1.0_wp, 1.0_wp, length], error)
    if (allocated(error)) return
    real_life%pressure = real_life%pressure/pressure
    real_life%traction = real_life%traction/pressure
    call check(error, difference(real_life, one), 0.0_wp, 1.0e-10_wp, 'tractions')
    if (allocated(error)) return
    call check(error, real_life%motion(:4)/[length, length, length, 1.0_wp], one%motion(:4), 1.0e-10_wp, 'motions')
  end subroutine test_units

  !> beta = 0.5, mu = 0.6: cold single steps, reversals, a turning load, unloading and a shift; all residuals at 1e-10.
  subroutine test_strong_coupling(error)
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem
    type(direct_friction_t) :: solver
    type(contact_state_t) :: state, cold
    real(wp) :: part
    integer :: i

    call sphere(problem, 12, 9, 0.5_wp, 0.0_wp, coulomb_t(0.6_wp), error)
    if (allocated(error)) return
    call new_direct_friction(solver, problem, error)
    if (allocated(error)) return
    do i = 0, 9, 3
      cold = contact_state_t()
      part = 0.1_wp*i
      call step(solver, cold, [f, f, f, d], [load, part*0.6_wp*load, 0.0_wp, 0.0_wp], error)
      if (allocated(error)) return
    end do
    call step(solver, state, [f, f, f, d], [load, 0.0_wp, 0.0_wp, 0.0_wp], error)
    if (allocated(error)) return
    call step(solver, state, [f, f, f, d], [load, 0.4_wp, 0.0_wp, 0.0_wp], error)
    if (allocated(error)) return
    call step(solver, state, [f, f, f, d], [load, -0.4_wp, 0.2_wp, 0.0_wp], error)
    if (allocated(error)) return
    call step(solver, state, [f, f, f, f], [0.6_wp*load, -0.2_wp, 0.1_wp, 0.05_wp], error)
    if (allocated(error)) return
    call step(solver, state, [f, f, f, f], [1.2_wp*load, 0.0_wp, -0.3_wp, 0.1_wp], error)
    if (allocated(error)) return
    call step(solver, state, [d, d, d, f], [0.5_wp, 1.0_wp, -2.0_wp, 0.0_wp], error)
    if (allocated(error)) return
    call check(error, norm2(state%load(along_x:along_y))/(0.6_wp*state%load(normal)), 1.0_wp, 9.2e-5_wp, 'full slip')
    if (allocated(error)) return
    ! the same loads again: nothing slips any more
    call step(solver, state, [d, d, d, d], state%motion, error)
    if (allocated(error)) return
    call check(error, largest(state%slip_increment), 0.0_wp, 1.0e-9_wp, 'no motion, no slip')
  end subroutine test_strong_coupling

  !> The iteration as the dissertation writes it: with gamma = 0, where slip is parallel to the load, it ends where Newton's
  !> does; with gamma > 0 directions stand, and it says so.
  subroutine test_as_written(error)
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem
    type(direct_friction_t) :: newton, written
    type(contact_state_t) :: start, one, other
    real(wp), parameter :: gamma(2) = [0.0_wp, 0.49_wp], mu = 0.5_wp, value(4) = [load, 0.4_wp*mu*load, 0.0_wp, 0.0_wp]
    integer :: i

    do i = 1, 2
      call sphere(problem, 12, 9, 0.0_wp, gamma(i), coulomb_t(mu), error)
      if (allocated(error)) return
      call new_direct_friction(newton, problem, error)
      if (allocated(error)) return
      problem%options%direct%as_written = .true.
      call new_direct_friction(written, problem, error)
      if (allocated(error)) return
      one = contact_state_t()
      other = contact_state_t()
      call step(newton, one, [f, f, f, d], value, error)
      if (allocated(error)) return
      call new_friction_state(start, problem%lattice)
      call written%solve_step(start, start%relative_displacement, load_target_t([f, f, f, d], value), tight, 40, other, error)
      if (allocated(error)) return
      call check_true(error, other%converged .eqv. i == 1, 'converged')
      if (allocated(error)) return
      call check(error, difference(one, other), 0.0_wp, merge(1.0e-9_wp, 0.05_wp*mu, i == 1), 'tractions')
      if (allocated(error)) return
    end do
    call check_true(error, other%stopped == no_progress, 'zones and directions stand')
    if (allocated(error)) return
    call check(error, other%residual_normal, 0.0_wp, 1.0e-10_wp, 'alike bodies: the pressure does not feel it')
  end subroutine test_as_written

  !> A history through both methods, solved to 1e-10: tractions to 1e-9 mu p_max, motions likewise; with 650 nodes in contact it
  !> starts from the coarse lattice.
  subroutine test_methods_agree(error)
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem
    type(direct_friction_t), allocatable :: direct
    type(frictional_contact_t), allocatable :: fft
    type(contact_state_t) :: one, other
    real(wp), parameter :: mu = 0.3_wp
    real(wp), parameter :: value(4, 5) = reshape([ &
      0.5_wp*load, 0.0_wp, 0.0_wp, 0.0_wp, &
      load, 0.0_wp, 0.0_wp, 0.0_wp, &
      load, 0.2_wp, 0.1_wp, 0.0_wp, &
      0.9_wp*load, -0.1_wp, 0.2_wp, 0.02_wp, &
      1.1_wp*load, 0.0_wp, 0.0_wp, -0.04_wp], [4, 5])
    integer :: i, a_nodes

    do a_nodes = 9, 15, 6
      call sphere(problem, 4*a_nodes/3, a_nodes, -0.19_wp, 0.47_wp, coulomb_t(mu), error)
      if (allocated(error)) return
      allocate (direct, fft)
      call new_direct_friction(direct, problem, error)
      if (allocated(error)) return
      call new_frictional_contact(fft, problem, error)
      if (allocated(error)) return
      do i = 1, size(value, 2)
        call step(direct, one, [f, f, f, f], value(:, i), error)
        if (allocated(error)) return
        call step(fft, other, [f, f, f, f], value(:, i), error)
        if (allocated(error)) return
        call check(error, difference(one, other), 0.0_wp, 1.0e-9_wp*mu, 'tractions')
        if (allocated(error)) return
        call check(error, one%motion, other%motion, 1.0e-9_wp*mu, 'motions')
        if (allocated(error)) return
      end do
      deallocate (direct, fft)
      one = contact_state_t()
      other = contact_state_t()
    end do
  end subroutine test_methods_agree

  !> Tangential loads and torques beyond what friction can carry; just below, there still is a solution.
  subroutine test_gross_sliding(error)
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem
    type(direct_friction_t) :: solver
    type(contact_state_t) :: state, next
    real(wp), parameter :: mu = 0.5_wp
    integer :: i

    call sphere(problem, 9, 7, 0.1_wp, 0.4_wp, coulomb_t(mu), error)
    if (allocated(error)) return
    call new_direct_friction(solver, problem, error)
    if (allocated(error)) return
    call step(solver, state, [f, f, f, d], [load, 0.0_wp, 0.0_wp, 0.0_wp], error)
    if (allocated(error)) return
    do i = 1, 3
      call solver%solve_step(state, state%relative_displacement, load_target_t([f, f, f, merge(f, d, i == 3)], &
                             [load, merge(1.01_wp, 0.0_wp, i < 3)*mu*load, merge(0.9_wp, 0.0_wp, i == 2)*mu*load, &
                              merge(0.65_wp, 0.0_wp, i == 3)*mu*load]), 1.0e-8_wp, 40, next, error)
      if (allocated(error)) return
      call check_true(error, next%sliding .and. .not. next%converged, 'the load cannot be carried')
      if (allocated(error)) return
    end do
    call step(solver, state, [f, f, f, d], [load, 0.99_wp*mu*load, 0.0_wp, 0.0_wp], error)
  end subroutine test_gross_sliding

  !> No load, or an approach without overlap: no tractions; then contact again.
  subroutine test_nothing_touches(error)
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem
    type(direct_friction_t) :: solver
    type(contact_state_t) :: state

    call sphere(problem, 6, 4, 0.2_wp, 0.4_wp, coulomb_t(0.3_wp), error)
    if (allocated(error)) return
    call new_direct_friction(solver, problem, error)
    if (allocated(error)) return
    call step(solver, state, [f, f, f, d], [0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], error)
    if (allocated(error)) return
    call check(error, maxval(state%pressure), 0.0_wp, 0.0_wp, 'no pressure')
    if (allocated(error)) return
    call step(solver, state, [f, f, d, d], [load, 0.1_wp, 0.05_wp, 0.0_wp], error)
    if (allocated(error)) return
    call step(solver, state, [d, f, d, d], [-0.1_wp, 0.0_wp, 0.05_wp, 0.0_wp], error)
    if (allocated(error)) return
    call check(error, [maxval(state%pressure), largest(state%traction)], [0.0_wp, 0.0_wp], 0.0_wp, 'separated')
    if (allocated(error)) return
    call step(solver, state, [d, f, f, f], [0.3_wp, 0.0_wp, 0.0_wp, 0.0_wp], error)
  end subroutine test_nothing_touches

  !> Windows of one row, of one node, and loads that a single node carries.
  subroutine test_few_nodes(error)
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem
    type(direct_friction_t) :: solver
    type(lattice_t) :: lattice
    type(contact_state_t) :: state
    real(wp), allocatable :: x(:, :), y(:, :)
    real(wp) :: q
    integer :: i, extent(2, 3)

    extent = reshape([21, 1, 1, 21, 1, 1], [2, 3])
    do i = 1, 3
      call new_lattice(lattice, equilateral_basis(0.2_wp), -extent(:, i)/2, extent(:, i), error)
      if (allocated(error)) return
      allocate (x(extent(1, i), extent(2, i)), y(extent(1, i), extent(2, i)))
      call lattice%coordinates(x, y)
      call new_friction_problem(problem, lattice, elastic_pair_t(1.0_wp/pi, 0.2_wp/pi, 0.4_wp/pi), &
                                0.5_wp*(x**2 + y**2), x**2 + y**2 >= 0.0_wp, coulomb_t(0.3_wp), .false., error)
      if (allocated(error)) return
      deallocate (x, y)
      call new_direct_friction(solver, problem, error)
      if (allocated(error)) return
      state = contact_state_t()
      ! the first load is so small that one node carries it
      call step(solver, state, [f, f, f, f], [1.0e-4_wp, 1.0e-5_wp, 0.0_wp, 0.0_wp], error)
      if (allocated(error)) return
      call check(error, count(state%pressure > 0.0_wp), 1, 'nodes under a tiny load')
      if (allocated(error)) return
      call step(solver, state, [f, f, f, d], [0.3_wp, 0.02_wp, 0.03_wp, 0.0_wp], error)
      if (allocated(error)) return
      q = merge(0.001_wp, 0.0_wp, i < 3)
      call step(solver, state, [f, f, f, f], [0.2_wp, -0.01_wp, 0.0_wp, q], error)
      if (allocated(error)) return
      call step(solver, state, [d, d, f, f], [0.1_wp, 3.0_wp, 0.0_wp, 0.0_wp], error)
      if (allocated(error)) return
      call step(solver, state, [f, f, f, f], [1.0e-4_wp, 0.0_wp, 0.0_wp, 0.0_wp], error)
      if (allocated(error)) return
    end do
  end subroutine test_few_nodes

  !> Nodes that may not touch carry nothing, however far the bodies overlap there.
  subroutine test_mask(error)
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem
    type(direct_friction_t) :: solver
    type(contact_state_t) :: state

    call sphere(problem, 9, 7, 0.2_wp, 0.4_wp, coulomb_t(0.4_wp), error)
    if (allocated(error)) return
    associate (x => coordinate(problem%lattice, 1), y => coordinate(problem%lattice, 2))
      problem%candidate = x > -0.2_wp .and. x**2 + y**2 > 0.04_wp
    end associate
    call new_direct_friction(solver, problem, error)
    if (allocated(error)) return
    call step(solver, state, [f, f, f, f], [load, 0.0_wp, 0.0_wp, 0.0_wp], error)
    if (allocated(error)) return
    call step(solver, state, [f, f, f, f], [load, 0.2_wp, 0.1_wp, 0.02_wp], error)
    if (allocated(error)) return
    call check_true(error, .not. any(state%pressure > 0.0_wp .and. .not. problem%candidate), 'no pressure off the mask')
    if (allocated(error)) return
    call check_true(error, any(state%gap < -0.01_wp .and. .not. problem%candidate), 'the bodies overlap there')
  end subroutine test_mask

  !> Too few sweeps: the residuals say so, and there is no error.
  subroutine test_not_converged(error)
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem
    type(direct_friction_t) :: solver
    type(contact_state_t) :: start, state

    call sphere(problem, 9, 7, 0.3_wp, 0.4_wp, coulomb_t(0.4_wp), error)
    if (allocated(error)) return
    call new_direct_friction(solver, problem, error)
    if (allocated(error)) return
    call new_friction_state(start, problem%lattice)
    call solver%solve_step(start, start%relative_displacement, &
                           load_target_t([f, f, f, d], [load, 0.3_wp, 0.0_wp, 0.0_wp]), tight, 2, state, error)
    if (allocated(error)) return
    call check_true(error, .not. state%converged .and. .not. state%sliding, 'not converged')
    if (allocated(error)) return
    call check_true(error, max(state%residual_normal, state%residual_tangential, state%residual_shear_force) > tight, &
                    'residuals above the tolerance')
  end subroutine test_not_converged

end module test_direct_friction
