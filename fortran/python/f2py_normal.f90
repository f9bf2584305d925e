!> Contact problems for Python: flat procedures for f2py, no mathematics.
!>
!> Objects live in the table of f2py_handles.f90. Creating and freeing happen
!> under Python's interpreter lock; the procedures marked threadsafe release it.
module hc_f2py_normal
  use iso_c_binding, only: c_double, c_int, c_int64_t
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_f2py_handles, only: slot_t, take_slot, check_size, secure, enter, leave, free_slot, report, pair_of, normal_law_of, &
    kernel_cache
  use hc_lattice, only: new_lattice, equilateral_basis
  use hc_elastic_pair, only: material_t, elastic_pair_t, new_elastic_pair
  use hc_flexibility, only: check_operator, along_x, along_y
  use hc_field_space, only: space_over
  use hc_flexibility_dense, only: dense_flexibility_t, new_dense_flexibility, dense_memory
  use hc_flexibility_fft, only: fft_flexibility_t, new_fft_flexibility, fft_memory, fft_setup_memory
  use hc_contact_state, only: contact_state_t, load_target_t, normal
  use hc_contact_solver, only: friction_solver_t
  use hc_normal_contact, only: normal_contact_t, new_normal_contact, normal_contact_memory
  use hc_direct_contact, only: direct_contact_t, new_direct_contact
  implicit none
  private

  public :: lattice_basis, elastic_constants, memory_needed
  public :: create_operator, apply_operator
  public :: create_normal_contact, solve_normal_contact
  public :: free_handle

  !> The method of explicit matrices and LAPACK; any other number means FFT.
  integer, parameter :: direct = 0
  !> Bytes of its fields over the nodes; matrices are checked where they are allocated
  integer(c_int64_t), parameter :: dense_fields = 500

