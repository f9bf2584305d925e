!> Ranks of MPI.
submodule (hc_communicator) hc_communicator_mpi
  use, intrinsic :: iso_c_binding, only: c_int, c_f_pointer
  use mpi_f08, only: MPI_Abort, MPI_Allgather, MPI_Allreduce, MPI_Alltoallv, MPI_Alltoallw, MPI_Bcast, MPI_CHARACTER, MPI_Comm, &
    MPI_Comm_free, MPI_Comm_rank, MPI_Comm_size, MPI_Comm_split_type, MPI_COMM_TYPE_SHARED, MPI_COMM_WORLD, &
    MPI_Datatype, MPI_DOUBLE_PRECISION, MPI_Finalize, MPI_Finalized, MPI_Gather, MPI_Gatherv, MPI_Get_count, MPI_IN_PLACE, &
    MPI_INFO_NULL, MPI_Init_thread, MPI_Initialized, MPI_INTEGER, MPI_INTEGER4, MPI_Iprobe, MPI_MAX, MPI_MIN, &
    MPI_ORDER_FORTRAN, MPI_Recv, MPI_Send, MPI_Status, MPI_STATUS_IGNORE, MPI_SUM, MPI_THREAD_SERIALIZED, MPI_Type_commit, &
    MPI_Type_contiguous, MPI_Type_create_subarray, MPI_Type_free
  implicit none

  !> Tag of words.
  integer, parameter :: tag = 1

  interface
    !> Sleep (POSIX)
    integer(c_int) function usleep(microseconds) bind(c)
      import :: c_int
      implicit none
      integer(c_int), value :: microseconds
    end function usleep
  end interface

