!> An iterate of the direct method: nodes in contact with their frozen state of stick and slip, tractions and motions.
!>
!> Equations: docs/theory/friction.md, (F5) to (F8).
module hc_direct_iterate
  use hc_precision, only: wp, lk, zk
  use hc_error, only: error_t
  use hc_flexibility, only: flexibility_t
  use hc_contact_state, only: contact_state_t, load_step_t, separated, stick, slip, normal, along_x, n_motion, &
    displacement_control
  use hc_contact_problem, only: friction_problem_t
  implicit none
  private

  public :: direct_iterate_t, new_direct_iterate, infinite, unloaded, classify, enter, is_unsupported, linearize_law, &
            evaluate, record

  !> A compliance that leaves no traction across the direction of slip.
  real(wp), parameter :: infinite = huge(1.0_wp)

  !> An iterate; over the nodes of the window.
  type :: direct_iterate_t
    !> Nodes that may come into contact, nodes in contact
    logical(lk), allocatable :: candidate(:), contact(:)
    !> Initial gap (n) and relative displacement at the beginning of the step (n, 2) [m]
    real(wp), allocatable :: initial_gap(:), reference(:, :)
    !> Pressure (n) and shear traction (n, 2) [Pa]
    real(wp), allocatable :: p(:), q(:, :)
    !> Gap (n) and slip of the step (n, 2) under them [m]
    real(wp), allocatable :: gap(:), ds(:, :)
    !> Approach, shifts [m] and twist [rad]
    real(wp) :: motion(n_motion) = 0.0_wp
    !> Frozen state of the nodes in contact: stick or slip, its direction (2, n) and
    !> compliance across it; a node with an infinite one has no traction across
    integer(zk), allocatable :: zone(:)
    real(wp), allocatable :: direction(:, :), compliance(:)
    !> Under a compliant law of contact: compliance [m/Pa] and offset [m] of the spring along the normal, 0 off the contact
    real(wp), allocatable :: spring(:), offset(:)
    !> The tractions carry all prescribed loads
    logical :: carried = .true.
    !> Linear systems solved so far
    integer :: solves = 0
    !> Residual that the next one may leave, relative to the largest pressure or traction
    real(wp) :: accuracy = 0.0_wp
  end type direct_iterate_t

