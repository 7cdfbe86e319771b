"""The reflex response beyond that of a muscle.

G is the gain of a muscle's response (`reflex_shapes`): it has no freedom that torque of another
origin could take up. What a free response over the whole basis would add to it is estimated apart,

    torque = K x + B v + I a + G h(.; η) * v₊ + Σ d_j b_j * v₊ + n,    d_j ~ N(0, width²),

with K, B, I and the d_j free about the present solution and G h held. The area of Σ d_j b_j is a
gain [N.m.s/rad] that no muscle's response explains: a later reflex, or intrinsic torque that the
model leaves out. It is stated with its standard error and is no part of G.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import linalg

from impedance_estimator.simultaneous.block_update import MIN_SCATTER_LENGTH, RESPONSE_SAMPLES
from impedance_estimator.simultaneous.explained_motion import memory_of, reduced_sums
from impedance_estimator.simultaneous.regression import GAINS, INTRINSIC
from impedance_estimator.simultaneous.state import Plan, State

WIDTH = 0.5
"""Prior standard deviation of the deviation, over the size of the response itself [1]: a late
response is a third to two thirds of the early one (Grey et al., J. Physiol. 534 (2001))."""
LEAST_GAIN = 1.0
"""[N.m.s/rad] A weaker reflex has deviations of this size."""


class Deviation(NamedTuple):
    """Holds what a free reflex response adds to that of a muscle.

    Attributes
    ----------
    coordinates
        Of each function of the basis, shape (m,).
    area
        [N.m.s/rad], beside G.
    standard_error
        Of the area [N.m.s/rad].
    """

    coordinates: np.ndarray
    area: float
    standard_error: float


def reflex_deviation(p: Plan, s: State) -> Deviation:
    """Return the deviation over the present memory; NaN where the memory is too short for it, and
    where the shape of the reflex is known beforehand.
    """
    c = s.counters[0]
    functions = len(p.area)
    nothing = Deviation(np.full(functions, np.nan), np.nan, np.nan)
    variance = float(c["variance"])
    if c["length"] < MIN_SCATTER_LENGTH * p.second or not variance > 0.0 or p.modelled_reflex:
        return nothing
    memory = memory_of(p, s, s.totals[c["model"]], c["length"])
    sums = reduced_sums(memory, s.nuisance.combine)
    start = np.concatenate([s.solution[:INTRINSIC], s.response])
    normal = sums[:-1, :-1]
    right = sums[:-1, -1] - normal @ start
    width = WIDTH * max(abs(float(s.output[0, GAINS - 1])), LEAST_GAIN)
    width *= float(np.sqrt(np.mean(s.tangent[:, 0] ** 2)))
    precision = np.concatenate(
        [1.0 / s.initial[1, :INTRINSIC] ** 2, np.full(functions, RESPONSE_SAMPLES / width**2)]
    )
    matrix = normal + np.diag(variance * precision)
    scale = 1.0 / np.sqrt(np.diag(matrix))
    try:
        factor = linalg.cho_factor(matrix * scale[:, None] * scale, check_finite=False)
    except linalg.LinAlgError:
        return nothing
    area = np.concatenate([np.zeros(INTRINSIC), p.area])
    found = scale * linalg.cho_solve(factor, scale * right)
    spread = scale * linalg.cho_solve(factor, scale * area)
    scatter = max(float(s.scatter[c["model"], GAINS - 1]), 1.0)
    error = np.sqrt(variance * scatter * float(area @ spread))
    return Deviation(found[INTRINSIC:], float(area @ found), float(error))
