#!/usr/bin/env python3
"""Install the compiled Fortran module files, which meson leaves behind.

Usage (from a meson install script): install_modules.py FOLDER_OF_THE_BUILD INCLUDE_FOLDER
"""

import os
import shutil
import sys
from pathlib import Path

build, include = sys.argv[1:]
target = Path(os.environ["MESON_INSTALL_DESTDIR_PREFIX"]) / include
target.mkdir(parents=True, exist_ok=True)
for module in sorted(Path(build).glob("*hexcontact.*.p/*.mod")):
    shutil.copy2(module, target)
