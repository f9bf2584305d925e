!> One load step with friction, on FFTs.
!>
!> Sweeps of a semismooth Newton method (see lattice_solver) lead from the last
!> state to the next, from a start by coarser lattices (see
!> fas_predictor). Without an earlier state the first guess comes from them, too. Where a guess is given it comes first.
!>
!> Theory: docs/theory/multilevel.md.
module hc_frictional_contact
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_communicator, only: communicator_t
  use hc_options, only: newton_options_t
  use hc_field_space, only: field_space_t, space_over
  use hc_scratch, only: scratch_t
  use hc_hierarchy, only: level_count
  use hc_flexibility, only: check_operator
  use hc_contact_state, only: contact_state_t, copy_tractions, load_target_t, load_step_t
  use hc_contact_problem, only: friction_problem_t
  use hc_contact_solver, only: friction_solver_t
  use hc_operator_set, only: operators_t, new_operators, operators_memory
  use hc_lattice_solver, only: solve_on_lattice
  use hc_fas_predictor, only: predict, find_first
  use hc_spectrum_cache, only: kernel_cache_t
  implicit none
  private

  public :: frictional_contact_t, new_frictional_contact, frictional_contact_memory, friction_step_memory

  !> A contact problem with friction on a hierarchy of lattices.
  type, extends(friction_solver_t) :: frictional_contact_t
    private
    !> The problem on the coarser lattices, from the second on
    type(friction_problem_t), allocatable :: coarse(:)
    !> Operators on all lattices, from the finest on
    type(operators_t), allocatable :: operators(:)
  contains
    procedure :: solve_step
    procedure :: displacements
    procedure :: set_gap
  end type frictional_contact_t

