# The two commands of the README are `make demo` and `make test`; each sets up what it needs.
PYTHON ?= python3
VENV ?= .venv
# Another Python has its own build: make PYTHON=python3.12 VENV=.venv-3.12 BUILD=build/3.12 INSTALL=install/3.12 test
BUILD ?= build
INSTALL ?= install
PYTHONS ?= 3.10 3.11 3.12 3.13
# Every process of the tests would otherwise compile the workspace's sources anew where a container
# sets this, half a second each.
unexport PYTHONDONTWRITEBYTECODE
BIN := $(VENV)/bin
STAMP := $(VENV)/set-up
REQUIREMENTS := $(wildcard requirements/*.txt)
PACKAGES := $(foreach package,$(patsubst src/%/setup.py,%,$(wildcard src/*/setup.py)),src/$(package)/$(package))
LAYOUT := $(wildcard src/*/setup.py src/*/setup.cfg src/*/package.xml)
# make COLCON_PACKAGES="ankle_physics ankle_sim" test-colcon takes some packages only
COLCON_PACKAGES ?=

.PHONY: setup demo test mutants faults bad-input soak test-slow test-colcon test-pythons lint manifests docs bench bench-live bench-diagnosis clean help
.DEFAULT_GOAL := help

help:
	@echo "make demo    set up, then run the laboratory once on a simulated and on real ankles (about 7 minutes)"
	@echo "make test    set up, lint, type-check and test (about 10 minutes on two cores)"
	@echo "make test-slow      the long tests as well"
	@echo "make test-colcon    the tests that only compute, through colcon, as on a Jazzy install"
	@echo "make test-pythons   make test with each of Python $(PYTHONS) that is installed"
	@echo "make docs    the documentation as a site, in build/docs/index.html"
	@echo "make mutants        remove each safety control in turn: the tests have to notice (30 minutes)"
	@echo "make faults         faults at random moments of a running rig; writes docs/reliability.md (20 minutes)"
	@echo "make bad-input      a million cases of bad input of every kind, counted (CASES=20000 for a short run)"
	@echo "make soak           a session of two hours on the emulated rig (MINUTES=10 for a short one)"
	@echo "make manifests      write the imports of each package into its package.xml"
	@echo "make bench   the benchmarks of simulation, estimators, files and graph (4 minutes)"
	@echo "make bench-live   those with a rig, a browser and EMG (20 minutes)"
	@echo "make bench-diagnosis   those of the diagnosis (5 minutes)"

setup: $(STAMP)

$(VENV)/packages: $(REQUIREMENTS)
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 13))' || \
	  { echo "Python 3.10 to 3.13 is needed; '$(PYTHON)' is `$(PYTHON) --version 2>&1`. Name another one: make PYTHON=python3.12 ..."; exit 1; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || \
	  { echo "Python's venv module is missing. On Debian or Ubuntu: sudo apt-get install python3-venv"; exit 1; }
	@echo "Setting up the virtual environment in $(VENV) (about a minute, once) ..."
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@$(BIN)/pip install -qq --disable-pip-version-check --requirement requirements/development.txt --constraint requirements/constraints.txt
	@touch $@

$(STAMP): $(VENV)/packages $(LAYOUT)
	@echo "Building the workspace ..."
	@$(BIN)/colcon --log-base build/log build --base-paths src --build-base $(BUILD) --install-base $(INSTALL) --merge-install --symlink-install > build.log 2>&1 || { cat build.log; exit 1; }
	@site=`$(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))'`; \
	  $(BIN)/python -c 'import pathlib; root = pathlib.Path.cwd(); print(*sorted(str(root / "$(BUILD)" / p.parent.name) for p in root.glob("src/*/setup.py")), sep="\n")' > $$site/ankle_workspace.pth
	@ln -sf $(CURDIR)/$(INSTALL)/lib/ankle_bringup/ankle $(BIN)/ankle
	@touch $@

# Compiling the estimators takes longest; the checks are made meanwhile. Then four processes for two
# cores: the two with the live tests wait for the clock, a page or a process half of their time.
# A live test that fails beside the others is repeated alone, and the summary names it.
test: setup
	@$(MAKE) --no-print-directory -j 3 compiled-simultaneous compiled-CE lint
	@$(BIN)/python -m pytest -q -m "not slow" -n 4 || $(BIN)/python -m pytest -q -m "not slow" -n 0 --failed-live
	@$(BIN)/python -m biofeedback.web.system_browser || true

test-slow: setup
	@$(BIN)/python -m pytest -q -m slow

mutants: setup
	@$(BIN)/python src/ankle_actuator_driver/test/mutants.py

faults: setup
	@$(BIN)/python src/ankle_actuator_driver/test/fault_campaign.py --times 2 --seed 3
	@$(BIN)/python benchmarks/live_faults.py --times 4

CASES ?= 1000000
SEED ?= 1
bad-input: setup
	@$(BIN)/python test/bad_input.py --cases $(CASES) --seed $(SEED)

MINUTES ?= 120
soak: setup
	@$(BIN)/python benchmarks/soak.py --minutes $(MINUTES)

test-colcon: setup
	@$(BIN)/colcon --log-base build/log test --base-paths src --build-base $(BUILD) --install-base $(INSTALL) --merge-install $(if $(COLCON_PACKAGES),--packages-select $(COLCON_PACKAGES)) --pytest-args -m "not slow and not live" --quiet > build.log 2>&1 || { cat build.log; exit 1; }
	@$(BIN)/colcon --log-base build/log test-result --test-result-base $(BUILD) --all

test-pythons:
	@for version in $(PYTHONS); do \
	  command -v python$$version > /dev/null || { echo "NOT TESTED: Python $$version is not installed"; continue; }; \
	  echo "Python $$version"; \
	  $(MAKE) --no-print-directory PYTHON=python$$version VENV=.venv-$$version BUILD=build/$$version INSTALL=install/$$version test || exit 1; \
	done

compiled-%: setup
	@$(BIN)/python -c 'from impedance_estimator.stream import compile_estimator; compile_estimator("$*")'

lint: setup
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check -q .
	@$(BIN)/mypy --no-error-summary $(PACKAGES)

manifests: setup
	@$(BIN)/python test/manifests.py

docs: setup
	@$(BIN)/python -m sphinx --fail-on-warning --keep-going -q -b html docs build/docs
	@echo "build/docs/index.html"

bench: setup
	@$(BIN)/python benchmarks/simulation.py
	@$(BIN)/python benchmarks/estimators.py
	@$(BIN)/python benchmarks/offline.py
	@$(BIN)/python benchmarks/graph.py --seconds 60

bench-live: setup
	@$(BIN)/python benchmarks/rig.py --stops 30
	@$(BIN)/python benchmarks/feedback_latency.py
	@$(BIN)/python benchmarks/emg_graph.py --seconds 600

bench-diagnosis: setup
	@$(BIN)/python benchmarks/discrepancy_fit.py

demo: setup
	@$(BIN)/ankle demo

clean:
	rm -rf .venv .venv-3.* build install build.log
