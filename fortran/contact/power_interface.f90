!> An interface with a normal compliance: the pressure is a power of the penetration.
!>
!>     p = c psi_+^m,     psi = -g,     c > 0,     m >= 1
!>
!> (J. T. Oden and J. A. C. Martins, Comput. Methods Appl. Mech. Eng. 52, 1985, 527-634; (11.19) of the dissertation), so that the
!> layer is compressed by sigma(p) = (p/c)^(1/m). Contact is where bodies penetrate. Towards the edge of the contact the layer
!> becomes infinitely soft if m > 1; Newton's method finds the penetration there and the pressure where the layer is stiff,
!> because it linearises about the solution P of P + r sigma(P) = p - r g, whichever of the two terms is the larger one.
!>
!> Equations: docs/theory/conditions.md, (C5), (C6); docs/theory/normal_contact.md, (N6).
module hc_power_interface
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_normal_law, only: normal_law_t, tangent_t
  implicit none
  private

  public :: power_interface_t

  !> Steps of Newton's method for one node: it starts within a factor of two of the larger term.
  integer, parameter :: max_steps = 50
  !> Least pressure to linearise about, relative to the present one: from a smaller one the tangent would lead too far away.
  real(wp), parameter :: least_share = 0.05_wp

  !> Normal compliance by a power law.
  type, extends(normal_law_t) :: power_interface_t
    !> Pressure under the unit of penetration, c [Pa/m^m]
    real(wp) :: coefficient = 0.0_wp
    !> Exponent m
    real(wp) :: exponent = 1.0_wp
  contains
    !> Pressure under a penetration, and the penetration under a pressure
    procedure :: pressure_under, compression
    !> Penetration psi with c psi^m + r psi = t
    procedure, private :: shared_penetration
    procedure :: is_compliant, check, compliance_under, linearize, violation
  end type power_interface_t

contains

  !> Compute c psi_+^m [Pa].
  elemental real(wp) function pressure_under(self, penetration)
    class(power_interface_t), intent(in) :: self
    !> Penetration psi; nothing where it is negative [m]
    real(wp), intent(in) :: penetration

    pressure_under = self%coefficient*max(penetration, 0.0_wp)**self%exponent
  end function pressure_under

  !> Compute sigma(p) = (p/c)^(1/m) [m].
  elemental real(wp) function compression(self, pressure)
    class(power_interface_t), intent(in) :: self
    !> Pressure; nothing where it is negative [Pa]
    real(wp), intent(in) :: pressure

    compression = (max(pressure, 0.0_wp)/self%coefficient)**(1.0_wp/self%exponent)
  end function compression

  !> Solve c psi^m + r psi = t for the penetration psi, by Newton's method from above: the left side is convex.
  elemental real(wp) function shared_penetration(self, r, t) result(penetration)
    class(power_interface_t), intent(in) :: self
    !> Stiffness r, at least 0 [Pa/m], and t > 0 [Pa]
    real(wp), intent(in) :: r, t
    real(wp) :: carried, next
    integer :: step

    penetration = self%compression(t)
    if (r*penetration > t) penetration = t/r
    do step = 1, max_steps
      if (.not. penetration > 0.0_wp) return
      carried = self%coefficient*penetration**self%exponent
      next = penetration*(t + (self%exponent - 1.0_wp)*carried)/(self%exponent*carried + r*penetration)
      if (.not. next < penetration*(1.0_wp - 1.0e-9_wp)) return
      penetration = next
    end do
  end function shared_penetration

  !> Return true: there is a layer.
  pure logical function is_compliant(self)
    class(power_interface_t), intent(in) :: self

    is_compliant = .true.
  end function is_compliant

  !> Refuse a coefficient that is not positive and an exponent below 1.
  pure subroutine check(self, error)
    class(power_interface_t), intent(in) :: self
    type(error_t), allocatable, intent(out) :: error
    logical :: sound

    sound = ieee_is_finite(self%coefficient) .and. ieee_is_finite(self%exponent)
    if (sound) sound = self%coefficient > 0.0_wp .and. self%exponent >= 1.0_wp
    if (.not. sound) then
      call raise(error, status%invalid_input, &
                 'normal compliance of the interface: a finite coefficient above 0 and a finite exponent of at least 1 expected')
    end if
  end subroutine check

  !> Compute sigma'(p) = sigma(p)/(m p).
  pure real(wp) function compliance_under(self, pressure) result(compliance)
    class(power_interface_t), intent(in) :: self
    real(wp), intent(in) :: pressure

    compliance = 0.0_wp
    if (pressure > 0.0_wp) compliance = self%compression(pressure)/(self%exponent*pressure)
  end function compliance_under

  !> Linearise about the solution P of P + r sigma(P) = p - r g at each node.
  pure subroutine linearize(self, first, tangent, p, gap, contact, compliance, offset)
    class(power_interface_t), intent(in) :: self
    integer, intent(in) :: first
    type(tangent_t), intent(in) :: tangent
    real(wp), intent(in), contiguous :: p(:), gap(:)
    logical, intent(in), contiguous :: contact(:)
    real(wp), intent(out), contiguous :: compliance(:), offset(:)
    real(wp) :: penetration, pressure
    integer :: i

    associate (r => tangent%r, softest => tangent%softest)
      do i = 1, size(p)
        compliance(i) = 0.0_wp
        offset(i) = 0.0_wp
        if (.not. contact(i)) cycle
        compliance(i) = softest
        pressure = least_share*abs(p(i))
        if (p(i) - r*gap(i) > 0.0_wp) then
          pressure = max(pressure, self%pressure_under(self%shared_penetration(r, p(i) - r*gap(i))))
        end if
        if (.not. pressure > 0.0_wp) cycle
        penetration = self%compression(pressure)
        if (pressure*softest*self%exponent > penetration) compliance(i) = penetration/(self%exponent*pressure)
        offset(i) = penetration - compliance(i)*pressure
      end do
    end associate
  end subroutine linearize

  !> Measure |p - c psi_+^m|, or |g + sigma(p)|/d_n where the layer is stiffer than a node: for c -> infinity |min(p, g/d_n)|.
  pure subroutine violation(self, first, compliance, p, gap, candidate, worst)
    class(power_interface_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in) :: compliance
    real(wp), intent(in), contiguous :: p(:), gap(:)
    logical, intent(in), contiguous :: candidate(:)
    real(wp), intent(inout) :: worst
    real(wp) :: wrong
    integer :: i

    do i = 1, size(p)
      if (.not. candidate(i)) cycle
      wrong = abs(p(i) - self%pressure_under(-gap(i)))
      if (.not. wrong > worst) cycle
      if (p(i) >= 0.0_wp) then
        wrong = min(wrong, abs(gap(i) + self%compression(p(i)))/compliance)
      else
        wrong = min(wrong, max(-p(i), -gap(i)/compliance))
      end if
      worst = max(worst, wrong)
    end do
  end subroutine violation

end module hc_power_interface
