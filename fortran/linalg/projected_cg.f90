!> Conjugate gradients on a set of active nodes, with linear constraints (hc_linear_system).
!>
!>     d <- z + (r^T z)/(r^T z of the last direction) d,     x <- x + (r^T z)/(d^T A d) d,     z = M r
!>
!> The projection of the preconditioned residual satisfies the constraints on B^T x exactly,
!>
!>     z <- M r - M B (B^T M B)^-1 B^T M r.
!>
!> (M. R. Hestenes and E. Stiefel, J. Res. Natl. Bur. Stand. 49, 1952, 409-436).
!>
!> Equations: docs/theory/friction.md, (F11); with sets of nodes that change docs/theory/normal_contact.md, (N5).
module hc_projected_cg
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp, sp
  use hc_error, only: error_t, status, raise
  use hc_active_set, only: active_set_t
  use hc_field_space, only: field_space_t, ddot
  use hc_linear_system, only: linear_system_t, constraints_t, iteration_t, solution_accurate, iterations_used_up, &
    solution_broke_off
  implicit none
  private

  public :: projected_cg, conjugate_gradient_t

  !> Values that one thread treats at a time: few enough to stay in its cache while several passes go over them
  integer, parameter :: block = 1024

  !> Where the recurrence of conjugate gradients stands, for vectors of any kind and storage.
  type :: conjugate_gradient_t
    !> r^T z of the last direction; not positive: there is none, the next direction is z
    real(wp), private :: rz = 0.0_wp
  contains
    !> Discard the last direction
    procedure :: restart
    !> Share of the last direction in the next
    procedure :: last_share
    !> Length of the step along the direction
    procedure :: step_length
  end type conjugate_gradient_t

