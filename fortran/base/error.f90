!> How the library reports failure: it never stops and never prints.
!>
!> Every public procedure that can fail ends its argument list with
!> `type(error_t), allocatable, intent(out) :: error`. Allocated means failed,
!> and the caller returns at once:
!>
!>     call do_something(x, error)
!>     if (allocated(error)) return
module hc_error
  implicit none
  private

  public :: error_t, status, raise

  !> Named status codes; compare names, not numbers.
  type :: status_t
    !> No failure.
    integer :: ok = 0
    !> An argument is outside its meaning (shape, sign, not finite, ...).
    integer :: invalid_input = 1
    !> An iteration ended without meeting its tolerance.
    integer :: no_convergence = 2
    !> Memory, or a limit of a library that is called, does not suffice.
    integer :: resources = 3
    !> A handle that is stale, unknown or in use by another thread.
    integer :: bad_handle = 4
  end type status_t

  !> The one instance of the status codes.
  type(status_t), parameter :: status = status_t()

  !> A failure.
  type :: error_t
    !> One of the codes of `status`.
    integer :: code = 0
    !> One sentence: the fault, and the expected value.
    character(len=:), allocatable :: message
  end type error_t

contains

  !> Allocate an error; the caller returns after it.
  pure subroutine raise(error, code, message)
    !> Error to be set
    type(error_t), allocatable, intent(out) :: error
    !> One of the codes of `status`
    integer, intent(in) :: code
    !> Fault, and expected value
    character(len=*), intent(in) :: message

    allocate (error)
    error%code = code
    error%message = message
  end subroutine raise

end module hc_error
