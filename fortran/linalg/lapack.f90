!> Procedures of BLAS and LAPACK.
module hc_lapack
  use, intrinsic :: iso_fortran_env, only: real32, int64
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_memory, only: require_memory
  implicit none
  private

  public :: dgemm, dposv, dsgesv, dgelss, spotrf, spotrs, sgemm, sgemv, ssyrk, strsm, strsv
  public :: prepare_lapack, eliminate, least_squares

  !> Bytes of address space that OpenBLAS takes for a buffer when it is first called, and a reserve.
  integer(int64), parameter :: buffer_space = 160000000

  interface
    !> Compute C = alpha A B + beta C (BLAS)
    subroutine dgemm(transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc)
      import :: wp
      implicit none
      character(len=1), intent(in) :: transa, transb
      integer, intent(in) :: m, n, k, lda, ldb, ldc
      real(wp), intent(in) :: alpha, beta, a(lda, *), b(ldb, *)
      real(wp), intent(inout) :: c(ldc, *)
    end subroutine dgemm

    !> Compute C = alpha A B + beta C, in single precision
    subroutine sgemm(transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc)
      import :: real32
      implicit none
      character(len=1), intent(in) :: transa, transb
      integer, intent(in) :: m, n, k, lda, ldb, ldc
      real(real32), intent(in) :: alpha, beta, a(lda, *), b(ldb, *)
      real(real32), intent(inout) :: c(ldc, *)
    end subroutine sgemm

    !> Compute y <- alpha A x + beta y, or with A^T, in single precision
    subroutine sgemv(trans, m, n, alpha, a, lda, x, incx, beta, y, incy)
      import :: real32
      implicit none
      character(len=1), intent(in) :: trans
      integer, intent(in) :: m, n, lda, incx, incy
      real(real32), intent(in) :: alpha, beta, a(lda, *), x(*)
      real(real32), intent(inout) :: y(*)
    end subroutine sgemv

    !> Compute x <- A^-1 x for a triangular A, in single precision
    subroutine strsv(uplo, trans, diag, n, a, lda, x, incx)
      import :: real32
      implicit none
      character(len=1), intent(in) :: uplo, trans, diag
      integer, intent(in) :: n, lda, incx
      real(real32), intent(in) :: a(lda, *)
      real(real32), intent(inout) :: x(*)
    end subroutine strsv

    !> Compute C = alpha A A^T + beta C for one triangle of C, in single precision
    subroutine ssyrk(uplo, trans, n, k, alpha, a, lda, beta, c, ldc)
      import :: real32
      implicit none
      character(len=1), intent(in) :: uplo, trans
      integer, intent(in) :: n, k, lda, ldc
      real(real32), intent(in) :: alpha, beta, a(lda, *)
      real(real32), intent(inout) :: c(ldc, *)
    end subroutine ssyrk

    !> Compute B <- alpha A^-1 B or alpha B A^-1 for a triangular A, in single precision
    subroutine strsm(side, uplo, transa, diag, m, n, alpha, a, lda, b, ldb)
      import :: real32
      implicit none
      character(len=1), intent(in) :: side, uplo, transa, diag
      integer, intent(in) :: m, n, lda, ldb
      real(real32), intent(in) :: alpha, a(lda, *)
      real(real32), intent(inout) :: b(ldb, *)
    end subroutine strsm

    !> Compute the Cholesky factor of a symmetric positive definite A, in single precision
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

    !> Compute the solution of A X = B of least norm, of least squares where there is none (singular values)
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

contains

  !> Let LAPACK allocate its buffers now: without memory for them OpenBLAS waits for ever.
  subroutine prepare_lapack(error)
    !> Allocated if there is no memory for them
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: matrix(1, 1), rhs(1, 1)
    integer :: info

    call require_memory(buffer_space, error)
    if (allocated(error)) return
    matrix = 1.0_wp
    rhs = 1.0_wp
    call dposv('U', 1, 1, matrix, 1, rhs, 1, info)
  end subroutine prepare_lapack

  !> Solve A X = B for a handful of unknowns, by elimination with partial pivoting; no buffers of LAPACK are needed.
  pure subroutine eliminate(a, b)
    !> Matrix (n, n); on return its upper triangle is that of the LU factors
    real(wp), intent(inout) :: a(:, :)
    !> Right-hand sides (n, number); on return the solutions, of no use if a pivot vanishes
    real(wp), intent(inout) :: b(:, :)
    integer :: i, k, n, pivot

    n = size(a, 1)
    do k = 1, n
      pivot = k - 1 + maxloc(abs(a(k:, k)), dim=1)
      a([k, pivot], :) = a([pivot, k], :)
      b([k, pivot], :) = b([pivot, k], :)
      if (abs(a(k, k)) <= 0.0_wp) return
      do i = k + 1, n
        b(i, :) = b(i, :) - a(i, k)/a(k, k)*b(k, :)
        a(i, k:) = a(i, k:) - a(i, k)/a(k, k)*a(k, k:)
      end do
    end do
    do k = n, 1, -1
      b(k, :) = (b(k, :) - matmul(a(k, k + 1:), b(k + 1:, :)))/a(k, k)
    end do
  end subroutine eliminate

  !> Solve A x = b in the sense of least squares.
  subroutine least_squares(a, b, x, error)
    !> Matrix (m, n) with m >= n; overwritten
    real(wp), intent(inout), contiguous :: a(:, :)
    !> Right-hand side (m)
    real(wp), intent(in) :: b(:)
    !> Solution (n) of least norm
    real(wp), intent(out) :: x(:)
    !> Allocated if there is no memory, or the singular values are not found
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: singular(size(x)), best_size(1)
    real(wp), allocatable :: work(:), rhs(:, :)
    integer :: rank, info

    x = 0.0_wp
    call prepare_lapack(error)
    if (allocated(error)) return
    associate (m => size(a, 1), n => size(a, 2))
      rhs = reshape(b, [m, 1])
      call dgelss(m, n, 1, a, m, rhs, m, singular, m*epsilon(1.0_wp), rank, best_size, -1, info)
      allocate (work(int(best_size(1))))
      call dgelss(m, n, 1, a, m, rhs, m, singular, m*epsilon(1.0_wp), rank, work, size(work), info)
      x = rhs(:n, 1)
    end associate
    if (info /= 0) call raise(error, status%no_convergence, 'the singular values of a least-squares fit were not found')
  end subroutine least_squares

end module hc_lapack
