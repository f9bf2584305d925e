program press_and_shear
  use hexcontact, only: wp, pi, error_t, material_t, elastic_pair_t, new_elastic_pair, lattice_t, new_lattice, &
    equilateral_basis, coulomb_t, friction_problem_t, new_friction_problem, frictional_contact_t, &
    new_frictional_contact, contact_state_t, new_friction_state, load_target_t, adaptive_path_t, step_settings_t, &
    contact_edges_t, new_contact_edges, zone_edge_t, stick, normal, along_x, wear_path_t, cycle_step_t, pending, failed
  implicit none
  type(elastic_pair_t) :: pair
  type(lattice_t) :: lattice
  type(friction_problem_t) :: problem
  type(frictional_contact_t) :: contact
  type(contact_state_t) :: state
  type(load_target_t) :: target
  type(adaptive_path_t) :: path
  type(wear_path_t) :: wear
  type(cycle_step_t) :: cycle_steps(3)
  type(contact_edges_t) :: edges
  type(zone_edge_t) :: contact_area, stick_area
  type(error_t), allocatable :: error
  real(wp) :: x(61, 61), y(61, 61)
  integer :: segment, steps

  call new_elastic_pair(pair, material_t(210.0e9_wp, 0.3_wp), material_t(70.0e9_wp, 0.33_wp), error)  ! steel, aluminum
  if (.not. allocated(error)) call new_lattice(lattice, equilateral_basis(7.0e-6_wp), [-30, -30], shape(x), error)
  call lattice%coordinates(x, y)
  if (.not. allocated(error)) then
    call new_friction_problem(problem, lattice, pair, (x**2 + y**2)/(2*0.01_wp), x < 1, coulomb_t(0.3_wp), .false., error)
  end if
  if (.not. allocated(error)) call new_frictional_contact(contact, problem, error)
  if (allocated(error)) error stop error%message
  call new_friction_state(state, lattice)
  call path%initialize(state, pi*(0.13e-3_wp)**2)       ! the contact will be about that large
  path%tolerance = 0.05_wp                              ! largest change by halving a load step
  do segment = 1, 2
    target%value(normal) = 15.0_wp                      ! first up to 15 N,
    if (segment == 2) target%value(along_x) = 3.0_wp    ! then up to 3 N along x
    steps = 0
    do
      call path%advance(contact, target, step_settings_t(tolerance=1.0e-8_wp), error)
      if (allocated(error)) error stop error%message
      if (.not. path%state%converged) error stop 'no convergence'
      steps = steps + 1
      if (path%fraction >= 1) exit                      ! the end of the segment
    end do
    state = path%state
    call new_contact_edges(edges, lattice, state%pressure, state%gap, state%zone > 0, x < 1)
    contact_area = edges%contact_edge()
    stick_area = edges%stick_edge(state%zone == stick, 0.3_wp*state%pressure - norm2(state%traction, dim=3))
    print '(i0, a, 2(f5.1, a))', steps, ' steps: stick ', 100*stick_area%area/contact_area%area, &
      ' % of the contact area, within', 100*path%stick_area_error/contact_area%area, ' %'
  end do
  print '(a, f6.4, a)', 'shift  ', state%motion(along_x)/1.0e-6_wp, ' um'
  print '(a, f6.2, a)', 'energy ', state%dissipated_energy/1.0e-9_wp, ' nJ dissipated'

  cycle_steps%target = load_target_t(value=[15.0_wp, 3.0_wp])
  cycle_steps(2)%target%value(along_x) = -3.0_wp        ! a cycle: to -3 N and back
  wear%coefficient = 1.0e-15_wp                         ! depth over pressure and slip [m^2/N]
  wear%cycles = 300000
  wear%tolerance = 0.1_wp                               ! of the jumps between the cycles that are solved
  call wear%initialize(state, cycle_steps)
  steps = 0
  do
    call wear%advance(contact, error)                   ! a load step of a cycle
    if (allocated(error)) error stop error%message
    if (wear%verdict == failed) error stop 'no convergence'
    if (wear%verdict == pending) cycle
    steps = steps + 1
    if (wear%cycle%cycles >= wear%cycles) exit
  end do
  print '(i0, a, f5.1, a)', wear%unworn + steps - 1, ' cycles solved: the deepest node is worn by', &
    wear%deepest/1.0e-9_wp, ' nm'
end program press_and_shear
