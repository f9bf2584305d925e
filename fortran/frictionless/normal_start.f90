!> The start of an iteration for frictionless contact.
!>
!> Equations: docs/theory/normal_contact.md, (N2), (N6).
module hc_normal_start
  use hc_precision, only: wp, sp
  use hc_error, only: error_t, status, raise
  use hc_normal_lattice, only: normal_lattice_t
  use hc_normal_iterate, only: normal_iterate_t, find_span, rescale, linearize_law, advance
  implicit none
  private

  public :: set_start

  !> Steps of Newton's method for the size of a pressure of which only the shape is known, under a compliant law.
  integer, parameter :: start_steps = 8

contains

  !> Set the pressure to start from, scaled to the load or to the least energy, and its closing of the gap.
  subroutine set_start(level, now, candidate, error)
    !> Problem on the lattice, with its operators
    type(normal_lattice_t), intent(inout) :: level
    !> Iterate, whose pressure is the one to start from, up to a factor
    type(normal_iterate_t), intent(inout) :: now
    !> Nodes that may come into contact (n_col, n_row)
    logical, intent(in) :: candidate(:, :)
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: scale, largest
    integer :: n(2), row, stat, try
    logical :: known

    n = level%lattice%extent
    if (allocated(now%active)) then
      if (any(shape(now%active) /= n)) deallocate (now%r, now%z, now%d, now%kd, now%active, now%span)
    end if
    if (allocated(now%punch)) deallocate (now%punch)
    if (allocated(now%compliance)) deallocate (now%compliance, now%offset)
    if (allocated(now%w)) deallocate (now%w)                                   ! of a solution that failed
    stat = 0
    if (.not. allocated(now%active)) then
      allocate (now%r(n(1), n(2), 1), now%z(n(1), n(2), 1), now%d(n(1), n(2), 1), now%kd(n(1), n(2), 1), &
                now%active(n(1), n(2)), now%span(2, n(2)), stat=stat)
    end if
    if (stat == 0) allocate (now%w(n(1), n(2)), stat=stat)
    if (stat == 0 .and. level%normal_law%is_compliant()) then
      allocate (now%compliance(n(1), n(2)), now%offset(n(1), n(2)), source=0.0_wp, stat=stat)
    end if
    if (stat /= 0) then
      now = normal_iterate_t()                                                 ! fields that did fit
      call raise(error, status%resources, 'not enough memory for the fields: use a smaller window')
      return
    end if
    known = any(now%p > 0.0_wp .and. candidate)
    !$omp parallel do schedule(static) num_threads(level%space%threads)
    do row = 1, n(2)
      now%active(:, row) = candidate(:, row)
      if (known) now%active(:, row) = candidate(:, row) .and. now%p(:, row) > 0.0_wp
      if (.not. known) now%p(:, row) = 1.0_wp
      now%p(:, row) = merge(now%p(:, row), 0.0_wp, now%active(:, row))
      now%w(:, row) = 0.0_wp
      now%r(:, row, 1) = 0.0_sp
    end do
    !$omp end parallel do
    now%n_active = level%space%count(now%active)
    largest = level%space%max(now%p)
    now%approach = now%target
    now%closing_error = 0.0_wp
    scale = 1.0_wp
    if (now%by_load) scale = now%target/(level%lattice%cell_area()*level%space%sum(now%p))
    now%span(1, :) = n(1) + 1
    now%span(2, :) = 0
    call find_span(now, level%space)
    now%p_unit = scale*largest
    now%w_unit = now%p_unit*level%preconditioner%unit
    !$omp parallel do schedule(static) num_threads(level%space%threads)
    do row = 1, n(2)
      now%d(:, row, 1) = real(now%p(:, row)/largest, sp)
      now%p(:, row) = 0.0_wp
    end do
    !$omp end parallel do
    call level%multiply(now%d, now%kd)
    call advance(level, now, 1.0_wp, .false.)
    do try = 1, merge(start_steps, 0, allocated(now%offset))
      call linearize_law(level, now, 0.0_wp)
      if (now%by_load) exit
      call rescale(level, now)
    end do
    if (.not. now%by_load) then
      call rescale(level, now)
      now%p_unit = level%space%max(now%p)
      now%w_unit = now%p_unit*level%preconditioner%unit
    end if
  end subroutine set_start

end module hc_normal_start
