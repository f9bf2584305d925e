!> Influence functions of one pyramid of traction on the surface of a half-space.
!>
!> The pyramid h is the piecewise linear hat of a lattice node: one at the node,
!> zero at its six neighbors. With rho the distance to the field point (x, y),
!> five kernels give every displacement of both bodies (Table 8.1):
!>
!>     K1  = iint h/rho                    K_x  = iint h (x - xi)/rho^2
!>     K_xx = iint h (x - xi)^2/rho^3      K_y  = iint h (y - eta)/rho^2
!>     K_xy = iint h (x - xi)(y - eta)/rho^3
!>
!> K1, K_xx, K_xy are even, K_x, K_y odd; K_yy = K1 - K_xx.
!>
!> Near the pyramid: integration by parts turns the double integrals into line
!> integrals of rho and ln rho over the nine segments in which h has a crease
!> (three spokes of double length, six rims). Far away: the hat is the
!> probability density of z = sum_q U_q d_q with U_q uniform on (-1/2, 1/2) and
!> d_q the three edge directions, so that its moments are coefficients of
!> product_q sinh(w_q/2)/(w_q/2), w_q = s d_q + t conj(d_q), and the kernels are
!> power series in 1/z (hc_hat). Both are valid for any lattice; lengths are in units of the
!> longest edge inside this module.
!>
!> Equations: docs/theory/elasticity.md, (E5) to (E13).
module hc_pyramid_influence
  use hc_precision, only: wp
  use hc_segment_integrals, only: segment_integrals
  use hc_hat, only: crease_t, hat_creases, hat_moments, binomial_series, max_order
  implicit none
  private

  public :: pyramid_t, new_pyramid, equivalent_spacing
  public :: k_1, k_xx, k_xy, k_x, k_y

  !> Positions of the five kernels in a vector.
  integer, parameter :: k_1 = 1, k_xx = 2, k_xy = 3, k_x = 4, k_y = 5

  !> Distance from which the moment expansion is used, in longest edges.
  real(wp), parameter :: far_radius = 3.0_wp
  !> Number of powers of 1/R^2 in the series.
  integer, parameter :: max_power = max_order/2
  !> Beyond band_radius(k) the orders up to 2*band_power(k) suffice (truncation < 3e-16 K1).
  real(wp), parameter :: band_radius(5) = [5.0_wp, 8.0_wp, 20.0_wp, 60.0_wp, 300.0_wp]
  integer, parameter :: band_power(5) = [8, 6, 4, 3, 2]

  !> The pyramid of a lattice: creases and moments, ready for evaluation.
  type :: pyramid_t
    private
    !> Longest edge [m]
    real(wp), public :: spacing = 1.0_wp
    type(crease_t) :: crease(3)
    !> Volume of the pyramid of unit height
    real(wp) :: volume = 0.0_wp
    !> Angular step: harmonics are multiples of it (6 if the lattice is equilateral, else 2)
    integer :: fold = 2
    !> Largest harmonic over fold
    integer :: n_harmonic = 0
    !> Series of K1: power of 1/R^2, harmonic 0...
    complex(wp), allocatable :: even(:, :)
    !> Series of K_xx - K_yy + 2 i K_xy: power of 1/R^2, harmonic of either sign
    complex(wp), allocatable :: quadrupole(:, :)
    !> Series of K_x - i K_y: power of Z^-fold
    complex(wp), allocatable :: odd(:)
  contains
    !> The five kernels at one point [m]
    procedure :: kernels
    !> K1 alone [m]
    procedure :: normal_kernel
    !> Is the lattice equilateral?
    procedure :: is_equilateral
  end type pyramid_t

