"""Samples get the reference of their own time, whichever of both streams comes first."""

import numpy as np
import pytest

from ankle_interfaces.block import Block
from impedance_estimator.live_estimates import LiveEstimates
from impedance_estimator.reference_track import LARGEST_STEP, LONGEST_WAIT, ReferenceTrack
from impedance_estimator.simultaneous.settings import SimultaneousSettings
from impedance_estimator.stream import EstimateStream

RATE = 1000.0
SAMPLES = ("t[s]", "position[rad]", "torque[N.m]")


def samples(first, last):
    time = np.arange(first, last) / RATE
    return np.column_stack([time, np.sin(time), np.cos(time)])


def reference(first, last):
    time = np.arange(first, last) / RATE
    return time, 2.0 * time


def joined(order, blocks=20, size=50):
    """All samples with their reference; `order` says per block which of both comes first."""
    track, out = ReferenceTrack(), []
    for k in range(blocks):
        first = k * size
        if order(k):
            track.feed_reference(*reference(first, first + size))
        out.append(track.join(samples(first, first + size)))
        if not order(k):
            track.feed_reference(*reference(first, first + size))
    out.append(track.join(samples(blocks * size, blocks * size)))
    return np.concatenate(out)


def test_it_does_not_matter_which_stream_comes_first():
    expected = joined(lambda k: True)
    assert len(expected) == 1000
    np.testing.assert_allclose(expected[:, -1], 2.0 * expected[:, 0], atol=1e-12)
    np.testing.assert_array_equal(joined(lambda k: False), expected)
    np.testing.assert_array_equal(joined(lambda k: k % 3 == 0), expected)


def test_a_reference_at_another_rate_is_interpolated():
    track = ReferenceTrack()
    time = np.arange(0.0, 1.0, 0.01)
    track.feed_reference(time, 3.0 * time)
    out = track.join(samples(0, 900))
    np.testing.assert_allclose(out[:, -1], 3.0 * out[:, 0], atol=1e-12)


def test_a_reference_at_the_samples_own_times_is_taken_as_it_is():
    """It is the same as where they lie between its times, also across a gap and with a repeated
    sample.
    """
    time = np.concatenate([np.arange(0.0, 1.0, 0.001), np.arange(1.5, 2.5, 0.001)])
    position = np.sin(40.0 * time)
    for chosen in (np.arange(2000), np.arange(300, 1700), np.append(np.arange(1500), 1499)):
        track = ReferenceTrack()
        track.feed_reference(time, position)
        out = track.join(np.column_stack([time[chosen], time[chosen]]))
        np.testing.assert_array_equal(out[:, -1], position[chosen])


def test_without_a_reference_samples_wait_once_and_then_no_more():
    track = ReferenceTrack()
    given = passed = 0
    while passed == 0:
        passed += len(track.join(samples(given, given + 32)))
        given += 32
    assert given / RATE == pytest.approx(LONGEST_WAIT, abs=0.07)
    assert passed == given
    out = track.join(samples(given, given + 32))
    assert len(out) == 32
    assert np.isnan(out[:, -1]).all()


def test_a_gap_in_the_reference_is_no_reference():
    track = ReferenceTrack()
    track.feed_reference(*reference(0, 300))
    track.feed_reference(*reference(600, 1000))
    out = track.join(samples(0, 900))
    missing = np.isnan(out[:, -1])
    inside = (out[:, 0] > 0.2995) & (out[:, 0] < 0.5995)
    np.testing.assert_array_equal(missing, inside)
    assert LARGEST_STEP < 0.3


def test_the_last_samples_give_estimates_when_their_reference_comes_after_them():
    """A replay sends both topics at full speed, in either order, and nothing behind the last."""
    rows = {}
    for late in (False, True):
        live, out = LiveEstimates(EstimateStream("simultaneous", SimultaneousSettings())), []
        for first in range(0, 2048, 32):
            time = np.arange(first, first + 32) / 2048.0
            position = 0.01 * np.sin(20.0 * time)
            block = Block(SAMPLES, np.column_stack([time, position, 5.0 * position]))
            command = Block(("t[s]", "position[rad]"), np.column_stack([time, position]))
            for given in (block, command) if late else (command, block):
                if given is block:
                    out.append(live.feed(block)[0].rows)
                else:
                    live.feed_reference(command)
                    out.append(live.release()[0].rows)
        rows[late] = np.concatenate(out)
    assert len(rows[False]) == 64
    np.testing.assert_array_equal(rows[True], rows[False])
