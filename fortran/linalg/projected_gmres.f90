!> GMRES on a set of active nodes, with linear constraints (hc_linear_system), for a matrix that is not symmetric.
!>
!> The projection of the preconditioned residual satisfies the constraints on C^T x exactly, whose multipliers act along
!> other vectors B,
!>
!>     z <- M r - M B (C^T M B)^-1 C^T M r.
!>
!> Of the products A z only the part off the active nodes is stored: with the weights W, the matrix H of Arnoldi's method and
!> the shares s of the constraints, on the active nodes A Z = W^-1 V H + B s. Where there are many directions, that of their sum
!> is computed instead: it takes less time than they take memory. V and M r may be stored in single precision, while
!> the arithmetic is in double; M r is rounded before its product then.
!>
!> (Y. Saad and M. H. Schultz, SIAM J. Sci. Stat. Comput. 7, 1986, 856-869; J. I. Aliaga, H. Anzt et al., Int. J. High Perform.
!> Comput. Appl. 37, 2023, 5-25).
!>
!> Equations: docs/theory/friction.md, (F11).
module hc_projected_gmres
  use hc_precision, only: wp, sp
  use hc_error, only: error_t, status, raise
  use hc_active_set, only: active_set_t
  use hc_memory, only: give_back
  use hc_field_space, only: field_space_t
  use hc_linear_system, only: linear_system_t, constraints_t, iteration_t, solution_accurate, iterations_used_up, &
    solution_broke_off
  implicit none
  private

  public :: projected_gmres

  !> A direction of the search.
  type :: direction_t
    !> Weighted residual v on the active nodes, and M r there, r that residual without its weights: the direction is
    !> z = M r + M B share with C^T z = 0
    real(wp), allocatable :: v(:), mr(:)
    !> The same in single precision
    real(sp), allocatable :: rounded(:), rounded_mr(:)
    !> The product A z on the other nodes; of the first direction also that of the sum
    real(sp), allocatable :: beyond(:)
  end type direction_t

