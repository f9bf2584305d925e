"""Checks of windows that repeat: waves, an asperity far from the next, rough surfaces."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from hexcontact.case import Case
from hexcontact.core.lattice import Lattice
from hexcontact.deck.rough import Rough
from hexcontact.deck.surfaces import FormulaSurface

from .reference import Comparison, Known
from .runs import Array

STEEL: dict[str, Any] = {"young_modulus": 210e9, "poisson_ratio": 0.3}
E_STAR = 210e9 / (2 * (1 - 0.3**2))
WAVE, HEIGHT = 1e-3, 1e-6  # m
TOLERANCE = 1e-10  # of the solver

# Mean gap over the height by share of the load of complete contact: a spectral program, 512 x 512 and more.
SQUARE = {0.03: 0.66068, 0.1: 0.384750, 0.3: 0.124881, 0.5: 0.045078, 0.7: 0.011131, 0.9: 0.000651}
PEAKS = {0.03: 0.6019, 0.1: 0.8839, 0.3: 1.2392, 0.5: 1.4793, 0.7: 1.6951, 0.9: 1.8997}  # of p_max/p*
RECTANGLE = {0.03: 0.65512, 0.1: 0.38049, 0.2: 0.2051, 0.3: 0.12715, 0.5: 0.04615, 0.7: 0.01142, 0.9: 0.00067}


def _waves(expression: str, sides: tuple[float, float], nodes: tuple[int, int], pressure: float) -> Any:
    """Return the last load step of waves on a rectangle under a mean pressure."""
    lattice = Lattice(
        sides[0] / nodes[0],
        -nodes[1] // 2,
        -nodes[0] // 2,
        nodes[1],
        nodes[0],
        cell_ratio=sides[1] * nodes[0] / (nodes[1] * sides[0]),
        cell_angle=math.pi / 2,
        periodic=True,
    )
    case = Case(
        body_1={**STEEL, "surface": FormulaSurface(expression=expression)},
        body_2=STEEL,
        lattice=lattice,
        loads={"mean_pressure": pressure},
        tolerance=TOLERANCE,
    )
    return case.run().dataset.isel(step=-1)


def westergaard(nodes: int = 128, shares: Sequence[float] = (0.05, 0.1, 0.3, 0.5, 0.7, 0.9)) -> Comparison:
    """Waves in one direction: largest pressure and width of the contact; complete contact."""
    found = Comparison()
    full = math.pi * E_STAR * HEIGHT / WAVE
    wave = f"{HEIGHT}*(1 - cos(2*pi*x/{WAVE}))"
    for share in shares:
        last = _waves(wave, (WAVE, WAVE / 8), (nodes, nodes // 8), share * full)
        where = f"p/p* = {share:g}"
        peak = 2.0 * math.sqrt(share)
        found.add(where, "p_max/p*", "-", float(last["max_pressure"]) / full, analytic=peak, relative=5e-4)
        width = float((last["pressure"].values[0] > 0.0).mean())
        exact = 2.0 / math.pi * math.asin(math.sqrt(share))
        found.add(where, "2a/λ, nodes", "-", width, analytic=exact, absolute=1.5 / nodes)
        half = math.pi * exact / 2.0
        angle = np.pi * last["x"].values[0] / WAVE
        p = 2.0 * share * np.cos(angle) * np.sqrt(np.maximum(math.sin(half) ** 2 - np.sin(angle) ** 2, 0.0))
        error = last["pressure"].values[0] / full - p / math.sin(half) ** 2
        rms = float(np.sqrt(np.mean(error**2)))
        found.add(where, "rms error of p/p*", "-", rms, analytic=0.0, absolute=5e-3)
    last = _waves(wave, (WAVE, WAVE / 8), (nodes, nodes // 8), 1.5 * full)
    exact_p = 1.5 + np.cos(2.0 * np.pi * last["x"].values / WAVE)
    error = float(np.abs(last["pressure"].values / full - exact_p).max())
    found.add("p/p* = 1.5", "max error of p/p*", "-", error, analytic=0.0, absolute=5e-4)
    found.notes.append(f"h = Δ0 (1 - cos 2πx/λ), {nodes} nodes in a wave; p* = πE*Δ0/λ.")
    return found


def waves(nodes: Sequence[int] = (64, 128)) -> Comparison:
    """Two cosines, on a square and on a rectangle, between a light load and complete contact."""
    found = Comparison()
    square = f"{HEIGHT}*(1 - cos(2*pi*x/{WAVE})*cos(2*pi*y/{WAVE}))"
    long = math.sqrt(3.0) * WAVE
    flat = f"{HEIGHT}*(1 - cos(2*pi*x/{WAVE})*cos(2*pi*y/{long}))"
    for count in nodes:
        allowed = 1e-3 * (64 / count) ** 1.7  # of the height: 1e-3 at 64 nodes, 3e-4 at 128
        full = math.sqrt(2.0) * math.pi * E_STAR * HEIGHT / WAVE
        for share, gap in SQUARE.items():
            last = _waves(square, (WAVE, WAVE), (count, count), share * full)
            where = f"square, {count} nodes, p/p* = {share:g}"
            known = Known(reference=gap)
            found.add(
                where, "mean gap/Δ0", "-", float(last["mean_gap"]) / HEIGHT, row=known, absolute=allowed
            )
            known = Known(reference=PEAKS[share])
            peak = float(last["max_pressure"]) / full
            found.add(where, "p_max/p*", "-", peak, row=known, relative=4e-3 * (64 / count) ** 1.7)
        full = 2.0 * math.pi / math.sqrt(3.0) * E_STAR * HEIGHT / WAVE
        for share, gap in RECTANGLE.items():
            last = _waves(flat, (WAVE, long), (count, count), share * full)
            where = f"1 x √3, {count} nodes, p/p* = {share:g}"
            known = Known(reference=gap)
            found.add(
                where, "mean gap/Δ0", "-", float(last["mean_gap"]) / HEIGHT, row=known, absolute=allowed
            )
    found.notes.append(
        "h = Δ0 (1 - cos 2πx/λx cos 2πy/λy); p* = E*kΔ0/2 of complete contact (Johnson, Greenwood, "
        "Higginson). Reference: a spectral program with trigonometric functions in place of pyramids."
    )
    return found


def asperity(cells: Sequence[int] = (8, 16, 32), spacings: int = 12) -> Comparison:
    """A sphere in cells of several contact radii beside the sphere alone."""
    found = Comparison()
    radius, a = 10e-3, 0.1e-3
    load = 4.0 * E_STAR * a**3 / (3.0 * radius)

    def pressed(number: int, periodic: bool) -> Array:
        n = number * spacings
        lattice = Lattice(a / spacings, -n // 2, -n // 2, n, n, cell_angle=math.pi / 2, periodic=periodic)
        case = Case(
            body_1=STEEL,
            body_2=STEEL,
            gap=lambda x, y: (x * x + y * y) / (2.0 * radius),
            lattice=lattice,
            normal_load=load,
            tolerance=TOLERANCE,
        )
        p: Array = case.run().dataset["pressure"].values[-1]
        return p[n // 2 - 16 : n // 2 + 16, n // 2 - 16 : n // 2 + 16]

    alone = pressed(min(cells), periodic=False)
    change = {}
    for number in cells:
        field = pressed(number, periodic=True)
        change[number] = float(np.abs(field - alone).max() / alone.max())
        off = float(field.max() / alone.max())
        found.add(
            f"L = {number} a", "p_max over that alone", "-", off, analytic=1.0, absolute=3.2 / number**3
        )
        # nodes beside the edge change most, since p falls there like a root
        found.add(
            f"L = {number} a",
            "max change of p/p_max",
            "-",
            change[number],
            analytic=0.0,
            absolute=5.0 / number**3,
        )
    for small, large in itertools.pairwise(cells):
        ratio = change[small] / change[large]
        found.add(f"L = {small} a to {large} a", "change falls by", "-", ratio, analytic=8.0, relative=0.1)
    found.notes.append("The influence of the others falls like (a/L)³.")
    return found


def _rough(nodes: int, pressure: float, seed: int) -> Any:
    """Return the last load step of a rough surface with 16 spacings in its shortest wave at 256 nodes."""
    side = 0.256e-3
    surface = Rough(hurst=0.8, shortest=16e-6, longest=128e-6, rms_slope=0.05, seed=seed)
    case = Case(
        body_1={**STEEL, "surface": surface},
        body_2=STEEL,
        boundary="periodic",
        extent=(side, side),
        nodes_across=nodes,
        loads={"mean_pressure": pressure * 0.05 * E_STAR},
    )
    return case.run().dataset.isel(step=-1)


def rough(
    nodes: Sequence[int] = (64, 128, 256, 512),
    pressures: Sequence[float] = (0.01, 0.03, 0.1),
    seeds: Sequence[int] = (1, 2, 3),
) -> Comparison:
    """Areas with their error bars beside the twice finer lattice; mean gap; slope of area over load."""
    found = Comparison()
    inside = []
    for seed in seeds:
        for pressure in pressures:
            solved = [_rough(count, pressure, seed) for count in nodes]
            for count, coarse, fine in zip(nodes, solved, solved[1:], strict=False):
                where = f"seed {seed}, p/E*h' = {pressure:g}, {count} nodes"
                bar = float(coarse["contact_area_error"])
                off = float(fine["contact_area"] - coarse["contact_area"]) / bar
                inside.append(abs(off) <= 1.0)
                found.add(
                    where,
                    "change of the area on the finer lattice/error bar",
                    "-",
                    off,
                    analytic=0.0,
                    absolute=1.0,
                )
            last, before = solved[-1], solved[-2]
            gap = float(last["mean_gap"])
            change = abs(float(before["mean_gap"]) / gap - 1.0)
            where = f"seed {seed}, p/E*h' = {pressure:g}"
            about = f"mean gap, change from {nodes[-2]} to {nodes[-1]} nodes"
            found.add(where, about, "-", change, analytic=0.0, absolute=2.0 / nodes[-1])
            area = float(last["contact_area"]) / (0.256e-3) ** 2
            found.add(where, "A/A0 E*h'/p", "-", area / pressure, analytic=2.2, absolute=0.4)
    found.add(
        "all", "share of areas within the error bar", "-", float(np.mean(inside)), analytic=1.0, absolute=0.05
    )
    found.notes.append(
        "H = 0.8, wavelengths from 16 to 128 µm in a period of 256 µm, slope h' = 0.05, three seeds. "
        "A/A0 = κ p/(E*h') with κ from 2 to 2.2 in numerical work, 1.6 and 2.5 in two theories (Hyun and "
        "Robbins, 2007)."
    )
    return found


def superposed(nodes: int = 128, parts: Sequence[float] = (0.3, 0.6, 0.9)) -> Comparison:
    """A rough surface, pressed, then sheared along x: ν = 0, so that superposition is exact."""
    found = Comparison()
    body: dict[str, Any] = {"young_modulus": 210e9, "poisson_ratio": 0.0}
    modulus = 210e9 / 2.0
    surface = Rough(hurst=0.8, shortest=16e-6, longest=128e-6, rms_slope=0.05, seed=4)
    mu, pressure = 0.3, 0.05 * 0.05 * modulus
    grid = {"boundary": "periodic", "extent": (0.256e-3, 0.256e-3), "nodes_across": nodes, "tolerance": 1e-11}

    def case(**given: Any) -> Any:
        return (
            Case(body_1={**body, "surface": surface}, body_2=body, **grid, **given)
            .run()
            .dataset.isel(step=-1)
        )

    for part in parts:
        sheared = case(
            friction_coefficient=mu,
            loads=[{"mean_pressure": pressure}, {"mean_traction_x": part * mu * pressure}],
        )
        whole, rest = (case(loads={"mean_pressure": share * pressure}) for share in (1.0, 1.0 - part))
        scale = mu * float(whole["max_pressure"])
        exact = mu * (whole["pressure"].values - rest["pressure"].values)
        error = float(np.abs(sheared["traction_x"].values - exact).max()) / scale
        where = f"Q/μP = {part:g}"
        found.add(where, "max error of q/(μ p_max)", "-", error, analytic=0.0, absolute=1e-9)
        error = float(np.abs(sheared["traction_y"].values).max()) / scale
        found.add(where, "max of q_y/(μ p_max)", "-", error, analytic=0.0, absolute=1e-9)
        shift = mu * float(whole["approach"] - rest["approach"])
        found.add(where, "shift", "um", float(sheared["shift_x"]), analytic=shift, relative=1e-8)
    found.notes.append(f"{nodes} x {nodes} nodes, ν = 0 on both bodies, μ = 0.3: q = μ(p(P) - p(P - Q/μ)).")
    return found


def _sheared(nodes: int, share: float) -> Any:
    """Return the last load step of a rough surface on a rigid flat, pressed to 2 % of E*, then sheared."""
    surface = Rough(hurst=0.8, shortest=16e-6, longest=128e-6, rms_slope=0.05, seed=2)
    pressure, mu = 5e8, 0.3
    case = Case(
        body_1={**STEEL, "surface": surface},
        body_2={"rigid": True},
        friction_coefficient=mu,
        boundary="periodic",
        extent=(0.256e-3, 0.256e-3),
        nodes_across=nodes,
        loads=[{"mean_pressure": pressure, "steps": 2}, {"mean_traction_x": share * mu * pressure}],
    )
    return case.run().dataset.isel(step=-1)


def sheared(nodes: Sequence[int] = (128, 256, 512), share: float = 0.6) -> Comparison:
    """Unlike bodies, pressed and sheared: each lattice beside one twice as fine."""
    found = Comparison()
    solved = [_sheared(count, share) for count in nodes]
    for count, coarse, fine in zip(nodes, solved, solved[1:], strict=False):
        for name in ("shift_x", "dissipated_energy", "stick_area", "mean_gap"):
            ratio = float(coarse[name]) / float(fine[name])
            about = f"{name} over that of {2 * count} nodes"
            found.add(f"{count} nodes", about, "-", ratio, analytic=1.0, absolute=6.0 / count)
    found.notes.append(
        f"A rough steel surface on a rigid flat, μ = 0.3, Q = {share:g} μP, "
        f"{solved[-1]['operator_applications'].item():.0f} operator applications in the last load step on "
        f"{nodes[-1]} x {nodes[-1]} nodes."
    )
    return found
