!> An iterate of the direct method: nodes in contact with their frozen state of stick and slip, tractions and motions.
!>
!> Equations: docs/theory/friction.md, (F5) to (F8).
module hc_direct_iterate
  use hc_precision, only: wp, lk, zk
  use hc_error, only: error_t
  use hc_flexibility_dense, only: dense_flexibility_t
  use hc_flexibility_fft, only: fft_flexibility_t
  use hc_area_factors, only: area_factors_t
  use hc_contact_state, only: contact_state_t, load_step_t, load_target_t, separated, stick, slip, normal, along_x, n_motion, &
    displacement_control
  use hc_contact_problem, only: friction_problem_t
  implicit none
  private

  public :: direct_iterate_t, infinite

  !> A compliance that leaves no traction across the direction of slip.
  real(wp), parameter :: infinite = huge(1.0_wp)

  !> An iterate of a load step; over the nodes of the window.
  type :: direct_iterate_t
    !> The contact problem, and its flexibility: influence coefficients, products over the window, factors of the last area
    type(friction_problem_t), pointer :: problem => null()
    type(dense_flexibility_t), pointer :: flexibility => null()
    type(fft_flexibility_t), pointer :: operator => null()
    type(area_factors_t), pointer :: factors => null()
    !> Loads or motions to be reached
    type(load_target_t) :: target
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
  contains
    !> Begin a load step without tractions or contact
    procedure :: begin
    !> Gap and slip by the motions alone, and under the tractions, too
    procedure :: unloaded, evaluate
    !> Stick or slip of all nodes in contact, and of one that comes into contact
    procedure :: classify, enter
    !> Nodes in contact with the springs of a compliant law
    procedure :: linearize_law
    !> Pressure that counts as rounding error
    procedure :: negligible_pressure
    !> Return whether nothing carries the loads
    procedure :: is_unsupported
    !> State with admissible tractions
    procedure :: record
  end type direct_iterate_t

