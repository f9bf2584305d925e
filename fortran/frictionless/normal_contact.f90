!> Frictionless contact, from coarse to fine lattices.
!>
!> The first guess comes from the solution on the lattice of every second node,
!> and so on down to a few nodes.
!>
!> Theory: docs/theory/normal_contact.md.
module hc_normal_contact
  use hc_precision, only: wp, lk
  use hc_error, only: error_t, status, raise
  use hc_communicator, only: communicator_t
  use hc_options, only: options_t
  use hc_lattice, only: lattice_t
  use hc_field_space, only: field_space_t, space_over
  use hc_memory, only: give_back
  use hc_scratch, only: scratch_t
  use hc_hierarchy, only: level_count, coarse_rows_t
  use hc_elastic_medium, only: elastic_medium_t
  use hc_fft_layout_single, only: convolution_memory, transform_memory
  use hc_flexibility, only: check_operator, padded_length
  use hc_flexibility_fft, only: fft_memory
  use hc_pressure_kernel, only: normal_kernel_t
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_contact_state, only: contact_state_t, load_target_t, new_contact_state, check_target, normal, force_control
  use hc_contact_solver, only: contact_solver_t
  use hc_normal_law, only: normal_law_t, tangent_t
  use hc_normal_problem, only: normal_problem_t, new_normal_problem
  use hc_inverse_symbol, only: preconditioner_memory
  use hc_normal_lattice, only: normal_lattice_t
  use hc_normal_iterate, only: normal_iterate_t
  use hc_normal_lattice_solver, only: solve_on_normal_lattice
  use hc_subwindow, only: next_part
  use hc_transfer, only: prolong, prolong_edge
  implicit none
  private

  public :: normal_contact_t, new_normal_contact, normal_contact_memory

  !> A frictionless contact problem on a hierarchy of lattices.
  type, extends(contact_solver_t) :: normal_contact_t
    private
    !> From the finest to the coarsest lattice
    type(normal_lattice_t), allocatable :: level(:)
    !> Fields of the iterations on the finest one: memory that the next solution uses again
    type(normal_iterate_t) :: iterate
    !> Memory of the transforms of all lattices, which run one after the other; their convolutions free it
    type(scratch_t), pointer :: scratch => null()
    !> The part of the finest lattice around the contact, and its first column and row there
    type(normal_lattice_t), allocatable :: inner
    integer :: corner(2) = 0
    !> Tuning numbers
    type(options_t) :: options
    !> The kernel, as far as it was needed
    type(normal_kernel_t) :: kernel
    !> Cache of spectra
    type(kernel_cache_t), pointer :: cache => null()
    !> Threads to use; 0: as many as OpenMP would take
    integer :: threads = 0
    !> Ranks that share the larger windows
    type(communicator_t) :: ranks
  contains
    procedure :: solve_step
    procedure :: normal_part
    !> Solve for a normal load or an approach
    procedure :: solve
  end type normal_contact_t

