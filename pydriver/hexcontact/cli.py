"""The command ``hexcontact``.

Every command imports what it needs when it runs, so that ``hexcontact --help`` comes at once.
"""

from __future__ import annotations

import contextlib
import enum
import functools
import os
import signal
import sys
import threading
import tomllib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, ParamSpec, TypeVar

import typer

from . import __version__, plot_choices
from .errors import DeckError, HexcontactError, ResourceError

if TYPE_CHECKING:
    from .case import Case
    from .result import Result, Step
    from .store import Store

P = ParamSpec("P")
R = TypeVar("R")

app = typer.Typer(
    name="hexcontact",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def main() -> None:
    """Entry point of the command."""
    # Threads that wait spin by default, which on a busy machine takes the core from those that work.
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # a terminal without µ gets a question mark, not a traceback
    app()


def _fail(message: str, code: int) -> NoReturn:
    for line in message.splitlines() or [""]:
        print(f"hexcontact: {line}", file=sys.stderr)
    raise typer.Exit(code)


def _guarded(command: Callable[P, R]) -> Callable[P, R]:
    """Turn what goes wrong into a sentence and an exit code; HEXCONTACT_DEBUG=1 shows tracebacks instead."""

    @functools.wraps(command)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return command(*args, **kwargs)
        except BrokenPipeError:
            raise
        except KeyboardInterrupt:
            _fail("interrupted", 130)
        except Exception as error:
            if os.environ.get("HEXCONTACT_DEBUG"):
                raise
            if isinstance(error, HexcontactError):
                _fail("\n".join([str(error), *getattr(error, "__notes__", ())]), error.exit_code)
            if isinstance(error, MemoryError):
                _fail("the machine has not enough memory for this", ResourceError.exit_code)
            if isinstance(error, OSError) and error.strerror:
                named = f"{error.filename}: " if error.filename else ""
                _fail(named + error.strerror, DeckError.exit_code)
            if isinstance(error, RuntimeError | OSError) and "NetCDF" in str(error):
                _fail(f"the result file is damaged ({error})", DeckError.exit_code)
            raise

    return wrapped


# --- interruption ---------------------------------------------------------------------------------


_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)  # the last comes from Slurm, before a time limit


