!> Load steps with friction on the part of the window around the contact.
!>
!> A contact that is small in its window (the first steps of one that grows, wide
!> windows) is solved on the part around it. What the tractions do elsewhere follows from one
!> product over the window, which also judges the state; hc_subwindow says what follows if it fails.
!>
!> Theory: docs/theory/multilevel.md.
module hc_subwindow_solver
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_contact_state, only: contact_state_t, new_friction_state, load_target_t
  use hc_contact_problem, only: friction_problem_t
  use hc_contact_solver, only: friction_solver_t
  use hc_frictional_contact, only: frictional_contact_t, new_frictional_contact, frictional_contact_memory, friction_step_memory
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_subwindow, only: next_part
  implicit none
  private

  public :: windowed_friction_t, new_windowed_friction, windowed_friction_memory

  !> A contact problem with friction, on its window and on a part of it.
  type, extends(friction_solver_t) :: windowed_friction_t
    private
    type(frictional_contact_t) :: whole
    type(frictional_contact_t), allocatable :: part
    !> First and last column and row of the part
    integer :: low(2) = 0, high(2) = 0
    !> Threads that were asked for; 0: as many as OpenMP would take
    integer :: threads = 0
    !> Spectra that are kept
    type(kernel_cache_t), pointer :: cache => null()
  contains
    procedure :: solve_step
    procedure :: displacements
  end type windowed_friction_t

