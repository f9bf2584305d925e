!> Dissimilar bodies pressed monotonically: no slip, and slip where shear does not move the pressure.
!>
!> V. I. Mossakovskii, J. Appl. Math. Mech. 27 (1963) 418-427; D. A. Spence, Proc. R. Soc. A 305 (1968) 55-80 and
!> J. Elasticity 5 (1975) 297-319; L. E. Goodman, J. Appl. Mech. 29 (1962) 515-522. beta is Dundurs' constant.
!>
!> Equations: docs/theory/closed_solutions.md.
module hc_self_similar
  use hc_precision, only: wp, pi
  use hc_carlson, only: complete_k
  use hc_scalar_function, only: scalar_function_t, zero_between, integral
  implicit none
  private

  public :: no_slip_constants, goodman_stick_ratio, goodman_stick_ratio_plane

  !> Integrand of 1/(2 chi) by s, t = tanh(s/2).
  type, extends(scalar_function_t) :: no_slip_integrand_t
    !> artanh(beta)/pi
    real(wp) :: frequency = 0.0_wp
  contains
    procedure :: at => no_slip_integrand
  end type no_slip_integrand_t

  !> Goodman's condition by z = artanh(c/a), which resolves c/a close to 1.
  type, extends(scalar_function_t) :: goodman_error_t
    !> mu/|beta|
    real(wp) :: ratio = 0.0_wp
  contains
    procedure :: at => goodman_error
  end type goodman_error_t

  !> Its plane form by z, k^2 = 1/(1 + exp(-z)), which resolves both ends.
  type, extends(scalar_function_t) :: plane_error_t
    !> mu/|beta|
    real(wp) :: ratio = 0.0_wp
  contains
    procedure :: at => plane_error
  end type plane_error_t

contains

  !> Compute the constants of indentation without slip (Mossakovskii, Spence).
  !>
  !> kappa = artanh(beta)/beta and chi = 1/2 / integral_0^1 t cos[(artanh(beta)/pi) ln((1-t)/(1+t))] dt.
  !> A flat punch has P = 2 kappa E* a delta; a sphere, pressed incrementally, delta = chi a^2/R and
  !> P = 4/3 kappa chi E* a^3/R.
  pure subroutine no_slip_constants(beta, kappa, chi)
    !> beta, at most 1/2 in magnitude
    real(wp), intent(in) :: beta
    !> Constants; both 1 for beta = 0
    real(wp), intent(out) :: kappa, chi

    kappa = 1.0_wp
    if (abs(beta) > 0.0_wp) kappa = atanh(beta)/beta
    ! t = tanh(s/2) turns the logarithm into -s: a decaying, smooth integrand
    chi = 0.5_wp/integral(no_slip_integrand_t(atanh(beta)/pi), 0.0_wp, 80.0_wp, 40)
  end subroutine no_slip_constants

  !> Evaluate the integrand of 1/(2 chi).
  pure real(wp) function no_slip_integrand(self, x) result(value)
    class(no_slip_integrand_t), intent(in) :: self
    !> s
    real(wp), intent(in) :: x

    value = tanh(0.5_wp*x)*cos(self%frequency*x)/(2.0_wp*cosh(0.5_wp*x)**2)
  end function no_slip_integrand

  !> Compute the stick ratio c/a of monotone indentation where shear does not move the pressure (Goodman, Spence).
  !>
  !> Solves (a/2c) ln[(a+c)/(a-c)] = (mu/|beta|) K'(c/a) with K'(k) = K(sqrt(1-k^2)); not a number where c/a is not
  !> distinct from 0 and 1.
  elemental real(wp) function goodman_stick_ratio(beta, friction_coefficient) result(stick_ratio)
    !> beta, not 0
    real(wp), intent(in) :: beta
    !> mu > 0
    real(wp), intent(in) :: friction_coefficient

    stick_ratio = tanh(zero_between(goodman_error_t(friction_coefficient/abs(beta)), 1.0e-150_wp, 40.0_wp, 0.0_wp))
  end function goodman_stick_ratio

  !> Compute the left side of Goodman's condition less the right one.
  pure real(wp) function goodman_error(self, x) result(value)
    class(goodman_error_t), intent(in) :: self
    !> artanh(c/a)
    real(wp), intent(in) :: x

    value = x/tanh(x) - self%ratio*complete_k(tanh(x)**2)
  end function goodman_error

  !> Compute the stick ratio c/b of cylinders pressed monotonically where shear does not move the pressure.
  !>
  !> Solves |beta| K(k) = mu K'(k), k = c/b (Spence). It follows from a flat punch, p = P'/(pi sqrt(b^2-x^2)), of which
  !> all self-similar contacts are made: a bounded traction in the stick strip needs
  !> integral_-c^c [|beta| p(x) - (mu/pi) integral_{c<|t|<b} sgn(t) p(t)/(t-x) dt]/sqrt(c^2-x^2) dx = 0.
  !> Not a number where c/b is not distinct from 0 and 1.
  elemental real(wp) function goodman_stick_ratio_plane(beta, friction_coefficient) result(stick_ratio)
    !> beta, not 0
    real(wp), intent(in) :: beta
    !> mu > 0
    real(wp), intent(in) :: friction_coefficient

    real(wp) :: z

    z = zero_between(plane_error_t(friction_coefficient/abs(beta)), -700.0_wp, 36.0_wp, 1.0e-15_wp)
    stick_ratio = sqrt(logistic(z))
  end function goodman_stick_ratio_plane

  !> Compute K(k) less mu/|beta| K'(k).
  pure real(wp) function plane_error(self, x) result(value)
    class(plane_error_t), intent(in) :: self
    !> z
    real(wp), intent(in) :: x

    value = complete_k(logistic(-x)) - self%ratio*complete_k(logistic(x))
  end function plane_error

  !> Compute 1/(1 + exp(-z)).
  elemental real(wp) function logistic(z)
    !> Where
    real(wp), intent(in) :: z

    logistic = 1.0_wp/(1.0_wp + exp(-z))
  end function logistic

end module hc_self_similar
