!> Cache of the spectra of kernels, in memory and, on request, in a folder.
!>
!> The key of a spectrum is everything that it depends on, so that a problem gets the same bits with the cache as without.
!> Problems share spectra: each is in memory once. The least recently used ones are dropped first.
!> Several threads may use one cache.
module hc_spectrum_cache
  use, intrinsic :: iso_fortran_env, only: int64
  use hc_lock, only: lock, unlock, kernel_table
  use hc_spectrum, only: kernel_spectrum_t, kernel_key_t, release
  use hc_spectrum_file, only: read_kernels, write_kernels, file_name
  implicit none
  private

  public :: kernel_cache_t

  !> Largest number of spectra.
  integer, parameter :: n_entry = 512

  !> Spectrum with its key.
  type :: entry_t
    type(kernel_key_t) :: key
    type(kernel_spectrum_t), pointer :: spectrum => null()
    !> When it was last used
    integer(int64) :: used = 0
  end type entry_t

  !> The cache; empty without a bound above zero and without a folder.
  type :: kernel_cache_t
    !> Largest number of bytes in memory, and that in use
    integer(int64) :: bound = 0, stored = 0
    !> Spectra that were found in memory, found in the folder, and not found
    integer(int64) :: found = 0, read = 0, missed = 0
    !> Bytes that may still be written to the folder
    integer(int64) :: room = 0
    integer(int64), private :: clock = 0, written = 0
    type(entry_t), private :: entry(n_entry)
    !> The folder; program and machine; a word for unique names of files
    character(len=:), allocatable, private :: folder, maker, word
    !> Files of other users are taken, too
    logical, private :: shared = .false.
    !> Fault of the folder since it was last returned
    character(len=:), allocatable, private :: complaint
  contains
    !> Bound the memory
    procedure :: limit
    !> Use a folder, or none
    procedure :: use_folder
    !> Look up spectra; the caller releases them
    procedure :: find
    !> Store spectra
    procedure :: store
    !> Return whether so many bytes of spectra can be stored together
    procedure :: holds
    !> Return the fault of the folder
    procedure :: fetch_message
    !> Copy the bound alone: spectra of two caches would be freed twice
    generic :: assignment(=) => copy
    procedure, private :: copy
    final :: free
  end type kernel_cache_t

