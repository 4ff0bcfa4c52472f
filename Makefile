# make         set up .venv with the pinned packages and compute everything in results/
# make test    also install the packages of the tests, and run all checks and tests of a change;
#              a release needs `make torture wheel docs couple-test` as well
# make lint    check style, formatting, imports and types only
# make golden  update the golden data in tests/golden, and the pictures of the figures
# make references  update the references with 50 digits in tests/references
# make peers   install heyoka, a solver that method= can call, into .venv if available
# make couple-test  run the tests with FMPy, ROSS and OpenTorsion, and install these into .venv
# make torture  test 50 killed runs, full and read-only disks, and damaged files; takes minutes
# make random-trains  compare 500 random gear trains with scipy event by event; takes ten minutes
# make random-certificates  certify 10,000 random orbits and wrong candidates; takes minutes
# make real-gearboxes  read the REXS files in the folder REXS, which are not part of the project
# make slurm-test  run the workflow with Slurm on one node; as root, also install Debian's packages
# make bench   measure the speed of the library on this machine
# make report  write results/report.html, all figures, tables and claims on one page
# make docs    build the documentation, build/docs/index.html, and test its longer examples
# make speed-and-accuracy  update numbers and pictures of this page (20 min); needs `make peers`
# make wheel   build wheel and source archive in dist/, and test both in a fresh environment
# make clean   remove the results; `make distclean` also removes the environment
#
# ARGS is passed to the program that a target calls, as in `make test ARGS=-x`. With SHORT=1
# benchmarks call each function once.

PYTHON ?= python3
# Use at most four cores, because each test worker needs up to 2 GB of memory.
JOBS ?= $(shell $(PYTHON) -c 'import os; print(min(4, os.cpu_count()))')
# Use one more worker than cores, because some tests wait for Slurm, a browser or a killed run.
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

# Review the changes and their reasons before you commit them.
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
	GEARLIB_KILLS=50 $(BIN)/python -m pytest tests/robustness -m "" -rs $(ARGS)

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

# The test, which is also part of `make test`, installs nothing and is skipped without Slurm.
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
	GEARLIB_DIST=dist $(BIN)/python -m pytest tests/wheel -m "" -rs $(ARGS)

report: all
	$(BIN)/snakemake --report results/report.html --report-stylesheet workflow/report/report.css

# Parallel jobs do not disturb wall times, because jobs that measure them run alone.
speed-and-accuracy: $(INSTALLED)
	$(BIN)/snakemake -j$(JOBS) draw_failures draw_stability_chart draw_models model_table \
	    draw_work_precision
	$(BIN)/python -m docs.hooks.take_over speed_and_accuracy results

docs: $(TESTING)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	$(BIN)/python -m pytest tests/docs tests/workflow/test_recipes.py -m release -rs $(ARGS)

# The test packages are only installed for targets that need them.
$(INSTALLED) $(TESTING): pyproject.toml requirements/constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "Python 3.11 or newer is required: use make PYTHON=python3.12" >&2; exit 1; }
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --no-compile --constraint requirements/constraints.txt \
	    --editable '.[proof,workflow$(if $(filter $@,$(TESTING)),$(COMMA)test)]'
	@# Compile all packages now, because otherwise each job would compile them again if
	@# PYTHONDONTWRITEBYTECODE is set. Tests in packages, a quarter of all files, are never loaded.
	@# Errors are ignored, because some packages contain invalid files on purpose.
	PYTHONPYCACHEPREFIX= $(BIN)/python -m compileall -qq -j $(JOBS) -x '/tests/' .venv || true
	touch $@ $(INSTALLED)

# This schema is for editors; the documentation builds its own.
$(SCHEMA): $(INSTALLED) $(wildcard gearlib/config/*.py gearlib/models/geometry/*.py)
	mkdir -p $(@D)
	$(BIN)/python -m gearlib schema > $@.new
	mv $@.new $@

clean:
	rm -rf .snakemake
	find results -mindepth 1 -not -name README.md -delete

distclean: clean
	rm -rf .venv
