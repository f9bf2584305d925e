"""The Fortran library as users get it: installed, found by pkg-config, linked by the program of the docs."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/fortran.md").read_text()
PROGRAMS = [ROOT / "docs/example.f90", ROOT / "docs/example_friction.f90"]
# meson and ninja lie beside this interpreter
PATH = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])


def run(*words: str | Path, folder: Path = ROOT, **variables: str) -> str:
    environment = os.environ | {"PATH": PATH} | variables
    done = subprocess.run(words, capture_output=True, text=True, cwd=folder, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the library is installed; built without optimization, which is quick."""
    folder = tmp_path_factory.mktemp("library")
    build = folder / "build"
    run("meson", "setup", build, f"--prefix={folder}", "--libdir=lib", "-Dtests=false", "-Doptimization=0")
    run("meson", "install", "-C", build)
    return folder


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda path: path.stem)
def test_example_links_and_prints_what_the_page_shows(program: Path, prefix: Path, tmp_path: Path) -> None:
    pkgconfig = str(prefix / "lib/pkgconfig")
    flags = run("pkg-config", "--cflags", "--libs", "hexcontact", PKG_CONFIG_PATH=pkgconfig).split()
    run("gfortran", "-std=f2018", "-Wall", "-Werror", program, "-o", "example", *flags, folder=tmp_path)
    assert f"\n{run(tmp_path / 'example', LD_LIBRARY_PATH=str(prefix / 'lib'))}```" in PAGE


def test_library_knows_nothing_of_python(prefix: Path) -> None:
    installed = [path for path in (prefix / "lib").rglob("libhexcontact*") if not path.is_symlink()]
    assert installed
    assert not [path for path in installed if b"f2py" in path.read_bytes() or b"python" in path.read_bytes()]
    assert not list((prefix / "include").rglob("*f2py*"))


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda path: path.stem)
def test_page_shows_the_program_that_is_tested(program: Path) -> None:
    """As a listing or by a link."""
    assert program.read_text() in PAGE or f"]({program.name})" in PAGE
