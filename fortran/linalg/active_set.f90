!> The active nodes of a field, one after the other without gaps.
!>
!> A contact fills less than half of its window: vectors of the unknowns alone save
!> as much of the work on them. Active nodes come in runs along the rows of the window, so
!> that packing is a copy of a few hundred pieces.
module hc_active_set
  use hc_precision, only: wp, sp, lk
  use hc_field_space, only: field_space_t
  implicit none
  private

  public :: active_set_t, new_active_set, paired_runs_t, pair_runs, find_span
  public :: packed_fields_t, new_packed_fields

  !> Nodes that one thread looks through at a time.
  integer, parameter :: block_size = 8192

  !> Runs of the active nodes of one field, cut where the same nodes of a second field become active or cease to be.
  type :: paired_runs_t
    !> First and last node of each run, and where it begins among the active nodes of both fields; 0: not active in the second
    integer, allocatable :: first(:), last(:), place(:), second(:)
    !> Number of active nodes of the first field
    integer :: n_first = 0
  end type paired_runs_t

  !> Runs of active nodes.
  type :: active_set_t
    !> Number of active nodes
    integer :: n_active = 0
    !> Space of vectors of the active nodes
    type(field_space_t) :: space
    !> First and last node of each run
    integer, allocatable :: first(:), last(:)
    !> Where it begins among the active nodes
    integer, allocatable :: place(:)
    !> The same of a field with two components, by `pair`
    type(paired_runs_t) :: pairs
  contains
    !> The active nodes of a field
    generic :: pack => pack_field, pack_single
    !> All values of a field that are not zero, in place of the field
    procedure :: pack_all, unpack_all
    !> Put them where they belong, the rest of the field stays as it is
    procedure :: unpack => unpack_field
    !> Add a multiple of them to the field
    generic :: add => add_to_field, add_single
    !> Those of a part of the nodes
    procedure :: slice
    !> Pair the components of a field that has two
    procedure :: pair
    !> The nodes that are not active
    procedure :: complement
    !> Is it a given set?
    procedure :: is_set
    procedure, private :: pack_field, pack_single, add_to_field, add_single
  end type active_set_t

  !> Fields that vanish off the nodes of a set, and serve as estimates: their values at these nodes, in single precision.
  type :: packed_fields_t
    !> Number of fields
    integer :: n_field = 0
    !> The nodes, and the values there (n_active, number of fields)
    type(active_set_t), private :: nodes
    real(sp), allocatable, private :: values(:, :)
  contains
    !> Keep a field, and return it over all nodes
    procedure :: keep, restore
  end type packed_fields_t

  !> Find the first and the last of some nodes, 1 and 0 if there are none: those that are active, or those with a value above zero
  interface find_span
    module procedure active_span, positive_span
  end interface find_span

