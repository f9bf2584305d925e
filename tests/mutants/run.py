"""Mutation testing: which wrong lines do the tests notice?

    python tests/mutants/run.py                     all stages; goes on where it was stopped
    python tests/mutants/run.py --until check       not the whole suite
    python tests/mutants/run.py --only python       the mutants of pydriver/ alone
    python tests/mutants/run.py --again             survivors once more, after tests were added
    python tests/mutants/run.py --write             put the tables into docs/measurements.md

A seed draws mutants of fortran/ and pydriver/: an operator, a constant or a whole line is changed in a copy
of the checkout below build/mutants. Each meets the tests of its own file, then those of `make check`;
survivors meet the whole suite, which stops at the first failure. Mutants that equivalents.toml names with the
reason behave as the line they come from: no test can tell.
"""

from __future__ import annotations

import argparse
import fcntl
import json
import os
import re
import sys
import time
import tomllib
from collections.abc import Collection
from dataclasses import asdict
from datetime import date
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parents[1] / "python")]

from arrows import imports_of
from bench import report

from mutants.sites import Mutant, drawn
from mutants.tree import ROOT, Tree

NUMBERS = {"fortran": 40, "python": 20}
STAGES = ("folder", "check", "suite")
GOALS = {"check": 70, "suite": 90}  # percent
FOLDER = ROOT / "build/mutants"
EQUIVALENTS = Path(__file__).parent / "equivalents.toml"

Row = dict[str, Any]


