# The front door: `make demo` and `make test` need nothing but python3 (3.11 to 3.13), git and make.
#
#   make demo     set up, then simulate two recordings of one place, build, query, diff and evaluate
#   make test     set up, then everything CI checks: format, lint, types, imports, tests
#   make test-postgresql   the tests that touch a database, on a PostgreSQL server that they start for themselves
#   make test-perception   detectors, segmenters and encoders against transformers (installs it, and torch for the CPU), and
#                 the table of differences in docs/perception.md
#   make zoo      the small recordings of every recorder, driver and robot, and their table in docs/recordings.md
#   make fuzz     hostile recordings, messages, maps, models, plugins, settings and command lines: EXAMPLES=2000 of each
#                 kind; says how many of each were tried, and SEED=7 tries the same again
#   make kill-tests  KILLS=50 of building, resuming, merging, pruning, upgrading at random moments (KILL_SEED=1), and
#                 KILLS_POSTGRESQL=20 with a PostgreSQL server that is killed, too: nothing may be lost
#   make benchmark   simulate, build and score the tables of docs/benchmarks.md; SEEDS=11,12,13, WORLDS=folder
#   make setup    only set up: .venv with SuperMap and its tools
#   make lint     ruff, mypy --strict, import-linter       make format   let ruff format and fix
#   make wheel    build dist/*.whl                         make clean    remove what make made
#
# PYTHON=/path/to/python3.12 chooses the interpreter of a new .venv, WORKERS=4 the processes of the tests.

VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
WORKERS ?= 2
CANDIDATES := $(or $(PYTHON),python3 python3.13 python3.12 python3.11)

export PIP_DISABLE_PIP_VERSION_CHECK := 1

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help setup demo benchmark test test-postgresql test-perception kill-tests fuzz zoo lint format wheel clean

help:
	@sed -n 's/^#   //p' Makefile

# -- setting up

setup: $(INSTALLED)

$(INSTALLED): pyproject.toml supermap_cli/version.py | $(BIN)/python
	@echo "Installing SuperMap and its tools into $(VENV): one to five minutes and 3 GB the first time ..."
	@$(BIN)/python -m pip install -qq --editable ".[dev]"
	@touch $@

$(BIN)/python:
	@for python in $(CANDIDATES); do \
	  "$$python" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' 2>/dev/null || continue; \
	  if ! "$$python" -c 'import ensurepip, venv' 2>/dev/null; then without_venv=$$python; continue; fi; \
	  echo "Creating $(VENV) with $$("$$python" --version) ..."; \
	  "$$python" -m venv $(VENV) && exit 0; \
	  rm -rf $(VENV); exit 1; \
	done; \
	if [ -n "$$without_venv" ]; then \
	  echo "error: $$without_venv cannot make virtual environments: install its venv package" \
	    "(on Debian and Ubuntu: python3-venv)" >&2; \
	else \
	  echo "error: SuperMap needs Python 3.11, 3.12 or 3.13; looked for: $(CANDIDATES)." \
	    "Install one, or say where it is: make PYTHON=/path/to/python3.12 ..." >&2; \
	fi; \
	exit 1

# -- checking

test: lint
	@echo "== pytest"
	@$(BIN)/python -m pytest -n $(WORKERS)

ON_POSTGRESQL := $(addprefix tests/,memory query schema exporting \
  $(addprefix drivers/test_,traversal_build.py multi_camera_builds.py resumed_builds.py second_traversals.py \
    failing_builds.py delayed_perception.py stopped_builds.py) \
  $(addprefix commands/test_,db.py db_sql.py build.py diff.py history.py query.py show.py))

test-postgresql: $(INSTALLED)
	@SUPERMAP_TEST_DATABASE=postgresql $(BIN)/python -m pytest -n $(WORKERS) -rs $(ON_POSTGRESQL)

KILLS ?= 50
KILLS_POSTGRESQL ?= 20
KILL_SEED ?= 1
KILLED := $(BIN)/python -m pytest -q -s -rs tests/drivers/test_killed_commands.py

kill-tests: $(INSTALLED)
	@SUPERMAP_KILL_SEED=$(KILL_SEED) SUPERMAP_KILLS=$(KILLS) $(KILLED)
	@SUPERMAP_KILL_SEED=$(KILL_SEED) SUPERMAP_KILLS=$(KILLS_POSTGRESQL) SUPERMAP_TEST_DATABASE=postgresql $(KILLED)

test-perception: $(INSTALLED)
	@$(BIN)/python -m pip install -qq --editable ".[perception-tests]"
	@$(BIN)/python -m pytest -rs tests/parity
	@PYTHONPATH=tests:. $(BIN)/python -m parity.documentation

EXAMPLES ?= 2000
SEED := $(or $(SEED),$(shell date +%s))

fuzz: $(INSTALLED)
	@SUPERMAP_FUZZ_EXAMPLES=$(EXAMPLES) $(BIN)/python -m pytest -n $(WORKERS) --hypothesis-seed=$(SEED) tests/fuzz

zoo: $(INSTALLED)
	@PYTHONPATH=tests:. $(BIN)/python -m zoo.documentation
	@$(BIN)/python -m pytest -n $(WORKERS) tests/zoo

lint: $(INSTALLED)
	@echo "== ruff format"
	@$(BIN)/ruff format --check .
	@echo "== ruff check"
	@$(BIN)/ruff check .
	@echo "== mypy --strict"
	@$(BIN)/mypy --strict
	@echo "== import-linter"
	@$(BIN)/lint-imports

format: $(INSTALLED)
	@$(BIN)/ruff format .
	@$(BIN)/ruff check --fix .

wheel: $(INSTALLED)
	@rm -rf build dist
	@$(BIN)/python -m build --wheel --outdir dist . > build.log 2>&1 || { cat build.log >&2; exit 1; }
	@rm -rf build build.log
	@ls dist/*.whl

# -- showing

demo: $(INSTALLED)
	@PATH="$$PWD/$(BIN):$$PATH" supermap demo --folder demo
	@echo
	@echo "(supermap lies in $(BIN): export PATH=\"\$$PWD/$(BIN):\$$PATH\")"

# -- measuring

WORLDS ?= worlds
SEEDS ?= 11,12,13

benchmark: $(INSTALLED)
	@$(BIN)/supermap eval benchmark --seeds $(SEEDS) --keep $(WORLDS)
	@for seed in $$(echo $(SEEDS) | tr , ' '); do $(BIN)/supermap eval ablation $(WORLDS)/office/$$seed || exit 1; done
	@$(BIN)/supermap eval perception office --seeds $(SEEDS) --keep $(WORLDS)
	@$(BIN)/supermap bench $(WORLDS)/office/$$(echo $(SEEDS) | cut -d, -f1)/office.mcap --objects 40,400

clean:
	rm -rf $(VENV) build dist demo .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache *.egg-info
