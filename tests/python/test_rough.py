"""Random rough surfaces of decks."""

from pathlib import Path

import numpy as np
import pytest
from validation import repeating

from hexcontact import Case, DeckError
from hexcontact.plotting.maps import surface as picture
from hexcontact.problem import plausibility
from hexcontact.surfaces import Rough

STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
E_STAR = 210e9 / (2 * (1 - 0.3**2))
SIDE = 0.256e-3
WAVES = {"hurst": 0.8, "shortest": "16 um", "longest": "128 um", "seed": 2}


def pressed(nodes: int, pressure: float, **more) -> Case:
    body = {**STEEL, "surface": {"shape": "rough", **WAVES, "rms_slope": 0.05, **more}}
    grid = {"boundary": "periodic", "extent": [SIDE, SIDE], "nodes_across": nodes}
    return Case(body_1=body, body_2=STEEL, loads={"mean_pressure": pressure}, tolerance=1e-8, **grid)


def spectrum_of(heights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths (m), and amplitudes of the waves of a period (m)."""
    n = len(heights)
    number = np.hypot(*np.meshgrid(np.fft.fftfreq(n, 1 / n), np.fft.fftfreq(n, 1 / n)))
    return SIDE / np.maximum(number, 1e-9), np.abs(np.fft.fft2(heights)) / n**2


def test_heights_have_the_moments_and_waves_that_are_asked_for() -> None:
    at = SIDE * np.arange(512) / 512
    x, y = np.meshgrid(at, at)
    for key, value in {"rms_height": 1e-6, "rms_slope": 0.05}.items():
        heights = Rough(**WAVES, **{key: value}).repeating((SIDE, SIDE)).height(x, y)
        length, size = spectrum_of(heights)
        found = {
            "rms_height": np.std(heights),
            "rms_slope": np.sqrt(np.sum((2 * np.pi / length) ** 2 * size**2)),
        }
        assert found[key] == pytest.approx(value, rel=2e-3)
        assert Rough(**WAVES, **{key: value}, period=[SIDE, SIDE]).rms == pytest.approx(
            tuple(found.values()), rel=2e-3
        )
        assert heights.min() == pytest.approx(0.0, abs=3e-3 * np.ptp(heights))
        strange = (length < 15.9e-6) | ((length > 129e-6) & (length < 1.0))
        assert np.sum(size[strange] ** 2) < 1e-4 * np.sum(size[~strange & (length < 1.0)] ** 2)
        # the spectrum falls like k^(-2(1 + H))
        means = [np.mean(size[abs(np.log(length / wave)) < 0.2] ** 2) for wave in (20e-6, 100e-6)]
        assert np.log(means[1] / means[0]) / np.log(5.0) == pytest.approx(3.6, abs=0.6)


def test_heights_count_from_the_highest_point_between_those_of_any_lattice() -> None:
    for seed in range(5):
        surface = Rough(**{**WAVES, "seed": seed}, rms_height=1e-6).repeating((SIDE, SIDE))
        at = SIDE * np.arange(256) / 256
        heights = surface.height(*np.meshgrid(at, at, indexing="ij"))
        i, j = np.unravel_index(heights.argmin(), heights.shape)
        fine = SIDE / 256 * np.linspace(-1.0, 1.0, 201)
        near = surface.height(*np.meshgrid(at[i] + fine, at[j] + fine, indexing="ij"))
        assert -1e-12 < near.min() < 1e-10 < heights.min()


def test_steep_roughness_is_told() -> None:
    assert not any("slope by" in sentence for sentence in pressed(64, 1e8).warnings)
    (found,) = (one for one in pressed(64, 1e8, rms_slope=0.2).warnings if "slope by" in one)
    assert found.startswith("the rough surfaces slope by 0.2 (rms), expected at most 0.1: ")


def test_every_lattice_sees_the_same_surface_and_shorter_waves_add_to_it() -> None:
    at = SIDE * np.arange(64) / 64
    one = Rough(**WAVES, rms_height=1e-6).repeating((SIDE, SIDE))
    fine = one.height(*np.meshgrid(SIDE * np.arange(128) / 128, at))
    assert np.array_equal(fine[:, ::2], one.height(*np.meshgrid(at, at)))
    other = Rough(**{**WAVES, "shortest": "12 um"}, rms_height=1e-6).repeating((SIDE, SIDE))
    change = other.height(*np.meshgrid(at, at)) - one.height(*np.meshgrid(at, at))
    assert np.std(change) < 0.2e-6
    another = Rough(**{**WAVES, "seed": 3}, rms_height=1e-6).repeating((SIDE, SIDE))
    assert np.std(another.height(*np.meshgrid(at, at)) - one.height(*np.meshgrid(at, at))) > 0.5e-6


@pytest.mark.parametrize("pressure", [20e6, 200e6])
def test_error_bar_of_the_area_contains_that_of_the_finer_lattice(pressure: float) -> None:
    coarse, fine = (pressed(n, pressure).run().dataset.isel(step=-1) for n in (64, 128))
    change = abs(float(coarse["contact_area"] - fine["contact_area"]))
    assert 0.1 * change < float(fine["contact_area_error"]) < float(coarse["contact_area_error"])
    assert change < float(coarse["contact_area_error"])
    share = float(fine["contact_area"]) / SIDE**2
    assert share == pytest.approx(2.2 * pressure / (0.05 * E_STAR), rel=0.4)


def test_a_rough_ball_has_several_spots() -> None:
    """A free window: the surface repeats after four of its longest waves."""
    shapes = [{"shape": "sphere", "radius": "10 mm"}, {"shape": "rough", **WAVES, "rms_height": "0.3 um"}]
    case = Case(
        body_1={**STEEL, "surface": shapes}, body_2=STEEL, spacing=4e-6, extent=["0.6 mm", "0.6 mm"],
        center=[0.0, 0.0], normal_load="20 N",
    )  # fmt: skip
    last = case.run().dataset.isel(step=-1)
    smooth = np.pi * (0.75 * 20.0 * 10e-3 / E_STAR) ** (2 / 3)
    assert 0.2 * smooth < float(last["contact_area"]) < 0.9 * smooth


def test_equal_surfaces_of_both_bodies_are_told() -> None:
    """Their peaks would meet, as those of independent surfaces do not."""
    for seeds, words in (
        ((2, 2), ["note: two rough surfaces have seed = 2: their waves coincide"]),
        ((2, 3), []),
    ):
        one, two = (
            {**STEEL, "surface": {"shape": "rough", **WAVES, "rms_slope": 0.05, "seed": n}} for n in seeds
        )
        case = Case(
            body_1=one, body_2=two, boundary="periodic", extent=[SIDE, SIDE], nodes_across=32,
            loads={"mean_pressure": 1e6},
        )  # fmt: skip
        assert [note.split(", ")[0] for note in plausibility.notes(case).values()] == [
            word.removeprefix("note: ") for word in words
        ]


def sheared(nodes: int):
    """Unlike bodies, pressed to 2 % of E* and sheared to 60 % of sliding."""
    surface = {"shape": "rough", **WAVES, "rms_slope": 0.05}
    last = Case(
        body_1={**STEEL, "surface": surface}, body_2={"rigid": True}, friction_coefficient=0.3,
        boundary="periodic", extent=(SIDE, SIDE), nodes_across=nodes,
        loads=[{"mean_pressure": 5e8, "steps": 4}, {"mean_traction_x": 9e7, "steps": 2}],
    ).run().dataset.isel(step=-1)  # fmt: skip
    slips = (last["zone"] == 2).values
    bound = 0.3 * last["pressure"].values
    shear = np.hypot(last["traction_x"].values, last["traction_y"].values)
    assert shear[slips] == pytest.approx(bound[slips], rel=1e-6)
    assert (shear <= bound * (1 + 1e-6) + 1e-6 * bound.max()).all()
    assert float(last["mean_gap"]) > 0.0
    assert 0.1 < float(last["stick_area"] / last["contact_area"]) < 0.4
    return last


def test_unlike_rough_bodies_with_friction() -> None:
    coarse, fine = sheared(64), sheared(128)
    for name in ("shift_x", "dissipated_energy", "mean_gap"):
        assert float(coarse[name]) == pytest.approx(float(fine[name]), rel=0.1)


@pytest.mark.parametrize(("other", "work"), [(STEEL, 27.0), ({"rigid": True}, 63.0)])
def test_work_with_friction(other: dict, work: float) -> None:
    """Alike and unlike bodies, pressed and sheared to 60 % of sliding, each in one load step."""
    surface = {"shape": "rough", **WAVES, "rms_slope": 0.05}
    steps = Case(
        body_1={**STEEL, "surface": surface}, body_2=other, friction_coefficient=0.3,
        boundary="periodic", extent=(SIDE, SIDE), nodes_across=128,
        loads=[{"mean_pressure": 5e8}, {"mean_traction_x": 9e7}],
    ).run().dataset  # fmt: skip
    assert (steps["operator_applications"].values < work).all()


def test_friction_on_512_by_512_nodes() -> None:
    """Superposition with ν = 0, and unlike bodies beside a lattice a quarter as fine."""
    assert repeating.superposed(512, (0.6,)).passed
    coarse, fine = sheared(128), sheared(512)
    for name in ("shift_x", "dissipated_energy", "mean_gap", "stick_area"):
        assert float(coarse[name]) == pytest.approx(float(fine[name]), rel=0.02)
    change = abs(float(coarse["contact_area"] - fine["contact_area"]))
    assert change < float(coarse["contact_area_error"])


BAD = {
    "both": ({"rms_height": 1e-6}, "expected rms_height or rms_slope, not both"),
    "none": ({"rms_slope": None}, "expected rms_height or rms_slope, one of them"),
    "hurst": ({"hurst": 1.5}, "hurst = 1.5: expected"),
    "order": (
        {"shortest": "1 mm"},
        "^body.1.surface: shortest, rolloff, longest: expected wavelengths that",
    ),
    "waves": (
        {"shortest": "1.2 mm", "longest": "1.3 mm", "period": [SIDE, SIDE]},
        "no wave between shortest and longest fits",
    ),
    "longest": ({"longest": "1 mm"}, "no such waves in a window of"),
    "points": ({"shortest": "1 nm"}, "expected at most 67,108,864"),
    "period": ({"period": ["0.2 mm", "0.2 mm"]}, "the gap does not repeat"),
}


@pytest.mark.parametrize("name", BAD)
def test_wrong_decks_are_told(name: str) -> None:
    more, sentence = BAD[name]
    surface = {"shape": "rough", **WAVES, "rms_slope": 0.05, **more}
    surface = {key: value for key, value in surface.items() if value is not None}
    grid = {"boundary": "periodic", "extent": [SIDE, SIDE], "nodes_across": 64}
    with pytest.raises(DeckError, match=sentence):
        Case(body_1={**STEEL, "surface": surface}, body_2=STEEL, loads={"mean_pressure": 1e6}, **grid)


def test_a_lattice_of_60_degrees_does_not_fit(tmp_path: Path) -> None:
    grid = {"boundary": "periodic", "extent": [SIDE, SIDE], "nodes_across": 64, "cell_angle": "60 deg"}
    surface = {"shape": "rough", **WAVES, "rms_slope": 0.05}
    with pytest.raises(DeckError, match='expected grid.lattice = "rectangular"'):
        Case(body_1={**STEEL, "surface": surface}, body_2=STEEL, loads={"mean_pressure": 1e6}, **grid)


def test_the_picture_has_the_period_of_the_window() -> None:
    surface = {"shape": "rough", **WAVES, "rms_height": 1e-7}
    grid = {"boundary": "periodic", "extent": [SIDE, SIDE], "nodes_across": 64}
    case = Case(body_1={**STEEL, "surface": surface}, body_2=STEEL, loads={"mean_pressure": 1e6}, **grid)
    gap, _ = case.initial_gap(case.lattice)
    [drawn] = picture(case).axes[0].collections
    row, col = np.unravel_index(np.argmax(drawn.get_array()), drawn.get_array().shape)
    highest = np.unravel_index(gap.argmax(), gap.shape)
    middles = drawn.get_coordinates()[row : row + 2, col : col + 2].mean(axis=(0, 1)) * 1e-6
    assert (
        np.hypot(*(middles - [case.lattice.x[highest], case.lattice.y[highest]])) < 2 * case.lattice.spacing
    )
