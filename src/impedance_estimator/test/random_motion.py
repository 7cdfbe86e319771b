"""The core of a joint, and a plate that moves at random, for tests of what is known of both."""

import numpy as np
from scipy import signal

CORE = {
    "inertia": {"I": 0.0137},
    "viscosity": {"B": 0.63},
    "stiffness": {"K": 100.0},
    "reflex": {"G": 10.0},
}


def random_motion(rate, seconds, cutoff=15.0, seed=5):
    """Smooth random motion of 0.02 rad: position, velocity, acceleration, each of shape (n,)."""
    random = np.random.default_rng(seed)
    sections = signal.butter(4, cutoff, fs=rate, output="sos")
    x = signal.sosfilt(sections, random.normal(size=round(seconds * rate)))
    x *= 0.02 / x.std()
    v = np.gradient(x, 1.0 / rate)
    return x, v, np.gradient(v, 1.0 / rate)
