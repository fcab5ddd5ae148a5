SHELL := /bin/bash
.DEFAULT_GOAL := help
.PHONY: help setup setup-test demo test test-long lint house gif bench bench-train bench-deploy bench-bag train-demo reproduce clean

PYTHON ?= python3
OUT ?= out/demo
BENCH_OUT ?= out/bench
TESTS ?= tests

# Nothing started from here is seen by, or sees, another machine.
export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST
ENV := source scripts/env.sh &&

help: ## Show this list
	@echo "cfnav: find a named object with one camera, touch nothing on the way."; echo
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /  make \1|/' | column -t -s '|'

setup: ## Build everything the demo needs (.venv, ROS, the workspace)
	@$(PYTHON) scripts/set_up.py

setup-test: ## The same, with what tests and training need
	@$(PYTHON) scripts/set_up.py --test

demo: setup ## Drive a simulated TurtleBot 4 to objects: ROOM=kitchen:25 GOALS=Fridge,Laptop SEED=2 SPEED=1
	@$(ENV) exec cfnav demo $(if $(ROOM),--room $(ROOM)) $(if $(GOALS),--goals $(GOALS)) \
	  $(if $(SEED),--seed $(SEED)) $(if $(SPEED),--speed $(SPEED)) --out $(OUT)

test: setup-test ## Run the tests, the ROS graph included (TESTS=tests/ros for a part)
	@$(ENV) exec scripts/test.sh $(TESTS)

test-long: setup-test ## Run the tests that take minutes
	@$(ENV) CFNAV_REQUIRE_ROS=1 exec python -m pytest -m long $(TESTS)

lint: setup-test ## Check style, types and spelling
	@$(ENV) ruff check . && ruff format --check . && codespell && mypy

house: setup ## Print lines by folder, the largest files and whether the import rules hold (SINCE=revision)
	@$(ENV) exec python -m studies.house $(if $(SINCE),--since $(SINCE))

gif: setup ## Make docs/drive.gif of the first drive that make demo left
	@$(ENV) exec python -m studies.bags.drive_gif --bag $(OUT)/bag --out docs/drive.gif

bench: setup ## Measure the live graph and write out/bench
	@$(ENV) exec python -m studies.bench.live --out $(BENCH_OUT)

bench-train: setup-test ## Measure training and write out/bench/train.json
	@$(ENV) exec python -m studies.bench.train --out $(BENCH_OUT)

bench-deploy: setup-test ## Measure faults, motions, LiDAR, CPU and memory on live graphs; goes on where it stopped (RUNS=5)
	@$(ENV) exec python -m studies.deploy.bench --out $(BENCH_OUT) $(if $(RUNS),--runs $(RUNS)) $(if $(ONLY),--only $(ONLY))

bench-bag: setup-test ## Measure how bags are read, replayed and judged; goes on where it stopped
	@$(ENV) exec python -m studies.bags.bench --out $(BENCH_OUT) $(if $(ONLY),--only $(ONLY))

train-demo: setup-test ## Make the bundles from nothing (days); goes on where it stopped (BUNDLES=boxes)
	@$(ENV) exec scripts/train_demo.sh

reproduce: setup-test ## Remake the paper's tables and figures from nothing (days on two cores); goes on where it stopped
	@$(ENV) exec scripts/reproduce.sh

clean: ## Remove what set-up and checks made; out/ with its results stays
	rm -rf .venv ros_ws/build ros_ws/install ros_ws/log build dist .pytest_cache .ruff_cache .mypy_cache
