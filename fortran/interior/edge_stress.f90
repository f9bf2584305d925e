!> Stress of the difference between a traction and its hats, next to the edge of its zone.
!>
!> The traction vanishes like a root there, the hats of the nodes like straight lines. Their difference is integrated in polar
!> coordinates about the field point:
!>
!>     delta sigma(x, z) = int int (delta(r, theta) - delta_0) w(r) S(r, theta, z) r dr dtheta + delta_0 D(z)
!>
!> S is the stress of a point load, D that of a disc about the point, w and the taper of delta end the integral within a few
!> spacings. Rays are broken at the edge and at depths of the point, so that Gauss points resolve all of it. Lengths are in
!> spacings.
!>
!> Equations: docs/theory/interior.md, (I21).
module hc_edge_stress
  use hc_precision, only: wp, pi
  use hc_lattice, only: lattice_t
  use hc_interpolation, only: interpolate
  use hc_edge_root, only: edge_root_t, gauss_rule
  use hc_interior_fields, only: n_derivative, stresses, point_load, xx, yy, zz, xz, yz
  implicit none
  private

  public :: edge_correction

  !> Distance from the edge, and depth, within which a point gets a correction; deeper, hats are right to 2e-3 of the largest
  !> pressure.
  real(wp), parameter, public :: most_away = 6.0_wp, most_deep = 1.0_wp
  !> Radius of the integral, and distances from the edge between which the difference ends.
  real(wp), parameter :: radius = 3.0_wp, band = 2.0_wp, fade = 1.5_wp
  !> Depth below which the value at the point is integrated by itself.
  real(wp), parameter :: shallow = 0.1_wp
  !> Gauss points in a quarter of the angle, and on a piece of a ray.
  integer, parameter :: n_angle = 6, n_ray = 8

