!> An iterate of a frictional load step on one lattice.
!>
!> It holds tractions and motions with what they cause, and says which contact
!> area, which stick and slip zones and which residuals follow from them. How to
!> get to the next one is left to friction_sweep and friction_newton.
module hc_friction_iterate
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp, pi
  use hc_error, only: error_t
  use hc_contact_state, only: contact_state_t, load_target_t, separated, stick, slip, &
    normal, along_x, along_y, about_z, n_motion, force_control
  use hc_contact_residuals, only: normal_residual, tangential_residual, least_traction
  use hc_friction_law, only: linearize, on_cone, normal_to
  use hc_friction_problem, only: friction_problem_t, classification_scale
  use hc_spring_blend, only: soft
  use hc_driven_motions, only: driven_motions_t, new_driven_motions
  use hc_friction_systems, only: operators_t, pressure_system_t, shear_system_t, new_shear_system
  implicit none
  private

  public :: iterate_t, gap_residual, cautious

  !> The first guess of a shear traction from nothing: this much less of the slip counts.
  real(wp), parameter :: cautious = 0.2_wp
  !> Share of the nodes that are held where none sticks.
  real(wp), parameter :: held_share = 0.25_wp

  !> Tractions and what they cause, as vectors over all nodes; two components one after the other.
  type :: iterate_t
    !> Pressure and the closing of the gap that it causes
    real(wp), allocatable :: p(:), w(:)
    !> Shear traction, and the tangential displacement that it causes together with the pressure
    real(wp), allocatable :: q(:), u(:)
    !> Closing of the gap that the shear traction, cut to the cone, causes
    real(wp), allocatable :: closing(:)
    !> Nodes in contact
    logical, allocatable :: contact(:)
    !> Approach, shifts and twist
    real(wp) :: motion(n_motion) = 0.0_wp
    real(wp) :: residual_normal = 1.0_wp, residual_tangential = 1.0_wp
    !> No node sticks on its own, some were held so that a prescribed load can be carried
    logical :: held = .false.
    !> The prescribed loads cannot be reached: no node resists a motion
    logical :: sliding = .false.

    type(friction_problem_t), pointer :: problem => null()
    type(operators_t), pointer :: operators => null()
    type(pressure_system_t) :: pressure
    type(shear_system_t) :: shear
    type(load_target_t) :: target
    real(wp) :: tolerance = 0.0_wp
    !> Initial gap; relative displacement at the beginning of the step
    real(wp), allocatable :: h(:), origin(:)
    logical, allocatable :: candidate(:)
    !> Pressure drags tangentially; shear tractions move the pressure
    logical :: dragging = .false., pressing = .false.
    !> Factor of the classification parameter, the smaller the worse the iteration goes
    real(wp) :: caution = 1.0_wp
    !> Shear tractions solved for, and the least of their residuals R_t
    integer :: n_sweep = 0
    real(wp) :: best = huge(1.0_wp)
    !> Share of the next step that is taken if that residual does not fall
    real(wp) :: share = 0.5_wp
    !> About the pressure that an approach of the contact causes, and the shear traction of each rigid motion,
    !> components along x and y: what constraints are fulfilled with
    real(wp), allocatable :: lift(:, :), drag(:, :)
    !> The start knew of no contact
    logical :: cold = .false.
    !> Nothing has been solved yet
    logical :: first = .true.
  contains
    !> Start from a state
    procedure :: begin
    !> Displacements of the present tractions, from scratch
    procedure :: refresh
    !> Contact area that the present tractions call for
    procedure :: contact_area
    !> Stick, slip and frames that the present tractions call for
    procedure :: classify
    !> Prescribed tangential loads as constraints
    procedure :: constraints
    !> Displacement of the motions that are prescribed
    procedure :: prescribed_displacement
    !> Relative displacement since the beginning of the step
    procedure :: slip_increment
    !> Shear traction cut to the cone
    procedure :: on_cone => traction_on_cone
    !> Largest shear traction that there can be
    procedure :: traction_scale
    !> Residuals of the present tractions
    procedure :: find_residuals, find_tangential_residual
    !> Are all numbers numbers?
    procedure :: is_finite
  end type iterate_t

