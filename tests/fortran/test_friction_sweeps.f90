!> What every step of the algorithm with friction leaves behind, and what full sliding carries.
module test_friction_sweeps
  use hc_precision, only: wp, pi, lk
  use hc_error, only: error_t
  use hc_field_space, only: field_space_t
  use hc_elastic_pair, only: elastic_pair_t
  use hc_contact_state, only: contact_state_t, new_friction_state, load_target_t, load_step_t, force_control, &
    displacement_control, along_x, along_y, slip
  use hc_contact_residuals, only: tangential_compliances
  use hc_contact_problem, only: near_reach
  use hc_coulomb, only: coulomb_t
  use hc_operator_set, only: operators_t, new_operators
  use hc_friction_iterate, only: friction_iterate_t
  use hc_displacement_check, only: check_displacements
  use hc_active_zones, only: classify
  use hc_front_relaxation, only: relax_fronts
  use hc_staggered_newton, only: staggered_sweep
  use hc_coupled_newton, only: coupled_sweep
  use hc_load_constraints, only: overloads
  use hc_frictional_contact, only: frictional_contact_t
  use test_friction, only: new_sphere
  use testing, only: test_t, new_test, check, check_true, coordinate
  implicit none
  private

  public :: collect_friction_sweeps

  integer, parameter :: f = force_control, d = displacement_control
  !> Loads of a contact of radius one
  real(wp), parameter :: load = 4.0_wp/3.0_wp

  !> Load steps of a sphere that fail, or take many more products, without one of the options.
  type :: hard_t
    !> Nodes on each side of the apex; elastic constants; coefficient of friction; height and wave number of waves on the gap
    integer :: n
    real(wp) :: gamma, beta, mu, height, wave
    !> Tolerance, and the most applications of the last step
    real(wp) :: tolerance, most
    !> Normal load, shares of mu P along x and y, and share of the torque mu P of each step
    real(wp) :: share(4, 3)
  end type hard_t

