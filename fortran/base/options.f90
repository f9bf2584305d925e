!> Tolerances, caps and tuning numbers of the solvers, each with its reason.
!>
!> Problems and solvers hold a copy; whoever changes one before solving changes the work, seldom the result. None of them is
!> part of what is solved: a state counts as converged by the tolerance that the caller gives, whatever stands here. Numbers
!> that only guard against overflow, and those that define a residual, stand beside their formulas.
module hc_options
  use hc_precision, only: wp
  implicit none
  private

  public :: options_t, contact_options_t, normal_options_t, newton_options_t, multilevel_options_t, &
            direct_options_t, entry_options_t

  !> What all methods share (docs/theory/friction.md, "The classification parameter", "Globalisation", "Gross sliding").
  type :: contact_options_t
    !> Scale kappa of the classification parameters, (F8): r times the operator has to be of order one, so that (F5) is a
    !> step of a contracting projection
    real(wp) :: classification_scale = 10.0_wp
    !> |beta| min(mu, 1) from which pressure and shear traction are better found together: staggered sweeps would keep
    !> exchanging nodes at the edge
    real(wp) :: strong_coupling = 0.03_wp
    !> Share of the slipping nodes that are held in stick where nothing else resists a load: enough of them to carry it, and
    !> those that slip least, which are the likeliest to stick
    real(wp) :: held_share = 0.25_wp
    !> Share of a load that rounding errors may add before it counts as more than full sliding carries
    real(wp) :: load_rounding = 1.0e-6_wp
    !> Residual R_n above which a pressure says nothing about the load that it can carry
    real(wp) :: trusted_residual = 0.1_wp
    !> Motions that are tried for the least load factor of (F12), and the relative gain below which no more are
    integer :: max_limit_motions = 100
    real(wp) :: least_limit_gain = 1.0e-9_wp
  end type contact_options_t

  !> Frictionless contact on FFTs (docs/theory/normal_contact.md, "FFT method").
  type :: normal_options_t
    !> Length of a projected step, (N3): M is a little more than the inverse of the operator
    real(wp) :: step_length = 0.85_wp
    !> Factor by which projected steps have to bring the residual down every other time, or sets are held: on rough
    !> surfaces they would change on and on
    real(wp) :: progress = 0.5_wp
    !> Steps that are not judged by it: the first ones cut off most of a wrong start
    integer :: first_steps = 3
    !> A set that is held is given up when its residual has come down by this factor: then the next one can be trusted
    real(wp) :: held_accuracy = 0.1_wp
    !> Share of a residual, and of the tolerance, that errors of single precision may make up
    real(wp) :: residual_share = 0.01_wp, tolerance_share = 0.1_wp
    !> Times that the pressure of a solution is fitted to the load: a tolerance below rounding errors is not reached by more
    integer :: max_fits = 3
    !> Tolerance on coarser lattices, which only have to give a start
    real(wp) :: coarse_tolerance = 3.0e-2_wp
    !> Tolerance on a part of the window: the product over the window sees what single precision left
    real(wp) :: part_tolerance = 0.8_wp
    !> Lattices with fewer nodes are left to one thread: waking the others for each of the short passes takes longer
    integer :: worth_sharing = 150000
  end type normal_options_t

  !> Newton's method on FFTs (docs/theory/friction.md, "Staggered sweep", "Coupled sweep", "Globalisation").
  type :: newton_options_t
    !> Accuracy of a linear solution, relative to the residual at its start: sets that will change deserve no more
    real(wp) :: inner_accuracy = 0.1_wp
    !> The same once residuals are small; where shear does not act on the pressure, Newton's method converges the faster for
    !> it; and of the pressure, whose iterations are the cheaper ones
    real(wp) :: late_accuracy = 0.03_wp, uncoupled_accuracy = 1.0e-3_wp, pressure_accuracy = 0.05_wp
    !> Accuracy of the last linear solution, relative to the tolerance
    real(wp) :: final_accuracy = 0.2_wp
    !> Iterations of a linear solver, and directions that GMRES stores: far more than the preconditioner needs
    integer :: max_iterations = 400, max_directions = 40
    !> Contact areas per staggered sweep: one where the shear traction moves the pressure, else until the area stands
    integer :: max_areas = 1, max_areas_uncoupled = 60
    !> What rounding errors may leave in displacements that are carried along, relative to the largest; where more may be
    !> left, they are computed afresh
    real(wp) :: displacement_rounding = 1.0e-10_wp
    !> Component of the traction across the direction of slip, relative to the largest that friction allows, that is no step
    !> towards a solution: nodes are held instead
    real(wp) :: most_across = 5.0_wp
    !> Factor of the classification parameter at the first shear traction, where nodes are held, and under strong coupling:
    !> there the tractions say little about the zones yet
    real(wp) :: cautious_share = 0.2_wp
    !> Sweeps after which the classification parameter is halved and a whole step taken again; how small its factor gets
    integer :: sweeps_per_cut = 10
    real(wp) :: least_share_of_r = 1.0e-3_wp
    !> Sweeps that are never damped: active sets need some to settle
    integer :: undamped_sweeps = 6
    !> A residual R_t that does not fall below this share of the best one goes in circles, unless it is settled
    real(wp) :: stalled_share = 0.7_wp, settled_residual = 1.0e-2_wp
    !> The share of a damped step, its factor from one to the next, and the least
    real(wp) :: first_damping = 0.5_wp, damping_factor = 0.9_wp, least_damping = 0.1_wp
    !> Sweeps with held nodes after which the loads are given up
    integer :: max_held_sweeps = 12
    !> Staggered sweeps before coupled ones: with weak coupling, and with strong coupling
    integer :: staggered_sweeps = 12, staggered_sweeps_strong = 1
    !> Coupled sweeps begin when residuals are below this, or so many sweeps later all the same: (F7) linearises far from
    !> the solution worse than two blocks do
    real(wp) :: coupled_residual = 0.6_wp
    integer :: coupled_delay = 4
  end type newton_options_t

  !> Coarser lattices and parts of the window (docs/theory/multilevel.md).
  type :: multilevel_options_t
    !> Windows with fewer nodes a side are not coarsened any further
    integer :: smallest_side = 20
    !> Tolerance on coarser lattices of a first step: they only give a start
    real(wp) :: nested_tolerance = 1.0e-3_wp
    !> The same of a later step, whose start is the change that they find, and sweeps there
    real(wp) :: change_tolerance = 1.0e-2_wp
    integer :: change_sweeps = 20
    !> Nodes that a coarse contact has at least: fewer say nothing about zones
    integer :: least_contact = 100
    !> Tolerance on a part of the window: the product over the window sees other rounding errors
    real(wp) :: part_tolerance = 0.9_wp
    !> Parts of the window that are tried: each sees where the bodies overlap outside of the last
    integer :: max_parts = 3
  end type multilevel_options_t

  !> Explicit matrices (docs/theory/friction.md, "Direct method").
  type :: direct_options_t
    !> Exchanges of whole sets that may fail to lower the number of wrong nodes, before Murty's rule exchanges one by one
    integer :: stalled_exchanges = 10
    !> Contact areas that are tried before there is any shear traction
    integer :: first_areas = 30
    !> Tension and penetration, relative to the largest pressure, that are rounding errors
    real(wp) :: pressure_rounding = 1.0e-12_wp
    !> Slip that gives a node without traction no direction yet, relative to that of the largest pressure
    real(wp) :: negligible_slip = 1.0e-6_wp
    !> Factor of the classification parameter at the beginning of a step and where nodes are held, and the sweeps after which
    !> it is halved, again and again
    real(wp) :: cautious_share = 0.2_wp
    integer :: sweeps_per_cut = 10
    !> Times that nothing may resist the loads
    integer :: max_unsupported = 6
    !> Traction, relative to its largest bound, that no step towards a solution leads to
    real(wp) :: most_across = 5.0_wp
    !> Singular value, relative to the largest, below which a rigid motion is not determined
    real(wp) :: undetermined_motion = 1.0e-12_wp
    !> Part of a load, relative to the sum of all tractions, that counts as rounding error
    real(wp) :: load_rounding = 1.0e-8_wp
  end type direct_options_t

  !> Interpolated entry of nodes (docs/theory/load_path.md, "Interpolated entry").
  type :: entry_options_t
    !> Near an edge on a lattice gap^(2/3) closes as (gap + g_0)^(2/3), g_0 this times the closing that the pressure at the
    !> edge makes at a node: fitted to the moments at which nodes enter a Hertzian contact
    real(wp) :: edge_gap = 0.11_wp
    !> The part C is found too small by this much of D, which is known from the first node outside on: fitted likewise
    real(wp) :: missed_share = 0.12_wp
    !> Spacings along the edge over which C is found
    integer :: along_edge = 3
    !> Corrections of the entry state in one load step, and those that the next one is extrapolated from
    integer :: max_corrections = 40, depth = 5
    !> A linear combination of corrections counts as dependent below this
    real(wp) :: dependent_corrections = 1.0e-7_wp
    !> Accuracy of a solution: at the beginning; relative to the residual that the entry state leaves; of the last one
    real(wp) :: first_tolerance = 1.0e-3_wp, relative_tolerance = 0.05_wp, last_tolerance = 0.5_wp
  end type entry_options_t

  !> All of them.
  type :: options_t
    type(contact_options_t) :: contact
    type(normal_options_t) :: normal
    type(newton_options_t) :: newton
    type(multilevel_options_t) :: multilevel
    type(direct_options_t) :: direct
    type(entry_options_t) :: entry
  end type options_t

end module hc_options
