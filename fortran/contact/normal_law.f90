!> The law of contact along the normal, as the solvers see it, and unilateral contact.
!>
!> A law relates pressure and gap of each node. Unilateral contact, p >= 0, g >= 0, p g = 0, is one equation,
!>
!>     p = max(0, p - r g)     for any r > 0
!>
!> ((F2) of docs/theory/friction.md): nodes with p - r g > 0 are in contact, and there g = 0 (Hintermueller, Ito & Kunisch,
!> SIAM J. Optim. 13, 2003). As with friction (see hc_friction_law) laws are asked about rows of nodes.
module hc_normal_law
  use hc_precision, only: wp
  implicit none
  private

  public :: normal_law_t, unilateral_t

  !> A law of contact along the normal.
  type, abstract :: normal_law_t
  contains
    !> Nodes that are in contact by p - r g
    procedure(law_contact), deferred :: find_contact
    !> Pressure projected on what the law allows
    procedure(law_project), deferred :: project
    !> What pressure and gap lack of the law
    procedure(law_violation), deferred :: violation
  end type normal_law_t

  !> Bodies that push and do not penetrate.
  type, extends(normal_law_t) :: unilateral_t
  contains
    procedure :: find_contact => unilateral_contact
    procedure :: project => unilateral_project
    procedure :: violation => unilateral_violation
  end type unilateral_t

  abstract interface
    pure subroutine law_contact(self, first, r, p, gap, candidate, contact)
      import :: normal_law_t, wp
      class(normal_law_t), intent(in) :: self
      !> Number of the first node
      integer, intent(in) :: first
      !> Classification parameter [Pa/m]
      real(wp), intent(in) :: r
      !> Pressure [Pa] and gap [m]
      real(wp), intent(in), contiguous :: p(:), gap(:)
      !> Nodes that may come into contact
      logical, intent(in), contiguous :: candidate(:)
      !> Nodes in contact
      logical, intent(out), contiguous :: contact(:)
    end subroutine law_contact

    pure subroutine law_project(self, first, p, cut)
      import :: normal_law_t, wp
      class(normal_law_t), intent(in) :: self
      !> Number of the first node
      integer, intent(in) :: first
      !> Pressure, and what is left of it [Pa]
      real(wp), intent(in), contiguous :: p(:)
      real(wp), intent(out), contiguous :: cut(:)
    end subroutine law_project

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

  pure subroutine unilateral_contact(self, first, r, p, gap, candidate, contact)
    class(unilateral_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in) :: r
    real(wp), intent(in), contiguous :: p(:), gap(:)
    logical, intent(in), contiguous :: candidate(:)
    logical, intent(out), contiguous :: contact(:)
    integer :: i

    associate (law => self, same_everywhere => first)
      do i = 1, size(p)
        contact(i) = candidate(i) .and. p(i) - r*gap(i) > 0.0_wp
      end do
    end associate
  end subroutine unilateral_contact

  pure subroutine unilateral_project(self, first, p, cut)
    class(unilateral_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in), contiguous :: p(:)
    real(wp), intent(out), contiguous :: cut(:)

    associate (law => self, same_everywhere => first)
      cut = max(p, 0.0_wp)
    end associate
  end subroutine unilateral_project

  !> |p - max(0, p - g/d_n)| = |min(p, g/d_n)|.
  pure subroutine unilateral_violation(self, first, compliance, p, gap, candidate, worst)
    class(unilateral_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in) :: compliance
    real(wp), intent(in), contiguous :: p(:), gap(:)
    logical, intent(in), contiguous :: candidate(:)
    real(wp), intent(inout) :: worst
    integer :: i

    associate (law => self, same_everywhere => first)
      !$omp simd reduction(max: worst)
      do i = 1, size(p)
        worst = max(worst, merge(abs(min(p(i), gap(i)/compliance)), 0.0_wp, candidate(i)))
      end do
    end associate
  end subroutine unilateral_violation

end module hc_normal_law
