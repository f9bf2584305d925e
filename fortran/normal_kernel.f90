!> The kernel of the pressure at all lattice offsets of a window.
!>
!> On the equilateral lattice it has twelve symmetries: only offsets with
!> 0 <= j <= i are evaluated. A lattice twice as coarse has twice the kernel at
!> the same indices, so that one table serves a whole hierarchy of lattices.
module hc_normal_kernel
  use hc_precision, only: wp
  use hc_lattice, only: lattice_t
  use hc_pyramid_influence, only: pyramid_t, new_pyramid
  use hc_convolution, only: kernel_source_t, threads_for
  implicit none
  private

  public :: normal_kernel_t, new_normal_kernel

  !> Closing of the gap by a pyramid of unit pressure.
  type, extends(kernel_source_t) :: normal_kernel_t
    !> Compliance lambda_1, times the ratio of the spacings of lattice and table [1/Pa]
    real(wp) :: factor = 1.0_wp
    logical, private :: equilateral = .false.
    !> K1 at offsets (i, j) with i j >= 0, and at (i, -j) [m]
    real(wp), allocatable, private :: same(:, :), opposite(:, :)
  contains
    procedure :: row => kernel_row
  end type normal_kernel_t

contains

  !> Table for a window.
  subroutine new_normal_kernel(self, lattice, factor, n_threads)
    !> Table to be set up
    type(normal_kernel_t), intent(out) :: self
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Compliance lambda_1 [1/Pa]
    real(wp), intent(in) :: factor
    !> Threads to use; absent or 0: as many as OpenMP would take
    integer, intent(in), optional :: n_threads
    type(pyramid_t) :: pyramid
    integer :: i, j, n(2)

    self%factor = factor
    call new_pyramid(pyramid, lattice%basis)
    self%equilateral = pyramid%is_equilateral()
    n = lattice%extent - 1
    if (self%equilateral) n = maxval(n)
    allocate (self%same(0:n(1), 0:n(2)))
    if (.not. self%equilateral) allocate (self%opposite(0:n(1), 0:n(2)))
    associate (basis => lattice%basis)
      !$omp parallel do schedule(dynamic, 8) private(i) num_threads(threads_for(lattice%extent, n_threads))
      do j = 0, n(2)
        do i = merge(j, 0, self%equilateral), n(1)
          self%same(i, j) = pyramid%normal_kernel(i*basis(1, 1) + j*basis(1, 2), i*basis(2, 1) + j*basis(2, 2))
          if (self%equilateral) cycle
          self%opposite(i, j) = pyramid%normal_kernel(i*basis(1, 1) - j*basis(1, 2), i*basis(2, 1) - j*basis(2, 2))
        end do
      end do
      !$omp end parallel do
    end associate
    if (.not. self%equilateral) return
    ! a mirror image: columns and rows change places
    do j = 1, n(2)
      self%same(:j - 1, j) = self%same(j, :j - 1)
    end do
  end subroutine new_normal_kernel

  pure subroutine kernel_row(self, j, k)
    class(normal_kernel_t), intent(in) :: self
    integer, intent(in) :: j
    real(wp), intent(out) :: k(:, :)
    integer :: i, n

    n = size(k, 2)/2
    k(1, n + 1:) = self%factor*self%same(:n, j)
    do i = 1, n
      if (j == 0) then
        k(1, n + 1 - i) = self%factor*self%same(i, 0)
      else if (self%equilateral) then
        ! a turn by 60 degrees
        k(1, n + 1 - i) = self%factor*self%same(abs(i - j), min(i, j))
      else
        k(1, n + 1 - i) = self%factor*self%opposite(i, j)
      end if
    end do
  end subroutine kernel_row

end module hc_normal_kernel
