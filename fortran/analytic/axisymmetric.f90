!> Frictionless axisymmetric contacts with a closed solution.
!>
!> They come from one theorem (L. A. Galin; I. N. Sneddon, Int. J. Eng. Sci. 3 (1965) 47-57): with the separation h(r)
!> of the undeformed bodies, and delta(t) = t integral_0^t h'(r)/sqrt(t^2-r^2) dr the approach that makes the contact
!> radius t,
!>
!>     P = 2 E* integral_0^a (delta(a) - delta(t)) dt,     p(r) = E*/pi integral_r^a delta'(t)/sqrt(t^2-r^2) dt.
!>
!> Equations: docs/theory/closed_solutions.md.
module hc_axisymmetric
  use, intrinsic :: ieee_arithmetic, only: ieee_positive_inf, ieee_value
  use hc_precision, only: wp, pi
  use hc_scalar_function, only: scalar_function_t, zero_between, integral
  implicit none
  private

  public :: axisymmetric_t, power_law_t, rounded_punch_t, flat_punch_t

  !> A body pressed into a half-space, with the contact circle r <= a.
  type, abstract :: axisymmetric_t
    !> E* [Pa]
    real(wp) :: effective_modulus = 1.0_wp
  contains
    !> Approach that makes a contact radius [m]
    procedure(quantity_interface), deferred :: approach
    !> Load that makes a contact radius [N]
    procedure(quantity_interface), deferred :: load
    !> Pressure at a distance from the axis, for a contact radius [Pa]
    procedure(pressure_interface), deferred :: pressure
    !> Contact radius under a load or an approach [m]
    procedure(radius_interface), deferred :: contact_radius
    procedure :: max_pressure
  end type axisymmetric_t

  abstract interface
    !> Compute a quantity by the contact radius.
    elemental function quantity_interface(self, radius) result(value)
      import :: axisymmetric_t, wp
      implicit none
      class(axisymmetric_t), intent(in) :: self
      !> Contact radius a [m]
      real(wp), intent(in) :: radius
      real(wp) :: value
    end function quantity_interface

    !> Compute the pressure by the contact radius; 0 outside the contact.
    elemental function pressure_interface(self, radius, r) result(value)
      import :: axisymmetric_t, wp
      implicit none
      class(axisymmetric_t), intent(in) :: self
      !> Contact radius a, distance from the axis [m]
      real(wp), intent(in) :: radius, r
      real(wp) :: value
    end function pressure_interface

    !> Find the contact radius under a load or an approach.
    pure function radius_interface(self, normal_load, approach) result(radius)
      import :: axisymmetric_t, wp
      implicit none
      class(axisymmetric_t), intent(in) :: self
      !> Load [N] or approach [m]: one of them, above 0
      real(wp), intent(in), optional :: normal_load, approach
      real(wp) :: radius
    end function radius_interface
  end interface

  !> h = C r^n.
  type, extends(axisymmetric_t) :: power_law_t
    !> C > 0 [m^(1-n)]
    real(wp) :: coefficient = 1.0_wp
    !> n >= 1
    real(wp) :: exponent = 2.0_wp
  contains
    procedure :: approach => power_law_approach
    procedure :: load => power_law_load
    procedure :: pressure => power_law_pressure
    procedure :: max_pressure => power_law_max_pressure
    procedure :: contact_radius => power_law_contact_radius
  end type power_law_t

  !> A flat punch with a parabolic edge: h = (r-b)^2/(2R) outside r = b, 0 inside.
  type, extends(axisymmetric_t) :: rounded_punch_t
    !> b [m]
    real(wp) :: flat_radius = 1.0_wp
    !> R [m]
    real(wp) :: edge_radius = 1.0_wp
  contains
    procedure :: approach => rounded_approach
    procedure :: load => rounded_load
    procedure :: pressure => rounded_pressure
    procedure :: contact_radius => rounded_contact_radius
  end type rounded_punch_t

  !> A flat punch, whose radius is that of the contact.
  type :: flat_punch_t
    !> E* [Pa]
    real(wp) :: effective_modulus = 1.0_wp
    !> a [m]
    real(wp) :: radius = 1.0_wp
  contains
    procedure :: stiffness => flat_stiffness
    procedure :: pressure => flat_pressure
  end type flat_punch_t

  !> (r cosh u)^(n-1).
  type, extends(scalar_function_t) :: cosh_power_t
    real(wp) :: scale = 1.0_wp, power = 0.0_wp
  contains
    procedure :: at => cosh_power
  end type cosh_power_t

  !> Integrand of the load on a rounded punch by v, sqrt(t^2-b^2) = b sinh v.
  type, extends(scalar_function_t) :: rounded_load_t
  contains
    procedure :: at => rounded_load_integrand
  end type rounded_load_t

  !> Integrand of the pressure of a rounded punch by v: sqrt(t^2-r^2) = g cosh v for r < b, g sinh v for r > b.
  type, extends(scalar_function_t) :: rounded_pressure_t
    !> g = sqrt|b^2-r^2|, as a share of b
    real(wp) :: gap = 0.0_wp
    !> r < b
    logical :: below_flat = .true.
  contains
    procedure :: at => rounded_pressure_integrand
  end type rounded_pressure_t

  !> Approach or load by the contact radius less a given one.
  type, extends(scalar_function_t) :: radius_error_t
    type(rounded_punch_t) :: body
    logical :: by_load = .false.
    real(wp) :: target = 0.0_wp
  contains
    procedure :: at => radius_error
  end type radius_error_t

