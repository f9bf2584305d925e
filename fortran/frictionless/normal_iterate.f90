!> The state of an iteration for frictionless contact, and the passes over its fields.
!>
!> Equations: docs/theory/normal_contact.md, (N2) to (N6).
module hc_normal_iterate
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp, sp, lk
  use hc_error, only: error_t, status, raise
  use hc_contact_state, only: not_finite
  use hc_normal_lattice, only: normal_lattice_t
  use hc_normal_rows, only: limits_t, classification_t, classify_row, add_row, dot_single, largest_of
  implicit none
  private

  public :: normal_iterate_t, set_start, rescale, find_approach, classify, set_active, linearize_law, add_springs, &
            find_punch_pressure, advance, missing_load, fit_load, pulls

  !> Steps of Newton's method for the size of a pressure of which only the shape is known, under a compliant law.
  integer, parameter :: start_steps = 8
  !> Error of a product in single precision, relative to its largest value.
  real(wp), parameter :: single_error = epsilon(1.0_sp)
  !> Columns between two runs from which on passing over them pays.
  integer, parameter :: worth_a_run = 16

  !> Present state of an iteration; fields are (n_col, n_row).
  !>
  !> Those in single precision are zero off the active nodes, r but for the rings of the
  !> continuation and z and kd everywhere; their units are p_unit and p_unit times that of the preconditioner.
  type :: normal_iterate_t
    !> Problem on the lattice that is being solved, with its operators
    type(normal_lattice_t), pointer :: level => null()
    !> Pressure [Pa] and the closing of the gap that it causes [m]; that of the springs below is part of it
    real(wp), allocatable :: p(:, :), w(:, :)
    !> Under a compliant law: compliance [m/Pa] and offset [m] of the spring of each node, 0 off the active nodes
    real(wp), allocatable :: compliance(:, :), offset(:, :)
    !> Direction; residual, preconditioned residual and product of the direction, in memory of the transforms
    real(sp), allocatable :: d(:, :, :)
    real(sp), pointer, contiguous :: r(:, :, :) => null(), z(:, :, :) => null(), kd(:, :, :) => null()
    !> Estimate of the pressure of a rigid punch over the active nodes: M times one; zero off them
    real(sp), allocatable :: punch(:, :)
    real(wp) :: punch_sum = 0.0_wp
    logical(lk), allocatable :: active(:, :)
    !> Runs of columns in which the active nodes of each row lie, now and before, and how many they are: no pressure outside
    integer, allocatable :: run(:, :, :), n_run(:)
    real(wp) :: approach = 0.0_wp
    !> Unit of the pressure in single precision [Pa], and of the closing of the gap [m]
    real(wp) :: p_unit = 1.0_wp, w_unit = 1.0_wp
    !> Error that products in single precision may have left in w [m]
    real(wp) :: closing_error = 0.0_wp
    real(wp) :: p_max = 0.0_wp
    !> Residual R_n, and the same on the active nodes alone
    real(wp) :: residual = huge(1.0_wp), residual_active = huge(1.0_wp)
    !> Under a compliant law: the residual of the nodes that would enter or leave the set
    real(wp) :: residual_changed = huge(1.0_wp)
    !> The normal load is prescribed, not the approach; the load [N] or the approach [m]
    logical :: by_load = .false.
    real(wp) :: target = 0.0_wp
    !> Sum of the pressures under a prescribed load [Pa]
    real(wp) :: pressures = 0.0_wp
    !> Active nodes, now and next
    integer :: n_active = 0, n_next = 0
    !> Sets change without end, here or on the coarser lattice: steps are searched
    logical :: searches = .false.
  end type normal_iterate_t

