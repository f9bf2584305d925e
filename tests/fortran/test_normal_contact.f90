!> What makes frictionless contact fast: kernels by symmetry, displacements continued beyond the edge, corrections
!> in single precision.
module test_normal_contact
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan, ieee_positive_inf
  use hc_build_options, only: debug_checks
  use hc_precision, only: wp, sp, lk, pi
  use hc_error, only: error_t
  use hc_lattice, only: lattice_t, new_lattice, equilateral_basis
  use hc_field_space, only: field_space_t
  use hc_elastic_pair, only: elastic_pair_t
  use hc_flexibility, only: normal
  use hc_flexibility_fft, only: fft_flexibility_t, new_fft_flexibility, of_pressure
  use hc_pyramid_influence, only: pyramid_t, new_pyramid, k_1
  use hc_pressure_kernel, only: normal_kernel_t
  use hc_lattice_symbol, only: lattice_symbols
  use hc_periodic_symbol, only: sinc
  use hc_transfer, only: prolong, prolong_edge
  use hc_edge_continuation, only: edge_extension_t, new_edge_extension
  use hc_inverse_symbol, only: inverse_symbol_t, new_inverse_symbol
  use hc_options, only: preconditioner_options_t
  use hc_contact_state, only: contact_state_t, force_control, displacement_control
  use hc_contact_residuals, only: normal_residual, normal_self_compliance
  use hc_normal_rows, only: limits_t, classification_t, classify_row, residual_row, sum_row, projected_row, direction_row
  use hc_normal_contact, only: normal_contact_t, new_normal_contact
  use test_flexibility, only: undone
  use testing, only: test_t, new_test, check, check_true, largest
  implicit none
  private

  public :: collect_normal_contact

