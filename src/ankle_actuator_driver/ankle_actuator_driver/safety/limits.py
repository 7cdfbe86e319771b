"""Limits that no reference passes: checked by the driver as the last place before the rig, and by
the rig once more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from ankle_actuator_driver.safety.interpolated_path import Path
from ankle_actuator_driver.safety.stop_motion import stopping_distance
from ankle_interfaces.ankle_range import PASSIVE_RANGE
from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Quantity, Value

ROUNDING = 1e-9
"""A value at its limit is allowed whatever the rounding."""
STEP_MARGIN = 0.02
"""Part by which differences of positions may pass the limits: the largest velocity can lie between
two samples."""

PATH_MARGIN = 1e-6
"""Part by which the path between samples may pass a limit: the rounding of its polynomials."""


@dataclass(frozen=True)
class Limits:
    """Holds the largest absolute values, with the reason of each default.

    Attributes
    ----------
    angle
        From the rest position [rad]. 0.175 rad (10 degrees): fast stretches of healthy ankles are 8
        degrees in Sinkjaer et al., J Neurophysiol 76:1112, 1996; the overshoot of a 30 Hz servo (5
        %) and a soft stop come on top. Half of the about 20 degrees of passive dorsiflexion of a
        healthy ankle.
    velocity
        [rad/s]. 5 rad/s (286 degrees/s): the fastest dorsiflexions of Cronin et al., J Physiol
        587:3375, 2009, were about 280 degrees/s; those of Sinkjaer et al. 250 degrees/s.
    acceleration
        [rad/s^2]. 2000: 27 N.m on the paper's 0.0137 kg.m^2 of foot and footplate; the paper's
        perturbation needs 400.
    torque
        [N.m], beyond which the plate yields. 30: the paper's perturbation of 0.04 rad gives 5 N.m
        of inertia, 2 of viscosity, 6 of a stiffness of 150 N.m/rad, 4 of reflexes and 5 of the
        target, and 30 is a quarter of the about 1.6 N.m/kg with which an adult's ankle pushes off
        in every step of walking (Winter, Biomechanics and Motor Control of Human Movement).
    step
        Between neighbouring samples, and from the held position to the first sample [rad]. 0.005:
        twice what 5 rad/s is at 2048 Hz.
    """

    angle: float = 0.175
    velocity: float = 5.0
    acceleration: float = 2000.0
    torque: float = 30.0
    step: float = 0.005

    def passed_by(
        self, motion: np.ndarray, interval: float, before: float | None = None
    ) -> str | None:
        """Return the limit that a stretch of reference passes, as a sentence with value and unit.

        It is None where the stretch keeps within all.

        The stated velocity and acceleration are checked, and those of the positions' differences
        too: a reference whose columns contradict each other is no less fast. A reference that
        moves outwards must leave room to stop.

        Parameters
        ----------
        motion
            Position [rad], velocity [rad/s], acceleration [rad/s^2], shape (n, 3), finite.
        interval
            Time between two samples [s].
        before
            Position one interval before the first sample [rad]; None where there is none.
        """
        if stated := self.stated_by(motion):
            return stated
        end = np.abs(
            motion[:, 0]
            + np.sign(motion[:, 1]) * stopping_distance(motion[:, 1], self.acceleration)
        ).max()
        if end > self.angle * (1 + ROUNDING):
            return f"a stop would end at {end:.4g} rad, beyond the limit of {self.angle:g} rad"
        return self._passed_by_steps(motion, interval, before)

    def stated_by(self, motion: np.ndarray) -> str | None:
        """Return the limit that the columns of a motion pass, as a sentence with value and unit.

        It is None where they keep within all.

        Parameters
        ----------
        motion
            Position [rad], velocity [rad/s], acceleration [rad/s^2], shape (n, 3), n of at least 1.
        """
        stated = np.abs(motion).max(axis=0)
        if stated[0] > self.angle * (1 + ROUNDING):
            return f"position of {stated[0]:.4g} rad passes the limit of {self.angle:g} rad"
        if stated[1] > self.velocity * (1 + ROUNDING):
            return f"velocity of {stated[1]:.4g} rad/s passes the limit of {self.velocity:g} rad/s"
        if stated[2] > self.acceleration * (1 + ROUNDING):
            return (
                f"acceleration of {stated[2]:.4g} rad/s^2 passes the limit of "
                f"{self.acceleration:g} rad/s^2"
            )
        return None

    def _passed_by_steps(
        self, motion: np.ndarray, interval: float, before: float | None
    ) -> str | None:
        """Return the limit that the differences of the positions pass."""
        position = motion[:, 0] if before is None else np.concatenate([[before], motion[:, 0]])
        steps = np.diff(position)
        if not len(steps):
            return None
        largest = float(np.abs(steps).max())
        if largest > self.step * (1 + ROUNDING):
            return (
                f"step of {largest:.4g} rad between samples passes the limit of {self.step:g} rad"
            )
        if largest > self.velocity * interval * (1 + STEP_MARGIN):
            return (
                f"positions that move at {largest / interval:.4g} rad/s pass the limit of "
                f"{self.velocity:g} rad/s"
            )
        if len(steps) > 1:
            sharpest = float(np.abs(np.diff(steps)).max()) / interval**2
            if sharpest > self.acceleration * (1 + STEP_MARGIN):
                return (
                    f"positions that accelerate at {sharpest:.4g} rad/s^2 pass the limit of "
                    f"{self.acceleration:g} rad/s^2"
                )
        return None

    def passed_on(self, path: Path) -> str | None:
        """Return the limit that the rig's path passes between the samples of a reference.

        It is None where the path keeps within all.

        Parameters
        ----------
        path
            Interpolated, as `interpolated_path.path_through` gives it.
        """
        slack = 1 + PATH_MARGIN
        position = float(np.abs(path.position).max())
        if position > self.angle * slack:
            return f"the path reaches {position:.4g} rad, beyond the limit of {self.angle:g} rad"
        velocity = float(np.abs(path.velocity).max())
        if velocity > self.velocity * slack:
            return (
                f"the path moves at {velocity:.4g} rad/s, beyond the limit of "
                f"{self.velocity:g} rad/s"
            )
        if path.largest_acceleration > self.acceleration * slack:
            return (
                f"the path accelerates at {path.largest_acceleration:.4g} rad/s^2, beyond the "
                f"limit of {self.acceleration:g} rad/s^2"
            )
        stops = path.position + np.sign(path.velocity) * stopping_distance(
            path.velocity, self.acceleration
        )
        end = float(np.abs(stops).max())
        if end > self.angle * slack:
            return f"a stop on the path would end at {end:.4g} rad, beyond {self.angle:g} rad"
        return None

    def require_within(self, hard: Limits) -> None:
        """Refuse limits that are beyond the hard ones.

        Raises
        ------
        QuantityError
            Names those that are beyond, with value, unit and hard limit.
        """
        passed = [
            f"'{parameter.name}' = {getattr(self, field.name):g} {parameter.unit} passes the hard "
            "limit of "
            f"{getattr(hard, field.name):g} {parameter.unit}"
            for field, parameter in zip(fields(self), LIMIT_PARAMETERS, strict=True)
            if getattr(self, field.name) > getattr(hard, field.name)
        ]
        if passed:
            raise QuantityError("; ".join(passed))


# Name, unit, largest hard limit that a laboratory can configure, what it is.
_KINDS = (
    (
        "angle",
        "rad",
        PASSIVE_RANGE,
        f"Largest distance of the reference from rest; {PASSIVE_RANGE:g} rad is the end of the "
        "passive range.",
    ),
    ("velocity", "rad/s", 10.0, "Largest velocity of the reference."),
    ("acceleration", "rad/s^2", 5000.0, "Largest acceleration of the reference."),
    ("torque", "N.m", 80.0, "Torque beyond which the plate yields."),
    ("step", "rad", 0.02, "Largest step between neighbouring samples of the reference."),
)
LEAST_LIMIT = 1e-3
"""Least value of a limit, in its unit: zero would have no meaning, as a stop needs some
acceleration."""
HARD_LIMIT_PARAMETERS = tuple(
    Quantity(
        f"hard_{name}_limit",
        unit,
        LEAST_LIMIT,
        most,
        getattr(Limits, name),
        description=f"{text} No other setting passes it.",
        start_only=True,
    )
    for name, unit, most, text in _KINDS
)
LIMIT_PARAMETERS = tuple(
    Quantity(
        f"{name}_limit",
        unit,
        LEAST_LIMIT,
        most,
        getattr(Limits, name),
        description=f"{text} At most 'hard_{name}_limit'.",
    )
    for name, unit, most, text in _KINDS
)


def limits_from(values: Mapping[str, Value]) -> Limits:
    """Return the limits that the values of `LIMIT_PARAMETERS` describe."""
    return Limits(*(float(values[parameter.name]) for parameter in LIMIT_PARAMETERS))


def hard_limits_from(values: Mapping[str, Value]) -> Limits:
    """Return the limits that the values of `HARD_LIMIT_PARAMETERS` describe."""
    return Limits(*(float(values[parameter.name]) for parameter in HARD_LIMIT_PARAMETERS))
