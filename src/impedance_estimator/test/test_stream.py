"""Live blocks, any other split and the file give the same numbers; rows come at fixed sample
counts.
"""

import itertools
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ankle_interfaces.block import Block
from ankle_interfaces.errors import BlockError, UnitError
from impedance_estimator.algorithms import ALGORITHMS, DEFAULT, make_estimator
from impedance_estimator.estimator import ESTIMATE_COLUMNS, REFLEX_COLUMNS
from impedance_estimator.judgements import Judgement, shares_of_doubted_time, shares_of_invalid_time
from impedance_estimator.offline.recorded_estimates import estimate_bag, estimate_signal
from impedance_estimator.settings import Settings
from impedance_estimator.simultaneous.settings import SimultaneousSettings
from impedance_estimator.stream import EstimateStream
from session_recorder.bag_reader import BagReader
from session_recorder.bag_writer import BagWriter
from session_recorder.errors import BagError

COLUMNS = ("t[s]", "position[rad]", "velocity[rad/s]", "torque[N.m]")


def blocks_of(samples, size=32, columns=COLUMNS):
    return [
        Block(columns, np.ascontiguousarray(samples[k : k + size]))
        for k in range(0, len(samples), size)
    ]


def write_bag(path, blocks, topic="/ankle/samples"):
    with BagWriter(path) as writer:
        writer.add_topic(topic)
        for block in blocks:
            writer.write_block(topic, block)
    return path


@pytest.fixture(scope="module")
def samples(minute):
    """12 s at a time as ROS gives it, with a gap and a NaN in it."""
    samples = minute.samples()[: 12 * 2048]
    samples[:, 0] += 1_790_000_000.0
    samples[9 * 2048, 1] = np.nan
    return np.delete(samples, slice(7 * 2048, 7 * 2048 + 50), axis=0)


def feed(blocks, algorithm=DEFAULT, chosen=None):
    stream = EstimateStream(
        algorithm, chosen or ALGORITHMS[algorithm].settings_type(settling_time=3.0)
    )
    results = [stream.feed(block) for block in blocks]
    rows = np.concatenate([result.rows for result in results])
    return rows, [response for result in results for response in result.responses]


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@settings(max_examples=10, deadline=None)
@given(cuts=st.lists(st.integers(1, 20_000), max_size=12))
def test_any_split_into_blocks_gives_the_same(samples, algorithm, cuts):
    whole, responses = feed(blocks_of(samples), algorithm)
    edges = [0, *sorted(set(cuts) & set(range(len(samples)))), len(samples)]
    split = [Block(COLUMNS, samples[a:b]) for a, b in itertools.pairwise(edges)]
    rows, others = feed(split, algorithm)
    np.testing.assert_array_equal(rows, whole)
    for (t, h), (t2, h2) in zip(responses, others, strict=True):
        assert t == t2
        np.testing.assert_array_equal(h, h2)


def test_rows_come_at_fixed_sample_counts(samples):
    rows, responses = feed(blocks_of(samples))
    np.testing.assert_array_equal(rows[:, 0], samples[31::32, 0])
    assert [t for t, _ in responses] == list(samples[1023::1024, 0])
    assert rows[:, 7].any()
    estimator = make_estimator("CE", 2048.0, True, Settings(estimate_rate=10.0))
    np.testing.assert_array_equal(estimator.process(samples)[:, 0], samples[204::205, 0])


def test_reset_forgets_everything(samples):
    estimator = make_estimator("CE", 2048.0, True, Settings(settling_time=3.0))
    first = estimator.process(samples)
    estimator.reset()
    assert estimator.reason
    np.testing.assert_array_equal(estimator.process(samples), first)


def test_file_gives_what_the_live_stream_gave(samples, tmp_path):
    rows, responses = feed(blocks_of(samples))
    bag = write_bag(tmp_path / "session", blocks_of(samples))
    reported = []
    result = estimate_bag(
        bag,
        tmp_path / "estimates",
        settings=SimultaneousSettings(settling_time=3.0),
        progress=reported.append,
    )
    np.testing.assert_array_equal(result.rows, rows)
    assert reported
    assert reported == sorted(reported)
    columns, written = BagReader(tmp_path / "estimates").signal("/impedance/estimate")
    assert columns == ESTIMATE_COLUMNS
    np.testing.assert_array_equal(written, rows)
    written_responses = list(BagReader(tmp_path / "estimates").blocks("/impedance/reflex_irf"))
    assert written_responses[-1].columns == REFLEX_COLUMNS
    np.testing.assert_array_equal(written_responses[-1].data, responses[-1][1])
    # The bag says why estimates are not valid, in the words of the live node's diagnostics.
    not_valid = BagReader(tmp_path / "estimates").custom_data["not_valid"]
    assert not_valid == "; ".join(map(str, shares_of_invalid_time(result.judgements)))
    assert {"settling after the start", "samples are missing"} & {
        judgement.not_valid for judgement in result.judgements
    }
    assert len(result.judgements) == len(responses)
    with pytest.raises(BagError, match="is there already"):
        estimate_bag(bag, tmp_path / "estimates", settings=SimultaneousSettings(settling_time=3.0))
    estimate_bag(
        bag,
        tmp_path / "estimates",
        settings=SimultaneousSettings(settling_time=3.0),
        overwrite=True,
    )


