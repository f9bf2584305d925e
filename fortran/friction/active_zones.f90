!> What the tractions of an iterate call for: contact area, stick and slip, and loads as constraints.
module hc_active_zones
  use hc_precision, only: wp, pi
  use hc_contact_state, only: separated, stick, slip, along_x, along_y, about_z, n_motion, force_control
  use hc_coulomb, only: linearize, normal_to
  use hc_contact_problem, only: classification_scale
  use hc_friction_iterate, only: iterate_t, cautious
  use hc_spring_blend, only: soft
  use hc_load_constraints, only: driven_motions_t, new_driven_motions
  implicit none
  private

  public :: find_contact, classify, find_constraints, find_wanted

  !> Share of the nodes that are held where none sticks.
  real(wp), parameter :: held_share = 0.25_wp

contains

  !> Nodes with p - r g > 0: one step of a projected gradient map, which contracts
  !> because r is scaled with the size of the contact.
  subroutine find_contact(now, gap, contact)
    type(iterate_t), intent(in) :: now
    !> Gap of the present tractions [m]
    real(wp), intent(in), contiguous :: gap(:)
    !> The nodes (n)
    logical, allocatable, intent(out) :: contact(:)
    real(wp) :: r
    integer :: i, n_contact

    r = classification_scale/(2.0_wp*pi*now%problem%pair%lambda_1 &
                              *sqrt(now%problem%lattice%cell_area()*max(now%operators%space%count(now%contact), 1)/pi))
    allocate (contact(size(gap)))
    n_contact = 0
    !$omp parallel do schedule(static) num_threads(now%operators%space%threads) reduction(+: n_contact)
    do i = 1, size(gap)
      contact(i) = now%candidate(i) .and. now%p(i) - r*gap(i) > 0.0_wp
      n_contact = n_contact + merge(1, 0, contact(i))
    end do
    !$omp end parallel do
    if (n_contact == 0) contact = now%candidate .and. gap <= minval(gap, mask=now%candidate)
  end subroutine find_contact

  !> Stick, slip and frames that the present tractions call for.
  !>
  !> The shear traction is put on the cone where a node slips, and its component across
  !> left as a start.
  subroutine classify(now, holding, active)
    type(iterate_t), intent(inout) :: now
    !> Let some nodes stick where none does
    logical, intent(in) :: holding
    !> Components in the frames that carry unknowns (2 n): both in stick, that along t in slip
    logical, allocatable, intent(out) :: active(:)
    integer, allocatable :: zone(:)
    real(wp) :: ds(now%problem%lattice%extent(1), 2), r, bound, largest, across, e(2)
    integer :: n, row, col, i

    n = size(now%p)
    allocate (zone(n), active(2*n))
    r = now%caution*now%problem%classification_parameter(now%operators%space%count(now%contact))
    if (now%first .and. .not. any(abs(now%q) > 0.0_wp)) r = cautious*r
    associate (friction => now%problem%friction)
      largest = friction%bound(now%operators%space%max(now%p))
      !$omp parallel do schedule(static) num_threads(now%operators%space%threads) private(ds, col, i)
      do row = 1, now%problem%lattice%extent(2)
        call now%slip_row(row, ds(:, 1), ds(:, 2))
        do col = 1, size(ds, 1)
          i = (row - 1)*size(ds, 1) + col
          if (now%contact(i)) then
            call linearize([now%q(i), now%q(n + i)], ds(col, :), friction%bound(now%p(i)), largest, r, zone(i), &
                           now%shear%direction(:, i), now%shear%compliance(i))
          else
            zone(i) = separated
            now%q([i, n + i]) = 0.0_wp
            now%shear%direction(:, i) = [1.0_wp, 0.0_wp]
            now%shear%compliance(i) = 0.0_wp
          end if
        end do
      end do
      !$omp end parallel do
      now%held = holding
      if (now%held) call hold(now%shear%compliance, zone)

      !$omp parallel do schedule(static) num_threads(now%operators%space%threads) private(bound, across, e)
      do i = 1, n
        active(i) = zone(i) /= separated
        active(n + i) = zone(i) == stick
        if (zone(i) == slip) then
          bound = friction%bound(now%p(i))
          e = now%shear%direction(:, i)
          across = 0.0_wp
          if (now%shear%compliance(i) < soft*now%shear%elastic_compliance) then
            across = dot_product(normal_to(e), [now%q(i), now%q(n + i)])
          end if
          now%q([i, n + i]) = bound*e + across*normal_to(e)
        end if
      end do
      !$omp end parallel do
    end associate
    call now%shear%weigh(now%contact)
  end subroutine classify

  !> Let the nodes stick that slip least: without any, nothing resists a prescribed load.
  subroutine hold(compliance, zone)
    !> Compliance of each node, the less the closer it is to sticking [m/Pa]
    real(wp), intent(inout) :: compliance(:)
    !> Zone of each node
    integer, intent(inout) :: zone(:)
    real(wp) :: low, high, middle
    integer :: i, n_contact

    n_contact = count(zone == slip)
    if (n_contact == 0) return
    low = minval(compliance, mask=zone == slip)
    high = maxval(compliance, mask=zone == slip)
    do i = 1, 60
      middle = sqrt(low)*sqrt(high)
      if (count(zone == slip .and. compliance <= middle) < held_share*n_contact) then
        low = middle
      else
        high = middle
      end if
    end do
    where (zone == slip .and. compliance <= high)
      zone = stick
      compliance = 0.0_wp
    end where
  end subroutine hold

  !> Loads that are prescribed as constraints on the unknowns.
  subroutine find_constraints(now, active, driven, constraint, missing)
    type(iterate_t), intent(in) :: now
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
  subroutine find_wanted(now, frame)
    type(iterate_t), intent(in) :: now
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
  end subroutine find_wanted

end module hc_active_zones
