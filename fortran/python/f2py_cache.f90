!> Cache of the spectra of kernels for Python: flat procedures for f2py.
module hc_f2py_cache
  use iso_c_binding, only: c_int, c_int64_t
  use hc_f2py_handles, only: kernel_cache
  implicit none
  private

  public :: limit_kernels, use_kernel_folder, kernel_statistics, kernel_message

contains

  !> Limit the bytes of spectra in memory.
  subroutine limit_kernels(bound)
    !> Bytes; 0: no cache in memory
    integer(c_int64_t), intent(in) :: bound

    if (.not. associated(kernel_cache)) allocate (kernel_cache)
    call kernel_cache%limit(bound)
  end subroutine limit_kernels

  !> Store spectra in a folder, too.
  subroutine use_kernel_folder(folder, maker, word, room, shared)
    !> Existing folder; empty: none
    character(len=*), intent(in) :: folder
    !> Program and machine
    character(len=*), intent(in) :: maker
    !> A word that no other process has
    character(len=*), intent(in) :: word
    !> Bytes that may be written
    integer(c_int64_t), intent(in) :: room
    !> Not zero: take files that other users may have written
    integer(c_int), intent(in) :: shared

    if (.not. associated(kernel_cache)) allocate (kernel_cache)
    call kernel_cache%use_folder(folder, maker, word, room, shared /= 0)
  end subroutine use_kernel_folder

  !> Return counts of the cache.
  subroutine kernel_statistics(numbers)
    !> Bytes in memory; spectra found in memory, found in the folder, not found
    integer(c_int64_t), intent(out) :: numbers(4)

    numbers = 0
    if (.not. associated(kernel_cache)) return
    numbers = [kernel_cache%stored, kernel_cache%found, kernel_cache%read, kernel_cache%missed]
  end subroutine kernel_statistics

  !> Return the fault of the folder since the last call.
  subroutine kernel_message(complaint)
    !> Sentences, one a line; empty: nothing
    character(len=2048), intent(out) :: complaint

    character(len=:), allocatable :: sentences

    complaint = ''
    if (.not. associated(kernel_cache)) return
    call kernel_cache%fetch_message(sentences)
    complaint = sentences
  end subroutine kernel_message

end module hc_f2py_cache
