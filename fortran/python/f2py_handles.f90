!> The table of objects that Python holds handles of.
!>
!> A handle is a slot number with a generation count, so that a stale handle is
!> an error and never another object. A handle at work in one thread is refused
!> in another. The spectra that all objects share are here, too. This is the one place with module state; it is not part of the
!> Fortran library.
module hc_f2py_handles
  use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
  use hc_error, only: error_t, status, raise
  use hc_lock, only: lock, unlock, handle_table
  use hc_memory, only: require_memory
  use hc_lattice, only: lattice_t
  use hc_field_space, only: field_space_t, most_threads
  use hc_flexibility, only: flexibility_t
  use hc_elastic_pair, only: elastic_pair_t
  use hc_coulomb, only: coulomb_t
  use hc_contact_solver, only: contact_solver_t
  use hc_spectrum_cache, only: kernel_cache_t
  implicit none
  private

  public :: slot_t, kernel_cache, take_slot, check_size, secure, enter, leave, free_slot, report, pair_of, friction_of

  !> Objects that may exist at a time.
  integer, parameter :: n_slot = 4096

  !> What a handle stands for.
  type :: slot_t
    !> Odd while the slot is in use
    integer(c_int64_t) :: generation = 0
    !> At work in some thread
    logical :: busy = .false.
    !> Bytes that work on it may take
    integer(c_int64_t) :: working = 0
    type(lattice_t) :: lattice
    type(field_space_t) :: space
    class(flexibility_t), pointer :: operator => null()
    class(contact_solver_t), pointer :: solver => null()
  end type slot_t

  type(slot_t), target :: slots(n_slot)

  !> Spectra of kernels that all problems share.
  type(kernel_cache_t), pointer :: kernel_cache => null()

contains

  !> Free what a handle stands for; a stale handle is ignored.
  subroutine free_slot(handle)
    !> Handle of an operator or a problem
    integer(c_int64_t), intent(in) :: handle
    logical :: mine

    if (handle < 0) return
    associate (slot => slots(int(modulo(handle, int(n_slot, c_int64_t))) + 1))
      call lock(handle_table)
      ! one that is at work, or being freed, in another thread stays that thread's
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

  !> A free slot of the table, and its handle. An odd generation marks a slot in use.
  subroutine take_slot(slot, handle, error)
    type(slot_t), pointer, intent(out) :: slot
    integer(c_int64_t), intent(out) :: handle
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

  !> Refuse a problem for which there is no memory; say what solving it may take.
  subroutine secure(slot, bytes, n_threads, error)
    type(slot_t), intent(inout) :: slot
    !> Memory of the problem, that of solving it included
    integer(c_int64_t), intent(in) :: bytes
    !> Threads to use; 0: as many as OpenMP would take
    integer(c_int), intent(in) :: n_threads
    type(error_t), allocatable, intent(out) :: error

    ! such a number is refused by what is set up next
    if (n_threads < 0 .or. n_threads > most_threads) then
      slot%space = field_space_t()
      return
    end if
    ! a fifth at least, mostly a quarter, are operators and fields that are there from the beginning on
    slot%working = 4*bytes/5
    call require_memory(bytes, error, slot%space%threads)
  end subroutine secure

  !> Look a handle up and mark it as at work.
  subroutine enter(handle, n_node, slot, error, more)
    integer(c_int64_t), intent(in) :: handle
    integer(c_int), intent(in) :: n_node
    type(slot_t), pointer, intent(out) :: slot
    type(error_t), allocatable, intent(out) :: error
    !> Bytes that the work takes beyond what solving does
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
    type(slot_t), intent(in) :: slot
    integer(c_int), intent(in) :: n_node
    type(error_t), allocatable, intent(out) :: error

    if (slot%lattice%size() /= n_node) then
      call raise(error, status%invalid_input, 'the arrays do not have the shape of the lattice window')
    end if
  end subroutine check_size

  !> Mark a handle as free for work.
  subroutine leave(slot)
    type(slot_t), pointer, intent(in) :: slot

    call lock(handle_table)
    slot%busy = .false.
    call unlock(handle_table)
  end subroutine leave

  !> Elastic constants from a vector.
  pure type(elastic_pair_t) function pair_of(lambda)
    real(c_double), intent(in) :: lambda(3)
    pair_of = elastic_pair_t(lambda(1), lambda(2), lambda(3))
  end function pair_of

  !> A law of friction from its coefficient; an infinite or huge one: no slip.
  pure type(coulomb_t) function friction_of(coefficient) result(friction)
    real(c_double), intent(in) :: coefficient

    friction%no_slip = coefficient > 0.5_c_double*huge(1.0_c_double)
    if (.not. friction%no_slip) friction%coefficient = coefficient
  end function friction_of

  !> An error as a code and a message.
  pure subroutine report(error, code, message)
    type(error_t), allocatable, intent(in) :: error
    integer(c_int), intent(out) :: code
    character(len=*), intent(out) :: message

    code = status%ok
    message = ''
    if (allocated(error)) then
      code = error%code
      message = error%message
    end if
  end subroutine report

end module hc_f2py_handles
