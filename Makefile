# `make demo` opens the app on a sample scene, `make test` runs every test. Each sets up what it needs by itself.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test setup fast format lint types bench experiments scenes pictures clean

demo: $(VENV)/.run
	$(BIN)/gazeloc demo

test: $(VENV)/.dev
	$(BIN)/python -m pytest

setup: $(VENV)/.dev

fast: $(VENV)/.dev  ## the tests that take seconds, for while you write
	$(BIN)/python -m pytest -m "not slow and not e2e"

format: $(VENV)/.dev
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

lint: $(VENV)/.dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .

types: $(VENV)/.dev
	$(BIN)/mypy

pictures: $(VENV)/.dev  ## takes the README's pictures anew, from the demo's project: make pictures PROJECT=...
	$(BIN)/python tests/e2e/tour.py $(PROJECT)

bench: $(VENV)/.dev  ## prints the numbers that the README quotes
	$(BIN)/python tests/benchmarks

experiments: $(VENV)/.dev  ## the paper's tables and figures into static/experiments: make experiments ONLY="table-2 figure-8"
	$(BIN)/python -m gazeloc_core.experiments $(ONLY)

scenes: $(VENV)/.dev  ## writes sample_scenes/ anew, the same for the same seed
	$(BIN)/python -m gazeloc_core.synthetic sample_scenes/studio --preset studio

$(VENV)/.run: pyproject.toml constraints.txt .ci/system-packages
	sh .ci/system-packages
	sh .ci/environment "$(PYTHON)" "$(VENV)"
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable .
	touch $@

$(VENV)/.dev: $(VENV)/.run
	sh .ci/system-packages browser
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable ".[dev]"
	touch $@

clean:
	rm -rf $(VENV) dist build
