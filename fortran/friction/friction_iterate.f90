!> An iterate of a frictional load step on one lattice.
!>
!> An iterate is tractions and motions with the displacements that they cause; this module computes its residuals.
!> The zones that it calls for are found in active_zones, the next iterate in staggered_newton and coupled_newton.
!>
!> Equations: docs/theory/friction.md, (F1).
module hc_friction_iterate
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp, lk
  use hc_error, only: error_t
  use hc_contact_state, only: contact_state_t, load_target_t, load_step_t, normal, along_x, along_y, about_z, n_motion, &
    force_control
  use hc_contact_residuals, only: normal_residual, tangential_scale
  use hc_contact_problem, only: friction_problem_t
  use hc_load_constraints, only: driven_motions_t, new_driven_motions
  use hc_operator_set, only: operators_t
  use hc_pressure_system, only: pressure_system_t
  use hc_shear_system, only: shear_system_t, new_shear_system
  use hc_linear_system, only: solution_accurate
  use hc_active_set, only: find_span, packed_fields_t
  use hc_field_space, only: field_space_t
  implicit none
  private

  public :: friction_iterate_t

  !> Tractions and their displacements, as vectors over all nodes; two components one after the other.
  type :: friction_iterate_t
    !> Pressure and the closing of the gap that it causes
    real(wp), allocatable :: p(:), w(:)
    !> Shear traction, and the tangential displacement that it causes together with the pressure
    real(wp), allocatable :: q(:), u(:)
    !> Closing of the gap that the shear traction causes; no element where it causes none
    real(wp), allocatable :: closing(:)
    !> It is that of the traction cut to the cone, as a staggered sweep leaves it; or it is part of `w`, and
    !> `closing` is zero, as after a coupled sweep
    logical :: cut = .false., joint = .false.
    !> Bound of the error of these displacements off the contact by directions of single precision [m]
    real(wp) :: rounding = 0.0_wp
    !> Nodes in contact
    logical(lk), allocatable :: contact(:)
    !> Approach, shifts and twist
    real(wp) :: motion(n_motion) = 0.0_wp
    real(wp) :: residual_normal = 1.0_wp, residual_tangential = 1.0_wp
    !> Too few nodes stick: some were fixed in stick so that a prescribed load can be carried
    logical :: fixed = .false.
    !> Even so nothing resists a motion whose load is prescribed
    logical :: unsupported = .false.

    type(friction_problem_t), pointer :: problem => null()
    type(operators_t), pointer :: operators => null()
    type(pressure_system_t) :: pressure
    type(shear_system_t) :: shear
    type(load_target_t) :: target
    real(wp) :: tolerance = 0.0_wp
    !> Initial gap; relative displacement at the beginning of the step
    real(wp), pointer, contiguous :: h(:) => null(), origin(:) => null()
    !> Nodes that may touch: those of the problem, or the ones among them where the bodies would overlap
    logical(lk), pointer, contiguous :: candidate(:) => null()
    logical(lk), allocatable :: reached(:)
    !> Pressure moves nodes tangentially; shear tractions move them along the normal, and so the pressure
    logical :: shear_feels_pressure = .false., pressure_feels_shear = .false.
    !> Factor of the classification parameter: smaller under strong coupling and where nodes are fixed in stick
    real(wp) :: share_of_r = 1.0_wp
    !> Shear tractions solved for
    integer :: n_shear = 0
    !> Estimates, with the preconditioner, of the pressure that an approach of the contact causes, and of the shear traction of
    !> each rigid motion, components along x and y: they correct tractions that do not carry the prescribed loads
    type(packed_fields_t), allocatable :: punch_pressure, rigid_traction
    !> How the linear solutions of the last sweep ended, the worst of them
    integer :: outcome = solution_accurate
    !> The start had no contact
    logical :: without_start = .false.
    !> Nothing has been solved yet
    logical :: first = .true.
    !> `w` and `u` have errors of interpolation, until the first sweep
    logical :: estimated = .false.
  contains
    !> Set the tractions and motions of a start
    procedure :: set_start
    !> Displacements of the present tractions, from scratch; free them until then, or all that the next sweep makes
    procedure :: refresh, forget_displacements, forget
    !> Gap of the present tractions and approach, and its residual
    procedure :: find_gap, gap_residual
    !> Relative displacement since the beginning of the step, along one row
    procedure :: slip_row
    !> Shear traction cut to the cone
    procedure :: project_to_cone
    !> Largest shear traction that there can be
    procedure :: traction_scale
    !> Residuals of the present tractions
    procedure :: find_residuals, find_tangential_residual
    !> Are tractions and motions finite?
    procedure :: is_finite
    !> Cut the classification parameter
    procedure :: cut_parameter
    !> Sum of the pressure over the window
    procedure :: pressure_sum
  end type friction_iterate_t