contains

  !> Return the stress of the difference of root and hats at a point.
  pure function edge_correction(root, lattice, field, load, poisson_ratio, point, depth) result(stress)
    !> Root of the field at the edge
    type(edge_root_t), intent(in) :: root
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Values of the hats (n_col, n_row) [Pa]
    real(wp), intent(in) :: field(:, :)
    !> Pressure, and shear traction along x and y, over the field
    real(wp), intent(in) :: load(3)
    real(wp), intent(in) :: poisson_ratio
    !> Point and its depth, in spacings
    real(wp), intent(in) :: point(2), depth
    !> Stress xx, yy, zz, xy, yz, xz [Pa]
    real(wp) :: stress(6)
    real(wp) :: node(n_angle), weight(n_angle), at(2), value, gradient(2), here, first, angle
    integer :: quarter, k

    stress = 0.0_wp
    at = matmul(point - root%center, root%axes)
    call root%square(at, value, gradient)
    if (abs(value) > most_away*norm2(gradient) .or. depth >= most_deep .or. .not. norm2(gradient) > 0.0_wp) return
    here = 0.0_wp
    if (depth < shallow) here = difference(root, lattice, field, point)
    call gauss_rule(node, weight)
    gradient = matmul(root%axes, gradient)
    first = atan2(gradient(2), gradient(1)) - 0.5_wp*pi
    do quarter = 0, 3
      do k = 1, n_angle
        angle = first + 0.5_wp*pi*(quarter + stretched(node(k)))
        stress = stress + 0.5_wp*pi*weight(k)*stretch(node(k))*ray([cos(angle), sin(angle)])
      end do
    end do
    stress = stress + here*disc(depth, load, poisson_ratio)

  contains

    !> Integrate along a ray.
    pure function ray(direction) result(total)
      real(wp), intent(in) :: direction(2)
      real(wp) :: total(6)
      real(wp) :: ends(6), points(n_ray), weights(n_ray), derivative(n_ray, n_derivative), part(n_ray, 6, 3), factor(n_ray), r
      integer :: piece, n, i

      call break_ray(root, at, matmul(direction, root%axes), depth, ends, n)
      call gauss_rule(points, weights)
      total = 0.0_wp
      do piece = 1, n - 1
        associate (low => ends(piece), length => ends(piece + 1) - ends(piece))
          if (length <= 1.0e-12_wp) cycle
          do i = 1, n_ray
            r = low + length*stretched(points(i))
            factor(i) = length*stretch(points(i))*weights(i)*r*(1.0_wp - step((r - 0.5_wp*radius)/(0.5_wp*radius))) &
                        *(difference(root, lattice, field, point + r*direction) - here)
            derivative(i, :) = point_load(-r*direction, depth)
          end do
        end associate
        call stresses(n_ray, derivative, derivative, derivative, poisson_ratio, part)
        do i = 1, n_ray
          total = total + factor(i)*matmul(part(i, :, :), load)
        end do
      end do
    end function ray

  end function edge_correction

  !> Compute the stress of the root less that of the hats at a point, tapered inside.
  pure real(wp) function difference(root, lattice, field, point)
    type(edge_root_t), intent(in) :: root
    type(lattice_t), intent(in) :: lattice
    real(wp), intent(in) :: field(:, :)
    !> In spacings
    real(wp), intent(in) :: point(2)
    real(wp) :: value, gradient(2), away

    call root%square(matmul(point - root%center, root%axes), value, gradient)
    away = value/max(norm2(gradient), tiny(1.0_wp))
    difference = 0.0_wp
    if (away >= band + fade) return
    difference = (1.0_wp - step((away - band)/fade))*(sqrt(max(value, 0.0_wp)) - interpolate(lattice, field, &
                                                                                            point*lattice%spacing(), 0.0_wp))
  end function difference

  !> Break a ray where it crosses the edge, and at half and twice the depth.
  pure subroutine break_ray(root, at, direction, depth, ends, n)
    type(edge_root_t), intent(in) :: root
    !> Point and direction, along the edge and inwards
    real(wp), intent(in) :: at(2), direction(2), depth
    !> Ends of the pieces, ascending, and their number
    real(wp), intent(out) :: ends(6)
    integer, intent(out) :: n
    real(wp) :: c(0:2), root_of, sum_of, candidates(4), swap
    integer :: k, j

    c = root%along(at, direction)
    candidates = [-1.0_wp, -1.0_wp, 0.5_wp*depth, 2.0_wp*depth]
    root_of = c(1)**2 - 4.0_wp*c(0)*c(2)
    if (root_of >= 0.0_wp) then
      sum_of = -0.5_wp*(c(1) + sign(sqrt(root_of), c(1)))
      if (abs(c(2)) > 1.0e-6_wp*abs(sum_of)) candidates(1) = sum_of/c(2)
      if (abs(sum_of) > 0.0_wp) candidates(2) = c(0)/sum_of
    end if
    ends = 0.0_wp
    n = 1
    do k = 1, size(candidates)
      if (.not. (candidates(k) > 0.0_wp .and. candidates(k) < radius)) cycle
      n = n + 1
      ends(n) = candidates(k)
      do j = n, 3, -1
        if (ends(j) >= ends(j - 1)) exit
        swap = ends(j)
        ends(j) = ends(j - 1)
        ends(j - 1) = swap
      end do
    end do
    n = n + 1
    ends(n) = radius
  end subroutine break_ray

  !> Compute the stress below the middle of a disc of the load 1, tapered like the integral.
  pure function disc(z, load, poisson_ratio) result(stress)
    real(wp), intent(in) :: z, load(3), poisson_ratio
    real(wp) :: stress(6)
    real(wp) :: ends(9), node(n_ray), weight(n_ray), psi_z_sum, z_psi_zz_sum, r, square, factor
    integer :: piece, i

    stress = 0.0_wp
    psi_z_sum = -1.0_wp
    z_psi_zz_sum = 0.0_wp
    if (z > 0.0_wp) then
      call gauss_rule(node, weight)
      ends = min([0.0_wp, 0.5_wp, 1.0_wp, 2.0_wp, 4.0_wp, 8.0_wp, 16.0_wp, 64.0_wp, huge(1.0_wp)/2.0_wp], radius/z)*z
      psi_z_sum = 0.0_wp
      do piece = 1, size(ends) - 1
        do i = 1, n_ray
          r = ends(piece) + (ends(piece + 1) - ends(piece))*node(i)
          square = r**2 + z**2
          factor = (ends(piece + 1) - ends(piece))*weight(i)*r*(1.0_wp - step((r - 0.5_wp*radius)/(0.5_wp*radius)))
          psi_z_sum = psi_z_sum - factor*z/square**1.5_wp
          z_psi_zz_sum = z_psi_zz_sum - factor*z*(1.0_wp - 3.0_wp*z**2/square)/square**1.5_wp
        end do
      end do
    end if
    stress([xx, yy]) = load(1)*((0.5_wp + poisson_ratio)*psi_z_sum + 0.5_wp*z_psi_zz_sum)
    stress(zz) = load(1)*(psi_z_sum - z_psi_zz_sum)
    stress([xz, yz]) = load(2:3)*(psi_z_sum + 0.5_wp*z_psi_zz_sum)
  end function disc

  !> Return a smooth step from 0 to 1.
  pure real(wp) function step(u)
    real(wp), intent(in) :: u
    associate (v => min(max(u, 0.0_wp), 1.0_wp))
      step = v**3*(10.0_wp - 15.0_wp*v + 6.0_wp*v**2)
    end associate
  end function step

  !> Map (0, 1) to itself with slopes of 0 at the ends, and return the slope.
  pure real(wp) function stretched(u)
    real(wp), intent(in) :: u
    stretched = u**2*(3.0_wp - 2.0_wp*u)
  end function stretched

  pure real(wp) function stretch(u)
    real(wp), intent(in) :: u
    stretch = 6.0_wp*u*(1.0_wp - u)
  end function stretch

end module hc_edge_stress
