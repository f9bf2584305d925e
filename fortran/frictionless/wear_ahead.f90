!> Wear of a jump of many cycles, with the pressure at its end.
!>
!> A node that slips by S in a cycle wears by n k S p in n cycles. With the pressure p at the end of the jump this is a spring of
!> compliance C = n k S at each node, and that pressure is the one of a frictionless contact on these springs, (V4): wear
!> never takes more than there is pressure left to take away, however long the jump. The change from the
!> pressure of the cycle is the only unknown, so that shear tractions and bulk strains, which are constant, do not enter.
!>
!> Ranks that share the window each hold their rows of all fields.
!>
!> Equations: docs/theory/wear.md, (V3), (V4).
module hc_wear_ahead
  use hc_precision, only: wp, lk
  use hc_error, only: error_t, status, raise
  use hc_pressure_kernel, only: normal_kernel_t
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_contact_state, only: contact_state_t, load_target_t, force_control, displacement_control
  use hc_nodal_springs, only: nodal_springs_t
  use hc_normal_problem, only: normal_problem_t, new_normal_problem
  use hc_normal_lattice, only: normal_lattice_t
  use hc_normal_iterate, only: normal_iterate_t
  use hc_normal_lattice_solver, only: solve_on_normal_lattice
  use hc_normal_contact, only: normal_contact_memory
  use hc_flexibility_fft, only: fft_memory
  implicit none
  private

  public :: worn_cycle_t, energy_ahead, energy_ahead_memory

  !> State at the end of a cycle; fields over the window (n_col, own rows).
  type :: worn_cycle_t
    !> Dissipated energy by area [J/m^2] and path of slip [m] of the cycle
    real(wp), allocatable :: energy(:, :), path(:, :)
    !> Pressure [Pa] and gap [m] at its end
    real(wp), allocatable :: pressure(:, :), gap(:, :)
    !> Nodes that may come into contact
    logical, allocatable :: candidate(:, :)
    !> Coefficient of friction
    real(wp), allocatable :: friction(:, :)
    !> The normal load is prescribed, not the approach
    logical :: by_load = .false.
  end type worn_cycle_t

  !> Iterations that may be made
  integer, parameter :: max_sweeps = 200

