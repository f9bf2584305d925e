!> Two elastic bodies in contact: the interface of all contact solvers.
!>
!> A medium answers with the displacements by one pyramid of traction: their values by distance, their transform on a lattice,
!> and the numbers that follow from them. The displacements depend on the distance of two nodes only, and the operator is
!> symmetric and positive definite. hc_elastic_pair has two half-spaces; a coated body is another extension of this type.
!>
!> Spectra are stored for bodies in other units (`reduce`): lengths over that of a spacing, displacements over `unit`. So
!> one spectrum serves all media that differ in the scale only.
!>
!> Equations: docs/theory/discretisation.md, (D4).
module hc_elastic_medium
  use, intrinsic :: iso_fortran_env, only: int64
  use hc_precision, only: wp, pi
  use hc_error, only: error_t
  implicit none
  private

  public :: elastic_medium_t, influence_t, block_symbols_t, n_block, block_index, n_word

  !> The operator has six different blocks: normal, xx, xy, yy, which are even in the
  !> distance of two nodes, and normal-x, normal-y, which are odd.
  integer, parameter :: n_block = 6
  !> Block that stands at (onto, from), negative where its sign is reversed.
  integer, parameter :: block_index(3, 3) = reshape([1, -5, -6, 5, 2, 3, 6, 3, 4], [3, 3])
  !> Words that a medium may add to the key of a spectrum.
  integer, parameter :: n_word = 8

  !> Displacements by a pyramid of traction of one lattice.
  type, abstract :: influence_t
  contains
    !> All blocks, and the closing of the gap by the pressure alone, at some points
    procedure(influence_blocks), deferred :: blocks
    procedure(influence_closing), deferred :: closing
    !> Return whether the closing has the twelve symmetries of a hexagon
    procedure(influence_is), deferred :: is_hexagonal
  end type influence_t

  !> Transform of the displacements by a pyramid on a window that repeats.
  type, abstract :: block_symbols_t
  contains
    !> Blocks at all frequencies of a column
    procedure(symbols_column), deferred :: column
  end type block_symbols_t

  !> Two bodies.
  type, abstract :: elastic_medium_t
  contains
    !> Refuse constants that no two elastic bodies have
    procedure(medium_check), deferred :: check
    !> Displacement per traction that the numbers of spectra refer to, for lengths of a given one [m/Pa]
    procedure(medium_at), deferred :: unit
    !> The same bodies with that length and that displacement as units, without springs between them
    procedure(medium_reduce), deferred :: reduce
    !> Displacements by a pyramid of a lattice
    procedure(medium_influence), deferred :: new_influence
    !> Their transform on a periodic grid, to the accuracy of a preconditioner; to rounding errors
    procedure(medium_symbols), deferred :: find_symbols
    procedure(medium_block_symbols), deferred :: new_block_symbols
    !> Text that identifies the reduced medium, for the keys of spectra
    procedure(medium_words), deferred :: key_words
    !> Coupling of normal and tangential displacements over the normal ones: Dundurs' beta for half-spaces
    procedure(medium_number), deferred :: coupling
    !> Tangential over normal displacement of a node, the mean of all directions
    procedure(medium_number), deferred :: shear_ratio
    !> Displacement by a point load times the distance, which is that given: along the normal, and along a tangential load
    procedure(medium_at), deferred :: normal_point, shear_point
    !> Sum of the blocks xx and yy over that of the pressure, if it is the same at all distances; else 0
    procedure :: trace
    !> Displacement that springs between the bodies give way by under a unit shear traction [m/Pa]
    procedure :: spring_compliance
    !> Mean displacement by a uniform shear traction in a window that repeats, from the planes that motions refer to [m/Pa]
    procedure :: mean_compliance
    !> Return whether pressure and shear traction move each other
    procedure :: couples
    !> Displacement by any point load times the distance: a bound [1/Pa]
    procedure :: largest_point
    !> Approach by a flat punch under a load [m]
    procedure :: punch_approach
  end type elastic_medium_t

  abstract interface
    !> Compute all blocks at points relative to the node [m/Pa].
    pure subroutine influence_blocks(self, x, y, block)
      import :: influence_t, wp
      class(influence_t), intent(in) :: self
      !> Points (n) [m]
      real(wp), intent(in), contiguous :: x(:), y(:)
      !> Displacement per traction (n_block, n) [m/Pa]
      real(wp), intent(out), contiguous :: block(:, :)
    end subroutine influence_blocks

    !> Compute the closing of the gap by a unit pressure at points relative to the node [m/Pa].
    pure subroutine influence_closing(self, x, y, displacement)
      import :: influence_t, wp
      class(influence_t), intent(in) :: self
      !> Points (n) [m]
      real(wp), intent(in), contiguous :: x(:), y(:)
      !> Closing (n) [m/Pa]
      real(wp), intent(out), contiguous :: displacement(:)
    end subroutine influence_closing

    !> Return a property of the lattice.
    pure logical function influence_is(self)
      import :: influence_t
      class(influence_t), intent(in) :: self
    end function influence_is

    !> Compute the blocks at all frequencies with the same first index, those of odd blocks over i.
    pure subroutine symbols_column(self, f, block)
      import :: block_symbols_t, wp
      class(block_symbols_t), intent(in) :: self
      !> First index, from 0 to half the number of columns
      integer, intent(in) :: f
      !> That of the pressure or all (0:number of rows - 1, 1 or n_block); 0 at frequency zero: from the mean plane [m/Pa]
      real(wp), intent(out), contiguous :: block(0:, :)
    end subroutine symbols_column

    !> Set up the transform of the displacements by a pyramid, on a window that repeats.
    subroutine medium_block_symbols(self, basis, length, n, symbols)
      import :: elastic_medium_t, block_symbols_t, wp
      class(elastic_medium_t), intent(in) :: self
      !> Basis vectors of the lattice as columns [m]
      real(wp), intent(in) :: basis(2, 2)
      !> Number of columns and rows of the window
      integer, intent(in) :: length(2)
      !> Number of blocks: 1, of the pressure, or all
      integer, intent(in) :: n
      !> The transform, without that of springs
      class(block_symbols_t), allocatable, intent(out) :: symbols
    end subroutine medium_block_symbols

    !> Refuse constants that no two elastic bodies have.
    pure subroutine medium_check(self, error)
      import :: elastic_medium_t, error_t
      class(elastic_medium_t), intent(in) :: self
      !> Allocated on failure: the bodies would gain energy as they deform
      type(error_t), allocatable, intent(out) :: error
    end subroutine medium_check

    !> Return a compliance for a length.
    pure real(wp) function medium_at(self, length)
      import :: elastic_medium_t, wp
      class(elastic_medium_t), intent(in) :: self
      !> Length [m]
      real(wp), intent(in) :: length
    end function medium_at

    !> Return the same bodies in units of a length and of the displacement `unit` of it.
    subroutine medium_reduce(self, length, reduced)
      import :: elastic_medium_t, wp
      class(elastic_medium_t), intent(in) :: self
      !> Unit of length [m]
      real(wp), intent(in) :: length
      !> The bodies, without springs between them
      class(elastic_medium_t), allocatable, intent(out) :: reduced
    end subroutine medium_reduce

    !> Set up the displacements by a pyramid of a lattice.
    subroutine medium_influence(self, basis, influence)
      import :: elastic_medium_t, influence_t, wp
      class(elastic_medium_t), intent(in) :: self
      !> Basis vectors of the lattice as columns [m]
      real(wp), intent(in) :: basis(2, 2)
      !> Displacements, without those of springs
      class(influence_t), allocatable, intent(out) :: influence
    end subroutine medium_influence

    !> Compute the transform of even blocks at frequencies of a periodic grid.
    pure subroutine medium_symbols(self, basis, length, frequency, symbol)
      import :: elastic_medium_t, wp
      class(elastic_medium_t), intent(in) :: self
      !> Basis vectors of the lattice as columns [m]
      real(wp), intent(in) :: basis(2, 2)
      !> Number of columns and rows of the grid
      integer, intent(in) :: length(2)
      !> Frequency indices (2, n), from 0 to length - 1
      integer, intent(in) :: frequency(:, :)
      !> That of the pressure (n, 1), or xx, xy, yy (n, 3) [m/Pa]
      real(wp), intent(out), contiguous :: symbol(:, :)
    end subroutine medium_symbols

    !> Return the numbers that blocks depend on, the first one the name of the medium; 0 where no block of the kind does.
    pure function medium_words(self, normal, tangential) result(word)
      import :: elastic_medium_t, int64, n_word
      class(elastic_medium_t), intent(in) :: self
      !> The spectra have the block of the pressure; those of shear tractions. Both: all blocks
      logical, intent(in) :: normal, tangential
      integer(int64) :: word(n_word)
    end function medium_words

    !> Return a number without a unit.
    pure real(wp) function medium_number(self)
      import :: elastic_medium_t, wp
      class(elastic_medium_t), intent(in) :: self
    end function medium_number
  end interface

