"""docs/developer.md: the way of a load leads through procedures that exist, and the examples work."""

import __future__

import importlib
import re
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import matplotlib.figure
import pytest
from typer.testing import CliRunner

import hexcontact
from hexcontact.cli import app, frame
from hexcontact.plotting import registry

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/developer.md").read_text(encoding="utf-8")
STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}


def executed(heading: str, module: str, number: int = 0, **others: Any) -> None:
    """Execute a program of the guide as if it stood in a module, with copies of its names and others."""
    section = re.search(rf"^## {heading}\n(.*?)(?=^## )", PAGE, re.MULTILINE | re.DOTALL)
    assert section
    program = re.findall(r"^```python\n(.*?)^```", section[1], re.MULTILINE | re.DOTALL)[number]
    importlib.import_module(module)
    names = {
        **vars(sys.modules[module]),
        **others,
    }  # not its attribute in the package, which a function may hide
    exec(compile(program, "developer.md", "exec", __future__.annotations.compiler_flag), names)


def test_procedures_that_a_load_passes_are_there() -> None:
    way = re.findall(r"^\| `(\w+/[\w/.]+)` \| `(\w+)` \|", PAGE, re.MULTILINE)
    assert len(way) > 10
    for file, name in way:
        assert re.search(rf"\b(?:def |class |subroutine |procedures\.){name}\b", (ROOT / file).read_text()), (
            file,
            name,
        )


def test_example_of_a_surface_has_its_closed_solution(monkeypatch: pytest.MonkeyPatch) -> None:
    from hexcontact.analytic import compare
    from hexcontact.deck import surfaces

    monkeypatch.setattr(surfaces, "SHAPES", dict(surfaces.SHAPES))
    monkeypatch.setattr(compare, "_SHAPES", dict(compare._SHAPES))
    executed("Add a surface with a closed-form solution", "hexcontact.deck.surfaces")
    executed("Add a surface with a closed-form solution", "hexcontact.analytic.compare", 1)
    surface = {"shape": "steepening", "radius": "10 mm", "factor": 3000.0}
    case = hexcontact.Case(
        body_1={**STEEL, "surface": surface}, body_2=STEEL, nodes_in_radius=12, normal_load=100.0
    )
    comparison = case.run().compare()
    # second order of the spacing, as for spheres
    assert comparison["approach"].error == pytest.approx(0.0, abs=2e-3)
    assert comparison["max_pressure"].error == pytest.approx(0.0, abs=2e-3)


def test_examples_of_a_figure_and_a_command_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "_ENTRIES", dict(registry._ENTRIES))
    monkeypatch.setattr(frame.app, "registered_commands", [*app.app.registered_commands])
    executed("Add a figure", "hexcontact.plotting.history")
    executed("Add a command", "hexcontact.cli.show")
    case = hexcontact.Case(
        body_1={**STEEL, "surface": {"shape": "sphere", "radius": "10 mm"}},
        body_2={"rigid": True},
        nodes_in_radius=6,
        friction_coefficient=0.3,
        loads=[{"normal_load": 50.0, "steps": 2}],
    )
    result = case.run(tmp_path / "out.nc")
    drawn = registry.entries()["work"].draw(result)
    assert isinstance(drawn, matplotlib.figure.Figure)
    assert drawn.axes[0].lines[0].get_ydata().tolist() == result.dissipated_energy.values.tolist()
    done = CliRunner().invoke(frame.app, ["energy", str(tmp_path / "out.nc")])
    assert done.exit_code == 0
    assert [line.split()[0] for line in done.output.splitlines()] == ["1", "2"]


def test_example_of_a_study_backend_yields_what_the_jobs_return(monkeypatch: pytest.MonkeyPatch) -> None:
    from hexcontact.study import backend

    monkeypatch.setattr(backend, "BACKENDS", dict(backend.BACKENDS))
    monkeypatch.setattr(backend, "KEYS", dict(backend.KEYS))
    monkeypatch.setattr(backend, "solve_case", lambda job, apart: f"outcome of {job}, {apart}")
    others = {"Queue": SimpleNamespace, "connected": lambda address: ThreadPoolExecutor(1)}
    executed("Add a study backend", "hexcontact.study.backends.dask", **others)
    with backend.BACKENDS["queue"](SimpleNamespace(address="here"), 2) as pool:
        found = list(backend.outcomes(pool, ["one", "two"], threading.Event()))
    assert found == ["outcome of one, True", "outcome of two, True"]
