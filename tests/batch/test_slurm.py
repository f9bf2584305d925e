"""The job scripts of cases/cluster on a Slurm of one node: the results are those of runs without Slurm."""

import importlib.util
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import xarray
from batch.slurm_node import Absent, SlurmNode
from commands import ENVIRONMENT, wait_for

ROOT = Path(__file__).parents[2]
CASES = ROOT / "cases"
MPIS = {"openmpi": "pmix", "mpich": "pmi2"}  # with what srun starts them
FINE, COARSE = "nodes_in_radius = 40", "nodes_in_radius = 8"


@pytest.fixture(scope="module")
def slurm() -> Iterator[SlurmNode]:
    try:
        node = SlurmNode()
        scripts = str(Path(sys.executable).parent)
        node.environment["PATH"] = os.pathsep.join([scripts, node.environment["PATH"]])
        with node:
            yield node
    except Absent as reason:
        pytest.skip(f"Slurm cannot run here: {reason}")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of the scripts and of the decks, on coarse lattices."""
    shutil.copytree(CASES / "cluster", tmp_path / "cluster")
    deck = (CASES / "cattaneo_mindlin.toml").read_text()
    assert FINE in deck
    (tmp_path / "cattaneo_mindlin.toml").write_text(deck.replace(FINE, COARSE))
    return tmp_path / "cluster"


def with_mpi(slurm: SlurmNode, mpi: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let jobs use a build with MPI."""
    if not (site := ROOT / "build" / f"{mpi}-site").is_dir():
        pytest.skip(f"no build with {mpi}, which make mpi-check-{mpi} makes")
    monkeypatch.setitem(slurm.environment, "PYTHONPATH", str(site))
    monkeypatch.setitem(slurm.environment, "SLURM_MPI_TYPE", MPIS[mpi])


