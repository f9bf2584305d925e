!> Contact by the dissertation's active-set iteration on LAPACK solves (section 8.6).
!>
!> The pressure on the current contact area makes the gap vanish there; nodes
!> in tension leave, and nodes that penetrate enter again. Should the number of wrong
!> nodes not fall any more, one node at a time is exchanged (Murty's rule, with
!> which the iteration ends for every positive definite matrix).
!>
!> Equations: docs/theory/normal_contact.md, (N1), (N6).
module hc_direct_contact
  use hc_precision, only: wp, pi
  use hc_error, only: error_t, status, raise
  use hc_options, only: options_t
  use hc_lapack, only: dposv
  use hc_lattice, only: lattice_t
  use hc_transfer, only: prolong_edge, restrict_field, restrict_mask
  use hc_field_space, only: field_space_t
  use hc_elastic_pair, only: elastic_pair_t
  use hc_flexibility, only: normal
  use hc_flexibility_dense, only: dense_flexibility_t, new_dense_flexibility
  use hc_contact_state, only: contact_state_t, load_target_t, new_contact_state, check_problem, check_target, force_control, &
    sweeps_used_up, no_progress
  use hc_contact_residuals, only: normal_self_compliance, complete_state
  use hc_contact_solver, only: contact_solver_t
  use hc_normal_law, only: normal_law_t, unilateral_t
  implicit none
  private

  public :: direct_contact_t, new_direct_contact, first_guess, exchange

  !> A frictionless contact problem with its flexibility.
  type, extends(contact_solver_t) :: direct_contact_t
    private
    type(dense_flexibility_t) :: flexibility
    !> Initial gap (n_col, n_row) [m]
    real(wp), allocatable :: initial_gap(:, :)
    !> Nodes that may come into contact (n_col, n_row)
    logical, allocatable :: candidate(:, :)
    !> Self-compliance of a node [m/Pa]
    real(wp) :: compliance = 0.0_wp
    !> Law of contact
    class(normal_law_t), allocatable :: law
    !> Matrix of the contact area and its factor: as large as the largest area so far
    real(wp), allocatable :: matrix(:, :)
    !> The same on the lattice of every second node, where a first contact is found first
    type(direct_contact_t), allocatable :: coarser
    type(options_t) :: options
  contains
    procedure :: solve_step
    !> Solve for a normal load or an approach
    procedure :: solve
  end type direct_contact_t

