!> Solvers with another operator and another preconditioner than the usual ones.
module test_preconditioner
  use hc_precision, only: wp, lk
  use hc_error, only: error_t
  use hc_field_space, only: field_space_t
  use hc_active_set, only: active_set_t, new_active_set
  use hc_options, only: preconditioner_options_t
  use hc_lattice, only: lattice_t, new_lattice, equilateral_basis
  use hc_elastic_pair, only: elastic_pair_t
  use hc_flexibility, only: normal
  use hc_flexibility_fft, only: fft_flexibility_t, new_fft_flexibility, of_pressure
  use hc_symbol_preconditioner, only: pressure_preconditioner_t, new_symbol_preconditioner
  use hc_flexibility_dense, only: dense_flexibility_t, new_dense_flexibility
  use hc_preconditioner, only: preconditioner_t
  use hc_contact_state, only: contact_state_t, new_friction_state, load_target_t, load_step_t, force_control
  use hc_contact_problem, only: friction_problem_t
  use hc_coulomb, only: coulomb_t
  use hc_operator_set, only: operators_t, new_operators
  use hc_shear_system, only: shear_system_t, new_shear_system
  use hc_frictional_contact, only: frictional_contact_t
  use hc_lattice_solver, only: solve_on_lattice
  use hc_normal_iterate, only: normal_iterate_t
  use hc_normal_lattice, only: normal_lattice_t
  use hc_normal_problem, only: new_normal_problem
  use hc_normal_lattice_solver, only: solve_on_normal_lattice
  use hc_pressure_kernel, only: normal_kernel_t
  use test_friction, only: new_sphere, precondition_shear
  use testing, only: test_t, new_test, check, check_true
  implicit none
  private

  public :: collect_preconditioner

  !> Inverse of the diagonal of operator and springs.
  type, extends(preconditioner_t) :: diagonal_preconditioner_t
    !> Self-compliance of a node [m/Pa]
    real(wp) :: own = 1.0_wp
    !> Compliance of the springs along the first component [m/Pa]
    real(wp), allocatable :: spring(:)
    integer :: applications = 0
  contains
    procedure :: set_active
    procedure :: apply_packed
  end type diagonal_preconditioner_t

