# All targets work on a fresh Debian or Ubuntu machine with Python 3.11 or newer and make; `make help` lists them.

PYTHON ?= python3
# The machine's own uv if it works, else a copy in .uv
UV := $(shell uv --version >/dev/null 2>&1 && command -v uv || echo .uv/bin/uv)
OWN_UV := $(filter .uv/bin/uv,$(UV))
STAMP := .venv/.made-from-lock
# What driving needs, in the same directory; the whole environment includes it.
DRIVE_STAMP := .venv/.made-to-drive
ROS2_STAMP := .ros2/.made-from-lock
RMW_ZENOH_STAMP := .rmw-zenoh/.made-from-lock
PEERS_STAMP := .peers/.made-from-lock
# This package contains axe-core; its dependencies are not needed.
AXE := .axe/axe_playwright_python/axe.min.js

# Use the machine's Python: uv must not download one.
export UV_PYTHON_DOWNLOADS := never
export UV := $(UV)

# With PYTHONDONTWRITEBYTECODE, each process would compile all modules again, which takes half a second.
COMPILE := .venv/bin/python -m compileall -q wire supervisor teleop station sim ros2 virtual deploy recordings commission passport faults lifeline bench tests

.DEFAULT_GOAL := help
# rclpy comes from ROS 2 Jazzy if it is installed, else from PyPI's wheels, which exist for CPython on x86_64 Linux only.
ROS := $(wildcard /opt/ros/jazzy)
ROS2_PYTHON := $(if $(ROS),/usr/bin/python3.12,$(PYTHON))
HAS_RCLPY := $(ROS2_PYTHON) -c 'import platform, sys; sys.exit(not ("$(ROS)" or \
  (sys.implementation.name, sys.platform, platform.machine()) == ("cpython", "linux", "x86_64") \
  and (3, 11) <= sys.version_info < (3, 15)))'
NO_RCLPY := ROS 2 is not installed in /opt/ros/jazzy, and PyPI has no rclpy for this machine \
  (only for CPython 3.11 to 3.14 on x86_64 Linux)
NO_RMW_ZENOH := zenoh-ros2-sdk cannot be installed on this machine

.PHONY: help setup ros2 test-ros2 run test unit component smoke system flaky first-minute timed demo proof proofs coverage fifth check bench bench-peers bench-robots bench-fleet bench-link bench-station docs picture passport mutation faults campaign

help: ## print this list
	@awk -F ':.*## ' '/^[a-z0-9-]+:.*## / { printf "make %-13s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: $(STAMP) ## create the environment .venv from uv.lock

ros2: $(ROS2_STAMP) ## create the environment .ros2 with rclpy, in which `python -m ros2` runs

# With LIFELINE_UNDER_MAKE, it exits with 0, or make would add `Error 2` to its sentence.
run: $(DRIVE_STAMP) ## drive the robot by keyboard; without a terminal, play the demo
	@if [ -t 0 ] && [ -t 1 ]; then echo "lifeline: to drive in a browser instead, run .venv/bin/lifeline up --station --drive"; exec env LIFELINE_UNDER_MAKE=1 .venv/bin/lifeline up; else exec .venv/bin/lifeline demo; fi

test: $(STAMP) ## run the checks, the unit and component tests, and the smoke tests with real processes; each commit must pass them (four minutes)
	$(COMPILE)
	$(MAKE) --no-print-directory --jobs=2 check unit
	$(MAKE) --no-print-directory smoke

# No test here depends on the real clock, so one runs on each core.
IN_PARALLEL := --numprocesses=auto --dist=worksteal

# The tests of the law take 40 % of the time, and the same sources give the same result: they run if the sources differ from
# those of the last proofs and mutants. `coverage` runs them each time; it and `component` also run the long ones, with more
# examples of each property.
LAW := tests/unit/supervisor/law
unit: $(STAMP)
	.venv/bin/pytest tests/unit tests/component -m "not proof and not long" --hypothesis-profile=quick $(IN_PARALLEL) \
	  $$(.venv/bin/python -m tests.proven >&2 && echo --ignore=$(LAW))

component: $(STAMP)
	.venv/bin/pytest tests/component -m "not proof" $(IN_PARALLEL)

# The real processes mostly wait: four tests run at a time.
FOUR_AT_A_TIME := --numprocesses=4 --dist=worksteal --durations=10

smoke: $(STAMP)
	.venv/bin/pytest tests/system -m "smoke and not timed and not demo" $(FOUR_AT_A_TIME)

