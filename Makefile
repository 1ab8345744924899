# Everything from a fresh Debian or Ubuntu machine with Python 3.11 or newer and make; `make help` lists it.

PYTHON ?= python3
# uv of this machine where there is one that works, else one of our own in .uv
UV := $(shell uv --version >/dev/null 2>&1 && command -v uv || echo .uv/bin/uv)
OWN_UV := $(filter .uv/bin/uv,$(UV))
STAMP := .venv/.made-from-lock

# This machine's Python: uv fetches none.
export UV_PYTHON_DOWNLOADS := never
export UV := $(UV)

# Where PYTHONDONTWRITEBYTECODE is set, each process would compile all of it anew: half a second.
COMPILE := .venv/bin/python -m compileall -q wire supervisor teleop sim virtual deploy bench tests

.DEFAULT_GOAL := help
.PHONY: help setup run test unit system demo proof proofs coverage check bench docs picture mutation faults campaign

help: ## this list
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "make %-8s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: $(STAMP) ## the environment alone: .venv from uv.lock

run: $(STAMP) ## drive the robot by keyboard; without a terminal, play the demo
	@if [ -t 0 ] && [ -t 1 ]; then exec .venv/bin/lifeline up; else exec .venv/bin/lifeline demo; fi

test: $(STAMP) ## the checks and the tests, with real processes; what each commit must pass
	$(COMPILE)
	$(MAKE) --no-print-directory check unit system

# No test here looks at the real clock: as many at a time as there are cores.
unit:
	.venv/bin/pytest tests/unit tests/component -m "not proof" --numprocesses=auto --dist=worksteal

# Real processes, which mostly wait: four tests at a time, then one at a time those that measure.
system:
	.venv/bin/pytest tests/system -m "not timed and not demo" --numprocesses=4 --dist=worksteal --durations=10
	.venv/bin/pytest tests/system -m timed --durations=10

demo: $(STAMP) ## play the demo from the checkout and from an installed wheel (two minutes)
	.venv/bin/pytest -s tests/system -m demo

proof: $(STAMP) ## the law's proofs, and whether the unit tests reach every branch of the pure modules (a quarter of an hour)
	$(COMPILE)
	$(MAKE) --no-print-directory --jobs=2 --output-sync=target proofs coverage

proofs:
	.venv/bin/pytest -s tests/unit tests/component -m proof --durations=10

coverage:
	.venv/bin/coverage run -m pytest tests/unit -m "not proof"
	.venv/bin/coverage report

check: $(STAMP) ## ruff, pyright and import-linter
	.venv/bin/ruff check
	.venv/bin/ruff format --check
	.venv/bin/pyright
	.venv/bin/lint-imports

bench: $(STAMP) ## time and memory of the law, supervisor, teleop and sim; about four minutes
	.venv/bin/python -m bench

docs: $(STAMP) ## write the generated parts and the drawings of docs/ anew
	.venv/bin/python -m docs.generate.safety_law
	.venv/bin/python -m docs.generate.draw_safety_law
	.venv/bin/python -m docs.generate.draw_dashboard
	.venv/bin/python -m docs.generate.draw_lab
	.venv/bin/python -m docs.generate.crash_safety
	.venv/bin/python -m docs.generate.draw_crash_safety

faults: $(STAMP) ## every class of fault three times on the real processes, and 1,000 trials in virtual time; a quarter of an hour
	.venv/bin/lifeline faults --trials 3 --minutes 8
	.venv/bin/lifeline faults --virtual --seeds 1000

campaign: $(STAMP) ## every class of fault 300 times on the real processes; hours, and it resumes
	.venv/bin/lifeline faults --trials 300 --out docs/campaign/real.jsonl

mutation: $(STAMP) ## mutate the law; every mutant must fail a test (twenty minutes)
	.venv/bin/python -m tests.mutation

picture: $(STAMP) ## render the warehouse and the animation of the README anew; a few minutes
	.venv/bin/python -m sim.render --out docs/images/warehouse.png
	.venv/bin/python -m docs.generate.draw_animation

$(STAMP): uv.lock pyproject.toml | $(OWN_UV)
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "Lifeline needs Python 3.11 or newer; this is $$($(PYTHON) --version 2>&1)." \
	    "Name a newer one: make PYTHON=python3.12" >&2; exit 1; }
	$(UV) sync --locked --all-extras --compile-bytecode --python $(PYTHON)
	@.venv/bin/python -c 'from deploy.stack.supervisord import fetch, find_uv; fetch(find_uv(), print)'
	$(COMPILE)
	@touch $@

.uv/bin/uv:
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
	  echo "uv is missing, and this Python cannot make an environment to fetch it:" \
	    "apt install python3-venv" >&2; exit 1; }
	$(PYTHON) -m venv .uv
	.uv/bin/pip install --quiet uv
