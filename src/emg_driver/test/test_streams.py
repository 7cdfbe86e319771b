"""The bridge against real streams from another process at 2048 Hz: time, faults, reconnection."""

import time

import numpy as np
import pytest

RATE = 2048
# Fourteen streams at once and their readers need a core of their own for half a minute.
pytestmark = [pytest.mark.live, pytest.mark.slow]


def pulse_errors(data):
    """Distance of the pulses on SOL from the whole seconds at which they were sent [s]."""
    pulses = data[np.abs(data[:, 1]) > 300e-6, 0]
    return pulses - np.round(pulses)


@pytest.mark.parametrize("name", ["good", "drift"])
def test_samples_carry_the_time_at_which_they_were_taken(heard, name):
    data = heard[name].data
    assert len(data) > 6 * RATE
    errors = pulse_errors(data)
    assert len(errors) >= 6
    # The stamps of 'drift' lose 0.5 ms every second: 7 ms at the end, were it not found by arrival.
    assert np.abs(errors).max() < 1e-3
    assert heard[name].said == []


def test_samples_are_evenly_spaced_and_in_volts(heard):
    data = heard["good"].data
    steps = np.diff(data[:, 0]) * RATE
    assert steps.min() > 0.7
    assert steps.max() < 1.3
    assert np.std(data[:, 2:], axis=0) == pytest.approx([20e-6] * 3, rel=0.05)
    assert {len(block) for block in heard["good"].blocks} == {32}


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("flat", "TA: flat line"),
        ("saturated", "TA: saturated"),
        ("hum", "mains hum"),
        ("nan", "are NaN or infinite"),
    ],
)
def test_a_channel_that_goes_bad_is_named_within_a_second_and_no_longer_given_out(
    heard, name, words
):
    listener = heard[name]
    time_and_words = listener.first(words)
    assert time_and_words is not None
    assert all(sentence.startswith("TA: ") for _, sentence in listener.said)
    bad = np.isnan(listener.data[:, 2])
    began = listener.fault_at - 33 / RATE  # faults come with the chunk that ends then
    assert not bad[listener.data[:, 0] < began].any()
    assert bad[listener.data[:, 0] > began + 1.0].all()
    assert np.isfinite(listener.data[:, [1, 3, 4]]).all()


def test_lost_chunks_are_counted_and_leave_a_gap(heard):
    listener = heard["lost_chunk"]
    assert listener.first("96 samples (0.047 s) are missing") is not None
    assert listener.bridge.missing == 96
    steps = np.diff(listener.data[:, 0]) * RATE
    assert np.count_nonzero(steps > 1.5) == 1
    assert steps.max() == pytest.approx(97, abs=1)
    assert np.abs(pulse_errors(listener.data)).max() < 1e-3


def test_a_clock_that_is_set_is_named_and_time_goes_on(heard):
    listener = heard["clock_jump"]
    assert listener.first("clock jumped by 7.0") is not None
    assert np.diff(listener.data[:, 0]).min() > 0
    # Dated by arrival from then on: first by that of one chunk, which may have waited, after two
    # seconds by the smallest delay.
    errors = pulse_errors(listener.data)
    assert np.abs(errors).max() < 0.05
    assert np.abs(errors[-5:]).max() < 5e-3


def test_stamps_of_a_clock_of_their_own_are_named_and_dated_by_arrival(heard):
    listener = heard["own_clock"]
    assert "dated by their arrival" in listener.said[0][1]
    assert np.abs(pulse_errors(listener.data)).max() < 0.05


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("half_rate", "declares 2048 Hz and sends 10"),
        ("few_channels", "has no channel 'GL' for GL; its 2 channels have SOL, TA"),
        ("no_unit", "declares no unit for channel 0 (SOL)"),
    ],
)
def test_a_stream_that_does_not_fit_is_refused_and_gives_nothing(heard, name, words):
    assert any(words in sentence for _, sentence in heard[name].said), heard[name].said
    assert heard[name].blocks == []


def test_millivolts_declared_as_volts_are_named_and_not_given_out(heard):
    listener = heard["millivolts_as_volts"]
    assert listener.first("another unit than declared") is not None
    assert np.isnan(listener.data[RATE // 2 :, 1:]).all()


def test_a_stream_that_stops_gives_nothing_out(heard):
    data = heard["silent"].data
    assert 4.5 < data[-1, 0] - data[0, 0] < 5.1


def test_a_sender_that_starts_anew_is_found_again_without_going_back_in_time(amplifiers, listen_to):
    prefix = f"again-{time.monotonic_ns()}"
    listener = listen_to(f"{prefix} own_clock")
    deadline = time.monotonic() + 40
    first = amplifiers.start(prefix, 60, "own_clock")
    while len(listener.blocks) < 64 and time.monotonic() < deadline:
        listener.listen()
        time.sleep(0.005)
    first.kill()
    amplifiers.start(prefix, 60, "own_clock")
    before = len(listener.blocks)
    while len(listener.blocks) < before + 64 and time.monotonic() < deadline:
        listener.listen()
        time.sleep(0.005)
    assert listener.connections == 2
    assert listener.first("lost: ") is not None
    data = listener.data
    steps = np.diff(data[:, 0])
    assert steps.min() > 0
    assert np.count_nonzero(steps > 0.1) == 1
    # Both clocks began at zero; both connections are dated by arrival.
    assert np.abs(pulse_errors(data)).max() < 0.05
