!> (F7) of a contact area by GMRES, preconditioned with the factors of hc_area_factors.
!>
!> The unknowns are packed: p of all nodes, q_x and q_y of those that stick, tau of those that slide. Products are those of a
!> flexibility operator over the window, in full precision; the factors are of single precision and leave out the coupling
!> of pressure and shear, what the pressure of a slipping node carries along, and the direction in the shear tractions' matrix.
!> Each direction of GMRES then leaves about a tenth of the error.
!>
!> Equations: docs/theory/friction.md, (F7), (F11) and "Direct method".
module hc_area_system
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_flexibility, only: flexibility_t, normal, along_x
  use hc_contact_problem, only: friction_problem_t
  use hc_active_set, only: active_set_t, new_active_set
  use hc_linear_system, only: linear_system_t, precondition_constraints, satisfy_constraints, solution_accurate
  use hc_projected_gmres, only: projected_gmres
  use hc_area_factors, only: area_factors_t
  implicit none
  private

  public :: solve_with_factors

  !> The matrix of an area and its factors.
  type, extends(linear_system_t) :: area_system_t
    !> What is given
    type(friction_problem_t), pointer :: problem => null()
    !> Products over the window
    class(flexibility_t), pointer :: operator => null()
    type(area_factors_t), pointer :: factors => null()
    !> Node of each unknown (n), displacements that its row adds up and its tractions (3, n), springs (n)
    integer, allocatable :: node(:)
    real(wp), allocatable :: weight(:, :), traction(:, :), spring(:)
  contains
    procedure :: product
    procedure :: precondition_packed
  end type area_system_t

contains

  !> Solve for the unknowns of an area and the changes of the driven motions, from a start.
  subroutine solve_with_factors(problem, operator, factors, node, weight, traction, spring, rhs, resultant, load, accuracy, x, &
                                change, solved, error)
    !> What is given
    type(friction_problem_t), intent(in), target :: problem
    !> Products over the window
    class(flexibility_t), intent(inout), target :: operator
    !> Factors of the area
    type(area_factors_t), intent(in), target :: factors
    !> Node of each unknown (n), displacements that its row adds up and its tractions (3, n), springs (n)
    integer, intent(in) :: node(:)
    real(wp), intent(in) :: weight(:, :), traction(:, :), spring(:)
    !> Right-hand side at the present motions, and of unit motions (n, 0:m) [Pa]
    real(wp), intent(in) :: rhs(:, 0:)
    !> Loads of unit unknowns (n, m), loads over the cell area (m) [Pa]
    real(wp), intent(in) :: resultant(:, :), load(:)
    !> Residual that may be left, relative to the largest pressure or traction
    real(wp), intent(in) :: accuracy
    !> Unknowns, on entry a start (n) [Pa]
    real(wp), intent(inout), contiguous :: x(:)
    !> Changes of the motions over the self-compliance of a node (m) [Pa]
    real(wp), allocatable, intent(out) :: change(:)
    !> False: the loads do not determine the motions, or too many directions would be needed; x means nothing then
    logical, intent(out) :: solved
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    type(area_system_t) :: system
    real(wp), allocatable :: columns(:, :), mb(:, :), rows(:, :), right(:), ax(:), multiplier(:)
    integer, allocatable :: determined(:)
    type(active_set_t) :: nodes
    logical :: independent
    real(wp) :: scale, residual, largest
    integer :: k, n, iterations, outcome

    n = size(x)
    system%problem => problem
    system%operator => operator
    system%factors => factors
    system%node = node
    system%weight = weight
    system%traction = traction
    system%spring = spring
    allocate (change(size(load)), source=0.0_wp)
    ! motions that no unknown resists stay as they are
    determined = pack([(k, k=1, size(load))], [(any(abs(rhs(:, k)) > 0.0_wp), k=1, size(load))])
    columns = rhs(:, determined)
    rows = resultant(:, determined)
    allocate (ax(n))
    call new_active_set(nodes, spread(.true., 1, n), system%space)
    call precondition_constraints(system, nodes, n, columns, mb, error)
    if (allocated(error)) return
    call satisfy_constraints(rows, mb, load(determined) - matmul(x, rows), x, solved, system%space)
    if (.not. solved) return
    call system%product(x, ax, error)
    if (allocated(error)) return

    right = rhs(:, 0)
    largest = maxval(abs(x), mask=abs(weight(normal, :)) > 0.0_wp)
    if (.not. largest > 0.0_wp) largest = maxval(abs(right))
    scale = largest
    if (problem%friction%is_bounded()) then
      if (problem%friction%resists()) scale = min(scale, problem%friction%largest_bound(largest))
    end if
    allocate (multiplier(size(determined)), source=0.0_wp)
    call projected_gmres(system, nodes, columns, mb, rows, [1.0_wp], right, x, ax, accuracy*scale*real(n, wp)**0.25_wp, &
                         problem%options%direct%max_directions, problem%options%direct%max_directions, multiplier, independent, &
                         residual, iterations, outcome, error)
    if (allocated(error)) return
    solved = independent .and. outcome == solution_accurate
    change(determined) = multiplier
  end subroutine solve_with_factors

  subroutine product(self, x, y, error)
    class(area_system_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable, target :: field(:, :, :), moved(:, :, :)
    real(wp), pointer, contiguous :: f(:, :), u(:, :)
    integer :: k

    associate (n => self%problem%lattice%extent)
      allocate (field(n(1), n(2), 3), moved(n(1), n(2), 3))
    end associate
    f(1:size(field)/3, 1:3) => field
    u(1:size(field)/3, 1:3) => moved
    f = 0.0_wp
    do k = 1, size(x)
      f(self%node(k), :) = f(self%node(k), :) + x(k)*self%traction(:, k)
    end do
    call self%problem%displacements(self%operator, field(:, :, normal), field(:, :, along_x:), moved, error)
    if (allocated(error)) return
    do k = 1, size(x)
      y(k) = dot_product(self%weight(:, k), u(self%node(k), :))/self%problem%normal_compliance + self%spring(k)*x(k)
    end do
  end subroutine product

  subroutine precondition_packed(self, nodes, n, r, z, error)
    class(area_system_t), intent(inout) :: self
    type(active_set_t), intent(in) :: nodes
    integer, intent(in) :: n
    real(wp), intent(in), contiguous :: r(:)
    real(wp), intent(inout), contiguous :: z(:)
    type(error_t), allocatable, intent(out) :: error

    call self%factors%apply(r, z)
  end subroutine precondition_packed

end module hc_area_system
