!> Space of the fields over a window: ranks and threads that share the work, and operations on the values of many nodes.
!>
!> Fields are plain arrays: windows (n_col, n_row), or vectors of nodes. A rank holds its own rows of the window only. Sums are
!> taken in fixed blocks or row by row, so that they do not depend on the number of threads; sums row by row, and largest values,
!> do not depend on the number of ranks, either.
module hc_field_space
  use, intrinsic :: iso_c_binding, only: c_loc
  use hc_precision, only: wp, sp, lk
  use hc_error, only: error_t
  use hc_communicator, only: communicator_t
  use hc_scratch, only: scratch_t
  !$ use omp_lib, only: omp_get_max_threads
  implicit none
  private

  public :: field_space_t, space_over, sum_block, most_threads, ddot

  !> Terms that one thread adds up.
  integer, parameter :: sum_block = 4096
  !> Largest number of threads: more than any machine has, fewer than the system refuses to start.
  integer, parameter :: most_threads = 1024
  !> Nodes below which a field has one thread: the start of the others takes longer than they save.
  integer, parameter :: worth_sharing = 16384

  !> Threads of the fields, and their operations.
  type :: field_space_t
    !> Number of threads
    integer :: threads = 1
    !> Ranks that share the rows of the window; by default this one holds all
    type(communicator_t) :: ranks = communicator_t()
    !> Ranks that share the transforms of fields of which each holds all rows, and their spectra; by default this one has them all
    type(communicator_t) :: helpers = communicator_t()
    !> Memory that the transforms of a solver share; not there: each has its own
    type(scratch_t), pointer :: scratch => null()
    !> Where each pair of own rows ends in vectors of some nodes (from 0 on, component); not there: they are summed in blocks
    integer, allocatable :: ends(:, :)
  contains
    !> Assign and combine vectors
    procedure :: fill, copy, add, add_columns
    !> Scalar product of two vectors, and of several with one
    generic :: dot => dot_double, dot_single
    procedure :: dots
    !> Sum and largest element of a vector or of a field over the window; of nothing, zero and the least number there is
    generic :: sum => vector_sum, window_sum, window_sum_on, window_sum_single
    generic :: max => vector_max, vector_max_on, window_max, window_max_on
    !> Smallest element on a set of nodes; of none, the largest number there is
    generic :: min => vector_min, window_min
    !> Largest absolute value of a vector
    procedure :: max_abs
    !> Number of nodes of a set, and of nodes with a value above zero
    generic :: count => count_nodes, count_window
    procedure :: count_positive
    !> Sum of values by row; largest values, in place
    procedure :: total, most, largest, number
    !> Error of any rank on all of them
    procedure :: agree
    !> First and last row of this rank, and the size of its part of a field
    procedure :: own_rows, own_extent
    !> Rows of a field over the window, wherever they lie
    generic :: fetch => fetch_window, fetch_single, fetch_mask
    procedure, private :: fetch_window, fetch_single, fetch_mask
    !> Terms of a sum over a vector: the pairs of rows or blocks that are added up, the components of each, and their elements
    procedure :: n_term, n_component, term
    !> Threads for a field of some nodes, one for a small field
    procedure :: threads_for
    procedure, private :: vector_sum, window_sum, window_sum_on, window_sum_single, vector_max, vector_max_on, window_max, &
                          window_max_on, vector_min, window_min, count_nodes, count_window, dot_double, dot_single
  end type field_space_t

  interface
    !> Compute a scalar product (BLAS)
    pure real(wp) function ddot(n, dx, incx, dy, incy)
      import :: wp
      implicit none
      integer, intent(in) :: n, incx, incy
      real(wp), intent(in) :: dx(1 + (n - 1)*abs(incx)), dy(1 + (n - 1)*abs(incy))
    end function ddot
  end interface

