!> Displacement and stress below the surface from the derivatives of three harmonic potentials of the load.
!>
!> For a load f on the surface, with R the distance of the field point (x, y, z):
!>
!>     Psi = iint f/R     X = iint f ln(R + z)     Omega = iint f (z ln(R + z) - R)
!>
!> Derivatives that the fields contain only times z are formed times z, so that all of them stay finite up to the
!> surface for a continuous load. Stress is positive in tension; z points into the body.
!>
!> Equations: docs/theory/interior.md, (I1) to (I3).
module hc_interior_fields
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp, pi
  use hc_error, only: error_t, status, raise
  implicit none
  private

  public :: stresses, displacements, point_load, check_interior

  !> Largest coordinate, whose powers are finite
  real(wp), parameter, public :: largest = 1.0e100_wp

  !> Derivatives in a row: those of Psi (the first and the tangential ones), z times the second ones of Psi, ...
  integer, parameter, public :: psi = 1, psi_z = 2, z_psi_zz = 3, psi_x = 4, psi_y = 5, z_psi_xz = 6, z_psi_yz = 7, &
    z_psi_xx = 8, z_psi_xy = 9, z_psi_yy = 10
  !> ... those of X and z times its third ones ...
  integer, parameter, public :: chi_x = 11, chi_y = 12, chi_xx = 13, chi_xy = 14, chi_yy = 15, &
    z_chi_xxx = 16, z_chi_xxy = 17, z_chi_xyy = 18, z_chi_yyy = 19
  !> ... and those of Omega.
  integer, parameter, public :: omega_xx = 20, omega_xy = 21, omega_yy = 22, &
    omega_xxx = 23, omega_xxy = 24, omega_xyy = 25, omega_yyy = 26
  !> Number of derivatives
  integer, parameter, public :: n_derivative = 26

  !> Components of the stress.
  integer, parameter, public :: xx = 1, yy = 2, zz = 3, xy = 4, yz = 5, xz = 6

