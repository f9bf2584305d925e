!> Fatigue quantities for Python: flat procedures for f2py, no mathematics.
!>
!> Histories have the shape (6, times, points). The module has no state: threads may call it.
module hc_f2py_fatigue
  use iso_c_binding, only: c_double, c_int
  use hc_error, only: error_t
  use hc_f2py_handles, only: report
  use hc_plane_criteria, only: plane_criterion_t, smith_watson_topper_t, findley_t, fatemi_socie_t
  use hc_stress_path, only: crossland, dang_van
  use hc_fatigue_fields, only: find_critical_planes, find_invariants, find_ruiz_parameters
  use hc_strain_life, only: strain_life_t, new_strain_life
  implicit none
  private

  public :: critical_planes, invariants, ruiz, cycles_of

contains

  !> Find the critical plane of every point.
  subroutine critical_planes(criterion, numbers, n_time, n_point, histories, values, normals, code, message)
    !f2py threadsafe
    !> 1: Smith, Watson & Topper, 2: Findley, 3: Fatemi & Socie
    integer(c_int), intent(in) :: criterion
    !> Components of the criterion, in their order
    real(c_double), intent(in) :: numbers(3)
    !> Number of times and of points
    integer(c_int), intent(in) :: n_time, n_point
    !> Stress [Pa]
    real(c_double), intent(in) :: histories(6, n_time, n_point)
    !> Largest value and normal of its plane
    real(c_double), intent(out) :: values(n_point), normals(3, n_point)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    class(plane_criterion_t), allocatable :: parameter_of_plane
    type(error_t), allocatable :: error

    select case (criterion)
    case (1)
      parameter_of_plane = smith_watson_topper_t(numbers(1), numbers(2))
    case (2)
      parameter_of_plane = findley_t(numbers(1))
    case default
      parameter_of_plane = fatemi_socie_t(numbers(1), numbers(2), numbers(3))
    end select
    call find_critical_planes(parameter_of_plane, histories, values, normals, error)
    call report(error, code, message)
  end subroutine critical_planes

  !> Compute the parameter of Crossland or of Dang Van of every point.
  subroutine invariants(of_dang_van, slope, n_time, n_point, histories, values, code, message)
    !f2py threadsafe
    !> Not zero: Dang Van; else Crossland
    integer(c_int), intent(in) :: of_dang_van
    !> Influence of the hydrostatic stress
    real(c_double), intent(in) :: slope
    !> Number of times and of points
    integer(c_int), intent(in) :: n_time, n_point
    !> Stress [Pa]
    real(c_double), intent(in) :: histories(6, n_time, n_point)
    !> Parameter [Pa]
    real(c_double), intent(out) :: values(n_point)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error

    if (of_dang_van /= 0) then
      call find_invariants(dang_van, histories, slope, values, error)
    else
      call find_invariants(crossland, histories, slope, values, error)
    end if
    call report(error, code, message)
  end subroutine invariants

  !> Compute the parameters of Ruiz of every point.
  subroutine ruiz(n_time, n_point, traction, slip, histories, f_1, f_2, amplitude, code, message)
    !f2py threadsafe
    !> Number of times and of points
    integer(c_int), intent(in) :: n_time, n_point
    !> Traction [Pa], slip [m], stress at the surface [Pa]
    real(c_double), intent(in) :: traction(2, n_time, n_point), slip(2, n_time, n_point), histories(6, n_time, n_point)
    !> F1 [Pa m], F2 [Pa^2 m], slip amplitude [m]
    real(c_double), intent(out) :: f_1(n_point), f_2(n_point), amplitude(n_point)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error

    call find_ruiz_parameters(traction, slip, histories, f_1, f_2, amplitude, error)
    call report(error, code, message)
  end subroutine ruiz

  !> Compute the cycles for values of the parameter of Smith, Watson & Topper.
  subroutine cycles_of(numbers, n_point, values, cycles, code, message)
    !f2py threadsafe
    !> E and sigma_f' [Pa], b, eps_f', c
    real(c_double), intent(in) :: numbers(5)
    !> Number of points
    integer(c_int), intent(in) :: n_point
    !> sigma_n,max d_eps/2 [Pa]
    real(c_double), intent(in) :: values(n_point)
    !> Cycles
    real(c_double), intent(out) :: cycles(n_point)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(strain_life_t) :: curve
    type(error_t), allocatable :: error

    cycles = 0.0_c_double
    call new_strain_life(curve, numbers(1), numbers(2), numbers(3), numbers(4), numbers(5), error)
    if (.not. allocated(error)) cycles = curve%cycles(values)
    call report(error, code, message)
  end subroutine cycles_of

end module hc_f2py_fatigue
