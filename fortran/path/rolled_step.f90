!> A load step of rolling bodies: one spacing, or the steady state.
!>
!> Equations: docs/theory/rolling.md, (K2) to (K4), (K6), (K7).
module hc_rolled_step
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_rolling, only: rolling_t
  use hc_contact_state, only: contact_state_t, load_target_t, force_control, stick, along_x, along_y, about_z
  use hc_contact_problem, only: friction_problem_t
  implicit none
  private

  public :: check_rolling, begin_rolling, add_rolled_slip

contains

  !> Refuse a prescribed torque with a creepage across the direction of rolling: the spin turns about a point half a spacing
  !> behind, and the creepage there is known once the spin is.
  pure subroutine check_rolling(problem, target, error)
    type(friction_problem_t), intent(in) :: problem
    !> Loads or creepages
    type(load_target_t), intent(in) :: target
    !> Allocated if it is refused
    type(error_t), allocatable, intent(out) :: error

    if (.not. target%rolling%rolls() .or. target%control(about_z) /= force_control) return
    if (any(target%control(along_x:along_y) /= force_control .and. is_across(problem, target%rolling))) then
      call raise(error, status%invalid_input, 'the torque of rolling bodies: a tangential load across the direction of '// &
                 'rolling expected, and no creepage')
    end if
  end subroutine check_rolling

  !> Return whether x and y have a part across the direction of rolling.
  pure function is_across(problem, rolling)
    type(friction_problem_t), intent(in) :: problem
    type(rolling_t), intent(in) :: rolling
    logical :: is_across(2)
    real(wp) :: by(2)

    by = rolling%spacing(problem%lattice)
    is_across = abs([by(2), by(1)]) > sqrt(epsilon(1.0_wp))*norm2(by)
  end function is_across

  !> Set shifts and twist over a spacing from creepages, and the displacement that slip counts from: that of the step before at
  !> the node ahead, (K3); nothing in the steady state, (K4).
  subroutine begin_rolling(problem, state, target, ahead)
    type(friction_problem_t), intent(in) :: problem
    !> State at the beginning of the step
    type(contact_state_t), intent(in) :: state
    !> Loads or creepages; then loads or motions
    type(load_target_t), intent(inout) :: target
    !> The displacement (n_col, n_row, 2) [m]
    real(wp), allocatable, intent(out) :: ahead(:, :, :)
    real(wp) :: creepage(3)
    integer :: m

    creepage = merge(0.0_wp, target%value(along_x:about_z), target%control(along_x:about_z) == force_control)
    associate (value => target%value(along_x:about_z), free => target%control(along_x:about_z) == force_control)
      value = merge(value, target%rolling%motions(problem%lattice, creepage), free)
    end associate
    ahead = state%relative_displacement
    if (target%rolling%steady) then
      ahead = 0.0_wp
      return
    end if
    ahead = ahead + problem%rigid_displacement(state%motion)
    do m = 1, 2
      ahead(:, :, m) = shifted(problem, target%rolling, ahead(:, :, m))
    end do
  end subroutine begin_rolling

  !> Add slip path and dissipated energy of the way over a spacing, which move on with the surfaces; in the steady state they
  !> are summed along the way of a point through the contact.
  subroutine add_rolled_slip(problem, before, rolling, state)
    type(friction_problem_t), intent(in) :: problem
    !> State at the beginning of the step
    type(contact_state_t), intent(in) :: before
    type(rolling_t), intent(in) :: rolling
    !> State at its end
    type(contact_state_t), intent(inout) :: state
    real(wp) :: spent, stored

    state%accumulated_slip = norm2(state%slip_increment, dim=3)
    state%dissipation_density = merge(0.0_wp, -sum(state%traction*state%slip_increment, dim=3), state%zone == stick)
    spent = problem%lattice%cell_area()*problem%space%sum(state%dissipation_density)
    state%dissipated_energy = before%dissipated_energy
    state%path_error = before%path_error
    if (rolling%steady) then
      call rolling%sum_behind(state%accumulated_slip)
      call rolling%sum_behind(state%dissipation_density)
    else
      state%accumulated_slip = shifted(problem, rolling, before%accumulated_slip) + state%accumulated_slip
      state%dissipation_density = shifted(problem, rolling, before%dissipation_density) + state%dissipation_density
      state%dissipated_energy = before%dissipated_energy + spent
    end if
    state%creepage = rolling%creepages(problem%lattice, state%motion(along_x:about_z))
    state%creep_power = -dot_product(state%load(along_x:about_z), state%creepage)
    state%slip_power = spent/norm2(rolling%spacing(problem%lattice))
    if (problem%medium%couples()) return
    if (rolling%steady) then
      stored = 0.0_wp
    else
      stored = shear_energy(problem, state) - shear_energy(problem, before)
    end if
    ! (K7); with a spin the power at the nodes differs from that half a spacing ahead
    associate (taken => dot_product(state%load(along_x:about_z), state%motion(along_x:about_z)), &
               by => norm2(rolling%spacing(problem%lattice)))
      state%creep_power_error = abs(taken - spent - stored)/by + abs(state%creep_power - taken/by)
    end associate
  end subroutine add_rolled_slip

  !> Return the values of the nodes ahead, also of those in rows of other ranks.
  function shifted(problem, rolling, field)
    type(friction_problem_t), intent(in) :: problem
    type(rolling_t), intent(in) :: rolling
    !> Field (n_col, own rows)
    real(wp), intent(in), contiguous :: field(:, :)
    real(wp), allocatable :: shifted(:, :), near(:, :)
    integer :: own(2), first, last

    associate (n_row => problem%lattice%extent(2))
      own = problem%space%own_rows(n_row)
      first = max(own(1) - 1, 1)
      last = min(own(2) + 1, n_row)
      allocate (near(size(field, 1), last - first + 1))
      call problem%space%fetch(n_row, field, first, near)
      near = rolling%shifted(near)
      shifted = near(:, own(1) - first + 1:own(2) - first + 1)
    end associate
  end function shifted

  !> Return the elastic energy of the shear tractions of similar bodies [J].
  real(wp) function shear_energy(problem, state)
    type(friction_problem_t), intent(in) :: problem
    type(contact_state_t), intent(in) :: state

    shear_energy = 0.5_wp*problem%lattice%cell_area() &
                   *problem%space%sum(sum(state%traction*(state%relative_displacement &
                                                          + problem%rigid_displacement(state%motion)), dim=3))
  end function shear_energy

end module hc_rolled_step
