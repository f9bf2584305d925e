!> Wear of the surfaces by cycles of a load history, of which a few are solved.
!>
!> The unworn cycle is repeated until its wear is converged, (V9). Then two jumps of many cycles are compared with one of double
!> length, (V6), which decides the size of the next jump (hc_step_control) and corrects the second one, (V5). Each
!> cycle is solved load step by load step on the worn gap:
!>
!>     call wear%initialize(state, steps)
!>     do
!>       call wear%advance(solver, error)
!>       if (allocated(error) .or. wear%verdict == failed) exit
!>       if (wear%verdict == pending) cycle    ! a further load step follows
!>       ... wear%cycle is solved: its state, its worn depth ...
!>       if (wear%cycle%cycles >= wear%cycles) exit
!>     end do
!>
!> If the verdict is `outgrown`, the contact reached the rim of a window that grows: `carry` continues on a larger one.
!>
!> Equations: docs/theory/wear.md, (V1) to (V6), (V9).
module hc_wear_path
  use hc_precision, only: wp, sp
  use hc_error, only: error_t, status, raise
  use hc_memory, only: require_memory
  use hc_lattice, only: lattice_t
  use hc_field_space, only: space_over
  use hc_elastic_medium, only: elastic_medium_t
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_contact_state, only: contact_state_t, load_target_t, force_control, n_load, n_motion, normal, &
                              separated
  use hc_normal_problem, only: normal_problem_t, new_normal_problem
  use hc_contact_problem, only: friction_problem_t
  use hc_contact_solver, only: friction_solver_t
  use hc_wear_ahead, only: worn_cycle_t, energy_ahead, energy_ahead_memory
  use hc_load_path, only: advance_state => advance, step_settings_t
  use hc_step_error, only: step_change_t
  use hc_step_control, only: step_control_t, step_attempt_t, accepted, failed, limited, outgrown, pending, rejected
  use hc_window_growth, only: embed, extend_state, grown_window
  use hc_wear_jumps, only: wear_law_t, two_jumps_t, wear_by, wear_left, jump_change, energy_of_second_jump, expect_end, &
                           remember_end
  implicit none
  private

  public :: wear_path_t, wear_cycle_t, cycle_step_t

  !> Load step of a cycle, and its last solution, from which the next one is extrapolated.
  type :: cycle_step_t
    !> Loads or motions at its end
    type(load_target_t) :: target
    !> Share of load or motion at the beginning of its segment that adds to the target
    real(wp) :: from_start(n_load) = 0.0_wp
    !> Number of its segment
    integer :: segment = 1
    !> Cycles when it was solved last; negative: never
    real(wp) :: cycles = -1.0_wp
    !> Motions at its end and their rates by cycle
    real(wp) :: motion(n_motion, 2) = 0.0_wp
    !> Pressure and tractions at its end and their rates by cycle (n, 3, 2) [Pa]; single precision is enough to start from
    real(sp), allocatable :: traction(:, :, :)
  end type cycle_step_t

  !> A solved cycle; fields over the window (n_col, n_row).
  type :: wear_cycle_t
    !> Its end, with slip and dissipation of all cycles, and with work and largest residuals of the load steps of this one
    type(contact_state_t), allocatable :: state
    !> Worn depth [m], and sum of its changes by jumps of half the size [m]
    real(wp), allocatable :: worn(:, :), change(:, :)
    !> Dissipated energy by area [J/m^2] and path of slip [m] of this cycle
    real(wp), allocatable :: energy(:, :), path(:, :)
    !> Dissipated energy of this cycle [J]
    real(wp) :: spent = 0.0_wp
    !> Cycles that have worn the surfaces
    real(wp) :: cycles = 0.0_wp
    !> Between two jumps: cycles at the end of the second one, and energy of a cycle by which it wears [J/m^2]
    real(wp) :: until = 0.0_wp
    real(wp), allocatable :: ahead(:, :)
  end type wear_cycle_t

  !> Path through cycles that wear the surfaces.
  type :: wear_path_t
    !> Coefficient of wear of both bodies together, k [m^2/N]
    real(wp) :: coefficient = 0.0_wp
    !> Cycles that wear, and those of a jump; 0: chosen by the tolerance
    real(wp) :: cycles = 1.0_wp, jump = 0.0_wp
    !> Change of the worn depth by halving a jump, (V6), and of the wear of the unworn cycle by repeating it, (V9)
    real(wp) :: tolerance = 0.03_wp
    !> Unworn cycles at most
    integer :: most_unworn = 50
    !> How the load steps of unworn cycles are solved, and bound of the residuals of the others
    type(step_settings_t) :: settings
    real(wp) :: cycle_tolerance = 3.0e-4_wp
    !> The window grows: a load step that reaches its rim is solved again on a larger one
    logical :: grows = .false.
    !> Medium that nodes indent, (V6); not allocated before a cycle: that of the problem
    class(elastic_medium_t), allocatable :: medium
    !> Last solved cycle
    type(wear_cycle_t), allocatable :: cycle
    !> Worn volume [m^3], largest worn depth and bound on its error [m]
    real(wp) :: volume = 0.0_wp, deepest = 0.0_wp, depth_error = 0.0_wp
    !> Unworn cycles that were solved, and bound on the change of their wear by more of them, as a share; they are closed
    integer :: unworn = 0
    real(wp) :: left = 0.0_wp
    logical :: closed = .false.
    !> Rejected attempts at the last jump; negative: it was not compared with jumps of half the size
    integer :: n_rejected = -1
    !> Result of the last load step: pending (the next one follows), accepted or limited (a cycle is solved), failed, outgrown
    integer :: verdict = pending
    !> Present load step of the cycle, 0: none; its target and the state at its beginning
    integer :: place = 0
    type(load_target_t) :: goal
    type(contact_state_t), allocatable :: state
    !> Solution of a load step that failed, or reached the rim of the window, and the larger window that this needs
    type(contact_state_t), allocatable :: attempted
    type(lattice_t) :: larger
    !> Load steps of the cycle; the first one is that onto the worn gap, under the loads at the end of the cycle
    type(cycle_step_t), allocatable :: steps(:)
    !> Size of the jumps, as a share of all cycles
    type(step_control_t) :: control
    !> Present attempt at a pair of jumps, which is compared; it is under way
    type(step_attempt_t), private :: attempt
    logical, private :: compares = .false., attempts = .false.
    !> The cycle that is being solved; its state has sums of all cycles before, and those of its load steps
    type(wear_cycle_t), allocatable, private :: next
    !> Cycles of the jump to it
    real(wp), private :: jumped = 0.0_wp
    !> Coefficient of friction, energies of a cycle in the first of two jumps and in one of both, and of the last unworn cycles
    real(wp), allocatable, private :: friction(:, :), first(:, :), both(:, :), last(:, :), last_but_one(:, :)
    !> Loads and motions at the beginning of the segment
    type(contact_state_t), private :: begun
    !> Expected pressure [Pa] and motions at the end of the load step before the present one
    real(sp), allocatable, private :: expected(:)
    real(wp), private :: expected_motion(n_motion) = 0.0_wp
  contains
    !> Begin at the end of a load history
    procedure :: initialize
    !> Go on from a solved cycle
    procedure :: continue_from
    !> Solve a load step
    procedure :: advance
    !> Go on with the solver of a larger window
    procedure :: carry
    procedure, private :: begin_cycle, begin_jump, solve_step, end_cycle, close_cycle, compare_jumps, energy_of_jump
    procedure, private :: set_guess, remember, retry, measure
  end type wear_path_t

  !> Errors of the depth are at most 1.7 times its change by jumps of half the size, as measured.
  real(wp), parameter :: depth_safety = 2.0_wp
  !> Smallest jump, as a share of all cycles.
  real(wp), parameter :: least_jump = 1.0e-12_wp

