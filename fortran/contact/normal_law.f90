!> Abstract law of contact along the normal, and unilateral contact.
!>
!> A law relates pressure and gap of each node. Unilateral contact, p >= 0, g >= 0, p g = 0, is one equation,
!>
!>     p = max(0, p - r g)     for any r > 0
!>
!> ((F2) of docs/theory/friction.md): nodes with p - r g > 0 are in contact, and there g = 0 (Hintermueller, Ito & Kunisch,
!> SIAM J. Optim. 13, 2003). As with friction (see hc_friction_law) the procedures take rows of nodes.
!>
!> Bodies with a compliant layer between them penetrate by sigma(p), sigma(0) = 0, sigma' > 0. They are in contact
!> unilaterally with g + sigma(p) in place of g,
!>
!>     p >= 0,     g + sigma(p) >= 0,     p (g + sigma(p)) = 0
!>
!> ((C5) of docs/theory/conditions.md), and one equation again, p = P(p - r g) with P(t) the solution of P + r sigma(P) = t
!> for t > 0, else 0. So the same nodes are in contact, those with p - r g > 0, and a step of Newton's method leaves
!> g + C p = -s there, with C = sigma'(P) and s = sigma(P) - C P: every node carries a spring of compliance C.
module hc_normal_law
  use hc_precision, only: wp
  use hc_error, only: error_t
  implicit none
  private

  public :: normal_law_t, unilateral_t, tangent_t

  !> Where a law is linearised.
  type :: tangent_t
    !> Classification parameter r, 0 to linearise about the present pressure [Pa/m]
    real(wp) :: r = 0.0_wp
    !> Compliance beyond which a spring has no effect [m/Pa]
    real(wp) :: softest = huge(1.0_wp)
  end type tangent_t

  !> A law of contact along the normal.
  type, abstract :: normal_law_t
  contains
    !> Return whether there is a compliant layer
    procedure(law_is), deferred :: is_compliant
    !> Refuse numbers that make no sense
    procedure(law_check), deferred :: check
    !> Compliance of the layer under a pressure
    procedure(law_compliance), deferred :: compliance_under
    !> Springs of the linearised law
    procedure(law_linearize), deferred :: linearize
    !> Find the nodes in contact by p - r g
    procedure, nopass :: find_contact
    !> Project the pressure on p >= 0
    procedure, nopass :: project
    !> Measure how far pressure and gap are from the law
    procedure(law_violation), deferred :: violation
  end type normal_law_t

  !> Unilateral contact: no tension, no penetration.
  type, extends(normal_law_t) :: unilateral_t
  contains
    procedure :: is_compliant => unilateral_is_compliant
    procedure :: check => unilateral_check
    procedure :: compliance_under => unilateral_compliance
    procedure :: linearize => unilateral_linearize
    procedure :: violation => unilateral_violation
  end type unilateral_t

  abstract interface
    !> Return a property of the law.
    pure logical function law_is(self)
      import :: normal_law_t
      class(normal_law_t), intent(in) :: self
    end function law_is

    !> Refuse numbers that make no sense.
    pure subroutine law_check(self, error)
      import :: normal_law_t, error_t
      class(normal_law_t), intent(in) :: self
      !> Allocated on failure
      type(error_t), allocatable, intent(out) :: error
    end subroutine law_check

    !> Compute the compliance of the layer under a pressure [m/Pa].
    pure real(wp) function law_compliance(self, pressure)
      import :: normal_law_t, wp
      class(normal_law_t), intent(in) :: self
      !> Pressure [Pa]
      real(wp), intent(in) :: pressure
    end function law_compliance

    !> Linearise the law at the nodes of a row: springs of compliance C and offset s.
    pure subroutine law_linearize(self, first, tangent, p, gap, contact, compliance, offset)
      import :: normal_law_t, tangent_t, wp
      class(normal_law_t), intent(in) :: self
      !> Number of the first node
      integer, intent(in) :: first
      !> Where the law is linearised
      type(tangent_t), intent(in) :: tangent
      !> Pressure [Pa] and gap [m]
      real(wp), intent(in), contiguous :: p(:), gap(:)
      !> Nodes in contact
      logical, intent(in), contiguous :: contact(:)
      !> Compliance C [m/Pa] and offset s [m] of each spring; 0 off the contact
      real(wp), intent(out), contiguous :: compliance(:), offset(:)
    end subroutine law_linearize

    !> Measure how far pressure and gap of a row are from the law.
    pure subroutine law_violation(self, first, compliance, p, gap, candidate, worst)
      import :: normal_law_t, wp
      class(normal_law_t), intent(in) :: self
      !> Number of the first node
      integer, intent(in) :: first
      !> Self-compliance d_n of a node [m/Pa]
      real(wp), intent(in) :: compliance
      !> Pressure [Pa] and gap [m], finite numbers
      real(wp), intent(in), contiguous :: p(:), gap(:)
      !> Nodes that may come into contact
      logical, intent(in), contiguous :: candidate(:)
      !> Largest pressure that is wrong: that of the rows before, and now of this one too [Pa]
      real(wp), intent(inout) :: worst
    end subroutine law_violation
  end interface

