"""The torque of a single sample that relaxation does not find.

Where a stop is steep, relaxation throws the motion back by more than it came; where play or
friction reverses, the torque jumps with the sign of the velocity, and relaxation changes from one
side to the other for ever. The solution lies between two such swings.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq

# Rounds until the torque swings back; one that does not has no solution.
MOST_ROUNDS = 20


def torque_between(ahead: Callable[[float], float], start: float, tolerance: float) -> float | None:
    """Return the torque [N.m] that the model answers with the same torque; None where there is
    none.

    Brent's method (1973) between two rounds of the relaxation, on either side of it. Where the
    answer jumps, it is the torque at the jump.

    Parameters
    ----------
    ahead
        By how much the answer to a torque exceeds it [N.m].
    start
        Where the relaxation begins [N.m].
    tolerance
        Of the torque [N.m].
    """
    near, step = start, ahead(start)
    for _ in range(MOST_ROUNDS):
        far = near + step
        there = ahead(far)
        if not np.isfinite(there):
            return None
        if there * step <= 0.0:
            # A part of the last digits is left to rounding.
            close = max(tolerance, 4.0 * np.spacing(abs(far)))
            return float(brentq(ahead, near, far, xtol=close))
        near, step = far, there
    return None
