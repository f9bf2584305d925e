!> A linear system on a set of active nodes, with linear constraints.
!>
!> Find the unknowns on the active nodes (the others stay as they are),
!>
!>     A x - B m = rhs   on the active nodes,     C^T x = as at the start,
!>
!> where m are the multipliers, which act along B; where A is symmetric C is B. In contact x are the tractions, m the
!> rigid motions and C^T x the resultants. Products and preconditioners take vectors over all nodes; between
!> them vectors have the active nodes only. A vector M B (C^T M B)^-1 y added to x changes C^T x by y.
!>
!> Equations: docs/theory/friction.md, (F11).
module hc_linear_system
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_lapack, only: eliminate
  use hc_field_space, only: field_space_t
  implicit none
  private

  public :: solution_accurate, iterations_used_up, solution_broke_off
  public :: linear_system_t, precondition_constraints, satisfy_constraints, invert_gram

  !> Why a linear solver stopped, from best to worst: the residual is within its bound; all iterations allowed were made;
  !> it falls along no direction (rounding errors, a matrix that is not positive definite, numbers that are not finite).
  integer, parameter :: solution_accurate = 1, iterations_used_up = 2, solution_broke_off = 3

  !> A symmetric positive definite operator with a preconditioner, the identity unless it is overridden, on fields that
  !> are vectors over all nodes.
  type, abstract :: linear_system_t
    !> Space of the vectors
    type(field_space_t) :: space
  contains
    !> y = A x for an x that vanishes off the active nodes; y is wanted everywhere
    procedure(linear_map), deferred :: product
    !> z = M r for an r that vanishes off the active nodes; z is used on them only
    procedure :: precondition => no_precondition
  end type linear_system_t

  abstract interface
    !> Apply a linear map to a vector.
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

  !> Apply the identity as a preconditioner.
  subroutine no_precondition(self, x, y, error)
    class(linear_system_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error

    associate (error => error)
      call self%space%copy(x, y)
    end associate
  end subroutine no_precondition

  !> Compute M B, the constraint vectors after the preconditioner, zero off the active nodes.
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

  !> Correct x <- x + M B (C^T M B)^-1 missing, so that C^T x has its prescribed value; mostly C is B.
  !>
  !> M B is about the traction that a rigid motion of the active nodes causes.
  subroutine satisfy_constraints(rows, mb, missing, x, independent, space)
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
  end subroutine satisfy_constraints

  !> Compute (C^T M B)^-1, zero if the constraints depend on each other.
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

end module hc_linear_system
