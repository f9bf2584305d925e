"""What Sphinx takes from the program itself: the commands, and docstrings as napoleon can read them."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import Any

import typer.cli
import typer.main
from sphinx.application import Sphinx

from hexcontact.cli.app import app as hexcontact


def commands() -> str:
    """Return what --help says, as Markdown with a heading of level 2 for each command."""
    group = typer.main.get_command(hexcontact)
    context = group.make_context("hexcontact", [], resilient_parsing=True)
    text = typer.cli.get_docs_for_click(obj=group, ctx=context, name="hexcontact")
    # typer shortens what the commands do; here they have their first sentence, and lead to their own section.
    rows = [
        f"| [`{name}`](#hexcontact-{name}) | {inspect.cleandoc(command.help).partition(chr(10))[0]} |"
        for name, command in group.commands.items()
    ]
    text = text.replace("\b", "")  # typer's mark of lines that are not wrapped
    table = "\n".join(["| command | |", "|---|---|", *rows])
    text = re.sub(r"\*\*Commands\*\*:\n\n(\* .*\n)+", lambda _: f"{table}\n", text)
    text = re.sub(r"^Example: (.*)$", r"Example: `\1`", text, flags=re.MULTILINE)
    # Lists of words and what they mean stay in columns, as on the terminal.
    text = re.sub(r"(^[\w-]+ {2,}\S.*\n){2,}", r"\n```text\n\g<0>```\n", text, flags=re.MULTILINE)
    # Smart quotes would make dashes of options.
    text = re.sub(r"(?<![`\w-])(--[a-z][\w-]*)(?![^`\n]*`)", r"`\1`", text)
    return text.removeprefix("# `hexcontact`\n")


def with_joined_names(
    app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]
) -> None:
    """Join attributes that share a line of a docstring, of which Sphinx would take the first for a type."""
    first = lines.index("Attributes") if "Attributes" in lines else len(lines)
    for place, line in enumerate(lines[first:], first):
        if names := re.match(r"(\w+(?:, \w+)+) : ", line):
            lines[place] = names[1].replace(", ", ",\u200b") + line[names.end(1) :]


def completed(app: Sphinx, page: str, source: list[str]) -> None:
    """Put the commands into their page, show what only the site has, drop patterns without a page."""

    def kept(line: re.Match[str]) -> str:
        return line[0] if any(Path(app.srcdir).glob(f"{line[1]}.md")) else ""

    source[0] = source[0].replace("<!-- commands -->\n", commands() if page == "commands" else "")
    source[0] = re.sub(r"<!-- site: (.*?) -->", r"\1", source[0], flags=re.DOTALL)
    if page == app.config.root_doc:
        source[0] = re.sub(r"^(\w+\*)\n", kept, source[0], flags=re.MULTILINE)


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("source-read", completed)
    # Before napoleon reads them.
    app.connect("autodoc-process-docstring", with_joined_names, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
