!> Two elastic half-spaces reduced to the three constants that matter in contact.
!>
!> For bodies with shear moduli G and Poisson's ratios nu (sums over both):
!>
!>     lambda_1 = sum (1 - nu)/(2 pi G) = 1/(pi E*)
!>     lambda_2 = (1 - 2 nu_1)/(4 pi G_1) - (1 - 2 nu_2)/(4 pi G_2) = beta lambda_1
!>     lambda_5 = sum nu/(2 pi G) = gamma lambda_1
!>
!> Three numbers describe any pair exactly: no averaged Poisson's ratio (Table
!> 8.2) is needed. beta is Dundurs' second constant. By the kernels of a pyramid (hc_pyramid_influence) the closing w of the gap
!> and the displacement s of body 1 over body 2 are (superposition of Table 8.1 over two bodies)
!>
!>     w   =  lambda_1 K1 * p   + lambda_2 (K_x * q_x + K_y * q_y)
!>     s_x = -lambda_2 K_x * p  + (lambda_1 K1 + lambda_5 K_xx) * q_x + lambda_5 K_xy * q_y
!>     s_y = -lambda_2 K_y * p  + lambda_5 K_xy * q_x + (lambda_1 K1 + lambda_5 K_yy) * q_y
!>
!> Equations: docs/theory/elasticity.md, (E14) to (E16); docs/theory/discretisation.md, (D4).
module hc_elastic_pair
  use, intrinsic :: iso_fortran_env, only: int64
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp, pi
  use hc_error, only: error_t, status, raise
  use hc_elastic_medium, only: elastic_medium_t, influence_t, block_symbols_t, n_word, n_block
  use hc_pyramid_influence, only: pyramid_t, new_pyramid, k_1, k_xx, k_xy, k_x, k_y
  use hc_lattice_symbol, only: lattice_symbols, symbol_1, symbol_xx, symbol_xy
  use hc_periodic_symbol, only: periodic_symbols_t, new_periodic_symbols, n_symbol
  implicit none
  private

  public :: material_t, elastic_pair_t, new_elastic_pair, find_bulk_strain, shear_modulus

  !> An isotropic elastic or a rigid material.
  type :: material_t
    !> Young's modulus [Pa]
    real(wp) :: young_modulus = 0.0_wp
    !> Poisson's ratio
    real(wp) :: poisson_ratio = 0.0_wp
    !> A rigid body: the two constants above are not used
    logical :: rigid = .false.
  end type material_t

  !> Name of the medium in keys of spectra.
  character(len=8), parameter :: name = 'halfspac'

  !> Compliance constants of a pair of bodies.
  type, extends(elastic_medium_t) :: elastic_pair_t
    !> Normal compliance, 1/(pi E*) [1/Pa]
    real(wp) :: lambda_1 = 0.0_wp
    !> Coupling of normal and tangential displacements [1/Pa]
    real(wp) :: lambda_2 = 0.0_wp
    !> Extra tangential compliance [1/Pa]
    real(wp) :: lambda_5 = 0.0_wp
    !> Displacement that springs between the bodies give way by under a unit shear traction, 1/k_T [m/Pa]
    real(wp) :: tangential_layer = 0.0_wp
  contains
    !> Effective modulus E* [Pa]
    procedure :: effective_modulus
    !> Dundurs' constant beta, and lambda_5/lambda_1
    procedure :: beta => dundurs_beta
    procedure :: gamma => tangential_gamma
    procedure :: check => check_pair
    procedure :: unit => unit_of_pair
    procedure :: reduce, new_influence, find_symbols, new_block_symbols, key_words
    procedure :: coupling => dundurs_beta
    procedure :: shear_ratio
    procedure :: normal_point => normal_compliance
    procedure :: shear_point => shear_compliance
    procedure :: trace, spring_compliance
  end type elastic_pair_t

  !> Displacements by a pyramid on two half-spaces.
  type, extends(influence_t) :: pair_influence_t
    private
    type(elastic_pair_t) :: pair
    type(pyramid_t) :: pyramid
  contains
    procedure :: blocks, closing, is_hexagonal
  end type pair_influence_t

  !> Transform of the displacements on two half-spaces, on a window that repeats.
  type, extends(block_symbols_t) :: pair_symbols_t
    private
    type(elastic_pair_t) :: pair
    type(periodic_symbols_t) :: kernels
  contains
    procedure :: column
  end type pair_symbols_t

