"""The rig's last look at a command before the servo gets it."""

from __future__ import annotations

import math

from ankle_actuator_driver.safety.limits import ROUNDING, STEP_MARGIN, Limits
from ankle_actuator_driver.safety.stop_motion import stopping_distance
from rig_emulator.reference_playback import Motion


def command_passes_limit(
    motion: Motion, step: float, last_step: float, interval: float, limits: Limits
) -> bool:
    """Return whether a command passes a limit, by itself or in the step from the one before.

    Parameters
    ----------
    motion
        Position [rad], velocity [rad/s] and acceleration [rad/s^2] of the command.
    step, last_step
        Change of the position from the command before [rad], and the change before that one.
    interval
        Time between two commands [s].
    limits
        Of the rig.
    """
    position, velocity, acceleration = motion
    end = position + math.copysign(stopping_distance(velocity, limits.acceleration), velocity)
    largest_step = min(limits.step, limits.velocity * interval * (1 + STEP_MARGIN))
    largest_change = limits.acceleration * interval**2 * (1 + STEP_MARGIN)
    # Written so that a command that is not a number passes a limit, too.
    return not (
        abs(end) <= limits.angle * (1 + ROUNDING)
        and abs(position) <= limits.angle * (1 + ROUNDING)
        and abs(velocity) <= limits.velocity * (1 + ROUNDING)
        and abs(acceleration) <= limits.acceleration * (1 + ROUNDING)
        and abs(step) <= largest_step
        and abs(step - last_step) <= largest_change
    )
