!> Frictionless contact on one lattice.
!>
!> Find pressure p and gap g = h + w - approach with p >= 0, g >= 0, p g = 0. Each
!> iteration takes the nodes with p - r g > 0 as active. While this set changes, a step of a
!> projected gradient method, p <- max(p + c M r, 0), finds pressure and set
!> together, with one product of the operator; M is close enough to the inverse of
!> the operator for that. Once the set stands still the steps become those of preconditioned
!> conjugate gradients. Where sets change without end (rough surfaces), the
!> steps are conjugate to the last one and their length is searched for.
!>
!> A compliant layer between the bodies gives each active node a spring, (N6). In the first iterations it is linearised anew in
!> each: the next direction is conjugate to the last one by the springs as they are now. The closing of the gap contains that of the
!> springs.
!>
!> Increments of the pressure are multiplied in single precision, and pressure and gap are
!> summed up in double precision. The bound on the error that this leaves in the gap is summed up, too; before it matters
!> the gap is computed anew from the pressure, in double precision.
!>
!> I. A. Polonsky and L. M. Keer, Wear 231, 1999, 206-219; M. Hintermueller, K. Ito and K. Kunisch, SIAM J. Optim. 13, 2003,
!> 865-888.
!>
!> Equations: docs/theory/normal_contact.md, (N2) to (N8).
module hc_normal_lattice_solver
  use hc_precision, only: wp, sp, lk
  use hc_error, only: error_t, status, raise
  use hc_options, only: normal_options_t
  use hc_projected_cg, only: conjugate_gradient_t
  use hc_contact_state, only: contact_state_t, load_target_t, new_contact_state, force_control, normal, sweeps_used_up, &
    no_progress
  use hc_normal_lattice, only: normal_lattice_t
  use hc_normal_iterate, only: normal_iterate_t, set_start, rescale, find_approach, classify, set_active, &
    linearize_law, add_springs, find_punch_pressure, advance, missing_load, fit_load, pulls
  use hc_normal_directions, only: find_residual, projected_step, searched_step, next_direction, next_sprung_direction, &
    curvature, find_sprung_step
  implicit none
  private

  public :: solve_on_normal_lattice

  !> Kinds of steps.
  integer, parameter :: projected = 1, searched = 2, conjugate = 3

  !> Progress of an iteration.
  type :: progress_t
    !> The last residual, the one before it, and the best of those before
    real(wp) :: best(3) = huge(1.0_wp)
    !> The set of active nodes is fixed until its linear problem is solved
    logical :: fixed = .false.
    !> Residual where the set was fixed
    real(wp) :: fixed_start = 1.0_wp
    !> Length of searched steps before their cut
    real(wp) :: length = 1.0_wp
    !> Of a searched step: fall of the energy by its length, and d^T K d
    real(wp) :: fall = 0.0_wp, curved = 0.0_wp
    !> Kind of the last step; it took tension away, of which rounding errors are left
    integer :: step = projected
    logical :: emptied = .false.
    !> Times that the pressure was fitted to the load
    integer :: fits = 0
  contains
    procedure :: judge
  end type progress_t

