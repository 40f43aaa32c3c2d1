# Everything runs in .venv; the first call of any target sets it up.
SHELL := /bin/bash
VENV := .venv
PY := $(VENV)/bin/python
PYTEST := $(PY) -m pytest
# A worker keeps to its half of the files, so that what a file's tests share is made once.
TYPED := fem predictors converters toolkit research __init__.py __main__.py
WORKERS := $(PYTEST) -n 2 --dist worksteal
STAMP := $(VENV)/.ready

# Rewritten tests and checked modules are kept: making them anew costs ten seconds a run.
unexport PYTHONDONTWRITEBYTECODE

# A thread for each of the two workers: four on two cores wait for each other.
quick inside outside long: export OMP_NUM_THREADS := 1

.PHONY: setup demo check quick test inside long outside test-all newest wheel bench gallery lint types notebooks docs figures clean

setup: $(STAMP)

$(STAMP): pyproject.toml constraints.txt .ci/setup
	@VENV=$(VENV) bash .ci/setup
	@touch $@

demo: $(STAMP)
	@mkdir -p out/demo
	@$(PY) -m autophyx_tet.toolkit.asset.bonsai out/demo/bonsai.glb
	@$(VENV)/bin/autophyx-tet run out/demo/bonsai.glb -o out/demo \
		--text "the pot is ceramic, the soil is moist soil, the trunk is oak, the foliage is leaves"
	@echo "look at out/demo/report.html"

lint: $(STAMP)
	@$(PY) -m ruff check .
	@$(PY) -m ruff format --check .
	@$(PY) -m codespell_lib

# The checkout is the package: its relative imports are found under the package's name.
types: $(STAMP)
	@mkdir -p .cache/types && ln -sfn ../.. .cache/types/autophyx_tet
	@$(VENV)/bin/ty check --python $(VENV) $(addprefix .cache/types/autophyx_tet/,$(TYPED))

# Types and quick tests side by side: together they leave neither of two cores idle.
check: lint
	@$(MAKE) --no-print-directory --output-sync=target -j2 types quick

quick: $(STAMP)
	@$(WORKERS) -m "not slow and not long and not real and not browser and not external"

# Tests that need nothing but .venv and seconds each; `long` and `outside` have all others.
test: lint
	@$(MAKE) --no-print-directory -j2 types inside

inside: $(STAMP)
	@$(WORKERS) -m "not long and not real and not browser and not external" --durations=40 -rs

# Pages and notebooks from top to bottom, the wheel, damaged files and sentences by the thousand.
long: $(STAMP)
	@AUTOPHYX_REQUIRE_ALL=1 $(WORKERS) -m "long and not real and not browser and not external" --durations=40

# Real assets, a browser and outside programs, which are installed where they are missing.
outside: $(STAMP)
	@bash .ci/system --all
	@EXTRAS=external,openclip bash .ci/setup
	@AUTOPHYX_REQUIRE_ALL=1 $(WORKERS) -m "real or browser or external" --durations=40

test-all: test
	@$(MAKE) --no-print-directory long outside

# The quick tests and the wheel with the newest Python that we promise, in an environment of its own.
newest:
	@python=$$(bash .ci/python 3.12) && PYTHON=$$python $(MAKE) VENV=.venv-3.12 quick wheel

wheel: $(STAMP)
	@$(PYTEST) tests/test_package.py

bench: $(STAMP)
	@$(PY) benchmarks/statics.py --sizes S,M

# Films of splats, eight commands as of AutoPhyX's figure 5: out/films and docs/films.
gallery: $(STAMP)
	@$(PY) benchmarks/splat_films.py --gallery --output out/films

notebooks: $(STAMP)
	@$(PY) .ci/notebooks

# The figures of README.md from docs/data, and the pictures whose scripts take seconds.
figures: demo
	@$(PY) .ci/figures
	@cp out/demo/picture.png docs/bonsai.png
	@$(PY) benchmarks/driven_picture.py docs/driven_splats.png

docs: $(STAMP)
	@$(PY) -m mkdocs build -q --strict -d out/docs
	@echo "look at out/docs/index.html"

clean:
	rm -rf .venv .venv-3.12 out build .cache
