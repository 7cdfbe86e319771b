"""The offline reference: intrinsic and reflex impulse responses as a parallel cascade.

    τ[n] = Δ Σ_j h_I[j] x[n - j]     j Δ from -40 to 40 ms: intrinsic, two-sided
         + Δ Σ_k h_R[k] v₊[n - k]    k Δ from 40 to 400 ms: reflex, v₊ = max(v, 0)

Neither pathway has a parametric form, so the method shows what a linear intrinsic pathway and a reflex to rectified
velocity can explain at all. The two are estimated in turn, each from the torque that the other leaves, until the
explained variance stops to grow (Kearney, Stein & Parameswaran, IEEE Trans. Biomed. Eng. 44 (1997) 493-504).
Every round only solves two systems of normal equations, because the sums over the data are taken once.

Position, velocity and torque pass the same zero-phase filters, so no voluntary drift and no noise beyond the
perturbation's band is fitted, and delays stay true.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import linalg, signal

INTRINSIC_LAG = 0.040
"""[s] Half-length of the intrinsic response. Shorter than the reflex delay. Kearney et al. 1997."""
REFLEX_LAGS = (0.040, 0.400)
"""[s] First and last lag of the reflex response. van 't Veld et al. 2018, section II-A."""
LOWPASS = 80.0
"""[Hz] Above, the position of the real trials is noise; the perturbation has its power below 40 Hz."""
HIGHPASS = 0.1
"""[Hz] Below, torque is voluntary. One step of the perturbation lasts 0.2 to 0.7 s, well within the pass band."""
FILTER_ORDER = 2
"""Of each Butterworth filter, which runs forwards and backwards."""
WORKING_RATE = 250.0
"""[Hz] Three times the low-pass; the factor of decimation is a whole number, so 2048 Hz gives 256 Hz."""
RIDGE = 1e-6
"""Added to the diagonals relative to them: the inputs have no power between `LOWPASS` and half the working rate."""
CONVERGED = 1e-3
"""[%] A round that explains less of the variance than this in addition is the last one; noise moves VAF by more."""
MOST_ROUNDS = 200


@dataclass(frozen=True)
class Prediction:
    """Torques after the filters, at the working rate. All of shape (n,)."""

    time: np.ndarray
    """[s] since the first sample given."""
    intrinsic: np.ndarray
    """[N.m]"""
    reflex: np.ndarray
    """[N.m]"""
    measured: np.ndarray
    """[N.m] The torque through the same filters; NaN where none was given."""

    @property
    def torque(self) -> np.ndarray:
        """Intrinsic and reflex torque together [N.m]."""
        return self.intrinsic + self.reflex

    @property
    def vaf(self) -> float:
        """Variance of the measured torque that is accounted for [%]."""
        return 100.0 * (1.0 - float(np.var(self.measured - self.torque) / np.var(self.measured)))


@dataclass(frozen=True)
class ParallelCascade:
    """Two impulse responses; see the module."""

    rate: float
    """[Hz] of the samples that `predict` takes."""
    intrinsic_lags: np.ndarray
    """[s], shape (k,)"""
    intrinsic: np.ndarray
    """h_I [N.m/(rad s)], shape (k,)"""
    reflex_lags: np.ndarray
    """[s], shape (m,)"""
    reflex: np.ndarray
    """h_R [N.m/rad], shape (m,)"""
    rounds: int
    """Until convergence."""
    vaf: float
    """Of the data it was fitted to [%]."""

    @property
    def stiffness(self) -> float:
        """K, the intrinsic pathway at rest: the integral of its response [N.m/rad]."""
        return float(np.sum(self.intrinsic) * _decimation(self.rate) / self.rate)

    @property
    def gain(self) -> float:
        """G, the reflex pathway at rest: the integral of its response [N.m.s/rad]."""
        return float(np.sum(self.reflex) * _decimation(self.rate) / self.rate)

    def predict(self, position: np.ndarray, torque: np.ndarray | None = None, velocity: np.ndarray | None = None) -> Prediction:
        """Torque of other data under this model.

        Args:
            position: [rad], shape (n,), at `rate`.
            torque: [N.m], shape (n,), to compare with.
            velocity: [rad/s], shape (n,), where it was measured; otherwise position is differentiated.

        Returns:
            The prediction from the first sample that has the whole reflex history behind it.

        Raises:
            ValueError: as `parallel_cascade`.
        """
        position, torque, velocity = _checked(self.rate, position, torque, velocity)
        x, rectified, y = _working_signals(self.rate, position, torque, velocity)
        every = _decimation(self.rate)
        rows, intrinsic_lags, reflex_lags = _rows(len(x), self.rate / every)
        step = every / self.rate
        return Prediction(
            time=rows * step,
            intrinsic=_lagged(x, rows, intrinsic_lags) @ self.intrinsic * step,
            reflex=_lagged(rectified, rows, reflex_lags) @ self.reflex * step,
            measured=y[rows],
        )


