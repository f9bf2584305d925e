!> Wear of the surfaces by fretting cycles, of which one stands for many.
!>
!> A cycle of the loads is solved on the worn gap. Its wear is multiplied by the number of cycles in the jump, (V3), with
!> the pressure at the end of the jump (hc_wear_ahead). Two jumps of n cycles are compared with one of 2 n, (V6); the difference
!> gives the size of the next jump (hc_step_control) and corrects the second one, (V5), which makes the two of
!> second order:
!>
!>     call energy_ahead(cycle, ..., cycles, ..., energy)
!>     call wear_by(energy, coefficient, friction, cycles, depth)
!>     call jump_change(lattice, medium, law, two_jumps_t(energy, that of the second jump, that of one jump of both, cycles), ...)
!>
!> Equations: docs/theory/wear.md, (V1) to (V6), (V9).
module hc_wear_jumps
  use hc_precision, only: wp, sp, lk
  use hc_options, only: step_options_t
  use hc_elastic_medium, only: elastic_medium_t
  use hc_lattice, only: lattice_t
  use hc_field_space, only: field_space_t
  use hc_contact_residuals, only: normal_self_compliance
  use hc_step_error, only: step_change_t
  implicit none
  private

  public :: wear_law_t, two_jumps_t, archard_depth, wear_by, wear_left, jump_change, energy_of_second_jump, expect_end, remember_end

  !> How much of the surfaces friction wears off.
  type :: wear_law_t
    !> Coefficient of wear of both bodies together, k [m^2/N]
    real(wp) :: coefficient = 0.0_wp
    !> Coefficient of friction (n_col, n_row)
    real(wp), allocatable :: friction(:, :)
  end type wear_law_t

  !> Two equal jumps, and one that is as long as both.
  type :: two_jumps_t
    !> Energy by area of each cycle in the first and the second jump, and in the long one (n_col, n_row) [J/m^2]
    real(wp), allocatable :: first(:, :), second(:, :), both(:, :)
    !> Cycles of each of the two
    real(wp) :: cycles = 0.0_wp
  end type two_jumps_t

