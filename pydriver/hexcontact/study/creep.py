"""Creep tables: the loads of a rolling contact by creepages and spin, for programs that simulate vehicles.

One contact is solved for all cases, in the steady state, by one call of the core for each line of the table.
The file of the table is read by the programs of ``hexcontact/creep_table.py``, whose interpolation is
compared with further cases.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from .._version import __version__
from ..arrays import Array, Dataset
from ..core.friction import Rolling
from ..creep_table import CreepTable
from ..errors import ConvergenceError, DeckError
from ..files import text_of
from ..problem.problem import Problem
from ..solve import steps as solving
from ..solve.events import Listener, Listeners, Log
from ..solve.window import FrictionWindow
from ..text import quantity
from ..variables import CREEPAGES, VARIABLES
from .dataset import ABOUT, FLAGS, refuse_foreign, write, writing
from .plan import StudyFile, base_of

_HEAD = "# hexcontact creep table"
_LOADS = ("tangential_load_x", "tangential_load_y", "torque")
_AXES = ("xi", "eta", "phi")
_TO_SLIP = (3.0, 4.0, 4.0)  # largest creepages over mu p_max/G and spin over that by a: all nodes slip
_DENSER = 2.0  # values of an axis are equidistant in asinh(sinh(2) x/x_max)
_FINE = 0.005  # error of interpolation over mu P that is not worth more cases
_POLE = 0.45  # distance of the pole from the middle of the contact, over the half-length


@dataclass
class _Rolled:
    """A contact that rolls freely, from which all cases start."""

    window: FrictionWindow
    state: Any  # after the last case
    limit: float  # mu P [N]
    radius: float  # of a circle with the area of the contact [m]
    unit: float  # creepage mu p_max/G
    pole: Array  # point whose creepages are axes of the table [m]
    half_length: float  # of the contact along the direction of rolling [m]


class CreepStudy:
    """A creep table that a study file describes; DeckError with a sentence for each fault.

    ``output`` is the netCDF file, ``table`` the text that other programs read, beside it.
    """

    def __init__(self, file: StudyFile, name: str, case: Problem, output: str | Path | None) -> None:
        assert file.creep_table is not None
        self.file, self.name, self.case, self.keys = file, name, case, file.creep_table
        self.output = Path(output or file.output or f"{Path(name).stem}.nc")
        if self.output.suffix != ".nc":
            raise DeckError(
                f"output {self.output}: expected a netCDF file, such as {self.output.with_suffix('.nc')}"
            )
        self.table = self.output.with_suffix(".txt")
        self._check()

    @classmethod
    def from_toml(cls, path: str | Path, output: str | Path | None = None) -> Self:
        """Read a study file with [creep_table] and its deck."""
        file = StudyFile.read(path)
        return cls(file, str(path), Problem._made(base_of(Path(path).parent / file.deck)), output)

    @property
    def title(self) -> str:
        """Title of the table."""
        return self.file.title or Path(self.name).stem

    def _check(self) -> None:
        """Refuse decks that do not end with steady rolling, and laws of friction without a mu P."""
        case, last = self.case, self.case.load_steps[-1]
        if last.roll is None or not last.roll.steady:
            key = f"load.{len(case.deck.load)}.rolling"
            raise DeckError(
                f'{self.name}: {key}: expected "steady" in the last entry of [[load]] of the deck'
            )
        self.direction = last.roll.direction
        if not 0.0 < case.friction_coefficient < math.inf:
            raise DeckError(
                f"{self.name}: friction.coefficient: expected one number above 0 for a creep table"
            )
        given = {name: getattr(self.keys, name) for name in CREEPAGES}
        for name in ("creepage_x", "spin"):
            if case.pair.beta != 0.0 and (given[name] is None or given[name][0] == 0.0):
                raise DeckError(
                    f"{self.name}: creep_table.{name}: expected numbers below and above 0: "
                    "the loads of unlike bodies are not mirrored"
                )

    def run(self, listener: Listener | None = None) -> Dataset:
        """Solve all cases, measure the error of interpolation, write both files, and return the data set.

        DeckError if another file has the name of one of both; ConvergenceError for a case without solution;
        ResourceError if a file cannot be written.
        """
        listener, started = Listeners(Log(), listener or Listener()), time.perf_counter()
        refuse_foreign(self.output)
        if self.table.exists() and not text_of(self.table, "a creep table").startswith(_HEAD):
            raise DeckError(f"{self.table} exists and is no creep table; choose another output")
        counts = self.keys.counts
        with listener.following(self.title, math.prod(counts)):
            rolled = self._rolled()
            axes = self._axes(rolled)
            at = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
            creepages = _unturned(at, rolled.pole)
            loads, work = np.zeros_like(at), np.zeros(counts)
            for number, along in enumerate(_lines(counts), start=1):
                loads[along], work[along] = self._solved(rolled, creepages[along])
                if number % counts[1] == 0:
                    listener.said("cases", f"{number * counts[0]} of {work.size} cases")
            rows = loads.transpose(2, 1, 0, 3).reshape(-1, 3).tolist()
            table = CreepTable([axis.tolist() for axis in axes], rolled.pole.tolist(), rolled.limit, rows)
            errors = self._errors(table, rolled, axes)
            stated = ", ".join(f"{100 * error:.2f} %" for error in errors)
            seconds = time.perf_counter() - started
            words = f"{work.size} cases in {quantity(seconds, 's', 3)}, {work.mean():.0f} applications each"
            listener.said("table", words, cases=work.size, seconds=seconds, applications=float(work.mean()))
            words = f"largest errors of interpolation over mu P at {self.keys.held_out} other cases: {stated}"
            words += "; larger counts make them smaller" if max(errors) > _FINE else ""
            listener.said("interpolated", words, errors=errors)
            dataset = self._dataset(axes, creepages, loads, work, errors, rolled)
            self._write(table, stated, dataset)
        return dataset

    def _rolled(self) -> _Rolled:
        """Solve the loads before the last segment of the deck, and free rolling."""
        case, last = self.case, self.case.load_steps[-1]
        before = [step for step in case.load_steps if step.segment < last.segment]
        window, state = FrictionWindow(case, case.lattice), None
        for step in solving.steps(case, targets=before) if before else ():
            window = FrictionWindow(case, step.lattice)
            state = window.restored(step)
        state = window.contact.virgin() if state is None else state
        _, _, state = self._called(window, state, [[0.0, 0.0, 0.0]])
        lattice, inside = window.lattice, state.pressure > 0.0
        along = np.array([math.cos(self.direction), math.sin(self.direction)])
        way = (along[0] * lattice.x + along[1] * lattice.y)[inside]
        half_length = 0.5 * float(way.max() - way.min())
        pair, limit = case.solved_pair, case.friction_coefficient * state.normal_load
        stiffness = 1.0 / (math.pi * (pair.lambda_1 + pair.lambda_5))
        unit = case.friction_coefficient * float(state.pressure.max()) / stiffness
        radius = math.sqrt(float(inside.sum()) * lattice.cell_area / math.pi)
        return _Rolled(window, state, limit, radius, unit, _POLE * half_length * along, half_length)

    def _axes(self, rolled: _Rolled) -> list[Array]:
        """Return the values along the three axes, which are denser near 0."""
        x, y, spin = (rolled.unit * factor for factor in _TO_SLIP)
        spin /= rolled.half_length
        ranges = ((0.0, x), (-y, y), (0.0, spin))
        given = [getattr(self.keys, name) for name in CREEPAGES]
        return [
            _graded(own or default, np.linspace(0.0, 1.0, count))
            for own, default, count in zip(given, ranges, self.keys.counts, strict=True)
        ]

    def _called(self, window: FrictionWindow, state: Any, creepages: Any) -> tuple[Array, Array, Any]:
        """Return loads, work and last state of some cases."""
        last, solver = self.case.load_steps[-1], self.case.solver
        how = last.z.control, last.z.value, creepages, Rolling(self.direction), solver.tolerance
        loads, work, after = window.contact.creep_loads(state, *how)
        if len(loads) < len(creepages) or after.touches_rim:
            names = zip(CREEPAGES, creepages[len(loads) - after.touches_rim], strict=True)
            case = ", ".join(f"{name} = {value:.6g}" for name, value in names)
            if after.touches_rim:
                raise DeckError(f"{self.name}: grid: the contact reaches the rim of the window ({case})")
            raise ConvergenceError(f"{self.name}: the steady state of {case} is not found")
        return loads, work, after

    def _solved(self, rolled: _Rolled, creepages: Any) -> tuple[Array, Array]:
        """Return loads and work of some cases, each of which starts from the case before it."""
        loads, work, rolled.state = self._called(rolled.window, rolled.state, creepages)
        return loads, work

    def _errors(self, table: CreepTable, rolled: _Rolled, axes: Sequence[Array]) -> list[float]:
        """Return the largest errors of the interpolated loads over mu P, and of the torque over mu P c."""
        from scipy.stats import qmc

        parts = qmc.LatinHypercube(3, seed=np.random.default_rng(0)).random(self.keys.held_out)
        ends = [(-axis[-1] if axis[0] == 0.0 else axis[0], axis[-1]) for axis in axes]
        at = np.stack([_graded(end, part) for end, part in zip(ends, parts.T, strict=True)], axis=-1)
        creepages = _unturned(at, rolled.pole)
        found, _ = self._solved(rolled, creepages)
        errors = np.abs(np.array([table(*case) for case in creepages.tolist()]) - found).max(axis=0)
        scale = rolled.limit * np.array([1.0, 1.0, rolled.radius])
        return [float(error) for error in errors / scale]

    def _dataset(
        self, axes: Sequence[Array], creepages: Array, loads: Array, work: Array, errors: Any, rolled: _Rolled
    ) -> Dataset:
        """Return the data set, of the form of a study."""
        import xarray

        power = -(creepages * loads).sum(axis=-1)
        values = dict(zip(CREEPAGES, np.moveaxis(creepages, -1, 0), strict=True))
        values |= dict(zip(_LOADS, np.moveaxis(loads, -1, 0), strict=True))
        values |= {"creep_power": power, "operator_applications": work}
        columns: dict[str, Any] = {name: (_AXES, values[name], VARIABLES[name].attributes) for name in values}
        none = np.zeros(work.shape)
        columns["status"] = _AXES, none.astype("i1"), {"long_name": "state of the case", **FLAGS}
        columns["exit_code"] = _AXES, none.astype("i2"), {"long_name": "exit code of the case", "units": "1"}
        columns["message"] = _AXES, np.full(work.shape, ""), {"long_name": "why the case failed"}
        number = np.arange(1, work.size + 1, dtype="i4").reshape(work.shape)
        columns["case_number"] = _AXES, number, {"long_name": "number of the case", "units": "1"}
        words = ("creepage x", "creepage y", "spin")
        units = [VARIABLES[name].attributes["units"] for name in CREEPAGES]
        coordinates = {
            name: (name, axis, {"long_name": f"{word} at the pole", "units": unit, "deck_key": f"load.{key}"})
            for name, axis, word, unit, key in zip(_AXES, axes, words, units, CREEPAGES, strict=True)
        }
        about = {"pole": rolled.pole, "friction_limit": rolled.limit, "interpolation_error": errors}
        return xarray.Dataset(columns, coordinates, ABOUT | about)

    def _write(self, table: CreepTable, stated: str, dataset: Dataset) -> None:
        """Write both files."""
        lines = [
            f"{_HEAD} 1, of hexcontact {__version__}: {' '.join(self.title.split())}",
            "# numbers of creepages x, creepages y, spins; pole [m], mu P [N]; the three axes [1, 1, rad/m];",
            "# loads on body 1 along x and y [N] and torque [N m], creepage x the fastest",
            f"# largest errors of interpolation at {self.keys.held_out} other cases, over mu P: {stated}",
            " ".join(map(str, self.keys.counts)),
            _written([*table.pole, table.limit]),
            *map(_written, (*table.axes, *table.loads)),
        ]
        write(dataset, self.output, self.title, self.file)
        with writing(self.table) as path:
            path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _written(numbers: Sequence[float]) -> str:
    return " ".join(f"{number:.9g}" for number in numbers)


def _graded(ends: tuple[float, ...], parts: NDArray[Any]) -> Array:
    """Return values at fractions of a range, dense near 0."""
    low, high = ends
    width = max(-low, high) / math.sinh(_DENSER)
    first, last = np.arcsinh([low / width, high / width])
    found = width * np.sinh(first + (last - first) * parts)
    found[np.abs(found) < 1e-12 * width] = 0.0
    return found


def _unturned(at: Array, pole: Array) -> Array:
    """Return creepages and spin (last axis) of those at the pole."""
    return at + at[..., 2:] * np.array([pole[1], -pole[0], 0.0])


def _lines(counts: Sequence[int]) -> Iterator[tuple[Any, ...]]:
    """Yield the lines of a table along its first axis, each beginning beside the end of the line before."""
    backward = 1
    for k in range(counts[2]):
        for j in range(counts[1])[:: (-1) ** k]:
            backward = -backward
            yield slice(None, None, -backward), j, k
