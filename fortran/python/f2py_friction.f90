!> Contact problems with friction for Python: flat procedures for f2py, no mathematics.
!>
!> States are kept by hc_f2py_states, which has the order of their fields and numbers.
module hc_f2py_friction
  use iso_c_binding, only: c_double, c_int, c_int64_t
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_f2py_handles, only: slot_t, take_slot, check_size, secure, enter, leave, free_slot, report, pair_of, friction_of, &
    normal_law_of, kernel_cache, take_state, state_at, unpack_state, numbers_of, n_number
  use hc_lattice, only: lattice_t, new_lattice
  use hc_contact_state, only: contact_state_t, load_target_t, n_load
  use hc_friction_law, only: friction_law_t
  use hc_contact_problem, only: friction_problem_t, new_friction_problem
  use hc_contact_solver, only: friction_solver_t
  use hc_subwindow_solver, only: windowed_friction_t, new_windowed_friction, windowed_friction_memory
  use hc_direct_friction, only: direct_friction_t, new_direct_friction
  use hc_field_space, only: space_over
  use hc_flexibility_dense, only: dense_memory
  use hc_load_path, only: advance, join_steps
  implicit none
  private

  public :: create_frictional_contact, set_guess, advance_friction, record_steps, relative_displacement, friction_memory_needed

  !> Methods: FFT; explicit matrices and LAPACK with the iteration of the dissertation; 0: with Newton's.
  integer, parameter :: fft_based = 1, as_written = 2
  !> Bytes of its fields over the nodes; matrices are checked where they are allocated
  integer(c_int64_t), parameter :: dense_fields = 500
  !> Fields that the entry of nodes takes
  integer, parameter :: entry_fields = 45

