!> Contact with friction by the dissertation's nested iteration on LAPACK solves.
!>
!> The outer iteration sorts the nodes in contact into stick and slip, the inner
!> one finds the contact area with these frozen (section 8.6 and chapter 12,
!> Figures 8.3 and 12.1): it solves one linear system for the tractions and the
!> rigid motions, nodes in tension leave and nodes that penetrate enter. Stick and
!> slip follow from q - r ds, and slip is linearised as in hc_coulomb, so
!> that the whole is a Newton method for pressure, traction and motions at once.
!>
!> A step starts from the solution on the lattice of every second node (hc_coarse_change), or from the last
!> contact area with a ring of nodes around it.
!>
!> Equations: docs/theory/friction.md, (F7).
module hc_direct_friction
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_options, only: direct_options_t
  use hc_flexibility_dense, only: dense_flexibility_t, new_dense_flexibility
  use hc_flexibility_fft, only: fft_flexibility_t, new_fft_flexibility
  use hc_contact_state, only: contact_state_t, load_target_t, load_step_t, new_friction_state, copy_tractions, slip, normal, &
    force_control, loads_not_carried
  use hc_normal_problem, only: nearest_nodes
  use hc_contact_problem, only: friction_problem_t
  use hc_contact_solver, only: friction_solver_t
  use hc_coarse_change, only: restrict_state, balance, add_change, prolong_state
  use hc_transfer, only: restrict_field, restrict_vector
  use hc_load_constraints, only: overloads, fix_in_stick
  use hc_direct_contact, only: exchange
  use hc_area_factors, only: area_factors_t
  use hc_direct_iterate, only: direct_iterate_t, infinite
  use hc_dissertation_iteration, only: iterate_as_written
  use hc_direct_system, only: solve_area
  implicit none
  private

  public :: direct_friction_t, new_direct_friction

  !> A contact problem with friction and its flexibility.
  type, extends(friction_solver_t) :: direct_friction_t
    private
    !> Influence coefficients for matrices
    type(dense_flexibility_t) :: flexibility
    !> Products over the window
    type(fft_flexibility_t) :: operator
    !> Factors of the last contact area
    type(area_factors_t) :: factors
    !> The same on the lattice of every second node, set up when it is first of use
    class(friction_solver_t), allocatable :: coarser
  contains
    procedure :: solve_step
    procedure :: displacements
    procedure :: set_gap
  end type direct_friction_t

