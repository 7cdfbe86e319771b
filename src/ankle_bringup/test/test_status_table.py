"""The table that `ankle up` shows while a graph runs."""

import math

from rich.console import Console

from ankle_bringup.live_monitor import SAMPLES, LiveMonitor, Stream
from ankle_bringup.up import status_table


class Monitor(LiveMonitor):
    """Has received the samples that it is given, and nothing else."""

    def __init__(self, **latest):
        self.streams = {SAMPLES: Stream()}
        self._latest = latest

    def latest(self, topic, column):
        return self._latest.get(column.split("[")[0], math.nan) if topic == SAMPLES else math.nan


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
