# Every target does its own set-up and repeats none of it; see docs/installation.md.
#   PUNNET_VENV=/elsewhere  where the virtual environment is (default .venv)
#   PYTHON=python3.12       which Python makes it (default: the first 3.11, 3.12 or 3.13 that is found)

SHELL := /bin/bash
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help demo test lint format bench docs pin clean base dev rendering

# The environment is a path with possible spaces, so it lives in shell variables, never in a make target.
export PUNNET_VENV ?= $(CURDIR)/.venv
# The checkout's own code whatever is installed, and no packages of a sourced ROS.
export PYTHONPATH := $(CURDIR)/src
export PYTHONNOUSERSITE := 1
RUN := source scripts/activate.sh &&

help:  ## this list
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/  make \1\t\2/p' Makefile | expand -t 16

demo: base rendering  ## pick strawberries in the simulator; the report is runs/demo/report.html
	@$(RUN) python -m punnet demo --out runs/demo --force

test: dev rendering  ## all tests on all cores (PYTEST_ARGS="-k detect" to choose, "-n 0" for one process, "--cov" for coverage)
	@$(RUN) OMP_NUM_THREADS=1 python -m pytest -n auto --maxprocesses 8 --dist worksteal $(PYTEST_ARGS)

lint: dev  ## ruff and mypy --strict
	@$(RUN) python -m ruff check .
	@$(RUN) python -m ruff format --check .
	@$(RUN) python -m mypy --strict

format: dev  ## let ruff format and fix what it can
	@$(RUN) python -m ruff check --fix .
	@$(RUN) python -m ruff format .

bench: dev rendering  ## the quick benchmarks, as tables
	@$(RUN) python benchmarks/quick.py

docs: dev  ## the documentation as HTML in site/
	@$(RUN) python -m sphinx --fail-on-warning --keep-going --quiet -b html docs site && echo "documentation: site/index.html"

pin: dev  ## write constraints.txt anew from what the package index offers today
	@$(RUN) python scripts/pin.py

clean:  ## remove what make made, the virtual environment included
	@rm -rf "$$PUNNET_VENV" site dist build .coverage .pytest_cache .mypy_cache .ruff_cache .hypothesis

base:
	@scripts/environment.sh base

dev: base
	@scripts/environment.sh dev

rendering: base
	@$(RUN) scripts/rendering.sh
