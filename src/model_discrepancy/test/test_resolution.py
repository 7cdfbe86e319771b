"""A coarse channel is told from a torque that rests at a few levels."""

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from model_discrepancy.recording.resolution import coarse_step


def torque_at_few_levels(seed: int) -> np.ndarray:
    """Return a torque [N.m], sampled at 1000 Hz, that goes smoothly from one level to the next."""
    generator = np.random.default_rng(seed)
    levels = np.repeat(generator.integers(-3, 4, 300), 200).astype(float)
    smooth = sosfiltfilt(butter(2, 8.0, fs=1000.0, output="sos"), levels)
    return smooth + 0.05 * generator.standard_normal(len(smooth))


@pytest.mark.parametrize("seed", [0, 1, 7])
def test_a_torque_that_rests_at_a_few_levels_is_not_coarse(seed):
    assert coarse_step(torque_at_few_levels(seed)) == 0.0


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_coarse_channel_is_found_by_its_step(noise):
    step = 0.7
    generator = np.random.default_rng(1)
    smooth = sosfiltfilt(
        butter(2, 8.0, fs=1000.0, output="sos"), 20.0 * generator.standard_normal(60_000)
    )
    coarse = np.round(smooth / step) * step + noise * step * generator.standard_normal(60_000)
    assert coarse_step(coarse) == pytest.approx(step, rel=0.02)
    assert coarse_step(smooth) == 0.0


@pytest.mark.parametrize(("noise", "coarse"), [(1.0, False), (0.3, True)])
def test_steps_below_twice_the_noise_that_a_converter_is_given_are_not_coarse(noise, coarse):
    """A converter of 12 bits for 50 N.m has steps of 0.02 N.m, and hides nothing."""
    step = 0.02
    generator = np.random.default_rng(1)
    smooth = sosfiltfilt(butter(2, 8.0, fs=1000.0, output="sos"), generator.standard_normal(60_000))
    given = smooth + noise * step * generator.standard_normal(60_000)
    assert (coarse_step(np.round(given / step) * step) > 0.0) == coarse
