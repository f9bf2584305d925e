!> The lattice of nodes that carry the overlapping pyramids.
!>
!> A node has two integer indices (col, row) and lies at
!>
!>     origin + col * basis(:, 1) + row * basis(:, 2)
!>
!> so that any pair of basis vectors gives a regular triangulation with the
!> three edge directions basis(:, 1), basis(:, 2) and basis(:, 2) - basis(:, 1).
!> The 60-degree lattice of the dissertation, eq. (5.1), is the default. A window is the rhombus of nodes in
!> memory; a field over it is an array of shape (n_col, n_row).
!>
!> Equations: docs/theory/discretisation.md, (D1), (D2).
module hc_lattice
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp
  use hc_options, only: multilevel_options_t
  use hc_error, only: error_t, status, raise
  implicit none
  private

  public :: lattice_t, new_lattice, check_lattice, equilateral_basis, oblique_basis, edge_directions, neighbors, &
            neighbor_steps, opposite_pairs, floor_half

  !> Steps in column and row to the six neighbors of a node, along the edges of the triangulation.
  integer, parameter :: neighbors(2, 6) = reshape([1, 0, 0, 1, -1, 1, -1, 0, 0, -1, 1, -1], [2, 6])

  !> The neighbors by pairs on opposite sides.
  integer, parameter :: opposite_pairs(6) = [1, 4, 2, 5, 6, 3]

  !> Nodes of a window and size of an index that default integers can still work with.
  integer, parameter :: most_nodes = 2**29 - 1, largest_index = most_nodes

  !> Basis, origin and index window of a lattice.
  type :: lattice_t
    !> Basis vectors as columns [m]
    real(wp) :: basis(2, 2) = 0.0_wp
    !> Position of node (0, 0) [m]
    real(wp) :: origin(2) = 0.0_wp
    !> Smallest column and row index of the window
    integer :: first(2) = 0
    !> Number of columns and rows of the window
    integer :: extent(2) = 0
    !> Whether the window repeats along columns and rows; else it ends, and there is nothing beyond
    logical :: periodic(2) = .false.
  contains
    !> Number of nodes in the window
    procedure :: size => lattice_size
    !> Area of a lattice cell = volume of the pyramid of unit height [m^2]
    procedure :: cell_area
    !> Length of the longest edge of the triangulation [m]
    procedure :: spacing => lattice_spacing
    !> Columns and rows per length across them [1/m]
    procedure :: lines_per_length
    !> Coordinates of every node of the window, and of those of one row [m]
    procedure :: coordinates, row_coordinates
    !> The lattice of every second node of this one
    procedure :: coarsened
    !> Basis vectors over the spacing
    procedure :: unit_basis
    !> Column and row of a neighbor of a node
    procedure :: neighbor
    !> Neighbours at the ends of edges that are not much longer than the shortest
    procedure :: near_neighbors
    !> Ratio of the edges of a cell, the longer over the shorter one, and the dimension of the shorter one
    procedure :: slenderness, short_side
    !> Whether the window repeats, both ways
    procedure :: is_periodic
    !> Values of the neighbors at all nodes
    procedure :: shifted
    !> Sum and largest value over each node and its neighbors; nodes of a zone and those next to it
    procedure :: ring_sum, ring_max, dilated
    !> The part of the window around some nodes: its columns and rows, whether it pays, its lattice
    procedure :: enclose, enclose_lines, subwindow
  end type lattice_t

