!> A contact problem on a hierarchy of lattices, each of every second node of the finer one, and on a part of its window.
!>
!> Ranks share the rows of each window that is large enough; a smaller one is on all of them alike.
!>
!> Theory: docs/theory/multilevel.md.
module hc_hierarchy
  use hc_precision, only: wp, lk
  use hc_communicator, only: rows_held
  use hc_lattice, only: lattice_t, floor_half
  use hc_field_space, only: field_space_t
  use hc_transfer, only: restrict_field
  implicit none
  private

  public :: level_t, level_count, coarse_rows_t

  !> Contact problem on one lattice.
  type, abstract :: level_t
    !> Lattice and window
    type(lattice_t) :: lattice
    !> Initial gap (n_col, own rows) [m]
    real(wp), allocatable :: initial_gap(:, :)
    !> Nodes that may come into contact (n_col, own rows)
    logical(lk), allocatable :: candidate(:, :)
    !> Space of the fields
    type(field_space_t) :: space
  contains
    !> Columns and rows of a field in the memory of this rank, and their product
    procedure :: own_extent, own_rows, own_size
    !> Number of rows before them
    procedure :: rows_before
    !> Lattice of some rows, and a field there
    procedure :: rows_of, take_rows
    !> Field on a part of the window, and back
    procedure :: cut, paste
    !> The same problem on the lattice of every second node
    procedure :: coarsen
    !> Gap of the problem there, set again; values of a field there
    procedure :: coarsen_gap, restrict
    !> Rows that the nodes of the next finer lattice take their values from, and a field there
    procedure :: rows_below, take_below
    !> The same problem on a part of its window
    procedure :: extract_part
    !> Bodies, laws and tuning numbers, from the same problem on another lattice
    procedure(inherit), deferred :: inherit
  end type level_t

  !> Rows of a coarse lattice that the nodes of the finer one between them take their values from, with the neighbors of neighbors.
  type :: coarse_rows_t
    !> Lattices of these rows, and of own rows of the finer lattice
    type(lattice_t) :: rows, fine
    !> First and last of them; the coarse lattice is all there, since one rank has both
    integer, private :: needed(2) = 0
    logical, private :: whole = .true.
  end type coarse_rows_t

  abstract interface
    !> Take bodies, laws and tuning numbers from the same problem on another lattice; lattice, gap and candidates are set.
    subroutine inherit(self, from)
      import :: level_t
      implicit none
      class(level_t), intent(inout) :: self
      !> The problem of the same type on a finer lattice or a larger window
      class(level_t), intent(in) :: from
    end subroutine inherit
  end interface

