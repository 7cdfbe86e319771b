"""A small simulated ankle that shares no code with the estimators or with ankle_physics, to check
both.

Everything runs at four times the sampling rate: reference signal, actuator (30 Hz, damping 0.7),
joint with delayed half-wave rectified velocity feedback, anti-alias filters; then sampling and
white noise. Linear systems are discretised for inputs that are linear between points, so position,
velocity and acceleration stay in step.
"""

from dataclasses import dataclass

import numpy as np
from scipy import signal
from scipy.interpolate import CubicSpline

OVERSAMPLING = 4
AMPLITUDE = 0.04  # rad
DELAY = 0.040  # s
OMEGA, DAMPING = 21.0, 0.8  # rad/s, 1
SNR = {
    "position": 52.7,
    "velocity": 37.7,
    "torque": 24.1,
}  # dB, van 't Veld 2018, sections II-C and II-D


@dataclass
class Recording:
    rate: float
    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    torque: np.ndarray

    def samples(self, velocity=True):
        columns = [self.time, self.position] + ([self.velocity] if velocity else []) + [self.torque]
        return np.column_stack(columns)


def pulse_steps(duration, fine, rng, edge=0.024, width=0.024, rest=(0.0, 0.0)):
    """Pulse-step reference around zero: blocks of 500 ms, the long part stretched by up to 0.2 s;
    none begins during `rest` [s].
    """
    reference = np.zeros(int(duration * fine))
    n, w = round(edge * fine), round(width * fine)
    s = np.arange(1, n + 1) / n if n else np.ones(0)
    rise = 10 * s**3 - 15 * s**4 + 6 * s**5

    def move(start, level):
        stop = min(start + n, len(reference))
        if n:
            reference[start:stop] += level * rise[: stop - start]
        reference[start + n :] += level

    start = 0
    while start < len(reference):
        if rest[0] <= start / fine < rest[1]:
            start = int(rest[1] * fine)
        length = round((0.5 + 0.2 * rng.random()) * fine)
        fall = start + (w if rng.random() < 0.5 else length - w)
        move(start, 1.0)
        if fall < len(reference):
            move(fall, -1.0)
        start += length
    return AMPLITUDE * (reference - 0.5)


def linear_system(numerators, denominator, inputs, fine):
    a, b, c, d = signal.tf2ss(np.atleast_2d(numerators), denominator)
    a, b, c, d, _ = signal.cont2discrete((a, b, c, d), 1.0 / fine, method="foh")
    outputs = []
    for k in range(c.shape[0]):
        numerator, poles = signal.ss2tf(a, b, c[k : k + 1], d[k : k + 1])
        outputs.append(signal.lfilter(numerator[0], poles, inputs))
    return outputs


def voluntary_torque(rms, cutoff, count, fine, seed):
    """White noise behind a fourth-order low-pass, scaled to its root mean square [N.m]."""
    if not rms:
        return np.zeros(count)
    # Drawn at 32 points per period of the cut-off and interpolated: a filter at the full rate would
    # be ill-conditioned.
    slow = 32.0 * cutoff
    settling = round(10.0 * 32)
    white = np.random.default_rng([seed, 7]).normal(size=int(count / fine * slow) + settling + 8)
    sos = signal.butter(4, cutoff, fs=slow, output="sos")
    drift = signal.sosfilt(sos, white)[settling:]
    # White noise of variance 1 comes out with the energy of the impulse response.
    drift *= rms / np.linalg.norm(signal.sosfilt(sos, np.eye(1, 4096)[0]))
    return CubicSpline(np.arange(len(drift)) / slow, drift)(np.arange(count) / fine)


def simulate(
    duration=240.0,
    rate=2048.0,
    seed=1,
    K=100.0,
    B=0.63,
    I=0.0137,
    G=10.0,
    snr=SNR,
    edge=0.024,
    width=0.024,
    rest=(0.0, 0.0),
    oversampling=OVERSAMPLING,
    reflex=(OMEGA, DAMPING, DELAY),
    voluntary=(0.0, 1.0),
):
    """A recording; K and G are numbers or functions of an array of times.

    `reflex`: rad/s, 1, s. `voluntary`: root mean square [N.m] and cut-off [Hz] of the subject's own
        torque.
    """
    rng = np.random.default_rng(seed)
    fine = oversampling * rate
    reference = pulse_steps(duration, fine, rng, edge, width, rest)
    w = 2 * np.pi * 30.0
    poles = [1.0, 2 * 0.7 * w, w * w]
    x, v, a = linear_system([[0, 0, w * w], [0, w * w, 0], [w * w, 0, 0]], poles, reference, fine)
    t = np.arange(len(x)) / fine
    omega, damping, delay = reflex
    stretch = np.interp(t - delay, t, np.maximum(v, 0.0), left=0.0)
    (muscle,) = linear_system([omega**2], [1.0, 2 * damping * omega, omega**2], stretch, fine)
    stiffness, gain = (value(t) if callable(value) else value for value in (K, G))
    torque = (
        I * a
        + B * v
        + stiffness * x
        + gain * muscle
        + voluntary_torque(*voluntary, len(x), fine, seed)
    )
    sos = signal.butter(4, 0.9 * rate / 2, fs=fine, output="sos")
    x, v, torque = (signal.sosfilt(sos, q)[::oversampling] for q in (x, v, torque))
    if snr:
        x = x + rng.normal(size=len(x)) * np.std(x) * 10 ** (-snr["position"] / 20)
        v = v + rng.normal(size=len(v)) * np.std(v) * 10 ** (-snr["velocity"] / 20)
        torque = torque + rng.normal(size=len(x)) * np.std(torque) * 10 ** (-snr["torque"] / 20)
    return Recording(rate, t[::oversampling], x, v, torque)
