!> Fourier preconditioner: the inverse of the lattice symbol on a small periodic grid.
!>
!> The grid is that of the window, or the next of a fast length, instead of twice
!> as large, so that one application costs about a quarter of a product. It is symmetric
!> and positive definite, also when it is restricted to a set of nodes.
!>
!> Equations: docs/theory/preconditioner.md, (P1), (P4), (P7).
module hc_inverse_symbol
  use, intrinsic :: iso_c_binding, only: c_ptr
  use, intrinsic :: iso_fortran_env, only: int64
  use hc_precision, only: wp, sp, lk
  use hc_error, only: error_t
  use hc_options, only: preconditioner_options_t
  use hc_lattice, only: lattice_t
  use hc_pyramid_influence, only: equivalent_spacing
  use hc_field_space, only: field_space_t
  use hc_elastic_medium, only: elastic_medium_t, influence_t
  use hc_flexibility, only: transform_length
  use hc_fftw, only: good_size
  use hc_convolution_single, only: convolution_t, new_convolution
  use hc_fft_layout_single, only: convolution_memory
  use hc_spectrum, only: kernel_key_t, new_kernel_key, inverse_of_pressure, inverse_of_shear
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_edge_continuation, only: edge_extension_t
  implicit none
  private

  public :: inverse_symbol_t, new_inverse_symbol, preconditioner_memory, node_compliance

  !> A transform in single precision moves half of the bytes, and is counted as half of one.
  real(wp), parameter, public :: single_cost = 0.5_wp

  !> Blocks (onto, from) of the symmetric inverse.
  integer, parameter :: normal_block(1, 1) = 1, tangential_block(2, 2) = reshape([1, 2, 2, 3], [2, 2])
  !> Excess over the stiffest spring below which a spring counts as equal to it, over t of (P7): single precision
  real(wp), parameter :: negligible = 1.0e-3_wp
  !> Kernels of the tangential inverse.
  integer, parameter :: n_tangential = 3

  !> Approximate inverse of the normal or of the tangential flexibility.
  type :: inverse_symbol_t
    type(convolution_t), private :: convolution
    !> Displacement per traction that the single precision numbers are scaled with [m/Pa]
    real(wp) :: unit = 1.0_wp
    !> Displacement of a node by its own pyramid, d_n [m/Pa]
    real(wp), private :: self_compliance = 0.0_wp
    !> Of the tangential flexibility
    logical, private :: tangential = .false.
    !> Columns, rows of this rank and components of the fields; columns and rows of the window
    integer, private :: shape(3) = 0, extent(2) = 0
    !> Lengths of the transforms
    integer, private :: length(2) = 0
    !> Cost of one application in applications of the full flexibility operator
    real(wp) :: cost = 0.0_wp
    !> On springs along the normal: the inverse symbol; the share of a displacement that each node passes on to it, and the
    !> stiffness of the rest (n)
    type(convolution_t), allocatable, private :: sprung
    real(sp), allocatable, private :: share(:), stiffness(:)
    !> Compliance from which on springs count as loose [m/Pa]; height of the continuation beyond those that do not
    real(wp), private :: loose = 0.0_wp
    real(sp), private :: height = 1.0_sp
  contains
    !> Put the nodes on springs along the normal
    procedure :: set_springs
    !> Return whether springs count as loose
    procedure :: is_loose
    !> Traction that causes a given displacement, approximately, in its place, and memory for it
    procedure :: apply_in_place, beside
  end type inverse_symbol_t

