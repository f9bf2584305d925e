!> Fatigue criteria of stress invariants: Crossland, Dang Van.
!>
!> A stress is (xx, yy, zz, xy, yz, xz), tension positive [Pa]. In the coordinates
!>
!>     (sqrt(3)/2 S_xx, (S_yy - S_zz)/2, S_xy, S_xz, S_yz)
!>
!> of the deviator S the distance from the origin is sqrt(J2). The amplitude sqrt(J2,a) of a path is the radius of the
!> smallest ball around it, and the center of this ball is its mean (I. V. Papadopoulos et al., Int. J. Fatigue 19 (1997)
!> 219-235).
module hc_invariant_criteria
  use hc_precision, only: wp, pi
  use hc_smallest_ball, only: find_smallest_ball
  implicit none
  private

  public :: deviator_amplitude, crossland, dang_van, hydrostatic, deviator_coordinates, largest_shear

contains

  !> Compute the hydrostatic part of a stress [Pa].
  pure real(wp) function hydrostatic(stress)
    !> Stress (6) [Pa]
    real(wp), intent(in) :: stress(:)
    hydrostatic = sum(stress(:3))/3.0_wp
  end function hydrostatic

  !> Compute the coordinates of the deviator, in which the distance is sqrt(J2) [Pa].
  pure function deviator_coordinates(stress) result(s)
    !> Stress (6) [Pa]
    real(wp), intent(in) :: stress(:)
    real(wp) :: s(5)
    s = [0.5_wp*sqrt(3.0_wp)*(stress(1) - hydrostatic(stress)), 0.5_wp*(stress(2) - stress(3)), stress(4), stress(6), &
         stress(5)]
  end function deviator_coordinates

  !> Compute the largest shear stress of a deviator in these coordinates: half the difference of extreme principal stresses [Pa].
  pure real(wp) function largest_shear(s)
    !> Coordinates (5) [Pa]
    real(wp), intent(in) :: s(:)
    real(wp) :: j2, j3, xx, yy, zz, lode

    j2 = sum(s**2)
    largest_shear = 0.0_wp
    if (j2 <= tiny(j2)) return
    xx = 2.0_wp/sqrt(3.0_wp)*s(1)
    yy = s(2) - 0.5_wp*xx
    zz = -s(2) - 0.5_wp*xx
    j3 = xx*(yy*zz - s(5)**2) - s(3)*(s(3)*zz - s(5)*s(4)) + s(4)*(s(3)*s(5) - yy*s(4))
    lode = acos(min(1.0_wp, max(-1.0_wp, 1.5_wp*sqrt(3.0_wp)*j3/(j2*sqrt(j2)))))/3.0_wp
    largest_shear = sqrt(j2)*sin(lode + pi/3.0_wp)
  end function largest_shear

  !> Find amplitude sqrt(J2,a) and mean of the deviator on a path.
  pure subroutine deviator_amplitude(history, amplitude, mean)
    !> Stress (6, number of times) [Pa]
    real(wp), intent(in), contiguous :: history(:, :)
    !> Radius [Pa], and center (5), of the smallest ball around the path
    real(wp), intent(out) :: amplitude, mean(5)
    real(wp) :: path(5, size(history, 2))
    integer :: i

    do i = 1, size(history, 2)
      path(:, i) = deviator_coordinates(history(:, i))
    end do
    call find_smallest_ball(path, mean, amplitude)
  end subroutine deviator_amplitude

  !> Compute sqrt(J2,a) + slope sigma_h,max: endurance where it is below the bound of the material
  !> (B. Crossland, Int. Conf. on Fatigue of Metals, Inst. Mech. Eng., London 1956, 138-149).
  pure real(wp) function crossland(history, slope)
    !> Stress (6, number of times) [Pa]
    real(wp), intent(in), contiguous :: history(:, :)
    !> Influence of the hydrostatic stress
    real(wp), intent(in) :: slope
    real(wp) :: amplitude, mean(5), highest
    integer :: i

    call deviator_amplitude(history, amplitude, mean)
    highest = maxval([(hydrostatic(history(:, i)), i=1, size(history, 2))])
    crossland = amplitude + slope*highest
  end function crossland

  !> Compute the largest tau(t) + slope sigma_h(t), tau the largest shear of the deviator less its mean on the path: the stress of a
  !> grain that has shaken down (K. Dang Van, ASTM STP 1191 (1993) 120-130).
  pure real(wp) function dang_van(history, slope)
    !> Stress (6, number of times) [Pa]
    real(wp), intent(in), contiguous :: history(:, :)
    !> Influence of the hydrostatic stress
    real(wp), intent(in) :: slope
    real(wp) :: amplitude, mean(5)
    integer :: i

    call deviator_amplitude(history, amplitude, mean)
    dang_van = -huge(dang_van)
    do i = 1, size(history, 2)
      dang_van = max(dang_van, largest_shear(deviator_coordinates(history(:, i)) - mean) + slope*hydrostatic(history(:, i)))
    end do
  end function dang_van

end module hc_invariant_criteria
