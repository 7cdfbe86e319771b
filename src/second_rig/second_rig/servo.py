"""The servo: how the movement that it wants follows the reference, and how the plate gives way."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit


class Servo(NamedTuple):
    """Holds the servo that moves the plate.

    Attributes
    ----------
    rigid
        1 where the plate moves as the servo is asked to, 0 where torque makes it give way [1].
    stiffness, damping
        Between the reference movement and the plate [N.m/rad], [N.m.s/rad].
    motor_inertia
        [kg.m^2].
    """

    rigid: float = 1.0
    stiffness: float = 1.0
    damping: float = 0.0
    motor_inertia: float = 0.0


@njit(cache=True)
def servo_response(
    reference: np.ndarray, dt: float, frequency: float, damping: float, lag: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the movement that a servo of second or third order makes of a reference.

    Parameters
    ----------
    reference
        [rad], shape (n,).
    dt
        Time step [s].
    frequency, damping
        Of the second order [rad/s], [1].
    lag
        Corner of the first order before it [rad/s]; 0 for a servo of second order.

    Returns
    -------
        Position [rad], velocity [rad/s] and acceleration [rad/s^2], each of shape (n,).
    """
    n = reference.size
    position, velocity, acceleration = np.empty(n), np.empty(n), np.empty(n)
    x = reference[0]
    v = 0.0
    y = reference[0]
    for i in range(n):
        if lag > 0.0:
            y += dt * lag * (reference[i] - y)
        else:
            y = reference[i]
        a = frequency * frequency * (y - x) - 2.0 * damping * frequency * v
        position[i] = x
        velocity[i] = v
        acceleration[i] = a
        v += dt * a
        x += dt * v
    return position, velocity, acceleration
