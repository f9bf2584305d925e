!> Processes (ranks) that solve one problem together: sums, rows of fields, transposes.
!>
!> Fields over a window are shared out by rows: each rank holds a slab of consecutive rows. A slab begins with an odd row and, but
!> for the last one, ends with an even row, because the transforms take two rows at a time. Transformed rows are shared out
!> by blocks of columns.
!>
!> A sum over rows is taken on the first rank in the order of the rows. It is the same to the bit for any number of ranks.
!>
!> The procedures are in a submodule: communicator_mpi.f90, or communicator_alone.f90 for the one rank of a build without MPI.
module hc_communicator
  use, intrinsic :: iso_c_binding, only: c_ptr
  use, intrinsic :: iso_fortran_env, only: int32
  use hc_precision, only: wp
  use hc_error, only: error_t
  implicit none
  private

  public :: communicator_t, rows_held, block_layout_t, start_ranks, end_ranks, abort_ranks

  !> Ranks that work together; by default one alone.
  type :: communicator_t
    !> Number of this rank, from 0 on, number of ranks, and of those on this machine
    integer :: rank = 0, size = 1, on_node = 1
    !> Communicator of MPI
    integer :: handle = 0
    !> Nodes from which on a window is shared out: below, an exchange takes longer than the work
    integer :: least_nodes = 65536
  contains
    !> Ranks that share a window: all, or each alone
    procedure, non_overridable :: over
    !> Rows of a rank
    procedure, non_overridable :: first_row, last_row
    !> Items of a rank of those that are shared out one by one
    procedure, non_overridable :: first_item, last_item
    !> Sum of a part by row; largest values, sums of counts
    procedure, non_overridable :: total, most, add_counts
    !> Error of any rank on all of them
    procedure, non_overridable :: agree
    !> Rows of a field that lie on other ranks
    procedure, non_overridable :: fetch
    !> Columns of transformed rows, and back
    procedure, non_overridable :: to_columns, to_rows
    !> Words of another rank
    procedure, non_overridable :: send_words, wait_for_words, receive_words
  end type communicator_t

  !> Transformed rows, and the columns that each rank works on; in words of four bytes.
  type :: block_layout_t
    !> Number of rows and of components
    integer :: n_row = 0, n_component = 0
    !> Number of column blocks, and words in a row of one of them
    integer :: n_block = 0, words = 0
    !> Rows of a component in memory: of own rows, and of all rows
    integer :: own_rows = 0, all_rows = 0
  end type block_layout_t

  interface
    !> Start MPI, unless it runs, and return the ranks that the launcher started.
    module subroutine start_ranks(ranks)
      type(communicator_t), intent(out) :: ranks
    end subroutine start_ranks

    !> End MPI, if `start_ranks` started it.
    module subroutine end_ranks(ranks)
      type(communicator_t), intent(inout) :: ranks
    end subroutine end_ranks

    !> End all ranks at once with an exit code; return without MPI.
    module subroutine abort_ranks(ranks, code)
      type(communicator_t), intent(in) :: ranks
      integer, intent(in) :: code
    end subroutine abort_ranks

    !> Sum the values of all ranks in their order.
    module function total(self, part)
      class(communicator_t), intent(in) :: self
      !> Values of this rank
      real(wp), intent(in), contiguous :: part(:)
      real(wp) :: total
    end function total

    !> Replace values by the largest of all ranks.
    module subroutine most(self, value)
      class(communicator_t), intent(in) :: self
      real(wp), intent(inout), contiguous :: value(:)
    end subroutine most

    !> Replace counts by their sums over all ranks.
    module subroutine add_counts(self, value)
      class(communicator_t), intent(in) :: self
      integer, intent(inout), contiguous :: value(:)
    end subroutine add_counts

    !> Take the error of the first rank that has one, on all ranks; the message names the rank, unless all failed.
    module subroutine agree(self, error)
      class(communicator_t), intent(in) :: self
      type(error_t), allocatable, intent(inout) :: error
    end subroutine agree

    !> Take rows of a field from their ranks; every rank takes part, each with rows of its own choice.
    module subroutine fetch(self, words, n_row, own, bounds, values)
      class(communicator_t), intent(in) :: self
      !> Words in a row, and number of rows of the field
      integer, intent(in) :: words, n_row
      !> Rows of this rank
      type(c_ptr), intent(in) :: own
      !> First and last row for this rank; none if the last is less
      integer, intent(in) :: bounds(2)
      !> Those rows
      type(c_ptr), intent(in) :: values
    end subroutine fetch

    !> Exchange own rows of all columns for all rows of own columns.
    module subroutine to_columns(self, layout, rows, columns)
      class(communicator_t), intent(in) :: self
      type(block_layout_t), intent(in) :: layout
      !> Own rows and own columns
      type(c_ptr), intent(in) :: rows, columns
    end subroutine to_columns

    !> Exchange all rows of own columns for own rows of all columns.
    module subroutine to_rows(self, layout, columns, rows)
      class(communicator_t), intent(in) :: self
      type(block_layout_t), intent(in) :: layout
      type(c_ptr), intent(in) :: columns, rows
    end subroutine to_rows

    !> Send words to another rank, which receives them.
    module subroutine send_words(self, values, rank)
      class(communicator_t), intent(in) :: self
      integer(int32), intent(in), contiguous :: values(:)
      !> The other rank
      integer, intent(in) :: rank
    end subroutine send_words

    !> Wait, without use of the processor, until the first rank sends words; return their number.
    module subroutine wait_for_words(self, n)
      class(communicator_t), intent(in) :: self
      integer, intent(out) :: n
    end subroutine wait_for_words

    !> Receive words that another rank sends.
    module subroutine receive_words(self, values, rank)
      class(communicator_t), intent(in) :: self
      integer(int32), intent(out), contiguous :: values(:)
      integer, intent(in) :: rank
    end subroutine receive_words
  end interface

