"""What the spindles make of a stretch: threshold, power, saturation, fading and slack."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit


class Reflex(NamedTuple):
    """Holds the reflex to stretch velocity.

    Attributes
    ----------
    G
        [N.m.s/rad].
    delay
        [s].
    frequency, damping
        Of the muscle [rad/s], [1].
    threshold
        Velocity below which nothing is felt [rad/s].
    saturation
        Inverse of the velocity at which the drive levels off [s/rad].
    exponent
        Power of velocity [1].
    exponent_velocity
        At which that power changes nothing [rad/s].
    fading
        With which each stretch takes the drive down [1/rad].
    recovery_time
        [s].
    slack
        Share of the drive that a slack spindle loses at most [1].
    slack_time
        In which a spindle tightens [s].
    slack_extension
        Slack at which about two thirds of that share are lost [rad].
    largest_slack
        [rad].
    """

    G: float
    delay: float
    frequency: float
    damping: float
    threshold: float = 0.0
    saturation: float = 0.0
    exponent: float = 1.0
    exponent_velocity: float = 1.0
    fading: float = 0.0
    recovery_time: float = 1.0
    slack: float = 0.0
    slack_time: float = 1.0
    slack_extension: float = 0.005
    largest_slack: float = 0.05


@njit(cache=True)
def reflex_drive(reflex: Reflex, state: np.ndarray, velocity: float, dt: float) -> float:
    """Return the drive of the reflex, and take its memory one step on [rad/s].

    Parameters
    ----------
    reflex
        Its numbers.
    state
        Share of the drive that is recovered [1] and slack of the spindles [rad], shape (2,).
    velocity
        Of the foot [rad/s].
    dt
        Time step [s].
    """
    drive = max(velocity, 0.0)
    if reflex.threshold > 0.0:
        drive = max(drive - reflex.threshold, 0.0)
    if reflex.exponent != 1.0 and drive > 0.0:
        drive = reflex.exponent_velocity * (drive / reflex.exponent_velocity) ** reflex.exponent
    if reflex.saturation > 0.0:
        drive = (1.0 - np.exp(-reflex.saturation * drive)) / reflex.saturation
    if reflex.fading > 0.0:
        recovered = state[0]
        spent = reflex.fading * recovered * drive
        state[0] = max(recovered + dt * ((1.0 - recovered) / reflex.recovery_time - spent), 0.0)
        drive *= recovered
    if reflex.slack > 0.0:
        slack = state[1]
        drive *= 1.0 - reflex.slack * (1.0 - np.exp(-slack / reflex.slack_extension))
        # Shortening leaves slack, stretch takes it up, and rest tightens the spindle.
        slack += dt * (-velocity - slack / reflex.slack_time)
        state[1] = min(max(slack, 0.0), reflex.largest_slack)
    return drive