contains

  !> Begin at the end of a load history.
  subroutine initialize(self, state, steps)
    class(wear_path_t), intent(inout) :: self
    !> End of the history
    type(contact_state_t), intent(in) :: state
    !> Loads at the end of the cycle, which are those of the history, and load steps of the cycle
    type(cycle_step_t), intent(in) :: steps(:)
    type(wear_cycle_t) :: cycle

    allocate (cycle%state, source=state)
    allocate (cycle%worn, source=0.0_wp*state%pressure)
    cycle%change = cycle%worn
    cycle%energy = cycle%worn
    cycle%path = cycle%worn
    allocate (self%steps, source=steps)
    self%control%options%least_step = least_jump
    call self%continue_from(cycle)
    self%closed = .false.
  end subroutine initialize

  !> Go on from a solved cycle.
  subroutine continue_from(self, cycle)
    class(wear_path_t), intent(inout) :: self
    !> The cycle
    type(wear_cycle_t), intent(in) :: cycle

    self%cycle = cycle
    self%place = 0
    self%closed = .true.
    self%attempts = .false.
  end subroutine continue_from

  !> Solve the next load step of a cycle.
  subroutine advance(self, solver, error, cache)
    class(wear_path_t), intent(inout) :: self
    !> Method
    class(friction_solver_t), intent(inout) :: solver
    !> Allocated on failure. No failure: the verdict is `failed` and `state` is not converged, and says why, if a load step
    !> does not converge.
    type(error_t), allocatable, intent(out) :: error
    !> Cache of spectra
    type(kernel_cache_t), pointer, intent(in), optional :: cache

    self%verdict = pending
    if (.not. allocated(self%medium)) allocate (self%medium, source=solver%problem%medium)
    if (self%place == 0) call self%begin_cycle(solver, error, cache)
    if (.not. allocated(error)) call self%solve_step(solver, error)
    if (.not. allocated(error) .and. self%verdict == pending .and. self%place > size(self%steps)) then
      call self%end_cycle(solver, error, cache)
    end if
    if (self%attempts) call self%retry(error)
  end subroutine advance

  !> Reject a pair of jumps whose solution failed; the next attempt is smaller, if there is one.
  subroutine retry(self, error)
    class(wear_path_t), intent(inout) :: self
    !> Failure of the solution
    type(error_t), allocatable, intent(inout) :: error
    integer :: verdict

    if (allocated(error)) then
      if (error%code /= status%no_convergence) return
    else if (self%verdict /= failed) then
      return
    end if
    call self%control%decide(self%attempt, .false., step_change_t(), self%tolerance, verdict)
    if (verdict == failed) return
    self%verdict = pending
    self%place = 0
    if (allocated(error)) deallocate (error)
  end subroutine retry

  !> Begin a cycle: unworn, after the second of two jumps, or after a jump that is given or chosen.
  subroutine begin_cycle(self, solver, error, cache)
    class(wear_path_t), intent(inout) :: self
    !> Method
    class(friction_solver_t), intent(inout) :: solver
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    !> Cache of spectra
    type(kernel_cache_t), pointer, intent(in), optional :: cache
    real(wp), allocatable :: energy(:, :), both(:, :)
    real(wp) :: until, half, left

    if (allocated(self%next)) deallocate (self%next)
    allocate (self%next)
    self%friction = nodal_coefficients(solver%problem)
    self%compares = .false.
    left = self%cycles - self%cycle%cycles
    if (.not. self%closed) then
      call self%begin_jump(solver, 0.0_wp, 0.0_wp*self%cycle%energy)
    else if (allocated(self%cycle%ahead)) then
      energy = self%cycle%ahead
      call self%begin_jump(solver, self%cycle%until, energy)
    else if (self%jump > 0.0_wp .and. left <= self%jump) then
      call self%energy_of_jump(solver%problem, self%cycle, left, energy, error, cache)
      if (.not. allocated(error)) call self%begin_jump(solver, self%cycles, energy)
    else
      self%compares = .true.
      if (self%jump > 0.0_wp) then
        until = self%cycle%cycles + min(2.0_wp*self%jump, left)
      else
        if (.not. self%attempts) then
          if (self%cycle%cycles <= 0.0_wp) call self%control%start_segment()
          self%attempt = self%control%first_attempt(self%cycle%cycles/self%cycles, 1.0_wp)
          self%attempts = .true.
        end if
        until = self%attempt%end*self%cycles
      end if
      half = 0.5_wp*(until - self%cycle%cycles)
      self%next%until = until
      call self%energy_of_jump(solver%problem, self%cycle, half, energy, error, cache)
      if (.not. allocated(error)) call self%energy_of_jump(solver%problem, self%cycle, 2.0_wp*half, both, error, cache)
      if (allocated(error)) return
      call self%begin_jump(solver, self%cycle%cycles + half, energy)
      call move_alloc(energy, self%first)
      call move_alloc(both, self%both)
    end if
  end subroutine begin_cycle

  !> Wear the surfaces by a jump, (V3), after which a cycle begins.
  subroutine begin_jump(self, solver, until, energy)
    class(wear_path_t), intent(inout) :: self
    !> Method
    class(friction_solver_t), intent(inout) :: solver
    !> Cycles at the end of the jump
    real(wp), intent(in) :: until
    !> Energy of a cycle by which it wears (n_col, n_row) [J/m^2]
    real(wp), intent(in) :: energy(:, :)
    real(wp) :: jump, area

    jump = until - self%cycle%cycles
    area = solver%problem%lattice%cell_area()
    self%next%worn = self%cycle%worn
    call wear_by(energy, self%coefficient, self%friction, jump, self%next%worn)
    call solver%wear(self%next%worn)
    allocate (self%next%state)
    associate (before => self%cycle, sums => self%next%state)
      self%next%cycles = until
      self%next%change = before%change
      sums%accumulated_slip = before%state%accumulated_slip + jump*before%path
      sums%dissipation_density = before%state%dissipation_density + jump*energy
      sums%dissipated_energy = before%state%dissipated_energy + jump*area*solver%problem%space%sum(energy)
      sums%path_error = before%state%path_error
      self%jumped = jump
      self%state = before%state
    end associate
    call forget_slip(self%state)
    call clear_work(self%next%state)
    if (allocated(self%expected)) deallocate (self%expected)
    self%place = 1
  end subroutine begin_jump

  !> Solve the present load step of the cycle.
  subroutine solve_step(self, solver, error)
    class(wear_path_t), intent(inout) :: self
    !> Method
    class(friction_solver_t), intent(inout) :: solver
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    type(step_settings_t) :: settings
    type(contact_state_t), allocatable :: reached
    logical :: begins

    settings = self%settings
    if (self%closed) settings%tolerance = self%cycle_tolerance
    begins = self%place <= 2
    if (.not. begins) begins = self%steps(self%place)%segment /= self%steps(self%place - 1)%segment
    if (begins) then
      self%begun%load = self%state%load
      self%begun%motion = self%state%motion
    end if
    associate (step => self%steps(self%place), begun => self%begun)
      self%goal = step%target
      self%goal%value(:n_load) = step%target%value(:n_load) + step%from_start &
                                 *merge(begun%load(:n_load), begun%motion(:n_load), step%target%control(:n_load) == force_control)
    end associate
    call self%set_guess(solver)
    if (allocated(self%attempted)) deallocate (self%attempted)
    allocate (reached)
    call advance_state(solver, self%state, self%goal, settings, reached, error)
    if (allocated(error)) return
    if (self%grows .and. reached%clipped) then
      self%verdict = outgrown
      self%larger = grown_window(solver%problem%lattice, reached%zone /= separated, solver%problem%space)
    else if (.not. reached%converged) then
      self%verdict = failed
    end if
    if (self%verdict /= pending) then
      call move_alloc(reached, self%attempted)
      return
    end if
    call move_alloc(reached, self%state)
    call self%remember(self%state)
    if (self%place > 1) then
      call add_work(self%state, self%next%state)
    else  ! this slip is no part of the cycle
      call forget_slip(self%state)
    end if
    self%place = self%place + 1
  end subroutine solve_step

  !> Take over a cycle that is solved.
  subroutine end_cycle(self, solver, error, cache)
    class(wear_path_t), intent(inout) :: self
    !> Method
    class(friction_solver_t), intent(inout) :: solver
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    !> Cache of spectra
    type(kernel_cache_t), pointer, intent(in), optional :: cache

    self%place = 0
    associate (next => self%next)
      next%energy = self%state%dissipation_density
      next%path = self%state%accumulated_slip
      next%spent = self%state%dissipated_energy
      call move_alloc(next%state%accumulated_slip, self%state%accumulated_slip)
      call move_alloc(next%state%dissipation_density, self%state%dissipation_density)
      self%state%dissipated_energy = next%state%dissipated_energy
      self%state%path_error = next%state%path_error + self%jumped*self%state%path_error
      call copy_work(next%state, self%state)
      call move_alloc(self%state, next%state)
    end associate
    self%n_rejected = -1
    if (.not. self%closed) then
      call self%close_cycle(solver%problem, error)
      if (allocated(error) .or. .not. self%closed) return
    else
      self%verdict = accepted
      if (self%compares) call self%compare_jumps(solver%problem, error, cache)
      if (allocated(error) .or. self%verdict == pending) return
      call move_alloc(self%next, self%cycle)
    end if
    call self%measure(solver%problem)
  end subroutine end_cycle

  !> Decide whether the unworn cycle is closed, (V9), and choose the first pair of jumps: the wear of each is the indentation of a
  !> node by the largest pressure.
  subroutine close_cycle(self, problem, error)
    class(wear_path_t), intent(inout) :: self
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> Allocated if nothing slips
    type(error_t), allocatable, intent(out) :: error
    type(step_change_t) :: change
    type(wear_law_t) :: law
    type(two_jumps_t) :: jumps
    real(wp), allocatable :: energies(:, :, :), slower(:, :), traction(:, :, :, :)
    integer :: extent(2)

    if (.not. problem%space%max(abs(self%next%energy)) > 0.0_wp) then
      call raise(error, status%invalid_input, 'no node slips in this cycle, so that nothing wears')
      return
    end if
    extent = shape(self%next%energy)
    associate (before => self%cycle, after => self%next)
      energies = reshape(after%energy, [extent, 1])
      if (self%unworn >= 1) energies = reshape([self%last, energies], [extent, 2])
      if (self%unworn >= 2) energies = reshape([self%last_but_one, energies], [extent, 3])
      traction = reshape([before%state%traction, after%state%traction], [extent, 2, 2])
      self%left = wear_left(energies, traction, after%state%pressure, self%friction, problem%space)
      if (self%unworn >= 1) then
        self%last_but_one = self%last
        call add_sums(before%state, after%state)
      end if
      self%last = after%energy
    end associate
    self%unworn = self%unworn + 1
    call move_alloc(self%next, self%cycle)
    self%closed = self%left <= self%tolerance .or. self%unworn >= self%most_unworn
    if (.not. self%closed) return
    self%verdict = accepted
    law = wear_law_t(self%coefficient, self%friction)
    jumps%second = self%cycle%energy
    allocate (jumps%first, jumps%both, mold=jumps%second)
    jumps%first = 0.0_wp
    jumps%both = 0.0_wp
    jumps%cycles = 1.0_wp
    allocate (slower, mold=jumps%first)
    call jump_change(problem%lattice, self%medium, law, jumps, problem%space%max(self%cycle%state%pressure), slower, change, &
                     problem%space)
    ! the first step of a segment is `most_growth` times as large
    self%control%first = 0.5_wp*min(1.0_wp, 1.0_wp/max(change%added*self%cycles, 1.0e-300_wp))
  end subroutine close_cycle

  !> Compare two jumps with one of double length: the second one is corrected, and the pair accepted or rejected.
  subroutine compare_jumps(self, problem, error, cache)
    class(wear_path_t), intent(inout) :: self
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    !> Cache of spectra
    type(kernel_cache_t), pointer, intent(in), optional :: cache
    type(two_jumps_t) :: jumps
    type(wear_law_t) :: law
    type(step_change_t) :: change
    real(wp), allocatable :: slower(:, :)
    integer :: verdict

    jumps%cycles = 0.5_wp*(self%next%until - self%cycle%cycles)
    call self%energy_of_jump(problem, self%next, jumps%cycles, jumps%second, error, cache)
    if (allocated(error)) return
    jumps%first = self%first
    jumps%both = self%both
    allocate (slower, self%next%ahead, mold=jumps%first)
    law = wear_law_t(self%coefficient, self%friction)
    call jump_change(problem%lattice, self%medium, law, jumps, problem%space%max(self%cycle%state%pressure), slower, change, &
                     problem%space)
    call energy_of_second_jump(problem%lattice, self%medium, law, jumps, self%next%path, self%next%ahead)
    self%next%change = self%next%change + slower
    if (self%jump > 0.0_wp) return
    call self%control%decide(self%attempt, .true., change, self%tolerance, verdict)
    self%verdict = merge(pending, verdict, verdict == rejected)
    if (verdict == rejected) return
    call self%control%accept(self%attempt, change, self%tolerance, verdict)
    self%n_rejected = self%attempt%n_rejected
    self%attempts = .false.
  end subroutine compare_jumps

  !> Compute the energy of a cycle by which a jump wears, with the pressure at its end, (V4).
  subroutine energy_of_jump(self, problem, cycle, cycles, energy, error, cache)
    class(wear_path_t), intent(in) :: self
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> The cycle before the jump
    type(wear_cycle_t), intent(in) :: cycle
    !> Cycles of the jump
    real(wp), intent(in) :: cycles
    !> Energy by area of each cycle (n_col, n_row) [J/m^2]
    real(wp), allocatable, intent(out) :: energy(:, :)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    !> Cache of spectra
    type(kernel_cache_t), pointer, intent(in), optional :: cache
    type(normal_problem_t) :: pressed
    type(worn_cycle_t) :: now

    pressed%space = space_over(problem%lattice%extent)
    pressed%space%ranks = problem%space%ranks
    if (max(problem%space%ranks%size, problem%space%helpers%size) == 1) then ! several ranks have checked it together
      call require_memory(energy_ahead_memory(problem%lattice%extent, pressed%space%threads), error, pressed%space%threads)
      if (allocated(error)) return
    end if
    now = worn_cycle_t(cycle%energy, cycle%path, cycle%state%pressure, merge(cycle%state%gap, 0.0_wp, problem%candidate), &
                       logical(problem%candidate), self%friction, self%steps(1)%target%control(normal) == force_control)
    call new_normal_problem(pressed, problem%lattice, problem%medium, now%gap, logical(problem%candidate), error, &
                            problem%normal_law)
    if (allocated(error)) return
    allocate (energy, mold=cycle%energy)
    call energy_ahead(now, pressed, cycles*self%coefficient, self%cycle_tolerance, energy, error, cache)
    call problem%space%agree(error)
  end subroutine energy_of_jump

  !> Compute volume, largest depth and the bound on its error after a cycle.
  subroutine measure(self, problem)
    class(wear_path_t), intent(inout) :: self
    !> The problem
    type(friction_problem_t), intent(in) :: problem

    associate (space => problem%space)
      self%volume = problem%lattice%cell_area()*space%sum(self%cycle%worn)
      self%deepest = space%max(self%cycle%worn)
      self%depth_error = depth_safety*space%max(abs(self%cycle%change)) + self%left*self%deepest
    end associate
  end subroutine measure

  !> Return the coefficient of friction of each node: its bound under a pressure of 1.
  pure function nodal_coefficients(problem) result(coefficient)
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    real(wp) :: coefficient(problem%lattice%extent(1), problem%own_rows()), one(problem%lattice%extent(1))
    integer :: row

    one = 1.0_wp
    do row = 1, size(coefficient, 2)
      call problem%friction%find_bounds((row - 1)*size(one) + 1, one, coefficient(:, row))
    end do
  end function nodal_coefficients

  !> Extrapolate the present load step from its last solution, to start from: the pressure and the motions are those of the load
  !> step before plus the expected change, so that an error common to both extrapolations cancels.
  subroutine set_guess(self, solver)
    class(wear_path_t), intent(inout) :: self
    !> Method
    class(friction_solver_t), intent(inout) :: solver
    real(wp), allocatable :: traction(:, :)
    real(wp) :: motion(n_motion), ahead
    real(sp), allocatable :: expected(:), before(:)

    if (allocated(solver%guess)) deallocate (solver%guess)
    call move_alloc(self%expected, before)
    associate (step => self%steps(self%place))
      if (step%cycles < 0.0_wp) return
      allocate (expected(size(self%state%pressure)), traction(size(self%state%pressure), 3))
      ahead = self%next%cycles - step%cycles
      motion = step%motion(:, 1) + ahead*step%motion(:, 2)
      allocate (solver%guess)
      if (allocated(before) .and. self%place > 1) then
        call expect_end(step%traction, ahead, expected, traction, reshape(self%state%pressure, [size(expected)]), before)
        solver%guess%motion = self%state%motion + (motion - self%expected_motion)
      else
        call expect_end(step%traction, ahead, expected, traction)
        solver%guess%motion = motion
      end if
      self%expected_motion = motion
      call move_alloc(expected, self%expected)
    end associate
    solver%guess%pressure = reshape(traction(:, 1), shape(self%state%pressure))
    solver%guess%traction = reshape(traction(:, 2:), shape(self%state%traction))
  end subroutine set_guess

  !> Remember the end of the present load step, and its rate by cycle.
  subroutine remember(self, state)
    class(wear_path_t), intent(inout) :: self
    !> Its end
    type(contact_state_t), intent(in) :: state
    real(wp) :: passed, before(n_motion)

    associate (step => self%steps(self%place))
      passed = 0.0_wp
      if (step%cycles >= 0.0_wp) passed = self%next%cycles - step%cycles
      if (.not. allocated(step%traction)) allocate (step%traction(size(state%pressure), 3, 2), source=0.0_sp)
      call remember_end(reshape([state%pressure, state%traction], [size(state%pressure), 3]), passed, step%traction)
      before = step%motion(:, 1)
      step%motion(:, 2) = 0.0_wp
      if (passed > 0.0_wp .or. passed < 0.0_wp) step%motion(:, 2) = (state%motion - before)/passed
      step%motion(:, 1) = state%motion
      step%cycles = self%next%cycles
    end associate
  end subroutine remember

  !> Continue on the solver of a larger window, at the present load step.
  subroutine carry(self, solver, lattice, error)
    class(wear_path_t), intent(inout) :: self
    !> Method on the larger window
    class(friction_solver_t), intent(inout) :: solver
    !> The smaller window
    type(lattice_t), intent(in) :: lattice
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    type(contact_state_t) :: extended
    integer :: i

    call carry_fields(self%cycle)
    call carry_fields(self%next)
    call carry_field(self%next%state%accumulated_slip)
    call carry_field(self%next%state%dissipation_density)
    call carry_field(self%first)
    call carry_field(self%both)
    call carry_field(self%last)
    call carry_field(self%last_but_one)
    self%friction = nodal_coefficients(solver%problem)
    ! the last solutions are of the smaller window
    do i = 1, size(self%steps)
      self%steps(i)%cycles = -1.0_wp
      if (allocated(self%steps(i)%traction)) deallocate (self%steps(i)%traction)
    end do
    if (allocated(self%expected)) deallocate (self%expected)
    call solver%wear(self%next%worn)
    call extend_state(solver, lattice, self%cycle%state, extended, error)
    if (allocated(error)) return
    self%cycle%state = extended
    call extend_state(solver, lattice, self%state, extended, error)
    if (.not. allocated(error)) self%state = extended

  contains

    !> Put the fields of a cycle on the larger window.
    subroutine carry_fields(cycle)
      type(wear_cycle_t), intent(inout) :: cycle

      call carry_field(cycle%worn)
      call carry_field(cycle%change)
      call carry_field(cycle%energy)
      call carry_field(cycle%path)
      call carry_field(cycle%ahead)
    end subroutine carry_fields

    !> Put a field on the larger window.
    subroutine carry_field(field)
      real(wp), allocatable, intent(inout) :: field(:, :)

      call embed(lattice, solver%problem%lattice, solver%problem%space, field)
    end subroutine carry_field

  end subroutine carry

  !> Set slip path and dissipated energy of a state to zero.
  pure subroutine forget_slip(state)
    type(contact_state_t), intent(inout) :: state

    state%accumulated_slip = 0.0_wp
    state%dissipation_density = 0.0_wp
    state%dissipated_energy = 0.0_wp
    state%path_error = 0.0_wp
  end subroutine forget_slip

  !> Set work and residuals to zero.
  pure subroutine clear_work(state)
    type(contact_state_t), intent(inout) :: state
    type(contact_state_t) :: none

    none%residual_normal = 0.0_wp
    none%residual_force = 0.0_wp
    call copy_work(none, state)
  end subroutine clear_work

  !> Copy work and residuals.
  pure subroutine copy_work(from, to)
    type(contact_state_t), intent(in) :: from
    type(contact_state_t), intent(inout) :: to

    to%sweeps = from%sweeps
    to%cuts = from%cuts
    to%operator_applications = from%operator_applications
    to%residual_normal = from%residual_normal
    to%residual_tangential = from%residual_tangential
    to%residual_force = from%residual_force
    to%residual_shear_force = from%residual_shear_force
    to%residual_torque = from%residual_torque
  end subroutine copy_work

  !> Add the work of a load step.
  pure subroutine add_sums(from, to)
    type(contact_state_t), intent(in) :: from
    type(contact_state_t), intent(inout) :: to

    to%sweeps = to%sweeps + from%sweeps
    to%cuts = to%cuts + from%cuts
    to%operator_applications = to%operator_applications + from%operator_applications
  end subroutine add_sums

  !> Add the work of a load step, and keep the largest residuals.
  pure subroutine add_work(from, to)
    type(contact_state_t), intent(in) :: from
    type(contact_state_t), intent(inout) :: to

    call add_sums(from, to)
    to%residual_normal = max(to%residual_normal, from%residual_normal)
    to%residual_tangential = max(to%residual_tangential, from%residual_tangential)
    to%residual_force = max(to%residual_force, from%residual_force)
    to%residual_shear_force = max(to%residual_shear_force, from%residual_shear_force)
    to%residual_torque = max(to%residual_torque, from%residual_torque)
  end subroutine add_work

end module hc_wear_path
