"""A build that lacks something names the package."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LIBRARIES = {
    "fftw": ("FFTW 3 is missing", "libfftw3-dev", "fftw-devel", "module load fftw", "-Dfft=pocketfft"),
    "pocketfft": ("OpenBLAS is missing", "libopenblas-dev", "openblas-devel", "module load openblas"),
}
COMPILERS = {
    "CC": ("a C compiler is missing", "apt-get install gcc", "dnf install gcc", "c-compiler", "set CC"),
    "FC": ("a Fortran compiler is missing", "gfortran", "gcc-gfortran", "fortran-compiler", "set FC"),
    "CXX": ("a C++ compiler is missing", "g++", "gcc-c++", "cxx-compiler", "set CXX"),
}


def refused(folder: Path, fft: str, **variables: str) -> str:
    beside = str(Path(sys.executable).parent)
    meson = shutil.which("meson", path=os.pathsep.join([beside, os.environ["PATH"]]))
    assert meson, "meson is a build tool: make install"
    done = subprocess.run(
        [meson, "setup", folder / "build", f"-Dfft={fft}"],
        cwd=ROOT,
        env={key: value for key, value in os.environ.items() if key != "PKG_CONFIG_PATH"} | variables,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 1
    return done.stdout


def lacking(output: str, *words: str) -> list[str]:
    everywhere = ("apt:", "dnf:", "conda install", "module load", "docs/install.md")
    return [word for word in (*words, *everywhere) if word not in output]


@pytest.mark.parametrize("fft", LIBRARIES)
def test_a_missing_library_is_named_for_package_managers(fft: str, tmp_path: Path) -> None:
    output = refused(tmp_path, fft, PKG_CONFIG_LIBDIR=str(tmp_path), CMAKE=str(tmp_path / "cmake"))
    assert lacking(output, *LIBRARIES[fft]) == []


@pytest.mark.parametrize("variable", COMPILERS)
def test_a_missing_compiler_is_named_for_package_managers(variable: str, tmp_path: Path) -> None:
    output = refused(tmp_path, "pocketfft", **{variable: str(tmp_path / "compiler")})
    assert lacking(output, *COMPILERS[variable]) == []
