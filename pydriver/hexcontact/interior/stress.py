"""Stress and displacement below the surface: at points, along lines, on planes of any orientation, in boxes.

Points are given by x, y and their depth below the surface of their body; components are those of the axes of
the result, of which z points into body 1. Stress is positive in tension.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, DataArray, Dataset
from ..core import flat, kernel_cache, memory
from ..core.calls import integer
from ..core.contact import pair_of
from ..core.edges import ContactEdges, TractionField
from ..core.friction import FrictionLaw
from ..core.lattice import Lattice
from ..core.measures import limits_of_error
from ..deck.below import SOURCES
from ..deck.keys import Body
from ..deck.read import recorded
from ..errors import DeckError, NotInResult
from ..text import counted, did_you_mean, percent, quantity
from ..variables import BULK_STRESS, EDGES, STRESSES, TRACTIONS
from . import fields
from .fields import Region, region

_LEAST = ("life",)  # quantities whose least value counts
_ALIKE = 1e-6  # share of a value within which others count as equal: the first of them is named
_SHALLOW = 2.0  # depth in spacings down to which a value depends on the few nodes next to an edge


def with_places(found: Dataset) -> Dataset:
    """Give each quantity the attributes largest, largest_at and largest_step, life least and so on."""
    for name, field in found.data_vars.items():
        values = np.where(np.isfinite(field.values), field.values, np.nan)
        if field.attrs.get("units") == "rad" or np.isnan(values).all():
            continue
        word, end = ("least", np.nanmin(values)) if name in _LEAST else ("largest", np.nanmax(values))
        first = np.flatnonzero(abs(values - end) <= _ALIKE * abs(end))[0]
        at = field.isel(dict(zip(field.dims, np.unravel_index(first, values.shape), strict=True)))
        field.attrs[word] = float(end)
        field.attrs[f"{word}_at"] = [float(at[axis]) for axis in ("x", "y", "depth")]
        if "step" in at.coords:
            field.attrs[f"{word}_step"] = int(at["step"])
    return found


def with_errors(found: Dataset, spacing: float, others: Sequence[tuple[float, Dataset]]) -> None:
    """Give each quantity largest_error, life least_factor, by spacing and table of other lattices."""
    spacings = np.array([spacing, *(other for other, _ in others)]) / spacing
    for name, field in found.data_vars.items():
        word = "least" if name in _LEAST else "largest"
        if word not in field.attrs:
            continue
        values = np.array(
            [one[name].attrs.get(word, np.nan) for one in (found, *(other for _, other in others))]
        )
        rough = np.array([field.attrs[f"{word}_at"][2] < _SHALLOW * spacing])
        values = np.log(values) if name in _LEAST else values
        error = float(limits_of_error(spacings, values[:, None], rough)[0])
        field.attrs |= {"least_factor": float(np.exp(error))} if name in _LEAST else {"largest_error": error}


def _error_of(field: DataArray) -> str:
    """Return the estimated error of the value that counts in words; empty if the file has none."""
    attributes = field.attrs
    error = float(attributes.get("least_factor", attributes.get("largest_error", 0.0)))
    if not np.isfinite(error):
        return " with an unknown error"
    if "least_factor" in attributes:
        return f" within a factor of {error:.2g}"
    if not error:
        return ""
    share = error / max(abs(float(attributes["largest"])), np.finfo(float).tiny)
    return f" ± {percent(share) if share <= 1.0 else _worded(error, field)}"


def _worded(value: float, field: DataArray) -> str:
    units = str(field.attrs.get("units", "")).removesuffix("1")
    return quantity(value, units) if " " not in units else f"{quantity(value)} {units}"


def place_of(field: DataArray) -> str:
    """Return the value that counts and its place in words; empty if the file has none."""
    word = "least" if field.name in _LEAST else "largest"
    if (at := field.attrs.get(f"{word}_at")) is None:
        return ""
    text = _worded(float(field.attrs[word]), field) + _error_of(field)
    x, y, depth = (quantity(float(place), "m") for place in at)
    step = field.attrs.get(f"{word}_step")
    return f"{word} {text} at x = {x}, y = {y}, depth {depth}" + (f", step {step}" if step else "")


Fields = Mapping[str, NDArray[Any]]
Bodies = Sequence[Body]

# fields of each step, as read and for the core; corrected ones, while others follow and in all
_LOADED_ARRAYS, _CORRECTED_ARRAYS = 8, (3, 6)
# fields as floats that are read for them, and bytes of each that the netCDF library keeps
_READ_ARRAYS, _READ_KEPT = 4, 16 * 2**20
_EDGE_ARRAYS = 11  # arguments and results of the correction at the edges
_STICK = 1  # value of zone at a sticking node
NEAR = 1.0  # depth in spacings above which the stress is corrected at the edges
_SUMS_FOR_A_NODE = 50  # pyramids summed at single points in the time of a node of a plane, at least
TENSOR = tuple(f"stress_{ab}" for ab in fields.COMPONENTS)
"""Components of the stress in the order of the core, which is that of symmetric tensors in VTK."""
_AT_SURFACE = ("stress_zz", "stress_xz", "stress_yz")  # of pressure and shear tractions, in either body
_INVARIANTS = tuple(name for name in STRESSES if STRESSES[name].units == "Pa" and name not in TENSOR)
_DISPLACEMENTS = tuple(name for name in STRESSES if STRESSES[name].units == "m")


def bodies_of(deck: str) -> Bodies:
    """Return the two bodies of a deck; none if the deck does not define them."""
    known = recorded(deck)
    if not (tables := known.tables("body", "interface")):
        return ()
    bodies = tables["body"]
    if tables["interface"] and known.separation and known.separation.flat:
        raise NotInResult(
            "there is no stress to compute below the window of a full contact, which has no end"
        )
    return bodies.body_1, bodies.body_2


@dataclasses.dataclass(frozen=True)
class Loaded:
    """One of the two bodies under the tractions of load steps."""

    lattice: Lattice  # window of the steps
    steps: Sequence[Fields]  # tractions at the nodes, bulk stress, and the fields of `EDGES` if they are kept
    bodies: Bodies
    body: int  # 1 or 2
    friction: float = 0.0
    # tractions to the edges by the place of a step, which the stress at depth 0 has exactly
    surface: Callable[[int], TractionField] | None = None

    @property
    def layers(self) -> Array:
        """Thickness (m), shear modulus (Pa) and Poisson's ratio of the layers, and of the body below."""
        if integer(self.body, "body") not in (1, 2):
            raise DeckError(f"body = {self.body}: expected 1 or 2")
        if not self.bodies:
            raise NotInResult("the result has no elastic constants of the bodies")
        one = self.bodies[self.body - 1]
        if one.rigid and not one.coating:
            raise NotInResult(f"body {self.body} is rigid: there is no stress to compute in it")
        constants = [(of.thickness, of.young_modulus, of.poisson_ratio) for of in one.coating]
        constants.append((0.0, one.young_modulus or 0.0, one.poisson_ratio or 0.0))
        return np.array([(t, e / (2.0 * (1.0 + nu)), nu) for t, e, nu in constants])

    @property
    def coated(self) -> bool:
        """Whether the body has layers."""
        return len(self.layers) > 1

    @property
    def source(self) -> str:
        """Source of tractions by default: the edges, if the contact has some and their fields are kept."""
        kept = all(name in step for step in self.steps for name in EDGES)
        return "edges" if kept and not self.lattice.periodic else "nodes"

    def tractions(self, source: str | None = None) -> tuple[Array, str]:
        """Return the tractions (step, 3, n_row, n_col; Pa) of the steps, and their source."""
        if source is not None and source not in SOURCES:
            raise DeckError(f"source = {source!r}: expected {' or '.join(SOURCES)}")
        at_nodes = nodal_tractions(self.steps)
        if (source or self.source) == "nodes":
            return at_nodes, "nodes"
        if self.lattice.periodic:
            raise DeckError(f'source = "{source}": expected "nodes" in a window that repeats')
        if missing := [name for name in EDGES if any(name not in step for step in self.steps)]:
            raise NotInResult(
                f"source = {source!r}: expected nodes; the edges need {' and '.join(missing)}, which was not "
                "kept"
            )
        law = _law_of(self.friction)
        pair = pair_of(*self.bodies)
        corrected = [
            _edges(self.lattice, one, step).tractions(one[1:], np.asarray(step["zone"]) == _STICK, law, pair)
            for one, step in zip(at_nodes, self.steps, strict=True)
        ]
        return np.array(corrected), "edges"


