"""Checks: a dissimilar sphere pressed with friction and let go again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hexcontact.deck.surfaces import Sphere

from .reference import Comparison, reference
from .runs import DIGITS, bodies, hertz_of, press, run

LOAD = 4.0 / 3.0  # E* = 1, R = 1: a_Hertz = 1
MESH = 40


@dataclass(frozen=True)
class Path:
    """A row of the reference table: materials, friction, load steps up to the largest load."""

    beta: float
    gamma: float
    mu: float
    steps: int

    @property
    def case(self) -> str:
        """How the reference table calls it."""
        return f"normal unloading beta={self.beta:g} mu={self.mu:g}"


PATHS = (Path(-0.189, 0.4705882, 0.1, 40), Path(0.25, 0.4, 0.3, 20))
TENTHS = (9, 8, 5)  # of the cube root of the load, on the way back


def unloading(paths: Sequence[Path] = PATHS) -> Comparison:
    """Press in steps of equal radius and go back the same way; slip reverses from the edge inwards."""
    found = Comparison()
    for path in paths:
        back = path.steps // 2  # to P/8
        made = run(
            *bodies(path.beta, path.gamma, Sphere(radius=1.0)),
            spacing=1.0 / MESH,
            friction_coefficient=path.mu,
            loads=[press(LOAD, path.steps), press(LOAD / 8.0, back)],
            every=path.steps // 10,
        )
        hertz = hertz_of(made.pair, LOAD, 1.0)
        where = f"β = {path.beta:g}, μ = {path.mu:g}"
        for way, tenth in (("load", 10), *(("unload", tenth) for tenth in TENTHS)):
            number = path.steps + (10 - tenth) * path.steps // 10
            state, share = made[number], 0.1 * tenth
            case = f"{path.case}: {way} P/Pmax={share**3:.3f} (steps {path.steps}, P_k ~ (k/N)^3)"
            radial = state.radial() / hertz.max_pressure
            nodes = 2.0 * state.two_nodes * state.stick_radius / state.area_radius
            values = {
                "p_max/p_Hertz(Pmax)": state.peak / hertz.max_pressure,
                "delta/delta_Hertz(Pmax)": state["approach"] / hertz.approach,
                "stick area fraction": state.stick_fraction,
            }
            if way == "unload":
                values["max radial traction/p_Hertz(Pmax)"] = float(radial.max())
                values["min radial traction/p_Hertz(Pmax)"] = float(radial.min())
            for quantity, value in values.items():
                row = reference(case, quantity)
                name = quantity.replace("(Pmax)", "").replace("delta/delta", "δ/δ")
                found.add(
                    f"{where}, {way}, P/P_max = {share**3:.3f}",
                    name,
                    "-",
                    value,
                    row=row,
                    absolute=nodes if quantity == "stick area fraction" else DIGITS,
                )
        found.add(where, f"time, {len(made)} steps", "s", made.seconds)
    found.notes.append(
        f"E* = 1, R = 1, a/l_e = {MESH}; P_k = P (k/N)³ up and down. Radial traction on body 1, outwards; "
        "its sign turns in the outer ring on the way back. p_Hertz and δ_Hertz belong to P_max."
    )
    return found
