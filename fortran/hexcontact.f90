!> Public names of the library.
!>
!> A contact problem in four calls:
!>
!>     call new_lattice(lattice, equilateral_basis(1.0e-5_wp), first=[-60, -60], extent=[121, 121], error=error)
!>     call new_elastic_pair(pair, material_t(210e9_wp, 0.3_wp), material_t(rigid=.true.), error)
!>     call new_normal_contact(contact, lattice, pair, initial_gap, candidate, error)
!>     call contact%solve(force_control, 100.0_wp, 1e-8_wp, 60, state, error)
module hexcontact
  use hc_precision, only: wp, pi
  use hc_error, only: error_t, status
  use hc_options, only: options_t
  use hc_lattice, only: lattice_t, new_lattice, equilateral_basis, oblique_basis
  use hc_field_space, only: field_space_t, space_over
  use hc_triangle_integrals, only: triangle_integral, triangle_integrals, is_supported, vertex_kernels, &
                                   load_displacement, linear_load_displacement, &
                                   evaluate_integral, evaluate_displacement, evaluate_linear_displacement
  use hc_pyramid_influence, only: pyramid_t, new_pyramid, k_1, k_xx, k_xy, k_x, k_y
  use hc_interior_pyramid, only: interior_pyramid_t, new_interior_pyramid
  use hc_interior_triangle, only: triangle_fields, mesh_fields
  use hc_interior_points, only: fields_at_points
  use hc_interior_planes, only: interior_planes_t, new_interior_planes, planes_memory
  use hc_stress_invariants, only: stress_invariants, von_mises, principal_stresses
  use hc_elastic_medium, only: elastic_medium_t, influence_t, block_symbols_t
  use hc_elastic_pair, only: material_t, elastic_pair_t, new_elastic_pair
  use hc_layered_pair, only: coating_t, layered_pair_t, new_layered_pair
  use hc_flexibility, only: flexibility_t, normal, along_x, along_y
  use hc_flexibility_dense, only: dense_flexibility_t, new_dense_flexibility, dense_memory
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_flexibility_fft, only: fft_flexibility_t, new_fft_flexibility, fft_memory, fft_setup_memory, spectra_of
  use hc_contact_state, only: contact_state_t, new_friction_state, separated, stick, slip, &
                              load_target_t, force_control, displacement_control, about_z, n_motion, touches_rim, &
                              not_solved, within_tolerance, sweeps_used_up, no_progress, loads_not_carried, rim_reached, &
                              out_of_range
  use hc_friction_law, only: friction_law_t
  use hc_normal_law, only: normal_law_t, unilateral_t
  use hc_power_interface, only: power_interface_t
  use hc_coulomb, only: coulomb_t
  use hc_nodal_coulomb, only: nodal_coulomb_t
  use hc_orthotropic_coulomb, only: orthotropic_coulomb_t
  use hc_contact_residuals, only: normal_residual, tangential_residual, force_residual
  use hc_contact_problem, only: friction_problem_t, new_friction_problem
  use hc_contact_solver, only: contact_solver_t, friction_solver_t
  use hc_normal_contact, only: normal_contact_t, new_normal_contact, normal_contact_memory
  use hc_direct_contact, only: direct_contact_t, new_direct_contact
  use hc_frictional_contact, only: frictional_contact_t, new_frictional_contact, frictional_contact_memory, friction_step_memory
  use hc_subwindow_solver, only: windowed_friction_t, new_windowed_friction, windowed_friction_memory
  use hc_direct_friction, only: direct_friction_t, new_direct_friction
  use hc_rolling, only: rolling_t, row_along
  use hc_load_path, only: advance, step_settings_t
  use hc_creep_loads, only: creep_loads_t, find_creep_loads
  use hc_window_growth, only: grown_window, extend_state
  use hc_contact_search, only: contact_search_t, find_rough_pressure
  use hc_adaptive_path, only: adaptive_path_t, adaptive_steps_t, two_paths_t
  use hc_step_control, only: step_control_t, step_attempt_t, rejected, accepted, limited, failed, outgrown, &
                             pending
  use hc_wear_path, only: wear_path_t, wear_cycle_t, cycle_step_t
  use hc_step_error, only: step_change_t, compare_halves
  use hc_discretization_error, only: limits_of_error, is_slip_zone_unresolved
  use hc_expected_error, only: lattice_errors_t, lattice_errors, lattice_spacings, slip_ring, even_steps, entry_error, &
                               entry_steps, oblique_error, oblique_steps
  use hc_zone_estimators, only: boundary, boundary_circle, circle_fit_t, area_radius, edge_radius, pressure_center, &
                                moment_ellipse, edge_ellipse, ellipse_t
  use hc_contact_edges, only: contact_edges_t, new_contact_edges
  use hc_zone_edge, only: edged_zone_t, zone_edge_t, zone_mesh_t
  use hc_traction_field, only: traction_field_t, new_traction_field
  use hc_edge_tractions, only: correct_at_edges
  use hc_load_cycles, only: find_cycles, loop_area
  use hc_state_measures, only: nodal_normal_residual, nodal_tangential_residual, elastic_energy, zone_extent, &
                               measure_state, state_measures_t, zone_measures_t
  use hc_zone_outline, only: zone_outline
  use hc_section_line, only: section_line_t, section_through, line_crossings
  use hc_interpolation, only: interpolate, interpolate_pressure, nearest_node
  use hc_elliptic_contact, only: elliptic_contact_t, hertz_ellipse, crossed_cylinders_hessian
  use hc_partial_slip, only: mindlin_t, plane_cattaneo_t, turning_points
  use hc_torsion, only: lubkin_t
  use hc_self_similar, only: no_slip_constants, goodman_stick_ratio, goodman_stick_ratio_plane
  use hc_axisymmetric, only: axisymmetric_t, power_law_t, rounded_punch_t, flat_punch_t
  use hc_invariant_criteria, only: crossland, dang_van, deviator_amplitude
  use hc_plane_criteria, only: plane_criterion_t, smith_watson_topper_t, findley_t, fatemi_socie_t
  use hc_critical_plane, only: find_critical_plane
  use hc_fatigue_fields, only: find_critical_planes, find_invariants, find_ruiz_parameters
  use hc_strain_life, only: strain_life_t, new_strain_life
  implicit none
  public
end module hexcontact
