!> A contact problem with friction: its data, and the residuals of a state.
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
  use hc_precision, only: wp, pi, lk
  use hc_error, only: error_t
  use hc_lattice, only: lattice_t
  use hc_field_space, only: field_space_t
  use hc_rolling, only: rolling_t
  use hc_hierarchy, only: level_t
  use hc_elastic_medium, only: elastic_medium_t
  use hc_flexibility, only: flexibility_t
  use hc_contact_state, only: contact_state_t, new_friction_state, load_target_t, separated, stick, &
    slip, normal, along_x, along_y, about_z, n_load, n_motion, remote_displacement, force_control, within_tolerance, &
    sweeps_used_up, loads_not_carried, out_of_range
  use hc_contact_residuals, only: tangential_compliances, largest_compliance, normal_residual, &
    tangential_residual, force_residual, relative, least_traction
  use hc_friction_law, only: friction_law_t
  use hc_normal_law, only: normal_law_t
  use hc_normal_problem, only: normal_problem_t, new_normal_problem
  implicit none
  private

  public :: friction_problem_t, new_friction_problem, near_reach

  !> Columns and rows on each side of a node that its traction moves where tractions are relaxed node by node: measured, fewer
  !> leave the zones less settled, more take longer
  integer, parameter :: near_reach = 5

  !> Data of a contact problem.
  type, extends(normal_problem_t) :: friction_problem_t
    !> Law of friction
    class(friction_law_t), allocatable :: friction
    !> Goodman's approximation: shear tractions do not move the pressure
    logical :: goodman = .false.
    !> Self-compliance d_t of a node [m/Pa]
    real(wp) :: tangential_compliance = 0.0_wp
    !> Tangential displacements near a node under its own pyramid of unit traction, xx, xy and yy [m/Pa]
    real(wp) :: near_compliance(-near_reach:near_reach, -near_reach:near_reach, 3) = 0.0_wp
  contains
    !> Bodies, laws and tuning numbers from another lattice
    procedure :: inherit
    !> Return whether pressure and shear traction act strongly on each other
    procedure :: couples_strongly
    !> State of bodies that do not touch
    procedure :: separate
    !> Relative displacements (w, u_x, u_y) of given tractions
    procedure :: displacements
    !> The same into a state
    procedure :: displace
    !> Tangential displacement of a rigid motion, at all nodes and at those of a row
    procedure :: rigid_displacement, rigid_displacement_row
    !> Resultants of given tractions
    procedure :: resultants
    !> Classification parameter r of the tangential conditions
    procedure :: classification_parameter
    !> Gap, slip, zones, loads and residuals of a state whose tractions and motions are known
    procedure :: complete_state
    !> Residuals of its loads alone
    procedure :: find_load_residuals
  end type friction_problem_t

