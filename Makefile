# Everything runs in .venv; the first call of any target sets it up.
SHELL := /bin/bash
PY := .venv/bin/python
PYTEST := $(PY) -m pytest
STAMP := .venv/.ready

.PHONY: setup demo check test test-all bench lint types clean

setup: $(STAMP)

$(STAMP): pyproject.toml constraints.txt .ci/setup
	@bash .ci/setup
	@touch $@

demo: $(STAMP)
	@$(PY) -m autophyx_tet.toolkit.demo out/demo

lint: $(STAMP)
	@$(PY) -m ruff check .
	@$(PY) -m ruff format --check .
	@$(PY) -m codespell_lib

types: $(STAMP)
	@$(PY) -m pyright

check: lint types
	@$(PYTEST) -n 2 -m "not slow and not real and not browser and not external"

test: lint types
	@$(PYTEST) -n 2 -m "not real and not browser and not external"

test-all: lint types
	@bash .ci/system --all
	@AUTOPHYX_REQUIRE_ALL=1 $(PYTEST) -n 2

bench: $(STAMP)
	@$(PY) benchmarks/statics.py --sizes S,M

clean:
	rm -rf .venv out build .cache
