"""Locks: what is at their place and is none stays as it is, whatever it is."""

import json
import os
import re
import stat
from collections.abc import Callable
from pathlib import Path

import pytest
from fuzz.file_made import made_step

from hexcontact import DeckError
from hexcontact.files import Lock, names_a_run, replacing
from hexcontact.result.journal import Journal, TrialFolder, journal_of
from hexcontact.result.layout import Metadata
from hexcontact.result.store import Store

THESIS = "what somebody wrote\n"


def symbolic(place: Path, victim: Path) -> None:
    place.symlink_to(victim)


def dangling(place: Path, victim: Path) -> None:
    place.symlink_to(victim.with_name("nowhere"))


def hard(place: Path, victim: Path) -> None:
    os.link(victim, place)


def written(place: Path, victim: Path) -> None:
    place.write_text(THESIS)


def long(place: Path, victim: Path) -> None:
    place.write_text(json.dumps({"process": 1, "host": "node", "more": "x" * 1000}))


def listed(place: Path, victim: Path) -> None:
    place.write_text("[1, 2]")


def pipe(place: Path, victim: Path) -> None:
    os.mkfifo(place)


def folder(place: Path, victim: Path) -> None:
    place.mkdir()


@pytest.mark.parametrize("put", [symbolic, dangling, hard, written, long, listed, pipe, folder])
def test_what_is_no_lock_is_left_alone(tmp_path: Path, put: Callable[[Path, Path], None]) -> None:
    victim, journal = tmp_path / "thesis.txt", tmp_path / "out.nc.d"
    victim.write_text(THESIS)
    journal.mkdir()
    place = journal / "lock"
    put(place, victim)
    before = place.lstat()
    with pytest.raises(DeckError, match=re.escape(f"{place} is not a lock of hexcontact; move it away")):
        Store(tmp_path / "out.nc", Metadata(), overwrite=True)
    after = place.lstat()
    assert (after.st_mode, after.st_size, after.st_ino) == (before.st_mode, before.st_size, before.st_ino)
    assert victim.read_text() == THESIS
    assert not (tmp_path / "nowhere").exists()
    if stat.S_ISREG(after.st_mode):
        assert place.read_text().startswith((THESIS, "{", "["))


@pytest.mark.parametrize(
    "left", [b"", b"\0" * 80, b'{"process": 1, "host": "%s"}' % os.uname().nodename.encode()]
)
def test_what_a_run_that_died_left_is_taken_over(tmp_path: Path, left: bytes) -> None:
    place = tmp_path / "lock"
    place.write_bytes(left)
    lock = Lock(place, tmp_path / "out.nc")
    assert json.loads(place.read_bytes())["process"] == os.getpid()
    lock.release()
    assert not place.exists()


def test_a_file_that_came_in_the_place_of_a_lock_stays(tmp_path: Path) -> None:
    lock = Lock(tmp_path / "lock", tmp_path / "out.nc")
    (tmp_path / "lock").unlink()
    (tmp_path / "lock").write_text(THESIS)
    lock.release()
    assert (tmp_path / "lock").read_text() == THESIS


def test_a_link_to_a_lock_does_not_name_a_run(tmp_path: Path) -> None:
    lock = Lock(tmp_path / "lock", tmp_path / "out.nc")
    (tmp_path / "link").symlink_to(lock.path)
    assert names_a_run(lock.path) and not names_a_run(tmp_path / "link")
    lock.release()


def test_no_descriptor_is_left_by_a_lock_that_was_refused(tmp_path: Path) -> None:
    (tmp_path / "lock").write_text(THESIS)
    before = os.listdir("/proc/self/fd")
    for _ in range(3):
        with pytest.raises(DeckError):
            Lock(tmp_path / "lock", tmp_path / "out.nc")
    assert len(os.listdir("/proc/self/fd")) == len(before)
    assert not journal_of(tmp_path / "out.nc").exists()


@pytest.mark.parametrize("put", [symbolic, dangling, hard, written])
def test_files_on_their_way_go_through_no_link(tmp_path: Path, put: Callable[[Path, Path], None]) -> None:
    victim, out = tmp_path / "thesis.txt", tmp_path / "out.nc"
    victim.write_text(THESIS)
    journal, trials = journal_of(out), TrialFolder(journal_of(out))
    with Store(out, Metadata(planned_steps=3)) as store:
        trials.folder.mkdir(exist_ok=True)
        for name in ("header.json.tmp", "000001.npz.tmp", "stopped.txt", "lattices/header.json.tmp"):
            put(journal / name, victim)
        store.append(made_step(0))
        trials.begin(Metadata())
        store.close("by hand")
    assert (journal / "stopped.txt").read_text() == "by hand"
    assert len(Journal(journal)) == 1 and trials.solutions == []
    put(tmp_path / "own.tmp", victim)
    with replacing(out, tmp_path / "own.tmp") as path:
        path.write_text("new")
    assert out.read_text() == "new" and not out.is_symlink()
    assert victim.read_text() == THESIS and not victim.with_name("nowhere").exists()