contains

  !> Return the communicator of MPI.
  pure type(MPI_Comm) function world(self)
    class(communicator_t), intent(in) :: self

    world%MPI_VAL = self%handle
  end function world

  !> Start MPI: one thread at a time calls it.
  module procedure start_ranks
    type(MPI_Comm) :: node
    logical :: runs
    integer :: given

    call MPI_Initialized(runs)
    if (.not. runs) call MPI_Init_thread(MPI_THREAD_SERIALIZED, given)
    call MPI_Comm_size(MPI_COMM_WORLD, ranks%size)
    call MPI_Comm_rank(MPI_COMM_WORLD, ranks%rank)
    ranks%handle = MPI_COMM_WORLD%MPI_VAL
    call MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, node)
    call MPI_Comm_size(node, ranks%on_node)
    call MPI_Comm_free(node)
  end procedure start_ranks

  !> End MPI.
  module procedure end_ranks
    logical :: over

    call MPI_Finalized(over)
    if (.not. over) call MPI_Finalize()
    ranks = communicator_t()
  end procedure end_ranks

  !> End all ranks.
  module procedure abort_ranks
    call MPI_Abort(world(ranks), code)
  end procedure abort_ranks

  !> Sum on the first rank, in the order of the ranks.
  module procedure total
    integer :: counts(self%size), places(self%size), r
    real(wp), allocatable :: all(:)

    if (self%size == 1) then
      total = sum(part)
      return
    end if
    call MPI_Gather(size(part), 1, MPI_INTEGER, counts, 1, MPI_INTEGER, 0, world(self))
    if (self%rank /= 0) counts = 0
    places(1) = 0
    do r = 2, self%size
      places(r) = places(r - 1) + counts(r - 1)
    end do
    allocate (all(sum(counts)))
    call MPI_Gatherv(part, size(part), MPI_DOUBLE_PRECISION, all, counts, places, MPI_DOUBLE_PRECISION, 0, world(self))
    total = sum(all)
    call MPI_Bcast(total, 1, MPI_DOUBLE_PRECISION, 0, world(self))
  end procedure total

  !> Take the largest values.
  module procedure most
    if (self%size > 1) call MPI_Allreduce(MPI_IN_PLACE, value, size(value), MPI_DOUBLE_PRECISION, MPI_MAX, world(self))
  end procedure most

  !> Add counts.
  module procedure add_counts
    if (self%size > 1) call MPI_Allreduce(MPI_IN_PLACE, value, size(value), MPI_INTEGER, MPI_SUM, world(self))
  end procedure add_counts

  !> Take the error of the first rank that has one.
  module procedure agree
    integer, parameter :: longest = 480
    character(len=longest) :: message
    character(len=12) :: number
    integer :: least(2), failed, code

    if (self%size == 1) return
    least = [self%size, 0] ! first rank that failed; whether all did
    if (allocated(error)) least = [self%rank, 1]
    call MPI_Allreduce(MPI_IN_PLACE, least, 2, MPI_INTEGER, MPI_MIN, world(self))
    failed = least(1)
    if (failed == self%size) return
    code = 0
    message = ''
    if (failed == self%rank) then
      code = error%code
      message = error%message
    end if
    call MPI_Bcast(code, 1, MPI_INTEGER, failed, world(self))
    call MPI_Bcast(message, longest, MPI_CHARACTER, failed, world(self))
    write (number, '(i0)') failed
    if (allocated(error)) deallocate (error)
    allocate (error)
    error%code = code
    error%message = trim(message)
    if (least(2) == 0) error%message = 'rank '//trim(number)//': '//error%message
  end procedure agree

  !> Send each rank the own rows that it takes.
  module procedure fetch
    integer :: all(2, 0:self%size - 1), first(0:self%size - 1), last(0:self%size - 1), r
    integer, dimension(0:self%size - 1) :: sent, from, received, onto
    integer(int32), pointer, contiguous :: source(:), target(:)
    type(MPI_Datatype) :: row

    call MPI_Allgather(bounds, 2, MPI_INTEGER, all, 2, MPI_INTEGER, world(self))
    first = self%first_row(n_row, [(r, r=0, self%size - 1)])
    last = self%last_row(n_row, [(r, r=0, self%size - 1)])
    do r = 0, self%size - 1
      associate (low => max(first(self%rank), all(1, r)), high => min(last(self%rank), all(2, r)))
        sent(r) = max(high - low + 1, 0)
        from(r) = merge(low - first(self%rank), 0, sent(r) > 0)
      end associate
      associate (low => max(first(r), bounds(1)), high => min(last(r), bounds(2)))
        received(r) = max(high - low + 1, 0)
        onto(r) = merge(low - bounds(1), 0, received(r) > 0)
      end associate
    end do
    call c_f_pointer(own, source, [1])
    call c_f_pointer(values, target, [1])
    call MPI_Type_contiguous(words, MPI_INTEGER4, row)
    call MPI_Type_commit(row)
    call MPI_Alltoallv(source, sent, from, row, target, received, onto, row, world(self))
    call MPI_Type_free(row)
  end procedure fetch

  !> Make the types of the blocks between each rank and another one: columns of own rows, and own columns of its rows.
  subroutine make_types(self, layout, of_rows, of_columns)
    class(communicator_t), intent(in) :: self
    type(block_layout_t), intent(in) :: layout
    type(MPI_Datatype), intent(out) :: of_rows(0:), of_columns(0:)
    integer :: own_rows, own_words, rows, words, r

    own_rows = self%last_row(layout%n_row) - self%first_row(layout%n_row) + 1
    own_words = layout%words*(self%last_item(layout%n_block) - self%first_item(layout%n_block) + 1)
    do r = 0, self%size - 1
      rows = self%last_row(layout%n_row, r) - self%first_row(layout%n_row, r) + 1
      words = layout%words*(self%last_item(layout%n_block, r) - self%first_item(layout%n_block, r) + 1)
      call make_type([layout%words*layout%n_block, layout%own_rows, layout%n_component], [words, own_rows, layout%n_component], &
                     [layout%words*(self%first_item(layout%n_block, r) - 1), 0, 0], of_rows(r))
      call make_type([own_words, layout%all_rows, layout%n_component], [own_words, rows, layout%n_component], &
                     [0, self%first_row(layout%n_row, r) - 1, 0], of_columns(r))
    end do
  end subroutine make_types

  !> Make the type of a part of an array; MPI has none for parts without elements.
  subroutine make_type(whole, part, start, type)
    integer, intent(in) :: whole(3), part(3), start(3)
    type(MPI_Datatype), intent(out) :: type

    if (product(int(part, selected_int_kind(18))) == 0) then
      call MPI_Type_contiguous(0, MPI_INTEGER4, type)
    else
      call MPI_Type_create_subarray(3, whole, part, start, MPI_ORDER_FORTRAN, MPI_INTEGER4, type)
    end if
    call MPI_Type_commit(type)
  end subroutine make_type

  !> Transpose.
  module procedure to_columns
    type(MPI_Datatype), dimension(0:self%size - 1) :: of_rows, of_columns

    call make_types(self, layout, of_rows, of_columns)
    call exchange(self, rows, of_rows, columns, of_columns)
  end procedure to_columns

  !> Transpose back.
  module procedure to_rows
    type(MPI_Datatype), dimension(0:self%size - 1) :: of_rows, of_columns

    call make_types(self, layout, of_rows, of_columns)
    call exchange(self, columns, of_columns, rows, of_rows)
  end procedure to_rows

  !> Exchange parts of two arrays, and free their types.
  subroutine exchange(self, from, sent, onto, received)
    class(communicator_t), intent(in) :: self
    type(c_ptr), intent(in) :: from, onto
    type(MPI_Datatype), intent(inout) :: sent(0:), received(0:)
    integer, dimension(0:self%size - 1) :: one, zero
    integer(int32), pointer, contiguous :: source(:), target(:)
    integer :: r

    one = 1
    zero = 0
    call c_f_pointer(from, source, [1])
    call c_f_pointer(onto, target, [1])
    call MPI_Alltoallw(source, one, zero, sent, target, one, zero, received, world(self))
    do r = 0, self%size - 1
      call MPI_Type_free(sent(r))
      call MPI_Type_free(received(r))
    end do
  end subroutine exchange

  !> Send words.
  module procedure send_words
    call MPI_Send(values, size(values), MPI_INTEGER4, rank, tag, world(self))
  end procedure send_words

  !> Look for the words every millisecond: MPI itself waits with the processor busy.
  module procedure wait_for_words
    integer(c_int), parameter :: millisecond = 1000
    type(MPI_Status) :: about
    logical :: there
    integer(c_int) :: ignored

    do
      call MPI_Iprobe(0, tag, world(self), there, about)
      if (there) exit
      ignored = usleep(millisecond)
    end do
    call MPI_Get_count(about, MPI_INTEGER4, n)
  end procedure wait_for_words

  !> Receive words.
  module procedure receive_words
    call MPI_Recv(values, size(values), MPI_INTEGER4, rank, tag, world(self), MPI_STATUS_IGNORE)
  end procedure receive_words

end submodule hc_communicator_mpi
