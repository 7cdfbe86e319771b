"""The emulated rig checks every command by itself, whatever the driver let through."""

import math

import pytest

from ankle_actuator_driver.safety.limits import Limits
from rig_emulator.command_check import command_passes_limit

INTERVAL = 1.0 / 2048.0
LIMITS = Limits()


def passes(position=0.0, velocity=0.0, acceleration=0.0, step=0.0, last_step=0.0):
    return command_passes_limit(
        (position, velocity, acceleration), step, last_step, INTERVAL, LIMITS
    )


def test_a_command_within_all_limits_passes_none():
    assert not passes()
    assert not passes(0.05, 1.0, 10.0, 1.0 * INTERVAL, 1.0 * INTERVAL)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(
    "command",
    [
        {"position": 1.01 * LIMITS.angle},
        {"velocity": 1.01 * LIMITS.velocity},
        {"acceleration": 1.01 * LIMITS.acceleration},
        {"step": 1.1 * LIMITS.velocity * INTERVAL, "last_step": 1.1 * LIMITS.velocity * INTERVAL},
        {"step": 0.0, "last_step": 2.0 * LIMITS.acceleration * INTERVAL**2},
        # No room is left to stop before the limit of the angle.
        {"position": 0.99 * LIMITS.angle, "velocity": 0.9 * LIMITS.velocity},
    ],
)
def test_each_limit_is_kept_on_both_sides(command, sign):
    assert passes(**{name: sign * value for name, value in command.items()})


@pytest.mark.parametrize("name", ["position", "velocity", "acceleration", "step", "last_step"])
def test_a_command_that_is_not_a_number_passes_a_limit(name):
    assert passes(**{name: math.nan})