contains

  !> Return false: there is no layer.
  pure logical function unilateral_is_compliant(self) result(is_compliant)
    class(unilateral_t), intent(in) :: self

    is_compliant = .false.
  end function unilateral_is_compliant

  !> Accept: there are no numbers.
  pure subroutine unilateral_check(self, error)
    class(unilateral_t), intent(in) :: self
    type(error_t), allocatable, intent(out) :: error

  end subroutine unilateral_check

  !> Return 0: there is no layer.
  pure real(wp) function unilateral_compliance(self, pressure) result(compliance)
    class(unilateral_t), intent(in) :: self
    real(wp), intent(in) :: pressure

    compliance = 0.0_wp
  end function unilateral_compliance

  !> Return springs of no compliance.
  pure subroutine unilateral_linearize(self, first, tangent, p, gap, contact, compliance, offset)
    class(unilateral_t), intent(in) :: self
    integer, intent(in) :: first
    type(tangent_t), intent(in) :: tangent
    real(wp), intent(in), contiguous :: p(:), gap(:)
    logical, intent(in), contiguous :: contact(:)
    real(wp), intent(out), contiguous :: compliance(:), offset(:)

    compliance = 0.0_wp
    offset = 0.0_wp
  end subroutine unilateral_linearize

  !> Find the nodes in contact: those with p - r g > 0, for any law.
  pure subroutine find_contact(r, p, gap, candidate, contact)
    !> Classification parameter [Pa/m]
    real(wp), intent(in) :: r
    !> Pressure [Pa] and gap [m]
    real(wp), intent(in), contiguous :: p(:), gap(:)
    !> Nodes that may come into contact
    logical, intent(in), contiguous :: candidate(:)
    !> Nodes in contact
    logical, intent(out), contiguous :: contact(:)
    integer :: i

    do i = 1, size(p)
      contact(i) = candidate(i) .and. p(i) - r*gap(i) > 0.0_wp
    end do
  end subroutine find_contact

  !> Project the pressure on p >= 0, which holds for every law.
  pure subroutine project(p, cut)
    !> Pressure, and its projection [Pa]
    real(wp), intent(in), contiguous :: p(:)
    real(wp), intent(out), contiguous :: cut(:)

    cut = max(p, 0.0_wp)
  end subroutine project

  !> Measure |p - max(0, p - g/d_n)| = |min(p, g/d_n)|.
  pure subroutine unilateral_violation(self, first, compliance, p, gap, candidate, worst)
    class(unilateral_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in) :: compliance
    real(wp), intent(in), contiguous :: p(:), gap(:)
    logical, intent(in), contiguous :: candidate(:)
    real(wp), intent(inout) :: worst
    real(wp) :: stiffness
    integer :: i

    stiffness = 1.0_wp/compliance
    !$omp simd reduction(max: worst)
    do i = 1, size(p)
      worst = max(worst, abs(min(p(i), stiffness*gap(i)))*merge(1.0_wp, 0.0_wp, candidate(i)))
    end do
  end subroutine unilateral_violation

end module hc_normal_law
