"""Settings of the joint estimator: every number with its unit, allowed range and reason."""

from __future__ import annotations

from dataclasses import dataclass

from impedance_estimator.settings import Settings, _choice, _number

CHANGE_DETECTION_CHOICES = ("on", "off")


@dataclass(frozen=True)
class JointSettings(Settings):
    """Numbers of the joint estimator.

    Raises:
        ValueError: a value out of its range, with name, value, unit and range.
    """

    memory: float = _number(20.0, "s", 1.0, 60.0, "Longest memory: a third of the paper's hold period of 60 s. Shorter only after a change.")
    change_detection: str = _choice(
        "on", CHANGE_DETECTION_CHOICES, "'on' forgets what was before a change; 'off' always uses the full memory, rise time 0.8 memory."
    )
    change_threshold: float = _number(
        40.0, "1", 15.0, 500.0, "Of the likelihood ratio, 4 degrees of freedom: chance 4e-8 per test, about 50 independent tests in 10 s."
    )
    rest_velocity: float = _number(
        0.01, "rad/s", 0.001, 0.5, "Below, rectified velocity counts as zero: five times the noise of the smoothed velocity; 1 % of a perturbation's."
    )
    settling_time: float = _number(10.0, "s", 1.0, 300.0, "Time with data before estimates are valid: about 15 perturbations.")

