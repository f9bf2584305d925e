"""Compare computed with published, analytic and converged solutions.

python tests/validation/run.py                      all checks (minutes)
python tests/validation/run.py table-9.2 fretting   these; --list lists them
python tests/validation/run.py --table              Markdown, as in docs/validation.md
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from hexcontact import DeckError
from validation import frame
from validation.checks import CHECKS
from validation.frame import HEADERS, Check, Comparison, cells_of, judge_column


def markdown(check: Check, comparison: Comparison) -> str:
    """Return a check as a Markdown section; the value that judges a row is in bold."""
    lines = [f"## {check.title}", "", check.text, "", f"`make verify CHECKS={check.name}`", ""]
    lines += ["| " + " | ".join(HEADERS) + " |", "|" + "---|" * 2 + "---:|" * (len(HEADERS) - 3) + "---|"]
    for row in comparison.rows:
        cells, judge = [cell.replace("|", "\\|") for cell in cells_of(row)], judge_column(row)
        if judge >= 0:
            cells[judge] = f"**{cells[judge]}**"
        lines.append("| " + " | ".join(cells) + " |")
    lines += ["", *(f"{note}  ".replace("|", "\\|") for note in comparison.notes)]
    return "\n".join(lines).rstrip() + "\n"


PREAMBLE = """# Validation

Made by `python tests/validation/run.py --table > docs/validation.md`; do not edit.

*published*: as printed in the dissertation. *reference*: the exact solution of the same discrete problem, or
a converged solution, from an independent program (`tests/reference/benchmarks.csv`). *analytic*: closed
solution. The value in bold judges the row; *difference* and *tolerance* are relative to it, or have its unit.
Rows without a tolerance are reported only. Seconds are those of the machine that made this table, one run
each, preparing the case included.
"""


def main() -> int:
    """Run the checks of the command line; exit code 1 if a comparison fails."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="which checks; default: all")
    parser.add_argument("--list", action="store_true", help="list the checks")
    parser.add_argument("--table", action="store_true", help="print Markdown tables")
    words = parser.parse_args()
    if words.table:
        print(PREAMBLE)
    output = (lambda check, found: print(markdown(check, found))) if words.table else frame.show
    try:
        return frame.main(words.names, checks=CHECKS, output=output, listing=words.list)
    except DeckError as error:
        parser.error(str(error))


if __name__ == "__main__":
    sys.exit(main())
