!> Contact with friction that several ranks solve: the first one has the state and the history, and leads the others.
!>
!> Paths of loads, wear and growing windows call the procedures of the solver on the first rank alone. Each call wakes the other
!> ranks, which take part in it by `follow`.
module hc_shared_friction
  use, intrinsic :: iso_c_binding, only: c_ptr, c_loc
  use, intrinsic :: iso_fortran_env, only: int32
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_communicator, only: communicator_t
  use hc_field_space, only: space_over
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_contact_state, only: contact_state_t, load_target_t, n_motion, add_fields
  use hc_contact_problem, only: friction_problem_t
  use hc_contact_solver, only: friction_solver_t
  use hc_subwindow_solver, only: windowed_friction_t, new_windowed_friction
  implicit none
  private

  public :: shared_friction_t, new_shared_friction

  !> What the first rank asks the others to take part in.
  integer, parameter :: to_solve = 1, to_displace = 2, to_set_gap = 3

  !> Numbers of a call of the first rank.
  type :: call_t
    integer :: what = 0
    type(load_target_t) :: target
    real(wp) :: tolerance = 0.0_wp
    integer :: max_sweeps = 0
    !> Motions and loads of the state to start from; there is a guess, and its motions
    real(wp) :: motion(n_motion) = 0.0_wp, load(n_motion) = 0.0_wp, guess_motion(n_motion) = 0.0_wp
    logical :: guessed = .false.
  end type call_t

  !> A contact problem with friction.
  type, extends(friction_solver_t) :: shared_friction_t
    private
    !> The problem as this rank solves it
    type(windowed_friction_t) :: part
    type(communicator_t) :: ranks
    !> On the first rank: words that let the others call `follow`
    integer(int32), allocatable :: wake(:)
  contains
    procedure :: solve_step
    procedure :: displacements
    procedure :: set_gap
    !> Take part in a call of the first rank
    procedure :: follow
  end type shared_friction_t

