!> Time of one application of the FFT operator, over that of the bare transforms it needs.
!>
!> The bare transforms are those of FFTW as planned for the whole array: real
!> transforms of the rows of the window, complex ones along all columns, there
!> and back; "blocked" are the same transforms in the operator's cache-sized
!> blocks. Nothing is copied, padded or multiplied in either. All in one run,
!> best of several repetitions, one thread.
!>
!> Arguments are sides of windows: for each a line of seconds instead of the table, to be read by a program
!> (side; scalar product, bare and blocked transforms; 3x3 product, its bare and blocked transforms).
program bench_operator
  use, intrinsic :: iso_c_binding, only: c_ptr, c_int, c_double, c_double_complex
  use, intrinsic :: iso_fortran_env, only: int64
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_lattice, only: lattice_t, new_lattice, equilateral_basis
  use hc_elastic_pair, only: elastic_pair_t
  use hc_pyramid_influence, only: pyramid_t, new_pyramid
  use hc_field_space, only: field_space_t
  use hc_flexibility_fft, only: fft_flexibility_t, new_fft_flexibility, of_pressure, of_all_tractions
  use hc_fftw, only: fftw_plan_many_dft, fftw_execute_dft, fftw_destroy_plan, fftw_forward, fftw_estimate, good_size
  implicit none

  !> Of fftw3.h: real transforms, which the library does without.
  integer(c_int), parameter :: fftw_backward = 1
  interface
    type(c_ptr) function fftw_plan_many_dft_r2c(rank, n, howmany, input, inembed, istride, idist, &
                                                output, onembed, ostride, odist, flags) bind(c, name='fftw_plan_many_dft_r2c')
      import :: c_ptr, c_int, c_double, c_double_complex
      integer(c_int), value :: rank, howmany, istride, idist, ostride, odist, flags
      integer(c_int), intent(in) :: n(*), inembed(*), onembed(*)
      real(c_double), intent(inout) :: input(*)
      complex(c_double_complex), intent(inout) :: output(*)
    end function fftw_plan_many_dft_r2c

    type(c_ptr) function fftw_plan_many_dft_c2r(rank, n, howmany, input, inembed, istride, idist, &
                                                output, onembed, ostride, odist, flags) bind(c, name='fftw_plan_many_dft_c2r')
      import :: c_ptr, c_int, c_double, c_double_complex
      integer(c_int), value :: rank, howmany, istride, idist, ostride, odist, flags
      integer(c_int), intent(in) :: n(*), inembed(*), onembed(*)
      complex(c_double_complex), intent(inout) :: input(*)
      real(c_double), intent(inout) :: output(*)
    end function fftw_plan_many_dft_c2r

    subroutine fftw_execute_dft_r2c(plan, input, output) bind(c, name='fftw_execute_dft_r2c')
      import :: c_ptr, c_double, c_double_complex
      type(c_ptr), value :: plan
      real(c_double), intent(inout) :: input(*)
      complex(c_double_complex), intent(inout) :: output(*)
    end subroutine fftw_execute_dft_r2c

    subroutine fftw_execute_dft_c2r(plan, input, output) bind(c, name='fftw_execute_dft_c2r')
      import :: c_ptr, c_double, c_double_complex
      type(c_ptr), value :: plan
      complex(c_double_complex), intent(inout) :: input(*)
      real(c_double), intent(inout) :: output(*)
    end subroutine fftw_execute_dft_c2r
  end interface

  integer, parameter :: sides(4) = [256, 512, 1024, 2048]
  integer :: i

  if (command_argument_count() > 0) then
    do i = 1, command_argument_count()
      call print_seconds(side_of_argument(i))
    end do
  else
    print '(a)', '| window | scalar product [ms] | over bare FFTs | over blocked FFTs | 3x3 product [ms] | over bare FFTs |'
    print '(a)', '|---|---|---|---|---|---|'
    do i = 1, size(sides)
      call print_row(sides(i))
    end do
    print '(/,a)', '| kernel table of a window | offsets | seconds |'
    print '(a)', '|---|---|---|'
    call measure_table(1024)
    call measure_table(2048)
  end if

