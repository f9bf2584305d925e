!> An elastic medium of its own: half-spaces with displacements scaled, and scaled again at distances below a length.
!>
!> Its blocks xx and yy have no constant sum, and with a length lattices of a hierarchy have different kernels. The factor
!> f (1 + e exp(-(r/t)^2)) leaves the operator positive definite: a product, number by number, of two that are (I. Schur, 1911).
module test_medium
  use, intrinsic :: iso_fortran_env, only: int64
  use hc_precision, only: wp, pi
  use hc_error, only: error_t
  use hc_lattice, only: lattice_t, new_lattice, equilateral_basis
  use hc_elastic_medium, only: elastic_medium_t, influence_t, block_symbols_t, n_block, n_word
  use hc_elastic_pair, only: elastic_pair_t
  use hc_field_space, only: field_space_t
  use hc_pressure_kernel, only: normal_kernel_t
  use hc_spectrum, only: new_kernel_key, of_pressure, of_all_tractions, inverse_of_shear
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_spectrum_file, only: file_name
  use hc_contact_state, only: contact_state_t, new_friction_state, load_target_t, force_control, displacement_control
  use hc_coulomb, only: coulomb_t
  use hc_contact_problem, only: friction_problem_t, new_friction_problem
  use hc_contact_solver, only: friction_solver_t
  use hc_normal_contact, only: normal_contact_t, new_normal_contact
  use hc_direct_contact, only: direct_contact_t, new_direct_contact
  use hc_frictional_contact, only: frictional_contact_t, new_frictional_contact
  use hc_direct_friction, only: direct_friction_t, new_direct_friction
  use testing, only: test_t, new_test, check, check_true, check_raised, largest
  implicit none
  private

  public :: collect_medium

  integer, parameter :: n = 12, f = force_control, d = displacement_control
  real(wp), parameter :: load = 4.0_wp/3.0_wp, tight = 1.0e-10_wp, factor = 2.5_wp

  !> The medium.
  type, extends(elastic_medium_t) :: scaled_medium_t
    !> The half-spaces
    type(elastic_pair_t) :: pair
    !> Factor f, excess e of short distances and length t
    real(wp) :: factor = 1.0_wp, excess = 0.0_wp, length = 1.0_wp
  contains
    procedure :: check => check_scaled
    procedure :: unit, reduce, new_influence, find_symbols, new_block_symbols, key_words, coupling, shear_ratio, normal_point, &
                 shear_point
  end type scaled_medium_t

  !> Displacements by one pyramid.
  type, extends(influence_t) :: scaled_influence_t
    type(scaled_medium_t) :: medium
    class(influence_t), allocatable :: of_pair
  contains
    procedure :: blocks, closing, is_hexagonal
  end type scaled_influence_t

