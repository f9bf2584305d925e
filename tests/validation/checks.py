"""The list of checks, and those that solve nothing."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable

import numpy as np

from .frame import Check
from .reference import Comparison, reference


def kernels() -> Comparison:
    """Pyramid kernels at lattice points against the reference table."""
    from hexcontact.influence import pyramid_kernels

    found = Comparison()
    for col, row in ((0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (3, -1)):
        values = pyramid_kernels(np.array(col + 0.5 * row), np.array(math.sqrt(0.75) * row))
        for name, value in zip(("K1", "Kxx", "Kxy", "Kx", "Ky"), values, strict=True):
            known = reference(f"kernel at index difference ({col},{row})", f"{name}/le")
            # the table has 13 digits
            found.add(f"({col},{row})", f"{name}/l_e", "-", float(value), row=known, absolute=5e-13)
    return found


def materials() -> Comparison:
    """Constants of the pairs of materials of sections 9.2 and 9.3."""
    from hexcontact.core.contact import ElasticPair

    found = Comparison()
    for section, beta, moduli in (
        ("9.2", "Dundurs beta", (432e9, 0.32, 72e9, 0.32)),
        ("9.3", "beta", (200e9, 0.30, 69e9, 0.33)),
    ):
        pair, case = ElasticPair.from_materials(*moduli), f"{section} materials"
        found.add(case, "E*", "GPa", pair.effective_modulus, row=reference(case, "E*"), relative=1e-7)
        found.add(case, "beta", "-", pair.beta, row=reference(case, beta), relative=5e-7)
        found.add(case, "gamma", "-", pair.gamma, row=reference(case, "gamma"), relative=5e-7)
    found.notes.append(
        "9.2: 432 GPa on 72 GPa, both 0.32. 9.3: steel (200 GPa, 0.30) on aluminium (69 GPa, 0.33)."
    )
    return found


def _of(module: str, name: str) -> Callable[[], Comparison]:
    """Return the check `name` of a module of this package, imported when it runs."""

    def run() -> Comparison:
        check: Callable[[], Comparison] = getattr(importlib.import_module(f"validation.{module}"), name)
        return check()

    return run


_ALL = (
    Check(
        "kernels",
        "Influence functions of the pyramid",
        "The five kernels at lattice points. Pictures, made by `make pictures`: "
        "[displacements of the pyramid](images/pyramid.png), as in Figure 5.6; "
        "[its elements](images/elements.png), as in Figures 4.5, 5.2 and 5.5; "
        "[the pyramid beside other load shapes](images/load_shapes.png), as in Figure 7.3; "
        "[a load in two dimensions](images/load_models.png), as in Figures 7.3 and 7.4.",
        kernels,
    ),
    Check("materials", "Pairs of materials", "Constants of the pairs of sections 9.2 and 9.3.", materials),
    Check(
        "fatigue",
        "Fatigue parameters",
        "Tension, torsion and both out of phase, about axes turned at random, against closed forms.",
        _of("fatigue", "parameters"),
    ),
    Check(
        "table-9.2",
        "Two spheres on five meshes (Tables 9.1 and 9.2)",
        "Frictionless contact of two spheres; on each mesh the discrete solution is unique.",
        _of("normal", "table_9_2"),
    ),
    Check(
        "convergence",
        "Convergence of the frictionless sphere",
        "Errors against Hertz on lattices with a/l_e spacings in the contact radius.",
        _of("normal", "convergence"),
    ),
    Check(
        "crossed-cylinders",
        "Crossed cylinders without friction (section 9.3)",
        "Contact ellipse of two cylinders whose axes enclose an angle, against Hertz.",
        _of("normal", "crossed_cylinders"),
    ),
    Check(
        "slender-contacts",
        "Slender contacts on cells of their shape",
        "Ellipses up to 50:1 and crossed cylinders on at most 128 nodes each way, against Hertz.",
        _of("surfaces", "slender"),
    ),
    Check(
        "rollers",
        "Logarithmic roller at its design load",
        "Load by length and pressure along the axis beside plane contact.",
        _of("surfaces", "rollers"),
    ),
    Check(
        "hollow-surfaces",
        "Balls in grooves, races and seats",
        "Hollow surfaces, against Hertz.",
        _of("surfaces", "hollow"),
    ),
    Check(
        "maps",
        "A ball read from files of heights",
        "Measured maps in three formats, against Hertz and against the same ball by its formula.",
        _of("surfaces", "measured"),
    ),
    Check(
        "westergaard",
        "Waves in one direction",
        "One period of a wave, against Westergaard, up to complete contact.",
        _of("repeating", "westergaard"),
    ),
    Check(
        "periodic-waves",
        "Waves in two directions between light and complete contact",
        "Mean gap and largest pressure, against a spectral program.",
        _of("repeating", "waves"),
    ),
    Check(
        "periodic-asperity",
        "An asperity in a window that repeats",
        "A sphere in cells of 8, 16 and 32 contact radii, against the sphere alone.",
        _of("repeating", "asperity"),
    ),
    Check(
        "rough",
        "Random rough surfaces",
        "Areas and mean gap, each against a lattice twice as fine; area over load.",
        _of("repeating", "rough"),
    ),
    Check(
        "rough-superposition",
        "A rough surface in a window that repeats, sheared",
        "Alike bodies with ν = 0: differences of contacts without friction (Jaeger, Ciavarella).",
        _of("repeating", "superposed"),
    ),
    Check(
        "rough-friction",
        "A rough surface with friction on a rigid flat",
        "Unlike bodies, pressed and sheared, on 128² to 512² nodes, each against a lattice twice as fine.",
        _of("repeating", "sheared"),
    ),
    Check(
        "error-bars",
        "Estimated discretization errors",
        "How many true errors lie within the estimated ones, on lattices of random spacing and origin.",
        _of("error_bars", "error_bars"),
    ),
    Check(
        "hard-error-bars",
        "Estimated errors of problems without closed-form solution",
        "How many errors of every load step lie within the estimated ones, against one fine lattice.",
        _of("hard_problems", "hard_error_bars"),
    ),
    Check(
        "step-bounds",
        "Bounds on the errors of adaptive load steps",
        "How many errors of stick area and tractions lie within the recorded bounds, in every load step.",
        _of("hard_problems", "step_bounds"),
    ),
    Check(
        "profiles",
        "Cone, powers and punches",
        "Axisymmetric contacts with closed-form solutions.",
        _of("normal", "profiles"),
    ),
    Check(
        "superposition",
        "Cone, power, punches and an own surface with friction (chapter 10)",
        "Alike bodies with ν = 0 sheared: differences of frictionless contacts, exact on every lattice "
        "(Jaeger, Ciavarella).",
        _of("superposition", "superposition"),
    ),
    Check(
        "coatings",
        "Sphere on a layer",
        "Radius, approach and pressure at the center, for layers on softer, harder and rigid bodies.",
        _of("coatings", "sphere"),
    ),
    Check(
        "interface",
        "Compliant interface (chapter 11)",
        "A sphere on layers p = c ψ^m, with E* = R = 1 and P = 4/3, extrapolated from two lattices; stiff "
        "layers against (C6), which adds (m/(m+1)) (p0/c)^(1/m) to Hertz's approach. "
        "[Convergence to contact without a layer](images/interface.png).",
        _of("interface", "spheres"),
    ),
    Check(
        "interface-flats",
        "Rigid flats on a layer (chapter 11)",
        "P = A c ψ^m, and in full slip Q = A c_t ψ^m_t by the interface's own limit (11.29); exact.",
        _of("interface", "flats"),
    ),
    Check(
        "interface-stiff",
        "Compliant interface as it stiffens",
        "Differences from contact without a layer, μ = 0.3, Q = 0.4 μP, a/l_e = 20, each within a multiple "
        "of (C6); and the interface's own limit with c_t = μ c against μp. "
        "[Convergence](images/interface.png).",
        _of("interface", "stiff_limit"),
    ),
    Check(
        "friction-by-radius",
        "Friction that varies with the radius",
        "Full slip by a shift and by a twist, against integrals of μ(r) times Hertz's pressure.",
        _of("friction_laws", "by_radius"),
    ),
    Check(
        "friction-direction",
        "Friction with a direction",
        "Full slip with two coefficients, and the limit of equal ones.",
        _of("friction_laws", "direction"),
    ),
    Check(
        "wear",
        "Wear by cycles",
        "Volume of the dissipated work (V2); a sphere in partial slip at a constant approach, worn until "
        "only the disc that sticks carries, (V7); the flat of a sphere in gross slip, constant load, (V8), "
        "which holds where the surface wears by more than it deforms.",
        _of("wear", "wear"),
    ),
    Check(
        "control",
        "Load control and approach control",
        "The same problem driven by its load or by its approach, by both methods.",
        _of("normal", "control"),
    ),
    Check(
        "methods",
        "Direct and fft with friction",
        "The same histories by both methods.",
        _of("methods", "methods"),
    ),
    Check(
        "table-9.3",
        "Dissimilar spheres pressed with friction (section 9.2, Table 9.3)",
        "Static and incremental solutions for P = 10 and 31.5 N, on the lattices of the reference table and "
        "extrapolated to many load steps.",
        _of("dissimilar", "table_9_3"),
    ),
    Check(
        "goodman",
        "Dissimilar spheres, uncoupled (section 9.2)",
        "The stick radius where shear does not move the pressure, against Spence's formula.",
        _of("dissimilar", "goodman"),
    ),
    Check(
        "rigid-plane",
        "Sphere with ν = 0 pressed on a rigid plane",
        "The strongest coupling of pressure and shear, β = 1/2.",
        _of("dissimilar", "rigid_plane"),
    ),
    Check(
        "stick-radius",
        "Stick radius of self-similar contacts",
        "The stick radius under a growing load depends on β and μ only; here from a flat punch.",
        _of("no_slip", "stick_radii"),
    ),
    Check(
        "flat-punch-no-slip",
        "Flat punch without slip",
        "A rigid flat punch that cannot slip (Mossakovskii).",
        _of("no_slip", "flat_punch"),
    ),
    Check(
        "sphere-no-slip",
        "Sphere without slip",
        "A sphere pressed in many steps that cannot slip (Mossakovskii, Spence).",
        _of("no_slip", "sphere"),
    ),
    Check(
        "entry",
        "Few load steps of a growing contact",
        "Nodes that come into contact, with both values of solver.entry, against exact solutions.",
        _of("entry", "entry"),
    ),
    Check(
        "unloading",
        "Dissimilar sphere pressed and let go",
        "Normal unloading with friction: slip reverses from the edge inwards.",
        _of("unloading", "unloading"),
    ),
    Check(
        "crossed-cylinders-friction",
        "Crossed cylinders with friction (section 9.3, Figure 9.4)",
        "Contact and stick ellipses, static and incremental.",
        _of("crossed_cylinders", "crossed_cylinders"),
    ),
    Check(
        "cattaneo-mindlin",
        "Alike spheres sheared (section 13.1, Figure 13.2)",
        "Stick radius, shift and tractions at Q/μP = 0.1 ... 0.9 against Cattaneo and Mindlin.",
        _of("tangential", "cattaneo_mindlin"),
    ),
    Check(
        "loop",
        "Hysteresis loop at constant normal load",
        "Spheres sheared to and fro, against Mindlin and Deresiewicz.",
        _of("tangential", "loop"),
    ),
    Check(
        "prescribed-shift",
        "Prescribed shift",
        "Spheres shifted by given amounts up to full slip.",
        _of("tangential", "prescribed_shift"),
    ),
    Check("torsion", "Torsion", "Spheres twisted, against Lubkin.", _of("tangential", "torsion")),
    Check(
        "rolling-linear",
        "Linear theory of rolling",
        "Coefficients of an ellipse against Kalker's table and an independent calculation.",
        _of("rolling", "linear"),
    ),
    Check(
        "rolling",
        "Creep forces of a circle",
        "Steady rolling against an independent calculation.",
        _of("rolling", "nonlinear"),
    ),
    Check("carter", "Rolling cylinders", "Middle of a roller, against Carter.", _of("rolling", "carter")),
    Check(
        "long-contact",
        "Middle of a long contact, sheared (Figure 13.3)",
        "Tractions in the mid-plane against the plane solution of Cattaneo and Mindlin.",
        _of("plane", "cattaneo"),
    ),
    Check(
        "long-contact-dissimilar",
        "Middle of a long contact of dissimilar bodies, pressed, then sheared (Figure 13.3)",
        "Stick and tractions in the mid-plane against plane solutions.",
        _of("plane", "dissimilar"),
    ),
    Check(
        "below",
        "Stress below Hertz's contact and a sliding sphere",
        "Largest error of the six stresses, 40 spacings in the radius, of both sources of tractions.",
        _of("subsurface", "closed_forms"),
    ),
    Check(
        "pyramids-below",
        "Influence functions below the surface",
        "Displacement and stress of the unit pyramid, near creases and vertices and out to 1e5 spacings.",
        _of("subsurface", "influence_functions"),
    ),
    Check(
        "waves-below",
        "Stress below a wave",
        "A wave pressed flat and sheared in a window that repeats: largest error of the stress by depth.",
        _of("subsurface", "waves"),
    ),
    Check(
        "layers-below",
        "Stress in a layer and below it",
        "On the axis below Hertz's pressure, against transforms of Hooke's law and equilibrium.",
        _of("coatings", "below"),
    ),
    Check(
        "bulk-plane",
        "Bulk stress: the shifted stick strip (Nowell and Hills)",
        "Long contact under tangential load and bulk stress across it, with slip of one sign and of both; "
        "the mid-plane against plane solutions.",
        _of("bulk", "plane"),
    ),
    Check(
        "bulk-plane-cycle",
        "Bulk stress and tangential load in phase (Nowell and Hills)",
        "A cycle of the long contact: the strips of loading, unloading and loading again.",
        _of("bulk", "cycle_in_plane"),
    ),
    Check(
        "bulk",
        "Bulk stress: the shifted stick disc",
        "Sphere under tangential load and bulk stress, exact for ν = 0, driven by force and by displacement.",
        _of("bulk", "disc"),
    ),
    Check(
        "bulk-large",
        "Large bulk stress, slip of both signs",
        "Spheres strained in one step, ν = 0 and 0.3, against values of another program.",
        _of("bulk", "single_steps"),
    ),
    Check(
        "bulk-cycles",
        "Cyclic bulk stress in phase, in quadrature and in counter-phase",
        "Spheres with ν = 0: shift, stick disc and energy of a cycle against (C10) and (C11), balance of "
        "work, symmetry of the half cycles.",
        _of("bulk", "cycles"),
    ),
    Check(
        "fretting",
        "Dissimilar spheres pressed, then sheared (section 13.2.2, Tables 13.3 to 13.5)",
        "The 40 load steps of the text.",
        _of("fretting", "fretting"),
    ),
    Check(
        "fretting-fine-steps",
        "Dissimilar spheres pressed, then sheared in finer steps",
        "The path of section 13.2.2 in 185 steps.",
        _of("fretting", "refined_path"),
    ),
    Check(
        "stick-outlines",
        "Stick zones, coupled and uncoupled (Figure 13.5)",
        "The history of section 13.2.2 by both kinds of coupling.",
        _of("fretting", "stick_outlines"),
    ),
    Check(
        "compliance",
        "Initial tangential compliance against β (Figure 13.4)",
        "The first small shear after pressing dissimilar spheres.",
        _of("fretting", "compliance"),
    ),
)

CHECKS = {check.name: check for check in _ALL}
"""All checks by name, in the order in which they run."""
