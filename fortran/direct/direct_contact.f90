!> Contact by the dissertation's active-set iteration on LAPACK solves (section 8.6).
!>
!> The pressure on the current contact area makes the gap vanish there; nodes
!> in tension leave, and nodes that penetrate enter again. Should the number of wrong
!> nodes not fall any more, one node at a time is exchanged (Murty's rule, with
!> which the iteration ends for every positive definite matrix).
!>
!> Equations: docs/theory/normal_contact.md, (N1), (N6).
module hc_direct_contact
  use hc_precision, only: wp, lk
  use hc_error, only: error_t, status, raise
  use hc_options, only: options_t
  use hc_lapack, only: dposv
  use hc_lattice, only: lattice_t
  use hc_transfer, only: prolong_edge
  use hc_elastic_medium, only: elastic_medium_t
  use hc_flexibility_dense, only: dense_flexibility_t, new_dense_flexibility
  use hc_contact_state, only: contact_state_t, load_target_t, new_contact_state, check_target, normal, force_control, &
    sweeps_used_up, no_progress
  use hc_contact_solver, only: contact_solver_t
  use hc_normal_law, only: normal_law_t
  use hc_normal_problem, only: normal_problem_t, new_normal_problem, nearest_nodes
  implicit none
  private

  public :: direct_contact_t, new_direct_contact, exchange

  !> A frictionless contact problem with its flexibility.
  type, extends(contact_solver_t) :: direct_contact_t
    private
    type(dense_flexibility_t) :: flexibility
    !> The contact problem
    type(normal_problem_t) :: problem
    !> Matrix of the contact area and its factor: as large as the largest area so far
    real(wp), allocatable :: matrix(:, :)
    !> The same on the lattice of every second node, where a first contact is found first
    type(direct_contact_t), allocatable :: coarser
  contains
    procedure :: solve_step
    procedure :: normal_part
    !> Solve for a normal load or an approach
    procedure :: solve
  end type direct_contact_t

  !> A contact area with its pressure; over the nodes of the window.
  type :: pressed_area_t
    !> Nodes that may come into contact, active nodes
    logical(lk), allocatable :: candidate(:), active(:)
    !> Initial gap, gap [m] and pressure, zero off the active nodes [Pa]
    real(wp), allocatable :: h(:), gap(:), p(:)
    !> Compliance [m/Pa] and offset [m] of the springs of a compliant law
    real(wp), allocatable :: compliance(:), offset(:)
    !> Approach [m]
    real(wp) :: approach = 0.0_wp
  end type pressed_area_t

