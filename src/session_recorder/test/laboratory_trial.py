"""A trial of a known ankle, and its columns as text."""

import numpy as np

RATE = 500.0
N = 5_000


def trial(rate=RATE, n=N):
    """An ankle of 0.0137 kg.m^2 under random steps: t, position, velocity, torque, EMG."""
    random = np.random.default_rng(8)
    t = np.arange(n) / rate
    steps = np.repeat(random.uniform(-0.02, 0.02, n // 100 + 1), 100)[:n]
    kernel = np.hanning(int(0.02 * rate))
    position = np.convolve(steps, kernel / kernel.sum(), "same") + 0.1
    velocity = np.gradient(position, 1 / rate)
    torque = 0.0137 * np.gradient(velocity, 1 / rate) + 0.6 * velocity + 90 * (position - 0.1) - 3
    emg = 2e-5 * random.standard_normal(n)
    return {"t": t, "position": position, "velocity": velocity, "torque": torque, "emg": emg}


TRIAL = trial()
DEG = np.degrees(TRIAL["position"])


def text(columns, delimiter=",", decimal=".", header=(), end=""):
    rows = np.column_stack(columns)
    lines = [delimiter.join(f"{v:.9g}" for v in row) + end for row in rows]
    if decimal == ",":
        lines = [line.replace(".", ",") for line in lines]
    return "\n".join([*header, *lines]) + "\n"


def plain(*names, **options):
    """A text of time, angle in degrees and torque."""
    return text([TRIAL["t"], DEG, TRIAL["torque"]], header=names, **options)
