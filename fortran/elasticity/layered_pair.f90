!> Two elastic bodies with coatings.
!>
!> Responses to short waves are those of the outermost materials, a pair of half-spaces; the rest is a sum of images (hc_image_fit),
!>
!>     f(k) = f(infinity) + sum_j c_j exp(-k z_j),
!>
!> whose displacements by a pyramid are derivatives of its potentials at the depths z_j, with the sums n, l, t and d of C_zz, C_LL,
!> C_TT and -D of both bodies (body 2 mirrored: d = d1 - d2):
!>
!>     w   = n Psi * p + d (X_x * q_x + X_y * q_y)
!>     s_x = -d X_x * p - (l Omega_xx + t Omega_yy) * q_x - (l - t) Omega_xy * q_y,    and so s_y.
!>
!> Symbols are computed from the responses themselves.
!>
!> Equations: docs/theory/coatings.md, (J1), (J5) to (J7).
module hc_layered_pair
  use, intrinsic :: iso_fortran_env, only: int64
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp, pi
  use hc_error, only: error_t, status, raise
  use hc_elastic_medium, only: elastic_medium_t, influence_t, block_symbols_t, n_word, n_block
  use hc_elastic_pair, only: elastic_pair_t, material_t, new_elastic_pair, shear_modulus
  use hc_layer_response, only: layer_t, layered_body_t, n_response, of_normal, of_along, of_across, of_coupling
  use hc_image_fit, only: images_t, wave_numbers
  use hc_periodic_symbol, only: sinc
  use hc_interior_pyramid, only: interior_pyramid_t, new_interior_pyramid, most_points
  use hc_interior_fields, only: n_derivative, psi, chi_x, chi_y, omega_xx, omega_xy, omega_yy
  implicit none
  private

  public :: coating_t, layered_pair_t, new_layered_pair

  !> A layer of a body.
  type :: coating_t
    !> Thickness [m]
    real(wp) :: thickness = 0.0_wp
    type(material_t) :: material
  end type coating_t

  !> Name of the medium in keys of spectra.
  character(len=8), parameter :: name = 'layered '
  !> Largest depths of images over the thickness of all layers, which are tried until the fit is good enough.
  real(wp), parameter :: deepest(9) = [24.0_wp, 60.0_wp, 150.0_wp, 400.0_wp, 1.0e3_wp, 3.0e3_wp, 1.0e4_wp, 3.0e4_wp, 1.0e5_wp]
  !> Errors of the fit, relative to the response: good enough; too large.
  real(wp), parameter :: good = 1.0e-7_wp, largest_error = 1.0e-6_wp
  !> Wave numbers at which the error of the fit is measured.
  integer, parameter :: n_check = 1501
  !> Coupling below which two bodies count as alike.
  real(wp), parameter :: alike = 1.0e-12_wp
  !> Wave number times the smallest thickness from which responses are those of the outermost materials.
  real(wp), parameter :: short = 19.0_wp

  !> Two bodies, some with coatings. The constants of the pair are those of the outermost materials.
  type, extends(elastic_pair_t) :: layered_pair_t
    private
    type(layered_body_t) :: body(2)
    !> Depths of the images [m], and their coefficients by response [1/Pa]
    real(wp), allocatable :: depth(:), image(:, :)
    !> Responses at infinite k [1/Pa]
    real(wp) :: surface(n_response) = 0.0_wp
    !> Largest ratio of coupling and normal response, largest response of a direction [1/Pa]
    real(wp) :: largest_coupling = 0.0_wp, largest_response = 0.0_wp
    !> Largest error of the fit over the normal response
    real(wp), public :: fit_error = 0.0_wp
  contains
    !> Sums over both bodies of the responses
    procedure :: response
    !> Number of images
    procedure :: n_image
    procedure :: reduce, new_influence, find_symbols, new_block_symbols, key_words
    procedure :: coupling => coupling_of_layers
    procedure :: normal_point, shear_point, largest_point, trace, mean_compliance
  end type layered_pair_t

  !> Displacements by a pyramid.
  type, extends(influence_t) :: image_influence_t
    private
    !> By the outermost materials, and potentials of the pyramid below the surface
    class(influence_t), allocatable :: surface
    type(interior_pyramid_t) :: pyramid
    real(wp), allocatable :: depth(:), image(:, :)
  contains
    procedure :: blocks, closing, is_hexagonal
  end type image_influence_t

  !> Their transform on a window that repeats.
  type, extends(block_symbols_t) :: layered_symbols_t
    private
    type(layered_pair_t) :: pair
    class(block_symbols_t), allocatable :: surface
    real(wp) :: basis(2, 2) = 0.0_wp
    integer :: length(2) = 0
  contains
    procedure :: column
  end type layered_symbols_t

