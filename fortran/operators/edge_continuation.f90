!> Displacements continued beyond the edge of a contact, for a better preconditioner.
!>
!> The inverse K^-1 of the flexibility over the whole lattice is cheap by FFT. The inverse of its part on the active nodes is that
!> of the whole, minimised over the displacement elsewhere:
!>
!>     r^T (K_CC)^-1 r = min over all continuations u of r of u^T K^-1 u,
!>
!> because no traction acts outside. Any linear continuation E thus gives a symmetric preconditioner E^T K^-1 E >= (K_CC)^-1,
!> the better the closer E comes to the minimum; zero outside is the plainest. Beyond the edge of a loaded region the surface
!> falls off like the root of the distance, and long waves along the edge fall off less. Here each ring of nodes around the
!> active ones takes the mean of its neighbors in the ring before, smoothed along the ring, and falls off like
!> 1 - sqrt(ring/(rings + 1)).
!>
!> Equations: docs/theory/preconditioner.md, (P2), (P3).
module hc_edge_continuation
  use, intrinsic :: iso_fortran_env, only: int8, int16
  use hc_precision, only: wp, sp, lk
  use hc_options, only: preconditioner_options_t
  use hc_lattice, only: neighbor_steps
  use hc_field_space, only: field_space_t
  use hc_line_means, only: line_means_t, new_line_means
  use hc_active_set, only: find_span
  implicit none
  private

  public :: edge_extension_t, new_edge_extension

  !> Marks of active nodes inside the contact, of nodes without a ring, and of the surroundings of the window.
  integer(int16), parameter :: inside = -1_int16, free = huge(0_int16), outside = huge(0_int16) - 1_int16
  !> Nodes that are passed over at once.
  integer, parameter :: stride = 32
  !> Nodes of a ring in rows that are passed over together.
  integer, parameter :: worth_a_block = 64
  !> Nodes in the rings from which on threads share the work.
  integer, parameter :: worth_sharing = 8192

  !> Steps to some of the neighbors as bits: their number, one over it, and the bits without the one, two and three lowest.
  integer :: bit
  integer, parameter :: bits_of(0:127) = [(bit, bit=0, 127)], n_bits(0:127) = popcnt(bits_of)
  real(sp), parameter :: mean(0:127) = 1.0_sp/max(n_bits, 1)
  integer, parameter, dimension(0:127) :: but_one = iand(bits_of, bits_of - 1), but_two = iand(but_one, but_one - 1), &
                                          others = iand(but_two, but_two - 1)
  !> The three lowest as numbers of steps, and 1 where there are as many, else 0: sums without branches for most nodes.
  integer, parameter :: lowest(0:127, 3) = reshape([trailz(bits_of) + 1, trailz(but_one) + 1, trailz(but_two) + 1], [128, 3])
  real(sp), parameter :: taken(0:127, 3) = reshape(merge(1.0_sp, 0.0_sp, [n_bits >= 1, n_bits >= 2, n_bits >= 3]), [128, 3])

  !> Nodes of the rings and their neighbors; the active nodes at the edge are ring 0.
  type :: edge_extension_t
    private
    !> Number of rings
    integer :: n_ring = 0
    !> Nodes, in blocks of rows and in each by rings, and where each ring begins (0:n_ring + 1, block)
    integer, allocatable :: node(:), start(:, :)
    !> Steps from a node to itself and to its neighbors
    integer, allocatable :: step(:)
    !> Of each node, a bit for each step: those to the ring before, those in the same ring, and those to the next one
    integer(int8), allocatable :: inner(:), beside(:), outer(:)
    !> By these bits: fall from ring to ring over the number of steps (bits, ring), and the first steps
    real(sp), allocatable :: fall(:, :)
    integer :: first(3, 0:127) = 0
    !> Times that a ring is smoothed
    integer :: smoothings = 0
    !> Space of the rings
    type(field_space_t) :: space
    !> Ranks that share the fields; on several ones the rings are those in `rows`, own rows and those that their values depend on
    type(field_space_t) :: fields
    integer :: own(2) = 0, rows(2) = 0, n_row = 0
    !> On slender cells: lines across the contact
    type(line_means_t), allocatable :: lines
  contains
    !> Continue the mean of each line across a slender contact further than the rest
    procedure :: set_floor
    !> Continue a field beyond the active nodes
    procedure :: extend
    !> The transpose: add loads on the rings to the active nodes
    procedure :: fold
    procedure, private :: pass_rings
  end type edge_extension_t

