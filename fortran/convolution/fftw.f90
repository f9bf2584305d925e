!> The few procedures of FFTW 3 that the library calls, by FFTW or by pocketfft.cpp (-Dfft=pocketfft), and good transform sizes.
module hc_fftw
  use, intrinsic :: iso_c_binding, only: c_int, c_ptr, ck => c_double_complex
  use hc_precision, only: wp
  implicit none
  private

  public :: fftw_plan_many_dft, fftw_execute_dft, fftw_destroy_plan
  public :: fftw_forward, fftw_estimate
  public :: good_size, plane_time

  !> Flags of fftw3.h
  integer(c_int), parameter :: fftw_forward = -1, fftw_estimate = 64

  interface
    !> Plan many complex transforms (FFTW)
    type(c_ptr) function fftw_plan_many_dft(rank, n, howmany, input, inembed, istride, idist, &
                                            output, onembed, ostride, odist, direction, flags) bind(c, name='fftw_plan_many_dft')
      import :: c_ptr, c_int, ck
      integer(c_int), value :: rank, howmany, istride, idist, ostride, odist, direction, flags
      integer(c_int), intent(in) :: n(*), inembed(*), onembed(*)
      complex(ck), intent(inout) :: input(*), output(*)
    end function fftw_plan_many_dft

    !> Transform by a plan (FFTW)
    subroutine fftw_execute_dft(plan, input, output) bind(c, name='fftw_execute_dft')
      import :: c_ptr, ck
      type(c_ptr), value :: plan
      complex(ck), intent(inout) :: input(*), output(*)
    end subroutine fftw_execute_dft

    !> Free a plan (FFTW)
    subroutine fftw_destroy_plan(plan) bind(c, name='fftw_destroy_plan')
      import :: c_ptr
      type(c_ptr), value :: plan
    end subroutine fftw_destroy_plan
  end interface

contains

  !> Return a multiple of four not below n that is transformed fast, of the form 2^a 3^b 5^c 7^d.
  !>
  !> The least of them is not the fastest: FFTW's plans for powers of two take half of the time a
  !> point of others, so that a longer transform can be the cheaper one.
  elemental integer function good_size(n)
    !> Least length
    integer, intent(in) :: n
    integer :: length
    real(wp) :: cost, least

    length = max(4, n + modulo(-n, 4))
    good_size = length
    least = huge(1.0_wp)
    do
      cost = plane_time([length, length])
      if (cost > 0.0_wp .and. cost < least) then
        least = cost
        good_size = length
      end if
      if (odd_part(length) == 1) return
      length = length + 4
    end do
  end function good_size

  !> Estimate the time of a transform along both directions, in that of a point of powers of two; zero as below.
  pure real(wp) function plane_time(length)
    integer, intent(in) :: length(2)
    plane_time = product(real(length, wp))*sum(time_per_point(length))/2.0_wp
  end function plane_time

  !> Estimate the time per point of FFTW's estimated plans over that of powers of two (measured with AVX2
  !> in both precisions); zero for lengths with larger prime factors, which are not to be taken.
  elemental real(wp) function time_per_point(length)
    integer, intent(in) :: length
    integer :: rest, prime
    integer, parameter :: primes(3) = [3, 5, 7], long = 1024

    rest = odd_part(length)
    select case (rest)
    case (1)
      time_per_point = 1.0_wp
    case (5)
      time_per_point = 1.3_wp
    case (3)
      time_per_point = merge(1.4_wp, 1.9_wp, length < long)
    case (15, 25)
      time_per_point = 1.65_wp
    case default
      do prime = 1, size(primes)
        do while (modulo(rest, primes(prime)) == 0)
          rest = rest/primes(prime)
        end do
      end do
      time_per_point = merge(1.9_wp, 0.0_wp, rest == 1)
    end select
  end function time_per_point

  !> Divide a number by all its factors of two.
  elemental integer function odd_part(n)
    integer, intent(in) :: n
    odd_part = shiftr(n, trailz(n))
  end function odd_part

end module hc_fftw
