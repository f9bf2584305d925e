!> Passes over fields along x and y in single precision, at runs of active nodes.
!>
!> Arguments are no pointers, so that the compiler can exclude aliases.
module hc_plane_fields
  use hc_precision, only: wp, sp
  use hc_active_set, only: active_set_t, paired_runs_t
  use hc_frame_rows, only: slip_to_plane, stick_to_plane, add_turned
  implicit none
  private

  public :: to_plane, add_in_frames, keep_along, copy_nodes, add_nodes, set_to_zero

contains

  !> Turn displacements to x and y; values off the active nodes stay.
  subroutine to_plane(runs, threads, direction, x, y, along_t, along_e, factor)
    !> Active nodes
    type(paired_runs_t), intent(in) :: runs
    integer, intent(in) :: threads
    !> Direction e of the nodes of the first component (2, n_first)
    real(wp), intent(in), contiguous :: direction(:, :)
    !> Displacement along x and y (n)
    real(sp), intent(inout), contiguous :: x(:), y(:)
    !> Displacement along t at the active nodes; along e, absent: 0, and its factor
    real(wp), intent(in), contiguous :: along_t(:)
    real(wp), intent(in), contiguous, optional :: along_e(:)
    real(wp), intent(in), optional :: factor
    integer :: k, from, to, at, second

    !$omp parallel do schedule(static) num_threads(threads) private(from, to, at, second)
    do k = 1, size(runs%first)
      from = runs%first(k)
      to = runs%last(k)
      at = runs%place(k)
      second = runs%second(k)
      if (second > 0 .and. present(along_e)) then
        call stick_to_plane(to - from + 1, direction(:, at:at + to - from), factor, along_t(at:at + to - from), &
                            along_e(second:second + to - from), x(from:to), y(from:to))
      else
        call slip_to_plane(to - from + 1, direction(:, at:at + to - from), along_t(at:at + to - from), x(from:to), y(from:to))
      end if
    end do
    !$omp end parallel do
  end subroutine to_plane

  !> Add a field along x and y to one in the frames.
  subroutine add_in_frames(runs, threads, direction, x, y, along_t, along_e)
    !> Active nodes
    type(paired_runs_t), intent(in) :: runs
    integer, intent(in) :: threads
    !> Direction e of the nodes of the first component (2, n_first)
    real(wp), intent(in), contiguous :: direction(:, :)
    !> Components along x and y (n), and along t and e at the active nodes; absent: not wanted
    real(sp), intent(in), contiguous :: x(:), y(:)
    real(wp), intent(inout), contiguous :: along_t(:)
    real(wp), intent(inout), contiguous, optional :: along_e(:)
    integer :: k, from, to, at, second

    !$omp parallel do schedule(static) num_threads(threads) private(from, to, at, second)
    do k = 1, size(runs%first)
      from = runs%first(k)
      to = runs%last(k)
      at = runs%place(k)
      call add_turned(to - from + 1, -1.0_wp, direction(:, at:at + to - from), y(from:to), x(from:to), along_t(at:at + to - from))
      if (.not. present(along_e)) cycle
      second = runs%second(k)
      if (second > 0) call add_turned(to - from + 1, 1.0_wp, direction(:, at:at + to - from), x(from:to), y(from:to), &
                                      along_e(second:second + to - from))
    end do
    !$omp end parallel do
  end subroutine add_in_frames

  !> Keep the part of a field along e at the nodes of a second component.
  subroutine keep_along(runs, threads, direction, x, y)
    !> The nodes
    type(paired_runs_t), intent(in) :: runs
    integer, intent(in) :: threads
    !> Direction e of the nodes of the first component (2, n_first)
    real(wp), intent(in), contiguous :: direction(:, :)
    !> Components along x and y (n)
    real(sp), intent(inout), contiguous :: x(:), y(:)
    real(wp) :: along
    integer :: i, k, at

    !$omp parallel do schedule(static) num_threads(threads) private(i, at, along)
    do k = 1, size(runs%first)
      if (runs%second(k) == 0) cycle
      do i = runs%first(k), runs%last(k)
        at = runs%place(k) + i - runs%first(k)
        along = direction(1, at)*x(i) + direction(2, at)*y(i)
        x(i) = real(direction(1, at)*along, sp)
        y(i) = real(direction(2, at)*along, sp)
      end do
    end do
    !$omp end parallel do
  end subroutine keep_along

  !> Copy a field at some nodes.
  subroutine copy_nodes(nodes, threads, from, onto)
    !> The nodes
    type(active_set_t), intent(in) :: nodes
    integer, intent(in) :: threads
    !> Fields (n)
    real(sp), intent(in), contiguous :: from(:)
    real(sp), intent(inout), contiguous :: onto(:)
    integer :: k

    !$omp parallel do schedule(static) num_threads(threads)
    do k = 1, size(nodes%first)
      associate (first => nodes%first(k), last => nodes%last(k))
        onto(first:last) = from(first:last)
      end associate
    end do
    !$omp end parallel do
  end subroutine copy_nodes

  !> Add a field to another one at some nodes.
  subroutine add_nodes(nodes, threads, from, onto)
    !> The nodes
    type(active_set_t), intent(in) :: nodes
    integer, intent(in) :: threads
    !> Fields (n)
    real(sp), intent(in), contiguous :: from(:)
    real(sp), intent(inout), contiguous :: onto(:)
    integer :: k

    !$omp parallel do schedule(static) num_threads(threads)
    do k = 1, size(nodes%first)
      associate (first => nodes%first(k), last => nodes%last(k))
        onto(first:last) = onto(first:last) + from(first:last)
      end associate
    end do
    !$omp end parallel do
  end subroutine add_nodes

  !> Set a field to zero at some nodes.
  subroutine set_to_zero(nodes, threads, field)
    !> The nodes
    type(active_set_t), intent(in) :: nodes
    integer, intent(in) :: threads
    !> Field (n)
    real(sp), intent(inout), contiguous :: field(:)
    integer :: k

    !$omp parallel do schedule(static) num_threads(threads)
    do k = 1, size(nodes%first)
      field(nodes%first(k):nodes%last(k)) = 0.0_sp
    end do
    !$omp end parallel do
  end subroutine set_to_zero

end module hc_plane_fields
