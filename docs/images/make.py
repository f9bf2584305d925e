"""Make the pictures of README and documentation, and docs/gallery.md: ``python docs/images/make.py``."""

import contextlib
import functools
import os
import re
import runpy
import shlex
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import xarray
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from PIL import Image
from typer.testing import CliRunner

from hexcontact import Case, Result, Study, plotting
from hexcontact.cli.app import app
from hexcontact.plotting.history import study as draw_study

HERE = Path(__file__).parent
CASES = HERE.parents[1] / "cases"
GALLERY = HERE.parent / "gallery.md"
PATHS = HERE / "path_dependence.csv"


@functools.cache
def solved(name: str, **overrides: Any) -> Result:
    """Run a case, once."""
    changed = {key.replace("__", "."): value for key, value in overrides.items()}
    return Case.from_toml(CASES / f"{name}.toml", overrides=changed).run()


def fretting() -> Result:
    """Run the case of the README on the lattice that it names."""
    return solved("dissimilar_fretting", grid__spacing="1.75 um")


def stiffening_interface() -> Figure:
    """Draw how a compliant interface goes over into unilateral contact with friction as it stiffens."""
    spheres = {
        "body": {
            "1": {"young_modulus": 1.0, "poisson_ratio": 0.0, "surface": {"shape": "sphere", "radius": 1.0}},
            "2": {"rigid": True},
        },
        "friction": {"coefficient": 0.3},
        "grid": {"spacing": 0.05},
        "load": [{"normal_load": 4 / 3}, {"tangential_load_x": "0.4 mu P", "steps": 2}],
    }
    quantities = {
        "approach": "approach",
        "max_pressure": "largest pressure",
        "contact_area_fit": "contact area",
        "shift_x": "shift",
        "stick_area_fit": "stick area",
    }
    looks = zip(("#0072B2", "#D55E00", "#009E73", "#56B4E9", "#CC79A7"), "osD^v", strict=True)
    styles = dict(zip(quantities, ({"color": c, "marker": m} for c, m in looks), strict=True))

    def last(**interface: float) -> dict[str, float]:
        layer = {"interface": interface} if interface else {}
        history = Case.from_dict(spheres | layer).run().dataset
        return {name: float(history[name][-1]) for name in quantities}

    rigid = last()
    stiffness = 10.0 ** np.arange(0, 4.6, 0.5)
    figure, parts = plt.subplots(1, 2, figsize=(10, 4), sharey=True, layout="constrained")
    for exponent, axes in zip((1, 2), parts, strict=True):
        found = [last(coefficient=c, exponent=exponent) for c in stiffness]
        for name, words in quantities.items():
            errors = [abs(values[name] / rigid[name] - 1) for values in found]
            axes.loglog(stiffness, errors, ms=3.5, label=words, **styles[name])
        first = exponent / (exponent + 1) * (2 / np.pi / stiffness) ** (1 / exponent)
        axes.loglog(stiffness, first, "k--", lw=1, label="approach, first order (C6)")
        axes.set(title=f"exponent $m$ = {exponent}", xlabel="coefficient $c$ ($E^* = R = 1$)")
    parts[0].set_ylabel("relative difference from $c = \\infty$")
    parts[0].legend(frameon=False)
    return figure


def solve_paths() -> None:
    """Run cases/study_path.toml and keep the numbers of its picture in path_dependence.csv."""
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "study_path.nc"
        done = CliRunner().invoke(app, ["study", str(CASES / "study_path.toml"), "-o", str(target)])
        assert done.exit_code == 0, done.output
        with xarray.open_dataset(target) as study:
            numbers = study[["shift_x", "stick_area", "contact_area", "tangential_load_x"]]
            numbers.to_dataframe().to_csv(PATHS, float_format="%.9e", lineterminator="\n")


def path_dependence() -> Figure:
    """Draw where incremental and static answers differ in the P-Q plane."""
    return ends_of_paths(pd.read_csv(PATHS, index_col=[0, 1, 2]).to_xarray())


