# Every target makes the virtual environment it needs with stock python3, venv and pip.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet --constraint constraints.txt

# Tests start many processes: without byte code on the disk each would compile all modules again.
export PYTHONDONTWRITEBYTECODE :=

# Workers take tests from one another when they run out of their own.
PYTEST := $(BIN)/python -m pytest -n 2 --dist worksteal

.PHONY: demo test test-full test-all lint bench conformance conformance-lerobot conformance-maniskill docs release-check clean

demo: $(VENV)/.runtime
	$(BIN)/manipose demo --out demo_report

# The quick tier: every package and every task, in minutes.
test: $(VENV)/.dev
	$(PYTEST) -m "not full"

# What the quick tier leaves out.
test-full: $(VENV)/.dev
	$(PYTEST) -m full

test-all: $(VENV)/.dev
	$(PYTEST)

lint: $(VENV)/.dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/basedpyright --pythonpath $(BIN)/python

bench: $(VENV)/.dev
	$(BIN)/python benchmarks/manipulation_table.py --play 50
	$(BIN)/python benchmarks/throughput.py

# Checkers of other libraries, and 2,000 random steps of every task; brings PyTorch.
conformance: $(VENV)/.conformance
	$(BIN)/python -m pytest tests/conformance tests/gym
	$(BIN)/python benchmarks/experiments/random_steps.py

# Stock LeRobot in an environment of its own: 6 GB, Python 3.12. Records, exports, trains for a moment, evaluates.
LEROBOT_PYTHON ?= python3.12
LEROBOT_VENV ?= .venv-lerobot
conformance-lerobot:
	$(LEROBOT_PYTHON) -m venv $(LEROBOT_VENV)
	$(LEROBOT_VENV)/bin/python -m pip --disable-pip-version-check install --quiet "lerobot[dataset,training,evaluation]>=0.6.1,<0.7" . ./plugins/lerobot_env_manipose
	plugins/lerobot_env_manipose/conformance.sh $(LEROBOT_VENV)/bin conformance_lerobot

# ManiSkill's own loader in an environment of its own reads demonstrations that were replayed.
MANISKILL_VENV ?= .venv-maniskill
conformance-maniskill: $(VENV)/.dev
	$(PYTHON) -m venv $(MANISKILL_VENV)
	$(MANISKILL_VENV)/bin/python -m pip --disable-pip-version-check install --quiet "mani_skill>=3.0.1,<3.1"
	MANISKILL_PYTHON=$(MANISKILL_VENV)/bin/python $(BIN)/python -m pytest tests/conformance/test_maniskill.py

# The site, into site/: index.html opens without a server. The variable keeps Material's notice about MkDocs 2 out.
docs: $(VENV)/.docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --clean --quiet

# Builds sdist and wheel, installs the wheel into an empty environment outside the repository, and uses it there.
release-check: $(VENV)/.dev
	$(BIN)/python .ci/release_check.py

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

# Only what the extra lists: the site is built from sources that are read, not imported.
$(VENV)/.docs: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(PIP) $$($(BIN)/python -c "import tomllib; print(*tomllib.load(open('pyproject.toml', 'rb'))['project']['optional-dependencies']['docs'])")
	touch $@

clean:
	rm -rf $(VENV) $(LEROBOT_VENV) $(MANISKILL_VENV) conformance_lerobot demo_report site
