!> Axisymmetric contacts for Python: flat procedures for f2py, no mathematics.
!>
!> A body is the list of its components, in their order. The module has no state, so that several threads may call at a time.
module hc_f2py_axisymmetric
  use iso_c_binding, only: c_double, c_int
  use hc_axisymmetric, only: axisymmetric_t, power_law_t, rounded_punch_t, flat_punch_t
  implicit none
  private

  public :: contact_of_body, pressure_of_body
  public :: flat_punch_stiffness, flat_punch_pressure

  !> Bodies, the other one is a rounded punch.
  integer, parameter :: of_power_law = 0
  !> What a contact is driven by.
  integer, parameter :: by_load = 0, by_approach = 1

contains

  !> Solve the contact under a load, an approach or with a contact radius.
  subroutine contact_of_body(kind, body, given, value, contact)
    !f2py threadsafe
    !> `of_power_law`, else a rounded punch
    integer(c_int), intent(in) :: kind
    !> E* [Pa], C [m^(1-n)], n; or E* [Pa], b [m], R [m]
    real(c_double), intent(in) :: body(3)
    !> What is given: `by_load`, `by_approach`, else the contact radius
    integer(c_int), intent(in) :: given
    !> Load [N], approach or contact radius [m]
    real(c_double), intent(in) :: value
    !> Contact radius, approach, load, largest pressure
    real(c_double), intent(out) :: contact(4)
    class(axisymmetric_t), allocatable :: indenter
    real(c_double) :: radius

    call set_indenter(kind, body, indenter)
    radius = value
    if (given == by_load) radius = indenter%contact_radius(normal_load=value)
    if (given == by_approach) radius = indenter%contact_radius(approach=value)
    contact = [radius, indenter%approach(radius), indenter%load(radius), indenter%max_pressure(radius)]
  end subroutine contact_of_body

  !> Compute the pressure of a contact.
  subroutine pressure_of_body(body, n, r, radius, kind, pressure)
    !f2py threadsafe
    !> E* [Pa], C [m^(1-n)], n; or E* [Pa], b [m], R [m]
    real(c_double), intent(in) :: body(3)
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Distance from the axis [m]
    real(c_double), intent(in) :: r(n)
    !> Contact radius [m]
    real(c_double), intent(in) :: radius
    !> `of_power_law`, else a rounded punch
    integer(c_int), intent(in) :: kind
    !> Pressure [Pa]
    real(c_double), intent(out) :: pressure(n)
    class(axisymmetric_t), allocatable :: indenter

    call set_indenter(kind, body, indenter)
    pressure = indenter%pressure(radius, r)
  end subroutine pressure_of_body

  !> Set up a body of a kind from its components.
  subroutine set_indenter(kind, body, indenter)
    integer(c_int), intent(in) :: kind
    real(c_double), intent(in) :: body(3)
    class(axisymmetric_t), allocatable, intent(out) :: indenter

    if (kind == of_power_law) then
      allocate (indenter, source=power_law_t(body(1), body(2), body(3)))
    else
      allocate (indenter, source=rounded_punch_t(body(1), body(2), body(3)))
    end if
  end subroutine set_indenter

  !> Compute the load per approach of a flat punch.
  subroutine flat_punch_stiffness(body, stiffness)
    !> E* [Pa], a [m]
    real(c_double), intent(in) :: body(2)
    !> Stiffness [N/m]
    real(c_double), intent(out) :: stiffness

    type(flat_punch_t) :: indenter

    indenter = flat_punch_t(body(1), body(2))
    stiffness = indenter%stiffness()
  end subroutine flat_punch_stiffness

  !> Compute the pressure of a flat punch.
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

    type(flat_punch_t) :: indenter

    indenter = flat_punch_t(body(1), body(2))
    pressure = indenter%pressure(load, r)
  end subroutine flat_punch_pressure

end module hc_f2py_axisymmetric
