"""Build a wheel that holds the libraries it needs: ``make wheel``.

pip builds it with pocketfft, auditwheel copies the shared libraries into it and names the systems that it
runs on. Licences of the copies are added; a library that is not in `NOTICES` is an error. The wheel goes to
build/wheelhouse.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

from commands import ROOT, run

WHEELHOUSE = ROOT / "build/wheelhouse"
LARGEST = 15e6  # bytes
PYTHON = (sys.executable, "-m")

GCC = (
    "of GCC, under the GNU General Public License 3 with the GCC Runtime Library Exception 3.1, "
    "which permits distribution under other terms; https://gcc.gnu.org/onlinedocs/libstdc++/manual/license.html"
)
NOTICES = {
    "libgfortran": GCC,
    "libgomp": GCC,
    "libgcc_s": GCC,
    "libquadmath": (
        "of GCC, under the GNU Lesser General Public License 2.1 or later: a separate shared library, which "
        "may be replaced by another version; its source is libquadmath of https://gcc.gnu.org"
    ),
    "libopenblas": (
        "OpenBLAS, Copyright (c) 2011-2014, The OpenBLAS Project, under the BSD-3-Clause licence; "
        "LAPACK in it, Copyright (c) 1992-2013 The University of Tennessee and others, under the modified "
        "BSD licence; https://github.com/OpenMathLib/OpenBLAS"
    ),
}
"""Where the libraries come from and their licences, by the beginning of the file's name."""


def built(folder: str, scratch: Path) -> Path:
    """Return the wheel that pip builds from a build folder."""
    settings = [f"-Cbuild-dir={folder}"]
    settings += [f"-Csetup-args={word}" for word in ("-Dfft=pocketfft", "-Dopenmp=enabled", "-Dtests=true")]
    run(*PYTHON, "pip", "wheel", "--no-build-isolation", "--no-deps", *settings, "-w", scratch, ".")
    [path] = scratch.glob("*.whl")
    return path


def with_notices(unpacked: Path) -> None:
    """Add the licences of the libraries that were copied into an unpacked wheel."""
    [libraries] = unpacked.glob("*.libs")
    [information] = unpacked.glob("*.dist-info")
    lines = ["Licences of what this wheel contains beside hexcontact.", ""]
    for path in sorted(libraries.iterdir()):
        notice = next((text for name, text in NOTICES.items() if path.name.startswith(name)), None)
        if notice is None:
            sys.exit(f"{path.name}: a library without a notice in .ci/wheel.py; state its licence there")
        lines += [f"{path.name}: {notice}", ""]
    pocketfft = (ROOT / "subprojects/pocketfft/LICENSE.md").read_text(encoding="utf-8")
    lines += ["pocketfft (compiled into hexcontact/core), under the BSD-3-Clause licence:", "", pocketfft]
    (information / "licenses/LIBRARIES.txt").write_text("\n".join(lines), encoding="utf-8")


def main() -> None:
    """Build the wheel, copy the libraries into it, add their licences."""
    shutil.rmtree(WHEELHOUSE, ignore_errors=True)
    with tempfile.TemporaryDirectory(prefix="hexcontact-") as name:
        scratch = Path(name)
        wheel = built(sys.argv[1], scratch)
        run(*PYTHON, "auditwheel", "repair", "--strip", "-w", scratch / "repaired", wheel)
        [repaired] = (scratch / "repaired").glob("*.whl")
        run(*PYTHON, "wheel", "unpack", repaired, "-d", scratch / "unpacked")
        [unpacked] = (scratch / "unpacked").iterdir()
        with_notices(unpacked)
        WHEELHOUSE.mkdir(parents=True)
        run(*PYTHON, "wheel", "pack", unpacked, "-d", WHEELHOUSE)
    [path] = WHEELHOUSE.glob("*.whl")
    size = path.stat().st_size
    if size > LARGEST:
        sys.exit(f"{path.name}: {size / 1e6:.1f} MB; expected at most {LARGEST / 1e6:.0f} MB")
    print(f"{path.relative_to(ROOT)}: {size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
