!> Dependence of a solution on the size of the load steps, measured on two paths.
!>
!> One path goes through a load history in load steps, another one in steps of half the size, from its own states. Errors of both
!> are of first order in the size, so that the change by the halves is their remaining error.
!>
!> Equations: docs/theory/step_control.md, (S1).
module hc_step_error
  use hc_precision, only: wp, lk
  use hc_options, only: step_options_t
  use hc_lattice, only: lattice_t
  use hc_field_space, only: field_space_t
  use hc_contact_state, only: contact_state_t, separated, slip, stick
  use hc_contact_problem, only: friction_problem_t
  use hc_contact_residuals, only: least_traction
  use hc_edges_by_rows, only: edges_by_rows_t, new_edges_by_rows
  use hc_state_measures, only: friction_reserve
  use hc_zone_edge, only: zone_edge_t
  implicit none
  private

  public :: step_change_t, compare_halves, edges_of, shear_free, turned_part

  !> Change by the halves of a load step.
  type :: step_change_t
    !> Change of the stick area, over the largest contact area
    real(wp) :: stick = 0.0_wp
    !> Change of the shear tractions, over the friction limit
    real(wp) :: traction = 0.0_wp
    !> The part of it that this load step added
    real(wp) :: added = 0.0_wp
    !> How far entering rings of nodes may move the stick area, whatever the steps, over the largest contact area
    real(wp) :: lattice = 0.0_wp
    !> Change of the stick area over that of the tractions, in these units, during the second half
    real(wp) :: gain = 1.0_wp
    !> Dissipated energy of the halves, and the part that is uncertain since the load turns in each, (W4), over the cell area
    real(wp) :: spent = 0.0_wp, turned = 0.0_wp
  end type step_change_t

