!> Locks of objects that threads share.
!>
!> They are the system's own, since Python's threads are no threads of OpenMP, and a build may be without it.
module hc_lock
  use, intrinsic :: iso_c_binding, only: c_int
  implicit none
  private

  public :: lock, unlock
  public :: fftw_planner, kernel_table, spectrum_users, handle_table

  !> FFTW's planner; the table of a kernel cache; counts of the users of spectra; the table of handles.
  !> A thread with the kernel table may lock the users, too; no other two are locked at once.
  integer(c_int), parameter :: fftw_planner = 0, kernel_table = 1, spectrum_users = 2, handle_table = 3

  interface
    !> Wait until no other thread has the lock, and take it
    subroutine lock(which) bind(c, name='hexcontact_lock')
      import :: c_int
      integer(c_int), value :: which
    end subroutine lock

    !> Release a lock
    subroutine unlock(which) bind(c, name='hexcontact_unlock')
      import :: c_int
      integer(c_int), value :: which
    end subroutine unlock
  end interface

end module hc_lock
