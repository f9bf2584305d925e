"""The load history: the segments of a deck unrolled into load steps with a target for each rigid motion.

By default the tangential loads are zero by force and the twist by displacement; a load or motion that a
segment does not name keeps its control and its value. See "control" in the deck reference.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import Any, Literal, NamedTuple

from ..deck.faults import MISSING, Mistake
from ..deck.keys import Bulk, Load, Segment
from ..deck.kinds import SMALLEST, Share
from ..deck.series import COLUMNS, MEANS, MOST_STEPS
from ..text import quantity, worded
from ..variables import BULK_STRESS, LOADS, ROLLED

Control = Literal["force", "displacement"]
Motion = Literal["z", "x", "y", "twist"]
MOTIONS: tuple[Motion, ...] = ("z", "x", "y", "twist")
Stress = tuple[float, float, float]


class Target(NamedTuple):
    """The prescribed load or displacement of one rigid motion in one load step."""

    # the prescribed one of a conjugate pair: normal load or approach, tangential load or shift, torque or
    # twist
    control: Control
    value: float  # the prescribed value (N, N m, m or rad), or the known part of it
    # share of the value that this quantity had at the beginning of the segment; it is not zero only within a
    # segment of several steps after the other control, since that value is a result, not an input
    from_start: float = 0.0

    def at(self, start: float) -> float:
        """Return the prescribed value, given that at the beginning of the segment."""
        return self.value + self.from_start * start


class Roll(NamedTuple):
    """Rolling during a load step."""

    direction: float  # angle from x of the direction that the contact travels in (rad)
    distance: float = 0.0  # distance that the bodies roll (m); 0: the steady state
    done: float = 0.0  # distance that they have rolled at the end of the step, over the whole history (m)
    way: tuple[int, int] = (0, 0)  # columns and rows that the contact has travelled by then

    @property
    def steady(self) -> bool:
        """Whether the steady state is solved at once."""
        return not self.distance


class Ramp(NamedTuple):
    """The way of the loads in a segment."""

    segment: Segment  # the segment of the deck
    start: Mapping[Motion, Target]  # target of each motion at its beginning
    virgin: bool  # whether all is zero at its beginning
    bulk: Stress = (0.0, 0.0, 0.0)  # bulk stress at its beginning (Pa)

    @property
    def largest(self) -> float:
        """Largest increment of chosen ones (``steps = "auto"``), as a part of the segment."""
        return 1.0 if self.segment.largest_step is None else self.segment.largest_step

    def target(self, motion: Motion, fraction: float) -> Target:
        """Return the target of a motion at a fraction of the segment."""
        segment, start = self.segment, self.start[motion]
        drives = ROLLED if segment.rolling else LOADS
        force, displacement = (getattr(segment, key) for key in drives[motion])
        if force is None and displacement is None:
            return start
        goal = Target("displacement", displacement) if force is None else Target("force", force)
        if fraction == 1.0:
            return goal
        if start.control != goal.control and not self.virgin:
            return Target(goal.control, fraction * goal.value, 1.0 - fraction)
        begin = start.value if start.control == goal.control else 0.0
        if motion == "z" and segment.ramp == "cubic":
            root = math.cbrt(begin) + fraction * (math.cbrt(goal.value) - math.cbrt(begin))
            return Target(goal.control, root**3)
        return Target(goal.control, begin + fraction * (goal.value - begin))

    def targets(self, fraction: float) -> dict[str, Any]:
        """Return the target of each motion, and the bulk stress, at a fraction of the segment.

        Components of the bulk stress that the segment does not name are constant.
        """
        goals = [getattr(self.segment, name) for name in BULK_STRESS]
        stress = tuple(
            begin if goal is None else goal if fraction == 1.0 else begin + fraction * (goal - begin)
            for begin, goal in zip(self.bulk, goals, strict=True)
        )
        return {motion: self.target(motion, fraction) for motion in MOTIONS} | {"bulk": stress}


@dataclass(frozen=True)
class LoadStep:
    """One load step, or a segment whose load steps are chosen during its solution."""

    index: int  # counts from 0 over the whole history
    segment: int  # counts from 0; each turn of a repeated path is one segment
    label: str  # name of the segment, may be empty
    z: Target  # targets of the normal motion, the two tangential ones and the rotation about z
    x: Target
    y: Target
    twist: Target
    fraction: float = 1.0  # fraction of the segment at the end of the step
    ramp: Ramp | None = None  # the ramp of a segment in chosen increments
    bulk: Stress = (0.0, 0.0, 0.0)  # bulk stress xx, yy, xy (Pa)
    roll: Roll | None = None  # rolling; motions along x and y and about z are creepages and spin

    @property
    def drives(self) -> Mapping[Any, tuple[str, ...]]:
        """Load and motion that drive each rigid motion."""
        return LOADS if self.roll is None else ROLLED

    def until(self, fraction: float) -> LoadStep:
        """Return the part of an adaptive segment that ends at a fraction of it."""
        if self.ramp is None:
            return self
        return replace(self, fraction=fraction, **self.ramp.targets(fraction))

    @property
    def targets(self) -> tuple[Target, Target, Target, Target]:
        """Targets of z, x, y and the twist."""
        return self.z, self.x, self.y, self.twist

    def values(self, begun: Mapping[str, float]) -> tuple[float, ...]:
        """Return the prescribed values for z, x, y and the twist."""
        return tuple(
            target.at(begun[self.drives[motion][target.control == "displacement"]])
            for motion, target in zip(MOTIONS, self.targets, strict=True)
        )


class Period(NamedTuple):
    """The window of a case that repeats."""

    area: float  # m^2
    mean_height: float  # mean of the gap before loading (m)

    def driven(self, segment: Segment) -> dict[str, float | Share]:
        """Return the loads (N) and the approach (m) of the means of a segment."""
        given = {name: getattr(segment, name) for name in MEANS}
        return {
            MEANS[name]: self.mean_height - value
            if name == "mean_gap"
            else value
            if isinstance(value, Share)  # of mu P, in newtons or pascals
            else value * self.area
            for name, value in given.items()
            if value is not None
        }


class _Stretch(NamedTuple):
    """A segment with its key in the deck, its label, and whether it continues the segment before it."""

    key: tuple[str | int, ...]
    segment: Segment
    label: str
    carries_on: bool = False


_FRICTION = "or a [friction] table with a coefficient above 0"  # the missing one
AUTO = "auto"  # number of load steps of a segment that are chosen

_WATCHED = [part / 16 for part in range(1, 17)]  # fractions of such a segment at which loads are checked

_START: Mapping[Any, Any] = {
    **dict.fromkeys(("z", "x", "y"), Target("force", 0.0)),
    "twist": Target("displacement", 0.0),
    "bulk": (0.0, 0.0, 0.0),
}
_NO_CREEPAGE: dict[Motion, Target] = dict.fromkeys(("x", "y", "twist"), Target("displacement", 0.0))


class History:
    """Load steps, unrolled from entries of [[load]] as they are appended.

    The coefficient of friction may be inf; NaN: another law; None: tangential loads and motions are no
    unknowns. `steps` are incomplete if they are more than `MOST_STEPS`.
    """

    def __init__(
        self, friction_coefficient: float | None, bulk: Bulk | None = None, period: Period | None = None
    ) -> None:
        self.steps: list[LoadStep] = []
        self._mu = friction_coefficient
        self._overloaded: tuple[str | int, ...] = ()  # segment whose load friction cannot carry
        self._bulk, self._period = bulk, period
        self._entries: list[Load] = []
        self._count = 0
        self._segments = 0
        self._rolled = False
        self._now = _START
        self._problems: dict[tuple[str | int, ...], Mistake] = {}

    def append(self, load: Load) -> None:
        """Append the load steps of an entry that is valid on its own; see `problems` for faults."""
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
        if self._period:
            segment = segment.model_copy(update=self._period.driven(segment))
        distance = segment.rolling if isinstance(segment.rolling, float) else 0.0
        roll = Roll(segment.rolling_direction or 0.0, distance) if segment.rolling else None
        if roll and not self._rolled:
            self._now = {**self._now, **_NO_CREEPAGE}
        elif self._rolled and not roll:
            sentence = "missing; expected rolling, since the bodies have rolled before"
            self._complain(Mistake((*key, "rolling"), MISSING, sentence))
        self._rolled = self._rolled or roll is not None
        ramp = Ramp(segment, self._now, not self._segments, self._now["bulk"])
        self._segments += not carries_on
        if segment.ramp == "cubic" and self._now["z"].control != "force":
            sentence = "expected linear, since the segment before was driven by approach"
            self._complain(Mistake((*key, "ramp"), "cubic", sentence))
        segment = self._in_newtons(key, segment, ramp.target("z", 1.0))
        self._complain_of_bulk(key, segment)
        ramp, chosen = ramp._replace(segment=segment), segment.steps == AUTO
        count = _count(segment)
        for fraction in segment.values or [step / count for step in range(1, count + 1)]:  # the last is 1
            self._now = ramp.targets(fraction)
            place = len(self.steps), self._segments - 1, label
            step = LoadStep(*place, **self._now, fraction=fraction, ramp=ramp if chosen else None, roll=roll)
            self.steps.append(step)
            for part in _WATCHED if chosen else (1.0,):
                problems = list(_overload(key, stretch.segment, step.until(part), self._mu, self._period))
                # a load that is too large at the beginning of a segment is a fault of the segment before it
                if not self._overloaded or self._overloaded == key:
                    for problem in problems:
                        self._complain(problem)
                    self._overloaded = key if problems else ()
                elif not problems:
                    self._overloaded = ()

    def _complain_of_bulk(self, key: tuple[str | int, ...], segment: Segment) -> None:
        """Note bulk stress without friction or body, or along a direction without strain."""
        given = {name: value for name in BULK_STRESS if (value := getattr(segment, name)) is not None}
        for name, value in given.items():
            if self._mu is None:
                sentence = f"expected nothing, {_FRICTION}"
            elif self._bulk is None:
                sentence = "expected a [bulk] table, which names the body"
            elif name not in self._bulk.components:
                sentence = f"expected nothing: in {self._bulk.state} it follows from the other component"
            else:
                continue
            self._complain(Mistake((*key, name), value, sentence))

    def _in_newtons(self, key: tuple[str | int, ...], segment: Segment, normal: Target) -> Segment:
        """Return a segment with its shares of mu P at its end as forces."""
        forces, mu = {}, self._mu or 0.0
        for name, value in segment:
            if isinstance(value, Share) and name not in MEANS:
                mean = next((mean for mean in MEANS if getattr(segment, mean) is value), "")
                since = f"expected {'pascals' if mean else 'newtons'}, since"
                loaded = normal.value or not value.share
                reasons = (
                    (self._mu is None, f"expected nothing, {_FRICTION}"),
                    (math.isinf(mu), f"{since} friction.coefficient is inf"),
                    (math.isnan(mu), f"{since} friction varies or has a bound, so that mu P is no number"),
                    (normal.control != "force", f"{since} the approach is given and not the normal load"),
                    (not loaded, "expected 0, since the normal load at the end of this segment is 0"),
                )
                unknown = next((sentence for holds, sentence in reasons if holds), "")
                if unknown:
                    self._complain(Mistake((*key, mean or name), str(value), unknown))
                forces[name] = 0.0 if unknown else value.share * mu * normal.value
        return segment.model_copy(update=forces) if forces else segment

    def _complain(self, problem: Mistake) -> None:
        if "series" in problem.key and isinstance(problem.value, float):  # of a row, in SI
            unit = COLUMNS[str(problem.key[-1])].kind.dimension.unit
            problem = problem._replace(value=worded(problem.value, unit))
        # the first fault of a key is enough: its segment has many steps, and may be repeated
        self._problems[problem.key] = self._problems.pop(problem.key, problem)

    @property
    def problems(self) -> list[Mistake]:
        """Faults: loads that never press, or that friction cannot carry; ramps of unknown start."""
        if self._count > MOST_STEPS:
            sentence = f"expected at most {MOST_STEPS} load steps in all, not {self._count}"
            return [Mistake(("load",), MISSING, sentence)]
        problems = list(self._problems.values())
        if all(step.z.value < SMALLEST for step in self.steps):
            sentence = "expected a normal load or an approach above zero somewhere in the history"
            if self._period and math.isfinite(self._period.mean_height):
                sentence = "expected a mean pressure above zero somewhere in the history"
                if self._period.mean_height > 0.0:
                    height = quantity(self._period.mean_height, "m")
                    sentence += f", or a mean gap below {height}, that before loading"
            names = ("normal_load", "mean_gap", "mean_pressure")
            name = next((name for name in names if getattr(self._entries[0], name) is not None), None)
            given = getattr(self._entries[0], name) if name else MISSING
            # sliding and unknown shares follow from this fault
            return [Mistake(("load", 0, name) if name else ("load",), given, sentence)]
        return problems


def load_steps(
    loads: Sequence[Load],
    friction_coefficient: float | None,
    bulk: Bulk | None = None,
    period: Period | None = None,
) -> tuple[tuple[LoadStep, ...], list[Mistake]]:
    """Return the load steps of a whole `History`, and its faults."""
    history = History(friction_coefficient, bulk, period)
    for load in loads:
        history.append(load)
    return tuple(history.steps), history.problems


def rolled_out(
    steps: Sequence[LoadStep], row: Callable[[float], tuple[tuple[int, int], float]]
) -> tuple[LoadStep, ...]:
    """Return a history with a load step for each spacing of a rolled distance.

    `row` returns, by direction, columns and rows to the node ahead, and their distance (m).
    """
    found: list[LoadStep] = []
    done, way = 0.0, (0, 0)
    for step in steps:
        if step.roll is None or step.roll.steady:
            roll = step.roll and step.roll._replace(done=done, way=way)
            found.append(replace(step, index=len(found), roll=roll))
            continue
        (cols, rows), spacing = row(step.roll.direction)
        count = max(round(step.roll.distance / spacing), 1)
        for number in range(1, count + 1):
            here = way[0] + number * cols, way[1] + number * rows
            roll = step.roll._replace(done=done + number * spacing, way=here)
            found.append(replace(step, index=len(found), fraction=number / count, roll=roll))
        done, way = done + count * spacing, here
    return tuple(found)


def cycle_entries(loads: Sequence[Load], label: str) -> list[Load]:
    """Return the last entries of [[load]], which have the label."""
    return [*reversed([*takewhile(lambda load: load.label == label, reversed(loads))])]


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
    """Return the number of load steps of a segment, 1 if they are chosen."""
    if segment.values:
        return len(segment.values)
    return segment.steps if isinstance(segment.steps, int) else 1


def _overload(
    key: tuple[str | int, ...],
    segment: Segment,
    step: LoadStep,
    mu: float | None,
    period: Period | None = None,
) -> Iterator[Mistake]:
    """Yield the tangential loads of a step that friction cannot carry, as far as the deck determines them."""
    tangential: tuple[tuple[Motion, Target], ...] = ("x", step.x), ("y", step.y), ("twist", step.twist)
    if not mu:
        for motion, target in tangential:
            by_force = target.control == "force"
            driven = step.drives[motion][0 if by_force else 1]
            names = (driven, *(mean for mean, load in MEANS.items() if load == driven))
            name = next((name for name in names if getattr(segment, name) is not None), driven)
            given = getattr(segment, name)
            # without friction, but with shear as an unknown, motions are free
            if target.value != 0 and given is not None and (by_force or mu is None):
                known = _FRICTION if mu is None else "since friction.coefficient = 0"
                yield Mistake((*key, name), given, f"expected 0, {known}")
        return
    if step.z.control != "force" or any(target.from_start for _, target in (("z", step.z), *tangential)):
        return
    loads = {motion: target.value if target.control == "force" else 0.0 for motion, target in tangential}
    bound = mu * step.z.value if step.z.value > 0 else 0.0
    force = math.hypot(loads["x"], loads["y"])
    if step.roll and force and force >= bound:
        name = "tangential_load_x" if segment.tangential_load_x is not None else "tangential_load_y"
        given = getattr(segment, name)
        sentence = (
            f"expected less than friction.coefficient x normal_load = {bound:g} N in all, which takes a "
            "creepage without bound"
        )
        yield Mistake((*key, name), MISSING if given is None else str(given), sentence)
    elif force > bound * (1 + 1e-12) or (bound == 0 and loads["twist"] != 0):
        blamed = ("tangential_load_x", "tangential_load_y", "torque", "normal_load", *reversed(MEANS))
        name = next((name for name in blamed if getattr(segment, name) is not None), "steps")
        given = getattr(segment, name)
        given = str(given) if isinstance(given, Share) else given
        words = f"tangential load of {force:g} N", f"normal_load = {bound:g} N"
        if period and name in MEANS:
            mean, most = (quantity(load / period.area, "Pa") for load in (force, bound))
            words = f"mean traction of {mean}", f"mean_pressure = {most}"
        sentence = (
            f"gross sliding: the {words[0]} in load step {step.index + 1} is more than "
            f"friction.coefficient x {words[1]}"
        )
        yield Mistake((*key, name), MISSING if given is None else given, sentence)
