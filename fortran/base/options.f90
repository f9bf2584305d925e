!> Tolerances, caps and tuning numbers of the solvers, each with its reason.
!>
!> Problems and solvers have a copy; a change of it before a solution changes the work, seldom the result. None of them is
!> part of the equations: a state is converged by the tolerance of the caller, whatever these numbers are.
!>
!> Beside their formulas stand numbers that only guard against overflow and dependent equations, those that define a residual,
!> the ranges of series in elasticity/, on which the spectra in a cache depend to the bit, and sizes of blocks that fit a cache.
module hc_options
  use hc_precision, only: wp, pi
  implicit none
  private

  public :: options_t, contact_options_t, normal_options_t, newton_options_t, multilevel_options_t, &
            preconditioner_options_t, direct_options_t, entry_options_t, step_options_t, edge_options_t, &
            cycle_options_t, accuracy_options_t

  !> Options that all methods share (docs/theory/friction.md, "The classification parameter", "Globalisation", "Gross sliding").
  type :: contact_options_t
    !> Scale kappa of the classification parameters, (F8): r times the operator has to be of order one, so that (F5) is a
    !> step of a contracting projection
    real(wp) :: classification_scale = 10.0_wp
    !> |beta| min(mu, 1) from which pressure and shear traction are better found together: staggered sweeps would
    !> exchange nodes at the edge again and again
    real(wp) :: strong_coupling = 0.03_wp
    !> Share of the slipping nodes that are fixed in stick where nothing else resists a load: enough of them to carry it, and
    !> those that slip least, which are the likeliest to stick
    real(wp) :: fixed_share = 0.25_wp
    !> Compliance of a layer, over that of a node and of the layer under the largest pressure, without effect: the
    !> pressure there is negligible, and larger numbers would only leave the range of single precision
    real(wp) :: softest_layer = 1.0e10_wp
    !> Share of a load that rounding errors may add before it counts as more than full sliding carries
    real(wp) :: load_rounding = 1.0e-6_wp
    !> Residual R_n above which the load that a pressure can carry is unknown
    real(wp) :: trusted_residual = 0.1_wp
    !> Motions that are tried for the least load factor of (F14), and the relative gain below which no more are
    integer :: max_limit_motions = 100
    real(wp) :: least_limit_gain = 1.0e-9_wp
  contains
    !> The parameter of a classification
    procedure :: classification_parameter
  end type contact_options_t

  !> Frictionless contact on FFTs (docs/theory/normal_contact.md, "FFT method").
  type :: normal_options_t
    !> Length of a projected step, (N3): M is a little more than the inverse of the operator
    real(wp) :: step_length = 0.85_wp
    !> The same on slender cells, where M exceeds it by more
    real(wp) :: slender_step = 0.8_wp
    !> Factor by which projected steps have to bring the residual down every other time, or their length is searched for: on rough
    !> surfaces sets would change without end
    real(wp) :: progress = 0.5_wp
    !> Length of the first searched step; share of the length below which none is tried
    real(wp) :: searched_length = 0.5_wp, least_searched = 0.1_wp
    !> Steps that are not judged by it: the first ones cut off most of a wrong start
    integer :: first_steps = 3
    !> A fixed set is changed when its residual has come down by this factor: then the next one can be trusted
    real(wp) :: fixed_accuracy = 0.1_wp
    !> Share of a residual, and of the tolerance, that errors of single precision may make up
    real(wp) :: residual_share = 0.01_wp, tolerance_share = 0.1_wp
    !> Times that the pressure of a solution is fitted to the load: a tolerance below rounding errors is not reached by more
    integer :: max_fits = 3
    !> Tolerance on coarser lattices, which only have to give a start
    real(wp) :: coarse_tolerance = 3.0e-2_wp
    !> Tolerance on a part of the window: the product over the window contains the errors of single precision
    real(wp) :: part_tolerance = 0.8_wp
    !> Lattices with fewer nodes are left to one thread: the start of the others takes longer than each of the short passes
    integer :: worth_sharing = 150000
    !> Compliance of a layer under the largest pressure, over that of a node, above which pressure and gap are smooth up to the
    !> edge; a tolerance that suits a start interpolated from the coarser lattice
    real(wp) :: soft_layer = 2.0_wp, smooth_tolerance = 3.0e-3_wp
    !> Share of the residual below which nodes that should enter or leave a compliant interface wait, where projected steps stall
    real(wp) :: slight_change = 0.1_wp
    !> Iterations in which the springs of a compliant layer are linearised again; beyond them (exponents of 3 and more, rough
    !> surfaces) only where their linear problem is solved to this share of the whole residual: that does not stall
    integer :: most_linearized = 10
    real(wp) :: linear_share = 0.3_wp
  end type normal_options_t

  !> Newton's method on FFTs (docs/theory/friction.md, "Staggered sweep", "Coupled sweep", "Globalisation").
  type :: newton_options_t
    !> Accuracy of a linear solution, relative to the residual at its start: loose while the active set changes
    real(wp) :: inner_accuracy = 0.1_wp
    !> The same of the shear traction once residuals are small; a tighter one where shear does not act on the pressure, since
    !> Newton's method then converges faster
    real(wp) :: late_accuracy = 0.03_wp, uncoupled_accuracy = 1.0e-3_wp
    !> Least accuracy of a coupled sweep; it follows the residuals of the sweep before
    real(wp) :: coupled_accuracy = 1.0e-4_wp
    !> Accuracy of the last linear solution, relative to the tolerance; of the last pressure, which the shear traction still moves
    real(wp) :: final_accuracy = 0.8_wp, final_pressure = 0.2_wp
    !> Share of the preconditioned residual that a linear solution starts with, before the product of its start: about the first
    !> step of conjugate gradients. Residual from which on sets change too much for it
    real(wp) :: length_ahead = 0.6_wp, residual_ahead = 0.1_wp
    !> Iterations of conjugate gradients and of GMRES, far more than the preconditioner needs; directions that GMRES stores, as many
    !> as it mostly takes, and up to how many with their products off the contact
    integer :: max_iterations = 400, max_coupled_iterations = 40, max_directions = 7, max_products = 5
    !> Contact areas per staggered sweep where the shear traction does not move the pressure: until the area stands
    integer :: max_areas_uncoupled = 60
    !> Residual R_n of a compliant interface at which the area of a first pressure stands
    real(wp) :: settled_residual = 1.0e-2_wp
    !> Round-off that is allowed in displacements that are carried along, relative to the largest; where more may be
    !> left, they are computed afresh
    real(wp) :: displacement_rounding = 1.0e-10_wp
    !> Component of the traction across the direction of slip, relative to the largest that friction allows, that is no step
    !> towards a solution: nodes are fixed in stick instead
    real(wp) :: most_across = 5.0_wp
    !> Compliance of the spring of a slipping node, over that of the node, below which its component across is left as a start
    real(wp) :: soft_spring = 8.0_wp
    !> Factor of the classification parameter at the first shear traction, where nodes are fixed, and under strong coupling:
    !> there the zones are far from those of the solution
    real(wp) :: cautious_share = 0.2_wp
    !> Shear tractions solved for after which the parameter is halved: two sets of zones may alternate; its least factor
    integer :: sweeps_per_cut = 10
    real(wp) :: least_share_of_r = 1.0e-3_wp
    !> Sweeps with fixed nodes after which the loads count as not carried
    integer :: max_fixed_sweeps = 12
    !> Staggered sweeps before coupled ones: with weak coupling, and with strong coupling
    integer :: staggered_sweeps = 12, staggered_sweeps_strong = 1
    !> Relaxation of the shear traction at a front (F12): nodes in contact from which on the products saved take longer than it
    !> does; rings of nodes on each side, and passes; residual R_t below which there is none, since zones stand then; changes that
    !> are left out, over R_t and the largest traction
    integer :: front_nodes = 5000, front_rings = 3, front_passes = 4
    real(wp) :: front_residual = 1.0e-4_wp, front_share = 0.01_wp
    !> Tolerance from which on the residuals of a solution are those of the displacements that its linear solvers carried along:
    !> their rounding errors are far below. Share of it that the displacement by the cut to admissible tractions may have
    real(wp) :: carried_tolerance = 1.0e-7_wp, cut_share = 0.05_wp
  end type newton_options_t

  !> Coarser lattices and parts of the window (docs/theory/multilevel.md).
  type :: multilevel_options_t
    !> Windows with fewer nodes a side are not coarsened any further
    integer :: smallest_side = 20
    !> Tolerance on coarser lattices of a first step: they only give a start
    real(wp) :: nested_tolerance = 3.0e-3_wp
    !> The same of a later step, whose start is the change that they find, and sweeps there
    real(wp) :: change_tolerance = 3.0e-2_wp
    integer :: change_sweeps = 20
    !> Nodes that a coarse contact has at least: fewer do not resolve zones
    integer :: least_contact = 100
    !> Tolerance on a part of the window: the product over the window has other rounding errors
    real(wp) :: part_tolerance = 0.9_wp
    !> Parts of the window that are tried: each contains the nodes where the bodies overlap outside of the last
    integer :: max_parts = 3
    !> Nodes in contact up to which a step that failed is handed to LAPACK, and sides of the part of the window for that
    integer :: few_nodes = 16, largest_direct_side = 64
    !> Share of the time of an application over the window up to which a part pays for separate operators
    real(wp) :: largest_part = 0.6_wp
    !> Margin of a part about the contact, in nodes: at least, and as a fraction 1/n of the width; the contact may grow in a
    !> step
    integer :: least_margin = 6, margin_divisor = 16
    !> Its ends lie on multiples of a power of two of the margin, at least a fraction 1/n of its width: loads that are alike
    !> share a part and its operators
    integer :: step_divisor = 16
  end type multilevel_options_t

  !> Inverse symbols (docs/theory/preconditioner.md, "Continuation beyond the edge", "Springs of slipping nodes").
  type :: preconditioner_options_t
    !> Rings of the continuation beyond the edge, (P3): a factor times a power of the number of active nodes over that of the
    !> nodes at the edge (the width of the contact), and the most rings
    real(wp) :: ring_factor = 0.7_wp, ring_power = 0.8_wp
    integer :: max_rings = 16
    !> The same factor and power in patches up to that width, where sets of active nodes change without end: the continuations of
    !> many patches meet
    real(wp) :: patch_ring_factor = 5.0_wp, patch_ring_power = 0.5_wp, patch_width = 10.0_wp
    !> So they do, as on rough surfaces; set by the solver
    logical :: patches = .false.
    !> Ratio of the edges of a cell above which the grid is wider than the window across the contact, by these shares of it on each
    !> side: with rings of all neighbors, and with those along short edges
    real(wp) :: slender = 4.0_wp, margins(2) = [0.05_wp, 0.15_wp]
    !> Rings along short edges over the width, by the logarithm of the ratio of the edges over another one; height of the mean of a
    !> line at its end: the surface falls off the less the longer the contact is
    real(wp) :: rings_by_ratio = 0.18_wp, least_ratio = 1.9_wp, floor = 0.2_wp
    !> Times that a ring is smoothed: waves along the edge fall off the faster the shorter they are
    integer :: smoothings = 2
    !> Compliances of the shortest and of the longest waves in slip, over that of a node, (P5): the shortest ones are known, and
    !> from 20 to 80 on the longest ones make no difference. Steps of the lattice to the neighbors that displacements are averaged
    !> over, one after the other, and from slip to the nodes in stick that take part
    real(wp) :: short_waves = 2.0_wp, long_waves = 40.0_wp
    integer :: smoothing_steps(3) = [1, 2, 4], smoothing_reach = 4
    !> Springs along the normal, (P7): elastic compliance of the waves that a single spring acts on, as d_n and the stiffest
    !> spring times these
    real(wp) :: wave_of_nodes = 2.0_wp, wave_of_springs = 1.0_wp
  end type preconditioner_options_t

  !> Explicit matrices (docs/theory/friction.md, "Direct method").
  type :: direct_options_t
    !> The iteration as the dissertation writes it, for comparison
    logical :: as_written = .false.
    !> Exchanges of whole sets that may fail to lower the number of wrong nodes, before Murty's rule exchanges one by one
    integer :: stalled_exchanges = 10
    !> Tolerance on coarser lattices, of a first step and of a later one
    real(wp) :: nested_tolerance = 1.0e-3_wp, change_tolerance = 1.0e-2_wp
    !> Accuracy at which a compliant interface is not linearised any more, relative to the tolerance
    real(wp) :: final_accuracy = 0.2_wp
    !> Contact areas that are tried before there is any shear traction
    integer :: first_areas = 30
    !> Tension and penetration, relative to the largest pressure, that are rounding errors
    real(wp) :: pressure_rounding = 1.0e-12_wp
    !> Violation of a compliant law, relative to the largest pressure, below which its springs stay
    real(wp) :: settled_spring = 1.0e-12_wp
    !> Slip that gives a node without traction no direction yet, relative to that of the largest pressure
    real(wp) :: negligible_slip = 1.0e-6_wp
    !> Factor of the classification parameter at the beginning of a step and where nodes are fixed, and the sweeps after which
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
    !> Block factors in single precision: share of the error that a correction may leave (more of them take longer than LU),
    !> and corrections
    real(wp) :: largest_share = 0.3_wp
    integer :: max_corrections = 40
    !> Nodes in contact up to which the whole matrix is factorized for every area: kept factors save nothing there
    integer :: most_explicit = 60
    !> Share of the rows of a factor that may change before it is computed again
    real(wp) :: most_exchanged = 0.1_wp
    !> Change of a direction of slip, and of a spring across it, that its factor serves for, too
    real(wp) :: largest_turn = 0.1_wp
    !> Solutions with kept factors: accuracy relative to the last residuals, and to the tolerance; the accuracy of the first one;
    !> directions of GMRES after which the whole matrix is factorized
    real(wp) :: inner_accuracy = 1.0e-3_wp, last_accuracy = 0.05_wp, first_accuracy = 1.0e-4_wp
    integer :: max_directions = 40
  end type direct_options_t

  !> Interpolated entry of nodes (docs/theory/load_path.md, "Interpolated entry").
  type :: entry_options_t
    !> Near an edge on a lattice gap^(2/3) closes as (gap + g_0)^(2/3), g_0 this times the closing that the pressure at the
    !> edge makes at a node: fitted to the moments at which nodes enter a Hertzian contact
    real(wp) :: edge_gap = 0.11_wp
    !> The computed part C is too small by this share of D, which follows from the first node outside: fitted likewise
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

  !> Size of adaptive load steps (docs/theory/step_control.md).
  type :: step_options_t
    !> Smallest load step, as a part of the segment, and attempts at one: a step that is not good enough then is marked
    real(wp) :: least_step = 1.0e-3_wp
    integer :: max_attempts = 6
    !> Largest and smallest growth from one load step to the next
    real(wp) :: most_growth = 2.0_wp, least_growth = 0.3_wp
    !> Smallest and largest size of an attempt over that of the rejected one; the same if that one did not converge: its
    !> changes say nothing about the size
    real(wp) :: smallest_retry = 0.1_wp, largest_retry = 0.6_wp, unsolved_retry = 0.25_wp
    !> Share of the allowed change that a step aims at: less than 1, since the change is estimated
    real(wp) :: aim = 0.8_wp
    !> Share of the tolerance by which one step may add to the change of the tractions, (S2)
    real(wp) :: added_share = 0.5_wp
    !> Share of a change of the stick area from which on it is that of the step itself, not of those before
    real(wp) :: own_share = 0.25_wp
    !> An attempt is useless if it leaves more than this share of the excess of the previous attempt
    real(wp) :: useful_share = 0.8_wp
    !> Least excess that a factor is found from, and rounding errors of sizes
    real(wp) :: least_excess = 1.0e-9_wp, size_rounding = 1.0e-9_wp
    !> Factors from changes to the bound (S3): of the stick area; of the tractions, times their gain
    real(wp) :: stick_safety = 2.0_wp, traction_safety = 2.0_wp
    !> Shares of changes that are still there after the next load step, (S3): where a change passes through zero the error does not
    real(wp) :: stick_memory = 0.9_wp, traction_memory = 0.8_wp
    !> Factor from changes of the tractions to the bound on their error, besides the tolerance, (S4): below that steps are too
    !> large for errors to fall in proportion to the size. Measured on nine histories
    real(wp) :: own_safety = 3.0_wp
    !> Error b of the lattice: spacings by which single rings of nodes that enter move the edge of the stick area; multiple of
    !> the share of the edge at which nodes entered along which it may have moved; spacings in the radius of a contact
    !> below which the lattice alone says where it sticks
    real(wp) :: ring_shift = 0.7_wp, entering_factor = 5.0_wp, small_radius = 3.0_wp
    !> Largest gain G of (S3): where nothing but rounding errors is added to tractions it would be any number
    real(wp) :: most_gain = 10.0_wp
    !> Factor on the changes that repeated cycles are expected to leave, and the largest ratio of one change to the change before
    !> it: a series without decay counts as one that closes in 50 cycles
    real(wp) :: closing_safety = 3.0_wp, slowest_closing = 0.98_wp
    !> Change of the wear of a cycle over that of the shear tractions, both as shares, where only the latter is known
    real(wp) :: closing_gain = 100.0_wp
    !> Shear tractions, over the largest pressure, that are rounding errors
    real(wp) :: shear_rounding = 1.0e-12_wp
  end type step_options_t

  !> Edges of zones and radii (docs/theory/edges.md, "The edge between the nodes", "Estimators").
  type :: edge_options_t
    !> Steps over which nodes next to an edge get a slope from nodes that have one, those with all six neighbors on its side
    integer :: reach = 3
    !> Distance of a node where there is no slope, in spacings: the zone is too small, or not sharply bounded. Least distance of
    !> a node inside
    real(wp) :: unknown_distance = 0.5_wp, least_distance = 1.0e-9_wp
    !> Distance at which fields of distances are cut off, in spacings: pictures need it at the edge alone
    real(wp) :: largest_distance = 9.0_wp
    !> Slopes per spacing below this share of a value, and sums of directions below it, are none: a value that vanishes at the edge
    !> has a slope of more than a tenth of it on the few nodes inside that are used. Slopes far below are errors of the
    !> solution, as in the middle of a symmetric contact of a few nodes, whatever the tolerance
    real(wp) :: least_relative_slope = 1.0e-3_wp
    !> Least square of the slope at the edge over that further inside, (B4): for squares that grow like a power m of the distance
    !> it is 1/m - 1
    real(wp) :: least_slope = 0.5_wp
    !> Spacings by which pressure and gap see the edge too far inside in the mean, where the layer is not taken off
    real(wp) :: inward = 0.04_wp
    !> Layer of the lattice at an edge, (B3): nodes at these distances have squares (of the pressure, of the reserve of friction)
    !> as if they were at `layer_square`. Measured on the contacts of Hertz and of Cattaneo and Mindlin with 14 to 60 spacings
    !> in the radius at random places on the lattice: it is the same for both and for all directions of the edge, up to a
    !> scatter of 0.03. There is no layer beyond the last one.
    real(wp) :: layer_distance(14) = &
      [-0.05_wp, 0.0_wp, 0.05_wp, 0.1_wp, 0.15_wp, 0.2_wp, 0.3_wp, 0.5_wp, 0.7_wp, 0.9_wp, 1.1_wp, 1.3_wp, 1.5_wp, 2.0_wp]
    real(wp) :: layer_square(14) = [0.0_wp, 0.006_wp, 0.021_wp, 0.046_wp, 0.076_wp, 0.118_wp, 0.216_wp, &
                                    0.464_wp, 0.740_wp, 0.985_wp, 1.164_wp, 1.334_wp, 1.513_wp, 2.0_wp]
    !> Distances from the edge, in spacings, between which circles and ellipses are fitted to the pressure: the outermost nodes
    !> carry most of the error of the lattice, and far inside a polynomial is no good approximation of other contacts
    real(wp) :: outer_ring = 1.0_wp, inner_ring = 6.0_wp
    !> Tractions corrected at an edge, (I16) to (I18): points along a spacing at which the shape is sampled, and how often the
    !> tractions are solved for
    integer :: samples = 6, passes = 2
    !> Paraboloids through the squares of nodes inside, from one solution to the next: nodes that count are at least `fit_from`
    !> from the edge and at most `fit_reach` away, and at least so many; squares of nodes up to `fit_depth` inside and `fit_beyond`
    !> outside are replaced, those that the triangles at the edge need.
    !> The error of the edge changes its sign from one solution to the next, with about half its size, so that `fit_share` of
    !> the change is right
    real(wp) :: fit_from = 0.5_wp, fit_reach = 4.0_wp, fit_depth = 3.0_wp, fit_beyond = 1.0_wp
    real(wp) :: fit_share = 2.0_wp/3.0_wp
    integer :: fit_nodes = 12
    !> Displacements of nodes in contact are unchanged to this share of the largest change, after at most as many iterations
    !> of conjugate gradients: 25 are enough on 128 x 128 nodes, 42 on 512 x 512
    real(wp) :: accuracy = 1.0e-3_wp
    integer :: max_iterations = 400
  end type edge_options_t

  !> Cycles of a load history (docs/theory/load_path.md, "Cycles").
  type :: cycle_options_t
    !> Share of the range of all values below which a way back is no turning point: solutions scatter by less
    real(wp) :: noise = 0.01_wp
    !> Share of the range of a cycle within which its motion or its load has to come back
    real(wp) :: closure = 0.05_wp
    !> The same of the motion where only the load has to come back: in gross sliding it does so before the motion has
    real(wp) :: drift = 0.25_wp
  end type cycle_options_t

  !> Error bars (docs/theory/error_bars.md). With these factors errors known from closed solutions stay within the estimate.
  type :: accuracy_options_t
    !> Orders of the trend that are tried, (A1): areas of whole cells have the first, approach and energies the second
    real(wp) :: orders(3) = [1.0_wp, 1.5_wp, 2.0_wp]
    !> Order of the trend of a quantity that a few nodes at an edge decide, or a slip zone that is not resolved, tried besides
    real(wp) :: rough_order = 0.5_wp
    !> The same where a slip zone is narrower than the lattice resolves: at mu = 1 an order of 0.5 has 75 % of
    !> the largest shear tractions within, 0.2 has 96 %, this one 98 %
    real(wp) :: unresolved_order = 0.15_wp
    !> Spacings below which a slip zone is not resolved, and the shear traction over the pressure that is none
    real(wp) :: resolved_width = 1.0_wp, least_shear = 1.0e-6_wp
    !> Orders whose residual is at most this multiple of the least one are all possible
    real(wp) :: possible_residual = 1.5_wp
    !> Factor on the trend, and standard errors of the limit that the fit finds, (A2)
    real(wp) :: trend_safety = 1.25_wp, standard_errors = 2.0_wp
    !> Lattices, at least: the fit has two unknowns
    integer :: least_lattices = 4
  end type accuracy_options_t

  !> All of them.
  type :: options_t
    type(contact_options_t) :: contact
    type(normal_options_t) :: normal
    type(newton_options_t) :: newton
    type(multilevel_options_t) :: multilevel
    type(preconditioner_options_t) :: preconditioner
    type(direct_options_t) :: direct
    type(entry_options_t) :: entry
    type(step_options_t) :: steps
    type(edge_options_t) :: edges
    type(cycle_options_t) :: cycles
    type(accuracy_options_t) :: accuracy
  end type options_t

contains

  !> Compute kappa/(2 pi lambda a) for a contact of radius a, (F8) [Pa/m].
  pure real(wp) function classification_parameter(self, lambda, radius) result(r)
    class(contact_options_t), intent(in) :: self
    !> Displacement by a point load times the distance [1/Pa]
    real(wp), intent(in) :: lambda
    !> Radius of the contact [m]
    real(wp), intent(in) :: radius

    r = self%classification_scale/(2.0_wp*pi*lambda*radius)
  end function classification_parameter

end module hc_options
