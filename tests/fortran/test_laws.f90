!> Laws of friction that the core does not know, how nodes are fixed, and parts of the window.
module test_laws
  use hc_precision, only: wp, lk, zk
  use hc_error, only: error_t
  use hc_lattice, only: lattice_t, new_lattice, equilateral_basis
  use hc_field_space, only: field_space_t
  use hc_contact_state, only: contact_state_t, new_friction_state, load_target_t, force_control, displacement_control, &
    separated, stick, slip, normal
  use hc_friction_law, only: friction_law_t
  use hc_coulomb, only: coulomb_t
  use hc_load_constraints, only: fix_in_stick
  use hc_subwindow, only: next_part
  use hc_contact_problem, only: friction_problem_t
  use hc_contact_solver, only: contact_solver_t
  use hc_frictional_contact, only: frictional_contact_t, new_frictional_contact
  use hc_direct_friction, only: direct_friction_t, new_direct_friction
  use hc_direct_contact, only: direct_contact_t, new_direct_contact
  use hc_normal_contact, only: normal_contact_t, new_normal_contact
  use test_friction, only: new_sphere
  use testing, only: test_t, new_test, check, check_true, largest, coordinate
  implicit none
  private

  public :: collect_laws

  integer, parameter :: f = force_control, d = displacement_control
  !> Load of a contact of radius one
  real(wp), parameter :: load = 4.0_wp/3.0_wp

  !> Coulomb's law with a coefficient of its own at every node: that with the coefficient one under the pressure mu p.
  type, extends(friction_law_t) :: nodal_law_t
    real(wp), allocatable :: coefficient(:)
    type(coulomb_t) :: unit_law = coulomb_t(1.0_wp)
  contains
    procedure :: resists, is_bounded, check => check_nodal, strength, find_bounds, find_slopes, find_zones, project, violation, &
      linearize, find_nodal_values, set_nodal_values
  end type nodal_law_t

