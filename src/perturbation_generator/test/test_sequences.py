"""The single signals: pulse-step timing and balance, random levels, PRBS and multisine."""

import numpy as np
import pytest

from ankle_interfaces.errors import QuantityError
from perturbation_generator.edges import Block, Filtered, Polynomial
from perturbation_generator.multisine import Multisine
from perturbation_generator.on_request import OnRequest
from perturbation_generator.prbs import Prbs
from perturbation_generator.pulse_step import GROUP, PulseStep
from perturbation_generator.random_steps import RandomSteps
from perturbation_generator.rig_calibration import DURATION, SWEEP_TIME, RigCalibration
from perturbation_generator.settings import Settings


def blocks(signal, seconds):
    """Start, time away from rest, length and side of each complete block of a pulse-step signal."""
    signal.next(round(seconds * signal.settings.rate))
    onsets = signal.onsets()
    starts, returns = onsets[0::2], onsets[1::2]
    away = np.array([back.time - start.time for start, back in zip(starts, returns, strict=False)])
    times = np.array([start.time for start in starts])
    sides = np.array([start.direction for start in starts])
    return times[:-1], away[: len(times) - 1], np.diff(times), sides[:-1]


def test_pulses_and_steps_of_the_paper():
    _, away, length, _ = blocks(PulseStep(Settings(shape=Block()), stretch=0.0), 240.0)
    np.testing.assert_allclose(length, 0.5, rtol=0, atol=1e-9)
    pulse = away < 0.25
    np.testing.assert_allclose(away[pulse], 0.040, rtol=0, atol=1e-9)
    np.testing.assert_allclose(away[~pulse], 0.460, rtol=0, atol=1e-9)
    # 479 blocks with equal chance: four standard deviations.
    assert abs(pulse.sum() - 239.5) < 4 * np.sqrt(479) / 2
    # No memory: a pulse follows a pulse as often as a step.
    assert abs(pulse[1:][pulse[:-1]].mean() - 0.5) < 4 * 0.5 / np.sqrt(pulse[:-1].sum())


def test_the_long_part_is_stretched():
    _, away, length, _ = blocks(PulseStep(Settings(shape=Block())), 300.0)
    pulse = away < 0.25
    stretch = length - 0.5
    assert stretch.min() >= -1e-9
    assert 0.19 < stretch.max() <= 0.2 + 1e-9
    assert stretch.mean() == pytest.approx(0.1, abs=0.012)
    np.testing.assert_allclose(away[pulse], 0.040, rtol=0, atol=1e-9)
    np.testing.assert_allclose(away[~pulse], 0.460 + stretch[~pulse], rtol=0, atol=1e-9)
    assert (
        90 <= len(away) / 5 <= 110
    )  # about 100 responses a minute, as in the paper's section III-B


@pytest.mark.parametrize(
    ("shape", "width"),
    [(Block(), 0.04), (Filtered(), 0.04), (Polynomial(), 0.024), (Polynomial(0.05), 0.05)],
)
def test_width_of_a_pulse_follows_the_shape(shape, width):
    _, away, _, _ = blocks(PulseStep(Settings(shape=shape), stretch=0.0), 30.0)
    assert away.min() == pytest.approx(width)
    assert away.max() == pytest.approx(0.5 - width)


@pytest.mark.parametrize("direction", ["dorsiflexing", "both"])
def test_balanced_groups(direction):
    times, away, length, sides = blocks(
        PulseStep(Settings(shape=Block(), direction=direction), balanced=True), 130.0
    )
    orders = set()
    for first in range(0, len(times) - GROUP, GROUP):
        group = slice(first, first + GROUP)
        pulse = away[group] < 0.25
        assert pulse.sum() == GROUP // 2
        np.testing.assert_allclose(
            np.sort(length[group][pulse]), np.sort(length[group][~pulse]), rtol=0, atol=1e-9
        )
        if direction == "both":
            assert [sides[group][pulse].sum(), sides[group][~pulse].sum()] == [0, 0]
        orders.add(tuple(pulse))
    assert len(orders) >= 8


def test_random_steps_as_in_the_recordings():
    signal = RandomSteps(Settings(direction="both", amplitude=0.03))
    signal.next(300 * 2048)
    onsets = signal.onsets()
    gaps = np.diff([onset.time for onset in onsets])
    assert gaps.min() >= 0.2 - 1e-9
    assert gaps.max() <= 0.3 + 1e-9
    assert gaps.mean() == pytest.approx(0.25, abs=0.005)
    sizes = np.array([onset.amplitude for onset in onsets[0::2]])
    assert sizes.min() >= 0.015
    assert 0.0295 < sizes.max() <= 0.03
    assert np.median(sizes) == pytest.approx(0.0225, abs=0.001)
    out = [onset.direction for onset in onsets[0::2]]
    assert abs(np.mean(out)) < 4 / np.sqrt(len(out))
    for start, back in zip(onsets[0::2], onsets[1::2], strict=False):
        assert back.amplitude == start.amplitude
        assert back.direction == -start.direction


def test_prbs_has_the_statistics_of_a_maximum_length_sequence():
    order, clock, rate = 8, 0.1, 1000.0
    period = 2**order - 1
    signal = Prbs(
        Settings(rate=rate, shape=Block(), direction="both", seed=9), order=order, clock=clock
    )
    chips = np.sign(signal.next(round(2 * period * clock * rate))[50 :: round(clock * rate), 0])
    np.testing.assert_array_equal(chips[:period], chips[period:])
    one = chips[:period]
    assert (one > 0).sum() == 2 ** (order - 1)
    autocorrelation = np.fft.ifft(np.abs(np.fft.fft(one)) ** 2).real
    assert autocorrelation[0] == pytest.approx(period)
    np.testing.assert_allclose(autocorrelation[1:], -1.0, atol=1e-6)


