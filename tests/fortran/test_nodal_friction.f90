!> Friction that differs from node to node, and a bound of the shear traction.
module test_nodal_friction
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use hc_precision, only: wp, zk
  use hc_error, only: error_t
  use hc_lattice, only: lattice_t
  use hc_contact_state, only: contact_state_t, new_friction_state, load_target_t, force_control, displacement_control, &
    separated, stick, slip, normal, about_z
  use hc_friction_law, only: friction_law_t
  use hc_coulomb, only: coulomb_t
  use hc_nodal_coulomb, only: nodal_coulomb_t
  use hc_orthotropic_coulomb, only: orthotropic_coulomb_t
  use hc_contact_problem, only: friction_problem_t
  use hc_contact_solver, only: friction_solver_t
  use hc_frictional_contact, only: frictional_contact_t, new_frictional_contact
  use hc_subwindow_solver, only: windowed_friction_t, new_windowed_friction
  use hc_direct_friction, only: direct_friction_t, new_direct_friction
  use test_friction, only: new_sphere
  use testing, only: test_t, new_test, check, check_true, largest, coordinate
  implicit none
  private

  public :: collect_nodal_friction

  integer, parameter :: f = force_control, d = displacement_control
  !> Load of a contact of radius one, and coefficients inside and outside of a ring
  real(wp), parameter :: load = 4.0_wp/3.0_wp, inner = 0.5_wp, outer = 0.2_wp, ring = 0.6_wp
  real(wp), parameter :: pi = acos(-1.0_wp)

  !> Static and kinetic friction: nodes that slip at the end of a step have the coefficient `outer` in the next one, others `inner`.
  type, extends(nodal_coulomb_t) :: kinetic_t
  contains
    procedure :: begin_step => remember
  end type kinetic_t

