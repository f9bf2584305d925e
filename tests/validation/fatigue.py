"""Checks: fatigue parameters of stress paths with closed forms."""

from __future__ import annotations

from math import hypot, sqrt

import numpy as np

from hexcontact import fatigue

from .reference import Comparison

SIGMA = 100e6  # Pa; torsion has half of it
YOUNG, NU, YIELD = 72e9, 0.33, 300e6
SHEAR = YOUNG / (2.0 * (1.0 + NU))
SLOPE = 0.3  # k and alpha of all


def parameters() -> Comparison:
    """Tension, torsion and both a quarter of a cycle apart, about axes that are turned at random."""
    found = Comparison()
    phase = np.linspace(0.0, 2.0 * np.pi, 41)
    rng = np.random.default_rng(5)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    cosine, sine = np.cos(phase), np.sin(phase)
    paths = {
        "tension, R = -1": (SIGMA * cosine, 0.0 * sine),
        "tension, R = 0": (0.5 * SIGMA * (1.0 + cosine), 0.0 * sine),
        "torsion": (0.0 * cosine, 0.5 * SIGMA * cosine),
        "both, 90° apart": (SIGMA * cosine, 0.5 * SIGMA * sine),
    }
    computed = {case: _computed(_turned(*path, turn)) for case, path in paths.items()}
    for case, exact in zip(paths, _closed_forms(), strict=True):
        for (name, value), known in zip(computed[case].items(), exact, strict=True):
            unit = "-" if name == "Fatemi & Socie" else "Pa" if name.startswith("Smith") else "MPa"
            bound = {"Crossland": 1e-12, "Dang Van": 1e-7}.get(name, 1e-5)
            found.add(case, name, unit, value, analytic=known, relative=bound)
    for (name, tension), torsion, wanted in zip(
        computed["tension, R = -1"].items(), computed["torsion"].values(), _ratios(), strict=True
    ):
        found.add("torsion over tension", name, "-", torsion / tension, analytic=wanted, relative=1e-5)
    found.notes.append(
        "100 MPa of tension, 50 MPa of torsion, 40 times of a cycle; E = 72 GPa, ν = 0.33, σ_y = 300 MPa, "
        "k = α = 0.3."
    )
    return found


def _turned(tension: np.ndarray, torsion: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Return the history (times, 6) about turned axes."""
    stress = np.zeros((len(tension), 3, 3))
    stress[:, 0, 0] = tension
    stress[:, 0, 1] = stress[:, 1, 0] = torsion
    stress = turn @ stress @ turn.T
    return np.stack([stress[:, i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))], axis=-1)


def _computed(history: np.ndarray) -> dict[str, float]:
    """Return each parameter of a history."""
    return {
        "Smith, Watson & Topper": float(fatigue.smith_watson_topper(history, YOUNG, NU).value),
        "Findley": float(fatigue.findley(history, SLOPE).value),
        "Fatemi & Socie": float(fatigue.fatemi_socie(history, SLOPE, SHEAR, YIELD).value),
        "Crossland": float(fatigue.crossland(history, SLOPE)),
        "Dang Van": float(fatigue.dang_van(history, SLOPE)),
    }


def _closed_forms() -> list[tuple[float, ...]]:
    """Return the five parameters of each path."""
    s, t, k = SIGMA, 0.5 * SIGMA, SLOPE
    return [
        (
            s**2 / YOUNG,
            0.5 * s * (k + hypot(1.0, k)),
            _sheared_by_tension(s, s),
            s * (1 / sqrt(3) + k / 3),
            s * (0.5 + k / 3),
        ),
        (
            0.5 * s**2 / YOUNG,
            0.5 * s * (k + hypot(0.5, k)),
            _sheared_by_tension(0.5 * s, s),
            s * (0.5 / sqrt(3) + k / 3),
            s * (0.25 + k / 3),
        ),
        ((1 + NU) * t**2 / YOUNG, t * hypot(1.0, k), _sheared_by_torsion(t), t, t),
        # tau = sigma/2: the shear on planes that contain z stays sigma/2, the tension is largest across x
        (
            s**2 / YOUNG,
            s * (0.5 + k),
            0.5 * s / SHEAR * (1 + k * s / YIELD),
            s * (1 / sqrt(3) + k / 3),
            s * (0.5 + k / 3),
        ),
    ]


def _ratios() -> tuple[float, ...]:
    """Return the parameters of torsion over those of reversed tension, for half the stress."""
    k = SLOPE
    return (
        (1 + NU) / 4,
        hypot(1, k) / (k + hypot(1, k)),
        _sheared_by_torsion(0.5 * SIGMA) / _sheared_by_tension(SIGMA, SIGMA),
        0.5 / (1 / sqrt(3) + k / 3),
        0.5 / (0.5 + k / 3),
    )


def _sheared_by_tension(amplitude: float, largest: float) -> float:
    """Return Fatemi & Socie's parameter of tension: the largest sin x (a + b cos x), x twice the angle."""
    b = 0.5 * SLOPE * largest / YIELD
    a = 1.0 + b
    cosine = (sqrt(a * a + 8.0 * b * b) - a) / (4.0 * b)
    return 0.5 * amplitude / SHEAR * sqrt(1.0 - cosine**2) * (a + b * cosine)


def _sheared_by_torsion(amplitude: float) -> float:
    """Return Fatemi & Socie's parameter of torsion: the largest cos x (1 + m sin x)."""
    m = SLOPE * amplitude / YIELD
    sine = (sqrt(1.0 + 8.0 * m * m) - 1.0) / (4.0 * m)
    return amplitude / SHEAR * sqrt(1.0 - sine**2) * (1.0 + m * sine)
