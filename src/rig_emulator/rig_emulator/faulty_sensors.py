"""Sensors of the plate that fail on request."""

from __future__ import annotations

import math

import numpy as np

from rig_emulator.faults import Faults

TORQUE_RANGE = 100.0
"""[N.m] End of the range of the torque sensor: beyond what a seated subject's ankle can do."""
TORQUE_NOISE = 0.14
"""[N.m] Standard deviation that is left of a dead torque sensor: the rig's own noise."""
SPIKE_SIZE = 0.3
"""[rad] Size of a spike of the position."""
SWING_FREQUENCY = 8.0
"""[Hz] Frequency of a torque that swings."""
SWING_SIZE = 100.0
"""[N.m] Amplitude of a torque that swings, for a switch at 1."""


class FaultySensors:
    """Changes samples as the switches say.

    Parameters
    ----------
    rate
        Sampling rate [Hz].
    seed
        Seed of all that is random.
    """

    def __init__(self, rate: float, seed: int) -> None:
        self._rate = rate
        self._random = np.random.default_rng(seed)
        self._count = 0
        self._stuck_at: float | None = None
        self._position = 0.0

    def change(self, samples: np.ndarray, faults: Faults) -> np.ndarray:
        """Return what the sensors show.

        Parameters
        ----------
        samples
            True position [rad], velocity [rad/s], torque [N.m], shape (n, 3).
        faults
            The faults that are switched on.

        Returns
        -------
        np.ndarray
            Shape (n, 3).
        """
        shown = np.array(samples)
        time = (self._count + np.arange(len(shown))) / self._rate
        self._count += len(shown)
        if not faults.encoder_stuck:
            self._stuck_at = None
        elif self._stuck_at is None:
            self._stuck_at = self._position
        if self._stuck_at is not None:
            shown[:, 0], shown[:, 1] = self._stuck_at, 0.0
        shown[:, 0] += faults.encoder_slip
        spikes = self._random.random(len(shown)) < faults.encoder_spikes
        shown[spikes, 0] += SPIKE_SIZE
        if faults.velocity_stuck:
            shown[:, 1] = 0.0
        if faults.torque_dead:
            shown[:, 2] = self._random.normal(0.0, TORQUE_NOISE, len(shown))
        if faults.torque_saturated:
            shown[:, 2] = TORQUE_RANGE
        if faults.torque_swings:
            size = SWING_SIZE * faults.torque_swings
            shown[:, 2] = size * np.sin(2 * math.pi * SWING_FREQUENCY * time)
        if faults.nan:
            shown[:] = np.nan
        self._position = float(samples[-1, 0])
        return shown
