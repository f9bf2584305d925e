!> Load steps that are cut in half, with a method that cannot go far at a time, and with the real one.
module test_load_path
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_lattice, only: lattice_t, new_lattice, equilateral_basis
  use hc_field_space, only: field_space_t
  use hc_elastic_pair, only: elastic_pair_t
  use hc_contact_residuals, only: tangential_residual
  use hc_contact_state, only: contact_state_t, new_friction_state, load_target_t, touches_rim, rim_reached, &
    force_control, displacement_control, normal, along_x, along_y, about_z
  use hc_coulomb, only: coulomb_t
  use hc_contact_problem, only: friction_problem_t, new_friction_problem
  use hc_contact_solver, only: friction_solver_t
  use hc_frictional_contact, only: frictional_contact_t
  use hc_subwindow_solver, only: windowed_friction_t, new_windowed_friction
  use hc_contact_entry, only: entry_displacement
  use hc_load_path, only: advance, step_settings_t
  use hc_adaptive_path, only: adaptive_path_t
  use hc_step_control, only: accepted, failed, outgrown
  use test_friction, only: new_sphere
  use testing, only: test_t, new_test, check, check_true, largest, coordinate
  implicit none
  private

  public :: collect_load_path

  !> One node in contact, that slips by -Q meters; converges only close to the start.
  type, extends(friction_solver_t) :: short_sighted_t
    !> How far load or motion may be from the start's
    real(wp) :: reach = huge(1.0_wp)
    !> The relative displacement has to be counted from somewhere near, too
    logical :: only_near = .false.
    !> Pressed harder than this, the rim is in contact
    real(wp) :: rim_load = huge(1.0_wp)
    !> Targets so far, and whether the relative displacement was counted from zero
    integer :: calls = 0
    real(wp) :: value(4, 50) = 0.0_wp
    logical :: from_zero(50) = .false.
  contains
    procedure :: solve_step
    procedure :: displacements
  end type short_sighted_t

  !> The real method, with the targets that it has reached.
  type, extends(frictional_contact_t) :: recorder_t
    integer :: n_done = 0
    real(wp) :: done(4, 64) = 0.0_wp
  contains
    procedure :: solve_step => record_step
  end type recorder_t

  !> The real method, that does not converge unless it is asked for an accuracy.
  type, extends(frictional_contact_t) :: demanding_t
    real(wp) :: loosest = 0.0_wp
    !> Whatever it finds counts as converged
    logical :: content = .false.
    !> Steps that it was asked for, and those that did not converge
    integer :: calls = 0, failures = 0
    !> Sweeps of all of them
    integer :: sweeps = 0
  contains
    procedure :: solve_step => accurate_step
  end type demanding_t

  integer, parameter :: f = force_control, d = displacement_control

