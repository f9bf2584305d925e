!> Adaptive load steps and expected errors for Python: flat procedures for f2py, no mathematics.
!>
!> A control is its eight numbers, a change its seven, an attempt its five, in the order of the types of the core.
module hc_f2py_steps
  use iso_c_binding, only: c_double, c_int
  use hc_error, only: error_t
  use hc_f2py_handles, only: report, friction_of
  use hc_lattice, only: lattice_t, new_lattice
  use hc_field_space, only: field_space_t
  use hc_friction_law, only: friction_law_t
  use hc_contact_state, only: contact_state_t
  use hc_options, only: step_options_t
  use hc_step_error, only: step_change_t, compare_halves, shear_free
  use hc_step_control, only: step_control_t, step_attempt_t
  use hc_expected_error, only: lattice_errors_t, lattice_errors, lattice_spacings, slip_ring, even_steps, entry_error, &
                               entry_steps, oblique_error, oblique_steps, turning_error
  implicit none
  private

  public :: change_by_halving, is_shear_free, first_attempt, decide_attempt, accept_attempt, errors_of_lattice, errors_of_entry, &
            error_of_turns, width_of_ring

  !> Fields of a state that are compared: pressure, gap, traction and relative displacement along x and along y.
  integer, parameter :: n_field = 6

