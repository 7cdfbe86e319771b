# The two commands of the README are `make demo` and `make test`; each sets up what it needs.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/set-up
LAYOUT := $(wildcard src/*/setup.py src/*/setup.cfg src/*/package.xml)

.PHONY: setup demo test test-slow lint bench bench-live bench-diagnosis clean help
.DEFAULT_GOAL := help

help:
	@echo "make demo    set up, then run the laboratory once on a simulated and on real ankles (about 6 minutes)"
	@echo "make test    set up, lint, type-check and test (under 10 minutes)"
	@echo "make test-slow   the long tests as well"
	@echo "make bench   the benchmarks of simulation, estimators, files and graph (4 minutes)"
	@echo "make bench-live   those with a rig, a browser and EMG (20 minutes)"
	@echo "make bench-diagnosis   those of the diagnosis (5 minutes)"

setup: $(STAMP)

$(VENV)/packages: requirements.txt constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 13))' || \
	  { echo "Python 3.10 to 3.13 is needed; '$(PYTHON)' is `$(PYTHON) --version 2>&1`. Name another one: make PYTHON=python3.12 ..."; exit 1; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || \
	  { echo "Python's venv module is missing. On Debian or Ubuntu: sudo apt-get install python3-venv"; exit 1; }
	@echo "Setting up the virtual environment in $(VENV) (about a minute, once) ..."
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/pip install -qq --disable-pip-version-check --requirement requirements.txt --constraint constraints.txt
	@touch $@

$(STAMP): $(VENV)/packages $(LAYOUT)
	@echo "Building the workspace ..."
	@$(BIN)/colcon --log-base build/log build --merge-install --symlink-install > build.log 2>&1 || { cat build.log; exit 1; }
	@site=`$(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))'`; \
	  $(BIN)/python -c 'import pathlib, sys; root = pathlib.Path.cwd(); print(*sorted(str(root / "build" / p.parent.name) for p in root.glob("src/*/setup.py")), sep="\n")' > $$site/ankle_workspace.pth
	@ln -sf ../../install/lib/ankle_bringup/ankle $(BIN)/ankle
	@touch $@

# Compiling the estimators takes longest; the checks are made meanwhile.
test: setup
	@$(MAKE) --no-print-directory -j 3 compiled-simultaneous compiled-CE lint
	@$(BIN)/python -m pytest -q -m "not slow" -n 2

test-slow: setup
	@$(BIN)/python -m pytest -q -m slow

compiled-%: setup
	@$(BIN)/python -c 'from impedance_estimator.stream import compile_estimator; compile_estimator("$*")'

lint: setup
	@$(BIN)/ruff check .
	@$(BIN)/mypy --no-error-summary src/*/[a-z]*_*/

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
	rm -rf $(VENV) build install build.log
