# Everything sets itself up from python3 and the package index: `make run`, `make test`, `make bench`, `make lint`.
PYTHON ?= python3
WORKERS ?= 2
ARGS ?=

BIN := .venv/bin
READY := .venv/.ready
CACHE := $(CURDIR)/.cache

.PHONY: run test bench lint clean
.DELETE_ON_ERROR:

run: $(READY)
	@$(BIN)/crowd run configs/wade.yaml $(ARGS)

test: export JAX_COMPILATION_CACHE_DIR := $(CACHE)/jax
test: export JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS := 0.2
test: $(READY)
	@$(BIN)/python -m pytest -n $(WORKERS) --dist loadfile $(ARGS)

bench: $(READY)
	@$(BIN)/python -m benchmarks.run $(ARGS)

lint: $(READY)
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/pyright

# Recordings in runs/ stay.
clean:
	@rm -rf .venv .cache .pytest_cache .ruff_cache build dist
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +

# One lock per Python: JAX's newest version for 3.11 is older than for 3.12 and later.
$(READY): pyproject.toml requirements/lock-py311.txt requirements/lock-py312.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "Python 3.11 or newer is needed; PYTHON=... names another one" >&2; exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv .venv
	@echo "installing into .venv (once)"
	@lock=$$($(BIN)/python -c 'import sys; print("py311" if sys.version_info < (3, 12) else "py312")'); \
	  $(BIN)/python -m pip install --disable-pip-version-check --constraint requirements/lock-$$lock.txt \
	    --editable '.[test,dev]' > .venv/install.log 2>&1 || { cat .venv/install.log >&2; exit 1; }
	@touch $@
