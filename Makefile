# make         set up .venv with the pinned packages and compute everything, results/
# make test    the packages of the tests as well, and all checks: style, imports, a small workflow
# make lint    the checks of style, formatting, imports and types only
# make golden  renew the golden numbers of tests/golden, and the pictures of the figures
# make references  renew the references in 50 digits that tests take from tests/references
# make peers   add heyoka to .venv, a solver that method= can call, where it installs
# make couple-test  tests with FMPy, ROSS and OpenTorsion, which it installs into .venv
# make torture  50 times kill -9, full and read-only disks, damaged files: minutes
# make random-trains  500 random gear trains against scipy, event by event: ten minutes
# make random-certificates  10,000 random orbits: what is proven of them, wrong candidates: minutes
# make real-gearboxes  read the REXS files in the folder REXS, which are not part of the project
# make slurm-test  the workflow on a real Slurm of one node; installs Debian's packages for root
# make bench   speed of the library on this machine
# make report  results/report.html, all figures, tables and claims on one page
# make docs    build/docs/index.html, the documentation as a site
# make speed-and-accuracy  after `make peers`: renew numbers and pictures of that page: 20 min
# make wheel   build wheel and source archive into dist/, and try both in a fresh environment
# make clean   remove the results; `make distclean` the environment as well
#
# ARGS is handed to what a target calls, as in `make test ARGS=-x`; with SHORT=1 benchmarks
# call everything once.

PYTHON ?= python3
# All cores, up to four: a worker of the tests takes up to 2 GB.
JOBS ?= $(shell $(PYTHON) -c 'import os; print(min(4, os.cpu_count()))')
# Of the tests, one more than cores: Slurm, browsers and killed runs make tests wait.
WORKERS ?= $(shell expr $(JOBS) + 1)
ARGS ?=
BIN := .venv/bin
INSTALLED := .venv/installed.stamp
TESTING := .venv/testing.stamp
SCHEMA := build/config.schema.json
COMMA := ,

.PHONY: all lint golden references test couple-test torture peers random-trains \
    random-certificates real-gearboxes slurm-test bench report docs speed-and-accuracy wheel clean distclean

all: $(INSTALLED) $(SCHEMA)
	$(BIN)/snakemake -j$(JOBS)

lint: $(TESTING)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/snakefmt --check Snakefile workflow
	$(BIN)/lint-imports
	$(BIN)/mypy

# Review what has moved, and why, before it is committed.
golden: $(TESTING)
	$(BIN)/python -m tests.golden

references: $(TESTING)
	$(BIN)/python -m tests.references $(ARGS)

test: lint
	$(BIN)/python -m pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder -rs $(ARGS)
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m pytest tests/kernels

couple-test: $(TESTING)
	$(BIN)/python -m pip install --quiet --constraint requirements/constraints.txt \
	    --editable '.[couple]'
	$(BIN)/python -m pytest tests/fmu tests/couple -rs $(ARGS)

torture: $(TESTING)
	GEARLIB_KILLS=50 $(BIN)/python -m pytest tests/robustness -rs $(ARGS)

random-trains: $(TESTING)
	GEARLIB_TRAINS=500 $(BIN)/python -m pytest -n $(JOBS) tests/properties/test_conformance.py -k random_train -rs $(ARGS)

random-certificates: $(TESTING)
	GEARLIB_CERTIFICATES=10000 $(BIN)/python -m pytest -n $(JOBS) tests/proofs/test_certificates.py \
	    -rs $(ARGS)

peers: $(INSTALLED)
	$(BIN)/python -m pip install --quiet --constraint requirements/constraints.txt \
	    --editable '.[peers]'

REXS ?= ../shared/rexs

real-gearboxes: $(TESTING)
	REXS='$(REXS)' $(BIN)/python -m tests.gearboxes

# The test itself, part of `make test` too, installs nothing, and says why where it cannot run.
slurm-test: $(TESTING)
	@if [ "$$(id -u)" = 0 ] && command -v apt-get > /dev/null && \
	    ! { command -v slurmctld && command -v slurmd && command -v munged; } > /dev/null; then \
	    apt-get update && apt-get install --yes --no-install-recommends \
	        slurmctld slurmd slurm-client munge; \
	fi
	$(BIN)/python -m pytest tests/slurm -rs $(ARGS)

bench: $(INSTALLED)
	$(BIN)/python -m benchmarks.run $(ARGS)

wheel: $(TESTING)
	rm -rf dist
	GEARLIB_DIST=dist $(BIN)/python -m pytest tests/wheel -rs $(ARGS)

report: all
	$(BIN)/snakemake --report results/report.html --report-stylesheet workflow/report/report.css

# Jobs that measure wall times run alone anyway.
speed-and-accuracy: $(INSTALLED)
	$(BIN)/snakemake -j$(JOBS) draw_failures draw_stability_chart draw_models model_table \
	    draw_work_precision
	$(BIN)/python -m docs.hooks.take_over speed_and_accuracy results

docs: $(TESTING)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

# With tools and tests only those wait for their packages who ask for them.
$(INSTALLED) $(TESTING): pyproject.toml requirements/constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "Python 3.11 or newer is needed: make PYTHON=python3.12" >&2; exit 1; }
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --no-compile --constraint requirements/constraints.txt \
	    --editable '.[proof,workflow$(if $(filter $@,$(TESTING)),$(COMMA)test)]'
	@# Here, side by side: left to first use, every job would compile its packages anew where
	@# PYTHONDONTWRITEBYTECODE is set. Nothing loads the packages' own tests, a quarter of all.
	@# Some packages hold files that are wrong on purpose.
	PYTHONPYCACHEPREFIX= $(BIN)/python -m compileall -qq -j $(JOBS) -x '/tests/' .venv || true
	touch $@ $(INSTALLED)

# For editors; the documentation makes its own.
$(SCHEMA): $(INSTALLED) $(wildcard gearlib/config/*.py gearlib/models/geometry/*.py)
	mkdir -p $(@D)
	$(BIN)/python -m gearlib schema > $@.new
	mv $@.new $@

clean:
	rm -rf .snakemake
	find results -mindepth 1 -not -name README.md -delete

distclean: clean
	rm -rf .venv
