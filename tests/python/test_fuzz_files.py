"""Damaged results and journals: each gives a result as written or a sentence, and stays as it is."""

import json
import os
import signal
import subprocess
import sys
from collections import Counter
from pathlib import Path

import fuzz
import pytest
from commands import ENVIRONMENT
from fuzz.file_scan import scan

from hexcontact import Case
from hexcontact.result.step import Step

FILES, PARTS = 60, 1
SCANNED = 250
LONGEST = 400  # s without a line from the worker's process, on a machine that does other things, too
WORKER = Path(fuzz.__path__[0]) / "file_worker.py"

PRESS = """
title = "A sphere"
[body.1]
young_modulus = "210 GPa"
poisson_ratio = 0.3
surface = { shape = "sphere", radius = "10 mm" }
[body.2]
young_modulus = "70 GPa"
poisson_ratio = 0.33
[grid]
nodes_in_radius = 4
[[load]]
normal_load = "100 N"
steps = 2
"""
SHEAR = """[[load]]
tangential_load_x = "9 N"
steps = 2
[friction]
coefficient = 0.2
"""


class Stopped(Exception):
    """Ends a run."""


def stop(step: Step) -> None:
    if step.number == 3:
        raise Stopped


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two results and the journal of a run that was stopped."""
    folder = tmp_path_factory.mktemp("sources")
    Case.from_text(PRESS).run(folder / "plain.nc")
    Case.from_text(PRESS + SHEAR).run(folder / "friction.nc")
    with pytest.raises(Stopped):
        Case.from_text(PRESS + SHEAR).run(folder / "unfinished.nc", on_step=stop)
    return folder


def worker(sources: Path, first: int, last: int) -> subprocess.CompletedProcess[str]:
    """Try the files from `first` to `last` - 1 in a process of its own."""
    path = os.pathsep.join([str(WORKER.parents[1]), ENVIRONMENT["PYTHONPATH"]])
    return subprocess.run(
        [sys.executable, str(WORKER), str(sources), str(first), str(last)],
        env=ENVIRONMENT | {"PYTHONPATH": path, "MPLBACKEND": "agg"},
        capture_output=True,
        text=True,
        timeout=LONGEST,
    )


@pytest.mark.parametrize("part", range(PARTS))
def test_damaged_files_get_a_sentence_and_stay_as_they_are(part: int, sources: Path) -> None:
    first, last = part * FILES // PARTS, (part + 1) * FILES // PARTS
    wrong, codes, tried = [], Counter[str](), 0
    while first < last:
        done = worker(sources, first, last)
        lines = done.stdout.splitlines()
        found = [json.loads(line) for line in lines if line.startswith("{")]
        tried += len(found)
        for file in found:
            wrong += [f"file {file['seed']} ({file['damage']}): {fault}" for fault in file["wrong"]]
            codes.update(f"{name} {code}" for name, code in file["codes"].items())
        first = found[-1]["seed"] + 1 if found else first
        if done.returncode:
            name = signal.Signals(-done.returncode).name if done.returncode < 0 else done.stderr[-2000:]
            wrong.append(f"the process died ({name}) at: {lines[-1] if lines else 'its beginning'}")
            first += 1
    assert wrong == []
    assert tried == last - part * FILES // PARTS
    opened, refused = codes["info 0"], codes["info 2"]
    assert opened > 0.15 * tried  # some damage is to what nobody looks at, or leaves a whole part
    assert refused > 0.4 * tried
    assert codes["resume 0"] > 0.1 * tried  # at least 7 of 60 files; the number varies with the damage
    assert {"export 0", "report 0", "plot 0"} <= codes.keys()


@pytest.mark.parametrize("name", ["friction.nc", "unfinished.nc.d/000001.npz", "unfinished.nc.d/000003.npz"])
def test_flipped_bits_and_swapped_blocks_are_noticed(name: str, sources: Path) -> None:
    """What is opened is what was written, or the file is named."""
    file = sources / name
    output = file if file.suffix == ".nc" else file.parent.with_suffix("")
    same, refused, wrong = scan(output, file, seed=7, count=SCANNED)
    assert wrong == []
    assert refused > 0.94 * SCANNED  # some blocks are alike, some bytes of an archive are never read
    assert same + refused == SCANNED
