"""Settings of every perturbation signal: rate, amplitude, direction, seed, duration, edges."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from ankle_interfaces.ankle_range import PASSIVE_RANGE
from ankle_interfaces.quantity import Quantity
from perturbation_generator.edges import Polynomial, Shape

# Sides of the rest position (0 rad) on which a signal moves. Dorsiflexion is positive.
SIDES: dict[str, tuple[int, ...]] = {"dorsiflexing": (1,), "plantarflexing": (-1,), "both": (1, -1)}


@dataclass(frozen=True)
class Settings:
    """Holds the settings that every signal has.

    Attributes
    ----------
    rate
        Samples a second [Hz]. The signal as a function of time does not depend on it.
    amplitude
        Largest distance from the rest position [rad]. The position starts and ends at rest, 0 rad,
        and moves to one side of it (both sides with ``both``): starting, stopping and changing the
        amplitude then need no extra movement to a baseline, and rest is the position that the
        operator chose.
    direction
        ``dorsiflexing``, ``plantarflexing`` or ``both`` (random for each movement from rest).
    seed
        Of all random draws; the same seed gives the same signal.
    duration
        Length [s], at the end of which the signal is at rest; 0 is endless.
    ramp_in
        Time [s] over which the amplitude grows to its value.
    shape
        Of each edge; a signal without edges does not use it.

    Raises
    ------
    QuantityError
        A value outside the range of `COMMON_PARAMETERS`.
    """

    rate: float = 2048.0
    amplitude: float = 0.04
    direction: str = "dorsiflexing"
    seed: int = 1
    duration: float = 0.0
    ramp_in: float = 0.0
    shape: Shape = field(default_factory=Polynomial)

    def __post_init__(self) -> None:
        for parameter in COMMON_PARAMETERS:
            parameter.check(getattr(self, parameter.name))

    @property
    def sides(self) -> tuple[int, ...]:
        """Return the signs of the sides that the signal moves to: 1 dorsiflexion, -1
        plantarflexion.
        """
        return SIDES[self.direction]

    @property
    def end(self) -> float:
        """Return the duration [s], infinite when endless."""
        return self.duration if self.duration > 0 else math.inf

    @property
    def samples(self) -> int | None:
        """Return the number of samples in the whole signal, None when endless."""
        return round(self.duration * self.rate) if self.duration > 0 else None


COMMON_PARAMETERS = (
    Quantity(
        "rate",
        "Hz",
        500.0,
        10_000.0,
        Settings.rate,
        description="Samples a second (paper: 2048).",
        start_only=True,
    ),
    # What protects is 'amplitude_limit'.
    Quantity(
        "amplitude",
        "rad",
        0.0,
        PASSIVE_RANGE,
        Settings.amplitude,
        description="Largest distance from the rest position.",
    ),
    Quantity(
        "direction",
        default=Settings.direction,
        description="Side of the rest position to move to; both: at random.",
        choices=tuple(SIDES),
        start_only=True,
    ),
    Quantity(
        "seed",
        "1",
        0,
        2**31 - 1,
        Settings.seed,
        description="Seed of the random draws.",
        start_only=True,
    ),
    Quantity(
        "duration",
        "s",
        0.0,
        86_400.0,
        Settings.duration,
        description="Length, ending at rest; 0 is endless.",
        start_only=True,
    ),
    Quantity(
        "ramp_in",
        "s",
        0.0,
        60.0,
        Settings.ramp_in,
        description="Time over which the amplitude grows to its value.",
        start_only=True,
    ),
)
