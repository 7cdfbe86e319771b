"""Tremor as an oscillator that a stretch sets back and excites."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

# Phase to which a stretch pulls the oscillator [rad]: shortly behind the peak of torque.
PHASE_AFTER_STRETCH = 0.8
# Arousal without movement, and what a stretch adds in its steady state [1], [s/rad]. Tremor is
# then seen at rest, and several times larger behind a fast stretch.
AROUSAL_AT_REST, AROUSAL_BY_STRETCH = 0.4, 3.0


class Tremor(NamedTuple):
    """Holds an oscillator whose phase a stretch resets.

    Attributes
    ----------
    torque
        Amplitude at unit arousal [N.m].
    frequency
        [Hz].
    reset
        Phase that a stretch moves [rad/rad].
    decay_time
        Of its amplitude [s].
    """

    torque: float = 0.0
    frequency: float = 9.0
    reset: float = 0.0
    decay_time: float = 1.0


@njit(cache=True)
def tremor_torque(
    tremor: Tremor, state: np.ndarray, stretch: float, noise: float, dt: float
) -> float:
    """Return the torque of the tremor, and take the oscillator one step on [N.m].

    Parameters
    ----------
    tremor
        Its numbers.
    state
        Phase [rad] and arousal [1], shape (2,).
    stretch
        Velocity of stretch, never negative [rad/s].
    noise
        That moves the phase in this step [rad].
    dt
        Time step [s].
    """
    if tremor.torque <= 0.0:
        return 0.0
    phase, arousal = state
    pulled = tremor.reset * stretch * np.sin(phase - PHASE_AFTER_STRETCH)
    state[0] += dt * (2.0 * np.pi * tremor.frequency - pulled) + noise
    at_which_it_settles = AROUSAL_AT_REST + AROUSAL_BY_STRETCH * stretch
    state[1] += dt * (at_which_it_settles - arousal) / tremor.decay_time
    return tremor.torque * arousal * np.cos(phase)