contains

  !> Set up a problem whose gap and candidates are those of the first rank.
  subroutine new_shared_friction(self, problem, error, n_threads, cache, ranks, wake)
    !> Problem to be set up
    type(shared_friction_t), intent(out) :: self
    !> The problem; on ranks but the first one of gap and candidates without meaning
    type(friction_problem_t), intent(in) :: problem
    !> Allocated on failure, on all ranks
    type(error_t), allocatable, intent(out) :: error
    !> Threads to use; 0: as many as OpenMP would take
    integer, intent(in) :: n_threads
    !> Cache of spectra; it has to outlive the problem
    type(kernel_cache_t), pointer, intent(in) :: cache
    !> The ranks
    type(communicator_t), intent(in) :: ranks
    !> On the first rank: words that let the others call `follow`
    integer(int32), intent(in) :: wake(:)

    self%problem = problem
    self%ranks = ranks
    self%wake = wake
    call spread_real(ranks, self%problem%initial_gap)
    call spread_mask(ranks, self%problem%candidate)
    call new_windowed_friction(self%part, self%problem, error, n_threads, cache, ranks)
    call ranks%agree(error)
    ! what a path computes by itself, it computes on the first rank alone
    self%problem%space = space_over(self%problem%lattice%extent, n_threads)
  end subroutine new_shared_friction

  !> Copy a field of the first rank to the other ranks.
  subroutine spread_real(ranks, field)
    type(communicator_t), intent(in) :: ranks
    !> Field (n_col, n_row), of one shape on all ranks
    real(wp), intent(in), contiguous, target :: field(:, :)

    call spread(ranks, [2*size(field, 1), size(field, 2)], c_loc(field))
  end subroutine spread_real

  !> Copy a mask of the first rank to the other ranks.
  subroutine spread_mask(ranks, field)
    type(communicator_t), intent(in) :: ranks
    !> Mask (n_col, n_row), of one shape on all ranks
    logical, intent(in), contiguous, target :: field(:, :)

    call spread(ranks, shape(field), c_loc(field))
  end subroutine spread_mask

  !> Copy zones of the first rank to the other ranks.
  subroutine spread_zone(ranks, field)
    type(communicator_t), intent(in) :: ranks
    !> Zones (n_col, n_row), of one shape on all ranks
    integer, intent(in), contiguous, target :: field(:, :)

    call spread(ranks, shape(field), c_loc(field))
  end subroutine spread_zone

  !> Copy rows of the first rank to the other ranks.
  subroutine spread(ranks, extent, field)
    type(communicator_t), intent(in) :: ranks
    !> Words in a row, and number of rows
    integer, intent(in) :: extent(2)
    !> The rows
    type(c_ptr), intent(in) :: field
    integer, target :: none(1)

    if (ranks%rank == 0) then
      call ranks%fetch(extent(1), extent(2), field, [1, 0], c_loc(none), on_first=.true.)
    else
      call ranks%fetch(extent(1), extent(2), c_loc(none), [1, extent(2)], field, on_first=.true.)
    end if
  end subroutine spread

  !> Let the other ranks take part in a call.
  subroutine announce(self, order)
    class(shared_friction_t), intent(in) :: self
    type(call_t), intent(in) :: order
    integer(int32) :: words(size(transfer(order, [0_int32])))

    call self%ranks%tell(self%wake)
    words = transfer(order, words)
    call self%ranks%tell(words)
  end subroutine announce

  !> Solve a load step; called on the first rank alone.
  subroutine solve_step(self, start, reference, target, tolerance, max_sweeps, state, error)
    class(shared_friction_t), intent(inout), target :: self
    type(contact_state_t), intent(in) :: start
    real(wp), intent(in), contiguous, target :: reference(:, :, :)
    type(load_target_t), intent(in) :: target
    real(wp), intent(in) :: tolerance
    integer, intent(in) :: max_sweeps
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error
    type(call_t) :: order

    call self%problem%friction%begin_step(start%zone)
    order = call_t(to_solve, target, tolerance, max_sweeps, start%motion, start%load)
    order%guessed = allocated(self%guess)
    if (order%guessed) order%guess_motion = self%guess%motion
    call announce(self, order)
    if (order%guessed) self%part%guess = self%guess
    call solve_together(self, order, start, reference, state, error)
  end subroutine solve_step

  !> Solve a load step on all ranks.
  subroutine solve_together(self, order, start, reference, state, error)
    class(shared_friction_t), intent(inout) :: self
    type(call_t), intent(in) :: order
    !> State to start from, and displacement that slip counts from; on ranks but the first one fields without meaning
    type(contact_state_t), intent(in) :: start
    real(wp), intent(in), contiguous, target :: reference(:, :, :)
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error
    integer :: m

    call spread_real(self%ranks, start%pressure)
    call spread_real(self%ranks, start%gap)
    call spread_zone(self%ranks, start%zone)
    do m = 1, 2
      call spread_real(self%ranks, start%traction(:, :, m))
      call spread_real(self%ranks, start%relative_displacement(:, :, m))
      call spread_real(self%ranks, reference(:, :, m))
    end do
    if (order%guessed) then
      call spread_real(self%ranks, self%part%guess%pressure)
      do m = 1, 2
        call spread_real(self%ranks, self%part%guess%traction(:, :, m))
      end do
      self%part%guess%motion = order%guess_motion
    end if
    call self%part%solve_step(start, reference, order%target, order%tolerance, order%max_sweeps, state, error)
    if (allocated(self%part%guess)) deallocate (self%part%guess)
    call self%ranks%agree(error)
  end subroutine solve_together

  !> Compute the displacements of given tractions; called on the first rank alone.
  subroutine displacements(self, pressure, traction, displacement, error)
    class(shared_friction_t), intent(inout) :: self
    real(wp), intent(in) :: pressure(:, :), traction(:, :, :)
    real(wp), intent(out), contiguous :: displacement(:, :, :)
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: tractions(:, :, :)

    allocate (tractions(size(pressure, 1), size(pressure, 2), 3))
    tractions(:, :, 1) = pressure
    tractions(:, :, 2:) = traction
    call announce(self, call_t(to_displace))
    call displace_together(self, tractions, displacement, error)
  end subroutine displacements

  !> Compute displacements on all ranks.
  subroutine displace_together(self, tractions, displacement, error)
    class(shared_friction_t), intent(inout) :: self
    !> Pressure and shear traction; set on the first rank
    real(wp), intent(in), contiguous, target :: tractions(:, :, :)
    real(wp), intent(out), contiguous :: displacement(:, :, :)
    type(error_t), allocatable, intent(out) :: error
    integer :: m

    do m = 1, 3
      call spread_real(self%ranks, tractions(:, :, m))
    end do
    call self%part%displacements(tractions(:, :, 1), tractions(:, :, 2:), displacement, error)
    call self%ranks%agree(error)
  end subroutine displace_together

  !> Set the gap before loading; called on the first rank alone.
  subroutine set_gap(self, gap)
    class(shared_friction_t), intent(inout) :: self
    real(wp), intent(in) :: gap(:, :)

    self%problem%initial_gap = gap
    call announce(self, call_t(to_set_gap))
    call spread_real(self%ranks, self%problem%initial_gap)
    call self%part%set_gap(self%problem%initial_gap)
  end subroutine set_gap

  !> Take part in a call of the first rank.
  subroutine follow(self, error)
    class(shared_friction_t), intent(inout) :: self
    !> Allocated on failure of any rank
    type(error_t), allocatable, intent(out) :: error
    type(call_t) :: order
    type(contact_state_t) :: start, state
    real(wp), allocatable :: fields(:, :, :), displacement(:, :, :)
    integer(int32), allocatable :: words(:)
    integer :: n

    call self%ranks%wait_for_words(n)
    allocate (words(n))
    call self%ranks%hear(words)
    order = transfer(words, order)
    associate (lattice => self%problem%lattice)
      select case (order%what)
      case (to_solve)
        call add_fields(start, lattice, self%problem%space)
        start%motion = order%motion
        start%load = order%load
        allocate (fields(lattice%extent(1), lattice%extent(2), 2))
        if (order%guessed) then
          allocate (self%part%guess)
          self%part%guess%pressure = start%pressure
          self%part%guess%traction = start%traction
        end if
        call solve_together(self, order, start, fields, state, error)
      case (to_displace)
        allocate (fields(lattice%extent(1), lattice%extent(2), 3), displacement(lattice%extent(1), lattice%extent(2), 3))
        call displace_together(self, fields, displacement, error)
      case (to_set_gap)
        call spread_real(self%ranks, self%problem%initial_gap)
        call self%part%set_gap(self%problem%initial_gap)
      end select
    end associate
  end subroutine follow

end module hc_shared_friction
