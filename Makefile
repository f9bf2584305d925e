# hexcontact: everything a checkout can do, from a bare machine on.
# `make` lists the targets. Everything goes into .venv and build/ of this folder.
#
#   PYTHON=/path/to/python3.12   the interpreter .venv is made with
#   APT=no                       install no system package, only name what is missing
#   PYTEST_ARGS='-k deck -x'     more words for pytest, which then runs in one process
#   PYTEST_JOBS=4                processes that share the Python tests; 0: all in one
#   BENCH_ARGS='--only counts'   more words for the benchmarks
#   CHECKS='fretting torsion'    which comparisons make verify makes
#   MUTANTS_ARGS='--until check' more words for make mutants

VENV := .venv
STAMPS := $(VENV)/.stamps
# After `make editable` the tests run on that build, until `make clean`.
BUILD := $(if $(wildcard $(STAMPS)/editable),build/editable,build/release)
DEBUG_BUILD := build/debug
DEBUG_SITE := build/debug-site
COVERAGE_BUILD := build/coverage
COVERAGE_SITE := build/coverage-site
PERTURBED_BUILD := build/perturbed
PERTURBED_SITE := build/perturbed-site
WHEEL_BUILD := build/wheel
WHEEL_SITE := build/wheel-site
FLANG := flang-22
FLANG_BUILD := build/flang
MPIS := openmpi mpich

# Least share of lines that tests must reach, percent.
COVERED_FORTRAN := 95
COVERED_PYTHON := 90

export PYTHON APT
# The build tools (meson, ninja, f2py) are looked up on the path.
export PATH := $(CURDIR)/$(VENV)/bin:$(PATH)
export PIP_DISABLE_PIP_VERSION_CHECK := 1
py := $(CURDIR)/$(VENV)/bin/python
pip := $(py) -m pip
pip_build := $(pip) install --quiet --no-build-isolation
# Test files as pytest rewrites them are kept, also where the environment keeps no byte code: collecting takes 4 s, not 10.
export PYTHONDONTWRITEBYTECODE :=
# Files of tests go to one process each, so that what they share is made once.
PYTEST_JOBS ?= $(if $(strip $(PYTEST_ARGS)),0,logical)
pytest := -m pytest --numprocesses=$(PYTEST_JOBS) --maxprocesses=8 --dist=loadscope --no-loadscope-reorder $(PYTEST_ARGS)
# A build of its own, installed beside that of .venv and not hidden by an editable one: site, build folder, settings.
define build_apart
@rm -rf $(1)
@$(pip_build) --no-deps --target $(1) -C build-dir=$(2) $(addprefix -C setup-args=-D,tests=true $(3)) .
@cp .ci/sitecustomize.py $(1)
@PYTHONPATH=$(CURDIR)/$(1) $(py) -c "import hexcontact, sys; '/$(1)/' in hexcontact.__file__ or sys.exit('hexcontact is not imported from $(1)')"
endef

# A .venv that is broken, was moved, or holds another Python is made anew.
ifneq ($(shell PYTHON='$(PYTHON)' sh .ci/bootstrap.sh --venv-ok && echo ok),ok)
  $(shell rm -rf $(STAMPS))
endif