def directly(folder: Path, *words: str) -> None:
    """Run the command in a process of this test."""
    done = subprocess.run(
        [sys.executable, "-m", "hexcontact", *words],
        cwd=folder,
        env=ENVIRONMENT,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr


def same(one: Path, other: Path) -> bool:
    """Test whether two results have the same values, but for the times they took."""
    with xarray.open_dataset(one) as a, xarray.open_dataset(other) as b:
        return a.drop_vars("seconds").equals(b.drop_vars("seconds"))


def requested(cores: int = 1) -> list[str]:
    """Return options that override those of a script."""
    return [f"--cpus-per-task={cores}", "--mem=500"]


@pytest.mark.parametrize("script", ["run.sh", "scratch.sh"])
def test_a_requeued_run_resumes_to_the_bit(slurm: SlurmNode, folder: Path, script: str) -> None:
    """The signal comes after the third of 37 steps."""
    deck = folder.parent / "cattaneo_mindlin.toml"
    deck.write_text(deck.read_text().replace(COARSE, "nodes_in_radius = 30"))
    scratch = folder / "scratch"
    scratch.mkdir()
    slurm.environment["TMPDIR"] = str(scratch)
    job = slurm.submit(*requested(), script, deck, cwd=folder)
    wait_for(lambda: [*folder.rglob("cattaneo_mindlin.nc.d/000003.npz")])
    assert [*scratch.iterdir()] == [*scratch.glob("hexcontact.*")] * (script == "scratch.sh")
    slurm.command("scancel", "--signal=USR1", job)
    slurm.wait(jobs=job)
    log = next(folder.glob(f"*-{job}.log")).read_text()
    assert 'stopped reason="interrupted (SIGUSR1)"' in log and "resumed title=" in log, log
    assert slurm.job(job)["JobState"] == "COMPLETED", log
    assert slurm.job(job)["Restarts"] == "1"
    assert not [*scratch.iterdir()] and not [*folder.glob("*.nc.*")]
    directly(folder, "run", str(deck), "--output", "whole.nc")
    assert same(folder / "cattaneo_mindlin.nc", folder / "whole.nc")


@pytest.mark.parametrize("mpi", ["", "openmpi"])  # srun gives 137, not 138, where MPICH ends all ranks
def test_the_signal_comes_before_the_time_limit(
    slurm: SlurmNode, folder: Path, mpi: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    script, ranks = "run.sh", 1
    if mpi:
        script, ranks = "mpi.sh", 2
        with_mpi(slurm, mpi, monkeypatch)
    deck = folder.parent / "cattaneo_mindlin.toml"
    deck.write_text(deck.read_text().replace("steps = 27", "steps = 90000"))  # more than a minute's
    limit = ["--time=1", "--signal=USR1@58"]
    limit += ["--nodes=1", f"--ntasks-per-node={ranks}"]
    job = slurm.submit(*requested(), *limit, script, deck, cwd=folder)
    wait_for(lambda: slurm.job(job).get("Restarts") == "1")
    slurm.command("scancel", job)
    slurm.wait(jobs=job)
    log = next(folder.glob(f"*-{job}.log")).read_text()
    # it may come before Python handles signals
    assert 'stopped reason="interrupted (SIGUSR1)"' in log or "User defined signal 1" in log, log


def test_a_job_whose_input_is_wrong_is_not_requeued(slurm: SlurmNode, folder: Path) -> None:
    job = slurm.submit(*requested(), "run.sh", "no.toml", cwd=folder)
    slurm.wait(jobs=job)
    entries = slurm.job(job)
    assert (entries["JobState"], entries["ExitCode"], entries["Restarts"]) == ("FAILED", "2:0", "0")


def test_a_run_has_the_cores_of_its_job(slurm: SlurmNode, folder: Path) -> None:
    if slurm.cores < 2:
        pytest.skip("one core")
    (folder / "bin").mkdir()
    counting = folder / "bin/hexcontact"
    counting.write_text('#!/bin/sh\necho "cores: $(env -u OMP_NUM_THREADS nproc)"\n')
    counting.chmod(0o755)
    path = os.pathsep.join([str(folder / "bin"), slurm.environment["PATH"]])
    for cores in (1, 2):
        job = slurm.submit(*requested(cores), f"--export=ALL,PATH={path}", "run.sh", "no.toml", cwd=folder)
        slurm.wait(jobs=job)
        assert f"cores: {cores}\n" in next(folder.glob(f"*-{job}.log")).read_text()


def test_blocks_of_an_array_make_up_the_study(slurm: SlurmNode, folder: Path) -> None:
    """Its tasks share a folder of kernels."""
    study = folder / "study.toml"
    study.write_text(study.read_text().replace('mem = "1G"', "mem = 500").replace("count = 4", "count = 2"))
    slurm.environment["HEXCONTACT_KERNEL_FOLDER"] = str(folder / "kernels")
    done = slurm.command("bash", "array.sh", "study.toml", cwd=folder)
    assert done.returncode == 0, done.stderr
    slurm.wait()
    assert len([*(folder / "study").glob("slurm-*_[12].log")]) == 2
    assert [*(folder / "kernels").iterdir()]
    log = (folder / "study-collect.log").read_text()
    directly(folder, "study", "study.toml", "--output", "local.nc", "--jobs", "2")
    assert same(folder / "study.nc", folder / "local.nc"), log
    with xarray.open_dataset(folder / "study.nc") as data:
        assert data.status.shape == (4, 2) and not data.status.any()
    (folder / "study.nc").unlink()
    again = slurm.command("bash", "array.sh", "study.toml", cwd=folder)
    assert again.returncode == 0 and "Submitted" not in again.stdout
    assert same(folder / "study.nc", folder / "local.nc")


def test_workers_of_dask_make_up_the_study(slurm: SlurmNode, folder: Path) -> None:
    if importlib.util.find_spec("dask_jobqueue") is None:
        pytest.skip("not installed: dask-jobqueue")
    study = folder / "study.toml"
    text = study.read_text().replace("workers = 4", "workers = 1").replace("count = 4", "count = 2")
    study.write_text(text.replace('memory = "1GB"', 'memory = "700MB"'))
    job = slurm.submit(*requested(), "--oversubscribe", "dask.sh", "study.toml", cwd=folder)
    slurm.wait(jobs=job)
    log = next(folder.glob(f"*-{job}.log")).read_text()
    assert slurm.job(job)["JobState"] == "COMPLETED", log
    directly(folder, "study", "study.toml", "--output", "local.nc", "--jobs", "2")
    assert same(folder / "study.nc", folder / "local.nc"), log


@pytest.mark.parametrize("mpi", MPIS)
def test_ranks_share_a_run(slurm: SlurmNode, folder: Path, mpi: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with_mpi(slurm, mpi, monkeypatch)
    deck = folder.parent / "cattaneo_mindlin.toml"
    job = slurm.submit(*requested(), "--nodes=1", "--ntasks-per-node=2", "mpi.sh", deck, cwd=folder)
    slurm.wait(jobs=job)
    log = next(folder.glob(f"*-{job}.log")).read_text()
    assert slurm.job(job)["JobState"] == "COMPLETED", log
    directly(folder, "run", str(deck), "--output", "whole.nc")
    files = [folder / "cattaneo_mindlin.nc", folder / "whole.nc"]
    shared, serial = (xarray.open_dataset(file) for file in files)
    assert abs(shared.pressure - serial.pressure).max() < 1e-6 * serial.max_pressure.max()
