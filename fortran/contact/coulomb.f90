!> Coulomb friction at a node, and its linearisation.
!>
!> Over a load step a node in contact either sticks, ds = 0 and |q| < mu p, or
!> slips, |q| = mu p and ds = -kappa q with kappa >= 0. Both are one equation,
!>
!>     q = P(q - r ds),
!>
!> with P the projection on the disc of radius mu p, for any r > 0. With
!> d = q - r ds a node with |d| > mu p slips along e = d/|d|; a step of Newton's
!> method for it leaves one unknown, tau in q = mu p e + tau t with t normal to e, and
!>
!>     t.ds + D tau = 0,     D = (|d| - mu p)/(r mu p),
!>
!> where D tends to |ds|/(mu p). The direction of slip is thus that of -ds, and
!> it converges quadratically.
!>
!> Equations: docs/theory/friction.md, (F3), (F6).
module hc_coulomb
  use hc_precision, only: wp
  use hc_contact_state, only: stick, slip
  implicit none
  private

  public :: coulomb_t, linearize, on_cone, normal_to, magnitude

  !> Slope of the bound without slip, where pressures are in units of the largest
  real(wp), parameter :: unbounded = 1.0e100_wp
  !> Smallest bound of the traction that counts in D, relative to the largest
  real(wp), parameter :: smallest_bound = 1.0e-12_wp

  !> Coulomb's law.
  type :: coulomb_t
    !> Coefficient of friction mu; not used without slip
    real(wp) :: coefficient = 0.0_wp
    !> An infinite coefficient: no node in contact slips
    logical :: no_slip = .false.
  contains
    !> Largest traction under a pressure
    procedure :: bound
    !> The same over the pressure
    procedure :: slope
    !> Is there any friction?
    procedure :: resists
  end type coulomb_t

contains

  !> mu p [Pa]; without slip there is no bound.
  elemental real(wp) function bound(self, pressure)
    class(coulomb_t), intent(in) :: self
    !> Pressure [Pa]
    real(wp), intent(in) :: pressure

    bound = huge(1.0_wp)
    if (.not. self%no_slip) bound = self%coefficient*max(pressure, 0.0_wp)
  end function bound

  !> mu; without slip a number so large that nothing is cut off, for pressures in units of the largest.
  elemental real(wp) function slope(self)
    class(coulomb_t), intent(in) :: self

    slope = unbounded
    if (.not. self%no_slip) slope = self%coefficient
  end function slope

  !> Is there any friction?
  elemental logical function resists(self)
    class(coulomb_t), intent(in) :: self
    resists = self%no_slip .or. self%coefficient > 0.0_wp
  end function resists

  !> Zone of a node in contact, and the linearised law if it slips.
  pure subroutine linearize(traction, slip_increment, bound, largest_bound, r, zone, direction, compliance)
    !> Traction q [Pa] and change of the relative displacement ds [m] of the last iterate
    real(wp), intent(in) :: traction(2), slip_increment(2)
    !> mu p at the node and its largest value anywhere [Pa]
    real(wp), intent(in) :: bound, largest_bound
    !> Parameter r [Pa/m]
    real(wp), intent(in) :: r
    !> stick or slip
    integer, intent(out) :: zone
    !> Direction e of the traction in slip; (1, 0) in stick
    real(wp), intent(out) :: direction(2)
    !> Compliance D across that direction [m/Pa]; 0 in stick
    real(wp), intent(out) :: compliance
    real(wp) :: d(2), length, least

    d = traction - r*slip_increment
    length = magnitude(d)
    least = smallest_bound*largest_bound
    if (least <= 0.0_wp) least = smallest_bound*length  ! no pressure at all
    if (length <= bound) then
      zone = stick
      direction = [1.0_wp, 0.0_wp]
      compliance = 0.0_wp
    else
      zone = slip
      direction = d/length
      compliance = (length - bound)/(r*max(bound, least))
    end if
  end subroutine linearize

  !> Projection P of a traction on the disc of radius mu p.
  pure function on_cone(traction, bound) result(projected)
    !> Traction [Pa]
    real(wp), intent(in) :: traction(2)
    !> Radius mu p [Pa]
    real(wp), intent(in) :: bound
    real(wp) :: projected(2), length

    projected = traction
    length = magnitude(traction)
    if (length > bound) projected = traction*(bound/length)
  end function on_cone

  !> Length of a vector: squares where they neither overflow nor vanish, which is much faster than `hypot`.
  pure real(wp) function magnitude(vector)
    !> The vector
    real(wp), intent(in) :: vector(2)
    real(wp), parameter :: least = 1.0e-140_wp, largest = 1.0e140_wp
    real(wp) :: longer

    longer = max(abs(vector(1)), abs(vector(2)))
    if (longer > least .and. longer < largest) then
      magnitude = sqrt(vector(1)**2 + vector(2)**2)
    else
      magnitude = hypot(vector(1), vector(2))
    end if
  end function magnitude

  !> The unit vector t, a quarter turn ahead of e.
  pure function normal_to(direction) result(t)
    !> Unit vector e
    real(wp), intent(in) :: direction(2)
    real(wp) :: t(2)
    t = [-direction(2), direction(1)]
  end function normal_to

end module hc_coulomb
