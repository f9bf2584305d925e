"""The table of procedures of the core, and the Fortran and Python that are generated from it."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from hexcontact import HexcontactError
from hexcontact.analytic.friction import MindlinContact
from hexcontact.core import flat
from hexcontact.core.contact import HeldState

ROOT = Path(__file__).parents[2]
SOURCES = ROOT / "fortran/python"
TABLE = tomllib.loads((SOURCES / "procedures.toml").read_text())


def generated(table: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run the generator on a table."""
    files = [folder / name for name in ("table.toml", "flat.f90", "flat.py")]
    files[0].write_text(table)
    command = [sys.executable, SOURCES / "generate.py", *files]
    return subprocess.run(command, capture_output=True, text=True)


def test_every_row_is_a_function_with_its_sentence() -> None:
    for name, row in TABLE["procedures"].items():
        assert getattr(flat, name).__doc__.startswith(row["does"]), name


def test_every_name_of_the_library_is_used() -> None:
    rows = [row for part in ("records", "kinds", "procedures") for row in TABLE[part].values()]
    text = " ".join(str(value) for row in (*rows, TABLE["objects"]) for value in row.values())
    text += " report wp error_t slot_t enter leave"  # names that the generator writes
    words = {*re.findall(r"\w+", text)}
    for module, names in TABLE["use"].items():
        known = {name.partition("=>")[0].strip() for name in names.split(",")}
        assert known <= words, module


def test_the_row_of_the_guide_is_that_of_the_table() -> None:
    [row] = re.findall(
        r"^```toml\n(\[procedures.*?)^```", (ROOT / "docs/developer.md").read_text(), re.M | re.S
    )
    shown = tomllib.loads(row)["procedures"]
    assert shown == {name: TABLE["procedures"][name] for name in shown}


def test_a_mistaken_argument_is_refused_with_its_text(tmp_path: Path) -> None:
    row = '[procedures.p]\ndoes = ""\ntakes = "real x("\ncalls = ""\n'
    done = generated(f"[use]\n[records]\n[objects]\n[kinds]\n{row}", tmp_path)
    assert done.returncode
    assert done.stderr == "real x(: expected kind name(shape) [unit]\n"


def test_long_statements_go_over_lines(tmp_path: Path) -> None:
    row = f'[procedures.p]\ndoes = "Add."\ntakes = "x"\ngives = "y"\ncalls = "y = {" + ".join(["x"] * 99)}"\n'
    assert not generated(f"[use]\n[records]\n[objects]\n[kinds]\n{row}", tmp_path).returncode
    lines = (tmp_path / "flat.f90").read_text().splitlines()
    assert max(map(len, lines)) <= 132
    joined = re.sub(r" &\s+", " ", "\n".join(lines))
    assert "y = " + " + ".join(["x"] * 99) in joined


def test_numbers_of_a_record_are_found_by_their_names() -> None:
    numbers = {"compliance": 1e-11, "contact_radius": 1e-4, "friction_coefficient": 0.3, "normal_load": 20.0}
    energy = flat.mindlin_energy(SimpleNamespace(**numbers), 3.0)
    assert energy == MindlinContact(**numbers).energy_per_cycle(3.0) > 0.0
    del numbers["compliance"]
    with pytest.raises(AttributeError, match="compliance"):
        flat.mindlin_energy(SimpleNamespace(**numbers), 3.0)


def test_fields_of_a_state_are_found_by_their_names() -> None:
    held = HeldState.copied({"pressure": np.arange(6.0).reshape(2, 3)}, {"twist": 0.25})
    assert held.view("pressure").tolist() == [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]
    assert flat.numbers_of_state(held).twist == 0.25
    with pytest.raises(HexcontactError, match="the state has no field pressures"):
        held.view("pressures")


def test_marks_are_true_or_false_whatever_their_numbers() -> None:
    zone = np.zeros((6, 6), int)
    zone[2:4, 2:4] = 256  # 0 in a byte
    assert np.array_equal(flat.boundary(zone), zone > 0)
