!> Contact of two bodies along the normal: the part of a contact problem that every solver shares.
!>
!> With friction it is the first part of hc_contact_problem; without, it is all there is.
!>
!> Equations: docs/theory/conditions.md, (C1), (C2), (C5); docs/theory/normal_contact.md, (N2), (N6).
module hc_normal_problem
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp, pi, lk
  use hc_error, only: error_t, status, raise
  use hc_options, only: options_t
  use hc_lattice, only: lattice_t
  use hc_hierarchy, only: level_t
  use hc_field_space, only: field_space_t
  use hc_elastic_medium, only: elastic_medium_t
  use hc_contact_state, only: contact_state_t, load_target_t, check_problem, touches_rim, separated, slip, normal, force_control, &
    within_tolerance, not_finite
  use hc_contact_residuals, only: normal_self_compliance, normal_residual, force_residual
  use hc_normal_law, only: normal_law_t, unilateral_t, tangent_t
  implicit none
  private

  public :: normal_problem_t, new_normal_problem, nearest_nodes

  !> Two bodies that touch.
  type, extends(level_t) :: normal_problem_t
    !> The two bodies
    class(elastic_medium_t), allocatable :: medium
    !> Law of contact along the normal
    class(normal_law_t), allocatable :: normal_law
    !> Self-compliance d_n of a node [m/Pa]
    real(wp) :: normal_compliance = 0.0_wp
    !> Tolerances, caps and tuning numbers of the solver
    type(options_t) :: options
  contains
    !> Bodies, law and tuning numbers from another lattice
    procedure :: inherit
    !> Return whether the bodies will touch
    procedure :: is_pressed
    !> Refuse an approach that no pressure belongs to
    procedure :: check_approach
    !> Classification parameter r' of the conditions along the normal
    procedure :: normal_classification_parameter
    !> Compliance beyond which a spring of a compliant law has no effect; that of a node with the stiffest of them
    procedure :: softest_spring, sprung_compliance
    !> Nodes that the law calls for, and its springs there
    procedure :: find_contact, linearize
    !> Nodes that the undeformed bodies overlap on
    procedure :: first_guess
    !> Gap from its closing by the pressure
    procedure :: open_gap
    !> Zones, load and residuals of a state whose pressure and gap are known
    procedure :: complete_pressed
    !> Return whether there is contact at the rim of the window
    procedure :: reaches_rim
  end type normal_problem_t

