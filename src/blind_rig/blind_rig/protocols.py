"""Perturbations of the laboratory: equal pulses and steps, equal steps both ways, random levels;
and two that other laboratories use, a random binary sequence and a multisine.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

PROTOCOLS = ("pulse_step", "equal_steps", "random_levels")
# The sizes of effects (`magnitudes`) were found with those above.
EVERY_PROTOCOL = (*PROTOCOLS, "binary", "multisine")
# A random binary sequence keeps a level for this time or a multiple of it [s] (Kearney, Stein &
# Parameswaran 1997, IEEE Trans. Biomed. Eng. 44, 493, section III: 150 to 200 ms).
BINARY_CLOCK = 0.2
# A multisine of the same velocity at each frequency, up to what ankle rigs follow [Hz].
MULTISINE_HZ = (0.5, 12.0)
MULTISINE_PERIOD = 20.0  # s
# Its movements have no beginning; the subject varies at these intervals [s] instead.
MULTISINE_ONSETS = 0.35
# Of the highest speed, at which a movement begins.
MOVING_SHARE = 0.15


class Protocol(NamedTuple):
    """Describes a perturbation as it is commanded.

    Attributes
    ----------
    kind
        One of `EVERY_PROTOCOL`.
    amplitude
        Size of a step [rad]; of the largest one among random levels.
    rise
        Duration of an edge [s].
    duration
        [s].
    """

    kind: str
    amplitude: float
    rise: float
    duration: float


def draw_protocol(generator: np.random.Generator, kinds: Sequence[str] = PROTOCOLS) -> Protocol:
    """Return the kind (one of `kinds`), size, edge and duration.

    As in the paper and in recorded human trials (steps of up to 30 mrad, edges of 11 to 24 ms).
    """
    kind = str(generator.choice(list(kinds)))
    amplitude = {
        "pulse_step": generator.uniform(0.03, 0.05),
        "equal_steps": generator.uniform(0.02, 0.04),
        "random_levels": generator.uniform(0.028, 0.045),
    }[kind]
    rise = generator.uniform(0.011, 0.024) if kind == "random_levels" else 0.024
    return Protocol(
        kind, float(amplitude), float(rise), float(round(generator.uniform(60.0, 120.0)))
    )


def edge(phase: np.ndarray) -> np.ndarray:
    """Return 5th-order polynomial from 0 to 1 over phase 0 to 1, without velocity and acceleration
    at its ends.
    """
    p = np.clip(phase, 0.0, 1.0)
    return p**3 * (10.0 - 15.0 * p + 6.0 * p**2)


def levels(protocol: Protocol, generator: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return times [s] at which edges start and the levels [rad] that they lead to, over the
    protocol's duration.
    """
    times: list[float] = []
    targets: list[float] = []
    now, level = 0.5, 0.0
    while now < protocol.duration:
        if protocol.kind == "pulse_step":
            # Paper, section II-B: a pulse (short up, long down) or a step (long up, short down),
            # the long part stretched at random.
            brief, long = protocol.rise, 0.5 - protocol.rise + generator.uniform(0.0, 0.2)
            up, down = (brief, long) if generator.random() < 0.5 else (long, brief)
            times += [now, now + up]
            targets += [protocol.amplitude, 0.0]
            now += up + down
            continue
        times.append(now)
        if protocol.kind == "equal_steps":
            choices = [
                s
                for s in (-protocol.amplitude, 0.0, protocol.amplitude)
                if abs(s - level) > 0 and abs(s - level) < 1.5 * protocol.amplitude
            ]
            level = float(generator.choice(choices))
            now += generator.uniform(0.25, 0.6)
        elif protocol.kind == "binary":
            level = protocol.amplitude - level
            now += BINARY_CLOCK * generator.geometric(0.5)
        else:
            level = float(generator.uniform(-protocol.amplitude / 2, protocol.amplitude / 2))
            now += generator.uniform(0.2, 0.476)
        targets.append(level)
    return np.array(times), np.array(targets)


def multisine(protocol: Protocol, generator: np.random.Generator, t: np.ndarray) -> np.ndarray:
    """Return a sum of sines of random phases and equal velocities [rad], shape (n,), whose largest
    angle is half the protocol's amplitude, as that of random levels.

    Parameters
    ----------
    protocol
        Whose amplitude counts.
    generator
        Of the phases.
    t
        Times [s], shape (n,).
    """
    first, last = (round(f * MULTISINE_PERIOD) for f in MULTISINE_HZ)
    harmonics = np.arange(first, last + 1)
    phases = generator.uniform(0.0, 2.0 * np.pi, len(harmonics))
    angle = np.zeros(len(t))
    for k, phase in zip(harmonics, phases, strict=True):
        angle += np.sin(2.0 * np.pi * k / MULTISINE_PERIOD * t + phase) / k
    begin = edge(t / 0.5)  # the plate begins at rest
    return begin * angle * (0.5 * protocol.amplitude / np.max(np.abs(angle)))


def command(
    protocol: Protocol, generator: np.random.Generator, rate: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the commanded angle around the operating point [rad], shape (n,), and the times of the
    edges' starts [s].
    """
    t = np.arange(round(protocol.duration * rate)) / rate
    if protocol.kind == "multisine":
        return multisine(protocol, generator, t), np.arange(
            0.5, protocol.duration, MULTISINE_ONSETS
        )
    times, targets = levels(protocol, generator)
    angle = np.zeros(len(t))
    before = 0.0
    for start, target in zip(times, targets, strict=True):
        first = int(np.ceil(start * rate))
        last = min(int(np.ceil((start + protocol.rise) * rate)) + 1, len(t))
        angle[first:last] = before + (target - before) * edge(
            (t[first:last] - start) / protocol.rise
        )
        angle[last:] = target
        before = target
    return angle, times[times < protocol.duration]


def onset_times(velocity: np.ndarray, rate: float) -> np.ndarray:
    """Return the times at which movements begin [s].

    Parameters
    ----------
    velocity
        Of the plate [rad/s], shape (n,).
    rate
        Samples per second [Hz].
    """
    speed = np.abs(velocity)
    begins = np.diff((speed > MOVING_SHARE * speed.max()).astype(int)) == 1
    return np.flatnonzero(begins) / rate