class _Interrupted(BaseException):
    """A signal has come that ends the run."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.name = signal.Signals(number).name
        self.exit_code = 128 + number


@contextlib.contextmanager
def _news() -> Iterator[tuple[int, int]]:
    """Open a pipe into which the signals that end a run put their numbers, in the order they come.

    They raise nothing, wherever they come, so that leaving is not interrupted by those that follow.
    """
    old = {number: signal.getsignal(number) for number in _SIGNALS}
    heeded = {number: handler for number, handler in old.items() if handler not in (signal.SIG_IGN, None)}
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    former = signal.set_wakeup_fd(writer)
    try:
        for number in heeded:
            signal.signal(number, lambda *_: None)
        yield reader, writer
    finally:
        for number, handler in heeded.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(former)
        os.close(reader)
        os.close(writer)


def _in_background(work: Callable[[], None], news: tuple[int, int]) -> None:
    """Do `work` in a second thread while this one waits for it, and for signals.

    The compiled core cannot be interrupted; a thread that waits can.
    """
    reader, writer = news
    raised: list[BaseException] = []

    def worker() -> None:
        try:
            work()
        except BaseException as error:
            raised.append(error)
        os.write(writer, bytes([0]))  # is the number of no signal

    threading.Thread(target=worker, daemon=True).start()
    if number := os.read(reader, 1)[0]:
        raise _Interrupted(number)
    if raised:
        raise raised[0]


def _leave(store: Store, signaled: _Interrupted) -> NoReturn:
    """Say what is kept after an interruption and end the process, whatever the core is doing."""
    store.close(f"interrupted ({signaled.name})")
    kept = store.kept if store.heads else "no load step was finished"
    with contextlib.suppress(OSError):  # nobody listens any more
        print(f"hexcontact: interrupted; {kept}", file=sys.stderr)
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(signaled.exit_code)


# --- commands -------------------------------------------------------------------------------------


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"hexcontact {__version__}")
        raise typer.Exit()


@app.callback(epilog="Example: hexcontact new sphere, then hexcontact run sphere.toml --plot")
def _hexcontact(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    """Elastic contact in 3-D from a deck in TOML: pressure, shear traction, stick and slip, approach, shift.

    Exit codes: 0 done, 2 wrong input, 3 no convergence, 4 not enough memory or disk; 130, 138, 143 stopped.
    """


DeckFile = Annotated[Path, typer.Argument(metavar="DECK", help="The deck, a TOML file.", show_default=False)]
ResultFile = Annotated[
    Path, typer.Argument(metavar="FILE", help="The result, a netCDF file.", show_default=False)
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Replace a key of the deck, as grid.spacing='0.05 mm'. Repeatable."
    ),
]


_PICTURES = (".png", ".pdf", ".svg")


class Kind(enum.StrEnum):
    """Kinds of pictures."""

    png = "png"
    pdf = "pdf"
    svg = "svg"


class Arrows(enum.StrEnum):
    """Arrows that a zone map may have."""

    none = "none"
    traction = "traction"
    slip = "slip"


def _case(deck: Path, settings: list[str] | None) -> Case:
    from .case import Case

    return Case.from_toml(deck, overrides=dict(map(_setting, settings or ())))


def _target(case: Case, deck: Path, output: Path | None = None) -> Path:
    """Return the file that a run writes: what the user, else the deck, else the deck's name says."""
    target = output or case.output.file or Path(f"{deck.stem}.nc")
    if target.suffix in _PICTURES:
        raise DeckError(f"output {target}: expected a netCDF file, such as {target.with_suffix('.nc')}")
    if not target.parent.is_dir():
        there = target.parent.exists()
        fault = f"{target.parent} is not a folder" if there else f"the folder {target.parent} does not exist"
        raise DeckError(f"cannot write {target}: {fault}")
    return target


