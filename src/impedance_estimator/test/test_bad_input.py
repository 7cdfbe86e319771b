"""Interruptions and damaged samples: valid drops, says why, comes back, and later estimates are as
if nothing had been.
"""

import numpy as np
import pytest

from impedance_estimator.algorithms import DEFAULT, make_estimator
from impedance_estimator.offline.recorded_estimates import estimate_signal
from impedance_estimator.settings import Settings
from impedance_estimator.stream import EstimateStream

VALID, DOUBT = 7, 8
EVENT = 40.0  # s


def run(samples, rate=2048.0, settings=None):
    """Rows, and the reason after every row's block."""
    estimator = make_estimator("CE", rate, True, settings or Settings())
    rows, reasons = [], []
    for begin in range(0, len(samples), 32):
        rows.append(estimator.process(samples[begin : begin + 32]))
        reasons += [estimator.reason] * len(rows[-1])
    return np.concatenate(rows), reasons


def stated(rows):
    """Rows without the doubt, which CE does not state."""
    return np.delete(rows, DOUBT, axis=1)


@pytest.fixture(scope="module")
def clean(minute):
    return run(minute.samples())[0]


def damaged(minute, what):
    """The recording with something wrong at 40 s."""
    samples = minute.samples()
    at = int(EVENT * minute.rate)
    if what == "one NaN":
        samples[at, 3] = np.nan
    elif what == "NaN for a second":
        samples[at : at + 2048, 1:] = np.nan
    elif what == "infinite velocity":
        samples[at : at + 5, 2] = np.inf
    elif what == "NaN time":
        samples[at : at + 3, 0] = np.nan
    elif what == "torque spike":
        samples[at, 3] = 1e9
    elif what == "degrees for a while":
        samples[at : at + 100, 1] = 90.0
    elif what == "missing block":
        samples = np.delete(samples, slice(at, at + 32), axis=0)
    elif what == "three seconds missing":
        samples = np.delete(samples, slice(at, at + 6144), axis=0)
    elif what == "repeated block":
        samples = np.insert(samples, at, samples[at - 32 : at], axis=0)
    elif what == "clock back by a second":
        samples[at:, 0] -= 1.0
    return samples


CASES = {
    "one NaN": "NaN",
    "NaN for a second": "NaN",
    "infinite velocity": "infinite",
    "NaN time": "NaN",
    "torque spike": "beyond any ankle",
    "degrees for a while": "beyond any ankle",
    "missing block": "missing",
    "three seconds missing": "missing",
    "repeated block": "backwards",
    "clock back by a second": "backwards",
}


@pytest.mark.parametrize("what", CASES)
def test_short_interruption_is_bridged_and_poisons_nothing(minute, clean, what):
    rows, reasons = run(damaged(minute, what))
    valid = rows[:, VALID] > 0
    first_bad = np.argmax(~valid & (rows[:, 0] > EVENT - 1.5) & (np.arange(len(rows)) > 64 * 35))
    assert not valid[first_bad], "the validity flag never dropped"
    assert CASES[what] in reasons[first_bad]
    # While invalid, the last valid estimate is held.
    np.testing.assert_array_equal(rows[first_bad, 1:7], rows[first_bad - 1, 1:7])
    back = first_bad + np.argmax(valid[first_bad:])
    assert valid[back:].all(), "validity did not come back for good"
    assert 0.3 < (back - first_bad) / 64.0 < 2.0
    assert np.isfinite(stated(rows[valid])).all()
    np.testing.assert_allclose(rows[-1, [1, 2, 3, 4]], clean[-1, [1, 2, 3, 4]], rtol=0.05)


