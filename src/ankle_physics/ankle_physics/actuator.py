"""The plate's true motion follows from the commanded reference.

The reference is interpolated to the internal rate and then passes the servo.

Interpolation: between two reference samples the fifth-order polynomial that meets position,
velocity and acceleration at both. Servo: ``y'' + 2 z w y' + w^2 y = w^2 x`` with w = 2 pi *
bandwidth, exact for a command that is linear between internal samples. Bandwidth 0 is the ideal
actuator: the plate follows the interpolated reference.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ankle_physics.errors import ModelError
from ankle_physics.linear_dynamics import SecondOrder
from ankle_physics.quintic import quintic_upsample

# Physics runs at a whole multiple of the sampling rate that reaches this: half-wave rectification
# and the delay are then good to 1e-4 of the torque, and the anti-alias filter has something to
# filter. 2048 Hz gives 4 x 2048 = 8192 Hz.
LOWEST_INTERNAL_RATE = 8000.0  # Hz
# At 10 kHz the whole multiple would be 1, which leaves no room above the Nyquist frequency of the
# samples.
LEAST_OVERSAMPLING = 2


def oversampling(rate: float) -> int:
    """Return internal samples for each sample at `rate` [Hz]."""
    return max(LEAST_OVERSAMPLING, math.ceil(LOWEST_INTERNAL_RATE / rate - 1e-9))


@dataclass(frozen=True)
class Servo:
    """Describes a second-order position servo.

    Attributes
    ----------
    bandwidth
        Undamped natural frequency [Hz]; at damping 0.707 also the -3 dB frequency. 0 is ideal.
        Default from van 't Veld et al. 2018, section II-B: the set-up did not achieve more than 30
        Hz.
    damping
        [1]; the paper gives none, 0.7 is the usual choice (overshoot 5 %).

    Raises
    ------
    ModelError
        Bandwidth not 0 and outside 1 to 500 Hz, or damping outside 0.1 to 5.
    """

    bandwidth: float = 30.0
    damping: float = 0.7

    def __post_init__(self) -> None:
        if self.bandwidth != 0.0 and not 1.0 <= self.bandwidth <= 500.0:
            raise ModelError(
                f"actuator bandwidth = {self.bandwidth:g} Hz is outside 1 to 500 Hz (0 for an "
                "ideal actuator)"
            )
        if not 0.1 <= self.damping <= 5.0:
            raise ModelError(f"actuator damping = {self.damping:g} is outside 0.1 to 5")

    @property
    def ideal(self) -> bool:
        """Tell whether the plate follows the reference exactly."""
        return self.bandwidth == 0.0


class Actuator:
    """Computes the plate's motion at the internal rate, stretch by stretch; the same whatever the
    size of the stretches.

    Before the first sample the plate rests at the first commanded position.

    Parameters
    ----------
    servo
        Dynamics of the servo.
    rate
        Of the reference [Hz].
    """

    def __init__(self, servo: Servo, rate: float) -> None:
        self.servo = servo
        self.factor = oversampling(rate)
        self._interval = 1.0 / rate
        self._last: np.ndarray | None = None
        self._dynamics = SecondOrder(rate * self.factor)

    def run(self, reference: np.ndarray) -> np.ndarray:
        """Return the true plate motion up to the time of the last reference sample.

        Parameters
        ----------
        reference
            Position [rad], velocity [rad/s], acceleration [rad/s^2], shape (n, 3); or position
            alone, shape (n, 1), which is then taken as linear between samples.

        Returns
        -------
        np.ndarray
            Position, velocity, acceleration, shape (3, n * factor); internal sample ``k * factor +
            factor - 1`` is at the time of reference sample k.

        Raises
        ------
        ModelError
            Position alone with an ideal actuator, whose velocity would not be defined.
        """
        motion = self.command(reference)
        if self.servo.ideal:
            return motion
        omega = 2.0 * math.pi * self.servo.bandwidth
        return self._dynamics.run_with_rates(motion[0], omega, self.servo.damping)

    def command(self, reference: np.ndarray) -> np.ndarray:
        """Return the interpolated reference that the servo is to follow; arguments and result as
        `run`.
        """
        if self._last is None:
            self._last = np.array([reference[0, 0], 0.0, 0.0])
            self._dynamics.settle(float(reference[0, 0]))
        if reference.shape[1] == 3:
            knots = np.concatenate([self._last[None, :], reference])
            motion = quintic_upsample(knots, self.factor, self._interval)
        else:
            motion = self._between_positions(reference[:, 0])
        self._last = np.zeros(3)
        self._last[: reference.shape[1]] = reference[-1]
        return motion

    def _between_positions(self, position: np.ndarray) -> np.ndarray:
        if self.servo.ideal:
            raise ModelError(
                "an ideal actuator needs a reference with velocity and acceleration; this one has "
                "position only"
            )
        assert self._last is not None
        knots = np.concatenate([self._last[:1], position])
        parts = np.arange(1, self.factor + 1) / self.factor
        motion = np.zeros((3, len(position) * self.factor))
        motion[0] = (knots[:-1, None] + np.diff(knots)[:, None] * parts).ravel()
        return motion
