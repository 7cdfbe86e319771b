"""Gains of terms that a model marks as tracked, estimated beside K, B, I and G.

The torque of a term of unit size along the motion is one more regressor of the joint's torque:

    torque = K x + B v + I a + g reflex + sum_j s_j torque_j + n

with s_j = 1 for the size that the calibration found. Torque and regressors pass one band-pass and
are summed up in blocks of a second over `MEMORY`; what the reference explains of the regressors
takes their place where it is known (two-stage least squares), as torque that moves the plate would
bias them. Standard errors come from the scatter of the blocks' scores.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
from scipy import linalg, signal

from ankle_physics.linear_dynamics import SecondOrder
from impedance_estimator.simultaneous.block_update import RESPONSE_SAMPLES
from impedance_estimator.simultaneous.nuisance import (
    REFERENCE_FILTER_DAMPING,
    REFERENCE_FILTER_HZ,
)
from impedance_estimator.simultaneous.voluntary_torque_noise import LOW_CORNER, NOISE_MODELS

BAND_END = 40.0
"""[Hz] A perturbation moves the ankle below; beyond it there is noise of acceleration."""
DECIMATED_RATE = 128.0
"""[Hz] Three times the band."""
MEMORY = 30
"""Blocks of a second. Terms that are tracked change within a hold period, not within a stretch, and
few of them are told from K by less than fifty perturbations."""
FEWEST_BLOCKS = 10
"""With fewer the scatter of the blocks does not tell a standard error."""
PRIOR_DEVIATION = 1.0
"""A tracked size is expected about the calibrated one by as much as itself."""
INSTRUMENT_RIDGE = 1e-9
"""Share of the instruments' own power that keeps a reference at rest from dividing by zero."""


class _Block(NamedTuple):
    """Holds sums over one second of instruments Z, regressors X and torque y.

    Attributes
    ----------
    zz, zx, zy, xx, xy, yy
        Z'Z, Z'X, Z'y, X'X, X'y and y'y.
    referenced
        Whether the reference is known for the whole block.
    """

    zz: np.ndarray
    zx: np.ndarray
    zy: np.ndarray
    xx: np.ndarray
    xy: np.ndarray
    yy: float
    referenced: bool


