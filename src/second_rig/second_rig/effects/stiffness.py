"""How the stiffness of the joint may change: with position, in time, or by co-contraction."""

from __future__ import annotations

import numpy as np

from second_rig.drawing import either_sign, evenly
from second_rig.effects.effect import Change, Effect
from second_rig.subject import Subject
from second_rig.voluntary_torque import bouts


def stiffness_rise(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw a stiffness that rises with dorsiflexion; the strength is its relative rise [1/rad].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    return Effect(
        "stiffness rises with dorsiflexion (exponential)",
        "T = K (exp(c x) - 1)/c, x about the mean of the reference",
        lambda strength: Change({"elastic.rise": strength}),
        8.0,
        1.0,
        20.0,
    )


def hardening(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw a stiffness that hardens on both sides; the strength is the cubic term [1/rad^2].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    return Effect(
        "stiffness hardens on both sides",
        "T = K (x + c x^3), x about the mean of the reference",
        lambda strength: Change({"elastic.hardening": strength}),
        200.0,
        20.0,
        900.0,
    )


def stiffness_drift(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw a stiffness that drifts; the strength is the change of K over the recording [1].

    K is that of the subject in the middle of the recording.

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    slowness, sign = evenly(generator, 25.0, 70.0), either_sign(generator)
    course = np.exp(-np.maximum(time, 0.0) / slowness) - np.exp(-0.5 * time[-1] / slowness)
    course = sign * course / np.ptp(course)
    return Effect(
        "stiffness drifts (fatigue or creep); in the middle K is that of the subject",
        "K(t) = K (1 + s g(t)), g exponential with tau, range 1, zero in the middle",
        lambda strength: Change(stiffness=1.0 + strength * course),
        0.3,
        0.05,
        0.55,
        {"tau": slowness, "sign": sign},
    )


def cocontraction(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw co-contraction in bouts; the strength is what full activation adds to K [1].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    activation = bouts(time - time[0], generator)
    torque = evenly(generator, 0.2, 0.8) * either_sign(generator)
    return Effect(
        "voluntary co-contraction in bouts",
        "K(t) = K (1 + s a(t)), T0(t) = T0 + dT s a(t); a(t) smooth bouts 0 to 1 of 3 to 9 s",
        lambda strength: Change(
            stiffness=1.0 + strength * activation, torque=torque * strength * activation
        ),
        0.3,
        0.05,
        0.7,
        {"dT": torque},
    )
