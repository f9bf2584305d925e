"""What all Python tests need."""

import os
import signal

import pytest
from hypothesis import settings

# Examples are drawn from the test itself: the same ones at every run, and nothing is remembered on the disk.
settings.register_profile("seeded", derandomize=True, database=None)
settings.load_profile("seeded")

# Processes of one session share the cores: more threads than those would only wait for each other.
if int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1")) > 1:
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# A shell that runs tests in the background has them ignore Ctrl-C, and so what they start; some send it.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Files that take longest come first, so that no process waits for one of them at the end.
LONGEST = ["pages", "resume", "memory_estimates", "developer_guide", "stress", "study", "fatigue"]
LONGEST += ["plotting_friction", "fortran_library"]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the files that take longest before the others."""
    ranks = {f"test_{name}": rank for rank, name in enumerate(LONGEST)}
    items.sort(key=lambda item: ranks.get(item.path.stem, len(ranks)))


@pytest.fixture
def laid_out_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lay figures out as they are written only: for tests that do not look at the places of labels."""
    monkeypatch.setattr("hexcontact.plotting.registry.settle", lambda figure: None)
