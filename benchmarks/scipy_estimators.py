"""The estimators' algorithms once more in plain NumPy and SciPy, block by block: peers for speed.

`ScipyCE` is the whole of algorithm CE (``highpass`` = ``all``) except validity, standard errors and
VAF; it gives the same K and G. `ScipySimultaneous` is the part of the simultaneous estimator that
every block needs: smoothing and derivatives, reflex basis, whitening under every noise model, sums
of products, and one solution per memory block. It does not look for changes, choose models, or
follow the shape.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg, signal

from impedance_estimator.correlation.correlation_estimator import AVERAGE_ORDER, LOWPASS_ORDER
from impedance_estimator.correlation.differences import backward_difference
from impedance_estimator.correlation.reflex_response import decimation, lags
from impedance_estimator.correlation.separation import REFLEX_EVERY
from impedance_estimator.digital_filters import butterworth_lowpass, highpass
from impedance_estimator.settings import Settings
from impedance_estimator.simultaneous.simultaneous_estimator import Simultaneous


class _Filter:
    """A cascade over the columns of blocks, started in the steady state of the first sample."""

    def __init__(self, sections: np.ndarray, from_rest: bool = False) -> None:
        self._sections = sections
        self._from_rest = from_rest
        self._state: np.ndarray | None = None

    def __call__(self, values: np.ndarray) -> np.ndarray:
        if self._state is None:
            first = np.zeros(values.shape[1]) if self._from_rest else values[0]
            self._state = signal.sosfilt_zi(self._sections)[:, :, None] * first
        out, self._state = signal.sosfilt(self._sections, values, axis=0, zi=self._state)
        return out


class ScipyCE:
    """Algorithm CE for a stream with measured velocity; the block's length must be a multiple of
    the decimation.
    """

    def __init__(self, rate: float) -> None:
        s = Settings(highpass="all")
        self._every = decimation(rate)
        slow = rate / self._every
        self._lowpass = _Filter(butterworth_lowpass(LOWPASS_ORDER, s.lowpass_cutoff, rate))
        self._weights = backward_difference(4, rate)
        self._difference_state: np.ndarray | None = None
        self._highpass = _Filter(highpass(s.highpass_cutoff, rate))
        self._average = _Filter(
            butterworth_lowpass(AVERAGE_ORDER, s.intrinsic_average_cutoff, slow), from_rest=True
        )
        self._reflex_average = _Filter(
            butterworth_lowpass(AVERAGE_ORDER, s.reflex_average_cutoff, slow), from_rest=True
        )
        self._lags = lags(s.reflex_first_lag, s.reflex_last_lag, slow)
        self._ridge = s.reflex_ridge
        self._rectified = np.zeros(self._lags[-1] + 1)
        self._chunks = 0
        self.parameters = np.zeros(3)
        self.G = 0.0

    def process(self, samples: np.ndarray) -> None:
        """Take in t, position, velocity, torque, shape (n, 4)."""
        low = self._lowpass(samples[:, 1:])
        x, v, torque = low.T
        if self._difference_state is None:
            self._difference_state = signal.lfilter_zi(self._weights, 1.0) * v[0]
        a, self._difference_state = signal.lfilter(self._weights, 1.0, v, zi=self._difference_state)
        torque, rectified, x, v, a = self._highpass(
            np.column_stack([torque, np.maximum(v, 0.0), x, v, a])
        ).T
        regressors = np.column_stack([x, v, a])
        products = np.column_stack(
            [regressors[:, i] * regressors[:, j] for i in range(3) for j in range(i, 3)]
        )
        products = np.column_stack([products, regressors * torque[:, None]])
        decimated = products.reshape(-1, self._every, 9).sum(axis=1)
        averages = self._average(decimated)
        for k, sums in enumerate(averages):
            part = slice(k * self._every, (k + 1) * self._every)
            residual = np.mean(torque[part] - regressors[part] @ self.parameters)
            self._reflex(residual, float(np.mean(rectified[part])))
            self._intrinsic(sums)

    def _intrinsic(self, sums: np.ndarray) -> None:
        normal = np.array(
            [[sums[0], sums[1], sums[2]], [sums[1], sums[3], sums[4]], [sums[2], sums[4], sums[5]]]
        )
        scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        try:
            self.parameters = (
                np.linalg.solve(normal / np.outer(scale, scale), sums[6:] / scale) / scale
            )
        except np.linalg.LinAlgError:
            return

    def _reflex(self, residual: float, rectified: float) -> None:
        self._rectified = np.roll(self._rectified, 1)
        self._rectified[0] = rectified
        count = len(self._lags)
        correlations = self._reflex_average(
            np.concatenate(
                [
                    self._rectified[0] * self._rectified[:count],
                    residual * self._rectified[self._lags],
                ]
            )[None]
        )[0]
        self._chunks += 1
        if self._chunks % REFLEX_EVERY == 0 and correlations[0] > 0.0:
            column = correlations[:count].copy()
            column[0] *= 1.0 + self._ridge
            self.G = float(np.sum(linalg.solve_toeplitz(column, correlations[count:])))


class ScipySimultaneous:
    """The simultaneous estimator's work for every block, for a stream with measured velocity."""

    def __init__(self, rate: float) -> None:
        self._plan = plan = Simultaneous(rate, True)._plan
        self._kernels = plan.kernels
        self._history = np.zeros((2 * plan.kernels.shape[1], 3))
        self._basis = plan.functions
        self._rectified = np.zeros(len(plan.lags) - 1)
        size = plan.functions.shape[1] + 4
        self._whitening = [_Filter(sections) for sections in plan.whitening]
        self._sums = np.zeros((len(plan.whitening), size, size))
        self._ring = np.zeros((plan.memory_blocks, len(plan.whitening), size, size))
        self._filled = self._blocks = 0
        self.solution = np.zeros(size - 1)

    def process(self, samples: np.ndarray) -> None:
        """Take in t, position, velocity, torque, shape (n, 4)."""
        p, width = self._plan, self._kernels.shape[1]
        known = np.vstack([self._history, samples[:, 1:]])
        self._history = known[-2 * width :]
        smooth, first = self._kernels[0, ::-1], self._kernels[1, ::-1]
        low = np.column_stack([np.convolve(column, smooth, "valid") for column in known.T])[
            -len(samples) :: p.decimation
        ]
        acceleration = np.convolve(known[:, 1], first, "valid")[-len(samples) :: p.decimation]
        rectified = np.where(low[:, 1] > p.rest_velocity, low[:, 1], 0.0)
        stretch = np.concatenate([self._rectified, rectified])
        self._rectified = stretch[-len(self._rectified) :]
        windows = np.lib.stride_tricks.sliding_window_view(stretch, len(p.lags))[:, ::-1]
        signals = np.column_stack(
            [low[:, 0], low[:, 1], acceleration, windows @ self._basis, low[:, 2]]
        )
        for model, whiten in enumerate(self._whitening):
            whitened = whiten(signals)
            self._sums[model] += whitened.T @ whitened
        self._filled += len(signals)
        if self._filled >= p.block_samples:
            self._finish()

    def _finish(self) -> None:
        self._ring[self._blocks % len(self._ring)] = self._sums
        self._sums[:] = 0.0
        self._filled = 0
        self._blocks += 1
        total = self._ring[:, 0].sum(axis=0)
        normal, right = total[:-1, :-1], total[:-1, -1]
        scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        scaled = normal / np.outer(scale, scale) + 1e-6 * np.eye(len(normal))
        self.solution = linalg.cho_solve(linalg.cho_factor(scaled), right / scale) / scale
