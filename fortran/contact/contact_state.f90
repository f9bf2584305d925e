!> The state of a contact: tractions, gap, zones, loads and rigid motions over a window.
module hc_contact_state
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp, lk, zk
  use hc_error, only: error_t, status, raise
  use hc_lattice, only: lattice_t
  use hc_rolling, only: rolling_t
  use hc_field_space, only: field_space_t
  use hc_elastic_medium, only: elastic_medium_t
  use hc_flexibility, only: check_operator, normal, along_x, along_y
  implicit none
  private

  public :: contact_state_t, new_contact_state, new_friction_state, add_fields, add_history, copy_tractions, touches_rim
  public :: allocate_fields, field_of
  public :: check_problem, check_target, check_state
  public :: not_finite
  public :: not_solved, within_tolerance, sweeps_used_up, no_progress, loads_not_carried, rim_reached, out_of_range
  public :: separated, stick, slip
  public :: load_step_t, load_target_t, force_control, displacement_control
  public :: normal, along_x, along_y, about_z, strain_xx, strain_yy, strain_xy, n_load, n_motion
  public :: remote_displacement

  !> Zone of a node; without friction every node in contact slips.
  integer(zk), parameter :: separated = 0_zk, stick = 1_zk, slip = 2_zk

  !> The motions of the remote parts: approach, shift along x and along y, and twist about z, each with its load, and the bulk
  !> strain of body 1 relative to body 2, which is always prescribed (docs/theory/conditions.md, bulk strain).
  !> `normal`, `along_x` and `along_y` are those of the tractions.
  integer, parameter :: about_z = 4, n_load = 4, strain_xx = 5, strain_yy = 6, strain_xy = 7, n_motion = 7

  !> Control of a motion: its load is prescribed, or its value.
  integer, parameter :: force_control = 1, displacement_control = 2

  !> Why a solver stopped: nothing was solved yet; all residuals are within the tolerance; all sweeps allowed were
  !> made; linear solutions broke off, and sweeps do not help; no node sticks and a load cannot be carried; a part of
  !> the step reached the rim of the window; numbers are not finite.
  integer, parameter :: not_solved = 0, within_tolerance = 1, sweeps_used_up = 2, no_progress = 3, loads_not_carried = 4, &
                        rim_reached = 5, out_of_range = 6

  character(len=*), parameter :: not_finite = 'pressure or gap are not finite numbers: expected a gap, loads and elastic '// &
                                              'constants whose products are neither zero nor infinite'

  !> Prescribed load or value of each motion.
  type :: load_target_t
    !> force_control or displacement_control
    integer :: control(n_motion) = [force_control, force_control, force_control, displacement_control, displacement_control, &
                                    displacement_control, displacement_control]
    !> Load [N], torque [N m]; or approach, shift [m], twist [rad]; bulk strain
    real(wp) :: value(n_motion) = 0.0_wp
    !> The bodies roll: shifts and twist are those over a spacing
    type(rolling_t) :: rolling
  end type load_target_t

  !> A load step that is to be solved.
  type :: load_step_t
    !> Loads or motions to be reached
    type(load_target_t) :: target
    !> Relative displacement s^n at the beginning of the step (n_col, n_row, 2) [m]
    real(wp), pointer, contiguous :: reference(:, :, :) => null()
    !> Bound of all residuals
    real(wp) :: tolerance = 0.0_wp
    !> Active sets that may be tried
    integer :: max_sweeps = 0
  end type load_step_t

  !> A target by the control and the value of the first motions; the others have their defaults.
  interface load_target_t
    module procedure target_of_values
  end interface load_target_t

  !> A solution and its residuals.
  type :: contact_state_t
    !> Pressure and gap (n_col, n_row) [Pa], [m]
    real(wp), allocatable :: pressure(:, :), gap(:, :)
    !> Zone of each node (n_col, n_row)
    integer(zk), allocatable :: zone(:, :)
    !> With friction: shear traction on body 1 (n_col, n_row, 2) [Pa]
    real(wp), allocatable :: traction(:, :, :)
    !> With friction: relative displacement s = (u1 - u2) + strain r - shift - twist x r (n_col, n_row, 2) [m]
    real(wp), allocatable :: relative_displacement(:, :, :)
    !> With friction: change of s during the step, all its parts, on the nodes in contact (n_col, n_row, 2) [m]
    real(wp), allocatable :: slip_increment(:, :, :)
    !> With friction: length of the slip path so far (n_col, n_row) [m]
    real(wp), allocatable :: accumulated_slip(:, :)
    !> With friction: energy dissipated so far by area (n_col, n_row) [J/m^2]
    real(wp), allocatable :: dissipation_density(:, :)
    !> Normal load, tangential loads on body 1 [N] and torque [N m]: resultants of the tractions; nothing for the bulk strain
    real(wp) :: load(n_motion) = 0.0_wp
    !> Approach, shifts [m] and twist [rad] of the remote parts; bulk strain of body 1 less that of body 2
    real(wp) :: motion(n_motion) = 0.0_wp
    !> Rolling bodies: creepages along x and y, and spin [1/m]; creep forces times creepages, with the sign of a loss, and energy
    !> that friction takes, by distance; error of the first by the lattice, of bodies whose pressure and shear do not couple [J/m]
    real(wp) :: creepage(3) = 0.0_wp, creep_power = 0.0_wp, slip_power = 0.0_wp, creep_power_error = 0.0_wp
    !> Energy dissipated by friction so far, and bound on its error by the size of the load steps, (W4) [J]
    real(wp) :: dissipated_energy = 0.0_wp, path_error = 0.0_wp
    !> Residual of the contact conditions along the normal
    real(wp) :: residual_normal = huge(1.0_wp)
    !> Residual of the friction conditions, with the slip increment that is recorded; of a load step that was halved it may
    !> exceed the tolerance, which each part meets by itself
    real(wp) :: residual_tangential = 0.0_wp
    !> Residual of the normal load; 0 where the approach is prescribed
    real(wp) :: residual_force = huge(1.0_wp)
    !> Residual of the tangential loads, of those that are prescribed
    real(wp) :: residual_shear_force = 0.0_wp
    !> Residual of the torque; 0 where the twist is prescribed
    real(wp) :: residual_torque = 0.0_wp
    !> All residuals are within the tolerance, in each part of the step
    logical :: converged = .false.
    !> Why the solver stopped: within_tolerance, sweeps_used_up, ...
    integer :: stopped = not_solved
    !> There is contact at the rim of the window: a larger window would have another solution, unless nothing can touch there
    logical :: clipped = .false.
    !> The tangential loads are more than full sliding carries
    logical :: sliding = .false.
    !> Active sets that were tried on the finest lattice
    integer :: sweeps = 0
    !> Times that the load step was halved
    integer :: cuts = 0
    !> Work, in applications of the full operator on the finest lattice
    real(wp) :: operator_applications = 0.0_wp
  end type contact_state_t

