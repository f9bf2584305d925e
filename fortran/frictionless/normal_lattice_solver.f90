!> Frictionless contact on one lattice.
!>
!> Find pressure p and gap g = h + w - approach with p >= 0, g >= 0, p g = 0. Each
!> iteration takes the nodes with p - r g > 0 as active. While this set changes, a step of a
!> projected gradient method, p <- max(p + c M r, 0), finds pressure and set
!> together, with one product of the operator; M is close enough to the inverse of
!> the operator for that. Once the set stands still the steps become those of preconditioned
!> conjugate gradients. Where a set changes without end (rough surfaces), it is fixed until
!> the linear problem on it is solved well enough to trust the next one.
!>
!> A compliant layer between the bodies gives each active node a spring, (N6). In the first iterations it is linearised anew in
!> each: the next direction is conjugate to the last one by the springs as they are now. The closing of the gap contains that of the
!> springs.
!>
!> What is added to the pressure is multiplied in single precision, and pressure and gap are
!> summed up in double precision. The bound on the error that this leaves in the gap is summed up, too; before it matters
!> the gap is computed anew from the pressure, in double precision.
!>
!> I. A. Polonsky and L. M. Keer, Wear 231, 1999, 206-219; M. Hintermueller, K. Ito and K. Kunisch, SIAM J. Optim. 13, 2003,
!> 865-888.
!>
!> Equations: docs/theory/normal_contact.md, (N2) to (N7).
module hc_normal_lattice_solver
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_options, only: normal_options_t
  use hc_conjugate_gradient, only: conjugate_gradient_t
  use hc_contact_state, only: contact_state_t, new_contact_state, force_control, normal, sweeps_used_up, no_progress
  use hc_contact_residuals, only: complete_state
  use hc_normal_lattice, only: normal_lattice_t
  use hc_normal_iterate, only: normal_iterate_t, rescale, find_approach, classify, set_active, &
    linearize_law, add_springs, find_punch_pressure, advance, missing_load, fit_load, remove_tension
  use hc_normal_start, only: set_start
  use hc_normal_directions, only: find_residual, projected_step, next_direction, next_sprung_direction, find_step, &
    find_sprung_step
  implicit none
  private

  public :: solve_on_normal_lattice

