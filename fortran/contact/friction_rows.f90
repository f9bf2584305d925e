!> Passes over one row of nodes with friction, written so that the compiler takes several nodes at a time.
!>
!> Lengths of vectors are roots of sums of squares: pressures have to come in a unit of their own size.
module hc_friction_rows
  use hc_precision, only: wp
  use hc_contact_state, only: separated, stick, slip
  implicit none
  private

  public :: residual_row, zone_row, cone_row, soften_row

  !> Squares below this count as nothing.
  real(wp), parameter :: nothing = 1.0e-200_wp

contains

  !> What the tractions of a row lack of Coulomb's law, |q - P(q - ds/d_t)|, squared.
  pure subroutine residual_row(n, unit, slope, stiffness, p, qx, qy, dsx, dsy, largest, worst)
    !> Number of nodes
    integer, intent(in) :: n
    !> Inverse of the unit of pressure; slope of Coulomb's law; inverse of d_t [Pa/m]
    real(wp), intent(in) :: unit, slope, stiffness
    !> Pressure, traction and slip of the step
    real(wp), intent(in) :: p(n), qx(n), qy(n), dsx(n), dsy(n)
    !> Squares of the largest traction and of what is lacking most, in the unit of pressure: those of the rows before,
    !> and now of this one too
    real(wp), intent(inout) :: largest, worst
    real(wp) :: x, y, trial_x, trial_y, length, share
    integer :: i

    !$omp simd reduction(max: largest, worst) private(x, y, trial_x, trial_y, length, share)
    do i = 1, n
      x = unit*qx(i)
      y = unit*qy(i)
      trial_x = x - unit*stiffness*dsx(i)
      trial_y = y - unit*stiffness*dsy(i)
      length = sqrt(max(trial_x**2 + trial_y**2, nothing))
      share = min(slope*max(unit*p(i), 0.0_wp)/length, 1.0_wp)
      largest = max(largest, merge(x**2 + y**2, 0.0_wp, p(i) > 0.0_wp))
      worst = max(worst, merge((x - share*trial_x)**2 + (y - share*trial_y)**2, 0.0_wp, p(i) > 0.0_wp))
    end do
  end subroutine residual_row

  !> Zones of a row: |q - r ds| tells.
  pure subroutine zone_row(n, unit, slope, r, p, qx, qy, dsx, dsy, zone)
    !> Number of nodes
    integer, intent(in) :: n
    !> Inverse of the unit of pressure; slope of Coulomb's law; classification parameter [Pa/m]
    real(wp), intent(in) :: unit, slope, r
    !> Pressure, traction and slip of the step
    real(wp), intent(in) :: p(n), qx(n), qy(n), dsx(n), dsy(n)
    !> separated, stick or slip
    integer, intent(out) :: zone(n)
    real(wp) :: x, y
    integer :: i

    !$omp simd private(x, y)
    do i = 1, n
      x = unit*(qx(i) - r*dsx(i))
      y = unit*(qy(i) - r*dsy(i))
      zone(i) = merge(stick, slip, x**2 + y**2 <= (slope*unit*p(i))**2)
      zone(i) = merge(zone(i), separated, p(i) > 0.0_wp)
    end do
  end subroutine zone_row

  !> Tractions of a row cut to the cone; none where there is no pressure.
  pure subroutine cone_row(n, unit, slope, p, qx, qy, cut_x, cut_y)
    !> Number of nodes
    integer, intent(in) :: n
    !> Inverse of the unit of pressure; slope of Coulomb's law
    real(wp), intent(in) :: unit, slope
    !> Pressure and traction
    real(wp), intent(in) :: p(n), qx(n), qy(n)
    !> What is left of the traction
    real(wp), intent(out) :: cut_x(n), cut_y(n)
    real(wp) :: length, share
    integer :: i

    !$omp simd private(length, share)
    do i = 1, n
      length = sqrt(max((unit*qx(i))**2 + (unit*qy(i))**2, nothing))
      share = merge(min(slope*max(unit*p(i), 0.0_wp)/length, 1.0_wp), 0.0_wp, p(i) > 0.0_wp)
      cut_x(i) = share*qx(i)
      cut_y(i) = share*qy(i)
    end do
  end subroutine cone_row

  !> A spring in series with the stiffness that each node was found to have in stick: what it leaves of the traction.
  pure subroutine soften_row(n, compliance, ux, uy, qx, qy)
    !> Number of nodes
    integer, intent(in) :: n
    !> Compliance of the springs, and displacements
    real(wp), intent(in) :: compliance(n), ux(n), uy(n)
    !> Tractions if all nodes stuck, and what is left of them
    real(wp), intent(inout) :: qx(n), qy(n)
    real(wp) :: moved, stretch, left
    integer :: i

    !$omp simd private(moved, stretch, left)
    do i = 1, n
      ! what the spring gives way under that traction
      stretch = compliance(i)*sqrt(qx(i)**2 + qy(i)**2)
      moved = sqrt(ux(i)**2 + uy(i)**2)
      left = merge(moved/max(moved + stretch, nothing), 1.0_wp, stretch > 0.0_wp)
      qx(i) = left*qx(i)
      qy(i) = left*qy(i)
    end do
  end subroutine soften_row

end module hc_friction_rows
