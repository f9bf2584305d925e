!> Objects of the core that Python holds: operators, contact problems and states, and the cache of spectra.
!>
!> A handle is the number of an entry of a table with a generation count, so that a stale handle is an error and never
!> another object. A problem in use by one thread is refused in another. No other module has state; this one is no part of
!> the Fortran library.
module hc_f2py_handles
  use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_error, only: error_t, status, raise
  use hc_lock, only: lock, unlock, handle_table
  use hc_memory, only: require_memory
  use hc_communicator, only: communicator_t
  use hc_lattice, only: lattice_t
  use hc_field_space, only: field_space_t
  use hc_flexibility, only: flexibility_t
  use hc_elastic_medium, only: elastic_medium_t
  use hc_elastic_pair, only: elastic_pair_t, material_t
  use hc_layered_pair, only: coating_t, layered_pair_t, new_layered_pair
  use hc_friction_law, only: friction_law_t
  use hc_coulomb, only: coulomb_t
  use hc_nodal_coulomb, only: nodal_coulomb_t
  use hc_orthotropic_coulomb, only: orthotropic_coulomb_t
  use hc_normal_law, only: normal_law_t, unilateral_t
  use hc_power_interface, only: power_interface_t
  use hc_contact_state, only: contact_state_t
  use hc_contact_solver, only: contact_solver_t, friction_solver_t
  use hc_wear_path, only: wear_path_t
  use hc_spectrum_cache, only: kernel_cache_t
  implicit none
  private

  public :: slot_t, take_slot, enter, leave, free_object, free_slip, hold, find, kernel_cache, report, ranks
  public :: bodies_of, make_layered, add_springs, friction_of, normal_law_of

  !> Object of a handle: one of these.
  type :: slot_t
    !> In use by some thread
    logical :: busy = .false.
    !> Bytes that a call may take
    integer(c_int64_t) :: working = 0
    type(lattice_t) :: lattice
    !> Columns and rows of the arrays: those of the window, or own rows of a problem that ranks share
    integer :: extent(2) = 0
    type(field_space_t) :: space
    !> Ranks that call its procedures together
    type(communicator_t) :: ranks = communicator_t()
    class(flexibility_t), pointer :: operator => null()
    !> A solver, and the same one if it is with friction
    class(contact_solver_t), pointer :: solver => null()
    class(friction_solver_t), pointer :: sheared => null()
    type(contact_state_t), pointer :: state => null()
    type(wear_path_t), pointer :: wear => null()
  end type slot_t

  !> Entry of the table.
  type :: entry_t
    !> Odd while there is an object
    integer(c_int64_t) :: generation = 0
    type(slot_t), pointer :: slot => null()
    !> The free entry after this one, 0: none
    integer :: next = 0
  end type entry_t

  !> Entries of the table, which grows, at most.
  integer(c_int64_t), parameter :: n_entry = 2_c_int64_t**24
  type(entry_t), allocatable :: entries(:)
  !> First free entry, 0: none
  integer :: free_entry = 0

  !> Ranks that solve problems together: one, unless MPI is started.
  type(communicator_t) :: ranks

  !> Spectra of kernels that all problems share: none until their bound is set.
  type(kernel_cache_t), target :: own_cache
  type(kernel_cache_t), pointer :: kernel_cache => own_cache

