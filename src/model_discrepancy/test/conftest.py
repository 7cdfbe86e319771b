"""Recordings for the tests: simulated trials, and the real ones where they are at hand."""

import re
from pathlib import Path

import pytest

from simulation_study.human_trials import load_trial
from simulation_study.planted_trials import simulate_trial

DOCUMENTATION = Path(__file__).resolve().parents[3] / "docs" / "missing_physics.md"
# What stands under these is named by terms, symbols and signals.
NAMED_BY_OTHERS = {"model", "excluded", "share_by_input"}
# Keys under these are quantities, of which the tables hold what belongs to each.
QUANTITIES = {"parameters", "on_impedance"}
RECORDINGS = Path(__file__).resolve().parents[3].parent / "shared" / "recordings"


@pytest.fixture(scope="session")
def null_recording():
    return simulate_trial({}, seed=1, duration=40.0)


@pytest.fixture(params=[1, 2])
def real_recording(request):
    file = RECORDINGS / f"mcgill_{request.param}.npz"
    if not file.exists():
        pytest.skip(f"the real recording {file.name} is not in ../shared/recordings")
    return load_trial(file)


@pytest.fixture(scope="session")
def undocumented_keys():
    """Return a function that tells which keys of a verdict its documentation lacks."""
    section = DOCUMENTATION.read_text().split("## What `verdict.json` holds")[1].split("\n## ")[0]
    documented = set(re.findall(r"`(\w+)`", section))

    def keys(content):
        if isinstance(content, list):
            return set().union(*map(keys, content)) if content else set()
        if not isinstance(content, dict):
            return set()
        found = set()
        for key, value in content.items():
            found.add(key.split("[")[0])
            if key in QUANTITIES:
                found |= keys(list(value.values()))
            elif key not in NAMED_BY_OTHERS:
                found |= keys(value)
        return found

    return lambda content: keys(content) - documented
