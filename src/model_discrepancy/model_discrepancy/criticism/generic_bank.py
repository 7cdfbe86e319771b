"""A bank of generic nonlinear regressors shows what is still predictable.

It is trained on one part of the recording and scored on the other.

The regressors know no physics: products of position, velocity and their rectified versions, each
through a set of overlapping lag windows. What they predict of a residual on data that they were
not trained on is structure that the model lacks, whatever its name.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from model_discrepancy.fit.columns import Columns
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.search.null import exceeded_by_chance

# Lag windows: from just before the movement (a torque channel that runs ahead) to beyond the
# reflex.
LAGS_S = (-0.01, 0.0, 0.01, 0.02, 0.035, 0.05, 0.075, 0.1, 0.14, 0.19, 0.26, 0.36, 0.5)
# Of the torque's variance: a quarter of its noise at the paper's SNR (24.1 dB). What changes less
# is below any instrument's own errors.
MATERIAL_SHARE = 1e-3
_RIDGES = (1e-4, 1e-3, 1e-2, 1e-1)


@dataclass(frozen=True)
class Remainder:
    """Describes what the bank predicts of a residual.

    Attributes
    ----------
    share
        Of the whitened residual's power on unseen rows, 0...1; mean of both directions.
    worst
        The smaller of the two directions.
    by_input
        Share that each input's regressors predict alone.
    plain_share
        Share of the plain residual's power, on unseen rows.
    torque_share
        Power of the predicted torque as a share of the recorded torque's, without what chance
        predicts.
    by_chance
        Share that the bank exceeds by chance in `FALSE_ALARM` of recordings like this one.
    judged
        Whether what is predicted is missing physics; not where torque may have moved the plate.
    """

    share: float
    worst: float
    by_input: dict[str, float]
    plain_share: float
    torque_share: float = 0.0
    by_chance: float = 0.0
    judged: bool = True

    @property
    def exceeds_chance(self) -> bool:
        """Say whether more is predicted than chance does, in both directions, and it matters."""
        return (
            self.share > max(self.by_chance, 0.0)
            and self.worst > 0.0
            and self.torque_share > MATERIAL_SHARE
        )

    @property
    def significant(self) -> bool:
        """Say whether physics is missing: more is predicted than by chance, by the movement."""
        return self.judged and self.exceeds_chance


class GenericBank:
    """The bank for one recording.

    Parameters
    ----------
    columns
        Of the recording.
    like
        A bank of another recording whose weights are to be used here; None scales by this
        recording.

    Attributes
    ----------
    scale
        Mean angle [rad] and size of position, velocity, acceleration [rad, rad/s, rad/s^2] that
        count as one.
    """

    def __init__(self, columns: Columns, like: GenericBank | None = None) -> None:
        m = columns.motion
        own = (
            columns.mean_angle,
            float(m.position.std()),
            float(m.velocity.std()),
            float(m.acceleration.std()),
        )
        self.scale: tuple[float, ...] = like.scale if like is not None else own
        # Scaled to unit size so that one ridge fits all.
        middle, *sizes = self.scale
        x, v, a = (
            signal / size
            for signal, size in zip(
                (m.position - middle, m.velocity, m.acceleration), sizes, strict=True
            )
        )
        inputs = {
            "position": [x],
            "velocity": [v],
            "acceleration": [a],
            "rectified velocity": [np.maximum(v, 0.0)],
            "speed": [np.abs(v) * v, np.tanh(3.0 * v)],
            "position squared": [x * x],
            "position cubed": [x**3],
            "position and velocity": [x * np.maximum(v, 0.0), x * np.minimum(v, 0.0)],
            "speed squared": [np.maximum(v, 0.0) ** 2],
        }
        self._rows = columns.rows
        self._spectra: list[np.ndarray] = []
        self._owners: list[str] = []
        windows = lag_windows(self._rows.frequency)
        for name, signals in inputs.items():
            for signal in signals:
                spectrum = self._rows.spectrum(signal)
                for window in windows:
                    self._spectra.append(spectrum * window)
                    self._owners.append(name)

    def remainder(
        self,
        fitter: Fitter,
        residual: np.ndarray,
        plain: np.ndarray,
        parts: tuple[np.ndarray, np.ndarray],
        surrogates: np.ndarray | None = None,
    ) -> Remainder:
        """Return what the bank predicts of this residual.

        Parameters
        ----------
        fitter
            Whose whitening applies.
        residual
            Whitened, shape (rows.count,).
        plain
            Plain, shape (rows.count,).
        parts
            Two masks of rows; each in turn is for training, the other for scoring.
        surrogates
            Of the noise in the fitted rows, shape (rows.used.sum(), draws); None leaves
            `Remainder.by_chance` at 0.
        """
        matrix = self.whitened()
        shares = [
            cross_score(matrix, residual, train, test) for train, test in (parts, parts[::-1])
        ]
        by_input = {}
        for name in dict.fromkeys(self._owners):
            own = matrix[:, [owner == name for owner in self._owners]]
            by_input[name] = float(
                np.mean(
                    [
                        cross_score(own, residual, train, test)
                        for train, test in (parts, parts[::-1])
                    ]
                )
            )
        unfiltered = np.column_stack([self._rows.plain(s) for s in self._spectra])
        plain_share = float(
            np.mean(
                [
                    cross_score(unfiltered, plain, train, test)
                    for train, test in (parts, parts[::-1])
                ]
            )
        )
        share = float(np.mean(shares))
        predicted = self.cross_predicted(residual, parts, matrix, unfiltered)
        chance = 0.0
        if surrogates is not None:
            noise = np.zeros((len(residual), surrogates.shape[1]), dtype=surrogates.dtype)
            noise[fitter.rows.used] = surrogates
            scores = [
                cross_score(matrix, noise, train, test) for train, test in (parts, parts[::-1])
            ]
            chance = exceeded_by_chance(np.mean(scores, axis=0))
        used = fitter.rows.used
        own, made = self.cross_predicted(residual, parts, matrix), predicted
        reliable = share * float(np.var(residual[used])) / max(float(np.var(own[used])), 1e-30)
        torque_share = float(np.var(made[used]) / np.var(fitter.plain_target[used]))
        return Remainder(
            share,
            float(min(shares)),
            by_input,
            plain_share,
            torque_share * min(max(reliable, 0.0), 1.0),
            chance,
        )

    def whitened(self) -> np.ndarray:
        """Return the whitened regressors, shape (rows.count, size)."""
        return np.column_stack([self._rows.whitened(s) for s in self._spectra])

    def cross_predicted(
        self,
        target: np.ndarray,
        parts: tuple[np.ndarray, np.ndarray],
        known: np.ndarray | None = None,
        made: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return what each half of the rows predicts of the other, and both of the rows between.

        Parameters
        ----------
        target
            Rows to learn from, shape (rows.count,).
        parts
            Two masks of rows.
        known
            Regressors that learn, shape (rows.count, size); None for the plain ones.
        made
            Regressors that the prediction is made of; None for those that learn.

        Returns
        -------
        np.ndarray
            Shape (rows.count,).
        """
        matrix = (
            np.column_stack([self._rows.plain(s) for s in self._spectra])
            if known is None
            else known
        )
        other = matrix if made is None else made
        predicted = []
        for train in parts:
            index = np.flatnonzero(train)
            scale = _size(matrix[index])
            ridge = _tuned(matrix, target, index)
            weights = _weights(matrix[index] / scale, target[index], ridge)
            predicted.append(other @ (weights / scale))
        first, second = parts
        return np.where(first, predicted[1], np.where(second, predicted[0], 0.5 * sum(predicted)))

    def learn(self, plain: np.ndarray) -> np.ndarray:
        """Weights with which the bank predicts this plain residual [N.m], shape (rows.count,); the
        ridge as in `cross_score`.
        """
        matrix = np.column_stack([self._rows.plain(s) for s in self._spectra])
        index = np.flatnonzero(self._rows.used)
        scale = _size(matrix[index])
        return _weights(matrix[index] / scale, plain[index], _tuned(matrix, plain, index)) / scale

    def prediction(self, weights: np.ndarray) -> np.ndarray:
        """Spectrum of the torque that these weights predict here, as `Rows.spectrum`."""
        return np.tensordot(weights, np.stack(self._spectra), axes=1)


