!> Windows that repeat: symbols, and waves pressed flat.
module test_periodic
  use hc_precision, only: wp, pi
  use hc_error, only: error_t, status
  use hc_contact_problem, only: friction_problem_t, new_friction_problem
  use hc_contact_state, only: contact_state_t, new_friction_state, load_target_t, force_control, displacement_control, &
    stick
  use hc_coulomb, only: coulomb_t
  use hc_field_space, only: field_space_t
  use hc_frictional_contact, only: frictional_contact_t, new_frictional_contact
  use hc_elastic_pair, only: elastic_pair_t
  use hc_flexibility_fft, only: fft_flexibility_t, new_fft_flexibility
  use hc_depth_fields, only: half_space_of
  use hc_layer_response, only: layer_t, layered_body_t
  use hc_interior_points, only: fields_at_points
  use hc_periodic_interior, only: periodic_interior_t, new_periodic_interior
  use hc_lattice, only: lattice_t, new_lattice, equilateral_basis, oblique_basis
  use hc_normal_contact, only: normal_contact_t, new_normal_contact
  use hc_periodic_symbol, only: periodic_symbols_t, new_periodic_symbols, n_symbol
  use testing, only: test_t, new_test, check, check_raised, check_true, largest
  implicit none
  private

  public :: collect_periodic

  !> The approach and both shifts follow from loads; nothing turns.
  integer, parameter :: by_loads(4) = [force_control, force_control, force_control, displacement_control]

