!> Relative displacement of nodes at the moment when their gap closed.
!>
!> Backward Euler lets the slip of a node that enters the contact during a step count from s^n,
!> its relative displacement at the beginning of the step, as if it had not moved freely until
!> its gap closed. Here it counts from an estimate of that moment's,
!>
!>     s_e = s^n + m_1/M_1 (D - C) + m_2/M_2 C,
!>
!> with D = s^{n+1} - s^n of the nodes that are still outside, carried inwards. Near the old edge
!> s_e - s^n is a sum of a part that is linear in the distance d from it, as the edge slips, and one with
!> d^(3/2), C, as it sticks. The gap at the beginning of the step measures both without any geometry: m_1 is its power
!> 2/3, m_2 the gap itself; M_1, M_2 are their decrease during the step outside. C follows from the change of D
!> outwards. D belongs to the solution, so that both are iterated (see docs/theory/load_path.md, (L1), (L2)).
module hc_contact_entry
  use hc_precision, only: wp
  use hc_lattice, only: opposite_pairs
  use hc_error, only: error_t
  use hc_options, only: entry_options_t
  use hc_contact_state, only: contact_state_t, load_target_t, normal, force_control
  use hc_contact_problem, only: friction_problem_t
  use hc_contact_solver, only: friction_solver_t
  use hc_few_nodes, only: solve_step
  implicit none
  private

  public :: solve_with_entry, entry_displacement

  !> Values that are carried inwards from the nodes outside.
  type :: carried_t
    !> Motion D of the step, and the part of it that grows with d^(3/2)
    real(wp) :: moved(2) = 0.0_wp
    real(wp) :: curved(2) = 0.0_wp
    !> Closing of both measures of the gap during the step
    real(wp) :: closed(2) = 0.0_wp
    !> g_0
    real(wp) :: lattice_gap = 0.0_wp
  end type carried_t

