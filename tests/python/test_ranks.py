"""Runs that a launcher of MPI starts as several processes."""

from pathlib import Path

import pytest
from commands import DECK, inside


@pytest.mark.parametrize(
    ("variable", "launcher"),
    [("OMPI_COMM_WORLD_SIZE", "mpirun"), ("PMI_SIZE", "mpirun"), ("SLURM_STEP_NUM_TASKS", "srun")],
)
@pytest.mark.parametrize("words", [("run", "sphere.toml"), ("resume", "sphere.nc")])
def test_copies_are_refused(
    words: tuple[str, ...], variable: str, launcher: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sphere.toml").write_text(DECK)
    monkeypatch.setenv(variable, "3")
    refused = inside(tmp_path, *words)
    assert refused.returncode == 2
    assert f"{launcher} started 3 processes; expected one" in " ".join(refused.stderr.split())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["sphere.toml"]


@pytest.mark.parametrize("variable", ["OMPI_COMM_WORLD_SIZE", "SLURM_STEP_NUM_TASKS"])
def test_one_process_of_a_launcher_runs(
    variable: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sphere.toml").write_text(DECK)
    monkeypatch.setenv(variable, "1")
    monkeypatch.setenv("SLURM_NTASKS", "4")  # as in a script of sbatch
    assert inside(tmp_path, "run", "sphere.toml", "--quiet").returncode == 0
