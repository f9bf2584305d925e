"""The store of a run: a journal of finished steps, from which the result file is made.

While a run continues, each finished step is a small file in the journal beside the output
(``out.nc.d/000012.npz``), with all its fields, written under a temporary name, flushed to disk and renamed.
``out.nc`` is assembled from the records, one step in memory at a time, and only replaced as a whole. So a run
that is killed at any moment loses at most its present step, and the earlier ``out.nc`` is readable.
"""

from __future__ import annotations

import contextlib
import dataclasses
import errno
import itertools
import os
import shlex
import shutil
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from ..arrays import Banded
from ..errors import LACKING, DeckError, HexcontactError, ResourceError
from ..files import Lock, begun, flush, make_anew, names_a_run, reading, replacing, require_utf8
from ..text import counted
from . import journal as records
from .layout import Layout, Metadata
from .netcdf import is_ours, read_output, require_free, stress_files, write
from .step import Step

if TYPE_CHECKING:
    from .result import Result

PUBLISH_INTERVAL = 30.0  # s, at least, between two interim versions of the output
_LACKING = {*LACKING, None}


def open_result(path: str | os.PathLike[str]) -> Result:
    """Open the result of a run, finished or not; fields of a finished one are read at their first use.

    `path` is the output file, which may be missing if the journal of an unfinished run is beside it; or the
    folder of a journal. DeckError if there is no such file, or it is damaged, of another kind or version.
    """
    target = Path(path)
    for _ in range(2):  # again if a run that just finished deleted its journal meanwhile
        with contextlib.suppress(FileNotFoundError):
            if target.is_dir():
                if journal := records.Journal(target):
                    return journal.result(target)
                raise DeckError(f"{target} is a folder without finished steps in it")
            output = read_output(target) if target.exists() else None
            if output is not None and output.complete:
                return output
            journal = records.Journal(records.journal_of(target))
            if not journal and output is None and (trials := records.TrialFolder(journal.folder)):
                return trials.result(target)
            if journal and (output is None or _continues(journal, output)):
                if output is not None:
                    output.close()
                return journal.result(target)
            if output is not None:
                return output
    raise DeckError(f"there is no file {target}")


def _continues(journal: records.Journal, output: Result) -> bool:
    """Test whether the steps of `output` are the first ones of `journal`."""
    return len(journal) >= len(output) and journal.run == output.dataset.attrs.get("run")


