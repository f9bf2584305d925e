!> Flexibility operator as an explicit matrix over all nodes of a window, for LAPACK.
module hc_flexibility_dense
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_lapack, only: dgemv
  use hc_lattice, only: lattice_t
  use hc_elastic_pair, only: elastic_pair_t
  use hc_pyramid_influence, only: pyramid_t, new_pyramid
  use hc_flexibility, only: flexibility_t, n_block, blocks, block_index
  implicit none
  private

  public :: dense_flexibility_t, new_dense_flexibility, dense_memory

  !> Explicit operator; node and component run as in an array (n_col, n_row, component).
  type, extends(flexibility_t) :: dense_flexibility_t
    !> Flexibility matrix, symmetric [m/Pa]
    real(wp), allocatable :: matrix(:, :)
  contains
    procedure :: apply => dense_apply
  end type dense_flexibility_t

contains

  !> The matrix of the operator over a window.
  subroutine new_dense_flexibility(operator, lattice, pair, error, normal_only)
    !> Operator to be set up
    type(dense_flexibility_t), intent(out) :: operator
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Elastic constants of the two bodies
    type(elastic_pair_t), intent(in) :: pair
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Only the action of the pressure on the gap will be asked for
    logical, intent(in), optional :: normal_only

    type(pyramid_t) :: pyramid
    real(wp), allocatable :: influence(:, :, :)
    real(wp) :: offset(2), sign
    integer :: n(2), n_component, from, onto, col, row, source, index, stat, n_node

    operator%lattice = lattice
    operator%pair = pair
    n_component = 3
    if (present(normal_only)) n_component = merge(1, 3, normal_only)
    n = lattice%extent
    n_node = lattice%size()
    allocate (operator%matrix(n_node*n_component, n_node*n_component), &
              influence(1 - n(1):n(1) - 1, 1 - n(2):n(2) - 1, n_block), stat=stat)
    if (stat /= 0) then
      call raise(error, status%resources, 'not enough memory for the flexibility matrix: use method "fft"')
      return
    end if
    call new_pyramid(pyramid, lattice%basis)
    !$omp parallel do private(col, offset) if (n_node > 1000)
    do row = 1 - n(2), n(2) - 1
      do col = 1 - n(1), n(1) - 1
        offset = col*lattice%basis(:, 1) + row*lattice%basis(:, 2)
        influence(col, row, :) = blocks(pair, pyramid%kernels(offset(1), offset(2)))
      end do
    end do
    !$omp end parallel do
    do from = 1, n_component
      do onto = 1, n_component
        index = abs(block_index(onto, from))
        sign = merge(1.0_wp, -1.0_wp, block_index(onto, from) > 0)
        !$omp parallel do private(col, source) if (n_node > 1000)
        do row = 1, n(2)
          do col = 1, n(1)
            source = (from - 1)*n_node + (row - 1)*n(1) + col
            operator%matrix((onto - 1)*n_node + 1:onto*n_node, source) = &
              sign*reshape(influence(1 - col:n(1) - col, 1 - row:n(2) - row, index), [n_node])
          end do
        end do
        !$omp end parallel do
      end do
    end do
  end subroutine new_dense_flexibility

  !> Bytes that the matrix takes, together with a factor of it.
  pure integer(selected_int_kind(18)) function dense_memory(extent, normal_only)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Only the action of the pressure on the gap will be asked for
    logical, intent(in) :: normal_only
    integer, parameter :: long = selected_int_kind(18)

    dense_memory = 2*8*(merge(1_long, 3_long, normal_only)*extent(1)*extent(2))**2
  end function dense_memory

  subroutine dense_apply(self, from, traction, onto, displacement, error)
    class(dense_flexibility_t), intent(inout) :: self
    integer, intent(in) :: from(:)
    real(wp), intent(in), contiguous :: traction(:, :, :)
    integer, intent(in) :: onto(:)
    real(wp), intent(out), contiguous :: displacement(:, :, :)
    type(error_t), allocatable, intent(out) :: error
    integer :: i, o, n

    call self%check(from, traction, onto, displacement, error)
    if (allocated(error)) return
    n = self%lattice%size()
    if (max(maxval(from), maxval(onto))*n > size(self%matrix, 1)) then
      call raise(error, status%invalid_input, 'the operator was set up for normal contact only')
      return
    end if
    displacement = 0.0_wp
    do i = 1, size(from)
      do o = 1, size(onto)
        call dgemv('N', n, n, 1.0_wp, self%matrix((onto(o) - 1)*n + 1, (from(i) - 1)*n + 1), size(self%matrix, 1), &
                   traction(:, :, i), 1, 1.0_wp, displacement(:, :, o), 1)
      end do
    end do
    call self%count(from, onto)
  end subroutine dense_apply

end module hc_flexibility_dense
