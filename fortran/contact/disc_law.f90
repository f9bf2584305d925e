!> Laws of Coulomb's type: the tractions that they allow are a disc, or the ellipse that a stretch of the plane makes of one.
!>
!> Over a load step a node in contact either sticks, ds = 0 and |q| < b(p), or
!> slips, |q| = b(p) and ds = -kappa q with kappa >= 0. Both are one equation,
!>
!>     q = P(q - r ds),
!>
!> with P the projection on the disc of radius b(p), for any r > 0. With
!> d = q - r ds a node with |d| > b(p) slips along e = d/|d|; a step of Newton's
!> method for it leaves one unknown, tau in q = b(p) e + tau t with t normal to e, and
!>
!>     t.ds + D tau = 0,     D = (|d| - b(p))/(r b(p)),
!>
!> where D tends to |ds|/b(p) (P. Alart and A. Curnier, Comput. Methods Appl. Mech. Eng. 92, 1991, 353-375). The direction of
!> slip is thus that of -ds, and it converges quadratically.
!>
!> Where the set is an ellipse, A^-1 q and A ds obey the law of the disc with the stretch A, because ds.q stays as it is; its
!> direction e and compliance D become the normal n ~ A^-1 e of the ellipse and D/|A^-1 e|^2 across it.
!>
!> Passes over one row of nodes are written so that the compiler takes several nodes at a time: lengths of vectors are
!> roots of sums of squares there, and pressures have to come in a unit of their own size.
!>
!> Equations: docs/theory/friction.md, (F3), (F6), (F16).
module hc_disc_law
  use hc_precision, only: wp, zk
  use hc_friction_law, only: friction_law_t
  use hc_contact_state, only: separated, stick, slip
  implicit none
  private

  public :: disc_law_t, normal_to, cone_row

  !> Squares below this count as nothing
  real(wp), parameter :: nothing = 1.0e-200_wp
  !> Length below which a traction is nothing, and radius that stands for no bound, in the unit of pressure
  real(wp), parameter :: smallest_length = 1.0e-100_wp, widest = 1.0e100_wp
  !> Smallest bound of the traction that counts in D, relative to the largest
  real(wp), parameter :: smallest_bound = 1.0e-12_wp

  !> A law whose admissible tractions are a disc or an ellipse; its extensions say how large.
  type, abstract, extends(friction_law_t) :: disc_law_t
  contains
    !> Compute the radius of the disc of each node
    procedure(disc), deferred :: find_disc
    !> Compute the largest radius over the largest pressure
    procedure(disc_strength), deferred :: strength_of_disc
    !> Return the squares of the smallest and of the largest stretch
    procedure :: stretches
    procedure :: strength, find_zones, project, violation
    procedure :: linearize => linearize_row
  end type disc_law_t

  abstract interface
    !> Compute the radius of the disc of each node as slope times a pressure; where there is pressure, that one is above zero.
    pure subroutine disc(self, first, p, slope, pressed)
      import :: disc_law_t, wp
      class(disc_law_t), intent(in) :: self
      !> Number of the first node
      integer, intent(in) :: first
      !> Pressure [Pa]
      real(wp), intent(in), contiguous :: p(:)
      !> Radius over `pressed`
      real(wp), intent(out) :: slope
      !> Pressure that the radius is proportional to (n) [Pa]
      real(wp), intent(out), contiguous :: pressed(:)
    end subroutine disc

    !> Compute the largest radius of all nodes over the largest pressure; infinite without slip.
    pure real(wp) function disc_strength(self, p_max)
      import :: disc_law_t, wp
      class(disc_law_t), intent(in) :: self
      !> Largest pressure of all nodes [Pa]
      real(wp), intent(in) :: p_max
    end function disc_strength
  end interface

