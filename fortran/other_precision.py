#!/usr/bin/env python3
"""Write the copy of a Fortran module in another precision: other_precision.py INPUT OUTPUT.

name.f90 with its module hc_name becomes name_extended.f90 with hc_name_extended, in which the kind
rk stands for xp instead of wp; or name_single.f90 with hc_name_single, in which wp stands for sp and
FFTW is called in single precision.
"""

import re
import sys
from pathlib import Path

CHANGES = {
    "extended": {r"\brk => wp\b": "rk => xp"},
    "single": {
        r"\bonly: wp\b": "only: wp => sp",
        r"\bhc_(fftw|fft_layout|fft_passes)\b": r"hc_\1_single",
        r"=> c_double_complex\b": "=> c_float_complex",
        r"=> c_double\b": "=> c_float",
        r"'fftw_": "'fftwf_",
    },
}

source, target = map(Path, sys.argv[1:])
precision = target.stem.removeprefix(f"{source.stem}_")
text = source.read_text(encoding="utf-8")
replaced = 0
for pattern, replacement in CHANGES[precision].items():
    text, count = re.subn(pattern, replacement, text)
    replaced += count
text, names = re.subn(rf"\bhc_{source.stem}\b", f"hc_{source.stem}_{precision}", text)
if not replaced or not (names or f"hc_{source.stem}_{precision}" in text):
    sys.exit(f"{source}: a module hc_{source.stem} with a kind of real expected")
target.write_text(text, encoding="utf-8")
