"""Results for other programs: VTK files read back by meshio, UGRID meshes against the rules, tables."""

import base64
import csv
import re
import xml.etree.ElementTree as ET
import zlib
from pathlib import Path

import meshio
import netCDF4
import numpy as np
import pandas as pd
import pytest
import xarray
from typer.testing import CliRunner

from hexcontact import Case, open_result
from hexcontact.cli.app import app
from hexcontact.result.journal import journal_of
from hexcontact.result.netcdf import triangles
from hexcontact.result.step import Step, with_shown

BODY = {"young_modulus": 210e9, "poisson_ratio": 0.3}
SPHERES = {"body_1": BODY | {"surface": {"shape": "sphere", "radius": 0.01}}, "body_2": BODY}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Spheres pressed and sheared, fields of every second step kept; and pressed without friction."""
    folder = tmp_path_factory.mktemp("results")
    loads = [{"normal_load": 100.0, "steps": 2}, {"tangential_load_x": 30.0, "steps": 3}]
    Case(
        **SPHERES, nodes_in_radius=6, friction_coefficient=0.5, algorithm="incremental", loads=loads,
        every=2, title="Sheared <& -- twice>",
    ).run(folder / "sheared.nc")  # fmt: skip
    Case(**SPHERES, nodes_in_radius=5, normal_load=100.0).run(folder / "pressed.nc")
    return folder


def export(*words: str | Path) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, ["export", *map(str, words)])
    return done.exit_code, done.stdout, done.stderr


def test_triangles_are_equilateral_and_counterclockwise(folder: Path) -> None:
    with open_result(folder / "sheared.nc").dataset as data:
        points = np.stack([data.x.values.ravel(), data.y.values.ravel()], axis=1)
        spacing = data.attrs["lattice_spacing"]
        a, b, c = (points[corner] for corner in triangles(*data.x.shape).T)
    for side in (b - a, c - b, a - c):
        np.testing.assert_allclose(np.linalg.norm(side, axis=1), spacing, rtol=1e-9)
    twice_area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    np.testing.assert_allclose(twice_area, np.sqrt(0.75) * spacing**2, rtol=1e-9)


def test_triangles_of_the_smallest_window() -> None:
    assert triangles(2, 2).tolist() == [[0, 1, 2], [1, 3, 2]]
    assert triangles(1, 5).shape == (0, 3)


# --- VTK ------------------------------------------------------------------------------------------


def test_series_lists_the_steps_that_were_kept(folder: Path, tmp_path: Path) -> None:
    code, out, _ = export(folder / "sheared.nc", "--vtk", "-o", tmp_path / "vtk")
    assert (code, out.split()) == (0, ["written:", str(tmp_path / "vtk/sheared.pvd")])
    sets = ET.parse(tmp_path / "vtk/sheared.pvd").getroot().findall("Collection/DataSet")
    assert [(s.get("timestep"), s.get("file")) for s in sets] == [
        (str(n), f"sheared_{n:04d}.vtu") for n in (2, 4, 5)
    ]
    assert all((tmp_path / "vtk" / str(s.get("file"))).is_file() for s in sets)


def test_vtk_file_holds_the_step(folder: Path, tmp_path: Path) -> None:
    assert export(folder / "sheared.nc", "--vtk", "-s", "4", "-o", tmp_path)[0] == 0
    read, result = meshio.read(tmp_path / "sheared_0004.vtu"), open_result(folder / "sheared.nc")
    data = with_shown(result.step(4), result.lattice)
    np.testing.assert_array_equal(read.points[:, 0], data.x.values.ravel())
    np.testing.assert_array_equal(read.points[:, 1], data.y.values.ravel())
    np.testing.assert_array_equal(read.cells_dict["triangle"], triangles(*data.x.shape))
    for name in ("pressure", "gap", "zone", "accumulated_slip", "initial_gap"):
        np.testing.assert_array_equal(read.point_data[name], data[name].values.ravel())
        assert read.point_data[name].dtype == data[name].dtype
    for name in ("traction", "relative_displacement", "slip_increment"):
        for k, axis in enumerate("xy"):
            np.testing.assert_array_equal(read.point_data[name][:, k], data[f"{name}_{axis}"].values.ravel())
        assert not read.point_data[name][:, 2].any()
    assert read.field_data["tangential_load_x"] == pytest.approx(20.0)


def test_arrays_are_packed_as_vtk_defines_it(folder: Path, tmp_path: Path) -> None:
    assert export(folder / "pressed.nc", "--vtk", "-o", tmp_path)[0] == 0
    root = ET.parse(tmp_path / "pressed_0001.vtu").getroot()
    assert {"header_type": "UInt64", "compressor": "vtkZLibDataCompressor"}.items() <= root.attrib.items()
    arrays = {array.get("Name"): array for array in root.iter("DataArray")}
    for name, width in (("pressure", 8), ("zone", 1), ("connectivity", 4)):
        text = (arrays[name].text or "").strip()
        header = np.frombuffer(base64.b64decode(text[:44]), "<u8")  # 32 bytes are 44 characters
        packed = base64.b64decode(text[44:])
        raw = zlib.decompress(packed)
        assert header.tolist() == [1, len(raw), 0, len(packed)]
        nodes = open_result(folder / "pressed.nc").lattice
        count = 6 * (nodes.n_row - 1) * (nodes.n_col - 1) if name == "connectivity" else nodes.size
        assert len(raw) == width * count


def test_vtk_files_say_units(folder: Path, tmp_path: Path) -> None:
    assert export(folder / "sheared.nc", "--vtk", "-s", "-1", "-o", tmp_path)[0] == 0
    root = ET.parse(tmp_path / "sheared_0005.vtu").getroot()
    units = {
        array.get("Name"): key.text
        for array in root.iter("DataArray")
        if (key := array.find("InformationKey[@name='UNITS_LABEL'][@location='vtkDataArray']")) is not None
    }
    assert {
        "Points": "m",
        "pressure": "Pa",
        "traction": "Pa",
        "gap": "m",
        "torque": "N m",
    }.items() <= units.items()
    assert "zone" not in units


def test_vtk_of_a_journal_and_without_friction(folder: Path, tmp_path: Path) -> None:
    def stop(step: Step) -> None:
        if step.number == 2:
            raise KeyboardInterrupt

    case = Case(**SPHERES, nodes_in_radius=5, loads=[{"normal_load": 100.0, "steps": 3}])
    with pytest.raises(KeyboardInterrupt):
        case.run(tmp_path / "part.nc", on_step=stop)
    assert journal_of(tmp_path / "part.nc").is_dir() and not (tmp_path / "part.nc").exists()
    assert export(tmp_path / "part.nc", "--vtk")[0] == 0
    assert len(list((tmp_path / "part_export").glob("*.vtu"))) == 2
    assert export(folder / "pressed.nc", "--vtk", "-o", tmp_path)[0] == 0
    assert "pressure" in meshio.read(tmp_path / "pressed_0001.vtu").point_data


# --- UGRID ----------------------------------------------------------------------------------------


def check_ugrid(path: Path) -> None:
    """Check a file against the rules of UGRID-1.0 for a mesh of triangles, and those its data follow."""
    with netCDF4.Dataset(path) as file:
        assert "UGRID-1.0" in file.Conventions.split()
        (name,) = [n for n, v in file.variables.items() if getattr(v, "cf_role", "") == "mesh_topology"]
        mesh = file[name]
        assert mesh.topology_dimension == 2 and np.issubdtype(type(mesh.topology_dimension), np.integer)
        nodes = [file[part] for part in mesh.node_coordinates.split()]
        (dimension,) = {d for node in nodes for d in node.dimensions}
        assert [node.standard_name for node in nodes] == [
            "projection_x_coordinate",
            "projection_y_coordinate",
        ]
        assert all(node.units == "m" and np.isfinite(node[:]).all() for node in nodes)
        faces = file[mesh.face_node_connectivity]
        assert faces.cf_role == "face_node_connectivity" and faces.dimensions[0] == mesh.face_dimension
        assert faces.dtype.kind == "i" and faces.shape[1] == 3 and faces.start_index in (0, 1)
        numbers = np.asarray(faces[:]) - faces.start_index
        assert numbers.min() == 0 and numbers.max() == len(file.dimensions[dimension]) - 1
        x, y = (np.asarray(node[:])[numbers] for node in nodes)
        area = (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (y[:, 1] - y[:, 0]) * (x[:, 2] - x[:, 0])
        assert (area > 0).all()  # counterclockwise
        for variable in file.variables.values():
            if dimension in variable.dimensions and variable not in nodes:
                assert (variable.mesh, variable.location) == (name, "node")
                assert variable.dimensions[-1] == dimension


def test_results_carry_a_mesh_of_their_lattice(folder: Path) -> None:
    for name in ("sheared.nc", "pressed.nc"):
        check_ugrid(folder / name)
        with xarray.open_dataset(folder / name) as data:
            np.testing.assert_array_equal(data.mesh_node_x, data.x.values.ravel())
            np.testing.assert_array_equal(data.mesh_node_y, data.y.values.ravel())
            np.testing.assert_array_equal(data.mesh_face_nodes, triangles(*data.x.shape))


def test_a_result_in_memory_has_no_second_set_of_coordinates(folder: Path) -> None:
    assert not [n for n in open_result(folder / "sheared.nc").dataset.variables if "mesh" in str(n)]


def test_a_window_without_triangles_has_no_mesh(tmp_path: Path) -> None:
    from hexcontact.core.lattice import Lattice
    from hexcontact.result.netcdf import write_mesh

    with netCDF4.Dataset(tmp_path / "row.nc", "w") as file:
        write_mesh(file, Lattice(1e-6, 0, 0, 1, 5))
        assert not file.variables


def test_fields_on_a_mesh(folder: Path, tmp_path: Path) -> None:
    assert export(folder / "sheared.nc", "--ugrid", "-o", tmp_path)[0] == 0
    check_ugrid(tmp_path / "sheared_ugrid.nc")
    own = open_result(folder / "sheared.nc")
    with xarray.open_dataset(tmp_path / "sheared_ugrid.nc") as data:
        assert data.step.values.tolist() == [2, 4, 5]
        shown = with_shown(own.step(4), own.lattice)
        for name in ("pressure", "zone", "traction_x"):
            np.testing.assert_array_equal(data[name].sel(step=4), shown[name].values.ravel())
        assert data.initial_gap.dims == ("mesh_node",)


# --- CSV ------------------------------------------------------------------------------------------


def test_history_and_fields_as_tables(folder: Path, tmp_path: Path) -> None:
    code, out, _ = export(folder / "sheared.nc", "--csv", "-s", "4", "--source", "nodes", "-o", tmp_path)
    assert code == 0 and len(out.splitlines()) == 2
    own = open_result(folder / "sheared.nc")
    history = pd.read_csv(tmp_path / "sheared_history.csv", index_col="step", float_precision="round_trip")
    np.testing.assert_array_equal(history["approach [m]"], own.approach)
    with (tmp_path / "sheared_0004.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == own.lattice.size
    assert [float(row["pressure [Pa]"]) for row in rows] == own.step(4).pressure.values.ravel().tolist()


# --- refusals -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ((), "expected --vtk, --ugrid, --csv or --histories"),
        (("--vtk", "-s", "9"), "there is no step 9"),
        (("--vtk", "-s", "2,3"), "step 3 were not kept"),
        (("--vtk", "-s", "x"), "--step x"),
    ],
)
def test_what_cannot_be_exported_is_said(folder: Path, words: tuple[str, ...], sentence: str) -> None:
    before = sorted(folder.iterdir())
    code, _, err = export(folder / "sheared.nc", *words)
    assert code == 2 and sentence in err and len(err.splitlines()) == 1
    assert sorted(folder.iterdir()) == before


def test_a_file_in_the_way_of_the_folder_stays(folder: Path) -> None:
    content = (folder / "pressed.nc").read_bytes()
    code, _, err = export(folder / "sheared.nc", "--vtk", "-o", folder / "pressed.nc")
    assert code == 2 and re.search(r"pressed\.nc is a file", err)
    assert (folder / "pressed.nc").read_bytes() == content


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (("--csv",), "sheared_history.csv"),
        (("--csv", "-s", "4"), "sheared_0004.csv"),
        (("--vtk",), "sheared.pvd"),
        (("--vtk",), "sheared_0005.vtu"),
        (("--ugrid",), "sheared_ugrid.nc"),
    ],
)
@pytest.mark.parametrize("of", ["text", "netcdf"])
def test_files_of_others_are_not_replaced(
    folder: Path, tmp_path: Path, words: tuple[str, ...], name: str, of: str
) -> None:
    target = tmp_path / name
    if of == "text":
        target.write_text("step,mine\n")
    else:
        xarray.Dataset({"a": ("x", [1.0])}).to_netcdf(target)
    content = target.read_bytes()
    code, out, err = export(folder / "sheared.nc", *words, "-o", tmp_path)
    assert (code, out) == (2, "")
    assert f"{name} exists and was not made by hexcontact; delete it or choose another name" in err
    assert target.read_bytes() == content
    assert [path.name for path in tmp_path.iterdir()] == [name]
    target.write_text("")
    for _ in range(2):  # an empty file, and that of the first export
        assert export(folder / "sheared.nc", *words, "-o", tmp_path)[0] == 0
