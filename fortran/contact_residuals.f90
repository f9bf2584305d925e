!> How well a state fulfils the contact conditions; dimensionless.
module hc_contact_residuals
  use hc_precision, only: wp
  use hc_pyramid_influence, only: pyramid_t, new_pyramid, k_1
  use hc_lattice, only: lattice_t
  use hc_elastic_pair, only: elastic_pair_t
  use hc_contact_state, only: contact_state_t, load_control, separated, slip
  implicit none
  private

  public :: normal_self_compliance, normal_residual, force_residual, conclude

contains

  !> Closing of the gap at a node under its own pyramid of unit pressure, lambda_1 K1(0) [m/Pa].
  pure real(wp) function normal_self_compliance(lattice, pair)
    !> Lattice
    type(lattice_t), intent(in) :: lattice
    !> Elastic constants of the two bodies
    type(elastic_pair_t), intent(in) :: pair
    type(pyramid_t) :: pyramid
    real(wp) :: k(5)

    call new_pyramid(pyramid, lattice%basis)
    k = pyramid%kernels(0.0_wp, 0.0_wp)
    normal_self_compliance = pair%lambda_1*k(k_1)
  end function normal_self_compliance

  !> R_n = max |p - max(0, p - g/d_n)|/p_max over all candidate nodes.
  !>
  !> Bounds tension, penetration and pressure across a gap at once. Without
  !> pressure anywhere the penetration is all there can be: it is 0 if the gap is nowhere
  !> negative, and else infinite.
  pure real(wp) function normal_residual(pressure, gap, candidate, compliance)
    !> Pressure [Pa] and gap [m]
    real(wp), intent(in) :: pressure(:, :), gap(:, :)
    !> Nodes that may come into contact
    logical, intent(in) :: candidate(:, :)
    !> Self-compliance d_n [m/Pa]
    real(wp), intent(in) :: compliance
    real(wp) :: p_max, worst
    integer :: row

    p_max = 0.0_wp
    worst = 0.0_wp
    do row = 1, size(pressure, 2)
      p_max = max(p_max, maxval(pressure(:, row)))
      worst = max(worst, maxval(abs(pressure(:, row) - max(0.0_wp, pressure(:, row) - gap(:, row)/compliance)), &
                                mask=candidate(:, row)))
    end do
    if (p_max > 0.0_wp) then
      normal_residual = worst/p_max
    else
      normal_residual = merge(0.0_wp, huge(1.0_wp), worst <= 0.0_wp)
    end if
  end function normal_residual

  !> R_P = |sum A_p p - P|/P.
  elemental real(wp) function force_residual(carried, load)
    !> Load carried by the pressure, and prescribed load [N]
    real(wp), intent(in) :: carried, load

    if (load > 0.0_wp) then
      force_residual = abs(carried - load)/load
    else
      force_residual = abs(carried)
    end if
  end function force_residual

  !> Zones, load and residuals of a state whose pressure and gap are known.
  pure subroutine conclude(state, lattice, candidate, compliance, control, target, tolerance)
    !> State to be completed
    type(contact_state_t), intent(inout) :: state
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Nodes that may come into contact
    logical, intent(in) :: candidate(:, :)
    !> Self-compliance d_n [m/Pa]
    real(wp), intent(in) :: compliance
    !> load_control or approach_control
    integer, intent(in) :: control
    !> Normal load [N] or approach [m] that was prescribed
    real(wp), intent(in) :: target
    !> Bound of the residuals
    real(wp), intent(in) :: tolerance

    state%zone = merge(slip, separated, state%pressure > 0.0_wp)
    state%normal_load = lattice%cell_area()*sum(state%pressure)
    state%residual_normal = normal_residual(state%pressure, state%gap, candidate, compliance)
    state%residual_force = 0.0_wp
    if (control == load_control) state%residual_force = force_residual(state%normal_load, target)
    state%converged = max(state%residual_normal, state%residual_force) <= tolerance
  end subroutine conclude

end module hc_contact_residuals
