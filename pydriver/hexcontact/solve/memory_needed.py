"""Memory that a run needs: one table of fields by feature, compared with the memory that is available."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

from ..core import contact, kernel_cache, memory, ranks
from ..core.friction import row_ahead
from ..core.lattice import Lattice
from ..deck.below import cycle_of
from ..deck.units import readable
from ..problem.checks import stage_of
from ..problem.problem import Problem
from ..text import listed
from ..variables import DISPLACEMENTS, MOVED_GAP, STATE, WORN

_ITEM = 8  # bytes of a float
# Measured by tests/bench/memory.py.
_WRITING = 24 * 2**20  # bytes of netCDF and HDF5, which an interim output loads beside the solver
_LOADED = 5 * 2**20  # bytes of modules that a run imports
_LOADED_AFTER = 105 * 2**20  # bytes of xarray, pandas and others, which read a result
_PART = {False: 140, True: 500}  # bytes of a node in contact, for parts of the window, by friction


def is_shared(case: Problem, lattice: Lattice) -> bool:
    """Test whether all ranks share the rows of a window.

    Where nodes that enter slip from where their gap closed, and in steady rolling across rows, a node depends
    on those of all rows.
    """
    if case.method_for(lattice) != "fft" or not ranks.share(lattice):
        return False
    rolls = [step.roll.direction for step in case.load_steps if step.roll and step.roll.steady]
    across = any(row_ahead(lattice, direction)[1] for direction in rolls)
    return not (case.frictional and (_interpolates(case) or across))


def _interpolates(case: Problem) -> bool:
    """Test whether nodes that enter slip from where their gap closed."""
    return case.solver.algorithm == "incremental" and case.solver.entry == "interpolated"


def fields_held(case: Problem) -> int:
    """Return the number of fields that Python and the core hold besides the solver, by feature."""
    friction = case.frictional
    table = [
        # initial gap of a record; with friction the state before, which the core holds, and holes in the heap
        (True, 10 if friction else 1),
        (friction and _interpolates(case), 45),  # places of nodes when their gap closed
        (case.adaptive, 40),  # the path in whole steps, and edges
        (math.isnan(case.friction_coefficient), 6),  # coefficients by node, also on lattices and parts
        (case.deck.wear, 56),  # cycles before and after a jump, their record, the pressure ahead
        (case.deck.wear, 3 * (1 + len(case.cycle)) if case.deck.wear else 0),  # guesses of its load steps
        (case.deck.interface, 6 if friction else 4),  # springs, and the symbol of bodies on them
    ]
    return sum(count for used, count in table if used)


def peak_memory(case: Problem, lattice: Lattice) -> int:
    """Return the largest memory (bytes) of a run on a window, with interpreter and libraries."""
    solved = memory_needed(case, lattice, _parts(case, lattice))
    return memory.resident() + max([solved, *_stress_needs(case, lattice, kept=True).values()])


def _stress_needs(case: Problem, lattice: Lattice, kept: bool = False) -> dict[str, int]:
    """Return the memory (bytes) of each table [[stress]] and [[fatigue]] after the run, by its key."""
    if not (case.deck.stress or case.deck.fatigue):
        return {}
    from ..interior import fatigue, stress
    from ..interior.fields import region

    needs = {}
    for number, table in enumerate(case.deck.stress, 1):
        all_steps = math.ceil(len(case.load_steps) / case.output.every)
        steps = all_steps if table.steps == "all" else len(table.steps or (1,))
        coated = bool((case.deck.body.body_1, case.deck.body.body_2)[table.body - 1].coating)
        below = stress.memory_needed(lattice, region(lattice, **table.where), steps, coated, kept)
        needs[f"stress.{number}"] = max(below, _tractions_memory(case, lattice, steps, table.source))
    for number, cycle in enumerate(case.deck.fatigue, 1):
        steps = len(cycle.steps or ())
        if not steps:  # adaptive segments as one step each
            first, last = cycle_of([stage_of(step) for step in case.load_steps], cycle.segment or ())
            steps = last - first + 1
        points = region(lattice, **cycle.where)
        below = fatigue.memory_needed(lattice, points, steps) + _ITEM * 5 * steps * lattice.size
        needs[f"fatigue.{number}"] = max(below, _tractions_memory(case, lattice, steps, None))
    return {key: needed + _LOADED_AFTER for key, needed in needs.items()}


def _tractions_memory(case: Problem, lattice: Lattice, steps: int, source: str | None) -> int:
    """Return the memory (bytes) of the tractions of some steps, corrected at sharp edges."""
    from ..interior import stress

    mu = case.friction_coefficient  # nan where it varies
    sheared = math.isnan(mu) or 0.0 < mu < math.inf
    nodes, spectra = case.contact_nodes(lattice), case.pair.spectra
    used = "nodes" if case.deck.interface or lattice.periodic else source
    needed = stress.tractions_needed(lattice, steps, nodes, case.frictional and sheared, spectra, used)
    # beside the spectra of the solver, which are kept
    kept = contact.memory_needed("fft", *lattice.shape, part="operator", spectra=spectra)
    return needed + case.frictional * kept


def memory_needed(case: Problem, lattice: Lattice, kept: int = 0) -> int:
    """Return the memory (bytes) to solve and write load steps on a window.

    The size of the contact is the estimate at the largest load, else that of the window. `kept` are further,
    dispensable bytes.
    """
    bodies = {name[:-2] for name in case.output.fields if name in DISPLACEMENTS}
    spectra = 5 + (case.pair.spectra % 2 == 0)  # a body is unlike a rigid one
    core = partial(contact.memory_needed, "fft", *lattice.shape, threads=memory.threads())
    given: dict[str, Any] = {"spectra": spectra, "periodic": lattice.periodic}
    operator = core(part="operator", **given)
    set_up = core(part="set-up of the operator", **given)
    ahead = core() if case.deck.wear else 0
    fields, method = fields_held(case) * _ITEM * lattice.size, case.method_for(lattice)
    needed = case.memory_needed(lattice)
    if ranks.count > 1:
        shared = is_shared(case, lattice)  # else each rank has all fields of a contact with friction
        copies = ranks.on_node if shared or (case.frictional and method == "fft") else 1
        parts = ranks.count if shared else 1
        needed, fields, operator, set_up, ahead = (
            part * copies // parts for part in (needed, fields, operator, set_up, ahead)
        )
    needed += kept + ahead
    if case.frictional or method == "direct":
        needed += fields + _WRITING
    else:  # the output takes the place of transforms and iterations
        needed += max(fields, _WRITING)
    if bodies:
        # the set-up fits into the vectors of a solver with friction, which are free by then
        needed += len(bodies) * operator + (0 if case.frictional else set_up)
    return _LOADED + needed


def _parts(case: Problem, lattice: Lattice) -> int:
    """Return the bytes of operators on parts of the window around a growing contact, and of cached spectra.

    Of n steps in which it grows, about log2(n) need a part that is larger by much.
    """
    if case.method_for(lattice) == "direct":
        return 0
    most, growing = 0.0, 0
    for step in case.load_steps:
        if step.z.value > most:
            most, growing = step.z.value, growing + 1
    doublings = min(math.log2(max(growing, 1)), 5.0) - case.frictional
    kept = int(_PART[case.frictional] * max(doublings, 0.0) * case.contact_nodes(lattice))
    return min(kept, kernel_cache.bound())


def require_memory(case: Problem, lattice: Lattice, steps_held: int = 0) -> None:
    """Refuse a window, with the fields of some steps, or a table that does not fit into memory."""
    kept = steps_held * len(fields_of(case)) * _ITEM * lattice.size
    needed, there = memory_needed(case, lattice) + kept, memory.available()
    if ranks.count > 1 and (case.frictional or is_shared(case, lattice)):  # the least of all machines
        there = int(ranks.order(share_of_memory) * ranks.on_node)
    fitting = lattice.spacing * math.sqrt(1.1 * needed / max(there, 1))
    fits = f', such as "{readable(fitting)}"' if lattice.spacing < fitting < math.inf else ""
    advice = ["a smaller window" if case.window_fixed else f"a larger grid.spacing{fits}"]
    if (method := case.method_for(lattice)) == "direct":
        advice.append('solver.method = "fft"')
    if steps_held:
        advice.append("an output file")
    memory.require(
        needed,
        f"a window of {lattice.n_row} x {lattice.n_col} nodes (method {method})",
        f"choose {listed(advice, 'or')}",
        there,
    )
    for key, below in _stress_needs(case, lattice).items():
        if below + kept > needed:
            fewer = "a smaller region, fewer points or steps, or a larger grid.spacing"
            memory.require(below + kept, key, f"choose {fewer}", there)


def share_of_memory() -> float:
    """Return the memory (bytes) that is available to each rank where it is least."""
    return ranks.least(memory.available() / ranks.on_node)


def fields_of(case: Problem) -> tuple[str, ...]:
    """Return the fields of each step of a case: its whole state, and displacements that the deck names."""
    worn = WORN if case.deck.wear else (MOVED_GAP,) if case.moves else ()
    return (*STATE[case.frictional], *worn, *(name for name in DISPLACEMENTS if name in case.output.fields))
