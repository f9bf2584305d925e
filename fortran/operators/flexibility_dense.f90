!> Flexibility operator by direct summation, and its single coefficients, for LAPACK.
!>
!> A coefficient depends on the distance of two nodes only, so that those of all distances in the window are stored;
!> the matrix of an area is filled from them on demand.
!>
!> Equations: docs/theory/discretisation.md, (D4).
module hc_flexibility_dense
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_lapack, only: prepare_lapack
  use hc_lattice, only: lattice_t
  use hc_elastic_medium, only: elastic_medium_t, influence_t, n_block, block_index
  use hc_flexibility_fft, only: fft_memory
  use hc_flexibility, only: flexibility_t, check_operator, normal, along_x, along_y
  implicit none
  private

  public :: dense_flexibility_t, new_dense_flexibility, dense_memory

  !> Operator by direct summation.
  type, extends(flexibility_t) :: dense_flexibility_t
    private
    !> Position of each node: two nodes differ by the same whenever they are equally far apart (n_node)
    integer, allocatable :: position(:)
    !> Blocks of the operator by the difference of positions, onto - from (:, n_block) [m/Pa]
    real(wp), allocatable :: influence(:, :)
  contains
    procedure :: apply => dense_apply
    !> Displacements of some nodes by a unit pressure on one
    procedure :: normal_influence
    !> Displacements of some nodes by the tractions on one
    procedure :: response
  end type dense_flexibility_t