@pytest.mark.parametrize(
    ("direction", "low", "high"),
    [("both", -1, 1), ("dorsiflexing", 0, 1), ("plantarflexing", -1, 0)],
)
def test_multisine_has_equal_lines_and_nothing_between(direction, low, high):
    signal = Multisine(
        Settings(direction=direction, rate=1000.0), period=10.0, lowest=0.5, highest=20.0
    )
    x, v, a = signal.next(30_000)[10_000:20_000].T  # a whole period behind the fade
    amplitudes = np.abs(np.fft.rfft(x)) * 2 / len(x)
    lines = np.arange(5, 201)
    np.testing.assert_allclose(signal.frequencies, lines / 10.0)
    np.testing.assert_allclose(amplitudes[lines], amplitudes[lines[0]], rtol=1e-6)
    others = np.delete(amplitudes, np.append(lines, 0))
    assert others.max() < 1e-9 * amplitudes[lines[0]]
    assert low * 0.04 <= x.min()
    assert x.max() <= high * 0.04
    assert np.ptp(x) > 0.7 * (high - low) * 0.04
    omega = 2j * np.pi * np.fft.rfftfreq(len(x), 1e-3)
    np.testing.assert_allclose(v, np.fft.irfft(omega * np.fft.rfft(x)), atol=1e-9)
    np.testing.assert_allclose(a, np.fft.irfft(omega**2 * np.fft.rfft(x)), atol=1e-6)


def test_multisine_period_at_a_rate_that_does_not_divide_it():
    signal = Multisine(
        Settings(rate=1000.3, direction="both"), period=0.5, lowest=2.0, highest=50.0
    )
    x = signal.next(4000)[2000:, 0]
    np.testing.assert_array_equal(x[:1000], x[500:1500])
    assert signal.frequencies[0] == pytest.approx(2.0, rel=1e-3)


def test_a_stretch_is_given_for_each_request_and_never_two_at_once():
    signal = OnRequest(Settings(amplitude=0.04))
    assert not signal.next(1024).any()
    onset = signal.request()
    assert onset == pytest.approx(0.5)
    assert signal.request() is None
    position = signal.next(2048)[:, 0]
    rate = signal.settings.rate
    assert position.max() == pytest.approx(0.04)
    assert np.flatnonzero(position > 0.02)[0] / rate == pytest.approx(0.012, abs=1e-3)
    assert np.sum(position > 0.02) / rate == pytest.approx(0.5, abs=1e-3)
    assert position[-1] == 0.0
    assert signal.request() is not None
    assert [o.direction for o in signal.onsets()] == [1, -1]
    with pytest.raises(QuantityError, match="an edge takes"):
        OnRequest(Settings(shape=Polynomial(0.2)), hold=0.1)


def test_the_movements_of_a_calibration_wait_for_their_request():
    settings = Settings(rate=512.0)
    assert not RigCalibration(settings).awaits_requests
    signal, at_once = RigCalibration(settings, on_request=True), RigCalibration(settings)
    whole = int(DURATION * 512.0)
    assert signal.awaits_requests
    assert not signal.next(whole).any()  # the plate rests, however long
    assert signal.request() == pytest.approx(DURATION)
    assert signal.request() is None
    assert signal.busy_for == pytest.approx(DURATION)
    moved = signal.next(whole)
    assert signal.busy_for == 0.0
    np.testing.assert_allclose(moved, at_once.next(whole), rtol=0, atol=1e-6)
    assert signal.request() is not None  # a second calibration, as with a spring
    assert np.abs(signal.next(whole)).max() > 0.0


@pytest.mark.parametrize("shape", [Polynomial(), Filtered()])
@pytest.mark.parametrize(
    "seconds", [0.0, 5.0, 10.01, 12.3, 33.9, 34.2, 57.77, 80.0, 84.0, 99.0, 131.0]
)
def test_the_movements_of_a_calibration_end_before_their_time(shape, seconds):
    rate, amplitude = 1024.0, 0.04
    signal = RigCalibration(Settings(rate=rate, shape=shape, amplitude=amplitude), on_request=True)
    start = signal.next(100)
    signal.rest()
    assert signal.busy_for == 0.0  # nothing was requested
    signal.request()
    before = signal.next(round(seconds * rate))
    signal.rest()
    still = signal.busy_for
    assert still <= 2.0 * SWEEP_TIME
    after = signal.next(round((still + 1.0) * rate))
    position, velocity, acceleration = np.concatenate([start, before, after]).T
    limits = signal.extremes(amplitude)
    assert np.abs(velocity).max() <= limits.velocity
    assert np.abs(acceleration).max() <= limits.acceleration
    # Nothing jumps: each sample follows from the velocity at the last two.
    steps = np.diff(position) - 0.5 * (velocity[1:] + velocity[:-1]) / rate
    assert np.abs(steps).max() <= 0.2 * limits.acceleration / rate**2
    np.testing.assert_allclose(after[-round(0.9 * rate) :], 0.0, atol=1e-9)
    assert all(onset.time < signal.time - 0.9 for onset in signal.onsets())
    assert signal.request() is not None
    again = signal.next(round((DURATION + 1.0) * rate))
    assert amplitude * 0.999 <= np.abs(again[:, 0]).max() <= limits.position * (1.0 + 1e-9)
    assert not again[-10:].any()


def test_movements_that_nobody_requested_do_not_end_before_their_time():
    settings = Settings(rate=512.0)
    ended, other = RigCalibration(settings), RigCalibration(settings)
    for signal in (ended, other):
        signal.next(20 * 512)
    ended.rest()
    np.testing.assert_array_equal(ended.next(4096), other.next(4096))
