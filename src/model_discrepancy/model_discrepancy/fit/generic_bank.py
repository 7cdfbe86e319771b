"""A bank of generic nonlinear regressors shows what is still predictable.

It is trained on one part of the recording and scored on the other.

The regressors know no physics: products of position, velocity and their rectified versions, each
through a set of overlapping lag windows. What they predict of a residual on data that they were
not trained on is structure that the model lacks, whatever its name. A bank over time (position and
velocity times a slow course) predicts what a joint that drifts or tires does. A bank over preceding
torque (position and velocity times what the muscles held before each movement) predicts what a
joint does whose stiffness or reflex follows its activation. They are banks of their own, because
regressors that have nothing to tell make the others predict less.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from model_discrepancy.fit.columns import Columns

# What responses may change with.
Over = Literal["time", "preceding torque"]
# Lag windows: from just before the movement (a torque channel that runs ahead) to beyond the
# reflex.
LAGS_S = (-0.01, 0.0, 0.01, 0.02, 0.035, 0.05, 0.075, 0.1, 0.14, 0.19, 0.26, 0.36, 0.5)
# Candidates for the ridge per mean square of a column; chosen on training stretches only.
RIDGES = (1e-4, 1e-3, 1e-2, 1e-1)


class GenericBank:
    """Holds the bank for one recording.

    Parameters
    ----------
    columns
        Of the recording.
    like
        A bank of another recording whose weights are to be used here; None scales by this
        recording.
    over
        What the responses change with: slowly with time, or with the torque that the muscles held
        before each movement. The bank holds such responses alone. What it learns holds for this
        recording only. None for responses that stay the same.

    Raises
    ------
    ValueError
        Where preceding torque is asked for and not known.

    Attributes
    ----------
    scale
        Mean angle [rad] and size of position, velocity, acceleration [rad, rad/s, rad/s^2] that
        count as one.
    inputs
        Name of the input of each regressor.
    """

    def __init__(
        self, columns: Columns, like: GenericBank | None = None, over: Over | None = None
    ) -> None:
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
        if over == "time":
            inputs = _changing(x, v)
        elif over == "preceding torque":
            if m.preceding is None:
                raise ValueError("nobody knows what the muscles held before each movement")
            inputs = _following(x, v, m.preceding)
        else:
            inputs = _constant(x, v, a)
        self._rows = columns.rows
        self._spectra: list[np.ndarray] = []
        self.inputs: list[str] = []
        windows = lag_windows(self._rows.frequency)
        for name, signals in inputs.items():
            for signal in signals:
                spectrum = self._rows.spectrum(signal)
                for window in windows:
                    self._spectra.append(spectrum * window)
                    self.inputs.append(name)

    def whitened(self) -> np.ndarray:
        """Return the whitened regressors, shape (rows.count, size)."""
        return np.column_stack([self._rows.whitened(s) for s in self._spectra])

    def plain(self) -> np.ndarray:
        """Return the plain regressors, shape (rows.count, size)."""
        return np.column_stack([self._rows.plain(s) for s in self._spectra])

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
        matrix = self.plain() if known is None else known
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

    def unpredicted(self, noise: np.ndarray, parts: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        """Return whitened noise without what the bank predicts of it, shape (rows.count,); as it is
        where either half predicts nothing of the other.

        Parameters
        ----------
        noise
            Shape (rows.count,).
        parts
            Two masks of rows.
        """
        matrix = self.whitened()
        shares = [cross_score(matrix, noise, train, test) for train, test in (parts, parts[::-1])]
        return noise if min(shares) <= 0.0 else noise - self.cross_predicted(noise, parts, matrix)

    def learn(self, plain: np.ndarray) -> np.ndarray:
        """Return the weights with which the bank predicts this plain residual [N.m], shape
        (rows.count,); the ridge as in `cross_score`.
        """
        matrix = self.plain()
        index = np.flatnonzero(self._rows.used)
        scale = _size(matrix[index])
        return _weights(matrix[index] / scale, plain[index], _tuned(matrix, plain, index)) / scale

    def prediction(self, weights: np.ndarray) -> np.ndarray:
        """Return the spectrum of the torque that these weights predict here, as `Rows.spectrum`."""
        return np.tensordot(weights, np.stack(self._spectra), axes=1)


def _constant(x: np.ndarray, v: np.ndarray, a: np.ndarray) -> dict[str, list[np.ndarray]]:
    """Return the inputs of responses that stay the same, from position, velocity and acceleration
    of unit size.
    """
    return {
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


def _changing(x: np.ndarray, v: np.ndarray) -> dict[str, list[np.ndarray]]:
    """Return the inputs of responses that change slowly: by Legendre polynomials, a straight course
    and a bent one.
    """
    straight = np.linspace(-1.0, 1.0, len(x))
    courses = (straight, 1.5 * straight**2 - 0.5)
    return {
        "time and position": [course * x for course in courses],
        "time and velocity": [straight * v],
        "time and rectified velocity": [c * np.maximum(v, 0.0) for c in courses],
    }


def _following(x: np.ndarray, v: np.ndarray, preceding: np.ndarray) -> dict[str, list[np.ndarray]]:
    """Return the inputs of responses that follow what the muscles held before each movement
    [N.m].
    """
    held = preceding - preceding.mean()
    held = held / max(float(held.std()), 1e-12)
    return {
        "position times the torque held before": [held * x],
        "velocity times the torque held before": [held * v],
        "rectified velocity times the torque held before": [held * np.maximum(v, 0.0)],
    }


def cross_score(matrix: np.ndarray, target: np.ndarray, train: np.ndarray, test: np.ndarray) -> Any:
    """Return the share of the target's power on `test` rows predicted by ridge regression on
    `train` rows; may be negative.

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
    ridge = _tuned(matrix, target, index)
    (score,) = _scores(matrix, target, index, np.flatnonzero(test), (ridge,))
    return float(score) if target.ndim == 1 else score


def _tuned(matrix: np.ndarray, target: np.ndarray, index: np.ndarray) -> float:
    """Return ridge that does best on the last third of these rows when fitted to the first two."""
    cut = 2 * len(index) // 3
    scores = _scores(matrix, target, index[:cut], index[cut:], RIDGES)
    return RIDGES[int(np.argmax([float(np.mean(score)) for score in scores]))]


def _scores(
    matrix: np.ndarray,
    target: np.ndarray,
    train: np.ndarray,
    test: np.ndarray,
    ridges: Sequence[float],
) -> list[Any]:
    """Return what `cross_score` returns, for each ridge."""
    known = matrix[train]
    scale = _size(known)
    known = known / scale
    gram, right = known.T @ known / len(known), known.T @ target[train] / len(known)
    known, target = matrix[test] / scale, target[test]
    power = np.maximum(np.sum(target**2, axis=0), 1e-30)
    scores = []
    for ridge in ridges:
        error = target - known @ np.linalg.solve(gram + ridge * np.eye(len(gram)), right)
        scores.append(1.0 - np.sum(error**2, axis=0) / power)
    return scores


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
        # A polynomial in the turn from one time to the next (Horner), which takes a tenth of the
        # time of as many exponentials.
        turn, response = np.exp(-2j * np.pi * frequency * (t[1] - t[0])), np.zeros(len(frequency))
        for coefficient in height[::-1]:
            response = response * turn + coefficient
        windows.append(response * np.exp(-2j * np.pi * frequency * t[0]))
    return windows
