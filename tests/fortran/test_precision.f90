!> Kinds, constants and the error type.
module test_precision
  use, intrinsic :: iso_fortran_env, only: real64
  use hc_precision, only: wp, xp, pi
  use hc_error, only: error_t, status, raise
  use testing, only: test_t, new_test, check, check_true
  implicit none
  private

  public :: collect_precision

contains

  subroutine collect_precision(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('kind', test_kind), &
      new_test('pi', test_pi), &
      new_test('error', test_error), &
      new_test('codes', test_codes) &
    ]
  end subroutine collect_precision

  subroutine test_kind(error)
    type(error_t), allocatable, intent(out) :: error

    call check(error, wp, real64, 'working precision is binary64')
    if (allocated(error)) return
    call check_true(error, precision(1.0_xp) >= 30 .or. (selected_real_kind(30) < 0 .and. xp == wp), &
                    'extended precision has thirty digits where the compiler has such a kind')
  end subroutine test_kind

  subroutine test_pi(error)
    type(error_t), allocatable, intent(out) :: error

    call check(error, pi, acos(-1.0_wp), epsilon(1.0_wp), 'pi')
  end subroutine test_pi

  !> intent(out) clears what an earlier call left.
  subroutine test_error(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: raised

    call raise(raised, status%resources, 'first')
    call raise(raised, status%no_convergence, 'second')
    call check(error, raised%code, status%no_convergence, 'code of an error')
    if (allocated(error)) return
    call check_true(error, raised%message == 'second', 'message of an error')
  end subroutine test_error

  !> Python tells failures apart by their code.
  subroutine test_codes(error)
    type(error_t), allocatable, intent(out) :: error

    integer :: codes(4), i

    call check(error, status%ok, 0, 'code of success')
    codes = [status%invalid_input, status%no_convergence, status%resources, status%bad_handle]
    do i = 1, size(codes)
      if (allocated(error)) return
      call check_true(error, codes(i) > 0 .and. count(codes == codes(i)) == 1, 'codes are positive and differ')
    end do
  end subroutine test_codes

end module test_precision
