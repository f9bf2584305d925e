!> Difference of a traction from its hats between the nodes, near the edges of a contact: its best approximation by hats, and the
!> displacement of the rest.
!>
!> It is sampled at the points of a lattice `samples` times as fine, in the cells of the lattice next to the edges. Hats
!> with the same weighted means about each node, the weights being a hat smoothed by a hat, have its moments up to the
!> third; the displacement of the rest falls off so fast that a sum over the cells nearby suffices.
!>
!> Equations: docs/theory/interior.md, (I17) and (I18).
module hc_edge_residue
  use hc_precision, only: wp, lk
  use hc_error, only: error_t, status, raise
  use hc_lattice, only: lattice_t
  use hc_elastic_medium, only: elastic_medium_t, influence_t, n_block, block_index
  use hc_field_space, only: field_space_t
  use hc_active_set, only: active_set_t, new_active_set
  use hc_linear_system, only: linear_system_t, constraints_t, iteration_t, solution_accurate
  use hc_projected_cg, only: projected_cg
  implicit none
  private

  public :: edge_residue_t, new_edge_residue, edge_residue_memory, not_found

  !> Error of the correction at the edges
  character(len=*), parameter :: not_found = &
    'the tractions at the edges of the contact were not found to the accuracy of the correction; use source "nodes"'

  !> Cells about a node whose residue moves it.
  integer, parameter :: reach = 4
  !> Nodes about a cell on whose means its points count, and reach of the matrix of these means.
  integer, parameter :: means_of = 2
  !> Means of the hats are those of the residue to this share of the largest, after at most as many iterations.
  real(wp), parameter :: accuracy = 1.0e-4_wp
  integer, parameter :: most_iterations = 60
  !> Cells over the square root of the number of nodes in a round zone: about twelve rows along its edge.
  real(wp), parameter :: cells_of_zone = 50.0_wp

  !> Points between the nodes near the edges.
  type :: edge_residue_t
    type(lattice_t) :: lattice
    !> Points along a spacing
    integer :: samples = 1
    !> Number of the cell whose first node a node is, 0: there is none (n_col, n_row)
    integer, allocatable :: cell(:, :)
    !> First node of each cell (2, cell)
    integer, allocatable :: node(:, :)
    !> Values (point, component, cell) [Pa]
    real(wp), allocatable :: values(:, :, :)
  contains
    !> Position of a point
    procedure :: point
    !> Hats that have the means of the values
    procedure :: hats
    !> Take hats off the values
    procedure :: take_off
    !> Displacements of nodes by the values
    procedure :: displacements
  end type edge_residue_t

  !> Means of hats about each node, as a linear system.
  type, extends(linear_system_t) :: means_t
    integer :: extent(2) = 0
    real(wp) :: weight(-means_of:means_of, -means_of:means_of) = 0.0_wp
  contains
    procedure :: product => mean_product
  end type means_t

