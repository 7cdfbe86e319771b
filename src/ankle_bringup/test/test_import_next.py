"""What `ankle import` says to type next: only what the next command can take."""

from pathlib import Path

import pytest

from ankle_bringup.verbs.import_ import _next
from session_recorder.importing.recording_import import ImportReport


@pytest.mark.parametrize(
    ("columns", "rate", "said"),
    [
        (("position[rad]", "torque[N.m]"), 1024.0, "next: ankle estimate bag"),
        (("torque[N.m]",), 1024.0, "no estimate: the bag holds no position"),
        (("position[rad]", "torque[N.m]"), 256.0, "--resample 1024"),
    ],
)
def test_a_next_line_is_printed_only_where_it_works(columns, rate, said):
    rates = {"/ankle/samples": rate}
    held = {"/ankle/samples": columns}
    report = ImportReport(Path("bag"), held, 1000, 10.0, rate, rates, (), (), None)
    assert said in _next(report)
