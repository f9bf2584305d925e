!> The checks must fail where they should: wrong numbers, NaN, wrong sizes, no error.
module test_testing
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use testing, only: test_t, new_test, check, check_true, check_raised, check_succeeded, fail, largest, open_table
  implicit none
  private

  public :: collect_testing

contains

  subroutine collect_testing(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('values', test_values), &
      new_test('errors', test_errors), &
      new_test('missing table', test_missing_table) &
    ]
  end subroutine collect_testing

  subroutine test_values(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: caught
    logical :: right(10)
    real(wp) :: field(2, 2)

    call check(caught, 1.0_wp, 1.0_wp + 1.0e-13_wp, 1.0e-12_wp, 'close')
    right(1) = .not. allocated(caught)
    call check(caught, 1.0_wp, 1.0_wp + 1.0e-11_wp, 1.0e-12_wp, 'wrong')
    right(2) = allocated(caught)
    call check(caught, ieee_value(1.0_wp, ieee_quiet_nan), 1.0_wp, 1.0e-12_wp, 'NaN')
    right(3) = allocated(caught)
    call check(caught, [1.0_wp, 2.0_wp], [1.0_wp, 2.5_wp], 1.0e-12_wp, 'wrong element')
    right(4) = allocated(caught)
    call check(caught, [1.0_wp, 2.0_wp], [1.0_wp], 1.0e-12_wp, 'wrong size')
    right(5) = allocated(caught)
    call check(caught, 1, 2, 'wrong integer')
    right(6) = allocated(caught)
    call check_true(caught, .false., 'wrong statement')
    right(7) = allocated(caught)
    call check_true(caught, .true., 'right statement')
    right(8) = .not. allocated(caught)
    ! one value of many that is no number
    field = 1.0_wp
    field(2, 1) = ieee_value(1.0_wp, ieee_quiet_nan)
    call check(caught, largest(field), 1.0_wp, 1.0e-12_wp, 'a NaN in a field')
    right(9) = allocated(caught)
    call check(caught, largest([1.0_wp, -3.0_wp]), 3.0_wp, 0.0_wp, 'largest magnitude')
    right(10) = .not. allocated(caught)
    if (.not. all(right)) call fail(error, 'a check of values does not tell right from wrong')
  end subroutine test_values

  subroutine test_errors(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: raised, caught
    logical :: right(5)

    call check_raised(caught, raised, status%invalid_input, 'nothing raised')
    right(1) = allocated(caught)
    call check_succeeded(caught, raised, 'nothing raised')
    right(2) = .not. allocated(caught)
    call raise(raised, status%resources, 'message')
    call check_raised(caught, raised, status%invalid_input, 'other code')
    right(3) = allocated(caught)
    call check_raised(caught, raised, status%resources, 'this code')
    right(4) = .not. allocated(caught)
    call check_succeeded(caught, raised, 'something raised')
    right(5) = allocated(caught)
    if (.not. all(right)) call fail(error, 'a check of errors does not tell right from wrong')
  end subroutine test_errors

  subroutine test_missing_table(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: raised
    integer :: unit

    call open_table('no_such_table.csv', unit, raised)
    call check_raised(error, raised, status%invalid_input, 'a table that does not exist')
  end subroutine test_missing_table

end module test_testing
