"""Tables for the terminal: what is going to be run, what came out, and how it compares with Hertz."""

from __future__ import annotations

import functools
import math
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from .errors import HexcontactError
from .progress import (
    LOADS_AND_MOTIONS,
    fitted,
    is_frictional,
    load_or_motion,
    quantity,
    residuals,
    stick_share,
    worth_showing,
)

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from .case import Body, Case
    from .result import Result
    from .surfaces import Surface

History = Mapping[str, Any]
Row = tuple[str, ...]

_MOST_ROWS = 24  # steps shown of a long history
_FURTHER = {  # shown of a load step besides loads and motions
    "max_pressure": "Pa",
    "max_traction": "Pa",
    "contact_radius": "m",
    "stick_radius": "m",
    "elastic_energy": "J",
    "dissipated_energy": "J",
}


def console() -> Console:
    """Return the console on standard output: colors on a terminal, plain wide text elsewhere."""
    from rich.console import Console

    width = None if sys.stdout.isatty() else 130
    return Console(highlight=False, markup=False, emoji=False, width=width)


def table(title: str, headers: Sequence[str], rows: Iterable[Row], tight: bool = False) -> Table:
    """Return a table of numbers; names and labels are text, which may wrap on a narrow terminal."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    shown = Table(
        title=Text(title, style="bold"), title_justify="left", box=box.SIMPLE_HEAD, show_header=any(headers),
        pad_edge=False, collapse_padding=tight,
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
    from .estimates import work
    from .window import memory_needed

    lattice = case.lattice
    span = [lattice.n_col - 1, lattice.n_row - 1] @ abs(lattice.basis)  # the window may be too large to fill
    return [
        *((f"body {number}", _body(body)) for number, body in ((1, case.body_1), (2, case.body_2))),
        (
            "pair",
            f"E* = {quantity(case.pair.effective_modulus, 'Pa')}, beta = {case.pair.beta:.4g}, "
            f"gamma = {case.pair.gamma:.4g}",
        ),
        ("friction", _friction(case)),
        ("spacing", quantity(lattice.spacing, "m")),
        (
            "window",
            f"{lattice.n_row} x {lattice.n_col} nodes ({lattice.size:,}), {quantity(span[0], 'm')} x "
            f"{quantity(span[1], 'm')}, {'fixed' if case.window_fixed else 'grows with the contact'}",
        ),
        ("load steps", _history(case)),
        ("largest load", _largest(case)),
        ("method", f"{case.method_for(lattice)}, tolerance {case.solver.tolerance:g}"),
        ("memory", f"{quantity(memory_needed(case, lattice), 'B', 3)}"),
        ("work", work(case)),
    ]  # fmt: skip


def _friction(case: Case) -> str:
    if not case.frictional:
        return "none"
    mu = case.friction_coefficient
    law = "no slip (coefficient inf)" if math.isinf(mu) else f"coefficient {mu:g}"
    goodman = ", shear does not move the pressure" * (case.solver.coupling == "goodman")
    interpolated = case.solver.algorithm == "incremental" and case.solver.entry == "interpolated"
    entry = ", entry interpolated" * interpolated
    return f"{law}, {case.solver.algorithm}{entry}{goodman}"


def _history(case: Case) -> str:
    segments = case.load_steps[-1].segment + 1
    return f"{len(case.load_steps)}" + (f" in {segments} segments" if segments > 1 else "")


def _largest(case: Case) -> str:
    """Return the largest load along each direction, as far as the deck tells."""
    largest = {}
    for direction in ("z", "x", "y"):
        targets = [getattr(step, direction) for step in case.load_steps]
        largest[direction] = max((abs(t.value) for t in targets if t.control == "force"), default=0.0)
    normal = quantity(largest["z"], "N") if largest["z"] else "follows from the approach"
    along = [f"{quantity(largest[axis], 'N')} along {axis}" for axis in ("x", "y") if largest[axis]]
    return ", ".join([normal, *along])


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
    rows = [(_words(name), load_or_motion(name, history)) for name in worth_showing([history])]
    rows += [
        (_words(name), quantity(fitted(name, history), unit))
        for name, unit in _FURTHER.items()
        if name in history
    ]
    if is_frictional(history):
        rows.append(("stick", _stick(history)))
    found = ", ".join(f"{sign} = {value:.1e}" for sign, value in residuals(history).items())
    return [*rows, ("residuals", found), ("work", _work(history))]


def _words(name: str) -> str:
    return name.replace("_", " ")


def _stick(history: History) -> str:
    """Return size and place of the stick zone in words."""
    if not history["stick_area"]:
        return "nowhere"
    center = [float(history[f"stick_center_{axis}"]) for axis in "xy"]
    near = 1e-6 * history["contact_radius"]  # as good as zero
    place = ", ".join(quantity(0.0 if abs(value) < near else value, "m") for value in center)
    return f"{stick_share(history)} of the contact area, about ({place})"


def _work(history: History) -> str:
    cuts = history.get("cuts", 0)
    halved = f"halved {cuts} time{'s' * (cuts > 1)}, " if cuts else ""
    return (
        f"{history['sweeps']} iterations, {halved}{history['operator_applications']:.3g} operator "
        f"applications, {quantity(history['seconds'], 's', 3)}"
    )


def history_table(histories: Sequence[History], console: Console) -> Table:
    """Return a table of the load steps; of a long history only some steps, the last among them.

    The residual is the largest of a step. What a narrow console has no room for is left out.
    """
    stride = max(1, math.ceil(len(histories) / _MOST_ROWS))
    chosen = [k for k in range(len(histories)) if (len(histories) - 1 - k) % stride == 0]
    columns: dict[str, Callable[[History], str]] = {"label": lambda h: str(h.get("label", ""))}
    for name in worth_showing(histories):
        columns[LOADS_AND_MOTIONS[name][0]] = functools.partial(load_or_motion, name)
    if is_frictional(histories[-1]):
        columns["stick"] = stick_share
    else:
        columns["p_max"] = lambda h: quantity(h["max_pressure"], "Pa")
        columns["radius"] = lambda h: quantity(fitted("contact_radius", h), "m")
    columns["residual"] = lambda h: f"{max(residuals(h).values(), default=math.nan):.1e}"
    columns["time"] = lambda h: quantity(h["seconds"], "s", 3)
    for spare in ("", "time", "label", "residual"):
        columns.pop(spare, None)
        rows = [(f"{k + 1}", *(entry(histories[k]) for entry in columns.values())) for k in chosen]
        shown = table("History", ("step", *columns), rows, tight=True)
        if console.measure(shown, options=console.options.update_width(1000)).maximum <= console.width:
            break
    return shown


# --- against Hertz --------------------------------------------------------------------------------


def against_hertz(case: Case, history: History) -> list[tuple[str, float, float, str]]:
    """Compare a load step with Hertz's solution.

    Parameters
    ----------
    case : Case
        The case.
    history : mapping
        History of one of its steps.

    Returns
    -------
    list of (str, float, float, str)
        Quantity as in histories, Hertz, computed, unit; empty where Hertz does not apply: with friction, with
        surfaces that are not quadratic or touch along a line, without load.
    """
    load = float(history["normal_load"])
    surfaces = [body.surface for body in (case.body_1, case.body_2) if body.surface is not None]
    curvatures = [curvature for surface in surfaces if (curvature := surface.curvature) is not None]
    quadratic = len(curvatures) == len(surfaces)
    if case.frictional or load <= 0 or not quadratic:
        return []
    import numpy as np

    from .analytic import hertz_ellipse

    try:
        hessian = np.sum([np.zeros((2, 2)), *curvatures], axis=0)
        hertz = hertz_ellipse(case.pair.effective_modulus, hessian, normal_load=load)
    except ValueError:  # contact along a line or all over, or a gap given in Python
        return []
    radius = math.sqrt(hertz.semi_major * hertz.semi_minor)
    known = {
        "max_pressure": (hertz.max_pressure, "Pa"),
        "approach": (hertz.approach, "m"),
        "contact_radius_fit": (radius, "m"),
        "contact_radius": (radius, "m"),
    }
    return [
        (name, exact, float(history[name]), unit)
        for name, (exact, unit) in known.items()
        if not math.isnan(history.get(name, math.nan))
    ]


def hertz_rows(case: Case, history: History) -> list[Row]:
    """Return the rows of `against_hertz`: quantity, Hertz, computed, difference."""
    named = {
        "contact_radius_fit": "contact radius (to the edge)",
        "contact_radius": "contact radius (area of the nodes)",
    }
    return [
        (named.get(name, _words(name)), quantity(exact, unit, 6), quantity(value, unit, 6),
         f"{100 * (value / exact - 1):+.3f} %")
        for name, exact, value, unit in against_hertz(case, history)
    ]  # fmt: skip


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
        *([("stopped", str(attributes["stopped"]))] if "stopped" in attributes else []),
        ("window", f"{sizes['row']} x {sizes['col']} nodes"),
        ("spacing", quantity(float(attributes["lattice_spacing"]), "m")),
        ("algorithm", algorithm(attributes)),
        ("fields", ", ".join(fields)),
    ]


def algorithm(attributes: Mapping[str, Any]) -> str:
    """Say from the attributes of a result how it was computed."""
    words = str(attributes.get("algorithm", "unknown"))
    if words in ("static", "incremental"):
        words += f", friction coefficient {float(attributes['friction_coefficient']):g}"
    if words.startswith("incremental"):
        words += ", entry interpolated" * (attributes.get("entry") == "interpolated")
    return words + ", coupling goodman" * (attributes.get("coupling") == "goodman")


def case_of(result: Result) -> Case | None:
    """Return the case a result came from, if its deck tells."""
    from .case import Case

    try:
        return Case.from_text(result.deck) if result.deck else None
    except HexcontactError:  # a deck with parts that were made in Python
        return None
