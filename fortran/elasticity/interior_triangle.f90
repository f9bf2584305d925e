!> Displacement and stress below the surface by linear loads on single triangles.
!>
!> A load may jump at the edges of its triangle: at a point of such an edge on the surface some stresses are infinite,
!> and the logarithm is cut off there, so that the sum over triangles of a continuous load stays right. Triangles
!> that share an edge must find the same distance from it, to the last bit: lengths are divided by powers of two, and
!> all triangles of a set have the same cut.
!> Near the triangle: closed forms by edges. Far away: the point loads of a conical product rule.
!>
!> Equations: docs/theory/interior.md, (I13) to (I15).
module hc_interior_triangle
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_conical_rule, only: node, node_weight
  use hc_edge_form, only: twice_area
  use hc_segment_integrals, only: segment_t, segment_integrals
  use hc_interior_fields, only: n_derivative, stresses, displacements, point_load, check_interior, largest, psi, psi_z, &
                                z_psi_zz, psi_x, psi_y, z_psi_xz, z_psi_yz, z_psi_xx, z_psi_yy, chi_x, chi_y, chi_xx, &
                                chi_yy, z_chi_xxx, z_chi_yyy, omega_xx, omega_yy, omega_xxx, omega_yyy
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  implicit none
  private

  public :: triangle_fields, mesh_fields

  !> Distance from the centroid, in longest edges, from which the triangle is a cluster of point loads.
  real(wp), parameter :: far_radius = 2.5_wp
  !> Distance from an edge, in longest edges of the smallest triangle, below which a point lies on it.
  real(wp), parameter :: next_to = 1.0e-14_wp
  !> Least divisor; where a distance is smaller, its numerator is zero.
  real(wp), parameter :: smallest = 1.0e-30_wp

