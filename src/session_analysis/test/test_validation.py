"""Holds, measures, correlation and the whole way from bags of simulated subjects to the report."""

import numpy as np
import pytest

from ankle_interfaces.block import Block
from ankle_node.session_event import TOPIC as EVENT_TOPIC
from ankle_node.session_event import SessionEvent, SessionEventError, parse
from emg_driver.muscles import RESPONSE_COLUMNS, SAMPLE_COLUMNS
from impedance_estimator.estimator import ESTIMATE_COLUMNS
from model_discrepancy.recording.recording import Recording
from session_analysis import validation
from session_analysis.correlation import correlate, z_scores
from session_analysis.coverage import coverage
from session_analysis.errors import AnalysisError
from session_analysis.hold_measures import HoldMeasures, measure_hold
from session_analysis.holds import Hold, find_holds
from session_analysis.recorded_session import read_session
from session_analysis.report import write_report
from session_analysis.table3 import PAPER, as_text, table3
from session_analysis.validation import validate
from session_analysis.virtual_study import VirtualSession, record_session, record_study
from session_recorder.bag_writer import BagWriter
from session_recorder.errors import BagError
from session_recorder.message_definitions import typestore

HOLD = Hold(4, 100.0, 160.0, 0.0)


def started(time, number, **details):
    return SessionEvent(
        "hold started", time, {"hold": number, "torque_target[N.m]": 0.0, **details}
    )


def ended(time):
    return SessionEvent("hold ended", time)


def estimates(valid=1.0, K=80.0):
    time = np.arange(90.0, 170.0, 1 / 64)
    rows = np.zeros((len(time), len(ESTIMATE_COLUMNS)))
    rows[:, 0], rows[:, 1], rows[:, 4] = time, K, 5.0
    rows[:, 7] = np.random.default_rng(1).uniform(size=len(time)) < valid
    return rows


def responses(count=100, background=4e-6):
    """As many onsets of each direction; a muscle has its own reflex, and another at the direction
    that does not stretch it.
    """
    time = np.linspace(100.1, 159.9, 2 * count)
    rows = np.zeros((2 * count, len(RESPONSE_COLUMNS)))
    rows[:, 0], rows[:, 1] = time, np.where(np.arange(2 * count) % 2, -1.0, 1.0)
    rows[:, 2:6] = np.where(rows[:, 1:2] > 0, background, 9.0)
    rows[:, 6:] = np.where(rows[:, 1:2] > 0, [1e-7, 9.0, 2e-7, 3e-7], [9.0, 4e-7, 9.0, 9.0])
    return rows


def test_an_event_is_a_line_that_is_read_back():
    event = started(1.7e9 + 0.125, 3, note="a, b: c")
    assert parse(event.line()) == event
    assert "\n" not in event.line()
    for line in (
        "{",
        "hold started",
        "{event: hold started}",
        "{event: hold started, 't[s]': soon}",
    ):
        with pytest.raises(SessionEventError):
            parse(line)


def test_complete_holds_are_found_and_the_others_listed_with_their_reason():
    events = [
        ended(5.0),
        *(started(10.0, 1), ended(70.0)),
        started(80.0, 2),
        *(started(90.0, 3), ended(150.0)),
        *(started(160.0, 4), ended(190.0)),
        SessionEvent("target changed", 195.0),
        *(SessionEvent("hold started", 200.0, {"hold": 5}), ended(260.0)),
        started(270.0, 6),
    ]
    holds, excluded = find_holds(events)
    assert [(hold.number, hold.start, hold.end) for hold in holds] == [
        (1, 10.0, 70.0),
        (3, 90.0, 150.0),
    ]
    reasons = [one.reason for one in excluded]
    assert reasons == [
        "its start is not in the recording",
        "it has no end",
        "it lasted 30.0 s, less than 50 s",
        "its event says no torque_target[N.m]",
        "it has no end",
    ]


def test_a_hold_gives_means_at_the_onsets_that_count():
    measures, excluded = measure_hold("a", HOLD, estimates(), responses())
    assert excluded == []
    np.testing.assert_allclose([measures.K, measures.G], [80.0, 5.0])
    assert measures.background == pytest.approx([4e-6] * 4)
    assert measures.reflex == pytest.approx([1e-7, 4e-7, 2e-7, 3e-7])
    assert measures.responses.tolist() == [100] * 4


def test_holds_are_left_out_by_the_stated_rules():
    rows = responses()
    rows[:150, RESPONSE_COLUMNS.index("reflex_GL[V.s]")] = np.nan
    measures, excluded = measure_hold("a", HOLD, estimates(), rows)
    assert np.isnan(measures.reflex).tolist() == [False, False, True, False]
    assert "GL" in excluded[0].what
    assert "25 usable responses, fewer than 50" in excluded[0].reason
    assert (
        "valid, less than 90 %"
        in measure_hold("a", HOLD, estimates(valid=0.5), responses())[1][0].reason
    )
    assert "no estimate" in measure_hold("a", HOLD, estimates()[:10], responses())[1][0].reason
    assert measure_hold("a", HOLD, estimates(), responses(count=20))[0] is None