contains

  !> Find the first and the last active node.
  pure subroutine active_span(active, low, high)
    logical(lk), intent(in), contiguous :: active(:)
    integer, intent(out) :: low, high

    high = size(active)
    do while (high > 0)
      if (active(high)) exit
      high = high - 1
    end do
    low = 1
    do while (low < high)
      if (active(low)) exit
      low = low + 1
    end do
  end subroutine active_span

  !> Find the first and the last node with a value above zero.
  pure subroutine positive_span(value, low, high)
    real(wp), intent(in), contiguous :: value(:)
    integer, intent(out) :: low, high

    high = size(value)
    do while (high > 0)
      if (value(high) > 0.0_wp) exit
      high = high - 1
    end do
    low = 1
    do while (low < high)
      if (value(low) > 0.0_wp) exit
      low = low + 1
    end do
  end subroutine positive_span

  !> Find the runs of active nodes; they end at the ends of rows, if these are known, else of blocks.
  subroutine new_active_set(self, active, space, extent)
    !> Set to be set up
    type(active_set_t), intent(out) :: self
    !> Active nodes
    logical(lk), intent(in), contiguous :: active(:)
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Columns and own rows of the window, by pairs of whose rows vectors are summed; absent: in blocks
    integer, intent(in), optional :: extent(2)
    !> Where the runs of each block begin in the list, less one
    integer, allocatable :: before(:)
    integer :: k, n_block, length

    length = block_size
    if (present(extent)) length = extent(1)
    n_block = (size(active) + length - 1)/length
    allocate (before(n_block + 1))
    before(1) = 0
    !$omp parallel do schedule(static) num_threads(space%threads)
    do k = 1, n_block
      before(k + 1) = count_runs(active(start(k):min(start(k + 1) - 1, size(active))))
    end do
    !$omp end parallel do
    do k = 1, n_block
      before(k + 1) = before(k) + before(k + 1)
    end do
    associate (n_run => before(n_block + 1))
      allocate (self%first(n_run), self%last(n_run))
    end associate
    !$omp parallel do schedule(static) num_threads(space%threads)
    do k = 1, n_block
      if (before(k + 1) == before(k)) cycle
      call list_runs(active(start(k):min(start(k + 1) - 1, size(active))), start(k) - 1, &
                     self%first(before(k) + 1:before(k + 1)), self%last(before(k) + 1:before(k + 1)))
    end do
    !$omp end parallel do
    call number_nodes(self)
    self%space = space
    if (present(extent)) call find_ends(self, active, extent)

  contains

    !> Return the first node of a block.
    pure integer function start(block)
      integer, intent(in) :: block
      start = (block - 1)*length + 1
    end function start

  end subroutine new_active_set

  !> Find where pairs of rows of the window end among the active nodes: the rows of a rank are whole pairs, but for the last.
  subroutine find_ends(self, active, extent)
    type(active_set_t), intent(inout) :: self
    !> Active nodes of all components
    logical(lk), intent(in), contiguous :: active(:)
    !> Columns and own rows of the window
    integer, intent(in) :: extent(2)
    integer, allocatable :: ends(:, :)
    integer :: n, m, k, before

    n = (extent(2) + 1)/2
    allocate (ends(0:n, size(active)/product(extent)))
    do m = 1, size(ends, 2)
      before = (m - 1)*product(extent)
      !$omp parallel do schedule(static) num_threads(self%space%threads)
      do k = 1, n
        ends(k, m) = count(active(before + 2*(k - 1)*extent(1) + 1:before + min(2*k, extent(2))*extent(1)))
      end do
      !$omp end parallel do
      ends(0, m) = 0
      if (m > 1) ends(0, m) = ends(n, m - 1)
      do k = 1, n
        ends(k, m) = ends(k - 1, m) + ends(k, m)
      end do
    end do
    call move_alloc(ends, self%space%ends)
  end subroutine find_ends

  !> Count the runs of active nodes.
  pure integer function count_runs(active)
    logical(lk), intent(in), contiguous :: active(:)
    integer :: i

    count_runs = merge(1, 0, active(1))
    !$omp simd reduction(+: count_runs)
    do i = 2, size(active)
      count_runs = count_runs + merge(1, 0, active(i))*merge(0, 1, active(i - 1))
    end do
  end function count_runs

  !> List the runs of active nodes.
  pure subroutine list_runs(active, shift, first, last)
    logical(lk), intent(in), contiguous :: active(:)
    !> Shift of the nodes
    integer, intent(in) :: shift
    !> First and last node of each run
    integer, intent(inout), contiguous :: first(:), last(:)
    !> Nodes that are passed over at once where they are like those before
    integer, parameter :: stride = 16
    integer :: from, to, i, k, n_active
    logical :: before

    k = 0
    before = .false.
    do from = 1, size(active), stride
      to = min(from + stride - 1, size(active))
      n_active = 0
      do i = from, to
        n_active = n_active + merge(1, 0, active(i))
      end do
      if (n_active == merge(to - from + 1, 0, before)) cycle
      do i = from, to
        if (active(i) .neqv. before) then
          if (active(i)) then
            k = k + 1
            first(k) = shift + i
          else
            last(k) = shift + i - 1
          end if
        end if
        before = active(i)
      end do
    end do
    if (before) last(k) = shift + size(active)
  end subroutine list_runs

  !> Gather the active nodes of a field.
  subroutine pack_field(self, field, packed)
    class(active_set_t), intent(in) :: self
    !> Field over all nodes
    real(wp), intent(in), contiguous :: field(:)
    !> Its values at the active nodes (n_active)
    real(wp), intent(inout), contiguous :: packed(:)
    integer :: k, i, shift

    !$omp parallel do schedule(static) num_threads(self%space%threads) private(i, shift)
    do k = 1, size(self%first)
      shift = self%place(k) - self%first(k)
      do i = self%first(k), self%last(k)
        packed(i + shift) = field(i)
      end do
    end do
    !$omp end parallel do
  end subroutine pack_field

  !> Gather the active nodes of a field in single precision.
  subroutine pack_single(self, field, packed)
    class(active_set_t), intent(in) :: self
    !> Field over all nodes
    real(wp), intent(in), contiguous :: field(:)
    !> Its values at the active nodes (n_active)
    real(sp), intent(inout), contiguous :: packed(:)
    integer :: k, i, shift

    !$omp parallel do schedule(static) num_threads(self%space%threads) private(i, shift)
    do k = 1, size(self%first)
      shift = self%place(k) - self%first(k)
      do i = self%first(k), self%last(k)
        packed(i + shift) = real(field(i), sp)
      end do
    end do
    !$omp end parallel do
  end subroutine pack_single

  !> Scatter values to the active nodes of a field.
  subroutine unpack_field(self, packed, field)
    class(active_set_t), intent(in) :: self
    !> Values at the active nodes (n_active)
    real(wp), intent(in), contiguous :: packed(:)
    !> Field over all nodes; the rest stays as it is
    real(wp), intent(inout), contiguous :: field(:)
    integer :: k, i, shift

    !$omp parallel do schedule(static) num_threads(self%space%threads) private(i, shift)
    do k = 1, size(self%first)
      shift = self%place(k) - self%first(k)
      do i = self%first(k), self%last(k)
        field(i) = packed(i + shift)
      end do
    end do
    !$omp end parallel do
  end subroutine unpack_field

  !> Add a multiple of values to the active nodes of a field.
  subroutine add_to_field(self, factor, packed, field)
    class(active_set_t), intent(in) :: self
    !> The multiple
    real(wp), intent(in) :: factor
    !> Values at the active nodes (n_active)
    real(wp), intent(in), contiguous :: packed(:)
    !> Field over all nodes
    real(wp), intent(inout), contiguous :: field(:)
    integer :: k, i, shift

    !$omp parallel do schedule(static) num_threads(self%space%threads) private(i, shift)
    do k = 1, size(self%first)
      shift = self%place(k) - self%first(k)
      do i = self%first(k), self%last(k)
        field(i) = field(i) + factor*packed(i + shift)
      end do
    end do
    !$omp end parallel do
  end subroutine add_to_field

  !> Add a multiple of values in single precision to the active nodes of a field.
  subroutine add_single(self, factor, packed, field)
    class(active_set_t), intent(in) :: self
    !> The multiple
    real(wp), intent(in) :: factor
    !> Values at the active nodes (n_active)
    real(sp), intent(in), contiguous :: packed(:)
    !> Field over all nodes
    real(wp), intent(inout), contiguous :: field(:)
    integer :: k, i, shift

    !$omp parallel do schedule(static) num_threads(self%space%threads) private(i, shift)
    do k = 1, size(self%first)
      shift = self%place(k) - self%first(k)
      do i = self%first(k), self%last(k)
        field(i) = field(i) + factor*packed(i + shift)
      end do
    end do
    !$omp end parallel do
  end subroutine add_single

  !> Pack the values at the active nodes of a field, and those elsewhere that are not zero, and free it.
  subroutine pack_all(self, field, packed, others, kept)
    class(active_set_t), intent(in) :: self
    !> Field over all nodes
    real(wp), allocatable, intent(inout) :: field(:)
    !> Values at the active nodes (n_active)
    real(wp), allocatable, intent(out) :: packed(:)
    !> Other nodes, and the values there
    type(active_set_t), intent(out) :: others
    real(wp), allocatable, intent(out) :: kept(:)
    logical(lk), allocatable :: left(:)
    integer :: k, i

    allocate (packed(self%n_active), left(size(field)))
    call self%pack(field, packed)
    !$omp parallel do schedule(static) num_threads(self%space%threads)
    do i = 1, size(field)
      left(i) = abs(field(i)) > 0.0_wp
    end do
    !$omp end parallel do
    do k = 1, size(self%first)
      left(self%first(k):self%last(k)) = .false.
    end do
    call new_active_set(others, left, self%space)
    allocate (kept(others%n_active))
    call others%pack(field, kept)
    deallocate (field)
  end subroutine pack_all

  !> Make the field again.
  subroutine unpack_all(self, n, packed, others, kept, field)
    class(active_set_t), intent(in) :: self
    !> Number of all nodes
    integer, intent(in) :: n
    !> Values at the active nodes; freed
    real(wp), allocatable, intent(inout) :: packed(:)
    !> Other nodes, and the values there
    type(active_set_t), intent(in) :: others
    real(wp), intent(in), contiguous :: kept(:)
    !> Field over all nodes
    real(wp), allocatable, intent(out) :: field(:)

    allocate (field(n))
    call self%space%fill(field, 0.0_wp)
    call self%unpack(packed, field)
    call others%unpack(kept, field)
    deallocate (packed)
  end subroutine unpack_all

  !> Return the nodes that are not active.
  pure type(active_set_t) function complement(self, n) result(others)
    class(active_set_t), intent(in) :: self
    !> Number of all nodes
    integer, intent(in) :: n
    logical(lk) :: gap(size(self%first) + 1)

    others%space%threads = self%space%threads
    associate (first => [1, self%last + 1], last => [self%first - 1, n])
      gap = first <= last
      others%first = pack(first, gap)
      others%last = pack(last, gap)
    end associate
    call number_nodes(others)
  end function complement

  !> Return the active nodes among those of a part, counted from its beginning.
  pure type(active_set_t) function slice(self, from, to) result(part)
    class(active_set_t), intent(in) :: self
    !> First and last node of the part
    integer, intent(in) :: from, to
    integer :: k, n_run

    part%space%threads = self%space%threads
    n_run = count(self%first <= to .and. self%last >= from)
    allocate (part%first(n_run), part%last(n_run))
    n_run = 0
    do k = 1, size(self%first)
      if (self%first(k) > to .or. self%last(k) < from) cycle
      n_run = n_run + 1
      part%first(n_run) = max(self%first(k), from) - from + 1
      part%last(n_run) = min(self%last(k), to) - from + 1
    end do
    call number_nodes(part)
  end function slice

  !> Pair the runs of two components; the nodes of the second one are a part of those of the first.
  subroutine pair(self, n)
    class(active_set_t), intent(inout) :: self
    !> Number of nodes of both components
    integer, intent(in) :: n

    call pair_runs(self%slice(1, n/2), self%slice(n/2 + 1, n), self%pairs)
  end subroutine pair

  !> Cut the runs of a set by those of a second one that is a part of it.
  pure subroutine pair_runs(one, second, runs)
    type(active_set_t), intent(in) :: one, second
    type(paired_runs_t), intent(out) :: runs
    integer, dimension(2*(size(one%first) + size(second%first))) :: first, last, place, other
    integer :: i, j, k, n, to, at

    n = 0
    j = 1
    do k = 1, size(one%first)
      i = one%first(k)
      do while (i <= one%last(k))
        do while (j < size(second%first))
          if (second%last(j) >= i) exit
          j = j + 1
        end do
        to = one%last(k)
        at = 0
        if (j <= size(second%first)) then
          if (second%first(j) > i) then
            to = min(to, second%first(j) - 1)
          else if (second%last(j) >= i) then
            to = min(to, second%last(j))
            at = second%place(j) + i - second%first(j)
          end if
        end if
        n = n + 1
        first(n) = i
        last(n) = to
        place(n) = one%place(k) + i - one%first(k)
        other(n) = at
        i = to + 1
      end do
    end do
    allocate (runs%first(n), runs%last(n), runs%place(n), runs%second(n))
    runs%first = first(:n)
    runs%last = last(:n)
    runs%place = place(:n)
    runs%second = other(:n)
    runs%n_first = one%n_active
  end subroutine pair_runs

  !> Count the nodes of the runs, and number them.
  pure subroutine number_nodes(self)
    type(active_set_t), intent(inout) :: self
    integer :: k

    allocate (self%place(size(self%first)))
    self%n_active = 0
    do k = 1, size(self%first)
      self%place(k) = self%n_active + 1
      self%n_active = self%n_active + self%last(k) - self%first(k) + 1
    end do
  end subroutine number_nodes

  !> Return whether the active nodes of this rank are those of a set.
  logical function is_set(self, active)
    class(active_set_t), intent(in) :: self
    !> The set
    logical(lk), intent(in), contiguous :: active(:)
    type(field_space_t) :: own
    integer :: k, within

    own%threads = self%space%threads
    within = 0
    !$omp parallel do schedule(static) num_threads(self%space%threads) reduction(+: within)
    do k = 1, size(self%first)
      within = within + count(active(self%first(k):self%last(k)))
    end do
    !$omp end parallel do
    is_set = within == self%n_active
    if (is_set) is_set = own%count(active) == within
  end function is_set

  !> Set up a number of fields.
  subroutine new_packed_fields(self, nodes, n_field)
    !> Fields to be set up
    type(packed_fields_t), intent(out) :: self
    !> Nodes that they do not vanish at
    type(active_set_t), intent(in) :: nodes
    !> Number of fields
    integer, intent(in) :: n_field

    self%n_field = n_field
    self%nodes = nodes
    allocate (self%values(nodes%n_active, n_field))
  end subroutine new_packed_fields

  !> Keep a field.
  subroutine keep(self, k, field)
    class(packed_fields_t), intent(inout) :: self
    !> Its number
    integer, intent(in) :: k
    !> The field
    real(wp), intent(in), contiguous :: field(:)

    call self%nodes%pack(field, self%values(:, k))
  end subroutine keep

  !> Return a field that was kept.
  subroutine restore(self, k, field)
    class(packed_fields_t), intent(in) :: self
    !> Its number
    integer, intent(in) :: k
    !> The field
    real(wp), intent(out), contiguous :: field(:)

    call self%nodes%space%fill(field, 0.0_wp)
    call self%nodes%unpack(real(self%values(:, k), wp), field)
  end subroutine restore

end module hc_active_set
