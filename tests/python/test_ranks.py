"""Runs that a launcher of MPI starts as several processes."""

import contextlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import netCDF4
import numpy as np
import pytest
from commands import DECK, ENVIRONMENT, PATIENCE, inside, wait_for

from hexcontact import Case
from hexcontact.core import flat
from hexcontact.result.journal import journal_of

PRESSED = DECK.replace("[friction]\ncoefficient = 0.2\n", "").replace(
    "nodes_in_radius = 4", "nodes_in_radius = 20\nwindow = [261, 300]"
)
WAVES = (
    PRESSED.partition("surface")[0].strip()
    + """
[body.1.surface]
shape = "formula"
expression = "1e-6*(2 - cos(2*pi*x/1e-3)*cos(2*pi*y/1e-3) - 0.5*sin(2*pi*(3*x/1e-3 + y/1e-3)))"
[body.2]
rigid = true
[grid]
boundary = "periodic"
extent = ["1 mm", "1 mm"]
nodes_across = 260
[[load]]
mean_pressure = "200 MPa"
steps = 2
[[load]]
mean_gap = "0.2 um"
"""
)
ODD_WAVES = WAVES.replace("y/1e-3", "y/1.004e-3").replace("x/1e-3", "x/1.056e-3")  # 251 rows
ODD_WAVES = ODD_WAVES.replace(
    '["1 mm", "1 mm"]\nnodes_across = 260', '["1.056 mm", "1.004 mm"]\nspacing = "4 um"'
)
REFINED = PRESSED.replace("nodes_in_radius = 20\nwindow = [261, 300]", "nodes_in_radius = 52") + (
    "\n[accuracy]\ntarget = 0.05\nmax_nodes = 100_000\n"
)
# The last nodes bear more than a cell; on a chamfer they can touch, and its corner is an end.
ROLLER = """
[body.1]
young_modulus = "210 GPa"
poisson_ratio = 0.3
[body.1.surface]
shape = "roller"
radius = "5 mm"
length = "2 mm"
angle = "90 deg"
profile = "logarithmic"
design_load = "14.5 N"
[body.2]
rigid = true
[grid]
spacing = "2.01 um"
cell_ratio = 2
cell_angle = "90 deg"
window = [515, 150]
[[load]]
normal_load = "10 N"
[[load]]
normal_load = "20 N"
"""
COATED = (
    PRESSED
    + """
[[body.1.coating]]
thickness = "5 um"
young_modulus = "300 GPa"
poisson_ratio = 0.25
"""
)
CHAMFER = ROLLER.replace('"logarithmic"\ndesign_load = "14.5 N"', '"chamfer"\nchamfer = "0.2 mm"')
with_mpi = pytest.mark.skipif("MPI: yes" not in flat.BUILT, reason="this build has no MPI")


@pytest.mark.parametrize(
    ("variable", "launcher"),
    [("OMPI_COMM_WORLD_SIZE", "mpirun"), ("PMI_SIZE", "mpirun"), ("SLURM_STEP_NUM_TASKS", "srun")],
)
@pytest.mark.parametrize("words", [("run", "sphere.toml"), ("resume", "sphere.nc"), ("study", "sphere.toml")])
def test_copies_are_refused(
    words: tuple[str, ...], variable: str, launcher: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sphere.toml").write_text(DECK)
    monkeypatch.setenv(variable, "3")
    refused = inside(tmp_path, *words)
    assert refused.returncode == 2
    assert f"{launcher} started 3 processes; expected one" in " ".join(refused.stderr.split())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["sphere.toml"]


@pytest.mark.parametrize(
    "words", [("check", "sphere.toml"), ("study", "study.toml", "--plan"), ("--version",)]
)
def test_other_commands_run_once(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sphere.toml").write_text(DECK)
    (tmp_path / "study.toml").write_text(
        'deck = "sphere.toml"\n[[parameter]]\nkey = "friction.coefficient"\nvalues = [0.1, 0.2]\n'
    )
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "2")
    for rank, prints in (("0", True), ("1", False)):
        monkeypatch.setenv("OMPI_COMM_WORLD_RANK", rank)
        copy = inside(tmp_path, *words)
        assert (copy.returncode, bool(copy.stdout)) == (0, prints)


def test_python_solves_alone_in_each_process_into_files_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sphere.toml").write_text(DECK)
    case = Case.from_toml(tmp_path / "sphere.toml")
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "2")
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "1")
    assert len(case.run(tmp_path / "own.nc")) == 2
    code = "import hexcontact; hexcontact.Case.from_toml('sphere.toml').run('own.nc', overwrite=True)"
    with case.start(tmp_path / "own.nc", overwrite=True):
        copy = subprocess.run(
            [sys.executable, "-c", code],
            cwd=tmp_path,
            env=ENVIRONMENT | {"OMPI_COMM_WORLD_SIZE": "2"},
            text=True,
            capture_output=True,
        )
    assert "mpirun started 2 processes, and each solves alone: name an output for each" in copy.stderr


