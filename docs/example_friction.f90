program press_and_shear
  use hexcontact, only: wp, error_t, material_t, elastic_pair_t, new_elastic_pair, lattice_t, new_lattice, &
    equilateral_basis, coulomb_t, friction_problem_t, new_friction_problem, frictional_contact_t, &
    new_frictional_contact, contact_state_t, new_friction_state, load_target_t, advance, stick, normal, along_x
  implicit none
  type(elastic_pair_t) :: pair
  type(lattice_t) :: lattice
  type(friction_problem_t) :: problem
  type(frictional_contact_t) :: contact
  type(contact_state_t) :: state, next
  type(load_target_t) :: target
  type(error_t), allocatable :: error
  real(wp) :: x(61, 61), y(61, 61)
  integer :: step

  call new_elastic_pair(pair, material_t(210.0e9_wp, 0.3_wp), material_t(70.0e9_wp, 0.33_wp), error)  ! steel, aluminum
  if (.not. allocated(error)) call new_lattice(lattice, equilateral_basis(7.0e-6_wp), [-30, -30], shape(x), error)
  call lattice%coordinates(x, y)
  if (.not. allocated(error)) then
    call new_friction_problem(problem, lattice, pair, (x**2 + y**2)/(2*0.01_wp), x < 1, coulomb_t(0.3_wp), .false., error)
  end if
  if (.not. allocated(error)) call new_frictional_contact(contact, problem, error)
  call new_friction_state(state, lattice)
  do step = 1, 10
    target%value(normal) = 3.0_wp*min(step, 5)        ! five steps up to 15 N,
    target%value(along_x) = 0.6_wp*max(step - 5, 0)   ! then five up to 3 N along x
    if (.not. allocated(error)) call advance(contact, state, target, .false., 1.0e-8_wp, 40, 6, next, error)
    if (allocated(error)) error stop error%message
    if (.not. next%converged) error stop 'no convergence'
    state = next
  end do
  print '(a, f6.2, a)', 'stick  ', 100.0_wp*count(state%zone == stick)/count(state%zone > 0), ' % of the contact area'
  print '(a, f6.4, a)', 'shift  ', state%motion(along_x)/1.0e-6_wp, ' um'
  print '(a, f6.2, a)', 'energy ', state%dissipated_energy/1.0e-9_wp, ' nJ taken by friction'
end program press_and_shear
