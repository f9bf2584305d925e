!> Memory that several transforms share, of which only one runs at a time.
module hc_scratch
  use, intrinsic :: iso_c_binding, only: c_ptr, c_loc
  use, intrinsic :: iso_fortran_env, only: int64
  use hc_precision, only: wp
  implicit none
  private

  public :: scratch_t, release_scratch

  !> As much memory as the largest of its users needs, with a count of them; the last one frees it.
  type :: scratch_t
    private
    !> Starts at 0: an empty part at the end needs an address, too
    real(wp), allocatable :: values(:)
    !> Numbers that there should be
    integer(int64) :: wanted = 0
    integer :: users = 0
  contains
    !> Add a user that needs a number of bytes
    procedure :: reserve
    !> Free the memory while nobody works; take it again before
    procedure :: free, take
    !> Address of the memory, whose contents are those of the last user
    procedure :: place
  end type scratch_t

contains

  !> Add a user that needs a number of bytes; the content is lost.
  subroutine reserve(self, bytes, stat)
    class(scratch_t), intent(inout) :: self
    integer(int64), intent(in) :: bytes
    !> Not zero: there is not enough memory
    integer, intent(out) :: stat
    integer(int64) :: n

    self%users = self%users + 1
    n = (bytes + storage_size(1.0_wp)/8 - 1)/(storage_size(1.0_wp)/8)
    self%wanted = max(self%wanted, n)
    call self%take(stat)
  end subroutine reserve

  !> Take the memory that the users need.
  subroutine take(self, stat)
    class(scratch_t), intent(inout) :: self
    !> Not zero: there is not enough memory
    integer, intent(out) :: stat

    stat = 0
    if (allocated(self%values)) then
      if (size(self%values, kind=int64) > self%wanted) return
      deallocate (self%values)
    end if
    allocate (self%values(0:self%wanted), stat=stat)
    if (stat == 0) self%values = 0.0_wp
  end subroutine take

  !> Free the memory.
  subroutine free(self)
    class(scratch_t), intent(inout) :: self

    if (allocated(self%values)) deallocate (self%values)
  end subroutine free

  !> Return the address of the memory, from a number on.
  type(c_ptr) function place(self, after)
    class(scratch_t), intent(in), target :: self
    !> Numbers of eight bytes before it; absent: none
    integer(int64), intent(in), optional :: after

    if (present(after)) then
      place = c_loc(self%values(after))
    else
      place = c_loc(self%values)
    end if
  end function place

  !> Count one user less.
  subroutine release_scratch(scratch)
    !> Memory of the caller; not associated afterwards
    type(scratch_t), pointer, intent(inout) :: scratch

    if (.not. associated(scratch)) return
    scratch%users = scratch%users - 1
    if (scratch%users == 0) deallocate (scratch)
    scratch => null()
  end subroutine release_scratch

end module hc_scratch
