!> The linear problem of the direct method: an area in contact, with stick and slip frozen.
!>
!> Equations: docs/theory/friction.md, (F7).
module hc_direct_system
  use, intrinsic :: iso_fortran_env, only: real32, int64
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_memory, only: require_memory
  use hc_lapack, only: dsgesv, dgelss
  use hc_block_cholesky, only: solve_blocks
  use hc_area_factors, only: factored_area_t
  use hc_direct_iterate, only: direct_iterate_t, infinite
  use hc_area_system, only: area_t, solve_with_factors
  use hc_contact_state, only: stick, slip, normal, along_x, along_y, n_motion, force_control
  use hc_disc_law, only: normal_to
  use hc_load_constraints, only: new_driven_motions
  implicit none
  private

  public :: solve_area

  character(len=*), parameter :: no_memory = &
    'not enough memory for the matrix of the contact area: use method "fft"'

contains

  !> Find tractions and motions with g = 0 on the contact, ds = 0 in stick, t.ds + D tau = 0 in slip; gap and slip under them.
  !>
  !> The unknowns are p on the contact, q_x and q_y in stick, tau in slip, in this order, and the changes
  !> of the rigid motions whose loads are prescribed. Unknown k acts with `traction(:, k)`, and its row
  !> adds up the displacements by `weight(:, k)`: they differ by the mu e in q = mu p e + tau t. Kept factors serve where they are
  !> of use, those of the whole matrix else.
  subroutine solve_area(it, error)
    !> Iterate
    type(direct_iterate_t), intent(inout), target :: it
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    type(area_t) :: area
    logical :: solved
    integer :: i, k

    allocate (area%contact, source=pack([(i, i=1, size(it%p))], it%contact))
    area%stuck = pack(area%contact, it%zone(area%contact) == stick)
    area%sliding = pack(area%contact, it%zone(area%contact) == slip .and. it%compliance(area%contact) < infinite)
    associate (problem => it%problem)
      solved = size(area%contact) > problem%options%direct%most_explicit .and. .not. problem%normal_law%is_compliant() &
               .and. .not. problem%medium%spring_compliance() > 0.0_wp
    end associate
    if (solved) call factorize_area(it, area, solved, error)
    if (allocated(error)) return
    call set_unknowns(it, area, error)
    if (allocated(error)) return
    call set_sides(it, area)
    if (solved) then
      area%unknown(:, 0) = [it%p(area%contact), it%q(area%stuck, 1), it%q(area%stuck, 2), &
                            spread(0.0_wp, 1, size(area%sliding))]
      call solve_with_factors(it, area, solved, error)
      if (allocated(error)) return
    end if
    if (solved) then
      call move_motions(area, area%change, it)
    else
      call solve_whole_area(it, area, error)
      if (allocated(error)) return
      call satisfy_loads(area, it, error)
      if (allocated(error)) return
    end if
    it%p = 0.0_wp
    it%q = area%fixed
    it%p(area%contact) = area%unknown(:size(area%contact), 0)
    do k = 1, size(area%node)
      it%q(area%node(k), :) = it%q(area%node(k), :) + area%unknown(k, 0)*area%traction(along_x:, k)
    end do
    it%solves = it%solves + 1
    call it%evaluate(error)
  end subroutine solve_area

  !> Set the unknowns of an area: their nodes, the displacements that their rows add up, their tractions and springs.
  subroutine set_unknowns(it, area, error)
    !> Iterate
    type(direct_iterate_t), intent(in) :: it
    !> Area, whose nodes are known
    type(area_t), intent(inout) :: area
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    real(wp), dimension(size(it%p)) :: slope, bound, ahead, aside
    integer :: i, k, n, n_p, n_stuck, n_free, stat

    n_p = size(area%contact)
    n_stuck = size(area%stuck)
    area%node = [area%contact, area%stuck, area%stuck, area%sliding]
    n = size(area%node)
    allocate (area%place(size(it%p)), source=0)
    area%place(area%contact) = [(i, i=1, n_p)]
    area%place = area%place(area%node)
    call new_driven_motions(area%driven, it%problem, it%target, reshape(it%contact, it%problem%lattice%extent))
    n_free = size(area%driven%motion) + merge(1, 0, it%target%control(normal) == force_control)
    allocate (area%rhs(n, 0:n_free), area%unknown(n, 0:n_free), area%weight(3, n), area%resultant(n, n_free), stat=stat)
    if (stat /= 0) then
      call raise(error, status%resources, no_memory)
      return
    end if
    area%weight = 0.0_wp
    area%weight(normal, :n_p) = 1.0_wp
    area%weight(along_x, n_p + 1:n_p + n_stuck) = 1.0_wp
    area%weight(along_y, n_p + n_stuck + 1:n_p + 2*n_stuck) = 1.0_wp
    do k = n_p + 2*n_stuck + 1, n
      area%weight(along_x:, k) = normal_to(it%direction(:, area%node(k)))
    end do
    area%traction = area%weight
    allocate (area%fixed(size(it%p), 2), source=0.0_wp)
    call it%problem%friction%find_slopes(1, it%p, slope)
    call it%problem%friction%find_bounds(1, it%p, bound)
    call it%problem%friction%find_boundary(it%direction, ahead, aside)
    do k = 1, n_p
      if (it%zone(area%node(k)) == stick .or. .not. it%problem%friction%is_bounded()) cycle
      associate (i => area%node(k), e => it%direction(:, area%node(k)))
        area%traction(along_x:, k) = slope(i)*(ahead(i)*e + aside(i)*normal_to(e))
        ! the part of a bound that is not proportional to the pressure
        if (it%p(i) > 0.0_wp) area%fixed(i, :) = (bound(i) - slope(i)*it%p(i))*(ahead(i)*e + aside(i)*normal_to(e))
      end associate
    end do
    allocate (area%spring(n), source=0.0_wp)
    area%spring(:n_p) = it%spring(area%contact)/it%problem%normal_compliance
    area%spring(n_p + 2*n_stuck + 1:) = it%compliance(area%sliding)/it%problem%normal_compliance
  end subroutine set_unknowns

  !> Set the right-hand sides of an area, at the present motions and of unit motions, and the loads of unit unknowns.
  subroutine set_sides(it, area)
    !> Iterate
    type(direct_iterate_t), intent(in) :: it
    !> Area, whose unknowns are set
    type(area_t), intent(inout) :: area
    real(wp), allocatable :: direction(:, :), moved(:, :)
    real(wp) :: rigid(size(it%p), 3)
    integer :: i, k, n_free

    call displace_fixed(it, area, moved)
    rigid = it%unloaded()
    associate (node => area%node, weight => area%weight, rhs => area%rhs, problem => it%problem)
      do k = 1, size(node)
        rhs(k, 0) = -dot_product(weight(:, k), rigid(node(k), :))/problem%normal_compliance
        if (k <= size(area%contact)) rhs(k, 0) = rhs(k, 0) - it%offset(node(k))/problem%normal_compliance
        if (allocated(moved)) rhs(k, 0) = rhs(k, 0) - dot_product(weight(:, k), moved(:, area%place(k)))
      end do
      n_free = size(area%resultant, 2)
      allocate (area%load(n_free))
      if (n_free > size(area%driven%motion)) then
        area%load(1) = it%target%value(normal)/problem%lattice%cell_area()
        rhs(:, 1) = weight(normal, :)
        area%resultant(:, 1) = area%traction(normal, :)
      end if
      do i = 1, size(area%driven%motion)
        k = n_free - size(area%driven%motion) + i
        direction = reshape(area%driven%direction(i, problem), [size(it%p), 2])
        rhs(:, k) = sum(weight(along_x:, :)*transpose(direction(node, :)), dim=1)
        area%resultant(:, k) = sum(area%traction(along_x:, :)*transpose(direction(node, :)), dim=1)
        area%load(k) = area%driven%load(i, problem, it%target) - sum(area%fixed*direction)
      end do
    end associate
  end subroutine set_sides

  !> Factorize the area as it stands.
  subroutine factorize_area(it, area, done, error)
    !> Iterate, whose factors are those of the last area, of this one on return
    type(direct_iterate_t), intent(inout) :: it
    !> Area, whose nodes are known
    type(area_t), intent(in) :: area
    !> False: not positive definite in single precision
    logical, intent(out) :: done
    !> Allocated if there is not enough memory
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: side(2, size(area%sliding))
    logical :: sticks(size(it%p)), edge(size(it%p))
    integer :: i

    sticks = .false.
    sticks(area%stuck) = .true.
    do i = 1, size(area%sliding)
      side(:, i) = normal_to(it%direction(:, area%sliding(i)))
    end do
    associate (problem => it%problem, unit => it%problem%normal_compliance)
      ! those next to a node that does not stick may be the next to slip or to leave
      edge = reshape(problem%lattice%dilated(reshape(.not. sticks, problem%lattice%extent)), [size(it%p)])
      call it%factors%factorize(it%flexibility, unit, problem%medium%shear_ratio(), problem%options%direct, &
                                factored_area_t(area%contact, area%stuck, .not. edge(area%stuck), area%sliding, side, &
                                                it%compliance(area%sliding)/unit), done, error)
    end associate
  end subroutine factorize_area

  !> Solve (F7) with the factors of the whole matrix, for the present motions and for unit motions.
  subroutine solve_whole_area(it, area, error)
    !> Iterate
    type(direct_iterate_t), intent(in) :: it
    !> Area; its unknowns are found
    type(area_t), intent(inout) :: area
    !> Allocated on failure: not enough memory, a singular matrix
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: matrix(:, :)
    real(real32), allocatable :: first(:, :)
    logical :: solved
    integer :: i, n, n_p, stat

    n = size(area%node)
    n_p = size(area%contact)
    call require_memory(8*int(n, int64)**2 + 4*int(n_p, int64)**2 + 4*int(n - n_p, int64)**2, error)
    if (allocated(error)) return
    allocate (matrix(n, n), first(n_p, n_p), stat=stat)
    if (stat /= 0) then
      call raise(error, status%resources, no_memory)
      return
    end if
    call assemble(it, area, matrix)
    do i = 1, n
      matrix(i, i) = matrix(i, i) + area%spring(i)
    end do
    do i = 1, n_p
      first(:, i) = real(it%flexibility%normal_influence(area%contact, area%contact(i))/it%problem%normal_compliance, real32)
      first(i, i) = first(i, i) + real(area%spring(i), real32)
    end do
    call solve_blocks(n, n_p, first, matrix, area%rhs, area%unknown, solved, it%problem%options%direct)
    if (.not. solved) call solve_whole(matrix, area%rhs, area%unknown, error)
  end subroutine solve_whole_area

  !> Compute the displacements by tractions that do not change with the unknowns, over the self-compliance of a node; not allocated
  !> if there are none.
  subroutine displace_fixed(it, area, moved)
    !> Iterate
    type(direct_iterate_t), intent(in) :: it
    !> Area with these tractions
    type(area_t), intent(in) :: area
    !> w, u_x, u_y of the nodes in contact (3, size(contact)) [Pa]
    real(wp), allocatable, intent(out) :: moved(:, :)
    real(wp) :: u(3, size(area%contact))
    integer :: k

    associate (contact => area%contact, fixed => area%fixed)
      if (.not. any(abs(fixed) > 0.0_wp)) return
      allocate (moved(3, size(contact)), source=0.0_wp)
      do k = 1, size(contact)
        if (.not. any(abs(fixed(contact(k), :)) > 0.0_wp)) cycle
        call it%flexibility%response(contact, contact(k), [0.0_wp, fixed(contact(k), :)]/it%problem%normal_compliance, u)
        moved = moved + u
      end do
    end associate
    if (it%problem%goodman) moved(normal, :) = 0.0_wp
  end subroutine displace_fixed

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
  !> Motions that the loads do not determine, as without a node in stick, do not change.
  subroutine satisfy_loads(area, it, error)
    !> Area, with unknowns at the present motions and of unit motions; on return the first are at the new motions
    type(area_t), intent(inout) :: area
    !> Iterate
    type(direct_iterate_t), intent(inout) :: it
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error

    real(wp) :: stiffness(n_motion, n_motion), change(n_motion, 1), singular(n_motion), work(64)
    integer :: n, rank, info

    n = size(area%load)
    if (n == 0) return
    associate (unknown => area%unknown)
      stiffness(:n, :n) = matmul(transpose(area%resultant), unknown(:, 1:))
      change(:n, 1) = area%load - matmul(unknown(:, 0), area%resultant)
      call dgelss(n, n, 1, stiffness, n_motion, change, n_motion, singular, it%problem%options%direct%undetermined_motion, &
                  rank, work, size(work), info)
      if (info /= 0) then
        call raise(error, status%no_convergence, 'the rigid motions of the contact cannot be found')
        return
      end if
      unknown(:, 0) = unknown(:, 0) + matmul(unknown(:, 1:), change(:n, 1))
    end associate
    call move_motions(area, change(:n, 1), it)
  end subroutine satisfy_loads

  !> Add changes of the motions that loads drive, and find whether the unknowns carry the loads, but for rounding errors.
  subroutine move_motions(area, change, it)
    !> Area with its unknowns
    type(area_t), intent(in) :: area
    !> Changes of the approach, if it is driven, and of the tangential motions, over the self-compliance of a node
    real(wp), intent(in) :: change(:)
    !> Iterate
    type(direct_iterate_t), intent(inout) :: it
    integer :: n, m

    n = size(change)
    m = size(area%driven%motion)
    associate (problem => it%problem, driven => area%driven)
      if (n > m) it%motion(normal) = it%motion(normal) + change(1)*problem%normal_compliance
      call driven%set_motions(driven%multipliers(it%motion) + change(n - m + 1:n)*problem%normal_compliance, it%motion)
      it%carried = maxval(abs(area%load - matmul(area%unknown(:, 0), area%resultant))) <= &
                   problem%options%direct%load_rounding*sum(abs(area%unknown(:, 0)))
    end associate
  end subroutine move_motions

  !> Compute the matrix of the nodes' mutual influence: weight.K.traction, divided by the self-compliance.
  subroutine assemble(it, area, matrix)
    !> Iterate
    type(direct_iterate_t), intent(in) :: it
    !> Area, whose unknowns are set
    type(area_t), intent(in) :: area
    !> Matrix
    real(wp), intent(out) :: matrix(:, :)
    real(wp) :: u(3, size(area%contact)), by_pressure(3, size(area%contact)), pressure(3)
    integer :: column, k

    !$omp parallel do private(u, by_pressure, pressure, k) if (size(area%place) > 500)
    do column = 1, size(area%place)
      call it%flexibility%response(area%contact, area%contact(area%place(column)), &
                                   area%traction(:, column)/it%problem%normal_compliance, u)
      if (it%problem%goodman) then
        ! the gap does not feel shear tractions
        pressure = [area%traction(normal, column)/it%problem%normal_compliance, 0.0_wp, 0.0_wp]
        call it%flexibility%response(area%contact, area%contact(area%place(column)), pressure, by_pressure)
        u(normal, :) = by_pressure(normal, :)
      end if
      do k = 1, size(area%place)
        matrix(k, column) = dot_product(area%weight(:, k), u(:, area%place(k)))
      end do
    end do
    !$omp end parallel do
  end subroutine assemble

end module hc_direct_system
