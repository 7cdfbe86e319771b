"""Effects of the independent rig follow the movement of the recording in which they are planted."""

import numpy as np
import pytest

from blind_rig.protocols import Protocol, command
from blind_rig.subjects import draw_subject
from blind_rig.trial import Trial, run, simulation_rate
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.recording.recording import Recording
from simulation_study import planted_effect
from simulation_study.planted_from_rig import QUIET, RIG_RATE, movement_of, plant_effect

SECONDS = 7.0
BEGUN = slice(round(RIG_RATE), None)


@pytest.fixture(autouse=True)
def rough_size(monkeypatch):
    """Let few sizes of an effect be tried: any visible one will do."""
    monkeypatch.setattr(planted_effect, "SCAN_POINTS", 3)
    monkeypatch.setattr(planted_effect, "SEARCH_TOLERANCE", 0.5)


@pytest.fixture(scope="module")
def recording():
    """Return steps to random levels, and a torque that has little to do with them."""
    generator = np.random.default_rng(3)
    protocol = Protocol("random_levels", 0.04, 0.024, SECONDS)
    angle, _ = command(protocol, generator, RIG_RATE)
    noise = np.cumsum(generator.standard_normal(len(angle)))
    torque = 4.0 + 100.0 * angle + 0.2 * noise / np.std(noise)
    return Recording(RIG_RATE, 0.1 + angle, torque, name="trial")


def test_the_plate_follows_the_measured_angle(recording):
    setup = draw_subject(np.random.default_rng(1)).replaced(QUIET)
    trial = Trial(setup, Protocol("random_levels", 0.04, 0.024, SECONDS), RIG_RATE, 0.1, 1)
    movement = movement_of(recording, np.zeros(len(recording.torque)), simulation_rate(trial))
    done = run(trial, movement=movement)
    reached = done.reading.position[:: round(done.rate / RIG_RATE)]
    measured = recording.position - np.mean(recording.position)
    off = (reached - measured)[BEGUN]
    assert np.std(off - np.mean(off)) < 0.02 * np.std(measured)


@pytest.mark.slow
def test_a_late_reflex_comes_after_the_movement_and_an_asymmetry_with_it(recording):
    speed = np.abs(np.gradient(recording.position, 1.0 / RIG_RATE))[BEGUN]

    def lag(effect):
        added = plant_effect(recording, effect, 5).recording.torque - recording.torque
        size = np.abs(np.gradient(added))[BEGUN]
        shifts = range(0, 200, 5)
        return max(shifts, key=lambda k: float(np.dot(np.roll(size, -k), speed)))

    assert lag("asymmetric_damping") < 15
    assert lag("late_reflex") > 80


@pytest.mark.slow
def test_what_is_planted_is_drawn_again(recording):
    planted = plant_effect(recording, "maxwell", 7).recording
    assert np.array_equal(planted.torque, plant_effect(recording, "maxwell", 7).recording.torque)
    other = plant_effect(recording, "maxwell", 8).recording
    assert not np.array_equal(planted.torque, other.torque)


def test_a_trial_at_another_rate_is_refused(recording):
    other = Recording(500.0, recording.position[::2], recording.torque[::2])
    with pytest.raises(DiagnosisError, match="500 Hz; 1000 Hz is needed"):
        plant_effect(other, "maxwell", 1)
