!> Contact with friction that several ranks solve: the first one has the state and the history, and leads the others.
!>
!> Paths of loads, wear and growing windows call the procedures of the solver on the first rank alone. Each call wakes the other
!> ranks, which take part in it by `follow`.
!>
!> Each rank solves on its rows of the window, which the first one deals out and gathers. In steady rolling from row to row each has
!> all rows; then they share the transforms.
module hc_shared_friction
  use, intrinsic :: iso_c_binding, only: c_ptr, c_loc
  use, intrinsic :: iso_fortran_env, only: int32
  use hc_precision, only: wp, lk
  use hc_error, only: error_t, raise, status
  use hc_memory, only: require_memory
  use hc_communicator, only: communicator_t
  use hc_field_space, only: space_over
  use hc_flexibility_fft, only: spectra_of
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_contact_state, only: contact_state_t, load_target_t, n_load, n_motion, add_history
  use hc_coulomb, only: coulomb_t
  use hc_nodal_coulomb, only: nodal_coulomb_t
  use hc_contact_problem, only: friction_problem_t
  use hc_contact_solver, only: friction_solver_t
  use hc_subwindow_solver, only: windowed_friction_t, new_windowed_friction, windowed_friction_memory
  implicit none
  private

  public :: shared_friction_t, new_shared_friction

  !> Calls of the first rank that the others take part in.
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
    !> Each rank solves on its rows; else on all of them
    logical :: by_rows = .false.
    !> Threads to use, and cache of spectra
    integer :: n_threads = 0
    type(kernel_cache_t), pointer :: cache => null()
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
    self%n_threads = n_threads
    self%cache => cache
    if (ranks%rank > 0) deallocate (self%problem%initial_gap, self%problem%candidate)
    call prepare(self, can_be_shared(self), error)
    ! the computations of a path run on the first rank alone
    self%problem%space = space_over(self%problem%lattice%extent, n_threads)
  end subroutine new_shared_friction

  !> Return whether ranks can solve the problem by rows: if friction does not depend on the zones of all nodes.
  logical function can_be_shared(self)
    type(shared_friction_t), intent(in) :: self
    type(communicator_t) :: sharing

    sharing = self%ranks%over(self%problem%lattice%extent)
    can_be_shared = .false.
    select type (law => self%problem%friction)
    type is (coulomb_t)
      can_be_shared = sharing%size > 1
    class is (nodal_coulomb_t)
      can_be_shared = sharing%size > 1
    end select
  end function can_be_shared

  !> Set up the problem as each rank solves it.
  subroutine prepare(self, by_rows, error)
    class(shared_friction_t), intent(inout) :: self
    !> Each on its rows; else on all of them
    logical, intent(in) :: by_rows
    !> Allocated on failure, on all ranks
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: own

    self%by_rows = by_rows
    own%lattice = self%problem%lattice
    if (by_rows) own%space%ranks = self%ranks%over(own%lattice%extent)
    call own%inherit(self%problem)
    associate (n => own%own_extent())
      allocate (own%initial_gap(n(1), n(2)), own%candidate(n(1), n(2)))
    end associate
    call deal_real(self, self%problem%initial_gap, own%initial_gap)
    call deal_mask(self, self%problem%candidate, own%candidate)
    call new_windowed_friction(self%part, own, error, self%n_threads, self%cache, self%ranks)
    call self%ranks%agree(error)
  end subroutine prepare

  !> Deal a field of the first rank out: to each rank its rows, or all of them.
  subroutine deal_real(self, field, own)
    class(shared_friction_t), intent(in) :: self
    !> Field (n_col, n_row); on ranks but the first one absent
    real(wp), intent(in), contiguous, optional, target :: field(:, :)
    !> Rows of this rank (n_col, rows)
    real(wp), intent(out), contiguous, target :: own(:, :)
    integer, target :: none(1)

    if (present(field)) then
      call deal(self, 2*size(own, 1), c_loc(field), c_loc(own))
    else
      call deal(self, 2*size(own, 1), c_loc(none), c_loc(own))
    end if
  end subroutine deal_real

  !> Deal the components of a field of the first rank out.
  subroutine deal_vector(self, field, own)
    class(shared_friction_t), intent(in) :: self
    !> Field (n_col, n_row, components); on ranks but the first one absent
    real(wp), intent(in), contiguous, optional :: field(:, :, :)
    !> Rows of this rank (n_col, rows, components)
    real(wp), intent(out), contiguous :: own(:, :, :)
    integer :: m

    do m = 1, size(own, 3)
      if (present(field)) then
        call deal_real(self, field(:, :, m), own(:, :, m))
      else
        call deal_real(self, own=own(:, :, m))
      end if
    end do
  end subroutine deal_vector

  !> Deal a mask of the first rank out.
  subroutine deal_mask(self, field, own)
    class(shared_friction_t), intent(in) :: self
    !> Mask (n_col, n_row); on ranks but the first one absent
    logical(lk), intent(in), optional :: field(:, :)
    !> Rows of this rank (n_col, rows)
    logical(lk), intent(out) :: own(:, :)
    real(wp), allocatable :: rows(:, :)

    ! a row of bytes is no number of words, which ranks exchange
    allocate (rows(size(own, 1), size(own, 2)))
    if (present(field)) then
      call deal_real(self, merge(1.0_wp, 0.0_wp, field), rows)
    else
      call deal_real(self, own=rows)
    end if
    own = rows > 0.5_wp
  end subroutine deal_mask

  !> Deal zones of the first rank out.
  subroutine deal_zone(self, field, own)
    class(shared_friction_t), intent(in) :: self
    !> Zones (n_col, n_row); on ranks but the first one absent
    integer, intent(in), contiguous, optional, target :: field(:, :)
    !> Rows of this rank (n_col, rows)
    integer, intent(out), contiguous, target :: own(:, :)
    integer, target :: none(1)

    if (present(field)) then
      call deal(self, size(own, 1), c_loc(field), c_loc(own))
    else
      call deal(self, size(own, 1), c_loc(none), c_loc(own))
    end if
  end subroutine deal_zone

  !> Deal rows of the first rank out.
  subroutine deal(self, words, field, own)
    class(shared_friction_t), intent(in) :: self
    !> Words in a row
    integer, intent(in) :: words
    !> All rows, on the first rank; rows of this rank
    type(c_ptr), intent(in) :: field, own
    integer :: rows(2)

    associate (n_row => self%problem%lattice%extent(2))
      rows = [1, n_row]
      if (self%by_rows) rows = [self%ranks%first_row(n_row), self%ranks%last_row(n_row)]
      call self%ranks%fetch(words, n_row, field, rows, own, on_first=.true.)
    end associate
  end subroutine deal

  !> Gather the rows of a field on the first rank; the others free them.
  subroutine gather_real(self, field)
    class(shared_friction_t), intent(in) :: self
    !> Rows of this rank, then all of them (n_col, rows)
    real(wp), allocatable, intent(inout), target :: field(:, :)
    real(wp), allocatable, target :: all(:, :)

    if (self%by_rows) then
      allocate (all(size(field, 1), merge(self%problem%lattice%extent(2), 1, self%ranks%rank == 0)))
      call gather(self, 2*size(field, 1), c_loc(field), c_loc(all))
      deallocate (field)
      call move_alloc(all, field)
    end if
    if (self%ranks%rank > 0) deallocate (field)
  end subroutine gather_real

  !> Gather the rows of zones on the first rank; the others free them.
  subroutine gather_zone(self, field)
    class(shared_friction_t), intent(in) :: self
    !> Rows of this rank, then all of them (n_col, rows)
    integer, allocatable, intent(inout), target :: field(:, :)
    integer, allocatable, target :: all(:, :)

    if (self%by_rows) then
      allocate (all(size(field, 1), merge(self%problem%lattice%extent(2), 1, self%ranks%rank == 0)))
      call gather(self, size(field, 1), c_loc(field), c_loc(all))
      deallocate (field)
      call move_alloc(all, field)
    end if
    if (self%ranks%rank > 0) deallocate (field)
  end subroutine gather_zone

  !> Gather the rows of all components of a field on the first rank; the others free them.
  subroutine gather_vector(self, field)
    class(shared_friction_t), intent(in) :: self
    !> Rows of this rank, then all of them (n_col, rows, components)
    real(wp), allocatable, intent(inout), target :: field(:, :, :)
    real(wp), allocatable, target :: all(:, :, :)
    integer :: m

    if (self%by_rows) then
      allocate (all(size(field, 1), merge(self%problem%lattice%extent(2), 1, self%ranks%rank == 0), size(field, 3)))
      do m = 1, size(field, 3)
        call gather(self, 2*size(field, 1), c_loc(field(:, :, m)), c_loc(all(:, :, m)))
      end do
      deallocate (field)
      call move_alloc(all, field)
    end if
    if (self%ranks%rank > 0) deallocate (field)
  end subroutine gather_vector

  !> Gather rows on the first rank.
  subroutine gather(self, words, own, all)
    class(shared_friction_t), intent(in) :: self
    !> Words in a row
    integer, intent(in) :: words
    !> Rows of this rank; all rows, on the first rank
    type(c_ptr), intent(in) :: own, all

    associate (n_row => self%problem%lattice%extent(2))
      call self%ranks%fetch(words, n_row, own, [1, merge(n_row, 0, self%ranks%rank == 0)], all)
    end associate
  end subroutine gather

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
    call solve_together(self, order, state, error, start, reference)
  end subroutine solve_step

  !> Solve a load step on all ranks.
  subroutine solve_together(self, order, state, error, start, reference)
    class(shared_friction_t), intent(inout) :: self
    type(call_t), intent(in) :: order
    !> State at the end of the step; its fields are on the first rank
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error
    !> State to start from, with its fields on the first rank, and there the displacement that slip counts from
    type(contact_state_t), intent(in) :: start
    real(wp), intent(in), contiguous, optional :: reference(:, :, :)
    type(contact_state_t) :: own
    real(wp), allocatable, target :: origin(:, :, :)

    if (self%by_rows .and. order%target%rolling%steady .and. order%target%rolling%ahead(2) /= 0) then
      ! a node feels all nodes ahead of it, in rows of other ranks
      associate (p => self%problem)
        call require_memory(self%ranks%on_node*windowed_friction_memory(p%lattice%extent, p%lattice%size(), n_load, &
                                                                        .not. p%goodman, p%space%threads, &
                                                                        spectra_of(p%medium), p%lattice%is_periodic()), error)
      end associate
      call self%ranks%agree(error)
      if (.not. allocated(error)) call prepare(self, .false., error)
      if (allocated(error)) return
    end if
    call deal_state(self, order, own, start)
    allocate (origin, mold=own%traction)
    call deal_vector(self, reference, origin)
    if (order%guessed) then
      allocate (self%part%guess)
      allocate (self%part%guess%pressure, mold=own%pressure)
      allocate (self%part%guess%traction, mold=own%traction)
      if (.not. allocated(self%guess)) allocate (self%guess)
      call deal_real(self, self%guess%pressure, self%part%guess%pressure)
      call deal_vector(self, self%guess%traction, self%part%guess%traction)
      self%part%guess%motion = order%guess_motion
    end if
    call self%part%solve_step(own, origin, order%target, order%tolerance, order%max_sweeps, state, error)
    if (allocated(self%part%guess)) deallocate (self%part%guess)
    call self%ranks%agree(error)
    if (allocated(error)) return
    deallocate (origin)
    own = contact_state_t()
    deallocate (state%accumulated_slip, state%dissipation_density)
    call gather_real(self, state%pressure)
    call gather_real(self, state%gap)
    call gather_zone(self, state%zone)
    call gather_vector(self, state%traction)
    call gather_vector(self, state%relative_displacement)
    call gather_vector(self, state%slip_increment)
    if (self%ranks%rank == 0) call add_history(state)
  end subroutine solve_together

  !> Deal a state of the first rank out.
  subroutine deal_state(self, order, own, state)
    class(shared_friction_t), intent(in) :: self
    type(call_t), intent(in) :: order
    !> Rows of this rank
    type(contact_state_t), intent(out) :: own
    !> All rows, on the first rank; on others without fields, which are absent then
    type(contact_state_t), intent(in) :: state

    own%motion = order%motion
    own%load = order%load
    associate (n => self%part%problem%own_extent())
      allocate (own%pressure(n(1), n(2)), own%gap(n(1), n(2)), own%zone(n(1), n(2)), own%traction(n(1), n(2), 2), &
                own%relative_displacement(n(1), n(2), 2))
    end associate
    call deal_real(self, state%pressure, own%pressure)
    call deal_real(self, state%gap, own%gap)
    call deal_zone(self, state%zone, own%zone)
    call deal_vector(self, state%traction, own%traction)
    call deal_vector(self, state%relative_displacement, own%relative_displacement)
  end subroutine deal_state

  !> Compute the displacements of given tractions; called on the first rank alone.
  subroutine displacements(self, pressure, traction, displacement, error)
    class(shared_friction_t), intent(inout) :: self
    real(wp), intent(in) :: pressure(:, :), traction(:, :, :)
    real(wp), intent(out), contiguous :: displacement(:, :, :)
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: tractions(:, :, :), found(:, :, :)
    type(call_t) :: order

    allocate (tractions(size(pressure, 1), size(pressure, 2), 3))
    tractions(:, :, 1) = pressure
    tractions(:, :, 2:) = traction
    order%what = to_displace
    call announce(self, order)
    call displace_together(self, found, error, tractions)
    if (.not. allocated(error)) displacement = found
  end subroutine displacements

  !> Compute displacements on all ranks.
  subroutine displace_together(self, displacement, error, tractions)
    class(shared_friction_t), intent(inout) :: self
    !> w, u_x, u_y; on the first rank
    real(wp), allocatable, intent(out) :: displacement(:, :, :)
    type(error_t), allocatable, intent(out) :: error
    !> Pressure and shear traction, on the first rank; freed
    real(wp), allocatable, intent(inout), optional :: tractions(:, :, :)
    real(wp), allocatable :: own(:, :, :)

    associate (n => self%part%problem%own_extent())
      allocate (own(n(1), n(2), 3), displacement(n(1), n(2), 3))
    end associate
    call deal_vector(self, tractions, own)
    if (present(tractions)) deallocate (tractions)
    call self%part%displacements(own(:, :, 1), own(:, :, 2:), displacement, error)
    call self%ranks%agree(error)
    if (allocated(error)) return
    deallocate (own)
    call gather_vector(self, displacement)
  end subroutine displace_together

  !> Set the gap before loading; called on the first rank alone.
  subroutine set_gap(self, gap)
    class(shared_friction_t), intent(inout) :: self
    real(wp), intent(in) :: gap(:, :)
    type(call_t) :: order

    self%problem%initial_gap = gap
    order%what = to_set_gap
    call announce(self, order)
    call set_gap_together(self)
  end subroutine set_gap

  !> Set the gap of the first rank on all ranks.
  subroutine set_gap_together(self)
    class(shared_friction_t), intent(inout) :: self
    real(wp), allocatable :: own(:, :)

    allocate (own, mold=self%part%problem%initial_gap)
    call deal_real(self, self%problem%initial_gap, own)
    call self%part%set_gap(own)
  end subroutine set_gap_together

  !> Take part in a call of the first rank.
  subroutine follow(self, error)
    class(shared_friction_t), intent(inout) :: self
    !> Allocated on failure of any rank
    type(error_t), allocatable, intent(out) :: error
    type(call_t) :: order
    type(contact_state_t) :: state, nothing
    real(wp), allocatable :: displacement(:, :, :)
    integer(int32), allocatable :: words(:)
    integer :: n

    call self%ranks%wait_for_words(n)
    allocate (words(n))
    call self%ranks%hear(words)
    order = transfer(words, order)
    select case (order%what)
    case (to_solve)
      call solve_together(self, order, state, error, nothing)
    case (to_displace)
      call displace_together(self, displacement, error)
    case (to_set_gap)
      call set_gap_together(self)
    case default
      call raise(error, status%invalid_input, 'expected a call that the ranks know')
    end select
  end subroutine follow

end module hc_shared_friction
