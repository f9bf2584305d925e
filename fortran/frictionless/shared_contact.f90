!> Frictionless contact that several ranks solve: the first one has the whole fields, each one its rows while they solve.
module hc_shared_contact
  use, intrinsic :: iso_c_binding, only: c_ptr, c_loc, c_null_ptr
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_communicator, only: communicator_t
  use hc_lattice, only: lattice_t
  use hc_elastic_medium, only: elastic_medium_t
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_contact_state, only: contact_state_t, load_target_t, check_problem
  use hc_contact_solver, only: contact_solver_t
  use hc_normal_law, only: normal_law_t
  use hc_normal_contact, only: normal_contact_t, new_normal_contact
  implicit none
  private

  public :: shared_contact_t, new_shared_contact

  !> A frictionless contact problem; every rank calls its procedures.
  type, extends(contact_solver_t) :: shared_contact_t
    private
    !> The problem on the rows of this rank
    type(normal_contact_t) :: part
    type(lattice_t) :: lattice
    !> All ranks, and those that share the window: one if each holds all of it
    type(communicator_t) :: ranks, sharing
  contains
    procedure :: solve_step
  end type shared_contact_t

contains

  !> Set up a problem whose fields are on the first rank.
  subroutine new_shared_contact(self, lattice, medium, initial_gap, candidate, error, n_threads, cache, law, ranks)
    !> Problem to be set up
    type(shared_contact_t), intent(out) :: self
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> On the first rank: initial gap (n_col, n_row) [m]
    real(wp), intent(in), contiguous, target :: initial_gap(:, :)
    !> On the first rank: nodes that may come into contact (n_col, n_row)
    logical, intent(in), contiguous, target :: candidate(:, :)
    !> Allocated on failure, on all ranks
    type(error_t), allocatable, intent(out) :: error
    !> Threads to use; 0: as many as OpenMP would take
    integer, intent(in) :: n_threads
    !> Cache of spectra; it has to outlive the problem
    type(kernel_cache_t), pointer, intent(in) :: cache
    !> Law of contact
    class(normal_law_t), intent(in) :: law
    !> The ranks
    type(communicator_t), intent(in) :: ranks
    real(wp), allocatable, target :: gap(:, :)
    logical, allocatable, target :: possible(:, :)
    type(c_ptr) :: all_gap, all_possible
    integer :: rows(2)

    self%lattice = lattice
    self%ranks = ranks
    self%sharing = ranks%over(lattice%extent)
    all_gap = c_null_ptr
    all_possible = c_null_ptr
    if (ranks%rank == 0) then
      call check_problem(lattice, medium, initial_gap, candidate, error)
      if (.not. allocated(error)) then
        all_gap = c_loc(initial_gap)
        all_possible = c_loc(candidate)
      end if
    end if
    call ranks%agree(error)
    if (allocated(error)) return
    rows = [self%sharing%first_row(lattice%extent(2)), self%sharing%last_row(lattice%extent(2))]
    allocate (gap(lattice%extent(1), rows(2) - rows(1) + 1), possible(lattice%extent(1), rows(2) - rows(1) + 1))
    call ranks%fetch(2*lattice%extent(1), lattice%extent(2), all_gap, rows, c_loc(gap), on_first=.true.)
    call ranks%fetch(lattice%extent(1), lattice%extent(2), all_possible, rows, c_loc(possible), on_first=.true.)
    call new_normal_contact(self%part, lattice, medium, gap, possible, error, n_threads, cache, law=law, ranks=ranks)
  end subroutine new_shared_contact

  !> Solve a load step; the fields of the state are on the first rank.
  subroutine solve_step(self, start, reference, target, tolerance, max_sweeps, state, error)
    class(shared_contact_t), intent(inout), target :: self
    type(contact_state_t), intent(in) :: start
    real(wp), intent(in), contiguous, target :: reference(:, :, :)
    type(load_target_t), intent(in) :: target
    real(wp), intent(in) :: tolerance
    integer, intent(in) :: max_sweeps
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error

    call self%part%solve_step(start, reference, target, tolerance, max_sweeps, state, error)
    if (allocated(error) .or. self%sharing%size == 1) return
    call gather_real(self, state%pressure)
    call gather_real(self, state%gap)
    call gather_zone(self, state%zone)
  end subroutine solve_step

  !> Take a field onto the first rank; others keep no value of it.
  subroutine gather_real(self, field)
    class(shared_contact_t), intent(in) :: self
    real(wp), allocatable, target, intent(inout) :: field(:, :)
    real(wp), allocatable, target :: whole(:, :)
    integer :: rows(2)

    rows = [1, merge(self%lattice%extent(2), 0, self%ranks%rank == 0)]
    allocate (whole(self%lattice%extent(1), max(rows(2), 1)), source=0.0_wp)
    call self%ranks%fetch(2*self%lattice%extent(1), self%lattice%extent(2), c_loc(field), rows, c_loc(whole))
    call move_alloc(whole, field)
  end subroutine gather_real

  !> Take zones onto the first rank.
  subroutine gather_zone(self, zone)
    class(shared_contact_t), intent(in) :: self
    integer, allocatable, target, intent(inout) :: zone(:, :)
    integer, allocatable, target :: whole(:, :)
    integer :: rows(2)

    rows = [1, merge(self%lattice%extent(2), 0, self%ranks%rank == 0)]
    allocate (whole(self%lattice%extent(1), max(rows(2), 1)), source=0)
    call self%ranks%fetch(self%lattice%extent(1), self%lattice%extent(2), c_loc(zone), rows, c_loc(whole))
    call move_alloc(whole, zone)
  end subroutine gather_zone

end module hc_shared_contact