contains

  !> Count the bytes that a problem takes while a step is solved.
  subroutine friction_memory_needed(method, extent, n_contact, n_force, coupled, unlike, n_threads, bytes)
    !> 0: direct (LAPACK), 1: FFT, 2: direct with the iteration of the dissertation
    integer(c_int), intent(in) :: method
    !> Number of columns and rows of the window
    integer(c_int), intent(in) :: extent(2)
    !> Nodes in contact
    integer(c_int), intent(in) :: n_contact
    !> Loads that are prescribed, the normal one among them
    integer(c_int), intent(in) :: n_force
    !> Not zero: pressure and shear move each other; the materials are unlike
    integer(c_int), intent(in) :: coupled, unlike
    !> Threads
    integer(c_int), intent(in) :: n_threads
    !> Bytes
    integer(c_int64_t), intent(out) :: bytes

    if (method /= fft_based) then
      bytes = dense_memory(extent, n_contact, normal_only=.false., unlike=unlike /= 0)
    else
      bytes = windowed_friction_memory(extent, n_contact, n_force, coupled /= 0, n_threads, unlike /= 0)
    end if
  end subroutine friction_memory_needed

  !> Create a contact problem with friction.
  subroutine create_frictional_contact(method, basis, first, extent, origin, lambda, n_node, initial_gap, candidate, &
                                       n_coefficient, coefficient, law, interface, goodman, n_threads, handle, code, &
                                       message)
    !> 0: direct (LAPACK), 1: FFT, 2: direct with the iteration of the dissertation
    integer(c_int), intent(in) :: method
    !> Basis vectors as columns [m]
    real(c_double), intent(in) :: basis(2, 2)
    !> Smallest column and row index, number of columns and rows of the window
    integer(c_int), intent(in) :: first(2), extent(2)
    !> Position of node (0, 0) [m]
    real(c_double), intent(in) :: origin(2)
    !> lambda_1, lambda_2, lambda_5 [1/Pa]
    real(c_double), intent(in) :: lambda(3)
    !> Number of nodes of the window
    integer(c_int), intent(in) :: n_node
    !> Initial gap [m]
    real(c_double), intent(in) :: initial_gap(n_node)
    !> Not zero where a node may come into contact
    integer(c_int), intent(in) :: candidate(n_node)
    !> Coefficient of friction, one or that of each node, infinite or huge: no slip; numbers of the law: `friction_of`
    integer(c_int), intent(in) :: n_coefficient
    real(c_double), intent(in) :: coefficient(n_coefficient), law(4)
    !> Coefficient [Pa/m^m] and exponent m of the normal compliance, both 0: bodies do not penetrate; tangential stiffness
    !> [Pa/m], 0: no springs
    real(c_double), intent(in) :: interface(3)
    !> Not zero: shear tractions do not move the pressure
    integer(c_int), intent(in) :: goodman
    !> Threads to use; 0: as many as OpenMP would take
    integer(c_int), intent(in) :: n_threads
    !> Handle of the problem
    integer(c_int64_t), intent(out) :: handle
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(slot_t), pointer :: slot
    type(error_t), allocatable :: error
    class(friction_law_t), allocatable :: friction
    type(friction_problem_t) :: problem
    type(windowed_friction_t), pointer :: fft
    type(direct_friction_t), pointer :: dense
    integer(c_int64_t) :: bytes

    call take_slot(slot, handle, error)
    if (.not. allocated(error)) call new_lattice(slot%lattice, basis, first, extent, error, origin)
    if (.not. allocated(error)) call check_size(slot, n_node, error)
    if (.not. allocated(error)) then
      slot%space = space_over(extent, n_threads)
      bytes = dense_fields*product(int(extent, c_int64_t))
      ! of the largest contact there can be, with all loads prescribed
      if (method == fft_based) bytes = windowed_friction_memory(extent, n_node, n_load, goodman == 0, slot%space%threads, &
                                                                abs(lambda(2)) > 0.0_c_double)
      call secure(slot, bytes, n_threads, error)
    end if
    if (.not. allocated(error)) then
      call friction_of(coefficient, law, int(n_node), friction)
      call new_friction_problem(problem, slot%lattice, pair_of(lambda, interface), reshape(initial_gap, extent), &
                                reshape(candidate /= 0, extent), friction, goodman /= 0, error, normal_law_of(interface))
    end if
    if (.not. allocated(error)) then
      if (method /= fft_based) then
        allocate (dense)
        slot%solver => dense
        problem%options%direct%as_written = method == as_written
        call new_direct_friction(dense, problem, error)
      else
        allocate (fft)
        slot%solver => fft
        call new_windowed_friction(fft, problem, error, n_threads, kernel_cache)
      end if
    end if
    if (allocated(error)) call free_slot(handle)
    call report(error, code, message)
  end subroutine create_frictional_contact

  !> Tractions and motions that the next step is likely to end with: it starts from them, and forgets them.
  subroutine set_guess(handle, n_node, traction, motion, code, message)
    !> Handle of the problem
    integer(c_int64_t), intent(in) :: handle
    !> Number of nodes of the window
    integer(c_int), intent(in) :: n_node
    !> Pressure, traction along x and along y [Pa]
    real(c_double), intent(in) :: traction(n_node, 3)
    !> Approach, shifts [m], twist [rad] and bulk strain
    real(c_double), intent(in) :: motion(7)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(slot_t), pointer :: slot
    class(friction_solver_t), pointer :: solver
    type(error_t), allocatable :: error

    call enter(handle, n_node, slot, error)
    if (.not. allocated(error)) then
      call with_friction(slot, solver, error)
      if (.not. allocated(error)) then
        if (allocated(solver%guess)) deallocate (solver%guess)
        allocate (solver%guess)
        solver%guess%pressure = reshape(traction(:, 1), slot%lattice%extent)
        solver%guess%traction = reshape(traction(:, 2:3), [slot%lattice%extent, 2])
        solver%guess%motion = motion
      end if
      call leave(slot)
    end if
    call report(error, code, message)
  end subroutine set_guess

  !> Advance a state to given loads or motions.
  subroutine advance_friction(handle, control, target, static, interpolated, tolerance, max_sweeps, max_cuts, n_node, before, &
                              after, numbers, residuals, sweeps, cuts, operator_applications, flags, code, message)
    !f2py threadsafe
    !> Handle of the problem
    integer(c_int64_t), intent(in) :: handle
    !> z, x, y, twist: 1: the load is given, 2: the motion
    integer(c_int), intent(in) :: control(4)
    !> Loads [N], [N m] or motions [m], [rad]; bulk strain
    real(c_double), intent(in) :: target(7)
    !> Not zero: the load is applied to the undeformed bodies at once
    integer(c_int), intent(in) :: static
    !> Not zero: the slip of a node that enters counts from where it stood when its gap closed
    integer(c_int), intent(in) :: interpolated
    !> Bound of the residuals
    real(c_double), intent(in) :: tolerance
    !> Active sets that may be tried, times that a step may be halved
    integer(c_int), intent(in) :: max_sweeps, max_cuts
    !> Number of nodes of the window
    integer(c_int), intent(in) :: n_node
    !> Handle of the state to go on from, which does not change, and of the new state, 0 if there is none
    integer(c_int64_t), intent(in) :: before
    integer(c_int64_t), intent(out) :: after
    !> Numbers of the new state
    real(c_double), intent(out) :: numbers(13)
    !> R_n, R_t, R_P, R_Q, R_M
    real(c_double), intent(out) :: residuals(5)
    !> Active sets that were tried, times that the step was halved
    integer(c_int), intent(out) :: sweeps, cuts
    !> Work, in applications of the full operator
    real(c_double), intent(out) :: operator_applications
    !> Not zero: converged; gross sliding; contact at the rim of the window; and why the solver stopped
    integer(c_int), intent(out) :: flags(4)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(slot_t), pointer :: slot
    class(friction_solver_t), pointer :: solver
    type(error_t), allocatable :: error
    type(contact_state_t), pointer :: state, next

    after = 0
    numbers = 0.0_c_double
    flags = 0
    allocate (next)
    call enter(handle, n_node, slot, error, merge(entry_fields*8_c_int64_t*n_node, 0_c_int64_t, interpolated /= 0))
    if (.not. allocated(error)) then
      call with_friction(slot, solver, error)
      if (.not. allocated(error)) then
        state => state_at(before, n_node)
        if (associated(state)) then
          call advance(solver, state, load_target_t(control, target), static /= 0, tolerance, max_sweeps, max_cuts, &
                       next, error, interpolated /= 0)
        else
          call raise(error, status%bad_handle, 'the handle is stale: its state has been freed')
        end if
        if (allocated(solver%guess)) deallocate (solver%guess)
      end if
      call leave(slot)
    end if
    residuals = [next%residual_normal, next%residual_tangential, next%residual_force, next%residual_shear_force, &
                 next%residual_torque]
    sweeps = next%sweeps
    cuts = next%cuts
    operator_applications = next%operator_applications
    if (.not. allocated(error)) call take_state(next, after, error)
    if (allocated(error)) then
      deallocate (next)
    else
      numbers = numbers_of(next)
      flags = [merge(1, 0, [next%converged, next%sliding, next%clipped]), next%stopped]
    end if
    call report(error, code, message)
  end subroutine advance_friction

  !> Compute slip and residual of two steps that are recorded as one.
  subroutine record_steps(handle, n_node, first, last, slip, residual, code, message)
    !f2py threadsafe
    !> Handle of the problem
    integer(c_int64_t), intent(in) :: handle
    !> Number of nodes of the window
    integer(c_int), intent(in) :: n_node
    !> Fields at the end of the first and of the second step
    real(c_double), intent(in) :: first(n_node, 10), last(n_node, 10)
    !> Slip of both along x and y [m], at the nodes in contact at the end
    real(c_double), intent(out) :: slip(n_node, 2)
    !> R_t of this slip
    real(c_double), intent(out) :: residual
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(slot_t), pointer :: slot
    class(friction_solver_t), pointer :: solver
    type(error_t), allocatable :: error
    type(contact_state_t) :: half, state

    slip = 0.0_c_double
    residual = 0.0_c_double
    call enter(handle, n_node, slot, error)
    if (.not. allocated(error)) then
      call with_friction(slot, solver, error)
      if (.not. allocated(error)) then
        call unpack_state(slot%lattice, first, spread(0.0_c_double, 1, n_number), half)
        call unpack_state(slot%lattice, last, spread(0.0_c_double, 1, n_number), state)
        call join_steps(solver%problem, half, state)
        slip = reshape(state%slip_increment, [n_node, 2])
        residual = state%residual_tangential
      end if
      call leave(slot)
    end if
    call report(error, code, message)
  end subroutine record_steps

  !> Compute the relative displacement that follows from tractions and rigid motions.
  subroutine relative_displacement(handle, n_node, traction, motion, displacement, code, message)
    !f2py threadsafe
    !> Handle of the problem
    integer(c_int64_t), intent(in) :: handle
    !> Number of nodes of the window
    integer(c_int), intent(in) :: n_node
    !> Pressure, traction along x and along y [Pa]
    real(c_double), intent(in) :: traction(n_node, 3)
    !> Approach, shifts [m], twist [rad] and bulk strain
    real(c_double), intent(in) :: motion(7)
    !> w - approach, s_x and s_y [m]
    real(c_double), intent(out) :: displacement(n_node, 3)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(slot_t), pointer :: slot
    class(friction_solver_t), pointer :: solver
    type(error_t), allocatable :: error
    real(wp), allocatable :: field(:, :, :), u(:, :, :)

    displacement = 0.0_c_double
    call enter(handle, n_node, slot, error)
    if (.not. allocated(error)) then
      call with_friction(slot, solver, error)
      if (.not. allocated(error)) then
        field = reshape(traction, [slot%lattice%extent, 3])
        allocate (u, mold=field)
        call solver%displacements(field(:, :, 1), field(:, :, 2:), u, error)
        u(:, :, 1) = u(:, :, 1) - motion(1)
        u(:, :, 2:) = u(:, :, 2:) - solver%problem%rigid_displacement(motion)
        displacement = reshape(u, [n_node, 3])
      end if
      call leave(slot)
    end if
    call report(error, code, message)
  end subroutine relative_displacement

  !> Return the solver of a slot, if it is one with friction.
  subroutine with_friction(slot, solver, error)
    type(slot_t), intent(in) :: slot
    class(friction_solver_t), pointer, intent(out) :: solver
    !> Allocated on failure: the object is another one
    type(error_t), allocatable, intent(out) :: error

    solver => null()
    if (associated(slot%solver)) then
      select type (found => slot%solver)
      class is (friction_solver_t)
        solver => found
      end select
    end if
    if (.not. associated(solver)) then
      call raise(error, status%bad_handle, 'the handle is not that of a contact problem with friction')
    end if
  end subroutine with_friction

end module hc_f2py_friction
