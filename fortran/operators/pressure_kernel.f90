!> The kernel of the pressure at all lattice offsets of a window, over the unit of the bodies.
!>
!> On the equilateral lattice it has twelve symmetries: only offsets with
!> 0 <= j <= i are evaluated. Bodies without a length of their own have the same kernel at the same
!> indices of any lattice, so that one table serves a whole hierarchy of lattices.
!>
!> Equations: docs/theory/elasticity.md, (E5) to (E13).
module hc_pressure_kernel
  use, intrinsic :: iso_fortran_env, only: int64
  use hc_precision, only: wp
  use hc_lattice, only: lattice_t
  use hc_field_space, only: field_space_t
  use hc_elastic_medium, only: elastic_medium_t, influence_t, n_word
  use hc_convolution, only: kernel_source_t
  implicit none
  private

  public :: normal_kernel_t

  !> Closing of the gap by a pyramid of unit pressure, over the unit of the bodies.
  type, extends(kernel_source_t) :: normal_kernel_t
    private
    logical :: equilateral = .false.
    !> The bodies
    integer(int64) :: medium(n_word) = 0
    !> Closing at offsets (i, j) with i j >= 0, and at (i, -j)
    real(wp), allocatable :: same(:, :), opposite(:, :)
    !> On several ranks there is no table of all rows: influence on the lattice of this basis
    class(influence_t), allocatable :: influence
    real(wp) :: basis(2, 2) = 0.0_wp
  contains
    !> Tabulate the kernel, unless the table covers the window
    procedure :: cover
    !> Free the table
    procedure :: clear
    procedure :: row => kernel_row
  end type normal_kernel_t

contains

  !> Tabulate the kernel for a window; one that exists is of the same basis.
  subroutine cover(self, lattice, medium, space)
    class(normal_kernel_t), intent(inout) :: self
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    class(elastic_medium_t), allocatable :: reduced
    class(influence_t), allocatable :: influence
    integer :: i, j, n(2), first

    n = lattice%extent - 1
    call medium%reduce(lattice%spacing(), reduced)
    if (allocated(self%influence)) deallocate (self%influence)
    if (space%ranks%size > 1) then
      self%basis = lattice%unit_basis()
      call reduced%new_influence(self%basis, self%influence)
      self%equilateral = self%influence%is_hexagonal()
      return
    end if
    associate (word => reduced%key_words(normal=.true., tangential=.false.))
      if (allocated(self%same)) then
        if (all(n <= ubound(self%same)) .and. all(self%medium == word)) return
        call self%clear()
      end if
      self%medium = word
    end associate
    associate (basis => lattice%unit_basis())
      call reduced%new_influence(basis, influence)
      self%equilateral = influence%is_hexagonal()
      if (self%equilateral) n = maxval(n)
      allocate (self%same(0:n(1), 0:n(2)))
      if (.not. self%equilateral) allocate (self%opposite(0:n(1), 0:n(2)))
      !$omp parallel do schedule(dynamic, 8) private(i, first) num_threads(space%threads)
      do j = 0, n(2)
        first = merge(j, 0, self%equilateral)
        call influence%closing([(i*basis(1, 1) + j*basis(1, 2), i=first, n(1))], &
                               [(i*basis(2, 1) + j*basis(2, 2), i=first, n(1))], self%same(first:, j))
        if (self%equilateral) cycle
        call influence%closing([(i*basis(1, 1) - j*basis(1, 2), i=0, n(1))], &
                               [(i*basis(2, 1) - j*basis(2, 2), i=0, n(1))], self%opposite(:, j))
      end do
      !$omp end parallel do
    end associate
    if (.not. self%equilateral) return
    ! a mirror image: columns and rows change places
    do j = 1, n(2)
      self%same(:j - 1, j) = self%same(j, :j - 1)
    end do
  end subroutine cover

  !> Free the table; `cover` makes it again.
  subroutine clear(self)
    class(normal_kernel_t), intent(inout) :: self

    if (allocated(self%same)) deallocate (self%same)
    if (allocated(self%opposite)) deallocate (self%opposite)
  end subroutine clear

  !> Take a row of offsets from the table.
  pure subroutine kernel_row(self, j, k)
    class(normal_kernel_t), intent(in) :: self
    integer, intent(in) :: j
    real(wp), intent(out) :: k(:, :)
    integer :: i, n

    n = size(k, 2)/2
    if (allocated(self%influence)) then
      call evaluate_row(self, j, k)
      return
    end if
    k(1, n + 1:) = self%same(:n, j)
    do i = 1, n
      if (j == 0) then
        k(1, n + 1 - i) = self%same(i, 0)
      else if (self%equilateral) then
        ! a turn by 60 degrees
        k(1, n + 1 - i) = self%same(abs(i - j), min(i, j))
      else
        k(1, n + 1 - i) = self%opposite(i, j)
      end if
    end do
  end subroutine kernel_row

  !> Evaluate a row of offsets at the points that the table has.
  pure subroutine evaluate_row(self, j, k)
    class(normal_kernel_t), intent(in) :: self
    integer, intent(in) :: j
    real(wp), intent(out) :: k(:, :)
    real(wp), dimension(size(k, 2)) :: x, y, closing
    integer :: i, n, at(2)

    n = size(k, 2)/2
    do i = -n, n
      at = [i, j]
      if (i < 0 .and. j == 0) at = [-i, 0]
      if (self%equilateral) then
        if (i < 0 .and. j > 0) at = [abs(-i - j), min(-i, j)]                  ! a turn by 60 degrees
        at = [maxval(at), minval(at)]
      else if (i < 0 .and. j > 0) then
        at = [-i, -j]
      end if
      x(n + 1 + i) = at(1)*self%basis(1, 1) + at(2)*self%basis(1, 2)
      y(n + 1 + i) = at(1)*self%basis(2, 1) + at(2)*self%basis(2, 2)
    end do
    call self%influence%closing(x, y, closing)
    k(1, :) = closing
  end subroutine evaluate_row

end module hc_pressure_kernel
