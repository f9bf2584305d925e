!> Products of transformed fields with the spectra of kernels.
!>
!> What comes out is conjugated: the forward transform of a conjugate is the conjugate of the
!> inverse transform, so that one plan serves both directions.
module hc_spectral_product
  use hc_precision, only: wp
  implicit none
  private

  public :: multiply_one, multiply

  !> Number of frequencies that are multiplied at a time.
  integer, parameter :: chunk = 128

contains

  !> One field and one even kernel, the whole operator of frictionless contact: conjg(spectrum * field).
  pure subroutine multiply_one(n, spectrum, field, total)
    !> Number of frequencies
    integer, intent(in) :: n
    !> Spectrum of the kernel
    real(wp), intent(in) :: spectrum(n)
    !> Transformed field and result
    complex(wp), intent(in) :: field(n)
    complex(wp), intent(inout) :: total(n)
    integer :: f

    do f = 1, n
      total(f) = cmplx(spectrum(f)*real(field(f), wp), -spectrum(f)*aimag(field(f)), wp)
    end do
  end subroutine multiply_one

  !> Up to three fields and any kernels: the conjugates of the sums over the fields.
  subroutine multiply(spectrum, first_odd, kernel, field, total)
    !> Spectra (frequency, kernel); those of odd kernels are divided by i
    real(wp), intent(in) :: spectrum(:, :)
    !> The first odd kernel
    integer, intent(in) :: first_odd
    !> Number of the kernel (onto, from), negative to reverse its sign
    integer, intent(in) :: kernel(:, :)
    !> Transformed fields and results (frequency, from and onto)
    complex(wp), intent(in), contiguous, target :: field(:, :)
    complex(wp), intent(inout), contiguous :: total(:, :)

    type :: part_t
      complex(wp), pointer, contiguous :: value(:)
    end type part_t
    !> Fields times i (frequency, from)
    complex(wp), target :: rotated(chunk, 3)
    type(part_t) :: part(3)
    integer :: i, o, start, last, m, n_from, k(3)
    real(wp) :: sign(3)

    n_from = size(kernel, 2)
    do start = 1, size(field, 1), chunk
      last = min(start + chunk - 1, size(field, 1))
      m = last - start + 1
      do i = 1, n_from
        if (any(abs(kernel(:, i)) >= first_odd)) call rotate(m, field(start:last, i), rotated(:, i))
      end do
      do o = 1, size(kernel, 1)
        k(:n_from) = abs(kernel(o, :))
        sign(:n_from) = merge(1.0_wp, -1.0_wp, kernel(o, :) > 0)
        do i = 1, n_from
          if (k(i) >= first_odd) then
            part(i)%value => rotated(:m, i)
          else
            part(i)%value => field(start:last, i)
          end if
        end do
        select case (n_from)
        case (1)
          call add_1(m, sign, spectrum(start:last, k(1)), part(1)%value, total(start:last, o))
        case (2)
          call add_2(m, sign, spectrum(start:last, k(1)), part(1)%value, spectrum(start:last, k(2)), part(2)%value, &
                     total(start:last, o))
        case default
          call add_3(m, sign, spectrum(start:last, k(1)), part(1)%value, spectrum(start:last, k(2)), part(2)%value, &
                     spectrum(start:last, k(3)), part(3)%value, total(start:last, o))
        end select
      end do
    end do
  end subroutine multiply

  !> A field times i.
  pure subroutine rotate(n, field, rotated)
    !> Number of frequencies
    integer, intent(in) :: n
    complex(wp), intent(in) :: field(n)
    complex(wp), intent(inout) :: rotated(n)
    integer :: f

    do f = 1, n
      rotated(f) = cmplx(-aimag(field(f)), real(field(f), wp), wp)
    end do
  end subroutine rotate

  !> total = conjg(sign * spectrum * field)
  pure subroutine add_1(n, sign, s_1, f_1, total)
    !> Number of frequencies
    integer, intent(in) :: n
    !> Sign and spectrum of the kernel
    real(wp), intent(in) :: sign(1), s_1(n)
    !> Transformed field and result
    complex(wp), intent(in) :: f_1(n)
    complex(wp), intent(inout) :: total(n)
    real(wp) :: a
    integer :: f

    do f = 1, n
      a = sign(1)*s_1(f)
      total(f) = cmplx(a*real(f_1(f), wp), -a*aimag(f_1(f)), wp)
    end do
  end subroutine add_1

  !> total = conjg(sum over two fields of sign * spectrum * field)
  pure subroutine add_2(n, sign, s_1, f_1, s_2, f_2, total)
    !> Number of frequencies
    integer, intent(in) :: n
    !> Signs and spectra of the kernels
    real(wp), intent(in) :: sign(2), s_1(n), s_2(n)
    !> Transformed fields and result
    complex(wp), intent(in) :: f_1(n), f_2(n)
    complex(wp), intent(inout) :: total(n)
    real(wp) :: a, b
    integer :: f

    do f = 1, n
      a = sign(1)*s_1(f)
      b = sign(2)*s_2(f)
      total(f) = cmplx(a*real(f_1(f), wp) + b*real(f_2(f), wp), -a*aimag(f_1(f)) - b*aimag(f_2(f)), wp)
    end do
  end subroutine add_2

  !> total = conjg(sum over three fields of sign * spectrum * field)
  pure subroutine add_3(n, sign, s_1, f_1, s_2, f_2, s_3, f_3, total)
    !> Number of frequencies
    integer, intent(in) :: n
    !> Signs and spectra of the kernels
    real(wp), intent(in) :: sign(3), s_1(n), s_2(n), s_3(n)
    !> Transformed fields and result
    complex(wp), intent(in) :: f_1(n), f_2(n), f_3(n)
    complex(wp), intent(inout) :: total(n)
    real(wp) :: a, b, c
    integer :: f

    do f = 1, n
      a = sign(1)*s_1(f)
      b = sign(2)*s_2(f)
      c = sign(3)*s_3(f)
      total(f) = cmplx(a*real(f_1(f), wp) + b*real(f_2(f), wp) + c*real(f_3(f), wp), &
                       -a*aimag(f_1(f)) - b*aimag(f_2(f)) - c*aimag(f_3(f)), wp)
    end do
  end subroutine add_3

end module hc_spectral_product