contains

  !> Solve by preconditioned conjugate gradients with projection on the constraints.
  !>
  !> The drift bounds the rounding errors of the largest residual so far
  !> (Greenbaum, SIAM J. Matrix Anal. Appl. 18, 1997, 535-551); the norm of a residual is its largest element.
  subroutine projected_cg(system, nodes, constraints, rhs, x, ax, iteration, error)
    !> Operator and preconditioner
    class(linear_system_t), intent(inout) :: system
    !> Nodes that carry unknowns
    type(active_set_t), intent(in) :: nodes
    !> Constraints, with C = B; on return their multipliers
    type(constraints_t), intent(inout) :: constraints
    !> Right-hand side at the active nodes, whose memory becomes that of the residual
    real(wp), allocatable, intent(inout) :: rhs(:)
    !> Unknowns (n_active), on entry a start that satisfies the constraints
    real(wp), intent(inout), contiguous :: x(:)
    !> Product A x (n), everywhere, on entry and on return
    real(wp), intent(inout), contiguous :: ax(:)
    !> How far it may go, and how it ended
    type(iteration_t), intent(inout) :: iteration
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    !> Product of a direction, over all nodes, and memory for it where the system has none
    real(wp), pointer, contiguous :: onto(:)
    real(wp), allocatable, target :: own(:)
    !> On the active nodes: the residual; its preconditioned projection, whose memory serves for the product of the
    !> direction, too; the direction
    real(wp), allocatable :: r(:), z(:), d(:)
    type(conjugate_gradient_t) :: recurrence
    real(wp) :: step, share, rz, largest
    real(wp), dimension(size(constraints%columns, 2)) :: change, along
    real(wp) :: inverse(size(change), size(change))
    type(field_space_t) :: space
    logical :: independent
    integer :: stat

    space = nodes%space
    ! before there are vectors
    call constraints%invert(space, inverse, independent)
    call find_residual(nodes, rhs, ax, space, r, z)
    allocate (d(size(r)))
    call system%take_image(size(ax), own, onto, stat)
    if (stat /= 0) call raise(error, status%resources, 'not enough memory for a product: choose a smaller window')
    call space%agree(error)
    if (allocated(error)) return
    iteration%made = 0
    iteration%outcome = iterations_used_up
    largest = 0.0_wp
    step = 0.0_wp
    associate (b => constraints%columns, m_b => constraints%mb)
      change = first_change(b, r, space)
      constraints%multiplier = change
      do
        ! The share of the constraints is taken out of the residual before it is preconditioned: it is the larger part by far,
        ! and its rounding errors would stay. The rest is normal to M B, so that the projected preconditioner is symmetric even
        ! if the given M B is only about M times B.
        call advance_residual(-step, z, change, b, m_b, r, along, space)
        change = -matmul(along, inverse)
        constraints%multiplier = constraints%multiplier + change
        call space%add_columns(b, change, r)
        iteration%residual = space%max_abs(r)
        largest = max(largest, iteration%residual)
        if (iteration%residual <= iteration%tolerance .or. iteration%made >= iteration%most) exit
        call system%precondition_packed(nodes, size(ax), r, z)
        call project(-matmul(inverse, space%dots(b, z)), m_b, r, z, rz, space)
        call recurrence%last_share(rz, share)
        call combine(1.0_wp, z, share, d, space)
        call system%product_packed(nodes, d, onto, error)
        if (allocated(error)) return
        call nodes%pack(onto, z)
        step = recurrence%step_length(space%dot(d, z))
        if (.not. step > 0.0_wp) iteration%outcome = solution_broke_off
        if (.not. step > 0.0_wp) exit
        call combine(step, d, 1.0_wp, x, space)
        call combine(step, onto, 1.0_wp, ax, space)
        change = 0.0_wp
        iteration%made = iteration%made + 1
      end do
    end associate
    if (iteration%residual <= iteration%tolerance) iteration%outcome = solution_accurate
    ! the largest of several numbers hides one that is not a number
    if (.not. ieee_is_finite(space%dot(r, r))) iteration%outcome = solution_broke_off
    iteration%drift = epsilon(1.0_wp)*largest
  end subroutine projected_cg

  !> Compute r = rhs - A x on the active nodes, in the memory of the right-hand side.
  subroutine find_residual(nodes, rhs, ax, space, r, z)
    !> Nodes that carry unknowns
    type(active_set_t), intent(in) :: nodes
    !> Right-hand side (n_active), and A x (n)
    real(wp), allocatable, intent(inout) :: rhs(:)
    real(wp), intent(in), contiguous :: ax(:)
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> The residual, and memory for another vector (n_active)
    real(wp), allocatable, intent(out) :: r(:), z(:)
    integer :: i

    call move_alloc(rhs, r)
    allocate (z(nodes%n_active))
    call nodes%pack(ax, z)
    !$omp parallel do simd schedule(static) num_threads(space%threads)
    do i = 1, size(r)
      r(i) = r(i) - z(i)
    end do
    !$omp end parallel do simd
  end subroutine find_residual

  !> Compute first multipliers: one by one, those that leave least of the residual.
  function first_change(b, r, space) result(change)
    !> B and residual on the active nodes
    real(wp), intent(in), contiguous :: b(:, :), r(:)
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    real(wp) :: change(size(b, 2))
    integer :: m

    do m = 1, size(change)
      change(m) = -space%dot(b(:, m), r)/space%dot(b(:, m), b(:, m))
    end do
  end function first_change

  !> Compute r <- r + step A d + B change, and C^T r.
  subroutine advance_residual(step, ad, change, b, c, r, along, space)
    !> Multiple of A d; 0: there is no A d yet
    real(wp), intent(in) :: step
    real(wp), intent(in), contiguous :: ad(:)
    !> Change of the multipliers, B and C
    real(wp), intent(in), contiguous :: change(:), b(:, :)
    real(sp), intent(in), contiguous :: c(:, :)
    !> Residual
    real(wp), intent(inout), contiguous :: r(:)
    !> C^T r
    real(wp), intent(out) :: along(:)
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    real(wp) :: part(size(change), space%n_term(size(r))), column(block)
    integer :: k, i, m, first, last, from, to, n

    part = 0.0_wp
    !$omp parallel do schedule(static) num_threads(space%threads) private(i, m, first, last, from, to, n, column)
    do k = 1, size(part, 2)
      do i = 1, space%n_component()
        call space%term(k, i, size(r), 0, first, last)
        do from = first, last, block
          to = min(from + block - 1, last)
          n = to - from + 1
          if (abs(step) > 0.0_wp) call add_multiple(n, step, ad(from:to), r(from:to))
          do m = 1, size(change)
            if (abs(change(m)) > 0.0_wp) call add_multiple(n, change(m), b(from:to, m), r(from:to))
          end do
          do m = 1, size(change)
            column(:n) = c(from:to, m)
            part(m, k) = part(m, k) + ddot(n, column, 1, r(from:to), 1)
          end do
        end do
      end do
    end do
    !$omp end parallel do
    do m = 1, size(along)
      along(m) = space%total(part(m, :))
    end do
  end subroutine advance_residual

  !> Project z <- z + M B share, and compute r^T z.
  subroutine project(share, m_b, r, z, rz, space)
    !> Shares of the constraints, and M B
    real(wp), intent(in), contiguous :: share(:)
    real(sp), intent(in), contiguous :: m_b(:, :)
    !> Residual, and its preconditioned projection
    real(wp), intent(in), contiguous :: r(:)
    real(wp), intent(inout), contiguous :: z(:)
    !> r^T z
    real(wp), intent(out) :: rz
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    real(wp) :: part(space%n_term(size(r))), column(block)
    integer :: k, i, m, first, last, from, to, n

    part = 0.0_wp
    !$omp parallel do schedule(static) num_threads(space%threads) private(i, m, first, last, from, to, n, column)
    do k = 1, size(part)
      do i = 1, space%n_component()
        call space%term(k, i, size(r), 0, first, last)
        do from = first, last, block
          to = min(from + block - 1, last)
          n = to - from + 1
          do m = 1, size(share)
            column(:n) = m_b(from:to, m)
            call add_multiple(n, share(m), column, z(from:to))
          end do
          part(k) = part(k) + ddot(n, r(from:to), 1, z(from:to), 1)
        end do
      end do
    end do
    !$omp end parallel do
    rz = space%total(part)
  end subroutine project

  !> Compute y <- alpha x + beta y; where beta is 0, y need not be a number.
  subroutine combine(alpha, x, beta, y, space)
    real(wp), intent(in) :: alpha, beta
    real(wp), intent(in), contiguous :: x(:)
    real(wp), intent(inout), contiguous :: y(:)
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    integer :: i

    if (abs(beta) > 0.0_wp) then
      !$omp parallel do simd schedule(static) num_threads(space%threads)
      do i = 1, size(x)
        y(i) = alpha*x(i) + beta*y(i)
      end do
      !$omp end parallel do simd
    else
      !$omp parallel do simd schedule(static) num_threads(space%threads)
      do i = 1, size(x)
        y(i) = alpha*x(i)
      end do
      !$omp end parallel do simd
    end if
  end subroutine combine

  !> Add a multiple of a vector to another.
  pure subroutine add_multiple(n, factor, x, y)
    integer, intent(in) :: n
    real(wp), intent(in) :: factor, x(n)
    real(wp), intent(inout) :: y(n)
    integer :: i

    !$omp simd
    do i = 1, n
      y(i) = y(i) + factor*x(i)
    end do
  end subroutine add_multiple

  !> Discard the last direction.
  pure subroutine restart(self)
    class(conjugate_gradient_t), intent(inout) :: self
    self%rz = 0.0_wp
  end subroutine restart

  !> Compute the share of the last direction in the next, zero if there is none.
  pure subroutine last_share(self, rz, share)
    class(conjugate_gradient_t), intent(inout) :: self
    !> r^T z
    real(wp), intent(in) :: rz
    real(wp), intent(out) :: share

    share = 0.0_wp
    if (self%rz > 0.0_wp) share = rz/self%rz
    self%rz = rz
  end subroutine last_share

  !> Compute the length of the step along the direction; zero: nothing is left to gain in working precision, or a matrix is not
  !> positive definite.
  pure real(wp) function step_length(self, curvature)
    class(conjugate_gradient_t), intent(in) :: self
    !> d^T A d
    real(wp), intent(in) :: curvature

    step_length = 0.0_wp
    if (curvature > 0.0_wp .and. self%rz > 0.0_wp) step_length = self%rz/curvature
  end function step_length

end module hc_projected_cg