contains

  !> Set up the normal part of a contact problem.
  subroutine new_normal_problem(problem, lattice, medium, initial_gap, candidate, error, law, space)
    !> Problem to be set up
    class(normal_problem_t), intent(inout) :: problem
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> Initial gap (n_col, n_row) [m]
    real(wp), intent(in) :: initial_gap(:, :)
    !> Nodes that may come into contact (n_col, n_row)
    logical, intent(in) :: candidate(:, :)
    !> Allocated on failure: wrong shapes, no candidate at all, numbers of no use
    type(error_t), allocatable, intent(out) :: error
    !> Law of contact along the normal; absent: unilateral contact
    class(normal_law_t), intent(in), optional :: law
    !> Space of the fields, whose rows on this rank gap and candidates are; absent: that of the problem
    type(field_space_t), intent(in), optional :: space

    if (present(space)) problem%space = space
    call check_problem(lattice, medium, initial_gap, candidate, error, problem%space)
    if (allocated(error)) return
    if (present(law)) call law%check(error)
    if (allocated(error)) return
    problem%lattice = lattice
    allocate (problem%medium, source=medium)
    if (present(law)) then
      allocate (problem%normal_law, source=law)
    else
      allocate (unilateral_t :: problem%normal_law)
    end if
    problem%initial_gap = initial_gap
    problem%candidate = candidate
    problem%normal_compliance = normal_self_compliance(lattice, medium)
  end subroutine new_normal_problem

  !> Take bodies, law and tuning numbers of the same problem from another lattice.
  subroutine inherit(self, from)
    class(normal_problem_t), intent(inout) :: self
    class(level_t), intent(in) :: from

    select type (from)
    class is (normal_problem_t)
      if (allocated(self%medium)) deallocate (self%medium)
      allocate (self%medium, source=from%medium)
      if (allocated(self%normal_law)) deallocate (self%normal_law)
      allocate (self%normal_law, source=from%normal_law)
      self%options = from%options
    end select
    self%normal_compliance = normal_self_compliance(self%lattice, self%medium)
  end subroutine inherit

  !> Return whether the bodies will touch: under any load, by an approach beyond the smallest gap.
  logical function is_pressed(self, target)
    class(normal_problem_t), intent(in) :: self
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target

    if (target%control(normal) == force_control) then
      is_pressed = target%value(normal) > 0.0_wp
    else
      is_pressed = target%value(normal) > self%space%min(self%initial_gap, self%candidate)
    end if
  end function is_pressed

  !> Refuse an approach of the mean gap or more in a window that repeats: all of it touches, under any mean pressure.
  subroutine check_approach(self, target, error)
    class(normal_problem_t), intent(in) :: self
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: all_touch = 1.0_wp - 1.0e-9_wp
    real(wp) :: lowest, mean
    integer :: n

    if (.not. self%lattice%is_periodic() .or. target%control(normal) == force_control) return
    if (self%normal_law%is_compliant()) return
    n = self%space%count(self%candidate)
    if (n < self%lattice%size()) return
    lowest = self%space%min(self%initial_gap, self%candidate)
    mean = self%space%sum(self%initial_gap)/self%lattice%size()
    if (target%value(normal) > lowest .and. target%value(normal) - lowest >= all_touch*(mean - lowest)) then
      call raise(error, status%invalid_input, 'the approach: less than the mean gap expected in a window that repeats')
    end if
  end subroutine check_approach

  !> Compute r' = kappa/(2 pi lambda a), lambda_1 on half-spaces [Pa/m].
  pure real(wp) function normal_classification_parameter(self, n_contact) result(r)
    class(normal_problem_t), intent(in) :: self
    !> Nodes in contact
    integer, intent(in) :: n_contact

    real(wp) :: radius

    radius = sqrt(self%lattice%cell_area()*max(n_contact, 1)/pi)
    r = self%options%contact%classification_parameter(self%medium%normal_point(radius), radius)
  end function normal_classification_parameter

  !> Compute the compliance beyond which a spring of a compliant law has no effect [m/Pa].
  pure real(wp) function softest_spring(self, p_max)
    class(normal_problem_t), intent(in) :: self
    !> Largest pressure [Pa]
    real(wp), intent(in) :: p_max

    softest_spring = self%options%contact%softest_layer*self%sprung_compliance(p_max)
  end function softest_spring

  !> Compute the compliance of a node along the normal, with that of the layer under the largest pressure [m/Pa].
  pure real(wp) function sprung_compliance(self, p_max)
    class(normal_problem_t), intent(in) :: self
    !> Largest pressure [Pa]
    real(wp), intent(in) :: p_max

    sprung_compliance = self%normal_compliance + self%normal_law%compliance_under(p_max)
  end function sprung_compliance

  !> Find the nodes that the law of contact calls for, (F5): one step of a projected gradient map, which contracts because r' is
  !> scaled with the size of the contact.
  subroutine find_contact(self, n_contact, p, gap, candidate, contact)
    class(normal_problem_t), intent(in) :: self
    !> Nodes in contact so far
    integer, intent(in) :: n_contact
    !> Pressure [Pa] and gap [m], row by row
    real(wp), intent(in), dimension(size(self%initial_gap, 1), size(self%initial_gap, 2)) :: p, gap
    !> Nodes that may come into contact
    logical(lk), intent(in) :: candidate(size(self%initial_gap, 1), size(self%initial_gap, 2))
    !> The nodes; those of the smallest gap where the law calls for none
    logical(lk), intent(out) :: contact(size(self%initial_gap, 1), size(self%initial_gap, 2))
    logical :: touching(size(p, 1))
    real(wp) :: r, least
    integer :: row

    r = self%normal_classification_parameter(n_contact)
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(touching)
    do row = 1, size(p, 2)
      call self%normal_law%find_contact(r, p(:, row), gap(:, row), logical(candidate(:, row)), touching)
      contact(:, row) = touching
    end do
    !$omp end parallel do
    if (self%space%count(contact) > 0) return
    least = self%space%min(gap, candidate)
    contact = candidate .and. gap <= least
  end subroutine find_contact

  !> Linearise a compliant law about the present pressure and gap: springs of the nodes in contact, (N6).
  subroutine linearize(self, r, p, gap, contact, compliance, offset)
    class(normal_problem_t), intent(in) :: self
    !> Classification parameter r'; 0: about the present pressure [Pa/m]
    real(wp), intent(in) :: r
    !> Pressure [Pa] and gap [m], row by row
    real(wp), intent(in), dimension(size(self%initial_gap, 1), size(self%initial_gap, 2)) :: p, gap
    !> Nodes in contact
    logical(lk), intent(in) :: contact(size(self%initial_gap, 1), size(self%initial_gap, 2))
    !> Compliance [m/Pa] and offset [m] of the spring of each node, 0 off the contact
    real(wp), intent(out), dimension(size(self%initial_gap, 1), size(self%initial_gap, 2)) :: compliance, offset
    type(tangent_t) :: tangent
    integer :: row

    tangent = tangent_t(r, self%softest_spring(self%space%max(abs(p))))
    !$omp parallel do schedule(static) num_threads(self%space%threads)
    do row = 1, size(p, 2)
      call self%normal_law%linearize((row - 1)*size(p, 1) + 1, tangent, p(:, row), gap(:, row), logical(contact(:, row)), &
                                     compliance(:, row), offset(:, row))
    end do
    !$omp end parallel do
  end subroutine linearize

  !> Return the nodes of the smallest gap among those that may come into contact.
  pure function nearest_nodes(gap, candidate) result(nodes)
    !> Gap [m]
    real(wp), intent(in) :: gap(:)
    !> Nodes that may come into contact
    logical(lk), intent(in) :: candidate(:)
    logical(lk) :: nodes(size(gap))

    nodes = candidate .and. gap <= minval(gap, mask=candidate)
  end function nearest_nodes

  !> Return the nodes that the undeformed bodies would overlap on well: about 1.4 times the contact area of a sphere (n).
  !>
  !> Under a load the overlap is that at which a flat punch of the same area
  !> would reach the rim of the overlap: mean initial gap + P/(2 E* a) = overlap, or that of other bodies.
  pure function first_guess(self, target) result(active)
    class(normal_problem_t), intent(in) :: self
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target
    logical(lk), allocatable :: active(:)
    !> Share of the overlap that the gap at the edge of a contact never exceeds: it is 2/pi for a cone, 1/2 for a sphere, and less
    !> for blunter bodies (Sneddon, Int. J. Eng. Sci. 3, 1965)
    real(wp), parameter :: edge_share = 0.65_wp
    real(wp), allocatable :: h(:)
    logical(lk), allocatable :: candidate(:)
    real(wp) :: low, high, overlap, radius
    integer :: i

    h = reshape(self%initial_gap, [self%lattice%size()])
    candidate = reshape(self%candidate, [self%lattice%size()])
    overlap = target%value(normal)
    if (target%control(normal) == force_control) then
      low = minval(h, mask=candidate)
      high = maxval(h, mask=candidate)
      do i = 1, 50
        overlap = 0.5_wp*(low + high)
        active = candidate .and. h <= overlap
        radius = sqrt(count(active)*self%lattice%cell_area()/pi)
        if (sum(h, mask=active)/count(active) + self%medium%punch_approach(target%value(normal), radius) > overlap) then
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

  !> Compute the gap h + w - approach in the place of the closing w.
  subroutine open_gap(self, approach, gap)
    class(normal_problem_t), intent(in) :: self
    !> Approach [m]
    real(wp), intent(in) :: approach
    !> Closing of the gap; then the gap (n_col, own rows) [m]
    real(wp), intent(inout), contiguous :: gap(:, :)
    integer :: row

    !$omp parallel do schedule(static) num_threads(self%space%threads)
    do row = 1, size(gap, 2)
      gap(:, row) = self%initial_gap(:, row) + gap(:, row) - approach
    end do
    !$omp end parallel do
  end subroutine open_gap

  !> Compute zones, load and residuals of a state whose pressure and gap are known.
  subroutine complete_pressed(self, target, tolerance, state, error)
    class(normal_problem_t), intent(in) :: self
    !> Load or motion that was prescribed along the normal
    type(load_target_t), intent(in) :: target
    !> Bound of the residuals
    real(wp), intent(in) :: tolerance
    !> State to be completed
    type(contact_state_t), intent(inout) :: state
    !> Allocated on failure: a pressure or a gap that is not a finite number
    type(error_t), allocatable, intent(out) :: error
    integer :: row

    !$omp parallel do schedule(static) num_threads(self%space%threads)
    do row = 1, size(state%zone, 2)
      state%zone(:, row) = merge(slip, separated, state%pressure(:, row) > 0.0_wp)
    end do
    !$omp end parallel do
    state%load(normal) = self%lattice%cell_area()*self%space%sum(state%pressure)
    state%residual_normal = normal_residual(state%pressure, state%gap, logical(self%candidate), self%normal_compliance, &
                                            self%space, self%normal_law)
    state%residual_force = 0.0_wp
    if (target%control(normal) == force_control) then
      state%residual_force = force_residual(state%load(normal), target%value(normal))
    end if
    ! one by one: the largest of several numbers hides one that is not a number
    state%converged = state%residual_normal <= tolerance .and. state%residual_force <= tolerance
    state%clipped = self%reaches_rim(state) .and. .not. self%lattice%is_periodic()
    if (state%converged) state%stopped = within_tolerance
    if (ieee_is_finite(state%load(normal)) .and. state%residual_normal < huge(1.0_wp)) return
    ! penetration without any pressure is infinite as well, but a state that can be shown
    if (self%space%count(logical(ieee_is_finite(state%pressure) .and. (ieee_is_finite(state%gap) .or. .not. self%candidate), lk)) &
        == self%lattice%size()) return
    call raise(error, status%no_convergence, not_finite)
  end subroutine complete_pressed

  !> Return whether there is contact at the rim of the window.
  logical function reaches_rim(self, state)
    class(normal_problem_t), intent(in) :: self
    !> State, with own rows of its pressure
    type(contact_state_t), intent(in) :: state
    logical(lk), allocatable :: rim(:, :)

    if (self%space%ranks%size == 1) then
      reaches_rim = touches_rim(state)
      return
    end if
    allocate (rim(size(state%pressure, 1), size(state%pressure, 2)), source=.false._lk)
    rim([1, size(rim, 1)], :) = .true.
    if (self%space%ranks%rank == 0) rim(:, 1) = .true.
    if (self%space%ranks%rank == self%space%ranks%size - 1) rim(:, size(rim, 2)) = .true.
    reaches_rim = self%space%count(logical(rim .and. state%pressure > 0.0_wp, lk)) > 0
  end function reaches_rim

end module hc_normal_problem
