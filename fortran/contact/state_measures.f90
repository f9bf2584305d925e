!> What a state says besides its fields: residuals node by node, energy, extent of a zone.
!>
!> Equations: docs/theory/residuals.md, (R1) to (R3).
module hc_state_measures
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_quiet_nan, ieee_value
  use hc_precision, only: wp
  use hc_lattice, only: lattice_t
  use hc_elastic_pair, only: elastic_pair_t
  use hc_contact_state, only: contact_state_t, separated, normal, along_x, along_y, about_z
  use hc_contact_residuals, only: normal_self_compliance, tangential_self_compliance, tangential_scale
  use hc_friction_law, only: friction_law_t
  implicit none
  private

  public :: nodal_normal_residual, nodal_tangential_residual, elastic_energy, zone_extent

contains

  !> |p - max(0, p - g/d_n)|/p_max at the nodes: what R_n is the largest value of. 0 where the gap is not finite.
  pure function nodal_normal_residual(lattice, pair, state) result(residual)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Elastic constants of the two bodies
    type(elastic_pair_t), intent(in) :: pair
    !> State with pressure somewhere; its pressure and gap count
    type(contact_state_t), intent(in) :: state
    real(wp) :: residual(size(state%pressure, 1), size(state%pressure, 2))
    real(wp) :: compliance
    integer :: col, row

    compliance = normal_self_compliance(lattice, pair)
    residual = 0.0_wp
    do row = 1, size(residual, 2)
      do col = 1, size(residual, 1)
        associate (p => state%pressure(col, row), g => state%gap(col, row))
          if (ieee_is_finite(g)) residual(col, row) = abs(min(p, g/compliance))
        end associate
      end do
    end do
    residual = residual/maxval(state%pressure)
  end function nodal_normal_residual

  !> |q - P(q - ds/d_t)|/tau at the nodes in contact, P the projection on the cone: what R_t is the largest value of.
  pure function nodal_tangential_residual(lattice, pair, friction, state) result(residual)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Elastic constants of the two bodies
    type(elastic_pair_t), intent(in) :: pair
    !> Law of friction
    class(friction_law_t), intent(in) :: friction
    !> State with pressure somewhere; its pressure, traction and slip increment count
    type(contact_state_t), intent(in) :: state
    real(wp) :: residual(size(state%pressure, 1), size(state%pressure, 2))
    real(wp) :: unit, stiffness, largest
    integer :: col, row

    residual = 0.0_wp
    if (.not. friction%resists()) return
    unit = 1.0_wp/maxval(state%pressure)
    stiffness = 1.0_wp/tangential_self_compliance(lattice, pair)
    largest = 0.0_wp
    do row = 1, size(residual, 2)
      do col = 1, size(residual, 1)
        if (state%pressure(col, row) <= 0.0_wp) cycle
        associate (node => [state%pressure(col, row), state%traction(col, row, :), state%slip_increment(col, row, :)])
          call friction%violation((row - 1)*size(residual, 1) + col, unit, stiffness, node(1:1), node(2:2), node(3:3), &
                                  node(4:4), node(5:5), largest, residual(col, row))
        end associate
      end do
    end do
    residual = sqrt(residual)/tangential_scale(friction, largest)
  end function nodal_tangential_residual

  !> U = sum A_p (p w + q . (u_1 - u_2))/2 with w = g - g_0 + approach and u_1 - u_2 = s + shift + twist x r [J].
  pure real(wp) function elastic_energy(lattice, initial_gap, state) result(energy)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Gap before loading (n_col, n_row) [m]
    real(wp), intent(in) :: initial_gap(:, :)
    !> State, with friction or without
    type(contact_state_t), intent(in) :: state
    real(wp), allocatable :: x(:, :), y(:, :)
    real(wp) :: moved(2)
    integer :: col, row

    allocate (x(size(initial_gap, 1), size(initial_gap, 2)), y(size(initial_gap, 1), size(initial_gap, 2)))
    call lattice%coordinates(x, y)
    energy = 0.0_wp
    do row = 1, size(initial_gap, 2)
      do col = 1, size(initial_gap, 1)
        if (state%zone(col, row) == separated) cycle
        energy = energy + state%pressure(col, row)*(state%gap(col, row) - initial_gap(col, row) + state%motion(normal))
        if (.not. allocated(state%traction)) cycle
        moved = state%relative_displacement(col, row, :) + state%motion([along_x, along_y]) &
                + state%motion(about_z)*[-y(col, row), x(col, row)]
        energy = energy + dot_product(state%traction(col, row, :), moved)
      end do
    end do
    energy = 0.5_wp*lattice%cell_area()*energy
  end function elastic_energy

  !> Center of area of a zone, and smallest and largest coordinates of its nodes; NaN if there are none [m].
  pure subroutine zone_extent(x, y, zone, center, lower, upper)
    !> Coordinates of the nodes [m]
    real(wp), intent(in) :: x(:, :), y(:, :)
    !> Nodes of the zone
    logical, intent(in) :: zone(:, :)
    !> Mean, smallest and largest x and y
    real(wp), intent(out) :: center(2), lower(2), upper(2)

    center = ieee_value(1.0_wp, ieee_quiet_nan)
    lower = center
    upper = center
    if (.not. any(zone)) return
    center = [sum(x, mask=zone), sum(y, mask=zone)]/count(zone)
    lower = [minval(x, mask=zone), minval(y, mask=zone)]
    upper = [maxval(x, mask=zone), maxval(y, mask=zone)]
  end subroutine zone_extent

end module hc_state_measures
