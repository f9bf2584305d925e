!> Tangential motions that are driven by their loads.
!>
!> Each is an unknown, and its load a constraint on the shear traction: the sum of the
!> traction times the unit motion is the load. A torque is taken about the middle of the
!> contact where the tangential loads are given, too: in a contact far from the origin a twist
!> about the origin is nearly a shift.
!>
!> Equations: docs/theory/friction.md, (F4), (F14).
module hc_load_constraints
  use hc_precision, only: wp, pi, lk, zk
  use hc_lapack, only: eliminate
  use hc_field_space, only: field_space_t
  use hc_active_set, only: active_set_t, new_active_set, find_span
  use hc_contact_state, only: load_target_t, stick, slip, normal, along_x, along_y, about_z, n_motion, force_control
  use hc_contact_problem, only: friction_problem_t
  implicit none
  private

  public :: driven_motions_t, new_driven_motions, overloads, fix_in_stick

  !> The driven motions of a contact.
  type :: driven_motions_t
    !> Some of along_x, along_y, about_z
    integer, allocatable :: motion(:)
    !> Point that a torque is taken about [m]
    real(wp) :: center(2) = 0.0_wp
    !> Unit of length of a twist: the contact radius [m]
    real(wp) :: arm = 1.0_wp
  contains
    !> Tangential displacement of a unit motion
    procedure :: direction, direction_row
    !> Load of a motion over the cell area
    procedure :: load
    !> Multipliers of the constraints from the motions, and back
    procedure :: multipliers, set_motions
  end type driven_motions_t