def ends_of_paths(study: xarray.Dataset) -> Figure:
    """Draw the differences at the ends of the paths of the study."""
    normal, sliding = 60.0, 18.0  # P1 and mu P1, N
    incremental, static = (study.sel(algorithm=name) for name in ("incremental", "static"))
    share = incremental.tangential_load_x / sliding
    load = (study.normal_load_2 / normal).broadcast_like(share)
    quantities = (
        (
            "difference of shifts / largest shift",
            (incremental.shift_x - static.shift_x) / static.shift_x.max(),
        ),
        (
            "difference of stick areas / contact area",
            (incremental.stick_area - static.stick_area) / static.contact_area,
        ),
    )
    figure, panels = plt.subplots(
        1, 2, figsize=(10, 4.4), sharey=True, layout=ConstrainedLayoutEngine(wspace=0.06)
    )
    line, moved = np.array([0.0, 2.0]), (load - 1.0) ** 2 + (share - 0.5) ** 2 > 1e-6
    for axes, (title, values) in zip(panels, quantities, strict=True):
        axes.fill_between(line, line - 0.5, line, color="0.9", lw=0, zorder=0)
        for sign in (1.0, -1.0):
            axes.fill_between(
                line, sign * line, sign * 3.0, fc="white", ec="0.75", hatch="///", lw=1, zorder=1
            )
        values = abs(values).where(moved)  # without a path there is nothing to compare
        drawn = axes.scatter(load, share, c=values, s=70, cmap="viridis", edgecolor="0.3", lw=0.5, zorder=3)
        figure.colorbar(drawn, ax=axes, label=title)
        axes.plot(line, line - 0.5, color="#D55E00", lw=1.2, ls="--")
        axes.plot([0.0, 1.0, 1.0], [0.0, 0.0, 0.5], color="k", lw=1)
        axes.plot(1.0, 0.5, "ko", ms=5, zorder=4)
        box = {"fc": "white", "ec": "none", "alpha": 0.8, "pad": 1.0}
        axes.text(0.55, 1.25, "sliding", fontsize=9, bbox=box)
        axes.text(1.43, 1.34, "no memory", fontsize=9)
        slope = {"rotation": 45, "rotation_mode": "anchor", "transform_rotates_text": True}
        axes.text(1.235, 0.655, r"$dQ = \mu\,dP$", color="#D55E00", fontsize=9, **slope)
        axes.set(xlabel="$P/P_1$", xlim=(0.5, 1.7), ylim=(-0.7, 1.5))
    panels[0].set_ylabel(r"$Q/\mu P_1$")
    return figure


def rough_areas() -> Figure:
    """Draw contact area and mean gap over the load, by the study of rough surfaces."""
    with tempfile.TemporaryDirectory() as folder:
        study = Study.from_toml(CASES / "study_rough.toml", output=Path(folder) / "study.nc").run()
        return draw_study(study.load(), ["contact_area", "mean_gap"], over="p")


FIGURES: dict[str, Callable[[], Figure]] = {
    "hertz_spheres": lambda: plotting.overview(solved("hertz_spheres")),
    "contact_boundary": lambda: plotting.contact_boundary(solved("hertz_spheres", grid__spacing="0.1 mm")),
    "crossed_cylinders": lambda: plotting.overview(
        solved("crossed_cylinders", body__2__surface__angle="45 deg", grid__spacing="0.05 mm")
    ),
    "dissimilar_fretting": lambda: plotting.overview(fretting(), 25),
    "fretting_zones": lambda: plotting.zones(fretting(), [10, 11, 12, 15, 20, 25, 30, 35]),
    "fretting_tractions": lambda: plotting.tractions(fretting(), [10, 11, 15, 20, 25, 30, 35, 40]),
    "cattaneo_mindlin": lambda: plotting.tractions(solved("cattaneo_mindlin"), [13, 19, 25, 31, 37]),
    "interface": stiffening_interface,
    "path_dependence": path_dependence,
    "rolling_dent_power": lambda: plotting.history(
        solved("rolling_dent"),
        ["max_pressure", "creepage_x", "dissipated_energy", "creep_power"],
        "rolled_distance",
    ),
    "rough_areas": rough_areas,
    "mindlin_loop": lambda: plotting.loop(solved("mindlin_loop")),
    **runpy.run_path(str(HERE / "influence.py"))["FIGURES"],
    **runpy.run_path(str(HERE / "rolling.py"))["FIGURES"],
}


