"""How the reflex may differ from a gain on stretch velocity, and which arcs may be beside it."""

from __future__ import annotations

import numpy as np
from scipy.special import expit

from second_rig.drawing import either_sign, evenly
from second_rig.effects.effect import Change, Effect
from second_rig.subject import Subject


def gain_drift(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw a gain that drifts about its mean; the strength is the change of a whole step [1].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    middle = evenly(generator, 1.0 / 3.0, 2.0 / 3.0) * time[-1]
    slowness, sign = evenly(generator, 8.0, 18.0), either_sign(generator)
    step = expit((time - middle) / slowness)
    course = sign * (step - step.mean())
    return Effect(
        "reflex gain drifts (learning or arousal), its mean in time that of the subject",
        "G(t) = G (1 + s (logistic((t - c)/w) - mean))",
        lambda strength: Change(reflex=1.0 + strength * course),
        0.5,
        0.1,
        0.8,
        {"c": middle, "w": slowness, "sign": sign},
    )


def reflex_threshold(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw a threshold; the strength is the velocity below which nothing is felt [rad/s].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    return Effect(
        "reflex has a velocity threshold",
        "drive = max(v - vth, 0)",
        lambda strength: Change({"reflex.threshold": strength}),
        0.15,
        0.01,
        0.9,
    )


def reflex_saturation(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw a saturation; the strength is the inverse of its velocity [s/rad].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    return Effect(
        "reflex saturates with velocity",
        "drive = vs (1 - exp(-v/vs)); strength = 1/vs",
        lambda strength: Change({"reflex.saturation": strength}),
        0.5,
        0.05,
        3.0,
    )


def reflex_exponent(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw a power of velocity; the strength is 1 minus the exponent [1].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    velocity = evenly(generator, 0.25, 0.8)
    return Effect(
        "reflex follows a power of velocity",
        "drive = vr (v/vr)^n, n = 1 - strength",
        lambda strength: Change(
            {"reflex.exponent": 1.0 - strength, "reflex.exponent_velocity": velocity}
        ),
        0.3,
        0.05,
        0.7,
        {"vr": velocity},
    )


def reflex_fading(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw a reflex that fades upon repetition; the strength is how fast with stretch [1/rad].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    recovery = evenly(generator, 0.5, 2.0)
    return Effect(
        "reflex fades upon repetition and recovers",
        "drive = v+ R; R' = (1 - R)/tau - u R v+",
        lambda strength: Change({"reflex.fading": strength, "reflex.recovery_time": recovery}),
        2.0,
        0.2,
        30.0,
        {"tau": recovery},
    )


def tonic_reflex(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw a reflex to position; the strength is its gain in units of K [1].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    onset, frequency = evenly(generator, -0.012, 0.0), evenly(generator, 15.0, 30.0)
    drawn = {"tonic_reflex.onset": onset, "tonic_reflex.frequency": frequency}
    return Effect(
        "tonic stretch reflex to position",
        "delayed as the reflex, critically damped low-pass w, of kt max(x - x0, 0)",
        lambda strength: Change(drawn | {"tonic_reflex.gain": strength * subject.K}),
        0.2,
        0.02,
        0.9,
        {"x0": onset, "w": frequency},
    )


def late_reflex(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw a long-latency reflex to velocity; the strength is its gain in units of G [1].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    delay, frequency = evenly(generator, 0.082, 0.098), evenly(generator, 22.0, 35.0)
    drawn = {"late_reflex.delay": delay, "late_reflex.frequency": frequency}
    return Effect(
        "additional long-latency reflex to stretch velocity",
        "delayed, critically damped low-pass w, of g v+",
        lambda strength: Change(drawn | {"late_reflex.gain": strength * subject.G}),
        0.25,
        0.03,
        0.9,
        {"delay": delay, "w": frequency},
    )


def antagonist_reflex(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw a reflex of the antagonist to velocity; the strength is its gain in units of G [1].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    delay, frequency = evenly(generator, 0.038, 0.055), evenly(generator, 32.0, 45.0)
    drawn = {"antagonist_reflex.delay": delay, "antagonist_reflex.frequency": frequency}
    return Effect(
        "antagonist reflex to plantarflexion velocity",
        "T -= delayed, critically damped low-pass w, of ga max(-v, 0)",
        lambda strength: Change(drawn | {"antagonist_reflex.gain": strength * subject.G}),
        0.25,
        0.03,
        0.9,
        {"delay": delay, "w": frequency},
    )
