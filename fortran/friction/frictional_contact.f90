!> One load step with Coulomb friction, on FFTs.
!>
!> Sweeps of a semismooth Newton method (see lattice_solver) lead from the last
!> state to the next, after coarser lattices have told what will change (see
!> friction_predictor). Without an earlier state the first guess comes from them, too.
!>
!> Theory: docs/theory/multilevel.md.
module hc_frictional_contact
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_lattice, only: lattice_t
  use hc_field_space, only: space_over
  use hc_flexibility, only: check_operator
  use hc_contact_state, only: contact_state_t, new_friction_state, take_tractions, load_target_t
  use hc_contact_problem, only: friction_problem_t
  use hc_contact_solver, only: friction_solver_t
  use hc_elastic_operators, only: operators_t, new_operators, operators_memory
  use hc_lattice_solver, only: solve_on_lattice
  use hc_fas_predictor, only: predict
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_transfer, only: prolong_edge, prolong_shear, restrict_vector, level_count
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
  end type frictional_contact_t

contains

  !> Operators of a problem on all its lattices.
  subroutine new_frictional_contact(self, problem, error, n_threads, cache)
    !> Solver to be set up
    type(frictional_contact_t), intent(out) :: self
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Threads to use; absent or 0: as many as OpenMP would take
    integer, intent(in), optional :: n_threads
    !> Spectra that are kept
    type(kernel_cache_t), pointer, intent(in), optional :: cache
    integer :: l, n_level

    call check_operator(problem%lattice, problem%pair, error, n_threads)
    if (allocated(error)) return
    self%problem = problem
    n_level = level_count(problem%lattice%extent, problem%options%multilevel%smallest_side)
    allocate (self%operators(n_level), self%coarse(2:n_level))
    do l = 1, n_level
      if (l == 2) then
        call problem%coarsen(self%coarse(l))
      else if (l > 2) then
        call self%coarse(l - 1)%coarsen(self%coarse(l))
      end if
      if (l == 1) then
        self%problem%space = space_over(problem%lattice%extent, n_threads)
        call new_operators(self%operators(l), problem%lattice, problem%pair, self%problem%space, error, cache)
      else
        self%coarse(l)%space = space_over(self%coarse(l)%lattice%extent, n_threads)
        call new_operators(self%operators(l), self%coarse(l)%lattice, problem%pair, self%coarse(l)%space, error, cache)
      end if
      if (allocated(error)) return
    end do
  end subroutine new_frictional_contact

  !> Bytes that a problem takes between its steps: operators and what is given, on all lattices.
  pure integer(selected_int_kind(18)) function frictional_contact_memory(extent, threads)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Threads to use
    integer, intent(in) :: threads
    integer, parameter :: long = selected_int_kind(18)
    integer(long) :: finest

    ! initial gap, coordinates, candidates
    finest = operators_memory(extent, threads) + 28*int(extent(1), long)*extent(2)
    frictional_contact_memory = finest + finest/3
  end function frictional_contact_memory

  !> Bytes that are needed besides while a step is solved; the coarse lattices have done by then.
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
    !> Bytes of a field of numbers, and of logical values or in single precision
    integer, parameter :: field = 8, half = 4
    !> Directions of GMRES: so many are enough as a rule
    integer, parameter :: n_direction = 4
    integer(long) :: n, everywhere, inside

    n = int(extent(1), long)*extent(2)
    ! states before and after, tractions to start from, displacements
    everywhere = 2*(9*field + half + 2*half) + 3*field + 3*field
    ! iterate; shear system: directions, compliance, weights, vectors in both precisions
    everywhere = everywhere + 9*field + 4*half + 9*field + 5*half
    ! zones, gap, edge of the contact, values of expressions; constraints of the loads and what they drag along
    everywhere = everywhere + 2*field + 2*half + 4*field + (2 + 2*2*max(n_force - 1, 1))*field
    if (coupled) then
      ! active nodes, unknowns, product, right-hand side, weights, shear in the plane, slope; constraints thrice
      everywhere = everywhere + 3*half + (4*3 + 2 + 1 + 3*3*n_force)*field
      ! the product; GMRES: vector and image, the products of all directions
      everywhere = everywhere + (2 + 3 + 3 + 3*(2 + n_direction))*field
      ! packed: both of all directions, residuals, weights, constraints thrice
      inside = 3*(2*n_direction + 4 + 3*n_force)*field
    else
      ! unknowns, product, right-hand side, shear; conjugate gradients: vector and image; preconditioned constraints
      everywhere = everywhere + (4*2 + 2*2 + 5)*field
      inside = 2*(7 + 2*max(n_force - 1, 1))*field
    end if
    friction_step_memory = n*everywhere + n_contact*inside
  end function friction_step_memory

  subroutine displacements(self, pressure, traction, displacement, error)
    class(frictional_contact_t), intent(inout) :: self
    real(wp), intent(in) :: pressure(:, :), traction(:, :, :)
    real(wp), intent(out), contiguous :: displacement(:, :, :)
    type(error_t), allocatable, intent(out) :: error

    call self%problem%displacements(self%operators(1)%flexibility, pressure, traction, displacement, error)
  end subroutine displacements

  subroutine solve_step(self, start, reference, target, tolerance, max_sweeps, state, error)
    class(frictional_contact_t), intent(inout), target :: self
    type(contact_state_t), intent(in) :: start
    real(wp), intent(in) :: reference(:, :, :)
    type(load_target_t), intent(in) :: target
    real(wp), intent(in) :: tolerance
    integer, intent(in) :: max_sweeps
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error

    type(contact_state_t) :: guess
    real(wp) :: work
    integer :: sweeps
    logical :: guessed

    if (.not. self%problem%is_pressed(target)) then
      call self%problem%separate(start, reference, target, tolerance, state)
      return
    end if
    work = 0.0_wp
    call take_tractions(start, guess, self%problem%space)
    guessed = .false.
    if (size(self%operators) > 1) then
      if (any(start%pressure > 0.0_wp)) then
        call predict(self%problem, self%coarse, self%operators(2:), start, reference, target, guess, guessed, work, error)
      else
        call coarse_guess(self, reference, target, max_sweeps, guess, work, error)
        guessed = .not. allocated(error)
        if (guessed) guessed = any(guess%pressure > 0.0_wp)
      end if
      if (allocated(error)) return
    end if
    sweeps = 0
    call attempt(guess)
    if (allocated(error)) return
    ! what coarse lattices found may lead astray: the old state is a start as good
    if (guessed .and. .not. (state%converged .or. state%sliding)) call attempt(start)
    if (allocated(error)) return
    ! a first step has no state to fall back on: it goes on from where it stands
    if (.not. (state%converged .or. state%sliding .or. any(start%pressure > 0.0_wp))) then
      call take_tractions(state, guess, self%problem%space)
      call attempt(guess)
      if (allocated(error)) return
    end if
    state%sweeps = sweeps
    state%operator_applications = work

  contains

    !> Solve on the finest lattice, and count what it takes.
    subroutine attempt(from)
      !> State to start from
      type(contact_state_t), intent(in) :: from

      call solve_on_lattice(self%problem, self%operators(1), from, reference, target, tolerance, max_sweeps, state, error)
      sweeps = sweeps + state%sweeps
      work = work + state%operator_applications
    end subroutine attempt

  end subroutine solve_step

  !> A first guess from the coarser lattices.
  subroutine coarse_guess(self, reference, target, max_sweeps, guess, work, error)
    class(frictional_contact_t), intent(inout), target :: self
    !> Relative displacement at the beginning of the step (n_col, n_row, 2) [m]
    real(wp), intent(in) :: reference(:, :, :)
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target
    !> Active sets that may be tried
    integer, intent(in) :: max_sweeps
    !> On entry a state without contact, on return one to start from
    type(contact_state_t), intent(inout) :: guess
    !> Work, in applications of the full operator on the finest lattice
    real(wp), intent(out) :: work
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    type :: field_t
      real(wp), allocatable :: value(:, :, :)
    end type field_t
    type(contact_state_t) :: state, coarser
    type(field_t) :: origin(size(self%operators))
    integer :: l

    work = 0.0_wp
    origin(2)%value = restrict_vector(self%problem%lattice, reference, self%coarse(2)%lattice)
    do l = 3, size(self%operators)
      origin(l)%value = restrict_vector(self%coarse(l - 1)%lattice, origin(l - 1)%value, self%coarse(l)%lattice)
    end do
    do l = size(self%operators), 2, -1
      associate (problem => self%coarse(l))
        if (.not. any(problem%candidate)) cycle
        if (.not. problem%is_pressed(target)) cycle
        call new_friction_state(state, problem%lattice, problem%space)
        state%motion = guess%motion
        if (allocated(coarser%pressure)) call prolong_state(self%coarse(l + 1), coarser, problem, state)
        call solve_on_lattice(problem, self%operators(l), state, origin(l)%value, target, &
                              problem%options%multilevel%nested_tolerance, max_sweeps, coarser, error)
        if (allocated(error)) return
        work = work + coarser%operator_applications*problem%lattice%size()/self%problem%lattice%size()
        ! what is no solution is no start
        if (.not. coarser%converged) deallocate (coarser%pressure)
      end associate
    end do
    if (allocated(coarser%pressure)) call prolong_state(self%coarse(2), coarser, self%problem, guess)
  end subroutine coarse_guess

  !> Tractions and motions of a coarse state as a start on the finer lattice.
  subroutine prolong_state(coarse_problem, coarse, problem, state)
    type(friction_problem_t), intent(in) :: coarse_problem
    type(contact_state_t), intent(in) :: coarse
    type(friction_problem_t), intent(in) :: problem
    type(contact_state_t), intent(inout) :: state
    if (any(shape(coarse%pressure) /= coarse_problem%lattice%extent)) return
    if (.not. all(abs(coarse%load) <= huge(1.0_wp))) return
    call prolong_edge(coarse_problem%lattice, coarse%pressure, problem%lattice, state%pressure, problem%space)
    call prolong_shear(coarse_problem%lattice, coarse%pressure, coarse%traction, problem%lattice, state%pressure, &
                       state%traction, problem%space)
    state%motion = coarse%motion
  end subroutine prolong_state

end module hc_frictional_contact
