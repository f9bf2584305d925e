!> Abstract law of friction.
!>
!> Over a load step every node in contact satisfies
!>
!>     q = P(q - r ds)     for any r > 0,
!>
!> P the projection on the tractions that the law allows under the pressure p ((F3) of docs/theory/friction.md; Alart
!> & Curnier, Comput. Methods Appl. Mech. Eng. 92, 1991). Where P cuts something off the node slips, and a step of Newton's
!> method leaves one unknown, tau in q = bound(p) e + tau t with t a quarter turn ahead of e, and t.ds + D tau = 0.
!>
!> The procedures of a law take rows of nodes, never a single one, so that the calls of abstract procedures cost nothing: p, q,
!> ds are those of consecutive nodes, of which `first` is the number of the first, counted over the window row by row. A law
!> that differs from node to node finds its numbers by it.
!>
!> The tractions that a law allows are a disc, |q| <= b(p), or after a stretch A of the plane, |A^-1 q| <= b(p), an ellipse:
!> (F16) of docs/theory/friction.md. The direction of a slipping node is the outward normal n of its boundary then, and the
!> traction is a b(p) n + c b(p) t + tau t with the point (a, c) of the boundary that has this normal.
!>
!> A law may depend on the zones at the end of the step before, as static and kinetic friction do. Solvers give them to it at the
!> beginning of each step, on every lattice.
module hc_friction_law
  use hc_precision, only: wp, zk
  use hc_error, only: error_t
  implicit none
  private

  public :: friction_law_t

  !> A law of friction.
  type, abstract :: friction_law_t
  contains
    !> Return whether there is any friction, and whether the traction has a bound: without one no node slips
    procedure(law_is), deferred :: resists, is_bounded
    !> Refuse numbers that make no sense on a lattice
    procedure(law_check), deferred :: check
    !> Largest traction over the largest pressure, of all nodes; infinite without slip
    procedure(law_strength), deferred :: strength
    !> Largest traction of each node, and its derivative by the pressure
    procedure(law_bounds), deferred :: find_bounds, find_slopes
    !> Classify the nodes by q - r ds
    procedure(law_zones), deferred :: find_zones
    !> Project tractions on the admissible set
    procedure(law_project), deferred :: project
    !> Measure how far tractions are from the law
    procedure(law_violation), deferred :: violation
    !> Linearise the law: zones, directions and compliances
    procedure(law_linearize), deferred :: linearize
    !> Largest traction of all nodes under a largest pressure
    procedure :: largest_bound
    !> Largest traction of each node of a window, and its derivative; that along a given traction
    procedure :: bounds_of, slopes_of, bounds_along
    !> Return whether the admissible set is a disc, and the stretch that makes it of one
    procedure :: is_isotropic, stretch
    !> Lengths of tractions that are at most b(p), and points of the boundary by its normals
    procedure :: find_lengths, find_boundary
    !> Numbers of the nodes, where they differ; the law of other nodes
    procedure :: find_nodal_values, set_nodal_values
    !> Take the zones at the beginning of a step
    procedure :: begin_step
  end type friction_law_t

  abstract interface
    !> Return a property of the law.
    pure logical function law_is(self)
      import :: friction_law_t
      class(friction_law_t), intent(in) :: self
    end function law_is

    !> Refuse numbers that make no sense.
    pure subroutine law_check(self, n_node, error)
      import :: friction_law_t, error_t
      class(friction_law_t), intent(in) :: self
      !> Number of nodes of this rank
      integer, intent(in) :: n_node
      !> Allocated on failure
      type(error_t), allocatable, intent(out) :: error
    end subroutine law_check

    !> Compute the largest traction over the largest pressure, of all nodes; infinite without slip.
    pure real(wp) function law_strength(self, p_max)
      import :: friction_law_t, wp
      class(friction_law_t), intent(in) :: self
      !> Largest pressure of all nodes [Pa]
      real(wp), intent(in) :: p_max
    end function law_strength

    !> Compute the largest traction of each node of a row, or its derivative by the pressure.
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

    !> Classify the nodes of a row by q - r ds.
    pure subroutine law_zones(self, first, unit, r, p, qx, qy, dsx, dsy, zone)
      import :: friction_law_t, wp, zk
      class(friction_law_t), intent(in) :: self
      !> Number of the first node
      integer, intent(in) :: first
      !> Inverse of the largest pressure [1/Pa]; classification parameter [Pa/m]
      real(wp), intent(in) :: unit, r
      !> Pressure, traction and slip of the step
      real(wp), intent(in), contiguous :: p(:), qx(:), qy(:), dsx(:), dsy(:)
      !> separated, stick or slip
      integer(zk), intent(out), contiguous :: zone(:)
    end subroutine law_zones

    !> Project the tractions of a row on the admissible set.
    pure subroutine law_project(self, first, unit, p, qx, qy, cut_x, cut_y)
      import :: friction_law_t, wp
      class(friction_law_t), intent(in) :: self
      !> Number of the first node
      integer, intent(in) :: first
      !> Inverse of the largest pressure [1/Pa]
      real(wp), intent(in) :: unit
      !> Pressure and traction [Pa]
      real(wp), intent(in), contiguous :: p(:), qx(:), qy(:)
      !> Projected traction; 0 without pressure [Pa]
      real(wp), intent(out), contiguous :: cut_x(:), cut_y(:)
    end subroutine law_project

    !> Measure how far the tractions of a row are from the law.
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

    !> Linearise the law at the nodes of a row: zones, directions and compliances.
    pure subroutine law_linearize(self, first, p_max, r, in_contact, p, qx, qy, dsx, dsy, zone, direction, compliance)
      import :: friction_law_t, wp, zk
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
      integer(zk), intent(out), contiguous :: zone(:)
      !> Direction of the traction in slip, or the normal of the boundary; (1, 0) elsewhere (2, n)
      real(wp), intent(out), contiguous :: direction(:, :)
      !> Compliance D across that direction, 0 elsewhere [m/Pa]
      real(wp), intent(out), contiguous :: compliance(:)
    end subroutine law_linearize
  end interface

