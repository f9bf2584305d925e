!> Operations on long vectors that threads share.
!>
!> Sums are taken in fixed blocks, so that they do not depend on the number of threads.
module hc_vectors
  use hc_precision, only: wp
  use hc_lapack, only: ddot
  implicit none
  private

  public :: fill, copy, add, maximum, total, dot, dots, add_columns, sum_block

  !> Terms that one thread adds up.
  integer, parameter :: sum_block = 4096

contains

  !> x <- value
  subroutine fill(x, value, n_threads)
    !> Vector
    real(wp), intent(out), contiguous :: x(:)
    real(wp), intent(in) :: value
    !> Threads to use
    integer, intent(in) :: n_threads
    integer :: i

    !$omp parallel do simd schedule(static) num_threads(n_threads)
    do i = 1, size(x)
      x(i) = value
    end do
    !$omp end parallel do simd
  end subroutine fill

  !> y <- x
  subroutine copy(x, y, n_threads)
    !> Vectors of equal length
    real(wp), intent(in), contiguous :: x(:)
    real(wp), intent(out), contiguous :: y(:)
    !> Threads to use
    integer, intent(in) :: n_threads
    integer :: i

    !$omp parallel do simd schedule(static) num_threads(n_threads)
    do i = 1, size(x)
      y(i) = x(i)
    end do
    !$omp end parallel do simd
  end subroutine copy

  !> y <- y + x
  subroutine add(x, y, n_threads)
    !> Vectors of equal length
    real(wp), intent(in), contiguous :: x(:)
    real(wp), intent(inout), contiguous :: y(:)
    !> Threads to use
    integer, intent(in) :: n_threads
    integer :: i

    !$omp parallel do simd schedule(static) num_threads(n_threads)
    do i = 1, size(x)
      y(i) = y(i) + x(i)
    end do
    !$omp end parallel do simd
  end subroutine add

  !> The largest element.
  real(wp) function maximum(x, n_threads)
    !> Vector
    real(wp), intent(in), contiguous :: x(:)
    !> Threads to use
    integer, intent(in) :: n_threads
    integer :: i

    maximum = -huge(1.0_wp)
    !$omp parallel do simd schedule(static) num_threads(n_threads) reduction(max: maximum)
    do i = 1, size(x)
      maximum = max(maximum, x(i))
    end do
    !$omp end parallel do simd
  end function maximum

  !> Sum of the elements.
  real(wp) function total(x, n_threads)
    !> Vector
    real(wp), intent(in), contiguous :: x(:)
    !> Threads to use
    integer, intent(in) :: n_threads
    real(wp) :: part((size(x) + sum_block - 1)/sum_block)
    integer :: k

    !$omp parallel do schedule(static) num_threads(n_threads)
    do k = 1, size(part)
      part(k) = sum(x((k - 1)*sum_block + 1:min(k*sum_block, size(x))))
    end do
    !$omp end parallel do
    total = sum(part)
  end function total

  !> x <- x + B share
  subroutine add_columns(b, share, x, n_threads)
    !> Vectors to be added
    real(wp), intent(in), contiguous :: b(:, :)
    !> Their factors
    real(wp), intent(in) :: share(:)
    !> What they are added to
    real(wp), intent(inout), contiguous :: x(:)
    !> Threads to use
    integer, intent(in) :: n_threads
    integer :: i, m, from, to

    !$omp parallel do schedule(static) num_threads(n_threads) private(i, m, to)
    do from = 1, size(x), sum_block
      to = min(from + sum_block - 1, size(x))
      do m = 1, size(share)
        do i = from, to
          x(i) = x(i) + share(m)*b(i, m)
        end do
      end do
    end do
    !$omp end parallel do
  end subroutine add_columns

  !> Scalar products of several vectors with one.
  function dots(b, x, n_threads)
    !> The several
    real(wp), intent(in), contiguous :: b(:, :)
    !> The one
    real(wp), intent(in), contiguous :: x(:)
    !> Threads to use
    integer, intent(in) :: n_threads
    real(wp) :: dots(size(b, 2))
    integer :: m

    do m = 1, size(b, 2)
      dots(m) = dot(b(:, m), x, n_threads)
    end do
  end function dots

  !> Scalar product, summed in fixed blocks.
  real(wp) function dot(a, b, n_threads)
    !> Vectors of equal length
    real(wp), intent(in), contiguous :: a(:), b(:)
    !> Threads to use
    integer, intent(in) :: n_threads
    real(wp) :: part((size(a) + sum_block - 1)/sum_block)
    integer :: k, from, to

    !$omp parallel do schedule(static) num_threads(n_threads) private(from, to)
    do k = 1, size(part)
      from = (k - 1)*sum_block + 1
      to = min(k*sum_block, size(a))
      part(k) = ddot(to - from + 1, a(from:to), 1, b(from:to), 1)
    end do
    !$omp end parallel do
    dot = sum(part)
  end function dot

end module hc_vectors
