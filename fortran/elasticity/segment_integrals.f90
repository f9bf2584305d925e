!> Integrals along a straight segment of the surface for a field point below it.
!>
!> With n the signed distance of the field point from the vertical plane through the segment, z its depth, t the
!> abscissa along the segment from the foot of the point, N^2 = n^2 + z^2 and R^2 = t^2 + N^2. Every difference is in a
!> form without cancellation. Terms that become infinite at N = 0 or R + z = 0 are set to zero there: they occur times z, n
!> or t only.
!>
!> Equations: docs/theory/interior.md, (I4), (I5).
module hc_segment_integrals
  use hc_precision, only: wp
  implicit none
  private

  public :: segment_t, segment_integrals

  !> Closer to the line (squared) and to its plane than this, integrals have the values that they have there.
  real(wp), parameter :: on_the_line = 1.0e-280_wp, on_the_plane = 1.0e-100_wp

  !> The integrals; a bracket is the difference between the ends.
  type :: segment_t
    !> Abscissae and distances of the ends, length
    real(wp) :: t(2), r(2), length
    !> n^2 + z^2
    real(wp) :: nn
    !> int dt/R, and n int dt/(R (R + z))
    real(wp) :: lambda, beta
    !> [R], [t R]
    real(wp) :: d_r, d_tr
    !> [ln(R + z)], [t ln(R + z)]
    real(wp) :: d_log, d_t_log
    !> n int dt/(R + z)
    real(wp) :: a_1
    !> int ln(R + z) dt, and int (z ln(R + z) - R) dt; without the constants -length and -length z
    real(wp) :: q_0, w_0
  end type segment_t

contains

  !> Compute all integrals of a segment.
  elemental type(segment_t) function segment_integrals(n, t1, t2, length, z) result(s)
    !> Signed distance of the field point from the plane, its depth
    real(wp), intent(in) :: n, z
    !> Abscissae of the ends, t1 < t2, and t2 - t1, measured on the segment itself
    real(wp), intent(in) :: t1, t2, length

    real(wp) :: tm, rs, q, log_end(2)

    s%length = length
    s%t = [t1, t2]
    tm = 0.5_wp*(t1 + t2)
    s%nn = n*n + z*z
    s%r = sqrt(s%t**2 + s%nn)
    rs = s%r(1) + s%r(2)
    s%d_r = 2.0_wp*tm*s%length/rs
    s%d_tr = s%length*(2.0_wp*tm*tm/rs + 0.5_wp*rs)

    q = s%length/rs
    if (s%nn < on_the_line) then
      s%lambda = 0.0_wp
    else if (q < 0.5_wp) then
      s%lambda = 2.0_wp*atanh(q)
    else if (s%t(1) >= 0.0_wp) then
      s%lambda = log((s%r(2) + s%t(2))/(s%r(1) + s%t(1)))
    else if (s%t(2) <= 0.0_wp) then
      s%lambda = log((s%r(1) - s%t(1))/(s%r(2) - s%t(2)))
    else
      s%lambda = log((s%r(2) + s%t(2))/sqrt(s%nn)*((s%r(1) - s%t(1))/sqrt(s%nn)))
    end if
    s%beta = 0.0_wp
    if (abs(n) > on_the_plane) then
      s%beta = atan2(n*(s%nn*s%length + z*(0.5_wp*s%length*rs - tm*s%d_r)), &
                     (s%nn + z*s%r(1))*(s%nn + z*s%r(2)) + n*n*s%t(1)*s%t(2))
    end if

    log_end = 0.0_wp
    where (s%r + z > 0.0_wp) log_end = log(s%r + z)
    q = s%d_r/(rs + 2.0_wp*z)
    if (abs(q) < 0.5_wp) then
      s%d_log = 2.0_wp*atanh(q)
    else
      s%d_log = log_end(2) - log_end(1)
    end if
    s%d_t_log = tm*s%d_log + 0.5_wp*length*(log_end(1) + log_end(2))

    s%a_1 = n*s%lambda - z*s%beta
    s%q_0 = s%d_t_log + z*s%lambda + n*s%beta
    s%w_0 = z*s%q_0 - 0.5_wp*(s%d_tr + s%nn*s%lambda)
  end function segment_integrals

end module hc_segment_integrals
