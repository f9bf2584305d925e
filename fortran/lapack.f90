!> The procedures of BLAS and LAPACK that the library calls.
module hc_lapack
  use hc_precision, only: wp
  implicit none
  private

  public :: dgemv, dposv, dgesv, dgelss

  interface
    !> y = alpha A x + beta y
    subroutine dgemv(trans, m, n, alpha, a, lda, x, incx, beta, y, incy)
      import :: wp
      implicit none
      character(len=1), intent(in) :: trans
      integer, intent(in) :: m, n, lda, incx, incy
      real(wp), intent(in) :: alpha, beta, a(lda, *), x(*)
      real(wp), intent(inout) :: y(*)
    end subroutine dgemv

    !> Solve A X = B for a symmetric positive definite A (Cholesky)
    subroutine dposv(uplo, n, nrhs, a, lda, b, ldb, info)
      import :: wp
      implicit none
      character(len=1), intent(in) :: uplo
      integer, intent(in) :: n, nrhs, lda, ldb
      real(wp), intent(inout) :: a(lda, *), b(ldb, *)
      integer, intent(out) :: info
    end subroutine dposv

    !> Solve A X = B (LU with partial pivoting)
    subroutine dgesv(n, nrhs, a, lda, ipiv, b, ldb, info)
      import :: wp
      implicit none
      integer, intent(in) :: n, nrhs, lda, ldb
      real(wp), intent(inout) :: a(lda, *), b(ldb, *)
      integer, intent(out) :: ipiv(*), info
    end subroutine dgesv

    !> Solution of A X = B of least norm, of least squares where there is none (singular values)
    subroutine dgelss(m, n, nrhs, a, lda, b, ldb, s, rcond, rank, work, lwork, info)
      import :: wp
      implicit none
      integer, intent(in) :: m, n, nrhs, lda, ldb, lwork
      real(wp), intent(in) :: rcond
      real(wp), intent(inout) :: a(lda, *), b(ldb, *)
      real(wp), intent(out) :: s(*), work(*)
      integer, intent(out) :: rank, info
    end subroutine dgelss
  end interface

end module hc_lapack
