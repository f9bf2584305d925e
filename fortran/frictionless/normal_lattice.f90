!> A frictionless contact problem on one lattice, with its operators.
!>
!> Corrections are multiplied in single precision, in units of displacement and pressure
!> whose ratio is that of the preconditioner; the operator in double precision is set up on demand.
!>
!> Equations: docs/theory/normal_contact.md, (N2) to (N5).
module hc_normal_lattice
  use, intrinsic :: iso_c_binding, only: c_f_pointer
  use, intrinsic :: iso_fortran_env, only: int64
  use hc_precision, only: wp, sp
  use hc_error, only: error_t
  use hc_field_space, only: field_space_t
  use hc_flexibility, only: normal
  use hc_flexibility, only: transform_length
  use hc_flexibility_fft, only: fft_flexibility_t, new_fft_flexibility, of_pressure
  use hc_pressure_kernel, only: normal_kernel_t
  use hc_spectrum, only: kernel_key_t, new_kernel_key, of_pressure_rounded
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_convolution_single, only: convolution_t, new_convolution, kernel_source_t
  use hc_fft_layout_single, only: transform_memory
  use hc_contact_state, only: contact_state_t, load_target_t
  use hc_normal_problem, only: normal_problem_t
  use hc_inverse_symbol, only: single_cost
  use hc_preconditioner, only: preconditioner_t
  use hc_symbol_preconditioner, only: pressure_preconditioner_t, new_symbol_preconditioner
  implicit none
  private

  public :: normal_lattice_t

  !> The problem on one lattice.
  type, extends(normal_problem_t) :: normal_lattice_t
    class(preconditioner_t), allocatable :: preconditioner
    !> The flexibility in single precision, in the unit of the preconditioner
    type(convolution_t) :: single
    !> The flexibility in double precision; whether it is set up, and whether the operators of iterations are
    type(fft_flexibility_t) :: flexibility
    logical :: exact = .false., iterating = .false.
    !> Work in single precision, in applications of the full operator
    real(wp) :: single_work = 0.0_wp
  contains
    !> Operators
    procedure :: prepare
    !> Memory for fields in single precision
    procedure :: take_fields
    !> Gap, zones, load and residuals of a given pressure
    procedure :: complete_from_pressure
    !> Products in single precision, of the flexibility and of its approximate inverse, and in double precision
    procedure :: multiply, precondition, multiply_exactly
    !> Work so far, in applications of the full operator
    procedure :: work
  end type normal_lattice_t

  !> The kernel of the pressure in single precision.
  type, extends(kernel_source_t) :: rounded_kernel_t
    type(normal_kernel_t), pointer :: kernel => null()
  contains
    procedure :: row => rounded_row
  end type rounded_kernel_t

