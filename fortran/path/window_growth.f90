!> Windows that grow with the contact: a larger one, and states on it.
!>
!> The nodes of a window stay those of the larger one. Where nothing was solved before, gap and relative displacement follow
!> from the tractions and the rigid motions, and nothing has slipped.
module hc_window_growth
  use hc_precision, only: wp, zk
  use hc_error, only: error_t
  use hc_lattice, only: lattice_t
  use hc_field_space, only: field_space_t
  use hc_contact_state, only: contact_state_t, add_fields, add_history, normal
  use hc_contact_solver, only: friction_solver_t
  implicit none
  private

  public :: grown_window, embed, extend_state

  !> Share of its columns or rows by which a window grows on a side, and the fewest that it grows by.
  real(wp), parameter :: growth = 0.25_wp
  integer, parameter :: fewest = 4

contains

  !> Return a window with more nodes on each side that a contact reaches.
  type(lattice_t) function grown_window(lattice, contact, space) result(larger)
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
  end function grown_window

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
  subroutine embed(lattice, larger, space, field)
    !> The smaller and the larger window
    type(lattice_t), intent(in) :: lattice, larger
    !> Space of the fields of the larger window
    type(field_space_t), intent(in) :: space
    !> The field (n_col, own rows)
    real(wp), allocatable, intent(inout) :: field(:, :)
    real(wp), allocatable :: grown(:, :)

    if (.not. allocated(field)) return
    associate (n => space%own_extent(larger%extent))
      allocate (grown(n(1), n(2)), source=0.0_wp)
    end associate
    call put(lattice, larger, space, field, grown)
    call move_alloc(grown, field)
  end subroutine embed

  !> Set a field at the nodes of a smaller window.
  subroutine put(lattice, larger, space, field, grown)
    !> The smaller and the larger window, and space of the fields of this one
    type(lattice_t), intent(in) :: lattice, larger
    type(field_space_t), intent(in) :: space
    !> Field there (n_col, own rows of the smaller window), and on the larger one (n_col, own rows)
    real(wp), intent(in), contiguous :: field(:, :)
    real(wp), intent(inout), contiguous :: grown(:, :)
    type(field_space_t) :: before
    real(wp), allocatable :: rows(:, :)
    integer :: low(2), own(2), wanted(2)

    before%ranks = space%ranks%over(lattice%extent)
    low = lattice%first - larger%first
    own = space%own_rows(larger%extent(2))
    ! own rows of the larger window that the smaller one has
    wanted = [max(own(1), low(2) + 1), min(own(2), low(2) + lattice%extent(2))]
    allocate (rows(lattice%extent(1), max(wanted(2) - wanted(1) + 1, 0)))
    call before%fetch(lattice%extent(2), field, wanted(1) - low(2), rows)
    grown(low(1) + 1:low(1) + size(rows, 1), wanted(1) - own(1) + 1:wanted(1) - own(1) + size(rows, 2)) = rows
  end subroutine put

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
    real(wp), allocatable :: moved(:, :, :), zone(:, :)
    integer :: m

    extended = state
    deallocate (extended%pressure, extended%gap, extended%zone, extended%traction, extended%relative_displacement, &
                extended%accumulated_slip, extended%dissipation_density)
    if (allocated(extended%slip_increment)) deallocate (extended%slip_increment)
    associate (problem => solver%problem)
      call add_fields(extended, problem%lattice, problem%space)
      call add_history(extended)
      call put_field(state%pressure, extended%pressure)
      do m = 1, 2
        call put_field(state%traction(:, :, m), extended%traction(:, :, m))
      end do
      extended%gap = problem%initial_gap
      if (problem%space%max(extended%pressure) > 0.0_wp .or. any(abs(state%motion) > 0.0_wp)) then
        allocate (moved(size(extended%gap, 1), size(extended%gap, 2), 3))
        call solver%displacements(extended%pressure, extended%traction, moved, error)
        if (allocated(error)) return
        extended%gap = extended%gap + (moved(:, :, 1) - state%motion(normal))
        extended%relative_displacement = moved(:, :, 2:) - problem%rigid_displacement(state%motion)
        deallocate (moved)
      end if
      call put_field(state%gap, extended%gap)
      where (.not. problem%candidate) extended%gap = 0.0_wp
      allocate (zone, source=0.0_wp*extended%gap)
      call put_field(real(state%zone, wp), zone)
      extended%zone = nint(zone, zk)
      do m = 1, 2
        call put_field(state%relative_displacement(:, :, m), extended%relative_displacement(:, :, m))
      end do
      call put_field(state%accumulated_slip, extended%accumulated_slip)
      call put_field(state%dissipation_density, extended%dissipation_density)
    end associate
    extended%clipped = .false.

  contains

    !> Set a field at the nodes of the smaller window.
    subroutine put_field(field, grown)
      real(wp), intent(in), contiguous :: field(:, :)
      real(wp), intent(inout), contiguous :: grown(:, :)

      call put(lattice, solver%problem%lattice, solver%problem%space, field, grown)
    end subroutine put_field

  end subroutine extend_state

end module hc_window_growth
