!> Conjugate gradients on a set of active nodes, with linear constraints.
!>
!> Solves, for the unknowns on the active nodes (the others stay as they are),
!>
!>     A x - B m = rhs   on the active nodes,     B^T x = as at the start,
!>
!> where m are the multipliers: in contact, x the tractions, m the rigid
!> motions and B^T x the resultants. The constraints are held exactly by
!> projecting the preconditioned residual,
!>
!>     z <- M r - M B (B^T M B)^-1 B^T M r.
module hc_krylov
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_lapack, only: dposv
  implicit none
  private

  public :: linear_system_t, projected_cg, dot

  !> Terms of a sum that are added up by one thread: the result does not depend on their number.
  integer, parameter :: sum_block = 4096

  !> A symmetric positive definite operator with a preconditioner, on fields that
  !> are kept as vectors over all nodes.
  type, abstract :: linear_system_t
    !> Threads that share the vector operations
    integer :: n_threads = 1
  contains
    !> y = A x for an x that vanishes off the active nodes; y is wanted everywhere
    procedure(linear_map), deferred :: product
    !> z = M r for an r that vanishes off the active nodes; z is used on them only
    procedure(linear_map), deferred :: precondition
  end type linear_system_t

  abstract interface
    subroutine linear_map(self, x, y, error)
      import :: linear_system_t, wp, error_t
      class(linear_system_t), intent(inout) :: self
      !> Argument
      real(wp), intent(in), contiguous, target :: x(:)
      !> Value
      real(wp), intent(out), contiguous, target :: y(:)
      !> Allocated on failure
      type(error_t), allocatable, intent(out) :: error
    end subroutine linear_map
  end interface

