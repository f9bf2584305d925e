!> A contact problem with friction: what is given, and how well a state solves it.
!>
!> One load step leads from the relative displacement s^n (zero for a body that
!> was never loaded) to tractions p, q and rigid motions with
!>
!>     g = h + w - approach,   s = (u1 - u2) - shift - twist x r,   ds = s - s^n,
!>
!> where w, u1 - u2 are the flexibility operator's.
!>
!> Equations: docs/theory/conditions.md, (C1) to (C4).
module hc_contact_problem
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp, pi
  use hc_error, only: error_t
  use hc_options, only: options_t
  use hc_lattice, only: lattice_t
  use hc_field_space, only: field_space_t
  use hc_elastic_pair, only: elastic_pair_t
  use hc_flexibility, only: flexibility_t
  use hc_contact_state, only: contact_state_t, new_friction_state, load_target_t, check_problem, touches_rim, separated, slip, &
    normal, along_x, along_y, about_z, n_motion, force_control, within_tolerance, sweeps_used_up, &
    loads_not_carried, out_of_range
  use hc_contact_residuals, only: normal_self_compliance, tangential_self_compliance, normal_residual, &
    tangential_residual, force_residual, least_traction
  use hc_friction_law, only: friction_law_t
  use hc_normal_law, only: normal_law_t, unilateral_t
  use hc_transfer, only: coarsen_bodies
  implicit none
  private

  public :: friction_problem_t, new_friction_problem

  !> What is given.
  type :: friction_problem_t
    !> Lattice and window
    type(lattice_t) :: lattice
    !> Elastic constants of the two bodies
    type(elastic_pair_t) :: pair
    !> Law of friction
    class(friction_law_t), allocatable :: friction
    !> Law of contact along the normal
    class(normal_law_t), allocatable :: normal_law
    !> Goodman's approximation: shear tractions do not move the pressure
    logical :: goodman = .false.
    !> Initial gap (n_col, n_row) [m]
    real(wp), allocatable :: initial_gap(:, :)
    !> Nodes that may come into contact (n_col, n_row)
    logical, allocatable :: candidate(:, :)
    !> Coordinates of the nodes (n_col, n_row) [m]
    real(wp), allocatable :: x(:, :), y(:, :)
    !> Self-compliances d_n and d_t of a node [m/Pa]
    real(wp) :: normal_compliance = 0.0_wp, tangential_compliance = 0.0_wp
    !> Tolerances, caps and tuning numbers of whoever solves it
    type(options_t) :: options
    !> Threads that share the passes over its nodes
    type(field_space_t) :: space
  contains
    !> The same problem on the lattice of every second node
    procedure :: coarsen
    !> The same problem on a part of its window
    procedure :: take_part
    !> Will the bodies touch?
    procedure :: is_pressed
    !> Do pressure and shear traction act strongly on each other?
    procedure :: couples_strongly
    !> State of bodies that do not touch
    procedure :: separate
    !> Relative displacements (w, u_x, u_y) of given tractions
    procedure :: displacements
    !> Tangential displacement of a rigid motion
    procedure :: rigid_displacement
    !> Resultants of given tractions
    procedure :: resultants
    !> Classification parameters r of the tangential conditions and r' of those along the normal
    procedure :: classification_parameter, normal_classification_parameter
    !> Gap, slip, zones, loads and residuals of a state whose tractions and motions are known
    procedure :: conclude
    !> Residuals of its loads alone
    procedure :: judge_loads
  end type friction_problem_t

