# Two commands do everything on a machine with python3 (3.11 or newer) and make: make demo, make test.
# make test takes ten minutes on two processors; make test-all adds the tests of tests/long_tests.txt.

PYTHON ?= python3
VENV := .venv
PIP := $(VENV)/bin/python -m pip --disable-pip-version-check
LOCK := pyproject.toml constraints.txt

.PHONY: demo test test-all bench library-results classics docs lint style types pytest clean

demo: $(VENV)/installed
	$(VENV)/bin/gantrytau demo

# The type checker takes minutes on one processor: it runs beside the tests.
test: style
	$(MAKE) --no-print-directory --jobs=2 types pytest

# Files in the order of tests/conftest.py, not those with the most tests first.
PYTEST = OMP_NUM_THREADS=1 $(VENV)/bin/python -m pytest -n auto --dist loadfile --no-loadscope-reorder

pytest: $(VENV)/installed-dev
	$(PYTEST) --only=short

test-all: test
	$(PYTEST) --only=long

bench: $(VENV)/installed-bench
	OMP_NUM_THREADS=1 $(VENV)/bin/python -m tests.benchmarks

# Examples of the libraries in MODELICAPATH beside the trajectories in REFERENCE_RESULTS; ONLY=Package.Of.Some.
library-results: $(VENV)/installed-dev
	@OMP_NUM_THREADS=1 $(VENV)/bin/python -m tests.library_results

# Published problems of each field, beside other solvers; ONLY=Hires or a family.
classics: $(VENV)/installed-bench
	@OMP_NUM_THREADS=1 $(VENV)/bin/python -m tests.classics

# Notebooks are executed again only where they, or the packages, have changed.
docs: $(VENV)/installed-docs
	OMP_NUM_THREADS=1 $(VENV)/bin/python -m notebooks.site.builder

lint: style types

style: $(VENV)/installed-dev
	$(VENV)/bin/ruff check
	$(VENV)/bin/ruff format --check

types: $(VENV)/installed-dev
	$(VENV)/bin/basedpyright

# A stamp is older than pyproject.toml or constraints.txt when the set-up has to be done again.
$(VENV)/installed: $(LOCK) | $(VENV)/bin/pip
	@echo "Installing gantrytau into $(VENV) ..."
	$(PIP) install --quiet -e . -c constraints.txt
	@touch $@

$(VENV)/installed-dev: $(LOCK) | $(VENV)/bin/pip
	@echo "Installing gantrytau and what its tests need into $(VENV) ..."
	$(PIP) install --quiet -e '.[dev]' -c constraints.txt
	@touch $(VENV)/installed $@

$(VENV)/installed-bench: $(LOCK) | $(VENV)/bin/pip
	@echo "Installing gantrytau and the peers it is measured against into $(VENV) ..."
	$(PIP) install --quiet -e '.[bench]' -c constraints.txt
	@touch $(VENV)/installed $@

$(VENV)/installed-docs: $(LOCK) | $(VENV)/bin/pip
	@echo "Installing gantrytau and what its site is built with into $(VENV) ..."
	$(PIP) install --quiet -e '.[docs]' -c constraints.txt
	@touch $(VENV)/installed $@

$(VENV)/bin/pip:
	@command -v $(PYTHON) > /dev/null || { echo "$(PYTHON): not found; install Python 3.11 or newer" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "$$($(PYTHON) --version) found, 3.11 or newer expected; name another one: make PYTHON=python3.12 ..." >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2> /dev/null || { \
	  echo "$(PYTHON) cannot create environments; install its venv module (Debian, Ubuntu: apt install python3-venv)" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)

# Keeps the environment, but has it checked by the next command.
clean:
	rm -rf build dist demo-output .pytest_cache .ruff_cache .hypothesis $(VENV)/installed*
	find . -name __pycache__ -not -path './$(VENV)/*' -prune -exec rm -rf {} +
