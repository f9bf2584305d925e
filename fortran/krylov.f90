!> Conjugate gradients and GMRES on a set of active nodes, with linear constraints.
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
!>
!> For a matrix that is not symmetric, and constraints C^T x whose multipliers act
!> along other vectors B, GMRES does the same with (C^T M B)^-1 C^T.
module hc_krylov
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_lapack, only: ddot, dgesv
  implicit none
  private

  public :: linear_system_t, projected_cg, projected_gmres, precondition_constraints, fulfil, dot

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

  !> Pivot of the scaled constraints below which they count as dependent.
  real(wp), parameter :: dependence = 1.0e-12_wp

contains

  !> M B, the constraint vectors after the preconditioner, zero off the active nodes.
  subroutine precondition_constraints(system, active, constraint, mb, error)
    !> Operator and preconditioner
    class(linear_system_t), intent(inout) :: system
    !> Nodes that carry unknowns (n)
    logical, intent(in) :: active(:)
    !> Constraint vectors B (n, number of constraints), zero off the active nodes
    real(wp), intent(in) :: constraint(:, :)
    !> M B (n, number of constraints)
    real(wp), allocatable, intent(out) :: mb(:, :)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    integer :: m

    allocate (mb(size(constraint, 1), size(constraint, 2)))
    do m = 1, size(constraint, 2)
      call system%precondition(constraint(:, m), mb(:, m), error)
      if (allocated(error)) return
      where (.not. active) mb(:, m) = 0.0_wp
    end do
  end subroutine precondition_constraints

  !> x <- x + M B (C^T M B)^-1 missing: make C^T x what it should be; mostly C is B.
  !>
  !> M B is about the traction that a rigid motion of the active nodes causes.
  subroutine fulfil(rows, mb, missing, x, independent, n_threads)
    !> C and M B
    real(wp), intent(in) :: rows(:, :), mb(:, :)
    !> What C^T x lacks
    real(wp), intent(in) :: missing(:)
    !> Unknowns
    real(wp), intent(inout) :: x(:)
    !> False where the constraints depend on each other: x is left alone
    logical, intent(out) :: independent
    !> Threads to use
    integer, intent(in) :: n_threads
    real(wp) :: share(size(missing)), inverse(size(missing), size(missing))
    integer :: m

    call invert_gram(rows, mb, inverse, independent, n_threads)
    if (.not. independent) return
    share = [(dot_product(inverse(m, :), missing), m=1, size(share))]
    do m = 1, size(missing)
      x = x + share(m)*mb(:, m)
    end do
  end subroutine fulfil

  !> (C^T M B)^-1, zero if the constraints depend on each other.
  subroutine invert_gram(rows, mb, inverse, independent, n_threads)
    !> C and M B
    real(wp), intent(in) :: rows(:, :), mb(:, :)
    !> The inverse
    real(wp), intent(out) :: inverse(:, :)
    !> The matrix can be inverted
    logical, intent(out) :: independent
    !> Threads to use
    integer, intent(in) :: n_threads
    real(wp) :: gram(size(mb, 2), size(mb, 2)), scale(size(mb, 2))
    integer :: m, k, info, pivot(size(mb, 2))

    independent = .true.
    inverse = 0.0_wp
    if (size(mb, 2) == 0) return
    do m = 1, size(mb, 2)
      do k = 1, size(mb, 2)
        gram(k, m) = dot(rows(:, k), mb(:, m), n_threads)
      end do
      scale(m) = gram(m, m)
    end do
    independent = all(scale > 0.0_wp)
    if (.not. independent) return
    scale = sqrt(scale)
    do m = 1, size(mb, 2)
      gram(:, m) = gram(:, m)/(scale*scale(m))
      inverse(m, m) = 1.0_wp/scale(m)
    end do
    call dgesv(size(mb, 2), size(mb, 2), gram, size(mb, 2), pivot, inverse, size(mb, 2), info)
    independent = info == 0 .and. all([(abs(gram(m, m)), m=1, size(mb, 2))] > dependence)
    inverse = inverse/spread(scale, 2, size(mb, 2))
    if (.not. independent) inverse = 0.0_wp
  end subroutine invert_gram

  !> Preconditioned conjugate gradients with projection on the constraints.
  subroutine projected_cg(system, active, constraint, mb, rhs, x, ax, tolerance, max_iterations, &
                          multiplier, residual, iterations, error)
    !> Operator and preconditioner
    class(linear_system_t), intent(inout) :: system
    !> Nodes that carry unknowns (n)
    logical, intent(in) :: active(:)
    !> Constraint vectors B (n, number of constraints, may be 0), zero off the active nodes, and M B
    real(wp), intent(in) :: constraint(:, :), mb(:, :)
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
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    real(wp), allocatable :: r(:), z(:), d(:), ad(:)
    real(wp) :: rz, rz_old, curvature, step, correction(size(constraint, 2))
    real(wp) :: inverse(size(constraint, 2), size(constraint, 2))
    integer :: n, i, m, n_threads
    logical :: independent

    n = size(x)
    n_threads = system%n_threads
    allocate (r(n), z(n), d(n), ad(n))
    call invert_gram(constraint, mb, inverse, independent, n_threads)
    iterations = 0
    rz_old = 0.0_wp
    do m = 1, size(multiplier)
      multiplier(m) = dot(constraint(:, m), ax - rhs, n_threads)/dot(constraint(:, m), constraint(:, m), n_threads)
    end do
    do
      ! The share of the constraints is taken out of the residual before it is
      ! preconditioned: it is the larger part by far, and its rounding errors would stay.
      ! What is left is normal to M B, which keeps the projected preconditioner
      ! symmetric even if the given M B is not quite what its name says.
      call constrained_residual(active, constraint, multiplier, rhs, ax, r, residual, n_threads)
      do m = 1, size(multiplier)
        correction(m) = dot(mb(:, m), r, n_threads)
      end do
      if (size(multiplier) > 0) then
        correction = [(dot_product(inverse(:, m), correction), m=1, size(correction))]
        multiplier = multiplier - correction
        call constrained_residual(active, constraint, multiplier, rhs, ax, r, residual, n_threads)
      end if
      if (residual <= tolerance .or. iterations >= max_iterations) exit
      call system%precondition(r, z, error)
      if (allocated(error)) return
      call project(active, constraint, mb, inverse, z, n_threads)

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
      ! nothing is left to gain in working precision
      if (.not. curvature > 0.0_wp) exit
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

  !> GMRES, preconditioned from the right, with the constraints C^T x held exactly.
  subroutine projected_gmres(system, active, columns, mb, rows, weight, rhs, x, ax, tolerance, max_iterations, &
                             multiplier, independent, iterations, error)
    !> Operator and preconditioner
    class(linear_system_t), intent(inout) :: system
    !> Nodes that carry unknowns (n)
    logical, intent(in) :: active(:)
    !> B, along which the multipliers act, M B, and C of the constraints (n, number of constraints), zero off the active nodes
    real(wp), intent(in) :: columns(:, :), mb(:, :), rows(:, :)
    !> Weight of each residual (n)
    real(wp), intent(in) :: weight(:)
    !> Right-hand side (n)
    real(wp), intent(in) :: rhs(:)
    !> Unknowns (n), on entry a start that fulfils the constraints
    real(wp), intent(inout), contiguous :: x(:)
    !> Product A x (n), everywhere
    real(wp), intent(inout), contiguous :: ax(:)
    !> The largest weighted residual that is allowed on an active node
    real(wp), intent(in) :: tolerance
    !> Iterations allowed
    integer, intent(in) :: max_iterations
    !> Multipliers of the constraints, on entry a start
    real(wp), intent(inout) :: multiplier(:)
    !> False where the constraints depend on each other: nothing was done
    logical, intent(out) :: independent
    !> Iterations taken
    integer, intent(out) :: iterations
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    type :: direction_t
      !> Weighted residual, and the product A z that the next one comes from
      real(wp), allocatable :: v(:), image(:)
    end type direction_t
    !> Directions take their memory one by one: mostly a few are enough
    type(direction_t) :: basis(max_iterations + 1)
    real(wp), allocatable :: z(:), r(:), combined(:)
    real(wp) :: h(max_iterations + 1, max_iterations), g(max_iterations + 1), c(max_iterations), s(max_iterations)
    real(wp) :: y(max_iterations), share(size(multiplier)), length, rotated
    real(wp) :: inverse(size(multiplier), size(multiplier))
    integer :: n, i, k

    n = size(x)
    iterations = 0
    call invert_gram(rows, mb, inverse, independent, system%n_threads)
    if (.not. independent) return
    allocate (z(n), r(n))
    basis(1)%v = merge(weight*(rhs - ax + matmul(columns, multiplier)), 0.0_wp, active)
    length = sqrt(dot(basis(1)%v, basis(1)%v, system%n_threads))
    if (.not. length > 0.0_wp) return
    basis(1)%v = basis(1)%v/length
    g = 0.0_wp
    g(1) = length
    h = 0.0_wp

    do k = 1, max_iterations
      call expand(basis(k)%v, error)
      if (allocated(error)) return
      allocate (basis(k)%image(n))
      call system%product(z, basis(k)%image, error)
      if (allocated(error)) return
      basis(k + 1)%v = merge(weight*(basis(k)%image - matmul(columns, share)), 0.0_wp, active)
      do i = 1, k
        h(i, k) = dot(basis(i)%v, basis(k + 1)%v, system%n_threads)
        basis(k + 1)%v = basis(k + 1)%v - h(i, k)*basis(i)%v
      end do
      h(k + 1, k) = sqrt(dot(basis(k + 1)%v, basis(k + 1)%v, system%n_threads))
      if (h(k + 1, k) > 0.0_wp) basis(k + 1)%v = basis(k + 1)%v/h(k + 1, k)
      do i = 1, k - 1
        rotated = c(i)*h(i, k) + s(i)*h(i + 1, k)
        h(i + 1, k) = -s(i)*h(i, k) + c(i)*h(i + 1, k)
        h(i, k) = rotated
      end do
      length = hypot(h(k, k), h(k + 1, k))
      if (.not. length > 0.0_wp) exit
      iterations = k
      c(k) = h(k, k)/length
      s(k) = h(k + 1, k)/length
      h(k, k) = length
      g(k + 1) = -s(k)*g(k)
      g(k) = c(k)*g(k)
      if (abs(g(k + 1)) <= tolerance) exit
    end do

    do i = iterations, 1, -1
      y(i) = (g(i) - dot_product(h(i, i + 1:iterations), y(i + 1:iterations)))/h(i, i)
    end do
    allocate (combined(n), source=0.0_wp)
    do i = 1, iterations
      combined = combined + y(i)*basis(i)%v
      ax = ax + y(i)*basis(i)%image
    end do
    call expand(combined, error)
    if (allocated(error)) return
    x = x + z
    multiplier = multiplier + share

  contains

    !> z = M (r + B share) with C^T z = 0, r the unweighted residual of a basis vector.
    subroutine expand(vector, error)
      real(wp), intent(in) :: vector(:)
      type(error_t), allocatable, intent(out) :: error
      integer :: j

      r = merge(vector/weight, 0.0_wp, active)
      call system%precondition(r, z, error)
      if (allocated(error)) return
      where (.not. active) z = 0.0_wp
      do j = 1, size(share)
        share(j) = -dot(rows(:, j), z, system%n_threads)
      end do
      share = [(dot_product(inverse(j, :), share), j=1, size(share))]
      z = z + matmul(mb, share)
    end subroutine expand

  end subroutine projected_gmres

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
  subroutine project(active, constraint, mb, inverse, z, n_threads)
    !> Active nodes
    logical, intent(in) :: active(:)
    !> B, M B and (B^T M B)^-1
    real(wp), intent(in) :: constraint(:, :), mb(:, :), inverse(:, :)
    !> Vector to be projected
    real(wp), intent(inout), contiguous :: z(:)
    !> Threads to use
    integer, intent(in) :: n_threads

    real(wp) :: share(size(mb, 2))
    integer :: i, m

    !$omp parallel do schedule(static) num_threads(n_threads)
    do i = 1, size(z)
      if (.not. active(i)) z(i) = 0.0_wp
    end do
    !$omp end parallel do
    do m = 1, size(mb, 2)
      share(m) = dot(constraint(:, m), z, n_threads)
    end do
    share = [(dot_product(inverse(m, :), share), m=1, size(share))]
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
    real(wp), intent(in), contiguous :: a(:), b(:)
    !> Threads to use
    integer, intent(in) :: n_threads
    real(wp) :: part((size(a) + sum_block - 1)/sum_block)
    integer :: k, from, to

    !$omp parallel do schedule(static) num_threads(n_threads) private(from, to)
    do k = 1, size(part)
      from = (k - 1)*sum_block + 1
      to = min(k*sum_block, size(a))
      part(k) = ddot(to - from + 1, a(from:to), 1, b(from:to), 1)
    end do
    !$omp end parallel do
    dot = sum(part)
  end function dot

end module hc_krylov