contains

  !> A problem from what is given.
  subroutine new_friction_problem(problem, lattice, pair, initial_gap, candidate, friction, goodman, error, normal_law)
    !> Problem to be set up
    type(friction_problem_t), intent(out) :: problem
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Elastic constants of the two bodies
    type(elastic_pair_t), intent(in) :: pair
    !> Initial gap (n_col, n_row) [m]
    real(wp), intent(in) :: initial_gap(:, :)
    !> Nodes that may come into contact (n_col, n_row)
    logical, intent(in) :: candidate(:, :)
    !> Law of friction
    class(friction_law_t), intent(in) :: friction
    !> Goodman's approximation: shear tractions do not move the pressure
    logical, intent(in) :: goodman
    !> Allocated on failure: wrong shapes, no candidate at all, numbers of no use, a negative coefficient
    type(error_t), allocatable, intent(out) :: error
    !> Law of contact along the normal; absent: unilateral contact
    class(normal_law_t), intent(in), optional :: normal_law

    call check_problem(lattice, pair, initial_gap, candidate, error)
    if (allocated(error)) return
    call friction%check(lattice, error)
    if (allocated(error)) return
    problem%lattice = lattice
    problem%pair = pair
    allocate (problem%friction, source=friction)
    if (present(normal_law)) then
      allocate (problem%normal_law, source=normal_law)
    else
      allocate (unilateral_t :: problem%normal_law)
    end if
    problem%goodman = goodman
    problem%initial_gap = initial_gap
    problem%candidate = candidate
    allocate (problem%x, problem%y, mold=initial_gap)
    call lattice%coordinates(problem%x, problem%y)
    problem%normal_compliance = normal_self_compliance(lattice, pair)
    problem%tangential_compliance = tangential_self_compliance(lattice, pair)
  end subroutine new_friction_problem

  !> The same problem on the lattice of every second node.
  subroutine coarsen(self, coarse)
    class(friction_problem_t), intent(in) :: self
    !> The problem there
    type(friction_problem_t), intent(out) :: coarse

    call coarsen_bodies(self%lattice, self%initial_gap, self%candidate, coarse%lattice, coarse%initial_gap, coarse%candidate)
    coarse%pair = self%pair
    call self%friction%on_lattice(self%lattice, coarse%lattice, coarse%friction)
    allocate (coarse%normal_law, source=self%normal_law)
    coarse%goodman = self%goodman
    coarse%options = self%options
    coarse%space = self%space
    allocate (coarse%x, coarse%y, mold=coarse%initial_gap)
    call coarse%lattice%coordinates(coarse%x, coarse%y)
    coarse%normal_compliance = normal_self_compliance(coarse%lattice, coarse%pair)
    coarse%tangential_compliance = tangential_self_compliance(coarse%lattice, coarse%pair)
  end subroutine coarsen

  !> The same problem on the part of its window between some columns and rows.
  subroutine take_part(self, low, high, part)
    class(friction_problem_t), intent(in) :: self
    !> First and last column and row
    integer, intent(in) :: low(2), high(2)
    !> The problem there
    type(friction_problem_t), intent(out) :: part

    part%lattice = self%lattice%subwindow(low, high)
    part%pair = self%pair
    call self%friction%on_lattice(self%lattice, part%lattice, part%friction)
    allocate (part%normal_law, source=self%normal_law)
    part%goodman = self%goodman
    part%options = self%options
    part%space = self%space
    part%initial_gap = self%initial_gap(low(1):high(1), low(2):high(2))
    part%candidate = self%candidate(low(1):high(1), low(2):high(2))
    part%x = self%x(low(1):high(1), low(2):high(2))
    part%y = self%y(low(1):high(1), low(2):high(2))
    part%normal_compliance = self%normal_compliance
    part%tangential_compliance = self%tangential_compliance
  end subroutine take_part

  !> Will the bodies touch? A load does, an approach only beyond the smallest gap.
  pure logical function is_pressed(self, target)
    class(friction_problem_t), intent(in) :: self
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target

    if (target%control(normal) == force_control) then
      is_pressed = target%value(normal) > 0.0_wp
    else
      is_pressed = target%value(normal) > minval(self%initial_gap, mask=self%candidate)
    end if
  end function is_pressed

  !> Do pressure and shear traction act strongly on each other? |beta| min(mu, 1) tells.
  pure logical function couples_strongly(self)
    class(friction_problem_t), intent(in) :: self

    couples_strongly = abs(self%pair%beta())*min(self%friction%strength(), 1.0_wp) > &
                       self%options%contact%strong_coupling .and. .not. self%goodman
  end function couples_strongly

  !> State of bodies that do not touch; motions that are driven by their load stay where they are.
  subroutine separate(self, start, reference, target, tolerance, state)
    class(friction_problem_t), intent(in) :: self
    !> State before
    type(contact_state_t), intent(in) :: start
    !> Relative displacement at the beginning of the step (n_col, n_row, 2) [m]
    real(wp), intent(in) :: reference(:, :, :)
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target
    !> Bound of all residuals
    real(wp), intent(in) :: tolerance
    !> State without contact; sliding where a tangential load is prescribed
    type(contact_state_t), intent(out) :: state
    real(wp), allocatable :: displacement(:, :, :)

    call new_friction_state(state, self%lattice, self%space)
    state%motion = merge(start%motion, target%value, target%control == force_control)
    if (target%control(normal) == force_control) state%motion(normal) = minval(self%initial_gap, mask=self%candidate)
    allocate (displacement(self%lattice%extent(1), self%lattice%extent(2), 3), source=0.0_wp)
    call self%conclude(target, tolerance, reference, displacement, state)
    state%sliding = .not. state%converged
    if (state%sliding) state%stopped = loads_not_carried
  end subroutine separate

  !> Relative displacements (w, u_x, u_y) of given tractions, by any operator.
  subroutine displacements(self, flexibility, pressure, traction, displacement, error)
    class(friction_problem_t), intent(in) :: self
    !> Flexibility operator over the window
    class(flexibility_t), intent(inout) :: flexibility
    !> Pressure (n_col, n_row) and shear traction (n_col, n_row, 2) [Pa]
    real(wp), intent(in) :: pressure(:, :), traction(:, :, :)
    !> w, u_x, u_y (n_col, n_row, 3) [m]
    real(wp), intent(out), contiguous :: displacement(:, :, :)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: tractions(:, :, :)
    integer :: row

    allocate (tractions(size(pressure, 1), size(pressure, 2), 3))
    !$omp parallel do schedule(static) num_threads(self%space%threads)
    do row = 1, size(pressure, 2)
      tractions(:, row, 1) = pressure(:, row)
      tractions(:, row, 2:) = traction(:, row, :)
    end do
    !$omp end parallel do
    call flexibility%apply([normal, along_x, along_y], tractions, [normal, along_x, along_y], displacement, error)
    if (allocated(error)) return
    if (self%goodman) call flexibility%apply([normal], tractions(:, :, :1), [normal], displacement(:, :, :1), error)
  end subroutine displacements

  !> shift + twist x r at every node (n_col, n_row, 2) [m].
  pure function rigid_displacement(self, motion) result(displacement)
    class(friction_problem_t), intent(in) :: self
    !> Approach, shifts and twist
    real(wp), intent(in) :: motion(n_motion)
    real(wp), allocatable :: displacement(:, :, :)

    allocate (displacement(size(self%x, 1), size(self%x, 2), 2))
    displacement(:, :, 1) = motion(along_x) - motion(about_z)*self%y
    displacement(:, :, 2) = motion(along_y) + motion(about_z)*self%x
  end function rigid_displacement

  !> Normal load, tangential loads [N] and torque [N m] of given tractions.
  function resultants(self, pressure, traction) result(load)
    class(friction_problem_t), intent(in) :: self
    !> Pressure (n_col, n_row) and shear traction (n_col, n_row, 2) [Pa]
    real(wp), intent(in) :: pressure(:, :), traction(:, :, :)
    real(wp) :: load(n_motion), part(n_motion, size(pressure, 2))
    integer :: row

    !$omp parallel do schedule(static) num_threads(self%space%threads)
    do row = 1, size(pressure, 2)
      part(normal, row) = sum(pressure(:, row))
      part(along_x, row) = sum(traction(:, row, 1))
      part(along_y, row) = sum(traction(:, row, 2))
      part(about_z, row) = dot_product(self%x(:, row), traction(:, row, 2)) - dot_product(self%y(:, row), traction(:, row, 1))
    end do
    !$omp end parallel do
    load = self%lattice%cell_area()*sum(part, dim=2)
  end function resultants

  !> r = kappa/(2 pi lambda_1 (1 + gamma) a) for a contact of n nodes, a its radius, (F8) [Pa/m].
  pure real(wp) function classification_parameter(self, n_contact) result(r)
    class(friction_problem_t), intent(in) :: self
    !> Nodes in contact
    integer, intent(in) :: n_contact

    r = self%options%contact%classification_scale/(2.0_wp*pi*(self%pair%lambda_1 + self%pair%lambda_5) &
                                                   *sqrt(self%lattice%cell_area()*max(n_contact, 1)/pi))
  end function classification_parameter

  !> r' = kappa/(2 pi lambda_1 a) [Pa/m].
  pure real(wp) function normal_classification_parameter(self, n_contact) result(r)
    class(friction_problem_t), intent(in) :: self
    !> Nodes in contact
    integer, intent(in) :: n_contact

    r = self%options%contact%classification_scale/(2.0_wp*pi*self%pair%lambda_1 &
                                                   *sqrt(self%lattice%cell_area()*max(n_contact, 1)/pi))
  end function normal_classification_parameter

  !> Gap, slip, zones, loads and residuals of a state whose tractions and motions are known.
  subroutine conclude(self, target, tolerance, reference, displacement, state)
    class(friction_problem_t), intent(in) :: self
    !> Loads or motions that were prescribed
    type(load_target_t), intent(in) :: target
    !> Bound of all residuals
    real(wp), intent(in) :: tolerance
    !> Relative displacement at the beginning of the step (n_col, n_row, 2) [m]
    real(wp), intent(in) :: reference(:, :, :)
    !> w, u_x, u_y of the tractions (n_col, n_row, 3) [m]
    real(wp), intent(in) :: displacement(:, :, :)
    !> State to be completed
    type(contact_state_t), intent(inout) :: state

    real(wp) :: r, unit
    integer :: col, row, m, n_contact
    logical :: finite

    n_contact = count(state%pressure > 0.0_wp)
    r = self%classification_parameter(n_contact)
    unit = max(self%space%max(state%pressure), 0.0_wp)
    if (unit > 0.0_wp) unit = 1.0_wp/unit
    finite = .true.
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(col, m) reduction(.and.: finite)
    do row = 1, size(state%pressure, 2)
      do col = 1, size(state%pressure, 1)
        state%gap(col, row) = self%initial_gap(col, row) + displacement(col, row, 1) - state%motion(normal)
        state%relative_displacement(col, row, 1) = displacement(col, row, 2) &
                                                   - (state%motion(along_x) - state%motion(about_z)*self%y(col, row))
        state%relative_displacement(col, row, 2) = displacement(col, row, 3) &
                                                   - (state%motion(along_y) + state%motion(about_z)*self%x(col, row))
      end do
      do m = 1, 2
        state%slip_increment(:, row, m) = merge(state%relative_displacement(:, row, m) - reference(:, row, m), 0.0_wp, &
                                                state%pressure(:, row) > 0.0_wp)
      end do
      if (self%friction%resists()) then
        call self%friction%find_zones((row - 1)*size(state%zone, 1) + 1, unit, r, state%pressure(:, row), &
                                      state%traction(:, row, 1), state%traction(:, row, 2), &
                                      state%slip_increment(:, row, 1), state%slip_increment(:, row, 2), state%zone(:, row))
      else
        state%zone(:, row) = merge(slip, separated, state%pressure(:, row) > 0.0_wp)
      end if
      finite = finite .and. all(ieee_is_finite(state%gap(:, row)) .or. .not. self%candidate(:, row)) .and. &
               all(ieee_is_finite(state%relative_displacement(:, row, :)))
    end do
    !$omp end parallel do

    state%load = self%resultants(state%pressure, state%traction)
    state%residual_normal = normal_residual(state%pressure, state%gap, self%candidate, self%normal_compliance, &
                                            self%space, self%normal_law)
    state%residual_tangential = tangential_residual(state%traction, state%slip_increment, state%pressure, &
                                                    self%friction, self%tangential_compliance, self%space)
    call self%judge_loads(target, state)
    ! one by one: the largest of several numbers hides one that is not a number
    finite = finite .and. all(ieee_is_finite(state%load)) .and. all(ieee_is_finite(state%motion))
    state%converged = all([state%residual_normal, state%residual_tangential, state%residual_force, &
                           state%residual_shear_force, state%residual_torque] <= tolerance) .and. finite
    state%clipped = touches_rim(state)
    state%stopped = merge(within_tolerance, sweeps_used_up, state%converged)
    if (.not. finite) state%stopped = out_of_range
  end subroutine conclude

  !> Residuals of the loads that were prescribed.
  subroutine judge_loads(self, target, state)
    class(friction_problem_t), intent(in) :: self
    !> Loads or motions that were prescribed
    type(load_target_t), intent(in) :: target
    !> State whose tractions and loads are known
    type(contact_state_t), intent(inout) :: state
    real(wp) :: scale, missing(n_motion)

    missing = merge(abs(state%load - target%value), 0.0_wp, target%control == force_control)
    state%residual_force = merge(force_residual(state%load(normal), target%value(normal)), 0.0_wp, &
                                 target%control(normal) == force_control)
    ! mu P, or P times the ratio of the largest traction to the largest pressure where there is no slip
    if (self%friction%is_bounded()) then
      scale = self%friction%strength()*state%load(normal)
    else
      scale = sqrt(maxval(sum(state%traction**2, dim=3)))/max(maxval(state%pressure), tiny(1.0_wp))
      scale = max(scale, least_traction)*state%load(normal)
    end if
    state%residual_shear_force = relative(norm2(missing(along_x:along_y)), scale)
    state%residual_torque = relative(missing(about_z), &
                                     scale*sqrt(self%lattice%cell_area()*count(state%pressure > 0.0_wp)/pi))
  end subroutine judge_loads

  !> A missing load relative to a scale; any at all is too much where the scale vanishes.
  elemental real(wp) function relative(missing, scale)
    real(wp), intent(in) :: missing, scale

    if (missing <= 0.0_wp) then
      relative = 0.0_wp
    else if (scale > 0.0_wp) then
      relative = missing/scale
    else
      relative = huge(1.0_wp)
    end if
  end function relative

end module hc_contact_problem