contains

  !> Compute the compliance constants of two bodies.
  pure subroutine new_elastic_pair(pair, body_1, body_2, error)
    !> Pair to be set up
    type(elastic_pair_t), intent(out) :: pair
    !> Material of body 1 (z > 0) and of body 2 (z < 0)
    type(material_t), intent(in) :: body_1, body_2
    !> Allocated on failure: a modulus that is not positive, a Poisson's ratio
    !> outside (-1, 0.5], two rigid bodies
    type(error_t), allocatable, intent(out) :: error

    call check(body_1, 'body 1', error)
    if (allocated(error)) return
    call check(body_2, 'body 2', error)
    if (allocated(error)) return
    if (body_1%rigid .and. body_2%rigid) then
      call raise(error, status%invalid_input, 'both bodies are rigid: at least one elastic body expected')
      return
    end if
    pair%lambda_1 = normal(body_1) + normal(body_2)
    pair%lambda_2 = coupling(body_1) - coupling(body_2)
    pair%lambda_5 = tangential(body_1) + tangential(body_2)
  end subroutine new_elastic_pair

  !> Refuse constants that no two elastic bodies have, which new_elastic_pair never sets.
  pure subroutine check_pair(self, error)
    class(elastic_pair_t), intent(in) :: self
    type(error_t), allocatable, intent(out) :: error
    logical :: sound

    sound = all(ieee_is_finite([self%lambda_1, self%lambda_2, self%lambda_5]))
    if (sound) sound = self%lambda_1 > 0.0_wp .and. abs(self%lambda_2) < self%lambda_1 .and. self%lambda_5 > -self%lambda_1
    if (sound) sound = ieee_is_finite(self%tangential_layer)
    if (sound) then
      if (self%tangential_layer >= 0.0_wp) return
      call raise(error, status%invalid_input, 'tangential stiffness of the interface: a positive number expected')
      return
    end if
    call raise(error, status%invalid_input, 'the elastic constants of the pair: finite numbers with '// &
               'lambda_1 > 0, |lambda_2| < lambda_1 and lambda_5 > -lambda_1 expected')
  end subroutine check_pair

  !> Refuse elastic constants of a body that make no sense.
  pure subroutine check(body, name, error)
    type(material_t), intent(in) :: body
    character(len=*), intent(in) :: name
    type(error_t), allocatable, intent(out) :: error

    if (body%rigid) return
    ! finite first: a comparison with NaN may be trapped
    if (.not. all(ieee_is_finite([body%young_modulus, body%poisson_ratio]))) then
      call raise(error, status%invalid_input, 'the elastic constants of '//name//': finite numbers expected')
    else if (body%young_modulus <= 0.0_wp) then
      call raise(error, status%invalid_input, 'Young''s modulus of '//name//': a positive number expected')
    else if (body%poisson_ratio <= -1.0_wp .or. body%poisson_ratio > 0.5_wp) then
      call raise(error, status%invalid_input, &
                 'Poisson''s ratio of '//name//': a number above -1 and at most 0.5 expected')
    end if
  end subroutine check

  !> Find the strain of a bulk stress in the plane of the surface by Hooke's law, and the stress of a direction without strain.
  pure subroutine find_bulk_strain(body, plane_strain, stress, strain)
    !> Material of an elastic body
    type(material_t), intent(in) :: body
    !> 0: free sides (plane stress); 1, 2: no strain along x, along y
    integer, intent(in) :: plane_strain
    !> xx, yy, xy, tension positive; that along the direction without strain is set [Pa]
    real(wp), intent(inout) :: stress(3)
    !> xx, yy, xy
    real(wp), intent(out) :: strain(3)

    associate (nu => body%poisson_ratio)
      if (plane_strain == 1) stress(1) = nu*stress(2)
      if (plane_strain == 2) stress(2) = nu*stress(1)
      strain = [stress(1) - nu*stress(2), stress(2) - nu*stress(1), (1.0_wp + nu)*stress(3)]/body%young_modulus
      if (plane_strain /= 0) strain(plane_strain) = 0.0_wp ! without rounding errors
    end associate
  end subroutine find_bulk_strain

  !> Compute (1 - nu)/(2 pi G)
  elemental real(wp) function normal(body)
    type(material_t), intent(in) :: body
    normal = 0.0_wp
    if (.not. body%rigid) normal = (1.0_wp - body%poisson_ratio)/(2.0_wp*pi*shear_modulus(body))
  end function normal

  !> Compute (1 - 2 nu)/(4 pi G)
  elemental real(wp) function coupling(body)
    type(material_t), intent(in) :: body
    coupling = 0.0_wp
    if (.not. body%rigid) coupling = (1.0_wp - 2.0_wp*body%poisson_ratio)/(4.0_wp*pi*shear_modulus(body))
  end function coupling

  !> Compute nu/(2 pi G)
  elemental real(wp) function tangential(body)
    type(material_t), intent(in) :: body
    tangential = 0.0_wp
    if (.not. body%rigid) tangential = body%poisson_ratio/(2.0_wp*pi*shear_modulus(body))
  end function tangential

  !> Return the shear modulus; 0: rigid [Pa].
  elemental real(wp) function shear_modulus(body)
    type(material_t), intent(in) :: body
    shear_modulus = 0.0_wp
    if (.not. body%rigid) shear_modulus = body%young_modulus/(2.0_wp*(1.0_wp + body%poisson_ratio))
  end function shear_modulus

  !> Return E* [Pa]
  elemental real(wp) function effective_modulus(self)
    class(elastic_pair_t), intent(in) :: self
    effective_modulus = 1.0_wp/(pi*self%lambda_1)
  end function effective_modulus

  !> Return Dundurs' beta
  pure real(wp) function dundurs_beta(self)
    class(elastic_pair_t), intent(in) :: self
    dundurs_beta = self%lambda_2/self%lambda_1
  end function dundurs_beta

  !> Return gamma = lambda_5/lambda_1
  pure real(wp) function tangential_gamma(self)
    class(elastic_pair_t), intent(in) :: self
    tangential_gamma = self%lambda_5/self%lambda_1
  end function tangential_gamma

  !> Return 1 + gamma/2.
  pure real(wp) function shear_ratio(self)
    class(elastic_pair_t), intent(in) :: self
    shear_ratio = 1.0_wp + 0.5_wp*self%gamma()
  end function shear_ratio

  !> Return 2 + gamma: K_yy = K1 - K_xx.
  pure real(wp) function trace(self)
    class(elastic_pair_t), intent(in) :: self
    trace = 2.0_wp*self%shear_ratio()
  end function trace

  !> Return the compliance of the springs [m/Pa].
  pure real(wp) function spring_compliance(self)
    class(elastic_pair_t), intent(in) :: self
    spring_compliance = self%tangential_layer
  end function spring_compliance

  !> Return lambda_1 times a length [m/Pa].
  pure real(wp) function unit_of_pair(self, length)
    class(elastic_pair_t), intent(in) :: self
    real(wp), intent(in) :: length
    unit_of_pair = self%lambda_1*length
  end function unit_of_pair

  !> Return lambda_1: w = lambda_1 P/r [1/Pa].
  pure real(wp) function normal_compliance(self, length)
    class(elastic_pair_t), intent(in) :: self
    real(wp), intent(in) :: length
    normal_compliance = self%lambda_1
  end function normal_compliance

  !> Return lambda_1 + lambda_5: s_x = (lambda_1 + lambda_5) Q/x on the x axis [1/Pa].
  pure real(wp) function shear_compliance(self, length)
    class(elastic_pair_t), intent(in) :: self
    real(wp), intent(in) :: length
    shear_compliance = self%lambda_1 + self%lambda_5
  end function shear_compliance

  !> Return the pair over its lambda_1; half-spaces have no length of their own.
  subroutine reduce(self, length, reduced)
    class(elastic_pair_t), intent(in) :: self
    real(wp), intent(in) :: length
    class(elastic_medium_t), allocatable, intent(out) :: reduced

    allocate (reduced, source=elastic_pair_t(1.0_wp, self%beta(), self%gamma()))
  end subroutine reduce

  !> Return beta and gamma of the blocks that depend on them.
  pure function key_words(self, normal, tangential) result(word)
    class(elastic_pair_t), intent(in) :: self
    logical, intent(in) :: normal, tangential
    integer(int64) :: word(n_word)

    word = 0
    word(1) = transfer(name, word(1))
    if (normal .and. tangential) word(2) = transfer(self%beta(), word(2))
    if (tangential) word(3) = transfer(self%gamma(), word(3))
  end function key_words

  !> Set up the kernels of the pyramid.
  subroutine new_influence(self, basis, influence)
    class(elastic_pair_t), intent(in) :: self
    real(wp), intent(in) :: basis(2, 2)
    class(influence_t), allocatable, intent(out) :: influence
    type(pair_influence_t), allocatable :: made

    allocate (made)
    made%pair = self
    call new_pyramid(made%pyramid, basis)
    call move_alloc(made, influence)
  end subroutine new_influence

  !> Compute the six blocks of the operator from the five kernels.
  pure subroutine blocks(self, x, y, block)
    class(pair_influence_t), intent(in) :: self
    real(wp), intent(in), contiguous :: x(:), y(:)
    real(wp), intent(out), contiguous :: block(:, :)
    integer :: i

    do i = 1, size(x)
      block(:, i) = blocks_of(self%pair, self%pyramid%kernels(x(i), y(i)))
    end do
  end subroutine blocks

  !> Compute the six blocks from the five kernels, or from their transforms.
  pure function blocks_of(pair, k) result(block)
    type(elastic_pair_t), intent(in) :: pair
    real(wp), intent(in) :: k(n_symbol)
    real(wp) :: block(n_block)

    associate (lambda_1 => pair%lambda_1, lambda_2 => pair%lambda_2, lambda_5 => pair%lambda_5)
      block = [lambda_1*k(k_1), lambda_1*k(k_1) + lambda_5*k(k_xx), lambda_5*k(k_xy), &
               (lambda_1 + lambda_5)*k(k_1) - lambda_5*k(k_xx), lambda_2*k(k_x), lambda_2*k(k_y)]
    end associate
  end function blocks_of

  !> Set up the transforms of the kernels on a window that repeats.
  subroutine new_block_symbols(self, basis, length, n, symbols)
    class(elastic_pair_t), intent(in) :: self
    real(wp), intent(in) :: basis(2, 2)
    integer, intent(in) :: length(2), n
    class(block_symbols_t), allocatable, intent(out) :: symbols
    type(pair_symbols_t), allocatable :: made

    allocate (made)
    made%pair = self
    call new_periodic_symbols(made%kernels, basis, length, merge(1, n_symbol, n == 1))
    call move_alloc(made, symbols)
  end subroutine new_block_symbols

  !> Compute the blocks at all frequencies of a column, from the transforms of the kernels.
  pure subroutine column(self, f, block)
    class(pair_symbols_t), intent(in) :: self
    integer, intent(in) :: f
    real(wp), intent(out), contiguous :: block(0:, :)
    real(wp) :: symbol(0:size(block, 1) - 1, merge(1, n_symbol, size(block, 2) == 1))
    integer :: g

    call self%kernels%column(f, symbol)
    if (size(block, 2) == 1) then
      block = self%pair%lambda_1*symbol
      return
    end if
    do g = 0, size(block, 1) - 1
      block(g, :) = blocks_of(self%pair, symbol(g, :))
    end do
  end subroutine column

  !> Compute lambda_1 K1.
  pure subroutine closing(self, x, y, displacement)
    class(pair_influence_t), intent(in) :: self
    real(wp), intent(in), contiguous :: x(:), y(:)
    real(wp), intent(out), contiguous :: displacement(:)
    integer :: i

    do i = 1, size(x)
      displacement(i) = self%pair%lambda_1*self%pyramid%normal_kernel(x(i), y(i))
    end do
  end subroutine closing

  !> Return whether the lattice is equilateral.
  pure logical function is_hexagonal(self)
    class(pair_influence_t), intent(in) :: self
    is_hexagonal = self%pyramid%is_equilateral()
  end function is_hexagonal

  !> Compute the transform of the block of the pressure, or of those of shear tractions; K_yy = K1 - K_xx.
  pure subroutine find_symbols(self, basis, length, frequency, symbol)
    class(elastic_pair_t), intent(in) :: self
    real(wp), intent(in) :: basis(2, 2)
    integer, intent(in) :: length(2)
    integer, intent(in) :: frequency(:, :)
    real(wp), intent(out), contiguous :: symbol(:, :)
    real(wp) :: k(3)
    integer :: i

    call lattice_symbols(basis, length, frequency, symbol)
    if (size(symbol, 2) == 1) then
      symbol = self%lambda_1*symbol
      return
    end if
    do i = 1, size(symbol, 1)
      k = symbol(i, :)
      symbol(i, :) = [self%lambda_1*k(symbol_1) + self%lambda_5*k(symbol_xx), self%lambda_5*k(symbol_xy), &
                      self%lambda_1*k(symbol_1) + self%lambda_5*(k(symbol_1) - k(symbol_xx))]
    end do
  end subroutine find_symbols

end module hc_elastic_pair
