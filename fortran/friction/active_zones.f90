!> What the tractions of an iterate call for: contact area, stick and slip, and loads as constraints.
!>
!> Equations: docs/theory/friction.md, (F5), (F8).
module hc_active_zones
  use hc_precision, only: wp
  use hc_contact_state, only: separated, stick, slip, along_x, along_y, about_z, n_motion, force_control
  use hc_coulomb, only: normal_to
  use hc_friction_iterate, only: friction_iterate_t
  use hc_symbol_preconditioner, only: soft
  use hc_load_constraints, only: driven_motions_t, new_driven_motions, hold_nodes
  implicit none
  private

  public :: find_contact, classify, find_constraints, find_prescribed_displacement

contains

  !> Nodes that the law of contact calls for, (F5): one step of a projected gradient map, which contracts
  !> because r' is scaled with the size of the contact.
  subroutine find_contact(now, gap, contact)
    type(friction_iterate_t), intent(in) :: now
    !> Gap of the present tractions [m]
    real(wp), intent(in), contiguous :: gap(:)
    !> The nodes (n)
    logical, allocatable, intent(out) :: contact(:)
    real(wp) :: r
    integer :: row, n_contact, from, to

    r = now%problem%normal_classification_parameter(now%operators%space%count(now%contact))
    allocate (contact(size(gap)))
    n_contact = 0
    !$omp parallel do schedule(static) num_threads(now%operators%space%threads) private(from, to) reduction(+: n_contact)
    do row = 1, now%problem%lattice%extent(2)
      to = row*now%problem%lattice%extent(1)
      from = to - now%problem%lattice%extent(1) + 1
      call now%problem%normal_law%find_contact(from, r, now%p(from:to), gap(from:to), now%candidate(from:to), contact(from:to))
      n_contact = n_contact + count(contact(from:to))
    end do
    !$omp end parallel do
    if (n_contact == 0) contact = now%candidate .and. gap <= minval(gap, mask=now%candidate)
  end subroutine find_contact

  !> Stick, slip and frames that the present tractions call for.
  !>
  !> The shear traction is put on the cone where a node slips, and its component across
  !> left as a start.
  subroutine classify(now, holding, active)
    type(friction_iterate_t), intent(inout) :: now
    !> Let some nodes stick where none does
    logical, intent(in) :: holding
    !> Components in the frames that carry unknowns (2 n): both in stick, that along t in slip
    logical, allocatable, intent(out) :: active(:)
    integer, allocatable :: zone(:)
    real(wp) :: ds(now%problem%lattice%extent(1), 2), bound(now%problem%lattice%extent(1)), r, p_max, across, e(2)
    integer :: n, row, col, i, from, to

    n = size(now%p)
    allocate (zone(n), active(2*n))
    r = now%globalization%share_of_r*now%problem%classification_parameter(now%operators%space%count(now%contact))
    if (now%first .and. .not. any(abs(now%q) > 0.0_wp)) r = now%problem%options%newton%cautious_share*r
    associate (friction => now%problem%friction)
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
      now%held = holding
      if (now%held) call hold_nodes(now%problem%options%contact%held_share, now%shear%compliance, zone)

      !$omp parallel do schedule(static) num_threads(now%operators%space%threads) private(bound, across, e, col, i, from, to)
      do row = 1, now%problem%lattice%extent(2)
        to = row*size(bound)
        from = to - size(bound) + 1
        call friction%find_bounds(from, now%p(from:to), bound)
        do col = 1, size(bound)
          i = from + col - 1
          active(i) = zone(i) /= separated
          active(n + i) = zone(i) == stick
          if (zone(i) /= slip) cycle
          e = now%shear%direction(:, i)
          across = 0.0_wp
          if (now%shear%compliance(i) < soft*now%shear%elastic_compliance) then
            across = dot_product(normal_to(e), [now%q(i), now%q(n + i)])
          end if
          now%q([i, n + i]) = bound(col)*e + across*normal_to(e)
        end do
      end do
      !$omp end parallel do
    end associate
    call now%shear%weigh(now%contact)
  end subroutine classify

  !> Loads that are prescribed as constraints on the unknowns.
  subroutine find_constraints(now, active, driven, constraint, missing)
    type(friction_iterate_t), intent(in) :: now
    !> Unknowns, in the frames (2 n)
    logical, intent(in) :: active(:)
    !> Motions that are driven by their loads
    type(driven_motions_t), intent(out) :: driven
    !> Constraint vectors, in the frames (2 n, number of driven motions)
    real(wp), allocatable, intent(out) :: constraint(:, :)
    !> What the present traction lacks of the loads, over the cell area
    real(wp), allocatable, intent(out) :: missing(:)
    real(wp) :: part(now%problem%lattice%extent(2)), unit(now%problem%lattice%extent(1), 2), t, e
    integer :: n, k, row, col, i

    n = size(now%p)
    call new_driven_motions(driven, now%problem, now%target, now%contact)
    allocate (constraint(2*n, size(driven%motion)), missing(size(driven%motion)))
    do k = 1, size(driven%motion)
      !$omp parallel do schedule(static) num_threads(now%operators%space%threads) private(unit, t, e, col, i)
      do row = 1, size(part)
        call driven%direction_row(k, now%problem, row, unit(:, 1), unit(:, 2))
        part(row) = 0.0_wp
        do col = 1, size(unit, 1)
          i = (row - 1)*size(unit, 1) + col
          part(row) = part(row) + unit(col, 1)*now%q(i) + unit(col, 2)*now%q(n + i)
          t = -now%shear%direction(2, i)*unit(col, 1) + now%shear%direction(1, i)*unit(col, 2)
          e = now%shear%direction(1, i)*unit(col, 1) + now%shear%direction(2, i)*unit(col, 2)
          constraint(i, k) = merge(t, 0.0_wp, active(i))
          constraint(n + i, k) = merge(e, 0.0_wp, active(n + i))
        end do
      end do
      !$omp end parallel do
      missing(k) = driven%load(k, now%problem, now%target) - sum(part)
    end do
  end subroutine find_constraints

  !> Displacements that sticking nodes should have as far as it is known: where they stood, and the motions that
  !> are prescribed.
  subroutine find_prescribed_displacement(now, frame)
    type(friction_iterate_t), intent(in) :: now
    !> In the frames (2 n)
    real(wp), intent(out), contiguous :: frame(:)
    real(wp) :: motion(n_motion), x, y
    integer :: n, row, col, i

    n = size(now%p)
    motion = merge(now%motion, 0.0_wp, now%target%control /= force_control)
    !$omp parallel do schedule(static) num_threads(now%operators%space%threads) private(x, y, col, i)
    do row = 1, now%problem%lattice%extent(2)
      do col = 1, now%problem%lattice%extent(1)
        i = (row - 1)*now%problem%lattice%extent(1) + col
        x = now%origin(i) + (motion(along_x) - motion(about_z)*now%problem%y(col, row))
        y = now%origin(n + i) + (motion(along_y) + motion(about_z)*now%problem%x(col, row))
        frame(i) = -now%shear%direction(2, i)*x + now%shear%direction(1, i)*y
        frame(n + i) = now%shear%direction(1, i)*x + now%shear%direction(2, i)*y
      end do
    end do
    !$omp end parallel do
  end subroutine find_prescribed_displacement

end module hc_active_zones
