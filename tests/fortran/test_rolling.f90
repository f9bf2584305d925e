!> Rolling bodies: the tractions of the scheme at given creepages, steady and step by step, on rows of the lattice.
module test_rolling
  use hc_precision, only: wp, pi
  use hc_error, only: error_t, status
  use hc_contact_problem, only: friction_problem_t, new_friction_problem
  use hc_contact_state, only: contact_state_t, new_friction_state, load_target_t, force_control, displacement_control, stick, &
    separated
  use hc_coulomb, only: coulomb_t
  use hc_elastic_pair, only: elastic_pair_t
  use hc_flexibility, only: normal
  use hc_flexibility_fft, only: fft_flexibility_t, new_fft_flexibility
  use hc_frictional_contact, only: frictional_contact_t, new_frictional_contact
  use hc_lattice, only: lattice_t, new_lattice, equilateral_basis, oblique_basis
  use hc_creep_loads, only: creep_loads_t, find_creep_loads
  use hc_load_path, only: advance, step_settings_t
  use hc_rolling, only: rolling_t, row_along
  use test_friction, only: new_sphere
  use testing, only: test_t, new_test, check, check_raised, check_true, coordinate, largest, open_table
  implicit none
  private

  public :: collect_rolling

  integer, parameter :: f = force_control, d = displacement_control
  !> Columns and rows from a node to the six around it, in turn
  integer, parameter :: around(2, 6) = reshape([1, 0, 0, 1, -1, 1, -1, 0, 0, -1, 1, -1], [2, 6])
  !> Poisson's ratio of the tables; residuals of the tests
  real(wp), parameter :: nu = 0.25_wp, accurate = 1.0e-9_wp