contains

  !> Make an empty object, and return its handle.
  subroutine take_slot(slot, handle, error)
    !> The object
    type(slot_t), pointer, intent(out) :: slot
    !> Its handle, 0 on failure
    integer(c_int64_t), intent(out) :: handle
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    integer :: place

    handle = 0
    allocate (slot)
    call lock(handle_table)
    if (free_entry == 0) call more_entries()
    place = free_entry
    if (place > 0) then
      free_entry = entries(place)%next
      entries(place)%generation = entries(place)%generation + 1
      entries(place)%slot => slot
      handle = entries(place)%generation*n_entry + place - 1
    end if
    call unlock(handle_table)
    if (place > 0) return
    deallocate (slot)
    call raise(error, status%resources, 'not enough memory for one more contact problem or state: delete some')
  end subroutine take_slot

  !> Double the table, if there is memory.
  subroutine more_entries()
    type(entry_t), allocatable :: grown(:)
    integer :: n, i, stat

    n = 0
    if (allocated(entries)) n = size(entries)
    if (2*n > n_entry) return
    allocate (grown(max(64, 2*n)), stat=stat)
    if (stat /= 0) return
    if (n > 0) grown(:n) = entries
    do i = n + 1, size(grown) - 1
      grown(i)%next = i + 1
    end do
    call move_alloc(grown, entries)
    free_entry = n + 1
  end subroutine more_entries

  !> Return the place of a handle in the table, 0 if it is stale; the table is locked.
  integer function place_of(handle) result(place)
    integer(c_int64_t), intent(in) :: handle

    place = 0
    if (handle < n_entry .or. .not. allocated(entries)) return
    place = int(modulo(handle, n_entry)) + 1
    if (place > size(entries)) then
      place = 0
    else if (entries(place)%generation /= handle/n_entry .or. .not. associated(entries(place)%slot)) then
      place = 0
    end if
  end function place_of

  !> Free the object of a handle; a stale handle is ignored, and an object at work stays with its thread.
  subroutine free_object(handle)
    !> Handle of the object
    integer(c_int64_t), intent(in) :: handle
    type(slot_t), pointer :: slot
    integer :: place

    slot => null()
    call lock(handle_table)
    place = place_of(handle)
    if (place > 0) then
      if (.not. entries(place)%slot%busy) then
        slot => entries(place)%slot
        entries(place)%slot => null()
        entries(place)%generation = entries(place)%generation + 1
        entries(place)%next = free_entry
        free_entry = place
      end if
    end if
    call unlock(handle_table)
    if (.not. associated(slot)) return
    if (associated(slot%operator)) deallocate (slot%operator)
    if (associated(slot%solver)) deallocate (slot%solver)
    if (associated(slot%state)) deallocate (slot%state)
    if (associated(slot%wear)) deallocate (slot%wear)
    deallocate (slot)
  end subroutine free_object

  !> Free the slip of the last step in a state, from which no step starts; a stale handle is ignored.
  subroutine free_slip(handle)
    !> Handle of the state
    integer(c_int64_t), intent(in) :: handle
    type(slot_t), pointer :: slot

    slot => slot_of(handle)
    if (.not. associated(slot)) return
    if (.not. associated(slot%state)) return
    if (allocated(slot%state%slip_increment)) deallocate (slot%state%slip_increment)
  end subroutine free_slip

  !> Look up an operator or a problem and mark it as in use. The ranks that share it call this together to work with it, and all
  !> of them fail, or none.
  subroutine enter(handle, kind, extent, slot, error)
    !> Its handle
    integer(c_int64_t), intent(in) :: handle
    !> Name of its kind in procedures.toml
    character(len=*), intent(in) :: kind
    !> Number of columns and rows of the arrays
    integer, intent(in) :: extent(2)
    !> The object
    type(slot_t), pointer, intent(out) :: slot
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    logical :: busy, fits
    integer :: place

    slot => null()
    busy = .false.
    fits = .false.
    call lock(handle_table)
    place = place_of(handle)
    if (place > 0) then
      slot => entries(place)%slot
      busy = slot%busy
      if (kind == 'operator') fits = associated(slot%operator)
      if (kind == 'problem') fits = associated(slot%solver)
      if (kind == 'pressed') fits = associated(slot%solver) .and. .not. associated(slot%sheared)
      if (kind == 'sheared') fits = associated(slot%sheared)
      if (fits) slot%busy = .true.
    end if
    call unlock(handle_table)
    if (place == 0) then
      call raise(error, status%bad_handle, 'the handle is stale: its object has been freed')
    else if (.not. fits) then
      call raise(error, status%bad_handle, 'the handle is that of another object')
    else if (busy) then
      call raise(error, status%bad_handle, 'the object is at work in another thread')
    else
      if (any(slot%extent /= extent)) then
        call raise(error, status%invalid_input, 'the arrays do not have the shape of the lattice window')
      else if (kind /= 'problem') then
        call require_memory(slot%working, error, slot%space%threads)
      end if
      if (kind /= 'problem') call slot%ranks%agree(error)
      if (allocated(error)) call leave(slot)
    end if
  end subroutine enter

  !> Mark an object as free.
  subroutine leave(slot)
    !> The object
    type(slot_t), pointer, intent(in) :: slot

    call lock(handle_table)
    slot%busy = .false.
    call unlock(handle_table)
  end subroutine leave

  !> Give a state a handle; on failure it is freed.
  subroutine hold(state, handle, error)
    !> The state
    type(contact_state_t), pointer, intent(inout) :: state
    !> Its handle, 0 on failure
    integer(c_int64_t), intent(out) :: handle
    !> Allocated on failure, of its solution, too
    type(error_t), allocatable, intent(inout) :: error
    type(slot_t), pointer :: slot

    handle = 0
    if (.not. allocated(error)) call take_slot(slot, handle, error)
    if (allocated(error)) then
      deallocate (state)
    else
      slot%state => state
    end if
  end subroutine hold

  !> Return the slot of a handle, which other threads may use; null if it is stale.
  function slot_of(handle) result(slot)
    integer(c_int64_t), intent(in) :: handle
    type(slot_t), pointer :: slot
    integer :: place

    slot => null()
    call lock(handle_table)
    place = place_of(handle)
    if (place > 0) slot => entries(place)%slot
    call unlock(handle_table)
  end function slot_of

  !> Find the state, or the path through cycles of wear, of a handle.
  subroutine find(handle, kind, slot, error, extent)
    !> Its handle
    integer(c_int64_t), intent(in) :: handle
    !> `state` or `path`
    character(len=*), intent(in) :: kind
    !> Its slot
    type(slot_t), pointer, intent(out) :: slot
    !> Allocated if the handle is stale, or the state is that of another window
    type(error_t), allocatable, intent(out) :: error
    !> Number of columns and rows of the window of the state
    integer, intent(in), optional :: extent(2)
    logical :: fits

    slot => slot_of(handle)
    fits = associated(slot)
    if (fits) fits = merge(associated(slot%state), associated(slot%wear), kind == 'state')
    if (fits .and. present(extent)) fits = all(shape(slot%state%pressure) == extent)
    if (.not. fits) call raise(error, status%bad_handle, 'the handle is stale: its '//kind//' has been freed')
  end subroutine find

  !> Make two bodies from their numbers: three compliances; or Young's modulus, Poisson's ratio and 1 if it is rigid of each, the
  !> numbers of their coatings, and thickness, Young's modulus and Poisson's ratio of each of these, outermost first.
  subroutine bodies_of(constants, bodies, error)
    real(c_double), intent(in) :: constants(:)
    class(elastic_medium_t), allocatable, intent(out) :: bodies
    !> Allocated on failure: constants of no body
    type(error_t), allocatable, intent(out) :: error
    type(layered_pair_t), allocatable :: layered

    if (size(constants) == 3) then
      allocate (bodies, source=elastic_pair_t(constants(1), constants(2), constants(3)))
    else
      allocate (layered)
      call make_layered(constants, layered, error)
      call move_alloc(layered, bodies)
    end if
  end subroutine bodies_of

  !> Make bodies with coatings from their numbers.
  subroutine make_layered(constants, pair, error)
    real(c_double), intent(in) :: constants(:)
    type(layered_pair_t), intent(out) :: pair
    type(error_t), allocatable, intent(out) :: error
    type(coating_t) :: coating((size(constants) - 8)/3)
    integer :: i, first

    first = nint(constants(7))
    do i = 1, size(coating)
      associate (of => constants(3*i + 6:3*i + 8))
        coating(i) = coating_t(of(1), material_t(of(2), of(3)))
      end associate
    end do
    call new_layered_pair(pair, [(material_t(constants(3*i - 2), constants(3*i - 1), constants(3*i) > 0.5_c_double), i=1, 2)], &
                          coating(:first), coating(first + 1:), error)
  end subroutine make_layered

  !> Add the tangential springs of an interface to two bodies.
  subroutine add_springs(bodies, interface)
    class(elastic_medium_t), intent(inout) :: bodies
    !> Coefficient [Pa/m^m] and exponent m of the normal compliance, tangential stiffness [Pa/m]; 0: no springs
    real(c_double), intent(in) :: interface(3)

    select type (bodies)
    class is (elastic_pair_t)
      if (abs(interface(3)) > 0.0_c_double .or. .not. ieee_is_finite(interface(3))) bodies%tangential_layer = 1/interface(3)
    end select
  end subroutine add_springs

  !> Make a law of friction from its numbers.
  subroutine friction_of(coefficient, law, n_node, friction)
    !> Coefficient of friction, one or that of each node; one that is infinite or huge: no slip
    real(c_double), intent(in) :: coefficient(:)
    !> Bound of the shear traction, infinite or huge: none [Pa]; power of the pressure; ratio of the coefficients along and across,
    !> of which `coefficient` is the geometric mean, and angle of the direction along from x [rad]
    real(c_double), intent(in) :: law(:)
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

  !> Return an error as a code and a message.
  pure subroutine report(error, code, message)
    !> Allocated on failure
    type(error_t), allocatable, intent(in) :: error
    !> Status
    integer(c_int), intent(out) :: code
    !> Message of the error
    character(len=512), intent(out) :: message

    code = status%ok
    message = ''
    if (allocated(error)) then
      code = error%code
      message = error%message
    end if
  end subroutine report

end module hc_f2py_handles
