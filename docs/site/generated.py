"""Pages that are made from the program: the reference of its commands."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import Any

import typer.cli
import typer.main
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from hexcontact.cli import app as hexcontact


def commands() -> str:
    """Return what --help says of every command, as Markdown with a heading of level 2 for each."""
    group = typer.main.get_command(hexcontact)
    context = group.make_context("hexcontact", [], resilient_parsing=True)
    text = typer.cli.get_docs_for_click(obj=group, ctx=context, name="hexcontact")
    # typer shortens what the commands do; here they have their first sentence, and lead to their own section.
    rows = [
        f"| [`{name}`](#hexcontact-{name}) | {inspect.cleandoc(command.help).partition(chr(10))[0]} |"
        for name, command in group.commands.items()
    ]
    table = "\n".join(["| | |", "|---|---|", *rows])
    text = re.sub(r"\*\*Commands\*\*:\n\n(\* .*\n)+", lambda _: f"{table}\n", text)
    text = re.sub(r"^Example: (.*)$", r"Example:\n\n```sh\n\1\n```", text, flags=re.MULTILINE)
    return text.removeprefix("# `hexcontact`\n")


class Commands(SphinxDirective):
    """The reference of all commands, in place of the directive."""

    def run(self) -> list[nodes.Node]:
        return self.parse_text_to_nodes(commands(), allow_section_headings=True)


def without_idle_patterns(app: Sphinx, page: str, source: list[str]) -> None:
    """Drop those patterns of the table of contents that no page matches yet, which Sphinx complains about."""

    def kept(line: re.Match[str]) -> str:
        return line[0] if any(Path(app.srcdir).glob(f"{line[1]}.md")) else ""

    if page == app.config.root_doc:
        source[0] = re.sub(r"^(\w+\*)\n", kept, source[0], flags=re.MULTILINE)


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_directive("commands", Commands)
    app.connect("source-read", without_idle_patterns)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
