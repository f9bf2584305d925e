"""The command ``hexcontact``: its sub-commands, each in a module with those of its kind.

Every command imports what it needs when it runs, so that ``hexcontact --help`` comes at once.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Annotated

import typer

from .._version import __version__
from ..solve import interruption
from . import deck as cli_deck
from . import plot_choices
from . import run as cli_solve
from . import show as cli_show
from .guard import Commands, standard_streams, warn_plainly

app = typer.Typer(
    name="hexcontact",
    cls=Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def main() -> None:
    """Entry point of the command."""
    # Threads that wait spin by default, which on a busy machine takes the core from those that work.
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    interruption.ends_process = True
    warn_plainly()
    with standard_streams():
        app()


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

    Exit codes: 0 done, 2 wrong input, 3 no convergence or accuracy, 4 memory or disk; 130, 138, 143 stopped.
    """


_EXAMPLES: dict[Callable[..., None], str] = {  # in the order of the help
    cli_solve.run: "hexcontact run cases/hertz_spheres.toml --plot",
    cli_solve.resume: "hexcontact resume fretting.nc",
    cli_deck.check: "hexcontact check fretting.toml --set grid.spacing='2 um'",
    cli_deck.schema: "hexcontact schema -o deck.schema.json",
    cli_solve.study: "hexcontact study cases/study_friction.toml --jobs 4",
    cli_deck.new: "hexcontact new sphere",
    cli_show.info: "hexcontact info hertz_spheres.nc",
    cli_show.plot: "hexcontact plot fretting.nc --what tractions --step 15,20,25,30 --output cuts.pdf",
    cli_show.report: "hexcontact report fretting.nc",
    cli_show.export: "hexcontact export fretting.nc --vtk",
    cli_solve.verify: "hexcontact verify",
}
for _command, _example in _EXAMPLES.items():
    _help = plot_choices.help_text() if _command is cli_show.plot else None
    app.command(help=_help, epilog=f"Example: {_example}")(_command)