contains

  subroutine collect_load_path(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('whole', test_whole), &
      new_test('halved', test_halved), &
      new_test('halved_at_first', test_halved_at_first), &
      new_test('bounded', test_bounded), &
      new_test('static', test_static), &
      new_test('sliding', test_sliding), &
      new_test('motions', test_motions), &
      new_test('rim', test_rim), &
      new_test('half_steps', test_half_steps), &
      new_test('adaptive_reach', test_adaptive_reach), &
      new_test('adaptive_rim', test_adaptive_rim), &
      new_test('any_start', test_any_start), &
      new_test('part_of_window', test_part_of_window), &
      new_test('entry_ring', test_entry_ring), &
      new_test('entry_patch', test_entry_patch), &
      new_test('entry_rim', test_entry_rim), &
      new_test('entry_oblique', test_entry_oblique), &
      new_test('entry_accurate', test_entry_accurate), &
      new_test('entry_endless', test_entry_endless), &
      new_test('few_nodes', test_few_nodes) &
    ]
  end subroutine collect_load_path

  subroutine solve_step(self, start, reference, target, tolerance, max_sweeps, state, error)
    class(short_sighted_t), intent(inout), target :: self
    type(contact_state_t), intent(in) :: start
    real(wp), intent(in), contiguous, target :: reference(:, :, :)
    type(load_target_t), intent(in) :: target
    real(wp), intent(in) :: tolerance
    integer, intent(in) :: max_sweeps
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error

    self%calls = self%calls + 1
    self%value(:, self%calls) = target%value(:4)
    self%from_zero(self%calls) = all(abs(reference) <= 0.0_wp)
    call new_friction_state(state, self%problem%lattice)
    state%load = merge(target%value, 0.0_wp, target%control == f)
    state%motion = merge(target%value, 0.0_wp, target%control == d)
    state%pressure(2, 2) = target%value(normal)/self%problem%lattice%cell_area()
    if (target%value(normal) > self%rim_load) state%pressure(1, 3) = 1.0_wp
    state%traction(2, 2, 1) = target%value(along_x)/self%problem%lattice%cell_area()
    state%relative_displacement(:, :, 1) = -target%value(along_x)
    state%slip_increment(2, 2, :) = state%relative_displacement(2, 2, :) - reference(2, 2, :)
    state%sweeps = min(3, max_sweeps)
    state%operator_applications = 2.0_wp
    state%residual_normal = maxval(abs(target%value - merge(start%load, start%motion, target%control == f)))
    state%converged = state%residual_normal <= self%reach
    if (self%only_near) state%converged = state%converged .and. maxval(abs(state%slip_increment)) <= self%reach
    state%clipped = touches_rim(state)
    if (tolerance < 0.0_wp) allocate (error)
  end subroutine solve_step

  subroutine displacements(self, pressure, traction, displacement, error)
    class(short_sighted_t), intent(inout) :: self
    real(wp), intent(in) :: pressure(:, :), traction(:, :, :)
    real(wp), intent(out), contiguous :: displacement(:, :, :)
    type(error_t), allocatable, intent(out) :: error

    displacement(:, :, 1) = self%problem%normal_compliance*pressure
    displacement(:, :, 2:) = self%problem%tangential_compliance*traction
    if (size(displacement) == 0) allocate (error)
  end subroutine displacements

  !> The method, and the state before the first load.
  subroutine set_up(solver, state, error)
    type(short_sighted_t), intent(out) :: solver
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    real(wp) :: gap(4, 5)
    logical :: candidate(4, 5)

    call new_lattice(lattice, equilateral_basis(0.3_wp), [0, 0], [4, 5], error)
    if (allocated(error)) return
    gap = 0.0_wp
    candidate = .true.
    call new_friction_problem(solver%problem, lattice, elastic_pair_t(1.0_wp, 0.0_wp, 0.0_wp), gap, candidate, &
                              coulomb_t(0.5_wp), .false., error)
    if (allocated(error)) return
    call new_friction_state(state, lattice)
  end subroutine set_up

  !> A step within reach is made at once; slip path and energy add up over steps there and back.
  subroutine test_whole(error)
    type(error_t), allocatable, intent(out) :: error
    type(short_sighted_t) :: solver
    type(contact_state_t) :: state, next
    real(wp) :: area

    call set_up(solver, state, error)
    if (allocated(error)) return
    call advance(solver, state, load_target_t(value=[8.0_wp, 3.0_wp, 0.0_wp, 0.0_wp]), step_settings_t(), next, error)
    if (allocated(error)) return
    call check(error, [next%accumulated_slip(2, 2), next%dissipated_energy], [3.0_wp, 9.0_wp], 1.0e-14_wp, 'first step')
    if (allocated(error)) return
    state = next
    call advance(solver, state, load_target_t(value=[8.0_wp, -1.0_wp, 0.0_wp, 0.0_wp]), step_settings_t(), next, error)
    if (allocated(error)) return
    ! another 4 m back, at the load -1
    area = solver%problem%lattice%cell_area()
    call check(error, [next%accumulated_slip(2, 2), next%dissipated_energy, area*next%dissipation_density(2, 2)], &
               [7.0_wp, 13.0_wp, 13.0_wp], 1.0e-14_wp, 'second step')
    if (allocated(error)) return
    call check(error, next%slip_increment(2, 2, 1), 4.0_wp, 1.0e-15_wp, 'slip of the step')
    if (allocated(error)) return
    call check(error, solver%calls, 2, 'solutions')
    if (allocated(error)) return
    call check(error, next%cuts, 0, 'cuts')
    if (allocated(error)) return
    call check_true(error, solver%from_zero(1) .and. .not. solver%from_zero(2), 'each step starts from the last')
  end subroutine test_whole

  !> Halved until it converges; slip, path, energy and work are those of all parts.
  subroutine test_halved(error)
    type(error_t), allocatable, intent(out) :: error
    type(short_sighted_t) :: solver
    type(contact_state_t) :: state, next
    real(wp) :: area

    call set_up(solver, state, error)
    if (allocated(error)) return
    ! contact, without any load
    state%pressure(2, 2) = tiny(1.0_wp)
    solver%reach = 2.5_wp
    call advance(solver, state, load_target_t(value=[8.0_wp, 4.0_wp, 0.0_wp, 0.0_wp]), step_settings_t(), next, error)
    if (allocated(error)) return
    call check_true(error, next%converged, 'converged')
    if (allocated(error)) return
    call check(error, solver%calls, 6, 'solutions')
    if (allocated(error)) return
    call check(error, solver%value(1, :6), [8.0_wp, 4.0_wp, 2.0_wp, 4.0_wp, 6.0_wp, 8.0_wp], 0.0_wp, 'normal loads')
    if (allocated(error)) return
    call check(error, solver%value(2, :6), [4.0_wp, 2.0_wp, 1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp], 0.0_wp, 'tangential loads')
    if (allocated(error)) return
    call check_true(error, all(solver%from_zero(:3)) .and. .not. any(solver%from_zero(4:6)), 'each part starts from the last')
    if (allocated(error)) return
    call check(error, next%cuts, 2, 'cuts')
    if (allocated(error)) return
    call check(error, next%sweeps, 18, 'sweeps of all attempts')
    if (allocated(error)) return
    call check(error, next%operator_applications, 12.0_wp, 0.0_wp, 'work of all attempts')
    if (allocated(error)) return
    call check(error, [next%slip_increment(2, 2, 1), sum(next%slip_increment)], [-4.0_wp, -4.0_wp], 1.0e-15_wp, &
               'slip of the whole step, in contact only')
    if (allocated(error)) return
    ! loads 1, 2, 3, 4 over 1 m each
    area = solver%problem%lattice%cell_area()
    call check(error, [next%accumulated_slip(2, 2), next%dissipated_energy, area*next%dissipation_density(2, 2)], &
               [4.0_wp, 10.0_wp, 10.0_wp], 1.0e-14_wp, 'path and energy')
  end subroutine test_halved

  !> A step that begins without contact is solved as one, its parts are starts; if that fails they are a path.
  subroutine test_halved_at_first(error)
    type(error_t), allocatable, intent(out) :: error
    type(short_sighted_t) :: solver
    type(contact_state_t) :: state, next

    call set_up(solver, state, error)
    if (allocated(error)) return
    state%relative_displacement(:, :, 1) = 1.0_wp
    state%accumulated_slip = 0.5_wp
    state%dissipated_energy = 2.0_wp
    solver%reach = 2.5_wp
    call advance(solver, state, load_target_t(value=[8.0_wp, 4.0_wp, 0.0_wp, 0.0_wp]), step_settings_t(), next, error)
    if (allocated(error)) return
    call check(error, solver%value(2, :solver%calls), [4.0_wp, 2.0_wp, 1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp], 0.0_wp, 'starts')
    if (allocated(error)) return
    ! from 1 m to -4 m under the last load, and not a part of it under each of them
    call check(error, [next%slip_increment(2, 2, 1), next%accumulated_slip(2, 2), next%dissipated_energy], &
               [-5.0_wp, 5.5_wp, 22.0_wp], 1.0e-14_wp, 'slip, path and energy of one step')
    if (allocated(error)) return
    call check(error, next%cuts, 2, 'cuts')
    if (allocated(error)) return
    solver%calls = 0
    solver%only_near = .true.
    call advance(solver, state, load_target_t(value=[8.0_wp, 4.0_wp, 0.0_wp, 0.0_wp]), step_settings_t(1.0e-8_wp, 40, 3), next, &
                 error)
    if (allocated(error)) return
    call check_true(error, next%converged .and. next%cuts == 2, 'a path')
    if (allocated(error)) return
    call check(error, [next%slip_increment(2, 2, 1), next%accumulated_slip(2, 2), next%dissipated_energy], &
               [-5.0_wp, 5.5_wp, 13.0_wp], 1.0e-14_wp, 'slip, path and energy of the parts')
  end subroutine test_halved_at_first

  !> As many cuts as are allowed, then a state that says so; the state handed in is as it was.
  subroutine test_bounded(error)
    type(error_t), allocatable, intent(out) :: error
    type(short_sighted_t) :: solver
    type(contact_state_t) :: state, next

    call set_up(solver, state, error)
    if (allocated(error)) return
    call advance(solver, state, load_target_t(value=[1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]), step_settings_t(), next, error)
    if (allocated(error)) return
    state = next
    solver%calls = 0
    solver%reach = 0.1_wp
    call advance(solver, state, load_target_t(value=[9.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]), step_settings_t(1.0e-8_wp, 40, 3), next, &
                 error)
    if (allocated(error)) return
    call check_true(error, .not. next%converged, 'not converged')
    if (allocated(error)) return
    call check(error, next%residual_normal, 1.0_wp, 1.0e-14_wp, 'residual of the last attempt')
    if (allocated(error)) return
    call check(error, solver%value(1, :solver%calls), [9.0_wp, 5.0_wp, 3.0_wp, 2.0_wp], 0.0_wp, 'normal loads')
    if (allocated(error)) return
    call check(error, next%cuts, 3, 'cuts')
    if (allocated(error)) return
    call check(error, [state%load(normal), state%pressure(2, 2)*solver%problem%lattice%cell_area()], [1.0_wp, 1.0_wp], &
               1.0e-15_wp, 'state before')
    if (allocated(error)) return
    call check_true(error, state%converged, 'state before converged')
  end subroutine test_bounded

  !> A static load counts from the undeformed bodies, also where its parts serve as starts.
  subroutine test_static(error)
    type(error_t), allocatable, intent(out) :: error
    type(short_sighted_t) :: solver
    type(contact_state_t) :: state, next

    call set_up(solver, state, error)
    if (allocated(error)) return
    call advance(solver, state, load_target_t(value=[8.0_wp, 3.0_wp, 0.0_wp, 0.0_wp]), step_settings_t(), next, error)
    if (allocated(error)) return
    state = next
    solver%calls = 0
    solver%reach = 2.0_wp
    call advance(solver, state, load_target_t(value=[8.0_wp, -1.0_wp, 0.0_wp, 0.0_wp]), step_settings_t(static=.true.), next, error)
    if (allocated(error)) return
    call check_true(error, next%converged .and. all(solver%from_zero(:solver%calls)), 'counted from zero')
    if (allocated(error)) return
    call check(error, solver%value(2, :solver%calls), [-1.0_wp, 1.0_wp, -1.0_wp], 0.0_wp, 'parts')
    if (allocated(error)) return
    call check(error, [next%slip_increment(2, 2, 1), next%accumulated_slip(2, 2), next%dissipated_energy], &
               [1.0_wp, 1.0_wp, 1.0_wp], 1.0e-14_wp, 'slip, path and energy')
  end subroutine test_static

  !> Adaptive load steps are made smaller until they converge, and grow again; the smallest ends the path.
  subroutine test_adaptive_reach(error)
    type(error_t), allocatable, intent(out) :: error
    type(short_sighted_t) :: solver
    type(contact_state_t) :: state
    type(adaptive_path_t) :: path
    real(wp) :: ends(5)
    integer :: step

    call set_up(solver, state, error)
    if (allocated(error)) return
    solver%reach = 3.0_wp
    call path%initialize(state, 1.0_wp)
    do step = 1, size(ends)
      call path%advance(solver, load_target_t(value=[8.0_wp]), step_settings_t(max_cuts=0), error)
      if (allocated(error)) return
      ends(step) = path%fraction
    end do
    ! all at once fails, and so does what is left as one step; a quarter of either converges, and so do steps of its size
    call check(error, ends, [0.25_wp, 0.5_wp, 0.625_wp, 0.75_wp, 1.0_wp], 1.0e-14_wp, 'ends of the steps')
    if (allocated(error)) return
    call check(error, [path%state%load(normal), path%state%operator_applications], [8.0_wp, 2.0_wp], 1.0e-14_wp, 'last step')
    if (allocated(error)) return
    solver%reach = 1.0e-3_wp
    call path%advance(solver, load_target_t(value=[16.0_wp]), step_settings_t(max_cuts=0), error)
    if (allocated(error)) return
    call check_true(error, .not. path%state%converged .and. path%verdict == failed, 'no convergence')
    if (allocated(error)) return
    call check(error, [path%reached, path%fraction], [1.0e-3_wp, 0.0_wp], 1.0e-14_wp, 'the smallest step')
  end subroutine test_adaptive_reach

  !> An attempt that reaches the rim of a window that grows is made again, with the work of both.
  subroutine test_adaptive_rim(error)
    type(error_t), allocatable, intent(out) :: error
    type(short_sighted_t) :: solver
    type(contact_state_t) :: state
    type(adaptive_path_t) :: path

    call set_up(solver, state, error)
    if (allocated(error)) return
    solver%reach = 5.0_wp
    solver%rim_load = 1.5_wp
    call path%initialize(state, 1.0_wp)
    path%grows = .true.
    call path%advance(solver, load_target_t(value=[8.0_wp]), step_settings_t(max_cuts=0), error)
    if (allocated(error)) return
    call check_true(error, path%verdict == outgrown .and. path%attempt%n_rejected == 1, 'the second attempt reaches the rim')
    if (allocated(error)) return
    call check(error, [path%state%load(normal), path%fraction], [0.0_wp, 0.0_wp], 0.0_wp, 'the path is where it was')
    if (allocated(error)) return
    solver%rim_load = huge(1.0_wp)
    call path%advance(solver, load_target_t(value=[8.0_wp]), step_settings_t(max_cuts=0), error)
    if (allocated(error)) return
    call check_true(error, path%verdict == accepted .and. path%n_rejected == 1, 'the same attempt again')
    if (allocated(error)) return
    call check(error, [path%state%load(normal), path%fraction], [2.0_wp, 0.25_wp], 1.0e-14_wp, 'the step')
    if (allocated(error)) return
    call check(error, path%state%sweeps, 9, 'sweeps of three solutions')
  end subroutine test_adaptive_rim

  !> Motions are interpolated from the motions of the state, loads from its loads.
  subroutine test_motions(error)
    type(error_t), allocatable, intent(out) :: error
    type(short_sighted_t) :: solver
    type(contact_state_t) :: state, next

    call set_up(solver, state, error)
    if (allocated(error)) return
    state%load(:4) = [2.0_wp, 7.0_wp, 0.0_wp, -3.0_wp]
    state%motion(:4) = [5.0_wp, 0.0_wp, 1.0_wp, 2.0_wp]
    solver%reach = 2.0_wp
    call advance(solver, state, load_target_t([f, d, f, d], [4.0_wp, 4.0_wp, -2.0_wp, 3.0_wp]), step_settings_t(), next, error)
    if (allocated(error)) return
    call check(error, solver%value(:, 2), [3.0_wp, 2.0_wp, -1.0_wp, 2.5_wp], 0.0_wp, 'half of the way')
    if (allocated(error)) return
    call check(error, next%motion([along_x, about_z]), [4.0_wp, 3.0_wp], 0.0_wp, 'motions reached')
    if (allocated(error)) return
    call check(error, next%load([normal, along_y]), [4.0_wp, -2.0_wp], 0.0_wp, 'loads reached')
  end subroutine test_motions

  !> Contact at the rim of the window ends the advance, wherever it is.
  subroutine test_rim(error)
    type(error_t), allocatable, intent(out) :: error
    type(short_sighted_t) :: solver
    type(contact_state_t) :: state, next

    call set_up(solver, state, error)
    if (allocated(error)) return
    solver%reach = 2.5_wp
    solver%rim_load = 3.0_wp
    call advance(solver, state, load_target_t(value=[8.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]), step_settings_t(), next, error)
    if (allocated(error)) return
    call check_true(error, touches_rim(next) .and. .not. touches_rim(state), 'contact at the rim')
    if (allocated(error)) return
    call check(error, next%load(normal), 4.0_wp, 0.0_wp, 'the first part that reaches the rim is the last')
    if (allocated(error)) return
    call check_true(error, next%clipped .and. .not. next%converged .and. next%stopped == rim_reached, 'a part is no solution')
    if (allocated(error)) return
    call check(error, next%residual_force, 0.5_wp, 1.0e-15_wp, 'half of the load of the step is missing')
    if (allocated(error)) return
    ! an attempt that failed may have pressure anywhere
    solver%reach = 0.5_wp
    call advance(solver, state, load_target_t(value=[8.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]), step_settings_t(1.0e-8_wp, 40, 0), next, &
                 error)
    if (allocated(error)) return
    call check_true(error, touches_rim(next) .and. .not. (next%clipped .or. next%converged), 'not clipped, but not converged')
  end subroutine test_rim

  !> Too few sweeps for a whole step, but enough for its parts: the solution is that of explicit parts.
  subroutine test_half_steps(error)
    type(error_t), allocatable, intent(out) :: error
    type(recorder_t) :: contact
    type(contact_state_t) :: virgin, pressed, cut, parts, next
    real(wp), parameter :: load = 4.0_wp/3.0_wp, mu = 0.4_wp, tolerance = 1.0e-10_wp
    type(load_target_t) :: target
    integer :: sweeps, i

    call new_sphere(contact%frictional_contact_t, 10, 0.4_wp, -0.07_wp, coulomb_t(mu), error)
    if (allocated(error)) return
    call new_friction_state(virgin, contact%problem%lattice)
    call advance(contact, virgin, load_target_t(value=[load, 0.0_wp, 0.0_wp, 0.0_wp]), step_settings_t(tolerance, 60, 0), pressed, &
                 error)
    if (allocated(error)) return
    target = load_target_t([f, f, f, d], [1.3_wp*load, 0.6_wp*mu*load, 0.5_wp*mu*load, 0.0_wp])
    do sweeps = 2, 59
      contact%n_done = 0
      call advance(contact, pressed, target, step_settings_t(tolerance, sweeps, 6), cut, error)
      if (allocated(error)) return
      if (cut%converged) exit
    end do
    call check_true(error, cut%converged .and. cut%cuts > 0, 'a number of sweeps with which cuts are needed, and suffice')
    if (allocated(error)) return
    parts = pressed
    associate (done => contact%done(:, :contact%n_done))
      call check_true(error, size(done, 2) > 1, 'several parts')
      if (allocated(error)) return
      do i = 1, size(done, 2)
        target%value(:4) = done(:, i)
        call advance(contact, parts, target, step_settings_t(tolerance, 60, 0), next, error)
        if (allocated(error)) return
        call check_true(error, next%converged, 'an explicit part')
        if (allocated(error)) return
        parts = next
      end do
    end associate
    call check(error, cut%load(:along_y), [1.3_wp*load, 0.6_wp*mu*load, 0.5_wp*mu*load], 1.0e-9_wp, 'the target is reached')
    if (allocated(error)) return
    call check(error, reshape(cut%traction, [882]), reshape(parts%traction, [882]), 1.0e-8_wp*mu, 'traction')
    if (allocated(error)) return
    call check(error, reshape(cut%slip_increment, [882]), &
               reshape((parts%relative_displacement - pressed%relative_displacement) &
                       *spread(merge(1.0_wp, 0.0_wp, parts%pressure > 0.0_wp), 3, 2), [882]), 1.0e-8_wp, 'slip of the step')
    if (allocated(error)) return
    call check(error, reshape(cut%accumulated_slip, [441]), reshape(parts%accumulated_slip, [441]), 1.0e-8_wp, 'slip path')
    if (allocated(error)) return
    call check(error, cut%dissipated_energy, parts%dissipated_energy, 1.0e-8_wp*abs(parts%dissipated_energy), 'energy')
    if (allocated(error)) return
    ! each part fulfils the conditions; the record does not, as one step, and its residual says so
    associate (problem => contact%problem)
      call check(error, cut%residual_tangential, &
                 tangential_residual(cut%traction, cut%slip_increment, cut%pressure, problem%friction, &
                                     problem%tangential_compliance, field_space_t()), 0.0_wp, 'residual of what is recorded')
    end associate
    if (allocated(error)) return
    call check_true(error, cut%converged .and. cut%residual_tangential > 1.0e-3_wp, 'a residual that is not hidden')
    if (allocated(error)) return
    ! and it is another solution than that of the whole step
    call advance(contact, pressed, target, step_settings_t(tolerance, 60, 0), next, error)
    if (allocated(error)) return
    call check_true(error, largest(next%traction - parts%traction) > 1.0e-4_wp*mu, 'the size of a step matters')
  end subroutine test_half_steps

  !> The real method, noting what it has reached.
  subroutine record_step(self, start, reference, target, tolerance, max_sweeps, state, error)
    class(recorder_t), intent(inout), target :: self
    type(contact_state_t), intent(in) :: start
    real(wp), intent(in), contiguous, target :: reference(:, :, :)
    type(load_target_t), intent(in) :: target
    real(wp), intent(in) :: tolerance
    integer, intent(in) :: max_sweeps
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error

    call self%frictional_contact_t%solve_step(start, reference, target, tolerance, max_sweeps, state, error)
    if (allocated(error) .or. .not. state%converged) return
    self%n_done = self%n_done + 1
    self%done(:, modulo(self%n_done - 1, size(self%done, 2)) + 1) = target%value(:4)
  end subroutine record_step

  !> A static step ends at the same state from any start; an incremental one does not.
  subroutine test_any_start(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: virgin, other, state(2), next
    real(wp), parameter :: load = 4.0_wp/3.0_wp, mu = 0.4_wp
    type(load_target_t) :: target

    call new_sphere(contact, 10, 0.4_wp, -0.25_wp, coulomb_t(mu), error)
    if (allocated(error)) return
    call new_friction_state(virgin, contact%problem%lattice)
    call advance(contact, virgin, load_target_t(value=[1.3_wp*load, -0.7_wp*mu*load, 0.0_wp, 0.0_wp]), &
                 step_settings_t(1.0e-10_wp, 60, 6), other, error)
    if (allocated(error)) return
    target = load_target_t(value=[load, 0.3_wp*mu*load, 0.5_wp*mu*load, 0.0_wp])
    call advance(contact, virgin, target, step_settings_t(1.0e-10_wp, 60, 6, static=.true.), state(1), error)
    if (allocated(error)) return
    call advance(contact, other, target, step_settings_t(1.0e-10_wp, 60, 6, static=.true.), state(2), error)
    if (allocated(error)) return
    call advance(contact, other, target, step_settings_t(1.0e-10_wp, 60, 6), next, error)
    if (allocated(error)) return
    call check_true(error, state(1)%converged .and. state(2)%converged .and. next%converged, 'converged')
    if (allocated(error)) return
    call check(error, reshape(state(2)%traction, [882]), reshape(state(1)%traction, [882]), 1.0e-8_wp*mu, 'same traction')
    if (allocated(error)) return
    call check(error, state(2)%motion, state(1)%motion, 1.0e-8_wp, 'same motions')
    if (allocated(error)) return
    call check(error, reshape(state(2)%slip_increment, [882]), reshape(state(1)%slip_increment, [882]), 1.0e-8_wp, &
               'same slip')
    if (allocated(error)) return
    call check_true(error, largest(next%traction - state(1)%traction) > 0.05_wp*mu, 'another history, another traction')
  end subroutine test_any_start

  !> A circular contact grows by 4 and by 12 spacings: near its edge s - s_e is linear in the distance d if the
  !> edge slips, and goes with d^(3/2) if it sticks. Found to 2 and 0.13 % of the motion outside.
  subroutine test_entry_ring(error)
    type(error_t), allocatable, intent(out) :: error
    type(recorder_t) :: solver
    type(contact_state_t) :: before, after
    real(wp), allocatable :: r(:, :), u(:, :, :), expected(:, :, :)
    real(wp), parameter :: old = 0.4_wp, power(2) = [1.0_wp, 1.5_wp], allowed(2) = [0.0201_wp, 0.00133_wp]
    real(wp) :: new, scale
    integer :: i, k

    call new_sphere(solver%frictional_contact_t, 40, 0.0_wp, 0.0_wp, coulomb_t(0.3_wp), error)
    if (allocated(error)) return
    associate (x => coordinate(solver%problem%lattice, 1), y => coordinate(solver%problem%lattice, 2))
      r = sqrt(x**2 + y**2)
      do i = 1, 2
        do k = 1, 2
          new = old + merge(4, 12, i == 1)*1.3_wp/40
          call edge_state(old, before)
          call edge_state(new, after)
          u = entry_displacement(solver%problem, before, after)
          allocate (expected, mold=u)
          expected = 0.0_wp
          where (r > old .and. r < new)
            expected(:, :, 1) = (r - old)**power(k)*x/r
            expected(:, :, 2) = (r - old)**power(k)*y/r
          end where
          scale = (new - old)**power(k)
          call check_true(error, count(abs(u(:, :, 1)) > 0.0_wp) > 100, 'many nodes enter')
          if (allocated(error)) return
          call check(error, sqrt(sum((u - expected)**2)/count(r > old .and. r < new))/scale, 0.0_wp, allowed(k), 'mean error')
          if (allocated(error)) return
          call check_true(error, all(abs(u) <= 0.0_wp .or. spread(r > old .and. r < new, 3, 2)), 'zero elsewhere')
          if (allocated(error)) return
          deallocate (expected)
        end do
      end do
    end associate

  contains

    !> Pressure and gap at the edge of a contact, and the displacement outside.
    subroutine edge_state(radius, state)
      real(wp), intent(in) :: radius
      type(contact_state_t), intent(out) :: state
      real(wp) :: far(size(r, 1), size(r, 2))

      call new_friction_state(state, solver%problem%lattice)
      far = max(r - radius, 0.0_wp)
      ! so little pressure that the lattice does not matter
      state%pressure = 1.0e-6_wp*sqrt(max(radius - r, 0.0_wp))
      state%gap = far**1.5_wp
      where (r > 0.0_wp)
        state%relative_displacement(:, :, 1) = -far**power(k)*coordinate(solver%problem%lattice, 1)/r
        state%relative_displacement(:, :, 2) = -far**power(k)*coordinate(solver%problem%lattice, 2)/r
      end where
    end subroutine edge_state

  end subroutine test_entry_ring

  !> A new patch, closing at one rate while the bodies shift: each node enters after gap/closing of the shift.
  subroutine test_entry_patch(error)
    type(error_t), allocatable, intent(out) :: error
    type(recorder_t) :: solver
    type(contact_state_t) :: before, after
    real(wp), allocatable :: u(:, :, :), gap(:, :)
    real(wp), parameter :: closing = 0.3_wp, shift(2) = [2.0_wp, -1.0_wp]
    integer :: i

    call new_sphere(solver%frictional_contact_t, 20, 0.0_wp, 0.0_wp, coulomb_t(0.3_wp), error)
    if (allocated(error)) return
    call new_friction_state(before, solver%problem%lattice)
    ! not touching yet by 0.1
    before%motion(normal) = -0.1_wp
    gap = solver%problem%initial_gap + 0.1_wp
    call new_friction_state(after, solver%problem%lattice)
    after%gap = max(gap - closing, 0.0_wp)
    after%pressure = max(closing - gap, 0.0_wp)
    do i = 1, 2
      after%relative_displacement(:, :, i) = shift(i)
    end do
    u = entry_displacement(solver%problem, before, after)
    call check_true(error, count(after%pressure > 0.0_wp) > 100, 'many nodes enter')
    if (allocated(error)) return
    do i = 1, 2
      call check(error, largest(u(:, :, i) - merge(shift(i)*gap/closing, 0.0_wp, after%pressure > 0.0_wp)), 0.0_wp, &
                 1.0e-12_wp, 'share of the shift')
      if (allocated(error)) return
    end do
    ! nothing enters: nothing is displaced
    u = entry_displacement(solver%problem, after, after)
    call check(error, largest(u), 0.0_wp, 0.0_wp, 'nothing enters')
  end subroutine test_entry_patch

  !> Oblique load that makes nothing slip, shift 3SQ/16a (exact for nu = 0): after three steps within the mesh error,
  !> while slip from the beginning of the step leaves 15 %.
  subroutine test_entry_oblique(error)
    type(error_t), allocatable, intent(out) :: error
    type(recorder_t) :: solver
    type(contact_state_t) :: state, next
    real(wp), parameter :: load = 4.0_wp/3.0_wp, ratio = 0.1_wp, exact = 3.0_wp*4.0_wp*ratio*load/16.0_wp
    real(wp) :: missing(2)
    integer :: i, step

    call new_sphere(solver%frictional_contact_t, 16, 0.0_wp, 0.0_wp, coulomb_t(0.3_wp), error)
    if (allocated(error)) return
    do i = 1, 2
      call new_friction_state(state, solver%problem%lattice)
      do step = 1, 3
        call advance(solver, state, load_target_t(value=(step/3.0_wp)**3*load*[1.0_wp, ratio, 0.0_wp, 0.0_wp]), &
                     step_settings_t(interpolated=i == 2), next, error)
        if (allocated(error)) return
        call check_true(error, next%converged, 'converged')
        if (allocated(error)) return
        state = next
      end do
      missing(i) = abs(state%motion(along_x))/exact - 1.0_wp
    end do
    call check_true(error, abs(missing(1)) > 0.1_wp, 'slip from the beginning of the step')
    if (allocated(error)) return
    call check(error, missing(2), 0.0_wp, 4.7e-4_wp, 'slip from the entry')
    if (allocated(error)) return
    call check_true(error, state%dissipated_energy <= 1.0e-12_wp .and. all(state%zone /= 2), 'nothing slips')
  end subroutine test_entry_oblique

  !> A contact that grows from a small part of the window to most of it, and is sheared: as on the whole window all along,
  !> with less work while it is small.
  subroutine test_part_of_window(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: tolerance = 1.0e-9_wp, load(5) = [0.01_wp, 0.03_wp, 0.1_wp, 0.9_wp, 0.9_wp], &
                           shear(5) = [0.0_wp, 0.0_wp, 0.004_wp, 0.01_wp, 0.05_wp]
    type(frictional_contact_t) :: whole
    type(windowed_friction_t) :: windowed
    type(contact_state_t) :: state, expected, next
    real(wp) :: scale
    integer :: i

    call new_sphere(whole, 35, 0.3_wp, -0.15_wp, coulomb_t(0.2_wp), error)
    if (allocated(error)) return
    call new_windowed_friction(windowed, whole%problem, error)
    if (allocated(error)) return
    call new_friction_state(state, whole%problem%lattice)
    expected = state
    do i = 1, size(load)
      call whole%solve_step(expected, expected%relative_displacement, &
                            load_target_t([f, f, f, d], [load(i), shear(i), 0.0_wp, 0.0_wp]), tolerance, 60, next, error)
      if (allocated(error)) return
      expected = next
      call windowed%solve_step(state, state%relative_displacement, &
                               load_target_t([f, f, f, d], [load(i), shear(i), 0.0_wp, 0.0_wp]), tolerance, 60, next, error)
      if (allocated(error)) return
      state = next
      call check_true(error, state%converged .and. expected%converged, 'both converge')
      if (allocated(error)) return
      scale = maxval(expected%pressure)
      call check(error, largest(state%pressure - expected%pressure), 0.0_wp, 1.0e-7_wp*scale, 'pressure')
      if (allocated(error)) return
      call check(error, largest(state%traction - expected%traction), 0.0_wp, 1.0e-7_wp*scale, 'shear traction')
      if (allocated(error)) return
      call check(error, largest(state%relative_displacement - expected%relative_displacement), 0.0_wp, &
                 1.0e-7_wp*expected%motion(normal), 'relative displacement, outside the part too')
      if (allocated(error)) return
      if (i == 2) call check_true(error, 3.0_wp*state%operator_applications < expected%operator_applications, 'less work')
      if (allocated(error)) return
    end do
  end subroutine test_part_of_window

  !> The real method, not converged if asked for less than it demands.
  subroutine accurate_step(self, start, reference, target, tolerance, max_sweeps, state, error)
    class(demanding_t), intent(inout), target :: self
    type(contact_state_t), intent(in) :: start
    real(wp), intent(in), contiguous, target :: reference(:, :, :)
    type(load_target_t), intent(in) :: target
    real(wp), intent(in) :: tolerance
    integer, intent(in) :: max_sweeps
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error

    self%calls = self%calls + 1
    call self%frictional_contact_t%solve_step(start, reference, target, tolerance, max_sweeps, state, error)
    if (allocated(error)) return
    self%sweeps = self%sweeps + state%sweeps
    state%converged = self%content .or. (state%converged .and. tolerance <= self%loosest)
    if (.not. state%converged) self%failures = self%failures + 1
  end subroutine accurate_step

  !> Entry states begin with inaccurate solutions. If one of them fails, the step is solved accurately before it is
  !> halved, once; if that fails, too, it is halved as often as it may be.
  subroutine test_entry_accurate(error)
    type(error_t), allocatable, intent(out) :: error
    type(demanding_t) :: solver
    type(frictional_contact_t) :: plain
    type(contact_state_t) :: virgin, pressed, expected, next
    type(load_target_t) :: target
    real(wp), parameter :: load = 4.0_wp/3.0_wp, mu = 0.3_wp, tolerance = 1.0e-8_wp
    integer :: k

    call new_sphere(plain, 10, 0.3_wp, 0.1_wp, coulomb_t(mu), error)
    if (allocated(error)) return
    call new_sphere(solver%frictional_contact_t, 10, 0.3_wp, 0.1_wp, coulomb_t(mu), error)
    if (allocated(error)) return
    call new_friction_state(virgin, plain%problem%lattice)
    call advance(plain, virgin, load_target_t(value=[0.4_wp*load, 0.0_wp, 0.0_wp, 0.0_wp]), step_settings_t(tolerance, 60, 0), &
                 pressed, error)
    if (allocated(error)) return
    ! under load and under approach: both say whether nodes will enter
    do k = 1, 2
      target = load_target_t(value=[load, 0.1_wp*mu*load, 0.0_wp, 0.0_wp])
      if (k == 2) then
        target%control(normal) = d
        target%value(normal) = expected%motion(normal)
      end if
      call advance(plain, pressed, target, step_settings_t(tolerance, 60, 0, interpolated=.true.), expected, error)
      if (allocated(error)) return
      solver%loosest = tolerance
      solver%failures = 0
      call advance(solver, pressed, target, step_settings_t(tolerance, 60, 0, interpolated=.true.), next, error)
      if (allocated(error)) return
      call check_true(error, expected%converged .and. next%converged, 'converged')
      if (allocated(error)) return
      call check(error, solver%failures, 1, 'an inaccurate solution is tried once')
      if (allocated(error)) return
      call check(error, maxval(abs(next%traction - expected%traction)), 0.0_wp, 1.0e-6_wp*mu, 'same traction')
      if (allocated(error)) return
    end do

    solver%loosest = 0.0_wp
    solver%calls = 0
    call advance(solver, pressed, target, step_settings_t(tolerance, 60, 2, interpolated=.true.), next, error)
    if (allocated(error)) return
    call check_true(error, .not. next%converged .and. next%cuts == 2, 'halved in vain')
    if (allocated(error)) return
    call check(error, solver%calls, 6, 'each part inaccurately and accurately')
  end subroutine test_entry_accurate

  !> A patch that enters at a corner of the window has the entry states of one inside; where all nodes of the window
  !> enter, none is left that moved outside, and nothing is known of their motion.
  subroutine test_entry_rim(error)
    type(error_t), allocatable, intent(out) :: error
    type(recorder_t) :: solver
    type(contact_state_t) :: before, after
    real(wp), allocatable :: u(:, :, :), gap(:, :)
    real(wp), parameter :: closing = 0.3_wp, shift = 2.0_wp

    call new_sphere(solver%frictional_contact_t, 20, 0.0_wp, 0.0_wp, coulomb_t(0.3_wp), error)
    if (allocated(error)) return
    associate (x => coordinate(solver%problem%lattice, 1), y => coordinate(solver%problem%lattice, 2))
      gap = 0.5_wp*((x - x(1, 1))**2 + (y - y(1, 1))**2)
    end associate
    solver%problem%initial_gap = gap
    call new_friction_state(before, solver%problem%lattice)
    call new_friction_state(after, solver%problem%lattice)
    after%relative_displacement(:, :, 1) = shift
    after%gap = max(gap - closing, 0.0_wp)
    after%pressure = max(closing - gap, 0.0_wp)
    u = entry_displacement(solver%problem, before, after)
    call check_true(error, after%pressure(1, 1) > 0.0_wp .and. count(after%pressure > 0.0_wp) > 50, 'contact at the corner')
    if (allocated(error)) return
    call check(error, maxval(abs(u(:, :, 1) - merge(shift*gap/closing, 0.0_wp, after%pressure > 0.0_wp))), 0.0_wp, &
               1.0e-12_wp, 'share of the shift')
    if (allocated(error)) return
    after%gap = 0.0_wp
    after%pressure = 1.0_wp
    u = entry_displacement(solver%problem, before, after)
    call check(error, maxval(abs(u)), 0.0_wp, 0.0_wp, 'all nodes enter')
  end subroutine test_entry_rim

  !> Entry states that never settle are corrected so many times, and the step has not converged.
  subroutine test_entry_endless(error)
    type(error_t), allocatable, intent(out) :: error
    type(demanding_t) :: solver
    type(contact_state_t) :: virgin, next
    real(wp), parameter :: load = 4.0_wp/3.0_wp, unreachable = 1.0e-30_wp

    call new_sphere(solver%frictional_contact_t, 6, 0.3_wp, 0.1_wp, coulomb_t(0.3_wp), error)
    if (allocated(error)) return
    call new_friction_state(virgin, solver%problem%lattice)
    solver%content = .true.
    call advance(solver, virgin, load_target_t(value=[load, 0.1_wp*load, 0.0_wp, 0.0_wp]), &
                 step_settings_t(unreachable, 3, 0, interpolated=.true.), next, error)
    if (allocated(error)) return
    call check_true(error, .not. next%converged, 'not converged')
    if (allocated(error)) return
    call check(error, solver%calls, 40, 'corrections')
    if (allocated(error)) return
    call check(error, next%sweeps, solver%sweeps, 'sweeps of all of them')
  end subroutine test_entry_endless

  !> A contact of few nodes is solved by LAPACK only if the method fails: sweeps are those of the method alone.
  subroutine test_few_nodes(error)
    type(error_t), allocatable, intent(out) :: error
    type(demanding_t) :: solver
    type(contact_state_t) :: virgin, next
    real(wp), parameter :: load = 4.0_wp/3.0_wp

    call new_sphere(solver%frictional_contact_t, 2, 0.3_wp, 0.1_wp, coulomb_t(0.3_wp), error)
    if (allocated(error)) return
    call new_friction_state(virgin, solver%problem%lattice)
    solver%loosest = 1.0_wp
    call advance(solver, virgin, load_target_t(value=[load, 0.1_wp*load, 0.0_wp, 0.0_wp]), &
                 step_settings_t(1.0e-8_wp, max_sweeps=60, max_cuts=0), next, error)
    if (allocated(error)) return
    call check_true(error, next%converged .and. count(next%pressure > 0.0_wp) <= 16, 'a few nodes')
    if (allocated(error)) return
    call check(error, next%sweeps, solver%sweeps, 'sweeps')
  end subroutine test_few_nodes

  !> A load that full sliding does not carry is given up at once: smaller parts of the step lead nowhere.
  subroutine test_sliding(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(contact_state_t) :: none, pressed, state
    real(wp), parameter :: load = 4.0_wp/3.0_wp, mu = 0.3_wp

    call new_sphere(contact, 10, 0.0_wp, 0.0_wp, coulomb_t(mu), error)
    if (allocated(error)) return
    call new_friction_state(none, contact%problem%lattice)
    call advance(contact, none, load_target_t([f, f, f, d], [load, 0.0_wp, 0.0_wp, 0.0_wp]), step_settings_t(1.0e-9_wp, 60, 4), &
                 pressed, error)
    if (allocated(error)) return
    call advance(contact, pressed, load_target_t([f, f, f, d], [load, 1.2_wp*mu*load, 0.0_wp, 0.0_wp]), &
                 step_settings_t(1.0e-9_wp, 60, 4), state, error)
    if (allocated(error)) return
    call check_true(error, state%sliding .and. .not. state%converged, 'gross sliding')
    if (allocated(error)) return
    call check(error, state%cuts, 0, 'no parts')
  end subroutine test_sliding

end module test_load_path
