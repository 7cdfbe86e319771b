"""The missing block shows input, delay and curve of what was planted, and nothing where nothing is
missing.
"""

import json

import numpy as np
import pytest

from model_discrepancy.criticism.locate import residual_map
from model_discrepancy.criticism.missing_block import missing_block
from model_discrepancy.fit.base_model import fit_base
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.recording.motion import motion_of
from simulation_study.planted_trials import simulate_trial


def block_of(recording):
    motion = motion_of(recording)
    fitter = Fitter.of(motion)
    base = fit_base(fitter)
    return missing_block(fitter, base, residual_map(fitter.columns, base).onsets)


@pytest.mark.parametrize(
    ("name", "values", "inputs", "place"),
    [
        (
            "asymmetric_damping",
            {},
            {"velocity", "plantarflexion velocity", "dorsiflexion velocity"},
            "intrinsic",
        ),
        ("long_latency_reflex", {}, {"dorsiflexion velocity"}, "reflex dynamics"),
        ("maxwell_relaxation", {"k": 35.0, "T": 0.1}, {"position", "velocity"}, "intrinsic"),
    ],
)
def test_input_and_place_are_those_of_the_planted_effect(name, values, inputs, place):
    block = block_of(simulate_trial({name: values}, seed=1, duration=60.0))
    assert block.input in inputs
    assert block.place == place
    assert block.share > 0.05
    low, middle, high = block.response
    assert np.all(
        (low <= middle + 1e-9) & (middle <= high + 1e-9)
        | (np.abs(middle) < 0.1 * np.abs(middle).max())
    )
    assert block.curve[1][np.argmin(np.abs(block.levels))] == 0.0
    assert np.abs(block.curve[1]).max() == pytest.approx(1.0)
    json.dumps(block.content(), allow_nan=False)


def test_nothing_is_predicted_where_nothing_is_missing(null_recording):
    assert block_of(null_recording).share < 0.02


def test_too_short_a_recording_has_no_block(null_recording):
    assert block_of(simulate_trial({}, seed=2, duration=25.0)) is None
