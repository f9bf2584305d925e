"""What all Python tests need."""

import fcntl
import os
import signal
from collections.abc import Generator

import pytest
from hypothesis import settings

# Examples are drawn from the test itself: the same ones at every run, and nothing is remembered on the disk.
settings.register_profile("seeded", derandomize=True, database=None)
settings.load_profile("seeded")

# Processes of one session share the cores: threads of BLAS beside them would only wait for each other.
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# A shell that runs tests in the background has them ignore Ctrl-C, and so what they start; some send it.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Run a test marked `alone`, with its fixtures, while no other process of the session runs a test."""
    if "PYTEST_XDIST_WORKER" not in os.environ:
        return (yield)
    alone = item.get_closest_marker("alone") is not None
    assert item.config.cache
    folder = item.config.cache.mkdir("alone")
    # Who waits to be alone holds the gate, so that the others do not take turns for ever.
    with (folder / "gate").open("w") as gate, (folder / "room").open("w") as room:
        fcntl.flock(gate, fcntl.LOCK_EX)
        fcntl.flock(room, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        if not alone:
            fcntl.flock(gate, fcntl.LOCK_UN)
        try:
            return (yield)
        finally:  # not by closing alone: a process that the test has forked may have the files open, too
            fcntl.flock(room, fcntl.LOCK_UN)
            fcntl.flock(gate, fcntl.LOCK_UN)