contains

  !> Set a target by the control and the value of the first motions.
  pure function target_of_values(control, value) result(target)
    !> force_control or displacement_control
    integer, intent(in), optional :: control(:)
    !> Loads [N], [N m] or motions [m], [rad]; bulk strain
    real(wp), intent(in), optional :: value(:)
    type(load_target_t) :: target

    if (present(control)) target%control(:size(control)) = control
    if (present(value)) target%value(:size(value)) = value
  end function target_of_values

  !> Set up a state without contact.
  subroutine new_contact_state(state, lattice, space)
    !> State to be set up
    type(contact_state_t), intent(out) :: state
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Space of the fields
    type(field_space_t), intent(in) :: space

    call add_fields(state, lattice, space, frictionless=.true.)
  end subroutine new_contact_state

  !> Set up a state with friction before the first load: no contact, nothing displaced.
  subroutine new_friction_state(state, lattice, space)
    !> State to be set up
    type(contact_state_t), intent(out) :: state
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Space of the fields; absent: one thread
    type(field_space_t), intent(in), optional :: space
    type(field_space_t) :: own

    if (present(space)) own = space
    call add_fields(state, lattice, own)
    call add_history(state)
  end subroutine new_friction_state

  !> Give a state the fields that a load step finds: no contact, nothing displaced. Numbers that are known stay.
  subroutine add_fields(state, lattice, space, frictionless)
    !> State without fields
    type(contact_state_t), intent(inout) :: state
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Only those of a frictionless contact; absent: all
    logical, intent(in), optional :: frictionless
    integer :: row

    associate (n => space%own_extent(lattice%extent))
      allocate (state%pressure(n(1), n(2)), state%gap(n(1), n(2)), state%zone(n(1), n(2)))
      if (.not. present(frictionless)) then
        allocate (state%traction(n(1), n(2), 2), state%relative_displacement(n(1), n(2), 2), state%slip_increment(n(1), n(2), 2))
      end if
    end associate
    !$omp parallel do schedule(static) num_threads(space%threads)
    do row = 1, size(state%pressure, 2)
      state%pressure(:, row) = 0.0_wp
      state%gap(:, row) = 0.0_wp
      state%zone(:, row) = separated
      if (.not. allocated(state%traction)) cycle
      state%traction(:, row, :) = 0.0_wp
      state%relative_displacement(:, row, :) = 0.0_wp
      state%slip_increment(:, row, :) = 0.0_wp
    end do
    !$omp end parallel do
  end subroutine add_fields

  !> Give a state that has its pressure the fields that add up over load steps: no slip so far, nothing dissipated.
  subroutine add_history(state)
    !> State without them
    type(contact_state_t), intent(inout) :: state

    associate (n => shape(state%pressure))
      allocate (state%accumulated_slip(n(1), n(2)), state%dissipation_density(n(1), n(2)), source=0.0_wp)
    end associate
  end subroutine add_history

  !> Allocate all fields of a state with friction, without values.
  subroutine allocate_fields(state, extent, error)
    !> State without fields
    type(contact_state_t), intent(inout) :: state
    !> Number of columns and rows
    integer, intent(in) :: extent(2)
    !> Allocated without enough memory
    type(error_t), allocatable, intent(out) :: error
    integer :: stat

    associate (n => extent(1), m => extent(2))
      allocate (state%pressure(n, m), state%gap(n, m), state%zone(n, m), state%traction(n, m, 2), &
                state%relative_displacement(n, m, 2), state%slip_increment(n, m, 2), state%accumulated_slip(n, m), &
                state%dissipation_density(n, m), stat=stat)
    end associate
    if (stat /= 0) call raise(error, status%resources, &
                              'not enough memory for the state of the contact: choose a smaller window')
  end subroutine allocate_fields

  !> Point to a field of real numbers by its name in Python; to nothing if the state has none of that name.
  function field_of(state, name) result(field)
    !> State
    type(contact_state_t), intent(in), target :: state
    !> Name, of a component of a vector with _x or _y at its end
    character(len=*), intent(in) :: name
    real(wp), pointer, contiguous :: field(:, :)
    integer :: m

    m = merge(1, 2, name(len(name):) == 'x')
    field => null()
    select case (name)
    case ('pressure')
      if (allocated(state%pressure)) field => state%pressure
    case ('gap')
      if (allocated(state%gap)) field => state%gap
    case ('traction_x', 'traction_y')
      if (allocated(state%traction)) field => state%traction(:, :, m)
    case ('relative_displacement_x', 'relative_displacement_y')
      if (allocated(state%relative_displacement)) field => state%relative_displacement(:, :, m)
    case ('slip_increment_x', 'slip_increment_y')
      if (allocated(state%slip_increment)) field => state%slip_increment(:, :, m)
    case ('accumulated_slip')
      if (allocated(state%accumulated_slip)) field => state%accumulated_slip
    case ('dissipation_density')
      if (allocated(state%dissipation_density)) field => state%dissipation_density
    case default
      field => null()
    end select
  end function field_of

  !> Copy tractions, motions and loads of a state, from which an iteration starts.
  subroutine copy_tractions(state, start, space)
    !> State they come from
    type(contact_state_t), intent(in) :: state
    !> State to be set up
    type(contact_state_t), intent(out) :: start
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    integer :: row

    allocate (start%pressure, mold=state%pressure)
    allocate (start%traction, mold=state%traction)
    !$omp parallel do schedule(static) num_threads(space%threads)
    do row = 1, size(state%pressure, 2)
      start%pressure(:, row) = state%pressure(:, row)
      start%traction(:, row, :) = state%traction(:, row, :)
    end do
    !$omp end parallel do
    start%motion = state%motion
    start%load = state%load
  end subroutine copy_tractions

  !> Compute the share of the remote motions in the relative displacement at a point: shift + twist x r - strain r [m].
  pure function remote_displacement(motion, x, y) result(displacement)
    !> Motions
    real(wp), intent(in) :: motion(n_motion)
    !> Point [m]
    real(wp), intent(in) :: x, y
    real(wp) :: displacement(2)

    displacement(1) = motion(along_x) - motion(about_z)*y - (motion(strain_xx)*x + motion(strain_xy)*y)
    displacement(2) = motion(along_y) + motion(about_z)*x - (motion(strain_xy)*x + motion(strain_yy)*y)
  end function remote_displacement

  !> Return whether there is contact at the rim of the window.
  pure logical function touches_rim(state)
    !> State
    type(contact_state_t), intent(in) :: state

    associate (p => state%pressure)
      touches_rim = any(p(1, :) > 0.0_wp) .or. any(p(size(p, 1), :) > 0.0_wp) .or. &
                    any(p(:, 1) > 0.0_wp) .or. any(p(:, size(p, 2)) > 0.0_wp)
    end associate
  end function touches_rim

  !> Refuse a gap that does not fit the window, is not finite or has no candidate node.
  subroutine check_problem(lattice, medium, initial_gap, candidate, error, space)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> Initial gap (n_col, own rows) [m]; any value at all where nothing can touch
    real(wp), intent(in) :: initial_gap(:, :)
    !> Nodes that may come into contact (n_col, own rows)
    logical, intent(in) :: candidate(:, :)
    !> Allocated on failure, on all ranks: wrong shapes, no candidate at all, numbers of no use
    type(error_t), allocatable, intent(out) :: error
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    integer :: possible(1)

    call check_operator(lattice, medium, error)
    if (allocated(error)) return
    associate (extent => space%own_extent(lattice%extent))
      if (any(shape(initial_gap) /= extent) .or. any(shape(candidate) /= extent)) then
        call raise(error, status%invalid_input, 'the initial gap does not have the shape of the lattice window')
      else if (any(candidate .and. .not. ieee_is_finite(initial_gap))) then
        call raise(error, status%invalid_input, 'the initial gap of nodes that may come into contact: finite numbers expected')
      end if
    end associate
    call space%ranks%agree(error)
    if (allocated(error)) return
    possible = merge(1, 0, any(candidate))
    call space%ranks%add_counts(possible)
    if (possible(1) == 0) call raise(error, status%invalid_input, 'no node of the window may come into contact')
  end subroutine check_problem

  !> Refuse controls, loads, motions, tolerances and numbers of sweeps that no solver can work with.
  pure subroutine check_target(control, value, tolerance, max_sweeps, error)
    !> How motions are driven, the normal one first: force_control or displacement_control
    integer, intent(in) :: control(:)
    !> Loads [N], [N m] or motions [m], [rad]
    real(wp), intent(in) :: value(:)
    !> Bound of all residuals
    real(wp), intent(in) :: tolerance
    !> Active sets that may be tried
    integer, intent(in) :: max_sweeps
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    if (any(control /= force_control .and. control /= displacement_control)) then
      call raise(error, status%invalid_input, 'the control of a motion: force_control or displacement_control expected')
    else if (any(control(n_load + 1:) /= displacement_control)) then
      call raise(error, status%invalid_input, 'the control of the bulk strain: displacement_control expected')
    else if (.not. all(ieee_is_finite(value))) then
      call raise(error, status%invalid_input, 'loads and motions: finite numbers expected')
    else if (control(normal) == force_control .and. value(normal) < 0.0_wp) then
      call raise(error, status%invalid_input, 'the normal load: a number not below zero expected')
    else if (.not. ieee_is_finite(tolerance)) then
      call raise(error, status%invalid_input, 'the tolerance: a number between 0 and 1 expected')
    else if (tolerance <= 0.0_wp .or. tolerance >= 1.0_wp) then
      call raise(error, status%invalid_input, 'the tolerance: a number between 0 and 1 expected')
    else if (max_sweeps < 1) then
      call raise(error, status%invalid_input, 'the sweeps that may be made: at least one expected')
    end if
  end subroutine check_target

  !> Refuse a state from which no load step with friction can start.
  pure subroutine check_state(state, extent, error)
    !> State
    type(contact_state_t), intent(in) :: state
    !> Columns and own rows of the window
    integer, intent(in) :: extent(2)
    !> Allocated on failure: fields that are missing or of another window, numbers that are not finite
    type(error_t), allocatable, intent(out) :: error
    logical :: fits
    integer :: row

    fits = allocated(state%pressure) .and. allocated(state%gap) .and. allocated(state%traction) .and. &
           allocated(state%relative_displacement) .and. allocated(state%accumulated_slip) .and. &
           allocated(state%dissipation_density)
    if (fits) fits = all([shape(state%pressure), shape(state%gap), shape(state%accumulated_slip)] == [extent, extent, extent])
    if (fits) fits = all(shape(state%dissipation_density) == extent)
    if (fits) fits = all(shape(state%traction) == [extent, 2]) .and. all(shape(state%relative_displacement) == [extent, 2])
    if (.not. fits) then
      call raise(error, status%invalid_input, 'the initial state does not have the shape of the lattice window')
      return
    end if
    fits = all(ieee_is_finite([state%load, state%motion, state%dissipated_energy, state%path_error]))
    do row = 1, extent(2)
      fits = fits .and. all(ieee_is_finite(state%pressure(:, row))) .and. all(ieee_is_finite(state%traction(:, row, :))) &
             .and. all(ieee_is_finite(state%relative_displacement(:, row, :))) &
             .and. all(ieee_is_finite(state%accumulated_slip(:, row))) &
             .and. all(ieee_is_finite(state%dissipation_density(:, row)))
    end do
    if (.not. fits) call raise(error, status%invalid_input, 'the initial state: finite numbers expected')
  end subroutine check_state

end module hc_contact_state