contains

  subroutine collect_rolling(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('rows', test_rows), &
      new_test('shift', test_shift), &
      new_test('motions', test_motions), &
      new_test('scheme', test_scheme), &
      new_test('transient', test_transient), &
      new_test('directions', test_directions), &
      new_test('prescribed_loads', test_loads), &
      new_test('full_slip', test_full_slip), &
      new_test('powers', test_powers), &
      new_test('unlike', test_unlike), &
      new_test('to_steady', test_to_steady), &
      new_test('creep_loads', test_creep_loads), &
      new_test('torque_and_creepage', test_torque)]
  end subroutine collect_rolling

  !> Directions of rows, and one between them.
  subroutine test_rows(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    integer :: k

    call new_lattice(lattice, equilateral_basis(2.0_wp), [0, 0], [4, 4], error)
    if (allocated(error)) return
    do k = 1, size(around, 2)
      call check_true(error, all(row_along(lattice, (k - 1)*pi/3) == around(:, k)), 'a row each 60 degrees')
      if (allocated(error)) return
    end do
    call check_true(error, all(row_along(lattice, 0.5_wp*pi) == 0), 'no row across')
    if (allocated(error)) return
    call new_lattice(lattice, oblique_basis(2.0_wp, 3.0_wp, 0.5_wp*pi, 0.0_wp), [0, 0], [4, 4], error)
    if (allocated(error)) return
    call check_true(error, all(row_along(lattice, -0.5_wp*pi) == [0, -1]), 'a row across rectangles')
  end subroutine test_rows

  !> Values of nodes ahead, differences and sums, at nodes that are not at the rim.
  subroutine test_shift(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 7, m = 6
    type(rolling_t) :: rolling
    real(wp), target :: field(n, m), moved(n, m), summed(n, m)
    real(wp), pointer, contiguous :: along(:)
    integer :: k, i, j

    call random_number(field)
    do k = 1, size(around, 2)
      rolling = rolling_t(around(:, k), .true., 0.5_wp)
      moved = field
      along(1:n*m) => moved
      call rolling%subtract_ahead(n, along)
      summed = 0.0_wp
      summed(2:n - 1, 2:m - 1) = field(2:n - 1, 2:m - 1)
      call rolling%sum_behind(summed)
      associate (ahead => rolling%shifted(field), by => rolling%ahead)
        do j = 2, m - 1
          do i = 2, n - 1
            call check(error, ahead(i, j), field(i + by(1), j + by(2)), 0.0_wp, 'node ahead')
            if (allocated(error)) return
            call check(error, moved(i, j), 0.5_wp*(field(i, j) - field(i + by(1), j + by(2))), 0.0_wp, 'half the difference')
            if (allocated(error)) return
            call check(error, summed(i, j) - summed(i + by(1), j + by(2)), field(i, j), 1.0e-15_wp*n, 'sum')
            if (allocated(error)) return
          end do
        end do
      end associate
    end do
  end subroutine test_shift

  !> Motions over a spacing are those of the creepages in the middle of it; and back.
  subroutine test_motions(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: creepage(3) = [0.2_wp, -0.3_wp, 0.7_wp]
    type(lattice_t) :: lattice
    type(rolling_t) :: rolling
    integer :: k

    call new_lattice(lattice, equilateral_basis(0.1_wp), [0, 0], [4, 4], error)
    if (allocated(error)) return
    rolling = rolling_t([1, 0])
    call check(error, rolling%motions(lattice, creepage), -0.1_wp*[0.2_wp, -0.3_wp + 0.7_wp*0.05_wp, 0.7_wp], 1.0e-16_wp, &
               'along x')
    do k = 1, size(around, 2)
      if (allocated(error)) return
      rolling = rolling_t(around(:, k))
      call check(error, rolling%creepages(lattice, rolling%motions(lattice, creepage)), creepage, 1.0e-15_wp, 'back')
    end do
  end subroutine test_motions

  !> Every third row of the table of the scheme, whose creepages take turns.
  subroutine test_scheme(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: state
    real(wp) :: n, origin(2), creepage(3), expected(3), share, load
    integer :: unit, stat, row, n_contact

    call open_table('rolling_scheme.csv', unit, error)
    if (allocated(error)) return
    row = 0
    do
      read (unit, *, iostat=stat) n, origin, creepage, expected, share
      if (stat /= 0) exit
      row = row + 1
      if (mod(row, 3) /= 1) cycle
      call new_disc(contact, nint(n), origin, 0.0_wp, load, error)
      if (allocated(error)) exit
      if (allocated(state%pressure)) deallocate (state%pressure)
      call roll(contact, state, [f, d, d, d], [load, creepage], .true., error)
      if (allocated(error)) exit
      call check(error, state%load(2:4)/load, expected, 2.0e-9_wp, 'forces and moment')
      if (allocated(error)) exit
      ! the table counts nodes at distance 1, too
      n_contact = count(state%zone /= separated)
      call check(error, count(state%zone == stick)/(share*n_contact), 1.0_wp, 0.03_wp, 'share that sticks')
      if (allocated(error)) exit
      call check_true(error, state%operator_applications <= 60.0_wp, 'operator applications')
      if (allocated(error)) exit
    end do
    close (unit)
    if (.not. allocated(error)) call check(error, row, 44, 'rows of the table')
  end subroutine test_scheme

  !> Step by step from no shear traction, at constant creepage.
  subroutine test_transient(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: state
    real(wp) :: n, creepage(3), expected(3), share, load
    integer :: unit, stat, row, step, done

    call open_table('rolling_transient.csv', unit, error)
    if (allocated(error)) return
    row = 0
    done = 0
    do
      read (unit, *, iostat=stat) n, creepage, step, expected, share
      if (stat /= 0) exit
      row = row + 1
      if (step == 1) then
        call new_disc(contact, nint(n), [0.0_wp, 0.0_wp], 0.0_wp, load, error)
        if (allocated(error)) exit
        if (allocated(state%pressure)) deallocate (state%pressure)
        done = 0
      end if
      if (step > 16) cycle
      do while (done < step)
        call roll(contact, state, [f, d, d, d], [load, creepage], .false., error)
        if (allocated(error)) exit
        done = done + 1
      end do
      if (allocated(error)) exit
      call check(error, state%load(2:4)/load, expected, 2.0e-9_wp, 'forces and moment')
      if (allocated(error)) exit
    end do
    close (unit)
    if (.not. allocated(error)) call check(error, row, 34, 'rows of the table')
  end subroutine test_transient

  !> The same creepages along each row of the lattice have the same forces.
  subroutine test_directions(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: state
    real(wp) :: load, turn(2, 2), found(3), first(3)
    integer :: k

    call new_disc(contact, 9, [0.0_wp, 0.0_wp], 0.0_wp, load, error)
    if (allocated(error)) return
    first = 0.0_wp
    do k = 1, size(around, 2)
      associate (angle => (k - 1)*pi/3)
        turn = reshape([cos(angle), sin(angle), -sin(angle), cos(angle)], [2, 2])
      end associate
      if (allocated(state%pressure)) deallocate (state%pressure)
      call roll(contact, state, [f, d, d, d], [load, matmul(turn, [-0.2_wp, -0.1_wp]), 0.5_wp], .true., error, around(:, k))
      if (allocated(error)) return
      found = [matmul(state%load(2:3), turn), state%load(4)]/load
      if (k == 1) first = found
      call check(error, found, first, 1.0e-8_wp, 'forces along the row')
      if (allocated(error)) return
    end do
    call check_true(error, first(1) > 0.2_wp .and. abs(first(2)) > 0.1_wp, 'of no small size')
  end subroutine test_directions

  !> Loads of many creepages are those of each; a case without solution is the last one.
  subroutine test_creep_loads(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: creepage(3, 4) = reshape([-0.1_wp, 0.0_wp, 0.0_wp, -0.3_wp, 0.1_wp, 0.0_wp, 0.2_wp, -0.4_wp, 1.0_wp, &
                                                     2.0_wp, 3.0_wp, -0.5_wp], [3, 4])
    type(error_t), allocatable :: raised
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: state, begun
    type(creep_loads_t) :: found
    type(load_target_t) :: target
    real(wp) :: load
    integer :: k

    call new_disc(contact, 9, [0.0_wp, 0.0_wp], 0.0_wp, load, error)
    if (allocated(error)) return
    target%value(1) = load
    target%rolling = rolling_t([1, 0], .true.)
    call new_friction_state(begun, contact%problem%lattice)
    state = begun
    call find_creep_loads(contact, state, target, creepage, step_settings_t(accurate), found, error)
    if (allocated(error)) return
    call check(error, found%n_solved, size(creepage, 2), 'all cases')
    do k = 1, size(creepage, 2)
      if (allocated(error)) return
      call check_true(error, found%work(k) > 1.0_wp .and. found%work(k) <= 60.0_wp, 'operator applications')
      if (allocated(error)) return
      if (allocated(state%pressure)) deallocate (state%pressure)
      call roll(contact, state, [f, d, d, d], [load, creepage(:, k)], .true., error)
      if (allocated(error)) return
      call check(error, found%load(:, k)/load, state%load(2:4)/load, 1.0e-8_wp, 'loads of a case')
    end do
    if (allocated(error)) return
    state = begun
    call find_creep_loads(contact, state, target, creepage, step_settings_t(accurate, max_sweeps=1, max_cuts=0), found, error)
    if (allocated(error)) return
    call check(error, found%n_solved, 0, 'no solution in one sweep')
    if (allocated(error)) return
    target%rolling%steady = .false.
    call find_creep_loads(contact, state, target, creepage, step_settings_t(accurate), found, raised)
    call check_raised(error, raised, status%invalid_input, 'no steady state')
  end subroutine test_creep_loads

  !> Prescribed loads lead to creepages that cause these loads.
  subroutine test_loads(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: control(4, 4) = reshape([f, f, d, d, f, f, f, d, f, f, f, f, f, d, f, d], [4, 4])
    real(wp), parameter :: value(3, 4) = reshape([0.5_wp, -0.1_wp, 0.0_wp, 0.5_wp, 0.1_wp, 0.5_wp, 0.8_wp, 0.0_wp, 0.05_wp, &
                                                  -0.1_wp, 0.0_wp, 1.0_wp], [3, 4])
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: state, back
    real(wp) :: load
    integer :: k

    call new_disc(contact, 9, [0.0_wp, 0.0_wp], 0.0_wp, load, error)
    if (allocated(error)) return
    do k = 1, size(control, 2)
      if (allocated(state%pressure)) deallocate (state%pressure)
      if (allocated(back%pressure)) deallocate (back%pressure)
      call roll(contact, state, control(:, k), [load, merge(load*value(:, k), value(:, k), control(2:, k) == f)], .true., error)
      if (allocated(error)) return
      call roll(contact, back, [f, d, d, d], [load, state%creepage], .true., error)
      if (allocated(error)) return
      call check(error, state%load(2:4)/load, back%load(2:4)/load, 1.0e-7_wp, 'loads of the creepages')
      if (allocated(error)) return
      call check(error, merge(state%load(2:4)/load, state%creepage, control(2:, k) == f), value(:, k), 1.0e-8_wp, 'prescribed')
      if (allocated(error)) return
    end do
  end subroutine test_loads

  !> At large creepage all nodes slip, and friction is all there is; pure spin turns the contact at 3 pi/16 mu N a.
  subroutine test_full_slip(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: state
    real(wp) :: load

    call new_disc(contact, 12, [0.0_wp, 0.0_wp], 0.0_wp, load, error)
    if (allocated(error)) return
    call roll(contact, state, [f, d, d, d], [load, -30.0_wp, 40.0_wp, 0.0_wp], .true., error)
    if (allocated(error)) return
    call check(error, state%load(2:3)/load, [0.6_wp, -0.8_wp], 1.0e-3_wp, 'against the creepage')
    if (allocated(error)) return
    call check(error, norm2(state%load(2:3))/load, 1.0_wp, 1.0e-5_wp, 'mu P')
    if (allocated(error)) return
    call roll(contact, state, [f, d, d, d], [load, 0.0_wp, 0.0_wp, 400.0_wp], .true., error)
    if (allocated(error)) return
    call check(error, state%load(4)/load, -3.0_wp*pi/16.0_wp, 0.01_wp, 'torque of the spin')
    if (allocated(error)) return
    ! the spin turns about a point half a spacing behind
    call check(error, state%load(2:3)/load, [0.0_wp, 0.0_wp], 0.75_wp/12, 'forces of the spin')
  end subroutine test_full_slip

  !> Creep forces take more power than friction by the dissipation of the scheme, which falls with the spacing; in the steady
  !> state a point of the surface takes as much as the whole contact over a spacing, row by row.
  subroutine test_powers(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: state
    real(wp) :: load, rest(2)
    integer :: k

    do k = 1, 2
      call new_disc(contact, 8*k, [0.0_wp, 0.0_wp], 0.0_wp, load, error)
      if (allocated(error)) return
      if (allocated(state%pressure)) deallocate (state%pressure)
      call roll(contact, state, [f, d, d, d], [load, -0.3_wp, 0.0_wp, 0.0_wp], .true., error)
      if (allocated(error)) return
      call check(error, state%creep_power, 0.3_wp*state%load(2), 1.0e-12_wp, '-Q.xi')
      if (allocated(error)) return
      rest(k) = 1.0_wp - state%slip_power/state%creep_power
      call check(error, state%creep_power_error, state%creep_power - state%slip_power, 1.0e-6_wp, 'error bar')
      if (allocated(error)) return
      associate (lattice => contact%problem%lattice, behind => state%dissipation_density(2, :))
        call check(error, sum(behind)*lattice%cell_area()/lattice%spacing(), state%slip_power, 1.0e-12_wp, 'behind the contact')
      end associate
      if (allocated(error)) return
    end do
    call check_true(error, all(rest > 0.0_wp) .and. rest(2) < 0.65_wp*rest(1), 'dissipation of the scheme')
    if (allocated(error)) return
    call check(error, state%dissipated_energy, 0.0_wp, 0.0_wp, 'no distance')
  end subroutine test_powers

  !> Free rolling of unlike bodies has a creepage, and exchanged bodies the opposite one.
  subroutine test_unlike(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: load = 4.0_wp/3.0_wp
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: state(2)
    integer :: k

    do k = 1, 2
      call new_sphere(contact, 12, 0.3_wp, merge(0.2_wp, -0.2_wp, k == 1), coulomb_t(0.3_wp), error)
      if (allocated(error)) return
      call roll(contact, state(k), [f, f, f, d], [load, 0.0_wp, 0.0_wp, 0.0_wp], .true., error)
      if (allocated(error)) return
      call check_true(error, state(k)%residual_tangential <= accurate, 'residual')
      if (allocated(error)) return
    end do
    ! 3-D, and with friction, the surface of body 1 is drawn together
    call check_true(error, state(1)%creepage(1) < -0.05_wp, 'sign of -beta')
    if (allocated(error)) return
    call check(error, state(2)%creepage(1), -state(1)%creepage(1), 1.0e-7_wp, 'mirrored')
    if (allocated(error)) return
    call check(error, largest(state(1)%traction + state(2)%traction), 0.0_wp, 1.0e-6_wp, 'opposite tractions')
    if (allocated(error)) return
    ! mu/beta alone decides, but for the pressure that the shear traction moves
    call new_sphere(contact, 12, 0.3_wp, 0.02_wp, coulomb_t(0.03_wp), error)
    if (allocated(error)) return
    call roll(contact, state(2), [f, f, f, d], [load, 0.0_wp, 0.0_wp, 0.0_wp], .true., error)
    if (allocated(error)) return
    call check(error, 10.0_wp*state(2)%creepage(1)/state(1)%creepage(1), 1.0_wp, 0.02_wp, 'as Goodman has it')
  end subroutine test_unlike

  !> A long way at constant creepage leads to the steady state, also of unlike bodies, with the same slip path of the surface.
  subroutine test_to_steady(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: load = 4.0_wp/3.0_wp
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: state, steady
    integer :: k, step

    do k = 1, 2
      call new_sphere(contact, 6, 0.3_wp, merge(0.2_wp, 0.0_wp, k == 1), coulomb_t(0.3_wp), error)
      if (allocated(error)) return
      if (allocated(state%pressure)) deallocate (state%pressure)
      if (allocated(steady%pressure)) deallocate (steady%pressure)
      do step = 1, 90
        call roll(contact, state, [f, f, d, d], [load, 0.15_wp, 0.03_wp, 0.1_wp], .false., error)
        if (allocated(error)) return
      end do
      call roll(contact, steady, [f, f, d, d], [load, 0.15_wp, 0.03_wp, 0.1_wp], .true., error)
      if (allocated(error)) return
      call check(error, state%creepage(1), steady%creepage(1), 1.0e-6_wp, 'creepage')
      if (allocated(error)) return
      call check(error, largest(state%traction - steady%traction), 0.0_wp, 1.0e-5_wp, 'tractions')
      if (allocated(error)) return
      call check(error, state%slip_power, steady%slip_power, 1.0e-6_wp, 'power')
      if (allocated(error)) return
      call check_true(error, steady%dissipated_energy <= 0.0_wp .and. state%dissipated_energy > 0.0_wp, 'energies')
      if (allocated(error)) return
    end do
  end subroutine test_to_steady

  !> A torque with a creepage across the direction of rolling is refused.
  subroutine test_torque(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: state
    type(error_t), allocatable :: raised
    real(wp) :: load

    call new_disc(contact, 6, [0.0_wp, 0.0_wp], 0.0_wp, load, error)
    if (allocated(error)) return
    call roll(contact, state, [f, f, d, f], [load, 0.0_wp, 0.1_wp, 0.0_wp], .true., raised)
    call check_true(error, allocated(raised), 'torque and creepage across')
    if (allocated(error)) return
    call roll(contact, state, [f, d, f, f], [load, -0.1_wp, 0.0_wp, 0.0_wp], .true., error)
  end subroutine test_torque

  !> A disc of unit radius that a load presses with Hertz's pressure, by a gap made for it.
  subroutine new_disc(contact, n, origin, beta, load, error)
    type(frictional_contact_t), intent(out) :: contact
    !> Spacings in the radius; position of the middle node in spacings
    integer, intent(in) :: n
    real(wp), intent(in) :: origin(2)
    !> Coupling, and the normal load of unit pressure in the middle
    real(wp), intent(in) :: beta
    real(wp), intent(out) :: load
    type(error_t), allocatable, intent(out) :: error
    type(fft_flexibility_t) :: flexibility
    type(friction_problem_t) :: problem
    type(elastic_pair_t) :: pair
    type(lattice_t) :: lattice
    real(wp), allocatable :: pressure(:, :, :), closing(:, :, :), square(:, :)
    integer :: m

    m = n + n/5 + 3
    pair = elastic_pair_t((1.0_wp - nu)/pi, beta*(1.0_wp - nu)/pi, nu/pi)
    call new_lattice(lattice, equilateral_basis(1.0_wp/n), [-m, -m], [2*m + 1, 2*m + 1], error, origin=origin/n)
    if (allocated(error)) return
    square = coordinate(lattice, 1)**2 + coordinate(lattice, 2)**2
    allocate (pressure(2*m + 1, 2*m + 1, 1), closing(2*m + 1, 2*m + 1, 1))
    pressure(:, :, 1) = sqrt(max(1.0_wp - square, 0.0_wp))
    load = lattice%cell_area()*sum(pressure)
    call new_fft_flexibility(flexibility, lattice, pair, error)
    if (allocated(error)) return
    call flexibility%apply([normal], pressure, [normal], closing, error)
    if (allocated(error)) return
    call new_friction_problem(problem, lattice, pair, 2.0_wp*maxval(closing) - closing(:, :, 1), square < 1.0_wp - 1.0e-12_wp, &
                              coulomb_t(1.0_wp), .false., error)
    if (allocated(error)) return
    call new_frictional_contact(contact, problem, error, n_threads=1)
  end subroutine new_disc

  !> Roll over a spacing, or to the steady state.
  subroutine roll(contact, state, control, value, steady, error, ahead)
    type(frictional_contact_t), intent(inout) :: contact
    !> The state, none at first
    type(contact_state_t), intent(inout) :: state
    integer, intent(in) :: control(4)
    !> Loads, creepages and spin
    real(wp), intent(in) :: value(4)
    logical, intent(in) :: steady
    type(error_t), allocatable, intent(out) :: error
    !> Direction, by default along x
    integer, intent(in), optional :: ahead(2)
    type(contact_state_t) :: before
    type(load_target_t) :: target

    target = load_target_t(control, value)
    target%rolling = rolling_t([1, 0], steady)
    if (present(ahead)) target%rolling%ahead = ahead
    if (.not. allocated(state%pressure)) call new_friction_state(state, contact%problem%lattice)
    before = state
    call advance(contact, before, target, step_settings_t(tolerance=accurate), state, error)
    if (allocated(error)) return
    call check_true(error, state%converged, 'converged')
  end subroutine roll

end module test_rolling
