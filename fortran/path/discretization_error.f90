!> How far values on the finest of several lattices are from their limit for a vanishing spacing.
!>
!> The difference of a solution and the limit has two parts: a trend, c h^p with an order p from 1 (areas of whole cells)
!> to 2 (approach, loads, energies), and a scatter, since the contact lies differently on every lattice. Both follow from
!> a least-squares fit of q + c h^p, each value weighted by 1/h, as a scatter in proportion to h asks for. It follows Eca
!> and Hoekstra, Journal of Computational Physics 262 (2014) 104-130; factors and numbers here are those with which errors
!> known from closed solutions stay within the estimate.
!>
!> Equations: docs/theory/error_bars.md, (A1), (A2).
module hc_discretization_error
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_quiet_nan, ieee_value
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  implicit none
  private

  public :: limits_of_error

  !> Orders of the trend that are tried.
  real(wp), parameter :: orders(3) = [1.0_wp, 1.5_wp, 2.0_wp]
  !> Factor on the trend.
  real(wp), parameter :: safety = 1.25_wp
  !> Standard errors of the limit that the fit finds.
  real(wp), parameter :: deviations = 2.0_wp
  !> Orders whose residual is at most this multiple of the least one are all possible.
  real(wp), parameter :: alike = 1.5_wp
  !> Unknowns of a fit, and least number of lattices.
  integer, parameter :: n_unknown = 2, least_lattices = 4

contains

  !> Estimate how far values on the first, finest lattice are from their limit.
  pure subroutine limits_of_error(spacings, values, errors, error)
    !> Spacings, in units of the first
    real(wp), intent(in) :: spacings(:)
    !> Quantities on each of the lattices (lattice, quantity)
    real(wp), intent(in) :: values(:, :)
    !> What hardly any error exceeds; NaN where a value is not finite
    real(wp), intent(out) :: errors(:)
    !> Allocated if there are fewer than four lattices
    type(error_t), allocatable, intent(out) :: error
    character(len=12) :: found
    real(wp) :: scale, scatter(size(orders)), width(size(orders))
    integer :: k, m

    errors = ieee_value(1.0_wp, ieee_quiet_nan)
    if (size(spacings) < least_lattices) then
      write (found, '(i0)') size(spacings)
      call raise(error, status%invalid_input, 'expected solutions on four lattices at least, not '//trim(found))
      return
    end if
    do m = 1, size(errors)
      if (.not. all(ieee_is_finite(values(:, m)))) cycle
      scale = maxval(abs(values(:, m)))
      if (scale <= 0.0_wp) scale = 1.0_wp
      do k = 1, size(orders)
        call fit(spacings, values(:, m)/scale, orders(k), scatter(k), width(k))
      end do
      errors(m) = scale*maxval(width, mask=scatter <= alike*minval(scatter))
    end do
  end subroutine limits_of_error

  !> Fit q + c h^p to values, weighted by 1/h.
  pure subroutine fit(h, values, order, scatter, width)
    !> Spacings
    real(wp), intent(in) :: h(:)
    !> Values
    real(wp), intent(in) :: values(:)
    !> p
    real(wp), intent(in) :: order
    !> Standard deviation of the weighted values from the fit
    real(wp), intent(out) :: scatter
    !> Bound on the error of the first value: trend and standard errors of q
    real(wp), intent(out) :: width
    real(wp) :: trend(size(h)), weight(size(h)), limit, factor, limit_variance

    ! the normal equations, in terms of deviations from the weighted means
    weight = 1.0_wp/h**2
    associate (total => sum(weight), mean => sum(weight*h**order)/sum(weight), middle => sum(weight*values)/sum(weight))
      trend = h**order - mean
      factor = sum(weight*trend*(values - middle))/sum(weight*trend**2)
      limit = middle - factor*mean
      limit_variance = 1.0_wp/total + mean**2/sum(weight*trend**2)
      scatter = sqrt(sum(weight*(values - middle - factor*trend)**2)/(size(h) - n_unknown))
    end associate
    width = safety*abs(values(1) - limit) + deviations*sqrt(limit_variance)*scatter
  end subroutine fit

end module hc_discretization_error
