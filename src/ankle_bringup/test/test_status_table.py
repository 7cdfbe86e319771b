"""The table that `ankle up` shows while a graph runs."""

import math
from datetime import datetime

import numpy as np
from rich.console import Console

from ankle_bringup.live_monitor import ESTIMATE, SAMPLES, LiveMonitor, Stream
from ankle_bringup.up import status_table
from ankle_interfaces.block import Block
from ankle_interfaces.topics import IMPEDANCE_ESTIMATE

BEGIN = datetime(2026, 3, 5, 14, 3, 7).timestamp()


class Monitor(LiveMonitor):
    """Has received the samples and estimates that it is given, and nothing else."""

    def __init__(self, *estimates, **latest):
        self.streams = {SAMPLES: Stream(), ESTIMATE: Stream()}
        self.valid = None
        self._latest = latest
        for time, value, valid in estimates:
            row = np.full((1, len(IMPEDANCE_ESTIMATE.columns)), value)
            row[0, [0, IMPEDANCE_ESTIMATE.columns.index("valid[1]")]] = time, valid
            block = Block(IMPEDANCE_ESTIMATE.columns, row)
            self.streams[ESTIMATE].last = block
            self.keep_valid(block)

    def latest(self, topic, column):
        if topic == SAMPLES:
            return self._latest.get(column.split("[")[0], math.nan)
        return super().latest(topic, column)


def shown(*arguments):
    console = Console(width=80)
    with console.capture() as capture:
        console.print(status_table(*arguments))
    return capture.get()


def test_a_graph_without_an_estimator_shows_what_is_measured():
    text = shown(Monitor(torque=-4.9876, position=math.radians(2.5)), None, (), False)
    assert "-4.988" in text
    assert "2.5" in text
    assert "no estimator in this graph" in text
    assert "nan" not in text


def test_before_the_first_estimate_the_table_has_words_instead_of_nan():
    text = shown(Monitor(), None)
    assert text.count("not yet") == 5
    assert "nan" not in text


def test_numbers_that_are_not_valid_are_never_shown_as_estimated():
    text = shown(Monitor((BEGIN, 17.5, 0.0)), None)
    assert text.count("not yet") == 5
    assert "17.5" not in text


def test_the_last_valid_estimate_is_shown_with_its_time_when_later_ones_are_not():
    text = shown(Monitor((BEGIN, 52.25, 1.0), (BEGIN + 12.0, 17.5, 0.0)), None)
    assert text.count("52.25") == 4
    assert "17.5" not in text
    assert "no; values of 14:03:07, 12 s before" in text


def test_a_valid_estimate_is_shown_as_it_is():
    text = shown(Monitor((BEGIN, 17.5, 0.0), (BEGIN + 1.0, 52.25, 1.0)), None)
    assert text.count("52.25") == 4
    assert "yes" in text
