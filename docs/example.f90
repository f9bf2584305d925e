program press_a_sphere
  use hexcontact, only: wp, error_t, material_t, elastic_pair_t, new_elastic_pair, lattice_t, new_lattice, &
    equilateral_basis, normal_contact_t, new_normal_contact, contact_state_t, normal, force_control
  implicit none
  type(elastic_pair_t) :: pair
  type(lattice_t) :: lattice
  type(normal_contact_t) :: contact
  type(contact_state_t) :: state
  type(error_t), allocatable :: error
  real(wp) :: x(61, 61), y(61, 61)

  call new_elastic_pair(pair, material_t(210.0e9_wp, 0.3_wp), material_t(rigid=.true.), error)  ! steel on rigid
  if (.not. allocated(error)) call new_lattice(lattice, equilateral_basis(6.0e-6_wp), [-30, -30], shape(x), error)
  call lattice%coordinates(x, y)
  if (.not. allocated(error)) call new_normal_contact(contact, lattice, pair, (x**2 + y**2)/(2*0.01_wp), x < 1, error)
  if (.not. allocated(error)) call contact%solve(force_control, 50.0_wp, 1.0e-8_wp, 50, state, error)
  if (allocated(error)) error stop error%message
  print '(a, f8.2, a)', 'largest pressure ', maxval(state%pressure)/1.0e6_wp, ' MPa'  ! sphere of 10 mm under 50 N
  print '(a, f8.5, a)', 'approach         ', state%motion(normal)/1.0e-6_wp, ' um'
end program press_a_sphere
