!> A staggered sweep: a step of Newton's method for the pressure, then one for the shear traction.
!>
!> Both methods on FFTs, this one and coupled_newton, solve F(p, q, motions) = 0 at the end of a load step
!> (docs/theory/friction.md),
!>
!>     F_p = p - max(0, p - r' g),     g = h + w(p, q) - approach,                      (F1), (F2)
!>     F_q = q - P(q - r ds),         ds = u(p, q) - shift - twist x r - s^n,           (F1), (F3)
!>     F_m = (sum A p - P,  sum A q - Q,  sum A (x q_y - y q_x) - M_z),                 (F4)
!>
!> with P the projection on the admissible tractions under p (Alart & Curnier, Comput. Methods Appl. Mech. Eng. 92,
!> 1991); a motion that is prescribed has no component of F_m. The linearisation is that of the branch on which each node
!> lies (semismooth Newton: Hintermueller, Ito & Kunisch, SIAM J. Optim. 13, 2003): g = 0 on the contact, ds = 0 in stick,
!> and in slip q = mu p e + tau t with t.ds + D tau = 0, (F5), (F6). A sweep is one pass of block Gauss-Seidel over it:
!>
!> 1. `solve_pressure`: the contact C by (F5), and (F9), T_pp p - approach = -h - T_pq q on C with sum A p = P, the approach its
!>    multiplier, by conjugate gradients at constant load (Polonsky & Keer, Wear 231, 1999, with a preconditioner);
!> 2. `solve_shear`: stick, slip, directions e and compliances D by (F5), (F6), with r of (F8);
!> 3. and (F10), (E^T T_qq E + D) (q, tau) - E^T B motions = E^T (s^n - T_qp p - T_qq mu p e), with the prescribed loads, by the
!>    same conjugate gradients; where nothing resists a load, nodes are fixed in stick;
!> 4. the closing of the gap by the shear traction, cut to the cone, and the residuals R_n and R_t, which take no product more.
!>
!> The tolerance of linear problems is loose while the sets change; the numbers are those of `newton_options_t`.
module hc_staggered_newton
  use hc_precision, only: wp, sp, lk
  use hc_error, only: error_t, status, raise
  use hc_memory, only: give_back
  use hc_options, only: newton_options_t
  use hc_contact_state, only: normal, along_x, along_y, n_motion, force_control
  use hc_load_constraints, only: driven_motions_t
  use hc_active_zones, only: linearize_law, classify, find_constraints, find_prescribed_displacement
  use hc_friction_iterate, only: friction_iterate_t
  use hc_front_relaxation, only: relax_fronts
  use hc_active_set, only: active_set_t, new_active_set, new_packed_fields
  use hc_linear_system, only: constraints_t, iteration_t, precondition_constraints, step_ahead, solution_accurate
  use hc_step_equation, only: solve_step_equation
  implicit none
  private

  public :: staggered_sweep, find_punch_pressure, find_rigid_traction

  !> A shear traction that is solved for, with its displacement.
  type :: shear_solution_t
    !> Traction in the frames [Pa], at the unknowns, and at other nodes where it is not zero
    real(wp), allocatable :: unknown(:), given(:)
    type(active_set_t) :: fixed
    !> Displacement with the springs, in the frames (2 n) [m]
    real(wp), allocatable :: ax(:)
    !> Motions that are driven by their loads, the loads as constraints, and the defect of the start
    type(driven_motions_t) :: driven
    type(constraints_t) :: constraints
    real(wp), allocatable :: missing(:)
    !> Displacement of a node under the largest traction [m]
    real(wp) :: scale = 0.0_wp
    !> Some node sticks; the loads determine the motions
    logical :: sticks = .false., independent = .false.
    !> It is taken however large it is: no further attempt follows
    logical :: is_last = .false.
  end type shear_solution_t

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
    ! the pressure is found under the shear traction: the displacements by each of them are needed
    if (now%joint) call now%refresh(error)
    if (allocated(error)) return
    ! 1.
    call solve_pressure(now, error)
    if (allocated(error)) return
    if (now%shear_feels_pressure .and. now%without_start .and. now%first) then
      call now%operators%apply([normal], now%p, [along_x, along_y], now%u, error)
      if (allocated(error)) return
    end if
    ! R_t of the old shear traction under the new pressure, which the step has to reduce
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

    real(wp), allocatable :: gap(:)
    logical(lk), allocatable :: contact(:)
    type(newton_options_t) :: options
    integer :: area, n_contact
    logical :: changed, searching, estimated, accurate

    options = now%problem%options%newton
    ! a start without contact: the contact without shear is found before stick and slip
    searching = now%without_start .and. now%first
    estimated = now%estimated
    now%estimated = .false.
    do area = 1, merge(1, options%max_areas_uncoupled, now%pressure_feels_shear .and. .not. searching)
      call now%find_gap(gap)
      call judge_pressure(now, estimated, gap, accurate, error)
      if (allocated(error) .or. accurate) return
      estimated = .false.
      changed = now%first .and. area == 1
      if (.not. (changed .and. now%without_start)) then
        allocate (contact(size(gap)))
        n_contact = now%pressure%space%count(now%contact)
        call now%problem%find_contact(n_contact, now%p, gap, now%candidate, contact)
        if (.not. changed) changed = now%pressure%space%count(contact .neqv. now%contact) > 0
        call move_alloc(contact, now%contact)
      end if
      if (searching .and. now%pressure_feels_shear) then
        if (.not. changed .and. .not. (now%problem%normal_law%is_compliant() .and. &
                                       now%residual_normal > options%settled_residual)) return
        ! that of another set
        if (allocated(now%punch_pressure)) deallocate (now%punch_pressure)
      end if
      call solve_on_contact(now, gap, changed, searching .and. area == 1, error)
      if (allocated(error)) return
    end do
  end subroutine solve_pressure

  !> Compute R_n, and decide whether the pressure remains.
  subroutine judge_pressure(now, estimated, gap, accurate, error)
    !> Tractions and motions
    type(friction_iterate_t), intent(inout) :: now
    !> The closing of the gap has errors of interpolation: the pressure stays only if it may without them
    logical, intent(in) :: estimated
    !> The gap; computed again where the closing is (n) [m]
    real(wp), allocatable, intent(inout) :: gap(:)
    !> It may stay
    logical, intent(out) :: accurate
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: bound, carried, missing

    bound = now%problem%options%newton%final_pressure*now%tolerance
    now%residual_normal = now%gap_residual(gap)
    missing = 0.0_wp
    carried = now%pressure_sum()
    if (now%target%control(normal) == force_control) then
      missing = now%target%value(normal)/now%problem%lattice%cell_area() - carried
    end if
    accurate = now%residual_normal <= bound .and. abs(missing) <= bound*carried
    if (.not. (accurate .and. estimated)) return
    call now%pressure%product(now%p, now%w, error)
    if (allocated(error)) return
    call now%pressure%stretch(-1.0_wp, now%p, now%w)
    call now%find_gap(gap)
    now%residual_normal = now%gap_residual(gap)
    accurate = now%residual_normal <= bound
  end subroutine judge_pressure

  !> Solve (F9) on the nodes in contact by conjugate gradients at constant load.
  subroutine solve_on_contact(now, gap, changed, is_first, error)
    !> Tractions and motions
    type(friction_iterate_t), intent(inout) :: now
    !> Gap of the present tractions [m]
    real(wp), intent(in), contiguous :: gap(:)
    !> The contact is another one; it is the first one of a start without contact
    logical, intent(in) :: changed, is_first
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    type(active_set_t) :: nodes
    type(constraints_t) :: constraints
    type(iteration_t) :: iteration
    type(newton_options_t) :: options
    real(wp), allocatable :: rhs(:), given(:), unknown(:)
    real(wp) :: scale, level, missing(1)
    logical :: by_load, compliant, unknown_gap, independent
    integer :: i

    options = now%problem%options%newton
    compliant = now%problem%normal_law%is_compliant()
    by_load = now%target%control(normal) == force_control
    level = merge(0.0_wp, now%motion(normal), by_load)
    ! a first pressure has the load, but no gap yet
    unknown_gap = changed .and. is_first .and. by_load
    if (compliant .and. .not. unknown_gap) call linearize_law(now, gap, .false.)
    if (changed .and. (.not. compliant .or. unknown_gap)) call now%operators%normal%set_active(now%contact)
    call new_active_set(nodes, now%contact, now%pressure%space, now%problem%own_extent())
    allocate (constraints%columns(nodes%n_active, merge(1, 0, by_load)), source=1.0_wp)
    allocate (given(size(gap)))
    !$omp parallel do schedule(static) num_threads(now%pressure%space%threads)
    do i = 1, size(given)
      given(i) = level - now%h(i)
      if (now%pressure_feels_shear) given(i) = given(i) - now%closing(i)
      if (changed) now%p(i) = merge(max(now%p(i), 0.0_wp), 0.0_wp, now%contact(i))
    end do
    !$omp end parallel do
    call find_punch_pressure(now, nodes, constraints%columns, constraints%mb)
    if (changed) then
      ! the pressure on another contact carries the load
      if (by_load) then
        missing = now%target%value(normal)/now%problem%lattice%cell_area() - now%pressure_sum()
        call constraints%satisfy(nodes%space, missing, now%p, independent, nodes)
      end if
      if (compliant .and. unknown_gap) call linearize_law(now, gap, .true.)
      call now%pressure%product(now%p, now%w, error)
      if (allocated(error)) return
    else
      call now%pressure%stretch(1.0_wp, now%p, now%w)
    end if
    if (compliant) given = given - now%pressure%offset
    allocate (rhs(nodes%n_active))
    call nodes%pack(given, rhs)
    deallocate (given)
    scale = now%pressure%space%max(now%p)
    scale = now%problem%sprung_compliance(scale)*scale
    iteration%tolerance = options%final_pressure*now%tolerance
    if (changed .or. compliant .or. now%pressure_feels_shear) then
      iteration%tolerance = max(options%inner_accuracy*min(now%residual_normal, 1.0_wp), iteration%tolerance)
    end if
    iteration%tolerance = iteration%tolerance*scale
    iteration%most = options%max_iterations
    allocate (unknown(nodes%n_active))
    call nodes%pack(now%p, unknown)
    call solve_step_equation(now%pressure, nodes, constraints, rhs, unknown, now%w, iteration, error)
    if (allocated(error)) return
    call nodes%unpack(unknown, now%p)
    if (iteration%drift > options%displacement_rounding*scale) call now%pressure%product(now%p, now%w, error)
    if (allocated(error)) return
    call now%pressure%stretch(-1.0_wp, now%p, now%w)
    now%outcome = max(now%outcome, iteration%outcome)
    if (by_load) now%motion(normal) = constraints%multiplier(1)
  end subroutine solve_on_contact

  !> Solve for the shear traction under the present pressure, (F10).
  subroutine solve_shear(now, judged, error)
    !> Tractions and motions
    type(friction_iterate_t), intent(inout), target :: now
    !> R_t is that of the traction found
    logical, intent(out) :: judged
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    type(shear_solution_t) :: found
    type(active_set_t) :: loaded
    real(wp), allocatable :: before(:)
    type(newton_options_t) :: options
    real(wp) :: highest
    integer :: n
    logical :: fixing

    n = size(now%p)
    options = now%problem%options%newton
    judged = .false.
    if (.not. now%problem%friction%resists()) then
      now%q = 0.0_wp
      return
    end if
    call give_back(2*n)
    call relax_fronts(now)
    call keep_traction(now, loaded, before)
    highest = now%traction_scale()
    found%scale = now%problem%tangential_compliance*highest
    fixing = .false.
    do
      call solve_on_zones(now, fixing, found, before, error)
      if (allocated(error)) return
      now%unsupported = .not. found%independent
      if (found%is_last .or. size(found%missing) == 0 .or. fixing) exit
      ! where all nodes slip, only their directions resist a load: limit the step along them
      if (found%independent) then
        if (now%shear%space%max_abs(now%q(:n)) <= options%most_across*highest) exit
        deallocate (found%ax)
      end if
      fixing = .true.
      call now%cut_parameter(options%cautious_share)
      call restore_traction(now, loaded, before)
    end do
    deallocate (found%constraints%columns, found%constraints%mb)
    if (now%unsupported) then
      call restore_traction(now, loaded, before)
      call now%refresh(error)
    else
      call take_solution(now, found, judged, error)
    end if
  end subroutine solve_shear

  !> Keep the shear traction, where there is any.
  subroutine keep_traction(now, loaded, before)
    !> Tractions and motions
    type(friction_iterate_t), intent(in) :: now
    !> Nodes with a shear traction (of 2 n)
    type(active_set_t), intent(out) :: loaded
    !> The traction there [Pa]
    real(wp), allocatable, intent(out) :: before(:)
    logical(lk) :: active(size(now%p))
    integer :: n

    n = size(now%p)
    active = .not. (abs(now%q(:n)) <= 0.0_wp .and. abs(now%q(n + 1:)) <= 0.0_wp)
    call new_active_set(loaded, [active, active], now%shear%space)
    allocate (before(loaded%n_active))
    call loaded%pack(now%q, before)
  end subroutine keep_traction

  !> Restore the shear traction that was kept.
  subroutine restore_traction(now, loaded, before)
    !> Tractions and motions
    type(friction_iterate_t), intent(inout) :: now
    !> Nodes with a shear traction (of 2 n), and the traction there [Pa]
    type(active_set_t), intent(in) :: loaded
    real(wp), intent(in), contiguous :: before(:)

    if (.not. allocated(now%q)) allocate (now%q(2*size(now%p)))
    call now%shear%space%fill(now%q, 0.0_wp)
    call loaded%unpack(before, now%q)
  end subroutine restore_traction

  !> Classify the nodes, and solve (F10) for their traction in the frames; the traction of the iterate moves there.
  subroutine solve_on_zones(now, fixing, found, before, error)
    !> Tractions and motions
    type(friction_iterate_t), intent(inout), target :: now
    !> Fix some nodes in stick where none sticks
    logical, intent(in) :: fixing
    !> The solution
    type(shear_solution_t), intent(inout) :: found
    !> The traction before, freed where the solution is taken however large it is
    real(wp), allocatable, intent(inout) :: before(:)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    type(active_set_t) :: nodes
    logical(lk), allocatable :: active(:)
    integer :: n, try

    n = size(now%p)
    call classify(now, fixing, active)
    call new_active_set(nodes, active, now%shear%space, now%problem%own_extent())
    call nodes%pair(2*n)
    found%sticks = now%shear%space%count(active(n + 1:)) > 0
    deallocate (active)
    call give_back(2*n)
    associate (constraints => found%constraints)
      call find_constraints(now, nodes, found%driven, constraints%columns, found%missing)
      constraints%multiplier = found%driven%multipliers(now%motion)
      ! traction and displacement stay where they are, in the frames: a window is too large for copies
      call now%shear%turn(now%q)
      call nodes%pack_all(now%q, found%unknown, found%fixed, found%given)
      do try = 1, 2
        call find_rigid_traction(now, nodes, constraints%columns, try == 2, constraints%mb, error)
        if (allocated(error)) return
        call constraints%satisfy(nodes%space, found%missing, found%unknown, found%independent)
        if (found%independent) exit
      end do
    end associate
    if (.not. found%independent) return
    found%is_last = size(found%missing) == 0 .or. fixing .or. found%sticks
    if (found%is_last) deallocate (before)
    call solve_in_frames(now, nodes, found, error)
  end subroutine solve_on_zones

  !> Solve (F10) by conjugate gradients from a traction that carries the prescribed loads.
  subroutine solve_in_frames(now, nodes, found, error)
    !> Tractions and motions; its displacements may move to the solution
    type(friction_iterate_t), intent(inout) :: now
    !> Unknowns (of 2 n)
    type(active_set_t), intent(in) :: nodes
    !> The solution, on entry its start
    type(shear_solution_t), intent(inout) :: found
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    type(iteration_t) :: iteration
    type(newton_options_t) :: options
    real(wp), allocatable :: rhs(:)
    real(wp) :: goal, scale
    integer :: n

    options = now%problem%options%newton
    n = size(now%u)
    if (found%is_last) then
      call move_alloc(now%u, found%ax)
    else
      ! the old displacements may be needed again
      allocate (found%ax(n))
      call now%shear%space%copy(now%u, found%ax)
    end if
    ! the pressure moves what u does not contain yet
    if (.not. (now%first .or. now%shear_feels_pressure) .and. now%residual_tangential < options%residual_ahead) then
      call now%shear%add_springs(found%unknown(:nodes%pairs%n_first), found%ax)
      call find_rhs(now, nodes, n, rhs, error)
      if (allocated(error)) return
      call step_ahead(now%shear, nodes, found%constraints, rhs, found%ax, options%length_ahead, found%unknown)
    end if
    call displace(now, nodes, found, error)
    if (allocated(error)) return
    call find_rhs(now, nodes, n, rhs, error)
    if (allocated(error)) return
    ! Newton's method alone converges the faster the more accurate its steps are
    goal = min(now%residual_tangential, 1.0_wp)
    goal = goal*min(options%inner_accuracy, max(goal, merge(options%late_accuracy, options%uncoupled_accuracy, &
                                                            now%pressure_feels_shear)))
    scale = found%scale
    iteration = iteration_t(tolerance=max(goal, options%final_accuracy*now%tolerance)*scale, most=options%max_iterations)
    call solve_step_equation(now%shear, nodes, found%constraints, rhs, found%unknown, found%ax, iteration, error)
    if (allocated(error)) return
    now%rounding = iteration%rounding
    if (iteration%drift > options%displacement_rounding*scale) then
      now%rounding = 0.0_wp
      call displace(now, nodes, found, error)
      if (allocated(error)) return
    end if
    call nodes%unpack_all(n, found%unknown, found%fixed, found%given, now%q)
    now%outcome = max(now%outcome, iteration%outcome)
  end subroutine solve_in_frames

  !> Find the right-hand side of (F10), in memory of the operator: prescribed motions are known; the others are multipliers.
  subroutine find_rhs(now, nodes, n, rhs, error)
    !> Tractions and motions
    type(friction_iterate_t), intent(in) :: now
    !> Unknowns (of 2 n), and number of all components
    type(active_set_t), intent(in) :: nodes
    integer, intent(in) :: n
    !> Right-hand side (n_active)
    real(wp), allocatable, intent(out) :: rhs(:)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable, target :: own(:)
    real(wp), pointer, contiguous :: given(:)
    integer :: stat

    call now%shear%take_image(n, own, given, stat)
    if (stat == 0) allocate (rhs(nodes%n_active), stat=stat)
    if (stat /= 0) call raise(error, status%resources, 'not enough memory for the shear traction: choose a smaller window')
    call now%shear%space%agree(error)
    if (allocated(error)) return
    call find_prescribed_displacement(now, given)
    call now%shear%add_rest(given)
    call nodes%pack(given, rhs)
  end subroutine find_rhs

  !> Take traction, displacement and motions of a solution.
  subroutine take_solution(now, found, judged, error)
    !> Tractions and motions
    type(friction_iterate_t), intent(inout) :: now
    !> The solution, which is used up
    type(shear_solution_t), intent(inout) :: found
    !> R_t is that of the traction taken
    logical, intent(out) :: judged
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: rounding

    now%n_shear = now%n_shear + 1
    if (mod(now%n_shear, now%problem%options%newton%sweeps_per_cut) == 0) call now%cut_parameter(0.5_wp)
    call found%driven%set_motions(found%constraints%multiplier, now%motion)
    call now%shear%leave_frames(now%q, found%ax, rounding)
    call move_alloc(found%ax, now%u)
    call now%find_tangential_residual()
    judged = .true.
    if (rounding > now%problem%options%newton%displacement_rounding*found%scale) then
      judged = .false.
      call now%refresh(error)
    end if
  end subroutine take_solution

  !> Compute the displacements by a shear traction and the pressure together, springs included.
  subroutine displace(now, nodes, found, error)
    !> Tractions and motions
    type(friction_iterate_t), intent(inout) :: now
    !> Unknowns (of 2 n)
    type(active_set_t), intent(in) :: nodes
    !> Shear traction; its displacement, in the frames, is computed
    type(shear_solution_t), intent(inout) :: found
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable, target :: traction(:)
    integer :: n, m

    n = size(now%p)
    m = merge(n, 0, now%shear_feels_pressure)
    call give_back(2*n)
    allocate (traction(m + 2*n))
    call now%shear%space%fill(traction, 0.0_wp)
    call nodes%unpack(found%unknown, traction(m + 1:))
    call found%fixed%unpack(found%given, traction(m + 1:))
    if (m == 0) then
      call now%shear%product(traction, found%ax, error)
      return
    end if
    call now%shear%space%copy(now%p, traction(:n))
    call now%shear%turn(traction(n + 1:))
    call now%operators%apply([normal, along_x, along_y], traction, [along_x, along_y], found%ax, error)
    if (allocated(error)) return
    call now%shear%add_springs(found%unknown(:nodes%pairs%n_first), found%ax)
  end subroutine displace

  !> Estimate the pressure that an approach of the nodes in contact causes, V of (F11): made once a step.
  subroutine find_punch_pressure(now, nodes, constraint, mb)
    !> Tractions and motions
    type(friction_iterate_t), intent(inout) :: now
    !> Nodes in contact
    type(active_set_t), intent(in) :: nodes
    !> One at these nodes; or no constraint at all (n_active, 1 or 0)
    real(wp), intent(in), contiguous :: constraint(:, :)
    !> The pressure there (n_active, 1 or 0)
    real(sp), allocatable, intent(out) :: mb(:, :)
    real(wp), allocatable :: pressure(:), column(:)

    if (size(constraint, 2) == 0) then
      allocate (mb(size(constraint, 1), 0))
      return
    end if
    allocate (pressure(size(now%p)))
    if (allocated(now%punch_pressure)) then
      call now%punch_pressure%restore(1, pressure)
      allocate (column(size(constraint, 1)))
      call nodes%pack(pressure, column)
      mb = reshape(real(column, sp), [size(column), 1])
      return
    end if
    call precondition_constraints(now%pressure, nodes, size(now%p), constraint, mb)
    allocate (now%punch_pressure)
    call new_packed_fields(now%punch_pressure, nodes, 1)
    call now%pressure%space%fill(pressure, 0.0_wp)
    call nodes%unpack(real(mb(:, 1), wp), pressure)
    call now%punch_pressure%keep(1, pressure)
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
    real(sp), allocatable, intent(out) :: mb(:, :)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    type(active_set_t) :: touching
    real(wp), allocatable, target :: own(:)
    real(wp), pointer, contiguous :: plane(:)
    integer :: n, k, n_t, stat
    logical :: known

    n = size(now%p)
    n_t = nodes%pairs%n_first
    known = allocated(now%rigid_traction) .and. .not. afresh
    if (known) known = now%rigid_traction%n_field == size(constraint, 2)
    if (.not. known) then
      call precondition_constraints(now%shear, nodes, 2*n, constraint, mb)
      if (allocated(now%rigid_traction)) deallocate (now%rigid_traction)
      allocate (now%rigid_traction)
      call new_active_set(touching, [now%contact, now%contact], now%shear%space)
      call new_packed_fields(now%rigid_traction, touching, size(mb, 2))
    else
      allocate (mb(size(constraint, 1), size(constraint, 2)))
    end if
    if (size(mb, 2) == 0) return
    call now%shear%take_image(2*n, own, plane, stat)
    if (stat /= 0) call raise(error, status%resources, 'not enough memory for the shear traction: choose a smaller window')
    call now%shear%space%agree(error)
    if (allocated(error)) return
    do k = 1, size(mb, 2)
      if (known) then
        call now%rigid_traction%restore(k, plane)
        call now%shear%apply_slip_compliance(nodes%pairs, constraint(:n_t, k), constraint(n_t + 1:, k), plane)
        call nodes%pack(plane, mb(:, k))
      else
        call now%shear%space%fill(plane, 0.0_wp)
        call nodes%unpack(real(mb(:, k), wp), plane)
        call now%shear%turn(plane)
        call now%rigid_traction%keep(k, plane)
      end if
    end do
  end subroutine find_rigid_traction

end module hc_staggered_newton
