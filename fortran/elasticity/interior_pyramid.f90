!> Potentials of one pyramid of traction below the surface: displacement and stress at any point of the half-space.
!>
!> Near the pyramid: line integrals over its nine creases, each symbol added up over the creases of one direction before
!> anything else, with the factors z and n inside, so that all of them stay finite at z = 0, on creases and at vertices.
!> Far away: moments of the hat times derivatives of 1/R, which are solid harmonics; with w = (x - i y)/R and
!> c = z/R the derivative of degree l and order m has the angular part w^m times a polynomial H(l, m) of c (for X and
!> Omega, where l < m, a rational function).
!> Points are taken in rows, so that the far field is worked out by vector instructions.
!>
!> Equations: docs/theory/interior.md, (I4) to (I9).
module hc_interior_pyramid
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_hat, only: crease_t, hat_creases, hat_moments, max_order
  use hc_segment_integrals, only: segment_integrals
  use hc_interior_fields, only: n_derivative, stresses, displacements, check_interior, psi, psi_z, z_psi_zz, &
                                psi_x, psi_y, z_psi_xz, z_psi_yz, z_psi_xx, z_psi_xy, z_psi_yy, chi_x, chi_y, &
                                chi_xx, chi_xy, chi_yy, z_chi_xxx, z_chi_xxy, z_chi_xyy, z_chi_yyy, omega_xx, &
                                omega_xy, omega_yy, omega_xxx, omega_xxy, omega_xyy, omega_yyy
  implicit none
  private

  public :: interior_pyramid_t, new_interior_pyramid

  !> Distance from which the moment expansion is used, in longest edges.
  real(wp), parameter :: far_radius = 3.0_wp
  !> Beyond band_radius(k, :) the moments up to the order band_order(k) suffice: truncation < 1e-14 of the envelopes, or < 3e-17
  !> where fields are summed with large coefficients of either sign.
  real(wp), parameter :: band_radius(7, 2) = reshape([6.0_wp, 7.0_wp, 9.0_wp, 14.0_wp, 25.0_wp, 57.0_wp, 200.0_wp, &
                                                      9.0_wp, 11.0_wp, 15.0_wp, 25.0_wp, 52.0_wp, 140.0_wp, 630.0_wp], [7, 2])
  integer, parameter :: band_order(7) = [16, 14, 12, 10, 8, 6, 4]
  !> Points that are worked on at a time.
  integer, parameter, public :: most_points = 64
  !> Largest order of a harmonic.
  integer, parameter :: max_harmonic = max_order + 3

  !> The pyramid of a lattice: creases and moments.
  type :: interior_pyramid_t
    private
    !> Longest edge [m]
    real(wp), public :: spacing = 1.0_wp
    type(crease_t) :: crease(3)
    !> Volume of the pyramid of unit height
    real(wp) :: volume = 0.0_wp
    !> Harmonics are multiples of it (6 if the lattice is equilateral, else 2)
    integer :: fold = 2
    !> Column of `band_radius`
    integer :: bands = 1
    !> Signed coefficients of the moments: order of the moment, harmonic, order of the derivative (0...3)
    complex(wp) :: moment(0:max_order, -max_order:max_order, 0:3) = 0.0_wp
  contains
    !> Derivatives of the potentials at up to most_points points
    procedure :: potentials
    !> Sums of these derivatives over loaded nodes
    procedure :: sum_over_nodes
    !> Displacement and stress at any number of points
    procedure :: fields
  end type interior_pyramid_t

  !> Points far from the node, for its moment series.
  type :: far_points_t
    !> Number of points, highest order of the moments
    integer :: n = 0, order = 0
    !> Cosine of the angle from the axis; powers of 1/(2R)^2
    real(wp) :: c(most_points), inverse(most_points, 0:max_order/2)
  end type far_points_t

