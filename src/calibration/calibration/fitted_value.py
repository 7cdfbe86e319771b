"""Values that least squares in the frequency domain find, with standard errors that hold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Frequencies within such a band count as one observation for standard errors: a few times the
# resolution of the smoothed transfers.
ERROR_BAND = 4.0  # Hz


@dataclass(frozen=True)
class Found:
    """Holds a value with its standard error, in the unit of its use."""

    value: float
    error: float


def standard_errors(slopes: np.ndarray, residual: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Return standard errors of least squares whose residual is alike within `ERROR_BAND`.

    Smoothing spreads noise over neighbouring frequencies, and what the description does not hold
    lies in whole bands: lines of one band are no independent observations (Liang & Zeger,
    Biometrika 73 (1986) 13-22). Never less than the errors of white residuals.

    Parameters
    ----------
    slopes
        Derivatives of the residual, shape (2 n, p): real parts, then imaginary ones.
    residual
        Real and imaginary residuals, shape (2 n,).
    frequency
        Frequencies of the spectra [Hz], shape (n,).
    """
    inverse = np.linalg.pinv(slopes.T @ slopes)
    variance = float(residual @ residual) / (len(residual) - slopes.shape[1])
    bands = np.floor(frequency / ERROR_BAND).astype(int)
    scores = np.zeros((bands.max() + 1, slopes.shape[1]))
    np.add.at(scores, np.concatenate([bands, bands]), slopes * residual[:, None])
    count = len(np.unique(bands))
    spread = inverse @ (scores.T @ scores) @ inverse * (count / max(count - 1, 1))
    return np.asarray(np.sqrt(np.maximum(np.diag(spread), np.diag(inverse) * variance)))


def solved(regressors: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """Return the least-squares solution, shape (p,), of regressors (n, p) and a goal (n,)."""
    return np.linalg.solve(regressors.T @ regressors, regressors.T @ goal)


def stacked_parts(values: np.ndarray) -> np.ndarray:
    """Return real parts, then imaginary ones, along the first axis: shape (2 n, ...)."""
    return np.concatenate([values.real, values.imag])