contains

  !> Find the driven motions of a contact.
  subroutine new_driven_motions(self, problem, target, contact)
    !> Motions to be set up
    type(driven_motions_t), intent(out) :: self
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target
    !> Nodes in contact (n_col, own rows)
    logical(lk), intent(in) :: contact(size(problem%initial_gap, 1), size(problem%initial_gap, 2))
    !> Nodes of each row, and the sum of their columns
    real(wp), dimension(size(contact, 2)) :: nodes, columns
    real(wp) :: middle(2), n_row, in_row, touching
    integer :: n_contact, row, col, low, high

    associate (control => target%control, space => problem%space, lattice => problem%lattice)
      !$omp parallel do schedule(static) num_threads(space%threads) private(col, low, high, n_row, in_row)
      do row = 1, size(contact, 2)
        call find_span(contact(:, row), low, high)
        n_row = 0.0_wp
        in_row = 0.0_wp
        !$omp simd reduction(+: n_row, in_row)
        do col = low, high
          n_row = n_row + merge(1.0_wp, 0.0_wp, contact(col, row))
          in_row = in_row + col*merge(1.0_wp, 0.0_wp, contact(col, row))
        end do
        nodes(row) = n_row
        columns(row) = in_row
      end do
      !$omp end parallel do
      touching = space%total(nodes)
      n_contact = max(nint(touching), 1)
      ! nothing turns a single node
      self%motion = pack([along_x, along_y, about_z], control(along_x:about_z) == force_control .and. &
                         [.true., .true., n_contact > 1])
      if (touching > 0.0_wp) then
        middle = [space%total(columns), space%total(nodes*[(real(row + problem%rows_before(), wp), row=1, size(nodes))])]
        middle = middle/n_contact + lattice%first - 1
        middle = lattice%origin + matmul(lattice%basis, middle)
        if (control(along_y) == force_control) self%center(1) = middle(1)
        if (control(along_x) == force_control) self%center(2) = middle(2)
      end if
    end associate
    self%arm = sqrt(problem%lattice%cell_area()*n_contact/pi)
  end subroutine new_driven_motions

  !> Compute the tangential displacement of a unit motion (n_col, own rows, 2).
  function direction(self, k, problem)
    class(driven_motions_t), intent(in) :: self
    !> Which of the driven motions
    integer, intent(in) :: k
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    real(wp), allocatable :: direction(:, :, :)
    integer :: row

    allocate (direction(problem%lattice%extent(1), problem%own_rows(), 2))
    !$omp parallel do schedule(static) num_threads(problem%space%threads)
    do row = 1, size(direction, 2)
      call self%direction_row(k, problem, (row - 1)*size(direction, 1) + 1, direction(:, row, 1), direction(:, row, 2))
    end do
    !$omp end parallel do
  end function direction

  !> Compute the tangential displacement of a unit motion at nodes that follow each other in a row.
  pure subroutine direction_row(self, k, problem, first, ux, uy)
    class(driven_motions_t), intent(in) :: self
    !> Which of the driven motions
    integer, intent(in) :: k
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> Number of the first node, from the first own row on
    integer, intent(in) :: first
    !> Components along x and y (number of nodes)
    real(wp), intent(out), contiguous :: ux(:), uy(:)
    real(wp) :: start(2)
    integer :: i, col, row

    ux = 0.0_wp
    uy = 0.0_wp
    select case (self%motion(k))
    case (along_x)
      ux = 1.0_wp
    case (along_y)
      uy = 1.0_wp
    case default
      associate (lattice => problem%lattice)
        ! from the beginning of the row: a node has one value, wherever the nodes begin
        col = modulo(first - 1, lattice%extent(1))
        row = (first - 1)/lattice%extent(1) + problem%rows_before()
        start = lattice%origin + matmul(lattice%basis, real(lattice%first + [0, row], wp)) - self%center
        do i = 1, size(ux)
          ux(i) = -(start(2) + (col + i - 1)*lattice%basis(2, 1))/self%arm
          uy(i) = (start(1) + (col + i - 1)*lattice%basis(1, 1))/self%arm
        end do
      end associate
    end select
  end subroutine direction_row

  !> Compute the prescribed load of a motion over the cell area [Pa].
  pure real(wp) function load(self, k, problem, target)
    class(driven_motions_t), intent(in) :: self
    !> Which of the driven motions
    integer, intent(in) :: k
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target

    load = target%value(self%motion(k))
    if (self%motion(k) == about_z) then
      load = (load - self%center(1)*target%value(along_y) + self%center(2)*target%value(along_x))/self%arm
    end if
    load = load/problem%lattice%cell_area()
  end function load

  !> Compute the multipliers of given motions: shifts are those of the center, if it turns.
  pure function multipliers(self, motion) result(multiplier)
    class(driven_motions_t), intent(in) :: self
    !> Approach, shifts and twist
    real(wp), intent(in) :: motion(n_motion)
    real(wp), allocatable :: multiplier(:)

    multiplier = motion(self%motion)
    if (any(self%motion == about_z)) then
      where (self%motion == along_x) multiplier = multiplier - motion(about_z)*self%center(2)
      where (self%motion == along_y) multiplier = multiplier + motion(about_z)*self%center(1)
      where (self%motion == about_z) multiplier = multiplier*self%arm
    end if
  end function multipliers

  !> Set the driven motions from their multipliers; the others stay as they are.
  pure subroutine set_motions(self, multiplier, motion)
    class(driven_motions_t), intent(in) :: self
    !> Multipliers of the driven motions
    real(wp), intent(in) :: multiplier(:)
    !> Approach, shifts and twist
    real(wp), intent(inout) :: motion(n_motion)

    motion(self%motion) = multiplier
    if (any(self%motion == about_z)) then
      motion(about_z) = motion(about_z)/self%arm
      if (any(self%motion == along_x)) motion(along_x) = motion(along_x) + motion(about_z)*self%center(2)
      if (any(self%motion == along_y)) motion(along_y) = motion(along_y) - motion(about_z)*self%center(1)
    end if
  end subroutine set_motions

  !> Return whether more is prescribed than full sliding carries, for a pressure with the residual R_n.
  !>
  !> Friction carries the prescribed loads times a factor, and no more than
  !>
  !>     factor <= sum of mu p |u| / (loads . motion)
  !>
  !> with u the displacement of any motion that they drive (upper bound of limit analysis, (F14) of
  !> docs/theory/friction.md). For shifts alone the
  !> least is mu P/|Q|. With a torque, or without a prescribed P, it depends on the pressure: a gap that makes the
  !> residual R_n moves it by that share of its largest value where it acts on single nodes, by less where it is smooth.
  logical function overloads(problem, target, pressure, residual_normal)
    !> The problem
    type(friction_problem_t), intent(in) :: problem
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target
    !> Pressure (n_col, own rows) [Pa], and its residual R_n
    real(wp), intent(in) :: pressure(size(problem%initial_gap, 1), size(problem%initial_gap, 2)), residual_normal
    type(driven_motions_t) :: driven
    real(wp), allocatable :: u(:, :, :), load(:), bound(:), length(:), field(:, :, :)
    real(wp) :: carried, error, factor, before, bounds(size(pressure))
    logical(lk), allocatable :: contact(:, :)
    type(active_set_t) :: nodes
    integer :: k, try, n_contact

    overloads = .false.
    if (.not. problem%friction%is_bounded()) return
    n_contact = problem%space%count_positive(pressure)
    if (n_contact == 0) return
    contact = pressure > 0.0_wp
    call new_driven_motions(driven, problem, target, contact)
    associate (n => size(driven%motion), options => problem%options%contact)
      load = [(driven%load(k, problem, target), k=1, n)]
      overloads = any(abs(load) > 0.0_wp) .and. .not. problem%friction%resists()
      if (overloads .or. n == 0) return
      call new_active_set(nodes, reshape(contact, [size(contact)]), problem%space, shape(contact))
      allocate (u(nodes%n_active, 2, n))
      error = residual_normal
      carried = problem%lattice%cell_area()*problem%space%sum(pressure, contact)
      if (target%control(normal) == force_control) then
        ! under the prescribed load
        call problem%friction%find_bounds(1, target%value(normal)/carried*reshape(pressure, [size(pressure)]), bounds)
        if (.not. any(driven%motion == about_z)) error = 0.0_wp
      else
        call problem%friction%find_bounds(1, reshape(pressure, [size(pressure)]), bounds)
      end if
      bound = pack(bounds, reshape(contact, [size(contact)]))
      if (error > options%trusted_residual) return
      do k = 1, n
        field = driven%direction(k, problem)
        u(:, 1, k) = pack(field(:, :, 1), contact)
        u(:, 2, k) = pack(field(:, :, 2), contact)
        ! where it has a direction, friction takes b(p) |A u| of a slip u
        if (.not. problem%friction%is_isotropic()) u(:, :, k) = matmul(u(:, :, k), problem%friction%stretch())
      end do
      allocate (length(nodes%n_active), source=1.0_wp)
      factor = huge(1.0_wp)
      do try = 1, options%max_limit_motions
        before = factor
        call improve_motion(nodes%space, u, bound, load, options%least_limit_gain, length, factor)
        if (.not. factor < (1.0_wp - options%least_limit_gain)*before) exit
      end do
      overloads = factor*(1.0_wp + error) < 1.0_wp - options%load_rounding
    end associate
  end function overloads

  !> Try the motion of nodes on springs of stiffness bound/length: large slip lowers the resistance.
  subroutine improve_motion(space, u, bound, load, least_length, length, factor)
    !> Space of the nodes
    type(field_space_t), intent(in) :: space
    !> Displacements of unit motions (n, 2, motion)
    real(wp), intent(in) :: u(:, :, :)
    !> Largest traction of each node, and load of each motion over the cell area [Pa]
    real(wp), intent(in) :: bound(:), load(:)
    !> Least displacement of a node that counts, relative to the largest
    real(wp), intent(in) :: least_length
    !> Displacement of each node in the motion tried before, and in this one
    real(wp), intent(inout) :: length(:)
    !> Least load factor so far
    real(wp), intent(inout) :: factor
    real(wp) :: stiffness(size(load), size(load)), motion(size(load), 1), moved(size(bound), 2)
    integer :: i, k

    do k = 1, size(load)
      do i = 1, size(load)
        stiffness(i, k) = space%dot(bound/length, sum(u(:, :, i)*u(:, :, k), dim=2))
      end do
    end do
    motion(:, 1) = load
    ! any motion gives an upper bound, also one from a singular matrix
    call eliminate(stiffness, motion)
    associate (work => dot_product(load, motion(:, 1)))
      if (.not. work > 0.0_wp) return
      motion = motion/work
    end associate
    moved = 0.0_wp
    do k = 1, size(load)
      moved = moved + motion(k, 1)*u(:, :, k)
    end do
    length = norm2(moved, dim=2)
    factor = min(factor, space%dot(bound, length))
    length = max(length, least_length*space%largest(maxval(length)))
  end subroutine improve_motion

  !> Set the nodes that slip least to stick: without any, nothing resists a prescribed load.
  subroutine fix_in_stick(space, share, compliance, zone)
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Share of the slipping nodes to be fixed
    real(wp), intent(in) :: share
    !> Compliance of each node, the less the closer it is to sticking; 0 where it is fixed [m/Pa]
    real(wp), intent(inout), contiguous :: compliance(:)
    !> Zone of each node
    integer(zk), intent(inout) :: zone(:)
    logical(lk) :: slips(size(zone))
    real(wp) :: low, high, middle
    integer :: i, n_slip

    slips = zone == slip
    n_slip = space%count(slips)
    if (n_slip == 0) return
    low = space%min(compliance, slips)
    high = space%max(compliance, slips)
    do i = 1, 60
      middle = sqrt(low)*sqrt(high)
      if (space%count(logical(slips .and. compliance <= middle, lk)) < share*n_slip) then
        low = middle
      else
        high = middle
      end if
    end do
    where (slips .and. compliance <= high)
      zone = stick
      compliance = 0.0_wp
    end where
  end subroutine fix_in_stick

end module hc_load_constraints
