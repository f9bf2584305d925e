!> A linear system on a set of active nodes, with linear constraints.
!>
!> Find the unknowns on the active nodes (the others do not change),
!>
!>     A x - B m = rhs   on the active nodes,     C^T x = as at the start,
!>
!> where m are the multipliers, which act along B; where A is symmetric C is B. In contact x are the tractions, m the
!> rigid motions and C^T x the resultants. Products and preconditioners take vectors over all nodes; between
!> them vectors have the active nodes only. A vector M B (C^T M B)^-1 y added to x changes C^T x by y.
!>
!> Equations: docs/theory/friction.md, (F11).
module hc_linear_system
  use hc_precision, only: wp, sp
  use hc_error, only: error_t
  use hc_lapack, only: eliminate
  use hc_field_space, only: field_space_t, sum_block
  use hc_active_set, only: active_set_t
  implicit none
  private

  public :: solution_accurate, iterations_used_up, solution_broke_off
  public :: linear_system_t, constraints_t, constraint_source_t, iteration_t, precondition_constraints, step_ahead

  !> Why a linear solver stopped, from best to worst: the residual is within its bound; all iterations allowed were made;
  !> it falls along no direction (rounding errors, a matrix that is not positive definite, numbers that are not finite).
  integer, parameter :: solution_accurate = 1, iterations_used_up = 2, solution_broke_off = 3

  !> An operator with a preconditioner, the identity unless it is overridden, on fields that are vectors over all nodes.
  type, abstract :: linear_system_t
    !> Space of the vectors
    type(field_space_t) :: space
    !> The operator is symmetric and positive definite; else hc_step_equation chooses GMRES
    logical :: symmetric = .true.
  contains
    !> y = A x for an x that vanishes off the active nodes; y at all nodes
    procedure(linear_map), deferred :: product
    !> The same for the values at the active nodes alone, x
    procedure :: product_packed
    !> z = M r at the active nodes
    procedure :: precondition_packed
    !> Memory for a product over all nodes
    procedure :: take_image
  end type linear_system_t

  !> Vectors of constraints that are computed where they are used: a window is too large to store them.
  type, abstract :: constraint_source_t
  contains
    procedure(constraint_vectors), deferred :: find
  end type constraint_source_t

  !> Linear constraints on the unknowns (nodes, number of constraints, may be 0).
  type :: constraints_t
    !> Active nodes at whose unknowns B and M B are zero, the first ones
    integer :: n_before = 0
    !> B, along which the multipliers act, at the active nodes after them
    real(wp), allocatable :: columns(:, :)
    !> M B there; vectors that nearly are M B serve as well
    real(sp), allocatable :: mb(:, :)
    !> C at the first active nodes, as far as it is not B
    real(wp), allocatable :: rows(:, :)
    !> Source of both instead, if it is there
    class(constraint_source_t), allocatable :: source
    !> M B of one more constraint, the last: the sum of the unknowns at the nodes before
    real(sp), allocatable :: of_sum(:)
    !> Multipliers m
    real(wp), allocatable :: multiplier(:)
  contains
    !> Unknowns that satisfy them
    procedure :: satisfy
    !> (C^T M B)^-1
    procedure :: invert
    !> C^T x
    procedure :: resultants
    !> Add B or M B times factors
    procedure :: add_columns, add_mb
    !> Number of constraints
    procedure :: number
  end type constraints_t

  !> An iteration: how far it may go, and how it ended.
  type :: iteration_t
    !> Norm of the residual that is allowed, and the one that is left
    real(wp) :: tolerance = 0.0_wp, residual = huge(1.0_wp)
    !> Iterations allowed, and made
    integer :: most = 0, made = 0
    !> GMRES: stored directions, after which it restarts with the present residual; up to how many with their products off the
    !> active nodes
    integer :: most_directions = 0, most_products = huge(0)
    !> GMRES: directions are stored in single precision; the product has an error of as much of the residual at the start
    logical :: single = .false.
    !> GMRES: weights of the residuals, one for each part of the vectors; the parts are equally long
    real(wp), allocatable :: weight(:)
    !> Why it stopped: solution_accurate, iterations_used_up or solution_broke_off
    integer :: outcome = solution_broke_off
    !> False where the constraints depend on each other: nothing was done
    logical :: independent = .true.
    !> Bound of the rounding errors in the product A x, which is carried along
    real(wp) :: drift = 0.0_wp
    !> GMRES: bound of the error of the product by vectors in single precision
    real(wp) :: rounding = 0.0_wp
  end type iteration_t

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

  abstract interface
    !> Compute the vectors of a constraint.
    subroutine constraint_vectors(self, k, column, row)
      import :: constraint_source_t, wp
      class(constraint_source_t), intent(in) :: self
      !> Its number
      integer, intent(in) :: k
      !> B at the active nodes after the first ones
      real(wp), intent(inout), contiguous :: column(:)
      !> C at these
      real(wp), intent(inout), contiguous, optional :: row(:)
    end subroutine constraint_vectors
  end interface

  !> Pivot of the scaled constraints below which they count as dependent.
  real(wp), parameter :: dependence = 1.0e-12_wp

