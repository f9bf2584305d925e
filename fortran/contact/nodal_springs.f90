!> Unilateral contact on springs that differ from node to node.
!>
!> Where the surface gives way by C p under a pressure p, C >= 0 and different at each node,
!>
!>     p >= 0,     g + C p >= 0,     p (g + C p) = 0.
!>
!> The layer is linear, so that its linearisation is the layer itself; a node with C = 0 is in unilateral contact.
!>
!> Equations: docs/theory/conditions.md, (C5); docs/theory/normal_contact.md, (N6).
module hc_nodal_springs
  use hc_precision, only: wp
  use hc_normal_law, only: unilateral_t, tangent_t
  implicit none
  private

  public :: nodal_springs_t

  !> A spring at each node.
  type, extends(unilateral_t) :: nodal_springs_t
    !> Compliance of the spring of each node of the window, row by row [m/Pa]
    real(wp), allocatable :: spring(:)
  contains
    procedure :: is_compliant, linearize, violation
  end type nodal_springs_t

contains

  !> Return true: there are springs.
  pure logical function is_compliant(self)
    class(nodal_springs_t), intent(in) :: self

    is_compliant = allocated(self%spring)
  end function is_compliant

  !> Return the springs themselves.
  pure subroutine linearize(self, first, tangent, p, gap, contact, compliance, offset)
    class(nodal_springs_t), intent(in) :: self
    integer, intent(in) :: first
    type(tangent_t), intent(in) :: tangent
    real(wp), intent(in), contiguous :: p(:), gap(:)
    logical, intent(in), contiguous :: contact(:)
    real(wp), intent(out), contiguous :: compliance(:), offset(:)

    associate (springs => self%spring(first:first + size(p) - 1))
      compliance = merge(min(springs, tangent%softest), 0.0_wp, contact)
      offset = 0.0_wp
    end associate
  end subroutine linearize

  !> Measure |min((d_n + C) p, g + C p)|/d_n: the error is a displacement, that of the spring included.
  pure subroutine violation(self, first, compliance, p, gap, candidate, worst)
    class(nodal_springs_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in) :: compliance
    real(wp), intent(in), contiguous :: p(:), gap(:)
    logical, intent(in), contiguous :: candidate(:)
    real(wp), intent(inout) :: worst
    integer :: i

    associate (springs => self%spring(first:first + size(p) - 1))
      do i = 1, size(p)
        if (.not. candidate(i)) cycle
        worst = max(worst, abs(springs(i)*p(i) + min(compliance*p(i), gap(i)))/compliance)
      end do
    end associate
  end subroutine violation

end module hc_nodal_springs