contains

  !> Seconds of the five kernels at the offsets of a window, half of which suffice: they are even or odd.
  subroutine measure_table(side)
    !> Nodes on a side of the window
    integer, intent(in) :: side
    type(pyramid_t) :: pyramid
    real(wp), allocatable :: table(:, :, :)
    real(wp) :: start, basis(2, 2)
    integer :: i, j

    basis = equilateral_basis(1.0_wp)
    allocate (table(5, 1 - side:side - 1, 0:side - 1))
    call new_pyramid(pyramid, basis)
    start = seconds()
    !$omp parallel do schedule(dynamic, 8) private(i)
    do j = 0, side - 1
      do i = 1 - side, side - 1
        table(:, i, j) = pyramid%kernels(i*basis(1, 1) + j*basis(1, 2), i*basis(2, 1) + j*basis(2, 2))
      end do
    end do
    !$omp end parallel do
    print '(a,i0,a,i0,a,f0.2,a)', '| ', side, '^2 | ', 2*side - 1, '^2 | ', seconds() - start, ' |'
  end subroutine measure_table

  !> Nodes on a side of a window, from the command line.
  integer function side_of_argument(i)
    !> Number of the argument
    integer, intent(in) :: i
    character(len=20) :: word
    integer :: ios

    call get_command_argument(i, word)
    read (word, *, iostat=ios) side_of_argument
    if (ios /= 0 .or. side_of_argument < 1) error stop 'expected sides of windows, positive integers'
  end function side_of_argument

  !> One row of the table.
  subroutine print_row(side)
    !> Nodes on a side of the window
    integer, intent(in) :: side
    real(wp) :: t(6)

    t = measure(side)
    print '(a,i0,a,f0.2,a,f0.2,a,f0.2,a,f0.2,a,f0.2,a)', '| ', side, '^2 | ', 1e3_wp*t(1), ' | ', t(1)/t(2), ' | ', &
      t(1)/t(3), ' | ', 1e3_wp*t(4), ' | ', t(4)/t(5), ' |'
  end subroutine print_row

  !> The same in seconds.
  subroutine print_seconds(side)
    !> Nodes on a side of the window
    integer, intent(in) :: side

    print '(i0,6es14.5)', side, measure(side)
  end subroutine print_seconds

  !> Seconds of a scalar product, its bare and its blocked transforms; the same of a 3x3 product.
  function measure(side) result(t)
    !> Nodes on a side of the window
    integer, intent(in) :: side
    real(wp) :: t(6)

    call products(side, 1, t(1), t(3))
    call products(side, 3, t(4))
    t(2) = bare_transforms(side, 1)
    t(5) = bare_transforms(side, 3)
    t(6) = 3.0_wp*t(3)
  end function measure

  !> Seconds of an application to one or to three components.
  subroutine products(side, n_component, best, blocked)
    !> Nodes on a side of the window, components
    integer, intent(in) :: side, n_component
    !> Seconds of a product
    real(wp), intent(out) :: best
    !> Seconds of its transforms
    real(wp), intent(out), optional :: blocked
    type(lattice_t) :: lattice
    type(fft_flexibility_t) :: operator
    type(error_t), allocatable :: error
    real(wp), allocatable :: traction(:, :, :), displacement(:, :, :)
    real(wp) :: start
    integer :: repeat, j

    call new_lattice(lattice, equilateral_basis(1.0_wp), [0, 0], [side, side], error)
    call new_fft_flexibility(operator, lattice, elastic_pair_t(1.0_wp, 0.2_wp, 0.5_wp), error, &
                             kind=merge(of_pressure, of_all_tractions, n_component == 1), space=field_space_t(1))
    if (allocated(error)) error stop 'the operator could not be set up'
    allocate (traction(side, side, n_component), displacement(side, side, n_component))
    call random_number(traction)
    best = huge(best)
    do repeat = 1, repeats(side)
      start = seconds()
      call operator%apply([(j, j=1, n_component)], traction, [(j, j=1, n_component)], displacement, error)
      best = min(best, seconds() - start)
    end do
    if (.not. present(blocked)) return
    blocked = huge(blocked)
    do repeat = 1, repeats(side)
      start = seconds()
      call operator%convolution%time_transforms()
      blocked = min(blocked, seconds() - start)
    end do
  end subroutine products

  !> Seconds of the bare transforms of a product, each component with arrays of its own.
  real(wp) function bare_transforms(side, n_component)
    !> Nodes on a side of the window, components
    integer, intent(in) :: side, n_component
    real(wp), allocatable :: rows(:, :, :)
    complex(wp), allocatable :: spectrum(:, :, :)
    type(c_ptr) :: row_forward, row_inverse, column_forward, column_inverse
    integer(c_int) :: length(1), n, m, k
    real(wp) :: start
    integer :: repeat, i

    k = side
    n = good_size(2*side - 1)
    m = n/2 + 1
    length = n
    allocate (rows(n, side, n_component), source=0.0_wp)
    allocate (spectrum(m, n, n_component), source=(0.0_wp, 0.0_wp))
    row_forward = fftw_plan_many_dft_r2c(1_c_int, length, k, rows, length, 1_c_int, n, spectrum, length, 1_c_int, m, &
                                         fftw_estimate)
    row_inverse = fftw_plan_many_dft_c2r(1_c_int, length, k, spectrum, length, 1_c_int, m, rows, length, 1_c_int, n, &
                                         fftw_estimate)
    column_forward = fftw_plan_many_dft(1_c_int, length, m, spectrum, length, m, 1_c_int, &
                                        spectrum, length, m, 1_c_int, fftw_forward, fftw_estimate)
    column_inverse = fftw_plan_many_dft(1_c_int, length, m, spectrum, length, m, 1_c_int, &
                                        spectrum, length, m, 1_c_int, fftw_backward, fftw_estimate)
    bare_transforms = huge(start)
    do repeat = 1, repeats(side)
      start = seconds()
      do i = 1, n_component
        call fftw_execute_dft_r2c(row_forward, rows(:, :, i), spectrum(:, :, i))
        call fftw_execute_dft(column_forward, spectrum(:, :, i), spectrum(:, :, i))
      end do
      do i = 1, n_component
        call fftw_execute_dft(column_inverse, spectrum(:, :, i), spectrum(:, :, i))
        call fftw_execute_dft_c2r(row_inverse, spectrum(:, :, i), rows(:, :, i))
      end do
      bare_transforms = min(bare_transforms, seconds() - start)
    end do
    call fftw_destroy_plan(row_forward)
    call fftw_destroy_plan(row_inverse)
    call fftw_destroy_plan(column_forward)
    call fftw_destroy_plan(column_inverse)
  end function bare_transforms

  !> Repetitions that take about as long for every window; the best one counts.
  pure integer function repeats(side)
    !> Nodes on a side of the window
    integer, intent(in) :: side
    repeats = max(5, 5*(1024/side)**2)
  end function repeats

  !> Wall-clock time.
  real(wp) function seconds()
    integer(int64) :: count, rate
    call system_clock(count, rate)
    seconds = real(count, wp)/real(rate, wp)
  end function seconds

end program bench_operator
