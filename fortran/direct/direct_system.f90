!> The linear problem of the direct method: an area in contact, with stick and slip frozen.
!>
!> Equations: docs/theory/friction.md, (F7).
module hc_direct_system
  use, intrinsic :: iso_fortran_env, only: real32
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_lapack, only: dsgesv, dgelss
  use hc_block_cholesky, only: solve_blocks
  use hc_flexibility_dense, only: dense_flexibility_t
  use hc_contact_state, only: load_target_t, stick, slip, normal, along_x, along_y, n_motion, force_control
  use hc_coulomb, only: normal_to
  use hc_contact_problem, only: friction_problem_t
  use hc_load_constraints, only: driven_motions_t, new_driven_motions
  implicit none
  private

  public :: direct_iterate_t, infinite, unloaded, solve_area

  !> A compliance that leaves no traction across the direction of slip.
  real(wp), parameter :: infinite = huge(1.0_wp)

  character(len=*), parameter :: no_memory = &
    'not enough memory for the matrix of the contact area: use method "fft"'

  !> An iterate; over the nodes of the window.
  type :: direct_iterate_t
    !> Nodes that may come into contact, nodes in contact
    logical, allocatable :: candidate(:), contact(:)
    !> Initial gap (n) and relative displacement at the beginning of the step (n, 2) [m]
    real(wp), allocatable :: initial_gap(:), reference(:, :)
    !> Pressure (n) and shear traction (n, 2) [Pa]
    real(wp), allocatable :: p(:), q(:, :)
    !> Gap (n) and slip of the step (n, 2) under them [m]
    real(wp), allocatable :: gap(:), ds(:, :)
    !> Approach, shifts [m] and twist [rad]
    real(wp) :: motion(n_motion) = 0.0_wp
    !> Frozen state of the nodes in contact: stick or slip, its direction (2, n) and
    !> compliance across it; a node with an infinite one has no traction across
    integer, allocatable :: zone(:)
    real(wp), allocatable :: direction(:, :), compliance(:)
    !> The tractions carry all prescribed loads
    logical :: carried = .true.
    !> Linear systems solved so far
    integer :: solves = 0
  end type direct_iterate_t

