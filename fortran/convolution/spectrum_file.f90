!> Files of spectra of kernels: a file is complete, or does not exist.
!>
!> A file is written under another name and renamed; its head contains the key of the spectra, program and machine, and a hash
!> of the whole file. Files with unexpected content are ignored, and so are those that another user may have written,
!> unless files are shared. Files are written by C, since Fortran's run-time library does not report a full disk.
module hc_spectrum_file
  use, intrinsic :: iso_c_binding, only: c_int, c_char, c_null_char, c_size_t, c_int64_t, c_ptr, &
                                         c_null_ptr, c_loc, c_associated, c_f_pointer
  use, intrinsic :: iso_fortran_env, only: int64
  use hc_precision, only: wp, sp
  use hc_spectrum, only: kernel_spectrum_t, kernel_key_t, key_length, kind_name
  implicit none
  private

  public :: read_kernels, write_kernels, file_name

  !> The first word of a file, and its layout: to be raised whenever that, or the order of the values, changes.
  character(len=24), parameter :: magic = 'hexcontact kernels'
  integer(int64), parameter :: layout = 5
  !> Length of the text for program and machine.
  integer, parameter :: maker_length = 256
  !> Words of the fixed part of a head, and of a whole head: bytes of a value, shape and hash follow.
  integer, parameter :: n_known = 4 + maker_length/8 + key_length, n_head = n_known + 5
  !> Status of `open_file`.
  integer(c_int), parameter :: absent = 1, foreign = 3, open_to_others = 4

  ! of posix.c, xxh64.c and stdio.h
  interface
    !> Open a file for reading (posix.c)
    type(c_ptr) function open_file(path, shared, bytes, status) bind(c, name='hexcontact_open')
      import :: c_ptr, c_char, c_int, c_int64_t
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int), value :: shared
      integer(c_int64_t), intent(out) :: bytes
      integer(c_int), intent(out) :: status
    end function open_file

    !> Create a file that only its owner may write (posix.c)
    type(c_ptr) function create_file(path) bind(c, name='hexcontact_create')
      import :: c_ptr, c_char
      character(kind=c_char), intent(in) :: path(*)
    end function create_file

    !> Hash bytes (xxh64.c)
    pure integer(c_int64_t) function xxh64(words, bytes, seed) bind(c, name='hexcontact_xxh64')
      import :: c_int64_t, c_size_t
      integer(c_int64_t), intent(in) :: words(*)
      integer(c_size_t), value :: bytes
      integer(c_int64_t), value :: seed
    end function xxh64

    !> Read from a stream (C)
    integer(c_size_t) function fread(items, bytes, n, stream) bind(c, name='fread')
      import :: c_ptr, c_size_t
      type(c_ptr), value :: items
      integer(c_size_t), value :: bytes, n
      type(c_ptr), value :: stream
    end function fread

    !> Write to a stream (C)
    integer(c_size_t) function fwrite(items, bytes, n, stream) bind(c, name='fwrite')
      import :: c_ptr, c_size_t
      type(c_ptr), value :: items
      integer(c_size_t), value :: bytes, n
      type(c_ptr), value :: stream
    end function fwrite

    !> Close a stream (C)
    integer(c_int) function fclose(stream) bind(c, name='fclose')
      import :: c_ptr, c_int
      type(c_ptr), value :: stream
    end function fclose

    !> Rename a file (C)
    integer(c_int) function rename_file(from, onto) bind(c, name='rename')
      import :: c_int, c_char
      character(kind=c_char), intent(in) :: from(*), onto(*)
    end function rename_file

    !> Remove a file (C)
    integer(c_int) function remove_file(path) bind(c, name='remove')
      import :: c_int, c_char
      character(kind=c_char), intent(in) :: path(*)
    end function remove_file
  end interface

