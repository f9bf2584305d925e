"""Pages that are made from the program: the reference of its commands."""

from __future__ import annotations

import re
from typing import Any

import typer.cli
import typer.main
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from hexcontact.cli import app as hexcontact


def commands() -> str:
    """Return what --help says of every command, as Markdown that begins with headings of level 2."""
    group = typer.main.get_command(hexcontact)
    context = group.make_context("hexcontact", [], resilient_parsing=True)
    return typer.cli.get_docs_for_click(obj=group, ctx=context, name="hexcontact")


class Commands(SphinxDirective):
    """The reference of all commands, in place of the directive."""

    def run(self) -> list[nodes.Node]:
        return self.parse_text_to_nodes(commands(), allow_section_headings=True)


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_directive("commands", Commands)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