contains

  !> Set the coefficients of a step by the zones before it.
  pure subroutine remember(self, zone)
    class(kinetic_t), intent(inout) :: self
    integer(zk), intent(in) :: zone(:, :)
    self%coefficient = reshape(merge(outer, inner, zone == slip), [size(zone)])
  end subroutine remember

  !> Nodes that slipped carry the kinetic coefficient times the pressure at most in the next step, the others the static one: in all
  !> solvers, on parts of the window and with coarser lattices.
  subroutine test_static_and_kinetic(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: alike, nodal
    type(windowed_friction_t) :: windowed
    type(direct_friction_t) :: dense
    type(friction_problem_t) :: problem
    type(kinetic_t) :: law
    type(contact_state_t) :: on_window(2), on_part(2), direct(2)
    real(wp), allocatable :: length(:, :), bound(:, :)
    logical, allocatable :: slipped(:, :)

    call new_nodal(inner, inner, 1.0e9_wp, alike, error)
    if (allocated(error)) return
    problem = alike%problem
    deallocate (problem%friction)
    ! no structure constructor: gfortran 12 frees the components of a parent in it twice
    law%coefficient = spread(inner, 1, problem%lattice%size())
    allocate (problem%friction, source=law)
    call new_frictional_contact(nodal, problem, error, 2)
    if (.not. allocated(error)) call new_windowed_friction(windowed, problem, error, 2)
    if (.not. allocated(error)) call new_direct_friction(dense, problem, error)
    if (.not. allocated(error)) call two_steps(nodal, on_window)
    if (.not. allocated(error)) call two_steps(windowed, on_part)
    if (.not. allocated(error)) call two_steps(dense, direct)
    if (allocated(error)) return
    slipped = on_window(1)%zone == slip
    length = norm2(on_window(2)%traction, dim=3)
    bound = merge(outer, inner, slipped)*on_window(2)%pressure
    call check_true(error, all(length <= bound + 1.0e-9_wp), 'within the bound')
    if (allocated(error)) return
    associate (slides => on_window(2)%zone == slip)
      call check_true(error, any(slipped .and. slides) .and. any(slides .and. .not. slipped) .and. &
                      any(on_window(2)%zone == stick), 'some nodes go on slipping, some begin, some stick')
      if (allocated(error)) return
      call check(error, largest(merge(length - bound, 0.0_wp, slides)), 0.0_wp, 1.0e-8_wp, 'on the bound')
    end associate
    if (allocated(error)) return
    call check(error, largest(on_part(2)%traction - on_window(2)%traction), 0.0_wp, 1.0e-6_wp, 'on a part of the window')
    if (allocated(error)) return
    call check(error, largest(direct(2)%traction - on_window(2)%traction), 0.0_wp, 1.0e-6_wp, 'by the explicit matrix')

  contains

    !> Press and shear, then shear more.
    subroutine two_steps(contact, state)
      class(friction_solver_t), intent(inout) :: contact
      type(contact_state_t), intent(out) :: state(2)

      call solve(contact, [f, d, d, d], [load, 0.15_wp, 0.0_wp, 0.0_wp], state(1), error)
      if (allocated(error)) return
      call contact%solve_step(state(1), state(1)%relative_displacement, &
                              load_target_t([f, d, d, d], [load, 0.25_wp, 0.0_wp, 0.0_wp]), 1.0e-10_wp, 200, state(2), error)
      if (.not. allocated(error)) call check_true(error, state(2)%converged, 'converged')
    end subroutine two_steps

  end subroutine test_static_and_kinetic

  subroutine collect_nodal_friction(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('equal_coefficients', test_equal_coefficients), &
      new_test('full_slip', test_full_slip), &
      new_test('torsion', test_torsion), &
      new_test('tresca', test_tresca), &
      new_test('methods_agree', test_methods_agree), &
      new_test('static_and_kinetic', test_static_and_kinetic), &
      new_test('other_lattices', test_other_lattices), &
      new_test('smooth_nodes', test_smooth_nodes), &
      new_test('direction', test_direction), &
      new_test('power', test_power), &
      new_test('bad_numbers', test_bad_numbers) &
    ]
  end subroutine collect_nodal_friction

  !> With equal coefficients and no bound in reach it is Coulomb's law.
  subroutine test_equal_coefficients(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: coulomb, nodal
    type(contact_state_t) :: expected, state

    call new_sphere(coulomb, 12, 0.3_wp, -0.2_wp, coulomb_t(inner), error)
    if (allocated(error)) return
    call new_nodal(inner, inner, 1.0e9_wp, nodal, error)
    if (.not. allocated(error)) call solve(coulomb, [f, f, f, d], [load, 0.2_wp*load, 0.0_wp, 0.0_wp], expected, error)
    if (.not. allocated(error)) call solve(nodal, [f, f, f, d], [load, 0.2_wp*load, 0.0_wp, 0.0_wp], state, error)
    if (allocated(error)) return
    call check(error, largest(state%traction - expected%traction), 0.0_wp, 1.0e-12_wp*maxval(expected%pressure), 'traction')
  end subroutine test_equal_coefficients

  !> A shift beyond any stick: the traction is mu(r) p along it.
  subroutine test_full_slip(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: nodal
    type(contact_state_t) :: state

    call new_nodal(inner, outer, 1.0e9_wp, nodal, error, similar=.true.)
    if (.not. allocated(error)) call solve(nodal, [f, d, d, d], [load, 5.0_wp, 0.0_wp, 0.0_wp], state, error)
    if (allocated(error)) return
    call check_true(error, all(state%zone /= 1), 'no stick')
    if (allocated(error)) return
    call check(error, largest(abs(state%traction(:, :, 1)) - coefficients(nodal, inner, outer)*state%pressure), 0.0_wp, &
               1.0e-8_wp, 'mu(r) p along the shift')
    if (allocated(error)) return
    call check(error, largest(state%traction(:, :, 2)), 0.0_wp, 1.0e-8_wp, 'nothing across it')
  end subroutine test_full_slip

  !> A twist beyond any stick: M = int 2 pi r^2 mu(r) p dr with p = 2/pi sqrt(1 - r^2).
  subroutine test_torsion(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: nodal
    type(contact_state_t) :: state
    real(wp), allocatable :: mu(:, :), across(:, :)
    real(wp) :: torque

    call new_nodal(inner, outer, 1.0e9_wp, nodal, error)
    if (.not. allocated(error)) call solve(nodal, [f, d, d, d], [load, 0.0_wp, 0.0_wp, 20.0_wp], state, error)
    if (allocated(error)) return
    mu = coefficients(nodal, inner, outer)
    associate (x => coordinate(nodal%problem%lattice, 1), y => coordinate(nodal%problem%lattice, 2))
      call check(error, largest(merge(norm2(state%traction, dim=3) - mu*state%pressure, 0.0_wp, state%zone == slip)), 0.0_wp, &
                 1.0e-8_wp, 'mu(r) p')
      if (allocated(error)) return
      across = x*state%traction(:, :, 1) + y*state%traction(:, :, 2)
      call check(error, largest(across), 0.0_wp, 1.0e-3_wp, 'around the centre')
    end associate
    if (allocated(error)) return
    torque = 4.0_wp*(inner*moment(ring) + outer*(moment(1.0_wp) - moment(ring)))
    call check(error, abs(state%load(about_z)), torque, 0.02_wp*torque, 'torque')

  contains

    !> Integral of r^2 sqrt(1 - r^2) from 0.
    pure real(wp) function moment(r)
      real(wp), intent(in) :: r
      moment = (asin(r) - r*sqrt(1.0_wp - r**2)*(1.0_wp - 2.0_wp*r**2))/8.0_wp
    end function moment

  end subroutine test_torsion

  !> Full slip with a bound: q = q_max where mu p is above it, also for an infinite coefficient.
  subroutine test_tresca(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: q_max = 0.15_wp, rough(3) = [inner, 1.0e3_wp, 1.0e100_wp]
    type(frictional_contact_t) :: nodal
    type(contact_state_t) :: state
    integer :: i

    do i = 1, size(rough)
      call new_nodal(rough(i), rough(i), q_max, nodal, error, similar=.true.)
      if (.not. allocated(error)) call solve(nodal, [f, d, d, d], [load, 5.0_wp, 0.0_wp, 0.0_wp], state, error)
      if (allocated(error)) return
      call check_true(error, count(rough(i)*state%pressure > q_max) > count(state%pressure > 0.0_wp)/2, 'the bound counts')
      if (allocated(error)) return
      call check(error, largest(abs(state%traction(:, :, 1)) - min(rough(i)*state%pressure, q_max)), 0.0_wp, 1.0e-8_wp, &
                 'min(mu p, q_max)')
      if (allocated(error)) return
    end do
  end subroutine test_tresca

  !> Dissimilar bodies in partial slip, with rings and a bound: transforms and matrices answer alike, and within the law.
  subroutine test_methods_agree(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: q_max = 0.1_wp
    type(frictional_contact_t) :: nodal
    type(direct_friction_t) :: dense
    type(contact_state_t) :: state, direct
    real(wp), allocatable :: bound(:, :)

    call new_nodal(inner, outer, q_max, nodal, error)
    if (.not. allocated(error)) call solve(nodal, [f, f, f, d], [load, 0.12_wp*load, 0.05_wp*load, 0.0_wp], state, error)
    if (allocated(error)) return
    bound = min(coefficients(nodal, inner, outer)*state%pressure, q_max)
    call check_true(error, all(norm2(state%traction, dim=3) <= bound + 1.0e-9_wp), 'within the bound')
    if (allocated(error)) return
    call check_true(error, any(state%zone == slip .and. bound >= q_max) .and. any(state%zone == slip .and. bound < q_max) &
                    .and. any(state%zone == 1), 'slip on the bound, slip under it, and stick')
    if (allocated(error)) return
    call new_direct_friction(dense, nodal%problem, error)
    if (.not. allocated(error)) call solve(dense, [f, f, f, d], [load, 0.12_wp*load, 0.05_wp*load, 0.0_wp], direct, error)
    if (allocated(error)) return
    call check(error, largest(state%traction - direct%traction), 0.0_wp, 1.0e-6_wp, 'traction')
    if (allocated(error)) return
    call check(error, largest(state%pressure - direct%pressure), 0.0_wp, 1.0e-6_wp, 'pressure')
  end subroutine test_methods_agree

  !> The coefficients of a part of the window and of every second node are those at its nodes.
  subroutine test_other_lattices(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: nodal
    type(friction_problem_t) :: part, coarse

    call new_nodal(inner, outer, 1.0_wp, nodal, error)
    if (allocated(error)) return
    call nodal%problem%extract_part([3, 5], [20, 21], part)
    call check_law(part, 'part')
    if (allocated(error)) return
    call part%coarsen(coarse)
    call check_law(coarse, 'every second node')

  contains

    subroutine check_law(problem, what)
      type(friction_problem_t), intent(in) :: problem
      character(len=*), intent(in) :: what
      real(wp) :: p(problem%lattice%size()), bound(problem%lattice%size()), expected(problem%lattice%size())

      p = 1.0_wp
      call problem%friction%find_bounds(1, p, bound)
      associate (x => coordinate(problem%lattice, 1), y => coordinate(problem%lattice, 2))
        expected = reshape(merge(inner, outer, hypot(x, y) < ring), shape(expected))
      end associate
      call check(error, bound, expected, 0.0_wp, what)
    end subroutine check_law

  end subroutine test_other_lattices

  !> Nodes without friction are in contact and slip.
  subroutine test_smooth_nodes(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: nodal
    type(contact_state_t) :: state

    call new_nodal(0.0_wp, inner, 1.0e9_wp, nodal, error)
    if (.not. allocated(error)) call solve(nodal, [f, f, f, d], [load, 0.05_wp*load, 0.0_wp, 0.0_wp], state, error)
    if (allocated(error)) return
    associate (smooth => hypot(coordinate(nodal%problem%lattice, 1), coordinate(nodal%problem%lattice, 2)) < ring)
      call check_true(error, all(state%zone == slip .or. .not. smooth), 'they slip')
      if (allocated(error)) return
      call check(error, largest(merge(norm2(state%traction, dim=3), 0.0_wp, smooth)), 0.0_wp, 1.0e-300_wp, 'no traction')
    end associate
  end subroutine test_smooth_nodes

  !> Two coefficients and an angle, dissimilar bodies in partial slip: no traction outside of the ellipse, slip along its normal,
  !> by transforms and by matrices; coarser lattices and parts have the same ellipse.
  subroutine test_direction(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: angle = 0.4_wp, ratio = 2.0_wp, mean = 0.3_wp
    type(frictional_contact_t) :: sphere, contact
    type(direct_friction_t) :: dense
    type(contact_state_t) :: state, direct
    type(friction_problem_t) :: problem, coarse
    type(orthotropic_coulomb_t) :: ellipse
    real(wp) :: turn(2, 2), shape_of(2, 2), q(2), slipped(2), worst
    integer :: col, row

    call new_sphere(sphere, 12, 0.3_wp, -0.2_wp, coulomb_t(mean), error)
    if (allocated(error)) return
    problem = sphere%problem
    deallocate (problem%friction)
    ellipse%coefficient = spread(mean, 1, problem%lattice%size())
    ellipse%ratio = ratio
    ellipse%angle = angle
    allocate (problem%friction, source=ellipse)
    call problem%coarsen(coarse)
    associate (a => coarse%friction%stretch(), b => problem%friction%stretch())
      call check(error, largest(a - b), 0.0_wp, 0.0_wp, 'ellipse of every second node')
    end associate
    if (allocated(error)) return
    call new_frictional_contact(contact, problem, error, 2)
    if (.not. allocated(error)) call solve(contact, [f, f, f, d], [load, 0.15_wp*load, 0.1_wp*load, 0.0_wp], state, error)
    if (.not. allocated(error)) call new_direct_friction(dense, problem, error)
    if (.not. allocated(error)) call solve(dense, [f, f, f, d], [load, 0.15_wp*load, 0.1_wp*load, 0.0_wp], direct, error)
    if (allocated(error)) return
    call check(error, largest(state%traction - direct%traction), 0.0_wp, 1.0e-7_wp, 'traction by both methods')
    if (allocated(error)) return
    ! q.B q <= p^2 with B of the coefficients along and across; slip along -B q
    turn = reshape([cos(angle), sin(angle), -sin(angle), cos(angle)], [2, 2])
    shape_of = matmul(turn, matmul(reshape([1.0_wp/(mean**2*ratio), 0.0_wp, 0.0_wp, ratio/mean**2], [2, 2]), transpose(turn)))
    worst = 0.0_wp
    do row = 1, size(state%zone, 2)
      do col = 1, size(state%zone, 1)
        if (state%zone(col, row) == separated) cycle
        q = state%traction(col, row, :)
        worst = max(worst, dot_product(q, matmul(shape_of, q)) - state%pressure(col, row)**2)
        if (state%zone(col, row) /= slip) cycle
        slipped = state%slip_increment(col, row, :)
        q = matmul(shape_of, q)
        worst = max(worst, dot_product(q, slipped), abs(q(1)*slipped(2) - q(2)*slipped(1)))
      end do
    end do
    call check(error, worst, 0.0_wp, 1.0e-8_wp, 'within the ellipse, and slip along its normal')
    if (allocated(error)) return
    call check_true(error, any(state%zone == slip) .and. any(state%zone == 1), 'stick and slip')
  end subroutine test_direction

  !> A power of the pressure as bound: the slope is its derivative, and it is 0 where a limit counts or nothing presses.
  subroutine test_power(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: p(4) = [-1.0_wp, 0.2_wp, 0.7_wp, 3.0_wp], small = 1.0e-6_wp, powers(3) = [0.6_wp, 1.0_wp, 1.7_wp]
    type(nodal_coulomb_t) :: law
    real(wp), dimension(4) :: slope, low, high
    integer :: i

    do i = 1, size(powers)
      law = nodal_coulomb_t(spread(0.3_wp, 1, 4), 0.5_wp, powers(i))
      call law%find_slopes(1, p, slope)
      call law%find_bounds(1, p - small, low)
      call law%find_bounds(1, p + small, high)
      call check(error, slope(2:), (high(2:) - low(2:))/(2*small), 1.0e-8_wp, 'derivative')
      if (allocated(error)) return
      call law%find_bounds(1, p, high)
      call check(error, high, min(0.3_wp*max(p, 0.0_wp)**law%power, 0.5_wp), 1.0e-15_wp, 'bound')
      if (allocated(error)) return
      call check(error, law%strength(0.7_wp)*0.7_wp, high(3), 1.0e-15_wp, 'strength')
      if (allocated(error)) return
    end do
  end subroutine test_power

  !> Numbers that are none, negative or too few.
  subroutine test_bad_numbers(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: sphere
    type(nodal_coulomb_t) :: law
    type(orthotropic_coulomb_t) :: tilted
    type(error_t), allocatable :: raised
    integer :: i

    call new_sphere(sphere, 4, 0.0_wp, 0.0_wp, coulomb_t(0.1_wp), error)
    if (allocated(error)) return
    do i = 1, 5
      law = nodal_coulomb_t(spread(0.3_wp, 1, sphere%problem%lattice%size()))
      if (i == 1) law%coefficient(7) = ieee_value(1.0_wp, ieee_quiet_nan)
      if (i == 2) law%coefficient(7) = -0.1_wp
      if (i == 3) law%coefficient = law%coefficient(2:)
      if (i == 4) law%shear_limit = 0.0_wp
      if (i == 5) law%power = -1.0_wp
      call law%check(sphere%problem%lattice%size(), raised)
      call check_true(error, allocated(raised), 'refused')
      if (allocated(error)) return
    end do
    tilted%coefficient = spread(0.3_wp, 1, sphere%problem%lattice%size())
    tilted%ratio = 0.0_wp
    call tilted%check(sphere%problem%lattice%size(), raised)
    call check_true(error, allocated(raised), 'no ratio')
  end subroutine test_bad_numbers

  !> A step from nothing, which must converge.
  subroutine solve(contact, control, value, state, error)
    class(friction_solver_t), intent(inout) :: contact
    integer, intent(in) :: control(4)
    real(wp), intent(in) :: value(4)
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error
    type(contact_state_t) :: none

    call new_friction_state(none, contact%problem%lattice)
    call contact%solve_step(none, none%relative_displacement, load_target_t(control, value), 1.0e-10_wp, 200, state, error)
    if (.not. allocated(error)) call check_true(error, state%converged, 'converged')
  end subroutine solve

  !> The coefficient of each node.
  function coefficients(contact, within, beyond) result(mu)
    class(friction_solver_t), intent(in) :: contact
    real(wp), intent(in) :: within, beyond
    real(wp), allocatable :: mu(:, :)

    mu = merge(within, beyond, hypot(coordinate(contact%problem%lattice, 1), coordinate(contact%problem%lattice, 2)) < ring)
  end function coefficients

  !> A sphere with one coefficient within a ring, and another beyond it.
  subroutine new_nodal(within, beyond, limit, nodal, error, similar)
    real(wp), intent(in) :: within, beyond, limit
    type(frictional_contact_t), intent(out) :: nodal
    type(error_t), allocatable, intent(out) :: error
    !> True: bodies without Poisson's effect, whose displacements are along the tractions
    logical, intent(in), optional :: similar
    type(frictional_contact_t) :: coulomb
    type(friction_problem_t) :: problem
    real(wp) :: pair(2)

    pair = [0.3_wp, -0.2_wp]
    if (present(similar)) pair = merge([0.0_wp, 0.0_wp], pair, similar)
    call new_sphere(coulomb, 12, pair(1), pair(2), coulomb_t(within), error)
    if (allocated(error)) return
    problem = coulomb%problem
    deallocate (problem%friction)
    allocate (problem%friction, source=nodal_coulomb_t(reshape(coefficients(coulomb, within, beyond), &
                                                              [problem%lattice%size()]), limit))
    call new_frictional_contact(nodal, problem, error, 2)
  end subroutine new_nodal

end module test_nodal_friction
