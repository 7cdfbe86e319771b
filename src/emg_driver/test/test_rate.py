"""A stream at a wrong rate is found out, and a computer that is busy refuses none."""

import numpy as np
import pytest

from emg_driver.bridge import RATE_ERROR_TIME, RUNNING_WINDOW, START_WINDOW
from emg_driver.rate_check import RateCheck

RATE, CHUNK = 2048.0, 32


def longest_disagreement(window, seconds, rate=RATE, late=lambda at: 0.0):
    """Return for how long a stream of so many seconds disagreed with its rate at most [s].

    `late` says by how much what was sent at a time is read later [s].
    """
    check, random = RateCheck(RATE, window), np.random.default_rng(1)
    read = longest = 0.0
    since = None
    for number in range(1, int(seconds * rate / CHUNK)):
        at = number * CHUNK / rate
        read = max(read, at + late(at) + 1e-3 * random.random())
        check.add(read, number * CHUNK)
        since = (read if since is None else since) if check.agrees is False else None
        longest = max(longest, 0.0 if since is None else read - since)
    return longest


@pytest.mark.parametrize(
    "busy",
    [
        lambda at: 2.5 - (at - 40.0) if 40.0 < at < 42.5 else 0.0,
        lambda at: 0.3 if at % 40.0 > 33.0 else 0.0,
        lambda at: 5.0 - (at - 60.0) if 60.0 < at < 65.0 else 0.0,
        lambda at: 0.8 - at % 0.8 if at > 36.0 else 0.0,
        lambda at: 1.5 - at % 1.5,
    ],
    ids=["for 2.5 s", "7 of 40 s", "for 5 s", "from then on", "always"],
)
def test_a_busy_computer_refuses_no_stream(busy):
    assert longest_disagreement(RUNNING_WINDOW, 150.0, late=busy) < RATE_ERROR_TIME


@pytest.mark.parametrize("rate", [0.99 * RATE, 1.01 * RATE, 2000.0])
def test_another_rate_is_found_by_a_busy_computer_too(rate):
    seconds = RUNNING_WINDOW.length + 2 * RATE_ERROR_TIME
    disagreed = longest_disagreement(RUNNING_WINDOW, seconds, rate, lambda at: 0.3 - at % 0.3)
    assert disagreed > RATE_ERROR_TIME


def test_half_the_rate_is_found_at_the_start_and_the_right_one_agrees():
    assert longest_disagreement(START_WINDOW, 4.0, 0.5 * RATE) > 1.0
    assert longest_disagreement(START_WINDOW, 4.0) == 0.0


def test_samples_that_are_known_to_be_missing_are_no_wrong_rate():
    check = RateCheck(RATE, START_WINDOW)
    for number in range(200):
        if number % 4:  # every fourth chunk is lost, and counted by its stamps
            check.add(number * CHUNK / RATE, number * CHUNK)
    assert check.measured == pytest.approx(RATE)
