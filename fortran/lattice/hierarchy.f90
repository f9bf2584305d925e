!> A contact problem on a hierarchy of lattices, each of every second node of the finer one, and on a part of its window.
!>
!> Theory: docs/theory/multilevel.md.
module hc_hierarchy
  use hc_precision, only: wp
  use hc_lattice, only: lattice_t
  use hc_field_space, only: field_space_t
  use hc_transfer, only: restrict_field, restrict_mask
  implicit none
  private

  public :: level_t, level_count, build_levels, restrict_gap

  !> Contact problem on one lattice.
  type, abstract :: level_t
    !> Lattice and window
    type(lattice_t) :: lattice
    !> Initial gap (n_col, n_row) [m]
    real(wp), allocatable :: initial_gap(:, :)
    !> Nodes that may come into contact (n_col, n_row)
    logical, allocatable :: candidate(:, :)
    !> Space of the fields
    type(field_space_t) :: space
  contains
    !> The same problem on the lattice of every second node
    procedure :: coarsen
    !> The same problem on a part of its window
    procedure :: extract_part
    !> Bodies, laws and tuning numbers, from the same problem on another lattice
    procedure(inherit), deferred :: inherit
  end type level_t

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
  pure integer function level_count(extent, smallest_side)
    !> Number of columns and rows of the finest window
    integer, intent(in) :: extent(2)
    !> Nodes that a side should have at least
    integer, intent(in) :: smallest_side
    integer :: side

    level_count = 1
    side = minval(extent)
    do while (side >= 2*smallest_side)
      side = side/2
      level_count = level_count + 1
    end do
  end function level_count

  !> Set up the problem on all coarser lattices.
  subroutine build_levels(finest, coarse)
    !> The problem on the finest lattice
    class(level_t), intent(in) :: finest
    !> The same on the coarser ones, finer ones first
    class(level_t), intent(inout) :: coarse(:)
    integer :: l

    if (size(coarse) == 0) return
    call finest%coarsen(coarse(1))
    do l = 2, size(coarse)
      call coarse(l - 1)%coarsen(coarse(l))
    end do
  end subroutine build_levels

  !> Set the gap on all coarser lattices again.
  subroutine restrict_gap(finest, coarse)
    !> The problem on the finest lattice
    class(level_t), intent(in) :: finest
    !> The same on the coarser ones, finer ones first
    class(level_t), intent(inout) :: coarse(:)
    integer :: l

    if (size(coarse) == 0) return
    coarse(1)%initial_gap = restrict_field(finest%lattice, finest%initial_gap, coarse(1)%lattice)
    do l = 2, size(coarse)
      coarse(l)%initial_gap = restrict_field(coarse(l - 1)%lattice, coarse(l - 1)%initial_gap, coarse(l)%lattice)
    end do
  end subroutine restrict_gap

  !> Set up the same problem on the lattice of every second node.
  subroutine coarsen(self, coarse)
    class(level_t), intent(in) :: self
    !> The problem there
    class(level_t), intent(inout) :: coarse

    coarse%lattice = self%lattice%coarsened()
    coarse%initial_gap = restrict_field(self%lattice, self%initial_gap, coarse%lattice)
    coarse%candidate = restrict_mask(self%lattice, self%candidate, coarse%lattice)
    coarse%space = self%space
    call coarse%inherit(self)
  end subroutine coarsen

  !> Set up the same problem on the part of its window between some columns and rows.
  subroutine extract_part(self, low, high, part)
    class(level_t), intent(in) :: self
    !> First and last column and row
    integer, intent(in) :: low(2), high(2)
    !> The problem there
    class(level_t), intent(inout) :: part

    part%lattice = self%lattice%subwindow(low, high)
    part%initial_gap = self%initial_gap(low(1):high(1), low(2):high(2))
    part%candidate = self%candidate(low(1):high(1), low(2):high(2))
    part%space = self%space
    call part%inherit(self)
  end subroutine extract_part

end module hc_hierarchy