contains

  !> Solve a load step in which slip counts from the entry state.
  !>
  !> The residuals of the result, and whether it converged, are those with the entry state that follows from the result itself.
  subroutine solve_with_entry(solver, start, target, tolerance, max_sweeps, state, error)
    !> Method
    class(friction_solver_t), intent(inout) :: solver
    !> State at the beginning of the step
    type(contact_state_t), intent(in) :: start
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target
    !> Bound of all residuals
    real(wp), intent(in) :: tolerance
    !> Active sets that may be tried for a given entry state
    integer, intent(in) :: max_sweeps
    !> State at the end of the step, converged or not
    type(contact_state_t), intent(out) :: state
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    type(entry_options_t) :: options
    type(contact_state_t) :: from
    real(wp), allocatable :: entry(:, :, :), correction(:, :, :), before(:, :, :), previous(:, :, :)
    real(wp), allocatable :: changes(:, :), corrections(:, :)
    real(wp) :: accuracy, work
    integer :: i, n, stored, sweeps
    logical :: again

    options = solver%problem%options%entry
    n = size(start%relative_displacement)
    allocate (changes(n, options%depth), corrections(n, options%depth))
    allocate (entry, mold=start%relative_displacement)
    allocate (before, previous, mold=entry)
    entry = 0.0_wp
    accuracy = options%last_tolerance*tolerance
    if (grows(start, target)) accuracy = max(accuracy, options%first_tolerance)
    from = start
    work = 0.0_wp
    sweeps = 0
    stored = -1
    again = .false.
    do i = 1, options%max_corrections
      call solve_step(solver, from, start%relative_displacement + entry, target, accuracy, max_sweeps, state, error)
      if (allocated(error)) return
      work = work + state%operator_applications
      sweeps = sweeps + state%sweeps
      if (.not. state%converged) then
        ! an inaccurate solution may have spoilt the extrapolation: begin once more
        if (again) exit
        again = .true.
        accuracy = options%last_tolerance*tolerance
        from = start
        cycle
      end if
      correction = entry_displacement(solver%problem, start, state) - entry
      call find_residuals(solver%problem, start%relative_displacement + entry + correction, target, tolerance, state)
      if (state%converged) exit
      if (i == options%max_corrections) exit
      accuracy = max(min(accuracy, options%relative_tolerance*state%residual_tangential), options%last_tolerance*tolerance)
      stored = min(stored + 1, options%depth)
      if (stored > 0) then
        changes(:, 2:stored) = changes(:, 1:stored - 1)
        corrections(:, 2:stored) = corrections(:, 1:stored - 1)
        changes(:, 1) = reshape(entry - before, [n])
        corrections(:, 1) = reshape(correction - previous, [n])
      end if
      before = entry
      previous = correction
      entry = entry + correction - reshape(extrapolated(changes(:, :stored), corrections(:, :stored), reshape(correction, [n]), &
                                                        options%dependent_corrections), shape(entry))
      ! nodes that have left again have no slip at entry
      where (spread(state%pressure <= 0.0_wp, 3, 2)) entry = 0.0_wp
      from = state
    end do
    state%operator_applications = work
    state%sweeps = sweeps
  end subroutine solve_with_entry

  !> Return whether nodes will enter the contact.
  pure logical function grows(start, target)
    type(contact_state_t), intent(in) :: start
    type(load_target_t), intent(in) :: target

    if (target%control(normal) == force_control) then
      grows = target%value(normal) > start%load(normal)
    else
      grows = target%value(normal) > start%motion(normal)
    end if
  end function grows

  !> Compute slip, zones and residuals of a solution with another reference displacement, without a product.
  subroutine find_residuals(problem, reference, target, tolerance, state)
    type(friction_problem_t), intent(in) :: problem
    !> Displacement that slip counts from (n_col, n_row, 2) [m]
    real(wp), intent(in), contiguous :: reference(:, :, :)
    type(load_target_t), intent(in) :: target
    real(wp), intent(in) :: tolerance
    type(contact_state_t), intent(inout) :: state

    state%gap = state%gap - problem%initial_gap + state%motion(normal)
    state%relative_displacement = state%relative_displacement + problem%rigid_displacement(state%motion)
    call problem%complete_state(target, tolerance, reference, state)
  end subroutine find_residuals

  !> Compute Anderson's extrapolation from a corrected entry state: (changes + corrections) y, where
  !> y makes |corrections y - correction| least. Combinations that depend on newer ones are left out.
  pure function extrapolated(changes, corrections, correction, dependent) result(less)
    !> Changes of the entry state and of its correction, the newest first
    real(wp), intent(in) :: changes(:, :), corrections(:, :)
    !> The last correction
    real(wp), intent(in) :: correction(:)
    !> Share of its length below which a combination counts as dependent
    real(wp), intent(in) :: dependent
    real(wp) :: less(size(correction))
    real(wp) :: direction(size(correction), size(changes, 2)), move(size(correction), size(changes, 2)), length, part
    integer :: k, m, j

    less = 0.0_wp
    m = 0
    do k = 1, size(changes, 2)
      m = m + 1
      direction(:, m) = corrections(:, k)
      move(:, m) = changes(:, k) + corrections(:, k)
      length = norm2(direction(:, m))
      do j = 1, m - 1
        part = dot_product(direction(:, j), direction(:, m))
        direction(:, m) = direction(:, m) - part*direction(:, j)
        move(:, m) = move(:, m) - part*move(:, j)
      end do
      if (norm2(direction(:, m)) <= max(dependent*length, tiny(1.0_wp))) then
        m = m - 1
        cycle
      end if
      move(:, m) = move(:, m)/norm2(direction(:, m))
      direction(:, m) = direction(:, m)/norm2(direction(:, m))
      less = less + dot_product(direction(:, m), correction)*move(:, m)
    end do
  end function extrapolated

  !> Compute s_e - s^n of the nodes that entered the contact during a step, zero elsewhere (n_col, n_row, 2) [m].
  function entry_displacement(problem, before, after) result(displacement)
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> States at the beginning and at the end of the step
    type(contact_state_t), intent(in) :: before, after
    real(wp), allocatable :: displacement(:, :, :)

    type(carried_t), allocatable :: carried(:, :)
    real(wp), allocatable :: gap(:, :), edge_pressure(:, :)
    !> Nodes that entered, that are outside all the time, that have a value to carry on, that are tied to the old contact
    logical, allocatable :: entered(:, :), outside(:, :), known(:, :), attached(:, :)
    integer, allocatable :: node(:, :)
    real(wp) :: share(2)
    integer :: i, k, col, row, c, r, there(2)

    allocate (displacement, mold=after%relative_displacement)
    displacement = 0.0_wp
    entered = after%pressure > 0.0_wp .and. before%pressure <= 0.0_wp
    if (.not. any(entered)) return
    outside = problem%candidate .and. after%pressure <= 0.0_wp .and. before%pressure <= 0.0_wp
    if (any(before%pressure > 0.0_wp)) then
      gap = max(before%gap, 0.0_wp)
    else
      gap = max(problem%initial_gap - before%motion(normal), 0.0_wp)
    end if
    edge_pressure = problem%lattice%ring_max(problem%lattice%ring_max(after%pressure))
    node = by_falling_gap(entered, gap)
    allocate (carried(size(gap, 1), size(gap, 2)), known(size(gap, 1), size(gap, 2)), attached(size(gap, 1), size(gap, 2)))
    known = .false.
    attached = .false.
    do i = size(node, 2), 1, -1
      do k = 1, size(opposite_pairs)
        there = problem%lattice%neighbor(node(:, i), opposite_pairs(k))
        if (there(1) == 0) cycle
        c = there(1)
        r = there(2)
        if (before%pressure(c, r) > 0.0_wp .or. attached(c, r)) attached(node(1, i), node(2, i)) = .true.
        if (outside(c, r)) then
          known(c, r) = .true.
          carried(c, r) = seen_from(c, r, problem%normal_compliance*problem%options%entry%edge_gap*edge_pressure(c, r))
        end if
      end do
    end do
    call find_curved_parts()

    do i = 1, size(node, 2)
      col = node(1, i)
      row = node(2, i)
      call carry_inwards(col, row)
      if (.not. known(col, row)) cycle
      share = merge(1.0_wp, 0.0_wp, gap(col, row) > 0.0_wp)
      associate (here => carried(col, row))
        where (measures(gap(col, row), here%lattice_gap) < here%closed)
          share = measures(gap(col, row), here%lattice_gap)/here%closed
        end where
        if (attached(col, row)) then
          displacement(col, row, :) = share(1)*(here%moved - here%curved) + share(2)*here%curved
        else
          displacement(col, row, :) = share(2)*here%moved
        end if
      end associate
    end do

  contains

    !> Carry the mean of the neighbors with a larger gap to a node.
    subroutine carry_inwards(col, row)
      integer, intent(in) :: col, row
      type(carried_t) :: sum_of
      real(wp) :: weight, total
      integer :: k, c, r, there(2)

      total = 0.0_wp
      do k = 1, size(opposite_pairs)
        there = problem%lattice%neighbor([col, row], opposite_pairs(k))
        if (there(1) == 0) cycle
        c = there(1)
        r = there(2)
        weight = gap(c, r) - gap(col, row)
        if (weight <= 0.0_wp .or. .not. known(c, r)) cycle
        total = total + weight
        sum_of%moved = sum_of%moved + weight*carried(c, r)%moved
        sum_of%closed = sum_of%closed + weight*carried(c, r)%closed
        sum_of%lattice_gap = sum_of%lattice_gap + weight*carried(c, r)%lattice_gap
        sum_of%curved = sum_of%curved + weight*carried(c, r)%curved
      end do
      if (total <= 0.0_wp) return
      known(col, row) = .true.
      carried(col, row) = carried_t(sum_of%moved/total, sum_of%curved/total, sum_of%closed/total, sum_of%lattice_gap/total)
    end subroutine carry_inwards

    !> Return the motion of a node outside, and how far its gap closed.
    type(carried_t) function seen_from(col, row, lattice_gap)
      integer, intent(in) :: col, row
      real(wp), intent(in) :: lattice_gap

      seen_from%moved = after%relative_displacement(col, row, :) - before%relative_displacement(col, row, :)
      seen_from%closed = measures(gap(col, row), lattice_gap) - measures(max(after%gap(col, row), 0.0_wp), lattice_gap)
      seen_from%lattice_gap = lattice_gap
    end function seen_from

    !> Find the part C of D that grows with d^(3/2), from how D grows between the first two nodes outside.
    !>
    !> Least squares over a few nodes along the edge: D_2 = m_2/m_1 (D_1 - C) + m'_2/m'_1 C.
    subroutine find_curved_parts()
      type(carried_t) :: next, further
      real(wp) :: growth(2), total, weight
      real(wp), allocatable :: squares(:, :), products(:, :, :)
      integer :: col, row, k, c, r, there(2)

      allocate (squares, mold=gap)
      allocate (products, mold=after%traction)
      squares = 0.0_wp
      products = 0.0_wp
      do row = 1, size(gap, 2)
        do col = 1, size(gap, 1)
          if (.not. known(col, row)) cycle
          further = carried_t()
          total = 0.0_wp
          associate (here => carried(col, row))
            if (any(here%closed <= 0.0_wp)) cycle
            do k = 1, size(opposite_pairs)
              there = problem%lattice%neighbor([col, row], opposite_pairs(k))
              if (there(1) == 0) cycle
              c = there(1)
              r = there(2)
              weight = gap(c, r) - gap(col, row)
              if (weight <= 0.0_wp .or. .not. outside(c, r)) cycle
              next = seen_from(c, r, here%lattice_gap)
              total = total + weight
              further%moved = further%moved + weight*next%moved
              further%closed = further%closed + weight*next%closed
            end do
            if (total <= 0.0_wp) cycle
            growth = further%closed/(total*here%closed)
            squares(col, row) = (growth(2) - growth(1))**2
            products(col, row, :) = (growth(2) - growth(1))*(further%moved/total - growth(1)*here%moved)
          end associate
        end do
      end do
      do k = 1, problem%options%entry%along_edge
        squares = problem%lattice%ring_sum(squares)
        products(:, :, 1) = problem%lattice%ring_sum(products(:, :, 1))
        products(:, :, 2) = problem%lattice%ring_sum(products(:, :, 2))
      end do
      do row = 1, size(gap, 2)
        do col = 1, size(gap, 1)
          if (.not. known(col, row)) cycle
          associate (here => carried(col, row))
            here%curved = here%moved
            if (squares(col, row) <= 0.0_wp) cycle
            here%curved = products(col, row, :)/squares(col, row) + problem%options%entry%missed_share*here%moved
            ! no more than all there is
            here%curved = here%curved*min(1.0_wp, norm2(here%moved)/max(norm2(here%curved), tiny(1.0_wp)))
          end associate
        end do
      end do
    end subroutine find_curved_parts

  end function entry_displacement

  !> Return measures of the distance by the gap, from an edge that slips and from one that sticks.
  pure function measures(gap, lattice_gap)
    real(wp), intent(in) :: gap, lattice_gap
    real(wp) :: measures(2)

    measures(1) = (gap + lattice_gap)**(2.0_wp/3.0_wp) - lattice_gap**(2.0_wp/3.0_wp)
    measures(2) = gap
  end function measures

  !> Sort the nodes of a set by their gap, the largest first: columns and rows. Equal ones stay in the order of the lattice.
  pure function by_falling_gap(set, gap) result(node)
    logical, intent(in) :: set(:, :)
    real(wp), intent(in) :: gap(:, :)
    integer, allocatable :: node(:, :)
    integer :: col, row, n

    allocate (node(2, count(set)))
    n = 0
    do row = 1, size(set, 2)
      do col = 1, size(set, 1)
        if (.not. set(col, row)) cycle
        n = n + 1
        node(:, n) = [col, row]
      end do
    end do
    call sort(node)

  contains

    !> Sort both halves of a list, and merge them.
    pure recursive subroutine sort(node)
      integer, intent(inout) :: node(:, :)
      integer :: first(2, size(node, 2)/2), i, j, k

      if (size(node, 2) < 2) return
      associate (middle => size(first, 2))
        call sort(node(:, :middle))
        call sort(node(:, middle + 1:))
        first = node(:, :middle)
        i = 1
        j = middle + 1
        do k = 1, size(node, 2)
          if (i > middle) exit
          if (j <= size(node, 2)) then
            if (gap(node(1, j), node(2, j)) > gap(first(1, i), first(2, i))) then
              node(:, k) = node(:, j)
              j = j + 1
              cycle
            end if
          end if
          node(:, k) = first(:, i)
          i = i + 1
        end do
      end associate
    end subroutine sort

  end function by_falling_gap

end module hc_contact_entry
