"""Friction of the joint: one bristle (LuGre), or springs with sliders (Iwan)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

# Sliders that let go one after the other: with eight the loop looks smooth at the noise of a
# torque sensor.
SLIDERS = 8
# Limit of the first slider and how much further each next one goes, in units of their mean: limits
# spread evenly over a factor of 15 hold no corner.
FIRST_LIMIT, LIMIT_STEP = 0.25, 0.5


class Friction(NamedTuple):
    """Holds the friction in the joint (LuGre).

    Attributes
    ----------
    torque
        Of sliding [N.m].
    breakaway_ratio
        Torque of sticking in that of sliding [1].
    bristle_travel
        Extension at which it slides [rad].
    stribeck_velocity
        [rad/s].
    """

    torque: float = 0.0
    breakaway_ratio: float = 1.0
    bristle_travel: float = 1e-3
    stribeck_velocity: float = 0.1


class SlipElements(NamedTuple):
    """Holds springs with sliders beside each other (Iwan).

    Attributes
    ----------
    torque
        At which all slide [N.m].
    stiffness
        Of all before the first slides, in units of that torque [1/rad].
    """

    torque: float = 0.0
    stiffness: float = 0.0


@njit(cache=True)
def friction_torque(friction: Friction, state: np.ndarray, velocity: float, dt: float) -> float:
    """Return the torque of the bristle, and take it one step on [N.m].

    Parameters
    ----------
    friction
        Its numbers.
    state
        Extension of the bristle [rad], shape (1,).
    velocity
        Of the foot [rad/s].
    dt
        Time step [s].
    """
    if friction.torque <= 0.0:
        return 0.0
    slowness = np.exp(-((velocity / friction.stribeck_velocity) ** 2))
    limit = friction.torque * (1.0 + (friction.breakaway_ratio - 1.0) * slowness)
    stiffness = friction.torque / friction.bristle_travel
    torque = stiffness * state[0]
    state[0] += dt * (velocity - stiffness * abs(velocity) / limit * state[0])
    return torque


@njit(cache=True)
def slip_torque(slip: SlipElements, state: np.ndarray, velocity: float, dt: float) -> float:
    """Return the torque of all springs with sliders, and take them one step on [N.m].

    Parameters
    ----------
    slip
        Their numbers.
    state
        Torque of each [N.m], shape (`SLIDERS`,).
    velocity
        Of the foot [rad/s].
    dt
        Time step [s].
    """
    if slip.torque <= 0.0:
        return 0.0
    torque = 0.0
    for j in range(SLIDERS):
        limit = slip.torque * (FIRST_LIMIT + LIMIT_STEP * j) / (2.0 * SLIDERS)
        loaded = state[j] + dt * velocity * slip.stiffness / SLIDERS * slip.torque
        state[j] = min(max(loaded, -limit), limit)
        torque += state[j]
    return torque
