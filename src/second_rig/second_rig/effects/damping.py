"""How the damping of the joint may change: with direction or with speed."""

from __future__ import annotations

import numpy as np

from second_rig.drawing import either_sign
from second_rig.effects.effect import Change, Effect
from second_rig.subject import Subject


def damping_direction(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw a damping that differs with direction; the strength is its relative change [1].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    sign = either_sign(generator)
    return Effect(
        "damping differs with direction",
        "T_B = B (1 + d tanh(v/0.02)) v",
        lambda strength: Change({"damping.direction": sign * strength}),
        0.5,
        0.1,
        0.75,
        {"sign": sign},
    )


def shear_thinning(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw a damping that falls with speed; the strength is how fast [s/rad].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    return Effect(
        "damping falls with speed (shear-thinning)",
        "T_B = B v/(1 + c |v|)",
        lambda strength: Change({"damping.thinning": strength}),
        0.6,
        0.05,
        4.0,
    )