contains

  !> Make plans and inverse symbol over a window.
  subroutine new_inverse_symbol(self, lattice, medium, space, error, tangential, cache, beside)
    !> Preconditioner to be set up
    type(inverse_symbol_t), intent(out) :: self
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> For shear tractions instead of the pressure
    logical, intent(in), optional :: tangential
    !> Cache of spectra
    type(kernel_cache_t), pointer, intent(in), optional :: cache
    !> Bytes that `beside` gives; absent: none
    integer(int64), intent(in), optional :: beside

    type(kernel_key_t) :: key
    integer, allocatable :: f(:, :)
    integer :: length(2), b, i, n_component
    real(wp) :: scale, layer, own(1)
    real(wp), allocatable :: symbol(:, :)
    class(elastic_medium_t), allocatable :: reduced
    class(influence_t), allocatable :: influence
    logical :: found

    if (present(tangential)) self%tangential = tangential
    n_component = merge(2, 1, self%tangential)
    self%shape = [space%own_extent(lattice%extent), n_component]
    self%extent = lattice%extent
    length = good_size(lattice%extent)
    if (lattice%is_periodic()) length = lattice%extent
    self%length = length
    call new_convolution(self%convolution, lattice%extent, length, [merge(n_tangential, 1, self%tangential), 0], n_component, &
                         space, error, beside=beside)
    if (allocated(error)) return
    self%unit = medium%unit(lattice%spacing())
    call medium%reduce(lattice%spacing(), reduced)
    call reduced%new_influence(lattice%unit_basis(), influence)
    call influence%closing([0.0_wp], [0.0_wp], own)
    ! to three decimals: a preconditioner needs no more
    self%self_compliance = self%unit*(anint(1.0e3_wp*own(1))/1.0e3_wp)
    self%cost = single_cost*n_component*product(real(length, wp))/product(real(transform_length(lattice), wp))/3.0_wp
    key = new_kernel_key(merge(inverse_of_shear, inverse_of_pressure, self%tangential), lattice, medium)
    call self%convolution%find_spectra(found, error, cache, key)
    if (found .or. allocated(error)) return
    layer = medium%spring_compliance()/self%unit
    scale = 1.0_wp/product(real(length, wp))
    !$omp parallel do num_threads(self%convolution%space%threads) private(f, i, symbol)
    do b = 1, self%convolution%n_block
      f = self%convolution%frequencies(b)
      ! beyond length/2 there is mere filling
      where (f(1, :) > length(1)/2) f(1, :) = min(1, length(1) - 1)
      allocate (symbol(size(f, 2), size(self%convolution%spectrum, 3)))
      call reduced%find_symbols(lattice%unit_basis(), length, f, symbol)
      if (.not. self%tangential) then
        self%convolution%spectrum(:, b, 1) = real(scale/symbol(:, 1), sp)
      else
        symbol(:, [1, 3]) = symbol(:, [1, 3]) + layer
        do i = 1, size(f, 2)
          self%convolution%spectrum(i, b, :) = real(scale*inverse(symbol(i, :)), sp)
        end do
      end if
      deallocate (symbol)
    end do
    !$omp end parallel do
    call self%convolution%store_spectra(cache, key)
  end subroutine new_inverse_symbol

  !> Invert a symmetric matrix.
  pure function inverse(matrix)
    !> Elements xx, xy and yy
    real(wp), intent(in) :: matrix(3)
    real(wp) :: inverse(3)
    inverse = [matrix(3), -matrix(2), matrix(1)]/(matrix(1)*matrix(3) - matrix(2)**2)
  end function inverse

  !> Count the bytes that the preconditioner takes, for a window of the given size.
  pure integer(selected_int_kind(18)) function preconditioner_memory(extent, threads, tangential, shared)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Threads to use
    integer, intent(in) :: threads
    !> For shear tractions instead of the pressure
    logical, intent(in) :: tangential
    !> Row transforms share the memory of others; absent: they have their own
    logical, intent(in), optional :: shared
    integer :: n_component

    n_component = merge(2, 1, tangential)
    if (present(shared)) n_component = merge(0, n_component, shared)
    preconditioner_memory = convolution_memory(extent, good_size(extent), merge(n_tangential, 1, tangential), n_component, &
                                               threads)
  end function preconditioner_memory

  !> Estimate the traction that causes a given displacement, in its place and in any units of ratio `unit`.
  subroutine apply_in_place(self, values, edge)
    class(inverse_symbol_t), intent(inout) :: self
    !> Closing of the gap, or tangential displacements; then pressure, or shear tractions (n_col, n_row, 1 or 2)
    real(sp), intent(inout), target :: values(self%shape(1), self%shape(2), self%shape(3))
    !> Continuation beyond the nodes where displacements are given
    type(edge_extension_t), intent(in), optional :: edge
    real(sp), pointer, contiguous :: field(:)
    integer :: m

    if (allocated(self%sprung)) then
      field(1:size(values)) => values
      call apply_on_springs(self, field, edge)
      return
    end if
    if (present(edge)) then
      do m = 1, size(values, 3)
        field(1:size(values, 1)*size(values, 2)) => values(:, :, m)
        call edge%extend(field)
      end do
    end if
    if (self%tangential) then
      call self%convolution%convolve_in_place(tangential_block, values)
    else
      call self%convolution%convolve_in_place(normal_block, values)
    end if
    if (.not. present(edge)) return
    do m = 1, size(values, 3)
      field(1:size(values, 1)*size(values, 2)) => values(:, :, m)
      call edge%fold(field)
    end do
  end subroutine apply_in_place

  !> Return the address of memory that other convolutions of the same scratch use, too.
  type(c_ptr) function beside(self)
    class(inverse_symbol_t), intent(in) :: self

    beside = self%convolution%beside()
  end function beside

  !> Put the nodes on springs along the normal, of a compliant interface, (P7).
  subroutine set_springs(self, options, compliance, active)
    class(inverse_symbol_t), intent(inout) :: self
    !> Tuning numbers
    type(preconditioner_options_t), intent(in) :: options
    !> Compliance of each spring (n) [m/Pa]
    real(wp), intent(in), contiguous :: compliance(:)
    !> Active nodes (n)
    logical(lk), intent(in), contiguous :: active(:)
    type(error_t), allocatable :: error
    real(wp) :: stiffest, elastic, softer
    real(sp) :: stretch
    logical :: found
    integer :: block, i

    self%loose = 0.0_wp
    if (self%convolution%space%count(logical(active .and. compliance > 0.0_wp, lk)) == 0) return
    if (.not. allocated(self%sprung)) then
      allocate (self%sprung, self%share(size(compliance)), self%stiffness(size(compliance)))
      call new_convolution(self%sprung, self%extent, self%length, [1, 0], 1, self%convolution%space, error)
      if (.not. allocated(error)) call self%sprung%find_spectra(found, error)
      if (allocated(error)) then
        ! without memory for it: the symbol without springs still is a preconditioner
        deallocate (self%sprung, self%share, self%stiffness)
        return
      end if
    end if
    stiffest = self%convolution%space%min(compliance, logical(active .and. compliance > 0.0_wp, lk))
    elastic = options%wave_of_nodes*self%self_compliance + options%wave_of_springs*stiffest
    self%loose = max(self%self_compliance, (1.0_wp + negligible)*stiffest)
    self%height = real(self%self_compliance/(self%self_compliance + stiffest), sp)
    ! the spectrum is the inverse of the symbol over the number of frequencies
    stretch = real(stiffest/self%unit*product(real(self%length, wp)), sp)
    !$omp parallel do schedule(static) num_threads(self%convolution%space%threads)
    do block = 1, self%sprung%n_block
      associate (stiffness => self%convolution%spectrum(:, block, 1))
        self%sprung%spectrum(:, block, 1) = stiffness/(1.0_sp + stretch*stiffness)
      end associate
    end do
    !$omp end parallel do
    !$omp parallel do schedule(static) num_threads(self%convolution%space%threads) private(softer)
    do i = 1, size(compliance)
      self%share(i) = 0.0_sp
      self%stiffness(i) = 0.0_sp
      if (.not. active(i)) cycle
      softer = max(compliance(i) - stiffest, 0.0_wp)
      self%share(i) = real((elastic + stiffest)/(elastic + stiffest + softer), sp)
      if (softer > negligible*elastic) self%stiffness(i) = real(self%unit/softer, sp)
    end do
    !$omp end parallel do
  end subroutine set_springs

  !> Return whether springs count as loose: the continuation of displacements begins at the others.
  elemental logical function is_loose(self, compliance)
    class(inverse_symbol_t), intent(in) :: self
    !> Compliance of a spring [m/Pa]
    real(wp), intent(in) :: compliance

    is_loose = compliance > self%loose
  end function is_loose

  !> Apply the inverse for nodes on springs along the normal.
  subroutine apply_on_springs(self, values, edge)
    class(inverse_symbol_t), intent(inout) :: self
    !> Closing of the gap, then pressure (n)
    real(sp), intent(inout), contiguous :: values(:)
    !> Continuation beyond the nodes where displacements are given
    type(edge_extension_t), intent(in), optional :: edge
    real(sp), allocatable, target :: passed(:), traction(:)
    real(sp), pointer, contiguous :: from(:, :, :), onto(:, :, :)

    allocate (passed(size(values)), traction(size(values)))
    passed = self%share*values
    if (present(edge)) call edge%extend(passed, self%share, self%height)
    from(1:self%shape(1), 1:self%shape(2), 1:1) => passed
    onto(1:self%shape(1), 1:self%shape(2), 1:1) => traction
    call self%sprung%convolve(normal_block, from, onto)
    passed = self%stiffness*(values - passed)
    traction = traction - passed
    if (present(edge)) call edge%fold(traction, self%share, self%height)
    values = self%share*traction + passed
  end subroutine apply_on_springs

  !> Compute the compliance t_h of a node in the plane, with its spring: 2 lambda_1 (1 + gamma/2) l_e on half-spaces [m/Pa],
  !> l_e of the equilateral cells with the same K1 at the node.
  pure real(wp) function node_compliance(lattice, medium)
    !> Lattice
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium

    associate (length => equivalent_spacing(lattice%basis))
      node_compliance = 2.0_wp*medium%shear_ratio()*medium%normal_point(length)*length + medium%spring_compliance()
    end associate
  end function node_compliance

end module hc_inverse_symbol
