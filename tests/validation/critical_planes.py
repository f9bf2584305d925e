"""Critical planes of random histories against a search of its own: a spread of normals, refined locally.

`cd tests; python -m validation.critical_planes [number of histories [seed]]` prints the table.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from hexcontact import fatigue
from hexcontact.arrays import Array

TIMES = 12
YOUNG, NU, SLOPE, SHEAR, YIELD = 72e9, 0.33, 0.3, 27e9, 300e6
SPREAD, STARTS, HALVINGS = 1000, 6, 10
_TRIPLES = np.array(list(itertools.combinations(range(TIMES), 3))).T


def histories(number: int, seed: int = 1) -> tuple[Array, list[str]]:
    """Return stress tensors (number, times, 3, 3) of several kinds (Pa), and their kinds."""
    rng = np.random.default_rng(seed)
    phase = 2.0 * np.pi * np.arange(TIMES) / TIMES
    one, two, mean = rng.normal(size=(3, number, 1, 3, 3))
    ellipse = one * np.cos(phase)[:, None, None] + two * np.sin(phase)[:, None, None]
    noise = rng.normal(size=(number, TIMES, 3, 3))
    simple = np.zeros_like(noise)
    simple[..., 0, 0] = np.sin(phase) + rng.normal(size=(number, 1))
    simple[..., 0, 1] = np.cos(phase + rng.choice([0.0, 0.3], size=(number, 1))) * rng.uniform(
        0.0, 1.5, (number, 1)
    )
    uniaxial = np.zeros_like(noise)
    uniaxial[..., 2, 2] = np.cos(phase) + rng.uniform(-1.0, 1.0, (number, 1))
    found = {
        "ellipse": ellipse,
        "ellipse and mean": ellipse + mean,
        "under pressure": ellipse - rng.uniform(1.0, 3.0, (number, 1, 1, 1)) * np.eye(3),
        "noise": noise,
        "tension and shear": simple,
        "tension": uniaxial,
    }
    kinds = [list(found)[k % len(found)] for k in range(number)]
    stress = 1e8 * np.array([found[kind][k] for k, kind in enumerate(kinds)])
    turns = Rotation.random(number, random_state=seed).as_matrix()[:, None]
    return turns @ (stress + np.swapaxes(stress, -1, -2)) @ np.swapaxes(turns, -1, -2), kinds


def smith_watson_topper(stress: Array, normals: Array) -> Array:
    """Return the parameter on some planes, (normal,)."""
    normal = np.einsum("pi,tij,pj->pt", normals, stress, normals)
    strain = (1.0 + NU) * normal - NU * np.trace(stress, axis1=1, axis2=2)
    return np.asarray(np.maximum(normal.max(1), 0.0) * np.ptp(strain, axis=1) / (2.0 * YOUNG))


def findley(stress: Array, normals: Array) -> Array:
    """Return the parameter on some planes, (normal,)."""
    amplitude, highest = _shear_and_normal(stress, normals)
    return amplitude + SLOPE * highest


def fatemi_socie(stress: Array, normals: Array) -> Array:
    """Return the parameter on some planes, (normal,)."""
    amplitude, highest = _shear_and_normal(stress, normals)
    return amplitude / SHEAR * (1.0 + SLOPE * np.maximum(highest, 0.0) / YIELD)


def _shear_and_normal(stress: Array, normals: Array) -> tuple[Array, Array]:
    """Return shear amplitude and largest normal stress on some planes.

    The smallest circle around points is the largest of those around three of them (Helly's theorem).
    """
    traction = np.einsum("tij,pj->pti", stress, normals)
    normal = np.einsum("pti,pi->pt", traction, normals)
    shear = traction - normal[..., None] * normals[:, None]
    square = (shear**2).sum(-1)
    distance = square[:, :, None] + square[:, None] - 2.0 * shear @ np.swapaxes(shear, 1, 2)
    i, j, k = _TRIPLES
    a, b, c = distance[:, i, j], distance[:, j, k], distance[:, i, k]
    longest, total = np.maximum(np.maximum(a, b), c), a + b + c
    area = 2.0 * (a * b + b * c + c * a) - (a * a + b * b + c * c)  # 16 times its square
    with np.errstate(divide="ignore", invalid="ignore"):
        radius = np.where(2.0 * longest >= (1.0 - 1e-9) * total, 0.25 * longest, a * b * c / area)
    return np.sqrt(radius.max(1)), normal.max(1)


_PARAMETERS: dict[str, tuple[Callable[[Array, Array], Array], Callable[[Array], fatigue.CriticalPlane]]] = {
    "Smith, Watson & Topper": (smith_watson_topper, lambda h: fatigue.smith_watson_topper(h, YOUNG, NU)),
    "Findley": (findley, lambda h: fatigue.findley(h, SLOPE)),
    "Fatemi & Socie": (fatemi_socie, lambda h: fatigue.fatemi_socie(h, SLOPE, SHEAR, YIELD)),
}


def searched(parameter: Callable[[Array, Array], Array], stress: Array) -> float:
    """Return the largest value of a spread of normals, the best of which are refined by squares of points."""
    height = (np.arange(SPREAD) + 0.5) / SPREAD
    azimuth = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(SPREAD)
    ring = np.sqrt(1.0 - height**2)
    normals = np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), height], axis=1)
    values = parameter(stress, normals)
    starts = []
    for k in np.argsort(values)[::-1]:
        if all(abs(normals[k] @ start) < np.cos(0.05) for start in starts):
            starts.append(normals[k])
        if len(starts) == STARTS:
            break
    centers, angle = np.array(starts), 0.04
    best = np.array([values.max()] * len(centers))
    steps = np.array(list(itertools.product((-1.0, -0.5, 0.0, 0.5, 1.0), repeat=2)))
    for _ in range(HALVINGS):
        across = np.cross(centers, np.eye(3)[abs(centers).argmin(1)])
        across /= np.linalg.norm(across, axis=1)[:, None]
        axes = np.stack([across, np.cross(centers, across)], axis=1)
        trials = centers[:, None] + angle * np.einsum("ks,csi->cki", steps, axes)
        trials /= np.linalg.norm(trials, axis=2)[..., None]
        found = parameter(stress, trials.reshape(-1, 3)).reshape(trials.shape[:2])
        centers, best = trials[np.arange(len(trials)), found.argmax(1)], found.max(1)
        angle *= 0.5
    return float(max(best.max(), values.max()))


def _listed(stress: Array) -> Array:
    """Return tensors as histories (..., 6)."""
    return np.stack([stress[..., i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))], -1)


def shortfalls(number: int, seed: int = 1) -> dict[str, dict[str, Array]]:
    """Return, by parameter, kinds of history and the values that are missing, as shares of the value.

    ``missing`` compares with the search of this file, ``turned`` with the same history about other axes,
    ``plane`` with the parameter on the plane that was found.
    """
    stress, kinds = histories(number, seed)
    turns = Rotation.random(number, random_state=seed + 1).as_matrix()[:, None]
    other = turns @ stress @ np.swapaxes(turns, -1, -2)
    table: dict[str, dict[str, Array]] = {}
    for name, (parameter, found_by) in _PARAMETERS.items():
        plane, turned = found_by(_listed(stress)), found_by(_listed(other))
        here = np.array([parameter(s, n[None])[0] for s, n in zip(stress, plane.normal, strict=True)])
        best = np.array([searched(parameter, s) for s in stress])
        scale = np.maximum(np.maximum(abs(best), abs(plane.value)), 1e-30)
        table[name] = {
            "kind": np.array(kinds),
            "missing": (best - plane.value) / scale,
            "turned": abs(turned.value - plane.value) / scale,
            "plane": abs(here - plane.value) / scale,
        }
    return table


def main(number: int = 10_000, seed: int = 1) -> None:
    """Print the largest shares that are missing."""
    print("| parameter | histories | missing | about other axes |\n|---|---|---|---|")
    for name, found in shortfalls(number, seed).items():
        for kind in dict.fromkeys(found["kind"].tolist()):
            some = found["kind"] == kind
            missing, turned = found["missing"][some], found["turned"][some]
            print(f"| {name} | {some.sum()}, {kind} | {missing.max():.1e} | {turned.max():.1e} |")


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:3]))
