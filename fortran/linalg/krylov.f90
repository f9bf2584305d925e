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
!> Vectors over all nodes are what products and preconditioners take; between them only
!> the active nodes are kept.
!>
!> For a matrix that is not symmetric, and constraints C^T x whose multipliers act
!> along other vectors B, GMRES does the same with (C^T M B)^-1 C^T.
!>
!> Equations: docs/theory/friction.md, (F11).
module hc_krylov
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_lapack, only: eliminate
  use hc_active_set, only: packing_t, new_packing
  use hc_field_space, only: field_space_t, sum_block
  implicit none
  private

  public :: solution_accurate, iterations_used_up, solution_broke_off
  public :: linear_system_t, projected_cg, projected_gmres, precondition_constraints, fulfil

  !> Why a linear solver stopped, from best to worst: the residual is within its bound; all iterations allowed were made;
  !> it falls along no direction (rounding errors, a matrix that is not positive definite, numbers that are not finite).
  integer, parameter :: solution_accurate = 1, iterations_used_up = 2, solution_broke_off = 3

  !> A symmetric positive definite operator with a preconditioner, on fields that
  !> are kept as vectors over all nodes.
  type, abstract :: linear_system_t
    !> Space of the vectors
    type(field_space_t) :: space
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
    real(wp), intent(in), contiguous :: constraint(:, :)
    !> M B (n, number of constraints)
    real(wp), allocatable, intent(out) :: mb(:, :)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    integer :: i, m

    allocate (mb(size(constraint, 1), size(constraint, 2)))
    do m = 1, size(constraint, 2)
      call system%precondition(constraint(:, m), mb(:, m), error)
      if (allocated(error)) return
      !$omp parallel do schedule(static) num_threads(system%space%threads)
      do i = 1, size(active)
        if (.not. active(i)) mb(i, m) = 0.0_wp
      end do
      !$omp end parallel do
    end do
  end subroutine precondition_constraints

  !> x <- x + M B (C^T M B)^-1 missing: make C^T x what it should be; mostly C is B.
  !>
  !> M B is about the traction that a rigid motion of the active nodes causes.
  subroutine fulfil(rows, mb, missing, x, independent, space)
    !> C and M B
    real(wp), intent(in), contiguous :: rows(:, :), mb(:, :)
    !> What C^T x lacks
    real(wp), intent(in) :: missing(:)
    !> Unknowns
    real(wp), intent(inout), contiguous :: x(:)
    !> False where the constraints depend on each other: x is left alone
    logical, intent(out) :: independent
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    real(wp) :: inverse(size(missing), size(missing))
    integer :: m

    call invert_gram(rows, mb, inverse, independent, space)
    if (independent) call space%add_columns(mb, [(dot_product(inverse(m, :), missing), m=1, size(missing))], x)
  end subroutine fulfil

  !> (C^T M B)^-1, zero if the constraints depend on each other.
  subroutine invert_gram(rows, mb, inverse, independent, space)
    !> C and M B
    real(wp), intent(in), contiguous :: rows(:, :), mb(:, :)
    !> The inverse
    real(wp), intent(out) :: inverse(:, :)
    !> The matrix can be inverted
    logical, intent(out) :: independent
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    real(wp) :: gram(size(mb, 2), size(mb, 2)), scale(size(mb, 2))
    integer :: m, k

    independent = .true.
    inverse = 0.0_wp
    if (size(mb, 2) == 0) return
    do m = 1, size(mb, 2)
      do k = 1, size(mb, 2)
        gram(k, m) = space%dot(rows(:, k), mb(:, m))
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
    call eliminate(gram, inverse)
    independent = all([(abs(gram(m, m)), m=1, size(mb, 2))] > dependence)
    inverse = inverse/spread(scale, 2, size(mb, 2))
    if (.not. independent) inverse = 0.0_wp
  end subroutine invert_gram

  !> Preconditioned conjugate gradients with projection on the constraints.
  subroutine projected_cg(system, active, constraint, mb, rhs, x, ax, tolerance, max_iterations, &
                          multiplier, residual, iterations, outcome, error, drift)
    !> Operator and preconditioner
    class(linear_system_t), intent(inout) :: system
    !> Nodes that carry unknowns (n)
    logical, intent(in) :: active(:)
    !> Constraint vectors B (n, number of constraints, may be 0), zero off the active nodes, and M B
    real(wp), intent(in), contiguous :: constraint(:, :), mb(:, :)
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
    !> Iterations taken; why it stopped: solution_accurate, iterations_used_up or solution_broke_off
    integer, intent(out) :: iterations, outcome
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    !> What rounding errors of the largest residual on the way may have left in A x
    !> (Greenbaum, SIAM J. Matrix Anal. Appl. 18, 1997, 535-551)
    real(wp), intent(out), optional :: drift

    type(packing_t) :: nodes
    !> Over all nodes: what is multiplied or preconditioned (zero off the active nodes), and what comes of it
    real(wp), allocatable :: from(:), onto(:)
    !> On the active nodes
    real(wp), allocatable :: r(:), z(:), d(:), ad(:), x_active(:), ax_active(:), rhs_active(:), b(:, :), m_b(:, :)
    real(wp) :: rz, rz_old, curvature, step, largest
    real(wp) :: inverse(size(constraint, 2), size(constraint, 2))
    integer :: i, m
    type(field_space_t) :: space
    logical :: independent

    space = system%space
    call new_packing(nodes, active, space)
    associate (n => nodes%n_active)
      allocate (r(n), z(n), d(n), ad(n), x_active(n), ax_active(n), rhs_active(n))
    end associate
    allocate (onto(size(x)), from(size(x)))
    call space%fill(from, 0.0_wp)
    call nodes%pack_columns(constraint, b)
    call nodes%pack_columns(mb, m_b)
    call nodes%pack(x, x_active)
    call nodes%pack(ax, ax_active)
    call nodes%pack(rhs, rhs_active)
    call invert_gram(b, m_b, inverse, independent, space)
    iterations = 0
    largest = 0.0_wp
    outcome = iterations_used_up
    rz_old = 0.0_wp
    multiplier = 0.0_wp
    if (size(multiplier) > 0) then
      call constrained_residual(b, multiplier, rhs_active, ax_active, r, residual, space)
      do m = 1, size(multiplier)
        multiplier(m) = -space%dot(b(:, m), r)/space%dot(b(:, m), b(:, m))
      end do
    end if
    do
      ! The share of the constraints is taken out of the residual before it is
      ! preconditioned: it is the larger part by far, and its rounding errors would stay.
      ! What is left is normal to M B, which keeps the projected preconditioner
      ! symmetric even if the given M B is not quite what its name says.
      call constrained_residual(b, multiplier, rhs_active, ax_active, r, residual, space)
      if (size(multiplier) > 0) then
        multiplier = multiplier - matmul(space%dots(m_b, r), inverse)
        call constrained_residual(b, multiplier, rhs_active, ax_active, r, residual, space)
      end if
      largest = max(largest, residual)
      if (residual <= tolerance .or. iterations >= max_iterations) exit
      call nodes%unpack(r, from)
      call system%precondition(from, onto, error)
      if (allocated(error)) return
      call nodes%pack(onto, z)
      call space%add_columns(m_b, -matmul(inverse, space%dots(b, z)), z)

      rz = space%dot(r, z)
      step = 0.0_wp
      if (iterations > 0) step = rz/rz_old
      rz_old = rz
      !$omp parallel do schedule(static) num_threads(space%threads)
      do i = 1, size(d)
        if (iterations > 0) then
          d(i) = z(i) + step*d(i)
        else
          d(i) = z(i)
        end if
      end do
      !$omp end parallel do
      call nodes%unpack(d, from)
      call system%product(from, onto, error)
      if (allocated(error)) return
      call nodes%pack(onto, ad)
      curvature = space%dot(d, ad)
      ! nothing is left to gain in working precision
      if (.not. curvature > 0.0_wp) then
        outcome = solution_broke_off
        exit
      end if
      step = rz/curvature
      !$omp parallel num_threads(space%threads)
      !$omp do schedule(static)
      do i = 1, size(d)
        x_active(i) = x_active(i) + step*d(i)
        ax_active(i) = ax_active(i) + step*ad(i)
      end do
      !$omp end do nowait
      !$omp do schedule(static)
      do i = 1, size(ax)
        ax(i) = ax(i) + step*onto(i)
      end do
      !$omp end do
      !$omp end parallel
      iterations = iterations + 1
    end do
    if (residual <= tolerance) outcome = solution_accurate
    ! the largest of several numbers hides one that is not a number
    if (.not. ieee_is_finite(space%dot(r, r))) outcome = solution_broke_off
    call nodes%unpack(x_active, x)
    if (present(drift)) drift = epsilon(1.0_wp)*largest
  end subroutine projected_cg

  !> GMRES, preconditioned from the right, with the constraints C^T x held exactly.
  subroutine projected_gmres(system, active, columns, mb, rows, weight, rhs, x, ax, tolerance, max_iterations, &
                             multiplier, independent, residual, iterations, outcome, error, drift)
    !> Operator and preconditioner
    class(linear_system_t), intent(inout) :: system
    !> Nodes that carry unknowns (n)
    logical, intent(in) :: active(:)
    !> B, along which the multipliers act, M B, and C of the constraints (n, number of constraints), zero off the active nodes
    real(wp), intent(in), contiguous :: columns(:, :), mb(:, :), rows(:, :)
    !> Weight of each residual (n)
    real(wp), intent(in) :: weight(:)
    !> Right-hand side (n)
    real(wp), intent(in) :: rhs(:)
    !> Unknowns (n), on entry a start that fulfils the constraints
    real(wp), intent(inout), contiguous :: x(:)
    !> Product A x (n), everywhere
    real(wp), intent(inout), contiguous :: ax(:)
    !> Euclidean norm of the weighted residuals on the active nodes that is allowed
    real(wp), intent(in) :: tolerance
    !> Iterations allowed
    integer, intent(in) :: max_iterations
    !> Multipliers of the constraints, on entry a start
    real(wp), intent(inout) :: multiplier(:)
    !> False where the constraints depend on each other: nothing was done
    logical, intent(out) :: independent
    !> Euclidean norm of the weighted residuals that is left, but for rounding errors
    real(wp), intent(out) :: residual
    !> Iterations taken; why it stopped: solution_accurate, iterations_used_up or solution_broke_off
    integer, intent(out) :: iterations, outcome
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    !> What rounding errors of the first residual may have left in A x, in that norm
    real(wp), intent(out), optional :: drift

    type :: direction_t
      !> Weighted residual v; z = M (r + B share) with C^T z = 0, r that residual without its weights, on the active
      !> nodes; the product A z over all nodes
      real(wp), allocatable :: v(:), z(:), image(:)
    end type direction_t
    !> Directions take their memory one by one: mostly a few are enough
    type(direction_t) :: basis(max_iterations + 1)
    type(packing_t) :: nodes
    !> Over all nodes: what is multiplied or preconditioned (zero off the active nodes), and what comes of it
    real(wp), allocatable :: from(:), onto(:)
    !> On the active nodes
    real(wp), allocatable :: w(:), packed(:), b(:, :), m_b(:, :), c_rows(:, :)
    real(wp) :: h(max_iterations + 1, max_iterations), g(max_iterations + 1), c(max_iterations), s(max_iterations)
    real(wp) :: y(max_iterations), share(size(multiplier), max_iterations), length, rotated
    real(wp) :: inverse(size(multiplier), size(multiplier))
    integer :: i, k, stat
    type(field_space_t) :: space

    iterations = 0
    residual = huge(1.0_wp)
    if (present(drift)) drift = 0.0_wp
    outcome = solution_broke_off
    space = system%space
    call new_packing(nodes, active, space)
    call nodes%pack_columns(columns, b)
    call nodes%pack_columns(mb, m_b)
    call nodes%pack_columns(rows, c_rows)
    call invert_gram(c_rows, m_b, inverse, independent, space)
    if (.not. independent) return
    associate (n => nodes%n_active)
      allocate (basis(1)%v(n), w(n), packed(n))
    end associate
    allocate (onto(size(x)), from(size(x)), source=0.0_wp)
    call nodes%pack(weight, w)
    call nodes%pack(rhs, basis(1)%v)
    call nodes%pack(ax, packed)
    basis(1)%v = basis(1)%v - packed
    call space%add_columns(b, multiplier, basis(1)%v)
    basis(1)%v = w*basis(1)%v
    length = sqrt(space%dot(basis(1)%v, basis(1)%v))
    residual = length
    if (present(drift)) drift = epsilon(1.0_wp)*length
    if (length <= 0.0_wp) outcome = solution_accurate
    if (.not. length > 0.0_wp) return
    outcome = iterations_used_up
    basis(1)%v = basis(1)%v/length
    g = 0.0_wp
    g(1) = length
    h = 0.0_wp

    do k = 1, max_iterations
      allocate (basis(k)%z(nodes%n_active), basis(k)%image(size(x)), basis(k + 1)%v(nodes%n_active), stat=stat)
      if (stat /= 0) then
        call raise(error, status%resources, 'not enough memory for another direction of GMRES: choose a smaller window')
        return
      end if
      packed = basis(k)%v/w
      call nodes%unpack(packed, from)
      call system%precondition(from, onto, error)
      if (allocated(error)) return
      call nodes%pack(onto, basis(k)%z)
      share(:, k) = -matmul(inverse, space%dots(c_rows, basis(k)%z))
      call space%add_columns(m_b, share(:, k), basis(k)%z)
      call nodes%unpack(basis(k)%z, from)
      call system%product(from, basis(k)%image, error)
      if (allocated(error)) return
      call nodes%pack(basis(k)%image, basis(k + 1)%v)
      call space%add_columns(b, -share(:, k), basis(k + 1)%v)
      basis(k + 1)%v = w*basis(k + 1)%v
      do i = 1, k
        h(i, k) = space%dot(basis(i)%v, basis(k + 1)%v)
        basis(k + 1)%v = basis(k + 1)%v - h(i, k)*basis(i)%v
      end do
      h(k + 1, k) = sqrt(space%dot(basis(k + 1)%v, basis(k + 1)%v))
      if (h(k + 1, k) > 0.0_wp) basis(k + 1)%v = basis(k + 1)%v/h(k + 1, k)
      do i = 1, k - 1
        rotated = c(i)*h(i, k) + s(i)*h(i + 1, k)
        h(i + 1, k) = -s(i)*h(i, k) + c(i)*h(i + 1, k)
        h(i, k) = rotated
      end do
      length = hypot(h(k, k), h(k + 1, k))
      if (.not. length > 0.0_wp) outcome = solution_broke_off
      if (outcome == solution_broke_off) exit
      iterations = k
      c(k) = h(k, k)/length
      s(k) = h(k + 1, k)/length
      h(k, k) = length
      g(k + 1) = -s(k)*g(k)
      g(k) = c(k)*g(k)
      residual = abs(g(k + 1))
      if (residual <= tolerance) exit
    end do
    if (residual <= tolerance) outcome = solution_accurate

    do i = iterations, 1, -1
      y(i) = (g(i) - dot_product(h(i, i + 1:iterations), y(i + 1:iterations)))/h(i, i)
    end do
    ! solution and product from the same directions: the preconditioner is of single precision, and where a node
    ! slips far the matrix would make displacements of its rounding errors
    call nodes%pack(x, packed)
    do i = 1, iterations
      packed = packed + y(i)*basis(i)%z
      ax = ax + y(i)*basis(i)%image
    end do
    multiplier = multiplier + matmul(share(:, :iterations), y(:iterations))
    call nodes%unpack(packed, x)
  end subroutine projected_gmres

  !> r = rhs - A x + B m and its largest element.
  subroutine constrained_residual(b, multiplier, rhs, ax, r, largest, space)
    !> Constraint vectors and multipliers
    real(wp), intent(in), contiguous :: b(:, :)
    real(wp), intent(in) :: multiplier(:)
    !> Right-hand side and product A x
    real(wp), intent(in), contiguous :: rhs(:), ax(:)
    !> Residual
    real(wp), intent(inout), contiguous :: r(:)
    !> Its largest element
    real(wp), intent(out) :: largest
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    integer :: i, m, from, to

    largest = 0.0_wp
    !$omp parallel do schedule(static) num_threads(space%threads) private(i, m, to) reduction(max: largest)
    do from = 1, size(r), sum_block
      to = min(from + sum_block - 1, size(r))
      do i = from, to
        r(i) = rhs(i) - ax(i)
      end do
      do m = 1, size(multiplier)
        do i = from, to
          r(i) = r(i) + multiplier(m)*b(i, m)
        end do
      end do
      do i = from, to
        largest = max(largest, abs(r(i)))
      end do
    end do
    !$omp end parallel do
  end subroutine constrained_residual

end module hc_krylov
