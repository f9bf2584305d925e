"""What `check` says of the memory of a run, and what a run with an interim output takes at most."""

import pytest
from bench.memory import HALF, deck, measured

DIRECT = '[solver]\nmethod = "direct"\n'
BOX = "[[stress]]\ndepths = [1e-5, 2e-5, 3e-5, 4e-5, 5e-5, 6e-5, 7e-5, 8e-5]\n"
POINTS = "[[stress]]\npoints = [[0.0, 0.0, 1e-5]]\n"
INTERFACE = "[interface]\ncoefficient = 1e15\nexponent = 1\n"
WAVES = {"frictionless": "", "friction, unlike": "[friction]\ncoefficient = 0.3\n"}
MOVED = '[output]\nfields = ["displacement_1_z"]\n'


def check(text: str) -> None:
    """Bound the peak by the estimate, of which another BLAS may leave buffers untouched."""
    memory = measured(text)
    assert memory.peak < 1.1 * memory.estimate
    assert memory.estimate < 1.5 * memory.peak


@pytest.mark.parametrize(
    ("problem", "side", "options"),
    [
        ("frictionless", 48, {}),
        ("frictionless", 256, {}),
        ("frictionless", 256, {"more": MOVED}),
        ("frictionless", 256, {"steps": 16}),
        ("frictionless", 64, {"more": DIRECT}),
        ("frictionless", 99, {"more": DIRECT, "share": 0.7, "steps": 1}),
        ("frictionless", 256, {"more": BOX}),
        ("frictionless", 256, {"more": INTERFACE}),
        ("friction, alike", 128, {}),
        ("friction, alike", 192, {"steps": 12}),
        ("friction, unlike", 128, {"share": 0.4}),
        ("friction, unlike", 256, {"share": 0.4}),
        # tractions corrected at the edges, of the last step and of all
        ("friction, unlike", 256, {"more": POINTS}),
        ("friction, alike", 128, {"more": POINTS + 'steps = "all"\n', "steps": 5}),
        ("wear", 128, {}),
        ("wear", 128, {"steps": 6}),
    ],
)
def test_the_estimate_bounds_the_peak(problem: str, side: int, options: dict[str, object]) -> None:
    """With the interpreter and all libraries, as the system counts it."""
    check(deck(problem, side, **options))  # type: ignore[arg-type]


@pytest.mark.parametrize("problem", WAVES)
def test_the_estimate_of_a_window_that_repeats(problem: str) -> None:
    """Its transforms are not padded."""
    shear = '[[load]]\nmean_traction_x = "60 MPa"\n' if WAVES[problem] else ""
    memory = measured(
        "[body.1]\nyoung_modulus = 210e9\npoisson_ratio = 0.3\n"
        'surface = { shape = "formula", expression = "1e-6*(1 - cos(2*pi*x/1e-3)*cos(2*pi*y/1e-3))" }\n'
        f"[body.2]\nrigid = true\n{WAVES[problem]}"
        '[grid]\nboundary = "periodic"\nextent = ["1 mm", "1 mm"]\nnodes_across = 384\n'
        f'[[load]]\nmean_pressure = "500 MPa"\n{shear}'
    )
    assert 0.9 < memory.estimate / memory.peak < 1.25


@pytest.mark.parametrize(
    ("problem", "sides", "most"),
    [
        ("frictionless", (384, 768), 170),
        ("friction, alike", (192, 384), 520),
        ("friction, unlike", (256, 384), 680),
    ],
)
def test_bytes_of_a_further_node(problem: str, sides: tuple[int, int], most: int) -> None:
    """Few copies of the state before, no field of the window for a mesh, solvers on the nodes in contact."""
    small, large = (measured(deck(problem, side, share=HALF, steps=1)).peak for side in sides)
    assert (large - small) / (sides[1] ** 2 - sides[0] ** 2) < most


def test_the_estimate_of_fatigue_parameters() -> None:
    """Stress histories of twelve load steps."""
    text = deck("wear", 48, steps=4)
    wear = text[text.index("[wear]") :]
    text = text.replace(wear[: wear.index("jump = 10\n") + 10], "")
    text = text.replace('[[load]]\nlabel = "cycle"', '[[load]]\nrepeat = 2\nlabel = "cycle"')
    check(text + '[[fatigue]]\nsegment = ["cycle"]\nparameters = ["smith_watson_topper"]\n')


@pytest.mark.parametrize(
    ("problem", "side", "share"),
    [
        ("friction, alike", 44, 0.8),
        ("friction, unlike", 44, 0.8),
        ("friction, unlike", 60, 0.8),
        ("friction, unlike", 80, 0.8),
        ("friction, alike", 121, 0.15),
    ],
)
def test_the_estimate_of_matrices_with_friction(problem: str, side: int, share: float) -> None:
    """The matrix is as large as the contact, whatever the window."""
    check(deck(problem, side, share=share, more=DIRECT))
