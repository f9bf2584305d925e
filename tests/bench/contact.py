"""CONTACT (Vollebregt, Kalker), built from its source, on the same load histories side by side."""

from __future__ import annotations

import math
import os
import re
import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from . import driver, memory, peers, problems, speed, worker
from .report import Table, seconds

SOURCE = os.environ.get("CONTACT_SOURCE", "https://github.com/eve70a/CONTACT.git")
COMMIT = "d431cdb"
LIBRARIES = peers.Peer("CONTACT", "", (("--no-deps", "mkl==2023.2.0", "intel-openmp==2023.2.0"),))
"""MKL of 2026 fails: its transforms of the layout that CONTACT asks for are wrong."""

PORTED = (
    ("m_timings.f90", r"omp_in_parallel\(\)\.(ne|gt)\.0", "omp_in_parallel()"),
    ("m_licensing.f90", r"(?m)^function LicenseGetDebug$", "function LicenseGetDebug()"),
    ("m_licensing.f90", r"(?ms)^function DirIsWritable.*^end subroutine ScanFolder", ""),
    ("m_licensing.f90", r"(?m)^ *public +(DirIsWritable|ScanFolder).*$", ""),
    ("m_bspline_make.f90", r"any\(mask\((.*?)\)\.ne\.mask", r"any(mask(\1).neqv.mask"),
    ("m_gridfunc.f90", r"(?m)^ *use m_globals *$", "use m_globals, text_length => strlen"),
    ("m_readline.f90", r"fmt='\(i\)'", "fmt='(i16)'"),
    ("m_temperature.f90", r"=> igs%", "=> outpt%igs%"),
    ("m_varprof.f90", r"if \(is_wheel\) ", "if (is_wheel.ne.0) "),
    ("m_wr_output.f90", r"if \(is_right\) ", "if (is_right.ne.0) "),
    ("makefile", r"-assume bscc \$< -o \$\*\.o", "$< -o $(P)m_readline.o"),
)
"""What gfortran takes in other words than Intel's compiler: file, pattern, replacement."""

LENGTH, RADIUS, SHEAR_MODULUS = 1.0, 50.0, 200.0
"""Contact radius and relative radius of curvature in mm, MPa: the size of CONTACT's own examples."""

WINDOWS = speed.HISTORIES
LONG_ENOUGH = 3.0
"""Seconds of a process whose start is not worth a repetition."""

TOLERANCES = (problems.TOLERANCE, problems.LOOSE)


def measure(folder: Path, *, quick: bool, sizes: Sequence[int] | None = None) -> list[Table]:
    """Return the times of load histories, small contacts and processes of both codes, in turns."""
    histories = Table(
        "CONTACT over ours: load histories, half of the window in contact, one thread, set-up included",
        [
            *("history", "window", "CONTACT [s]", "ours [s]", "times faster", "goal"),
            *("CONTACT at 10⁻⁵ [s]", "ours [s]", "times faster", "goal", "stick, CONTACT", "ours"),
        ],
        remarks=[
            "CONTACT: what a process with several repetitions of a history takes longer than one with a "
            "single one, without output; ours: the best set-up and the best solution in a process. The "
            "tolerance of CONTACT bounds the change of the tractions in an iteration, ours all residuals. "
            "Stick: its share of the contact after the last step.",
            f"CONTACT: source {COMMIT}, gfortran with -O3, transforms of MKL 2023.2.",
        ],
    )
    others = Table(
        "CONTACT over ours: one load step at once from nothing, and whole processes",
        ["what", "CONTACT [s]", "ours [s]", "times faster", "goal"],
    )
    try:
        program = Program.build(folder)
    except peers.Missing as reason:
        histories.remarks.append(f"Not measured: CONTACT is not there: {reason}")
        return [histories]
    for name, windows in WINDOWS.items():
        for side in [n for n in sizes or windows if n in windows][: 1 if quick else None]:
            add_history(histories, program, name, side, turns=1 if quick else 3)
    if not sizes:
        add_small(others, program, turns=1 if quick else 3)
        for side in (64,) if quick else (64, 128, 256):
            add_process(others, program, side, turns=1 if quick else 5)
    return [histories, others]


def add_history(table: Table, program: Program, name: str, side: int, turns: int) -> None:
    """Add the times of a load history at two tolerances."""
    problem = problems.LOADED[name]
    row = [problem.title.removesuffix(", mean"), f"{side}²"]
    zones: list[str] = []
    for tolerance in TOLERANCES:
        theirs = min(program.history(name, side, tolerance) for _ in range(turns))
        task = speed.task_of(name, side, 1, 3 if side < 256 else 1) | {"setups": 3}
        loose = tolerance == problems.LOOSE
        ours = worker.best([worker.run(task | {"loose": loose}) for _ in range(turns)], "setup", "solve")
        if "failed" in ours:
            table.add(*row, ours["failed"])
            return
        total = ours["setup"] + ours["solve"]
        row += [seconds(theirs), seconds(total), f"{theirs / total:.1f}", "≥ 8" if loose else "≥ 10"]
        zones = [f"{program.stick_share:.3f}", f"{ours['stick']:.3f}"]
    table.add(*row, *zones)
    print(f"  {table.rows[-1]}", flush=True)