contains

  !> Compare the two solutions at the end of a load step.
  subroutine compare_halves(problem, whole, half, halves, whole_before, halves_before, area, change)
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> End of the path in whole steps, middle and end of the one in halves
    type(contact_state_t), intent(in) :: whole, half, halves
    !> Both paths at the beginning of the step
    type(contact_state_t), intent(in) :: whole_before, halves_before
    !> Largest contact area of the history [m^2]
    real(wp), intent(in) :: area
    !> Change by the halves
    type(step_change_t), intent(out) :: change
    type(edges_by_rows_t) :: edges
    type(zone_edge_t) :: contact, sticking
    real(wp) :: carried, scale, grown, loaded
    integer :: entered

    associate (spacing => problem%lattice%spacing(), steps => problem%options%steps, space => problem%space, &
               friction => problem%friction)
      call edges_of(problem, halves, edges)
      contact = edges%contact_edge()
      sticking = edges%stick_edge(halves%zone == stick, friction_reserve(friction, halves))
      entered = space%count(logical((halves%zone /= separated) .neqv. (halves_before%zone /= separated), lk))
      if (contact%radius() < steps%small_radius*spacing) then
        change%lattice = contact%area/area
      else if (space%count(logical(whole%zone == slip .or. half%zone == slip .or. halves%zone == slip, lk)) > 0) then
        change%lattice = steps%ring_shift*spacing*sticking%length/area &
                         *min(1.0_wp, steps%entering_factor*entered*spacing/max(contact%length, spacing))
      end if

      if (friction%is_bounded()) then
        carried = space%sum(friction%bounds_of(halves%pressure))
      else
        carried = max(space%sum(shear(halves)), least_traction*space%sum(halves%pressure))
      end if
      scale = 0.0_wp
      if (carried > 0.0_wp) scale = min(1.0_wp, contact%area/area)/carried
      change%traction = scale*space%sum(norm2(whole%traction - halves%traction, dim=3))
      change%added = scale*space%sum(norm2(whole%traction - halves%traction &
                                           - (whole_before%traction - halves_before%traction), dim=3))

      if (friction%is_bounded()) then
        change%spent = space%sum(shear(half)*slipped(halves_before, half) + shear(halves)*slipped(half, halves))
        ! nodes that turn one way and others that turn the other way do so under a load that keeps its direction
        change%turned = abs(space%sum(turned(halves_before, half)*slipped(halves_before, half) &
                                      + turned(half, halves)*slipped(half, halves)))
      end if

      grown = abs(sticking%area - stick_area(problem, half))/area
      loaded = scale*space%sum(norm2(half%traction - halves%traction, dim=3))
      if (loaded > 0.0_wp) change%gain = min(max(1.0_wp, grown/loaded), steps%most_gain)
    end associate
    change%stick = (sticking%area - stick_area(problem, whole))/area
  end subroutine compare_halves

  !> Return whether states have no shear tractions: their path has no history.
  logical function shear_free(state, space, options)
    !> State
    type(contact_state_t), intent(in) :: state
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Tuning numbers
    type(step_options_t), intent(in) :: options
    shear_free = space%max(shear(state)) <= options%shear_rounding*max(space%max(state%pressure), tiny(1.0_wp))
  end function shear_free

  !> Find the edges of a contact at the end of a load step, in a window about the origin.
  subroutine edges_of(problem, state, edges)
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> State
    type(contact_state_t), intent(in) :: state
    !> Its edges
    type(edges_by_rows_t), intent(out) :: edges
    type(lattice_t) :: here

    ! lengths do not depend on where the window lies and how it grew, not even in their last digit
    here = problem%lattice
    here%first = 0
    here%origin = 0.0_wp
    call new_edges_by_rows(edges, here, state, logical(problem%candidate), problem%space, problem%options%edges)
  end subroutine edges_of

  !> Compute the stick area of a state [m^2].
  real(wp) function stick_area(problem, state)
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> State
    type(contact_state_t), intent(in) :: state
    type(edges_by_rows_t) :: edges
    type(zone_edge_t) :: edge

    call edges_of(problem, state, edges)
    edge = edges%stick_edge(state%zone == stick, friction_reserve(problem%friction, state))
    stick_area = edge%area
  end function stick_area

  !> Compute the slip during a step; 0 where nodes do not slip at its end [m].
  pure function slipped(before, after)
    !> Beginning and end
    type(contact_state_t), intent(in) :: before, after
    real(wp) :: slipped(size(after%traction, 1), size(after%traction, 2))

    slipped = merge(norm2(after%relative_displacement - before%relative_displacement, dim=3), 0.0_wp, after%zone == slip)
  end function slipped

  !> Compute by how much a traction may have turned while a node slipped, (W4): its part before the step that is transverse to that
  !> at the end, positive where it turns from x to y. Beyond a right angle less and less: a node whose traction reverses sticks
  !> until that is at its bound again.
  elemental real(wp) function turned_part(before_x, before_y, x, y) result(turned)
    !> Traction at the beginning and at the end of the step [Pa]
    real(wp), intent(in) :: before_x, before_y, x, y
    real(wp) :: product

    turned = 0.0_wp
    product = hypot(before_x, before_y)*hypot(x, y)
    if (product <= 0.0_wp) return
    turned = (before_x*y - before_y*x)/hypot(x, y)*min(1.0_wp, 1.0_wp + (x*before_x + y*before_y)/product)
  end function turned_part

  !> Compute these parts of the shear tractions of two states; a node that stuck slips in the direction that it is pulled to [Pa].
  pure function turned(before, after)
    !> Beginning and end
    type(contact_state_t), intent(in) :: before, after
    real(wp) :: turned(size(after%traction, 1), size(after%traction, 2))

    turned = 0.0_wp
    where (before%zone == slip) turned = turned_part(before%traction(:, :, 1), before%traction(:, :, 2), &
                                                     after%traction(:, :, 1), after%traction(:, :, 2))
  end function turned

  !> Compute the magnitude of the shear tractions [Pa].
  pure function shear(state)
    !> State
    type(contact_state_t), intent(in) :: state
    real(wp) :: shear(size(state%traction, 1), size(state%traction, 2))
    shear = hypot(state%traction(:, :, 1), state%traction(:, :, 2))
  end function shear

end module hc_step_error