def nodal_tractions(steps: Sequence[Fields]) -> Array:
    """Return pressure and shear tractions of some steps as the core takes them, (step, 3, n_row, n_col)."""
    zero = np.zeros_like(np.asarray(steps[0]["pressure"], dtype=float))
    return np.array([[np.asarray(step.get(name, zero), dtype=float) for name in TRACTIONS] for step in steps])


def _law_of(friction: float) -> FrictionLaw:
    """Return the law, without friction where shear tractions do not follow the pressure."""
    return FrictionLaw(friction if math.isfinite(friction) else 0.0)


def _edges(lattice: Lattice, loads: Array, step: Fields) -> ContactEdges:
    """Return the edges of a contact."""
    gap = np.asarray(step["gap"], dtype=float)
    touching = np.asarray(step["zone"]) > 0
    return ContactEdges(loads[0], gap, touching, np.isfinite(gap), lattice.basis, lattice.start)


def below(
    loaded: Loaded,
    where: Mapping[str, Any],
    components: Sequence[str] = (),
    numbers: Sequence[int] | None = None,
    source: str | None = None,
) -> Dataset:
    """Return quantities below the surface; without `numbers` of steps there is one, and no such dimension."""
    import xarray

    lattice, steps, body = loaded.lattice, loaded.steps, loaded.body
    found = region(lattice, **where)
    for name in components:
        if not isinstance(name, str) or name not in STRESSES:
            hint = did_you_mean(str(name), STRESSES) or f"; there are {', '.join(STRESSES)}"
            raise DeckError(f"{name!r} is no quantity below the surface{hint}")
    names = tuple(components) or (*TENSOR, "von_mises_stress")
    layers = loaded.layers
    loads, used = loaded.tractions(source)
    if found.lattice is None or summed(lattice, found):
        memory.require(
            memory_needed(lattice, found, len(loads), loaded.coated),
            f"the stress at {counted(found.count, 'point')} in {counted(len(loads), 'step')}",
            "choose fewer points or steps",
        )
        flat = fields.at_points(lattice, loads, body, layers, found.nodes)
        moved, stress = (values.reshape(len(loads), *found.shape, -1) for values in flat)
    else:
        moved = np.empty((0, 3))
        if any(name in _DISPLACEMENTS for name in names):
            moved = _in_box(loaded, loads, found, len(_DISPLACEMENTS))
        stress = _in_box(loaded, loads, found, len(TENSOR))
    add_bulk(stress, steps, loaded)
    about: dict[str, Any] = {"body": np.int32(body), "tractions": used}
    if used == "edges":
        stress = np.ascontiguousarray(stress)
        given = loaded, loads, stress.reshape(len(steps), -1, len(TENSOR)), found.nodes.reshape(-1, 3)
        about["edge_without_root"] = correct_near_surface(*given)
    values = {name: stress[..., k] for k, name in enumerate(TENSOR)}
    if any(name in _INVARIANTS for name in names):
        scalars = fields.invariants(stress)
        values |= {name: scalars[..., k] for k, name in enumerate(_INVARIANTS)}
    values |= {name: moved[..., k] / layers[0, 1] for k, name in enumerate(_DISPLACEMENTS)}
    quantities = {name: (("step", *found.dims), values[name], STRESSES[name].attributes) for name in names}
    whole = xarray.Dataset(quantities, coords=found.coordinates, attrs=about)
    return whole.isel(step=0) if numbers is None else whole.assign_coords(step=list(numbers))


