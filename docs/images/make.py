"""Make the pictures of the README and the documentation: ``python docs/images/make.py``."""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from hexcontact import Case, Result, plotting
from hexcontact.plotting.registry import entries

HERE = Path(__file__).parent
CASES = HERE.parents[1] / "cases"


@functools.cache
def solved(name: str, **overrides: Any) -> Result:
    """Run a case, once."""
    changed = {key.replace("__", "."): value for key, value in overrides.items()}
    return Case.from_toml(CASES / f"{name}.toml", overrides=changed).run()


def fretting() -> Result:
    """Run the case of the README on the lattice that it names."""
    return solved("dissimilar_fretting", grid__spacing="1.75 um")


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
    "mindlin_loop": lambda: plotting.loop(solved("mindlin_loop")),
    **{name.replace("-", "_"): figure.draw for name, figure in entries().items() if not figure.of_a_result},
}


def main() -> None:
    """Solve the cases and draw them."""
    for name, draw in FIGURES.items():
        draw().savefig(HERE / f"{name}.png", dpi=150)
        print(f"written: {HERE / name}.png")


if __name__ == "__main__":
    main()