def test_reasons_have_their_share_of_the_time():
    judgements = [
        Judgement(0.5, "settling after the start", ""),
        Judgement(1.0, "", "the halves disagree; tissue relaxes"),
        Judgement(1.5, "", "tissue relaxes"),
        Judgement(2.0, "", ""),
    ]
    assert [str(share) for share in shares_of_doubted_time(judgements)] == [
        "50 % of the time: tissue relaxes",
        "25 % of the time: the halves disagree",
    ]
    (settling,) = shares_of_invalid_time(judgements)
    assert (settling.reason, settling.share) == ("settling after the start", 0.25)
    assert shares_of_doubted_time([]) == []


def test_arrays_give_what_the_bag_gives(samples, tmp_path):
    bag = write_bag(tmp_path / "session", blocks_of(samples))
    from_bag = estimate_bag(bag, settings=SimultaneousSettings(settling_time=3.0))
    from_arrays = estimate_signal(*samples.T, settings=SimultaneousSettings(settling_time=3.0))
    np.testing.assert_array_equal(from_bag.rows, from_arrays.rows)
    np.testing.assert_array_equal(from_bag.torques, from_arrays.torques)


def test_degrees_and_millinewton_metres_are_converted(samples, tmp_path):
    converted = samples * [1.0, 180 / np.pi, 180 / np.pi, 1e3]
    columns = ("t[s]", "position[deg]", "velocity[deg/s]", "torque[mN.m]")
    result = estimate_bag(
        write_bag(tmp_path / "session", blocks_of(converted, columns=columns)),
        settings=SimultaneousSettings(settling_time=3.0),
    )
    expected, _ = feed(blocks_of(samples))
    np.testing.assert_allclose(result.rows, expected, rtol=1e-6)


def test_a_refused_block_is_reported_and_the_rest_used(samples, tmp_path):
    blocks = blocks_of(samples)
    blocks[300] = Block(("t[s]", "position[rad]", "velocity[rad/s]", "torque[V]"), blocks[300].data)
    result = estimate_bag(
        write_bag(tmp_path / "session", blocks), settings=SimultaneousSettings(settling_time=3.0)
    )
    assert any("torque comes in 'V', expected N.m" in note for note in result.notes)
    assert result.rows[-1, 7] == 1.0


@pytest.mark.parametrize(
    ("columns", "error", "words"),
    [
        (
            ("t[s]", "position[rad]", "velocity[rad/s]", "force[N.m]"),
            BlockError,
            "no column 'torque",
        ),
        (
            ("t[s]", "position[V]", "velocity[rad/s]", "torque[N.m]"),
            UnitError,
            "position comes in 'V', expected rad",
        ),
        (
            ("t[s]", "position[rad]", "velocity[furlong/s]", "torque[N.m]"),
            UnitError,
            "unknown unit 'furlong/s'",
        ),
    ],
)
def test_columns_that_do_not_fit_are_refused(samples, tmp_path, columns, error, words):
    blocks = blocks_of(samples, columns=columns)
    with pytest.raises(error, match=words):
        EstimateStream().feed(blocks[0])
    with pytest.raises(BlockError, match=words):
        estimate_bag(write_bag(tmp_path / "session", blocks))


def test_bags_without_samples_are_refused(samples, tmp_path):
    with pytest.raises(BagError, match="no topic '/ankle/samples'; it holds /other"):
        estimate_bag(write_bag(tmp_path / "session", blocks_of(samples), "/other"))
    with pytest.raises(BagError, match="no bag at"):
        estimate_bag(tmp_path / "nothing", tmp_path / "out")
    assert not (tmp_path / "out").exists()
    with pytest.raises(ValueError, match="at least 256 samples"):
        estimate_bag(write_bag(tmp_path / "short", blocks_of(samples[:100])))


def test_cut_off_bag_is_estimated_up_to_the_cut_and_reported(samples, tmp_path):
    bag = write_bag(tmp_path / "session", blocks_of(samples))
    file: Path = next(bag.glob("*.mcap"))
    file.write_bytes(file.read_bytes()[: file.stat().st_size - 40])
    result = estimate_bag(bag, settings=SimultaneousSettings(settling_time=3.0))
    assert result.notes
    assert len(result.rows) > 0
