"""The reflex response beyond that of a muscle and its late reflex.

G is the gain of a muscle's response (`reflex_shapes`), early and late (`optional_terms`): it has no
freedom that torque of another origin could take up. What a free response over the whole basis would
add to it is estimated apart,

    torque = K x + B v + I a + G h(.; η) * v₊ + nuisance + Σ d_j b_j * v₊ + n

    d_j ~ N(0, width²)

with K, B, I and the d_j free about the present solution and G h held. The area of Σ d_j b_j is a
gain [N.m.s/rad] that no muscle's response explains: a reflex of another delay, or intrinsic torque
that the model leaves out. It is stated with its standard error and is no part of G.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from impedance_estimator.compilation import source_fingerprint
from impedance_estimator.simultaneous.block_update import MIN_SCATTER_LENGTH, RESPONSE_SAMPLES
from impedance_estimator.simultaneous.cholesky import solve_scaled
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


def _compile(source: int) -> Any:
    # `source` in the closure: see `compilation.source_fingerprint`.
    @njit(cache=True, error_model="numpy")
    def found(p: Plan, s: State) -> tuple[np.ndarray, float, float]:
        _ = source
        c = s.counters[0]
        functions = p.area.shape[0]
        size = INTRINSIC + functions
        nothing = np.full(functions, np.nan), np.nan, np.nan
        if c.length < MIN_SCATTER_LENGTH * p.second or not c.variance > 0.0 or p.modelled_reflex:
            return nothing
        memory = memory_of(p, s, s.totals[c.model], c.length)
        sums = reduced_sums(memory, s.nuisance.combine)
        matrix = sums[:size, :size].copy()
        width = WIDTH * max(abs(s.output[0, GAINS - 1]), LEAST_GAIN)
        width *= np.sqrt(np.mean(s.tangent[:, 0] ** 2))
        # What is left of the torque, and the area of each function.
        right = np.zeros((size, 2))
        for i in range(size):
            right[i, 0] = sums[i, size]
            for j in range(INTRINSIC):
                right[i, 0] -= sums[i, j] * s.solution[j]
            for j in range(functions):
                right[i, 0] -= sums[i, INTRINSIC + j] * s.response[j]
            deviation = s.initial[1, i] if i < INTRINSIC else width / np.sqrt(RESPONSE_SAMPLES)
            matrix[i, i] += c.variance / deviation**2
        right[INTRINSIC:, 1] = p.area
        known, _ = solve_scaled(matrix, 0.0, right)
        if not known:
            return nothing
        area = spread = 0.0
        for j in range(functions):
            area += p.area[j] * right[INTRINSIC + j, 0]
            spread += p.area[j] * right[INTRINSIC + j, 1]
        scatter = max(s.scatter[c.model, GAINS - 1], 1.0)
        return right[INTRINSIC:, 0].copy(), area, np.sqrt(c.variance * scatter * spread)

    return found


_found = _compile(source_fingerprint())


def reflex_deviation(p: Plan, s: State) -> Deviation:
    """Return the deviation over the present memory; NaN where the memory is too short for it, and
    where the shape of the reflex is known beforehand.
    """
    return Deviation(*_found(p, s))