contains

  subroutine collect_normal_contact(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('kernel_by_symmetry', test_kernel), &
      new_test('rows', test_rows), &
      new_test('rows_not_finite', test_rows_not_finite), &
      new_test('symbols', test_symbols), &
      new_test('prolonged_edge', test_prolonged_edge), &
      new_test('transpose', test_transpose), &
      new_test('continuation_pays', test_continuation), &
      new_test('scattered_nodes', test_scattered), &
      new_test('tight_tolerance', test_tight), &
      new_test('residual_is_true', test_true_residual), &
      new_test('few_products', test_few_products), &
      new_test('part_of_window', test_part), &
      new_test('part_that_grows', test_growing_part) &
    ]
  end subroutine collect_normal_contact

  !> Passes over a row without branches give what the formulas say, node by node; the gap is infinite where nothing can touch.
  subroutine test_rows(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: p(5) = [2.0_wp, 0.5_wp, 0.0_wp, 0.0_wp, 1.0_wp], w(5) = [0.5_wp, 1.0_wp, 0.25_wp, 0.0_wp, 0.0_wp]
    logical(lk), parameter :: candidate(5) = [.true., .true., .true., .false., .true.]
    logical(lk), parameter :: active(5) = [.true., .true., .false., .false., .false.]
    real(sp), parameter :: z(5) = [1.0_sp, -8.0_sp, 4.0_sp, 2.0_sp, 1.0_sp], punch(5) = [2.0_sp, 1.0_sp, 0.0_sp, 0.0_sp, 0.0_sp]
    real(wp) :: h(5), total, product
    real(sp) :: r(5), d(5)
    type(classification_t) :: found
    logical(lk) :: next(5)

    h = [0.5_wp, 1.0_wp, 0.25_wp, ieee_value(1.0_wp, ieee_positive_inf), 1.25_wp]
    ! gaps of -0.5, 0.5, -1, infinite, -0.25 under an approach of 1.5
    call classify_row(limits_t(2.0_wp, 4.0_wp, 1.5_wp), h, p, w, candidate, active, next, found)
    call check_true(error, all(next .eqv. [.true., .false., .true., .false., .true.]), 'set')
    if (allocated(error)) return
    call check_true(error, found%n_next == 3 .and. found%n_changed == 3 .and. found%finite, 'numbers of nodes')
    if (allocated(error)) return
    call check(error, [found%p_max, found%worst, found%worst_active], [2.0_wp, 4.0_wp, 0.5_wp], 0.0_wp, 'pressure and residuals')
    if (allocated(error)) return

    r = 7.0_sp
    call residual_row(5, 2.0_wp, 1.5_wp, h, w, active, r)
    call check(error, real(r, wp), [1.0_wp, -1.0_wp, 7.0_wp, 7.0_wp, 7.0_wp], 0.0_wp, 'r')
    if (allocated(error)) return
    total = 1.0_wp                                                             ! to which those of the row are added
    product = 1.0_wp
    call sum_row(5, z, active, total, r, product)
    call check(error, [total, product], [-6.0_wp, 10.0_wp], 0.0_wp, 'sums')
    if (allocated(error)) return
    d = 2.0_sp
    call direction_row(5, 0.5_sp, z, active, d)
    call check(error, real(d, wp), [2.0_wp, -7.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], 0.0_wp, 'direction')
    if (allocated(error)) return

    total = 0.0_wp
    call projected_row(0.5_wp, p, active, d, total, [0.0_wp, 0.0_wp], z)
    call check(error, [real(d, wp), total], [0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, -2.0_wp, 5.0_wp], 0.0_wp, 'no step')
    if (allocated(error)) return
    total = 0.0_wp
    call projected_row(0.5_wp, p, active, d, total, [0.5_wp, 0.0_wp], z)
    call check(error, [real(d, wp), total], [0.5_wp, -1.0_wp, 0.0_wp, 0.0_wp, -2.0_wp, 4.5_wp], 0.0_wp, 'step')
    if (allocated(error)) return
    total = 0.0_wp
    call projected_row(0.5_wp, p, active, d, total, [0.5_wp, -0.5_wp], z, punch)
    call check(error, [real(d, wp), total], [1.5_wp, -1.0_wp, 0.0_wp, 0.0_wp, -2.0_wp, 5.5_wp], 0.0_wp, 'step by load')
  end subroutine test_rows

  !> A pressure or closing that is not finite is found, on any node; a build that traps such numbers stops before.
  subroutine test_rows_not_finite(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: p(3), w(3), odd(2)
    type(classification_t) :: found
    integer :: i
    logical(lk) :: next(3)

    if (debug_checks) return
    odd = [ieee_value(1.0_wp, ieee_quiet_nan), ieee_value(1.0_wp, ieee_positive_inf)]
    do i = 0, 3
      p = 1.0_wp
      w = 0.0_wp
      if (i < 2) p(2) = odd(1 + modulo(i, 2))
      if (i >= 2) w(3) = odd(1 + modulo(i, 2))
      call classify_row(limits_t(1.0_wp, 1.0_wp, 0.5_wp), [0.0_wp, 0.0_wp, 0.0_wp], p, w, &
                        [logical(lk) :: .true., .true., .false.], [logical(lk) :: .true., .true., .false.], next, found)
      call check_true(error, .not. found%finite, 'not finite')
      if (allocated(error)) return
    end do
  end subroutine test_rows_not_finite

  !> The table agrees with the pyramid at every offset, on an equilateral and on an oblique lattice.
  subroutine test_kernel(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(pyramid_t) :: pyramid
    type(normal_kernel_t) :: kernel
    real(wp) :: basis(2, 2), row(1, -11:11), all_kernels(5), worst
    integer :: which, i, j

    do which = 1, 2
      basis = equilateral_basis(0.5_wp)
      if (which == 2) basis(:, 2) = [0.1_wp, 0.4_wp]
      call new_lattice(lattice, basis, [0, 0], [12, 9], error)
      if (allocated(error)) return
      kernel = normal_kernel_t()
      call kernel%cover(lattice, elastic_pair_t(1.0_wp, 0.0_wp, 0.0_wp), field_space_t())
      basis = lattice%unit_basis()
      call new_pyramid(pyramid, basis)
      worst = 0.0_wp
      do j = 0, 8
        call kernel%row(j, row)
        do i = -11, 11
          all_kernels = pyramid%kernels(i*basis(1, 1) + j*basis(1, 2), i*basis(2, 1) + j*basis(2, 2))
          worst = largest([worst, row(1, i)/all_kernels(k_1) - 1.0_wp])
        end do
      end do
      call check(error, worst, 0.0_wp, 1.0e-14_wp, 'kernel')
      if (allocated(error)) return
    end do
  end subroutine test_kernel

  !> The fast sum over aliases agrees with the careful one at every frequency.
  subroutine test_symbols(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: length(2) = [12, 18]
    integer :: f(2, length(1)*length(2)), i, j
    real(wp) :: normal(size(f, 2), 1), symbol(size(f, 2), 3), careful(3), worst(2), basis(2, 2)

    ! a basis without symmetry: no symbol vanishes
    basis = reshape([0.3_wp, 0.0_wp, 0.1_wp, 0.35_wp], [2, 2])
    f = reshape([((i, j, i=0, length(1) - 1), j=0, length(2) - 1)], shape(f))
    call lattice_symbols(basis, length, f, normal)
    call lattice_symbols(basis, length, f, symbol)
    worst = 0.0_wp
    do i = 1, size(f, 2)
      careful = careful_symbols(basis, length, f(:, i))
      worst = [largest([worst(1), normal(i, 1)/careful(1) - 1.0_wp]), largest([worst(2), (symbol(i, :) - careful)/careful(1)])]
    end do
    call check(error, worst(1), 0.0_wp, 1.0e-13_wp, 'symbol of K1')
    if (allocated(error)) return
    call check(error, worst(2), 0.0_wp, 1.0e-13_wp, 'symbols of all kernels')
  end subroutine test_symbols

  !> Compute the symbols of K1, K_xx and K_xy at one frequency, term by term.
  pure function careful_symbols(basis, length, frequency) result(symbol)
    !> Basis vectors as columns [m]
    real(wp), intent(in) :: basis(2, 2)
    !> Number of columns and rows of the grid
    integer, intent(in) :: length(2)
    !> Frequency indices, of any sign
    integer, intent(in) :: frequency(2)
    real(wp) :: symbol(3)

    real(wp) :: area, theta(2)
    integer :: wrapped(2)

    area = basis(1, 1)*basis(2, 2) - basis(2, 1)*basis(1, 2)
    wrapped = modulo(frequency + (length - 1)/2, length) - (length - 1)/2
    if (all(wrapped == 0)) then
      symbol = 2.0_wp*pi*sqrt(area*product(real(length, wp))/pi)*[1.0_wp, 0.5_wp, 0.0_wp]
      return
    end if
    theta = 2.0_wp*pi*wrapped/length
    symbol = alias_sum(basis, area, theta)
    ! On a Nyquist row k and -k are the same frequency: a cut-off sum has to be made even.
    if (any(2*wrapped == length)) then
      where (2*wrapped /= length) theta = -theta
      symbol = 0.5_wp*(symbol + alias_sum(basis, area, theta))
    end if
  end function careful_symbols

  !> Sum the terms of all reciprocal vectors nearby; theta = k.basis in (-pi, pi].
  pure function alias_sum(basis, area, theta) result(total)
    real(wp), intent(in) :: basis(2, 2), area, theta(2)
    real(wp) :: total(3), phase(2), k(2), weight, k_squared
    integer :: i, j

    total = 0.0_wp
    do j = -1, 1
      do i = -1, 1
        phase = theta + 2.0_wp*pi*[i, j]
        ! k from its products with the basis vectors
        k = [phase(1)*basis(2, 2) - phase(2)*basis(2, 1), phase(2)*basis(1, 1) - phase(1)*basis(1, 2)]/area
        weight = product(sinc(0.5_wp*[phase, phase(2) - phase(1)]))
        k_squared = dot_product(k, k)
        total = total + weight*2.0_wp*pi/sqrt(k_squared)*[1.0_wp, k(2)**2/k_squared, -k(1)*k(2)/k_squared]
      end do
    end do
  end function alias_sum

  !> The edge of a Hertzian pressure is found between the coarse nodes: the error is an eighth of that of
  !> plain interpolation at least.
  subroutine test_prolonged_edge(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: fine, coarse
    real(wp), allocatable :: p(:, :), plain(:, :), edge(:, :), exact(:, :)

    call new_lattice(fine, equilateral_basis(1.0_wp/32), [-45, -45], [91, 91], error)
    if (allocated(error)) return
    coarse = fine%coarsened()
    allocate (plain(91, 91))
    allocate (edge, exact, mold=plain)
    p = hertz(coarse)
    exact = hertz(fine)
    call prolong(coarse, p, fine, plain, field_space_t())
    call prolong_edge(coarse, p, fine, edge, field_space_t())
    call check_true(error, norm2(edge - exact) < norm2(plain - exact)/8.8_wp, 'the edge is found between nodes')

  contains

    function hertz(lattice) result(pressure)
      type(lattice_t), intent(in) :: lattice
      real(wp), allocatable :: pressure(:, :), x(:, :), y(:, :)

      allocate (x(lattice%extent(1), lattice%extent(2)))
      allocate (y, mold=x)
      call lattice%coordinates(x, y)
      pressure = sqrt(max(1.0_wp - x**2 - y**2, 0.0_wp))
    end function hertz

  end subroutine test_prolonged_edge

  !> A disc of active nodes in the middle of a window.
  pure function disc(n, radius) result(active)
    integer, intent(in) :: n
    real(wp), intent(in) :: radius
    logical(lk) :: active(n, n)
    integer :: i, j
    real(wp) :: x, y

    do j = 1, n
      do i = 1, n
        x = i - (n + 1)/2 + 0.5_wp*(j - (n + 1)/2)
        y = 0.5_wp*sqrt(3.0_wp)*(j - (n + 1)/2)
        active(i, j) = x**2 + y**2 < radius**2
      end do
    end do
  end function disc

  !> y^T E x = (E^T y)^T x for any x on the active nodes and any y.
  subroutine test_transpose(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 41
    type(edge_extension_t) :: edge
    logical(lk) :: active(n, n)
    real(sp), target :: x(n, n), y(n, n), extended(n, n), folded(n, n)
    real(sp), pointer, contiguous :: flat(:)
    real(wp) :: left, right

    active = disc(n, 12.5_wp)
    active(3:5, 30:34) = .true.
    active(1, 1) = .true.
    call new_edge_extension(edge, active, field_space_t(2), preconditioner_options_t())
    call random_number(x)
    call random_number(y)
    x = merge(x, 0.0_sp, active)
    extended = x
    flat(1:n*n) => extended
    call edge%extend(flat)
    call check_true(error, count(abs(extended) > 0.0_sp) > count(active) + 200, 'nodes beyond the edge take part')
    if (allocated(error)) return
    call check_true(error, all(abs(extended - x) <= 0.0_sp .or. .not. active), 'the active nodes keep their values')
    if (allocated(error)) return
    folded = y
    flat(1:n*n) => folded
    call edge%fold(flat)
    left = sum(real(y, wp)*extended)
    right = sum(real(folded, wp)*x, mask=active)
    call check(error, left, right, 1.0e-6_wp*abs(right), 'y^T E x')
  end subroutine test_transpose

  !> Conjugate gradients on a disc need half of the iterations with the continuation.
  subroutine test_continuation(error)
    type(error_t), allocatable, intent(out) :: error
    integer :: plain, continued

    call iterations(.false., plain, error)
    if (allocated(error)) return
    call iterations(.true., continued, error)
    if (allocated(error)) return
    call check_true(error, 3*continued <= 2*plain, 'a third of the iterations is saved')
  end subroutine test_continuation

  !> Iterations of preconditioned conjugate gradients to 1e-5 for a rigid punch.
  subroutine iterations(continued, n_iteration, error)
    logical, intent(in) :: continued
    integer, intent(out) :: n_iteration
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 121
    type(lattice_t) :: lattice
    type(fft_flexibility_t) :: flexibility
    type(inverse_symbol_t) :: preconditioner
    type(edge_extension_t) :: edge
    logical(lk) :: active(n, n)
    real(wp), dimension(n, n, 1) :: x, r, z, d, kd
    real(wp) :: rz, rz_old, step
    integer :: i

    call new_lattice(lattice, equilateral_basis(1.0_wp), [-60, -60], [n, n], error)
    if (.not. allocated(error)) then
      call new_fft_flexibility(flexibility, lattice, elastic_pair_t(1.0_wp, 0.0_wp, 0.0_wp), error, kind=of_pressure)
    end if
    if (allocated(error)) return
    call new_inverse_symbol(preconditioner, lattice, elastic_pair_t(1.0_wp, 0.0_wp, 0.0_wp), field_space_t(), error)
    if (allocated(error)) return
    active = disc(n, 40.3_wp)
    call new_edge_extension(edge, active, field_space_t(2), preconditioner_options_t())
    x = 0.0_wp
    r(:, :, 1) = merge(1.0_wp, 0.0_wp, active)
    do i = 1, n, 2
      r(i, :, 1) = -0.7_wp*r(i, :, 1)
    end do
    d = 0.0_wp
    rz_old = 1.0_wp
    do n_iteration = 0, 60
      if (maxval(abs(r)) < 1.0e-5_wp) exit
      if (continued) then
        z = undone(preconditioner, r, edge)
      else
        z = undone(preconditioner, r)
      end if
      z(:, :, 1) = merge(z(:, :, 1), 0.0_wp, active)
      rz = sum(r*z)
      d = z + merge(rz/rz_old, 0.0_wp, n_iteration > 0)*d
      rz_old = rz
      call flexibility%apply([normal], d, [normal], kd, error)
      if (allocated(error)) return
      step = rz/sum(d*kd)
      x = x + step*d
      r(:, :, 1) = merge(r(:, :, 1) - step*kd(:, :, 1), 0.0_wp, active)
    end do
  end subroutine iterations

  !> Single nodes have no rings: nothing is wide enough to fall off slowly.
  subroutine test_scattered(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 20
    type(edge_extension_t) :: edge
    logical(lk) :: active(n, n)
    real(sp) :: field(n*n), before(n*n)

    active = .false.
    active(3::5, 3::5) = .true.
    call new_edge_extension(edge, active, field_space_t(2), preconditioner_options_t())
    field = reshape(merge(1.0_sp, 0.0_sp, active), [n*n])
    before = field
    call edge%extend(field)
    call check_true(error, all(abs(field - before) <= 0.0_sp), 'the field is as it was')
    if (allocated(error)) return
    active = .true.
    call new_edge_extension(edge, active, field_space_t(2), preconditioner_options_t())
    field = 1.0_sp
    call edge%extend(field)
    call edge%fold(field)
    call check_true(error, all(abs(field - 1.0_sp) <= 0.0_sp), 'no node is left to continue to')
  end subroutine test_scattered

  !> A sphere of unit radius on a window with the given number of nodes a side.
  subroutine sphere(n, solver, lattice, gap, error)
    integer, intent(in) :: n
    type(normal_contact_t), intent(out) :: solver
    type(lattice_t), intent(out) :: lattice
    real(wp), allocatable, intent(out) :: gap(:, :)
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: x(:, :), y(:, :)
    logical, allocatable :: candidate(:, :)

    call new_lattice(lattice, equilateral_basis(2.7_wp/n), [-n/2, -n/2], [n, n], error)
    if (allocated(error)) return
    allocate (x(n, n), y(n, n), candidate(n, n))
    call lattice%coordinates(x, y)
    gap = 0.5_wp*(x**2 + y**2)
    candidate = .true.
    call new_normal_contact(solver, lattice, elastic_pair_t(1.0_wp/pi, 0.0_wp, 0.0_wp), gap, candidate, error)
  end subroutine sphere

  !> Tolerances far below single precision are met, load included.
  subroutine test_tight(error)
    type(error_t), allocatable, intent(out) :: error
    type(normal_contact_t) :: solver
    type(contact_state_t) :: state
    type(lattice_t) :: lattice
    real(wp), allocatable :: gap(:, :)

    call sphere(60, solver, lattice, gap, error)
    if (allocated(error)) return
    call solver%solve(force_control, 4.0_wp/3.0_wp, 1.0e-12_wp, 60, state, error)
    if (allocated(error)) return
    call check_true(error, state%converged, 'converged under a load')
    if (allocated(error)) return
    call check(error, state%load(normal), 4.0_wp/3.0_wp, 2.0e-12_wp, 'load')
    if (allocated(error)) return
    call solver%solve(displacement_control, 1.0_wp, 1.0e-12_wp, 60, state, error)
    if (allocated(error)) return
    call check_true(error, state%converged, 'converged at an approach')
  end subroutine test_tight

  !> The residual that is reported is that of the pressure, found anew in double precision.
  subroutine test_true_residual(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: tolerance = 1.0e-8_wp
    type(normal_contact_t) :: solver
    type(contact_state_t) :: state
    type(fft_flexibility_t) :: flexibility
    type(elastic_pair_t), parameter :: pair = elastic_pair_t(1.0_wp/pi, 0.0_wp, 0.0_wp)
    type(lattice_t) :: lattice
    real(wp), allocatable :: gap(:, :), pressure(:, :, :), w(:, :, :)
    logical, allocatable :: candidate(:, :)
    real(wp) :: residual

    call sphere(150, solver, lattice, gap, error)
    if (allocated(error)) return
    call solver%solve(force_control, 4.0_wp/3.0_wp, tolerance, 60, state, error)
    if (allocated(error)) return
    call new_fft_flexibility(flexibility, lattice, pair, error, kind=of_pressure)
    if (allocated(error)) return
    pressure = reshape(state%pressure, [150, 150, 1])
    allocate (w, mold=pressure)
    call flexibility%apply([normal], pressure, [normal], w, error)
    if (allocated(error)) return
    allocate (candidate(150, 150), source=.true.)
    residual = normal_residual(state%pressure, gap + w(:, :, 1) - state%motion(normal), candidate, &
                               normal_self_compliance(lattice, pair), field_space_t())
    call check_true(error, state%converged, 'converged')
    if (allocated(error)) return
    call check(error, residual, state%residual_normal, 0.1_wp*tolerance, 'residual')
  end subroutine test_true_residual

  !> Six or seven scalar products, whatever the mesh; corrections in single precision count half.
  subroutine test_few_products(error)
    type(error_t), allocatable, intent(out) :: error
    type(normal_contact_t) :: solver
    type(contact_state_t) :: state
    type(lattice_t) :: lattice
    real(wp), allocatable :: gap(:, :)
    integer :: n

    n = 40
    do while (n <= 320)
      call sphere(n, solver, lattice, gap, error)
      if (allocated(error)) return
      call solver%solve(force_control, 4.0_wp/3.0_wp, 1.0e-8_wp, 60, state, error)
      if (allocated(error)) return
      call check_true(error, state%converged .and. 3.0_wp*state%operator_applications <= 9.0_wp, 'few products')
      if (allocated(error)) return
      n = 2*n
    end do
  end subroutine test_few_products

  !> A small contact off the middle of a large window is solved on a part of it: same pressure, far less work.
  subroutine test_part(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 180
    type(normal_contact_t) :: solver
    type(contact_state_t) :: state, again, small
    type(lattice_t) :: lattice
    real(wp) :: gap(n, n), x(n, n), y(n, n)
    logical :: candidate(n, n)
    type(elastic_pair_t), parameter :: pair = elastic_pair_t(1.0_wp/pi, 0.0_wp, 0.0_wp)

    call new_lattice(lattice, equilateral_basis(0.05_wp), [-50, -30], [n, n], error)
    if (allocated(error)) return
    call lattice%coordinates(x, y)
    gap = 0.5_wp*(x**2 + y**2)
    candidate = .true.
    call new_normal_contact(solver, lattice, pair, gap, candidate, error)
    if (allocated(error)) return
    call solver%solve(force_control, 4.0_wp/3.0_wp, 1.0e-8_wp, 60, state, error)
    if (allocated(error)) return
    call check_true(error, state%converged .and. 3.0_wp*state%operator_applications < 4.0_wp, 'little work')
    if (allocated(error)) return
    call check(error, state%motion(normal), 1.0_wp, 1.2e-4_wp, 'approach of Hertz')
    if (allocated(error)) return
    ! another load, which needs another part, and the first one again
    call solver%solve(force_control, 0.1_wp, 1.0e-8_wp, 60, small, error)
    if (allocated(error)) return
    call solver%solve(force_control, 4.0_wp/3.0_wp, 1.0e-8_wp, 60, again, error)
    if (allocated(error)) return
    call check_true(error, small%converged .and. all(abs(again%pressure - state%pressure) <= 0.0_wp), 'history leaves no trace')
    if (allocated(error)) return
    call check_true(error, minval(state%gap) > -1.0e-9_wp .and. all(state%gap(1, :) > 0.1_wp), 'the gap is known everywhere')
  end subroutine test_part

  !> A pillar between the nodes of the coarse lattices is found all the same: the part grows to it.
  subroutine test_growing_part(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 180
    type(normal_contact_t) :: solver
    type(contact_state_t) :: state
    type(lattice_t) :: lattice
    real(wp) :: gap(n, n), x(n, n), y(n, n)
    logical :: candidate(n, n)

    call new_lattice(lattice, equilateral_basis(0.05_wp), [-90, -90], [n, n], error)
    if (allocated(error)) return
    call lattice%coordinates(x, y)
    gap = 0.5_wp*(x**2 + y**2)
    gap(150, 60) = 0.0_wp
    candidate = .true.
    call new_normal_contact(solver, lattice, elastic_pair_t(1.0_wp/pi, 0.0_wp, 0.0_wp), gap, candidate, error)
    if (allocated(error)) return
    call solver%solve(force_control, 4.0_wp/3.0_wp, 1.0e-8_wp, 200, state, error)
    if (allocated(error)) return
    call check_true(error, state%converged .and. state%pressure(150, 60) > 0.0_wp, 'the pillar carries its share')
  end subroutine test_growing_part

end module test_normal_contact
