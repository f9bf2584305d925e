"""A copy of the checkout with a build of its own, in which one line at a time is changed."""

from __future__ import annotations

import json
import os
import re
import resource
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from mutants.limit import SECONDS
from mutants.sites import Mutant

ROOT = Path(__file__).parents[2]
WALL = 3600  # seconds after which a run of tests stands still


class Tree:
    """The copy in a folder, which is made if it is not there; only what differs is copied and built.

    Without changes of Fortran the extension that a folder already holds is enough.
    """

    def __init__(self, folder: Path, extension: Path | None = None) -> None:
        self.extension = extension
        self.root, self.build, self.temporary = folder / "tree", folder / "build", folder / "tmp"
        self.at = folder / "at"
        self.environment = os.environ | {
            "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
            "PYTHONPATH": os.pathsep.join(str(self.root / name) for name in ("pydriver", "tests")),
            "HEXCONTACT_REFERENCE": str(self.root / "tests/reference"),
            "OMP_NUM_THREADS": "1",
            "MUTANTS_AT": str(self.at),
        }

    def renew(self) -> None:
        """Copy what differs from the checkout, and build."""
        listed = subprocess.run(
            ["git", "ls-files", "-co", "--exclude-standard"],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=True,
        ).stdout.splitlines()
        for name in listed:
            source, copy = ROOT / name, self.root / name
            if source.is_file() and not (copy.exists() and copy.read_bytes() == source.read_bytes()):
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(source, copy)
        for name in ("fortran", "pydriver", "tests"):
            for copy in (self.root / name).rglob("*"):
                kept = copy.is_dir() or copy.suffix in {".so", ".pyc"} or copy.name == "flat.py"
                if not kept and copy.relative_to(self.root).as_posix() not in listed:
                    copy.unlink()
        if not self.extension and not (self.build / "build.ninja").exists():
            options = "-Dpython=true", "-Dtests=true", "-Dbuildtype=release"
            self._run(["meson", "setup", str(self.build), str(self.root), *options], check=True)
        self.make(check=True)

    def make(self, check: bool = False) -> bool:
        """Build; return whether that worked."""
        if not self.extension and self._run(["ninja", "-C", str(self.build)], check=check).returncode:
            return False
        built = (self.extension or self.build) / "pydriver"
        for made in (*built.glob("_core*.so"), built / "flat.py"):
            shutil.copy2(made, self.root / "pydriver/hexcontact/core")
        return True

    @contextmanager
    def changed(self, mutant: Mutant) -> Iterator[str]:
        """Change a line for as long as the context lasts; yield why there is nothing to test, or nothing."""
        path = self.root / mutant.path
        text, times = path.read_text(), path.stat()
        lines = text.splitlines(keepends=True)
        lines[mutant.number - 1] = lines[mutant.number - 1].replace(mutant.line, mutant.changed)
        path.write_text("".join(lines))
        try:
            if path.suffix == ".py":
                # times of their own, by which Python knows what it has compiled
                os.utime(path, (times.st_atime, times.st_mtime + 1))
                yield ""
            elif list(self.build.glob(f"fortran/*/{path.stem}_*.f90")):  # the same text in another precision
                yield "" if self.make() else "does not compile"
            else:
                with self._compiled(path, text, times) as reason:
                    yield reason
        finally:
            if path.read_text() != text:
                path.write_text(text)
                if path.suffix == ".py":
                    os.utime(path, (times.st_atime, times.st_mtime + 2))

    @contextmanager
    def _compiled(self, path: Path, text: str, times: os.stat_result) -> Iterator[str]:
        """Compile one file alone: what uses it needs no new compilation, as interfaces stay."""
        commands = json.loads((self.build / "compile_commands.json").read_text())
        of_file = [entry for entry in commands if (self.build / entry["file"]).resolve() == path.resolve()]
        objects = [self.build / entry["output"] for entry in of_file]
        before = [file.read_bytes() for file in objects]
        failed = any([self._run(shlex.split(entry["command"])).returncode for entry in of_file])
        os.utime(path, (times.st_atime, times.st_mtime))
        try:
            if failed:
                yield "does not compile"
            elif [file.read_bytes() for file in objects] == before:
                yield "compiles to the same"
            else:
                self.make(check=True)
                yield ""
        finally:
            path.write_text(text)
            os.utime(path, (times.st_atime, times.st_mtime))
            for file, content in zip(objects, before, strict=True):
                file.write_bytes(content)

    def fortran(self, suites: Sequence[str]) -> str:
        """Run suites of the Fortran tests up to the first failure, which is returned."""
        for suite in suites:
            done = self._run([str(self.build / "tests/fortran/tester"), suite], limit=SECONDS)
            if done.returncode:
                named = re.search(r"^FAILED  (\S+ .+?):", done.stdout, re.MULTILINE)
                return named[1] if named else f"{suite}: {_ended(done.returncode)}"
        return ""

    def python(self, words: Sequence[str], processes: int = 0) -> str:
        """Run Python tests up to the first failure, which is returned."""
        shutil.rmtree(self.temporary, ignore_errors=True)
        self.at.write_text("")
        pytest = [
            sys.executable,
            "-m",
            "pytest",
            "-p",
            "mutants.limit",
            "-q",
            "-x",
            f"--numprocesses={processes}",
        ]
        kept = ["--dist=loadscope", f"--basetemp={self.temporary}"]
        done = self._run([*pytest, *kept, *words])
        if done.returncode in (0, 5):  # passed, or all are slow
            return ""
        named = re.search(r"^(?:FAILED|ERROR) tests/python/(\S+)", done.stdout, re.MULTILINE)
        at = self.at.read_text().removeprefix("tests/python/")
        return named[1] if named and done.returncode > 0 else f"{at or 'start'}: {_ended(done.returncode)}"

    def _run(
        self, words: Sequence[str], *, check: bool = False, limit: int = 0
    ) -> subprocess.CompletedProcess[str]:
        def limited() -> None:
            if limit:
                resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

        cwd = self.build if self.build.exists() and words[0] == "gfortran" else self.root
        with subprocess.Popen(
            words, cwd=cwd, env=self.environment, text=True, errors="replace", start_new_session=True,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, preexec_fn=limited,
        ) as process:  # fmt: skip
            try:
                output, _ = process.communicate(timeout=WALL)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, 9)
                output, _ = process.communicate()
        if check and process.returncode:
            raise SystemExit(output)
        return subprocess.CompletedProcess(words, process.returncode, output)


def _ended(code: int) -> str:
    return {-24: "time limit", -9: "time limit"}.get(code, "crash" if code < 0 else "stopped")
