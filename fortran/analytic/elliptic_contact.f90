!> Frictionless contacts over an ellipse: Hertz's solution for surfaces that are quadratic forms.
!>
!> H. Hertz, J. reine angew. Math. 92 (1882) 156-171; docs/theory/closed_solutions.md.
module hc_elliptic_contact
  use hc_precision, only: wp, pi
  use hc_error, only: error_t, status, raise
  use hc_carlson, only: carlson_rf, carlson_rd
  use hc_scalar_function, only: scalar_function_t, zero_between
  implicit none
  private

  public :: elliptic_contact_t, hertz_ellipse, crossed_cylinders_hessian

  !> Hertz contact over an ellipse with its center at the origin.
  type :: elliptic_contact_t
    !> E* [Pa]
    real(wp) :: effective_modulus = 0.0_wp
    !> Semi-axes a >= b [m]
    real(wp) :: semi_major = 0.0_wp, semi_minor = 0.0_wp
    !> Direction of the major axis from x [rad], in (-pi/2, pi/2]
    real(wp) :: angle = 0.0_wp
    !> Approach [m], load [N], largest pressure [Pa]
    real(wp) :: approach = 0.0_wp, normal_load = 0.0_wp, max_pressure = 0.0_wp
  contains
    procedure :: local, pressure
  end type elliptic_contact_t

  !> How far the ratio of the curvatures of an ellipse is from a given one, by log(b/a).
  type, extends(scalar_function_t) :: curvature_error_t
    real(wp) :: log_ratio = 0.0_wp
  contains
    procedure :: at => curvature_error
  end type curvature_error_t

contains

  !> Solve Hertz's contact with the separation h = (x, y) H (x, y)^T / 2 under a load or an approach.
  !>
  !> The complete elliptic integrals (parameter m = e^2 = 1 - b^2/a^2) enter in Carlson's symmetric form,
  !> K = R_F(0, 1-m, 1), (K-E)/m = R_D(0, 1-m, 1)/3, (E-(1-m)K)/m = (1-m) R_D(0, 1, 1-m)/3, which loses no
  !> digits for nearly circular and for very slender ellipses. K. L. Johnson, Contact Mechanics (1985), section 4.2.
  pure subroutine hertz_ellipse(contact, effective_modulus, hessian, error, normal_load, approach)
    !> Contact
    type(elliptic_contact_t), intent(out) :: contact
    !> E* [Pa], above 0
    real(wp), intent(in) :: effective_modulus
    !> H, the symmetric tensor of second derivatives of h [1/m], positive definite
    real(wp), intent(in) :: hessian(2, 2)
    !> Set if H is not positive definite
    type(error_t), allocatable, intent(out) :: error
    !> Load [N] or approach [m]: one of them, above 0
    real(wp), intent(in), optional :: normal_load, approach

    real(wp) :: mean, half, shear, small, large, complement, k, d, log_ratio

    mean = 0.5_wp*(hessian(1, 1) + hessian(2, 2))
    half = 0.5_wp*(hessian(1, 1) - hessian(2, 2))
    shear = 0.5_wp*(hessian(1, 2) + hessian(2, 1))
    large = mean + hypot(half, shear)
    small = 0.0_wp
    ! free of cancellation where the axes are those of the coordinates
    if (large > 0.0_wp) small = (hessian(1, 1)*(hessian(2, 2)/large) - shear*(shear/large))
    if (.not. small > 1.0e-12_wp*large) then
      call raise(error, status%invalid_input, &
                 'the gap does not close into an ellipse: hessian is not positive definite (line contact)')
      return
    end if
    complement = 1.0_wp
    if (small < large*(1.0_wp - 1.0e-15_wp)) then
      ! the ratio of the curvatures lies between (b/a)^2 and b/a
      log_ratio = log(small/large)
      complement = min(exp(zero_between(curvature_error_t(log_ratio), log_ratio - 1.0e-9_wp, 1.0e-9_wp, 0.0_wp)), 1.0_wp)**2
    end if
    k = carlson_rf(0.0_wp, complement, 1.0_wp)
    d = carlson_rd(0.0_wp, complement, 1.0_wp)
    contact%effective_modulus = effective_modulus
    associate (a => contact%semi_major, b => contact%semi_minor, load => contact%normal_load)
      if (present(normal_load)) a = (normal_load*d/(pi*effective_modulus*small))**(1.0_wp/3.0_wp)
      if (present(approach)) a = sqrt(2.0_wp*approach*d/(3.0_wp*k*small))
      b = a*sqrt(complement)
      load = pi*effective_modulus*small*a**3/d
      contact%approach = 1.5_wp*load*k/(pi*effective_modulus*a)
      contact%max_pressure = 1.5_wp*load/(pi*a*b)
    end associate
    ! axes that differ by rounding alone have no direction
    if (complement < 1.0_wp - 1.0e-9_wp) contact%angle = 0.5_wp*atan2(-shear, -half)
    ! an axis has no sense
    contact%angle = 0.5_wp*pi - modulo(0.5_wp*pi - contact%angle, pi)
  end subroutine hertz_ellipse

  !> Compute log(A/B) of an ellipse less that of the gap, A = (1-m) R_D(0, 1, 1-m) and B = R_D(0, 1-m, 1) but for a factor.
  pure real(wp) function curvature_error(self, x) result(value)
    class(curvature_error_t), intent(in) :: self
    !> log(b/a)
    real(wp), intent(in) :: x

    value = exp(2.0_wp*x)
    value = log(carlson_rd(0.0_wp, value, 1.0_wp)/carlson_rd(0.0_wp, 1.0_wp, value)) - self%log_ratio
  end function curvature_error

  !> Compute the tensor H of two cylinders, the first with its axis along x.
  pure function crossed_cylinders_hessian(radius_1, radius_2, angle) result(hessian)
    !> Radii [m]
    real(wp), intent(in) :: radius_1, radius_2
    !> From the axis of cylinder 1 to that of cylinder 2 [rad]
    real(wp), intent(in) :: angle
    real(wp) :: hessian(2, 2)

    hessian(:, 1) = -sin(angle)*[-sin(angle), cos(angle)]/radius_2
    hessian(:, 2) = cos(angle)*[-sin(angle), cos(angle)]/radius_2 + [0.0_wp, 1.0_wp/radius_1]
  end function crossed_cylinders_hessian

  !> Return a point relative to the ellipse: coordinates along its axes, as shares of them.
  elemental subroutine local(self, x, y, along, across)
    class(elliptic_contact_t), intent(in) :: self
    !> Point [m]
    real(wp), intent(in) :: x, y
    !> Its shares
    real(wp), intent(out) :: along, across

    along = (x*cos(self%angle) + y*sin(self%angle))/self%semi_major
    across = (y*cos(self%angle) - x*sin(self%angle))/self%semi_minor
  end subroutine local

  !> Compute the contact pressure [Pa] at a point; 0 outside the contact.
  elemental real(wp) function pressure(self, x, y)
    class(elliptic_contact_t), intent(in) :: self
    !> Point [m]
    real(wp), intent(in) :: x, y

    real(wp) :: along, across

    call self%local(x, y, along, across)
    pressure = self%max_pressure*sqrt(max(1.0_wp - along**2 - across**2, 0.0_wp))
  end function pressure

end module hc_elliptic_contact
