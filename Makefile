# hexcontact: everything a checkout can do, from a bare machine on.
# `make` lists the targets. Everything goes into .venv and build/ of this folder.
#
#   PYTHON=/path/to/python3.12   the interpreter .venv is made with
#   APT=no                       install no system package, only name what is missing
#   PYTEST_ARGS='-k deck -x'     more words for pytest
#   BENCH_ARGS='--only counts'   more words for the benchmarks

VENV := .venv
STAMPS := $(VENV)/.stamps
# After `make editable` the tests run on that build, until `make clean`.
BUILD := $(if $(wildcard $(STAMPS)/editable),build/editable,build/release)
DEBUG_BUILD := build/debug
DEBUG_SITE := build/debug-site

export PYTHON APT
# The build tools (meson, ninja, f2py) are looked up on the path.
export PATH := $(CURDIR)/$(VENV)/bin:$(PATH)
export PIP_DISABLE_PIP_VERSION_CHECK := 1
py := $(CURDIR)/$(VENV)/bin/python
pip := $(py) -m pip
pip_build := $(pip) install --quiet --no-build-isolation

# A .venv that is broken, was moved, or holds another Python is made anew.
ifneq ($(shell PYTHON='$(PYTHON)' sh .ci/bootstrap.sh --venv-ok && echo ok),ok)
  $(shell rm -rf $(STAMPS))
endif

build_files := pyproject.toml meson.build meson.options $(wildcard fortran/meson.build pydriver/meson.build)
library_sources := $(wildcard fortran/*.f90 fortran/*.c)
python_sources := $(shell find pydriver -type f ! -name '*.so' ! -name '*.pyc')
fortran_tests := $(shell find tests/fortran tests/bench -type f ! -name '*.pyc' 2>/dev/null)
sources := $(build_files) $(library_sources) $(python_sources) $(fortran_tests)

.DEFAULT_GOAL := help
# The steps are in order; make -j would only mix their output.
.NOTPARALLEL:
.PHONY: help install demo test test-fortran test-python debug-test verify bench lint format docs docs-links pictures editable clean distclean

help:  ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-13s %s\n", $$1, $$2 }' Makefile

# --- set-up: each step leaves a stamp, so that it is not done again ---------

$(STAMPS)/system: .ci/bootstrap.sh
	@sh .ci/bootstrap.sh
	@mkdir -p $(STAMPS)
	@touch $@

# What the build itself needs, read from pyproject.toml; ninja runs it, and a
# pip from 23.1 on takes more than one setup-args.
$(STAMPS)/build-tools: pyproject.toml $(STAMPS)/system
	@echo "Installing the build tools into $(VENV)"
	@$(py) -c "import tomllib; print('\n'.join(tomllib.load(open('pyproject.toml', 'rb'))['build-system']['requires'] + ['ninja', 'pip>=23.1']))" > $@.txt
	@$(pip) install --quiet -r $@.txt
	@touch $@

$(STAMPS)/installed: $(sources) $(STAMPS)/build-tools
	@echo "Building hexcontact ($(BUILD))"
	@if [ -e $(STAMPS)/editable ]; then meson compile -C $(BUILD); \
	else $(pip_build) -C build-dir=$(BUILD) -C setup-args=-Dtests=true .; fi
	@touch $@

# Optional groups of pyproject.toml: test, lint, docs.
$(STAMPS)/extra-%: pyproject.toml $(STAMPS)/system
	@echo "Installing what $* needs into $(VENV)"
	@$(py) -c "import tomllib; print('\n'.join(tomllib.load(open('pyproject.toml', 'rb'))['project']['optional-dependencies']['$*']))" > $@.txt
	@$(pip) install --quiet -r $@.txt
	@touch $@

install: $(STAMPS)/installed  ## build and install into .venv (done by the targets below)

# --- use ---------------------------------------------------------------------

demo: install  ## press a sphere on aluminum, then shear it: history, result and pictures in output/
	@mkdir -p output
	cd output && hexcontact run ../cases/dissimilar_fretting.toml --overwrite --plot
	cd output && hexcontact plot dissimilar_fretting.nc --what tractions --step 10,11,15,20,25,30,35,40
	cd output && hexcontact plot dissimilar_fretting.nc --what zones --step 10,11,15,20,25,30,35,40
	cd output && hexcontact plot dissimilar_fretting.nc --what history
	cd output && hexcontact report dissimilar_fretting.nc

verify: install  ## compare with published, discrete and analytic solutions (minutes)
	hexcontact verify

bench: install  ## work, times, memory, other codes side by side: docs/performance.md (BENCH_ARGS=--quick: two minutes)
	$(py) tests/bench/run.py --build $(BUILD) $(BENCH_ARGS)

# --- tests -------------------------------------------------------------------

test: install test-fortran test-python  ## build and run all tests

test-fortran: install  ## Fortran unit tests
	@meson test -C $(BUILD) --print-errorlogs

test-python: install $(STAMPS)/extra-test  ## Python tests
	@$(py) -m pytest $(PYTEST_ARGS)

debug-test: $(STAMPS)/build-tools $(STAMPS)/installed $(STAMPS)/extra-test  ## all tests on a build that checks bounds and traps NaN
	@echo "Building hexcontact with checks ($(DEBUG_BUILD))"
	@rm -rf $(DEBUG_SITE)
	@$(pip_build) --no-deps --target $(DEBUG_SITE) -C build-dir=$(DEBUG_BUILD) \
	    -C setup-args=-Dtests=true -C setup-args=-Ddebug_checks=true -C setup-args=-Dbuildtype=debug .
	@meson test -C $(DEBUG_BUILD) --print-errorlogs --timeout-multiplier 10
	@PYTHONPATH=$(CURDIR)/$(DEBUG_SITE) $(py) -m pytest $(PYTEST_ARGS)

# --- development -------------------------------------------------------------

lint: install $(STAMPS)/extra-lint $(STAMPS)/extra-test  ## check style, types and spelling
	@code=0; \
	for check in 'ruff check' 'ruff format --check' mypy 'fortitude check fortran tests docs' codespell; do \
	  echo "$$check"; $$check || code=1; \
	done; \
	exit $$code

format: $(STAMPS)/system $(STAMPS)/extra-lint  ## let ruff mend what it can
	ruff check --fix
	ruff format

docs: install $(STAMPS)/extra-docs  ## this documentation as pages in build/docs; warnings and dead links are errors
	@$(py) docs/site/build.py

docs-links: install $(STAMPS)/extra-docs  ## the same, and check the addresses of other sites (needs a network)
	@$(py) docs/site/build.py --external

pictures: install  ## draw the pictures of docs/images again, with the outputs shown in docs/tutorial.md and others
	$(py) docs/images/make.py
	$(py) docs/site/played.py --write

editable: $(STAMPS)/build-tools $(STAMPS)/extra-test $(STAMPS)/extra-lint  ## developers: import from pydriver/, rebuilt when imported
	@$(pip_build) -C build-dir=build/editable -C setup-args=-Dtests=true --editable .
	@touch $(STAMPS)/editable $(STAMPS)/installed

clean:  ## remove what was built; .venv keeps the packages it downloaded
	rm -rf build $(STAMPS)/installed $(STAMPS)/editable .pytest_cache .mypy_cache .ruff_cache

distclean: clean  ## remove .venv and output/ too
	rm -rf $(VENV) output
