!> Relaxation of the shear traction along the fronts between stick and slip.
!>
!> A sweep with wrong zones leaves residuals in a few rings of nodes along the front. A few passes of nonlinear Gauss-Seidel over
!> these, each of which changes the displacements of its neighborhood alone, bring traction and front into place, without a
!> product over the window. Each rank relaxes the nodes of its rows, then adds what those of the others displace there.
!>
!> Equations: docs/theory/friction.md, (F12).
module hc_front_relaxation
  use, intrinsic :: iso_fortran_env, only: int8
  use hc_precision, only: wp, sp
  use hc_lattice, only: neighbors
  use hc_options, only: newton_options_t
  use hc_contact_problem, only: friction_problem_t, near_reach
  use hc_friction_iterate, only: friction_iterate_t
  use hc_active_set, only: find_span
  use hc_active_zones, only: shear_parameter
  implicit none
  private

  !> Marks of nodes: off the contact or at the rim of the window, sticking, slipping, among those relaxed
  integer(int8), parameter :: is_off = 0_int8, sticks = 1_int8, slips = 2_int8, is_near = 3_int8

  public :: relax_fronts

  !> Nodes near the fronts between stick and slip.
  type :: fronts_t
    !> Columns and rows (2, nodes)
    integer, allocatable :: node(:, :)
    !> Displacement beyond the slip, u - ds (2, nodes) [m]; largest traction (nodes) [Pa]
    real(wp), allocatable :: rest(:, :), bound(:)
    !> Changes of a traction below which it stays [Pa]
    real(wp) :: least = 0.0_wp
  end type fronts_t