class Table:
    """What was found, on the disk, where runs for Fortran and Python may add at the same time."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def rows(self) -> dict[str, Row]:
        return json.loads(self.path.read_text()) if self.path.exists() else {}

    def add(self, key: str, row: Row) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.with_suffix(".lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            rows = self.rows() | {key: row}
            new = self.path.with_suffix(".new")
            new.write_text(json.dumps(rows, indent=1))
            new.replace(self.path)


def suites() -> list[str]:
    """Return the Fortran suites."""
    return re.findall(r"^  '(\w+)',$", (ROOT / "tests/fortran/meson.build").read_text(), re.MULTILINE)


def tests_of(path: str) -> tuple[list[str], list[str]]:
    """Return the Fortran suites that use a folder of fortran/, and the Python tests that import a module."""
    file = ROOT / path
    if path.startswith("fortran"):
        modules = {f"hc_{other.stem}" for other in file.parent.glob("*.f90")}
        texts = {suite: (ROOT / f"tests/fortran/test_{suite}.f90").read_text() for suite in suites()}
        uses = {suite: re.findall(r"^ *use (\w+)", text, re.MULTILINE) for suite, text in texts.items()}
        table = tomllib.loads((ROOT / "fortran/python/procedures.toml").read_text())
        known = set(re.findall(r"\w+", table["use"].get(f"hc_{file.stem}", "")))
        rows = [
            name for name, row in table["procedures"].items() if known & {*re.findall(r"\w+", row["calls"])}
        ]
        calls = re.compile(rf"\bflat\.({'|'.join(rows) or '-'})\b")
        core = (ROOT / "pydriver/hexcontact/core").glob("*.py")
        callers = [f"hexcontact.core.{other.stem}" for other in core if calls.search(other.read_text())]
        return [suite for suite in suites() if modules & set(uses[suite])], importing(callers)
    module = ".".join(Path(path).relative_to("pydriver").with_suffix("").parts)
    return [], importing([module]) or importing([module.rpartition(".")[0]])


def importing(modules: Collection[str]) -> list[str]:
    """Return the files of Python tests that import one of some modules, or a module of one of some rooms."""
    starts = tuple(f"{module}." for module in modules)
    tests = sorted((ROOT / "tests/python").glob("test_*.py")) if starts else []
    return [
        f"tests/python/{test.name}"
        for test in tests
        if any(f"{name}.".startswith(starts) for name in imports_of(test, ""))
    ]


def examined(tree: Tree, mutant: Mutant, until: str, processes: int) -> Row:
    """Run the stages on a mutant; return what killed it in each: an empty text if nothing did."""
    row: Row = asdict(mutant)
    using, tests = tests_of(mutant.path)
    slow = [word for word in (ROOT / "tests/check.txt").read_text().split() if word.startswith("--")]
    with tree.changed(mutant) as reason:
        if reason:
            return row | {"invalid": reason}
        row["folder"] = tree.fortran(using) or (tests and tree.python([*tests, *slow])) or ""
        row["check"] = row["folder"]
        if not row["check"] and mutant.path.startswith("fortran"):
            row["check"] = tree.fortran([suite for suite in suites() if suite not in using])
        row["check"] = row["check"] or tree.python(["@tests/check.txt"])
        if until == "suite" and not row["check"]:
            row["suite"] = tree.python([*tests, "tests/python", "-m", "not alone"], processes)
    return row


def killed_by(row: Row, stage: str) -> str | None:
    """Return the test that kills a mutant up to a stage; None: it was not tried."""
    return row.get("check") or row.get(stage)


def run(language: str, arguments: argparse.Namespace) -> None:
    """Examine the mutants of a language that the table does not have yet."""
    table = Table(arguments.table)
    tree = Tree(FOLDER / language, arguments.build if language == "python" else None)
    tree.renew()
    if not arguments.trust:
        failure = (language == "fortran" and tree.fortran(suites())) or tree.python(["@tests/check.txt"])
        if failure:
            raise SystemExit(f"without any mutant: {failure}")
    count = 0
    for mutant in drawn(ROOT, language, arguments.seed):
        row = table.rows().get(mutant.key, {})
        if "invalid" in row:
            continue
        count += 1
        if count > arguments.numbers[language]:
            break
        equivalent = mutant.key in equivalents()
        left = killed_by(row, arguments.until) is None or (arguments.again and not killed_by(row, "suite"))
        if equivalent or not left:
            if equivalent and not row:
                table.add(mutant.key, asdict(mutant))
            continue
        began = time.monotonic()
        row = examined(tree, mutant, arguments.until, arguments.processes)
        table.add(mutant.key, row | {"seconds": round(time.monotonic() - began)})
        count -= "invalid" in row
        found = row.get("invalid") or killed_by(row, arguments.until) or "SURVIVED"
        print(f"{count:3} {mutant.path}:{mutant.number} {mutant.change}: {found}", flush=True)


def equivalents() -> dict[str, str]:
    """Return why mutants, by their keys, are no different."""
    entries = tomllib.loads(EQUIVALENTS.read_text()).get("mutant", [])
    return {f"{entry['file']}: {entry['line']} -> {entry['changed']}": entry["reason"] for entry in entries}


def tables(rows: dict[str, Row], seed: int, numbers: dict[str, int]) -> list[report.Table]:
    """Return how many mutants were killed, and by what each was."""
    reasons = equivalents()
    summary = report.Table(
        f"Mutants of seed {seed}",
        [
            "lines of",
            "mutants",
            "not compiled",
            "compiled to the same",
            "equivalent",
            "killed by `make check`",
            "by the suite",
        ],
    )
    each = report.Table("Each mutant", ["line", "change", "killed by"])
    for language, number in numbers.items():
        chosen: list[Row] = []
        invalid = {"does not compile": 0, "compiles to the same": 0}
        for mutant in drawn(ROOT, language, seed):
            if len(chosen) == number:
                break
            row = rows.get(mutant.key, {})
            if "invalid" in row:
                invalid[row["invalid"]] += 1
            else:
                chosen.append(row | asdict(mutant) | {"reason": reasons.get(mutant.key)})
        judged = [row for row in chosen if not row["reason"]]
        shares = [_share([killed_by(row, stage) for row in judged]) for stage in GOALS]
        counts = [len(chosen), *invalid.values(), len(chosen) - len(judged)]
        summary.add("`fortran/`" if language == "fortran" else "`pydriver/`", *map(str, counts), *shares)
        for row in chosen:
            path = row["path"].removeprefix("fortran/").removeprefix("pydriver/hexcontact/")
            where = f"`{path}:{row['number']}`"
            change = re.sub(r"(.+) for (.+)", r"`\1` for `\2`", row["change"]).replace("`nothing`", "nothing")
            killer = killed_by(row, "suite")
            found = "not tried" if row.get("check") is None else "not by `make check`"
            if killer is not None:
                found = f"`{killer}`{'' if row['check'] else ' (suite)'}" if killer else "**not killed**"
            if row["reason"]:
                found = f"equivalent: {row['reason']}"
            each.add(where, change, found)
    return [summary, each]


def _share(killers: list[str | None]) -> str:
    """Return how many were killed, of those that were tried."""
    tried = [killer for killer in killers if killer is not None]
    killed = sum(bool(killer) for killer in tried)
    percent = f" ({100 * killed / len(tried):.0f} %)" if tried else ""
    left = f", {len(killers) - len(tried)} not tried" if len(tried) < len(killers) else ""
    return f"{killed} of {len(tried)}{percent}{left}"


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=NUMBERS, help="mutants of one language")
    parser.add_argument("--build", type=Path, default=ROOT / "build/release", help="where the extension is")
    parser.add_argument("--number", type=int, help="mutants of each language; usually 40 and 20")
    parser.add_argument("--until", choices=STAGES[1:], default="suite", help="last stage")
    parser.add_argument("--again", action="store_true", help="examine survivors once more")
    parser.add_argument("--trust", action="store_true", help="do not run the tests without a mutant first")
    parser.add_argument("--processes", type=int, default=2, help="of the suite")
    parser.add_argument("--write", action="store_true", help="put the table of what is known into its page")
    arguments = parser.parse_args()
    arguments.table = FOLDER / f"table-{arguments.seed}.json"
    arguments.numbers = {name: arguments.number or number for name, number in NUMBERS.items()}
    os.nice(19 - os.nice(0))
    if not arguments.write:
        for language in [arguments.only] if arguments.only else NUMBERS:
            run(language, arguments)
    found = tables(Table(arguments.table).rows(), arguments.seed, arguments.numbers)
    print("\n\n".join(table.text() for table in found))
    if arguments.write:
        report.write("mutants", found, f"{date.today()}, `make mutants`")


if __name__ == "__main__":
    main()
