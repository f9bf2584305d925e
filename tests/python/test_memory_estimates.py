"""What `check` says of the memory of a run, and what a run with an interim output takes at most."""

import pytest
from bench.memory import deck, measured

DIRECT = '[solver]\nmethod = "direct"\n'
BOX = "[[stress]]\ndepths = [1e-5, 2e-5, 3e-5, 4e-5, 5e-5, 6e-5, 7e-5, 8e-5]\n"
POINTS = "[[stress]]\npoints = [[0.0, 0.0, 1e-5]]\n"
INTERFACE = "[interface]\ncoefficient = 1e15\nexponent = 1\n"
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
        ("friction, alike", 192, {"more": POINTS + 'steps = "all"\n', "steps": 5}),
        ("friction, alike", 384, {"more": POINTS}),
        ("wear", 128, {}),
        ("wear", 128, {"steps": 6}),
    ],
)
def test_the_estimate_bounds_the_peak(problem: str, side: int, options: dict[str, object]) -> None:
    """With the interpreter and all libraries, as the system counts it."""
    check(deck(problem, side, **options))  # type: ignore[arg-type]


def test_a_load_step_takes_few_copies_of_its_state() -> None:
    """Bytes a further node: 450 with like materials, 750 with whole records for the output."""
    small, large = (measured(deck("friction, alike", side)).peak for side in (192, 384))
    assert (large - small) / (384**2 - 192**2) < 600


def test_the_estimate_of_fatigue_parameters() -> None:
    """Stress histories of twelve load steps."""
    text = deck("wear", 64, steps=4)
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
