!> Table of the objects to which Python has handles.
!>
!> A handle is a slot number with a generation count, so that a stale handle is
!> an error and never another object. A handle in use by one thread is refused
!> in another. States of contacts have handles of the same kind. The cache of spectra is here, too.
!> No other module has state; this one is not part of the Fortran library.
module hc_f2py_handles
  use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_error, only: error_t, status, raise
  use hc_lock, only: lock, unlock, handle_table
  use hc_memory, only: require_memory
  use hc_lattice, only: lattice_t
  use hc_field_space, only: field_space_t, most_threads
  use hc_flexibility, only: flexibility_t
  use hc_elastic_pair, only: elastic_pair_t
  use hc_friction_law, only: friction_law_t
  use hc_coulomb, only: coulomb_t
  use hc_nodal_coulomb, only: nodal_coulomb_t
  use hc_orthotropic_coulomb, only: orthotropic_coulomb_t
  use hc_normal_law, only: normal_law_t, unilateral_t
  use hc_power_interface, only: power_interface_t
  use hc_contact_state, only: contact_state_t, new_friction_state, n_load, n_motion
  use hc_contact_solver, only: contact_solver_t
  use hc_spectrum_cache, only: kernel_cache_t
  implicit none
  private

  public :: slot_t, kernel_cache, take_slot, check_size, secure, enter, leave, free_slot, report, pair_of, friction_of, &
            normal_law_of
  public :: take_state, state_at, forget_state, unpack_state, unpack_numbers, numbers_of, n_number

  !> Fields of a state: pressure, traction x y, gap, relative displacement x y, slip increment x y, slip path,
  !> dissipated energy by area
  integer, parameter :: n_field = 10
  !> Numbers of a state: loads, motions with the bulk strain, dissipated energy
  integer, parameter :: n_number = n_load + n_motion + 2

  !> Largest number of objects.
  integer, parameter :: n_slot = 4096

  !> Object of a handle.
  type :: slot_t
    !> Odd while the slot is in use
    integer(c_int64_t) :: generation = 0
    !> In use by some thread
    logical :: busy = .false.
    !> Bytes that a call may take
    integer(c_int64_t) :: working = 0
    type(lattice_t) :: lattice
    type(field_space_t) :: space
    class(flexibility_t), pointer :: operator => null()
    class(contact_solver_t), pointer :: solver => null()
  end type slot_t

  type(slot_t), target :: slots(n_slot)

  !> State of a handle.
  type :: held_state_t
    !> Odd while there is a state
    integer(c_int64_t) :: generation = 0
    type(contact_state_t), pointer :: state => null()
    !> The free slot after this one, 0: none
    integer :: next = 0
  end type held_state_t

  !> Slots of the table of states, which grows, at most.
  integer(c_int64_t), parameter :: n_state = 2_c_int64_t**24
  type(held_state_t), allocatable :: states(:)
  !> First free slot, 0: none
  integer :: free_state = 0

  !> Spectra of kernels that all problems share.
  type(kernel_cache_t), pointer :: kernel_cache => null()

