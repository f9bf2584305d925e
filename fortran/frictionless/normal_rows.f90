!> Passes over one row of nodes in a frictionless contact, written so that the compiler vectorises them.
!>
!> Equations: docs/theory/normal_contact.md, (N2) to (N5).
module hc_normal_rows
  use hc_precision, only: wp, sp, lk
  implicit none
  private

  public :: limits_t, classification_t
  public :: classify_row, residual_row, sum_row, projected_row, direction_row, add_row, dot_single, largest_of

  !> Limits of a classification.
  type :: limits_t
    !> Classification parameter, and inverse of the self-compliance [Pa/m]
    real(wp) :: r = 0.0_wp, stiffness = 0.0_wp
    !> Approach [m]
    real(wp) :: approach = 0.0_wp
  end type limits_t

  !> Classification of the nodes of a row.
  type :: classification_t
    !> Largest pressure [Pa]; largest residual of the conditions, and on the active nodes of their linearisation
    real(wp) :: p_max = 0.0_wp, worst = 0.0_wp, worst_active = 0.0_wp
    !> Under a compliant law: largest residual of the nodes that would enter or leave the set
    real(wp) :: worst_changed = 0.0_wp
    !> Nodes of the next set, and nodes that would enter or leave
    integer :: n_next = 0, n_changed = 0
    !> Pressure and closing are finite numbers
    logical :: finite = .true.
  end type classification_t

