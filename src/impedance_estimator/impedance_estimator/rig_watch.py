"""The rig file in force is held against the running signals once in a while."""

from __future__ import annotations

from datetime import datetime, timezone

import numpy as np

from ankle_physics.rig_agreement import rig_warnings
from ankle_physics.rig_file import RigFile

WATCHED_DURATION = 20.0
"""[s] Stretch of samples that is judged: 30 perturbations give a delay to 0.02 ms."""
WATCH_PERIOD = 60.0
"""[s] From one judgement to the next: a rig does not change by the second."""


class RigWatch:
    """Collects samples and says in which ways a rig file is old or contradicts them.

    Parameters
    ----------
    rig
        The file in force.
    rate
        Sampling rate [Hz].
    measured_velocity
        Whether samples have a velocity.

    Attributes
    ----------
    warnings
        One sentence each, of the newest judgement.
    """

    def __init__(self, rig: RigFile, rate: float, measured_velocity: bool) -> None:
        self._rig = rig
        self._rate = rate
        self._measured = measured_velocity
        self._waiting: list[np.ndarray] = []
        self._held = 0
        self._skipped = 0
        self.warnings: list[str] = []

    def add(self, samples: np.ndarray) -> list[str]:
        """Take in samples, and return what was not said before.

        Parameters
        ----------
        samples
            Shape (n, k): time [s], position [rad], velocity [rad/s] where measured, torque [N.m].
        """
        if self._skipped > 0:
            self._skipped -= len(samples)
            return []
        good = np.isfinite(samples[:, : 3 + self._measured]).all(axis=1)
        if not good.all():
            self._waiting, self._held = [], 0
            return []
        self._waiting.append(samples)
        self._held += len(samples)
        if self._held < WATCHED_DURATION * self._rate:
            return []
        known = set(self.warnings)
        self.warnings = self._judge(np.concatenate(self._waiting))
        self._waiting, self._held = [], 0
        self._skipped = round((WATCH_PERIOD - WATCHED_DURATION) * self._rate)
        return [sentence for sentence in self.warnings if sentence not in known]

    def _judge(self, samples: np.ndarray) -> list[str]:
        return rig_warnings(
            self._rig,
            self._rate,
            samples[:, 1],
            samples[:, 2] if self._measured else None,
            samples[:, 2 + self._measured],
            datetime.fromtimestamp(float(samples[-1, 0]), timezone.utc),
        )