contains

  !> Solve for a normal load or an approach.
  subroutine solve_on_normal_lattice(level, now, target, tolerance, max_sweeps, state, error)
    !> Problem on the lattice, with its operators
    type(normal_lattice_t), intent(inout), target :: level
    !> Iterate of an earlier solution, whose memory is used again
    type(normal_iterate_t), intent(inout) :: now
    !> Normal load or approach to be reached
    type(load_target_t), intent(in) :: target
    !> Bound of both residuals
    real(wp), intent(in) :: tolerance
    !> Iterations that may be made
    integer, intent(in) :: max_sweeps
    !> On entry its pressure is the start, up to a factor; on return the solution
    type(contact_state_t), intent(inout) :: state
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    logical :: everywhere
    integer :: row, stat

    level%flexibility%applications = 0.0_wp
    level%single_work = 0.0_wp
    now%level => level
    call move_alloc(state%pressure, now%p)
    state = contact_state_t()
    if (.not. level%is_pressed(target)) then
      call new_contact_state(state, level%lattice, level%space)
      state%motion(normal) = target%value(normal)
      if (target%control(normal) == force_control) state%motion(normal) = level%space%min(level%initial_gap, level%candidate)
      state%gap = level%initial_gap - state%motion(normal)
    else
      now%by_load = target%control(normal) == force_control
      now%target = target%value(normal)
      if (now%by_load) then
        now%pressures = now%target/level%lattice%cell_area()
        call iterate(now, level%candidate, tolerance, max_sweeps, state%sweeps, error)
      else
        ! pressure only opens the gap elsewhere: no contact where the bodies would not even overlap; from mean planes it
        ! closes it, and layers bulge
        everywhere = level%lattice%is_periodic() .or. .not. level%medium%trace() > 0.0_wp
        call iterate(now, logical(level%candidate .and. (level%initial_gap < now%target .or. everywhere), lk), tolerance, &
                     max_sweeps, state%sweeps, error)
      end if
      call level%preconditioner%clear()                              ! before there are fields of the solution
      if (allocated(error)) return
      state%stopped = merge(sweeps_used_up, no_progress, state%sweeps >= max_sweeps)
      if (pulls(now)) then
        ! it is within the tolerance
        !$omp parallel do schedule(static) num_threads(level%space%threads)
        do row = 1, size(now%p, 2)
          now%p(:, row) = max(now%p(:, row), 0.0_wp)
        end do
        !$omp end parallel do
        if (level%exact) call find_closing(now, error)
      end if
      if (allocated(error)) return
      call add_springs(now, -1)
      call level%open_gap(now%approach, now%w)
      call move_alloc(now%p, state%pressure)
      call move_alloc(now%w, state%gap)
      if (allocated(now%punch)) deallocate (now%punch)
      if (allocated(now%compliance)) deallocate (now%compliance, now%offset)
      allocate (state%zone(size(state%gap, 1), size(state%gap, 2)), stat=stat)
      if (stat /= 0) call raise(error, status%resources, 'not enough memory for the fields: use a smaller window')
      call level%space%ranks%agree(error)
      if (allocated(error)) return
      state%motion(normal) = now%approach
    end if
    call level%complete_pressed(target, tolerance, state, error)
  end subroutine solve_on_normal_lattice

  !> Iterate up to the tolerance.
  subroutine iterate(now, candidate, tolerance, max_sweeps, sweeps, error)
    !> Its pressure is the start, up to a factor; on return the solution
    type(normal_iterate_t), intent(inout) :: now
    !> Nodes that may come into contact (n_col, n_row)
    logical(lk), intent(in), contiguous :: candidate(:, :)
    real(wp), intent(in) :: tolerance
    integer, intent(in) :: max_sweeps
    !> Iterations made
    integer, intent(out) :: sweeps
    type(error_t), allocatable, intent(out) :: error

    type(progress_t) :: progress
    type(conjugate_gradient_t) :: recurrence
    logical(lk), allocatable :: next(:, :)
    real(wp) :: share
    logical :: changed, compliant, anew, corrected, follows

    sweeps = 0
    progress%length = now%level%options%normal%searched_length
    call set_start(now, candidate, error)
    if (allocated(error)) return
    allocate (next, mold=candidate)
    compliant = now%level%normal_law%is_compliant()
    anew = .true.
    follows = .false.
    do
      if (now%by_load .and. .not. follows) call find_approach(now)
      follows = .false.
      call classify(now, candidate, next, changed, error)
      if (allocated(error)) return
      call remove_rounding(now, tolerance, progress%fits, corrected, error)
      if (allocated(error)) return
      if (corrected) cycle
      if (now%residual <= tolerance .or. sweeps >= max_sweeps) return
      sweeps = sweeps + 1
      call progress%judge(now, now%level%options%normal, sweeps, compliant, changed)
      now%level%preconditioner%patches = now%searches
      if (changed) then
        call set_active(now, next)
        call recurrence%restart()
      end if
      if (compliant) call follow_law(now, changed, sweeps, anew)
      if (now%by_load .and. .not. allocated(now%punch)) call find_punch_pressure(now)
      if (now%by_load .and. changed) call find_approach(now)
      call find_residual(now)
      call now%level%precondition(now%r, now%z)
      call find_step(now, progress, recurrence, changed, anew)
      call now%level%multiply(now%d, now%kd)
      share = share_of_step(now, progress, recurrence)
      if (.not. share > 0.0_wp) then
        ! the residual has reached round-off of single precision: a product in double precision is next, or the end
        if (.not. (now%level%exact .and. now%closing_error > 0.0_wp)) return
        now%closing_error = huge(1.0_wp)
        cycle
      end if
      ! close to the solution rounding errors would add up
      follows = now%by_load .and. now%residual > sqrt(epsilon(1.0_wp)) .and. .not. compliant
      call advance(now, share, follows)
      if (progress%step == projected .and. .not. now%by_load) call rescale(now)
    end do
  end subroutine iterate

  !> Compute the closing of the gap in double precision where errors of single precision, or a load that was missed by rounding,
  !> would limit the accuracy.
  subroutine remove_rounding(now, tolerance, fits, corrected, error)
    type(normal_iterate_t), intent(inout) :: now
    real(wp), intent(in) :: tolerance
    !> Times that the pressure of a solution was fitted to the load
    integer, intent(inout) :: fits
    !> The gap is another one: residuals have to be computed again
    logical, intent(out) :: corrected
    type(error_t), allocatable, intent(out) :: error

    corrected = .false.
    if (.not. now%level%exact) return
    associate (options => now%level%options%normal)
      ! the error of the pressure by an error of the gap falls with the stiffness of the layer
      corrected = now%closing_error > max(now%level%normal_compliance, now%level%normal_law%compliance_under(now%p_max))*now%p_max &
                  *max(options%residual_share*now%residual, options%tolerance_share*tolerance)
      if (.not. corrected .and. now%residual <= tolerance .and. now%by_load .and. fits < options%max_fits) then
        corrected = abs(missing_load(now)) > options%tolerance_share*tolerance*now%pressures
        if (corrected) fits = fits + 1
      end if
    end associate
    if (.not. corrected) return
    if (now%by_load) call fit_load(now)
    call find_closing(now, error)
  end subroutine remove_rounding

  !> Judge the progress of the residual, and fix the set where it changes without end.
  pure subroutine judge(self, now, options, sweeps, compliant, changed)
    class(progress_t), intent(inout) :: self
    type(normal_iterate_t), intent(inout) :: now
    type(normal_options_t), intent(in) :: options
    !> Iterations made
    integer, intent(in) :: sweeps
    !> There is a compliant layer
    logical, intent(in) :: compliant
    !> Pressure and gap call for another set; false on return where the set stays
    logical, intent(inout) :: changed
    logical :: stalled

    ! nodes of no weight, as there are many along a soft edge, do not stop conjugate gradients again and again
    stalled = compliant .and. now%residual > options%progress*self%best(1)
    if (stalled .and. now%residual_changed <= options%slight_change*now%residual) changed = .false.
    if (sweeps == 1) changed = .true.
    ! has the residual come down, compared with the best but the last two?
    if (.not. now%searches .and. sweeps > options%first_steps) now%searches = now%residual > options%progress*self%best(3)
    self%best = [now%residual, self%best(1), min(self%best(2), self%best(3))]
    if (.not. self%fixed) return
    self%fixed = now%residual_active > options%fixed_accuracy*self%fixed_start
    if (self%fixed) changed = .false.
  end subroutine judge

  !> Find the next step: a conjugate one on a set that stands or is fixed, else a projected one, of a length that is searched for
  !> where sets change without end.
  subroutine find_step(now, progress, recurrence, changed, anew)
    type(normal_iterate_t), intent(inout) :: now
    type(progress_t), intent(inout) :: progress
    type(conjugate_gradient_t), intent(inout) :: recurrence
    !> The set of active nodes is another one
    logical, intent(in) :: changed
    !> The next sprung direction is not conjugate to the last one
    logical, intent(inout) :: anew
    logical :: found

    anew = anew .or. changed
    if (progress%step == conjugate) progress%emptied = .false.
    if (now%searches .and. .not. progress%fixed) then
      anew = .true.
      ! without tension, or after it was taken away
      found = .not. pulls(now)
      if (found .or. progress%step == searched .or. progress%emptied) then
        call search_step(now, progress, found)
      end if
      progress%emptied = .not. found
      if (found) return
      ! tension, and the pressure of nodes that left the set, go first
      call searched_step(now, 0.0_wp, 0.0_wp, progress%fall)
      call recurrence%restart()
    else if (changed) then
      call projected_step(now)
    else
      progress%step = conjugate
      if (now%level%normal_law%is_compliant()) then
        call next_sprung_direction(now, anew)
        anew = .false.
      else
        call next_direction(now, recurrence)
      end if
      return
    end if
    progress%step = projected
  end subroutine find_step

  !> Search a step, shorter and shorter until it goes down; if none does the set is fixed.
  subroutine search_step(now, progress, found)
    type(normal_iterate_t), intent(inout) :: now
    type(progress_t), intent(inout) :: progress
    !> There is such a step
    logical, intent(out) :: found
    real(wp) :: shortest

    shortest = now%level%options%normal%least_searched*progress%length
    found = .false.
    do while (progress%length > shortest)
      call searched_step(now, progress%length, merge(progress%curved, 0.0_wp, progress%step == searched), progress%fall)
      found = progress%fall > 0.0_wp
      progress%step = merge(searched, projected, found)
      if (found) return
      progress%length = 0.5_wp*progress%length
    end do
    progress%length = now%level%options%normal%searched_length
    progress%fixed = .true.
    progress%fixed_start = min(now%residual, 1.0_wp)
  end subroutine search_step

  !> Compute the largest share of a step that leaves no tension: 1 where pressure was cut off, more elsewhere.
  real(wp) function longest_share(now)
    type(normal_iterate_t), intent(in) :: now
    !> Rounding errors of single precision
    real(wp), parameter :: rounding = 1.0e-6_wp
    real(wp) :: fall(1), part(size(now%p, 2))
    integer :: row, k

    !$omp parallel do schedule(static) num_threads(now%level%space%threads)
    do row = 1, size(now%p, 2)
      part(row) = 0.0_wp
      do k = 1, now%n_run(row)
        associate (from => now%run(1, k, row), to => now%run(2, k, row))
          part(row) = max(part(row), maxval(-now%p_unit*now%d(from:to, row, 1)/max(now%p(from:to, row), tiny(1.0_wp)), &
                                            mask=now%d(from:to, row, 1) < 0.0_sp))
        end associate
      end do
    end do
    !$omp end parallel do
    fall = max(maxval(part), epsilon(1.0_wp))
    call now%level%space%most(fall)
    longest_share = 1.0_wp
    if (fall(1) < 1.0_wp - rounding) longest_share = 1.0_wp/fall(1)
  end function longest_share

  !> Compute the share of a step that is taken, and of a searched one the length of the next.
  real(wp) function share_of_step(now, progress, recurrence)
    type(normal_iterate_t), intent(in) :: now
    type(progress_t), intent(inout) :: progress
    type(conjugate_gradient_t), intent(in) :: recurrence
    real(wp) :: best

    share_of_step = 1.0_wp
    if (progress%step == searched) then
      progress%curved = curvature(now)
      best = progress%fall/progress%curved
      ! all of it ends where there is no tension
      share_of_step = min(best, 1.0_wp)
      if (now%level%lattice%slenderness() > now%level%options%preconditioner%slender) share_of_step = min(best, longest_share(now))
      ! twice the last one at most, from far below the first one more
      progress%length = min(progress%length*min(max(best, 0.5_wp), 8.0_wp), &
                            max(2.0_wp*progress%length, 0.5_wp*now%level%options%normal%searched_length), 2.0_wp)
    else if (progress%step == conjugate .and. now%level%normal_law%is_compliant()) then
      share_of_step = find_sprung_step(now)
    else if (progress%step == conjugate) then
      share_of_step = recurrence%step_length(curvature(now))
    end if
  end function share_of_step

  !> Linearise a compliant law again, which costs no product: in the first iterations, for a new set, and where the linear problem
  !> is solved.
  subroutine follow_law(now, changed, sweeps, anew)
    type(normal_iterate_t), intent(inout) :: now
    !> The set of active nodes is another one
    logical, intent(in) :: changed
    !> Iterations made
    integer, intent(in) :: sweeps
    !> The next direction is not conjugate to the last one
    logical, intent(inout) :: anew
    logical :: settled

    associate (options => now%level%options%normal)
      settled = sweeps > options%most_linearized .and. now%residual_active < options%linear_share*now%residual
      anew = anew .or. settled
      if (changed .or. settled .or. sweeps <= options%most_linearized) then
        call linearize_law(now, now%level%normal_classification_parameter(now%n_active))
      end if
    end associate
    if (now%by_load) call find_approach(now)
  end subroutine follow_law

  !> Compute w = K p in double precision, without a rest of single precision.
  subroutine find_closing(now, error)
    type(normal_iterate_t), intent(inout) :: now
    type(error_t), allocatable, intent(out) :: error
    integer :: row

    call now%level%multiply_exactly(now%p, now%w, error)
    !$omp parallel do schedule(static) num_threads(now%level%space%threads)
    do row = 1, size(now%r, 2)
      now%r(:, row, 1) = 0.0_sp                                                ! which the transforms have overwritten
    end do
    !$omp end parallel do
    call add_springs(now, 1)
    now%closing_error = 0.0_wp
  end subroutine find_closing

end module hc_normal_lattice_solver
