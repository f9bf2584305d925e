"""Files are written as a whole, or not at all."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hexcontact.files import remove_stale, replacing


def test_a_file_is_replaced_when_it_is_complete(tmp_path: Path) -> None:
    target = tmp_path / "result.txt"
    target.write_text("old")
    with replacing(target) as path:
        path.write_text("new")
        assert path.parent == tmp_path
        assert target.read_text() == "old"
    assert target.read_text() == "new"
    assert list(tmp_path.iterdir()) == [target]


def test_a_file_may_be_prepared_elsewhere(tmp_path: Path) -> None:
    (tmp_path / "journal").mkdir()
    with replacing(tmp_path / "result.txt", tmp_path / "journal/result.txt.tmp") as path:
        path.write_text("new")
        assert path == tmp_path / "journal/result.txt.tmp"
    assert (tmp_path / "result.txt").read_text() == "new"
    assert not list((tmp_path / "journal").iterdir())


@pytest.mark.parametrize("fails", ["writing", "fsync", "replace"])
def test_after_an_error_the_file_is_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: str
) -> None:
    def failing(*_: object) -> None:
        raise OSError(f"{fails} fails")

    target = tmp_path / "result.txt"
    target.write_text("old")
    if fails != "writing":
        monkeypatch.setattr(os, fails, failing)
    with pytest.raises(OSError, match=f"{fails} fails"), replacing(target) as path:
        path.write_text("new")
        if fails == "writing":
            failing()
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_what_killed_processes_left_is_removed(tmp_path: Path) -> None:
    killed = subprocess.Popen([sys.executable, "-c", ""])
    killed.wait()
    target = tmp_path / "out_[1].nc"
    stale = [tmp_path / f"out_[1].nc.{killed.pid}.tmp"]
    kept = [
        tmp_path / f"out_[1].nc.{os.getpid()}.tmp",  # this process may write it in another thread
        tmp_path / f"out_1.nc.{killed.pid}.tmp",  # of another target
        tmp_path / "out_[1].nc.mine.tmp",
        target,
    ]
    for path in (*stale, *kept):
        path.write_text("")
    remove_stale(target)
    assert all(path.exists() for path in (*stale, *kept))  # just written
    for path in (*stale, *kept):
        os.utime(path, (0.0, 0.0))
    remove_stale(target)
    assert sorted(tmp_path.iterdir()) == sorted(kept)
