!> Conjugate gradients and GMRES with constraints, on dense systems of five unknowns.
module test_linear_solvers
  use hc_precision, only: wp, sp, lk
  use hc_error, only: error_t
  use hc_field_space, only: field_space_t
  use hc_projected_cg, only: freeing_cg => projected_cg, conjugate_gradient_t
  use hc_projected_gmres, only: freeing_gmres => projected_gmres
  use hc_step_equation, only: solve_step_equation
  use hc_active_set, only: active_set_t, new_active_set
  use hc_linear_system, only: linear_system_t, constraints_t, iteration_t, &
    precondition_packed_constraints => precondition_constraints, step_ahead, solution_accurate, iterations_used_up, &
    solution_broke_off
  use testing, only: test_t, new_test, check, check_true
  implicit none
  private

  public :: collect_linear_solvers

  !> A small dense system, to test the iteration alone.
  type, extends(linear_system_t) :: dense_system_t
    real(wp) :: matrix(5, 5)
    !> Precision of the preconditioner
    integer :: kind = wp
  contains
    procedure :: product => dense_product
    procedure :: precondition_packed => dense_precondition
  end type dense_system_t

contains

  subroutine collect_linear_solvers(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('recurrence', test_recurrence), &
      new_test('projected_cg', test_projected_cg), &
      new_test('three_constraints', test_three_constraints), &
      new_test('constraints_in_parts', test_constraints_in_parts), &
      new_test('step_ahead', test_step_ahead), &
      new_test('outcomes', test_outcomes), &
      new_test('norm_of_gmres', test_norm_of_gmres), &
      new_test('step_equation', test_step_equation), &
      new_test('products_that_are_carried', test_products_that_are_carried), &
      new_test('restarts_of_gmres', test_restarts_of_gmres), &
      new_test('rows_of_some', test_rows_of_some), &
      new_test('ends_of_gmres', test_ends_of_gmres) &
    ]
  end subroutine collect_linear_solvers

  !> Shares and steps of the recurrence; it begins again after a restart, and where r^T z was not positive.
  subroutine test_recurrence(error)
    type(error_t), allocatable, intent(out) :: error
    type(conjugate_gradient_t) :: recurrence
    real(wp) :: share

    call recurrence%last_share(4.0_wp, share)
    call check(error, share, 0.0_wp, 0.0_wp, 'nothing of a direction that there is not')
    if (allocated(error)) return
    call check(error, recurrence%step_length(8.0_wp), 0.5_wp, 0.0_wp, 'length of the step')
    if (allocated(error)) return
    call check(error, recurrence%step_length(0.0_wp), 0.0_wp, 0.0_wp, 'no step without curvature')
    if (allocated(error)) return
    call recurrence%last_share(1.0_wp, share)
    call check(error, share, 0.25_wp, 0.0_wp, 'share of the last direction')
    if (allocated(error)) return
    call recurrence%last_share(-1.0_wp, share)
    call check(error, recurrence%step_length(8.0_wp), 0.0_wp, 0.0_wp, 'no step uphill')
    if (allocated(error)) return
    call recurrence%last_share(1.0_wp, share)
    call check(error, share, 0.0_wp, 0.0_wp, 'a direction uphill is discarded')
    if (allocated(error)) return
    call recurrence%restart()
    call recurrence%last_share(1.0_wp, share)
    call check(error, share, 0.0_wp, 0.0_wp, 'begun again')
  end subroutine test_recurrence

  !> Conjugate gradients that free copies of what is given.
  subroutine projected_cg(system, active, constraint, mb, rhs, x, ax, tolerance, max_iterations, multiplier, residual, &
                          iterations, outcome, error, drift)
    type(dense_system_t), intent(inout) :: system
    logical(lk), intent(in) :: active(:)
    real(wp), intent(in) :: constraint(:, :), mb(:, :), rhs(:), tolerance
    real(wp), intent(inout), contiguous :: x(:), ax(:)
    integer, intent(in) :: max_iterations
    real(wp), intent(out) :: multiplier(:), residual
    integer, intent(out) :: iterations, outcome
    type(error_t), allocatable, intent(out) :: error
    real(wp), intent(out), optional :: drift
    real(wp), allocatable :: right(:), unknown(:)
    type(constraints_t) :: constraints
    type(iteration_t) :: iteration
    type(active_set_t) :: nodes

    call new_active_set(nodes, active, system%space)
    call pack_columns(nodes, constraint, constraints%columns)
    call pack_single(nodes, mb, constraints%mb)
    allocate (right(nodes%n_active), unknown(nodes%n_active))
    call nodes%pack(rhs, right)
    call nodes%pack(x, unknown)
    iteration = iteration_t(tolerance=tolerance, most=max_iterations)
    call freeing_cg(system, nodes, constraints, right, unknown, ax, iteration, error)
    call nodes%unpack(unknown, x)
    multiplier = constraints%multiplier
    residual = iteration%residual
    iterations = iteration%made
    outcome = iteration%outcome
    if (present(drift)) drift = iteration%drift
  end subroutine projected_cg

  !> M B over all nodes, zero off the active ones.
  subroutine precondition_constraints(system, active, constraint, mb)
    type(dense_system_t), intent(inout) :: system
    logical(lk), intent(in) :: active(:)
    real(wp), intent(in) :: constraint(:, :)
    real(wp), allocatable, intent(out) :: mb(:, :)
    real(wp), allocatable :: b(:, :)
    real(sp), allocatable :: m_b(:, :)
    type(active_set_t) :: nodes
    integer :: k

    call new_active_set(nodes, active, system%space)
    call pack_columns(nodes, constraint, b)
    call precondition_packed_constraints(system, nodes, size(active), b, m_b)
    allocate (mb(size(constraint, 1), size(constraint, 2)), source=0.0_wp)
    do k = 1, size(mb, 2)
      call nodes%unpack(real(m_b(:, k), wp), mb(:, k))
    end do
  end subroutine precondition_constraints

  !> Gather the active nodes of several vectors.
  subroutine pack_columns(nodes, columns, packed)
    type(active_set_t), intent(in) :: nodes
    !> Vectors over all nodes (n, number of vectors)
    real(wp), intent(in) :: columns(:, :)
    !> Vectors on the active nodes (n_active, number of vectors)
    real(wp), allocatable, intent(out) :: packed(:, :)
    integer :: m

    allocate (packed(nodes%n_active, size(columns, 2)))
    do m = 1, size(columns, 2)
      call nodes%pack(columns(:, m), packed(:, m))
    end do
  end subroutine pack_columns

  !> Gather the active nodes of several vectors in single precision.
  subroutine pack_single(nodes, columns, packed)
    type(active_set_t), intent(in) :: nodes
    !> Vectors over all nodes (n, number of vectors)
    real(wp), intent(in) :: columns(:, :)
    !> Vectors on the active nodes (n_active, number of vectors)
    real(sp), allocatable, intent(out) :: packed(:, :)
    real(wp), allocatable :: values(:, :)

    call pack_columns(nodes, columns, values)
    packed = real(values, sp)
  end subroutine pack_single

  !> GMRES with constraints over all nodes, which frees a copy of the right-hand side.
  subroutine projected_gmres(system, active, columns, mb, rows, weight, rhs, x, ax, tolerance, max_iterations, multiplier, &
                             independent, residual, iterations, outcome, error, drift, max_directions)
    type(dense_system_t), intent(inout) :: system
    logical(lk), intent(in) :: active(:)
    real(wp), intent(in) :: columns(:, :), mb(:, :), rows(:, :), weight(:), rhs(:), tolerance
    real(wp), intent(inout), contiguous :: x(:), ax(:)
    integer, intent(in) :: max_iterations
    real(wp), intent(inout) :: multiplier(:)
    logical, intent(out) :: independent
    real(wp), intent(out) :: residual
    integer, intent(out) :: iterations, outcome
    type(error_t), allocatable, intent(out) :: error
    real(wp), intent(out), optional :: drift
    !> Directions that are stored; absent: all of them
    integer, intent(in), optional :: max_directions
    type(constraints_t) :: constraints
    type(iteration_t) :: iteration
    type(active_set_t) :: nodes

    call new_active_set(nodes, active, system%space)
    call pack_columns(nodes, columns, constraints%columns)
    call pack_single(nodes, mb, constraints%mb)
    call pack_columns(nodes, rows, constraints%rows)
    constraints%multiplier = multiplier
    iteration = iteration_t(tolerance=tolerance, most=max_iterations, most_directions=max_iterations)
    if (present(max_directions)) iteration%most_directions = max_directions
    iteration%weight = weight
    call gmres_over_all(system, nodes, constraints, rhs, x, ax, iteration, error)
    multiplier = constraints%multiplier
    independent = iteration%independent
    residual = iteration%residual
    iterations = iteration%made
    outcome = iteration%outcome
    if (present(drift)) drift = iteration%drift
  end subroutine projected_gmres

  !> GMRES on vectors over all nodes.
  subroutine gmres_over_all(system, nodes, constraints, rhs, x, ax, iteration, error)
    type(dense_system_t), intent(inout) :: system
    type(active_set_t), intent(in) :: nodes
    type(constraints_t), intent(inout) :: constraints
    real(wp), intent(in) :: rhs(:)
    real(wp), intent(inout), contiguous :: x(:), ax(:)
    type(iteration_t), intent(inout) :: iteration
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: right(:), unknown(:)

    allocate (right(nodes%n_active), unknown(nodes%n_active))
    call nodes%pack(rhs, right)
    call nodes%pack(x, unknown)
    call freeing_gmres(system, nodes, constraints, right, unknown, ax, iteration, error)
    call nodes%unpack(unknown, x)
  end subroutine gmres_over_all

  !> Minimum of x.Ax/2 - b.x under x_1 + x_2 + x_4 = 6, x_3 and x_5 fixed at zero, against Gauss elimination by hand.
  subroutine test_projected_cg(error)
    type(error_t), allocatable, intent(out) :: error
    type(dense_system_t) :: system
    real(wp) :: x(5), ax(5), multiplier(1), residual, constraint(5, 1)
    real(wp), allocatable :: mb(:, :)
    integer :: iterations, outcome, i

    system%matrix = 1.0_wp
    do i = 1, 5
      system%matrix(i, i) = 1.0_wp + i
    end do
    x = [6.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
    ax = matmul(system%matrix, x)
    constraint(:, 1) = [1.0_wp, 1.0_wp, 0.0_wp, 1.0_wp, 0.0_wp]
    call precondition_constraints(system, logical(constraint(:, 1) > 0.0_wp, lk), constraint, mb)
    call projected_cg(system, logical(constraint(:, 1) > 0.0_wp, lk), constraint, mb, &
                      [1.0_wp, 2.0_wp, 9.0_wp, 3.0_wp, 9.0_wp], x, ax, 1.0e-12_wp, 20, multiplier, &
                      residual, iterations, outcome, error)
    if (allocated(error)) return
    ! i x_i + 6 = b_i + m on the active nodes and sum x = 6: m (1 + 1/2 + 1/4) = 6 + sum (6 - b_i)/i
    call check(error, multiplier(1), (6.0_wp + 5.0_wp + 2.0_wp + 0.75_wp)/1.75_wp, 1.0e-11_wp, 'multiplier')
    if (allocated(error)) return
    call check(error, x(2), (2.0_wp + multiplier(1) - 6.0_wp)/2.0_wp, 1.0e-11_wp, 'second unknown')
    if (allocated(error)) return
    call check(error, [sum(x), x(3), x(5)], [6.0_wp, 0.0_wp, 0.0_wp], 1.0e-12_wp, 'constraint and fixed nodes')
    if (allocated(error)) return
    call check_true(error, iterations <= 2 .and. residual <= 1.0e-12_wp .and. outcome == solution_accurate, &
                    'three unknowns, one constraint')
  end subroutine test_projected_cg

  !> Conjugate gradients say why they stopped: solved, out of iterations, a matrix that is not positive definite.
  subroutine test_outcomes(error)
    type(error_t), allocatable, intent(out) :: error
    type(dense_system_t) :: system
    real(wp) :: x(5), ax(5), multiplier(0), residual, none(5, 0)
    logical(lk), parameter :: active(5) = .true.
    integer, parameter :: expected(3) = [solution_accurate, iterations_used_up, solution_broke_off], most(3) = [20, 2, 20]
    integer :: iterations, outcome, i, k

    do k = 1, 3
      system%matrix = 1.0_wp
      do i = 1, 5
        system%matrix(i, i) = 1.0_wp + i
      end do
      if (k == 3) system%matrix = -system%matrix
      x = 0.0_wp
      ax = 0.0_wp
      call projected_cg(system, active, none, none, [1.0_wp, 2.0_wp, 9.0_wp, 3.0_wp, -4.0_wp], x, ax, 1.0e-12_wp, most(k), &
                        multiplier, residual, iterations, outcome, error)
      if (allocated(error)) return
      call check(error, outcome, expected(k), 'outcome')
      if (allocated(error)) return
      call check_true(error, (residual <= 1.0e-12_wp) .eqv. outcome == solution_accurate, 'residual')
      if (allocated(error)) return
    end do
  end subroutine test_outcomes

  !> GMRES bounds the Euclidean norm of the weighted residuals, and returns it.
  subroutine test_norm_of_gmres(error)
    type(error_t), allocatable, intent(out) :: error
    type(dense_system_t) :: system
    real(wp) :: x(5), ax(5), multiplier(0), residual, none(5, 0), left, first
    real(wp), parameter :: rhs(5) = [1.0_wp, 2.0_wp, 9.0_wp, 3.0_wp, -4.0_wp], weight(5) = [1.0_wp, 2.0_wp, 1.0_wp, 0.5_wp, 1.0_wp]
    logical(lk), parameter :: active(5) = .true.
    logical :: independent
    integer :: iterations, outcome, i, most

    first = norm2(weight*rhs)
    system%matrix = 1.0_wp
    do i = 1, 5
      system%matrix(i, i) = 1.0_wp + i
    end do
    system%matrix(2, 1) = -3.0_wp
    do most = 1, 5
      x = 0.0_wp
      ax = 0.0_wp
      call projected_gmres(system, active, none, none, none, weight, rhs, x, ax, 1.0e-10_wp, most, multiplier, independent, &
                           residual, iterations, outcome, error)
      if (allocated(error)) return
      left = norm2(weight*(rhs - matmul(system%matrix, x)))
      call check(error, residual, left, 1.0e-12_wp*first, 'the norm that is left')
      if (allocated(error)) return
      call check(error, outcome, merge(solution_accurate, iterations_used_up, left <= 1.0e-10_wp), 'outcome')
      if (allocated(error)) return
    end do
    call check(error, outcome, solution_accurate, 'as many directions as unknowns are enough')
  end subroutine test_norm_of_gmres

  !> A matrix that is not symmetric is solved by GMRES, with a constraint; conjugate gradients would not solve it.
  subroutine test_step_equation(error)
    type(error_t), allocatable, intent(out) :: error
    type(dense_system_t) :: system
    type(active_set_t) :: nodes
    type(constraints_t) :: constraints
    type(iteration_t) :: iteration
    real(wp), allocatable :: rhs(:)
    real(wp) :: x(5), ax(5)
    real(wp), parameter :: right(5) = [1.0_wp, 2.0_wp, 9.0_wp, 3.0_wp, -4.0_wp]
    integer :: i

    system%matrix = 0.0_wp
    do i = 1, 5
      system%matrix(i, i) = 1.0_wp + i
    end do
    do i = 2, 5
      system%matrix(i, i - 1) = -4.0_wp
    end do
    call new_active_set(nodes, [(.true._lk, i=1, 5)], system%space)
    do i = 1, 2
      system%symmetric = i == 1
      x = 1.0_wp
      ax = matmul(system%matrix, x)
      rhs = right
      constraints%columns = reshape([1.0_wp, 1.0_wp, 1.0_wp, 1.0_wp, 1.0_wp], [5, 1])
      call precondition_packed_constraints(system, nodes, 5, constraints%columns, constraints%mb)
      iteration = iteration_t(tolerance=1.0e-12_wp, most=30)
      call solve_step_equation(system, nodes, constraints, rhs, x, ax, iteration, error)
      if (allocated(error)) return
      if (i == 1) call check_true(error, iteration%outcome /= solution_accurate, 'conjugate gradients fail')
      if (allocated(error)) return
    end do
    call check(error, iteration%outcome, solution_accurate, 'outcome')
    if (allocated(error)) return
    call check(error, matmul(system%matrix, x) - constraints%multiplier(1), right, 1.0e-11_wp, 'equation')
    if (allocated(error)) return
    call check(error, sum(x), 5.0_wp, 1.0e-13_wp, 'constraint')
  end subroutine test_step_equation

  !> The product that is carried along is that of the unknowns: with a preconditioner of single precision before a row
  !> that is a billion times larger, and the rounding errors of a start that is far off are told.
  subroutine test_products_that_are_carried(error)
    type(error_t), allocatable, intent(out) :: error
    type(dense_system_t) :: system
    real(wp) :: x(5), ax(5), multiplier(0), residual, none(5, 0), drift
    real(wp), parameter :: rhs(5) = [1.0_wp, 2.0_wp, 9.0_wp, 3.0_wp, -4.0_wp], weight(5) = 1.0_wp
    logical(lk), parameter :: active(5) = .true.
    logical :: independent
    integer :: iterations, outcome, i, k

    system%matrix = 1.0_wp
    do i = 1, 5
      system%matrix(i, i) = 1.0_wp + i
    end do
    system%matrix(3, 3) = 1.0e9_wp
    system%kind = sp
    do k = 1, 2
      x = merge(1.0e8_wp, 0.0_wp, k == 2)
      ax = matmul(system%matrix, x)
      call projected_gmres(system, active, none, none, none, weight, rhs, x, ax, 1.0e-10_wp, 5, multiplier, independent, &
                           residual, iterations, outcome, error, drift)
      if (allocated(error)) return
      if (k == 1) call check(error, ax, matmul(system%matrix, x), 1.0e-13_wp, 'product of GMRES')
      if (k == 2) call check_true(error, maxval(abs(ax - matmul(system%matrix, x))) < drift, 'drift of GMRES')
      if (allocated(error)) return
      x = merge(1.0e8_wp, 0.0_wp, k == 2)
      ax = matmul(system%matrix, x)
      call projected_cg(system, active, none, none, rhs, x, ax, 1.0e-10_wp, 9, multiplier, residual, iterations, outcome, &
                        error, drift)
      if (allocated(error)) return
      if (k == 1) call check(error, ax, matmul(system%matrix, x), 1.0e-13_wp, 'product of conjugate gradients')
      if (k == 2) call check_true(error, maxval(abs(ax - matmul(system%matrix, x))) < drift, 'drift of conjugate gradients')
      if (allocated(error)) return
      if (k == 1) call check_true(error, drift < 1.0e-13_wp, 'no drift')
      if (allocated(error)) return
    end do
  end subroutine test_products_that_are_carried

  !> A constraint whose rows differ from its columns at the first nodes holds, however often the iteration begins anew.
  subroutine test_rows_of_some(error)
    type(error_t), allocatable, intent(out) :: error
    type(dense_system_t) :: system
    type(active_set_t) :: nodes
    type(constraints_t) :: constraints
    type(iteration_t) :: iteration
    real(wp), allocatable :: rhs(:)
    real(wp) :: x(5), ax(5), left(5)
    integer :: i, most

    system%matrix = 1.0_wp
    do i = 1, 5
      system%matrix(i, i) = 1.0_wp + i
    end do
    system%matrix(2, 1) = -3.0_wp
    call new_active_set(nodes, [logical(lk) :: .true., .true., .false., .true., .true.], system%space)
    allocate (constraints%multiplier(1))
    do most = 2, 4
      x = [1.0_wp/3.0_wp, 2.0_wp, 0.0_wp, 3.0_wp, -1.0_wp/7.0_wp]
      ax = matmul(system%matrix, x)
      rhs = [1.0_wp, 2.0_wp, 9.0_wp, 3.0_wp, -4.0_wp]
      constraints%columns = spread([1.0_wp, 1.0_wp, 1.0_wp, 1.0_wp], 2, 1)
      constraints%mb = spread([1.0_sp, 0.9_sp, 0.7_sp, 0.3_sp], 2, 1)
      ! C differs from B at the first two nodes
      constraints%rows = spread([0.7_wp, 1.3_wp], 2, 1)
      constraints%multiplier(:) = 0.0_wp
      associate (c => [0.7_wp, 1.3_wp, 0.0_wp, 1.0_wp, 1.0_wp])
        left(1) = dot_product(c, x)
        iteration = iteration_t(tolerance=1.0e-5_wp, most=40, most_directions=most)
        iteration%weight = [1.0_wp]
        call gmres_over_all(system, nodes, constraints, rhs, x, ax, iteration, error)
        if (allocated(error)) return
        call check(error, dot_product(c, x), left(1), 1.0e-14_wp, 'constraint')
      end associate
      if (allocated(error)) return
      call check_true(error, maxval(abs(ax - matmul(system%matrix, x))) < iteration%drift + iteration%rounding, &
                      'product within the drift')
      if (allocated(error)) return
      left = [1.0_wp, 2.0_wp, 0.0_wp, 3.0_wp, -4.0_wp] - matmul(system%matrix, x) + constraints%multiplier(1)
      left(3) = 0.0_wp
      call check(error, norm2(left), 0.0_wp, 1.0e-5_wp, 'residual')
      if (allocated(error)) return
      call check(error, iteration%outcome, solution_accurate, 'outcome')
      if (allocated(error)) return
    end do
  end subroutine test_rows_of_some

  !> GMRES with two directions at a time comes to the solution under a constraint, too, by more iterations; its product and its
  !> residual are those of the unknowns wherever it stops.
  subroutine test_restarts_of_gmres(error)
    type(error_t), allocatable, intent(out) :: error
    type(dense_system_t) :: system
    real(wp) :: x(5), ax(5), solution(5), multiplier(1), residual, constraint(5, 1), left
    real(wp), parameter :: rhs(5) = [1.0_wp, 2.0_wp, 9.0_wp, 3.0_wp, -4.0_wp], weight(5) = [1.0_wp, 2.0_wp, 1.0_wp, 0.5_wp, 1.0_wp]
    logical(lk), parameter :: active(5) = .true.
    logical :: independent
    integer :: iterations, outcome, i, most, all_at_once

    system%matrix = 1.0_wp
    do i = 1, 5
      system%matrix(i, i) = 1.0_wp + i
    end do
    system%matrix(2, 1) = -3.0_wp
    constraint = 1.0_wp
    call solve(99, 99)
    if (allocated(error)) return
    solution = x
    all_at_once = iterations
    do most = 1, 7
      call solve(most, 2)
      if (allocated(error)) return
      left = norm2(weight*(rhs + multiplier(1) - matmul(system%matrix, x)))
      call check(error, residual, left, 1.0e-12_wp, 'the norm that is left')
      if (allocated(error)) return
      call check(error, ax, matmul(system%matrix, x), 1.0e-12_wp, 'the product')
      if (allocated(error)) return
      call check(error, [sum(x)], [6.0_wp], 1.0e-12_wp, 'the constraint')
      if (allocated(error)) return
      call check_true(error, iterations == most .and. outcome == iterations_used_up, 'stopped on the way')
      if (allocated(error)) return
    end do
    call solve(99, 2)
    if (allocated(error)) return
    call check(error, outcome, solution_accurate, 'outcome')
    if (allocated(error)) return
    call check(error, x, solution, 1.0e-9_wp, 'solution')
    if (allocated(error)) return
    call check_true(error, iterations > all_at_once, 'more iterations')

  contains

    subroutine solve(most_iterations, directions)
      integer, intent(in) :: most_iterations, directions

      x = [6.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
      ax = matmul(system%matrix, x)
      multiplier = 0.0_wp
      call projected_gmres(system, active, constraint, constraint, constraint, weight, rhs, x, ax, 1.0e-10_wp, most_iterations, &
                           multiplier, independent, residual, iterations, outcome, error, max_directions=directions)
    end subroutine solve

  end subroutine test_restarts_of_gmres

  !> Constraints of which each sees a part of the unknowns are those that have zeros elsewhere, and off the active nodes the
  !> product is right but for the error that is told.
  subroutine test_constraints_in_parts(error)
    type(error_t), allocatable, intent(out) :: error
    type(dense_system_t) :: system
    type(active_set_t) :: nodes
    type(constraints_t) :: whole, parts
    type(iteration_t) :: iteration
    real(wp), allocatable :: rhs(:)
    real(wp) :: x(5, 2), ax(5, 2)
    real(wp), parameter :: given(5) = [1.0_wp, 2.0_wp, 9.0_wp, 3.0_wp, -4.0_wp]
    integer :: i

    system%matrix = 1.0_wp/3.0_wp
    do i = 1, 5
      system%matrix(i, i) = 1.0_wp + i
    end do
    system%matrix(2, 1) = -3.0_wp
    call new_active_set(nodes, [logical(lk) :: .true., .true., .false., .true., .true.], system%space)
    whole%columns = reshape([0.0_wp, 0.0_wp, 1.0_wp, 0.5_wp, 1.0_wp, 1.0_wp, 0.0_wp, 0.0_wp], [4, 2])
    whole%mb = reshape([0.0_sp, 0.0_sp, 0.7_sp, 0.3_sp, 0.9_sp, 0.4_sp, 0.0_sp, 0.0_sp], [4, 2])
    whole%rows = reshape([0.2_wp, 0.1_wp, 1.0_wp, 1.0_wp], [2, 2])
    parts%n_before = 2
    parts%columns = reshape([1.0_wp, 0.5_wp], [2, 1])
    parts%mb = reshape([0.7_sp, 0.3_sp], [2, 1])
    parts%rows = reshape([0.2_wp, 0.1_wp], [2, 1])
    parts%of_sum = [0.9_sp, 0.4_sp]
    whole%multiplier = [0.1_wp, -0.2_wp]
    parts%multiplier = whole%multiplier
    do i = 1, 2
      x(:, i) = [1.0_wp/3.0_wp, 2.0_wp, 0.0_wp, 3.0_wp, -1.0_wp/7.0_wp]
      ax(:, i) = matmul(system%matrix, x(:, i))
      rhs = given
      iteration = iteration_t(tolerance=1.0e-12_wp, most=5, most_directions=5)
      iteration%weight = [1.0_wp]
      if (i == 1) call gmres_over_all(system, nodes, whole, rhs, x(:, i), ax(:, i), iteration, error)
      if (i == 2) call gmres_over_all(system, nodes, parts, rhs, x(:, i), ax(:, i), iteration, error)
      if (allocated(error)) return
    end do
    call check(error, whole%number() + parts%number(), 4, 'number of constraints')
    if (allocated(error)) return
    call check(error, x(:, 2), x(:, 1), 1.0e-12_wp, 'unknowns')
    if (allocated(error)) return
    call check(error, parts%multiplier, whole%multiplier, 1.0e-12_wp, 'multipliers')
    if (allocated(error)) return
    call check_true(error, abs(sum(x(:2, 2)) - 7.0_wp/3.0_wp) < 1.0e-13_wp, 'sum of the first unknowns')
    if (allocated(error)) return
    associate (off => abs(ax(3, 2) - dot_product(system%matrix(3, :), x(:, 2))))
      call check_true(error, off > 1.0e-12_wp .and. off <= iteration%rounding, 'error off the active nodes')
    end associate
    if (allocated(error)) return
    call check_true(error, iteration%rounding < 1.0e-6_wp, 'bound of this error')
  end subroutine test_constraints_in_parts

  !> GMRES leaves alone what has constraints that depend on each other, what is solved, and what no direction changes.
  subroutine test_ends_of_gmres(error)
    type(error_t), allocatable, intent(out) :: error
    type(dense_system_t) :: system
    real(wp) :: x(5), ax(5), multiplier(2), residual, constraint(5, 2)
    real(wp), parameter :: rhs(5) = [1.0_wp, 2.0_wp, 9.0_wp, 3.0_wp, -4.0_wp], weight(5) = 1.0_wp
    logical(lk), parameter :: active(5) = .true.
    logical :: independent
    integer :: iterations, outcome

    system%matrix = 1.0_wp
    multiplier = 0.0_wp
    constraint(:, 1) = rhs
    constraint(:, 2) = -2.0_wp*rhs
    x = 0.0_wp
    ax = 0.0_wp
    call projected_gmres(system, active, constraint, constraint, constraint, weight, rhs, x, ax, 1.0e-10_wp, 5, multiplier, &
                         independent, residual, iterations, outcome, error)
    if (allocated(error)) return
    call check_true(error, .not. independent .and. iterations == 0 .and. outcome == solution_broke_off, 'dependent constraints')
    if (allocated(error)) return
    call projected_gmres(system, active, constraint(:, :0), constraint(:, :0), constraint(:, :0), weight, 0.0_wp*rhs, x, ax, &
                         1.0e-10_wp, 5, multiplier(:0), independent, residual, iterations, outcome, error)
    if (allocated(error)) return
    call check_true(error, independent .and. iterations == 0 .and. outcome == solution_accurate, 'a start that solves it')
    if (allocated(error)) return
    call check(error, residual, 0.0_wp, 0.0_wp, 'its residual')
    if (allocated(error)) return
    ! differences have no image
    call projected_gmres(system, active, constraint(:, :0), constraint(:, :0), constraint(:, :0), weight, &
                         [1.0_wp, -1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], x, ax, 1.0e-10_wp, 5, multiplier(:0), independent, &
                         residual, iterations, outcome, error)
    if (allocated(error)) return
    call check_true(error, iterations == 0 .and. outcome == solution_broke_off, 'no direction')
    if (allocated(error)) return
    call check(error, [x, ax, multiplier], [(0.0_wp, iterations=1, 12)], 0.0_wp, 'what is left alone')
  end subroutine test_ends_of_gmres

  !> Three constraints on four unknowns: the solution fulfils its own equations; dependent ones are told.
  subroutine test_three_constraints(error)
    type(error_t), allocatable, intent(out) :: error
    type(dense_system_t) :: system
    type(constraints_t) :: constraints
    real(wp) :: x(5), ax(5), rhs(5), multiplier(3), residual, constraint(5, 3)
    real(wp), allocatable :: mb(:, :)
    real(wp), parameter :: wanted(3) = [6.0_wp, -1.0_wp, 2.0_wp]
    logical(lk), parameter :: active(5) = [.true., .true., .false., .true., .true.]
    logical :: independent
    integer :: iterations, outcome, i

    system%matrix = 1.0_wp
    do i = 1, 5
      system%matrix(i, i) = 1.0_wp + i
    end do
    rhs = [1.0_wp, 2.0_wp, 9.0_wp, 3.0_wp, -4.0_wp]
    constraint(:, 1) = [1.0_wp, 1.0_wp, 0.0_wp, 1.0_wp, 1.0_wp]
    constraint(:, 2) = [0.0_wp, 1.0_wp, 0.0_wp, -2.0_wp, 0.0_wp]
    constraint(:, 3) = [3.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, -1.0_wp]
    call precondition_constraints(system, active, constraint, mb)
    call check(error, mb(:, 3), [1.5_wp, 0.0_wp, 0.0_wp, 0.2_wp, -1.0_wp/6.0_wp], 1.0e-7_wp, 'M B')
    if (allocated(error)) return
    x = [0.0_wp, 0.0_wp, 7.0_wp, 0.0_wp, 0.0_wp]
    constraints%columns = constraint
    constraints%mb = real(mb, sp)
    call constraints%satisfy(field_space_t(), wanted, x, independent)
    call check_true(error, independent, 'independent constraints')
    if (allocated(error)) return
    call check(error, matmul(transpose(constraint), x), wanted, 1.0e-13_wp, 'constraints at the start')
    if (allocated(error)) return
    ax = matmul(system%matrix, x)
    call projected_cg(system, active, constraint, mb, rhs, x, ax, 1.0e-12_wp, 20, multiplier, residual, iterations, outcome, error)
    if (allocated(error)) return
    call check(error, matmul(transpose(constraint), x), wanted, 1.0e-12_wp, 'constraints')
    if (allocated(error)) return
    call check(error, x(3), 7.0_wp, 0.0_wp, 'an unknown that is fixed')
    if (allocated(error)) return
    call check(error, merge(matmul(system%matrix, x) - rhs - matmul(constraint, multiplier), 0.0_wp, active), &
               [(0.0_wp, i=1, 5)], 1.0e-11_wp, 'equations')
    if (allocated(error)) return

    constraint(:, 3) = 2.0_wp*constraint(:, 1)
    call precondition_constraints(system, active, constraint, mb)
    ax = x
    constraints%columns = constraint
    constraints%mb = real(mb, sp)
    call constraints%satisfy(field_space_t(), wanted, x, independent)
    call check_true(error, .not. independent, 'constraints that depend on each other')
    if (allocated(error)) return
    call check(error, x, ax, 0.0_wp, 'the unknowns are left alone')
  end subroutine test_three_constraints

  !> A step before the product is known: that of the unknowns before one of them was changed; rows differ from columns.
  subroutine test_step_ahead(error)
    type(error_t), allocatable, intent(out) :: error
    type(dense_system_t) :: system
    type(active_set_t) :: nodes
    real(wp) :: x(5), before(5), ax(5), r(5), z(5), columns(5, 1), rows(5, 1)
    real(wp), allocatable :: mb(:, :), right(:), unknown(:)
    type(constraints_t) :: constraints
    real(wp), parameter :: rhs(5) = [1.0_wp, 2.0_wp, 9.0_wp, 3.0_wp, -4.0_wp], length = 0.6_wp
    logical(lk), parameter :: active(5) = [.true., .true., .false., .true., .true.]
    integer :: i

    system%matrix = 1.0_wp
    do i = 1, 5
      system%matrix(i, i) = 1.0_wp + i
    end do
    columns(:, 1) = [1.0_wp, 1.0_wp, 0.0_wp, 1.0_wp, 1.0_wp]
    rows(:, 1) = [1.0_wp, 2.0_wp, 0.0_wp, 1.0_wp, -1.0_wp]
    allocate (constraints%multiplier(1), source=0.5_wp)
    call precondition_constraints(system, active, columns, mb)
    x = [1.0_wp, 0.0_wp, 2.0_wp, -1.0_wp, 3.0_wp]
    ax = matmul(system%matrix, x)
    x(3) = 2.1_wp
    before = x
    call new_active_set(nodes, active, system%space)
    call pack_columns(nodes, columns, constraints%columns)
    call pack_single(nodes, mb, constraints%mb)
    call pack_columns(nodes, rows, constraints%rows)
    right = pack(rhs, active)
    unknown = pack(x, active)
    call step_ahead(system, nodes, constraints, right, ax, length, unknown)
    call nodes%unpack(unknown, x)
    r = merge(rhs - ax + 0.5_wp*columns(:, 1), 0.0_wp, active)
    z = r/[(1.0_wp + i, i=1, 5)]
    z = z - mb(:, 1)*(dot_product(rows(:, 1), z)/dot_product(rows(:, 1), mb(:, 1)))
    call check(error, x, before + length*z, 1.0e-13_wp, 'unknowns')
    if (allocated(error)) return
    call check(error, dot_product(rows(:, 1), x), dot_product(rows(:, 1), before), 1.0e-13_wp, 'constraint')
    if (allocated(error)) return
    before = x
    constraints%rows = 0.0_wp*constraints%rows
    right = pack(rhs, active)
    call step_ahead(system, nodes, constraints, right, ax, length, unknown)
    call nodes%unpack(unknown, x)
    call check(error, x, before, 0.0_wp, 'no step where constraints depend on each other')
  end subroutine test_step_ahead

  subroutine dense_product(self, x, y, error)
    class(dense_system_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error
    y = matmul(self%matrix, x)
  end subroutine dense_product

  subroutine dense_precondition(self, nodes, n, r, z)
    class(dense_system_t), intent(inout) :: self
    type(active_set_t), intent(in) :: nodes
    integer, intent(in) :: n
    real(wp), intent(in), contiguous :: r(:)
    real(wp), intent(inout), contiguous :: z(:)
    integer :: i
    call nodes%pack([(self%matrix(i, i), i=1, n)], z)
    z = r/z
    if (self%kind == sp) z = real(z, sp)
  end subroutine dense_precondition

end module test_linear_solvers
