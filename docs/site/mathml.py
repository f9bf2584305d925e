"""Formulas as MathML, which browsers show without a script. What cannot be converted is a warning."""

from __future__ import annotations

import re
from html import escape
from pathlib import Path
from typing import Any

import ziamath
from docutils import nodes
from math_core import LatexError, LatexToMathML
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.fileutil import copy_asset_file

logger = logging.getLogger(__name__)
converter = LatexToMathML(fancy_error=False)
# Number of an equation, which the converter takes in numbered environments only.
TAG = re.compile(r"\\tag\{(\w+)\}\s*$")
# Not every system has a font for formulas, so that the site brings one.
FONT = Path(ziamath.__file__).parent / "fonts/STIXTwoMath-Regular.ttf"


def converted(node: nodes.Element, latex: str, display: bool) -> str:
    try:
        return converter.convert_with_local_state(latex, displaystyle=display)
    except LatexError as error:
        logger.warning("formula %r: %s", latex, error, location=node)
        return f"<code>{escape(latex)}</code>"


def inline(writer: Any, node: nodes.Element) -> None:
    writer.body.append(converted(node, node.astext(), display=False))
    raise nodes.SkipNode


def block(writer: Any, node: nodes.Element) -> None:
    latex = node.astext()
    tag = TAG.search(latex)
    number = f'<span class="number">({tag[1]})</span>' if tag else ""
    formula = converted(node, TAG.sub("", latex), display=True)
    writer.body.append(f'<div class="formula">{formula}{number}</div>')
    raise nodes.SkipNode


def bring_font(app: Sphinx, exception: Exception | None) -> None:
    if exception is None and app.builder.format == "html":
        copy_asset_file(FONT, Path(app.outdir) / "_static")


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    app.connect("build-finished", bring_font)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
