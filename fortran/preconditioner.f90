!> Fourier preconditioner: the inverse of the lattice symbol on a small periodic grid.
!>
!> The grid is a little larger than the window instead of twice as large, so
!> that one application costs about a quarter of a product. It is symmetric
!> and positive definite, also when it is restricted to a set of nodes.
module hc_preconditioner
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_lattice, only: lattice_t
  use hc_elastic_pair, only: elastic_pair_t
  use hc_fftw, only: good_size
  use hc_convolution, only: convolution_t, new_convolution, convolution_memory
  use hc_lattice_symbol, only: normal_symbol
  implicit none
  private

  public :: preconditioner_t, new_preconditioner, preconditioner_memory

  !> Approximate inverse of the normal flexibility.
  type :: preconditioner_t
    type(convolution_t), private :: convolution
    !> Cost of one application in applications of the full flexibility operator
    real(wp) :: cost = 0.0_wp
  contains
    !> Pressure that causes a given closing of the gap, approximately
    procedure :: apply => apply_preconditioner
  end type preconditioner_t

contains

  !> Plans and inverse symbol over a window.
  subroutine new_preconditioner(self, lattice, pair, error, n_threads)
    !> Preconditioner to be set up
    type(preconditioner_t), intent(out) :: self
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Elastic constants of the two bodies
    type(elastic_pair_t), intent(in) :: pair
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Threads to use; absent or 0: as many as OpenMP would take
    integer, intent(in), optional :: n_threads

    integer, allocatable :: f(:, :)
    integer :: length(2), b, i
    real(wp) :: scale

    length = grid_length(lattice%extent)
    call new_convolution(self%convolution, lattice%extent, length, 1, 1, error, n_threads=n_threads)
    if (allocated(error)) return
    scale = 1.0_wp/(pair%lambda_1*product(real(length, wp)))
    !$omp parallel do num_threads(self%convolution%n_threads) private(f, i)
    do b = 1, self%convolution%n_block
      f = self%convolution%frequencies(b)
      do i = 1, size(f, 2)
        if (f(1, i) > length(1)/2) cycle
        self%convolution%spectrum(i, b, 1) = scale/normal_symbol(lattice%basis, length, f(:, i))
      end do
    end do
    !$omp end parallel do
    self%cost = product(real(length, wp))/product(real(good_size(2*lattice%extent - 1), wp))/3.0_wp
  end subroutine new_preconditioner

  !> Bytes that the preconditioner takes, for a window of the given size.
  pure integer(selected_int_kind(18)) function preconditioner_memory(extent, n_threads)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Threads to use
    integer, intent(in) :: n_threads
    preconditioner_memory = convolution_memory(extent, grid_length(extent), 1, 1, n_threads)
  end function preconditioner_memory

  !> Side of the periodic grid: an eighth more than the window.
  elemental integer function grid_length(extent)
    !> Number of columns or rows of the window
    integer, intent(in) :: extent
    grid_length = good_size(extent + (extent + 7)/8)
  end function grid_length

  subroutine apply_preconditioner(self, closing, pressure)
    class(preconditioner_t), intent(inout) :: self
    !> Closing of the gap (n_col, n_row, 1) [m]
    real(wp), intent(in), contiguous :: closing(:, :, :)
    !> Pressure (n_col, n_row, 1) [Pa]
    real(wp), intent(out), contiguous :: pressure(:, :, :)

    call self%convolution%convolve(reshape([1], [1, 1]), closing, pressure)
  end subroutine apply_preconditioner

end module hc_preconditioner
