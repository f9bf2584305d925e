"""What a user sees while a case runs: a bar on a terminal, plain lines in a log, or nothing."""

from __future__ import annotations

import contextlib
import math
import sys
from collections.abc import Iterable, Iterator, Mapping
from typing import IO, TYPE_CHECKING, Any

from .text import percent, quantity, visible

if TYPE_CHECKING:
    from .step import Step


class Reporter:
    """Is told about the steps of a run; this one says nothing."""

    @contextlib.contextmanager
    def watching(self, title: str, steps: int) -> Iterator[None]:
        """Be there for a run of so many steps.

        Parameters
        ----------
        title : str
            Title of the case.
        steps : int
            Number of load steps; 0 if it shows on the way.
        """
        yield

    def lattice(self, words: str, shifted: bool) -> None:
        """Hear that the load history begins again on another lattice.

        Parameters
        ----------
        words : str
            Which one, in words.
        shifted : bool
            Whether it is a shifted copy, which only serves to estimate errors.
        """

    def says(self, words: str) -> None:
        """Hear what is worth telling between load steps.

        Parameters
        ----------
        words : str
            What there is to tell.
        """

    def finished(self, step: Step) -> None:
        """Hear of a finished step.

        Parameters
        ----------
        step : Step
            The step; only its history is looked at.
        """


class Lines(Reporter):
    """One line by step, for logs and pipes.

    Parameters
    ----------
    stream : text file
        Where the lines go.
    """

    def __init__(self, stream: IO[str]) -> None:
        self.stream = stream
        self.steps = 0
        self._shifted = False

    @contextlib.contextmanager
    def watching(self, title: str, steps: int) -> Iterator[None]:
        """Print the title first."""
        self.steps = steps
        count = f"{steps} load step{'s' * (steps != 1)}" if steps else "adaptive load steps"
        self._print(f"{title or 'case'}: {count}")
        yield

    def lattice(self, words: str, shifted: bool) -> None:
        """Print which lattice is next."""
        self._print(words)
        self._shifted = shifted

    def says(self, words: str) -> None:
        """Print it."""
        self._print(words)

    def finished(self, step: Step) -> None:
        """Print the line of a step; those of shifted copies tell nothing new."""
        if self._shifted:
            return
        width = len(str(self.steps))
        number = f"{step.number:>{width}}/{self.steps}"
        if not self.steps:
            number = f"{step.number:>3} ({step.done:4.0%})"
        self._print(f"step {number}  {describe(step.history)}")

    def _print(self, line: str) -> None:
        with contextlib.suppress(OSError):  # nobody listens any more; the run goes on
            print(visible(line), file=self.stream, flush=True)


class Bar(Reporter):
    """A progress bar with the latest step below it."""

    @contextlib.contextmanager
    def watching(self, title: str, steps: int) -> Iterator[None]:
        """Show the bar; it vanishes at the end."""
        from rich.console import Console, Group
        from rich.live import Live
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            Progress,
            SpinnerColumn,
            TextColumn,
            TimeElapsedColumn,
        )
        from rich.text import Text

        self._counted = steps > 0  # else by the share of the load history
        count = MofNCompleteColumn() if self._counted else TextColumn("{task.percentage:.0f} %")
        columns = [SpinnerColumn(), TextColumn("{task.description}", markup=False), BarColumn(), count]
        self._bar = Progress(*columns, TimeElapsedColumn())
        self._title = visible(title)
        self._task = self._bar.add_task(self._title, total=steps or 1.0)
        self._latest = Text(style="dim", no_wrap=True, overflow="ellipsis")
        with Live(Group(self._bar, self._latest), console=Console(stderr=True), transient=True):
            yield

    def lattice(self, words: str, shifted: bool) -> None:
        """Start the bar again, with the name of the lattice."""
        self._bar.update(self._task, completed=0, description=f"{self._title}, {words.partition(':')[0]}")

    def says(self, words: str) -> None:
        """Show it until the next step."""
        self._latest.plain = f"  {visible(words)}"

    def finished(self, step: Step) -> None:
        """Move the bar on by one step."""
        self._latest.plain = "  " + visible(describe(step.history, short=True))
        self._bar.update(self._task, completed=step.number if self._counted else step.done)


def reporter(quiet: bool = False, stream: IO[str] | None = None) -> Reporter:
    """Return what suits `stream` (default: standard error): bar, lines, or silence if `quiet`."""
    stream = stream or sys.stderr
    if quiet:
        return Reporter()
    return Bar() if stream is sys.stderr and stream.isatty() else Lines(stream)


# --- what is said about a step --------------------------------------------------------------------