def _setting(text: str) -> tuple[str, Any]:
    """Split KEY=VALUE; a value that is not TOML is text, so that units need no quotes."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise DeckError(f"--set {text}: expected KEY=VALUE, such as load.1.normal_load='20 N'")
    try:
        return key.strip(), tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return key.strip(), value.strip()


@app.command(epilog="Example: hexcontact run cases/hertz_spheres.toml --plot")
@_guarded
def run(
    deck: DeckFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="File to write; default: the deck's output.file, or DECK.nc here."
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an output that is there.")] = False,
    plot: Annotated[bool, typer.Option("--plot", help="Draw the result beside the output (.png).")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
    settings: Settings = None,
) -> None:
    """Solve a deck; each load step is safe on the disk before the next begins."""
    from . import solve
    from .store import Store

    case = _case(deck, settings)
    target = _target(case, deck, output)
    with _news() as news, Store(target, solve.metadata_of(case), overwrite) as store:
        histories = _solved(case, store, news, deck.stem, quiet)
    picture = _overview(store.path) if plot else None
    if not quiet:
        _summarize(case, histories, target, picture)


@app.command(epilog="Example: hexcontact resume fretting.nc")
@_guarded
def resume(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The output of the run.", show_default=False)],
    plot: Annotated[bool, typer.Option("--plot", help="Draw the result beside the output (.png).")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Change how the further steps are solved, as solver.tolerance=1e-7. Repeatable.",
        ),
    ] = None,
) -> None:
    """Go on with a run that was interrupted or killed, met a full disk or did not converge.

    The result is to the bit that of a run in one go, on the same machine with as many threads.
    """
    from . import restart

    overrides = dict(map(_setting, settings or ()))
    with _news() as news, restart.reopened(file, overrides=overrides) as again:
        if again is not None:
            if again.warning:
                print(f"hexcontact: warning: {again.warning}", file=sys.stderr)
            histories = _solved(again.case, again.store, news, file.stem, quiet, again.before)
    path = file if again is None else again.store.path
    picture = _overview(path) if plot else None
    if quiet:
        return
    if again is not None:
        _summarize(again.case, histories, path, picture)
    else:
        print(
            f"{file} is finished, all its load steps are there" + (f"; written: {picture}" if picture else "")
        )


def _solved(
    case: Case,
    store: Store,
    news: tuple[int, int],
    name: str,
    quiet: bool,
    before: Sequence[Step] = (),
) -> list[Any]:
    """Solve a case into a store and return the histories of all its steps; signals end the process."""
    from . import solve
    from .progress import reporter

    shown, histories = reporter(quiet), [step.history for step in before]
    title = (case.title or name) + (f", after step {len(before)}" if before else "")
    try:
        with shown.watching(title, len(case.load_steps)):
            _in_background(
                lambda: solve.record(case, store, shown, lambda step: histories.append(step.history), before),
                news,
            )
    except _Interrupted as signaled:
        _leave(store, signaled)
    return histories


def _overview(path: Path) -> Path:
    from .plot_command import picture_of

    return picture_of([_open(path)], "overview", path.with_suffix(".png"), {})


def _summarize(case: Case, histories: list[Any], target: Path, picture: Path | None) -> None:
    from . import summary

    console, last = summary.console(), histories[-1]
    if len(histories) > 1:
        console.print(summary.history_table(histories, console))
    console.print(summary.pairs(f"Last load step of {case.title!r}" if case.title else "Last load step",
                                summary.step_rows(last)))  # fmt: skip
    if rows := summary.hertz_rows(case, last):
        console.print(summary.table("Against Hertz", summary.HERTZ_HEADERS, rows))
    console.print(f"written: {target}" + (f", {picture}" if picture else ""), soft_wrap=True)


@app.command(epilog="Example: hexcontact check fretting.toml --set grid.spacing='2 um'")
@_guarded
def check(deck: DeckFile, settings: Settings = None) -> None:
    """Read a deck, report everything that is wrong with it, and say what would be run."""
    from . import summary
    from .window import require_memory

    case = _case(deck, settings)
    console = summary.console()
    console.print(summary.pairs(case.title or deck.stem, summary.case_rows(case)))
    require_memory(case, case.lattice)
    _target(case, deck)
    console.print(f"{deck} is ready to run", soft_wrap=True)


@app.command(epilog="Example: hexcontact schema -o deck.schema.json")
@_guarded
def schema(
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File to write; default: print it.")
    ] = None,
) -> None:
    """Write the JSON schema of decks, with which editors complete keys and mark mistakes."""
    import json

    from .schema import deck_schema

    text = json.dumps(deck_schema(), indent=2, ensure_ascii=False) + "\n"
    if output is None or str(output) == "-":
        print(text, end="")
        return
    output.write_text(text, encoding="utf-8")
    print(f'written: {output}; first line of a deck that uses it: "#:schema {output}"')


@app.command(epilog="Example: hexcontact study cases/study_friction.toml --jobs 4")
@_guarded
def study(
    file: Annotated[
        Path, typer.Argument(metavar="STUDY", help="The study, a TOML file.", show_default=False)
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="Result; default: the study's output, or STUDY.nc here. Cases go beside it.",
        ),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option("--jobs", "-j", help="Cases at a time on this machine; default: the cores.")
    ] = None,
    dask: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Run on a Dask cluster, as tcp://host:8786.")
    ] = None,
    slurm: Annotated[bool, typer.Option("--slurm", help="Print a job array for sbatch instead.")] = False,
    case: Annotated[
        int | None, typer.Option(metavar="N", help="Run only case N (what a job array does).")
    ] = None,
    collect: Annotated[
        bool, typer.Option("--collect", help="Run nothing, put together what is there.")
    ] = False,
    retry: Annotated[bool, typer.Option("--retry", help="Run cases that failed again.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Run the missing ones of many cases that differ in keys of one deck; exit code 3 if some failed."""
    from . import study_command as command
    from .study import Study

    if sum([slurm, case is not None, collect, dask is not None, jobs is not None]) > 1:
        raise DeckError("expected only one of --jobs, --dask, --slurm, --case and --collect")
    planned = Study.from_toml(file, output, check=case is None and not collect)
    if slurm:
        print(command.slurm_script(planned, file, retry) or "# no case is missing")
        return
    if case is not None:
        outcome = planned.run_case(case, retry)
        if outcome.exit_code:
            _fail(outcome.message, outcome.exit_code)
        return
    if collect:
        planned.collect()
    else:
        cancel = threading.Event()
        options = {"jobs": jobs, "dask": dask, "retry": retry, "watcher": command.watcher(quiet)}
        work, over = command.run_in_background(planned, cancel, options)
        with _news() as news:
            try:
                _in_background(work, news)
            except _Interrupted as signaled:
                cancel.set()
                over.wait()
                _fail(f"interrupted; {command.interrupted(planned)}", signaled.exit_code)
    if code := command.report(planned, quiet):
        raise typer.Exit(code)


