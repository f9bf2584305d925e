!> Fatigue quantities of many points at once, in parallel; each point by itself, so that any number of threads gives the same bits.
module hc_fatigue_fields
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp
  use hc_error, only: error_t, raise, status
  use hc_plane_criteria, only: plane_criterion_t
  use hc_critical_plane, only: find_critical_plane
  use hc_invariant_criteria, only: crossland
  use hc_fretting_parameters, only: find_ruiz
  implicit none
  private

  public :: find_critical_planes, find_invariants, find_ruiz_parameters

contains

  !> Find the critical plane of every point.
  subroutine find_critical_planes(criterion, histories, values, normals, error)
    !> The parameter
    class(plane_criterion_t), intent(in) :: criterion
    !> Stress (6, times, points): xx, yy, zz, xy, yz, xz [Pa]
    real(wp), intent(in), contiguous :: histories(:, :, :)
    !> Largest value (points), in the unit of the parameter
    real(wp), intent(out), contiguous :: values(:)
    !> Normals of the planes (3, points)
    real(wp), intent(out), contiguous :: normals(:, :)
    !> Allocated if a stress is not finite, or there is none
    type(error_t), allocatable, intent(out) :: error
    integer :: i

    call require_stress(histories, error)
    if (allocated(error)) return
    !$omp parallel do schedule(dynamic, 16)
    do i = 1, size(values)
      call find_critical_plane(criterion, histories(:, :, i), values(i), normals(:, i))
    end do
    !$omp end parallel do
  end subroutine find_critical_planes

  !> Find a parameter of the stress invariants at every point: that of Crossland or of Dang Van.
  subroutine find_invariants(parameter, histories, slope, values, error)
    !> crossland or dang_van
    procedure(crossland) :: parameter
    !> Stress (6, times, points) [Pa]
    real(wp), intent(in), contiguous :: histories(:, :, :)
    !> Influence of the hydrostatic stress
    real(wp), intent(in) :: slope
    !> Parameter (points) [Pa]
    real(wp), intent(out), contiguous :: values(:)
    !> Allocated if a stress is not finite, or there is none
    type(error_t), allocatable, intent(out) :: error
    integer :: i

    call require_stress(histories, error)
    if (allocated(error)) return
    !$omp parallel do schedule(dynamic, 64)
    do i = 1, size(values)
      values(i) = parameter(histories(:, :, i), slope)
    end do
    !$omp end parallel do
  end subroutine find_invariants

  !> Find the parameters of Ruiz of every point.
  subroutine find_ruiz_parameters(traction, slip, histories, f_1, f_2, amplitude, error)
    !> Traction (2, times, points) [Pa] and slip (2, times, points) [m]
    real(wp), intent(in), contiguous :: traction(:, :, :), slip(:, :, :)
    !> Stress at the surface (6, times, points) [Pa]
    real(wp), intent(in), contiguous :: histories(:, :, :)
    !> F1 [Pa m], F2 [Pa^2 m] and slip amplitude [m] (points)
    real(wp), intent(out), contiguous :: f_1(:), f_2(:), amplitude(:)
    !> Allocated if a number is not finite, or there is none
    type(error_t), allocatable, intent(out) :: error
    integer :: i

    call require_stress(histories, error)
    if (.not. allocated(error)) call require_stress(traction, error)
    if (.not. allocated(error)) call require_stress(slip, error)
    if (allocated(error)) return
    do i = 1, size(f_1)
      call find_ruiz(traction(:, :, i), slip(:, :, i), histories(:, :, i), f_1(i), f_2(i), amplitude(i))
    end do
  end subroutine find_ruiz_parameters

  !> Refuse histories without a time, and numbers that are not finite, or whose products are not.
  pure subroutine require_stress(histories, error)
    real(wp), intent(in), contiguous :: histories(:, :, :)
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: largest = 1.0e100_wp

    if (size(histories, 2) == 0) then
      call raise(error, status%invalid_input, 'a history of at least one time is expected')
    else if (.not. all(ieee_is_finite(histories))) then ! first: a comparison with NaN may be trapped
      call raise(error, status%invalid_input, 'finite numbers are expected in the history')
    else if (any(abs(histories) > largest)) then
      call raise(error, status%invalid_input, 'numbers of at most 1e100 are expected in the history')
    end if
  end subroutine require_stress

end module hc_fatigue_fields
