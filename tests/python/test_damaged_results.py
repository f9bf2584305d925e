"""Damaged results and journals: data as written, or an error that names the file."""

from dataclasses import replace
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray
from fuzz.file_made import WINDOW, made_step, written

from hexcontact import Case
from hexcontact.errors import DeckError
from hexcontact.result import journal, netcdf
from hexcontact.result.journal import Solution, TrialFolder, journal_of, write_record
from hexcontact.result.layout import Metadata, assemble
from hexcontact.result.store import Store, open_result
from hexcontact.study.dataset import histories
from hexcontact.variables import LARGEST, RESIDUALS, VARIABLES

MATERIALS = {
    **{"effective_modulus": 2e11, "dundurs_beta": 0.0, "tangential_compliance_ratio": 1.0},
    **{"friction_coefficient": 0.2, "algorithm": "incremental", "coupling": "full", "tolerance": 1e-8},
}


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "out.nc"


def test_files_that_are_no_results(tmp_path: Path) -> None:
    (tmp_path / "text.nc").write_text("no netCDF")
    (tmp_path / "empty.nc").touch()
    (tmp_path / "folder").mkdir()
    xarray.Dataset({"a": ("x", [1.0])}).to_netcdf(tmp_path / "foreign.nc")
    for name, message in {
        "text.nc": r"text\.nc is damaged or not a netCDF file",
        "empty.nc": r"empty\.nc is damaged or not a netCDF file",
        "foreign.nc": r"foreign\.nc was not written by hexcontact",
        "missing.nc": r"there is no file .*missing\.nc",
        "folder": "folder is a folder without finished steps",
    }.items():
        with pytest.raises(DeckError, match=message):
            open_result(tmp_path / name)


def test_another_layout_is_refused_with_its_number(out: Path) -> None:
    written(out)
    with netCDF4.Dataset(out, "a") as file:
        file.schema_version = np.int32(99)
        file.hexcontact_version = "7.0"
    message = r"has the file layout 99 of hexcontact 7\.0; this version reads layout 1"
    with pytest.raises(DeckError, match=message):
        open_result(out)


