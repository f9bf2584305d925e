!> Tangential motions that are driven by their loads.
!>
!> Each is an unknown, and its load a constraint on the shear traction: what
!> the unit motion does along x and y, summed over the traction, is the load. A torque is
!> taken about the middle of the contact, as far as the tangential loads are
!> known too: a contact far from the origin would not tell a twist from a shift.
module hc_driven_motions
  use hc_precision, only: wp, pi
  use hc_contact_state, only: load_target_t, along_x, along_y, about_z, n_motion, force_control
  use hc_friction_problem, only: friction_problem_t
  implicit none
  private

  public :: driven_motions_t, new_driven_motions

  !> The driven motions of a contact.
  type :: driven_motions_t
    !> Some of along_x, along_y, about_z
    integer, allocatable :: motion(:)
    !> Point that a torque is taken about [m]
    real(wp) :: center(2) = 0.0_wp
    !> Unit of length of a twist: the contact radius [m]
    real(wp) :: arm = 1.0_wp
  contains
    !> Tangential displacement of a unit motion
    procedure :: direction, direction_row
    !> Load of a motion over the cell area
    procedure :: load
    !> Multipliers of the constraints from the motions, and back
    procedure :: multipliers, set_motions
  end type driven_motions_t

contains

  !> The driven motions of a contact.
  subroutine new_driven_motions(self, problem, target, contact)
    !> Motions to be set up
    type(driven_motions_t), intent(out) :: self
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target
    !> Nodes in contact (n_col, n_row)
    logical, intent(in) :: contact(problem%lattice%extent(1), problem%lattice%extent(2))
    real(wp) :: part(2, problem%lattice%extent(2))
    integer :: n_contact, row

    n_contact = 0
    !$omp parallel do schedule(static) num_threads(problem%n_threads) reduction(+: n_contact)
    do row = 1, size(contact, 2)
      n_contact = n_contact + count(contact(:, row))
      part(1, row) = sum(problem%x(:, row), mask=contact(:, row))
      part(2, row) = sum(problem%y(:, row), mask=contact(:, row))
    end do
    !$omp end parallel do
    n_contact = max(n_contact, 1)
    associate (control => target%control)
      ! nothing turns a single node
      self%motion = pack([along_x, along_y, about_z], control(along_x:) == force_control .and. &
                         [.true., .true., n_contact > 1])
      if (control(along_y) == force_control) self%center(1) = sum(part(1, :))/n_contact
      if (control(along_x) == force_control) self%center(2) = sum(part(2, :))/n_contact
    end associate
    self%arm = sqrt(problem%lattice%cell_area()*n_contact/pi)
  end subroutine new_driven_motions

  !> Tangential displacement of a unit motion (n_col, n_row, 2).
  function direction(self, k, problem)
    class(driven_motions_t), intent(in) :: self
    !> Which of the driven motions
    integer, intent(in) :: k
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    real(wp), allocatable :: direction(:, :, :)
    integer :: row

    allocate (direction(problem%lattice%extent(1), problem%lattice%extent(2), 2))
    !$omp parallel do schedule(static) num_threads(problem%n_threads)
    do row = 1, size(direction, 2)
      call self%direction_row(k, problem, row, direction(:, row, 1), direction(:, row, 2))
    end do
    !$omp end parallel do
  end function direction

  !> The same along one row of nodes.
  pure subroutine direction_row(self, k, problem, row, ux, uy)
    class(driven_motions_t), intent(in) :: self
    !> Which of the driven motions
    integer, intent(in) :: k
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    integer, intent(in) :: row
    !> Components along x and y (n_col)
    real(wp), intent(out), contiguous :: ux(:), uy(:)

    ux = 0.0_wp
    uy = 0.0_wp
    select case (self%motion(k))
    case (along_x)
      ux = 1.0_wp
    case (along_y)
      uy = 1.0_wp
    case default
      ux = -(problem%y(:, row) - self%center(2))/self%arm
      uy = (problem%x(:, row) - self%center(1))/self%arm
    end select
  end subroutine direction_row

  !> Prescribed load of a motion over the cell area [Pa].
  pure real(wp) function load(self, k, problem, target)
    class(driven_motions_t), intent(in) :: self
    !> Which of the driven motions
    integer, intent(in) :: k
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target

    load = target%value(self%motion(k))
    if (self%motion(k) == about_z) then
      load = (load - self%center(1)*target%value(along_y) + self%center(2)*target%value(along_x))/self%arm
    end if
    load = load/problem%lattice%cell_area()
  end function load

  !> Multipliers that stand for given motions: shifts are those of the center, if it turns.
  pure function multipliers(self, motion) result(multiplier)
    class(driven_motions_t), intent(in) :: self
    !> Approach, shifts and twist
    real(wp), intent(in) :: motion(n_motion)
    real(wp), allocatable :: multiplier(:)

    multiplier = motion(self%motion)
    if (any(self%motion == about_z)) then
      where (self%motion == along_x) multiplier = multiplier - motion(about_z)*self%center(2)
      where (self%motion == along_y) multiplier = multiplier + motion(about_z)*self%center(1)
      where (self%motion == about_z) multiplier = multiplier*self%arm
    end if
  end function multipliers

  !> Motions from their multipliers; the others stay as they are.
  pure subroutine set_motions(self, multiplier, motion)
    class(driven_motions_t), intent(in) :: self
    !> Multipliers of the driven motions
    real(wp), intent(in) :: multiplier(:)
    !> Approach, shifts and twist
    real(wp), intent(inout) :: motion(n_motion)

    motion(self%motion) = multiplier
    if (any(self%motion == about_z)) then
      motion(about_z) = motion(about_z)/self%arm
      if (any(self%motion == along_x)) motion(along_x) = motion(along_x) + motion(about_z)*self%center(2)
      if (any(self%motion == along_y)) motion(along_y) = motion(along_y) - motion(about_z)*self%center(1)
    end if
  end subroutine set_motions

end module hc_driven_motions
