"""Halves of a trial, and its torque shifted in time."""

import numpy as np

from model_discrepancy.recording.recording import Recording
from simulation_study.human_halves import halves, shifted


def trial():
    time = np.arange(3000) / 1000.0
    return Recording(1000.0, np.sin(time), np.sin(4.0 * time), name="trial")


def test_the_halves_share_no_sample_and_make_up_the_trial():
    whole = trial()
    parts = halves(whole)
    assert list(parts) == ["first", "second"]
    np.testing.assert_array_equal(np.concatenate([p.torque for p in parts.values()]), whole.torque)
    assert parts["second"].name == "trial_second"
    assert parts["second"].time[0] == 0.0


def test_a_shifted_torque_comes_later_and_the_position_stays():
    whole = trial()
    late = shifted(whole, 0.002)
    np.testing.assert_allclose(late.torque[2:], whole.torque[:-2], atol=1e-12)
    assert late.position is whole.position
