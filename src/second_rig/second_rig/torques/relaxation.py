"""Three Maxwell arms beside the elasticity of the joint."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit


class Relaxation(NamedTuple):
    """Holds three Maxwell arms beside K.

    Attributes
    ----------
    stiffness_1, stiffness_2, stiffness_3
        [N.m/rad].
    time_1, time_2, time_3
        [s].
    """

    stiffness_1: float = 0.0
    stiffness_2: float = 0.0
    stiffness_3: float = 0.0
    time_1: float = 1.0
    time_2: float = 1.0
    time_3: float = 1.0


@njit(cache=True)
def relaxation_torque(
    relaxation: Relaxation, state: np.ndarray, position: float, dt: float
) -> float:
    """Return the torque of the arms, and take them one step on [N.m].

    Parameters
    ----------
    relaxation
        Its numbers.
    state
        Position to which each arm has relaxed [rad], shape (3,).
    position
        Of the foot [rad].
    dt
        Time step [s].
    """
    if relaxation.stiffness_1 <= 0.0:
        return 0.0
    torque = (
        relaxation.stiffness_1 * (position - state[0])
        + relaxation.stiffness_2 * (position - state[1])
        + relaxation.stiffness_3 * (position - state[2])
    )
    state[0] += dt * (position - state[0]) / relaxation.time_1
    state[1] += dt * (position - state[1]) / relaxation.time_2
    state[2] += dt * (position - state[2]) / relaxation.time_3
    return torque
