"""Build what is distributed, and use it where nothing else is: ``make package``.

The source archive holds every file of the last commit; the wheel is built from it without a network, with
pocketfft, installed into an empty environment and used by its command in a folder outside the checkout. Then
``pip install .``, in isolation and with FFTW, takes its place there. Both are compiled without
optimization, which is quick. Run by an interpreter that has the build tools; archive and wheel go to
build/dist.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from functools import partial
from pathlib import Path

import commands
from commands import ROOT

DIST = ROOT / "build/dist"

# A user's shell: no tools of .venv, nothing that points to this checkout.
ENVIRONMENT = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "VIRTUAL_ENV")}
ENVIRONMENT["PATH"] = os.pathsep.join(
    folder for folder in os.environ["PATH"].split(os.pathsep) if not Path(folder).is_relative_to(ROOT)
)
run = partial(commands.run, environment=ENVIRONMENT)

QUICK = ["-Csetup-args=-Doptimization=0"]

SESSION = [  # words of the command, and a file that it leaves
    (["new", "sphere", "-o", "sphere.toml"], "sphere.toml"),
    (["run", "sphere.toml"], "sphere.nc"),
    (["info", "sphere.nc"], None),
    (["plot", "sphere.nc"], "sphere_overview.png"),
    (["report", "sphere.nc"], "sphere.html"),
    (["new", "fretting", "-o", "fretting.toml"], "fretting.toml"),
    (["run", "fretting.toml", "--quiet"], "fretting.nc"),
    (["verify", "spheres", "shear"], None),
]


def compare(what: str, found: set[str], expected: set[str]) -> None:
    """End with the differences of two lists of files, if there are any."""
    missing, surplus = sorted(expected - found), sorted(found - expected)
    if missing or surplus:
        sys.exit(f"{what}: missing {missing}, not expected {surplus}")
    print(f"{what}: {len(found)} files, none missing")


def source_archive() -> Path:
    """Return the source archive of the last commit."""
    if run("git", "status", "--porcelain"):
        print("Changes that are not committed are not in the archive.")
    build = f"import mesonpy; mesonpy.build_sdist({str(DIST)!r})"
    run(sys.executable, "-c", build, environment=os.environ)  # the tools of .venv
    [path] = DIST.glob("*.tar.gz")
    tracked = set(run("git", "ls-tree", "-r", "--name-only", "HEAD").splitlines())
    with tarfile.open(path) as archive:
        files = {name.partition("/")[2] for name in archive.getnames() if not archive.getmember(name).isdir()}
    compare(path.name, files, tracked | {"PKG-INFO"})
    return path


def no_network() -> list[str]:
    """Return a command that runs another one without a network."""
    for words in (["unshare", "--net"], ["unshare", "--map-root-user", "--net"]):
        if subprocess.run([*words, "true"], stderr=subprocess.DEVNULL).returncode == 0:
            return words
    sys.exit("unshare makes no network namespace here; run make package as root, or permit user namespaces")


def wheel_from(archive: Path) -> Path:
    """Return the wheel that pip builds from a source archive with the tools of .venv, without a network."""
    for old in DIST.glob("*.whl"):
        old.unlink()
    pip = [*no_network(), sys.executable, "-m", "pip", "wheel", "--quiet", "--no-index", "--no-deps"]
    settings = ["--no-build-isolation", *QUICK, "-Csetup-args=-Dfft=pocketfft", "--wheel-dir", DIST]
    run(*pip, *settings, archive, environment=os.environ)
    [path] = DIST.glob("*.whl")
    tracked = run("git", "ls-tree", "-r", "--name-only", "HEAD", "pydriver/hexcontact").splitlines()
    with zipfile.ZipFile(path) as wheel:
        names = [name for name in wheel.namelist() if ".dist-info/" not in name and not name.endswith("/")]
    extensions = {
        name for name in names if name.startswith("hexcontact/core/_core.") and name.endswith(".so")
    }
    if len(extensions) != 1:
        sys.exit(f"{path.name}: one compiled module was expected, found {sorted(extensions)}")
    built = extensions | {"hexcontact/core/flat.py"}
    compare(path.name, set(names) - built, {name.removeprefix("pydriver/") for name in tracked})
    return path


def use(environment: Path, folder: Path, *words: str | Path) -> None:
    """Install by the pip of an environment and use the command in a new folder."""
    folder.mkdir()
    bin_ = environment / "bin"
    run(bin_ / "python", "-m", "pip", "install", "--quiet", *words)
    run(bin_ / "python", "-m", "pip", "check")
    version = run(bin_ / "hexcontact", "--version", folder=folder).split()[-1]
    place = run(bin_ / "python", "-c", "import hexcontact; print(hexcontact.__file__)", folder=folder).strip()
    if not Path(place).is_relative_to(environment):
        sys.exit(f"hexcontact was imported from {place}, not from {environment}")
    archives = [path.name for path in DIST.glob("*.tar.gz")]
    if f"hexcontact-{version}.tar.gz" not in archives:
        sys.exit(f"hexcontact --version says {version}; the archives are {archives}")
    for command, left in SESSION:
        run(bin_ / "hexcontact", *command, folder=folder)
        if left and not (folder / left).is_file():
            sys.exit(f"hexcontact {' '.join(command)} left no {left}")


def main() -> None:
    """Build and use the distributions."""
    DIST.mkdir(parents=True, exist_ok=True)
    for old in DIST.glob("*.tar.gz"):
        old.unlink()
    wheel = wheel_from(source_archive())
    with tempfile.TemporaryDirectory(prefix="hexcontact-") as scratch:
        environment = Path(scratch, "venv")
        run(sys.executable, "-m", "venv", environment)
        use(environment, Path(scratch, "wheel"), wheel)
        use(environment, Path(scratch, "checkout"), "--force-reinstall", "--no-deps", *QUICK, ROOT)
    print(f"{wheel.name} works outside the checkout, and so does pip install .")


if __name__ == "__main__":
    main()
