"""The course of a bearing's dry friction while a plate moves and rests."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

# Below, the measured velocity is noise, and the plate rests; a slow sweep has 0.03 rad/s.
RESTING_VELOCITY = 0.008  # rad/s


@dataclass(frozen=True)
class Friction:
    """Describes the course of a bearing's dry friction.

    Attributes
    ----------
    rounding
        v0 [rad/s], the velocity that rounds its jump at rest. Unless it is known: sharp beside the
        speed of the sweeps.
    relaxation
        Time in which a plate at rest loses its torque [s].
    """

    rounding: float = 0.01
    relaxation: float = 0.05

    def course(self, velocity: np.ndarray, rate: float) -> np.ndarray:
        """Return the friction of each sample of the velocity [rad/s], as a part of its largest,
        shape (n,), at a rate [Hz].
        """
        return np.asarray(
            friction_of(velocity, self.rounding, math.exp(-1.0 / (self.relaxation * rate)))
        )


@njit(cache=True)
def friction_of(velocity: np.ndarray, rounding: float, decay: float) -> np.ndarray:
    """Return the friction of a bearing for each sample, as a part of its largest, shape (n,).

    It is tanh(v / v0) while the plate moves. Behind a movement it stays, and relaxes: a bearing
    that sticks keeps its torque, one that creeps loses it.

    Parameters
    ----------
    velocity
        [rad/s], shape (n,).
    rounding
        v0 [rad/s].
    decay
        Factor of what is left of the torque from one sample to the next.
    """
    out = np.empty_like(velocity)
    torque = 0.0
    for k in range(len(velocity)):
        moving = abs(velocity[k]) > RESTING_VELOCITY
        torque = math.tanh(velocity[k] / rounding) if moving else torque * decay
        out[k] = torque
    return out
