!> One load step with Coulomb friction, on FFTs.
!>
!> Sweeps of a semismooth Newton method (see friction_sweep, friction_newton) lead from the
!> last state to the next. Without an earlier state the first guess comes from
!> coarser lattices.
module hc_frictional_contact
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_lattice, only: lattice_t
  use hc_contact_state, only: contact_state_t, new_friction_state, load_target_t, along_x, force_control
  use hc_friction_problem, only: friction_problem_t, friction_solver_t
  use hc_friction_systems, only: operators_t, new_operators, operators_memory
  use hc_friction_iterate, only: iterate_t, cautious
  use hc_friction_sweep, only: staggered_sweep
  use hc_friction_newton, only: coupled_sweep
  use hc_multilevel, only: prolong, restrict_field, level_count
  implicit none
  private

  public :: frictional_contact_t, new_frictional_contact, frictional_contact_memory

  !> Windows below this many nodes a side are not coarsened any further.
  integer, parameter :: smallest_side = 20
  !> Sweeps without a node that sticks on its own, after which a load counts as not carried.
  integer, parameter :: max_held = 12
  !> Sweeps after which tractions that do not settle one after the other are found together, unless they act on
  !> each other so strongly that it is done sooner: once residuals are near, or a few sweeps later all the same.
  integer, parameter :: most_apart = 12, patience = 4
  real(wp), parameter :: near = 0.1_wp
  !> Coarse lattices only have to give a start.
  real(wp), parameter :: coarse_tolerance = 1.0e-4_wp

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
  subroutine new_frictional_contact(self, problem, error, n_threads)
    !> Solver to be set up
    type(frictional_contact_t), intent(out) :: self
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Threads to use; absent or 0: as many as OpenMP would take
    integer, intent(in), optional :: n_threads
    integer :: l, n_level

    self%problem = problem
    n_level = level_count(problem%lattice%extent, smallest_side)
    allocate (self%operators(n_level), self%coarse(2:n_level))
    do l = 1, n_level
      if (l == 2) then
        self%coarse(l) = problem%coarsened()
      else if (l > 2) then
        self%coarse(l) = self%coarse(l - 1)%coarsened()
      end if
      if (l == 1) then
        call new_operators(self%operators(l), problem%lattice, problem%pair, error, n_threads)
      else
        call new_operators(self%operators(l), self%coarse(l)%lattice, problem%pair, error, n_threads)
      end if
      if (allocated(error)) return
    end do
  end subroutine new_frictional_contact

  !> Bytes that a problem takes, for a window of the given size.
  pure integer(selected_int_kind(18)) function frictional_contact_memory(extent, n_threads)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Threads to use
    integer, intent(in) :: n_threads
    integer, parameter :: long = selected_int_kind(18)
    integer(long) :: finest

    ! fields: problem, iterate, states, frames, vectors of conjugate gradients, a dozen directions of GMRES
    finest = operators_memory(extent, n_threads) + 110*8*int(extent(1), long)*extent(2)
    frictional_contact_memory = finest + finest/3
  end function frictional_contact_memory

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

    if (.not. self%problem%is_pressed(target)) then
      call self%problem%separate(start, reference, target, tolerance, state)
      return
    end if
    work = 0.0_wp
    guess = start
    if (.not. any(start%pressure > 0.0_wp) .and. size(self%operators) > 1) then
      call coarse_guess(self, reference, target, max_sweeps, guess, work, error)
      if (allocated(error)) return
    end if
    call solve_level(self%problem, self%operators(1), guess, reference, target, tolerance, max_sweeps, state, error)
    state%operator_applications = state%operator_applications + work
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
    origin(2)%value = restricted(self%problem%lattice, reference, self%coarse(2)%lattice)
    do l = 3, size(self%operators)
      origin(l)%value = restricted(self%coarse(l - 1)%lattice, origin(l - 1)%value, self%coarse(l)%lattice)
    end do
    do l = size(self%operators), 2, -1
      associate (problem => self%coarse(l))
        if (.not. any(problem%candidate)) cycle
        if (.not. problem%is_pressed(target)) cycle
        call new_friction_state(state, problem%lattice)
        state%motion = guess%motion
        if (allocated(coarser%pressure)) call prolong_state(self%coarse(l + 1), coarser, problem, state)
        call solve_level(problem, self%operators(l), state, origin(l)%value, target, coarse_tolerance, max_sweeps, &
                         coarser, error)
        if (allocated(error)) return
        work = work + coarser%operator_applications*problem%lattice%size()/self%problem%lattice%size()
      end associate
    end do
    if (allocated(coarser%pressure)) call prolong_state(self%coarse(2), coarser, self%problem, guess)
  end subroutine coarse_guess

  !> Values of both components of a field at the coarse nodes.
  pure function restricted(fine_lattice, fine, coarse_lattice) result(coarse)
    type(lattice_t), intent(in) :: fine_lattice, coarse_lattice
    real(wp), intent(in) :: fine(:, :, :)
    real(wp), allocatable :: coarse(:, :, :)
    integer :: m

    allocate (coarse(coarse_lattice%extent(1), coarse_lattice%extent(2), size(fine, 3)))
    do m = 1, size(fine, 3)
      coarse(:, :, m) = restrict_field(fine_lattice, fine(:, :, m), coarse_lattice)
    end do
  end function restricted

  !> Tractions and motions of a coarse state as a start on the finer lattice.
  pure subroutine prolong_state(coarse_problem, coarse, problem, state)
    type(friction_problem_t), intent(in) :: coarse_problem
    type(contact_state_t), intent(in) :: coarse
    type(friction_problem_t), intent(in) :: problem
    type(contact_state_t), intent(inout) :: state
    integer :: m

    if (any(shape(coarse%pressure) /= coarse_problem%lattice%extent)) return
    if (.not. all(abs(coarse%load) <= huge(1.0_wp))) return
    call prolong(coarse_problem%lattice, coarse%pressure, problem%lattice, state%pressure)
    do m = 1, 2
      call prolong(coarse_problem%lattice, coarse%traction(:, :, m), problem%lattice, state%traction(:, :, m))
    end do
    state%motion = coarse%motion
  end subroutine prolong_state

  !> Sweeps on one lattice.
  subroutine solve_level(problem, operators, start, reference, target, tolerance, max_sweeps, state, error)
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> Operator and preconditioners
    type(operators_t), intent(inout), target :: operators
    !> State to start from
    type(contact_state_t), intent(in) :: start
    !> Relative displacement at the beginning of the step (n_col, n_row, 2) [m]
    real(wp), intent(in) :: reference(:, :, :)
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target
    !> Bound of all residuals
    real(wp), intent(in) :: tolerance
    !> Sweeps that may be made
    integer, intent(in) :: max_sweeps
    !> Solution, converged or not
    type(contact_state_t), intent(out) :: state
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    type(iterate_t) :: now
    real(wp), allocatable :: displacement(:, :, :)
    integer :: sweep, held, apart
    logical :: failed

    held = 0
    operators%flexibility%applications = 0.0_wp
    operators%preconditioning = 0.0_wp
    call new_friction_state(state, problem%lattice)
    allocate (displacement(problem%lattice%extent(1), problem%lattice%extent(2), 3))
    call now%begin(problem, operators, start, reference, target, tolerance, error)
    if (allocated(error)) return
    ! sweeps that find pressure and shear traction one after the other
    apart = max_sweeps
    if (now%pressing) apart = most_apart
    if (problem%couples_strongly()) then
      apart = 1
      now%caution = cautious
    end if
    do sweep = 1, max_sweeps
      failed = .true.
      if (sweep > apart .and. (max(now%residual_normal, now%residual_tangential) < near .or. sweep > apart + patience)) then
        call coupled_sweep(now, failed, error)
        if (allocated(error)) return
      end if
      if (failed) call staggered_sweep(now, error)
      if (allocated(error)) return
      if (.not. now%is_finite()) exit
      if (now%held) held = held + 1
      if (now%held .and. problem%overloads(target, sum(now%p))) held = max_held
      state%sweeps = sweep
      if (max(now%residual_normal, now%residual_tangential) > tolerance .and. sweep < max_sweeps &
          .and. .not. now%sliding .and. held < max_held) cycle

      ! what is recorded fulfils the bounds exactly, and is judged by a product of its own
      state%pressure = reshape(max(now%p, 0.0_wp), shape(state%pressure))
      state%traction = reshape(now%on_cone(), shape(state%traction))
      state%motion = now%motion
      call problem%displacements(operators%flexibility, state%pressure, state%traction, displacement, error)
      if (allocated(error)) return
      call problem%conclude(target, tolerance, reference, displacement, state)
      if (state%converged .or. now%sliding .or. held >= max_held) exit
      call now%refresh(error)
      if (allocated(error)) return
    end do
    state%sliding = .not. state%converged .and. any(target%control(along_x:) == force_control) .and. &
                    (now%sliding .or. held > 1)
    state%operator_applications = operators%work()
  end subroutine solve_level

end module hc_frictional_contact
