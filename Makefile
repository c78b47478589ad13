# The front door: `make demo` and `make test` need nothing but python3 (3.11 to 3.13), git and make.
#
#   make demo     set up, then run the main job on two small recordings: build, query, diff
#   make test     set up, then everything CI checks: format, lint, types, imports, tests
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
.PHONY: help setup demo test lint format wheel clean

help:
	@sed -n 's/^#   //p' Makefile

# -- setting up

setup: $(INSTALLED)

$(INSTALLED): pyproject.toml supermap_cli/version.py | $(BIN)/python
	@echo "Installing SuperMap and its tools into $(VENV): one to three minutes and 2 GB the first time ..."
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

SUPERMAP := SUPERMAP_DB=demo/office.db $(BIN)/supermap
show = @echo; echo '$$ supermap $(1)'; $(SUPERMAP) $(1)

demo: $(INSTALLED) demo/monday.mcap demo/tuesday.mcap
	@rm -f demo/office.db demo/office.db-wal demo/office.db-shm
	@echo
	@echo "Two recordings of one simulated office, a day apart: colour, depth, odometry and recorded detections."
	@echo "All that follows goes into one database, demo/office.db (SUPERMAP_DB)."
	@echo
	@echo "1. Is there all that a build needs?"
	$(call show,inspect demo/monday.mcap)
	@echo
	@echo "2. Both recordings become one memory with two traversals."
	$(call show,build demo/monday.mcap demo/tuesday.mcap)
	@echo
	@echo "3. Questions, and what an answer rests on. A thing that is not there is an answer, too."
	$(call show,query "cup on the table")
	$(call show,query "how many chairs in monday")
	$(call show,query "piano")
	@echo
	@echo "4. What changed? On Tuesday one cup is gone, a chair has moved to a corner, and a suitcase has come."
	$(call show,diff)
	@echo
	@echo "Try next:"
	@echo "  export SUPERMAP_DB=demo/office.db PATH=\"\$$PWD/$(BIN):\$$PATH\""
	@echo "  supermap show                        everything in the map now"
	@echo "  supermap show dining-table-1         all about one object, with its relations"
	@echo "  supermap query \"cup in monday\" --json"
	@echo "  supermap inspect your-own.mcap       what a build would use of your recording"
	@echo "The README goes on from here: \"Five minutes to an answer on your own bag\"."

demo/monday.mcap: VISIT := 1
demo/tuesday.mcap: VISIT := 2
demo/%.mcap: tests/synthetic_room.py tests/room_messages.py | $(INSTALLED)
	@mkdir -p demo
	@echo "Rendering $@ ..."
	@$(BIN)/python tests/synthetic_room.py $@ --visit $(VISIT)

clean:
	rm -rf $(VENV) build dist demo .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache *.egg-info
