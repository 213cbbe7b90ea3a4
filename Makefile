# Every target sets up what it needs from a fresh clone: Python >= 3.11, make and git are enough.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/ready
INSTALL := -m pip install --quiet --disable-pip-version-check --constraint constraints.txt
PIP := $(BIN)/python $(INSTALL)
ALONE := $(patsubst %,tests/integration/test_%.py,\
	follower_takeover manual odd_tracker security stop_beside_viewers swap takeover time_to_stop \
	watchdog world_page)
PEERS := .venv-peers
PEERS_PIP := $(PEERS)/bin/python $(INSTALL)

define CHECK_PYTHON
@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	|| { echo "Heel needs Python 3.11 or newer: make PYTHON=/path/to/python3.11 ..."; exit 1; }
endef

.PHONY: help demo test release check lint layers types docs test-docker test-ros2 test-slow mutants same same-short bench results peers clean

help:  ## list the targets
	@grep -hE '^[a-z0-9-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z0-9-]+):.*## /  \1\t/' | expand -t 16

$(READY): pyproject.toml constraints.txt
	$(CHECK_PYTHON)
	$(PYTHON) -m venv $(VENV)
	$(PIP) --editable '.[dev]'
	@# Scores are tested against TrackEval; its wheel asks for opencv-python, which would overwrite the
	@# headless build.
	$(PIP) --no-deps trackeval
	@touch $@

demo: $(READY)  ## a robot follows somebody through a simulated world, with the live page
	$(BIN)/heel demo

test: $(READY)  ## unit and integration tests
	@# Most tests run side by side: they share nothing, and hold on a busy machine. Those of ALONE
	@# measure times that other work would lengthen.
	$(BIN)/python -m pytest tests/integration tests/unit $(addprefix --ignore=,$(ALONE)) \
		-m 'not docker and not slow' -n 2 --dist loadfile --no-loadscope-reorder
	$(BIN)/python -m pytest $(ALONE) -m 'not docker and not slow'

test-docker: $(READY)  ## the same services in containers
	$(BIN)/python -m pytest -m 'docker and not slow'

test-ros2: pyproject.toml constraints.txt  ## the bridge beside robots of rclpy and of rmw_zenoh, in an environment of its own
	$(CHECK_PYTHON)
	$(PYTHON) -m venv .venv-ros2
	.venv-ros2/bin/python -m pip install --quiet -c constraints.txt --editable '.[ros2,ros2-zenoh,sim]' \
		pytest pytest-timeout hypothesis pycdr2 zenoh-ros2-sdk
	.venv-ros2/bin/python -m pytest tests/ros2 -p no:cacheprovider

test-slow: $(READY)  ## what takes minutes
	$(BIN)/python -m pytest -m slow

lint: $(READY)  ## style
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

layers: $(READY)  ## which module may import which
	$(BIN)/lint-imports --no-cache

types: $(READY)  ## types
	$(BIN)/mypy

docs: $(READY)  ## build the documentation site in site/, with strict links
	PYTHONPATH=. $(BIN)/zensical build --clean --strict

release: $(READY)  ## wheel, source archive, image of this kind of computer and checksums, into dist/
	$(BIN)/python -m tools.release

check: lint layers types test  ## everything but Docker and the slow tests

mutants: $(READY)  ## halve and double every constant of detector, tracker, follower: does a unit test notice? (an hour or two)
	$(BIN)/python -m benchmarks.mutants --write docs/records/mutants.md

same: $(READY)  ## does everything still come out the same, on all recordings, scenes and episodes
	nice $(BIN)/python -m benchmarks.same

same-short: $(READY)  ## the same on drawn scenes, in a minute
	$(BIN)/python -m benchmarks.same --short

bench: $(READY)  ## speed, latency and memory, each against something
	$(BIN)/python -m benchmarks.overhead
	$(BIN)/python -m benchmarks.realtime

results: $(READY)  ## score everything on all recordings and write docs/records/results.md and docs/records/identity.md
	$(BIN)/python -m benchmarks.accuracy --write docs/records/results.md
	$(BIN)/python -m benchmarks.ablation --write docs/records/results.md
	$(BIN)/python -m benchmarks.reliability --write docs/records/identity.md
	$(BIN)/python -m benchmarks.features --write docs/records/identity.md
	$(BIN)/python -m benchmarks.speed --write docs/records/results.md
	$(BIN)/python -m benchmarks.networks --write docs/records/results.md
	$(BIN)/python -m benchmarks.frames docs/records/frames.jpg

$(PEERS)/ready: pyproject.toml constraints.txt
	$(CHECK_PYTHON)
	$(PYTHON) -m venv $(PEERS)
	$(PEERS_PIP) --editable '.[eval]' defusedxml pydeprecate pyyaml requests tqdm
	@# Their wheels ask for opencv-python, too; above is what else they import.
	$(PEERS_PIP) --no-deps supervision trackers
	@touch $@

peers: $(PEERS)/ready  ## score association beside four public trackers and write docs/records/association.md
	$(PEERS)/bin/python -m benchmarks.association --write docs/records/association.md

clean:  ## remove the environments and caches
	rm -rf $(VENV) $(PEERS) .cache site .pytest_cache .mypy_cache .ruff_cache .hypothesis