contains

  !> Compute displacement times the shear modulus, and stress, by the same linear load in the directions p, q_x, q_y.
  subroutine triangle_fields(corner, value, points, poisson_ratio, displacement, stress, error)
    !> Vertices as columns [m], and the load there
    real(wp), intent(in) :: corner(2, 3), value(3)
    !> Points, x, y and depth (3, n) [m]
    real(wp), intent(in) :: points(:, :)
    real(wp), intent(in) :: poisson_ratio
    !> Direction x, y, z; load p, q_x, q_y; point
    real(wp), intent(out) :: displacement(:, :, :)
    !> Component xx, yy, zz, xy, yz, xz; load; point
    real(wp), intent(out) :: stress(:, :, :)
    !> Allocated on failure: numbers that are not finite, points above the surface, no such Poisson's ratio
    type(error_t), allocatable, intent(out) :: error

    real(wp) :: d(1, n_derivative), u(1, 3, 3), s(1, 6, 3), size_of, near
    integer :: i

    call check_triangle(corner, error)
    if (.not. allocated(error)) call check_interior(points(1, :), points(2, :), points(3, :), poisson_ratio, error)
    if (allocated(error)) return
    size_of = unit_length(corner)
    near = next_to*longest_edge(corner)
    !$omp parallel do schedule(dynamic, 16) private(d, u, s) if (size(points, 2) > 64)
    do i = 1, size(points, 2)
      d(1, :) = potentials(corner, value, points(:, i), near)
      call displacements(1, d, d, d, [points(3, i)/size_of], poisson_ratio, u)
      call stresses(1, d, d, d, poisson_ratio, s)
      displacement(:, :, i) = size_of*u(1, :, :)
      stress(:, :, i) = s(1, :, :)
    end do
    !$omp end parallel do
  end subroutine triangle_fields

  !> Compute displacement times the shear modulus, and stress, by tractions that are linear on each triangle of a set.
  subroutine mesh_fields(corner, traction, points, poisson_ratio, displacement, stress, error)
    !> Vertices (direction, vertex, triangle) [m]
    real(wp), intent(in) :: corner(:, :, :)
    !> Pressure and traction on the body along x and y (component, vertex, triangle) [Pa]
    real(wp), intent(in) :: traction(:, :, :)
    !> Points, x, y and depth (3, n) [m]
    real(wp), intent(in) :: points(:, :)
    real(wp), intent(in) :: poisson_ratio
    !> Displacement times the shear modulus (direction, point) [Pa m], stress (component, point) [Pa]
    real(wp), intent(out) :: displacement(:, :), stress(:, :)
    !> Allocated on failure: numbers that are not finite, points above the surface, no such Poisson's ratio
    type(error_t), allocatable, intent(out) :: error

    real(wp) :: d(1, n_derivative, 3), u(1, 3, 3), s(1, 6, 3), size_of, near
    integer :: i, t, k

    near = largest
    do t = 1, size(corner, 3)
      call check_triangle(corner(:, :, t), error)
      if (allocated(error)) return
      if (abs(twice_area(corner(:, :, t))) > 0.0_wp) near = min(near, next_to*longest_edge(corner(:, :, t)))
    end do
    if (.not. all(ieee_is_finite(traction))) then
      call raise(error, status%invalid_input, 'the tractions: finite numbers expected')
    else
      call check_interior(points(1, :), points(2, :), points(3, :), poisson_ratio, error)
    end if
    if (allocated(error)) return
    displacement = 0.0_wp
    stress = 0.0_wp
    !$omp parallel do schedule(dynamic, 4) private(d, u, s, t, k, size_of) if (size(points, 2) > 4)
    do i = 1, size(points, 2)
      do t = 1, size(corner, 3)
        size_of = unit_length(corner(:, :, t))
        do k = 1, 3
          d(1, :, k) = potentials(corner(:, :, t), traction(k, :, t), points(:, i), near)
        end do
        call displacements(1, d(:, :, 1), d(:, :, 2), d(:, :, 3), [points(3, i)/size_of], poisson_ratio, u)
        call stresses(1, d(:, :, 1), d(:, :, 2), d(:, :, 3), poisson_ratio, s)
        displacement(:, i) = displacement(:, i) + size_of*sum(u(1, :, :), dim=2)
        stress(:, i) = stress(:, i) + sum(s(1, :, :), dim=2)
      end do
    end do
    !$omp end parallel do
  end subroutine mesh_fields

  !> Refuse vertices that are not finite, or too far away for their squares.
  pure subroutine check_triangle(corner, error)
    real(wp), intent(in) :: corner(2, 3)
    type(error_t), allocatable, intent(out) :: error

    if (.not. all(ieee_is_finite(corner))) then
      call raise(error, status%invalid_input, 'vertices: finite coordinates expected')
    else if (any(abs(corner) > largest)) then
      call raise(error, status%invalid_input, 'vertices: coordinates of at most 1e100 expected')
    end if
  end subroutine check_triangle

  !> Return the longest edge of a triangle; of one that is a point, a length that can be divided by.
  pure real(wp) function longest_edge(corner)
    real(wp), intent(in) :: corner(2, 3)
    longest_edge = max(1.0_wp/largest, maxval(norm2(corner - cshift(corner, 1, dim=2), dim=1)))
  end function longest_edge

  !> Return the unit of length of a triangle: the power of two above its longest edge, by which division is exact.
  pure real(wp) function unit_length(corner)
    real(wp), intent(in) :: corner(2, 3)
    unit_length = scale(1.0_wp, exponent(longest_edge(corner)))
  end function unit_length

  !> Compute the derivatives of the potentials of a linear load, with the `unit_length` of the triangle.
  pure function potentials(corner, value, point, near) result(d)
    !> Vertices as columns, the load there, and the point
    real(wp), intent(in) :: corner(2, 3), value(3), point(3)
    !> Distance below which the point lies on an edge
    real(wp), intent(in) :: near
    real(wp) :: d(n_derivative)

    real(wp) :: at(2, 3), load(3), length, cut, z, area_2, slope(2)
    integer :: order(3), i

    d = 0.0_wp
    length = unit_length(corner)
    cut = max(near/length, 100.0_wp*smallest)
    area_2 = twice_area(corner)
    if (.not. abs(area_2) > epsilon(1.0_wp)*length**2 .or. all(abs(value) <= 0.0_wp)) return
    order = merge([1, 2, 3], [1, 3, 2], area_2 > 0.0_wp)
    area_2 = abs(area_2)/length**2
    do i = 1, 3
      at(:, i) = (corner(:, order(i)) - point(1:2))/length
    end do
    load = value(order)
    z = point(3)/length
    do i = 1, 3
      if (norm2(at(:, i)) > cut) cycle
      ! at a vertex the limit from below is taken
      at(:, i) = 0.0_wp
      z = max(z, 0.01_wp*cut)
    end do
    if (norm2([sum(at, dim=2)/3.0_wp, z]) > far_radius*longest_edge(corner)/length) then
      do i = 1, size(node_weight)
        d = d + 0.5_wp*area_2*node_weight(i)*dot_product(node(i, :), load)*point_load(-matmul(at, node(i, :)), z)
      end do
      return
    end if
    slope = (load(2) - load(1))*[at(2, 3) - at(2, 1), at(1, 1) - at(1, 3)]/area_2 &
            + (load(3) - load(1))*[at(2, 1) - at(2, 2), at(1, 2) - at(1, 1)]/area_2
    do i = 1, 3
      d = d + edge_terms(at(:, i), at(:, modulo(i, 3) + 1), load(1) - dot_product(slope, at(:, 1)), slope, z, cut)
    end do
    d(z_psi_zz) = -(d(z_psi_xx) + d(z_psi_yy))
  end function potentials

  !> Compute the share of one edge of a triangle, counter-clockwise, in the derivatives.
  pure function edge_terms(from, onto, value, slope, z, near) result(d)
    !> Ends of the edge relative to the point
    real(wp), intent(in) :: from(2), onto(2)
    !> The load continued to the point, and its slopes
    real(wp), intent(in) :: value, slope(2)
    !> Depth; distance below which the point lies on the edge
    real(wp), intent(in) :: z, near
    real(wp) :: d(n_derivative)

    type(segment_t) :: s
    real(wp), dimension(2) :: along, normal, t, f, r, rz
    real(wp) :: length, q, tm, alpha, gamma, q_0, w_0, q_1, f_log, log_less_r, lambda, d_t_over_r, z_q, z_z

    length = norm2(onto - from)
    along = (onto - from)/length
    normal = [along(2), -along(1)]
    t = [dot_product(along, from), dot_product(along, onto)]
    tm = 0.5_wp*sum(t)
    ! the nearer end gives the more accurate distance, and the same one to both triangles that share the edge
    q = -dot_product(normal, merge(from, onto, tm > 0.0_wp))
    if (.not. abs(tm) > 0.0_wp) q = -0.5_wp*dot_product(normal, from + onto)
    if (abs(q) < near) q = 0.0_wp
    s = segment_integrals(q, t(1), t(2), length, z)
    lambda = s%lambda
    if (s%nn < near**2) then
      associate (cut => segment_integrals(near, t(1), t(2), length, 0.0_wp))
        lambda = cut%lambda
      end associate
    end if
    alpha = value - q*dot_product(slope, normal)
    gamma = dot_product(slope, along)
    f = alpha + gamma*s%t
    r = max(s%r, smallest)
    rz = max(s%r + z, smallest)
    q_0 = s%q_0 - length
    w_0 = s%w_0 - z*length
    q_1 = difference(0.5_wp*(s%r**2 - z*z)*log(rz) - 0.25_wp*(s%r - z)**2)
    f_log = alpha*s%d_log + gamma*s%d_t_log
    log_less_r = z*s%d_log - s%d_r
    ! [t/R] q z/N^2 and [t/R] z^2/N^2, in the limit z -> 0
    d_t_over_r = difference(s%t/r)
    if (s%t(1)*s%t(2) > 0.0_wp) d_t_over_r = 2.0_wp*s%nn*tm*length/(r(1)*r(2)*(s%t(2)*r(1) + s%t(1)*r(2)))
    z_q = 0.0_wp
    z_z = d_t_over_r
    if (s%nn > smallest**2) then
      z_q = d_t_over_r*(z*q/s%nn)
      z_z = d_t_over_r*(z*z/s%nn)
    end if

    d = 0.0_wp
    d(psi) = -value*s%a_1 + dot_product(slope, normal)*0.5_wp*(s%d_tr + s%nn*s%lambda)
    d(psi_z) = value*s%beta + z*dot_product(slope, normal)*s%lambda
    d(psi_x:psi_y) = -slope*s%a_1 - normal*(alpha*lambda + gamma*s%d_r)
    d(z_psi_xz:z_psi_yz) = z*slope*s%beta - normal*(-alpha*z_z + gamma*z*z*difference(1.0_wp/r))
    d(chi_x:chi_y) = -0.5_wp*slope*(q*q_0 + z*s%a_1 - 0.5_wp*q*length) - normal*(alpha*q_0 + gamma*q_1)
    d(z_psi_xx:z_psi_yy) = second(z*s%lambda, gamma*z*s%lambda - z*difference(f/r), &
                                  -alpha*z_q + gamma*q*z*difference(1.0_wp/r))
    d(chi_xx:chi_yy) = second(q_0, gamma*q_0 - f_log, alpha*s%beta + gamma*q*s%d_log)
    d(omega_xx:omega_yy) = second(w_0, gamma*w_0 - (z*f_log - alpha*s%d_r - gamma*s%d_tr), &
                                  -alpha*s%a_1 + gamma*q*log_less_r)
    d(z_chi_xxx:z_chi_yyy) = third(z*s%beta, z*s%d_log, gamma*z*s%beta - q*z*difference(f/(r*rz)), &
                                   -gamma*z*s%d_log + z*difference(f*s%t/(r*rz)), &
                                   alpha*(z_z - z*difference(s%t/(r*rz))) &
                                   + gamma*(z*s%d_log + q*q*z*difference(1.0_wp/(r*rz))))
    d(omega_xxx:omega_yyy) = third(-s%a_1, log_less_r, -gamma*s%a_1 + q*difference(f/rz), &
                                   -gamma*log_less_r - difference(f*s%t/rz), &
                                   alpha*(-lambda + difference(s%t/rz)) + gamma*(log_less_r - q*q*difference(1.0_wp/rz)))

  contains

    !> Compute the difference between the ends.
    pure real(wp) function difference(values)
      real(wp), intent(in) :: values(2)
      difference = values(2) - values(1)
    end function difference

    !> Compute the second derivatives xx, xy, yy
    pure function second(i_0, with_along, with_normal)
      real(wp), intent(in) :: i_0, with_along, with_normal
      real(wp) :: second(3)
      integer, parameter :: first(3) = [1, 1, 2], last(3) = [1, 2, 2]

      second = -slope(first)*normal(last)*i_0 - normal(first)*(along(last)*with_along + normal(last)*with_normal)
    end function second

    !> Compute the third derivatives xxx, xxy, xyy, yyy
    pure function third(i_0, kernel, mixed, with_along, with_normal)
      real(wp), intent(in) :: i_0, kernel, mixed, with_along, with_normal
      real(wp) :: third(4)
      integer, parameter :: a(4) = [1, 1, 1, 2], b(4) = [1, 1, 2, 2], c(4) = [1, 2, 2, 2]

      third = -slope(a)*normal(b)*(normal(c)*i_0 - along(c)*kernel) &
              - normal(a)*((along(b)*normal(c) + normal(b)*along(c))*mixed + along(b)*along(c)*with_along &
                           + normal(b)*normal(c)*with_normal)
    end function third

  end function edge_terms

end module hc_interior_triangle