contains

  !> Limit the memory of the cache; spectra beyond it are dropped.
  subroutine limit(self, bound)
    class(kernel_cache_t), intent(inout) :: self
    !> Bytes; 0: no cache in memory
    integer(int64), intent(in) :: bound

    call lock(kernel_table)
    self%bound = max(bound, 0_int64)
    call make_room(self, 0_int64)
    call unlock(kernel_table)
  end subroutine limit

  !> Store spectra in a folder, too.
  subroutine use_folder(self, folder, maker, word, room, shared)
    class(kernel_cache_t), intent(inout) :: self
    !> Existing folder, with a slash at the end, so that its name may end with a blank; empty: none
    character(len=*), intent(in) :: folder
    !> Identity of the program and the machine
    character(len=*), intent(in) :: maker
    !> Word of this process alone
    character(len=*), intent(in) :: word
    !> Bytes that may be written
    integer(int64), intent(in) :: room
    !> Take files that other users may have written
    logical, intent(in) :: shared

    call lock(kernel_table)
    if (allocated(self%folder)) deallocate (self%folder)
    if (len_trim(folder) > 0) self%folder = trim(folder)
    self%maker = trim(maker)
    self%word = trim(word)
    self%room = room
    self%shared = shared
    call unlock(kernel_table)
  end subroutine use_folder

  !> Look up spectra in memory, then in the folder.
  subroutine find(self, key, spectrum)
    class(kernel_cache_t), intent(inout) :: self
    !> Parameters of the kernels
    type(kernel_key_t), intent(in) :: key
    !> The spectra, to be released by the caller; not associated: they have to be made
    type(kernel_spectrum_t), pointer, intent(out) :: spectrum
    character(len=:), allocatable :: path, maker, complaint
    logical :: shared
    integer :: i

    spectrum => null()
    call lock(kernel_table)
    i = place_of(self, key)
    if (i > 0) then
      spectrum => self%entry(i)%spectrum
      call spectrum%retain()
      call touch(self, i)
      self%found = self%found + 1
    else if (allocated(self%folder)) then
      maker = self%maker
      shared = self%shared
      path = self%folder//file_name(key, maker)
    end if
    call unlock(kernel_table)
    if (associated(spectrum)) return
    if (allocated(path)) call read_kernels(path, key, maker, shared, spectrum, complaint)
    call lock(kernel_table)
    if (allocated(complaint)) call complain(self, complaint//': the kernels are computed again')
    if (associated(spectrum)) then
      self%read = self%read + 1
      call insert(self, key, spectrum)
    else
      self%missed = self%missed + 1
    end if
    call unlock(kernel_table)
  end subroutine find

  !> Store spectra in memory and in the folder.
  subroutine store(self, key, spectrum)
    class(kernel_cache_t), intent(inout) :: self
    !> Parameters of the kernels
    type(kernel_key_t), intent(in) :: key
    !> The spectra, which do not change any more
    type(kernel_spectrum_t), pointer, intent(in) :: spectrum
    character(len=:), allocatable :: path, maker, word, complaint
    character(len=20) :: number
    integer(int64) :: bytes

    call lock(kernel_table)
    call insert(self, key, spectrum)
    if (allocated(self%folder) .and. spectrum%bytes() <= self%room) then
      maker = self%maker
      path = self%folder//file_name(key, maker)
      self%written = self%written + 1
      write (number, '(i0)') self%written
      word = self%word//'-'//trim(number)
    end if
    call unlock(kernel_table)
    if (.not. allocated(path)) return
    call write_kernels(path, key, maker, spectrum, word, bytes, complaint)
    call lock(kernel_table)
    self%room = self%room - bytes
    if (allocated(complaint)) then
      ! a single complaint
      if (self%room > 0) call complain(self, complaint//': no more kernels are kept in the folder')
      self%room = 0
    end if
    call unlock(kernel_table)
  end subroutine store

  !> Return the fault since the last call; empty: none.
  subroutine fetch_message(self, complaint)
    class(kernel_cache_t), intent(inout) :: self
    !> Sentences, one a line
    character(len=:), allocatable, intent(out) :: complaint

    complaint = ''
    call lock(kernel_table)
    if (allocated(self%complaint)) then
      call move_alloc(self%complaint, complaint)
    end if
    call unlock(kernel_table)
  end subroutine fetch_message

  !> Share the spectra of another cache.
  subroutine copy(self, other)
    class(kernel_cache_t), intent(inout) :: self
    type(kernel_cache_t), intent(in) :: other

    call free(self)
    self%stored = 0
    self%bound = other%bound
  end subroutine copy

  !> Free the cache; spectra that a problem uses stay until it is freed.
  subroutine free(self)
    type(kernel_cache_t), intent(inout) :: self
    integer :: i

    do i = 1, n_entry
      call release(self%entry(i)%spectrum)
    end do
  end subroutine free

  ! The following procedures are called by the one thread that has locked the cache.

  !> Return the place of spectra in the list; 0: there are none.
  pure integer function place_of(self, key)
    class(kernel_cache_t), intent(in) :: self
    type(kernel_key_t), intent(in) :: key
    integer :: i

    place_of = 0
    do i = 1, n_entry
      if (.not. associated(self%entry(i)%spectrum)) cycle
      if (self%entry(i)%key%is_same(key)) place_of = i
    end do
  end function place_of

  !> Return whether so many bytes of spectra can be stored together, in memory or in a folder.
  pure logical function holds(self, bytes)
    class(kernel_cache_t), intent(in) :: self
    integer(int64), intent(in) :: bytes

    holds = bytes <= self%bound .or. allocated(self%folder)
  end function holds

  !> Mark spectra as used last.
  subroutine touch(self, i)
    class(kernel_cache_t), intent(inout) :: self
    integer, intent(in) :: i

    self%clock = self%clock + 1
    self%entry(i)%used = self%clock
  end subroutine touch

  !> Add spectra to those in memory, unless they are there or too large.
  subroutine insert(self, key, spectrum)
    class(kernel_cache_t), intent(inout) :: self
    type(kernel_key_t), intent(in) :: key
    type(kernel_spectrum_t), pointer, intent(in) :: spectrum
    integer :: i

    if (spectrum%bytes() > self%bound .or. place_of(self, key) > 0) return
    call make_room(self, spectrum%bytes())
    do i = 1, n_entry
      if (associated(self%entry(i)%spectrum)) cycle
      self%entry(i)%key = key
      self%entry(i)%spectrum => spectrum
      call spectrum%retain()
      call touch(self, i)
      self%stored = self%stored + spectrum%bytes()
      return
    end do
  end subroutine insert

  !> Drop the least recently used spectra until there is an empty place and as many bytes fit.
  subroutine make_room(self, bytes)
    class(kernel_cache_t), intent(inout) :: self
    integer(int64), intent(in) :: bytes
    integer :: i, k, oldest

    do
      oldest = 0
      k = 0
      do i = 1, n_entry
        if (.not. associated(self%entry(i)%spectrum)) cycle
        k = k + 1
        if (oldest == 0) oldest = i
        if (self%entry(i)%used < self%entry(oldest)%used) oldest = i
      end do
      if (k == 0 .or. (k < n_entry .and. self%stored + bytes <= self%bound)) return
      self%stored = self%stored - self%entry(oldest)%spectrum%bytes()
      call release(self%entry(oldest)%spectrum)
    end do
  end subroutine make_room

  !> Record a fault of the folder.
  subroutine complain(self, complaint)
    class(kernel_cache_t), intent(inout) :: self
    character(len=*), intent(in) :: complaint

    if (allocated(self%complaint)) then
      self%complaint = self%complaint//new_line('a')//complaint
    else
      self%complaint = complaint
    end if
  end subroutine complain

end module hc_spectrum_cache
