"""What notebooks and terminals show: tables, pictures, lists of quantities."""

import base64
import io
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from rich.console import Console

from hexcontact import Case, Result
from hexcontact.deck.surfaces import Sphere
from hexcontact.result.html import Plane
from hexcontact.result.view import StepView
from hexcontact.text import Table
from hexcontact.variables import VARIABLES

STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}


def sheared(**arguments: Any) -> Case:
    given: dict[str, Any] = {
        "title": "Sphere <b>on</b> flat",
        "body_1": {**STEEL, "surface": Sphere(radius=10e-3)},
        "body_2": STEEL,
        "nodes_in_radius": 8,
        "friction_coefficient": 0.2,
        "loads": [{"normal_load": 100.0}, {"tangential_load_x": 12.0, "label": "shear"}],
    }
    return Case(**{**given, **arguments})


@pytest.fixture(scope="module")
def result() -> Result:
    return sheared().run()


class Page(HTMLParser):
    """Cells, pictures and text of some HTML; complains about tags that are not closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.rows: list[list[str]] = []
        self.pictures: list[Image.Image] = []
        self.text = ""
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "img":
            data = str(dict(attrs)["src"]).removeprefix("data:image/png;base64,")
            self.pictures.append(Image.open(io.BytesIO(base64.b64decode(data))))
            return
        self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data
        if self.open and self.open[-1] in ("td", "th"):
            self.rows[-1][-1] += data


def test_tables_align_numbers_and_escape_words() -> None:
    rows = [("a", "1.5 mm", "x"), ("long name", "-12 mm", "<y>")]
    text = str(Table(("", "size", "word"), rows))
    assert text.splitlines() == [
        "             size  word",
        "a          1.5 mm  x",
        "long name  -12 mm  <y>",
    ]
    page = Page(Table(("", "size", "word"), rows, "A & B", "note <1>")._repr_html_())
    assert page.rows == [["", "size", "word"], ["a", "1.5 mm", "x"], ["long name", "-12 mm", "<y>"]]
    assert "A & B" in page.text
    assert "note <1>" in page.text
    assert str(Table(("", ""), [("a", "b")])) == "a  b"


def test_a_result_says_what_it_is(result: Result) -> None:
    lines = repr(result).splitlines()
    assert lines[0] == "Result of 'Sphere <b>on</b> flat'"
    assert lines[1].startswith("  2 load steps, ")
    shown = dict(line.strip().split("  ", 1) for line in lines[2:-1])
    assert shown["normal load"].strip() == "100.0 N"
    assert shown["tangential load x"].strip() == "12.00 N"
    assert "tangential load y" not in shown  # is nothing but rounding
    assert "% of the contact area" in shown["stick"]
    assert lines[-1].startswith("  fields: pressure, traction_x")


def test_a_result_in_a_notebook_has_maps_of_its_last_step(result: Result) -> None:
    page = Page(result._repr_html_())
    assert ["normal load", "100.0 N"] in page.rows
    assert "Sphere <b>on</b> flat" in page.text
    pressure, zones = page.pictures
    view = StepView(result, -1)
    plane = Plane(view.window(1.15), max(pressure.size))
    assert plane.shape == pressure.size[::-1]
    values = view.at(*plane.points)
    # yellow in the middle, white outside, and the contact as large as it is
    row, col = np.unravel_index(values.argmax(), values.shape)
    assert pressure.getpixel((int(col), int(row)))[1] > 200
    white = np.array(pressure.convert("L")) == 255
    assert (white == ~view.touches(*plane.points)).all()
    assert (values[~white] > 0.0).mean() > 0.99  # the pressure ends within a tenth of a spacing of the edge
    colors = {color: count for count, color in zones.getcolors() or ()}
    assert set(colors) == {(255, 255, 255), (0, 0x72, 0xB2), (0xF0, 0xC0, 0x5A)}
    share = colors[0, 0x72, 0xB2] / (colors[0, 0x72, 0xB2] + colors[0xF0, 0xC0, 0x5A])
    assert share == pytest.approx(float(result.stick_area[-1] / result.contact_area[-1]), rel=0.05)


@pytest.mark.parametrize(
    ("arguments", "pictures"),
    [
        ({"friction_coefficient": None, "loads": {"normal_load": 10.0}}, 1),
        ({"friction_coefficient": None, "loads": [{"normal_load": 10.0}, {"normal_load": 0.0}]}, 0),
        ({"fields": ["gap"]}, 0),
    ],
)
def test_a_result_without_pictures_is_shown_too(arguments: dict[str, Any], pictures: int) -> None:
    made = sheared(**arguments).run()
    page = Page(made._repr_html_())
    assert len(page.pictures) == pictures
    assert [row[0] for row in page.rows if row[0] == "residuals"] == ["residuals"]


def test_a_run_that_was_ended_says_so() -> None:
    result = sheared().run(on_step=lambda step: "enough")
    assert "1 load step of 2 (unfinished run)" in repr(result)
    assert "stopped by on_step after step 1: enough" in Page(result._repr_html_()).text


def test_cases_and_steps_are_tables_in_a_notebook() -> None:
    case = sheared()
    page = Page(case._repr_html_())
    assert ["friction", "coefficient 0.2, incremental"] in page.rows
    assert "Sphere <b>on</b> flat" in page.text
    step = next(case.start())
    assert ["normal load", "100.0 N"] in Page(step._repr_html_()).rows


def test_the_quantities_of_a_result_are_listed(result: Result) -> None:
    quantities = result.quantities
    assert set(quantities) == set(result.dataset.variables)
    assert quantities["approach"] is VARIABLES["approach"]
    assert quantities["approach"].units == "m"
    assert "torque" in quantities
    assert len(quantities) == len(list(quantities))
    with pytest.raises(KeyError, match=r"the result has no aproach; did you mean approach\?"):
        _ = quantities["aproach"]
    assert re.search(r"^contact_area +m² +by step +contact area: ", repr(quantities), re.MULTILINE)
    assert ["traction_x", "Pa", "at each node, by step", "shear traction on body 1 along x"] in Page(
        quantities._repr_html_()
    ).rows
    with pytest.raises(
        AttributeError, match=r"^presure is no quantity of a result; did you mean pressure\?$"
    ):
        _ = result.presure
    with pytest.raises(AttributeError, match=r"displacement_1_x is not in this result"):
        _ = result.displacement_1_x


def test_going_through_a_result_is_going_through_its_steps(result: Result) -> None:
    assert [int(step["step"]) for step in result] == [1, 2]
    assert float(list(result)[1].shift_x) == float(result.shift_x[1])
    assert "shift_x" in result
    assert "displacement_1_x" not in result


def test_a_comparison_is_a_table_on_a_terminal(result: Result) -> None:
    console = Console(width=100, file=io.StringIO(), record=True)
    console.print(result.compare())
    text = console.export_text()
    assert "Load step 2 against closed-form solutions" in text
    assert "Cattaneo–Mindlin" in text
    assert "spacings in the contact radius" in text


@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs Chromium")
def test_a_browser_draws_the_pictures_beside_each_other(result: Result, tmp_path: Path) -> None:
    """The page is as wide as a cell of a notebook, dark; both maps are seen."""
    page = tmp_path / "page.html"
    page.write_text(f'<body style="background:#111;color:#eee">{result._repr_html_()}</body>')
    words = ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--window-size=900,900"]
    subprocess.run(
        [*words, f"--user-data-dir={tmp_path}/profile", f"--screenshot={tmp_path}/page.png", page.as_uri()],
        check=True,
        capture_output=True,
        timeout=120,
    )
    pixels = np.array(Image.open(tmp_path / "page.png").convert("RGB")).astype(int)
    blue = (np.abs(pixels - [0, 0x72, 0xB2]).sum(axis=2) < 12).sum()
    yellow = (np.abs(pixels - [0xFD, 0xE7, 0x25]).sum(axis=2) < 40).sum()
    assert blue > 1000
    assert yellow > 200