contains

  !> Return the number of rows of this rank.
  pure integer function rows_held(ranks, n_row)
    type(communicator_t), intent(in) :: ranks
    !> Number of rows
    integer, intent(in) :: n_row

    rows_held = ranks%last_row(n_row) - ranks%first_row(n_row) + 1
  end function rows_held

  !> Return the first row of a rank, from 1 on.
  elemental integer function first_row(self, n_row, rank)
    class(communicator_t), intent(in) :: self
    !> Number of rows
    integer, intent(in) :: n_row
    !> Rank; absent: this one
    integer, intent(in), optional :: rank

    first_row = 2*self%first_item((n_row + 1)/2, rank) - 1
  end function first_row

  !> Return the last row of a rank.
  elemental integer function last_row(self, n_row, rank)
    class(communicator_t), intent(in) :: self
    !> Number of rows
    integer, intent(in) :: n_row
    !> Rank; absent: this one
    integer, intent(in), optional :: rank

    last_row = min(2*self%last_item((n_row + 1)/2, rank), n_row)
  end function last_row

  !> Return the first of the items of a rank, from 1 on.
  elemental integer function first_item(self, n, rank)
    class(communicator_t), intent(in) :: self
    !> Number of items
    integer, intent(in) :: n
    !> Rank; absent: this one
    integer, intent(in), optional :: rank
    integer, parameter :: long = selected_int_kind(18)
    integer :: own

    own = self%rank
    if (present(rank)) own = rank
    first_item = int(int(own, long)*n/self%size) + 1
  end function first_item

  !> Return the last of the items of a rank.
  elemental integer function last_item(self, n, rank)
    class(communicator_t), intent(in) :: self
    !> Number of items
    integer, intent(in) :: n
    !> Rank; absent: this one
    integer, intent(in), optional :: rank
    integer :: own

    own = self%rank
    if (present(rank)) own = rank
    last_item = self%first_item(n, own + 1) - 1
  end function last_item

  !> Return the ranks that share a window: all if it is large enough and each has two rows; else each holds all of it.
  pure type(communicator_t) function over(self, extent)
    class(communicator_t), intent(in) :: self
    !> Columns and rows of the window
    integer, intent(in) :: extent(2)

    over%least_nodes = self%least_nodes
    if (product(extent) < self%least_nodes .or. self%size > extent(2)/2) return
    over = communicator_t(self%rank, self%size, self%on_node, self%handle, self%least_nodes)
  end function over

end module hc_communicator