contains

  !> Set up the operators of a problem on all its lattices.
  subroutine new_frictional_contact(self, problem, error, n_threads, cache, shared, ranks)
    !> Solver to be set up
    type(frictional_contact_t), intent(out) :: self
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Threads to use; absent or 0: as many as OpenMP would take
    integer, intent(in), optional :: n_threads
    !> Cache of spectra
    type(kernel_cache_t), pointer, intent(in), optional :: cache
    !> Memory of the transforms of a solver that is never used at the same time, and freed later
    type(scratch_t), pointer, intent(in), optional :: shared
    !> Ranks that share the products of a problem of which each has all rows; absent: one
    type(communicator_t), intent(in), optional :: ranks
    type(scratch_t), pointer :: scratch
    integer :: l, n_level

    call check_operator(problem%lattice, problem%medium, error, n_threads)
    if (allocated(error)) return
    self%problem = problem
    n_level = level_count(problem%lattice, problem%options%multilevel%smallest_side)
    allocate (self%operators(n_level), self%coarse(2:n_level))
    if (n_level > 1) call self%problem%coarsen(self%coarse(2))
    do l = 3, n_level
      call self%coarse(l - 1)%coarsen(self%coarse(l))
    end do
    ! transforms of all lattices take turns
    scratch => null()
    if (present(shared)) scratch => shared
    if (.not. associated(scratch)) allocate (scratch)
    call prepare(self%problem, self%operators(1), rounded=.false.)
    do l = 2, n_level
      if (allocated(error)) return
      call prepare(self%coarse(l), self%operators(l), rounded=.true.)
    end do

  contains

    !> Set up threads and operators of one lattice, whose rows are shared as the problem says.
    subroutine prepare(level, operators, rounded)
      type(friction_problem_t), intent(inout) :: level
      type(operators_t), intent(out) :: operators
      !> Its solutions are only starts
      logical, intent(in) :: rounded
      type(field_space_t) :: space

      space = space_over(level%lattice%extent, n_threads)
      space%scratch => scratch
      space%ranks = level%space%ranks
      if (present(ranks) .and. space%ranks%size == 1) space%helpers = ranks%over(level%lattice%extent)
      level%space = space
      call new_operators(operators, level%lattice, level%medium, space, error, cache, level%options%preconditioner, rounded)
    end subroutine prepare

  end subroutine new_frictional_contact

  !> Set the gap before loading on all lattices.
  subroutine set_gap(self, gap)
    class(frictional_contact_t), intent(inout) :: self
    real(wp), intent(in) :: gap(:, :)
    integer :: l

    self%problem%initial_gap = gap
    if (size(self%coarse) > 0) call self%problem%coarsen_gap(self%coarse(2))
    do l = 3, ubound(self%coarse, 1)
      call self%coarse(l - 1)%coarsen_gap(self%coarse(l))
    end do
  end subroutine set_gap

  !> Count the bytes of a problem between its steps: operators and given fields, on all lattices.
  pure integer(selected_int_kind(18)) function frictional_contact_memory(extent, threads, n_spectrum, periodic)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Threads to use
    integer, intent(in) :: threads
    !> Number of spectra of the two bodies
    integer, intent(in) :: n_spectrum
    !> The window repeats
    logical, intent(in) :: periodic
    integer, parameter :: long = selected_int_kind(18)
    integer(long) :: given

    ! initial gap, candidates
    given = 9*int(extent(1), long)*extent(2)
    frictional_contact_memory = given + operators_memory(extent, threads, n_spectrum, .false., periodic) &
                                + (given + operators_memory(extent, threads, n_spectrum, .true., periodic))/3
  end function frictional_contact_memory

  !> Count the additional bytes while a step is solved; the coarse lattices have done by then, and its record takes less.
  pure integer(selected_int_kind(18)) function friction_step_memory(extent, n_contact, n_force, coupled)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Nodes in contact
    integer, intent(in) :: n_contact
    !> Loads that are prescribed, the normal one among them; the other motions are
    integer, intent(in) :: n_force
    !> Pressure and shear move each other
    logical, intent(in) :: coupled
    integer, parameter :: long = selected_int_kind(18)
    !> Bytes of a field of numbers, in single precision, and of marks
    integer, parameter :: field = 8, half = 4, mark = 1
    integer(long) :: n, everywhere, inside, last, n_shear, directions, products, stored
    type(newton_options_t) :: options

    n = int(extent(1), long)*extent(2)
    n_shear = max(n_force - 1, 1)
    ! all that GMRES may store but one, since mostly a few are enough
    directions = options%max_directions - 1
    products = min(directions, int(options%max_products, long))
    stored = 0
    ! iterate without shear traction
    everywhere = 4*field + mark
    ! packed: frames and their compliances; traction estimates
    inside = 3*field + (1 + 2*n_shear)*half
    if (coupled) then
      ! product of the unknowns; without pressure and displacements of the iterate
      everywhere = everywhere + (3 - 4)*field
      ! packed, where half of the nodes stick: slope; unknowns and a residual; estimates of the constraints
      inside = inside + field + 5*2*field/2 + n_shear*2*half + half
      ! two vectors of each direction there and the products off the contact of all but one, or without products
      stored = max(n*3*(products - 1)*half + n_contact*5*products*half/2, n_contact*5*directions*half)
      ! the last direction, or before it another residual and a vector of the preconditioner of the shear traction
      last = max(3*half*n + 5*half/2*n_contact, int(5*field/2 + field, long)*n_contact)
    else
      ! packed: shear traction, vectors of conjugate gradients, one of the preconditioner, whose fields are in the memory of the
      ! transforms, constraints with their estimates
      inside = inside + 2*(1 + 3)*field + field + 2*n_shear*(field + half)
      last = 0
    end if
    friction_step_memory = n*everywhere + n_contact*inside + stored + last
  end function friction_step_memory

  !> Compute the displacements of given tractions by the operator of the finest lattice.
  subroutine displacements(self, pressure, traction, displacement, error)
    class(frictional_contact_t), intent(inout) :: self
    real(wp), intent(in) :: pressure(:, :), traction(:, :, :)
    real(wp), intent(out), contiguous :: displacement(:, :, :)
    type(error_t), allocatable, intent(out) :: error

    call self%problem%displacements(self%operators(1)%flexibility, pressure, traction, displacement, error)
  end subroutine displacements

  !> Solve a load step: predict on coarser lattices, iterate on the finest.
  subroutine solve_step(self, start, reference, target, tolerance, max_sweeps, state, error)
    class(frictional_contact_t), intent(inout), target :: self
    type(contact_state_t), intent(in) :: start
    real(wp), intent(in), contiguous, target :: reference(:, :, :)
    type(load_target_t), intent(in) :: target
    real(wp), intent(in) :: tolerance
    integer, intent(in) :: max_sweeps
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error

    type(contact_state_t) :: guess
    type(load_step_t) :: step
    real(wp), allocatable :: estimate(:, :, :)
    real(wp) :: work
    integer :: sweeps
    logical :: guessed, touching

    call self%problem%friction%begin_step(start%zone)
    if (.not. self%problem%is_pressed(target)) then
      call self%problem%separate(start, reference, target, tolerance, state)
      return
    end if
    step = load_step_t(target, reference, tolerance, max_sweeps)
    work = 0.0_wp
    sweeps = 0
    touching = self%problem%space%max(start%pressure) > 0.0_wp
    if (allocated(self%guess)) then
      call copy_tractions(self%guess, guess, self%problem%space)
      call attempt(guess)
      if (allocated(error)) return
      state%sweeps = sweeps
      state%operator_applications = work
      if (state%converged) return
    end if
    call copy_tractions(start, guess, self%problem%space)
    guessed = .false.
    if (size(self%operators) > 1) then
      if (touching .and. target%rolling%steady) then
        ! the change of a coarser lattice is no start: slip is that over a spacing
      else if (touching) then
        call predict(self%problem, self%coarse, self%operators(2:), start, step, guess, error, estimate)
        guessed = guess%converged
      else
        call find_first(self%problem, self%coarse, self%operators(2:), step, guess, error, estimate)
        guessed = .not. allocated(error)
        if (guessed) guessed = self%problem%space%max(guess%pressure) > 0.0_wp
      end if
      if (allocated(error)) return
      work = work + guess%operator_applications
    end if
    call attempt(guess)
    if (allocated(error)) return
    ! the start by coarse lattices may not converge where the old state does
    if (guessed .and. .not. (state%converged .or. state%sliding)) then
      call copy_tractions(start, guess, self%problem%space)
      call attempt(guess)
      if (allocated(error)) return
    end if
    ! a first step has no state to fall back on: it goes on from where it stands
    if (.not. (state%converged .or. state%sliding .or. touching)) then
      call copy_tractions(state, guess, self%problem%space)
      call attempt(guess)
      if (allocated(error)) return
    end if
    state%sweeps = sweeps
    state%operator_applications = work

  contains

    !> Solve on the finest lattice, and count the work.
    subroutine attempt(from)
      !> State to start from, whose tractions are freed
      type(contact_state_t), intent(inout) :: from

      call solve_on_lattice(self%problem, self%operators(1), from, step, state, error, estimate)
      sweeps = sweeps + state%sweeps
      work = work + state%operator_applications
    end subroutine attempt

  end subroutine solve_step

end module hc_frictional_contact
