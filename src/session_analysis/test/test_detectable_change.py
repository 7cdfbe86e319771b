"""Reliability from visit to visit, and the least change that visits can show."""

import numpy as np
import pytest

from session_analysis.study.detectable_change import (
    EMPTY_SCATTER,
    detectable_change,
    detectable_changes,
    scatter,
)
from session_analysis.study.reliability import reliability

SHROUT_FLEISS = np.array(
    [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]], float
)


def test_reliability_is_that_of_shrout_and_fleiss():
    found = reliability(SHROUT_FLEISS)
    # Their table 4; pingouin and R's psych print 0.2898 for the same data.
    assert found.icc == pytest.approx(0.2898, abs=5e-5)
    assert (found.subjects, found.visits) == (6, 4)


def test_reliability_of_a_known_scatter_and_of_one_subject():
    random = np.random.default_rng(1)
    values = random.normal(100, 20, (400, 1)) + random.normal(0, 5, (400, 3))
    found = reliability(values)
    assert found.sem == pytest.approx(5.0, rel=0.1)
    assert found.icc == pytest.approx(400 / 425, abs=0.02)
    alone = reliability(np.array([[10.0, 12.0, 14.0]]))
    assert np.isnan(alone.icc)
    assert alone.sem == pytest.approx(2.0)
    assert reliability(np.array([[1.0]])) is None
    assert reliability(np.full((3, 2), np.nan)) is None


def test_a_detectable_change_grows_with_the_correlation_of_visits_and_with_ignorance():
    random = np.random.default_rng(3)
    steps = random.normal(0, 1, (40, 8))
    wandering = np.cumsum(steps, axis=1)
    near, far = (
        detectable_change(sum((scatter(np.arange(8), row) for row in wandering), EMPTY_SCATTER), d)
        for d in (1, 7)
    )
    # Between neighbours of a random walk lies one step, between the ends seven.
    assert near == pytest.approx(2.17 * 1.0, rel=0.15)
    assert far > 1.8 * near
    few = detectable_changes([1, 2], steps[:2, :2])
    many = detectable_changes([1, 2], steps[:, :2])
    assert many == pytest.approx(2.17 * np.sqrt(2.0), rel=0.25)
    assert few[0] != few[1]  # each is known from the other alone
    assert few[0] > 20.0 * abs(steps[1, 1] - steps[1, 0])


def test_a_subject_is_not_part_of_what_judges_their_change():
    values = np.random.default_rng(4).normal(100, 2, (5, 3))
    before = detectable_changes([1, 2, 3], values)
    values[0, 2] += 50.0
    after = detectable_changes([1, 2, 3], values)
    assert after[0] == before[0]
    assert after[1] > before[1]


def test_without_others_the_own_earlier_visits_say_what_is_detectable():
    alone = detectable_changes([1, 2, 5, 6], np.array([[10.0, 12.0, np.nan, 40.0]]))
    same = detectable_changes([1, 2, 5, 6], np.array([[10.0, 12.0, np.nan, 90.0]]))
    assert alone == same
    assert alone > 2.0
    # Two visits alone say nothing of how far two visits are apart without a change.
    assert np.isnan(detectable_changes([1, 2], np.array([[10.0, 12.0]]))).all()
    assert np.isnan(detectable_changes([1, 2], np.array([[10.0, np.nan], [9.0, 10.0]]))[0])
