!> Expected error of a run with few load steps, or few spacings in the contact, before it is solved.
!>
!> The rules were fitted to spheres: pressed with materials that differ, pressed and sheared at once, sheared to and fro, each
!> against a solution with many more steps or spacings. They are right to a factor of about 1.5, which is enough to choose
!> lattice and steps; error bars and adaptive load steps measure the errors of a run.
!>
!> Equations and measurements: docs/theory/expected_errors.md, (X1)-(X5).
module hc_expected_error
  use hc_precision, only: wp
  implicit none
  private

  public :: lattice_errors_t, lattice_errors, lattice_spacings, slip_ring, even_steps, entry_error, entry_steps, &
            oblique_error, oblique_steps, turning_error

  !> Relative errors that a lattice leaves at most; the largest one stands for no value.
  type :: lattice_errors_t
    !> Largest pressure, contact area to the edge between the nodes
    real(wp) :: max_pressure = 0.0_wp, contact_area = 0.0_wp
    !> Stick area to the edge, energy dissipated in a cycle
    real(wp) :: stick_area = 0.0_wp, dissipated_energy = 0.0_wp
  end type lattice_errors_t

  !> Errors times n^2 with n spacings in the radius: of the largest pressure, the contact area, the dissipated energy; of the
  !> stick area with n spacings in its radius
  real(wp), parameter :: of_pressure = 0.12_wp, of_area = 0.56_wp, of_energy = 2.0_wp, of_stick = 0.65_wp
  !> Spacings in the contact radius and in the stick radius below which these rules end, and by which power of them the
  !> error of the pressure grows there
  real(wp), parameter :: few = 2.0_wp, few_stick = 2.3_wp, few_order = 1.75_wp
  !> Error and exponent of the energy that a slip ring of one spacing dissipates, and spacings in it that are too few
  real(wp), parameter :: of_ring = 0.11_wp, ring_order = 3.5_wp, narrow = 0.8_wp
  !> Error that stands for no value at all
  real(wp), parameter :: no_value = 0.65_wp
  !> -ln of the error of a contact pressed in one step without slip, its increase by slip, the exponent, and that by a step
  real(wp), parameter :: no_slip = 0.2_wp, slip_share = 1.2_wp, slip_order = 1.2_wp, per_step = 0.13_wp
  !> Error of an oblique load in one step, exponent of the reserve of friction, and divisor for a step
  real(wp), parameter :: oblique = 0.8_wp, oblique_order = 0.65_wp, per_oblique_step = 0.28_wp

