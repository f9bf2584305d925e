!> Tests of what several ranks do together.
module ranks_tests
  use, intrinsic :: iso_fortran_env, only: int32
  use hc_precision, only: wp, sp, pi, lk
  use hc_error, only: error_t, status, raise
  use hc_communicator, only: communicator_t
  use hc_lattice, only: lattice_t, new_lattice, equilateral_basis, oblique_basis
  use hc_field_space, only: field_space_t, space_over
  use hc_elastic_pair, only: elastic_pair_t, new_elastic_pair, material_t
  use hc_flexibility, only: normal, along_x, along_y
  use hc_flexibility_fft, only: fft_flexibility_t, new_fft_flexibility, of_pressure, of_all_tractions
  use hc_contact_state, only: contact_state_t, new_friction_state, load_target_t, load_step_t, force_control, &
    displacement_control
  use hc_power_interface, only: power_interface_t
  use hc_normal_law, only: normal_law_t, unilateral_t
  use hc_normal_problem, only: normal_problem_t, new_normal_problem
  use hc_normal_contact, only: normal_contact_t, new_normal_contact
  use hc_edges_by_rows, only: edges_by_rows_t
  use hc_state_measures, only: state_measures_t, measure_contact, rises_to_end
  use hc_window_growth, only: grown_window
  use hc_coulomb, only: coulomb_t
  use hc_orthotropic_coulomb, only: orthotropic_coulomb_t
  use hc_friction_law, only: friction_law_t
  use hc_rolling, only: rolling_t
  use hc_contact_problem, only: friction_problem_t, new_friction_problem
  use hc_contact_solver, only: friction_solver_t
  use hc_subwindow, only: solve_part
  use hc_active_set, only: active_set_t, new_active_set
  use hc_linear_system, only: linear_system_t, constraints_t, iteration_t
  use hc_step_equation, only: solve_step_equation
  use hc_subwindow_solver, only: windowed_friction_t, new_windowed_friction
  use hc_load_path, only: advance, step_settings_t
  use hc_wear_ahead, only: worn_cycle_t, energy_ahead
  use testing, only: test_t, new_test, check, check_true
  implicit none
  private

  public :: collect, ranks

  real(wp), parameter :: two_pi = 2.0_wp*pi

  !> All ranks, from windows of one node on
  type(communicator_t) :: ranks

  !> A diagonal matrix; the second rank has no memory for a product
  type, extends(linear_system_t) :: short_of_memory_t
  contains
    procedure :: product => diagonal_product
    procedure :: take_image => refuse_image
  end type short_of_memory_t

  !> A solver that fails on the second rank
  type, extends(friction_solver_t) :: failing_solver_t
  contains
    procedure :: solve_step => fail_on_one
    procedure :: displacements => sum_of_tractions
  end type failing_solver_t