contains

  !> Compare a load step with its halves.
  subroutine change_by_halving(n_col, n_row, basis, candidate, n_coefficient, coefficient, law, fields, zones, area, &
                               change, code, message)
    !f2py threadsafe
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Basis vectors as columns [m]
    real(c_double), intent(in) :: basis(2, 2)
    !> Not zero where a node may come into contact
    integer(c_int), intent(in) :: candidate(n_col, n_row)
    !> Coefficient of friction, one or that of each node, infinite or huge: no slip; numbers of the law: `friction_of`
    integer(c_int), intent(in) :: n_coefficient
    real(c_double), intent(in) :: coefficient(n_coefficient), law(4)
    !> Fields and zones of five states: the end of the whole step, the middle and the end of the halves, both at the beginning
    real(c_double), intent(in) :: fields(n_col, n_row, 6, 5)
    integer(c_int), intent(in) :: zones(n_col, n_row, 5)
    !> Largest contact area of the history [m^2]
    real(c_double), intent(in) :: area
    !> What the halves change
    real(c_double), intent(out) :: change(7)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(lattice_t) :: lattice
    class(friction_law_t), allocatable :: friction
    type(contact_state_t) :: state(5)
    type(step_change_t) :: found
    integer :: k

    change = 0.0_c_double
    call new_lattice(lattice, basis, [0, 0], [n_col, n_row], error)
    if (.not. allocated(error)) then
      do k = 1, size(state)
        state(k)%pressure = fields(:, :, 1, k)
        state(k)%gap = fields(:, :, 2, k)
        state(k)%traction = fields(:, :, 3:4, k)
        state(k)%relative_displacement = fields(:, :, 5:n_field, k)
        state(k)%zone = zones(:, :, k)
      end do
      call friction_of(coefficient, law, lattice%size(), friction)
      call compare_halves(lattice, candidate /= 0, friction, state(1), state(2), state(3), state(4), &
                          state(5), area, found, field_space_t())
      change = [found%stick, found%traction, found%added, found%lattice, found%gain, found%spent, found%turned]
    end if
    call report(error, code, message)
  end subroutine change_by_halving

  !> Return whether a state has no shear tractions.
  subroutine is_shear_free(n_col, n_row, pressure, traction_x, traction_y, shearless)
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Pressure and shear tractions [Pa]
    real(c_double), intent(in) :: pressure(n_col, n_row), traction_x(n_col, n_row), traction_y(n_col, n_row)
    !> Not zero: none
    integer(c_int), intent(out) :: shearless
    type(contact_state_t) :: state

    allocate (state%pressure, source=pressure)
    allocate (state%traction(n_col, n_row, 2))
    state%traction(:, :, 1) = traction_x
    state%traction(:, :, 2) = traction_y
    shearless = merge(1, 0, shear_free(state, field_space_t(), step_options_t()))
  end subroutine is_shear_free

  !> Return the first attempt at a load step.
  subroutine first_attempt(control, least, fraction, largest, attempt)
    !> Control of the load steps; at the beginning of a segment its first size follows from that of the last one
    real(c_double), intent(inout) :: control(8)
    !> Smallest load step
    real(c_double), intent(in) :: least
    !> Part of the segment that is done, largest load step
    real(c_double), intent(in) :: fraction, largest
    !> The attempt
    real(c_double), intent(out) :: attempt(5)
    type(step_control_t) :: steps

    steps = control_of(control, least)
    if (fraction <= 0.0_c_double) call steps%start_segment()
    control = numbers_of_control(steps)
    attempt = numbers_of_attempt(steps%first_attempt(fraction, largest))
  end subroutine first_attempt

  !> Decide what becomes of an attempt.
  subroutine decide_attempt(control, least, attempt, converged, change, tolerance, verdict)
    !> Control of the load steps
    real(c_double), intent(in) :: control(8)
    !> Smallest load step
    real(c_double), intent(in) :: least
    !> The attempt; if it is rejected, the next one
    real(c_double), intent(inout) :: attempt(5)
    !> Not zero: it was solved
    integer(c_int), intent(in) :: converged
    !> What the halves change
    real(c_double), intent(in) :: change(7)
    !> What a step may change
    real(c_double), intent(in) :: tolerance
    !> 0: rejected, 1: accepted, 2: smaller ones are of no use, 3: it did not converge and is the smallest there is
    integer(c_int), intent(out) :: verdict
    type(step_control_t) :: steps
    type(step_attempt_t) :: tried

    steps = control_of(control, least)
    tried = attempt_of(attempt)
    call steps%decide(tried, converged /= 0, change_of(change), tolerance, verdict)
    attempt = numbers_of_attempt(tried)
  end subroutine decide_attempt

  !> Take over an attempt.
  subroutine accept_attempt(control, least, attempt, change, tolerance, verdict, bounds)
    !> Control of the load steps
    real(c_double), intent(inout) :: control(8)
    !> Smallest load step
    real(c_double), intent(in) :: least
    !> The attempt
    real(c_double), intent(in) :: attempt(5)
    !> What the halves change
    real(c_double), intent(in) :: change(7)
    !> What a step may change
    real(c_double), intent(in) :: tolerance
    !> What became of it
    integer(c_int), intent(in) :: verdict
    !> Bounds on the errors of the stick area, over the largest contact area, and of the tractions
    real(c_double), intent(out) :: bounds(2)
    type(step_control_t) :: steps

    steps = control_of(control, least)
    call steps%accept(attempt_of(attempt), change_of(change), tolerance, verdict)
    bounds = [steps%bound(change_of(change)), steps%traction_bound(tolerance)]
    control = numbers_of_control(steps)
  end subroutine accept_attempt

  !> Estimate the relative errors that a lattice leaves at most.
  subroutine errors_of_lattice(spacings, load_ratio, goal, errors, needed)
    !> Spacings in the radius of the contact
    real(c_double), intent(in) :: spacings
    !> Q/mu P; 0: nothing slips
    real(c_double), intent(in) :: load_ratio
    !> Error that is small enough
    real(c_double), intent(in) :: goal
    !> Of largest pressure, contact area, stick area and dissipated energy
    real(c_double), intent(out) :: errors(4)
    !> Spacings that leave no more than the goal
    real(c_double), intent(out) :: needed
    type(lattice_errors_t) :: found

    found = lattice_errors(spacings, slip_ring(load_ratio))
    errors = [found%max_pressure, found%contact_area, found%stick_area, found%dissipated_energy]
    needed = lattice_spacings(goal, slip_ring(load_ratio))
  end subroutine errors_of_lattice

  !> Estimate the errors of the shear tractions where the contact grows.
  subroutine errors_of_entry(n, before, after, stick, load_ratio, goal, steps, error, needed)
    !> Number of load steps in which the contact grows
    integer(c_int), intent(in) :: n
    !> Contact radius before and after each [m]
    real(c_double), intent(in) :: before(n), after(n)
    !> mu/|beta|; 0: the materials are alike
    real(c_double), intent(in) :: stick
    !> Q/mu P of a tangential load that grows at the same time; negative: there is none
    real(c_double), intent(in) :: load_ratio
    !> Error that is small enough
    real(c_double), intent(in) :: goal
    !> Steps as they count, error, steps that leave no more than the goal
    real(c_double), intent(out) :: steps, error, needed

    steps = even_steps(before, after)
    error = 0.0_c_double
    needed = 1.0_c_double
    if (stick > 0.0_c_double) then
      error = entry_error(steps, stick)
      needed = entry_steps(goal, stick)
    end if
    if (load_ratio < 0.0_c_double) return
    error = max(error, oblique_error(steps, load_ratio))
    needed = max(needed, oblique_steps(goal, load_ratio))
  end subroutine errors_of_entry

  !> Estimate the error of the dissipated energy where the tangential load turns.
  subroutine error_of_turns(n, shear, error)
    !> Number of load steps
    integer(c_int), intent(in) :: n
    !> Tangential load or shift along x and y, and torque or twist, each over its largest, at the end of each step
    real(c_double), intent(in) :: shear(3, n)
    !> Its error as a share
    real(c_double), intent(out) :: error

    error = turning_error(shear)
  end subroutine error_of_turns

  !> Compute the width of the slip ring over the contact radius.
  subroutine width_of_ring(load_ratio, width)
    !> Q/mu P
    real(c_double), intent(in) :: load_ratio
    !> Width over radius
    real(c_double), intent(out) :: width

    width = slip_ring(load_ratio)
  end subroutine width_of_ring

  !> Set up a control from its numbers.
  pure type(step_control_t) function control_of(numbers, least)
    real(c_double), intent(in) :: numbers(8), least
    control_of = step_control_t(numbers(1), numbers(2), numbers(3), numbers(4), numbers(5), numbers(6), numbers(7), numbers(8), &
                                step_options_t(least))
  end function control_of

  !> Return a control as numbers.
  pure function numbers_of_control(control) result(numbers)
    type(step_control_t), intent(in) :: control
    real(c_double) :: numbers(8)
    numbers = [control%size, control%first, control%stick, control%traction, control%past_stick, control%past_traction, &
               control%spent, control%turned]
  end function numbers_of_control

  !> Set up an attempt from its numbers.
  pure type(step_attempt_t) function attempt_of(numbers)
    real(c_double), intent(in) :: numbers(5)
    attempt_of = step_attempt_t(numbers(1), numbers(2), nint(numbers(3)), numbers(4), numbers(5))
  end function attempt_of

  !> Return an attempt as numbers.
  pure function numbers_of_attempt(attempt) result(numbers)
    type(step_attempt_t), intent(in) :: attempt
    real(c_double) :: numbers(5)
    numbers = [attempt%start, attempt%end, real(attempt%n_rejected, c_double), attempt%last_excess, attempt%last_size]
  end function numbers_of_attempt

  !> Set up a change from its numbers.
  pure type(step_change_t) function change_of(numbers)
    real(c_double), intent(in) :: numbers(7)
    change_of = step_change_t(numbers(1), numbers(2), numbers(3), numbers(4), numbers(5), numbers(6), numbers(7))
  end function change_of

end module hc_f2py_steps
