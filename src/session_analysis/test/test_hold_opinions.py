"""Every hold by the offline method: it follows the hold's own stiffness, or says why it cannot."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ankle_interfaces.block import Block
from ankle_interfaces.value_text import with_error
from impedance_estimator.estimator import ESTIMATE_COLUMNS
from session_analysis.figures import frequency_figure
from session_analysis.hold_opinions import hold_opinions
from session_analysis.holds import Hold
from session_analysis.recorded_session import RecordedSession
from session_analysis.report import opinion_rows
from session_recorder.bag_writer import BagWriter
from session_recorder.sample_account import Gap

RATE = 512.0
HOLDS = [Hold(1, 1000.0, 1050.0, 0.0), Hold(2, 1060.0, 1110.0, -5.0)]
STIFFNESS = (60.0, 120.0)
CHANGE_TIME = 1055.0


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """An ankle that is twice as stiff in the second hold; online, K is 5 N.m/rad too high."""
    random = np.random.default_rng(3)
    time = 998.0 + np.arange(round(114 * RATE)) / RATE
    steps = np.repeat(random.uniform(-0.03, 0.03, len(time) // 100 + 1), 100)[: len(time)]
    shape = np.hanning(16) / np.hanning(16).sum()
    position = np.convolve(steps, shape, "same")
    velocity = np.gradient(position, 1 / RATE)
    stiffness = np.where(time < CHANGE_TIME, *STIFFNESS)
    torque = 0.0137 * np.gradient(velocity, 1 / RATE) + 0.6 * velocity + stiffness * position
    torque += 0.05 * random.normal(size=len(time))
    path = tmp_path_factory.mktemp("session") / "bag"
    columns = ("t[s]", "position[rad]", "velocity[rad/s]", "torque[N.m]")
    data = np.column_stack([time, position, velocity, torque])
    with BagWriter(path) as writer:
        writer.add_topic("/ankle/samples")
        for first in range(0, len(data), 512):
            writer.write_block("/ankle/samples", Block(columns, data[first : first + 512]))
    rows = np.zeros((len(time) // 16, len(ESTIMATE_COLUMNS)))
    rows[:, 0] = time[::16][: len(rows)]
    rows[:, ESTIMATE_COLUMNS.index("K[N.m/rad]")] = stiffness[::16][: len(rows)] + 5.0
    rows[:, ESTIMATE_COLUMNS.index("se_K[N.m/rad]")] = 2.0
    rows[:, ESTIMATE_COLUMNS.index("valid[1]")] = 1.0
    return RecordedSession(path, "S07", HOLDS, [], rows, np.empty((0, 10)), [])


def test_each_hold_has_its_own_opinion_beside_the_online_values(session, tmp_path):
    found = hold_opinions(session)
    assert [one.hold.number for one in found] == [1, 2]
    for one, K in zip(found, STIFFNESS, strict=True):
        assert pytest.approx((K + 5.0, 2.0)) == one.K
        assert one.opinion.K[0] == pytest.approx(K, rel=0.03)
        assert [half[0] for half in one.opinion.halves_K] == pytest.approx([K, K], rel=0.05)
        assert all(half[1] > 0.0 for half in one.opinion.halves_K)
        assert min(one.opinion.held_out_vaf) > 95.0
    head, first, second = opinion_rows(found)
    assert len(head) == len(first) == len(second)
    assert first[:4] == ["S07", "1", "0", "65.0 ± 2.0"]
    frequency_figure(found, tmp_path / "response.png")
    assert (tmp_path / "response.png").stat().st_size > 10_000


def test_a_hold_with_too_many_missing_samples_has_no_opinion(session):
    holed = replace(session, gaps=(Gap(1010.0, 1010.6, 307), Gap(1070.0, 1070.1, 51)))
    first, second = hold_opinions(holed)
    assert first.opinion is None
    assert first.reason == (
        "1.2 % of its samples are missing, at most 0.60 s at once; allowed: 2 %, 0.4 s"
    )
    assert opinion_rows([first])[1][4] == first.reason
    assert second.opinion is not None


def test_a_session_without_samples_says_so(session):
    (first, _) = hold_opinions(replace(session, path=Path("/nowhere")))
    assert first.opinion is None
    assert "no bag at" in first.reason
    assert hold_opinions(replace(session, holds=[])) == []


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ((89.934, 0.402), "89.93 ± 0.40"),
        ((1234.5, 56.0), "1234 ± 56"),
        ((0.0137, 0.0002), "0.01370 ± 0.00020"),
        ((3.14159, np.nan), "3.14"),
        ((12345.0, np.nan), "12345"),
        ((np.nan, 1.0), "-"),
        ((0.0, 0.0), "0"),
    ],
)
def test_a_value_has_as_many_digits_as_its_error_allows(value, text):
    assert with_error(value) == text