contains

  !> Relax the shear traction near the fronts, and estimate the displacements that it causes.
  subroutine relax_fronts(now)
    !> Iterate: traction and tangential displacement change, the latter but for an error
    type(friction_iterate_t), intent(inout), target :: now
    real(wp), pointer, contiguous :: q(:, :, :), u(:, :, :)
    type(fronts_t) :: fronts
    type(newton_options_t) :: options
    integer :: pass
    logical :: changed

    options = now%problem%options%newton
    if (now%residual_tangential < options%front_residual) return
    ! steadily rolling nodes move those behind them, too
    if (now%target%rolling%steady) return
    ! nodes of slender cells are coupled beyond the reach of a relaxation node by node
    if (.not. all(now%problem%lattice%near_neighbors())) return
    ! a pressure that moves with the shear traction moves the fronts again
    if (now%pressure_feels_shear .or. (now%without_start .and. now%first)) return
    if (.not. (now%problem%friction%is_bounded() .and. now%problem%friction%is_isotropic())) return
    if (now%operators%space%count(now%contact) < options%front_nodes) return
    call find_fronts(now, options%front_rings, fronts%node)
    if (now%operators%space%number(size(fronts%node, 2)) == 0) return
    call describe(now, fronts)
    associate (extent => now%problem%own_extent())
      q(1:extent(1), 1:extent(2), 1:2) => now%q
      u(1:extent(1), 1:extent(2), 1:2) => now%u
    end associate
    fronts%least = options%front_share*now%residual_tangential*now%traction_scale()
    do pass = 1, options%front_passes
      if (now%operators%space%ranks%size == 1) then
        call relax(now%problem, fronts, mod(pass, 2) == 0, q, u, changed)
      else
        call relax_rows(now%problem, fronts, mod(pass, 2) == 0, q, u, changed)
      end if
      if (.not. changed) exit
    end do
  end subroutine relax_fronts

  !> Find the nodes in contact within some rings of a front between stick and slip, ring by ring.
  subroutine find_fronts(now, rings, node)
    type(friction_iterate_t), intent(in) :: now
    !> Rings on each side of a front
    integer, intent(in) :: rings
    !> Columns and rows (2, nodes)
    integer, allocatable, intent(out) :: node(:, :)
    integer(int8), allocatable :: mark(:, :)
    integer, allocatable :: found(:, :)
    integer :: row, col, ring, k, i, first, last, at, before

    associate (extent => now%problem%own_extent())
      allocate (mark(extent(1), extent(2)))
    end associate
    call mark_nodes(now, mark)
    before = 0
    if (now%operators%space%ranks%size > 1) call add_rows(now%problem, rings + 1, mark, before)
    allocate (found(2, count(mark /= is_off)))
    at = 0
    do row = 2, size(mark, 2) - 1
      do col = 2, size(mark, 1) - 1
        if (mark(col, row) == is_off) cycle
        do k = 1, size(neighbors, 2)
          ! one of them sticks, the other one slips
          if (mark(col, row) + mark(col + neighbors(1, k), row + neighbors(2, k)) == sticks + slips .and. &
              mark(col + neighbors(1, k), row + neighbors(2, k)) /= is_off) then
            at = at + 1
            found(:, at) = [col, row]
            exit
          end if
        end do
      end do
    end do
    do i = 1, at
      mark(found(1, i), found(2, i)) = is_near
    end do
    first = 1
    do ring = 2, rings
      last = at
      do i = first, last
        do k = 1, size(neighbors, 2)
          associate (x => found(1, i) + neighbors(1, k), y => found(2, i) + neighbors(2, k))
            if (mark(x, y) == is_off .or. mark(x, y) == is_near) cycle
            mark(x, y) = is_near
            at = at + 1
            found(:, at) = [x, y]
          end associate
        end do
      end do
      first = last + 1
    end do
    node = found(:, :at)
    if (now%operators%space%ranks%size == 1) return
    node(2, :) = node(2, :) - before
    associate (own => node(2, :) > 0 .and. node(2, :) <= now%problem%own_rows())
      node = reshape(pack(node, spread(own, 1, 2)), [2, count(own)])
    end associate
  end subroutine find_fronts

  !> Add the marks of some rows of other ranks on each side.
  subroutine add_rows(problem, n, mark, before)
    type(friction_problem_t), intent(in) :: problem
    !> Number of rows
    integer, intent(in) :: n
    !> Marks of own rows, then of these rows, too (n_col, rows)
    integer(int8), allocatable, intent(inout) :: mark(:, :)
    !> Rows that were added before own rows
    integer, intent(out) :: before
    real(sp), allocatable :: around(:, :)
    integer :: own(2)

    own = problem%space%own_rows(problem%lattice%extent(2))
    before = min(n, own(1) - 1)
    allocate (around(size(mark, 1), before + size(mark, 2) + min(n, problem%lattice%extent(2) - own(2))))
    call problem%space%fetch(problem%lattice%extent(2), real(mark, sp), own(1) - before, around)
    mark = nint(around, int8)
    ! rings end there: the nodes of own rows are further off
    mark(:, [1, size(mark, 2)]) = is_off
  end subroutine add_rows

  !> Find out which nodes in contact stick, and which slip, as their classification will.
  subroutine mark_nodes(now, mark)
    type(friction_iterate_t), intent(in) :: now
    !> Marks (n_col, n_row)
    integer(int8), intent(out) :: mark(:, :)
    real(wp) :: ds(size(mark, 1), 2), bound(size(mark, 1)), r
    integer :: row, col, n, i, low, high

    n = size(now%p)
    r = shear_parameter(now)
    !$omp parallel do schedule(static) num_threads(now%operators%space%threads) private(ds, bound, col, i, low, high)
    do row = 1, size(mark, 2)
      mark(:, row) = is_off
      i = (row - 1)*size(bound)
      if (any(row + now%problem%rows_before() == [1, now%problem%lattice%extent(2)])) cycle
      call find_span(now%contact(i + 1:i + size(bound)), low, high)
      if (high < low) cycle
      call now%problem%friction%find_bounds(i + low, now%p(i + low:i + high), bound(low:high))
      call now%slip_row(row, low, ds(low:high, 1), ds(low:high, 2))
      do col = max(low, 2), min(high, size(bound) - 1)
        if (.not. (now%contact(i + col) .and. bound(col) > 0.0_wp)) cycle
        mark(col, row) = merge(slips, sticks, (now%q(i + col) - r*ds(col, 1))**2 + (now%q(n + i + col) - r*ds(col, 2))**2 &
                               > bound(col)**2)
      end do
    end do
    !$omp end parallel do
  end subroutine mark_nodes

  !> Compute the offset between displacement and slip of a node, and its largest traction.
  subroutine describe(now, fronts)
    type(friction_iterate_t), intent(in) :: now
    !> Nodes near the fronts
    type(fronts_t), intent(inout) :: fronts
    real(wp) :: rigid(now%problem%lattice%extent(1), 2)
    integer :: k, i, n, row

    n = size(now%p)
    row = 0
    associate (node => fronts%node)
      allocate (fronts%rest(2, size(node, 2)), fronts%bound(size(node, 2)))
      do k = 1, size(node, 2)
        if (node(2, k) /= row) then
          row = node(2, k)
          call now%problem%rigid_displacement_row(now%motion, row, rigid(:, 1), rigid(:, 2))
        end if
        i = (row - 1)*size(rigid, 1) + node(1, k)
        fronts%rest(1, k) = now%origin(i) + rigid(node(1, k), 1)
        fronts%rest(2, k) = now%origin(n + i) + rigid(node(1, k), 2)
        call now%problem%friction%find_bounds(i, now%p(i:i), fronts%bound(k:k))
      end do
    end associate
  end subroutine describe

  !> Make one pass on own rows, and add what the nodes of other ranks displace there.
  subroutine relax_rows(problem, fronts, backwards, q, u, changed)
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> Nodes near the fronts
    type(fronts_t), intent(in) :: fronts
    !> From the last node to the first
    logical, intent(in) :: backwards
    !> Shear traction [Pa] and tangential displacement [m] (n_col, own rows, 2)
    real(wp), intent(inout), contiguous :: q(:, :, :), u(:, :, :)
    !> A traction has changed on any rank
    logical, intent(out) :: changed
    real(wp), allocatable :: change(:, :), around(:, :, :)
    integer :: own(2), wanted(2), n_row, row, col, m, there

    n_row = problem%lattice%extent(2)
    own = problem%space%own_rows(n_row)
    wanted = [max(own(1) - near_reach, 1), min(own(2) + near_reach, n_row)]
    allocate (around(size(q, 1), wanted(1):wanted(2), 2))
    around(:, own(1):own(2), :) = q
    call relax(problem, fronts, backwards, q, u, changed)
    changed = problem%space%number(merge(1, 0, changed)) > 0
    if (.not. changed) return
    do m = 1, 2
      change = q(:, :, m) - around(:, own(1):own(2), m)
      call problem%space%fetch(n_row, change, wanted(1), around(:, :, m))
    end do
    do row = wanted(1), wanted(2)
      if (row >= own(1) .and. row <= own(2)) cycle
      do col = 1, size(q, 1)
        if (max(abs(around(col, row, 1)), abs(around(col, row, 2))) <= 0.0_wp) cycle
        do there = max(row - near_reach, own(1)), min(row + near_reach, own(2))
          call add_near(problem, col, there - row, around(col, row, :), u(:, there - own(1) + 1, 1), u(:, there - own(1) + 1, 2))
        end do
      end do
    end do
  end subroutine relax_rows

  !> Add what a change of the traction of a node displaces near it in a row.
  pure subroutine add_near(problem, node, rows, change, ux, uy)
    type(friction_problem_t), intent(in) :: problem
    !> Column of the node, and rows from it to the row
    integer, intent(in) :: node, rows
    !> Change of its traction [Pa]
    real(wp), intent(in) :: change(2)
    !> Tangential displacement of the row along x and y (n_col) [m]
    real(wp), intent(inout), contiguous :: ux(:), uy(:)
    integer :: col

    associate (near => problem%near_compliance)
      !$omp simd
      do col = max(node - near_reach, 1), min(node + near_reach, size(ux))
        ux(col) = ux(col) + near(col - node, rows, 1)*change(1) + near(col - node, rows, 2)*change(2)
        uy(col) = uy(col) + near(col - node, rows, 2)*change(1) + near(col - node, rows, 3)*change(2)
      end do
    end associate
  end subroutine add_near

  !> Make one pass of nonlinear Gauss-Seidel, (F12).
  pure subroutine relax(problem, fronts, backwards, q, u, changed)
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> Nodes near the fronts
    type(fronts_t), intent(in) :: fronts
    !> From the last node to the first
    logical, intent(in) :: backwards
    !> Shear traction [Pa] and tangential displacement [m] (n_col, n_row, 2)
    real(wp), intent(inout), contiguous :: q(:, :, :), u(:, :, :)
    !> A traction has changed
    logical, intent(out) :: changed
    real(wp) :: trial(2), change(2), length
    integer :: m, k, i, j, row

    changed = .false.
    associate (node => fronts%node, bound => fronts%bound, rest => fronts%rest, &
               compliance => problem%tangential_compliance)
      do m = 1, size(node, 2)
        k = merge(size(node, 2) + 1 - m, m, backwards)
        i = node(1, k)
        j = node(2, k)
        trial(1) = q(i, j, 1) - (u(i, j, 1) - rest(1, k))/compliance
        trial(2) = q(i, j, 2) - (u(i, j, 2) - rest(2, k))/compliance
        length = sqrt(trial(1)**2 + trial(2)**2)
        if (length > bound(k)) trial = trial*(bound(k)/length)
        change(1) = trial(1) - q(i, j, 1)
        change(2) = trial(2) - q(i, j, 2)
        if (max(abs(change(1)), abs(change(2))) <= fronts%least) cycle
        changed = .true.
        q(i, j, 1) = trial(1)
        q(i, j, 2) = trial(2)
        do row = max(j - near_reach, 1), min(j + near_reach, size(u, 2))
          call add_near(problem, i, row - j, change, u(:, row, 1), u(:, row, 2))
        end do
      end do
    end associate
  end subroutine relax

end module hc_front_relaxation