contains

  !> Set up the operators of a problem on all its lattices.
  subroutine new_normal_contact(self, lattice, medium, initial_gap, candidate, error, n_threads, cache, options, law, ranks)
    !> Problem to be set up
    type(normal_contact_t), intent(out) :: self
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> Initial gap (n_col, own rows) [m]
    real(wp), intent(in) :: initial_gap(:, :)
    !> Nodes that may come into contact (n_col, own rows)
    logical, intent(in) :: candidate(:, :)
    !> Allocated on failure: wrong shapes, no candidate at all, numbers of no use, not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Threads to use; absent or 0: as many as OpenMP would take
    integer, intent(in), optional :: n_threads
    !> Cache of spectra; it has to outlive the problem
    type(kernel_cache_t), pointer, intent(in), optional :: cache
    !> Tuning numbers; absent: the usual ones
    type(options_t), intent(in), optional :: options
    !> Law of contact; absent: unilateral contact
    class(normal_law_t), intent(in), optional :: law
    !> Ranks that solve it together; absent: one
    type(communicator_t), intent(in), optional :: ranks

    integer :: l

    if (present(ranks)) self%ranks = ranks
    if (present(n_threads)) self%threads = n_threads
    if (present(cache)) self%cache => cache
    if (present(options)) self%options = options
    call check_operator(lattice, medium, error, n_threads)
    if (allocated(error)) return
    allocate (self%level(level_count(lattice, self%options%multilevel%smallest_side)))
    allocate (self%scratch)
    self%level(1)%options = self%options
    call new_normal_problem(self%level(1), lattice, medium, initial_gap, candidate, error, law, space_of(self, lattice))
    if (allocated(error)) return
    do l = 2, size(self%level)
      call self%level(l - 1)%coarsen(self%level(l))
    end do
    call free_coarse_gaps(self)
    do l = 1, size(self%level)
      ! operators for iterations on the finest lattice are set up on demand: a part of it may be enough
      call self%level(l)%prepare(self%kernel, l == 1, l > 1, space_of(self, self%level(l)%lattice), error, self%cache)
      if (allocated(error)) return
    end do
  end subroutine new_normal_contact

  !> Count the bytes that a problem takes, for a window of the given size.
  pure integer(selected_int_kind(18)) function normal_contact_memory(extent, threads, periodic)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Threads to use
    integer, intent(in) :: threads
    !> The window repeats
    logical, intent(in) :: periodic
    integer, parameter :: long = selected_int_kind(18)
    !> Bytes of a field of numbers, in single precision, and of marks
    integer, parameter :: field = 8, half = 4, mark = 1
    integer(long) :: n, exact, each

    n = int(extent(1), long)*extent(2)
    ! the spectrum of the pressure: in double precision on the finest lattice, and on all of a window that repeats
    exact = fft_memory(extent, .true., threads, shared=.true., periodic=periodic)
    ! on all lattices: the inverse symbol, buffers; gap, candidates
    each = preconditioner_memory(extent, threads, .false., shared=.true.) &
           + convolution_memory(extent, padded_length(extent, periodic), 0, 0, threads) + n*(field + mark)
    normal_contact_memory = each + exact + (each + merge(exact, exact/2, periodic))/3
    ! on the finest: row transforms in single precision, beside them those in double precision or two fields, and a third one
    associate (rows => transform_memory(extent, padded_length(extent, periodic), 1))
      normal_contact_memory = normal_contact_memory + rows + max(rows, 2*half*n) + half*n
    end associate
    ! pressure, closing; direction, punch, places about the edge of the contact; zones now and next
    normal_contact_memory = normal_contact_memory + n*(2*field + 3*half + 2*mark)
  end function normal_contact_memory

  !> Point to the problem on the finest lattice.
  function normal_part(self) result(problem)
    class(normal_contact_t), intent(in), target :: self
    class(normal_problem_t), pointer :: problem

    problem => self%level(1)
  end function normal_part

  !> Solve a load step, of which the normal load or the approach matters.
  subroutine solve_step(self, start, reference, target, tolerance, max_sweeps, state, error)
    class(normal_contact_t), intent(inout), target :: self
    type(contact_state_t), intent(in) :: start
    real(wp), intent(in), contiguous, target :: reference(:, :, :)
    type(load_target_t), intent(in) :: target
    real(wp), intent(in) :: tolerance
    integer, intent(in) :: max_sweeps
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error

    ! the first guess is that of the coarser lattices: a load gives the same bits whatever came before it
    call self%solve(target%control(normal), target%value(normal), tolerance, max_sweeps, state, error)
  end subroutine solve_step

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
    !> Solution; `converged`: the residuals are within the tolerance
    type(contact_state_t), intent(out) :: state
    !> Allocated on failure: a target that cannot be solved for, numbers that are not finite
    type(error_t), allocatable, intent(out) :: error

    type(load_target_t) :: goal
    type(contact_state_t) :: coarse
    type(normal_iterate_t), allocatable :: passing
    real(wp) :: work, coarse_tolerance
    integer :: l, stat

    call check_target([control], [target], tolerance, max_sweeps, error)
    if (allocated(error)) return
    call self%scratch%take(stat)
    if (stat /= 0) call raise(error, status%resources, 'not enough memory for the transforms: use a smaller window')
    call self%ranks%agree(error)
    if (allocated(error)) return
    goal = load_target_t([control], [target])
    call self%level(1)%check_approach(goal, error)
    if (allocated(error)) return
    work = 0.0_wp
    do l = 2, size(self%level)
      call self%level(l - 1)%coarsen_gap(self%level(l))
    end do
    do l = size(self%level), 1, -1
      associate (level => self%level(l))
        if (level%space%count(level%candidate) == 0) cycle
        if (l > 1 .and. .not. allocated(passing)) allocate (passing)
        allocate (state%pressure(level%lattice%extent(1), level%own_rows()), source=0.0_wp)
        coarse_tolerance = self%options%normal%coarse_tolerance
        if (allocated(coarse%pressure)) then
          if (is_smooth(level, self%level(l + 1)%space%max(coarse%pressure))) then
            coarse_tolerance = self%options%normal%smooth_tolerance
          end if
          call prolong_pressure(self%level(l + 1), coarse, level, state%pressure)
        else
          where (level%candidate) state%pressure = 1.0_wp
          ! the same pressure everywhere would move no surface from its mean plane
          if (level%lattice%is_periodic() .and. goal%control(normal) /= force_control) then
            state%pressure = max(goal%value(normal) - level%initial_gap, 0.0_wp)
          end if
        end if
        if (l > 1) then
          call solve_on_normal_lattice(level, passing, goal, max(tolerance, coarse_tolerance), max_sweeps, state, error)
          ! each rank may have solved all of the coarser lattice
          call self%ranks%agree(error)
          if (allocated(error)) return
          work = work + share_of(level, self%level(1))*level%work()
          call move_alloc(state%pressure, coarse%pressure)
          call move_alloc(state%gap, coarse%gap)
        else
          self%iterate%searches = .false.
          if (allocated(passing)) then
            self%iterate%searches = passing%searches
            deallocate (passing)
          end if
          coarse = contact_state_t()
          call free_coarse_gaps(self)
          call solve_finest(self, goal, tolerance, max_sweeps, state, work, error)
          if (allocated(error)) return
        end if
      end associate
    end do
    state%operator_applications = work
    ! files are written before the next load
    self%iterate = normal_iterate_t()
    call self%scratch%free()
    call give_back(self%level(1)%own_size())
  end subroutine solve

  !> Free the gaps of the coarse lattices, whose memory set-up and iterations on the finest one take; each load finds them anew.
  subroutine free_coarse_gaps(self)
    class(normal_contact_t), intent(inout) :: self
    integer :: l

    do l = 2, size(self%level)
      deallocate (self%level(l)%initial_gap)
    end do
  end subroutine free_coarse_gaps

  !> Return whether pressure and gap are smooth up to the edge of the contact: on a layer that is softer than a node.
  pure logical function is_smooth(level, p_max)
    class(normal_lattice_t), intent(in) :: level
    !> Largest pressure [Pa]
    real(wp), intent(in) :: p_max

    is_smooth = level%normal_law%compliance_under(p_max) > level%options%normal%soft_layer*level%normal_compliance
  end function is_smooth

  !> Interpolate the pressure from the next coarser lattice.
  !>
  !> Between rigid surfaces and on a stiff layer it falls to zero like the root of the distance. On a layer that is softer than a
  !> node, pressure and gap are smooth: t = p - r g is interpolated, of which p + r sigma(p) = t follows, (N6).
  subroutine prolong_pressure(coarser, coarse, level, pressure)
    !> Coarser lattice, and pressure and gap there
    type(normal_lattice_t), intent(in) :: coarser
    type(contact_state_t), intent(in), target :: coarse
    !> Finer lattice
    type(normal_lattice_t), intent(in) :: level
    !> Pressure there
    real(wp), intent(inout), contiguous :: pressure(:, :)
    real(wp), dimension(size(pressure, 1)) :: compliance, offset
    real(wp), allocatable, target :: own(:, :), own_gap(:, :)
    real(wp), pointer, contiguous :: p(:, :), gap(:, :)
    type(coarse_rows_t) :: below
    type(tangent_t) :: tangent
    real(wp) :: p_max
    integer :: row

    p_max = coarser%space%max(coarse%pressure)
    below = coarser%rows_below(level)
    call coarser%take_below(below, coarse%pressure, own, p)
    if (.not. is_smooth(level, p_max)) then
      call prolong_edge(below%rows, p, below%fine, pressure, level%space)
      return
    end if
    call coarser%take_below(below, coarse%gap, own_gap, gap)
    tangent = tangent_t(1.0_wp/coarser%normal_compliance, level%softest_spring(p_max))
    call prolong(below%rows, p - tangent%r*min(gap, coarser%normal_compliance*p_max), below%fine, pressure, level%space)
    !$omp parallel do schedule(static) num_threads(level%space%threads) private(compliance, offset)
    do row = 1, size(pressure, 2)
      ! the tangent at the solution p is that of p + r sigma(p) = t, too
      call level%normal_law%linearize((row - 1)*size(pressure, 1) + 1, tangent, spread(0.0_wp, 1, size(pressure, 1)), &
                                      -pressure(:, row)/tangent%r, level%candidate(:, row) .and. pressure(:, row) > 0.0_wp, &
                                      compliance, offset)
      pressure(:, row) = max((pressure(:, row) - tangent%r*offset)/(1.0_wp + tangent%r*compliance), 0.0_wp)
    end do
    !$omp end parallel do
  end subroutine prolong_pressure

  !> Return the space of a lattice: one thread where the start of the others takes longer than each of the short passes.
  type(field_space_t) function space_of(self, lattice)
    class(normal_contact_t), intent(in) :: self
    type(lattice_t), intent(in) :: lattice

    if (self%threads > 0 .or. lattice%size() >= self%options%normal%worth_sharing) then
      space_of = space_over(lattice%extent, self%threads)
    end if
    space_of%ranks = self%ranks%over(lattice%extent)
    space_of%scratch => self%scratch
  end function space_of

  !> Return the nodes of a part of a lattice over those of the whole.
  pure real(wp) function share_of(part, whole)
    type(normal_lattice_t), intent(in) :: part, whole
    share_of = real(part%lattice%size(), wp)/whole%lattice%size()
  end function share_of

  !> Solve on the finest lattice: on the part around the contact, if that is much smaller than the window.
  !>
  !> The gap elsewhere follows from one product over the window.
  subroutine solve_finest(self, target, tolerance, max_sweeps, state, work, error)
    class(normal_contact_t), intent(inout), target :: self
    !> Normal load or approach to be reached
    type(load_target_t), intent(in) :: target
    !> Bound of both residuals
    real(wp), intent(in) :: tolerance
    !> Iterations that may be made
    integer, intent(in) :: max_sweeps
    !> On entry its pressure is the start, up to a factor; on return the solution
    type(contact_state_t), intent(inout) :: state
    !> Work, in applications of the full operator on the finest lattice
    real(wp), intent(inout) :: work
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    type(contact_state_t) :: part
    integer :: low(2), high(2), sweeps, try
    logical :: found

    associate (whole => self%level(1))
      sweeps = 0
      do try = 1, self%options%multilevel%max_parts + 1
        call next_part(try, whole, state, low, high, found)
        if (.not. found) exit
        call extract_part(self, low, high, error)
        if (allocated(error)) return
        associate (inner => self%inner)
          call whole%cut(state%pressure, self%corner, inner, part%pressure)
          ! the product over the window contains the errors of single precision
          call solve_on_normal_lattice(inner, self%iterate, target, &
                                       self%options%normal%part_tolerance*tolerance, max_sweeps, part, error)
          call self%ranks%agree(error)
          if (allocated(error)) return
          work = work + share_of(inner, whole)*inner%work()
          sweeps = sweeps + part%sweeps
          call new_contact_state(state, whole%lattice, whole%space)
          call whole%paste(inner, self%corner, part%pressure, state%pressure)
        end associate
        state%motion = part%motion
        state%stopped = part%stopped
        call whole%complete_from_pressure(target, tolerance, state, error)
        if (allocated(error)) return
        work = work + whole%work()
        state%sweeps = sweeps
        if (state%converged) return
        if (.not. part%converged) exit
      end do
      if (allocated(self%inner)) deallocate (self%inner)                      ! its memory first
      ! the whole takes no further spectra from the kernel; a part for a smaller load later tabulates it again
      if (.not. whole%iterating) call self%kernel%clear()
      call whole%prepare(self%kernel, .true., .true., space_of(self, whole%lattice), error, self%cache)
      if (allocated(error)) return
      call solve_on_normal_lattice(whole, self%iterate, target, tolerance, max_sweeps, state, error)
      if (allocated(error)) return
      state%sweeps = state%sweeps + sweeps
      work = work + whole%work()
    end associate
  end subroutine solve_finest

  !> Set up the part of the finest lattice between some columns and rows, unless it is set up already.
  !>
  !> No other part is taken, be it large enough: a load gives the same bits whatever came before it.
  subroutine extract_part(self, low, high, error)
    class(normal_contact_t), intent(inout) :: self
    integer, intent(in) :: low(2), high(2)
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error

    if (allocated(self%inner)) then
      if (all(low == self%corner) .and. all(high - low + 1 == self%inner%lattice%extent)) return
      deallocate (self%inner)
    end if
    allocate (self%inner)
    self%corner = low
    call self%level(1)%extract_part(low, high, self%inner)
    call self%inner%prepare(self%kernel, .true., .true., space_of(self, self%inner%lattice), error, self%cache)
    call self%ranks%agree(error)
    if (allocated(error)) deallocate (self%inner)
  end subroutine extract_part

end module hc_normal_contact
