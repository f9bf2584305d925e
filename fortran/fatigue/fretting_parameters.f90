!> Fretting parameters of a node from traction, slip and surface stress over a cycle (C. Ruiz, P. H. B. Boddington and K. C. Chen,
!> Exp. Mech. 24 (1984) 208-217).
!>
!> With the main direction t of the slip path: slip amplitude delta_s = half the range of s.t; F1 = max |q| delta_s [Pa m];
!> F2 = sigma_t F1 [Pa^2 m], sigma_t the largest surface stress along t, 0 if it is pressure. Both use values of one node.
module hc_fretting_parameters
  use hc_precision, only: wp
  implicit none
  private

  public :: find_ruiz

contains

  !> Find the parameters F1 and F2 of a node.
  pure subroutine find_ruiz(traction, slip, stress, f_1, f_2, amplitude)
    !> Traction (2, times) [Pa] and slip (2, times) [m]
    real(wp), intent(in), contiguous :: traction(:, :), slip(:, :)
    !> Stress at the surface (6, times): xx, yy, zz, xy, yz, xz [Pa]
    real(wp), intent(in), contiguous :: stress(:, :)
    !> F1 [Pa m] and F2 [Pa^2 m]; slip amplitude [m]
    real(wp), intent(out) :: f_1, f_2, amplitude
    real(wp) :: t(2), along(size(slip, 2))

    t = main_direction(slip)
    along = matmul(t, slip)
    amplitude = 0.5_wp*(maxval(along) - minval(along))
    f_1 = sqrt(maxval(sum(traction**2, dim=1)))*amplitude
    f_2 = f_1*max(0.0_wp, maxval(t(1)**2*stress(1, :) + t(2)**2*stress(2, :) + 2.0_wp*t(1)*t(2)*stress(4, :)))
  end subroutine find_ruiz

  !> Direction along which a path extends most: the first axis of its scatter.
  pure function main_direction(path) result(t)
    real(wp), intent(in), contiguous :: path(:, :)
    real(wp) :: t(2), mean(2), xx, yy, xy, angle

    mean = sum(path, dim=2)/size(path, 2)
    xx = sum((path(1, :) - mean(1))**2)
    yy = sum((path(2, :) - mean(2))**2)
    xy = sum((path(1, :) - mean(1))*(path(2, :) - mean(2)))
    angle = 0.0_wp
    if (xx + yy > 0.0_wp) angle = 0.5_wp*atan2(2.0_wp*xy, xx - yy)
    t = [cos(angle), sin(angle)]
  end function main_direction

end module hc_fretting_parameters
