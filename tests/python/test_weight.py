"""The way of one load step from deck to result file, counted in functions, files and moves between rooms."""

import json
import subprocess
import sys
from pathlib import Path

DECK = """\
[body.1]
young_modulus = "200 GPa"
poisson_ratio = 0.3
surface = { shape = "sphere", radius = "10 mm" }
[body.2]
young_modulus = "70 GPa"
poisson_ratio = 0.33
[friction]
coefficient = 0.3
[grid]
nodes_in_radius = 8
[[load]]
normal_load = "10 N"
"""

COUNTED = """
import json, os, sys
import hexcontact

home = os.path.dirname(hexcontact.__file__)
functions, rooms = set(), []


def seen(frame, event, _):
    path = frame.f_code.co_filename
    if event == "call" and path.startswith(home):
        functions.add((path, frame.f_code.co_qualname))
        rooms.append(os.path.relpath(path, home).split(os.sep)[0])


for name in ("first.nc", "second.nc"):  # a second run imports nothing
    sys.setprofile(seen if name == "second.nc" else None)
    assert hexcontact.Case.from_toml("deck.toml").run(name).normal_load > 0.0
sys.setprofile(None)
moves = sum(one != other for one, other in zip(rooms, rooms[1:]))
print(json.dumps([len(functions), len({path for path, _ in functions}), moves]))
"""


def test_a_load_step_takes_a_short_way(tmp_path: Path) -> None:
    (tmp_path / "deck.toml").write_text(DECK)
    command = [sys.executable, "-W", "ignore", "-c", COUNTED]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    functions, files, moves = json.loads(done.stdout)
    assert functions <= 499
    assert files <= 45
    assert moves <= 230
