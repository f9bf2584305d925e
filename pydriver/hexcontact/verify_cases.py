"""The list of checks of ``hexcontact verify``, and those that solve nothing."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from .verify import Check, Comparison, reference


def kernels() -> Comparison:
    """Pyramid kernels at lattice points against the reference table."""
    from .influence import pyramid_kernels

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
    from .native import ElasticPair

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


def _frictionless(name: str) -> Callable[[], Comparison]:
    """Return the check `name` of `verify_normal`, imported when it runs."""

    def run() -> Comparison:
        from . import verify_normal

        check: Callable[[], Comparison] = getattr(verify_normal, name)
        return check()

    return run


_ALL = (
    Check(
        "kernels",
        "Influence functions of the pyramid",
        "The five kernels at lattice points. Pictures, made by `make pictures`: "
        "[displacements of the pyramid](images/pyramid.png), as in Figure 5.6; "
        "[the pyramid beside other load shapes](images/load_shapes.png), as in Figure 7.3.",
        kernels,
    ),
    Check("materials", "Pairs of materials", "Constants of the pairs of sections 9.2 and 9.3.", materials),
    Check(
        "table-9.2",
        "Two spheres on five meshes (Tables 9.1 and 9.2)",
        "Frictionless contact of two spheres; on each mesh the discrete solution is unique.",
        _frictionless("table_9_2"),
    ),
    Check(
        "convergence",
        "Convergence of the frictionless sphere",
        "Errors against Hertz on lattices with a/l_e spacings in the contact radius.",
        _frictionless("convergence"),
    ),
    Check(
        "crossed-cylinders",
        "Crossed cylinders without friction (section 9.3)",
        "Contact ellipse of two cylinders whose axes enclose an angle, against Hertz.",
        _frictionless("crossed_cylinders"),
    ),
    Check(
        "profiles",
        "Cone, powers and punches",
        "Axisymmetric contacts with closed solutions.",
        _frictionless("profiles"),
    ),
    Check(
        "control",
        "Load control and approach control",
        "The same problem driven by its load or by its approach, by both methods.",
        _frictionless("control"),
    ),
)

CHECKS = {check.name: check for check in _ALL}
"""All checks by name, in the order in which they run."""