contains

  !> Find the rings around the active nodes.
  subroutine new_edge_extension(self, active, space, options, within, near, by_width)
    !> Continuation to be set up
    type(edge_extension_t), intent(out) :: self
    !> Active nodes (n_col, own rows)
    logical(lk), intent(in), contiguous, target :: active(:, :)
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Tuning numbers
    type(preconditioner_options_t), intent(in) :: options
    !> Nodes beyond which there are no rings (n_col, own rows); absent: all of the window
    logical(lk), intent(in), contiguous, optional, target :: within(:, :)
    !> Neighbours that a ring consists of; absent: all
    logical, intent(in), optional :: near(6)
    !> Rings by the width of the contact, in nodes, on one rank; absent: those of `options`
    real(wp), intent(in), optional :: by_width
    logical(lk), pointer, contiguous :: around(:, :), until(:, :)
    integer(int16), allocatable :: mark(:)
    integer, allocatable :: list(:), step(:)
    integer :: n_ring, n_edge

    self%step = [0, neighbor_steps(size(active, 1))]
    step = neighbor_steps(size(active, 1) + 2)                                 ! among marks, with a column more on each side
    if (present(near)) then
      self%step = pack(self%step, [.true., near])
      step = pack(step, near)
    end if
    if (space%ranks%size > 1) then
      call share_rings(self, active, space, options, step, within)
    else
      ! marks take memory: rows that no ring reaches have none
      self%rows = [1, size(active, 2)]
      if (.not. present(by_width)) then
        call find_span(any(active, dim=1), self%rows(1), self%rows(2))
        self%rows = [max(self%rows(1) - options%max_rings - 1, 1), min(self%rows(2) + options%max_rings + 1, size(active, 2))]
      end if
      around => active(:, self%rows(1):self%rows(2))
      until => null()                                                          ! the same as absent
      if (present(within)) until => within(:, self%rows(1):self%rows(2))
      call mark_window(around, space, mark, until)
      call find_edge(size(active, 1), mark, step, list, n_edge)
      n_ring = number_of_rings(options, space%count(active), n_edge)
      if (present(by_width)) n_ring = int(by_width*space%count(active)/max(n_edge, 1))
      call find_rings(self, size(active, 1), n_ring, step, list, n_edge, mark, space, options)
    end if
  end subroutine new_edge_extension

  !> Compute the number of rings.
  pure integer function number_of_rings(options, n_active, n_edge)
    type(preconditioner_options_t), intent(in) :: options
    !> Active nodes, and those at the edge
    integer, intent(in) :: n_active, n_edge
    real(wp) :: width

    number_of_rings = 0
    if (n_edge == 0) return
    width = real(n_active, wp)/n_edge
    if (options%patches .and. width < options%patch_width) then
      number_of_rings = int(options%patch_ring_factor*width**options%patch_ring_power)
    else
      number_of_rings = int(options%ring_factor*width**options%ring_power)
    end if
    number_of_rings = min(options%max_rings, number_of_rings)
  end function number_of_rings

  !> Continue the mean of each line across a slender contact to the end of the line.
  subroutine set_floor(self, active, across, share)
    class(edge_extension_t), intent(inout) :: self
    !> Active nodes (n_col, n_row), on one rank
    logical(lk), intent(in), contiguous :: active(:, :)
    !> Dimension across the contact
    integer, intent(in) :: across
    !> Height at the end of a line over the mean
    real(wp), intent(in) :: share
    real(sp), allocatable :: field(:)

    allocate (field(size(active)))
    field = reshape(merge(1.0_sp, 0.0_sp, active), [size(active)])
    call self%pass_rings(.false., field)
    allocate (self%lines)
    call new_line_means(self%lines, active, reshape(field, shape(active)), across, self%n_ring/2, real(share, sp), &
                        self%fields%threads)
  end subroutine set_floor

  !> Find the rings in own rows and in those that their values depend on: smoothed rings further in or out, and the active nodes
  !> that these begin at.
  subroutine share_rings(self, active, space, options, step, within)
    type(edge_extension_t), intent(inout) :: self
    !> Active nodes (n_col, own rows)
    logical(lk), intent(in), contiguous :: active(:, :)
    type(field_space_t), intent(in) :: space
    type(preconditioner_options_t), intent(in) :: options
    !> Steps to the neighbors of a node
    integer, intent(in), contiguous :: step(:)
    !> Nodes beyond which there are no rings (n_col, own rows); absent: all of the window
    logical(lk), intent(in), contiguous, optional :: within(:, :)
    logical(lk), allocatable :: wider(:, :), around(:, :)
    integer(int16), allocatable :: mark(:)
    integer, allocatable :: list(:)
    integer :: counts(3), n_ring, n_edge

    self%fields = space
    self%own = 0
    counts = size(active, 2)
    call space%ranks%add_counts(counts)
    self%n_row = counts(1)
    self%own = space%own_rows(self%n_row)
    call take_rows(self, active, 1, wider)
    if (present(within)) call take_rows(self, within, 1, around)
    call mark_window(wider, space, mark, around)
    call find_edge(size(active, 1), mark, step, list, n_edge)
    counts = [count(active), count(is_own(self, size(active, 1), list(:n_edge))), 0]
    call space%ranks%add_counts(counts)
    n_ring = number_of_rings(options, counts(1), counts(2))
    call take_rows(self, active, n_ring*(options%smoothings + 2) + 1, wider)
    if (present(within)) call take_rows(self, within, n_ring*(options%smoothings + 2) + 1, around)
    call mark_window(wider, space, mark, around)
    call find_edge(size(active, 1), mark, step, list, n_edge)
    call find_rings(self, size(active, 1), n_ring, step, list, n_edge, mark, space, options)
  end subroutine share_rings

  !> Take own rows and some more on each side, as far as the window goes.
  subroutine take_rows(self, active, more, wider)
    type(edge_extension_t), intent(inout) :: self
    !> Active nodes (n_col, own rows)
    logical(lk), intent(in), contiguous :: active(:, :)
    !> Number of further rows
    integer, intent(in) :: more
    !> Active nodes of all of these rows
    logical(lk), allocatable, intent(out) :: wider(:, :)

    self%rows = [max(self%own(1) - more, 1), min(self%own(2) + more, self%n_row)]
    allocate (wider(size(active, 1), self%rows(2) - self%rows(1) + 1))
    call self%fields%fetch(self%n_row, active, self%rows(1), wider)
  end subroutine take_rows

  !> Return whether a place in the marks is in an own row.
  elemental logical function is_own(self, n_col, place)
    type(edge_extension_t), intent(in) :: self
    integer, intent(in) :: n_col, place
    integer :: row

    row = self%rows(1) + (place - 1)/(n_col + 2) - 1
    is_own = row >= self%own(1) .and. row <= self%own(2)
  end function is_own

  !> Grow the rings from the nodes at the edge.
  subroutine find_rings(self, n_col, most_rings, step, list, n_edge, mark, space, options)
    type(edge_extension_t), intent(inout) :: self
    !> Number of columns, and of rings, unless they fill the window before
    integer, intent(in) :: n_col, most_rings
    !> Steps to the neighbors of a node among the marks
    integer, intent(in), contiguous :: step(:)
    !> Nodes at the edge, to which those of the rings are added, as places in the marks, and the number of those at the edge
    integer, intent(inout) :: list(:)
    integer, intent(in) :: n_edge
    !> Marks of the nodes, one column and row around the window included: `inside` or 0 on active nodes, the ring on those of
    !> the rings, `free` elsewhere and `outside` around
    integer(int16), intent(inout), contiguous :: mark(:)
    type(field_space_t), intent(in) :: space
    type(preconditioner_options_t), intent(in) :: options
    integer :: first(0:most_rings + 1), spare(0:127), r, n
    real(wp) :: found(1), by_number(0:7)
    real(wp), parameter :: number(0:7) = [(real(max(r, 1), wp), r=0, 7)]

    n = n_edge
    first(0:1) = [1, n + 1]
    found = 0.0_wp
    do r = 1, most_rings
      call add_ring(list, first(r - 1), first(r) - 1, step, int(r, int16), mark, n)
      first(r + 1) = n + 1
      if (space%ranks%size == 1) then
        if (n < first(r)) exit
        found = r
      else if (any(is_own(self, n_col, list(first(r):n)))) then
        found = r
      end if
    end do
    call space%most(found)
    self%n_ring = nint(found(1))
    self%smoothings = options%smoothings
    allocate (self%fall(0:127, self%n_ring))
    do r = 1, self%n_ring
      by_number = profile(r, self%n_ring)/profile(r - 1, self%n_ring)/number
      self%fall(:, r) = real(by_number(n_bits), sp)
    end do
    ! a factor of 0 stands before a neighbor that is summed anyway: other values may be no numbers
    spare = merge(min(lowest(:, 1), size(self%step)), 1, n_bits > 0)
    do r = 1, size(lowest, 2)
      self%first(r, :) = self%step(merge(min(lowest(:, r), size(self%step)), spare, n_bits >= r))
    end do
    call list_rings(self, n_col, list, first, step, mark, space)
  end subroutine find_rings

  !> List the nodes of the rings by blocks of rows, with their neighbors.
  subroutine list_rings(self, n_col, list, first, step, mark, space)
    type(edge_extension_t), intent(inout) :: self
    !> Number of columns
    integer, intent(in) :: n_col
    !> Nodes as places in the marks, ring by ring, and where each ring begins
    integer, intent(in) :: list(:), first(0:)
    !> Steps to the neighbors of a node among the marks, and marks of the nodes
    integer, intent(in), contiguous :: step(:)
    integer(int16), intent(in), contiguous :: mark(:)
    type(field_space_t), intent(in) :: space
    integer, allocatable :: before(:, :)
    integer :: width, n_row, height, shift, b, r, k, n

    width = n_col + 2
    n_row = size(mark)/width - 2
    n = first(self%n_ring + 1) - 1
    height = int(max(min(real(worth_a_block*(self%n_ring + 1), wp)*n_row/max(n, 1), real(n_row, wp)), 1.0_wp))
    if (n >= worth_sharing) self%space = space
    allocate (before(0:self%n_ring, (n_row + height - 1)/height), source=0)
    allocate (self%start(0:self%n_ring + 1, size(before, 2)))
    do r = 0, self%n_ring
      do k = first(r), first(r + 1) - 1
        b = ((list(k) - 1)/width - 1)/height + 1
        before(r, b) = before(r, b) + 1
      end do
    end do
    k = 1
    do b = 1, size(before, 2)
      do r = 0, self%n_ring
        self%start(r, b) = k
        k = k + before(r, b)
        before(r, b) = self%start(r, b) - 1
      end do
      self%start(self%n_ring + 1, b) = k
    end do
    allocate (self%node(n), self%inner(n), self%beside(n), self%outer(n))
    do r = 0, self%n_ring
      do k = first(r), first(r + 1) - 1
        b = ((list(k) - 1)/width - 1)/height + 1
        before(r, b) = before(r, b) + 1
        self%node(before(r, b)) = list(k)
      end do
    end do
    ! from places in the marks to nodes of the window
    shift = merge(self%rows(1) - 2, -1, space%ranks%size == 1)*n_col - 1
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(b)
    do k = 1, n
      call find_neighbors(self, k, step, mark)
      b = (self%node(k) - 1)/width
      self%node(k) = self%node(k) - b*width + b*n_col + shift
    end do
    !$omp end parallel do
  end subroutine list_rings

  !> Find the neighbors of a node in the ring before, in its own, and in the next one.
  pure subroutine find_neighbors(self, n, step, mark)
    type(edge_extension_t), intent(inout) :: self
    !> The node in the list, there as a place in the marks
    integer, intent(in) :: n
    !> Steps to the neighbors of a node among the marks, and marks of the nodes
    integer, intent(in), contiguous :: step(:)
    integer(int16), intent(in), contiguous :: mark(:)
    integer :: found(-2:2), other, k

    found = 0
    associate (place => self%node(n))
      do k = 1, size(step)
        other = max(min(int(mark(place + step(k))) - mark(place), 2), -2)
        found(other) = ior(found(other), ishft(1, k))
      end do
      if (mark(place) == self%n_ring) found(1) = 0
    end associate
    self%inner(n) = int(found(-1), int8)
    self%beside(n) = int(ior(found(0), 1), int8)
    self%outer(n) = int(found(1), int8)
  end subroutine find_neighbors

  !> Mark all nodes before there are rings.
  subroutine mark_window(active, space, mark, within)
    !> Active nodes (n_col, n_row)
    logical(lk), intent(in) :: active(:, :)
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Marks of the nodes, with those around the window
    integer(int16), allocatable, intent(out) :: mark(:)
    !> Nodes that are not outside (n_col, n_row); absent: all of the window
    logical(lk), intent(in), optional :: within(:, :)
    integer :: row, width, start

    width = size(active, 1) + 2
    allocate (mark(width*(size(active, 2) + 2)))
    mark(:width) = outside
    mark(size(mark) - width + 1:) = outside
    !$omp parallel do schedule(static) num_threads(space%threads) private(start)
    do row = 1, size(active, 2)
      start = row*width + 1
      mark(start) = outside
      mark(start + 1:start + width - 2) = merge(inside, free, active(:, row))
      if (present(within)) then
        where (.not. (active(:, row) .or. within(:, row))) mark(start + 1:start + width - 2) = outside
      end if
      mark(start + width - 1) = outside
    end do
    !$omp end parallel do
  end subroutine mark_window

  !> Compute the height of the continuation in a ring.
  pure real(wp) function profile(ring, n_ring)
    !> Ring, and number of rings
    integer, intent(in) :: ring, n_ring
    profile = 1.0_wp - sqrt(real(ring, wp)/(n_ring + 1))
  end function profile

  !> Mark the active nodes with a neighbor that is not; a node at the rim of the window has none there.
  pure subroutine find_edge(n_col, mark, step, edge, n)
    !> Number of columns
    integer, intent(in) :: n_col
    !> Marks of all nodes, and steps to the neighbors of a node
    integer(int16), intent(inout), contiguous :: mark(:)
    integer, intent(in) :: step(:)
    !> The nodes, as places in the marks; as long as these, since pages that nothing is written to take no memory
    integer, allocatable, intent(out) :: edge(:)
    !> Their number
    integer, intent(out) :: n
    integer :: row, first, last, n_free, place, i

    allocate (edge(size(mark)))
    n = 0
    do row = 1, size(mark)/(n_col + 2) - 2
      do first = row*(n_col + 2) + 2, (row + 1)*(n_col + 2) - 1, stride
        last = min(first + stride - 1, (row + 1)*(n_col + 2) - 1)
        if (count(mark(first:last) == inside) == 0) cycle
        n_free = 0
        do i = -1, 1
          n_free = n_free + count(mark(first - 1 + i*(n_col + 2):last + 1 + i*(n_col + 2)) == free)
        end do
        if (n_free == 0) cycle
        do place = first, last
          if (mark(place) /= inside) cycle
          do i = 1, size(step)
            if (mark(place + step(i)) /= free) cycle
            mark(place) = 0
            n = n + 1
            edge(n) = place
            exit
          end do
        end do
      end do
    end do
  end subroutine find_edge

  !> Add the nodes next to a ring that have no ring yet to the list.
  pure subroutine add_ring(list, from, to, step, ring, mark, n)
    !> Nodes of the rings, as places in the marks
    integer, intent(inout) :: list(:)
    !> First and last node of the ring before, and steps to the neighbors of a node
    integer, intent(in) :: from, to, step(:)
    !> Number of the new ring
    integer(int16), intent(in) :: ring
    !> Marks of all nodes
    integer(int16), intent(inout) :: mark(:)
    !> Nodes in the list
    integer, intent(inout) :: n
    integer :: i, k, near

    do i = from, to
      do k = 1, size(step)
        near = list(i) + step(k)
        if (mark(near) /= free) cycle
        n = n + 1
        mark(near) = ring
        list(n) = near
      end do
    end do
  end subroutine add_ring

  !> Continue a field beyond the active nodes.
  subroutine extend(self, field, own, first)
    class(edge_extension_t), intent(in) :: self
    !> Field over the own rows (n)
    real(sp), intent(inout), contiguous, target :: field(:)
    !> Share of their own value at the nodes of the rings, to which the rest of the continuation is added: absent, 0 (n)
    real(sp), intent(in), optional, contiguous, target :: own(:)
    !> Height of the continuation in the first ring; absent: 1
    real(sp), intent(in), optional :: first
    real(sp), allocatable :: wider(:), wider_own(:)
    real(sp), allocatable :: mean(:)

    if (self%fields%ranks%size == 1) then
      if (.not. allocated(self%lines) .or. present(own)) then
        call self%pass_rings(.false., field, own, first)
        return
      end if
      allocate (mean, source=self%lines%mean(field))
      call self%pass_rings(.false., field)
      call self%lines%add(mean, field)
      return
    end if
    call widen(self, field, wider)
    if (present(own)) call widen(self, own, wider_own)                         ! absent if it is not allocated
    call self%pass_rings(.false., wider, wider_own, first)
    call narrow(self, wider, field)
  end subroutine extend

  !> Take a field on all rows of the rings.
  subroutine widen(self, field, wider)
    class(edge_extension_t), intent(in) :: self
    real(sp), intent(in), contiguous, target :: field(:)
    real(sp), allocatable, target, intent(out) :: wider(:)
    real(sp), pointer, contiguous :: own(:, :), rows(:, :)
    integer :: n_col, n

    n_col = size(field)/(self%own(2) - self%own(1) + 1)
    n = self%rows(2) - self%rows(1) + 1
    allocate (wider(n_col*n))
    own(1:n_col, 1:self%own(2) - self%own(1) + 1) => field
    rows(1:n_col, 1:n) => wider
    call self%fields%fetch(self%n_row, own, self%rows(1), rows)
  end subroutine widen

  !> Take the own rows of a field.
  pure subroutine narrow(self, wider, field)
    class(edge_extension_t), intent(in) :: self
    real(sp), intent(in), contiguous :: wider(:)
    real(sp), intent(inout), contiguous :: field(:)
    integer :: start

    start = size(field)/(self%own(2) - self%own(1) + 1)*(self%own(1) - self%rows(1))
    field = wider(start + 1:start + size(field))
  end subroutine narrow

  !> Apply the transpose of `extend`; the values on the rings have no meaning afterwards, but for those of `own`.
  subroutine fold(self, field, own, first)
    class(edge_extension_t), intent(in) :: self
    !> Field over the own rows (n)
    real(sp), intent(inout), contiguous, target :: field(:)
    !> Share of their own value at the nodes of the rings: absent, 0 (n)
    real(sp), intent(in), optional, contiguous, target :: own(:)
    !> Height of the continuation in the first ring; absent: 1
    real(sp), intent(in), optional :: first
    real(sp), allocatable :: wider(:), wider_own(:)
    real(sp), allocatable :: share(:)

    if (self%fields%ranks%size == 1) then
      if (.not. allocated(self%lines) .or. present(own)) then
        call self%pass_rings(.true., field, own, first)
        return
      end if
      allocate (share, source=self%lines%share(field))
      call self%pass_rings(.true., field)
      call self%lines%hand_back(share, field)
      return
    end if
    call widen(self, field, wider)
    if (present(own)) call widen(self, own, wider_own)
    call self%pass_rings(.true., wider, wider_own, first)
    call narrow(self, wider, field)
  end subroutine fold

  !> Continue a field in the rows of the rings, or fold it.
  !>
  !> A ring takes several stages, each of which needs the neighboring rows of the stage before. In one thread the stages follow each
  !> other a block apart, so that the rows that they need are still in the cache.
  subroutine pass_rings(self, folds, field, own, first)
    class(edge_extension_t), intent(in) :: self
    !> Fold it
    logical, intent(in) :: folds
    !> Field over the window (n)
    real(sp), intent(inout), contiguous :: field(:)
    !> Share of their own value at the nodes of the rings, to which the rest of the continuation is added: absent, 0 (n)
    real(sp), intent(in), optional, contiguous :: own(:)
    !> Height of the continuation in the first ring; absent: 1
    real(sp), intent(in), optional :: first
    real(sp), allocatable :: value(:), before(:)
    integer :: n_stage, stage, time, block

    if (self%n_ring == 0) return                                               ! or not set up: zero beyond the edge
    allocate (value(size(self%node)))
    if (present(own)) allocate (before(size(self%node)))
    n_stage = self%n_ring*(2*self%smoothings + 1)
    if (folds) n_stage = n_stage + 1
    associate (n_block => size(self%start, 2))
      if (self%space%threads == 1) then
        do time = 1, n_block + n_stage - 1
          do stage = max(time - n_block, 0), min(time, n_stage) - 1
            call pass_block(stage, time - stage)
          end do
        end do
      else
        !$omp parallel num_threads(self%space%threads) private(stage, block)
        do stage = 0, n_stage - 1
          !$omp do schedule(static)
          do block = 1, n_block
            call pass_block(stage, block)
          end do
          !$omp end do
        end do
        !$omp end parallel
      end if
      if (.not. (folds .and. present(own))) return
      do block = 1, n_block
        do stage = self%start(1, block), self%start(self%n_ring + 1, block) - 1
          field(self%node(stage)) = before(stage)
        end do
      end do
    end associate

  contains

    !> Do one stage in one block.
    subroutine pass_block(stage, block)
      integer, intent(in) :: stage, block
      if (folds) then
        call fold_block(self, stage, block, field, value, before, own, first)
      else
        call extend_block(self, stage, block, field, value, before, own, first)
      end if
    end subroutine pass_block

  end subroutine pass_rings

  !> Do a stage of the continuation in a block: the mean of the ring before, or a mean along the ring, found or put into the field.
  pure subroutine extend_block(self, stage, block, field, value, before, own, first)
    type(edge_extension_t), intent(in) :: self
    !> Stage, from 0, and block
    integer, intent(in) :: stage, block
    !> Field over the window; of the nodes of the rings, new values and those of the field before
    real(sp), intent(inout), contiguous :: field(:), value(:)
    real(sp), intent(inout), contiguous, optional :: before(:)
    !> See `pass_rings`
    real(sp), intent(in), contiguous, optional :: own(:)
    real(sp), intent(in), optional :: first
    integer :: ring, part, k

    ring = stage/(2*self%smoothings + 1) + 1
    part = modulo(stage, 2*self%smoothings + 1)
    associate (from => self%start(ring, block), to => self%start(ring + 1, block) - 1)
      if (part == 0) then
        if (present(own)) before(from:to) = field(self%node(from:to))
        call sum_over(self, from, to, self%inner, field, value)
        do k = from, to
          value(k) = self%fall(self%inner(k), ring)*value(k)
        end do
        if (ring == 1 .and. present(first)) value(from:to) = first*value(from:to)
      else if (modulo(part, 2) == 1) then
        call sum_over(self, from, to, self%beside, field, value)
        return
      end if
      do k = from, to
        if (part > 0) value(k) = mean(self%beside(k))*value(k)
        field(self%node(k)) = value(k)
      end do
      if (part < 2*self%smoothings .or. .not. present(own)) return
      do k = from, to
        field(self%node(k)) = before(k) + (1.0_sp - own(self%node(k)))*value(k)
      end do
    end associate
  end subroutine extend_block

  !> Do a stage of the transpose in a block: the values of the next ring are added and smoothed along the ring, and get their factor
  !> for the ring before.
  pure subroutine fold_block(self, stage, block, field, value, before, own, first)
    type(edge_extension_t), intent(in) :: self
    !> Stage, from 0, and block
    integer, intent(in) :: stage, block
    !> Field over the window; of the nodes of the rings, new values and those that the field has afterwards
    real(sp), intent(inout), contiguous :: field(:), value(:)
    real(sp), intent(inout), contiguous, optional :: before(:)
    !> See `pass_rings`
    real(sp), intent(in), contiguous, optional :: own(:)
    real(sp), intent(in), optional :: first
    integer :: ring, part, k

    ring = self%n_ring - stage/(2*self%smoothings + 1)
    part = modulo(stage, 2*self%smoothings + 1)
    associate (from => self%start(ring, block), to => self%start(ring + 1, block) - 1)
      if (modulo(part, 2) == 1) then
        call sum_over(self, from, to, self%beside, field, value)
        return
      end if
      if (part == 0) then
        call sum_over(self, from, to, self%outer, field, value)
        do k = from, to
          value(k) = field(self%node(k)) + value(k)
        end do
        if (ring > 0 .and. present(own)) then
          before(from:to) = value(from:to)
          value(from:to) = (1.0_sp - own(self%node(from:to)))*value(from:to)
        end if
        if (ring == 1 .and. present(first)) value(from:to) = first*value(from:to)
      end if
      do k = from, to
        if (ring == 0) then
          field(self%node(k)) = value(k)
        else if (part < 2*self%smoothings) then
          field(self%node(k)) = mean(self%beside(k))*value(k)
        else
          field(self%node(k)) = self%fall(self%inner(k), ring)*value(k)
        end if
      end do
    end associate
  end subroutine fold_block

  !> Sum a field over some neighbors of each node.
  pure subroutine sum_over(self, from, to, neighbors, field, total)
    type(edge_extension_t), intent(in) :: self
    !> First and last node
    integer, intent(in) :: from, to
    !> Neighbours of each node, as bits
    integer(int8), intent(in), contiguous :: neighbors(:)
    !> Field over the window, and the sums
    real(sp), intent(in), contiguous :: field(:)
    real(sp), intent(inout), contiguous :: total(:)
    real(sp) :: one
    integer :: k, bits

    do k = from, to
      bits = neighbors(k)
      associate (node => self%node(k))
        one = taken(bits, 1)*field(node + self%first(1, bits)) + taken(bits, 2)*field(node + self%first(2, bits)) &
              + taken(bits, 3)*field(node + self%first(3, bits))
        bits = others(bits)
        do while (bits /= 0)
          one = one + field(node + self%step(trailz(bits) + 1))
          bits = iand(bits, bits - 1)
        end do
      end associate
      total(k) = one
    end do
  end subroutine sum_over

end module hc_edge_continuation