contains

  !> Compute the depth that is worn off where friction dissipates an energy, (V2) [m].
  elemental real(wp) function archard_depth(energy, coefficient, friction) result(depth)
    !> Dissipated energy by area [J/m^2]
    real(wp), intent(in) :: energy
    !> Coefficient of wear of both bodies together, k [m^2/N]
    real(wp), intent(in) :: coefficient
    !> Coefficient of friction
    real(wp), intent(in) :: friction

    depth = 0.0_wp
    if (friction > 0.0_wp) depth = coefficient*energy/friction
  end function archard_depth

  !> Wear the surfaces by cycles that are all alike, (V3).
  pure subroutine wear_by(energy, coefficient, friction, cycles, depth)
    !> Dissipated energy of a cycle by area (n_col, n_row) [J/m^2]
    real(wp), intent(in) :: energy(:, :)
    !> Coefficient of wear [m^2/N]
    real(wp), intent(in) :: coefficient
    !> Coefficient of friction (n_col, n_row)
    real(wp), intent(in) :: friction(:, :)
    !> Number of cycles
    real(wp), intent(in) :: cycles
    !> Worn depth (n_col, n_row) [m]
    real(wp), intent(inout) :: depth(:, :)

    depth = depth + cycles*archard_depth(energy, coefficient, friction)
  end subroutine wear_by

  !> Bound the change of the wear of a cycle by further repetitions, over the largest of a node, (V9).
  !>
  !> Changes fade like 1/n**2 in the n-th repetition, which leaves n times the last one; n follows from the last two. A
  !> geometric series leaves less. Before the third cycle the bound follows from the shear tractions, which are back where
  !> they were when a cycle is closed.
  real(wp) function wear_left(energies, traction, pressure, friction, space) result(left)
    !> Dissipated energy of the last cycles, at most three, by area (n_col, n_row, :) [J/m^2]
    real(wp), intent(in) :: energies(:, :, :)
    !> Shear tractions at the beginning and at the end of the last cycle (n_col, n_row, 2, 2) [Pa]
    real(wp), intent(in) :: traction(:, :, :, :)
    !> Pressure at its end (n_col, n_row) [Pa]
    real(wp), intent(in) :: pressure(:, :)
    !> Coefficient of friction (n_col, n_row)
    real(wp), intent(in) :: friction(:, :)
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    type(step_options_t) :: options
    real(wp), allocatable :: depth(:, :, :)
    real(wp) :: first, last

    associate (n => size(energies, 3))
      left = options%closing_gain*space%sum(norm2(traction(:, :, :, 2) - traction(:, :, :, 1), dim=3)) &
             /max(space%sum(friction*pressure, logical(energies(:, :, n) > 0.0_wp, lk)), tiny(1.0_wp))
      if (n < 3) return
      depth = archard_depth(energies, 1.0_wp, spread(friction, 3, n))
      first = space%max(abs(depth(:, :, n - 1) - depth(:, :, n - 2)))
      last = space%max(abs(depth(:, :, n) - depth(:, :, n - 1)))
      left = options%closing_safety*last/max(space%max(depth(:, :, n)), tiny(1.0_wp)) &
             /(1.0_wp - min(last/max(first, tiny(1.0_wp)), options%slowest_closing))
    end associate
  end function wear_left

  !> Compare two jumps with one of both, (V6): difference of the depth, and its root mean square over the indentation of one node
  !> by the largest pressure, in place of the tractions that a step adds.
  subroutine jump_change(lattice, medium, law, jumps, p_max, slower, change, space)
    !> Lattice
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> How the surfaces wear
    type(wear_law_t), intent(in) :: law
    !> The jumps
    type(two_jumps_t), intent(in) :: jumps
    !> Largest pressure [Pa]
    real(wp), intent(in) :: p_max
    !> Depth by the two jumps less that by one (n_col, n_row) [m]
    real(wp), intent(out) :: slower(:, :)
    !> The change for hc_step_control
    type(step_change_t), intent(out) :: change
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    type(step_options_t) :: options

    associate (first => jumps%first, second => jumps%second, both => jumps%both)
      slower = jumps%cycles*archard_depth((first - both) + (second - both), law%coefficient, law%friction)
      associate (n_wearing => space%count(logical(first > 0.0_wp .or. second > 0.0_wp .or. both > 0.0_wp, lk)))
        if (p_max > 0.0_wp .and. n_wearing > 0) change%added = options%added_share*sqrt(space%sum(slower**2)/n_wearing) &
                                                                /(normal_self_compliance(lattice, medium)*p_max)
      end associate
    end associate
  end subroutine jump_change

  !> Correct the energy by which the second of two equal jumps wears, (V5).
  !>
  !> The correction is at most the indentation of a node by the remaining pressure; the energy is not negative.
  subroutine energy_of_second_jump(lattice, medium, law, jumps, path, corrected)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> How the surfaces wear
    type(wear_law_t), intent(in) :: law
    !> The jumps
    type(two_jumps_t), intent(in) :: jumps
    !> Path of slip of the cycle between the two (n_col, n_row) [m]
    real(wp), intent(in) :: path(:, :)
    !> That of the second jump, corrected (n_col, n_row) [J/m^2]
    real(wp), intent(out) :: corrected(:, :)
    real(wp) :: node, most
    integer :: col, row

    node = normal_self_compliance(lattice, medium)
    associate (first => jumps%first, second => jumps%second, both => jumps%both)
      do row = 1, size(corrected, 2)
        do col = 1, size(corrected, 1)
          corrected(col, row) = second(col, row)
          if (.not. (second(col, row) > 0.0_wp .and. path(col, row) > 0.0_wp .and. jumps%cycles > 0.0_wp)) cycle
          ! d_n p mu/(n k) with p = e/(mu S)
          most = node*second(col, row)/(path(col, row)*jumps%cycles*law%coefficient)
          corrected(col, row) = second(col, row) + min(first(col, row) + second(col, row) - 2.0_wp*both(col, row), most)
          corrected(col, row) = max(corrected(col, row), 0.0_wp)
        end do
      end do
    end associate
  end subroutine energy_of_second_jump

  !> Expect the end of a load step of the next cycle, to start it from: the end in the cycle before, extrapolated linearly in the
  !> cycles. Given the solved load step before it, the pressure is the one there plus the expected change between the two, so that
  !> an error common to both extrapolations cancels. The shear traction, which
  !> turns round in a cycle, is the extrapolated one.
  pure subroutine expect_end(last, ahead, expected, traction, pressure, expected_before)
    !> Pressure and tractions along x and y at the end of the load step (n, 3) [Pa], and their rates by cycle (n, 3)
    real(sp), intent(in) :: last(:, :, :)
    !> Cycles since then
    real(wp), intent(in) :: ahead
    !> Extrapolated pressure [Pa]
    real(sp), intent(out) :: expected(:)
    !> Pressure and tractions to start from (n, 3) [Pa]
    real(wp), intent(out) :: traction(:, :)
    !> Pressure at the end of the load step before, and the extrapolated one there [Pa]
    real(wp), intent(in), optional :: pressure(:)
    real(sp), intent(in), optional :: expected_before(:)
    real(sp) :: cycles
    integer :: i

    cycles = real(ahead, sp)
    do i = 1, size(traction, 1)
      traction(i, :) = last(i, :, 1)
      if (last(i, 1, 1) > 0.0_sp) traction(i, :) = last(i, :, 1) + cycles*last(i, :, 2)
      expected(i) = max(real(traction(i, 1), sp), 0.0_sp)
      traction(i, 1) = expected(i)
      if (.not. present(pressure)) cycle
      traction(i, 1) = max(pressure(i) + (traction(i, 1) - expected_before(i)), 0.0_wp)
      if (.not. traction(i, 1) > 0.0_wp) traction(i, :) = 0.0_wp
    end do
  end subroutine expect_end

  !> Remember tractions at the end of a load step, and how they have changed since the cycle before.
  pure subroutine remember_end(traction, passed, last)
    !> Pressure and tractions along x and y (n, 3) [Pa]
    real(wp), intent(in) :: traction(:, :)
    !> Cycles since those at hand were found, 0: never
    real(wp), intent(in) :: passed
    !> Tractions and their rates by cycle, as in `expect_end`
    real(sp), intent(inout) :: last(:, :, :)

    last(:, :, 2) = 0.0_sp
    if (passed > 0.0_wp) last(:, :, 2) = real((traction - last(:, :, 1))/passed, sp)
    last(:, :, 1) = real(traction, sp)
  end subroutine remember_end

end module hc_wear_jumps