contains

  !> Solve for a normal load or an approach.
  subroutine solve_on_normal_lattice(level, now, control, target, tolerance, max_sweeps, state, error)
    !> Problem on the lattice, with its operators
    type(normal_lattice_t), intent(inout) :: level
    !> Iterate of an earlier solution, whose memory is used again
    type(normal_iterate_t), intent(inout) :: now
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

    real(wp) :: delta
    logical :: pulls
    integer :: row, stat

    level%flexibility%applications = 0.0_wp
    level%single_work = 0.0_wp
    call move_alloc(state%pressure, now%p)
    state = contact_state_t()
    delta = level%space%min(level%initial_gap, level%candidate)
    if (target <= merge(0.0_wp, delta, control == force_control)) then         ! nothing touches
      call new_contact_state(state, level%lattice, level%space)
      state%motion(normal) = merge(delta, target, control == force_control)
      state%gap = level%initial_gap - state%motion(normal)
    else
      if (control == force_control) then
        call iterate(level, now, level%candidate, .true., target, tolerance, max_sweeps, state%sweeps, error)
      else
        ! pressure only opens the gap elsewhere: no contact where the bodies would not even overlap
        call iterate(level, now, level%candidate .and. level%initial_gap < target, .false., target, tolerance, max_sweeps, &
                     state%sweeps, error)
      end if
      call level%preconditioner%clear()                              ! before there are fields of the solution
      if (allocated(error)) return
      state%stopped = merge(sweeps_used_up, no_progress, state%sweeps >= max_sweeps)
      call remove_tension(level, now, pulls)
      if (pulls .and. level%exact) call find_closing(level, now, error)
      if (allocated(error)) return
      call add_springs(level, now, -1)
      !$omp parallel do schedule(static) num_threads(level%space%threads)
      do row = 1, size(now%w, 2)
        now%w(:, row) = level%initial_gap(:, row) + now%w(:, row) - now%approach
      end do
      !$omp end parallel do
      call move_alloc(now%p, state%pressure)
      call move_alloc(now%w, state%gap)
      if (allocated(now%punch)) deallocate (now%punch)
      if (allocated(now%compliance)) deallocate (now%compliance, now%offset)
      allocate (state%zone(size(state%gap, 1), size(state%gap, 2)), stat=stat)
      if (stat /= 0) then
        call raise(error, status%resources, 'not enough memory for the fields: use a smaller window')
        return
      end if
      state%motion(normal) = now%approach
    end if
    call complete_state(state, level%lattice, level%candidate, level%compliance, control, target, tolerance, level%space, error, &
                  level%law)
  end subroutine solve_on_normal_lattice

  !> Iterate up to the tolerance.
  subroutine iterate(level, now, candidate, by_load, target, tolerance, max_sweeps, sweeps, error)
    type(normal_lattice_t), intent(inout) :: level
    !> Its pressure is the start, up to a factor; on return the solution
    type(normal_iterate_t), intent(inout) :: now
    !> Nodes that may come into contact (n_col, n_row)
    logical, intent(in), contiguous :: candidate(:, :)
    !> The normal load is prescribed, not the approach
    logical, intent(in) :: by_load
    !> Normal load [N] or approach [m]
    real(wp), intent(in) :: target
    real(wp), intent(in) :: tolerance
    integer, intent(in) :: max_sweeps
    !> Iterations made
    integer, intent(out) :: sweeps
    type(error_t), allocatable, intent(out) :: error

    logical, allocatable :: next(:, :)
    real(wp) :: history(3), fixed_start, pressures, share, softness, r
    type(conjugate_gradient_t) :: recurrence
    logical :: changed, fixed, fresh, compliant, settled, stalled, anew, follows
    integer :: fits
    type(normal_options_t) :: options

    options = level%options%normal
    pressures = target/level%lattice%cell_area()                  ! of no meaning under a prescribed approach
    call set_start(level, now, by_load, target, candidate, error)
    if (allocated(error)) return
    allocate (next, mold=candidate)
    compliant = level%law%is_compliant()
    share = 1.0_wp
    anew = .true.
    history = huge(1.0_wp)
    fixed = .false.
    fresh = .false.
    follows = .false.
    fixed_start = 1.0_wp
    sweeps = 0
    fits = 0
    do
      if (by_load .and. .not. follows) call find_approach(level, now)
      follows = .false.
      call classify(level, now, candidate, next, changed, error)
      if (allocated(error)) return
      ! what an error of the gap does to the pressure falls with the stiffness of the layer
      softness = max(level%compliance, level%law%compliance_under(now%p_max))
      if (level%exact .and. now%closing_error > softness*now%p_max*max(options%residual_share*now%residual, &
                                                                       options%tolerance_share*tolerance)) then
        if (by_load) call fit_load(level, now, pressures)
        call find_closing(level, now, error)
        if (allocated(error)) return
        cycle
      end if
      if (now%residual <= tolerance .and. by_load .and. level%exact .and. fits < options%max_fits) then
        if (abs(missing_load(level, now, pressures)) > options%tolerance_share*tolerance*pressures) then
          fits = fits + 1
          call fit_load(level, now, pressures)
          call find_closing(level, now, error)
          if (allocated(error)) return
          cycle
        end if
      end if
      if (now%residual <= tolerance .or. sweeps >= max_sweeps) return
      sweeps = sweeps + 1
      ! nodes of no weight, as there are many along a soft edge, do not stop conjugate gradients again and again
      stalled = compliant .and. now%residual > options%progress*history(1)
      if (stalled .and. now%residual_changed <= options%slight_change*now%residual) changed = .false.
      if (sweeps == 1) changed = .true.

      ! has the residual come down, compared with the best but the last two?
      if (.not. fixed .and. sweeps > options%first_steps) fixed = now%residual > options%progress*history(3)
      history = [now%residual, history(1), min(history(2), history(3))]
      if (fixed .and. changed) then
        if (fresh .and. now%residual_active > options%fixed_accuracy*fixed_start) then
          changed = .false.
        else
          fixed_start = min(now%residual, 1.0_wp)
          fresh = .true.
        end if
      end if

      if (changed) then
        call set_active(level, now, next)
        call recurrence%restart()
      end if
      if (compliant) then
        ! linearising costs no product
        settled = sweeps > options%most_linearized .and. now%residual_active < options%linear_share*now%residual
        anew = anew .or. settled
        if (changed .or. settled .or. sweeps <= options%most_linearized) then
          r = level%options%contact%classification_parameter(level%pair%lambda_1, level%lattice%cell_area()*now%n_active)
          ! what is left close to the solution are errors of a few nodes along the edge
          if (now%residual < options%close_residual) r = max(r, options%local_share/level%compliance)
          call linearize_law(level, now, r)
        end if
        if (by_load) call find_approach(level, now)
      end if
      if (by_load .and. .not. allocated(now%punch)) call find_punch_pressure(level, now)
      if (.not. (changed .and. fixed)) then
        if (by_load .and. changed) call find_approach(level, now)
        call find_residual(level, now)
        call level%precondition(now%r, now%z)
      end if
      if (changed) then
        call projected_step(level, now, fixed, by_load, pressures)
        share = 1.0_wp
        anew = .true.
      else if (compliant) then
        call next_sprung_direction(level, now, by_load, anew)
        anew = .false.
      else
        call next_direction(level, now, by_load, recurrence)
      end if
      call level%multiply(now%d, now%kd)
      if (.not. changed) then
        if (compliant) then
          share = find_sprung_step(level, now)
        else
          share = find_step(level, now, recurrence)
        end if
        if (.not. share > 0.0_wp) then
          ! nothing is left to gain in single precision, and perhaps at all
          if (.not. (level%exact .and. now%closing_error > 0.0_wp)) return
          now%closing_error = huge(1.0_wp)
          cycle
        end if
      end if
      ! a step of a fixed set moves pressures whose approach was not found; close to the solution rounding errors would add up
      follows = by_load .and. now%residual > sqrt(epsilon(1.0_wp)) .and. .not. (compliant .or. (changed .and. fixed))
      call advance(level, now, share, follows)
      if (changed .and. .not. by_load) call rescale(level, now)
    end do
  end subroutine iterate

  !> Compute w = K p in double precision, without a rest of single precision.
  subroutine find_closing(level, now, error)
    type(normal_lattice_t), intent(inout) :: level
    type(normal_iterate_t), intent(inout) :: now
    type(error_t), allocatable, intent(out) :: error

    call level%multiply_exactly(now%p, now%w, error)
    call add_springs(level, now, 1)
    now%closing_error = 0.0_wp
  end subroutine find_closing

end module hc_normal_lattice_solver
