!> Active sets of an iterate: contact area, stick and slip, and loads as constraints.
!>
!> Equations: docs/theory/friction.md, (F5), (F8); docs/theory/normal_contact.md, (N6).
module hc_active_zones
  use hc_precision, only: wp, lk, zk
  use hc_contact_state, only: separated, stick, slip, along_x, along_y, n_motion, force_control
  use hc_active_set, only: active_set_t, find_span
  use hc_frame_rows, only: plane_row
  use hc_friction_iterate, only: friction_iterate_t
  use hc_load_constraints, only: driven_motions_t, new_driven_motions, fix_in_stick
  implicit none
  private

  public :: linearize_law, shear_parameter, classify, find_constraints, find_constraint, find_prescribed_displacement

contains

  !> Linearise a compliant law of contact about the present pressure and gap.
  subroutine linearize_law(now, gap, from_pressure)
    !> Iterate
    type(friction_iterate_t), intent(inout) :: now
    !> Gap of the present tractions [m]
    real(wp), intent(in), contiguous :: gap(:)
    !> The gap means nothing yet: about the pressure
    logical, intent(in) :: from_pressure
    real(wp) :: r

    if (.not. allocated(now%pressure%compliance)) return
    if (.not. now%operators%space%max_abs(now%p) > 0.0_wp) return
    r = 0.0_wp
    if (.not. from_pressure) r = now%problem%normal_classification_parameter(now%operators%space%count(now%contact))
    call now%problem%linearize(r, now%p, gap, now%contact, now%pressure%compliance, now%pressure%offset)
    call now%operators%normal%set_active(now%contact, now%pressure%compliance)
  end subroutine linearize_law

  !> Compute r of (F8), smaller under strong coupling, where nodes are fixed, and for the first shear traction [Pa/m].
  real(wp) function shear_parameter(now) result(r)
    type(friction_iterate_t), intent(in) :: now

    r = now%share_of_r*now%problem%classification_parameter(now%operators%space%count(now%contact))
    if (.not. now%first) return
    if (.not. now%operators%space%max_abs(now%q) > 0.0_wp) r = now%problem%options%newton%cautious_share*r
  end function shear_parameter

  !> Compute r of (F8), or a parameter under which all nodes slip where all would stick against a shift that no traction takes up:
  !> that of a complete contact of a window that repeats, whose mean displacement is zero [Pa/m].
  real(wp) function sliding_parameter(now) result(r)
    type(friction_iterate_t), intent(in) :: now
    real(wp), dimension(now%problem%lattice%extent(1)) :: dsx, dsy
    real(wp) :: total(3, now%problem%own_rows()), sums(3), unit, scale
    integer(zk) :: zone(now%problem%lattice%extent(1))
    integer :: n, n_col, row, from, to, k

    r = shear_parameter(now)
    if (.not. (now%problem%lattice%is_periodic() .and. now%problem%friction%is_bounded())) return
    if (now%problem%medium%mean_compliance() > 0.0_wp) return
    associate (space => now%operators%space)
      if (space%count(logical(.not. now%contact, lk)) > 0) return
      n = size(now%p)
      n_col = size(dsx)
      unit = 1.0_wp/space%max(now%p)
      !$omp parallel do schedule(static) num_threads(space%threads) private(dsx, dsy, zone, from, to)
      do row = 1, size(total, 2)
        to = row*n_col
        from = to - n_col + 1
        call now%slip_row(row, 1, dsx, dsy)
        call now%problem%friction%find_zones(from, unit, r, now%p(from:to), now%q(from:to), now%q(n + from:n + to), dsx, dsy, zone)
        total(:, row) = [sum(dsx), sum(dsy), real(count(zone == slip), wp)]
      end do
      !$omp end parallel do
      sums = [(space%total(total(k, :)), k=1, 3)]
      where (now%target%control([along_x, along_y]) == force_control) sums(:2) = 0.0_wp
      associate (mean => norm2(sums(:2))/space%count(now%contact))
        scale = now%traction_scale()
        ! from any traction of the disc to its other side
        if (.not. sums(3) > 0.0_wp .and. mean > now%tolerance*now%problem%tangential_compliance*scale) r = 4.0_wp*scale/mean
      end associate
    end associate
  end function sliding_parameter

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
    logical(lk), allocatable, intent(out) :: active(:)
    !> Zones of the nodes in contact
    integer(zk), allocatable :: zone(:)
    real(wp), dimension(now%problem%lattice%extent(1)) :: dsx, dsy, bound, ahead, aside
    real(wp) :: r, p_max, soft
    integer :: n, k, i, from, to, at, last, m

    n = size(now%p)
    call now%shear%set_contact(now%contact)
    associate (friction => now%problem%friction, nodes => now%shear%nodes, direction => now%shear%direction, &
               compliance => now%shear%compliance, threads => now%operators%space%threads)
      allocate (zone(nodes%n_active), active(2*n))
      if (allocated(now%shear%rest)) deallocate (now%shear%rest)
      if (.not. friction%is_isotropic()) allocate (now%shear%rest(nodes%n_active))
      r = sliding_parameter(now)
      soft = now%problem%options%newton%soft_spring*now%shear%elastic_compliance
      p_max = now%operators%space%max(now%p)
      !$omp parallel do schedule(static) num_threads(threads)
      do i = 1, n
        active(i) = now%contact(i)
        active(n + i) = .false.
        now%q(i) = merge(now%q(i), 0.0_wp, now%contact(i))
        now%q(n + i) = merge(now%q(n + i), 0.0_wp, now%contact(i))
      end do
      !$omp end parallel do
      !$omp parallel do schedule(static) num_threads(threads) private(dsx, dsy, from, to, at, last, m)
      do k = 1, size(nodes%first)
        call take_run(k, from, to, at, last, m)
        call now%slip_row((from - 1)/size(dsx) + 1, modulo(from - 1, size(dsx)) + 1, dsx(:m), dsy(:m))
        call friction%linearize(from, p_max, r, logical(now%contact(from:to)), now%p(from:to), now%q(from:to), &
                                now%q(n + from:n + to), dsx(:m), dsy(:m), zone(at:last), direction(:, at:last), compliance(at:last))
      end do
      !$omp end parallel do
      now%fixed = fixing
      if (now%fixed) call fix_in_stick(now%operators%space, now%problem%options%contact%fixed_share, compliance, zone)

      !$omp parallel do schedule(static) num_threads(threads) private(bound, ahead, aside, from, to, at, last, m)
      do k = 1, size(nodes%first)
        call take_run(k, from, to, at, last, m)
        active(n + from:n + to) = zone(at:last) == stick
        call friction%find_bounds(from, now%p(from:to), bound(:m))
        call friction%find_boundary(direction(:, at:last), ahead(:m), aside(:m))
        ahead(:m) = bound(:m)*ahead(:m)
        aside(:m) = bound(:m)*aside(:m)
        if (allocated(now%shear%rest)) now%shear%rest(at:last) = aside(:m)
        call put_on_boundary(m, zone(at:last), direction(:, at:last), ahead, aside, compliance(at:last) < soft, now%q(from:to), &
                             now%q(n + from:n + to))
      end do
      !$omp end parallel do
    end associate
    call now%shear%use_frames(now%contact)

  contains

    !> Find the nodes of a run of the contact, the places of the first and the last of them, and their number.
    pure subroutine take_run(k, from, to, at, last, m)
      integer, intent(in) :: k
      integer, intent(out) :: from, to, at, last, m

      from = now%shear%nodes%first(k)
      to = now%shear%nodes%last(k)
      at = now%shear%nodes%place(k)
      m = to - from + 1
      last = at + m - 1
    end subroutine take_run

  end subroutine classify

  !> Put the tractions of the slipping nodes of a row on the boundary of the admissible ones, with a start across.
  pure subroutine put_on_boundary(n, zone, direction, ahead, aside, stiff, qx, qy)
    !> Number of nodes, and their zones
    integer, intent(in) :: n
    integer(zk), intent(in) :: zone(n)
    !> Directions e; components of the boundary along e and across [Pa]
    real(wp), intent(in) :: direction(2, n), ahead(n), aside(n)
    !> The spring of a node is stiff: its component across is left as a start
    logical, intent(in) :: stiff(n)
    !> Traction along x and y [Pa]
    real(wp), intent(inout) :: qx(n), qy(n)
    real(wp) :: across
    integer :: i

    !$omp simd private(across)
    do i = 1, n
      across = merge(-direction(2, i)*qx(i) + direction(1, i)*qy(i), aside(i), stiff(i))
      qx(i) = merge(ahead(i)*direction(1, i) - across*direction(2, i), qx(i), zone(i) == slip)
      qy(i) = merge(ahead(i)*direction(2, i) + across*direction(1, i), qy(i), zone(i) == slip)
    end do
  end subroutine put_on_boundary

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
    !> Loads less those of the present traction, over the cell area
    real(wp), allocatable, intent(out) :: missing(:)
    integer :: k

    call new_driven_motions(driven, now%problem, now%target, now%contact)
    allocate (constraint(nodes%n_active, size(driven%motion)), missing(size(driven%motion)))
    do k = 1, size(driven%motion)
      call find_constraint(now, nodes, driven, k, constraint(:, k))
      missing(k) = driven%load(k, now%problem, now%target) - carried_load(now, driven, k)
    end do
  end subroutine find_constraints

  !> Find the constraint vector of one of the loads.
  subroutine find_constraint(now, nodes, driven, k, constraint)
    !> Iterate
    type(friction_iterate_t), intent(in) :: now
    !> Unknowns, in the frames (of 2 n)
    type(active_set_t), intent(in) :: nodes
    !> Motions that are driven by their loads, and which of them
    type(driven_motions_t), intent(in) :: driven
    integer, intent(in) :: k
    !> Constraint vector at the unknowns (n_active)
    real(wp), intent(inout), contiguous :: constraint(:)
    real(wp), dimension(now%problem%lattice%extent(1)) :: ux, uy, across
    integer :: run, from, m, at

    !$omp parallel do schedule(static) num_threads(now%operators%space%threads) private(ux, uy, across, from, m, at)
    do run = 1, size(nodes%pairs%first)
      from = nodes%pairs%first(run)
      m = nodes%pairs%last(run) - from + 1
      call driven%direction_row(k, now%problem, from, ux(:m), uy(:m))
      at = nodes%pairs%place(run)
      ! into the frames, which takes the same reflection as out of them
      call plane_row(m, now%shear%direction(:, at:at + m - 1), ux, uy, constraint(at:at + m - 1), across)
      if (nodes%pairs%second(run) == 0) cycle
      at = nodes%pairs%n_first + nodes%pairs%second(run)
      constraint(at:at + m - 1) = across(:m)
    end do
    !$omp end parallel do
  end subroutine find_constraint

  !> Compute the load of the present shear traction along a motion, over the cell area [Pa].
  real(wp) function carried_load(now, driven, k)
    type(friction_iterate_t), intent(in) :: now
    !> Motions that are driven by their loads, and which of them
    type(driven_motions_t), intent(in) :: driven
    integer, intent(in) :: k
    real(wp), dimension(now%problem%lattice%extent(1)) :: ux, uy
    real(wp) :: part(now%problem%own_rows())
    integer :: n, row, from, to, low, high

    n = size(now%p)
    !$omp parallel do schedule(static) num_threads(now%operators%space%threads) private(ux, uy, from, to, low, high)
    do row = 1, size(part)
      from = (row - 1)*size(ux)
      call find_span(now%contact(from + 1:from + size(ux)), low, high)
      to = from + high
      from = from + low
      call driven%direction_row(k, now%problem, from, ux(:to - from + 1), uy(:to - from + 1))
      part(row) = dot_product(ux(:to - from + 1), now%q(from:to)) + dot_product(uy(:to - from + 1), now%q(n + from:n + to))
    end do
    !$omp end parallel do
    carried_load = now%operators%space%total(part)
  end function carried_load

  !> Find the prescribed part of the displacements of sticking nodes: their old position, and the motions that
  !> are prescribed.
  subroutine find_prescribed_displacement(now, frame)
    !> Iterate
    type(friction_iterate_t), intent(in) :: now
    !> In the frames; on the nodes in contact (2 n)
    real(wp), intent(inout), contiguous :: frame(:)
    real(wp) :: motion(n_motion)
    integer :: n, k, from, to

    n = size(now%contact)
    motion = merge(now%motion, 0.0_wp, now%target%control /= force_control)
    associate (nodes => now%shear%nodes, n_col => now%problem%lattice%extent(1))
      !$omp parallel do schedule(static) num_threads(now%operators%space%threads) private(from, to)
      do k = 1, size(nodes%first)
        from = nodes%first(k)
        to = nodes%last(k)
        call now%problem%rigid_displacement_row(motion, (from - 1)/n_col + 1, frame(from:to), frame(n + from:n + to), &
                                                modulo(from - 1, n_col) + 1)
        frame(from:to) = frame(from:to) + now%origin(from:to)
        frame(n + from:n + to) = frame(n + from:n + to) + now%origin(n + from:n + to)
      end do
      !$omp end parallel do
    end associate
    call now%shear%turn(frame)
  end subroutine find_prescribed_displacement

end module hc_active_zones
