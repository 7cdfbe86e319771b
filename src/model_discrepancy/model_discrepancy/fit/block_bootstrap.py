"""Standard errors from a bootstrap over stretches of the recording (Künsch 1989).

Source: Ann. Statist. 17, 1217.

The formula of least squares takes the whitened residual for white and the model for right. A
residual that still holds something predictable breaks both; stretches drawn with replacement do not
mind. Every draw takes one Gauss-Newton step from the fit, from the stretches' own normal equations,
so that two hundred draws cost less than one fit.
"""

from __future__ import annotations

import numpy as np

# Ten times the memory of the whitening filter (order 40 at 200 Hz): neighbours are as good as
# independent.
STRETCH_S = 2.0
# The standard error of a standard error from so many draws is 5 %.
DRAWS = 200


def bootstrap_changes(
    derivatives: np.ndarray, residual: np.ndarray, used: np.ndarray, rate: float, seed: int = 0
) -> np.ndarray:
    """Return the changes of the parameters from draw to draw of stretches.

    Parameters
    ----------
    derivatives
        Of the whitened model torque by the free parameters, shape (count, p).
    residual
        Whitened, shape (count,).
    used
        Rows that were fitted, bool, shape (count,).
    rate
        Of the rows [Hz].
    seed
        Of the draws.

    Returns
    -------
    np.ndarray
        In the parameters' units, shape (DRAWS, p); NaN where fewer than six stretches hold fitted
        rows. Their spread is the standard error.
    """
    length = max(int(STRETCH_S * rate), 1)
    stretches = [
        (derivatives[begin : begin + length][rows], residual[begin : begin + length][rows])
        for begin in range(0, len(residual), length)
        if (rows := used[begin : begin + length]).any()
    ]
    size = derivatives.shape[1]
    if len(stretches) < 6 or size == 0:
        return np.full((DRAWS, size), np.nan)
    scale = np.linalg.norm(derivatives[used], axis=0)
    scale[scale == 0] = 1.0
    information = np.array([(d / scale).T @ (d / scale) for d, _ in stretches])
    pull = np.array([(d / scale).T @ r for d, r in stretches])
    times = np.random.default_rng(seed).multinomial(
        len(stretches), np.full(len(stretches), 1 / len(stretches)), size=DRAWS
    )
    changes = [
        np.linalg.pinv(np.tensordot(count, information, 1), rcond=1e-12, hermitian=True)
        @ (count @ pull)
        for count in times.astype(float)
    ]
    return np.asarray(changes) / scale
