"""Settings of the simultaneous estimator: every number with its unit, allowed range and reason."""

from __future__ import annotations

from dataclasses import dataclass

from ankle_interfaces.quantity import choice, number
from impedance_estimator.settings import EstimatorSettings
from impedance_estimator.simultaneous import reflex_shapes

CHANGE_DETECTION_CHOICES = ("on", "off")


@dataclass(frozen=True)
class SimultaneousSettings(EstimatorSettings):
    """Holds numbers of the simultaneous estimator.

    Raises
    ------
    QuantityError
        A value out of its range, with name, value, unit and range.
    """

    memory: float = number(
        10.0,
        "s",
        1.0,
        60.0,
        "It is the time that an estimate looks back. 10 s hold 15 perturbations: as precise as CE, "
        "and faster. It is shorter after changes and in drift.",
    )
    change_detection: str = choice(
        "on",
        CHANGE_DETECTION_CHOICES,
        "'on' forgets what was before a change, and remembers less in a drift; 'off' always uses "
        "the full memory, rise time 0.8 memory.",
    )
    change_threshold: float = number(
        200.0,
        "1",
        15.0,
        1000.0,
        "It is the likelihood ratio above which a change counts. Without a change the ratio stays "
        "below 30 in simulation. It stays below 200 on two real ankles, which are no perfect "
        "spring, damper and mass. At 100 one of them restarted its memory every second.",
    )
    rest_velocity: float = number(
        0.005,
        "rad/s",
        0.001,
        0.5,
        "It is the speed below which rectified velocity counts as zero. The default is three times "
        "the noise of the smoothed velocity, and 0.5 % of a perturbation's velocity.",
    )
    basis_functions: float = number(
        float(reflex_shapes.BASIS),
        "1",
        6.0,
        20.0,
        "It is the number of functions that make up the reflex response; reflex_shapes.BASIS says "
        "why.",
    )
    settling_time: float = number(
        10.0,
        "s",
        1.0,
        300.0,
        "It is the time with data before estimates are valid: about 15 perturbations.",
    )
