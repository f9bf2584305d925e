!> Spectra of kernels that several problems may share, and their parameters.
module hc_spectrum
  use, intrinsic :: iso_fortran_env, only: int64
  use hc_precision, only: wp, sp
  use hc_lock, only: lock, unlock, spectrum_users
  use hc_lattice, only: lattice_t
  use hc_elastic_medium, only: elastic_medium_t, n_word
  implicit none
  private

  public :: kernel_spectrum_t, kernel_key_t, new_kernel_key, new_depth_key, release
  public :: of_pressure, of_all_tractions, of_tractions_rounded, of_pressure_rounded, inverse_of_pressure, inverse_of_shear
  public :: of_stress, of_displacement, kind_name, key_length

  !> Transformed kernels: the kernel of the pressure, those of all blocks, that of the pressure in single
  !> precision, the inverses that precondition, those of stress and displacement at a
  !> depth, and those of all blocks in single precision.
  integer, parameter :: of_pressure = 1, of_all_tractions = 2, of_pressure_rounded = 3, &
    inverse_of_pressure = 4, inverse_of_shear = 5, of_stress = 6, of_displacement = 7, of_tractions_rounded = 8
  character(len=*), parameter :: kind_name(8) = &
    [character(len=16) :: 'pressure', 'tractions', 'pressure-single', 'inverse', 'shear-inverse', 'stress', 'displacement', &
     'tractions-single']

  !> Words of a key.
  integer, parameter :: key_length = 8 + n_word

  !> Everything that the numbers of a spectrum depend on, to the bit.
  type :: kernel_key_t
    !> Kind, columns and rows of the window, below zero where it repeats, basis over its spacing, words of the medium, compliance of
    !> springs over its unit;
    !> of stress and displacement, instead of the last ones, depth over spacing and Poisson's ratio
    integer(int64) :: word(key_length) = 0
  contains
    !> Return whether two keys are equal
    procedure :: is_same
  end type kernel_key_t

  !> Spectra with a count of their users, of whom the last one frees them; constant once they are shared.
  type :: kernel_spectrum_t
    !> Spectra (frequency, block, kernel), in one of the precisions
    real(wp), allocatable :: double(:, :, :)
    real(sp), allocatable :: single(:, :, :)
    integer, private :: users = 1
  contains
    !> Count one user more
    procedure :: retain
    !> Bytes of the values
    procedure :: bytes
    !> Point to the values, if they have the precision and the shape
    generic :: point => point_double, point_single
    procedure, private :: point_double, point_single
    !> Allocate values and point to them
    generic :: reserve => reserve_double, reserve_single
    procedure, private :: reserve_double, reserve_single
  end type kernel_spectrum_t

contains

  !> Compute the key of the spectra of a kind, on a window.
  type(kernel_key_t) function new_kernel_key(kind, lattice, medium) result(key)
    !> One of the kinds above
    integer, intent(in) :: kind
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    class(elastic_medium_t), allocatable :: reduced

    call medium%reduce(lattice%spacing(), reduced)
    key%word(1) = kind
    key%word(2:3) = merge(-lattice%extent, lattice%extent, lattice%periodic)
    key%word(4:7) = transfer(lattice%unit_basis(), key%word, 4)
    key%word(8:7 + n_word) = reduced%key_words(normal=kind /= inverse_of_shear, &
                                               tangential=any(kind == [of_all_tractions, of_tractions_rounded, inverse_of_shear]))
    if (kind == inverse_of_shear) key%word(key_length) = &
      transfer(medium%spring_compliance()/medium%unit(lattice%spacing()), key%word(1))
  end function new_kernel_key

  !> Compute the key of the spectra of stress or displacement at a depth.
  pure type(kernel_key_t) function new_depth_key(kind, lattice, depth, poisson_ratio) result(key)
    !> of_stress or of_displacement
    integer, intent(in) :: kind
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Depth over the longest edge, Poisson's ratio of the body
    real(wp), intent(in) :: depth, poisson_ratio

    key%word(1) = kind
    key%word(2:3) = lattice%extent
    key%word(4:7) = transfer(lattice%unit_basis(), key%word, 4)
    key%word(8:9) = transfer([depth, poisson_ratio], key%word, 2)
  end function new_depth_key

  !> Return whether two keys are equal.
  pure logical function is_same(self, other)
    class(kernel_key_t), intent(in) :: self, other
    is_same = all(self%word == other%word)
  end function is_same

  !> Count one user more.
  subroutine retain(self)
    class(kernel_spectrum_t), intent(inout) :: self

    call lock(spectrum_users)
    self%users = self%users + 1
    call unlock(spectrum_users)
  end subroutine retain

  !> Count one user less; the last one frees the memory.
  subroutine release(spectrum)
    !> Spectra of the caller; not associated afterwards
    type(kernel_spectrum_t), pointer, intent(inout) :: spectrum
    integer :: left

    if (.not. associated(spectrum)) return
    call lock(spectrum_users)
    spectrum%users = spectrum%users - 1
    left = spectrum%users
    call unlock(spectrum_users)
    if (left == 0) deallocate (spectrum)
    spectrum => null()
  end subroutine release

  !> Count the bytes of the values.
  pure integer(int64) function bytes(self)
    class(kernel_spectrum_t), intent(in) :: self

    bytes = 0
    if (allocated(self%double)) bytes = bytes + size(self%double, kind=int64)*(storage_size(self%double)/8)
    if (allocated(self%single)) bytes = bytes + size(self%single, kind=int64)*(storage_size(self%single)/8)
  end function bytes

  !> Point to the values in double precision.
  subroutine point_double(self, n, values)
    class(kernel_spectrum_t), intent(in), target :: self
    integer, intent(in) :: n(3)
    real(wp), pointer, contiguous, intent(out) :: values(:, :, :)

    values => null()
    if (.not. allocated(self%double)) return
    if (all(shape(self%double) == n)) values => self%double
  end subroutine point_double

  !> Point to the values in single precision.
  subroutine point_single(self, n, values)
    class(kernel_spectrum_t), intent(in), target :: self
    integer, intent(in) :: n(3)
    real(sp), pointer, contiguous, intent(out) :: values(:, :, :)

    values => null()
    if (.not. allocated(self%single)) return
    if (all(shape(self%single) == n)) values => self%single
  end subroutine point_single

  !> Allocate values in double precision, zero.
  subroutine reserve_double(self, n, values, stat)
    class(kernel_spectrum_t), intent(inout), target :: self
    integer, intent(in) :: n(3)
    real(wp), pointer, contiguous, intent(out) :: values(:, :, :)
    !> Not zero: not enough memory
    integer, intent(out) :: stat

    values => null()
    allocate (self%double(n(1), n(2), n(3)), stat=stat)
    if (stat == 0) values => self%double
  end subroutine reserve_double

  !> Allocate values in single precision, zero.
  subroutine reserve_single(self, n, values, stat)
    class(kernel_spectrum_t), intent(inout), target :: self
    integer, intent(in) :: n(3)
    real(sp), pointer, contiguous, intent(out) :: values(:, :, :)
    !> Not zero: not enough memory
    integer, intent(out) :: stat

    values => null()
    allocate (self%single(n(1), n(2), n(3)), stat=stat)
    if (stat == 0) values => self%single
  end subroutine reserve_single

end module hc_spectrum
