"""Compare computed with published, analytic and converged solutions.

python tests/validation/run.py                      all checks (minutes)
python tests/validation/run.py table-9.2 fretting   these; --list lists them
python tests/validation/run.py --write              also updates docs/validation.csv and docs/validation.md
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from hexcontact import DeckError
from validation import frame, page
from validation.checks import CHECKS
from validation.frame import Check, Comparison


def main() -> int:
    """Run the checks of the command line; exit code 1 if a comparison fails."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="which checks; default: all")
    parser.add_argument("--list", action="store_true", help="list the checks")
    parser.add_argument("--write", action="store_true", help="update the page and its file of rows")
    words = parser.parse_args()

    def output(check: Check, found: Comparison) -> None:
        frame.show(check, found)
        if words.write:
            page.write(check, found, CHECKS)

    try:
        return frame.main(words.names, checks=CHECKS, output=output, listing=words.list)
    except DeckError as error:
        parser.error(str(error))


if __name__ == "__main__":
    sys.exit(main())