contains

  !> Estimate the errors of a lattice, (X1), (X2).
  pure function lattice_errors(spacings, ring) result(errors)
    !> Spacings in the radius, or in the smaller half-axis, of the contact (above 0)
    real(wp), intent(in) :: spacings
    !> Width of the slip ring over the radius; 0: nothing slips
    real(wp), intent(in) :: ring
    type(lattice_errors_t) :: errors
    real(wp) :: stick

    errors%max_pressure = min(no_value, of_pressure/spacings**2*max(1.0_wp, few/spacings)**few_order)
    errors%contact_area = merge(of_area/spacings**2, no_value, spacings >= few)
    if (ring <= 0.0_wp) return
    stick = 1.0_wp - ring
    if (stick > 0.0_wp) errors%stick_area = merge(of_stick/(stick*spacings)**2, no_value, stick*spacings >= few_stick)
    if (ring*spacings >= narrow) then
      errors%dissipated_energy = min(no_value, of_ring*(ring*spacings)**(-ring_order) + of_energy/spacings**2)
    else ! all of it may stick
      errors%dissipated_energy = no_value
      errors%stick_area = min(no_value, errors%stick_area + 1.0_wp/stick**2 - 1.0_wp)
    end if
  end function lattice_errors

  !> Estimate the spacings in the radius that leave no more than an error in any of them, (X1) and (X2) solved by bisection.
  elemental real(wp) function lattice_spacings(error, ring)
    !> The error, below that of no value
    real(wp), intent(in) :: error
    !> Width of the slip ring over the radius; 0: nothing slips
    real(wp), intent(in) :: ring
    type(lattice_errors_t) :: errors
    real(wp) :: too_few, middle
    integer :: k

    too_few = 0.0_wp
    lattice_spacings = 1.0e4_wp*sqrt(1.0_wp/error)
    if (ring > 0.0_wp) lattice_spacings = lattice_spacings/min(ring, max(1.0_wp - ring, epsilon(ring)))
    do k = 1, 2*digits(ring)
      middle = 0.5_wp*(too_few + lattice_spacings)
      errors = lattice_errors(middle, ring)
      if (max(errors%max_pressure, errors%contact_area, errors%stick_area, errors%dissipated_energy) > error) then
        too_few = middle
      else
        lattice_spacings = middle
      end if
    end do
  end function lattice_spacings

  !> Compute the width of the slip ring over the contact radius under a load Q: 1 - (1 - Q/mu P)^(1/3) (Cattaneo, Mindlin).
  elemental real(wp) function slip_ring(load_ratio)
    !> Q/mu P, from 0 to 1
    real(wp), intent(in) :: load_ratio
    slip_ring = 1.0_wp - max(0.0_wp, 1.0_wp - load_ratio)**(1.0_wp/3.0_wp)
  end function slip_ring

  !> Count the steps in which the contact grows, each weighted with the load that the nodes entering in it will carry, (X3).
  !>
  !> Both m equal increments of the load of a sphere and of its radius count as m.
  pure real(wp) function even_steps(before, after)
    !> Contact radius before and after each step in which it grows [m]
    real(wp), intent(in) :: before(:), after(:)
    real(wp) :: largest, weight(size(after))

    even_steps = 1.0_wp
    if (size(after) == 0) return
    largest = maxval(after)
    weight = after**3 - before**3
    even_steps = largest*sum(weight)/sum(weight*(after - before))
  end function even_steps

  !> Estimate the error of the shear tractions, over their sum, where dissimilar bodies are pressed with implicit entry, (X4).
  elemental real(wp) function entry_error(steps, stick)
    !> Steps, see even_steps
    real(wp), intent(in) :: steps
    !> mu/|beta|; huge: no slip
    real(wp), intent(in) :: stick
    entry_error = exp(-one_step(stick)*(1.0_wp + per_step*(steps - 1.0_wp)))
  end function entry_error

  !> Estimate the steps that leave no more than an error, (X4) solved for them.
  elemental real(wp) function entry_steps(error, stick)
    !> The error
    real(wp), intent(in) :: error
    !> mu/|beta|
    real(wp), intent(in) :: stick
    entry_steps = 1.0_wp + max(0.0_wp, -log(error)/one_step(stick) - 1.0_wp)/per_step
  end function entry_steps

  !> Compute -ln of (X4) for one step.
  elemental real(wp) function one_step(stick)
    !> mu/|beta|
    real(wp), intent(in) :: stick
    one_step = no_slip + slip_share*stick**(-slip_order)
  end function one_step

  !> Estimate the error of the shear tractions where the contact grows while the tangential load does, with implicit entry, (X5).
  elemental real(wp) function oblique_error(steps, load_ratio)
    !> Steps, see even_steps
    real(wp), intent(in) :: steps
    !> Q/mu P at the end, from 0 to 1
    real(wp), intent(in) :: load_ratio
    oblique_error = oblique*max(0.0_wp, 1.0_wp - load_ratio)**oblique_order/(1.0_wp + per_oblique_step*(steps - 1.0_wp))
  end function oblique_error

  !> Estimate the steps that leave no more than an error, (X5) solved for them.
  elemental real(wp) function oblique_steps(error, load_ratio)
    !> The error
    real(wp), intent(in) :: error
    !> Q/mu P at the end
    real(wp), intent(in) :: load_ratio
    oblique_steps = 1.0_wp + max(0.0_wp, oblique_error(1.0_wp, load_ratio)/error - 1.0_wp)/per_oblique_step
  end function oblique_steps

  !> Estimate the error of the dissipated energy where the tangential load turns, (X6): the largest part of a load, over the largest
  !> of all loads, that is transverse to the load at the end of the step.
  pure real(wp) function turning_error(shear)
    !> Tangential load or shift along x and y, and torque or twist, each over its largest, at the end of each step (3, :)
    real(wp), intent(in) :: shear(:, :)
    real(wp) :: along(size(shear, 2))
    integer :: k

    turning_error = 0.0_wp
    along = norm2(shear, dim=1)
    do k = 2, size(shear, 2)
      associate (q => shear(:, k), before => shear(:, k - 1))
        if (along(k) > 0.0_wp) turning_error = max(turning_error, norm2(before - dot_product(before, q)/along(k)**2*q))
      end associate
    end do
    if (turning_error > 0.0_wp) turning_error = turning_error/maxval(along)
  end function turning_error

end module hc_expected_error
