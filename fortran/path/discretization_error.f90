!> Distance of values on the finest of several lattices from their limit for a vanishing spacing.
!>
!> The difference of a solution and the limit has two parts: a trend, c h^p with an order p from 1 (areas of whole cells)
!> to 2 (approach, loads, energies), and a scatter, since the contact lies differently on every lattice. Both follow from
!> a least-squares fit of q + c h^p, each value weighted by 1/h, since the scatter is in proportion to h (L. Eca
!> and M. Hoekstra, Journal of Computational Physics 262 (2014) 104-130); factors and numbers are those of `accuracy_options_t`.
!>
!> A slip zone narrower than the lattice resolves has a maximum of the shear traction at its inner edge that no lattice
!> resolves. Quantities that depend on it have a slower trend, (A3).
!>
!> Equations: docs/theory/error_bars.md, (A1) to (A3).
module hc_discretization_error
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_quiet_nan, ieee_value
  use hc_precision, only: wp, pi
  use hc_options, only: accuracy_options_t
  use hc_error, only: error_t, status, raise
  implicit none
  private

  public :: limits_of_error, is_slip_zone_unresolved

  !> Unknowns of a fit.
  integer, parameter :: n_unknown = 2

contains

  !> Estimate how far values on the first, finest lattice are from their limit.
  pure subroutine limits_of_error(spacings, values, errors, error, rough, unresolved)
    !> Spacings, in units of the first
    real(wp), intent(in) :: spacings(:)
    !> Quantities on each of the lattices (lattice, quantity)
    real(wp), intent(in) :: values(:, :)
    !> Bound that hardly any error exceeds; NaN where a value is not finite
    real(wp), intent(out) :: errors(:)
    !> Allocated if there are fewer than four lattices
    type(error_t), allocatable, intent(out) :: error
    !> Quantities that a few nodes decide, at the edge of a zone, where fields change like the square root of the distance
    logical, intent(in), optional :: rough(:)
    !> Quantities that depend on a slip zone narrower than the lattice resolves, (A3)
    logical, intent(in), optional :: unresolved(:)
    type(accuracy_options_t) :: tuning
    character(len=12) :: found
    real(wp) :: scale, scatter(size(tuning%orders)), width(size(tuning%orders)), any_scatter, wide, slow
    logical :: uneven, narrow
    integer :: k, m

    errors = ieee_value(1.0_wp, ieee_quiet_nan)
    if (size(spacings) < tuning%least_lattices) then
      write (found, '(i0)') size(spacings)
      call raise(error, status%invalid_input, 'expected solutions on four lattices at least, not '//trim(found))
      return
    end if
    do m = 1, size(errors)
      if (.not. all(ieee_is_finite(values(:, m)))) cycle
      scale = maxval(abs(values(:, m)))
      if (scale <= 0.0_wp) scale = 1.0_wp
      do k = 1, size(tuning%orders)
        call fit(spacings, values(:, m)/scale, tuning%orders(k), tuning, scatter(k), width(k))
      end do
      uneven = .false.
      if (present(rough)) uneven = rough(m)
      narrow = .false.
      if (present(unresolved)) narrow = unresolved(m)
      wide = 0.0_wp
      if (uneven .or. narrow) then
        slow = merge(tuning%unresolved_order, tuning%rough_order, uneven .and. narrow)
        call fit(spacings, values(:, m)/scale, slow, tuning, any_scatter, wide)
      end if
      errors(m) = scale*max(wide, maxval(width, mask=scatter <= tuning%possible_residual*minval(scatter)))
    end do
  end subroutine limits_of_error

  !> Return whether a slip zone beside a stick zone is narrower than the lattice resolves, (A3).
  !>
  !> Without shear tractions, as of similar bodies under a normal load, nothing slips and there is no such zone.
  elemental logical function is_slip_zone_unresolved(spacing, contact_area, stick_area, max_traction, max_pressure) result(narrow)
    !> Spacing [m]
    real(wp), intent(in) :: spacing
    !> Areas to the edge between the nodes [m2]
    real(wp), intent(in) :: contact_area, stick_area
    !> Largest shear traction and pressure [Pa]
    real(wp), intent(in) :: max_traction, max_pressure
    type(accuracy_options_t) :: tuning

    narrow = stick_area > 0.0_wp .and. max_traction > tuning%least_shear*max_pressure .and. &
             contact_area - stick_area < tuning%resolved_width*spacing*2.0_wp*sqrt(pi*contact_area)
  end function is_slip_zone_unresolved

  !> Fit q + c h^p to values, weighted by 1/h.
  pure subroutine fit(h, values, order, options, scatter, width)
    !> Spacings
    real(wp), intent(in) :: h(:)
    !> Values
    real(wp), intent(in) :: values(:)
    !> p
    real(wp), intent(in) :: order
    type(accuracy_options_t), intent(in) :: options
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
    width = options%trend_safety*abs(values(1) - limit) + options%standard_errors*sqrt(limit_variance)*scatter
  end subroutine fit

end module hc_discretization_error