contains

  !> Compute the residuals of the nodes of a row, and find which of them pressure and gap call for.
  pure subroutine classify_row(limits, initial_gap, pressure, closing, candidate, active, next, found)
    !> Limits of the classification
    type(limits_t), intent(in) :: limits
    !> Gap of the undeformed bodies, pressure and the closing of the gap
    real(wp), intent(in), contiguous :: initial_gap(:), pressure(:), closing(:)
    logical(lk), intent(in), contiguous :: candidate(:), active(:)
    logical(lk), intent(out), contiguous :: next(:)
    !> Residuals and numbers of nodes
    type(classification_t), intent(out) :: found
    real(wp) :: gap(size(next)), rest, p_max, worst, worst_active
    integer, dimension(size(next)) :: possible, carries, enters
    integer :: n, col

    n = size(next)
    ! without branches, and the sets as numbers, so that several nodes are judged at a time
    do col = 1, n
      possible(col) = merge(1, 0, candidate(col))
      carries(col) = merge(1, 0, active(col))
    end do
    do col = 1, n
      gap(col) = initial_gap(col) + closing(col) - limits%approach
      enters(col) = merge(1, 0, pressure(col) - limits%r*gap(col) > 0.0_wp)*merge(1, 0, candidate(col))
    end do
    ! the gap may be infinite where nothing can touch; a number less itself is 0, unless it is infinite or none
    p_max = 0.0_wp
    worst = 0.0_wp
    worst_active = 0.0_wp
    rest = 0.0_wp
    !$omp simd reduction(max: p_max, worst, worst_active) reduction(+: rest)
    do col = 1, n
      p_max = max(p_max, pressure(col))
      worst = max(worst, abs(min(pressure(col), limits%stiffness*gap(col)))*possible(col))
      worst_active = max(worst_active, abs(min(gap(col), huge(1.0_wp)))*carries(col))
      rest = rest + (pressure(col) - pressure(col)) + (closing(col) - closing(col))
    end do
    do col = 1, n
      next(col) = enters(col) == 1
    end do
    found = classification_t(p_max, worst, worst_active, n_next=sum(enters), n_changed=sum(abs(enters - carries)), &
                             finite=abs(rest) <= 0.0_wp)
  end subroutine classify_row

  !> Compute r = approach - h - w at the active nodes of a row, in single precision; the others stay.
  pure subroutine residual_row(n, scale, approach, initial_gap, closing, active, r)
    !> Number of nodes
    integer, intent(in) :: n
    !> Inverse of the unit of r [1/m], approach, gap of the undeformed bodies and its closing [m]
    real(wp), intent(in) :: scale, approach, initial_gap(n), closing(n)
    logical(lk), intent(in) :: active(n)
    real(sp), intent(inout) :: r(n)
    !> Lowest number of single precision: the gap may be infinite where nothing can touch
    real(wp), parameter :: lowest = -huge(1.0_sp)
    real(sp) :: residual(n)
    integer :: carries(n), col

    do col = 1, n
      carries(col) = merge(1, 0, active(col))
    end do
    do col = 1, n
      residual(col) = real(max(scale*(approach - initial_gap(col) - closing(col)), lowest), sp)
    end do
    do col = 1, n
      r(col) = carries(col)*residual(col) + (1 - carries(col))*r(col)
    end do
  end subroutine residual_row

  !> Add up a field over the active nodes of a row, and its product with another one.
  pure subroutine sum_row(n, field, active, total, other, product)
    !> Number of nodes
    integer, intent(in) :: n
    real(sp), intent(in) :: field(n)
    logical(lk), intent(in) :: active(n)
    !> The sum
    real(wp), intent(inout) :: total
    real(sp), intent(in), optional :: other(n)
    !> Sum of the products
    real(wp), intent(inout), optional :: product
    real(sp) :: part(n), value
    integer :: col

    do col = 1, n
      value = field(col)
      part(col) = merge(value, 0.0_sp, active(col))
    end do
    !$omp simd reduction(+: total)
    do col = 1, n
      total = total + part(col)
    end do
    if (present(other)) product = product + dot_single(n, other, part)
  end subroutine sum_row

  !> Compute d = max(p + length z - off punch, 0) - p at the active nodes of a row, -p at the others.
  pure subroutine projected_row(unit, pressure, active, d, total, step, z, punch, punch_total)
    !> Unit of d and z [Pa], and pressure [Pa]
    real(wp), intent(in) :: unit
    real(wp), intent(in), contiguous :: pressure(:)
    logical(lk), intent(in), contiguous :: active(:)
    !> The direction
    real(sp), intent(out), contiguous :: d(:)
    !> Sum of p + d, to which those of the row are added
    real(wp), intent(inout) :: total
    !> Length of the step, and share of the pressure of a punch that is taken off
    real(wp), intent(in) :: step(2)
    !> The direction
    real(sp), intent(in), contiguous :: z(:)
    !> The pressure of a punch; absent: none is taken off
    real(sp), intent(in), optional, contiguous :: punch(:)
    !> Sum of the punch where p + d is positive, likewise
    real(wp), intent(inout), optional :: punch_total
    real(wp), dimension(size(d)) :: before, aim
    integer :: carries(size(d)), col

    do col = 1, size(d)
      carries(col) = merge(1, 0, active(col))
    end do
    before = pressure/unit
    aim = before + step(1)*z
    if (present(punch)) aim = aim - step(2)*punch
    !$omp simd reduction(+: total)
    do col = 1, size(d)
      aim(col) = carries(col)*max(aim(col), 0.0_wp)
      total = total + aim(col)
      d(col) = real(aim(col) - before(col), sp)
    end do
    if (.not. present(punch_total)) return
    !$omp simd reduction(+: punch_total)
    do col = 1, size(d)
      punch_total = punch_total + merge(real(punch(col), wp), 0.0_wp, aim(col) > 0.0_wp)
    end do
  end subroutine projected_row

  !> Compute d <- z + back d at the active nodes of a row, 0 at the others.
  pure subroutine direction_row(n, back, z, active, d)
    !> Number of nodes
    integer, intent(in) :: n
    !> Share of the last direction, and the preconditioned residual
    real(sp), intent(in) :: back, z(n)
    logical(lk), intent(in) :: active(n)
    real(sp), intent(inout) :: d(n)
    integer :: carries(n), col

    do col = 1, n
      carries(col) = merge(1, 0, active(col))
    end do
    do col = 1, n
      d(col) = carries(col)*(z(col) + back*d(col))
    end do
  end subroutine direction_row

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

  !> Compute a scalar product of fields in single precision, in double precision.
  pure real(wp) function dot_single(n, first, second)
    !> Number of nodes
    integer, intent(in) :: n
    real(sp), intent(in) :: first(n), second(n)
    integer :: col

    dot_single = 0.0_wp
    !$omp simd reduction(+: dot_single)
    do col = 1, n
      dot_single = dot_single + real(first(col), wp)*second(col)
    end do
  end function dot_single

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
