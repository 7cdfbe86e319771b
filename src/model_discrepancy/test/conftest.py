"""Recordings for the tests: simulated trials, and the real ones where they are at hand."""

from pathlib import Path

import pytest

from simulation_study.human_trials import load_trial
from simulation_study.planted_trials import simulate_trial

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
