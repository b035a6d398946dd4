# Everything runs inside .venv, which the first target that needs it creates from Python alone.
PYTHON ?= python3
BIN := .venv/bin
INSTALLED := .venv/.installed
STAMP := .venv/.developer

.PHONY: demo dev test test-all hard-cases bench lint notebooks figures wheel docs clean

demo: $(INSTALLED)
	$(BIN)/bseries modified rk4 --order 5
	$(BIN)/bseries modified stormer-verlet-kdk --order 3

dev: $(STAMP)

test: $(STAMP)
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "not slow" --ignore tests/benchmarks \
		tests bseries_base trees integrators bseries README.md

test-all: $(STAMP)
	$(BIN)/python -m pytest -n 2 --dist worksteal

hard-cases: $(STAMP)
	$(BIN)/python -m pytest -n 2 --dist worksteal tests/hard_cases --hard-cases-page build/hard-cases.md

bench: $(STAMP)
	mkdir -p build
	$(BIN)/python -m benchmarks --keep --output build/benchmarks.md

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright

notebooks: $(STAMP)
	$(BIN)/python -m notebooks

figures: $(STAMP)
	$(BIN)/python docs/draw_figures.py

# `build/lib` would keep modules that are no longer there.
wheel: $(STAMP)
	rm -rf build/lib build/wheels
	$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir build/wheels .

docs: $(STAMP)
	$(MAKE) -j2 notebooks figures wheel
	$(BIN)/sphinx-build --fail-on-warning --quiet -d build/doctrees docs build/docs

clean:
	rm -rf .venv .pytest_cache .ruff_cache build docs/notebooks docs/figures docs/reference/generated *.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# Modules are compiled as they are imported: most of SymPy's and numba's never are.
$(INSTALLED): pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -e .
	touch $(INSTALLED)

# What developing needs beside the package, three times as much, is installed only where it is used.
$(STAMP): $(INSTALLED)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[dev]"
	touch $(STAMP)
