!> A frictionless contact problem on one lattice, with its operators.
!>
!> Corrections are multiplied in single precision, in units of displacement and pressure
!> whose ratio is that of the preconditioner; the exact operator is there where it is wanted.
module hc_normal_lattice
  use hc_precision, only: wp, sp
  use hc_error, only: error_t
  use hc_options, only: options_t
  use hc_lattice, only: lattice_t
  use hc_field_space, only: field_space_t
  use hc_elastic_pair, only: elastic_pair_t
  use hc_flexibility, only: normal
  use hc_fftw, only: good_size
  use hc_flexibility_fft, only: fft_flexibility_t, new_fft_flexibility
  use hc_pressure_kernel, only: normal_kernel_t
  use hc_spectrum, only: kernel_key_t, new_kernel_key, of_pressure_rounded
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_convolution_single, only: convolution_t, new_convolution, kernel_source_t
  use hc_contact_state, only: contact_state_t
  use hc_contact_residuals, only: conclude, normal_self_compliance
  use hc_symbol_preconditioner, only: symbol_preconditioner_t, new_symbol_preconditioner, single_cost
  use hc_preconditioner_extension, only: edge_extension_t
  implicit none
  private

  public :: normal_lattice_t

  !> The problem on one lattice.
  type :: normal_lattice_t
    type(lattice_t) :: lattice
    !> Initial gap (n_col, n_row) [m]
    real(wp), allocatable :: initial_gap(:, :)
    !> Nodes that may come into contact (n_col, n_row)
    logical, allocatable :: candidate(:, :)
    type(elastic_pair_t) :: pair
    type(options_t) :: options
    type(symbol_preconditioner_t) :: preconditioner
    !> The flexibility in single precision, in the unit of the preconditioner
    type(convolution_t) :: single
    !> The flexibility in double precision; is it there, and is the rest?
    type(fft_flexibility_t) :: flexibility
    logical :: exact = .false., iterating = .false.
    !> Self-compliance of a node [m/Pa]
    real(wp) :: compliance = 0.0_wp
    !> Work in single precision, in applications of the full operator
    real(wp) :: single_work = 0.0_wp
    !> Space of the fields
    type(field_space_t) :: space
  contains
    !> Operators
    procedure :: prepare
    !> Gap, zones, load and residuals of a given pressure
    procedure :: conclude_anew
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

  !> Operators of a problem whose lattice, gap and candidates are known; those that are there are kept.
  subroutine prepare(self, pair, kernel, exact, iterating, space, error, cache)
    class(normal_lattice_t), intent(inout) :: self
    !> Elastic constants of the two bodies
    type(elastic_pair_t), intent(in) :: pair
    !> The kernel, as far as it is at hand
    type(normal_kernel_t), intent(inout), target :: kernel
    !> The operator in double precision is wanted; what iterations need is wanted
    logical, intent(in) :: exact, iterating
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Spectra that are kept
    type(kernel_cache_t), pointer, intent(in), optional :: cache
    type(rounded_kernel_t) :: rounded
    type(kernel_key_t) :: key
    logical :: found
    integer :: block

    self%pair = pair
    self%compliance = normal_self_compliance(self%lattice, pair)
    self%space = space
    if (exact .and. .not. self%exact) then
      call new_fft_flexibility(self%flexibility, self%lattice, pair, error, normal_only=.true., space=space, &
                               kernel=kernel, cache=cache)
      if (allocated(error)) return
      self%exact = .true.
    end if
    if (self%iterating .or. .not. iterating) return
    call new_symbol_preconditioner(self%preconditioner, self%lattice, pair, space, error, cache=cache)
    if (allocated(error)) return
    call new_convolution(self%single, self%lattice%extent, good_size(2*self%lattice%extent - 1), 1, 1, space, error)
    if (allocated(error)) return
    if (self%exact) then
      ! copied as fast as it would be found
      call self%single%take_spectra(found, error)
      if (allocated(error)) return
      !$omp parallel do schedule(static) num_threads(self%space%threads)
      do block = 1, self%single%n_block
        self%single%spectrum(:, block, 1) = real(self%flexibility%convolution%spectrum(:, block, 1), sp)
      end do
      !$omp end parallel do
    else
      key = new_kernel_key(of_pressure_rounded, self%lattice, pair)
      call self%single%take_spectra(found, error, cache, key)
      if (allocated(error)) return
      if (.not. found) then
        call kernel%cover(self%lattice, space)
        rounded%kernel => kernel
        call self%single%transform_kernels(rounded, error)
        if (allocated(error)) return
        call self%single%share_spectra(cache, key)
      end if
    end if
    self%iterating = .true.
  end subroutine prepare

  !> Gap, zones, load and residuals of a given pressure at a given approach.
  subroutine conclude_anew(self, control, target, tolerance, state, error)
    class(normal_lattice_t), intent(inout) :: self
    !> force_control or displacement_control
    integer, intent(in) :: control
    !> Normal load [N] or approach [m]
    real(wp), intent(in) :: target
    !> Bound of the residuals
    real(wp), intent(in) :: tolerance
    !> State whose pressure and approach are known
    type(contact_state_t), intent(inout) :: state
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    integer :: row

    self%flexibility%applications = 0.0_wp
    self%single_work = 0.0_wp
    call self%multiply_exactly(state%pressure, state%gap, error)
    if (allocated(error)) return
    !$omp parallel do schedule(static) num_threads(self%space%threads)
    do row = 1, size(state%gap, 2)
      state%gap(:, row) = self%initial_gap(:, row) + state%gap(:, row) - state%motion(normal)
    end do
    !$omp end parallel do
    call conclude(state, self%lattice, self%candidate, self%compliance, control, target, tolerance, self%space, error)
  end subroutine conclude_anew

  !> K d in single precision, in units of the preconditioner.
  subroutine multiply(self, d, kd)
    class(normal_lattice_t), intent(inout) :: self
    !> Pressure (n_col, n_row, 1)
    real(sp), intent(in), contiguous :: d(:, :, :)
    !> Closing of the gap (n_col, n_row, 1)
    real(sp), intent(out), contiguous :: kd(:, :, :)

    call self%single%convolve(reshape([1], [1, 1]), d, kd)
    self%single_work = self%single_work + single_cost/3.0_wp
  end subroutine multiply

  !> z = M r in single precision.
  subroutine precondition(self, edge, r, z)
    class(normal_lattice_t), intent(inout) :: self
    !> Continuation beyond the active nodes
    type(edge_extension_t), intent(in) :: edge
    !> Displacement on the active nodes (n_col, n_row, 1); changed on the rings around them
    real(sp), intent(inout), contiguous :: r(:, :, :)
    !> Pressure; of use on the active nodes only (n_col, n_row, 1)
    real(sp), intent(out), contiguous :: z(:, :, :)

    call self%preconditioner%apply_single(r, z, edge)
    self%single_work = self%single_work + self%preconditioner%cost
  end subroutine precondition

  !> w = K p in double precision.
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

  pure real(wp) function work(self)
    class(normal_lattice_t), intent(in) :: self
    work = self%flexibility%applications + self%single_work
  end function work

  pure subroutine rounded_row(self, j, k)
    class(rounded_kernel_t), intent(in) :: self
    integer, intent(in) :: j
    real(sp), intent(out) :: k(:, :)
    real(wp) :: row(size(k, 1), size(k, 2))

    call self%kernel%row(j, row)
    k = real(row, sp)
  end subroutine rounded_row

end module hc_normal_lattice
