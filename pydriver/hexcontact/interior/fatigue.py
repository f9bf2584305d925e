"""Fatigue parameters of a body over a closed cycle, from the stress histories of its points.

Histories are computed block by block, so that memory does not grow with the number of points: a block is as
large as the tractions of the cycle, or 128 MiB.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from .. import fatigue
from ..arrays import Array, DataFrame, Dataset
from ..core import memory
from ..core.lattice import Lattice
from ..deck.below import NEEDS, Criteria
from ..errors import DeckError, NotInResult
from ..text import counted
from . import fields
from .fields import Region, region
from .stress import Fields, Loaded, add_bulk, correct_near_surface, embedded, summed, window_over

COATED = "moduli and constants of fatigue parameters are those of one material"
SLIPS = ("slip_increment_x", "slip_increment_y")
_BLOCK = 1 << 27  # bytes of stress histories that are held at once, at least
_AT_ONCE = 8  # steps whose stress on a plane is held besides


class Meaning(NamedTuple):
    """Unit, name in words, definition and source of a parameter."""

    units: str
    long_name: str
    definition: str = ""
    references: str = ""


_SWT = "K. N. Smith et al., J. Mater. 5 (1970) 767-778; D. F. Socie, J. Eng. Mater. Techn. 109 (1987) 293-298"
_RUIZ = "C. Ruiz et al., Exp. Mech. 24 (1984) 208-217"
MEANINGS = {
    "smith_watson_topper": Meaning(
        "Pa",
        "parameter of Smith, Watson and Topper",
        "largest of all planes: largest normal stress times half the range of the normal strain",
        _SWT,
    ),
    "life": Meaning(
        "1",
        "cycles to a crack by the parameter of Smith, Watson and Topper",
        "N of parameter = strength^2/E (2N)^(2b) + strength ductility (2N)^(b+c)",
        _SWT,
    ),
    "findley": Meaning(
        "Pa",
        "parameter of Findley",
        "largest of all planes: shear amplitude plus findley_slope times the largest normal stress",
        "W. N. Findley, J. Eng. Ind. 81 (1959) 301-306",
    ),
    "fatemi_socie": Meaning(
        "1",
        "parameter of Fatemi and Socie",
        "largest of all planes: shear amplitude/G (1 + slope largest normal stress/yield_stress)",
        "A. Fatemi and D. F. Socie, Fatigue Fract. Eng. Mater. Struct. 11 (1988) 149-165",
    ),
    "crossland": Meaning(
        "Pa",
        "parameter of Crossland",
        "sqrt(J2,a) + crossland_slope times the largest hydrostatic stress",
        "B. Crossland, Int. Conf. on Fatigue of Metals (1956) 138-149",
    ),
    "dang_van": Meaning(
        "Pa",
        "parameter of Dang Van",
        "largest in time: largest shear of the deviator less its mean + dang_van_slope hydrostatic stress",
        "K. Dang Van, ASTM STP 1191 (1993) 120-130",
    ),
    "ruiz_f1": Meaning(
        "Pa m", "first fretting parameter of Ruiz", "largest shear traction times slip_amplitude", _RUIZ
    ),
    "ruiz_f2": Meaning(
        "Pa2 m",
        "second fretting parameter of Ruiz",
        "ruiz_f1 times the largest tension along the slip",
        _RUIZ,
    ),
    "slip_amplitude": Meaning("m", "half the range of the slip along its main direction"),
    "polar": Meaning("rad", "angle from z, 0 to pi, of the normal of the critical plane of the {}"),
    "azimuth": Meaning("rad", "angle from x, -pi/2 to pi/2, of the normal of the critical plane of the {}"),
}
"""The quantities, after the parameters of a deck; those on a critical plane have its angles, too."""


def memory_needed(lattice: Lattice, where: Region, steps: int) -> int:
    """Return the memory (bytes) that the stress histories of a region and their parameters take."""
    loads = 24 * steps * lattice.size
    block = min(max(_BLOCK, loads), 48 * steps * where.count)
    besides = 2 * block  # a block as it comes, and as the parameters take it
    if where.lattice is not None and not summed(lattice, where):
        whole, _, _ = window_over(lattice, where.lattice)
        # tractions, and the stress on a plane twice
        planes = fields.planes_memory(whole, min(steps, _AT_ONCE), coated=False)
        besides = max(besides, planes + 8 * min(steps, _AT_ONCE) * 15 * whole.size)
    return 2 * loads + block + besides + 104 * where.count


def histories(loaded: Loaded, where: Region) -> Iterator[tuple[slice, Array]]:
    """Yield stress histories (points, steps, 6) of a region by blocks, each with the slice of its points."""
    loads, used = loaded.tractions()
    points = where.nodes.reshape(-1, 3) if used == "edges" else np.empty(0)
    for part, history in _of_tractions(loaded, loads, where):
        if used == "edges":
            correct_near_surface(loaded, loads, np.swapaxes(history, 0, 1), points[part])
        yield part, history


def _of_tractions(loaded: Loaded, loads: Array, where: Region) -> Iterator[tuple[slice, Array]]:
    """Yield the histories that follow from the tractions of the lattice."""
    lattice, steps, body, layers = loaded.lattice, loaded.steps, loaded.body, loaded.layers
    block = max(_BLOCK, loads.nbytes)
    most = max(block // (48 * len(steps)), 1)
    memory.require(
        memory_needed(lattice, where, len(steps)),
        f"the stress at {counted(where.count, 'point')} in {counted(len(steps), 'step')}",
        "choose fewer points or steps",
    )
    if where.lattice is None or summed(lattice, where):
        points = where.nodes.reshape(-1, 3)
        for first in range(0, where.count, most):
            part = slice(first, min(first + most, where.count))
            stress = fields.at_points(lattice, loads, body, layers, points[part])[1]
            yield part, np.ascontiguousarray(np.moveaxis(add_bulk(stress, steps, loaded), 0, 1))
        return
    whole, rows, cols = window_over(lattice, where.lattice)
    loads = embedded(lattice, whole, loads)
    n_row, n_col = where.lattice.shape
    high = max(most // n_col, 1)
    for plane, depth in enumerate(where.depths):
        for row in range(0, n_row, high):
            shown = rows[row : row + high]
            block_of = np.empty((len(shown) * n_col, len(steps), 6))
            for first in range(0, len(steps), _AT_ONCE):
                some = slice(first, first + _AT_ONCE)
                found = fields.on_planes(whole, loads[some], body, layers, [depth])[:, 0]
                stress = np.moveaxis(found[..., shown, cols], 1, -1)
                stress = add_bulk(stress.reshape(len(stress), -1, 6), steps[some], loaded)
                block_of[:, some] = np.moveaxis(stress, 0, 1)
            start = plane * where.lattice.size + row * n_col
            yield slice(start, start + len(block_of)), block_of


def parameters_below(loaded: Loaded, where: Mapping[str, Any], criteria: Criteria) -> Dataset:
    """Return fatigue parameters of a body."""
    import xarray

    found = region(loaded.lattice, **where)
    if loaded.coated:
        raise NotInResult(f"body {loaded.body} has a coating: {COATED}")
    [[_, shear_modulus, nu]] = loaded.layers
    moduli = {"young_modulus": 2.0 * shear_modulus * (1.0 + nu), "poisson_ratio": nu}
    moduli["shear_modulus"] = shear_modulus
    slip = _surface_slip(loaded.lattice, loaded.steps, found) if "ruiz" in criteria.parameters else None
    values: dict[str, Array] = {}
    for part, history in histories(loaded, found):
        nodal = None if slip is None else slip[..., part]
        block: dict[str, Array] = {}
        for name in sorted(set(criteria.parameters), key=list(NEEDS).index):  # life after its parameter
            block |= _computed(name, criteria, moduli, history, nodal, block.get("smith_watson_topper"))
        for key, some in block.items():
            values.setdefault(key, np.empty(found.count))[part] = some
    return xarray.Dataset(
        {
            key: (found.dims, some.reshape(found.shape), _about(key, criteria, moduli))
            for key, some in values.items()
        },
        coords=found.coordinates,
        attrs={"body": np.int32(loaded.body), "tractions": loaded.source},
    )


def _computed(
    name: str,
    criteria: Criteria,
    moduli: Mapping[str, float],
    history: Array,
    slip: Array | None,
    energy: Array | None,
) -> dict[str, Array]:
    """Return the quantities of a parameter at some points; `energy` is that of Smith, Watson and Topper."""
    if name == "ruiz":
        assert slip is not None
        path = np.ascontiguousarray(np.moveaxis(slip, -1, 0))  # point, step, component
        found = fatigue.ruiz(path[..., :2], path[..., 2:], history)
        return {"ruiz_f1": found.f1, "ruiz_f2": found.f2, "slip_amplitude": found.slip_amplitude}
    if name == "life":
        if energy is None:
            energy = _by_name("smith_watson_topper", criteria, moduli, history).value
        numbers = [getattr(criteria, key) for key in NEEDS[name]]
        return {name: fatigue.life(energy, moduli["young_modulus"], *numbers)}
    plane = _by_name(name, criteria, moduli, history)
    if not isinstance(plane, fatigue.CriticalPlane):
        return {name: plane}
    x, y, z = np.where(plane.value == 0.0, np.nan, plane.normal.T)
    x, y, z = np.where(x < 0.0, (-x, -y, -z), (x, y, z))  # of the two normals the one that points along x
    return {
        name: plane.value,
        f"{name}_polar": np.arccos(np.clip(z, -1.0, 1.0)),
        f"{name}_azimuth": np.arctan2(y, x),
    }


def _by_name(name: str, criteria: Criteria, moduli: Mapping[str, float], history: Array) -> Any:
    """Call the function of a parameter with those of the moduli and constants that it takes."""
    constants = {key.removeprefix(f"{name}_"): getattr(criteria, key) for key in NEEDS[name]}
    return getattr(fatigue, name)(history, **constants, **_moduli_of(name, moduli))


def _moduli_of(name: str, moduli: Mapping[str, float]) -> dict[str, float]:
    """Return the moduli that a parameter depends on."""
    return {key: moduli[key] for key in inspect.signature(getattr(fatigue, name)).parameters if key in moduli}


def _surface_slip(lattice: Lattice, steps: Sequence[Fields], where: Region) -> Array:
    """Return shear traction and slip so far at the nodes of the surface, (step, 4, n)."""
    if where.lattice is None or where.depths.tolist() != [0.0]:
        raise DeckError("ruiz: expected the nodes of the surface, the region that is taken if none is given")
    if lost := [name for name in (*SLIPS, "traction_x", "traction_y") if name not in steps[0]]:
        raise DeckError(f"ruiz: expected {lost[0]} in the result: a contact with friction (output.fields)")
    whole, rows, cols = window_over(lattice, where.lattice)
    names = ("traction_x", "traction_y", *SLIPS)
    nodal = np.array([[np.asarray(step[name], dtype=float) for name in names] for step in steps])
    nodal[:, 2:] = np.cumsum(nodal[:, 2:], axis=0)
    return embedded(lattice, whole, nodal)[..., rows, cols].reshape(len(steps), 4, -1)


def _about(key: str, criteria: Criteria, moduli: Mapping[str, float]) -> dict[str, Any]:
    """Return the attributes of a quantity: meaning, source and the constants that it was computed with."""
    name, _, angle = key.rpartition("_")
    if angle in ("polar", "azimuth"):
        meaning = MEANINGS[angle]
        return {"long_name": meaning.long_name.format(MEANINGS[name].long_name), "units": meaning.units}
    meaning = MEANINGS[key]
    attributes = {k: value for k, value in meaning._asdict().items() if value}
    if key not in NEEDS:
        return attributes
    constants = {name: getattr(criteria, name) for name in NEEDS[key]}
    return attributes | constants | _moduli_of("smith_watson_topper" if key == "life" else key, moduli)


def tabulated(places: Array, first: int, history: Array, numbers: Sequence[int]) -> DataFrame:
    """Return histories at some places as a table that pyLife takes: stresses in MPa by point and load step.

    The columns S11 ... S23 are those that pyLife expects; 1, 2, 3 stand for x, y, z. Points count from
    `first`.
    """
    import pandas

    points = range(first, first + len(places))
    index = pandas.MultiIndex.from_product([points, list(numbers)], names=["node_id", "load_step"])
    table = pandas.DataFrame(np.repeat(places, len(numbers), axis=0), index, ["x", "y", "depth"])
    table[["S11", "S22", "S33", "S12", "S23", "S13"]] = 1e-6 * history.reshape(-1, 6)
    return table
