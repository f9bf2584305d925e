!> Elliptic integrals in Carlson's symmetric form.
!>
!> B. C. Carlson, Numerical computation of real or complex elliptic integrals, Numerical Algorithms 10 (1995) 13-26:
!> the duplication theorem, and Taylor series where the arguments have come close to each other.
module hc_carlson
  use, intrinsic :: ieee_arithmetic, only: ieee_positive_inf, ieee_value
  use hc_precision, only: wp
  implicit none
  private

  public :: carlson_rf, carlson_rd, complete_k

  !> Relative error of the truncated series.
  real(wp), parameter :: truncation = 0.05_wp*epsilon(1.0_wp)

contains

  !> Compute R_F(x, y, z) = 1/2 integral_0^inf dt/sqrt((t+x)(t+y)(t+z)); x, y, z >= 0; infinite if two of them are 0.
  elemental real(wp) function carlson_rf(x, y, z) result(rf)
    !> Arguments
    real(wp), intent(in) :: x, y, z

    real(wp) :: v(3), mean, away, dx, dy, dz, e2, e3, lambda

    if (count([x, y, z] <= 0.0_wp) > 1) then
      rf = ieee_value(rf, ieee_positive_inf)
      return
    end if
    v = [x, y, z]
    mean = sum(v)/3.0_wp
    away = (3.0_wp*truncation)**(-1.0_wp/6.0_wp)*maxval(abs(mean - v))
    do while (away > mean)
      lambda = sqrt(v(1)*v(2)) + sqrt(v(2)*v(3)) + sqrt(v(3)*v(1))
      v = 0.25_wp*(v + lambda)
      mean = 0.25_wp*(mean + lambda)
      away = 0.25_wp*away
    end do
    dx = 1.0_wp - v(1)/mean
    dy = 1.0_wp - v(2)/mean
    dz = -dx - dy
    e2 = dx*dy - dz**2
    e3 = dx*dy*dz
    rf = (1.0_wp - e2/10.0_wp + e3/14.0_wp + e2**2/24.0_wp - 3.0_wp*e2*e3/44.0_wp)/sqrt(mean)
  end function carlson_rf

  !> Compute R_D(x, y, z) = 3/2 integral_0^inf dt/(sqrt((t+x)(t+y)) (t+z)^(3/2)); x, y, z >= 0;
  !> infinite if z or both x and y are 0.
  elemental real(wp) function carlson_rd(x, y, z) result(rd)
    !> Arguments
    real(wp), intent(in) :: x, y, z

    real(wp) :: v(3), mean, away, dx, dy, dz, e2, e3, e4, e5, lambda, power, total

    if (max(x, y) <= 0.0_wp .or. z <= 0.0_wp) then
      rd = ieee_value(rd, ieee_positive_inf)
      return
    end if
    v = [x, y, z]
    mean = (x + y + 3.0_wp*z)/5.0_wp
    away = (0.25_wp*truncation)**(-1.0_wp/6.0_wp)*maxval(abs(mean - v))
    power = 1.0_wp
    total = 0.0_wp
    do while (away > mean)
      lambda = sqrt(v(1)*v(2)) + sqrt(v(2)*v(3)) + sqrt(v(3)*v(1))
      total = total + power/(sqrt(v(3))*(v(3) + lambda))
      v = 0.25_wp*(v + lambda)
      mean = 0.25_wp*(mean + lambda)
      away = 0.25_wp*away
      power = 0.25_wp*power
    end do
    dx = 1.0_wp - v(1)/mean
    dy = 1.0_wp - v(2)/mean
    dz = -(dx + dy)/3.0_wp
    e2 = dx*dy - 6.0_wp*dz**2
    e3 = (3.0_wp*dx*dy - 8.0_wp*dz**2)*dz
    e4 = 3.0_wp*(dx*dy - dz**2)*dz**2
    e5 = dx*dy*dz**3
    rd = 3.0_wp*total + power/(mean*sqrt(mean))*(1.0_wp - 3.0_wp*e2/14.0_wp + e3/6.0_wp + 9.0_wp*e2**2/88.0_wp &
                                                 - 3.0_wp*e4/22.0_wp - 9.0_wp*e2*e3/52.0_wp + 3.0_wp*e5/26.0_wp)
  end function carlson_rd

  !> Compute the complete elliptic integral K by the complementary parameter 1 - k^2 > 0.
  elemental real(wp) function complete_k(complement) result(k)
    !> 1 - k^2
    real(wp), intent(in) :: complement

    k = carlson_rf(0.0_wp, complement, 1.0_wp)
  end function complete_k

end module hc_carlson
