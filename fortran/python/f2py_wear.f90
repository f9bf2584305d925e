!> Wear by fretting cycles for Python: flat procedures for f2py, no mathematics.
module hc_f2py_wear
  use iso_c_binding, only: c_double, c_float, c_int
  use hc_error, only: error_t
  use hc_f2py_handles, only: report, pair_of, normal_law_of, kernel_cache
  use hc_field_space, only: field_space_t, space_over
  use hc_lattice, only: lattice_t, new_lattice
  use hc_memory, only: require_memory
  use hc_step_error, only: step_change_t
  use hc_wear_jumps, only: wear_by, wear_left, jump_change, energy_of_second_jump, expect_end, remember_end
  use hc_wear_ahead, only: worn_cycle_t, energy_ahead, energy_ahead_memory
  implicit none
  private

  public :: wear_of_cycles, wear_left_open, energy_of_jump, change_by_jump, expected_end, remembered_end

contains

  !> Compute depth and volume after cycles that are all alike.
  subroutine wear_of_cycles(n_col, n_row, energy, coefficient, friction, cycles, area, depth, worn, volume, deepest)
    !f2py threadsafe
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Dissipated energy of a cycle by area [J/m^2]
    real(c_double), intent(in) :: energy(n_col, n_row)
    !> Coefficient of wear [m^2/N]
    real(c_double), intent(in) :: coefficient
    !> Coefficient of friction
    real(c_double), intent(in) :: friction(n_col, n_row)
    !> Number of cycles, area of a node [m^2]
    real(c_double), intent(in) :: cycles, area
    !> Depth before and after [m]
    real(c_double), intent(in) :: depth(n_col, n_row)
    real(c_double), intent(out) :: worn(n_col, n_row)
    !> Worn volume [m^3], largest depth [m]
    real(c_double), intent(out) :: volume, deepest

    worn = depth
    call wear_by(energy, coefficient, friction, cycles, area, worn, volume)
    deepest = maxval(worn)
  end subroutine wear_of_cycles

  !> Bound the change of the wear of a cycle by further repetitions.
  subroutine wear_left_open(n_col, n_row, n_cycle, energies, traction, pressure, friction, left)
    !f2py threadsafe
    !> Number of columns, rows and known cycles
    integer(c_int), intent(in) :: n_col, n_row, n_cycle
    !> Dissipated energy of the last cycles by area [J/m^2]
    real(c_double), intent(in) :: energies(n_col, n_row, n_cycle)
    !> Shear tractions at the beginning and at the end of the last one [Pa]
    real(c_double), intent(in) :: traction(n_col, n_row, 2, 2)
    !> Pressure at its end [Pa], coefficient of friction
    real(c_double), intent(in) :: pressure(n_col, n_row), friction(n_col, n_row)
    !> Share of the largest wear of a node
    real(c_double), intent(out) :: left

    left = wear_left(energies, traction, pressure, friction)
  end subroutine wear_left_open

  !> Find the energy of a cycle by which a jump wears.
  subroutine energy_of_jump(n_col, n_row, basis, lambda, interface, energy, path, pressure, gap, candidate, friction, by_load, &
                            coefficient, cycles, tolerance, ahead, code, message)
    !f2py threadsafe
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Basis vectors as columns [m]
    real(c_double), intent(in) :: basis(2, 2)
    !> lambda_1, lambda_2, lambda_5 [1/Pa]
    real(c_double), intent(in) :: lambda(3)
    !> Coefficient [Pa/m^m] and exponent m of the normal compliance, both 0: bodies do not penetrate; tangential stiffness [Pa/m]
    real(c_double), intent(in) :: interface(3)
    !> Dissipated energy by area [J/m^2] and path of slip [m] of a cycle
    real(c_double), intent(in) :: energy(n_col, n_row), path(n_col, n_row)
    !> Pressure [Pa] and gap [m] at its end
    real(c_double), intent(in) :: pressure(n_col, n_row), gap(n_col, n_row)
    !> Not zero where a node may come into contact
    integer(c_int), intent(in) :: candidate(n_col, n_row)
    !> Coefficient of friction
    real(c_double), intent(in) :: friction(n_col, n_row)
    !> Not zero: the normal load is prescribed, not the approach
    integer(c_int), intent(in) :: by_load
    !> Coefficient of wear [m^2/N], cycles of the jump, bound of the residual of the pressure
    real(c_double), intent(in) :: coefficient, cycles, tolerance
    !> Energy by area of each cycle [J/m^2]
    real(c_double), intent(out) :: ahead(n_col, n_row)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(lattice_t) :: lattice
    type(field_space_t) :: space

    ahead = 0.0_c_double
    call new_lattice(lattice, basis, [0, 0], [n_col, n_row], error)
    space = space_over([n_col, n_row])
    if (.not. allocated(error)) call require_memory(energy_ahead_memory(lattice%extent, space%threads), error, space%threads)
    if (.not. allocated(error)) then
      call energy_ahead(worn_cycle_t(energy, path, pressure, gap, candidate /= 0, friction, by_load /= 0), lattice, &
                        pair_of(lambda), normal_law_of(interface), coefficient, cycles, tolerance, ahead, error, &
                        space, kernel_cache)
    end if
    call report(error, code, message)
  end subroutine energy_of_jump

  !> Compare two jumps with one of both, and correct the second one.
  subroutine change_by_jump(n_col, n_row, basis, lambda, energies, path, coefficient, friction, cycles, p_max, &
                            change, slower, corrected, code, message)
    !f2py threadsafe
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Basis vectors as columns [m]
    real(c_double), intent(in) :: basis(2, 2)
    !> lambda_1, lambda_2, lambda_5 [1/Pa]
    real(c_double), intent(in) :: lambda(3)
    !> Energy by area of each cycle in the first and the second jump, and in one that is as long as both [J/m^2]
    real(c_double), intent(in) :: energies(n_col, n_row, 3)
    !> Path of slip of the cycle between the two jumps [m]
    real(c_double), intent(in) :: path(n_col, n_row)
    !> Coefficient of wear [m^2/N]
    real(c_double), intent(in) :: coefficient
    !> Coefficient of friction
    real(c_double), intent(in) :: friction(n_col, n_row)
    !> Cycles of each of the two jumps, largest pressure [Pa]
    real(c_double), intent(in) :: cycles, p_max
    !> What it changes
    real(c_double), intent(out) :: change(7)
    !> By how much the two wear more [m]
    real(c_double), intent(out) :: slower(n_col, n_row)
    !> Energy by area of each cycle in the second jump, corrected [J/m^2]
    real(c_double), intent(out) :: corrected(n_col, n_row)
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(lattice_t) :: lattice
    type(step_change_t) :: found

    change = 0.0_c_double
    slower = 0.0_c_double
    corrected = 0.0_c_double
    call new_lattice(lattice, basis, [0, 0], [n_col, n_row], error)
    if (.not. allocated(error)) then
      associate (pair => pair_of(lambda), first => energies(:, :, 1), second => energies(:, :, 2), both => energies(:, :, 3))
        call jump_change(lattice, pair, first, second, both, coefficient, friction, cycles, p_max, slower, found)
        call energy_of_second_jump(lattice, pair, path, coefficient, cycles, first, second, both, corrected)
      end associate
      change = [found%stick, found%traction, found%added, found%lattice, found%gain, found%spent, found%turned]
    end if
    call report(error, code, message)
  end subroutine change_by_jump

  !> Expect the end of a load step of the next cycle.
  subroutine expected_end(n_node, last, ahead, follows, pressure, expected, traction)
    !f2py threadsafe
    !> Number of nodes
    integer(c_int), intent(in) :: n_node
    !> Pressure and tractions along x and y when the step was solved last [Pa], and their rates by cycle
    real(c_float), intent(in) :: last(n_node, 3, 2)
    !> Cycles since then
    real(c_double), intent(in) :: ahead
    !> Not zero: `pressure` and `expected` are those of the load step before
    integer(c_int), intent(in) :: follows
    !> Pressure at the end of the load step before [Pa]
    real(c_double), intent(in) :: pressure(n_node)
    !> Pressure that was expected there; then the one that is expected of this step [Pa]
    real(c_float), intent(inout) :: expected(n_node)
    !> Tractions to start from [Pa]
    real(c_double), intent(out) :: traction(n_node, 3)
    real(c_float) :: before(n_node)

    before = expected
    if (follows /= 0) then
      call expect_end(last, ahead, expected, traction, pressure, before)
    else
      call expect_end(last, ahead, expected, traction)
    end if
  end subroutine expected_end

  !> Remember the end of a load step in single precision, with its change since the cycle before.
  subroutine remembered_end(n_node, pressure, traction_x, traction_y, passed, last)
    !f2py threadsafe
    !> Number of nodes
    integer(c_int), intent(in) :: n_node
    !> Pressure and tractions [Pa]
    real(c_double), intent(in) :: pressure(n_node), traction_x(n_node), traction_y(n_node)
    !> Cycles since those at hand were found, 0: never
    real(c_double), intent(in) :: passed
    !> Tractions and their rates by cycle [Pa]
    real(c_float), intent(inout) :: last(n_node, 3, 2)

    call remember_end(reshape([pressure, traction_x, traction_y], [n_node, 3]), passed, last)
  end subroutine remembered_end

end module hc_f2py_wear