contains

  !> Compute y = A x of the values at the active nodes.
  subroutine product_packed(self, nodes, x, y, error)
    class(linear_system_t), intent(inout) :: self
    !> Active nodes
    type(active_set_t), intent(in) :: nodes
    !> Values at the active nodes
    real(wp), intent(in), contiguous :: x(:)
    !> Values at all nodes
    real(wp), intent(out), contiguous, target :: y(:)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable, target :: from(:)

    allocate (from(size(y)))
    call self%space%fill(from, 0.0_wp)
    call nodes%unpack(x, from)
    call self%product(from, y, error)
  end subroutine product_packed

  !> Point to memory for a product of `product_packed`, which stays there until the next product or preconditioner: by default that
  !> of the caller.
  subroutine take_image(self, n, own, image, stat)
    class(linear_system_t), intent(in) :: self
    !> Number of all nodes
    integer, intent(in) :: n
    !> Memory of the caller, allocated if it is needed
    real(wp), allocatable, target, intent(inout) :: own(:)
    real(wp), pointer, contiguous, intent(out) :: image(:)
    !> Not zero: there is not enough memory
    integer, intent(out) :: stat

    stat = 0
    if (.not. allocated(own)) allocate (own(n), stat=stat)
    if (stat /= 0) return
    image => own
  end subroutine take_image

  !> Compute z = M r at the active nodes: by default M is the identity.
  subroutine precondition_packed(self, nodes, n, r, z)
    class(linear_system_t), intent(inout) :: self
    !> Active nodes, and number of all nodes
    type(active_set_t), intent(in) :: nodes
    integer, intent(in) :: n
    !> Values at the active nodes
    real(wp), intent(in), contiguous :: r(:)
    real(wp), intent(inout), contiguous :: z(:)

    call self%space%copy(r, z)
  end subroutine precondition_packed

  !> Compute M B, the constraint vectors after the preconditioner.
  subroutine precondition_constraints(system, nodes, n, constraint, mb)
    !> Operator and preconditioner
    class(linear_system_t), intent(inout) :: system
    !> Nodes that carry unknowns, and number of all nodes
    type(active_set_t), intent(in) :: nodes
    integer, intent(in) :: n
    !> Constraint vectors B at these nodes (n_active, number of constraints)
    real(wp), intent(in), contiguous :: constraint(:, :)
    !> M B there
    real(sp), allocatable, intent(out) :: mb(:, :)
    real(wp), allocatable :: column(:)
    integer :: m

    allocate (mb(size(constraint, 1), size(constraint, 2)), column(size(constraint, 1)))
    do m = 1, size(constraint, 2)
      call system%precondition_packed(nodes, n, constraint(:, m), column)
      mb(:, m) = real(column, sp)
    end do
  end subroutine precondition_constraints

  !> Correct x <- x + M B (C^T M B)^-1 missing, so that C^T x has its prescribed value.
  !>
  !> M B is about the traction that a rigid motion of the active nodes causes.
  subroutine satisfy(self, space, missing, x, independent, nodes)
    class(constraints_t), intent(in) :: self
    !> Space of the nodes
    type(field_space_t), intent(in) :: space
    !> Defect of C^T x
    real(wp), intent(in) :: missing(:)
    !> Unknowns, over all nodes if `nodes` are given
    real(wp), intent(inout), contiguous :: x(:)
    !> False if the constraints are linearly dependent: x does not change
    logical, intent(out) :: independent
    !> Nodes to which C and M B belong; absent: all
    type(active_set_t), intent(in), optional :: nodes
    real(wp) :: inverse(size(missing), size(missing)), factor(size(missing))
    real(wp), allocatable :: values(:)
    integer :: m

    call self%invert(space, inverse, independent)
    if (.not. independent) return
    factor = [(dot_product(inverse(m, :), missing), m=1, size(missing))]
    if (.not. present(nodes)) then
      call self%add_mb(space, factor, x)
    else if (size(missing) > 0) then
      allocate (values(nodes%n_active))
      call nodes%pack(x, values)
      call self%add_mb(space, factor, values)
      call nodes%unpack(values, x)
    end if
  end subroutine satisfy

  !> Take a step along the preconditioned residual, projected on the constraints, before the product A x is known: that of the
  !> unknowns before small changes serves for the residual, and one product serves for changes and step together.
  subroutine step_ahead(system, nodes, constraints, rhs, ax, length, x)
    !> Operator and preconditioner
    class(linear_system_t), intent(inout) :: system
    !> Nodes that carry unknowns
    type(active_set_t), intent(in) :: nodes
    !> Constraints, with multipliers that are nearly right
    type(constraints_t), intent(in) :: constraints
    !> Right-hand side (n_active), used up: its memory is that of the residual; nearly A x (n)
    real(wp), intent(inout), contiguous :: rhs(:)
    real(wp), intent(in), contiguous :: ax(:)
    !> Share of the preconditioned residual
    real(wp), intent(in) :: length
    !> Unknowns (n_active), whose C^T x stays
    real(wp), intent(inout), contiguous :: x(:)
    real(wp), allocatable :: z(:)
    real(wp), dimension(size(constraints%multiplier)) :: share
    real(wp) :: inverse(size(share), size(share))
    logical :: independent

    call constraints%invert(nodes%space, inverse, independent)
    if (.not. independent) return
    allocate (z(nodes%n_active))
    call nodes%pack(ax, z)
    rhs = rhs - z
    call constraints%add_columns(system%space, constraints%multiplier, rhs)
    call system%precondition_packed(nodes, size(ax), rhs, z)
    share = -matmul(inverse, constraints%resultants(nodes%space, z))
    call constraints%add_mb(system%space, share, z)
    x = x + length*z
  end subroutine step_ahead

  !> Compute (C^T M B)^-1.
  subroutine invert(self, space, inverse, independent)
    class(constraints_t), intent(in) :: self
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> The inverse; zero if the constraints depend on each other
    real(wp), intent(out) :: inverse(:, :)
    !> The matrix can be inverted
    logical, intent(out) :: independent
    real(wp), dimension(size(inverse, 1), size(inverse, 1)) :: gram, unit
    real(wp) :: scale(size(inverse, 1))
    real(wp), allocatable :: column(:)
    integer :: m

    independent = .true.
    inverse = 0.0_wp
    if (size(scale) == 0) return
    unit = 0.0_wp
    allocate (column(self%n_before + size(self%mb, 1)))
    do m = 1, size(scale)
      unit(m, m) = 1.0_wp
      call space%fill(column, 0.0_wp)
      call self%add_mb(space, unit(:, m), column)
      gram(:, m) = self%resultants(space, column)
      scale(m) = gram(m, m)
    end do
    independent = all(scale > 0.0_wp)
    if (.not. independent) return
    scale = sqrt(scale)
    do m = 1, size(scale)
      gram(:, m) = gram(:, m)/(scale*scale(m))
      inverse(m, m) = 1.0_wp/scale(m)
    end do
    call eliminate(gram, inverse)
    independent = all([(abs(gram(m, m)), m=1, size(scale))] > dependence)
    inverse = inverse/spread(scale, 2, size(scale))
    if (.not. independent) inverse = 0.0_wp
  end subroutine invert

  !> Return the number of constraints.
  pure integer function number(self)
    class(constraints_t), intent(in) :: self

    number = merge(1, 0, allocated(self%of_sum))
    if (allocated(self%source)) then
      number = number + size(self%mb, 2)
    else
      number = number + size(self%columns, 2)
    end if
  end function number

  !> Add x <- x + B factor.
  subroutine add_columns(self, space, factor, x, work)
    class(constraints_t), intent(in) :: self
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> A factor for each constraint
    real(wp), intent(in) :: factor(:)
    !> Values at the active nodes
    real(wp), intent(inout), contiguous :: x(:)
    !> Memory for a column of a source, as long as x; absent: own one
    real(wp), intent(inout), contiguous, optional, target :: work(:)
    real(wp), allocatable, target :: own(:)
    real(wp), pointer, contiguous :: column(:, :)
    integer :: i, m

    associate (n => self%n_before)
      if (allocated(self%source)) then
        if (.not. present(work)) allocate (own(size(x)))
        if (present(work)) column(1:size(x) - n, 1:1) => work
        if (allocated(own)) column(1:size(x) - n, 1:1) => own
        do m = 1, size(self%mb, 2)
          call self%source%find(m, column(:, 1))
          call space%add_columns(column, factor(m:m), x(n + 1:))
        end do
      else
        call space%add_columns(self%columns, factor(:size(self%columns, 2)), x(n + 1:))
      end if
      if (.not. allocated(self%of_sum)) return
      !$omp parallel do simd schedule(static) num_threads(space%threads)
      do i = 1, n
        x(i) = x(i) + factor(size(factor))
      end do
      !$omp end parallel do simd
    end associate
  end subroutine add_columns

  !> Add x <- x + M B factor.
  subroutine add_mb(self, space, factor, x)
    class(constraints_t), intent(in) :: self
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> A factor for each constraint
    real(wp), intent(in) :: factor(:)
    !> Values at the active nodes
    real(wp), intent(inout), contiguous :: x(:)
    integer :: i, m, from, to

    associate (n => self%n_before)
      !$omp parallel do schedule(static) num_threads(space%threads) private(i, m, to)
      do from = 1, size(self%mb, 1), sum_block
        to = min(from + sum_block - 1, size(self%mb, 1))
        do m = 1, size(self%mb, 2)
          do i = from, to
            x(n + i) = x(n + i) + factor(m)*self%mb(i, m)
          end do
        end do
      end do
      !$omp end parallel do
      if (.not. allocated(self%of_sum)) return
      !$omp parallel do simd schedule(static) num_threads(space%threads)
      do i = 1, n
        x(i) = x(i) + factor(size(factor))*self%of_sum(i)
      end do
      !$omp end parallel do simd
    end associate
  end subroutine add_mb

  !> Compute C^T x of values at the active nodes.
  function resultants(self, space, x, work)
    class(constraints_t), intent(in) :: self
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> The values
    real(wp), intent(in), contiguous :: x(:)
    !> Memory for the vectors of a source, as long as x; absent: own one
    real(wp), intent(inout), contiguous, optional, target :: work(:)
    real(wp) :: resultants(self%number())
    real(wp), allocatable, target :: own(:)
    real(wp), pointer, contiguous :: vector(:)
    integer :: n, m

    n = self%n_before
    resultants = 0.0_wp
    if (allocated(self%source)) then
      if (present(work)) then
        vector => work
      else
        allocate (own(size(x)))
        vector => own
      end if
      do m = 1, size(self%mb, 2)
        call self%source%find(m, vector(n + 1:), vector(:n))
        resultants(m) = space%dot(vector(:n), x(:n)) + space%dot(vector(n + 1:), x(n + 1:), n)
      end do
    else
      if (allocated(self%rows)) n = size(self%rows, 1)
      do m = 1, size(self%mb, 2)
        resultants(m) = space%dot(self%columns(n - self%n_before + 1:, m), x(n + 1:), n)
        if (allocated(self%rows)) resultants(m) = space%dot(self%rows(:, m), x(:n)) + resultants(m)
      end do
    end if
    if (allocated(self%of_sum)) resultants(size(resultants)) = space%sum(x(:self%n_before))
  end function resultants

end module hc_linear_system