contains

  !> Set up creases and moments of the pyramid of a lattice.
  pure subroutine new_pyramid(pyramid, basis)
    !> Pyramid to be set up
    type(pyramid_t), intent(out) :: pyramid
    !> Basis vectors of the lattice as columns [m]
    real(wp), intent(in) :: basis(2, 2)

    real(wp) :: edges(2, 3)

    call hat_creases(basis, pyramid%crease, edges, pyramid%spacing, pyramid%volume)
    call expand(pyramid, cmplx(edges(1, :), edges(2, :), wp))
  end subroutine new_pyramid

  !> Compute the spacing of the equilateral lattice whose pyramid has the same K1 at its apex.
  pure real(wp) function equivalent_spacing(basis) result(spacing)
    !> Basis vectors of the lattice as columns [m]
    real(wp), intent(in) :: basis(2, 2)
    type(pyramid_t) :: pyramid

    call new_pyramid(pyramid, basis)
    spacing = pyramid%spacing
    if (.not. pyramid%is_equilateral()) spacing = pyramid%normal_kernel(0.0_wp, 0.0_wp)/(1.5_wp*sqrt(3.0_wp)*log(3.0_wp))
  end function equivalent_spacing

  !> Compute the five kernels at a point relative to the node.
  pure function kernels(self, x, y) result(k)
    class(pyramid_t), intent(in) :: self
    !> Field point relative to the node [m]
    real(wp), intent(in) :: x, y
    !> K1, K_xx, K_xy, K_x, K_y [m]
    real(wp) :: k(5)
    real(wp) :: xs, ys

    xs = x/self%spacing
    ys = y/self%spacing
    if (xs*xs + ys*ys < far_radius**2) then
      k = self%spacing*near_kernels(self, xs, ys)
    else
      k = self%spacing*far_kernels(self, xs, ys)
    end if
  end function kernels

  !> Compute K1 at a point relative to the node [m].
  pure real(wp) function normal_kernel(self, x, y) result(k)
    class(pyramid_t), intent(in) :: self
    !> Field point relative to the node [m]
    real(wp), intent(in) :: x, y
    real(wp) :: xs, ys, all_kernels(5)

    xs = x/self%spacing
    ys = y/self%spacing
    if (xs*xs + ys*ys < far_radius**2) then
      all_kernels = near_kernels(self, xs, ys)
      k = self%spacing*all_kernels(k_1)
    else
      k = self%spacing*far_normal_kernel(self, xs, ys)
    end if
  end function normal_kernel

  !> Return whether the edges have one length: then the kernels have the symmetries of a hexagon.
  pure logical function is_equilateral(self)
    class(pyramid_t), intent(in) :: self
    is_equilateral = self%fold == 6
  end function is_equilateral

  !> Sum line integrals over the nine creases; exact everywhere, loses digits like R^2.
  pure function near_kernels(self, x, y) result(k)
    class(pyramid_t), intent(in) :: self
    !> Field point relative to the node, in longest edges
    real(wp), intent(in) :: x, y
    !> K1, K_xx, K_xy, K_x, K_y over the longest edge
    real(wp) :: k(5)

    real(wp) :: t, n, sums(2)
    integer :: q

    k = 0.0_wp
    do q = 1, 3
      associate (crease => self%crease(q))
        t = -(x*crease%along(1) + y*crease%along(2))
        n = x*crease%normal(1) + y*crease%normal(2)
        sums = ((on_segment(n - crease%height, t + crease%skew, 0.5_wp*crease%length) &
                 + on_segment(n + crease%height, t - crease%skew, 0.5_wp*crease%length)) &
                - on_segment(n, t, crease%length))/crease%height
        k(k_1) = k(k_1) + sums(1)
        k(k_xx) = k(k_xx) + crease%normal(2)**2*sums(1)
        k(k_xy) = k(k_xy) - crease%normal(1)*crease%normal(2)*sums(1)
        k(k_x:k_y) = k(k_x:k_y) + 0.5_wp*crease%normal*sums(2)
      end associate
    end do
  end function near_kernels

  !> Integrate rho and n*ln(rho) along a straight segment; the constant -length*n of the second is left out, it adds up to zero
  !> over a crease family.
  pure function on_segment(n, tm, half)
    !> Signed distance of the field point from the line
    real(wp), intent(in) :: n
    !> Abscissa of the middle of the segment, from the foot of the point
    real(wp), intent(in) :: tm
    !> Half its length
    real(wp), intent(in) :: half
    real(wp) :: on_segment(2)

    associate (s => segment_integrals(n, tm - half, tm + half, 2.0_wp*half, 0.0_wp))
      on_segment = [-s%w_0, n*s%q_0]
    end associate
  end function on_segment

  !> Sum the moment series.
  pure function far_kernels(self, x, y) result(k)
    class(pyramid_t), intent(in) :: self
    !> Field point relative to the node, in longest edges
    real(wp), intent(in) :: x, y
    !> K1, K_xx, K_xy, K_x, K_y over the longest edge
    real(wp) :: k(5)

    complex(wp) :: u, turn, turns, k2, k1, kc, inverse
    real(wp) :: r, q
    integer :: power, harmonic

    r = sqrt(x*x + y*y)
    u = cmplx(x/r, -y/r, wp)            ! conjugate direction, exp(-i theta)
    q = 1.0_wp/r
    q = q*q
    power = powers_needed(r)

    turn = u*u
    if (self%fold == 6) turn = turn*turn*turn
    k1 = horner(self%even(:power, 0), q)
    k2 = horner(self%quadrupole(:power, 0), q)
    turns = 1.0_wp
    do harmonic = 1, 2*power/self%fold
      turns = turns*turn
      k1 = k1 + turns*horner(self%even(:power, harmonic), q)
      k2 = k2 + turns*horner(self%quadrupole(:power, harmonic), q) &
           + conjg(turns)*horner(self%quadrupole(:power, -harmonic), q)
    end do
    k2 = conjg(u)**2*k2

    inverse = turn*q**(self%fold/2)
    kc = 0.0_wp
    do harmonic = 2*power/self%fold, 0, -1
      kc = self%odd(harmonic) + inverse*kc
    end do
    kc = u*kc

    k = self%volume/r*[real(k1, wp), 0.5_wp*real(k1 + k2, wp), 0.5_wp*aimag(k2), real(kc, wp), -aimag(kc)]
  end function far_kernels

  !> Sum the moment series of K1.
  pure real(wp) function far_normal_kernel(self, x, y) result(k)
    class(pyramid_t), intent(in) :: self
    !> Field point relative to the node, in longest edges
    real(wp), intent(in) :: x, y
    complex(wp) :: turn, turns
    real(wp) :: r, q
    integer :: power, harmonic

    r = sqrt(x*x + y*y)
    q = 1.0_wp/r
    turn = cmplx(x*q, -y*q, wp)**2
    q = q*q
    power = powers_needed(r)
    if (self%fold == 6) turn = turn*turn*turn
    k = real(horner(self%even(:power, 0), q), wp)
    turns = 1.0_wp
    do harmonic = 1, 2*power/self%fold
      turns = turns*turn
      k = k + real(turns*horner(self%even(:power, harmonic), q), wp)
    end do
    k = self%volume/r*k
  end function far_normal_kernel

  !> Return the powers of 1/R^2 that suffice at a distance.
  pure integer function powers_needed(r)
    !> Distance, in longest edges
    real(wp), intent(in) :: r
    integer :: band

    powers_needed = max_power
    do band = 1, size(band_radius)
      if (r >= band_radius(band)) powers_needed = band_power(band)
    end do
  end function powers_needed

  !> Evaluate a polynomial with complex coefficients at a real argument, smallest terms first.
  pure complex(wp) function horner(coefficient, q)
    !> Coefficients of q**0, q**1, ...
    complex(wp), intent(in) :: coefficient(0:)
    !> Argument
    real(wp), intent(in) :: q
    integer :: i

    horner = coefficient(ubound(coefficient, 1))
    do i = ubound(coefficient, 1) - 1, 0, -1
      horner = coefficient(i) + q*horner
    end do
  end function horner

  !> Expand the moment series from the three edge directions.
  pure subroutine expand(pyramid, edge)
    !> Pyramid whose series are set up
    type(pyramid_t), intent(inout) :: pyramid
    !> Edge directions in the complex plane, in longest edges
    complex(wp), intent(in) :: edge(3)

    complex(wp) :: moment(0:max_order, 0:max_order)
    real(wp), dimension(0:max_order) :: inverse_root, root, inverse_cube
    integer :: a, b, harmonic, power

    moment = hat_moments(edge)
    pyramid%fold = 6
    do b = 0, 4
      do a = 0, 4
        if (modulo(a - b, 6) /= 0 .and. abs(moment(a, b)) > 1.0e-14_wp) pyramid%fold = 2
      end do
    end do
    pyramid%n_harmonic = max_order/pyramid%fold

    inverse_root = binomial_series(-0.5_wp)
    root = binomial_series(0.5_wp)
    inverse_cube = binomial_series(-1.5_wp)
    allocate (pyramid%even(0:max_power, 0:pyramid%n_harmonic), source=(0.0_wp, 0.0_wp))
    allocate (pyramid%quadrupole(0:max_power, -pyramid%n_harmonic:pyramid%n_harmonic), source=(0.0_wp, 0.0_wp))
    allocate (pyramid%odd(0:pyramid%n_harmonic), source=(0.0_wp, 0.0_wp))
    do harmonic = -pyramid%n_harmonic, pyramid%n_harmonic
      do power = 0, max_power
        a = power + pyramid%fold*harmonic/2
        b = power - pyramid%fold*harmonic/2
        if (a < 0 .or. b < 0) cycle
        pyramid%quadrupole(power, harmonic) = root(a)*inverse_cube(b)*moment(a, b)
        if (harmonic == 0) pyramid%even(power, 0) = inverse_root(a)*inverse_root(b)*moment(a, b)
        ! the terms of opposite harmonics are conjugate
        if (harmonic > 0) pyramid%even(power, harmonic) = 2.0_wp*inverse_root(a)*inverse_root(b)*moment(a, b)
      end do
      if (harmonic >= 0) pyramid%odd(harmonic) = moment(pyramid%fold*harmonic, 0)
    end do
  end subroutine expand

end module hc_pyramid_influence
