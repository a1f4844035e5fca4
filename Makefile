# Everything happens inside .venv, which the first target that needs it creates.
# Needed from the system: python 3.11 or newer with venv, make, git.

.DEFAULT_GOAL := help
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DELETE_ON_ERROR:
MAKEFLAGS += --no-print-directory

PYTHON ?= $(shell command -v python3.11 || command -v python3 || echo python3)
VENV := .venv
BIN := $(VENV)/bin
JOBS ?= 2
ARGS ?=
STUDY ?= studies/survey.toml

# The batch is spread over threads by the environments; a threaded BLAS underneath would fight them.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
# Without a display MuJoCo must be told to render off screen; setup notes down what works here.
ifeq ($(DISPLAY)$(WAYLAND_DISPLAY),)
HEADLESS := if [ -z "$${MUJOCO_GL:-}" ] && [ -s $(VENV)/mujoco_gl ]; then \
	export MUJOCO_GL="$$(cat $(VENV)/mujoco_gl)"; fi;
endif

.PHONY: help setup demo play docs study test test-fast check format bench papers fuzz soak dist clean

help:  ## List the targets.
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "  make %-10s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: $(VENV)/.installed $(VENV)/mujoco_gl $(VENV)/.compiled  ## Install into .venv and compile, once.
	@:

demo: setup  ## A quadruped walks, learns through two action layers; writes runs/demo/report.html.
	@$(HEADLESS) $(BIN)/python -m eval.demo $(ARGS)

play: setup $(VENV)/.play  ## Push a walking robot in the browser (ARGS="--beside joint_position").
	@$(HEADLESS) $(BIN)/python -m eval.play $(ARGS)

docs: setup $(VENV)/.docs  ## Build the documentation's site, to be opened at site/index.html.
	@$(HEADLESS) $(BIN)/python -m eval.tools.site.pictures
	@NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build

study: setup  ## Train what a study names, write its page (STUDY=studies/survey.toml).
	@$(HEADLESS) $(BIN)/python -m train.sweep $(STUDY) $(ARGS)
	@$(HEADLESS) $(BIN)/python -m eval.study $(STUDY) --write-docs

test: setup  ## Run every test.
	@$(HEADLESS) $(BIN)/python -m pytest -q -n $(JOBS) --dist worksteal $(ARGS)

test-fast: setup  ## Run the tests that one runs while one writes: all but the long ones.
	@$(HEADLESS) $(BIN)/python -m pytest -q -n $(JOBS) --dist worksteal -m "not slow" $(ARGS)

check: setup  ## Lint, formatting, types.
	@$(BIN)/ruff check --quiet
	@$(BIN)/ruff format --quiet --diff
	@$(BIN)/mypy --no-error-summary

format: setup  ## Format the code and sort its imports.
	@$(BIN)/ruff check --quiet --select I --fix
	@$(BIN)/ruff format --quiet

bench: setup  ## Measure the costs per robot and layer (ARGS="--help" for the choices).
	@$(HEADLESS) $(BIN)/python -m eval.tools.bench $(ARGS)

papers: setup  ## Run the papers' experiments, write runs/papers/report.html (ARGS=--quick: in 2 minutes).
	@$(HEADLESS) $(BIN)/python -m eval.papers $(ARGS)

fuzz: setup  ## Search for inputs that break something (ARGS="--minutes 5").
	@$(HEADLESS) $(BIN)/python -m pytest -q -s tests/property --minutes 5 $(ARGS)

soak: setup  ## Run every layer for long, see that nothing grows (ARGS="--steps 1e7").
	@$(HEADLESS) $(BIN)/python -m eval.tools.soak $(ARGS)

dist: setup $(VENV)/.dist  ## Build wheel and source archive, use them in a fresh environment (PYTHON=python3.13).
	@rm -f dist/fbid_gym-*
	@$(BIN)/python -m build --no-isolation --outdir dist . > /dev/null
	@$(HEADLESS) PYTHON="$(PYTHON)" $(BIN)/python -m pytest -v -rP eval/tools/dist.py $(ARGS)

clean:  ## Remove the environment and the caches; keep runs/.
	rm -rf $(VENV) build dist site .pytest_cache .mypy_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(BIN)/python:
	@command -v "$(PYTHON)" > /dev/null && "$(PYTHON)" -c \
		'import sys; sys.exit(sys.version_info < (3, 11))' || { \
		echo "Python 3.11 or newer is needed. Point to one: make $(MAKECMDGOALS) PYTHON=/path/to/python" >&2; \
		exit 1; }
	@"$(PYTHON)" -m venv $(VENV) || { rm -rf $(VENV); \
		echo "Could not create $(VENV): is the venv module installed (Debian: python3-venv)?" >&2; exit 1; }

$(VENV)/.installed: pyproject.toml constraints.txt | $(BIN)/python
	@echo "Installing into $(VENV) ..."
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check \
		--constraint constraints.txt --editable ".[dev]"
	@touch $@

# Playwright drives a browser in the page's tests.
$(VENV)/.play: $(VENV)/.installed
	@echo "Installing the live page ..."
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check \
		--constraint constraints.txt --editable ".[play]" playwright
	@touch $@

$(VENV)/.docs: $(VENV)/.installed
	@echo "Installing what builds the documentation ..."
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check \
		--constraint constraints.txt --editable ".[docs]"
	@touch $@

$(VENV)/.dist: $(VENV)/.installed
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check \
		--constraint constraints.txt --editable ".[dist]"
	@touch $@

# Done once; after a change of the sources, what runs is compiled as it is used.
$(VENV)/.compiled: $(VENV)/.installed | $(VENV)/mujoco_gl
	@$(HEADLESS) $(BIN)/python -m fbid_gym.compile_all
	@touch $@

# Which off-screen backend works: EGL, else OSMesa. Missing libraries are installed where that is
# possible (Debian, root), otherwise named; everything but rendering works without them, so this
# does not fail, and the next make tries again.
RENDERS := -c 'import mujoco; c = mujoco.GLContext(64, 64); c.make_current(); c.free()'

$(VENV)/mujoco_gl: $(VENV)/.installed
	@probe() { for gl in egl osmesa; do \
		if MUJOCO_GL=$$gl $(BIN)/python $(RENDERS) > /dev/null 2>&1; then echo $$gl > $@; return 0; fi; \
	done; return 1; }; \
	if probe; then exit 0; fi; \
	if [ "$$(id -u)" = 0 ] && command -v apt-get > /dev/null; then \
		echo "Installing libraries for off-screen rendering ..."; \
		(apt-get -qq update && DEBIAN_FRONTEND=noninteractive apt-get -qq install --yes \
			--no-install-recommends libegl1 libgl1 libgl1-mesa-dri libopengl0) > /dev/null || true; \
		if probe; then exit 0; fi; \
	fi; \
	echo "Off-screen rendering is not available: neither EGL nor OSMesa loads. Videos and the" >&2; \
	echo "report's pictures need it. On Debian, as root: apt-get install libegl1 libgl1-mesa-dri" >&2
