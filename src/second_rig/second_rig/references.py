"""Reference movements of the plate: pulses and steps, binary sequences, noise and sines.

Each returns the reference about zero [rad], shape (n,), and the numbers that were drawn for it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, lfilter, max_len_seq, sosfiltfilt

from second_rig.drawing import evenly

Drawn = tuple[np.ndarray, dict[str, Any]]
# Noise is made at this rate and interpolated [Hz]: ten times its highest corner and more.
NOISE_RATE = 200.0
# Noise goes on behind the last sample, which no spline then ends at [s].
NOISE_MARGIN_S = 2.0
# A soft limit, in standard deviations: excursions stay within the range of a subject's ankle, and
# what lies within one deviation stays Gaussian.
SOFT_LIMIT = 2.2
# Order of the shift register of a binary sequence: 1023 clocks, longer than a recording.
REGISTER = 10


def levels_in_time(
    moments: Sequence[float], levels: Sequence[float], time: np.ndarray, edge: float
) -> np.ndarray:
    """Return a course that goes from level to level with half-cosine edges [rad], shape (n,).

    Parameters
    ----------
    moments
        From which on each level holds [s].
    levels
        [rad], of the same number; the first holds from the start.
    time
        Since the start [s], shape (n,).
    edge
        Length of an edge [s]; 0 for jumps.
    """
    dt = time[1] - time[0]
    jumps = np.zeros(time.size)
    steps = np.diff(np.asarray(levels, dtype=float))
    places = (np.asarray(moments[1:]) / dt).astype(int)
    inside = places < time.size
    np.add.at(jumps, places[inside], steps[inside])
    course = np.cumsum(jumps)
    if edge > dt:
        width = max(int(edge / dt), 1)
        weights = np.sin(np.linspace(0.0, np.pi, width + 2)[1:-1])
        course = lfilter(weights / weights.sum(), 1, course)
    return levels[0] + course


def pulses_and_steps(time: np.ndarray, generator: np.random.Generator) -> Drawn:
    """Draw pulses and steps of any size at any interval.

    Parameters
    ----------
    time
        Since the start [s], shape (n,).
    generator
        Draws it.
    """
    size = evenly(generator, 0.045, 0.085)
    edge = float(generator.choice([0.0, 0.015, 0.03]))
    moments, levels, base = [0.0], [0.0], 0.0
    now = evenly(generator, 0.3, 0.6)
    while now < time[-1]:
        if generator.random() < 0.5:
            height = evenly(generator, -0.5, 0.5) * size
            length = evenly(generator, 0.04, 0.15)
            moments += [now, now + length]
            levels += [float(np.clip(base + height, -0.5 * size, 0.5 * size)), base]
            now += length
        else:
            base = evenly(generator, -0.5, 0.5) * size
            moments.append(now)
            levels.append(base)
        now += evenly(generator, 0.2, 1.0)
    about = {"range_rad": size, "edge_s": edge, "interval_s": "uniform 0.2-1.0"}
    return levels_in_time(moments, levels, time, edge), about


def pulse_and_step(time: np.ndarray, generator: np.random.Generator) -> Drawn:
    """Draw pulses of one size between steps, as laboratories of reflexes use them.

    Parameters
    ----------
    time
        Since the start [s], shape (n,).
    generator
        Draws it.
    """
    pulse, steps = evenly(generator, 0.03, 0.04), evenly(generator, 0.025, 0.045)
    edge = float(generator.choice([0.0, 0.01, 0.02]))
    moments, levels, base, now = [0.0], [0.0], 0.0, 0.5
    hold = evenly(generator, 0.42, 0.5)
    while now < time[-1]:
        if generator.random() < 0.5:
            moments += [now, now + 0.04]
            levels += [base + pulse, base]
        else:
            if generator.random() < 0.7:
                base = steps * float(generator.choice([-0.5, 0.0, 0.5]))
            else:
                base = steps * evenly(generator, -0.5, 0.5)
            moments.append(now)
            levels.append(base)
        now += hold + evenly(generator, 0.0, 0.15)
    about = {"pulse_rad": pulse, "step_range_rad": steps, "edge_s": edge}
    return levels_in_time(moments, levels, time, edge), about


def binary_sequence(time: np.ndarray, generator: np.random.Generator) -> Drawn:
    """Draw a pseudo-random binary sequence of limited slope.

    Parameters
    ----------
    time
        Since the start [s], shape (n,).
    generator
        Draws it.
    """
    size, clock = evenly(generator, 0.03, 0.065), evenly(generator, 0.12, 0.25)
    slope = evenly(generator, 1.2, 3.0)
    state = generator.integers(0, 2, REGISTER)
    # A register of zeros stays one.
    state[3] = 1
    sequence = max_len_seq(REGISTER, state=state)[0]
    count = int(time[-1] / clock) + 2
    bits = np.resize(sequence, count)[np.minimum((time / clock).astype(int), count - 1)]
    jumping = (bits - 0.5) * size
    width = max(int(size / slope / (time[1] - time[0])), 1)
    smooth = lfilter(np.ones(width) / width, 1, jumping - jumping[0]) + jumping[0]
    return smooth, {"pp_rad": size, "clock_s": clock, "slew_rad_s": slope}


def gaussian_noise(time: np.ndarray, generator: np.random.Generator) -> Drawn:
    """Draw low-passed noise within a soft limit.

    Parameters
    ----------
    time
        Since the start [s], shape (n,).
    generator
        Draws it.
    """
    corner, size = evenly(generator, 5.0, 8.0), evenly(generator, 0.06, 0.09)
    count = int((time[-1] + NOISE_MARGIN_S) * NOISE_RATE)
    sections = butter(4, corner, fs=NOISE_RATE, output="sos")
    noise = sosfiltfilt(sections, generator.standard_normal(count))
    # 0.42/0.8 brings the soft limit to about the range asked for.
    noise = 0.42 * size * np.tanh(noise / noise.std() / SOFT_LIMIT) / 0.8
    course = CubicSpline(np.arange(count) / NOISE_RATE, noise)(time)
    return course, {"cutoff_hz": corner, "pp_rad": float(np.ptp(course))}


def sum_of_sines(time: np.ndarray, generator: np.random.Generator) -> Drawn:
    """Draw a sum of sines that weaken towards high frequencies.

    Parameters
    ----------
    time
        Since the start [s], shape (n,).
    generator
        Draws it.
    """
    count = int(generator.integers(8, 15))
    lowest, highest = evenly(generator, 0.1, 0.3), evenly(generator, 9.0, 14.0)
    frequencies = np.geomspace(lowest, highest, count) * generator.uniform(0.93, 1.07, count)
    amplitudes = 1.0 / (1.0 + (frequencies / evenly(generator, 2.0, 4.0)) ** 1.2)
    phases = generator.uniform(0.0, 2.0 * np.pi, count)
    course = np.zeros(time.size)
    for amplitude, frequency, phase in zip(amplitudes, frequencies, phases, strict=True):
        course += amplitude * np.sin(2.0 * np.pi * frequency * time + phase)
    size = evenly(generator, 0.06, 0.09)
    about = {"n_sines": count, "f_hz": [round(float(f), 4) for f in frequencies], "pp_rad": size}
    return course * size / np.ptp(course), about


REFERENCES: dict[str, Callable[[np.ndarray, np.random.Generator], Drawn]] = {
    "random pulses and steps": pulses_and_steps,
    "pulse-step": pulse_and_step,
    "prbs": binary_sequence,
    "gaussian noise": gaussian_noise,
    "sum of sines": sum_of_sines,
}
"""Every protocol by its name."""