contains

  !> Operators of a problem on its window; those of parts come when they are needed.
  subroutine new_windowed_friction(self, problem, error, n_threads, cache)
    !> Solver to be set up
    type(windowed_friction_t), intent(out) :: self
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Threads to use; absent or 0: as many as OpenMP would take
    integer, intent(in), optional :: n_threads
    !> Spectra that are kept; it has to outlive the solver
    type(kernel_cache_t), pointer, intent(in), optional :: cache

    self%problem = problem
    if (present(n_threads)) self%threads = n_threads
    if (present(cache)) self%cache => cache
    call new_frictional_contact(self%whole, problem, error, n_threads, self%cache)
    if (allocated(error)) return
    self%problem%space = self%whole%problem%space
  end subroutine new_windowed_friction

  !> Bytes that a problem takes while a step is solved on the window; parts, and spectra that are kept of them, take
  !> more the more steps the contact grows in.
  pure integer(selected_int_kind(18)) function windowed_friction_memory(extent, n_contact, n_force, coupled, threads)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Nodes in contact
    integer, intent(in) :: n_contact
    !> Loads that are prescribed, the normal one among them
    integer, intent(in) :: n_force
    !> Pressure and shear move each other
    logical, intent(in) :: coupled
    !> Threads to use
    integer, intent(in) :: threads
    integer, parameter :: long = selected_int_kind(18)

    ! what is given is there twice
    windowed_friction_memory = frictional_contact_memory(extent, threads) &
                               + friction_step_memory(extent, n_contact, n_force, coupled) &
                               + 28*int(extent(1), long)*extent(2)
  end function windowed_friction_memory

  subroutine displacements(self, pressure, traction, displacement, error)
    class(windowed_friction_t), intent(inout) :: self
    real(wp), intent(in) :: pressure(:, :), traction(:, :, :)
    real(wp), intent(out), contiguous :: displacement(:, :, :)
    type(error_t), allocatable, intent(out) :: error

    call self%whole%displacements(pressure, traction, displacement, error)
  end subroutine displacements

  subroutine solve_step(self, start, reference, target, tolerance, max_sweeps, state, error)
    class(windowed_friction_t), intent(inout), target :: self
    type(contact_state_t), intent(in) :: start
    real(wp), intent(in) :: reference(:, :, :)
    type(load_target_t), intent(in) :: target
    real(wp), intent(in) :: tolerance
    integer, intent(in) :: max_sweeps
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error

    integer :: low(2), high(2), try, sweeps
    real(wp) :: work
    logical :: found, solved

    work = 0.0_wp
    sweeps = 0
    if (any(start%pressure > 0.0_wp) .and. self%problem%is_pressed(target)) then
      do try = 1, self%problem%options%multilevel%max_parts + 1
        associate (problem => self%problem, options => self%problem%options%multilevel)
          if (try == 1) then
            call next_part(try, options, problem%lattice, problem%candidate, start, low, high, found)
          else
            call next_part(try, options, problem%lattice, problem%candidate, state, low, high, found)
          end if
        end associate
        if (.not. found) exit
        call take_part(self, low, high, error)
        if (allocated(error)) return
        call solve_part(self, start, reference, target, tolerance, max_sweeps, state, solved, error)
        if (allocated(error)) return
        work = work + state%operator_applications
        sweeps = sweeps + state%sweeps
        state%operator_applications = work
        state%sweeps = sweeps
        if (state%converged) return
        if (.not. solved) exit
      end do
    end if
    call self%whole%solve_step(start, reference, target, tolerance, max_sweeps, state, error)
    state%operator_applications = state%operator_applications + work
    state%sweeps = state%sweeps + sweeps
  end subroutine solve_step

  !> Solver on the part of the window between some columns and rows, unless it is at hand.
  subroutine take_part(self, low, high, error)
    class(windowed_friction_t), intent(inout) :: self
    integer, intent(in) :: low(2), high(2)
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem

    if (allocated(self%part)) then
      if (all(low == self%low) .and. all(high == self%high)) return
      deallocate (self%part)
    end if
    self%low = low
    self%high = high
    call self%problem%take_part(low, high, problem)
    allocate (self%part)
    call new_frictional_contact(self%part, problem, error, self%threads, self%cache)
  end subroutine take_part

  !> A step on the part, judged on the window.
  subroutine solve_part(self, start, reference, target, tolerance, max_sweeps, state, solved, error)
    class(windowed_friction_t), intent(inout) :: self
    type(contact_state_t), intent(in) :: start
    real(wp), intent(in) :: reference(:, :, :)
    type(load_target_t), intent(in) :: target
    real(wp), intent(in) :: tolerance
    integer, intent(in) :: max_sweeps
    !> State on the window
    type(contact_state_t), intent(out) :: state
    !> There is a solution on the part
    logical, intent(out) :: solved
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    type(contact_state_t) :: before, after
    real(wp), allocatable :: displacement(:, :, :)

    solved = .false.
    call new_friction_state(state, self%problem%lattice, self%problem%space)
    associate (lattice => self%part%problem%lattice, c => [self%low(1), self%high(1)], r => [self%low(2), self%high(2)])
      call new_friction_state(before, lattice, self%problem%space)
      before%pressure = start%pressure(c(1):c(2), r(1):r(2))
      before%gap = start%gap(c(1):c(2), r(1):r(2))
      before%traction = start%traction(c(1):c(2), r(1):r(2), :)
      before%relative_displacement = start%relative_displacement(c(1):c(2), r(1):r(2), :)
      before%motion = start%motion
      before%load = start%load
      if (.not. self%part%problem%is_pressed(target)) return
      call self%part%solve_step(before, reference(c(1):c(2), r(1):r(2), :), target, &
                                self%problem%options%multilevel%part_tolerance*tolerance, max_sweeps, after, error)
      if (allocated(error)) return
      state%operator_applications = after%operator_applications*lattice%size()/self%problem%lattice%size()
      state%sweeps = after%sweeps
      solved = after%converged
      if (.not. solved) return
      state%pressure(c(1):c(2), r(1):r(2)) = after%pressure
      state%traction(c(1):c(2), r(1):r(2), :) = after%traction
    end associate
    state%motion = after%motion
    allocate (displacement(size(state%pressure, 1), size(state%pressure, 2), 3))
    call self%whole%displacements(state%pressure, state%traction, displacement, error)
    if (allocated(error)) return
    call self%problem%conclude(target, tolerance, reference, displacement, state)
    state%operator_applications = state%operator_applications + 1.0_wp
  end subroutine solve_part

end module hc_subwindow_solver
