!> Closed solutions for Python: flat procedures for f2py, no mathematics.
!>
!> A contact is the list of its components, in their order. Results are not numbers where there is no solution.
!> The module has no state, so that several threads may call at a time.
module hc_f2py_analytic
  use iso_c_binding, only: c_double, c_int
  use hc_error, only: error_t
  use hc_f2py_handles, only: report
  use hc_elliptic_contact, only: elliptic_contact_t, hertz_ellipse, crossed_cylinders_hessian
  use hc_partial_slip, only: mindlin_t, plane_cattaneo_t, turning_points
  use hc_torsion, only: lubkin_t
  use hc_self_similar, only: no_slip_constants, goodman_stick_ratio, goodman_stick_ratio_plane
  implicit none
  private

  public :: hertz, cylinders_hessian, ellipse_local, ellipse_pressure
  public :: mindlin_sliding, mindlin_stick_radius, mindlin_shift, mindlin_load, mindlin_traction
  public :: mindlin_shift_unloading, mindlin_traction_unloading, mindlin_energy, masing_turns
  public :: plane_stick_half_width, plane_traction
  public :: lubkin_sliding_torque, lubkin_twist, lubkin_torque, lubkin_stick_radius
  public :: no_slip, goodman, goodman_plane

contains

  !> Solve the contact over an ellipse under a load or an approach.
  subroutine hertz(effective_modulus, hessian, by_load, value, contact, code, message)
    !f2py threadsafe
    !> E* [Pa], second derivatives of the separation [1/m]
    real(c_double), intent(in) :: effective_modulus, hessian(2, 2)
    !> Not zero if the load is given, zero if the approach is
    integer(c_int), intent(in) :: by_load
    !> Load [N] or approach [m]
    real(c_double), intent(in) :: value
    !> E*, a, b, angle, approach, load, largest pressure
    real(c_double), intent(out) :: contact(7)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message

    type(elliptic_contact_t) :: ellipse
    type(error_t), allocatable :: error

    if (by_load /= 0) then
      call hertz_ellipse(ellipse, effective_modulus, hessian, error, normal_load=value)
    else
      call hertz_ellipse(ellipse, effective_modulus, hessian, error, approach=value)
    end if
    contact = [ellipse%effective_modulus, ellipse%semi_major, ellipse%semi_minor, ellipse%angle, ellipse%approach, &
               ellipse%normal_load, ellipse%max_pressure]
    call report(error, code, message)
  end subroutine hertz

  !> Compute the second derivatives of the separation of crossed cylinders.
  subroutine cylinders_hessian(radius_1, radius_2, angle, hessian)
    !> Radii [m], angle between the axes [rad]
    real(c_double), intent(in) :: radius_1, radius_2, angle
    !> Tensor [1/m]
    real(c_double), intent(out) :: hessian(2, 2)

    hessian = crossed_cylinders_hessian(radius_1, radius_2, angle)
  end subroutine cylinders_hessian

  !> Set up an ellipse from its components.
  pure function ellipse_of(contact) result(ellipse)
    !> Those that `hertz` returns
    real(c_double), intent(in) :: contact(7)
    type(elliptic_contact_t) :: ellipse

    ellipse = elliptic_contact_t(contact(1), contact(2), contact(3), contact(4), contact(5), contact(6), contact(7))
  end function ellipse_of

  !> Return points relative to an ellipse, as shares of its axes.
  subroutine ellipse_local(contact, n, x, y, along, across)
    !f2py threadsafe
    !> Those that `hertz` returns
    real(c_double), intent(in) :: contact(7)
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Points [m]
    real(c_double), intent(in) :: x(n), y(n)
    !> Shares of the axes
    real(c_double), intent(out) :: along(n), across(n)

    type(elliptic_contact_t) :: ellipse

    ellipse = ellipse_of(contact)
    call ellipse%local(x, y, along, across)
  end subroutine ellipse_local

  !> Compute the pressure over an ellipse.
  subroutine ellipse_pressure(contact, n, x, y, pressure)
    !f2py threadsafe
    !> Those that `hertz` returns
    real(c_double), intent(in) :: contact(7)
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Points [m]
    real(c_double), intent(in) :: x(n), y(n)
    !> Pressure [Pa]
    real(c_double), intent(out) :: pressure(n)

    type(elliptic_contact_t) :: ellipse

    ellipse = ellipse_of(contact)
    pressure = ellipse%pressure(x, y)
  end subroutine ellipse_pressure

  !> Set up the contact of spheres from its components.
  pure function mindlin_of(contact) result(spheres)
    !> mu, P [N], a [m], S [1/Pa]
    real(c_double), intent(in) :: contact(4)
    type(mindlin_t) :: spheres

    spheres = mindlin_t(contact(1), contact(2), contact(3), contact(4))
  end function mindlin_of

  !> Return load and shift at which spheres slide.
  subroutine mindlin_sliding(contact, load, shift)
    !> mu, P [N], a [m], S [1/Pa]
    real(c_double), intent(in) :: contact(4)
    !> Sliding load [N], sliding shift [m]
    real(c_double), intent(out) :: load, shift

    type(mindlin_t) :: spheres

    spheres = mindlin_of(contact)
    load = spheres%sliding_load()
    shift = spheres%sliding_shift()
  end subroutine mindlin_sliding

  !> Compute the stick radius of spheres under a first tangential load.
  subroutine mindlin_stick_radius(contact, n, load, radius)
    !f2py threadsafe
    !> mu, P [N], a [m], S [1/Pa]
    real(c_double), intent(in) :: contact(4)
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Tangential load [N]
    real(c_double), intent(in) :: load(n)
    !> Stick radius [m]
    real(c_double), intent(out) :: radius(n)

    type(mindlin_t) :: spheres

    spheres = mindlin_of(contact)
    radius = spheres%stick_radius(load)
  end subroutine mindlin_stick_radius

  !> Compute the rigid shift of spheres under a first tangential load.
  subroutine mindlin_shift(contact, n, load, shift)
    !f2py threadsafe
    !> mu, P [N], a [m], S [1/Pa]
    real(c_double), intent(in) :: contact(4)
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Tangential load [N]
    real(c_double), intent(in) :: load(n)
    !> Shift [m]
    real(c_double), intent(out) :: shift(n)

    type(mindlin_t) :: spheres

    spheres = mindlin_of(contact)
    shift = spheres%shift(load)
  end subroutine mindlin_shift

  !> Compute the tangential load on spheres under a first shift.
  subroutine mindlin_load(contact, n, shift, load)
    !f2py threadsafe
    !> mu, P [N], a [m], S [1/Pa]
    real(c_double), intent(in) :: contact(4)
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Shift [m]
    real(c_double), intent(in) :: shift(n)
    !> Tangential load [N]
    real(c_double), intent(out) :: load(n)

    type(mindlin_t) :: spheres

    spheres = mindlin_of(contact)
    load = spheres%load(shift)
  end subroutine mindlin_load

  !> Compute the shear traction between spheres under a first tangential load.
  subroutine mindlin_traction(contact, n, r, load, traction)
    !f2py threadsafe
    !> mu, P [N], a [m], S [1/Pa]
    real(c_double), intent(in) :: contact(4)
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Distance from the axis [m]
    real(c_double), intent(in) :: r(n)
    !> Tangential load [N]
    real(c_double), intent(in) :: load
    !> Traction [Pa]
    real(c_double), intent(out) :: traction(n)

    type(mindlin_t) :: spheres

    spheres = mindlin_of(contact)
    traction = spheres%traction(r, load)
  end subroutine mindlin_traction

  !> Compute the rigid shift of spheres on the way back.
  subroutine mindlin_shift_unloading(contact, n, load, peak, shift)
    !f2py threadsafe
    !> mu, P [N], a [m], S [1/Pa]
    real(c_double), intent(in) :: contact(4)
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Tangential load [N]
    real(c_double), intent(in) :: load(n)
    !> Largest load before [N]
    real(c_double), intent(in) :: peak
    !> Shift [m]
    real(c_double), intent(out) :: shift(n)

    type(mindlin_t) :: spheres

    spheres = mindlin_of(contact)
    shift = spheres%shift_unloading(load, peak)
  end subroutine mindlin_shift_unloading

  !> Compute the shear traction between spheres on the way back.
  subroutine mindlin_traction_unloading(contact, n, r, load, peak, traction)
    !f2py threadsafe
    !> mu, P [N], a [m], S [1/Pa]
    real(c_double), intent(in) :: contact(4)
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Distance from the axis [m]
    real(c_double), intent(in) :: r(n)
    !> Tangential load and the largest one before [N]
    real(c_double), intent(in) :: load, peak
    !> Traction [Pa]
    real(c_double), intent(out) :: traction(n)

    type(mindlin_t) :: spheres

    spheres = mindlin_of(contact)
    traction = spheres%traction_unloading(r, load, peak)
  end subroutine mindlin_traction_unloading

  !> Compute the energy dissipated by spheres in a cycle.
  subroutine mindlin_energy(contact, peak, energy)
    !> mu, P [N], a [m], S [1/Pa]
    real(c_double), intent(in) :: contact(4)
    !> Largest tangential load [N]
    real(c_double), intent(in) :: peak
    !> Energy [J]
    real(c_double), intent(out) :: energy

    type(mindlin_t) :: spheres

    spheres = mindlin_of(contact)
    energy = spheres%energy_per_cycle(peak)
  end subroutine mindlin_energy

  !> Find the turning points of a load history that a contact remembers.
  subroutine masing_turns(n, loads, turns, n_turn)
    !> Number of loads
    integer(c_int), intent(in) :: n
    !> Loads in order
    real(c_double), intent(in) :: loads(n)
    !> Turning points, the last being the load now
    real(c_double), intent(out) :: turns(n)
    !> Their number
    integer(c_int), intent(out) :: n_turn

    call turning_points(loads, turns, n_turn)
  end subroutine masing_turns

  !> Compute half the width of the stick strip between cylinders.
  subroutine plane_stick_half_width(contact, load, half_width)
    !> mu, P' [N/m], b [m]
    real(c_double), intent(in) :: contact(3)
    !> Tangential load [N/m]
    real(c_double), intent(in) :: load
    !> Half the width [m]
    real(c_double), intent(out) :: half_width

    type(plane_cattaneo_t) :: cylinders

    cylinders = plane_cattaneo_t(contact(1), contact(2), contact(3))
    half_width = cylinders%stick_half_width(load)
  end subroutine plane_stick_half_width

  !> Compute the shear traction between cylinders under a first tangential load.
  subroutine plane_traction(contact, n, x, load, traction)
    !f2py threadsafe
    !> mu, P' [N/m], b [m]
    real(c_double), intent(in) :: contact(3)
    !> Number of points
    integer(c_int), intent(in) :: n
    !> Distance from the middle [m]
    real(c_double), intent(in) :: x(n)
    !> Tangential load [N/m]
    real(c_double), intent(in) :: load
    !> Traction [Pa]
    real(c_double), intent(out) :: traction(n)

    type(plane_cattaneo_t) :: cylinders

    cylinders = plane_cattaneo_t(contact(1), contact(2), contact(3))
    traction = cylinders%traction(x, load)
  end subroutine plane_traction

  !> Compute the torque at which spheres slide.
  subroutine lubkin_sliding_torque(contact, torque)
    !f2py threadsafe
    !> mu, P [N], a [m], S_t [1/Pa]
    real(c_double), intent(in) :: contact(4)
    !> Torque [N m]
    real(c_double), intent(out) :: torque

    type(lubkin_t) :: spheres

    spheres = lubkin_t(contact(1), contact(2), contact(3), contact(4))
    torque = spheres%sliding_torque()
  end subroutine lubkin_sliding_torque

  !> Compute the twist of spheres by their stick radius.
  subroutine lubkin_twist(contact, stick_radius, twist)
    !f2py threadsafe
    !> mu, P [N], a [m], S_t [1/Pa]
    real(c_double), intent(in) :: contact(4)
    !> Stick radius [m]
    real(c_double), intent(in) :: stick_radius
    !> Twist [rad]
    real(c_double), intent(out) :: twist

    type(lubkin_t) :: spheres

    spheres = lubkin_t(contact(1), contact(2), contact(3), contact(4))
    twist = spheres%twist(stick_radius)
  end subroutine lubkin_twist

  !> Compute the torque on spheres by their stick radius.
  subroutine lubkin_torque(contact, stick_radius, torque)
    !f2py threadsafe
    !> mu, P [N], a [m], S_t [1/Pa]
    real(c_double), intent(in) :: contact(4)
    !> Stick radius [m]
    real(c_double), intent(in) :: stick_radius
    !> Torque [N m]
    real(c_double), intent(out) :: torque

    type(lubkin_t) :: spheres

    spheres = lubkin_t(contact(1), contact(2), contact(3), contact(4))
    torque = spheres%torque(stick_radius)
  end subroutine lubkin_torque

  !> Compute the stick radius of spheres under a first torque.
  subroutine lubkin_stick_radius(contact, torque, stick_radius)
    !f2py threadsafe
    !> mu, P [N], a [m], S_t [1/Pa]
    real(c_double), intent(in) :: contact(4)
    !> Torque [N m]
    real(c_double), intent(in) :: torque
    !> Stick radius [m]
    real(c_double), intent(out) :: stick_radius

    type(lubkin_t) :: spheres

    spheres = lubkin_t(contact(1), contact(2), contact(3), contact(4))
    stick_radius = spheres%stick_radius(torque)
  end subroutine lubkin_stick_radius

  !> Compute the constants of indentation without slip.
  subroutine no_slip(beta, kappa, chi)
    !f2py threadsafe
    !> Dundurs' constant
    real(c_double), intent(in) :: beta
    !> Constants
    real(c_double), intent(out) :: kappa, chi

    call no_slip_constants(beta, kappa, chi)
  end subroutine no_slip

  !> Compute the stick ratio of spheres pressed monotonically where shear does not move the pressure.
  subroutine goodman(beta, friction_coefficient, stick_ratio)
    !f2py threadsafe
    !> Dundurs' constant, coefficient of friction
    real(c_double), intent(in) :: beta, friction_coefficient
    !> Stick ratio
    real(c_double), intent(out) :: stick_ratio

    stick_ratio = goodman_stick_ratio(beta, friction_coefficient)
  end subroutine goodman

  !> Compute the stick ratio of cylinders pressed monotonically where shear does not move the pressure.
  subroutine goodman_plane(beta, friction_coefficient, stick_ratio)
    !f2py threadsafe
    !> Dundurs' constant, coefficient of friction
    real(c_double), intent(in) :: beta, friction_coefficient
    !> Stick ratio
    real(c_double), intent(out) :: stick_ratio

    stick_ratio = goodman_stick_ratio_plane(beta, friction_coefficient)
  end subroutine goodman_plane

end module hc_f2py_analytic