@pytest.mark.parametrize("place", ["journal.made", "netcdf.fault_of_result"])
def test_a_defect_of_the_reader_is_no_damage(out: Path, place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    written(out, count=3 if "netcdf" in place else 2)
    if "netcdf" in place:
        out.write_bytes(out.read_bytes()[:-48])  # the seal
    monkeypatch.setattr(f"hexcontact.result.{place}", None)
    with pytest.raises(TypeError, match="'NoneType' object is not callable"):
        open_result(out)


def test_a_truncated_file_is_damaged_not_a_crash(out: Path) -> None:
    written(out)
    whole = out.read_bytes()
    for part in np.linspace(0, len(whole) - 1, 40).astype(int):
        out.write_bytes(whole[:part])
        with pytest.raises(DeckError, match="is damaged"):
            open_result(out)


def test_flipped_bytes_in_a_result_are_noticed(out: Path) -> None:
    """Before HDF5, which damage may crash, reads any of them."""
    written(out, 1, planned=1)
    whole = out.read_bytes()
    for at in range(0, len(whole) - 8, 211):
        out.write_bytes(whole[:at] + bytes(255 - byte for byte in whole[at : at + 8]) + whole[at + 8 :])
        for read in (open_result, histories):
            with pytest.raises(DeckError, match=r"out\.nc is damaged: (its bytes are not|the checksum)"):
                read(out)


def test_flipped_bytes_in_a_record_are_noticed(out: Path) -> None:
    """A record that can be read is the record that was written, its history included."""
    described = written(out, 1, planned=2)
    record = journal_of(out) / "000001.npz"
    whole = record.read_bytes()
    expected = assemble(described, [made_step(0)], complete=False)
    noticed, places = 0, range(0, len(whole), 11)
    for at in places:
        record.write_bytes(whole[:at] + bytes([255 - whole[at]]) + whole[at + 1 :])
        try:
            read = open_result(out).dataset
        except DeckError as error:
            assert "000001.npz is damaged" in str(error)
            noticed += 1
        else:
            assert read.identical(expected)
    assert noticed > 0.9 * len(places)


def test_every_flipped_bit_in_a_text_of_a_journal_is_noticed(out: Path) -> None:
    trials = TrialFolder(out.parent)
    trials.begin(Metadata(title="a case", deck="deck = 1", parameters=MATERIALS))
    trials.add(Solution(1, 0, 1e-6, (0.0, 1e-9), 99, [{"max_pressure": 1.0 / 3.0, "label": "é", "cuts": 0}]))
    for name in ("header.json", "1_0.json"):
        path = trials.folder / name
        data, read, noticed = path.read_bytes(), (trials.metadata, trials.solutions), 0
        for place in range(8 * len(data)):
            changed = bytearray(data)
            changed[place // 8] ^= 1 << place % 8
            path.write_bytes(changed)
            try:
                found = trials.metadata, trials.solutions
            except DeckError as error:
                assert str(error).startswith(f"{path} ")
                noticed += 1
            else:
                assert found == read  # E for e in a number
        assert noticed > 0.99 * 8 * len(data)
        path.write_bytes(data)
        assert (trials.metadata, trials.solutions) == read


def test_lattices_of_another_run_are_refused(out: Path) -> None:
    trials = TrialFolder(out.parent)
    for steps_of, of in (("one", "one"), ("one", "another")):
        trials.begin(Metadata(run=of))
        with Store(trials.path(0), Metadata(run=steps_of, planned_steps=3), overwrite=True) as store:
            store.append(made_step(0))
        if of == steps_of:
            assert len(trials.result(out)) == 1
    with pytest.raises(DeckError, match=r"lattices holds load steps of another run than .*header\.json"):
        trials.result(out)


def test_every_step_has_the_numbers_that_are_required() -> None:
    cases = Path(__file__).parents[2] / "cases"
    dataset = Case.from_toml(cases / "torsion.toml", overrides={"grid.nodes_in_radius": 8}).run().dataset
    known = {name: v for name, v in VARIABLES.items() if v.dtype == "f8" and v.dims == ("step",)}
    required = [name for name, v in known.items() if v.required and not name.startswith("stick_center")]
    assert len(required) > 20
    assert netcdf.fault_of_result(dataset) == ""
    for name in required:
        damaged = dataset.assign({name: dataset[name].where(dataset["step"] != 2)})
        assert netcdf.fault_of_result(damaged) == f"{name} holds numbers that no load step has"


def test_records_of_a_journal_are_of_one_run(out: Path) -> None:
    written(out, planned=4)
    write_record(journal_of(out) / "000002.npz", "another", made_step(1))
    message = r"000002\.npz does not belong to the records before it: its run is another"
    with pytest.raises(DeckError, match=message):
        open_result(out)
    with pytest.raises(DeckError, match=message) as caught:
        Store.reopened(out)
    assert "continues after step 1" in caught.value.__notes__[0]


@pytest.mark.parametrize("what", ["history", "fields"])
def test_a_record_that_was_written_again_is_refused(out: Path, what: str) -> None:
    """Each of its numbers is one that a step may have."""
    written(out, 1, planned=2)
    record = journal_of(out) / "000001.npz"
    with np.load(record) as file:
        arrays = dict(file)
    if what == "fields":
        arrays["pressure"] = arrays["pressure"] * (1 + 1e-9)
    else:
        text = arrays["about"].tobytes().replace(b'"seconds": 0.5', b'"seconds": 0.6')
        arrays["about"] = np.frombuffer(text, "u1")
    np.savez(record, **arrays)
    with pytest.raises(DeckError, match=r"000001\.npz is damaged: its checksum differs"):
        open_result(out)


@pytest.mark.parametrize("large", [False, True])
def test_a_shorter_type_in_a_record_is_noticed(
    out: Path, monkeypatch: pytest.MonkeyPatch, large: bool
) -> None:
    """The checksum is compared at the end of an array, though its header asks for fewer bytes."""
    monkeypatch.setattr(journal, "LARGE", 0 if large else journal.LARGE)
    with Store(out, Metadata(title="a case", deck="deck = 1", planned_steps=2)) as store:
        store.append(made_step(0, replace(WINDOW, n_row=60, n_col=60)))
    record = journal_of(out) / "000001.npz"
    record.write_bytes(record.read_bytes().replace(b"'<f8'", b"'<f4'", 1))
    with pytest.raises(DeckError, match=r"000001\.npz is damaged"):
        open_result(out)


def test_damage_in_a_large_record_is_named_before_a_restart(
    out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(journal, "LARGE", 0)
    written(out, planned=4)
    record = journal_of(out) / "000001.npz"
    content = bytearray(record.read_bytes())
    content[len(content) // 2] ^= 4
    record.write_bytes(content)
    with pytest.raises(DeckError, match=r"000001\.npz is damaged .*Bad CRC-32"):
        journal.read_record(record, restart=True)


def test_a_journal_without_its_header_is_refused(out: Path) -> None:
    written(out, planned=4)
    (journal_of(out) / "header.json").unlink()
    for read in (open_result, Store.reopened):
        with pytest.raises(DeckError, match=r"out\.nc\.d lacks its header, header\.json") as caught:
            read(out)
        assert not hasattr(caught.value, "__notes__")  # no record is to be deleted


@pytest.mark.parametrize("story", ["", "resumed, tolerance = 1e-07 instead of 1e-05"])
def test_values_that_no_step_has_are_refused(out: Path, story: str) -> None:
    """In a result without a seal, which another program has written again."""
    step, tolerance = made_step(0), 1e-5 if story else 1e-8
    described = Metadata(
        planned_steps=2, resumed=(story,), parameters=MATERIALS | {"algorithm": "frictionless"}
    )
    fields = dict(step.fields)
    contact = fields["zone"] > 0
    history = dict(step.history) | {
        **{"max_pressure": fields["pressure"].max(), "contact_area": contact.sum() * WINDOW.cell_area},
        **{"contact_radius": 1.0, "approach": 1.0, "sweeps": 7, "operator_applications": 7.5, "cuts": 0},
        **{"residual_normal": tolerance, "residual_tangential": tolerance, "residual_force": 0.0},
    }
    places = (f"{n}.nc" for n in range(99))

    def fault(of_fields: dict[str, object], of_history: dict[str, object]) -> str:
        changed = replace(step, fields=fields | of_fields, history=history | of_history)  # type: ignore[arg-type]
        path = out.parent / next(places)
        assemble(described, [changed]).to_netcdf(path)
        try:
            open_result(path)
        except DeckError as error:
            assert str(error).startswith(f"{path} is damaged: ")
            return str(error).removeprefix(f"{path} is damaged: ").removesuffix(" in step 1")
        return ""

    assert fault({}, {}) == ""
    for name, value in {
        **{"residual_normal": 1.0, "residual_tangential": 3 * tolerance, "residual_force": -1e-9},
        **{"max_pressure": -1.0, "cuts": -2, "seconds": -1.0, "contact_area": -1e-9, "step_limited": 7},
        **{"approach": 1e31, "sweeps": -1, "segment": 0, "segment_fraction": 1.5},
        **{"dissipated_energy": -1.0, "dissipated_energy_step": -1.0, "elastic_energy": -1.0},
        **{"operator_applications": -1.0, "contact_area_fit": 1.1 * WINDOW.size * WINDOW.cell_area},
        **{"stick_area": 1.01 * contact.sum() * WINDOW.cell_area, "stick_radius": 1.1},
    }.items():
        assert fault({}, {name: value}) == f"{name} holds numbers that no load step has"
    assert fault({}, {"cuts": 1, "residual_tangential": 0.04}) == ""  # of the parts one after the other
    assert fault({}, {"cuts": 1, "residual_normal": 0.04}) != ""
    for name, wrong in (("pressure", -1.0), ("pressure", np.nan), ("zone", 7), ("zone", -1), ("gap", np.nan)):
        values = fields[name].copy()
        values[contact] = wrong
        assert fault({name: values}, {}) == f"{name} holds numbers that no node has"
    outside = np.where(contact, fields["gap"], np.nan)
    assert fault({"gap": outside}, {}) == ""
    assert fault({"pressure": fields["pressure"] * 2}, {}) == "pressure does not fit to max_pressure"
    assert fault({"zone": 0 * fields["zone"]}, {}) == "zone does not fit to contact_area"


@pytest.fixture(scope="module")
def sheared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("sheared") / "out.nc"
    body = {"young_modulus": 210e9, "poisson_ratio": 0.3}
    loads = [{"normal_load": 31.5}, {"tangential_load_x": 2.0, "torque": 1e-5}]
    sphere = {**body, "surface": {"shape": "sphere", "radius": 1e-3}}
    Case(body_1=sphere, body_2=body, nodes_in_radius=5, friction_coefficient=0.2, loads=loads).run(str(file))
    return file


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("nothing", ""),
        ("normal_load", "normal_load is not the resultant of the tractions in step 1"),
        ("tractions", "tangential_load_x is not the resultant of the tractions in step 2"),
        ("torque", "torque is not the resultant of the tractions in step 2"),
        ("deck", "its deck is no TOML: "),
    ],
)
def test_loads_that_are_not_those_of_the_fields_are_refused(
    sheared: Path, out: Path, name: str, fault: str
) -> None:
    """In a result without a seal, which another program has written again."""
    out.write_bytes(sheared.read_bytes())
    with netCDF4.Dataset(out, "a") as file:
        if name == "nothing":
            file.remark = "another attribute"
        elif name == "tractions":
            x, y = (file[f"traction_{axis}"][:] for axis in "xy")
            file["traction_x"][:], file["traction_y"][:] = y, x
        elif name == "deck":
            file.deck = "load ="
        else:
            file[name][:] = 1.0 if name == "normal_load" else -file[name][:]
    if not fault:
        assert open_result(out).complete
        return
    with pytest.raises(DeckError, match=f"out.nc is damaged: {fault}"):
        open_result(out)


def test_every_bound_of_the_table_is_looked_at() -> None:
    lattice = replace(WINDOW, spacing=0.1)
    window = lattice.size * lattice.cell_area
    known = {"normal_load": 1.0, "approach": 1.0, "contact_radius": 0.5, "contact_area": 0.5}
    quantities = {**known, "window": window}

    def fault(name: str, value: float) -> str:
        return next(netcdf._faults_of_numbers({**known, name: value}, {"tolerance": 1.0}, lattice), "")

    found = 0
    for name, variable in VARIABLES.items():
        if variable.dims != ("step",) or variable.dtype == "str" or name in RESIDUALS.values():
            continue
        least, most = variable.least, quantities.get(str(variable.most), variable.most)
        assert isinstance(most, float)
        if variable.dtype != "f8":
            least, most = max(least, -1), max(variable.flags, default=most)
        for limit, beyond in ((least, -1.0), (most, 1.0)):
            if abs(limit) < LARGEST:
                assert fault(name, limit) == "", name
                assert name in fault(name, limit + beyond), name
                found += 1
    assert found > 60
    for energy in ("dissipated_energy", "dissipated_energy_step"):  # noise, where nodes stick
        assert fault(energy, -1e-4) == ""
        assert fault(energy, -1e-3) != ""


def test_files_of_earlier_versions_are_read_and_searched(out: Path) -> None:
    """Without a checksum, an index of chunks that is damaged shows by what it leads to."""
    written(out, every=2)
    data = out.read_bytes()
    expected = open_result(out).dataset.load()
    earlier = data[:-48]
    out.write_bytes(earlier)
    assert open_result(out).dataset.identical(expected)
    for part in (1, 24, 47):
        out.write_bytes(data[:-part])
        with pytest.raises(DeckError, match=r"out\.nc is damaged: the checksum at its end cannot be read"):
            open_result(out)
    for name, missing in (("pressure", np.nan), ("zone", -1)):
        other = out.with_name(f"{name}.nc")
        other.write_bytes(earlier)
        with netCDF4.Dataset(other, "a") as file:
            file[name][1] = missing
        with pytest.raises(DeckError, match=rf"{name}\.nc is damaged: {name} holds numbers .* in step 2"):
            open_result(other)


def test_a_record_of_another_version_is_refused(out: Path) -> None:
    written(out, 1, planned=2)
    record = journal_of(out) / "000001.npz"
    with np.load(record) as file:
        arrays = dict(file)
    text = arrays["about"].tobytes().replace(b'"journal_version": 5', b'"journal_version": 1')
    np.savez(record, **(arrays | {"about": np.frombuffer(text, "u1")}))
    with pytest.raises(DeckError, match=r"000001\.npz was kept by hexcontact .*layout 1; .* reads layout 5"):
        open_result(out)


def test_lattices_of_an_earlier_version_are_refused(out: Path) -> None:
    lattices = journal_of(out) / "lattices"
    lattices.mkdir(parents=True)
    (lattices / "trials.json").write_text('{"trials_version": 2}')
    for read in (open_result, Store.reopened):
        with pytest.raises(DeckError, match=r"trials\.json was kept by an earlier version .*; run the deck"):
            read(out)


def test_a_gap_or_a_damaged_record_in_the_journal_is_named(out: Path) -> None:
    written(out, count=3, planned=9)
    record = journal_of(out) / "000002.npz"
    kept = record.read_bytes()
    record.write_bytes(kept[: len(kept) // 2])
    with pytest.raises(DeckError, match=r"000002\.npz is damaged"):
        open_result(out)
    record.unlink()
    with pytest.raises(DeckError, match=r"lacks the record of step 2, 000002\.npz"):
        open_result(out)
    with Store(out, Metadata(planned_steps=1), overwrite=True):  # nothing stands in the way of a new run
        pass
