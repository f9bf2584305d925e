!> Spectra of kernels in files: one a file, complete or not there at all.
!>
!> A file is written under another name and renamed; its head says what it holds and who made it, and has a
!> checksum of the values. What is not as expected is not taken.
module hc_kernel_file
  use, intrinsic :: iso_c_binding, only: c_int, c_char, c_null_char, c_ptr, c_null_ptr, c_loc, c_f_pointer
  use, intrinsic :: iso_fortran_env, only: int64
  use hc_precision, only: wp, sp
  use hc_kernel_spectrum, only: kernel_spectrum_t, kernel_key_t, kind_name
  implicit none
  private

  public :: read_kernels, write_kernels, file_name, maker_length

  !> Length of the text that says who made a file.
  integer, parameter :: maker_length = 256
  !> Length of a message of the system.
  integer, parameter :: message_length = 200
  !> Values that the checksum takes at a time.
  integer, parameter :: lanes = 8

  !> The beginning of a file.
  type :: head_t
    sequence
    character(len=24) :: magic = 'hexcontact kernels'
    !> Layout of file and spectra: to be raised whenever one of them changes
    integer(int64) :: layout = 1
    !> What the numbers depend on besides the key: program, machine
    character(len=maker_length) :: maker = ''
    integer(int64) :: key(9) = 0
    !> Bytes of a value, and shape
    integer(int64) :: value_bytes = 0, n(3) = 0
    integer(int64) :: checksum = 0
  end type head_t

  interface
    integer(c_int) function c_rename(from, onto) bind(c, name='rename')
      import :: c_int, c_char
      character(kind=c_char), intent(in) :: from(*), onto(*)
    end function c_rename
  end interface

