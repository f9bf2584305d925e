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


@pytest.fixture
def placed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Place the axes of pictures once: repetition takes half of their time, and pages show its effect."""
    monkeypatch.setattr("hexcontact.plotting.registry.settle", lambda figure: None)
