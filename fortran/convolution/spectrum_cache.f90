!> Spectra of kernels that are kept for problems to come, in memory and, if wanted, in a folder.
!>
!> They are found by everything that they depend on, so that a problem gets the same bits with them as without.
!> Problems share what they find: a spectrum is in memory once. The least recently used ones go first.
!> Several threads may use one cache.
module hc_spectrum_cache
  use, intrinsic :: iso_fortran_env, only: int64
  use hc_lock, only: lock, unlock, kernel_table
  use hc_spectrum, only: kernel_spectrum_t, kernel_key_t, release
  use hc_spectrum_file, only: read_kernels, write_kernels, file_name
  implicit none
  private

  public :: kernel_cache_t

  !> Spectra that may be kept at a time.
  integer, parameter :: n_entry = 512

  !> Spectra that are kept.
  type :: entry_t
    type(kernel_key_t) :: key
    type(kernel_spectrum_t), pointer :: spectrum => null()
    !> When it was last asked for
    integer(int64) :: used = 0
  end type entry_t

  !> The cache; without a bound above zero and without a folder nothing is kept.
  type :: kernel_cache_t
    !> Bytes that are kept in memory at most, and those that are
    integer(int64) :: bound = 0, held = 0
    !> Spectra that were found in memory, found in the folder, and not found
    integer(int64) :: found = 0, read = 0, missed = 0
    !> Bytes that may still be written to the folder
    integer(int64) :: room = 0
    integer(int64), private :: clock = 0, written = 0
    type(entry_t), private :: entry(n_entry)
    !> The folder; what made the spectra; a word for names that nobody else gives
    character(len=:), allocatable, private :: folder, maker, word
    !> Files of other users are taken, too
    logical, private :: shared = .false.
    !> What is wrong with the folder, since it was last asked for
    character(len=:), allocatable, private :: complaint
  contains
    !> Bound the memory
    procedure :: limit
    !> Use a folder, or none
    procedure :: use_folder
    !> Spectra of kernels, held for the caller, or none
    procedure :: find
    !> Keep spectra
    procedure :: keep
    !> What was wrong with the folder
    procedure :: take_complaint
    !> A copy has the bound and begins empty: what two caches had would be freed twice
    generic :: assignment(=) => copy
    procedure, private :: copy
    final :: free
  end type kernel_cache_t

contains

  !> Keep so many bytes in memory at most; what is too much goes.
  subroutine limit(self, bound)
    class(kernel_cache_t), intent(inout) :: self
    !> Bytes; 0: nothing is kept
    integer(int64), intent(in) :: bound

    call lock(kernel_table)
    self%bound = max(bound, 0_int64)
    call make_room(self, 0_int64)
    call unlock(kernel_table)
  end subroutine limit

  !> Keep spectra in a folder, too.
  subroutine use_folder(self, folder, maker, word, room, shared)
    class(kernel_cache_t), intent(inout) :: self
    !> The folder, which is there, with a slash at the end, so that its name may end with a blank; empty: none
    character(len=*), intent(in) :: folder
    !> What the numbers depend on besides the kernels: program, machine
    character(len=*), intent(in) :: maker
    !> A word that no other process has
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

  subroutine find(self, key, spectrum)
    class(kernel_cache_t), intent(inout) :: self
    !> What the kernels depend on
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
      call spectrum%hold()
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
    if (allocated(complaint)) call complain(self, complaint//': the kernels are worked out anew')
    if (associated(spectrum)) then
      self%read = self%read + 1
      call insert(self, key, spectrum)
    else
      self%missed = self%missed + 1
    end if
    call unlock(kernel_table)
  end subroutine find

  subroutine keep(self, key, spectrum)
    class(kernel_cache_t), intent(inout) :: self
    !> What the kernels depend on
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
      ! one complaint is enough
      if (self%room > 0) call complain(self, complaint//': no more kernels are kept in the folder')
      self%room = 0
    end if
    call unlock(kernel_table)
  end subroutine keep

  !> What was wrong since this was last asked; empty: nothing.
  subroutine take_complaint(self, complaint)
    class(kernel_cache_t), intent(inout) :: self
    !> Sentences, one a line
    character(len=:), allocatable, intent(out) :: complaint

    complaint = ''
    call lock(kernel_table)
    if (allocated(self%complaint)) then
      call move_alloc(self%complaint, complaint)
    end if
    call unlock(kernel_table)
  end subroutine take_complaint

  subroutine copy(self, other)
    class(kernel_cache_t), intent(inout) :: self
    type(kernel_cache_t), intent(in) :: other

    call free(self)
    self%held = 0
    self%bound = other%bound
  end subroutine copy

  !> Spectra that a problem uses stay until it is gone.
  subroutine free(self)
    type(kernel_cache_t), intent(inout) :: self
    integer :: i

    do i = 1, n_entry
      call release(self%entry(i)%spectrum)
    end do
  end subroutine free

  ! What follows is called by the one thread that has the cache.

  !> Where spectra are kept; 0: nowhere.
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

  subroutine touch(self, i)
    class(kernel_cache_t), intent(inout) :: self
    integer, intent(in) :: i

    self%clock = self%clock + 1
    self%entry(i)%used = self%clock
  end subroutine touch

  !> Take spectra to those in memory, unless there are some or they are too large.
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
      call spectrum%hold()
      call touch(self, i)
      self%held = self%held + spectrum%bytes()
      return
    end do
  end subroutine insert

  !> Drop what was not used for longest until there is an empty place and so many bytes fit.
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
      if (k == 0 .or. (k < n_entry .and. self%held + bytes <= self%bound)) return
      self%held = self%held - self%entry(oldest)%spectrum%bytes()
      call release(self%entry(oldest)%spectrum)
    end do
  end subroutine make_room

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
