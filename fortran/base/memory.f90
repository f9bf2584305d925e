!> Check of the memory before work begins.
!>
!> An array of the compiler's own making, a thread, or a plan of FFTW for which there is no memory ends the whole
!> program. So the library checks first whether the system grants all that the work may take; a limit on the address
!> space (`ulimit -v`), or a machine without overcommitment, then leads to an error.
module hc_memory
  use, intrinsic :: iso_c_binding, only: c_size_t, c_int
  use, intrinsic :: iso_fortran_env, only: int64
  use hc_error, only: error_t, status, raise
  implicit none
  private

  public :: require_memory, give_back

  !> Bytes that do not depend on the window: plans, lists, messages.
  integer(int64), parameter :: margin = 8000000

  !> Values of a vector from which holes between vectors are worth the time of the system.
  integer, parameter :: worth_giving = 500000

  interface
    !> Return memory that is free to the system
    subroutine return_free() bind(c, name='hexcontact_give_back')
    end subroutine return_free

    !> Return 1 if the system grants as many bytes, else 0
    integer(c_int) function can_map(bytes) bind(c, name='hexcontact_can_map')
      import :: c_size_t, c_int
      integer(c_size_t), value :: bytes
    end function can_map

    !> Return the bytes of the stack of a thread
    integer(c_size_t) function stack_size() bind(c, name='hexcontact_stack_size')
      import :: c_size_t
    end function stack_size
  end interface

contains

  !> Refuse work for which there is no memory. Nothing is touched, so that it costs no more than a call of the system.
  subroutine require_memory(bytes, error, threads)
    !> Bytes that the work takes at most
    integer(int64), intent(in) :: bytes
    !> Allocated if the system does not grant them
    type(error_t), allocatable, intent(out) :: error
    !> Threads that may have to be started
    integer, intent(in), optional :: threads
    integer(int64) :: needed
    character(len=16) :: megabytes

    needed = bytes + margin
    if (present(threads)) needed = needed + max(threads - 1, 0)*int(stack_size(), int64)
    if (can_map(int(needed, c_size_t)) /= 0) return
    write (megabytes, '(i0)') needed/1000000 + 1
    call raise(error, status%resources, 'not enough memory: '//trim(megabytes)//' MB more are needed; '// &
               'choose a smaller window')
  end subroutine require_memory

  !> Return free memory between the fields of a large problem, once a solver has its vectors: others that come do not fit
  !> into the holes, which would stay.
  subroutine give_back(n)
    !> Values of a vector
    integer, intent(in) :: n

    if (n >= worth_giving) call return_free()
  end subroutine give_back

end module hc_memory
