!> Coulomb's law, the residuals of friction, and load steps against closed solutions.
module test_friction
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan, ieee_invalid, ieee_get_halting_mode, &
    ieee_set_halting_mode
  use hc_precision, only: wp, pi, lk, zk
  use hc_error, only: error_t, status
  use hc_lattice, only: lattice_t, new_lattice, equilateral_basis
  use hc_field_space, only: field_space_t
  use hc_elastic_pair, only: elastic_pair_t
  use hc_flexibility, only: along_x, along_y
  use hc_flexibility_dense, only: dense_flexibility_t, new_dense_flexibility
  use hc_contact_state, only: contact_state_t, new_friction_state, load_target_t, force_control, displacement_control, &
    separated, stick, slip, normal, about_z
  use hc_coulomb, only: coulomb_t
  use hc_disc_law, only: normal_to
  use hc_contact_residuals, only: tangential_residual, tangential_self_compliance
  use hc_contact_problem, only: friction_problem_t, new_friction_problem
  use hc_active_set, only: active_set_t, new_active_set
  use hc_linear_system, only: constraints_t, iteration_t
  use hc_projected_cg, only: projected_cg
  use hc_operator_set, only: operators_t, new_operators
  use hc_shear_system, only: shear_system_t, new_shear_system
  use hc_frictional_contact, only: frictional_contact_t, new_frictional_contact
  use testing, only: test_t, new_test, check, check_raised, check_true, largest, coordinate
  implicit none
  private

  public :: collect_friction, new_sphere, precondition_shear

  integer, parameter :: f = force_control, d = displacement_control

