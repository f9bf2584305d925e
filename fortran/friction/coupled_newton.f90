!> A coupled sweep: a step of Newton's method for pressure, shear traction and motions at once.
!>
!> Where pressure and shear traction act strongly on each other (dissimilar materials and much friction), staggered sweeps
!> exchange nodes at the edge of the contact again and again. Here F(p, q, motions) = 0, (F2) to (F4) of
!> docs/theory/friction.md as they stand at the top of staggered_newton, is linearised as a whole (Alart & Curnier,
!> Comput. Methods Appl. Mech. Eng. 92, 1991; Hintermueller, Ito & Kunisch, SIAM J. Optim. 13, 2003):
!>
!>     ( E_t^T T E + D   -E_t^T B ) ( p, q_stick, tau )   ( E_t^T (-h, s^n) )
!>     (  A B^T E            0    ) (     motions     ) = ( P, Q_x, Q_y, M_z ),                    (F7)
!>
!> with q = mu p e + tau t in E and q = tau t in E_t where a node slips: the pressure carries mu p e along, and the matrix is
!> not symmetric. The steps, in their order below:
!>
!> 1. contact, stick, slip, directions e and compliances D by (F5), (F6), with r' and r of (F8);
!> 2. unknowns in the frames of the nodes, without mu p e, which belongs to p;
!> 3. loads as rows A B^T E, motions as columns E_t^T B, and the start corrected so that it carries the loads;
!> 4. (F7) by GMRES, preconditioned block by block and projected as in (F11);
!> 5. tractions and motions of the solution, and the residuals R_n and R_t from the product that GMRES carries along.
!>
!> If nothing resists the loads, `failed` is true, and a staggered sweep follows.
module hc_coupled_newton
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_options, only: newton_options_t
  use hc_contact_state, only: normal, force_control
  use hc_load_constraints, only: driven_motions_t
  use hc_active_zones, only: linearize_law, classify, find_constraints, find_prescribed_displacement
  use hc_friction_iterate, only: friction_iterate_t
  use hc_staggered_newton, only: find_punch_pressure, find_rigid_traction
  use hc_coupled_system, only: coupled_system_t
  use hc_active_set, only: active_set_t, new_active_set
  use hc_linear_system, only: satisfy_constraints, step_ahead
  use hc_projected_gmres, only: projected_gmres
  implicit none
  private

  public :: coupled_sweep

