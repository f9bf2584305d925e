!> The procedures of BLAS and LAPACK that the library calls.
module hc_lapack
  use, intrinsic :: iso_fortran_env, only: real32
  use hc_precision, only: wp
  implicit none
  private

  public :: ddot, dgemm, dposv, dgesv, dsgesv, dgelss, spotrf, spotrs

  interface
    !> Scalar product
    pure real(wp) function ddot(n, dx, incx, dy, incy)
      import :: wp
      implicit none
      integer, intent(in) :: n, incx, incy
      real(wp), intent(in) :: dx(*), dy(*)
    end function ddot

    !> C = alpha A B + beta C
    subroutine dgemm(transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc)
      import :: wp
      implicit none
      character(len=1), intent(in) :: transa, transb
      integer, intent(in) :: m, n, k, lda, ldb, ldc
      real(wp), intent(in) :: alpha, beta, a(lda, *), b(ldb, *)
      real(wp), intent(inout) :: c(ldc, *)
    end subroutine dgemm

    !> Cholesky factor of a symmetric positive definite A, in single precision
    subroutine spotrf(uplo, n, a, lda, info)
      import :: real32
      implicit none
      character(len=1), intent(in) :: uplo
      integer, intent(in) :: n, lda
      real(real32), intent(inout) :: a(lda, *)
      integer, intent(out) :: info
    end subroutine spotrf

    !> Solve A X = B with the factor that spotrf returns
    subroutine spotrs(uplo, n, nrhs, a, lda, b, ldb, info)
      import :: real32
      implicit none
      character(len=1), intent(in) :: uplo
      integer, intent(in) :: n, nrhs, lda, ldb
      real(real32), intent(in) :: a(lda, *)
      real(real32), intent(inout) :: b(ldb, *)
      integer, intent(out) :: info
    end subroutine spotrs

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

    !> Solve A X = B (LU with partial pivoting in single precision, refined to full precision; should that
    !> fail, LU in full precision)
    subroutine dsgesv(n, nrhs, a, lda, ipiv, b, ldb, x, ldx, work, swork, iter, info)
      import :: wp, real32
      implicit none
      integer, intent(in) :: n, nrhs, lda, ldb, ldx
      real(wp), intent(inout) :: a(lda, *)
      real(wp), intent(in) :: b(ldb, *)
      real(wp), intent(out) :: x(ldx, *), work(n, *)
      real(real32), intent(out) :: swork(*)
      integer, intent(out) :: ipiv(*), iter, info
    end subroutine dsgesv

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
