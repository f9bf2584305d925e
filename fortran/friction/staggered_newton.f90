!> A staggered sweep: a step of Newton's method for the pressure, then one for the shear traction.
!>
!> Both methods on FFTs, this one and coupled_newton, solve F(p, q, motions) = 0 at the end of a load step
!> (docs/theory/friction.md),
!>
!>     F_p = p - max(0, p - r' g),     g = h + w(p, q) - approach,                      (F1), (F2)
!>     F_q = q - P(q - r ds),         ds = u(p, q) - shift - twist x r - s^n,           (F1), (F3)
!>     F_m = (sum A p - P,  sum A q - Q,  sum A (x q_y - y q_x) - M_z),                 (F4)
!>
!> with P the projection on what the law of friction allows under p (Alart & Curnier, Comput. Methods Appl. Mech. Eng. 92,
!> 1991); a motion that is prescribed has no component of F_m. The linearisation is that of the branch on which each node
!> lies (semismooth Newton: Hintermueller, Ito & Kunisch, SIAM J. Optim. 13, 2003): g = 0 on the contact, ds = 0 in stick,
!> and in slip q = mu p e + tau t with t.ds + D tau = 0, (F5), (F6). A sweep is one pass of block Gauss-Seidel over it:
!>
!> 1. `solve_pressure`: the contact C by (F5), and (F9), T_pp p - approach = -h - T_pq q on C with sum A p = P, the approach its
!>    multiplier, by conjugate gradients at constant load (Polonsky & Keer, Wear 231, 1999, with a preconditioner);
!> 2. `solve_shear`: stick, slip, directions e and compliances D by (F5), (F6), with r of (F8);
!> 3. and (F10), (E^T T_qq E + D) (q, tau) - E^T B motions = E^T (s^n - T_qp p - T_qq mu p e), with the prescribed loads, by the
!>    same conjugate gradients; where nothing resists a load, nodes are fixed in stick; where the residual does not fall, the
!>    step is damped (hc_globalization);
!> 4. the closing of the gap by the shear traction, cut to the cone, and the residuals R_n and R_t, which take no product more.
!>
!> Linear problems are solved no more accurately than the sets deserve; the numbers are those of `newton_options_t`.
module hc_staggered_newton
  use hc_precision, only: wp, sp
  use hc_error, only: error_t
  use hc_options, only: newton_options_t
  use hc_contact_state, only: normal, along_x, along_y, n_motion, force_control
  use hc_load_constraints, only: driven_motions_t
  use hc_active_zones, only: find_contact, linearize_law, classify, find_constraints, find_prescribed_displacement
  use hc_friction_iterate, only: friction_iterate_t
  use hc_front_relaxation, only: relax_fronts
  use hc_active_set, only: active_set_t, new_active_set
  use hc_linear_system, only: precondition_constraints, satisfy_constraints, step_ahead, solution_accurate
  use hc_step_equation, only: solve_step_equation
  implicit none
  private

  public :: staggered_sweep, find_punch_pressure, find_rigid_traction

contains

  !> Solve for the pressure, then for the shear traction, each under the displacements by the other.
  subroutine staggered_sweep(now, error)
    !> Tractions and motions
    type(friction_iterate_t), intent(inout), target :: now
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: q(:)
    logical :: judged

    now%outcome = solution_accurate
    ! the pressure is found under the shear traction: what each of them causes has to be known
    if (now%joint) call now%refresh(error)
    if (allocated(error)) return
    ! 1.
    call solve_pressure(now, error)
    if (allocated(error)) return
    if (now%shear_feels_pressure .and. now%without_start .and. now%first) then
      call now%operators%apply([normal], now%p, [along_x, along_y], now%u, error)
      if (allocated(error)) return
    end if
    ! R_t of the old shear traction under the new pressure: what the step has to reduce
    if (.not. now%first) call now%find_tangential_residual()
    ! 2. and 3.
    call solve_shear(now, judged, error)
    if (allocated(error)) return
    ! 4.
    if (now%pressure_feels_shear) then
      allocate (q(2*size(now%p)))
      call now%project_to_cone(q)
      call now%operators%apply([along_x, along_y], q, [normal], now%closing, error)
      if (allocated(error)) return
      now%cut = .true.
    end if
    call now%find_residuals(judged)
    now%first = .false.
  end subroutine staggered_sweep

  !> Solve for the pressure under the present shear traction, (F9).
  subroutine solve_pressure(now, error)
    !> Tractions and motions
    type(friction_iterate_t), intent(inout) :: now
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    real(wp), allocatable :: gap(:), rhs(:), constraint(:, :), mb(:, :)
    logical, allocatable :: contact(:)
    type(active_set_t) :: nodes
    type(newton_options_t) :: options
    real(wp) :: goal, scale, residual, drift, multiplier(1), missing(1), cell_area, carried, level
    integer :: n, i, area, n_constraint, iterations, outcome
    logical :: changed, independent, searching, compliant, unknown_gap, estimated

    n = size(now%p)
    options = now%problem%options%newton
    ! a start without contact: the contact without shear is found before stick and slip
    searching = now%without_start .and. now%first
    compliant = now%problem%normal_law%is_compliant()
    cell_area = now%problem%lattice%cell_area()
    n_constraint = merge(1, 0, now%target%control(normal) == force_control)
    level = merge(0.0_wp, now%motion(normal), n_constraint == 1)
    estimated = now%estimated
    now%estimated = .false.
    do area = 1, merge(options%max_areas, options%max_areas_uncoupled, now%pressure_feels_shear .and. .not. searching)
      call now%find_gap(gap)
      now%residual_normal = now%gap_residual(gap)
      missing = 0.0_wp
      carried = now%pressure%space%sum(now%p)
      if (n_constraint == 1) missing = now%target%value(normal)/cell_area - carried
      if (now%residual_normal <= options%final_pressure*now%tolerance .and. &
          abs(missing(1)) <= options%final_pressure*now%tolerance*carried) then
        if (.not. estimated) return
        ! a pressure that may stay as it is, if that is so without errors of interpolation
        estimated = .false.
        call now%pressure%product(now%p, now%w, error)
        if (allocated(error)) return
        call now%pressure%stretch(-1.0_wp, now%p, now%w)
        call now%find_gap(gap)
        now%residual_normal = now%gap_residual(gap)
        if (now%residual_normal <= options%final_pressure*now%tolerance) return
      end if
      estimated = .false.
      changed = now%first .and. area == 1
      if (.not. (changed .and. now%without_start)) then
        call find_contact(now, gap, contact)
        if (.not. changed) changed = now%pressure%space%count(contact .neqv. now%contact) > 0
        call move_alloc(contact, now%contact)
      end if
      if (searching .and. now%pressure_feels_shear .and. .not. changed .and. &
          .not. (compliant .and. now%residual_normal > options%settled_residual)) return
      ! a first pressure has the load, but no gap yet
      unknown_gap = changed .and. now%without_start .and. now%first .and. area == 1 .and. n_constraint == 1
      if (compliant .and. .not. unknown_gap) call linearize_law(now, gap, .false.)

      if (changed .and. (.not. compliant .or. unknown_gap)) call now%operators%normal%set_active(now%contact)
      if (searching .and. now%pressure_feels_shear .and. allocated(now%punch_pressure)) deallocate (now%punch_pressure)
      call new_active_set(nodes, now%contact, now%pressure%space)
      if (allocated(constraint)) deallocate (constraint)
      allocate (constraint(nodes%n_active, n_constraint), source=1.0_wp)
      allocate (rhs(n))
      !$omp parallel do schedule(static) num_threads(now%pressure%space%threads)
      do i = 1, n
        rhs(i) = level - now%h(i)
        if (now%pressure_feels_shear) rhs(i) = rhs(i) - now%closing(i)
        if (changed) now%p(i) = merge(max(now%p(i), 0.0_wp), 0.0_wp, now%contact(i))
      end do
      !$omp end parallel do
      call find_punch_pressure(now, nodes, constraint, mb, error)
      if (allocated(error)) return
      if (changed) then
        if (n_constraint == 1) then
          missing = now%target%value(normal)/cell_area - now%pressure%space%sum(now%p)
          call satisfy_constraints(constraint, mb, missing, now%p, independent, now%pressure%space, nodes)
        end if
        if (compliant .and. unknown_gap) call linearize_law(now, gap, .true.)
        call now%pressure%product(now%p, now%w, error)
        if (allocated(error)) return
      else
        call now%pressure%stretch(1.0_wp, now%p, now%w)
      end if
      if (compliant) rhs = rhs - now%pressure%offset
      goal = options%final_pressure*now%tolerance
      if (changed .or. compliant .or. now%pressure_feels_shear) then
        goal = max(options%pressure_accuracy*min(now%residual_normal, 1.0_wp), goal)
      end if
      scale = now%pressure%space%max(now%p)
      if (compliant) then
        scale = now%problem%sprung_compliance(scale)*scale
      else
        scale = now%problem%normal_compliance*scale
      end if
      call solve_step_equation(now%pressure, nodes, constraint, mb, rhs, now%p, now%w, goal*scale, options%max_iterations, &
                        multiplier(:n_constraint), residual, iterations, outcome, error, drift)
      if (allocated(error)) return
      if (drift > options%displacement_rounding*scale) call now%pressure%product(now%p, now%w, error)
      if (allocated(error)) return
      call now%pressure%stretch(-1.0_wp, now%p, now%w)
      now%outcome = max(now%outcome, outcome)
      if (n_constraint == 1) now%motion(normal) = multiplier(1)
    end do
  end subroutine solve_pressure

  !> Solve for the shear traction under the present pressure, (F10).
  subroutine solve_shear(now, judged, error)
    !> Tractions and motions
    type(friction_iterate_t), intent(inout), target :: now
    !> R_t is that of the traction found
    logical, intent(out) :: judged
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    real(wp), allocatable :: x(:), ax(:), rhs(:), constraint(:, :), mb(:, :), q(:)
    logical, allocatable :: active(:)
    type(active_set_t) :: nodes, loaded
    real(wp), allocatable :: missing(:), multiplier(:)
    type(driven_motions_t) :: driven
    type(newton_options_t) :: options
    real(wp) :: goal, highest, scale, residual, drift, share, rounding, motion(n_motion)
    integer :: n, iterations, outcome
    logical :: independent, fixing, sticks

    n = size(now%p)
    options = now%problem%options%newton
    judged = .false.
    if (.not. now%problem%friction%resists()) then
      now%q = 0.0_wp
      return
    end if
    call relax_fronts(now)
    ! the traction before, where there is one
    active = .not. (abs(now%q(:n)) <= 0.0_wp .and. abs(now%q(n + 1:)) <= 0.0_wp)
    call new_active_set(loaded, [active, active], now%shear%space)
    allocate (q(loaded%n_active))
    call loaded%pack(now%q, q)
    fixing = .false.
    highest = now%traction_scale()
    scale = now%problem%tangential_compliance*highest
    do
      call classify(now, fixing, active)
      call new_active_set(nodes, active, now%shear%space)
      call nodes%pair(2*n)
      sticks = any(active(n + 1:))
      deallocate (active)
      call find_constraints(now, nodes, driven, constraint, missing)
      multiplier = driven%multipliers(now%motion)
      call find_rigid_traction(now, nodes, constraint, .false., mb, error)
      if (allocated(error)) return
      ! traction and displacement stay where they are, in the frames: a window is too large for copies
      call move_alloc(now%q, x)
      call now%shear%turn(x)
      call satisfy_constraints(constraint, mb, missing, x, independent, now%shear%space, nodes)
      if (.not. independent) then
        call find_rigid_traction(now, nodes, constraint, .true., mb, error)
        if (allocated(error)) return
        call satisfy_constraints(constraint, mb, missing, x, independent, now%shear%space, nodes)
      end if
      if (independent) then
        ! motions that are prescribed are known; the others are multipliers
        allocate (rhs(2*n))
        call find_prescribed_displacement(now, rhs)
        call now%shear%add_rest(rhs)
        if (size(missing) == 0 .or. fixing .or. sticks) then
          call move_alloc(now%u, ax)
        else
          ! the old displacements may be needed again
          allocate (ax(2*n))
          call now%shear%space%copy(now%u, ax)
        end if
        ! the pressure moves what u does not contain yet
        if (.not. (now%first .or. now%shear_feels_pressure) .and. now%residual_tangential < options%residual_ahead) then
          call now%shear%add_springs(x, ax)
          call step_ahead(now%shear, nodes, constraint, mb, constraint, rhs, ax, multiplier, options%length_ahead, x, error)
          if (allocated(error)) return
        end if
        call displace(now, x, ax, error)
        if (allocated(error)) return
        ! Newton's method alone converges the faster the more accurate its steps are
        goal = min(now%residual_tangential, 1.0_wp)
        goal = goal*min(options%inner_accuracy, max(goal, merge(options%late_accuracy, options%uncoupled_accuracy, &
                                                              now%pressure_feels_shear)))
        goal = max(goal, options%final_accuracy*now%tolerance)
        call solve_step_equation(now%shear, nodes, constraint, mb, rhs, x, ax, goal*scale, options%max_iterations, multiplier, &
                          residual, iterations, outcome, error, drift)
        if (allocated(error)) return
        if (drift > options%displacement_rounding*scale) call displace(now, x, ax, error)
        if (allocated(error)) return
        now%outcome = max(now%outcome, outcome)
      end if
      now%unsupported = .not. independent
      if (size(missing) == 0 .or. fixing) exit
      ! where all nodes slip, only their directions resist a load: not beyond reason
      if (independent) then
        if (sticks) exit
        if (now%shear%space%max_abs(x(:n)) <= options%most_across*highest) exit
        deallocate (ax)
      end if
      fixing = .true.
      call now%globalization%cut(options%cautious_share, options)
      call take_back()
    end do
    deallocate (constraint, mb)
    if (now%unsupported) then
      call take_back()
      call now%refresh(error)
      return
    end if
    motion = now%motion
    call driven%set_motions(multiplier, now%motion)
    call take(x, ax)
    call now%find_tangential_residual()
    judged = .true.
    call now%globalization%step_share(now%residual_tangential, options, share)
    if (share < 1.0_wp) then
      judged = .false.
      ! Newton's method oscillates: any iterate between carries the same loads
      call move_alloc(now%q, x)
      call take_back()
      x = merge(now%q + share*(x - now%q), 0.0_wp, [now%contact, now%contact])
      deallocate (now%q)
      now%motion = motion + share*(now%motion - motion)
      call now%shear%turn(x)
      call move_alloc(now%u, ax)
      call displace(now, x, ax, error)
      if (allocated(error)) return
      call take(x, ax)
    end if
    if (rounding > options%displacement_rounding*scale) then
      judged = .false.
      call now%refresh(error)
    end if

  contains

    !> Take the traction before.
    subroutine take_back()
      if (.not. allocated(now%q)) allocate (now%q(2*n))
      call now%shear%space%fill(now%q, 0.0_wp)
      call loaded%unpack(q, now%q)
    end subroutine take_back

    !> Take a traction and its displacement out of the frames.
    subroutine take(traction, displacement)
      !> Traction, and displacement with the springs, in the frames (2 n)
      real(wp), allocatable, intent(inout) :: traction(:), displacement(:)

      call now%shear%leave_frames(traction, displacement, rounding)
      call move_alloc(traction, now%q)
      call move_alloc(displacement, now%u)
    end subroutine take

  end subroutine solve_shear

  !> Compute the displacements by a shear traction and the pressure together, springs included.
  subroutine displace(now, x, ax, error)
    !> Tractions and motions
    type(friction_iterate_t), intent(inout) :: now
    !> Shear traction, in the frames (2 n)
    real(wp), intent(in), contiguous, target :: x(:)
    !> Tangential displacement, in the frames (2 n)
    real(wp), intent(out), contiguous, target :: ax(:)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: traction(:)
    integer :: n

    if (.not. now%shear_feels_pressure) then
      call now%shear%product(x, ax, error)
      return
    end if
    n = size(now%p)
    allocate (traction(3*n))
    call now%shear%space%copy(now%p, traction(:n))
    call now%shear%space%copy(x, traction(n + 1:))
    call now%shear%turn(traction(n + 1:))
    call now%operators%apply([normal, along_x, along_y], traction, [along_x, along_y], ax, error)
    if (allocated(error)) return
    call now%shear%add_springs(x, ax)
  end subroutine displace

  !> Estimate the pressure that an approach of the nodes in contact causes, V of (F11): made once a step.
  subroutine find_punch_pressure(now, nodes, constraint, mb, error)
    !> Tractions and motions
    type(friction_iterate_t), intent(inout) :: now
    !> Nodes in contact
    type(active_set_t), intent(in) :: nodes
    !> One at these nodes; or no constraint at all (n_active, 1 or 0)
    real(wp), intent(in), contiguous :: constraint(:, :)
    !> The pressure there (n_active, 1 or 0)
    real(wp), allocatable, intent(out) :: mb(:, :)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: pressure(:)
    integer :: k

    allocate (pressure(merge(size(now%p), 0, size(constraint, 2) > 0)))
    if (.not. allocated(now%punch_pressure)) then
      call precondition_constraints(now%pressure, nodes, size(now%p), constraint, mb, error)
      if (allocated(error)) return
      allocate (now%punch_pressure(size(pressure), size(mb, 2)))
      do k = 1, size(mb, 2)
        call now%pressure%space%fill(pressure, 0.0_wp)
        call nodes%unpack(mb(:, k), pressure)
        now%punch_pressure(:, k) = real(pressure, sp)
      end do
      return
    end if
    allocate (mb, mold=constraint)
    do k = 1, size(mb, 2)
      pressure = now%punch_pressure(:, k)
      call nodes%pack(pressure, mb(:, k))
    end do
  end subroutine find_punch_pressure

  !> Estimate the shear traction that rigid motions of the unknowns cause, V of (F11): made once a step, if it serves.
  subroutine find_rigid_traction(now, nodes, constraint, afresh, mb, error)
    !> Tractions and motions
    type(friction_iterate_t), intent(inout) :: now
    !> Unknowns, in the frames (of 2 n)
    type(active_set_t), intent(in) :: nodes
    !> Constraint vectors at the unknowns (n_active, number of constraints)
    real(wp), intent(in), contiguous :: constraint(:, :)
    !> Make it again
    logical, intent(in) :: afresh
    !> The traction there (n_active, number of constraints)
    real(wp), allocatable, intent(out) :: mb(:, :)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: plane(:)
    integer :: n, k, n_t
    logical :: known

    n = size(now%p)
    n_t = nodes%pairs%n_first
    known = allocated(now%rigid_traction) .and. .not. afresh
    if (known) known = size(now%rigid_traction, 2) == size(constraint, 2)
    if (known) then
      allocate (mb, mold=constraint)
      do k = 1, size(mb, 2)
        call now%shear%apply_slip_compliance(nodes%pairs, constraint(:n_t, k), constraint(n_t + 1:, k), now%rigid_traction(:, k), &
                                             mb(:n_t, k), mb(n_t + 1:, k))
      end do
    else
      call precondition_constraints(now%shear, nodes, 2*n, constraint, mb, error)
      if (allocated(error)) return
      if (allocated(now%rigid_traction)) deallocate (now%rigid_traction)
      allocate (now%rigid_traction(2*n, size(mb, 2)))
      if (size(mb, 2) > 0) allocate (plane(2*n))
      do k = 1, size(mb, 2)
        call now%shear%space%fill(plane, 0.0_wp)
        call now%shear%put_in_plane(nodes%pairs, mb(:n_t, k), mb(n_t + 1:, k), plane)
        now%rigid_traction(:, k) = real(plane, sp)
      end do
    end if
  end subroutine find_rigid_traction

end module hc_staggered_newton
