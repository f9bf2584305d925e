"""Checks of bodies with coatings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.linalg import expm, schur

from hexcontact import Lattice, analytic
from hexcontact.arrays import Array
from hexcontact.case import Case
from hexcontact.interior import fields

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


def _halves(k: float, shear: float, nu: float) -> list:
    """Waves that fall and rise with the depth: displacements and tractions by Hooke's law and equilibrium."""
    lame = 2 * shear * nu / (1 - 2 * nu)
    stiff = lame + 2 * shear
    # of u_L/i, u_z, sigma_Lz/i and sigma_zz
    change = np.array(
        [
            [0, -k, 1 / shear, 0],
            [lame * k / stiff, 0, 0, 1 / stiff],
            [(stiff - lame**2 / stiff) * k**2, 0, 0, -lame * k / stiff],
            [0, 0, k, 0],
        ]
    )
    return [(schur(change, sort=side)[1][:, :2], change) for side in ("lhp", "rhp")]


def wave_below(k: float, z: float, t: float, top: tuple, base: tuple) -> tuple[float, float]:
    """Stress zz, and LL + TT, of a wave of pressure one."""
    (down, change), (up, _) = _halves(k, *top)
    below, change_below = _halves(k, *base)[0]

    def moved(columns: np.ndarray, change: np.ndarray, depth: float) -> np.ndarray:
        return columns @ expm(columns.T @ change @ columns * depth)

    matrix = np.zeros((6, 6))
    matrix[:2, :2], matrix[:2, 2:4] = down[2:], moved(up, change, -t)[2:]
    matrix[2:, :2], matrix[2:, 2:4], matrix[2:, 4:] = moved(down, change, t), up, -below
    a = np.linalg.solve(matrix, [0, -1, 0, 0, 0, 0])
    state = moved(below, change_below, z - t) @ a[4:]
    (shear, nu) = base
    if z < t:
        state = moved(down, change, z) @ a[:2] + moved(up, change, z - t) @ a[2:4]
        (shear, nu) = top
    along = (nu * state[3] - 2 * shear * k * state[0]) / (1 - nu)
    return state[3], along + nu * (along + state[3])


def axis(
    depths: Sequence[float], t: float, top: tuple[float, float], base: tuple[float, float], n: int = SPACINGS
) -> tuple[Array, Array]:
    """Return computed and known stress zz and xx + yy on the axis below Hertz's pressure on a layer.

    Lengths are over the radius, stresses over the largest pressure; n spacings are in the radius.
    """
    lattice = Lattice(1 / n, -n - 2, -n - 2, 2 * n + 5, 2 * n + 5, cell_angle=math.pi / 2)
    pressure = np.sqrt(np.maximum(1 - lattice.x**2 - lattice.y**2, 0.0))
    loads = np.array([[pressure, 0 * pressure, 0 * pressure]])
    points = [[0.0, 0.0, z] for z in depths]
    _, [stress] = fields.at_points(lattice, loads, 1, [[t, *top], [0.0, *base]], points)
    x, weight = np.polynomial.legendre.leggauss(300)
    k, weight = 50 * (x + 1), 50 * weight
    load = weight * (np.sin(k) - k * np.cos(k)) / k**2
    known = [load @ np.array([wave_below(one, z, t, top, base) for one in k]) for z in depths]
    return np.stack([stress[:, 2], stress[:, 0] + stress[:, 1]], axis=1), np.array(known)


def below() -> Comparison:
    """Stress on the axis in a layer and below it."""
    found = Comparison()
    depths = [0.2, 0.49999, 0.50001, 1.5]
    for ratio in (0.3, 5.0):
        computed, known = axis(depths, 0.5, (ratio, 0.25), (1.0, 0.35))
        for z, one, other in zip(depths, computed, known, strict=True):
            for name, value, expected in zip(("zz", "xx + yy"), one, other, strict=True):
                case = f"G1/G2 = {ratio:g}, t/a = 0.5, z/a = {z:g}"
                row = Known(reference=float(expected))
                found.add(case, f"{name}/p_0", "-", float(value), row=row, absolute=5e-4)
    return found