contains

  !> Set up the flexibility of a problem.
  subroutine new_direct_friction(self, problem, error)
    !> Solver to be set up
    type(direct_friction_t), intent(out) :: self
    !> The contact problem
    type(friction_problem_t), intent(in) :: problem
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error

    self%problem = problem
    call new_dense_flexibility(self%flexibility, problem%lattice, problem%medium, error)
    if (allocated(error)) return
    call new_fft_flexibility(self%operator, problem%lattice, problem%medium, error, space=problem%space)
  end subroutine new_direct_friction

  !> Compute the displacements of given tractions.
  subroutine displacements(self, pressure, traction, displacement, error)
    class(direct_friction_t), intent(inout) :: self
    real(wp), intent(in) :: pressure(:, :), traction(:, :, :)
    real(wp), intent(out), contiguous :: displacement(:, :, :)
    type(error_t), allocatable, intent(out) :: error

    call self%problem%displacements(self%operator, pressure, traction, displacement, error)
  end subroutine displacements

  !> Set the gap before loading, on all lattices.
  recursive subroutine set_gap(self, gap)
    class(direct_friction_t), intent(inout) :: self
    real(wp), intent(in) :: gap(:, :)

    self%problem%initial_gap = gap
    if (allocated(self%coarser)) then
      call self%coarser%set_gap(restrict_field(self%problem%lattice, gap, self%coarser%problem%lattice))
    end if
  end subroutine set_gap

  !> Solve a load step: from the change that a coarser lattice finds, then from the old state.
  recursive subroutine solve_step(self, start, reference, target, tolerance, max_sweeps, state, error)
    class(direct_friction_t), intent(inout), target :: self
    type(contact_state_t), intent(in) :: start
    real(wp), intent(in), contiguous, target :: reference(:, :, :)
    type(load_target_t), intent(in) :: target
    real(wp), intent(in) :: tolerance
    integer, intent(in) :: max_sweeps
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error
    type(contact_state_t) :: guess
    type(load_step_t) :: step
    type(direct_iterate_t) :: it
    real(wp) :: work
    integer :: sweeps
    logical :: guessed

    call self%problem%friction%begin_step(start%zone)
    if (.not. self%problem%is_pressed(target)) then
      call self%problem%separate(start, reference, target, tolerance, state)
      return
    end if
    step = load_step_t(target, reference, tolerance, max_sweeps)
    if (self%problem%options%direct%as_written) then
      call take_problem(self, it)
      call iterate_as_written(it, start, step, state, error)
      return
    end if
    call find_start(self, start, step, guess, guessed, work, error)
    if (allocated(error)) return
    sweeps = 0
    if (guessed) then
      call attempt(guess)
      if (allocated(error)) return
    end if
    ! the start by coarse lattices may not converge where the old state does
    if (.not. state%converged) call attempt(start)
    state%sweeps = sweeps
    state%operator_applications = work

  contains

    !> Iterate on this lattice, and count the work.
    subroutine attempt(from)
      !> State to start from
      type(contact_state_t), intent(in) :: from

      call iterate(self, from, guessed .and. sweeps == 0, step, state, error)
      sweeps = sweeps + state%sweeps
      work = work + state%operator_applications
    end subroutine attempt

  end subroutine solve_step

  !> Find tractions and motions to start from by the lattice of every second node.
  recursive subroutine find_start(self, start, step, guess, guessed, work, error)
    class(direct_friction_t), intent(inout), target :: self
    !> State to start from otherwise
    type(contact_state_t), intent(in) :: start
    !> The load step
    type(load_step_t), intent(in) :: step
    !> State to start from
    type(contact_state_t), intent(out) :: guess
    !> There is one
    logical, intent(out) :: guessed
    !> Work, in applications of the operator of this lattice
    real(wp), intent(out) :: work
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    type(contact_state_t) :: before, after
    type(load_target_t) :: coarse_target
    real(wp), allocatable :: displacement(:, :, :), origin(:, :, :), gap(:, :)
    logical :: touching

    guessed = .false.
    work = 0.0_wp
    touching = any(start%pressure > 0.0_wp)
    if (.not. is_worth_coarsening(self, touching, start, step%target)) return
    if (.not. allocated(self%coarser)) call set_up_coarser(self, error)
    if (allocated(error)) return
    call copy_tractions(start, guess, self%problem%space)
    associate (model => self%coarser%problem, options => self%problem%options%multilevel)
      if (.not. any(model%candidate)) return
      if (touching) then
        call restrict_state(self%problem, start, model, before)
        allocate (displacement(model%lattice%extent(1), model%lattice%extent(2), 3))
        call self%coarser%displacements(before%pressure, before%traction, displacement, error)
        if (allocated(error)) return
        gap = model%initial_gap
        call balance(self%problem, start, step, before, displacement, model, origin, coarse_target)
        call self%coarser%solve_step(before, origin, coarse_target, self%problem%options%direct%change_tolerance, &
                                     options%change_sweeps, after, error)
        model%initial_gap = gap
        if (allocated(error)) return
        guessed = after%converged
        if (guessed) call add_change(model, before, after, self%problem, guess)
      else
        call new_friction_state(before, model%lattice, model%space)
        before%motion = start%motion
        call self%coarser%solve_step(before, restrict_vector(self%problem%lattice, step%reference, model%lattice), &
                                     step%target, self%problem%options%direct%nested_tolerance, step%max_sweeps, after, error)
        if (allocated(error)) return
        guessed = after%converged
        if (guessed) call prolong_state(model, after, self%problem, guess)
      end if
      work = after%operator_applications*model%lattice%size()/self%problem%lattice%size()
    end associate
    if (guessed) guessed = any(guess%pressure > 0.0_wp)
  end subroutine find_start

  !> Return whether the contact has enough nodes for a coarser lattice to help.
  logical function is_worth_coarsening(self, touching, start, target) result(worth)
    type(direct_friction_t), intent(in) :: self
    !> There is a contact already
    logical, intent(in) :: touching
    !> State to start from
    type(contact_state_t), intent(in) :: start
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target
    logical, allocatable :: nodes(:)

    associate (problem => self%problem, options => self%problem%options%multilevel)
      worth = minval(problem%lattice%extent) >= 2*options%smallest_side
      if (.not. worth) return
      if (touching) then
        nodes = reshape(start%pressure > 0.0_wp, [problem%lattice%size()])
      else
        nodes = problem%first_guess(target)
      end if
      worth = count(nodes) >= 4*options%least_contact
    end associate
  end function is_worth_coarsening

  !> Set up the problem on the lattice of every second node.
  subroutine set_up_coarser(self, error)
    type(direct_friction_t), intent(inout) :: self
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem
    type(direct_friction_t), allocatable :: coarser

    call self%problem%coarsen(problem)
    allocate (coarser)
    call new_direct_friction(coarser, problem, error)
    if (.not. allocated(error)) call move_alloc(coarser, self%coarser)
  end subroutine set_up_coarser

  !> Give an iterate the problem with its flexibility.
  subroutine take_problem(self, it)
    class(direct_friction_t), intent(inout), target :: self
    !> Iterate
    type(direct_iterate_t), intent(inout) :: it

    it%problem => self%problem
    it%flexibility => self%flexibility
    it%operator => self%operator
    it%factors => self%factors
  end subroutine take_problem

  !> Iterate from a state until the residuals are within the tolerance.
  subroutine iterate(self, start, is_near, step, state, error)
    class(direct_friction_t), intent(inout), target :: self
    !> State to start from
    type(contact_state_t), intent(in) :: start
    !> Its contact area needs no ring around it
    logical, intent(in) :: is_near
    !> The load step
    type(load_step_t), intent(in) :: step
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error
    type(direct_iterate_t) :: it, before
    type(direct_options_t) :: options
    real(wp) :: share
    integer :: sweep, unsupported

    options = self%problem%options%direct
    call new_friction_state(state, self%problem%lattice)
    call take_problem(self, it)
    call it%begin(start, step)
    it%accuracy = options%first_accuracy

    if (any(start%pressure > 0.0_wp)) then
      call continue_from(start, is_near, it, error)
    else
      call set_start(it, error)
    end if
    unsupported = 0
    share = 1.0_wp
    do sweep = 1, step%max_sweeps
      if (allocated(error)) return
      before = it
      ! with wrong zones of stick and slip, full convergence of the contact area costs more than it saves
      call find_area(merge(1, sweep, is_near), it, error)
      if (allocated(error)) return
      if (it%is_unsupported()) then
        unsupported = unsupported + 1
        if (unsupported < options%max_unsupported .and. any(it%zone == slip)) then
          before%solves = it%solves
          it = before
          share = options%cautious_share*share
          call fix_in_stick(self%problem%space, self%problem%options%contact%fixed_share, it%compliance, it%zone)
          call find_area(sweep, it, error)
          if (allocated(error)) return
        end if
      end if
      call it%record(step, state, error)
      if (allocated(error) .or. state%converged) exit
      it%accuracy = min(it%accuracy, max(options%last_accuracy*step%tolerance, options%inner_accuracy* &
                                         max(state%residual_normal, state%residual_tangential)))
      if (unsupported > 0 .or. sweep == step%max_sweeps) then
        state%sliding = overloads(self%problem, step%target, state%pressure, state%residual_normal)
        if (state%sliding .or. unsupported == options%max_unsupported) exit
      end if
      if (mod(sweep, options%sweeps_per_cut) == 0) share = 0.5_wp*share
      call it%classify(share)
    end do
    if (state%sliding) state%stopped = loads_not_carried
  end subroutine iterate

  !> Find a first contact: without shear traction, and then against the slip that its pressure causes.
  subroutine set_start(it, error)
    !> Iterate
    type(direct_iterate_t), intent(inout) :: it
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: weight(size(it%p)), mean
    integer :: i

    it%contact = it%problem%first_guess(it%target)
    where (it%contact)
      it%zone = slip
      it%compliance = infinite
    end where
    call find_area(it%problem%options%direct%first_areas, it, error)
    if (allocated(error)) return
    ! shifts that are free follow the bodies
    weight = max(it%p, 0.0_wp)/max(sum(max(it%p, 0.0_wp)), tiny(1.0_wp))
    do i = 1, 2
      if (it%target%control(1 + i) /= force_control) cycle
      mean = sum(weight*it%ds(:, i))
      it%motion(1 + i) = it%motion(1 + i) + mean
      it%ds(:, i) = it%ds(:, i) - mean
    end do
    call it%classify(it%problem%options%direct%cautious_share)
  end subroutine set_start

  !> Take tractions, and contact with a ring around it, of the state to start from.
  subroutine continue_from(start, is_near, it, error)
    !> State to start from
    type(contact_state_t), intent(in) :: start
    !> Its contact area needs no ring around it
    logical, intent(in) :: is_near
    !> Iterate
    type(direct_iterate_t), intent(inout) :: it
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    integer :: n

    n = size(it%p)
    it%contact = reshape(start%pressure > 0.0_wp, [n])
    if (.not. is_near) it%contact = reshape(it%problem%lattice%dilated(start%pressure > 0.0_wp), [n])
    it%contact = it%candidate .and. it%contact
    if (.not. any(it%contact)) it%contact = it%candidate
    it%p = merge(reshape(start%pressure, [n]), 0.0_wp, it%contact)
    it%q = reshape(start%traction, [n, 2])
    call it%evaluate(error)
    if (.not. allocated(error)) call it%classify(it%problem%options%direct%cautious_share)
  end subroutine continue_from

  !> Find the contact area under a frozen state of stick and slip, and its tractions.
  subroutine find_area(max_tries, it, error)
    !> Areas that may be tried
    integer, intent(in) :: max_tries
    !> Iterate
    type(direct_iterate_t), intent(inout) :: it
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    logical, dimension(size(it%p)) :: wrong, before
    real(wp) :: negligible, violation
    integer :: i, fewest, left, try

    fewest = huge(1)
    associate (problem => it%problem, options => it%problem%options%direct)
      left = options%stalled_exchanges
      do try = 1, max_tries
        if (problem%normal_law%is_compliant() .and. any(abs(it%p) > 0.0_wp)) call it%linearize_law()
        call solve_area(it, error)
        if (allocated(error)) return
        if (problem%normal_law%is_compliant()) then
          violation = 0.0_wp
          call problem%normal_law%violation(1, problem%normal_compliance, it%p, it%gap, logical(it%candidate), violation)
          if (violation <= options%settled_spring*maxval(it%p)) return
          cycle
        end if
        negligible = it%negligible_pressure()
        wrong = merge(it%p < -negligible, it%candidate .and. it%gap < -negligible*problem%normal_compliance, it%contact)
        if (.not. any(wrong)) return
        before = it%contact
        call exchange(wrong, options%stalled_exchanges, fewest, left, it%contact)
        if (.not. any(it%contact)) it%contact = nearest_nodes(it%gap, it%candidate)
        do i = 1, size(it%p)
          if (it%contact(i) .and. .not. before(i)) call it%enter(i)
        end do
      end do
    end associate
  end subroutine find_area

end module hc_direct_friction
