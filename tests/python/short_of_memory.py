"""Work with ever more address space, and print how each try ended.

The argument is normal, friction, direct, wear, measures or paths. Each try is a process of its own, so that
none finds memory that another one has left behind.
"""

import os
import resource
import sys

import numpy as np

from hexcontact import ContactState, FrictionalContact, Lattice, NormalContact, ResourceError
from hexcontact.core import flat, kernel_cache
from hexcontact.core.contact import ElasticPair
from hexcontact.core.flat import WearSettings
from hexcontact.core.friction import ACCEPTED, PENDING, CyclesOfWear

PAIR = ElasticPair(2e-12, -0.5e-12, 0.9e-12)
SPACING = 2e-6
MB = 1_000_000


KIND = sys.argv[1]
half = {"direct": 10, "measures": 300, "paths": 200}.get(KIND, 40)
# before memory is short: numpy itself ends a process that has less than half a megabyte left
lattice = Lattice(SPACING, -half, -half, 2 * half, 2 * half)
gap = (lattice.x**2 + lattice.y**2) / (400 * SPACING)


def attempt(kind: str) -> None:
    """Set a problem up and solve it twice."""
    if kind == "measures":
        flat.boundary(TOUCHING)
        flat.count_cut_triangles(TOUCHING)
        flat.section_of_pressure(lattice, gap, 0.0, False, (0.0, 0.0))
        return
    if kind == "paths":
        wear_path(STATE).reached(PROBLEM)
        return
    approach = (0.7 * half * SPACING) ** 2 / (200 * SPACING)
    if kind == "normal":
        contact = NormalContact(lattice, PAIR, gap)
        for share in (0.3, 1.0):
            assert contact.solve(approach=share * approach).converged
        return
    method = "direct" if kind == "direct" else "fft"
    problem = FrictionalContact(lattice, PAIR, gap, friction_coefficient=0.5, method=method)
    state = problem.virgin()
    for depth, shift in ((0.3, 0.0), (1.0, 0.0), (1.0, 0.1)):
        state = problem.advance(state, ("displacement",) * 4, (depth * approach, shift * approach, 0.0, 0.0))
        assert state.converged
    if kind == "wear":
        cycles = wear_path(state, approach)
        while (now := problem.called(flat.advance_wear, cycles)).cycles < 200:
            assert now.verdict in (ACCEPTED, PENDING)


def wear_path(state: ContactState, approach: float = 1e-6) -> CyclesOfWear:
    """Return a path through cycles of wear from a state."""
    numbers = dict.fromkeys(WearSettings._fields, 0) | {"coefficient": 1e-14, "cycles": 200, "jump": 100}
    numbers |= {"tolerance": 1.0, "cycle_tolerance": 1e-4, "most_unworn": 1, "residual": 1e-4}
    targets = [[approach, share * approach, 0.0, 0.0, 0.0, 0.0, 0.0] for share in (0.1, -0.1, 0.1)]
    steps = [([2, 2, 2, 2], values, [0.0] * 4, 1) for values in targets]
    return CyclesOfWear(WearSettings(**numbers), PAIR, steps, state)


def limited(kind: str, spare: int) -> int:
    """Return how a process ends that may take so many bytes more than this one has: 0 done, 4 no memory."""
    child = os.fork()
    if child:
        status = os.waitpid(child, 0)[1]
        return os.waitstatus_to_exitcode(status)
    code = 99
    try:
        with open("/proc/self/statm") as file:
            taken = int(file.read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (taken + spare, resource.RLIM_INFINITY))
        attempt(kind)
        code = 0
    except (ResourceError, MemoryError):
        code = 4
    finally:
        os._exit(code)


kernel_cache.configure(memory=0)
np.linalg.norm(np.ones(3))
if KIND == "measures":
    TOUCHING = np.asarray(gap < np.median(gap), np.int32)
if KIND == "paths":
    PROBLEM = FrictionalContact(lattice, PAIR, gap, friction_coefficient=0.5)
    STATE = PROBLEM.virgin()
step = {"normal": MB // 2, "direct": 10 * MB}.get(KIND, 2 * MB)
codes: list[int] = []
while codes[-2:] != [0, 0] and len(codes) < 60:
    codes.append(limited(KIND, MB + step * len(codes)))
print(*codes)
