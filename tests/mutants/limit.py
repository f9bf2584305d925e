"""Plugin of pytest for mutants: bounds the processor time of each test, and notes which one runs."""

import os
import resource
from collections.abc import Generator
from pathlib import Path

import pytest

SECONDS = 120  # the longest takes 30


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Bound the time that this process, and each that the test starts, may take from here on."""
    if "MUTANTS_AT" in os.environ:
        Path(os.environ["MUTANTS_AT"]).write_text(item.nodeid)
    used = resource.getrusage(resource.RUSAGE_SELF)
    hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
    resource.setrlimit(resource.RLIMIT_CPU, (int(used.ru_utime + used.ru_stime) + SECONDS, hard))
    return (yield)
