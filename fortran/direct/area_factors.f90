!> Cholesky factors of a contact area, kept from one area to the next.
!>
!> One scalar matrix stands for all components: K1 between the nodes of the contact, in units of the self-compliance. The
!> pressure has it exactly; the shear traction, times c = 1 + gamma/2, without the part that depends on the direction
!> (lambda_5 (K_xx - K_1/2), lambda_5 K_xy). Its factor L is made in single precision; nodes that are sure to stick, the core,
!> come first. With S = A_22 - L_21 L_21^T an unknown of another node, of direction t_i and magnitude tau_i, is left with
!>
!>     T_ij = (t_i . t_j) S_ij + D_i/c delta_ij,
!>
!> the Schur complement of the core's two components, exactly. A sliding node has one of them, across its
!> slip; a sticking one that is not of the core has two. So zones may change without a change of L. Nodes that come into contact
!> get rows at its end; those that leave it keep theirs, and their pressure is held at 0.
!>
!> Equations: docs/theory/friction.md, (F7) and "Direct method".
module hc_area_factors
  use, intrinsic :: iso_fortran_env, only: real32, int64
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_memory, only: require_memory
  use hc_options, only: direct_options_t
  use hc_lapack, only: spotrf, spotrs, strsm, strsv, ssyrk, sgemm, sgemv
  use hc_flexibility_dense, only: dense_flexibility_t
  implicit none
  private

  public :: area_factors_t, factored_area_t

  !> A factor of BLAS
  real(real32), parameter :: one = 1.0_real32, none = 0.0_real32
  !> Spring, over the self-compliance of a node, that is as good as none; far from the largest number in single precision
  real(wp), parameter :: loosest = 1.0e30_wp

  !> An area that is to be factorized.
  type :: factored_area_t
    !> Nodes in contact; those that stick, and which of these certainly remain in stick; those that slip with a spring across
    integer, allocatable :: contact(:), stuck(:)
    logical, allocatable :: is_core(:)
    integer, allocatable :: sliding(:)
    !> Directions across the slip (2, size(sliding)), and compliances D over the unit
    real(wp), allocatable :: side(:, :), compliance(:)
  end type factored_area_t

  !> Factors of one area.
  type :: area_factors_t
    !> Rows of L that have been made so far, and those that all areas would have needed
    integer :: factorized = 0, wanted = 0
    !> Nodes of the rows of L, the core first; the row of each node of the window, or 0
    integer, allocatable, private :: order(:), row(:)
    integer, private :: n_core = 0
    !> Factor of the shear tractions' matrix over that of the pressure, c
    real(wp), private :: shear = 1.0_wp
    !> L on and below the diagonal; above it S of the rows behind the core, whose diagonal is apart
    real(real32), allocatable, private :: lower(:, :), diagonal(:)
    !> Rows of the nodes in contact, of those that stick, and of those that slide with a spring
    integer, allocatable, private :: pressed(:), stuck(:), sliding(:)
    !> Rows of nodes that have left the contact; W and the factor of W^T W
    integer, allocatable, private :: gone(:)
    real(real32), allocatable, private :: away(:, :), gram(:, :)
    !> Unknowns of T: row behind the core, direction (:, 2) and spring; upper factor of T
    integer, allocatable, private :: behind(:)
    real(real32), allocatable, private :: side(:, :), spring(:), across(:, :)
  contains
    !> Factorize another area
    procedure :: factorize
    !> Keep no rows for the next area
    procedure :: clear
    !> Find tractions from displacements, nearly
    procedure :: apply
  end type area_factors_t

