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
!> Passes over one row of nodes are written so that the compiler takes several nodes at a time: lengths of vectors are
!> roots of sums of squares there, and pressures have to come in a unit of their own size.
!>
!> Equations: docs/theory/friction.md, (F3), (F6).
module hc_coulomb
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_lattice, only: lattice_t
  use hc_friction_law, only: friction_law_t
  use hc_contact_state, only: separated, stick, slip
  implicit none
  private

  public :: coulomb_t, linearize, on_cone, normal_to, magnitude, residual_row, zone_row, cone_row

  !> Slope of the bound without slip, where pressures are in units of the largest
  real(wp), parameter :: unbounded = 1.0e100_wp
  !> Squares below this count as nothing
  real(wp), parameter :: nothing = 1.0e-200_wp
  !> Smallest bound of the traction that counts in D, relative to the largest
  real(wp), parameter :: smallest_bound = 1.0e-12_wp

  !> Coulomb's law.
  type, extends(friction_law_t) :: coulomb_t
    !> Coefficient of friction mu; not used without slip
    real(wp) :: coefficient = 0.0_wp
    !> An infinite coefficient: no node in contact slips
    logical :: no_slip = .false.
  contains
    !> Largest traction under a pressure
    procedure :: bound
    !> The same over the pressure
    procedure :: slope
    procedure :: resists, is_bounded, check, strength, find_bounds, find_slopes, find_zones, project, violation
    procedure :: linearize => linearize_row
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
  pure logical function resists(self)
    class(coulomb_t), intent(in) :: self
    resists = self%no_slip .or. self%coefficient > 0.0_wp
  end function resists

  !> Does any node slip?
  pure logical function is_bounded(self)
    class(coulomb_t), intent(in) :: self
    is_bounded = .not. self%no_slip
  end function is_bounded

  pure subroutine check(self, lattice, error)
    class(coulomb_t), intent(in) :: self
    type(lattice_t), intent(in) :: lattice
    type(error_t), allocatable, intent(out) :: error
    logical :: sound

    sound = self%no_slip .or. ieee_is_finite(self%coefficient)
    if (sound .and. .not. self%no_slip) sound = self%coefficient >= 0.0_wp
    associate (same_everywhere => lattice)
      if (sound) return
      call raise(error, status%invalid_input, 'coefficient of friction: a finite number of at least 0 expected, or no_slip')
    end associate
  end subroutine check

  pure real(wp) function strength(self)
    class(coulomb_t), intent(in) :: self

    strength = huge(1.0_wp)
    if (.not. self%no_slip) strength = self%coefficient
  end function strength

  pure subroutine find_bounds(self, first, p, bound)
    class(coulomb_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in), contiguous :: p(:)
    real(wp), intent(out), contiguous :: bound(:)

    associate (same_everywhere => first)
      bound = self%bound(p)
    end associate
  end subroutine find_bounds

  pure subroutine find_slopes(self, first, p, bound)
    class(coulomb_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in), contiguous :: p(:)
    real(wp), intent(out), contiguous :: bound(:)

    associate (same_everywhere => first, linear_in => p)
      bound = self%slope()
    end associate
  end subroutine find_slopes

  pure subroutine find_zones(self, first, unit, r, p, qx, qy, dsx, dsy, zone)
    class(coulomb_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in) :: unit, r
    real(wp), intent(in), contiguous :: p(:), qx(:), qy(:), dsx(:), dsy(:)
    integer, intent(out), contiguous :: zone(:)

    associate (same_everywhere => first)
      call zone_row(size(p), unit, self%slope(), r, p, qx, qy, dsx, dsy, zone)
    end associate
  end subroutine find_zones

  pure subroutine project(self, first, unit, p, qx, qy, cut_x, cut_y)
    class(coulomb_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in) :: unit
    real(wp), intent(in), contiguous :: p(:), qx(:), qy(:)
    real(wp), intent(out), contiguous :: cut_x(:), cut_y(:)

    associate (same_everywhere => first)
      call cone_row(size(p), unit, self%slope(), p, qx, qy, cut_x, cut_y)
    end associate
  end subroutine project

  pure subroutine violation(self, first, unit, stiffness, p, qx, qy, dsx, dsy, largest, worst)
    class(coulomb_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in) :: unit, stiffness
    real(wp), intent(in), contiguous :: p(:), qx(:), qy(:), dsx(:), dsy(:)
    real(wp), intent(inout) :: largest, worst

    associate (same_everywhere => first)
      call residual_row(size(p), unit, self%slope(), stiffness, p, qx, qy, dsx, dsy, largest, worst)
    end associate
  end subroutine violation

  pure subroutine linearize_row(self, first, p_max, r, in_contact, p, qx, qy, dsx, dsy, zone, direction, compliance)
    class(coulomb_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in) :: p_max, r
    logical, intent(in), contiguous :: in_contact(:)
    real(wp), intent(in), contiguous :: p(:), qx(:), qy(:), dsx(:), dsy(:)
    integer, intent(out), contiguous :: zone(:)
    real(wp), intent(out), contiguous :: direction(:, :), compliance(:)
    integer :: i

    associate (same_everywhere => first, largest => self%bound(p_max))
      do i = 1, size(p)
        if (in_contact(i)) then
          call linearize([qx(i), qy(i)], [dsx(i), dsy(i)], self%bound(p(i)), largest, r, zone(i), direction(:, i), compliance(i))
        else
          zone(i) = separated
          direction(:, i) = [1.0_wp, 0.0_wp]
          compliance(i) = 0.0_wp
        end if
      end do
    end associate
  end subroutine linearize_row

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

  !> What the tractions of a row lack of Coulomb's law, |q - P(q - ds/d_t)|, squared.
  pure subroutine residual_row(n, unit, slope, stiffness, p, qx, qy, dsx, dsy, largest, worst)
    !> Number of nodes
    integer, intent(in) :: n
    !> Inverse of the unit of pressure; slope of Coulomb's law; inverse of d_t [Pa/m]
    real(wp), intent(in) :: unit, slope, stiffness
    !> Pressure, traction and slip of the step
    real(wp), intent(in) :: p(n), qx(n), qy(n), dsx(n), dsy(n)
    !> Squares of the largest traction and of what is lacking most, in the unit of pressure: those of the rows before,
    !> and now of this one too
    real(wp), intent(inout) :: largest, worst
    real(wp) :: x, y, trial_x, trial_y, length, share
    integer :: i

    !$omp simd reduction(max: largest, worst) private(x, y, trial_x, trial_y, length, share)
    do i = 1, n
      x = unit*qx(i)
      y = unit*qy(i)
      trial_x = x - unit*stiffness*dsx(i)
      trial_y = y - unit*stiffness*dsy(i)
      length = sqrt(max(trial_x**2 + trial_y**2, nothing))
      share = min(slope*max(unit*p(i), 0.0_wp)/length, 1.0_wp)
      largest = max(largest, merge(x**2 + y**2, 0.0_wp, p(i) > 0.0_wp))
      worst = max(worst, merge((x - share*trial_x)**2 + (y - share*trial_y)**2, 0.0_wp, p(i) > 0.0_wp))
    end do
  end subroutine residual_row

  !> Zones of a row: |q - r ds| tells.
  pure subroutine zone_row(n, unit, slope, r, p, qx, qy, dsx, dsy, zone)
    !> Number of nodes
    integer, intent(in) :: n
    !> Inverse of the unit of pressure; slope of Coulomb's law; classification parameter [Pa/m]
    real(wp), intent(in) :: unit, slope, r
    !> Pressure, traction and slip of the step
    real(wp), intent(in) :: p(n), qx(n), qy(n), dsx(n), dsy(n)
    !> separated, stick or slip
    integer, intent(out) :: zone(n)
    real(wp) :: x, y
    integer :: i

    !$omp simd private(x, y)
    do i = 1, n
      x = unit*(qx(i) - r*dsx(i))
      y = unit*(qy(i) - r*dsy(i))
      zone(i) = merge(stick, slip, x**2 + y**2 <= (slope*unit*p(i))**2)
      zone(i) = merge(zone(i), separated, p(i) > 0.0_wp)
    end do
  end subroutine zone_row

  !> Tractions of a row cut to the cone; none where there is no pressure.
  pure subroutine cone_row(n, unit, slope, p, qx, qy, cut_x, cut_y)
    !> Number of nodes
    integer, intent(in) :: n
    !> Inverse of the unit of pressure; slope of Coulomb's law
    real(wp), intent(in) :: unit, slope
    !> Pressure and traction
    real(wp), intent(in) :: p(n), qx(n), qy(n)
    !> What is left of the traction
    real(wp), intent(out) :: cut_x(n), cut_y(n)
    real(wp) :: length, share
    integer :: i

    !$omp simd private(length, share)
    do i = 1, n
      length = sqrt(max((unit*qx(i))**2 + (unit*qy(i))**2, nothing))
      share = merge(min(slope*max(unit*p(i), 0.0_wp)/length, 1.0_wp), 0.0_wp, p(i) > 0.0_wp)
      cut_x(i) = share*qx(i)
      cut_y(i) = share*qy(i)
    end do
  end subroutine cone_row

end module hc_coulomb
