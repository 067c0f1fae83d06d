# `make` alone prints this help.                                              (GNU make, bash)
#
#   VERIFY_PYTHON=/path   the Python that .venv is built on (else one from 3.12 on is searched)
#   DOLFINX=system        use the DOLFINx of that Python instead of the wheel
#   JOBS=n                processes that tests and the demo run side by side (else all cores)

CHECKS := types layers lint format words
SHELL := /bin/bash
MAKEFLAGS += --no-print-directory
.DEFAULT_GOAL := help
.PHONY: help setup demo test heavy bench check docs results size clean lock $(CHECKS)

BIN := $(or $(VERIFY_VENV),.venv)/bin
JOBS ?= $(shell nproc)
DEMO := build/demo

# One thread per process: cores are filled by processes, and a timing is that of one thread.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
export MKL_NUM_THREADS ?= 1
export NUMBA_NUM_THREADS ?= 1
# Many short processes: one that may not keep what Python compiles compiles every module again.
unexport PYTHONDONTWRITEBYTECODE
# Nothing here opens a window.
export MPLBACKEND ?= Agg
export PYVISTA_OFF_SCREEN ?= true

PYTEST := $(BIN)/python -m pytest

help: ## print this help
	@sed -n 's/^#   /  /p' $(MAKEFILE_LIST)
	@echo
	@sed -nE 's/^([a-z]+):.*## (.*)/\1|\2/p' $(MAKEFILE_LIST) \
	    | while IFS='|' read -r name what; do printf '  make %-7s %s\n' "$$name" "$$what"; done
	@echo
	@echo "  one thread per process: OMP_NUM_THREADS=$(OMP_NUM_THREADS) NUMBA_NUM_THREADS=$(NUMBA_NUM_THREADS); JOBS=$(JOBS)"

setup: ## make .venv ready (every other target does it first)
	@.ci/setup

demo: setup ## solve the demo cases and write build/demo/report.html
	@rm -rf $(DEMO)
	@$(BIN)/verify run -k demo -j $(JOBS) --out $(DEMO); code=$$?; \
	    if [ -f $(DEMO)/report.html ]; then echo "Report: $(CURDIR)/$(DEMO)/report.html"; fi; \
	    exit $$code

# No claim about time: what passes here does so however busy the machine is. Kernels are compiled
# before, or both workers and all that they start compile the same ones at once.
test: setup ## run the tests, without claims about time and heavy studies
	@echo "compiling the kernels that are not yet compiled (a minute the first time)"
	@$(BIN)/python -m verify doctor --compile >/dev/null
	@$(PYTEST) -n $(JOBS) --dist loadfile --no-loadscope-reorder -m "not timing and not heavy"

heavy: setup ## run the heavy studies (minutes to hours)
	@$(PYTEST) -m heavy --timeout 0

# One after the other; a claim that fails while other programs run is repeated, then undecided;
# with VERIFY_SHARED_MACHINE=1 also where the other programs are not to be seen (continuous integration).
bench: setup ## run the claims about time, print medians with their spread, write docs/results/speed.md
	@VERIFY_SPEED=1 $(PYTEST) -m "timing and not heavy" -p no:xdist -rs --benchmark-columns=median,iqr,rounds \
	    $$(grep -rl --include='*.py' 'mark\.timing' tests)

# Side by side, the longest first; each says its words at its end.
check: setup ## ruff, format, types, layers, words
	@$(MAKE) --jobs=$(JOBS) --keep-going --output-sync=target $(CHECKS)

types:
	$(BIN)/mypy
lint:
	$(BIN)/ruff check .
format:
	$(BIN)/ruff format --check .
layers:
	$(BIN)/lint-imports
words:
	$(BIN)/python .ci/words

lock: ## resolve the lock files again from pyproject.toml (needs uv; UPGRADE=1 takes new versions)
	@.ci/lock $(if $(UPGRADE),--upgrade)

# What the site needs beyond .venv is installed into it once, by hash.
docs: setup ## build the documentation site, build/docs/index.html
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --only-binary :all: \
	    --require-hashes --requirement .ci/requirements-docs.lock
	@$(BIN)/python .ci/docs

# One solve after the other, for their times are compared; JOBS=2 is faster, and no time is ranked.
results: setup ## run the protocol of the method comparison and write docs/results (hours)
	@$(BIN)/python .ci/results $(if $(findstring command,$(origin JOBS)),$(JOBS),1)

size: setup ## print code lines per package, the longest functions, circles of imports
	@$(BIN)/python .ci/size

clean: ## remove what was built, but not .venv
	rm -rf build dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .benchmarks
	find verify reference tests -type d -name __pycache__ -prune -exec rm -rf {} +
