!> (F7) of a contact area by GMRES, preconditioned with the factors of hc_area_factors.
!>
!> The unknowns are packed: p of all nodes, q_x and q_y of those that stick, tau of those that slide. Products are those of a
!> flexibility operator over the window, in full precision; the factors are of single precision and leave out the coupling
!> of pressure and shear, the friction of slipping nodes, and the direction in the matrix of the shear tractions.
!> Each direction of GMRES then leaves about a tenth of the error.
!>
!> Equations: docs/theory/friction.md, (F7), (F11) and "Direct method".
module hc_area_system
  use hc_precision, only: wp, lk
  use hc_error, only: error_t
  use hc_flexibility, only: normal, along_x
  use hc_load_constraints, only: driven_motions_t
  use hc_active_set, only: active_set_t, new_active_set
  use hc_linear_system, only: linear_system_t, constraints_t, iteration_t, precondition_constraints, solution_accurate
  use hc_projected_gmres, only: projected_gmres
  use hc_direct_iterate, only: direct_iterate_t
  implicit none
  private

  public :: area_t, solve_with_factors

  !> The linear problem (F7) of an area; lengths are over the self-compliance of a node, so that every number is a pressure.
  type :: area_t
    !> Nodes in contact, those that stick, those that slip with a spring across
    integer, allocatable :: contact(:), stuck(:), sliding(:)
    !> Node of each unknown, and its place in `contact` (n)
    integer, allocatable :: node(:), place(:)
    !> Displacements that the row of each unknown adds up, and its tractions (3, n); springs (n)
    real(wp), allocatable :: weight(:, :), traction(:, :), spring(:)
    !> Right-hand side at the present motions, and of unit motions (n, 0:m); unknowns of the same [Pa]
    real(wp), allocatable :: rhs(:, :), unknown(:, :)
    !> Loads of unit unknowns (n, m), loads over the cell area, the tangential ones last, changes of the motions (m) [Pa]
    real(wp), allocatable :: resultant(:, :), load(:), change(:)
    !> Shear traction of every node of the window that does not change with the unknowns (:, 2) [Pa]
    real(wp), allocatable :: fixed(:, :)
    !> Tangential motions driven by their loads
    type(driven_motions_t) :: driven
  end type area_t

  !> The matrix of an area and its factors.
  type, extends(linear_system_t) :: area_system_t
    type(direct_iterate_t), pointer :: it => null()
    type(area_t), pointer :: area => null()
  contains
    procedure :: product
    procedure :: precondition_packed
  end type area_system_t

contains

  !> Solve for the unknowns of an area and the changes of the driven motions, from a start.
  subroutine solve_with_factors(it, area, solved, error)
    !> Iterate, with the factors of the area
    type(direct_iterate_t), intent(in), target :: it
    !> The area; its unknowns at the present motions are on entry a start
    type(area_t), intent(inout), target :: area
    !> False: the loads do not determine the motions, or too many directions would be needed; the unknowns mean nothing then
    logical, intent(out) :: solved
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    type(area_system_t) :: system
    type(constraints_t) :: constraints
    type(iteration_t) :: iteration
    real(wp), allocatable :: right(:), ax(:)
    integer, allocatable :: determined(:)
    type(active_set_t) :: nodes
    real(wp) :: scale, largest
    integer :: k, n

    n = size(area%node)
    system%it => it
    system%area => area
    allocate (area%change(size(area%load)), source=0.0_wp)
    associate (x => area%unknown(:, 0))
      ! motions that no unknown resists do not change
      determined = pack([(k, k=1, size(area%load))], [(any(abs(area%rhs(:, k)) > 0.0_wp), k=1, size(area%load))])
      constraints%columns = area%rhs(:, determined)
      constraints%rows = area%resultant(:, determined)
      allocate (constraints%multiplier(size(determined)), source=0.0_wp)
      allocate (ax(n))
      call new_active_set(nodes, spread(.true._lk, 1, n), system%space)
      call precondition_constraints(system, nodes, n, constraints%columns, constraints%mb)
      call constraints%satisfy(system%space, area%load(determined) - matmul(x, constraints%rows), x, solved)
      if (.not. solved) return
      call system%product(x, ax, error)
      if (allocated(error)) return

      right = area%rhs(:, 0)
      largest = maxval(abs(x), mask=abs(area%weight(normal, :)) > 0.0_wp)
      if (.not. largest > 0.0_wp) largest = maxval(abs(right))
      scale = largest
      associate (friction => it%problem%friction, most => it%problem%options%direct%max_directions)
        if (friction%is_bounded() .and. friction%resists()) scale = min(scale, friction%largest_bound(largest))
        iteration = iteration_t(tolerance=it%accuracy*scale*real(n, wp)**0.25_wp, most=most, most_directions=most)
      end associate
      iteration%weight = [1.0_wp]
      call projected_gmres(system, nodes, constraints, right, x, ax, iteration, error)
      if (allocated(error)) return
    end associate
    solved = iteration%independent .and. iteration%outcome == solution_accurate
    area%change(determined) = constraints%multiplier
  end subroutine solve_with_factors

  !> Multiply by the matrix of (F7).
  subroutine product(self, x, y, error)
    class(area_system_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable, target :: field(:, :, :), moved(:, :, :)
    real(wp), pointer, contiguous :: f(:, :), u(:, :)
    integer :: k

    associate (n => self%it%problem%lattice%extent)
      allocate (field(n(1), n(2), 3), moved(n(1), n(2), 3))
    end associate
    f(1:size(field)/3, 1:3) => field
    u(1:size(field)/3, 1:3) => moved
    f = 0.0_wp
    do k = 1, size(x)
      f(self%area%node(k), :) = f(self%area%node(k), :) + x(k)*self%area%traction(:, k)
    end do
    call self%it%problem%displacements(self%it%operator, field(:, :, normal), field(:, :, along_x:), moved, error)
    if (allocated(error)) return
    do k = 1, size(x)
      y(k) = dot_product(self%area%weight(:, k), u(self%area%node(k), :))/self%it%problem%normal_compliance &
             + self%area%spring(k)*x(k)
    end do
  end subroutine product

  !> Apply the factors.
  subroutine precondition_packed(self, nodes, n, r, z)
    class(area_system_t), intent(inout) :: self
    type(active_set_t), intent(in) :: nodes
    integer, intent(in) :: n
    real(wp), intent(in), contiguous :: r(:)
    real(wp), intent(inout), contiguous :: z(:)

    call self%it%factors%apply(r, z)
  end subroutine precondition_packed

end module hc_area_system
