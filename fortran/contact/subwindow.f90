!> The part of the window around the contact, and its enlargement where it fails: one policy for all solvers.
!>
!> If the present contact is much smaller than the window, a problem is solved on the part around it, and checked by
!> one product over the window (docs/theory/multilevel.md, "Part of the window"). A part that has a solution fails where
!> the bodies overlap outside of it: the next part is around these nodes, too. The whole window is next where a part has no
!> solution, where it saves no work, or after some parts.
module hc_subwindow
  use hc_precision, only: wp, zk
  use hc_error, only: error_t
  use hc_flexibility, only: application_time
  use hc_normal_problem, only: normal_problem_t
  use hc_contact_state, only: contact_state_t, new_friction_state, add_fields, add_history, load_step_t
  use hc_contact_problem, only: friction_problem_t
  use hc_contact_solver, only: friction_solver_t
  implicit none
  private

  public :: next_part, enclose, solve_part

contains

  !> Choose the part of the window to be tried next.
  subroutine next_part(try, problem, state, low, high, found)
    !> Number of the part, from 1 on
    integer, intent(in) :: try
    !> Problem on the window
    class(normal_problem_t), intent(in) :: problem
    !> State to start from at first; then that of the last part over the window, with its gap
    type(contact_state_t), intent(in) :: state
    !> Columns and rows, from 1 on
    integer, intent(out) :: low(2), high(2)
    !> False: the whole window is next
    logical, intent(out) :: found

    found = try <= problem%options%multilevel%max_parts
    low = 1
    high = problem%lattice%extent
    if (.not. found) return
    if (try == 1) then
      call enclose(problem, state%pressure > 0.0_wp, low, high)
    else
      call enclose(problem, state%pressure > 0.0_wp .or. (state%gap < 0.0_wp .and. problem%candidate), low, high)
    end if
    ! the nodes of a part do not tell: 3072 x 3072 of 4096 x 4096 nodes take transforms of the same lengths; none repeats
    associate (whole => problem%lattice)
      found = .not. whole%is_periodic() .and. application_time(whole%subwindow(low, high)) &
              <= problem%options%multilevel%largest_part*application_time(whole)
    end associate
  end subroutine next_part

  !> Find the part around some nodes.
  subroutine enclose(problem, nodes, low, high)
    class(normal_problem_t), intent(in) :: problem
    !> The nodes (n_col, own rows)
    logical, intent(in) :: nodes(:, :)
    !> Columns and rows, from 1 on
    integer, intent(out) :: low(2), high(2)
    integer :: columns(size(nodes, 1)), rows(problem%lattice%extent(2)), own(2)

    associate (ranks => problem%space%ranks, options => problem%options%multilevel)
      if (ranks%size == 1) then
        call problem%lattice%enclose(nodes, options, low, high)
        return
      end if
      columns = count(nodes, dim=2)
      rows = 0
      own = problem%space%own_rows(size(rows))
      rows(own(1):own(2)) = count(nodes, dim=1)
      call ranks%add_counts(columns)
      call ranks%add_counts(rows)
      call problem%lattice%enclose_lines(columns > 0, rows > 0, options, low, high)
    end associate
  end subroutine enclose

  !> Solve a step on the part, and judge it on the window.
  subroutine solve_part(whole, part, corners, start, step, state, solved, error)
    !> Solver on the window, and one on the part
    class(friction_solver_t), intent(inout) :: whole, part
    !> First column and row of the part, and the last ones
    integer, intent(in) :: corners(2, 2)
    !> State at the beginning of the step
    type(contact_state_t), intent(in) :: start
    !> The load step
    type(load_step_t), intent(in) :: step
    !> State on the window
    type(contact_state_t), intent(out) :: state
    !> There is a solution on the part
    logical, intent(out) :: solved
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    type(contact_state_t) :: before, after
    real(wp), allocatable :: displacement(:, :, :)
    integer :: m

    solved = .false.
    associate (lattice => part%problem%lattice)
      call new_friction_state(before, lattice, part%problem%space)
      call cut_state(whole%problem, corners(:, 1), part%problem, start, before)
      before%motion = start%motion
      before%load = start%load
      if (.not. part%problem%is_pressed(step%target)) return
      if (allocated(whole%guess)) then
        allocate (part%guess)
        call whole%problem%cut(whole%guess%pressure, corners(:, 1), part%problem, part%guess%pressure)
        part%guess%traction = cut_vector(whole%problem, whole%guess%traction, corners(:, 1), part%problem)
        part%guess%motion = whole%guess%motion
      end if
      call part%solve_step(before, cut_vector(whole%problem, step%reference, corners(:, 1), part%problem), step%target, &
                           whole%problem%options%multilevel%part_tolerance*step%tolerance, step%max_sweeps, after, error)
      if (allocated(part%guess)) deallocate (part%guess)
      ! each rank may have solved all of the part
      call whole%problem%space%agree(error)
      if (allocated(error)) return
      state%operator_applications = after%operator_applications*lattice%size()/whole%problem%lattice%size()
      state%sweeps = after%sweeps
      solved = after%converged
      if (.not. solved) return
      call add_fields(state, whole%problem%lattice, whole%problem%space)
      call whole%problem%paste(part%problem, corners(:, 1), after%pressure, state%pressure)
      do m = 1, 2
        call whole%problem%paste(part%problem, corners(:, 1), after%traction(:, :, m), state%traction(:, :, m))
      end do
    end associate
    state%motion = after%motion
    allocate (displacement(size(state%pressure, 1), size(state%pressure, 2), 3))
    call whole%displacements(state%pressure, state%traction, displacement, error)
    if (allocated(error)) return
    state%gap = displacement(:, :, 1)
    state%relative_displacement = displacement(:, :, 2:)
    deallocate (displacement)
    call whole%problem%complete_state(step%target, step%tolerance, step%reference, state)
    call add_history(state)
    state%operator_applications = state%operator_applications + 1.0_wp
  end subroutine solve_part

  !> Take the fields of a state on a part of the window.
  subroutine cut_state(whole, low, part, state, values)
    type(friction_problem_t), intent(in) :: whole, part
    !> First column and row of the part
    integer, intent(in) :: low(2)
    !> State on the window, and on the part (columns and own rows)
    type(contact_state_t), intent(in) :: state
    type(contact_state_t), intent(inout) :: values
    real(wp), allocatable :: zone(:, :)

    call whole%cut(state%pressure, low, part, values%pressure)
    call whole%cut(state%gap, low, part, values%gap)
    if (whole%space%ranks%size == 1) then
      associate (high => low + part%lattice%extent - 1)
        values%zone = state%zone(low(1):high(1), low(2):high(2))
      end associate
    else
      call whole%cut(real(state%zone, wp), low, part, zone)
      values%zone = nint(zone, zk)
    end if
    values%traction = cut_vector(whole, state%traction, low, part)
    values%relative_displacement = cut_vector(whole, state%relative_displacement, low, part)
  end subroutine cut_state

  !> Return the components of a field on a part of the window.
  function cut_vector(whole, field, low, part) result(values)
    type(friction_problem_t), intent(in) :: whole, part
    !> Field (n_col, own rows, 2)
    real(wp), intent(in), contiguous :: field(:, :, :)
    !> First column and row of the part
    integer, intent(in) :: low(2)
    !> Field there (columns and own rows of the part, 2)
    real(wp), allocatable :: values(:, :, :)
    real(wp), allocatable :: component(:, :)
    integer :: m

    allocate (values(part%lattice%extent(1), part%own_rows(), size(field, 3)))
    do m = 1, size(field, 3)
      call whole%cut(field(:, :, m), low, part, component)
      values(:, :, m) = component
    end do
  end function cut_vector

end module hc_subwindow