contains

  !> Count the lattices, the given one included, as long as no window gets too small.
  pure integer function level_count(lattice, smallest_side)
    !> The finest lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Nodes that a side should have at least
    integer, intent(in) :: smallest_side
    integer :: side, extent(2)

    level_count = 1
    extent = lattice%extent
    side = minval(extent)
    do while (side >= 2*smallest_side)
      ! every second node of a window that repeats is one that repeats
      if (lattice%is_periodic() .and. any(modulo(extent, [8, 2]) /= 0)) exit
      extent = extent/2
      side = side/2
      level_count = level_count + 1
    end do
  end function level_count

  !> Set up the same problem on the lattice of every second node.
  subroutine coarsen(self, coarse)
    class(level_t), intent(in) :: self
    !> The problem there
    class(level_t), intent(inout) :: coarse

    logical(lk), allocatable :: rows(:, :)
    integer :: first(2), n

    coarse%lattice = self%lattice%coarsened()
    coarse%space = self%space
    coarse%space%ranks = self%space%ranks%over(coarse%lattice%extent)
    call self%coarsen_gap(coarse)
    call find_fine_rows(self, coarse, first, n)
    if (self%space%ranks%size == 1) then
      coarse%candidate = self%candidate(first(1)::2, first(2)::2)
    else
      allocate (rows(self%lattice%extent(1), n))
      call self%space%fetch(self%lattice%extent(2), self%candidate, first(2), rows)
      coarse%candidate = rows(first(1)::2, ::2)
    end if
    call coarse%inherit(self)
  end subroutine coarsen

  !> Set the gap of the problem on the lattice of every second node again.
  subroutine coarsen_gap(self, coarse)
    class(level_t), intent(in) :: self
    !> The problem there
    class(level_t), intent(inout) :: coarse
    real(wp), allocatable :: gap(:, :)

    call self%restrict(self%initial_gap, coarse, gap)
    call move_alloc(gap, coarse%initial_gap)
  end subroutine coarsen_gap

  !> Take the values of a field at the nodes of the coarser lattice.
  subroutine restrict(self, field, coarse, values)
    class(level_t), intent(in) :: self
    !> Field (n_col, own rows)
    real(wp), intent(in), contiguous :: field(:, :)
    !> The problem there
    class(level_t), intent(in) :: coarse
    !> Field there (columns and own rows of the coarse lattice)
    real(wp), allocatable, intent(out) :: values(:, :)
    real(wp), allocatable :: rows(:, :)
    integer :: first(2), n

    if (self%space%ranks%size == 1) then
      values = restrict_field(self%lattice, field, coarse%lattice)
    else
      call find_fine_rows(self, coarse, first, n)
      allocate (rows(self%lattice%extent(1), n))
      call self%space%fetch(self%lattice%extent(2), field, first(2), rows)
      values = rows(first(1)::2, ::2)
    end if
  end subroutine restrict

  !> Return the rows that those of this rank of the next finer lattice take their values from.
  type(coarse_rows_t) function rows_below(self, fine) result(below)
    class(level_t), intent(in) :: self
    !> The problem on the finer lattice
    class(level_t), intent(in) :: fine
    integer, parameter :: neighbors_of_neighbors = 2
    integer :: own(2)

    below%rows = self%lattice
    below%fine = fine%lattice
    below%whole = fine%space%ranks%size == 1
    if (below%whole) return
    own = fine%space%own_rows(fine%lattice%extent(2))
    below%fine = fine%rows_of(own(1), own(2))
    own = fine%lattice%first(2) + own - 1
    associate (needed => below%needed)
      needed = [floor_half(own(1)), floor_half(own(2) + 1)] - self%lattice%first(2) + 1
      needed = needed + [-neighbors_of_neighbors, neighbors_of_neighbors]
      if (.not. self%lattice%periodic(2)) needed = min(max(needed, 1), self%lattice%extent(2))
      below%rows = self%rows_of(needed(1), needed(2))
    end associate
  end function rows_below

  !> Point to these rows of a field: to the field itself where one rank has both lattices.
  subroutine take_below(self, below, field, own, rows)
    class(level_t), intent(in) :: self
    !> The rows
    type(coarse_rows_t), intent(in) :: below
    !> Field (n_col, own rows)
    real(wp), intent(in), contiguous, target :: field(:, :)
    !> Memory of the caller, allocated if it is needed
    real(wp), allocatable, target, intent(inout) :: own(:, :)
    !> Those rows
    real(wp), pointer, contiguous, intent(out) :: rows(:, :)

    rows => field
    if (below%whole) return
    if (.not. allocated(own)) allocate (own(size(field, 1), below%needed(2) - below%needed(1) + 1))
    call self%take_rows(field, below%needed(1), own)
    rows => own
  end subroutine take_below

  !> Find the first column and row of the fine nodes that the own rows of the coarse lattice consist of, and their rows.
  subroutine find_fine_rows(fine, coarse, first, n)
    class(level_t), intent(in) :: fine, coarse
    integer, intent(out) :: first(2), n

    first = 2*coarse%lattice%first - fine%lattice%first + 1
    associate (rows => coarse%space%own_rows(coarse%lattice%extent(2)))
      first(2) = first(2) + 2*(rows(1) - 1)
      n = 2*(rows(2) - rows(1)) + 1
    end associate
  end subroutine find_fine_rows

  !> Return the columns and rows of a field in the memory of this rank.
  pure function own_extent(self)
    class(level_t), intent(in) :: self
    integer :: own_extent(2)

    own_extent = self%space%own_extent(self%lattice%extent)
  end function own_extent

  !> Return the number of rows in the memory of this rank.
  pure integer function own_rows(self)
    class(level_t), intent(in) :: self

    own_rows = rows_held(self%space%ranks, self%lattice%extent(2))
  end function own_rows

  !> Return the number of rows of the window before those of this rank.
  pure integer function rows_before(self)
    class(level_t), intent(in) :: self

    rows_before = self%space%ranks%first_row(self%lattice%extent(2)) - 1
  end function rows_before

  !> Return the number of nodes in the memory of this rank.
  pure integer function own_size(self)
    class(level_t), intent(in) :: self

    own_size = self%lattice%extent(1)*self%own_rows()
  end function own_size

  !> Return the lattice of some rows of the window.
  pure type(lattice_t) function rows_of(self, first, last) result(rows)
    class(level_t), intent(in) :: self
    !> First and last row
    integer, intent(in) :: first, last

    rows = self%lattice%subwindow([1, first], [self%lattice%extent(1), last])
    rows%periodic(1) = self%lattice%periodic(1)
  end function rows_of

  !> Take some rows of a field: beyond the first and the last one, by less than a window, those of the other side.
  subroutine take_rows(self, field, first, rows)
    class(level_t), intent(in) :: self
    !> Field (n_col, own rows)
    real(wp), intent(in), contiguous :: field(:, :)
    !> First of the rows, and their values (n_col, number of rows)
    integer, intent(in) :: first
    real(wp), intent(out), contiguous :: rows(:, :)
    integer :: before, within

    associate (n => self%lattice%extent(2))
      if (.not. self%lattice%periodic(2)) then
        call self%space%fetch(n, field, first, rows)
        return
      end if
      ! every rank takes part in all of them
      before = min(max(1 - first, 0), size(rows, 2))
      within = max(min(n - first + 1, size(rows, 2)), before)
      call self%space%fetch(n, field, n + first, rows(:, :before))
      call self%space%fetch(n, field, max(first, 1), rows(:, before + 1:within))
      call self%space%fetch(n, field, max(first - n, 1), rows(:, within + 1:))
    end associate
  end subroutine take_rows

  !> Take a field on a part of the window.
  subroutine cut(self, field, low, part, values)
    class(level_t), intent(in) :: self
    !> Field (n_col, own rows)
    real(wp), intent(in), contiguous :: field(:, :)
    !> First column and row of the part
    integer, intent(in) :: low(2)
    !> The problem there
    class(level_t), intent(in) :: part
    !> Field there (columns and own rows of the part)
    real(wp), allocatable, intent(inout) :: values(:, :)
    real(wp), allocatable :: rows(:, :)
    integer :: first

    first = low(2) + part%space%ranks%first_row(part%lattice%extent(2)) - 1
    associate (last => low(1) + part%lattice%extent(1) - 1, n => part%own_rows())
      if (self%space%ranks%size == 1) then
        values = field(low(1):last, first:first + n - 1)
      else
        allocate (rows(size(field, 1), n))
        call self%space%fetch(self%lattice%extent(2), field, first, rows)
        values = rows(low(1):last, :)
      end if
    end associate
  end subroutine cut

  !> Set a field on a part of the window.
  subroutine paste(self, part, low, values, field)
    class(level_t), intent(in) :: self
    !> The problem on the part, and first column and row of it
    class(level_t), intent(in) :: part
    integer, intent(in) :: low(2)
    !> Field there (columns and own rows of the part)
    real(wp), intent(in), contiguous :: values(:, :)
    !> Field (n_col, own rows)
    real(wp), intent(inout), contiguous :: field(:, :)
    real(wp), allocatable :: rows(:, :)
    integer :: own(2), both(2)

    own = self%space%own_rows(self%lattice%extent(2))
    both = [max(own(1), low(2)), min(own(2), low(2) + part%lattice%extent(2) - 1)]
    allocate (rows(part%lattice%extent(1), max(both(2) - both(1) + 1, 0)))
    call part%space%fetch(part%lattice%extent(2), values, both(1) - low(2) + 1, rows)
    field(low(1):low(1) + size(rows, 1) - 1, both(1) - own(1) + 1:both(2) - own(1) + 1) = rows
  end subroutine paste

  !> Set up the same problem on the part of its window between some columns and rows.
  subroutine extract_part(self, low, high, part)
    class(level_t), intent(in) :: self
    !> First and last column and row
    integer, intent(in) :: low(2), high(2)
    !> The problem there
    class(level_t), intent(inout) :: part

    logical(lk), allocatable :: rows(:, :)

    part%lattice = self%lattice%subwindow(low, high)
    part%space = self%space
    part%space%ranks = self%space%ranks%over(part%lattice%extent)
    call self%cut(self%initial_gap, low, part, part%initial_gap)
    if (self%space%ranks%size == 1) then
      part%candidate = self%candidate(low(1):high(1), low(2):high(2))
    else
      allocate (rows(size(self%candidate, 1), part%own_rows()))
      call self%space%fetch(self%lattice%extent(2), self%candidate, &
                            low(2) + part%space%ranks%first_row(part%lattice%extent(2)) - 1, rows)
      part%candidate = rows(low(1):high(1), :)
    end if
    call part%inherit(self)
  end subroutine extract_part

end module hc_hierarchy
