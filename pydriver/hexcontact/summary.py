"""Tables for the terminal: what is going to be run, what came out, and how it compares with Hertz."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from .errors import HexcontactError
from .progress import quantity

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from .case import Body, Case
    from .result import Result
    from .surfaces import Surface

History = Mapping[str, Any]
Row = tuple[str, ...]

_MOST_ROWS = 24  # steps shown of a long history
_SHOWN = {
    "normal_load": "N",
    "approach": "m",
    "max_pressure": "Pa",
    "contact_radius": "m",
    "elastic_energy": "J",
}


def console() -> Console:
    """Return the console on standard output: colors on a terminal, plain wide text elsewhere."""
    from rich.console import Console

    width = None if sys.stdout.isatty() else 130
    return Console(highlight=False, markup=False, emoji=False, width=width)


def table(title: str, headers: Sequence[str], rows: Iterable[Row]) -> Table:
    """Return a table of numbers; names and labels are text, which may wrap on a narrow terminal."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    shown = Table(
        title=Text(title, style="bold"), title_justify="left", box=box.SIMPLE_HEAD, show_header=any(headers),
        pad_edge=False,
    )  # fmt: skip
    for header in headers:
        text = header in ("", "label")
        shown.add_column(Text(header), justify="left" if text else "right", no_wrap=not text)
    for row in rows:
        shown.add_row(*map(Text, row))
    return shown


def pairs(title: str, rows: Iterable[Row]) -> Table:
    """Return a table of names and what belongs to them."""
    return table(title, ("", ""), rows)


# --- before the run -------------------------------------------------------------------------------


def case_rows(case: Case) -> list[Row]:
    """Return what would be run."""
    from .solve import memory_needed

    lattice = case.lattice
    span = [lattice.n_col - 1, lattice.n_row - 1] @ abs(lattice.basis)  # the window may be too large to fill
    pressed = [step.z.value for step in case.load_steps if step.z.control == "force"]
    return [
        *((f"body {number}", _body(body)) for number, body in ((1, case.body_1), (2, case.body_2))),
        ("pair", f"E* = {quantity(case.pair.effective_modulus, 'Pa')}, beta = {case.pair.beta:.4g}"),
        ("friction", f"{case.friction_coefficient:g}" if case.solver.algorithm != "frictionless" else "none"),
        ("spacing", quantity(lattice.spacing, "m")),
        (
            "window",
            f"{lattice.n_row} x {lattice.n_col} nodes ({lattice.size:,}), {quantity(span[0], 'm')} x "
            f"{quantity(span[1], 'm')}, {'fixed' if case.window_fixed else 'grows with the contact'}",
        ),
        ("load steps", str(len(case.load_steps))),
        ("largest load", quantity(max(pressed), "N") if pressed else "follows from the approach"),
        ("method", f"{case.method_for(lattice)}, tolerance {case.solver.tolerance:g}"),
        ("memory", f"{quantity(memory_needed(case, lattice), 'B', 3)}"),
    ]  # fmt: skip


def _body(body: Body) -> str:
    stiffness = "rigid"
    if not body.rigid:
        stiffness = f"E = {quantity(body.young_modulus or math.nan, 'Pa')}, nu = {body.poisson_ratio:g}"
    return f"{stiffness}; {_surface(body.surface)}"


def _surface(surface: Surface | None) -> str:
    from .validation import Quantity

    if surface is None:
        return "flat"
    given = [surface.shape]
    for name, field in type(surface).model_fields.items():
        value = getattr(surface, name)
        if name == "shape" or value == field.default:
            continue
        unit = next((kind.dimension.unit for kind in field.metadata if isinstance(kind, Quantity)), "")
        if name == "offset":
            given.append(f"{name} ({', '.join(quantity(part, 'm') for part in value)})")
        elif unit == "rad":
            given.append(f"{name} {math.degrees(value):.6g} deg")
        else:
            given.append(f"{name} {quantity(value, unit) if isinstance(value, float) else value}")
    return ", ".join(given)


# --- after the run --------------------------------------------------------------------------------


def step_rows(history: History) -> list[Row]:
    """Return what a load step came to, with its residuals."""
    rows = [
        (name.replace("_", " "), quantity(history[name], unit))
        for name, unit in _SHOWN.items()
        if name in history
    ]
    residuals = ", ".join(f"{sign} = {value:.1e}" for sign, value in _residuals(history).items())
    return [*rows, ("residuals", residuals), ("work", _work(history))]


