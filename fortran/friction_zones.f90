!> What the tractions of an iterate call for: contact area, stick and slip, and loads as constraints.
module hc_friction_zones
  use hc_precision, only: wp, pi
  use hc_contact_state, only: separated, stick, slip, along_x, along_y, about_z, n_motion, force_control
  use hc_friction_law, only: linearize, normal_to
  use hc_friction_problem, only: classification_scale
  use hc_friction_iterate, only: iterate_t, cautious
  use hc_spring_blend, only: soft
  use hc_driven_motions, only: driven_motions_t, new_driven_motions
  use hc_vectors, only: maximum
  implicit none
  private

  public :: find_contact, classify, find_constraints, find_wanted

  !> Share of the nodes that are held where none sticks.
  real(wp), parameter :: held_share = 0.25_wp

contains

  !> Nodes with p - r g > 0: one step of a projected gradient map, which contracts
  !> because r is scaled with the size of the contact.
  subroutine find_contact(self, gap, contact)
    type(iterate_t), intent(in) :: self
    !> Gap of the present tractions [m]
    real(wp), intent(in), contiguous :: gap(:)
    !> The nodes (n)
    logical, allocatable, intent(out) :: contact(:)
    real(wp) :: r
    integer :: i, n_contact

    r = classification_scale/(2.0_wp*pi*self%problem%pair%lambda_1 &
                              *sqrt(self%problem%lattice%cell_area()*max(count(self%contact), 1)/pi))
    allocate (contact(size(gap)))
    n_contact = 0
    !$omp parallel do schedule(static) num_threads(self%operators%n_threads) reduction(+: n_contact)
    do i = 1, size(gap)
      contact(i) = self%candidate(i) .and. self%p(i) - r*gap(i) > 0.0_wp
      n_contact = n_contact + merge(1, 0, contact(i))
    end do
    !$omp end parallel do
    if (n_contact == 0) contact = self%candidate .and. gap <= minval(gap, mask=self%candidate)
  end subroutine find_contact

  !> Stick, slip and frames that the present tractions call for.
  !>
  !> The shear traction is put on the cone where a node slips, and its component across
  !> left as a start.
  subroutine classify(self, holding, active)
    type(iterate_t), intent(inout) :: self
    !> Let some nodes stick where none does
    logical, intent(in) :: holding
    !> Components in the frames that carry unknowns (2 n): both in stick, that along t in slip
    logical, allocatable, intent(out) :: active(:)
    integer, allocatable :: zone(:)
    real(wp) :: ds(self%problem%lattice%extent(1), 2), r, bound, largest, across, e(2)
    integer :: n, n_stick, row, col, i

    n = size(self%p)
    allocate (zone(n), active(2*n))
    r = self%caution*self%problem%classification_parameter(count(self%contact))
    if (self%first .and. .not. any(abs(self%q) > 0.0_wp)) r = cautious*r
    associate (friction => self%problem%friction)
      largest = friction%bound(maximum(self%p, self%operators%n_threads))
      n_stick = 0
      !$omp parallel do schedule(static) num_threads(self%operators%n_threads) private(ds, col, i) reduction(+: n_stick)
      do row = 1, self%problem%lattice%extent(2)
        call self%slip_row(row, ds(:, 1), ds(:, 2))
        do col = 1, size(ds, 1)
          i = (row - 1)*size(ds, 1) + col
          if (self%contact(i)) then
            call linearize([self%q(i), self%q(n + i)], ds(col, :), friction%bound(self%p(i)), largest, r, zone(i), &
                           self%shear%direction(:, i), self%shear%compliance(i))
            if (zone(i) == stick) n_stick = n_stick + 1
          else
            zone(i) = separated
            self%q([i, n + i]) = 0.0_wp
            self%shear%direction(:, i) = [1.0_wp, 0.0_wp]
            self%shear%compliance(i) = 0.0_wp
          end if
        end do
      end do
      !$omp end parallel do
      self%held = holding .and. n_stick == 0
      if (self%held) call hold(self%shear%compliance, zone)

      !$omp parallel do schedule(static) num_threads(self%operators%n_threads) private(bound, across, e)
      do i = 1, n
        active(i) = zone(i) /= separated
        active(n + i) = zone(i) == stick
        if (zone(i) == slip) then
          bound = friction%bound(self%p(i))
          e = self%shear%direction(:, i)
          across = 0.0_wp
          if (self%shear%compliance(i) < soft*self%shear%elastic_compliance) then
            across = dot_product(normal_to(e), [self%q(i), self%q(n + i)])
          end if
          self%q([i, n + i]) = bound*e + across*normal_to(e)
        end if
      end do
      !$omp end parallel do
    end associate
    call self%shear%weigh(self%contact)
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
  subroutine find_constraints(self, active, driven, constraint, missing)
    type(iterate_t), intent(in) :: self
    !> Unknowns, in the frames (2 n)
    logical, intent(in) :: active(:)
    !> Motions that are driven by their loads
    type(driven_motions_t), intent(out) :: driven
    !> Constraint vectors, in the frames (2 n, number of driven motions)
    real(wp), allocatable, intent(out) :: constraint(:, :)
    !> What the present traction lacks of the loads, over the cell area
    real(wp), allocatable, intent(out) :: missing(:)
    real(wp) :: part(self%problem%lattice%extent(2)), unit(self%problem%lattice%extent(1), 2), t, e
    integer :: n, k, row, col, i

    n = size(self%p)
    call new_driven_motions(driven, self%problem, self%target, self%contact)
    allocate (constraint(2*n, size(driven%motion)), missing(size(driven%motion)))
    do k = 1, size(driven%motion)
      !$omp parallel do schedule(static) num_threads(self%operators%n_threads) private(unit, t, e, col, i)
      do row = 1, size(part)
        call driven%direction_row(k, self%problem, row, unit(:, 1), unit(:, 2))
        part(row) = 0.0_wp
        do col = 1, size(unit, 1)
          i = (row - 1)*size(unit, 1) + col
          part(row) = part(row) + unit(col, 1)*self%q(i) + unit(col, 2)*self%q(n + i)
          t = -self%shear%direction(2, i)*unit(col, 1) + self%shear%direction(1, i)*unit(col, 2)
          e = self%shear%direction(1, i)*unit(col, 1) + self%shear%direction(2, i)*unit(col, 2)
          constraint(i, k) = merge(t, 0.0_wp, active(i))
          constraint(n + i, k) = merge(e, 0.0_wp, active(n + i))
        end do
      end do
      !$omp end parallel do
      missing(k) = driven%load(k, self%problem, self%target) - sum(part)
    end do
  end subroutine find_constraints

  !> Displacements that sticking nodes should have as far as it is known: where they stood, and the motions that
  !> are prescribed.
  subroutine find_wanted(self, frame)
    type(iterate_t), intent(in) :: self
    !> In the frames (2 n)
    real(wp), intent(out), contiguous :: frame(:)
    real(wp) :: motion(n_motion), x, y
    integer :: n, row, col, i

    n = size(self%p)
    motion = merge(self%motion, 0.0_wp, self%target%control /= force_control)
    !$omp parallel do schedule(static) num_threads(self%operators%n_threads) private(x, y, col, i)
    do row = 1, self%problem%lattice%extent(2)
      do col = 1, self%problem%lattice%extent(1)
        i = (row - 1)*self%problem%lattice%extent(1) + col
        x = self%origin(i) + (motion(along_x) - motion(about_z)*self%problem%y(col, row))
        y = self%origin(n + i) + (motion(along_y) + motion(about_z)*self%problem%x(col, row))
        frame(i) = -self%shear%direction(2, i)*x + self%shear%direction(1, i)*y
        frame(n + i) = self%shear%direction(1, i)*x + self%shear%direction(2, i)*y
      end do
    end do
    !$omp end parallel do
  end subroutine find_wanted

end module hc_friction_zones
