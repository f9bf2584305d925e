"""Result files: nothing that was finished is lost, nothing that was there is damaged."""

import errno
import json
import os
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import netCDF4
import pytest
import xarray
from commands import ENVIRONMENT
from fuzz.file_made import WINDOW, made_step, read_record, written
from numpy.testing import assert_array_equal

from hexcontact import files as lock_module
from hexcontact import resume
from hexcontact.errors import DeckError, ResourceError
from hexcontact.files import Lock
from hexcontact.result import journal as journal_module
from hexcontact.result import store as store_module
from hexcontact.result.journal import Journal, Stored, journal_of
from hexcontact.result.layout import Metadata, assemble
from hexcontact.result.store import Store, open_result


def content(path: Path) -> dict[str, bytes]:
    """Everything in a folder."""
    return {str(p.relative_to(path)): p.read_bytes() for p in sorted(path.rglob("*")) if p.is_file()}


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "out.nc"


# --- what is written can be read ------------------------------------------------------------------


def test_a_finished_run_is_one_file(out: Path) -> None:
    described = written(out)
    assert [p.name for p in out.parent.iterdir()] == ["out.nc"]
    result = open_result(out)
    assert result.complete
    assert result.dataset.identical(assemble(described, [made_step(k) for k in range(3)]))


def test_a_window_that_grew_and_chosen_fields_come_back(out: Path) -> None:
    larger = replace(WINDOW, row_first=-6, n_row=12)
    steps = [made_step(0), made_step(1, larger), made_step(2, larger)]
    described = Metadata(fields=("pressure", "zone"), every=2, planned_steps=3)
    with Store(out, described) as store:
        for step in steps:
            store.append(step)
        record = read_record(store.folder / "000001.npz")
        assert_array_equal(record[1].fields["gap"], steps[0].fields["gap"])  # the journal keeps everything
        assert record[0] == described
        store.finish()
    assert open_result(out).dataset.identical(assemble(described, steps))