contains

  !> Set up a lattice from its basis vectors and window.
  pure subroutine new_lattice(lattice, basis, first, extent, error, origin)
    !> Lattice to be set up
    type(lattice_t), intent(out) :: lattice
    !> Basis vectors as columns, counter-clockwise [m]
    real(wp), intent(in) :: basis(2, 2)
    !> Smallest column and row index of the window
    integer, intent(in) :: first(2)
    !> Number of columns and rows of the window, at least 1
    integer, intent(in) :: extent(2)
    !> Allocated on failure: a degenerate basis, an empty or too large window, numbers that are not finite
    type(error_t), allocatable, intent(out) :: error
    !> Position of node (0, 0), default (0, 0) [m]
    real(wp), intent(in), optional :: origin(2)

    lattice%basis = basis
    lattice%first = first
    lattice%extent = extent
    if (present(origin)) lattice%origin = origin
    call check_lattice(lattice, error)
  end subroutine new_lattice

  !> Refuse a lattice on which nothing can be computed.
  pure subroutine check_lattice(lattice, error)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Allocated on failure: a degenerate basis, an empty or too large window, numbers that are not finite
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: long = selected_int_kind(18)

    if (any(lattice%extent < 1)) then
      call raise(error, status%invalid_input, 'the lattice window is empty: at least one row and one column expected')
    else if (product(int(lattice%extent, long)) > most_nodes .or. any(abs(int(lattice%first, long)) > largest_index)) then
      call raise(error, status%invalid_input, 'the lattice window: at most 536870911 nodes and indices up to that expected')
    else if (.not. (all(ieee_is_finite(lattice%basis)) .and. all(ieee_is_finite(lattice%origin)))) then
      ! before any comparison, which NaN may trap
      call raise(error, status%invalid_input, 'the lattice basis and origin: finite numbers expected')
    else if (.not. lattice%cell_area() > 1.0e-3_wp*lattice%spacing()**2) then
      call raise(error, status%invalid_input, &
                 'the lattice basis is degenerate: two vectors in counter-clockwise order expected')
    else if (any(lattice%periodic) .and. .not. (lattice%is_periodic() .and. modulo(lattice%extent(1), 4) == 0)) then
      call raise(error, status%invalid_input, 'a window that repeats: both ways, and a multiple of four columns expected')
    end if
  end subroutine check_lattice

  !> Return the basis of the equilateral lattice, eq. (5.1): sides of equal length at 60 degrees.
  pure function equilateral_basis(spacing) result(basis)
    !> Length of a side [m]
    real(wp), intent(in) :: spacing
    !> Basis vectors as columns [m]
    real(wp) :: basis(2, 2)

    basis(:, 1) = spacing*[1.0_wp, 0.0_wp]
    basis(:, 2) = spacing*[0.5_wp, 0.5_wp*sqrt(3.0_wp)]
  end function equilateral_basis

  !> Return a basis with its first vector along x; that of the equilateral lattice at a ratio of 1 and 60 degrees.
  pure function oblique_basis(spacing, ratio, angle, direction) result(basis)
    !> Length of the first vector [m], of the second one over it, and angle of the second one from the first [rad]
    real(wp), intent(in) :: spacing, ratio, angle
    !> Angle of the first vector from x [rad]; absent: 0
    real(wp), intent(in), optional :: direction
    !> Basis vectors as columns [m]
    real(wp) :: basis(2, 2)

    basis = spacing*rounded(reshape([1.0_wp, 0.0_wp, ratio*cos(angle), ratio*sin(angle)], [2, 2]))
    if (.not. present(direction)) return
    if (abs(direction) > 0.0_wp) basis = matmul(reshape([cos(direction), sin(direction), -sin(direction), cos(direction)], &
                                                        [2, 2]), basis)
  end function oblique_basis

  !> Return a basis in spacings, that of the equilateral lattice to the bit if it differs by rounding errors only.
  pure function rounded(basis)
    !> Basis vectors as columns
    real(wp), intent(in) :: basis(2, 2)
    real(wp) :: rounded(2, 2)

    rounded = basis
    if (all(abs(basis - equilateral_basis(1.0_wp)) < 4.0_wp*epsilon(1.0_wp))) rounded = equilateral_basis(1.0_wp)
  end function rounded

  !> Return the three edge directions of the triangulation, as columns [m].
  pure function edge_directions(basis) result(edges)
    !> Basis vectors as columns [m]
    real(wp), intent(in) :: basis(2, 2)
    !> First and second basis vector and their difference
    real(wp) :: edges(2, 3)

    edges(:, 1) = basis(:, 1)
    edges(:, 2) = basis(:, 2)
    edges(:, 3) = basis(:, 2) - basis(:, 1)
  end function edge_directions

  !> Return the number of nodes of the window.
  pure integer function lattice_size(self)
    class(lattice_t), intent(in) :: self
    lattice_size = product(self%extent)
  end function lattice_size

  !> Return the area of a cell [m^2].
  pure real(wp) function cell_area(self)
    class(lattice_t), intent(in) :: self
    cell_area = self%basis(1, 1)*self%basis(2, 2) - self%basis(2, 1)*self%basis(1, 2)
  end function cell_area

  !> Return the spacing l_e [m].
  pure real(wp) function lattice_spacing(self)
    class(lattice_t), intent(in) :: self
    lattice_spacing = maxval(norm2(edge_directions(self%basis), dim=1))
  end function lattice_spacing

  !> Return how many columns and rows a straight line across them meets per length [1/m].
  pure function lines_per_length(self) result(lines)
    class(lattice_t), intent(in) :: self
    real(wp) :: lines(2)
    lines = norm2(self%basis(:, 2:1:-1), dim=1)/self%cell_area()
  end function lines_per_length

  !> Compute the coordinates of all nodes of the window.
  pure subroutine coordinates(self, x, y)
    class(lattice_t), intent(in) :: self
    !> Coordinates of the nodes, (n_col, n_row) [m]
    real(wp), intent(out) :: x(:, :), y(:, :)
    integer :: row

    do row = 1, self%extent(2)
      call self%row_coordinates(row, x(:, row), y(:, row))
    end do
  end subroutine coordinates

  !> Compute the coordinates of the first nodes of a row: faster than to read them.
  pure subroutine row_coordinates(self, row, x, y)
    class(lattice_t), intent(in) :: self
    !> Row of the window, from 1 on
    integer, intent(in) :: row
    !> Coordinates of the nodes (n_col, or less) [m]
    real(wp), intent(out) :: x(:), y(:)
    integer :: col
    real(wp) :: i, j

    j = real(self%first(2) + row - 1, wp)
    do col = 1, size(x)
      i = real(self%first(1) + col - 1, wp)
      x(col) = self%origin(1) + i*self%basis(1, 1) + j*self%basis(1, 2)
      y(col) = self%origin(2) + i*self%basis(2, 1) + j*self%basis(2, 2)
    end do
  end subroutine row_coordinates

  !> Return the basis vectors over the spacing, as columns: the same to the bit for all equilateral lattices with a row along x.
  pure function unit_basis(self) result(basis)
    class(lattice_t), intent(in) :: self
    real(wp) :: basis(2, 2)

    basis = rounded(self%basis/self%spacing())
  end function unit_basis

  !> Return column and row of a neighbor of a node, from 1 on; 0 beyond the end of the window.
  pure function neighbor(self, node, k) result(there)
    class(lattice_t), intent(in) :: self
    !> Column and row of the node, from 1 on
    integer, intent(in) :: node(2)
    !> Number of the neighbor in `neighbors`
    integer, intent(in) :: k
    integer :: there(2)

    there = node + neighbors(:, k)
    where (self%periodic) there = modulo(there - 1, self%extent) + 1
    if (any(there < 1 .or. there > self%extent)) there = 0
  end function neighbor

  !> Return which neighbors lie at the ends of edges that are not much longer than the shortest: all but on slender cells.
  pure function near_neighbors(self) result(near)
    class(lattice_t), intent(in) :: self
    logical :: near(6)

    associate (edges => norm2(matmul(self%basis, real(neighbors, wp)), dim=1))
      near = edges < 5.0_wp*minval(edges)
    end associate
  end function near_neighbors

  !> Return the longer edge of a cell over the shorter one.
  pure real(wp) function slenderness(self)
    class(lattice_t), intent(in) :: self

    associate (edges => norm2(self%basis, dim=1))
      slenderness = maxval(edges)/minval(edges)
    end associate
  end function slenderness

  !> Return the dimension along which the edges of a cell are shorter.
  pure integer function short_side(self)
    class(lattice_t), intent(in) :: self

    short_side = minloc(norm2(self%basis, dim=1), dim=1)
  end function short_side

  !> Return whether the window repeats.
  pure logical function is_periodic(self)
    class(lattice_t), intent(in) :: self
    is_periodic = all(self%periodic)
  end function is_periodic

  !> Return the values of a field at a neighbor of each node; 0 beyond the end of the window.
  pure function shifted(self, field, k)
    class(lattice_t), intent(in) :: self
    !> Field over the window (n_col, n_row)
    real(wp), intent(in) :: field(:, :)
    !> Number of the neighbor in `neighbors`
    integer, intent(in) :: k
    real(wp) :: shifted(size(field, 1), size(field, 2))
    integer :: d

    shifted = field
    do d = 1, 2
      if (self%periodic(d)) then
        shifted = cshift(shifted, neighbors(d, k), dim=d)
      else
        shifted = eoshift(shifted, neighbors(d, k), dim=d)
      end if
    end do
  end function shifted

  !> Sum a field over each node and its neighbors.
  pure function ring_sum(self, field) result(total)
    class(lattice_t), intent(in) :: self
    !> Field over the window (n_col, n_row)
    real(wp), intent(in) :: field(:, :)
    real(wp) :: total(size(field, 1), size(field, 2))
    integer :: k

    total = field
    do k = 1, size(opposite_pairs)
      total = total + self%shifted(field, opposite_pairs(k))
    end do
  end function ring_sum

  !> Return the largest value of a field at each node and its neighbors.
  pure function ring_max(self, field) result(largest)
    class(lattice_t), intent(in) :: self
    !> Field over the window (n_col, n_row)
    real(wp), intent(in) :: field(:, :)
    real(wp) :: largest(size(field, 1), size(field, 2))
    integer :: k

    largest = field
    do k = 1, size(neighbors, 2)
      largest = max(largest, self%shifted(field, k))
    end do
  end function ring_max

  !> Find the nodes of a zone and those next to it.
  pure function dilated(self, zone) result(wider)
    class(lattice_t), intent(in) :: self
    !> Nodes of the zone (n_col, n_row)
    logical, intent(in) :: zone(:, :)
    logical :: wider(size(zone, 1), size(zone, 2))
    real(wp) :: largest(size(zone, 1), size(zone, 2))

    largest = self%ring_max(merge(1.0_wp, 0.0_wp, zone))
    wider = largest > 0.5_wp
  end function dilated

  !> Return the steps to the neighbors in a list of the nodes of a window, column by column.
  pure function neighbor_steps(n_col) result(steps)
    !> Number of columns
    integer, intent(in) :: n_col
    integer :: steps(6)
    steps = neighbors(1, :) + n_col*neighbors(2, :)
  end function neighbor_steps

  !> Return the lattice of every second node: node (i, j) of it is node (2 i, 2 j) of this one; nodes
  !> outside the window of this one are left out.
  pure function coarsened(self) result(coarse)
    class(lattice_t), intent(in) :: self
    type(lattice_t) :: coarse
    integer :: last(2)

    coarse%basis = 2.0_wp*self%basis
    coarse%origin = self%origin
    last = self%first + self%extent - 1
    coarse%periodic = self%periodic
    coarse%first = -floor_half(-self%first)
    coarse%extent = floor_half(last) - coarse%first + 1
  end function coarsened

  !> Return the floor of n/2, also for negative n
  elemental integer function floor_half(n)
    integer, intent(in) :: n
    floor_half = (n - modulo(n, 2))/2
  end function floor_half

  !> Find first and last column and row of the part around some nodes, with a margin as far as the window goes.
  !>
  !> It depends on nothing else, so that a load gives the same bits whatever came before it.
  pure subroutine enclose(self, nodes, options, low, high)
    class(lattice_t), intent(in) :: self
    !> The nodes (n_col, n_row)
    logical, intent(in) :: nodes(:, :)
    type(multilevel_options_t), intent(in) :: options
    !> Columns and rows, from 1 on
    integer, intent(out) :: low(2), high(2)

    call self%enclose_lines(any(nodes, dim=2), any(nodes, dim=1), options, low, high)
  end subroutine enclose

  !> Find the same part from the columns and rows that contain nodes.
  pure subroutine enclose_lines(self, columns, rows, options, low, high)
    class(lattice_t), intent(in) :: self
    !> Columns and rows with nodes
    logical, intent(in) :: columns(:), rows(:)
    type(multilevel_options_t), intent(in) :: options
    !> Columns and rows, from 1 on
    integer, intent(out) :: low(2), high(2)
    integer :: d, margin, step
    logical :: line(maxval(self%extent))

    do d = 1, 2
      line = .false.
      if (d == 1) line(:size(columns)) = columns
      if (d == 2) line(:size(rows)) = rows
      low(d) = max(findloc(line, .true., dim=1), 1)
      high(d) = findloc(line, .true., dim=1, back=.true.)
      if (high(d) == 0) high(d) = self%extent(d)
      margin = options%least_margin + (high(d) - low(d) + 1)/options%margin_divisor
      ! in steps of a power of two, so that loads that are alike share a part
      step = options%least_margin
      do while (step*options%step_divisor < high(d) - low(d))
        step = 2*step
      end do
      low(d) = max((low(d) - margin - 1)/step*step + 1, 1)
      high(d) = min((high(d) + margin + step - 1)/step*step, self%extent(d))
    end do
  end subroutine enclose_lines

  !> Return lattice and window of a part.
  pure function subwindow(self, low, high) result(part)
    class(lattice_t), intent(in) :: self
    !> First and last column and row of the part
    integer, intent(in) :: low(2), high(2)
    type(lattice_t) :: part

    part%basis = self%basis
    part%origin = self%origin
    part%first = self%first + low - 1
    part%extent = high - low + 1
  end function subwindow

end module hc_lattice
