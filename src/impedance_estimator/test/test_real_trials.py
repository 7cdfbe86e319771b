"""Two trials of a human ankle: plausible, and the same from 1000 Hz and from 2048 Hz data."""

from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from ankle_interfaces.resampling import resample
from impedance_estimator.offline.recorded_estimates import estimate_signal
from impedance_estimator.settings import Settings

RECORDINGS = Path(__file__).resolve().parents[4] / "shared" / "recordings"
TRIALS = ("mcgill_1", "mcgill_2")

# Bounds of plausibility; docs/algorithm.md says where they come from and how firm they are.
PLAUSIBLE_RANGES = {
    "K[N.m/rad]": (20.0, 250.0),
    "B[N.m.s/rad]": (0.2, 3.0),
    "I[kg.m^2]": (0.005, 0.03),
    "G[N.m.s/rad]": (0.0, 40.0),
}


@pytest.fixture(scope="module", params=TRIALS)
def trial(request):
    path = RECORDINGS / f"{request.param}.npz"
    if not path.exists():
        pytest.skip(f"the recording {path.name} is not there")
    data = np.load(path)
    # The recordings' torque is the subject's; here it is the torque that moves the ankle.
    return np.column_stack([data["position"], -data["torque"]])


def estimate(signals, rate, highpass):
    return estimate_signal(
        np.arange(len(signals)) / rate,
        signals[:, 0],
        None,
        signals[:, 1],
        "CE",
        Settings(highpass=highpass),
    )


@pytest.mark.parametrize("highpass", ["torque", "all"])
def test_estimates_are_plausible_stable_and_independent_of_the_rate(trial, highpass):
    result = estimate(trial, 1000.0, highpass)
    assert result.valid[0, 0] < 31.0
    assert np.all(result.rows[result.rows[:, 0] > 31.0, 7] == 1.0)
    values = result.median()
    for name, (low, high) in PLAUSIBLE_RANGES.items():
        assert low < values[name] < high, f"{name} = {values[name]:.4g}"
    assert 50.0 < values["vaf_intrinsic[%]"] < values["vaf_total[%]"] < 100.0
    # Over half a minute K and I stay within a quarter of their median; B, into which reflex torque
    # leaks, within half.
    spread = np.ptp(result.valid[:, 1:4], axis=0) / np.median(result.valid[:, 1:4], axis=0)
    assert spread[0] < 0.25
    assert spread[2] < 0.25
    assert spread[1] < 0.5
    at_2048 = estimate(resample(trial, 1000.0, 2048.0), 2048.0, highpass).median()
    for name in PLAUSIBLE_RANGES:
        assert at_2048[name] == pytest.approx(values[name], rel=0.05), name


def known_joint(trial, gain, drift=0.0):
    """Position of a trial at 1000 Hz and the torque of a joint with K = 100, B = 0.63, I = 0.0137
    that moves like that.
    """
    rate = 1000.0
    x = signal.sosfiltfilt(signal.butter(4, 60.0, fs=rate, output="sos"), trial[:, 0])
    v = np.gradient(x, 1 / rate)
    a = np.gradient(v, 1 / rate)
    stretch = np.concatenate([np.zeros(40), np.maximum(v, 0.0)[:-40]])
    muscle = signal.lfilter(
        *signal.bilinear([21.0**2], [1.0, 2 * 0.8 * 21.0, 21.0**2], rate), stretch
    )
    return np.column_stack([x, 0.0137 * a + 0.63 * v + 100.0 * x + gain * muscle + drift])


def test_random_steps_leak_reflex_into_stiffness(trial):
    """Why CE's numbers on these trials are bounds, not values: a known joint moved by the real
    position signal.

    CE leaves the reflex out of the intrinsic fit only where position and past rectified velocity
    are uncorrelated. Random-level steps are not pulse-steps: part of the reflex is taken for
    stiffness.
    """
    without, reflex = (
        estimate(known_joint(trial, gain), 1000.0, "all").median() for gain in (0.0, 10.0)
    )
    assert without["K[N.m/rad]"] == pytest.approx(100.0, rel=0.01)
    assert without["G[N.m.s/rad]"] == pytest.approx(0.0, abs=0.1)
    assert 110.0 < reflex["K[N.m/rad]"] < 130.0
    assert 4.0 < reflex["G[N.m.s/rad]"] < 7.0


def test_simultaneous_does_not_leak_on_random_steps(trial):
    """The same known joint with 0.5 N.m of voluntary torque: intrinsic and reflex parts in one
    regression need no special motion.
    """
    random = np.random.default_rng(3)
    slow = signal.sosfilt(
        signal.butter(4, 0.3, fs=1000.0, output="sos"), random.normal(size=len(trial))
    )
    signals = known_joint(
        trial, 10.0, 0.5 * slow / slow.std() + 0.05 * random.normal(size=len(trial))
    )
    values = estimate_signal(
        np.arange(len(signals)) / 1000.0, signals[:, 0], None, signals[:, 1], "simultaneous"
    ).median()
    assert values["K[N.m/rad]"] == pytest.approx(100.0, rel=0.02)
    assert values["G[N.m.s/rad]"] == pytest.approx(10.0, rel=0.05)


def test_simultaneous_keeps_its_memory_on_a_real_ankle(trial):
    """No ankle is the model; what it does otherwise is not taken for changes, after which standard
    errors would be large again.
    """
    t = np.arange(len(trial)) / 1000.0
    rows = estimate_signal(t, trial[:, 0], None, trial[:, 1], "simultaneous").valid
    errors = rows[rows[:, 0] > 25.0][:, 9]
    assert errors.max() < 2.0 * np.median(errors)


def test_simultaneous_says_the_same_of_both_halves_and_of_torque_a_millisecond_later(trial):
    """The voluntary torque's noise model must not be chosen by what the model leaves out."""
    half, later = len(trial) // 2, np.roll(trial[:, 1], 1)
    t = np.arange(half) / 1000.0
    values = np.array(
        [
            estimate_signal(t, trial[part, 0], None, torque[part], "simultaneous").rows[-1, [1, 4]]
            for torque in (trial[:, 1], later)
            for part in (slice(0, half), slice(half, 2 * half))
        ]
    )
    assert np.ptp(values[:, 0]) < 0.1 * values[:, 0].mean()
    assert np.ptp(values[:, 1]) < 0.25 * values[:, 1].mean()