@pytest.mark.parametrize("variable", ["OMPI_COMM_WORLD_SIZE", "SLURM_STEP_NUM_TASKS"])
def test_one_process_of_a_launcher_runs(
    variable: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sphere.toml").write_text(DECK)
    monkeypatch.setenv(variable, "1")
    monkeypatch.setenv("SLURM_NTASKS", "4")  # as in a script of sbatch
    assert inside(tmp_path, "run", "sphere.toml", "--quiet").returncode == 0


def launched(
    folder: Path,
    ranks: int,
    *words: str,
    program: tuple[str, ...] = ("-m", "hexcontact"),
    path: Path | None = None,
) -> subprocess.Popen[str]:
    """Start the command, or another program, in several processes, which look for modules in a path first."""
    launcher = "mpirun.mpich" if "mpich" in os.environ.get("FC", "") else "mpirun.openmpi"
    environment = ENVIRONMENT | {
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_rmaps_base_oversubscribe": "1",
        "OMPI_MCA_hwloc_base_binding_policy": "none",
        "OMPI_MCA_mpi_yield_when_idle": "1",
    }
    if path is not None:
        environment["PYTHONPATH"] = os.pathsep.join([str(path), environment.get("PYTHONPATH", "")])
    command = [launcher, "-n", str(ranks), sys.executable, *program, *words]
    return subprocess.Popen(
        command, cwd=folder, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


@with_mpi
@pytest.mark.parametrize(
    ("ranks", "deck"),
    [
        (2, PRESSED),
        (3, PRESSED),
        (2, WAVES),
        (3, ODD_WAVES),
        (2, REFINED),
        (3, ROLLER),
        (2, CHAMFER),
        (3, COATED),
    ],
)
def test_several_processes_write_the_file_of_one(ranks: int, deck: str, tmp_path: Path) -> None:
    assert_same(*run_twice(ranks, deck, tmp_path))


def run_twice(ranks: int, deck: str, tmp_path: Path) -> tuple[Path, Path]:
    """Run a deck in one process and in several."""
    (tmp_path / "sphere.toml").write_text(deck)
    assert inside(tmp_path, "run", "sphere.toml", "--quiet", "--output", "one.nc").returncode == 0
    process = launched(tmp_path, ranks, "run", "sphere.toml", "--output", "all.nc")
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, out + err
    assert out.count("written: all.nc") == 1
    return tmp_path / "one.nc", tmp_path / "all.nc"


def assert_same(first: Path, second: Path) -> None:
    """Compare all values of two results."""
    with netCDF4.Dataset(first) as one, netCDF4.Dataset(second) as several:
        assert set(one.variables) == set(several.variables)
        for name in set(one.variables) - {"seconds"}:
            np.testing.assert_array_equal(one[name][:], several[name][:], err_msg=name)


SHEARED = DECK.replace("nodes_in_radius = 4", "nodes_in_radius = 20\nwindow = [261, 300]") + (
    '[[load]]\ntangential_load_x = "2 N"\nsteps = 2\n[solver]\ntolerance = 1e-12\n'
)
ALIKE = SHEARED.replace('"72 GPa"', '"432 GPa"')
ENTERED = SHEARED + 'entry = "interpolated"\n'
LARGE = SHEARED.replace("in_radius = 20", "in_radius = 95")  # no smaller window is solved first
TWISTED = LARGE.replace("steps = 2\n[solver]", 'torque = "5e-6 N m"\n[solver]')
ADAPTIVE = SHEARED.replace("steps = 2\n[[load]]", "[[load]]").replace("steps = 2", 'steps = "auto"') + (
    "step_tolerance = 0.3\n"
)
VARYING = LARGE.replace("coefficient = 0.2", 'coefficient = "0.2 + 0.1*tanh(x/20e-6)"')
DIRECTED = LARGE.replace("coefficient = 0.2", 'coefficient = { along = 0.2, across = 0.3, angle = "30 deg" }')
ROLLING = LARGE.partition("[[load]]\ntangential")[0] + (
    '[[load]]\nrolling = "steady"\ncreepage_x = -1e-3\n[solver]\ntolerance = 1e-10\n'
)
SHEARED_WAVES = (
    WAVES.partition("[[load]]")[0]
    + """
[friction]
coefficient = 0.3
[[load]]
mean_pressure = "200 MPa"
[[load]]
mean_traction_x = "20 MPa"
[solver]
tolerance = 1e-12
"""
)
# All touches, and no traction in stick takes up a shift.
SHIFTED_WAVES = (
    SHEARED_WAVES.replace("200 MPa", "6 GPa").replace("mean_traction_x", "shift_x").replace("20 MPa", "20 nm")
)
# The sphere ends within the window.
ENDING = (
    '[{ shape = "sphere", radius = "1 mm" }, { shape = "punch", radius = "20 um", offset = ["8 um", 0] }]'
)
WORN = """
[[load]]
label = "fretting"
path = [{ tangential_load_x = "-2 N" }, { tangential_load_x = "2 N" }]
[wear]
coefficient_1 = "1e-14 m^2/N"
cycle = "fretting"
cycles = 1_000
"""


@with_mpi
@pytest.mark.parametrize(
    ("ranks", "deck"),
    [
        (3, TWISTED),
        (3, ALIKE),
        (2, SHEARED.replace("steps = 2", "") + WORN),
        (3, ADAPTIVE),
        (2, SHEARED_WAVES),
        (2, SHIFTED_WAVES),
        (2, SHEARED.replace('{ shape = "sphere", radius = "1 mm" }', ENDING)),
        (2, VARYING),
        (3, DIRECTED),
        (2, ROLLING),
    ],
    ids=[
        "twisted",
        "alike",
        "worn",
        "adaptive",
        "waves",
        "shifted",
        "ends",
        "varying",
        "directed",
        "rolling",
    ],
)
def test_friction_in_several_processes(ranks: int, deck: str, tmp_path: Path) -> None:
    test_several_processes_write_the_file_of_one(ranks, deck, tmp_path)


@with_mpi
def test_fronts_are_relaxed_by_rows(tmp_path: Path) -> None:
    assert_near(*run_twice(3, ALIKE.replace("in_radius = 20", "in_radius = 95"), tmp_path))


def assert_near(first: Path, second: Path) -> None:
    """Compare two results in which each rank has relaxed the fronts on its rows."""
    with netCDF4.Dataset(first) as one, netCDF4.Dataset(second) as several:
        np.testing.assert_array_equal(one["zone"][:], several["zone"][:])
        p_max = one["pressure"][:].max()
        for name in ("pressure", "traction_x", "traction_y"):
            np.testing.assert_allclose(several[name][:] / p_max, one[name][:] / p_max, rtol=0.0, atol=1e-10)
        for name in ("approach", "shift_x", "stick_area", "dissipated_energy"):
            np.testing.assert_allclose(several[name][:], one[name][:], rtol=1e-9, atol=0.0)


# On a window beside the contact, which grows in the first step.
GROWING = """
import dataclasses, sys
from hexcontact import Case
from hexcontact.core import ranks

with ranks.together() as first:
    if first:
        case = Case.from_toml("sphere.toml")
        case.lattice = dataclasses.replace(case.lattice, row_first=-219, n_row=220, col_first=-150, n_col=300)
        case.run(sys.argv[1])
"""


@with_mpi
@pytest.mark.parametrize("deck", [PRESSED, ADAPTIVE], ids=["pressed", "adaptive"])
def test_a_window_grows_as_in_one_process(deck: str, tmp_path: Path) -> None:
    (tmp_path / "sphere.toml").write_text(deck.replace("window = [261, 300]", ""))
    (tmp_path / "growing.py").write_text(GROWING)
    alone = subprocess.run(
        [sys.executable, "growing.py", "one.nc"], cwd=tmp_path, env=ENVIRONMENT, check=False
    )
    assert alone.returncode == 0
    process = launched(tmp_path, 2, "all.nc", program=("growing.py",))
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, out + err
    assert_same(tmp_path / "one.nc", tmp_path / "all.nc")
    with netCDF4.Dataset(tmp_path / "all.nc") as result:
        assert result["pressure"].shape[1] > 220


@with_mpi
@pytest.mark.parametrize(("again", "deck"), [(1, PRESSED), (4, PRESSED), (2, SHEARED)])
def test_a_run_whose_process_is_killed_resumes_with_another_number(
    again: int, deck: str, tmp_path: Path
) -> None:
    (tmp_path / "sphere.toml").write_text(deck.replace("steps = 2", "steps = 12"))
    assert inside(tmp_path, "run", "sphere.toml", "--quiet", "--output", "one.nc").returncode == 0
    process = launched(tmp_path, 3, "run", "sphere.toml", "--quiet")
    journal = journal_of(tmp_path / "sphere.nc")
    wait_for(lambda: journal.is_dir() and len(list(journal.iterdir())) > 3)
    started = wait_for(lambda: ranks_of(process.pid, 3))
    os.kill(started[-1], signal.SIGKILL)
    process.communicate(timeout=PATIENCE)
    assert process.returncode != 0
    wait_for(lambda: not any(map(runs, started)))
    done = inside(tmp_path, "info", str(journal))
    assert done.returncode == 0, done.stderr
    process = launched(tmp_path, again, "resume", "sphere.nc")
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, out + err
    assert_same(tmp_path / "one.nc", tmp_path / "sphere.nc")


@with_mpi
@pytest.mark.parametrize(
    ("number", "to", "deck"),
    [
        (signal.SIGTERM, (0, 1), PRESSED),  # as a batch system sends it
        (signal.SIGUSR1, (0, 1), PRESSED),
        (signal.SIGTERM, (1,), PRESSED),
        (signal.SIGTERM, (1,), DECK),  # a window that is not shared
    ],
)
def test_a_signal_ends_all_and_says_how_to_resume(
    number: signal.Signals, to: tuple[int, ...], deck: str, tmp_path: Path
) -> None:
    (tmp_path / "sphere.toml").write_text(deck.replace("steps = 2", "steps = 4000"))
    process = launched(tmp_path, 2, "run", "sphere.toml", "--quiet")
    journal = journal_of(tmp_path / "sphere.nc")
    wait_for(lambda: journal.is_dir() and len(list(journal.iterdir())) > 3)
    started = wait_for(lambda: ranks_of(process.pid, 2))
    for pid in started:
        words = Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
        if any(
            b"%s=%d" % (name, rank) in words for name in (b"OMPI_COMM_WORLD_RANK", b"PMI_RANK") for rank in to
        ):
            os.kill(pid, number)
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 128 + number
    assert "hexcontact resume" in err
    wait_for(lambda: not any(map(runs, started)))


@with_mpi
def test_a_gap_that_fails_on_another_rank_names_it(tmp_path: Path) -> None:
    (tmp_path / "sphere.toml").write_text(PRESSED)
    (tmp_path / "sitecustomize.py").write_text(FAILING)
    process = launched(tmp_path, 3, "run", "sphere.toml", path=tmp_path)
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 4, out + err
    assert "rank 2: no memory for the gap" in err


# The last of three ranks has no memory for its rows of the gap.
FAILING = """
from hexcontact.core import ranks
from hexcontact.problem.plane_field import PlaneField
over = PlaneField.over
def failing(self, lattice):
    if ranks.rank == 2:
        raise MemoryError("no memory for the gap")
    return over(self, lattice)
PlaneField.over = failing
"""


@with_mpi
def test_a_folder_of_kernels_that_others_may_write_is_named_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "kernels").mkdir()
    (tmp_path / "kernels").chmod(0o777)
    (tmp_path / "sphere.toml").write_text(SHEARED)
    monkeypatch.setitem(ENVIRONMENT, "HEXCONTACT_KERNEL_FOLDER", str(tmp_path / "kernels"))
    process = launched(tmp_path, 2, "run", "sphere.toml")
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, out + err
    assert err.count("other users may write to it") == 1


@with_mpi
def test_a_step_that_does_not_converge_ends_as_in_one_process(tmp_path: Path) -> None:
    (tmp_path / "sphere.toml").write_text(PRESSED)
    (tmp_path / "sitecustomize.py").write_text(FEW)
    said = []
    for ranks in (1, 2):
        process = launched(tmp_path, ranks, "run", "sphere.toml", "--overwrite", path=tmp_path)
        out, err = process.communicate(timeout=PATIENCE)
        assert process.returncode == 3, out + err
        said.append([line for line in err.splitlines() if line.startswith("hexcontact: ")])
    assert said[0] == said[1]
    assert "worst is R_n" in said[0][1]
    assert "1 of 2 load steps are finished" in said[0][-1]


# The second load step ends after one iteration on each lattice.
FEW = """
from hexcontact.core import flat
press = flat.press
flat.press = lambda *given: press(*given[:-1], given[-1] if given[2] < 15.0 else 1)
"""


@with_mpi
def test_a_full_disk_between_two_ranks_ends_all(tmp_path: Path) -> None:
    (tmp_path / "sphere.toml").write_text(PRESSED)
    (tmp_path / "sitecustomize.py").write_text(FULL)
    process = launched(tmp_path, 3, "run", "sphere.toml", path=tmp_path)
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 4, out + err
    assert "cannot write step 1" in err


# The disk is full after the rows of the first rank.
FULL = """
import errno, os
from hexcontact.core import ranks
ask = ranks.ask
def asked(rank, *arguments, **named):
    if rank == 1:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    return ask(rank, *arguments, **named)
ranks.ask = asked
"""


@with_mpi
@pytest.mark.parametrize("deck", [PRESSED, SHEARED, ENTERED], ids=["pressed", "sheared", "entered"])
def test_fields_of_bodies_are_those_of_one_process(deck: str, tmp_path: Path) -> None:
    fields = '[output]\nfields = ["pressure", "displacement_1_z", "displacement_2_y"]\n'
    (tmp_path / "sphere.toml").write_text(deck + fields)
    assert inside(tmp_path, "run", "sphere.toml", "--quiet", "--output", "one.nc").returncode == 0
    process = launched(tmp_path, 2, "run", "sphere.toml", "--output", "all.nc")
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, out + err
    assert_same(tmp_path / "one.nc", tmp_path / "all.nc")


@with_mpi
def test_more_ranks_than_rows_leave_the_work_to_the_first(tmp_path: Path) -> None:
    (tmp_path / "sphere.toml").write_text(PRESSED.replace("[261, 300]", "[7, 9]").replace("= 20", "= 2"))
    process = launched(tmp_path, 5, "run", "sphere.toml", "--output", "all.nc")
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, out + err


def ranks_of(launcher: int, count: int) -> list[int]:
    """Return the processes of Python below a launcher, once they are so many."""
    children: dict[int, list[int]] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            fields = stat.read_text().rpartition(")")[2].split()
            children.setdefault(int(fields[1]), []).append(int(stat.parent.name))
    found, below = [], [launcher]
    while below:
        below += children.get(pid := below.pop(), [])
        with contextlib.suppress(OSError):
            if "python" in os.readlink(f"/proc/{pid}/exe"):
                found.append(pid)
    return sorted(found) if len(found) == count else []


def runs(pid: int) -> bool:
    """Test whether a process has not ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