contains

  !> Gap and slip that the motions alone would cause, without tractions (n, 3) [m].
  pure function unloaded(problem, it)
    !> What is given
    type(friction_problem_t), intent(in) :: problem
    !> Iterate
    type(direct_iterate_t), intent(in) :: it
    real(wp) :: unloaded(size(it%p), 3)

    unloaded(:, normal) = it%initial_gap - it%motion(normal)
    unloaded(:, along_x:) = -reshape(problem%rigid_displacement(it%motion), [size(it%p), 2]) - it%reference
  end function unloaded

  !> Tractions and motions with g = 0 on the contact, ds = 0 in stick, t.ds + D tau = 0 in slip.
  !>
  !> The unknowns are p on the contact, q_x and q_y in stick, tau in slip, in this order, and the changes
  !> of the rigid motions whose loads are prescribed. Unknown k acts with `traction(:, k)`, and its row
  !> adds up the displacements by `weight(:, k)`: they differ by the mu e in q = mu p e + tau t. Lengths are
  !> divided by the self-compliance of a node, so that every number is a pressure.
  subroutine solve_area(problem, flexibility, target, it, error)
    !> What is given
    type(friction_problem_t), intent(in) :: problem
    !> Its flexibility
    type(dense_flexibility_t), intent(in) :: flexibility
    !> Loads or motions to be reached
    type(load_target_t), intent(in) :: target
    !> Iterate
    type(direct_iterate_t), intent(inout) :: it
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    type(driven_motions_t) :: driven
    real(wp), allocatable :: matrix(:, :), rhs(:, :), unknown(:, :), weight(:, :), traction(:, :), resultant(:, :), &
                             rigid(:, :), direction(:, :)
    real(real32), allocatable :: first(:, :)
    logical :: solved
    integer, allocatable :: contact(:), stuck(:), sliding(:), node(:), place(:)
    real(wp) :: load(n_motion), slope(size(it%p))
    integer :: i, k, n, n_p, n_free, stat

    contact = pack([(i, i=1, size(it%p))], it%contact)
    stuck = pack(contact, it%zone(contact) == stick)
    sliding = pack(contact, it%zone(contact) == slip .and. it%compliance(contact) < infinite)
    allocate (node, source=[contact, stuck, stuck, sliding])
    place = unpack([(i, i=1, size(contact))], it%contact, 0)
    place = place(node)
    call new_driven_motions(driven, problem, target, reshape(it%contact, problem%lattice%extent))
    n = size(node)
    n_p = size(contact)
    n_free = size(driven%motion) + merge(1, 0, target%control(normal) == force_control)
    allocate (matrix(n, n), rhs(n, 0:n_free), unknown(n, 0:n_free), weight(3, n), resultant(n, n_free), &
              first(n_p, n_p), stat=stat)
    if (stat /= 0) then
      call raise(error, status%resources, no_memory)
      return
    end if
    weight = 0.0_wp
    weight(normal, :n_p) = 1.0_wp
    weight(along_x, n_p + 1:n_p + size(stuck)) = 1.0_wp
    weight(along_y, n_p + size(stuck) + 1:n_p + 2*size(stuck)) = 1.0_wp
    do k = n_p + 2*size(stuck) + 1, n
      weight(along_x:, k) = normal_to(it%direction(:, node(k)))
    end do
    traction = weight
    call problem%friction%find_slopes(1, it%p, slope)
    do k = 1, n_p
      if (it%zone(node(k)) == stick .or. .not. problem%friction%is_bounded()) cycle
      traction(along_x:, k) = slope(node(k))*it%direction(:, node(k))
    end do

    rigid = unloaded(problem, it)
    do k = 1, n
      rhs(k, 0) = -dot_product(weight(:, k), rigid(node(k), :))/problem%normal_compliance
    end do
    if (n_free > size(driven%motion)) then
      load(1) = target%value(normal)/problem%lattice%cell_area()
      rhs(:, 1) = weight(normal, :)
      resultant(:, 1) = traction(normal, :)
    end if
    do i = 1, size(driven%motion)
      k = n_free - size(driven%motion) + i
      load(k) = driven%load(i, problem, target)
      direction = reshape(driven%direction(i, problem), [size(it%p), 2])
      rhs(:, k) = sum(weight(along_x:, :)*transpose(direction(node, :)), dim=1)
      resultant(:, k) = sum(traction(along_x:, :)*transpose(direction(node, :)), dim=1)
    end do
    call assemble(problem, flexibility, contact, place, weight, traction, matrix)
    do k = n_p + 2*size(stuck) + 1, n
      matrix(k, k) = matrix(k, k) + it%compliance(node(k))/problem%normal_compliance
    end do
    do i = 1, n_p
      first(:, i) = real(flexibility%normal_influence(contact, contact(i))/problem%normal_compliance, real32)
    end do
    call solve_blocks(n, n_p, 1 + n_free, first, matrix, rhs, unknown, solved)
    if (.not. solved) then
      call solve_whole(matrix, rhs, unknown, error)
      if (allocated(error)) return
    end if

    call satisfy_loads(problem, driven, load(:n_free), resultant, unknown, it, error)
    if (allocated(error)) return
    it%p = 0.0_wp
    it%q = 0.0_wp
    it%p(contact) = unknown(:n_p, 0)
    do k = 1, n
      it%q(node(k), :) = it%q(node(k), :) + unknown(k, 0)*traction(along_x:, k)
    end do
  end subroutine solve_area

  !> Solve matrix.unknown = rhs by LU.
  subroutine solve_whole(matrix, rhs, unknown, error)
    !> Matrix, its factors on return
    real(wp), intent(inout), contiguous :: matrix(:, :)
    !> Right-hand sides
    real(wp), intent(in), contiguous :: rhs(:, :)
    !> Unknowns
    real(wp), intent(out), contiguous :: unknown(:, :)
    !> Allocated on failure: not enough memory, a singular matrix
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: work(size(rhs, 1), size(rhs, 2))
    real(real32), allocatable :: single(:)
    integer :: n, refinements, info, stat, pivot(size(matrix, 1))

    n = size(matrix, 1)
    allocate (single(n*(n + size(rhs, 2))), stat=stat)
    if (stat /= 0) then
      call raise(error, status%resources, no_memory)
      return
    end if
    call dsgesv(n, size(rhs, 2), matrix, n, pivot, rhs, n, unknown, n, work, single, refinements, info)
    if (info /= 0) call raise(error, status%no_convergence, 'the matrix of the contact area is singular')
  end subroutine solve_whole

  !> Find the motions whose loads are prescribed from these loads.
  !>
  !> Motions that the loads do not determine stay as they are (without a node in stick, say).
  subroutine satisfy_loads(problem, driven, load, resultant, rhs, it, error)
    !> What is given
    type(friction_problem_t), intent(in) :: problem
    !> Tangential motions driven by their loads
    type(driven_motions_t), intent(in) :: driven
    !> Loads over the cell area, the tangential ones last [Pa]
    real(wp), intent(in) :: load(:)
    !> Loads of unit unknowns (size(rhs, 1), size(load))
    real(wp), intent(in) :: resultant(:, :)
    !> Unknowns at the present motions, and those of unit motions; on return the first are at the new motions
    real(wp), intent(inout) :: rhs(:, 0:)
    !> Iterate
    type(direct_iterate_t), intent(inout) :: it
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    real(wp) :: stiffness(n_motion, n_motion), change(n_motion, 1), singular(n_motion), work(64)
    integer :: n, m, rank, info

    n = size(load)
    if (n == 0) return
    stiffness(:n, :n) = matmul(transpose(resultant), rhs(:, 1:))
    change(:n, 1) = load - matmul(rhs(:, 0), resultant)
    call dgelss(n, n, 1, stiffness, n_motion, change, n_motion, singular, problem%options%direct%undetermined_motion, &
                rank, work, size(work), info)
    if (info /= 0) then
      call raise(error, status%no_convergence, 'the rigid motions of the contact cannot be found')
      return
    end if
    rhs(:, 0) = rhs(:, 0) + matmul(rhs(:, 1:), change(:n, 1))
    it%carried = maxval(abs(load - matmul(rhs(:, 0), resultant))) <= &
                 problem%options%direct%load_rounding*sum(abs(rhs(:, 0)))

    change(:n, 1) = change(:n, 1)*problem%normal_compliance
    m = size(driven%motion)
    if (n > m) it%motion(normal) = it%motion(normal) + change(1, 1)
    call driven%set_motions(driven%multipliers(it%motion) + change(n - m + 1:n, 1), it%motion)
  end subroutine satisfy_loads

  !> Matrix of the nodes' mutual influence: weight.K.traction, divided by the self-compliance.
  subroutine assemble(problem, flexibility, contact, place, weight, traction, matrix)
    !> What is given
    type(friction_problem_t), intent(in) :: problem
    !> Its flexibility
    type(dense_flexibility_t), intent(in) :: flexibility
    !> Nodes in contact
    integer, intent(in) :: contact(:)
    !> Node of each unknown, as a place in `contact`
    integer, intent(in) :: place(:)
    !> Displacements that each row adds up, traction of each unknown (3, size(place))
    real(wp), intent(in) :: weight(:, :), traction(:, :)
    !> Matrix
    real(wp), intent(out) :: matrix(:, :)
    real(wp) :: u(3, size(contact)), by_pressure(3, size(contact)), pressure(3)
    integer :: column, k

    !$omp parallel do private(u, by_pressure, pressure, k) if (size(place) > 500)
    do column = 1, size(place)
      call flexibility%response(contact, contact(place(column)), traction(:, column)/problem%normal_compliance, u)
      if (problem%goodman) then
        ! the gap does not feel shear tractions
        pressure = [traction(normal, column)/problem%normal_compliance, 0.0_wp, 0.0_wp]
        call flexibility%response(contact, contact(place(column)), pressure, by_pressure)
        u(normal, :) = by_pressure(normal, :)
      end if
      do k = 1, size(place)
        matrix(k, column) = dot_product(weight(:, k), u(:, place(k)))
      end do
    end do
    !$omp end parallel do
  end subroutine assemble

end module hc_direct_system
