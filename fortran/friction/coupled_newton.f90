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
  use hc_precision, only: wp, sp, lk
  use hc_error, only: error_t, status, raise
  use hc_memory, only: give_back
  use hc_options, only: newton_options_t
  use hc_contact_state, only: normal, force_control
  use hc_load_constraints, only: driven_motions_t
  use hc_active_zones, only: linearize_law, classify, find_constraints, find_constraint, find_prescribed_displacement
  use hc_friction_iterate, only: friction_iterate_t
  use hc_staggered_newton, only: find_punch_pressure, find_rigid_traction
  use hc_coupled_system, only: coupled_system_t
  use hc_active_set, only: active_set_t, new_active_set
  use hc_linear_system, only: constraints_t, constraint_source_t, iteration_t, step_ahead
  use hc_projected_gmres, only: projected_gmres
  implicit none
  private

  public :: coupled_sweep

  !> A step: the linear problem (F7) and its solution.
  type :: coupled_step_t
    type(coupled_system_t) :: system
    !> Nodes that carry unknowns (of 3 n), and those of the shear traction (of 2 n)
    type(active_set_t) :: nodes, sheared
    !> Pressure, then shear traction in the frames, and its product (3 n)
    real(wp), allocatable :: x(:), ax(:)
    !> Motions that are driven by their loads; the loads as constraints, the normal one last
    type(driven_motions_t) :: driven
    type(constraints_t) :: constraints
    type(iteration_t) :: iteration
    !> Some node sticks
    logical :: sticks = .false.
  contains
    procedure :: determined
  end type coupled_step_t

  !> Loads that drive motions, as rows and columns of a step.
  type, extends(constraint_source_t) :: driving_loads_t
    type(friction_iterate_t), pointer :: now => null()
    type(coupled_step_t), pointer :: step => null()
  contains
    procedure :: find => find_load
  end type driving_loads_t

