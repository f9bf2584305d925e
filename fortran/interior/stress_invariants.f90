!> Scalars of a stress that do not depend on the axes: principal stresses, von Mises, Tresca, mean stress.
!>
!> Equations: docs/theory/interior.md, (I12).
module hc_stress_invariants
  use hc_precision, only: wp
  use hc_interior_fields, only: xx, yy, zz, xy, yz, xz
  implicit none
  private

  public :: stress_invariants, von_mises, principal_stresses

contains

  !> Compute principal stresses, von Mises and Tresca at many points.
  subroutine stress_invariants(stress, scalars)
    !> Stress (component xx, yy, zz, xy, yz, xz; point)
    real(wp), intent(in) :: stress(:, :)
    !> Principal stresses, the largest first, von Mises, Tresca (scalar, point)
    real(wp), intent(out) :: scalars(:, :)
    integer :: i

    !$omp parallel do schedule(static) if (size(stress, 2) > 4096)
    do i = 1, size(stress, 2)
      scalars(1:3, i) = principal_stresses(stress(:, i))
      scalars(4, i) = von_mises(stress(:, i))
      scalars(5, i) = scalars(1, i) - scalars(3, i)
    end do
    !$omp end parallel do
  end subroutine stress_invariants

  !> Compute the equivalent stress of von Mises.
  pure real(wp) function von_mises(s)
    !> Stress xx, yy, zz, xy, yz, xz
    real(wp), intent(in) :: s(6)

    von_mises = sqrt(0.5_wp*((s(xx) - s(yy))**2 + (s(yy) - s(zz))**2 + (s(zz) - s(xx))**2) + 3.0_wp*sum(s(xy:xz)**2))
  end function von_mises

  !> Principal stresses, the largest (most tensile) one first, by Jacobi's rotations.
  pure function principal_stresses(s) result(principal)
    !> Stress xx, yy, zz, xy, yz, xz
    real(wp), intent(in) :: s(6)
    real(wp) :: principal(3)

    !> Rounds that suffice for any matrix, with a margin: convergence is quadratic.
    integer, parameter :: most_rounds = 12
    !> Axes of each rotation and the third one
    integer, parameter :: axes(3, 3) = reshape([1, 2, 3, 1, 3, 2, 2, 3, 1], [3, 3])
    real(wp) :: a(3, 3), t, c, theta, tau, p_r, q_r
    integer :: round, k

    a = reshape([s(xx), s(xy), s(xz), s(xy), s(yy), s(yz), s(xz), s(yz), s(zz)], [3, 3])
    do round = 1, most_rounds
      if (abs(a(1, 2)) + abs(a(1, 3)) + abs(a(2, 3)) <= 0.0_wp) exit
      do k = 1, 3
        associate (p => axes(1, k), q => axes(2, k), r => axes(3, k))
          if (abs(a(p, q)) <= 0.1_wp*epsilon(1.0_wp)*(abs(a(p, p)) + abs(a(q, q)))) then
            a(p, q) = 0.0_wp
          else
            theta = 0.5_wp*(a(q, q) - a(p, p))/a(p, q)
            t = sign(1.0_wp, theta)/(abs(theta) + hypot(theta, 1.0_wp))
            c = 1.0_wp/sqrt(t*t + 1.0_wp)
            tau = t*c
            a(p, p) = a(p, p) - t*a(p, q)
            a(q, q) = a(q, q) + t*a(p, q)
            a(p, q) = 0.0_wp
            p_r = a(min(p, r), max(p, r))
            q_r = a(min(q, r), max(q, r))
            a(min(p, r), max(p, r)) = c*p_r - tau*q_r
            a(min(q, r), max(q, r)) = tau*p_r + c*q_r
          end if
        end associate
      end do
    end do
    principal(1) = max(a(1, 1), a(2, 2), a(3, 3))
    principal(3) = min(a(1, 1), a(2, 2), a(3, 3))
    principal(2) = max(min(a(1, 1), a(2, 2)), min(max(a(1, 1), a(2, 2)), a(3, 3)))
  end function principal_stresses

end module hc_stress_invariants
