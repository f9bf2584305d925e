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
    error_of,
    fitted,
    halved,
    is_frictional,
    load_or_motion,
    residuals,
    step_error_share,
    stick_share,
    worth_showing,
)
from .text import PREFIXES, percent, quantity, rich_table
from .variables import VARIABLES

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from .case import Case
    from .case_settings import Body
    from .problem import Problem
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


def pairs(title: str, rows: Iterable[Row]) -> Table:
    """Return a table of names and what belongs to them."""
    return rich_table(title, ("", ""), rows)


# --- before the run -------------------------------------------------------------------------------


def case_rows(case: Problem) -> list[Row]:
    """Return what would be run."""
    from .estimates import work

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
        *([("accuracy", _accuracy(case))] if case.accuracy else []),
        ("load steps", _history(case)),
        ("largest load", _largest(case)),
        ("method", f"{case.method_for(lattice)}, tolerance {case.solver.tolerance:g}"),
        ("memory", _memory(case)),
        ("work", work(case)),
    ]  # fmt: skip


def _memory(case: Problem) -> str:
    from .refinement import least_and_most
    from .window import peak_memory

    last = [cases[-1] for cases in least_and_most(case)] if case.accuracy else [case]
    return " to ".join(quantity(peak_memory(one, one.lattice), "B", 3) for one in last)


def _accuracy(case: Problem) -> str:
    """Say what is to be reached, and between which lattices the refinement will end."""
    from .refinement import least_and_most

    assert case.accuracy is not None
    last = [cases[-1].lattice for cases in least_and_most(case)]
    spacings = [quantity(lattice.spacing, "m") for lattice in last]
    return (
        f"target {percent(case.accuracy.target)}: spacing and window are of the first lattice, the last "
        f"has {' to '.join(spacings)} ({' to '.join(f'{lattice.size:,}' for lattice in last)} nodes)"
    )


def _friction(case: Problem) -> str:
    if not case.frictional:
        return "none"
    mu = case.friction_coefficient
    law = "no slip (coefficient inf)" if math.isinf(mu) else f"coefficient {mu:g}"
    goodman = ", shear does not move the pressure" * (case.solver.coupling == "goodman")
    interpolated = case.solver.algorithm == "incremental" and case.solver.entry == "interpolated"
    entry = ", entry interpolated" * interpolated
    return f"{law}, {case.solver.algorithm}{entry}{goodman}"


def _history(case: Problem) -> str:
    segments = case.load_steps[-1].segment + 1
    if case.adaptive:
        chosen = sum(step.ramp is not None for step in case.load_steps)
        given = len(case.load_steps) - chosen
        where = f"{chosen} segment{'s' * (chosen > 1)}"
        fixed = f", and {given} that {'are' if given > 1 else 'is'} given" * (given > 0)
        return f"chosen on the way in {where} (step_tolerance {case.solver.step_tolerance:g}){fixed}"
    return f"{len(case.load_steps)}" + (f" in {segments} segments" if segments > 1 else "")


def _largest(case: Problem) -> str:
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
    """Return what a load step came to, with its estimated errors and residuals."""
    rows = [
        (_words(name), load_or_motion(name, history) + error_of(name, history))
        for name in worth_showing([history])
    ]
    rows += [
        (_words(name), quantity(fitted(name, history), unit) + error_of(name, history))
        for name, unit in _FURTHER.items()
        if name in history
    ]
    if is_frictional(history):
        rows.append(("stick", _stick(history)))
    if (error := step_error_share(history)) is not None:
        change = 100 * history["stick_area_step_change"] / fitted("contact_area", history)
        words = f"stick area within {100 * error:.1f} % of the contact area, {change + 0.0:+.2f} % by halving"
        rows.append(("load steps", words))
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
    parts = f"{halved(history)}, " if halved(history) else ""
    return (
        f"{history['sweeps']} iterations, {parts}{history['operator_applications']:.3g} operator "
        f"applications, {quantity(history['seconds'], 's', 3)}"
    )


def history_table(histories: Sequence[History], console: Console) -> Table:
    """Return a table of the load steps; of a long history only some steps, the last among them.

    The residual is the largest of a step. What a narrow console has no room for is left out, estimated errors
    as the last.
    """
    stride = max(1, math.ceil(len(histories) / _MOST_ROWS))
    chosen = [k for k in range(len(histories)) if (len(histories) - 1 - k) % stride == 0]
    for told in (_and_error, _alone):
        columns = _columns(histories, told)
        for spare in ("", "time", "label", "residual"):
            columns.pop(spare, None)
            rows = [(f"{k + 1}", *(entry(histories[k]) for entry in columns.values())) for k in chosen]
            shown = rich_table("History", ("step", *columns), rows, tight=True)
            if console.measure(shown, options=console.options.update_width(1000)).maximum <= console.width:
                return shown
    return shown


_Told = Callable[[str, str, History], str]


def _alone(text: str, name: str, history: History) -> str:
    return text


def _and_error(text: str, name: str, history: History) -> str:
    return text + error_of(name, history)


