"""Limits of amplitude, velocity and acceleration that no signal may pass."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ankle_interfaces.ankle_range import PASSIVE_RANGE
from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Quantity, Value
from perturbation_generator.signal import Signal


class LimitError(QuantityError):
    """Reports a signal that would pass a limit. The message names value, unit and limit."""


@dataclass(frozen=True)
class Limits:
    """Holds the largest absolute position [rad], velocity [rad/s] and acceleration [rad/s^2].

    Defaults, with their reason:

    * 0.14 rad (8°): the fast ankle stretch of Sinkjær et al., J Neurophysiol 76:1112, 1996, in
      healthy subjects.
    * 5 rad/s (286°/s): the fastest dorsiflexions of Cronin et al., J Physiol 587:3375, 2009, in
      healthy subjects, were about 280°/s; those of Sinkjær et al. 250°/s.
    * 2000 rad/s²: with the paper's foot and footplate, 0.0137 kg·m², this is 27 N·m. The paper's
      signal needs 400 rad/s², a step of 0.04 rad filtered at the 30 Hz of its actuator 1420 rad/s².
    """

    amplitude: float = 0.14
    velocity: float = 5.0
    acceleration: float = 2000.0

    def check(self, signal: Signal, amplitude: float) -> None:
        """Refuse a signal that passes the limits at an amplitude [rad].

        Raises
        ------
        LimitError
            The signal passes a limit. All that it passes are named.
        """
        reach = signal.extremes(amplitude)
        passed = [
            f"{what} of {value:.4g} {unit} passes the limit of {limit:.4g} {unit} ('{name}')"
            for what, value, limit, unit, name in (
                ("amplitude", reach.position, self.amplitude, "rad", AMPLITUDE_LIMIT.name),
                ("velocity", reach.velocity, self.velocity, "rad/s", VELOCITY_LIMIT.name),
                (
                    "acceleration",
                    reach.acceleration,
                    self.acceleration,
                    "rad/s^2",
                    ACCELERATION_LIMIT.name,
                ),
            )
            # A value at its limit is allowed whatever the rounding.
            if not value <= limit * (1 + 1e-9)
        ]
        if passed:
            shape = signal.settings.shape
            hint = (
                " (a block moves by its whole step in one sample)" if shape.name == "block" else ""
            )
            raise LimitError(
                f"signal '{signal.name}', shape '{shape.name}', 'amplitude' {amplitude:g} rad: "
                f"{'; '.join(passed)}{hint}"
            )


AMPLITUDE_LIMIT = Quantity(
    "amplitude_limit",
    "rad",
    0.0,
    PASSIVE_RANGE,
    Limits.amplitude,
    description="Largest distance from rest, overshoot included.",
    start_only=True,
)
VELOCITY_LIMIT = Quantity(
    "velocity_limit",
    "rad/s",
    0.0,
    1e4,
    Limits.velocity,
    description="Largest velocity.",
    start_only=True,
)
ACCELERATION_LIMIT = Quantity(
    "acceleration_limit",
    "rad/s^2",
    0.0,
    1e8,
    Limits.acceleration,
    description="Largest acceleration.",
    start_only=True,
)
LIMIT_PARAMETERS = (AMPLITUDE_LIMIT, VELOCITY_LIMIT, ACCELERATION_LIMIT)


def limits_from(values: Mapping[str, Value]) -> Limits:
    """Return the limits that the values of `LIMIT_PARAMETERS` describe."""
    return Limits(*(float(values[parameter.name]) for parameter in LIMIT_PARAMETERS))