def add_small(table: Table, program: Program, turns: int) -> None:
    """Add the load step of a small contact, pressed and sheared at once."""
    side = driver.SIDE
    theirs = min(program.history("AT_ONCE", side, problems.TOLERANCE, repeats=40) for _ in range(turns))
    found = worker.best(
        [worker.run({"problem": "small", "repeats": 30}, script=Path(driver.__file__)) for _ in range(turns)],
        "core",
        "case",
    )
    for title, ours in (("core, set-up included", found["core"]), ("Case.run", found["case"])):
        ratio = theirs / ours
        table.add(
            f"{side} × {side}, Q = µP/2 at once: {title}", seconds(theirs), seconds(ours), f"{ratio:.1f}", ""
        )
        print(f"  {table.rows[-1]}", flush=True)


def add_process(table: Table, program: Program, side: int, turns: int) -> None:
    """Add the whole process of two load steps, files of all nodes included."""
    words = [*driver.program(), "run", f"{side}.toml", "--overwrite"]
    with tempfile.TemporaryDirectory() as folder:
        deck = memory.deck("friction, alike", side, share=memory.HALF, steps=1)
        Path(folder, f"{side}.toml").write_text(deck)
        times = [
            (
                program.run(deck_of("HC", side, problems.TOLERANCE, 1, output=True))[0],
                driver.process(words, folder)[0],
            )
            for _ in range(turns)
        ]
    theirs, ours = (min(column) for column in zip(*times, strict=True))
    goal = "≥ 1" if side == 64 else ""
    table.add(
        f"process with files, HC, {side}²", seconds(theirs), seconds(ours), f"{theirs / ours:.2f}", goal
    )
    print(f"  {table.rows[-1]}", flush=True)


@dataclass
class Program:
    """The executable of CONTACT, and the share of the contact that stuck after the last history."""

    path: Path
    stick_share: float = math.nan

    @classmethod
    def build(cls, folder: Path) -> Program:
        """Return the program, which is built the first time; raise `peers.Missing` with the reason."""
        python = Path(peers.interpreter(LIBRARIES, folder))
        home = python.parents[1]
        program = cls(home / "source" / "bin" / "contact_linux64")
        if not program.path.exists():
            print(f"  building CONTACT in {home}", flush=True)
            fetch(home / "source")
            compile_source(home / "source", home / "lib")
            program.check(home / "source" / "examples")
        return program

    def check(self, examples: Path) -> None:
        """Compare the zones of its example of Cattaneo's problem with those that come with it."""
        deck, expected = (
            (examples / name).read_text(encoding="latin-1") for name in ("cattaneo.inp", "cattaneo.ref_out")
        )
        found = self.run(deck)[1]
        if found != zones(expected):
            self.path.unlink()
            raise peers.Missing(f"its example of Cattaneo's problem gives zones of {found} elements")

    def history(self, name: str, side: int, tolerance: float, repeats: int | None = None) -> float:
        """Return the seconds that a load history takes, without the start of the process."""
        single = deck_of(name, side, tolerance, 1)
        once, found = self.run(single)
        _, contact, stick, _ = found[-1]
        self.stick_share = stick / contact
        if once > LONG_ENOUGH:
            return once
        # what is subtracted must not be a disturbed time: the result would be too small
        once = min(once, *(self.run(single)[0] for _ in range(3)))
        repeats = repeats or min(20, math.ceil(1.0 / once))
        return (self.run(deck_of(name, side, tolerance, 1 + repeats))[0] - once) / repeats

    def run(self, deck: str) -> tuple[float, list[tuple[int, ...]]]:
        """Return the seconds of a process, and the zones of the cases that print results."""
        environment = worker.environment(1)
        environment |= {"MKL_INTERFACE_LAYER": "GNU", "MKL_THREADING_LAYER": "SEQUENTIAL"}
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "deck.inp").write_text(deck)
            start = time.perf_counter()
            done = subprocess.run(
                [str(self.path), "2", "deck"],
                cwd=folder,
                env=environment,
                capture_output=True,
                text=True,
                check=False,
            )
            spent = time.perf_counter() - start
            output = Path(folder, "deck.out").read_text(encoding="latin-1")
        if "The CONTACT program ended" not in done.stdout or "ERROR" in output:
            raise RuntimeError(f"CONTACT: {done.stdout.strip().splitlines()[-1]}")
        return spent, zones(output)


