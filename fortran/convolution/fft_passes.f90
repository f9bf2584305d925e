!> Passes of a convolution between its 1-D transforms: pairs of rows, blocks of columns, products with spectra.
!>
!> Two real rows X and Y are the parts of one complex row. With Z = X + i Y and the transforms of real rows being
!> hermitian, X(f) = (Z(f) + conjg(Z(-f)))/2 and Y(f) = (Z(f) - conjg(Z(-f)))/(2 i).
!>
!> Some columns of the transformed rows are laid one after the other: FFTW's estimated plans for contiguous columns out of
!> place take half to two thirds of the time that they take for interleaved ones in place. The number of columns is a
!> multiple of four.
!>
!> Products with spectra are conjugated: the forward transform of a conjugate is the conjugate of the inverse transform,
!> so that one plan serves both directions.
module hc_fft_passes
  use hc_precision, only: wp
  implicit none
  private

  public :: complement, pair_rows, split_rows, join_rows, gather_columns, scatter_columns, multiply_one, multiply

  !> Number of the kernel that is a multiple of the first one less the second one, and needs no spectrum.
  integer, parameter :: complement = 0

  !> Number of frequencies that are multiplied at a time.
  integer, parameter :: chunk = 128

contains

  !> Split the transform of two real rows into those of each, at the frequencies 0...n/2.
  pure subroutine split_rows(both, first, second)
    !> Transform of the complex row (0:n-1), n even
    complex(wp), intent(in), contiguous :: both(0:)
    !> Transforms of its parts (0:n/2)
    complex(wp), intent(out), contiguous :: first(0:), second(0:)
    integer :: f, n
    real(wp) :: re, im, re_opposite, im_opposite

    n = size(both)
    first(0) = real(both(0), wp)
    second(0) = aimag(both(0))
    do f = 1, n/2
      re = real(both(f), wp)
      im = aimag(both(f))
      re_opposite = real(both(n - f), wp)
      im_opposite = aimag(both(n - f))
      first(f) = 0.5_wp*cmplx(re + re_opposite, im - im_opposite, wp)
      second(f) = 0.5_wp*cmplx(im + im_opposite, re_opposite - re, wp)
    end do
  end subroutine split_rows

  !> Pair two real rows as the parts of a complex one.
  pure subroutine pair_rows(n, first, second, both)
    !> Number of nodes of a row
    integer, intent(in) :: n
    !> The rows
    real(wp), intent(in) :: first(n), second(n)
    !> The complex row; values beyond it stay
    complex(wp), intent(inout) :: both(n)
    integer :: col

    do col = 1, n
      both(col) = cmplx(first(col), second(col), wp)
    end do
  end subroutine pair_rows

  !> Compute the conjugate of X + i Y at all frequencies, from the conjugates of X and Y at 0...n/2.
  pure subroutine join_rows(first, second, both)
    !> Conjugates of the transforms of two real rows (0:n/2)
    complex(wp), intent(in), contiguous :: first(0:), second(0:)
    !> Conjugate of the transform of the complex row (0:n-1), n even
    complex(wp), intent(out), contiguous :: both(0:)
    integer :: f, n
    real(wp) :: re_1, im_1, re_2, im_2

    n = size(both)
    ! imaginary parts at the ends belong to no real row
    both(0) = cmplx(real(first(0), wp), -real(second(0), wp), wp)
    both(n/2) = cmplx(real(first(n/2), wp), -real(second(n/2), wp), wp)
    do f = 1, n/2 - 1
      re_1 = real(first(f), wp)
      im_1 = aimag(first(f))
      re_2 = real(second(f), wp)
      im_2 = aimag(second(f))
      both(n - f) = cmplx(re_1 - im_2, -im_1 - re_2, wp)
      both(f) = cmplx(re_1 + im_2, im_1 - re_2, wp)
    end do
  end subroutine join_rows

  !> Copy columns one after the other, padded with zeros.
  pure subroutine gather_columns(width, n_row, leading, length, matrix, columns)
    !> Number of columns and rows, distance of two rows, length of a padded column
    integer, intent(in) :: width, n_row, leading, length
    !> The matrix, from the first of the columns on
    complex(wp), intent(in) :: matrix(leading*(n_row - 1) + width)
    !> The columns
    complex(wp), intent(inout) :: columns(0:length - 1, 0:width - 1)
    integer :: row, k, i

    do row = 0, n_row - 1
      i = row*leading
      do k = 0, width - 4, 4
        columns(row, k) = matrix(i + k + 1)
        columns(row, k + 1) = matrix(i + k + 2)
        columns(row, k + 2) = matrix(i + k + 3)
        columns(row, k + 3) = matrix(i + k + 4)
      end do
    end do
    columns(n_row:, :) = 0.0_wp
  end subroutine gather_columns

  !> Copy the columns back, without the padding.
  pure subroutine scatter_columns(width, n_row, length, leading, columns, matrix)
    !> Number of columns and rows, length of a padded column, distance of two rows
    integer, intent(in) :: width, n_row, length, leading
    !> The columns
    complex(wp), intent(in) :: columns(0:length - 1, 0:width - 1)
    !> The matrix, from the first of the columns on
    complex(wp), intent(inout) :: matrix(leading*(n_row - 1) + width)
    integer :: row, k, i

    do row = 0, n_row - 1
      i = row*leading
      do k = 0, width - 4, 4
        matrix(i + k + 1) = columns(row, k)
        matrix(i + k + 2) = columns(row, k + 1)
        matrix(i + k + 3) = columns(row, k + 2)
        matrix(i + k + 4) = columns(row, k + 3)
      end do
    end do
  end subroutine scatter_columns

  !> Multiply one field by one kernel, as in the operator of frictionless contact: conjg(spectrum * field).
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

  !> Multiply up to three fields by any kernels: the conjugates of the sums over the fields. Kernels beyond the spectra are zero.
  subroutine multiply(spectrum, first_odd, whole, kernel, field, total)
    !> Spectra (frequency, kernel); those of odd kernels are divided by i
    real(wp), intent(in), target :: spectrum(:, :)
    !> The first odd kernel
    integer, intent(in) :: first_odd
    !> The kernel `complement` is this times the first one less the second one
    real(wp), intent(in) :: whole
    !> Number of the kernel (onto, from), negative to reverse its sign
    integer, intent(in) :: kernel(:, :)
    !> Transformed fields and results (frequency, from and onto)
    complex(wp), intent(in), contiguous, target :: field(:, :)
    complex(wp), intent(inout), contiguous :: total(:, :)

    type :: part_t
      complex(wp), pointer, contiguous :: value(:)
      real(wp), pointer :: spectrum(:)
    end type part_t
    !> Fields times i (frequency, from)
    complex(wp), target :: rotated(chunk, 3)
    !> Spectrum of the complement
    real(wp), target :: rest(chunk)
    type(part_t) :: part(3)
    integer :: i, o, start, last, m, n_part
    real(wp) :: sign(3)

    do start = 1, size(field, 1), chunk
      last = min(start + chunk - 1, size(field, 1))
      m = last - start + 1
      do i = 1, size(kernel, 2)
        if (any(abs(kernel(:, i)) >= first_odd .and. abs(kernel(:, i)) <= size(spectrum, 2))) then
          call rotate(m, field(start:last, i), rotated(:, i))
        end if
      end do
      if (any(kernel == complement)) rest(:m) = whole*spectrum(start:last, 1) - spectrum(start:last, 2)
      do o = 1, size(kernel, 1)
        n_part = 0
        do i = 1, size(kernel, 2)
          if (abs(kernel(o, i)) > size(spectrum, 2)) cycle
          n_part = n_part + 1
          sign(n_part) = merge(1.0_wp, -1.0_wp, kernel(o, i) >= 0)
          if (abs(kernel(o, i)) >= first_odd) then
            part(n_part)%value => rotated(:m, i)
          else
            part(n_part)%value => field(start:last, i)
          end if
          if (kernel(o, i) == complement) then
            part(n_part)%spectrum => rest(:m)
          else
            part(n_part)%spectrum => spectrum(start:last, abs(kernel(o, i)))
          end if
        end do
        select case (n_part)
        case (0)
          total(start:last, o) = (0.0_wp, 0.0_wp)
        case (1)
          call multiply_one(m, part(1)%spectrum, part(1)%value, total(start:last, o))
          if (sign(1) < 0.0_wp) total(start:last, o) = -total(start:last, o)
        case (2)
          call add_2(sign, part(1)%spectrum, part(1)%value, part(2)%spectrum, part(2)%value, total(start:last, o))
        case default
          call add_3(sign, part(1)%spectrum, part(1)%value, part(2)%spectrum, part(2)%value, part(3)%spectrum, &
                     part(3)%value, total(start:last, o))
        end select
      end do
    end do
  end subroutine multiply

  !> Multiply a field by i.
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

  !> Compute total = conjg(sum over two fields of sign * spectrum * field)
  pure subroutine add_2(sign, s_1, f_1, s_2, f_2, total)
    !> Signs and spectra of the kernels
    real(wp), intent(in) :: sign(2)
    real(wp), intent(in), contiguous :: s_1(:), s_2(:)
    !> Transformed fields and result
    complex(wp), intent(in), contiguous :: f_1(:), f_2(:)
    complex(wp), intent(inout), contiguous :: total(:)
    real(wp) :: a, b
    integer :: f

    do f = 1, size(total)
      a = sign(1)*s_1(f)
      b = sign(2)*s_2(f)
      total(f) = cmplx(a*real(f_1(f), wp) + b*real(f_2(f), wp), -a*aimag(f_1(f)) - b*aimag(f_2(f)), wp)
    end do
  end subroutine add_2

  !> Compute total = conjg(sum over three fields of sign * spectrum * field)
  pure subroutine add_3(sign, s_1, f_1, s_2, f_2, s_3, f_3, total)
    !> Signs and spectra of the kernels
    real(wp), intent(in) :: sign(3)
    real(wp), intent(in), contiguous :: s_1(:), s_2(:), s_3(:)
    !> Transformed fields and result
    complex(wp), intent(in), contiguous :: f_1(:), f_2(:), f_3(:)
    complex(wp), intent(inout), contiguous :: total(:)
    real(wp) :: a, b, c
    integer :: f

    do f = 1, size(total)
      a = sign(1)*s_1(f)
      b = sign(2)*s_2(f)
      c = sign(3)*s_3(f)
      total(f) = cmplx(a*real(f_1(f), wp) + b*real(f_2(f), wp) + c*real(f_3(f), wp), &
                       -a*aimag(f_1(f)) - b*aimag(f_2(f)) - c*aimag(f_3(f)), wp)
    end do
  end subroutine add_3

end module hc_fft_passes
