"""Outlet, bridge and processor as processes of their own, over Lab Streaming Layer and DDS: from
samples to responses.
"""

import os
import re
import time

import numpy as np
import pytest

from emg_driver.muscles import RESPONSE_COLUMNS, RESPONSE_TOPIC, SAMPLE_COLUMNS, SAMPLES_TOPIC
from emg_driver.processor import EmgProcessor

pytestmark = pytest.mark.live

RATE, SIZE = 2048, 32
# Everything in real time: the processes need about a core for half a minute, and on a computer that
# is too busy samples are lost.
chain = pytest.mark.slow


def responses(sent, velocity):
    """What the processor makes of all that was sent, shape (k, 10)."""
    processor = EmgProcessor()
    processor.feed_reference(sent[:, 0], sent[:, 1])
    processor.feed_motion(sent[:, 0], velocity)
    return np.concatenate(
        [processor.feed_emg(sent[:, 0], sent[:, 2:]).rows, processor.finish().rows]
    )


def test_the_processor_answers_every_onset_as_the_class_does(lab):
    laboratory = lab.Laboratory(SAMPLES_TOPIC)
    try:
        laboratory.start("emg_processor", "-p", "wait_for_readers:=1")
        laboratory.listen(RESPONSE_TOPIC)
        laboratory.until_read()
        begin, same, expected = time.time(), EmgProcessor(), []
        for k in range(round(6.0 * RATE / SIZE)):
            laboratory.publish(begin + k * SIZE / RATE)
            if (
                k % 32 == 31
            ):  # half of what the node's queue holds, then wait until it has caught up
                sent = np.concatenate(laboratory.sent[-32:])
                same.feed_reference(sent[:, 0], sent[:, 1])
                expected.extend(same.feed_emg(sent[:, 0], sent[:, 2:]).rows)
                laboratory.until_processed()
                laboratory.until(
                    lambda: len(laboratory.blocks[RESPONSE_TOPIC]) >= len(expected), "responses"
                )
        laboratory.until(
            lambda: laboratory.reported("emg_processor", "less than 0.5 s without a gap"),
            "missing EMG is reported",
        )
    finally:
        codes = laboratory.close()
    rows = laboratory.data(RESPONSE_TOPIC)
    assert laboratory.blocks[RESPONSE_TOPIC][0].columns == RESPONSE_COLUMNS
    assert len(rows) > 10
    np.testing.assert_array_equal(rows, expected)
    assert codes == {"emg_processor": 0}


@pytest.fixture(scope="module")
def laboratory(lab):
    """Nodes that are connected and have run for ten seconds."""
    made = lab.Laboratory(lab.MADE, plate=True)
    try:
        made.stream = f"nodes of {os.getpid()} at {time.monotonic_ns()}"
        made.start("emg_processor", "-p", "wait_for_readers:=1")
        made.start("emg_bridge", "-p", f"stream_name:={made.stream}", "-p", "wait_for_readers:=2")
        made.start(
            "emg_outlet", "-p", f"stream_name:={made.stream}", "-r", f"{SAMPLES_TOPIC}:={lab.MADE}"
        )
        made.listen(RESPONSE_TOPIC)
        made.listen(SAMPLES_TOPIC)
        made.until(
            lambda: all(
                publisher.get_subscription_count()
                for publisher in (made.emg, made.reference, made.plate)
            ),
            "readers",
        )
        made.run(10.0)
        made.until(lambda: made.reported("emg_bridge", "sends nothing"), "silence is reported")
        yield made
    finally:
        codes = made.close()
    assert set(codes.values()) == {0}, codes


@chain
def test_every_sample_comes_through_with_its_value_and_its_time(laboratory):
    sent, received = np.concatenate(laboratory.sent), laboratory.data(SAMPLES_TOPIC)
    # By all four values as the amplifier sends them: 32-bit microvolts.
    where = {row.tobytes(): k for k, row in enumerate((1e6 * sent[:, 2:]).astype(np.float32))}
    index = np.array([where[row.tobytes()] for row in (1e6 * received[:, 1:]).astype(np.float32)])
    # The stream is found with its first block or soon after; from then on nothing is missing but
    # what fills no block at the end.
    np.testing.assert_array_equal(np.diff(index), 1)
    assert len(received) > 7 * RATE
    assert index[-1] >= len(sent) - 2 * SIZE
    errors = np.abs(received[:, 0] - sent[index, 0])
    assert np.median(errors) < 1e-3
    assert errors.max() < 5e-3  # the first seconds of a stream on a busy computer
    assert laboratory.blocks[SAMPLES_TOPIC][0].columns == SAMPLE_COLUMNS


@chain
def test_responses_are_those_of_the_samples(laboratory):
    sent, velocity = np.concatenate(laboratory.sent), np.concatenate(laboratory.velocity)
    expected, got = responses(sent, velocity), laboratory.data(RESPONSE_TOPIC)
    begin, end = laboratory.data(SAMPLES_TOPIC)[[0, -1], 0]
    expected, got = (
        rows[(rows[:, 0] > begin + 1.0) & (rows[:, 0] < end - 0.1)] for rows in (expected, got)
    )
    assert len(got) > 15
    np.testing.assert_array_equal(got[:, :2], expected[:, :2])
    assert np.isfinite(got[:, 2:]).all()
    # A time that is off by 1 ms takes two samples of the 82 of a background's window in and two
    # out.
    np.testing.assert_allclose(got[:, 2:6], expected[:, 2:6], rtol=0.2)
    for direction, columns in ((1, [6, 8, 9]), (-1, [7])):
        mine, theirs = (
            rows[rows[:, 1] == direction][:, columns].mean(axis=0) for rows in (got, expected)
        )
        np.testing.assert_allclose(mine, theirs, rtol=0.1)
        assert (
            mine > 0.4e-6
        ).all()  # 20 ms of twice the mean of rectified noise of 20 uV: 0.64 uV.s


@chain
def test_silence_is_on_diagnostics_within_a_second(laboratory):
    text = laboratory.reported("emg_bridge", "sends nothing")
    assert float(re.search(r"sends nothing for ([0-9.]+) s", text)[1]) <= 1.0


@chain
def test_an_amplifier_that_dies_and_returns_is_named_and_its_samples_follow(lab, laboratory):
    before = laboratory.data(SAMPLES_TOPIC)
    since = time.monotonic()
    laboratory.nodes["emg_outlet"].kill()
    laboratory.nodes["emg_outlet"].wait(timeout=10)
    laboratory.until(
        lambda: (
            laboratory.reported("emg_bridge", "lost", since)
            or laboratory.reported("emg_bridge", "no stream", since)
        ),
        "loss is reported",
    )
    laboratory.until(lambda: not laboratory.emg.get_subscription_count(), "the end of the outlet")
    laboratory.start(
        "emg_outlet",
        "-p",
        f"stream_name:={laboratory.stream}",
        "-r",
        f"{SAMPLES_TOPIC}:={lab.MADE}",
    )
    laboratory.until(laboratory.emg.get_subscription_count, "the outlet")
    laboratory.run(8.0)
    laboratory.until(
        lambda: laboratory.reported("emg_bridge", "started anew, with a new clock", since),
        "a new clock is reported",
    )
    data, rows = laboratory.data(SAMPLES_TOPIC), laboratory.data(RESPONSE_TOPIC)
    assert len(data) > len(before) + 3 * RATE
    assert np.diff(data[:, 0]).min() > 0
    assert np.isfinite(rows[rows[:, 0] > data[len(before), 0] + 1.0, 2:]).all()
