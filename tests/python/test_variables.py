"""The table of quantities, and what is derived from it."""

from dataclasses import fields

import pytest

from hexcontact import ContactState
from hexcontact.core import flat
from hexcontact.variables import (
    CORE,
    ESTIMATED,
    FIELDS,
    FRICTIONLESS_FIELDS,
    LOADS,
    MAPS,
    PANELS,
    RESIDUALS,
    STATE,
    SUMMARY,
    VARIABLES,
    VECTORS,
    label_of,
)


@pytest.mark.parametrize("groups", [PANELS, MAPS, VECTORS, CORE], ids=["panels", "maps", "vectors", "core"])
def test_quantities_of_a_group_are_drawn_and_stored_alike(groups: dict[str, tuple[str, ...]]) -> None:
    for names in groups.values():
        assert len({VARIABLES[name].dims for name in names}) == 1
        assert len({VARIABLES[name].dtype for name in names}) == 1
        if groups is not CORE:
            assert len({VARIABLES[name].units for name in names}) == 1


def test_the_arrays_of_the_core_hold_a_contact_state_and_its_measures() -> None:
    names = [name for part in ("fields", "zone", "numbers", "rolling", "residuals") for name in CORE[part]]
    known = [entry.name for entry in fields(ContactState)]
    assert set(names) <= set(known)
    assert not set(CORE["measures"]) & set(known)
    assert set(known) - set(names) == {
        *("converged", "sliding", "touches_rim", "sweeps", "cuts", "operator_applications", "stopped"),
    }
    assert set(STATE[True]) == {*CORE["fields"], *CORE["zone"]}
    assert set(flat.History._fields) == set(CORE["numbers"]) < set(flat.Solution._fields) < set(known)
    assert set(CORE["residuals"]) < set(flat.Solution._fields)
    assert set(flat.Measures._fields) == {*CORE["measures"], "contact_area_error", "mean_gap"}
    assert STATE[False] == ("pressure", "gap", "zone")


def test_each_rigid_motion_has_a_load_and_a_displacement() -> None:
    assert LOADS == {
        "z": ("normal_load", "approach"),
        "x": ("tangential_load_x", "shift_x"),
        "y": ("tangential_load_y", "shift_y"),
        "twist": ("torque", "twist"),
    }
    assert [label_of(load) for load, _ in LOADS.values()] == ["P", "Qx", "Qy", "Mz"]
    assert label_of("shift_x") == "shift x"


def test_noise_is_judged_beside_quantities_of_the_same_unit() -> None:
    powers = {"m": 1, "rad": 0, "N": 0, "N m": 1, "J": 1, "1": 0, "rad/m": -1, "J/m": 0}
    forces = {"N": True, "N m": True, "J": True, "J/m": True}
    forces |= dict.fromkeys(("m", "rad", "1", "rad/m"), False)
    for name, variable in VARIABLES.items():
        beside, power = variable.scale
        if beside:
            assert forces[VARIABLES[beside].units] == forces[variable.units], name
            assert powers[VARIABLES[beside].units] + power == powers[variable.units], name


def test_columns_of_the_table() -> None:
    assert list(RESIDUALS) == ["R_n", "R_t", "R_P", "R_Q", "R_M"]
    assert list(VECTORS) == [
        *("traction", "relative_displacement", "slip_increment"),
        *("displacement_1", "displacement_2"),
    ]
    assert set(FIELDS) - set(FRICTIONLESS_FIELDS) == {
        *("traction_x", "traction_y", "relative_displacement_x", "relative_displacement_y"),
        *("slip_increment_x", "slip_increment_y", "accumulated_slip", "dissipation_density"),
        *("worn_depth", "worn_depth_step_change", "cycle_dissipation_density", "cycle_slip_amplitude"),
        "moved_gap",
    }
    assert SUMMARY[:2] == ("max_pressure", "max_traction")
    assert {"sweeps", "seconds", "label", *RESIDUALS.values()}.isdisjoint(ESTIMATED)
    assert {"approach", "contact_area_fit", "dissipated_energy_step"} < set(ESTIMATED)
