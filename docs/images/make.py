"""Make the pictures of the README and the documentation: ``python docs/images/make.py``."""

from pathlib import Path

from hexcontact import Case, plotting
from hexcontact.plotting import influence as plotting_influence

HERE = Path(__file__).parent
CASES = HERE.parents[1] / "cases"


def main() -> None:
    """Solve the cases and draw them."""
    spheres = Case.from_toml(CASES / "hertz_spheres.toml").run()
    coarse = Case.from_toml(CASES / "hertz_spheres.toml", overrides={"grid.spacing": "0.1 mm"}).run()
    cylinders = Case.from_toml(
        CASES / "crossed_cylinders.toml",
        overrides={"body.2.surface.angle": "45 deg", "grid.spacing": "0.05 mm"},
    ).run()
    fretting = Case.from_toml(CASES / "dissimilar_fretting.toml", overrides={"grid.spacing": "1.75 um"}).run()
    mindlin = Case.from_toml(CASES / "cattaneo_mindlin.toml").run()
    loop = Case.from_toml(CASES / "mindlin_loop.toml").run()
    figures = {
        "hertz_spheres": plotting.overview(spheres),
        "contact_boundary": plotting.contact_boundary(coarse),
        "crossed_cylinders": plotting.overview(cylinders),
        "dissimilar_fretting": plotting.overview(fretting, 25),
        "fretting_zones": plotting.zones(fretting, [10, 11, 12, 15, 20, 25, 30, 35]),
        "fretting_tractions": plotting.tractions(fretting, [10, 11, 15, 20, 25, 30, 35, 40]),
        "cattaneo_mindlin": plotting.tractions(mindlin, [13, 19, 25, 31, 37]),
        "mindlin_loop": plotting.loop(loop),
        **{name.replace("-", "_"): draw() for name, draw in plotting_influence.FIGURES.items()},
    }
    for name, figure in figures.items():
        figure.savefig(HERE / f"{name}.png", dpi=150)
        print(f"written: {HERE / name}.png")


if __name__ == "__main__":
    main()
