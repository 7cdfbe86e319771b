"""Intrinsic parameters by least squares at zero lag.

    τ = K x + B v + I a + (everything else, uncorrelated with x, v, a)

    | <xx> <xv> <xa> | |K|   |<xτ>|
    | <xv> <vv> <va> | |B| = |<vτ>|        <.> running average (`running_products`)
    | <xa> <va> <aa> | |I|   |<aτ>|

van 't Veld et al. 2018, section II-A. The three signals differ by a factor of 10⁴ in size, so the
system is scaled to a correlation matrix before it is solved.
"""

from __future__ import annotations

import numpy as np
from numba import njit

SOLVED, NO_VARIANCE, COLLINEAR = 0, 1, 2

LEAST_DETERMINANT = 1e-6
"""The determinant of the correlation matrix of x, v, a must be at least this. It is 1 for
uncorrelated signals and about 0.9 for pulse-steps; below 1e-6 one signal follows from the other two
to a part in a thousand, and sensor noise of that size decides the estimate.
"""


@njit
def solve_intrinsic(averages: np.ndarray, parameters: np.ndarray, inverse: np.ndarray) -> int:
    """Return K, B, I from the running averages of products.

    Parameters
    ----------
    averages
        Shape (11,), from `average_products`.
    parameters
        Shape (3,), replaced by K [N.m/rad], B [N.m.s/rad], I [kg.m^2] where the system is solved.
    inverse
        Shape (3, 3), replaced by the inverse of the normal matrix <ss'>.

    Returns
    -------
    int
        `SOLVED`, `NO_VARIANCE` or `COLLINEAR`; parameters and inverse are left alone unless solved.
    """
    xx, xv, xa, xt = averages[0], averages[1], averages[2], averages[3]
    vv, va, vt = averages[4], averages[5], averages[6]
    aa, at = averages[7], averages[8]
    if not (xx > 0.0 and vv > 0.0 and aa > 0.0):
        return NO_VARIANCE
    sx, sv, sa = 1.0 / np.sqrt(xx), 1.0 / np.sqrt(vv), 1.0 / np.sqrt(aa)
    p, q, r = xv * sx * sv, xa * sx * sa, va * sv * sa
    determinant = 1.0 + 2.0 * p * q * r - p * p - q * q - r * r
    if not (determinant > LEAST_DETERMINANT and abs(p) < 1.0 and abs(q) < 1.0 and abs(r) < 1.0):
        return COLLINEAR
    inverse[0, 0] = (1.0 - r * r) / determinant * sx * sx
    inverse[1, 1] = (1.0 - q * q) / determinant * sv * sv
    inverse[2, 2] = (1.0 - p * p) / determinant * sa * sa
    inverse[0, 1] = inverse[1, 0] = (q * r - p) / determinant * sx * sv
    inverse[0, 2] = inverse[2, 0] = (p * r - q) / determinant * sx * sa
    inverse[1, 2] = inverse[2, 1] = (p * q - r) / determinant * sv * sa
    for i in range(3):
        parameters[i] = inverse[i, 0] * xt + inverse[i, 1] * vt + inverse[i, 2] * at
    return SOLVED