contains

  !> Return the squares of the smallest and of the largest stretch of the plane by A; 1 for a disc.
  pure function stretches(self)
    class(disc_law_t), intent(in) :: self
    real(wp) :: stretches(2)

    stretches = 1.0_wp
  end function stretches

  !> Compute the largest traction over the largest pressure: the longer semi-axis of an ellipse.
  pure real(wp) function strength(self, p_max)
    class(disc_law_t), intent(in) :: self
    real(wp), intent(in) :: p_max
    real(wp) :: squares(2)

    squares = self%stretches()
    strength = self%strength_of_disc(p_max)*sqrt(squares(2))
  end function strength

  !> Classify the nodes of a row.
  pure subroutine find_zones(self, first, unit, r, p, qx, qy, dsx, dsy, zone)
    class(disc_law_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in) :: unit, r
    real(wp), intent(in), contiguous :: p(:), qx(:), qy(:), dsx(:), dsy(:)
    integer(zk), intent(out), contiguous :: zone(:)
    real(wp) :: slope, pressed(size(p))

    call self%find_disc(first, p, slope, pressed)
    if (self%is_isotropic()) then
      zone = zone_of(pressed, unit*(qx - r*dsx), unit*(qy - r*dsy), slope*unit*pressed)
    else
      associate (a => self%stretch())
        associate (q => squeezed(a, qx, qy), ds => stretched(a, dsx, dsy))
          zone = zone_of(pressed, unit*(q(:, 1) - r*ds(:, 1)), unit*(q(:, 2) - r*ds(:, 2)), slope*unit*pressed)
        end associate
      end associate
    end if
  end subroutine find_zones

  !> Project the tractions of a row on the disc, in the metric of the stretched plane.
  pure subroutine project(self, first, unit, p, qx, qy, cut_x, cut_y)
    class(disc_law_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in) :: unit
    real(wp), intent(in), contiguous :: p(:), qx(:), qy(:)
    real(wp), intent(out), contiguous :: cut_x(:), cut_y(:)
    real(wp) :: slope, pressed(size(p))

    call self%find_disc(first, p, slope, pressed)
    if (self%is_isotropic()) then
      call cone_row(size(p), unit, slope, pressed, qx, qy, cut_x, cut_y)
    else
      associate (a => self%stretch())
        associate (q => squeezed(a, qx, qy))
          call cone_row(size(p), unit, slope, pressed, q(:, 1), q(:, 2), cut_x, cut_y)
        end associate
        associate (cut => stretched(a, cut_x, cut_y))
          cut_x = cut(:, 1)
          cut_y = cut(:, 2)
        end associate
      end associate
    end if
  end subroutine project

  !> Measure |q - P(q - A^2 ds/d_t)|, P the projection in the metric A^-2, in which an ellipse is a disc.
  pure subroutine violation(self, first, unit, stiffness, p, qx, qy, dsx, dsy, largest, worst)
    class(disc_law_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in) :: unit, stiffness
    real(wp), intent(in), contiguous :: p(:), qx(:), qy(:), dsx(:), dsy(:)
    real(wp), intent(inout) :: largest, worst
    real(wp), allocatable :: cut(:, :), trial(:, :)
    real(wp) :: slope, pressed(size(p)), x, y, trial_x, trial_y, length, share, touches
    integer :: i

    if (self%is_isotropic()) then
      call self%find_disc(first, p, slope, pressed)
      !$omp simd reduction(max: largest, worst) private(x, y, trial_x, trial_y, length, share, touches)
      do i = 1, size(p)
        touches = merge(1.0_wp, 0.0_wp, pressed(i) > 0.0_wp)
        x = unit*qx(i)
        y = unit*qy(i)
        trial_x = x - unit*stiffness*dsx(i)
        trial_y = y - unit*stiffness*dsy(i)
        length = sqrt(max(trial_x**2 + trial_y**2, nothing))
        share = min(slope*max(unit*pressed(i), 0.0_wp)/length, 1.0_wp)
        largest = max(largest, touches*(x**2 + y**2))
        worst = max(worst, touches*((x - share*trial_x)**2 + (y - share*trial_y)**2))
      end do
    else
      allocate (cut(size(p), 2))
      associate (a => self%stretch())
        trial = stretched(a, dsx, dsy)
        trial = stretched(a, trial(:, 1), trial(:, 2))
      end associate
      trial = reshape([qx, qy], shape(trial)) - stiffness*trial
      call self%project(first, unit, p, trial(:, 1), trial(:, 2), cut(:, 1), cut(:, 2))
      largest = max(largest, maxval(unit**2*(qx**2 + qy**2), mask=p > 0.0_wp))
      worst = max(worst, maxval(unit**2*((qx - cut(:, 1))**2 + (qy - cut(:, 2))**2), mask=p > 0.0_wp))
    end if
  end subroutine violation

  !> Linearise the law at the nodes of a row, those in contact.
  pure subroutine linearize_row(self, first, p_max, r, in_contact, p, qx, qy, dsx, dsy, zone, direction, compliance)
    class(disc_law_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in) :: p_max, r
    logical, intent(in), contiguous :: in_contact(:)
    real(wp), intent(in), contiguous :: p(:), qx(:), qy(:), dsx(:), dsy(:)
    integer(zk), intent(out), contiguous :: zone(:)
    real(wp), intent(out), contiguous :: direction(:, :), compliance(:)
    real(wp) :: bound(size(p)), squares(2), largest, largest_r, length, unit
    real(wp), allocatable :: normal(:, :)
    integer :: i

    call self%find_bounds(first, p, bound)
    largest = huge(1.0_wp)
    if (self%is_bounded()) largest = self%strength_of_disc(p_max)*max(p_max, 0.0_wp)
    unit = 1.0_wp
    if (p_max > 0.0_wp) unit = 1.0_wp/p_max
    if (self%is_isotropic()) then
      call linearize_disc(unit, bound, largest, r, qx - r*dsx, qy - r*dsy, direction, compliance)
      call classify(in_contact, zone, direction, compliance)
      return
    end if
    squares = self%stretches()
    ! r A^2 is nowhere above r, or the classification would be no contraction
    largest_r = r*squares(1)
    associate (a => self%stretch())
      associate (q => squeezed(a, qx, qy), ds => stretched(a, dsx, dsy))
        call linearize_disc(unit, bound, largest, largest_r, q(:, 1) - largest_r*ds(:, 1), q(:, 2) - largest_r*ds(:, 2), &
                            direction, compliance)
      end associate
      call classify(in_contact, zone, direction, compliance)
      normal = squeezed(a, direction(1, :), direction(2, :))
    end associate
    do i = 1, size(p)
      if (zone(i) /= slip) cycle
      length = norm2(normal(i, :))
      direction(:, i) = normal(i, :)/length
      compliance(i) = compliance(i)/length**2
    end do
  end subroutine linearize_row

  !> Linearise the law of the disc at the nodes of a row.
  pure subroutine linearize_disc(unit, bound, largest, r, dx, dy, direction, compliance)
    !> Inverse of the unit of pressure
    real(wp), intent(in) :: unit
    !> Radius of each node, and the largest of all nodes [Pa]
    real(wp), intent(in), contiguous :: bound(:)
    real(wp), intent(in) :: largest
    !> Parameter r [Pa/m], and d = q - r ds
    real(wp), intent(in) :: r
    real(wp), intent(in), contiguous :: dx(:), dy(:)
    !> Direction e (2, n) and compliance D (n) of the nodes that slip
    real(wp), intent(out), contiguous :: direction(:, :), compliance(:)
    real(wp) :: x, y, length, radius, least, slips, widest_bound, alone
    integer :: i

    widest_bound = widest/unit
    least = smallest_bound*unit*min(largest, widest_bound)
    ! without any pressure the traction itself is the scale
    alone = merge(0.0_wp, smallest_bound, largest > 0.0_wp)
    !$omp simd private(x, y, length, radius, slips)
    do i = 1, size(bound)
      x = unit*dx(i)
      y = unit*dy(i)
      length = sqrt(max(x**2 + y**2, nothing))
      radius = unit*min(bound(i), widest_bound)
      ! 1 or 0, without a condition, so that the compiler takes several nodes at a time
      slips = 0.5_wp - sign(0.5_wp, max(radius, smallest_length) - length)
      direction(1, i) = slips*(x/length) + (1.0_wp - slips)
      direction(2, i) = slips*(y/length)
      compliance(i) = slips*(max(length - radius, 0.0_wp)/(r*max(radius, least, alone*length)))
    end do
  end subroutine linearize_disc

  !> Find the zones of the nodes of a row.
  pure subroutine classify(in_contact, zone, direction, compliance)
    !> Nodes in contact; the others are separated
    logical, intent(in), contiguous :: in_contact(:)
    !> separated, stick or slip
    integer(zk), intent(out), contiguous :: zone(:)
    !> Direction e (2, n) and compliance D (n) of the nodes that slip
    real(wp), intent(inout), contiguous :: direction(:, :), compliance(:)
    integer :: i

    do i = 1, size(zone)
      zone(i) = merge(merge(slip, stick, compliance(i) > 0.0_wp), separated, in_contact(i))
      if (in_contact(i)) cycle
      direction(:, i) = [1.0_wp, 0.0_wp]
      compliance(i) = 0.0_wp
    end do
  end subroutine classify

  !> Return the unit vector t, a quarter turn ahead of e.
  pure function normal_to(direction) result(t)
    !> Unit vector e
    real(wp), intent(in) :: direction(2)
    real(wp) :: t(2)
    t = [-direction(2), direction(1)]
  end function normal_to

  !> Classify a node by |q - r ds|.
  elemental integer(zk) function zone_of(p, x, y, radius) result(zone)
    !> Pressure; components of q - r ds and radius of the disc, in the unit of pressure
    real(wp), intent(in) :: p, x, y, radius

    zone = merge(stick, slip, x**2 + y**2 <= radius**2)
    zone = merge(zone, separated, p > 0.0_wp)
  end function zone_of

  !> Project the tractions of a row on the disc; zero where there is no pressure.
  pure subroutine cone_row(n, unit, slope, p, qx, qy, cut_x, cut_y)
    !> Number of nodes
    integer, intent(in) :: n
    !> Inverse of the unit of pressure; slope of the radius
    real(wp), intent(in) :: unit, slope
    !> Pressure and traction
    real(wp), intent(in) :: p(n), qx(n), qy(n)
    !> Traction within the disc
    real(wp), intent(out) :: cut_x(n), cut_y(n)
    real(wp) :: length, share
    integer :: i

    !$omp simd private(length, share)
    do i = 1, n
      length = sqrt(max((unit*qx(i))**2 + (unit*qy(i))**2, nothing))
      share = min(slope*max(unit*p(i), 0.0_wp)/length, 1.0_wp)
      cut_x(i) = share*qx(i)
      cut_y(i) = share*qy(i)
    end do
  end subroutine cone_row

  !> Compute A v.
  pure function stretched(a, x, y) result(vector)
    !> The matrix A
    real(wp), intent(in) :: a(2, 2)
    !> Components of v
    real(wp), intent(in) :: x(:), y(:)
    real(wp) :: vector(size(x), 2)

    vector(:, 1) = a(1, 1)*x + a(1, 2)*y
    vector(:, 2) = a(2, 1)*x + a(2, 2)*y
  end function stretched

  !> Compute A^-1 v; the determinant of A is 1.
  pure function squeezed(a, x, y) result(vector)
    !> The matrix A
    real(wp), intent(in) :: a(2, 2)
    !> Components of v
    real(wp), intent(in) :: x(:), y(:)
    real(wp) :: vector(size(x), 2)

    vector(:, 1) = a(2, 2)*x - a(1, 2)*y
    vector(:, 2) = a(1, 1)*y - a(2, 1)*x
  end function squeezed

end module hc_disc_law