class Store:
    """Writes a run: each finished step to the journal, all of them to the output.

    Use it as a context manager, or call `close`. Without `finish` the journal remains. With `overwrite` an
    existing output or unfinished run is replaced at `finish`.
    """

    def __init__(self, path: str | os.PathLike[str], metadata: Metadata, overwrite: bool = False) -> None:
        self._at(path)
        self.describe(records.Header(metadata))
        with self.writing("the journal"):
            self._lock = self._locked()
        try:
            self._take_over(overwrite)
        except BaseException:
            self.close()
            raise
        self._in_the_way = self.path.exists()

    @property
    def metadata(self) -> Metadata:
        """Metadata of the run."""
        return self._header.whole(step.control for step in self.heads)

    def describe(self, header: records.Header) -> None:
        """Set the metadata, which are written with the next step."""
        self._header, self._described = header, False

    @classmethod
    def reopened(cls, path: str | os.PathLike[str]) -> tuple[Self, Step | None]:
        """Open the journal of an unfinished run to resume it; return its store and last finished step.

        The step has all its fields; it is None if the run is finished, or refines its lattice. No file
        changes before `go_on`. Raises DeckError if no step is finished, one is missing or damaged, or another
        run writes them; FileNotFoundError without a journal.
        """
        store = cls.__new__(cls)
        store._at(path)
        if not store.folder.is_dir():
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(store.folder))
        lock = store.folder / "lock"
        with store.writing("the journal", missing=True):
            began = begun(lock)
            store._lock = Lock(lock, store.path, began)
        try:
            return store, store._read_again(began)
        except BaseException:
            store.close()
            raise

    def _at(self, path: str | os.PathLike[str]) -> None:
        """Set the paths of an output that can be written."""
        require_utf8(path, "a netCDF file")
        self.path = Path(os.path.realpath(path))
        self.folder = records.journal_of(self.path)
        self.heads: list[Step] = []
        self._last: Step | None = None  # with its fields, unless they are large
        self._mutex = threading.RLock()  # close() may come from another thread than append()
        self._closed = False
        self.finished = False  # whether the output is complete
        self._published = (0, time.monotonic())
        self.interim = True  # whether a long run also writes interim outputs
        if self.path.is_dir():
            raise DeckError(f"{self.path} is a folder; a file name is expected")
        if self.path.exists() and not self.path.is_file():  # replacing would delete a device
            raise DeckError(f"{self.path} is not a regular file; choose another output")
        if not self.path.parent.is_dir():
            raise DeckError(f"cannot write {self.path}: the folder {self.path.parent} does not exist")
        with self.writing("the journal"):
            if not os.access(self.path.parent, os.W_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    def _read_again(self, began: float | None) -> Step | None:
        """Read all records, so that damage shows before the next step; return the last one.

        The time at which the run `began` shows whether a complete output is its own if it left no records.
        """
        journal, trials = records.Journal(self.folder, restart=True), records.TrialFolder(self.folder)
        left = trials.metadata if trials else None
        output = None
        with contextlib.suppress(DeckError):  # another file is not replaced
            output = read_output(self.path) if self.path.exists() else None
        ours, steps, complete = False, 0, False
        if output is not None:
            run = left.run if left else journal.run if journal else output.dataset.attrs.get("run")
            ours, steps, complete = output.dataset.attrs.get("run") == run, len(output), output.complete
            output.close()
        if not (journal or trials) and output is not None and began and began > self.path.stat().st_mtime:
            raise DeckError(
                f"the run that would have replaced {self.path} ended before its first load step; run it "
                "again with --overwrite (overwrite=True in Python)"
            )
        if ours and complete:  # killed while it deleted the journal
            records.remove_all(self.folder)
            return None
        if left is not None:
            self.describe(records.Header(left))
            self._refuse_newer(not ours, trials.folder / records.HEADER)
            return None
        if not journal and output is not None:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(self.folder))
        if not journal:
            raise DeckError(
                f"no load step of {self.path} was finished, so it has to be run from the beginning"
            )
        last, _ = None, journal.header  # whose damage is not that of a record
        try:
            for last in journal:
                self.heads.append(last.head)
        except DeckError as error:
            error.add_note(
                f"without it and those after it, hexcontact resume continues after step {len(self.heads)}"
            )
            raise
        self._header, self._described = journal.header, True
        with reading(self.folder, "a journal"):
            Layout(self.metadata, self.heads)  # fails if the steps do not belong together
        self._refuse_newer(not ours, journal.records[0])
        if ours:
            self._published = (steps, time.monotonic())
        return last

    def _refuse_newer(self, foreign: bool, left: Path) -> None:
        """Refuse an output of another run that is newer than the records of this one."""
        self._in_the_way = self.path.exists() and foreign
        if self._in_the_way and self.path.stat().st_mtime > left.stat().st_mtime:
            raise DeckError(
                f"{self.path} is not of the run that left its steps in {self.folder}, and newer; move it away"
            )

    def go_on(self, metadata: Metadata) -> None:
        """Prepare a reopened journal for further steps."""
        self.describe(records.Header(metadata))
        with self.writing("the journal"):
            (self.folder / records.STOPPED).unlink(missing_ok=True)

    def _locked(self) -> Lock:
        """Return the lock of the journal, in whose folder no other files are in the way."""
        while True:
            there = self.folder.exists()
            self.folder.mkdir(exist_ok=True)  # fails for another file of this name
            flush(self.path.parent)
            if there and (foreign := records.foreign(self.folder, names_a_run(self.folder / "lock"))):
                raise DeckError(
                    f"{foreign} may not be of hexcontact, and a run would write its load steps there; move "
                    f"{self.folder} away or choose another output"
                )
            with contextlib.suppress(FileNotFoundError):  # a run that just ended deleted the folder
                return Lock(self.folder / "lock", self.path)

    def _take_over(self, overwrite: bool) -> None:
        """Refuse or delete an existing output or unfinished run."""
        left, trials = records.Journal(self.folder), records.TrialFolder(self.folder)
        if (left or trials) and not overwrite:
            count, what = (len(trials.solutions), "lattice") if trials else (len(left), "step")
            raise DeckError(
                f"{self.folder} holds {counted(count, f'finished {what}')} of an unfinished run; "
                f"hexcontact resume {shlex.quote(str(self.path))} continues it, --overwrite (overwrite=True "
                "in Python) starts anew"
            )
        if self.path.exists() and not overwrite:
            raise DeckError(f"{self.path} exists already; --overwrite (overwrite=True in Python) replaces it")
        if self.path.exists() and self.path.stat().st_size and not is_ours(self.path):
            raise DeckError(
                f"{self.path} is not a result of hexcontact that can be read, so it is not overwritten; "
                "delete it or choose another output"
            )
        require_free(stress_files(self.metadata.deck, self.path).values(), overwrite)
        with self.writing("the journal"):
            if left:  # they become the old output, which a complete new one replaces
                with contextlib.suppress(DeckError):
                    old = read_output(self.path) if self.path.exists() else None
                    if old is None or (not old.complete and _continues(left, old)):
                        layout = Layout(left.metadata, [step.head for step in left])
                        self._put_together(layout, left, left.complete)
                    if old is not None:
                        old.close()
            records.remove_all(self.folder)

    def __enter__(self) -> Self:
        """Return the store."""
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        """Close the store; the journal has the reason of an error, the error names the finished steps."""
        known = isinstance(error, HexcontactError | KeyboardInterrupt)
        self.close((str(error) or "interrupted") if known else "")
        if isinstance(error, HexcontactError) and self.kept:
            error.add_note(self.kept)

    @property
    def has_all_steps(self) -> bool:
        """Whether all planned steps are finished."""
        return bool(self.heads) and (
            len(self.heads) == self.metadata.planned_steps or self.heads[-1].done == 1.0
        )

    @property
    def kept(self) -> str:
        """Sentence about the finished steps: number, place, how to resume; empty without any."""
        where = self.folder if self.folder.exists() else self.path
        planned, count = self.metadata.planned_steps, len(self.heads)
        finished = records.TrialFolder(self.folder).kept
        if self.heads and planned:
            finished = f"{count} of {counted(planned, 'load step is', 'load steps are')} finished"
        elif self.heads:
            finished = f"{counted(count, 'load step is', 'load steps are')} finished"
        if not finished:
            return ""
        return (
            f"{finished} and recorded in {where}; to resume: hexcontact resume {shlex.quote(str(self.path))}"
        )

    @contextlib.contextmanager
    def writing(self, what: str, missing: bool = False) -> Iterator[None]:
        """Raise one sentence for a failure to write, with the file and the step."""
        try:
            yield
        except OSError as error:
            if missing and isinstance(error, FileNotFoundError):
                raise
            reason = error.strerror or str(error)
            if error.errno is None:
                free = shutil.disk_usage(self.path.parent).free
                reason = f"{reason}; is the disk full? {free / 1e6:.0f} MB are free"
            kind = ResourceError if error.errno in _LACKING else DeckError
            raise kind(f"cannot write {what} of {self.path}: {reason}") from error

    def _replacing(self, target: Path) -> contextlib.AbstractContextManager[Path]:
        return replacing(target, self.folder / (target.name + ".tmp"))  # a name in the journal

    def _put_together(self, layout: Layout, steps: Iterable[Step], complete: bool) -> None:
        """Write the output of finished steps."""
        with self._replacing(self.path) as path:
            write(path, layout, steps, complete)

    def append(self, step: Step) -> None:
        """Record a finished step on the disk."""
        with self._mutex:
            self._require_open()
            if step.number != len(self.heads) + 1:
                raise ValueError(f"step {len(self.heads) + 1} is next, not step {step.number}")
            record = self.folder / f"{step.number:06d}{records.SUFFIX}"
            try:
                with self.writing(f"step {step.number}"):
                    if not self._described:
                        records.write_header(self.folder, self._header)
                    with self._replacing(record) as path:
                        records.write_record(path, self._header.metadata.run, step)
            except BaseException:
                if not self.heads:
                    (self.folder / records.HEADER).unlink(missing_ok=True)
                raise
            self._described = True
            if step.companion and "until" in step.control and step.number > 2:
                self._lighten(self.folder / f"{step.number - 2:06d}{records.SUFFIX}")
            self.heads.append(step.head)
            kept = not isinstance(step.fields, Banded)
            kept = kept and sum(v.nbytes for v in step.fields.values()) < records.LARGE
            self._last = step if kept else None

    def publish(self) -> None:
        """Write an interim output if one is due; errors as those of `append`, but all steps remain."""
        with self._mutex:
            steps, moment = self._published
            # by doubling, the cost of all interim versions is linear
            due = len(self.heads) >= 2 * steps and time.monotonic() >= moment + PUBLISH_INTERVAL
            if due and self.interim and not self._in_the_way:
                self._published = (len(self.heads), time.monotonic())  # also if it fails: not at each step
                with self.writing("the output"):
                    layout = Layout(self.metadata, self.heads)
                    self._put_together(layout, self._steps(), complete=False)

    def _lighten(self, record: Path) -> None:
        """Remove restart data from an older record; the last two keep it, since one may be lost."""
        with self.writing("the journal"):
            about, before = records.read_record(record)
            with self._replacing(record) as path:
                records.write_record(path, about["run"], before)

    def finish(
        self,
        metadata: Metadata | None = None,
        steps: Callable[[], Iterable[Step]] | None = None,
        trials: Mapping[str, Sequence[Any]] | None = None,
    ) -> None:
        """Write the output and delete the journal, which remains after an error.

        `steps` reads those that are recorded elsewhere, with their `metadata` and `trials` as of `Layout`.
        """
        with self._mutex:
            self._require_open()  # a signal may have closed it during the last step
            heads = [step.head for step in steps()] if steps else self.heads
            about = metadata or dataclasses.replace(self.metadata, planned_steps=len(heads))
            with self.writing("the output"):
                layout = Layout(about, heads, trials)
                self._put_together(layout, (steps or self._steps)(), complete=True)
            self.finished = True
            records.remove_all(self.folder)
            self.close()

    def _steps(self) -> Iterator[Step]:
        """Yield the finished steps: their records, and the last one as it is."""
        recorded = len(self.heads) - (self._last is not None)
        yield from itertools.islice(records.Journal(self.folder), recorded) if recorded else ()
        if self._last is not None:
            yield self._last

    def _require_open(self) -> None:
        if self._closed:
            raise ValueError("the store is closed")

    def close(self, reason: str = "") -> None:
        """Close the files; the journal of an unfinished run remains, with the `reason` of an early end."""
        with self._mutex:
            if self._closed:
                return
            self._closed = True
            if reason and (self.heads or records.TrialFolder(self.folder)):
                with contextlib.suppress(OSError):
                    make_anew(self.folder / records.STOPPED)
                    (self.folder / records.STOPPED).write_text(reason, encoding="utf-8")
            self._lock.release()
            with contextlib.suppress(OSError):  # unless there are records in it
                self.folder.rmdir()
