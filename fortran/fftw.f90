!> The few procedures of FFTW 3 that the library calls, and good transform sizes.
module hc_fftw
  use, intrinsic :: iso_c_binding, only: c_int, c_ptr, c_size_t, rk => c_double, ck => c_double_complex
  implicit none
  private

  public :: fftw_plan_many_dft, fftw_plan_many_dft_r2c, fftw_plan_many_dft_c2r
  public :: fftw_execute_dft, fftw_execute_dft_r2c, fftw_execute_dft_c2r
  public :: fftw_destroy_plan, fftw_malloc, fftw_free
  public :: fftw_forward, fftw_backward, fftw_estimate
  public :: good_size

  !> Flags of fftw3.h
  integer(c_int), parameter :: fftw_forward = -1, fftw_backward = 1, fftw_estimate = 64

  interface
    type(c_ptr) function fftw_plan_many_dft(rank, n, howmany, input, inembed, istride, idist, &
                                            output, onembed, ostride, odist, direction, flags) bind(c, name='fftw_plan_many_dft')
      import :: c_ptr, c_int, ck
      integer(c_int), value :: rank, howmany, istride, idist, ostride, odist, direction, flags
      integer(c_int), intent(in) :: n(*), inembed(*), onembed(*)
      complex(ck), intent(inout) :: input(*), output(*)
    end function fftw_plan_many_dft

    type(c_ptr) function fftw_plan_many_dft_r2c(rank, n, howmany, input, inembed, istride, idist, &
                                                output, onembed, ostride, odist, flags) bind(c, name='fftw_plan_many_dft_r2c')
      import :: c_ptr, c_int, rk, ck
      integer(c_int), value :: rank, howmany, istride, idist, ostride, odist, flags
      integer(c_int), intent(in) :: n(*), inembed(*), onembed(*)
      real(rk), intent(inout) :: input(*)
      complex(ck), intent(inout) :: output(*)
    end function fftw_plan_many_dft_r2c

    type(c_ptr) function fftw_plan_many_dft_c2r(rank, n, howmany, input, inembed, istride, idist, &
                                                output, onembed, ostride, odist, flags) bind(c, name='fftw_plan_many_dft_c2r')
      import :: c_ptr, c_int, rk, ck
      integer(c_int), value :: rank, howmany, istride, idist, ostride, odist, flags
      integer(c_int), intent(in) :: n(*), inembed(*), onembed(*)
      complex(ck), intent(inout) :: input(*)
      real(rk), intent(inout) :: output(*)
    end function fftw_plan_many_dft_c2r

    subroutine fftw_execute_dft(plan, input, output) bind(c, name='fftw_execute_dft')
      import :: c_ptr, ck
      type(c_ptr), value :: plan
      complex(ck), intent(inout) :: input(*), output(*)
    end subroutine fftw_execute_dft

    subroutine fftw_execute_dft_r2c(plan, input, output) bind(c, name='fftw_execute_dft_r2c')
      import :: c_ptr, rk, ck
      type(c_ptr), value :: plan
      real(rk), intent(inout) :: input(*)
      complex(ck), intent(inout) :: output(*)
    end subroutine fftw_execute_dft_r2c

    subroutine fftw_execute_dft_c2r(plan, input, output) bind(c, name='fftw_execute_dft_c2r')
      import :: c_ptr, rk, ck
      type(c_ptr), value :: plan
      complex(ck), intent(inout) :: input(*)
      real(rk), intent(inout) :: output(*)
    end subroutine fftw_execute_dft_c2r

    subroutine fftw_destroy_plan(plan) bind(c, name='fftw_destroy_plan')
      import :: c_ptr
      type(c_ptr), value :: plan
    end subroutine fftw_destroy_plan

    type(c_ptr) function fftw_malloc(n) bind(c, name='fftw_malloc')
      import :: c_ptr, c_size_t
      integer(c_size_t), value :: n
    end function fftw_malloc

    subroutine fftw_free(p) bind(c, name='fftw_free')
      import :: c_ptr
      type(c_ptr), value :: p
    end subroutine fftw_free
  end interface

contains

  !> Smallest multiple of four not below n of the form 2^a 3^b 5^c 7^d: a fast transform length.
  elemental integer function good_size(n)
    !> Least length
    integer, intent(in) :: n
    integer :: rest, prime
    integer, parameter :: primes(4) = [2, 3, 5, 7]

    good_size = max(4, n + modulo(-n, 4))
    do
      rest = good_size
      do prime = 1, 4
        do while (modulo(rest, primes(prime)) == 0)
          rest = rest/primes(prime)
        end do
      end do
      if (rest == 1) return
      good_size = good_size + 4
    end do
  end function good_size

end module hc_fftw
