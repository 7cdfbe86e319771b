"""A recording of a synthetic ankle, and what is stated of its columns."""

import numpy as np

STATED = {"t[s]": "time", "position[rad]": "position", "torque[N.m]": "torque"}
I, B, K = 0.0137, 0.63, 100.0  # the paper's ankle


def synthetic(seconds=20.0, rate=1000.0, noise=0.02):
    """An ankle of known I, B and K under smooth random steps of 20 mrad, at 0.1 rad, with torque of
    the rig's sign.
    """
    n = int(seconds * rate)
    random = np.random.default_rng(5)
    t = np.arange(n) / rate
    level, position = 0.0, np.empty(n)
    for k in range(n):
        if k % 250 == 0:
            level = random.uniform(-0.02, 0.02)
        position[k] = level
    width = int(0.02 * rate)
    kernel = np.hanning(width) / np.hanning(width).sum()
    position = np.convolve(position, kernel, "same")
    velocity = np.gradient(position, 1 / rate)
    torque = I * np.gradient(velocity, 1 / rate) + B * velocity + K * position
    torque += noise * torque.std() * random.normal(size=n) - 3.0 + np.sin(2 * np.pi * 0.1 * t)
    return {"time": t, "position": position + 0.1, "velocity": velocity, "torque": torque}
