!> The state of a contact: tractions, gap, zones and rigid motion over a window.
module hc_contact_state
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_lattice, only: lattice_t
  implicit none
  private

  public :: contact_state_t, new_contact_state, check_problem
  public :: separated, stick, slip
  public :: load_control, approach_control

  !> Zone of a node; without friction every node in contact slips.
  integer, parameter :: separated = 0, stick = 1, slip = 2

  !> What is prescribed along z: the normal load, or the approach.
  integer, parameter :: load_control = 1, approach_control = 2

  !> A solution and how well it fulfils the contact conditions.
  type :: contact_state_t
    !> Pressure and gap (n_col, n_row) [Pa], [m]
    real(wp), allocatable :: pressure(:, :), gap(:, :)
    !> Zone of each node (n_col, n_row)
    integer, allocatable :: zone(:, :)
    !> Normal load, the sum of the pressure times the cell area [N]
    real(wp) :: normal_load = 0.0_wp
    !> Approach of the remote parts [m]
    real(wp) :: approach = 0.0_wp
    !> Residual of the contact conditions along the normal
    real(wp) :: residual_normal = huge(1.0_wp)
    !> Residual of the normal load; 0 where the approach is prescribed
    real(wp) :: residual_force = huge(1.0_wp)
    !> Both residuals are within the tolerance
    logical :: converged = .false.
    !> Active sets that were tried on the finest lattice
    integer :: sweeps = 0
    !> Work, in applications of the full operator on the finest lattice
    real(wp) :: operator_applications = 0.0_wp
  end type contact_state_t

contains

  !> A state without contact.
  pure subroutine new_contact_state(state, lattice)
    !> State to be set up
    type(contact_state_t), intent(out) :: state
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice

    allocate (state%pressure(lattice%extent(1), lattice%extent(2)), source=0.0_wp)
    allocate (state%gap, source=state%pressure)
    allocate (state%zone(lattice%extent(1), lattice%extent(2)), source=separated)
  end subroutine new_contact_state

  !> Does a problem make sense?
  pure subroutine check_problem(lattice, initial_gap, candidate, error)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Initial gap (n_col, n_row) [m]
    real(wp), intent(in) :: initial_gap(:, :)
    !> Nodes that may come into contact (n_col, n_row)
    logical, intent(in) :: candidate(:, :)
    !> Allocated on failure: wrong shapes, no candidate at all
    type(error_t), allocatable, intent(out) :: error

    if (any(shape(initial_gap) /= lattice%extent) .or. any(shape(candidate) /= lattice%extent)) then
      call raise(error, status%invalid_input, 'the initial gap does not have the shape of the lattice window')
    else if (.not. any(candidate)) then
      call raise(error, status%invalid_input, 'no node of the window may come into contact')
    end if
  end subroutine check_problem

end module hc_contact_state
