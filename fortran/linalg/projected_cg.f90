!> Conjugate gradients on a set of active nodes, with linear constraints (hc_linear_system).
!>
!> The projection of the preconditioned residual satisfies the constraints on B^T x exactly,
!>
!>     z <- M r - M B (B^T M B)^-1 B^T M r.
!>
!> (M. R. Hestenes and E. Stiefel, J. Res. Natl. Bur. Stand. 49, 1952, 409-436).
!>
!> Equations: docs/theory/friction.md, (F11).
module hc_projected_cg
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_active_set, only: active_set_t
  use hc_conjugate_gradient, only: conjugate_gradient_t
  use hc_field_space, only: field_space_t, sum_block
  use hc_linear_system, only: linear_system_t, invert_gram, solution_accurate, iterations_used_up, solution_broke_off
  implicit none
  private

  public :: projected_cg

contains

  !> Solve by preconditioned conjugate gradients with projection on the constraints.
  subroutine projected_cg(system, nodes, b, m_b, rhs, x, ax, tolerance, max_iterations, &
                          multiplier, residual, iterations, outcome, error, drift)
    !> Operator and preconditioner
    class(linear_system_t), intent(inout) :: system
    !> Nodes that carry unknowns
    type(active_set_t), intent(in) :: nodes
    !> Constraint vectors B and M B, at these nodes (n_active, number of constraints, may be 0)
    real(wp), intent(in), contiguous :: b(:, :), m_b(:, :)
    !> Right-hand side (n); freed, once there is a copy of its active part
    real(wp), allocatable, intent(inout) :: rhs(:)
    !> Unknowns (n), on entry a start that satisfies the constraints
    real(wp), intent(inout), contiguous :: x(:)
    !> Product A x (n), everywhere, on entry and on return
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

    !> Product of a direction, over all nodes
    real(wp), allocatable :: onto(:)
    !> On the active nodes: rhs - A x; the residual, whose memory serves for the product of the direction, too; its
    !> preconditioned projection; the direction
    real(wp), allocatable :: left(:), r(:), z(:), d(:)
    type(conjugate_gradient_t) :: recurrence
    real(wp) :: step, largest
    real(wp) :: inverse(size(b, 2), size(b, 2))
    integer :: i, k, m, shift
    type(field_space_t) :: space
    logical :: independent, anew

    space = system%space
    associate (n => nodes%n_active)
      allocate (left(n), r(n), z(n), d(n))
    end associate
    call nodes%pack(rhs, left)
    deallocate (rhs)
    call add_at_nodes(nodes, -1.0_wp, ax, left, space)
    allocate (onto(size(x)))
    call invert_gram(b, m_b, inverse, independent, space)
    iterations = 0
    largest = 0.0_wp
    outcome = iterations_used_up
    multiplier = 0.0_wp
    do m = 1, size(multiplier)
      multiplier(m) = -space%dot(b(:, m), left)/space%dot(b(:, m), b(:, m))
    end do
    do
      ! The share of the constraints is taken out of the residual before it is
      ! preconditioned: it is the larger part by far, and its rounding errors would stay.
      ! The rest is normal to M B, so that the projected preconditioner is
      ! symmetric even if the given M B is only about M times B.
      call constrained_residual(b, multiplier, left, r, residual, space)
      if (size(multiplier) > 0) then
        multiplier = multiplier - matmul(space%dots(m_b, r), inverse)
        call constrained_residual(b, multiplier, left, r, residual, space)
      end if
      largest = max(largest, residual)
      if (residual <= tolerance .or. iterations >= max_iterations) exit
      call system%precondition_packed(nodes, size(x), r, z, error)
      if (allocated(error)) return
      call space%add_columns(m_b, -matmul(inverse, space%dots(b, z)), z)

      call recurrence%last_share(space%dot(r, z), step, anew)
      !$omp parallel do schedule(static) num_threads(space%threads)
      do i = 1, size(d)
        if (anew) then
          d(i) = z(i)
        else
          d(i) = z(i) + step*d(i)
        end if
      end do
      !$omp end parallel do
      call system%product_packed(nodes, d, onto, error)
      if (allocated(error)) return
      associate (ad => r)
        call nodes%pack(onto, ad)
        step = recurrence%step_length(space%dot(d, ad))
        if (.not. step > 0.0_wp) then
          outcome = solution_broke_off
          exit
        end if
        !$omp parallel num_threads(space%threads) private(i, shift)
        !$omp do schedule(static)
        do k = 1, size(nodes%first)
          shift = nodes%place(k) - nodes%first(k)
          do i = nodes%first(k), nodes%last(k)
            x(i) = x(i) + step*d(i + shift)
            left(i + shift) = left(i + shift) - step*ad(i + shift)
          end do
        end do
        !$omp end do nowait
        !$omp do schedule(static)
        do i = 1, size(ax)
          ax(i) = ax(i) + step*onto(i)
        end do
        !$omp end do
        !$omp end parallel
      end associate
      iterations = iterations + 1
    end do
    call system%release()
    if (residual <= tolerance) outcome = solution_accurate
    ! the largest of several numbers hides one that is not a number
    if (.not. ieee_is_finite(space%dot(r, r))) outcome = solution_broke_off
    if (present(drift)) drift = epsilon(1.0_wp)*largest
  end subroutine projected_cg

  !> Add a multiple of the values of a field at the active nodes.
  subroutine add_at_nodes(nodes, factor, field, packed, space)
    !> Active nodes
    type(active_set_t), intent(in) :: nodes
    !> The multiple
    real(wp), intent(in) :: factor
    !> Field over all nodes
    real(wp), intent(in), contiguous :: field(:)
    !> Values at the active nodes
    real(wp), intent(inout), contiguous :: packed(:)
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    integer :: i, k, shift

    !$omp parallel do schedule(static) num_threads(space%threads) private(i, shift)
    do k = 1, size(nodes%first)
      shift = nodes%place(k) - nodes%first(k)
      do i = nodes%first(k), nodes%last(k)
        packed(i + shift) = packed(i + shift) + factor*field(i)
      end do
    end do
    !$omp end parallel do
  end subroutine add_at_nodes

  !> Compute r = rhs - A x + B m and its largest element.
  subroutine constrained_residual(b, multiplier, left, r, largest, space)
    !> Constraint vectors and multipliers
    real(wp), intent(in), contiguous :: b(:, :)
    real(wp), intent(in) :: multiplier(:)
    !> rhs - A x
    real(wp), intent(in), contiguous :: left(:)
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
        r(i) = left(i)
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

end module hc_projected_cg
