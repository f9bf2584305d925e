"""The folder of a study: a netCDF file for each finished case, a note for each failed case, an index of both.

The hash of its merged deck identifies a case, and its number never changes, so that a study can be edited:
its cases are found again, new cases get new numbers, files of other cases are not touched.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import operator
import os
import re
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from .._version import __version__
from ..errors import ConvergenceError, DeckError, ResourceError
from ..files import Lock, replacing, require_ordinary, text_of
from ..result.netcdf import missing_stresses, stress_files
from .backend import Outcome, holds
from .plan import Plan, PlannedCase

INDEX = "index.json"
_FINAL = (DeckError.exit_code, ConvergenceError.exit_code)  # the same deck fails in the same way again


class StudyFolder:
    """Keep the files of a study in the folder named as its netCDF file, without the ending."""

    def __init__(self, output: Path) -> None:
        if output.suffix != ".nc":
            raise DeckError(f"output {output}: expected a netCDF file, such as {output.with_suffix('.nc')}")
        require_ordinary(output, "a netCDF file")
        if not output.parent.is_dir():
            raise DeckError(f"cannot write {output}: the folder {output.parent} does not exist")
        self.output = output
        self.folder = output.with_suffix("")
        if self.folder.exists() and not self.folder.is_dir():
            raise DeckError(f"{self.folder} is a file; the study needs a folder of this name for its cases")
        there = os.listdir(self.folder) if self.folder.is_dir() else []
        if there and not {INDEX, "lock"} & set(there):
            raise DeckError(
                f"the folder {self.folder} holds other things than cases of a study; choose another output"
            )
        self.numbers: dict[str, int] = {}
        self._entries: dict[str, Any] = {}
        if (self.folder / INDEX).exists():
            self._read()

    def _read(self) -> None:
        path = self.folder / INDEX
        content = text_of(path, "the index of a study")
        try:
            self._entries = json.loads(content)["cases"]
            self.numbers = {name: operator.index(entry["number"]) for name, entry in self._entries.items()}
            numbers = sorted(self.numbers.values())
            if len(set(numbers)) < len(numbers) or any(not 1 <= n <= 10**9 for n in numbers):
                raise ValueError("its numbers are not those of cases")
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise DeckError(f"{path} is damaged ({error}); move the folder {self.folder} away") from None

    def lock(self) -> Lock:
        """Lock the folder against other runs of the study, up to `Lock.release`."""
        self.folder.mkdir(exist_ok=True)
        return Lock(self.folder / "lock", self.folder)

    def enter(self, plan: Plan) -> None:
        """Assign numbers to the cases and write the index, if any case is new."""
        new = [case.hash for case in plan.cases if case.hash not in self._entries]
        if not new:
            return
        self.folder.mkdir(exist_ok=True)
        self.assign(plan)
        for case in plan.cases:
            if case.hash in new:
                number = self.numbers[case.hash]
                self._entries[case.hash] = {"number": number, "parameters": dict(case.settings)}
        self._write(INDEX, {"index_version": 1, "cases": self._entries})

    def assign(self, plan: Plan) -> None:
        """Assign numbers to the cases without writing the index."""
        new = dict.fromkeys(case.hash for case in plan.cases if case.hash not in self.numbers)
        start = max(self.numbers.values(), default=0) + 1
        self.numbers |= {name: number for number, name in enumerate(new, start=start)}

    def _write(self, name: str, content: Any) -> None:
        text = json.dumps(content, indent=1, ensure_ascii=False, default=str)
        try:
            with replacing(self.folder / name) as path:
                path.write_text(text, encoding="utf-8")
        except OSError as error:
            raise ResourceError(f"cannot write {self.folder / name}: {error.strerror or error}") from error

    def number(self, case: PlannedCase) -> int:
        """Return the number of a case, from 1."""
        return self.numbers[case.hash]

    def path(self, case: PlannedCase) -> Path:
        """Return the file of a case."""
        return self.folder / f"{self.number(case):04d}.nc"

    def done(self, case: PlannedCase) -> bool:
        """Return whether the file of a case is complete and holds this case, with its tables beside it."""
        path = self.path(case)
        return holds(path, case.hash) and not (stress_files(case.deck, path) and missing_stresses(path))

    def failure(self, case: PlannedCase) -> Outcome | None:
        """Return the failure in the note of a case; None without one."""
        with contextlib.suppress(DeckError, ValueError, TypeError, AttributeError, RecursionError):
            note = json.loads(text_of(self.path(case).with_suffix(".json"), "a note"))
            outcome = Outcome(**{"hexcontact_version": "", **note})
            whole = type(outcome.exit_code), type(outcome.message), type(outcome.lasting)
            if outcome.hash == case.hash and whole == (int, str, bool) and outcome.message.strip():
                return outcome
        return None

    def _is_final(self, case: PlannedCase) -> bool:
        """Return whether a case would fail again: for its own reasons, in this version of the program."""
        failure = self.failure(case)
        if failure is None or not failure.lasting:
            return False
        return failure.exit_code in _FINAL and failure.hexcontact_version == __version__

    def missing(self, cases: Iterable[PlannedCase], retry: bool = False) -> list[PlannedCase]:
        """Return the cases to run; with `retry` also those that would fail again."""
        wanted = {case.hash: case for case in cases}
        return [
            case
            for case in wanted.values()
            if not (case.fault or self.done(case)) and (retry or not self._is_final(case))
        ]

    def note(self, case: PlannedCase, outcome: Outcome) -> None:
        """Record the outcome of a case, and remove files of its attempts."""
        path = self.path(case)
        if outcome.exit_code:
            self._write(f"{path.stem}.json", dataclasses.asdict(outcome))
            return
        path.with_suffix(".json").unlink(missing_ok=True)
        pattern = re.compile(re.escape(path.stem) + r"\.[0-9a-f]{8}\.nc(\.d)?")
        for name in os.listdir(self.folder):
            if pattern.fullmatch(name):
                left = self.folder / name
                if left.is_dir():
                    shutil.rmtree(left, ignore_errors=True)
                else:
                    left.unlink(missing_ok=True)
