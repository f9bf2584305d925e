"""Work of the solvers, counted in operator applications: it does not depend on the machine.

The bounds are a tenth above what was measured; `python tests/bench/run.py --write-bounds` measures again.
"""

import pytest
from bench import counts, problems

BOUNDS = counts.bounds()


def test_every_problem_has_bounds_on_its_meshes() -> None:
    wanted = {name: {str(mesh) for mesh in meshes} for name, meshes in counts.BOUNDED.items()}
    assert {name: set(row) for name, row in BOUNDS.items()} == wanted


@pytest.mark.parametrize(
    ("name", "mesh", "bound"),
    [(name, int(mesh), bound) for name, row in BOUNDS.items() for mesh, bound in row.items()],
)
def test_work_stays_below_its_bound(name: str, mesh: int, bound: float) -> None:
    assert problems.count(name, mesh) <= bound