contains

  !> Refuse points that do not lie in the body, and Poisson's ratios that no body has.
  pure subroutine check_interior(x, y, z, poisson_ratio, error)
    !> Points
    real(wp), intent(in) :: x(:), y(:), z(:)
    real(wp), intent(in) :: poisson_ratio
    !> Allocated on failure: also for points so far away that squares of their distances are infinite
    type(error_t), allocatable, intent(out) :: error

    ! finite first: a comparison with NaN may be trapped
    if (.not. (all(ieee_is_finite(x)) .and. all(ieee_is_finite(y)) .and. all(ieee_is_finite(z)))) then
      call raise(error, status%invalid_input, 'field points: finite coordinates expected')
    else if (max(maxval(abs(x)), maxval(abs(y)), maxval(abs(z))) > largest) then
      call raise(error, status%invalid_input, 'field points: coordinates of at most 1e100 expected')
    else if (any(z < 0.0_wp)) then
      call raise(error, status%invalid_input, 'field points: depths z of at least 0 expected, as z points into the body')
    else if (.not. ieee_is_finite(poisson_ratio)) then
      call raise(error, status%invalid_input, 'Poisson''s ratio: a number above -1 and at most 0.5 expected')
    else if (poisson_ratio <= -1.0_wp .or. poisson_ratio > 0.5_wp) then
      call raise(error, status%invalid_input, 'Poisson''s ratio: a number above -1 and at most 0.5 expected')
    end if
  end subroutine check_interior

  !> Compute the stress by the three loads, from the derivatives of the potentials of each.
  pure subroutine stresses(n, pressure, shear_x, shear_y, poisson_ratio, stress)
    !> Number of points
    integer, intent(in) :: n
    !> Derivatives for the pressure, and for the traction along x and y that acts on the body
    real(wp), intent(in) :: pressure(n, n_derivative), shear_x(n, n_derivative), shear_y(n, n_derivative)
    real(wp), intent(in) :: poisson_ratio
    !> Point, component, load
    real(wp), intent(out) :: stress(n, 6, 3)

    associate (p => pressure, q => shear_x, nu => poisson_ratio)
      stress(:, xx, 1) = 2.0_wp*nu*p(:, psi_z) - p(:, z_psi_xx) - (1.0_wp - 2.0_wp*nu)*p(:, chi_xx)
      stress(:, yy, 1) = 2.0_wp*nu*p(:, psi_z) - p(:, z_psi_yy) - (1.0_wp - 2.0_wp*nu)*p(:, chi_yy)
      stress(:, zz, 1) = p(:, psi_z) - p(:, z_psi_zz)
      stress(:, xy, 1) = -p(:, z_psi_xy) - (1.0_wp - 2.0_wp*nu)*p(:, chi_xy)
      stress(:, yz, 1) = -p(:, z_psi_yz)
      stress(:, xz, 1) = -p(:, z_psi_xz)

      stress(:, xx, 2) = 2.0_wp*(1.0_wp + nu)*q(:, psi_x) + 2.0_wp*nu*q(:, omega_xxx) - q(:, z_chi_xxx)
      stress(:, yy, 2) = 2.0_wp*nu*(q(:, psi_x) + q(:, omega_xyy)) - q(:, z_chi_xyy)
      stress(:, zz, 2) = -q(:, z_psi_xz)
      stress(:, xy, 2) = q(:, psi_y) + 2.0_wp*nu*q(:, omega_xxy) - q(:, z_chi_xxy)
      stress(:, yz, 2) = -q(:, z_psi_xy)
      stress(:, xz, 2) = q(:, psi_z) - q(:, z_psi_xx)
    end associate

    associate (q => shear_y, nu => poisson_ratio)
      stress(:, xx, 3) = 2.0_wp*nu*(q(:, psi_y) + q(:, omega_xxy)) - q(:, z_chi_xxy)
      stress(:, yy, 3) = 2.0_wp*(1.0_wp + nu)*q(:, psi_y) + 2.0_wp*nu*q(:, omega_yyy) - q(:, z_chi_yyy)
      stress(:, zz, 3) = -q(:, z_psi_yz)
      stress(:, xy, 3) = q(:, psi_x) + 2.0_wp*nu*q(:, omega_xyy) - q(:, z_chi_xyy)
      stress(:, yz, 3) = q(:, psi_z) - q(:, z_psi_yy)
      stress(:, xz, 3) = -q(:, z_psi_xy)
    end associate
    stress = stress/(2.0_wp*pi)
  end subroutine stresses

  !> Compute the displacement times the shear modulus by the three loads, from the derivatives of the potentials of each.
  pure subroutine displacements(n, pressure, shear_x, shear_y, z, poisson_ratio, displacement)
    !> Number of points
    integer, intent(in) :: n
    !> Derivatives for the pressure, and for the traction along x and y that acts on the body
    real(wp), intent(in) :: pressure(n, n_derivative), shear_x(n, n_derivative), shear_y(n, n_derivative)
    !> Depth
    real(wp), intent(in) :: z(n)
    real(wp), intent(in) :: poisson_ratio
    !> Point; direction x, y, z; load
    real(wp), intent(out) :: displacement(n, 3, 3)

    associate (p => pressure, q => shear_x, nu => poisson_ratio)
      displacement(:, 1, 1) = -(1.0_wp - 2.0_wp*nu)*p(:, chi_x) - z*p(:, psi_x)
      displacement(:, 2, 1) = -(1.0_wp - 2.0_wp*nu)*p(:, chi_y) - z*p(:, psi_y)
      displacement(:, 3, 1) = 2.0_wp*(1.0_wp - nu)*p(:, psi) - z*p(:, psi_z)

      displacement(:, 1, 2) = 2.0_wp*(q(:, psi) + nu*q(:, omega_xx)) - z*q(:, chi_xx)
      displacement(:, 2, 2) = 2.0_wp*nu*q(:, omega_xy) - z*q(:, chi_xy)
      displacement(:, 3, 2) = (1.0_wp - 2.0_wp*nu)*q(:, chi_x) - z*q(:, psi_x)
    end associate

    associate (q => shear_y, nu => poisson_ratio)
      displacement(:, 1, 3) = 2.0_wp*nu*q(:, omega_xy) - z*q(:, chi_xy)
      displacement(:, 2, 3) = 2.0_wp*(q(:, psi) + nu*q(:, omega_yy)) - z*q(:, chi_yy)
      displacement(:, 3, 3) = (1.0_wp - 2.0_wp*nu)*q(:, chi_y) - z*q(:, psi_y)
    end associate
    displacement = displacement/(4.0_wp*pi)
  end subroutine displacements

  !> Compute the derivatives of the potentials of a unit point load at the origin.
  pure function point_load(at, z) result(d)
    !> The point, and its depth
    real(wp), intent(in) :: at(2), z
    real(wp) :: d(n_derivative)

    real(wp) :: r, k, m, h, s
    real(wp) :: xx2(3), xxx3(4), delta(3), mixed(4)

    r = sqrt(sum(at**2) + z*z)
    s = r + z
    xx2 = [at(1)**2, at(1)*at(2), at(2)**2]
    xxx3 = [at(1)**3, at(1)**2*at(2), at(1)*at(2)**2, at(2)**3]
    delta = [1.0_wp, 0.0_wp, 1.0_wp]
    mixed = [3.0_wp*at(1), at(2), at(1), 3.0_wp*at(2)]
    k = 1.0_wp/(r*s)
    m = (r + s)/(r**3*s**2)
    h = 1.0_wp/(r*s**2)
    d(psi) = 1.0_wp/r
    d(psi_z) = -z/r**3
    d(z_psi_zz) = z*(3.0_wp*z*z/r**5 - 1.0_wp/r**3)
    d(psi_x:psi_y) = -at/r**3
    d(z_psi_xz:z_psi_yz) = 3.0_wp*z*z*at/r**5
    d(z_psi_xx:z_psi_yy) = z*(3.0_wp*xx2/r**5 - delta/r**3)
    d(chi_x:chi_y) = at*k
    d(chi_xx:chi_yy) = delta*k - xx2*m
    d(z_chi_xxx:z_chi_yyy) = z*(xxx3*(8.0_wp*r*r + 9.0_wp*r*z + 3.0_wp*z*z)/(r**5*s**3) - mixed*m)
    d(omega_xx:omega_yy) = xx2*h - delta/s
    d(omega_xxx:omega_yyy) = mixed*h - xxx3*(3.0_wp*r + z)/(r**3*s**3)
  end function point_load

end module hc_interior_fields
