!> Discrete Fourier transform of a field over a window that repeats.
module hc_plane_transform
  use, intrinsic :: iso_c_binding, only: c_ptr, c_int, c_associated
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_fftw, only: fftw_plan_many_dft, fftw_execute_dft, fftw_destroy_plan, fftw_forward, fftw_estimate
  use hc_lock, only: lock, unlock, fftw_planner
  implicit none
  private

  public :: transform_plane

contains

  !> Sum field(a, b) exp(-2 pi i (a f/n_1 + b g/n_2)) over a = 0 ... n_1 - 1 and b = 0 ... n_2 - 1.
  !>
  !> The way back is the transform of the conjugate, over the number of nodes.
  subroutine transform_plane(field, spectrum, error)
    !> Values (n_1, n_2); lost
    complex(wp), intent(inout), contiguous :: field(:, :)
    !> Their transform by g and f (n_2, n_1)
    complex(wp), intent(out), contiguous :: spectrum(:, :)
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    complex(wp), allocatable :: lines(:, :)
    integer :: stat

    allocate (lines(size(field, 1), size(field, 2)), stat=stat)
    if (stat == 0) call transform_lines(field, lines, stat)
    if (stat == 0) then
      spectrum = transpose(lines)
      lines = reshape(lines, [size(spectrum, 1), size(spectrum, 2)])
      call transform_lines(spectrum, lines, stat)
      spectrum = lines
    end if
    if (stat /= 0) call raise(error, status%resources, 'not enough memory for the transforms: use a smaller window')
  end subroutine transform_plane

  !> Transform all columns of an array.
  subroutine transform_lines(given, transformed, stat)
    complex(wp), intent(inout), contiguous :: given(:, :)
    complex(wp), intent(out), contiguous :: transformed(:, :)
    !> Not zero: not enough memory
    integer, intent(out) :: stat
    type(c_ptr) :: plan
    integer(c_int) :: length(1)

    length = size(given, 1)
    call lock(fftw_planner)
    plan = fftw_plan_many_dft(1_c_int, length, size(given, 2, c_int), given, length, 1_c_int, length(1), &
                              transformed, length, 1_c_int, length(1), fftw_forward, fftw_estimate)
    call unlock(fftw_planner)
    stat = merge(0, 1, c_associated(plan))
    if (stat /= 0) return
    call fftw_execute_dft(plan, given, transformed)
    call lock(fftw_planner)
    call fftw_destroy_plan(plan)
    call unlock(fftw_planner)
  end subroutine transform_lines

end module hc_plane_transform
