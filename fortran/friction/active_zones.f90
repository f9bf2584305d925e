!> Active sets of an iterate: contact area, stick and slip, and loads as constraints.
!>
!> Equations: docs/theory/friction.md, (F5), (F8); docs/theory/normal_contact.md, (N6).
module hc_active_zones
  use hc_precision, only: wp
  use hc_contact_state, only: separated, stick, slip, about_z, n_motion, force_control
  use hc_disc_law, only: normal_to
  use hc_active_set, only: active_set_t
  use hc_friction_iterate, only: friction_iterate_t
  use hc_load_constraints, only: driven_motions_t, new_driven_motions, fix_in_stick
  implicit none
  private

  public :: find_contact, linearize_law, shear_parameter, classify, find_constraints, find_prescribed_displacement

contains

  !> Find the nodes that the law of contact calls for, (F5): one step of a projected gradient map, which contracts
  !> because r' is scaled with the size of the contact.
  subroutine find_contact(now, gap, contact)
    !> Iterate
    type(friction_iterate_t), intent(in) :: now
    !> Gap of the present tractions [m]
    real(wp), intent(in), contiguous :: gap(:)
    !> The nodes (n)
    logical, allocatable, intent(out) :: contact(:)
    real(wp) :: r, least
    integer :: row, from, to

    r = now%problem%normal_classification_parameter(now%operators%space%count(now%contact))
    allocate (contact(size(gap)))
    !$omp parallel do schedule(static) num_threads(now%operators%space%threads) private(from, to)
    do row = 1, now%problem%lattice%extent(2)
      to = row*now%problem%lattice%extent(1)
      from = to - now%problem%lattice%extent(1) + 1
      call now%problem%normal_law%find_contact(r, now%p(from:to), gap(from:to), now%candidate(from:to), contact(from:to))
    end do
    !$omp end parallel do
    if (now%operators%space%count(contact) > 0) return
    least = now%operators%space%min(gap, now%candidate)
    contact = now%candidate .and. gap <= least
  end subroutine find_contact

  !> Linearise a compliant law of contact about the present pressure and gap.
  subroutine linearize_law(now, gap, from_pressure)
    !> Iterate
    type(friction_iterate_t), intent(inout) :: now
    !> Gap of the present tractions [m]
    real(wp), intent(in), contiguous :: gap(:)
    !> The gap means nothing yet: about the pressure
    logical, intent(in) :: from_pressure
    real(wp) :: r, p_max
    integer :: row, from, to

    p_max = 0.0_wp
    if (allocated(now%pressure%compliance)) p_max = now%operators%space%max(abs(now%p))
    if (.not. (allocated(now%pressure%compliance) .and. p_max > 0.0_wp)) return
    r = 0.0_wp
    if (.not. from_pressure) r = now%problem%normal_classification_parameter(now%operators%space%count(now%contact))
    !$omp parallel do schedule(static) num_threads(now%operators%space%threads) private(from, to)
    do row = 1, now%problem%lattice%extent(2)
      to = row*now%problem%lattice%extent(1)
      from = to - now%problem%lattice%extent(1) + 1
      call now%problem%normal_law%linearize(from, r, now%problem%softest_spring(p_max), now%p(from:to), gap(from:to), &
                                            now%contact(from:to), now%pressure%compliance(from:to), now%pressure%offset(from:to))
    end do
    !$omp end parallel do
    call now%operators%normal%set_active(now%contact, now%pressure%compliance)
  end subroutine linearize_law

  !> Compute r of (F8), smaller where the iteration goes badly, and where there is no shear traction yet [Pa/m].
  real(wp) function shear_parameter(now) result(r)
    type(friction_iterate_t), intent(in) :: now

    r = now%globalization%share_of_r*now%problem%classification_parameter(now%operators%space%count(now%contact))
    if (.not. now%first) return
    if (.not. now%operators%space%max_abs(now%q) > 0.0_wp) r = now%problem%options%newton%cautious_share*r
  end function shear_parameter

  !> Find stick, slip and frames that the present tractions call for.
  !>
  !> The shear traction is put on the cone where a node slips, and its component across
  !> left as a start.
  subroutine classify(now, fixing, active)
    !> Iterate
    type(friction_iterate_t), intent(inout), target :: now
    !> Fix some nodes in stick where none sticks
    logical, intent(in) :: fixing
    !> Components in the frames that carry unknowns (2 n): both in stick, that along t in slip
    logical, allocatable, intent(out) :: active(:)
    integer, allocatable :: zone(:)
    real(wp) :: ds(now%problem%lattice%extent(1), 2), r, p_max, across, e(2)
    real(wp), dimension(now%problem%lattice%extent(1)) :: bound, ahead, aside
    integer :: n, row, col, i, from, to

    n = size(now%p)
    allocate (zone(n), active(2*n))
    r = shear_parameter(now)
    associate (friction => now%problem%friction, soft => now%problem%options%preconditioner%soft_spring)
      p_max = now%operators%space%max(now%p)
      !$omp parallel do schedule(static) num_threads(now%operators%space%threads) private(ds, i, from, to)
      do row = 1, now%problem%lattice%extent(2)
        to = row*size(ds, 1)
        from = to - size(ds, 1) + 1
        call now%slip_row(row, ds(:, 1), ds(:, 2))
        call friction%linearize(from, p_max, r, now%contact(from:to), now%p(from:to), now%q(from:to), now%q(n + from:n + to), &
                                ds(:, 1), ds(:, 2), zone(from:to), now%shear%direction(:, from:to), &
                                now%shear%compliance(from:to))
        do i = from, to
          if (.not. now%contact(i)) now%q([i, n + i]) = 0.0_wp
        end do
      end do
      !$omp end parallel do
      now%fixed = fixing
      if (now%fixed) call fix_in_stick(now%operators%space, now%problem%options%contact%fixed_share, now%shear%compliance, zone)

      !$omp parallel do schedule(static) num_threads(now%operators%space%threads) &
      !$omp& private(bound, ahead, aside, across, e, col, i, from, to)
      do row = 1, now%problem%lattice%extent(2)
        to = row*size(bound)
        from = to - size(bound) + 1
        call friction%find_bounds(from, now%p(from:to), bound)
        call friction%find_boundary(now%shear%direction(:, from:to), ahead, aside)
        if (allocated(now%shear%rest)) now%shear%rest(from:to) = bound*aside
        do col = 1, size(bound)
          i = from + col - 1
          active(i) = zone(i) /= separated
          active(n + i) = zone(i) == stick
          if (zone(i) /= slip) cycle
          e = now%shear%direction(:, i)
          across = bound(col)*aside(col)
          if (now%shear%compliance(i) < soft*now%shear%elastic_compliance) then
            across = dot_product(normal_to(e), [now%q(i), now%q(n + i)])
          end if
          now%q([i, n + i]) = bound(col)*ahead(col)*e + across*normal_to(e)
        end do
      end do
      !$omp end parallel do
    end associate
    call now%shear%set_contact(now%contact)
  end subroutine classify

  !> Find the loads that are prescribed as constraints on the unknowns.
  subroutine find_constraints(now, nodes, driven, constraint, missing)
    !> Iterate
    type(friction_iterate_t), intent(in) :: now
    !> Unknowns, in the frames (of 2 n)
    type(active_set_t), intent(in) :: nodes
    !> Motions that are driven by their loads
    type(driven_motions_t), intent(out) :: driven
    !> Constraint vectors at the unknowns (n_active, number of driven motions)
    real(wp), allocatable, intent(out) :: constraint(:, :)
    !> What the present traction lacks of the loads, over the cell area
    real(wp), allocatable, intent(out) :: missing(:)
    real(wp) :: part(now%problem%lattice%extent(2)), unit(now%problem%lattice%extent(1), 2)
    real(wp), allocatable :: frame(:)
    integer :: n, k, row, col, i

    n = size(now%p)
    call new_driven_motions(driven, now%problem, now%target, now%contact)
    allocate (constraint(nodes%n_active, size(driven%motion)), missing(size(driven%motion)))
    if (size(missing) > 0) allocate (frame(2*n))
    do k = 1, size(driven%motion)
      !$omp parallel do schedule(static) num_threads(now%operators%space%threads) private(unit, col, i)
      do row = 1, size(part)
        call driven%direction_row(k, now%problem, row, unit(:, 1), unit(:, 2))
        part(row) = 0.0_wp
        do col = 1, size(unit, 1)
          i = (row - 1)*size(unit, 1) + col
          part(row) = part(row) + unit(col, 1)*now%q(i) + unit(col, 2)*now%q(n + i)
          frame(i) = -now%shear%direction(2, i)*unit(col, 1) + now%shear%direction(1, i)*unit(col, 2)
          frame(n + i) = now%shear%direction(1, i)*unit(col, 1) + now%shear%direction(2, i)*unit(col, 2)
        end do
      end do
      !$omp end parallel do
      call nodes%pack(frame, constraint(:, k))
      missing(k) = driven%load(k, now%problem, now%target) - sum(part)
    end do
  end subroutine find_constraints

  !> Find the displacements that sticking nodes should have as far as it is known: where they stood, and the motions that
  !> are prescribed.
  subroutine find_prescribed_displacement(now, frame)
    !> Iterate
    type(friction_iterate_t), intent(in) :: now
    !> In the frames (2 n)
    real(wp), intent(out), contiguous :: frame(:)
    real(wp) :: motion(n_motion), remote(now%problem%lattice%extent(1), 2), along, across
    integer :: n, row, col, i

    n = size(now%p)
    motion = merge(now%motion, 0.0_wp, now%target%control /= force_control)
    !$omp parallel do schedule(static) num_threads(now%operators%space%threads) private(remote, along, across, col, i)
    do row = 1, now%problem%lattice%extent(2)
      call now%problem%rigid_displacement_row(motion, row, remote(:, 1), remote(:, 2))
      do col = 1, now%problem%lattice%extent(1)
        i = (row - 1)*now%problem%lattice%extent(1) + col
        along = now%origin(i) + remote(col, 1)
        across = now%origin(n + i) + remote(col, 2)
        frame(i) = -now%shear%direction(2, i)*along + now%shear%direction(1, i)*across
        frame(n + i) = now%shear%direction(1, i)*along + now%shear%direction(2, i)*across
      end do
    end do
    !$omp end parallel do
  end subroutine find_prescribed_displacement

end module hc_active_zones
