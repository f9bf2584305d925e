!> States of contacts with friction for Python: flat procedures for f2py, no mathematics.
!>
!> A state stays where the solver made it, and Python's arrays are views of its fields: neither a step nor its record copies
!> them. Python frees the state with the last of its arrays. The order of fields and numbers is that of `hexcontact.variables`.
module hc_f2py_states
  use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t, c_intptr_t, c_loc
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_contact_state, only: contact_state_t
  use hc_f2py_handles, only: take_state, state_at, forget_state, unpack_numbers
  implicit none
  private

  public :: hold_state, state_places, take_zones, free_state

contains

  !> Make a state of arrays that Python holds, to go on from.
  subroutine hold_state(n_col, n_row, pressure, traction_x, traction_y, gap, displacement_x, displacement_y, slip, density, &
                        numbers, handle)
    !> Number of columns and rows of the window
    integer(c_int), intent(in) :: n_col, n_row
    !> Its fields but for the slip increment
    real(c_double), intent(in) :: pressure(n_col*n_row), traction_x(n_col*n_row), traction_y(n_col*n_row), gap(n_col*n_row), &
                                  displacement_x(n_col*n_row), displacement_y(n_col*n_row), slip(n_col*n_row), &
                                  density(n_col*n_row), numbers(13)
    !> Handle of the state, or 0: there is no memory for it
    integer(c_int64_t), intent(out) :: handle
    type(contact_state_t), pointer :: state
    type(error_t), allocatable :: error
    integer :: n(2), stat

    n = [n_col, n_row]
    handle = 0
    allocate (state)
    allocate (state%pressure(n(1), n(2)), state%gap(n(1), n(2)), state%traction(n(1), n(2), 2), &
              state%relative_displacement(n(1), n(2), 2), state%accumulated_slip(n(1), n(2)), &
              state%dissipation_density(n(1), n(2)), stat=stat)
    if (stat /= 0) then
      deallocate (state)
      return
    end if
    state%pressure = reshape(pressure, n)
    state%traction(:, :, 1) = reshape(traction_x, n)
    state%traction(:, :, 2) = reshape(traction_y, n)
    state%gap = reshape(gap, n)
    state%relative_displacement(:, :, 1) = reshape(displacement_x, n)
    state%relative_displacement(:, :, 2) = reshape(displacement_y, n)
    state%accumulated_slip = reshape(slip, n)
    state%dissipation_density = reshape(density, n)
    call unpack_numbers(numbers, state)
    call take_state(state, handle, error)
    if (handle == 0) deallocate (state)
  end subroutine hold_state

  !> Return the addresses of the fields of a state, 0 of one that is missing; of a stale handle all are.
  subroutine state_places(handle, places)
    !> Handle of the state
    integer(c_int64_t), intent(in) :: handle
    !> Addresses of the fields
    integer(c_int64_t), intent(out) :: places(10)
    type(contact_state_t), pointer :: state

    places = 0
    state => state_at(handle)
    if (.not. associated(state)) return
    places = [place(state%pressure), places_of_both(state%traction), place(state%gap), &
              places_of_both(state%relative_displacement), places_of_both(state%slip_increment), place(state%accumulated_slip), &
              place(state%dissipation_density)]
  end subroutine state_places

  !> Return the zones of a state, and free them: no step goes on from them.
  subroutine take_zones(handle, n_node, zone)
    !> Handle of the state
    integer(c_int64_t), intent(in) :: handle
    !> Number of nodes of the window
    integer(c_int), intent(in) :: n_node
    !> Zone of each node
    integer(c_int), intent(out) :: zone(n_node)
    type(contact_state_t), pointer :: state

    zone = 0
    state => state_at(handle, n_node)
    if (.not. associated(state)) return
    if (.not. allocated(state%zone)) return
    zone = reshape(state%zone, [n_node])
    deallocate (state%zone)
  end subroutine take_zones

  !> Free a state; a stale handle is ignored.
  subroutine free_state(handle)
    !> Handle of the state
    integer(c_int64_t), intent(in) :: handle
    type(contact_state_t), pointer :: state

    state => forget_state(handle)
    if (associated(state)) deallocate (state)
  end subroutine free_state

  !> Return the address of a field.
  integer(c_int64_t) function place(field)
    real(wp), allocatable, intent(in), target :: field(:, :)

    place = 0
    if (allocated(field)) place = transfer(c_loc(field), 0_c_intptr_t)
  end function place

  !> Return the addresses of both components of a field.
  function places_of_both(field) result(places)
    real(wp), allocatable, intent(in), target :: field(:, :, :)
    integer(c_int64_t) :: places(2)

    places = 0
    if (.not. allocated(field)) return
    places(1) = transfer(c_loc(field), 0_c_intptr_t)
    places(2) = places(1) + int(size(field, 1), c_int64_t)*size(field, 2)*(storage_size(1.0_wp)/8)
  end function places_of_both

end module hc_f2py_states