contains

  !> Preconditioned conjugate gradients with projection on the constraints.
  subroutine projected_cg(system, active, constraint, rhs, x, ax, tolerance, max_iterations, &
                          multiplier, residual, iterations, error)
    !> Operator and preconditioner
    class(linear_system_t), intent(inout) :: system
    !> Nodes that carry unknowns (n)
    logical, intent(in) :: active(:)
    !> Constraint vectors (n, number of constraints, may be 0), zero off the active nodes
    real(wp), intent(in) :: constraint(:, :)
    !> Right-hand side (n)
    real(wp), intent(in) :: rhs(:)
    !> Unknowns (n), on entry a start that fulfils the constraints
    real(wp), intent(inout), contiguous :: x(:)
    !> Product A x (n), everywhere, kept up to date
    real(wp), intent(inout), contiguous :: ax(:)
    !> The largest residual that is allowed on an active node
    real(wp), intent(in) :: tolerance
    !> Iterations allowed
    integer, intent(in) :: max_iterations
    !> Multipliers of the constraints
    real(wp), intent(out) :: multiplier(:)
    !> The largest residual on an active node
    real(wp), intent(out) :: residual
    !> Iterations taken
    integer, intent(out) :: iterations
    !> Allocated on failure: the operator is not positive definite
    type(error_t), allocatable, intent(out) :: error

    real(wp), allocatable :: r(:), z(:), d(:), ad(:), mb(:, :)
    real(wp) :: rz, rz_old, curvature, step, correction(size(constraint, 2))
    integer :: n, i, m, n_threads

    n = size(x)
    n_threads = system%n_threads
    allocate (r(n), z(n), d(n), ad(n), mb(n, size(constraint, 2)))
    do m = 1, size(constraint, 2)
      call system%precondition(constraint(:, m), mb(:, m), error)
      if (allocated(error)) return
      where (.not. active) mb(:, m) = 0.0_wp
    end do

    iterations = 0
    rz_old = 0.0_wp
    do m = 1, size(multiplier)
      multiplier(m) = dot(constraint(:, m), ax - rhs, n_threads)/dot(constraint(:, m), constraint(:, m), n_threads)
    end do
    do
      ! The share of the constraints is taken out of the residual before it is
      ! preconditioned: it is the larger part by far, and its rounding errors would stay.
      call constrained_residual(active, constraint, multiplier, rhs, ax, r, residual, n_threads)
      call system%precondition(r, z, error)
      if (allocated(error)) return
      call project(active, constraint, mb, z, correction, n_threads)
      multiplier = multiplier - correction
      call constrained_residual(active, constraint, multiplier, rhs, ax, r, residual, n_threads)
      if (residual <= tolerance .or. iterations >= max_iterations) exit

      rz = dot(r, z, n_threads)
      step = 0.0_wp
      if (iterations > 0) step = rz/rz_old
      rz_old = rz
      !$omp parallel do schedule(static) num_threads(n_threads)
      do i = 1, n
        if (iterations > 0) then
          d(i) = z(i) + step*d(i)
        else
          d(i) = z(i)
        end if
      end do
      !$omp end parallel do
      call system%product(d, ad, error)
      if (allocated(error)) return
      curvature = dot(d, ad, n_threads)
      if (.not. curvature > 0.0_wp) then
        ! nothing is left to gain in working precision
        if (.not. rz > 0.0_wp) exit
        call raise(error, status%no_convergence, 'the flexibility operator is not positive definite on the active nodes')
        return
      end if
      step = rz/curvature
      !$omp parallel do schedule(static) num_threads(n_threads)
      do i = 1, n
        x(i) = x(i) + step*d(i)
        ax(i) = ax(i) + step*ad(i)
      end do
      !$omp end parallel do
      iterations = iterations + 1
    end do
  end subroutine projected_cg

  !> r = rhs - A x + B m on the active nodes, zero elsewhere, and its largest element.
  subroutine constrained_residual(active, constraint, multiplier, rhs, ax, r, largest, n_threads)
    !> Active nodes
    logical, intent(in) :: active(:)
    !> Constraint vectors and multipliers
    real(wp), intent(in) :: constraint(:, :), multiplier(:)
    !> Right-hand side and product A x
    real(wp), intent(in) :: rhs(:), ax(:)
    !> Residual
    real(wp), intent(out) :: r(:)
    !> Its largest element
    real(wp), intent(out) :: largest
    !> Threads to use
    integer, intent(in) :: n_threads
    integer :: i

    largest = 0.0_wp
    !$omp parallel do schedule(static) num_threads(n_threads) reduction(max: largest)
    do i = 1, size(r)
      r(i) = 0.0_wp
      if (.not. active(i)) cycle
      r(i) = rhs(i) - ax(i) + dot_product(constraint(i, :), multiplier)
      largest = max(largest, abs(r(i)))
    end do
    !$omp end parallel do
  end subroutine constrained_residual

  !> z <- z - M B (B^T M B)^-1 B^T z on the active nodes, zero elsewhere.
  subroutine project(active, constraint, mb, z, share, n_threads)
    !> Active nodes
    logical, intent(in) :: active(:)
    !> B and M B
    real(wp), intent(in) :: constraint(:, :), mb(:, :)
    !> Vector to be projected
    real(wp), intent(inout) :: z(:)
    !> (B^T M B)^-1 B^T z: how much of B is in the residual
    real(wp), intent(out) :: share(:)
    !> Threads to use
    integer, intent(in) :: n_threads

    real(wp) :: gram(size(mb, 2), size(mb, 2))
    integer :: i, m, k, info

    !$omp parallel do schedule(static) num_threads(n_threads)
    do i = 1, size(z)
      if (.not. active(i)) z(i) = 0.0_wp
    end do
    !$omp end parallel do
    if (size(mb, 2) == 0) return
    do m = 1, size(mb, 2)
      share(m) = dot(constraint(:, m), z, n_threads)
      do k = 1, size(mb, 2)
        gram(k, m) = dot(constraint(:, k), mb(:, m), n_threads)
      end do
    end do
    call dposv('U', size(mb, 2), 1, gram, size(mb, 2), share, size(mb, 2), info)
    do m = 1, size(mb, 2)
      !$omp parallel do schedule(static) num_threads(n_threads)
      do i = 1, size(z)
        z(i) = z(i) - share(m)*mb(i, m)
      end do
      !$omp end parallel do
    end do
  end subroutine project

  !> Scalar product, summed in fixed blocks.
  real(wp) function dot(a, b, n_threads)
    !> Vectors of equal length
    real(wp), intent(in) :: a(:), b(:)
    !> Threads to use
    integer, intent(in) :: n_threads
    real(wp) :: part((size(a) + sum_block - 1)/sum_block)
    integer :: k, from, to

    !$omp parallel do schedule(static) num_threads(n_threads) private(from, to)
    do k = 1, size(part)
      from = (k - 1)*sum_block + 1
      to = min(k*sum_block, size(a))
      part(k) = dot_product(a(from:to), b(from:to))
    end do
    !$omp end parallel do
    dot = sum(part)
  end function dot

end module hc_krylov
