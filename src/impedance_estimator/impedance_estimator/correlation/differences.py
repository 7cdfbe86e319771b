"""Backward differences: derivatives from present and past samples.

First order (error h x''/2, half a sample late) and fourth order (error h⁴ x⁽⁵⁾/5):

    x'[n] = (x[n] - x[n-1]) / h
    x'[n] = (25/12 x[n] - 4 x[n-1] + 3 x[n-2] - 4/3 x[n-3] + 1/4 x[n-4]) / h

Coefficients: Fornberg, Math. Comp. 51 (1988) 699-706, table 3 (one-sided, first derivative).
"""

from __future__ import annotations

import numpy as np
from numba import njit

_WEIGHTS = {1: (1.0, -1.0), 4: (25.0 / 12.0, -4.0, 3.0, -4.0 / 3.0, 1.0 / 4.0)}
ORDERS = tuple(_WEIGHTS)
LENGTH = max(ORDERS) + 1
"""Samples that a difference looks at. The same for both orders: loops of constant length are
unrolled.
"""


def backward_difference(order: int, rate: float) -> np.ndarray:
    """Return the weights [1/s] of x[n], x[n-1], ..., x[n-4] for the first derivative, shape
    (`LENGTH`,).

    Raises
    ------
    ValueError
        An order other than 1 or 4.
    """
    if order not in _WEIGHTS:
        raise ValueError(
            f"backward difference of order {order} is not available; allowed: "
            f"{', '.join(map(str, ORDERS))}"
        )
    weights = np.zeros(LENGTH)
    weights[: order + 1] = _WEIGHTS[order]
    return weights * rate


@njit(inline="always")
def difference_step(weights: np.ndarray, history: np.ndarray, value: float) -> float:
    """Return the derivative at the newest sample.

    Parameters
    ----------
    weights
        Weights of the samples [1/s], shape (`LENGTH`,).
    history
        Shape (`LENGTH`,), the newest sample first; it takes `value` in.
    value
        The newest sample.
    """
    for k in range(LENGTH - 1, 0, -1):
        history[k] = history[k - 1]
    history[0] = value
    derivative = 0.0
    for k in range(LENGTH):
        derivative += weights[k] * history[k]
    return derivative