@app.command(epilog="Example: hexcontact new sphere")
@_guarded
def new(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="Which starter deck.", show_default=False)
    ] = None,
    listing: Annotated[bool, typer.Option("--list", help="List the starter decks.")] = False,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="File to write; default: NAME.toml; - prints it."),
    ] = None,
) -> None:
    """Write a commented deck to start from."""
    from . import starters

    names = starters.names()
    if listing or name is None:
        print("\n".join(names))
        if not listing:
            raise DeckError("NAME is missing; expected one of the names above")
        return
    if name not in names:
        from .messages import did_you_mean, listed

        raise DeckError(f"NAME = {name}: expected {listed(names, 'or')}{did_you_mean(name, names)}")
    if str(output) == "-":
        print(starters.text(name), end="")
        return
    target = output or Path(f"{name}.toml")
    try:
        with target.open("x", encoding="utf-8") as file:
            file.write(starters.text(name))
    except FileExistsError:
        raise DeckError(f"{target} exists already; choose another name with --output") from None
    print(f"written: {target}; now: hexcontact run {target}")


@app.command(epilog="Example: hexcontact info hertz_spheres.nc")
@_guarded
def info(file: ResultFile) -> None:
    """Say what a result holds: origin, history, residuals, the last load step against Hertz."""
    from . import summary

    result = _open(file)
    case, console = summary.case_of(result), summary.console()
    histories = result.history.to_dict("records")
    console.print(summary.pairs(result.case_title, summary.file_rows(result)))
    console.print(summary.history_table(histories, console))
    console.print(summary.pairs("Last load step", summary.step_rows(histories[-1])))
    if case is not None and (rows := summary.hertz_rows(case, histories[-1])):
        console.print(summary.table("Against Hertz", summary.HERTZ_HEADERS, rows))


def _open(path: Path) -> Result:
    from .store import open_result

    return open_result(path)


