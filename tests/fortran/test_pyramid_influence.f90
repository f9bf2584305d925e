!> Kernels of the unit pyramid against 20-digit values, symmetry, and the sum
!> over its triangles, which is an independent route. Errors are relative to K1.
module test_pyramid_influence
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp, pi
  use hc_error, only: error_t
  use hc_lattice, only: equilateral_basis, edge_directions
  use hc_triangle_integrals, only: vertex_kernels, linear_load_displacement
  use hc_pyramid_influence, only: pyramid_t, new_pyramid, k_1, k_xx, k_xy, k_x, k_y
  use testing, only: test_t, new_test, check, check_true, open_table
  implicit none
  private

  public :: collect_pyramid_influence

  !> Ten times better than what is promised
  real(wp), parameter :: thr = 1.0e-13_wp

contains

  subroutine collect_pyramid_influence(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('reference table', test_reference), &
      new_test('special values', test_special), &
      new_test('rotations and mirrors', test_symmetry), &
      new_test('spacing', test_spacing), &
      new_test('sum of six triangles', test_triangles), &
      new_test('oblique lattices', test_oblique), &
      new_test('displacements', test_displacements), &
      new_test('finite everywhere', test_finite) &
    ]
  end subroutine collect_pyramid_influence

  !> Every row of pyramid_kernels.csv.
  subroutine test_reference(error)
    type(error_t), allocatable, intent(out) :: error

    type(pyramid_t) :: pyramid
    character(len=8) :: kind
    real(wp) :: i, j, x, y, expected(5)
    integer :: unit, stat, id, n_row

    call open_table('pyramid_kernels.csv', unit, error)
    if (allocated(error)) return
    call new_pyramid(pyramid, equilateral_basis(1.0_wp))
    n_row = 0
    do
      ! i and j are empty in some rows
      read (unit, *, iostat=stat) id, kind, i, j, x, y, expected
      if (stat /= 0) exit
      n_row = n_row + 1
      call check(error, pyramid%kernels(x, y), expected, thr*expected(k_1), trim(kind)//' point')
      if (allocated(error)) exit
    end do
    close (unit)
    if (.not. allocated(error)) call check(error, n_row, 183, 'rows of pyramid_kernels.csv')
  end subroutine test_reference

  !> K1(0) = (3 sqrt(3)/2) ln 3, a third of it at the neighbours, K_xx(0) = K1(0)/2.
  subroutine test_special(error)
    type(error_t), allocatable, intent(out) :: error

    type(pyramid_t) :: pyramid
    real(wp) :: top

    call new_pyramid(pyramid, equilateral_basis(1.0_wp))
    top = 1.5_wp*sqrt(3.0_wp)*log(3.0_wp)
    call check(error, pyramid%kernels(0.0_wp, 0.0_wp), [top, 0.5_wp*top, 0.0_wp, 0.0_wp, 0.0_wp], thr*top, &
               'at the apex')
    if (allocated(error)) return
    call check(error, pyramid%kernels(1.0_wp, 0.0_wp), &
               [top/3.0_wp, 0.82139746751542477834_wp, 0.0_wp, 0.87969560237940835762_wp, 0.0_wp], thr*top/3.0_wp, &
               'at a neighbour')
  end subroutine test_special

  !> A turn by 60 degrees leaves K1, turns (K_x, K_y) once and the deviator of the
  !> tensor twice; the mirror y -> -y reverses K_xy and K_y; so odd and even follow.
  subroutine test_symmetry(error)
    type(error_t), allocatable, intent(out) :: error

    real(wp), parameter :: mirror(5) = [1.0_wp, 1.0_wp, -1.0_wp, 1.0_wp, -1.0_wp]
    real(wp), parameter :: inversion(5) = [1.0_wp, 1.0_wp, 1.0_wp, -1.0_wp, -1.0_wp]
    type(pyramid_t) :: pyramid
    real(wp) :: points(2, 120), here(5), there(5)
    complex(wp) :: turn, z, odd, deviator
    integer :: p

    call new_pyramid(pyramid, equilateral_basis(1.0_wp))
    turn = cmplx(0.5_wp, 0.5_wp*sqrt(3.0_wp), wp)
    points = test_points()
    do p = 1, size(points, 2)
      associate (x => points(1, p), y => points(2, p))
        here = pyramid%kernels(x, y)
        z = turn*cmplx(x, y, wp)
        odd = turn*cmplx(here(k_x), here(k_y), wp)
        deviator = turn**2*cmplx(2.0_wp*here(k_xx) - here(k_1), 2.0_wp*here(k_xy), wp)
        there = [here(k_1), 0.5_wp*(here(k_1) + real(deviator, wp)), 0.5_wp*aimag(deviator), real(odd, wp), aimag(odd)]
        call check(error, pyramid%kernels(real(z, wp), aimag(z)), there, thr*here(k_1), 'turned by 60 degrees')
        if (allocated(error)) return
        call check(error, pyramid%kernels(x, -y), mirror*here, thr*here(k_1), 'mirrored')
        if (allocated(error)) return
        call check(error, pyramid%kernels(-x, -y), inversion*here, thr*here(k_1), 'inverted')
        if (allocated(error)) return
      end associate
    end do
  end subroutine test_symmetry

  !> Kernels scale with the spacing.
  subroutine test_spacing(error)
    type(error_t), allocatable, intent(out) :: error

    type(pyramid_t) :: unit_pyramid, pyramid
    real(wp), parameter :: spacing(3) = [3.5e-6_wp, 0.2_wp, 1.0e3_wp]
    real(wp) :: points(2, 120), expected(5)
    integer :: s, p

    call new_pyramid(unit_pyramid, equilateral_basis(1.0_wp))
    points = test_points()
    do s = 1, size(spacing)
      call new_pyramid(pyramid, equilateral_basis(spacing(s)))
      do p = 1, size(points, 2)
        expected = spacing(s)*unit_pyramid%kernels(points(1, p), points(2, p))
        call check(error, pyramid%kernels(spacing(s)*points(1, p), spacing(s)*points(2, p)), expected, &
                   thr*expected(k_1), 'other spacing')
        if (allocated(error)) return
      end do
    end do
  end subroutine test_spacing

  !> The pyramid is six linear loads, each one at the apex.
  subroutine test_triangles(error)
    type(error_t), allocatable, intent(out) :: error

    call compare_with_triangles(equilateral_basis(1.0_wp), error)
  end subroutine test_triangles

  !> Creases and moments hold for any basis.
  subroutine test_oblique(error)
    type(error_t), allocatable, intent(out) :: error

    call compare_with_triangles(reshape([1.0_wp, 0.0_wp, 0.4_wp, 0.75_wp], [2, 2]), error)
    if (allocated(error)) return
    call compare_with_triangles(reshape([0.8_wp, -0.1_wp, 0.1_wp, 0.7_wp], [2, 2]), error)
  end subroutine test_oblique

  !> The nine functions of Table 8.1, here as displacements of six triangles.
  subroutine test_displacements(error)
    type(error_t), allocatable, intent(out) :: error

    real(wp), parameter :: g = 1.7_wp, nu = 0.3_wp
    type(pyramid_t) :: pyramid
    real(wp) :: points(2, 120), kernel(5), triangles(2, 3, 6), a, b, c, traction(3, 3), u(3), expected(3, 3)
    integer :: p, direction, i

    a = (1.0_wp - nu)/(2.0_wp*pi*g)
    b = (1.0_wp - 2.0_wp*nu)/(4.0_wp*pi*g)
    c = nu/(2.0_wp*pi*g)
    call new_pyramid(pyramid, equilateral_basis(1.0_wp))
    triangles = triangles_around(equilateral_basis(1.0_wp))
    points = test_points()
    do p = 1, size(points, 2)
      kernel = pyramid%kernels(points(1, p), points(2, p))
      expected(:, 1) = [a*kernel(k_1) + c*kernel(k_xx), c*kernel(k_xy), b*kernel(k_x)]
      expected(:, 2) = [c*kernel(k_xy), a*kernel(k_1) + c*(kernel(k_1) - kernel(k_xx)), b*kernel(k_y)]
      expected(:, 3) = [-b*kernel(k_x), -b*kernel(k_y), a*kernel(k_1)]
      do direction = 1, 3
        traction = 0.0_wp
        traction(direction, 1) = 1.0_wp
        u = 0.0_wp
        do i = 1, 6
          u = u + linear_load_displacement(triangles(:, :, i), points(1, p), points(2, p), traction, g, nu)
        end do
        call check(error, u, expected(:, direction), thr*a*kernel(k_1), 'displacement by a pyramid')
        if (allocated(error)) return
      end do
    end do
  end subroutine test_displacements

  !> On spokes, rims, their prolongations, and as close to them as numbers go.
  subroutine test_finite(error)
    type(error_t), allocatable, intent(out) :: error

    real(wp), parameter :: line(2, 6) = reshape([ &
      0.0_wp, 0.0_wp, 0.5_wp, 0.0_wp, 1.0_wp, 0.0_wp, 2.5_wp, 0.0_wp, 0.25_wp, 0.5_wp, 0.5_wp, 0.5_wp], [2, 6])
    type(pyramid_t) :: pyramid
    real(wp) :: basis(2, 2), point(2), kernel(5)
    integer :: p, q, direction

    basis = equilateral_basis(1.0_wp)
    call new_pyramid(pyramid, basis)
    do p = 1, size(line, 2)
      do q = 0, 32
        do direction = 1, 7
          point = matmul(basis, line(:, p)) + scale(1.0_wp, -33*q)*[cos(real(direction, wp)), sin(real(direction, wp))]
          kernel = pyramid%kernels(point(1), point(2))
          call check_true(error, all(ieee_is_finite(kernel)), 'not finite')
          if (allocated(error)) return
          ! K_xx and K_yy lie between 0 and K1, the others within K1
          call check_true(error, all(abs(kernel) <= (1.0_wp + thr)*kernel(k_1)) .and. kernel(k_xx) >= -thr, &
                          'beyond the envelope')
          if (allocated(error)) return
        end do
      end do
    end do
  end subroutine test_finite

  !> Kernels of a lattice against the sum over the triangles around a node.
  subroutine compare_with_triangles(basis, error)
    !> Basis vectors as columns
    real(wp), intent(in) :: basis(2, 2)
    !> Allocated if they differ
    type(error_t), allocatable, intent(out) :: error

    type(pyramid_t) :: pyramid
    real(wp) :: triangles(2, 3, 6), points(2, 120), kernel(6, 3), total(6)
    integer :: p, i

    call new_pyramid(pyramid, basis)
    triangles = triangles_around(basis)
    points = test_points()
    do p = 1, size(points, 2)
      total = 0.0_wp
      do i = 1, 6
        kernel = vertex_kernels(triangles(:, :, i), points(1, p), points(2, p))
        total = total + kernel(:, 1)
      end do
      ! 1/rho, x/rho^2, y/rho^2, x^2/rho^3, x y/rho^3, y^2/rho^3
      call check(error, pyramid%kernels(points(1, p), points(2, p)), total([1, 4, 5, 2, 3]), thr*total(1), &
                 'sum over the triangles')
      if (allocated(error)) return
      call check(error, total(6), total(1) - total(4), thr*total(1), 'K_yy = K1 - K_xx')
      if (allocated(error)) return
    end do
  end subroutine compare_with_triangles

  !> The six triangles around a node, which is their first vertex.
  pure function triangles_around(basis) result(triangles)
    !> Basis vectors as columns
    real(wp), intent(in) :: basis(2, 2)
    real(wp) :: triangles(2, 3, 6)

    real(wp) :: edges(2, 3), corner(2, 7)
    integer :: i

    edges = edge_directions(basis)
    corner(:, :3) = edges
    corner(:, 4:6) = -edges
    corner(:, 7) = corner(:, 1)
    triangles = 0.0_wp
    do i = 1, 6
      triangles(:, 2:, i) = corner(:, i:i + 1)
    end do
  end function triangles_around

  !> Points at all distances to 1e5: close to the apex, about the rim, about the
  !> radius where the moment expansion takes over.
  pure function test_points() result(points)
    real(wp) :: points(2, 120)

    real(wp), parameter :: radius(20) = [ &
      0.0_wp, 1.0e-9_wp, 0.01_wp, 0.2_wp, 0.5_wp, 0.75_wp, 0.87_wp, 1.0_wp, 1.2_wp, 1.7_wp, 2.3_wp, 2.9_wp, 2.9999_wp, &
      3.0001_wp, 3.2_wp, 5.0_wp, 19.0_wp, 61.0_wp, 1.0e3_wp, 1.0e5_wp]
    integer :: r, q, p

    p = 0
    do r = 1, size(radius)
      do q = 0, 5
        p = p + 1
        points(:, p) = radius(r)*[cos(q + 0.1_wp*r*modulo(q, 3)), sin(q + 0.1_wp*r*modulo(q, 3))]
      end do
    end do
  end function test_points

end module test_pyramid_influence
