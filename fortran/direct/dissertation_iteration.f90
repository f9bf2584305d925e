!> Contact with friction by the iteration of the dissertation as it is written, for comparison with hc_direct_friction.
!>
!> Sections 8.6 and 12.3, Figures 8.3 and 12.1. Inside, under frozen zones: solve for the tractions; nodes in
!> tension leave, (8.40) and (12.28), until there are none. In a first step the area only shrinks (chapter 8); in a later one,
!> where the bodies then overlap outside of the area, a ring is added to it (12.3.1).
!>
!> Outside: a node that sticks and has |q| >= mu p slips, (12.31), in the direction of its last traction, (8.35); the
!> components of this direction keep their lengths and have the signs of the last slip, (12.20) to (12.25); a node that slips
!> with no velocity sticks, (12.32). Nothing is damped. Where the text leaves a choice:
!>
!> - The first area is that on which the undeformed bodies would overlap; all of it sticks, and so do nodes that are added.
!>   A later step begins with the area and the zones of the last one.
!> - Where ring and shrinking lead to an area that was there before, the zones are next.
!> - A velocity is never zero in numbers: (12.32) holds as soon as the slip is not against the traction any more.
!>
!> It ends when the residuals are within the tolerance, when zones and directions stand, or when they come again with the
!> same area.
!>
!> Theory: docs/direct_method.md.
module hc_dissertation_iteration
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_contact_state, only: contact_state_t, load_step_t, new_friction_state, stick, slip, normal, no_progress, &
    sweeps_used_up, loads_not_carried
  use hc_normal_problem, only: nearest_nodes
  use hc_load_constraints, only: overloads
  use hc_direct_iterate, only: direct_iterate_t, infinite
  use hc_direct_system, only: solve_area
  implicit none
  private

  public :: iterate_as_written

  !> Solved arrangements of area, zones and directions; two sums identify each of them.
  type :: arrangements_t
    real(wp), allocatable :: sums(:, :)
  contains
    procedure :: add
  end type arrangements_t

