!> Fatigue quantities: histories whose answer is a formula, and what rotations and constant stresses must not change.
module test_fatigue
  use hc_fatigue_fields, only: find_ruiz
  use hc_precision, only: wp, pi
  use hc_error, only: error_t, status
  use hc_smallest_ball, only: find_smallest_ball
  use hc_invariant_criteria, only: crossland, dang_van, deviator_amplitude, largest_shear, deviator_coordinates
  use hc_plane_criteria, only: plane_criterion_t, smith_watson_topper_t, findley_t, fatemi_socie_t
  use hc_critical_plane, only: find_critical_plane
  use hc_strain_life, only: strain_life_t, new_strain_life
  use testing, only: test_t, new_test, check, check_raised, check_true
  implicit none
  private

  public :: collect_fatigue

  !> Steps of a cycle.
  integer, parameter :: n_t = 40

contains

  subroutine collect_fatigue(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('smallest_circle', test_circle), &
      new_test('smallest_ball', test_ball), &
      new_test('invariants', test_invariants), &
      new_test('uniaxial', test_uniaxial), &
      new_test('out_of_phase', test_out_of_phase), &
      new_test('rotated', test_rotated), &
      new_test('compressed', test_compressed), &
      new_test('strain_life', test_life), &
      new_test('ruiz', test_ruiz) &
    ]
  end subroutine collect_fatigue

  !> Angles of a cycle.
  pure real(wp) function phase(i)
    integer, intent(in) :: i
    phase = 2.0_wp*pi*(i - 1)/n_t
  end function phase

  !> The smallest circle around points is that of all pairs and triples that contains them and is smallest.
  subroutine test_circle(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: points(2, 9), center(2), radius, best
    integer :: trial, i, j, k

    call seed()
    do trial = 1, 200
      call random_number(points)
      if (mod(trial, 3) == 0) points = anint(4.0_wp*points)/4.0_wp ! corners of a grid: points coincide, four on a circle
      call find_smallest_ball(points, center, radius)
      best = huge(best)
      do i = 1, 9
        do j = i, 9
          call consider(0.5_wp*(points(:, i) + points(:, j)))
          do k = j + 1, 9
            call consider(circumcenter(points(:, i), points(:, j), points(:, k)))
          end do
        end do
      end do
      call check(error, radius, best, 1.0e-10_wp, 'radius of the smallest circle')
      if (allocated(error)) return
    end do

  contains

    subroutine consider(c)
      real(wp), intent(in) :: c(2)
      integer :: m
      best = min(best, maxval([(norm2(points(:, m) - c), m=1, 9)]))
    end subroutine consider

    pure function circumcenter(a, b, c) result(m)
      real(wp), intent(in) :: a(2), b(2), c(2)
      real(wp) :: m(2), twice_area
      twice_area = (b(1) - a(1))*(c(2) - a(2)) - (b(2) - a(2))*(c(1) - a(1))
      m = a
      if (abs(twice_area) < 1.0e-9_wp) return
      m(1) = a(1) + (sum((b - a)**2)*(c(2) - a(2)) - sum((c - a)**2)*(b(2) - a(2)))/(2.0_wp*twice_area)
      m(2) = a(2) + (sum((c - a)**2)*(b(1) - a(1)) - sum((b - a)**2)*(c(1) - a(1)))/(2.0_wp*twice_area)
    end function circumcenter

  end subroutine test_circle

  !> Points in a ball of which some lie on its surface, on both sides of every plane through the center.
  subroutine test_ball(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: points(5, 60), center(5), radius, middle(5)
    integer :: i, trial

    call seed()
    do trial = 1, 50
      call random_number(points)
      points = 2.0_wp*points - 1.0_wp
      call random_number(middle)
      do i = 1, size(points, 2)
        points(:, i) = 0.9_wp*points(:, i)/max(1.0_wp, norm2(points(:, i)))
      end do
      do i = 1, 5
        points(:, i) = merge(1.0_wp, 0.0_wp, [1, 2, 3, 4, 5] == i)
      end do
      points(:, 6) = -1.0_wp/sqrt(5.0_wp)
      do i = 1, size(points, 2)
        points(:, i) = middle + 3.0_wp*points(:, i)
      end do
      call find_smallest_ball(points, center, radius)
      call check(error, radius, 3.0_wp, 1.0e-10_wp, 'radius')
      if (.not. allocated(error)) call check(error, norm2(center - middle), 0.0_wp, 1.0e-9_wp, 'distance from the center')
      if (allocated(error)) return
    end do
  end subroutine test_ball

  !> Largest shear of uniaxial tension, torsion and a stress with three different principal values.
  subroutine test_invariants(error)
    type(error_t), allocatable, intent(out) :: error
    call check(error, shear_of([2.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]), 1.0_wp, 1.0e-12_wp, 'tension')
    if (.not. allocated(error)) then
      call check(error, shear_of([0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 3.0_wp, 0.0_wp]), 3.0_wp, 1.0e-12_wp, 'torsion')
    end if
    if (.not. allocated(error)) then
      call check(error, shear_of([1.0_wp, 4.0_wp, -7.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]), 5.5_wp, 1.0e-12_wp, 'three principal stresses')
    end if
    if (.not. allocated(error)) then
      ! the principal values of [[2,1],[1,2]] are 3 and 1; the third is 10
      call check(error, shear_of([2.0_wp, 2.0_wp, 10.0_wp, 1.0_wp, 0.0_wp, 0.0_wp]), 4.5_wp, 1.0e-12_wp, 'turned')
    end if
  contains
    pure real(wp) function shear_of(stress)
      real(wp), intent(in) :: stress(6)
      shear_of = largest_shear(deviator_coordinates(stress))
    end function shear_of
  end subroutine test_invariants

  !> Tension and pressure in turn, with a mean: all parameters in closed form.
  subroutine test_uniaxial(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: amplitude = 200.0_wp, mean = 50.0_wp, k = 0.4_wp, e = 2.0e5_wp, nu = 0.3_wp, g = e/(2.0_wp*(1.0_wp + nu))
    real(wp) :: history(6, n_t), value, normal(3), peak, best
    integer :: i

    history = 0.0_wp
    history(2, :) = [(mean + amplitude*cos(phase(i)), i=1, n_t)]
    peak = mean + amplitude
    call find_critical_plane(smith_watson_topper_t(e, nu), history, value, normal)
    call check(error, value, peak*amplitude/e, 1.0e-6_wp*value, 'Smith, Watson, Topper')
    if (allocated(error)) return
    call check(error, abs(normal(2)), 1.0_wp, 1.0e-5_wp, 'its plane')
    if (allocated(error)) return
    ! on a plane at theta: amplitude sin(2 theta)/2 + k peak cos(theta)^2
    call find_critical_plane(findley_t(k), history, value, normal)
    call check(error, value, 0.5_wp*(k*peak + sqrt(amplitude**2 + (k*peak)**2)), 1.0e-6_wp*value, 'Findley')
    if (allocated(error)) return
    call find_critical_plane(fatemi_socie_t(k, g, 300.0_wp), history, value, normal)
    best = maxval([(0.5_wp*amplitude*sin(2.0_wp*i*1.0e-4_wp)/g*(1.0_wp + k*peak*cos(i*1.0e-4_wp)**2/300.0_wp), i=1, 15707)])
    call check(error, value, best, 1.0e-5_wp*best, 'Fatemi, Socie')
    if (allocated(error)) return
    call check(error, crossland(history, 0.3_wp), amplitude/sqrt(3.0_wp) + 0.1_wp*peak, 1.0e-9_wp, 'Crossland')
    if (allocated(error)) return
    call check(error, dang_van(history, 0.3_wp), 0.5_wp*amplitude + 0.1_wp*peak, 1.0e-9_wp, 'Dang Van')
  end subroutine test_uniaxial

  !> Tension and torsion a quarter of a cycle apart: a circle in the space of deviators, of the radius of each alone.
  subroutine test_out_of_phase(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: history(6, n_t), amplitude, mean(5), expected(5)
    integer :: i

    history = 0.0_wp
    history(1, :) = [(sqrt(3.0_wp)*sin(phase(i)), i=1, n_t)]
    history(4, :) = [(cos(phase(i)), i=1, n_t)]
    call deviator_amplitude(history, amplitude, mean)
    call check(error, amplitude, 1.0_wp, 1.0e-12_wp, 'amplitude')
    if (allocated(error)) return
    history(1, :) = history(1, :) + 7.0_wp
    history(6, :) = -3.0_wp
    call deviator_amplitude(history, amplitude, mean)
    call check(error, amplitude, 1.0_wp, 1.0e-11_wp, 'amplitude about another mean')
    if (allocated(error)) return
    expected = deviator_coordinates([7.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, -3.0_wp])
    call check(error, norm2(mean - expected), 0.0_wp, 1.0e-10_wp, 'mean')
  end subroutine test_out_of_phase

  !> A history in a turned frame has the same values, on turned planes.
  subroutine test_rotated(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: history(6, n_t), turned(6, n_t), r(3, 3), s(3, 3), value(2), normal(3, 2)
    class(plane_criterion_t), allocatable :: criterion
    integer :: i, which, trial

    call seed()
    do trial = 1, 10
      call random_number(history)
      do i = 1, n_t
        history(:, i) = history(:, 1)*cos(phase(i)) + history(:, 2)*sin(2.0_wp*phase(i)) + 0.3_wp*history(:, 3)
      end do
      r = rotation()
      do i = 1, n_t
        s = reshape(history([1, 4, 6, 4, 2, 5, 6, 5, 3], i), [3, 3])
        s = matmul(matmul(r, s), transpose(r))
        turned(:, i) = [s(1, 1), s(2, 2), s(3, 3), s(1, 2), s(2, 3), s(1, 3)]
      end do
      call check(error, crossland(turned, 0.2_wp), crossland(history, 0.2_wp), 1.0e-10_wp, 'Crossland')
      if (allocated(error)) return
      call check(error, dang_van(turned, 0.2_wp), dang_van(history, 0.2_wp), 1.0e-9_wp, 'Dang Van')
      if (allocated(error)) return
      do which = 1, 3
        if (which == 1) criterion = smith_watson_topper_t(1.0_wp, 0.3_wp)
        if (which == 2) criterion = findley_t(0.3_wp)
        if (which == 3) criterion = fatemi_socie_t(0.5_wp, 1.0_wp, 2.0_wp)
        call find_critical_plane(criterion, history, value(1), normal(:, 1))
        call find_critical_plane(criterion, turned, value(2), normal(:, 2))
        call check(error, value(2), value(1), 1.0e-6_wp*value(1), 'critical plane in a turned frame')
        if (allocated(error)) return
        deallocate (criterion)
      end do
    end do
  contains
    function rotation() result(q)
      real(wp) :: q(3, 3), u(4)
      call random_number(u)
      u = (2.0_wp*u - 1.0_wp)
      u = u/norm2(u)
      q(1, :) = [1 - 2*(u(3)**2 + u(4)**2), 2*(u(2)*u(3) - u(1)*u(4)), 2*(u(2)*u(4) + u(1)*u(3))]
      q(2, :) = [2*(u(2)*u(3) + u(1)*u(4)), 1 - 2*(u(2)**2 + u(4)**2), 2*(u(3)*u(4) - u(1)*u(2))]
      q(3, :) = [2*(u(2)*u(4) - u(1)*u(3)), 2*(u(3)*u(4) + u(1)*u(2)), 1 - 2*(u(2)**2 + u(3)**2)]
    end function rotation
  end subroutine test_rotated

  !> Under pressure alone nothing opens a crack, and the largest of negative values is found as well.
  subroutine test_compressed(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: history(6, 3), value, normal(3)

    history = 0.0_wp
    history(1, :) = [-10.0_wp, -12.0_wp, -14.0_wp]
    history(2, :) = [-20.0_wp, -22.0_wp, -24.0_wp]
    history(3, :) = [-30.0_wp, -32.0_wp, -34.0_wp]
    call find_critical_plane(smith_watson_topper_t(1.0_wp, 0.3_wp), history, value, normal)
    call check(error, value, 0.0_wp, 0.0_wp, 'Smith, Watson, Topper under pressure')
    if (allocated(error)) return
    call find_critical_plane(findley_t(1.0_wp), history, value, normal) ! no shear varies: the least pressure
    call check(error, value, -10.0_wp, 1.0e-4_wp, 'Findley under pressure')
  end subroutine test_compressed

  subroutine test_life(error)
    type(error_t), allocatable, intent(out) :: error
    type(strain_life_t) :: curve
    type(error_t), allocatable :: raised
    real(wp), parameter :: n(4) = [1.0_wp, 1.0e3_wp, 1.0e6_wp, 1.0e9_wp]
    integer :: i

    call new_strain_life(curve, 72.0e9_wp, 1015.0e6_wp, -0.11_wp, 0.21_wp, -0.52_wp, error)
    if (allocated(error)) return
    do i = 1, size(n)
      call check(error, curve%cycles(curve%parameter_at(n(i))), n(i), 1.0e-10_wp*n(i), 'cycles')
      if (allocated(error)) return
    end do
    call check(error, curve%cycles(curve%parameter_at(0.25_wp)), 0.0_wp, 0.0_wp, 'less than half a cycle')
    if (allocated(error)) return
    call check_true(error, curve%cycles(0.0_wp) > huge(1.0_wp), 'no end without load')
    if (allocated(error)) return
    call new_strain_life(curve, 72.0e9_wp, 1015.0e6_wp, 0.11_wp, 0.21_wp, -0.52_wp, raised)
    call check_raised(error, raised, status%invalid_input, 'a positive exponent')
  end subroutine test_life

  !> Slip to and fro along a direction, with traction and stress along it.
  subroutine test_ruiz(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: t(2), slip(2, n_t), traction(2, n_t), stress(6, n_t), f_1, f_2, amplitude
    integer :: i

    t = [cos(2.2_wp), sin(2.2_wp)]
    do i = 1, n_t
      slip(:, i) = (3.0_wp + 2.0_wp*cos(phase(i)))*t
      traction(:, i) = -5.0_wp*sin(phase(i))*t
      stress(:, i) = 7.0_wp*sin(phase(i))*[t(1)**2, t(2)**2, 0.0_wp, t(1)*t(2), 0.0_wp, 0.0_wp]
    end do
    call find_ruiz(traction, slip, stress, f_1, f_2, amplitude)
    call check(error, amplitude, 2.0_wp, 1.0e-12_wp, 'slip amplitude')
    if (.not. allocated(error)) call check(error, f_1, 10.0_wp, 1.0e-12_wp, 'F1')
    if (.not. allocated(error)) call check(error, f_2, 70.0_wp, 1.0e-11_wp, 'F2')
    if (allocated(error)) return
    call find_ruiz(traction, 0.0_wp*slip, -abs(stress), f_1, f_2, amplitude)
    call check(error, abs(f_1) + abs(f_2) + amplitude, 0.0_wp, 0.0_wp, 'no slip')
  end subroutine test_ruiz

  subroutine seed()
    integer, allocatable :: state(:)
    integer :: n
    call random_seed(size=n)
    allocate (state(n), source=7)
    call random_seed(put=state)
  end subroutine seed

end module test_fatigue
