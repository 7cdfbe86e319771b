"""An arc of the reflex: its delay, and the muscle as a low-pass of second order."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit


class TonicReflex(NamedTuple):
    """Holds a reflex to position, as late as the reflex to velocity.

    Attributes
    ----------
    gain
        [N.m/rad].
    onset
        Position from the mean beyond which it acts [rad].
    frequency
        [rad/s].
    """

    gain: float = 0.0
    onset: float = 0.0
    frequency: float = 20.0


class FurtherReflex(NamedTuple):
    """Holds a further reflex to velocity: a late one, or that of the antagonist.

    Attributes
    ----------
    gain
        [N.m.s/rad].
    delay
        [s].
    frequency
        [rad/s].
    """

    gain: float = 0.0
    delay: float = 0.09
    frequency: float = 25.0


@njit(cache=True)
def delay_line(delay: float, dt: float) -> np.ndarray:
    """Return an empty memory of what is on its way.

    Parameters
    ----------
    delay
        [s].
    dt
        Time step [s].
    """
    return np.zeros(round(delay / dt) + 1)


@njit(cache=True)
def arc_torque(
    line: np.ndarray,
    state: np.ndarray,
    step: int,
    drive: float,
    frequency: float,
    damping: float,
    dt: float,
) -> float:
    """Return the torque of the muscle, after taking drive and muscle one step on [N.m].

    Parameters
    ----------
    line
        From `delay_line`.
    state
        Torque [N.m] and its rate [N.m/s], shape (2,).
    step
        Number of the time step.
    drive
        Torque that the drive of this moment asks for [N.m].
    frequency, damping
        Of the muscle [rad/s], [1].
    dt
        Time step [s].
    """
    line[step % line.size] = drive
    delayed = line[(step + 1) % line.size]
    pull = frequency * frequency * (delayed - state[0])
    state[1] += dt * (pull - 2.0 * damping * frequency * state[1])
    state[0] += dt * state[1]
    return state[0]