class TrackedGains:
    """Estimates the sizes of tracked terms from corrected samples.

    Parameters
    ----------
    count
        Number of tracked terms.
    rate
        Sampling rate [Hz].

    Attributes
    ----------
    sizes
        Of each term in units of the calibrated one [1], shape (count,).
    errors
        Their standard errors [1], shape (count,); NaN before there are enough data.
    """

    def __init__(self, count: int, rate: float) -> None:
        self.sizes: np.ndarray = np.ones(count)
        self.errors: np.ndarray = np.full(count, np.nan)
        self._rate = rate
        self._every = max(round(rate / DECIMATED_RATE), 1)
        self._per_block = round(rate / self._every)
        corner, order = NOISE_MODELS[LOW_CORNER]
        self._sections = signal.butter(order, [corner, BAND_END], "bandpass", fs=rate, output="sos")
        self._blocks: deque[_Block] = deque(maxlen=MEMORY)
        self._restart()

    def _restart(self) -> None:
        """Forget the filters' states and the unfinished block."""
        self._actuator = SecondOrder(self._rate)
        self._start: np.ndarray | None = None
        self._last: np.ndarray | None = None
        self._phase = 0
        self._waiting: list[np.ndarray] = []
        self._known: list[np.ndarray] = []

    def add(
        self,
        motion: np.ndarray,
        torque: np.ndarray,
        columns: np.ndarray,
        reference: np.ndarray,
        commanded: np.ndarray,
    ) -> None:
        """Take in samples; a sample that is not finite begins a new stretch.

        Parameters
        ----------
        motion
            Position [rad] of the joint, and its velocity [rad/s] where it is measured, shape (1, n)
            or (2, n).
        torque
            [N.m], tracked terms included, shape (n,).
        columns
            Torque of the calibrated reflex and of each tracked term along the motion [N.m], shape
            (1 + count, n).
        reference
            Commanded position [rad], NaN where there is none, shape (n,).
        commanded
            As `columns`, along the motion that the reference commands.
        """
        good = np.isfinite(motion).all(axis=0) & np.isfinite(torque)
        measured = len(motion) == 2
        # Without a velocity channel the position stands there until it is differentiated.
        signals = np.vstack([torque, motion[0], motion[-1], columns, reference, commanded])
        edges = np.flatnonzero(np.diff(good.astype(int))) + 1
        for part in np.split(np.arange(len(torque)), edges):
            if not len(part):
                continue
            if good[part[0]]:
                self._advance(signals[:, part], len(columns), measured)
            else:
                self._restart()

    def _advance(self, signals: np.ndarray, count: int, measured: bool) -> None:
        torque, x, v = signals[:3]
        reference = signals[3 + count]
        known = np.isfinite(reference)
        if self._start is None:
            self._start = np.array([x[0], np.where(known, reference, x[0])[0]])
        command = np.where(known, reference, self._start[1]) - self._start[1]
        omega = 2.0 * np.pi * REFERENCE_FILTER_HZ
        nominal = self._actuator.run_with_rates(command, omega, REFERENCE_FILTER_DAMPING)
        rows = np.vstack(
            [torque, x - self._start[0], v, signals[3 : 3 + count], nominal, signals[4 + count :]]
        )
        if self._last is None:
            self._last = np.repeat(rows[:, :1], 2, axis=1)
            steady = signal.sosfilt_zi(self._sections)[:, None, :]
            begin = rows[:, 0].copy()
            if not measured:
                begin[2] = 0.0
            self._states = steady * begin[None, :, None]
            self._acceleration_state = np.zeros((len(self._sections), 2))
        joined = np.concatenate([self._last, rows], axis=1)
        self._last = joined[:, -2:]
        middle = joined[:, 1:-1].copy()
        slope = 0.5 * self._rate * (joined[2, 2:] - joined[2, :-2])
        acceleration = slope
        if not measured:
            middle[2] = slope
            acceleration = self._rate**2 * (joined[2, 2:] - 2.0 * joined[2, 1:-1] + joined[2, :-2])
        passed, self._states = signal.sosfilt(self._sections, middle, axis=1, zi=self._states)
        a, self._acceleration_state = signal.sosfilt(
            self._sections, acceleration, zi=self._acceleration_state
        )
        kept = np.arange((-self._phase) % self._every, x.size, self._every)
        self._phase = (self._phase + x.size) % self._every
        # Torque; x, v, a, reflex and terms; the same of the reference.
        ordered = np.vstack([passed[:3], a, passed[3:]])[:, kept]
        self._waiting.append(ordered)
        self._known.append(known[kept])
        self._finish_blocks(3 + count)

    def _finish_blocks(self, unknowns: int) -> None:
        waiting = np.concatenate(self._waiting, axis=1)
        known = np.concatenate(self._known)
        size = self._per_block
        while waiting.shape[1] >= size:
            y, X, Z = np.split(waiting[:, :size], [1, 1 + unknowns])
            self._blocks.append(
                _Block(
                    Z @ Z.T,
                    Z @ X.T,
                    Z @ y[0],
                    X @ X.T,
                    X @ y[0],
                    float(y[0] @ y[0]),
                    bool(known[:size].all()),
                )
            )
            waiting, known = waiting[:, size:], known[size:]
        self._waiting, self._known = [waiting], [known]

    def update(self) -> None:
        """Estimate the sizes anew from the memory."""
        if len(self._blocks) < FEWEST_BLOCKS:
            return
        referenced = all(block.referenced for block in self._blocks)
        zx = sum((b.zx if referenced else b.xx for b in self._blocks), 0.0)
        zz = sum((b.zz if referenced else b.xx for b in self._blocks), 0.0)
        zy = sum((b.zy if referenced else b.xy for b in self._blocks), 0.0)
        xx, xy, yy = (sum(getattr(b, name) for b in self._blocks) for name in ("xx", "xy", "yy"))
        try:
            found = self._solved(np.asarray(zz), np.asarray(zx), np.asarray(zy), xx, xy, yy)
        except linalg.LinAlgError:
            # A plate that rests tells nothing: what was found before stays.
            return
        unknowns, inverse, explain = found
        scores = np.array(
            [
                explain.T @ (b.zy - b.zx @ unknowns if referenced else b.xy - b.xx @ unknowns)
                for b in self._blocks
            ]
        )
        count = len(self.sizes)
        spread = len(scores) / (len(scores) - 1.0)
        covariance = spread * inverse @ (scores.T @ scores) @ inverse
        self.sizes = unknowns[-count:]
        self.errors = np.sqrt(np.diag(covariance))[-count:]

    def _solved(
        self,
        zz: np.ndarray,
        zx: np.ndarray,
        zy: np.ndarray,
        xx: np.ndarray,
        xy: np.ndarray,
        yy: float,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the unknowns, the inverse of the normal matrix, and the regressors by instruments.

        Raises
        ------
        scipy.linalg.LinAlgError
            The signals do not tell the unknowns.
        """
        scale = 1.0 / np.sqrt(np.maximum(np.diag(zz), 1e-300))
        factor = linalg.cho_factor(scale[:, None] * zz * scale + INSTRUMENT_RIDGE * np.eye(len(zz)))
        explain = scale[:, None] * linalg.cho_solve(factor, scale[:, None] * zx)
        normal, right = explain.T @ zx, explain.T @ zy
        count = len(self.sizes)
        prior = np.zeros(len(normal))
        mean = np.concatenate([np.zeros(len(normal) - count), np.ones(count)])
        variance = yy / (len(self._blocks) * self._per_block)
        for _ in range(2):
            prior[-count:] = RESPONSE_SAMPLES * variance / PRIOR_DEVIATION**2
            matrix = normal + np.diag(prior)
            size = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
            whole = linalg.cho_factor(size[:, None] * matrix * size)
            inverse = size[:, None] * linalg.cho_solve(whole, np.diag(size))
            unknowns = inverse @ (right + prior * mean)
            rest = yy - 2.0 * unknowns @ xy + unknowns @ xx @ unknowns
            # The first round takes all torque for noise, and so the prior for too strong.
            variance = max(rest, 0.0) / (len(self._blocks) * self._per_block)
        return unknowns, inverse, explain
