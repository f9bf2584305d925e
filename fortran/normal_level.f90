!> Frictionless contact on one lattice.
!>
!> Find pressure p and gap g = h + w - approach with p >= 0, g >= 0, p g = 0. Each
!> iteration takes the nodes with p - r g > 0 as active. While this set changes, a step of a
!> projected gradient method, p <- max(p + c M r, 0), finds pressure and set
!> together, with one product of the operator; M is close enough to the inverse of
!> the operator for that. Once the set stands still the steps become those of preconditioned
!> conjugate gradients. Where a set changes on and on (rough surfaces), it is held until
!> the linear problem on it is solved well enough to trust the next one.
!>
!> What is added to the pressure is multiplied in single precision, and pressure and gap are
!> summed up in double precision. The error that this can have left in the gap is kept
!> account of; before it matters the gap is found anew from the pressure, in double precision.
module hc_normal_level
  use hc_precision, only: wp, sp, pi
  use hc_error, only: error_t, status, raise
  use hc_lattice, only: lattice_t
  use hc_elastic_pair, only: elastic_pair_t
  use hc_flexibility, only: normal
  use hc_fftw, only: good_size
  use hc_flexibility_fft, only: fft_flexibility_t, new_fft_flexibility
  use hc_normal_kernel, only: normal_kernel_t
  use hc_convolution_single, only: convolution_t, new_convolution, kernel_source_t, threads_for
  use hc_contact_state, only: contact_state_t, new_contact_state, force_control
  use hc_contact_residuals, only: conclude, normal_self_compliance
  use hc_preconditioner, only: preconditioner_t, new_preconditioner, single_cost
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
  !> Error of a product in single precision, relative to its largest value.
  real(wp), parameter :: single_error = epsilon(1.0_sp)
  !> Share of a residual, and of the tolerance, that such errors may make up.
  real(wp), parameter :: residual_share = 0.01_wp, tolerance_share = 0.1_wp

  !> The problem on one lattice.
  type :: normal_level_t
    type(lattice_t) :: lattice
    !> Initial gap (n_col, n_row) [m]
    real(wp), allocatable :: initial_gap(:, :)
    !> Nodes that may come into contact (n_col, n_row)
    logical, allocatable :: candidate(:, :)
    type(elastic_pair_t), private :: pair
    type(preconditioner_t), private :: preconditioner
    !> The flexibility in single precision, in units of that of the preconditioner
    type(convolution_t), private :: single
    !> The flexibility in double precision; is it there, and is the rest?
    type(fft_flexibility_t), private :: flexibility
    logical, private :: exact = .false., iterating = .false.
    !> Self-compliance of a node [m/Pa]
    real(wp), private :: compliance = 0.0_wp
    !> Work in single precision, in applications of the full operator
    real(wp), private :: single_work = 0.0_wp
    !> Threads that share the vector operations
    integer, private :: n_threads = 1
  contains
    !> Operators
    procedure :: prepare
    !> Gap, zones, load and residuals of a given pressure
    procedure :: conclude_anew
    !> Solve for a normal load or an approach
    procedure :: solve
    !> Work so far, in applications of the full operator
    procedure :: work
  end type normal_level_t

  !> The kernel of the pressure in single precision.
  type, extends(kernel_source_t) :: rounded_kernel_t
    type(normal_kernel_t), pointer :: kernel => null()
    !> Unit that it is measured in [m/Pa]
    real(wp) :: unit = 1.0_wp
  contains
    procedure :: row => rounded_row
  end type rounded_kernel_t

  !> Present state of an iteration; fields are (n_col, n_row).
  !>
  !> Those in single precision are zero off the active nodes, r but for the rings of the
  !> continuation and z and kd everywhere; their units are p_unit and p_unit times that of the preconditioner.
  type :: iterate_t
    !> Pressure [Pa] and the closing of the gap that it causes [m]
    real(wp), allocatable :: p(:, :), w(:, :)
    !> Residual, preconditioned residual, direction and its product
    real(sp), allocatable :: r(:, :, :), z(:, :, :), d(:, :, :), kd(:, :, :)
    !> About the pressure of a rigid punch over the active nodes: M times one; zero off them
    real(sp), allocatable :: punch(:, :)
    real(wp) :: punch_sum = 0.0_wp
    logical, allocatable :: active(:, :)
    !> Columns between which the active nodes of each row lie, now and before: no pressure outside
    integer, allocatable :: span(:, :)
    type(edge_extension_t) :: edge
    real(wp) :: approach = 0.0_wp
    !> Unit of the pressure in single precision [Pa], and of the closing of the gap [m]
    real(wp) :: p_unit = 1.0_wp, w_unit = 1.0_wp
    !> Error that products in single precision may have left in w [m]
    real(wp) :: stale = 0.0_wp
    real(wp) :: p_max = 0.0_wp
    !> Residual R_n, and the same on the active nodes alone
    real(wp) :: residual = huge(1.0_wp), residual_active = huge(1.0_wp)
    !> Active nodes, now and next
    integer :: n_active = 0, n_next = 0
  end type iterate_t