contains

  !> Return the sum of the blocks xx and yy over that of the pressure: 0, not the same at all distances.
  pure real(wp) function trace(self)
    class(elastic_medium_t), intent(in) :: self
    trace = 0.0_wp
  end function trace

  !> Return the compliance of springs between the bodies: 0, none [m/Pa].
  pure real(wp) function spring_compliance(self)
    class(elastic_medium_t), intent(in) :: self
    spring_compliance = 0.0_wp
  end function spring_compliance

  !> Return the mean displacement by a uniform shear traction of one: that of the springs, from the mean planes of half-spaces
  !> [m/Pa].
  pure real(wp) function mean_compliance(self)
    class(elastic_medium_t), intent(in) :: self
    mean_compliance = self%spring_compliance()
  end function mean_compliance

  !> Return whether pressure and shear traction move each other.
  pure logical function couples(self)
    class(elastic_medium_t), intent(in) :: self
    couples = abs(self%coupling()) > 0.0_wp
  end function couples

  !> Bound the displacement by a point load times the distance [1/Pa].
  pure real(wp) function largest_point(self, length)
    class(elastic_medium_t), intent(in) :: self
    !> Distance [m]
    real(wp), intent(in) :: length

    associate (normal => self%normal_point(length))
      largest_point = max(normal, self%shear_point(length)) + abs(self%coupling())*normal
    end associate
  end function largest_point

  !> Compute the approach by a flat punch, as large as on half-spaces with the same point loads at its radius [m].
  pure real(wp) function punch_approach(self, load, radius)
    class(elastic_medium_t), intent(in) :: self
    !> Load [N], radius [m]
    real(wp), intent(in) :: load, radius

    punch_approach = 0.5_wp*pi*self%normal_point(radius)*load/radius
  end function punch_approach

end module hc_elastic_medium