def fetch(source: Path) -> None:
    """Take the source from its repository, and port it to gfortran."""
    peers.call(["rm", "-rf", str(source)])
    peers.call(["git", "clone", "--quiet", "--no-checkout", SOURCE, str(source)])
    files = ("src", "examples/cattaneo.inp", "examples/cattaneo.ref_out")
    peers.call(["git", "-C", str(source), "checkout", "--quiet", COMMIT, "--", *files])
    for name, pattern, replacement in PORTED:
        path = source / "src" / name
        text, changes = re.subn(pattern, replacement, path.read_text(encoding="latin-1"))
        if not changes:
            raise peers.Missing(f"{name} has no {pattern}")
        path.write_text(text, encoding="latin-1")


def compile_source(source: Path, libraries: Path) -> None:
    """Build the program with the options of its makefile, as far as gfortran has them."""
    objects = source / "src" / "obj" / "linux64_exe"
    objects.mkdir(parents=True, exist_ok=True)
    (source / "bin").mkdir(exist_ok=True)
    # the last option: arrays are declared with one element in its copy of BLAS
    options = (
        f"-cpp -O3 -fopenmp -DTARGET_exe -DWITH_MKLFFT -I. -J{objects} -w "
        "-ffree-line-length-none -fbackslash -fno-aggressive-loop-optimizations"
    )
    peers.call(
        [
            *("make", "-C", str(source / "src"), "PROD=exe_l64", "F90=gfortran", f"FFOPTS={options}"),
            f"MKLLIB={libraries}/libmkl_rt.so.2 -Wl,-rpath,{libraries}",
        ]
    )


def zones(output: str) -> list[tuple[int, ...]]:
    """Return the numbers of elements: all, in contact, in stick, in slip, of each case."""
    rows = re.findall(r"NPOT +NCON +NADH +NSLIP.*\n +(\d+) +(\d+) +(\d+) +(\d+)", output)
    return [tuple(int(word) for word in row) for row in rows]


def materials(material: problems.Material) -> tuple[float, tuple[float, float]]:
    """Return Poisson's ratio and both shear moduli that have Dundurs' constant beta and gamma."""
    ratio = material.gamma / (1 + material.gamma)
    difference = material.beta * 2 * (1 - ratio) / (1 - 2 * ratio)
    return ratio, (SHEAR_MODULUS, SHEAR_MODULUS * (1 - difference) / (1 + difference))


AT_ONCE = problems.Problem("Q = 0.5 µP at once", problems.ALIKE, ((1, 0.5),), 1, 35)


def deck_of(name: str, side: int, tolerance: float, repeats: int, *, output: bool = False) -> str:
    """Return the input of CONTACT for a load history from nothing, several times.

    Pressed without shear, bodies keep their tangential position; sheared, Q_x is given. The
    last case prints global results; with `output` a file holds the fields of all elements.
    """
    problem = AT_ONCE if name == "AT_ONCE" else problems.LOADED[name]
    ratio, moduli = materials(problem.material)
    compliance = sum((1 - ratio) / (2 * modulus) for modulus in moduli)
    load = 4 / 3 * LENGTH**3 / (RADIUS * compliance)
    spacing = 2.7 * LENGTH / (side - 1) * math.sqrt(math.sqrt(3) / 2)  # as many elements in contact as nodes
    alike, mu = moduli[0] == moduli[1], problem.material.friction
    lines = [" 3  MODULE"]
    for repeat in range(repeats):
        sheared = False
        for step, (press, shear) in enumerate(problem.steps):
            new, last = step == 0, repeat == repeats - 1 and step == len(problem.steps) - 1
            sheared = sheared or shear != 0
            results, fields = 2 * last, 2 * (last and output)
            lines += [
                f" {2 * new}011{int(sheared)}0  P-B-T-N-F-S",
                f" 0{2 * new}{2 * new}0{2 * new}0  L-D-C-M-Z-E",
                f" 000{int(not new)}{fields}{results}0{int(last)}  X-H-G-I-A-O-W-R",
                f" 999 100 50 {1 if alike else 100} {tolerance:g}  MAXGS MAXIN MAXNR MAXOUT EPS",
                f" {press * load:.15g} {-shear:.15g} 0 0  FN FX CETA CPHI",
                f" {mu} {mu}  FSTAT FKIN",
            ]
            if new:
                corner = -spacing * side / 2
                width = f"{spacing:.15g} {spacing:.15g}"
                lines += [
                    f" {ratio:.15g} {ratio:.15g} {moduli[0]:.15g} {moduli[1]:.15g}  POISS GG",
                    " 1  IPOTCN",
                    f" {side} {side} {corner:.15g} {corner:.15g} {width}  MX MY XL YL DX DY",
                    " 1 1  IBASE IPLAN",
                    f" {0.5 / RADIUS} 0 {0.5 / RADIUS} 0 0 0  B",
                ]
    return "\n".join([*lines, " 0  MODULE", ""])
