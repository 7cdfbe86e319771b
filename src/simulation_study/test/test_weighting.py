"""The comparison of whitened and plain fits counts what lies nearer to the truth."""

import pytest

from simulation_study.verdict_study import ordered
from simulation_study.weighting import Compared, compare, report


def compared(case, share, plain_stated, whitened, plain):
    return Compared(case, share, plain_stated, *({"K": e, "G": e} for e in (whitened, plain)))


def test_recordings_are_counted_by_what_is_stated_of_them():
    found = [
        compared("a", 0.5, True, -20.0, 4.0),
        compared("b", 0.6, True, 3.0, -9.0),
        compared("c", 0.0, False, 1.0, 2.0),
    ]
    text = report(found, "command")
    much, little = (next(r for r in text.splitlines() if w in r) for w in ("| much", "| little"))
    assert "| 2 | 11.5 %; 6.5 %" in much
    assert "1 of 2" in much
    assert "| 1 | 1.0 %; 2.0 %" in little
    assert text.index("| c |") < text.index("| a |") < text.index("| b |")


@pytest.mark.slow
def test_a_recording_is_fitted_in_both_ways():
    plan = next(p for p in ordered({"effect": 30}, 5, []) if "torque_delay" in p.name)
    found = compare(plan)
    assert found.plain_stated
    assert found.share > 0.5
    assert abs(found.plain["K"]) < abs(found.whitened["K"])