contains

  !> Name of the file of some kernels; nothing else has the same but by a rare chance, which the head rules out.
  pure function file_name(key, maker) result(name)
    !> What the kernels depend on
    type(kernel_key_t), intent(in) :: key
    !> Program and machine
    character(len=*), intent(in) :: maker
    character(len=:), allocatable :: name
    character(len=64) :: text
    integer(int64) :: word(9 + maker_length/8)

    word(:9) = key%word
    word(10:) = transfer(padded(maker), word, maker_length/8)
    write (text, '(a, "-", i0, "x", i0, "-", z16.16, ".kernels")') trim(kind_name(key%word(1))), key%word(2:3), &
      mixed(word)
    name = trim(text)
  end function file_name

  !> Read spectra; without a complaint if there is no file.
  subroutine read_kernels(path, key, maker, spectrum, complaint)
    !> The file
    character(len=*), intent(in) :: path
    !> What the kernels have to depend on
    type(kernel_key_t), intent(in) :: key
    !> Program and machine
    character(len=*), intent(in) :: maker
    !> The spectra, not associated if they cannot be had
    type(kernel_spectrum_t), pointer, intent(out) :: spectrum
    !> Why a file that is there was not taken
    character(len=:), allocatable, intent(out) :: complaint

    type(head_t) :: head, expected
    integer(int64) :: file_bytes
    integer :: unit, stat
    logical :: there
    character(len=200) :: message

    spectrum => null()
    inquire (file=path, exist=there)
    if (.not. there) return
    open (newunit=unit, file=path, access='stream', form='unformatted', status='old', action='read', iostat=stat, &
          iomsg=message)
    if (stat /= 0) then
      complaint = path//' cannot be read ('//trim(message)//')'
      return
    end if
    complaint = path//' is damaged, or was made by something else'
    read (unit, iostat=stat) head
    inquire (unit, size=file_bytes)
    if (stat == 0) then
      expected%maker = maker
      if (head%magic == expected%magic .and. head%layout == expected%layout .and. head%maker == expected%maker &
          .and. all(head%key == key%word) .and. all(head%n > 0) .and. all(head%n < huge(1)) .and. modulo(head%n(1), 4_int64) == 0 &
          .and. (head%value_bytes == 8 .or. head%value_bytes == 4)) then
        if (file_bytes == storage_size(head)/8 + head%value_bytes*product(head%n)) call take_values()
      end if
    end if
    close (unit, iostat=stat)
    if (stat /= 0) complaint = path//' cannot be closed'

  contains

    subroutine take_values()
      real(wp), pointer, contiguous :: double(:, :, :)
      real(sp), pointer, contiguous :: single(:, :, :)
      integer(int64), pointer, contiguous :: words(:)
      integer :: failed
      logical :: complete

      allocate (spectrum)
      if (head%value_bytes == 8) then
        call spectrum%reserve(int(head%n), double, failed)
      else
        call spectrum%reserve(int(head%n), single, failed)
      end if
      if (failed == 0) then
        words => words_of(spectrum)
        call read_words(unit, size(words, kind=int64), words, complete)
        if (complete) complete = checksum(words) == head%checksum
        if (complete) then
          deallocate (complaint)
          return
        end if
      end if
      deallocate (spectrum)
      spectrum => null()
    end subroutine take_values

  end subroutine read_kernels

  !> Write spectra.
  subroutine write_kernels(path, key, maker, spectrum, word, bytes, complaint)
    !> The file
    character(len=*), intent(in) :: path
    !> What the kernels depend on
    type(kernel_key_t), intent(in) :: key
    !> Program and machine
    character(len=*), intent(in) :: maker
    !> The spectra
    type(kernel_spectrum_t), intent(in) :: spectrum
    !> A word for the name of the file while it is written, that nobody else has
    character(len=*), intent(in) :: word
    !> Bytes that were written
    integer(int64), intent(out) :: bytes
    !> Why that failed
    character(len=:), allocatable, intent(out) :: complaint

    type(head_t) :: head
    integer(int64), pointer, contiguous :: words(:)
    integer :: unit, stat, left
    character(len=:), allocatable :: while_written
    character(len=message_length) :: message

    head%maker = maker
    head%key = key%word
    words => words_of(spectrum)
    head%checksum = checksum(words)
    bytes = 0
    while_written = path//'.'//word//'.part'
    open (newunit=unit, file=while_written, access='stream', form='unformatted', status='new', action='write', &
          iostat=stat, iomsg=message)
    if (stat == 0) then
      if (allocated(spectrum%double)) then
        head%value_bytes = 8
        head%n = shape(spectrum%double)
      else
        head%value_bytes = 4
        head%n = shape(spectrum%single)
      end if
      write (unit, iostat=stat, iomsg=message) head
      if (stat == 0) call write_words(unit, size(words, kind=int64), words, stat, message)
      if (stat == 0) flush (unit, iostat=stat, iomsg=message)
      if (stat /= 0) then
        close (unit, status='delete', iostat=left)
        if (left /= 0) message = trim(message)//'; a part of it is left'
      else
        close (unit, iostat=stat, iomsg=message)
        if (stat == 0) then
          stat = c_rename(while_written//c_null_char, path//c_null_char)
          message = 'it cannot be given its name'
        end if
      end if
    end if
    if (stat /= 0) then
      complaint = path//' cannot be written ('//trim(message)//')'
    else
      bytes = spectrum%bytes() + storage_size(head)/8
    end if
  end subroutine write_kernels

  !> As vectors, which gfortran reads in one piece.
  subroutine read_words(unit, n, words, complete)
    integer, intent(in) :: unit
    integer(int64), intent(in) :: n
    integer(int64), intent(out) :: words(n)
    logical, intent(out) :: complete
    integer :: stat

    read (unit, iostat=stat) words
    complete = stat == 0
  end subroutine read_words

  !> As vectors, which gfortran writes in one piece.
  subroutine write_words(unit, n, words, stat, message)
    integer, intent(in) :: unit
    integer(int64), intent(in) :: n
    integer(int64), intent(in) :: words(n)
    integer, intent(out) :: stat
    character(len=message_length), intent(inout) :: message

    write (unit, iostat=stat, iomsg=message) words
    if (stat == 0) message = ''
  end subroutine write_words

  !> The values of spectra as whole words: their number is a multiple of four.
  function words_of(spectrum) result(words)
    type(kernel_spectrum_t), intent(in), target :: spectrum
    integer(int64), pointer, contiguous :: words(:)
    type(c_ptr) :: start

    start = c_null_ptr
    if (allocated(spectrum%double)) start = c_loc(spectrum%double)
    if (allocated(spectrum%single)) start = c_loc(spectrum%single)
    call c_f_pointer(start, words, [spectrum%bytes()/8])
  end function words_of

  !> Checksum: words are turned and added without carry, some side by side, so that every single change is seen.
  pure integer(int64) function checksum(words)
    integer(int64), intent(in), contiguous :: words(:)
    integer(int64) :: sum(lanes), i, n

    n = size(words, kind=int64)
    sum = [(i, i=1, lanes)]
    do i = 1, n - lanes + 1, lanes
      sum = ieor(ior(shiftl(sum, 7), shiftr(sum, 57)), words(i:i + lanes - 1))
    end do
    checksum = mixed([sum, words(n - modulo(n, int(lanes, int64)) + 1:)])
  end function checksum

  !> One number of many, none of which can change alone without changing it.
  pure integer(int64) function mixed(words)
    integer(int64), intent(in) :: words(:)
    integer :: i

    mixed = 0
    do i = 1, size(words)
      mixed = ieor(ishftc(mixed, 13), words(i))
      mixed = ieor(mixed, shiftr(mixed, 29))
      mixed = ieor(mixed, shiftl(mixed, 17))
    end do
  end function mixed

  !> A text of fixed length.
  pure function padded(text)
    character(len=*), intent(in) :: text
    character(len=maker_length) :: padded
    padded = text
  end function padded

end module hc_kernel_file