system: $(STAMP) ## run all system tests that need no idle machine (seven minutes)
	.venv/bin/pytest tests/system -m "not timed and not demo" $(FOUR_AT_A_TIME)

N ?= 10
TESTS ?= tests/system

flaky: $(STAMP) ## run the system tests N times (10), every third time under load, and list what failed; TESTS selects some
	.venv/bin/python -m tests.flaky --runs $(N) $(TESTS)

first-minute: $(STAMP) ## measure `make run` in a new clone with an empty home directory
	.venv/bin/python -m tests.first_minute

timed: $(STAMP) $(PEERS_STAMP) $(AXE) ## run the system tests that measure real time, one at a time, on an idle machine (16 minutes)
	.venv/bin/pytest -s tests/system -m timed --durations=10

demo: $(STAMP) ## play the demo from the checkout and from an installed wheel, and test what is installed (two minutes)
	.venv/bin/pytest -s tests/system -m demo

# These tests measure times of many processes, and share the machine's ports: one test at a time.
test-ros2: $(STAMP) ## run the tests with real ROS 2 processes; skipped where rclpy cannot be installed
	@if $(HAS_RCLPY); then \
	  $(MAKE) --no-print-directory ros2 && \
	  { $(MAKE) --no-print-directory $(RMW_ZENOH_STAMP) || echo "the tests of rmw_zenoh are skipped: $(NO_RMW_ZENOH)"; } && \
	  .venv/bin/pytest tests/ros2 --durations=10; \
	else \
	  echo "skipped: $(NO_RCLPY)"; \
	fi

proof: $(STAMP) ## run the proofs of the law, and check that the unit tests reach every branch of the pure modules (15 minutes)
	$(COMPILE)
	$(MAKE) --no-print-directory proofs exhaustive coverage

# Where they pass, the hash of their sources is stored, so that .ci/run repeats them only after a change.
proofs: $(STAMP)
	.venv/bin/pytest -s $(LAW) -m proof --durations=10
	.venv/bin/python -m tests.proven --passed proofs

exhaustive: $(STAMP)
	.venv/bin/pytest -s tests/unit tests/component -m proof --ignore=$(LAW) $(IN_PARALLEL) --durations=10

coverage: $(STAMP)
	.venv/bin/coverage erase
	.venv/bin/coverage run -m pytest tests/unit -m "not proof" $(IN_PARALLEL)
	.venv/bin/coverage combine --quiet
	.venv/bin/coverage report

check: $(STAMP) ## run ruff, pyright and import-linter
	.venv/bin/ruff check
	.venv/bin/ruff format --check
	.venv/bin/pyright
	.venv/bin/lint-imports

bench: $(STAMP) ## measure the law, the supervisor process and its restart, each beside a reference (four minutes)
	.venv/bin/python -m bench

bench-peers: $(STAMP) $(PEERS_STAMP) ## compare the supervisor with bare relays over Zenoh, MQTT, DDS and rclpy (four minutes)
	@if $(HAS_RCLPY); then $(MAKE) --no-print-directory ros2; fi
	.venv/bin/python -m bench.peers

bench-robots: $(STAMP) ## measure CPU, gaps and stops of 1 to 30 robots on this machine (seven minutes)
	.venv/bin/python -m bench.robots

bench-fleet: $(STAMP) ## measure 1 to 30 robots behind one router on this machine (seven minutes)
	.venv/bin/python -m bench.robots --router

bench-link: $(STAMP) ## measure false stops over links that lose packets, in network namespaces (root; four minutes)
	.venv/bin/python -m bench.link

bench-station: $(STAMP) ## measure the page that drives, in Chromium, and an hour of driving (three hours; can be interrupted and resumed)
	.venv/bin/python -m docs.generate.measure_station

docs: $(STAMP) ## update the generated parts and the drawings of README.md and docs/
	.venv/bin/python -m docs.generate
	.venv/bin/python -m docs.generate.draw_safety_law
	.venv/bin/python -m docs.generate.draw_dashboard
	.venv/bin/python -m docs.generate.draw_lab --out docs/images
	.venv/bin/python -m docs.generate.draw_crash_safety
	.venv/bin/python -m docs.generate.draw_benches
	.venv/bin/python -m docs.generate.draw_passport

ROBOT ?= demo

passport: $(STAMP) $(if $(filter ros2,$(ROBOT)),$(ROS2_STAMP)) ## measure N (10) stops of each cell of the simulated robot, or of ROBOT=ros2, for docs/passports; on an idle machine
	.venv/bin/python -m docs.generate.measure_passport --robot $(ROBOT) --runs $(N)
	.venv/bin/python -m docs.generate.draw_passport

