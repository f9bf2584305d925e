!> Coulomb's law with two coefficients: friction along one direction and across it.
!>
!> The tractions that it allows are an ellipse,
!>
!>     (q_1/mu_1)^2 + (q_2/mu_2)^2 <= p^2,
!>
!> with q_1 along the first axis, and a node slips along the normal of its boundary,
!>
!>     ds = -kappa (q_1/mu_1^2, q_2/mu_2^2),     kappa >= 0:
!>
!> the flow rule is associated, so that the slip dissipates most (R. Michalowski, Z. Mroz, Arch. Mech. 30, 1978, 259-276; (F16) of
!> docs/theory/friction.md). Slip and traction are parallel only along the axes.
!>
!> With A = diag(sqrt(mu_1/mu_2), sqrt(mu_2/mu_1)) in these axes, A^-1 q and A ds obey Coulomb's law with the coefficient
!> sqrt(mu_1 mu_2): the law of the disc in the stretched plane (hc_disc_law).
module hc_orthotropic_coulomb
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_nodal_coulomb, only: nodal_coulomb_t
  implicit none
  private

  public :: orthotropic_coulomb_t

  !> Friction with a direction; its coefficient is sqrt(mu_1 mu_2).
  type, extends(nodal_coulomb_t) :: orthotropic_coulomb_t
    !> mu_1/mu_2
    real(wp) :: ratio = 1.0_wp
    !> Angle from x to the first axis [rad]
    real(wp) :: angle = 0.0_wp
  contains
    procedure :: is_isotropic, stretch, stretches, check
  end type orthotropic_coulomb_t

contains

  !> Return whether both coefficients are equal.
  pure logical function is_isotropic(self)
    class(orthotropic_coulomb_t), intent(in) :: self

    is_isotropic = abs(self%ratio - 1.0_wp) <= 0.0_wp
  end function is_isotropic

  !> Compute the matrix A in x and y.
  pure function stretch(self) result(matrix)
    class(orthotropic_coulomb_t), intent(in) :: self
    real(wp) :: matrix(2, 2), c, s, along, across

    c = cos(self%angle)
    s = sin(self%angle)
    along = sqrt(self%ratio)
    across = 1.0_wp/along
    matrix(:, 1) = [along*c**2 + across*s**2, (along - across)*c*s]
    matrix(:, 2) = [matrix(2, 1), along*s**2 + across*c**2]
  end function stretch

  !> Refuse coefficients, a ratio or an angle that make no sense.
  pure subroutine check(self, n_node, error)
    class(orthotropic_coulomb_t), intent(in) :: self
    integer, intent(in) :: n_node
    type(error_t), allocatable, intent(out) :: error
    logical :: sound

    call self%nodal_coulomb_t%check(n_node, error)
    if (allocated(error)) return
    sound = ieee_is_finite(self%ratio) .and. ieee_is_finite(self%angle)
    if (sound) sound = self%ratio > 0.0_wp
    if (.not. sound) call raise(error, status%invalid_input, &
                                'ratio of two coefficients of friction: a finite number above 0 expected, and a finite angle')
  end subroutine check

  !> Return the squares of the smallest and of the largest stretch.
  pure function stretches(self)
    class(orthotropic_coulomb_t), intent(in) :: self
    real(wp) :: stretches(2)

    stretches = [min(self%ratio, 1.0_wp/self%ratio), max(self%ratio, 1.0_wp/self%ratio)]
  end function stretches

end module hc_orthotropic_coulomb
