!> Linear systems of two blocks, nearly symmetric positive definite and coupled weakly.
!>
!> The first unknowns are pressures, the others shear tractions. The second block and the symmetric part of the
!> first one that does not come from friction are factorized (Cholesky) in single precision; block elimination
!> with these factors is refined to full precision by the residuals of the whole matrix. That takes an eighth of
!> the operations of LU. Each correction leaves a share of the error that grows with the coupling: 0.035 for
!> beta = -0.19 and a coefficient of friction of 0.1, 0.09 for one of 0.6, next to nothing where shear does not
!> move the pressure.
module hc_block_cholesky
  use, intrinsic :: iso_fortran_env, only: real32
  use hc_precision, only: wp
  use hc_options, only: direct_options_t
  use hc_lapack, only: dgemm, spotrf, spotrs
  implicit none
  private

  public :: solve_blocks

  !> Residual, relative to the matrix and the largest unknown, that counts as rounding error.
  real(wp), parameter :: rounding = 4.0_wp*epsilon(1.0_wp)

contains

  !> Solve matrix.unknown = rhs for several right-hand sides at once.
  subroutine solve_blocks(n, n_1, first, matrix, rhs, unknown, solved, options)
    !> Numbers of unknowns, and of those in the first block
    integer, intent(in) :: n, n_1
    !> Symmetric positive definite part of the first block; its factor on return
    real(real32), intent(inout) :: first(n_1, n_1)
    !> Matrix; its second block is symmetric positive definite
    real(wp), intent(in) :: matrix(n, n)
    !> Right-hand sides (n, number of them)
    real(wp), intent(in), contiguous :: rhs(:, :)
    !> Unknowns, to rounding
    real(wp), intent(out), contiguous :: unknown(:, :)
    !> False: the coupling is too strong, a block not positive definite, single precision too narrow, or there is
    !> not enough memory; the unknowns mean nothing then
    logical, intent(out) :: solved
    !> Tuning numbers; absent: the usual ones
    type(direct_options_t), intent(in), optional :: options

    type(direct_options_t) :: tuning
    real(real32), allocatable :: second(:, :)
    real(real32) :: part_1(n_1, size(rhs, 2)), part_2(n - n_1, size(rhs, 2))
    real(wp) :: residual(n, size(rhs, 2)), correction(n, size(rhs, 2)), along(n - n_1, size(rhs, 2))
    real(wp), dimension(size(rhs, 2)) :: scale, left, bound, step, last
    real(wp) :: norm
    integer :: i, n_2, n_rhs, info, stat

    if (present(options)) tuning = options
    n_2 = n - n_1
    n_rhs = size(rhs, 2)
    solved = .false.
    unknown = 0.0_wp
    allocate (second(n_2, n_2), stat=stat)
    if (stat /= 0) return
    if (.not. all(abs(matrix(n_1 + 1:, n_1 + 1:)) < huge(1.0_real32))) return
    second = real(matrix(n_1 + 1:, n_1 + 1:), real32)
    call spotrf('L', n_1, first, n_1, info)
    if (info /= 0) return
    call spotrf('L', n_2, second, max(1, n_2), info)
    if (info /= 0) return
    norm = 0.0_wp
    do i = 1, n
      norm = max(norm, sum(abs(matrix(:, i))))
    end do

    residual = rhs
    last = huge(1.0_wp)
    do i = 1, tuning%max_corrections
      scale = maxval(abs(residual), dim=1)
      where (.not. scale > 0.0_wp) scale = 1.0_wp
      ! the residuals as numbers about 1, in the range of single precision
      residual = residual/spread(scale, 1, n)
      part_1 = real(residual(:n_1, :), real32)
      call spotrs('L', n_1, n_rhs, first, n_1, part_1, n_1, info)
      correction(:n_1, :) = part_1
      along = residual(n_1 + 1:, :)
      call dgemm('N', 'N', n_2, n_rhs, n_1, -1.0_wp, matrix(min(n, n_1 + 1), 1), n, correction, n, &
                 1.0_wp, along, max(1, n_2))
      part_2 = real(along, real32)
      call spotrs('L', n_2, n_rhs, second, max(1, n_2), part_2, max(1, n_2), info)
      correction(n_1 + 1:, :) = part_2
      correction = correction*spread(scale, 1, n)

      unknown = unknown + correction
      residual = rhs
      call dgemm('N', 'N', n, n_rhs, n, -1.0_wp, matrix, n, unknown, n, 1.0_wp, residual, n)
      left = maxval(abs(residual), dim=1)
      bound = rounding*norm*maxval(abs(unknown), dim=1)
      step = maxval(abs(correction), dim=1)
      solved = all(left <= bound)
      if (solved) return
      if (.not. all(step <= tuning%largest_share*last .or. left <= bound)) then
        solved = all(left <= sqrt(real(n, wp))*bound)  ! no further for rounding, or no convergence
        return
      end if
      last = step
    end do
  end subroutine solve_blocks

end module hc_block_cholesky
