"""The page of a result: what it holds, and that it works in a browser: Chromium, which CI=true requires."""

import base64
import fcntl
import hashlib
import html
import html.parser
import io
import json
import os
import re
import select
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import PATIENCE
from PIL import Image
from scipy.spatial import KDTree
from typer.testing import CliRunner

from hexcontact import Case, analytic, open_result
from hexcontact.cli.app import app
from hexcontact.cli.report import report, write_report
from hexcontact.errors import DeckError
from hexcontact.result.html import Plane
from hexcontact.result.result import Result
from hexcontact.result.step import Step
from hexcontact.result.view import MOST_STEPS, StepView, mapped_steps
from hexcontact.text import quantity, worded

DECK = """\
title = "Sheared <script>alert('1 & 2')</script> {{data}}"
[body.1]
young_modulus = "210 GPa"
poisson_ratio = 0.3
surface = { shape = "sphere", radius = "10 mm" }
[body.2]
young_modulus = "70 GPa"
poisson_ratio = 0.3
[friction]
coefficient = 0.5
[grid]
nodes_in_radius = 8
[solver]
algorithm = "incremental"
[[load]]
normal_load = "100 N"
steps = 2
label = "press"
[[load]]
tangential_load_x = "30 N"
steps = 4
label = "shear </script>"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sphere pressed and sheared, one pressed without friction, a run that was stopped, and their pages."""
    folder = tmp_path_factory.mktemp("pages")
    case = Case.from_text(DECK)
    case.run(folder / "sheared.nc")
    body = {"young_modulus": 210e9, "poisson_ratio": 0.3}
    pressed = Case(
        body_1=body | {"surface": {"shape": "sphere", "radius": 0.01}}, body_2=body, nodes_in_radius=6,
        normal_load=100.0, title="Pressed",
    )  # fmt: skip
    pressed.run(folder / "pressed.nc")

    def stop(step: Step) -> None:
        if step.number == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        case.run(folder / "stopped.nc", on_step=stop)
    for name in ("sheared", "pressed", "stopped"):
        done = CliRunner().invoke(app, ["report", str(folder / f"{name}.nc")])
        assert (done.exit_code, done.stdout) == (0, f"written: {folder / name}.html\n"), done.stderr
    return folder


def data_of(page: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert found
    data: dict[str, Any] = json.loads(found.group(1))
    return data


FACTOR = {  # from the units of the page to SI
    **{"": 1.0, "N": 1.0, "GPa": 1e9, "MPa": 1e6, "µm": 1e-6, "nm": 1e-9},
    **{"mJ": 1e-3, "µJ": 1e-6, "mm²": 1e-6, "µm²": 1e-12, "J/m²": 1.0},
}
MAPPED = (
    ("pressure",),
    ("traction_x", "traction_y"),
    ("slip_increment_x", "slip_increment_y"),
    ("accumulated_slip",),
    ("dissipation_density",),
)


def picture(data: str) -> np.ndarray:
    """Return the shades of a picture of the page."""
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data))))


class Reader(html.parser.HTMLParser):
    """Looks for what is never closed, and for everything that a page would fetch."""

    VOID = frozenset({"meta", "input", "link", "img", "br"})

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.fetched: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.ids += [given["id"] or ""] if "id" in given else []
        self.fetched += [value or "" for name, value in attrs if name in ("src", "srcset", "action", "data")]
        self.fetched += [tag] if tag in ("link", "iframe", "object", "embed", "base") else []
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.mark.parametrize("name", ["sheared", "pressed", "stopped"])
def test_page_is_whole_and_fetches_nothing(folder: Path, name: str) -> None:
    page, reader = (folder / f"{name}.html").read_text(encoding="utf-8"), Reader()
    reader.feed(page)
    assert reader.open == [] and reader.fetched == []
    assert len(set(reader.ids)) == len(reader.ids)
    assert "default-src 'none'" in page
    assert re.findall(r"https?://(?!www\.w3\.org/2000/svg)", page) == []
    assert "@import" not in page and "url(" not in page.replace("url(#${id})", "")
    assert len(page) < 1e6


