!> Integrals over a triangle against 20-digit values, identities and closed forms.
!>
!> Errors are measured against area * d^(k+m-j), d the distance of the farthest
!> vertex: a lower bound of I_100 d^(k+m+1-j), which is what bounds I_jkm.
module test_triangle_integrals
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_is_nan, ieee_value, ieee_quiet_nan
  use hc_precision, only: wp, xp, pi
  use hc_error, only: error_t, status
  use hc_triangle_integrals, only: triangle_integral, triangle_integrals, is_supported, vertex_kernels, &
    load_displacement, linear_load_displacement, evaluate_integral, evaluate_displacement, &
    evaluate_linear_displacement
  use testing, only: test_t, new_test, check, check_true, check_raised, check_succeeded, fail, open_table
  implicit none
  private

  public :: collect_triangle_integrals

  !> Promised accuracy
  real(wp), parameter :: thr = 1.0e-13_wp
  real(wp), parameter :: round_off = 100.0_wp*epsilon(1.0_wp)
  !> Elastic constants
  real(wp), parameter :: g = 1.7_wp, nu = 0.3_wp

  !> Well-shaped (both orientations), obtuse, and slivers of aspect 8, 470, 8192
  real(wp), parameter :: shapes(2, 3, 6) = reshape([ &
    0.1_wp, -0.2_wp, 1.1_wp, 0.3_wp, 0.4_wp, 0.9_wp, &
    0.1_wp, -0.2_wp, 0.4_wp, 0.9_wp, 1.1_wp, 0.3_wp, &
    0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 1.3_wp, 0.4_wp, &
    0.0_wp, 0.125_wp, 1.0_wp, 0.125_wp, 0.3125_wp, 0.25_wp, &
    -0.3125_wp, 0.6875_wp, 0.4375_wp, 0.09375_wp, 0.125_wp, 0.34375_wp, &
    0.25_wp, 0.125_wp, 1.25_wp, 0.125_wp, 1.25_wp, 0.125_wp + 2.0_wp**(-13)], [2, 3, 6])

