!> The recurrence of preconditioned conjugate gradients, for vectors of any kind and storage.
!>
!>     d <- z + (r^T z)/(r^T z of the last direction) d,     x <- x + (r^T z)/(d^T A d) d,     z = M r
!>
!> (M. R. Hestenes and E. Stiefel, J. Res. Natl. Bur. Stand. 49, 1952, 409-436; projected on constraints as in (F11) of
!> docs/theory/friction.md; with sets of nodes that change as in (N5) of docs/theory/normal_contact.md).
module hc_conjugate_gradient
  use hc_precision, only: wp
  implicit none
  private

  public :: conjugate_gradient_t

  !> Where the recurrence stands.
  type :: conjugate_gradient_t
    !> r^T z of the last direction; not positive: there is none, the next direction is z
    real(wp), private :: rz = 0.0_wp
  contains
    !> Discard the last direction
    procedure :: restart
    !> Share of the last direction in the next
    procedure :: last_share
    !> Length of the step along the direction
    procedure :: step_length
  end type conjugate_gradient_t

contains

  !> Discard the last direction.
  pure subroutine restart(self)
    class(conjugate_gradient_t), intent(inout) :: self
    self%rz = 0.0_wp
  end subroutine restart

  !> Compute the share of the last direction in the next, zero if there is none.
  pure subroutine last_share(self, rz, share, anew)
    class(conjugate_gradient_t), intent(inout) :: self
    !> r^T z
    real(wp), intent(in) :: rz
    real(wp), intent(out) :: share
    !> There is no last direction
    logical, intent(out) :: anew

    anew = .not. self%rz > 0.0_wp
    share = 0.0_wp
    if (.not. anew) share = rz/self%rz
    self%rz = rz
  end subroutine last_share

  !> Compute the length of the step along the direction; zero: nothing is left to gain in working precision, or a matrix is not
  !> positive definite.
  pure real(wp) function step_length(self, curvature)
    class(conjugate_gradient_t), intent(in) :: self
    !> d^T A d
    real(wp), intent(in) :: curvature

    step_length = 0.0_wp
    if (curvature > 0.0_wp .and. self%rz > 0.0_wp) step_length = self%rz/curvature
  end function step_length

end module hc_conjugate_gradient