contains

  !> Begin a load step without tractions or contact; problem and flexibility are set.
  subroutine begin(it, start, step)
    class(direct_iterate_t), intent(inout) :: it
    !> State to start from: its motions
    type(contact_state_t), intent(in) :: start
    !> The load step
    type(load_step_t), intent(in) :: step
    integer :: n

    ! with rows of the step before, the last bits would depend on whether the run was interrupted
    call it%factors%clear()
    it%operator%applications = 0.0_wp
    it%target = step%target
    n = it%problem%lattice%size()
    it%initial_gap = reshape(it%problem%initial_gap, [n])
    it%candidate = reshape(it%problem%candidate, [n])
    it%reference = reshape(step%reference, [n, 2])
    it%motion = merge(step%target%value, start%motion, step%target%control == displacement_control)
    allocate (it%p(n), it%compliance(n), it%spring(n), it%offset(n), source=0.0_wp)
    allocate (it%q(n, 2), it%direction(2, n), source=0.0_wp)
    allocate (it%zone(n), source=separated)
  end subroutine begin

  !> Compute gap and slip that the motions alone would cause, without tractions (n, 3) [m].
  pure function unloaded(it)
    class(direct_iterate_t), intent(in) :: it
    real(wp) :: unloaded(size(it%p), 3)

    unloaded(:, normal) = it%initial_gap - it%motion(normal)
    unloaded(:, along_x:) = -reshape(it%problem%rigid_displacement(it%motion), [size(it%p), 2]) - it%reference
  end function unloaded

  !> Find stick or slip at every node in contact.
  pure subroutine classify(it, share)
    class(direct_iterate_t), intent(inout) :: it
    !> Share of the classification parameter to use
    real(wp), intent(in) :: share
    logical :: pressed(size(it%p))
    real(wp) :: r
    integer :: i

    associate (problem => it%problem)
      r = share*problem%classification_parameter(count(it%contact .and. it%p > 0.0_wp))
      pressed = it%contact .and. it%p > 0.0_wp .and. problem%friction%resists() .and. problem%friction%is_bounded()
      call problem%friction%linearize(1, maxval(it%p), r, pressed, it%p, it%q(:, 1), it%q(:, 2), it%ds(:, 1), it%ds(:, 2), &
                                      it%zone, it%direction, it%compliance)
    end associate
    do i = 1, size(it%p)
      if (it%contact(i) .and. .not. pressed(i)) call it%enter(i)
    end do
  end subroutine classify

  !> Set the state of a node that comes into contact: its traction, if any, will oppose its slip.
  pure subroutine enter(it, node)
    class(direct_iterate_t), intent(inout) :: it
    !> Node
    integer, intent(in) :: node
    real(wp) :: length

    associate (problem => it%problem)
      it%zone(node) = merge(slip, stick, problem%friction%is_bounded())
      it%compliance(node) = merge(infinite, 0.0_wp, problem%friction%is_bounded())
      it%direction(:, node) = 0.0_wp
      length = norm2(it%ds(node, :))
      if (length > problem%options%direct%negligible_slip*problem%tangential_compliance*maxval(it%p)) then
        it%direction(:, node) = -it%ds(node, :)/length
      end if
    end associate
  end subroutine enter

  !> Return the pressure that counts as rounding error [Pa].
  pure real(wp) function negligible_pressure(it)
    class(direct_iterate_t), intent(in) :: it

    negligible_pressure = max(it%problem%options%direct%pressure_rounding, it%accuracy)*maxval(it%p)
  end function negligible_pressure

  !> Return whether nothing carries the loads, or no more than the directions of slip, with tractions to match.
  pure logical function is_unsupported(it)
    class(direct_iterate_t), intent(in) :: it

    is_unsupported = .not. it%carried
    if (is_unsupported .or. any(it%zone == stick)) return
    is_unsupported = sqrt(maxval(sum(it%q**2, dim=2)))/it%problem%options%direct%most_across &
                     > it%problem%friction%largest_bound(maxval(it%p))
  end function is_unsupported

  !> Find the nodes in contact, and the springs of a compliant law, that the present pressure and gap call for.
  subroutine linearize_law(it)
    class(direct_iterate_t), intent(inout) :: it
    logical :: before(size(it%p))
    real(wp) :: r
    integer :: i

    before = it%contact
    r = it%problem%normal_classification_parameter(count(before))
    call it%problem%find_contact(count(before), it%p, it%gap, it%candidate, it%contact)
    call it%problem%linearize(r, it%p, it%gap, it%contact, it%spring, it%offset)
    do i = 1, size(it%p)
      if (it%contact(i) .and. .not. before(i)) call it%enter(i)
    end do
  end subroutine linearize_law

  !> Compute gap and slip under the tractions and motions.
  subroutine evaluate(it, error)
    class(direct_iterate_t), intent(inout) :: it
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), dimension(it%problem%lattice%extent(1), it%problem%lattice%extent(2), 3) :: traction, displacement
    real(wp) :: conditions(size(it%p), 3)

    traction = reshape([it%p, it%q], shape(traction))
    call it%problem%displacements(it%operator, traction(:, :, normal), traction(:, :, along_x:), displacement, error)
    if (allocated(error)) return
    conditions = it%unloaded() + reshape(displacement, shape(conditions))
    it%gap = conditions(:, normal)
    it%ds = conditions(:, along_x:)
  end subroutine evaluate

  !> Record the state that an iterate stands for: with its tractions projected on p >= 0 and on the cone.
  subroutine record(it, step, state, error)
    class(direct_iterate_t), intent(in) :: it
    !> The load step
    type(load_step_t), intent(in) :: step
    !> State to be filled
    type(contact_state_t), intent(inout) :: state
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: p(size(it%p)), q(size(it%p), 2), unit

    associate (problem => it%problem)
      call problem%normal_law%project(it%p, p)
      unit = maxval(p)
      if (unit > 0.0_wp) unit = 1.0_wp/unit
      call problem%friction%project(1, unit, p, it%q(:, 1), it%q(:, 2), q(:, 1), q(:, 2))
      state%pressure = reshape(p, shape(state%pressure))
      state%traction = reshape(q, shape(state%traction))
      state%motion = it%motion
      call problem%displace(it%operator, state, error)
      if (allocated(error)) return
      call problem%complete_state(step%target, step%tolerance, step%reference, state)
    end associate
    state%sweeps = it%solves
    state%operator_applications = it%operator%applications
  end subroutine record

end module hc_direct_iterate
