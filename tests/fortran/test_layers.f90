!> Bodies with coatings: responses, images, limits, and both methods with friction.
module test_layers
  use hc_precision, only: wp, pi
  use hc_error, only: error_t, status
  use hc_lattice, only: lattice_t, new_lattice, equilateral_basis
  use hc_elastic_medium, only: elastic_medium_t, influence_t, block_symbols_t, n_block
  use hc_elastic_pair, only: elastic_pair_t, material_t, new_elastic_pair
  use hc_layer_response, only: layer_t, layered_body_t, n_response, of_normal, of_along, of_across, of_coupling, n_wave, &
                               ll_p, tt_p, zz_p, lz_p, ll_q, zz_q, lz_q, tz_t, lt_t, uz_p, ul_p, uz_q, ul_q, ut_t
  use hc_flexibility_fft, only: fft_flexibility_t, new_fft_flexibility, spectra_of
  use hc_interior_points, only: fields_at_points
  use hc_interior_planes, only: interior_planes_t, new_interior_planes
  use hc_depth_fields, only: half_space_of
  use hc_layered_pair, only: coating_t, layered_pair_t, new_layered_pair
  use hc_contact_state, only: contact_state_t, new_friction_state, load_target_t, force_control, displacement_control
  use hc_coulomb, only: coulomb_t
  use hc_contact_problem, only: friction_problem_t, new_friction_problem
  use hc_contact_solver, only: friction_solver_t
  use hc_frictional_contact, only: frictional_contact_t, new_frictional_contact
  use hc_direct_friction, only: direct_friction_t, new_direct_friction
  use testing, only: test_t, new_test, check, check_true, check_raised, largest, open_table
  implicit none
  private

  public :: collect_layers

  integer, parameter :: f = force_control, d = displacement_control

