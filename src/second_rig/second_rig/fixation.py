"""What is between plate and foot: straps, a soft pad that stiffens, or a gap."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

# Share of the contact's damping: skin and sock rub inside the gap, which keeps a free foot from
# swinging without end.
DAMPING_IN_GAP = 0.1


class Fixation(NamedTuple):
    """Holds what is between plate and foot.

    Attributes
    ----------
    compliant
        1 where the foot moves against the plate, 0 where both are one [1].
    plate_inertia
        Of the plate and the part of the foot that goes with it [kg.m^2].
    stiffness, damping
        [N.m/rad], [N.m.s/rad].
    stiffening_extension
        Extension at which a soft pad stiffens; 0 where it does not [rad].
    gap
        In which the foot moves freely, side to side [rad].
    """

    compliant: float = 0.0
    plate_inertia: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0
    stiffening_extension: float = 0.0
    gap: float = 0.0


@njit(cache=True)
def fixation_torque(fixation: Fixation, extension: float, rate: float) -> float:
    """Return the torque that goes from the plate to the foot [N.m].

    Parameters
    ----------
    fixation
        Its numbers.
    extension, rate
        Plate minus foot [rad], [rad/s].
    """
    stiffness, damping = fixation.stiffness, fixation.damping
    if fixation.gap > 0.0:
        side = 0.5 * fixation.gap
        if extension > side:
            # A contact pushes and does not pull.
            return max(stiffness * (extension - side) + damping * rate, 0.0)
        if extension < -side:
            return min(stiffness * (extension + side) + damping * rate, 0.0)
        return DAMPING_IN_GAP * damping * rate
    if fixation.stiffening_extension > 0.0:
        relative = extension / fixation.stiffening_extension
        elastic = stiffness * fixation.stiffening_extension * np.sinh(relative)
        return elastic + damping * rate * np.cosh(relative)
    return stiffness * extension + damping * rate
