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
  use hc_precision, only: wp, sp, lk
  use hc_options, only: preconditioner_options_t
  use hc_lattice, only: neighbor_steps
  use hc_field_space, only: field_space_t
  use hc_line_means, only: line_means_t, new_line_means
  use hc_active_set, only: find_span
  implicit none
  private

  public :: edge_extension_t, new_edge_extension

  !> Marks of nodes without a ring, and of the surroundings of the window.
  integer, parameter :: free = huge(0), outside = huge(0) - 1
  !> Nodes in the rings from which on threads share the work.
  integer, parameter :: worth_sharing = 8192

  !> Neighbours of the nodes of the rings.
  type :: edge_extension_t
    private
    !> Nodes of the rings, ring by ring, and where each ring begins
    integer, allocatable :: node(:), ring(:)
    !> Neighbours in the ring before, as nodes (6, n), and how many they are
    integer, allocatable :: inner(:, :), n_inner(:)
    !> Neighbours in the same ring and the node itself, as places in the list (7, n), and how many they are
    integer, allocatable :: beside(:, :), n_beside(:)
    !> Fall from ring to ring over the number of neighbors in the ring before; 1 over the number of those in the same ring
    real(sp), allocatable :: fall(:), mean(:)
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
    procedure, private :: extend_rings, fold_rings
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
    integer, allocatable :: mark(:), frontier(:), step(:)
    integer :: n_ring

    step = neighbor_steps(size(active, 1) + 2)
    if (present(near)) step = pack(step, near)
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
      call find_edge(around, mark, step, space, frontier)
      n_ring = number_of_rings(options, space%count(active), size(frontier))
      if (present(by_width)) n_ring = int(by_width*space%count(active)/max(size(frontier), 1))
      call find_rings(self, size(active, 1), n_ring, step, frontier, mark, space, options)
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
    call self%extend_rings(field)
    allocate (self%lines)
    call new_line_means(self%lines, active, reshape(field, shape(active)), across, (size(self%ring) - 1)/2, real(share, sp), &
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
    integer, allocatable :: mark(:), frontier(:)
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
    call find_edge(wider, mark, step, space, frontier)
    counts = [count(active), count(is_own(self, size(active, 1), frontier)), 0]
    call space%ranks%add_counts(counts)
    n_ring = number_of_rings(options, counts(1), counts(2))
    call take_rows(self, active, n_ring*(options%smoothings + 2) + 1, wider)
    if (present(within)) call take_rows(self, within, n_ring*(options%smoothings + 2) + 1, around)
    call mark_window(wider, space, mark, around)
    call find_edge(wider, mark, step, space, frontier)
    call find_rings(self, size(active, 1), n_ring, step, frontier, mark, space, options)
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
  subroutine find_rings(self, n_col, most_rings, step, frontier, mark, space, options)
    type(edge_extension_t), intent(inout) :: self
    !> Number of columns, and of rings, unless they fill the window before
    integer, intent(in) :: n_col, most_rings
    !> Steps to the neighbors of a node
    integer, intent(in), contiguous :: step(:)
    !> Nodes at the edge
    integer, allocatable, intent(inout) :: frontier(:)
    !> Marks of the nodes, one column and row around the window included: 0 on active nodes, the place in the list on
    !> those of the rings, `free` elsewhere and `outside` around
    integer, intent(inout), contiguous :: mark(:)
    type(field_space_t), intent(in) :: space
    type(preconditioner_options_t), intent(in) :: options
    integer, allocatable :: next(:), node(:)
    integer :: n_ring, width, before, r, n, k
    real(wp) :: fall, found(1)

    width = n_col + 2
    found = 0.0_wp
    allocate (node(0), self%ring(1))
    self%ring(1) = 1
    do r = 1, most_rings
      call next_ring(frontier, step, mark, size(node), next)
      if (space%ranks%size > 1) then
        if (any(is_own(self, n_col, next))) found = r
      else if (size(next) == 0) then
        exit
      end if
      node = [node, next]
      self%ring = [self%ring, size(node) + 1]
      call move_alloc(next, frontier)
    end do

    if (space%ranks%size > 1) then
      call space%most(found)
      self%ring = self%ring(:nint(found(1)) + 1)
      node = node(:self%ring(size(self%ring)) - 1)
    end if
    n = size(node)
    n_ring = size(self%ring) - 1
    before = merge(self%rows(1) - 1, 0, space%ranks%size == 1)
    self%smoothings = options%smoothings
    if (n >= worth_sharing) self%space = space
    allocate (self%node(n), self%n_inner(n), self%n_beside(n), self%fall(n), self%mean(n), self%inner(6, n), &
              self%beside(7, n))
    !$omp parallel num_threads(self%space%threads) private(r, k, fall)
    do r = 1, n_ring
      fall = profile(r, n_ring)/profile(r - 1, n_ring)
      !$omp do schedule(static)
      do k = self%ring(r), self%ring(r + 1) - 1
        call list_neighbors(node(k), step, mark, self%ring(r:r + 1), self%inner(:, k), self%beside(:, k), &
                            self%n_inner(k), self%n_beside(k))
        self%node(k) = in_window(node(k))
        self%inner(:self%n_inner(k), k) = in_window(self%inner(:self%n_inner(k), k))
        self%mean(k) = 1.0_sp/self%n_beside(k)
        self%fall(k) = real(fall/self%n_inner(k), sp)
      end do
      !$omp end do nowait
    end do
    !$omp end parallel

  contains

    !> Return the place in the window of a place in the marks.
    elemental integer function in_window(place)
      integer, intent(in) :: place
      integer :: row
      row = (place - 1)/width
      in_window = place - 1 - row*width + (row - 1 + before)*n_col
    end function in_window

  end subroutine find_rings

  !> Mark all nodes before there are rings.
  subroutine mark_window(active, space, mark, within)
    !> Active nodes (n_col, n_row)
    logical(lk), intent(in) :: active(:, :)
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Marks of the nodes, with those around the window
    integer, allocatable, intent(out) :: mark(:)
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
      mark(start + 1:start + width - 2) = merge(0, free, active(:, row))
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

  !> Find the active nodes with a neighbor that is not; a node at the rim of the window has none there.
  subroutine find_edge(active, mark, step, space, edge)
    !> Active nodes (n_col, n_row)
    logical(lk), intent(in), contiguous :: active(:, :)
    !> Marks of all nodes, and steps to the neighbors of a node
    integer, intent(in), contiguous :: mark(:)
    integer, intent(in) :: step(:)
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> The nodes, as places in the marks
    integer, allocatable, intent(out) :: edge(:)
    type :: places_t
      integer, allocatable :: node(:)
    end type places_t
    type(places_t) :: edge_of(size(active, 2))
    integer :: row, n

    n = 0
    !$omp parallel do schedule(static) num_threads(space%threads) reduction(+: n)
    do row = 1, size(active, 2)
      call list_edge(active(:, row), mark, step, row*(size(active, 1) + 2) + 1, edge_of(row)%node)
      n = n + size(edge_of(row)%node)
    end do
    !$omp end parallel do
    allocate (edge(n))
    n = 0
    do row = 1, size(active, 2)
      associate (node => edge_of(row)%node)
        edge(n + 1:n + size(node)) = node
        n = n + size(node)
      end associate
    end do
  end subroutine find_edge

  !> List the nodes of a row at the edge.
  pure subroutine list_edge(active, mark, step, before, node)
    !> Active nodes of the row
    logical(lk), intent(in), contiguous :: active(:)
    !> Marks of all nodes, steps to the neighbors of a node, and the place in the marks before the row
    integer, intent(in), contiguous :: mark(:)
    integer, intent(in) :: step(:), before
    !> The nodes
    integer, allocatable, intent(out) :: node(:)
    integer :: is_edge(size(active)), col, k, low, high, found

    call find_span(active, low, high)
    do col = low, high
      is_edge(col) = 0
    end do
    do k = 1, size(step)
      do col = low, high
        is_edge(col) = merge(1, is_edge(col), mark(before + col + step(k)) == free)
      end do
    end do
    found = 0
    do col = low, high
      is_edge(col) = merge(is_edge(col), 0, active(col))
      found = found + is_edge(col)
    end do
    allocate (node(found))
    found = 0
    do col = low, high
      if (is_edge(col) == 0) cycle
      found = found + 1
      node(found) = before + col
    end do
  end subroutine list_edge

  !> Find the nodes next to a ring that have no ring yet.
  pure subroutine next_ring(ring, step, mark, listed, next)
    !> Nodes of the ring before, and steps to the neighbors of a node
    integer, intent(in) :: ring(:), step(:)
    !> Marks of all nodes; those of the new ring get their place in the list
    integer, intent(inout) :: mark(:)
    !> Nodes that are in the list already
    integer, intent(in) :: listed
    !> Nodes of the new ring
    integer, allocatable, intent(out) :: next(:)
    integer, allocatable :: found(:)
    integer :: i, k, n, near

    allocate (found(size(step)*size(ring)))
    n = 0
    do i = 1, size(ring)
      do k = 1, size(step)
        near = ring(i) + step(k)
        if (mark(near) /= free) cycle
        n = n + 1
        mark(near) = listed + n
        found(n) = near
      end do
    end do
    next = found(:n)
  end subroutine next_ring

  !> List the neighbors of a node in the ring before and in its own.
  pure subroutine list_neighbors(node, step, mark, first, inner, beside, n_inner, n_beside)
    !> The node, and steps to its neighbors
    integer, intent(in) :: node, step(:)
    !> Marks of all nodes
    integer, intent(in) :: mark(:)
    !> First marks of its own ring and of the next
    integer, intent(in) :: first(2)
    !> Neighbours in the ring before (places in the marks), and in its own (places in the list), itself included
    integer, intent(out) :: inner(6), beside(7)
    !> Their numbers
    integer, intent(out) :: n_inner, n_beside
    integer :: k, near

    n_inner = 0
    n_beside = 1
    beside(1) = mark(node)
    do k = 1, size(step)
      near = node + step(k)
      if (mark(near) < first(1)) then
        ! no neighbor is further in than the ring before
        n_inner = n_inner + 1
        inner(n_inner) = near
      else if (mark(near) < first(2)) then
        n_beside = n_beside + 1
        beside(n_beside) = mark(near)
      end if
    end do
  end subroutine list_neighbors

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
        call self%extend_rings(field, own, first)
        return
      end if
      allocate (mean, source=self%lines%mean(field))
      call self%extend_rings(field)
      call self%lines%add(mean, field)
      return
    end if
    call widen(self, field, wider)
    if (present(own)) call widen(self, own, wider_own)                         ! absent if it is not allocated
    call self%extend_rings(wider, wider_own, first)
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

  !> Continue a field in the rows of the rings.
  subroutine extend_rings(self, field, own, first)
    class(edge_extension_t), intent(in) :: self
    !> Field over the window (n)
    real(sp), intent(inout), contiguous :: field(:)
    !> Share of their own value at the nodes of the rings, to which the rest of the continuation is added: absent, 0 (n)
    real(sp), intent(in), optional, contiguous :: own(:)
    !> Height of the continuation in the first ring; absent: 1
    real(sp), intent(in), optional :: first
    real(sp), allocatable :: value(:), smooth(:)
    integer :: r, k, s

    if (.not. allocated(self%node)) return                                     ! not set up: zero beyond the edge
    allocate (value(size(self%node)), smooth(size(self%node)))
    !$omp parallel num_threads(self%space%threads) private(r, k, s)
    do r = 1, size(self%ring) - 1
      associate (from => self%ring(r), to => self%ring(r + 1) - 1)
        call add_up(from, to, self%inner, self%n_inner, field, value, self%fall)
        if (r == 1 .and. present(first)) then
          !$omp do schedule(static)
          do k = from, to
            value(k) = first*value(k)
          end do
          !$omp end do
        end if
        do s = 1, self%smoothings
          call add_up(from, to, self%beside, self%n_beside, value, smooth, self%mean)
          !$omp do schedule(static)
          do k = from, to
            value(k) = smooth(k)
          end do
          !$omp end do
        end do
        !$omp do schedule(static)
        do k = from, to
          if (present(own)) then
            field(self%node(k)) = field(self%node(k)) + (1.0_sp - own(self%node(k)))*value(k)
          else
            field(self%node(k)) = value(k)
          end if
        end do
        !$omp end do
      end associate
    end do
    !$omp end parallel
  end subroutine extend_rings

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
        call self%fold_rings(field, own, first)
        return
      end if
      allocate (share, source=self%lines%share(field))
      call self%fold_rings(field)
      call self%lines%hand_back(share, field)
      return
    end if
    call widen(self, field, wider)
    if (present(own)) call widen(self, own, wider_own)
    call self%fold_rings(wider, wider_own, first)
    call narrow(self, wider, field)
  end subroutine fold

  !> Fold a field in the rows of the rings.
  subroutine fold_rings(self, field, own, first)
    class(edge_extension_t), intent(in) :: self
    !> Field over the window (n)
    real(sp), intent(inout), contiguous :: field(:)
    !> Share of their own value at the nodes of the rings: absent, 0 (n)
    real(sp), intent(in), optional, contiguous :: own(:)
    !> Height of the continuation in the first ring; absent: 1
    real(sp), intent(in), optional :: first
    real(sp), allocatable :: value(:), share(:)
    integer :: r, k, s

    if (.not. allocated(self%node)) return
    allocate (value(size(self%node)), share(size(self%node)))
    !$omp parallel num_threads(self%space%threads) private(r, k, s)
    do r = size(self%ring) - 1, 1, -1
      associate (from => self%ring(r), to => self%ring(r + 1) - 1)
        call take_up(from, to, self%node, field, value)
        if (present(own) .or. (r == 1 .and. present(first))) then
          !$omp do schedule(static)
          do k = from, to
            if (present(own)) value(k) = (1.0_sp - own(self%node(k)))*value(k)
            if (r == 1 .and. present(first)) value(k) = first*value(k)
          end do
          !$omp end do
        end if
        do s = 1, self%smoothings
          !$omp do schedule(static)
          do k = from, to
            share(k) = self%mean(k)*value(k)
          end do
          !$omp end do
          call add_up(from, to, self%beside, self%n_beside, share, value)
        end do
        !$omp single
        call spread_out(from, to, self%inner, self%n_inner, self%fall, value, field)
        !$omp end single
      end associate
    end do
    !$omp end parallel
  end subroutine fold_rings

  !> Take the values of a field at the nodes of a ring, by the threads of a parallel region.
  subroutine take_up(from, to, node, field, value)
    !> First and last node
    integer, intent(in) :: from, to
    !> Their places in the field
    integer, intent(in), contiguous :: node(:)
    real(sp), intent(in), contiguous :: field(:)
    !> The values
    real(sp), intent(inout), contiguous :: value(:)
    integer :: k

    !$omp do schedule(static)
    do k = from, to
      value(k) = field(node(k))
    end do
    !$omp end do
  end subroutine take_up

  !> Add values at the nodes of a ring to some places of a field; several nodes to the same one, always in the same order.
  pure subroutine spread_out(from, to, places, n_places, factor, value, field)
    !> First and last node
    integer, intent(in) :: from, to
    !> Places of each node, and how many they are
    integer, intent(in), contiguous :: places(:, :), n_places(:)
    !> Values and their factors
    real(sp), intent(in), contiguous :: factor(:), value(:)
    real(sp), intent(inout), contiguous :: field(:)
    real(sp) :: one
    integer :: k, i

    do k = from, to
      one = factor(k)*value(k)
      do i = 1, n_places(k)
        field(places(i, k)) = field(places(i, k)) + one
      end do
    end do
  end subroutine spread_out

  !> Sum at nodes of a ring over some places, by the threads of a parallel region.
  subroutine add_up(from, to, places, n_places, value, total, factor)
    !> First and last node
    integer, intent(in) :: from, to
    !> Places of each node, and how many they are
    integer, intent(in), contiguous :: places(:, :), n_places(:)
    !> Values at the places, and their sums
    real(sp), intent(in), contiguous :: value(:)
    real(sp), intent(inout), contiguous :: total(:)
    !> Factor of each sum; absent: 1
    real(sp), intent(in), contiguous, optional :: factor(:)
    real(sp) :: one
    integer :: k, i

    !$omp do schedule(static)
    do k = from, to
      one = 0.0_sp
      do i = 1, n_places(k)
        one = one + value(places(i, k))
      end do
      if (present(factor)) one = factor(k)*one
      total(k) = one
    end do
    !$omp end do
  end subroutine add_up

end module hc_edge_continuation
