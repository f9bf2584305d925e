!> The law of friction, as the solvers see it.
!>
!> Over a load step every node in contact fulfils
!>
!>     q = P(q - r ds)     for any r > 0,
!>
!> P the projection on the tractions that the law allows under the pressure p ((F3) of docs/theory/friction.md; Alart
!> & Curnier, Comput. Methods Appl. Mech. Eng. 92, 1991). Where P cuts something off the node slips, and a step of Newton's
!> method leaves one unknown, tau in q = bound(p) e + tau t with t a quarter turn ahead of e, and t.ds + D tau = 0.
!>
!> Laws are asked about rows of nodes, never about one alone, so that it costs nothing that they are abstract: p, q, ds are
!> those of consecutive nodes, of which `first` is the number of the first, counted over the window row by row. A law that
!> differs from node to node finds its numbers by it.
module hc_friction_law
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_lattice, only: lattice_t
  implicit none
  private

  public :: friction_law_t

  !> A law of friction.
  type, abstract :: friction_law_t
  contains
    !> Is there any friction? Is there a bound of the traction, or does no node in contact slip?
    procedure(law_is), deferred :: resists, is_bounded
    !> Do its numbers make sense on a lattice?
    procedure(law_check), deferred :: check
    !> Largest traction over the pressure, of all nodes; infinite without slip
    procedure(law_strength), deferred :: strength
    !> Largest traction of each node, and its derivative by the pressure
    procedure(law_bounds), deferred :: find_bounds, find_slopes
    !> Zones of the nodes that q - r ds calls for
    procedure(law_zones), deferred :: find_zones
    !> Tractions projected on what the law allows
    procedure(law_project), deferred :: project
    !> What tractions lack of the law
    procedure(law_violation), deferred :: violation
    !> Zones, directions and compliances of the linearised law
    procedure(law_linearize), deferred :: linearize
    !> Largest traction at all under a largest pressure
    procedure :: largest_bound
    !> The same law on another lattice: a coarser one, or a part
    procedure :: on_lattice
  end type friction_law_t

  abstract interface
    pure logical function law_is(self)
      import :: friction_law_t
      class(friction_law_t), intent(in) :: self
    end function law_is

    pure subroutine law_check(self, lattice, error)
      import :: friction_law_t, lattice_t, error_t
      class(friction_law_t), intent(in) :: self
      !> Lattice and window
      type(lattice_t), intent(in) :: lattice
      !> Allocated on failure
      type(error_t), allocatable, intent(out) :: error
    end subroutine law_check

    pure real(wp) function law_strength(self)
      import :: friction_law_t, wp
      class(friction_law_t), intent(in) :: self
    end function law_strength

    pure subroutine law_bounds(self, first, p, bound)
      import :: friction_law_t, wp
      class(friction_law_t), intent(in) :: self
      !> Number of the first node
      integer, intent(in) :: first
      !> Pressure [Pa]
      real(wp), intent(in), contiguous :: p(:)
      !> Largest traction [Pa], or its derivative
      real(wp), intent(out), contiguous :: bound(:)
    end subroutine law_bounds

    pure subroutine law_zones(self, first, unit, r, p, qx, qy, dsx, dsy, zone)
      import :: friction_law_t, wp
      class(friction_law_t), intent(in) :: self
      !> Number of the first node
      integer, intent(in) :: first
      !> Inverse of the largest pressure [1/Pa]; classification parameter [Pa/m]
      real(wp), intent(in) :: unit, r
      !> Pressure, traction and slip of the step
      real(wp), intent(in), contiguous :: p(:), qx(:), qy(:), dsx(:), dsy(:)
      !> separated, stick or slip
      integer, intent(out), contiguous :: zone(:)
    end subroutine law_zones

    pure subroutine law_project(self, first, unit, p, qx, qy, cut_x, cut_y)
      import :: friction_law_t, wp
      class(friction_law_t), intent(in) :: self
      !> Number of the first node
      integer, intent(in) :: first
      !> Inverse of the largest pressure [1/Pa]
      real(wp), intent(in) :: unit
      !> Pressure and traction [Pa]
      real(wp), intent(in), contiguous :: p(:), qx(:), qy(:)
      !> What is left of the traction; nothing where there is no pressure [Pa]
      real(wp), intent(out), contiguous :: cut_x(:), cut_y(:)
    end subroutine law_project

    pure subroutine law_violation(self, first, unit, stiffness, p, qx, qy, dsx, dsy, largest, worst)
      import :: friction_law_t, wp
      class(friction_law_t), intent(in) :: self
      !> Number of the first node
      integer, intent(in) :: first
      !> Inverse of the largest pressure [1/Pa]; inverse of the self-compliance d_t [Pa/m]
      real(wp), intent(in) :: unit, stiffness
      !> Pressure, traction and slip of the step
      real(wp), intent(in), contiguous :: p(:), qx(:), qy(:), dsx(:), dsy(:)
      !> Squares of the largest traction and of the largest |q - P(q - ds/d_t)|, in the unit of pressure: those of the
      !> rows before, and now of this one too
      real(wp), intent(inout) :: largest, worst
    end subroutine law_violation

    pure subroutine law_linearize(self, first, p_max, r, in_contact, p, qx, qy, dsx, dsy, zone, direction, compliance)
      import :: friction_law_t, wp
      class(friction_law_t), intent(in) :: self
      !> Number of the first node
      integer, intent(in) :: first
      !> Largest pressure of all nodes [Pa]; classification parameter [Pa/m]
      real(wp), intent(in) :: p_max, r
      !> Nodes in contact; the others are separated
      logical, intent(in), contiguous :: in_contact(:)
      !> Pressure, traction and slip of the step, of the last iterate
      real(wp), intent(in), contiguous :: p(:), qx(:), qy(:), dsx(:), dsy(:)
      !> separated, stick or slip
      integer, intent(out), contiguous :: zone(:)
      !> Direction e of the traction in slip, (1, 0) elsewhere (2, n)
      real(wp), intent(out), contiguous :: direction(:, :)
      !> Compliance D across that direction, 0 elsewhere [m/Pa]
      real(wp), intent(out), contiguous :: compliance(:)
    end subroutine law_linearize
  end interface

contains

  !> Largest traction at all under a largest pressure [Pa]; huge without a bound.
  pure real(wp) function largest_bound(self, p_max)
    class(friction_law_t), intent(in) :: self
    !> Largest pressure [Pa]
    real(wp), intent(in) :: p_max

    largest_bound = huge(1.0_wp)
    if (self%is_bounded()) largest_bound = self%strength()*max(p_max, 0.0_wp)
  end function largest_bound

  !> The same law on another lattice; one whose numbers differ from node to node has to override this.
  subroutine on_lattice(self, from, onto, law)
    class(friction_law_t), intent(in) :: self
    !> Lattice of the law, and one with every second node of it or with a part of its nodes
    type(lattice_t), intent(in) :: from, onto
    !> The law there
    class(friction_law_t), allocatable, intent(out) :: law

    associate (same_everywhere => self, here => from, there => onto)
      allocate (law, source=self)
    end associate
  end subroutine on_lattice

end module hc_friction_law
