!> The flexibility operators: explicit matrix and convolution.
module test_flexibility
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use, intrinsic :: iso_fortran_env, only: int64
  use hc_precision, only: wp, sp, pi
  use hc_error, only: error_t, status
  use hc_lattice, only: lattice_t, new_lattice, equilateral_basis
  use hc_field_space, only: field_space_t
  use hc_elastic_pair, only: elastic_pair_t, material_t, new_elastic_pair
  use hc_flexibility, only: normal, along_x, along_y
  use hc_flexibility_dense, only: dense_flexibility_t, new_dense_flexibility
  use hc_flexibility_fft, only: fft_flexibility_t, new_fft_flexibility, of_pressure
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_contact_residuals, only: normal_self_compliance
  use hc_lattice_symbol, only: lattice_symbols, symbol_1, symbol_xx, symbol_xy
  use hc_triangle_integrals, only: linear_load_displacement
  use hc_inverse_symbol, only: inverse_symbol_t, new_inverse_symbol
  use hc_edge_continuation, only: edge_extension_t
  use testing, only: test_t, new_test, check, check_raised, check_true, largest
  implicit none
  private

  public :: collect_flexibility, undone

  integer, parameter :: all_components(3) = [normal, along_x, along_y]

  interface
    subroutine dsyev(jobz, uplo, n, a, lda, w, work, lwork, info)
      import :: wp
      character(len=1), intent(in) :: jobz, uplo
      integer, intent(in) :: n, lda, lwork
      real(wp), intent(inout) :: a(lda, *)
      real(wp), intent(out) :: w(*), work(*)
      integer, intent(out) :: info
    end subroutine dsyev
  end interface

