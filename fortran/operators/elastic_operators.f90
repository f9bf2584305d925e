!> Operator and preconditioners of a contact with friction, on vectors, and the work they do.
!>
!> A field with several components is one vector, one component after the other.
module hc_elastic_operators
  use hc_precision, only: wp, sp
  use hc_error, only: error_t
  use hc_lattice, only: lattice_t
  use hc_field_space, only: field_space_t
  use hc_elastic_pair, only: elastic_pair_t
  use hc_flexibility_fft, only: fft_flexibility_t, new_fft_flexibility, fft_memory
  use hc_symbol_preconditioner, only: symbol_preconditioner_t, new_symbol_preconditioner, preconditioner_memory
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_preconditioner_extension, only: edge_extension_t
  implicit none
  private

  public :: operators_t, new_operators, operators_memory

  !> Operator and preconditioners over one window, and the work they did.
  type :: operators_t
    type(fft_flexibility_t) :: flexibility
    type(symbol_preconditioner_t) :: normal, tangential
    !> Space of the fields
    type(field_space_t) :: space
    !> Work of the preconditioners, in applications of the full operator
    real(wp) :: preconditioning = 0.0_wp
  contains
    !> Displacements that given components of the traction cause along others
    procedure :: apply => apply_operators
    !> The preconditioners, on vectors
    procedure :: precondition_pressure, precondition_shear
    !> All work so far, in applications of the full operator
    procedure :: work
  end type operators_t

contains

  !> Operator and preconditioners over a window.
  subroutine new_operators(self, lattice, pair, space, error, cache)
    !> Operators to be set up
    type(operators_t), intent(out) :: self
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Elastic constants of the two bodies
    type(elastic_pair_t), intent(in) :: pair
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Spectra that are kept
    type(kernel_cache_t), pointer, intent(in), optional :: cache

    call new_fft_flexibility(self%flexibility, lattice, pair, error, space=space, cache=cache)
    if (allocated(error)) return
    call new_symbol_preconditioner(self%normal, lattice, pair, space, error, cache=cache)
    if (allocated(error)) return
    call new_symbol_preconditioner(self%tangential, lattice, pair, space, error, tangential=.true., cache=cache)
    self%space = space
  end subroutine new_operators

  !> Bytes that operator and preconditioners take, for a window of the given size.
  pure integer(selected_int_kind(18)) function operators_memory(extent, threads)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Threads to use
    integer, intent(in) :: threads

    operators_memory = fft_memory(extent, .false., threads) + preconditioner_memory(extent, threads, .false.) &
                       + preconditioner_memory(extent, threads, .true.)
  end function operators_memory

  !> A product of some components, on vectors.
  subroutine apply_operators(self, from, traction, onto, displacement, error)
    class(operators_t), intent(inout) :: self
    !> Components that act: normal, along_x, along_y
    integer, intent(in) :: from(:)
    !> Their values, one after the other [Pa]
    real(wp), intent(in), contiguous, target :: traction(:)
    !> Components that are wanted
    integer, intent(in) :: onto(:)
    !> Their values, one after the other [m]
    real(wp), intent(out), contiguous, target :: displacement(:)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), pointer, contiguous :: acting(:, :, :), wanted(:, :, :)

    associate (n => self%flexibility%lattice%extent)
      acting(1:n(1), 1:n(2), 1:size(from)) => traction
      wanted(1:n(1), 1:n(2), 1:size(onto)) => displacement
    end associate
    call self%flexibility%apply(from, acting, onto, wanted, error)
  end subroutine apply_operators

  pure real(wp) function work(self)
    class(operators_t), intent(in) :: self
    work = self%flexibility%applications + self%preconditioning
  end function work

  !> Apply the preconditioner of the pressure to vectors, and count it.
  subroutine precondition_pressure(self, edge, displacement, pressure)
    class(operators_t), intent(inout) :: self
    !> Continuation beyond the contact
    type(edge_extension_t), intent(in) :: edge
    !> Closing of the gap, zero off the contact (n) [m]
    real(wp), intent(in), contiguous, target :: displacement(:)
    !> Pressure that causes it, about; of use in the contact only (n) [Pa]
    real(wp), intent(out), contiguous, target :: pressure(:)
    real(wp), pointer, contiguous :: given(:, :, :), wanted(:, :, :)

    associate (n => self%flexibility%lattice%extent)
      given(1:n(1), 1:n(2), 1:1) => displacement
      wanted(1:n(1), 1:n(2), 1:1) => pressure
    end associate
    call self%normal%apply(given, wanted, edge)
    self%preconditioning = self%preconditioning + self%normal%cost
  end subroutine precondition_pressure

  !> Apply the tangential preconditioner to vectors in single precision, and count it.
  subroutine precondition_shear(self, edge, on_springs, displacement, traction)
    class(operators_t), intent(inout) :: self
    !> Continuation beyond the contact, where nodes on soft springs play no part
    type(edge_extension_t), intent(in) :: edge
    !> Displacements of nodes on soft springs
    logical, intent(in) :: on_springs
    !> Tangential displacement over the unit of the preconditioner, and the traction (2 n) [Pa]
    real(sp), intent(inout), contiguous, target :: displacement(:)
    real(sp), intent(out), contiguous, target :: traction(:)
    real(sp), pointer, contiguous :: given(:, :, :), wanted(:, :, :)

    associate (n => self%flexibility%lattice%extent)
      given(1:n(1), 1:n(2), 1:2) => displacement
      wanted(1:n(1), 1:n(2), 1:2) => traction
    end associate
    if (on_springs) then
      call self%tangential%apply_single(given, wanted, on_springs=.true.)
    else
      call self%tangential%apply_single(given, wanted, edge)
    end if
    self%preconditioning = self%preconditioning + self%tangential%cost
  end subroutine precondition_shear

end module hc_elastic_operators
