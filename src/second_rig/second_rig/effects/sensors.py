"""What the torque channel may do to the torque."""

from __future__ import annotations

import numpy as np
from scipy.signal import bilinear, lfilter, lfilter_zi

from second_rig.drawing import evenly
from second_rig.effects.effect import Change, Effect
from second_rig.subject import Subject


def sensor_resonance(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw a sensor that resonates; the strength is its inverse natural frequency [s/rad].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    damping = evenly(generator, 0.25, 0.6)

    def change(strength: float) -> Change:
        def sensed(torque: np.ndarray, dt: float) -> np.ndarray:
            squared = strength**-2
            b, a = bilinear([squared], [1.0, 2.0 * damping / strength, squared], 1.0 / dt)
            return lfilter(b, a, torque, zi=lfilter_zi(b, a) * torque[0])[0]

        return Change(sensor=sensed)

    return Effect(
        "torque sensor of limited bandwidth with resonance",
        "T_rec = wn^2/(s^2 + 2 zeta wn s + wn^2) T, wn = 1/strength",
        change,
        1 / 500.0,
        1 / 1500.0,
        1 / 220.0,
        {"zeta": damping},
    )


def late_torque(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw a torque channel that is late; the strength is by how much [s].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """

    def change(strength: float) -> Change:
        def sensed(torque: np.ndarray, dt: float) -> np.ndarray:
            places = np.arange(torque.size)
            return np.interp(places - strength / dt, places, torque)

        return Change(sensor=sensed)

    return Effect("torque channel late", "T_rec(t) = T(t - s)", change, 0.002, 0.001, 0.004)


def mains_hum(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw pick-up from the mains; the strength is its amplitude [N.m].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    phase = evenly(generator, 0.0, 2.0 * np.pi)
    frequency = 50.0 + evenly(generator, -0.04, 0.04)
    third = evenly(generator, 0.2, 0.5)

    def change(strength: float) -> Change:
        def sensed(torque: np.ndarray, dt: float) -> np.ndarray:
            angle = 2.0 * np.pi * frequency * np.arange(torque.size) * dt + phase
            harmonic = np.sin(3.0 * angle - phase)
            return torque + strength * (np.sin(angle) + third * harmonic)

        return Change(sensor=sensed)

    return Effect(
        "mains hum in the torque",
        "T_rec = T + A (sin 2 pi f0 t + h sin 3 2 pi f0 t)",
        change,
        0.3,
        0.02,
        1.0,
        {"f0": frequency, "h": third},
    )


def unequal_gain(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw a sensor with another gain for positive load; the strength is how much more [1].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """

    def change(strength: float) -> Change:
        def sensed(torque: np.ndarray, dt: float) -> np.ndarray:
            return torque * (1.0 + strength * (torque > 0.0))

        return Change(sensor=sensed)

    return Effect(
        "torque sensor has a larger gain for positive load",
        "T_rec = T (1 + s (T > 0))",
        change,
        0.06,
        0.01,
        0.12,
    )
