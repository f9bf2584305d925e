!> Axisymmetric contacts for Python: flat procedures for f2py, no mathematics.
!>
!> A body is the list of its components, in their order. Nothing here keeps state, so that threads may call at will.
module hc_f2py_axisymmetric
  use iso_c_binding, only: c_double, c_int
  use hc_axisymmetric, only: power_law_t, rounded_punch_t, flat_punch_t
  implicit none
  private

  public :: power_law, power_law_pressure, rounded_punch, rounded_punch_pressure
  public :: flat_punch_stiffness, flat_punch_pressure

  !> What a contact is driven by.
  integer, parameter :: by_load = 0, by_approach = 1

contains

  !> Contact with a power law under a load, an approach or with a contact radius.
  subroutine power_law(body, given, value, contact)
    !f2py threadsafe
    !> E* [Pa], C [m^(1-n)], n
    real(c_double), intent(in) :: body(3)
    !> What is given: `by_load`, `by_approach`, else the contact radius
    integer(c_int), intent(in) :: given
    !> Load [N], approach or contact radius [m]
    real(c_double), intent(in) :: value
    !> Contact radius, approach, load, largest pressure
    real(c_double), intent(out) :: contact(4)

    type(power_law_t) :: shape
    real(c_double) :: radius

    shape = power_law_t(body(1), body(2), body(3))
    radius = value
    if (given == by_load) radius = shape%contact_radius(normal_load=value)
    if (given == by_approach) radius = shape%contact_radius(approach=value)
    contact = [radius, shape%approach(radius), shape%load(radius), shape%max_pressure(radius)]
  end subroutine power_law

  !> Pressure of a power law.
  subroutine power_law_pressure(body, n, r, radius, pressure)
    !f2py threadsafe
    !> E* [Pa], C [m^(1-n)], n
    real(c_double), intent(in) :: body(3)
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Distance from the axis [m]
    real(c_double), intent(in) :: r(n)
    !> Contact radius [m]
    real(c_double), intent(in) :: radius
    !> Pressure [Pa]
    real(c_double), intent(out) :: pressure(n)

    type(power_law_t) :: shape

    shape = power_law_t(body(1), body(2), body(3))
    pressure = shape%pressure(radius, r)
  end subroutine power_law_pressure

  !> Contact with a rounded punch under a load, an approach or with a contact radius.
  subroutine rounded_punch(body, given, value, contact)
    !f2py threadsafe
    !> E* [Pa], b [m], R [m]
    real(c_double), intent(in) :: body(3)
    !> What is given: `by_load`, `by_approach`, else the contact radius
    integer(c_int), intent(in) :: given
    !> Load [N], approach or contact radius [m]
    real(c_double), intent(in) :: value
    !> Contact radius, approach, load, largest pressure
    real(c_double), intent(out) :: contact(4)

    type(rounded_punch_t) :: shape
    real(c_double) :: radius

    shape = rounded_punch_t(body(1), body(2), body(3))
    radius = value
    if (given == by_load) radius = shape%contact_radius(normal_load=value)
    if (given == by_approach) radius = shape%contact_radius(approach=value)
    contact = [radius, shape%approach(radius), shape%load(radius), shape%max_pressure(radius)]
  end subroutine rounded_punch

  !> Pressure of a rounded punch.
  subroutine rounded_punch_pressure(body, n, r, radius, pressure)
    !f2py threadsafe
    !> E* [Pa], b [m], R [m]
    real(c_double), intent(in) :: body(3)
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Distance from the axis [m]
    real(c_double), intent(in) :: r(n)
    !> Contact radius [m]
    real(c_double), intent(in) :: radius
    !> Pressure [Pa]
    real(c_double), intent(out) :: pressure(n)

    type(rounded_punch_t) :: shape

    shape = rounded_punch_t(body(1), body(2), body(3))
    pressure = shape%pressure(radius, r)
  end subroutine rounded_punch_pressure

  !> Load per approach of a flat punch.
  subroutine flat_punch_stiffness(body, stiffness)
    !> E* [Pa], a [m]
    real(c_double), intent(in) :: body(2)
    !> Stiffness [N/m]
    real(c_double), intent(out) :: stiffness

    type(flat_punch_t) :: shape

    shape = flat_punch_t(body(1), body(2))
    stiffness = shape%stiffness()
  end subroutine flat_punch_stiffness

  !> Pressure of a flat punch.
  subroutine flat_punch_pressure(body, n, r, load, pressure)
    !f2py threadsafe
    !> E* [Pa], a [m]
    real(c_double), intent(in) :: body(2)
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Distance from the axis [m]
    real(c_double), intent(in) :: r(n)
    !> Load [N]
    real(c_double), intent(in) :: load
    !> Pressure [Pa]
    real(c_double), intent(out) :: pressure(n)

    type(flat_punch_t) :: shape

    shape = flat_punch_t(body(1), body(2))
    pressure = shape%pressure(load, r)
  end subroutine flat_punch_pressure

end module hc_f2py_axisymmetric