contains

  !> Iterate from a state until the residuals are within the tolerance or nothing new comes.
  subroutine iterate_as_written(it, start, step, state, error)
    !> Iterate, with its problem and flexibility
    type(direct_iterate_t), intent(inout) :: it
    !> State to start from
    type(contact_state_t), intent(in) :: start
    !> The load step
    type(load_step_t), intent(in) :: step
    !> State at the end of the step, converged or not
    type(contact_state_t), intent(out) :: state
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    type(arrangements_t) :: before
    logical :: changed, repeated, first
    integer :: sweep

    call new_friction_state(state, it%problem%lattice)
    call it%begin(start, step)
    it%accuracy = it%problem%options%direct%last_accuracy*step%tolerance
    first = .not. any(start%pressure > 0.0_wp)
    if (.not. first) then
      it%contact = it%candidate .and. reshape(start%pressure > 0.0_wp, [size(it%p)])
      it%p = reshape(start%pressure, [size(it%p)])
      it%q = reshape(start%traction, [size(it%p), 2])
    else
      it%contact = it%problem%first_guess(step%target)
    end if
    if (.not. any(it%contact)) it%contact = it%candidate
    where (it%contact) it%zone = stick
    if (.not. first) call partition(it, changed)
    allocate (before%sums(2, 0))
    do sweep = 1, step%max_sweeps
      call before%add(it, repeated)
      call find_area(first, it, error)
      if (allocated(error)) return
      call it%record(step, state, error)
      if (allocated(error) .or. state%converged) return
      state%stopped = no_progress
      if (repeated) return
      if (.not. it%carried) then
        state%sliding = overloads(it%problem, step%target, state%pressure, state%residual_normal)
        if (state%sliding) state%stopped = loads_not_carried
        return
      end if
      call partition(it, changed)
      if (.not. changed) return
    end do
    state%stopped = sweeps_used_up
  end subroutine iterate_as_written

  !> Find the contact area under frozen zones: the inner loop.
  subroutine find_area(shrinks, it, error)
    !> Nodes leave the area only
    logical, intent(in) :: shrinks
    !> Iterate
    type(direct_iterate_t), intent(inout) :: it
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    logical, dimension(size(it%p)) :: tension, wider
    type(arrangements_t) :: before
    real(wp) :: negligible
    logical :: repeated

    allocate (before%sums(2, 0))
    do
      call before%add(it, repeated)
      if (repeated) return
      call solve_area(it, error)
      if (allocated(error)) return
      negligible = it%negligible_pressure()
      tension = it%contact .and. it%p < -negligible
      if (any(tension)) then
        it%contact = it%contact .and. .not. tension
        if (.not. any(it%contact)) it%contact = nearest_nodes(it%gap, it%candidate)
      else if (shrinks) then
        return
      else if (any(it%candidate .and. .not. it%contact .and. it%gap < -negligible*it%problem%normal_compliance)) then
        wider = it%candidate &
                .and. reshape(it%problem%lattice%dilated(logical(reshape(it%contact, it%problem%lattice%extent))), [size(it%p)])
        where (wider .and. .not. it%contact) it%zone = stick
        it%contact = wider
      else
        return
      end if
    end do
  end subroutine find_area

  !> Find stick or slip at every node in contact, from the last tractions and the last slip.
  subroutine partition(it, changed)
    !> Iterate
    type(direct_iterate_t), intent(inout) :: it
    !> Some zone or direction is another one
    logical, intent(out) :: changed
    real(wp), dimension(size(it%p)) :: bound, length
    real(wp) :: negligible, e(2)
    integer :: i, k

    changed = .false.
    if (.not. it%problem%friction%is_bounded()) return
    call it%problem%friction%find_bounds(1, it%p, bound)
    call it%problem%friction%find_lengths(it%q(:, 1), it%q(:, 2), length)
    negligible = it%problem%options%direct%negligible_slip*it%problem%tangential_compliance*maxval(it%p)
    do i = 1, size(it%p)
      if (.not. it%contact(i)) cycle
      if (it%zone(i) == stick) then
        if (length(i) < bound(i)*(1.0_wp - epsilon(1.0_wp)**0.5_wp) .or. .not. length(i) > 0.0_wp) cycle
        it%zone(i) = slip
        it%compliance(i) = infinite
        it%direction(:, i) = it%q(i, :)/norm2(it%q(i, :))
        changed = .true.
      else if (allocated(it%ds)) then
        e = it%direction(:, i)
        if (dot_product(it%ds(i, :), e) >= 0.0_wp) then
          it%zone(i) = stick
          it%compliance(i) = 0.0_wp
          changed = .true.
          cycle
        end if
        do k = 1, 2
          if (abs(it%ds(i, k)) > negligible) it%direction(k, i) = -sign(e(k), it%ds(i, k))
        end do
        if (any(abs(it%direction(:, i) - e) > 0.0_wp)) changed = .true.
      end if
    end do
  end subroutine partition

  !> Add the present arrangement, unless it has been there before.
  subroutine add(self, it, repeated)
    class(arrangements_t), intent(inout) :: self
    !> Iterate
    type(direct_iterate_t), intent(in) :: it
    !> It has been there before
    logical, intent(out) :: repeated
    real(wp) :: now(2), number
    integer :: i

    now = 0.0_wp
    do i = 1, size(it%p)
      if (.not. it%contact(i)) cycle
      number = 1.0_wp
      if (it%zone(i) == slip) number = 2.0_wp + dot_product([0.37_wp, 0.61_wp], it%direction(:, i))
      now = now + number*[real(i, wp), sqrt(real(i, wp))]
    end do
    repeated = .false.
    do i = 1, size(self%sums, 2)
      if (all(abs(self%sums(:, i) - now) <= 0.0_wp)) repeated = .true.
    end do
    self%sums = reshape([self%sums, now], [2, size(self%sums, 2) + 1])
  end subroutine add

end module hc_dissertation_iteration