@pytest.mark.parametrize(("gap", "reason"), [(20.0, "missing"), (-100.0, "backwards")])
def test_long_interruption_starts_anew(minute, gap, reason):
    samples = np.concatenate([minute.samples(), minute.samples()])
    half = len(samples) // 2
    samples[half:, 0] += minute.time[-1] + gap
    rows, reasons = run(samples)
    second = rows[half // 32 :]
    assert reason in reasons[half // 32]
    assert "settling" in reasons[half // 32 + 64]
    assert not second[: (29 * 64), VALID].any()
    assert second[(31 * 64) :, VALID].all()
    # Nothing of the first half is left: the estimates are those of a fresh estimator, up to its
    # start's place in a block.
    np.testing.assert_allclose(second[-1, 1:5], rows[half // 32 - 1, 1:5], rtol=1e-6)


def test_constant_position_is_not_valid_and_not_infinite(minute):
    rng = np.random.default_rng(3)
    n = 40 * 2048
    t = np.arange(n) / 2048.0
    noise = rng.normal(size=(3, n)) * [[5e-5], [0.006], [0.1]]
    rows, reasons = run(np.column_stack([t, 0.15 + noise[0], noise[1], 5.0 + noise[2]]))
    assert not rows[:, VALID].any()
    assert "position does not change" in reasons[-1]
    assert np.isnan(rows[:, 1:7]).all()


def test_rest_of_the_perturbation_holds_the_estimate(simulate):
    rows, reasons = run(simulate(60.0, seed=7, rest=(40.0, 45.0)).samples())
    assert "position does not change" in reasons[(44 * 64)]
    assert not rows[(44 * 64), VALID]
    assert rows[(46 * 64) :, VALID].all()
    np.testing.assert_allclose(rows[(46 * 64), [1, 4]], rows[(42 * 64), [1, 4]], rtol=0.03)
    np.testing.assert_allclose(rows[-1, 1:5], [100.0, 0.63, 0.0137, 10.0], rtol=0.08)


def test_single_frequency_is_refused_by_name():
    t = np.arange(40 * 1000) / 1000.0
    x, v, a = 0.05 * np.sin(8 * t), 0.4 * np.cos(8 * t), -3.2 * np.sin(8 * t)
    rows, reasons = run(
        np.column_stack([t, x, v, 100 * x + 0.6 * v + 0.01 * a]), 1000.0, Settings(highpass="all")
    )
    assert not rows[:, VALID].any()
    assert "one frequency" in reasons[-1]


def test_unplugged_torque_sensor_is_named(minute):
    samples = minute.samples()
    samples[:, 3] = 0.0
    rows, reasons = run(samples)
    assert not rows[:, VALID].any()
    assert "torque does not change" in reasons[-1]


def test_before_the_first_valid_estimate_there_are_only_nans(clean):
    first = np.argmax(clean[:, VALID])
    assert clean[first, 0] == pytest.approx(30.4, abs=0.2)
    assert np.isnan(clean[:first, 1:7]).all()
    assert np.isnan(clean[:first, 8:]).all()
    assert np.isfinite(stated(clean[first:])).all()
    # CE does not judge itself.
    assert np.isnan(clean[first:, DOUBT]).all()


def test_offset_of_torque_and_position_leaves_no_transient(simulate):
    recording = simulate(60.0, seed=7, snr=None)
    plain = recording.samples()
    shifted = plain + np.array([0.0, 0.15, 0.0, -40.0])
    for highpass in ("torque", "all"):
        a, b = (
            run(samples, settings=Settings(highpass=highpass))[0][-1, 1:5]
            for samples in (plain, shifted)
        )
        np.testing.assert_allclose(a, b, rtol=1e-4)


def test_change_of_the_sampling_rate_starts_anew_at_the_new_rate(simulate):
    fast, slow = simulate(40.0, seed=8), simulate(60.0, rate=1000.0, seed=9, oversampling=8)
    late = slow.samples()
    late[:, 0] += fast.time[-1] + 1e-3
    stream = EstimateStream()
    stream.feed_samples(fast.samples(), True)
    due = stream.feed_samples(late, True)
    assert any("sampling rate is no longer 2048 Hz" in note for note in due.notes)
    assert any(f"{DEFAULT} at 1000 Hz" in note for note in due.notes)
    assert due.rows[-1, VALID]
    assert due.rows[-1, 3] == pytest.approx(0.0137, rel=0.05)


def test_velocity_that_disappears_is_reported(minute):
    stream = EstimateStream()
    stream.feed_samples(minute.samples()[:2048], True)
    due = stream.feed_samples(minute.samples(velocity=False)[2048:4096], False)
    assert "velocity is gone from now on" in due.notes[0]


@pytest.mark.parametrize("rate", [100.0, 20_000.0])
def test_sampling_rate_out_of_range_is_refused(rate):
    t = np.arange(1000) / rate
    with pytest.raises(
        ValueError, match=rf"sampling rate {rate:g} Hz is refused; allowed: 500 to 10000 Hz"
    ):
        estimate_signal(t, t, t, t)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"highpass_cutoff": 0.0}, "'highpass_cutoff' = 0.0 Hz is refused; allowed: 0.001 to 3 Hz"),
        ({"highpass": "none"}, "'highpass' = 'none' is refused; allowed: one of torque, all"),
        ({"settling_time": float("nan")}, "'settling_time' = nan s is refused"),
        ({"reflex_first_lag": "early"}, "'reflex_first_lag' = 'early' is refused"),
    ],
)
def test_settings_out_of_range_are_refused(settings, words):
    with pytest.raises(ValueError, match="is refused") as error:
        Settings(**settings)
    assert words in str(error.value)


def test_wrong_shapes_and_names_are_refused(minute):
    with pytest.raises(
        ValueError, match=r"samples of shape \(10, 3\) do not fit; expected \(n, 4\)"
    ):
        make_estimator("CE", 2048.0, True).process(np.zeros((10, 3)))
    with pytest.raises(ValueError, match="not known; allowed: C, CE, O, simultaneous"):
        EstimateStream("X")
    with pytest.raises(ValueError, match="must have the same length"):
        estimate_signal(np.zeros(10), np.zeros(9), None, np.zeros(10))
    with pytest.raises(ValueError, match="no estimate; waiting for samples"):
        estimate_signal(minute.time[:100], minute.position[:100], None, minute.torque[:100])
