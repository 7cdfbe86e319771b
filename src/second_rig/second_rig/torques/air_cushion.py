"""A cushion of two chambers of air with a turbulent orifice, beside the joint."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

# Below this torque the flow is laminar [N.m]: a root alone has an infinite slope at rest.
LAMINAR_TORQUE = 1e-3


class AirCushion(NamedTuple):
    """Holds two chambers of air with a turbulent orifice beside the joint.

    Attributes
    ----------
    stiffness
        [N.m/rad].
    flow
        Through the orifice, per root of torque; 0 where there is no cushion.
    """

    stiffness: float = 1.0
    flow: float = 0.0


@njit(cache=True)
def air_cushion_torque(cushion: AirCushion, state: np.ndarray, position: float, dt: float) -> float:
    """Return the torque of the cushion, and take it one step on [N.m].

    Parameters
    ----------
    cushion
        Its numbers.
    state
        Position at which the air of both chambers is level [rad], shape (1,).
    position
        Of the foot [rad].
    dt
        Time step [s].
    """
    if cushion.flow <= 0.0:
        return 0.0
    torque = cushion.stiffness * (position - state[0])
    state[0] += dt * cushion.flow * torque / np.sqrt(abs(torque) + LAMINAR_TORQUE)
    return torque
