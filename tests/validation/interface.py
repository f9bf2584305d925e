"""Checks of contacts with a compliant interface."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np

from hexcontact import analytic
from hexcontact.case import Case
from hexcontact.core.lattice import Lattice

from .reference import Comparison, Known

TABLE = Path(__file__).parents[1] / "reference" / "interface.csv"
SPACINGS = 0.05, 0.025


def spheres() -> Comparison:
    """Approach and largest pressure of the reference table; the first order where it holds."""
    found = Comparison()
    hertz = analytic.hertz_ellipse(1.0, np.eye(2), normal_load=4 / 3)
    with TABLE.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    for row in rows:
        c, m, uncertainty = (float(row[name]) for name in ("c", "m", "uncertainty"))
        coarse, fine = (_solved(c, m, spacing) for spacing in SPACINGS)
        approach, peak = ((4 * b - a) / 3 for a, b in zip(coarse, fine, strict=True))
        case = f"c = {c:g}, m = {m:g}"
        for name, value, scale in (("delta", approach, 1.0), ("p_max/p0", peak, hertz.max_pressure)):
            known = Known(reference=float(row[name]), uncertainty=uncertainty)
            found.add(case, name, "-", value / scale, row=known, absolute=4e-5)
        added = m / (m + 1) * (hertz.max_pressure / c) ** (1 / m)
        if added < 6e-3:
            found.add(f"{case}, (C6)", "delta", "-", approach, analytic=hertz.approach + added, absolute=4e-5)
    return found


def flats() -> Comparison:
    """Flats as good as rigid: all of the layer gives way alike, and slides at its limit."""
    found = Comparison()
    c, depth, far = 2.0, 0.1, 1.0
    for m, m_t, limit in ((1.0, 1.0, 0.5), (2.0, 2.0, 0.5), (2.0, 3.0, 3.0), (2.5, 1.0, 0.01)):
        layer = {"coefficient": c, "exponent": m, "friction_coefficient": limit, "friction_exponent": m_t}
        case = Case(
            body_1={"young_modulus": 1e14, "poisson_ratio": 0.0},
            body_2={"rigid": True},
            gap=lambda x, y: np.where(np.hypot(x, y) < 0.85, 0.0, np.inf),
            lattice=Lattice(0.1, -11, -11, 23, 23),
            interface=layer,
            loads=[{"approach": depth}, {"shift_x": far}],
            tolerance=1e-12,
        )
        last = case.run().dataset.isel(step=-1)
        area, name = float(last["contact_area"]), f"m = {m:g}, m_t = {m_t:g}"
        carried = float(last["normal_load"]) / (area * c)
        found.add(name, "P/(A c)", "-", carried, analytic=depth**m, relative=1e-9)
        slid = float(last["tangential_load_x"]) / (area * limit)
        found.add(name, "Q/(A c_t)", "-", slid, analytic=depth**m_t, relative=1e-9)
    return found


def stiff_limit() -> Comparison:
    """Convergence to unilateral contact with Coulomb friction as the layer stiffens."""
    found = Comparison()
    friction = {"friction": {"coefficient": 0.3}}
    rigid = _sheared(friction)
    for m in (1.0, 2.0):
        for exponent in (2, 4, 6, 8):
            layer = _sheared(friction | {"interface": {"exponent": m, "coefficient": 10.0**exponent}})
            first = m / (m + 1) * (2 / np.pi / 10.0**exponent) ** (1 / m)
            for name, unit in STIFF.items():
                found.add(
                    f"m = {m:g}, c = 1e{exponent}",
                    f"{name} over that without a layer, - 1",
                    unit,
                    float(layer[name] / rigid[name] - 1),
                    analytic=0.0,
                    # (C6) of the approach; what else there is follows it within these factors
                    absolute=FACTORS[name] * first,
                )
    own = _sheared(
        {"interface": {"exponent": 2.0, "coefficient": 1e3, "friction_coefficient": 300.0}},
    )
    same = _sheared(friction | {"interface": {"exponent": 2.0, "coefficient": 1e3}})
    for name, unit in STIFF.items():
        ratio = float(own[name] / same[name])
        found.add("c_t = μ c, m_t = m", f"{name} over that with μp", unit, ratio, analytic=1.0, relative=1e-7)
    return found


STIFF = {"approach": "-", "max_pressure": "-", "shift_x": "-", "stick_area_fit": "-"}
FACTORS = {"approach": 1.1, "max_pressure": 7.0, "shift_x": 3.0, "stick_area_fit": 5.0}


def _sheared(laws: dict[str, Any]) -> Any:
    """Return the end of the history of a sphere that is pressed and sheared by 0.4 mu P."""
    load = [{"normal_load": 4 / 3}, {"tangential_load_x": 0.16, "steps": 2}]
    case = _sphere(0.05) | {"load": load} | laws
    return Case.from_dict(case).run().dataset.isel(step=-1)


def _solved(c: float, m: float, spacing: float) -> tuple[float, float]:
    """Return approach and largest pressure of the sphere on a layer."""
    case = _sphere(spacing) | {"interface": {"exponent": m, "coefficient": c}}
    last = Case.from_dict(case).run().dataset.isel(step=-1)
    return float(last["approach"]), float(last["max_pressure"])


def _sphere(spacing: float) -> dict[str, Any]:
    """Return the sphere of the reference table."""
    return {
        "body": {
            "1": {"young_modulus": 1.0, "poisson_ratio": 0.0, "surface": {"shape": "sphere", "radius": 1.0}},
            "2": {"rigid": True},
        },
        "grid": {"spacing": spacing},
        "solver": {"tolerance": 1e-11},
        "load": [{"normal_load": 4 / 3}],
    }
