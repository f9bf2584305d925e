!> Flexibility operator as a zero-padded convolution by FFT.
!>
!> Equations: docs/theory/discretisation.md, (D4).
module hc_flexibility_fft
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_lattice, only: lattice_t
  use hc_field_space, only: field_space_t, space_over
  use hc_elastic_medium, only: elastic_medium_t, influence_t, block_symbols_t, n_block, block_index
  use hc_flexibility, only: flexibility_t, check_operator, transform_length, padded_length, normal
  use hc_convolution, only: convolution_t, new_convolution, kernel_source_t
  use hc_fft_passes, only: complement
  use hc_fft_layout, only: convolution_memory, transform_memory
  use hc_spectrum, only: kernel_key_t, new_kernel_key, of_pressure, of_all_tractions, of_tractions_rounded
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_pressure_kernel, only: normal_kernel_t
  implicit none
  private

  public :: fft_flexibility_t, new_fft_flexibility, fft_memory, fft_setup_memory, spectra_of
  public :: of_pressure, of_all_tractions, of_tractions_rounded

  !> Blocks that have spectra, the odd ones last, where that of yy is a multiple of the normal one less that of xx.
  integer, parameter :: with_trace(5) = [1, 2, 3, 5, 6]
  !> Even blocks of all
  integer, parameter :: n_even = 4
  !> With a trace: spectrum that stands at (onto, from), negative where its sign is reversed
  integer, parameter :: spectrum_index(3, 3) = reshape([1, -4, -5, 4, 2, 3, 5, 3, complement], [3, 3])

  !> Convolution operator over a window.
  type, extends(flexibility_t) :: fft_flexibility_t
    !> Spectra of the blocks over the unit of the bodies, that of the pressure and the gap alone or all of them
    type(convolution_t) :: convolution
    !> Spectrum that stands at (onto, from), negative where its sign is reversed
    integer, private :: index(3, 3) = 0
    !> Components that the operator was set up for, and those that are multiplied together
    integer, private :: n_component = 0, at_once = 1
  contains
    procedure :: apply => fft_apply
    procedure :: replace => fft_replace
    procedure :: in_place => fft_in_place
  end type fft_flexibility_t

  !> The blocks of the operator at lattice offsets, over the unit of the bodies.
  type, extends(kernel_source_t) :: lattice_blocks_t
    class(influence_t), allocatable :: influence
    real(wp) :: basis(2, 2) = 0.0_wp
    !> Those that have spectra
    integer, allocatable :: transformed(:)
  contains
    procedure :: row => lattice_block_row
  end type lattice_blocks_t