contains

  !> Start from a state.
  subroutine begin(self, problem, operators, start, reference, target, tolerance, error)
    class(iterate_t), intent(inout) :: self
    !> The problem
    type(friction_problem_t), intent(in), target :: problem
    !> Operator and preconditioners over its window
    type(operators_t), intent(inout), target :: operators
    !> State to start from
    type(contact_state_t), intent(in) :: start
    !> Relative displacement at the beginning of the step (n_col, n_row, 2) [m]
    real(wp), intent(in) :: reference(:, :, :)
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target
    !> Bound of all residuals
    real(wp), intent(in) :: tolerance
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    type(driven_motions_t) :: driven
    integer :: n

    n = problem%lattice%size()
    self%problem => problem
    self%operators => operators
    self%target = target
    self%tolerance = tolerance
    self%pressure%operators => operators
    self%pressure%n_threads = operators%n_threads
    call new_shear_system(self%shear, operators)
    self%h = reshape(problem%initial_gap, [n])
    self%origin = reshape(reference, [2*n])
    self%candidate = reshape(problem%candidate, [n])
    self%dragging = abs(problem%pair%lambda_2) > 0.0_wp
    self%pressing = self%dragging .and. problem%friction%resists() .and. .not. problem%goodman
    if (target%control(normal) /= force_control .and. .not. self%pressing) then
      ! pressure only opens the gap elsewhere: no contact where the bodies would not even overlap
      self%candidate = self%candidate .and. self%h < target%value(normal)
    end if

    self%p = reshape(start%pressure, [n])
    self%q = reshape(start%traction, [2*n])
    allocate (self%w(n), self%closing(n), self%u(2*n), source=0.0_wp)
    self%contact = self%p > 0.0_wp .and. self%candidate
    self%motion = merge(start%motion, target%value, target%control == force_control)
    if (any(self%contact)) then
      ! a twist turns about the middle of the contact, as far as the shifts are free
      call new_driven_motions(driven, problem, target, reshape(self%contact, problem%lattice%extent))
      associate (turned => self%motion(about_z) - start%motion(about_z))
        if (any(driven%motion == along_x)) self%motion(along_x) = self%motion(along_x) + turned*driven%center(2)
        if (any(driven%motion == along_y)) self%motion(along_y) = self%motion(along_y) - turned*driven%center(1)
      end associate
    else
      ! any pressure is better than none
      self%cold = .true.
      self%contact = self%candidate
      if (target%control(normal) /= force_control) self%contact = self%contact .and. self%h < target%value(normal)
      self%p = merge(1.0_wp, 0.0_wp, self%contact)
      self%q = 0.0_wp
    end if
    call self%refresh(error)
  end subroutine begin

  !> Displacements of the present tractions, from scratch.
  subroutine refresh(self, error)
    class(iterate_t), intent(inout) :: self
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: moved(:)
    integer :: n

    n = size(self%p)
    allocate (moved(3*n))
    self%u = 0.0_wp
    if (self%dragging .and. .not. (self%cold .and. self%first)) then
      call self%operators%apply([normal], self%p, [normal, along_x, along_y], moved, error)
      self%u = moved(n + 1:)
    else
      call self%operators%apply([normal], self%p, [normal], moved(:n), error)
    end if
    if (allocated(error)) return
    self%w = moved(:n)
    self%closing = 0.0_wp
    if (all_zero(self%q)) return
    if (self%pressing) then
      call self%operators%apply([along_x, along_y], self%q, [normal, along_x, along_y], moved, error)
      self%closing = moved(:n)
    else
      call self%operators%apply([along_x, along_y], self%q, [along_x, along_y], moved(n + 1:), error)
    end if
    if (allocated(error)) return
    self%u = self%u + moved(n + 1:)
  end subroutine refresh

  pure logical function all_zero(values)
    real(wp), intent(in) :: values(:)
    all_zero = .not. any(abs(values) > 0.0_wp)
  end function all_zero

  !> Nodes with p - r g > 0: one step of a projected gradient map, which contracts
  !> because r is scaled with the size of the contact.
  pure function contact_area(self, gap) result(contact)
    class(iterate_t), intent(in) :: self
    !> Gap of the present tractions [m]
    real(wp), intent(in) :: gap(:)
    logical, allocatable :: contact(:)
    real(wp) :: r

    r = classification_scale/(2.0_wp*pi*self%problem%pair%lambda_1 &
                              *sqrt(self%problem%lattice%cell_area()*max(count(self%contact), 1)/pi))
    contact = self%candidate .and. self%p - r*gap > 0.0_wp
    if (.not. any(contact)) contact = self%candidate .and. gap <= minval(gap, mask=self%candidate)
  end function contact_area

  !> Stick, slip and frames that the present tractions call for.
  !>
  !> The shear traction is put on the cone where a node slips, and its component across
  !> left as a start.
  subroutine classify(self, holding, active)
    class(iterate_t), intent(inout) :: self
    !> Let some nodes stick where none does
    logical, intent(in) :: holding
    !> Components in the frames that carry unknowns (2 n): both in stick, that along t in slip
    logical, allocatable, intent(out) :: active(:)
    real(wp), allocatable :: ds(:)
    integer, allocatable :: zone(:)
    real(wp) :: r, bound, largest, across, e(2)
    integer :: n, i

    n = size(self%p)
    allocate (ds, source=self%slip_increment())
    allocate (zone(n), source=separated)
    allocate (active(2*n), source=.false.)
    r = self%caution*self%problem%classification_parameter(count(self%contact))
    if (self%first .and. all_zero(self%q)) r = cautious*r
    associate (friction => self%problem%friction)
      largest = friction%bound(maxval(self%p))
      !$omp parallel do schedule(static) num_threads(self%operators%n_threads)
      do i = 1, n
        if (self%contact(i)) then
          call linearize([self%q(i), self%q(n + i)], [ds(i), ds(n + i)], friction%bound(self%p(i)), largest, r, zone(i), &
                         self%shear%direction(:, i), self%shear%compliance(i))
        else
          self%q([i, n + i]) = 0.0_wp
          self%shear%direction(:, i) = [1.0_wp, 0.0_wp]
          self%shear%compliance(i) = 0.0_wp
        end if
      end do
      !$omp end parallel do
      self%held = holding .and. .not. any(zone == stick)
      if (self%held) call hold(self%shear%compliance, zone)

      !$omp parallel do schedule(static) num_threads(self%operators%n_threads) private(bound, across, e)
      do i = 1, n
        active(i) = zone(i) /= separated
        active(n + i) = zone(i) == stick
        if (zone(i) == slip) then
          bound = friction%bound(self%p(i))
          e = self%shear%direction(:, i)
          across = 0.0_wp
          if (self%shear%compliance(i) < soft*self%shear%elastic_compliance) then
            across = dot_product(normal_to(e), [self%q(i), self%q(n + i)])
          end if
          self%q([i, n + i]) = bound*e + across*normal_to(e)
        end if
      end do
      !$omp end parallel do
    end associate
    call self%shear%weigh(self%contact)
  end subroutine classify

  !> Let the nodes stick that slip least: without any, nothing resists a prescribed load.
  subroutine hold(compliance, zone)
    !> Compliance of each node, the less the closer it is to sticking [m/Pa]
    real(wp), intent(inout) :: compliance(:)
    !> Zone of each node
    integer, intent(inout) :: zone(:)
    real(wp) :: low, high, middle
    integer :: i, n_contact

    n_contact = count(zone == slip)
    if (n_contact == 0) return
    low = minval(compliance, mask=zone == slip)
    high = maxval(compliance, mask=zone == slip)
    do i = 1, 60
      middle = sqrt(low)*sqrt(high)
      if (count(zone == slip .and. compliance <= middle) < held_share*n_contact) then
        low = middle
      else
        high = middle
      end if
    end do
    where (zone == slip .and. compliance <= high)
      zone = stick
      compliance = 0.0_wp
    end where
  end subroutine hold

  !> Loads that are prescribed as constraints on the unknowns.
  subroutine constraints(self, active, driven, constraint, missing)
    class(iterate_t), intent(in) :: self
    !> Unknowns, in the frames (2 n)
    logical, intent(in) :: active(:)
    !> Motions that are driven by their loads
    type(driven_motions_t), intent(out) :: driven
    !> Constraint vectors, in the frames (2 n, number of driven motions)
    real(wp), allocatable, intent(out) :: constraint(:, :)
    !> What the present traction lacks of the loads, over the cell area
    real(wp), allocatable, intent(out) :: missing(:)
    real(wp) :: plane(size(self%q))
    integer :: k

    call new_driven_motions(driven, self%problem, self%target, reshape(self%contact, self%problem%lattice%extent))
    allocate (constraint(size(self%q), size(driven%motion)), missing(size(driven%motion)))
    do k = 1, size(driven%motion)
      plane = driven%direction(k, self%problem)
      missing(k) = driven%load(k, self%problem, self%target) - dot_product(plane, self%q)
      call self%shear%to_frame(plane, constraint(:, k))
      where (.not. active) constraint(:, k) = 0.0_wp
    end do
  end subroutine constraints

  !> Displacement of the motions that are prescribed, x components first.
  pure function prescribed_displacement(self) result(displacement)
    class(iterate_t), intent(in) :: self
    real(wp), allocatable :: displacement(:)

    displacement = rigid(self%problem, merge(self%motion, 0.0_wp, self%target%control /= force_control))
  end function prescribed_displacement

  !> shift + twist x r at every node, x components first.
  pure function rigid(problem, motion)
    type(friction_problem_t), intent(in) :: problem
    real(wp), intent(in) :: motion(n_motion)
    real(wp), allocatable :: rigid(:)

    rigid = reshape(problem%rigid_displacement(motion), [2*problem%lattice%size()])
  end function rigid

  !> ds of the present tractions and motions at the nodes in contact, zero elsewhere.
  function slip_increment(self) result(ds)
    class(iterate_t), intent(in) :: self
    real(wp), allocatable :: ds(:)
    integer :: i, n, col, row, n_col

    n = size(self%p)
    n_col = self%problem%lattice%extent(1)
    allocate (ds(2*n))
    !$omp parallel do schedule(static) num_threads(self%operators%n_threads) private(i, col)
    do row = 1, n/n_col
      do col = 1, n_col
        i = (row - 1)*n_col + col
        ds(i) = 0.0_wp
        ds(n + i) = 0.0_wp
        if (.not. (self%contact(i) .or. self%p(i) > 0.0_wp)) cycle
        ds(i) = self%u(i) - self%origin(i) &
                - (self%motion(along_x) - self%motion(about_z)*self%problem%y(col, row))
        ds(n + i) = self%u(n + i) - self%origin(n + i) &
                    - (self%motion(along_y) + self%motion(about_z)*self%problem%x(col, row))
      end do
    end do
    !$omp end parallel do
  end function slip_increment

  !> Largest shear traction that there can be.
  pure real(wp) function traction_scale(self)
    class(iterate_t), intent(in) :: self
    integer :: n

    n = size(self%p)
    if (self%problem%friction%no_slip) then
      traction_scale = max(sqrt(maxval(self%q(:n)**2 + self%q(n + 1:)**2)), least_traction*maxval(self%p))
    else
      traction_scale = self%problem%friction%coefficient*maxval(self%p)
    end if
  end function traction_scale

  !> Shear traction cut to the cone.
  function traction_on_cone(self) result(q)
    class(iterate_t), intent(in) :: self
    real(wp), allocatable :: q(:)
    integer :: i, n

    n = size(self%p)
    allocate (q(2*n))
    !$omp parallel do schedule(static) num_threads(self%operators%n_threads)
    do i = 1, n
      if (self%p(i) > 0.0_wp) then
        q([i, n + i]) = on_cone([self%q(i), self%q(n + i)], self%problem%friction%bound(self%p(i)))
      else
        q([i, n + i]) = 0.0_wp
      end if
    end do
    !$omp end parallel do
  end function traction_on_cone

  !> Residuals of the present tractions; nothing is multiplied for them.
  subroutine find_residuals(self)
    class(iterate_t), intent(inout) :: self

    self%residual_normal = gap_residual(self%problem, self%p, self%h + self%closing + self%w - self%motion(normal))
    call self%find_tangential_residual()
  end subroutine find_residuals

  !> R_t alone.
  subroutine find_tangential_residual(self)
    class(iterate_t), intent(inout), target :: self
    real(wp), allocatable, target :: slipped(:)
    real(wp), pointer, contiguous :: p(:, :), q(:, :, :), ds(:, :, :)

    allocate (slipped, source=self%slip_increment())
    associate (n => self%problem%lattice%extent)
      p(1:n(1), 1:n(2)) => self%p
      q(1:n(1), 1:n(2), 1:2) => self%q
      ds(1:n(1), 1:n(2), 1:2) => slipped
    end associate
    self%residual_tangential = tangential_residual(q, ds, p, self%problem%friction, self%problem%tangential_compliance)
  end subroutine find_tangential_residual

  !> Are all tractions and motions finite numbers?
  pure logical function is_finite(self)
    class(iterate_t), intent(in) :: self

    is_finite = all(ieee_is_finite(self%p)) .and. all(ieee_is_finite(self%q)) .and. all(ieee_is_finite(self%motion))
  end function is_finite

  !> R_n of vectors.
  real(wp) function gap_residual(problem, pressure, gap)
    type(friction_problem_t), intent(in) :: problem
    real(wp), intent(in), contiguous, target :: pressure(:), gap(:)
    real(wp), pointer, contiguous :: p(:, :), g(:, :)

    associate (n => problem%lattice%extent)
      p(1:n(1), 1:n(2)) => pressure
      g(1:n(1), 1:n(2)) => gap
    end associate
    gap_residual = normal_residual(p, g, problem%candidate, problem%normal_compliance)
  end function gap_residual

end module hc_friction_iterate
