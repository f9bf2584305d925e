"""Checks: both methods with friction lead to one solution."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hexcontact.deck.surfaces import Sphere

from .reference import Comparison
from .runs import ALUMINUM, BALL, STIFF, bodies, dissimilar_pair, hertz_of, press, run

ROUGH = hertz_of(dissimilar_pair(), 31.5).contact_radius / 8  # spacing: a few hundred nodes in contact
PRESSED = {"normal_load": 31.5, "steps": 4}
UNIT = {"spacing": 1.0 / 8, "friction_coefficient": 0.3}

HISTORIES: dict[str, dict[str, Any]] = {
    "static": {"loads": [press(31.5, 1)], "algorithm": "static"},
    "press, shear, turn back": {
        "loads": [PRESSED, {"tangential_load_x": 3.0, "steps": 6}, {"tangential_load_x": -1.0, "steps": 4}]
    },
    "press, shift aside": {"loads": [PRESSED, {"shift_x": 0.3e-6, "shift_y": 0.2e-6, "steps": 4}]},
    "goodman": {"loads": [PRESSED], "coupling": "goodman"},
}


def methods(histories: Mapping[str, Mapping[str, Any]] = HISTORIES) -> Comparison:
    """Solve histories by LAPACK and by transforms; the largest differences over all steps."""
    found = Comparison()
    spheres = {**STIFF, "surface": BALL}, ALUMINUM
    for name, arguments in histories.items():
        _compare(found, name, spheres, {"spacing": ROUGH, "friction_coefficient": 0.1, **arguments})
    twisted = {**UNIT, "loads": [press(4.0 / 3.0, 3), {"torque": 0.15, "steps": 4}]}
    _compare(found, "press, twist", bodies(0.2, 0.3, Sphere(radius=1.0)), twisted)
    found.notes.append(
        "Two algorithms: the nested active sets of chapter 12 on LAPACK, and the matrix-free one."
    )
    return found


def _compare(
    found: Comparison, name: str, pair: tuple[dict[str, Any], dict[str, Any]], arguments: Mapping[str, Any]
) -> None:
    direct, fft = (run(*pair, **{**arguments, "method": method}) for method in ("direct", "fft"))
    apart = {"p": 0.0, "q": 0.0}
    for number in range(1, len(fft) + 1):
        one, two = direct[number], fft[number]
        p = np.abs(one.pressure - two.pressure).max() / two.peak
        shear = np.hypot(one.traction_x - two.traction_x, one.traction_y - two.traction_y).max()
        q = shear / (arguments["friction_coefficient"] * two.peak)
        apart = {"p": max(apart["p"], float(p)), "q": max(apart["q"], float(q))}
    steps = f"{name}, {len(fft)} steps" if len(fft) > 1 else name
    found.add(steps, "max difference of p/p_max", "-", apart["p"], analytic=0.0, absolute=1e-6)
    found.add(steps, "max difference of q/(μ p_max)", "-", apart["q"], analytic=0.0, absolute=1e-6)
    for method, made in (("direct", direct), ("fft", fft)):
        found.add(steps, f"time, {method}", "s", made.seconds)