contains

  subroutine collect(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('slabs', test_slabs), &
      new_test('reductions', test_reductions), &
      new_test('rows', test_rows), &
      new_test('words', test_words), &
      new_test('errors', test_errors), &
      new_test('one_without_memory', test_memory), &
      new_test('one_fails_on_a_part', test_failed_part), &
      new_test('products', test_products), &
      new_test('periodic_products', test_periodic_products), &
      new_test('contact', test_contact), &
      new_test('part_of_the_window', test_part), &
      new_test('compliant_layer', test_layer), &
      new_test('approach', test_approach), &
      new_test('rough', test_rough), &
      new_test('friction', test_friction), &
      new_test('varying_friction', test_varying_friction), &
      new_test('waves', test_waves), &
      new_test('complete_contact', test_complete), &
      new_test('mean_gap', test_mean_gap), &
      new_test('layer_between_waves', test_waves_on_layer), &
      new_test('across_the_end', test_across), &
      new_test('wear_ahead', test_wear_ahead) &
    ]
  end subroutine collect

  !> All rows belong to one rank each; slabs begin with odd rows.
  subroutine test_slabs(error)
    type(error_t), allocatable, intent(out) :: error
    type(communicator_t) :: some
    integer :: n, r, next

    do n = 2, 40
      do r = 1, n/2
        some%size = r
        next = 1
        do while (some%rank < some%size)
          call check_true(error, some%first_row(n) == next .and. modulo(next, 2) == 1 .and. some%last_row(n) > next - 1, 'slabs')
          if (allocated(error)) return
          next = some%last_row(n) + 1
          some%rank = some%rank + 1
        end do
        some%rank = 0
        call check_true(error, next == n + 1, 'all rows')
        if (allocated(error)) return
      end do
    end do
  end subroutine test_slabs

  !> Sums are those of one rank to the bit.
  subroutine test_reductions(error)
    type(error_t), allocatable, intent(out) :: error
    type(field_space_t) :: space
    real(wp) :: field(37, 41), largest(2)
    integer :: i, rows(2), counts(1)

    field = reshape([(exp(20.0_wp*sin(1.7_wp*i)), i=1, size(field))], shape(field))
    space%ranks = ranks
    rows = space%own_rows(size(field, 2))
    associate (own => field(:, rows(1):rows(2)))
      call check(error, space%sum(own), field_sum(field), 0.0_wp, 'sum')
      if (allocated(error)) return
      call check(error, space%max(own), maxval(field), 0.0_wp, 'max')
      if (allocated(error)) return
      call check(error, space%min(own, logical(own > 0.0_wp, lk)), minval(field), 0.0_wp, 'min')
      if (allocated(error)) return
      call check_true(error, space%count(logical(own > 1.0_wp, lk)) == count(field > 1.0_wp), 'count')
      if (allocated(error)) return
    end associate
    largest = [real(ranks%rank, wp), -real(ranks%rank, wp)]
    call space%most(largest)
    call check_true(error, nint(largest(1)) == ranks%size - 1 .and. nint(largest(2)) == 0, 'largest of several')
    if (allocated(error)) return
    counts = ranks%rank + 1
    call ranks%add_counts(counts)
    call check_true(error, counts(1) == ranks%size*(ranks%size + 1)/2, 'sum of counts')
  end subroutine test_reductions

  !> Sum a field as one rank does.
  real(wp) function field_sum(field)
    real(wp), intent(in), contiguous :: field(:, :)
    type(field_space_t) :: alone

    field_sum = alone%sum(field)
  end function field_sum

  !> Each rank takes other rows, of reals and of masks.
  subroutine test_rows(error)
    type(error_t), allocatable, intent(out) :: error
    type(field_space_t) :: space
    real(wp), target :: field(5, 23)
    real(wp), allocatable, target :: some(:, :)
    logical(lk), allocatable :: mask(:, :)
    integer :: i, rows(2), first, last

    field = reshape([(real(i, wp), i=1, size(field))], shape(field))
    space%ranks = ranks
    rows = space%own_rows(size(field, 2))
    first = 1 + 2*ranks%rank
    last = 23 - ranks%rank
    allocate (some(5, last - first + 1), mask(5, last - first + 1))
    call space%fetch(size(field, 2), field(:, rows(1):rows(2)), first, some)
    call check_true(error, all(abs(some - field(:, first:last)) <= 0.0_wp), 'rows')
    if (allocated(error)) return
    call space%fetch(size(field, 2), logical(field(:, rows(1):rows(2)) > 50.0_wp, lk), first, mask)
    call check_true(error, all(mask .eqv. field(:, first:last) > 50.0_wp), 'rows of a mask')
  end subroutine test_rows

  !> The first rank sends each other rank some words, which sends them back.
  subroutine test_words(error)
    type(error_t), allocatable, intent(out) :: error
    integer(int32) :: words(3)
    integer :: r, n

    do r = 1, ranks%size - 1
      if (ranks%rank == 0) then
        call ranks%send_words([1_int32, 2_int32, int(r, int32)], r)
        call ranks%receive_words(words, r)
        call check_true(error, all(words == [2, 4, 2*r]), 'words')
        if (allocated(error)) return
      else if (ranks%rank == r) then
        call ranks%wait_for_words(n)
        call check_true(error, n == 3, 'number of words')
        call ranks%receive_words(words, 0)
        call ranks%send_words(2*words, 0)
        if (allocated(error)) return
      end if
    end do
  end subroutine test_words

  !> An error of one rank is one of all, and names it.
  subroutine test_errors(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: found

    call ranks%agree(found)
    call check_true(error,.not. allocated(found), 'no error')
    if (allocated(error) .or. ranks%size == 1) return
    if (ranks%rank == 1) call raise(found, status%resources, 'not enough memory')
    call ranks%agree(found)
    call check_true(error, allocated(found), 'an error')
    if (allocated(error)) return
    call check_true(error, found%code == status%resources .and. found%message == 'rank 1: not enough memory', found%message)
    if (allocated(error)) return
    call ranks%agree(found)
    call check_true(error, found%message == 'rank 1: not enough memory', 'an error of all ranks has no name more')
  end subroutine test_errors

  !> Memory that one rank does not get in conjugate gradients or GMRES is an error of all, whether they share rows or transforms.
  subroutine test_memory(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n_col = 3
    type(short_of_memory_t) :: system
    type(active_set_t) :: nodes
    type(constraints_t) :: constraints
    type(iteration_t) :: iteration
    type(error_t), allocatable :: found
    real(wp), allocatable :: rhs(:), x(:), ax(:)
    integer :: extent(2), k, n

    if (ranks%size == 1) return
    do k = 0, 3
      system%symmetric = modulo(k, 2) == 0
      system%space = field_space_t()
      if (k < 2) system%space%ranks = ranks
      if (k > 1) system%space%helpers = ranks
      extent = system%space%own_extent([n_col, 2*ranks%size + 1])
      n = product(extent)
      call new_active_set(nodes, spread(.true._lk, 1, n), system%space, extent)
      constraints = constraints_t()
      allocate (constraints%columns(n, 1), source=1.0_wp)
      allocate (constraints%mb(n, 1), source=1.0_sp)
      rhs = spread(1.0_wp, 1, n)
      x = 0.0_wp*rhs
      ax = x
      iteration = iteration_t(most=5)
      call solve_step_equation(system, nodes, constraints, rhs, x, ax, iteration, found)
      call check_failure(found, error)
      if (allocated(error)) return
    end do
  end subroutine test_memory

  !> Expect the error of the second rank on all ranks.
  subroutine check_failure(found, error)
    type(error_t), allocatable, intent(in) :: found
    type(error_t), allocatable, intent(out) :: error

    call check_true(error, allocated(found), 'an error on all ranks')
    if (.not. allocated(error)) call check_true(error, found%code == status%resources .and. index(found%message, 'rank 1: ') == 1, &
                                                found%message)
  end subroutine check_failure

  subroutine diagonal_product(self, x, y, error)
    class(short_of_memory_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error
    integer :: i

    y = [(i*x(i), i=1, size(x))]
  end subroutine diagonal_product

  subroutine refuse_image(self, n, own, image, stat)
    class(short_of_memory_t), intent(in) :: self
    integer, intent(in) :: n
    real(wp), allocatable, target, intent(inout) :: own(:)
    real(wp), pointer, contiguous, intent(out) :: image(:)
    integer, intent(out) :: stat

    stat = merge(1, 0, ranks%rank == 1)
    if (.not. allocated(own)) allocate (own(n))
    image => own
  end subroutine refuse_image

  !> A part of the window that each rank solves alone, where one fails: an error of all, before they share the window again.
  subroutine test_failed_part(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 40
    type(elastic_pair_t) :: pair
    type(lattice_t) :: lattice
    type(field_space_t) :: space
    type(failing_solver_t) :: whole, part
    type(contact_state_t) :: start, found
    type(load_target_t) :: target
    type(error_t), allocatable :: failure
    real(wp) :: gap(n, n)
    real(wp), allocatable, target :: reference(:, :, :)
    logical :: solved
    integer :: rows(2)

    if (ranks%size == 1) return
    call new_elastic_pair(pair, material_t(210.0e9_wp, 0.3_wp), material_t(70.0e9_wp, 0.3_wp), error)
    if (.not. allocated(error)) call new_lattice(lattice, equilateral_basis(1.0e-5_wp), [-n/2, -n/2], [n, n], error)
    if (allocated(error)) return
    call sphere(lattice, gap)
    space%ranks = ranks
    space%ranks%least_nodes = n*n                                              ! parts are too small to be shared
    rows = space%own_rows(n)
    associate (own => gap(:, rows(1):rows(2)))
      call new_friction_problem(whole%problem, lattice, pair, own, own < huge(gap), coulomb_t(0.3_wp), .false., error, space=space)
    end associate
    if (allocated(error)) return
    call whole%problem%extract_part([11, 11], [30, 30], part%problem)
    call new_friction_state(start, lattice, space)
    allocate (reference, source=start%relative_displacement)
    target%value(1) = 30.0_wp
    call solve_part(whole, part, reshape([11, 11, 30, 30], [2, 2]), start, load_step_t(target, reference, 1.0e-8_wp, 10), &
                    found, solved, failure)
    call check_failure(failure, error)
  end subroutine test_failed_part

  subroutine fail_on_one(self, start, reference, target, tolerance, max_sweeps, state, error)
    class(failing_solver_t), intent(inout), target :: self
    type(contact_state_t), intent(in) :: start
    real(wp), intent(in), contiguous, target :: reference(:, :, :)
    type(load_target_t), intent(in) :: target
    real(wp), intent(in) :: tolerance
    integer, intent(in) :: max_sweeps
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error

    if (ranks%rank == 1) call raise(error, status%resources, 'not enough memory')
    state = start
    state%converged = .true.
  end subroutine fail_on_one

  !> Sum over all ranks.
  subroutine sum_of_tractions(self, pressure, traction, displacement, error)
    class(failing_solver_t), intent(inout) :: self
    real(wp), intent(in) :: pressure(:, :), traction(:, :, :)
    real(wp), intent(out), contiguous :: displacement(:, :, :)
    type(error_t), allocatable, intent(out) :: error

    displacement = self%problem%space%sum(pressure) + sum(traction)
  end subroutine sum_of_tractions

  !> A product is that of one rank to the bit: even and odd numbers of rows, like and unlike materials.
  subroutine test_products(error)
    type(error_t), allocatable, intent(out) :: error
    type(elastic_pair_t) :: pair
    type(lattice_t) :: lattice
    integer :: k

    do k = 0, 3
      call new_elastic_pair(pair, material_t(2.0_wp, 0.25_wp), material_t(5.0_wp, merge(0.1_wp, 0.25_wp, k > 1)), error)
      if (allocated(error)) return
      call new_lattice(lattice, merge(oblique_basis(0.5_wp, 0.9_wp, 1.1_wp), equilateral_basis(0.5_wp), k == 3), &
                       [-4, -3], [33 - k, 30 + k], error)
      if (allocated(error)) return
      call compare_products(lattice, pair, k > 0, error)
      if (allocated(error)) return
    end do
  end subroutine test_products

  !> The same on windows that repeat, without padding; some ranks have fewer columns than others.
  subroutine test_periodic_products(error)
    type(error_t), allocatable, intent(out) :: error
    type(elastic_pair_t) :: pair
    type(lattice_t) :: lattice
    integer :: k

    do k = 0, 3
      call new_elastic_pair(pair, material_t(2.0_wp, 0.25_wp), material_t(5.0_wp, merge(0.1_wp, 0.25_wp, k > 1)), error)
      if (allocated(error)) return
      call new_lattice(lattice, merge(oblique_basis(0.5_wp, 0.9_wp, 1.1_wp), equilateral_basis(0.5_wp), k == 3), &
                       [-4, -3], [20 + 4*k, 30 + k], error)
      if (allocated(error)) return
      lattice%periodic = .true.
      call compare_products(lattice, pair, k > 0, error)
      if (allocated(error)) return
    end do
  end subroutine test_periodic_products

  subroutine compare_products(lattice, pair, all_of_them, error)
    type(lattice_t), intent(in) :: lattice
    type(elastic_pair_t), intent(in) :: pair
    !> All components
    logical, intent(in) :: all_of_them
    type(error_t), allocatable, intent(out) :: error
    type(fft_flexibility_t) :: alone, shared
    type(field_space_t) :: space
    real(wp), allocatable :: traction(:, :, :), expected(:, :, :), answer(:, :, :)
    integer, parameter :: components(3) = [normal, along_x, along_y]
    integer :: i, rows(2), n

    n = merge(3, 1, all_of_them)
    allocate (traction(lattice%extent(1), lattice%extent(2), n), expected(lattice%extent(1), lattice%extent(2), n))
    traction = reshape([(sin(1.3_wp*i), i=1, size(traction))], shape(traction))
    space = space_over(lattice%extent, 1)
    call new_fft_flexibility(alone, lattice, pair, error, kind=merge(of_all_tractions, of_pressure, all_of_them), space=space)
    if (allocated(error)) return
    space%ranks = ranks
    rows = space%own_rows(lattice%extent(2))
    allocate (answer(lattice%extent(1), rows(2) - rows(1) + 1, n))
    call new_fft_flexibility(shared, lattice, pair, error, kind=merge(of_all_tractions, of_pressure, all_of_them), space=space)
    if (allocated(error)) return
    call alone%apply(components(:n), traction, components(:n), expected, error)
    if (allocated(error)) return
    call shared%apply(components(:n), traction(:, rows(1):rows(2), :), components(:n), answer, error)
    if (allocated(error)) return
    call check(error, maxval(abs(answer - expected(:, rows(1):rows(2), :))), 0.0_wp, 0.0_wp, 'product')
    call ranks%agree(error)
  end subroutine compare_products

  !> Compare pressure, gap, numbers and work with those of one rank, to the bit.
  subroutine compare_contacts(lattice, gap, candidate, law, control, value, tolerance, error)
    type(lattice_t), intent(in) :: lattice
    real(wp), intent(in) :: gap(:, :)
    logical, intent(in) :: candidate(:, :)
    class(normal_law_t), intent(in) :: law
    integer, intent(in) :: control
    real(wp), intent(in) :: value, tolerance
    type(error_t), allocatable, intent(out) :: error
    type(elastic_pair_t) :: pair
    type(normal_contact_t) :: alone, shared
    type(contact_state_t) :: expected, found
    integer :: rows(2)

    call new_elastic_pair(pair, material_t(210.0e9_wp, 0.3_wp), material_t(70.0e9_wp, 0.3_wp), error)
    if (allocated(error)) return
    rows = [ranks%first_row(lattice%extent(2)), ranks%last_row(lattice%extent(2))]
    call new_normal_contact(alone, lattice, pair, gap, candidate, error, 1, law=law)
    if (.not. allocated(error)) call alone%solve(control, value, tolerance, 200, expected, error)
    if (allocated(error)) return
    call new_normal_contact(shared, lattice, pair, gap(:, rows(1):rows(2)), candidate(:, rows(1):rows(2)), error, 1, law=law, &
                            ranks=ranks)
    if (.not. allocated(error)) call shared%solve(control, value, tolerance, 200, found, error)
    if (allocated(error)) return
    call compare_states(expected, found, rows, error)
    call ranks%agree(error)
    if (allocated(error)) return
    call compare_measures(lattice, gap, candidate, expected, found, rows, error)
    call ranks%agree(error)
  end subroutine compare_contacts

  !> Compare measures with those of one rank, to the bit, and larger windows.
  subroutine compare_measures(lattice, gap, candidate, expected, found, rows, error)
    type(lattice_t), intent(in) :: lattice
    real(wp), intent(in) :: gap(:, :)
    logical, intent(in) :: candidate(:, :)
    type(contact_state_t), intent(in) :: expected, found
    integer, intent(in) :: rows(2)
    type(error_t), allocatable, intent(out) :: error
    type(state_measures_t) :: of_all, of_parts
    type(edges_by_rows_t) :: edges
    type(field_space_t) :: space
    type(lattice_t) :: grown, grown_from_parts
    logical :: rises, rise_in_parts

    call measure_contact(lattice, gap, candidate, expected, space, of_all, edges)
    rises = rises_to_end(merge(1.0_wp, 0.0_wp, candidate), expected%pressure, space, lattice%extent(2))
    grown = grown_window(lattice, expected%zone > 0, space)
    space%ranks = ranks
    call measure_contact(lattice, gap(:, rows(1):rows(2)), candidate(:, rows(1):rows(2)), found, space, of_parts, edges)
    rise_in_parts = rises_to_end(merge(1.0_wp, 0.0_wp, candidate(:, rows(1):rows(2))), found%pressure, space, &
                                 lattice%extent(2))
    grown_from_parts = grown_window(lattice, found%zone > 0, space)
    call check(error, [of_parts%contact%area_error, of_parts%mean_gap, of_parts%elastic_energy], &
               [of_all%contact%area_error, of_all%mean_gap, of_all%elastic_energy], 0.0_wp, 'measures of windows that repeat')
    if (allocated(error) .or. lattice%is_periodic()) return
    associate (one => of_all%contact, all => of_parts%contact)
      call check(error, [all%area, all%radius, all%area_fit, all%radius_fit, all%semi_major, all%semi_minor, &
                         of_parts%pressure_center, of_parts%max_pressure, of_parts%elastic_energy], &
                 [one%area, one%radius, one%area_fit, one%radius_fit, one%semi_major, one%semi_minor, of_all%pressure_center, &
                  of_all%max_pressure, of_all%elastic_energy], 0.0_wp, 'measures')
    end associate
    if (allocated(error)) return
    call check_true(error, rises .eqv. rise_in_parts, 'rise to an end')
    if (allocated(error)) return
    call check_true(error, all(grown%first == grown_from_parts%first) .and. all(grown%extent == grown_from_parts%extent), 'grown')
  end subroutine compare_measures

  !> Compare own rows.
  subroutine compare_states(expected, found, rows, error)
    type(contact_state_t), intent(in) :: expected, found
    !> First and last row
    integer, intent(in) :: rows(2)
    type(error_t), allocatable, intent(out) :: error

    call check_true(error, expected%converged .and. found%converged, 'converged')
    if (allocated(error)) return
    call check_true(error, found%sweeps == expected%sweeps, 'iterations')
    if (allocated(error)) return
    call check(error, maxval(abs(found%pressure - expected%pressure(:, rows(1):rows(2)))), 0.0_wp, 0.0_wp, 'pressure')
    if (allocated(error)) return
    call check(error, maxval(abs(found%gap - expected%gap(:, rows(1):rows(2)))), 0.0_wp, 0.0_wp, 'gap')
    if (allocated(error)) return
    call check_true(error, all(found%zone == expected%zone(:, rows(1):rows(2))), 'zone')
    if (allocated(error)) return
    call check(error, [found%load(normal), found%motion(normal), found%residual_normal, found%operator_applications], &
               [expected%load(normal), expected%motion(normal), expected%residual_normal, expected%operator_applications], &
               0.0_wp, 'numbers')
    if (allocated(error)) return
    call check_true(error, found%clipped .eqv. expected%clipped, 'rim')
  end subroutine compare_states

  !> Compute the gap of a sphere of 10 mm on a plane.
  subroutine sphere(lattice, gap)
    type(lattice_t), intent(in) :: lattice
    real(wp), intent(out) :: gap(:, :)
    real(wp), allocatable :: x(:, :), y(:, :)

    allocate (x(lattice%extent(1), lattice%extent(2)), y(lattice%extent(1), lattice%extent(2)))
    call lattice%coordinates(x, y)
    gap = (x**2 + y**2)/0.02_wp
  end subroutine sphere

  !> A sphere whose contact fills the window, on even and odd numbers of rows.
  subroutine test_contact(error)
    type(error_t), allocatable, intent(out) :: error
    integer :: n

    do n = 64, 65
      call press_sphere(n, 1.0e-5_wp, unilateral_t(), force_control, 120.0_wp, error)
      if (allocated(error)) return
    end do
  end subroutine test_contact

  !> A small contact in a large window.
  subroutine test_part(error)
    type(error_t), allocatable, intent(out) :: error

    call press_sphere(121, 1.0e-5_wp, unilateral_t(), force_control, 20.0_wp, error)
  end subroutine test_part

  !> A compliant layer.
  subroutine test_layer(error)
    type(error_t), allocatable, intent(out) :: error

    call press_sphere(64, 1.0e-5_wp, power_interface_t(1.0e15_wp, 1.0_wp), force_control, 60.0_wp, error)
    if (allocated(error)) return
    call press_sphere(64, 1.0e-5_wp, power_interface_t(1.0e20_wp, 2.0_wp), force_control, 60.0_wp, error)
  end subroutine test_layer

  !> An approach in place of a load.
  subroutine test_approach(error)
    type(error_t), allocatable, intent(out) :: error

    call press_sphere(70, 1.0e-5_wp, unilateral_t(), displacement_control, 4.0e-6_wp, error)
  end subroutine test_approach

  subroutine press_sphere(n, spacing, law, control, value, error)
    integer, intent(in) :: n, control
    real(wp), intent(in) :: spacing, value
    class(normal_law_t), intent(in) :: law
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    real(wp) :: gap(n, n - 3)
    logical :: candidate(n, n - 3)

    call new_lattice(lattice, equilateral_basis(spacing), [-n/2, -n/2], [n, n - 3], error)
    if (allocated(error)) return
    call sphere(lattice, gap)
    candidate = .true.
    call compare_contacts(lattice, gap, candidate, law, control, value, 1.0e-12_wp, error)
  end subroutine press_sphere

  !> A wavy surface, with nodes that cannot touch: many small contacts.
  subroutine test_rough(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    real(wp), dimension(90, 87) :: gap, x, y
    logical :: candidate(90, 87)

    call new_lattice(lattice, oblique_basis(1.0e-5_wp, 1.0_wp, 1.5_wp), [0, 0], [90, 87], error)
    if (allocated(error)) return
    call lattice%coordinates(x, y)
    gap = 1.0e-7_wp*(2.0_wp + sin(7.0e4_wp*x) + cos(5.0e4_wp*y + 3.0e4_wp*x)) + ((x - 4.0e-4_wp)**2 + (y - 4.0e-4_wp)**2)/0.4_wp
    candidate = .not. (abs(x - 3.0e-4_wp) < 3.0e-5_wp)
    call compare_contacts(lattice, gap, candidate, unilateral_t(), force_control, 40.0_wp, 1.0e-9_wp, error)
  end subroutine test_rough

  !> A sphere that is pressed and sheared, of like and unlike materials, on the whole window and on a part of it.
  subroutine test_friction(error)
    type(error_t), allocatable, intent(out) :: error
    integer :: k

    if (ranks%size == 1) return
    do k = 0, 5
      call shear_sphere(merge(83, 40, k == 2 .or. k == 3), modulo(k, 2) == 1, k > 3, coulomb_t(0.3_wp), error)
      if (allocated(error)) return
    end do
  end subroutine test_friction

  !> Friction that differs from node to node, and with its direction.
  subroutine test_varying_friction(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 40
    type(orthotropic_coulomb_t) :: law
    integer :: i, k

    if (ranks%size == 1) return
    law%coefficient = [(0.3_wp + 0.1_wp*sin(0.01_wp*i), i=1, n*(n - 3))]
    do k = 0, 2
      if (k > 0) law%ratio = 1.3_wp
      law%angle = 0.4_wp
      call shear_sphere(n, k > 1, .false., law, error)
      if (allocated(error)) return
    end do
  end subroutine test_varying_friction

  !> Compare the ends of two load steps with those of one rank.
  subroutine shear_sphere(n, unlike, periodic, law, error)
    integer, intent(in) :: n
    logical, intent(in) :: unlike, periodic
    class(friction_law_t), intent(in) :: law
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(elastic_pair_t) :: pair
    type(friction_problem_t) :: problem, part
    type(windowed_friction_t) :: alone, shared
    type(contact_state_t) :: start, begun, expected, found
    type(load_target_t) :: target
    type(field_space_t) :: space
    class(friction_law_t), allocatable :: own_law
    real(wp), allocatable :: values(:)
    real(wp) :: gap(n, n - 3), p_max
    integer :: step, n_step, rows(2)

    call new_elastic_pair(pair, material_t(210.0e9_wp, 0.3_wp), material_t(merge(70.0e9_wp, 210.0e9_wp, unlike), 0.3_wp), error)
    if (.not. allocated(error)) call new_lattice(lattice, equilateral_basis(1.0e-5_wp), [-n/2, -n/2], [n, n - 3], error)
    if (allocated(error)) return
    lattice%periodic = periodic
    call sphere(lattice, gap)
    space%ranks = ranks
    rows = space%own_rows(n - 3)
    call new_friction_problem(problem, lattice, pair, gap, gap < huge(gap), law, .false., error)
    if (.not. allocated(error)) call new_windowed_friction(alone, problem, error, 1)
    allocate (own_law, source=law)
    call law%find_nodal_values(values)
    if (size(values) > 0) call own_law%set_nodal_values(values((rows(1) - 1)*n + 1:rows(2)*n), maxval(values))
    associate (own => gap(:, rows(1):rows(2)))
      if (.not. allocated(error)) call new_friction_problem(part, lattice, pair, own, own < huge(gap), own_law, .false., error, &
                                                            space=space)
    end associate
    if (.not. allocated(error)) call new_windowed_friction(shared, part, error, 1, ranks=ranks)
    if (allocated(error)) return
    call new_friction_state(start, lattice)
    call new_friction_state(begun, lattice, space)
    ! bodies of like materials also roll along rows, in the steady state and by a spacing, then across rows
    n_step = merge(5, 2, n == 40 .and. .not. (unlike .or. periodic))
    do step = 1, n_step
      target%value(:2) = [30.0_wp, merge(0.0_wp, 4.0_wp, step == 1)]
      if (step >= 3) target%rolling = rolling_t(merge([1, 0], [0, 1], step < 5), step == 3)
      call advance(alone, start, target, step_settings_t(1.0e-12_wp), expected, error)
      if (.not. allocated(error)) call advance(shared, begun, target, step_settings_t(1.0e-12_wp), found, error)
      if (allocated(error)) return
      call check_true(error, expected%converged .and. found%converged, 'converged')
      if (allocated(error)) return
      p_max = maxval(expected%pressure)
      call check(error, maxval(abs(found%pressure - expected%pressure(:, rows(1):rows(2))))/p_max, 0.0_wp, 1.0e-10_wp, 'pressure')
      if (allocated(error)) return
      call check(error, maxval(abs(found%traction - expected%traction(:, rows(1):rows(2), :)))/p_max, 0.0_wp, 1.0e-10_wp, &
                 'traction')
      if (allocated(error)) return
      call check_true(error, all(found%zone == expected%zone(:, rows(1):rows(2))), 'zones')
      if (allocated(error)) return
      call check(error, found%load(:3), expected%load(:3), 1.0e-9_wp, 'loads')
      if (allocated(error)) return
      call check(error, [found%dissipated_energy, found%path_error], [expected%dissipated_energy, expected%path_error], &
                 1.0e-8_wp, 'energies')
      if (allocated(error)) return
      call check(error, maxval(abs(found%accumulated_slip - expected%accumulated_slip(:, rows(1):rows(2)))), 0.0_wp, &
                 1.0e-8_wp*maxval(expected%accumulated_slip) + tiny(p_max), 'slip')
      if (allocated(error)) return
      call check_true(error, any(expected%zone == 1) .or. step == 1, 'stick')
      if (allocated(error)) return
      start = expected
      begun = found
    end do
  end subroutine shear_sphere

  !> Waves that repeat, on even and odd numbers of rows; even ones have a coarser lattice, too.
  subroutine test_waves(error)
    type(error_t), allocatable, intent(out) :: error
    integer :: k

    do k = 80, 83
      call press_waves([96, k], unilateral_t(), force_control, 0.05_wp, error)
      if (allocated(error)) return
    end do
  end subroutine test_waves

  !> Waves pressed flat.
  subroutine test_complete(error)
    type(error_t), allocatable, intent(out) :: error

    call press_waves([64, 64], unilateral_t(), force_control, 4.0_wp, error)
  end subroutine test_complete

  !> A mean gap in place of a load.
  subroutine test_mean_gap(error)
    type(error_t), allocatable, intent(out) :: error

    call press_waves([80, 72], unilateral_t(), displacement_control, 0.4_wp, error)
  end subroutine test_mean_gap

  !> A compliant layer between waves.
  subroutine test_waves_on_layer(error)
    type(error_t), allocatable, intent(out) :: error

    call press_waves([64, 50], power_interface_t(1.0e15_wp, 1.0_wp), force_control, 0.1_wp, error)
    if (allocated(error)) return
    call press_waves([80, 80], power_interface_t(1.0e15_wp, 1.0_wp), force_control, 0.1_wp, error)
  end subroutine test_waves_on_layer

  !> Press waves of 1 um together.
  subroutine press_waves(extent, law, control, value, error)
    integer, intent(in) :: extent(2), control
    class(normal_law_t), intent(in) :: law
    !> Mean pressure [GPa], or approach of the mean planes [um]
    real(wp), intent(in) :: value
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    real(wp) :: gap(extent(1), extent(2)), target
    logical :: candidate(extent(1), extent(2))
    integer :: i, j

    call new_lattice(lattice, oblique_basis(1.0e-5_wp, 1.1_wp, 1.3_wp), [-4, -2], extent, error)
    if (allocated(error)) return
    lattice%periodic = .true.
    do j = 1, extent(2)
      do i = 1, extent(1)
        associate (x => two_pi*i/extent(1), y => two_pi*j/extent(2))
          gap(i, j) = 1.0e-6_wp*(1.0_wp + 0.5_wp*sin(x + 1.0_wp) + 0.3_wp*sin(2*x + y) + 0.2_wp*cos(3*y - x))
        end associate
      end do
    end do
    candidate = .true.
    target = 1.0e-6_wp*value
    if (control == force_control) target = 1.0e9_wp*value*lattice%cell_area()*lattice%size()
    call compare_contacts(lattice, gap, candidate, law, control, target, 1.0e-12_wp, error)
  end subroutine press_waves

  !> A contact across the corners of a window that repeats, on three lattices: the interpolation wraps around.
  subroutine test_across(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 160
    type(lattice_t) :: lattice
    real(wp) :: gap(n, n)
    logical :: candidate(n, n)
    integer :: i, j

    call new_lattice(lattice, equilateral_basis(1.0e-5_wp), [0, 0], [n, n], error)
    if (allocated(error)) return
    lattice%periodic = .true.
    do j = 1, n
      do i = 1, n
        gap(i, j) = 1.0e-6_wp*(3.0_wp - cos(two_pi*i/n) - cos(two_pi*j/n) - cos(two_pi*(i + j)/n))
      end do
    end do
    candidate = .true.
    call compare_contacts(lattice, gap, candidate, unilateral_t(), force_control, &
                          1.0e8_wp*lattice%cell_area()*lattice%size(), 1.0e-11_wp, error)
  end subroutine test_across

  !> The pressure after a jump of wear, in windows that end and that repeat.
  subroutine test_wear_ahead(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n(2) = [64, 57]
    type(elastic_pair_t) :: pair
    type(lattice_t) :: lattice
    type(worn_cycle_t) :: cycle
    type(field_space_t) :: space
    real(wp) :: expected(n(1), n(2))
    real(wp), allocatable :: found(:, :)
    integer :: k, i, rows(2)

    call new_elastic_pair(pair, material_t(210.0e9_wp, 0.3_wp), material_t(70.0e9_wp, 0.3_wp), error)
    if (allocated(error)) return
    call new_lattice(lattice, equilateral_basis(1.0e-5_wp), [-32, -28], n, error)
    if (allocated(error)) return
    allocate (cycle%gap(n(1), n(2)), cycle%pressure(n(1), n(2)))
    call sphere(lattice, cycle%gap)
    cycle%pressure = 1.0e9_wp*sqrt(max(1.0_wp - cycle%gap/2.0e-6_wp, 0.0_wp))
    cycle%gap = max(cycle%gap - 2.0e-6_wp, 0.0_wp)
    cycle%path = 1.0e-6_wp*reshape([(1.0_wp + 0.1_wp*sin(0.7_wp*i), i=1, product(n))], n)
    allocate (cycle%friction(n(1), n(2)), source=0.4_wp)
    allocate (cycle%candidate(n(1), n(2)), source=.true.)
    cycle%energy = cycle%friction*cycle%pressure*cycle%path
    space = space_over(n, 1)
    rows = [ranks%first_row(n(2)), ranks%last_row(n(2))]
    allocate (found(n(1), rows(2) - rows(1) + 1))
    do k = 0, 3
      lattice%periodic = k > 1
      cycle%by_load = modulo(k, 2) == 0
      call wear(lattice, pair, cycle, space, expected, error)
      if (allocated(error)) return
      space%ranks = ranks
      call wear(lattice, pair, rows_of_cycle(cycle, rows), space, found, error)
      if (allocated(error)) return
      space%ranks = communicator_t()
      call check_true(error, any(abs(expected - cycle%energy) > 0.01_wp*maxval(expected)), 'wear')
      if (.not. allocated(error)) call check(error, maxval(abs(found - expected(:, rows(1):rows(2)))), 0.0_wp, 0.0_wp, 'energy')
      call ranks%agree(error)
      if (allocated(error)) return
    end do
  end subroutine test_wear_ahead

  !> Compute the energy of a cycle by which a jump wears.
  subroutine wear(lattice, pair, cycle, space, energy, error)
    type(lattice_t), intent(in) :: lattice
    type(elastic_pair_t), intent(in) :: pair
    type(worn_cycle_t), intent(in) :: cycle
    type(field_space_t), intent(in) :: space
    real(wp), intent(out) :: energy(:, :)
    type(error_t), allocatable, intent(out) :: error
    type(normal_problem_t) :: problem

    call new_normal_problem(problem, lattice, pair, cycle%gap, cycle%candidate, error, space=space)
    if (.not. allocated(error)) call energy_ahead(cycle, problem, 5.0e-11_wp, 1.0e-9_wp, energy, error)
  end subroutine wear

  !> Return some rows of all fields of a cycle.
  pure type(worn_cycle_t) function rows_of_cycle(cycle, rows) result(part)
    type(worn_cycle_t), intent(in) :: cycle
    !> First and last row
    integer, intent(in) :: rows(2)

    associate (from => rows(1), to => rows(2))
      part = worn_cycle_t(cycle%energy(:, from:to), cycle%path(:, from:to), cycle%pressure(:, from:to), cycle%gap(:, from:to), &
                          cycle%candidate(:, from:to), cycle%friction(:, from:to), cycle%by_load)
    end associate
  end function rows_of_cycle

end module ranks_tests

!> Run them; mpirun starts this program with some numbers of ranks.
program ranks_tester
  use hc_communicator, only: start_ranks, end_ranks
  use testing, only: new_suite, run_suites
  use ranks_tests, only: collect, ranks
  implicit none

  integer :: n_failed

  call start_ranks(ranks)
  ranks%least_nodes = 1
  call run_suites([new_suite('ranks', collect)], n_failed)
  call end_ranks(ranks)
  if (n_failed > 0) stop 1, quiet=.true.
  stop 0, quiet=.true.
end program ranks_tester