LOADS_AND_MOTIONS = {  # with friction: what it is called, unit
    "normal_load": ("P", "N"),
    "tangential_load_x": ("Qx", "N"),
    "tangential_load_y": ("Qy", "N"),
    "torque": ("Mz", "N m"),
    "approach": ("approach", "m"),
    "shift_x": ("shift x", "m"),
    "shift_y": ("shift y", "m"),
    "twist": ("twist", "rad"),
}
RESIDUALS = {  # by the symbol of the theory
    "R_n": "residual_normal",
    "R_t": "residual_tangential",
    "R_P": "residual_force",
    "R_Q": "residual_shear_force",
    "R_M": "residual_torque",
}
_NOTICED = 1e-6  # share of the normal load or approach from which something tangential is worth showing
_NOISE = 1e-9  # ... below which it is written as zero


def _scale(name: str, history: Mapping[str, Any]) -> float:
    """Return what a load or motion of a step is to be compared with to tell whether it is noise."""
    load, approach = abs(history["normal_load"]), abs(history["approach"])
    length = history["contact_radius"]
    if name in ("normal_load", "approach"):
        return 0.0
    if name == "torque":
        return float(load * length)
    if name == "twist":
        return float(approach / length) if length else math.inf
    return float(load if name.startswith("tangential") else approach)


def worth_showing(histories: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return those of `LOADS_AND_MOTIONS` to show: the normal ones, and others that are more than noise."""
    shown = {"normal_load", "approach"}
    for history in histories:
        shown |= {
            name
            for name in LOADS_AND_MOTIONS.keys() - shown
            if abs(history.get(name, 0.0)) > _NOTICED * _scale(name, history)
        }
    return [name for name in LOADS_AND_MOTIONS if name in shown]


def load_or_motion(name: str, history: Mapping[str, Any]) -> str:
    """Write one of `LOADS_AND_MOTIONS`, noise as zero."""
    value = float(history[name])
    return quantity(0.0 if abs(value) < _NOISE * _scale(name, history) else value, LOADS_AND_MOTIONS[name][1])


def fitted(name: str, history: Mapping[str, Any]) -> float:
    """Return an area or radius to the edge between the nodes; as its nodes have it where no fit was kept."""
    value = float(history.get(f"{name}_fit", math.nan))
    return float(history[name]) if math.isnan(value) else value


def error_of(name: str, history: Mapping[str, Any]) -> str:
    """Write the estimated error of what `fitted` or `load_or_motion` give, as " ± 0.05 %"; empty if none."""
    own = name if math.isnan(float(history.get(f"{name}_fit", math.nan))) else f"{name}_fit"
    value, error = abs(float(history[own])), float(history.get(f"{own}_error", 0.0))
    least = _NOISE * _scale(name, history) if name in LOADS_AND_MOTIONS else 0.0
    return f" ± {percent(error / value)}" if value > least and error > 0.0 else ""


def stick_share(history: Mapping[str, Any]) -> str:
    """Write how much of the contact area sticks."""
    area = fitted("contact_area", history)
    return f"{100 * fitted('stick_area', history) / area:.1f} %" if area else "-"


def step_error_share(history: Mapping[str, Any]) -> float | None:
    """Return the bound on the error of the stick area by load steps, as a share of the contact area."""
    error, area = float(history.get("stick_area_step_error", math.nan)), fitted("contact_area", history)
    return None if math.isnan(error) or not area else error / area


def halved(history: Mapping[str, Any]) -> str:
    """Say how often a step was halved until the solver converged; empty if it was not."""
    cuts = int(history.get("cuts", 0))
    return f"halved {cuts} time{'s' * (cuts > 1)}" if cuts else ""


def residuals(history: Mapping[str, Any]) -> dict[str, float]:
    """Return the residuals that there are, by the symbol of the theory."""
    found = {sign: float(history.get(name, math.nan)) for sign, name in RESIDUALS.items()}
    return {sign: value for sign, value in found.items() if not math.isnan(value)}


def is_frictional(history: Mapping[str, Any]) -> bool:
    """Tell whether a step was solved with friction."""
    return "stick_area" in history


def describe(history: Mapping[str, Any], short: bool = False) -> str:
    """Return a line of text about a step from its history."""
    parts = [str(history.get("label", ""))]
    for name in worth_showing([history]):
        parts.append(f"{LOADS_AND_MOTIONS[name][0]} {load_or_motion(name, history)}")
    if is_frictional(history):
        error = step_error_share(history)
        around = "" if error is None or short else f" ± {100 * error:.1f} %"
        parts += [f"stick {stick_share(history)}{around}", f"R {max(residuals(history).values()):.1e}"]
    else:
        parts.append(f"p_max {quantity(history['max_pressure'], 'Pa')}")
        if not short:
            parts.append(f"radius {quantity(fitted('contact_radius', history), 'm')}")
            parts += [f"{sign} {value:.1e}" for sign, value in residuals(history).items()]
    parts.append(halved(history))
    if not short:
        parts.append(quantity(history["seconds"], "s", 3))
    return "  ".join(part for part in parts if part)
