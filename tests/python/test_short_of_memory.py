"""Memory that is not there: an error with a sentence, no end of the process; finished steps are kept."""

import contextlib
import errno
import os
import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest
from commands import ENVIRONMENT
from numpy.testing import assert_array_equal

from hexcontact import Case, ResourceError, open_result
from hexcontact.cli import frame
from hexcontact.core import cores, memory
from hexcontact.files import _is_running

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/statm").exists(), reason="limits and sizes are those of Linux"
)

ENV = ENVIRONMENT | {"OPENBLAS_NUM_THREADS": "1"}
MB = 1_000_000
DECK = """
[body.1]
young_modulus = "432 GPa"
poisson_ratio = 0.32
surface = { shape = "sphere", radius = "1 mm" }
[body.2]
young_modulus = "72 GPa"
poisson_ratio = 0.32
[friction]
coefficient = 0.1
[grid]
spacing = "5 um"
[[load]]
normal_load = "31.5 N"
steps = 3
"""
# Lets a run take no more memory once two steps are finished.
STARVED = """
import resource, sys
from hexcontact import Case, ResourceError

def starve(step):
    if step.number == 2:
        pages = int(open("/proc/self/statm").read().split()[0])
        resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + 2_000_000, -1))

try:
    Case.from_toml("deck.toml").run("starved.nc", on_step=starve)
except ResourceError as error:
    resource.setrlimit(resource.RLIMIT_AS, (-1, -1))
    print(error, *error.__notes__, sep="\\n")
    sys.exit(error.exit_code)
"""
# Says how much address space the command and the buffers of numpy take before it begins to work.
BEGUN = """
import numpy
import hexcontact.core._core, hexcontact.cli.solving
numpy.linalg.lstsq(numpy.eye(9), numpy.ones(9))
print(*(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmPeak")))
"""


