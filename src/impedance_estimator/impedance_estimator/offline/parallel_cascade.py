"""The offline reference: intrinsic and reflex impulse responses as a parallel cascade.

    τ[n] = Δ Σ_j h_I[j] x[n - j]     j Δ from -40 to 40 ms: intrinsic, two-sided
         + Δ Σ_k h_R[k] v₊[n - k]    k Δ from 40 to 400 ms: reflex, v₊ = max(v, 0)

Neither pathway has a parametric form, so the method shows what a linear intrinsic pathway and a
reflex to rectified velocity can explain at all. The two are estimated in turn, each from the torque
that the other leaves, until the explained variance stops to grow (Kearney, Stein & Parameswaran,
IEEE Trans. Biomed. Eng. 44 (1997) 493-504). Every round only solves two systems of normal
equations, because the sums over the data are taken once.

Position, velocity and torque pass the same zero-phase filters, so no voluntary drift and no noise
beyond the perturbation's band is fitted, and delays stay true.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from impedance_estimator.offline.torque_prediction import (
    Prediction,
    checked_signals,
    decimation,
    working_signals,
)

INTRINSIC_LAG = 0.040
"""[s] Half-length of the intrinsic response. Shorter than the reflex delay. Kearney et al. 1997."""
REFLEX_LAGS = (0.040, 0.400)
"""[s] First and last lag of the reflex response. van 't Veld et al. 2018, section II-A."""
RIDGE = 1e-6
"""Added to the diagonals relative to them: the inputs have no power between the low-pass and half
the working rate.
"""
CONVERGENCE_VAF = 1e-3
"""A round that raises VAF by less than this [%] is the last one; noise moves VAF by more."""
MOST_ROUNDS = 200


@dataclass(frozen=True)
class ParallelCascade:
    """Holds two impulse responses; see the module."""

    rate: float
    """Rate [Hz] of the samples that `predict` takes."""
    intrinsic_lags: np.ndarray
    """[s], shape (k,)"""
    intrinsic: np.ndarray
    """h_I [N.m/(rad s)], shape (k,)"""
    reflex_lags: np.ndarray
    """[s], shape (m,)"""
    reflex: np.ndarray
    """h_R [N.m/rad], shape (m,)"""
    rounds: int
    """Number of rounds until convergence."""
    vaf: float
    """Variance of the data it was fitted to that it accounts for [%]."""

    @property
    def stiffness(self) -> float:
        """Return K, the intrinsic pathway at rest: the integral of its response [N.m/rad]."""
        return float(np.sum(self.intrinsic) * decimation(self.rate) / self.rate)

    @property
    def gain(self) -> float:
        """Return G, the reflex pathway at rest: the integral of its response [N.m.s/rad]."""
        return float(np.sum(self.reflex) * decimation(self.rate) / self.rate)

    def predict(
        self,
        position: np.ndarray,
        torque: np.ndarray | None = None,
        velocity: np.ndarray | None = None,
    ) -> Prediction:
        """Return the torque of other data under this model.

        Parameters
        ----------
        position
            [rad], shape (n,), at `rate`.
        torque
            [N.m], shape (n,), to compare with.
        velocity
            [rad/s], shape (n,), where it was measured; otherwise position is differentiated.

        Returns
        -------
        Prediction
            The prediction from the first sample that has the whole reflex history behind it.

        Raises
        ------
        ValueError
            As `parallel_cascade`.
        """
        position, torque, velocity = checked_signals(self.rate, position, torque, velocity)
        x, _, _, rectified, y = working_signals(self.rate, position, torque, velocity)
        every = decimation(self.rate)
        rows, intrinsic_lags, reflex_lags = _rows(len(x), self.rate / every)
        step = every / self.rate
        return Prediction(
            time=rows * step,
            intrinsic=_lagged(x, rows, intrinsic_lags) @ self.intrinsic * step,
            reflex=_lagged(rectified, rows, reflex_lags) @ self.reflex * step,
            measured=y[rows],
        )


def parallel_cascade(
    rate: float, position: np.ndarray, torque: np.ndarray, velocity: np.ndarray | None = None
) -> ParallelCascade:
    """Fit the two impulse responses.

    Parameters
    ----------
    rate
        Sampling rate [Hz], at least 250.
    position
        [rad], shape (n,), evenly sampled without gaps.
    torque
        Measured torque [N.m], shape (n,).
    velocity
        [rad/s], shape (n,), where it was measured; otherwise position is differentiated.

    Raises
    ------
    ValueError
        Shapes that differ, values that are not finite, a record shorter than 5 s, or a rate too
        low.
    numpy.linalg.LinAlgError
        Position or rectified velocity do not vary.
    """
    position, checked_torque, velocity = checked_signals(rate, position, torque, velocity)
    every = decimation(rate)
    step = every / rate
    x, _, _, rectified, y = working_signals(rate, position, checked_torque, velocity)
    rows, intrinsic_lags, reflex_lags = _rows(len(x), rate / every)
    intrinsic_inputs = _lagged(x, rows, intrinsic_lags) * step
    reflex_inputs = _lagged(rectified, rows, reflex_lags) * step
    y = y[rows] - np.mean(y[rows])
    total = float(y @ y)
    intrinsic_system = _factor(intrinsic_inputs)
    reflex_system = _factor(reflex_inputs)
    cross = intrinsic_inputs.T @ reflex_inputs
    intrinsic_torque, reflex_torque = intrinsic_inputs.T @ y, reflex_inputs.T @ y
    reflex = np.zeros(len(reflex_lags))
    explained = -math.inf
    for rounds in range(1, MOST_ROUNDS + 1):  # noqa: B007 - the number of rounds is a result
        intrinsic = linalg.cho_solve(intrinsic_system, intrinsic_torque - cross @ reflex)
        reflex = linalg.cho_solve(reflex_system, reflex_torque - cross.T @ intrinsic)
        residual = y - intrinsic_inputs @ intrinsic - reflex_inputs @ reflex
        previous, explained = explained, 100.0 * (1.0 - float(residual @ residual) / total)
        if explained - previous < CONVERGENCE_VAF:
            break
    return ParallelCascade(
        rate, intrinsic_lags * step, intrinsic, reflex_lags * step, reflex, rounds, explained
    )


def _rows(count: int, working_rate: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return samples with all lags inside the record, and the lags of both responses, in
    samples.
    """
    ahead = round(INTRINSIC_LAG * working_rate)
    reflex = np.arange(
        round(REFLEX_LAGS[0] * working_rate), round(REFLEX_LAGS[1] * working_rate) + 1
    )
    return np.arange(reflex[-1], count - ahead), np.arange(-ahead, ahead + 1), reflex


def _lagged(values: np.ndarray, rows: np.ndarray, lags: np.ndarray) -> np.ndarray:
    return values[rows[:, None] - lags[None, :]]


def _factor(inputs: np.ndarray) -> tuple[np.ndarray, bool]:
    normal = inputs.T @ inputs
    return linalg.cho_factor(normal + RIDGE * np.diag(np.diag(normal)))