# --- gallery --------------------------------------------------------------------------------------

# Decks that take long: a lattice, or an accuracy, that is enough for a small picture.
COARSER = {
    "friction_table_9_3": "grid.spacing='3.5 um'",
    "cattaneo_mindlin": "grid.nodes_in_radius=20",
    "error_bars": "accuracy.target=0.05 --set title='Stiff sphere on aluminum to 5 %'",
    "mindlin_loop": "grid.nodes_in_radius=20",
    "adaptive_fretting": "solver.step_tolerance=0.05",
    "rigid_plane": "grid.nodes_in_radius=20",
    "subsurface_stress": "grid.nodes_in_radius=12",
    "fretting_fatigue": "grid.nodes_in_radius=12",
}
HEADER = """\
# Gallery

Made by `python docs/images/make.py`; do not edit.

The decks of `cases/`, each with its picture; [a table](cases.md) lists what they are compared with.
"""
DECK = re.compile(r"^\| `(\w+)\.toml` \| (.+?) \| .* \| `(\w+\.nc.*)` \|$")


def decks() -> dict[str, tuple[str, str]]:
    """Return what each deck of the tables of cases/README.md shows, and the arguments that draw it."""
    rows = map(DECK.match, (CASES / "README.md").read_text(encoding="utf-8").splitlines())
    return {row[1]: (row[2], row[3]) for row in rows if row}


def commands(name: str) -> list[str]:
    """Return the commands that run and draw a deck."""
    coarser = f" --set {COARSER[name]}" if name in COARSER else ""
    return [f"hexcontact run cases/{name}.toml{coarser}", f"hexcontact plot {decks()[name][1]}"]


def gallery() -> str:
    """Return the page."""
    text = HEADER
    for line in (CASES / "README.md").read_text(encoding="utf-8").splitlines():
        if line.startswith("## W"):
            text += f"\n{line}\n"
        elif row := DECK.match(line):
            name, shown = row[1], row[2]
            block = "\n".join(["```sh", *commands(name), "```"])
            text += f"\n### {name}\n\n{shown[0].upper()}{shown[1:]}.\n\n{block}\n"
            text += f"\n![{shown}](images/cases/{name}.png)\n"
    return text


def draw_deck(name: str, picture: Path) -> None:
    """Run and draw a deck by its commands; the picture has half their size and few colors."""
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        Path("cases").symlink_to(CASES)
        for line in commands(name):
            quiet = ["--quiet"] if line.startswith("hexcontact run") else []
            done = CliRunner().invoke(app, [*shlex.split(line)[1:], *quiet])
            assert done.exit_code == 0, f"{line}\n{done.output}"
        [drawn] = Path().glob("*.png")
        with Image.open(drawn) as image:
            half = image.convert("RGB").reduce(2)
    half.quantize(64, dither=Image.Dither.NONE).save(picture, optimize=True)


def main() -> None:
    """Solve the cases and draw them."""
    os.environ.setdefault("MPLBACKEND", "agg")
    GALLERY.write_text(gallery(), encoding="utf-8")
    print(f"written: {GALLERY}")
    for name in decks():
        picture = HERE / f"cases/{name}.png"
        draw_deck(name, picture)
        print(f"written: {picture}")
    solve_paths()
    for name, draw in FIGURES.items():
        draw().savefig(HERE / f"{name}.png", dpi=150)
        print(f"written: {HERE / name}.png")


if __name__ == "__main__":
    main()