contains

  !> Compute the pressure by which nodes slip, on average over a cycle: where nothing slips, that at the end of the cycle [Pa].
  elemental real(wp) function slipping_pressure(energy, path, friction, pressure)
    !> Dissipated energy by area [J/m^2], path of slip [m], coefficient of friction, pressure at the end of the cycle [Pa]
    real(wp), intent(in) :: energy, path, friction, pressure

    slipping_pressure = max(pressure, 0.0_wp)
    if (energy > 0.0_wp .and. path > 0.0_wp .and. friction > 0.0_wp) slipping_pressure = energy/(friction*path)
  end function slipping_pressure

  !> Count the bytes that `energy_ahead` takes, for a window of the given size.
  pure integer(selected_int_kind(18)) function energy_ahead_memory(extent, threads)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Threads to use
    integer, intent(in) :: threads
    !> Bytes of a node: five fields and two masks of the cycle; pressures, springs, gaps and their sources
    integer(selected_int_kind(18)), parameter :: node = 5*8 + 2*4 + 12*8

    ! the transforms share no memory here: three more than there
    energy_ahead_memory = normal_contact_memory(extent, threads, periodic=.false.) + 3*fft_memory(extent, .true., threads) &
                          + node*extent(1)*extent(2)
  end function energy_ahead_memory

  !> Find the energy of a cycle by which a jump wears, (V4): that of the cycle before it, times the pressure after over before.
  subroutine energy_ahead(now, problem, wear, tolerance, ahead, error, cache)
    !> The cycle before the jump
    type(worn_cycle_t), intent(in) :: now
    !> Window, bodies and law of contact
    class(normal_problem_t), intent(in) :: problem
    !> Cycles of the jump times the coefficient of wear [m^2/N]
    real(wp), intent(in) :: wear
    !> Bound of the residual of the pressure
    real(wp), intent(in) :: tolerance
    !> Energy by area of each cycle (n_col, n_row) [J/m^2]
    real(wp), intent(out) :: ahead(:, :)
    !> Allocated on failure: no convergence, not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Cache of spectra
    type(kernel_cache_t), pointer, intent(in), optional :: cache
    real(wp), dimension(size(ahead, 1), size(ahead, 2)) :: before, after, spring

    ahead = now%energy
    before = slipping_pressure(now%energy, now%path, now%friction, now%pressure)
    if (problem%space%count(logical(now%candidate .and. before > 0.0_wp, lk)) == 0) return
    spring = merge(wear*now%path, 0.0_wp, now%energy > 0.0_wp .and. before > 0.0_wp)
    call settle(now, problem, before, spring, tolerance, after, error, cache)
    if (allocated(error)) return
    where (now%energy > 0.0_wp .and. before > 0.0_wp) ahead = now%energy*(after/before)
  end subroutine energy_ahead

  !> Solve for the pressure on springs that are new, given one that is in balance without them.
  subroutine settle(now, problem, before, spring, tolerance, after, error, cache)
    !> The cycle
    type(worn_cycle_t), intent(in) :: now
    !> Window, bodies and law of contact
    class(normal_problem_t), intent(in) :: problem
    !> Pressure without the springs (n_col, n_row) [Pa]
    real(wp), intent(in), contiguous :: before(:, :)
    !> Compliance of the springs (n_col, n_row) [m/Pa]
    real(wp), intent(in), contiguous :: spring(:, :)
    !> Bound of the residual
    real(wp), intent(in) :: tolerance
    !> Pressure on them (n_col, n_row) [Pa]
    real(wp), intent(out) :: after(:, :)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    !> Cache of spectra
    type(kernel_cache_t), pointer, intent(in), optional :: cache
    type(normal_lattice_t) :: level
    type(normal_iterate_t) :: iterate
    type(normal_kernel_t), target :: kernel
    type(contact_state_t) :: state
    type(load_target_t) :: target
    real(wp), allocatable :: closing(:, :), layer(:, :)
    real(wp) :: lift
    integer :: col, row

    allocate (layer, mold=before)
    do row = 1, size(layer, 2)
      do col = 1, size(layer, 1)
        layer(col, row) = problem%normal_law%compliance_under(before(col, row))
      end do
    end do
    call new_normal_problem(level, problem%lattice, problem%medium, merge(now%gap, 0.0_wp, now%candidate), now%candidate, &
                            error, nodal_springs_t(reshape(spring + layer, [size(spring)])), problem%space)
    if (allocated(error)) return
    call level%prepare(kernel, .true., .true., problem%space, error, cache)
    if (allocated(error)) return
    allocate (closing, mold=before)
    call level%multiply_exactly(before, closing, error)
    if (allocated(error)) return
    closing = closing + layer*before
    ! the gap under `before` is that of the cycle, 0 where nodes carry
    lift = problem%space%max(closing, logical(now%candidate, lk))
    level%initial_gap = lift - closing
    where (.not. now%candidate)
      level%initial_gap = 0.0_wp
    else where (.not. before > 0.0_wp)
      level%initial_gap = level%initial_gap + max(now%gap, 0.0_wp)
    end where
    allocate (state%pressure, source=merge(before, 0.0_wp, now%candidate))
    target = load_target_t([merge(force_control, displacement_control, now%by_load)], &
                           [merge(problem%lattice%cell_area()*problem%space%sum(state%pressure), lift, now%by_load)])
    call solve_on_normal_lattice(level, iterate, target, tolerance, max_sweeps, state, error)
    if (allocated(error)) return
    if (.not. state%converged) then
      call raise(error, status%no_convergence, 'the pressure after a jump of wear was not found')
      return
    end if
    after = state%pressure
  end subroutine settle

end module hc_wear_ahead
