# Every target makes the virtual environment it needs, and only once.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: demo test test-slow check bench clean
.DELETE_ON_ERROR:
.NOTPARALLEL:

demo: .venv/demo.stamp  ## estimates the mass of a loaded car; the timeline goes to out/
	mkdir -p out
	$(BIN)/til run mass --rrd out/mass.rrd

test: .venv/test.stamp  ## the tests, less those of minutes
	$(BIN)/pytest -n 2

test-slow: .venv/test.stamp  ## the tests of minutes
	$(BIN)/pytest -n 2 -m slow

check: .venv/check.stamp  ## lint, format, types
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/basedpyright

bench: .venv/demo.stamp  ## speed, as ratios measured side by side
	$(BIN)/til bench

clean:  ## removes results and caches, not the virtual environment
	rm -rf out build dist .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -not -path './.venv/*' -prune -exec rm -rf {} +

.venv/pyvenv.cfg:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || \
	  { echo "PYTHON=$(PYTHON) is not there or older than 3.11: name one, as in make PYTHON=python3.12" >&2; exit 1; }
	$(PYTHON) -m venv .venv

.venv/demo.stamp: extras = plots
.venv/test.stamp: extras = plots,test
.venv/check.stamp: extras = plots,test,check
.venv/%.stamp: pyproject.toml | .venv/pyvenv.cfg
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[$(extras)]'
	touch $@
