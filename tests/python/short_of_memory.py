"""Solve with ever more address space: short_of_memory.py normal|friction|direct|wear. Prints how each ended.

Each try is a process of its own, so that none finds memory that another one has left behind.
"""

import os
import resource
import sys

import numpy as np

from hexcontact import FrictionalContact, Lattice, NormalContact, ResourceError
from hexcontact.core import kernel_cache
from hexcontact.core.contact import UNILATERAL, ElasticPair
from hexcontact.core.friction import FrictionLaw
from hexcontact.core.handles import HeldState
from hexcontact.core.steps import energy_of_jump

PAIR = ElasticPair(2e-12, -0.5e-12, 0.9e-12)
SPACING = 2e-6
MB = 1_000_000


KIND = sys.argv[1]
half = 10 if KIND == "direct" else 40
# before memory is short: numpy itself ends a process that has less than half a megabyte left
lattice = Lattice(SPACING, -half, -half, 2 * half, 2 * half)
gap = (lattice.x**2 + lattice.y**2) / (400 * SPACING)


def attempt(kind: str) -> None:
    """Set a problem up and solve it twice."""
    approach = (0.7 * half * SPACING) ** 2 / (200 * SPACING)
    if kind == "wear":
        pressure = np.maximum(1e8 - 1e18 * gap**2, 0.0)
        slip = np.where(gap > 0.0, 1e-9, 0.0)
        end = HeldState.copied({"pressure": pressure, "gap": np.maximum(gap - approach, 0.0)}, {})
        mask = np.full(lattice.shape, True)
        friction = FrictionLaw(0.5)
        cycle = 0.5 * slip * pressure, slip
        energy_of_jump(lattice, PAIR, UNILATERAL, mask, friction, 1e-14, cycle, end, True, 100.0, 1e-4)
        return
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
step = {"normal": MB // 2, "friction": 2 * MB, "direct": 10 * MB, "wear": MB // 2}[KIND]
codes: list[int] = []
while codes[-2:] != [0, 0] and len(codes) < 60:
    codes.append(limited(KIND, MB + step * len(codes)))
print(*codes)
