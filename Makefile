# Two commands for a newcomer: `make demo` and `make test`. Both keep everything in .venv at the root.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: demo test
.DEFAULT_GOAL := demo

demo: .venv/ready
	@mkdir -p out
	$(BIN)/tasuki render tests/data/still_life.nff --size 800x600 --samples 16 --depth 8 -o out/still_life.png

test: .venv/ready-dev
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/pytest --numprocesses auto

.venv/ready: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "Tasuki needs Python 3.11 or newer; $(PYTHON) is older. Try: make PYTHON=python3.11"; exit 2; }
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check --editable .
	@touch $@

.venv/ready-dev: .venv/ready
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@
