# `make` lists the targets. Every target that needs Python first makes .venv from requirements.lock.
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:

BIN := .venv/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet
# Ten times as fast, from the same files by their hashes; it does not know of pip's own index.
UV := $(BIN)/uv pip install --quiet --python $(BIN)/python --only-binary=:all: --require-hashes
INSTALLED := .venv/installed
PYTHONS ?= python3.13 python3.12 python3.11 python3.14 python3

# What tests run: compilers, emulators of AVR chips and Cortex-M, checkers, a browser.
TOOLS := gcc g++ clang avr-gcc avr-size simavr arm-none-eabi-gcc qemu-system-arm cppcheck frama-c chromium
HEADERS := /usr/include/simavr/sim_avr.h /usr/lib/avr/include/avr/io.h \
  /usr/share/arduino/hardware/arduino/avr/cores/arduino/Arduino.h \
  /usr/lib/llvm-*/lib/clang/*/lib/linux/libclang_rt.asan-*.a
PACKAGES := gcc g++ clang libclang-rt-dev gcc-avr avr-libc arduino-core-avr simavr libsimavr-dev libelf-dev \
  gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm cppcheck frama-c-base chromium

# Where `make prove` begins to draw examples, and how often it draws all of them anew.
SEED ?= $(shell od -An -N3 -tu4 /dev/urandom | tr -d ' ')
ROUNDS ?= 10

.PHONY: help demo test tests prove dist lint format docs docs-links bench calibrate lock python tools clean

help: ## List the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  \1\t\2/p' Makefile | expand -t 12

demo: $(INSTALLED) ## Reproduce the paper and write the report
	@$(BIN)/swimbladder reproduce --out report/paper
	@echo "The report is in $(CURDIR)/report/paper"

test: $(INSTALLED) ## Lint, check types and layers, and run every test
	@$(MAKE) --no-print-directory --jobs=2 lint tests

tests: $(INSTALLED)
	@PYTHONDONTWRITEBYTECODE= $(BIN)/pytest -n 2 --dist loadfile --no-loadscope-reorder

prove: SEED := $(SEED)
prove: $(INSTALLED) ## Hunt for counter-examples and prove what takes long (again: SEED=N ROUNDS=1)
	@for seed in $$(seq $(SEED) $$(($(SEED) + $(ROUNDS) - 1))); do \
	  echo "Random examples of every property; the same again: make prove SEED=$$seed ROUNDS=1"; \
	  $(BIN)/pytest -q -n 2 -m hypothesis --hypothesis-profile=prove --hypothesis-seed=$$seed || exit; \
	done
	@$(BIN)/pytest -n 2 -m "prove and not hypothesis"
	@$(BIN)/python scripts/mutate.py --number 300 --seed 1 --jobs 2

dist: $(INSTALLED) ## Build wheel and sdist, and try the wheel in a fresh environment of each of PYTHONS
	@$(BIN)/python scripts/dist.py $(PYTHONS)

lint: $(INSTALLED) ## Check style, types, layers, words and the size of the source
	@$(BIN)/ruff check
	@$(BIN)/ruff format --check
	@$(BIN)/mypy
	@$(BIN)/lint-imports --no-logo
	@$(BIN)/python scripts/budget.py

format: $(INSTALLED) ## Format the code and mend what the linter can mend
	@$(BIN)/ruff check --fix
	@$(BIN)/ruff format

docs: $(INSTALLED) ## Build the site, run its gallery and check its references: build/docs/index.html
	@MPLBACKEND=Agg $(BIN)/sphinx-build -W --keep-going -q -b html -d build/doctrees docs build/docs
	@echo "The site is in $(CURDIR)/build/docs/index.html"

docs-links: $(INSTALLED) ## Ask whether the addresses on the site still answer (needs the network)
	@$(BIN)/sphinx-build -q -b linkcheck -D plot_gallery=0 -d build/doctrees-links docs build/docs-links

bench: $(INSTALLED) ## Time the package side by side with its peers
	@$(BIN)/python -m benchmarks

calibrate: $(INSTALLED) ## Simulate pool campaigns and say how far the intervals of identify can be believed
	@$(BIN)/python -m studies.calibration

lock: $(INSTALLED) ## Bring requirements.lock up to date with pyproject.toml (LOCK_FLAGS=--upgrade: and every pin)
	@$(BIN)/uv pip compile --quiet --universal --python-version 3.11 --extra dev --extra docs --generate-hashes --no-build \
	  --fork-strategy fewest --no-emit-index-url --no-emit-find-links --no-annotate --no-header \
	  $(LOCK_FLAGS) --output-file requirements.lock pyproject.toml

python: ## Name the interpreter that .venv will be made with
	@for python in $(PYTHONS); do \
	  $$python -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || continue; \
	  found=$$python; \
	  $$python -c 'import ensurepip, venv' 2>/dev/null || continue; \
	  echo $$python; exit 0; \
	done; \
	if [ -n "$$found" ]; then echo "$$found cannot make a virtual environment: apt install python3-venv" >&2; \
	else echo "no Python 3.11 or newer among: $(PYTHONS)" >&2; fi; \
	exit 1

tools: ## Install what the tests of the firmware run, where it is missing (as root, by apt-get)
	@missing=; for tool in $(TOOLS); do command -v $$tool >/dev/null || missing="$$missing $$tool"; done; \
	for header in $(HEADERS); do test -e $$header || missing="$$missing $$header"; done; \
	if [ -z "$$missing" ]; then exit 0; fi; \
	if [ "$$(id -u)" != 0 ] || ! command -v apt-get >/dev/null; then \
	  echo "missing:$$missing; as root: apt-get install $(PACKAGES)" >&2; exit 1; fi; \
	apt-get update --quiet=2 && DEBIAN_FRONTEND=noninteractive \
	  apt-get install --quiet=2 --yes --no-install-recommends $(PACKAGES) >/dev/null

clean: ## Remove .venv and everything that was generated
	rm -rf .venv build dist report .hypothesis .mypy_cache .pytest_cache .ruff_cache .import_linter_cache
	find src tests -name __pycache__ -prune -exec rm -rf {} +

.venv/locked: requirements.lock
	@test -x $(BIN)/python || { python=$$($(MAKE) --silent python) && $$python -m venv .venv; }
	@echo "Installing requirements.lock into .venv"
	@sed -n '/^uv==/,/[^\\]$$/p' requirements.lock > .venv/uv.txt && $(PIP) --only-binary=:all: -r .venv/uv.txt
	@{ ! $(BIN)/python -m pip config list | grep -q '\.index-url=' && $(UV) -r requirements.lock; } \
	  || $(PIP) --no-compile --only-binary=:all: -r requirements.lock
	@$(BIN)/python -m compileall -qq -j 0 -x '/tests?/' .venv/lib || true
	@touch $@

$(INSTALLED): .venv/locked pyproject.toml
	@$(PIP) --no-deps --no-build-isolation -e .
	@touch $@
