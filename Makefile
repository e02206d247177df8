# On a fresh machine with Python >= 3.11, `make benchmark` and `make test` do all set-up by themselves.
PYTHON ?= python3
BIN := .venv/bin
INSTALLED := .venv/installed
PYTEST := $(BIN)/python -m pytest --numprocesses logical --dist loadfile --no-loadscope-reorder
export PIP_DISABLE_PIP_VERSION_CHECK := 1
export PYTHONDONTWRITEBYTECODE :=  # else each of the many processes of the tests compiles all that it imports

LOWEST := .venv-lowest
LOWEST_TESTS := configuration robot packaging arena_arena paths_shapes paths_splines paths_specification \
  paths_trajectory export_mjcf engines_native_fleet engines_native_cores engines_native_compilation \
  engines_native_compiled_files tasks_track_environment agents_comparison_task_settings \
  agents_learning_bundle report_run_folder wrappers_specification

.PHONY: help install benchmark pictures papers test quick papers-test lowest lock audit lint style format clean
.DEFAULT_GOAL := help

help: ## This list
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 12

install: $(INSTALLED) ## Virtual environment in .venv with the package, editable, and all tools

$(INSTALLED): pyproject.toml setup.py constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "Python >= 3.11 is needed, $(PYTHON) is not; try for instance: make PYTHON=python3.12 $(MAKECMDGOALS)"; exit 1; }
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --no-compile -c constraints.txt -e '.[dev]'
	@touch $@

benchmark: $(INSTALLED) ## Learned and model-based control compared; results in runs/benchmark
	$(BIN)/caster-gym benchmark --config track --out runs/benchmark --overwrite

pictures: $(INSTALLED) ## The README's pictures, in docs/pictures
	$(BIN)/python -m scripts.draw_pictures --out docs/pictures

papers: $(INSTALLED) ## Both papers reproduced: pages, figures and tables in docs/papers
	$(BIN)/python -m papers chung2008 --out docs/papers --overwrite
	$(BIN)/python -m papers kim2001 --out docs/papers --overwrite

test: style ## Style, then all tests, a worker on each core, with types beside them
	@$(BIN)/mypy > .venv/types.txt 2>&1 & types=$$!; \
	$(PYTEST); failed=$$?; \
	wait $$types || failed=1; cat .venv/types.txt; exit $$failed

quick: $(INSTALLED) ## The fast tests alone, in about two minutes on two cores once their code is compiled
	$(PYTEST) -m "not slow" --ignore tests/papers

papers-test: $(INSTALLED) ## Tests of papers/ alone
	$(PYTEST) tests/papers

lowest: $(LOWEST)/installed ## Some of the tests with the lowest versions that pyproject.toml allows
	$(LOWEST)/bin/python -m pytest $(LOWEST_TESTS:%=tests/test_%.py)

$(LOWEST)/installed: pyproject.toml setup.py constraints-lowest.txt
	$(PYTHON) -m venv $(LOWEST)
	$(LOWEST)/bin/python -m pip install --quiet -c constraints-lowest.txt -e '.[test]'
	@touch $@

lock: ## requirements.lock and constraints.txt made again; LOCK=--upgrade takes the newest versions
	$(PYTHON) -m venv .venv-lock
	.venv-lock/bin/python -m pip install --quiet uv==0.13.9
	.venv-lock/bin/uv pip compile --quiet --extra dev --universal --generate-hashes --no-annotate --no-header $(LOCK) \
	  pyproject.toml --output-file requirements.lock
	@sed -n 's/^\([a-z0-9].*[^ ]\) *\\$$/\1/p' requirements.lock > constraints.txt

audit: ## Known vulnerabilities of the locked versions, by PyPI; fails too where it cannot be asked
	$(PYTHON) -m venv .venv-lock
	.venv-lock/bin/python -m pip install --quiet pip-audit==2.10.1
	.venv-lock/bin/pip-audit --strict --disable-pip --require-hashes --requirement requirements.lock

lint: style ## Style and types
	$(BIN)/mypy

style: $(INSTALLED) ## Style alone
	$(BIN)/ruff check
	$(BIN)/ruff format --check

format: $(INSTALLED) ## Bring the sources into shape
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

clean: ## Remove the environment and caches, keep runs/
	rm -rf .venv .venv-lock $(LOWEST) build dist *.egg-info .mypy_cache .pytest_cache .ruff_cache .hypothesis