def test_text_of_the_deck_is_text(folder: Path) -> None:
    page = (folder / "sheared.html").read_text(encoding="utf-8")
    assert page.count("<script") == 2 and page.count("</script>") == 2
    assert "<title>Sheared &lt;script&gt;alert(&#39;1 &amp; 2&#39;)&lt;/script&gt; {{data}}</title>" in page
    assert data_of(page)["labels"][-1] == "shear </script>"
    assert "tangential_load_x = &#34;30 N&#34;" in page


def test_page_says_where_it_comes_from(folder: Path) -> None:
    page, result = (folder / "sheared.html").read_text(encoding="utf-8"), open_result(folder / "sheared.nc")
    attributes = result.dataset.attrs
    for text in (
        hashlib.sha256(DECK.encode()).hexdigest(),
        attributes["run"],
        attributes["machine"],
        attributes["source"],
    ):
        assert text in page
    assert os.uname().machine in attributes["machine"]
    assert "Unfinished" not in page


def test_unfinished_run_says_so(folder: Path) -> None:
    page = (folder / "stopped.html").read_text(encoding="utf-8")
    assert "Unfinished run: 3 of 6 load steps. interrupted" in page
    assert data_of(page)["fields"]["steps"] == [1, 2, 3]


def test_inputs_loads_and_residuals_are_in_tables(folder: Path) -> None:
    page = (folder / "sheared.html").read_text(encoding="utf-8")
    assert "sphere, radius 10.00 mm" in page and "coefficient 0.5, incremental" in page
    history = open_result(folder / "sheared.nc").history
    assert len(history) == 6
    residuals = [f"residual_{name}" for name in ("normal", "tangential", "force", "shear_force", "torque")]
    for number, row in history.iterrows():
        (line,) = re.findall(rf'<tr id="row-{number}">.*?</tr>', page)
        cells = [html.unescape(cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", line)]
        assert cells[:-1] == [
            row["label"],
            *(f"{row[name]:.1e}" for name in residuals),
            str(row["sweeps"]),
            str(row["cuts"]),
            f"{row['operator_applications']:.3g}",
        ]
        assert cells[-1] == quantity(row["seconds"], "s", 3)
    (table,) = re.findall(r"<caption>Load history: the end of each segment</caption>.*?</table>", page)
    rows = [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row) for row in re.findall(r"<tr>.*?</tr>", table)]
    ends = history.loc[[2, 6]]
    assert [row[:3] for row in rows] == [
        ["segment", "label", "steps"],
        ["1", "press", "1 to 2"],
        ["2", "shear &lt;/script&gt;", "3 to 6"],
    ]
    for sign, name, unit in (
        ("P", "normal_load", "N"),
        ("approach", "approach", "m"),
        ("Qx", "tangential_load_x", "N"),
    ):
        column = rows[0].index(sign)
        shown = [quantity(value if abs(value) > 1e-6 else 0.0, unit) for value in ends[name]]
        assert [row[column] for row in rows[1:]] == shown


def test_maps_are_the_fields(folder: Path) -> None:
    result = open_result(folder / "sheared.nc")
    fields = data_of((folder / "sheared.html").read_text(encoding="utf-8"))["fields"]
    assert [m["name"] for m in fields["maps"]] == [
        "pressure",
        "traction",
        "slip_increment",
        "accumulated_slip",
        "dissipation_density",
    ]
    assert fields["length"] == "µm"
    assert fields["steps"] == [1, 2, 3, 4, 5, 6]
    assert [m["unit"] for m in fields["maps"]] == ["MPa", "MPa", "nm", "nm", "J/m²"]
    for shown, names in zip(fields["maps"], MAPPED, strict=True):
        assert len(shown["images"]) == len(shown["max"]) == 6
        for k, number in enumerate(fields["steps"]):
            view = StepView(result, number)
            parts = [view.data[name].values for name in names]
            largest = np.sqrt(sum(part**2 for part in parts))[view.contact].max()
            if "slip" in shown["name"] and largest < 1e-7 * float(result.approach.max()):
                largest = 0.0  # rounding
            assert shown["max"][k] * FACTOR[shown["unit"]] == pytest.approx(largest, rel=1e-3)
            gray = picture(shown["images"][k])
            plane = Plane(tuple(1e-6 * v for v in fields["limits"]), max(gray.shape))
            assert plane.shape == gray.shape
            expected = np.sqrt(sum(view.at(*plane.points, name) ** 2 for name in names))
            inside = view.touches(*plane.points)
            np.testing.assert_array_equal(gray > 0, inside)
            if "slip" in shown["name"]:  # between nodes in contact: what is beyond the edge has no say
                inside &= view.at(*plane.points, view.contact.astype(float)) > 1.0 - 1e-9
            assert inside.sum() > 1000
            read = (gray - 1.0) / 254.0 * largest
            expected = np.minimum(expected, largest) if largest else 0.0 * expected  # as bright as it gets
            apart = np.abs(read - expected)[inside]
            # limits have six digits, which count where tractions are as steep as roots
            assert (apart > largest * 0.505 / 254).sum() <= (20 if "Pa" in shown["unit"] else 0)
            assert apart.max() <= 0.02 * largest


def test_pictures_begin_at_the_upper_left() -> None:
    x, y = Plane((0.0, 2.0, 10.0, 11.0), 4).points
    np.testing.assert_allclose(x, [[0.25, 0.75, 1.25, 1.75]] * 2)
    np.testing.assert_allclose(y, [[10.75] * 4, [10.25] * 4])


def test_zone_map_ends_at_the_edges(folder: Path) -> None:
    result = open_result(folder / "sheared.nc")
    fields = data_of((folder / "sheared.html").read_text(encoding="utf-8"))["fields"]
    assert len(fields["zones"]) == 6
    for number, zones in enumerate(fields["zones"], start=1):
        gray, view = picture(zones), StepView(result, number)
        plane = Plane(tuple(1e-6 * v for v in fields["limits"]), max(gray.shape))
        x0, x1, y0, y1 = plane.limits
        area = (x1 - x0) * (y1 - y0) / gray.size
        assert (gray == 1).sum() * area == pytest.approx(float(view.data["stick_area_fit"]), rel=0.01)
        assert (gray > 0).sum() * area == pytest.approx(float(view.data["contact_area_fit"]), rel=0.01)
        pixels = KDTree(np.stack([at.ravel() for at in plane.points], axis=1))
        for zone, nodes in enumerate((~view.contact, view.stick, view.contact & ~view.stick)):
            inside = nodes & (view.x > x0) & (view.x < x1) & (view.y > y0) & (view.y < y1)
            nodes_inside = np.stack([view.x[inside], view.y[inside]], axis=1)
            nearest = pixels.query(nodes_inside, k=4)[1]
            assert (gray.ravel()[nearest] == zone).any(axis=1).all()  # an edge may run between node and pixel


def test_arrows_point_along_the_traction_where_there_is_slip(folder: Path) -> None:
    fields = data_of((folder / "sheared.html").read_text(encoding="utf-8"))["fields"]
    view = StepView(open_result(folder / "sheared.nc"), -1)
    x_min, x_max, y_min, y_max = (1e-6 * v for v in fields["limits"])
    for name, many, sign in (
        ("traction", 50, 1),
        ("slip_increment", 20, -1),
    ):  # the load on body 1 is along +x
        (shown,) = [m for m in fields["maps"] if m["name"] == name]
        x, y, u, v = np.reshape(shown["arrows"][-1], (-1, 4)).T
        assert len(x) > many and x.min() > 0 and x.max() < 1000 and y.min() > 0 and y.max() < 1000
        assert np.mean(sign * u > 0) > 0.8
        at = x_min + (x_max - x_min) * x / 1000.0, y_max - (y_max - y_min) * y / 1000.0
        largest = shown["max"][-1] * FACTOR[shown["unit"]]
        for drawn, axis in ((u, "x"), (v, "y")):
            part = f"{'slip_increment' if name == 'slip' else name}_{axis}"
            # places are rounded to a thousandth of the map, values to a percent of the largest
            np.testing.assert_allclose(drawn, 100.0 * view.at(*at, part) / largest, atol=1.5)


def test_slip_that_is_only_noise_is_not_shown() -> None:
    deck = DECK.replace("coefficient = 0.5", "coefficient = inf").replace("70 GPa", "210 GPa")
    case = Case.from_text(deck)
    fields = data_of(report(case.run()))["fields"]
    assert [m["name"] for m in fields["maps"]] == ["pressure", "traction"]
    assert [list(panel["curves"]) for panel in fields["sections"]["panels"]][-1] == ["q_x"]


def test_sections_hold_pressure_and_bounds(folder: Path) -> None:
    fields = data_of((folder / "sheared.html").read_text(encoding="utf-8"))["fields"]
    result = open_result(folder / "sheared.nc")
    pressure, shear = fields["sections"]["panels"]
    assert list(pressure["curves"]) == ["p"] and list(shear["curves"]) == ["q_x", "μp", "−μp"]
    assert (pressure["unit"], shear["unit"]) == ("MPa", "MPa")
    x = 1e-6 * np.array(fields["sections"]["x"])
    line = result.section("pressure", points=201)
    np.testing.assert_allclose(x, line.x, rtol=5e-5, atol=1e-12)
    middle = float(line.y[0])
    assert fields["section_y"] == worded(middle, "m")
    for panel, name, field, factor in (
        (pressure, "p", "pressure", 1.0),
        (shear, "q_x", "traction_x", 1.0),
        (shear, "μp", "pressure", 0.5),
        (
            shear,
            "−μp",
            "pressure",
            -0.5,
        ),  # pressing moves the surfaces inwards: the traction lies on both sides
    ):
        assert len(panel["curves"][name]) == len(fields["steps"]) == 6
        for number, curve in zip(fields["steps"], panel["curves"][name], strict=True):
            view = StepView(result, number)
            expected = factor * view.at(x, np.full(x.size, middle), field)
            found = FACTOR[panel["unit"]] * np.array(curve)
            # places have five digits, which count where tractions are as steep as roots
            np.testing.assert_allclose(found, expected, rtol=1e-3, atol=2e-3 * np.abs(expected).max() + 1.0)
    pressed = data_of((folder / "pressed.html").read_text(encoding="utf-8"))
    (panel,) = pressed["fields"]["sections"]["panels"]
    assert list(panel["curves"]) == ["p", "p (Hertz)"]
    x = 1e-6 * np.array(pressed["fields"]["sections"]["x"])
    hertz = analytic.hertz_sphere(0.5 * 210e9 / 0.91, 0.01, normal_load=100.0)
    found = [FACTOR[panel["unit"]] * np.array(*curves) for curves in panel["curves"].values()]
    assert np.count_nonzero(found[1]) > 100
    np.testing.assert_allclose(found[1], hertz.pressure(x), rtol=0, atol=4e-4 * hertz.max_pressure)
    view = StepView(open_result(folder / "pressed.nc"), -1)
    np.testing.assert_allclose(found[0], view.at(x, 0.0 * x), rtol=0, atol=6e-4 * hertz.max_pressure)
    assert pressed["charts"] == [] and pressed["fields"]["zones"] == []


def test_curves_are_the_history(folder: Path) -> None:
    charts = {c["title"]: c for c in data_of((folder / "sheared.html").read_text(encoding="utf-8"))["charts"]}
    history = open_result(folder / "sheared.nc").history
    expected = {
        "Normal load": {"": "normal_load"},
        "Tangential load": {"Q_x": "tangential_load_x"},
        "Approach": {"": "approach"},
        "Shift": {"x": "shift_x"},
        "Contact and stick area": {"contact": "contact_area_fit", "stick": "stick_area_fit"},
        "Max pressure": {"": "max_pressure"},
        "Max traction": {"": "max_traction"},
        "Elastic energy": {"": "elastic_energy"},
        "Dissipated energy": {"": "dissipated_energy"},
        "Tangential load over shift, x": {"": "tangential_load_x"},
        "Residuals": {
            "R_n": "residual_normal",
            "R_t": "residual_tangential",
            "R_P": "residual_force",
            "R_Q": "residual_shear_force",
        },
    }
    assert list(charts) == list(expected)
    for title, curves in expected.items():
        chart = charts[title]
        assert list(chart["curves"]) == list(curves)
        over, factor = (
            ("shift_x", FACTOR[chart["xlabel"].partition("(")[2][:-1]]) if "over" in title else (None, 1.0)
        )
        xs = history[over] if over else history.index
        begun = [0.0, *xs]  # the unloaded state
        np.testing.assert_allclose(factor * np.array(chart["x"]), begun, rtol=1e-4, atol=1e-14, err_msg=title)
        for sign, name in curves.items():
            values = FACTOR[chart["unit"]] * np.array(chart["curves"][sign])
            np.testing.assert_allclose(values, [0.0, *history[name]], rtol=1e-4, atol=1e-18, err_msg=name)
    assert charts["Residuals"]["log"]


def test_a_history_that_ends_unloaded_shows_its_contacts(tmp_path: Path) -> None:
    loads = [{"normal_load": 100.0, "steps": 3}, {"normal_load": 0.0, "steps": 2}]
    body = {"young_modulus": 210e9, "poisson_ratio": 0.3}
    ball = body | {"surface": {"shape": "sphere", "radius": 0.01}}
    result = Case(body_1=ball, body_2=body, nodes_in_radius=8, loads=loads).run()
    data = data_of(write_report(result, tmp_path / "page.html").read_text(encoding="utf-8"))
    largest = 1e6 * float(result.contact_radius.max())
    assert largest < data["fields"]["limits"][1] < 1.6 * largest
    areas = next(chart for chart in data["charts"] if "area" in chart["title"])
    factor = FACTOR[areas["unit"]]
    shown = [factor * value for value in areas["curves"]["contact"]]
    assert shown == pytest.approx([0.0, *result.contact_area_fit.values], rel=1e-3)


def test_long_histories_show_some_steps_as_maps(folder: Path) -> None:
    dataset = open_result(folder / "sheared.nc").dataset
    long = dataset.isel(step=np.arange(1000) % 6).assign_coords(step=np.arange(1, 1001))
    kept = mapped_steps(Result(long))
    assert len(kept) <= MOST_STEPS and kept[-1] == 1000 and len(set(np.diff(kept))) == 1
    long.attrs = dataset.attrs | {"output_every": 300}
    assert mapped_steps(Result(long)) == [300, 600, 900, 1000]


def test_result_without_fields_has_a_page(folder: Path) -> None:
    result = open_result(folder / "sheared.nc")
    bare = Result(
        result.dataset.drop_dims(["row", "col"]).assign_coords(result.dataset[["row", "col"]].coords)
    )
    page = report(bare)
    assert data_of(page)["fields"] is None and "so that there are no maps" in page


def test_only_a_page_is_written_or_replaced(folder: Path) -> None:
    before = (folder / "sheared.nc").read_bytes()
    done = CliRunner().invoke(app, ["report", str(folder / "sheared.nc"), "-o", str(folder / "sheared.nc")])
    assert done.exit_code == 2 and "expected a page, such as" in done.stderr
    assert (folder / "sheared.nc").read_bytes() == before
    with pytest.raises(DeckError, match="missing does not exist"):
        write_report(open_result(folder / "pressed.nc"), folder / "missing" / "page.html")
    assert not list(folder.glob("*.tmp"))


# --- in a browser ---------------------------------------------------------------------------------


class Browser:
    """Chromium without a window, driven through a pipe by its DevTools protocol."""

    FLAGS = (
        *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
        *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
        *("--disable-dev-shm-usage", "--hide-scrollbars", "--remote-debugging-pipe"),
    )

    def __init__(self, program: str, profile: Path) -> None:
        theirs_in, self.sender = os.pipe()
        self.receiver, theirs_out = os.pipe()
        words = [program, *self.FLAGS, f"--user-data-dir={profile}", "about:blank"]
        # descriptors 3 and 4 are those that the browser talks through
        ends = [fcntl.fcntl(end, fcntl.F_DUPFD, 10) for end in (theirs_in, theirs_out)]
        start = "import os; from sys import argv as a; "
        start += "os.dup2(int(a[1]), 3); os.dup2(int(a[2]), 4); os.execv(a[3], a[3:])"
        self.process = subprocess.Popen(
            [sys.executable, "-c", start, *map(str, ends), *words],
            pass_fds=ends, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        for end in (theirs_in, theirs_out, *ends):
            os.close(end)
        self.buffer, self.count, self.session = b"", 0, ""
        self.events: list[dict[str, Any]] = []
        targets = self.send("Target.getTargets")["targetInfos"]
        page = next(t["targetId"] for t in targets if t["type"] == "page")
        self.session = self.send("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.send(f"{domain}.enable")

    def send(self, method: str, **params: Any) -> dict[str, Any]:
        self.count += 1
        message = {"id": self.count, "method": method, "params": params}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.sender, json.dumps(message).encode() + b"\0")
        while True:
            while b"\0" not in self.buffer:
                assert select.select([self.receiver], [], [], PATIENCE)[0], f"no answer to {method}"
                part = os.read(self.receiver, 1 << 16)
                assert part, "the browser has gone"
                self.buffer += part
            text, _, self.buffer = self.buffer.partition(b"\0")
            answer = json.loads(text)
            if answer.get("id") == self.count:
                assert "error" not in answer, answer
                result: dict[str, Any] = answer["result"]
                return result
            self.events.append(answer)

    def value(self, expression: str) -> Any:
        answer = self.send("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def wait_for(self, expression: str) -> None:
        limit = time.monotonic() + PATIENCE
        while not self.value(expression):
            assert time.monotonic() < limit, expression
            time.sleep(0.02)

    def open(self, page: Path, fragment: str = "") -> None:
        self.send("Page.navigate", url="about:blank")
        self.wait_for("location.href === 'about:blank'")
        self.events.clear()
        self.send("Page.navigate", url=page.as_uri() + fragment)
        self.wait_for("document.readyState === 'complete' && !!document.body && !!document.body.dataset.step")

    def press(self, key: str) -> None:
        code = {"ArrowRight": 39, "ArrowLeft": 37, "Home": 36, "End": 35, "Tab": 9}[key]
        for kind in ("rawKeyDown", "keyUp"):
            self.send("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=code)

    def picture(self) -> Image.Image:
        answer = self.send("Page.captureScreenshot", format="png", captureBeyondViewport=True)
        return Image.open(io.BytesIO(base64.b64decode(answer["data"]))).convert("RGB")

    def faults(self) -> list[Any]:
        """Errors of scripts, complaints on the console, and requests that leave the page."""
        found: list[Any] = []
        for event in self.events:
            params = event.get("params", {})
            if event.get("method") in ("Runtime.exceptionThrown", "Log.entryAdded"):
                found.append(params)
            if event.get("method") == "Network.requestWillBeSent":
                url = params["request"]["url"]
                found += [] if url.startswith(("file:", "data:", "about:")) else [url]
        return found

    def close(self) -> None:
        for end in (self.sender, self.receiver):
            os.close(end)
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


BROWSERS = "chromium", "chromium-browser", "google-chrome"


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        absent = "no Chromium on this machine: pages are not opened (apt install chromium)"
        pytest.fail(absent) if os.environ.get("CI") == "true" else pytest.skip(absent)
    browser = Browser(program, tmp_path_factory.mktemp("profile"))
    yield browser
    browser.close()


def test_ci_fails_where_no_browser_can_be_installed(tmp_path: Path) -> None:
    for name in os.environ["PATH"].split(os.pathsep):
        for program in Path(name).glob("*") if name else ():
            link = tmp_path / program.name
            if program.name not in BROWSERS and not link.is_symlink():
                link.symlink_to(program)
    root = Path(__file__).parents[2]
    environment = {"PATH": str(tmp_path), "CI": "true", "APT": "no"}
    done = subprocess.run(
        ["sh", str(root / ".ci/bootstrap.sh")], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 1 and "Install chromium." in done.stderr


def state(browser: Browser) -> tuple[str, str, str, str]:
    """What shows the step: slider, words, table of the state, marked row."""
    found: list[str] = browser.value(
        "[document.getElementById('step').value, document.getElementById('now').textContent, "
        "document.getElementById('state-number').textContent, document.querySelector('tr.now').id]"
    )
    return found[0], found[1], found[2], found[3]


def hrefs(browser: Browser) -> list[str]:
    found: list[str] = browser.value(
        "[...document.querySelectorAll('#maps image')].map(i => i.getAttribute('href'))"
    )
    return found


def test_page_opens_at_the_last_step(browser: Browser, folder: Path) -> None:
    browser.open(folder / "sheared.html")
    assert state(browser) == ("5", "step 6 of 6, shear </script>", "6", "row-6")
    assert browser.value("document.querySelectorAll('#charts figure').length") == 11
    assert len(hrefs(browser)) == len(MAPPED) + 1  # and the zones
    assert all(h.startswith("data:image/png") for h in hrefs(browser))
    assert browser.faults() == []


def test_address_chooses_a_step(browser: Browser, folder: Path) -> None:
    browser.open(folder / "sheared.html", "#step=2")
    assert state(browser) == ("1", "step 2 of 6, press", "2", "row-2")
    browser.value("location.hash = '#step=4'")
    browser.wait_for("document.body.dataset.step === '4'")
    assert state(browser)[0] == "3"


def test_slider_moves_by_keys_and_the_maps_with_it(browser: Browser, folder: Path) -> None:
    browser.open(folder / "sheared.html", "#step=2")
    first = hrefs(browser)
    browser.value("document.getElementById('step').focus()")
    for key, step in (("ArrowRight", 3), ("ArrowRight", 4), ("ArrowLeft", 3), ("End", 6), ("Home", 1)):
        browser.press(key)
        browser.wait_for(f"document.body.dataset.step === '{step}'")
        assert state(browser)[2:] == (str(step), f"row-{step}")
        assert browser.value("location.hash") == f"#step={step}"
        assert all(a != b for a, b in zip(first, hrefs(browser), strict=True))
    spoken = browser.value("document.getElementById('step').getAttribute('aria-valuetext')")
    assert spoken == "step 1 of 6, press"
    assert browser.faults() == []


def test_map_is_painted_with_the_values(browser: Browser, folder: Path) -> None:
    browser.send(
        "Emulation.setDeviceMetricsOverride", width=1250, height=900, deviceScaleFactor=1, mobile=False
    )
    browser.open(folder / "sheared.html")
    box = browser.value(
        "(() => { const b = document.querySelector('#map-pressure image').getBoundingClientRect();"
        " return [b.x + scrollX, b.y + scrollY, b.width, b.height]; })()"
    )
    shot = browser.picture()
    x, y, width, height = box
    middle = np.array(shot.getpixel((int(x + width / 2), int(y + height / 2))), dtype=int)
    assert np.abs(middle - [253, 231, 37]).max() < 12  # the brightest color of viridis: p_max
    assert shot.getpixel((int(x + 4), int(y + 4))) == (255, 255, 255)  # no contact there


def test_scale_can_be_that_of_the_step(browser: Browser, folder: Path) -> None:
    browser.open(folder / "sheared.html", "#step=1")
    common = hrefs(browser)
    browser.value("document.getElementById('common').click()")
    browser.wait_for(
        f"document.querySelector('#map-pressure image').getAttribute('href') !== {json.dumps(common[0])}"
    )
    assert browser.faults() == []


def test_values_are_read_with_the_pointer(browser: Browser, folder: Path) -> None:
    browser.open(folder / "pressed.html")
    x, y = browser.value(
        "(() => { const i = document.querySelector('#map-pressure image');"
        " i.scrollIntoView({block: 'center'});"
        " const b = i.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; })()"
    )
    browser.send("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
    browser.wait_for("document.getElementById('readout').textContent !== ''")
    text = browser.value("document.getElementById('readout').textContent")
    found = re.fullmatch(r"Pressure at x = (\S+), y = (\S+) µm: about (\S+) (MPa|GPa)", text)
    assert found, text
    peak = float(open_result(folder / "pressed.nc").max_pressure[-1]) / {"MPa": 1e6, "GPa": 1e9}[found[4]]
    assert float(found[3]) == pytest.approx(peak, rel=0.02)


@pytest.mark.parametrize("name", ["pressed", "stopped"])
def test_other_results_have_pages_that_work(browser: Browser, folder: Path, name: str) -> None:
    browser.open(folder / f"{name}.html")
    assert browser.faults() == []
    assert browser.value("document.getElementById('step').checkVisibility()") == (name == "stopped")
    assert browser.value("document.getElementById('history').checkVisibility()") == (name == "stopped")


def test_dark_screens_and_print(browser: Browser, folder: Path) -> None:
    browser.open(folder / "sheared.html")
    background = "getComputedStyle(document.body).backgroundColor"
    browser.send("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "dark"}])
    assert browser.value(background) == "rgb(13, 17, 23)"
    browser.send("Emulation.setEmulatedMedia", media="print")
    assert browser.value(background) == "rgb(255, 255, 255)"
    assert not browser.value("document.getElementById('step').checkVisibility()")
    assert browser.value("document.getElementById('now').checkVisibility()")
    browser.send("Emulation.setEmulatedMedia", media="", features=[])
