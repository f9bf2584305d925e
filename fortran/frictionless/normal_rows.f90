!> Passes over one row of nodes in a frictionless contact, written so that the compiler vectorises them.
!>
!> Equations: docs/theory/normal_contact.md, (N2).
module hc_normal_rows
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp, sp
  implicit none
  private

  public :: classify_row, add_row, largest_of

contains

  !> Compute the residuals of the nodes of a row, and find which of them pressure and gap call for.
  pure subroutine classify_row(n, r, stiffness, approach, initial_gap, pressure, closing, candidate, active, next, &
                            p_max, worst, worst_active, n_next, n_changed, n_wrong)
    !> Number of nodes
    integer, intent(in) :: n
    !> Classification parameter, and inverse of the self-compliance [Pa/m]
    real(wp), intent(in) :: r, stiffness
    !> Approach, gap of the undeformed bodies, pressure and the closing of the gap
    real(wp), intent(in) :: approach, initial_gap(n), pressure(n), closing(n)
    logical, intent(in) :: candidate(n), active(n)
    logical, intent(out) :: next(n)
    !> What the rows before gave, and now this one too
    real(wp), intent(inout) :: p_max, worst, worst_active
    integer, intent(inout) :: n_next, n_changed
    !> Nodes whose pressure or gap is not a finite number
    integer, intent(inout) :: n_wrong
    real(wp) :: gap(n)
    integer :: enters(n), col

    ! without branches, so that several nodes are judged at a time
    do col = 1, n
      gap(col) = initial_gap(col) + closing(col) - approach
      enters(col) = merge(1, 0, pressure(col) - r*gap(col) > 0.0_wp)*merge(1, 0, candidate(col))
    end do
    !$omp simd reduction(max: p_max, worst, worst_active) reduction(+: n_wrong)
    do col = 1, n
      p_max = max(p_max, pressure(col))
      worst = max(worst, merge(abs(min(pressure(col), stiffness*gap(col))), 0.0_wp, candidate(col)))
      worst_active = max(worst_active, merge(abs(gap(col)), 0.0_wp, active(col)))
      n_wrong = n_wrong + merge(0, 1, ieee_is_finite(pressure(col)) .and. (ieee_is_finite(gap(col)) .or. .not. candidate(col)))
    end do
    next = enters == 1
    n_next = n_next + sum(enters)
    n_changed = n_changed + sum(abs(enters - merge(1, 0, active)))
  end subroutine classify_row

  !> Add to a field: field <- field + factor * change
  pure subroutine add_row(n, factor, change, field)
    !> Number of nodes
    integer, intent(in) :: n
    real(wp), intent(in) :: factor
    real(sp), intent(in) :: change(n)
    real(wp), intent(inout) :: field(n)
    integer :: col

    do col = 1, n
      field(col) = field(col) + factor*change(col)
    end do
  end subroutine add_row

  !> Compute the largest absolute value.
  pure real(sp) function largest_of(n, field)
    !> Number of nodes
    integer, intent(in) :: n
    real(sp), intent(in) :: field(n)
    integer :: col

    largest_of = 0.0_sp
    !$omp simd reduction(max: largest_of)
    do col = 1, n
      largest_of = max(largest_of, abs(field(col)))
    end do
  end function largest_of

end module hc_normal_rows
