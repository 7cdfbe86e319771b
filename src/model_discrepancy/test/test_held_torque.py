"""The torque that the muscles hold, where the joint shows more or less of it."""

import numpy as np

from model_discrepancy.fit.held_torque import slow_torque
from model_discrepancy.fit.rows import Rows

RATE = 500.0


def test_torque_is_found_of_which_the_joint_shows_more_or_less():
    random = np.random.default_rng(1)
    n = int(40.0 * RATE)
    rows = Rows(n, RATE)
    held = rows.slow(rows.spectrum(random.standard_normal(n)), 0.3)
    shown = 1.0 + 2.0 * np.repeat(random.choice([-1.0, 1.0], n // 200), 200)
    left = held * shown
    inner = slice(int(3.0 * RATE), -int(3.0 * RATE))
    found = slow_torque(rows, left, shown)
    assert np.corrcoef(found[inner], held[inner])[0, 1] > 0.95
    as_it_is = slow_torque(rows, left, np.ones(n))
    assert np.corrcoef(as_it_is[inner], held[inner])[0, 1] < 0.9