contains

  !> Set up the operators that are needed and not set up yet.
  subroutine prepare(self, kernel, exact, iterating, space, error, cache)
    class(normal_lattice_t), intent(inout) :: self
    !> The kernel, as far as it has been computed
    type(normal_kernel_t), intent(inout), target :: kernel
    !> Set up the operator in double precision; set up those of iterations
    logical, intent(in) :: exact, iterating
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Cache of spectra
    type(kernel_cache_t), pointer, intent(in), optional :: cache
    type(pressure_preconditioner_t), allocatable :: preconditioner
    type(rounded_kernel_t) :: rounded
    type(kernel_key_t) :: key
    logical :: found

    self%space = space
    ! on a window that repeats, single precision is rounded from the spectrum of the other
    if ((exact .or. self%lattice%is_periodic()) .and. .not. self%exact) then
      call new_fft_flexibility(self%flexibility, self%lattice, self%medium, error, kind=of_pressure, space=space, &
                               kernel=kernel, cache=cache)
      if (allocated(error)) return
      self%exact = .true.
    end if
    if (self%iterating .or. .not. iterating) return
    allocate (preconditioner)
    call new_symbol_preconditioner(preconditioner, self%lattice, self%medium, space, self%options%preconditioner, error, cache)
    if (allocated(error)) return
    call move_alloc(preconditioner, self%preconditioner)
    call new_convolution(self%single, self%lattice%extent, transform_length(self%lattice), [1, 0], 1, space, error, &
                         beside=before_last(self) + self%own_size()*(storage_size(1.0_sp)/8))
    if (allocated(error)) return
    if (self%exact) then
      self%single%wide => self%flexibility%convolution%spectrum(:, :, 1)
    else
      key = new_kernel_key(of_pressure_rounded, self%lattice, self%medium)
      call self%single%find_spectra(found, error, cache, key)
      if (allocated(error)) return
      if (.not. found) then
        call kernel%cover(self%lattice, self%medium, space)
        rounded%kernel => kernel
        call self%single%transform_kernels(rounded, error)
        if (allocated(error)) return
        call self%single%store_spectra(cache, key)
      end if
    end if
    self%iterating = .true.
  end subroutine prepare

  !> Count the bytes before the last of the fields of `take_fields`: its memory is beside that of products in double precision,
  !> which take twice as much as those in single precision.
  pure integer(int64) function before_last(self)
    class(normal_lattice_t), intent(in) :: self

    before_last = max(transform_memory(self%lattice%extent, transform_length(self%lattice), 1, self%space%ranks), &
                      2*int(self%own_size(), int64)*(storage_size(1.0_sp)/8))
  end function before_last

  !> Take fields from the memory of the transforms: products in double precision destroy the first two.
  subroutine take_fields(self, first, second, last)
    class(normal_lattice_t), intent(in) :: self
    !> Fields (n_col, n_row, 1)
    real(sp), pointer, contiguous, intent(out) :: first(:, :, :), second(:, :, :), last(:, :, :)
    real(sp), pointer, contiguous :: all(:)
    integer(int64) :: n, from

    n = self%own_size()
    from = before_last(self)/(storage_size(1.0_sp)/8)
    call c_f_pointer(self%single%beside(), all, [from + n])
    associate (extent => self%own_extent())
      first(1:extent(1), 1:extent(2), 1:1) => all(:n)
      second(1:extent(1), 1:extent(2), 1:1) => all(n + 1:2*n)
      last(1:extent(1), 1:extent(2), 1:1) => all(from + 1:)
    end associate
  end subroutine take_fields

  !> Compute gap, zones, load and residuals of a given pressure at a given approach.
  subroutine complete_from_pressure(self, target, tolerance, state, error)
    class(normal_lattice_t), intent(inout) :: self
    !> Normal load or approach to be reached
    type(load_target_t), intent(in) :: target
    !> Bound of the residuals
    real(wp), intent(in) :: tolerance
    !> State whose pressure and approach are known
    type(contact_state_t), intent(inout) :: state
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    self%flexibility%applications = 0.0_wp
    self%single_work = 0.0_wp
    call self%multiply_exactly(state%pressure, state%gap, error)
    if (allocated(error)) return
    call self%open_gap(state%motion(normal), state%gap)
    call self%complete_pressed(target, tolerance, state, error)
  end subroutine complete_from_pressure

  !> Compute K d in single precision, in units of the preconditioner.
  subroutine multiply(self, d, kd)
    class(normal_lattice_t), intent(inout) :: self
    !> Pressure (n_col, n_row, 1)
    real(sp), intent(in), contiguous :: d(:, :, :)
    !> Closing of the gap (n_col, n_row, 1)
    real(sp), intent(out), contiguous :: kd(:, :, :)

    call self%single%convolve(reshape([1], [1, 1]), d, kd)
    self%single_work = self%single_work + single_cost/3.0_wp
  end subroutine multiply

  !> Compute z = M r in single precision.
  subroutine precondition(self, r, z)
    class(normal_lattice_t), intent(inout) :: self
    !> Displacement on the active nodes (n_col, n_row, 1); changed on the rings around them
    real(sp), intent(inout), contiguous, target :: r(:, :, :)
    !> Pressure; of use on the active nodes only (n_col, n_row, 1)
    real(sp), intent(out), contiguous, target :: z(:, :, :)
    real(sp), pointer, contiguous :: displacement(:), traction(:)

    displacement(1:size(r)) => r
    traction(1:size(z)) => z
    call self%preconditioner%apply_single(displacement, traction, self%single_work)
  end subroutine precondition

  !> Compute w = K p in double precision.
  subroutine multiply_exactly(self, p, w, error)
    class(normal_lattice_t), intent(inout) :: self
    !> Pressure [Pa] and closing of the gap [m] (n_col, n_row)
    real(wp), intent(in), contiguous, target :: p(:, :)
    real(wp), intent(out), contiguous, target :: w(:, :)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), pointer, contiguous :: field(:, :, :), closing(:, :, :)

    field(1:size(p, 1), 1:size(p, 2), 1:1) => p
    closing(1:size(p, 1), 1:size(p, 2), 1:1) => w
    call self%flexibility%apply([normal], field, [normal], closing, error)
  end subroutine multiply_exactly

  !> Return all work so far, in applications of the full operator.
  pure real(wp) function work(self)
    class(normal_lattice_t), intent(in) :: self
    work = self%flexibility%applications + self%single_work
  end function work

  !> Copy a row in single precision.
  pure subroutine rounded_row(self, j, k)
    class(rounded_kernel_t), intent(in) :: self
    integer, intent(in) :: j
    real(sp), intent(out) :: k(:, :)
    real(wp) :: row(size(k, 1), size(k, 2))

    call self%kernel%row(j, row)
    k = real(row, sp)
  end subroutine rounded_row

end module hc_normal_lattice