@pytest.mark.parametrize("kind", ["normal", "friction", "direct", "wear", "measures", "paths"])
def test_solvers_ask_for_memory_before_they_take_it(kind: str) -> None:
    script = Path(__file__).with_name("short_of_memory.py")
    done = subprocess.run([sys.executable, script, kind], env=ENV, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    codes = done.stdout.split()
    assert set(codes) == {"0", "4"}, done
    assert codes[0] == "4" and codes[-2:] == ["0", "0"]


def test_command_ends_with_the_code_of_lacking_memory(tmp_path: Path) -> None:
    (tmp_path / "deck.toml").write_text(DECK)
    done = subprocess.run([sys.executable, "-c", BEGUN], env=ENV, capture_output=True, text=True, check=True)
    begun = 1024 * int(done.stdout)
    codes = []
    for spare in (10, 40, 70, 100, 130, 160, 400):
        limit = begun + spare * MB
        command = [sys.executable, "-m", "hexcontact", "run", "deck.toml", "-o", f"{spare}.nc"]
        done = subprocess.run(
            command,
            cwd=tmp_path,
            env=ENV,
            capture_output=True,
            text=True,
            preexec_fn=lambda limit=limit: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
        )
        codes.append(done.returncode)
        assert done.returncode in (0, 4), done
        assert "Traceback" not in done.stderr
        assert ("memory" in done.stderr) == (done.returncode == 4), done
        assert (tmp_path / f"{spare}.nc").exists() == (done.returncode == 0)
    assert codes[0] == 4 and codes[-1] == 0


def test_run_that_finds_no_memory_any_more_goes_on_later(tmp_path: Path) -> None:
    (tmp_path / "deck.toml").write_text(DECK)
    done = subprocess.run(
        [sys.executable, "-c", STARVED], cwd=tmp_path, env=ENV, capture_output=True, text=True
    )
    assert done.returncode == 4, done
    assert "memory" in done.stdout
    assert "2 of 3 load steps are finished and recorded" in done.stdout
    for command in (["resume", "starved.nc"], ["run", "deck.toml", "-o", "fed.nc"]):
        subprocess.run([sys.executable, "-m", "hexcontact", *command], cwd=tmp_path, env=ENV, check=True)
    starved, fed = (open_result(tmp_path / f"{name}.nc") for name in ("starved", "fed"))
    for name in ("pressure", "traction_x", "approach", "gap"):
        assert_array_equal(starved[name].values, fed[name].values)


@pytest.mark.parametrize("limit", ["RLIMIT_AS", "RLIMIT_DATA"])
def test_limits_of_the_process_bound_what_is_available(limit: str) -> None:
    code = f"""
import resource, psutil
from hexcontact.core import memory
plenty = memory.available()
info = psutil.Process().memory_info()
taken = info.vms if {limit!r} == "RLIMIT_AS" else info.data
resource.setrlimit(resource.{limit}, (taken + 500_000_000, -1))
print(plenty, memory.available())
resource.setrlimit(resource.{limit}, (taken + 50_000_000, -1))
print(memory.available())
"""
    done = subprocess.run([sys.executable, "-c", code], env=ENV, capture_output=True, text=True, check=True)
    plenty, some, none = map(int, done.stdout.split())
    assert plenty > 500 * MB
    assert 200 * MB < some < 500 * MB
    assert none == 0


def test_what_cannot_be_had_is_not_claimed() -> None:
    memory.claim(100 * MB)
    with pytest.raises(OSError, match="Cannot allocate memory"):
        memory.claim(2**46)


def test_a_machine_that_hides_its_processes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without /proc the memory of the machine is the bound, and a lock is held if its process lives."""

    def hidden(path: str) -> bytes:
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), path)

    for module in (memory, cores):
        monkeypatch.setattr(module, "read", hidden)
    monkeypatch.setattr(psutil, "PROCFS_PATH", str(tmp_path))
    assert memory.resident() > MB
    assert memory.available() > 100 * MB
    with memory_limit(8_000 * MB):
        assert memory.available() < 8_000 * MB
    (tmp_path / "deck.toml").write_text(DECK)
    assert len(Case.from_toml(tmp_path / "deck.toml").run(tmp_path / "out.nc")) == 3
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    here = os.uname().nodename
    for number, runs in ((os.getpid(), True), (ended.pid, False), (-1, False), ("1", False), (2**70, False)):
        assert _is_running({"process": number, "host": here}) == runs


@contextlib.contextmanager
def memory_limit(size: int) -> Iterator[None]:
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def test_files_that_cannot_be_opened_for_want_of_descriptors(tmp_path: Path) -> None:
    """A sentence and the code of lacking resources, whatever is opened when there are too few."""
    (tmp_path / "deck.toml").write_text(DECK)
    code = f"import sys; sys.path[:] = {sys.path!r}; from hexcontact.cli.app import main; main()"
    for most in (5, 6, 8):
        done = subprocess.run(
            [sys.executable, "-S", "-c", code, "run", "deck.toml", "--overwrite", "-o", "out.nc"],
            cwd=tmp_path, env=ENV, text=True, capture_output=True, check=False,
            preexec_fn=lambda most=most: resource.setrlimit(resource.RLIMIT_NOFILE, (most, most)),
        )  # fmt: skip
        assert "Traceback" not in done.stderr
        if done.returncode:
            assert done.returncode == 4
            assert "Too many open files" in done.stderr


def test_a_library_that_finds_no_descriptor(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def refuse(*arguments: object) -> int:
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    sentence = "_core.so: cannot open shared object file: Error 24"
    report = frame._report_of(ImportError(sentence, path="_core.so"))
    assert report == frame.Report("_core.so: Too many open files", 4)
    (tmp_path / "deck.toml").write_text(DECK)
    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(ResourceError, match=r"deck\.toml: cannot be read \(Too many open files\)"):
        Case.from_toml(tmp_path / "deck.toml")