contains

  !> Set up points in some cells and those about them, with values of 0.
  pure subroutine new_edge_residue(self, lattice, samples, near, n)
    !> Points to be set up
    type(edge_residue_t), intent(out) :: self
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Points along a spacing
    integer, intent(in) :: samples
    !> First nodes of the cells (n_col, n_row)
    logical, intent(in) :: near(:, :)
    !> Number of components
    integer, intent(in) :: n
    integer :: col, row, k

    self%lattice = lattice
    self%samples = samples
    allocate (self%cell(size(near, 1), size(near, 2)), source=0)
    k = 0
    do row = 1, size(near, 2)
      do col = 1, size(near, 1)
        associate (c => [max(col - means_of, 1), min(col + means_of, size(near, 1))], &
                   r => [max(row - means_of, 1), min(row + means_of, size(near, 2))])
          if (.not. any(near(c(1):c(2), r(1):r(2)))) cycle
        end associate
        k = k + 1
        self%cell(col, row) = k
      end do
    end do
    allocate (self%node(2, k), self%values(samples**2, n, k))
    self%values = 0.0_wp
    do row = 1, size(near, 2)
      do col = 1, size(near, 1)
        if (self%cell(col, row) > 0) self%node(:, self%cell(col, row)) = [col, row]
      end do
    end do
  end subroutine new_edge_residue

  !> Return the position of a point of a cell, in columns and rows from its first node.
  pure function point(self, i) result(at)
    class(edge_residue_t), intent(in) :: self
    !> Number of the point
    integer, intent(in) :: i
    real(wp) :: at(2)
    at = real([mod(i - 1, self%samples), (i - 1)/self%samples], wp)/self%samples
  end function point

  !> Count the bytes of points along the edges of a round zone.
  pure integer(selected_int_kind(18)) function edge_residue_memory(n_zone, samples, n)
    !> Nodes of the zone, points along a spacing, components
    integer, intent(in) :: n_zone, samples, n
    integer, parameter :: long = selected_int_kind(18)

    ! values of the points, and the first node of each cell
    edge_residue_memory = int(cells_of_zone*sqrt(real(n_zone, wp)), long)*8*(samples**2*n + 1)
  end function edge_residue_memory

  !> Find the hats that have the means of the points about each node, (I17).
  subroutine hats(self, space, values, error)
    class(edge_residue_t), intent(in) :: self
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Values at the nodes (n_col, n_row, component) [Pa]
    real(wp), intent(out), allocatable :: values(:, :, :)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    type(means_t) :: means
    real(wp) :: weight(-2*self%samples:2*self%samples, -2*self%samples:2*self%samples)
    real(wp), allocatable :: x(:), ax(:), rhs(:)
    type(constraints_t) :: none
    type(iteration_t) :: iteration
    type(active_set_t) :: nodes
    integer :: i, j, k, col, row, component

    associate (m => self%samples, n => self%lattice%extent)
      weight = smooth_weights(m)
      do row = -means_of, means_of
        do col = -means_of, means_of
          do j = 1 - m, m - 1
            do i = 1 - m, m - 1
              if (maxval(abs([i - m*col, j - m*row])) > 2*m) cycle
              means%weight(col, row) = means%weight(col, row) + hat(i, j, m)*weight(i - m*col, j - m*row)
            end do
          end do
        end do
      end do
      means%space = space
      means%extent = n
      allocate (values(n(1), n(2), size(self%values, 2)))
      do component = 1, size(self%values, 2)
        values(:, :, component) = 0.0_wp
        do k = 1, size(self%node, 2)
          do row = max(self%node(2, k) - 1, 1), min(self%node(2, k) + means_of, n(2))
            do col = max(self%node(1, k) - 1, 1), min(self%node(1, k) + means_of, n(1))
              associate (away => m*(self%node(:, k) - [col, row]))
                values(col, row, component) = values(col, row, component) + sum(self%values(:, component, k) &
                  *reshape(weight(away(1):away(1) + m - 1, away(2):away(2) + m - 1), [m**2]))
              end associate
            end do
          end do
        end do
        rhs = reshape(values(:, :, component), [product(n)])
        x = rhs
        allocate (ax(size(x)))
        call means%product(x, ax, error)
        if (allocated(error)) return
        call new_active_set(nodes, spread(.true._lk, 1, size(x)), space)
        if (.not. allocated(none%mb)) allocate (none%columns(size(x), 0), none%mb(size(x), 0))
        iteration = iteration_t(tolerance=accuracy*maxval(abs(rhs)), most=most_iterations)
        call projected_cg(means, nodes, none, rhs, x, ax, iteration, error)
        if (allocated(error)) return
        if (iteration%outcome /= solution_accurate) then
          call raise(error, status%no_convergence, not_found)
          return
        end if
        values(:, :, component) = reshape(x, [n(1), n(2)])
        deallocate (ax)
      end do
    end associate
  end subroutine hats

  !> Evaluate a hat at a point of the fine lattice.
  pure real(wp) function hat(i, j, m)
    !> Steps from the node, and how many make a spacing
    integer, intent(in) :: i, j, m
    hat = real(max(m - max(abs(i), abs(j), abs(i + j)), 0), wp)/m
  end function hat

  !> Compute the weights of points in the mean about a node: a hat smoothed by a hat, their sum is 1.
  pure function smooth_weights(m) result(weight)
    !> Points along a spacing
    integer, intent(in) :: m
    real(wp) :: weight(-2*m:2*m, -2*m:2*m)
    integer :: i, j, k, l

    weight = 0.0_wp
    do l = 1 - m, m - 1
      do k = 1 - m, m - 1
        if (.not. hat(k, l, m) > 0.0_wp) cycle
        do j = 1 - m, m - 1
          do i = 1 - m, m - 1
            weight(i + k, j + l) = weight(i + k, j + l) + hat(i, j, m)*hat(k, l, m)
          end do
        end do
      end do
    end do
    weight = weight/real(m, wp)**4
  end function smooth_weights

  subroutine mean_product(self, x, y, error)
    class(means_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error
    real(wp), pointer, contiguous :: from(:, :), onto(:, :)
    integer :: i, j

    associate (n => self%extent)
      from(1:n(1), 1:n(2)) => x
      onto(1:n(1), 1:n(2)) => y
      y = 0.0_wp
      do j = -means_of, means_of
        do i = -means_of, means_of
          if (.not. self%weight(i, j) > 0.0_wp) cycle
          associate (c => [max(1, 1 - i), min(n(1), n(1) - i)], r => [max(1, 1 - j), min(n(2), n(2) - j)])
            onto(c(1):c(2), r(1):r(2)) = onto(c(1):c(2), r(1):r(2)) &
                                         + self%weight(i, j)*from(c(1) + i:c(2) + i, r(1) + j:r(2) + j)
          end associate
        end do
      end do
    end associate
  end subroutine mean_product

  !> Take hats off the values.
  pure subroutine take_off(self, nodal)
    class(edge_residue_t), intent(inout) :: self
    !> Values at the nodes (n_col, n_row, component) [Pa]
    real(wp), intent(in) :: nodal(:, :, :)
    real(wp) :: corner(4), at(2)
    integer :: i, k, component, c(2), r(2)

    do k = 1, size(self%node, 2)
      c = min(self%node(1, k) + [0, 1], size(nodal, 1))
      r = min(self%node(2, k) + [0, 1], size(nodal, 2))
      do component = 1, size(nodal, 3)
        corner = reshape(nodal(c, r, component), [4])
        do i = 1, self%samples**2
          at = self%point(i)
          associate (value => self%values(i, component, k), u => at(1), v => at(2))
            if (u + v <= 1.0_wp) then
              value = value - ((1.0_wp - u - v)*corner(1) + u*corner(2) + v*corner(3))
            else
              value = value - ((1.0_wp - v)*corner(2) + (1.0_wp - u)*corner(3) + (u + v - 1.0_wp)*corner(4))
            end if
          end associate
        end do
      end do
    end do
  end subroutine take_off

  !> Compute the relative displacements of nodes by the values, as of hats of the fine lattice in the cells nearby.
  function displacements(self, medium, wanted, onto) result(moved)
    class(edge_residue_t), intent(in) :: self
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> Nodes whose displacement is computed (n_col, n_row)
    logical, intent(in) :: wanted(:, :)
    !> Components that are computed; those of the values are 1 and the next ones
    integer, intent(in) :: onto(:)
    !> Displacements (n_col, n_row, component) [m]
    real(wp) :: moved(size(wanted, 1), size(wanted, 2), size(onto))
    real(wp), allocatable :: table(:, :, :, :, :) ! (point, from, onto, away)
    real(wp) :: at(2), block(n_block, 1), total(size(onto))
    class(influence_t), allocatable :: influence
    integer :: i, j, k, col, row, from, to, first(2), last(2)

    associate (m => self%samples, basis => self%lattice%basis, n => size(self%values, 2))
      call medium%new_influence(basis/m, influence)
      allocate (table(m**2, n, size(onto), -reach:reach, -reach:reach))
      do j = -reach, reach
        do i = -reach, reach
          do k = 1, m**2
            at = matmul(basis, [i, j] - self%point(k))
            call influence%blocks(at(1:1), at(2:2), block)
            do to = 1, size(onto)
              do from = 1, n
                associate (b => block_index(onto(to), from))
                  table(k, from, to, i, j) = sign(1.0_wp, real(b, wp))*block(abs(b), 1)
                end associate
              end do
            end do
          end do
        end do
      end do
      moved = 0.0_wp
      do row = 1, size(wanted, 2)
        do col = 1, size(wanted, 1)
          if (.not. wanted(col, row)) cycle
          first = max([col, row] - reach, 1)
          last = min([col, row] + reach, shape(wanted))
          total = 0.0_wp
          do j = first(2), last(2)
            do i = first(1), last(1)
              k = self%cell(i, j)
              if (k == 0) cycle
              do to = 1, size(onto)
                do from = 1, n
                  total(to) = total(to) + dot_product(table(:, from, to, col - i, row - j), self%values(:, from, k))
                end do
              end do
            end do
          end do
          moved(col, row, :) = total
        end do
      end do
    end associate
  end function displacements

end module hc_edge_residue
