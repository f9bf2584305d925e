!> A sweep over pressure and shear traction.
!>
!> Two steps of a semismooth Newton method: the pressure under the present shear
!> traction, by active sets as without friction; then the shear traction under that
!> pressure, with stick, slip and the direction of slip taken from the last
!> iterate (see friction_law). Both linear problems are solved by projected
!> conjugate gradients, no more accurately than the sets deserve; the rigid motions
!> come out as multipliers of the prescribed loads.
module hc_staggered_newton
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_contact_state, only: normal, along_x, along_y, n_motion, force_control
  use hc_load_constraints, only: driven_motions_t
  use hc_active_zones, only: find_contact, classify, find_constraints, find_wanted
  use hc_friction_iterate, only: iterate_t, cautious, rounding
  use hc_krylov, only: projected_cg, precondition_constraints, fulfil, solution_accurate
  implicit none
  private

  public :: staggered_sweep, lift_pressure, drag_shear, inner_accuracy, final_accuracy, beyond_reason

  !> Accuracy of a linear solution, relative to the residual at its start.
  real(wp), parameter :: inner_accuracy = 0.1_wp
  !> The same once residuals are small, and of the pressure: its iterations are the cheaper ones.
  real(wp), parameter :: late_accuracy = 0.03_wp, press_accuracy = 0.05_wp
  !> Accuracy of the last linear solution, relative to the tolerance.
  real(wp), parameter :: final_accuracy = 0.2_wp
  !> Component across the direction of slip, relative to the largest traction, that is taken for an answer.
  real(wp), parameter :: beyond_reason = 5.0_wp
  !> Sweeps after which a residual that falls less than this is taken for a circle.
  integer, parameter :: patience = 6
  real(wp), parameter :: stalling = 0.7_wp
  !> The share of a step that is taken then falls by this factor from 1/2 on, down to this.
  real(wp), parameter :: less = 0.9_wp, least_share = 0.1_wp
  !> Residual from which on Newton's method is left alone.
  real(wp), parameter :: settled = 1.0e-2_wp
  !> Sweeps after which a whole step is taken again with half the classification parameter, and how small that gets.
  integer, parameter :: tired = 10
  real(wp), parameter :: least_caution = 1.0e-3_wp
  integer, parameter :: max_iterations = 400
  !> Contact areas that are tried before the shear traction is looked at again.
  integer, parameter :: max_areas = 1, max_areas_alone = 60