contains

  !> Free the object of a handle; a stale handle is ignored.
  subroutine free_slot(handle)
    !> Handle of an operator or a problem
    integer(c_int64_t), intent(in) :: handle
    logical :: mine

    if (handle < 0) return
    associate (slot => slots(int(modulo(handle, int(n_slot, c_int64_t))) + 1))
      call lock(handle_table)
      ! an object that another thread uses, or frees, stays with that thread
      mine = slot%generation == handle/n_slot .and. .not. slot%busy
      if (mine) slot%busy = .true.
      call unlock(handle_table)
      if (.not. mine) return
      if (associated(slot%operator)) deallocate (slot%operator)
      if (associated(slot%solver)) deallocate (slot%solver)
      call lock(handle_table)
      slot%generation = slot%generation + 1
      slot%busy = .false.
      call unlock(handle_table)
    end associate
  end subroutine free_slot

  !> Take a free slot of the table, and return its handle. An odd generation marks a slot in use.
  subroutine take_slot(slot, handle, error)
    !> Slot of the table
    type(slot_t), pointer, intent(out) :: slot
    !> Handle of an operator or a problem
    integer(c_int64_t), intent(out) :: handle
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    integer :: i, free

    handle = -1
    free = 0
    call lock(handle_table)
    do i = 1, n_slot
      if (modulo(slots(i)%generation, 2_c_int64_t) == 0) then
        free = i
        slots(i)%generation = slots(i)%generation + 1
        exit
      end if
    end do
    call unlock(handle_table)
    slot => slots(max(free, 1))
    if (free == 0) then
      call raise(error, status%resources, 'too many contact problems exist at once: delete some')
      return
    end if
    handle = slot%generation*n_slot + free - 1
  end subroutine take_slot

  !> Refuse a problem for which there is no memory; record the bytes that its solution may take.
  subroutine secure(slot, bytes, n_threads, error)
    !> Slot of the table
    type(slot_t), intent(inout) :: slot
    !> Memory of the problem, that of solving it included
    integer(c_int64_t), intent(in) :: bytes
    !> Threads to use; 0: as many as OpenMP would take
    integer(c_int), intent(in) :: n_threads
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    ! the constructors refuse such a number
    if (n_threads < 0 .or. n_threads > most_threads) then
      slot%space = field_space_t()
      return
    end if
    ! a fifth at least, mostly a quarter, are operators and fields of the problem itself
    slot%working = 4*bytes/5
    call require_memory(bytes, error, slot%space%threads)
  end subroutine secure

  !> Look a handle up and mark its object as in use.
  subroutine enter(handle, n_node, slot, error, more)
    !> Handle of an operator or a problem
    integer(c_int64_t), intent(in) :: handle
    !> Number of nodes of the arrays
    integer(c_int), intent(in) :: n_node
    !> Slot of the table
    type(slot_t), pointer, intent(out) :: slot
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    !> Bytes that the call takes beyond those of a solution
    integer(c_int64_t), intent(in), optional :: more
    integer(c_int64_t) :: bytes
    logical :: stale, busy

    slot => slots(int(modulo(handle, int(n_slot, c_int64_t))) + 1)
    busy = .true.
    call lock(handle_table)
    stale = handle < 0 .or. slot%generation /= handle/n_slot
    if (.not. stale) then
      busy = slot%busy
      slot%busy = .true.
    end if
    call unlock(handle_table)
    if (stale) then
      call raise(error, status%bad_handle, 'the handle is stale: its object has been freed')
      return
    end if
    if (busy) then
      call raise(error, status%bad_handle, 'the object is at work in another thread')
      return
    end if
    call check_size(slot, n_node, error)
    if (.not. allocated(error)) then
      bytes = slot%working
      if (present(more)) bytes = bytes + more
      call require_memory(bytes, error, slot%space%threads)
    end if
    if (allocated(error)) call leave(slot)
  end subroutine enter

  !> Refuse arrays that do not fit the window of a slot.
  pure subroutine check_size(slot, n_node, error)
    !> Slot of the table
    type(slot_t), intent(in) :: slot
    !> Number of nodes of the arrays
    integer(c_int), intent(in) :: n_node
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    if (slot%lattice%size() /= n_node) then
      call raise(error, status%invalid_input, 'the arrays do not have the shape of the lattice window')
    end if
  end subroutine check_size

  !> Mark the object of a handle as free.
  subroutine leave(slot)
    !> Slot of the table
    type(slot_t), pointer, intent(in) :: slot

    call lock(handle_table)
    slot%busy = .false.
    call unlock(handle_table)
  end subroutine leave

  !> Set up elastic constants from a vector; with them the tangential springs of an interface.
  pure type(elastic_pair_t) function pair_of(lambda, interface)
    !> lambda_1, lambda_2, lambda_5 [1/Pa]
    real(c_double), intent(in) :: lambda(3)
    !> Coefficient [Pa/m^m] and exponent m of the normal compliance, tangential stiffness [Pa/m]
    real(c_double), intent(in), optional :: interface(3)
    pair_of = elastic_pair_t(lambda(1), lambda(2), lambda(3))
    if (.not. present(interface)) return
    if (abs(interface(3)) > 0.0_c_double .or. .not. ieee_is_finite(interface(3))) pair_of%tangential_layer = 1/interface(3)
  end function pair_of

  !> Make a law of friction from its numbers.
  subroutine friction_of(coefficient, law, n_node, friction)
    !> Coefficient of friction, one or that of each node; one that is infinite or huge: no slip
    real(c_double), intent(in) :: coefficient(:)
    !> Bound of the shear traction, infinite or huge: none [Pa]; power of the pressure; ratio of the coefficients along and across,
    !> of which `coefficient` is the geometric mean, and angle of the direction along from x [rad]
    real(c_double), intent(in) :: law(4)
    !> Number of nodes of the window
    integer, intent(in) :: n_node
    !> The law
    class(friction_law_t), allocatable, intent(out) :: friction
    type(coulomb_t) :: coulomb
    type(nodal_coulomb_t) :: nodal
    type(orthotropic_coulomb_t) :: ellipse
    real(c_double), parameter :: half = 0.5_c_double*huge(1.0_c_double), unbounded = 1.0e100_c_double
    logical :: plain, isotropic

    isotropic = abs(law(3) - 1) <= 0
    plain = size(coefficient) == 1 .and. law(1) > half .and. abs(law(2) - 1) <= 0 .and. isotropic
    if (plain) then
      coulomb%no_slip = coefficient(1) > half
      if (.not. coulomb%no_slip) coulomb%coefficient = coefficient(1)
      allocate (friction, source=coulomb)
    else
      nodal%coefficient = coefficient
      if (size(coefficient) == 1) nodal%coefficient = spread(min(coefficient(1), unbounded), 1, n_node)
      nodal%shear_limit = law(1)
      nodal%power = law(2)
      if (isotropic) then
        allocate (friction, source=nodal)
      else
        ! no structure constructor: gfortran 12 frees the components of a parent in it twice
        ellipse%nodal_coulomb_t = nodal
        ellipse%ratio = law(3)
        ellipse%angle = law(4)
        allocate (friction, source=ellipse)
      end if
    end if
  end subroutine friction_of

  !> Make a law of contact from coefficient and exponent of a normal compliance; both 0: bodies do not penetrate.
  function normal_law_of(interface) result(law)
    !> Coefficient [Pa/m^m] and exponent m of the normal compliance, tangential stiffness [Pa/m]
    real(c_double), intent(in) :: interface(3)
    class(normal_law_t), allocatable :: law

    if (all(abs(interface(:2)) <= 0.0_c_double)) then
      allocate (unilateral_t :: law)
    else
      allocate (law, source=power_interface_t(interface(1), interface(2)))
    end if
  end function normal_law_of

  !> Give a state a handle.
  subroutine take_state(state, handle, error)
    !> The state
    type(contact_state_t), pointer, intent(in) :: state
    !> Its handle, 0 on failure
    integer(c_int64_t), intent(out) :: handle
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    integer :: slot

    handle = 0
    call lock(handle_table)
    if (free_state == 0) call more_states()
    slot = free_state
    if (slot > 0) then
      free_state = states(slot)%next
      states(slot)%generation = states(slot)%generation + 1
      states(slot)%state => state
      handle = states(slot)%generation*n_state + slot - 1
    end if
    call unlock(handle_table)
    if (slot == 0) call raise(error, status%resources, 'not enough memory for one more state of a contact: delete some')
  end subroutine take_state

  !> Double the table of states, if there is memory.
  subroutine more_states()
    type(held_state_t), allocatable :: grown(:)
    integer :: n, i, stat

    n = 0
    if (allocated(states)) n = size(states)
    if (2*n > n_state) return
    allocate (grown(max(64, 2*n)), stat=stat)
    if (stat /= 0) return
    if (n > 0) grown(:n) = states
    do i = n + 1, size(grown) - 1
      grown(i)%next = i + 1
    end do
    call move_alloc(grown, states)
    free_state = n + 1
  end subroutine more_states

  !> Return the state of a handle; none if the handle is stale, or the state has another number of nodes.
  function state_at(handle, n_node) result(state)
    !> Handle, of `take_state`
    integer(c_int64_t), intent(in) :: handle
    !> Number of nodes of the window; absent: any
    integer(c_int), intent(in), optional :: n_node
    type(contact_state_t), pointer :: state
    integer :: slot

    state => null()
    call lock(handle_table)
    slot = slot_of(handle)
    if (slot > 0) state => states(slot)%state
    call unlock(handle_table)
    if (.not. (associated(state) .and. present(n_node))) return
    if (size(state%pressure) /= n_node) state => null()
  end function state_at

  !> Return the state of a handle, which is stale from now on; none if it was.
  function forget_state(handle) result(state)
    !> Handle, of `take_state`
    integer(c_int64_t), intent(in) :: handle
    type(contact_state_t), pointer :: state
    integer :: slot

    state => null()
    call lock(handle_table)
    slot = slot_of(handle)
    if (slot > 0) then
      state => states(slot)%state
      states(slot)%state => null()
      states(slot)%generation = states(slot)%generation + 1
      states(slot)%next = free_state
      free_state = slot
    end if
    call unlock(handle_table)
  end function forget_state

  !> Return the slot of a handle of a state, 0 if it is stale.
  integer function slot_of(handle) result(slot)
    integer(c_int64_t), intent(in) :: handle

    slot = 0
    if (handle < n_state .or. .not. allocated(states)) return
    slot = int(modulo(handle, n_state)) + 1
    if (slot > size(states)) then
      slot = 0
    else if (states(slot)%generation /= handle/n_state .or. .not. associated(states(slot)%state)) then
      slot = 0
    end if
  end function slot_of

  !> Unpack a state from its arrays.
  subroutine unpack_state(lattice, fields, numbers, state)
    type(lattice_t), intent(in) :: lattice
    real(c_double), intent(in) :: fields(:, :), numbers(:)
    type(contact_state_t), intent(out) :: state

    call new_friction_state(state, lattice)
    state%pressure = reshape(fields(:, 1), lattice%extent)
    state%traction = reshape(fields(:, 2:3), [lattice%extent, 2])
    state%gap = reshape(fields(:, 4), lattice%extent)
    state%relative_displacement = reshape(fields(:, 5:6), [lattice%extent, 2])
    state%slip_increment = reshape(fields(:, 7:8), [lattice%extent, 2])
    state%accumulated_slip = reshape(fields(:, 9), lattice%extent)
    state%dissipation_density = reshape(fields(:, n_field), lattice%extent)
    call unpack_numbers(numbers, state)
  end subroutine unpack_state

  !> Return the numbers of a state.
  pure function numbers_of(state) result(numbers)
    type(contact_state_t), intent(in) :: state
    real(c_double) :: numbers(n_number)

    numbers = [state%load(:n_load), state%motion, state%dissipated_energy, state%path_error]
  end function numbers_of

  !> Unpack the numbers of a state.
  subroutine unpack_numbers(numbers, state)
    real(c_double), intent(in) :: numbers(:)
    type(contact_state_t), intent(inout) :: state

    state%load(:n_load) = numbers(:n_load)
    state%motion = numbers(n_load + 1:n_load + n_motion)
    state%dissipated_energy = numbers(n_number - 1)
    state%path_error = numbers(n_number)
  end subroutine unpack_numbers

  !> Return an error as a code and a message.
  pure subroutine report(error, code, message)
    !> Allocated on failure
    type(error_t), allocatable, intent(in) :: error
    !> Status
    integer(c_int), intent(out) :: code
    !> Message of the error
    character(len=*), intent(out) :: message

    code = status%ok
    message = ''
    if (allocated(error)) then
      code = error%code
      message = error%message
    end if
  end subroutine report

end module hc_f2py_handles
