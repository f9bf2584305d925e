"""Build the documentation site in build/docs, without a network: ``make docs``, or ``python docs/site/build.py``.

Sphinx makes the pages of docs/, FORD the reference of the Fortran library; then every link of the finished
pages is followed. A warning of Sphinx, a dead link or anything loaded from elsewhere ends it with exit code 1.
``--external`` checks the addresses of other sites too, and needs a network.
"""

from __future__ import annotations

import argparse
import importlib.resources
import re
import shutil
import subprocess
import sys
from pathlib import Path

from links import faults

DOCS = Path(__file__).parents[1]
SITE = DOCS.parent / "build/docs"
FORTRAN = SITE / "fortran"
DOCTREES = SITE.parent / "doctrees"

# FORD's pages load Bootstrap, and MathJax for formulas, which the comments do not have.
ELSEWHERE = re.compile(r"[ \t]*<(?:link|script)\b[^>]*\"https?://[^>]*>(?:\s*</script>)?\n?")
BOOTSTRAP = """\
    <link href="{root}css/bootstrap.min.css" rel="stylesheet">
    <script src="{root}js/bootstrap.bundle.min.js"></script>
"""


def sphinx(builder: str, target: Path) -> int:
    options = ["-W", "--keep-going", "-q", "-j", "auto", "-c", DOCS / "site", "-d", DOCTREES]
    return subprocess.run([sys.executable, "-m", "sphinx", "-b", builder, *options, DOCS, target]).returncode


def ford() -> int:
    """Write the pages of the Fortran library, and put what they load beside them."""
    done = subprocess.run(
        [sys.executable, "-m", "ford", "--quiet", DOCS / "ford.md"], capture_output=True, text=True
    )
    if done.returncode != 0:
        print(done.stdout, done.stderr, file=sys.stderr)
        return done.returncode
    assets = importlib.resources.files("bootstrap")
    for name in ("css/bootstrap.min.css", "js/bootstrap.bundle.min.js"):
        text = (assets / name).read_text(encoding="utf-8")
        (FORTRAN / name).write_text(re.sub(r"(//|/\*)# sourceMappingURL.*", "", text), encoding="utf-8")
    for page in FORTRAN.rglob("*.html"):
        text = ELSEWHERE.sub("", page.read_text(encoding="utf-8"))
        root = "../" * (len(page.relative_to(FORTRAN).parts) - 1)
        text = text.replace("  </head>", BOOTSTRAP.format(root=root) + "  </head>", 1)
        text = re.sub(r'(navbar-brand" href=)[^<]*', rf'\1"{root}../index.html">hexcontact documentation', text)
        # FORD links the procedures of an interface to places that it does not write
        text = re.sub(r"(interface/\w+\.html)#moduleprocedure-\w+", r"\1", text)
        page.write_text(text, encoding="utf-8")
    return 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--external", action="store_true", help="check the addresses of other sites, too")
    external = parser.parse_args().external
    # Nothing is left over: a page that is gone must not satisfy a link, and one that was read must warn again.
    for folder in (SITE, DOCTREES):
        shutil.rmtree(folder, ignore_errors=True)
    code = sphinx("html", SITE) | ford()
    found = faults(SITE)
    for fault in found:
        print(fault, file=sys.stderr)
    if external:
        code |= sphinx("linkcheck", SITE.parent / "linkcheck")
    if code == 0 and not found:
        print(f"written: {SITE}/index.html")
    return 1 if code or found else 0


if __name__ == "__main__":
    sys.exit(main())