def cross_score(matrix: np.ndarray, target: np.ndarray, train: np.ndarray, test: np.ndarray) -> Any:
    """Share of the target's power on `test` rows predicted by ridge regression on `train` rows; may
    be negative.

    The ridge is chosen on the last third of the training rows, never on the test rows.

    Parameters
    ----------
    matrix
        Regressors, shape (rows, size).
    target
        Shape (rows,), or (rows, count) for many targets at once, which share a ridge.
    train, test
        Masks of rows, each bool, shape (rows,).

    Returns
    -------
    Any
        A float, or an array of shape (count,).
    """
    index = np.flatnonzero(train)
    score = _score(matrix, target, index, np.flatnonzero(test), _tuned(matrix, target, index))
    return float(score) if target.ndim == 1 else score


def _tuned(matrix: np.ndarray, target: np.ndarray, index: np.ndarray) -> float:
    """Return ridge that does best on the last third of these rows when fitted to the first two."""
    cut = 2 * len(index) // 3
    scores = [
        float(np.mean(_score(matrix, target, index[:cut], index[cut:], ridge))) for ridge in _RIDGES
    ]
    return _RIDGES[int(np.argmax(scores))]


def _score(
    matrix: np.ndarray, target: np.ndarray, train: np.ndarray, test: np.ndarray, ridge: float
) -> Any:
    scale = _size(matrix[train])
    weights = _weights(matrix[train] / scale, target[train], ridge)
    error = target[test] - (matrix[test] / scale) @ weights
    power = np.sum(target[test] ** 2, axis=0)
    return 1.0 - np.sum(error**2, axis=0) / np.maximum(power, 1e-30)


def _size(matrix: np.ndarray) -> np.ndarray:
    """Return the root mean square of each column; 1 for empty ones."""
    scale = np.sqrt(np.mean(matrix**2, axis=0))
    scale[scale == 0] = 1.0
    return scale


def _weights(known: np.ndarray, target: np.ndarray, ridge: float) -> np.ndarray:
    """Return the weights of a ridge regression on columns of unit size."""
    gram = known.T @ known / len(known)
    return np.linalg.solve(gram + ridge * np.eye(len(gram)), known.T @ target / len(known))


def lag_windows(frequency: np.ndarray) -> list[np.ndarray]:
    """Return the frequency responses of triangular windows between neighbouring lags."""
    windows = []
    lags = np.array(LAGS_S)
    for k in range(len(lags)):
        left = lags[k] - lags[k - 1] if k else 0.01
        right = lags[k + 1] - lags[k] if k + 1 < len(lags) else 0.2
        t = np.linspace(lags[k] - left, lags[k] + right, 41)
        height = np.where(t < lags[k], (t - lags[k] + left) / left, (lags[k] + right - t) / right)
        height = height / height.sum()
        windows.append(np.exp(-2j * np.pi * np.outer(frequency, t)) @ height)
    return windows