contains

  !> Solve by GMRES, preconditioned from the right, with the constraints C^T x satisfied exactly; the norm of a residual is that of
  !> Euclid, with the weights.
  subroutine projected_gmres(system, nodes, constraints, rhs, x, ax, iteration, error)
    !> Operator and preconditioner
    class(linear_system_t), intent(inout) :: system
    !> Nodes that carry unknowns
    type(active_set_t), intent(in) :: nodes
    !> Constraints; their multipliers are on entry a start
    type(constraints_t), intent(inout) :: constraints
    !> Right-hand side at the active nodes, whose memory becomes that of the residual
    real(wp), allocatable, intent(inout) :: rhs(:)
    !> Unknowns (n_active), on entry a start that satisfies the constraints
    real(wp), intent(inout), contiguous :: x(:)
    !> Product A x (n), everywhere
    real(wp), intent(inout), contiguous :: ax(:)
    !> How far it may go, and how it ended
    type(iteration_t), intent(inout) :: iteration
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    !> Directions take their memory one by one: mostly a few are enough
    type(direction_t) :: basis(iteration%most_directions + 1)
    !> Residual that becomes the next; in its memory also a direction and its product
    real(wp), allocatable :: w(:)
    type(active_set_t) :: others
    !> A product over all nodes, and memory for it where the system has none; between products it serves for vectors
    real(wp), pointer, contiguous :: image(:)
    real(wp), allocatable, target :: own(:)
    !> Places of the last active nodes of the parts
    integer :: last(0:size(iteration%weight))
    !> H, and after rotations
    real(wp), dimension(iteration%most_directions + 1, iteration%most_directions) :: arnoldi, h
    real(wp), dimension(iteration%most_directions + 1) :: g, left
    !> Largest rounding errors of the stored residuals
    real(wp) :: rounded_off(iteration%most_directions + 1)
    real(wp), dimension(iteration%most_directions) :: c, s, y
    real(wp) :: share(size(constraints%multiplier), iteration%most_directions), length, began
    real(wp) :: inverse(size(constraints%multiplier), size(constraints%multiplier))
    !> Norms of the columns, with the weights of the residual
    real(wp) :: along(size(constraints%multiplier))
    integer :: directions
    type(field_space_t) :: space

    space = nodes%space
    iteration%made = 0
    iteration%residual = huge(1.0_wp)
    iteration%drift = 0.0_wp
    iteration%outcome = solution_broke_off
    call constraints%invert(space, inverse, iteration%independent)
    if (.not. iteration%independent) return
    call begin()
    if (.not. length > 0.0_wp) return
    iteration%outcome = iterations_used_up
    do while (iteration%outcome == iterations_used_up .and. iteration%made < iteration%most .and. length > 0.0_wp)
      call search(min(iteration%most_directions, iteration%most - iteration%made))
      if (allocated(error)) return
      call take_step()
      if (allocated(error)) return
      iteration%made = iteration%made + directions
    end do

  contains

    !> Compute the weighted residual of the start, the first direction.
    subroutine begin()
      type(active_set_t) :: of_part
      real(wp), allocatable :: r(:)
      real(wp) :: unit(size(along))
      integer :: i, part

      rounded_off = 0.0_wp
      others = nodes%complement(size(ax))
      allocate (r(nodes%n_active))
      part = size(ax)/size(iteration%weight)
      last(0) = 0
      do i = 1, size(iteration%weight)
        of_part = nodes%slice((i - 1)*part + 1, i*part)
        last(i) = last(i - 1) + of_part%n_active
      end do
      do i = 1, size(along)
        unit = 0.0_wp
        unit(i) = 1.0_wp
        r = 0.0_wp
        call constraints%add_columns(space, unit, r)
        call weigh(iteration%weight, r)
        along(i) = sqrt(space%dot(r, r))
      end do
      call move_alloc(rhs, w)
      call nodes%pack(ax, r)
      w = w - r
      call constraints%add_columns(space, constraints%multiplier, w, r)
      call weigh(iteration%weight, w)
      length = sqrt(space%dot(w, w))
      iteration%residual = length
      iteration%drift = epsilon(1.0_wp)*length
      iteration%rounding = 0.0_wp
      if (length <= 0.0_wp) iteration%outcome = solution_accurate
    end subroutine begin

    !> Find directions, and the combination of them that reduces the residual most.
    subroutine search(most)
      !> Directions allowed
      integer, intent(in) :: most
      real(wp) :: rotated
      integer :: i, k

      directions = 0
      began = length
      w = w/length
      call keep(1)
      g = 0.0_wp
      g(1) = began
      h = 0.0_wp
      do k = 1, most
        call find_direction(k)
        if (allocated(error)) return
        call system%product_packed(nodes, w, image, error)
        if (allocated(error)) return
        call nodes%pack(image, w)
        if (allocated(basis(k)%beyond)) call others%pack(image, basis(k)%beyond)
        call constraints%add_columns(space, -share(:, k), w, image(:size(w)))
        call weigh(iteration%weight, w)
        do i = 1, k
          if (iteration%single) then
            h(i, k) = space%dot(basis(i)%rounded, w)
          else
            h(i, k) = space%dot(basis(i)%v, w)
          end if
          call add_residual(-h(i, k), i)
        end do
        h(k + 1, k) = sqrt(space%dot(w, w))
        arnoldi(:, k) = h(:, k)
        if (h(k + 1, k) > 0.0_wp) w = w/h(k + 1, k)
        call keep(k + 1)
        do i = 1, k - 1
          rotated = c(i)*h(i, k) + s(i)*h(i + 1, k)
          h(i + 1, k) = -s(i)*h(i, k) + c(i)*h(i + 1, k)
          h(i, k) = rotated
        end do
        length = hypot(h(k, k), h(k + 1, k))
        if (.not. length > 0.0_wp) iteration%outcome = solution_broke_off
        if (iteration%outcome == solution_broke_off) exit
        directions = k
        c(k) = h(k, k)/length
        s(k) = h(k + 1, k)/length
        h(k, k) = length
        g(k + 1) = -s(k)*g(k)
        g(k) = c(k)*g(k)
        iteration%residual = abs(g(k + 1))
        if (iteration%residual <= iteration%tolerance) exit
      end do
      if (iteration%residual <= iteration%tolerance) iteration%outcome = solution_accurate
    end subroutine search

    !> Take the memory of a direction, of the residual after it, and of a product, on all ranks or on none.
    subroutine take_memory(k)
      !> Its number
      integer, intent(in) :: k
      integer :: stat

      associate (double => merge(0, nodes%n_active, iteration%single), single => merge(nodes%n_active, 0, iteration%single))
        allocate (basis(k)%rounded_mr(single), basis(k)%mr(double), basis(k + 1)%rounded(single), basis(k + 1)%v(double), stat=stat)
      end associate
      if (stat == 0 .and. k <= iteration%most_products) allocate (basis(k)%beyond(others%n_active), stat=stat)
      if (stat == 0) call system%take_image(size(ax), own, image, stat)
      call agree(stat)
    end subroutine take_memory

    !> Raise an error where a rank has not enough memory.
    subroutine agree(stat)
      !> Not zero: there is not enough memory
      integer, intent(in) :: stat

      if (stat /= 0) then
        call raise(error, status%resources, 'not enough memory for another direction of GMRES: choose a smaller window')
      end if
      call space%agree(error)
    end subroutine agree

    !> Store a residual.
    subroutine keep(i)
      !> Its number
      integer, intent(in) :: i

      if (iteration%single) then
        basis(i)%rounded = real(w, sp)
        rounded_off(i) = 0.5_wp*epsilon(1.0_sp)*space%max_abs(w)
      else
        basis(i)%v = w
      end if
    end subroutine keep

    !> Add a multiple of a stored residual to w.
    subroutine add_residual(factor, i)
      real(wp), intent(in) :: factor
      !> Its number
      integer, intent(in) :: i

      if (iteration%single) then
        w = w + factor*basis(i)%rounded
      else
        w = w + factor*basis(i)%v
      end if
    end subroutine add_residual

    !> Compute a direction.
    subroutine find_direction(k)
      !> Its number
      integer, intent(in) :: k
      !> Its residual without the weights, freed before the direction takes its memory
      real(wp), allocatable :: r(:)
      integer :: i, stat

      do i = 2, merge(k - 1, 0, k > iteration%most_products)
        if (allocated(basis(i)%beyond)) deallocate (basis(i)%beyond)
      end do
      ! after a restart the same memory serves again
      if (iteration%made == 0) call give_back(size(ax))
      allocate (r(nodes%n_active), stat=stat)
      call agree(stat)
      if (allocated(error)) return
      if (iteration%single) then
        r = basis(k)%rounded
      else
        r = basis(k)%v
      end if
      call weigh(1.0_wp/iteration%weight, r)
      call system%precondition_packed(nodes, size(ax), r, w)
      deallocate (r)
      call take_memory(k)
      if (allocated(error)) return
      if (iteration%single) then
        basis(k)%rounded_mr = real(w, sp)
        w = basis(k)%rounded_mr
      else
        basis(k)%mr = w
      end if
      share(:, k) = -matmul(inverse, constraints%resultants(space, w, image(:size(w))))
      call constraints%add_mb(space, share(:, k), w)
    end subroutine find_direction

    !> Add that combination to the unknowns, their product and the multipliers; the residual that is left is the first direction.
    subroutine take_step()
      real(wp) :: factor, largest
      logical :: many
      integer :: i

      many = .not. allocated(basis(max(directions, 1))%beyond)
      do i = directions, 1, -1
        y(i) = (g(i) - dot_product(h(i, i + 1:directions), y(i + 1:directions)))/h(i, i)
      end do
      ! where nodes slip far, or motions are all but free, the terms of A x are large and cancel
      do i = 1, directions
        iteration%drift = iteration%drift + epsilon(1.0_wp)*abs(y(i))*(norm2(arnoldi(:i + 1, i)) &
                                                                       + dot_product(abs(share(:, i)), along))
      end do
      ! solution and product from the same directions: the preconditioner is of single precision, and where a node
      ! slips far the matrix would make displacements of its rounding errors
      left = 0.0_wp
      w = 0.0_wp
      do i = 1, directions + 1
        left(i) = -dot_product(arnoldi(i, :directions), y(:directions))
        call add_residual(-left(i), i)
      end do
      call weigh(1.0_wp/iteration%weight, w)
      call constraints%add_columns(space, matmul(share(:, :directions), y(:directions)), w, image(:size(w)))
      call nodes%add(1.0_wp, w, ax)
      w = 0.0_wp
      call constraints%add_mb(space, matmul(share(:, :directions), y(:directions)), w)
      do i = 1, directions
        if (iteration%single) then
          w = w + y(i)*basis(i)%rounded_mr
        else
          w = w + y(i)*basis(i)%mr
        end if
        iteration%rounding = iteration%rounding + abs(y(i))*arnoldi(i + 1, i)*rounded_off(i + 1)/minval(iteration%weight)
      end do
      call space%add(w, x)
      if (many) then
        call system%product_packed(nodes, w, image, error)
        if (allocated(error)) return
        call others%pack(image, basis(1)%beyond)
      end if
      if (allocated(own)) deallocate (own)
      do i = 1, merge(1, directions, many)
        factor = merge(1.0_wp, y(i), many)
        call others%add(factor, basis(i)%beyond, ax)
        largest = abs(factor)*space%largest(real(max(maxval(abs(basis(i)%beyond)), 0.0_sp), wp))
        iteration%rounding = iteration%rounding + 0.5_wp*epsilon(1.0_sp)*largest
      end do
      constraints%multiplier = constraints%multiplier + matmul(share(:, :directions), y(:directions))
      if (iteration%outcome /= iterations_used_up) return
      left(1) = left(1) + began
      w = 0.0_wp
      do i = 1, directions + 1
        call add_residual(left(i), i)
      end do
      length = sqrt(space%dot(w, w))
      basis = direction_t()
    end subroutine take_step

    !> Multiply by one factor for each part.
    subroutine weigh(factor, values)
      !> The factors, and values at the active nodes
      real(wp), intent(in) :: factor(:)
      real(wp), intent(inout), contiguous :: values(:)
      integer :: p

      do p = 1, size(factor)
        values(last(p - 1) + 1:last(p)) = factor(p)*values(last(p - 1) + 1:last(p))
      end do
    end subroutine weigh

  end subroutine projected_gmres

end module hc_projected_gmres
