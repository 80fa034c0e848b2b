# Every target sets up what it needs by itself, in .venv.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
PIP    := $(BIN)/python -m pip install --quiet --disable-pip-version-check

.PHONY: help pick test check bench view lock clean
help:            ## list the targets
	@grep -E '^[a-z]+: .*##|^[a-z]+:  +##' $(MAKEFILE_LIST) | sed -E 's/:.*##/\t/' | expand -t 12

pick: $(VENV)/.core    ## pick a real object with a real robot model and place it, in physics
	$(BIN)/apprehend pick --out pick-out

view: $(VENV)/.core    ## replay the last pick in the browser
	$(BIN)/apprehend view pick-out/episode.json

test: check            ## set up, check style, types and layers, and run the tests
	$(BIN)/python -m pytest -n 2 --dist worksteal

check: $(VENV)/.dev    ## style, types and layers
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

bench: $(VENV)/.bench  ## every benchmark against its peers
	$(BIN)/python -m benchmarks

$(VENV)/.core: pyproject.toml requirements/lock.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(PIP) -c requirements/lock.txt -e .
	touch $@

$(VENV)/.dev: $(VENV)/.core
	$(PIP) -c requirements/lock.txt -e '.[dev]'
	touch $@

$(VENV)/.bench: $(VENV)/.dev
	$(PIP) -c requirements/lock.txt -e '.[bench]'
	touch $@

lock:            ## write the versions of a fresh environment to requirements/lock.txt
	rm -rf .lock-venv && $(PYTHON) -m venv .lock-venv
	.lock-venv/bin/python -m pip install --quiet '.[dev,bench]'
	(echo "# Versions that are known to work together, as constraints for pip; written by make lock."; \
	 .lock-venv/bin/python -m pip freeze | grep -v '^apprehend') > requirements/lock.txt
	rm -rf .lock-venv

clean:           ## remove what the targets made
	rm -rf $(VENV) pick-out .mypy_cache .ruff_cache .pytest_cache