contains

  subroutine collect_friction(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('law', test_law), &
      new_test('linearize', test_linearize), &
      new_test('tangential_residual', test_tangential_residual), &
      new_test('residual_scales', test_residual_scales), &
      new_test('self_compliance', test_self_compliance), &
      new_test('load_residuals', test_load_residuals), &
      new_test('complete_state', test_conclude), &
      new_test('shear_system', test_shear_system), &
      new_test('slip_preconditioner', test_slip_preconditioner), &
      new_test('cattaneo_mindlin', test_cattaneo_mindlin), &
      new_test('lubkin', test_lubkin), &
      new_test('bulk_strain', test_bulk_strain), &
      new_test('bulk_shear', test_bulk_shear), &
      new_test('no_friction', test_no_friction), &
      new_test('gross_sliding', test_gross_sliding), &
      new_test('oblong_windows', test_oblong), &
      new_test('threads', test_threads), &
      new_test('bad_input', test_bad_input) &
    ]
  end subroutine collect_friction

  !> The bound mu p, the projection on the cone, the quarter turn.
  subroutine test_law(error)
    type(error_t), allocatable, intent(out) :: error
    type(coulomb_t) :: friction, rough
    real(wp), dimension(3) :: cut_x, cut_y

    friction = coulomb_t(0.3_wp)
    rough = coulomb_t(no_slip=.true.)
    call check(error, friction%bound([10.0_wp, 0.0_wp, -1.0_wp]), [3.0_wp, 0.0_wp, 0.0_wp], 1.0e-15_wp, 'mu p')
    if (allocated(error)) return
    call check_true(error, all(rough%bound([1.0_wp, 0.0_wp]) >= huge(1.0_wp)), 'no bound without slip')
    if (allocated(error)) return
    friction = coulomb_t(0.5_wp)
    call friction%project(1, 0.1_wp, [5.0_wp, 12.0_wp, 0.0_wp], [3.0_wp, 3.0_wp, 3.0_wp], [4.0_wp, -4.0_wp, -4.0_wp], cut_x, cut_y)
    call check(error, [cut_x, cut_y], [1.5_wp, 3.0_wp, 0.0_wp, 2.0_wp, -4.0_wp, 0.0_wp], 1.0e-15_wp, 'cut to the cone')
    if (allocated(error)) return
    call rough%project(1, 0.1_wp, [10.0_wp, 1.0_wp, 1.0_wp], [3.0_wp, 3.0_wp, 3.0_wp], [4.0_wp, -4.0_wp, -4.0_wp], cut_x, cut_y)
    call check(error, [cut_x, cut_y], [3.0_wp, 3.0_wp, 3.0_wp, 4.0_wp, -4.0_wp, -4.0_wp], 0.0_wp, 'no slip')
    if (allocated(error)) return
    call check(error, normal_to([0.6_wp, 0.8_wp]), [-0.8_wp, 0.6_wp], 0.0_wp, 'a quarter turn ahead')
  end subroutine test_law

  !> Stick inside of the disc, direction and compliance outside; D -> |ds|/(mu p) at the solution, for any r.
  subroutine test_linearize(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: e(2), compliance
    real(wp), parameter :: r(3) = [0.01_wp, 1.0_wp, 300.0_wp]
    integer :: i
    integer(zk) :: zone

    ! d = (1, 0) - 10 (0.05, 0) = (0.5, 0), inside of the radius 2
    call linearize([1.0_wp, 0.0_wp], [0.05_wp, 0.0_wp], 2.0_wp, 9.0_wp, 10.0_wp, zone, e, compliance)
    call check(error, int(zone), int(stick), 'inside')
    if (allocated(error)) return
    call check(error, [e, compliance], [1.0_wp, 0.0_wp, 0.0_wp], 0.0_wp, 'direction and compliance in stick')
    if (allocated(error)) return
    ! on the rim of the disc without slip: stick
    call linearize([0.0_wp, 2.0_wp], [0.0_wp, 0.0_wp], 2.0_wp, 9.0_wp, 10.0_wp, zone, e, compliance)
    call check(error, int(zone), int(stick), 'on the rim')
    if (allocated(error)) return
    ! d = (1, 1) - 10 (-0.2, -0.3) = (3, 4): D = (5 - 2)/(10*2)
    call linearize([1.0_wp, 1.0_wp], [-0.2_wp, -0.3_wp], 2.0_wp, 9.0_wp, 10.0_wp, zone, e, compliance)
    call check(error, int(zone), int(slip), 'outside')
    if (allocated(error)) return
    call check(error, [e, compliance], [0.6_wp, 0.8_wp, 0.15_wp], 1.0e-15_wp, 'direction and compliance in slip')
    if (allocated(error)) return
    ! a slip of 0.1 against the traction (1.2, 1.6) of length mu p = 2
    do i = 1, 3
      call linearize([1.2_wp, 1.6_wp], [-0.06_wp, -0.08_wp], 2.0_wp, 2.0_wp, r(i), zone, e, compliance)
      call check(error, int(zone), int(slip), 'slip at the solution')
      if (allocated(error)) return
      call check(error, [e, compliance], [0.6_wp, 0.8_wp, 0.05_wp], 1.0e-14_wp, 'D = |ds|/(mu p) at the solution')
      if (allocated(error)) return
    end do
    ! no pressure: D is large, but finite
    call linearize([0.0_wp, 1.0_wp], [0.0_wp, 0.0_wp], 0.0_wp, 5.0_wp, 1.0_wp, zone, e, compliance)
    call check(error, compliance*5.0e-12_wp, 1.0_wp, 1.0e-12_wp, 'compliance without pressure')
    if (allocated(error)) return
    call linearize([1.0e200_wp, 0.0_wp], [-1.0e200_wp, 0.0_wp], 1.0e200_wp, 1.0e200_wp, 1.0_wp, zone, e, compliance, no_slip=.true.)
    call check(error, int(zone), int(stick), 'never slip under an infinite coefficient')
  end subroutine test_linearize

  !> Linearise the law at a node.
  subroutine linearize(traction, slip_increment, bound, largest_bound, r, zone, direction, compliance, no_slip)
    real(wp), intent(in) :: traction(2), slip_increment(2), bound, largest_bound, r
    integer(zk), intent(out) :: zone
    real(wp), intent(out) :: direction(2), compliance
    logical, intent(in), optional :: no_slip
    type(coulomb_t) :: law
    integer(zk) :: zones(1)
    real(wp) :: directions(2, 1), compliances(1)

    law = coulomb_t(1.0_wp, present(no_slip))
    call law%linearize(1, largest_bound, r, [.true.], [bound], traction(:1), traction(2:), slip_increment(:1), &
                       slip_increment(2:), zones, directions, compliances)
    zone = zones(1)
    direction = directions(:, 1)
    compliance = compliances(1)
  end subroutine linearize

  !> Hand-made violations, each with its number; mu = 0.5, d_t = 0.5, mu p = 5 and 2, p_max = 10.
  subroutine test_tangential_residual(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: q(3, 1, 2), ds(3, 1, 2)

    call right(q, ds)
    call violation(0.0_wp, 'stick, slip against the traction, and a node apart')
    if (allocated(error)) return
    ! 2.5 instead of 2
    q(2, 1, :) = [0.0_wp, 2.5_wp]
    call violation(0.5_wp/5.0_wp, 'traction outside of the cone')
    if (allocated(error)) return
    ! q - ds/d_t = (3, 0) - (1, 0)
    call right(q, ds)
    ds(1, 1, :) = [0.5_wp, 0.0_wp]
    call violation(1.0_wp/5.0_wp, 'slip in stick')
    if (allocated(error)) return
    ! q - ds/d_t = (0, 2) + (3, 2): projected to 2 (3, 4)/5
    call right(q, ds)
    ds(2, 1, :) = [-1.5_wp, -1.0_wp]
    call violation(norm2([-1.2_wp, 0.4_wp])/5.0_wp, 'slip that is not opposed to the traction')
    if (allocated(error)) return
    ! q - ds/d_t = (0, 2) - (0, 2)
    call right(q, ds)
    ds(2, 1, :) = [0.0_wp, 1.0_wp]
    call violation(2.0_wp/5.0_wp, 'slip along the traction')
    if (allocated(error)) return
    ! slip under too small a traction: (0, 1.5) + (0, 0.8), projected to (0, 2)
    call right(q, ds)
    q(2, 1, :) = [0.0_wp, 1.5_wp]
    call violation(0.5_wp/5.0_wp, 'slip inside of the cone')

  contains

    !> Stick, slip and separation as they should be.
    pure subroutine right(q, ds)
      real(wp), intent(out) :: q(3, 1, 2), ds(3, 1, 2)
      q(:, 1, 1) = [3.0_wp, 0.0_wp, 0.0_wp]
      q(:, 1, 2) = [0.0_wp, 2.0_wp, 0.0_wp]
      ds(:, 1, 1) = [0.0_wp, 0.0_wp, 1.0_wp]
      ds(:, 1, 2) = [0.0_wp, -0.4_wp, 1.0_wp]
    end subroutine right

    subroutine violation(expected, what)
      real(wp), intent(in) :: expected
      character(len=*), intent(in) :: what
      real(wp), parameter :: p(3, 1) = reshape([10.0_wp, 4.0_wp, 0.0_wp], [3, 1])

      call check(error, tangential_residual(q, ds, p, coulomb_t(0.5_wp), 0.5_wp, field_space_t()), expected, 1.0e-15_wp, what)
    end subroutine violation

  end subroutine test_tangential_residual

  !> Scales of the tangential residual without slip, without friction, and without contact.
  subroutine test_residual_scales(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: q(2, 1, 2), ds(2, 1, 2), p(2, 1)

    p(:, 1) = [10.0_wp, 4.0_wp]
    q(:, 1, 1) = [3.0_wp, 0.0_wp]
    q(:, 1, 2) = [0.0_wp, 400.0_wp]
    ds = 0.0_wp
    ds(1, 1, 1) = 0.5_wp
    call check(error, tangential_residual(q, ds, p, coulomb_t(no_slip=.true.), 0.5_wp, field_space_t()), &
               1.0_wp/400.0_wp, 1.0e-15_wp, 'no slip: the largest traction')
    if (allocated(error)) return
    q = 0.0_wp
    call check(error, tangential_residual(q, ds, p, coulomb_t(no_slip=.true.), 0.5_wp, field_space_t()), 100.0_wp, 1.0e-12_wp, &
               'no slip and no traction: a thousandth of the largest pressure')
    if (allocated(error)) return
    call check(error, tangential_residual(q, ds, p, coulomb_t(0.0_wp), 0.5_wp, field_space_t()), 0.0_wp, 0.0_wp, &
               'any slip without friction')
    if (allocated(error)) return
    call check(error, tangential_residual(q, ds, 0.0_wp*p, coulomb_t(0.5_wp), 0.5_wp, field_space_t()), 0.0_wp, 0.0_wp, &
               'no contact')
  end subroutine test_residual_scales

  !> d_t = (lambda_1 + lambda_5/2) K1(0), K1(0) = (3 sqrt(3)/2) ln 3 spacings.
  subroutine test_self_compliance(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice

    call new_lattice(lattice, equilateral_basis(2.0_wp), [0, 0], [1, 1], error)
    if (allocated(error)) return
    call check(error, tangential_self_compliance(lattice, elastic_pair_t(0.5_wp, 0.2_wp, 0.3_wp)), &
               0.65_wp*3.0_wp*sqrt(3.0_wp)*log(3.0_wp), 1.0e-14_wp, 'self-compliance')
  end subroutine test_self_compliance

  !> R_P, R_Q and R_M of loads that are missed by known amounts, for finite, infinite and no friction.
  subroutine test_load_residuals(error)
    type(error_t), allocatable, intent(out) :: error
    type(contact_state_t) :: state
    real(wp), parameter :: still(3, 4, 3) = 0.0_wp
    type(load_target_t) :: target
    type(friction_problem_t) :: problem
    real(wp), parameter :: mu = 0.5_wp
    real(wp) :: area, radius

    ! two nodes of pressure 10 and 20, tractions 3 and 4 along x and y; loads are missed by 2 % of P, by
    ! (3, 4) % of mu P, and by 7 % of mu P a
    call load_state(coulomb_t(mu), 1.0_wp)
    if (allocated(error)) return
    call check(error, [state%residual_force, state%residual_shear_force, state%residual_torque], &
               [0.02_wp/0.98_wp, 0.05_wp, 0.07_wp], 1.0e-13_wp, 'missed loads')
    if (allocated(error)) return
    call check_true(error, .not. state%converged, 'not converged')
    if (allocated(error)) return
    ! R_Q refers to P q_max/p_max = P/5 without slip; mu P = P/2 was taken to make the targets
    call load_state(coulomb_t(no_slip=.true.), 1.0_wp)
    if (allocated(error)) return
    call check(error, [state%residual_shear_force, state%residual_torque], [0.125_wp, 0.175_wp], 1.0e-13_wp, &
               'missed loads without slip')
    if (allocated(error)) return
    ! any traction at all is wrong without friction
    call load_state(coulomb_t(0.0_wp), 1.0_wp)
    if (allocated(error)) return
    call check_true(error, min(state%residual_shear_force, state%residual_torque) >= huge(1.0_wp), 'loads without friction')
    if (allocated(error)) return
    ! prescribed motions have no residuals
    target%control = d
    target%value = state%motion
    state%gap = 0.0_wp
    state%relative_displacement = 0.0_wp
    call problem%complete_state(target, 1.0e-8_wp, still(:, :, 2:), state)
    call check(error, [state%residual_force, state%residual_shear_force, state%residual_torque], spread(0.0_wp, 1, 3), &
               0.0_wp, 'prescribed motions')
    if (allocated(error)) return
    ! nothing touches, nothing is carried
    call load_state(coulomb_t(mu), 0.0_wp)
    if (allocated(error)) return
    call check(error, [state%residual_force, state%residual_shear_force, state%residual_torque], spread(0.0_wp, 1, 3), &
               0.0_wp, 'no load')

  contains

    subroutine load_state(friction, scale)
      type(coulomb_t), intent(in) :: friction
      !> Factor of tractions and loads
      real(wp), intent(in) :: scale
      type(lattice_t) :: lattice
      real(wp) :: gap(3, 4)
      logical :: candidate(3, 4)

      call new_lattice(lattice, equilateral_basis(0.5_wp), [-1, -1], [3, 4], error)
      if (allocated(error)) return
      gap = 0.0_wp
      candidate = .true.
      call new_friction_problem(problem, lattice, elastic_pair_t(1.0_wp, 0.0_wp, 0.0_wp), gap, candidate, friction, &
                                .false., error)
      if (allocated(error)) return
      call new_friction_state(state, lattice)
      state%pressure(2, 2) = 10.0_wp*scale          ! at (0, 0)
      state%pressure(3, 2) = 20.0_wp*scale          ! at (0.5, 0)
      state%traction(2, 2, 1) = 3.0_wp*scale
      state%traction(3, 2, 2) = 4.0_wp*scale
      area = 0.125_wp*sqrt(3.0_wp)
      radius = sqrt(2.0_wp*area/pi)
      target%control = f
      target%value(:4) = scale*area*[0.98_wp*30.0_wp, 3.0_wp + 0.03_wp*mu*30.0_wp, 4.0_wp - 0.04_wp*mu*30.0_wp, &
                                 0.5_wp*4.0_wp + 0.07_wp*mu*30.0_wp*radius]
      call problem%complete_state(target, 1.0e-8_wp, still(:, :, 2:), state)
      call check(error, state%load(:4), scale*area*[30.0_wp, 3.0_wp, 4.0_wp, 2.0_wp], 1.0e-14_wp, 'resultants')
    end subroutine load_state

  end subroutine test_load_residuals

  !> Gap, relative displacement, slip and zones follow from displacements and motions.
  subroutine test_conclude(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(friction_problem_t) :: problem
    type(contact_state_t) :: state
    type(load_target_t) :: target
    real(wp) :: gap(3, 1), displacement(3, 1, 3), reference(3, 1, 2), nan
    integer :: i
    logical :: candidate(3, 1), halting

    call new_lattice(lattice, equilateral_basis(1.0_wp), [2, 0], [3, 1], error)
    if (allocated(error)) return
    gap(:, 1) = [0.0_wp, 0.1_wp, 5.0_wp]
    candidate = .true.
    call new_friction_problem(problem, lattice, elastic_pair_t(1.0_wp, 0.0_wp, 0.0_wp), gap, candidate, &
                              coulomb_t(0.5_wp), .false., error)
    if (allocated(error)) return
    call new_friction_state(state, lattice)
    state%pressure(:2, 1) = [10.0_wp, 4.0_wp]
    state%traction(2, 1, 2) = 2.0_wp
    state%motion(:4) = [1.0_wp, 0.2_wp, 0.3_wp, 0.1_wp]
    target%control = d
    target%value = state%motion
    ! w = approach - h in contact; s = u - (0.2, 0.3 + 0.1 x) at x = 2, 3, 4
    displacement(:, 1, 1) = [1.0_wp, 0.9_wp, 0.5_wp]
    displacement(:, 1, 2) = [0.7_wp, 0.2_wp, 0.0_wp]
    displacement(:, 1, 3) = [0.5_wp, 0.4_wp, 0.0_wp]
    reference = 0.0_wp
    reference(1, 1, 1) = 0.5_wp
    reference(2, 1, 2) = 0.1_wp
    call take(displacement)
    call problem%complete_state(target, 1.0e-8_wp, reference, state)
    call check(error, state%gap(:, 1), [0.0_wp, 0.0_wp, 4.5_wp], 1.0e-15_wp, 'gap')
    if (allocated(error)) return
    call check(error, state%relative_displacement(:, 1, 1), [0.5_wp, 0.0_wp, -0.2_wp], 1.0e-15_wp, 'relative displacement x')
    if (allocated(error)) return
    call check(error, state%relative_displacement(:, 1, 2), [0.0_wp, -0.2_wp, -0.7_wp], 1.0e-15_wp, 'relative displacement y')
    if (allocated(error)) return
    call check(error, reshape(state%slip_increment, [6]), [0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, -0.3_wp, 0.0_wp], 1.0e-15_wp, &
               'slip on the nodes in contact')
    if (allocated(error)) return
    call check_true(error, all(state%zone(:, 1) == [stick, slip, separated]), 'zones')
    if (allocated(error)) return
    call check_true(error, state%converged, 'a right state')
    if (allocated(error)) return

    ! slip within the tolerance of R_t, 1e-8 mu p_max d_t with d_t = (3 sqrt(3)/2) ln 3, is none
    do i = 1, 2
      displacement(2, 1, 3) = 0.7_wp - merge(0.9e-8_wp, 1.1e-8_wp, i == 1)*5.0_wp*1.5_wp*sqrt(3.0_wp)*log(3.0_wp)
      call take(displacement)
      call problem%complete_state(target, 1.0e-8_wp, reference, state)
      call check(error, int(state%zone(2, 1)), int(merge(stick, slip, i == 1)), 'zone of a node that hardly moves')
      if (allocated(error)) return
    end do

    ! no tolerance, a bound that rounding exceeds: what does not move at all sticks
    reference(2, 1, :) = state%relative_displacement(2, 1, :)
    state%traction(2, 1, 2) = 2.0_wp*(1.0_wp + 4.0_wp*epsilon(1.0_wp))
    call take(displacement)
    call problem%complete_state(target, 0.0_wp, reference, state)
    call check(error, state%slip_increment(2, 1, :), [0.0_wp, 0.0_wp], 0.0_wp, 'no slip')
    if (allocated(error)) return
    call check(error, int(state%zone(2, 1)), int(stick), 'zone of a node that does not move')
    if (allocated(error)) return
    state%traction(2, 1, 2) = 2.0_wp

    ! what is no number is no solution
    call ieee_get_halting_mode(ieee_invalid, halting)
    call ieee_set_halting_mode(ieee_invalid, .false.)
    nan = ieee_value(nan, ieee_quiet_nan)
    state%traction(1, 1, 1) = nan
    call take(displacement)
    call problem%complete_state(target, 1.0e-8_wp, reference, state)
    call check_true(error, .not. state%converged, 'a traction that is not a number')
    if (.not. allocated(error)) then
      state%traction(1, 1, 1) = 0.0_wp
      displacement(3, 1, 1) = nan
      call take(displacement)
    call problem%complete_state(target, 1.0e-8_wp, reference, state)
      call check_true(error, .not. state%converged, 'a gap that is not a number')
    end if
    call ieee_set_halting_mode(ieee_invalid, halting)

  contains

    !> Put displacements where a state is completed from.
    subroutine take(displacement)
      real(wp), intent(in) :: displacement(:, :, :)

      state%gap = displacement(:, :, 1)
      state%relative_displacement = displacement(:, :, 2:)
    end subroutine take

  end subroutine test_conclude

  !> Precondition the shear tractions of some unknowns, zero elsewhere.
  subroutine precondition_shear(system, unknown, x, m_x)
    type(shear_system_t), intent(inout) :: system
    !> Unknowns, values to be multiplied and the products, one component after the other
    logical(lk), intent(in) :: unknown(:)
    real(wp), intent(in) :: x(:)
    real(wp), intent(out) :: m_x(:)
    type(active_set_t) :: nodes
    real(wp), allocatable :: packed(:)

    call new_active_set(nodes, unknown, field_space_t())
    call nodes%pair(size(x))
    allocate (packed(nodes%n_active))
    call system%precondition_packed(nodes, size(x), pack(x, unknown), packed)
    m_x = unpack(packed, unknown, 0.0_wp)
  end subroutine precondition_shear

  !> R^T T R + D against the explicit matrix; its preconditioner is symmetric and positive definite, stick or slip.
  subroutine test_shear_system(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 30
    type(lattice_t) :: lattice
    type(operators_t), target :: operators
    type(shear_system_t), target :: system
    type(dense_flexibility_t) :: dense
    type(elastic_pair_t) :: pair
    real(wp) :: angle(n), x(2*n), y(2*n), expected(2*n), plane(n, 2), frame(2*n), answer(2*n), m(2*n, 2*n), scale, &
                moved(5, 6, 2)
    integer :: i

    pair = elastic_pair_t(0.8_wp, 0.2_wp, 0.5_wp)
    call new_lattice(lattice, equilateral_basis(0.4_wp), [3, -2], [5, 6], error)
    if (allocated(error)) return
    call new_operators(operators, lattice, pair, field_space_t(), error)
    if (allocated(error)) return
    call new_dense_flexibility(dense, lattice, pair, error)
    if (allocated(error)) return
    call new_shear_system(system, operators)
    call system%set_contact(spread(.true._lk, 1, n))
    call random_number(angle)
    system%direction(1, :) = cos(2.0_wp*pi*angle)
    system%direction(2, :) = sin(2.0_wp*pi*angle)
    ! stick, and slip with compliances from far below to far above that of a node
    system%compliance = [(merge(0.0_wp, system%elastic_compliance*10.0_wp**(0.4_wp*(i - 14)), modulo(i, 3) == 0), i=1, n)]
    call system%use_frames(spread(.true._lk, 1, n))
    call random_number(x)
    call system%product(x, y, error)
    if (allocated(error)) return
    ! frame -> plane by hand: x_t t + x_e e with t = (-e_2, e_1)
    plane(:, 1) = -system%direction(2, :)*x(:n) + system%direction(1, :)*x(n + 1:)
    plane(:, 2) = system%direction(1, :)*x(:n) + system%direction(2, :)*x(n + 1:)
    call dense%apply([along_x, along_y], reshape(plane, [5, 6, 2]), [along_x, along_y], moved, error)
    if (allocated(error)) return
    answer = reshape(moved, [2*n])
    expected(:n) = -system%direction(2, :)*answer(:n) + system%direction(1, :)*answer(n + 1:) + system%compliance*x(:n)
    expected(n + 1:) = system%direction(1, :)*answer(:n) + system%direction(2, :)*answer(n + 1:)
    do i = 1, 2*n
      call check(error, y(i), expected(i), 1.0e-12_wp*max(1.0_wp, abs(expected(i))), 'product')
      if (allocated(error)) return
    end do

    do i = 1, 2*n
      frame = 0.0_wp
      frame(i) = 1.0_wp
      call precondition_shear(system, spread(.true._lk, 1, 2*n), frame, m(:, i))
    end do
    ! on the unknowns: a slipping node carries only its component across e
    do i = 1, n
      if (.not. system%compliance(i) > 0.0_wp) cycle
      m(n + i, :) = 0.0_wp
      m(:, n + i) = 0.0_wp
      m(n + i, n + i) = 1.0_wp
    end do
    scale = maxval(abs(m))
    call check(error, largest(m - transpose(m)), 0.0_wp, 1.0e-6_wp*scale, 'asymmetry of the preconditioner')
    if (allocated(error)) return
    call check_true(error, positive_definite(m), 'preconditioner positive definite')
    if (allocated(error)) return
    ! the softest nodes, 10^6.4 times as soft as the body, are left to 1/D
    i = maxloc(system%compliance, dim=1)
    call check(error, m(i, i)*system%compliance(i), 1.0_wp, 2.0e-6_wp, '1/D')
  end subroutine test_shear_system

  !> Nodes that slip far or not so far: conjugate gradients take few iterations, and no more on twice as fine a lattice.
  subroutine test_slip_preconditioner(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(operators_t), target :: operators
    type(shear_system_t), target :: system
    type(elastic_pair_t) :: pair
    real(wp), allocatable :: x(:, :), y(:, :), unknown(:), image(:), rhs(:)
    logical(lk), allocatable :: active(:)
    type(active_set_t) :: nodes
    type(constraints_t) :: none
    type(iteration_t) :: iteration
    integer :: level, side, n

    pair = elastic_pair_t(1.0_wp, 0.0_wp, 0.5_wp)
    do level = 1, 2
      side = 40*level + 1
      n = side**2
      call new_lattice(lattice, equilateral_basis(2.0_wp/(side - 1)), [-side/2, -side/2], [side, side], error)
      if (allocated(error)) return
      call new_operators(operators, lattice, pair, field_space_t(), error)
      if (allocated(error)) return
      if (allocated(x)) deallocate (x, y, unknown, image, none%columns, none%mb)
      allocate (x(side, side), y(side, side), image(2*n))
      call lattice%coordinates(x, y)
      call new_shear_system(system, operators)
      ! compliances from nothing to that of the whole contact, as they grow across a slip zone
      active = [reshape(x**2 + y**2 < 0.8_wp, [n]), spread(.false., 1, n)]
      system%space = field_space_t()
      call system%set_contact(active(:n))
      system%compliance = pack(2.0_wp*sqrt(x**2 + y**2)**3, reshape(active(:n), [side, side]))
      call system%use_frames(active(:n))
      image = 0.0_wp
      call new_active_set(nodes, active, system%space)
      allocate (unknown(nodes%n_active), source=0.0_wp)
      allocate (rhs(nodes%n_active), source=1.0_wp)
      call nodes%pair(2*n)
      allocate (none%columns(nodes%n_active, 0), none%mb(nodes%n_active, 0))
      iteration = iteration_t(tolerance=1.0e-6_wp, most=100)
      call projected_cg(system, nodes, none, rhs, unknown, image, iteration, error)
      if (allocated(error)) return
      call check_true(error, iteration%residual <= 1.0e-6_wp .and. iteration%made <= 9, 'iterations')
      if (allocated(error)) return
    end do
  end subroutine test_slip_preconditioner

  !> Does Cholesky's factor exist?
  pure logical function positive_definite(matrix)
    real(wp), intent(in) :: matrix(:, :)
    real(wp) :: a(size(matrix, 1), size(matrix, 1))
    integer :: k, i

    a = matrix
    positive_definite = .true.
    do k = 1, size(a, 1)
      positive_definite = positive_definite .and. a(k, k) > 0.0_wp
      if (.not. positive_definite) return
      do i = k + 1, size(a, 1)
        a(i, k + 1:) = a(i, k + 1:) - a(i, k)/a(k, k)*a(k, k + 1:)
      end do
    end do
  end function positive_definite

  !> A sphere on 2 n + 1 nodes a side; E* = 1, R = 1: contact radius 1 for P = 4/3, p0 = 2/pi.
  subroutine new_sphere(contact, n, gamma, beta, friction, error, n_threads)
    type(frictional_contact_t), intent(out) :: contact
    !> Nodes on each side of the apex
    integer, intent(in) :: n
    !> Elastic constants of the pair
    real(wp), intent(in) :: gamma, beta
    type(coulomb_t), intent(in) :: friction
    type(error_t), allocatable, intent(out) :: error
    integer, intent(in), optional :: n_threads
    type(friction_problem_t) :: problem
    type(lattice_t) :: lattice
    real(wp) :: x(2*n + 1, 2*n + 1), y(2*n + 1, 2*n + 1)
    logical :: candidate(2*n + 1, 2*n + 1)

    call new_lattice(lattice, equilateral_basis(1.3_wp/n), [-n, -n], [2*n + 1, 2*n + 1], error)
    if (allocated(error)) return
    call lattice%coordinates(x, y)
    candidate = .true.
    call new_friction_problem(problem, lattice, elastic_pair_t(1.0_wp/pi, beta/pi, gamma/pi), 0.5_wp*(x**2 + y**2), &
                              candidate, friction, .false., error)
    if (allocated(error)) return
    call new_frictional_contact(contact, problem, error, n_threads=n_threads)
  end subroutine new_sphere

  !> The same steps on windows that are longer along one side or the other have the same tractions.
  subroutine test_oblong(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 10, more(2, 3) = reshape([0, 0, 5, 0, 0, 4], [2, 3])
    real(wp), parameter :: beta(2) = [0.0_wp, 0.15_wp], load = 4.0_wp/3.0_wp
    type(frictional_contact_t) :: contact
    type(friction_problem_t) :: problem
    type(contact_state_t) :: state
    type(lattice_t) :: lattice
    real(wp), allocatable :: x(:, :), y(:, :)
    real(wp) :: traction(2*n + 1, 2*n + 1, 3), first(2*n + 1, 2*n + 1, 3)
    integer :: pair, k, high(2)

    do pair = 1, size(beta)
      do k = 1, size(more, 2)
        high = 2*(n + more(:, k)) + 1
        call new_lattice(lattice, equilateral_basis(1.3_wp/n), -n - more(:, k), high, error)
        if (allocated(error)) return
        if (allocated(x)) deallocate (x, y)
        allocate (x(high(1), high(2)), y(high(1), high(2)))
        call lattice%coordinates(x, y)
        call new_friction_problem(problem, lattice, elastic_pair_t(1.0_wp/pi, beta(pair)/pi, 0.3_wp/pi), 0.5_wp*(x**2 + y**2), &
                                  x < 9.0_wp, coulomb_t(0.4_wp), .false., error)
        if (allocated(error)) return
        call new_frictional_contact(contact, problem, error)
        if (allocated(error)) return
        if (allocated(state%pressure)) deallocate (state%pressure)
        call step(contact, state, [f, f, f, d], [load, 0.0_wp, 0.0_wp, 0.0_wp], error)
        if (allocated(error)) return
        call step(contact, state, [f, f, f, f], load*[1.0_wp, 0.2_wp, -0.1_wp, 0.02_wp], error)
        if (allocated(error)) return
        call step(contact, state, [d, d, d, d], state%motion(:4)*[1.02_wp, 0.7_wp, 1.1_wp, 0.8_wp], error)
        if (allocated(error)) return
        associate (low => more(:, k))
          traction(:, :, 1) = state%pressure(low(1) + 1:low(1) + 2*n + 1, low(2) + 1:low(2) + 2*n + 1)
          traction(:, :, 2:3) = state%traction(low(1) + 1:low(1) + 2*n + 1, low(2) + 1:low(2) + 2*n + 1, :)
        end associate
        if (k == 1) first = traction
        call check(error, largest(traction - first), 0.0_wp, 1.0e-6_wp, 'tractions')
        if (allocated(error)) return
      end do
    end do
  end subroutine test_oblong

  !> One load step; it must converge.
  subroutine step(contact, state, control, value, error, tolerance)
    type(frictional_contact_t), intent(inout) :: contact
    !> From and to
    type(contact_state_t), intent(inout) :: state
    integer, intent(in) :: control(:)
    real(wp), intent(in) :: value(:)
    type(error_t), allocatable, intent(out) :: error
    real(wp), intent(in), optional :: tolerance
    type(contact_state_t) :: next
    real(wp) :: bound

    bound = 1.0e-9_wp
    if (present(tolerance)) bound = tolerance
    if (.not. allocated(state%pressure)) call new_friction_state(state, contact%problem%lattice)
    call contact%solve_step(state, state%relative_displacement, load_target_t(control, value), bound, 60, next, error)
    if (allocated(error)) return
    state = next
    call check_true(error, state%converged, 'the step converges')
    if (allocated(error)) return
    call check_true(error, max(state%residual_normal, state%residual_tangential, state%residual_force, &
                               state%residual_shear_force, state%residual_torque) <= bound, 'all residuals within the tolerance')
  end subroutine step

  !> Cattaneo-Mindlin (exact for nu = 0): at Q = mu P/2 c/a = 0.5^(1/3), shift (3 mu P S/16 a) (1 - 0.5^(2/3)).
  !>
  !> At 12 spacings in the radius the shift is good to 3e-5, c/a to 0.004.
  subroutine test_cattaneo_mindlin(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: state
    real(wp), parameter :: load = 4.0_wp/3.0_wp, mu = 0.3_wp
    real(wp) :: shift

    call new_sphere(contact, 16, 0.0_wp, 0.0_wp, coulomb_t(mu), error)
    if (allocated(error)) return
    call step(contact, state, [f, f, f, d], [load, 0.0_wp, 0.0_wp, 0.0_wp], error)
    if (allocated(error)) return
    call check_true(error, all(state%zone /= slip), 'no slip under the normal load')
    if (allocated(error)) return
    call step(contact, state, [f, f, f, d], [load, 0.0_wp, 0.5_wp*mu*load, 0.0_wp], error)
    if (allocated(error)) return
    shift = 3.0_wp*mu*load*4.0_wp/16.0_wp*(1.0_wp - 0.5_wp**(2.0_wp/3.0_wp))
    call check(error, state%motion(along_y), shift, 3.2e-5_wp*shift, 'shift')
    if (allocated(error)) return
    call check(error, [state%motion(along_x), state%load(along_x)], [0.0_wp, 0.0_wp], 1.0e-8_wp, 'nothing across')
    if (allocated(error)) return
    call check(error, sqrt(real(count(state%zone == stick), wp)/count(state%zone /= separated)), &
               0.5_wp**(1.0_wp/3.0_wp), 0.004_wp, 'stick radius')
    if (allocated(error)) return
    call check(error, state%traction(17, 17, 2), mu*2.0_wp/pi*(1.0_wp - 0.5_wp**(1.0_wp/3.0_wp)), 2.1e-5_wp, &
               'traction in the middle')
    if (allocated(error)) return
    ! control of the shift leads to the same solution from the same start, and holds what it holds
    shift = state%motion(along_y)
    call step(contact, state, [f, d, d, d], [load, 0.0_wp, shift, 0.0_wp], error)
    if (allocated(error)) return
    call check(error, state%load(along_y), 0.5_wp*mu*load, 1.0e-7_wp, 'load under the shift')
  end subroutine test_cattaneo_mindlin

  !> Bulk strain moves the stick disc of alike spheres with nu = 0 by 2 a E* e_xx/(pi mu p0); the traction is Cattaneo's with the
  !> disc there. Nothing enters the contact and no node slips back, so that one step will do.
  subroutine test_bulk_strain(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: virgin, state
    real(wp), parameter :: load = 4.0_wp/3.0_wp, mu = 0.3_wp, p0 = 2.0_wp/pi, strain = 0.2_wp*mu*p0
    real(wp) :: c, e, shift, q, worst, center
    integer :: sign_of, row, col

    c = 0.5_wp**(1.0_wp/3.0_wp)
    do sign_of = -1, 1, 2
      e = sign_of*2.0_wp*strain/(pi*mu*p0)
      shift = pi*mu*p0/4.0_wp*(2.0_wp*(1.0_wp - c**2) + e**2)
      call new_sphere(contact, 16, 0.0_wp, 0.0_wp, coulomb_t(mu), error)
      if (allocated(error)) return
      state = virgin
      call step(contact, state, [f, f, f, d], [load, 0.0_wp, 0.0_wp, 0.0_wp], error)
      if (allocated(error)) return
      call step(contact, state, [f, f, f, d, d, d, d], &
                [load, 0.5_wp*mu*load, 0.0_wp, 0.0_wp, sign_of*strain, 0.0_wp, 0.0_wp], error)
      if (allocated(error)) return
      call check(error, state%motion(along_x), shift, 6.0e-4_wp*shift, 'shift')
      if (allocated(error)) return
      associate (x => coordinate(contact%problem%lattice, 1), y => coordinate(contact%problem%lattice, 2))
        center = sum(x, mask=state%zone == stick)/count(state%zone == stick)
        call check(error, center, e, 0.004_wp, 'center of the stick disc')
        if (allocated(error)) return
        worst = 0.0_wp
        do row = 1, size(x, 2)
          do col = 1, size(x, 1)
            q = sqrt(max(0.0_wp, 1.0_wp - x(col, row)**2 - y(col, row)**2)) &
                - c*sqrt(max(0.0_wp, 1.0_wp - ((x(col, row) - e)**2 + y(col, row)**2)/c**2))
            worst = worst + (state%traction(col, row, 1)/(mu*p0) - q)**2
          end do
        end do
        call check(error, sqrt(worst/count(state%pressure > 0.0_wp)), 0.0_wp, 0.0150_wp, 'traction')
        if (allocated(error)) return
        call check(error, state%motion(5:), [sign_of*strain, 0.0_wp, 0.0_wp], 0.0_wp, 'strain')
        if (allocated(error)) return
      end associate
    end do
  end subroutine test_bulk_strain

  !> Strain xy is strain xx - yy turned by 45 degrees, and its relief does not restore the tractions: friction remembers.
  subroutine test_bulk_shear(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: pressed, sheared, relieved, stretched
    real(wp), parameter :: load = 4.0_wp/3.0_wp, mu = 0.3_wp, strain = 0.1_wp
    integer, parameter :: control(7) = [f, f, f, d, d, d, d]
    real(wp), parameter :: rest(4) = [load, 0.0_wp, 0.0_wp, 0.0_wp]

    call new_sphere(contact, 10, 0.4_wp, 0.2_wp, coulomb_t(mu), error)
    if (allocated(error)) return
    call step(contact, pressed, control, [rest, 0.0_wp, 0.0_wp, 0.0_wp], error)
    if (allocated(error)) return
    sheared = pressed
    call step(contact, sheared, control, [rest, 0.0_wp, 0.0_wp, strain], error)
    if (allocated(error)) return
    call check_true(error, any(sheared%zone == stick) .and. any(sheared%zone == slip), 'stick and slip')
    if (allocated(error)) return
    stretched = pressed
    call step(contact, stretched, control, [rest, strain, -strain, 0.0_wp], error)
    if (allocated(error)) return
    call check(error, dissipation(stretched), dissipation(sheared), 0.01_wp*dissipation(sheared), 'dissipation')
    if (allocated(error)) return
    call check_true(error, dissipation(sheared) > 0.0_wp, 'a positive dissipation')
    if (allocated(error)) return
    relieved = sheared
    call step(contact, relieved, control, [rest, 0.0_wp, 0.0_wp, 0.0_wp], error)
    if (allocated(error)) return
    call check_true(error, largest(relieved%traction - pressed%traction) > 0.05_wp*mu, 'friction remembers')
  contains
    pure real(wp) function dissipation(state)
      type(contact_state_t), intent(in) :: state
      dissipation = -sum(state%traction*state%slip_increment)
    end function dissipation
  end subroutine test_bulk_shear

  !> Torsion of spheres: twist and torque where the stick radius is 0.6 a, for nu > 0, to 0.07 %.
  subroutine test_lubkin(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: state, pressed
    real(wp), parameter :: load = 4.0_wp/3.0_wp, mu = 0.4_wp, gamma = 0.49_wp, c = 0.6_wp
    real(wp) :: twist, torque, compliance, peak, t
    integer, parameter :: n = 400
    integer :: i

    compliance = 2.0_wp*(1.0_wp + gamma)              ! S_t = 2 pi (lambda_1 + lambda_5)
    peak = mu*2.0_wp/pi
    twist = 0.5_wp*compliance*peak*k_less_e(c)
    torque = 4.0_wp*twist*c**3/(3.0_wp*pi*compliance)
    do i = 1, n
      t = c + (i - 0.5_wp)*(1.0_wp - c)/n
      torque = torque + 2.0_wp*peak/pi*t**2*k_less_e(t)*(1.0_wp - c)/n
    end do
    torque = 4.0_wp*pi*torque

    call new_sphere(contact, 16, gamma, 0.0_wp, coulomb_t(mu), error)
    if (allocated(error)) return
    call step(contact, pressed, [f, f, f, d], [load, 0.0_wp, 0.0_wp, 0.0_wp], error)
    if (allocated(error)) return
    state = pressed
    call step(contact, state, [f, f, f, d], [load, 0.0_wp, 0.0_wp, twist], error)
    if (allocated(error)) return
    call check(error, state%load(about_z), torque, 6.7e-4_wp*torque, 'torque')
    if (allocated(error)) return
    call check(error, sqrt(real(count(state%zone == stick), wp)/count(state%zone /= separated)), c, 0.0037_wp, 'stick radius')
    if (allocated(error)) return
    call check(error, state%motion(along_x:along_y), [0.0_wp, 0.0_wp], 1.0e-8_wp, 'no shift')
    if (allocated(error)) return
    ! the torque as a load: the same twist
    torque = state%load(about_z)
    call step(contact, pressed, [f, f, f, f], [load, 0.0_wp, 0.0_wp, torque], error)
    if (allocated(error)) return
    call check(error, pressed%motion(about_z), twist, 1.0e-6_wp*twist, 'twist under the torque')
  end subroutine test_lubkin

  !> K(k) - E(k) with k^2 = 1 - r^2, by the arithmetic-geometric mean.
  pure real(wp) function k_less_e(r)
    real(wp), intent(in) :: r
    real(wp) :: a, b, excess, power, next
    integer :: i

    a = 1.0_wp
    b = r
    power = 0.5_wp
    excess = power*(1.0_wp - r**2)
    do i = 1, 8
      next = 0.5_wp*(a - b)
      power = 2.0_wp*power
      excess = excess + power*next**2
      next = sqrt(a*b)
      a = 0.5_wp*(a + b)
      b = next
    end do
    k_less_e = 0.5_wp*pi/a*excess
  end function k_less_e

  !> Without friction there is no shear traction, however the bodies are moved.
  subroutine test_no_friction(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: state

    call new_sphere(contact, 10, 0.3_wp, -0.3_wp, coulomb_t(0.0_wp), error)
    if (allocated(error)) return
    call step(contact, state, [f, d, d, d], [4.0_wp/3.0_wp, 0.3_wp, -0.1_wp, 0.2_wp], error)
    if (allocated(error)) return
    call check(error, largest(state%traction), 0.0_wp, 0.0_wp, 'shear traction')
    if (allocated(error)) return
    call check(error, maxval(state%pressure), 2.0_wp/pi, 1.0e-3_wp, 'pressure of Hertz')
    if (allocated(error)) return
    call check_true(error, all(state%zone /= stick), 'no stick')
  end subroutine test_no_friction

  !> More tangential load than can be carried: said so; as a shift it is carried, q = mu p everywhere.
  subroutine test_gross_sliding(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: state, next
    real(wp), parameter :: load = 4.0_wp/3.0_wp, mu = 0.3_wp

    call new_sphere(contact, 10, 0.0_wp, 0.0_wp, coulomb_t(mu), error)
    if (allocated(error)) return
    call step(contact, state, [f, f, f, d], [load, 0.0_wp, 0.0_wp, 0.0_wp], error)
    if (allocated(error)) return
    call contact%solve_step(state, state%relative_displacement, &
                            load_target_t([f, f, f, d], [load, 1.2_wp*mu*load, 0.0_wp, 0.0_wp]), 1.0e-8_wp, 40, next, error)
    if (allocated(error)) return
    call check_true(error, next%sliding .and. .not. next%converged, 'gross sliding')
    if (allocated(error)) return
    call check_true(error, next%residual_shear_force > 0.15_wp, 'the load that is missing')
    if (allocated(error)) return
    call step(contact, state, [f, d, f, d], [load, 2.0_wp, 0.0_wp, 0.0_wp], error)
    if (allocated(error)) return
    call check(error, state%load(along_x), mu*load, 1.0e-9_wp, 'load in sliding')
    if (allocated(error)) return
    call check_true(error, .not. state%sliding, 'a prescribed shift is carried')
    if (allocated(error)) return
    call check(error, reshape(state%traction(:, :, 1), [441]), reshape(mu*state%pressure, [441]), 1.0e-9_wp, 'q = mu p')
  end subroutine test_gross_sliding

  !> One and three threads end at the same bits.
  subroutine test_threads(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: state(2)
    real(wp), parameter :: load = 4.0_wp/3.0_wp
    integer :: i

    do i = 1, 2
      call new_sphere(contact, 15, 0.4_wp, -0.2_wp, coulomb_t(0.3_wp), error, n_threads=2*i - 1)
      if (allocated(error)) return
      call step(contact, state(i), [f, f, f, d], [load, 0.0_wp, 0.0_wp, 0.0_wp], error, 1.0e-8_wp)
      if (allocated(error)) return
      call step(contact, state(i), [f, f, f, d], [load, 0.2_wp*load, 0.0_wp, 0.0_wp], error, 1.0e-8_wp)
      if (allocated(error)) return
    end do
    call check_true(error, maxval(state(1)%traction) > 0.0_wp, 'a shear traction')
    if (allocated(error)) return
    call check(error, largest(state(2)%traction - state(1)%traction), 0.0_wp, 0.0_wp, 'shear traction')
    if (allocated(error)) return
    call check(error, largest(state(2)%pressure - state(1)%pressure), 0.0_wp, 0.0_wp, 'pressure')
    if (allocated(error)) return
    call check(error, state(2)%motion, state(1)%motion, 0.0_wp, 'motions')
  end subroutine test_threads

  subroutine test_bad_input(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: raised
    type(friction_problem_t) :: problem
    type(lattice_t) :: lattice
    real(wp) :: gap(5, 5)
    logical :: candidate(5, 5)

    call new_lattice(lattice, equilateral_basis(1.0_wp), [0, 0], [5, 5], error)
    if (allocated(error)) return
    gap = 0.0_wp
    candidate = .true.
    call new_friction_problem(problem, lattice, elastic_pair_t(), gap(:, :4), candidate, coulomb_t(0.1_wp), .false., raised)
    call check_raised(error, raised, status%invalid_input, 'a gap of another shape')
    if (allocated(error)) return
    call new_friction_problem(problem, lattice, elastic_pair_t(), gap, candidate, coulomb_t(-0.1_wp), .false., raised)
    call check_raised(error, raised, status%invalid_input, 'a negative coefficient')
    if (allocated(error)) return
    candidate = .false.
    call new_friction_problem(problem, lattice, elastic_pair_t(), gap, candidate, coulomb_t(0.1_wp), .false., raised)
    call check_raised(error, raised, status%invalid_input, 'no candidate')
  end subroutine test_bad_input

end module test_friction