contains

  !> Return the name of the file of some kernels; the head of the file tells sets of the same name apart.
  pure function file_name(key, maker) result(name)
    !> Parameters of the kernels
    type(kernel_key_t), intent(in) :: key
    !> Program and machine
    character(len=*), intent(in) :: maker
    character(len=:), allocatable :: name
    character(len=64) :: text
    write (text, '(a, "-", i0, "x", i0, "-", z16.16, ".kernels")') trim(kind_name(key%word(1))), abs(key%word(2:3)), &
      hash_of(known_head(key, maker), 0_int64)
    name = trim(text)
  end function file_name

  !> Return the part of a head that is known beforehand.
  pure function known_head(key, maker) result(head)
    type(kernel_key_t), intent(in) :: key
    character(len=*), intent(in) :: maker
    integer(int64) :: head(n_known)
    character(len=maker_length) :: padded

    padded = maker
    head = [transfer(magic, head, 3), layout, transfer(padded, head, maker_length/8), key%word]
  end function known_head

  !> Read spectra; without a complaint if there is no file.
  subroutine read_kernels(path, key, maker, shared, spectrum, complaint)
    !> The file
    character(len=*), intent(in) :: path
    !> Expected parameters of the kernels
    type(kernel_key_t), intent(in) :: key
    !> Program and machine
    character(len=*), intent(in) :: maker
    !> Accept files of other users
    logical, intent(in) :: shared
    !> The spectra; not associated if there are none
    type(kernel_spectrum_t), pointer, intent(out) :: spectrum
    !> Why an existing file was ignored
    character(len=:), allocatable, intent(out) :: complaint

    integer(int64), target :: head(n_head)
    integer(int64) :: bytes
    type(c_ptr) :: stream
    integer(c_int) :: status
    logical :: good

    spectrum => null()
    stream = open_file(path//c_null_char, merge(1_c_int, 0_c_int, shared), bytes, status)
    if (.not. c_associated(stream)) then
      if (status == foreign) then
        complaint = path//' belongs to another user'
      else if (status == open_to_others) then
        complaint = path//' can be written by other users (chmod go-w)'
      else if (status /= absent) then
        complaint = path//' cannot be read'
      end if
      return
    end if
    good = fread(c_loc(head), 8_c_size_t, int(n_head, c_size_t), stream) == n_head
    if (good) good = all(head(:n_known) == known_head(key, maker))
    if (good) call read_values(stream, bytes - 8*n_head, head, spectrum)
    if (.not. associated(spectrum)) complaint = path//' is damaged, or was made by something else'
    if (fclose(stream) /= 0) complaint = path//' cannot be closed'
  end subroutine read_kernels

  !> Read the values of spectra, up to the end of the file; not associated if they are damaged.
  subroutine read_values(stream, bytes, head, spectrum)
    type(c_ptr), intent(in) :: stream
    !> Bytes that the file has for them
    integer(int64), intent(in) :: bytes
    !> Head of the file
    integer(int64), intent(in) :: head(n_head)
    type(kernel_spectrum_t), pointer, intent(out) :: spectrum

    real(wp), pointer, contiguous :: double(:, :, :)
    real(sp), pointer, contiguous :: single(:, :, :)
    integer(int64), pointer, contiguous :: words(:)
    integer(int64) :: value_bytes, n(3)
    integer :: stat
    logical :: good

    spectrum => null()
    value_bytes = head(n_known + 1)
    n = head(n_known + 2:n_known + 4)
    if (any(n < 1) .or. any(n >= 2_int64**20) .or. modulo(n(1), 4_int64) /= 0) return
    if (value_bytes /= 4 .and. value_bytes /= 8) return
    if (value_bytes*product(n) /= bytes) return
    allocate (spectrum, stat=stat)
    if (stat /= 0) return
    stat = 1
    if (value_bytes == 8) call spectrum%reserve(int(n), double, stat)
    if (value_bytes == 4) call spectrum%reserve(int(n), single, stat)
    good = stat == 0
    if (good) then
      words => words_of(spectrum)
      good = fread(c_loc(words), 8_c_size_t, size(words, kind=c_size_t), stream) == size(words, kind=c_size_t)
    end if
    if (good) good = hash_of(words, hash_of(head(:n_head - 1), 0_int64)) == head(n_head)
    if (good) return
    deallocate (spectrum)
    spectrum => null()
  end subroutine read_values

  !> Write spectra.
  subroutine write_kernels(path, key, maker, spectrum, word, bytes, complaint)
    !> The file
    character(len=*), intent(in) :: path
    !> Parameters of the kernels
    type(kernel_key_t), intent(in) :: key
    !> Program and machine
    character(len=*), intent(in) :: maker
    !> The spectra
    type(kernel_spectrum_t), intent(in) :: spectrum
    !> Word for the name of the file while it is written, of this process alone
    character(len=*), intent(in) :: word
    !> Bytes that were written
    integer(int64), intent(out) :: bytes
    !> Why it failed
    character(len=:), allocatable, intent(out) :: complaint

    integer(int64), target :: head(n_head)
    integer(int64), pointer, contiguous :: words(:)
    character(len=:), allocatable :: while_written
    type(c_ptr) :: stream
    logical :: good

    words => words_of(spectrum)
    head(:n_known) = known_head(key, maker)
    if (allocated(spectrum%double)) then
      head(n_known + 1:n_head - 1) = [8_int64, shape(spectrum%double, kind=int64)]
    else
      head(n_known + 1:n_head - 1) = [4_int64, shape(spectrum%single, kind=int64)]
    end if
    head(n_head) = hash_of(words, hash_of(head(:n_head - 1), 0_int64))
    bytes = 0
    while_written = path//'.'//word//'.part'//c_null_char
    stream = create_file(while_written)
    good = c_associated(stream)
    if (good) then
      good = fwrite(c_loc(head), 8_c_size_t, int(n_head, c_size_t), stream) == n_head
      if (good) good = fwrite(c_loc(words), 8_c_size_t, size(words, kind=c_size_t), stream) == size(words, kind=c_size_t)
      if (fclose(stream) /= 0) good = .false.
      if (good) good = rename_file(while_written, path//c_null_char) == 0
      if (good) bytes = 8*(n_head + size(words, kind=int64))
    end if
    if (good) return
    complaint = path//' cannot be written'
    if (c_associated(stream)) then
      if (remove_file(while_written) /= 0) complaint = complaint//', and a part of it is left'
    end if
  end subroutine write_kernels

  !> Return the values of spectra as whole words: their number is a multiple of four.
  function words_of(spectrum) result(words)
    type(kernel_spectrum_t), intent(in), target :: spectrum
    integer(int64), pointer, contiguous :: words(:)
    type(c_ptr) :: start

    start = c_null_ptr
    if (allocated(spectrum%double)) start = c_loc(spectrum%double)
    if (allocated(spectrum%single)) start = c_loc(spectrum%single)
    call c_f_pointer(start, words, [spectrum%bytes()/8])
  end function words_of

  !> Hash words together with an earlier hash.
  pure integer(int64) function hash_of(words, before)
    integer(int64), intent(in), contiguous :: words(:)
    !> Hash of the words before them; 0: none
    integer(int64), intent(in) :: before
    hash_of = xxh64(words, 8*size(words, kind=c_size_t), before)
  end function hash_of

end module hc_spectrum_file