build_files := pyproject.toml meson.build meson.options $(wildcard fortran/meson.build fortran/*/meson.build pydriver/meson.build)
library_sources := $(wildcard fortran/*.f90 fortran/*/*.f90 fortran/*/*.c fortran/*.py fortran/python/*.py fortran/python/*.toml)
python_sources := $(shell find pydriver -type f ! -name '*.so' ! -name '*.pyc')
fortran_tests := $(shell find tests/fortran tests/bench -type f ! -name '*.pyc' 2>/dev/null)
sources := $(build_files) $(library_sources) $(python_sources) $(fortran_tests)

.DEFAULT_GOAL := help
# The steps are in order; make -j would only mix their output.
.NOTPARALLEL:
.PHONY: help install demo check test test-fortran test-python debug-test debug-check flang-check mpi-check slurm-check perturbed-test mutants coverage package wheel wheel-check oldest-check verify bench lint format docs docs-links pictures editable coverage-report clean distclean

help:  ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-14s %s\n", $$1, $$2 }' Makefile

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

verify: install  ## compare with published, discrete and analytic solutions; updates docs/validation.md and .csv (minutes)
	$(py) tests/validation/run.py --write $(CHECKS)

bench: install  ## work, times, memory, other codes side by side: docs/measurements.md and other pages (BENCH_ARGS=--quick: minutes)
	$(py) tests/bench/run.py --build $(BUILD) $(BENCH_ARGS)

# --- tests -------------------------------------------------------------------

check: install $(STAMPS)/extra-test  ## all tests but the slow ones (tests/check.txt), in less than a minute
	@OMP_NUM_THREADS=1 meson test -C $(BUILD) --quiet --print-errorlogs
	@$(py) -m pytest --quiet --numprocesses=$(PYTEST_JOBS) --maxprocesses=8 @tests/check.txt

test: install test-fortran test-python  ## build and run all tests

test-fortran: install  ## Fortran unit tests
	@meson test -C $(BUILD) --print-errorlogs

test-python: install $(STAMPS)/extra-test  ## Python tests
	@$(py) $(pytest)

# OpenBLAS runs its oldest kernels on processors that it does not know; their strsm computes with lanes beyond the matrix,
# which traps. Others are as fast as this needs.
debug-test debug-check: export OPENBLAS_CORETYPE := $(if $(filter x86_64,$(shell uname -m)),Nehalem)

# What debug-check tests in Python: whatever solves.
CHECKED := first_step friction_driver friction_properties entry fuzz_arrays comparison nonconvergence solve

debug-test debug-check: $(STAMPS)/build-tools $(STAMPS)/installed $(STAMPS)/extra-test
	@echo "Building hexcontact with checks ($(DEBUG_BUILD))"
	$(call build_apart,$(DEBUG_SITE),$(DEBUG_BUILD),debug_checks=true buildtype=debug)
	@meson test -C $(DEBUG_BUILD) --print-errorlogs --timeout-multiplier 10
	@PYTHONPATH=$(CURDIR)/$(DEBUG_SITE) $(py) $(pytest) $(if $(filter debug-check,$@),$(CHECKED:%=tests/python/test_%.py))
debug-test:  ## all tests on a build that checks bounds and traps NaN
debug-check:  ## the tests of the solvers on that build (minutes)

# With openmp=enabled, so that a build in one thread does not pass for one with threads.
flang-check: $(STAMPS)/build-tools  ## Fortran unit tests on a build of LLVM's flang, which apt installs where it is missing
	@sh .ci/bootstrap.sh --flang $(FLANG)
	@echo "Building hexcontact with $(FLANG) ($(FLANG_BUILD))"
	@[ -e $(FLANG_BUILD)/build.ninja ] || FC=$(FLANG) meson setup $(FLANG_BUILD) -Dopenmp=enabled -Dwarning_level=0 -Doptimization=1
	@meson test -C $(FLANG_BUILD) --print-errorlogs --timeout-multiplier 5

# dask-jobqueue is not in .venv, where tests expect it to be missing.
JOBQUEUE := build/jobqueue
slurm-check: install $(STAMPS)/extra-test  ## the job scripts of cases/cluster on a Slurm of one node, which the tests start and end (minutes)
	@sh .ci/bootstrap.sh --slurm
	@[ -d $(JOBQUEUE) ] || $(pip) install --quiet --no-deps --target $(JOBQUEUE) dask-jobqueue || true
	@PYTHONPATH=$(CURDIR)/$(JOBQUEUE) $(py) -m pytest --quiet $(PYTEST_ARGS) tests/batch

mpi-check: $(STAMPS)/build-tools $(STAMPS)/installed $(STAMPS)/extra-test  ## Fortran units and tests of mpirun on builds with Open MPI and MPICH, which apt installs where they are missing
	@for mpi in $(MPIS); do $(MAKE) --no-print-directory mpi-check-$$mpi || exit 1; done

mpi-check-%:
	@env -u FC sh .ci/bootstrap.sh --mpi $*
	@echo "Building hexcontact with $* (build/$*)"
	$(call build_apart,build/$*-site,build/$*,mpi=enabled optimization=1)
	@meson test -C build/$* --print-errorlogs --no-suite crowded
	@PYTHONPATH=$(CURDIR)/build/$*-site $(py) $(pytest) $(MPI_CHECKED_$*:%=tests/python/test_%.py)
mpi-check-%: export FC = mpifort.$*
# Once also what hardly differs in a build with MPI: runs of one process.
MPI_CHECKED_openmpi := ranks first_step solve
MPI_CHECKED_mpich := ranks

perturbed-test: $(STAMPS)/build-tools $(STAMPS)/installed $(STAMPS)/extra-test  ## all tests on a build whose products differ in their last digits, as on another processor
	@echo "Building hexcontact with perturbed products ($(PERTURBED_BUILD))"
	$(call build_apart,$(PERTURBED_SITE),$(PERTURBED_BUILD),perturb_convolution=true)
	@meson test -C $(PERTURBED_BUILD) --print-errorlogs
	@PYTHONPATH=$(CURDIR)/$(PERTURBED_SITE) $(py) $(pytest)

mutants: install $(STAMPS)/extra-test  ## wrong lines in copies of the sources: which tests find them? (hours; goes on where it was stopped)
	@$(py) tests/mutants/run.py --build $(BUILD) $(MUTANTS_ARGS)

# In one thread: others would spoil the counts.
coverage: $(STAMPS)/build-tools $(STAMPS)/installed $(STAMPS)/extra-test $(STAMPS)/extra-coverage  ## the tests of make check on a build with counters: lists the lines that they do not reach
	@echo "Building hexcontact with counters ($(COVERAGE_BUILD))"
	$(call build_apart,$(COVERAGE_SITE),$(COVERAGE_BUILD),b_coverage=true buildtype=debugoptimized)
	@rm -rf build/coverage-data && find $(COVERAGE_BUILD) -name '*.gcda' -delete
	@OMP_NUM_THREADS=1 meson test -C $(COVERAGE_BUILD) --print-errorlogs --timeout-multiplier 5
	@OMP_NUM_THREADS=1 PYTHONPATH=$(CURDIR)/$(COVERAGE_SITE) $(py) -m coverage run -m pytest --quiet --numprocesses=$(PYTEST_JOBS) --maxprocesses=8 @tests/check.txt
	@$(MAKE) --no-print-directory coverage-report

# Reads what the tests left.
coverage-report:
	@$(py) -m coverage combine --quiet
	@$(py) -m coverage report --fail-under=$(COVERED_PYTHON); python=$$?; \
	$(py) -m gcovr --root . --filter fortran/ --gcov-ignore-parse-errors=negative_hits.warn --gcov-suspicious-hits-threshold 0 --fail-under-line $(COVERED_FORTRAN) $(COVERAGE_BUILD) && exit $$python

package: $(STAMPS)/build-tools  ## source archive, wheel, pip install .: build them and use them outside the checkout
	@$(py) .ci/package.py

# With pocketfft, so that nothing in it is under the GPL but what GCC's runtime exception covers.
wheel: $(STAMPS)/build-tools $(STAMPS)/extra-wheel  ## a wheel that needs no compiler, BLAS or FFTW, in build/wheelhouse
	@sh .ci/bootstrap.sh --cpp
	@$(py) .ci/wheel.py $(WHEEL_BUILD)

wheel-check: wheel $(STAMPS)/extra-test  ## Fortran unit tests on its build, and those tests of make check that solve on the wheel itself
	@meson test -C $(WHEEL_BUILD) --print-errorlogs
	@rm -rf $(WHEEL_SITE)
	@$(pip) install --quiet --no-deps --target $(WHEEL_SITE) build/wheelhouse/*.whl
	@cp .ci/sitecustomize.py $(WHEEL_SITE)
	@PYTHONPATH=$(CURDIR)/$(WHEEL_SITE) $(py) -m pytest --quiet --numprocesses=$(PYTEST_JOBS) --maxprocesses=8 @tests/check.txt \
	  -k 'first_step or solve or friction or rolling or periodic or coating or direct or stress or cli'

# Lower bounds of pyproject.toml, without what tests and builds need.
OLDEST := build/oldest
oldest-check: install $(STAMPS)/extra-test  ## the tests of decks, files, tables and pictures with the oldest dependencies that pyproject.toml admits
	@rm -rf $(OLDEST) && $(py) -m venv $(OLDEST)
	@$(py) -c "import tomllib; p = tomllib.load(open('pyproject.toml', 'rb'))['project']; print('\n'.join(w.replace('>=', '==') for w in p['dependencies'] + p['optional-dependencies']['dask']))" > $(OLDEST)/oldest.txt
	@$(OLDEST)/bin/python -m pip install --quiet -r $(OLDEST)/oldest.txt -r $(STAMPS)/extra-test.txt -c $(OLDEST)/oldest.txt
	@mkdir $(OLDEST)/site && cp -r pydriver/hexcontact $(OLDEST)/site
	@cp $(BUILD)/pydriver/_core*.so $(BUILD)/pydriver/flat.py $(OLDEST)/site/hexcontact/core/
	@PYTHONPATH=$(CURDIR)/$(OLDEST)/site $(OLDEST)/bin/python -m pytest --quiet --numprocesses=$(PYTEST_JOBS) --maxprocesses=8 @tests/check.txt \
	  -k 'case or deck or display or export or files or first_step or json or plot or report or result or schema or store or study or units'

# --- development -------------------------------------------------------------

lint: install $(STAMPS)/extra-lint $(STAMPS)/extra-test  ## check style, types and spelling
	@code=0; \
	for check in 'ruff check' 'ruff format --check' mypy 'python docs/site/typed.py' 'fortitude check fortran tests docs' codespell; do \
	  echo "$$check"; $$check || code=1; \
	done; \
	exit $$code

format: $(STAMPS)/system $(STAMPS)/extra-lint  ## let ruff mend what it can
	ruff check --fix
	ruff format

docs: install $(STAMPS)/extra-docs $(STAMPS)/extra-test  ## this documentation as pages in build/docs; warnings, dead links and old pictures are errors
	@$(py) docs/site/build.py
	@$(py) $(pytest) --dist=load --quiet tests/pictures

docs-links: install $(STAMPS)/extra-docs  ## the same, and check the addresses of other sites (needs a network)
	@$(py) docs/site/build.py --external

pictures: install  ## draw the pictures of docs/images again, with the outputs shown in docs/tutorial.md and others
	$(py) docs/images/make.py
	$(py) docs/images/rooms.py
	$(py) docs/site/played.py --write

editable: $(STAMPS)/build-tools $(STAMPS)/extra-test $(STAMPS)/extra-lint  ## developers: import from pydriver/, rebuilt when imported
	@$(pip_build) -C build-dir=build/editable -C setup-args=-Dtests=true --editable .
	@touch $(STAMPS)/editable $(STAMPS)/installed

clean:  ## remove what was built; .venv keeps the packages it downloaded
	rm -rf build $(STAMPS)/installed $(STAMPS)/editable .pytest_cache .mypy_cache .ruff_cache

distclean: clean  ## remove .venv and output/ too
	rm -rf $(VENV) output