contains

  !> Flexibility of a problem.
  subroutine new_direct_contact(self, lattice, pair, initial_gap, candidate, error, options, law)
    !> Problem to be set up
    type(direct_contact_t), intent(out) :: self
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Elastic constants of the two bodies
    type(elastic_pair_t), intent(in) :: pair
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

    if (present(options)) self%options = options
    call check_problem(lattice, pair, initial_gap, candidate, error)
    if (allocated(error)) return
    allocate (unilateral_t :: self%law)
    if (present(law)) then
      deallocate (self%law)
      allocate (self%law, source=law)
    end if
    call self%law%check(error)
    if (allocated(error)) return
    self%initial_gap = initial_gap
    self%candidate = candidate
    self%compliance = normal_self_compliance(lattice, pair)
    call new_dense_flexibility(self%flexibility, lattice, pair, error)
  end subroutine new_direct_contact

  subroutine solve_step(self, start, reference, target, tolerance, max_sweeps, state, error)
    class(direct_contact_t), intent(inout), target :: self
    type(contact_state_t), intent(in) :: start
    real(wp), intent(in), contiguous :: reference(:, :, :)
    type(load_target_t), intent(in) :: target
    real(wp), intent(in) :: tolerance
    integer, intent(in) :: max_sweeps
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error
    logical :: again

    again = allocated(start%pressure)
    if (again) again = any(start%pressure > 0.0_wp)
    if (again) then
      call self%solve(target%control(normal), target%value(normal), tolerance, max_sweeps, state, error, &
                      start%pressure > 0.0_wp)
    else
      call self%solve(target%control(normal), target%value(normal), tolerance, max_sweeps, state, error)
    end if
  end subroutine solve_step

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
    !> Solution; `converged` tells whether the residuals are within the tolerance
    type(contact_state_t), intent(out) :: state
    !> Allocated on failure: a target that cannot be solved for, not enough memory, a matrix that is not positive definite
    type(error_t), allocatable, intent(out) :: error
    !> Contact area to start from (n_col, n_row); absent: that of the coarser lattice, or where the undeformed bodies would overlap
    logical, intent(in), optional :: start(:, :)

    real(wp), allocatable :: h(:), p(:), compliance(:), offset(:)
    logical, allocatable :: candidate(:), active(:), wrong(:)
    real(wp) :: delta, worst, gap(self%flexibility%lattice%size())
    integer :: n, fewest, left

    call check_target([control], [target], tolerance, max_sweeps, error)
    if (allocated(error)) return
    if (present(start)) then
      if (any(shape(start) /= self%flexibility%lattice%extent)) then
        call raise(error, status%invalid_input, 'the contact area to start from does not have the shape of the lattice window')
        return
      end if
    end if
    call new_contact_state(state, self%flexibility%lattice, field_space_t())
    self%flexibility%applications = 0.0_wp
    n = self%flexibility%lattice%size()
    h = reshape(self%initial_gap, [n])
    candidate = reshape(self%candidate, [n])
    delta = minval(h, mask=candidate)
    allocate (p(n), compliance(n), offset(n), source=0.0_wp)
    allocate (wrong(n), source=.false.)
    if (present(start)) then
      active = candidate .and. reshape(start, [n])
      if (.not. any(active)) active = candidate
    else
      active = first_guess(self%flexibility%lattice, self%flexibility%pair, control, target, h, candidate)
      call find_coarse_area(self, control, target, max_sweeps, active)
    end if
    if (target <= merge(0.0_wp, delta, control == force_control)) then
      active = .false.
      if (control /= force_control) delta = target
    end if
    fewest = huge(1)
    left = self%options%direct%stalled_exchanges

    do while (any(active) .and. state%sweeps < max_sweeps)
      state%sweeps = state%sweeps + 1
      call solve_active(self, control, target, h + offset, compliance, active, p, delta, error)
      if (allocated(error)) return
      call find_gap(self, p, h - delta, gap, error)
      if (allocated(error)) return
      if (self%law%is_compliant()) then
        worst = 0.0_wp
        call self%law%violation(1, self%compliance, p, gap, candidate, worst)
        if (worst <= self%options%direct%final_accuracy*tolerance*maxval(p)) exit
        call linearize_law(self, p, gap, candidate, active, compliance, offset)
        cycle
      end if

      ! the gap of a node in contact is zero up to rounding, which must not count as penetration
      wrong = (active .and. p < 0.0_wp) .or. (candidate .and. .not. active .and. gap < 0.0_wp)
      if (.not. any(wrong)) exit
      call exchange(wrong, self%options%direct%stalled_exchanges, fewest, left, active)
      if (.not. any(active)) active = candidate .and. gap <= minval(gap, mask=candidate)
    end do

    state%pressure = reshape(max(p, 0.0_wp), shape(state%pressure))
    call find_gap(self, reshape(state%pressure, [n]), h - delta, gap, error)
    if (allocated(error)) return
    state%gap = reshape(gap, shape(state%gap))
    state%motion(normal) = delta
    state%stopped = merge(sweeps_used_up, no_progress, state%sweeps >= max_sweeps)
    call complete_state(state, self%flexibility%lattice, self%candidate, self%compliance, control, target, tolerance, &
                  field_space_t(), error, self%law)
    state%operator_applications = self%flexibility%applications
  end subroutine solve

  !> Find the contact area on the lattice of every second node, if that has nodes enough: each one takes fewer exchanges.
  recursive subroutine find_coarse_area(self, control, target, max_sweeps, active)
    class(direct_contact_t), intent(inout) :: self
    !> force_control or displacement_control
    integer, intent(in) :: control
    !> Normal load [N] or approach [m]
    real(wp), intent(in) :: target
    !> Active sets that may be tried
    integer, intent(in) :: max_sweeps
    !> First guess of the contact area; then the better one, if there is one
    logical, intent(inout) :: active(:)
    !> A start is of use only: without the coarse one the first guess serves
    type(error_t), allocatable :: error
    type(direct_contact_t), allocatable :: coarser
    type(contact_state_t) :: state
    type(lattice_t) :: coarse
    real(wp) :: pressure(self%flexibility%lattice%extent(1), self%flexibility%lattice%extent(2))
    logical :: found(size(active))

    associate (lattice => self%flexibility%lattice, options => self%options)
      if (count(active) < 4*options%multilevel%least_contact) return
      if (.not. allocated(self%coarser)) then
        coarse = lattice%coarsened()
        if (.not. any(restrict_mask(lattice, self%candidate, coarse))) return
        allocate (coarser)
        call new_direct_contact(coarser, coarse, self%flexibility%pair, restrict_field(lattice, self%initial_gap, coarse), &
                                restrict_mask(lattice, self%candidate, coarse), error, options, self%law)
        if (allocated(error)) return
        call move_alloc(coarser, self%coarser)
      end if
      call self%coarser%solve(control, target, options%direct%nested_tolerance, max_sweeps, state, error)
      if (allocated(error)) return
      call prolong_edge(self%coarser%flexibility%lattice, state%pressure, lattice, pressure, field_space_t())
      found = reshape(self%candidate .and. pressure > 0.0_wp, [size(active)])
      if (any(found)) active = found
    end associate
  end subroutine find_coarse_area

  !> Nodes in contact, and springs of a compliant law that is linearised about the present pressure and gap.
  pure subroutine linearize_law(self, p, gap, candidate, active, compliance, offset)
    class(direct_contact_t), intent(in) :: self
    !> Pressure [Pa] and gap [m]
    real(wp), intent(in), contiguous :: p(:), gap(:)
    !> Nodes that may come into contact
    logical, intent(in), contiguous :: candidate(:)
    !> Active nodes
    logical, intent(inout), contiguous :: active(:)
    !> Compliance [m/Pa] and offset [m] of each spring
    real(wp), intent(out), contiguous :: compliance(:), offset(:)
    real(wp) :: r, softest

    associate (options => self%options%contact, pair => self%flexibility%pair, lattice => self%flexibility%lattice)
      r = options%classification_parameter(pair%lambda_1, lattice%cell_area()*max(count(active), 1))
      softest = self%law%softest_spring(options%softest_layer, self%compliance, maxval(abs(p)))
    end associate
    call self%law%find_contact(r, p, gap, candidate, active)
    if (.not. any(active)) active = candidate .and. gap <= minval(gap, mask=candidate)
    call self%law%linearize(1, r, softest, p, gap, active, compliance, offset)
  end subroutine linearize_law

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
    logical, intent(inout) :: active(:)
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

  !> Nodes that the undeformed bodies would overlap on well; about 1.4 times the contact area of a sphere.
  !>
  !> Under a load the overlap is that at which a flat punch of the same area
  !> would reach the rim of the overlap: mean initial gap + P/(2 E* a) = overlap.
  pure function first_guess(lattice, pair, control, target, h, candidate) result(active)
    !> Lattice
    type(lattice_t), intent(in) :: lattice
    !> Elastic constants of the two bodies
    type(elastic_pair_t), intent(in) :: pair
    !> force_control or displacement_control
    integer, intent(in) :: control
    !> Normal load [N] or approach [m]
    real(wp), intent(in) :: target
    !> Initial gap [m]
    real(wp), intent(in) :: h(:)
    !> Nodes that may come into contact
    logical, intent(in) :: candidate(:)
    logical :: active(size(h))
    !> Share of the overlap that the gap at the edge of a contact never exceeds: it is 2/pi for a cone, 1/2 for a sphere, and less
    !> for blunter bodies (Sneddon, Int. J. Eng. Sci. 3, 1965)
    real(wp), parameter :: edge_share = 0.65_wp
    real(wp) :: low, high, overlap, radius
    integer :: i

    overlap = target
    if (control == force_control) then
      low = minval(h, mask=candidate)
      high = maxval(h, mask=candidate)
      do i = 1, 50
        overlap = 0.5_wp*(low + high)
        active = candidate .and. h <= overlap
        radius = sqrt(count(active)*lattice%cell_area()/pi)
        if (sum(h, mask=active)/count(active) + target/(2.0_wp*pair%effective_modulus()*radius) > overlap) then
          low = overlap
        else
          high = overlap
        end if
      end do
      overlap = high
    end if
    low = minval(h, mask=candidate)
    active = candidate .and. h <= low + edge_share*(overlap - low)
  end function first_guess

  !> Pressure that closes the gap on the active nodes, but for what their springs give way: (K + C) p = approach - h.
  subroutine solve_active(self, control, target, h, compliance, active, p, delta, error)
    class(direct_contact_t), intent(inout) :: self
    !> force_control or displacement_control
    integer, intent(in) :: control
    !> Normal load [N] or approach [m]
    real(wp), intent(in) :: target
    !> Initial gap [m], and compliance of the springs [m/Pa]
    real(wp), intent(in) :: h(:), compliance(:)
    !> Active nodes
    logical, intent(in) :: active(:)
    !> Pressure, zero off the active nodes [Pa]
    real(wp), intent(out) :: p(:)
    !> Approach [m]
    real(wp), intent(out) :: delta
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    real(wp), allocatable :: rhs(:, :)
    integer, allocatable :: node(:)
    integer :: i, n, info, stat

    delta = target
    p = 0.0_wp
    node = pack([(i, i=1, size(active))], active)
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
      self%matrix(i, i) = self%matrix(i, i) + compliance(node(i))
    end do
    !$omp end parallel do
    rhs(:, 1) = 1.0_wp
    rhs(:, 2) = h(node)
    call dposv('U', n, 2, self%matrix, size(self%matrix, 1), rhs, n, info)
    if (info /= 0) then
      call raise(error, status%no_convergence, 'the flexibility matrix of the contact area is not positive definite')
      return
    end if
    if (control == force_control) delta = (target/self%flexibility%lattice%cell_area() + sum(rhs(:, 2)))/sum(rhs(:, 1))
    p(node) = delta*rhs(:, 1) - rhs(:, 2)
  end subroutine solve_active

  !> Gap under a pressure.
  subroutine find_gap(self, pressure, rigid_gap, gap, error)
    class(direct_contact_t), intent(inout) :: self
    !> Pressure [Pa]
    real(wp), intent(in) :: pressure(:)
    !> Gap of the undeformed bodies [m]
    real(wp), intent(in) :: rigid_gap(:)
    !> Gap [m]
    real(wp), intent(out) :: gap(:)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: closing(self%flexibility%lattice%extent(1), self%flexibility%lattice%extent(2), 1)

    call self%flexibility%apply([normal], reshape(pressure, shape(closing)), [normal], closing, error)
    if (allocated(error)) return
    gap = rigid_gap + reshape(closing, shape(gap))
  end subroutine find_gap

end module hc_direct_contact
