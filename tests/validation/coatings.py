"""Checks of bodies with coatings."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hexcontact import analytic
from hexcontact.case import Case

from .reference import Comparison, Known

TABLE = Path(__file__).parents[1] / "reference" / "coated_sphere.csv"
RADIUS, A, NU = 1.0, 0.01, 0.3  # m, m
SPACINGS = 40


def sphere() -> Comparison:
    """A rigid sphere on a layer, 40 spacings in the contact radius, against a Fredholm equation."""
    found, young = Comparison(), 1e9
    hertz = analytic.hertz_sphere(young / (1 - NU**2), RADIUS, contact_radius=A)
    for ratio, t, load, approach, pressure in np.loadtxt(TABLE, delimiter=",", skiprows=4):
        layer = {"thickness": t * A, "young_modulus": young, "poisson_ratio": NU}
        base = {"young_modulus": young / ratio, "poisson_ratio": NU} if ratio else {"rigid": True}
        case = Case(
            body_1={**base, "coating": [layer]},
            body_2={"rigid": True, "surface": {"shape": "sphere", "radius": RADIUS}},
            spacing=A / SPACINGS,
            normal_load=load * hertz.normal_load,
        )
        last = case.run().dataset.isel(step=-1)
        rows, cols = last.sizes["row"], last.sizes["col"]
        center = float(last["pressure"].values[rows // 2, cols // 2])
        name = f"G1/G2 = {ratio:g}, t/a = {t:g}"
        radius = float(last["contact_radius_fit"]) / A
        found.add(name, "a from p² at the edge", "-", radius, row=Known(reference=1.0), relative=1e-3)
        moved = float(last["approach"]) / hertz.approach
        found.add(name, "delta/delta_H", "-", moved, row=Known(reference=approach), relative=1e-3)
        peak = center / hertz.max_pressure
        found.add(name, "p(0)/p_H", "-", peak, row=Known(reference=pressure), relative=1e-3)
    return found
