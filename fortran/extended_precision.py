#!/usr/bin/env python3
"""Write the extended-precision copy of a Fortran module: extended_precision.py INPUT OUTPUT.

hc_name becomes hc_name_extended, and its kind rk, which is wp, becomes xp.
"""

import re
import sys
from pathlib import Path

source, target = map(Path, sys.argv[1:])
text, kinds = re.subn(r"\brk => wp\b", "rk => xp", source.read_text(encoding="utf-8"))
text, names = re.subn(rf"\bhc_{source.stem}\b", f"hc_{source.stem}_extended", text)
if kinds != 1 or not names:
    sys.exit(f"{source}: a module hc_{source.stem} with one 'rk => wp' expected")
target.write_text(text, encoding="utf-8")