contains

  subroutine collect_friction_sweeps(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('any_order', test_any_order), &
      new_test('near_compliance', test_near_compliance), &
      new_test('residual', test_residual), &
      new_test('start', test_start), &
      new_test('fronts', test_fronts), &
      new_test('fronts_at_the_rim', test_rim), &
      new_test('hard_steps', test_hard_steps), &
      new_test('load_factor', test_load_factor), &
      new_test('load_factor_of_shifts', test_load_factor_of_shifts) &
    ]
  end subroutine collect_friction_sweeps

  !> Displacements are those of the tractions after each sweep, whichever came before.
  subroutine test_any_order(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(operators_t) :: operators
    type(contact_state_t), target :: state
    type(friction_iterate_t) :: now
    real(wp) :: before
    integer :: sweep
    logical :: failed
    character(len=*), parameter :: order = 'sscsccss'

    call new_sphere(contact, 10, 0.0_wp, 0.5_wp, coulomb_t(1.0_wp), error, n_threads=1)
    if (allocated(error)) return
    call new_operators(operators, contact%problem%lattice, contact%problem%medium, field_space_t(), error)
    if (allocated(error)) return
    call new_friction_state(state, contact%problem%lattice)
    call now%set_start(contact%problem, operators, state, &
                       load_step_t(load_target_t([f, f, f, f], [load, 0.2_wp*load, 0.0_wp, 0.0_wp]), &
                                   state%relative_displacement, 1.0e-9_wp), error)
    if (allocated(error)) return
    before = huge(1.0_wp)
    do sweep = 1, len(order)
      if (order(sweep:sweep) == 'c') then
        call coupled_sweep(now, failed, error)
      else
        call staggered_sweep(now, error)
      end if
      if (allocated(error)) return
      call check_displacements(now, error)
      if (allocated(error)) return
      call check_true(error, 0.2_wp*now%residual_normal < before, 'the residual of the pressure stays low')
      if (allocated(error)) return
      before = now%residual_normal
    end do
    ! products that nobody made are found out
    now%w = now%w*(1.0_wp + 1.0e-5_wp)
    call check_displacements(now, error)
    failed = allocated(error)
    if (failed) deallocate (error)
    call check_true(error, failed, 'displacements of other tractions')
  end subroutine test_any_order

  !> What the pyramids of two nodes displace around them is what the operator says, spring of the layer included.
  subroutine test_near_compliance(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(operators_t) :: operators
    type(elastic_pair_t) :: pair
    real(wp) :: near(-near_reach:near_reach, -near_reach:near_reach, 3), expected(2)
    real(wp), dimension(21, 21, 2), target :: q, u
    real(wp), pointer, contiguous :: traction(:), displacement(:)
    integer, parameter :: node(2, 2) = reshape([9, 10, 12, 11], [2, 2])
    integer :: col, row, k

    call new_sphere(contact, 10, 0.4_wp, 0.2_wp, coulomb_t(1.0_wp), error, n_threads=1)
    if (allocated(error)) return
    pair = elastic_pair_t(1.0_wp, 0.4_wp, 0.2_wp)
    pair%tangential_layer = 0.02_wp
    near = tangential_compliances(contact%problem%lattice, pair, near_reach)
    call new_operators(operators, contact%problem%lattice, pair, field_space_t(), error)
    if (allocated(error)) return
    q = 0.0_wp
    q(node(1, 1), node(2, 1), :) = [0.7_wp, -0.3_wp]
    q(node(1, 2), node(2, 2), :) = [0.2_wp, 1.1_wp]
    traction(1:size(q)) => q
    displacement(1:size(u)) => u
    call operators%apply([along_x, along_y], traction, [along_x, along_y], displacement, error)
    if (allocated(error)) return
    do row = 6, 15
      do col = 7, 14
        expected = 0.0_wp
        do k = 1, size(node, 2)
          associate (t => q(node(1, k), node(2, k), :), by => near(col - node(1, k), row - node(2, k), :))
            expected = expected + [by(1)*t(1) + by(2)*t(2), by(2)*t(1) + by(3)*t(2)]
          end associate
        end do
        call check(error, u(col, row, :), expected, 1.0e-12_wp, 'displacement near the nodes')
        if (allocated(error)) return
      end do
    end do
  end subroutine test_near_compliance

  !> The residual after a sweep is that of the displacements that it leaves, those computed anew for their rounding errors, too.
  subroutine test_residual(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t), target :: contact
    type(operators_t), target :: operators
    type(contact_state_t), target :: state
    type(friction_iterate_t) :: now
    real(wp) :: residual
    integer :: sweep

    call new_sphere(contact, 10, 0.0_wp, 0.0_wp, coulomb_t(0.5_wp), error, n_threads=1)
    if (allocated(error)) return
    call new_operators(operators, contact%problem%lattice, contact%problem%medium, field_space_t(), error)
    if (allocated(error)) return
    call new_friction_state(state, contact%problem%lattice)
    call now%set_start(contact%problem, operators, state, &
                       load_step_t(load_target_t([f, f, f, f], [load, 0.2_wp*load, 0.0_wp, 0.0_wp]), &
                                   state%relative_displacement, 1.0e-9_wp), error)
    if (allocated(error)) return
    do sweep = 1, 6
      if (sweep == 4) contact%problem%options%newton%displacement_rounding = 0.0_wp
      call staggered_sweep(now, error)
      if (allocated(error)) return
      residual = now%residual_tangential
      call now%find_tangential_residual()
      call check(error, residual, now%residual_tangential, 0.0_wp, 'residual of the shear traction')
      if (allocated(error)) return
    end do
  end subroutine test_residual

  !> Unlike bodies pressed by an approach begin in contact where they would overlap, with any pressure.
  subroutine test_start(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(operators_t) :: operators
    type(contact_state_t), target :: state
    type(friction_iterate_t) :: now
    real(wp), parameter :: approach = 0.3_wp

    call new_sphere(contact, 10, 0.0_wp, 0.5_wp, coulomb_t(1.0_wp), error, n_threads=1)
    if (allocated(error)) return
    call new_operators(operators, contact%problem%lattice, contact%problem%medium, field_space_t(), error)
    if (allocated(error)) return
    call new_friction_state(state, contact%problem%lattice)
    call now%set_start(contact%problem, operators, state, &
                       load_step_t(load_target_t([d, f, f, f], [approach, 0.0_wp, 0.0_wp, 0.0_wp]), &
                                   state%relative_displacement, 1.0e-9_wp), error)
    if (allocated(error)) return
    associate (overlap => reshape(contact%problem%initial_gap < approach, [size(now%p)]))
      call check_true(error, any(overlap) .and. .not. all(overlap), 'the bodies overlap somewhere')
      if (allocated(error)) return
      call check_true(error, all(now%contact .eqv. overlap), 'contact where they overlap')
      if (allocated(error)) return
      call check_true(error, all((now%p > 0.0_wp) .eqv. overlap) .and. now%without_start, 'pressure there')
    end associate
  end subroutine test_start

  !> Relaxed fronts are nearer to those of the solution; small contacts do without.
  subroutine test_fronts(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t), target :: contact
    type(operators_t), target :: operators
    type(contact_state_t), target :: start
    type(contact_state_t) :: solution
    type(friction_iterate_t), target :: now
    type(load_target_t) :: target
    real(wp), allocatable :: q(:)
    integer :: before, after, k

    call new_sphere(contact, 40, 0.0_wp, 0.0_wp, coulomb_t(0.5_wp), error, n_threads=1)
    if (allocated(error)) return
    call new_friction_state(solution, contact%problem%lattice)
    do k = 1, 2
      start = solution
      target = load_target_t([f, f, f, f], [load, merge(0.0_wp, 0.25_wp*load, k == 1), 0.0_wp, 0.0_wp])
      call contact%solve_step(start, start%relative_displacement, target, 1.0e-8_wp, 60, solution, error)
      if (allocated(error)) return
    end do
    call new_operators(operators, contact%problem%lattice, contact%problem%medium, field_space_t(), error)
    if (allocated(error)) return
    call now%set_start(contact%problem, operators, start, load_step_t(target, start%relative_displacement, 1.0e-8_wp), error)
    if (allocated(error)) return
    call staggered_sweep(now, error)
    if (allocated(error)) return
    before = count_wrong()
    q = now%q
    call relax_fronts(now)
    call check(error, now%q, q, 0.0_wp, 'few nodes in contact')
    if (allocated(error)) return
    contact%problem%options%newton%front_nodes = 0
    call relax_fronts(now)
    after = count_wrong()
    call check_true(error, before > 100 .and. 2*after < before, 'fronts nearer to those of the solution')
  contains

    !> Nodes whose zone is not that of the solution.
    integer function count_wrong()
      type(friction_iterate_t), target :: copy
      logical(lk), allocatable :: active(:)

      copy = now
      call classify(copy, .false., active)
      associate (n => size(copy%p))
        count_wrong = count((active(:n) .and. .not. active(n + 1:)) .neqv. reshape(solution%zone == slip, [n]))
      end associate
    end function count_wrong

  end subroutine test_fronts

  !> Relaxation leaves alone the nodes at the rim of the window, whose neighbors are not all there, and those far from the front.
  subroutine test_rim(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t), target :: contact
    type(operators_t), target :: operators
    type(contact_state_t) :: start, used_up
    type(friction_iterate_t), target :: fresh, now
    real(wp), allocatable :: change(:, :)
    real(wp), allocatable, target :: reference(:, :, :)
    integer, parameter :: beside_rim(2, 4) = reshape([2, 7, 12, 7, 7, 2, 7, 12], [2, 4])
    integer :: at(2), k

    call new_sphere(contact, 6, 0.0_wp, 0.0_wp, coulomb_t(0.5_wp), error, n_threads=1)
    if (allocated(error)) return
    contact%problem%options%newton%front_nodes = 0
    call new_operators(operators, contact%problem%lattice, contact%problem%medium, field_space_t(), error)
    if (allocated(error)) return
    ! contact all over the window of 13 by 13 nodes; one node next to its rim slips, the others stick
    do k = 1, 4
      at = beside_rim(:, k)
      call new_friction_state(start, contact%problem%lattice)
      start%pressure = 1.0_wp
      start%traction(at(1), at(2), 1) = 0.6_wp
      reference = start%relative_displacement
      reference(at(1), at(2), 1) = contact%problem%tangential_compliance
      now = fresh
      used_up = start
      call now%set_start(contact%problem, operators, used_up, &
                       load_step_t(load_target_t([f, d, d, d], [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]), reference, 1.0e-9_wp), error)
      if (allocated(error)) return
      now%first = .false.
      call relax_fronts(now)
      associate (n => size(now%p))
        change = reshape(abs(now%q(:n) - reshape(start%traction(:, :, 1), [n])), shape(start%pressure))
      end associate
      call check_true(error, change(at(1), at(2)) > 0.05_wp, 'the node that slips')
      if (allocated(error)) return
      call check(error, maxval([change(1, :), change(13, :), change(:, 1), change(:, 13)]), 0.0_wp, 0.0_wp, 'rim of the window')
      if (allocated(error)) return
      call check(error, change(14 - at(1), 14 - at(2)), 0.0_wp, 0.0_wp, 'the other side of the window')
      if (allocated(error)) return
    end do
  end subroutine test_rim

  !> Each option is needed by one of the steps; beside it stands the work with and without.
  subroutine test_hard_steps(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: state, next
    real(wp), parameter :: press(4) = [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], none(4) = 0.0_wp, pull(4) = [1.0_wp, 0.5_wp, 0.0_wp, 0.0_wp]
    type(hard_t) :: hard(5)
    integer :: i, k

    ! max_areas_uncoupled: 8.0 in 1 sweep; with 1: 13.3 in 8
    hard(1) = hard_t(10, 0.4_wp, 0.0_wp, 0.3_wp, 0.0_wp, 0.0_wp, 1.0e-5_wp, 10.0_wp, reshape([press, none, none], [4, 3]))
    ! sweeps_per_cut: 17.4 in 4 sweeps, without cuts 50.6 in 13
    hard(2) = hard_t(20, 0.22_wp, 0.0_wp, 0.12_wp, 0.0_wp, 0.0_wp, 1.0e-5_wp, 30.0_wp, &
                     reshape([press, 1.0_wp, 0.5_wp, 0.77_wp, 0.13_wp, 1.0_wp, 0.6_wp, 0.0_wp, 0.0_wp], [4, 3]))
    ! fixed_share: 43.3 in 11 sweeps; with 0.1: 63.0 in 16; fails if one node is fixed
    hard(3) = hard_t(12, 0.17_wp, 0.0_wp, 0.1_wp, 0.0_wp, 0.0_wp, 1.0e-8_wp, 55.0_wp, &
                     reshape([press, 1.0_wp, 0.8_wp, 0.0_wp, 0.15_wp, 0.5_wp, -0.07_wp, 0.0_wp, -0.07_wp], [4, 3]))
    ! staggered_sweeps: 33.0 in 13 sweeps; fails without coupled ones
    hard(4) = hard_t(10, 0.16_wp, -0.02_wp, 1.0_wp, 0.025_wp, 11.0_wp, 1.0e-8_wp, 50.0_wp, reshape([press, none, none], [4, 3]))
    ! soft_spring: 10.4 in 2 sweeps; with 0: 18.3 in 4
    hard(5) = hard_t(42, 0.4_wp, 0.15_wp, 0.4_wp, 0.0_wp, 0.0_wp, 1.0e-8_wp, 14.0_wp, reshape([press, pull, pull], [4, 3]))
    do i = 1, size(hard)
      associate (given => hard(i))
        call new_sphere(contact, given%n, given%gamma, given%beta, coulomb_t(given%mu), error, n_threads=1)
        if (allocated(error)) return
        associate (x => coordinate(contact%problem%lattice, 1), y => coordinate(contact%problem%lattice, 2))
          call contact%set_gap(0.5_wp*(x**2 + y**2) + given%height*(cos(given%wave*x) + cos(given%wave*y)))
        end associate
        call new_friction_state(next, contact%problem%lattice)
        do k = 1, count(given%share(1, :) > 0.0_wp)
          state = next
          ! the twist is free where there is a torque
          call contact%solve_step(state, state%relative_displacement, &
                                  load_target_t([f, f, f, merge(f, d, abs(given%share(4, k)) > 0.0_wp)], &
                                                load*given%share(:, k)*[1.0_wp, given%mu, given%mu, given%mu]), &
                                  given%tolerance, 40, next, error)
          if (allocated(error)) return
          call check_true(error, next%converged, 'converged')
          if (allocated(error)) return
        end do
        call check_true(error, next%operator_applications < given%most, 'few products')
        if (allocated(error)) return
      end associate
    end do
  end subroutine test_hard_steps

  !> Shift and torque on Hertz' pressure: too much by a thousandth, and not quite.
  !>
  !> The motion that the least load drives is a rotation about some point of the axis across the shift; all of them
  !> are tried. Full sliding carries the torque 3 pi/16 mu P a.
  subroutine test_load_factor(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    logical, allocatable :: is_said(:)
    real(wp), allocatable :: pressure(:, :)
    real(wp), parameter :: mu = 0.3_wp, shares(5) = [0.0_wp, 0.1_wp, 0.5_wp, 2.0_wp, 100.0_wp]
    real(wp) :: force, torque, factor, least
    integer :: i, k

    call new_sphere(contact, 20, 0.0_wp, 0.0_wp, coulomb_t(mu), error, n_threads=1)
    if (allocated(error)) return
    associate (x => coordinate(contact%problem%lattice, 1), y => coordinate(contact%problem%lattice, 2), &
               cell => contact%problem%lattice%cell_area())
      pressure = sqrt(max(1.0_wp - x**2 - y**2, 0.0_wp))
      pressure = pressure*load/(cell*sum(pressure))
      do i = 1, size(shares)
        force = shares(i)*mu*load
        torque = mu*load
        least = mu*load/max(force, 1.0e-9_wp)
        do k = 0, 20000
          associate (away => -10.0_wp + 0.001_wp*k)
            factor = mu*cell*sum(pressure*sqrt(x**2 + (y - away)**2))/max(torque + away*force, 1.0e-9_wp)
          end associate
          least = min(least, factor)
        end do
        if (i == 1) call check_true(error, abs(least - 3.0_wp*pi/16.0_wp) < 1.0e-3_wp, 'torque alone')
        if (allocated(error)) return
        call check_true(error, said(0.999_wp*least, 0.0_wp) .eqv. .false., 'not quite too much')
        if (allocated(error)) return
        call check_true(error, said(1.001_wp*least, 0.0_wp), 'too much')
        if (allocated(error)) return
        is_said = [said(1.05_wp*least, 0.04_wp), said(1.05_wp*least, 0.06_wp), said(1.5_wp*least, 0.5_wp)]
        call check_true(error, all(is_said .eqv. [.true., .false., .false.]), 'by more than the error of the pressure')
        if (allocated(error)) return
      end do
    end associate

  contains

    logical function said(share, residual)
      real(wp), intent(in) :: share, residual

      said = overloads(contact%problem, load_target_t([f, f, f, f], [load, share*force, 0.0_wp, share*torque]), pressure, &
                       residual)
    end function said

  end subroutine test_load_factor

  !> Without a torque mu P is all that counts, wherever the pressure is; without friction nothing is carried.
  subroutine test_load_factor_of_shifts(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    logical, allocatable :: is_said(:)
    real(wp), parameter :: mu = 0.3_wp
    integer, parameter :: held(4) = [f, f, f, d], along(4) = [f, f, d, d], none(4) = [f, d, d, d]

    call new_sphere(contact, 10, 0.0_wp, 0.0_wp, coulomb_t(mu), error, n_threads=1)
    if (allocated(error)) return
    associate (problem => contact%problem, pressure => 1.0_wp + coordinate(contact%problem%lattice, 1))
      is_said = [overloads(problem, target(held, 0.61_wp, 0.8_wp), pressure, 1.0_wp), &
                 overloads(problem, target(held, 0.59_wp, 0.8_wp), pressure, 0.0_wp), &
                 overloads(problem, target(along, 0.99_wp, 5.0_wp), pressure, 0.0_wp), &
                 overloads(problem, target(along, 1.01_wp, 0.0_wp), pressure, 1.0_wp), &
                 overloads(problem, target(none, 1.1_wp, 1.1_wp), pressure, 0.0_wp)]
      call check_true(error, all(is_said .eqv. [.true., .false., .false., .true., .false.]), 'mu P')
      if (allocated(error)) return
      problem%friction = coulomb_t(0.0_wp)
      is_said = [overloads(problem, target(held, 1.0e-9_wp, 0.0_wp), pressure, 0.0_wp), &
                 overloads(problem, target(held, 0.0_wp, 0.0_wp), pressure, 0.0_wp)]
      call check_true(error, all(is_said .eqv. [.true., .false.]), 'no friction')
      if (allocated(error)) return
      problem%friction = coulomb_t(no_slip=.true.)
      call check_true(error, .not. overloads(problem, target(held, 100.0_wp, 0.0_wp), pressure, 0.0_wp), 'no slip')
    end associate

  contains

    !> Loads along x and y as shares of mu P.
    type(load_target_t) function target(control, share_x, share_y)
      integer, intent(in) :: control(4)
      real(wp), intent(in) :: share_x, share_y

      target = load_target_t(control, [load, share_x*mu*load, share_y*mu*load, 0.0_wp])
    end function target

  end subroutine test_load_factor_of_shifts

end module test_friction_sweeps
