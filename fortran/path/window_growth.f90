!> Windows that grow with the contact: a larger one, and states on it.
!>
!> The nodes of a window stay those of the larger one. Where nothing was solved before, gap and relative displacement follow
!> from the tractions and the rigid motions, and nothing has slipped.
module hc_window_growth
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_lattice, only: lattice_t
  use hc_field_space, only: field_space_t
  use hc_contact_state, only: contact_state_t, add_fields, add_history, normal
  use hc_contact_solver, only: friction_solver_t
  implicit none
  private

  public :: grown_window, shared_grown_window, embed, extend_state

  !> Share of its columns or rows by which a window grows on a side, and the fewest that it grows by.
  real(wp), parameter :: growth = 0.25_wp
  integer, parameter :: fewest = 4

contains

  !> Return a window with more nodes on each side that a contact reaches.
  pure type(lattice_t) function grown_window(lattice, contact) result(larger)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Nodes in contact (n_col, n_row)
    logical, intent(in) :: contact(:, :)

    larger = grown_on(lattice, [any(contact(1, :)), any(contact(:, 1)), any(contact(size(contact, 1), :)), &
                                any(contact(:, size(contact, 2)))])
  end function grown_window

  !> Return a window as `grown_window` for a contact whose rows several ranks share.
  type(lattice_t) function shared_grown_window(lattice, contact, space) result(larger)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Nodes in contact (n_col, own rows)
    logical, intent(in) :: contact(:, :)
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    integer :: reached(4)

    associate (own => space%own_rows(lattice%extent(2)))
      reached = merge(1, 0, [any(contact(1, :)), any(contact(:, 1)) .and. own(1) == 1, any(contact(size(contact, 1), :)), &
                             any(contact(:, size(contact, 2))) .and. own(2) == lattice%extent(2)])
    end associate
    call space%ranks%add_counts(reached)
    larger = grown_on(lattice, reached > 0)
  end function shared_grown_window

  !> Return a window with more nodes at the left, lower, right and upper side.
  pure type(lattice_t) function grown_on(lattice, sides) result(larger)
    type(lattice_t), intent(in) :: lattice
    logical, intent(in) :: sides(4)
    integer :: more(2), low(2), high(2)

    more = max(fewest, ceiling(growth*lattice%extent))
    low = merge(more, 0, sides(:2))
    high = merge(more, 0, sides(3:))
    larger = lattice
    larger%first = lattice%first - low
    larger%extent = lattice%extent + low + high
  end function grown_on

  !> Put a field of a smaller window on a larger one; its new nodes have 0.
  pure subroutine embed(lattice, larger, field)
    !> The smaller and the larger window
    type(lattice_t), intent(in) :: lattice, larger
    !> The field (n_col, n_row)
    real(wp), allocatable, intent(inout) :: field(:, :)
    real(wp), allocatable :: small(:, :)
    integer :: low(2), high(2)

    if (.not. allocated(field)) return
    call move_alloc(field, small)
    low = lattice%first - larger%first + 1
    high = low + lattice%extent - 1
    allocate (field(larger%extent(1), larger%extent(2)), source=0.0_wp)
    field(low(1):high(1), low(2):high(2)) = small
  end subroutine embed

  !> Extend a state of a smaller window to that of a solver.
  subroutine extend_state(solver, lattice, state, extended, error)
    !> Method on the larger window
    class(friction_solver_t), intent(inout) :: solver
    !> The smaller window
    type(lattice_t), intent(in) :: lattice
    !> State there
    type(contact_state_t), intent(in) :: state
    !> State on the larger window
    type(contact_state_t), intent(out) :: extended
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: moved(:, :, :)
    integer :: low(2), high(2)

    low = lattice%first - solver%problem%lattice%first + 1
    high = low + lattice%extent - 1
    extended = state
    deallocate (extended%pressure, extended%gap, extended%zone, extended%traction, extended%relative_displacement, &
                extended%accumulated_slip, extended%dissipation_density)
    if (allocated(extended%slip_increment)) deallocate (extended%slip_increment)
    call add_fields(extended, solver%problem%lattice, solver%problem%space)
    call add_history(extended)
    extended%pressure(low(1):high(1), low(2):high(2)) = state%pressure
    extended%traction(low(1):high(1), low(2):high(2), :) = state%traction
    extended%gap = solver%problem%initial_gap
    if (any(state%pressure > 0.0_wp) .or. any(abs(state%motion) > 0.0_wp)) then
      allocate (moved(size(extended%gap, 1), size(extended%gap, 2), 3))
      call solver%displacements(extended%pressure, extended%traction, moved, error)
      if (allocated(error)) return
      extended%gap = extended%gap + (moved(:, :, 1) - state%motion(normal))
      extended%relative_displacement = moved(:, :, 2:) - solver%problem%rigid_displacement(state%motion)
    end if
    extended%gap(low(1):high(1), low(2):high(2)) = state%gap
    where (.not. solver%problem%candidate) extended%gap = 0.0_wp
    extended%zone(low(1):high(1), low(2):high(2)) = state%zone
    extended%relative_displacement(low(1):high(1), low(2):high(2), :) = state%relative_displacement
    extended%accumulated_slip(low(1):high(1), low(2):high(2)) = state%accumulated_slip
    extended%dissipation_density(low(1):high(1), low(2):high(2)) = state%dissipation_density
    extended%clipped = .false.
  end subroutine extend_state

end module hc_window_growth