contains

  !> Set up creases and moments of the pyramid of a lattice.
  pure subroutine new_interior_pyramid(pyramid, basis, sharp)
    !> Pyramid to be set up
    type(interior_pyramid_t), intent(out) :: pyramid
    !> Basis vectors of the lattice as columns [m]
    real(wp), intent(in) :: basis(2, 2)
    !> Fields will be summed with large coefficients; absent: they will not
    logical, intent(in), optional :: sharp

    complex(wp) :: moment(0:max_order, 0:max_order)
    real(wp) :: edges(2, 3)
    integer :: a, b, m

    if (present(sharp)) pyramid%bands = merge(2, 1, sharp)
    call hat_creases(basis, pyramid%crease, edges, pyramid%spacing, pyramid%volume)
    moment = hat_moments(cmplx(edges(1, :), edges(2, :), wp))
    pyramid%fold = 6
    do b = 0, max_order
      do a = modulo(b, 2), max_order - b, 2
        ! the moments of a! b! that the equilateral lattice has not are round-off
        moment(a, b) = moment(a, b)/(gamma(real(a + 1, wp))*gamma(real(b + 1, wp)))
        if (a + b <= 4 .and. modulo(a - b, 6) /= 0 .and. abs(moment(a, b)) > 1.0e-14_wp) pyramid%fold = 2
        do m = 0, 3
          pyramid%moment(a + b, a - b, m) = merge(-1.0_wp, 1.0_wp, modulo(min(m + a, b), 2) == 1)*moment(a, b)
        end do
      end do
    end do
    ! the harmonics of either sign of a real function are one
    pyramid%moment(:, 1:, 0) = 2.0_wp*pyramid%moment(:, 1:, 0)
    pyramid%moment(:, :-1, 0) = 0.0_wp
  end subroutine new_interior_pyramid

  !> Compute the derivatives of the potentials of the unit pyramid, lengths in longest edges.
  pure subroutine potentials(self, n, x, y, z, derivative)
    class(interior_pyramid_t), intent(in) :: self
    !> Number of points, at most most_points
    integer, intent(in) :: n
    !> Points relative to the node, z >= 0, in longest edges
    real(wp), intent(in) :: x(n), y(n), z(n)
    !> Derivatives
    real(wp), intent(out) :: derivative(n, n_derivative)

    real(wp) :: radius(most_points), at(most_points, 4), far(most_points, n_derivative)
    integer :: order(most_points), some(most_points), i, k, m, highest

    do i = 1, n
      radius(i) = sqrt(x(i)**2 + y(i)**2 + z(i)**2)
      order(i) = order_needed(self, radius(i))
      if (order(i) == 0) derivative(i, :) = near_potentials(self%crease, x(i), y(i), z(i))
    end do
    highest = maxval(order(:n))
    if (highest > 0 .and. all(order(:n) == highest)) then
      call far_potentials(self, n, highest, x, y, z, radius(:n), derivative)
      return
    end if
    ! together only points of one order, so that no value depends on the other points
    do while (highest > 0)
      m = 0
      do i = 1, n
        if (order(i) /= highest) cycle
        m = m + 1
        some(m) = i
        at(m, :) = [x(i), y(i), z(i), radius(i)]
        order(i) = 0
      end do
      call far_potentials(self, m, highest, at(:m, 1), at(:m, 2), at(:m, 3), at(:m, 4), far(:m, :))
      do k = 1, n_derivative
        do i = 1, m
          derivative(some(i), k) = far(i, k)
        end do
      end do
      highest = maxval(order(:n))
    end do
  end subroutine potentials

  !> Sum the derivatives of the potentials of loaded nodes at a point, the nodes in the order of their distance: those far away
  !> need few moments.
  pure subroutine sum_over_nodes(self, x, y, z, load, sums)
    class(interior_pyramid_t), intent(in) :: self
    !> The point relative to the nodes and its depth, in longest edges
    real(wp), intent(in) :: x(:), y(:), z
    !> Loads (node, load)
    real(wp), intent(in) :: load(:, :)
    !> Sums (derivative, load)
    real(wp), intent(out) :: sums(:, :)

    real(wp) :: d(most_points, n_derivative), depth(most_points)
    integer, allocatable :: band(:), node(:)
    integer :: next(0:size(band_order) + 2), first, last, n, i

    allocate (band(size(x)), node(size(x)))
    next = 1
    do i = 1, size(x)
      band(i) = count(x(i)**2 + y(i)**2 + z**2 >= [far_radius, band_radius(:, self%bands)]**2)
      next(band(i) + 1:) = next(band(i) + 1:) + 1
    end do
    do i = 1, size(x)
      node(next(band(i))) = i
      next(band(i)) = next(band(i)) + 1
    end do
    sums = 0.0_wp
    depth = z
    do first = 1, size(node), most_points
      last = min(first + most_points - 1, size(node))
      n = last - first + 1
      associate (some => node(first:last))
        call self%potentials(n, x(some), y(some), depth(:n), d(:n, :))
        sums = sums + matmul(transpose(d(:n, :)), load(some, :))
      end associate
    end do
  end subroutine sum_over_nodes

  !> Compute displacement times the shear modulus, and stress, by unit peak tractions.
  subroutine fields(self, x, y, z, poisson_ratio, displacement, stress, error)
    class(interior_pyramid_t), intent(in) :: self
    !> Points relative to the node [m]
    real(wp), intent(in) :: x(:), y(:), z(:)
    real(wp), intent(in) :: poisson_ratio
    !> Direction x, y, z; load p, q_x, q_y; point [m]
    real(wp), intent(out) :: displacement(:, :, :)
    !> Component xx, yy, zz, xy, yz, xz; load; point
    real(wp), intent(out) :: stress(:, :, :)
    !> Allocated on failure: points above the surface or not finite, a Poisson's ratio outside (-1, 0.5]
    type(error_t), allocatable, intent(out) :: error

    real(wp) :: d(most_points, n_derivative), u(most_points, 3, 3), s(most_points, 6, 3)
    integer :: first, last, n, i

    call check_interior(x, y, z, poisson_ratio, error)
    if (allocated(error)) return
    !$omp parallel do schedule(dynamic) private(last, n, i, d, u, s) if (size(x) > 4*most_points)
    do first = 1, size(x), most_points
      last = min(first + most_points - 1, size(x))
      n = last - first + 1
      call self%potentials(n, x(first:last)/self%spacing, y(first:last)/self%spacing, z(first:last)/self%spacing, d(:n, :))
      call displacements(n, d(:n, :), d(:n, :), d(:n, :), z(first:last)/self%spacing, poisson_ratio, u(:n, :, :))
      call stresses(n, d(:n, :), d(:n, :), d(:n, :), poisson_ratio, s(:n, :, :))
      do i = 1, n
        displacement(:, :, first + i - 1) = self%spacing*u(i, :, :)
        stress(:, :, first + i - 1) = s(i, :, :)
      end do
    end do
    !$omp end parallel do
  end subroutine fields

  !> Return the order of the moments that suffices at a distance; 0: the point is too near for them.
  pure integer function order_needed(self, radius)
    type(interior_pyramid_t), intent(in) :: self
    !> Distance, in longest edges
    real(wp), intent(in) :: radius
    integer :: band

    order_needed = merge(max_order, 0, radius >= far_radius)
    do band = 1, size(band_order)
      if (radius >= band_radius(band, self%bands)) order_needed = band_order(band)
    end do
  end function order_needed

  !> Sum line integrals over the nine creases.
  pure function near_potentials(crease, x, y, z) result(d)
    type(crease_t), intent(in) :: crease(3)
    !> Point relative to the node, in longest edges
    real(wp), intent(in) :: x, y, z
    !> Derivatives
    real(wp) :: d(n_derivative)

    real(wp) :: t, n, s(8)
    integer :: q

    d = 0.0_wp
    do q = 1, 3
      associate (c => crease(q), a => crease(q)%normal, e => crease(q)%along)
        t = -(x*c%along(1) + y*c%along(2))
        n = x*c%normal(1) + y*c%normal(2)
        s = ((groups(n - c%height, t + c%skew, 0.5_wp*c%length, z) + groups(n + c%height, t - c%skew, 0.5_wp*c%length, z)) &
             - groups(n, t, c%length, z))/c%height
        associate (w_0 => s(1), q_0 => s(2), z_lambda => s(3), a_1 => s(4), z_beta => s(5), x_1 => s(6), &
                   z_log => s(7), log_less_r => s(8))
          d(psi) = d(psi) - w_0
          d(psi_z) = d(psi_z) - q_0
          d(z_psi_zz) = d(z_psi_zz) - z_lambda
          d(psi_x:psi_y) = d(psi_x:psi_y) + a*a_1
          d(z_psi_xz:z_psi_yz) = d(z_psi_xz:z_psi_yz) - a*z_beta
          d(z_psi_xx:z_psi_yy) = d(z_psi_xx:z_psi_yy) + twice(a)*z_lambda
          d(chi_x:chi_y) = d(chi_x:chi_y) + 0.5_wp*a*x_1
          d(chi_xx:chi_yy) = d(chi_xx:chi_yy) + twice(a)*q_0
          d(z_chi_xxx:z_chi_yyy) = d(z_chi_xxx:z_chi_yyy) + thrice(a, a*z_beta - e*z_log)
          d(omega_xx:omega_yy) = d(omega_xx:omega_yy) + twice(a)*w_0
          d(omega_xxx:omega_yyy) = d(omega_xxx:omega_yyy) - thrice(a, a*a_1 + e*log_less_r)
        end associate
      end associate
    end do
  end function near_potentials

  !> Compute the groups of integrals of a crease of which every potential is a sum.
  pure function groups(n, tm, half, z)
    !> Signed distance of the field point from the plane of the crease, its depth
    real(wp), intent(in) :: n, z
    !> Abscissa of the middle of the crease, and half its length
    real(wp), intent(in) :: tm, half
    real(wp) :: groups(8)

    associate (s => segment_integrals(n, tm - half, tm + half, 2.0_wp*half, z))
      groups = [s%w_0, s%q_0, z*s%lambda, s%a_1, z*s%beta, n*s%q_0 + z*s%a_1, z*s%d_log, z*s%d_log - s%d_r]
    end associate
  end function groups

  !> Compute a_a a_b for xx, xy, yy
  pure function twice(a)
    real(wp), intent(in) :: a(2)
    real(wp) :: twice(3)
    twice = [a(1)**2, a(1)*a(2), a(2)**2]
  end function twice

  !> Compute a_a a_b b_c for xxx, xxy, xyy, yyy; symmetric in the sum over the creases
  pure function thrice(a, b)
    real(wp), intent(in) :: a(2), b(2)
    real(wp) :: thrice(4)
    thrice = [a(1)**2*b(1), a(1)**2*b(2), a(2)**2*b(1), a(2)**2*b(2)]
  end function thrice

  !> Sum the moment series.
  pure subroutine far_potentials(self, n, order, x, y, z, radius, d)
    type(interior_pyramid_t), intent(in) :: self
    !> Number of points, highest order of the moments
    integer, intent(in) :: n, order
    !> Points relative to the node and their distance from it, in longest edges
    real(wp), intent(in) :: x(n), y(n), z(n), radius(n)
    !> Derivatives
    real(wp), intent(out) :: d(n, n_derivative)

    !> Powers of w; sums by degree, real and imaginary parts of their factor; derivatives S(degree, order)
    real(wp) :: power(most_points, 2, 0:max_harmonic)
    real(wp) :: re(most_points, 0:2, 0:3), im(most_points, 0:2, 0:3), radial(most_points, 0:2, 2)
    real(wp) :: scale(most_points), factor(most_points)
    type(far_points_t) :: points
    integer :: m, k, p, l, harmonic
    logical :: complex_moments

    scale(:n) = 1.0_wp/radius
    points%n = n
    points%order = order
    points%c(:n) = z*scale(:n)
    power(:n, 1, 0) = 1.0_wp
    power(:n, 2, 0) = 0.0_wp
    power(:n, 1, 1) = x*scale(:n)
    power(:n, 2, 1) = -y*scale(:n)
    do p = 2, max(3, 3 + order/self%fold*self%fold)
      power(:n, 1, p) = power(:n, 1, p - 1)*power(:n, 1, 1) - power(:n, 2, p - 1)*power(:n, 2, 1)
      power(:n, 2, p) = power(:n, 1, p - 1)*power(:n, 2, 1) + power(:n, 2, p - 1)*power(:n, 1, 1)
    end do
    points%inverse(:n, 0) = 1.0_wp
    points%inverse(:n, 1) = 0.25_wp*scale(:n)**2
    do p = 2, order/2
      points%inverse(:n, p) = points%inverse(:n, p - 1)*points%inverse(:n, 1)
    end do

    re = 0.0_wp
    im = 0.0_wp
    do m = 0, 3
      do k = merge(0, -order/self%fold*self%fold, m == 0), order, self%fold
        associate (moment => self%moment(abs(k):order:2, k, m))
          complex_moments = any(abs(aimag(moment)) > 1.0e-14_wp*abs(real(moment, wp)))
          call radial_sums(points, m, k, moment, complex_moments, radial)
        end associate
        harmonic = abs(m + k)
        do l = merge(1, 0, m == 3), 2
          associate (u => power(:n, 1, harmonic), g => radial(:n, l, 1), h => radial(:n, l, 2), &
                     v => power(:n, 2, harmonic)*merge(1.0_wp, -1.0_wp, m + k >= 0))
            re(:n, l, m) = re(:n, l, m) + u*g
            im(:n, l, m) = im(:n, l, m) + v*g
            if (complex_moments) then
              re(:n, l, m) = re(:n, l, m) - v*h
              im(:n, l, m) = im(:n, l, m) + u*h
            end if
          end associate
        end do
      end do
    end do
    factor(:n) = self%volume*scale(:n)
    do l = 0, 2
      do m = 0, 3
        re(:n, l, m) = 0.5_wp**m*factor(:n)*re(:n, l, m)
        im(:n, l, m) = 0.5_wp**m*factor(:n)*im(:n, l, m)
      end do
      factor(:n) = -factor(:n)*scale(:n)
    end do
    call sum_derivatives(n, z, re, im, d)
  end subroutine far_potentials

  !> Combine the derivatives S(degree, order) to those of the potentials.
  pure subroutine sum_derivatives(n, z, re, im, d)
    !> Number of points
    integer, intent(in) :: n
    !> Their depth, in longest edges
    real(wp), intent(in) :: z(n)
    !> Real and imaginary parts of S(degree, order)
    real(wp), intent(in) :: re(most_points, 0:2, 0:3), im(most_points, 0:2, 0:3)
    !> Derivatives
    real(wp), intent(out) :: d(n, n_derivative)

    d(:, psi) = re(:n, 0, 0)
    d(:, psi_z) = re(:n, 1, 0)
    d(:, z_psi_zz) = z*re(:n, 2, 0)
    d(:, psi_x) = 2.0_wp*re(:n, 1, 1)
    d(:, psi_y) = -2.0_wp*im(:n, 1, 1)
    d(:, z_psi_xz) = 2.0_wp*z*re(:n, 2, 1)
    d(:, z_psi_yz) = -2.0_wp*z*im(:n, 2, 1)
    d(:, z_psi_xx) = z*(2.0_wp*re(:n, 2, 2) - 0.5_wp*re(:n, 2, 0))
    d(:, z_psi_xy) = -2.0_wp*z*im(:n, 2, 2)
    d(:, z_psi_yy) = -z*(2.0_wp*re(:n, 2, 2) + 0.5_wp*re(:n, 2, 0))
    d(:, chi_x) = 2.0_wp*re(:n, 0, 1)
    d(:, chi_y) = -2.0_wp*im(:n, 0, 1)
    d(:, chi_xx) = 2.0_wp*re(:n, 1, 2) - 0.5_wp*re(:n, 1, 0)
    d(:, chi_xy) = -2.0_wp*im(:n, 1, 2)
    d(:, chi_yy) = -2.0_wp*re(:n, 1, 2) - 0.5_wp*re(:n, 1, 0)
    d(:, z_chi_xxx) = z*(2.0_wp*re(:n, 2, 3) - 1.5_wp*re(:n, 2, 1))
    d(:, z_chi_xxy) = z*(0.5_wp*im(:n, 2, 1) - 2.0_wp*im(:n, 2, 3))
    d(:, z_chi_xyy) = -z*(2.0_wp*re(:n, 2, 3) + 0.5_wp*re(:n, 2, 1))
    d(:, z_chi_yyy) = z*(2.0_wp*im(:n, 2, 3) + 1.5_wp*im(:n, 2, 1))
    d(:, omega_xx) = 2.0_wp*re(:n, 0, 2) - 0.5_wp*re(:n, 0, 0)
    d(:, omega_xy) = -2.0_wp*im(:n, 0, 2)
    d(:, omega_yy) = -2.0_wp*re(:n, 0, 2) - 0.5_wp*re(:n, 0, 0)
    d(:, omega_xxx) = 2.0_wp*re(:n, 1, 3) - 1.5_wp*re(:n, 1, 1)
    d(:, omega_xxy) = 0.5_wp*im(:n, 1, 1) - 2.0_wp*im(:n, 1, 3)
    d(:, omega_xyy) = -2.0_wp*re(:n, 1, 3) - 0.5_wp*re(:n, 1, 1)
    d(:, omega_yyy) = 2.0_wp*im(:n, 1, 3) + 1.5_wp*im(:n, 1, 1)
  end subroutine sum_derivatives

  !> Sum the moments of one harmonic: moment/(2R)^N H(l + N, |m + k|) over sin^|m + k|, for l = 0, 1, 2.
  pure subroutine radial_sums(points, m, k, moment, complex_moments, radial)
    !> The points
    type(far_points_t), intent(in) :: points
    !> Order of the derivative, harmonic of the moments
    integer, intent(in) :: m, k
    !> Moments of the orders |k|, |k| + 2, ...
    complex(wp), intent(in) :: moment(0:)
    !> Have they imaginary parts?
    logical, intent(in) :: complex_moments
    !> Sums by degree, for the real and the imaginary parts
    real(wp), intent(out) :: radial(most_points, 0:2, 2)

    real(wp) :: h(most_points), before(most_points), next(most_points)
    integer :: degree, harmonic, l, i, order_now

    associate (n => points%n, order => points%order, c => points%c, inverse => points%inverse)
      harmonic = abs(m + k)
      radial(:n, :, :) = 0.0_wp
      ! degrees below the harmonic occur for k >= 0 only
      do degree = merge(harmonic - min(m, 2), harmonic, k >= 0), order + 2
        if (degree < harmonic) then
          if (degree == harmonic - 2 .or. m == 1) before(:n) = first_below(harmonic, c(:n))
          h(:n) = before(:n)
          if (degree == harmonic - 2) h(:n) = odd_factorial(harmonic)/(2*harmonic - 1) - c(:n)*before(:n)
        else if (degree == harmonic) then
          h(:n) = odd_factorial(harmonic)
          before(:n) = 0.0_wp
        else
          next(:n) = (2*degree - 1)*c(:n)*h(:n) - real((degree - 1 - harmonic)*(degree - 1 + harmonic), wp)*before(:n)
          before(:n) = h(:n)
          h(:n) = next(:n)
        end if
        do l = 0, 2
          order_now = degree - l
          if (order_now < abs(k) .or. order_now > order .or. modulo(order_now, 2) /= 0) cycle
          i = (order_now - abs(k))/2
          radial(:n, l, 1) = radial(:n, l, 1) + real(moment(i), wp)*inverse(:n, order_now/2)*h(:n)
          if (complex_moments) radial(:n, l, 2) = radial(:n, l, 2) + aimag(moment(i))*inverse(:n, order_now/2)*h(:n)
        end do
      end do
    end associate
  end subroutine radial_sums

  !> Compute H(m - 1, m) over sin^m: all terms are positive.
  pure function first_below(m, c) result(h)
    !> Order
    integer, intent(in) :: m
    !> Cosine of the angle from the axis
    real(wp), intent(in) :: c(:)
    real(wp) :: h(size(c))

    real(wp) :: coefficient(0:max_harmonic), ratio(size(c))
    integer :: k

    ! (2m-1)!/m! C(m-1, k) k! m!/(m+k)!
    coefficient(0) = 1.0_wp
    do k = m + 1, 2*m - 1
      coefficient(0) = coefficient(0)*k
    end do
    do k = 1, m - 1
      coefficient(k) = coefficient(k - 1)*(m - k)/(m + k)
    end do
    ratio = (1.0_wp - c)/(1.0_wp + c)
    h = coefficient(m - 1)
    do k = m - 2, 0, -1
      h = coefficient(k) + h*ratio
    end do
    h = h*0.5_wp**(m - 1)/(1.0_wp + c)
  end function first_below

  !> Compute 1*3*...*(2m - 1)
  elemental real(wp) function odd_factorial(m)
    integer, intent(in) :: m
    integer :: k

    odd_factorial = 1.0_wp
    do k = 3, 2*m - 1, 2
      odd_factorial = odd_factorial*k
    end do
  end function odd_factorial

end module hc_interior_pyramid