contains

  !> Take one step of Newton's method.
  subroutine coupled_sweep(now, failed, error)
    !> Tractions and motions
    type(friction_iterate_t), intent(inout), target :: now
    !> No node resists the loads: the iterate is unchanged
    logical, intent(out) :: failed
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    type(coupled_system_t) :: system
    real(wp), allocatable :: x(:), ax(:), rhs(:), column(:), plane(:)
    real(wp), allocatable :: shear_columns(:, :), part(:, :), b(:, :), m_b(:, :), c(:, :)
    real(wp), allocatable :: gap(:), ahead(:), aside(:)
    logical, allocatable :: active(:), shear_active(:), contact(:)
    type(active_set_t), target :: nodes, sheared, pressed
    real(wp), allocatable :: shear_missing(:)
    type(driven_motions_t) :: driven
    type(newton_options_t) :: options
    real(wp) :: missing(4), multiplier(4), weight(2), goal, residual, drift, rounding
    integer :: n, m, k, n_shear, iterations
    logical :: independent, sticks

    n = size(now%p)
    options = now%problem%options%newton
    ! 1.
    call now%find_gap(gap)
    allocate (contact(n))
    call now%problem%find_contact(now%operators%space%count(now%contact), now%p, gap, now%candidate, contact)
    call move_alloc(contact, now%contact)
    now%p = merge(max(now%p, 0.0_wp), 0.0_wp, now%contact)
    call linearize_law(now, gap, .false.)
    deallocate (gap)
    call classify(now, .false., shear_active)
    ! 2.
    system%operators => now%operators
    system%shear => now%shear
    if (.not. allocated(now%pressure%compliance)) call now%operators%normal%set_active(now%contact)
    if (allocated(now%pressure%compliance)) system%compliance = now%pressure%compliance
    system%space = now%operators%space
    allocate (active(3*n), x(3*n), plane(2*n))
    active(:n) = now%contact
    active(n + 1:) = shear_active
    allocate (system%slope(n), source=0.0_wp)
    allocate (ahead(n), aside(n))
    call now%problem%friction%find_boundary(now%shear%direction, ahead, aside)
    if (now%problem%friction%is_bounded()) then
      call now%problem%friction%find_slopes(1, now%p, system%slope)
      where (.not. now%contact .or. shear_active(n + 1:)) system%slope = 0.0_wp
      if (allocated(now%shear%rest)) then
        system%tilt = aside*system%slope
        now%shear%rest = now%shear%rest - system%tilt*now%p
      end if
      system%slope = ahead*system%slope
    end if
    x(:n) = now%p
    x(n + 1:) = now%q
    call now%shear%turn(x(n + 1:))
    ! what p carries along is not counted twice
    x(2*n + 1:) = x(2*n + 1:) - system%slope*now%p
    where (.not. shear_active) x(n + 1:) = 0.0_wp
    if (now%problem%friction%is_bounded()) then
      ! the part of a bound that does not grow with the pressure stays as it is
      call now%problem%friction%find_bounds(1, now%p, plane(:n))
      where (now%contact .and. .not. shear_active(n + 1:)) x(2*n + 1:) = ahead*plane(:n) - system%slope*now%p
    end if
    deallocate (ahead, aside)

    ! 3.
    call new_active_set(nodes, active, system%space)
    call new_active_set(sheared, shear_active, system%space)
    call sheared%pair(2*n)
    call new_active_set(pressed, now%contact, system%space)
    system%pressed => pressed
    system%sheared => sheared
    sticks = any(shear_active(n + 1:))
    deallocate (active, shear_active)
    call find_constraints(now, sheared, driven, shear_columns, shear_missing)
    n_shear = size(shear_missing)
    m = n_shear
    if (now%target%control(normal) == force_control) m = m + 1
    call find_rigid_traction(now, sheared, shear_columns, .false., part, error)
    if (allocated(error)) return
    ! one by one: over all nodes they are large
    allocate (b(nodes%n_active, m), m_b(nodes%n_active, m), c(nodes%n_active, m), column(3*n))
    do k = 1, n_shear
      column = 0.0_wp
      call sheared%unpack(part(:, k), column(n + 1:))
      call nodes%pack(column, m_b(:, k))
      column = 0.0_wp
      call sheared%unpack(shear_columns(:, k), column(n + 1:))
      call nodes%pack(column, b(:, k))
      ! the traction mu p e belongs to the pressure
      plane = reshape(driven%direction(k, now%problem), [2*n])
      column(:n) = system%slope*(now%shear%direction(1, :)*plane(:n) + now%shear%direction(2, :)*plane(n + 1:))
      call nodes%pack(column, c(:, k))
    end do
    deallocate (part, shear_columns, plane)
    missing(:n_shear) = shear_missing
    multiplier(:n_shear) = driven%multipliers(now%motion)
    if (m > n_shear) then
      missing(m) = now%target%value(normal)/now%problem%lattice%cell_area() - system%space%sum(now%p)
      multiplier(m) = now%motion(normal)
      allocate (shear_columns(pressed%n_active, 1), source=1.0_wp)
      call find_punch_pressure(now, pressed, shear_columns, part, error)
      if (allocated(error)) return
      column = 0.0_wp
      call pressed%unpack(part(:, 1), column(:n))
      call nodes%pack(column, m_b(:, m))
      column(:n) = merge(1.0_wp, 0.0_wp, now%contact)
      call nodes%pack(column, b(:, m))
      c(:, m) = b(:, m)
      deallocate (part, shear_columns)
    end if
    deallocate (column)
    call satisfy_constraints(c, m_b, missing(:m), x, independent, system%space, nodes)
    ! 4.
    if (independent) then
      allocate (ax(3*n), rhs(3*n))
      rhs(:n) = -now%h + merge(0.0_wp, now%motion(normal), m > n_shear)
      if (allocated(now%pressure%offset)) rhs(:n) = rhs(:n) - now%pressure%offset
      call find_prescribed_displacement(now, rhs(n + 1:))
      call now%shear%add_rest(rhs(n + 1:))
      if (max(now%residual_normal, now%residual_tangential) < options%residual_ahead) then
        ax(:n) = now%w + now%closing
        if (allocated(system%compliance)) ax(:n) = ax(:n) + system%compliance*x(:n)
        ax(n + 1:) = now%u
        call now%shear%add_springs(x(n + 1:), ax(n + 1:))
        if (allocated(system%tilt)) ax(n + 1:2*n) = ax(n + 1:2*n) - now%shear%compliance*system%tilt*x(:n)
        call step_ahead(system, nodes, b, m_b, c, rhs, ax, multiplier(:m), options%length_ahead, x, error)
        if (allocated(error)) return
      end if
      ! those of the iterate come from the solution, or anew
      call now%forget_displacements()
      call system%product(x, ax, error)
      if (allocated(error)) return
      weight(1) = 1.0_wp/(now%problem%normal_compliance*system%space%max(now%p))
      if (allocated(system%compliance)) then
        weight(1) = now%problem%normal_compliance/now%problem%sprung_compliance(system%space%max(now%p))*weight(1)
      end if
      weight(2) = 1.0_wp/(now%problem%tangential_compliance*now%traction_scale())
      goal = min(max(now%residual_normal, now%residual_tangential), 1.0_wp)
      goal = max(goal*min(options%inner_accuracy, max(goal, options%coupled_accuracy)), options%final_accuracy*now%tolerance)
      goal = goal*real(nodes%n_active, wp)**0.25_wp
      call projected_gmres(system, nodes, b, m_b, c, weight([1, 2, 2]), rhs, x, ax, goal, options%max_coupled_iterations, &
                           options%max_directions, multiplier(:m), independent, residual, iterations, now%outcome, error, drift)
      if (allocated(error)) return
      if (drift > options%displacement_rounding) call system%product(x, ax, error)
      if (allocated(error)) return
    end if
    ! where all nodes slip, only their directions resist a load: not beyond reason
    failed = .not. independent
    if (.not. failed .and. n_shear > 0) then
      if (.not. sticks) then
        failed = system%space%max_abs(x(n + 1:2*n)) > options%most_across*now%traction_scale()
      end if
    end if
    if (failed) then
      call now%refresh(error)
      return
    end if

    ! 5.
    call driven%set_motions(multiplier(:n_shear), now%motion)
    if (m > n_shear) now%motion(normal) = multiplier(m)
    now%p = x(:n)
    x(2*n + 1:) = x(2*n + 1:) + system%slope*now%p
    allocate (now%closing(n))
    now%w = ax(:n)
    call now%pressure%stretch(-1.0_wp, now%p, now%w)
    now%closing = 0.0_wp
    now%cut = .false.
    now%joint = .true.
    if (allocated(system%tilt)) ax(n + 1:2*n) = ax(n + 1:2*n) + now%shear%compliance*system%tilt*now%p
    call now%shear%leave_frames(x(n + 1:), ax(n + 1:), rounding)
    now%q = x(n + 1:)
    now%u = ax(n + 1:)
    if (rounding > options%displacement_rounding*now%problem%tangential_compliance*now%traction_scale()) then
      call now%refresh(error)
      if (allocated(error)) return
    end if
    call now%find_residuals()
    now%first = .false.
  end subroutine coupled_sweep

end module hc_coupled_newton