contains

  !> Keep no rows of the last area for the next one.
  subroutine clear(self)
    class(area_factors_t), intent(inout) :: self

    if (allocated(self%order)) deallocate (self%order)
    if (allocated(self%behind)) deallocate (self%behind)
    self%n_core = 0
  end subroutine clear

  !> Factorize the matrix of an area.
  subroutine factorize(self, flexibility, unit, shear, options, area, done, error)
    class(area_factors_t), intent(inout) :: self
    !> Influence coefficients
    type(dense_flexibility_t), intent(in) :: flexibility
    !> Self-compliance of a node [m/Pa], and c
    real(wp), intent(in) :: unit, shear
    !> Largest changes since L and T were made
    type(direct_options_t), intent(in) :: options
    !> The area
    type(factored_area_t), intent(in) :: area
    !> False: not positive definite in single precision
    logical, intent(out) :: done
    !> Allocated if there is not enough memory
    type(error_t), allocatable, intent(out) :: error
    logical :: is_here(flexibility%lattice%size())
    integer, allocatable :: new(:)
    integer :: i, info

    is_here = .false.
    is_here(area%contact) = .true.
    self%shear = shear
    self%wanted = self%wanted + size(area%contact)
    info = 0
    if (is_kept(self, options%most_exchanged, area%contact, area%stuck, is_here)) then
      new = pack(area%contact, self%row(area%contact) == 0)
      if (size(new) > 0) call add_rows(self, flexibility, unit, new, info, error)
    else
      call self%clear()
      self%n_core = count(area%is_core)
      is_here(pack(area%stuck, area%is_core)) = .false.
      new = [pack(area%stuck, area%is_core), pack(area%contact, is_here(area%contact))]
      is_here(area%contact) = .true.
      self%order = [integer ::]
      if (allocated(self%row)) deallocate (self%row)
      allocate (self%row(size(is_here)), source=0)
      call add_rows(self, flexibility, unit, new, info, error)
    end if
    if (allocated(error)) return
    if (info == 0) then
      self%pressed = self%row(area%contact)
      self%stuck = self%row(area%stuck)
      self%sliding = self%row(area%sliding)
      self%gone = pack([(i, i=1, size(self%order))],.not. is_here(self%order))
      call hold_gone(self, info, error)
      if (allocated(error)) return
    end if
    if (info == 0) call factorize_across(self, area%side, area%compliance, options%largest_turn, info, error)
    done = info == 0
    ! a failed factor cannot be kept
    if (.not. done) call self%clear()
  end subroutine factorize

  !> Return whether the rows of L serve another area.
  pure logical function is_kept(self, most_exchanged, contact, stuck, is_here)
    type(area_factors_t), intent(in) :: self
    !> Largest share of rows that were added or deleted
    real(wp), intent(in) :: most_exchanged
    !> Nodes in contact and those that stick; which of the window are in contact
    integer, intent(in) :: contact(:), stuck(:)
    logical, intent(in) :: is_here(:)
    integer :: n

    is_kept = allocated(self%order)
    if (.not. is_kept) return
    n = size(self%order)
    ! all of the core still sticks
    is_kept = count(self%row(stuck) > 0 .and. self%row(stuck) <= self%n_core) == self%n_core .and. &
              count(self%row(contact) == 0) + count(.not. is_here(self%order)) <= most_exchanged*n
  end function is_kept

  !> Add the rows of some nodes to L, and to S.
  subroutine add_rows(self, flexibility, unit, new, info, error)
    type(area_factors_t), intent(inout) :: self
    type(dense_flexibility_t), intent(in) :: flexibility
    !> Self-compliance of a node [m/Pa]
    real(wp), intent(in) :: unit
    !> Nodes; the core is among them if there are no rows yet
    integer, intent(in) :: new(:)
    !> Not zero: not positive definite
    integer, intent(out) :: info
    !> Allocated if there is not enough memory
    type(error_t), allocatable, intent(out) :: error
    integer :: from, to, i

    from = size(self%order)
    to = from + size(new)
    call reserve(self, to, from, error)
    if (allocated(error)) return
    self%order = [self%order, new]
    self%row(new) = [(i, i=from + 1, to)]
    self%factorized = self%factorized + size(new)
    info = 0
    if (from < self%n_core) then
      call extend(self, flexibility, unit, from, self%n_core, info)
      from = self%n_core
    end if
    if (info == 0 .and. to > from) call extend(self, flexibility, unit, from, to, info)
  end subroutine add_rows

  !> Reserve memory for n rows; the first rows stay.
  subroutine reserve(self, n, kept, error)
    type(area_factors_t), intent(inout) :: self
    !> Rows, and those that stay
    integer, intent(in) :: n, kept
    !> Allocated if there is not enough memory
    type(error_t), allocatable, intent(out) :: error
    real(real32), allocatable :: wider(:, :), longer(:)
    integer :: room

    room = 0
    if (allocated(self%lower)) room = size(self%lower, 1)
    if (room >= n) return
    room = n + n/10
    if (kept == 0 .and. allocated(self%lower)) deallocate (self%lower, self%diagonal)
    call require_memory(4*int(room, int64)**2, error)
    if (allocated(error)) return
    allocate (wider(room, room), longer(room))
    if (kept > 0) then
      wider(:kept, :kept) = self%lower(:kept, :kept)
      longer(:kept) = self%diagonal(:kept)
    end if
    call move_alloc(wider, self%lower)
    call move_alloc(longer, self%diagonal)
  end subroutine reserve

  !> Make rows of L, and of S if they are behind the core.
  subroutine extend(self, flexibility, unit, from, to, info)
    type(area_factors_t), intent(inout) :: self
    type(dense_flexibility_t), intent(in) :: flexibility
    !> Self-compliance of a node [m/Pa]
    real(wp), intent(in) :: unit
    !> Rows that there are, and that there shall be
    integer, intent(in) :: from, to
    !> Not zero: not positive definite
    integer, intent(out) :: info
    real(real32), allocatable :: part(:, :)
    integer :: i, n, m, room

    n = to - from
    room = size(self%lower, 1)
    associate (a => self%lower, order => self%order, core => self%n_core)
      !$omp parallel do schedule(dynamic, 32) if (to > 1000)
      do i = 1, to
        a(max(i, from + 1):to, i) = real(flexibility%normal_influence(order(max(i, from + 1):to), order(i))/unit, real32)
      end do
      !$omp end parallel do
      ! S between these rows and those before that are behind the core: A - L_21 L_21^T
      m = max(from - core, 0)
      allocate (part(n, m))
      part = a(from + 1:to, core + 1:core + m)
      if (core > 0 .and. from >= core) then
        call strsm('R', 'L', 'T', 'N', n, core, one, a, room, a(from + 1, 1), room)
        if (m > 0) call sgemm('N', 'T', n, m, core, -one, a(from + 1, 1), room, a(core + 1, 1), room, one, part, n)
        call ssyrk('L', 'N', n, core, -one, a(from + 1, 1), room, one, a(from + 1, from + 1), room)
      end if
      if (from >= core) then
        do i = from + 1, to
          self%diagonal(i) = a(i, i)
          a(from + 1:i - 1, i) = a(i, from + 1:i - 1)
          a(core + 1:core + m, i) = part(i - from, :)
        end do
      end if
      if (m > 0) then
        ! the columns behind the core
        a(from + 1:to, core + 1:from) = part
        call strsm('R', 'L', 'T', 'N', n, m, one, a(core + 1, core + 1), room, a(from + 1, core + 1), room)
        call ssyrk('L', 'N', n, m, -one, a(from + 1, core + 1), room, one, a(from + 1, from + 1), room)
      end if
      call spotrf('L', n, a(from + 1, from + 1), room, info)
    end associate
  end subroutine extend

  !> Compute the constraints of zero pressure at nodes that have left the contact: W, and the factor of W^T W.
  subroutine hold_gone(self, info, error)
    type(area_factors_t), intent(inout) :: self
    !> Not zero: not positive definite
    integer, intent(out) :: info
    !> Allocated if there is not enough memory
    type(error_t), allocatable, intent(out) :: error
    integer :: i, k, n, room

    info = 0
    if (allocated(self%away)) deallocate (self%away, self%gram)
    k = size(self%gone)
    if (k == 0) return
    n = size(self%order)
    room = size(self%lower, 1)
    call require_memory(4*int(k, int64)*(n + k), error)
    if (allocated(error)) return
    allocate (self%away(n, k), source=none)
    allocate (self%gram(k, k), source=none)
    do i = 1, k
      self%away(self%gone(i), i) = one
    end do
    call strsm('L', 'L', 'N', 'N', n, k, one, self%lower, room, self%away, n)
    call ssyrk('L', 'T', k, n, one, self%away, n, none, self%gram, k)
    call spotrf('L', k, self%gram, k, info)
  end subroutine hold_gone

  !> Factorize T, unless the last one is nearly the same.
  subroutine factorize_across(self, side, compliance, largest_turn, info, error)
    type(area_factors_t), intent(inout) :: self
    !> Directions across the slip (2, number of sliding nodes), and compliances D over the unit
    real(wp), intent(in) :: side(:, :), compliance(:)
    !> Change of a direction, and of D over the whole compliance of a node, that counts as nearly the same
    real(wp), intent(in) :: largest_turn
    !> Not zero: not positive definite
    integer, intent(out) :: info
    !> Allocated if there is not enough memory
    type(error_t), allocatable, intent(out) :: error
    integer, allocatable :: row(:)
    real(real32), allocatable :: t(:, :), d(:)
    integer :: i, j, m, n, room

    info = 0
    row = pack(self%stuck, self%stuck > self%n_core)
    n = size(row)
    row = [row, row, self%sliding]
    m = size(row)
    allocate (t(m, 2), d(m), source=none)
    t(:n, 1) = one
    t(n + 1:2*n, 2) = one
    t(2*n + 1:, :) = transpose(real(side, real32))
    d(2*n + 1:) = real(min(compliance/self%shear, loosest), real32)
    if (allocated(self%behind)) then
      if (is_like(self, row, t, d, real(largest_turn, real32))) return
      deallocate (self%behind)
    end if
    room = 0
    if (allocated(self%across)) room = size(self%across, 1)
    if (room < m) then
      if (room > 0) deallocate (self%across)
      ! later areas have more unknowns: memory that is not touched costs nothing, a hole in the heap does
      room = max(m, size(self%order))
      room = room + room/10
      call require_memory(4*int(room, int64)**2, error)
      if (allocated(error)) return
      allocate (self%across(room, room))
    end if
    !$omp parallel do schedule(dynamic, 32) private(j) if (m > 1000)
    do i = 1, m
      do j = 1, i - 1
        self%across(j, i) = self%lower(min(row(i), row(j)), max(row(i), row(j)))*(t(j, 1)*t(i, 1) + t(j, 2)*t(i, 2))
      end do
      self%across(i, i) = self%diagonal(row(i)) + d(i)
      ! both components of a node are orthogonal
      if (i > n .and. i <= 2*n) self%across(i - n, i) = none
    end do
    !$omp end parallel do
    if (m > 0) call spotrf('U', m, self%across, room, info)
    self%behind = row - self%n_core
    self%side = t
    self%spring = d
  end subroutine factorize_across

  !> Return whether T is nearly that of some unknowns.
  pure logical function is_like(self, row, side, spring, largest_turn)
    type(area_factors_t), intent(in) :: self
    !> Row of each unknown, its direction (:, 2) and spring
    integer, intent(in) :: row(:)
    real(real32), intent(in) :: side(:, :), spring(:)
    !> Change of a direction, and of a spring over the whole compliance of a node, that counts as nearly the same
    real(real32), intent(in) :: largest_turn

    is_like = size(row) == size(self%behind)
    if (is_like) is_like = all(row == self%behind + self%n_core)
    if (is_like) is_like = maxval(abs(side - self%side)) <= largest_turn
    if (is_like) is_like = all(abs(spring - self%spring) <= largest_turn*(self%diagonal(row) + self%spring))
  end function is_like

  !> Find tractions from displacements, nearly: pressure of all nodes, both components of the stuck, tau of the sliding ones.
  subroutine apply(self, given, found)
    class(area_factors_t), intent(in) :: self
    !> Displacements over the unit
    real(wp), intent(in) :: given(:)
    !> Tractions
    real(wp), intent(out) :: found(:)
    real(wp) :: scale
    integer :: n

    n = size(self%pressed)
    found = 0.0_wp
    ! as numbers about 1, which single precision can hold
    scale = maxval(abs(given))
    if (.not. scale > 0.0_wp) return
    if (any(abs(given(:n)) > 0.0_wp)) found(:n) = scale*pressure_of(self, given(:n)/scale)
    if (any(abs(given(n + 1:)) > 0.0_wp)) found(n + 1:) = scale/self%shear*shear_of(self, given(n + 1:)/scale)
  end subroutine apply

  !> Find pressures from displacements.
  function pressure_of(self, given) result(found)
    type(area_factors_t), intent(in) :: self
    !> Displacements of the nodes in contact, and their pressures
    real(wp), intent(in) :: given(:)
    real(wp) :: found(size(given))
    real(real32) :: p(size(self%order)), part(size(self%gone), 1)
    integer :: n, k, room, info

    n = size(self%order)
    k = size(self%gone)
    room = size(self%lower, 1)
    p = none
    p(self%pressed) = real(given, real32)
    call strsv('L', 'N', 'N', n, self%lower, room, p, 1)
    if (k > 0) then
      call sgemv('T', n, k, one, self%away, n, p, 1, none, part, 1)
      call spotrs('L', k, 1, self%gram, k, part, k, info)
      call sgemv('N', n, k, -one, self%away, n, part, 1, one, p, 1)
    end if
    call strsv('L', 'T', 'N', n, self%lower, room, p, 1)
    found = p(self%pressed)
  end function pressure_of

  !> Find shear tractions from displacements, c left out.
  function shear_of(self, given) result(found)
    type(area_factors_t), intent(in) :: self
    !> Displacements of both components of the stuck nodes and of tau of the sliding ones, and their tractions
    real(wp), intent(in) :: given(:)
    real(wp) :: found(size(given))
    real(real32) :: q(self%n_core, 2), tau(size(self%behind)), part(size(self%order) - self%n_core)
    integer, allocatable :: sure(:), unsure(:)
    integer :: i, k, m, n, s, room

    s = size(self%stuck)
    m = size(tau)
    room = size(self%lower, 1)
    sure = pack([(i, i=1, s)], self%stuck <= self%n_core)
    unsure = pack([(i, i=1, s)], self%stuck > self%n_core)
    n = size(unsure)
    tau(:n) = real(given(unsure), real32)
    tau(n + 1:2*n) = real(given(s + unsure), real32)
    tau(2*n + 1:) = real(given(2*s + 1:), real32)
    associate (l => self%lower, core => self%n_core)
      do i = 1, 2
        if (core == 0) exit
        q(self%stuck(sure), i) = real(given((i - 1)*s + sure), real32)
        call strsv('L', 'N', 'N', core, l, room, q(:, i), 1)
        if (m == 0) cycle
        call sgemv('N', size(part), core, one, l(core + 1, 1), room, q(:, i), 1, none, part, 1)
        tau = tau - self%side(:, i)*part(self%behind)
      end do
      if (m > 0) then
        call strsv('U', 'T', 'N', m, self%across, size(self%across, 1), tau, 1)
        call strsv('U', 'N', 'N', m, self%across, size(self%across, 1), tau, 1)
      end if
      do i = 1, 2
        if (core == 0) exit
        if (m > 0) then
          part = none
          do k = 1, m
            part(self%behind(k)) = part(self%behind(k)) + self%side(k, i)*tau(k)
          end do
          call sgemv('T', size(part), core, -one, l(core + 1, 1), room, part, 1, one, q(:, i), 1)
        end if
        call strsv('L', 'T', 'N', core, l, room, q(:, i), 1)
        found((i - 1)*s + sure) = q(self%stuck(sure), i)
      end do
    end associate
    found(unsure) = tau(:n)
    found(s + unsure) = tau(n + 1:2*n)
    found(2*s + 1:) = tau(2*n + 1:)
  end function shear_of

end module hc_area_factors