contains

  !> Set up a problem.
  subroutine new_friction_problem(problem, lattice, medium, initial_gap, candidate, friction, goodman, error, normal_law, &
                                  space)
    !> Problem to be set up
    type(friction_problem_t), intent(out) :: problem
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> Initial gap (n_col, own rows) [m]
    real(wp), intent(in) :: initial_gap(:, :)
    !> Nodes that may come into contact (n_col, own rows)
    logical, intent(in) :: candidate(:, :)
    !> Law of friction
    class(friction_law_t), intent(in) :: friction
    !> Goodman's approximation: shear tractions do not move the pressure
    logical, intent(in) :: goodman
    !> Allocated on failure: wrong shapes, no candidate at all, numbers of no use, a negative coefficient
    type(error_t), allocatable, intent(out) :: error
    !> Law of contact along the normal; absent: unilateral contact
    class(normal_law_t), intent(in), optional :: normal_law
    !> Space of the fields; absent: this rank has all rows
    type(field_space_t), intent(in), optional :: space
    real(wp), allocatable :: values(:)

    call new_normal_problem(problem, lattice, medium, initial_gap, candidate, error, normal_law, space)
    if (allocated(error)) return
    call friction%check(problem%own_size(), error)
    call problem%space%ranks%agree(error)
    if (allocated(error)) return
    allocate (problem%friction, source=friction)
    call problem%friction%find_nodal_values(values)
    if (size(values) > 0) call problem%friction%set_nodal_values(values, problem%space%max(values))
    problem%goodman = goodman
    call set_geometry(problem)
  end subroutine new_friction_problem

  !> Take bodies, laws and tuning numbers of the same problem from another lattice.
  subroutine inherit(self, from)
    class(friction_problem_t), intent(inout) :: self
    class(level_t), intent(in) :: from

    call self%normal_problem_t%inherit(from)
    select type (from)
    type is (friction_problem_t)
      if (allocated(self%friction)) deallocate (self%friction)
      allocate (self%friction, source=from%friction)
      call take_nodal_values(self, from)
      self%goodman = from%goodman
    end select
    call set_geometry(self)
  end subroutine inherit

  !> Take the numbers of the nodes of a law of friction from a finer lattice, or from a larger window.
  subroutine take_nodal_values(self, from)
    type(friction_problem_t), intent(inout) :: self
    type(friction_problem_t), intent(in) :: from
    real(wp), allocatable :: values(:), field(:, :)

    call from%friction%find_nodal_values(values)
    if (size(values) == 0) return
    associate (given => reshape(values, [from%lattice%extent(1), from%own_rows()]))
      if (self%lattice%spacing() > 1.5_wp*from%lattice%spacing()) then
        call from%restrict(given, self, field)
      else
        call from%cut(given, self%lattice%first - from%lattice%first + 1, self, field)
      end if
    end associate
    call self%friction%set_nodal_values(reshape(field, [size(field)]), self%space%max(field))
  end subroutine take_nodal_values

  !> Set the tangential compliances of the nodes of the lattice.
  subroutine set_geometry(self)
    type(friction_problem_t), intent(inout) :: self

    self%near_compliance = tangential_compliances(self%lattice, self%medium, near_reach)
    self%tangential_compliance = largest_compliance(self%near_compliance(0, 0, :))
  end subroutine set_geometry

  !> Return whether pressure and shear traction act strongly on each other, by their coupling times min(mu, 1).
  pure logical function couples_strongly(self, target)
    class(friction_problem_t), intent(in) :: self
    !> Loads or motions: slip over a spacing of steadily rolling bodies feels any coupling
    type(load_target_t), intent(in) :: target

    couples_strongly = abs(self%medium%coupling())*min(self%friction%strength(0.0_wp), 1.0_wp) > &
                       merge(0.0_wp, self%options%contact%strong_coupling, target%rolling%steady) .and. .not. self%goodman
  end function couples_strongly

  !> Return the state of bodies that do not touch; motions that are driven by their load stay where they are.
  subroutine separate(self, start, reference, target, tolerance, state)
    class(friction_problem_t), intent(in) :: self
    !> State before
    type(contact_state_t), intent(in) :: start
    !> Relative displacement at the beginning of the step (n_col, n_row, 2) [m]
    real(wp), intent(in), contiguous :: reference(:, :, :)
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target
    !> Bound of all residuals
    real(wp), intent(in) :: tolerance
    !> State without contact; sliding where a tangential load is prescribed
    type(contact_state_t), intent(out) :: state

    call new_friction_state(state, self%lattice, self%space)
    state%motion = merge(start%motion, target%value, target%control == force_control)
    if (target%control(normal) == force_control) state%motion(normal) = self%space%min(self%initial_gap, self%candidate)
    call self%complete_state(target, tolerance, reference, state)
    state%sliding = .not. state%converged
    if (state%sliding) state%stopped = loads_not_carried
  end subroutine separate

  !> Compute the relative displacements (w, u_x, u_y) of given tractions, by any operator.
  subroutine displacements(self, flexibility, pressure, traction, displacement, error)
    class(friction_problem_t), intent(in) :: self
    !> Flexibility operator over the window
    class(flexibility_t), intent(inout) :: flexibility
    !> Pressure (n_col, n_row) and shear traction (n_col, n_row, 2) [Pa]
    real(wp), intent(in), contiguous, target :: pressure(:, :), traction(:, :, :)
    !> w, u_x, u_y (n_col, n_row, 3) [m]
    real(wp), intent(out), contiguous :: displacement(:, :, :)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: tractions(:, :, :)
    real(wp), pointer, contiguous :: alone(:, :, :)
    integer :: row

    if (.not. self%medium%couples()) then
      ! pressure and shear traction do not move each other: no copy of both
      alone(1:size(pressure, 1), 1:size(pressure, 2), 1:1) => pressure
      call flexibility%apply([normal], alone, [normal], displacement(:, :, :1), error)
      if (allocated(error)) return
      call flexibility%apply([along_x, along_y], traction, [along_x, along_y], displacement(:, :, 2:), error)
      return
    end if
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

  !> Compute the displacements by the tractions of a state, with any operator: w in its gap, u in its relative displacement, from
  !> which `complete_state` continues.
  subroutine displace(self, flexibility, state, error)
    class(friction_problem_t), intent(in) :: self
    !> Flexibility operator over the window
    class(flexibility_t), intent(inout) :: flexibility
    !> State whose tractions are known
    type(contact_state_t), intent(inout), target :: state
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: displacement(:, :, :)
    real(wp), pointer, contiguous :: acting(:, :, :), closing(:, :, :)

    if (self%medium%couples()) then
      allocate (displacement(size(state%pressure, 1), size(state%pressure, 2), 3))
      call self%displacements(flexibility, state%pressure, state%traction, displacement, error)
      if (allocated(error)) return
      state%gap = displacement(:, :, 1)
      state%relative_displacement = displacement(:, :, 2:)
    else
      ! pressure and shear traction do not move each other: each of them fills its field
      acting(1:size(state%pressure, 1), 1:size(state%pressure, 2), 1:1) => state%pressure
      closing(1:size(state%pressure, 1), 1:size(state%pressure, 2), 1:1) => state%gap
      call flexibility%apply([normal], acting, [normal], closing, error)
      if (allocated(error)) return
      call flexibility%apply([along_x, along_y], state%traction, [along_x, along_y], state%relative_displacement, error)
    end if
  end subroutine displace

  !> Compute the displacement by the motions of the remote parts at every node (n_col, own rows, 2) [m].
  pure function rigid_displacement(self, motion) result(displacement)
    class(friction_problem_t), intent(in) :: self
    !> Motions
    real(wp), intent(in) :: motion(n_motion)
    real(wp), allocatable :: displacement(:, :, :)
    integer :: row

    allocate (displacement(self%lattice%extent(1), self%own_rows(), 2))
    do row = 1, size(displacement, 2)
      call self%rigid_displacement_row(motion, row, displacement(:, row, 1), displacement(:, row, 2))
    end do
  end function rigid_displacement

  !> Compute it at nodes of a row, along which it changes evenly.
  pure subroutine rigid_displacement_row(self, motion, row, along, across, from)
    class(friction_problem_t), intent(in) :: self
    !> Motions
    real(wp), intent(in) :: motion(n_motion)
    !> Own row of the window, from 1 on
    integer, intent(in) :: row
    !> Components along x and y (number of nodes) [m]
    real(wp), intent(out), contiguous :: along(:), across(:)
    !> Column of the first node; absent: 1
    integer, intent(in), optional :: from
    real(wp) :: first(2), step(2), x(1), y(1), no_shift(n_motion)
    integer :: i, col

    call self%lattice%row_coordinates(row + self%rows_before(), x, y)
    first = remote_displacement(motion, x(1), y(1))
    no_shift = motion
    no_shift([along_x, along_y]) = 0.0_wp
    step = remote_displacement(no_shift, self%lattice%basis(1, 1), self%lattice%basis(2, 1))
    col = 1
    if (present(from)) col = from
    do i = 1, size(along)
      along(i) = first(1) + (col + i - 2)*step(1)
      across(i) = first(2) + (col + i - 2)*step(2)
    end do
  end subroutine rigid_displacement_row

  !> Compute normal load, tangential loads [N] and torque [N m] of given tractions.
  function resultants(self, pressure, traction) result(load)
    class(friction_problem_t), intent(in) :: self
    !> Pressure (n_col, n_row) and shear traction (n_col, n_row, 2) [Pa]
    real(wp), intent(in) :: pressure(:, :), traction(:, :, :)
    real(wp) :: load(n_motion), part(size(pressure, 2), n_load), x(size(pressure, 1)), y(size(pressure, 1))
    integer :: row, k

    !$omp parallel do schedule(static) num_threads(self%space%threads) private(x, y)
    do row = 1, size(pressure, 2)
      part(row, normal) = sum(pressure(:, row))
      part(row, along_x) = sum(traction(:, row, 1))
      part(row, along_y) = sum(traction(:, row, 2))
      call self%lattice%row_coordinates(row + self%rows_before(), x, y)
      part(row, about_z) = dot_product(x, traction(:, row, 2)) - dot_product(y, traction(:, row, 1))
    end do
    !$omp end parallel do
    load = 0.0_wp
    do k = 1, n_load
      load(k) = self%lattice%cell_area()*self%space%total(part(:, k))
    end do
    if (self%lattice%is_periodic()) load(about_z) = 0.0_wp                     ! a torque does not repeat
  end function resultants

  !> Compute r = kappa/(2 pi lambda a) for a contact of n nodes, a its radius, (F8) [Pa/m].
  !>
  !> In a narrow window that repeats a contact goes on across: a is no less than half of its width along the longer period.
  pure real(wp) function classification_parameter(self, n_contact) result(r)
    class(friction_problem_t), intent(in) :: self
    !> Nodes in contact
    integer, intent(in) :: n_contact
    real(wp) :: radius, longest

    radius = sqrt(self%lattice%cell_area()*max(n_contact, 1)/pi)
    if (self%lattice%is_periodic()) then
      longest = maxval(norm2(self%lattice%basis, dim=1)*self%lattice%extent)
      radius = max(radius, 0.5_wp*longest*n_contact/self%lattice%size())
    end if
    r = self%options%contact%classification_parameter(self%medium%shear_point(radius), radius)
    r = r/(1.0_wp + r*self%medium%spring_compliance())
  end function classification_parameter

  !> Compute gap, slip, zones, loads and residuals of a state whose tractions, motions and displacements are known.
  subroutine complete_state(self, target, tolerance, reference, state)
    class(friction_problem_t), intent(in) :: self
    !> Loads or motions that were prescribed
    type(load_target_t), intent(in) :: target
    !> Bound of all residuals
    real(wp), intent(in) :: tolerance
    !> Relative displacement at the beginning of the step (n_col, n_row, 2) [m]
    real(wp), intent(in), contiguous :: reference(:, :, :)
    !> State to be completed: its gap and relative displacement are w, u_x and u_y of its tractions (`displace`)
    type(contact_state_t), intent(inout) :: state

    real(wp), allocatable :: over_spacing(:, :, :)
    real(wp) :: r, unit, least, remote(size(state%pressure, 1), 2)
    integer :: row, m, n_contact
    logical :: finite

    n_contact = self%space%count_positive(state%pressure)
    r = self%classification_parameter(n_contact)
    unit = max(self%space%max(state%pressure), 0.0_wp)
    ! slip that R_t does not see: a node that moves no more sticks
    least = 0.0_wp
    if (unit > 0.0_wp) then
      if (self%friction%is_bounded()) least = tolerance*self%tangential_compliance*self%friction%largest_bound(unit)
      unit = 1.0_wp/unit
    end if
    if (target%rolling%steady) call slip_over_spacing(target%rolling, state%relative_displacement, over_spacing)
    finite = .true.
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(m, remote) reduction(.and.: finite)
    do row = 1, size(state%pressure, 2)
      state%gap(:, row) = self%initial_gap(:, row) + state%gap(:, row) - state%motion(normal)
      call self%rigid_displacement_row(state%motion, row, remote(:, 1), remote(:, 2))
      do m = 1, 2
        state%relative_displacement(:, row, m) = state%relative_displacement(:, row, m) - remote(:, m)
        state%slip_increment(:, row, m) = state%relative_displacement(:, row, m) - reference(:, row, m)
        if (target%rolling%steady) state%slip_increment(:, row, m) = over_spacing(:, row, m) - remote(:, m)
        state%slip_increment(:, row, m) = merge(state%slip_increment(:, row, m), 0.0_wp, state%pressure(:, row) > 0.0_wp)
      end do
      if (self%friction%resists()) then
        call self%friction%find_zones((row - 1)*size(state%zone, 1) + 1, unit, r, state%pressure(:, row), &
                                      state%traction(:, row, 1), state%traction(:, row, 2), &
                                      state%slip_increment(:, row, 1), state%slip_increment(:, row, 2), state%zone(:, row))
        ! where nothing slips, round-off would decide which nodes on the boundary do
        where (state%zone(:, row) == slip .and. hypot(state%slip_increment(:, row, 1), state%slip_increment(:, row, 2)) <= least) &
          state%zone(:, row) = stick
      else
        state%zone(:, row) = merge(slip, separated, state%pressure(:, row) > 0.0_wp)
      end if
      finite = finite .and. all(ieee_is_finite(state%gap(:, row)) .or. .not. self%candidate(:, row)) .and. &
               all(ieee_is_finite(state%relative_displacement(:, row, :)))
    end do
    !$omp end parallel do
    finite = self%space%number(merge(0, 1, finite)) == 0

    state%load = self%resultants(state%pressure, state%traction)
    state%residual_normal = normal_residual(state%pressure, state%gap, logical(self%candidate), self%normal_compliance, &
                                            self%space, self%normal_law)
    state%residual_tangential = tangential_residual(state%traction, state%slip_increment, state%pressure, &
                                                    self%friction, self%tangential_compliance, self%space)
    call self%find_load_residuals(target, state)
    ! one by one: the largest of several numbers hides one that is not a number
    finite = finite .and. all(ieee_is_finite(state%load)) .and. all(ieee_is_finite(state%motion))
    state%converged = all([state%residual_normal, state%residual_tangential, state%residual_force, &
                           state%residual_shear_force, state%residual_torque] <= tolerance) .and. finite
    state%clipped = self%reaches_rim(state) .and. .not. self%lattice%is_periodic()
    state%stopped = merge(within_tolerance, sweeps_used_up, state%converged)
    if (.not. finite) state%stopped = out_of_range
  end subroutine complete_state

  !> Compute the slip of steadily rolling bodies over a spacing, before rigid motions, from their displacement.
  subroutine slip_over_spacing(rolling, displacement, slip)
    type(rolling_t), intent(in) :: rolling
    !> u (n_col, n_row, 2) [m]
    real(wp), intent(in) :: displacement(:, :, :)
    !> u less u at the node ahead [m]
    real(wp), allocatable, intent(out), target :: slip(:, :, :)
    real(wp), pointer, contiguous :: along(:)
    integer :: m

    allocate (slip, source=displacement)
    do m = 1, 2
      along(1:size(slip(:, :, m))) => slip(:, :, m)
      call rolling%subtract_ahead(size(slip, 1), along)
    end do
  end subroutine slip_over_spacing

  !> Compute the residuals of the loads that were prescribed.
  subroutine find_load_residuals(self, target, state)
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
      scale = self%friction%strength(self%space%max(state%pressure))*state%load(normal)
    else
      scale = sqrt(self%space%max(sum(state%traction**2, dim=3)))/max(self%space%max(state%pressure), tiny(1.0_wp))
      scale = max(scale, least_traction)*state%load(normal)
    end if
    state%residual_shear_force = relative(norm2(missing(along_x:along_y)), scale)
    state%residual_torque = relative(missing(about_z), &
                                     scale*sqrt(self%lattice%cell_area()*self%space%count_positive(state%pressure)/pi))
  end subroutine find_load_residuals

end module hc_contact_problem
