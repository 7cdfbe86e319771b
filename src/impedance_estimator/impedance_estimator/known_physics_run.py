"""Samples are corrected by what is known of rig and subject; each gap begins a new stretch.

The path from the sensors back to the joint is that of `known_physics`, carried out by `joint_path`.
The simultaneous estimator also gets columns of the reflex (`estimator.ReflexColumns`), along the
motion and along the motion that the reference commands: rectified velocity as a filter at the
sensor leaves it, or the torque of the calibrated reflex, whose size it then follows, not its shape.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numba import njit

from impedance_estimator.estimator import SampleLayout
from impedance_estimator.joint_path import JointPath, widened
from impedance_estimator.known_physics import KnownPhysics

LONGEST_STEP = 1.5
"""A step longer than so many sample intervals starts a new stretch."""


class KnownPhysicsRun:
    """Corrects one stream of samples; keeps all states between calls.

    Parameters
    ----------
    known
        Rig and subject.
    layout
        Of the samples, and which columns of the reflex are put behind them. Those of the torque
        need a subject with a reflex, whose torque is then not left in the samples.
    """

    def __init__(self, known: KnownPhysics, layout: SampleLayout) -> None:
        self._known = known
        self._layout = layout
        self._path: JointPath | None = None
        self._newest = np.nan
        self._tracked = len(known.tracked)
        self.tracked_torques = np.zeros((2, 1 + self._tracked, 0))
        """Torque [N.m] of the calibrated reflex and of each tracked term at its calibrated size,
        along the motion and along that of the reference, for the samples of the last call; shape
        (2, 1 + count, n)."""

    def correct(self, samples: np.ndarray) -> np.ndarray:
        """Return samples as a joint alone would give them.

        Parameters
        ----------
        samples
            Shape (n, k): time [s], position [rad], velocity [rad/s] where measured, torque [N.m],
            and where there is one the reference [rad].

        Returns
        -------
        np.ndarray
            Shape (n, k), or (n, k + 2) with columns of the reflex. Samples that are not finite are
            passed on as they are.
        """
        out = widened(samples, self._layout.reflex)
        self.tracked_torques = np.zeros((2, 1 + self._tracked, len(samples)))
        used = 4 if self._layout.measured_velocity else 3
        good, begins = _stretches(samples[:, :used], self._newest, LONGEST_STEP / self._layout.rate)
        edges = [0, *(np.flatnonzero(begins[1:]) + 1).tolist(), len(samples)]
        for first, last in pairwise(edges):
            if first == last or not good[first]:
                continue
            if begins[first] or self._path is None:
                self._path = JointPath(self._known, self._layout)
                self._path.settle(samples[first])
            out[first:last] = self._path.run(samples[first:last])
            if self._tracked:
                self.tracked_torques[:, :, first:last] = self._path.tracked_torques
        if len(samples):
            self._newest = samples[-1, 0] if good[-1] else np.nan
        return out

    @property
    def projection(self) -> float:
        """Return the share of a change of the reflex that the regression sees (`HeldTorques`)."""
        return 1.0 if self._path is None else self._path.projection

    def follow(self, stiffness: float) -> float:
        """Take over the estimated stiffness of the joint's core [N.m/rad].

        Returns
        -------
        float
            Share of a slow torque on the foot that reaches the plate [1]; 1 without straps.
        """
        if self._path is None or self._path.straps is None:
            return 1.0
        self._path.straps.follow(stiffness)
        return self._path.straps.share


@njit(cache=True)
def _stretches(samples: np.ndarray, newest: float, longest: float) -> tuple[np.ndarray, np.ndarray]:
    """Return which samples are finite, and which begin a stretch: after a gap, or not finite.

    Parameters
    ----------
    samples
        Shape (n, k), time [s] in the first column.
    newest
        Time of the sample before [s]; NaN where it was not finite or there was none.
    longest
        Step from which there is a gap [s].
    """
    good = np.empty(len(samples), np.bool_)
    begins = np.empty(len(samples), np.bool_)
    for k in range(len(samples)):
        good[k] = True
        for value in samples[k]:
            good[k] = good[k] and np.isfinite(value)
        step = samples[k, 0] - newest
        begins[k] = not (good[k] and abs(step) < longest)
        newest = samples[k, 0] if good[k] else np.nan
    return good, begins
