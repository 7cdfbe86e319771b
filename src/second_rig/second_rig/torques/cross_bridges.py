"""Short-range stiffness of a population of cross-bridges."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

# Share of bridges that stay attached through any stretch [1]: the mean extension of none is not
# defined.
LEAST_ATTACHED = 0.02


class CrossBridges(NamedTuple):
    """Holds a population of cross-bridges by two moments: how many and how far stretched.

    Attributes
    ----------
    stiffness
        With every bridge attached [N.m/rad].
    attachment, detachment
        Rates at rest [1/s].
    forced_detachment
        Rate that stretch adds at the critical extension [1/s].
    critical_extension
        [rad].
    """

    stiffness: float = 0.0
    attachment: float = 8.0
    detachment: float = 2.0
    forced_detachment: float = 50.0
    critical_extension: float = 0.01


@njit(cache=True)
def attached_at_rest(bridges: CrossBridges) -> float:
    """Return the share of bridges that are attached in a muscle at rest [1].

    Parameters
    ----------
    bridges
        Their numbers.
    """
    return bridges.attachment / (bridges.attachment + bridges.detachment)


@njit(cache=True)
def cross_bridge_torque(
    bridges: CrossBridges, state: np.ndarray, velocity: float, dt: float
) -> float:
    """Return the torque of the attached bridges, and take them one step on [N.m].

    Parameters
    ----------
    bridges
        Their numbers.
    state
        Share that is attached [1] and their mean extension [rad], shape (2,).
    velocity
        Of the foot [rad/s].
    dt
        Time step [s].
    """
    if bridges.stiffness <= 0.0:
        return 0.0
    attached, extension = state
    torque = bridges.stiffness * attached * extension
    stretched = extension / bridges.critical_extension
    leaving = bridges.detachment + bridges.forced_detachment * stretched**2
    arriving = bridges.attachment * (1.0 - attached)
    # New bridges are not stretched, so that they take the mean extension down.
    state[1] += dt * (velocity - extension * arriving / max(attached, LEAST_ATTACHED))
    state[0] = max(attached + dt * (arriving - leaving * attached), LEAST_ATTACHED)
    return torque
