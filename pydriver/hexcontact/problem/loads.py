"""The load history: the segments of a deck unrolled into load steps with a target for each rigid motion.

Where nothing is said, the tangential loads are held at zero by force and the twist at zero by displacement; a
load or motion that a segment does not name keeps its control and its value. See "control" in the deck
reference.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

from ..deck.faults import MISSING, Mistake
from ..deck.kinds import SMALLEST
from ..deck.series import MOST_STEPS
from ..deck.tables import Load, Segment
from ..variables import LOADS

Control = Literal["force", "displacement"]
Motion = Literal["z", "x", "y", "twist"]
MOTIONS: tuple[Motion, ...] = ("z", "x", "y", "twist")


@dataclass(frozen=True)
class Target:
    """What one rigid motion is driven to in one load step.

    Attributes
    ----------
    control : "force" or "displacement"
        Which of the conjugate pair is prescribed: normal load or approach, tangential load or shift, torque
        or twist.
    value : float
        The prescribed value (N, N m, m or rad), or the known part of it.
    from_start : float
        Share of the value that this quantity had when the segment began. It is not zero only while a segment
        of several steps takes over from the other control, since that value is then a result, not an input.
    """

    control: Control
    value: float
    from_start: float = 0.0

    def at(self, start: float) -> float:
        """Return the value to prescribe, given what the quantity was when the segment began."""
        return self.value + self.from_start * start


@dataclass(frozen=True)
class Ramp:
    """A segment in increments that are chosen while it is solved (``steps = "auto"``).

    Attributes
    ----------
    segment : Segment
        What the deck says.
    start : mapping of str to Target
        What drives each motion when the segment begins.
    virgin : bool
        All is zero when it begins.
    """

    segment: Segment
    start: Mapping[Motion, Target]
    virgin: bool

    @property
    def largest(self) -> float:
        """Largest part of the segment that one increment may take."""
        return 1.0 if self.segment.largest_step is None else self.segment.largest_step

    def targets(self, fraction: float) -> dict[str, Target]:
        """Return what drives each motion when a fraction of the segment is done."""
        return {
            motion: _ramp(self.segment, motion, self.start[motion], fraction, self.virgin)
            for motion in MOTIONS
        }


@dataclass(frozen=True)
class LoadStep:
    """One load step, or a segment whose load steps are chosen while it is solved.

    Attributes
    ----------
    index : int
        Counts from 0 over the whole history.
    segment : int
        Counts from 0; each turn of a repeated path is a segment of its own.
    label : str
        Name of the segment, may be empty.
    z, x, y, twist : Target
        What drives the normal motion, the two tangential ones and the rotation about z.
    fraction : float
        How much of the segment is done at the end of the step.
    ramp : Ramp or None
        The way there, if it is taken in increments that are chosen on it.
    """

    index: int
    segment: int
    label: str
    z: Target
    x: Target
    y: Target
    twist: Target
    fraction: float = 1.0
    ramp: Ramp | None = None

    def until(self, fraction: float) -> LoadStep:
        """Return the part of an adaptive segment that ends at a fraction of it."""
        if self.ramp is None:
            return self
        return replace(self, fraction=fraction, **self.ramp.targets(fraction))  # type: ignore[arg-type]

    @property
    def targets(self) -> tuple[Target, Target, Target, Target]:
        """What drives z, x, y and the twist, in this order."""
        return self.z, self.x, self.y, self.twist

    def values(self, begun: Mapping[str, float]) -> tuple[float, ...]:
        """Return the values to prescribe for z, x, y and the twist.

        Parameters
        ----------
        begun : mapping of str to float
            Loads and motions when the segment began, by the names of `hexcontact.deck.LOADS`.
        """
        return tuple(
            target.at(begun[LOADS[motion][target.control == "displacement"]])
            for motion, target in zip(MOTIONS, self.targets, strict=True)
        )


class _Stretch(NamedTuple):
    """A segment as it is run: its key in the deck, its label, whether it carries on the one before."""

    key: tuple[str | int, ...]
    segment: Segment
    label: str
    carries_on: bool = False


AUTO = "auto"  # number of load steps of a segment in which they are chosen
LEAST = 1e-3  # of a segment, the smallest adaptive load step
_WATCHED = [part / 16 for part in range(1, 17)]  # fractions of such a segment at which loads are looked at

START: dict[Motion, Target] = {
    "z": Target("force", 0.0),
    "x": Target("force", 0.0),
    "y": Target("force", 0.0),
    "twist": Target("displacement", 0.0),
}


class History:
    """Load steps, unrolled from entries of [[load]] as they are appended.

    Parameters
    ----------
    friction_coefficient : float or None
        Coefficient of friction; inf allowed. None: tangential loads and motions are not solved for at all.

    Attributes
    ----------
    steps : list of LoadStep
        The history; incomplete if it is longer than `MOST_STEPS`.
    """

    def __init__(self, friction_coefficient: float | None) -> None:
        self.steps: list[LoadStep] = []
        self._mu = friction_coefficient
        self._entries: list[Load] = []
        self._count = 0
        self._segments = 0
        self._now = START
        self._problems: dict[tuple[str | int, ...], Mistake] = {}

    def append(self, load: Load) -> None:
        """Append the load steps of an entry, valid on its own; see `problems` for what is wrong then."""
        turns, path = load.repeat or 1, list(_turn(("load", len(self._entries)), load))
        self._entries.append(load)
        self._count += turns * sum(_count(stretch.segment) for stretch in path)
        if self._count <= MOST_STEPS:
            for _ in range(turns):
                for stretch in path:
                    self._run(stretch)

    def _run(self, stretch: _Stretch) -> None:
        """Append the load steps of a segment."""
        key, segment, label, carries_on = stretch
        start, virgin = self._now, not self._segments
        self._segments += not carries_on
        if segment.ramp == "cubic" and start["z"].control != "force":
            sentence = "expected linear, since the segment before was driven by approach"
            self._complain(Mistake((*key, "ramp"), "cubic", sentence))
        ramp = Ramp(segment, start, virgin) if segment.steps == AUTO else None
        for fraction in _fractions(segment):
            now = {motion: _ramp(segment, motion, start[motion], fraction, virgin) for motion in MOTIONS}
            number = self._segments - 1
            step = LoadStep(len(self.steps), number, label, **now, fraction=fraction, ramp=ramp)
            self.steps.append(step)
            self._now = now
            for part in _WATCHED if ramp else (1.0,):
                for problem in _overload(key, segment, step.until(part), self._mu):
                    self._complain(problem)

    def _complain(self, problem: Mistake) -> None:
        # The first complaint about a key is enough: its segment has many steps, and may be repeated.
        self._problems[problem.key] = self._problems.pop(problem.key, problem)

    @property
    def problems(self) -> list[Mistake]:
        """What is wrong with the history as a whole.

        Loads that never press, that no friction carries, or a ramp whose start is not known.
        """
        if self._count > MOST_STEPS:
            sentence = f"expected at most {MOST_STEPS} load steps in all, not {self._count}"
            return [Mistake(("load",), MISSING, sentence)]
        problems = list(self._problems.values())
        if all(step.z.value < SMALLEST for step in self.steps):
            first = self._entries[0].normal_load
            key, value = (("load", 0, "normal_load"), first) if first is not None else (("load",), MISSING)
            sentence = "expected a normal load or an approach above zero somewhere in the history"
            problems.append(Mistake(key, value, sentence))
        return problems


def load_steps(
    loads: Sequence[Load], friction_coefficient: float | None
) -> tuple[tuple[LoadStep, ...], list[Mistake]]:
    """Return the load steps of a whole `History`, and what is wrong with it."""
    history = History(friction_coefficient)
    for load in loads:
        history.append(load)
    return tuple(history.steps), history.problems


def _turn(key: tuple[str | int, ...], load: Load) -> Iterator[_Stretch]:
    """Yield the segments of one turn of an entry; rows of one step with the same label are one segment."""
    if load.series is None:
        for place, segment in enumerate(load.path or ()):
            yield _Stretch((*key, "path", place), segment, segment.label or load.label)
        if load.path is None:
            yield _Stretch(key, load, load.label)
        return
    before = None
    for row in load.series.rows():
        label = row.pop("label", "") or load.label
        # checked already, and there may be many
        segment = Segment.model_construct(**row, steps=load.steps, largest_step=load.largest_step)
        yield _Stretch((*key, "series"), segment, label, label == before and load.steps in (None, 1))
        before = label


def _count(segment: Segment) -> int:
    """Return the number of load steps of a segment, 1 for one in which they are chosen."""
    if segment.values:
        return len(segment.values)
    return segment.steps if isinstance(segment.steps, int) else 1


def _fractions(segment: Segment) -> Sequence[float]:
    """Return how much of a segment is done after each of its steps; the last is exactly 1."""
    count = _count(segment)
    return segment.values or [step / count for step in range(1, count + 1)]


def _ramp(segment: Segment, motion: Motion, start: Target, fraction: float, virgin: bool) -> Target:
    """Return the target of a motion at a fraction of a segment; `virgin`: all is zero when it begins."""
    force, displacement = (getattr(segment, key) for key in LOADS[motion])
    if force is None and displacement is None:
        return start
    goal = Target("displacement", displacement) if force is None else Target("force", force)
    if fraction == 1.0:
        return goal
    if start.control != goal.control and not virgin:
        return Target(goal.control, fraction * goal.value, 1.0 - fraction)
    begin = start.value if start.control == goal.control else 0.0
    if motion == "z" and segment.ramp == "cubic":
        root = math.cbrt(begin) + fraction * (math.cbrt(goal.value) - math.cbrt(begin))
        return Target(goal.control, root**3)
    return Target(goal.control, begin + fraction * (goal.value - begin))


def _overload(
    key: tuple[str | int, ...], segment: Segment, step: LoadStep, mu: float | None
) -> Iterator[Mistake]:
    """Yield the tangential loads of a step that friction cannot carry, as far as the deck determines them."""
    tangential: tuple[tuple[Motion, Target], ...] = ("x", step.x), ("y", step.y), ("twist", step.twist)
    if not mu:
        for motion, target in tangential:
            by_force = target.control == "force"
            name = LOADS[motion][0 if by_force else 1]
            given = getattr(segment, name)
            # without friction, but solved for all the same, the surfaces may be moved over each other
            if target.value != 0 and given is not None and (by_force or mu is None):
                known = "or a [friction] table" if mu is None else "since friction.coefficient = 0"
                yield Mistake((*key, name), given, f"expected 0, {known}")
        return
    if step.z.control != "force" or any(target.from_start for _, target in (("z", step.z), *tangential)):
        return
    loads = {motion: target.value if target.control == "force" else 0.0 for motion, target in tangential}
    bound = mu * step.z.value if step.z.value > 0 else 0.0
    force = math.hypot(loads["x"], loads["y"])
    if force > bound * (1 + 1e-12) or (bound == 0 and loads["twist"] != 0):
        blamed = ("tangential_load_x", "tangential_load_y", "torque", "normal_load")
        name = next((name for name in blamed if getattr(segment, name) is not None), "steps")
        given = getattr(segment, name)
        sentence = (
            f"gross sliding: the tangential load of {force:g} N in load step {step.index + 1} is more than "
            f"friction.coefficient x normal_load = {bound:g} N"
        )
        yield Mistake((*key, name), MISSING if given is None else given, sentence)