contains

  !> Take one step of Newton's method.
  subroutine coupled_sweep(now, failed, error)
    !> Tractions and motions
    type(friction_iterate_t), intent(inout), target :: now
    !> No node resists the loads: the iterate is unchanged
    logical, intent(out) :: failed
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    type(coupled_step_t), target :: step
    logical(lk), allocatable :: shear_active(:)
    real(wp), allocatable :: missing(:)

    ! 1.
    call linearize(now, shear_active)
    ! 2.
    call enter_frames(now, shear_active, step)
    ! 3.
    call find_nodes(now, shear_active, step)
    call constrain(now, step, missing, error)
    if (allocated(error)) return
    call step%constraints%satisfy(step%nodes%space, missing, step%x, step%iteration%independent, step%nodes)
    ! 4.
    if (step%iteration%independent) call solve(now, step, error)
    if (allocated(error)) return
    ! where all nodes slip, only their directions resist a load: limit the step along them
    failed = .not. step%iteration%independent
    if (.not. (failed .or. step%determined())) then
      associate (n => size(now%p))
        failed = step%system%space%max_abs(step%x(n + 1:2*n)) > now%problem%options%newton%most_across*now%traction_scale()
      end associate
    end if
    if (failed) then
      call now%refresh(error)
    else
      ! 5.
      call take_solution(now, step, error)
    end if
  end subroutine coupled_sweep

  !> Return whether the solution is taken however large: nodes stick, or no load drives a motion.
  pure logical function determined(self)
    class(coupled_step_t), intent(in) :: self

    determined = self%sticks .or. size(self%driven%motion) == 0
  end function determined

  !> Find contact, stick, slip, directions and compliances that the present tractions call for.
  subroutine linearize(now, shear_active)
    !> Tractions and motions
    type(friction_iterate_t), intent(inout), target :: now
    !> Components of the shear traction that are unknown (2 n)
    logical(lk), allocatable, intent(out) :: shear_active(:)
    real(wp), allocatable :: gap(:)
    logical(lk), allocatable :: contact(:)

    call now%find_gap(gap)
    allocate (contact(size(gap)))
    call now%problem%find_contact(now%operators%space%count(now%contact), now%p, gap, now%candidate, contact)
    call move_alloc(contact, now%contact)
    now%p = merge(max(now%p, 0.0_wp), 0.0_wp, now%contact)
    call linearize_law(now, gap, .false.)
    deallocate (gap)
    call classify(now, .false., shear_active)
  end subroutine linearize

  !> Set up matrix and unknowns in the frames of the nodes; the part mu p e of a traction belongs to the pressure.
  subroutine enter_frames(now, shear_active, step)
    !> Tractions and motions
    type(friction_iterate_t), intent(inout), target :: now
    !> Components of the shear traction that are unknown (2 n)
    logical(lk), intent(in), contiguous :: shear_active(:)
    !> The step
    type(coupled_step_t), intent(inout) :: step
    real(wp), allocatable :: ahead(:), aside(:)
    real(wp) :: bound(now%problem%lattice%extent(1))
    integer :: n, k, i, from, to, at

    n = size(now%p)
    associate (system => step%system, friction => now%problem%friction)
      system%operators => now%operators
      system%shear => now%shear
      if (.not. allocated(now%pressure%compliance)) call now%operators%normal%set_active(now%contact)
      if (allocated(now%pressure%compliance)) system%compliance = now%pressure%compliance
      system%space = now%operators%space
      system%pressed => now%shear%nodes
      allocate (step%x(3*n), ahead(system%pressed%n_active), aside(system%pressed%n_active))
      allocate (system%slope(system%pressed%n_active), source=0.0_wp)
      step%x(:n) = now%p
      step%x(n + 1:) = now%q
      call now%shear%turn(step%x(n + 1:))
      if (.not. friction%is_bounded()) return
      call friction%find_boundary(now%shear%direction, ahead, aside)
      if (allocated(now%shear%rest)) allocate (system%tilt(system%pressed%n_active), source=0.0_wp)
      !$omp parallel do schedule(static) num_threads(system%space%threads) private(bound, i, from, to, at)
      do k = 1, size(system%pressed%first)
        from = system%pressed%first(k)
        to = system%pressed%last(k)
        at = system%pressed%place(k) - from
        call friction%find_slopes(from, now%p(from:to), system%slope(at + from:at + to))
        call friction%find_bounds(from, now%p(from:to), bound(:to - from + 1))
        do i = from, to
          if (shear_active(n + i)) then
            system%slope(at + i) = 0.0_wp
            cycle
          end if
          if (allocated(system%tilt)) then
            system%tilt(at + i) = aside(at + i)*system%slope(at + i)
            now%shear%rest(at + i) = now%shear%rest(at + i) - system%tilt(at + i)*now%p(i)
          end if
          ! the part of q that p carries is not counted twice; that of a bound that does not grow with p stays as it is
          system%slope(at + i) = ahead(at + i)*system%slope(at + i)
          step%x(2*n + i) = ahead(at + i)*bound(i - from + 1) - system%slope(at + i)*now%p(i)
        end do
      end do
      !$omp end parallel do
    end associate
  end subroutine enter_frames

  !> Set the nodes that carry unknowns.
  subroutine find_nodes(now, shear_active, step)
    !> Tractions and motions
    type(friction_iterate_t), intent(in) :: now
    !> Components of the shear traction that are unknown (2 n); freed
    logical(lk), allocatable, intent(inout) :: shear_active(:)
    !> The step
    type(coupled_step_t), intent(inout), target :: step
    integer :: n

    n = size(now%p)
    call new_active_set(step%nodes, [now%contact, shear_active], step%system%space, now%problem%own_extent())
    call new_active_set(step%sheared, shear_active, step%system%space, now%problem%own_extent())
    call step%sheared%pair(2*n)
    step%system%sheared => step%sheared
    step%sticks = step%system%space%count(shear_active(n + 1:)) > 0
    deallocate (shear_active)
  end subroutine find_nodes

  !> Set the prescribed loads as constraints: loads as rows A B^T E, motions as columns E_t^T B, and M B.
  subroutine constrain(now, step, missing, error)
    !> Tractions and motions
    type(friction_iterate_t), intent(inout), target :: now
    !> The step
    type(coupled_step_t), intent(inout), target :: step
    !> Loads less those of the start, over the cell area
    real(wp), allocatable, intent(out) :: missing(:)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: ones(:, :), columns(:, :)
    real(sp), allocatable :: punch(:, :)

    associate (c => step%constraints, pressed => now%shear%nodes)
      c%n_before = pressed%n_active
      call find_constraints(now, step%sheared, step%driven, columns, missing)
      c%multiplier = step%driven%multipliers(now%motion)
      call find_rigid_traction(now, step%sheared, columns, .false., c%mb, error)
      if (allocated(error)) return
      deallocate (columns)
      c%source = driving_loads_t(now, step)
      if (now%target%control(normal) /= force_control) return
      missing = [missing, now%target%value(normal)/now%problem%lattice%cell_area() - now%pressure_sum()]
      c%multiplier = [c%multiplier, now%motion(normal)]
      allocate (ones(pressed%n_active, 1), source=1.0_wp)
      call find_punch_pressure(now, pressed, ones, punch)
      c%of_sum = punch(:, 1)
    end associate
  end subroutine constrain

  !> Compute row and column of a load; the traction mu p e belongs to the pressure.
  subroutine find_load(self, k, column, row)
    class(driving_loads_t), intent(in) :: self
    integer, intent(in) :: k
    real(wp), intent(inout), contiguous :: column(:)
    real(wp), intent(inout), contiguous, optional :: row(:)
    real(wp), dimension(self%now%problem%lattice%extent(1)) :: ux, uy
    integer :: run, m, from, to

    call find_constraint(self%now, self%step%sheared, self%step%driven, k, column)
    if (.not. present(row)) return
    associate (now => self%now, pressed => self%now%shear%nodes, direction => self%now%shear%direction)
      !$omp parallel do schedule(static) num_threads(now%operators%space%threads) private(ux, uy, m, from, to)
      do run = 1, size(pressed%first)
        from = pressed%place(run)
        m = pressed%last(run) - pressed%first(run) + 1
        to = from + m - 1
        call self%step%driven%direction_row(k, now%problem, pressed%first(run), ux(:m), uy(:m))
        row(from:to) = self%step%system%slope(from:to)*(direction(1, from:to)*ux(:m) + direction(2, from:to)*uy(:m))
      end do
      !$omp end parallel do
    end associate
  end subroutine find_load

  !> Solve (F7) by GMRES, preconditioned block by block and projected as in (F11).
  subroutine solve(now, step, error)
    !> Tractions and motions; its displacements are freed, and its tractions where the solution is taken in any case
    type(friction_iterate_t), intent(inout) :: now
    !> The step
    type(coupled_step_t), intent(inout), target :: step
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    type(newton_options_t) :: options
    real(wp), allocatable :: rhs(:), unknown(:), kept(:)
    type(active_set_t) :: fixed
    real(wp) :: residual, p_max
    integer :: n
    logical :: ahead

    n = size(now%p)
    options = now%problem%options%newton
    residual = max(now%residual_normal, now%residual_tangential)
    ahead = residual < options%residual_ahead
    associate (system => step%system, iteration => step%iteration)
      allocate (step%ax(3*n))
      if (ahead) then
        step%ax(:n) = now%w + now%closing
        step%ax(n + 1:) = now%u
      end if
      ! those of the iterate come from the solution, or anew
      call now%forget_displacements()
      p_max = system%space%max(now%p)
      allocate (iteration%weight(3))
      iteration%weight(1) = 1.0_wp/(now%problem%normal_compliance*p_max)
      if (allocated(system%compliance)) then
        iteration%weight(1) = now%problem%normal_compliance/now%problem%sprung_compliance(p_max)*iteration%weight(1)
      end if
      iteration%weight(2:) = 1.0_wp/(now%problem%tangential_compliance*now%traction_scale())
      if (step%determined()) deallocate (now%p, now%q)
      call give_back(3*n)
      if (ahead) then
        if (allocated(system%compliance)) step%ax(:n) = step%ax(:n) + system%compliance*step%x(:n)
        call now%shear%add_springs(step%x(n + 1:), step%ax(n + 1:))
        call system%add_tilt(-1.0_wp, step%x(:n), step%ax(n + 1:2*n))
        allocate (unknown(step%nodes%n_active))
        call step%nodes%pack(step%x, unknown)
        call find_rhs(now, step, rhs, error)
        if (allocated(error)) return
        call step_ahead(system, step%nodes, step%constraints, rhs, step%ax, options%length_ahead, unknown)
        call step%nodes%unpack(unknown, step%x)
        deallocate (unknown)
      end if
      call system%product(step%x, step%ax, error)
      if (allocated(error)) return
      call find_rhs(now, step, rhs, error)
      if (allocated(error)) return
      residual = min(residual, 1.0_wp)
      iteration%tolerance = max(residual*min(options%inner_accuracy, max(residual, options%coupled_accuracy)), &
                                options%final_accuracy*now%tolerance)*real(system%space%number(step%nodes%n_active), wp)**0.25_wp
      iteration%most = options%max_coupled_iterations
      iteration%most_directions = options%max_directions
      iteration%most_products = options%max_products
      ! the next sweep begins with a product; stiff springs that rest under the pressure would feel the rounding
      iteration%single = .not. allocated(system%tilt)
      ! the traction across of nodes on a bound that does not grow with the pressure is no unknown
      call step%nodes%pack_all(step%x, unknown, fixed, kept)
      call projected_gmres(system, step%nodes, step%constraints, rhs, unknown, step%ax, iteration, error)
      if (allocated(error)) return
      call give_back(3*n)
      call step%nodes%unpack_all(3*n, unknown, fixed, kept, step%x)
      now%outcome = iteration%outcome
      now%rounding = iteration%rounding
      if (iteration%drift > options%displacement_rounding) then
        now%rounding = 0.0_wp
        call system%product(step%x, step%ax, error)
      end if
    end associate
  end subroutine solve

  !> Find the right-hand side of (F7) at the unknowns, in memory of the operator.
  subroutine find_rhs(now, step, rhs, error)
    !> Tractions and motions
    type(friction_iterate_t), intent(in) :: now
    !> The step
    type(coupled_step_t), intent(in) :: step
    !> Right-hand side (nodes%n_active)
    real(wp), allocatable, intent(out) :: rhs(:)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable, target :: own(:)
    real(wp), pointer, contiguous :: given(:)
    integer :: n, stat

    n = size(step%ax)/3
    call step%system%take_image(3*n, own, given, stat)
    if (stat == 0) allocate (rhs(step%nodes%n_active), stat=stat)
    if (stat /= 0) call raise(error, status%resources, 'not enough memory for the tractions: choose a smaller window')
    call step%system%space%agree(error)
    if (allocated(error)) return
    given(:n) = -now%h + merge(0.0_wp, now%motion(normal), now%target%control(normal) == force_control)
    if (allocated(now%pressure%offset)) given(:n) = given(:n) - now%pressure%offset
    call find_prescribed_displacement(now, given(n + 1:))
    call now%shear%add_rest(given(n + 1:))
    call step%nodes%pack(given, rhs)
  end subroutine find_rhs

  !> Take tractions and motions of the solution, and their displacements from the product that GMRES carries along.
  subroutine take_solution(now, step, error)
    !> Tractions and motions
    type(friction_iterate_t), intent(inout) :: now
    !> The step
    type(coupled_step_t), intent(inout) :: step
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: rounding
    integer :: n, n_shear

    n = size(step%x)/3
    n_shear = size(step%driven%motion)
    associate (c => step%constraints, x => step%x, ax => step%ax, system => step%system)
      call step%driven%set_motions(c%multiplier(:n_shear), now%motion)
      if (size(c%multiplier) > n_shear) now%motion(normal) = c%multiplier(n_shear + 1)
      ! fields go as soon as they are copied: a window is too large for two of each
      c = constraints_t()
      now%p = x(:n)
      call system%add_slope(now%p, x(2*n + 1:))
      call system%add_tilt(1.0_wp, now%p, ax(n + 1:2*n))
      call now%shear%leave_frames(x(n + 1:), ax(n + 1:), rounding)
      deallocate (system%slope)
      now%q = x(n + 1:)
      deallocate (step%x)
      now%u = ax(n + 1:)
      now%w = ax(:n)
      deallocate (step%ax)
      call now%pressure%stretch(-1.0_wp, now%p, now%w)
      allocate (now%closing(n), source=0.0_wp)
      now%cut = .false.
      now%joint = .true.
    end associate
    if (rounding > now%problem%options%newton%displacement_rounding*now%problem%tangential_compliance*now%traction_scale()) then
      call now%refresh(error)
      if (allocated(error)) return
    end if
    call now%find_residuals()
    now%first = .false.
  end subroutine take_solution

end module hc_coupled_newton