contains

  subroutine collect_triangle_integrals(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('reference table', test_reference), &
      new_test('supported exponents', test_supported), &
      new_test('identities', test_identities), &
      new_test('order of vertices', test_order), &
      new_test('scaling', test_scaling), &
      new_test('subdivision', test_subdivision), &
      new_test('finite everywhere', test_finite), &
      new_test('no area', test_no_area), &
      new_test('uniform square', test_square), &
      new_test('tables of displacements', test_tables), &
      new_test('linear load near', test_linear_near), &
      new_test('linear load far', test_linear_far), &
      new_test('many points', test_many), &
      new_test('wrong arguments', test_wrong) &
    ]
  end subroutine collect_triangle_integrals

  !> Every row of triangle_integrals.csv.
  subroutine test_reference(error)
    type(error_t), allocatable, intent(out) :: error

    character(len=24) :: shape_name, place
    real(wp) :: vertices(2, 3), x, y, expected
    integer :: unit, stat, id, orientation, j, k, m, n_row

    call open_table('triangle_integrals.csv', unit, error)
    if (allocated(error)) return
    n_row = 0
    do
      read (unit, *, iostat=stat) id, shape_name, orientation, place, vertices, x, y, j, k, m, expected
      if (stat /= 0) exit
      n_row = n_row + 1
      call check(error, triangle_integral(vertices, x, y, j, k, m), expected, &
                 allowed(vertices, x, y, j, k, m), trim(shape_name)//' '//trim(place))
      if (allocated(error)) exit
    end do
    close (unit)
    if (.not. allocated(error)) call check(error, n_row, 210, 'rows of triangle_integrals.csv')
  end subroutine test_reference

  subroutine test_supported(error)
    type(error_t), allocatable, intent(out) :: error
    integer :: j, k, m

    call check(error, size(all_exponents(), 2), 27, 'number of integrals')
    if (allocated(error)) return
    call check_true(error, .not. any(is_supported([0, 4, 1, 1, 2, 3, 1, 1], [0, 4, -1, 3, 0, 1, 0, 1], &
                                                  [0, 0, 1, 0, 0, 0, 3, 2])), 'exponents outside the list')
    if (allocated(error)) return
    j = 2
    k = 0
    m = 0
    call check_true(error, ieee_is_nan(triangle_integral(shapes(:, :, 1), 0.0_wp, 0.0_wp, j, k, m)), &
                    'exponents outside the list give NaN')
  end subroutine test_supported

  !> I_j,k+2,m + I_j,k,m+2 = I_j-2,k,m and I_220 + I_202 = area.
  subroutine test_identities(error)
    type(error_t), allocatable, intent(out) :: error

    integer, parameter :: low(2, 6) = reshape([0, 0, 1, 0, 0, 1, 2, 0, 1, 1, 0, 2], [2, 6])
    real(wp) :: points(2, 40), left, right
    integer :: s, p, e

    do s = 1, size(shapes, 3)
      points = test_points(shapes(:, :, s))
      do p = 1, size(points, 2)
        associate (v => shapes(:, :, s), x => points(1, p), y => points(2, p))
          do e = 1, size(low, 2)
            associate (k => low(1, e), m => low(2, e))
              left = triangle_integral(v, x, y, 3, k + 2, m) + triangle_integral(v, x, y, 3, k, m + 2)
              right = triangle_integral(v, x, y, 1, k, m)
              call check(error, left, right, 2.0_wp*allowed(v, x, y, 1, k, m), 'I_3,k+2,m + I_3,k,m+2 = I_1,k,m')
              if (allocated(error)) return
            end associate
          end do
          left = triangle_integral(v, x, y, 2, 2, 0) + triangle_integral(v, x, y, 2, 0, 2)
          call check(error, left, area(v), 2.0_wp*allowed(v, x, y, 2, 2, 0), 'I_220 + I_202 = area')
          if (allocated(error)) return
        end associate
      end do
    end do
  end subroutine test_identities

  !> The value depends neither on the first vertex nor on the sense of rotation.
  subroutine test_order(error)
    type(error_t), allocatable, intent(out) :: error

    integer, parameter :: order(3, 3) = reshape([2, 3, 1, 3, 2, 1, 1, 3, 2], [3, 3])
    integer :: exponents(3, 27), s, p, e, q
    real(wp) :: points(2, 40), one(27), other(27)

    exponents = all_exponents()
    do s = 1, size(shapes, 3)
      points = test_points(shapes(:, :, s))
      do p = 1, size(points, 2)
        one = triangle_integrals(shapes(:, :, s), points(1, p), points(2, p), exponents)
        do q = 1, size(order, 2)
          other = triangle_integrals(shapes(:, order(:, q), s), points(1, p), points(2, p), exponents)
          do e = 1, 27
            call check(error, other(e), one(e), allowed(shapes(:, :, s), points(1, p), points(2, p), &
                                                       exponents(1, e), exponents(2, e), exponents(3, e)), &
                       'other order of vertices')
            if (allocated(error)) return
          end do
        end do
      end do
    end do
  end subroutine test_order

  !> I_jkm is homogeneous of degree k + m + 2 - j: exactly so for powers of two.
  subroutine test_scaling(error)
    type(error_t), allocatable, intent(out) :: error

    integer, parameter :: powers(4) = [-200, -3, 5, 200]
    integer :: exponents(3, 27), s, p, e, q
    real(wp) :: points(2, 40), one(27), other(27)

    exponents = all_exponents()
    do s = 1, size(shapes, 3)
      points = test_points(shapes(:, :, s))
      do p = 1, size(points, 2)
        one = triangle_integrals(shapes(:, :, s), points(1, p), points(2, p), exponents)
        do q = 1, size(powers)
          other = triangle_integrals(scale(shapes(:, :, s), powers(q)), scale(points(1, p), powers(q)), &
                                     scale(points(2, p), powers(q)), exponents)
          do e = 1, 27
            other(e) = scale(other(e), -powers(q)*(exponents(2, e) + exponents(3, e) + 2 - exponents(1, e)))
          end do
          call check(error, other, one, 0.0_wp, 'integrals of a scaled triangle')
          if (allocated(error)) return
        end do
      end do
    end do
  end subroutine test_scaling

  !> The four parts of a triangle add up to it: about the switch from the edge
  !> form to quadrature the parts take the other branch.
  subroutine test_subdivision(error)
    type(error_t), allocatable, intent(out) :: error

    real(wp), parameter :: distance(6) = [0.0_wp, 0.5_wp, 1.0_wp, 1.4_wp, 1.499_wp, 1.501_wp]
    integer :: exponents(3, 27), s, e, q, i
    real(wp) :: parts(2, 3, 4), centroid(2), longest, x, y, whole(27), total(27)

    exponents = all_exponents()
    do s = 1, size(shapes, 3)
      parts = quarters(shapes(:, :, s))
      centroid = sum(shapes(:, :, s), dim=2)/3.0_wp
      longest = longest_edge(shapes(:, :, s))
      do q = 1, 5*size(distance)
        associate (d => distance(modulo(q, 6) + 1)*longest)
          x = centroid(1) + d*cos(0.7_wp*q)
          y = centroid(2) + d*sin(0.7_wp*q)
        end associate
        whole = triangle_integrals(shapes(:, :, s), x, y, exponents)
        total = 0.0_wp
        do i = 1, 4
          total = total + triangle_integrals(parts(:, :, i), x, y, exponents)
        end do
        do e = 1, 27
          call check(error, total(e), whole(e), allowed(shapes(:, :, s), x, y, exponents(1, e), &
                                                       exponents(2, e), exponents(3, e)), &
                     'sum over the parts of a triangle')
          if (allocated(error)) return
        end do
      end do
    end do
  end subroutine test_subdivision

  !> Finite and within the bound on vertices, edges, their prolongations, and as
  !> close to them as numbers go.
  subroutine test_finite(error)
    type(error_t), allocatable, intent(out) :: error

    integer :: exponents(3, 27), s, p, q, e
    real(wp) :: points(2, 40), x, y, step, value(27), farthest
    real(wp) :: kernels(6, 3)

    exponents = all_exponents()
    do s = 1, size(shapes, 3)
      points = test_points(shapes(:, :, s))
      do p = 1, size(points, 2)
        do q = -1, 32
          step = merge(0.0_wp, scale(1.0_wp, -33*q), q < 0)
          x = points(1, p) + step*cos(real(q, wp))
          y = points(2, p) + step*sin(real(q, wp))
          value = triangle_integrals(shapes(:, :, s), x, y, exponents)
          kernels = vertex_kernels(shapes(:, :, s), x, y)
          call check_true(error, all(ieee_is_finite(value)) .and. all(ieee_is_finite(kernels)), 'not finite')
          if (allocated(error)) return
          farthest = maxval(hypot(shapes(1, :, s) - x, shapes(2, :, s) - y))
          do e = 1, 27
            call check_true(error, abs(value(e)) <= (1.0_wp + thr)*triangle_integral(shapes(:, :, s), x, y, 1, 0, 0) &
                            *farthest**(exponents(2, e) + exponents(3, e) + 1 - exponents(1, e)), 'beyond the bound')
            if (allocated(error)) return
          end do
        end do
      end do
    end do
    ! near the origin the steps do not vanish in rounding
    do q = 0, 32
      step = scale(1.0_wp, -33*q)
      value = triangle_integrals(reshape([0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 3]), &
                                 0.3_wp*(modulo(q, 2)), step, exponents)
      call check_true(error, all(ieee_is_finite(value)), 'not finite at an edge through the origin')
      if (allocated(error)) return
      value = triangle_integrals(reshape([0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, step], [2, 3]), 0.3_wp, 0.0_wp, &
                                 exponents)
      call check_true(error, all(ieee_is_finite(value)), 'not finite at a triangle of vanishing height')
      if (allocated(error)) return
      value = triangle_integrals(reshape([0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 3]), &
                                 scale(1.0_wp, 15*q), 0.0_wp, exponents)
      call check_true(error, all(ieee_is_finite(value)), 'not finite far away')
      if (allocated(error)) return
    end do
  end subroutine test_finite

  !> Points, segments, collinear vertices: nothing to integrate over.
  subroutine test_no_area(error)
    type(error_t), allocatable, intent(out) :: error

    real(wp), parameter :: flat(2, 3, 4) = reshape([ &
      0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
      0.5_wp, 0.25_wp, 0.5_wp, 0.25_wp, 1.0_wp, 1.0_wp, &
      0.0_wp, 0.0_wp, 1.0_wp, 2.0_wp, 3.0_wp, 6.0_wp, &
      -1.0_wp, 1.0_wp, 0.0_wp, 1.0_wp, 4.0_wp, 1.0_wp], [2, 3, 4])
    real(wp), parameter :: x(3) = [0.0_wp, 0.3_wp, 50.0_wp], y(3) = [0.0_wp, 0.7_wp, 1.0_wp]
    integer :: s, p

    do s = 1, size(flat, 3)
      do p = 1, size(x)
        call check(error, triangle_integrals(flat(:, :, s), x(p), y(p), all_exponents()), spread(0.0_wp, 1, 27), &
                   0.0_wp, 'integral over no area')
        if (allocated(error)) return
        call check(error, reshape(vertex_kernels(flat(:, :, s), x(p), y(p)), [18]), spread(0.0_wp, 1, 18), 0.0_wp, &
                   'kernels over no area')
        if (allocated(error)) return
      end do
    end do
  end subroutine test_no_area

  !> Uniform load on a square of side 2: I_100 = 8 asinh(1) at its center and half
  !> of that at a corner (Love, 1929); half of I_100 in I_320 by symmetry.
  subroutine test_square(error)
    type(error_t), allocatable, intent(out) :: error

    real(wp), parameter :: lower(2, 3) = reshape([-1.0_wp, -1.0_wp, 1.0_wp, -1.0_wp, 1.0_wp, 1.0_wp], [2, 3])
    real(wp), parameter :: upper(2, 3) = reshape([-1.0_wp, -1.0_wp, 1.0_wp, 1.0_wp, -1.0_wp, 1.0_wp], [2, 3])
    real(wp) :: potential, a, c, normal(3), tangential(3)

    potential = 8.0_wp*asinh(1.0_wp)
    a = (1.0_wp - nu)/(2.0_wp*pi*g)
    c = nu/(2.0_wp*pi*g)
    normal = load_displacement(lower, 0.0_wp, 0.0_wp, 3, 0, 0, g, nu) + &
             load_displacement(upper, 0.0_wp, 0.0_wp, 3, 0, 0, g, nu)
    call check(error, normal, [0.0_wp, 0.0_wp, a*potential], round_off, 'center of a pressed square')
    if (allocated(error)) return
    tangential = load_displacement(lower, 0.0_wp, 0.0_wp, 1, 0, 0, g, nu) + &
                 load_displacement(upper, 0.0_wp, 0.0_wp, 1, 0, 0, g, nu)
    call check(error, tangential, [(a + 0.5_wp*c)*potential, 0.0_wp, 0.0_wp], round_off, 'center of a sheared square')
    if (allocated(error)) return
    normal = load_displacement(lower, 1.0_wp, 1.0_wp, 3, 0, 0, g, nu) + &
             load_displacement(upper, 1.0_wp, 1.0_wp, 3, 0, 0, g, nu)
    call check(error, normal(3), 0.5_wp*a*potential, round_off, 'corner of a pressed square')
  end subroutine test_square

  !> Tables 4.1 and 4.2, line by line.
  subroutine test_tables(error)
    type(error_t), allocatable, intent(out) :: error

    integer, parameter :: loads(2, 4) = reshape([0, 0, 1, 0, 0, 1, 1, 1], [2, 4])
    character(len=*), parameter :: names(4) = ['constant', 'linear x', 'linear y', 'bilinear']
    real(wp) :: points(2, 40), a, b, c, expected(3, 3), bound
    integer :: s, p, q, direction

    a = (1.0_wp - nu)/(2.0_wp*pi*g)
    b = (1.0_wp - 2.0_wp*nu)/(4.0_wp*pi*g)
    c = nu/(2.0_wp*pi*g)
    do s = 1, size(shapes, 3)
      points = test_points(shapes(:, :, s))
      do p = 1, size(points, 2)
        do q = 1, size(loads, 2)
          associate (k => loads(1, q), m => loads(2, q))
            expected(:, 1) = [a*i(1, k, m) + c*i(3, k + 2, m), c*i(3, k + 1, m + 1), b*i(2, k + 1, m)]
            expected(:, 2) = [c*i(3, k + 1, m + 1), a*i(1, k, m) + c*i(3, k, m + 2), b*i(2, k, m + 1)]
            expected(:, 3) = [-b*i(2, k + 1, m), -b*i(2, k, m + 1), a*i(1, k, m)]
            bound = round_off*a*envelope(shapes(:, :, s), points(1, p), points(2, p), 1, k, m)
            do direction = 1, 3
              call check(error, load_displacement(shapes(:, :, s), points(1, p), points(2, p), direction, k, m, g, &
                                                  nu), expected(:, direction), bound, &
                         'displacement by a '//names(q)//' load')
              if (allocated(error)) return
            end do
          end associate
        end do
      end do
    end do

  contains

    real(wp) function i(j, k, m)
      integer, intent(in) :: j, k, m
      i = triangle_integral(shapes(:, :, s), points(1, p), points(2, p), j, k, m)
    end function i

  end subroutine test_tables

  !> f0 + g.(xi, eta) given at the vertices is (f0 + g.(x, y)) 1 - g_x (x - xi) - g_y (y - eta).
  subroutine test_linear_near(error)
    type(error_t), allocatable, intent(out) :: error

    real(wp), parameter :: value(3) = [0.7_wp, -0.4_wp, 1.1_wp]
    real(wp), parameter :: slope(2, 3) = reshape([0.3_wp, -0.8_wp, 0.6_wp, 0.2_wp, -0.5_wp, 0.9_wp], [2, 3])
    real(wp) :: points(2, 40), traction(3, 3), expected(3), bound
    integer :: s, p, d

    do s = 1, size(shapes, 3)
      points = test_points(shapes(:, :, s))
      traction = spread(value, 2, 3) + matmul(transpose(slope), shapes(:, :, s))
      do p = 1, size(points, 2)
        associate (v => shapes(:, :, s), x => points(1, p), y => points(2, p))
          expected = 0.0_wp
          do d = 1, 3
            expected = expected &
                       + (value(d) + slope(1, d)*x + slope(2, d)*y)*load_displacement(v, x, y, d, 0, 0, g, nu) &
                       - slope(1, d)*load_displacement(v, x, y, d, 1, 0, g, nu) &
                       - slope(2, d)*load_displacement(v, x, y, d, 0, 1, g, nu)
          end do
          ! the expected value loses a power of the distance
          bound = (1.0_wp + hypot(x, y))*allowed(v, x, y, 1, 0, 0)
          call check(error, linear_load_displacement(v, x, y, traction, g, nu), expected, bound, &
                     'displacement by a linear load')
          if (allocated(error)) return
        end associate
      end do
    end do
  end subroutine test_linear_near

  !> Far away a linear load keeps all digits: its four parts add up to it, and it
  !> acts like its resultant at the center of the load, up to (size/distance)^2.
  subroutine test_linear_far(error)
    type(error_t), allocatable, intent(out) :: error

    real(wp), parameter :: traction(3, 3) = &
      reshape([0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.25_wp, 0.0_wp, 0.0_wp, 0.5_wp], [3, 3])
    real(wp) :: parts(2, 3, 4), part_traction(3, 3, 4), u(3), total(3), force, center(2), rho
    integer :: s, q, i

    do s = 1, size(shapes, 3)
      parts = quarters(shapes(:, :, s))
      part_traction = quarters(traction)
      force = area(shapes(:, :, s))*sum(traction(3, :))/3.0_wp
      center = matmul(shapes(:, :, s), traction(3, :) + sum(traction(3, :)))/(4.0_wp*sum(traction(3, :)))
      do q = 1, 5
        associate (x => center(1) + 10.0_wp**q*cos(real(q, wp)), y => center(2) + 10.0_wp**q*sin(real(q, wp)))
          u = linear_load_displacement(shapes(:, :, s), x, y, traction, g, nu)
          total = 0.0_wp
          do i = 1, 4
            total = total + linear_load_displacement(parts(:, :, i), x, y, part_traction(:, :, i), g, nu)
          end do
          rho = hypot(x - center(1), y - center(2))
          call check(error, total, u, round_off*force/rho, &
                     'parts of a linear load')
          if (allocated(error)) return
          call check(error, u(3), (1.0_wp - nu)/(2.0_wp*pi*g)*force/rho, 0.1_wp*force/rho*rho**(-2) &
                     + round_off*force/rho, 'resultant of a linear load')
          if (allocated(error)) return
        end associate
      end do
    end do
  end subroutine test_linear_far

  !> evaluate_* give what the pure functions give, whatever the number of points.
  subroutine test_many(error)
    type(error_t), allocatable, intent(out) :: error

    integer, parameter :: n = 1000
    real(wp), parameter :: traction(3, 3) = &
      reshape([0.1_wp, 0.2_wp, 1.0_wp, -0.3_wp, 0.4_wp, 0.25_wp, 0.6_wp, -0.7_wp, 0.5_wp], [3, 3])
    type(error_t), allocatable :: raised
    real(wp) :: x(n), y(n), value(n), u(3, n), linear(3, n)
    integer :: p

    x = [(2.0_wp*cos(1.0_wp*p)*p/n, p=1, n)]
    y = [(2.0_wp*sin(1.0_wp*p)*p/n, p=1, n)]
    associate (v => shapes(:, :, 1))
      call evaluate_integral(v, x, y, 3, 1, 2, value, raised)
      call check_succeeded(error, raised, 'integral at many points')
      if (allocated(error)) return
      call evaluate_displacement(v, x, y, 2, 1, 1, g, nu, u, raised)
      call check_succeeded(error, raised, 'displacement at many points')
      if (allocated(error)) return
      call evaluate_linear_displacement(v, x, y, traction, g, nu, linear, raised)
      call check_succeeded(error, raised, 'linear load at many points')
      if (allocated(error)) return
      do p = 1, n
        call check(error, value(p), triangle_integral(v, x(p), y(p), 3, 1, 2), 0.0_wp, 'integral at many points')
        if (allocated(error)) return
        call check(error, u(:, p), load_displacement(v, x(p), y(p), 2, 1, 1, g, nu), 0.0_wp, &
                   'displacement at many points')
        if (allocated(error)) return
        call check(error, linear(:, p), linear_load_displacement(v, x(p), y(p), traction, g, nu), 0.0_wp, &
                   'linear load at many points')
        if (allocated(error)) return
      end do
      call evaluate_integral(v, x(:0), y(:0), 3, 1, 2, value(:0), raised)
      call check_succeeded(error, raised, 'integral at no points')
    end associate
  end subroutine test_many

  !> Every wrong argument is refused.
  subroutine test_wrong(error)
    type(error_t), allocatable, intent(out) :: error

    type(error_t), allocatable :: raised
    real(wp) :: x(2), y(2), value(2), u(3, 2), nan, v(2, 3), traction(3, 3), bad(2, 3)
    integer :: i

    nan = ieee_value(1.0_wp, ieee_quiet_nan)
    x = [0.0_wp, 1.0_wp]
    y = 0.0_wp
    v = shapes(:, :, 1)
    bad = v
    bad(2, 3) = nan
    traction = 1.0_wp
    do i = 1, 14
      select case (i)
      case (1); call evaluate_integral(v, x, y, 2, 0, 0, value, raised)
      case (2); call evaluate_integral(v, x, y, 1, -1, 2, value, raised)
      case (3); call evaluate_integral(bad, x, y, 1, 0, 0, value, raised)
      case (4); call evaluate_integral(v, [nan, 0.0_wp], y, 1, 0, 0, value, raised)
      case (5); call evaluate_integral(v, x, y(:1), 1, 0, 0, value, raised)
      case (6); call evaluate_integral(v, x, y, 1, 0, 0, value(:1), raised)
      case (7); call evaluate_displacement(v, x, y, 4, 0, 0, g, nu, u, raised)
      case (8); call evaluate_displacement(v, x, y, 3, 2, 1, g, nu, u, raised)
      case (9); call evaluate_displacement(v, x, y, 3, 0, 0, 0.0_wp, nu, u, raised)
      case (10); call evaluate_displacement(v, x, y, 3, 0, 0, nan, nu, u, raised)
      case (11); call evaluate_displacement(v, x, y, 3, 0, 0, g, 0.51_wp, u, raised)
      case (12); call evaluate_displacement(v, x, y, 3, 0, 0, g, -1.0_wp, u, raised)
      case (13); call evaluate_linear_displacement(v, x, y, traction*nan, g, nu, u, raised)
      case default; call evaluate_linear_displacement(v, x, [0.0_wp, nan], traction, g, nu, u, raised)
      end select
      call check_raised(error, raised, status%invalid_input, 'wrong argument')
      if (allocated(error)) return
    end do
  end subroutine test_wrong

  !> The 27 supported exponents, as columns (j, k, m).
  pure function all_exponents() result(exponents)
    integer :: exponents(3, 27)
    integer :: j, k, m, n

    n = 0
    do j = 1, 3
      do k = 0, 4
        do m = 0, 4
          if (.not. is_supported(j, k, m)) cycle
          n = n + 1
          exponents(:, n) = [j, k, m]
        end do
      end do
    end do
  end function all_exponents

  !> Points in, on and around a triangle: inside, vertices, edges and their
  !> prolongations, then from half an edge to 1e5 edges away.
  pure function test_points(vertices) result(points)
    !> Vertices, as columns
    real(wp), intent(in) :: vertices(2, 3)
    real(wp) :: points(2, 40)

    real(wp), parameter :: along(6) = [0.25_wp, 0.5_wp, 0.8125_wp, -0.5_wp, 1.75_wp, 3.0_wp]
    real(wp) :: weight(3), centroid(2)
    integer :: i, q, p

    p = 0
    do i = 1, 3
      weight = [0.5_wp, 0.3_wp, 0.2_wp]
      p = p + 1
      points(:, p) = matmul(vertices, cshift(weight, i))
      p = p + 1
      points(:, p) = vertices(:, i)
    end do
    do q = 1, size(along)
      weight = [along(q), 1.0_wp - along(q), 0.0_wp]
      do i = 1, 3
        p = p + 1
        points(:, p) = matmul(vertices, cshift(weight, i))
      end do
    end do
    centroid = sum(vertices, dim=2)/3.0_wp
    do i = 1, 16
      p = p + 1
      points(:, p) = centroid + 0.5_wp*10.0_wp**(i/3.0_wp)*[cos(2.0_wp*i), sin(2.0_wp*i)]
    end do
  end function test_points

  !> A triangle and its vertex values, cut at the middles of the edges.
  pure function quarters(corner) result(parts)
    !> Values at the vertices, as columns
    real(wp), intent(in) :: corner(:, :)
    real(wp) :: parts(size(corner, 1), 3, 4)

    real(wp) :: middle(size(corner, 1), 3)
    integer :: i

    middle = 0.5_wp*(corner + cshift(corner, 1, dim=2))
    do i = 1, 3
      parts(:, 1, i) = corner(:, i)
      parts(:, 2, i) = middle(:, i)
      parts(:, 3, i) = middle(:, modulo(i + 1, 3) + 1)
    end do
    parts(:, :, 4) = middle
  end function quarters

  !> Allowed error of an integral: what is promised, and the rounding of the edge form. The terms of the two long edges of a
  !> sliver are as many times larger than their sum as it is longer than high, each with some twenty roundings: that counts
  !> where xp is no more than wp.
  pure real(wp) function allowed(vertices, x, y, j, k, m)
    !> Vertices, as columns
    real(wp), intent(in) :: vertices(2, 3)
    !> Field point
    real(wp), intent(in) :: x, y
    !> Exponents
    integer, intent(in) :: j, k, m

    allowed = (thr + 40.0_wp*real(epsilon(1.0_xp), wp)*longest_edge(vertices)**2/(2.0_wp*area(vertices)))* &
              envelope(vertices, x, y, j, k, m)
  end function allowed

  !> area * d^(k+m-j), d the distance of the farthest vertex.
  pure real(wp) function envelope(vertices, x, y, j, k, m)
    !> Vertices, as columns
    real(wp), intent(in) :: vertices(2, 3)
    !> Field point
    real(wp), intent(in) :: x, y
    !> Exponents
    integer, intent(in) :: j, k, m

    envelope = area(vertices)*maxval(hypot(vertices(1, :) - x, vertices(2, :) - y))**(k + m - j)
  end function envelope

  pure real(wp) function area(v)
    !> Vertices, as columns
    real(wp), intent(in) :: v(2, 3)

    area = 0.5_wp*abs((v(1, 2) - v(1, 1))*(v(2, 3) - v(2, 1)) - (v(1, 3) - v(1, 1))*(v(2, 2) - v(2, 1)))
  end function area

  pure real(wp) function longest_edge(v)
    !> Vertices, as columns
    real(wp), intent(in) :: v(2, 3)

    longest_edge = maxval(norm2(cshift(v, 1, dim=2) - v, dim=1))
  end function longest_edge

end module test_triangle_integrals
