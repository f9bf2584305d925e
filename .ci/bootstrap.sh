#!/bin/sh
# Prepares a machine for hexcontact: finds Python, checks for compilers and
# libraries by trying them, installs what is missing with apt where that is
# possible without a question, and creates the virtual environment .venv.
#
#   sh .ci/bootstrap.sh            check, install what is missing, create .venv
#   sh .ci/bootstrap.sh --flang flang-22  the same, with that flang and its OpenMP
#   sh .ci/bootstrap.sh --slurm    the same, with CI=true also Slurm, for its tests
#   sh .ci/bootstrap.sh --cpp      the same, with a C++ compiler (pocketfft)
#   sh .ci/bootstrap.sh --mpi openmpi     the same, with that MPI, or mpich
#   sh .ci/bootstrap.sh --venv-ok  say nothing; succeed if .venv is usable
#
# PYTHON=/path/to/python3.12  uses that interpreter
# APT=no                      installs no system package, only names them
# CC, CXX, FC, PKG_CONFIG     as usual
set -u
cd "$(dirname "$0")/.." || exit 1

oldest_python='3.11'
flang=''
[ "${1:-}" != --flang ] || flang=$2
cpp=''
[ "${1:-}" != --cpp ] || cpp=yes
mpi=''
[ "${1:-}" != --mpi ] || mpi=$2
venv="$PWD/.venv"
# A new environment must not be made with the interpreter of the old one.
PATH=$(printf '%s' "$PATH" | sed "s|$venv/bin:||g")
scratch=''
trap '[ -z "$scratch" ] || rm -rf "$scratch"' EXIT
trap 'exit 130' INT TERM

say() { printf '%s\n' "$*"; }
have() { command -v "$1" >/dev/null 2>&1; }

# --- Python ---------------------------------------------------------------

# Succeeds if the command $1 runs and is new enough.
new_enough() {
  "$1" -c "import sys; sys.exit(sys.version_info < ($(say $oldest_python | tr . ,)))" >/dev/null 2>&1
}

# What identifies an interpreter: its version and where it is installed.
identity() {
  "$1" -c 'import sys; print(sys.version_info[:3], sys.base_prefix)' 2>/dev/null
}

# Usable: the interpreter runs, pip is there, the folder has not been moved
# (its scripts hold absolute paths), and it is the interpreter asked for.
venv_ok() {
  new_enough "$venv/bin/python" || return 1
  grep -qF "$venv" "$venv/bin/activate" 2>/dev/null || return 1
  "$venv/bin/python" -c 'import pip' >/dev/null 2>&1 || return 1
  [ -z "${PYTHON:-}" ] || [ "$(identity "$PYTHON")" = "$(identity "$venv/bin/python")" ]
}

# The first interpreter that is new enough: PYTHON alone if it is set, else
# that of .venv, so that a later call needs nothing anew.
find_python() {
  if venv_ok; then
    say "$venv/bin/python"
    return 0
  fi
  for candidate in ${PYTHON:-python3 python3.14 python3.13 python3.12 python3.11}; do
    if new_enough "$candidate"; then
      say "$candidate"
      return 0
    fi
  done
  return 1
}

if [ "${1:-}" = --venv-ok ]; then
  venv_ok
  exit
fi

# --- what is needed, each found by trying it ------------------------------

pkgconfig() {
  for tool in ${PKG_CONFIG:-pkg-config pkgconf}; do
    if have "$tool"; then
      "$tool" "$@" 2>/dev/null
      return
    fi
  done
  return 1
}

compiles_c() {
  printf '#include <stdio.h>\nint main(void) { puts("c"); return 0; }\n' >"$scratch/try.c"
  for compiler in ${CC:-cc gcc clang}; do
    "$compiler" "$scratch/try.c" -o "$scratch/try_c" >/dev/null 2>&1 && return 0
  done
  return 1
}

compiles_cpp() {
  printf '#include <cstdio>\nint main() { std::puts("c++"); }\n' >"$scratch/try.cpp"
  for compiler in ${CXX:-c++ g++ clang++}; do
    "$compiler" "$scratch/try.cpp" -o "$scratch/try_cpp" >/dev/null 2>&1 && return 0
  done
  return 1
}

# Links a Fortran program with the flags given.
compiles_fortran() {
  printf 'program try\n  print *, sqrt(2.0)\nend program try\n' >"$scratch/try.f90"
  # shellcheck disable=SC2086
  ${FC:-gfortran} "$scratch/try.f90" -o "$scratch/try_f" "$@" >/dev/null 2>&1
}

# Links against pkg-config modules; until there is a Fortran compiler the
# word of pkg-config must do.
links() {
  pkgconfig --exists "$@" || return 1
  compiles_fortran || return 0
  # shellcheck disable=SC2046
  compiles_fortran $(pkgconfig --libs "$@")
}