contains

  !> Return the basis vectors of the equilateral lattice, as columns.
  subroutine lattice_basis(spacing, basis)
    !> Length of a side [m]
    real(c_double), intent(in) :: spacing
    !> Basis vectors as columns [m]
    real(c_double), intent(out) :: basis(2, 2)
    basis = equilateral_basis(spacing)
  end subroutine lattice_basis

  !> Compute the compliance constants of two bodies.
  subroutine elastic_constants(young_modulus, poisson_ratio, rigid, lambda, code, message)
    !> Young's moduli [Pa]
    real(c_double), intent(in) :: young_modulus(2)
    !> Poisson's ratios
    real(c_double), intent(in) :: poisson_ratio(2)
    !> Not zero for a rigid body
    integer(c_int), intent(in) :: rigid(2)
    !> lambda_1, lambda_2, lambda_5 [1/Pa]
    real(c_double), intent(out) :: lambda(3)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(elastic_pair_t) :: pair
    type(error_t), allocatable :: error

    call new_elastic_pair(pair, material_t(young_modulus(1), poisson_ratio(1), rigid(1) /= 0), &
                          material_t(young_modulus(2), poisson_ratio(2), rigid(2) /= 0), error)
    lambda = [pair%lambda_1, pair%lambda_2, pair%lambda_5]
    call report(error, code, message)
  end subroutine elastic_constants

  !> Count the bytes that a frictionless problem, or an operator, takes.
  subroutine memory_needed(method, extent, n_contact, operator_only, n_threads, bytes)
    !> 0: direct (LAPACK), else FFT
    integer(c_int), intent(in) :: method
    !> Number of columns and rows of the window
    integer(c_int), intent(in) :: extent(2)
    !> Nodes in contact
    integer(c_int), intent(in) :: n_contact
    !> 1: the full 3x3 operator alone, 2: what it takes besides while it is set up; 0: a frictionless problem
    integer(c_int), intent(in) :: operator_only
    !> Threads
    integer(c_int), intent(in) :: n_threads
    !> Bytes
    integer(c_int64_t), intent(out) :: bytes

    if (method == direct) then
      bytes = dense_memory(extent, n_contact, normal_only=.true.)
    else if (operator_only == 1) then
      bytes = fft_memory(extent, .false., n_threads)
    else if (operator_only == 2) then
      bytes = fft_setup_memory(extent)
    else
      bytes = normal_contact_memory(extent, n_threads)
    end if
  end subroutine memory_needed

  !> Create a flexibility operator over a window.
  subroutine create_operator(method, basis, extent, lambda, n_threads, handle, code, message)
    !> 0: direct summation, else FFT
    integer(c_int), intent(in) :: method
    !> Basis vectors as columns [m]
    real(c_double), intent(in) :: basis(2, 2)
    !> Number of columns and rows of the window
    integer(c_int), intent(in) :: extent(2)
    !> lambda_1, lambda_2, lambda_5 [1/Pa]
    real(c_double), intent(in) :: lambda(3)
    !> Threads to use; 0: as many as OpenMP would take
    integer(c_int), intent(in) :: n_threads
    !> Handle of the operator
    integer(c_int64_t), intent(out) :: handle
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(slot_t), pointer :: slot
    type(error_t), allocatable :: error
    type(dense_flexibility_t), pointer :: dense
    type(fft_flexibility_t), pointer :: fft
    integer(c_int64_t) :: bytes

    call take_slot(slot, handle, error)
    if (.not. allocated(error)) call new_lattice(slot%lattice, basis, [0, 0], extent, error)
    if (.not. allocated(error)) then
      slot%space = space_over(extent, n_threads)
      bytes = dense_fields*product(int(extent, c_int64_t))
      if (method /= direct) bytes = fft_memory(extent, .false., slot%space%threads) + fft_setup_memory(extent)
      call secure(slot, bytes, n_threads, error)
    end if
    if (.not. allocated(error)) call check_operator(slot%lattice, pair_of(lambda), error, n_threads)
    if (.not. allocated(error)) then
      if (method == direct) then
        allocate (dense)
        slot%operator => dense
        call new_dense_flexibility(dense, slot%lattice, pair_of(lambda), error)
      else
        allocate (fft)
        slot%operator => fft
        call new_fft_flexibility(fft, slot%lattice, pair_of(lambda), error, space=slot%space, cache=kernel_cache)
      end if
    end if
    if (allocated(error)) call free_slot(handle)
    call report(error, code, message)
  end subroutine create_operator

  !> Compute the relative displacements of given tractions.
  subroutine apply_operator(handle, n_node, traction, displacement, code, message)
    !f2py threadsafe
    !> Handle of the operator
    integer(c_int64_t), intent(in) :: handle
    !> Number of nodes of the window
    integer(c_int), intent(in) :: n_node
    !> Pressure, traction along x and along y [Pa]
    real(c_double), intent(in) :: traction(n_node, 3)
    !> Closing of the gap, relative displacement along x and along y [m]
    real(c_double), intent(out) :: displacement(n_node, 3)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(slot_t), pointer :: slot
    type(error_t), allocatable :: error
    real(wp), allocatable :: field(:, :, :), answer(:, :, :)

    displacement = 0.0_c_double
    call enter(handle, n_node, slot, error)
    if (.not. allocated(error)) then
      if (associated(slot%operator)) then
        associate (extent => slot%lattice%extent)
          field = reshape(traction, [extent(1), extent(2), 3])
          allocate (answer, mold=field)
          call slot%operator%apply([normal, along_x, along_y], field, [normal, along_x, along_y], answer, error)
          displacement = reshape(answer, [n_node, 3])
        end associate
      else
        call raise(error, status%bad_handle, 'the handle is not that of an operator')
      end if
      call leave(slot)
    end if
    call report(error, code, message)
  end subroutine apply_operator

  !> Create a frictionless contact problem.
  subroutine create_normal_contact(method, basis, first, extent, lambda, n_node, initial_gap, candidate, interface, &
                                   n_threads, handle, code, message)
    !> 0: direct (LAPACK), else FFT
    integer(c_int), intent(in) :: method
    !> Basis vectors as columns [m]
    real(c_double), intent(in) :: basis(2, 2)
    !> Smallest column and row index, number of columns and rows of the window
    integer(c_int), intent(in) :: first(2), extent(2)
    !> lambda_1, lambda_2, lambda_5 [1/Pa]
    real(c_double), intent(in) :: lambda(3)
    !> Number of nodes of the window
    integer(c_int), intent(in) :: n_node
    !> Initial gap [m]
    real(c_double), intent(in) :: initial_gap(n_node)
    !> Not zero where a node may come into contact
    integer(c_int), intent(in) :: candidate(n_node)
    !> Coefficient [Pa/m^m] and exponent m of the normal compliance, both 0: bodies do not penetrate; tangential stiffness
    !> [Pa/m], 0: no springs
    real(c_double), intent(in) :: interface(3)
    !> Threads to use; 0: as many as OpenMP would take
    integer(c_int), intent(in) :: n_threads
    !> Handle of the problem
    integer(c_int64_t), intent(out) :: handle
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(slot_t), pointer :: slot
    type(error_t), allocatable :: error
    type(direct_contact_t), pointer :: dense
    type(normal_contact_t), pointer :: fft
    integer(c_int64_t) :: bytes

    call take_slot(slot, handle, error)
    if (.not. allocated(error)) call new_lattice(slot%lattice, basis, first, extent, error)
    if (.not. allocated(error)) call check_size(slot, n_node, error)
    if (.not. allocated(error)) then
      slot%space = space_over(extent, n_threads)
      bytes = dense_fields*product(int(extent, c_int64_t))
      if (method /= direct) bytes = normal_contact_memory(extent, slot%space%threads)
      call secure(slot, bytes, n_threads, error)
    end if
    if (.not. allocated(error)) then
      if (method == direct) then
        allocate (dense)
        slot%solver => dense
        call new_direct_contact(dense, slot%lattice, pair_of(lambda), reshape(initial_gap, extent), &
                                reshape(candidate /= 0, extent), error, law=normal_law_of(interface))
      else
        allocate (fft)
        slot%solver => fft
        call new_normal_contact(fft, slot%lattice, pair_of(lambda), reshape(initial_gap, extent), &
                                reshape(candidate /= 0, extent), error, n_threads, kernel_cache, &
                                law=normal_law_of(interface))
      end if
    end if
    if (allocated(error)) call free_slot(handle)
    call report(error, code, message)
  end subroutine create_normal_contact

  !> Solve a frictionless contact problem for a load or an approach.
  subroutine solve_normal_contact(handle, control, target, tolerance, max_sweeps, n_node, pressure, gap, zone, &
                                  normal_load, approach, residuals, sweeps, operator_applications, flags, code, message)
    !f2py threadsafe
    !> Handle of the problem
    integer(c_int64_t), intent(in) :: handle
    !> 1: the normal load is given, 2: the approach
    integer(c_int), intent(in) :: control
    !> Normal load [N] or approach [m]
    real(c_double), intent(in) :: target
    !> Bound of the residuals
    real(c_double), intent(in) :: tolerance
    !> Active sets that may be tried
    integer(c_int), intent(in) :: max_sweeps
    !> Number of nodes of the window
    integer(c_int), intent(in) :: n_node
    !> Pressure [Pa], gap [m] and zone of each node
    real(c_double), intent(out) :: pressure(n_node), gap(n_node)
    integer(c_int), intent(out) :: zone(n_node)
    ! no memory is touched for them before the solution is there
    !f2py intent(out, cache) :: pressure, gap, zone
    !> Normal load [N] and approach [m]
    real(c_double), intent(out) :: normal_load, approach
    !> R_n and R_P
    real(c_double), intent(out) :: residuals(2)
    !> Active sets that were tried
    integer(c_int), intent(out) :: sweeps
    !> Work, in applications of the full operator
    real(c_double), intent(out) :: operator_applications
    !> Not zero: converged; contact at the rim of the window; and why the solver stopped
    integer(c_int), intent(out) :: flags(3)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(slot_t), pointer :: slot
    type(error_t), allocatable :: error
    type(contact_state_t) :: none, state
    type(load_target_t) :: goal
    real(wp) :: no_reference(0, 0, 0)
    logical :: is_frictionless

    call enter(handle, n_node, slot, error)
    if (.not. allocated(error)) then
      is_frictionless = associated(slot%solver)
      if (is_frictionless) then
        select type (solver => slot%solver)
        class is (friction_solver_t)
          is_frictionless = .false.
        end select
      end if
      if (is_frictionless) then
        goal%control(normal) = control
        goal%value(normal) = target
        call slot%solver%solve_step(none, no_reference, goal, tolerance, max_sweeps, state, error)
      else
        call raise(error, status%bad_handle, 'the handle is not that of a contact problem')
      end if
      call leave(slot)
    end if
    if (allocated(error)) then
      pressure = 0.0_c_double
      gap = 0.0_c_double
      zone = 0
    else
      call hand_over(state%pressure, pressure)
      call hand_over(state%gap, gap)
      zone = pack(state%zone, .true.)
    end if
    normal_load = state%load(normal)
    approach = state%motion(normal)
    residuals = [state%residual_normal, state%residual_force]
    sweeps = state%sweeps
    operator_applications = state%operator_applications
    flags = [merge(1, 0, [state%converged, state%clipped]), state%stopped]
    call report(error, code, message)
  end subroutine solve_normal_contact

  !> Copy a field to Python, and free it.
  subroutine hand_over(field, values)
    !> Field (n_col, n_row)
    real(wp), allocatable, intent(inout) :: field(:, :)
    !> Its values
    real(c_double), intent(out) :: values(size(field, 1), size(field, 2))

    values = field
    deallocate (field)
  end subroutine hand_over

  !> Free the object of a handle; a stale handle is ignored.
  subroutine free_handle(handle)
    !> Handle of an operator or a problem
    integer(c_int64_t), intent(in) :: handle
    call free_slot(handle)
  end subroutine free_handle

end module hc_f2py_normal