contains

  !> Set up a problem with its flexibility.
  subroutine new_direct_contact(self, lattice, medium, initial_gap, candidate, error, options, law)
    !> Problem to be set up
    type(direct_contact_t), intent(out) :: self
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> Initial gap (n_col, n_row) [m]
    real(wp), intent(in) :: initial_gap(:, :)
    !> Nodes that may come into contact (n_col, n_row)
    logical, intent(in) :: candidate(:, :)
    !> Allocated on failure: wrong shapes, no candidate at all, numbers of no use, not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Tolerances, caps and tuning numbers
    type(options_t), intent(in), optional :: options
    !> Law of contact; absent: unilateral contact
    class(normal_law_t), intent(in), optional :: law

    if (present(options)) self%problem%options = options
    call new_normal_problem(self%problem, lattice, medium, initial_gap, candidate, error, law)
    if (allocated(error)) return
    call new_dense_flexibility(self%flexibility, lattice, medium, error)
  end subroutine new_direct_contact

  !> Solve a load step, of which the normal load or the approach matters, from the contact area of the start.
  subroutine solve_step(self, start, reference, target, tolerance, max_sweeps, state, error)
    class(direct_contact_t), intent(inout), target :: self
    type(contact_state_t), intent(in) :: start
    real(wp), intent(in), contiguous, target :: reference(:, :, :)
    type(load_target_t), intent(in) :: target
    real(wp), intent(in) :: tolerance
    integer, intent(in) :: max_sweeps
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error
    logical, allocatable :: nodes(:, :)

    if (allocated(start%pressure)) nodes = start%pressure > 0.0_wp
    if (allocated(nodes)) then
      if (.not. any(nodes)) deallocate (nodes)
    end if
    ! not allocated: absent
    call self%solve(target%control(normal), target%value(normal), tolerance, max_sweeps, state, error, nodes)
  end subroutine solve_step

  !> Point to the problem.
  function normal_part(self) result(problem)
    class(direct_contact_t), intent(in), target :: self
    class(normal_problem_t), pointer :: problem

    problem => self%problem
  end function normal_part

  !> Solve for a normal load or an approach.
  recursive subroutine solve(self, control, target, tolerance, max_sweeps, state, error, start)
    class(direct_contact_t), intent(inout) :: self
    !> force_control or displacement_control
    integer, intent(in) :: control
    !> Normal load [N] or approach [m]
    real(wp), intent(in) :: target
    !> Bound of both residuals
    real(wp), intent(in) :: tolerance
    !> Active sets that may be tried
    integer, intent(in) :: max_sweeps
    !> Solution; `converged`: the residuals are within the tolerance
    type(contact_state_t), intent(out) :: state
    !> Allocated on failure: a target that cannot be solved for, not enough memory, a matrix that is not positive definite
    type(error_t), allocatable, intent(out) :: error
    !> Contact area to start from (n_col, n_row); absent: that of the coarser lattice, or where the undeformed bodies would overlap
    logical, intent(in), optional :: start(:, :)

    type(load_target_t) :: goal
    type(pressed_area_t) :: area
    integer :: n

    call check_target([control], [target], tolerance, max_sweeps, error)
    if (allocated(error)) return
    if (present(start)) then
      if (any(shape(start) /= self%problem%lattice%extent)) then
        call raise(error, status%invalid_input, 'the contact area to start from does not have the shape of the lattice window')
        return
      end if
    end if
    goal = load_target_t([control], [target])
    call new_contact_state(state, self%problem%lattice, self%problem%space)
    self%flexibility%applications = 0.0_wp
    n = self%problem%lattice%size()
    area%h = reshape(self%problem%initial_gap, [n])
    area%candidate = reshape(self%problem%candidate, [n])
    allocate (area%p(n), area%gap(n), area%compliance(n), area%offset(n), source=0.0_wp)
    if (.not. self%problem%is_pressed(goal)) then
      allocate (area%active(n), source=.false._lk)
      area%approach = target
      if (control == force_control) area%approach = minval(area%h, mask=area%candidate)
    else if (present(start)) then
      area%active = area%candidate .and. reshape(start, [n])
      if (.not. any(area%active)) area%active = area%candidate
    else
      area%active = self%problem%first_guess(goal)
      call find_coarse_area(self, goal, max_sweeps, area%active)
    end if
    call exchange_nodes(self, goal, tolerance, max_sweeps, area, state%sweeps, error)
    if (allocated(error)) return

    area%p = max(area%p, 0.0_wp)
    call find_gap(self, area, error)
    if (allocated(error)) return
    state%pressure = reshape(area%p, shape(state%pressure))
    state%gap = reshape(area%gap, shape(state%gap))
    state%motion(normal) = area%approach
    state%stopped = merge(sweeps_used_up, no_progress, state%sweeps >= max_sweeps)
    call self%problem%complete_pressed(goal, tolerance, state, error)
    state%operator_applications = self%flexibility%applications
  end subroutine solve

  !> Exchange nodes between contact and gap until the pressure on the area fits.
  subroutine exchange_nodes(self, target, tolerance, max_sweeps, area, sweeps, error)
    class(direct_contact_t), intent(inout) :: self
    !> Normal load or approach to be reached
    type(load_target_t), intent(in) :: target
    !> Bound of both residuals
    real(wp), intent(in) :: tolerance
    !> Active sets that may be tried
    integer, intent(in) :: max_sweeps
    !> The first area; on return the last one with its pressure
    type(pressed_area_t), intent(inout) :: area
    !> Active sets that were tried
    integer, intent(out) :: sweeps
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    logical :: wrong(size(area%p))
    real(wp) :: worst
    integer :: n_active, fewest, left

    fewest = huge(1)
    sweeps = 0
    associate (options => self%problem%options%direct, law => self%problem%normal_law)
      left = options%stalled_exchanges
      do while (any(area%active) .and. sweeps < max_sweeps)
        sweeps = sweeps + 1
        call solve_active(self, target, area, error)
        if (allocated(error)) return
        call find_gap(self, area, error)
        if (allocated(error)) return
        if (law%is_compliant()) then
          worst = 0.0_wp
          call law%violation(1, self%problem%normal_compliance, area%p, area%gap, logical(area%candidate), worst)
          if (worst <= options%final_accuracy*tolerance*maxval(area%p)) return
          n_active = count(area%active)
          call self%problem%find_contact(n_active, area%p, area%gap, area%candidate, area%active)
          call self%problem%linearize(self%problem%normal_classification_parameter(n_active), area%p, area%gap, area%active, &
                                      area%compliance, area%offset)
          cycle
        end if

        ! the gap of a node in contact is zero up to rounding, which must not count as penetration
        wrong = (area%active .and. area%p < 0.0_wp) .or. (area%candidate .and. .not. area%active .and. area%gap < 0.0_wp)
        if (.not. any(wrong)) return
        call exchange(wrong, options%stalled_exchanges, fewest, left, area%active)
        if (.not. any(area%active)) area%active = nearest_nodes(area%gap, area%candidate)
      end do
    end associate
  end subroutine exchange_nodes

  !> Find the contact area on the lattice of every second node, if that has nodes enough: each one takes fewer exchanges.
  recursive subroutine find_coarse_area(self, target, max_sweeps, active)
    class(direct_contact_t), intent(inout) :: self
    !> Normal load or approach to be reached
    type(load_target_t), intent(in) :: target
    !> Active sets that may be tried
    integer, intent(in) :: max_sweeps
    !> First guess of the contact area; then the better one, if there is one
    logical(lk), intent(inout) :: active(:)
    !> A start is of use only: without the coarse one the first guess serves
    type(error_t), allocatable :: error
    type(direct_contact_t), allocatable :: coarser
    type(contact_state_t) :: state
    real(wp) :: pressure(self%problem%lattice%extent(1), self%problem%lattice%extent(2))
    logical :: found(size(active))

    associate (problem => self%problem, options => self%problem%options)
      if (count(active) < 4*options%multilevel%least_contact) return
      if (.not. allocated(self%coarser)) then
        allocate (coarser)
        call problem%coarsen(coarser%problem)
        if (.not. any(coarser%problem%candidate)) return
        call new_dense_flexibility(coarser%flexibility, coarser%problem%lattice, problem%medium, error)
        if (allocated(error)) return
        call move_alloc(coarser, self%coarser)
      end if
      call self%coarser%solve(target%control(normal), target%value(normal), options%direct%nested_tolerance, max_sweeps, state, &
                              error)
      if (allocated(error)) return
      call prolong_edge(self%coarser%problem%lattice, state%pressure, problem%lattice, pressure, problem%space)
      found = reshape(problem%candidate .and. pressure > 0.0_wp, [size(active)])
      if (any(found)) active = found
    end associate
  end subroutine find_coarse_area

  !> Exchange the wrong nodes; one only as soon as the number of them does not fall any more.
  pure subroutine exchange(wrong, stalled_exchanges, fewest, left, active)
    !> Nodes that are active and should not be, or should be and are not; one at least
    logical, intent(in) :: wrong(:)
    !> Exchanges of whole sets that may fail to lower the number of wrong nodes
    integer, intent(in) :: stalled_exchanges
    !> Smallest number of wrong nodes so far; huge(1) at the start
    integer, intent(inout) :: fewest
    !> Those that are left; all of them at the start
    integer, intent(inout) :: left
    !> Active nodes
    logical(lk), intent(inout) :: active(:)
    integer :: last

    if (count(wrong) < fewest) then
      fewest = count(wrong)
      left = stalled_exchanges
    else
      left = left - 1
    end if
    if (left > 0) then
      active = active .neqv. wrong
    else
      last = findloc(wrong, .true., dim=1, back=.true.)
      active(last) = .not. active(last)
    end if
  end subroutine exchange

  !> Find the pressure that closes the gap on the active nodes, but for the springs: (K + C) p = approach - h - s.
  subroutine solve_active(self, target, area, error)
    class(direct_contact_t), intent(inout) :: self
    !> Normal load or approach to be reached
    type(load_target_t), intent(in) :: target
    !> Area with its springs; pressure and approach are found
    type(pressed_area_t), intent(inout) :: area
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    real(wp), allocatable :: rhs(:, :)
    integer, allocatable :: node(:)
    integer :: i, n, info, stat

    area%approach = target%value(normal)
    area%p = 0.0_wp
    node = pack([(i, i=1, size(area%active))], area%active)
    n = size(node)
    if (allocated(self%matrix)) then
      if (size(self%matrix, 1) < n) deallocate (self%matrix)
    end if
    stat = 0
    if (.not. allocated(self%matrix)) allocate (self%matrix(n, n), stat=stat)
    if (stat == 0) allocate (rhs(n, 2), stat=stat)
    if (stat /= 0) then
      call raise(error, status%resources, 'not enough memory for the matrix of the contact area: use method "fft"')
      return
    end if
    !$omp parallel do if (n > 1000)
    do i = 1, n
      self%matrix(:i, i) = self%flexibility%normal_influence(node(:i), node(i))
      self%matrix(i, i) = self%matrix(i, i) + area%compliance(node(i))
    end do
    !$omp end parallel do
    rhs(:, 1) = 1.0_wp
    rhs(:, 2) = area%h(node) + area%offset(node)
    call dposv('U', n, 2, self%matrix, size(self%matrix, 1), rhs, n, info)
    if (info /= 0) then
      call raise(error, status%no_convergence, 'the flexibility matrix of the contact area is not positive definite')
      return
    end if
    if (target%control(normal) == force_control) then
      area%approach = (target%value(normal)/self%problem%lattice%cell_area() + sum(rhs(:, 2)))/sum(rhs(:, 1))
    end if
    area%p(node) = area%approach*rhs(:, 1) - rhs(:, 2)
  end subroutine solve_active

  !> Find the gap under the pressure of an area.
  subroutine find_gap(self, area, error)
    class(direct_contact_t), intent(inout) :: self
    !> Area, whose gap is found
    type(pressed_area_t), intent(inout) :: area
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: closing(self%problem%lattice%extent(1), self%problem%lattice%extent(2), 1)

    call self%flexibility%apply([normal], reshape(area%p, shape(closing)), [normal], closing, error)
    if (allocated(error)) return
    area%gap = (area%h - area%approach) + reshape(closing, shape(area%gap))
  end subroutine find_gap

end module hc_direct_contact
