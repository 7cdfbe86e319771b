"""Where the cursor is, and where it is wanted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from ankle_node.session_event import TORQUE_TARGET
from biofeedback.errors import CommandError
from biofeedback.session.axis_calibration import Baseline
from biofeedback.session.conditioning import Conditioning, Response
from biofeedback.session.protocol import UNITS, Protocol, Step


@dataclass(frozen=True)
class Reading:
    """Holds the values that the screen shows at one moment.

    Attributes
    ----------
    K, G
        Newest estimates [N.m/rad], [N.m.s/rad].
    torque
        The subject's torque [N.m] beside the baseline's.
    valid
        Whether the estimates are valid and no older than the screen allows.
    activity
        Of the muscle of a conditioning course [MVC].
    responses
        To perturbations, since the reading before.
    """

    K: float
    G: float
    torque: float
    valid: bool
    activity: float = math.nan
    responses: tuple[Response, ...] = ()


@dataclass(frozen=True)
class Target:
    """Describes the place where the cursor is wanted.

    Attributes
    ----------
    feedback
        ``K`` or ``G``, on the x-axis; ``reflex`` in a conditioning course of the EMG reflex.
    torque
        [N.m], y-axis.
    torque_half_width
        Of the band about it [N.m].
    lower, upper
        Region of the feedback in its unit; None where there is none.
    """

    feedback: str
    torque: float
    torque_half_width: float
    lower: float | None
    upper: float | None

    def reached(self, reading: Reading) -> bool:
        """Return whether a reading lies in band and region."""
        value = reading.K if self.feedback == "K" else reading.G
        within = self.lower is None or self.upper is None or self.lower <= value <= self.upper
        return (
            reading.valid and within and abs(reading.torque - self.torque) <= self.torque_half_width
        )

    def changed(self, values: Mapping[str, Any]) -> Target:
        """Return the target with other values; another feedback takes no region along.

        Parameters
        ----------
        values
            New values for fields of the target.

        Raises
        ------
        CommandError
            A region whose lower end is not below the upper one.
        """
        wanted = replace(self, **values)
        if wanted.feedback != self.feedback and not {"lower", "upper"} & set(values):
            wanted = replace(wanted, lower=None, upper=None)
        if (wanted.lower is None) != (wanted.upper is None):
            raise CommandError("a region needs both ends")
        if (
            wanted.lower is not None
            and wanted.upper is not None
            and not wanted.lower < wanted.upper
        ):
            raise CommandError(
                f"the region's lower end {wanted.lower:g} is not below its upper end "
                f"{wanted.upper:g}"
            )
        return wanted

    def details(self) -> dict[str, Any]:
        """Return what a session event says of the target."""
        unit = UNITS[self.feedback]
        details: dict[str, Any] = {TORQUE_TARGET: self.torque, "feedback": self.feedback}
        if self.lower is not None and self.upper is not None:
            details[f"lower[{unit}]"] = round(self.lower, 4)
            details[f"upper[{unit}]"] = round(self.upper, 4)
        return details


def planned_target(
    step: Step, protocol: Protocol, baseline: Baseline | None, conditioning: Conditioning | None
) -> Target:
    """Return the target of a step: its region is a level of the baseline, or the course's.

    Parameters
    ----------
    step, protocol
        What is asked for, and the widths of band and region.
    baseline
        The relaxed subject; None before it is measured, and there is no region then.
    conditioning
        Of a conditioning course; None without one.
    """
    region = None
    if step.level is not None and baseline is not None:
        region = baseline.region(step.feedback, step.level, protocol.level_half_width)
    elif conditioning is not None:
        region = conditioning.region()
    lower, upper = region or (None, None)
    return Target(step.feedback, step.torque_target, protocol.torque_half_width, lower, upper)