contains

  !> Operators of a problem whose lattice, gap and candidates are known; those that are there are kept.
  subroutine prepare(self, pair, kernel, exact, iterating, error, n_threads)
    class(normal_level_t), intent(inout) :: self
    !> Elastic constants of the two bodies
    type(elastic_pair_t), intent(in) :: pair
    !> The kernel on this lattice
    type(normal_kernel_t), intent(in), target :: kernel
    !> The operator in double precision is wanted; what iterations need is wanted
    logical, intent(in) :: exact, iterating
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Threads to use; absent or 0: as many as OpenMP would take
    integer, intent(in), optional :: n_threads
    type(rounded_kernel_t) :: rounded

    self%pair = pair
    self%compliance = normal_self_compliance(self%lattice, pair)
    self%n_threads = threads_for(self%lattice%extent, n_threads)
    if (exact .and. .not. self%exact) then
      call new_fft_flexibility(self%flexibility, self%lattice, pair, error, normal_only=.true., n_threads=n_threads, &
                               kernel=kernel)
      if (allocated(error)) return
      self%exact = .true.
    end if
    if (self%iterating .or. .not. iterating) return
    call new_preconditioner(self%preconditioner, self%lattice, pair, error, n_threads)
    if (allocated(error)) return
    call new_convolution(self%single, self%lattice%extent, good_size(2*self%lattice%extent - 1), 1, 1, error, &
                         n_threads=n_threads)
    if (allocated(error)) return
    if (self%exact) then
      self%single%spectrum = real(self%flexibility%convolution%spectrum/self%preconditioner%unit, sp)
    else
      rounded%kernel => kernel
      rounded%unit = self%preconditioner%unit
      call self%single%transform_kernels(rounded, error)
    end if
    self%iterating = .true.
  end subroutine prepare

  !> Gap, zones, load and residuals of a given pressure at a given approach.
  subroutine conclude_anew(self, control, target, tolerance, state, error)
    class(normal_level_t), intent(inout), target :: self
    !> force_control or displacement_control
    integer, intent(in) :: control
    !> Normal load [N] or approach [m]
    real(wp), intent(in) :: target
    !> Bound of the residuals
    real(wp), intent(in) :: tolerance
    !> State whose pressure and approach are known
    type(contact_state_t), intent(inout), target :: state
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), pointer, contiguous :: field(:, :, :), closing(:, :, :)

    associate (n => self%lattice%extent)
      field(1:n(1), 1:n(2), 1:1) => state%pressure
      closing(1:n(1), 1:n(2), 1:1) => state%gap
    end associate
    self%flexibility%applications = 0.0_wp
    self%single_work = 0.0_wp
    call self%flexibility%apply([normal], field, [normal], closing, error)
    if (allocated(error)) return
    state%gap = self%initial_gap + state%gap - state%motion(normal)
    call conclude(state, self%lattice, self%candidate, self%compliance, control, target, tolerance)
  end subroutine conclude_anew

  pure subroutine rounded_row(self, j, k)
    class(rounded_kernel_t), intent(in) :: self
    integer, intent(in) :: j
    real(sp), intent(out) :: k(:, :)
    real(wp) :: row(size(k, 1), size(k, 2))

    call self%kernel%row(j, row)
    k = real(row/self%unit, sp)
  end subroutine rounded_row

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
    self%single_work = 0.0_wp
    call move_alloc(state%pressure, start)
    call new_contact_state(state, self%lattice)
    delta = minval(self%initial_gap, mask=self%candidate)
    if (target <= merge(0.0_wp, delta, control == force_control)) then         ! nothing touches
      state%motion(normal) = merge(delta, target, control == force_control)
      state%gap = self%initial_gap - state%motion(normal)
    else
      call iterate(self, now, control == force_control, target, tolerance, max_sweeps, start, state%sweeps, error)
      if (allocated(error)) return
      if (any(now%p < 0.0_wp)) then                                            ! within the tolerance
        now%p = max(now%p, 0.0_wp)
        if (self%exact) call find_closing(self, now, error)
        if (allocated(error)) return
      end if
      state%gap = self%initial_gap + now%w - now%approach
      call move_alloc(now%p, state%pressure)
      state%motion(normal) = now%approach
    end if
    call conclude(state, self%lattice, self%candidate, self%compliance, control, target, tolerance)
  end subroutine solve

  pure real(wp) function work(self)
    class(normal_level_t), intent(in) :: self
    work = self%flexibility%applications + self%single_work
  end function work

  !> Iterations up to the tolerance.
  subroutine iterate(self, now, by_load, target, tolerance, max_sweeps, start, sweeps, error)
    class(normal_level_t), intent(inout) :: self
    type(iterate_t), intent(out) :: now
    !> The normal load is prescribed, not the approach
    logical, intent(in) :: by_load
    !> Normal load [N] or approach [m]
    real(wp), intent(in) :: target
    real(wp), intent(in) :: tolerance
    integer, intent(in) :: max_sweeps
    !> Pressure to start from, up to a factor
    real(wp), intent(in) :: start(:, :)
    !> Iterations made
    integer, intent(out) :: sweeps
    type(error_t), allocatable, intent(out) :: error

    logical, allocatable :: candidate(:, :), next(:, :)
    real(wp) :: history(3), held_start, rz_old, pressures, share
    logical :: changed, held, fresh

    allocate (candidate, source=self%candidate)
    ! pressure only opens the gap elsewhere: no contact where the bodies would not even overlap
    if (.not. by_load) candidate = candidate .and. self%initial_gap < target
    pressures = target/self%lattice%cell_area()                  ! of no meaning under a prescribed approach
    call begin(self, now, by_load, target, candidate, start, error)
    if (allocated(error)) return
    allocate (next, mold=candidate)
    history = huge(1.0_wp)
    held = .false.
    fresh = .false.
    held_start = 1.0_wp
    rz_old = 0.0_wp
    sweeps = 0
    do
      if (by_load) call balance(self, now)
      call judge(self, now, candidate, next, changed)
      if (self%exact .and. now%stale > self%compliance*now%p_max*max(residual_share*now%residual, tolerance_share*tolerance)) then
        if (by_load) call fit_load(self, now, pressures)
        call find_closing(self, now, error)
        if (allocated(error)) return
        cycle
      end if
      if (now%residual <= tolerance .and. by_load .and. self%exact) then
        if (abs(load_lack(self, now, pressures)) > tolerance_share*tolerance*pressures) then
          call fit_load(self, now, pressures)
          call find_closing(self, now, error)
          if (allocated(error)) return
          cycle
        end if
      end if
      if (now%residual <= tolerance .or. sweeps == max_sweeps) return
      sweeps = sweeps + 1
      if (sweeps == 1) changed = .true.

      ! has the residual come down, compared with the best but the last two?
      if (.not. held .and. sweeps > first_steps) held = now%residual > progress*history(3)
      history = [now%residual, history(1), min(history(2), history(3))]
      if (held .and. changed) then
        if (fresh .and. now%residual_active > held_accuracy*held_start) then
          changed = .false.
        else
          held_start = min(now%residual, 1.0_wp)
          fresh = .true.
        end if
      end if

      if (changed) then
        call take_set(self, now, next)
        rz_old = 0.0_wp
      end if
      if (by_load .and. .not. allocated(now%punch)) call press_punch(self, now)
      if (.not. (changed .and. held)) then
        if (by_load .and. changed) call balance(self, now)
        call find_residual(self, now)
        call precondition(self, now)
      end if
      if (changed) then
        call projected_step(self, now, held, by_load, pressures)
        share = 1.0_wp
      else
        call next_direction(self, now, by_load, rz_old)
      end if
      call multiply(self, now)
      if (.not. changed) then
        share = step_share(self, now, rz_old)
        if (.not. share > 0.0_wp) then
          ! nothing is left to gain in single precision, and perhaps at all
          if (.not. (self%exact .and. now%stale > 0.0_wp)) return
          now%stale = huge(1.0_wp)
          cycle
        end if
      end if
      call advance(self, now, share)
      if (changed .and. .not. by_load) call rescale(self, now)
    end do
  end subroutine iterate

  !> Pressure to start from, scaled to the load or to the least energy, and its closing of the gap.
  subroutine begin(self, now, by_load, target, candidate, start, error)
    class(normal_level_t), intent(inout) :: self
    type(iterate_t), intent(inout) :: now
    logical, intent(in) :: by_load
    real(wp), intent(in) :: target
    logical, intent(in) :: candidate(:, :)
    real(wp), intent(in) :: start(:, :)
    type(error_t), allocatable, intent(out) :: error
    integer :: n(2), stat

    n = self%lattice%extent
    allocate (now%p(n(1), n(2)), now%w(n(1), n(2)), stat=stat)
    if (stat == 0) allocate (now%r(n(1), n(2), 1), now%z(n(1), n(2), 1), now%d(n(1), n(2), 1), now%kd(n(1), n(2), 1), &
                             source=0.0_sp, stat=stat)
    if (stat == 0) allocate (now%active(n(1), n(2)), now%span(2, n(2)), stat=stat)
    if (stat /= 0) then
      call raise(error, status%resources, 'not enough memory for the fields: use a smaller window')
      return
    end if
    now%p = merge(max(start, 0.0_wp), 0.0_wp, candidate)
    if (.not. any(now%p > 0.0_wp)) now%p = merge(1.0_wp, 0.0_wp, candidate)
    now%approach = target
    if (by_load) now%p = target/(self%lattice%cell_area()*sum(sum(now%p, dim=1)))*now%p
    now%active = now%p > 0.0_wp
    now%n_active = count(now%active)
    now%span(1, :) = n(1) + 1
    now%span(2, :) = 0
    call find_span(now)
    now%p_unit = maxval(now%p)
    now%w_unit = now%p_unit*self%preconditioner%unit
    now%w = 0.0_wp
    now%d(:, :, 1) = real(now%p/now%p_unit, sp)
    now%p = 0.0_wp
    call multiply(self, now)
    call advance(self, now, 1.0_wp)
    if (.not. by_load) then
      call rescale(self, now)
      now%p_unit = maxval(now%p)
      now%w_unit = now%p_unit*self%preconditioner%unit
    end if
  end subroutine begin

  !> Scale the pressure so that it has the least energy under a prescribed approach.
  subroutine rescale(self, now)
    class(normal_level_t), intent(in) :: self
    type(iterate_t), intent(inout) :: now
    real(wp) :: overlap(size(now%p, 2)), resistance(size(now%p, 2)), factor
    integer :: row

    !$omp parallel do schedule(static) num_threads(self%n_threads)
    do row = 1, size(now%p, 2)
      associate (from => now%span(1, row), to => now%span(2, row))
        overlap(row) = sum(now%p(from:to, row)*(now%approach - self%initial_gap(from:to, row)), &
                           mask=now%active(from:to, row))
        resistance(row) = dot_product(now%p(from:to, row), now%w(from:to, row))
      end associate
    end do
    !$omp end parallel do
    factor = sum(overlap)/sum(resistance)
    if (.not. factor > 0.0_wp) factor = now%approach/maxval(now%w)
    now%p = factor*now%p
    now%w = factor*now%w
    now%stale = factor*now%stale
  end subroutine rescale

  !> The approach at which gap and pressure are in balance under a prescribed load.
  !>
  !> The residual then has no part along the motion of the punch; before there is one, the mean gap
  !> under the pressure vanishes.
  subroutine balance(self, now)
    class(normal_level_t), intent(in) :: self
    type(iterate_t), intent(inout) :: now
    real(wp) :: weight(size(now%p, 2)), lift(size(now%p, 2)), u
    integer :: col, row

    !$omp parallel do schedule(static) num_threads(self%n_threads) private(col, u)
    do row = 1, size(now%p, 2)
      associate (from => now%span(1, row), to => now%span(2, row))
        weight(row) = 0.0_wp
        lift(row) = 0.0_wp
        if (allocated(now%punch)) then
          do col = from, to
            u = now%punch(col, row)
            weight(row) = weight(row) + u
            ! the gap may be infinite where nothing can touch
            if (u > 0.0_wp) lift(row) = lift(row) + u*(self%initial_gap(col, row) + now%w(col, row))
          end do
        else
          do col = from, to
            u = now%p(col, row)
            weight(row) = weight(row) + u
            if (u > 0.0_wp) lift(row) = lift(row) + u*(self%initial_gap(col, row) + now%w(col, row))
          end do
        end if
      end associate
    end do
    !$omp end parallel do
    now%approach = sum(lift)/sum(weight)
  end subroutine balance

  !> Residuals, and the set that the present pressure and gap call for.
  subroutine judge(self, now, candidate, next, changed)
    class(normal_level_t), intent(in) :: self
    type(iterate_t), intent(inout) :: now
    logical, intent(in) :: candidate(:, :)
    logical, intent(out) :: next(:, :)
    !> The new set is another one
    logical, intent(out) :: changed
    real(wp) :: r, gap, p, p_max, worst, worst_active
    integer :: col, row, n_next, n_changed
    logical :: enters

    r = classification_scale/(2.0_wp*pi*self%pair%lambda_1*sqrt(self%lattice%cell_area()*now%n_active/pi))
    p_max = 0.0_wp
    worst = 0.0_wp
    worst_active = 0.0_wp
    n_next = 0
    n_changed = 0
    !$omp parallel do schedule(static) num_threads(self%n_threads) private(col, gap, p, enters) &
    !$omp& reduction(max: p_max, worst, worst_active) reduction(+: n_next, n_changed)
    do row = 1, size(now%p, 2)
      next(:, row) = .false.
      do col = 1, size(now%p, 1)
        gap = self%initial_gap(col, row) + now%w(col, row) - now%approach
        if (col < now%span(1, row) .or. col > now%span(2, row)) then
          if (gap >= 0.0_wp) cycle                                             ! no pressure there, and none called for
        end if
        if (.not. candidate(col, row)) cycle
        p = now%p(col, row)
        enters = p - r*gap > 0.0_wp
        next(col, row) = enters
        p_max = max(p_max, p)
        worst = max(worst, abs(min(p, gap/self%compliance)))
        if (enters) n_next = n_next + 1
        if (now%active(col, row)) then
          worst_active = max(worst_active, abs(gap))
          if (.not. enters) n_changed = n_changed + 1
        else
          if (enters) n_changed = n_changed + 1
        end if
      end do
    end do
    !$omp end parallel do
    now%p_max = p_max
    now%residual = worst/p_max
    now%residual_active = worst_active/(self%compliance*p_max)
    changed = n_changed > 0 .and. n_next > 0
    now%n_next = n_next
    if (n_next > 0) return
    ! too much pressure everywhere: less of it on the old set
    next = now%active
    now%n_next = now%n_active
  end subroutine judge

  !> Take a new set of active nodes.
  subroutine take_set(self, now, next)
    class(normal_level_t), intent(in) :: self
    type(iterate_t), intent(inout) :: now
    !> The new set; on return the old one
    logical, allocatable, intent(inout) :: next(:, :)
    logical, allocatable :: swap(:, :)
    integer :: row

    call move_alloc(now%active, swap)
    call move_alloc(next, now%active)
    call move_alloc(swap, next)
    now%n_active = now%n_next
    call find_span(now)
    call new_edge_extension(now%edge, now%active)
    !$omp parallel do schedule(static) num_threads(self%n_threads)
    do row = 1, size(now%p, 2)
      now%r(:, row, 1) = 0.0_sp
      if (.not. allocated(now%punch)) cycle
      where (.not. now%active(:, row)) now%punch(:, row) = 0.0_sp
    end do
    !$omp end parallel do
    if (.not. allocated(now%punch)) return
    now%punch_sum = total(now%punch, self%n_threads)
    if (.not. now%punch_sum > 0.0_wp) deallocate (now%punch)
  end subroutine take_set

  !> Columns between which the active nodes of each row lie, those of earlier sets included.
  pure subroutine find_span(now)
    type(iterate_t), intent(inout) :: now
    integer :: row

    do row = 1, size(now%active, 2)
      if (.not. any(now%active(:, row))) cycle
      now%span(1, row) = min(now%span(1, row), findloc(now%active(:, row), .true., dim=1))
      now%span(2, row) = max(now%span(2, row), findloc(now%active(:, row), .true., dim=1, back=.true.))
    end do
  end subroutine find_span

  !> Sum in double precision, row by row: it does not depend on the number of threads.
  real(wp) function total(field, n_threads)
    real(sp), intent(in) :: field(:, :)
    integer, intent(in) :: n_threads
    real(wp) :: part(size(field, 2))
    integer :: row

    !$omp parallel do schedule(static) num_threads(n_threads)
    do row = 1, size(field, 2)
      part(row) = sum(real(field(:, row), wp))
    end do
    !$omp end parallel do
    total = sum(part)
  end function total

  !> Pressure of a rigid punch over the active nodes, about, and nowhere negative.
  subroutine press_punch(self, now)
    class(normal_level_t), intent(inout) :: self
    type(iterate_t), intent(inout) :: now

    integer :: row

    !$omp parallel do schedule(static) num_threads(self%n_threads)
    do row = 1, size(now%p, 2)
      now%r(:, row, 1) = merge(1.0_sp, 0.0_sp, now%active(:, row))
    end do
    !$omp end parallel do
    call precondition(self, now)
    allocate (now%punch(size(now%p, 1), size(now%p, 2)))
    !$omp parallel do schedule(static) num_threads(self%n_threads)
    do row = 1, size(now%p, 2)
      now%punch(:, row) = merge(max(now%z(:, row, 1), 0.0_sp), 0.0_sp, now%active(:, row))
    end do
    !$omp end parallel do
    now%punch_sum = total(now%punch, self%n_threads)
  end subroutine press_punch

  !> r = approach - h - w on the active nodes.
  subroutine find_residual(self, now)
    class(normal_level_t), intent(in) :: self
    type(iterate_t), intent(inout) :: now
    integer :: col, row

    !$omp parallel do schedule(static) num_threads(self%n_threads) private(col)
    do row = 1, size(now%p, 2)
      do col = now%span(1, row), now%span(2, row)
        if (.not. now%active(col, row)) cycle
        now%r(col, row, 1) = real((now%approach - self%initial_gap(col, row) - now%w(col, row))/now%w_unit, sp)
      end do
    end do
    !$omp end parallel do
  end subroutine find_residual

  !> z = M r.
  subroutine precondition(self, now)
    class(normal_level_t), intent(inout) :: self
    type(iterate_t), intent(inout) :: now

    call self%preconditioner%apply_single(now%r, now%z, now%edge)
    self%single_work = self%single_work + self%preconditioner%cost
  end subroutine precondition

  !> d = max(p + c z, 0) - p on the active nodes, -p elsewhere; or what is left of p, on a set to be held.
  subroutine projected_step(self, now, held, by_load, pressures)
    class(normal_level_t), intent(in) :: self
    type(iterate_t), intent(inout) :: now
    logical, intent(in) :: held, by_load
    !> Sum of the pressures under a prescribed load
    real(wp), intent(in) :: pressures
    real(wp) :: part(size(now%p, 2)), aim, mean
    real(sp) :: lack
    integer :: col, row

    mean = 0.0_wp
    if (by_load .and. .not. held) then
      !$omp parallel do schedule(static) num_threads(self%n_threads) private(col)
      do row = 1, size(now%p, 2)
        part(row) = 0.0_wp
        do col = now%span(1, row), now%span(2, row)
          if (now%active(col, row)) part(row) = part(row) + now%z(col, row, 1)
        end do
      end do
      !$omp end parallel do
      mean = sum(part)/now%punch_sum
    end if
    !$omp parallel do schedule(static) num_threads(self%n_threads) private(col, aim)
    do row = 1, size(now%p, 2)
      now%d(:, row, 1) = 0.0_sp
      part(row) = 0.0_wp
      do col = now%span(1, row), now%span(2, row)
        aim = 0.0_wp
        if (now%active(col, row)) then
          aim = now%p(col, row)/now%p_unit
          if (.not. held) then
            aim = aim + step_length*now%z(col, row, 1)
            if (by_load) aim = aim - step_length*mean*now%punch(col, row)
          end if
          aim = max(aim, 0.0_wp)
          part(row) = part(row) + aim
        end if
        now%d(col, row, 1) = real(aim - now%p(col, row)/now%p_unit, sp)
      end do
    end do
    !$omp end parallel do
    if (.not. sum(part) > 0.0_wp) then
      ! none of the pressure is left where it should be
      now%d(:, :, 1) = now%d(:, :, 1) + merge(1.0_sp, 0.0_sp, now%active)
      part = count(now%active, dim=1)
    end if
    ! what was cut off goes where it changes the approach alone
    if (.not. by_load) return
    lack = real((pressures/now%p_unit - sum(part))/now%punch_sum, sp)
    !$omp parallel do schedule(static) num_threads(self%n_threads) private(col)
    do row = 1, size(now%p, 2)
      do col = now%span(1, row), now%span(2, row)
        now%d(col, row, 1) = now%d(col, row, 1) + lack*now%punch(col, row)
      end do
    end do
    !$omp end parallel do
  end subroutine projected_step

  !> Direction of conjugate gradients.
  subroutine next_direction(self, now, by_load, rz)
    class(normal_level_t), intent(in) :: self
    type(iterate_t), intent(inout) :: now
    logical, intent(in) :: by_load
    !> r^T z of the last direction, 0: there is none; on return that of the new one
    real(wp), intent(inout) :: rz
    real(wp), dimension(size(now%p, 2)) :: part, sum_z
    real(wp) :: rz_new
    real(sp) :: back, mean
    integer :: col, row

    !$omp parallel do schedule(static) num_threads(self%n_threads) private(col)
    do row = 1, size(now%p, 2)
      part(row) = 0.0_wp
      sum_z(row) = 0.0_wp
      do col = now%span(1, row), now%span(2, row)
        if (.not. now%active(col, row)) cycle
        part(row) = part(row) + real(now%r(col, row, 1), wp)*now%z(col, row, 1)
        sum_z(row) = sum_z(row) + now%z(col, row, 1)
      end do
    end do
    !$omp end parallel do
    rz_new = sum(part)
    back = 0.0_sp
    if (rz > 0.0_wp) back = real(rz_new/rz, sp)
    mean = 0.0_sp
    if (by_load) mean = real(sum(sum_z)/now%punch_sum, sp)
    !$omp parallel do schedule(static) num_threads(self%n_threads) private(col)
    do row = 1, size(now%p, 2)
      if (.not. rz > 0.0_wp) now%d(:, row, 1) = 0.0_sp
      do col = now%span(1, row), now%span(2, row)
        if (.not. now%active(col, row)) cycle
        now%d(col, row, 1) = now%z(col, row, 1) + back*now%d(col, row, 1)
        if (by_load) now%d(col, row, 1) = now%d(col, row, 1) - mean*now%punch(col, row)
      end do
    end do
    !$omp end parallel do
    rz = rz_new
  end subroutine next_direction

  !> Length of a step of conjugate gradients; 0 if there is no curvature.
  real(wp) function step_share(self, now, rz)
    class(normal_level_t), intent(in) :: self
    type(iterate_t), intent(in) :: now
    !> r^T z
    real(wp), intent(in) :: rz
    real(wp) :: part(size(now%p, 2)), curvature
    integer :: row

    !$omp parallel do schedule(static) num_threads(self%n_threads)
    do row = 1, size(now%p, 2)
      associate (from => now%span(1, row), to => now%span(2, row))
        part(row) = sum(real(now%d(from:to, row, 1), wp)*now%kd(from:to, row, 1))
      end associate
    end do
    !$omp end parallel do
    curvature = sum(part)
    step_share = 0.0_wp
    if (curvature > 0.0_wp .and. rz > 0.0_wp) step_share = rz/curvature
  end function step_share

  !> kd = K d.
  subroutine multiply(self, now)
    class(normal_level_t), intent(inout) :: self
    type(iterate_t), intent(inout) :: now

    call self%single%convolve(reshape([1], [1, 1]), now%d, now%kd)
    self%single_work = self%single_work + single_cost/3.0_wp
  end subroutine multiply

  !> p <- p + share d, w <- w + share K d.
  subroutine advance(self, now, share)
    class(normal_level_t), intent(in) :: self
    type(iterate_t), intent(inout) :: now
    real(wp), intent(in) :: share
    real(wp) :: step, lift
    real(sp) :: largest
    integer :: col, row

    step = share*now%p_unit
    lift = share*now%w_unit
    largest = 0.0_sp
    !$omp parallel do schedule(static) num_threads(self%n_threads) private(col) reduction(max: largest)
    do row = 1, size(now%p, 2)
      do col = now%span(1, row), now%span(2, row)
        now%p(col, row) = now%p(col, row) + step*now%d(col, row, 1)
        ! what left is gone, but for what single precision would leave of it
        if (.not. now%active(col, row)) now%p(col, row) = 0.0_wp
      end do
      do col = 1, size(now%p, 1)
        now%w(col, row) = now%w(col, row) + lift*now%kd(col, row, 1)
        largest = max(largest, abs(now%kd(col, row, 1)))
      end do
    end do
    !$omp end parallel do
    now%stale = now%stale + single_error*abs(lift)*largest
  end subroutine advance

  !> What the sum of the pressures lacks because of rounding.
  real(wp) function load_lack(self, now, pressures)
    class(normal_level_t), intent(in) :: self
    type(iterate_t), intent(in) :: now
    !> What it should be
    real(wp), intent(in) :: pressures
    real(wp) :: part(size(now%p, 2))
    integer :: row

    !$omp parallel do schedule(static) num_threads(self%n_threads)
    do row = 1, size(now%p, 2)
      part(row) = sum(now%p(:, row))
    end do
    !$omp end parallel do
    load_lack = pressures - sum(part)
  end function load_lack

  !> Make up for it.
  subroutine fit_load(self, now, pressures)
    class(normal_level_t), intent(in) :: self
    type(iterate_t), intent(inout) :: now
    real(wp), intent(in) :: pressures
    real(wp) :: lack

    lack = load_lack(self, now, pressures)
    if (allocated(now%punch)) then
      now%p = now%p + lack/now%punch_sum*now%punch
    else
      now%p = pressures/(pressures - lack)*now%p
    end if
  end subroutine fit_load

  !> w = K p in double precision.
  subroutine find_closing(self, now, error)
    class(normal_level_t), intent(inout) :: self
    type(iterate_t), intent(inout), target :: now
    type(error_t), allocatable, intent(out) :: error
    real(wp), pointer, contiguous :: field(:, :, :), closing(:, :, :)

    field(1:size(now%p, 1), 1:size(now%p, 2), 1:1) => now%p
    closing(1:size(now%p, 1), 1:size(now%p, 2), 1:1) => now%w
    call self%flexibility%apply([normal], field, [normal], closing, error)
    now%stale = 0.0_wp
  end subroutine find_closing

end module hc_normal_level