contains

  !> Make plans and spectra of the operator over a window.
  subroutine new_fft_flexibility(operator, lattice, medium, error, kind, space, kernel, cache)
    !> Operator to be set up
    type(fft_flexibility_t), intent(out) :: operator
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> Allocated on failure: a lattice or constants of no use, not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> of_pressure: the operator is applied to the pressure alone, for the gap alone; of_tractions_rounded: it only serves for
    !> starts; absent: of_all_tractions
    integer, intent(in), optional :: kind
    !> Space of the fields; absent: as many threads as OpenMP would take
    type(field_space_t), intent(in), optional :: space
    !> With `of_pressure`: the kernel where it is known
    type(normal_kernel_t), intent(inout), optional :: kernel
    !> Cache of spectra
    type(kernel_cache_t), pointer, intent(in), optional :: cache

    type(lattice_blocks_t) :: source
    type(normal_kernel_t) :: made
    class(elastic_medium_t), allocatable :: reduced
    type(kernel_key_t) :: key
    type(field_space_t) :: shared
    integer :: n_kernel(2), spectra, i
    logical :: only_normal, found

    call check_operator(lattice, medium, error)
    if (allocated(error)) return
    shared = space_over(lattice%extent)
    if (present(space)) shared = space
    operator%space = shared
    spectra = of_all_tractions
    if (present(kind)) spectra = kind
    only_normal = spectra == of_pressure
    operator%lattice = lattice
    allocate (operator%medium, source=medium)
    operator%n_component = merge(1, 3, only_normal)
    operator%index = block_index
    source%transformed = [(i, i=1, n_block)]
    if (medium%trace() > 0.0_wp) then
      operator%index = spectrum_index
      source%transformed = with_trace
    end if
    n_kernel = [1, 0]
    if (.not. only_normal) n_kernel(1) = n_even - merge(1, 0, medium%trace() > 0.0_wp)
    if (.not. only_normal) n_kernel(2) = spectra_of(medium) - n_kernel(1)
    operator%at_once = components_at_once(sum(n_kernel))
    call new_convolution(operator%convolution, lattice%extent, transform_length(lattice), n_kernel, operator%at_once, &
                         shared, error)
    if (allocated(error)) return
    operator%convolution%factor = medium%unit(lattice%spacing())
    operator%convolution%whole = medium%trace()
    operator%convolution%rounded = spectra == of_tractions_rounded
    key = new_kernel_key(spectra, lattice, medium)
    call operator%convolution%find_spectra(found, error, cache, key)
    if (found .or. allocated(error)) return
    if (lattice%is_periodic()) then
      call set_periodic_spectra(operator%convolution, lattice, medium, source%transformed)
    else if (only_normal .and. present(kernel)) then
      call kernel%cover(lattice, medium, shared)
      call operator%convolution%transform_kernels(kernel, error)
    else if (only_normal) then
      call made%cover(lattice, medium, shared)
      call operator%convolution%transform_kernels(made, error)
    else
      source%basis = lattice%unit_basis()
      call medium%reduce(lattice%spacing(), reduced)
      call reduced%new_influence(source%basis, source%influence)
      call operator%convolution%transform_kernels(source, error)
    end if
    if (.not. allocated(error)) call operator%convolution%store_spectra(cache, key)
  end subroutine new_fft_flexibility

  !> Compute the spectra on a window that repeats, from the symbols of the blocks.
  subroutine set_periodic_spectra(convolution, lattice, medium, transformed)
    !> Convolution with spectra that are zero
    type(convolution_t), intent(inout) :: convolution
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> Blocks that may have spectra
    integer, intent(in) :: transformed(:)
    class(elastic_medium_t), allocatable :: reduced
    class(block_symbols_t), allocatable :: symbols
    real(wp), allocatable :: block(:, :)
    integer :: b, column, f, n_block_wanted, n_kernel

    n_kernel = size(convolution%spectrum, 3)
    n_block_wanted = merge(1, n_block, n_kernel == 1)
    call medium%reduce(lattice%spacing(), reduced)
    call reduced%new_block_symbols(lattice%unit_basis(), lattice%extent, n_block_wanted, symbols)
    associate (n => lattice%extent, width => convolution%width)
      !$omp parallel do schedule(dynamic) num_threads(convolution%space%threads) private(column, f, block)
      do b = 1, convolution%n_block
        allocate (block(n(2), n_block_wanted))
        do column = 1, width
          f = convolution%before + (b - 1)*width + column - 1
          if (f > n(1)/2) exit
          call symbols%column(f, block)
          convolution%spectrum((column - 1)*n(2) + 1:column*n(2), b, :) = block(:, transformed(:n_kernel))/product(real(n, wp))
        end do
        deallocate (block)
      end do
      !$omp end parallel do
    end associate
  end subroutine set_periodic_spectra

  !> Return the number of spectra of two bodies: 3 if they are alike, since the odd blocks vanish, else 5; one more without a trace.
  pure integer function spectra_of(medium)
    class(elastic_medium_t), intent(in) :: medium

    spectra_of = merge(5, 3, medium%couples()) + merge(0, 1, medium%trace() > 0.0_wp)
  end function spectra_of

  !> Count the bytes that the operator takes, for a window of the given size.
  pure integer(selected_int_kind(18)) function fft_memory(extent, normal_only, threads, n_spectrum, shared, periodic)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> The operator is applied to the pressure alone, for the gap alone
    logical, intent(in) :: normal_only
    !> Threads to use
    integer, intent(in) :: threads
    !> Number of spectra of all components; absent: the most
    integer, intent(in), optional :: n_spectrum
    !> Row transforms share the memory of others; absent: they have their own
    logical, intent(in), optional :: shared
    !> The window repeats; absent: it does not
    logical, intent(in), optional :: periodic
    integer :: n_kernel, n_component

    n_kernel = merge(1, n_block, normal_only)
    if (present(n_spectrum)) n_kernel = min(n_kernel, n_spectrum)
    n_component = components_at_once(n_kernel)
    if (present(shared)) n_component = merge(0, n_component, shared)
    fft_memory = convolution_memory(extent, padded_length(extent, periodic), n_kernel, n_component, threads)
  end function fft_memory

  !> Return the components that are multiplied together: without odd blocks, pressure and shear traction are apart.
  pure integer function components_at_once(n_kernel)
    !> Number of spectra
    integer, intent(in) :: n_kernel

    components_at_once = 1
    if (n_kernel > 1) components_at_once = merge(3, 2, n_kernel > n_even)
  end function components_at_once

  !> Count the additional bytes while the full operator is set up.
  pure integer(selected_int_kind(18)) function fft_setup_memory(extent, n_spectrum)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Number of spectra
    integer, intent(in) :: n_spectrum

    fft_setup_memory = transform_memory(extent, padded_length(extent), n_spectrum)
  end function fft_setup_memory

  !> Evaluate the blocks of the operator along a row of offsets.
  pure subroutine lattice_block_row(self, j, k)
    class(lattice_blocks_t), intent(in) :: self
    integer, intent(in) :: j
    real(wp), intent(out) :: k(:, :)
    real(wp) :: block(n_block, size(k, 2)), x(size(k, 2)), y(size(k, 2))
    integer :: i, n

    n = size(k, 2)/2
    x = [(i*self%basis(1, 1) + j*self%basis(1, 2), i=-n, n)]
    y = [(i*self%basis(2, 1) + j*self%basis(2, 2), i=-n, n)]
    call self%influence%blocks(x, y, block)
    k = block(self%transformed(:size(k, 1)), :)
  end subroutine lattice_block_row

  !> Multiply by the convolution, and add the stretch of tangential springs.
  subroutine fft_apply(self, from, traction, onto, displacement, error)
    class(fft_flexibility_t), intent(inout) :: self
    integer, intent(in) :: from(:)
    real(wp), intent(in), contiguous :: traction(:, :, :)
    integer, intent(in) :: onto(:)
    real(wp), intent(out), contiguous :: displacement(:, :, :)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: spring
    integer :: i, o

    call self%check(from, traction, onto, displacement, error)
    if (allocated(error)) return
    if (max(maxval(from), maxval(onto)) > self%n_component) then
      call raise(error, status%invalid_input, 'the operator was set up for normal contact only')
      return
    end if
    if (max(size(from), size(onto)) <= self%at_once) then
      call self%convolution%convolve(self%index(onto, from), traction, displacement)
    else if (any(from(2:) == normal) .or. any(onto(2:) == normal)) then
      call raise(error, status%invalid_input, 'of several components the pressure is the first')
      return
    else
      call apply_apart(self, from, traction, onto, displacement)
    end if
    spring = self%medium%spring_compliance()
    if (spring > 0.0_wp) then
      do i = 1, size(from)
        do o = 1, size(onto)
          if (from(i) == normal .or. onto(o) /= from(i)) cycle
          displacement(:, :, o) = displacement(:, :, o) + spring*traction(:, :, i)
        end do
      end do
    end if
    call self%count(from, onto)
  end subroutine fft_apply

  !> Multiply in the place of the tractions, unless these are needed to the end or are multiplied apart.
  subroutine fft_replace(self, components, values, error)
    class(fft_flexibility_t), intent(inout) :: self
    integer, intent(in) :: components(:)
    real(wp), intent(inout), contiguous :: values(:, :, :)
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: traction(:, :, :)

    if (size(components) > self%at_once .or. self%medium%spring_compliance() > 0.0_wp) then
      allocate (traction, source=values)
      call self%apply(components, traction, components, values, error)
      return
    end if
    call self%check(components, values, components, values, error)
    if (allocated(error)) return
    call self%convolution%convolve_in_place(self%index(components, components), values)
    call self%count(components, components)
  end subroutine fft_replace

  !> Point to the memory of the row transforms, if the components are multiplied together.
  function fft_in_place(self, n_component) result(values)
    class(fft_flexibility_t), intent(in) :: self
    integer, intent(in) :: n_component
    real(wp), pointer, contiguous :: values(:)

    values => null()
    if (n_component <= self%at_once) values => self%convolution%in_place(n_component)
  end function fft_in_place

  !> Multiply pressure and shear traction one after the other, which do not move each other; the pressure is the first component.
  subroutine apply_apart(self, from, traction, onto, displacement)
    class(fft_flexibility_t), intent(inout) :: self
    integer, intent(in) :: from(:)
    real(wp), intent(in), contiguous :: traction(:, :, :)
    integer, intent(in) :: onto(:)
    real(wp), intent(out), contiguous :: displacement(:, :, :)
    integer :: i, o

    i = merge(1, 0, from(1) == normal)
    o = merge(1, 0, onto(1) == normal)
    if (i == 0 .or. i == size(from)) displacement = 0.0_wp
    if (i*o > 0) call self%convolution%convolve(self%index(onto(:o), from(:i)), traction(:, :, :i), displacement(:, :, :o))
    if (i == size(from) .or. o == size(onto)) return
    call self%convolution%convolve(self%index(onto(o + 1:), from(i + 1:)), traction(:, :, i + 1:), displacement(:, :, o + 1:))
  end subroutine apply_apart

end module hc_flexibility_fft
