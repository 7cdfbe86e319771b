"""A torque that relaxation does not find lies between two of its swings, or there is none."""

import numpy as np
import pytest

from ankle_physics.single_sample import torque_between


def test_a_steep_answer_is_met_where_relaxation_swings_wider():
    # The answer to 2 is 2; one step off, relaxation is three steps off on the other side.
    found = torque_between(lambda torque: (2.0 - 3.0 * (torque - 2.0)) - torque, 0.5, 1e-11)
    assert found == pytest.approx(2.0, abs=1e-10)


def test_a_jump_is_met_where_it_lies():
    found = torque_between(lambda torque: (1.0 if torque < 0.3 else -1.0) - torque, 0.0, 1e-11)
    assert found == pytest.approx(0.3, abs=1e-10)


def test_it_is_found_beyond_the_first_round():
    found = torque_between(lambda torque: 1.0 if torque < 4.5 else -1.0, 0.0, 1e-11)
    assert found == pytest.approx(4.5, abs=1e-10)


@pytest.mark.parametrize("ahead", [lambda torque: 1.0 + abs(torque), lambda _: np.nan])
def test_a_torque_that_runs_away_is_not_found(ahead):
    assert torque_between(ahead, 0.0, 1e-11) is None