contains

  !> Scale the pressure so that it has the least energy under a prescribed approach; springs as they are linearised.
  subroutine rescale(now)
    !> Iterate
    type(normal_iterate_t), intent(inout) :: now
    real(wp) :: overlap(size(now%p, 2)), resistance(size(now%p, 2)), factor
    integer :: row, k

    if (allocated(now%offset)) now%w = now%w - now%offset
    !$omp parallel do schedule(static) num_threads(now%level%space%threads)
    do row = 1, size(now%p, 2)
      overlap(row) = 0.0_wp
      resistance(row) = 0.0_wp
      do k = 1, now%n_run(row)
        associate (from => now%run(1, k, row), to => now%run(2, k, row))
          overlap(row) = overlap(row) + sum(now%p(from:to, row)*(now%approach - now%level%initial_gap(from:to, row)), &
                                            mask=now%active(from:to, row))
          resistance(row) = resistance(row) + dot_product(now%p(from:to, row), now%w(from:to, row))
          if (allocated(now%offset)) overlap(row) = overlap(row) - dot_product(now%p(from:to, row), now%offset(from:to, row))
        end associate
      end do
    end do
    !$omp end parallel do
    factor = now%level%space%total(overlap)/now%level%space%total(resistance)
    if (.not. factor > 0.0_wp) factor = now%approach/now%level%space%max(now%w)
    now%p = factor*now%p
    now%w = factor*now%w
    if (allocated(now%offset)) now%w = now%w + now%offset
    now%closing_error = factor*now%closing_error
  end subroutine rescale

  !> Find the approach at which gap and pressure are in balance under a prescribed load.
  !>
  !> The residual then has no part along the motion of the punch; before there is one, the mean gap
  !> under the pressure vanishes.
  subroutine find_approach(now)
    !> Iterate
    type(normal_iterate_t), intent(inout) :: now
    real(wp) :: weight(size(now%p, 2)), moment(size(now%p, 2)), w, l, u
    integer :: col, row, k

    !$omp parallel do schedule(static) num_threads(now%level%space%threads) private(w, l, u)
    do row = 1, size(now%p, 2)
      w = 0.0_wp
      l = 0.0_wp
      do k = 1, now%n_run(row)
        ! the gap may be infinite where nothing can touch
        if (allocated(now%punch)) then
          !$omp simd private(u) reduction(+: w, l)
          do col = now%run(1, k, row), now%run(2, k, row)
            u = now%punch(col, row)
            w = w + u
            l = l + u*(merge(now%level%initial_gap(col, row), 0.0_wp, u > 0.0_wp) + now%w(col, row))
          end do
        else
          !$omp simd private(u) reduction(+: w, l)
          do col = now%run(1, k, row), now%run(2, k, row)
            u = now%p(col, row)
            w = w + u
            l = l + u*(merge(now%level%initial_gap(col, row), 0.0_wp, u > 0.0_wp) + now%w(col, row))
          end do
        end if
      end do
      weight(row) = w
      moment(row) = l
    end do
    !$omp end parallel do
    now%approach = now%level%space%total(moment)/now%level%space%total(weight)
  end subroutine find_approach

  !> Compute the residuals, and find the set that the present pressure and gap call for.
  subroutine classify(now, candidate, next, changed, error)
    !> Iterate
    type(normal_iterate_t), intent(inout) :: now
    !> Nodes that may come into contact (n_col, n_row)
    logical(lk), intent(in), contiguous :: candidate(:, :)
    !> Nodes that pressure and gap call for (n_col, n_row)
    logical(lk), intent(out), contiguous :: next(:, :)
    !> The new set is another one
    logical, intent(out) :: changed
    !> Allocated on failure: a pressure or a gap that is not a finite number
    type(error_t), allocatable, intent(out) :: error
    type(classification_t) :: found(size(now%p, 2))
    type(limits_t) :: limits
    real(wp) :: largest(4)
    integer :: row, numbers(3)

    ! r' of (N2)
    limits = limits_t(now%level%normal_classification_parameter(now%n_active), 1.0_wp/now%level%normal_compliance, now%approach)
    !$omp parallel do schedule(static) num_threads(now%level%space%threads)
    do row = 1, size(now%p, 2)
      if (allocated(now%offset)) then
        call classify_compliant_row(now, row, limits%r, candidate(:, row), next(:, row), found(row))
      else
        call classify_row(limits, now%level%initial_gap(:, row), now%p(:, row), now%w(:, row), candidate(:, row), &
                          now%active(:, row), next(:, row), found(row))
      end if
    end do
    !$omp end parallel do
    numbers = [count(.not. found%finite), sum(found%n_next), sum(found%n_changed)]
    call now%level%space%ranks%add_counts(numbers)
    if (numbers(1) > 0 .or. .not. ieee_is_finite(now%approach)) then
      call raise(error, status%no_convergence, not_finite)
      return
    end if
    largest = [maxval(found%p_max), maxval(found%worst), maxval(found%worst_changed), maxval(found%worst_active)]
    call now%level%space%most(largest)
    now%p_max = largest(1)
    now%residual = largest(2)/now%p_max
    now%residual_changed = largest(3)/now%p_max
    now%residual_active = largest(4)
    if (.not. allocated(now%offset)) then
      now%residual_active = now%residual_active/(now%level%normal_compliance*now%p_max)
    else
      now%residual_active = now%residual_active/now%p_max
    end if
    now%n_next = numbers(2)
    changed = numbers(3) > 0 .and. now%n_next > 0
    if (now%n_next > 0) return
    ! too much pressure everywhere: reduce it on the old set
    next = now%active
    now%n_next = now%n_active
  end subroutine classify

  !> Classify a row of nodes with a compliant layer: residuals of the law and, on the active nodes, of its
  !> linearisation.
  subroutine classify_compliant_row(now, row, r, candidate, next, found)
    type(normal_iterate_t), intent(in) :: now
    integer, intent(in) :: row
    !> Classification parameter [Pa/m]
    real(wp), intent(in) :: r
    logical(lk), intent(in), contiguous :: candidate(:)
    logical(lk), intent(out), contiguous :: next(:)
    !> Residuals and numbers of nodes
    type(classification_t), intent(out) :: found
    logical, dimension(size(next)) :: possible, called_for
    real(wp) :: gap(size(next)), left(size(next))
    integer :: first

    first = (row - 1)*size(next) + 1
    left = now%level%initial_gap(:, row) + now%w(:, row) - now%approach
    gap = left - now%compliance(:, row)*now%p(:, row) - now%offset(:, row)
    found%finite = all(ieee_is_finite(now%p(:, row)) .and. (ieee_is_finite(gap) .or. .not. candidate))
    if (.not. found%finite) return
    possible = candidate
    call now%level%normal_law%find_contact(r, now%p(:, row), gap, possible, called_for)
    next = called_for
    call now%level%normal_law%violation(first, now%level%normal_compliance, now%p(:, row), gap, possible, found%worst)
    call now%level%normal_law%violation(first, now%level%normal_compliance, now%p(:, row), gap, &
                                    possible .and. (called_for .neqv. now%active(:, row)), found%worst_changed)
    found%p_max = max(0.0_wp, maxval(now%p(:, row)))
    found%worst_active = max(0.0_wp, maxval(abs(left)/(now%level%normal_compliance + now%compliance(:, row)), &
                                            mask=now%active(:, row)))
    found%n_next = count(next)
    found%n_changed = count(next .neqv. now%active(:, row))
  end subroutine classify_compliant_row

  !> Linearise a compliant law about the present pressure and gap, and give the springs to the preconditioner.
  subroutine linearize_law(now, r)
    !> Iterate
    type(normal_iterate_t), intent(inout) :: now
    !> Classification parameter; 0: about the present pressure [Pa/m]
    real(wp), intent(in) :: r
    real(wp), allocatable :: gap(:, :)

    call add_springs(now, -1)
    allocate (gap, source=now%w)
    call now%level%open_gap(now%approach, gap)
    call now%level%linearize(r, now%p, gap, now%active, now%compliance, now%offset)
    call add_springs(now, 1)
    associate (n => size(now%p))
      call now%level%preconditioner%set_active(reshape(now%active, [n]), reshape(now%compliance, [n]))
    end associate
  end subroutine linearize_law

  !> Add the springs to the closing by the pressure, or subtract them again.
  subroutine add_springs(now, sign)
    !> Iterate
    type(normal_iterate_t), intent(inout) :: now
    !> 1 to add them, -1 to take them off
    integer, intent(in) :: sign
    integer :: row

    if (.not. allocated(now%offset)) return
    !$omp parallel do schedule(static) num_threads(now%level%space%threads)
    do row = 1, size(now%p, 2)
      now%w(:, row) = now%w(:, row) + sign*(now%compliance(:, row)*now%p(:, row) + now%offset(:, row))
    end do
    !$omp end parallel do
  end subroutine add_springs

  !> Take a new set of active nodes; under a compliant law the preconditioner receives it with the springs.
  subroutine set_active(now, next)
    !> Iterate
    type(normal_iterate_t), intent(inout), target :: now
    !> The new set; on return the old one
    logical(lk), allocatable, intent(inout) :: next(:, :)
    logical(lk), allocatable :: swap(:, :)
    logical(lk), pointer, contiguous :: active(:)
    real(wp) :: part(size(now%p, 2))
    integer :: known(size(now%p, 2)), n(1), row, k

    call move_alloc(now%active, swap)
    call move_alloc(next, now%active)
    call move_alloc(swap, next)
    now%n_active = now%n_next
    call find_runs(now)
    active(1:size(now%active)) => now%active
    if (.not. allocated(now%compliance)) call now%level%preconditioner%set_active(active)
    !$omp parallel do schedule(static) num_threads(now%level%space%threads)
    do row = 1, size(now%p, 2)
      now%r(:, row, 1) = 0.0_sp
    end do
    !$omp end parallel do
    if (.not. allocated(now%punch)) return
    !$omp parallel do schedule(static) num_threads(now%level%space%threads)
    do row = 1, size(now%p, 2)
      part(row) = 0.0_wp
      known(row) = 0
      do k = 1, now%n_run(row)
        associate (from => now%run(1, k, row), to => now%run(2, k, row))
          where (.not. now%active(from:to, row)) now%punch(from:to, row) = 0.0_sp
          part(row) = part(row) + sum(real(now%punch(from:to, row), wp))
          known(row) = known(row) + count(now%punch(from:to, row) > 0.0_sp)
        end associate
      end do
    end do
    !$omp end parallel do
    now%punch_sum = now%level%space%total(part)
    n = sum(known)
    call now%level%space%ranks%add_counts(n)
    if (2*n(1) < now%n_active) deallocate (now%punch)                          ! nodes that came back are not in it
  end subroutine set_active

  !> Find the runs of columns that the active nodes of each row lie in, those of earlier sets included.
  subroutine find_runs(now)
    !> Iterate
    type(normal_iterate_t), intent(inout) :: now
    logical(lk) :: known(size(now%active, 1))
    integer :: row, k

    !$omp parallel do schedule(static) num_threads(now%level%space%threads) private(known)
    do row = 1, size(now%active, 2)
      known = now%active(:, row)
      do k = 1, now%n_run(row)
        known(now%run(1, k, row):now%run(2, k, row)) = .true.
      end do
      call list_runs(known, now%run(:, :, row), now%n_run(row))
    end do
    !$omp end parallel do
  end subroutine find_runs

  !> List the runs of some columns; runs close to each other are one.
  pure subroutine list_runs(known, run, n_run)
    !> The columns
    logical(lk), intent(in), contiguous :: known(:)
    !> First and last column of each run, and their number
    integer, intent(inout), contiguous :: run(:, :)
    integer, intent(out) :: n_run
    integer :: from, to, col, n

    n_run = 0
    do from = 1, size(known), worth_a_run
      to = min(from + worth_a_run - 1, size(known))
      n = count(known(from:to))
      if (n == 0) cycle
      if (n == to - from + 1 .and. n_run > 0) then
        if (run(2, n_run) == from - 1) then
          run(2, n_run) = to
          cycle
        end if
      end if
      do col = from, to
        if (.not. known(col)) cycle
        if (n_run == 0) then
          n_run = 1
          run(1, 1) = col
        else if (col - run(2, n_run) > worth_a_run) then
          n_run = n_run + 1
          run(1, n_run) = col
        end if
        run(2, n_run) = col
      end do
    end do
  end subroutine list_runs

  !> Estimate the pressure of a rigid punch over the active nodes, nowhere negative.
  subroutine find_punch_pressure(now)
    !> Iterate
    type(normal_iterate_t), intent(inout) :: now

    integer :: row

    !$omp parallel do schedule(static) num_threads(now%level%space%threads)
    do row = 1, size(now%p, 2)
      now%r(:, row, 1) = merge(1.0_sp, 0.0_sp, now%active(:, row))
    end do
    !$omp end parallel do
    call now%level%precondition(now%r, now%z)
    allocate (now%punch(size(now%p, 1), size(now%p, 2)))
    !$omp parallel do schedule(static) num_threads(now%level%space%threads)
    do row = 1, size(now%p, 2)
      now%punch(:, row) = merge(max(now%z(:, row, 1), 0.0_sp), 0.0_sp, now%active(:, row))
    end do
    !$omp end parallel do
    now%punch_sum = now%level%space%sum(now%punch)
  end subroutine find_punch_pressure

  !> Update p <- p + share d, w <- w + share (K + C) d, C the springs of a compliant law.
  !>
  !> Without springs the approach moves along, so that under a prescribed load it is still that of `find_approach`.
  subroutine advance(now, share, follows)
    !> Iterate
    type(normal_iterate_t), intent(inout) :: now
    !> Share of the direction that is added
    real(wp), intent(in) :: share
    !> The approach follows a prescribed load
    logical, intent(in) :: follows
    real(wp) :: step, closing, moment(size(now%p, 2)), change(1)
    real(sp) :: largest
    integer :: row, k

    step = share*now%p_unit
    closing = share*now%w_unit
    largest = 0.0_sp
    !$omp parallel do schedule(static) num_threads(now%level%space%threads) reduction(max: largest)
    do row = 1, size(now%p, 2)
      moment(row) = 0.0_wp
      do k = 1, now%n_run(row)
        associate (from => now%run(1, k, row), to => now%run(2, k, row))
          if (follows) moment(row) = moment(row) + dot_single(to - from + 1, now%punch(from:to, row), now%kd(from:to, row, 1))
          ! springs may be many times softer than the bodies: theirs is computed in double precision
          if (allocated(now%compliance)) now%w(from:to, row) = now%w(from:to, row) &
                                                               - now%compliance(from:to, row)*now%p(from:to, row)
          call add_row(to - from + 1, step, now%d(from:to, row, 1), now%p(from:to, row))
          ! nodes that left the set carry no pressure after a whole step, not even a residue in single precision
          if (share >= 1.0_wp) where (.not. now%active(from:to, row)) now%p(from:to, row) = 0.0_wp
          if (allocated(now%compliance)) now%w(from:to, row) = now%w(from:to, row) &
                                                               + now%compliance(from:to, row)*now%p(from:to, row)
        end associate
      end do
      call add_row(size(now%p, 1), closing, now%kd(:, row, 1), now%w(:, row))
      largest = max(largest, largest_of(size(now%p, 1), now%kd(:, row, 1)))
    end do
    !$omp end parallel do
    change = largest
    call now%level%space%most(change)
    now%closing_error = now%closing_error + single_error*abs(closing)*change(1)
    if (follows) now%approach = now%approach + closing*now%level%space%total(moment)/now%punch_sum
  end subroutine advance

  !> Return whether there is tension.
  logical function pulls(now)
    !> Iterate
    type(normal_iterate_t), intent(in) :: now
    integer :: row, k, n(1)

    n = 0
    !$omp parallel do schedule(static) num_threads(now%level%space%threads) reduction(+: n)
    do row = 1, size(now%p, 2)
      do k = 1, now%n_run(row)
        n = n + count(now%p(now%run(1, k, row):now%run(2, k, row), row) < 0.0_wp)
      end do
    end do
    !$omp end parallel do
    call now%level%space%ranks%add_counts(n)
    pulls = n(1) > 0
  end function pulls

  !> Compute the difference between the prescribed load and the sum of the pressures, which is rounding error.
  real(wp) function missing_load(now)
    !> Iterate
    type(normal_iterate_t), intent(in) :: now

    missing_load = now%pressures - now%level%space%sum(now%p)
  end function missing_load

  !> Scale the pressures to the prescribed load.
  subroutine fit_load(now)
    !> Iterate
    type(normal_iterate_t), intent(inout) :: now
    real(wp) :: lack

    lack = missing_load(now)
    if (allocated(now%punch)) then
      now%p = now%p + lack/now%punch_sum*now%punch
    else
      now%p = now%pressures/(now%pressures - lack)*now%p
    end if
  end subroutine fit_load

  !> Set the pressure to start from, scaled to the load or to the least energy, and its closing of the gap.
  subroutine set_start(now, candidate, error)
    !> Iterate, whose pressure is the one to start from, up to a factor
    type(normal_iterate_t), intent(inout) :: now
    !> Nodes that may come into contact (n_col, n_row)
    logical(lk), intent(in) :: candidate(:, :)
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: scale, largest
    integer :: n(2), row, stat, try
    logical :: known

    n = now%level%own_extent()
    if (allocated(now%active)) then
      if (any(shape(now%active) /= n)) deallocate (now%d, now%active, now%run, now%n_run)
    end if
    if (allocated(now%punch)) deallocate (now%punch)
    if (allocated(now%compliance)) deallocate (now%compliance, now%offset)
    if (allocated(now%w)) deallocate (now%w)                                   ! of a solution that failed
    stat = 0
    if (.not. allocated(now%active)) then
      allocate (now%d(n(1), n(2), 1), now%active(n(1), n(2)), now%run(2, n(1)/worth_a_run + 1, n(2)), now%n_run(n(2)), stat=stat)
    end if
    call now%level%take_fields(now%r, now%z, now%kd)
    if (stat == 0) allocate (now%w(n(1), n(2)), stat=stat)
    if (stat == 0 .and. now%level%normal_law%is_compliant()) then
      allocate (now%compliance(n(1), n(2)), now%offset(n(1), n(2)), source=0.0_wp, stat=stat)
    end if
    if (stat /= 0) call raise(error, status%resources, 'not enough memory for the fields: use a smaller window')
    call now%level%space%ranks%agree(error)
    if (allocated(error)) then
      now = normal_iterate_t()                                                 ! fields that did fit
      return
    end if
    known = now%level%space%count(logical(now%p > 0.0_wp .and. candidate, lk)) > 0
    !$omp parallel do schedule(static) num_threads(now%level%space%threads)
    do row = 1, n(2)
      now%active(:, row) = candidate(:, row)
      if (known) now%active(:, row) = candidate(:, row) .and. now%p(:, row) > 0.0_wp
      if (.not. known) now%p(:, row) = 1.0_wp
      now%p(:, row) = merge(now%p(:, row), 0.0_wp, now%active(:, row))
      now%w(:, row) = 0.0_wp
      now%r(:, row, 1) = 0.0_sp
    end do
    !$omp end parallel do
    now%n_active = now%level%space%count(now%active)
    largest = now%level%space%max(now%p)
    now%approach = now%target
    now%closing_error = 0.0_wp
    scale = 1.0_wp
    if (now%by_load) scale = now%target/(now%level%lattice%cell_area()*now%level%space%sum(now%p))
    now%n_run = 0
    call find_runs(now)
    now%p_unit = scale*largest
    now%w_unit = now%p_unit*now%level%preconditioner%unit
    !$omp parallel do schedule(static) num_threads(now%level%space%threads)
    do row = 1, n(2)
      now%d(:, row, 1) = real(now%p(:, row)/largest, sp)
      now%p(:, row) = 0.0_wp
    end do
    !$omp end parallel do
    call now%level%multiply(now%d, now%kd)
    call advance(now, 1.0_wp, .false.)
    do try = 1, merge(start_steps, 0, allocated(now%offset))
      call linearize_law(now, 0.0_wp)
      if (now%by_load) exit
      call rescale(now)
    end do
    if (.not. now%by_load) then
      call rescale(now)
      now%p_unit = now%level%space%max(now%p)
      now%w_unit = now%p_unit*now%level%preconditioner%unit
    end if
  end subroutine set_start

end module hc_normal_iterate
