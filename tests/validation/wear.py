"""Checks of wear by cycles: volume, limiting shape in partial slip, flat of a sphere in gross slip."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.optimize import brentq

from hexcontact import ElasticPair, NormalContact
from hexcontact.case import Case

from .reference import Comparison

MODULUS, RADIUS, CONTACT, COEFFICIENT = 1e11, 1e-2, 1e-4, 1e-14
EFFECTIVE = MODULUS / 2  # E* of two bodies with nu = 0, and the same number for shear
APPROACH = CONTACT**2 / RADIUS  # of Hertz's contact with that radius
LOAD = 4 / 3 * EFFECTIVE * CONTACT**3 / RADIUS


def _cycles(nodes: int, mu: float, press: dict[str, float], shift: float, **wear: Any) -> Any:
    """Return the cycles of a sphere, nu = 0, that is shifted to and fro."""
    body = {"young_modulus": MODULUS, "poisson_ratio": 0.0}
    cycle: Sequence[dict[str, float]] = [
        {"shift_x": shift, "steps": 2},
        {"shift_x": -shift, "steps": 4},
        {"shift_x": 0.0, "steps": 2},
    ]
    case = Case(
        body_1=body | {"surface": {"shape": "sphere", "radius": RADIUS}},
        body_2=body,
        nodes_in_radius=nodes,
        friction_coefficient=mu,
        loads=[press | {"shift_x": 0.0}, {"label": "fretting", "path": cycle}],
        wear={"coefficient_1": COEFFICIENT, "cycle": "fretting"} | wear,
    )
    result = case.run()
    data = result.dataset.isel(step=result.dataset["wear_cycles"].values >= 0)
    return data.assign_attrs(lattice=result.lattice)


def _volume(found: Comparison, case: str, mu: float, cycles: Any) -> None:
    spent = (cycles["dissipated_energy"][-1] - cycles["dissipated_energy"][0]).item()
    ratio = cycles["wear_volume"][-1].item() / (COEFFICIENT / mu * spent)
    found.add(case, "V mu/(k E)", "-", ratio, analytic=1.0, absolute=1e-13)


def wear() -> Comparison:
    """Limiting shape (V7) and flat of a sphere (V8)."""
    found = Comparison()
    mu, c = 0.5, 0.6 * CONTACT
    case = "partial slip, c = 0.6 a, 24 spacings in a"
    shift = mu * (APPROACH - c**2 / RADIUS)
    cycles = _cycles(24, mu, {"approach": APPROACH}, shift, cycles=30_000_000, tolerance=0.1)
    last = cycles.isel(step=-1)
    limit = 2 * EFFECTIVE * (APPROACH * c - c**3 / (3 * RADIUS))
    found.add(case, "P", "N", float(last["normal_load"]), analytic=limit, relative=0.01)
    r, p = np.hypot(last["x"], last["y"]).values, last["pressure"].values
    for share in (0.0, 0.5, 0.8):
        ring = abs(r - share * c) < CONTACT / 24
        exact = EFFECTIVE / math.pi * _pressure(r[ring], c)
        found.add(
            f"{case}, r = {share:g} c",
            "p",
            "MPa",
            p[ring].mean(),
            analytic=exact.mean(),
            relative=0.01,
        )
    beyond = p[r > c + CONTACT / 24].sum() / p.sum()
    # the surfaces just touch there; load steps of a cycle are solved to a hundredth of wear.tolerance
    found.add(f"{case}, a spacing beyond c", "load/P", "-", float(beyond), analytic=0.0, absolute=1e-4)
    depth, spacing = last["worn_depth"].values, float(last.attrs["lattice_spacing"])
    disc = (depth == 0.0) & (r < c + spacing)
    pair = ElasticPair.from_materials(MODULUS, 0.0, MODULUS, 0.0)
    rigid = NormalContact(cycles.attrs["lattice"], pair, last["initial_gap"].values, disc, rim_warning=False)
    touching = np.where(disc, 0.0, np.maximum(-rigid.solve(approach=APPROACH).gap, 0.0))
    by_jumps = abs(depth - touching).max() / depth.max()
    found.add(
        f"{case}, all nodes", "depth less the lattice's limit", "-", by_jumps, analytic=0.0, absolute=0.01
    )
    away = r > c + 2.0 * spacing
    off = abs(depth[away] - _depth(r[away], c)).max() / depth.max()
    found.add(f"{case}, 2 spacings beyond c", "depth less (V7)", "-", off, analytic=0.0, absolute=0.01)
    _volume(found, case, mu, cycles)

    mu, case = 0.3, "gross slip, 10 spacings in a"
    cycles = _cycles(10, mu, {"normal_load": LOAD}, 6 * APPROACH, cycles=90_000, tolerance=0.1)
    last = cycles.isel(step=-1)
    volume = float(last["wear_volume"])
    radius = brentq(
        lambda a: math.pi * a**4 / (4 * RADIUS) - 4 * LOAD * a / (3 * math.pi * EFFECTIVE) - volume,
        CONTACT,
        9 * CONTACT,
    )
    pressure = LOAD / (math.pi * radius**2)
    depth = radius**2 / (2 * RADIUS) + (4 / math.pi - 2) * pressure * radius / EFFECTIVE
    found.add(case, "largest depth", "um", float(last["max_worn_depth"]), analytic=depth, relative=0.01)
    fit = float(last["contact_radius_fit"])
    found.add(case, "radius of the flat", "um", fit, analytic=radius, relative=0.03)
    _volume(found, case, mu, cycles)
    return found


def _pressure(r: Any, c: float) -> Any:
    """Return the limiting pressure over E*/pi, (V7)."""
    return (APPROACH - c**2 / RADIUS) / np.sqrt(c**2 - r**2) + 2 / RADIUS * np.sqrt(c**2 - r**2)


def _depth(r: Any, c: float) -> Any:
    """Return the limiting depth beyond the disc that sticks, (V7)."""
    angle, root = np.arcsin(c / r), np.sqrt(r**2 - c**2)
    gap = (r**2 * angle - c * root) / np.pi / RADIUS + APPROACH * (1.0 - 2.0 * angle / np.pi)
    return np.maximum(gap - r**2 / (2.0 * RADIUS), 0.0)
