"""What `ankle estimate` answers: values with errors, losses, a second opinion, and why nothing is
valid.
"""

import csv
import re

import numpy as np
import pytest

from ankle_interfaces.block import Block
from impedance_estimator.estimator import ESTIMATE_COLUMNS, TORQUE_COLUMNS
from impedance_estimator.judgements import Judgement
from impedance_estimator.offline.recorded_estimates import OfflineResult
from model_discrepancy.recording.recording import Recording
from session_analysis.errors import AnalysisError
from session_analysis.estimate_answer import (
    answer,
    require_start,
    require_valid,
    why_nothing_is_valid,
)
from session_analysis.estimate_report import value_rows, write_estimates
from session_analysis.second_opinion import second_opinion
from session_recorder.bag_writer import BagWriter

RATE = 1000
I, B, K = 0.0137, 0.6, 90.0
COLUMNS = ("t[s]", "position[rad]", "torque[N.m]")


def ankle(seconds=40.0, noise=0.02, seed=1):
    """Time, position and torque of an ankle without reflexes under random steps."""
    n = int(seconds * RATE)
    random = np.random.default_rng(seed)
    steps = np.repeat(random.uniform(-0.03, 0.03, n // 200 + 1), 200)[:n]
    position = np.convolve(steps, np.hanning(20) / np.hanning(20).sum(), "same")
    velocity = np.gradient(position, 1 / RATE)
    torque = I * np.gradient(velocity, 1 / RATE) + B * velocity + K * position
    torque += noise * torque.std() * random.standard_normal(n)
    return np.column_stack([100 + np.arange(n) / RATE, position, torque])


def write_bag(path, data, left_out=()):
    with BagWriter(path) as writer:
        writer.add_topic("/ankle/samples")
        for number, first in enumerate(range(0, len(data), 32)):
            if number not in left_out:
                writer.write_block("/ankle/samples", Block(COLUMNS, data[first : first + 32]))
    return path


def estimates(seconds=40.0, valid_from=8.0, K=K, doubts=""):
    """What an estimator may have said of that ankle; doubts, if any, from its half on."""
    time = 100 + np.arange(0.0, seconds, 1 / 64)
    rows = np.zeros((len(time), len(ESTIMATE_COLUMNS)))
    values = {
        "t[s]": time,
        "K[N.m/rad]": K,
        "B[N.m.s/rad]": B,
        "I[kg.m^2]": I,
        "se_K[N.m/rad]": 1.0,
    }
    for name, value in values.items():
        rows[:, ESTIMATE_COLUMNS.index(name)] = value
    rows[:, ESTIMATE_COLUMNS.index("valid[1]")] = time >= 100 + valid_from
    torques = np.zeros((len(time), len(TORQUE_COLUMNS)))
    torques[:, 0] = time
    doubted = bool(doubts) & (time >= 100 + seconds / 2)
    rows[:, ESTIMATE_COLUMNS.index("doubt[1]")] = np.where(doubted, 0.8, 0.0)
    judgements = [
        Judgement(t, "", doubts if late else "")
        if t >= 100 + valid_from
        else Judgement(t, "settling after the start", "")
        for t, late in zip(time[::32], doubted[::32], strict=True)
    ]
    return OfflineResult(rows, [], torques, ["something happened"], "", judgements)


def test_the_report_answers_and_needs_no_network(tmp_path):
    bag = write_bag(tmp_path / "bag", ankle(), left_out=(100, 101))
    found = answer(bag, estimates(), "CE", "CESettings(memory=10.0)")
    path = write_estimates(found, tmp_path)
    text = path.read_text()
    body = re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)
    assert "64 samples (0.064 s) are missing in 1 gap: 64 at 3.199 s" in body
    assert "2048 of 2560 estimates are valid" in body
    assert "something happened" in body
    assert "Settings: memory=10.0<" in body
    # Figures draw from what the file holds; nothing is fetched.
    assert text.count("Plotly.newPlot(") >= 3
    assert not re.search(r"<(script|link|img)[^>]+(src|href)=.http", text)
    with (tmp_path / "estimates.csv").open() as stream:
        table = list(csv.reader(stream))
    assert tuple(table[0]) == ESTIMATE_COLUMNS
    assert len(table) == 2561
    assert (tmp_path / "estimates.png").read_bytes().startswith(b"\x89PNG")
    assert value_rows(found)[1][1] == "90.0 ± 1.0"
    assert found.median("K[N.m/rad]", 1) == (90.0, 1.0)
    assert np.isnan(answer(bag, estimates(valid_from=30.0), "CE", "").median("K[N.m/rad]", 0)[0])


def test_the_terminal_says_that_a_command_is_absent_and_why_there_is_no_second_opinion(tmp_path):
    holes = {block for first in range(200, 1200, 200) for block in range(first, first + 20)}
    bag = write_bag(tmp_path / "bag", ankle(), left_out=holes)
    remarks = " ".join(answer(bag, estimates(), "simultaneous", "").remarks())
    assert "the recording has no commanded angle" in remarks
    assert "5 gap(s) in the samples, 3.205 s in all" in remarks
    assert "no second opinion" in remarks
    whole = ankle()
    with BagWriter(tmp_path / "commanded") as writer:
        for topic in ("/ankle/samples", "/perturbation/reference"):
            writer.add_topic(topic)
        for first in range(0, len(whole), 32):
            rows = whole[first : first + 32]
            writer.write_block("/ankle/samples", Block(COLUMNS, rows))
            writer.write_block("/perturbation/reference", Block(COLUMNS[:2], rows[:, :2]))
    quiet = answer(tmp_path / "commanded", estimates(), "simultaneous", "").remarks()
    assert quiet == list(estimates().notes)


def test_a_gap_leaves_the_second_opinion_of_the_longest_stretch(tmp_path):
    whole = answer(write_bag(tmp_path / "whole", ankle()), estimates(), "simultaneous", "")
    bag = write_bag(tmp_path / "bag", ankle(), left_out=range(200, 220))
    found = answer(bag, estimates(), "simultaneous", "")
    assert found.opinion is not None
    assert found.opinion.K[0] == pytest.approx(whole.opinion.K[0], rel=0.1)
    (remark,) = [note for note in found.remarks() if "second opinion" in note]
    assert remark.startswith("1 gap(s) in the samples, 0.641 s in all, the longest 0.641 s: ")
    assert remark.endswith("of the longest stretch without one, 7.0 to 40.0 s")


def test_the_report_says_why_estimates_are_doubtful_or_not_valid(tmp_path):
    bag = write_bag(tmp_path / "bag", ankle(20.0))
    doubts = "both halves disagree; tissue relaxes"
    found = answer(bag, estimates(doubts=doubts), "CE", "")
    assert [str(share) for share in found.doubts] == [
        "50 % of the time: both halves disagree",
        "50 % of the time: tissue relaxes",
    ]
    text = write_estimates(found, tmp_path).read_text()
    assert "<li>50 % of the time: tissue relaxes</li>" in text
    assert "<li>20 % of the time: settling after the start</li>" in text
    sure = write_estimates(answer(bag, estimates(), "CE", ""), tmp_path).read_text()
    assert "Why estimates are doubtful" not in sure
    assert "settling after the start" in sure


def test_a_saturated_channel_is_in_the_report_with_its_share(tmp_path):
    clean = ankle()
    assert answer(write_bag(tmp_path / "clean", clean), estimates(), "CE", "").saturated == []
    clean[:, 2] = np.minimum(clean[:, 2], np.quantile(clean[:, 2], 0.9))
    found = answer(write_bag(tmp_path / "bag", clean), estimates(), "CE", "")
    (said,) = found.saturated
    assert said.startswith("torque is saturated: ")
    assert "record again" in said
    assert f"In doubt: {said}." in write_estimates(found, tmp_path).read_text()


def test_the_second_opinion_finds_the_ankle_and_predicts_the_other_half(tmp_path):
    bag = write_bag(tmp_path / "bag", ankle(60.0))
    opinion = second_opinion(Recording.from_bag(bag))
    # A reflex response of 0.4 s can stand in for a part of the stiffness; the report says so.
    assert opinion.K[0] == pytest.approx(K, rel=0.1)
    assert abs(opinion.G[0]) < 3.0
    assert min(opinion.held_out_vaf) > 95.0
    for value, error in opinion.halves_K:
        assert abs(value - K) < max(5 * error, 0.1 * K)
    response = opinion.response
    assert not response.instrument
    s = 2j * np.pi * response.frequency
    truth = I * s**2 + B * s + K
    low = response.frequency < 15
    assert np.median(np.abs(response.measured - truth)[low] / np.abs(truth)[low]) < 0.1
    assert np.median(response.coherence[low]) > 0.9
    np.testing.assert_allclose(
        np.abs(response.model[low]), np.abs(response.measured[low]), rtol=0.3
    )


def jittered(data):
    data = data.copy()
    data[:, 0] = 100 + np.cumsum(np.random.default_rng(1).uniform(0.3e-3, 1.7e-3, len(data)))
    return data


def still(data):
    data = data.copy()
    data[:, 1] = 0.1
    return data


def torque_missing(data):
    data = data.copy()
    data[::2, 2] = np.nan
    return data


@pytest.mark.parametrize(
    ("change", "seconds", "words"),
    [
        (lambda data: data, 2.0, "lasts 2.0 s; the first valid estimate comes up to 11 s after"),
        (lambda data: data, 10.0, "lasts 10.0 s; the first valid estimate comes up to 11 s after"),
        (still, 20.0, "no perturbation to learn from. Record while the perturbation runs"),
        (jittered, 20.0, "import the recording again with --resample"),
        (torque_missing, 20.0, "50 % of the samples of torque are NaN or infinite"),
        (lambda data: data[::-1], 20.0, "time does not increase"),
        (lambda data: data, 20.0, "position and torque do not go together"),
    ],
)
def test_why_nothing_is_valid(tmp_path, change, seconds, words):
    bag = write_bag(tmp_path / "bag", change(ankle(seconds)))
    assert words in why_nothing_is_valid(bag)
    found = answer(bag, estimates(20.0, valid_from=100.0), "CE", "")
    with pytest.raises(AnalysisError, match="none of 1280 estimates is valid"):
        require_valid(found)
    write_estimates(found, tmp_path)
    require_valid(answer(bag, estimates(20.0), "CE", ""))


def test_a_recording_that_ends_before_an_estimator_begins_is_refused_by_its_length(tmp_path):
    bag = write_bag(tmp_path / "bag", ankle(2.0))
    with pytest.raises(AnalysisError, match=r"no estimate: the recording lasts 2\.0 s; .* longer"):
        require_start(bag)
    require_start(write_bag(tmp_path / "long", ankle(4.0)))


def test_an_ankle_that_rests_has_no_second_opinion(tmp_path):
    data = ankle(20.0)
    data[:, 1] = 0.1 + 1e-5 * np.random.default_rng(3).normal(size=len(data))
    with pytest.raises(ValueError, match=r"moves by no more than 1(\.\d)?e-05 rad within a second"):
        second_opinion(Recording.from_bag(write_bag(tmp_path / "bag", data)))


def test_a_break_widens_no_errors_of_the_second_opinion(tmp_path):
    """The plate rests for 22 of 80 s, and the torque is voluntary then."""
    data = ankle(80.0)
    random, rest = np.random.default_rng(4), slice(round(29 * RATE), round(51 * RATE))
    count = rest.stop - rest.start
    whole = second_opinion(Recording.from_bag(write_bag(tmp_path / "whole", data)))
    data[rest, 1] = 1e-5 * random.normal(size=count)
    data[rest, 2] = np.cumsum(random.normal(size=count)) / RATE
    opinion = second_opinion(Recording.from_bag(write_bag(tmp_path / "bag", data)))
    assert opinion.K[0] == pytest.approx(whole.K[0], rel=0.05)
    assert 0.0 < opinion.K[1] < 0.01 * K
    assert 0.0 < opinion.G[1] < 5.0 * whole.G[1]