contains

  subroutine collect_layers(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('responses', test_responses), &
      new_test('fields_at_depths', test_depths), &
      new_test('stress_in_layers', test_stress), &
      new_test('equal_materials', test_equal), &
      new_test('split_layer', test_split), &
      new_test('limits', test_limits), &
      new_test('images', test_images), &
      new_test('far_field', test_far), &
      new_test('rows_of_kernels', test_rows), &
      new_test('fits', test_fits), &
      new_test('symbols', test_symbols), &
      new_test('mean_on_rigid_bases', test_mean), &
      new_test('like_bodies', test_like), &
      new_test('number_of_spectra', test_spectra), &
      new_test('both_methods', test_methods), &
      new_test('refused', test_refused) &
    ]
  end subroutine collect_layers

  !> Up to three layers on a half-space or a rigid base, from matrix exponentials in 50 digits.
  subroutine test_responses(error)
    type(error_t), allocatable, intent(out) :: error
    type(layered_body_t) :: body
    real(wp) :: layers(3, 3), base(2), k, expected(n_response), found(n_response)
    integer :: unit, stat, n, n_row, i

    call open_table('layer_response.csv', unit, error)
    if (allocated(error)) return
    n_row = 0
    do
      read (unit, *, iostat=stat) n, layers, base, k, expected
      if (stat /= 0) exit
      n_row = n_row + 1
      body%layer = [(layer_t(layers(1, i), layers(2, i), layers(3, i)), i=1, n)]
      body%base = layer_t(0.0_wp, base(1), base(2))
      found = body%response(k)
      call check(error, found/expected(3), expected/expected(3), 1.0e-12_wp, 'responses')
      if (allocated(error)) exit
    end do
    close (unit)
    if (.not. allocated(error)) call check_true(error, n_row == 30, 'all rows were read')
  end subroutine test_responses

  !> Waves below the surface: its displacements and tractions, equilibrium and Hooke's law in each layer, no jump between them.
  subroutine test_depths(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: step = 1.0e-4_wp
    integer, parameter :: continuous(9) = [zz_p, lz_p, zz_q, lz_q, tz_t, uz_p, ul_p, uz_q, ul_q]
    type(layered_body_t) :: body
    type(layer_t) :: here
    real(wp), dimension(n_wave) :: f, rate
    real(wp) :: k, z, law(9)
    integer :: i

    body%layer = [layer_t(0.5_wp, 3.0_wp, 0.3_wp), layer_t(0.2_wp, 0.4_wp, 0.45_wp), layer_t(0.6_wp, 1.5_wp, 0.1_wp)]
    body%base = layer_t(0.0_wp, 1.0_wp, 0.25_wp)
    do i = 1, 12
      k = 0.3_wp*i
      f = body%at_depth(k, 0.0_wp)
      call check(error, f([zz_p, lz_p, zz_q, lz_q, tz_t]), [-1.0_wp, 0.0_wp, 0.0_wp, -1.0_wp, -1.0_wp], 1.0e-13_wp, 'tractions')
      if (allocated(error)) return
      associate (known => 2.0_wp*pi*body%response(k))
        call check(error, f([uz_p, ul_q, ut_t, ul_p, uz_q]), [known([of_normal, of_along, of_across]), &
                                                              known(of_coupling), -known(of_coupling)], 1.0e-13_wp, 'surface')
      end associate
      if (allocated(error)) return
      f = body%at_depth(k, 0.5_wp) - body%at_depth(k, 0.5_wp*(1.0_wp + 1.0e-11_wp))
      call check(error, largest_of(f(continuous)), 0.0_wp, 1.0e-9_wp, 'jumps')
      if (allocated(error)) return
      f = body%at_depth(k, 0.5_wp) - body%at_depth(k, 0.5_wp*(1.0_wp + 1.0e-14_wp))
      call check(error, largest_of(f), 0.0_wp, 1.0e-12_wp, 'rounding leaves the layer above an interface')
      if (allocated(error)) return
      z = 0.14_wp*i - 0.09_wp
      here = body%material_at(z)
      f = body%at_depth(k, z)
      rate = (8.0_wp*(body%at_depth(k, z + step) - body%at_depth(k, z - step)) &
              - body%at_depth(k, z + 2.0_wp*step) + body%at_depth(k, z - 2.0_wp*step))/(12.0_wp*step*k)
      associate (nu => here%poisson_ratio, g => here%shear_modulus)
        ! equilibrium along L, z and T
        law = [rate(lz_p) + f(ll_p), rate(zz_p) - f(lz_p), rate(lz_q) - f(ll_q), rate(zz_q) + f(lz_q), rate(tz_t) - f(lt_t), &
               ! Hooke's law: strains zz, Lz and TT of a stress
               2.0_wp*g*rate(uz_p) - f(zz_p) + nu*(f(ll_p) + f(tt_p) + f(zz_p))/(1.0_wp + nu), &
               g*(rate(ul_p) + f(uz_p)) - f(lz_p), g*rate(ut_t) - f(tz_t), f(tt_p) - nu*(f(ll_p) + f(zz_p))]
      end associate
      call check(error, largest_of(law), 0.0_wp, 1.0e-8_wp, 'equations')
      if (allocated(error)) return
    end do

  contains

    pure real(wp) function largest_of(values)
      real(wp), intent(in) :: values(:)
      largest_of = maxval(abs(values))
    end function largest_of
  end subroutine test_depths

  !> Points in a layer and below it: tractions of the surface, no jump at the base, planes, a layer of the material below.
  subroutine test_stress(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: across(3) = [3, 5, 6]
    real(wp), parameter :: thickness(3) = [1.0_wp, 0.6_wp, 2.5_wp], modulus(3) = [3.0_wp, 0.02_wp, 100.0_wp]
    type(lattice_t) :: lattice
    type(layered_body_t) :: body
    type(interior_planes_t) :: planes
    type(error_t), allocatable :: raised
    real(wp) :: traction(8, 6, 3, 1), plane(8, 6, 6), points(3, 4), u(3, 4, 1), s(6, 4, 1), plain_u(3, 4, 1), plain(6, 4, 1)
    real(wp) :: node(2)
    integer :: i, number

    call random_number(traction)
    do number = 1, 2
      do i = 1, size(modulus)
        call new_lattice(lattice, equilateral_basis(0.5_wp), [-4, -3], [8, 6], error)
        if (allocated(error)) return
        body%layer = [layer_t(thickness(i), modulus(i), 0.3_wp)]
        body%base = layer_t(0.0_wp, 1.0_wp, 0.2_wp)
        node = matmul(lattice%basis, [0.0_wp, -1.0_wp])
        points(:2, :) = spread(node, 2, 4)
        points(3, :) = thickness(i)*[0.0_wp, 0.4_wp, 1.0_wp, 1.0_wp + 1.0e-10_wp]
        call fields_at_points(lattice, traction, number, body, points, u, s, error)
        if (allocated(error)) return
        call check(error, s([3, 6, 5], 1, 1), -traction(5, 3, :, 1), 1.0e-12_wp, 'surface')
        if (allocated(error)) return
        call check(error, s(across, 3, 1), s(across, 4, 1), 1.0e-8_wp, 'traction at the base')
        if (allocated(error)) return
        call check(error, u(:, 3, 1)/maxval(abs(u)), u(:, 4, 1)/maxval(abs(u)), 1.0e-8_wp, 'displacement at the base')
        if (allocated(error)) return
        call new_interior_planes(planes, lattice, number, body, error)
        if (.not. allocated(error)) call planes%set_depth(points(3, 2), error)
        if (.not. allocated(error)) call planes%apply(traction(:, :, :, 1), plane, error)
        if (allocated(error)) return
        call check(error, plane(5, 3, :)/maxval(abs(plane)), s(:, 2, 1)/maxval(abs(plane)), 1.0e-11_wp, 'plane')
        if (allocated(error)) return
        body%layer(1) = layer_t(thickness(i), 1.0_wp, 0.2_wp)
        call fields_at_points(lattice, traction, number, body, points, u, s, error)
        if (.not. allocated(error)) call fields_at_points(lattice, traction, number, half_space_of(0.2_wp), points, plain_u, &
                                                         plain, error)
        if (allocated(error)) return
        call check(error, [s, u], [plain, plain_u], 1.0e-8_wp, 'a layer of the material below')
        if (allocated(error)) return
      end do
    end do
    body%base%shear_modulus = 0.0_wp
    call fields_at_points(lattice, traction, 1, body, points, u, s, raised)
    call check_raised(error, raised, status%invalid_input, 'points in a rigid base')
  end subroutine test_stress

  !> The memory is counted for as many spectra as there are.
  subroutine test_spectra(error)
    type(error_t), allocatable, intent(out) :: error
    type(material_t), parameter :: soft = material_t(1.0_wp, 0.3_wp), hard = material_t(4.0_wp, 0.2_wp)
    type(lattice_t) :: lattice
    type(layered_pair_t) :: coated
    type(elastic_pair_t) :: plain

    call new_lattice(lattice, equilateral_basis(1.0_wp), [0, 0], [4, 4], error)
    if (.not. allocated(error)) call new_elastic_pair(plain, soft, soft, error)
    if (.not. allocated(error)) call expect(plain, 3)
    if (.not. allocated(error)) call new_elastic_pair(plain, soft, hard, error)
    if (.not. allocated(error)) call expect(plain, 5)
    if (.not. allocated(error)) call new_layered_pair(coated, [soft, soft], [coating_t(2.0_wp, hard)], [coating_t(2.0_wp, hard)], &
                                                     error)
    if (.not. allocated(error)) call expect(coated, 4)
    if (.not. allocated(error)) call new_layered_pair(coated, [soft, soft], [coating_t(2.0_wp, hard)], [coating_t :: ], error)
    if (.not. allocated(error)) call expect(coated, 6)

  contains

    subroutine expect(medium, n)
      class(elastic_medium_t), intent(in) :: medium
      integer, intent(in) :: n
      type(fft_flexibility_t) :: operator

      call new_fft_flexibility(operator, lattice, medium, error)
      if (allocated(error)) return
      call check(error, real([spectra_of(medium), size(operator%convolution%spectrum, 3)], wp), real([n, n], wp), 0.0_wp, 'spectra')
    end subroutine expect
  end subroutine test_spectra

  !> A layer of the material below is none: all blocks are those of half-spaces.
  subroutine test_equal(error)
    type(error_t), allocatable, intent(out) :: error
    type(material_t), parameter :: soft = material_t(1.0_wp, 0.3_wp), hard = material_t(4.0_wp, 0.2_wp)
    type(layered_pair_t) :: coated
    type(elastic_pair_t) :: plain
    real(wp), dimension(n_block, 3) :: found, expected

    call new_layered_pair(coated, [soft, hard], [coating_t(0.4_wp, soft)], [coating_t :: ], error)
    if (allocated(error)) return
    call new_elastic_pair(plain, soft, hard, error)
    if (allocated(error)) return
    found = blocks_of(coated)
    expected = blocks_of(plain)
    call check(error, largest(found - expected), 0.0_wp, 1.0e-13_wp, 'blocks')
    if (allocated(error)) return
    call check(error, coated%coupling(), plain%coupling(), 1.0e-13_wp, 'coupling')
  end subroutine test_equal

  !> Evaluate the blocks at three points.
  function blocks_of(medium) result(block)
    class(elastic_medium_t), intent(in) :: medium
    real(wp) :: block(n_block, 3)
    class(influence_t), allocatable :: influence

    call medium%new_influence(equilateral_basis(1.0_wp), influence)
    call influence%blocks([0.0_wp, 2.5_wp, -7.0_wp], [0.0_wp, 0.5_wp, 4.0_wp], block)
  end function blocks_of

  !> Two layers of one material are one layer.
  subroutine test_split(error)
    type(error_t), allocatable, intent(out) :: error
    type(layered_body_t) :: one, two
    real(wp) :: base(2)
    integer :: i, j

    base = [0.0_wp, 0.7_wp]
    do i = 1, 2
      one%layer = [layer_t(1.0_wp, 1.0_wp, 0.3_wp)]
      two%layer = [layer_t(0.3_wp, 1.0_wp, 0.3_wp), layer_t(0.7_wp, 1.0_wp, 0.3_wp)]
      one%base = layer_t(0.0_wp, base(i), 0.2_wp)
      two%base = one%base
      do j = -3, 3
        call check(error, two%response(4.0_wp**j), one%response(4.0_wp**j), 1.0e-12_wp, 'responses')
        if (allocated(error)) return
      end do
    end do
  end subroutine test_split

  !> Long waves see what lies below, short ones the layer; a thin layer on a rigid base is a foundation of springs.
  subroutine test_limits(error)
    type(error_t), allocatable, intent(out) :: error
    type(layered_body_t) :: coated, plain
    real(wp), parameter :: k = 1.0e-5_wp, nu = 0.3_wp
    real(wp) :: thin(n_response)

    allocate (plain%layer(0))
    coated%layer = [layer_t(1.0_wp, 1.0_wp, nu)]
    coated%base = layer_t(0.0_wp, 0.4_wp, 0.2_wp)
    plain%base = coated%base
    call check(error, coated%response(k), plain%response(k), 1.0e-4_wp, 'long waves')
    if (allocated(error)) return
    plain%base = coated%layer(1)
    call check(error, coated%response(50.0_wp), plain%response(1.0_wp), 1.0e-14_wp, 'short waves')
    if (allocated(error)) return
    coated%base = layer_t(0.0_wp, 0.0_wp, 0.0_wp)
    thin = 2.0_wp*pi/k*coated%response(k)
    call check(error, thin(1), (1.0_wp - 2.0_wp*nu)/(2.0_wp*(1.0_wp - nu)), 1.0e-8_wp, 'compression of a thin layer')
    if (allocated(error)) return
    call check(error, thin(2:3), [1.0_wp, 1.0_wp], 1.0e-8_wp, 'shear of a thin layer')
    if (allocated(error)) return
    call check(error, coated%uniform(), thin([1, 3]), 1.0e-8_wp, 'uniform tractions')
    if (allocated(error)) return
    coated%layer(1)%poisson_ratio = 0.5_wp
    thin = coated%response(0.01_wp)*2.0_wp*pi/0.01_wp
    call check(error, thin(1)/(0.01_wp**2/3.0_wp), 1.0_wp, 1.0e-3_wp, 'a thin incompressible layer')
  end subroutine test_limits

  !> Blocks of a layer less those of its material alone, by quadrature of the inverse transform.
  subroutine test_images(error)
    type(error_t), allocatable, intent(out) :: error
    type(material_t) :: layer, base
    type(layered_pair_t) :: coated
    type(elastic_pair_t) :: plain
    class(influence_t), allocatable :: images, surface
    real(wp) :: at(2), expected(n_block), found(n_block, 1), outer(n_block, 1), own(1), basis(2, 2)
    integer :: unit, stat, lattice, n_row

    layer = material_t(2.6_wp, 0.3_wp)
    base = material_t(1.3_wp, 0.3_wp)
    call new_layered_pair(coated, [base, material_t(rigid=.true.)], [coating_t(1.5_wp, layer)], [coating_t :: ], error)
    if (allocated(error)) return
    call new_elastic_pair(plain, layer, material_t(rigid=.true.), error)
    if (allocated(error)) return
    call open_table('layer_kernels.csv', unit, error)
    if (allocated(error)) return
    n_row = 0
    do
      read (unit, *, iostat=stat) lattice, at, expected
      if (stat /= 0) exit
      n_row = n_row + 1
      basis = equilateral_basis(1.0_wp)
      if (lattice == 2) basis = reshape([1.0_wp, 0.0_wp, 0.2_wp, 0.6_wp], [2, 2])
      call coated%new_influence(basis, images)
      call plain%new_influence(basis, surface)
      call images%blocks(at(1:1), at(2:2), found)
      call surface%blocks(at(1:1), at(2:2), outer)
      call check(error, found(:, 1) - outer(:, 1), expected, 2.0e-9_wp, 'blocks')
      if (allocated(error)) exit
      call images%closing(at(1:1), at(2:2), own)
      call check(error, own(1), found(1, 1), 1.0e-14_wp, 'block of the pressure')
      if (allocated(error)) exit
    end do
    close (unit)
    if (.not. allocated(error)) call check_true(error, n_row == 12, 'all rows were read')
  end subroutine test_images

  !> Far away the layer is not there.
  subroutine test_far(error)
    type(error_t), allocatable, intent(out) :: error
    type(material_t), parameter :: base = material_t(1.0_wp, 0.3_wp), other = material_t(5.0_wp, 0.1_wp)
    type(layered_pair_t) :: coated
    type(elastic_pair_t) :: plain
    class(influence_t), allocatable :: images, below
    real(wp), dimension(n_block, 1) :: found, expected

    call new_layered_pair(coated, [base, other], [coating_t(1.0_wp, material_t(4.0_wp, 0.2_wp))], [coating_t :: ], error)
    if (.not. allocated(error)) call new_elastic_pair(plain, base, other, error)
    if (allocated(error)) return
    call coated%new_influence(equilateral_basis(1.0_wp), images)
    call plain%new_influence(equilateral_basis(1.0_wp), below)
    call images%blocks([8.0e10_wp], [6.0e10_wp], found)
    call below%blocks([8.0e10_wp], [6.0e10_wp], expected)
    call check(error, found(:, 1)/expected(1, 1), expected(:, 1)/expected(1, 1), 1.0e-10_wp, 'blocks')
  end subroutine test_far

  !> The kernel of a row of offsets is that of single ones, to the last bit: ranks evaluate rows, one rank a table.
  subroutine test_rows(error)
    type(error_t), allocatable, intent(out) :: error
    type(layered_pair_t) :: pair
    class(influence_t), allocatable :: images
    real(wp) :: x(150), y(150), row(150), single(150)
    integer :: i

    call new_layered_pair(pair, [material_t(1.0_wp, 0.3_wp), material_t(5.0_wp, 0.1_wp)], &
                          [coating_t(1.0_wp, material_t(4.0_wp, 0.2_wp))], [coating_t :: ], error)
    if (allocated(error)) return
    call pair%new_influence(equilateral_basis(1.0_wp), images)
    x = [(real(i, wp) - 75.5_wp, i=1, 150)]
    y = 2.0_wp*sqrt(0.75_wp)
    call images%closing(x, y, row)
    do i = 1, size(x)
      call images%closing(x(i:i), y(i:i), single(i:i))
    end do
    call check(error, maxval(abs(row - single)), 0.0_wp, 0.0_wp, 'kernel of a row')
  end subroutine test_rows

  !> The kernels of layers are images to 1e-6, for moduli apart by a factor of a thousand, and for a soft layer below a hard one.
  subroutine test_fits(error)
    type(error_t), allocatable, intent(out) :: error
    type(layered_pair_t) :: pair
    type(material_t) :: rigid
    real(wp), parameter :: ratio(8) = [0.001_wp, 0.1_wp, 0.5_wp, 2.0_wp, 10.0_wp, 30.0_wp, 100.0_wp, 1000.0_wp]
    integer :: i

    rigid%rigid = .true.
    do i = 1, size(ratio)
      call new_layered_pair(pair, [material_t(1.0_wp, 0.3_wp), rigid], [coating_t(1.0_wp, material_t(ratio(i), 0.25_wp))], &
                            [coating_t :: ], error)
      if (allocated(error)) return
      call check_true(error, pair%fit_error < 1.0e-6_wp .and. pair%n_image() < 75, 'layer on a half-space')
      if (allocated(error)) return
      call new_layered_pair(pair, [material_t(1.0_wp, 0.3_wp), rigid], &
                            [coating_t(1.0_wp, material_t(1.0_wp, 0.3_wp)), &
                             coating_t(1.0_wp, material_t(min(ratio(i), 1.0_wp), 0.4_wp))], [coating_t :: ], error)
      if (allocated(error)) return
      call check_true(error, pair%fit_error < 1.0e-6_wp, 'soft layer below a hard one')
      if (allocated(error)) return
    end do
    call new_layered_pair(pair, [rigid, rigid], [coating_t(1.0_wp, material_t(1.0_wp, 0.49_wp))], [coating_t :: ], error)
    if (allocated(error)) return
    call check_true(error, pair%fit_error < 1.0e-6_wp, 'layer on a rigid base')
    if (allocated(error)) return
    call new_layered_pair(pair, [material_t(1.0_wp, 0.3_wp), material_t(3.0_wp, 0.2_wp)], &
                          [coating_t(1.0_wp, material_t(3.0_wp, 0.25_wp)), coating_t(0.2_wp, material_t(0.5_wp, 0.4_wp))], &
                          [coating_t(4.0_wp, material_t(1.0_wp, 0.3_wp))], error)
    if (allocated(error)) return
    call check_true(error, pair%fit_error < 1.0e-6_wp, 'layers on both bodies')
  end subroutine test_fits

  !> The transform of the blocks on a window that repeats: that of long waves is the response.
  subroutine test_symbols(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 64
    type(layered_pair_t) :: pair
    class(block_symbols_t), allocatable :: symbols
    real(wp) :: block(0:n - 1, n_block), k(2), response(n_response), expected(n_block), basis(2, 2)

    call new_layered_pair(pair, [material_t(1.0_wp, 0.3_wp), material_t(3.0_wp, 0.2_wp)], &
                          [coating_t(3.0_wp, material_t(4.0_wp, 0.25_wp))], [coating_t :: ], error)
    if (allocated(error)) return
    basis = reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 2])
    call pair%new_block_symbols(basis, [n, n], n_block, symbols)
    call symbols%column(1, block)
    k = 2.0_wp*pi/n*[1.0_wp, 2.0_wp]
    associate (length => norm2(k), c => k(1)/norm2(k), s => k(2)/norm2(k))
      response = 2.0_wp*pi/length*pair%response(length)
      expected = [response(1), response(2)*c**2 + response(3)*s**2, (response(2) - response(3))*c*s, &
                  response(2)*s**2 + response(3)*c**2, -response(4)*c, -response(4)*s]
    end associate
    ! a pyramid is no wave: the difference is (k l)^2/12
    call check(error, block(2, :)/expected(1), expected/expected(1), 8.0e-3_wp, 'blocks of a long wave')
  end subroutine test_symbols

  !> On rigid bases a uniform traction has a displacement.
  subroutine test_mean(error)
    type(error_t), allocatable, intent(out) :: error
    type(layered_pair_t) :: pair
    type(material_t) :: rigid
    class(block_symbols_t), allocatable :: symbols
    real(wp) :: block(0:3, n_block)
    real(wp), parameter :: young = 2.0_wp, nu = 0.25_wp, t = 3.0_wp

    rigid%rigid = .true.
    call new_layered_pair(pair, [rigid, rigid], [coating_t(t, material_t(young, nu))], [coating_t :: ], error)
    if (allocated(error)) return
    call pair%new_block_symbols(equilateral_basis(1.0_wp), [4, 4], n_block, symbols)
    call symbols%column(0, block)
    call check(error, block(0, :), t/young*[(1.0_wp + nu)*(1.0_wp - 2.0_wp*nu)/(1.0_wp - nu), 2.0_wp*(1.0_wp + nu), 0.0_wp, &
                                            2.0_wp*(1.0_wp + nu), 0.0_wp, 0.0_wp], 1.0e-14_wp, 'uniform tractions')
    if (allocated(error)) return
    call new_layered_pair(pair, [rigid, material_t(1.0_wp, 0.3_wp)], [coating_t(t, material_t(young, nu))], [coating_t :: ], error)
    if (allocated(error)) return
    call pair%new_block_symbols(equilateral_basis(1.0_wp), [4, 4], n_block, symbols)
    call symbols%column(0, block)
    call check(error, block(0, :), [0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], 0.0_wp, 'from the mean planes')
  end subroutine test_mean

  !> Two like bodies with like coatings do not couple; two of like surfaces on unlike bodies do.
  subroutine test_like(error)
    type(error_t), allocatable, intent(out) :: error
    type(material_t), parameter :: layer = material_t(3.0_wp, 0.25_wp)
    type(layered_pair_t) :: pair
    type(coating_t) :: coating(1)

    coating = coating_t(0.7_wp, layer)
    call new_layered_pair(pair, [material_t(1.0_wp, 0.3_wp), material_t(1.0_wp, 0.3_wp)], coating, coating, error)
    if (allocated(error)) return
    call check_true(error, .not. pair%couples(), 'like bodies')
    if (allocated(error)) return
    call new_layered_pair(pair, [material_t(1.0_wp, 0.3_wp), layer], coating, [coating_t :: ], error)
    if (allocated(error)) return
    call check_true(error, pair%couples() .and. abs(pair%lambda_2) <= 0.0_wp, 'like surfaces')
  end subroutine test_like

  !> Press and shear by both methods.
  subroutine test_methods(error)
    type(error_t), allocatable, intent(out) :: error
    type(layered_pair_t) :: pair
    type(friction_problem_t) :: problem
    type(frictional_contact_t) :: contact
    type(direct_friction_t) :: direct
    type(contact_state_t) :: one, other
    type(lattice_t) :: lattice
    integer, parameter :: n = 10
    real(wp), dimension(2*n + 1, 2*n + 1) :: x, y

    call new_layered_pair(pair, [material_t(2.0_wp, 0.3_wp), material_t(4.0_wp, 0.1_wp)], &
                          [coating_t(0.3_wp, material_t(4.0_wp, 0.2_wp))], [coating_t :: ], error)
    if (allocated(error)) return
    call new_lattice(lattice, equilateral_basis(1.3_wp/n), [-n, -n], [2*n + 1, 2*n + 1], error)
    if (allocated(error)) return
    call lattice%coordinates(x, y)
    call new_friction_problem(problem, lattice, pair, 0.5_wp*(x**2 + y**2), x < 9.0_wp, coulomb_t(0.4_wp), .false., error)
    if (allocated(error)) return
    call new_frictional_contact(contact, problem, error)
    if (.not. allocated(error)) call press_and_shear(contact, one, error)
    if (.not. allocated(error)) call new_direct_friction(direct, problem, error)
    if (.not. allocated(error)) call press_and_shear(direct, other, error)
    if (allocated(error)) return
    call check(error, largest(one%pressure - other%pressure), 0.0_wp, 1.0e-8_wp, 'pressure')
    if (allocated(error)) return
    call check(error, largest(one%traction - other%traction), 0.0_wp, 1.0e-7_wp, 'shear traction')
  end subroutine test_methods

  subroutine press_and_shear(solver, state, error)
    class(friction_solver_t), intent(inout) :: solver
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error
    type(contact_state_t) :: next
    real(wp) :: value(4)
    integer :: i

    call new_friction_state(state, solver%problem%lattice)
    do i = 1, 2
      value = [1.5_wp, 0.0_wp, 0.0_wp, 0.0_wp]
      if (i == 2) value(2:3) = [0.3_wp, -0.1_wp]
      call solver%solve_step(state, state%relative_displacement, load_target_t([f, f, f, d], value), 1.0e-10_wp, 60, next, error)
      if (allocated(error)) return
      state = next
      call check_true(error, state%converged, 'the step converges')
      if (allocated(error)) return
    end do
  end subroutine press_and_shear

  !> Layers of no use are refused.
  subroutine test_refused(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: raised
    type(layered_pair_t) :: pair
    type(material_t) :: rigid
    type(material_t), parameter :: soft = material_t(1.0_wp, 0.3_wp)

    rigid%rigid = .true.
    call new_layered_pair(pair, [soft, rigid], [coating_t(0.0_wp, soft)], [coating_t :: ], raised)
    call check_raised(error, raised, 1, 'thickness')
    if (allocated(error)) return
    call new_layered_pair(pair, [soft, rigid], [coating_t(1.0_wp, soft), coating_t(1.0_wp, material_t(1.0_wp, 0.5_wp))], &
                          [coating_t :: ], raised)
    call check_raised(error, raised, 1, 'below 0.5')
    if (allocated(error)) return
    call new_layered_pair(pair, [material_t(1.0_wp, 0.7_wp), rigid], [coating_t(1.0_wp, soft)], [coating_t :: ], raised)
    call check_raised(error, raised, 1, 'body 1')
    if (allocated(error)) return
    call new_layered_pair(pair, [soft, rigid], [coating_t(1.0_wp, material_t(1.0e6_wp, 0.3_wp))], [coating_t :: ], raised)
    call check_raised(error, raised, 1, 'ratios of moduli')
  end subroutine test_refused

end module test_layers
