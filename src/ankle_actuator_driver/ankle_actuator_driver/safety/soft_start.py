"""From where the plate is held to a reference that is already moving: ``x = x_held + w (x_reference
- x_held)``.

The weight w goes from 0 to 1 as ``10 s^3 - 15 s^4 + 6 s^5``, the minimum-jerk movement of Flash &
Hogan, J Neurosci 5:1688, 1985: velocity and acceleration begin and end at zero.
"""

from __future__ import annotations

import numpy as np


def blend(motion: np.ndarray, since: np.ndarray, duration: float, held: float) -> np.ndarray:
    """Return the motion with its soft start.

    Parameters
    ----------
    motion
        Position [rad], velocity [rad/s], acceleration [rad/s^2] of the reference, shape (n, 3).
    since
        Time since the begin of the start [s], shape (n,), not negative.
    duration
        Of the start [s].
    held
        Where the plate is held at its begin [rad].

    Returns
    -------
    np.ndarray
        Shape (n, 3).
    """
    s = np.minimum(since / duration, 1.0)
    weight = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    rate = 30.0 * s**2 * (1.0 - s) ** 2 / duration
    curve = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / duration**2
    away, velocity, acceleration = motion[:, 0] - held, motion[:, 1], motion[:, 2]
    return np.column_stack(
        [
            held + weight * away,
            weight * velocity + rate * away,
            weight * acceleration + 2.0 * rate * velocity + curve * away,
        ]
    )
