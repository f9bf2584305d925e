!> The active nodes of a field, one after the other without gaps.
!>
!> A contact fills less than half of its window: vectors of the unknowns alone save
!> as much of the work on them. Active nodes come in runs along the rows of the window, so
!> that packing is a copy of a few hundred pieces.
module hc_active_set
  use hc_precision, only: wp
  use hc_field_space, only: field_space_t
  implicit none
  private

  public :: active_set_t, new_active_set

  !> Nodes that one thread looks through at a time.
  integer, parameter :: block_size = 8192

  !> Runs of active nodes.
  type :: active_set_t
    !> Number of active nodes
    integer :: n_active = 0
    type(field_space_t), private :: space
    !> First and last node of each run
    integer, allocatable :: first(:), last(:)
    !> Where it begins among the active nodes
    integer, allocatable, private :: place(:)
  contains
    !> The active nodes of a field
    procedure :: pack => pack_field
    !> The same of several fields
    procedure :: pack_columns
    !> Put them where they belong, the rest of the field stays as it is
    procedure :: unpack => unpack_field
  end type active_set_t

contains

  !> Find the runs of active nodes; they end at the ends of blocks, too.
  subroutine new_active_set(self, active, space)
    !> Set to be set up
    type(active_set_t), intent(out) :: self
    !> Active nodes
    logical, intent(in), contiguous :: active(:)
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Where the runs of each block begin in the list, less one
    integer :: before((size(active) + block_size - 1)/block_size + 1)
    integer :: k, n_block

    n_block = size(before) - 1
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
      allocate (self%first(n_run), self%last(n_run), self%place(n_run))
    end associate
    !$omp parallel do schedule(static) num_threads(space%threads)
    do k = 1, n_block
      if (before(k + 1) == before(k)) cycle
      call list_runs(active(start(k):min(start(k + 1) - 1, size(active))), start(k) - 1, &
                     self%first(before(k) + 1:before(k + 1)), self%last(before(k) + 1:before(k + 1)))
    end do
    !$omp end parallel do
    do k = 1, size(self%first)
      self%place(k) = self%n_active + 1
      self%n_active = self%n_active + self%last(k) - self%first(k) + 1
    end do
    self%space = space

  contains

    !> Return the first node of a block.
    pure integer function start(block)
      integer, intent(in) :: block
      start = (block - 1)*block_size + 1
    end function start

  end subroutine new_active_set

  !> Count the runs of active nodes.
  pure integer function count_runs(active)
    logical, intent(in), contiguous :: active(:)
    count_runs = merge(1, 0, active(1)) + count(active(2:) .and. .not. active(:size(active) - 1))
  end function count_runs

  !> List the runs of active nodes.
  pure subroutine list_runs(active, shift, first, last)
    logical, intent(in), contiguous :: active(:)
    !> What the nodes are shifted by
    integer, intent(in) :: shift
    !> First and last node of each run
    integer, intent(inout), contiguous :: first(:), last(:)
    integer :: i, k
    logical :: before

    k = 0
    before = .false.
    do i = 1, size(active)
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

  !> Gather the active nodes of several vectors.
  subroutine pack_columns(self, columns, packed)
    class(active_set_t), intent(in) :: self
    !> Vectors over all nodes (n, number of vectors)
    real(wp), intent(in), contiguous :: columns(:, :)
    !> Vectors on the active nodes (n_active, number of vectors)
    real(wp), allocatable, intent(out) :: packed(:, :)
    integer :: m

    allocate (packed(self%n_active, size(columns, 2)))
    do m = 1, size(columns, 2)
      call self%pack(columns(:, m), packed(:, m))
    end do
  end subroutine pack_columns

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

end module hc_active_set
