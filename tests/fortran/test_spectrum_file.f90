!> Files of kernels: the hash that tells whether one is whole.
module test_spectrum_file
  use, intrinsic :: iso_c_binding, only: c_char, c_int64_t, c_size_t
  use hc_error, only: error_t
  use testing, only: test_t, new_test, check_true
  implicit none
  private

  public :: collect_spectrum_file

  interface
    pure integer(c_int64_t) function xxh64(text, bytes, seed) bind(c, name='hexcontact_xxh64')
      import :: c_char, c_int64_t, c_size_t
      character(kind=c_char), intent(in) :: text(*)
      integer(c_size_t), value :: bytes
      integer(c_int64_t), value :: seed
    end function xxh64
  end interface

contains

  subroutine collect_spectrum_file(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [new_test('hash', test_hash)]
  end subroutine collect_spectrum_file

  !> Values of libxxhash 0.8.4, for texts that take each way through the algorithm.
  subroutine test_hash(error)
    type(error_t), allocatable, intent(out) :: error

    call expect('', 0_c_int64_t, 'EF46DB3751D8E999')
    call expect('a', 0_c_int64_t, 'D24EC4F1A98C6E5B')
    call expect('abc', 0_c_int64_t, '44BC2CF5AD770999')
    call expect('xxhash', 20141025_c_int64_t, 'B559B98D844E0635')
    call expect('Nobody inspects the spammish repetition', 0_c_int64_t, 'FBCEA83C8A378BF1')
    call expect('Nobody inspects the spammish repetition, but 64-bit lanes do it four at a time.', 20141025_c_int64_t, &
                '7A10FC0B6CC53BF5')

  contains

    subroutine expect(text, seed, digest)
      character(len=*), intent(in) :: text, digest
      integer(c_int64_t), intent(in) :: seed
      character(len=16) :: found

      if (allocated(error)) return
      write (found, '(z16.16)') xxh64(text, len(text, kind=c_size_t), seed)
      call check_true(error, found == digest, 'hash of "'//text//'": '//found)
    end subroutine expect

  end subroutine test_hash

end module test_spectrum_file