contains

  !> Set up two bodies of materials with coatings, and the images.
  pure subroutine new_layered_pair(pair, material, coating_1, coating_2, error)
    !> Pair to be set up
    type(layered_pair_t), intent(out) :: pair
    !> Materials of body 1 and body 2 below their coatings
    type(material_t), intent(in) :: material(2)
    !> Coatings, outermost first
    type(coating_t), intent(in) :: coating_1(:), coating_2(:)
    !> Allocated on failure: constants of no body, rigid surfaces, layers that images do not describe
    type(error_t), allocatable, intent(out) :: error
    type(elastic_pair_t) :: below
    type(material_t) :: outer(2)

    call make_body(material(1), coating_1, pair%body(1), outer(1), error)
    if (.not. allocated(error)) call make_body(material(2), coating_2, pair%body(2), outer(2), error)
    ! the materials below are checked too, where one of them deforms
    if (.not. (allocated(error) .or. all(material%rigid))) call new_elastic_pair(below, material(1), material(2), error)
    if (.not. allocated(error)) call new_elastic_pair(pair%elastic_pair_t, outer(1), outer(2), error)
    if (.not. allocated(error)) call find_images(pair, error)
  end subroutine new_layered_pair

  !> Make a body of its materials.
  pure subroutine make_body(material, coating, body, outer, error)
    type(material_t), intent(in) :: material
    type(coating_t), intent(in) :: coating(:)
    type(layered_body_t), intent(out) :: body
    !> Its outermost material
    type(material_t), intent(out) :: outer
    !> Allocated on failure: a thickness that is not positive, a layer that is rigid, or incompressible among several
    type(error_t), allocatable, intent(out) :: error
    integer :: i

    outer = material
    if (size(coating) > 0) outer = coating(1)%material
    allocate (body%layer(size(coating)))
    do i = 1, size(coating)
      associate (layer => coating(i), of => coating(i)%material)
        if (.not. all(ieee_is_finite([layer%thickness, of%young_modulus, of%poisson_ratio]))) then
          call raise(error, status%invalid_input, 'a coating: finite numbers expected')
        else if (.not. (layer%thickness > 0.0_wp .and. of%young_modulus > 0.0_wp) .or. of%rigid) then
          call raise(error, status%invalid_input, 'thickness and Young''s modulus of a coating: positive numbers expected')
        else if (of%poisson_ratio <= -1.0_wp .or. of%poisson_ratio > 0.5_wp) then
          call raise(error, status%invalid_input, 'Poisson''s ratio of a coating: a number above -1 and at most 0.5 expected')
        else if (size(coating) > 1 .and. of%poisson_ratio >= 0.5_wp) then
          call raise(error, status%invalid_input, 'Poisson''s ratio of one of several coatings: a number below 0.5 expected')
        end if
        if (allocated(error)) return
        body%layer(i) = layer_t(layer%thickness, shear_modulus(of), of%poisson_ratio)
      end associate
    end do
    body%base = layer_t(0.0_wp, shear_modulus(material), material%poisson_ratio)
  end subroutine make_body

  !> Find the images: with the largest depth from which on the error is small.
  pure subroutine find_images(self, error)
    type(layered_pair_t), intent(inout) :: self
    !> Allocated on failure: the error is too large
    type(error_t), allocatable, intent(out) :: error
    type(images_t) :: images
    real(wp) :: found(0:n_check, n_response), k(n_check), whole, thinnest
    character(len=16) :: number
    integer :: i, trial

    self%surface = [self%lambda_1, self%lambda_1, self%lambda_1 + self%lambda_5, self%lambda_2]
    whole = max(sum(self%body(1)%layer%thickness), sum(self%body(2)%layer%thickness))
    thinnest = least_thickness(self)
    do trial = 1, size(deepest)
      k = wave_numbers(thinnest, whole, deepest(trial), n_check)
      found(0, :) = self%response(0.0_wp)
      do i = 1, n_check
        found(i, :) = self%response(k(i))
      end do
      if (trial == 1) then
        ! of the largest size, with its sign
        associate (ratio => found(1:, of_coupling)/found(1:, of_normal))
          self%largest_coupling = ratio(maxloc(abs(ratio), dim=1))
        end associate
        self%largest_response = maxval(found(1:, :of_across))
        if (abs(self%largest_coupling) < alike) self%largest_coupling = 0.0_wp
      end if
      if (.not. abs(self%largest_coupling) > 0.0_wp) then
        self%lambda_2 = 0.0_wp
        self%surface(of_coupling) = 0.0_wp
        found(:, of_coupling) = 0.0_wp
      end if
      associate (scale => max(self%surface(of_normal), found(:, of_normal)))
        call images%improve(thinnest, whole, deepest(trial), k, found - spread(self%surface, 1, n_check + 1), scale)
      end associate
      if (images%error <= good) exit
    end do
    self%fit_error = images%error
    call move_alloc(images%depth, self%depth)
    call move_alloc(images%coefficient, self%image)
    if (self%fit_error <= largest_error) return
    write (number, '(es8.1)') self%fit_error
    call raise(error, status%invalid_input, 'the moduli of layers and bodies lie too far apart: the error of the kernels is '// &
               trim(adjustl(number))//' of the largest one; at most 1E-06 expected')
  end subroutine find_images

  !> Return the smallest thickness of all layers.
  pure real(wp) function least_thickness(self)
    type(layered_pair_t), intent(in) :: self
    least_thickness = min(minval(self%body(1)%layer%thickness), minval(self%body(2)%layer%thickness))
  end function least_thickness

  !> Compute the sums over both bodies of the responses at a wave number; the difference of the couplings [1/Pa].
  pure function response(self, k) result(f)
    class(layered_pair_t), intent(in) :: self
    !> Wave number [1/m]
    real(wp), intent(in) :: k
    real(wp) :: f(n_response)

    f = self%body(1)%response(k) + [1.0_wp, 1.0_wp, 1.0_wp, -1.0_wp]*self%body(2)%response(k)
  end function response

  !> Return the number of images.
  pure integer function n_image(self)
    class(layered_pair_t), intent(in) :: self
    n_image = size(self%depth)
  end function n_image

  !> Return the pair over its lambda_1, lengths over that of the unit.
  subroutine reduce(self, length, reduced)
    class(layered_pair_t), intent(in) :: self
    real(wp), intent(in) :: length
    class(elastic_medium_t), allocatable, intent(out) :: reduced
    type(layered_pair_t), allocatable :: made
    integer :: i

    allocate (made)
    made%elastic_pair_t = elastic_pair_t(1.0_wp, self%lambda_2/self%lambda_1, self%lambda_5/self%lambda_1)
    made%body = self%body
    do i = 1, 2
      made%body(i)%layer%thickness = self%body(i)%layer%thickness/length
      made%body(i)%layer%shear_modulus = self%body(i)%layer%shear_modulus*self%lambda_1
    end do
    made%body%base%shear_modulus = self%body%base%shear_modulus*self%lambda_1
    made%depth = self%depth/length
    made%image = self%image/self%lambda_1
    made%surface = self%surface/self%lambda_1
    made%largest_coupling = self%largest_coupling
    made%largest_response = self%largest_response/self%lambda_1
    made%fit_error = self%fit_error
    call move_alloc(made, reduced)
  end subroutine reduce

  !> Return beta and gamma of the outermost materials, and two hashes of layers and images.
  pure function key_words(self, normal, tangential) result(word)
    class(layered_pair_t), intent(in) :: self
    logical, intent(in) :: normal, tangential
    integer(int64) :: word(n_word)
    real(wp), allocatable :: numbers(:)
    integer :: i

    word = 0
    word(1) = transfer(name, word(1))
    if (normal .and. tangential) word(2) = transfer(self%lambda_2/self%lambda_1, word(2))
    if (tangential) word(3) = transfer(self%lambda_5/self%lambda_1, word(3))
    numbers = [self%depth, reshape(self%image, [size(self%image)])]
    do i = 1, 2
      associate (layer => self%body(i)%layer)
        numbers = [numbers, real(size(layer), wp), layer%thickness, layer%shear_modulus, layer%poisson_ratio, &
                   self%body(i)%base%shear_modulus, self%body(i)%base%poisson_ratio]
      end associate
    end do
    word(4) = hash(numbers, 23)
    word(5) = hash(numbers, 41)
  end function key_words

  !> Mix the bits of numbers to a word (G. Marsaglia, J. Statistical Software 8, 2003: shifts and exclusive or).
  pure integer(int64) function hash(numbers, turn)
    real(wp), intent(in) :: numbers(:)
    !> Bits by which the word is turned between two numbers
    integer, intent(in) :: turn
    integer :: i

    hash = size(numbers)
    do i = 1, size(numbers)
      hash = ieor(ishftc(hash, turn), transfer(numbers(i), hash))
      hash = ieor(hash, ishft(hash, 13))
      hash = ieor(hash, ishft(hash, -7))
      hash = ieor(hash, ishft(hash, 17))
    end do
  end function hash

  !> Return the largest ratio of coupling and normal response, with its sign.
  pure real(wp) function coupling_of_layers(self)
    class(layered_pair_t), intent(in) :: self
    coupling_of_layers = self%largest_coupling
  end function coupling_of_layers

  !> Return the response to a pressure of about that wave length [1/Pa].
  pure real(wp) function normal_point(self, length)
    class(layered_pair_t), intent(in) :: self
    real(wp), intent(in) :: length
    real(wp) :: f(n_response)

    f = self%response(1.0_wp/length)
    normal_point = f(of_normal)
  end function normal_point

  !> Return the larger one of the responses to a shear traction of about that wave length [1/Pa].
  pure real(wp) function shear_point(self, length)
    class(layered_pair_t), intent(in) :: self
    real(wp), intent(in) :: length
    real(wp) :: f(n_response)

    f = self%response(1.0_wp/length)
    shear_point = max(f(of_along), f(of_across))
  end function shear_point

  !> Bound the displacement by a point load times the distance [1/Pa].
  pure real(wp) function largest_point(self, length)
    class(layered_pair_t), intent(in) :: self
    real(wp), intent(in) :: length
    largest_point = (1.0_wp + abs(self%largest_coupling))*self%largest_response
  end function largest_point

  !> Return 0: Kxx + Kyy is no multiple of the pressure block.
  pure real(wp) function trace(self)
    class(layered_pair_t), intent(in) :: self
    trace = 0.0_wp
  end function trace

  !> Set up the displacements by a pyramid of a lattice.
  subroutine new_influence(self, basis, influence)
    class(layered_pair_t), intent(in) :: self
    real(wp), intent(in) :: basis(2, 2)
    class(influence_t), allocatable, intent(out) :: influence
    type(image_influence_t), allocatable :: made

    allocate (made)
    call self%elastic_pair_t%new_influence(basis, made%surface)
    call new_interior_pyramid(made%pyramid, basis, sharp=.true.)
    made%depth = self%depth
    made%image = self%image
    call move_alloc(made, influence)
  end subroutine new_influence

  !> Add the images to the six blocks of the outermost materials, (J6).
  pure subroutine blocks(self, x, y, block)
    class(image_influence_t), intent(in) :: self
    real(wp), intent(in), contiguous :: x(:), y(:)
    real(wp), intent(out), contiguous :: block(:, :)

    call self%surface%blocks(x, y, block)
    call add_images(self, x, y, block)
  end subroutine blocks

  !> Compute the block of the pressure.
  pure subroutine closing(self, x, y, displacement)
    class(image_influence_t), intent(in) :: self
    real(wp), intent(in), contiguous :: x(:), y(:)
    real(wp), intent(out), contiguous :: displacement(:)
    real(wp) :: block(1, size(x))

    call self%surface%closing(x, y, block(1, :))
    call add_images(self, x, y, block)
    displacement = block(1, :)
  end subroutine closing

  !> Add the images to the block of the pressure, or to all.
  pure subroutine add_images(self, x, y, block)
    class(image_influence_t), intent(in) :: self
    real(wp), intent(in), contiguous :: x(:), y(:)
    !> Displacement per traction (1 or n_block, n) [m/Pa]
    real(wp), intent(inout), contiguous :: block(:, :)
    real(wp) :: d(most_points, n_derivative), z(most_points)
    integer :: first, last, j, n

    associate (unit => self%pyramid%spacing)
      do first = 1, size(x), most_points
        last = min(first + most_points - 1, size(x))
        n = last - first + 1
        do j = 1, size(self%depth)
          z = self%depth(j)/unit
          call self%pyramid%potentials(n, x(first:last)/unit, y(first:last)/unit, z(:n), d(:n, :))
          associate (normal => unit*self%image(of_normal, j), along => unit*self%image(of_along, j), &
                     across => unit*self%image(of_across, j), couple => unit*self%image(of_coupling, j), b => block(:, first:last))
            b(1, :) = b(1, :) + normal*d(:n, psi)
            if (size(block, 1) == 1) cycle
            b(2, :) = b(2, :) - along*d(:n, omega_xx) - across*d(:n, omega_yy)
            b(3, :) = b(3, :) - (along - across)*d(:n, omega_xy)
            b(4, :) = b(4, :) - along*d(:n, omega_yy) - across*d(:n, omega_xx)
            b(5, :) = b(5, :) + couple*d(:n, chi_x)
            b(6, :) = b(6, :) + couple*d(:n, chi_y)
          end associate
        end do
      end do
    end associate
  end subroutine add_images

  !> Return whether the lattice is equilateral.
  pure logical function is_hexagonal(self)
    class(image_influence_t), intent(in) :: self
    is_hexagonal = self%surface%is_hexagonal()
  end function is_hexagonal

  !> Add to the transform of the outermost materials the difference of the responses at the frequency itself.
  pure subroutine find_symbols(self, basis, length, frequency, symbol)
    class(layered_pair_t), intent(in) :: self
    real(wp), intent(in) :: basis(2, 2)
    integer, intent(in) :: length(2)
    integer, intent(in) :: frequency(:, :)
    real(wp), intent(out), contiguous :: symbol(:, :)
    real(wp) :: half(2), change(n_block)
    integer :: m, low(2)

    call self%elastic_pair_t%find_symbols(basis, length, frequency, symbol)
    do m = 1, size(symbol, 1)
      low = frequency(:, m) - merge(length, 0, 2*frequency(:, m) > length)
      half = pi*low/length
      if (all(low == 0)) then
        change = mean_change(self, basis, length)
      else
        change = change_at(self, basis, half)
        ! on a Nyquist row k and -k are the same frequency
        if (any(2*low == length)) change = 0.5_wp*(change + change_at(self, basis, merge(half, -half, 2*low == length)))
      end if
      if (size(symbol, 2) == 1) then
        symbol(m, 1) = symbol(m, 1) + change(1)
      else
        symbol(m, :) = symbol(m, :) + change(2:4)
      end if
    end do
  end subroutine find_symbols

  !> Compute the part of the responses in the transform of the blocks at a wave vector, (J7); that of odd blocks over i.
  pure function change_at(self, basis, half) result(change)
    type(layered_pair_t), intent(in) :: self
    real(wp), intent(in) :: basis(2, 2)
    !> Halves of the phases along both basis vectors
    real(wp), intent(in) :: half(2)
    real(wp) :: change(n_block), k(2), along(2), size_of

    k = 2.0_wp*[half(1)*basis(2, 2) - half(2)*basis(2, 1), half(2)*basis(1, 1) - half(1)*basis(1, 2)] &
        /(basis(1, 1)*basis(2, 2) - basis(2, 1)*basis(1, 2))
    size_of = norm2(k)
    along = k/size_of
    associate (f => 2.0_wp*pi/size_of*sinc(half(1))*sinc(half(2))*sinc(half(2) - half(1)) &
               *(self%response(size_of) - self%surface))
      change = [f(of_normal), f(of_along)*along(1)**2 + f(of_across)*along(2)**2, &
                (f(of_along) - f(of_across))*along(1)*along(2), f(of_along)*along(2)**2 + f(of_across)*along(1)**2, &
                -f(of_coupling)*along]
    end associate
  end function change_at

  !> Compute it for the mean: of a wave as long as a disc of the area of the grid.
  pure function mean_change(self, basis, length) result(change)
    type(layered_pair_t), intent(in) :: self
    real(wp), intent(in) :: basis(2, 2)
    integer, intent(in) :: length(2)
    real(wp) :: change(n_block)

    change = 0.0_wp
    associate (radius => sqrt(abs(basis(1, 1)*basis(2, 2) - basis(2, 1)*basis(1, 2))*product(real(length, wp))/pi))
      associate (f => 2.0_wp*pi*radius*(self%response(1.0_wp/radius) - self%surface))
        change([1, 2, 4]) = [f(of_normal), 0.5_wp*(f(of_along) + f(of_across)), 0.5_wp*(f(of_along) + f(of_across))]
      end associate
    end associate
  end function mean_change

  !> Set up the transforms on a window that repeats.
  subroutine new_block_symbols(self, basis, length, n, symbols)
    class(layered_pair_t), intent(in) :: self
    real(wp), intent(in) :: basis(2, 2)
    integer, intent(in) :: length(2), n
    class(block_symbols_t), allocatable, intent(out) :: symbols
    type(layered_symbols_t), allocatable :: made

    allocate (made)
    made%pair = self
    made%basis = basis
    made%length = length
    call self%elastic_pair_t%new_block_symbols(basis, length, n, made%surface)
    call move_alloc(made, symbols)
  end subroutine new_block_symbols

  !> Compute the blocks at all frequencies of a column: aliases add as far as their waves reach below the outermost layer.
  pure subroutine column(self, f, block)
    class(layered_symbols_t), intent(in) :: self
    integer, intent(in) :: f
    real(wp), intent(out), contiguous :: block(0:, :)
    real(wp) :: change(n_block), half(2), compliance(2)
    integer :: g, i, j, near(2)

    call self%surface%column(f, block)
    near = ceiling(0.5_wp*short/least_thickness(self%pair)*norm2(self%basis, dim=1)/pi)
    do g = 0, self%length(2) - 1
      if (f == 0 .and. g == 0) cycle
      change = 0.0_wp
      do j = -near(2), near(2)
        do i = -near(1), near(1)
          half = pi*([i, j] + [f, g - merge(self%length(2), 0, 2*g > self%length(2))]/real(self%length, wp))
          change = change + change_at(self%pair, self%basis, half)
        end do
      end do
      if (modulo(2*f, self%length(1)) == 0 .and. modulo(2*g, self%length(2)) == 0) change(5:) = 0.0_wp
      block(g, :) = block(g, :) + change(:size(block, 2))
    end do
    if (f > 0) return
    compliance = uniform_compliance(self%pair)
    block(0, 1) = compliance(1)
    if (size(block, 2) > 1) block(0, [2, 4]) = compliance(2)
  end subroutine column

  !> Return the mean displacements by unit tractions, normal and shear; 0 unless both bases are rigid
  !> [m/Pa].
  pure function uniform_compliance(pair) result(compliance)
    class(layered_pair_t), intent(in) :: pair
    real(wp) :: compliance(2)

    compliance = 0.0_wp
    if (.not. any(pair%body%base%shear_modulus > 0.0_wp)) compliance = pair%body(1)%uniform() + pair%body(2)%uniform()
  end function uniform_compliance

  !> Return the mean displacement by a uniform shear traction of one: that of the springs and of layers on rigid bases [m/Pa].
  pure real(wp) function mean_compliance(self)
    class(layered_pair_t), intent(in) :: self

    associate (uniform => uniform_compliance(self))
      mean_compliance = self%spring_compliance() + uniform(2)
    end associate
  end function mean_compliance

end module hc_layered_pair