def _residuals(history: History) -> dict[str, float]:
    """Return the residuals that there are, by the symbol of the theory."""
    names = {"R_n": "normal", "R_t": "tangential", "R_P": "force", "R_Q": "shear_force", "R_M": "torque"}
    found = {sign: float(history.get(f"residual_{name}", math.nan)) for sign, name in names.items()}
    return {sign: value for sign, value in found.items() if not math.isnan(value)}


def _work(history: History) -> str:
    return (
        f"{history['sweeps']} iterations, {history['operator_applications']:.3g} operator applications, "
        f"{quantity(history['seconds'], 's', 3)}"
    )


def history_rows(histories: Sequence[History]) -> list[Row]:
    """Return a row for each load step; of a long history only some steps, the last among them.

    The residual is the largest of a step.
    """
    stride = max(1, math.ceil(len(histories) / _MOST_ROWS))
    chosen = [k for k in range(len(histories)) if (len(histories) - 1 - k) % stride == 0]
    return [
        (
            f"{k + 1}",
            str(h.get("label", "")),
            quantity(h["normal_load"], "N"),
            quantity(h["approach"], "m"),
            quantity(h["max_pressure"], "Pa"),
            quantity(h["contact_radius"], "m"),
            f"{max(_residuals(h).values(), default=math.nan):.1e}",
            quantity(h["seconds"], "s", 3),
        )
        for k, h in ((k, histories[k]) for k in chosen)
    ]


HISTORY_HEADERS = ("step", "label", "load", "approach", "p_max", "radius", "residual", "time")


# --- against Hertz --------------------------------------------------------------------------------


def hertz_rows(case: Case, history: History) -> list[Row]:
    """Compare a load step with Hertz's solution.

    Parameters
    ----------
    case : Case
        The case.
    history : mapping
        History of one of its steps.

    Returns
    -------
    list of rows
        Quantity, Hertz, computed, difference; empty where Hertz does not apply: with friction, with surfaces
        that are not quadratic or touch along a line, without load.
    """
    load = float(history["normal_load"])
    surfaces = [body.surface for body in (case.body_1, case.body_2) if body.surface is not None]
    curvatures = [curvature for surface in surfaces if (curvature := surface.curvature) is not None]
    quadratic = len(curvatures) == len(surfaces)
    if case.solver.algorithm != "frictionless" or load <= 0 or not quadratic:
        return []
    import numpy as np

    from .analytic import hertz_ellipse

    try:
        hessian = np.sum([np.zeros((2, 2)), *curvatures], axis=0)
        hertz = hertz_ellipse(case.pair.effective_modulus, hessian, normal_load=load)
    except ValueError:  # contact along a line or all over, or a gap given in Python
        return []
    radius = math.sqrt(hertz.semi_major * hertz.semi_minor)
    compared = [
        ("max pressure", hertz.max_pressure, history["max_pressure"], "Pa"),
        ("approach", hertz.approach, history["approach"], "m"),
        ("contact radius (pressure at the edge)", radius, history.get("contact_radius_fit", math.nan), "m"),
        ("contact radius (area of the nodes)", radius, history["contact_radius"], "m"),
    ]
    return [
        (name, quantity(exact, unit, 6), quantity(value, unit, 6), f"{100 * (value / exact - 1):+.3f} %")
        for name, exact, value, unit in compared
        if not math.isnan(value)
    ]


HERTZ_HEADERS = ("", "Hertz", "computed", "difference")


# --- a file ---------------------------------------------------------------------------------------


def file_rows(result: Result) -> list[Row]:
    """Return where a result comes from and how large it is."""
    attributes, sizes = result.dataset.attrs, result.dataset.sizes
    planned = int(attributes["planned_steps"])
    state = "complete" if result.complete else f"unfinished, {planned} were planned"
    fields = [str(n) for n, v in result.dataset.data_vars.items() if v.dims == ("step", "row", "col")]
    return [
        ("file", result.path),
        ("written by", f"{attributes['source']}, run started {attributes['created']}"),
        ("load steps", f"{len(result)} ({state})"),
        ("window", f"{sizes['row']} x {sizes['col']} nodes"),
        ("spacing", quantity(float(attributes["lattice_spacing"]), "m")),
        ("fields", ", ".join(fields)),
    ]


def case_of(result: Result) -> Case | None:
    """Return the case a result came from, if its deck tells."""
    from .case import Case

    try:
        return Case.from_text(result.deck) if result.deck else None
    except HexcontactError:  # a deck with parts that were made in Python
        return None
