!> Moments of the hat of a lattice node, and the binomial series with which kernels are expanded in them.
!>
!> The hat is the probability density of z = sum_q U_q d_q with U_q uniform on (-1/2, 1/2) and d_q the three edge
!> directions: its moments are coefficients of product_q sinh(w_q/2)/(w_q/2), w_q = s d_q + t conj(d_q).
!>
!> Equations: docs/theory/elasticity.md, (E5) to (E13).
module hc_hat_moments
  use hc_precision, only: wp
  implicit none
  private

  public :: hat_moments, binomial_series

  !> Highest order of the moments.
  integer, parameter, public :: max_order = 24

contains

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

end module hc_hat_moments