def _columns(histories: Sequence[History], told: _Told) -> dict[str, Callable[[History], str]]:
    """Return what a table of load steps shows, by its header."""

    def column(entry: Callable[[History], str], name: str) -> Callable[[History], str]:
        return lambda history: told(entry(history), name, history)

    columns: dict[str, Callable[[History], str]] = {"label": lambda h: str(h.get("label", ""))}
    for name in worth_showing(histories):
        columns[LOADS_AND_MOTIONS[name][0]] = column(functools.partial(load_or_motion, name), name)
    if is_frictional(histories[-1]):
        columns["stick"] = column(stick_share, "stick_area")
    else:
        columns["p_max"] = column(lambda h: quantity(h["max_pressure"], "Pa"), "max_pressure")
        columns["radius"] = column(lambda h: quantity(fitted("contact_radius", h), "m"), "contact_radius")
    columns["residual"] = lambda h: f"{max(residuals(h).values(), default=math.nan):.1e}"
    columns["time"] = lambda h: quantity(h["seconds"], "s", 3)
    return columns


# --- against Hertz --------------------------------------------------------------------------------


def against_hertz(case: Problem, history: History) -> list[tuple[str, float, float, str]]:
    """Compare a load step with Hertz's solution.

    Parameters
    ----------
    case : Problem
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


def hertz_rows(case: Problem, history: History) -> list[Row]:
    """Return the rows of `against_hertz`: quantity, Hertz, computed, difference."""
    named = {
        "contact_radius_fit": "contact radius (to the edge)",
        "contact_radius": "contact radius (area of the nodes)",
    }
    rows: list[Row] = []
    for name, exact, value, unit in against_hertz(case, history):
        off, error = f"{100 * (value / exact - 1):+.3f} %", float(history.get(f"{name}_error", math.nan))
        if not math.isnan(error):
            off += f" (± {percent(error / value)} estimated)"
        rows.append((named.get(name, _words(name)), quantity(exact, unit, 6), quantity(value, unit, 6), off))
    return rows


HERTZ_HEADERS = ("", "Hertz", "computed", "difference")


# --- accuracy -------------------------------------------------------------------------------------


def _value(value: float, unit: str) -> str:
    """Write a number to five digits; prefixes of squares are squared, too."""
    if unit != "m2" or value <= 0.0:
        return quantity(value, unit, 5)
    power = 3 * math.floor((math.log10(value) + 1) / 6)  # from 0.1 of a unit on
    return f"{value / 10.0 ** (2 * power):#.5g} ".replace(". ", " ") + f"{PREFIXES[power]}m²"


TRIAL_HEADERS = ("", "first lattice", "last but one", "last", "largest error")


def trial_rows(result: Result) -> list[Row]:
    """Return what decides about the accuracy of a result that was refined, at the last load step.

    Parameters
    ----------
    result : Result
        The result.

    Returns
    -------
    list of rows
        Quantity, on three of the lattices, largest error of all load steps in its largest value; empty if
        the lattice was not refined.
    """
    from .accuracy import JUDGED, relative_errors

    data = result.dataset
    if "trial_spacing" not in data:
        return []
    own = data.isel(trial=data["trial_copy"].values == 0)
    shown = [0, -2, -1]
    names = [name for name in JUDGED if name in data]
    histories = result.history.to_dict("records")
    errors = [{name: history[f"{name}_error"] for name in names} for history in histories]
    relative = relative_errors(histories, errors)
    rows = [
        ("spacing", *(quantity(float(own["trial_spacing"][k]), "m") for k in shown), ""),
        ("nodes", *(f"{int(own['trial_nodes'][k]):,}" for k in shown), ""),
    ]
    for name in names:
        values = own[f"trial_{name}"].isel(step=-1)
        told = (_value(float(values[k]), VARIABLES[name].units) for k in shown)
        rows.append((_words(name.removesuffix("_fit")), *told, percent(relative[name])))
    return [*rows, ("target", "", "", "", percent(float(data.attrs["accuracy_target"])))]


# --- a file ---------------------------------------------------------------------------------------


def file_rows(result: Result) -> list[Row]:
    """Return where a result comes from and how large it is."""
    attributes, sizes = result.dataset.attrs, result.dataset.sizes
    planned = int(attributes["planned_steps"])
    plan = f"{planned} were planned" if planned else "their number was open"
    state = "complete" if result.complete else f"unfinished, {plan}"
    fields = [str(n) for n, v in result.dataset.data_vars.items() if v.dims == ("step", "row", "col")]
    return [
        ("file", result.path),
        ("written by", f"{attributes['source']}, run started {attributes['created']}"),
        ("load steps", f"{len(result)} ({state})"),
        *([("stopped", str(attributes["stopped"]))] if "stopped" in attributes else []),
        ("window", f"{sizes['row']} x {sizes['col']} nodes"),
        ("spacing", quantity(float(attributes["lattice_spacing"]), "m")),
        ("algorithm", algorithm(attributes)),
        *([("accuracy", _reached(attributes))] if "accuracy_reached" in attributes else []),
        ("fields", ", ".join(fields)),
    ]


def _reached(attributes: Mapping[str, Any]) -> str:
    """Say whether the accuracy that was asked for is reached."""
    if "accuracy_shortfall" in attributes:
        return str(attributes["accuracy_shortfall"])
    error, target = (percent(float(attributes[f"accuracy_{name}"])) for name in ("estimate", "target"))
    return f"target {target} reached: estimated error {error}"


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
