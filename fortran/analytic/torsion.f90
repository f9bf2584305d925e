!> Spheres pressed by a constant load and twisted about their common normal.
!>
!> J. L. Lubkin, The torsion of elastic spheres in contact, J. Appl. Mech. 18 (1951) 183-187; docs/theory/closed_solutions.md.
module hc_torsion
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use hc_precision, only: wp, pi
  use hc_carlson, only: carlson_rd
  use hc_scalar_function, only: scalar_function_t, zero_between, integral
  implicit none
  private

  public :: lubkin_t

  !> Spheres under a first torque.
  type :: lubkin_t
    !> Coefficient of friction mu, above 0
    real(wp) :: friction_coefficient = 0.0_wp
    !> Normal load P [N]
    real(wp) :: normal_load = 0.0_wp
    !> Contact radius a [m]
    real(wp) :: contact_radius = 0.0_wp
    !> S_t = sum 1/G_i [1/Pa]
    real(wp) :: compliance = 0.0_wp
  contains
    procedure :: sliding_torque, twist, torque, stick_radius
  end type lubkin_t

  !> Slip's share of the torque: 2 u^5 (K(k) - E(k)), k^2 = 1 - u^4, by u^2 = r/a, which takes the logarithm at r = 0 out.
  type, extends(scalar_function_t) :: slip_torque_t
  contains
    procedure :: at => slip_torque
  end type slip_torque_t

  !> Torque at a stick radius less a given torque.
  type, extends(scalar_function_t) :: torque_error_t
    type(lubkin_t) :: contact
    real(wp) :: torque = 0.0_wp
  contains
    procedure :: at => torque_error
  end type torque_error_t

contains

  !> Compute the largest shear traction mu p0 [Pa].
  elemental real(wp) function peak(self)
    class(lubkin_t), intent(in) :: self

    peak = 1.5_wp*self%friction_coefficient*self%normal_load/(pi*self%contact_radius**2)
  end function peak

  !> Compute the torque of full slip, 3 pi mu P a/16 [N m].
  elemental real(wp) function sliding_torque(self)
    class(lubkin_t), intent(in) :: self

    sliding_torque = 3.0_wp*pi/16.0_wp*self%friction_coefficient*self%normal_load*self%contact_radius
  end function sliding_torque

  !> Compute K(k) - E(k), k^2 = 1 - r^2/a^2, in Carlson's form (no cancellation, no overflow).
  elemental real(wp) function twist_factor(ratio)
    !> r/a
    real(wp), intent(in) :: ratio

    twist_factor = (1.0_wp - ratio**2)*carlson_rd(0.0_wp, ratio**2, 1.0_wp)/3.0_wp
  end function twist_factor

  !> Compute the twist at which the stick radius is c: (S_t mu p0/2) (K(k) - E(k)), k^2 = 1 - c^2/a^2 [rad].
  elemental real(wp) function twist(self, stick_radius)
    class(lubkin_t), intent(in) :: self
    !> c [m]
    real(wp), intent(in) :: stick_radius

    twist = 0.5_wp*self%compliance*peak(self)*twist_factor(stick_radius/self%contact_radius)
  end function twist

  !> Compute the torque at which the stick radius is c [N m].
  elemental real(wp) function torque(self, stick_radius)
    class(lubkin_t), intent(in) :: self
    !> c [m]
    real(wp), intent(in) :: stick_radius

    real(wp) :: c, slip

    c = stick_radius/self%contact_radius
    slip = integral(slip_torque_t(), sqrt(c), 1.0_wp, 4)
    torque = 8.0_wp*peak(self)*self%contact_radius**3*(c**3*twist_factor(c)/3.0_wp + slip)
  end function torque

  !> Compute the stick radius under a first torque below the sliding torque, to 1e-14 a; else not a number [m].
  elemental real(wp) function stick_radius(self, torque)
    class(lubkin_t), intent(in) :: self
    !> Torque [N m]
    real(wp), intent(in) :: torque

    if (torque >= 0.0_wp .and. torque < self%sliding_torque()) then
      stick_radius = zero_between(torque_error_t(lubkin_t(self%friction_coefficient, self%normal_load, self%contact_radius, &
                                                          self%compliance), torque), &
                                  1.0e-12_wp*self%contact_radius, self%contact_radius, 1.0e-14_wp*self%contact_radius)
    else
      stick_radius = ieee_value(stick_radius, ieee_quiet_nan)
    end if
  end function stick_radius

  !> Evaluate the integrand of slip's share of the torque.
  pure real(wp) function slip_torque(self, x) result(value)
    class(slip_torque_t), intent(in) :: self
    !> sqrt(r/a)
    real(wp), intent(in) :: x

    value = 2.0_wp*x**5*twist_factor(x**2)
  end function slip_torque

  !> Compute the torque less the given one.
  pure real(wp) function torque_error(self, x) result(value)
    class(torque_error_t), intent(in) :: self
    !> Stick radius [m]
    real(wp), intent(in) :: x

    value = self%contact%torque(x) - self%torque
  end function torque_error

end module hc_torsion
