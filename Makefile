# Every target makes the virtual environment it needs with stock python3, venv and pip.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet --constraint constraints.txt

.PHONY: demo test lint bench conformance clean

demo: $(VENV)/.runtime
	$(BIN)/manipose demo --out demo_report

test: $(VENV)/.dev
	$(BIN)/python -m pytest -n 2 --dist loadfile

lint: $(VENV)/.dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/basedpyright --pythonpath $(BIN)/python

bench: $(VENV)/.dev
	$(BIN)/python benchmarks/manipulation_table.py
	$(BIN)/python benchmarks/throughput.py

# Checkers of other libraries, and 2,000 random steps of every task; brings PyTorch.
conformance: $(VENV)/.conformance
	$(BIN)/python -m pytest tests/conformance
	$(BIN)/python benchmarks/random_steps.py

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.runtime: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(PIP) --editable .
	touch $@

$(VENV)/.dev: $(VENV)/.runtime
	$(PIP) --editable ".[dev]"
	touch $@

$(VENV)/.conformance: $(VENV)/.dev
	$(PIP) --editable ".[conformance]"
	touch $@

clean:
	rm -rf $(VENV) demo_report
