!> The hat of a lattice node: where its slope jumps, and its moments.
!>
!> Creases: for each of the three edge directions there are a spoke of double length through the node, with the jump -1/height,
!> and two rims parallel to it, with the jump +1/height. Lengths are in units of the longest edge.
!>
!> Moments: the hat is the probability density of z = sum_q U_q d_q with U_q uniform on (-1/2, 1/2) and d_q the three edge
!> directions: its moments are coefficients of product_q sinh(w_q/2)/(w_q/2), w_q = s d_q + t conj(d_q).
!>
!> Equations: docs/theory/elasticity.md, (E5) to (E13).
module hc_hat
  use hc_precision, only: wp
  use hc_lattice, only: edge_directions
  implicit none
  private

  public :: crease_t, hat_creases, hat_moments, binomial_series

  !> Highest order of the moments.
  integer, parameter, public :: max_order = 24

  !> One family of parallel creases: a spoke through the node and two rims.
  type :: crease_t
    !> Unit direction and unit normal
    real(wp) :: along(2) = 0.0_wp, normal(2) = 0.0_wp
    !> Length of a rim; the spoke is twice as long
    real(wp) :: length = 0.0_wp
    !> Distance of the rims from the node
    real(wp) :: height = 0.0_wp
    !> Abscissa of the center of the rim on the side of the normal
    real(wp) :: skew = 0.0_wp
  end type crease_t

contains

  !> Return the three families of creases.
  pure subroutine hat_creases(basis, crease, edges, spacing, volume)
    !> Basis vectors of the lattice as columns [m]
    real(wp), intent(in) :: basis(2, 2)
    type(crease_t), intent(out) :: crease(3)
    !> Edge directions over the longest edge, as columns
    real(wp), intent(out) :: edges(2, 3)
    !> Longest edge [m]
    real(wp), intent(out) :: spacing
    !> Volume of the hat of unit height, over the longest edge squared
    real(wp), intent(out) :: volume

    real(wp) :: rim(2, 3)
    integer :: q

    edges = edge_directions(basis)
    spacing = maxval(norm2(edges, dim=1))
    edges = edges/spacing
    volume = edges(1, 1)*edges(2, 2) - edges(2, 1)*edges(1, 2)
    ! centers of the rims on the side to which the normals point
    rim(:, 1) = edges(:, 2) - 0.5_wp*edges(:, 1)
    rim(:, 2) = 0.5_wp*edges(:, 2) - edges(:, 1)
    rim(:, 3) = -0.5_wp*(edges(:, 1) + edges(:, 2))
    do q = 1, 3
      crease(q)%length = norm2(edges(:, q))
      crease(q)%along = edges(:, q)/crease(q)%length
      crease(q)%normal = [-crease(q)%along(2), crease(q)%along(1)]
      crease(q)%height = volume/crease(q)%length
      crease(q)%skew = dot_product(rim(:, q), crease(q)%along)
      ! a rim is centered on its spoke exactly where the lattice is equilateral
      if (abs(crease(q)%skew) < 4.0_wp*epsilon(1.0_wp)) crease(q)%skew = 0.0_wp
    end do
  end subroutine hat_creases

  !> Compute E[z**a conj(z)**b] for z distributed like the hat, a + b <= max_order.
  pure function hat_moments(edge) result(moment)
    !> Edge directions in the complex plane
    complex(wp), intent(in) :: edge(3)
    complex(wp) :: moment(0:max_order, 0:max_order)

    complex(wp), dimension(0:max_order, 0:max_order) :: series, factor, product
    real(wp) :: scale
    integer :: q, m, p, a, b, i, j

    do q = 1, 3
      ! sinh(w/2)/(w/2) = sum_m w**(2m)/(4**m (2m+1)!), w = s*edge + t*conj(edge)
      factor = 0.0_wp
      scale = 1.0_wp
      do m = 0, max_order/2
        if (m > 0) scale = scale/(4.0_wp*(2*m)*(2*m + 1))
        do p = 0, 2*m
          factor(p, 2*m - p) = scale*binomial(2*m, p)*edge(q)**p*conjg(edge(q))**(2*m - p)
        end do
      end do
      if (q == 1) then
        series = factor
        cycle
      end if
      product = 0.0_wp
      do b = 0, max_order
        do a = modulo(b, 2), max_order - b, 2  ! odd orders vanish, here and in both factors
          do j = 0, b
            do i = modulo(j, 2), a, 2
              product(a, b) = product(a, b) + series(i, j)*factor(a - i, b - j)
            end do
          end do
        end do
      end do
      series = product
    end do
    moment = 0.0_wp
    do b = 0, max_order
      do a = 0, max_order - b
        moment(a, b) = series(a, b)*gamma(real(a + 1, wp))*gamma(real(b + 1, wp))
      end do
    end do
  end function hat_moments

  !> Compute Taylor coefficients of (1 - u)**exponent.
  pure function binomial_series(exponent) result(c)
    !> Exponent
    real(wp), intent(in) :: exponent
    real(wp) :: c(0:max_order)
    integer :: n

    c(0) = 1.0_wp
    do n = 1, max_order
      c(n) = c(n - 1)*(n - 1 - exponent)/n
    end do
  end function binomial_series

  !> Compute the binomial coefficient.
  pure real(wp) function binomial(n, k)
    !> Upper and lower argument
    integer, intent(in) :: n, k
    integer :: i

    binomial = 1.0_wp
    do i = 1, k
      binomial = binomial*(n - k + i)/i
    end do
  end function binomial

end module hc_hat
