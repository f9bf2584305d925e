!> The nodes about the edge of a zone, in one list, and operations on values at them.
!>
!> Values at the nodes of a band are vectors. Where only some of them are known, a mask goes with them.
!>
!> Lengths are measured as the linear map of the lattice to the equilateral one of unit spacing makes them. The layer of the
!> solution at an edge is as wide in them for any basis and any direction of the edge, and areas are those of cells.
!>
!> Theory: docs/theory/edges.md.
module hc_edge_band
  use hc_precision, only: wp
  use hc_options, only: edge_options_t
  use hc_lattice, only: equilateral_basis, neighbors
  use hc_zone_estimators, only: is_boundary
  implicit none
  private

  public :: edge_band_t, new_edge_band, to_neighbors

  !> Number of neighbors of a node.
  integer, parameter :: n_beside = size(neighbors, 2)
  !> Nodes about an edge.
  type :: edge_band_t
    !> Number of nodes
    integer :: n = 0
    !> Steps over which nodes next to the edge get values from nodes that have one
    integer, private :: reach = 0
    !> Column and row of each in the window, counted from 1; they may lie outside it (2, n)
    integer, allocatable :: node(:, :)
    !> Number in the list of each node of the window and `reach` + 2 nodes about it; 0: it is not in the band
    integer, allocatable :: place(:, :)
    !> Numbers in the list of the six neighbors; 0: they are not in the band (6, n)
    integer, allocatable :: beside(:, :)
  contains
    !> Values of a field at the nodes
    procedure :: values_of
    !> Which of the nodes are in a zone of the window
    procedure :: part_of
    !> Nodes whose neighbors are all in a part
    procedure :: surrounded
    !> Nodes that have a neighbor in a part
    procedure :: next_to
    !> Gradient in the plane, per spacing
    procedure :: gradient
    !> Values for nodes that have none, from the nearest that have one
    procedure :: extend
  end type edge_band_t

