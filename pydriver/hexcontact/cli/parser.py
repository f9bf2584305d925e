"""The command as typer knows it, for help, completion, and words that are not plain or wrong."""

from __future__ import annotations

import functools
import inspect
import sys
from collections.abc import Callable, Sequence
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from .._version import __version__
from ..errors import DeckError
from .guard import COMMANDS, Report
from .options import parameters

_EXAMPLE = "hexcontact new sphere, then hexcontact run sphere.toml --plot"


class _Commands(TyperGroup):
    """The sub-commands; with ``--json`` wrong options and arguments give an object, too."""

    def main(self, args: Sequence[str] | None = None, *more: Any, **options: Any) -> Any:
        """Run the command that the arguments name."""
        given = sys.argv[1:] if args is None else list(args)
        try:
            return super().main(args, *more, **options)
        except SystemExit as ending:
            usage = getattr(ending.__context__, "format_message", None)  # printed by typer before
            if "--json" in given and usage is not None:
                name = next((word for word in given if word in self.commands), "")
                Report(usage(), DeckError.exit_code).print_json(name)
            raise


def parser() -> typer.Typer:
    """Return the command with the sub-commands of the modules that are imported."""
    whole = typer.Typer(
        name="hexcontact",
        cls=_Commands,
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    whole.callback(epilog=f"Example: {_EXAMPLE}")(_hexcontact)
    for command in COMMANDS.values():
        whole.command(
            epilog=f"Example: {command.example}",
            short_help=command.short_help,
            cls=_with_help(command.help) if command.help else None,
        )(_typed(command.function))
    return whole


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"hexcontact {__version__}")
        raise typer.Exit()


def _hexcontact(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Elastic contact in 3-D from a deck in TOML: pressure, shear traction, stick and slip, approach, shift.

    Exit codes: 0 done, 2 wrong input, 3 no convergence or accuracy, 4 memory or disk; 130, 138, 143 stopped.
    """


def _typed(function: Callable[..., None]) -> Callable[..., None]:
    """Return a function with the options and arguments of typer in its annotations."""

    @functools.wraps(function)
    def typed(**given: Any) -> None:
        function(**given)

    signature, hints = inspect.signature(function), {}
    for name, (names, words, metavar), hint, *_ in parameters(function):
        words = words.replace("[", r"\[")  # typer reads markup in it
        if names:
            kind: Any = typer.Option(*names, metavar=metavar, help=words, readable=False)
        else:
            kind = typer.Argument(metavar=metavar, help=words, show_default=False, readable=False)
        hints[name] = Annotated[hint, kind]  # the command itself tests whether it can read a file
    typed.__annotations__ = hints
    typed.__signature__ = signature.replace(  # type: ignore[attr-defined]
        parameters=[one.replace(annotation=hints[name]) for name, one in signature.parameters.items()],
        return_annotation=None,
    )
    return typed


def _with_help(text: Callable[[], str]) -> type[TyperCommand]:
    """Return the class of a command whose help is written when it is asked for."""

    class WithHelp(TyperCommand):
        help = property(lambda _: text(), lambda _, __: None)

    return WithHelp
