"""Physics that no library of terms lists in this form."""

from __future__ import annotations

import numpy as np

from second_rig.drawing import evenly
from second_rig.effects.effect import Change, Effect
from second_rig.subject import Subject


def tremor_reset(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw a tremor that stretches set back; the strength is its torque [N.m].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    drawn = {
        "tremor.frequency": evenly(generator, 8.0, 10.5),
        "tremor.reset": evenly(generator, 40.0, 90.0),
        "tremor.decay_time": evenly(generator, 0.3, 0.8),
    }
    return Effect(
        "tremor whose phase each stretch resets and whose amplitude each stretch raises",
        "phi' = 2 pi f - kappa v+ sin(phi - 0.8) + noise; A' = (0.4 + 3 v+ - A)/tau; "
        "T += s A cos phi",
        lambda strength: Change(drawn | {"tremor.torque": strength}),
        0.2,
        0.02,
        0.8,
        drawn,
    )


def spindle_slack(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw spindles that shortening leaves slack; the strength is the share they lose [1].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    drawn = {
        "reflex.slack_time": evenly(generator, 0.8, 3.0),
        "reflex.slack_extension": evenly(generator, 0.004, 0.01),
    }
    return Effect(
        "spindle slack: shortening makes it, the stretch takes it up first, and time tightens it",
        "drive = v+ (1 - s (1 - exp(-L/s0))); L' = -v - L/tau, 0 <= L <= 0.05",
        lambda strength: Change(drawn | {"reflex.slack": strength}),
        0.5,
        0.1,
        1.0,
        drawn,
    )


def air_cushion(generator: np.random.Generator, subject: Subject, time: np.ndarray) -> Effect:
    """Draw a cushion with an orifice; the strength is the resistance of the orifice.

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    stiffness = subject.K * evenly(generator, 0.25, 0.6)
    return Effect(
        "air cushion with two chambers and a turbulent orifice beside the joint",
        "T += k (x - y); y' = c d/sqrt(|d| + 1e-3), d = k (x - y); strength = 1/c",
        lambda strength: Change(
            {"air_cushion.stiffness": stiffness, "air_cushion.flow": 1.0 / strength}
        ),
        8.0,
        1.0,
        200.0,
        {"k": stiffness},
    )


def reflex_contraction(
    generator: np.random.Generator, subject: Subject, time: np.ndarray
) -> Effect:
    """Draw a reflex whose contraction stiffens the joint; the strength is its share of K [1].

    Parameters
    ----------
    generator, subject, time
        As `effects.register.EFFECTS` says.
    """
    drawn = {
        "elastic.contraction_time": evenly(generator, 0.1, 0.25),
        "elastic.contraction_torque": evenly(generator, 0.8, 2.0),
    }
    return Effect(
        "the reflex' own contraction stiffens the joint",
        "T += K s Y/(Y + y0) x; Y' = (reflex torque - Y)/tau, Y > 0 only",
        lambda strength: Change(drawn | {"elastic.contraction_gain": strength}),
        0.5,
        0.05,
        1.5,
        drawn,
    )