contains

  !> Set up an iterate without tractions or contact.
  subroutine new_direct_iterate(it, problem, start, step)
    !> Iterate
    type(direct_iterate_t), intent(out) :: it
    !> The contact problem
    type(friction_problem_t), intent(in) :: problem
    !> State to start from: its motions
    type(contact_state_t), intent(in) :: start
    !> The load step
    type(load_step_t), intent(in) :: step
    integer :: n

    n = problem%lattice%size()
    it%initial_gap = reshape(problem%initial_gap, [n])
    it%candidate = reshape(problem%candidate, [n])
    it%reference = reshape(step%reference, [n, 2])
    it%motion = merge(step%target%value, start%motion, step%target%control == displacement_control)
    allocate (it%p(n), it%compliance(n), it%spring(n), it%offset(n), source=0.0_wp)
    allocate (it%q(n, 2), it%direction(2, n), source=0.0_wp)
    allocate (it%zone(n), source=separated)
  end subroutine new_direct_iterate

  !> Gap and slip that the motions alone would cause, without tractions (n, 3) [m].
  pure function unloaded(problem, it)
    !> The contact problem
    type(friction_problem_t), intent(in) :: problem
    !> Iterate
    type(direct_iterate_t), intent(in) :: it
    real(wp) :: unloaded(size(it%p), 3)

    unloaded(:, normal) = it%initial_gap - it%motion(normal)
    unloaded(:, along_x:) = -reshape(problem%rigid_displacement(it%motion), [size(it%p), 2]) - it%reference
  end function unloaded

  !> Stick or slip at every node in contact.
  pure subroutine classify(problem, share, it)
    !> The contact problem
    type(friction_problem_t), intent(in) :: problem
    !> Share of the classification parameter to use
    real(wp), intent(in) :: share
    !> Iterate
    type(direct_iterate_t), intent(inout) :: it
    logical :: pressed(size(it%p))
    real(wp) :: r
    integer :: i

    r = share*problem%classification_parameter(count(it%contact .and. it%p > 0.0_wp))
    pressed = it%contact .and. it%p > 0.0_wp .and. problem%friction%resists() .and. problem%friction%is_bounded()
    call problem%friction%linearize(1, maxval(it%p), r, pressed, it%p, it%q(:, 1), it%q(:, 2), it%ds(:, 1), it%ds(:, 2), &
                                    it%zone, it%direction, it%compliance)
    do i = 1, size(it%p)
      if (it%contact(i) .and. .not. pressed(i)) call enter(problem, it, i)
    end do
  end subroutine classify

  !> State of a node that comes into contact: its traction, if any, will oppose its slip.
  pure subroutine enter(problem, it, node)
    !> The contact problem
    type(friction_problem_t), intent(in) :: problem
    !> Iterate
    type(direct_iterate_t), intent(inout) :: it
    !> Node
    integer, intent(in) :: node
    real(wp) :: length

    it%zone(node) = merge(slip, stick, problem%friction%is_bounded())
    it%compliance(node) = merge(infinite, 0.0_wp, problem%friction%is_bounded())
    it%direction(:, node) = 0.0_wp
    length = norm2(it%ds(node, :))
    if (length > problem%options%direct%negligible_slip*problem%tangential_compliance*maxval(it%p)) then
      it%direction(:, node) = -it%ds(node, :)/length
    end if
  end subroutine enter

  !> Is there nothing to carry the loads, or no more than the directions of slip, with tractions to match?
  pure logical function is_unsupported(problem, it)
    !> The contact problem
    type(friction_problem_t), intent(in) :: problem
    !> Iterate
    type(direct_iterate_t), intent(in) :: it

    is_unsupported = .not. it%carried
    if (is_unsupported .or. any(it%zone == stick)) return
    is_unsupported = sqrt(maxval(sum(it%q**2, dim=2)))/problem%options%direct%most_across &
                     > problem%friction%largest_bound(maxval(it%p))
  end function is_unsupported

  !> Find the nodes in contact, and the springs of a compliant law, that the present pressure and gap call for.
  subroutine linearize_law(problem, it)
    !> The contact problem
    type(friction_problem_t), intent(in) :: problem
    !> Iterate
    type(direct_iterate_t), intent(inout) :: it
    logical :: before(size(it%p))
    real(wp) :: r
    integer :: i

    before = it%contact
    r = problem%normal_classification_parameter(count(before))
    call problem%find_contact(count(before), it%p, it%gap, it%candidate, it%contact)
    call problem%linearize(r, it%p, it%gap, it%contact, it%spring, it%offset)
    do i = 1, size(it%p)
      if (it%contact(i) .and. .not. before(i)) call enter(problem, it, i)
    end do
  end subroutine linearize_law

  !> Gap and slip under the tractions and motions of an iterate.
  subroutine evaluate(problem, operator, it, error)
    !> The contact problem
    type(friction_problem_t), intent(in) :: problem
    !> Products over the window
    class(flexibility_t), intent(inout) :: operator
    !> Iterate
    type(direct_iterate_t), intent(inout) :: it
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), dimension(problem%lattice%extent(1), problem%lattice%extent(2), 3) :: traction, displacement
    real(wp) :: conditions(size(it%p), 3)

    traction = reshape([it%p, it%q], shape(traction))
    call problem%displacements(operator, traction(:, :, normal), traction(:, :, along_x:), displacement, error)
    if (allocated(error)) return
    conditions = unloaded(problem, it) + reshape(displacement, shape(conditions))
    it%gap = conditions(:, normal)
    it%ds = conditions(:, along_x:)
  end subroutine evaluate

  !> The state that an iterate stands for: with its tractions projected on p >= 0 and on the cone.
  subroutine record(problem, operator, step, it, state, error)
    !> The contact problem
    type(friction_problem_t), intent(in) :: problem
    !> Products over the window
    class(flexibility_t), intent(inout) :: operator
    !> The load step
    type(load_step_t), intent(in) :: step
    !> Iterate
    type(direct_iterate_t), intent(in) :: it
    !> State to be filled
    type(contact_state_t), intent(inout) :: state
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: p(size(it%p)), q(size(it%p), 2), unit

    call problem%normal_law%project(it%p, p)
    unit = maxval(p)
    if (unit > 0.0_wp) unit = 1.0_wp/unit
    call problem%friction%project(1, unit, p, it%q(:, 1), it%q(:, 2), q(:, 1), q(:, 2))
    state%pressure = reshape(p, shape(state%pressure))
    state%traction = reshape(q, shape(state%traction))
    state%motion = it%motion
    call problem%displace(operator, state, error)
    if (allocated(error)) return
    call problem%complete_state(step%target, step%tolerance, step%reference, state)
    state%sweeps = it%solves
    state%operator_applications = operator%applications
  end subroutine record

end module hc_direct_iterate