contains

  subroutine collect_laws(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('same_everywhere', test_same_everywhere), &
      new_test('two_halves', test_two_halves), &
      new_test('any_solver', test_any_solver), &
      new_test('fixed_nodes', test_fixed_nodes), &
      new_test('next_part', test_next_part) &
    ]
  end subroutine collect_laws

  !> A law that only the test knows, with equal numbers, is Coulomb's on all lattices and by all methods.
  subroutine test_same_everywhere(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: mu = 0.3_wp
    type(frictional_contact_t) :: coulomb, nodal
    type(direct_friction_t) :: direct
    type(contact_state_t) :: none, expected, state
    type(load_target_t) :: target

    call new_sphere(coulomb, 12, 0.3_wp, -0.2_wp, coulomb_t(mu), error)
    if (allocated(error)) return
    call new_nodal(coulomb, mu, mu, nodal, error)
    if (allocated(error)) return
    call new_friction_state(none, coulomb%problem%lattice)
    target = load_target_t([f, f, f, d], [load, 0.1_wp*load, 0.0_wp, 0.0_wp])
    call coulomb%solve_step(none, none%relative_displacement, target, 1.0e-9_wp, 60, expected, error)
    if (allocated(error)) return
    call nodal%solve_step(none, none%relative_displacement, target, 1.0e-9_wp, 60, state, error)
    if (allocated(error)) return
    call compare('FFT')
    if (allocated(error)) return
    call new_direct_friction(direct, nodal%problem, error)
    if (allocated(error)) return
    call direct%solve_step(none, none%relative_displacement, target, 1.0e-9_wp, 200, state, error)
    if (allocated(error)) return
    call compare('LAPACK')

  contains

    subroutine compare(what)
      character(len=*), intent(in) :: what

      call check_true(error, expected%converged .and. state%converged, what//': converged')
      if (allocated(error)) return
      call check(error, largest(state%traction - expected%traction), 0.0_wp, 1.0e-6_wp*maxval(expected%pressure), what)
    end subroutine compare

  end subroutine test_same_everywhere

  !> One half of a contact is smooth, the other rough: each node of it keeps to its own bound, and carries what is left.
  subroutine test_two_halves(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: smooth = 0.05_wp, rough = 0.5_wp
    type(frictional_contact_t) :: coulomb, nodal
    type(contact_state_t) :: none, state
    real(wp), allocatable :: mu(:, :), length(:, :)

    call new_sphere(coulomb, 12, 0.0_wp, 0.0_wp, coulomb_t(rough), error)
    if (allocated(error)) return
    call new_nodal(coulomb, smooth, rough, nodal, error)
    if (allocated(error)) return
    call new_friction_state(none, coulomb%problem%lattice)
    call nodal%solve_step(none, none%relative_displacement, &
                          load_target_t([f, f, f, d], [load, 0.15_wp*load, 0.0_wp, 0.0_wp]), 1.0e-9_wp, 60, state, error)
    if (allocated(error)) return
    call check_true(error, state%converged, 'converged')
    if (allocated(error)) return
    mu = merge(smooth, rough, coordinate(coulomb%problem%lattice, 1) < 0.0_wp)
    length = norm2(state%traction, dim=3)
    call check_true(error, all(length <= mu*state%pressure*(1.0_wp + 1.0e-12_wp)), 'within the bound of each node')
    if (allocated(error)) return
    call check_true(error, all(abs(length - mu*state%pressure) <= 1.0e-12_wp .or. state%zone /= slip), 'slip on the bound')
    if (allocated(error)) return
    call check_true(error, 2*count(state%zone == slip .and. mu < 0.1_wp) > count(state%zone > separated .and. mu < 0.1_wp), &
                    'most of the smooth half slips')
    if (allocated(error)) return
    call check_true(error, 2*count(state%zone == stick .and. mu > 0.1_wp) > count(state%zone > separated .and. mu > 0.1_wp), &
                    'most of the rough half sticks')
  end subroutine test_two_halves

  !> Solvers without friction answer as steps, and as load or approach.
  subroutine test_any_solver(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: sphere
    type(normal_contact_t), target :: fft
    type(direct_contact_t), target :: dense

    call new_sphere(sphere, 8, 0.0_wp, 0.0_wp, coulomb_t(0.0_wp), error)
    if (allocated(error)) return
    associate (problem => sphere%problem)
      call new_normal_contact(fft, problem%lattice, problem%medium, problem%initial_gap, logical(problem%candidate), error)
      if (allocated(error)) return
      call new_direct_contact(dense, problem%lattice, problem%medium, problem%initial_gap, logical(problem%candidate), error)
    end associate
    if (allocated(error)) return
    call check_solver(fft)
    if (.not. allocated(error)) call check_solver(dense)
    if (.not. allocated(error)) call check_solver(sphere)

  contains

    subroutine check_solver(solver)
      class(contact_solver_t), intent(inout) :: solver
      type(contact_state_t) :: none, state

      call new_friction_state(none, sphere%problem%lattice)
      call solver%solve_step(none, none%relative_displacement, load_target_t([f, d, d, d], [load, 0.0_wp, 0.0_wp, 0.0_wp]), &
                             1.0e-9_wp, 100, state, error)
      if (allocated(error)) return
      call check_true(error, state%converged, 'converged')
      if (allocated(error)) return
      call check(error, state%load(normal), load, 1.0e-8_wp*load, 'load')
    end subroutine check_solver

  end subroutine test_any_solver

  !> The quarter that slips least.
  subroutine test_fixed_nodes(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: compliance(10)
    integer(zk) :: zone(10)

    compliance = [8.0_wp, 0.0_wp, 2.0_wp, 7.0_wp, huge(1.0_wp), 1.0_wp, 3.0_wp, 5.0_wp, 0.0_wp, 4.0_wp]
    zone = slip
    zone([2, 9]) = [stick, separated]
    call fix_in_stick(field_space_t(), 0.25_wp, compliance, zone)
    call check_true(error, all(zone == [slip, stick, stick, slip, slip, stick, slip, slip, separated, slip]), 'zones')
    if (allocated(error)) return
    call check_true(error, all(compliance([3, 6]) <= 0.0_wp) .and. compliance(7) > 2.9_wp, 'compliances')
  end subroutine test_fixed_nodes

  !> Parts around the contact, then around overlapping nodes too, then none.
  subroutine test_next_part(error)
    type(error_t), allocatable, intent(out) :: error
    type(friction_problem_t) :: problem
    type(contact_state_t) :: state
    logical :: found
    integer :: low(2), high(2)

    call new_lattice(problem%lattice, equilateral_basis(1.0_wp), [0, 0], [200, 200], error)
    if (allocated(error)) return
    call new_friction_state(state, problem%lattice)
    state%pressure(90:100, 90:100) = 1.0_wp
    state%gap(130, 95) = -1.0_wp
    state%gap(2, 2) = -1.0_wp
    allocate (problem%candidate(200, 200), source=.true._lk)
    problem%candidate(2, 2) = .false.
    call next_part(1, problem, state, low, high, found)
    call check_true(error, found .and. all(low < 90) .and. all(high > 100) .and. high(1) < 130, 'around the contact')
    if (allocated(error)) return
    call next_part(2, problem, state, low, high, found)
    call check_true(error, found .and. high(1) > 130 .and. all(low > 10), 'around nodes that overlap and may touch')
    if (allocated(error)) return
    call next_part(4, problem, state, low, high, found)
    call check_true(error, .not. found, 'not for ever')
    if (allocated(error)) return
    state%pressure(10:190, 10:190) = 1.0_wp
    call next_part(1, problem, state, low, high, found)
    call check_true(error, .not. found, 'not almost the whole window')
  end subroutine test_next_part

  !> The problem of another contact with one coefficient where x < 0, and another elsewhere.
  subroutine new_nodal(coulomb, left, right, nodal, error)
    type(frictional_contact_t), intent(in) :: coulomb
    real(wp), intent(in) :: left, right
    type(frictional_contact_t), intent(out) :: nodal
    type(error_t), allocatable, intent(out) :: error
    type(nodal_law_t) :: law
    type(friction_problem_t) :: problem

    problem = coulomb%problem
    associate (lattice => coulomb%problem%lattice)
      law%coefficient = merge(left, right, reshape(coordinate(lattice, 1), [lattice%size()]) < 0.0_wp)
    end associate
    deallocate (problem%friction)
    allocate (problem%friction, source=law)
    call new_frictional_contact(nodal, problem, error, 2)
  end subroutine new_nodal

  pure logical function resists(self)
    class(nodal_law_t), intent(in) :: self
    resists = any(self%coefficient > 0.0_wp)
  end function resists

  pure logical function is_bounded(self)
    class(nodal_law_t), intent(in) :: self
    is_bounded = size(self%coefficient) > 0
  end function is_bounded

  pure subroutine check_nodal(self, n_node, error)
    class(nodal_law_t), intent(in) :: self
    integer, intent(in) :: n_node
    type(error_t), allocatable, intent(out) :: error

    if (size(self%coefficient) /= n_node) error = error_t()
  end subroutine check_nodal

  pure real(wp) function strength(self, p_max)
    class(nodal_law_t), intent(in) :: self
    real(wp), intent(in) :: p_max
    associate (under_any => p_max)
      strength = maxval(self%coefficient)
    end associate
  end function strength

  pure subroutine find_bounds(self, first, p, bound)
    class(nodal_law_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in), contiguous :: p(:)
    real(wp), intent(out), contiguous :: bound(:)
    bound = self%coefficient(first:first + size(p) - 1)*max(p, 0.0_wp)
  end subroutine find_bounds

  pure subroutine find_slopes(self, first, p, bound)
    class(nodal_law_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in), contiguous :: p(:)
    real(wp), intent(out), contiguous :: bound(:)
    bound = self%coefficient(first:first + size(p) - 1)
  end subroutine find_slopes

  pure subroutine find_zones(self, first, unit, r, p, qx, qy, dsx, dsy, zone)
    class(nodal_law_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in) :: unit, r
    real(wp), intent(in), contiguous :: p(:), qx(:), qy(:), dsx(:), dsy(:)
    integer(zk), intent(out), contiguous :: zone(:)
    call self%unit_law%find_zones(first, unit, r, self%coefficient(first:first + size(p) - 1)*p, qx, qy, dsx, dsy, zone)
  end subroutine find_zones

  pure subroutine project(self, first, unit, p, qx, qy, cut_x, cut_y)
    class(nodal_law_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in) :: unit
    real(wp), intent(in), contiguous :: p(:), qx(:), qy(:)
    real(wp), intent(out), contiguous :: cut_x(:), cut_y(:)
    call self%unit_law%project(first, unit, self%coefficient(first:first + size(p) - 1)*p, qx, qy, cut_x, cut_y)
  end subroutine project

  pure subroutine violation(self, first, unit, stiffness, p, qx, qy, dsx, dsy, largest, worst)
    class(nodal_law_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in) :: unit, stiffness
    real(wp), intent(in), contiguous :: p(:), qx(:), qy(:), dsx(:), dsy(:)
    real(wp), intent(inout) :: largest, worst
    call self%unit_law%violation(first, unit, stiffness, self%coefficient(first:first + size(p) - 1)*p, qx, qy, dsx, dsy, &
                                 largest, worst)
  end subroutine violation

  pure subroutine linearize(self, first, p_max, r, in_contact, p, qx, qy, dsx, dsy, zone, direction, compliance)
    class(nodal_law_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in) :: p_max, r
    logical, intent(in), contiguous :: in_contact(:)
    real(wp), intent(in), contiguous :: p(:), qx(:), qy(:), dsx(:), dsy(:)
    integer(zk), intent(out), contiguous :: zone(:)
    real(wp), intent(out), contiguous :: direction(:, :), compliance(:)
    call self%unit_law%linearize(first, self%strength(p_max)*p_max, r, in_contact, self%coefficient(first:first + size(p) - 1)*p, &
                                 qx, qy, dsx, dsy, zone, direction, compliance)
  end subroutine linearize

  pure subroutine find_nodal_values(self, values)
    class(nodal_law_t), intent(in) :: self
    real(wp), allocatable, intent(out) :: values(:)

    values = self%coefficient
  end subroutine find_nodal_values

  pure subroutine set_nodal_values(self, values, largest)
    class(nodal_law_t), intent(inout) :: self
    real(wp), intent(in) :: values(:), largest

    self%coefficient = values
  end subroutine set_nodal_values

end module test_laws
