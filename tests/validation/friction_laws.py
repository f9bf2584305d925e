"""Checks of friction that varies over the contact, and of friction with a direction."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hexcontact.case import Case
from hexcontact.deck.surfaces import Sphere

from .reference import Comparison

# E* = R = 1 and P = 4/3 make Hertz's radius 1; the second coefficient counts beyond the ring
MODULUS, LOAD, SPACING = 1.0, 4 / 3, 0.025
CENTER, RIM, RING = 0.5, 0.2, 0.6


def by_radius() -> Comparison:
    """Coefficients that depend on the radius, in full slip by a shift and by a twist."""
    found = Comparison()
    inner = CENTER + (RIM - CENTER) * math.sqrt(1 - RING**2) ** 3  # share of P within the ring
    moment = (math.asin(RING) - RING * math.sqrt(1 - RING**2) * (1 - 2 * RING**2)) / 8
    whole = math.pi / 16
    laws: dict[str, tuple[Any, float, float]] = {
        "μ = 0.5 - 0.3 r²": ("max(0.5 - 0.3*(x**2 + y**2), 0)", 0.38, 3 * (0.5 * whole - 0.3 * math.pi / 32)),
        "μ = 0.5 for r < 0.6, else 0.2": (
            lambda x, y: np.where(np.hypot(x, y) < RING, CENTER, RIM),
            inner,
            3 * (CENTER * moment + RIM * (whole - moment)),
        ),
    }
    for name, (mu, force, torque) in laws.items():
        bound = 1e-3 if isinstance(mu, str) else 1e-2  # a jump between nodes
        last = _slid(mu, {"shift_x": 50.0})
        found.add(name, "Q/P", "-", float(last["tangential_load_x"]) / LOAD, analytic=force, absolute=bound)
        last = _slid(mu, {"twist": "50 rad"})
        found.add(name, "M_z/(P a)", "-", float(last["torque"]) / LOAD, analytic=torque, absolute=bound)
    found.notes.append("E* = R = 1, P = 4/3 (a = 1), ν = 0, a/l_e = 40; the whole contact slips.")
    return found


def direction() -> Comparison:
    """Two coefficients and an angle: full slip against the associated law, and the limit of equal ones."""
    found = Comparison()
    along, across, angle = 0.4, 0.2, math.radians(20)
    law = {"along": along, "across": across, "angle": "20 deg"}
    for degrees in (0, 20, 45, 65, 110):
        way = math.radians(degrees - 20)
        n = np.array([math.cos(way), math.sin(way)])
        point = np.array([along**2, across**2]) * n / math.hypot(along * n[0], across * n[1])
        turned = complex(*point) * np.exp(1j * angle)
        far = 1e4 * np.exp(1j * math.radians(degrees))
        last = _slid(law, {"shift_x": far.real, "shift_y": far.imag})
        for axis, value in (("x", turned.real), ("y", turned.imag)):
            carried = float(last[f"tangential_load_{axis}"]) / LOAD
            found.add(f"slip at {degrees}°", f"Q_{axis}/P", "-", carried, analytic=value, absolute=2e-5)
    part = {"tangential_load_x": 0.2, "tangential_load_y": 0.1}
    equal = _slid(0.3, part)
    for ratio in (1e-4, 1e-6):
        near = _slid({"along": 0.3 * (1 + ratio), "across": 0.3, "angle": "20 deg"}, part)
        for name in ("shift_x", "shift_y", "dissipated_energy"):
            change = float(near[name] / equal[name]) - 1
            found.add(
                f"μ_1/μ_2 = 1 + {ratio:g}", f"{name}, change", "-", change, analytic=0.0, absolute=3 * ratio
            )
    found.notes.append(
        "μ_1 = 0.4 along 20°, μ_2 = 0.2 across: slip is normal to the ellipse (q_1/μ_1)² + (q_2/μ_2)² = p², "
        "so that Q is along (μ_1² n_1, μ_2² n_2) for slip along -n."
    )
    return found


def _slid(mu: Any, load: dict[str, Any]) -> Any:
    """Return the end of the history of a sphere that is pressed, then sheared or twisted."""
    body = {"young_modulus": 2 * MODULUS, "poisson_ratio": 0.0}
    case = Case(
        body_1={**body, "surface": Sphere(radius=1.0)},
        body_2=body,
        friction_coefficient=mu,
        spacing=SPACING,
        loads=[{"normal_load": LOAD}, load],
        tolerance=1e-10,
    )
    return case.run().dataset.isel(step=-1)