def parallel_cascade(rate: float, position: np.ndarray, torque: np.ndarray, velocity: np.ndarray | None = None) -> ParallelCascade:
    """Fit the two impulse responses.

    Args:
        rate: sampling rate [Hz], at least 250.
        position: [rad], shape (n,), evenly sampled without gaps.
        torque: [N.m], shape (n,).
        velocity: [rad/s], shape (n,), where it was measured; otherwise position is differentiated.

    Raises:
        ValueError: shapes that differ, values that are not finite, a record shorter than 5 s, or a rate too low.
        numpy.linalg.LinAlgError: position or rectified velocity do not vary.
    """
    position, torque, velocity = _checked(rate, position, torque, velocity)
    every = _decimation(rate)
    step = every / rate
    x, rectified, y = _working_signals(rate, position, torque, velocity)
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
        if explained - previous < CONVERGED:
            break
    return ParallelCascade(rate, intrinsic_lags * step, intrinsic, reflex_lags * step, reflex, rounds, explained)


def _checked(
    rate: float, position: np.ndarray, torque: np.ndarray | None, velocity: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None]:
    if rate < WORKING_RATE:
        raise ValueError(f"sampling rate {rate:g} Hz is refused; allowed: {WORKING_RATE:g} Hz and more")
    position = np.asarray(position, dtype=float)
    if position.ndim != 1 or len(position) < 5.0 * rate:
        raise ValueError(
            f"position of shape {position.shape} is refused; needed: one row of at least 5 s ({math.ceil(5.0 * rate)} samples)"
        )
    others: list[np.ndarray | None] = []
    for name, values in (("torque", torque), ("velocity", velocity)):
        others.append(None if values is None else np.asarray(values, dtype=float))
        if values is not None and np.shape(values) != position.shape:
            raise ValueError(f"{name} of shape {np.shape(values)} does not fit position of shape {position.shape}")
    for name, checked in zip(("position", "torque", "velocity"), (position, *others), strict=True):
        if checked is not None and not np.all(np.isfinite(checked)):
            raise ValueError(f"{name} has {int(np.sum(~np.isfinite(checked)))} values that are NaN or infinite")
    return position, others[0], others[1]


def _decimation(rate: float) -> int:
    return max(int(rate // WORKING_RATE), 1)


def _rows(count: int, working_rate: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Samples with all lags inside the record, and the lags of both responses, in samples."""
    ahead = round(INTRINSIC_LAG * working_rate)
    reflex = np.arange(round(REFLEX_LAGS[0] * working_rate), round(REFLEX_LAGS[1] * working_rate) + 1)
    return np.arange(reflex[-1], count - ahead), np.arange(-ahead, ahead + 1), reflex


def _lagged(values: np.ndarray, rows: np.ndarray, lags: np.ndarray) -> np.ndarray:
    return values[rows[:, None] - lags[None, :]]


def _factor(inputs: np.ndarray) -> tuple[np.ndarray, bool]:
    normal = inputs.T @ inputs
    return linalg.cho_factor(normal + RIDGE * np.diag(np.diag(normal)))


def _working_signals(
    rate: float, position: np.ndarray, torque: np.ndarray | None, velocity: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position [rad], rectified velocity [rad/s] and torque [N.m] (NaN where not given), filtered, at the working rate."""
    lowpass = signal.butter(FILTER_ORDER, LOWPASS, fs=rate, output="sos")
    highpass = signal.butter(FILTER_ORDER, HIGHPASS, "highpass", fs=rate, output="sos")
    every = _decimation(rate)

    def smooth(values: np.ndarray) -> np.ndarray:
        return signal.sosfiltfilt(lowpass, values)

    def finish(values: np.ndarray) -> np.ndarray:
        return signal.sosfiltfilt(highpass, values)[::every]

    x = smooth(position)
    v = np.gradient(x, 1.0 / rate) if velocity is None else smooth(velocity)
    rectified = np.maximum(v, 0.0)
    y = np.full(len(x[::every]), np.nan) if torque is None else finish(smooth(torque))
    return finish(x), finish(rectified), y