@app.command(
    help=plot_choices.help_text(),
    epilog="Example: hexcontact plot fretting.nc --what tractions --step 15,20,25,30 --output cuts.pdf",
)
@_guarded
def plot(
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="FILE",
            help="The result, a netCDF file; several for zones, outlines and compliance.",
            show_default=False,
        ),
    ] = None,
    what: Annotated[str, typer.Option("--what", "-w", help="Which picture; see above.")] = "overview",
    step: Annotated[
        str | None,
        typer.Option(
            "--step",
            "-s",
            metavar="N,...",
            help="Load step, the first is 1; -1, the default: the last. Some "
            "pictures show several: 10,20,30.",
        ),
    ] = None,
    angle: Annotated[
        str | None,
        typer.Option(metavar="ANGLE", help="Direction of the line of section and tractions from x, degrees."),
    ] = None,
    through: Annotated[
        str | None,
        typer.Option(metavar="X,Y", help="A point of that line, as 10um,0um; default: the center."),
    ] = None,
    over: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="What the history is drawn over, as tangential_load_x."),
    ] = None,
    arrows: Annotated[
        Arrows | None, typer.Option(help="Arrows on zone maps: shear traction, or slip in the step.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="Picture to write (.png, .pdf, .svg); default: FILE_WHAT.png beside FILE."
        ),
    ] = None,
    kind: Annotated[
        Kind | None, typer.Option("--format", "-f", help="Kind of picture where --output names none.")
    ] = None,
) -> None:
    """Draw a result, or what belongs to none; its help is made of the choices there are."""
    from . import plot_command as command

    command.refuse_unknown(what, bool(files))
    given = {
        "step": None if step is None else command.steps_of(step),
        "angle": None if angle is None else command.angle_of(angle),
        "through": None if through is None else command.point_of(through),
        "over": over,
        "arrows": None if arrows is None else arrows.value,
    }
    chosen = {name: value for name, value in given.items() if value is not None}
    if output and kind:
        raise DeckError(f"--format {kind}: the name of --output {output} says what kind of picture it is")
    suffix = f".{kind or 'png'}"
    if not files:
        if chosen:
            raise DeckError(f"--{next(iter(chosen))}: not an option of --what {what}")
        print(f"written: {command.general_picture(what, output or Path(f'{what}{suffix}'))}")
        return
    results, first = [_open(file) for file in files], output or files[0].with_suffix(suffix)
    if what == "all":
        if len(files) > 1:
            raise DeckError(f"--what all shows one result; expected one FILE, not {len(files)}")
        print("\n".join(command.all_pictures(results[0], first, chosen)))
        return
    picture = first if output else first.with_stem(f"{first.stem}_{what}")
    print(f"written: {command.picture_of(results, what, picture, chosen)}")


@app.command(epilog="Example: hexcontact report fretting.nc")
@_guarded
def report(
    file: ResultFile,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Page to write (.html); default: FILE.html.")
    ] = None,
) -> None:
    """Write one HTML page that shows a result: inputs, history, maps of every load step, residuals."""
    from .report import write_report

    print(f"written: {write_report(_open(file), output or file.with_suffix('.html'))}")


@app.command(epilog="Example: hexcontact export fretting.nc --vtk")
@_guarded
def export(
    file: ResultFile,
    vtk: Annotated[
        bool, typer.Option("--vtk", help="A .vtu file by load step, a .pvd for ParaView.")
    ] = False,
    ugrid: Annotated[bool, typer.Option("--ugrid", help="A netCDF file with the fields on a mesh.")] = False,
    csv: Annotated[
        bool, typer.Option("--csv", help="The history as a table; with --step fields by node, too.")
    ] = False,
    step: Annotated[
        str | None, typer.Option("--step", "-s", metavar="N,...", help="Only these load steps; -1: the last.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder to write into; default: FILE_export beside FILE."),
    ] = None,
) -> None:
    """Write a result for other programs."""
    if not (vtk or ugrid or csv):
        raise DeckError("expected --vtk, --ugrid or --csv")
    from . import export as write
    from .plot_command import steps_of

    result, folder = _open(file), output or file.with_name(f"{file.stem}_export")
    steps, stem = None if step is None else steps_of(step), file.stem
    written = [write.to_vtk(result, folder, stem, steps)] if vtk else []
    written += [write.to_ugrid(result, folder / f"{stem}_ugrid.nc", steps)] if ugrid else []
    written += write.to_csv(result, folder, stem, steps) if csv else []
    print("\n".join(f"written: {path}" for path in written))


@app.command(epilog="Example: hexcontact verify")
@_guarded
def verify(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[NAME]...", help="Which comparisons; default: all.", show_default=False),
    ] = None,
    listing: Annotated[bool, typer.Option("--list", help="List the comparisons.")] = False,
    table: Annotated[bool, typer.Option("--table", help="Print Markdown tables.")] = False,
) -> None:
    """Compare with published, analytic and converged solutions; exit code 1 if a comparison fails."""
    from . import verify as comparisons

    raise typer.Exit(comparisons.main(names or [], table=table, listing=listing))
