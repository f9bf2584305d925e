"""A build that lacks something names the package."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FFTW = ("FFTW 3 is missing", "libfftw3-dev", "fftw-devel", "module load fftw", "-Dfft=pocketfft")
BLAS = ("OpenBLAS is missing", "libopenblas-dev", "openblas-devel", "module load openblas")


@pytest.mark.parametrize(("fft", "words"), [("fftw", FFTW), ("pocketfft", BLAS)])
def test_a_missing_library_is_named_for_package_managers(
    fft: str, words: tuple[str, ...], tmp_path: Path
) -> None:
    beside = str(Path(sys.executable).parent)
    meson = shutil.which("meson", path=os.pathsep.join([beside, os.environ["PATH"]]))
    assert meson, "meson is a build tool: make install"
    nothing = {"PKG_CONFIG_LIBDIR": str(tmp_path), "CMAKE": str(tmp_path / "cmake")}
    done = subprocess.run(
        [meson, "setup", tmp_path / "build", f"-Dfft={fft}"],
        cwd=ROOT,
        env={key: value for key, value in os.environ.items() if key != "PKG_CONFIG_PATH"} | nothing,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 1
    assert [word for word in (*words, "conda install", "docs/install.md") if word not in done.stdout] == []
