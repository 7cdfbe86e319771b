"""The plain joint of a subject, as it is drawn."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from second_rig.drawing import evenly, evenly_in_ratio
from second_rig.parameters import Parameters
from second_rig.servo import Servo
from second_rig.torques.elastic import Elastic
from second_rig.torques.reflex_drive import Reflex
from second_rig.torques.viscous import Damping

SHOWN_BY_REFLEX = frozenset(
    {
        "gain_drift",
        "reflex_threshold",
        "reflex_saturation",
        "late_reflex",
        "antagonist_reflex",
        "reflex_exponent",
        "reflex_fading",
        "spindle_slack",
        "reflex_contraction",
    }
)
"""Effects that show only in a subject with a strong reflex on a joint that is not very stiff."""
SHOWN_BY_DAMPING = frozenset({"damping_direction", "shear_thinning"})
"""Effects that show only in a subject with much damping."""
SHOWN_AT_ZERO_TORQUE = frozenset({"backlash"})
"""Effects that show only where the torque changes its sign: a foot under load stays on one side."""

# Slower movement is no stretch of its own [rad/s]: a servo settles with as much.
STRETCH_VELOCITY = 0.03
# Between two stretches [s]: a shorter one is a ripple of the same.
SHORTEST_INTERVAL_S = 0.03


class Subject(NamedTuple):
    """Holds the plain joint.

    Attributes
    ----------
    I, B, K, G
        [kg.m^2], [N.m.s/rad], [N.m/rad], [N.m.s/rad].
    delay, frequency, damping
        Of the reflex [s], [rad/s], [1].
    torque
        That is held in the mean [N.m].
    mean_position
        Of the reference, about which K is stated [rad].
    """

    I: float
    B: float
    K: float
    G: float
    delay: float
    frequency: float
    damping: float
    torque: float
    mean_position: float

    def parameters(self, servo: Servo) -> Parameters:
        """Return the numbers of the joint without any effect, on a rig.

        Parameters
        ----------
        servo
            Of the rig.
        """
        return Parameters(
            self.I,
            self.torque,
            Elastic(self.K, self.mean_position),
            Damping(self.B),
            Reflex(self.G, self.delay, self.frequency, self.damping),
            servo,
        )


def draw_subject(effects: Collection[str], generator: np.random.Generator) -> Subject:
    """Draw a subject whose reference has the mean zero.

    Parameters
    ----------
    effects
        Identifiers of what the recording hides.
    generator
        Draws the subject.
    """
    reflexive = bool(SHOWN_BY_REFLEX & set(effects))
    subject = Subject(
        I=evenly(generator, 0.008, 0.016),
        B=evenly(generator, 0.4, 1.3),
        K=evenly_in_ratio(generator, *((20.0, 90.0) if reflexive else (18.0, 140.0))),
        G=evenly_in_ratio(generator, *((6.0, 18.0) if reflexive else (2.5, 15.0))),
        delay=evenly(generator, 0.036, 0.049),
        frequency=evenly(generator, 34.0, 44.0),
        damping=evenly(generator, 0.75, 1.0),
        torque=evenly(generator, -2.0, 5.0),
        mean_position=0.0,
    )
    if SHOWN_AT_ZERO_TORQUE & set(effects):
        subject = subject._replace(torque=evenly(generator, -0.6, 0.6))
    if SHOWN_BY_DAMPING & set(effects):
        subject = subject._replace(B=evenly(generator, 0.9, 1.5))
    return subject


def stretch_factors(
    velocity: np.ndarray, time: np.ndarray, variation: float, generator: np.random.Generator
) -> np.ndarray:
    """Draw how strongly the reflex answers each stretch, in units of its mean [1], shape (n,).

    A stretch begins where the servo's own movement passes `STRETCH_VELOCITY`, so that the factors
    are the same with and without an effect.

    Parameters
    ----------
    velocity
        That the servo wants [rad/s], shape (n,).
    time
        Since the start [s], shape (n,).
    variation
        Standard deviation of the factors [1].
    generator
        Draws them.
    """
    begins = np.flatnonzero(np.diff((velocity > STRETCH_VELOCITY).astype(np.int8)) == 1) + 1
    kept, last = [], -1.0
    for place in begins:
        if time[place] - last > SHORTEST_INTERVAL_S:
            kept.append(int(place))
            last = time[place]
    factors = generator.gamma(1.0 / variation**2, variation**2, len(kept) + 1)
    counts = np.zeros(time.size, dtype=int)
    counts[kept] = 1
    return (factors / factors.mean())[np.cumsum(counts)]