contains

  subroutine collect_preconditioner(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('diagonal', test_diagonal), &
      new_test('diagonal_coupled', test_diagonal_coupled), &
      new_test('diagonal_frictionless', test_diagonal_frictionless), &
      new_test('springs', test_springs), &
      new_test('slip', test_slip), &
      new_test('slip_spectrum', test_slip_spectrum) &
    ]
  end subroutine collect_preconditioner

  !> On springs along the normal that soften without bound towards the edge M is symmetric and at least the inverse, (P7): for
  !> x = (K + C) y on the contact, x^T M x >= x^T y.
  subroutine test_springs(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 40
    type(lattice_t) :: lattice
    type(elastic_pair_t) :: pair
    type(fft_flexibility_t) :: flexibility
    type(pressure_preconditioner_t) :: preconditioner
    real(wp), dimension(n, n, 1) :: x, y, w
    real(wp), dimension(n*n) :: compliance, mx, mw, packed
    type(active_set_t) :: nodes
    logical(lk) :: active(n, n)
    real(wp) :: work, layer, inside
    integer :: col, row, softness

    pair = elastic_pair_t(1.0_wp, 0.0_wp, 0.0_wp)
    call new_lattice(lattice, equilateral_basis(1.0_wp), [0, 0], [n, n], error)
    if (allocated(error)) return
    call new_fft_flexibility(flexibility, lattice, pair, error, kind=of_pressure)
    if (allocated(error)) return
    call new_symbol_preconditioner(preconditioner, lattice, pair, field_space_t(), preconditioner_options_t(), error)
    if (allocated(error)) return
    do softness = -2, 2
      layer = 3.0_wp*10.0_wp**softness
      do row = 1, n
        do col = 1, n
          inside = 1.0_wp - ((col - 20.3_wp)**2 + (row - 20.4_wp)**2 + (col - 20.3_wp)*(row - 20.4_wp))/16.5_wp**2
          active(col, row) = inside > 0.0_wp
          compliance((row - 1)*n + col) = merge(layer*max(inside, 1.0e-8_wp)**(-0.4_wp), 0.0_wp, active(col, row))
        end do
      end do
      call preconditioner%set_active(reshape(active, [n*n]), compliance)
      call random_number(y)
      call random_number(w)
      y(:, :, 1) = merge(y(:, :, 1), 0.0_wp, active)
      w(:, :, 1) = merge(w(:, :, 1), 0.0_wp, active)
      call flexibility%apply([normal], y, [normal], x, error)
      if (allocated(error)) return
      x(:, :, 1) = merge(x(:, :, 1) + reshape(compliance, [n, n])*y(:, :, 1), 0.0_wp, active)
      work = 0.0_wp
      call new_active_set(nodes, reshape(active, [n*n]), field_space_t())
      call preconditioner%apply_packed(nodes, n*n, pack(x(:, :, 1), active), packed(:nodes%n_active), work)
      mx = unpack(packed, reshape(active, [n*n]), 0.0_wp)
      call preconditioner%apply_packed(nodes, n*n, pack(w(:, :, 1), active), packed(:nodes%n_active), work)
      mw = unpack(packed, reshape(active, [n*n]), 0.0_wp)
      ! single precision
      call check(error, dot_product(reshape(w, [n*n]), mx), dot_product(reshape(x, [n*n]), mw), &
                 1.0e-5_wp*abs(dot_product(reshape(x, [n*n]), mw)), 'w^T M x')
      if (allocated(error)) return
      call check_true(error, dot_product(reshape(x, [n*n]), mx) > 0.999_wp*sum(x*y), 'M is at least the inverse')
      if (allocated(error)) return
      call check_true(error, dot_product(reshape(x, [n*n]), mx) < 3.5_wp*sum(x*y), 'M is close to the inverse')
      if (allocated(error)) return
    end do
  end subroutine test_springs

  !> In partial slip M of the shear traction is symmetric and at least the inverse, and close to it, (P5), (P6): for x = (T + D) y
  !> on the unknowns, x^T M x >= x^T y, also for y at the front of stick, and whatever the frames of the nodes in stick are.
  subroutine test_slip(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: side = 49, n = side**2
    type(lattice_t) :: lattice
    type(operators_t), target :: operators
    type(shear_system_t), target :: system
    real(wp), dimension(side, side) :: x, y, radius
    real(wp), dimension(n) :: distance, turn, compliance
    real(wp), dimension(2*n) :: traction, moved, answer, other, other_moved, other_answer
    logical(lk) :: unknown(2*n)
    integer :: front, frame

    call new_lattice(lattice, equilateral_basis(1.0_wp), [-24, -24], [side, side], error)
    if (allocated(error)) return
    call new_operators(operators, lattice, elastic_pair_t(1.0_wp, 0.0_wp, 0.5_wp), field_space_t(), error)
    if (allocated(error)) return
    call new_shear_system(system, operators)
    call lattice%coordinates(x, y)
    radius = sqrt((x - 0.3_wp)**2 + (y + 0.2_wp)**2)
    do front = 4, 16, 4
      distance = reshape(max(radius - front, 0.0_wp), [n])
      ! from nothing at the front to far above that of the whole contact at its edge
      compliance = system%elastic_compliance*merge(0.2_wp*distance**1.5_wp/max(18.0_wp - reshape(radius, [n]), 1.0e-4_wp), &
                                                   0.0_wp, reshape(radius < 18.0_wp, [n]))
      do frame = 1, 2
        ! slip along x, but for a turn; in stick the same frames, or any
        call random_number(turn)
        turn = merge(turn*6.0_wp*(frame - 1), 0.1_wp*reshape(x - y, [n])/18.0_wp, .not. compliance > 0.0_wp)
        unknown = [reshape(radius < 18.0_wp, [n]), reshape(radius < 18.0_wp, [n]) .and. .not. compliance > 0.0_wp]
        call system%set_contact(unknown(:n))
        system%compliance = pack(compliance, unknown(:n))
        system%direction(1, :) = pack(cos(turn), unknown(:n))
        system%direction(2, :) = pack(sin(turn), unknown(:n))
        call system%use_frames(unknown(:n))
        call random_number(traction)
        call random_number(other)
        traction = merge(traction - 0.5_wp, 0.0_wp, unknown)
        other = merge(other*exp(-([distance, distance] - 0.5_wp)**2), 0.0_wp, unknown)
        call estimate(traction, moved, answer)
        if (allocated(error)) return
        call estimate(other, other_moved, other_answer)
        if (allocated(error)) return
        ! single precision
        call check(error, dot_product(other_moved, answer), dot_product(moved, other_answer), &
                   1.0e-5_wp*sqrt(dot_product(moved, answer)*dot_product(other_moved, other_answer)), 'w^T M x')
        if (allocated(error)) return
        call check_true(error, dot_product(moved, answer) > 0.999_wp*dot_product(moved, traction) .and. &
                        dot_product(other_moved, other_answer) > 0.999_wp*dot_product(other_moved, other), 'at least the inverse')
        if (allocated(error)) return
        call check_true(error, dot_product(moved, answer) < 1.2_wp*dot_product(moved, traction) .and. &
                        dot_product(other_moved, other_answer) < 1.9_wp*dot_product(other_moved, other), 'close to the inverse')
        if (allocated(error)) return
      end do
    end do

  contains

    !> Multiply, and estimate what was multiplied.
    subroutine estimate(y, x, m_x)
      real(wp), intent(in), contiguous :: y(:)
      real(wp), intent(out), contiguous :: x(:), m_x(:)

      call system%product(y, x, error)
      if (allocated(error)) return
      x = merge(x, 0.0_wp, unknown)
      call precondition_shear(system, unknown, x, m_x)
    end subroutine estimate

  end subroutine test_slip

  !> With the springs of Cattaneo and Mindlin's slip zone at Q = mu P/2 no eigenvalue of M (T + D) is above 2, on any lattice.
  subroutine test_slip_spectrum(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    type(operators_t), target :: operators
    type(shear_system_t), target :: system
    real(wp), allocatable :: x(:, :), y(:, :), radius(:), slip(:), v(:), image(:), back(:)
    logical(lk), allocatable :: unknown(:)
    real(wp) :: eigenvalue
    integer :: spacings, half, side, n, k

    do spacings = 18, 36, 18
      half = int(1.34_wp*spacings)
      side = 2*half + 1
      n = side**2
      if (allocated(x)) deallocate (x, y, radius, slip, unknown, v, image, back)
      allocate (x(side, side), y(side, side), radius(n), slip(n), unknown(2*n), v(2*n), image(2*n), back(2*n))
      call new_lattice(lattice, equilateral_basis(1.0_wp), [-half, -half], [side, side], error)
      if (allocated(error)) return
      call new_operators(operators, lattice, elastic_pair_t(1.0_wp, 0.0_wp, 0.5_wp), field_space_t(), error)
      if (allocated(error)) return
      call new_shear_system(system, operators)
      call lattice%coordinates(x, y)
      radius(:) = reshape(sqrt((x - 0.3_wp)**2 + (y + 0.2_wp)**2), [n])/spacings
      ! slip grows like the power 1.5 of the distance from stick, and the pressure falls like the root of that from the edge
      slip(:) = max(radius - 0.794_wp, 0.0_wp)**1.5_wp/sqrt(max(1.0_wp - radius**2, 1.0e-6_wp))
      unknown(:) = [radius < 1.0_wp, radius < 0.794_wp]
      call system%set_contact(unknown(:n))
      system%compliance = pack(2.0_wp*spacings*system%elastic_compliance*slip, unknown(:n))
      call system%use_frames(unknown(:n))
      call random_number(v)
      v = merge(v - 0.5_wp, 0.0_wp, unknown)
      do k = 1, 60
        call system%product(v, image, error)
        if (allocated(error)) return
        image = merge(image, 0.0_wp, unknown)
        call precondition_shear(system, unknown, image, back)
        eigenvalue = dot_product(back, image)/dot_product(v, image)
        v = back/sqrt(sum(back**2))
      end do
      call check(error, eigenvalue, 1.9_wp, 0.1_wp, 'largest eigenvalue')
      if (allocated(error)) return
    end do
  end subroutine test_slip_spectrum

  subroutine set_active(self, active, compliance, direction)
    class(diagonal_preconditioner_t), intent(inout) :: self
    logical(lk), intent(in), contiguous :: active(:)
    real(wp), intent(in), optional, target, contiguous :: compliance(:), direction(:, :)

    self%spring = spread(0.0_wp, 1, size(active))
    if (present(direction)) self%spring = [unpack(compliance, logical(active), 0.0_wp), self%spring]
  end subroutine set_active

  subroutine apply_packed(self, nodes, n, displacement, traction, work)
    class(diagonal_preconditioner_t), intent(inout) :: self
    type(active_set_t), intent(in) :: nodes
    integer, intent(in) :: n
    real(wp), intent(in), contiguous :: displacement(:)
    real(wp), intent(inout), contiguous :: traction(:)
    real(wp), intent(inout) :: work
    real(wp) :: spring(size(displacement))

    call nodes%pack(self%spring, spring)
    traction = displacement/(self%own + spring)
    self%applications = self%applications + 1
  end subroutine apply_packed

  subroutine test_diagonal(error)
    type(error_t), allocatable, intent(out) :: error
    call compare(0.0_wp, 0.3_wp, error)
  end subroutine test_diagonal

  subroutine test_diagonal_coupled(error)
    type(error_t), allocatable, intent(out) :: error
    call compare(0.3_wp, 0.8_wp, error)
  end subroutine test_diagonal_coupled

  !> A step in partial slip with the explicit matrix and its diagonal is that with FFTs and the inverse symbol.
  subroutine compare(beta, mu, error)
    !> Coupling of pressure and shear, coefficient of friction
    real(wp), intent(in) :: beta, mu
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(operators_t) :: usual, other
    type(dense_flexibility_t), allocatable :: dense
    type(diagonal_preconditioner_t), allocatable :: diagonal
    type(contact_state_t), target :: start
    type(contact_state_t) :: again, expected, found
    type(load_target_t) :: target

    call new_sphere(contact, 10, 0.2_wp, beta, coulomb_t(mu), error, n_threads=1)
    if (allocated(error)) return
    associate (problem => contact%problem)
      call new_operators(usual, problem%lattice, problem%medium, field_space_t(), error)
      if (allocated(error)) return
      allocate (dense)
      call new_dense_flexibility(dense, problem%lattice, problem%medium, error)
      if (allocated(error)) return
      call move_alloc(dense, other%flexibility)
      allocate (diagonal)
      diagonal%own = problem%normal_compliance
      call move_alloc(diagonal, other%normal)
      allocate (diagonal)
      diagonal%own = problem%tangential_compliance
      call move_alloc(diagonal, other%tangential)
      target = load_target_t(spread(force_control, 1, 4), [1.0_wp, 0.15_wp*mu, 0.1_wp*mu, 0.05_wp*mu])
      call new_friction_state(start, problem%lattice)
      again = start
      call solve_on_lattice(problem, usual, start, load_step_t(target, start%relative_displacement, 1.0e-10_wp, 60), &
                            expected, error)
      if (allocated(error)) return
      call solve_on_lattice(problem, other, again, load_step_t(target, start%relative_displacement, 1.0e-10_wp, 60), found, error)
      if (allocated(error)) return
    end associate
    call check_true(error, expected%converged .and. found%converged, 'both converge')
    if (allocated(error)) return
    call check_true(error, all(expected%zone == found%zone), 'the same zones')
    if (allocated(error)) return
    call check(error, [found%pressure, found%traction], [expected%pressure, expected%traction], 1.0e-8_wp, 'tractions')
    if (allocated(error)) return
    select type (preconditioner => other%tangential)
    type is (diagonal_preconditioner_t)
      call check_true(error, preconditioner%applications > 0, 'the diagonal was taken')
    end select
  end subroutine compare

  !> The frictionless solver, which works in single precision, takes the diagonal likewise.
  subroutine test_diagonal_frictionless(error)
    type(error_t), allocatable, intent(out) :: error
    type(frictional_contact_t) :: contact
    type(normal_lattice_t) :: level(2)
    type(normal_iterate_t) :: now(2)
    type(normal_kernel_t) :: kernel
    type(diagonal_preconditioner_t), allocatable :: diagonal
    type(contact_state_t) :: state(2)
    integer :: k

    call new_sphere(contact, 10, 0.0_wp, 0.0_wp, coulomb_t(0.0_wp), error, n_threads=1)
    if (allocated(error)) return
    do k = 1, 2
      associate (problem => contact%problem)
        call new_normal_problem(level(k), problem%lattice, problem%medium, problem%initial_gap, logical(problem%candidate), error)
      end associate
      if (allocated(error)) return
      call level(k)%prepare(kernel, .true., .true., field_space_t(), error)
      if (allocated(error)) return
      if (k == 2) then
        allocate (diagonal)
        diagonal%unit = level(k)%preconditioner%unit
        ! a projected step takes M for nearly the inverse: the compliance of the whole contact
        diagonal%own = 10.0_wp*contact%problem%normal_compliance
        call move_alloc(diagonal, level(k)%preconditioner)
      end if
      allocate (state(k)%pressure, mold=level(k)%initial_gap)
      state(k)%pressure = merge(1.0_wp, 0.0_wp, level(k)%candidate)
      call solve_on_normal_lattice(level(k), now(k), load_target_t([force_control], [1.0_wp]), 1.0e-10_wp, 400, state(k), error)
      if (allocated(error)) return
      call check_true(error, state(k)%converged, 'converged')
      if (allocated(error)) return
    end do
    call check(error, [state(2)%pressure], [state(1)%pressure], 1.0e-8_wp, 'pressure')
  end subroutine test_diagonal_frictionless

end module test_preconditioner
