# `make demo` and `make test` do all set-up themselves: a virtual environment in .venv, the Python packages, and an LLVM.
SHELL := /bin/bash
.DEFAULT_GOAL := help

VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.scarl-setup-done
TEST_STAMP := $(VENV)/.scarl-test-setup-done
DOCS_STAMP := $(VENV)/.scarl-docs-setup-done
OUT ?= demo_out
QUALITY ?= draft
JOBS ?= 2
PYTEST_ARGS ?=

.PHONY: help setup demo test test-slow test-gpu checks lint style types imports format bench validation docs notebooks clean distclean

ifeq ($(MAKELEVEL),0)
.NOTPARALLEL: # whatever -j says: two set-ups at once would write into one environment
endif

help: ## Show this list
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "  make %-10s %s\n", $$1, $$2}'

$(STAMP): pyproject.toml scripts/setup_env.sh
	@bash scripts/setup_env.sh $(VENV) && touch $@

# what tests, linters and the site need comes in one go: pip takes half a minute to find out what fits together
$(TEST_STAMP): pyproject.toml scripts/setup_env.sh
	@bash scripts/setup_env.sh $(VENV) test,docs && touch $(STAMP) $(DOCS_STAMP) $@

setup: $(STAMP) ## Make .venv with all that is needed; does nothing when it is up to date
	@echo "setup: $(VENV) is ready"

demo: $(STAMP) ## Simulate a short synchronized dataset and its contact sheet into OUT (demo_out)
	$(BIN)/scarl-sionna demo --out $(OUT) --quality $(QUALITY)

# compiled modules are kept, whatever the environment says: a run starts some fifty processes
test test-slow test-gpu: export PYTHONDONTWRITEBYTECODE =

test: checks ## Run the linters, build the documentation site, and run all tests but the slow ones
	$(BIN)/python -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder $(PYTEST_ARGS)

test-slow: checks ## Run the linters, build the documentation site, and run all tests
	$(BIN)/python -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder --run-slow $(PYTEST_ARGS)

test-gpu: $(TEST_STAMP) ## Run every solver, camera and lidar on CUDA beside the processor; skips where no device is
	$(BIN)/python -m pytest -m gpu $(PYTEST_ARGS) tests/gpu

checks: $(TEST_STAMP)
	@$(MAKE) --no-print-directory -j $(JOBS) lint docs # each takes one core

lint: types style imports ## Check style, types and the direction of imports

style: $(TEST_STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(TEST_STAMP)
	MYPY_NUM_WORKERS=$(JOBS) $(BIN)/mypy

imports: $(TEST_STAMP)
	$(BIN)/lint-imports

format: $(TEST_STAMP) ## Format the code
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(STAMP) ## Run the benchmarks: error against time
	@for name in synthesis radar_frame camera lidar frame; do echo "== benchmarks/$$name.py"; $(BIN)/python benchmarks/$$name.py || exit 1; done

validation: $(TEST_STAMP) ## Set the simulator beside measurements again, and write docs/validation.md
	@for name in ground people vehicles layers weather motion front_end; do echo "== benchmarks/validation/$$name.py"; \
		$(BIN)/python benchmarks/validation/$$name.py || exit 1; done
	@if [ -n "$(CAPTURES)" ]; then $(BIN)/python benchmarks/validation/captures.py "$(CAPTURES)"; \
		else echo "== captures: kept; CAPTURES=folder of the recordings renews them"; fi
	$(BIN)/python benchmarks/validation/page.py --figure

notebooks: $(TEST_STAMP) ## Run all notebooks; copies with figures go to build/notebooks
	$(BIN)/python scripts/run_notebooks.py

$(DOCS_STAMP): $(STAMP)
	@bash scripts/setup_env.sh $(VENV) docs && touch $@

docs: $(DOCS_STAMP) ## Build the documentation site into build/site; fails on any warning
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo "docs: build/site/index.html is ready"

clean: ## Remove caches and outputs, but not .venv
	rm -rf build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache $(OUT)
	find . -name __pycache__ -not -path './$(VENV)/*' -prune -exec rm -rf {} +

distclean: clean ## Remove .venv, too
	rm -rf $(VENV)
