!> Rolling: the surfaces move through the contact along a row of the lattice, by one spacing a step.
!>
!> The contact travels over both bodies to the node ahead, so the material of a node was one node ahead a step before: the
!> displacements of the step before are shifted by an index, without interpolation. In the steady state they are those of this
!> step, and the slip over one spacing is u less u at the node ahead.
!>
!> Equations: docs/theory/rolling.md, (K1) to (K5).
module hc_rolling
  use hc_precision, only: wp
  use hc_lattice, only: lattice_t
  implicit none
  private

  public :: rolling_t, row_along

  !> Sine of the angle between a direction and a row below which they are one
  real(wp), parameter :: aligned = 1.0e-9_wp

  !> Direction of rolling, and whether the state is steady.
  type :: rolling_t
    !> Columns and rows from a node to the node ahead; zero: the bodies do not roll
    integer :: ahead(2) = 0
    !> The steady state is solved at once; else the contact moves on by one spacing
    logical :: steady = .false.
    !> Share of the slip over a spacing: on a coarser lattice that over a spacing of the finest one
    real(wp) :: share = 1.0_wp
  contains
    !> Return whether the bodies roll
    procedure :: rolls
    !> Step from a node to the one ahead in a field that is a vector
    procedure :: stride
    !> Vector from a node to the one ahead
    procedure :: spacing => spacing_vector
    !> Slip over a spacing, before rigid motions, in place
    procedure :: subtract_ahead
    !> Values of the node ahead
    procedure :: shifted
    !> Sums along the rows, from the front of the window on
    procedure :: sum_behind
    !> Motions over a spacing from creepages, and back
    procedure :: motions, creepages
  end type rolling_t

contains

  !> Return columns and rows from a node to the next one along a direction; zero if no row of the lattice has it.
  pure function row_along(lattice, direction) result(ahead)
    !> Lattice
    type(lattice_t), intent(in) :: lattice
    !> Angle from x
    real(wp), intent(in) :: direction
    integer :: ahead(2), k
    integer, parameter :: rows(2, 6) = reshape([1, 0, -1, 0, 0, 1, 0, -1, -1, 1, 1, -1], [2, 6])
    real(wp) :: to(2)

    ahead = 0
    do k = 1, size(rows, 2)
      to = matmul(lattice%basis, real(rows(:, k), wp))
      associate (along => to(1)*cos(direction) + to(2)*sin(direction), across => to(2)*cos(direction) - to(1)*sin(direction))
        if (along > 0.0_wp .and. abs(across) <= aligned*along) ahead = rows(:, k)
      end associate
    end do
  end function row_along

  !> Return whether the bodies roll.
  pure logical function rolls(self)
    class(rolling_t), intent(in) :: self

    rolls = any(self%ahead /= 0)
  end function rolls

  !> Return the step from a node to the one ahead in a field that is a vector.
  pure integer function stride(self, n_col)
    class(rolling_t), intent(in) :: self
    !> Columns of the window
    integer, intent(in) :: n_col

    stride = self%ahead(1) + self%ahead(2)*n_col
  end function stride

  !> Return the vector from a node to the one ahead [m].
  pure function spacing_vector(self, lattice) result(vector)
    class(rolling_t), intent(in) :: self
    !> Lattice
    type(lattice_t), intent(in) :: lattice
    real(wp) :: vector(2)

    vector = matmul(lattice%basis, real(self%ahead, wp))
  end function spacing_vector

  !> Subtract the value of the node ahead, times the share. At the rim of the window, which no contact reaches, a value is one
  !> of another row, or stays.
  pure subroutine subtract_ahead(self, n_col, field)
    class(rolling_t), intent(in) :: self
    !> Columns of the window
    integer, intent(in) :: n_col
    !> The field, row after row
    real(wp), intent(inout), contiguous :: field(:)
    integer :: i, to_ahead

    to_ahead = self%stride(n_col)
    ! in the order in which the value ahead is not changed yet
    if (to_ahead > 0) then
      do i = 1, size(field) - to_ahead
        field(i) = self%share*(field(i) - field(i + to_ahead))
      end do
    else
      do i = size(field), 1 - to_ahead, -1
        field(i) = self%share*(field(i) - field(i + to_ahead))
      end do
    end if
  end subroutine subtract_ahead

  !> Return the values of the nodes ahead; at the rim of the window, which no contact reaches, those of the node itself.
  pure function shifted(self, field)
    class(rolling_t), intent(in) :: self
    !> A field of the window (n_col, n_row)
    real(wp), intent(in) :: field(:, :)
    real(wp) :: shifted(size(field, 1), size(field, 2))

    shifted = field
    associate (low => max(1, 1 - self%ahead), high => min(shape(field), shape(field) - self%ahead), by => self%ahead)
      shifted(low(1):high(1), low(2):high(2)) = field(low(1) + by(1):high(1) + by(1), low(2) + by(2):high(2) + by(2))
    end associate
  end function shifted

  !> Add to each value those of all nodes ahead: what a point of the surface gathers on its way through the contact.
  pure subroutine sum_behind(self, field)
    class(rolling_t), intent(in) :: self
    !> A field of the window (n_col, n_row)
    real(wp), intent(inout) :: field(:, :)
    integer :: row, col, step(2)

    step = merge(-1, 1, self%ahead > 0)
    associate (by => self%ahead, low => max(1, 1 - self%ahead), high => min(shape(field), shape(field) - self%ahead))
      do row = merge(high(2), low(2), by(2) > 0), merge(low(2), high(2), by(2) > 0), step(2)
        do col = merge(high(1), low(1), by(1) > 0), merge(low(1), high(1), by(1) > 0), step(1)
          field(col, row) = field(col, row) + field(col + by(1), row + by(2))
        end do
      end do
    end associate
  end subroutine sum_behind

  !> Return shifts and twist of body 2 relative to body 1 over a spacing, (K2): creepages are the velocity of body 1 less that of
  !> body 2, taken in the middle between a node and the one ahead.
  pure function motions(self, lattice, creepage) result(motion)
    class(rolling_t), intent(in) :: self
    !> Lattice
    type(lattice_t), intent(in) :: lattice
    !> Creepage along x and y, and spin [1/m]
    real(wp), intent(in) :: creepage(3)
    real(wp) :: motion(3), by(2)

    by = self%spacing(lattice)
    motion = -norm2(by)*creepage
    motion(:2) = motion(:2) + 0.5_wp*motion(3)*[-by(2), by(1)]
  end function motions

  !> Return the creepages of given shifts and twist over a spacing.
  pure function creepages(self, lattice, motion) result(creepage)
    class(rolling_t), intent(in) :: self
    !> Lattice
    type(lattice_t), intent(in) :: lattice
    !> Shift along x and y, and twist
    real(wp), intent(in) :: motion(3)
    real(wp) :: creepage(3), by(2)

    by = self%spacing(lattice)
    creepage = motion
    creepage(:2) = creepage(:2) - 0.5_wp*motion(3)*[-by(2), by(1)]
    creepage = -creepage/norm2(by)
  end function creepages

end module hc_rolling