contains

  !> One sweep: pressure, then shear traction, each with what it does to the other.
  subroutine staggered_sweep(now, error)
    !> Tractions and motions
    type(iterate_t), intent(inout) :: now
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: q(:)

    now%outcome = solution_accurate
    ! the pressure is found under the shear traction: what each of them causes has to be known
    if (now%joint) call now%refresh(error)
    if (allocated(error)) return
    call press(now, error)
    if (allocated(error)) return
    if (now%dragging .and. now%cold .and. now%first) then
      call now%operators%apply([normal], now%p, [along_x, along_y], now%u, error)
      if (allocated(error)) return
    end if
    ! what the new pressure makes of the old shear traction is what has to be mended
    if (.not. now%first) call now%find_tangential_residual()
    call shear_off(now, error)
    if (allocated(error)) return
    if (now%pressing) then
      call now%cut_to_cone(q)
      call now%operators%apply([along_x, along_y], q, [normal], now%closing, error)
      if (allocated(error)) return
      now%cut = .true.
    end if
    call now%find_residuals()
    now%first = .false.
  end subroutine staggered_sweep

  !> Pressure under the present shear traction.
  subroutine press(now, error)
    !> Tractions and motions
    type(iterate_t), intent(inout) :: now
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    real(wp), allocatable :: gap(:), rhs(:), constraint(:, :), mb(:, :)
    logical, allocatable :: contact(:)
    real(wp) :: goal, scale, residual, drift, multiplier(1), missing(1), cell_area, carried, level
    integer :: n, i, area, n_constraint, iterations, outcome
    logical :: changed, independent, searching

    n = size(now%p)
    ! a start that knows of no contact: the one without shear has to be found before stick and slip can be
    searching = now%cold .and. now%first
    cell_area = now%problem%lattice%cell_area()
    n_constraint = merge(1, 0, now%target%control(normal) == force_control)
    allocate (constraint(n, n_constraint), rhs(n))
    level = merge(0.0_wp, now%motion(normal), n_constraint == 1)
    do area = 1, merge(max_areas, max_areas_alone, now%pressing .and. .not. searching)
      call now%find_gap(gap)
      now%residual_normal = now%gap_residual(gap)
      missing = 0.0_wp
      carried = now%pressure%space%sum(now%p)
      if (n_constraint == 1) missing = now%target%value(normal)/cell_area - carried
      if (now%residual_normal <= final_accuracy*now%tolerance .and. &
          abs(missing(1)) <= final_accuracy*now%tolerance*carried) return
      changed = now%first .and. area == 1
      if (.not. (changed .and. now%cold)) then
        call find_contact(now, gap, contact)
        if (.not. changed) changed = count(contact .neqv. now%contact) > 0
        call move_alloc(contact, now%contact)
      end if
      if (searching .and. now%pressing .and. .not. changed) return

      if (changed) call now%pressure%take(now%contact)
      if (searching .and. now%pressing .and. allocated(now%lift)) deallocate (now%lift)
      !$omp parallel do schedule(static) num_threads(now%pressure%space%threads)
      do i = 1, n
        if (n_constraint == 1) constraint(i, 1) = merge(1.0_wp, 0.0_wp, now%contact(i))
        rhs(i) = level - now%h(i) - now%closing(i)
        if (changed) now%p(i) = merge(max(now%p(i), 0.0_wp), 0.0_wp, now%contact(i))
      end do
      !$omp end parallel do
      call lift_pressure(now, constraint, mb, error)
      if (allocated(error)) return
      if (changed) then
        if (n_constraint == 1) then
          missing = now%target%value(normal)/cell_area - now%pressure%space%sum(now%p)
          call fulfil(constraint, mb, missing, now%p, independent, now%pressure%space)
        end if
        call now%pressure%product(now%p, now%w, error)
        if (allocated(error)) return
      end if
      goal = final_accuracy*now%tolerance
      if (changed .or. now%pressing) goal = max(press_accuracy*min(now%residual_normal, 1.0_wp), goal)
      scale = now%problem%normal_compliance*now%pressure%space%max(now%p)
      call projected_cg(now%pressure, now%contact, constraint, mb, rhs, now%p, now%w, goal*scale, max_iterations, &
                        multiplier(:n_constraint), residual, iterations, outcome, error, drift)
      if (allocated(error)) return
      if (drift > rounding*scale) call now%pressure%product(now%p, now%w, error)
      if (allocated(error)) return
      now%outcome = max(now%outcome, outcome)
      if (n_constraint == 1) now%motion(normal) = multiplier(1)
    end do
  end subroutine press

  !> Shear traction under the present pressure.
  subroutine shear_off(now, error)
    !> Tractions and motions
    type(iterate_t), intent(inout) :: now
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    real(wp), allocatable :: x(:), ax(:), rhs(:), constraint(:, :), mb(:, :), q(:)
    logical, allocatable :: active(:)
    real(wp), allocatable :: missing(:), multiplier(:)
    type(driven_motions_t) :: driven
    real(wp) :: goal, scale, residual, drift, motion(n_motion)
    integer :: n, iterations, outcome
    logical :: independent, holding

    n = size(now%p)
    if (.not. now%problem%friction%resists()) then
      now%q = 0.0_wp
      return
    end if
    allocate (x(2*n), ax(2*n), rhs(2*n), q(2*n))
    call now%shear%space%copy(now%q, q)
    holding = .false.
    do
      call classify(now, holding, active)
      call now%shear%to_frame(now%q, x)
      call find_constraints(now, active, driven, constraint, missing)
      multiplier = driven%multipliers(now%motion)
      call drag_shear(now, active, constraint, .false., mb, error)
      if (allocated(error)) return
      call fulfil(constraint, mb, missing, x, independent, now%shear%space)
      if (.not. independent) then
        call drag_shear(now, active, constraint, .true., mb, error)
        if (allocated(error)) return
        call fulfil(constraint, mb, missing, x, independent, now%shear%space)
      end if
      if (independent) then
        call displace(now, x, ax, error)
        if (allocated(error)) return
        ! motions that are prescribed are known; the others are multipliers
        call find_wanted(now, rhs)
        ! Newton's method alone converges the faster the more accurate its steps are
        goal = min(now%residual_tangential, 1.0_wp)
        goal = goal*min(inner_accuracy, max(goal, merge(late_accuracy, 1.0e-3_wp, now%pressing)))
        goal = max(goal, final_accuracy*now%tolerance)
        scale = now%problem%tangential_compliance*now%traction_scale()
        call projected_cg(now%shear, active, constraint, mb, rhs, x, ax, goal*scale, max_iterations, multiplier, &
                          residual, iterations, outcome, error, drift)
        if (allocated(error)) return
        if (drift > rounding*scale) call displace(now, x, ax, error)
        if (allocated(error)) return
        now%outcome = max(now%outcome, outcome)
      end if
      now%adrift = .not. independent
      if (size(missing) == 0 .or. holding) exit
      ! where all nodes slip, only their directions resist a load: not beyond reason
      if (independent) then
        if (any(active(n + 1:))) exit
        if (maxval(abs(x(:n))) <= beyond_reason*now%traction_scale()) exit
      end if
      holding = .true.
      now%caution = max(cautious*now%caution, least_caution)
      now%q = q
    end do
    if (now%adrift) then
      now%q = q
      call now%refresh(error)
      return
    end if
    motion = now%motion
    call driven%set_motions(multiplier, now%motion)
    call now%shear%to_plane(x, now%q)
    call now%shear%take_springs_off(x, ax)
    call now%shear%to_plane(ax, now%u)
    call now%find_tangential_residual()
    now%n_sweep = now%n_sweep + 1
    if (mod(now%n_sweep, tired) == 0) then
      now%caution = max(0.5_wp*now%caution, least_caution)
      now%best = huge(1.0_wp)
    end if
    if (now%n_sweep <= patience .or. now%residual_tangential <= max(stalling*now%best, settled)) then
      now%best = min(now%best, now%residual_tangential)
      now%share = 0.5_wp
    else
      ! Newton's method goes in circles: what lies between carries the same loads
      now%q = merge(q + now%share*(now%q - q), 0.0_wp, [now%contact, now%contact])
      now%motion = motion + now%share*(now%motion - motion)
      now%share = max(less*now%share, least_share)
      call now%shear%to_frame(now%q, x)
      call displace(now, x, ax, error)
      if (allocated(error)) return
      call now%shear%take_springs_off(x, ax)
      call now%shear%to_plane(ax, now%u)
    end if
  end subroutine shear_off

  !> What a shear traction and the pressure displace together, springs included.
  subroutine displace(now, x, ax, error)
    !> Tractions and motions
    type(iterate_t), intent(inout) :: now
    !> Shear traction, in the frames (2 n)
    real(wp), intent(in), contiguous, target :: x(:)
    !> Tangential displacement, in the frames (2 n)
    real(wp), intent(out), contiguous, target :: ax(:)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: traction(:), moved(:)
    integer :: n, i

    if (.not. now%dragging) then
      call now%shear%product(x, ax, error)
      return
    end if
    n = size(now%p)
    allocate (traction(3*n), moved(2*n))
    call now%shear%space%copy(now%p, traction(:n))
    call now%shear%to_plane(x, traction(n + 1:))
    call now%operators%apply([normal, along_x, along_y], traction, [along_x, along_y], moved, error)
    if (allocated(error)) return
    call now%shear%to_frame(moved, ax)
    !$omp parallel do schedule(static) num_threads(now%shear%space%threads)
    do i = 1, n
      ax(i) = ax(i) + now%shear%compliance(i)*x(i)
    end do
    !$omp end parallel do
  end subroutine displace

  !> About the pressure that an approach of the nodes in contact causes: worked out once a step.
  subroutine lift_pressure(now, constraint, mb, error)
    !> Tractions and motions
    type(iterate_t), intent(inout) :: now
    !> One on the nodes in contact; or no constraint at all (n, 1 or 0)
    real(wp), intent(in) :: constraint(:, :)
    !> The pressure, zero off the contact (n, 1 or 0)
    real(wp), allocatable, intent(out) :: mb(:, :)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    integer :: i, k

    if (.not. allocated(now%lift)) then
      call precondition_constraints(now%pressure, now%contact, constraint, now%lift, error)
      if (allocated(error)) return
    end if
    allocate (mb, mold=now%lift)
    do k = 1, size(mb, 2)
      !$omp parallel do schedule(static) num_threads(now%pressure%space%threads)
      do i = 1, size(mb, 1)
        mb(i, k) = merge(now%lift(i, k), 0.0_wp, now%contact(i))
      end do
      !$omp end parallel do
    end do
  end subroutine lift_pressure

  !> About the shear traction that rigid motions of the unknowns cause: worked out once a step, if it serves.
  subroutine drag_shear(now, active, constraint, afresh, mb, error)
    !> Tractions and motions
    type(iterate_t), intent(inout) :: now
    !> Unknowns, in the frames (2 n)
    logical, intent(in), contiguous :: active(:)
    !> Constraint vectors, in the frames (2 n, number of constraints)
    real(wp), intent(in), contiguous :: constraint(:, :)
    !> Work it out again
    logical, intent(in) :: afresh
    !> The traction, in the frames (2 n, number of constraints)
    real(wp), allocatable, intent(out) :: mb(:, :)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    integer :: k
    logical :: known

    known = allocated(now%drag) .and. .not. afresh
    if (known) known = size(now%drag, 2) == size(constraint, 2)
    if (known) then
      allocate (mb, mold=constraint)
      do k = 1, size(mb, 2)
        call now%shear%soften(constraint(:, k), now%drag(:, k), active, mb(:, k))
      end do
    else
      call precondition_constraints(now%shear, active, constraint, mb, error)
      if (allocated(error)) return
      if (allocated(now%drag)) deallocate (now%drag)
      allocate (now%drag, mold=mb)
      do k = 1, size(mb, 2)
        call now%shear%to_plane(mb(:, k), now%drag(:, k))
      end do
    end if
  end subroutine drag_shear

end module hc_staggered_newton
