!> The state of an iteration for frictionless contact, and the passes over its fields.
module hc_normal_iterate
  use hc_precision, only: wp, sp, pi
  use hc_error, only: error_t, status, raise
  use hc_field_space, only: field_space_t
  use hc_contact_state, only: not_finite
  use hc_preconditioner_extension, only: edge_extension_t, new_edge_extension
  use hc_normal_lattice, only: normal_lattice_t
  use hc_normal_rows, only: judge_row, add_row, largest_of
  implicit none
  private

  public :: normal_iterate_t, begin, rescale, balance, judge, take_set, press_punch, advance, load_lack, fit_load, push_only

  !> Error of a product in single precision, relative to its largest value.
  real(wp), parameter :: single_error = epsilon(1.0_sp)

  !> Present state of an iteration; fields are (n_col, n_row).
  !>
  !> Those in single precision are zero off the active nodes, r but for the rings of the
  !> continuation and z and kd everywhere; their units are p_unit and p_unit times that of the preconditioner.
  type :: normal_iterate_t
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
  end type normal_iterate_t

contains

  !> Pressure to start from, scaled to the load or to the least energy, and its closing of the gap.
  subroutine begin(level, now, by_load, target, candidate, start, error)
    type(normal_lattice_t), intent(inout) :: level
    type(normal_iterate_t), intent(inout) :: now
    logical, intent(in) :: by_load
    real(wp), intent(in) :: target
    logical, intent(in) :: candidate(:, :)
    real(wp), intent(in) :: start(:, :)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: part(size(start, 2)), scale, largest
    integer :: n(2), n_active, row, stat
    logical :: known

    n = level%lattice%extent
    stat = 0
    if (allocated(now%w)) then
      if (any(shape(now%w) /= n)) deallocate (now%w, now%r, now%z, now%d, now%kd, now%active, now%span)
    end if
    if (allocated(now%punch)) deallocate (now%punch)
    if (allocated(now%p)) deallocate (now%p)
    if (.not. allocated(now%w)) then
      allocate (now%w(n(1), n(2)), now%r(n(1), n(2), 1), now%z(n(1), n(2), 1), now%d(n(1), n(2), 1), now%kd(n(1), n(2), 1), &
                now%active(n(1), n(2)), now%span(2, n(2)), stat=stat)
    end if
    if (stat == 0) allocate (now%p(n(1), n(2)), stat=stat)
    if (stat /= 0) then
      call raise(error, status%resources, 'not enough memory for the fields: use a smaller window')
      return
    end if
    known = any(start > 0.0_wp .and. candidate)
    n_active = 0
    largest = 0.0_wp
    !$omp parallel do schedule(static) num_threads(level%space%threads) reduction(+: n_active) reduction(max: largest)
    do row = 1, n(2)
      now%active(:, row) = candidate(:, row)
      if (known) now%active(:, row) = candidate(:, row) .and. start(:, row) > 0.0_wp
      now%p(:, row) = 1.0_wp
      if (known) now%p(:, row) = start(:, row)
      now%p(:, row) = merge(now%p(:, row), 0.0_wp, now%active(:, row))
      now%w(:, row) = 0.0_wp
      now%r(:, row, 1) = 0.0_sp
      n_active = n_active + count(now%active(:, row))
      largest = max(largest, maxval(now%p(:, row)))
      part(row) = sum(now%p(:, row))
    end do
    !$omp end parallel do
    now%n_active = n_active
    now%approach = target
    now%stale = 0.0_wp
    scale = 1.0_wp
    if (by_load) scale = target/(level%lattice%cell_area()*sum(part))
    now%span(1, :) = n(1) + 1
    now%span(2, :) = 0
    call find_span(now, level%space)
    now%p_unit = scale*largest
    now%w_unit = now%p_unit*level%preconditioner%unit
    !$omp parallel do schedule(static) num_threads(level%space%threads)
    do row = 1, n(2)
      now%d(:, row, 1) = real(now%p(:, row)/largest, sp)
      now%p(:, row) = 0.0_wp
    end do
    !$omp end parallel do
    call level%multiply(now%d, now%kd)
    call advance(level, now, 1.0_wp)
    if (.not. by_load) then
      call rescale(level, now)
      now%p_unit = level%space%max(now%p)
      now%w_unit = now%p_unit*level%preconditioner%unit
    end if
  end subroutine begin

  !> Scale the pressure so that it has the least energy under a prescribed approach.
  subroutine rescale(level, now)
    type(normal_lattice_t), intent(in) :: level
    type(normal_iterate_t), intent(inout) :: now
    real(wp) :: overlap(size(now%p, 2)), resistance(size(now%p, 2)), factor
    integer :: row

    !$omp parallel do schedule(static) num_threads(level%space%threads)
    do row = 1, size(now%p, 2)
      associate (from => now%span(1, row), to => now%span(2, row))
        overlap(row) = sum(now%p(from:to, row)*(now%approach - level%initial_gap(from:to, row)), &
                           mask=now%active(from:to, row))
        resistance(row) = dot_product(now%p(from:to, row), now%w(from:to, row))
      end associate
    end do
    !$omp end parallel do
    factor = sum(overlap)/sum(resistance)
    if (.not. factor > 0.0_wp) factor = now%approach/level%space%max(now%w)
    now%p = factor*now%p
    now%w = factor*now%w
    now%stale = factor*now%stale
  end subroutine rescale

  !> The approach at which gap and pressure are in balance under a prescribed load.
  !>
  !> The residual then has no part along the motion of the punch; before there is one, the mean gap
  !> under the pressure vanishes.
  subroutine balance(level, now)
    type(normal_lattice_t), intent(in) :: level
    type(normal_iterate_t), intent(inout) :: now
    real(wp) :: weight(size(now%p, 2)), lift(size(now%p, 2)), w, l, u
    integer :: col, row

    !$omp parallel do schedule(static) num_threads(level%space%threads) private(col, w, l, u)
    do row = 1, size(now%p, 2)
      associate (from => now%span(1, row), to => now%span(2, row))
        w = 0.0_wp
        l = 0.0_wp
        ! the gap may be infinite where nothing can touch
        if (allocated(now%punch)) then
          !$omp simd private(u) reduction(+: w, l)
          do col = from, to
            u = now%punch(col, row)
            w = w + u
            l = l + u*(merge(level%initial_gap(col, row), 0.0_wp, u > 0.0_wp) + now%w(col, row))
          end do
        else
          !$omp simd private(u) reduction(+: w, l)
          do col = from, to
            u = now%p(col, row)
            w = w + u
            l = l + u*(merge(level%initial_gap(col, row), 0.0_wp, u > 0.0_wp) + now%w(col, row))
          end do
        end if
        weight(row) = w
        lift(row) = l
      end associate
    end do
    !$omp end parallel do
    now%approach = sum(lift)/sum(weight)
  end subroutine balance

  !> Residuals, and the set that the present pressure and gap call for.
  subroutine judge(level, now, candidate, next, changed, error)
    type(normal_lattice_t), intent(in) :: level
    type(normal_iterate_t), intent(inout) :: now
    logical, intent(in), contiguous :: candidate(:, :)
    logical, intent(out), contiguous :: next(:, :)
    !> The new set is another one
    logical, intent(out) :: changed
    !> Allocated on failure: a pressure or a gap that is not a finite number
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: r, stiffness, p_max, worst, worst_active
    integer :: row, n_next, n_changed, n_wrong

    ! (N2)
    r = level%options%contact%classification_scale/(2.0_wp*pi*level%pair%lambda_1 &
                                                    *sqrt(level%lattice%cell_area()*now%n_active/pi))
    stiffness = 1.0_wp/level%compliance
    p_max = 0.0_wp
    worst = 0.0_wp
    worst_active = 0.0_wp
    n_next = 0
    n_changed = 0
    n_wrong = 0
    !$omp parallel do schedule(static) num_threads(level%space%threads) &
    !$omp& reduction(max: p_max, worst, worst_active) reduction(+: n_next, n_changed, n_wrong)
    do row = 1, size(now%p, 2)
      call judge_row(size(now%p, 1), r, stiffness, now%approach, level%initial_gap(:, row), now%p(:, row), now%w(:, row), &
                     candidate(:, row), now%active(:, row), next(:, row), p_max, worst, worst_active, n_next, n_changed, n_wrong)
    end do
    !$omp end parallel do
    if (n_wrong > 0) then
      call raise(error, status%no_convergence, not_finite)
      return
    end if
    now%p_max = p_max
    now%residual = worst/p_max
    now%residual_active = worst_active/(level%compliance*p_max)
    changed = n_changed > 0 .and. n_next > 0
    now%n_next = n_next
    if (n_next > 0) return
    ! too much pressure everywhere: less of it on the old set
    next = now%active
    now%n_next = now%n_active
  end subroutine judge

  !> Take a new set of active nodes.
  subroutine take_set(level, now, next)
    type(normal_lattice_t), intent(in) :: level
    type(normal_iterate_t), intent(inout) :: now
    !> The new set; on return the old one
    logical, allocatable, intent(inout) :: next(:, :)
    logical, allocatable :: swap(:, :)
    integer :: row

    call move_alloc(now%active, swap)
    call move_alloc(next, now%active)
    call move_alloc(swap, next)
    now%n_active = now%n_next
    call find_span(now, level%space)
    call new_edge_extension(now%edge, now%active, level%space)
    !$omp parallel do schedule(static) num_threads(level%space%threads)
    do row = 1, size(now%p, 2)
      now%r(:, row, 1) = 0.0_sp
      if (.not. allocated(now%punch)) cycle
      where (.not. now%active(:, row)) now%punch(:, row) = 0.0_sp
    end do
    !$omp end parallel do
    if (.not. allocated(now%punch)) return
    now%punch_sum = level%space%sum(now%punch)
    if (.not. now%punch_sum > 0.0_wp) deallocate (now%punch)
  end subroutine take_set

  !> Columns between which the active nodes of each row lie, those of earlier sets included.
  subroutine find_span(now, space)
    type(normal_iterate_t), intent(inout) :: now
    type(field_space_t), intent(in) :: space
    integer :: row

    !$omp parallel do schedule(static) num_threads(space%threads)
    do row = 1, size(now%active, 2)
      if (.not. any(now%active(:, row))) cycle
      now%span(1, row) = min(now%span(1, row), findloc(now%active(:, row), .true., dim=1))
      now%span(2, row) = max(now%span(2, row), findloc(now%active(:, row), .true., dim=1, back=.true.))
    end do
    !$omp end parallel do
  end subroutine find_span

  !> Pressure of a rigid punch over the active nodes, about, and nowhere negative.
  subroutine press_punch(level, now)
    type(normal_lattice_t), intent(inout) :: level
    type(normal_iterate_t), intent(inout) :: now

    integer :: row

    !$omp parallel do schedule(static) num_threads(level%space%threads)
    do row = 1, size(now%p, 2)
      now%r(:, row, 1) = merge(1.0_sp, 0.0_sp, now%active(:, row))
    end do
    !$omp end parallel do
    call level%precondition(now%edge, now%r, now%z)
    allocate (now%punch(size(now%p, 1), size(now%p, 2)))
    !$omp parallel do schedule(static) num_threads(level%space%threads)
    do row = 1, size(now%p, 2)
      now%punch(:, row) = merge(max(now%z(:, row, 1), 0.0_sp), 0.0_sp, now%active(:, row))
    end do
    !$omp end parallel do
    now%punch_sum = level%space%sum(now%punch)
  end subroutine press_punch

  !> p <- p + share d, w <- w + share K d.
  subroutine advance(level, now, share)
    type(normal_lattice_t), intent(in) :: level
    type(normal_iterate_t), intent(inout) :: now
    real(wp), intent(in) :: share
    real(wp) :: step, lift
    real(sp) :: largest
    integer :: row

    step = share*now%p_unit
    lift = share*now%w_unit
    largest = 0.0_sp
    !$omp parallel do schedule(static) num_threads(level%space%threads) reduction(max: largest)
    do row = 1, size(now%p, 2)
      associate (from => now%span(1, row), to => now%span(2, row))
        call add_row(to - from + 1, step, now%d(from:to, row, 1), now%p(from:to, row))
        ! what left is gone, but for what single precision would leave of it
        where (.not. now%active(from:to, row)) now%p(from:to, row) = 0.0_wp
      end associate
      call add_row(size(now%p, 1), lift, now%kd(:, row, 1), now%w(:, row))
      largest = max(largest, largest_of(size(now%p, 1), now%kd(:, row, 1)))
    end do
    !$omp end parallel do
    now%stale = now%stale + single_error*abs(lift)*largest
  end subroutine advance

  !> Leave no tension: what is within the tolerance.
  subroutine push_only(level, now, pulls)
    type(normal_lattice_t), intent(in) :: level
    type(normal_iterate_t), intent(inout) :: now
    !> There was some
    logical, intent(out) :: pulls
    integer :: row

    pulls = .false.
    !$omp parallel do schedule(static) num_threads(level%space%threads) reduction(.or.: pulls)
    do row = 1, size(now%p, 2)
      associate (from => now%span(1, row), to => now%span(2, row))
        pulls = pulls .or. count(now%p(from:to, row) < 0.0_wp) > 0
        now%p(from:to, row) = max(now%p(from:to, row), 0.0_wp)
      end associate
    end do
    !$omp end parallel do
  end subroutine push_only

  !> What the sum of the pressures lacks because of rounding.
  real(wp) function load_lack(level, now, pressures)
    type(normal_lattice_t), intent(in) :: level
    type(normal_iterate_t), intent(in) :: now
    !> What it should be
    real(wp), intent(in) :: pressures

    load_lack = pressures - level%space%sum(now%p)
  end function load_lack

  !> Make up for it.
  subroutine fit_load(level, now, pressures)
    type(normal_lattice_t), intent(in) :: level
    type(normal_iterate_t), intent(inout) :: now
    real(wp), intent(in) :: pressures
    real(wp) :: lack

    lack = load_lack(level, now, pressures)
    if (allocated(now%punch)) then
      now%p = now%p + lack/now%punch_sum*now%punch
    else
      now%p = pressures/(pressures - lack)*now%p
    end if
  end subroutine fit_load

end module hc_normal_iterate
