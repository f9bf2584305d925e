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
  !> Nodes in the rings from which on threads share the work.
  integer, parameter :: worth_sharing = 8192

  !> Nodes of the rings and their neighbors; the active nodes at the edge are ring 0.
  type :: edge_extension_t
    private
    !> Number of rings
    integer :: n_ring = 0
    !> Nodes, row by row and in each by rings, and where each ring begins (0:n_ring + 1, row)
    integer, allocatable :: node(:), start(:, :)
    !> Steps from a node to itself and to its neighbors
    integer, allocatable :: step(:)
    !> Of each node, a bit for each step: those to the ring before, those in the same ring, and those to the next one
    integer(int8), allocatable :: inner(:), beside(:), outer(:)
    !> By these bits: fall from ring to ring over the number of steps (bits, ring), and 1 over the number
    real(sp), allocatable :: fall(:, :)
    real(sp) :: mean(0:127) = 0.0_sp
    !> By them, the first steps, by a factor of 1 or 0, and the bits of the others: without branches for most nodes
    integer :: first(3, 0:127) = 0, others(0:127) = 0
    real(sp) :: taken(3, 0:127) = 0.0_sp
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
    integer, allocatable :: edge(:), step(:)
    integer :: n_ring

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
      call find_edge(size(active, 1), mark, step, space, edge)
      n_ring = number_of_rings(options, space%count(active), size(edge))
      if (present(by_width)) n_ring = int(by_width*space%count(active)/max(size(edge), 1))
      call find_rings(self, size(active, 1), n_ring, step, edge, mark, space, options)
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
    integer, allocatable :: edge(:)
    integer :: counts(3), n_ring

    self%fields = space
    self%own = 0
    counts = size(active, 2)
    call space%ranks%add_counts(counts)
    self%n_row = counts(1)
    self%own = space%own_rows(self%n_row)
    call take_rows(self, active, 1, wider)
    if (present(within)) call take_rows(self, within, 1, around)
    call mark_window(wider, space, mark, around)
    call find_edge(size(active, 1), mark, step, space, edge)
    counts = [count(active), count(is_own(self, size(active, 1), edge)), 0]
    call space%ranks%add_counts(counts)
    n_ring = number_of_rings(options, counts(1), counts(2))
    call take_rows(self, active, n_ring*(options%smoothings + 2) + 1, wider)
    if (present(within)) call take_rows(self, within, n_ring*(options%smoothings + 2) + 1, around)
    call mark_window(wider, space, mark, around)
    call find_edge(size(active, 1), mark, step, space, edge)
    call find_rings(self, size(active, 1), n_ring, step, edge, mark, space, options)
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
  subroutine find_rings(self, n_col, most_rings, step, edge, mark, space, options)
    type(edge_extension_t), intent(inout) :: self
    !> Number of columns, and of rings, unless they fill the window before
    integer, intent(in) :: n_col, most_rings
    !> Steps to the neighbors of a node, and nodes at the edge, among the marks
    integer, intent(in), contiguous :: step(:), edge(:)
    !> Marks of the nodes, one column and row around the window included: `inside` or 0 on active nodes, the ring on those of
    !> the rings, `free` elsewhere and `outside` around
    integer(int16), intent(inout), contiguous :: mark(:)
    type(field_space_t), intent(in) :: space
    type(preconditioner_options_t), intent(in) :: options
    integer, allocatable :: list(:)
    integer :: r, n, from, to, bits
    real(wp) :: found(1)

    ! room for as many nodes as there can be: what is not used takes no memory
    allocate (list(size(mark)))
    to = size(edge)
    list(:to) = edge
    from = 1
    found = 0.0_wp
    do r = 1, most_rings
      n = to
      call add_ring(list, from, to, step, int(r, int16), mark, n)
      from = to + 1
      to = n
      if (space%ranks%size == 1) then
        if (to < from) exit
        found = r
      else if (any(is_own(self, n_col, list(from:to)))) then
        found = r
      end if
    end do
    deallocate (list)
    call space%most(found)
    self%n_ring = nint(found(1))
    self%smoothings = options%smoothings
    allocate (self%fall(0:127, self%n_ring))
    do bits = 1, 2**size(self%step) - 1
      self%mean(bits) = 1.0_sp/popcnt(bits)
      self%others(bits) = bits
      do r = 1, min(popcnt(bits), size(self%first, 1))
        self%first(r, bits) = self%step(trailz(self%others(bits)) + 1)
        self%taken(r, bits) = 1.0_sp
        self%others(bits) = iand(self%others(bits), self%others(bits) - 1)
      end do
      do r = 1, self%n_ring
        self%fall(bits, r) = real(profile(r, self%n_ring)/profile(r - 1, self%n_ring)/popcnt(bits), sp)
      end do
    end do
    call list_rings(self, n_col, step, mark, space)
  end subroutine find_rings

  !> List the nodes of the rings, row by row, with their neighbors.
  subroutine list_rings(self, n_col, step, mark, space)
    type(edge_extension_t), intent(inout) :: self
    !> Number of columns
    integer, intent(in) :: n_col
    !> Steps to the neighbors of a node among the marks, and marks of the nodes
    integer, intent(in), contiguous :: step(:)
    integer(int16), intent(in), contiguous :: mark(:)
    type(field_space_t), intent(in) :: space
    integer :: n_node(0:self%n_ring), cols(n_col), row, first, r, k, n

    n = size(mark)/(n_col + 2) - 2
    first = merge(self%rows(1), 1, space%ranks%size == 1)
    allocate (self%start(0:self%n_ring + 1, first:first + n - 1))
    !$omp parallel do schedule(static) num_threads(space%threads) private(n_node, cols, r, k, n)
    do row = first, ubound(self%start, 2)
      associate (before => (row - first + 1)*(n_col + 2) + 1)
        call find_marks(mark(before + 1:before + n_col), 0_int16, int(self%n_ring, int16), cols, n)
        n_node = 0
        do k = 1, n
          r = mark(before + cols(k))
          n_node(r) = n_node(r) + 1
        end do
      end associate
      self%start(:self%n_ring, row) = n_node
    end do
    !$omp end parallel do
    n = 0
    do row = first, ubound(self%start, 2)
      do r = 0, self%n_ring
        k = self%start(r, row)
        self%start(r, row) = n + 1
        n = n + k
      end do
      self%start(self%n_ring + 1, row) = n + 1
    end do
    if (n >= worth_sharing) self%space = space
    allocate (self%node(n), self%inner(n), self%beside(n), self%outer(n))
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(n_node, cols, r, k, n)
    do row = first, ubound(self%start, 2)
      associate (before => (row - first + 1)*(n_col + 2) + 1)
        call find_marks(mark(before + 1:before + n_col), 0_int16, int(self%n_ring, int16), cols, n)
        n_node = self%start(:self%n_ring, row) - 1
        do k = 1, n
          r = mark(before + cols(k))
          n_node(r) = n_node(r) + 1
          self%node(n_node(r)) = (row - 1)*n_col + cols(k)
          call find_neighbors(self, n_node(r), r, before + cols(k), step, mark)
        end do
      end associate
    end do
    !$omp end parallel do
  end subroutine list_rings

  !> Find the marks in a row within some limits.
  pure subroutine find_marks(mark, low, high, cols, n)
    !> Marks of the row, and their limits
    integer(int16), intent(in), contiguous :: mark(:)
    integer(int16), intent(in) :: low, high
    !> Their columns, and how many they are
    integer, intent(inout) :: cols(:)
    integer, intent(out) :: n
    integer :: from, col

    n = 0
    do from = 1, size(mark), stride
      associate (to => min(from + stride - 1, size(mark)))
        if (count(mark(from:to) >= low .and. mark(from:to) <= high) == 0) cycle
        do col = from, to
          if (mark(col) < low .or. mark(col) > high) cycle
          n = n + 1
          cols(n) = col
        end do
      end associate
    end do
  end subroutine find_marks

  !> Find the neighbors of a node in the ring before, in its own, and in the next one.
  pure subroutine find_neighbors(self, n, ring, place, step, mark)
    type(edge_extension_t), intent(inout) :: self
    !> The node in the list, its ring, and its place among the marks
    integer, intent(in) :: n, ring, place
    !> Steps to the neighbors of a node among the marks, and marks of the nodes
    integer, intent(in), contiguous :: step(:)
    integer(int16), intent(in), contiguous :: mark(:)
    integer :: found(-2:2), other, k

    found = 0
    do k = 1, size(step)
      other = max(min(mark(place + step(k)) - ring, 2), -2)
      found(other) = ior(found(other), ishft(1, k))
    end do
    self%inner(n) = int(found(-1), int8)
    self%beside(n) = int(ior(found(0), 1), int8)
    self%outer(n) = int(merge(found(1), 0, ring < self%n_ring), int8)
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
  subroutine find_edge(n_col, mark, step, space, edge)
    !> Number of columns
    integer, intent(in) :: n_col
    !> Marks of all nodes, and steps to the neighbors of a node
    integer(int16), intent(inout), contiguous :: mark(:)
    integer, intent(in) :: step(:)
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> The nodes, as places in the marks
    integer, allocatable, intent(out) :: edge(:)
    integer :: n_edge(size(mark)/(n_col + 2) - 2), cols(n_col), row, i, k, n

    !$omp parallel do schedule(static) num_threads(space%threads) private(cols, i, k, n)
    do row = 1, size(n_edge)
      associate (before => row*(n_col + 2) + 1)
        call find_marks(mark(before + 1:before + n_col), inside, inside, cols, n)
        n_edge(row) = 0
        do k = 1, n
          do i = 1, size(step)
            if (mark(before + cols(k) + step(i)) /= free) cycle
            mark(before + cols(k)) = 0
            n_edge(row) = n_edge(row) + 1
            exit
          end do
        end do
      end associate
    end do
    !$omp end parallel do
    allocate (edge(sum(n_edge)))
    n = 0
    do row = 1, size(n_edge)
      if (n_edge(row) == 0) cycle
      associate (before => row*(n_col + 2) + 1)
        call find_marks(mark(before + 1:before + n_col), 0_int16, 0_int16, cols, k)
        edge(n + 1:n + k) = before + cols(:k)
      end associate
      n = n + k
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
  !> other a row apart, so that the rows that they need are still in the cache.
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
    integer :: n_stage, stage, time, row

    if (self%n_ring == 0) return                                               ! or not set up: zero beyond the edge
    allocate (value(size(self%node)))
    if (present(own)) allocate (before(size(self%node)))
    n_stage = self%n_ring*(2*self%smoothings + 1)
    if (folds) n_stage = n_stage + 1
    associate (low => lbound(self%start, 2), high => ubound(self%start, 2))
      if (self%space%threads == 1) then
        do time = low, high + n_stage - 1
          do stage = max(time - high, 0), min(time - low, n_stage - 1)
            call pass_row(stage, time - stage)
          end do
        end do
      else
        !$omp parallel num_threads(self%space%threads) private(stage, row)
        do stage = 0, n_stage - 1
          !$omp do schedule(static)
          do row = low, high
            call pass_row(stage, row)
          end do
          !$omp end do
        end do
        !$omp end parallel
      end if
      if (.not. (folds .and. present(own))) return
      do row = low, high
        do stage = self%start(1, row), self%start(self%n_ring + 1, row) - 1
          field(self%node(stage)) = before(stage)
        end do
      end do
    end associate

  contains

    !> Do one stage in one row.
    subroutine pass_row(stage, row)
      integer, intent(in) :: stage, row
      if (folds) then
        call fold_row(self, stage, row, field, value, before, own, first)
      else
        call extend_row(self, stage, row, field, value, before, own, first)
      end if
    end subroutine pass_row

  end subroutine pass_rings

  !> Do a stage of the continuation in a row: the mean of the ring before, or a mean along the ring, found or put into the field.
  pure subroutine extend_row(self, stage, row, field, value, before, own, first)
    type(edge_extension_t), intent(in) :: self
    !> Stage, from 0, and row
    integer, intent(in) :: stage, row
    !> Field over the window; of the nodes of the rings, new values and those of the field before
    real(sp), intent(inout), contiguous :: field(:), value(:)
    real(sp), intent(inout), contiguous, optional :: before(:)
    !> See `pass_rings`
    real(sp), intent(in), contiguous, optional :: own(:)
    real(sp), intent(in), optional :: first
    integer :: ring, part, k
    logical :: last

    ring = stage/(2*self%smoothings + 1) + 1
    part = modulo(stage, 2*self%smoothings + 1)
    last = part == 2*self%smoothings
    do k = self%start(ring, row), self%start(ring + 1, row) - 1
      if (part == 0) then
        if (present(own)) before(k) = field(self%node(k))
        value(k) = self%fall(self%inner(k), ring)*sum_over(self, field, self%node(k), self%inner(k))
        if (ring == 1 .and. present(first)) value(k) = first*value(k)
      else if (modulo(part, 2) == 1) then
        value(k) = self%mean(self%beside(k))*sum_over(self, field, self%node(k), self%beside(k))
        cycle
      end if
      field(self%node(k)) = value(k)
      if (last .and. present(own)) field(self%node(k)) = before(k) + (1.0_sp - own(self%node(k)))*value(k)
    end do
  end subroutine extend_row

  !> Do a stage of the transpose in a row: what the next ring hands back is added, smoothed along the ring, and made ready for the
  !> ring before.
  pure subroutine fold_row(self, stage, row, field, value, before, own, first)
    type(edge_extension_t), intent(in) :: self
    !> Stage, from 0, and row
    integer, intent(in) :: stage, row
    !> Field over the window; of the nodes of the rings, new values and those that the field has afterwards
    real(sp), intent(inout), contiguous :: field(:), value(:)
    real(sp), intent(inout), contiguous, optional :: before(:)
    !> See `pass_rings`
    real(sp), intent(in), contiguous, optional :: own(:)
    real(sp), intent(in), optional :: first
    integer :: ring, part, k

    ring = self%n_ring - stage/(2*self%smoothings + 1)
    part = modulo(stage, 2*self%smoothings + 1)
    do k = self%start(ring, row), self%start(ring + 1, row) - 1
      associate (node => self%node(k))
        if (part == 0) then
          value(k) = field(node) + sum_over(self, field, node, self%outer(k))
          if (ring == 0) then
            field(node) = value(k)
            cycle
          end if
          if (present(own)) then
            before(k) = value(k)
            value(k) = (1.0_sp - own(node))*value(k)
          end if
          if (ring == 1 .and. present(first)) value(k) = first*value(k)
        else if (modulo(part, 2) == 1) then
          value(k) = sum_over(self, field, node, self%beside(k))
          cycle
        end if
        if (part < 2*self%smoothings) then
          field(node) = self%mean(self%beside(k))*value(k)
        else
          field(node) = self%fall(self%inner(k), ring)*value(k)
        end if
      end associate
    end do
  end subroutine fold_row

  !> Sum a field over some neighbors of a node.
  pure real(sp) function sum_over(self, field, node, neighbors) result(total)
    type(edge_extension_t), intent(in) :: self
    !> Field over the window
    real(sp), intent(in), contiguous :: field(:)
    !> The node
    integer, intent(in) :: node
    !> Its neighbors, as bits
    integer(int8), intent(in) :: neighbors
    integer :: bits

    bits = neighbors
    total = self%taken(1, bits)*field(node + self%first(1, bits)) + self%taken(2, bits)*field(node + self%first(2, bits)) &
            + self%taken(3, bits)*field(node + self%first(3, bits))
    bits = self%others(bits)
    do while (bits /= 0)
      total = total + field(node + self%step(trailz(bits) + 1))
      bits = iand(bits, bits - 1)
    end do
  end function sum_over

end module hc_edge_continuation
