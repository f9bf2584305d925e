!> Edge form of the triangle integrals.
!>
!> Close to a sliver the contributions of its long edges cancel to the order of
!> its small height: as many digits are lost as the aspect ratio has. Therefore
!> the build makes a second module of this file, hc_edge_form_extended, in
!> which rk is the extended precision xp (see other_precision.py). It takes
!> some thirty times as long.
!>
!> Equations: docs/theory/elasticity.md, (E3), (E4).
module hc_edge_form
  use hc_precision, only: rk => wp
  implicit none
  private

  public :: edge_form, vertex_loads, twice_area

contains

  !> Integrate (x - xi)^k (y - eta)^m / rho^j over a triangle, summed over its edges.
  !>
  !> With t the abscissa along an edge and n the distance of the field point from
  !> its line (positive on the left), homogeneity leaves line integrals (4.5):
  !>
  !>     I_jkm = sum over edges of n/p int (-t c - n s)^k (n c - t s)^m / r^j dt
  !>
  !> where (c, s) is the direction of the edge, r^2 = t^2 + n^2, p = k + m + 2 - j.
  !> An edge whose line contains the field point contributes nothing.
  pure function edge_form(corner, exponents) result(integral)
    !> Vertices relative to the field point, as columns, in any order, of size 1 or so
    real(rk), intent(in) :: corner(2, 3)
    !> Columns (j, k, m)
    integer, intent(in) :: exponents(:, :)
    !> Value for each column
    real(rk) :: integral(size(exponents, 2))

    !> Closer to its line than this an edge contributes less than rounding does
    real(rk), parameter :: on_the_line = epsilon(1.0_rk)**2
    real(rk) :: tangent(2), length, t(2), n, moment(0:4, 3), polynomial(0:4)
    integer :: i, next, e

    integral = 0.0_rk
    do i = 1, 3
      next = merge(1, i + 1, i == 3)
      tangent = corner(:, next) - corner(:, i)
      length = hypot(tangent(1), tangent(2))
      if (.not. length > 0.0_rk) cycle
      tangent = tangent/length
      t = [dot_product(corner(:, i), tangent), dot_product(corner(:, next), tangent)]
      ! the nearer end gives the more accurate distance
      e = merge(i, next, abs(t(1)) <= abs(t(2)))
      n = cross(corner(:, e), tangent)
      if (abs(n) < on_the_line) cycle
      moment = edge_moments(n, t(1), t(2), length)
      do e = 1, size(integral)
        associate (j => exponents(1, e), k => exponents(2, e), m => exponents(3, e))
          polynomial = expanded(tangent, n, k, m)
          integral(e) = integral(e) + n/(k + m + 2 - j)*dot_product(polynomial(:k + m), moment(:k + m, j))
        end associate
      end do
    end do
    integral = sign(1.0_rk, twice_area(corner))*integral
  end function edge_form

  !> Compute int t^q r^-j dt from t1 to t2; every difference in a form without cancellation.
  pure function edge_moments(n, t1, t2, length) result(moment)
    !> Distance of the field point from the line, not zero
    real(rk), intent(in) :: n
    !> Abscissae of the ends, t1 < t2, from the foot of the perpendicular
    real(rk), intent(in) :: t1, t2
    !> t2 - t1, measured on the edge itself
    real(rk), intent(in) :: length
    !> Value for q = 0... and j = 1, 2, 3, as far as exponents need them
    real(rk) :: moment(0:4, 3)

    real(rk) :: tm, r1, r2, rs, rr, nn, q, log_sum, log_ratio, angle, dr, d_tr, d_t_over_r

    tm = 0.5_rk*(t1 + t2)
    nn = n*n
    r1 = hypot(n, t1)
    r2 = hypot(n, t2)
    rs = r1 + r2
    rr = r1*r2
    dr = 2.0_rk*tm*length/rs

    q = length/rs
    if (q < 0.5_rk) then
      log_sum = 2.0_rk*atanh(q)
    else if (t1 >= 0.0_rk) then
      log_sum = log((r2 + t2)/(r1 + t1))
    else if (t2 <= 0.0_rk) then
      log_sum = log((r1 - t1)/(r2 - t2))
    else
      log_sum = log((r2 + t2)/abs(n)*((r1 - t1)/abs(n)))
    end if
    q = dr/rs
    if (abs(q) < 0.5_rk) then
      log_ratio = 2.0_rk*atanh(q)
    else
      log_ratio = log(r2/r1)
    end if
    angle = atan2(n*length, nn + t1*t2)
    d_tr = length*(2.0_rk*tm*tm/rs + 0.5_rk*rs)
    if (t1*t2 > 0.0_rk) then
      d_t_over_r = 2.0_rk*nn*tm*length/(rr*(t2*r1 + t1*r2))
    else
      d_t_over_r = t2/r2 - t1/r1
    end if

    moment = 0.0_rk
    moment(0:2, 1) = [log_sum, dr, 0.5_rk*(d_tr - nn*log_sum)]
    moment(0:3, 2) = [angle/n, log_ratio, length - n*angle, tm*length - nn*log_ratio]
    moment(0:4, 3) = [d_t_over_r/nn, dr/rr, log_sum - d_t_over_r, dr*(1.0_rk - nn/rr), &
                      0.5_rk*d_tr - 1.5_rk*nn*log_sum + nn*d_t_over_r]
  end function edge_moments

  !> Expand (-t c - n s)^k (n c - t s)^m in powers of t.
  pure function expanded(tangent, n, k, m) result(polynomial)
    !> Direction (c, s) of the edge
    real(rk), intent(in) :: tangent(2)
    !> Distance of the field point from its line
    real(rk), intent(in) :: n
    !> Exponents, k + m <= 4
    integer, intent(in) :: k, m
    !> Ascending powers
    real(rk) :: polynomial(0:4)

    real(rk) :: factor(0:1)
    integer :: i, q

    polynomial = [1.0_rk, 0.0_rk, 0.0_rk, 0.0_rk, 0.0_rk]
    do i = 1, k + m
      if (i <= k) then
        factor = [-n*tangent(2), -tangent(1)]
      else
        factor = [n*tangent(1), -tangent(2)]
      end if
      do q = i, 1, -1
        polynomial(q) = factor(0)*polynomial(q) + factor(1)*polynomial(q - 1)
      end do
      polynomial(0) = factor(0)*polynomial(0)
    end do
  end function expanded

  !> Return the linear loads that are 1 at one vertex and 0 at the two others:
  !> value at the field point and slopes, load = c1 + c2 (x - xi) + c3 (y - eta).
  pure function vertex_loads(corner) result(coefficient)
    !> Vertices relative to the field point, as columns
    real(rk), intent(in) :: corner(2, 3)
    !> Coefficients (3, vertex)
    real(rk) :: coefficient(3, 3)

    real(rk) :: opposite(2)
    integer :: i, j, k

    do i = 1, 3
      j = modulo(i, 3) + 1
      k = modulo(i + 1, 3) + 1
      opposite = corner(:, k) - corner(:, j)
      coefficient(:, i) = [cross(corner(:, j), corner(:, k)), opposite(2), -opposite(1)]/twice_area(corner)
    end do
  end function vertex_loads

  !> Compute twice the area, positive if the vertices run counter-clockwise.
  pure real(rk) function twice_area(corner)
    !> Vertices, as columns
    real(rk), intent(in) :: corner(2, 3)

    twice_area = cross(corner(:, 2) - corner(:, 1), corner(:, 3) - corner(:, 1))
  end function twice_area

  !> Compute the cross product of two vectors of the plane.
  pure real(rk) function cross(a, b)
    !> Vectors
    real(rk), intent(in) :: a(2), b(2)

    cross = a(1)*b(2) - a(2)*b(1)
  end function cross

end module hc_edge_form
