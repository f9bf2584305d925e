!> Transforms of two real rows from that of a complex one, whose real and imaginary parts they are.
!>
!> With Z = X + i Y and the transforms of real rows being hermitian,
!> X(f) = (Z(f) + conjg(Z(-f)))/2 and Y(f) = (Z(f) - conjg(Z(-f)))/(2 i).
module hc_row_pairs
  use hc_precision, only: wp
  implicit none
  private

  public :: split_rows, join_rows

contains

  !> Transforms of the real and of the imaginary part, at the frequencies 0...n/2.
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

  !> The conjugate of X + i Y at all frequencies, from the conjugates of X and Y at 0...n/2.
  pure subroutine join_rows(first, second, both)
    !> Conjugates of the transforms of two real rows (0:n/2)
    complex(wp), intent(in), contiguous :: first(0:), second(0:)
    !> Conjugate of the transform of the complex row (0:n-1), n even
    complex(wp), intent(out), contiguous :: both(0:)
    integer :: f, n
    real(wp) :: re_1, im_1, re_2, im_2

    n = size(both)
    ! what is imaginary at the ends belongs to no real row
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

end module hc_row_pairs