def add_bulk(stress: Array, steps: Sequence[Fields], loaded: Loaded) -> Array:
    """Add the bulk stress of a body to the stress (step, ..., component) by its tractions, and return it."""
    for name in BULK_STRESS:
        bulk = [float(step.get(name, 0.0)) * (step.get("bulk_body") == loaded.body) for step in steps]
        if any(bulk) and loaded.coated:
            raise NotInResult(
                f"body {loaded.body} has a coating and a bulk stress: that of the layers is not computed"
            )
        component = TENSOR.index(name.removeprefix("bulk_"))
        stress[..., component] += np.reshape(bulk, (-1, *[1] * (stress.ndim - 2)))
    return stress


def correct_near_surface(of: Loaded, loads: Array, stress: Array, points: Array) -> float:
    """Correct the stress (step, point, 6) of hats at points (point, 3): roots at edges, tractions at depth 0.

    Return the largest share of an edge without a root.
    """
    thickness, _, poisson_ratio = of.layers[0]
    # the correction is that of the outermost material
    deepest, refused = (thickness if of.coated else math.inf), 0.0
    near = (points[:, 2] < NEAR * of.lattice.spacing) & (points[:, 2] <= deepest)
    if near.any():
        for k, (step, load) in enumerate(zip(of.steps, loads, strict=True)):
            [nodal] = nodal_tractions([step])
            more, share = _edges(of.lattice, nodal, step).stress(
                *(nodal[1:], np.asarray(step["zone"]) == _STICK, _law_of(of.friction), load),
                *(of.body, poisson_ratio, points[near]),
            )
            stress[k, near] += more
            refused = max(refused, share)
    free = points[:, 2] == 0.0
    if of.surface is not None and free.any():
        x, y, _ = points[free].T
        for k in range(len(stress)):
            for name, values in zip(_AT_SURFACE, of.surface(k)(x, y), strict=True):
                stress[k, free, TENSOR.index(name)] = 0.0 - values  # no sign on zero
    return refused


