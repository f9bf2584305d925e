!> Frictionless contact on one lattice.
!>
!> Find pressure p and gap g = h + w - approach with p >= 0, g >= 0, p g = 0. Each
!> iteration takes the nodes with p - r g > 0 as active. While this set changes, a step of a
!> projected gradient method, p <- max(p + c M r, 0), finds pressure and set
!> together, with one product of the operator; M is close enough to the inverse of
!> the operator for that. Once the set stands still the steps become those of preconditioned
!> conjugate gradients. Where a set changes on and on (rough surfaces), it is held until
!> the linear problem on it is solved well enough to trust the next one.
module hc_normal_level
  use hc_precision, only: wp, pi
  use hc_error, only: error_t
  use hc_lattice, only: lattice_t
  use hc_flexibility, only: normal
  use hc_flexibility_fft, only: fft_flexibility_t
  use hc_contact_state, only: contact_state_t, new_contact_state, force_control
  use hc_contact_residuals, only: conclude
  use hc_preconditioner, only: preconditioner_t
  use hc_edge_extension, only: edge_extension_t, new_edge_extension
  implicit none
  private

  public :: normal_level_t

  !> Scale of the classification parameter: r = this/(2 pi lambda_1 a), a the contact radius.
  real(wp), parameter :: classification_scale = 10.0_wp
  !> Length c of a projected step: M is a little more than the inverse.
  real(wp), parameter :: step_length = 0.85_wp
  !> Projected steps have to bring the residual down by this factor every other time, or sets are held.
  real(wp), parameter :: progress = 0.5_wp
  !> Steps that are not judged.
  integer, parameter :: first_steps = 3
  !> A set that is held is given up when its residual has come down by this factor.
  real(wp), parameter :: held_accuracy = 0.1_wp

  !> The problem on one lattice.
  type :: normal_level_t
    type(lattice_t) :: lattice
    !> Initial gap (n_col, n_row) [m]
    real(wp), allocatable :: initial_gap(:, :)
    !> Nodes that may come into contact (n_col, n_row)
    logical, allocatable :: candidate(:, :)
    type(fft_flexibility_t) :: flexibility
    type(preconditioner_t) :: preconditioner
    !> Self-compliance of a node [m/Pa]
    real(wp) :: compliance = 0.0_wp
    !> Work of the preconditioner, in applications of the full operator
    real(wp) :: preconditioning = 0.0_wp
    !> Threads that share the vector operations
    integer :: n_threads = 1
  contains
    !> Solve for a normal load or an approach
    procedure :: solve
    !> Work so far, in applications of the full operator
    procedure :: work
  end type normal_level_t

  !> Present state of an iteration; fields are (n_col, n_row).
  type :: iterate_t
    !> Pressure and the closing of the gap that it causes
    real(wp), allocatable :: p(:, :), w(:, :)
    !> Residual on the active nodes, preconditioned residual, direction and its product
    real(wp), allocatable :: r(:, :), z(:, :), d(:, :), kd(:, :)
    !> The pressure of a rigid punch over the active nodes, about: M times one
    real(wp), allocatable :: punch(:, :)
    logical, allocatable :: active(:, :)
    !> Columns between which nodes are active, by row
    integer, allocatable :: span(:, :)
    type(edge_extension_t) :: edge
    real(wp) :: approach = 0.0_wp
    !> Residual R_n, and that on the active nodes alone
    real(wp) :: residual = huge(1.0_wp), residual_active = huge(1.0_wp)
    integer :: n_active = 0
  end type iterate_t