contains

  subroutine collect_medium(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('frictionless', test_frictionless), &
      new_test('friction', test_friction), &
      new_test('direct_friction', test_direct), &
      new_test('own_length', test_own_length), &
      new_test('table', test_table), &
      new_test('keys', test_keys), &
      new_test('files', test_files), &
      new_test('refused', test_refused) &
    ]
  end subroutine collect_medium

  pure subroutine check_scaled(self, error)
    class(scaled_medium_t), intent(in) :: self
    type(error_t), allocatable, intent(out) :: error

    call self%pair%check(error)
  end subroutine check_scaled

  pure real(wp) function unit(self, length)
    class(scaled_medium_t), intent(in) :: self
    real(wp), intent(in) :: length

    unit = self%factor*self%pair%unit(length)
  end function unit

  subroutine reduce(self, length, reduced)
    class(scaled_medium_t), intent(in) :: self
    real(wp), intent(in) :: length
    class(elastic_medium_t), allocatable, intent(out) :: reduced
    class(elastic_medium_t), allocatable :: pair

    call self%pair%reduce(length, pair)
    select type (pair)
    type is (elastic_pair_t)
      allocate (reduced, source=scaled_medium_t(pair, 1.0_wp, self%excess, self%length/length))
    end select
  end subroutine reduce

  subroutine new_influence(self, basis, influence)
    class(scaled_medium_t), intent(in) :: self
    real(wp), intent(in) :: basis(2, 2)
    class(influence_t), allocatable, intent(out) :: influence
    type(scaled_influence_t), allocatable :: made

    allocate (made)
    made%medium = self
    call self%pair%new_influence(basis, made%of_pair)
    call move_alloc(made, influence)
  end subroutine new_influence

  pure subroutine blocks(self, x, y, block)
    class(scaled_influence_t), intent(in) :: self
    real(wp), intent(in), contiguous :: x(:), y(:)
    real(wp), intent(out), contiguous :: block(:, :)

    call self%of_pair%blocks(x, y, block)
    block = block*spread(factor_at(self%medium, x, y), 1, n_block)
  end subroutine blocks

  pure subroutine closing(self, x, y, displacement)
    class(scaled_influence_t), intent(in) :: self
    real(wp), intent(in), contiguous :: x(:), y(:)
    real(wp), intent(out), contiguous :: displacement(:)

    call self%of_pair%closing(x, y, displacement)
    displacement = displacement*factor_at(self%medium, x, y)
  end subroutine closing

  elemental real(wp) function factor_at(medium, x, y)
    type(scaled_medium_t), intent(in) :: medium
    real(wp), intent(in) :: x, y

    factor_at = medium%factor*(1.0_wp + medium%excess*exp(-(x**2 + y**2)/medium%length**2))
  end function factor_at

  pure logical function is_hexagonal(self)
    class(scaled_influence_t), intent(in) :: self

    is_hexagonal = self%of_pair%is_hexagonal()
  end function is_hexagonal

  !> Those of the half-spaces: they precondition only.
  pure subroutine find_symbols(self, basis, length, frequency, symbol)
    class(scaled_medium_t), intent(in) :: self
    real(wp), intent(in) :: basis(2, 2)
    integer, intent(in) :: length(2), frequency(:, :)
    real(wp), intent(out), contiguous :: symbol(:, :)

    call self%pair%find_symbols(basis, length, frequency, symbol)
    symbol = self%factor*symbol
  end subroutine find_symbols

  !> Those of the half-spaces: no window of the tests repeats.
  subroutine new_block_symbols(self, basis, length, n, symbols)
    class(scaled_medium_t), intent(in) :: self
    real(wp), intent(in) :: basis(2, 2)
    integer, intent(in) :: length(2), n
    class(block_symbols_t), allocatable, intent(out) :: symbols

    call self%pair%new_block_symbols(basis, length, n, symbols)
  end subroutine new_block_symbols

  pure function key_words(self, normal, tangential) result(word)
    class(scaled_medium_t), intent(in) :: self
    logical, intent(in) :: normal, tangential
    integer(int64) :: word(n_word)

    word = self%pair%key_words(normal, tangential)
    word(1) = transfer('scaled  ', word(1))
    if (self%excess > 0.0_wp) word(4:5) = transfer([self%excess, self%length], word, 2)
  end function key_words

  pure real(wp) function coupling(self)
    class(scaled_medium_t), intent(in) :: self
    coupling = self%pair%coupling()
  end function coupling

  pure real(wp) function shear_ratio(self)
    class(scaled_medium_t), intent(in) :: self
    shear_ratio = self%pair%shear_ratio()
  end function shear_ratio

  pure real(wp) function normal_point(self, length)
    class(scaled_medium_t), intent(in) :: self
    real(wp), intent(in) :: length
    normal_point = factor_at(self, length, 0.0_wp)*self%pair%normal_point(length)
  end function normal_point

  pure real(wp) function shear_point(self, length)
    class(scaled_medium_t), intent(in) :: self
    real(wp), intent(in) :: length
    shear_point = factor_at(self, length, 0.0_wp)*self%pair%shear_point(length)
  end function shear_point

  !> A sphere of R = 1 on 2 n + 1 nodes a side.
  subroutine sphere(lattice, gap, error)
    type(lattice_t), intent(out) :: lattice
    real(wp), allocatable, intent(out) :: gap(:, :)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: x(2*n + 1, 2*n + 1), y(2*n + 1, 2*n + 1)

    call new_lattice(lattice, equilateral_basis(1.3_wp/n), [-n, -n], [2*n + 1, 2*n + 1], error)
    if (allocated(error)) return
    call lattice%coordinates(x, y)
    gap = 0.5_wp*(x**2 + y**2)
  end subroutine sphere

  !> Half-spaces of E* = 1: contact radius 1 under the load.
  pure type(elastic_pair_t) function half_spaces(beta)
    real(wp), intent(in) :: beta

    half_spaces = elastic_pair_t(1.0_wp/pi, beta/pi, 0.4_wp/pi)
  end function half_spaces

  !> With displacements scaled by f and loads by 1/f the contact and its gap are the same.
  subroutine test_frictionless(error)
    type(error_t), allocatable, intent(out) :: error
    type(normal_contact_t) :: contact(2)
    type(direct_contact_t) :: direct
    type(contact_state_t) :: state(3)
    type(lattice_t) :: lattice
    real(wp), allocatable :: gap(:, :)

    call sphere(lattice, gap, error)
    if (allocated(error)) return
    call new_normal_contact(contact(1), lattice, half_spaces(0.0_wp), gap, gap < 9.0_wp, error)
    if (allocated(error)) return
    call new_normal_contact(contact(2), lattice, scaled_medium_t(half_spaces(0.0_wp), factor), gap, gap < 9.0_wp, error)
    if (allocated(error)) return
    call new_direct_contact(direct, lattice, scaled_medium_t(half_spaces(0.0_wp), factor), gap, gap < 9.0_wp, error)
    if (allocated(error)) return
    call contact(1)%solve(f, load, tight, 80, state(1), error)
    if (allocated(error)) return
    call contact(2)%solve(f, load/factor, tight, 80, state(2), error)
    if (allocated(error)) return
    call direct%solve(f, load/factor, tight, 80, state(3), error)
    if (allocated(error)) return
    call check_scaled_state(state(1), state(2), error)
    if (allocated(error)) return
    call check_scaled_state(state(1), state(3), error)
    if (allocated(error)) return
    call check(error, state(2)%operator_applications, state(1)%operator_applications, 1.0e-12_wp, 'work')
  end subroutine test_frictionless

  !> Check tractions over 1/f, gap, displacement and approach.
  subroutine check_scaled_state(one, other, error)
    !> On half-spaces, and on the medium
    type(contact_state_t), intent(in) :: one, other
    type(error_t), allocatable, intent(out) :: error

    call check_true(error, one%converged .and. other%converged, 'both converge')
    if (allocated(error)) return
    call check(error, largest(factor*other%pressure - one%pressure), 0.0_wp, 1.0e-8_wp, 'pressure')
    if (allocated(error)) return
    call check(error, largest(other%gap - one%gap), 0.0_wp, 1.0e-8_wp, 'gap')
    if (allocated(error)) return
    call check(error, other%motion(:4), one%motion(:4), 1.0e-8_wp, 'motion')
    if (allocated(error) .or. .not. allocated(one%traction)) return
    call check(error, largest(factor*other%traction - one%traction), 0.0_wp, 1.0e-7_wp, 'shear traction')
    if (allocated(error)) return
    call check(error, largest(other%relative_displacement - one%relative_displacement), 0.0_wp, 1.0e-7_wp, 'displacement')
  end subroutine check_scaled_state

  !> Set up the sphere with friction.
  subroutine new_problem(problem, medium, error)
    type(friction_problem_t), intent(out) :: problem
    class(elastic_medium_t), intent(in) :: medium
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    real(wp), allocatable :: gap(:, :)

    call sphere(lattice, gap, error)
    if (allocated(error)) return
    call new_friction_problem(problem, lattice, medium, gap, gap < 9.0_wp, coulomb_t(0.4_wp), .false., error)
  end subroutine new_problem

  !> Press, shear, and turn back by half of the shift.
  subroutine press_and_shear(solver, scale, state, error)
    class(friction_solver_t), intent(inout) :: solver
    !> Factor of the loads
    real(wp), intent(in) :: scale
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error
    type(contact_state_t) :: next
    integer :: control(4, 3), i
    real(wp) :: value(4, 3)

    control = reshape([f, f, f, d, f, f, f, f, d, d, d, d], [4, 3])
    value(:, 1) = scale*load*[1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
    value(:, 2) = scale*load*[1.0_wp, 0.25_wp, -0.1_wp, 0.02_wp]
    call new_friction_state(state, solver%problem%lattice)
    do i = 1, size(control, 2)
      if (i == 3) value(:, 3) = state%motion(:4)*[1.01_wp, 0.5_wp, 0.5_wp, 0.5_wp]
      call solver%solve_step(state, state%relative_displacement, load_target_t(control(:, i), value(:, i)), tight, 60, next, error)
      if (allocated(error)) return
      state = next
      call check_true(error, state%converged, 'the step converges')
      if (allocated(error)) return
    end do
  end subroutine press_and_shear

  !> Solve the history by the convolution or by the matrix.
  subroutine solve(medium, by_matrix, scale, state, error, cache)
    class(elastic_medium_t), intent(in) :: medium
    logical, intent(in) :: by_matrix
    real(wp), intent(in) :: scale
    type(contact_state_t), intent(out) :: state
    type(error_t), allocatable, intent(out) :: error
    type(kernel_cache_t), pointer, intent(in), optional :: cache
    type(friction_problem_t) :: problem
    type(frictional_contact_t) :: contact
    type(direct_friction_t) :: direct

    call new_problem(problem, medium, error)
    if (allocated(error)) return
    if (by_matrix) then
      call new_direct_friction(direct, problem, error)
      if (allocated(error)) return
      call press_and_shear(direct, scale, state, error)
    else
      call new_frictional_contact(contact, problem, error, cache=cache)
      if (allocated(error)) return
      call press_and_shear(contact, scale, state, error)
    end if
  end subroutine solve

  !> With friction, like and unlike materials; the scaled medium has one spectrum more.
  subroutine test_friction(error)
    type(error_t), allocatable, intent(out) :: error
    call compare_histories(.false., error)
  end subroutine test_friction

  subroutine test_direct(error)
    type(error_t), allocatable, intent(out) :: error
    call compare_histories(.true., error)
  end subroutine test_direct

  subroutine compare_histories(by_matrix, error)
    logical, intent(in) :: by_matrix
    type(error_t), allocatable, intent(out) :: error
    real(wp), parameter :: beta(2) = [0.0_wp, 0.2_wp]
    type(contact_state_t) :: one, other
    integer :: i

    do i = 1, size(beta)
      call solve(half_spaces(beta(i)), by_matrix, 1.0_wp, one, error)
      if (allocated(error)) return
      call solve(scaled_medium_t(half_spaces(beta(i)), factor), by_matrix, 1.0_wp/factor, other, error)
      if (allocated(error)) return
      call check_scaled_state(one, other, error)
      if (allocated(error)) return
    end do
  end subroutine compare_histories

  !> A medium with a length of its own: convolution and matrix have one solution, which differs from that of the half-spaces.
  subroutine test_own_length(error)
    type(error_t), allocatable, intent(out) :: error
    type(scaled_medium_t) :: medium
    type(normal_contact_t) :: contact
    type(direct_contact_t) :: direct
    type(contact_state_t) :: one, other, plain
    type(lattice_t) :: lattice
    real(wp), allocatable :: gap(:, :)

    medium = scaled_medium_t(half_spaces(0.0_wp), 1.0_wp, 0.5_wp, 0.4_wp)
    call sphere(lattice, gap, error)
    if (allocated(error)) return
    call new_normal_contact(contact, lattice, medium, gap, gap < 9.0_wp, error)
    if (allocated(error)) return
    call new_direct_contact(direct, lattice, medium, gap, gap < 9.0_wp, error)
    if (allocated(error)) return
    call contact%solve(f, load, tight, 80, one, error)
    if (allocated(error)) return
    call direct%solve(f, load, tight, 80, other, error)
    if (allocated(error)) return
    call check_true(error, one%converged .and. other%converged, 'both converge without friction')
    if (allocated(error)) return
    call check(error, largest(one%pressure - other%pressure), 0.0_wp, 1.0e-8_wp, 'pressure without friction')
    if (allocated(error)) return
    medium%pair = half_spaces(0.2_wp)
    call solve(medium, .false., 1.0_wp, one, error)
    if (allocated(error)) return
    call solve(medium, .true., 1.0_wp, other, error)
    if (allocated(error)) return
    call solve(medium%pair, .true., 1.0_wp, plain, error)
    if (allocated(error)) return
    call check(error, largest(one%pressure - other%pressure), 0.0_wp, 1.0e-7_wp, 'pressure')
    if (allocated(error)) return
    call check(error, largest(one%traction - other%traction), 0.0_wp, 1.0e-7_wp, 'shear traction')
    if (allocated(error)) return
    call check_true(error, largest(one%pressure - plain%pressure) > 0.01_wp, 'the length matters')
  end subroutine test_own_length

  !> A table of the kernel serves another lattice only if the bodies have no length of their own.
  subroutine test_table(error)
    type(error_t), allocatable, intent(out) :: error
    type(scaled_medium_t) :: long
    type(lattice_t) :: coarse, fine
    type(normal_kernel_t) :: kernel, fresh
    real(wp), dimension(1, 17) :: row, expected

    call new_lattice(fine, equilateral_basis(0.1_wp), [0, 0], [9, 9], error)
    if (allocated(error)) return
    call new_lattice(coarse, equilateral_basis(0.2_wp), [0, 0], [9, 9], error)
    if (allocated(error)) return
    long = scaled_medium_t(half_spaces(0.2_wp), 1.0_wp, 0.5_wp, 0.4_wp)
    call kernel%cover(fine, long, field_space_t(1))
    call kernel%cover(coarse, long, field_space_t(1))
    call fresh%cover(coarse, long, field_space_t(1))
    call kernel%row(2, row)
    call fresh%row(2, expected)
    call check(error, largest(row - expected), 0.0_wp, 0.0_wp, 'the table is made anew')
  end subroutine test_table

  !> Spectra of two media are the same only if their reduced bodies are.
  subroutine test_keys(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: kind(3) = [of_pressure, of_all_tractions, inverse_of_shear]
    type(scaled_medium_t) :: long
    type(lattice_t) :: coarse, fine
    character(len=64) :: plain
    integer :: i

    call new_lattice(fine, equilateral_basis(0.1_wp), [0, 0], [9, 9], error)
    if (allocated(error)) return
    call new_lattice(coarse, equilateral_basis(0.2_wp), [0, 0], [9, 9], error)
    if (allocated(error)) return
    long = scaled_medium_t(half_spaces(0.2_wp), 1.0_wp, 0.5_wp, 0.4_wp)
    do i = 1, size(kind)
      plain = name_of(fine, scaled_medium_t(half_spaces(0.2_wp)))
      call check_true(error, plain == name_of(coarse, scaled_medium_t(half_spaces(0.2_wp), factor)), 'scale and spacing')
      if (allocated(error)) return
      call check_true(error, plain /= name_of(fine, half_spaces(0.2_wp)), 'name of the medium')
      if (allocated(error)) return
      call check_true(error, plain /= name_of(fine, long), 'length')
      if (allocated(error)) return
      call check_true(error, name_of(coarse, long) /= name_of(fine, long), 'length over the spacing')
      if (allocated(error)) return
    end do

  contains

    function name_of(lattice, medium) result(name)
      type(lattice_t), intent(in) :: lattice
      class(elastic_medium_t), intent(in) :: medium
      character(len=64) :: name

      name = file_name(new_kernel_key(kind(i), lattice, medium), 'test')
    end function name_of

  end subroutine test_keys

  !> Spectra from files, of half-spaces and of the medium in one folder, leave the solution as it is to the bit.
  subroutine test_files(error)
    type(error_t), allocatable, intent(out) :: error
    character(len=*), parameter :: folder = 'kernels_of_test_medium/'
    type(kernel_cache_t), pointer :: cache
    type(scaled_medium_t) :: medium
    type(contact_state_t) :: plain, state
    integer :: turn

    medium = scaled_medium_t(half_spaces(0.2_wp), 1.0_wp, 0.5_wp, 0.4_wp)
    call solve(medium, .false., 1.0_wp, plain, error)
    if (allocated(error)) return
    call execute_command_line('mkdir -p '//folder)
    do turn = 1, 2
      allocate (cache)
      call cache%limit(10000000_int64)
      call cache%use_folder(folder, 'test_medium', 'test', 10000000_int64, .false.)
      call solve(medium%pair, .false., 1.0_wp, state, error, cache)
      if (allocated(error)) exit
      call solve(medium, .false., 1.0_wp, state, error, cache)
      if (allocated(error)) exit
      call check(error, largest(state%pressure - plain%pressure) + largest(state%traction - plain%traction), 0.0_wp, 0.0_wp, &
                 'tractions')
      if (allocated(error)) exit
      if (turn == 2) call check_true(error, cache%read > 0 .and. cache%missed == 0, 'all spectra are those of files')
      if (allocated(error)) exit
      deallocate (cache)
    end do
    call execute_command_line('rm -r '//folder)
  end subroutine test_files

  !> Elastic constants of no body are refused.
  subroutine test_refused(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: raised
    type(normal_contact_t) :: contact
    type(lattice_t) :: lattice
    real(wp), allocatable :: gap(:, :)

    call sphere(lattice, gap, error)
    if (allocated(error)) return
    call new_normal_contact(contact, lattice, scaled_medium_t(elastic_pair_t()), gap, gap < 9.0_wp, raised)
    call check_raised(error, raised, 1, 'elastic constants')
  end subroutine test_refused

end module test_medium
