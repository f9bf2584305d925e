!> Load steps with friction on the part of the window around the contact.
!>
!> A contact that is small in its window (the first steps of one that grows, wide
!> windows) is solved on the part around it. The displacements elsewhere follow from one
!> product over the window, which also judges the state; hc_subwindow chooses the next part if it fails.
!>
!> Theory: docs/theory/multilevel.md.
module hc_subwindow_solver
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_communicator, only: communicator_t
  use hc_contact_state, only: contact_state_t, load_target_t, load_step_t
  use hc_contact_problem, only: friction_problem_t
  use hc_frictional_contact, only: frictional_contact_t, new_frictional_contact, frictional_contact_memory, friction_step_memory
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_subwindow, only: next_part, solve_part
  implicit none
  private

  public :: windowed_friction_t, new_windowed_friction, windowed_friction_memory

  !> A contact problem with friction, on its window and on a part of it.
  type, extends(frictional_contact_t) :: windowed_friction_t
    private
    !> The part of the window around the contact
    type(frictional_contact_t), allocatable :: part
    !> First and last column and row of the part
    integer :: low(2) = 0, high(2) = 0
    !> Threads to use; 0: as many as OpenMP would take
    integer :: threads = 0
    !> Cache of spectra
    type(kernel_cache_t), pointer :: cache => null()
    !> Ranks that share the products
    type(communicator_t) :: ranks
  contains
    procedure :: solve_step
    procedure :: set_gap
  end type windowed_friction_t

contains

  !> Set up the operators of a problem on its window; those of parts are set up on demand.
  subroutine new_windowed_friction(self, problem, error, n_threads, cache, ranks)
    !> Solver to be set up
    type(windowed_friction_t), intent(out) :: self
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Threads to use; absent or 0: as many as OpenMP would take
    integer, intent(in), optional :: n_threads
    !> Cache of spectra; it has to outlive the solver
    type(kernel_cache_t), pointer, intent(in), optional :: cache
    !> Ranks that share the products of a problem of which each has all rows; absent: one
    type(communicator_t), intent(in), optional :: ranks

    if (present(ranks)) self%ranks = ranks
    if (present(n_threads)) self%threads = n_threads
    if (present(cache)) self%cache => cache
    call new_frictional_contact(self%frictional_contact_t, problem, error, n_threads, self%cache, ranks=self%ranks)
  end subroutine new_windowed_friction

  !> Count the bytes of a problem while a step is solved on the window; parts, and their spectra in the cache, take
  !> more the more steps the contact grows in.
  pure integer(selected_int_kind(18)) function windowed_friction_memory(extent, n_contact, n_force, coupled, threads, &
                                                                     n_spectrum, periodic)
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
    !> Number of spectra of the two bodies
    integer, intent(in) :: n_spectrum
    !> The window repeats
    logical, intent(in) :: periodic

    windowed_friction_memory = frictional_contact_memory(extent, threads, n_spectrum, periodic) &
                               + friction_step_memory(extent, n_contact, n_force, coupled)
  end function windowed_friction_memory

  !> Solve a load step on parts around the contact, or on the window.
  subroutine solve_step(self, start, reference, target, tolerance, max_sweeps, state, error)
    class(windowed_friction_t), intent(inout), target :: self
    type(contact_state_t), intent(in) :: start
    real(wp), intent(in), contiguous, target :: reference(:, :, :)
    type(load_target_t), intent(in) :: target
    real(wp), intent(in) :: tolerance
    integer, intent(in) :: max_sweeps
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error

    integer :: low(2), high(2), try, sweeps
    real(wp) :: work
    logical :: found, solved, to_part

    call self%problem%friction%begin_step(start%zone)
    work = 0.0_wp
    sweeps = 0
    to_part = self%problem%space%max(start%pressure) > 0.0_wp
    if (to_part) to_part = self%problem%is_pressed(target)
    if (to_part) then
      do try = 1, self%problem%options%multilevel%max_parts + 1
        if (try == 1) then
          call next_part(try, self%problem, start, low, high, found)
        else
          call next_part(try, self%problem, state, low, high, found)
        end if
        if (.not. found) exit
        call extract_part(self, low, high, error)
        if (allocated(error)) return
        call solve_part(self%frictional_contact_t, self%part, reshape([low, high], [2, 2]), start, &
                        load_step_t(target, reference, tolerance, max_sweeps), state, solved, error)
        if (allocated(error)) return
        work = work + state%operator_applications
        sweeps = sweeps + state%sweeps
        state%operator_applications = work
        state%sweeps = sweeps
        if (state%converged) return
        if (.not. solved) exit
      end do
    end if
    ! the contact has outgrown the part: its memory goes before the window takes more
    if (allocated(self%part)) deallocate (self%part)
    call self%frictional_contact_t%solve_step(start, reference, target, tolerance, max_sweeps, state, error)
    state%operator_applications = state%operator_applications + work
    state%sweeps = state%sweeps + sweeps
  end subroutine solve_step

  !> Set the gap before loading; the part of the window is set up again.
  subroutine set_gap(self, gap)
    class(windowed_friction_t), intent(inout) :: self
    real(wp), intent(in) :: gap(:, :)

    if (allocated(self%part)) deallocate (self%part)
    call self%frictional_contact_t%set_gap(gap)
  end subroutine set_gap

  !> Set up the solver on the part of the window between some columns and rows, unless it is set up already.
  subroutine extract_part(self, low, high, error)
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
    call self%problem%extract_part(low, high, problem)
    allocate (self%part)
    call new_frictional_contact(self%part, problem, error, self%threads, self%cache, self%problem%space%scratch, self%ranks)
    call self%ranks%agree(error)
    if (allocated(error)) deallocate (self%part)
  end subroutine extract_part

end module hc_subwindow_solver