contains

  subroutine collect_flexibility(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('elastic_pair', test_elastic_pair), &
      new_test('bad_materials', test_bad_materials), &
      new_test('two_half_spaces', test_two_half_spaces), &
      new_test('dense_equals_fft', test_dense_equals_fft), &
      new_test('any_lattice', test_any_lattice), &
      new_test('components', test_components), &
      new_test('positive_definite', test_positive_definite), &
      new_test('threads', test_threads), &
      new_test('nothing_left_behind', test_nothing_left_behind), &
      new_test('shared_spectra', test_shared_spectra), &
      new_test('copies', test_copies), &
      new_test('wrong_shapes', test_wrong_shapes), &
      new_test('self_compliance', test_self_compliance), &
      new_test('symbol', test_symbol), &
      new_test('shear_symbol', test_shear_symbol), &
      new_test('preconditioner', test_preconditioner), &
      new_test('shear_preconditioner', test_shear_preconditioner), &
      new_test('preconditioner_definite', test_preconditioner_definite) &
    ]
  end subroutine collect_flexibility

  !> Steel on a rubber-like body: nu = 0.5 takes its own coupling away.
  subroutine test_elastic_pair(error)
    type(error_t), allocatable, intent(out) :: error
    type(elastic_pair_t) :: pair

    call new_elastic_pair(pair, material_t(210.0_wp, 0.3_wp), material_t(6.0_wp, 0.5_wp), error)
    if (allocated(error)) return
    ! 1/E* = sum (1 - nu^2)/E
    call check(error, pair%effective_modulus(), 1.0_wp/(0.91_wp/210.0_wp + 0.75_wp/6.0_wp), 1.0e-13_wp, 'E*')
    if (allocated(error)) return
    ! G_1 = 210/2.6, lambda_2 = (1 - 0.6)/(4 pi G_1)
    call check(error, pair%lambda_2, 0.4_wp*2.6_wp/(4*pi*210.0_wp), 1.0e-16_wp, 'lambda_2')
    if (allocated(error)) return
    ! rigid plane: beta = (1 - 2 nu)/(2 - 2 nu)
    call new_elastic_pair(pair, material_t(1.0_wp, 0.2_wp), material_t(rigid=.true.), error)
    if (allocated(error)) return
    call check(error, pair%beta(), 0.6_wp/1.6_wp, 1.0e-15_wp, 'beta on a rigid plane')
    if (allocated(error)) return
    call check(error, pair%gamma(), 0.2_wp/0.8_wp, 1.0e-15_wp, 'gamma on a rigid plane')
  end subroutine test_elastic_pair

  !> A product is to the bit that of an operator that was never used, whatever was multiplied before.
  subroutine test_nothing_left_behind(error)
    type(error_t), allocatable, intent(out) :: error
    type(elastic_pair_t) :: pair
    type(lattice_t) :: lattice
    integer :: n_row

    call new_elastic_pair(pair, material_t(2.0_wp, 0.25_wp), material_t(5.0_wp, 0.1_wp), error)
    if (allocated(error)) return
    do n_row = 30, 31
      call new_lattice(lattice, equilateral_basis(0.5_wp), [-4, -3], [60, n_row], error)
      if (allocated(error)) return
      call compare(n_row)
      if (allocated(error)) return
    end do

  contains

    subroutine compare(n_row)
      integer, intent(in) :: n_row
      type(fft_flexibility_t) :: used, fresh
      real(wp) :: traction(60, n_row, 3), answer(60, n_row, 3), expected(60, n_row, 3)
      integer :: i

      traction = reshape([(sin(1.3_wp*i), i=1, size(traction))], shape(traction))
      call new_fft_flexibility(used, lattice, pair, error)
      if (allocated(error)) return
      call new_fft_flexibility(fresh, lattice, pair, error)
      if (allocated(error)) return
      call used%apply(all_components, 1.0e40_wp*traction, all_components, answer, error)
      if (allocated(error)) return
      call used%apply([normal], traction(:, :, :1), all_components, answer, error)
      if (allocated(error)) return
      call fresh%apply([normal], traction(:, :, :1), all_components, expected, error)
      if (allocated(error)) return
      call check(error, largest(answer - expected), 0.0_wp, 0.0_wp, 'a product after a large one')
    end subroutine compare

  end subroutine test_nothing_left_behind

  subroutine test_bad_materials(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: raised
    type(elastic_pair_t) :: pair
    type(material_t) :: good, bad(5)
    integer :: i

    good = material_t(1.0_wp, 0.3_wp)
    bad = [material_t(-1.0_wp, 0.3_wp), material_t(0.0_wp, 0.3_wp), material_t(1.0_wp, 0.6_wp), material_t(1.0_wp, -1.0_wp), &
           material_t(ieee_value(1.0_wp, ieee_quiet_nan), 0.3_wp)]
    do i = 1, size(bad)
      call new_elastic_pair(pair, good, bad(i), raised)
      call check_raised(error, raised, status%invalid_input, 'a bad material')
      if (allocated(error)) return
    end do
    call new_elastic_pair(pair, material_t(rigid=.true.), material_t(rigid=.true.), raised)
    call check_raised(error, raised, status%invalid_input, 'two rigid bodies')
  end subroutine test_bad_materials

  !> The operator against the two half-spaces apart, six triangles of linear traction at a time.
  !>
  !> Body 2 is seen in its mirrored frame, in which the tangential tractions are reversed.
  subroutine test_two_half_spaces(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(material_t) :: body(2)
    type(elastic_pair_t) :: pair
    type(dense_flexibility_t) :: dense
    real(wp) :: traction(7, 7, 3), answer(7, 7, 3), x(7, 7), y(7, 7), load(3), u(3, 2), triangle(2, 3), corner(3, 3)
    integer :: i, b, col, row
    integer, parameter :: around(2, 7) = reshape([1, 0, 0, 1, -1, 1, -1, 0, 0, -1, 1, -1, 1, 0], [2, 7])

    body = [material_t(2.0_wp, 0.25_wp), material_t(5.0_wp, 0.1_wp)]
    call new_elastic_pair(pair, body(1), body(2), error)
    if (allocated(error)) return
    call new_lattice(lattice, equilateral_basis(0.5_wp), [-3, -3], [7, 7], error)
    if (allocated(error)) return
    call new_dense_flexibility(dense, lattice, pair, error)
    if (allocated(error)) return
    load = [1.0_wp, 0.7_wp, -0.4_wp]                      ! p, q_x, q_y of the node (0, 0)
    traction = 0.0_wp
    traction(4, 4, :) = load
    call dense%apply(all_components, traction, all_components, answer, error)
    if (allocated(error)) return
    call lattice%coordinates(x, y)
    do row = 1, 7
      do col = 1, 7
        u = 0.0_wp
        do b = 1, 2
          corner = 0.0_wp
          corner(:, 1) = merge([load(2), load(3), load(1)], [-load(2), -load(3), load(1)], b == 1)
          do i = 1, 6
            triangle(:, 1) = 0.0_wp
            triangle(:, 2) = matmul(lattice%basis, around(:, i))
            triangle(:, 3) = matmul(lattice%basis, around(:, i + 1))
            u(:, b) = u(:, b) + linear_load_displacement(triangle, x(col, row), y(col, row), corner, &
                                  body(b)%young_modulus/(2 + 2*body(b)%poisson_ratio), body(b)%poisson_ratio)
          end do
        end do
        call check(error, answer(col, row, :), [u(3, 1) + u(3, 2), u(1, 1) - u(1, 2), u(2, 1) - u(2, 2)], &
                   1.0e-13_wp, 'closing of the gap and tangential displacement')
        if (allocated(error)) return
      end do
    end do
  end subroutine test_two_half_spaces

  !> Both operators agree to 1e-12 on random tractions.
  subroutine test_dense_equals_fft(error)
    type(error_t), allocatable, intent(out) :: error
    call compare(equilateral_basis(2.5e-6_wp), [17, 12], error)
    if (allocated(error)) return
    call compare(equilateral_basis(1.0_wp), [1, 9], error)
    if (allocated(error)) return
    call compare(equilateral_basis(1.0_wp), [8, 1], error)
  end subroutine test_dense_equals_fft

  !> Nothing above the lattice knows 60 degrees.
  subroutine test_any_lattice(error)
    type(error_t), allocatable, intent(out) :: error
    call compare(reshape([1.3_wp, 0.1_wp, 0.4_wp, 1.1_wp], [2, 2]), [9, 14], error)
  end subroutine test_any_lattice

  !> Compare the two operators on one window.
  subroutine compare(basis, extent, error)
    !> Basis vectors as columns [m]
    real(wp), intent(in) :: basis(2, 2)
    !> Number of columns and rows
    integer, intent(in) :: extent(2)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(elastic_pair_t) :: pair
    type(dense_flexibility_t) :: dense
    type(fft_flexibility_t) :: fft
    real(wp), dimension(extent(1), extent(2), 3) :: traction, u, v

    call new_lattice(lattice, basis, [-3, 5], extent, error)
    if (allocated(error)) return
    pair = elastic_pair_t(1.0_wp, -0.3_wp, 0.6_wp)
    call new_dense_flexibility(dense, lattice, pair, error)
    if (allocated(error)) return
    call new_fft_flexibility(fft, lattice, pair, error)
    if (allocated(error)) return
    call random_number(traction)
    traction = traction - 0.4_wp
    call dense%apply(all_components, traction, all_components, u, error)
    if (allocated(error)) return
    call fft%apply(all_components, traction, all_components, v, error)
    if (allocated(error)) return
    call check(error, reshape(v, [size(v)]), reshape(u, [size(u)]), 1.0e-12_wp*maxval(abs(u)), 'convolution')
  end subroutine compare

  !> A block alone is that block of the whole; the work is counted by its components.
  subroutine test_components(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(fft_flexibility_t) :: fft
    real(wp) :: traction(10, 7, 3), whole(10, 7, 3), part(10, 7, 1)
    integer :: i, o

    call new_lattice(lattice, equilateral_basis(1.0_wp), [0, 0], [10, 7], error)
    if (allocated(error)) return
    call new_fft_flexibility(fft, lattice, elastic_pair_t(1.0_wp, 0.2_wp, 0.5_wp), error)
    if (allocated(error)) return
    do i = 1, 3
      traction = 0.0_wp
      call random_number(traction(:, :, i))
      call fft%apply(all_components, traction, all_components, whole, error)
      if (allocated(error)) return
      do o = 1, 3
        fft%applications = 0.0_wp
        call fft%apply([i], traction(:, :, i:i), [o], part, error)
        if (allocated(error)) return
        call check(error, reshape(part, [70]), reshape(whole(:, :, o), [70]), 1.0e-13_wp*maxval(abs(whole)), 'block')
        if (allocated(error)) return
        call check(error, fft%applications, 1.0_wp/3.0_wp, 1.0e-15_wp, 'count of a scalar block')
        if (allocated(error)) return
      end do
    end do
  end subroutine test_components

  !> Symmetric (Betti) to 1e-13 and positive definite for couplings up to the largest possible ones.
  subroutine test_positive_definite(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(dense_flexibility_t) :: dense
    integer, parameter :: n = 3*81
    real(wp) :: matrix(n, n), unit(n), column(9, 9, 3), values(n), work(8*n), asymmetry
    real(wp), parameter :: beta(3) = [0.0_wp, 0.5_wp, -0.5_wp], gamma(3) = [1.0_wp, 0.0_wp, 1.0_wp]
    integer :: i, k, info

    call new_lattice(lattice, equilateral_basis(1.0_wp), [-4, -4], [9, 9], error)
    if (allocated(error)) return
    do i = 1, 3
      call new_dense_flexibility(dense, lattice, elastic_pair_t(1.0_wp, beta(i), gamma(i)), error)
      if (allocated(error)) return
      do k = 1, n
        unit = 0.0_wp
        unit(k) = 1.0_wp
        call dense%apply(all_components, reshape(unit, [9, 9, 3]), all_components, column, error)
        if (allocated(error)) return
        matrix(:, k) = reshape(column, [n])
      end do
      asymmetry = largest(matrix - transpose(matrix))
      call check(error, asymmetry, 0.0_wp, 1.0e-13_wp, 'asymmetry')
      if (allocated(error)) return
      call dsyev('N', 'U', n, matrix, n, values, work, size(work), info)
      call check_true(error, info == 0 .and. minval(values) > 0.01_wp*maxval(values)/sqrt(real(n, wp)), 'positive definite')
      if (allocated(error)) return
    end do
  end subroutine test_positive_definite

  !> The number of threads does not change a single bit.
  subroutine test_threads(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(fft_flexibility_t) :: one, three
    real(wp) :: traction(53, 61, 3), u(53, 61, 3), v(53, 61, 3)

    call new_lattice(lattice, equilateral_basis(1.0_wp), [0, 0], [53, 61], error)
    if (allocated(error)) return
    call new_fft_flexibility(one, lattice, elastic_pair_t(1.0_wp, 0.2_wp, 0.5_wp), error, space=field_space_t(1))
    if (allocated(error)) return
    call new_fft_flexibility(three, lattice, elastic_pair_t(1.0_wp, 0.2_wp, 0.5_wp), error, space=field_space_t(3))
    if (allocated(error)) return
    call random_number(traction)
    call one%apply(all_components, traction, all_components, u, error)
    if (allocated(error)) return
    call three%apply(all_components, traction, all_components, v, error)
    if (allocated(error)) return
    call check(error, reshape(v, [size(v)]), reshape(u, [size(u)]), 0.0_wp, 'three threads')
  end subroutine test_threads

  !> Copies of operators, and of what holds them, go without taking anything with them, and stay when the first one goes;
  !> nothing is freed twice.
  subroutine test_copies(error)
    type(error_t), allocatable, intent(out) :: error
    type :: holder_t
      type(fft_flexibility_t) :: flexibility
      type(fft_flexibility_t), allocatable :: others(:)
    end type holder_t
    type(holder_t) :: first
    type(holder_t), allocatable :: second, third(:)
    type(lattice_t) :: lattice
    real(wp) :: traction(23, 21, 3), u(23, 21, 3), v(23, 21, 3)
    type(elastic_pair_t), parameter :: pair = elastic_pair_t(3.0_wp, 0.6_wp, 1.5_wp)
    integer :: i

    call new_lattice(lattice, equilateral_basis(0.7_wp), [0, 0], [23, 21], error)
    if (allocated(error)) return
    allocate (first%others(2), second, third(2))
    call new_fft_flexibility(first%flexibility, lattice, pair, error)
    if (allocated(error)) return
    call new_fft_flexibility(first%others(2), lattice, pair, error)
    if (allocated(error)) return
    traction = reshape([(sin(1.3_wp*i), i=1, size(traction))], shape(traction))
    second = first
    third(1) = second
    third(2) = first
    call third(1)%others(2)%apply(all_components, traction, all_components, u, error)
    if (allocated(error)) return
    deallocate (second, third)
    do i = 1, 2
      if (i == 1) call first%flexibility%apply(all_components, traction, all_components, v, error)
      if (i == 2) call first%others(2)%apply(all_components, traction, all_components, v, error)
      if (allocated(error)) return
      call check(error, reshape(v, [size(v)]), reshape(u, [size(u)]), 0.0_wp, 'the operator that was copied')
      if (allocated(error)) return
    end do
    allocate (second)
    call new_fft_flexibility(second%flexibility, lattice, pair, error)
    if (allocated(error)) return
    first%flexibility = second%flexibility
    deallocate (second)
    call first%flexibility%apply(all_components, traction, all_components, v, error)
    if (allocated(error)) return
    call check(error, reshape(v, [size(v)]), reshape(u, [size(u)]), 0.0_wp, 'the copy that is left')
  end subroutine test_copies

  !> Operators of one window share their spectra, on any spacing; with a cache they give the same bits as without.
  subroutine test_shared_spectra(error)
    type(error_t), allocatable, intent(out) :: error
    type(kernel_cache_t), pointer :: cache
    type(kernel_cache_t) :: other
    type(lattice_t) :: lattice, finer, oblique
    type(fft_flexibility_t) :: alone, shared(5)
    real(wp) :: traction(23, 21, 3), u(23, 21, 3), v(23, 21, 3), basis(2, 2)
    type(elastic_pair_t), parameter :: pair = elastic_pair_t(3.0_wp, 0.6_wp, 1.5_wp)

    allocate (cache)
    call cache%limit(10000000_int64)
    basis = equilateral_basis(0.7_wp)
    call new_lattice(lattice, basis, [0, 0], [23, 21], error)
    if (allocated(error)) return
    call new_lattice(finer, equilateral_basis(1.9e-6_wp), [-5, 3], [23, 21], error)
    if (allocated(error)) return
    basis(1, 2) = 1.01_wp*basis(1, 2)
    call new_lattice(oblique, basis, [0, 0], [23, 21], error)
    if (allocated(error)) return
    call new_fft_flexibility(alone, lattice, pair, error)
    if (allocated(error)) return
    call new_fft_flexibility(shared(1), lattice, pair, error, cache=cache)
    if (allocated(error)) return
    call new_fft_flexibility(shared(2), lattice, pair, error, cache=cache)
    if (allocated(error)) return
    call new_fft_flexibility(shared(3), finer, pair, error, cache=cache)
    if (allocated(error)) return
    call check_true(error, cache%found == 2 .and. cache%missed == 1, 'once made, twice found')
    if (allocated(error)) return
    call check_true(error, associated(shared(1)%convolution%spectrum, shared(2)%convolution%spectrum) .and. &
                    associated(shared(1)%convolution%spectrum, shared(3)%convolution%spectrum), 'in memory once')
    if (allocated(error)) return
    call new_fft_flexibility(shared(4), oblique, pair, error, cache=cache)
    if (allocated(error)) return
    call new_fft_flexibility(shared(5), lattice, pair, error, kind=of_pressure, cache=cache)
    if (allocated(error)) return
    call check_true(error, cache%found == 2 .and. cache%missed == 3, 'another lattice, other components')
    if (allocated(error)) return
    other = cache
    call check_true(error, other%bound == cache%bound .and. other%stored == 0, 'a copy of a cache begins empty')
    if (allocated(error)) return
    ! what is in use stays when the cache goes
    deallocate (cache)
    call random_number(traction)
    call alone%apply(all_components, traction, all_components, u, error)
    if (allocated(error)) return
    call shared(2)%apply(all_components, traction, all_components, v, error)
    if (allocated(error)) return
    call check(error, reshape(v, [size(v)]), reshape(u, [size(u)]), 0.0_wp, 'found and made')
    if (allocated(error)) return
    call shared(3)%apply(all_components, traction, all_components, v, error)
    if (allocated(error)) return
    v = v/1.9e-6_wp*0.7_wp
    call check(error, reshape(v, [size(v)]), reshape(u, [size(u)]), 1.0e-14_wp*maxval(abs(u)), 'another spacing')
  end subroutine test_shared_spectra

  subroutine test_wrong_shapes(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: raised
    type(lattice_t) :: lattice
    type(fft_flexibility_t) :: fft
    real(wp) :: field(4, 5, 1), answer(5, 4, 1), other(4, 5, 1)

    field = 0.0_wp
    call new_lattice(lattice, equilateral_basis(1.0_wp), [0, 0], [4, 5], error)
    if (allocated(error)) return
    call new_fft_flexibility(fft, lattice, elastic_pair_t(1.0_wp, 0.2_wp, 0.5_wp), error, kind=of_pressure)
    if (allocated(error)) return
    call fft%apply([normal], field, [normal], answer, raised)
    call check_raised(error, raised, status%invalid_input, 'an answer of another shape')
    if (allocated(error)) return
    call fft%apply([normal], field, [along_x], other, raised)
    call check_raised(error, raised, status%invalid_input, 'a component it was not set up for')
  end subroutine test_wrong_shapes

  !> K1(0) = (3 sqrt(3)/2) ln 3 spacings.
  subroutine test_self_compliance(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice

    call new_lattice(lattice, equilateral_basis(2.0_wp), [0, 0], [1, 1], error)
    if (allocated(error)) return
    call check(error, normal_self_compliance(lattice, elastic_pair_t(0.5_wp, 0.0_wp, 0.0_wp)), &
               1.5_wp*sqrt(3.0_wp)*log(3.0_wp), 1.0e-14_wp, 'self-compliance')
  end subroutine test_self_compliance

  !> Long waves: 2 pi/|k|, 2 pi k_y^2/|k|^3 and -2 pi k_x k_y/|k|^3; the symbols are even, also on Nyquist rows.
  subroutine test_symbol(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: basis(2, 2), k
    integer :: i, j

    basis = equilateral_basis(1.0_wp)
    ! the wave vector of the frequency (1, 0) is normal to the second basis vector: k = |k| (sqrt(3)/2, -1/2)
    k = 2*pi/(512*0.5_wp*sqrt(3.0_wp))
    call check(error, symbols_at(basis, [512, 512], [1, 0])*k/(2*pi), [1.0_wp, 0.25_wp, 0.25_wp*sqrt(3.0_wp)], &
               1.4e-5_wp, 'long wave')
    if (allocated(error)) return
    ! and that of (0, 1) is normal to the first one, along y
    call check(error, symbols_at(basis, [512, 512], [0, 1])*k/(2*pi), [1.0_wp, 1.0_wp, 0.0_wp], 1.4e-5_wp, &
               'long wave along y')
    do i = 0, 11
      do j = 0, 9
        if (allocated(error)) return
        call check(error, symbols_at(basis, [12, 10], [i, j]), symbols_at(basis, [12, 10], [-i, -j]), &
                   1.0e-13_wp, 'even symbol')
      end do
    end do
  end subroutine test_symbol

  !> Return the symbols at one frequency of any sign.
  pure function symbols_at(basis, length, frequency) result(symbol)
    real(wp), intent(in) :: basis(2, 2)
    integer, intent(in) :: length(2), frequency(2)
    real(wp) :: symbol(3), all_of(1, 3)
    integer :: f(2, 1)

    f(:, 1) = modulo(frequency, length)
    call lattice_symbols(basis, length, f, all_of)
    symbol = all_of(1, :)
  end function symbols_at

  !> The shear flexibility is positive definite at every frequency, from nu = -1 to 0.5 for both bodies.
  subroutine test_shear_symbol(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: k(3), xx, xy, yy
    real(wp), parameter :: gamma(3) = [-0.5_wp, 0.0_wp, 1.0_wp]
    integer :: i, j, m

    do m = 1, 3
      do j = 0, 8
        do i = 0, 11
          k = symbols_at(equilateral_basis(0.3_wp), [12, 9], [i, j])
          xx = k(symbol_1) + gamma(m)*k(symbol_xx)
          xy = gamma(m)*k(symbol_xy)
          yy = k(symbol_1) + gamma(m)*(k(symbol_1) - k(symbol_xx))
          call check_true(error, xx > 0.0_wp .and. xx*yy - xy**2 > 0.01_wp*xx*yy, 'positive definite')
          if (allocated(error)) return
        end do
      end do
    end do
  end subroutine test_shear_symbol

  !> Estimate the tractions that cause displacements.
  function undone(preconditioner, displacement, edge) result(traction)
    type(inverse_symbol_t), intent(inout) :: preconditioner
    real(wp), intent(in) :: displacement(:, :, :)
    type(edge_extension_t), intent(in), optional :: edge
    real(wp) :: traction(size(displacement, 1), size(displacement, 2), size(displacement, 3))
    real(sp) :: values(size(displacement, 1), size(displacement, 2), size(displacement, 3))

    values = real(displacement/preconditioner%unit, sp)
    call preconditioner%apply_in_place(values, edge)
    traction = values
  end function undone

  !> In the middle of the window the preconditioner undoes the operator within 0.2 per cent.
  subroutine test_preconditioner(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(fft_flexibility_t) :: fft
    type(inverse_symbol_t) :: preconditioner
    type(elastic_pair_t) :: pair
    real(wp), dimension(65, 65, 1) :: traction, closing, back
    real(wp) :: x(65, 65), y(65, 65)

    pair = elastic_pair_t(0.7_wp, 0.0_wp, 0.0_wp)
    call new_lattice(lattice, equilateral_basis(1.0_wp), [-32, -32], [65, 65], error)
    if (allocated(error)) return
    call new_fft_flexibility(fft, lattice, pair, error, kind=of_pressure)
    if (allocated(error)) return
    call new_inverse_symbol(preconditioner, lattice, pair, field_space_t(), error)
    if (allocated(error)) return
    ! waves of zero mean under a wide envelope
    call lattice%coordinates(x, y)
    traction(:, :, 1) = cos(0.9_wp*x + 0.5_wp*y)*exp(-(x**2 + y**2)/100.0_wp)
    call fft%apply([normal], traction, [normal], closing, error)
    if (allocated(error)) return
    back = undone(preconditioner, closing)
    call check(error, reshape(back, [size(back)]), reshape(traction, [size(back)]), 1.4e-3_wp, 'traction')
  end subroutine test_preconditioner

  !> The same for shear tractions, with the coupling of x and y.
  subroutine test_shear_preconditioner(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(fft_flexibility_t) :: fft
    type(inverse_symbol_t) :: preconditioner
    type(elastic_pair_t) :: pair
    real(wp), dimension(65, 65, 2) :: traction, displacement, back
    real(wp) :: x(65, 65), y(65, 65)

    pair = elastic_pair_t(0.7_wp, 0.1_wp, 0.6_wp)
    call new_lattice(lattice, equilateral_basis(1.0_wp), [-32, -32], [65, 65], error)
    if (allocated(error)) return
    call new_fft_flexibility(fft, lattice, pair, error)
    if (allocated(error)) return
    call new_inverse_symbol(preconditioner, lattice, pair, field_space_t(), error, tangential=.true.)
    if (allocated(error)) return
    call lattice%coordinates(x, y)
    traction(:, :, 1) = cos(0.9_wp*x + 0.5_wp*y)*exp(-(x**2 + y**2)/100.0_wp)
    traction(:, :, 2) = sin(0.4_wp*x - 1.1_wp*y)*exp(-(x**2 + y**2)/100.0_wp)
    call fft%apply([along_x, along_y], traction, [along_x, along_y], displacement, error)
    if (allocated(error)) return
    back = undone(preconditioner, displacement)
    call check(error, reshape(back, [size(back)]), reshape(traction, [size(back)]), 2.1e-3_wp, 'shear traction')
  end subroutine test_shear_preconditioner

  !> Both preconditioners are symmetric and positive definite, column by column of their matrices.
  subroutine test_preconditioner_definite(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(inverse_symbol_t) :: preconditioner
    type(elastic_pair_t) :: pair
    integer, parameter :: n_col = 9, n_row = 6
    real(wp), allocatable :: matrix(:, :), unit(:), answer(:, :, :), values(:), work(:)
    integer :: n_component, n, k, info

    pair = elastic_pair_t(0.7_wp, 0.3_wp, 0.7_wp)
    call new_lattice(lattice, equilateral_basis(0.2_wp), [-4, 7], [n_col, n_row], error)
    if (allocated(error)) return
    do n_component = 1, 2
      if (n_component == 1) call new_inverse_symbol(preconditioner, lattice, pair, field_space_t(), error)
      if (n_component == 2) call new_inverse_symbol(preconditioner, lattice, pair, field_space_t(), error, tangential=.true.)
      if (allocated(error)) return
      n = n_col*n_row*n_component
      if (allocated(matrix)) deallocate (matrix, unit, answer, values, work)
      allocate (matrix(n, n), unit(n), answer(n_col, n_row, n_component), values(n), work(8*n))
      do k = 1, n
        unit = 0.0_wp
        unit(k) = 1.0_wp
        answer = undone(preconditioner, reshape(unit, shape(answer)))
        matrix(:, k) = reshape(answer, [n])
      end do
      call check(error, largest(matrix - transpose(matrix)), 0.0_wp, 1.0e-6_wp*maxval(matrix), 'asymmetry')
      if (allocated(error)) return
      call dsyev('N', 'U', n, matrix, n, values, work, size(work), info)
      call check_true(error, info == 0 .and. minval(values) > 0.001_wp*maxval(values), 'positive definite')
      if (allocated(error)) return
    end do
  end subroutine test_preconditioner_definite

end module test_flexibility
