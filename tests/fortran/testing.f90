!> A small test harness: suites of named tests, run all at once, by suite or singly.
!>
!>     tester                 every suite
!>     tester lattice         one suite
!>     tester lattice basis   one test of it
!>
!> A test is a subroutine with the argument `error`; it has failed if that is
!> allocated when it returns. The checks allocate it:
!>
!>     call check(error, computed, expected, 1.0e-12_wp, 'where in the test')
!>     if (allocated(error)) return
module testing
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  use, intrinsic :: iso_fortran_env, only: output_unit
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_lattice, only: lattice_t
  implicit none
  private

  public :: test_t, suite_t, new_test, new_suite, run_suites
  public :: check, check_true, check_raised, check_succeeded, fail
  public :: data_file, largest, open_table, coordinate

  !> A named test.
  type :: test_t
    !> Name, as on the command line
    character(len=:), allocatable :: name
    !> What is run
    procedure(test_interface), pointer, nopass :: run => null()
  end type test_t

  abstract interface
    !> One test
    subroutine test_interface(error)
      import :: error_t
      implicit none
      !> Allocated if the test has failed
      type(error_t), allocatable, intent(out) :: error
    end subroutine test_interface

    !> Lists the tests of a suite
    subroutine collect_interface(tests)
      import :: test_t
      implicit none
      !> Tests, in the order they are run
      type(test_t), allocatable, intent(out) :: tests(:)
    end subroutine collect_interface
  end interface

  !> A named list of tests.
  type :: suite_t
    !> Name, as on the command line
    character(len=:), allocatable :: name
    !> Lists the tests
    procedure(collect_interface), pointer, nopass :: collect => null()
  end type suite_t

  !> Largest magnitude of a field; not a number if any of its values is none, which maxval would pass over.
  interface largest
    module procedure largest_of_vector, largest_of_field, largest_of_fields
  end interface largest

  !> A value against what is expected.
  interface check
    module procedure check_real, check_reals, check_integer
  end interface check

