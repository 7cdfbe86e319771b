"""Viscous torque of the joint."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

# Over this velocity the damping goes over from one direction to the other [rad/s]. It is below any
# movement and keeps the torque smooth at rest.
TURNING_VELOCITY = 0.02


class Damping(NamedTuple):
    """Holds the viscous torque of the joint.

    Attributes
    ----------
    B
        [N.m.s/rad].
    direction
        Relative change of B in dorsiflexion; the opposite in plantarflexion [1].
    thinning
        With which B falls with speed [s/rad].
    """

    B: float
    direction: float = 0.0
    thinning: float = 0.0


@njit(cache=True)
def viscous_torque(damping: Damping, velocity: float) -> float:
    """Return the viscous torque [N.m].

    Parameters
    ----------
    damping
        Its numbers.
    velocity
        Of the foot [rad/s].
    """
    B = damping.B
    if damping.direction != 0.0:
        B *= 1.0 + damping.direction * np.tanh(velocity / TURNING_VELOCITY)
    if damping.thinning > 0.0:
        B /= 1.0 + abs(velocity) * damping.thinning
    return B * velocity
