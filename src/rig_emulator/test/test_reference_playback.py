"""The motion that the emulated rig makes of samples and the gaps between them."""

import numpy as np
import pytest

from ankle_actuator_driver.safety.continuation import LONGEST_BRIDGE
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings
from rig_emulator.reference_playback import Empty, ReferencePlayback

RATE = 2048.0


def paper_signal(seconds, rate=RATE):
    return PulseStep(Settings(rate=rate)).next(int(seconds * rate))


def test_playback_meets_every_sample_and_what_lies_between():
    motion, playback = paper_signal(2.0), ReferencePlayback()
    fine = paper_signal(2.0, 4 * RATE)
    playback.add(10.0, 1 / RATE, motion)
    assert playback.at(9.9) is Empty.BEFORE
    found = np.array([playback.at(10.0 + k / (4 * RATE)) for k in range(len(fine) - 8)])
    # The ends of an edge lie between samples, where its jerk jumps.
    assert np.all(np.abs(found - fine[: len(found)]).max(axis=0) < [1e-6, 0.01, 20.0])


def test_a_short_gap_is_bridged_a_long_one_is_not():
    motion = np.column_stack([0.1 * np.arange(400) / RATE, np.full(400, 0.1), np.zeros(400)])
    for lost, bridged in ((32, True), (64, True), (128, False)):
        playback = ReferencePlayback()
        playback.add(0.0, 1 / RATE, motion[:100])
        playback.add((100 + lost) / RATE, 1 / RATE, motion[100 + lost :])
        middle = playback.at((100 + lost / 2) / RATE)
        assert ((lost + 1) / RATE <= LONGEST_BRIDGE) is bridged
        if bridged:
            assert middle[0] == pytest.approx(0.1 * (100 + lost / 2) / RATE, abs=1e-9)
            playback.at((100 + lost) / RATE)
            assert playback.bridged == 1
        else:
            assert middle is Empty.OVER


def test_a_reference_that_ends_in_motion_is_over_and_one_at_rest_goes_on():
    playback = ReferencePlayback()
    playback.add(0.0, 1 / RATE, np.array([[0.0, 0.1, 0.0], [0.0001, 0.1, 0.0]]))
    assert playback.at(0.01) is Empty.OVER
    playback.clear()
    playback.add(0.0, 1 / RATE, np.array([[0.02, 0.0, 0.0]]))
    assert playback.at(0.5) == (0.02, 0.0, 0.0)