def test_z_scores_take_slope_and_intercept_of_each_subject_away():
    groups = np.repeat(["a", "b", "c"], 10)
    x = np.tile(np.arange(10.0), 3)
    y = np.concatenate([2 * x[:10] + 5, 30 * x[:10] - 100, np.full(10, 3.0)])
    z = z_scores(y, groups)
    np.testing.assert_allclose(z[:10], z[10:20])
    assert np.isnan(z[20:]).all()
    assert correlate(z_scores(x, groups), z).r == pytest.approx(1.0)


def test_the_interval_is_scipys_and_holds_r():
    random = np.random.default_rng(2)
    x = random.standard_normal(33)
    found = correlate(x, 0.8 * x + 0.6 * random.standard_normal(33))
    assert found.low < found.r < found.high
    assert found.r == pytest.approx(
        np.corrcoef(x, 0.8 * x + 0.6 * np.random.default_rng(2).standard_normal(66)[33:])[0, 1]
    )
    assert np.isnan(correlate(x[:4], x[:4]).r)
    assert np.isnan(correlate(x, np.ones(33)).r)
    assert as_text(correlate(x[:4], x[:4])) == "-"


def test_the_interval_covers_a_known_correlation():
    # 95 % asked for; a bootstrap over so few pairs falls a little short. 200 trials: 3 standard
    # errors are 5 %.
    assert 0.85 < coverage(0.7, (11, 11, 11), trials=200, resamples=999, seed=1) <= 1.0


def test_unrelated_measures_do_not_correlate():
    random = np.random.default_rng(3)
    measures = [
        HoldMeasures(
            f"s{k % 3}",
            Hold(k, 0.0, 60.0, 0.0),
            *random.uniform(50, 100, 2),
            random.uniform(1, 2, 4),
            random.uniform(1, 2, 4),
            np.full(4, 99),
        )
        for k in range(33)
    ]
    cells = table3(measures)
    assert len(cells) == 8
    assert all(cell.correlation.n == 33 and abs(cell.correlation.r) < 0.5 for cell in cells)
    assert len(PAPER) == 16


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A simulated subject with one minute-long hold on the way of half a minute, recorded."""
    folder = tmp_path_factory.mktemp("study")
    session = VirtualSession(1, (1, 0), hold=60.0, reach=35.0)
    record_session(session, folder / "subject_1")
    return folder, session


def test_a_virtual_session_is_validated_and_its_samples_give_the_recorded_numbers(
    study, monkeypatch
):
    folder, session = study
    recorded = validate([folder / "subject_1"])
    # The opinions do not depend on who made the estimates, and take longest.
    monkeypatch.setattr(validation, "hold_opinions", lambda session, progress: [])
    again = validate([folder / "subject_1"], ["somebody"], recompute=True, algorithm="CE")
    (one,), (other,) = recorded.measures, again.measures
    assert (one.subject, other.subject) == ("subject 1", "somebody")
    np.testing.assert_allclose([other.K, other.G], [one.K, one.G], rtol=1e-9)
    np.testing.assert_allclose(other.reflex, one.reflex, rtol=1e-9)
    assert one.responses.min() > 80
    assert one.hold.end - one.hold.start == 60.0
    out = folder / "report"
    out.mkdir()
    text = write_report(recorded, out, "Test").read_text()
    assert "subject 1" in text
    assert "name='viewport'" in text
    assert "<div class='wide'><table>" in text
    # One hold tells no correlation: nothing empty is drawn.
    assert "Too few holds for a correlation" in text
    assert not (out / "figure5.png").exists()
    assert (out / "frequency_response.png").exists()
    assert (out / "holds.csv").read_text().count("\n") == 2
    assert record_study([session], folder) == [folder / "subject_1"]
    with pytest.raises(AnalysisError, match="nothing is overwritten"):
        record_study([VirtualSession(1, (2, 0))], folder)


def test_bags_that_cannot_be_used_are_refused(tmp_path):
    with pytest.raises(BagError, match="no bag at"):
        validate([tmp_path / "nowhere"])


def test_samples_missing_from_a_bag_are_reported_by_every_reader(tmp_path):
    # The bag of a session that lost 3968 samples of the ankle used to pass without a word.
    time = np.arange(1.0, 12.0, 1 / 2048)
    motion = np.column_stack([time, np.sin(time), np.cos(time), np.sin(2 * time)])
    columns = ("t[s]", "position[rad]", "velocity[rad/s]", "torque[N.m]")
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/ankle/samples")
        writer.add_topic(EVENT_TOPIC, "std_msgs/msg/String")
        for first in range(0, len(time), 32):
            if not 100 * 32 <= first < 224 * 32:
                writer.write_block("/ankle/samples", Block(columns, motion[first : first + 32]))
        store = typestore()
        text = store.types["std_msgs/msg/String"](data=started(1.0, 1).line())
        message = bytes(store.serialize_cdr(text, "std_msgs/msg/String"))
        writer.write(EVENT_TOPIC, 1_000_000_000, message)
        writer.add_topic("/emg/samples")
        for first in range(0, len(time), 32):
            emg = np.column_stack([time, *np.random.default_rng(1).normal(0, 1e-5, (4, len(time)))])
            writer.write_block("/emg/samples", Block(SAMPLE_COLUMNS, emg[first : first + 32]))
    lost = "/ankle/samples: 3968 samples (1.938 s) are missing in 1 gap: 3968 at 1.562 s"
    session = read_session(tmp_path / "bag", algorithm="CE")
    assert any(lost in note for note in session.notes)
    assert lost in Recording.from_bag(tmp_path / "bag").notes
