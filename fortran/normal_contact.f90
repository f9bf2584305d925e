!> Frictionless contact by active sets and preconditioned conjugate gradients.
!>
!> Find pressure p and gap g = h + w - approach with p >= 0, g >= 0, p g = 0.
!> Each sweep takes the nodes with p - r g > 0 as the active set, solves the
!> linear problem g = 0 on it by projected conjugate gradients (nodes may enter
!> and leave), and classifies again. The first guess comes from the solution on
!> the lattice of every second node, and so on down to a few nodes.
module hc_normal_contact
  use hc_precision, only: wp, pi
  use hc_error, only: error_t
  use hc_lattice, only: lattice_t
  use hc_elastic_pair, only: elastic_pair_t
  use hc_flexibility, only: normal
  use hc_flexibility_fft, only: fft_flexibility_t, new_fft_flexibility, fft_memory
  use hc_contact_state, only: contact_state_t, new_contact_state, check_problem, force_control
  use hc_contact_residuals, only: normal_self_compliance, normal_residual, conclude
  use hc_preconditioner, only: preconditioner_t, new_preconditioner, preconditioner_memory
  use hc_krylov, only: linear_system_t, projected_cg, precondition_constraints, dot
  use hc_multilevel, only: level_count, prolong, restrict_field, restrict_mask
  implicit none
  private

  public :: normal_contact_t, new_normal_contact, normal_contact_memory

  !> Windows below this many nodes a side are not coarsened any further.
  integer, parameter :: smallest_side = 12
  !> Coarse lattices only have to give a start.
  real(wp), parameter :: coarse_tolerance = 1.0e-4_wp
  !> Scale of the classification parameter: r = this/(2 pi lambda_1 a), a the contact radius.
  real(wp), parameter :: classification_scale = 10.0_wp
  !> Accuracy of a linear solution, relative to the residual at its start, while the set changes.
  real(wp), parameter :: inner_accuracy = 0.1_wp
  !> Accuracy of the last linear solution, relative to the tolerance.
  real(wp), parameter :: final_accuracy = 0.3_wp
  integer, parameter :: max_iterations = 400

  !> The problem on one lattice.
  type, extends(linear_system_t) :: level_t
    type(lattice_t) :: lattice
    !> Initial gap (n_col, n_row) [m]
    real(wp), allocatable :: initial_gap(:, :)
    !> Nodes that may come into contact (n_col, n_row)
    logical, allocatable :: candidate(:, :)
    type(fft_flexibility_t) :: flexibility
    type(preconditioner_t) :: preconditioner
    !> Self-compliance of a node [m/Pa]
    real(wp) :: compliance = 0.0_wp
    !> Work of the preconditioner, in applications of the full operator
    real(wp) :: preconditioning = 0.0_wp
  contains
    procedure :: product => level_product
    procedure :: precondition => level_precondition
  end type level_t

  !> A frictionless contact problem on a hierarchy of lattices.
  type :: normal_contact_t
    private
    !> From the finest to the coarsest lattice
    type(level_t), allocatable :: level(:)
  contains
    !> Solve for a normal load or an approach
    procedure :: solve
  end type normal_contact_t