contains

  !> Compute the largest pressure by the contact radius [Pa]; there is one maximum between the axis and the edge.
  pure real(wp) function max_pressure(self, radius) result(peak)
    class(axisymmetric_t), intent(in) :: self
    !> Contact radius [m]
    real(wp), intent(in) :: radius

    integer, parameter :: n_sample = 400
    real(wp), parameter :: golden = 0.5_wp*(sqrt(5.0_wp) - 1.0_wp)
    real(wp) :: sample(0:n_sample), first, last, low, high, at_low, at_high
    integer :: i

    sample = self%pressure(radius, [(radius*i/n_sample, i=0, n_sample)])
    i = maxloc(sample, 1) - 1
    peak = sample(i)
    if (i == 0) return
    first = radius*(i - 1)/n_sample
    last = radius*min(i + 1, n_sample)/n_sample
    low = last - golden*(last - first)
    high = first + golden*(last - first)
    at_low = self%pressure(radius, low)
    at_high = self%pressure(radius, high)
    ! flat at the maximum: a place within the root of the rounding gives all digits of the value
    do while (last - first > 0.5_wp*sqrt(epsilon(1.0_wp))*last)
      if (at_low > at_high) then
        last = high
        high = low
        at_high = at_low
        low = last - golden*(last - first)
        at_low = self%pressure(radius, low)
      else
        first = low
        low = high
        at_low = at_high
        high = first + golden*(last - first)
        at_high = self%pressure(radius, high)
      end if
    end do
    peak = max(peak, at_low, at_high)
  end function max_pressure

  ! ------------------------------------------------------------------------------- power laws

  !> Compute delta = c C a^n, c = sqrt(pi) Gamma(n/2+1)/Gamma(n/2+1/2) [m].
  elemental real(wp) function power_law_approach(self, radius) result(value)
    class(power_law_t), intent(in) :: self
    !> Contact radius a [m]
    real(wp), intent(in) :: radius

    value = power_law_factor(self)*radius**self%exponent
  end function power_law_approach

  !> Compute c C of the approach [m^(1-n)].
  elemental real(wp) function power_law_factor(self) result(factor)
    class(power_law_t), intent(in) :: self

    associate (n => self%exponent)
      factor = sqrt(pi)*exp(log_gamma(0.5_wp*n + 1.0_wp) - log_gamma(0.5_wp*n + 0.5_wp))*self%coefficient
    end associate
  end function power_law_factor

  !> Compute P = 2 E* n/(n+1) delta a [N].
  elemental real(wp) function power_law_load(self, radius) result(value)
    class(power_law_t), intent(in) :: self
    !> Contact radius a [m]
    real(wp), intent(in) :: radius

    value = 2.0_wp*self%effective_modulus*self%exponent/(self%exponent + 1.0_wp)*self%approach(radius)*radius
  end function power_law_load

  !> Find the contact radius under a load or an approach [m].
  pure real(wp) function power_law_contact_radius(self, normal_load, approach) result(radius)
    class(power_law_t), intent(in) :: self
    !> Load [N] or approach [m]: one of them, above 0
    real(wp), intent(in), optional :: normal_load, approach

    radius = 0.0_wp
    if (present(approach)) radius = (approach/power_law_factor(self))**(1.0_wp/self%exponent)
    if (present(normal_load)) radius = (normal_load/self%load(1.0_wp))**(1.0_wp/(self%exponent + 1.0_wp))
  end function power_law_contact_radius

  !> Compute p(r) = (E*/pi) n c C a^(n-1) I_n, I_n = integral_0^s (r^2+x^2)^(n/2-1) dx, s^2 = a^2-r^2, lengths as shares of a.
  !>
  !> Integration by parts leads from I_(n-2) to I_n = (s + (n-2) r^2 I_(n-2))/(n-1), and x = r sinh u to a smooth
  !> integrand, I_n = integral_0^(arsinh s/r) (r cosh u)^(n-1) du.
  elemental real(wp) function power_law_pressure(self, radius, r) result(value)
    class(power_law_t), intent(in) :: self
    !> Contact radius a, distance from the axis [m]
    real(wp), intent(in) :: radius, r

    real(wp) :: n, x, s, angle
    integer :: n_step, k

    value = 0.0_wp
    x = abs(r)/radius
    if (x > 1.0_wp) return
    s = sqrt((1.0_wp - x)*(1.0_wp + x))
    ! n = 1 or n in (1, 3]
    n_step = max(ceiling(0.5_wp*(self%exponent - 3.0_wp)), 0)
    n = self%exponent - 2*n_step
    if (x < tiny(x)) then
      value = s/max(self%exponent - 1.0_wp, tiny(x))
      if (self%exponent <= 1.0_wp) value = ieee_value(value, ieee_positive_inf)
    else
      if (abs(n - 2.0_wp) <= 0.0_wp) then
        value = s
      else
        angle = asinh(s/x)
        value = integral(cosh_power_t(x, n - 1.0_wp), 0.0_wp, angle, max(ceiling(0.5_wp*angle), 1))
      end if
      do k = 1, n_step
        n = n + 2.0_wp
        value = (s + (n - 2.0_wp)*x**2*value)/(n - 1.0_wp)
      end do
    end if
    value = self%effective_modulus/pi*self%exponent*self%approach(radius)/radius*value
  end function power_law_pressure

  !> Compute the largest pressure [Pa]: infinite for a cone, in the middle for n <= 2, where the pressure falls outwards.
  pure real(wp) function power_law_max_pressure(self, radius) result(peak)
    class(power_law_t), intent(in) :: self
    !> Contact radius [m]
    real(wp), intent(in) :: radius

    if (self%exponent <= 2.0_wp) then
      peak = self%pressure(radius, 0.0_wp)
    else
      peak = max_pressure(self, radius)
    end if
  end function power_law_max_pressure

  !> Compute (r cosh u)^(n-1).
  pure real(wp) function cosh_power(self, x) result(value)
    class(cosh_power_t), intent(in) :: self
    !> u
    real(wp), intent(in) :: x

    value = (self%scale*cosh(x))**self%power
  end function cosh_power

  ! ------------------------------------------------------------------------------- punches

  !> Compute delta = (a/R) [sqrt(a^2-b^2) - b arccos(b/a)] [m].
  elemental real(wp) function rounded_approach(self, radius) result(value)
    class(rounded_punch_t), intent(in) :: self
    !> Contact radius a >= b [m]
    real(wp), intent(in) :: radius

    real(wp) :: leg

    associate (b => self%flat_radius)
      leg = sqrt(max((radius - b)*(radius + b), 0.0_wp))
      value = radius/self%edge_radius*(leg - b*atan2(leg, b))
    end associate
  end function rounded_approach

  !> Compute P = 2 E* integral_b^a t delta'(t) dt, delta'(t) = [2 sqrt(t^2-b^2) - b arccos(b/t)]/R [N].
  elemental real(wp) function rounded_load(self, radius) result(value)
    class(rounded_punch_t), intent(in) :: self
    !> Contact radius a >= b [m]
    real(wp), intent(in) :: radius

    associate (b => self%flat_radius)
      value = asinh(sqrt(max((radius - b)*(radius + b), 0.0_wp))/b)
      value = 2.0_wp*self%effective_modulus*b**3/self%edge_radius &
              *integral(rounded_load_t(), 0.0_wp, value, ceiling(value) + 1)
    end associate
  end function rounded_load

  !> Evaluate the integrand of the load, lengths as shares of b.
  pure real(wp) function rounded_load_integrand(self, x) result(value)
    class(rounded_load_t), intent(in) :: self
    !> v
    real(wp), intent(in) :: x

    value = (2.0_wp*sinh(x) - atan(sinh(x)))*sinh(x)*cosh(x)
  end function rounded_load_integrand

  !> Find the contact radius under a load or an approach [m].
  pure real(wp) function rounded_contact_radius(self, normal_load, approach) result(radius)
    class(rounded_punch_t), intent(in) :: self
    !> Load [N] or approach [m]: one of them, above 0
    real(wp), intent(in), optional :: normal_load, approach

    type(radius_error_t) :: error

    error%body = rounded_punch_t(self%effective_modulus, self%flat_radius, self%edge_radius)
    error%by_load = present(normal_load)
    if (present(normal_load)) error%target = normal_load
    if (present(approach)) error%target = approach
    radius = 2.0_wp*self%flat_radius
    do while (error%at(radius) < 0.0_wp)
      radius = 2.0_wp*radius
    end do
    radius = zero_between(error, self%flat_radius, radius, 0.0_wp)
  end function rounded_contact_radius

  !> Compute the approach or load less the given one.
  pure real(wp) function radius_error(self, x) result(value)
    class(radius_error_t), intent(in) :: self
    !> Contact radius [m]
    real(wp), intent(in) :: x

    if (self%by_load) then
      value = self%body%load(x) - self%target
    else
      value = self%body%approach(x) - self%target
    end if
  end function radius_error

  !> Compute p(r) = E*/pi integral delta'(t)/t ds, s = sqrt(t^2-r^2), from t = max(r, b) to a [Pa].
  elemental real(wp) function rounded_pressure(self, radius, r) result(value)
    class(rounded_punch_t), intent(in) :: self
    !> Contact radius a, distance from the axis [m]
    real(wp), intent(in) :: radius, r

    type(rounded_pressure_t) :: integrand
    real(wp) :: last

    value = 0.0_wp
    if (abs(r) >= radius) return
    associate (b => self%flat_radius)
      last = sqrt((radius - abs(r))*(radius + abs(r)))/b
      integrand%below_flat = abs(r) < b
      ! at r = b itself the integrand of the one is the limit of that of the other
      integrand%gap = max(sqrt(abs((b - r)*(b + r)))/b, 1.0e-9_wp*last)
      if (integrand%below_flat) then
        last = acosh(max(last/integrand%gap, 1.0_wp))
      else
        last = asinh(last/integrand%gap)
      end if
      value = self%effective_modulus/pi*b/self%edge_radius*integral(integrand, 0.0_wp, last, ceiling(last) + 1)
    end associate
  end function rounded_pressure

  !> Evaluate the integrand of the pressure, lengths as shares of b.
  pure real(wp) function rounded_pressure_integrand(self, x) result(value)
    class(rounded_pressure_t), intent(in) :: self
    !> v
    real(wp), intent(in) :: x

    real(wp) :: leg

    leg = self%gap*merge(sinh(x), cosh(x), self%below_flat)
    value = self%gap*merge(sinh(x), cosh(x), self%below_flat)
    value = value*(2.0_wp*leg - atan(leg))/sqrt(1.0_wp + leg**2)
  end function rounded_pressure_integrand

  !> Compute P/delta = 2 E* a of a flat punch [N/m].
  elemental real(wp) function flat_stiffness(self) result(stiffness)
    class(flat_punch_t), intent(in) :: self

    stiffness = 2.0_wp*self%effective_modulus*self%radius
  end function flat_stiffness

  !> Compute p = P/(2 pi a sqrt(a^2-r^2)) of a flat punch; infinite at its edge, 0 outside [Pa].
  elemental real(wp) function flat_pressure(self, load, r) result(value)
    class(flat_punch_t), intent(in) :: self
    !> Load [N], distance from the axis [m]
    real(wp), intent(in) :: load, r

    if (abs(r) < self%radius) then
      value = load/(2.0_wp*pi*self%radius*sqrt((self%radius - r)*(self%radius + r)))
    else if (abs(r) <= self%radius) then
      value = ieee_value(value, ieee_positive_inf)
    else
      value = 0.0_wp
    end if
  end function flat_pressure

end module hc_axisymmetric