contains

  !> Return the space of a window.
  type(field_space_t) function space_over(extent, n_threads) result(space)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Threads to use; absent or 0: the default of OpenMP, one for a small window
    integer, intent(in), optional :: n_threads

    space%threads = 1
    !$ if (product(extent) >= worth_sharing) space%threads = min(omp_get_max_threads(), most_threads)
    if (present(n_threads)) then
      !$ if (n_threads > 0) space%threads = n_threads
    end if
  end function space_over

  !> Return the threads for a field of some nodes.
  pure integer function threads_for(self, n)
    class(field_space_t), intent(in) :: self
    !> Number of nodes
    integer, intent(in) :: n

    threads_for = merge(self%threads, 1, n >= worth_sharing)
  end function threads_for

  !> Sum values by row over all ranks.
  real(wp) function total(self, part)
    class(field_space_t), intent(in) :: self
    !> Values of the own rows
    real(wp), intent(in), contiguous :: part(:)

    total = self%ranks%total(part)
  end function total

  !> Replace values by the largest of all ranks.
  subroutine most(self, value)
    class(field_space_t), intent(in) :: self
    real(wp), intent(inout), contiguous :: value(:)

    call self%ranks%most(value)
  end subroutine most

  !> Return the largest of a value of all ranks.
  real(wp) function largest(self, value)
    class(field_space_t), intent(in) :: self
    real(wp), intent(in) :: value
    real(wp) :: values(1)

    values = value
    call self%ranks%most(values)
    largest = values(1)
  end function largest

  !> Return the sum of a count of all ranks.
  integer function number(self, value)
    class(field_space_t), intent(in) :: self
    integer, intent(in) :: value
    integer :: values(1)

    values = value
    call self%ranks%add_counts(values)
    number = values(1)
  end function number

  !> Take the error of the first rank that has one, on all ranks that share the window or its transforms.
  subroutine agree(self, error)
    class(field_space_t), intent(in) :: self
    type(error_t), allocatable, intent(inout) :: error

    call self%ranks%agree(error)
    call self%helpers%agree(error)
  end subroutine agree

  !> Return the first and the last row of this rank.
  pure function own_rows(self, n_row) result(rows)
    class(field_space_t), intent(in) :: self
    !> Rows of the window
    integer, intent(in) :: n_row
    integer :: rows(2)

    rows = [self%ranks%first_row(n_row), self%ranks%last_row(n_row)]
  end function own_rows

  !> Return the columns and rows of a field in the memory of this rank.
  pure function own_extent(self, extent)
    class(field_space_t), intent(in) :: self
    !> Columns and rows of the window
    integer, intent(in) :: extent(2)
    integer :: own_extent(2)

    associate (rows => self%own_rows(extent(2)))
      own_extent = [extent(1), rows(2) - rows(1) + 1]
    end associate
  end function own_extent

  !> Take rows of a field; all ranks take part.
  subroutine fetch_window(self, n_row, own, first, values)
    class(field_space_t), intent(in) :: self
    !> Rows of the window
    integer, intent(in) :: n_row
    !> Own rows of the field (n_col, own rows)
    real(wp), intent(in), contiguous, target :: own(:, :)
    !> First of the rows to be fetched, and their values (n_col, number of rows)
    integer, intent(in) :: first
    real(wp), intent(out), contiguous, target :: values(:, :)

    if (self%ranks%size == 1) then
      values = own(:, first:first + size(values, 2) - 1)
    else
      call self%ranks%fetch(2*size(own, 1), n_row, c_loc(own), [first, first + size(values, 2) - 1], c_loc(values))
    end if
  end subroutine fetch_window

  !> Take rows of a field in single precision.
  subroutine fetch_single(self, n_row, own, first, values)
    class(field_space_t), intent(in) :: self
    integer, intent(in) :: n_row
    real(sp), intent(in), contiguous, target :: own(:, :)
    integer, intent(in) :: first
    real(sp), intent(out), contiguous, target :: values(:, :)

    if (self%ranks%size == 1) then
      values = own(:, first:first + size(values, 2) - 1)
    else
      call self%ranks%fetch(size(own, 1), n_row, c_loc(own), [first, first + size(values, 2) - 1], c_loc(values))
    end if
  end subroutine fetch_single

  !> Take rows of a mask.
  subroutine fetch_mask(self, n_row, own, first, values)
    class(field_space_t), intent(in) :: self
    integer, intent(in) :: n_row
    logical(lk), intent(in), contiguous :: own(:, :)
    integer, intent(in) :: first
    logical(lk), intent(out), contiguous :: values(:, :)
    real(sp), allocatable :: rows(:, :)

    if (self%ranks%size == 1) then
      values = own(:, first:first + size(values, 2) - 1)
    else
      ! a row of bytes is no number of words, which ranks exchange
      allocate (rows(size(values, 1), size(values, 2)))
      call self%fetch(n_row, merge(1.0_sp, 0.0_sp, own), first, rows)
      values = rows > 0.5_sp
    end if
  end subroutine fetch_mask

  !> Set x <- value.
  subroutine fill(self, x, value)
    class(field_space_t), intent(in) :: self
    !> Vector
    real(wp), intent(out), contiguous :: x(:)
    real(wp), intent(in) :: value
    integer :: i

    !$omp parallel do simd schedule(static) num_threads(self%threads)
    do i = 1, size(x)
      x(i) = value
    end do
    !$omp end parallel do simd
  end subroutine fill

  !> Copy y <- x.
  subroutine copy(self, x, y)
    class(field_space_t), intent(in) :: self
    !> Vectors of equal length
    real(wp), intent(in), contiguous :: x(:)
    real(wp), intent(out), contiguous :: y(:)
    integer :: i

    !$omp parallel do simd schedule(static) num_threads(self%threads)
    do i = 1, size(x)
      y(i) = x(i)
    end do
    !$omp end parallel do simd
  end subroutine copy

  !> Add y <- y + x.
  subroutine add(self, x, y)
    class(field_space_t), intent(in) :: self
    !> Vectors of equal length
    real(wp), intent(in), contiguous :: x(:)
    real(wp), intent(inout), contiguous :: y(:)
    integer :: i

    !$omp parallel do simd schedule(static) num_threads(self%threads)
    do i = 1, size(x)
      y(i) = y(i) + x(i)
    end do
    !$omp end parallel do simd
  end subroutine add

  !> Return the largest element.
  real(wp) function vector_max(self, x)
    class(field_space_t), intent(in) :: self
    !> Vector
    real(wp), intent(in), contiguous :: x(:)
    integer :: i

    vector_max = -huge(1.0_wp)
    !$omp parallel do simd schedule(static) num_threads(self%threads) reduction(max: vector_max)
    do i = 1, size(x)
      vector_max = max(vector_max, x(i))
    end do
    !$omp end parallel do simd
    vector_max = largest(self, vector_max)
  end function vector_max

  !> Return the largest element of a field over the window.
  real(wp) function window_max(self, x)
    class(field_space_t), intent(in) :: self
    !> Field (n_col, n_row)
    real(wp), intent(in), contiguous, target :: x(:, :)
    real(wp), pointer, contiguous :: values(:)

    values(1:size(x)) => x
    window_max = vector_max(self, values)
  end function window_max

  !> Return the largest element on a set of nodes.
  real(wp) function vector_max_on(self, x, nodes)
    class(field_space_t), intent(in) :: self
    !> Vector
    real(wp), intent(in), contiguous :: x(:)
    !> True on the nodes of the set
    logical(lk), intent(in), contiguous :: nodes(:)
    integer :: i

    vector_max_on = -huge(1.0_wp)
    !$omp parallel do simd schedule(static) num_threads(self%threads) reduction(max: vector_max_on)
    do i = 1, size(x)
      vector_max_on = max(vector_max_on, merge(x(i), -huge(1.0_wp), nodes(i)))
    end do
    !$omp end parallel do simd
    vector_max_on = largest(self, vector_max_on)
  end function vector_max_on

  !> Return the largest element of a field over the window on a set of nodes.
  real(wp) function window_max_on(self, x, nodes)
    class(field_space_t), intent(in) :: self
    !> Field (n_col, n_row)
    real(wp), intent(in), contiguous, target :: x(:, :)
    !> True on the nodes of the set (n_col, n_row)
    logical(lk), intent(in), contiguous, target :: nodes(:, :)
    real(wp), pointer, contiguous :: values(:)
    logical(lk), pointer, contiguous :: set(:)

    values(1:size(x)) => x
    set(1:size(x)) => nodes
    window_max_on = vector_max_on(self, values, set)
  end function window_max_on

  !> Return the smallest element on a set of nodes.
  real(wp) function vector_min(self, x, nodes)
    class(field_space_t), intent(in) :: self
    !> Vector
    real(wp), intent(in), contiguous :: x(:)
    !> True on the nodes of the set
    logical(lk), intent(in), contiguous :: nodes(:)
    integer :: i

    vector_min = huge(1.0_wp)
    !$omp parallel do simd schedule(static) num_threads(self%threads) reduction(min: vector_min)
    do i = 1, size(x)
      vector_min = min(vector_min, merge(x(i), huge(1.0_wp), nodes(i)))
    end do
    !$omp end parallel do simd
    vector_min = -largest(self, -vector_min)
  end function vector_min

  !> Return the smallest element of a field over the window on a set of nodes.
  real(wp) function window_min(self, x, nodes)
    class(field_space_t), intent(in) :: self
    !> Field (n_col, n_row)
    real(wp), intent(in), contiguous, target :: x(:, :)
    !> True on the nodes of the set (n_col, n_row)
    logical(lk), intent(in), contiguous, target :: nodes(:, :)
    real(wp), pointer, contiguous :: values(:)
    logical(lk), pointer, contiguous :: set(:)

    values(1:size(x)) => x
    set(1:size(x)) => nodes
    window_min = vector_min(self, values, set)
  end function window_min

  !> Return the largest absolute value, 0 of nothing.
  real(wp) function max_abs(self, x)
    class(field_space_t), intent(in) :: self
    !> Vector
    real(wp), intent(in), contiguous :: x(:)
    integer :: i

    max_abs = 0.0_wp
    !$omp parallel do simd schedule(static) num_threads(self%threads) reduction(max: max_abs)
    do i = 1, size(x)
      max_abs = max(max_abs, abs(x(i)))
    end do
    !$omp end parallel do simd
    max_abs = largest(self, max_abs)
  end function max_abs

  !> Count the nodes of a set of the window.
  integer function count_window(self, nodes)
    class(field_space_t), intent(in) :: self
    !> True on the nodes of the set (n_col, n_row)
    logical(lk), intent(in), contiguous, target :: nodes(:, :)
    logical(lk), pointer, contiguous :: set(:)

    set(1:size(nodes)) => nodes
    count_window = count_nodes(self, set)
  end function count_window

  !> Count the nodes of the window with a value above zero.
  integer function count_positive(self, x)
    class(field_space_t), intent(in) :: self
    !> Field (n_col, n_row)
    real(wp), intent(in), contiguous :: x(:, :)
    integer :: row

    count_positive = 0
    !$omp parallel do schedule(static) num_threads(self%threads) reduction(+: count_positive)
    do row = 1, size(x, 2)
      count_positive = count_positive + count(x(:, row) > 0.0_wp)
    end do
    !$omp end parallel do
    count_positive = number(self, count_positive)
  end function count_positive

  !> Count the nodes of a set.
  integer function count_nodes(self, nodes)
    class(field_space_t), intent(in) :: self
    !> Vector, true on the nodes of the set
    logical(lk), intent(in), contiguous :: nodes(:)
    integer :: i

    count_nodes = 0
    !$omp parallel do simd schedule(static) num_threads(self%threads) reduction(+: count_nodes)
    do i = 1, size(nodes)
      count_nodes = count_nodes + merge(1, 0, nodes(i))
    end do
    !$omp end parallel do simd
    count_nodes = number(self, count_nodes)
  end function count_nodes

  !> Return the number of terms of a sum: pairs of own rows, or blocks.
  pure integer function n_term(self, n)
    class(field_space_t), intent(in) :: self
    !> Length of the vector
    integer, intent(in) :: n

    n_term = (n + sum_block - 1)/sum_block
    if (allocated(self%ends)) n_term = ubound(self%ends, 1)
  end function n_term

  !> Return the number of components of a term.
  pure integer function n_component(self)
    class(field_space_t), intent(in) :: self

    n_component = 1
    if (allocated(self%ends)) n_component = size(self%ends, 2)
  end function n_component

  !> Find the first and the last element of a component of a term; there are none if the last is less.
  pure subroutine term(self, k, component, n, before, first, last)
    class(field_space_t), intent(in) :: self
    !> Term and component
    integer, intent(in) :: k, component
    !> Length of the vector, and elements that it lacks before its first one
    integer, intent(in) :: n, before
    !> The elements
    integer, intent(out) :: first, last

    if (allocated(self%ends)) then
      first = max(self%ends(k - 1, component) - before, 0) + 1
      last = min(self%ends(k, component) - before, n)
    else
      first = (k - 1)*sum_block + 1
      last = min(k*sum_block, n)
    end if
  end subroutine term

  !> Sum the elements.
  real(wp) function vector_sum(self, x)
    class(field_space_t), intent(in) :: self
    !> Vector
    real(wp), intent(in), contiguous :: x(:)
    real(wp) :: part(self%n_term(size(x)))
    integer :: k, m, from, to

    !$omp parallel do schedule(static) num_threads(self%threads) private(m, from, to)
    do k = 1, size(part)
      part(k) = 0.0_wp
      do m = 1, self%n_component()
        call term(self, k, m, size(x), 0, from, to)
        part(k) = part(k) + sum(x(from:to))
      end do
    end do
    !$omp end parallel do
    vector_sum = self%ranks%total(part)
  end function vector_sum

  !> Sum a field over the window, row by row.
  real(wp) function window_sum(self, x)
    class(field_space_t), intent(in) :: self
    !> Field (n_col, n_row)
    real(wp), intent(in), contiguous :: x(:, :)
    real(wp) :: part(size(x, 2))
    integer :: row

    !$omp parallel do schedule(static) num_threads(self%threads)
    do row = 1, size(x, 2)
      part(row) = sum(x(:, row))
    end do
    !$omp end parallel do
    window_sum = self%ranks%total(part)
  end function window_sum

  !> Sum a field over a set of nodes of the window, row by row.
  real(wp) function window_sum_on(self, x, nodes)
    class(field_space_t), intent(in) :: self
    !> Field (n_col, n_row)
    real(wp), intent(in), contiguous :: x(:, :)
    !> True on the nodes of the set (n_col, n_row)
    logical(lk), intent(in), contiguous :: nodes(:, :)
    real(wp) :: part(size(x, 2))
    integer :: row

    !$omp parallel do schedule(static) num_threads(self%threads)
    do row = 1, size(x, 2)
      part(row) = sum(x(:, row), mask=nodes(:, row))
    end do
    !$omp end parallel do
    window_sum_on = self%ranks%total(part)
  end function window_sum_on

  !> Sum a field in single precision over the window, row by row, in double precision.
  real(wp) function window_sum_single(self, x)
    class(field_space_t), intent(in) :: self
    !> Field (n_col, n_row)
    real(sp), intent(in), contiguous :: x(:, :)
    real(wp) :: part(size(x, 2))
    integer :: row

    !$omp parallel do schedule(static) num_threads(self%threads)
    do row = 1, size(x, 2)
      part(row) = sum(real(x(:, row), wp))
    end do
    !$omp end parallel do
    window_sum_single = self%ranks%total(part)
  end function window_sum_single

  !> Add x <- x + B share.
  subroutine add_columns(self, b, share, x)
    class(field_space_t), intent(in) :: self
    !> Vectors to be added
    real(wp), intent(in), contiguous :: b(:, :)
    !> Their factors
    real(wp), intent(in) :: share(:)
    !> Sum
    real(wp), intent(inout), contiguous :: x(:)
    integer :: i, m, from, to

    !$omp parallel do schedule(static) num_threads(self%threads) private(i, m, to)
    do from = 1, size(x), sum_block
      to = min(from + sum_block - 1, size(x))
      do m = 1, size(share)
        do i = from, to
          x(i) = x(i) + share(m)*b(i, m)
        end do
      end do
    end do
    !$omp end parallel do
  end subroutine add_columns

  !> Compute the scalar products of several vectors with one.
  function dots(self, b, x)
    class(field_space_t), intent(in) :: self
    !> Vectors
    real(wp), intent(in), contiguous :: b(:, :)
    !> Vector
    real(wp), intent(in), contiguous :: x(:)
    real(wp) :: dots(size(b, 2))
    integer :: m

    do m = 1, size(b, 2)
      dots(m) = self%dot(b(:, m), x)
    end do
  end function dots

  !> Compute a scalar product, summed by pairs of rows or in fixed blocks.
  real(wp) function dot_double(self, a, b, before)
    class(field_space_t), intent(in) :: self
    !> Vectors of equal length
    real(wp), intent(in), contiguous :: a(:), b(:)
    !> Elements that they lack before their first ones; absent: none
    integer, intent(in), optional :: before
    integer, parameter :: block = 8192 ! OpenBLAS sums more than 10,000 by threads
    real(wp) :: part(self%n_term(size(a)))
    integer :: k, m, from, to, at, n, lacking

    lacking = 0
    if (present(before)) lacking = before
    !$omp parallel do schedule(static) num_threads(self%threads) private(m, from, to, at, n)
    do k = 1, size(part)
      part(k) = 0.0_wp
      do m = 1, self%n_component()
        call term(self, k, m, size(a), lacking, from, to)
        do at = from, to, block
          n = min(block, to - at + 1)
          part(k) = part(k) + ddot(n, a(at:at + n - 1), 1, b(at:at + n - 1), 1)
        end do
      end do
    end do
    !$omp end parallel do
    dot_double = self%ranks%total(part)
  end function dot_double

  !> Compute the scalar product of a vector in single precision and one in double.
  real(wp) function dot_single(self, a, b)
    class(field_space_t), intent(in) :: self
    !> Vectors of equal length
    real(sp), intent(in), contiguous :: a(:)
    real(wp), intent(in), contiguous :: b(:)
    integer, parameter :: block = 1024
    real(wp) :: part(self%n_term(size(a))), wide(block)
    integer :: k, m, from, to, at, n

    !$omp parallel do schedule(static) num_threads(self%threads) private(m, from, to, at, n, wide)
    do k = 1, size(part)
      part(k) = 0.0_wp
      do m = 1, self%n_component()
        call term(self, k, m, size(a), 0, from, to)
        do at = from, to, block
          n = min(block, to - at + 1)
          wide(:n) = a(at:at + n - 1)
          part(k) = part(k) + ddot(n, wide, 1, b(at:at + n - 1), 1)
        end do
      end do
    end do
    !$omp end parallel do
    dot_single = self%ranks%total(part)
  end function dot_single

end module hc_field_space