contains

  !> Compute the largest traction of all nodes under a largest pressure [Pa]; huge without a bound.
  pure real(wp) function largest_bound(self, p_max)
    class(friction_law_t), intent(in) :: self
    !> Largest pressure [Pa]
    real(wp), intent(in) :: p_max

    largest_bound = huge(1.0_wp)
    if (self%is_bounded()) largest_bound = self%strength(p_max)*max(p_max, 0.0_wp)
  end function largest_bound

  !> Compute the largest traction of each node of a window [Pa].
  pure function bounds_of(self, pressure) result(bound)
    class(friction_law_t), intent(in) :: self
    !> Pressure (n_col, n_row) [Pa]
    real(wp), intent(in) :: pressure(:, :)
    real(wp) :: bound(size(pressure, 1), size(pressure, 2))
    integer :: row

    do row = 1, size(bound, 2)
      call self%find_bounds((row - 1)*size(bound, 1) + 1, pressure(:, row), bound(:, row))
    end do
  end function bounds_of

  !> Differentiate the largest traction of each node of a window by the pressure.
  pure function slopes_of(self, pressure) result(slope)
    class(friction_law_t), intent(in) :: self
    !> Pressure (n_col, n_row) [Pa]
    real(wp), intent(in) :: pressure(:, :)
    real(wp) :: slope(size(pressure, 1), size(pressure, 2))
    integer :: row

    do row = 1, size(slope, 2)
      call self%find_slopes((row - 1)*size(slope, 1) + 1, pressure(:, row), slope(:, row))
    end do
  end function slopes_of

  !> Compute the largest traction of each node of a window in the direction of a given one: b(p) |q|/|A^-1 q| [Pa].
  pure function bounds_along(self, pressure, traction) result(bound)
    class(friction_law_t), intent(in) :: self
    !> Pressure (n_col, n_row), and traction (n_col, n_row, 2) [Pa]
    real(wp), intent(in) :: pressure(:, :), traction(:, :, :)
    real(wp) :: bound(size(pressure, 1), size(pressure, 2)), length(size(pressure, 1))
    integer :: row

    bound = self%bounds_of(pressure)
    if (self%is_isotropic()) return
    do row = 1, size(bound, 2)
      call self%find_lengths(traction(:, row, 1), traction(:, row, 2), length)
      where (length > 0.0_wp) bound(:, row) = bound(:, row)*(norm2(traction(:, row, :), dim=2)/length)
    end do
  end function bounds_along

  !> Return whether the admissible set is a disc; a law with another set overrides it.
  pure logical function is_isotropic(self)
    class(friction_law_t), intent(in) :: self

    is_isotropic = .true.
  end function is_isotropic

  !> Return the symmetric matrix A with determinant 1 that makes the admissible set of a disc.
  pure function stretch(self) result(matrix)
    class(friction_law_t), intent(in) :: self
    real(wp) :: matrix(2, 2)

    matrix = reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 2])
  end function stretch

  !> Compute |A^-1 q| of a row [Pa].
  pure subroutine find_lengths(self, qx, qy, length)
    class(friction_law_t), intent(in) :: self
    !> Tractions [Pa]
    real(wp), intent(in), contiguous :: qx(:), qy(:)
    !> Their lengths [Pa]
    real(wp), intent(out), contiguous :: length(:)
    real(wp) :: a(2, 2)

    a = self%stretch()
    length = hypot(a(2, 2)*qx - a(1, 2)*qy, a(1, 1)*qy - a(1, 2)*qx)
  end subroutine find_lengths

  !> Compute the points A^2 n/|A n| of the boundary under b = 1, by their normals n.
  pure subroutine find_boundary(self, direction, along, across)
    class(friction_law_t), intent(in) :: self
    !> Normals n (2, n)
    real(wp), intent(in), contiguous :: direction(:, :)
    !> Components along n and along t, a quarter turn ahead of it
    real(wp), intent(out), contiguous :: along(:), across(:)
    real(wp) :: a(2, 2), moved(2), point(2)
    integer :: i

    along = 1.0_wp
    across = 0.0_wp
    if (self%is_isotropic()) return
    a = self%stretch()
    do i = 1, size(along)
      moved = matmul(a, direction(:, i))
      along(i) = norm2(moved)
      if (.not. along(i) > 0.0_wp) cycle
      point = matmul(a, moved)/along(i)
      across(i) = direction(1, i)*point(2) - direction(2, i)*point(1)
    end do
  end subroutine find_boundary

  !> Take the zones at the end of the step before; a law that depends on them overrides this.
  pure subroutine begin_step(self, zone)
    class(friction_law_t), intent(inout) :: self
    !> Zone of each node (n_col, n_row)
    integer(zk), intent(in) :: zone(:, :)
  end subroutine begin_step

  !> Return a number of each node, row by row; a law whose nodes are not alike overrides this.
  pure subroutine find_nodal_values(self, values)
    class(friction_law_t), intent(in) :: self
    !> Values at the nodes of this rank; none if all are alike
    real(wp), allocatable, intent(out) :: values(:)

    allocate (values(0))
  end subroutine find_nodal_values

  !> Set the number of each node, those of another lattice or of a part of the window; see `find_nodal_values`.
  pure subroutine set_nodal_values(self, values, largest)
    class(friction_law_t), intent(inout) :: self
    !> Values at the nodes of this rank
    real(wp), intent(in) :: values(:)
    !> Largest value of all ranks
    real(wp), intent(in) :: largest
  end subroutine set_nodal_values

end module hc_friction_law
