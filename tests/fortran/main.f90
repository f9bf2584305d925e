!> Runs the unit tests: `tester [suite [test]]`.
!>
!> A new suite is a file test_<name>.f90 with a module of that name and its
!> collect_<name>, a `use` and an entry here, and its name in meson.build.
program tester
  use testing, only: suite_t, new_suite, run_suites
  use test_testing, only: collect_testing
  use test_precision, only: collect_precision
  use test_triangle_integrals, only: collect_triangle_integrals
  use test_pyramid_influence, only: collect_pyramid_influence
  use test_interior, only: collect_interior
  use test_lattice, only: collect_lattice
  use test_flexibility, only: collect_flexibility
  use test_medium, only: collect_medium
  use test_layers, only: collect_layers
  use test_spectrum_file, only: collect_spectrum_file
  use test_vectors, only: collect_vectors
  use test_arguments, only: collect_arguments
  use test_linear_solvers, only: collect_linear_solvers
  use test_contact, only: collect_contact
  use test_normal_contact, only: collect_normal_contact
  use test_friction, only: collect_friction
  use test_fas_predictor, only: collect_fas_predictor
  use test_preconditioner, only: collect_preconditioner
  use test_friction_sweeps, only: collect_friction_sweeps
  use test_laws, only: collect_laws
  use test_nodal_friction, only: collect_nodal_friction
  use test_interface, only: collect_interface
  use test_load_path, only: collect_load_path
  use test_direct_friction, only: collect_direct_friction
  use test_edges, only: collect_edges
  use test_steps, only: collect_steps
  use test_periodic, only: collect_periodic
  use test_rolling, only: collect_rolling
  use test_analytic, only: collect_analytic
  use test_fatigue, only: collect_fatigue
  implicit none

  type(suite_t), allocatable :: suites(:)
  integer :: n_failed

  suites = [ &
    new_suite('testing', collect_testing), &
    new_suite('precision', collect_precision), &
    new_suite('triangle_integrals', collect_triangle_integrals), &
    new_suite('pyramid_influence', collect_pyramid_influence), &
    new_suite('interior', collect_interior), &
    new_suite('lattice', collect_lattice), &
    new_suite('flexibility', collect_flexibility), &
    new_suite('medium', collect_medium), &
    new_suite('layers', collect_layers), &
    new_suite('spectrum_file', collect_spectrum_file), &
    new_suite('vectors', collect_vectors), &
    new_suite('arguments', collect_arguments), &
    new_suite('linear_solvers', collect_linear_solvers), &
    new_suite('contact', collect_contact), &
    new_suite('normal_contact', collect_normal_contact), &
    new_suite('friction', collect_friction), &
    new_suite('fas_predictor', collect_fas_predictor), &
    new_suite('preconditioner', collect_preconditioner), &
    new_suite('friction_sweeps', collect_friction_sweeps), &
    new_suite('laws', collect_laws), &
    new_suite('nodal_friction', collect_nodal_friction), &
    new_suite('interface', collect_interface), &
    new_suite('load_path', collect_load_path), &
    new_suite('direct_friction', collect_direct_friction), &
    new_suite('edges', collect_edges), &
    new_suite('steps', collect_steps), &
    new_suite('periodic', collect_periodic), &
    new_suite('rolling', collect_rolling), &
    new_suite('analytic', collect_analytic), &
    new_suite('fatigue', collect_fatigue) &
  ]
  call run_suites(suites, n_failed)
  if (n_failed > 0) stop 1, quiet=.true.
  stop 0, quiet=.true.
end program tester