contains

  !> Compute the coefficients of the operator over a window.
  subroutine new_dense_flexibility(operator, lattice, medium, error)
    !> Operator to be set up
    type(dense_flexibility_t), intent(out) :: operator
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> Allocated on failure: a lattice or constants of no use, not enough memory
    type(error_t), allocatable, intent(out) :: error

    integer, parameter :: long = selected_int_kind(18)
    class(influence_t), allocatable :: influence
    real(wp), allocatable :: x(:), y(:), block(:, :)
    integer :: n(2), col, row, stride, largest, stat

    call check_operator(lattice, medium, error)
    if (allocated(error)) return
    if (lattice%is_periodic()) then
      call raise(error, status%invalid_input, 'the influence of nodes that repeat has no end: use method "fft"')
      return
    end if
    if (product(2*int(lattice%extent, long) - 1) > huge(1)) then
      call raise(error, status%resources, 'the window is too large for a matrix: use method "fft"')
      return
    end if
    call prepare_lapack(error)
    if (allocated(error)) return
    operator%lattice = lattice
    allocate (operator%medium, source=medium)
    n = lattice%extent
    stride = 2*n(1) - 1
    largest = n(1) - 1 + (n(2) - 1)*stride
    allocate (operator%influence(-largest:largest, n_block), operator%position(lattice%size()), stat=stat)
    if (stat /= 0) then
      call raise(error, status%resources, 'not enough memory for the flexibility operator')
      return
    end if
    operator%position = [((col + row*stride, col=0, n(1) - 1), row=0, n(2) - 1)]
    call medium%new_influence(lattice%basis, influence)
    !$omp parallel do private(col, x, y, block) if (lattice%size() > 1000)
    do row = 1 - n(2), n(2) - 1
      x = [(col*lattice%basis(1, 1) + row*lattice%basis(1, 2), col=1 - n(1), n(1) - 1)]
      y = [(col*lattice%basis(2, 1) + row*lattice%basis(2, 2), col=1 - n(1), n(1) - 1)]
      allocate (block(n_block, stride))
      call influence%blocks(x, y, block)
      operator%influence(1 - n(1) + row*stride:n(1) - 1 + row*stride, :) = transpose(block)
      deallocate (block)
    end do
    !$omp end parallel do
    associate (xx => abs(block_index(along_x, along_x)), yy => abs(block_index(along_y, along_y)))
      operator%influence(0, [xx, yy]) = operator%influence(0, [xx, yy]) + medium%spring_compliance()
    end associate
  end subroutine new_dense_flexibility

  !> Count the bytes that the influence coefficients and the matrix of a contact take, factorized.
  pure integer(selected_int_kind(18)) function dense_memory(extent, n_contact, normal_only, n_spectrum)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Nodes in contact
    integer, intent(in) :: n_contact
    !> Contact without friction
    logical, intent(in) :: normal_only
    !> Number of spectra of the two bodies; absent: the most
    integer, intent(in), optional :: n_spectrum
    integer, parameter :: long = selected_int_kind(18)
    !> What BLAS packs matrices into: 2 to 15 MB, as it was built and for what processor
    integer(long), parameter :: buffers = 3000000
    !> Vectors of a node in contact with friction: rows and columns of its unknowns, 2.5 as a rule, and ten directions of GMRES
    integer(long), parameter :: vectors = 1800
    !> Pages at the ends of columns of which half is touched, and fifths of the bytes for a pair of nodes: the complement of the
    !> sliding nodes is the larger one of unlike materials
    integer(long), parameter :: pages(2) = [4500, 6000], fifths(2) = [19, 24]
    integer(long) :: n, n_window
    logical :: slides

    n = n_contact
    n_window = int(extent(1), long)*extent(2)
    dense_memory = buffers + 8*n_block*4*n_window
    if (normal_only) then
      ! the first area, of the lattice of every second node, has some rings more than the contact; half of the matrix is touched
      dense_memory = dense_memory + 8*min(n + nint(13*sqrt(real(n, wp)), long), n_window)**2/2
    else
      slides = .true.
      if (present(n_spectrum)) slides = n_spectrum > 4
      ! with those of the coarse lattice; in single precision the factor, and the complement of the sliding nodes, half touched
      dense_memory = dense_memory + 2*n_block*4*n_window + 5*fft_memory(extent, .false., 1, n_spectrum)/4 &
                     + merge(fifths(2), fifths(1), slides)*n**2/5 + (vectors + merge(pages(2), pages(1), slides))*n
    end if
  end function dense_memory

  !> Compute the displacements along the normal by a unit pressure on one node [m/Pa].
  pure function normal_influence(self, onto, from) result(displacement)
    class(dense_flexibility_t), intent(in) :: self
    !> Nodes that move, in the order of a window
    integer, intent(in) :: onto(:)
    !> Node that is loaded
    integer, intent(in) :: from
    real(wp) :: displacement(size(onto))

    displacement = self%influence(self%position(onto) - self%position(from), block_index(normal, normal))
  end function normal_influence

  !> Compute the displacements by the tractions on one node.
  pure subroutine response(self, onto, from, traction, displacement)
    class(dense_flexibility_t), intent(in) :: self
    !> Nodes that move, in the order of a window
    integer, intent(in) :: onto(:)
    !> Node that is loaded
    integer, intent(in) :: from
    !> Its tractions [Pa]
    real(wp), intent(in) :: traction(3)
    !> Displacements (3, size(onto)) [m]
    real(wp), intent(out) :: displacement(:, :)
    real(wp) :: factor(3)
    integer :: acting, k, offset, block(3)

    displacement = 0.0_wp
    do acting = normal, along_y
      if (abs(traction(acting)) <= 0.0_wp) cycle
      block = abs(block_index(:, acting))
      factor = traction(acting)*sign(1, block_index(:, acting))
      do k = 1, size(onto)
        offset = self%position(onto(k)) - self%position(from)
        displacement(:, k) = displacement(:, k) + factor*self%influence(offset, block)
      end do
    end do
  end subroutine response

  !> Multiply by direct summation.
  subroutine dense_apply(self, from, traction, onto, displacement, error)
    class(dense_flexibility_t), intent(inout) :: self
    integer, intent(in) :: from(:)
    real(wp), intent(in), contiguous :: traction(:, :, :)
    integer, intent(in) :: onto(:)
    real(wp), intent(out), contiguous :: displacement(:, :, :)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: factor
    integer :: col, row, i, o, block, first, n(2), target_row

    call self%check(from, traction, onto, displacement, error)
    if (allocated(error)) return
    n = self%lattice%extent
    !$omp parallel do private(row, col, i, o, block, first, factor) if (self%lattice%size() > 1000)
    do target_row = 1, n(2)
      displacement(:, target_row, :) = 0.0_wp
      do i = 1, size(from)
        do row = 1, n(2)
          do col = 1, n(1)
            if (abs(traction(col, row, i)) <= 0.0_wp) cycle
            first = 1 - col + (target_row - row)*(2*n(1) - 1)
            do o = 1, size(onto)
              block = block_index(onto(o), from(i))
              factor = sign(1, block)*traction(col, row, i)
              displacement(:, target_row, o) = displacement(:, target_row, o) &
                                               + factor*self%influence(first:first + n(1) - 1, abs(block))
            end do
          end do
        end do
      end do
    end do
    !$omp end parallel do
    call self%count(from, onto)
  end subroutine dense_apply

end module hc_flexibility_dense