contains

  !> A named test.
  function new_test(name, run) result(test)
    !> Name, as on the command line
    character(len=*), intent(in) :: name
    !> What is run
    procedure(test_interface) :: run
    type(test_t) :: test

    test%name = name
    test%run => run
  end function new_test

  !> A named suite.
  function new_suite(name, collect) result(suite)
    !> Name, as on the command line
    character(len=*), intent(in) :: name
    !> Lists the tests
    procedure(collect_interface) :: collect
    type(suite_t) :: suite

    suite%name = name
    suite%collect => collect
  end function new_suite

  !> Run what the command line names, print each test and the totals.
  subroutine run_suites(suites, n_failed)
    !> All suites
    type(suite_t), intent(in) :: suites(:)
    !> Number of failures; a name that matches nothing is one
    integer, intent(out) :: n_failed

    type(test_t), allocatable :: tests(:)
    type(error_t), allocatable :: error
    character(len=:), allocatable :: suite_name, test_name
    integer :: i, j, n_passed

    suite_name = argument(1)
    test_name = argument(2)
    n_passed = 0
    n_failed = 0
    do i = 1, size(suites)
      if (suite_name /= '' .and. suite_name /= suites(i)%name) cycle
      call suites(i)%collect(tests)
      do j = 1, size(tests)
        if (test_name /= '' .and. test_name /= tests(j)%name) cycle
        call seed_random_numbers()
        call tests(j)%run(error)
        if (allocated(error)) then
          n_failed = n_failed + 1
          write (output_unit, '(a)') 'FAILED  '//suites(i)%name//' '//tests(j)%name//': '//error%message
        else
          n_passed = n_passed + 1
          write (output_unit, '(a)') 'passed  '//suites(i)%name//' '//tests(j)%name
        end if
        flush (output_unit)
      end do
    end do
    if (n_passed + n_failed == 0) then
      n_failed = 1
      write (output_unit, '(a)') 'FAILED  no test is called '//suite_name//' '//test_name
    end if
    write (output_unit, '(i0,a,i0,a)') n_passed, ' passed, ', n_failed, ' failed'
  end subroutine run_suites

  !> Begin each test with the same random numbers, whichever tests ran before it.
  subroutine seed_random_numbers()
    integer, allocatable :: seed(:)
    integer :: n, i

    call random_seed(size=n)
    seed = [(104729*i + 7, i=1, n)]
    call random_seed(put=seed)
  end subroutine seed_random_numbers

  !> Largest magnitude of a vector.
  pure real(wp) function largest_of_vector(x) result(value)
    !> Values
    real(wp), intent(in) :: x(:)

    if (any(ieee_is_nan(x))) then
      value = ieee_value(value, ieee_quiet_nan)
    else
      value = maxval(abs(x))
    end if
  end function largest_of_vector

  !> Largest magnitude of a field.
  pure real(wp) function largest_of_field(x) result(value)
    !> Values
    real(wp), intent(in) :: x(:, :)

    value = largest_of_vector(reshape(x, [size(x)]))
  end function largest_of_field

  !> Largest magnitude of several fields.
  pure real(wp) function largest_of_fields(x) result(value)
    !> Values
    real(wp), intent(in) :: x(:, :, :)

    value = largest_of_vector(reshape(x, [size(x)]))
  end function largest_of_fields

  !> Compare a real; NaN fails.
  subroutine check_real(error, value, expected, threshold, what)
    !> Allocated if |value - expected| > threshold
    type(error_t), allocatable, intent(out) :: error
    !> Computed, expected
    real(wp), intent(in) :: value, expected
    !> Allowed absolute difference
    real(wp), intent(in) :: threshold
    !> What is compared
    character(len=*), intent(in) :: what

    character(len=120) :: numbers

    if (ieee_is_nan(value)) then
      call fail(error, what//': not a number')
      return
    end if
    if (abs(value - expected) <= threshold) return
    write (numbers, '(es24.16,a,es24.16,a,es9.2,a,es9.2)') value, ' instead of', expected, ', off by', &
      abs(value - expected), ', allowed', threshold
    call fail(error, what//': '//trim(adjustl(numbers)))
  end subroutine check_real

  !> Compare arrays of reals; the first that differs is reported.
  subroutine check_reals(error, value, expected, threshold, what)
    !> Allocated if any |value - expected| > threshold, or if sizes differ
    type(error_t), allocatable, intent(out) :: error
    !> Computed, expected
    real(wp), intent(in) :: value(:), expected(:)
    !> Allowed absolute difference
    real(wp), intent(in) :: threshold
    !> What is compared
    character(len=*), intent(in) :: what

    character(len=12) :: position
    integer :: i

    call check_integer(error, size(value), size(expected), 'size of '//what)
    do i = 1, size(value)
      if (allocated(error)) return
      write (position, '(a,i0,a)') ' (', i, ')'
      call check_real(error, value(i), expected(i), threshold, what//trim(position))
    end do
  end subroutine check_reals

  !> Compare an integer.
  subroutine check_integer(error, value, expected, what)
    !> Allocated if they differ
    type(error_t), allocatable, intent(out) :: error
    !> Computed, expected
    integer, intent(in) :: value, expected
    !> What is compared
    character(len=*), intent(in) :: what

    character(len=40) :: numbers

    if (value == expected) return
    write (numbers, '(i0,a,i0)') value, ' instead of ', expected
    call fail(error, what//': '//trim(numbers))
  end subroutine check_integer

  !> A statement must hold.
  subroutine check_true(error, holds, what)
    !> Allocated if it does not
    type(error_t), allocatable, intent(out) :: error
    !> The statement
    logical, intent(in) :: holds
    !> What should have held
    character(len=*), intent(in) :: what

    if (.not. holds) call fail(error, what)
  end subroutine check_true

  !> A procedure must have failed, with this code and with a message.
  subroutine check_raised(error, raised, code, what)
    !> Allocated if it has not
    type(error_t), allocatable, intent(out) :: error
    !> What the procedure returned
    type(error_t), allocatable, intent(in) :: raised
    !> Expected code, one of hc_error's status
    integer, intent(in) :: code
    !> What was tried
    character(len=*), intent(in) :: what

    if (.not. allocated(raised)) then
      call fail(error, what//': an error was expected')
      return
    end if
    call check_integer(error, raised%code, code, what//': code of the error')
    if (.not. allocated(error)) call check_true(error, len_trim(raised%message) > 0, what//': the error has no message')
  end subroutine check_raised

  !> A procedure must not have failed.
  subroutine check_succeeded(error, raised, what)
    !> Allocated if it has
    type(error_t), allocatable, intent(out) :: error
    !> What the procedure returned
    type(error_t), allocatable, intent(in) :: raised
    !> What was tried
    character(len=*), intent(in) :: what

    if (allocated(raised)) call fail(error, what//': '//raised%message)
  end subroutine check_succeeded

  !> Let the test fail.
  subroutine fail(error, message)
    !> Allocated
    type(error_t), allocatable, intent(out) :: error
    !> Why
    character(len=*), intent(in) :: message

    call raise(error, status%invalid_input, message)
  end subroutine fail

  !> Path of a reference table: in the folder HEXCONTACT_REFERENCE, or tests/reference.
  function data_file(name) result(path)
    !> Name of the file
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: path
    integer :: length

    call get_environment_variable('HEXCONTACT_REFERENCE', length=length)
    if (length > 0) then
      allocate (character(len=length) :: path)
      call get_environment_variable('HEXCONTACT_REFERENCE', path)
      path = path//'/'//name
    else
      path = 'tests/reference/'//name
    end if
  end function data_file

  !> Open a reference table behind its comments and its line of column names.
  subroutine open_table(name, unit, error)
    !> Name of the file
    character(len=*), intent(in) :: name
    !> Unit to read rows from
    integer, intent(out) :: unit
    !> Allocated if it cannot be opened
    type(error_t), allocatable, intent(out) :: error

    character(len=1) :: first
    integer :: stat

    open (newunit=unit, file=data_file(name), action='read', status='old', iostat=stat)
    if (stat /= 0) then
      call fail(error, 'cannot read '//data_file(name))
      return
    end if
    do
      read (unit, '(a)', iostat=stat) first
      if (stat /= 0) then
        call fail(error, 'no line of column names in '//data_file(name))
        return
      end if
      if (first /= '#') exit
    end do
  end subroutine open_table

  !> One coordinate of all nodes of a window (n_col, n_row).
  function coordinate(lattice, axis)
    type(lattice_t), intent(in) :: lattice
    !> 1: x, 2: y
    integer, intent(in) :: axis
    real(wp) :: coordinate(lattice%extent(1), lattice%extent(2)), both(lattice%extent(1), lattice%extent(2), 2)

    call lattice%coordinates(both(:, :, 1), both(:, :, 2))
    coordinate = both(:, :, axis)
  end function coordinate

  !> An argument of the command line, empty if there is none.
  function argument(number) result(value)
    !> Its number
    integer, intent(in) :: number
    character(len=:), allocatable :: value
    integer :: length

    call get_command_argument(number, length=length)
    allocate (character(len=length) :: value)
    if (length > 0) call get_command_argument(number, value)
  end function argument

end module testing