contains

  !> Solve for a normal load or an approach.
  subroutine solve(self, control, target, tolerance, max_sweeps, state, error)
    class(normal_level_t), intent(inout) :: self
    !> force_control or displacement_control
    integer, intent(in) :: control
    !> Normal load [N] or approach [m]
    real(wp), intent(in) :: target
    !> Bound of both residuals
    real(wp), intent(in) :: tolerance
    !> Iterations that may be made
    integer, intent(in) :: max_sweeps
    !> On entry its pressure is the start, up to a factor; on return the solution
    type(contact_state_t), intent(inout) :: state
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    type(iterate_t) :: now
    real(wp), allocatable :: start(:, :)
    real(wp) :: delta

    self%flexibility%applications = 0.0_wp
    self%preconditioning = 0.0_wp
    call move_alloc(state%pressure, start)
    call new_contact_state(state, self%lattice)
    delta = minval(self%initial_gap, mask=self%candidate)
    if (target <= merge(0.0_wp, delta, control == force_control)) then         ! nothing touches
      state%motion(normal) = merge(delta, target, control == force_control)
      state%gap = self%initial_gap - state%motion(normal)
    else
      call find_contact()
      if (allocated(error)) return
    end if
    call conclude(state, self%lattice, self%candidate, self%compliance, control, target, tolerance)

  contains

    subroutine find_contact()
      logical, allocatable :: candidate(:, :)

      allocate (candidate, source=self%candidate)
      ! pressure only opens the gap elsewhere: no contact where the bodies would not even overlap
      if (control /= force_control) candidate = candidate .and. self%initial_gap < target
      call begin(self, now, control, target, candidate, start, error)
      if (allocated(error)) return
      call iterate(self, now, control, target, tolerance, max_sweeps, candidate, state%sweeps, error)
      if (allocated(error)) return
      if (any(now%p < 0.0_wp)) then                                            ! within the tolerance
        now%p = max(now%p, 0.0_wp)
        call multiply(self, now%p, now%w, error)
        if (allocated(error)) return
      end if
      state%gap = self%initial_gap + now%w - now%approach
      call move_alloc(now%p, state%pressure)
      state%motion(normal) = now%approach
    end subroutine find_contact

  end subroutine solve

  pure real(wp) function work(self)
    class(normal_level_t), intent(in) :: self
    work = self%flexibility%applications + self%preconditioning
  end function work

  !> Pressure to start from, scaled to the load or to the least energy, and its closing of the gap.
  subroutine begin(self, now, control, target, candidate, start, error)
    type(normal_level_t), intent(inout) :: self
    type(iterate_t), intent(out) :: now
    integer, intent(in) :: control
    real(wp), intent(in) :: target
    logical, intent(in) :: candidate(:, :)
    real(wp), intent(in) :: start(:, :)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: factor

    allocate (now%p, source=merge(max(start, 0.0_wp), 0.0_wp, candidate))
    allocate (now%w, now%r, now%z, now%d, now%kd, mold=now%p)
    allocate (now%span(2, size(now%p, 2)))
    if (.not. any(now%p > 0.0_wp)) now%p = merge(1.0_wp, 0.0_wp, candidate)
    call multiply(self, now%p, now%w, error)
    if (allocated(error)) return
    now%approach = target
    if (control == force_control) then
      factor = target/(self%lattice%cell_area()*total(now%p))
      now%p = factor*now%p
      now%w = factor*now%w
    else
      call rescale(self, now)
    end if
    allocate (now%active, source=now%p > 0.0_wp)
    now%n_active = count(now%active)
  end subroutine begin

  !> Scale the pressure so that it has the least energy under a prescribed approach.
  subroutine rescale(self, now)
    class(normal_level_t), intent(in) :: self
    type(iterate_t), intent(inout) :: now
    real(wp) :: factor

    factor = total(now%p*(now%approach - self%initial_gap))/total(now%p*now%w)
    if (.not. factor > 0.0_wp) factor = now%approach/maxval(now%w)
    now%p = factor*now%p
    now%w = factor*now%w
  end subroutine rescale

  !> Sum by rows: it does not depend on the number of threads.
  pure real(wp) function total(field)
    real(wp), intent(in) :: field(:, :)
    total = sum(sum(field, dim=1))
  end function total

  !> Iterations up to the tolerance.
  subroutine iterate(self, now, control, target, tolerance, max_sweeps, candidate, sweeps, error)
    class(normal_level_t), intent(inout) :: self
    type(iterate_t), intent(inout) :: now
    integer, intent(in) :: control
    real(wp), intent(in) :: target
    real(wp), intent(in) :: tolerance
    integer, intent(in) :: max_sweeps
    logical, intent(in) :: candidate(:, :)
    !> Iterations made
    integer, intent(out) :: sweeps
    type(error_t), allocatable, intent(out) :: error

    logical, allocatable :: next(:, :)
    real(wp) :: lack, history(0:2), held_start, rz, rz_old
    logical :: changed, held, fresh, by_load

    by_load = control == force_control
    allocate (next, mold=now%active)
    history = huge(1.0_wp)
    held = .false.
    fresh = .false.
    held_start = 1.0_wp
    rz_old = 0.0_wp
    changed = .true.
    do sweeps = 1, max_sweeps
      if (by_load) call balance(self, now)
      call judge(self, now, candidate, next, changed)
      if (now%residual <= tolerance) return
      if (sweeps == 1) changed = .true.

      ! has the residual come down since the best but the last two?
      if (.not. held .and. sweeps > first_steps) held = now%residual > progress*history(2)
      history = [now%residual, min(history(0), huge(1.0_wp)), min(history(1), history(2))]
      if (held .and. changed) then
        if (fresh .and. now%residual_active > held_accuracy*held_start) then
          changed = .false.
          call keep_set(self, now)
        else
          held_start = min(now%residual, 1.0_wp)
          fresh = .true.
        end if
      end if

      if (changed) then
        call take_set(now, next)
        rz_old = 0.0_wp
        if (held) then
          now%d = merge(max(now%p, 0.0_wp), 0.0_wp, now%active)
        else
          call step_direction(self, now, by_load)
          now%d = merge(max(now%p + step_length*now%z, 0.0_wp), 0.0_wp, now%active)
        end if
        if (.not. any(now%d > 0.0_wp)) now%d = merge(1.0_wp, 0.0_wp, now%active)
        if (by_load) then
          if (.not. allocated(now%punch)) call press_punch(self, now)
          ! what was cut off goes where it changes the approach alone
          lack = target/self%lattice%cell_area() - total(now%d)
          now%d = now%d + lack/total(now%punch)*now%punch
        end if
        now%d = now%d - now%p
        call multiply(self, now%d, now%kd, error)
        if (allocated(error)) return
        now%p = now%p + now%d
        now%w = now%w + now%kd
        if (.not. by_load) call rescale(self, now)
      else
        call step_direction(self, now, by_load)
        rz = total(now%r*now%z)
        if (rz_old > 0.0_wp) then
          now%d = now%z + rz/rz_old*now%d
        else
          now%d = now%z
        end if
        rz_old = rz
        call multiply(self, now%d, now%kd, error)
        if (allocated(error)) return
        associate (curvature => total(now%d*now%kd))
          ! nothing is left to gain in working precision
          if (.not. curvature > 0.0_wp) return
          now%p = now%p + rz/curvature*now%d
          now%w = now%w + rz/curvature*now%kd
        end associate
      end if
    end do
    sweeps = max_sweeps
    if (by_load) call balance(self, now)
  end subroutine iterate

  !> The approach at which gap and pressure are in balance under a prescribed load.
  !>
  !> On a set that stands still the residual has no part along the motion of the punch; else
  !> the mean gap under the pressure vanishes.
  subroutine balance(self, now)
    class(normal_level_t), intent(in) :: self
    type(iterate_t), intent(inout) :: now

    if (allocated(now%punch)) then
      now%approach = total(now%punch*(self%initial_gap + now%w))/total(now%punch)
    else
      now%approach = total(now%p*(self%initial_gap + now%w))/total(now%p)
    end if
  end subroutine balance

  !> Residuals, the set that the present pressure and gap call for, and the residual on it.
  subroutine judge(self, now, candidate, next, changed)
    class(normal_level_t), intent(in) :: self
    type(iterate_t), intent(inout) :: now
    logical, intent(in) :: candidate(:, :)
    logical, intent(out) :: next(:, :)
    logical, intent(out) :: changed
    real(wp) :: r, gap, p_max, worst, worst_active
    integer :: col, row, n_next, n_changed

    r = classification_scale/(2.0_wp*pi*self%flexibility%pair%lambda_1*sqrt(self%lattice%cell_area()*now%n_active/pi))
    p_max = 0.0_wp
    worst = 0.0_wp
    worst_active = 0.0_wp
    n_next = 0
    n_changed = 0
    !$omp parallel do schedule(static) num_threads(self%n_threads) private(col, gap) &
    !$omp& reduction(max: p_max, worst, worst_active) reduction(+: n_next, n_changed)
    do row = 1, size(now%p, 2)
      do col = 1, size(now%p, 1)
        associate (p => now%p(col, row))
          gap = self%initial_gap(col, row) + now%w(col, row) - now%approach
          next(col, row) = candidate(col, row) .and. p - r*gap > 0.0_wp
          p_max = max(p_max, p)
          if (candidate(col, row)) worst = max(worst, abs(p - max(0.0_wp, p - gap/self%compliance)))
          if (now%active(col, row)) worst_active = max(worst_active, abs(gap))
          now%r(col, row) = merge(-gap, 0.0_wp, next(col, row))
          if (next(col, row)) n_next = n_next + 1
          if (next(col, row) .neqv. now%active(col, row)) n_changed = n_changed + 1
        end associate
      end do
    end do
    !$omp end parallel do
    now%residual = worst/p_max
    now%residual_active = worst_active/(self%compliance*p_max)
    changed = n_changed > 0
    if (n_next == 0) then                                    ! too much pressure everywhere: less of it on the old set
      next = now%active
      changed = .false.
      call keep_set(self, now)
    end if
  end subroutine judge

  !> Go on with the old set after all.
  subroutine keep_set(self, now)
    class(normal_level_t), intent(in) :: self
    type(iterate_t), intent(inout) :: now
    now%r = merge(now%approach - self%initial_gap - now%w, 0.0_wp, now%active)
  end subroutine keep_set

  !> Take a new set of active nodes.
  subroutine take_set(now, next)
    type(iterate_t), intent(inout) :: now
    logical, intent(in) :: next(:, :)

    now%active = next
    now%n_active = count(next)
    call new_edge_extension(now%edge, now%active)
    if (allocated(now%punch)) then
      now%punch = merge(now%punch, 0.0_wp, now%active)
      if (.not. total(now%punch) > 0.0_wp) deallocate (now%punch)
    end if
  end subroutine take_set

  !> z = M r, with the resultant of z taken out under a prescribed load.
  subroutine step_direction(self, now, by_load)
    class(normal_level_t), intent(inout) :: self
    type(iterate_t), intent(inout) :: now
    logical, intent(in) :: by_load

    if (by_load) then
      if (.not. allocated(now%punch)) call press_punch(self, now)
      call balance(self, now)
      call keep_set(self, now)
    end if
    call precondition(self, now, now%r, now%z)
    if (by_load) now%z = now%z - total(now%z)/total(now%punch)*now%punch
  end subroutine step_direction

  !> Pressure of a rigid punch over the active nodes, about.
  subroutine press_punch(self, now)
    class(normal_level_t), intent(inout) :: self
    type(iterate_t), intent(inout) :: now

    now%z = merge(1.0_wp, 0.0_wp, now%active)
    allocate (now%punch, mold=now%z)
    call precondition(self, now, now%z, now%punch)
    ! a weight that is nowhere negative
    now%punch = max(now%punch, 0.0_wp)
  end subroutine press_punch

  subroutine multiply(self, x, y, error)
    class(normal_level_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:, :)
    real(wp), intent(out), contiguous, target :: y(:, :)
    type(error_t), allocatable, intent(out) :: error
    real(wp), pointer, contiguous :: field(:, :, :), closing(:, :, :)

    field(1:size(x, 1), 1:size(x, 2), 1:1) => x
    closing(1:size(x, 1), 1:size(x, 2), 1:1) => y
    call self%flexibility%apply([normal], field, [normal], closing, error)
  end subroutine multiply

  !> z = M r on the active nodes, zero elsewhere.
  subroutine precondition(self, now, r, z)
    class(normal_level_t), intent(inout) :: self
    type(iterate_t), intent(in) :: now
    real(wp), intent(in), contiguous :: r(:, :)
    real(wp), intent(out), contiguous, target :: z(:, :)
    real(wp), allocatable, target :: continued(:, :)
    real(wp), pointer, contiguous :: field(:, :, :), pressure(:, :, :), flat(:)

    allocate (continued, source=r)
    flat(1:size(r)) => continued
    call now%edge%extend(flat)
    field(1:size(r, 1), 1:size(r, 2), 1:1) => continued
    pressure(1:size(r, 1), 1:size(r, 2), 1:1) => z
    call self%preconditioner%apply(field, pressure)
    flat(1:size(r)) => z
    call now%edge%fold(flat)
    where (.not. now%active) z = 0.0_wp
    self%preconditioning = self%preconditioning + self%preconditioner%cost
  end subroutine precondition

end module hc_normal_level