contains

  !> Operators of a problem on all its lattices.
  subroutine new_normal_contact(self, lattice, pair, initial_gap, candidate, error, n_threads)
    !> Problem to be set up
    type(normal_contact_t), intent(out) :: self
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Elastic constants of the two bodies
    type(elastic_pair_t), intent(in) :: pair
    !> Initial gap (n_col, n_row) [m]
    real(wp), intent(in) :: initial_gap(:, :)
    !> Nodes that may come into contact (n_col, n_row)
    logical, intent(in) :: candidate(:, :)
    !> Allocated on failure: wrong shapes, no candidate at all, not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Threads to use; absent or 0: as many as OpenMP would take
    integer, intent(in), optional :: n_threads

    integer :: l

    call check_problem(lattice, initial_gap, candidate, error)
    if (allocated(error)) return
    allocate (self%level(level_count(lattice%extent, smallest_side)))
    do l = 1, size(self%level)
      associate (level => self%level(l))
        if (l == 1) then
          level%lattice = lattice
          level%initial_gap = initial_gap
          level%candidate = candidate
        else
          associate (finer => self%level(l - 1))
            level%lattice = finer%lattice%coarsened()
            level%initial_gap = restrict_field(finer%lattice, finer%initial_gap, level%lattice)
            level%candidate = restrict_mask(finer%lattice, finer%candidate, level%lattice)
          end associate
        end if
        level%compliance = normal_self_compliance(level%lattice, pair)
        call new_fft_flexibility(level%flexibility, level%lattice, pair, error, normal_only=.true., n_threads=n_threads)
        if (allocated(error)) return
        call new_preconditioner(level%preconditioner, level%lattice, pair, error, n_threads)
        level%n_threads = level%flexibility%convolution%n_threads
        if (allocated(error)) return
      end associate
    end do
  end subroutine new_normal_contact

  !> Bytes that a problem takes, for a window of the given size.
  pure integer(selected_int_kind(18)) function normal_contact_memory(extent, n_threads)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Threads to use
    integer, intent(in) :: n_threads
    integer, parameter :: long = selected_int_kind(18)
    integer(long) :: finest

    ! fields: gap, candidates, state, and the vectors of the conjugate gradients
    finest = fft_memory(extent, .true., n_threads) + preconditioner_memory(extent, n_threads, .false.) &
             + 14*8*int(extent(1), long)*extent(2)
    normal_contact_memory = finest + finest/3
  end function normal_contact_memory

  !> Solve for a normal load or an approach.
  subroutine solve(self, control, target, tolerance, max_sweeps, state, error)
    class(normal_contact_t), intent(inout), target :: self
    !> force_control or displacement_control
    integer, intent(in) :: control
    !> Normal load [N] or approach [m]
    real(wp), intent(in) :: target
    !> Bound of both residuals
    real(wp), intent(in) :: tolerance
    !> Active sets that may be tried on each lattice
    integer, intent(in) :: max_sweeps
    !> Solution; `converged` tells whether the residuals are within the tolerance
    type(contact_state_t), intent(out) :: state
    !> Allocated on failure: an operator that is not positive definite
    type(error_t), allocatable, intent(out) :: error

    real(wp), allocatable :: pressure(:, :), finer(:, :)
    real(wp) :: work, size_ratio
    integer :: l

    work = 0.0_wp
    do l = size(self%level), 1, -1
      associate (level => self%level(l))
        if (.not. any(level%candidate)) cycle
        allocate (finer(level%lattice%extent(1), level%lattice%extent(2)), source=0.0_wp)
        if (allocated(pressure)) then
          call prolong(self%level(l + 1)%lattice, pressure, level%lattice, finer)
        else
          where (level%candidate) finer = 1.0_wp
        end if
        call move_alloc(finer, pressure)
        level%flexibility%applications = 0.0_wp
        level%preconditioning = 0.0_wp
        call solve_level(level, control, target, merge(tolerance, max(tolerance, coarse_tolerance), l == 1), &
                         max_sweeps, pressure, state, error)
        if (allocated(error)) return
        pressure = state%pressure
        size_ratio = real(level%lattice%size(), wp)/self%level(1)%lattice%size()
        work = work + size_ratio*(level%flexibility%applications + level%preconditioning)
      end associate
    end do
    state%operator_applications = work
  end subroutine solve

  !> Active sets on one lattice.
  subroutine solve_level(level, control, target, tolerance, max_sweeps, start, state, error)
    !> The problem
    type(level_t), intent(inout) :: level
    !> force_control or displacement_control
    integer, intent(in) :: control
    !> Normal load [N] or approach [m]
    real(wp), intent(in) :: target
    !> Bound of both residuals
    real(wp), intent(in) :: tolerance
    !> Active sets that may be tried
    integer, intent(in) :: max_sweeps
    !> Pressure to start from, up to a factor (n_col, n_row)
    real(wp), intent(in) :: start(:, :)
    !> Solution
    type(contact_state_t), intent(out) :: state
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    real(wp), allocatable :: p(:), w(:), gap(:), h(:), constraint(:, :), mb(:, :)
    logical, allocatable :: candidate(:), active(:), previous(:)
    real(wp) :: delta, r, residual, inner_tolerance, multiplier(1)
    integer :: n, sweep, iterations, n_constraint
    logical :: changed

    call new_contact_state(state, level%lattice)
    n = level%lattice%size()
    h = reshape(level%initial_gap, [n])
    candidate = reshape(level%candidate, [n])
    delta = minval(h, mask=candidate)
    if (target <= merge(0.0_wp, delta, control == force_control)) then         ! nothing touches
      state%motion(normal) = merge(delta, target, control == force_control)
      state%gap = level%initial_gap - state%motion(normal)
      call conclude(state, level%lattice, level%candidate, level%compliance, control, target, tolerance)
      return
    end if

    ! pressure only opens the gap elsewhere: no contact where the bodies would not even overlap
    if (control /= force_control) candidate = candidate .and. h < target
    p = reshape(start, [n])
    active = candidate .and. p > 0.0_wp
    if (.not. any(active)) active = candidate
    allocate (w(n), gap(n))
    n_constraint = merge(1, 0, control == force_control)
    allocate (constraint(n, n_constraint))
    delta = target
    residual = 1.0_wp

    changed = .true.

    do sweep = 1, max_sweeps
      if (changed) then
        call restart(level, control, target, h, active, p, w, error)
        if (allocated(error)) return
        if (n_constraint == 1) constraint(:, 1) = merge(1.0_wp, 0.0_wp, active)
        call precondition_constraints(level, active, constraint, mb, error)
        if (allocated(error)) return
        inner_tolerance = max(inner_accuracy*min(residual, 1.0_wp), final_accuracy*tolerance)
      else
        ! the set has been found: the linear problem is worth solving to the end
        inner_tolerance = final_accuracy*tolerance
      end if
      inner_tolerance = inner_tolerance*level%compliance*maxval(p)
      call projected_cg(level, active, constraint, mb, merge(0.0_wp, delta, control == force_control) - h, p, w, &
                        inner_tolerance, max_iterations, multiplier(:n_constraint), residual, iterations, error)
      if (allocated(error)) return
      if (control == force_control) delta = multiplier(1)
      gap = h + w - delta
      residual = normal_residual(reshape(p, shape(level%candidate)), reshape(gap, shape(level%candidate)), &
                                 level%candidate, level%compliance)
      state%sweeps = sweep
      if (residual <= tolerance) exit

      ! one step of a projected gradient map; scaled with the size of the contact it contracts
      r = classification_scale/(2.0_wp*pi*level%flexibility%pair%lambda_1*sqrt(level%lattice%cell_area()*count(active)/pi))
      previous = active
      active = candidate .and. p - r*gap > 0.0_wp
      if (.not. any(active)) active = candidate .and. gap <= minval(gap, mask=candidate)
      changed = any(active .neqv. previous)
    end do

    if (any(p < 0.0_wp)) then                                                 ! within the tolerance
      p = max(p, 0.0_wp)
      call level%product(p, w, error)
      if (allocated(error)) return
      gap = h + w - delta
    end if
    state%pressure = reshape(p, shape(state%pressure))
    state%gap = reshape(gap, shape(state%gap))
    state%motion(normal) = delta
    call conclude(state, level%lattice, level%candidate, level%compliance, control, target, tolerance)
  end subroutine solve_level

  !> Make the pressure fit the active set and the load, and find what it does to the gap.
  subroutine restart(level, control, target, h, active, p, w, error)
    !> The problem
    type(level_t), intent(inout) :: level
    !> force_control or displacement_control
    integer, intent(in) :: control
    !> Normal load [N] or approach [m]
    real(wp), intent(in) :: target
    !> Initial gap [m]
    real(wp), intent(in) :: h(:)
    !> Active nodes
    logical, intent(in) :: active(:)
    !> Pressure [Pa]
    real(wp), intent(inout) :: p(:)
    !> Closing of the gap [m]
    real(wp), intent(out) :: w(:)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: factor

    p = merge(max(p, 0.0_wp), 0.0_wp, active)
    if (.not. any(p > 0.0_wp)) p = merge(1.0_wp, 0.0_wp, active)
    call level%product(p, w, error)
    if (allocated(error)) return
    ! the prescribed load, or else the least energy under the prescribed approach
    if (control == force_control) then
      factor = target/(level%lattice%cell_area()*sum(p))
    else
      factor = dot(p, target - h, level%n_threads)/dot(p, w, level%n_threads)
    end if
    p = factor*p
    w = factor*w
  end subroutine restart

  subroutine level_product(self, x, y, error)
    class(level_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error
    real(wp), pointer, contiguous :: field(:, :, :), closing(:, :, :)

    field(1:self%lattice%extent(1), 1:self%lattice%extent(2), 1:1) => x
    closing(1:self%lattice%extent(1), 1:self%lattice%extent(2), 1:1) => y
    call self%flexibility%apply([normal], field, [normal], closing, error)
  end subroutine level_product

  subroutine level_precondition(self, x, y, error)
    class(level_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error
    real(wp), pointer, contiguous :: field(:, :, :), pressure(:, :, :)

    field(1:self%lattice%extent(1), 1:self%lattice%extent(2), 1:1) => x
    pressure(1:self%lattice%extent(1), 1:self%lattice%extent(2), 1:1) => y
    call self%preconditioner%apply(field, pressure)
    self%preconditioning = self%preconditioning + self%preconditioner%cost
  end subroutine level_precondition

end module hc_normal_contact