contains

  !> Return the positions of the six neighbors on the equilateral lattice, in spacings.
  pure function to_neighbors() result(to)
    !> x and y of each (2, 6)
    real(wp) :: to(2, n_beside)
    integer :: k

    associate (basis => equilateral_basis(1.0_wp))
      do k = 1, n_beside
        to(:, k) = matmul(basis, real(neighbors(:, k), wp))
      end do
    end associate
  end function to_neighbors

  !> Find the band about the edge of a zone: nodes at most `reach` + 1 steps from the boundary nodes.
  pure subroutine new_edge_band(band, zone, options)
    !> Band to be set up
    type(edge_band_t), intent(out) :: band
    !> Nodes of the zone (n_col, n_row)
    logical, intent(in) :: zone(:, :)
    !> Tuning numbers
    type(edge_options_t), intent(in) :: options
    integer :: col, row, k, step, last, margin

    band%reach = options%reach
    margin = band%reach + 2
    allocate (band%place(1 - margin:size(zone, 1) + margin, 1 - margin:size(zone, 2) + margin), source=0)
    allocate (band%node(2, 2*sum(shape(zone))))
    do row = 1, size(zone, 2)
      do col = 1, size(zone, 1)
        if (zone(col, row)) then
          if (is_boundary(zone, col, row)) call append(band, [col, row])
        end if
      end do
    end do
    last = 0
    do step = 1, band%reach + 1
      associate (first => last + 1)
        last = band%n
        do k = first, last
          call append_neighbors(band, k)
        end do
      end associate
    end do
    band%node = band%node(:, :band%n)
    allocate (band%beside(n_beside, band%n))
    do k = 1, band%n
      do step = 1, n_beside
        associate (there => band%node(:, k) + neighbors(:, step))
          band%beside(step, k) = band%place(there(1), there(2))
        end associate
      end do
    end do
  end subroutine new_edge_band

  !> Add the neighbors of a node to a band that does not have them.
  pure subroutine append_neighbors(band, k)
    !> Band
    type(edge_band_t), intent(inout) :: band
    !> Number of the node
    integer, intent(in) :: k
    integer :: j, there(2)

    do j = 1, n_beside
      there = band%node(:, k) + neighbors(:, j)
      if (band%place(there(1), there(2)) == 0) call append(band, there)
    end do
  end subroutine append_neighbors

  !> Add a node to a band.
  pure subroutine append(band, node)
    !> Band
    type(edge_band_t), intent(inout) :: band
    !> Column and row
    integer, intent(in) :: node(2)
    integer, allocatable :: longer(:, :)

    if (band%n == size(band%node, 2)) then
      allocate (longer(2, 2*band%n))
      longer(:, :band%n) = band%node
      call move_alloc(longer, band%node)
    end if
    band%n = band%n + 1
    band%node(:, band%n) = node
    band%place(node(1), node(2)) = band%n
  end subroutine append

  !> Return the values of a field at the nodes of a band; 0 outside the window.
  pure function values_of(self, field) result(values)
    class(edge_band_t), intent(in) :: self
    !> Field over the window (n_col, n_row)
    real(wp), intent(in) :: field(:, :)
    real(wp) :: values(self%n)
    integer :: k

    values = 0.0_wp
    do k = 1, self%n
      associate (at => self%node(:, k))
        if (all(at >= 1 .and. at <= shape(field))) values(k) = field(at(1), at(2))
      end associate
    end do
  end function values_of

  !> Return which nodes of a band are in a zone; those outside the window are not.
  pure function part_of(self, zone) result(part)
    class(edge_band_t), intent(in) :: self
    !> Nodes of the zone (n_col, n_row)
    logical, intent(in) :: zone(:, :)
    logical :: part(self%n)
    integer :: k

    part = .false.
    do k = 1, self%n
      associate (at => self%node(:, k))
        if (all(at >= 1 .and. at <= shape(zone))) part(k) = zone(at(1), at(2))
      end associate
    end do
  end function part_of

  !> Find the nodes of a part of a band whose neighbors are in it, too.
  pure function surrounded(self, part) result(whole)
    class(edge_band_t), intent(in) :: self
    !> Nodes of the part
    logical, intent(in) :: part(:)
    logical :: whole(self%n)
    integer :: k

    do k = 1, self%n
      whole(k) = part(k) .and. all(self%beside(:, k) > 0)
      if (whole(k)) whole(k) = all(part(self%beside(:, k)))
    end do
  end function surrounded

  !> Find the nodes of a band that have a neighbor in a part of it.
  pure function next_to(self, part) result(beside)
    class(edge_band_t), intent(in) :: self
    !> Nodes of the part
    logical, intent(in) :: part(:)
    logical :: beside(self%n)
    integer :: k, j

    beside = .false.
    do k = 1, self%n
      do j = 1, n_beside
        associate (m => self%beside(j, k))
          if (m > 0) beside(k) = beside(k) .or. part(m)
        end associate
      end do
    end do
  end function next_to

  !> Compute the gradient of values along x and y, per spacing: the mean slope along the three lines of nodes.
  pure function gradient(self, values, part) result(slopes)
    class(edge_band_t), intent(in) :: self
    !> Values at the nodes
    real(wp), intent(in) :: values(:)
    !> Nodes where it is found; elsewhere, and at the rim of the band, it is 0
    logical, intent(in) :: part(:)
    real(wp) :: slopes(2, self%n), to(2, n_beside)
    integer :: k

    to = to_neighbors()/3.0_wp
    slopes = 0.0_wp
    do k = 1, self%n
      if (part(k) .and. all(self%beside(:, k) > 0)) slopes(:, k) = matmul(to, values(self%beside(:, k)))
    end do
  end function gradient

  !> Give nodes without a value the mean of their neighbors, from the nearest nodes on.
  pure subroutine extend(self, n_value, values, known)
    class(edge_band_t), intent(in) :: self
    !> Number of values of a node
    integer, intent(in) :: n_value
    !> Values at the nodes
    real(wp), intent(inout) :: values(n_value, self%n)
    !> Nodes that have values
    logical, intent(inout) :: known(:)
    logical :: had(self%n)
    real(wp) :: total(n_value)
    integer :: unknown(self%n), n_unknown, n_left, k, j, step, n_known

    n_unknown = 0
    do k = 1, self%n
      if (known(k)) cycle
      n_unknown = n_unknown + 1
      unknown(n_unknown) = k
    end do
    had = known
    do step = 1, self%reach
      n_left = 0
      do k = 1, n_unknown
        total = 0.0_wp
        n_known = 0
        do j = 1, n_beside
          associate (m => self%beside(j, unknown(k)))
            if (m == 0) cycle
            if (.not. had(m)) cycle
            total = total + values(:, m)
            n_known = n_known + 1
          end associate
        end do
        if (n_known == 0) then
          n_left = n_left + 1
          unknown(n_left) = unknown(k)
        else
          known(unknown(k)) = .true.
          values(:, unknown(k)) = total/n_known
        end if
      end do
      if (n_left == 0) exit
      n_unknown = n_left
      had = known
    end do
  end subroutine extend

end module hc_edge_band
