"""Opens damaged results in a process of its own, which the C libraries may crash; see test_fuzz_files.py.

``python file_worker.py FOLDER FIRST LAST`` damages copies of the results in FOLDER by the seeds from FIRST to
LAST - 1 and gives each to all that reads results. A line is printed before each command (so that a crash
is known) and one, as JSON, after each file.
"""

import json
import random
import shutil
import sys
import warnings
from pathlib import Path
from typing import Any

import netCDF4  # noqa: F401 (before the time limit)
import xarray  # noqa: F401
from fuzz import file_damage, harness

from hexcontact import plotting
from hexcontact.cli import plot as cli_plot
from hexcontact.cli import run as cli_solve
from hexcontact.cli import show as cli_show
from hexcontact.errors import HexcontactError
from hexcontact.result.store import open_result

PICTURES = [name for name in plotting.FIGURES if name != "overview"]


def commands(file: Path, folder: Path, rng: random.Random) -> list[tuple[str, Any, dict[str, Any]]]:
    """Return what is done with a file: names, commands, options."""
    what = rng.choice(PICTURES)
    tables = {"vtk": True, "ugrid": True, "csv": True}
    shown = [
        ("export", cli_show.export, {"file": file, **tables, "output": folder / "tables"}),
        ("report", cli_show.report, {"file": file, "output": folder / "page.html"}),
        (f"plot {what}", cli_plot.plot, {"files": [file], "what": what, "output": folder / "picture.svg"}),
    ]
    return [
        ("info", cli_show.info, {"file": file, "as_json": True}),
        *([rng.choice(shown)] if rng.random() < 0.6 else []),  # each takes a while
        ("resume", cli_solve.resume, {"file": file, "quiet": True, "as_json": True}),
    ]


def read(file: Path) -> str:
    """Open a result from Python and look at all of it; return why that is not possible."""
    try:
        result = open_result(file)
        try:
            result.dataset.load()
            repr(result), result.history, len(result)
        finally:
            result.close()
    except HexcontactError as error:
        return str(error)
    return ""


def tried(seed: int, sources: Path, folder: Path) -> dict[str, Any]:
    """Damage a file by a seed and try everything with it."""
    rng = random.Random(seed)
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "input").mkdir(parents=True)
    file = folder / "input/out.nc"
    (folder / "input/neighbor.nc").write_bytes(b"not to be touched")
    if seed % 4 == 3:
        damage = file_damage.damaged_journal(sources / "unfinished.nc.d", folder / "input/out.nc.d", rng)
    else:
        source = rng.choice([sources / "friction.nc", sources / "plain.nc"])
        damage = file_damage.damaged(source, file, rng)
    before, wrong, codes = harness.contents(folder / "input", "lock"), [], {}
    print(seed, damage, "open", flush=True)
    try:
        with harness.time_limit():
            read(file)
    except (Exception, harness.Hang) as error:
        wrong.append(f"open_result: {error!r}")
    for name, command, options in commands(file, folder, rng):
        print(seed, damage, name, flush=True)
        try:
            end = harness.ending(command, **options)
        except (Exception, harness.Hang) as error:
            wrong.append(f"{name}: {error!r}")
            continue
        codes[name.split()[0]] = end.exit_code
        wrong += [f"{name}: {fault}" for fault in harness.complaints(end, options.get("as_json", False))]
        if (name, end.exit_code) != ("resume", 0) and harness.contents(folder / "input", "lock") != before:
            wrong.append(f"{name}: the input was changed")
    return {"seed": seed, "damage": damage, "wrong": wrong, "codes": codes}


if __name__ == "__main__":
    warnings.filterwarnings("error", module="hexcontact")
    place = Path(sys.argv[1])
    for number in range(int(sys.argv[2]), int(sys.argv[3])):
        print(json.dumps(tried(number, place, place / f"work{sys.argv[2]}")), flush=True)