def test_xarray_opens_it_without_us(out: Path) -> None:
    written(out)
    program = f"""
        import sys, warnings, numpy, xarray
        warnings.simplefilter("error")
        data = xarray.open_dataset({str(out)!r})
        assert set(data.coords) == {{"step", "row", "col", "x", "y"}}, data.coords
        assert data["seconds"].dtype == float and data["zone"].dtype == numpy.int8
        assert data["label"].values.tolist() == ["pressé 0", "pressé 1", "pressé 2"]
        assert data["pressure"].attrs["units"] == "Pa" and data["pressure"].attrs["long_name"]
        assert data.attrs["Conventions"] == "CF-1.11 UGRID-1.0" and data.attrs["deck"] == "deck = 1"
        assert "hexcontact" not in sys.modules
        print(float(data["pressure"].sum()))
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(program)], capture_output=True, text=True)
    assert done.stderr == ""
    total = sum(made_step(k).fields["pressure"].sum() for k in range(3))
    assert float(done.stdout) == pytest.approx(total, rel=1e-14)


@pytest.mark.parametrize("deck", ["", "spacing = '3 µm'\n" * 20_000])
def test_the_deck_is_kept_to_the_letter(out: Path, deck: str) -> None:
    with Store(out, Metadata(title="Kugel auf Fläche", deck=deck, planned_steps=1)) as store:
        store.append(made_step(0))
        store.finish()
    assert open_result(out).deck == deck
    assert open_result(out).case_title == "Kugel auf Fläche"


def test_there_are_no_strings_of_variable_length(out: Path) -> None:
    """HDF5 up to 2.2 crashes on them when one process opens a file more than once."""
    written(out, parameters={"note": "µ"})
    with netCDF4.Dataset(out) as file:
        assert file.data_model == "NETCDF4_CLASSIC"
        assert file.note == "µ"
        assert file["label"].dtype == "S1"


def test_a_file_can_be_open_many_times(out: Path) -> None:
    written(out, parameters={"note": "µ"})
    program = f"""
        import random, sys
        sys.path[:0] = {sys.path!r}
        from hexcontact.result.store import open_result
        random.seed(1)
        held = []
        for turn in range(150):
            held.append(open_result({str(out)!r}))
            assert held[-1].label.values[0] == "pressé 0"
            if len(held) > 6:
                held.pop(random.randrange(7)).close()
    """
    environment = ENVIRONMENT | {"MALLOC_PERTURB_": "165"}  # makes use of freed memory show
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)], env=environment, capture_output=True
    )
    assert (done.returncode, done.stderr) == (0, b"")


def test_what_xarray_writes_can_be_opened(out: Path) -> None:
    data = assemble(Metadata(planned_steps=2), [made_step(0), made_step(1)])
    data.to_netcdf(out)
    assert open_result(out).dataset.identical(data)


def test_an_unfinished_run_is_read_from_its_journal(out: Path) -> None:
    described = written(out, count=2, planned=5)
    assert not out.exists()
    for path in (out, journal_of(out)):
        result = open_result(path)
        assert not result.complete
        assert result.dataset.identical(assemble(described, [made_step(0), made_step(1)], complete=False))


def test_output_and_journal_of_one_run_belong_together(out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store_module, "PUBLISH_INTERVAL", 0.0)
    written(out, count=3, planned=5)
    assert xarray.open_dataset(out).sizes["step"] == 2  # interim: after 1 and 2 steps, not after 3
    assert len(open_result(out)) == 3
    shutil.rmtree(journal_of(out))
    alone = open_result(out)
    assert len(alone) == 2
    assert not alone.complete


def test_the_journal_of_another_run_does_not_mix_in(out: Path) -> None:
    written(out, count=3, planned=3)
    with Store(out, Metadata(title="new", planned_steps=9), overwrite=True) as store:
        store.append(made_step(7 - 7))
    assert open_result(out).case_title == "a case"
    assert open_result(journal_of(out)).case_title == "new"


def test_fields_of_large_records_are_read_one_by_one(out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Their checksums are compared."""
    monkeypatch.setattr(journal_module, "LARGE", 0)
    described = written(out)
    result = open_result(out)
    assert result.dataset.identical(assemble(described, [made_step(k) for k in range(3)]))
    other = out.with_name("other.nc")
    written(other, count=2)
    [first, second] = Journal(journal_of(other))
    assert isinstance(first.fields, Stored) and list(first.fields) == list(made_step(0).fields)
    record = Journal(journal_of(other)).records[1]
    data = bytearray(record.read_bytes())
    record.write_bytes(data[: len(data) // 3])
    with pytest.raises(DeckError, match="damaged"):
        second.fields["zone"]
    place = data.index(made_step(1).pressure.tobytes())
    data[place + 9] ^= 1
    record.write_bytes(data)
    [_, second] = Journal(journal_of(other))
    with pytest.raises(DeckError, match="damaged"):
        second.fields["pressure"]


def test_interim_outputs_cost_linear_time(out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store_module, "PUBLISH_INTERVAL", 0.0)
    reads = 0
    original = journal_module.read_record

    def counted(*arguments: Any, **options: Any) -> Any:
        nonlocal reads
        reads += 1
        return original(*arguments, **options)

    monkeypatch.setattr(journal_module, "read_record", counted)
    written(out, count=33, planned=34)
    assert reads == sum(steps - 1 for steps in (1, 2, 4, 8, 16, 32))  # the last step need not be read


def test_a_failed_interim_output_is_not_tried_at_each_step(
    out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(store_module, "PUBLISH_INTERVAL", 0.0)
    monkeypatch.setattr(store_module, "write", full)
    failed = []
    with Store(out, Metadata(title="full", planned_steps=6)) as store:
        for index in range(5):
            store.append(made_step(index))
            try:
                store.publish()
            except ResourceError:
                failed.append(index + 1)
    assert failed == [1, 2, 4]


def test_no_interim_output_within_the_interval(out: Path) -> None:
    written(out, count=4, planned=5)
    assert not out.exists()


# --- what is there is safe ------------------------------------------------------------------------


def test_an_output_that_is_there_is_refused(out: Path) -> None:
    out.write_text("a thesis")
    before = content(out.parent)
    with pytest.raises(DeckError, match=r"out\.nc exists already; --overwrite"):
        Store(out, Metadata())
    assert content(out.parent) == before
    assert [p.name for p in out.parent.iterdir()] == ["out.nc"]


def test_the_old_output_stays_until_the_new_one_is_complete(out: Path) -> None:
    written(out)
    before = out.read_bytes()
    with Store(out, Metadata(planned_steps=2), overwrite=True) as store:
        for index in range(2):
            store.append(made_step(index))
            assert out.read_bytes() == before
        store.finish()
    assert len(open_result(out)) == 2
    assert [p.name for p in out.parent.iterdir()] == ["out.nc"]


def test_an_unfinished_run_is_not_overwritten_by_accident(out: Path) -> None:
    written(out, count=2, planned=5)
    before = content(out.parent)
    with pytest.raises(
        DeckError, match=r"out\.nc\.d holds 2 finished steps of an unfinished run; hexcontact resume "
    ):
        Store(out, Metadata())
    assert content(out.parent) == before


def test_overwriting_an_unfinished_run_keeps_its_steps_until_the_end(out: Path) -> None:
    written(out, count=2, planned=5)
    with Store(out, Metadata(title="new", planned_steps=1), overwrite=True) as store:
        store.append(made_step(0))
        assert len(open_result(out)) == 2  # all steps of the old run, now in the output
        store.finish()
    assert open_result(out).case_title == "new"


def test_overwriting_an_abandoned_overwrite_keeps_the_first_output(out: Path) -> None:
    written(out)
    with Store(out, Metadata(title="abandoned", planned_steps=9), overwrite=True) as store:
        store.append(made_step(0))
    with Store(out, Metadata(title="third", planned_steps=9), overwrite=True) as store:
        assert len(Journal(store.folder)) == 0
        assert open_result(out).case_title == "a case"


FOREIGN = {
    "a record": "000001.npz",
    "a temporary record": "000002.npz.tmp",
    "a temporary output": "out.nc.tmp",
    "a reason": "stopped.txt",
    "a header": "header.json",
    "a header of lattices": "lattices/header.json",
    "a lattice": "lattices/1_0.json",
    "a step of a lattice": "lattices/1_0.nc.d/000001.npz",
}


@pytest.mark.parametrize("left", ["lock", "blank"])
def test_a_run_killed_while_it_replaces_an_output_is_not_that_output(out: Path, left: str) -> None:
    """Killed before its first step: the old output is complete, but not the run that is asked for."""
    written(out)
    os.utime(out, (0.0, 1e9))
    holder = {"process": 2**30, "host": os.uname().nodename, "time": 1e9 + 60.0}
    journal_of(out).mkdir()
    (journal_of(out) / "lock").write_text(json.dumps(holder) if left == "lock" else "")
    for call in (lambda: Store.reopened(out), lambda: resume(out)):
        with pytest.raises(
            DeckError, match=r"out\.nc ended before its first .*; run it again with --overwrite"
        ):
            call()
        assert open_result(out).complete
        journal_of(out).mkdir(exist_ok=True)
        (journal_of(out) / "lock").write_text(json.dumps(holder) if left == "lock" else "")
    os.utime(out, (0.0, 1e9 + 90.0))  # it was killed while it deleted its journal
    if left == "lock":
        store, last = Store.reopened(out)
        assert last is None
        store.close()


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("name", FOREIGN.values(), ids=FOREIGN)
def test_a_folder_that_no_run_has_written_to_is_refused(out: Path, name: str, overwrite: bool) -> None:
    theirs = journal_of(out) / name
    theirs.parent.mkdir(parents=True)
    theirs.write_bytes(b"measured for a year")
    before = content(out.parent)
    with pytest.raises(DeckError, match=rf"{re.escape(str(theirs))} may not be of hexcontact.*move "):
        Store(out, Metadata(), overwrite)
    assert content(out.parent) == before


@pytest.mark.parametrize("name", ["lattices", "lattices/1_0.nc.d"])
def test_lattices_behind_a_link_are_refused(out: Path, name: str) -> None:
    """What looks like those of a run, too."""
    elsewhere = out.parent / "elsewhere"
    (elsewhere / "1_0.nc.d").mkdir(parents=True)
    (elsewhere / "header.json").write_text('{"journal_version": 4}')
    link = journal_of(out) / name
    link.parent.mkdir(parents=True)
    link.symlink_to(elsewhere, target_is_directory=True)
    before = content(out.parent)
    with pytest.raises(DeckError, match=rf"{re.escape(str(link))} may not be of hexcontact.*move "):
        Store(out, Metadata(), True)
    assert content(out.parent) == before


@pytest.mark.parametrize("overwrite", [False, True])
def test_other_files_in_the_folder_stay(out: Path, overwrite: bool) -> None:
    """Names of their own do no harm, in the folder of an unfinished run too."""
    theirs = ["a.tmp", "1.npz", "lattices/notes.txt", "lattices/a/000001.npz", "other.nc.tmp"]
    for name in theirs:
        file = journal_of(out) / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(b"measured for a year")
    before = content(out.parent)
    for planned, replaced in ((5, overwrite), (2, True)):
        with Store(out, Metadata(planned_steps=planned), replaced) as store:
            store.append(made_step(0))
            store.append(made_step(1))
            if planned == 2:
                store.finish()
    assert len(before) == len(theirs)
    assert content(out.parent) == before | {"out.nc": out.read_bytes()}


def test_what_a_killed_run_left_before_its_first_step_is_taken_over(out: Path) -> None:
    journal_of(out).mkdir()
    (journal_of(out) / "000001.npz.tmp").write_bytes(b"PK")
    lock = {"process": 1, "host": socket.gethostname(), "since": "2030-01-01 00:00:00", "time": 0.0}
    (journal_of(out) / "lock").write_text(json.dumps(lock))
    written(out)
    assert [p.name for p in out.parent.iterdir()] == ["out.nc"]


def test_only_results_are_overwritten(out: Path) -> None:
    written(out)
    kept = out.read_bytes()
    sealed = len(kept) - 48  # bytes of HDF5
    ours = {"as written": kept, "damaged": kept[:3000] + bytes(999) + kept[3999:], "empty": b""}
    ours["of an earlier version"] = kept[:sealed]
    xarray.Dataset({"a": ("x", [1.0])}).to_netcdf(out)
    theirs = {"netCDF": out.read_bytes(), "classic": b"CDF\x01measured", "HDF5": b"\x89HDF\r\n\x1a\nmeasured"}
    for what, data in theirs.items():
        out.write_bytes(data)
        with pytest.raises(DeckError, match=r"out\.nc is not a result of hexcontact that can be read, so it"):
            Store(out, Metadata(), overwrite=True)
        assert content(out.parent) == {"out.nc": data}, what
    for what, data in ours.items():
        out.write_bytes(data)
        with Store(out, Metadata(title=what, planned_steps=1), overwrite=True) as store:
            store.append(made_step(0))
            store.finish()
        assert open_result(out).case_title == what


def test_a_link_is_followed(tmp_path: Path) -> None:
    (tmp_path / "disk").mkdir()
    written(tmp_path / "disk" / "real.nc")
    (tmp_path / "out.nc").symlink_to(tmp_path / "disk" / "real.nc")
    with Store(tmp_path / "out.nc", Metadata(planned_steps=1), overwrite=True) as store:
        store.append(made_step(0))
        store.finish()
    assert (tmp_path / "out.nc").is_symlink()
    assert len(open_result(tmp_path / "disk" / "real.nc")) == 1


def test_steps_come_in_order(out: Path) -> None:
    with Store(out, Metadata()) as store:
        with pytest.raises(ValueError, match="step 1 is next, not step 2"):
            store.append(made_step(1))
        store.close()
        with pytest.raises(ValueError, match="closed"):
            store.append(made_step(0))


def test_places_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(DeckError, match="is a folder; a file name is expected"):
        Store(tmp_path, Metadata())
    with pytest.raises(DeckError, match=r"the folder .*missing does not exist"):
        Store(tmp_path / "missing" / "out.nc", Metadata())
    (tmp_path / "out.nc.d").write_text("in the way")
    with pytest.raises(DeckError, match=r"cannot write the journal of .*out\.nc: File exists"):
        Store(tmp_path / "out.nc", Metadata())
    assert content(tmp_path) == {"out.nc.d": b"in the way"}

    def denied(*_: object, **__: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(Path, "mkdir", denied)
    with pytest.raises(DeckError, match=r"cannot write the journal of .*other\.nc: Permission denied"):
        Store(tmp_path / "other.nc", Metadata())


# --- the disk fails -------------------------------------------------------------------------------

FAILURES = [
    ("fsync", errno.EIO, "Input/output error", ResourceError),
    ("replace", errno.EDQUOT, "quota exceeded", ResourceError),
    ("replace", errno.EACCES, "Permission denied", DeckError),
]


@pytest.mark.parametrize(("call", "number", "words", "kind"), FAILURES)
def test_a_step_that_cannot_be_committed_leaves_those_before(
    out: Path, monkeypatch: pytest.MonkeyPatch, call: str, number: int, words: str, kind: type[Exception]
) -> None:
    def failing(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    message = rf"cannot write step 3 of .*out\.nc: .*{words}"
    with pytest.raises(kind, match=message) as caught, Store(out, Metadata(planned_steps=9)) as store:
        store.append(made_step(0))
        store.append(made_step(1))
        monkeypatch.setattr(store_module.os, call, failing)
        store.append(made_step(2))
    monkeypatch.undo()
    [note] = caught.value.__notes__
    assert note.startswith(
        f"2 of 9 load steps are finished and recorded in {journal_of(out)}; to resume: hexcontact "
    )
    assert sorted(p.name for p in journal_of(out).iterdir()) == [
        *("000001.npz", "000002.npz", "header.json", "stopped.txt")
    ]
    assert_array_equal(open_result(out).pressure.sel(step=2), made_step(1).fields["pressure"])


def test_an_output_that_cannot_be_written_at_the_end_leaves_the_journal(
    out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = store_module.write

    def full(path: Path, *arguments: object, **options: object) -> None:
        if path.name == "out.nc.tmp":
            path.write_bytes(b"half")
            raise OSError(errno.ENOSPC, "No space left on device")
        original(path, *arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(store_module, "write", full)
    with pytest.raises(ResourceError, match=r"cannot write the output of .*: No space left on device"):
        written(out)
    assert not out.exists()
    assert sorted(p.name for p in journal_of(out).iterdir()) == [
        *(f"{k:06d}.npz" for k in (1, 2, 3)),
        *("header.json", "stopped.txt"),
    ]
    assert len(open_result(out)) == 3


def test_a_full_disk_is_told_apart_from_wrong_input(out: Path) -> None:
    """A limit on the size of files makes the real libraries fail as on a full disk."""
    written(out)
    before = out.read_bytes()
    program = f"""
        import resource, signal, sys
        sys.path[:0] = {[str(Path(__file__).parent), *sys.path]!r}
        from dataclasses import replace
        from test_store import WINDOW, made_step
        from hexcontact.result.layout import Metadata
        from hexcontact.result.store import Store
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        with Store({str(out)!r}, Metadata(planned_steps=9), overwrite=True) as store:
            store.append(made_step(0))
            resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))
            try:
                store.append(made_step(1, replace(WINDOW, n_row=300, n_col=300)))
            except Exception as error:
                print(type(error).__name__, error)
            resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
            try:
                store.finish()
            except Exception as error:
                print(type(error).__name__, error)
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(program)], capture_output=True, text=True)
    assert done.stderr == ""
    step, output = done.stdout.splitlines()
    assert step == f"ResourceError cannot write step 2 of {out}: File too large"
    assert output.startswith(f"ResourceError cannot write the output of {out}: ")
    assert "is the disk full?" in output  # the netCDF library does not say
    assert out.read_bytes() == before
    assert sorted(p.name for p in journal_of(out).iterdir()) == ["000001.npz", "header.json"]


# --- killed ---------------------------------------------------------------------------------------

WRITER = """
    import sys
    sys.path[:0] = {path!r}
    from test_store import made_step
    from hexcontact.result import store
    from hexcontact.result.layout import Metadata
    store.PUBLISH_INTERVAL = 0.0
    with store.Store({out!r}, Metadata(title="killed", planned_steps=40), overwrite={overwrite!r}) as running:
        for index in range(40):
            running.append(made_step(index))
            running.publish()
            print(index + 1, flush=True)
        running.finish()
        print("finished", flush=True)
"""


def killed_writer(out: Path, delay: float, overwrite: bool = False) -> list[str]:
    """Run a writer, kill it `delay` seconds after its first step, and return what it said it had done."""
    path = [str(Path(__file__).parent), *sys.path]
    program = textwrap.dedent(WRITER).format(path=path, out=str(out), overwrite=overwrite)
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        first = process.stdout.readline()
        time.sleep(delay)
        process.send_signal(signal.SIGKILL)
        return [first.strip(), *process.stdout.read().split()]


@pytest.mark.parametrize("seed", range(4))
def test_killed_at_any_moment_all_committed_steps_are_there(out: Path, seed: int) -> None:
    said = killed_writer(out, random.Random(seed).uniform(0.0, 0.5))
    result = open_result(out)
    committed = 40 if said[-1] == "finished" else int(said[-1])
    assert committed <= len(result) <= committed + 1  # killed between the commit and the word
    for number in range(1, len(result) + 1):
        assert_array_equal(result.step(number)["pressure"], made_step(number - 1).fields["pressure"])
        assert_array_equal(result.step(number)["zone"], made_step(number - 1).fields["zone"])
    if out.exists():
        assert xarray.open_dataset(out).sizes["step"] <= len(result)


@pytest.mark.parametrize("seed", range(2))
def test_killed_while_overwriting_the_old_output_is_whole(out: Path, seed: int) -> None:
    written(out)
    before = out.read_bytes()
    said = killed_writer(out, random.Random(seed).uniform(0.0, 0.3), overwrite=True)
    if out.read_bytes() != before:
        assert len(open_result(out)) == 40
    else:
        assert said[-1] != "finished"
        assert open_result(out).case_title == "a case"
    # the lock that the dead process left is recognized, so is its journal
    with Store(out, Metadata(title="next", planned_steps=1), overwrite=True) as store:
        store.append(made_step(0))
        store.finish()
    assert [p.name for p in out.parent.iterdir()] == ["out.nc"]


# --- two runs -------------------------------------------------------------------------------------


@pytest.fixture
def other_run(out: Path) -> Iterator[subprocess.Popen[str]]:
    """Give a second process that is writing `out`."""
    program = f"""
        import sys
        sys.path[:0] = {sys.path!r}
        from hexcontact.result.layout import Metadata
        from hexcontact.result.store import Store
        with Store({str(out)!r}, Metadata()):
            print("ready", flush=True)
            sys.stdin.readline()
    """
    with subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(program)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout
        process.stdout.readline()
        yield process
        process.kill()


def test_two_runs_cannot_write_one_file(out: Path, other_run: subprocess.Popen[str]) -> None:
    host = socket.gethostname()
    message = rf"out\.nc is being written by another run, process {other_run.pid} on {host} since 20"
    for overwrite in (False, True):
        with pytest.raises(DeckError, match=message):
            Store(out, Metadata(), overwrite)
    other_run.communicate("leave\n")
    with Store(out, Metadata()):
        pass
    assert list(out.parent.iterdir()) == []


def test_an_output_that_came_while_we_waited_is_refused(out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another run finishes, and takes its journal away, just before we get the lock."""
    original = Lock.__init__
    calls = 0

    def late(self: Lock, path: Path, output: Path) -> None:
        nonlocal calls
        calls += 1
        if calls == 1:
            out.write_text("of the other run")
            path.parent.rmdir()
        original(self, path, output)

    monkeypatch.setattr(Lock, "__init__", late)
    with pytest.raises(DeckError, match="exists already"):
        Store(out, Metadata())
    assert calls == 2
    assert out.read_text() == "of the other run"


def test_the_lock_of_a_dead_process_is_taken_over(out: Path, other_run: subprocess.Popen[str]) -> None:
    other_run.kill()
    other_run.wait()
    assert (journal_of(out) / "lock").exists()
    with Store(out, Metadata(planned_steps=1)) as store:
        holder = json.loads((store.folder / "lock").read_text())
        assert holder["process"] == os.getpid()
        assert holder["host"] == socket.gethostname()


def test_the_lock_of_another_host_holds(out: Path) -> None:
    journal_of(out).mkdir()
    lock = journal_of(out) / "lock"
    lock.write_text(json.dumps({"process": 1, "host": "node7", "since": "2030-01-01 00:00:00"}))
    with pytest.raises(
        DeckError, match=r"process 1 on node7 since 2030-01-01 00:00:00; if that run is over, delete .*lock"
    ):
        Store(out, Metadata())
    lock.unlink()
    with Store(out, Metadata()):
        pass


def test_a_file_in_the_place_of_the_lock_stays_as_it_is(out: Path) -> None:
    journal_of(out).mkdir()
    (journal_of(out) / "lock").write_text("[1, 2")
    with pytest.raises(DeckError, match="lock"), Store(out, Metadata()):
        pass
    assert (journal_of(out) / "lock").read_text() == "[1, 2"


def test_a_lock_that_was_cut_short_is_taken_over(out: Path) -> None:
    journal_of(out).mkdir()
    (journal_of(out) / "lock").write_text('{"process": 1, "ho')
    with Store(out, Metadata()):
        pass


def test_without_locks_in_the_file_system_the_process_number_decides(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unsupported(*_: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(lock_module.fcntl, "flock", unsupported)
    path = tmp_path / "lock"
    lock = Lock(path, tmp_path / "out.nc")
    with pytest.raises(DeckError, match=f"process {os.getpid()}"):
        Lock(path, tmp_path / "out.nc")
    lock.release()
    with subprocess.Popen([sys.executable, "-c", ""]) as gone:
        gone.wait()
    path.write_text(json.dumps({"process": gone.pid, "host": socket.gethostname()}))
    Lock(path, tmp_path / "out.nc").release()


def test_two_threads_write_two_files(tmp_path: Path) -> None:
    failed: list[BaseException] = []

    def work(name: str) -> None:
        try:
            for turn in range(5):
                written(tmp_path / f"{name}{turn}.nc", 4, 4)
                assert len(open_result(tmp_path / f"{name}{turn}.nc").pressure.load()) == 4
        except BaseException as error:
            failed.append(error)

    threads = [threading.Thread(target=work, args=(name,)) for name in "ab"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failed == []
