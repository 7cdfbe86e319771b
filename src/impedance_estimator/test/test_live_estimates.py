"""A change of algorithm, settings or model never stops the stream: the new one takes over when it
is valid.
"""

import numpy as np

from ankle_interfaces.block import Block
from impedance_estimator.live_estimates import LiveEstimates
from impedance_estimator.settings import Settings
from impedance_estimator.stream import EstimateStream

COLUMNS = ("t[s]", "position[rad]", "velocity[rad/s]", "torque[N.m]")
VALID = 7


def fed(live, samples):
    """Rows, and the index of the row with which the successor took over."""
    rows, taken_over = [], None
    for first in range(0, len(samples), 32):
        due, changed = live.feed(Block(COLUMNS, samples[first : first + 32]))
        if changed:
            taken_over = sum(len(part) for part in rows)
        rows.append(due.rows)
    return np.concatenate(rows), taken_over


def test_the_present_estimate_is_given_until_the_new_one_is_valid(minute):
    samples = minute.samples()[: 20 * 2048]
    live = LiveEstimates(EstimateStream("CE", Settings(settling_time=3.0)))
    before, changed = fed(live, samples[: 6 * 2048])
    assert changed is None
    assert before[-1, VALID] == 1.0
    successor = EstimateStream("CE", Settings(settling_time=5.0, highpass="all"))
    waiting = [True] * 64
    live.replace(successor, lambda: not waiting or waiting.pop() is None)
    assert live.changing
    after, changed = fed(live, samples[6 * 2048 :])
    # It was prepared for a second and settled for five, and no row was lost or invalid.
    assert abs(changed / 64.0 - 6.0) < 0.6
    assert (after[:, VALID] == 1.0).all()
    np.testing.assert_allclose(np.diff(np.concatenate([before, after])[:, 0]), 1 / 64, rtol=1e-6)
    assert not live.changing
    assert live.stream is successor
    # From then on the numbers are the successor's alone.
    alone = EstimateStream("CE", Settings(settling_time=5.0, highpass="all"))
    expected = alone.feed(Block(COLUMNS, samples[7 * 2048 :])).rows
    np.testing.assert_array_equal(after[changed:][-64:], expected[-64:])


def test_a_second_change_replaces_the_one_that_was_not_ready(minute):
    samples = minute.samples()[: 10 * 2048]
    live = LiveEstimates(EstimateStream("CE", Settings(settling_time=3.0)))
    fed(live, samples[: 4 * 2048])
    live.replace(EstimateStream("C"), lambda: False)
    last = EstimateStream("CE", Settings(settling_time=2.0))
    live.replace(last, lambda: True)
    fed(live, samples[4 * 2048 :])
    assert live.stream is last


def test_where_nothing_runs_yet_the_new_one_runs_at_once(minute):
    live = LiveEstimates(EstimateStream("CE"))
    successor = EstimateStream("CE", Settings(settling_time=9.0))
    live.replace(successor, lambda: True)
    live.feed(Block(COLUMNS, minute.samples()[:32]))
    assert live.stream is successor
