!> Closed solutions against printed numbers and against each other.
module test_analytic
  use hc_precision, only: wp, pi
  use hc_error, only: error_t, status
  use hc_carlson, only: carlson_rf, carlson_rd, complete_k
  use hc_scalar_function, only: gauss_legendre
  use hc_elliptic_contact, only: elliptic_contact_t, hertz_ellipse, crossed_cylinders_hessian
  use hc_partial_slip, only: mindlin_t, plane_cattaneo_t, turning_points
  use hc_torsion, only: lubkin_t
  use hc_self_similar, only: no_slip_constants, goodman_stick_ratio, goodman_stick_ratio_plane
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use hc_axisymmetric, only: power_law_t, rounded_punch_t, flat_punch_t
  use testing, only: test_t, new_test, check, check_true, check_raised
  implicit none
  private

  public :: collect_analytic

contains

  subroutine collect_analytic(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('elliptic_integrals', test_elliptic_integrals), &
      new_test('gauss_rule', test_gauss_rule), &
      new_test('ellipse', test_ellipse), &
      new_test('line_contact', test_line_contact), &
      new_test('partial_slip', test_partial_slip), &
      new_test('memory', test_memory), &
      new_test('torsion', test_torsion), &
      new_test('dissimilar', test_dissimilar), &
      new_test('power_laws', test_power_laws), &
      new_test('punches', test_punches) &
    ]
  end subroutine collect_analytic

  !> Values of section 3 of Carlson (1995), and K(1/2).
  subroutine test_elliptic_integrals(error)
    type(error_t), allocatable, intent(out) :: error

    call check(error, carlson_rf([1.0_wp, 2.0_wp], [2.0_wp, 3.0_wp], [0.0_wp, 4.0_wp]), &
               [1.3110287771461_wp, 0.58408284167715_wp], 1.0e-13_wp, 'R_F')
    if (allocated(error)) return
    call check(error, carlson_rd([0.0_wp, 2.0_wp], [2.0_wp, 3.0_wp], [1.0_wp, 4.0_wp]), &
               [1.7972103521034_wp, 0.16510527294261_wp], 1.0e-13_wp, 'R_D')
    if (allocated(error)) return
    call check(error, complete_k(0.5_wp), 1.8540746773013719_wp, 1.0e-15_wp, 'K(m = 1/2)')
    if (allocated(error)) return
    call check_true(error, min(carlson_rf(0.0_wp, 0.0_wp, 1.0_wp), carlson_rd(0.0_wp, 0.0_wp, 1.0_wp)) > huge(1.0_wp), &
                    'infinite integrals')
  end subroutine test_elliptic_integrals

  !> The rule of n points is exact for polynomials of the degree 2 n - 1.
  subroutine test_gauss_rule(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: node(7), weight(7)
    integer :: k

    call gauss_legendre(node, weight)
    call check(error, [(sum(weight*node**k), k=0, 13)], [(1.0_wp/(k + 1), k=0, 13)], 1.0e-15_wp, 'powers')
    if (allocated(error)) return
    call check_true(error, abs(sum(weight*node**14) - 1.0_wp/15.0_wp) > 1.0e-9_wp, 'and no further')
  end subroutine test_gauss_rule

  !> Crossed cylinders of section 9.3 of the dissertation (tests/reference/benchmarks.csv); a sphere; the inverse.
  subroutine test_ellipse(error)
    type(error_t), allocatable, intent(out) :: error
    type(elliptic_contact_t) :: ellipse, again
    real(wp) :: hessian(2, 2)

    hessian = crossed_cylinders_hessian(0.075_wp, 0.05_wp, pi/6.0_wp)
    call hertz_ellipse(ellipse, 57.25903e9_wp, hessian, error, normal_load=1.0e4_wp)
    if (allocated(error)) return
    call check(error, ellipse%semi_major/5.532394e-3_wp, 1.0_wp, 5.0e-7_wp, 'a')
    if (allocated(error)) return
    call check(error, ellipse%semi_minor/0.9701612e-3_wp, 1.0_wp, 5.0e-7_wp, 'b')
    if (allocated(error)) return
    call check(error, ellipse%max_pressure/889.5788e6_wp, 1.0_wp, 5.0e-7_wp, 'p0')
    if (allocated(error)) return
    call check(error, ellipse%angle*180.0_wp/pi, 18.29339_wp, 1.0e-5_wp, 'angle')
    if (allocated(error)) return
    call check(error, ellipse%pressure(0.0_wp, 0.0_wp), ellipse%max_pressure, 0.0_wp, 'pressure in the middle')
    if (allocated(error)) return
    call check(error, ellipse%pressure(ellipse%semi_minor*1.1_wp, -ellipse%semi_minor), 0.0_wp, 0.0_wp, 'pressure outside')
    if (allocated(error)) return
    call hertz_ellipse(again, 57.25903e9_wp, hessian, error, approach=ellipse%approach)
    if (allocated(error)) return
    call check(error, again%normal_load, 1.0e4_wp, 1.0e-8_wp, 'load by the approach')
    if (allocated(error)) return
    ! a^3 = 3 P R/(4 E*), delta = a^2/R
    hessian = reshape([0.5_wp, 0.0_wp, 0.0_wp, 0.5_wp], [2, 2])
    call hertz_ellipse(ellipse, 1.5_wp, hessian, error, normal_load=1.0_wp)
    if (allocated(error)) return
    call check(error, [ellipse%semi_major, ellipse%semi_minor, ellipse%approach, ellipse%angle], &
               [1.0_wp, 1.0_wp, 0.5_wp, 0.0_wp], 1.0e-14_wp, 'sphere')
  end subroutine test_ellipse

  !> A gap that does not close along one direction.
  subroutine test_line_contact(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: raised
    type(elliptic_contact_t) :: ellipse

    call hertz_ellipse(ellipse, 1.0_wp, crossed_cylinders_hessian(1.0_wp, 1.0_wp, 0.0_wp), raised, approach=1.0_wp)
    call check_raised(error, raised, status%invalid_input, 'parallel cylinders')
  end subroutine test_line_contact

  !> Load and shift are inverse, the loop has the area of the closed form, strips are half-ellipses.
  subroutine test_partial_slip(error)
    type(error_t), allocatable, intent(out) :: error
    type(mindlin_t), parameter :: spheres = mindlin_t(0.5_wp, 4.0_wp/3.0_wp, 1.0_wp, 4.0_wp)
    type(plane_cattaneo_t), parameter :: cylinders = plane_cattaneo_t(0.5_wp, 2.0_wp, 1.0_wp)
    real(wp) :: node(40), weight(40), peak

    call check(error, spheres%sliding_shift(), 0.5_wp, 1.0e-15_wp, '3 mu P S/(16 a)')
    if (allocated(error)) return
    call check(error, spheres%load(spheres%shift([-0.3_wp, 0.0_wp, 0.5_wp])), [-0.3_wp, 0.0_wp, 0.5_wp], 1.0e-15_wp, 'load')
    if (allocated(error)) return
    call check(error, spheres%load(0.7_wp), spheres%sliding_load(), 0.0_wp, 'sliding')
    if (allocated(error)) return
    peak = 0.6_wp*spheres%sliding_load()
    ! benchmarks.csv, loop Q* = 0.6 mu P
    call check(error, spheres%energy_per_cycle(peak), 0.01824773_wp, 1.0e-8_wp, 'energy of a cycle')
    if (allocated(error)) return
    call gauss_legendre(node, weight)
    call check(error, 4.0_wp*peak*sum(weight*spheres%shift_unloading(peak*(2.0_wp*node - 1.0_wp), peak)), &
               spheres%energy_per_cycle(peak), 1.0e-10_wp, 'area of the loop')
    if (allocated(error)) return
    ! r = u (2 - u) takes the root at the rim out
    associate (r => node*(2.0_wp - node), slope => 2.0_wp*(1.0_wp - node))
      call check(error, 2.0_wp*pi*sum(weight*r*slope*spheres%traction(r, 0.5_wp)), 0.5_wp, 1.0e-3_wp, 'sum of the traction')
      if (allocated(error)) return
      call check(error, spheres%traction_unloading(r, -peak, peak), -spheres%traction(r, peak), 1.0e-15_wp, 'full reversal')
      if (allocated(error)) return
    end associate
    call check_true(error, ieee_is_nan(cylinders%stick_half_width(1.01_wp)), 'no stick beyond the sliding load')
    if (allocated(error)) return
    call check(error, cylinders%stick_half_width(0.75_wp), 0.5_wp, 1.0e-15_wp, 'stick strip')
    if (allocated(error)) return
    ! 2 mu P'/(pi b^2) (b - c)
    call check(error, cylinders%traction(0.0_wp, -0.75_wp), -1.0_wp/pi, 1.0e-15_wp, 'traction in the middle')
  end subroutine test_partial_slip

  !> Reversals are remembered until a slip zone has grown over them.
  subroutine test_memory(error)
    type(error_t), allocatable, intent(out) :: error

    call expect([1.0_wp, 2.0_wp, 3.0_wp], [3.0_wp], 'first loading')
    if (allocated(error)) return
    call expect([3.0_wp, -1.0_wp, 1.0_wp, 0.0_wp], [3.0_wp, -1.0_wp, 1.0_wp, 0.0_wp], 'reversals within each other')
    if (allocated(error)) return
    call expect([3.0_wp, -1.0_wp, 1.0_wp, -2.0_wp], [3.0_wp, -2.0_wp], 'a closed inner loop')
    if (allocated(error)) return
    call expect([3.0_wp, -1.0_wp, 1.0_wp, -3.0_wp], [-3.0_wp], 'the mirror image of the first loading')
  contains

    subroutine expect(loads, remembered, what)
      !> History, turning points, what it is
      real(wp), intent(in) :: loads(:), remembered(:)
      character(len=*), intent(in) :: what
      real(wp) :: turns(size(loads))
      integer :: n_turn

      call turning_points(loads, turns, n_turn)
      call check(error, n_turn, size(remembered), what)
      if (allocated(error)) return
      call check(error, turns(:n_turn), remembered, 0.0_wp, what)
    end subroutine expect
  end subroutine test_memory

  !> Torque and twist at c/a = 1/2 (benchmarks.csv), sliding, no slip.
  subroutine test_torsion(error)
    type(error_t), allocatable, intent(out) :: error
    type(lubkin_t), parameter :: spheres = lubkin_t(0.3_wp, 4.0_wp/3.0_wp, 1.0_wp, 2.0_wp)

    call check(error, spheres%torque(0.5_wp)/0.4_wp, 0.528576_wp, 5.0e-7_wp, 'torque')
    if (allocated(error)) return
    call check(error, spheres%twist(0.5_wp), 0.1805695_wp, 1.0e-7_wp, 'twist')
    if (allocated(error)) return
    call check(error, spheres%stick_radius(spheres%torque([0.1_wp, 0.5_wp])), [0.1_wp, 0.5_wp], 1.0e-12_wp, 'stick radius')
    if (allocated(error)) return
    call check(error, spheres%torque(1.0e-9_wp), spheres%sliding_torque(), 1.0e-14_wp, 'sliding')
    if (allocated(error)) return
    ! Reissner and Sagoci: M = 16 theta a^3/(3 S_t)
    associate (c => 1.0_wp - 1.0e-6_wp)
      call check(error, spheres%torque(c)*6.0_wp/(16.0_wp*spheres%twist(c)), 1.0_wp, 1.0e-5_wp, 'no slip')
      if (allocated(error)) return
    end associate
    call check_true(error, ieee_is_nan(spheres%stick_radius(spheres%sliding_torque())), 'no stick when sliding')
  end subroutine test_torsion

  !> Constants without slip, and stick ratios (benchmarks.csv).
  subroutine test_dissimilar(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: kappa, chi, beta, k

    call no_slip_constants(0.0_wp, kappa, chi)
    call check(error, [kappa, chi], [1.0_wp, 1.0_wp], 1.0e-14_wp, 'similar bodies')
    if (allocated(error)) return
    call no_slip_constants(0.3_wp, kappa, chi)
    call check(error, kappa, 1.031732_wp, 5.0e-7_wp, 'kappa')
    if (allocated(error)) return
    ! a/a_H = (kappa chi)^(-1/3)
    call no_slip_constants(-0.1890756_wp, kappa, chi)
    call check(error, (kappa*chi)**(-1.0_wp/3.0_wp), 0.99256_wp, 1.0e-5_wp, 'chi')
    if (allocated(error)) return
    call check(error, goodman_stick_ratio([0.1_wp, -0.3_wp], [0.2_wp, 0.1_wp]), [0.99623_wp, 0.19532_wp], 6.0e-6_wp, 'c/a')
    if (allocated(error)) return
    ! |beta| K(k) = mu K'(k): k^2 = 1/2 for mu = |beta|, and mu from k = 0.9
    call check(error, goodman_stick_ratio_plane(-0.2_wp, 0.2_wp), sqrt(0.5_wp), 1.0e-14_wp, 'c/b for mu = |beta|')
    if (allocated(error)) return
    k = 0.9_wp
    beta = 0.1_wp*complete_k(k**2)/complete_k(1.0_wp - k**2)
    call check(error, goodman_stick_ratio_plane(beta, 0.1_wp), k, 1.0e-14_wp, 'c/b')
    if (allocated(error)) return
    call check_true(error, ieee_is_nan(goodman_stick_ratio(0.5_wp, 1.0e-4_wp)), 'too small a stick ratio')
  end subroutine test_dissimilar

  !> Closed forms of n = 1, 2, 3, 4, and the sum of the pressure for an exponent that is no integer.
  subroutine test_power_laws(error)
    type(error_t), allocatable, intent(out) :: error
    type(power_law_t) :: body
    real(wp) :: node(60), weight(60)

    ! Sneddon's cone: delta = pi m a/2, P = pi E* m a^2/2, p = (E* m/2) arcosh(a/r)
    body = power_law_t(2.0_wp, 0.3_wp, 1.0_wp)
    call check(error, [body%approach(1.5_wp), body%load(1.5_wp)], pi*[0.225_wp, 0.675_wp], 1.0e-14_wp, 'cone')
    if (allocated(error)) return
    call check(error, body%pressure(1.5_wp, [0.01_wp, -1.0_wp, 1.49_wp]), &
               0.3_wp*acosh(1.5_wp/[0.01_wp, 1.0_wp, 1.49_wp]), 1.0e-14_wp, 'pressure of the cone')
    if (allocated(error)) return
    call check_true(error, min(body%max_pressure(1.5_wp), body%pressure(1.5_wp, 0.0_wp)) > huge(1.0_wp), 'its tip')
    if (allocated(error)) return
    ! Hertz: R = 1, a = 1, E* = 3/4: P = 1, p0 = 3/(2 pi)
    body = power_law_t(0.75_wp, 0.5_wp, 2.0_wp)
    call check(error, [body%load(1.0_wp), body%approach(1.0_wp), body%max_pressure(1.0_wp), body%pressure(1.0_wp, 0.6_wp)], &
               [1.0_wp, 1.0_wp, 1.5_wp/pi, 1.2_wp/pi], 1.0e-14_wp, 'sphere')
    if (allocated(error)) return
    ! n = 4: p = 32/(3 pi) (s^3/3 + r^2 s), largest at r = a/sqrt(2)
    body = power_law_t(1.0_wp, 1.0_wp, 4.0_wp)
    call check(error, body%pressure(1.0_wp, [0.0_wp, 0.6_wp, 1.1_wp]), &
               32.0_wp/(3.0_wp*pi)*[1.0_wp/3.0_wp, 0.512_wp/3.0_wp + 0.36_wp*0.8_wp, 0.0_wp], 1.0e-14_wp, 'fourth power')
    if (allocated(error)) return
    call check(error, body%max_pressure(1.0_wp), 32.0_wp*sqrt(2.0_wp)/(9.0_wp*pi), 1.0e-14_wp, 'its largest pressure')
    if (allocated(error)) return
    body = power_law_t(2.0_wp, 0.4_wp, 5.3_wp)
    call check(error, [body%contact_radius(normal_load=body%load(0.9_wp)), body%contact_radius(approach=body%approach(0.9_wp))], &
               [0.9_wp, 0.9_wp], 1.0e-14_wp, 'contact radius')
    if (allocated(error)) return
    call gauss_legendre(node, weight)
    associate (r => 0.9_wp*sqrt((1.0_wp - node)*(1.0_wp + node)))
      ! r dr = a^2 s ds takes the root at the edge out
      call check(error, 2.0_wp*pi*0.81_wp*sum(weight*node*body%pressure(0.9_wp, r)), body%load(0.9_wp), 1.0e-9_wp, 'sum')
    end associate
  end subroutine test_power_laws

  !> A rounded punch (benchmarks.csv, E* = 1, a = 1, b = 0.6, R = 1) and a flat one.
  subroutine test_punches(error)
    type(error_t), allocatable, intent(out) :: error
    type(rounded_punch_t), parameter :: rounded = rounded_punch_t(1.0_wp, 0.6_wp, 1.0_wp)
    type(flat_punch_t), parameter :: flat = flat_punch_t(2.0_wp, 1.3_wp)
    real(wp), parameter :: beside = 1.0e-12_wp
    real(wp) :: p(3), node(60), weight(60)

    call check(error, [rounded%load(1.0_wp), rounded%approach(1.0_wp)], [0.4142895_wp, 0.2436229_wp], 5.0e-8_wp, 'rounded punch')
    if (allocated(error)) return
    ! the table's values for a lattice are 1e-5 below and 2e-5 above
    call check(error, rounded%max_pressure(1.0_wp), 0.17562_wp, 2.0e-5_wp, 'largest pressure')
    if (allocated(error)) return
    ! r = x^2 (3 - 2 x) on both sides of the end of the flat, where the pressure has a kink
    call gauss_legendre(node, weight)
    weight = weight*6.0_wp*node*(1.0_wp - node)
    node = node**2*(3.0_wp - 2.0_wp*node)
    associate (inner => 0.6_wp*node, outer => 0.6_wp + 0.4_wp*node)
      call check(error, 2.0_wp*pi*(0.6_wp*sum(weight*inner*rounded%pressure(1.0_wp, inner)) &
                                   + 0.4_wp*sum(weight*outer*rounded%pressure(1.0_wp, outer))), &
                 rounded%load(1.0_wp), 1.0e-7_wp, 'sum of the pressure')
      if (allocated(error)) return
    end associate
    call check(error, [rounded%contact_radius(normal_load=rounded%load(1.7_wp)), rounded%contact_radius(approach=0.2436229_wp)], &
               [1.7_wp, 1.0_wp], 1.0e-7_wp, 'contact radius')
    if (allocated(error)) return
    p = rounded%pressure(1.0_wp, 0.6_wp*[1.0_wp - beside, 1.0_wp, 1.0_wp + beside])
    call check(error, p, spread(p(2), 1, 3), 1.0e-10_wp, 'the pressure is continuous where the flat ends')
    if (allocated(error)) return
    call check(error, [flat%stiffness(), flat%pressure(1.0_wp, 0.0_wp), flat%pressure(1.0_wp, 1.31_wp)], &
               [5.2_wp, 1.0_wp/(2.0_wp*pi*1.69_wp), 0.0_wp], 1.0e-15_wp, 'flat punch')
    if (allocated(error)) return
    call check_true(error, flat%pressure(1.0_wp, -1.3_wp) > huge(1.0_wp), 'its edge')
  end subroutine test_punches

end module test_analytic