contains

  subroutine collect_periodic(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('symbols', test_symbols), &
      new_test('symbols_of_long_cells', test_long_cells), &
      new_test('operator', test_operator), &
      new_test('westergaard', test_westergaard), &
      new_test('three_cosines', test_three_cosines), &
      new_test('two_cosines', test_two_cosines), &
      new_test('mean_gap', test_mean_gap), &
      new_test('across_the_end', test_across), &
      new_test('bad_windows', test_bad), &
      new_test('superposition', test_superposition), &
      new_test('shifts', test_shifts), &
      new_test('narrow_window', test_narrow), &
      new_test('flat', test_flat), &
      new_test('unlike', test_unlike), &
      new_test('waves_below', test_below), &
      new_test('planes_below', test_planes)]
  end subroutine collect_periodic

  !> Frequencies of the equilateral lattice, K1 from Epstein's zeta sums, the others from extrapolated alias sums; at the
  !> corner of the zone K_xx is half of K1.
  subroutine test_symbols(error)
    type(error_t), allocatable, intent(out) :: error
    type(periodic_symbols_t) :: symbols
    real(wp) :: found(0:5, n_symbol)

    call new_periodic_symbols(symbols, equilateral_basis(1.0_wp), [6, 6], n_symbol)
    call symbols%column(3, found)
    call check(error, found(0, :), [1.476671689842_wp, 0.3691679224605_wp, 0.6394175982263_wp, 0.0_wp, 0.0_wp], 4.0e-11_wp, &
               'half a turn along x')
    call check(error, found(3, :), [1.476671689842_wp, 0.3691679224605_wp, -0.6394175982263_wp, 0.0_wp, 0.0_wp], 4.0e-11_wp, &
               'half a turn along both')
    call symbols%column(2, found)
    call check(error, found(4, :), [1.301658414445_wp, 0.6508292072225_wp, 0.0_wp, 0.0_wp, 0.0_wp], 4.0e-11_wp, &
               'the corner of the zone')
  end subroutine test_symbols

  !> Half of the frequencies of cells that are twice as long are those of every second node of the lattice: the symbols of a
  !> coarse pyramid are sums of those of fine ones.
  subroutine test_long_cells(error)
    type(error_t), allocatable, intent(out) :: error
    !> The coarse pyramid in fine ones: 1 at its node, 1/2 at the neighbors
    type(periodic_symbols_t) :: fine, coarse
    integer, parameter :: n = 8
    real(wp) :: basis(2, 2), of_fine(0:n - 1, n_symbol, 0:n/2), of_coarse(0:n/2 - 1, n_symbol), sum_of(n_symbol), odd(n_symbol)
    real(wp) :: worst
    integer :: f, g, a, b, ff, gg, case

    worst = 0.0_wp
    odd = [1.0_wp, 1.0_wp, 1.0_wp, -1.0_wp, -1.0_wp]
    do case = 1, 3
      basis = oblique_basis(1.0_wp, [1.0_wp, 0.5_wp, 3.0_wp], [1.1_wp, 0.5_wp*pi, 1.8_wp], case)
      call new_periodic_symbols(fine, basis, [n, n], n_symbol)
      call new_periodic_symbols(coarse, 2.0_wp*basis, [n/2, n/2], n_symbol)
      do f = 0, n/2
        call fine%column(f, of_fine(:, :, f))
      end do
      do f = 0, n/4
        call coarse%column(f, of_coarse)
        do g = 0, n/2 - 1
          if (f == 0 .and. g == 0) cycle
          ! the coarse lattice has every second value: the mean of the four fine frequencies that look the same there
          sum_of = 0.0_wp
          do b = 0, 1
            do a = 0, 1
              ff = modulo(f + a*n/2, n)
              gg = modulo(g + b*n/2, n)
              if (ff > n/2) then
                sum_of = sum_of + 0.25_wp*pyramid(ff, gg)*odd*of_fine(modulo(n - gg, n), :, n - ff)
              else
                sum_of = sum_of + 0.25_wp*pyramid(ff, gg)*of_fine(gg, :, ff)
              end if
            end do
          end do
          worst = max(worst, maxval(abs(sum_of - of_coarse(g, :)))/of_coarse(g, 1))
        end do
      end do
    end do
    call check(error, worst, 0.0_wp, 1.0e-10_wp, 'coarse pyramids from fine ones')

  contains

    pure function oblique_basis(spacing, ratio, angle, which) result(made)
      real(wp), intent(in) :: spacing, ratio(:), angle(:)
      integer, intent(in) :: which
      real(wp) :: made(2, 2)

      made = spacing*reshape([1.0_wp, 0.0_wp, ratio(which)*cos(angle(which)), ratio(which)*sin(angle(which))], [2, 2])
    end function oblique_basis

    pure real(wp) function pyramid(f1, f2)
      integer, intent(in) :: f1, f2

      associate (x => 2.0_wp*pi*f1/n, y => 2.0_wp*pi*f2/n)
        pyramid = 1.0_wp + cos(x) + cos(y) + cos(x - y)
      end associate
    end function pyramid

  end subroutine test_long_cells

  !> A traction without force or moment on a large window displaces as it does on one that ends: images hardly matter.
  subroutine test_operator(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 96, all_three(3) = [1, 2, 3]
    type(lattice_t) :: lattice
    type(elastic_pair_t) :: pair
    type(fft_flexibility_t) :: free, repeated
    real(wp), allocatable :: traction(:, :, :), on_free(:, :, :), on_repeated(:, :, :)
    integer :: m

    pair = elastic_pair_t(1.0_wp/pi, 0.06_wp, 0.1_wp)
    call new_lattice(lattice, equilateral_basis(1.0_wp), [0, 0], [n, n], error)
    if (allocated(error)) return
    call new_fft_flexibility(free, lattice, pair, error)
    if (allocated(error)) return
    lattice%periodic = .true.
    call new_fft_flexibility(repeated, lattice, pair, error)
    if (allocated(error)) return
    allocate (traction(n, n, 3), on_free(n, n, 3), on_repeated(n, n, 3))
    do m = 1, 3
      traction = 0.0_wp
      traction(n/2 - 1:n/2 + 1, n/2, m) = [1.0_wp, -2.0_wp, 1.0_wp]
      call free%apply(all_three, traction, all_three, on_free, error)
      if (allocated(error)) return
      call repeated%apply(all_three, traction, all_three, on_repeated, error)
      if (allocated(error)) return
      associate (near => on_free(n/4:3*n/4, n/4:3*n/4, :), there => on_repeated(n/4:3*n/4, n/4:3*n/4, :))
        call check(error, largest(near - there), 0.0_wp, 2.0e-5_wp*maxval(abs(near)), 'displacements near the traction')
      end associate
    end do
  end subroutine test_operator

  !> Solve for a normal load or a mean gap, of bodies with E* = 1.
  subroutine solve(lattice, gap, control, target, state, error)
    type(lattice_t), intent(in) :: lattice
    real(wp), intent(in) :: gap(:, :)
    integer, intent(in) :: control
    !> Mean pressure, or approach
    real(wp), intent(in) :: target
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error
    type(normal_contact_t) :: contact
    logical :: candidate(size(gap, 1), size(gap, 2))

    candidate = .true.
    call new_normal_contact(contact, lattice, elastic_pair_t(1.0_wp/pi, 0.0_wp, 0.0_wp), gap, candidate, error)
    if (allocated(error)) return
    call contact%solve(control, merge(target*lattice%cell_area()*lattice%size(), target, control == force_control), 1.0e-10_wp, &
                       500, state, error)
    if (allocated(error)) return
    call check_true(error, state%converged .and. .not. state%clipped, 'converged')
  end subroutine solve

  !> Three waves on a unit square: a rough surface.
  subroutine waves(lattice, gap, error)
    type(lattice_t), intent(out) :: lattice
    real(wp), intent(out) :: gap(:, :)
    type(error_t), allocatable, intent(out) :: error
    real(wp), dimension(size(gap, 1), size(gap, 2)) :: x, y

    call new_lattice(lattice, oblique_basis(1.0_wp/size(gap, 1), 1.0_wp, 0.5_wp*pi), [0, 0], shape(gap), error)
    if (allocated(error)) return
    lattice%periodic = .true.
    call lattice%coordinates(x, y)
    gap = sin(2.0_wp*pi*x + 1.0_wp) + 0.4_wp*sin(2.0_wp*pi*(2*x + y)) + 0.3_wp*cos(2.0_wp*pi*(3*y - x))
  end subroutine waves

  !> A contact with friction of bodies with E* = 1.
  subroutine new_contact(lattice, beta, gamma, mu, gap, contact, error)
    type(lattice_t), intent(in) :: lattice
    real(wp), intent(in) :: beta, gamma, mu, gap(:, :)
    type(frictional_contact_t), intent(out) :: contact
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem

    call new_friction_problem(problem, lattice, elastic_pair_t(1.0_wp/pi, beta/pi, gamma/pi), gap, gap < huge(1.0_wp), &
                              coulomb_t(mu), .false., error)
    if (.not. allocated(error)) call new_frictional_contact(contact, problem, error)
  end subroutine new_contact

  !> A wave along the second reciprocal vector, on n nodes; its height is 1 (REACH: H. M. Westergaard, J. Appl. Mech. 6, 1939).
  subroutine test_westergaard(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: nodes(2) = [64, 128]
    type(lattice_t) :: lattice
    type(contact_state_t) :: state
    real(wp) :: gap(8, maxval(nodes)), wave, full
    integer :: k, row, n

    do k = 1, 2
      n = nodes(k)
      call new_lattice(lattice, equilateral_basis(1.0_wp), [0, 0], [8, n], error)
      if (allocated(error)) return
      lattice%periodic = .true.
      wave = 0.5_wp*sqrt(3.0_wp)*n
      full = pi/wave
      do row = 1, n
        gap(:, row) = 1.0_wp - cos(2.0_wp*pi*(row - 1)/n)
      end do
      call solve(lattice, gap(:, :n), force_control, 0.5_wp*full, state, error)
      if (allocated(error)) return
      call check(error, maxval(state%pressure)/full, sqrt(2.0_wp), 4.0_wp/n**2, 'largest pressure')
      call check(error, real(count(state%pressure(1, :) > 0.0_wp), wp)/n, 0.5_wp, 1.0_wp/n, 'share in contact')
      ! complete contact: any load beyond, and the pressure is a wave
      call solve(lattice, gap(:, :n), force_control, 1.5_wp*full, state, error)
      if (allocated(error)) return
      call check_true(error, all(state%pressure > 0.0_wp), 'complete contact')
      call check(error, maxval(state%pressure)/full, 2.5_wp, 4.0_wp/n**2, 'largest pressure of complete contact')
      call check(error, largest(state%gap), 0.0_wp, 1.0e-9_wp, 'no gap')
    end do
  end subroutine test_westergaard

  !> Peaks on a rhombus: mean gaps of the same pyramids, from an independent program.
  subroutine test_three_cosines(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: nodes(3) = [32, 64, 128]
    real(wp), parameter :: light(3) = [1.5324_wp, 1.5296_wp, 1.5291_wp], heavy(3) = [0.19705_wp, 0.19562_wp, 0.19538_wp]
    type(lattice_t) :: lattice
    type(contact_state_t) :: state
    real(wp), allocatable :: gap(:, :)
    real(wp) :: full
    integer :: k, n, i, j

    do k = 1, 3
      n = nodes(k)
      call new_lattice(lattice, equilateral_basis(1.0_wp/n), [0, 0], [n, n], error)
      if (allocated(error)) return
      lattice%periodic = .true.
      allocate (gap(n, n))
      do j = 1, n
        do i = 1, n
          gap(i, j) = 3.0_wp - cos(2.0_wp*pi*i/n) - cos(2.0_wp*pi*j/n) - cos(2.0_wp*pi*(i + j)/n)
        end do
      end do
      full = 3.0_wp*pi/sqrt(3.0_wp)
      call solve(lattice, gap, force_control, 0.1_wp*full, state, error)
      if (allocated(error)) return
      call check(error, sum(state%gap)/n**2, light(k), 6.0e-5_wp, 'mean gap under a light load')
      call check(error, 3.0_wp - state%motion(1), sum(state%gap)/n**2, 1.0e-12_wp, 'the approach is that of mean planes')
      call solve(lattice, gap, force_control, 0.5_wp*full, state, error)
      if (allocated(error)) return
      call check(error, sum(state%gap)/n**2, heavy(k), 6.0e-6_wp, 'mean gap under half the load of complete contact')
      deallocate (gap)
    end do
  end subroutine test_three_cosines

  !> Two cosines on a square: mean gap and largest pressure of a spectral program on 512 x 512 nodes, E* = height = wave = 1.
  subroutine test_two_cosines(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 128
    real(wp), parameter :: load(4) = [0.03_wp, 0.1_wp, 0.5_wp, 0.9_wp], &
      mean_gap(4) = [0.66068_wp, 0.38475_wp, 0.045078_wp, 0.000651_wp], largest_pressure(4) = [0.6019_wp, 0.8839_wp, 1.4793_wp, &
                                                                                              1.8997_wp]
    type(lattice_t) :: lattice
    type(contact_state_t) :: state
    real(wp) :: gap(n, n), full
    integer :: k, i, j

    call new_lattice(lattice, oblique_basis(1.0_wp/n, 1.0_wp, 0.5_wp*pi), [0, 0], [n, n], error)
    if (allocated(error)) return
    lattice%periodic = .true.
    do j = 1, n
      do i = 1, n
        gap(i, j) = 1.0_wp - cos(2.0_wp*pi*i/n)*cos(2.0_wp*pi*j/n)
      end do
    end do
    full = sqrt(2.0_wp)*pi
    do k = 1, 4
      call solve(lattice, gap, force_control, load(k)*full, state, error)
      if (allocated(error)) return
      call check(error, sum(state%gap)/n**2, mean_gap(k), 3.0e-4_wp, 'mean gap')
      call check(error, maxval(state%pressure)/full, largest_pressure(k), 4.0e-3_wp, 'largest pressure')
    end do
  end subroutine test_two_cosines

  !> A mean gap leads back to the load, and one beyond the lowest point to none.
  subroutine test_mean_gap(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 64
    type(lattice_t) :: lattice
    type(contact_state_t) :: by_load, by_gap
    real(wp) :: gap(n, n)

    call waves(lattice, gap, error)
    if (allocated(error)) return
    call solve(lattice, gap, force_control, 0.6_wp, by_load, error)
    if (allocated(error)) return
    call solve(lattice, gap, displacement_control, by_load%motion(1), by_gap, error)
    if (allocated(error)) return
    call check(error, by_gap%load(1), by_load%load(1), 1.0e-8_wp*by_load%load(1), 'load')
    call check(error, largest(by_gap%pressure - by_load%pressure), 0.0_wp, 1.0e-7_wp*maxval(by_load%pressure), 'pressure')
  end subroutine test_mean_gap

  !> A contact across the end of the window is the one in its middle.
  subroutine test_across(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 64
    type(lattice_t) :: lattice
    type(contact_state_t) :: middle, across
    real(wp) :: gap(n, n)
    integer :: i, j

    call new_lattice(lattice, equilateral_basis(1.0_wp/n), [0, 0], [n, n], error)
    if (allocated(error)) return
    lattice%periodic = .true.
    do j = 1, n
      do i = 1, n
        associate (a => real(i - n/2, wp)/n, b => real(j - n/2, wp)/n)
          gap(i, j) = a**2 + b**2 + a*b
        end associate
      end do
    end do
    call solve(lattice, gap, force_control, 0.05_wp, middle, error)
    if (allocated(error)) return
    gap = cshift(cshift(gap, n/2, dim=1), n/2, dim=2)
    call solve(lattice, gap, force_control, 0.05_wp, across, error)
    if (allocated(error)) return
    call check(error, largest(cshift(cshift(middle%pressure, n/2, dim=1), n/2, dim=2) - across%pressure), 0.0_wp, &
               1.0e-8_wp*maxval(middle%pressure), 'pressure')
    call check(error, across%motion(1), middle%motion(1), 1.0e-9_wp, 'approach')
  end subroutine test_across

  subroutine test_bad(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: raised
    type(lattice_t) :: lattice
    type(fft_flexibility_t) :: operator

    call new_lattice(lattice, equilateral_basis(1.0_wp), [0, 0], [10, 10], error)
    if (allocated(error)) return
    lattice%periodic = .true.
    call new_fft_flexibility(operator, lattice, elastic_pair_t(1.0_wp, 0.0_wp, 0.0_wp), raised)
    call check_raised(error, raised, status%invalid_input, 'ten columns')
    lattice%extent = 12
    lattice%periodic = [.true., .false.]
    call new_fft_flexibility(operator, lattice, elastic_pair_t(1.0_wp, 0.0_wp, 0.0_wp), raised)
    call check_raised(error, raised, status%invalid_input, 'one way only')
  end subroutine test_bad

  !> Friction on a rough surface of bodies with nu = 0: the traction is mu times the difference of two pressures (J. Jaeger, Arch.
  !> Appl. Mech. 65, 1995; M. Ciavarella, Int. J. Solids Struct. 35, 1998).
  subroutine test_superposition(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 64
    type(lattice_t) :: lattice
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: pressed, less, before, after
    real(wp) :: gap(n, n), reference(n, n, 2), area
    real(wp), parameter :: mu = 0.4_wp, p = 0.6_wp, q = 0.1_wp
    type(load_target_t) :: target

    call waves(lattice, gap, error)
    if (allocated(error)) return
    area = lattice%cell_area()*lattice%size()
    call solve(lattice, gap, force_control, p, pressed, error)
    if (allocated(error)) return
    call solve(lattice, gap, force_control, p - q/mu, less, error)
    if (allocated(error)) return
    call new_contact(lattice, 0.0_wp, 0.0_wp, mu, gap, contact, error)
    if (allocated(error)) return
    reference = 0.0_wp
    call new_friction_state(before, lattice, field_space_t())
    target = load_target_t(by_loads, [p*area, 0.0_wp, 0.0_wp, 0.0_wp])
    call contact%solve_step(before, reference, target, 1.0e-11_wp, 500, after, error)
    if (allocated(error)) return
    call check(error, largest(after%pressure - pressed%pressure), 0.0_wp, 1.0e-8_wp*maxval(pressed%pressure), 'pressure')
    reference = after%relative_displacement
    before = after
    target%value(2) = q*area
    call contact%solve_step(before, reference, target, 1.0e-11_wp, 500, after, error)
    if (allocated(error)) return
    call check(error, largest(after%traction(:, :, 1) - mu*(pressed%pressure - less%pressure)), 0.0_wp, &
               1.0e-9_wp*maxval(pressed%pressure), 'shear traction')
    call check(error, largest(after%traction(:, :, 2)), 0.0_wp, 1.0e-8_wp*maxval(pressed%pressure), 'across')
    call check(error, after%motion(2), mu*(pressed%motion(1) - less%motion(1)), 1.0e-8_wp, 'shift')
  end subroutine test_superposition

  !> Press a contact by a load, and shift it: each shift takes few sweeps.
  subroutine press_and_shift(contact, lattice, load, shift, state, error)
    type(frictional_contact_t), intent(inout) :: contact
    type(lattice_t), intent(in) :: lattice
    real(wp), intent(in) :: load, shift(:)
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: control(4) = [force_control, displacement_control, force_control, displacement_control]
    type(contact_state_t) :: before
    real(wp), allocatable :: reference(:, :, :)
    type(load_target_t) :: target
    integer :: k

    call new_friction_state(state, lattice, field_space_t())
    do k = 0, size(shift)
      before = state
      reference = before%relative_displacement
      target = load_target_t(control, [load, merge(shift(max(k, 1)), 0.0_wp, k > 0), 0.0_wp, 0.0_wp])
      call contact%solve_step(before, reference, target, 1.0e-10_wp, 500, state, error)
      if (allocated(error)) return
      call check_true(error, state%converged .and. state%sweeps <= 12, 'few sweeps')
      if (allocated(error)) return
    end do
  end subroutine press_and_shift

  !> A rough surface in complete contact of bodies with nu = 0 under a shift, which then goes back in part: mu times the
  !> difference to the pressure whose mean gap is the shift over mu, less twice that of half of the way back. Some nodes slip under
  !> the least shift, since no traction in stick has a mean displacement.
  subroutine test_shifts(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 32
    type(lattice_t) :: lattice
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: pressed, ahead, back, after
    real(wp) :: gap(n, n), load
    real(wp), parameter :: mu = 0.4_wp, p = 12.0_wp, shift(2) = [0.1_wp, 0.04_wp]

    call waves(lattice, gap, error)
    if (allocated(error)) return
    gap = gap - sum(gap)/size(gap)
    load = p*lattice%cell_area()*lattice%size()
    call solve(lattice, gap, force_control, p, pressed, error)
    if (allocated(error)) return
    call check_true(error, all(pressed%pressure > 0.0_wp), 'complete contact')
    if (allocated(error)) return
    call solve(lattice, gap, displacement_control, -shift(1)/mu, ahead, error)
    if (allocated(error)) return
    call solve(lattice, gap, displacement_control, -0.5_wp*(shift(1) - shift(2))/mu, back, error)
    if (allocated(error)) return
    call new_contact(lattice, 0.0_wp, 0.0_wp, mu, gap, contact, error)
    if (allocated(error)) return
    call press_and_shift(contact, lattice, load, shift(:1), after, error)
    if (allocated(error)) return
    call check(error, largest(after%traction(:, :, 1) - mu*(pressed%pressure - ahead%pressure)), 0.0_wp, &
               1.0e-8_wp*maxval(pressed%pressure), 'ahead')
    call press_and_shift(contact, lattice, load, shift, after, error)
    if (allocated(error)) return
    call check(error, largest(after%traction(:, :, 1) - mu*(2.0_wp*back%pressure - pressed%pressure - ahead%pressure)), 0.0_wp, &
               1.0e-8_wp*maxval(pressed%pressure), 'back')
  end subroutine test_shifts

  !> A wave along a window of 512 columns and one row, in incomplete and in complete contact under a shift, nu = 0: zones of
  !> contacts that go on across do not alternate.
  subroutine test_narrow(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 512
    type(lattice_t) :: lattice
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: pressed, less, after
    real(wp), dimension(n, 1) :: gap, x, y
    real(wp), parameter :: mu = 0.4_wp, shift = 0.03_wp, p(2) = [0.1_wp, 1.5_wp]*pi
    integer :: k

    call new_lattice(lattice, oblique_basis(1.0_wp/n, 1.0_wp, 0.5_wp*pi), [0, 0], [n, 1], error)
    if (allocated(error)) return
    lattice%periodic = .true.
    call lattice%coordinates(x, y)
    gap = -cos(2.0_wp*pi*x)
    call new_contact(lattice, 0.0_wp, 0.0_wp, mu, gap, contact, error)
    do k = 1, 2
      if (allocated(error)) return
      call solve(lattice, gap, force_control, p(k), pressed, error)
      if (allocated(error)) return
      call solve(lattice, gap, displacement_control, pressed%motion(1) - shift/mu, less, error)
      if (allocated(error)) return
      call press_and_shift(contact, lattice, p(k)*lattice%cell_area()*lattice%size(), [shift], after, error)
      if (allocated(error)) return
      call check(error, largest(after%traction(:, :, 1) - mu*(pressed%pressure - less%pressure)), 0.0_wp, &
                 1.0e-8_wp*maxval(pressed%pressure), 'shear traction')
    end do
  end subroutine test_narrow

  !> Flat on flat: no shear traction and no shift until all of it slides, whatever the bodies.
  subroutine test_flat(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 32
    type(lattice_t) :: lattice
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: before, after
    real(wp) :: gap(n, n), reference(n, n, 2)
    real(wp), parameter :: mu = 0.4_wp, beta(2) = [0.0_wp, 0.3_wp], load = n*n*0.5_wp*sqrt(3.0_wp)
    integer :: k

    call new_lattice(lattice, equilateral_basis(1.0_wp), [0, 0], [n, n], error)
    if (allocated(error)) return
    lattice%periodic = .true.
    gap = 0.0_wp
    reference = 0.0_wp
    do k = 1, 2
      call new_contact(lattice, beta(k), 0.2_wp, mu, gap, contact, error)
      if (allocated(error)) return
      call new_friction_state(before, lattice, field_space_t())
      call contact%solve_step(before, reference, load_target_t(by_loads, [load, 0.3_wp*load, 0.1_wp*load, 0.0_wp]), 1.0e-10_wp, &
                              500, after, error)
      if (allocated(error)) return
      call check_true(error, after%converged .and. all(after%zone == stick), 'sticks')
      call check(error, largest(after%pressure), 1.0_wp, 1.0e-9_wp, 'pressure')
      call check(error, largest(after%traction(:, :, 1)), 0.3_wp, 1.0e-9_wp, 'shear traction')
      call check(error, after%motion(:3), [0.0_wp, 0.0_wp, 0.0_wp], 1.0e-9_wp, 'no motion')
      call contact%solve_step(before, reference, load_target_t(by_loads, [load, 0.5_wp*load, 0.0_wp, 0.0_wp]), 1.0e-10_wp, &
                              500, after, error)
      if (allocated(error)) return
      call check_true(error, after%sliding .and. .not. after%converged, 'slides')
    end do
  end subroutine test_flat

  !> Unlike bodies, waves pressed and sheared; complete contact at the end.
  subroutine test_unlike(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 64
    type(lattice_t) :: lattice
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: before, after
    real(wp) :: gap(n, n), reference(n, n, 2), area, load
    real(wp), parameter :: mu = 0.3_wp, p(7) = [0.2_wp, 1.0_wp, 1.0_wp, 1.0_wp, 8.0_wp, 20.0_wp, 20.0_wp], &
                           q(7) = [0.0_wp, 0.0_wp, 0.15_wp, -0.1_wp, 0.0_wp, 0.0_wp, 2.0_wp]
    integer :: k

    call waves(lattice, gap, error)
    if (allocated(error)) return
    area = lattice%cell_area()*lattice%size()
    call new_contact(lattice, 0.25_wp, 0.3_wp, mu, gap, contact, error)
    if (allocated(error)) return
    reference = 0.0_wp
    call new_friction_state(before, lattice, field_space_t())
    do k = 1, size(p)
      load = p(k)*area
      call contact%solve_step(before, reference, load_target_t(by_loads, [load, q(k)*area, 0.2_wp*q(k)*area, 0.0_wp]), &
                              1.0e-9_wp, 500, after, error)
      if (allocated(error)) return
      call check_true(error, after%converged, 'converged')
      reference = after%relative_displacement
      before = after
    end do
    call check_true(error, all(after%pressure > 0.0_wp) .and. all(after%zone == stick), 'complete contact, which sticks')
    call check(error, after%motion(1), 0.0_wp, 1.0e-9_wp, 'no mean gap')
  end subroutine test_unlike

  !> A wave of pressure and one of shear, linear between nodes: Westergaard's stress of each of its harmonics.
  subroutine test_below(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 16, n_harmonic = 3000
    real(wp), parameter :: nu = 0.3_wp, depth(7) = [0.0_wp, 0.01_wp, 0.1_wp, 0.12_wp, 0.13_wp, 0.3_wp, 0.9_wp]
    type(lattice_t) :: lattice
    real(wp) :: traction(n, 4, 3, 1), points(3, size(depth)), u(3, size(depth), 1), s(6, size(depth), 1), known(6), k, e, x(n, 4)
    integer :: i, m

    call new_lattice(lattice, oblique_basis(1.0_wp/n, 1.3_wp, 0.5_wp*pi, 0.0_wp), [-3, 1], [n, 4], error)
    if (allocated(error)) return
    lattice%periodic = .true.
    call lattice%coordinates(x, traction(:, :, 2, 1))
    traction(:, :, 1, 1) = 2.0_wp + cos(2.0_wp*pi*x)
    traction(:, :, 2, 1) = 0.3_wp*sin(2.0_wp*pi*x)
    traction(:, :, 3, 1) = -0.2_wp
    do i = 1, size(depth)
      points(:, i) = [0.13_wp, 0.4_wp, depth(i)]
    end do
    call fields_at_points(lattice, traction, 1, half_space_of(nu), points, u, s, error)
    if (allocated(error)) return
    do i = 1, size(depth)
      known = [0.0_wp, 0.0_wp, -2.0_wp, 0.0_wp, 0.2_wp, 0.0_wp]
      do m = -n_harmonic, n_harmonic
        k = 2.0_wp*pi*(1 + m*n)
        e = (sin(k/(2*n))/(k/(2*n)))**2*exp(-abs(k)*depth(i))
        associate (c => cos(k*points(1, i)), q => 0.3_wp*sign(1.0_wp, k), kz => abs(k)*depth(i))
          known(1) = known(1) + e*c*(kz - 1.0_wp + q*(2.0_wp - kz))
          known(2) = known(2) + 2.0_wp*nu*e*c*(q - 1.0_wp)
          known(3) = known(3) + e*c*(q*kz - 1.0_wp - kz)
          known(6) = known(6) - e*sin(k*points(1, i))*(sign(kz, k) + 0.3_wp*(1.0_wp - kz))
        end associate
      end do
      call check(error, s(:, i, 1), known, 3.0e-7_wp, 'stress of a wave')
      if (allocated(error)) return
    end do
  end subroutine test_below

  !> Planes are the values at their nodes, in both bodies and below layers; their means are those of the tractions.
  subroutine test_planes(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: depth(4) = [0.0_wp, 0.07_wp, 0.25_wp, 0.5_wp]
    type(lattice_t) :: lattice
    type(layered_body_t) :: body(2)
    type(periodic_interior_t) :: repeating
    real(wp) :: traction(8, 6, 3, 2), stress(8, 6, 6, 2), moved(8, 6, 3, 2), points(3, 1), u(3, 1, 2), s(6, 1, 2)
    integer :: i, j

    call random_number(traction)
    call new_lattice(lattice, oblique_basis(0.1_wp, 0.7_wp, 1.2_wp, 0.4_wp), [-2, 3], [8, 6], error, [0.3_wp, 0.1_wp])
    if (allocated(error)) return
    lattice%periodic = .true.
    body(1) = half_space_of(0.25_wp)
    body(2)%layer = [layer_t(0.2_wp, 3.0_wp, 0.3_wp)]
    body(2)%base = layer_t(0.0_wp, 1.0_wp, 0.2_wp)
    do i = 1, 2
      do j = 1, size(depth)
        points(:2, 1) = lattice%origin + matmul(lattice%basis, [2.0_wp + 8.0_wp, 5.0_wp - 6.0_wp])
        points(3, 1) = depth(j)
        call fields_at_points(lattice, traction, 1, body(i), points, u, s, error)
        if (allocated(error)) return
        call new_periodic_interior(repeating, lattice, 1, body(i), traction, field_space_t(), error)
        if (.not. allocated(error)) call repeating%on_plane(depth(j), stress, error)
        if (.not. allocated(error)) call repeating%on_plane(depth(j), moved, error)
        if (allocated(error)) return
        call check(error, [stress(5, 3, :, :), moved(5, 3, :, :)], [s(:, 1, :), u(:, 1, :)], 1.0e-8_wp, 'plane')
        if (allocated(error)) return
        call check(error, [sum(sum(stress(:, :, [3, 6, 5], :), dim=1), dim=1)]/48, [-sum(sum(traction, dim=1), dim=1)]/48, &
                   1.0e-7_wp, 'means')
        if (allocated(error)) return
      end do
    end do
  end subroutine test_planes

end module test_periodic