def summed(lattice: Lattice, box: Region) -> bool:
    """Return whether sums at the nodes of a box take less work than planes that cover it and the window."""
    assert box.lattice is not None
    if lattice.periodic:
        return False
    return box.lattice.size * lattice.size < _SUMS_FOR_A_NODE * window_over(lattice, box.lattice)[0].size


def memory_needed(
    lattice: Lattice, where: Region, steps: int, coated: bool = False, kept: bool = False
) -> int:
    """Return the memory (bytes) of the stress of steps; `kept`: with the spectra for the next one."""
    if where.lattice is None or summed(lattice, where):
        waves = fields.planes_memory(lattice, steps, coated) if lattice.periodic else 0
        return 8 * steps * (6 * lattice.size + 30 * where.count) + waves
    whole, count = window_over(lattice, where.lattice)[0], steps * where.depths.size
    # of fifteen influences, of each further depth; stored if those of all depths fit
    spectra = 15 * 8 * 2 * whole.size * (where.depths.size - 1)
    kept = kept and spectra <= kernel_cache.bound() and not (lattice.periodic or coated)
    return (
        fields.planes_memory(whole, steps, coated)
        + 8 * (12 * count * where.lattice.size + (6 * count + 6 * steps) * whole.size)
        + kept * spectra
    )


def tractions_needed(
    lattice: Lattice, steps: int, contact: int, sheared: bool, spectra: int, source: str | None = None
) -> int:
    """Return the memory (bytes) of the tractions of load steps, with their correction at the edges."""
    field = 8 * lattice.size
    loaded = field * _LOADED_ARRAYS * steps + _READ_ARRAYS * min(field * steps, _READ_KEPT)
    if source == "nodes":
        return loaded
    each, all_of_them = _CORRECTED_ARRAYS
    correction = _EDGE_ARRAYS * field + flat.memory_of_edges(*lattice.extent, contact, sheared, spectra, 0)
    return loaded + max(field * each * steps + correction, field * all_of_them * steps)


def _in_box(of: Loaded, loads: Array, where: Region, components: int) -> Array:
    """Return stress, or displacement times shear modulus, (step, depth, n_row, n_col, component)."""
    target = where.lattice
    assert target is not None
    memory.require(
        memory_needed(of.lattice, where, len(loads), of.coated),
        f"the stress at {where.depths.size} x {target.n_row} x {target.n_col} nodes "
        f"in {counted(len(loads), 'step')}",
        "choose a smaller box, or one nearer to the window, fewer depths or steps",
    )
    whole, rows, cols = window_over(of.lattice, target)
    given = embedded(of.lattice, whole, loads), of.body, of.layers, where.depths
    found = fields.on_planes(whole, *given, components=components)
    return np.moveaxis(found[..., rows, cols], 2, -1)


def embedded(lattice: Lattice, whole: Lattice, values: Array) -> Array:
    """Return fields (step, component, n_row, n_col) on a window that covers theirs."""
    if whole == lattice:
        return values
    return np.array([[lattice.embed(field, whole) for field in step] for step in values], dtype=float)


def window_over(lattice: Lattice, target: Lattice) -> tuple[Lattice, NDArray[Any], NDArray[Any]]:
    """Return a window with the nodes of two others, and rows (n, 1) and columns (1, n) of the second in it.

    A window that repeats has all nodes.
    """
    whole = lattice if lattice.periodic else lattice.joined(target)
    rows, cols = target.rows - whole.row_first, target.cols - whole.col_first
    return whole, rows[:, None] % whole.n_row, cols[None, :] % whole.n_col
