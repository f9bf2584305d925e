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

  public :: level_t, level_count

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
    !> Gap of the problem there, set again
    procedure :: coarsen_gap
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
  pure integer function level_count(lattice, smallest_side)
    !> The finest lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Nodes that a side should have at least
    integer, intent(in) :: smallest_side
    integer :: side, extent(2)

    level_count = 1
    extent = lattice%extent
    side = minval(extent)
    do while (side >= 2*smallest_side)
      ! every second node of a window that repeats is one that repeats
      if (lattice%is_periodic() .and. any(modulo(extent, [8, 2]) /= 0)) exit
      extent = extent/2
      side = side/2
      level_count = level_count + 1
    end do
  end function level_count

  !> Set up the same problem on the lattice of every second node.
  subroutine coarsen(self, coarse)
    class(level_t), intent(in) :: self
    !> The problem there
    class(level_t), intent(inout) :: coarse

    coarse%lattice = self%lattice%coarsened()
    call self%coarsen_gap(coarse)
    coarse%candidate = restrict_mask(self%lattice, self%candidate, coarse%lattice)
    coarse%space = self%space
    call coarse%inherit(self)
  end subroutine coarsen

  !> Set the gap of the problem on the lattice of every second node again.
  subroutine coarsen_gap(self, coarse)
    class(level_t), intent(in) :: self
    !> The problem there
    class(level_t), intent(inout) :: coarse

    coarse%initial_gap = restrict_field(self%lattice, self%initial_gap, coarse%lattice)
  end subroutine coarsen_gap

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