contains

  !> Cut the classification parameter (docs/theory/friction.md, "Globalisation").
  pure subroutine cut_parameter(self, factor)
    class(friction_iterate_t), intent(inout) :: self
    !> Factor of the cut
    real(wp), intent(in) :: factor

    self%share_of_r = max(factor*self%share_of_r, self%problem%options%newton%least_share_of_r)
  end subroutine cut_parameter

  !> Sum the pressure over the window, row by row.
  real(wp) function pressure_sum(self)
    class(friction_iterate_t), intent(in), target :: self
    real(wp), pointer, contiguous :: p(:, :)

    associate (n => self%problem%own_extent())
      p(1:n(1), 1:n(2)) => self%p
    end associate
    pressure_sum = self%operators%space%sum(p)
  end function pressure_sum

  !> Set tractions and motions from those of a state, and compute the displacements.
  subroutine set_start(self, problem, operators, start, step, error, estimate)
    class(friction_iterate_t), intent(inout), target :: self
    !> The problem
    type(friction_problem_t), intent(in), target :: problem
    !> Operator and preconditioners over its window
    type(operators_t), intent(inout), target :: operators
    !> State to start from, whose tractions are freed
    type(contact_state_t), intent(inout), target :: start
    !> The load step, whose reference is not copied
    type(load_step_t), intent(in) :: step
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    !> w, u_x, u_y of the start but for an error of interpolation (n_col, n_row, 3), if known; freed [m]
    real(wp), allocatable, intent(inout), optional :: estimate(:, :, :)
    type(driven_motions_t) :: driven
    real(wp), pointer, contiguous :: pressure(:), traction(:)
    integer :: i

    call set_problem(self, problem, operators, step)
    pressure(1:size(start%pressure)) => start%pressure
    traction(1:size(start%traction)) => start%traction
    call operators%space%copy(pressure, self%p)
    call operators%space%copy(traction, self%q)
    !$omp parallel do simd schedule(static) num_threads(operators%space%threads)
    do i = 1, size(self%p)
      self%contact(i) = self%p(i) > 0.0_wp .and. self%candidate(i)
    end do
    !$omp end parallel do simd
    deallocate (start%pressure, start%traction)
    self%motion = merge(start%motion, step%target%value, step%target%control == force_control)
    if (operators%space%count(self%contact) > 0) then
      ! a twist turns about the middle of the contact, as far as the shifts are free
      call new_driven_motions(driven, problem, step%target, self%contact)
      associate (turned => self%motion(about_z) - start%motion(about_z))
        if (any(driven%motion == along_x)) self%motion(along_x) = self%motion(along_x) + turned*driven%center(2)
        if (any(driven%motion == along_y)) self%motion(along_y) = self%motion(along_y) - turned*driven%center(1)
      end associate
    else
      ! initial guess: uniform pressure on all nodes that may touch
      self%without_start = .true.
      self%contact = self%candidate
      if (step%target%control(normal) /= force_control) self%contact = self%contact .and. self%h < step%target%value(normal)
      self%p = merge(1.0_wp, 0.0_wp, self%contact)
      self%q = 0.0_wp
    end if
    if (present(estimate)) self%estimated = allocated(estimate) .and. .not. self%without_start
    if (self%estimated) then
      call take_estimate(self, estimate, error)
    else
      call self%refresh(error)
    end if
    if (present(estimate)) then
      if (allocated(estimate)) deallocate (estimate)
    end if
  end subroutine set_start

  !> Set the problem that is solved, and allocate tractions and springs.
  subroutine set_problem(self, problem, operators, step)
    class(friction_iterate_t), intent(inout), target :: self
    !> The problem
    type(friction_problem_t), intent(in), target :: problem
    !> Operator and preconditioners over its window
    type(operators_t), intent(inout), target :: operators
    !> The load step, whose reference is not copied
    type(load_step_t), intent(in) :: step
    integer :: n

    n = problem%own_size()
    self%problem => problem
    self%operators => operators
    self%target = step%target
    self%tolerance = step%tolerance
    operators%rolling = step%target%rolling
    self%pressure%operators => operators
    self%pressure%space = operators%space
    call new_shear_system(self%shear, operators)
    self%shear_feels_pressure = problem%medium%couples()
    self%pressure_feels_shear = self%shear_feels_pressure .and. problem%friction%resists() .and. .not. problem%goodman
    self%h(1:n) => problem%initial_gap
    self%origin(1:2*n) => step%reference
    allocate (self%p(n), self%q(2*n))
    allocate (self%contact(n))
    self%candidate(1:n) => problem%candidate
    if (step%target%control(normal) /= force_control .and. .not. self%pressure_feels_shear &
        .and. problem%medium%trace() > 0.0_wp .and. .not. problem%lattice%is_periodic()) then
      ! pressure only opens the gap elsewhere: no contact where the bodies would not even overlap; from mean planes it
      ! closes it, and layers bulge
      allocate (self%reached(n))
      self%reached = self%candidate .and. self%h < step%target%value(normal)
      self%candidate => self%reached
    end if
    if (problem%normal_law%is_compliant()) allocate (self%pressure%compliance(n), self%pressure%offset(n), source=0.0_wp)
  end subroutine set_problem

  !> Take displacements that were estimated; the closing by the shear traction is found: the pressure needs it by itself.
  subroutine take_estimate(self, estimate, error)
    class(friction_iterate_t), intent(inout) :: self
    !> w, u_x, u_y (n_col, n_row, 3) [m]
    real(wp), intent(in), contiguous, target :: estimate(:, :, :)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), pointer, contiguous :: moved(:)
    integer :: n

    n = size(self%p)
    call allocate_displacements(self)
    if (self%pressure_feels_shear) then
      call self%operators%apply([along_x, along_y], self%q, [normal], self%closing, error)
      if (allocated(error)) return
    end if
    moved(1:3*n) => estimate
    call self%operators%space%copy(moved(:n), self%w)
    if (self%pressure_feels_shear) self%w = self%w - self%closing
    call self%operators%space%copy(moved(n + 1:), self%u)
  end subroutine take_estimate

  !> Compute the displacements of the present tractions anew.
  subroutine refresh(self, error)
    class(friction_iterate_t), intent(inout) :: self
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: moved(:)
    type(field_space_t) :: space
    integer :: n

    n = size(self%p)
    space = self%operators%space
    self%cut = .false.
    self%joint = .false.
    self%rounding = 0.0_wp
    if (.not. allocated(self%w)) call allocate_displacements(self)
    allocate (moved(3*n))
    if (self%shear_feels_pressure .and. .not. (self%without_start .and. self%first)) then
      call self%operators%apply([normal], self%p, [normal, along_x, along_y], moved, error)
      if (allocated(error)) return
      call space%copy(moved(:n), self%w)
      call space%copy(moved(n + 1:), self%u)
    else
      call self%operators%apply([normal], self%p, [normal], self%w, error)
      if (allocated(error)) return
      call space%fill(self%u, 0.0_wp)
    end if
    if (self%pressure_feels_shear) call space%fill(self%closing, 0.0_wp)
    if (.not. space%max_abs(self%q) > 0.0_wp) return
    if (self%pressure_feels_shear) then
      call self%operators%apply([along_x, along_y], self%q, [normal, along_x, along_y], moved, error)
      if (allocated(error)) return
      call space%copy(moved(:n), self%closing)
    else
      call self%operators%apply([along_x, along_y], self%q, [along_x, along_y], moved(n + 1:), error)
      if (allocated(error)) return
    end if
    call space%add(moved(n + 1:), self%u)
  end subroutine refresh

  !> Allocate the displacements.
  subroutine allocate_displacements(self)
    class(friction_iterate_t), intent(inout) :: self

    associate (n => size(self%p))
      allocate (self%w(n), self%closing(merge(n, 0, self%pressure_feels_shear)), self%u(2*n))
    end associate
  end subroutine allocate_displacements

  !> Free the displacements; the next ones come from `refresh`.
  subroutine forget_displacements(self)
    class(friction_iterate_t), intent(inout) :: self

    deallocate (self%w, self%closing, self%u)
  end subroutine forget_displacements

  !> Free all but tractions, motions and contact; a next sweep comes after `refresh`.
  subroutine forget(self)
    class(friction_iterate_t), intent(inout) :: self

    call self%forget_displacements()
    if (allocated(self%shear%compliance)) deallocate (self%shear%direction, self%shear%compliance)
    if (allocated(self%punch_pressure)) deallocate (self%punch_pressure)
    if (allocated(self%rigid_traction)) deallocate (self%rigid_traction)
  end subroutine forget

  !> Compute the gap of the present tractions and approach.
  subroutine find_gap(self, gap)
    class(friction_iterate_t), intent(in) :: self
    !> The gap (n) [m]
    real(wp), allocatable, intent(out) :: gap(:)
    integer :: i

    allocate (gap(size(self%p)))
    !$omp parallel do schedule(static) num_threads(self%operators%space%threads)
    do i = 1, size(gap)
      gap(i) = self%h(i)
      if (self%pressure_feels_shear) gap(i) = gap(i) + self%closing(i)
      gap(i) = gap(i) + self%w(i) - self%motion(normal)
    end do
    !$omp end parallel do
  end subroutine find_gap

  !> Compute ds of the present tractions and motions at nodes of a row, from a column on; zero off the contact.
  pure subroutine slip_row(self, row, col, dsx, dsy)
    class(friction_iterate_t), intent(in) :: self
    integer, intent(in) :: row, col
    !> Components along x and y (number of nodes)
    real(wp), intent(out), contiguous :: dsx(:), dsy(:)
    real(wp) :: touches(size(dsx))
    integer :: i, n, at

    n = size(self%p)
    call self%problem%rigid_displacement_row(self%motion, row, dsx, dsy, col)
    at = (row - 1)*self%problem%lattice%extent(1) + col - 1
    do i = 1, size(dsx)
      touches(i) = merge(1.0_wp, 0.0_wp, self%contact(at + i))
    end do
    do i = 1, size(dsx)
      touches(i) = max(touches(i), merge(1.0_wp, 0.0_wp, self%p(at + i) > 0.0_wp))
      dsx(i) = touches(i)*(self%u(at + i) - self%origin(at + i) - dsx(i))
      dsy(i) = touches(i)*(self%u(n + at + i) - self%origin(n + at + i) - dsy(i))
    end do
  end subroutine slip_row

  !> Compute the largest shear traction that there can be.
  real(wp) function traction_scale(self)
    class(friction_iterate_t), intent(in) :: self
    real(wp) :: largest
    integer :: n

    n = size(self%p)
    largest = 0.0_wp
    traction_scale = self%operators%space%max(self%p)
    if (.not. self%problem%friction%is_bounded()) then
      largest = self%operators%space%max((self%q(:n)/traction_scale)**2 + (self%q(n + 1:)/traction_scale)**2)
    end if
    traction_scale = tangential_scale(self%problem%friction, traction_scale, largest)*traction_scale
  end function traction_scale

  !> Project the shear traction on the admissible set.
  subroutine project_to_cone(self, q)
    class(friction_iterate_t), intent(in) :: self
    !> The traction, components along x and y (2 n) [Pa]
    real(wp), intent(inout), contiguous :: q(:)
    real(wp) :: unit
    integer :: n, n_col, row, from, to

    n = size(self%p)
    n_col = self%problem%lattice%extent(1)
    unit = pressure_unit(self)
    !$omp parallel do schedule(static) num_threads(self%operators%space%threads) private(from, to)
    do row = 1, n/n_col
      from = (row - 1)*n_col + 1
      to = row*n_col
      call self%problem%friction%project(from, unit, self%p(from:to), self%q(from:to), self%q(n + from:n + to), q(from:to), &
                                         q(n + from:n + to))
    end do
    !$omp end parallel do
  end subroutine project_to_cone

  !> Compute the inverse of the largest pressure, 0 without pressure [1/Pa].
  real(wp) function pressure_unit(self)
    class(friction_iterate_t), intent(in) :: self

    pressure_unit = max(self%operators%space%max(self%p), 0.0_wp)
    if (pressure_unit > 0.0_wp) pressure_unit = 1.0_wp/pressure_unit
  end function pressure_unit

  !> Compute the residuals of the present tractions, without a product.
  subroutine find_residuals(self, tangential_known)
    class(friction_iterate_t), intent(inout) :: self
    !> R_t has been computed; default: it has not
    logical, intent(in), optional :: tangential_known
    real(wp), allocatable :: gap(:)
    logical :: known

    call self%find_gap(gap)
    self%residual_normal = self%gap_residual(gap)
    known = .false.
    if (present(tangential_known)) known = tangential_known
    if (.not. known) call self%find_tangential_residual()
  end subroutine find_residuals

  !> Compute R_t alone.
  subroutine find_tangential_residual(self)
    class(friction_iterate_t), intent(inout) :: self
    real(wp), dimension(self%problem%lattice%extent(1)) :: dsx, dsy
    real(wp) :: unit, largest, worst, most(2)
    integer :: n, n_col, row, from, to, low, high

    n = size(self%p)
    self%residual_tangential = 0.0_wp
    unit = pressure_unit(self)
    if (.not. (unit > 0.0_wp .and. self%problem%friction%resists())) return
    largest = 0.0_wp
    worst = 0.0_wp
    n_col = size(dsx)
    !$omp parallel do schedule(static) num_threads(self%operators%space%threads) private(dsx, dsy, from, to, low, high) &
    !$omp& reduction(max: largest, worst)
    do row = 1, n/n_col
      call find_span(self%p((row - 1)*n_col + 1:row*n_col), low, high)
      from = (row - 1)*n_col + low
      to = (row - 1)*n_col + high
      call self%slip_row(row, low, dsx(low:high), dsy(low:high))
      call self%problem%friction%violation(from, unit, 1.0_wp/self%problem%tangential_compliance, self%p(from:to), &
                                           self%q(from:to), self%q(n + from:n + to), dsx(low:high), dsy(low:high), largest, worst)
    end do
    !$omp end parallel do
    most = [largest, worst]
    call self%operators%space%most(most)
    self%residual_tangential = sqrt(most(2))/tangential_scale(self%problem%friction, 1.0_wp/unit, most(1))
  end subroutine find_tangential_residual

  !> Return whether all tractions and motions are finite numbers.
  logical function is_finite(self)
    class(friction_iterate_t), intent(in) :: self
    real(wp) :: rest
    integer :: n, i

    n = size(self%p)
    ! a number less itself is 0, unless it is infinite or none
    rest = 0.0_wp
    !$omp parallel do simd schedule(static) num_threads(self%operators%space%threads) reduction(+: rest)
    do i = 1, n
      rest = rest + (self%p(i) - self%p(i)) + (self%q(i) - self%q(i)) + (self%q(n + i) - self%q(n + i))
    end do
    !$omp end parallel do simd
    is_finite = self%operators%space%number(merge(0, 1, abs(rest) <= 0.0_wp)) == 0 .and. all(ieee_is_finite(self%motion))
  end function is_finite

  !> Compute R_n of a gap under the present pressure.
  real(wp) function gap_residual(self, gap)
    class(friction_iterate_t), intent(in), target :: self
    !> Gap (n) [m]
    real(wp), intent(in), contiguous, target :: gap(:)
    real(wp), pointer, contiguous :: p(:, :), g(:, :)

    associate (n => self%problem%own_extent())
      p(1:n(1), 1:n(2)) => self%p
      g(1:n(1), 1:n(2)) => gap
    end associate
    gap_residual = normal_residual(p, g, logical(self%problem%candidate), self%problem%normal_compliance, self%operators%space, &
                                   self%problem%normal_law)
  end function gap_residual

end module hc_friction_iterate
