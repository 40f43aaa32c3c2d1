# Everything runs in .venv; the first call of any target sets it up.
SHELL := /bin/bash
PY := .venv/bin/python
PYTEST := $(PY) -m pytest
STAMP := .venv/.ready

.PHONY: setup demo check test test-all bench lint types notebooks docs clean

setup: $(STAMP)

$(STAMP): pyproject.toml constraints.txt .ci/setup
	@bash .ci/setup
	@touch $@

demo: $(STAMP)
	@mkdir -p out/demo
	@$(PY) -m autophyx_tet.toolkit.bonsai out/demo/bonsai.glb
	@.venv/bin/autophyx-tet run out/demo/bonsai.glb -o out/demo \
		--text "the pot is ceramic, the soil is moist soil, the trunk is oak, the foliage is leaves"
	@echo "look at out/demo/report.html"

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
	@EXTRAS=external,openclip bash .ci/setup
	@AUTOPHYX_REQUIRE_ALL=1 $(PYTEST) -n 2

bench: $(STAMP)
	@$(PY) benchmarks/statics.py --sizes S,M

notebooks: $(STAMP)
	@$(PY) .ci/notebooks

docs: $(STAMP)
	@$(PY) -m mkdocs build -q --strict -d out/docs
	@echo "look at out/docs/index.html"

clean:
	rm -rf .venv out build .cache
