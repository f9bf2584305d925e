!> Operators, contact problems and states for Python: set-up, with checks of memory, and fields of states.
module hc_f2py_problems
  use, intrinsic :: iso_c_binding, only: c_int64_t, c_intptr_t, c_loc
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_memory, only: require_memory
  use hc_f2py_handles, only: slot_t, take_slot, free_object, hold, kernel_cache, ranks
  use hc_communicator, only: communicator_t
  use hc_lattice, only: lattice_t
  use hc_field_space, only: field_space_t, space_over, most_threads
  use hc_elastic_medium, only: elastic_medium_t
  use hc_flexibility, only: check_operator
  use hc_flexibility_dense, only: dense_flexibility_t, new_dense_flexibility
  use hc_flexibility_fft, only: fft_flexibility_t, new_fft_flexibility, fft_memory, fft_setup_memory, spectra_of
  use hc_friction_law, only: friction_law_t
  use hc_normal_law, only: normal_law_t
  use hc_contact_state, only: contact_state_t, allocate_fields, field_of, n_load
  use hc_contact_problem, only: friction_problem_t, new_friction_problem
  use hc_contact_solver, only: friction_solver_t
  use hc_normal_contact, only: normal_contact_t, new_normal_contact, normal_contact_memory
  use hc_direct_contact, only: direct_contact_t, new_direct_contact
  use hc_subwindow_solver, only: windowed_friction_t, new_windowed_friction, windowed_friction_memory
  use hc_direct_friction, only: direct_friction_t, new_direct_friction
  use hc_wear_ahead, only: energy_ahead_memory
  implicit none
  private

  public :: new_operator, new_problem, solver_options_t, secure_fields, entry_fields, wear_fields
  public :: new_held_state, find_field

  !> Methods: FFT; explicit matrices and LAPACK with the iteration of the dissertation; any other number: with Newton's.
  integer, parameter :: fft_based = 1, as_written = 2
  !> Bytes by node of fields of the direct method; its matrices are checked where they are allocated
  integer(c_int64_t), parameter :: dense_fields = 500
  !> Fields that the entry of nodes takes, and those of a cycle of wear with its states
  integer, parameter :: entry_fields = 45, wear_fields = 60

  !> How a problem is solved.
  type :: solver_options_t
    !> All ranks call its procedures together, each with its rows of the arrays or all with all of them
    logical :: shared = .false.
    integer :: threads = 0
    !> Shear tractions do not move the pressure
    logical :: goodman = .false.
  end type solver_options_t