has_headers() {
  "$1" -c 'import os, sys, sysconfig
sys.exit(not os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h")))' >/dev/null 2>&1
}

has_venv() { "$1" -c 'import ensurepip, venv' >/dev/null 2>&1; }

missing=''  # in words
packages='' # for apt
need() {
  missing="${missing:+$missing, }$1"
  packages="${packages:+$packages }$2"
}

look_around() {
  missing=''
  packages=''
  python=$(find_python) || python=''
  compiles_c || need 'a C compiler' 'gcc libc6-dev'
  compiles_fortran || need 'a Fortran compiler' 'gfortran'
  [ -z "$cpp" ] || compiles_cpp || need 'a C++ compiler' 'g++'
  [ -z "$flang" ] || FC=$flang compiles_fortran -fopenmp || need "$flang with OpenMP" "$flang libomp-${flang##*-}-dev"
  [ -z "$mpi" ] || have "mpifort.$mpi" || need "the MPI $mpi" "$([ "$mpi" = mpich ] && say mpich || say openmpi-bin) lib$mpi-dev"
  pkgconfig --version >/dev/null || need 'pkg-config' 'pkg-config'
  links openblas || links lapack blas || need 'OpenBLAS (or LAPACK and BLAS)' 'libopenblas-dev'
  links fftw3 fftw3f || need 'FFTW 3' 'libfftw3-dev'
  if [ -n "$python" ]; then
    of=$("$python" -c 'import sys; print("python%d.%d" % sys.version_info[:2])')
    has_headers "$python" || need "the headers of $of" "$of-dev"
    has_venv "$python" || need "the venv module of $of" "$of-venv"
  fi
}

# --- installing -------------------------------------------------------------

# The command that makes us root without a question; fails if there is none.
as_root() {
  if [ "$(id -u)" = 0 ]; then
    "$@"
  else
    sudo -n "$@"
  fi
}

can_apt() {
  [ "${APT:-yes}" != no ] && have apt-get && as_root true >/dev/null 2>&1
}

apt_get() { as_root env DEBIAN_FRONTEND=noninteractive apt-get -q "$@" </dev/null; }

# Distributions whose python3 is too old often carry a newer one beside it.
newer_python_in_apt() {
  for minor in 14 13 12 11; do
    if apt-cache show "python3.$minor" >/dev/null 2>&1; then
      say "python3.$minor python3.$minor-dev python3.$minor-venv"
      return
    fi
  done
}

install_with_apt() {
  say "Installing with apt: ${packages:-Python $oldest_python or newer}"
  apt_get update || return 1
  if [ -z "$python" ] && [ -z "${PYTHON:-}" ]; then
    packages="$packages $(newer_python_in_apt)"
  fi
  # shellcheck disable=SC2086
  [ -z "$packages" ] || apt_get install -y --no-install-recommends $packages
}

# One line per package manager. For apt just what is missing, for the
# others all of it (they pass over what is there).
print_hints() {
  cat <<END

One of these lines installs it; then run make again.

  apt:      sudo apt-get update && sudo apt-get install -y $packages
  dnf:      sudo dnf install -y gcc${cpp:+ gcc-c++} gcc-gfortran pkgconf-pkg-config openblas-devel fftw-devel python3-devel
  conda:    conda create -y -n hexcontact -c conda-forge python=3.12 make compilers pkg-config openblas fftw && conda activate hexcontact
  brew:     brew install gcc pkgconf openblas fftw python@3.12 && export PKG_CONFIG_PATH="\$(brew --prefix openblas)/lib/pkgconfig"
  modules:  module load gcc openblas fftw python     (names differ between sites: module avail)

The compilers of conda and brew, and gcc of module systems, include C++. More: docs/install.md.
END
}

no_python() {
  asked=${PYTHON:-python3}
  found=$("$asked" --version 2>/dev/null) || found='not there'
  say "hexcontact needs Python $oldest_python or newer; $asked is $found."
  say "Install a newer one and name it: make PYTHON=/path/to/python3.12"
}

scratch=$(mktemp -d) || exit 1
look_around
if [ -n "$missing" ] || { [ -z "$python" ] && [ -z "${PYTHON:-}" ]; }; then
  if can_apt; then
    install_with_apt || say 'apt-get failed, see above.' >&2
    look_around
  fi
fi
if [ -z "$python" ]; then
  no_python >&2
  [ -n "$missing" ] || exit 1
fi
if [ -n "$missing" ]; then
  {
    say "Missing on this machine: $missing."
    print_hints
  } >&2
  exit 1
fi

# --- a browser, where tests are to leave nothing out ------------------------

# Tests open the page of `hexcontact report` in Chromium: 80 MB, ten seconds; elsewhere they may be skipped.
has_browser() { have chromium || have chromium-browser || have google-chrome; }
if [ "${CI:-}" = true ] && ! has_browser; then
  say 'Installing with apt: chromium'
  { can_apt && apt_get update && apt_get install -y --no-install-recommends chromium; } >/dev/null
  if ! has_browser; then
    say 'Chromium cannot be installed; with CI=true the tests open pages in it. Install chromium.' >&2
    exit 1
  fi
fi

# Elsewhere apt would start the daemons for good; the tests that need them are skipped.
slurm_packages='slurmctld slurmd slurm-client munge'
has_slurm() { PATH=$PATH:/usr/sbin have slurmctld; }
if [ "${1:-}" = --slurm ] && ! has_slurm; then
  if [ "${CI:-}" = true ] && can_apt; then
    say "Installing with apt: $slurm_packages"
    # shellcheck disable=SC2086
    { apt_get update && apt_get install -y --no-install-recommends $slurm_packages; } >/dev/null
  fi
  has_slurm || say "Slurm is not here, so its tests are skipped: sudo apt-get install $slurm_packages"
fi

# --- the virtual environment ----------------------------------------------

if ! venv_ok; then
  [ ! -e "$venv" ] || say 'Replacing .venv: it is broken, was moved, or holds another Python.'
  rm -rf "$venv" build # builds remember the interpreter
  say "Creating .venv with $("$python" --version)"
  "$python" -m venv "$venv" || exit 1
fi
