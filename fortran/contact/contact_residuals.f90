!> Residuals of the contact conditions; dimensionless.
!>
!> Equations: docs/theory/residuals.md, (R1) to (R4).
module hc_contact_residuals
  use, intrinsic :: iso_fortran_env, only: int64
  use hc_precision, only: wp
  use hc_lattice, only: lattice_t
  use hc_field_space, only: field_space_t
  use hc_elastic_medium, only: elastic_medium_t, influence_t, n_block, block_index
  use hc_friction_law, only: friction_law_t
  use hc_normal_law, only: normal_law_t, unilateral_t
  implicit none
  private

  public :: normal_self_compliance, tangential_self_compliance, tangential_compliances, largest_compliance
  public :: normal_residual, tangential_residual, tangential_scale, force_residual, relative, least_traction

  !> Without slip: the least shear traction that residuals refer to, over the largest pressure.
  real(wp), parameter :: least_traction = 1.0e-3_wp
  !> Of the bits of a number, shifted by one: all but the sign, the last one of the exponent, and the one above it
  integer, parameter :: above = 62
  integer(int64), parameter :: no_sign = 2_int64**above - 1, one_more = 2_int64**51

contains

  !> Compute the closing d_n of the gap at a node under its own pyramid of unit pressure [m/Pa].
  real(wp) function normal_self_compliance(lattice, medium)
    !> Lattice
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    class(influence_t), allocatable :: influence
    real(wp) :: own(1)

    call medium%new_influence(lattice%basis, influence)
    call influence%closing([0.0_wp], [0.0_wp], own)
    normal_self_compliance = own(1)
  end function normal_self_compliance

  !> Compute the tangential displacement d_t of a node under its own pyramid of unit traction, with its spring [m/Pa].
  real(wp) function tangential_self_compliance(lattice, medium)
    !> Lattice
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    real(wp) :: own(1, 1, 3)

    own = tangential_compliances(lattice, medium, 0)
    tangential_self_compliance = largest_compliance(own(1, 1, :))
  end function tangential_self_compliance

  !> Return the largest eigenvalue of the tangential compliances of a node [m/Pa].
  !>
  !> On half-spaces (lambda_1 + lambda_5/2) K1(0) on the equilateral lattice, where K_xx(0) = K1(0)/2 and all directions are alike
  !> but for rounding errors.
  pure real(wp) function largest_compliance(own)
    !> Along x, across, along y [m/Pa]
    real(wp), intent(in) :: own(3)
    real(wp), parameter :: rounding = 16.0_wp*epsilon(1.0_wp)

    largest_compliance = own(1)
    associate (half => 0.5_wp*(own(1) - own(3)))
      if (max(abs(half), abs(own(2))) > rounding*own(1)) largest_compliance = 0.5_wp*(own(1) + own(3)) + hypot(half, own(2))
    end associate
  end function largest_compliance

  !> Compute the tangential displacements of the nodes around a pyramid of unit traction, with the spring of its node if there
  !> is one: along x under a traction along x, across, and along y under one along y [m/Pa].
  function tangential_compliances(lattice, medium, reach) result(compliance)
    !> Lattice
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> Columns and rows on each side
    integer, intent(in) :: reach
    real(wp) :: compliance(-reach:reach, -reach:reach, 3)
    class(influence_t), allocatable :: influence
    real(wp) :: block(n_block, 1), at(2)
    integer :: i, j

    call medium%new_influence(lattice%basis, influence)
    do j = 0, reach
      do i = -reach, reach
        at = matmul(lattice%basis, real([i, j], wp))
        call influence%blocks(at(1:1), at(2:2), block)
        compliance(i, j, :) = block([block_index(2, 2), block_index(2, 3), block_index(3, 3)], 1)
        compliance(-i, -j, :) = compliance(i, j, :)
      end do
    end do
    compliance(0, 0, [1, 3]) = compliance(0, 0, [1, 3]) + medium%spring_compliance()
  end function tangential_compliances

  !> Compute R_n = max |p - max(0, p - g/d_n)|/p_max over all candidate nodes, or that of another law.
  !>
  !> Bounds tension, penetration and pressure across a gap at once. Without
  !> pressure anywhere the penetration is all there can be: it is 0 if the gap is nowhere
  !> negative, and else infinite; so it is where a number is not finite, which a maximum would hide.
  real(wp) function normal_residual(pressure, gap, candidate, compliance, space, law)
    !> Pressure [Pa] and gap [m]
    real(wp), intent(in), contiguous :: pressure(:, :), gap(:, :)
    !> Nodes that may come into contact
    logical, intent(in), contiguous :: candidate(:, :)
    !> Self-compliance d_n [m/Pa]
    real(wp), intent(in) :: compliance
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Law of contact; absent: unilateral contact
    class(normal_law_t), intent(in), optional :: law
    type(unilateral_t) :: unilateral
    real(wp) :: g(size(pressure, 1)), p_max, worst
    real(wp) :: largest(3)
    integer(int64) :: found
    integer :: col, row, first
    logical :: wrong

    p_max = 0.0_wp
    worst = 0.0_wp
    wrong = .false.
    !$omp parallel do schedule(static) num_threads(space%threads) private(col, first, g, found) reduction(max: p_max, worst) &
    !$omp& reduction(.or.: wrong)
    do row = 1, size(pressure, 2)
      ! a comparison with NaN may be trapped: numbers are not finite where one more overflows the exponent
      found = 0_int64
      !$omp simd reduction(ior: found)
      do col = 1, size(pressure, 1)
        g(col) = merge(gap(col, row), 0.0_wp, candidate(col, row))
        found = ior(found, iand(shiftr(transfer(g(col), found), 1), no_sign) + one_more)
        found = ior(found, iand(shiftr(transfer(pressure(col, row), found), 1), no_sign) + one_more)
      end do
      wrong = wrong .or. btest(found, above)
      if (btest(found, above)) cycle
      !$omp simd reduction(max: p_max)
      do col = 1, size(pressure, 1)
        p_max = max(p_max, pressure(col, row))
      end do
      first = (row - 1)*size(pressure, 1) + 1
      if (present(law)) then
        call law%violation(first, compliance, pressure(:, row), g, candidate(:, row), worst)
      else
        call unilateral%violation(first, compliance, pressure(:, row), g, candidate(:, row), worst)
      end if
    end do
    !$omp end parallel do
    largest = [p_max, worst, merge(1.0_wp, 0.0_wp, wrong)]
    call space%most(largest)
    p_max = largest(1)
    worst = largest(2)
    if (largest(3) > 0.0_wp) then
      normal_residual = huge(1.0_wp)
    else if (p_max > 0.0_wp) then
      normal_residual = worst/p_max
    else
      normal_residual = merge(0.0_wp, huge(1.0_wp), worst <= 0.0_wp)
    end if
  end function normal_residual

  !> Compute R_t = max |q - P(q - ds/d_t)|/tau over the nodes in contact, P the projection on the cone.
  !>
  !> Bounds tractions outside of the cone, slip in stick and a wrong direction
  !> of slip at once. The scale tau is mu p_max; the largest traction, but
  !> not less than a thousandth of p_max, without slip; 0 without friction.
  real(wp) function tangential_residual(traction, slip_increment, pressure, friction, compliance, space)
    !> Traction (n_col, n_row, 2) [Pa] and slip of the step (n_col, n_row, 2) [m]
    real(wp), intent(in), contiguous :: traction(:, :, :), slip_increment(:, :, :)
    !> Pressure (n_col, n_row) [Pa]
    real(wp), intent(in), contiguous :: pressure(:, :)
    !> Law of friction
    class(friction_law_t), intent(in) :: friction
    !> Self-compliance d_t [m/Pa]
    real(wp), intent(in) :: compliance
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    real(wp) :: p_max, largest, worst, most(2)
    integer :: row

    tangential_residual = 0.0_wp
    p_max = space%max(pressure)
    if (.not. (p_max > 0.0_wp .and. friction%resists())) return
    largest = 0.0_wp
    worst = 0.0_wp
    !$omp parallel do schedule(static) num_threads(space%threads) reduction(max: largest, worst)
    do row = 1, size(pressure, 2)
      call friction%violation((row - 1)*size(pressure, 1) + 1, 1.0_wp/p_max, 1.0_wp/compliance, pressure(:, row), &
                              traction(:, row, 1), traction(:, row, 2), slip_increment(:, row, 1), slip_increment(:, row, 2), &
                              largest, worst)
    end do
    !$omp end parallel do
    most = [largest, worst]
    call space%most(most)
    tangential_residual = sqrt(most(2))/tangential_scale(friction, p_max, most(1))
  end function tangential_residual

  !> Compute the scale tau of R_t over p_max.
  pure real(wp) function tangential_scale(friction, p_max, largest)
    !> Law of friction
    class(friction_law_t), intent(in) :: friction
    !> Largest pressure [Pa]
    real(wp), intent(in) :: p_max
    !> Square of the largest traction over p_max
    real(wp), intent(in) :: largest

    if (friction%is_bounded()) then
      tangential_scale = friction%strength(p_max)
    else
      tangential_scale = max(sqrt(largest), least_traction)
    end if
  end function tangential_scale

  !> Compute R_P = |sum A_p p - P|/P; without a load any pressure at all is as wrong as a load that is not carried.
  elemental real(wp) function force_residual(carried, load)
    !> Load carried by the pressure, and prescribed load [N]
    real(wp), intent(in) :: carried, load

    if (load > 0.0_wp) then
      force_residual = abs(carried - load)/load
    else
      force_residual = merge(1.0_wp, 0.0_wp, abs(carried) > 0.0_wp)
    end if
  end function force_residual

  !> Return a missing load relative to a scale; huge if the scale vanishes and the load does not.
  elemental real(wp) function relative(missing, scale)
    real(wp), intent(in) :: missing, scale

    if (missing <= 0.0_wp) then
      relative = 0.0_wp
    else if (scale > 0.0_wp) then
      relative = missing/scale
    else
      relative = huge(1.0_wp)
    end if
  end function relative

end module hc_contact_residuals