contains

  !> Take a slot with its window, and refuse a problem for which there is no memory.
  subroutine take_window(lattice, n_own, shared, bytes, threads, slot, handle, error)
    type(lattice_t), intent(in) :: lattice
    !> Rows of the arrays: all, or those of this rank
    integer, intent(in) :: n_own
    !> All ranks call this together
    logical, intent(in) :: shared
    !> Memory of the problem on one rank, that of solving it included
    integer(c_int64_t), intent(in) :: bytes
    integer, intent(in) :: threads
    type(slot_t), pointer, intent(out) :: slot
    integer(c_int64_t), intent(out) :: handle
    !> Allocated on failure, on all ranks that share the problem
    type(error_t), allocatable, intent(out) :: error
    type(communicator_t) :: together
    integer(c_int64_t) :: needed

    if (shared) together = ranks
    call take_slot(slot, handle, error)
    if (.not. allocated(error)) then
      slot%lattice = lattice
      slot%extent = [lattice%extent(1), n_own]
      slot%ranks = together
      ! the constructors refuse another number
      if (threads >= 0 .and. threads <= most_threads) then
        slot%space = space_over(lattice%extent, threads)
        if (n_own < lattice%extent(2)) slot%space%ranks = together%over(lattice%extent)
        needed = bytes/slot%space%ranks%size*together%on_node
        ! a fifth at least, mostly a quarter, are operators and fields of the problem itself
        slot%working = 4*needed/5
        call require_memory(needed, error, slot%space%threads)
      end if
    end if
    call together%agree(error)
  end subroutine take_window

  !> Create a flexibility operator over a window.
  subroutine new_operator(method, lattice, bodies, n_own, threads, handle, error)
    integer, intent(in) :: method, threads
    type(lattice_t), intent(in) :: lattice
    class(elastic_medium_t), intent(in) :: bodies
    !> Rows of the arrays: all, or those of this rank; then all ranks call this
    integer, intent(in) :: n_own
    !> Handle of the operator
    integer(c_int64_t), intent(out) :: handle
    !> Allocated on failure, on all ranks that share the operator
    type(error_t), allocatable, intent(out) :: error
    type(slot_t), pointer :: slot
    type(field_space_t) :: space
    type(dense_flexibility_t), pointer :: dense
    type(fft_flexibility_t), pointer :: fft
    integer(c_int64_t) :: bytes

    space = space_over(lattice%extent, threads)
    bytes = dense_fields*lattice%size()
    if (method == fft_based) bytes = fft_setup_memory(lattice%extent, spectra_of(bodies)) &
                                     + fft_memory(lattice%extent, .false., space%threads, spectra_of(bodies), &
                                                  periodic=lattice%is_periodic())
    call take_window(lattice, n_own, n_own < lattice%extent(2), bytes, threads, slot, handle, error)
    if (.not. allocated(error)) call check_operator(lattice, bodies, error, threads)
    if (.not. allocated(error)) then
      if (method == fft_based) then
        allocate (fft)
        slot%operator => fft
        call new_fft_flexibility(fft, slot%lattice, bodies, error, space=slot%space, cache=kernel_cache)
      else
        allocate (dense)
        slot%operator => dense
        call new_dense_flexibility(dense, slot%lattice, bodies, error)
      end if
    end if
    if (allocated(error)) call free_object(handle)
  end subroutine new_operator

  !> Create a contact problem, with friction or without.
  subroutine new_problem(method, lattice, bodies, gap, candidate, law, options, handle, error, friction)
    integer, intent(in) :: method
    type(lattice_t), intent(in) :: lattice
    class(elastic_medium_t), intent(in) :: bodies
    !> Gap before loading (n_col, n_row or own rows) [m]
    real(wp), intent(in) :: gap(:, :)
    !> Nodes that may come into contact (n_col, n_row or own rows)
    logical, intent(in) :: candidate(:, :)
    class(normal_law_t), intent(in) :: law
    type(solver_options_t), intent(in) :: options
    !> Handle of the problem
    integer(c_int64_t), intent(out) :: handle
    !> Allocated on failure, on all ranks that share the problem
    type(error_t), allocatable, intent(out) :: error
    !> Absent: none
    class(friction_law_t), intent(in), optional :: friction
    type(slot_t), pointer :: slot
    type(friction_problem_t) :: problem
    type(direct_contact_t), pointer :: dense_pressed
    type(normal_contact_t), pointer :: pressed
    type(direct_friction_t), pointer :: dense_sheared
    type(windowed_friction_t), pointer :: sheared
    type(field_space_t) :: space
    integer(c_int64_t) :: bytes

    space = space_over(lattice%extent, options%threads)
    bytes = dense_fields*lattice%size()
    if (method == fft_based .and. present(friction)) then
      ! of the largest contact there can be, with all loads prescribed
      bytes = windowed_friction_memory(lattice%extent, lattice%size(), n_load, .not. options%goodman, space%threads, &
                                       spectra_of(bodies), lattice%is_periodic())
    else if (method == fft_based) then
      bytes = normal_contact_memory(lattice%extent, space%threads, lattice%is_periodic())
    end if
    call take_window(lattice, size(gap, 2), options%shared, bytes, options%threads, slot, handle, error)
    if (present(friction) .and. .not. allocated(error)) then
      space%ranks = slot%space%ranks
      call new_friction_problem(problem, lattice, bodies, gap, candidate, friction, options%goodman, error, law, space)
      call slot%ranks%agree(error)
    end if
    if (allocated(error)) then
      call free_object(handle)
      return
    end if
    if (present(friction) .and. method == fft_based) then
      allocate (sheared)
      slot%sheared => sheared
      call new_windowed_friction(sheared, problem, error, options%threads, kernel_cache, slot%ranks)
      call slot%ranks%agree(error)
    else if (present(friction)) then
      allocate (dense_sheared)
      slot%sheared => dense_sheared
      problem%options%direct%as_written = method == as_written
      call new_direct_friction(dense_sheared, problem, error)
    else if (method == fft_based) then
      allocate (pressed)
      slot%solver => pressed
      call new_normal_contact(pressed, slot%lattice, bodies, gap, candidate, error, options%threads, kernel_cache, law=law, &
                              ranks=slot%space%ranks)
    else
      allocate (dense_pressed)
      slot%solver => dense_pressed
      call new_direct_contact(dense_pressed, slot%lattice, bodies, gap, candidate, error, law=law)
    end if
    if (present(friction)) slot%solver => slot%sheared
    if (allocated(error)) call free_object(handle)
  end subroutine new_problem

  !> Refuse a load step if there is no memory for further fields beside the solution.
  subroutine secure_fields(slot, n_field, error, ahead)
    type(slot_t), intent(in) :: slot
    !> Number of fields
    integer, intent(in) :: n_field
    type(error_t), allocatable, intent(out) :: error
    !> The pressure after a jump of wear is solved for, too
    logical, intent(in), optional :: ahead
    integer(c_int64_t) :: bytes

    bytes = int(n_field, c_int64_t)*8*product(slot%extent)
    if (present(ahead)) bytes = bytes + energy_ahead_memory(slot%lattice%extent, slot%space%threads)/slot%space%ranks%size
    call require_memory(slot%working + bytes*slot%ranks%on_node, error, slot%space%threads)
    call slot%ranks%agree(error)
  end subroutine secure_fields

  !> Make a state with some numbers, and fields that are not set.
  subroutine new_held_state(numbers, extent, handle, error)
    !> State without fields
    type(contact_state_t), intent(in) :: numbers
    integer, intent(in) :: extent(2)
    !> Handle of the state
    integer(c_int64_t), intent(out) :: handle
    type(error_t), allocatable, intent(out) :: error
    type(contact_state_t), pointer :: state

    allocate (state, source=numbers)
    call allocate_fields(state, extent, error)
    call hold(state, handle, error)
  end subroutine new_held_state

  !> Return the address of a field of a state, by its name in hexcontact.variables.
  subroutine find_field(state, name, place, error)
    type(contact_state_t), intent(in), target :: state
    character(len=*), intent(in) :: name
    integer(c_int64_t), intent(out) :: place
    type(error_t), allocatable, intent(out) :: error
    real(wp), pointer, contiguous :: field(:, :)

    place = 0
    if (name == 'zone') then
      if (allocated(state%zone)) place = transfer(c_loc(state%zone), 0_c_intptr_t)
    else
      field => field_of(state, name)
      if (associated(field)) place = transfer(c_loc(field), 0_c_intptr_t)
    end if
    if (place == 0) call raise(error, status%bad_handle, 'the state has no field '//name)
  end subroutine find_field

end module hc_f2py_problems
