!> The state of a contact: tractions, gap, zones, loads and rigid motions over a window.
module hc_contact_state
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_lattice, only: lattice_t
  use hc_flexibility, only: normal, along_x, along_y
  implicit none
  private

  public :: contact_state_t, new_contact_state, new_friction_state, take_tractions, check_problem
  public :: separated, stick, slip
  public :: load_target_t, force_control, displacement_control
  public :: normal, along_x, along_y, about_z, n_motion

  !> Zone of a node; without friction every node in contact slips.
  integer, parameter :: separated = 0, stick = 1, slip = 2

  !> The rigid motions: approach, shift along x and along y, and twist about z.
  !> `normal`, `along_x` and `along_y` are those of the tractions.
  integer, parameter :: about_z = 4, n_motion = 4

  !> What is prescribed of a motion: its load, or itself.
  integer, parameter :: force_control = 1, displacement_control = 2

  !> What the bodies are driven to, motion by motion.
  type :: load_target_t
    !> force_control or displacement_control
    integer :: control(n_motion) = [force_control, force_control, force_control, displacement_control]
    !> Load [N], torque [N m]; or approach, shift [m], twist [rad]
    real(wp) :: value(n_motion) = 0.0_wp
  end type load_target_t

  !> A solution and how well it fulfils the contact conditions.
  type :: contact_state_t
    !> Pressure and gap (n_col, n_row) [Pa], [m]
    real(wp), allocatable :: pressure(:, :), gap(:, :)
    !> Zone of each node (n_col, n_row)
    integer, allocatable :: zone(:, :)
    !> With friction: shear traction on body 1 (n_col, n_row, 2) [Pa]
    real(wp), allocatable :: traction(:, :, :)
    !> With friction: relative displacement s = (u1 - u2) - shift - twist x r (n_col, n_row, 2) [m]
    real(wp), allocatable :: relative_displacement(:, :, :)
    !> With friction: change of s during the step, on the nodes in contact (n_col, n_row, 2) [m]
    real(wp), allocatable :: slip_increment(:, :, :)
    !> With friction: length of the slip path so far (n_col, n_row) [m]
    real(wp), allocatable :: accumulated_slip(:, :)
    !> Normal load, tangential loads on body 1 [N] and torque [N m]: resultants of the tractions
    real(wp) :: load(n_motion) = 0.0_wp
    !> Approach, shifts [m] and twist [rad] of the remote parts
    real(wp) :: motion(n_motion) = 0.0_wp
    !> Energy dissipated by friction so far [J]
    real(wp) :: dissipated_energy = 0.0_wp
    !> Residual of the contact conditions along the normal
    real(wp) :: residual_normal = huge(1.0_wp)
    !> Residual of the friction conditions
    real(wp) :: residual_tangential = 0.0_wp
    !> Residual of the normal load; 0 where the approach is prescribed
    real(wp) :: residual_force = huge(1.0_wp)
    !> Residual of the tangential loads, of those that are prescribed
    real(wp) :: residual_shear_force = 0.0_wp
    !> Residual of the torque; 0 where the twist is prescribed
    real(wp) :: residual_torque = 0.0_wp
    !> All residuals are within the tolerance
    logical :: converged = .false.
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

  !> A state without contact.
  subroutine new_contact_state(state, lattice, n_threads)
    !> State to be set up
    type(contact_state_t), intent(out) :: state
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Threads to use; absent: one
    integer, intent(in), optional :: n_threads
    integer :: row, threads

    threads = 1
    if (present(n_threads)) threads = n_threads
    associate (n => lattice%extent)
      allocate (state%pressure(n(1), n(2)), state%gap(n(1), n(2)), state%zone(n(1), n(2)))
    end associate
    !$omp parallel do schedule(static) num_threads(threads)
    do row = 1, lattice%extent(2)
      state%pressure(:, row) = 0.0_wp
      state%gap(:, row) = 0.0_wp
      state%zone(:, row) = separated
    end do
    !$omp end parallel do
  end subroutine new_contact_state

  !> A state with friction before the first load: no contact, nothing displaced.
  subroutine new_friction_state(state, lattice, n_threads)
    !> State to be set up
    type(contact_state_t), intent(out) :: state
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Threads to use; absent: one
    integer, intent(in), optional :: n_threads
    integer :: row, threads

    threads = 1
    if (present(n_threads)) threads = n_threads
    call new_contact_state(state, lattice, threads)
    associate (n => lattice%extent)
      allocate (state%traction(n(1), n(2), 2), state%relative_displacement(n(1), n(2), 2), state%slip_increment(n(1), n(2), 2), &
                state%accumulated_slip(n(1), n(2)))
    end associate
    !$omp parallel do schedule(static) num_threads(threads)
    do row = 1, lattice%extent(2)
      state%traction(:, row, :) = 0.0_wp
      state%relative_displacement(:, row, :) = 0.0_wp
      state%slip_increment(:, row, :) = 0.0_wp
      state%accumulated_slip(:, row) = 0.0_wp
    end do
    !$omp end parallel do
  end subroutine new_friction_state

  !> Tractions and motions of a state, and nothing else: what an iteration starts from.
  subroutine take_tractions(state, start, n_threads)
    !> State they come from
    type(contact_state_t), intent(in) :: state
    !> State to be set up
    type(contact_state_t), intent(out) :: start
    !> Threads to use
    integer, intent(in) :: n_threads
    integer :: row

    allocate (start%pressure, mold=state%pressure)
    allocate (start%traction, mold=state%traction)
    !$omp parallel do schedule(static) num_threads(n_threads)
    do row = 1, size(state%pressure, 2)
      start%pressure(:, row) = state%pressure(:, row)
      start%traction(:, row, :) = state%traction(:, row, :)
    end do
    !$omp end parallel do
    start%motion = state%motion
    start%load = state%load
  end subroutine take_tractions

  !> Does a problem make sense?
  pure subroutine check_problem(lattice, initial_gap, candidate, error)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Initial gap (n_col, n_row) [m]
    real(wp), intent(in) :: initial_gap(:, :)
    !> Nodes that may come into contact (n_col, n_row)
    logical, intent(in) :: candidate(:, :)
    !> Allocated on failure: wrong shapes, no candidate at all
    type(error_t), allocatable, intent(out) :: error

    if (any(shape(initial_gap) /= lattice%extent) .or. any(shape(candidate) /= lattice%extent)) then
      call raise(error, status%invalid_input, 'the initial gap does not have the shape of the lattice window')
    else if (.not. any(candidate)) then
      call raise(error, status%invalid_input, 'no node of the window may come into contact')
    end if
  end subroutine check_problem

end module hc_contact_state