TRIALS ?= 3
SEEDS ?= 1000

faults: $(STAMP) ## inject every class of fault TRIALS times (3) into real processes, and run SEEDS (1000) virtual trials (15 minutes)
	.venv/bin/lifeline faults --trials $(TRIALS) --minutes 8
	.venv/bin/lifeline faults --virtual --seeds $(SEEDS)

campaign: $(STAMP) ## inject every class of fault 300 times into real processes (hours; can be interrupted and resumed)
	.venv/bin/lifeline faults --trials 300 --out docs/campaign/real.jsonl

mutation: $(STAMP) ## mutate the law and check that every mutant fails a test (20 to 60 minutes)
	.venv/bin/python -m tests.mutation
	.venv/bin/python -m tests.proven --passed mutants

fifth: $(STAMP) ## the same with a fifth of the mutants, another one after each change of the law
	.venv/bin/python -m tests.mutation --fifth
	.venv/bin/python -m tests.proven --passed mutants

picture: $(STAMP) ## render the warehouse, the animation and the page again (a few minutes)
	.venv/bin/python -m docs.generate.draw_warehouse
	.venv/bin/python -m docs.generate.draw_crash_animation
	.venv/bin/python -m docs.generate.draw_page

# $(1): the options of uv. A test compares the announced sizes with uv.lock.
define INSTALL
@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
  echo "Lifeline needs Python 3.11 or newer; this is $$($(PYTHON) --version 2>&1)." \
    "Choose a newer one: make PYTHON=python3.12" >&2; exit 1; }
@$(UV) sync --quiet --locked --compile-bytecode --python $(PYTHON) $(1) || { \
  echo "lifeline: uv could not install the packages of uv.lock; the first time, this needs access to PyPI:" \
    "run the command again when the network is there" >&2; exit 1; }
@.venv/bin/python -c 'from deploy.stack.supervisord import fetch, find_uv; \
  fetch(find_uv(), lambda sentence: print("lifeline:", sentence, flush=True))'
@echo "lifeline: compiling"
@$(COMPILE)
endef

$(DRIVE_STAMP): uv.lock pyproject.toml | $(OWN_UV)
	@echo "lifeline: installing what driving needs; this fetches at most 90 MB, once"
	$(call INSTALL,--inexact --no-dev --extra sim --extra gamepad --extra station)
	@touch $@

$(STAMP): uv.lock pyproject.toml | $(OWN_UV)
	@echo "lifeline: installing everything, also for the tests; this fetches at most 550 MB, once"
	$(call INSTALL,--all-extras)
	@touch $(DRIVE_STAMP) $@

$(ROS2_STAMP): uv.lock pyproject.toml | $(OWN_UV)
	@$(HAS_RCLPY) || { echo "$(NO_RCLPY)" >&2; exit 1; }
	@# Anew each time: a second sync would remove rclpy, which its wheels install under a name that the lock does not have.
	$(UV) venv --quiet --clear $(if $(ROS),--system-site-packages) --python $(ROS2_PYTHON) .ros2
	UV_PROJECT_ENVIRONMENT=.ros2 $(UV) sync --locked --compile-bytecode --python $(ROS2_PYTHON) \
	  --only-group $(if $(ROS),ros2,ros2-wheels)
	@touch $@

$(RMW_ZENOH_STAMP): uv.lock pyproject.toml | $(OWN_UV)
	UV_PROJECT_ENVIRONMENT=.rmw-zenoh $(UV) sync --locked --compile-bytecode --python $(PYTHON) --only-group rmw-zenoh
	@touch $@

$(PEERS_STAMP): uv.lock pyproject.toml | $(OWN_UV)
	UV_PROJECT_ENVIRONMENT=.peers $(UV) sync --locked --compile-bytecode --python $(PYTHON) --only-group peers
	@touch $@

$(AXE): tests/axe.txt | $(OWN_UV)
	$(UV) pip install --quiet --no-deps --verify-hashes --target .axe -r tests/axe.txt
	@touch $@

.uv/bin/uv:
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
	  echo "uv is missing, and this Python cannot create an environment to install it:" \
	    "apt install python3-venv" >&2; exit 1; }
	@echo "lifeline: fetching uv, which installs packages (30 MB, once)"
	@$(PYTHON) -m venv .uv
	@.uv/bin/pip install --quiet --disable-pip-version-check uv
