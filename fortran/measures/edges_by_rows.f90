!> Edges of a contact whose rows several ranks share.
!>
!> Each rank finds the edges near its own rows, about which it takes those that they depend on, and sums the cells of its
!> rows. All ranks call these procedures together.
module hc_edges_by_rows
  use hc_precision, only: wp, lk
  use hc_lattice, only: lattice_t
  use hc_field_space, only: field_space_t
  use hc_options, only: edge_options_t
  use hc_contact_state, only: contact_state_t, separated
  use hc_contact_edges, only: contact_edges_t, new_contact_edges
  use hc_zone_edge, only: edged_zone_t, zone_edge_t, edge_of_sums, n_cell_sum
  implicit none
  private

  public :: edges_by_rows_t, new_edges_by_rows

  !> A contact and its edges.
  type :: edges_by_rows_t
    private
    !> Lattice and window, and space of the fields
    type(lattice_t) :: lattice
    type(field_space_t) :: space
    !> Edges in own rows and those nearby, of which these are the first and the last
    type(contact_edges_t) :: edges
    integer :: near(2) = 0
  contains
    !> Edge of the contact, and of the part of it that sticks, without its pieces
    procedure :: contact_edge, stick_edge
    procedure, private :: cells, whole_edge
  end type edges_by_rows_t

contains

  !> Find the edges of a contact.
  subroutine new_edges_by_rows(self, lattice, state, candidate, space, options)
    !> Edges to be set up
    type(edges_by_rows_t), intent(out) :: self
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> State, of which pressure, gap and zones matter
    type(contact_state_t), intent(in) :: state
    !> Nodes that can touch (n_col, own rows)
    logical, intent(in), contiguous :: candidate(:, :)
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Tuning numbers
    type(edge_options_t), intent(in) :: options
    real(wp), allocatable :: pressure(:, :), gap(:, :)
    logical(lk), allocatable :: touching(:, :), possible(:, :)

    self%lattice = lattice
    self%space = space
    self%near = space%own_rows(lattice%extent(2))
    if (space%ranks%size == 1) then
      call new_contact_edges(self%edges, lattice, state%pressure, state%gap, state%zone /= separated, candidate, options)
      return
    end if
    ! The first and last of these rows look like the rim of the window: their band has reach + 1 rows, and a value depends on
    ! nodes that are reach + 2 rows away.
    self%near = self%near + [-2, 2]*(options%reach + 2)
    self%near = [max(self%near(1), 1), min(self%near(2), lattice%extent(2))]
    associate (n => [lattice%extent(1), self%near(2) - self%near(1) + 1], first => self%near(1))
      allocate (pressure(n(1), n(2)), gap(n(1), n(2)), touching(n(1), n(2)), possible(n(1), n(2)))
      call space%fetch(lattice%extent(2), state%pressure, first, pressure)
      call space%fetch(lattice%extent(2), state%gap, first, gap)
      call space%fetch(lattice%extent(2), logical(state%zone /= separated, lk), first, touching)
      call space%fetch(lattice%extent(2), logical(candidate, lk), first, possible)
    end associate
    call new_contact_edges(self%edges, lattice%subwindow([1, self%near(1)], [lattice%extent(1), self%near(2)]), pressure, gap, &
                           logical(touching), logical(possible), options)
  end subroutine new_edges_by_rows

  !> Find the edge of the contact.
  function contact_edge(self) result(edge)
    class(edges_by_rows_t), intent(in) :: self
    type(zone_edge_t) :: edge

    edge = self%whole_edge(self%edges)
  end function contact_edge

  !> Find the edge of the part of the contact that sticks.
  function stick_edge(self, stick, reserve) result(edge)
    class(edges_by_rows_t), intent(in) :: self
    !> Nodes that stick (n_col, own rows), and their reserve of friction, mu p - |q| [Pa]
    logical, intent(in), contiguous :: stick(:, :)
    real(wp), intent(in), contiguous :: reserve(:, :)
    type(zone_edge_t) :: edge
    type(edged_zone_t) :: zone
    real(wp), allocatable :: near(:, :)
    logical(lk), allocatable :: sticking(:, :)

    if (self%space%ranks%size == 1) then
      call self%edges%find_stick(stick, reserve, zone)
    else
      associate (n => [size(stick, 1), self%near(2) - self%near(1) + 1], n_row => self%lattice%extent(2))
        allocate (near(n(1), n(2)), sticking(n(1), n(2)))
        call self%space%fetch(n_row, reserve, self%near(1), near)
        call self%space%fetch(n_row, logical(stick, lk), self%near(1), sticking)
      end associate
      call self%edges%find_stick(logical(sticking), near, zone)
    end if
    edge = self%whole_edge(zone)
  end function stick_edge

  !> Return the first and last row of cells of this rank among the rows nearby, each named by the row of nodes below it, and the
  !> rows before these.
  pure function cells(self)
    class(edges_by_rows_t), intent(in) :: self
    integer :: cells(3)

    cells(:2) = self%space%own_rows(self%lattice%extent(2))
    if (cells(1) == 1) cells(1) = 0 ! the cells below the first row
    cells(3) = self%near(1) - 1
    cells(:2) = cells(:2) - cells(3)
  end function cells

  !> Find the edge of a zone from the sums of the cells of each rank.
  function whole_edge(self, zone) result(edge)
    class(edges_by_rows_t), intent(in) :: self
    !> The zone in own rows and those nearby
    class(edged_zone_t), intent(in) :: zone
    type(zone_edge_t) :: edge
    real(wp), allocatable :: sums(:, :), segments(:, :, :)
    real(wp) :: totals(n_cell_sum)
    integer :: k

    call zone%sum_cells(self%cells(), sums, segments)
    do k = 1, n_cell_sum
      totals(k) = self%space%total(sums(k, :))
    end do
    edge = edge_of_sums(self%lattice, totals)
  end function whole_edge

end module hc_edges_by_rows
