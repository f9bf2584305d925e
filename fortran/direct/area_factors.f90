!> Cholesky factors of a contact area, kept from one area to the next.
!>
!> One scalar matrix stands for all components: K1 between the nodes of the contact, in units of the self-compliance. The
!> pressure has it exactly; the shear traction, times c = 1 + gamma/2, but for what depends on the direction (the part
!> lambda_5 (K_xx - K_1/2), lambda_5 K_xy). Its factor L is made in single precision and in the order stuck, sliding, other nodes:
!> the first rows of L are then the factor of the stuck nodes, and with S = A_22 - L_21 L_21^T a sliding node i with
!> traction tau_i t_i (t across its direction of slip) is left with
!>
!>     T_ij = (t_i . t_j) S_ij + D_i/c delta_ij,
!>
!> the Schur complement of the stuck nodes' two components, exactly. When the area changes the rows of L are kept up to the first
!> node that is not stuck any more; stuck nodes are ordered by their distance from slip and from the edge, so that it comes late.
!>
!> Equations: docs/theory/friction.md, (F7) and "Direct method".
module hc_area_factors
  use, intrinsic :: iso_fortran_env, only: real32, int64
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_memory, only: require_memory
  use hc_lapack, only: spotrf, strsm, ssyrk, strsv, sgemv
  use hc_flexibility_dense, only: dense_flexibility_t
  implicit none
  private

  public :: area_factors_t

  !> A factor of BLAS
  real(real32), parameter :: one = 1.0_real32
  !> Spring, over the self-compliance of a node, that is as good as none; far from the largest number in single precision
  real(wp), parameter :: loosest = 1.0e30_wp

  !> Factors of one area.
  type :: area_factors_t
    !> Nodes of the area: stuck, sliding, others
    integer, allocatable :: order(:)
    !> Numbers of those that are stuck, and that slide
    integer :: n_stuck = 0, n_sliding = 0
    !> Rows that have been factorized so far, by all changes of the area, and rows that there were
    integer :: factorized = 0, wanted = 0
    !> Factor of the shear tractions' matrix over that of the pressure, c
    real(wp), private :: shear = 1.0_wp
    !> Lower factor L of the area; its first `n` rows and columns hold
    real(real32), allocatable, private :: lower(:, :)
    !> S on and below the diagonal; upper factor of T one column to the right
    real(real32), allocatable, private :: across(:, :)
    !> Directions across the slip of the sliding nodes (n_sliding, 2)
    real(real32), allocatable, private :: side(:, :)
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
    self%n_stuck = 0
    self%n_sliding = 0
  end subroutine clear

  !> Factorize the matrix of an area.
  subroutine factorize(self, flexibility, unit, shear, stuck, key, sliding, others, side, compliance, done, error)
    class(area_factors_t), intent(inout) :: self
    !> Influence coefficients
    type(dense_flexibility_t), intent(in) :: flexibility
    !> Self-compliance of a node [m/Pa], and c
    real(wp), intent(in) :: unit, shear
    !> Nodes that stick, and how far each is from slip and from the edge (size(stuck))
    integer, intent(in) :: stuck(:)
    real(wp), intent(in) :: key(:)
    !> Nodes that slip with a spring across, other nodes in contact
    integer, intent(in) :: sliding(:), others(:)
    !> Directions across the slip (2, size(sliding)), and compliances D over the unit
    real(wp), intent(in) :: side(:, :), compliance(:)
    !> False: not positive definite in single precision
    logical, intent(out) :: done
    !> Allocated if there is not enough memory
    type(error_t), allocatable, intent(out) :: error
    integer, allocatable :: before(:)
    integer :: n, kept, n_before, n_slid_before, i, info

    n = size(stuck) + size(sliding) + size(others)
    self%shear = shear
    n_before = 0
    n_slid_before = self%n_sliding
    allocate (before(0))
    if (allocated(self%order)) then
      n_before = self%n_stuck
      call move_alloc(self%order, before)
    end if
    call set_order(self, before(:n_before), stuck, key, kept)
    self%order = [self%order, sliding, others]
    self%n_stuck = size(stuck)
    self%n_sliding = size(sliding)
    self%side = transpose(real(side, real32))
    call reserve(self, n, kept, error)
    if (allocated(error)) return
    done = size(before) == n .and. n_before == self%n_stuck .and. n_slid_before == self%n_sliding
    if (done) done = all(before == self%order)
    self%wanted = self%wanted + n
    if (.not. done) then
      call extend(self, flexibility, unit, kept, size(stuck), .false., info)
      if (info == 0) call extend(self, flexibility, unit, size(stuck), n, .true., info)
      self%factorized = self%factorized + n - kept
      done = info == 0
      if (.not. done) then
        ! nothing can be kept of what fails
        deallocate (self%order)
        self%n_stuck = 0
        return
      end if
    end if
    if (self%n_sliding == 0) return
    associate (t => self%side, s => self%across)
      do i = 1, self%n_sliding
        s(:i, i + 1) = s(i, :i)*(t(:i, 1)*t(i, 1) + t(:i, 2)*t(i, 2))
        s(i, i + 1) = s(i, i + 1) + real(min(compliance(i)/shear, loosest), real32)
      end do
      call spotrf('U', self%n_sliding, s(1, 2), self%n_sliding, info)
    end associate
    done = info == 0
  end subroutine factorize

  !> Order stuck nodes as in the last area up to the first that is not stuck any more, the others by their distance from slip.
  subroutine set_order(self, before, stuck, key, kept)
    class(area_factors_t), intent(inout) :: self
    !> Stuck nodes of the last area, in their order
    integer, intent(in) :: before(:)
    !> Nodes that stick now, and their keys
    integer, intent(in) :: stuck(:)
    real(wp), intent(in) :: key(:)
    !> Nodes that stand where they stood
    integer, intent(out) :: kept
    !> Classes that keys are sorted into
    integer, parameter :: n_class = 256
    integer :: last(0:n_class), class(size(stuck)), i, place
    integer, allocatable :: index(:)
    logical :: left(size(stuck))

    allocate (index(max(maxval(stuck), 0)), source=0)
    index(stuck) = [(i, i=1, size(stuck))]
    left = .true.
    do kept = 0, size(before) - 1
      if (before(kept + 1) > size(index)) exit
      place = index(before(kept + 1))
      if (place == 0) exit
      left(place) = .false.
    end do
    allocate (self%order(size(stuck)))
    self%order(:kept) = before(:kept)
    last = 0
    class = 1 + min(int((1.0_wp - min(max(key, 0.0_wp), 1.0_wp))*n_class), n_class - 1)
    do i = 1, size(stuck)
      if (left(i)) last(class(i)) = last(class(i)) + 1
    end do
    last(0) = kept
    do i = 1, n_class
      last(i) = last(i) + last(i - 1)
    end do
    do i = size(stuck), 1, -1
      if (.not. left(i)) cycle
      self%order(last(class(i))) = stuck(i)
      last(class(i)) = last(class(i)) - 1
    end do
  end subroutine set_order

  !> Reserve memory for the factors of n nodes; the first rows stay.
  subroutine reserve(self, n, kept, error)
    class(area_factors_t), intent(inout) :: self
    !> Nodes, and rows that stay
    integer, intent(in) :: n, kept
    !> Allocated if there is not enough memory
    type(error_t), allocatable, intent(out) :: error
    real(real32), allocatable :: wider(:, :)
    integer :: room

    if (allocated(self%lower)) then
      room = size(self%lower, 1)
    else
      room = 0
    end if
    if (room < n) then
      room = n + n/10
      call require_memory(2*int(room, int64)**2, error)
      if (allocated(error)) return
      allocate (wider(room, room))
      if (kept > 0) wider(:kept, :kept) = self%lower(:kept, :kept)
      call move_alloc(wider, self%lower)
    end if
    if (allocated(self%across)) then
      if (size(self%across, 1) == self%n_sliding) return
      deallocate (self%across)
    end if
    call require_memory(4*int(self%n_sliding, int64)**2, error)
    if (allocated(error)) return
    allocate (self%across(self%n_sliding, self%n_sliding + 1))
  end subroutine reserve

  !> Add rows to L.
  subroutine extend(self, flexibility, unit, from, to, with_schur, info)
    class(area_factors_t), intent(inout) :: self
    type(dense_flexibility_t), intent(in) :: flexibility
    !> Self-compliance of a node [m/Pa]
    real(wp), intent(in) :: unit
    !> Rows that there are, and that there shall be
    integer, intent(in) :: from, to
    !> S of the sliding nodes, which come next, is wanted
    logical, intent(in) :: with_schur
    !> Not zero: not positive definite
    integer, intent(out) :: info
    integer :: i, n, room

    info = 0
    n = to - from
    room = size(self%lower, 1)
    if (n == 0) return
    associate (a => self%lower, order => self%order)
      !$omp parallel do schedule(dynamic, 32) if (to > 1000)
      do i = 1, to
        a(max(i, from + 1):to, i) = real(flexibility%normal_influence(order(max(i, from + 1):to), order(i))/unit, real32)
      end do
      !$omp end parallel do
      if (from > 0) then
        call strsm('R', 'L', 'T', 'N', n, from, one, a, room, a(from + 1, 1), room)
        call ssyrk('L', 'N', n, from, -one, a(from + 1, 1), room, one, a(from + 1, from + 1), room)
      end if
      if (with_schur) then
        do i = 1, self%n_sliding
          self%across(i:, i) = a(from + i:from + self%n_sliding, from + i)
        end do
      end if
      call spotrf('L', n, a(from + 1, from + 1), room, info)
    end associate
  end subroutine extend

  !> Find tractions from displacements, nearly: pressure of all nodes, both components of the stuck, tau of the sliding ones.
  subroutine apply(self, given, found)
    class(area_factors_t), intent(in) :: self
    !> Displacements over the unit
    real(wp), intent(in) :: given(:)
    !> Tractions
    real(wp), intent(out) :: found(:)
    real(real32) :: p(size(self%order)), q(self%n_stuck, 2), tau(self%n_sliding), part(self%n_sliding)
    real(wp) :: scale
    integer :: i, n, room

    n = size(self%order)
    room = size(self%lower, 1)
    found = 0.0_wp
    ! as numbers about 1, which single precision can hold
    scale = maxval(abs(given))
    if (.not. scale > 0.0_wp) return
    associate (l => self%lower, s => self%n_stuck, m => self%n_sliding)
      if (any(abs(given(:n)) > 0.0_wp)) then
        p = real(given(:n)/scale, real32)
        call strsv('L', 'N', 'N', n, l, room, p, 1)
        call strsv('L', 'T', 'N', n, l, room, p, 1)
        found(:n) = scale*p
      end if
      if (.not. any(abs(given(n + 1:)) > 0.0_wp)) return
      q = reshape(real(given(n + 1:n + 2*s)/scale, real32), [s, 2])
      tau = real(given(n + 2*s + 1:)/scale, real32)
      do i = 1, 2
        call strsv('L', 'N', 'N', s, l, room, q(:, i), 1)
        if (min(s, m) == 0) cycle
        call sgemv('N', m, s, one, l(s + 1, 1), room, q(:, i), 1, 0.0_real32, part, 1)
        tau = tau - self%side(:, i)*part
      end do
      if (m > 0) then
        call strsv('U', 'T', 'N', m, self%across(1, 2), m, tau, 1)
        call strsv('U', 'N', 'N', m, self%across(1, 2), m, tau, 1)
      end if
      do i = 1, 2
        part = self%side(:, i)*tau
        if (min(s, m) > 0) call sgemv('T', m, s, -one, l(s + 1, 1), room, part, 1, one, q(:, i), 1)
        call strsv('L', 'T', 'N', s, l, room, q(:, i), 1)
      end do
      found(n + 1:n + 2*s) = scale/self%shear*reshape(q, [2*s])
      found(n + 2*s + 1:) = scale/self%shear*tau
    end associate
  end subroutine apply

end module hc_area_factors
