"""Sensors of the plate that fail on request."""

from __future__ import annotations

import math

import numpy as np

from ankle_interfaces.ankle_range import PASSIVE_RANGE
from rig_emulator.faults import Faults

TORQUE_RANGE = 100.0
"""[N.m] End of the range of the torque sensor: beyond what a seated subject's ankle can do."""
TORQUE_NOISE = 0.14
"""[N.m] Standard deviation that is left of a dead torque sensor: the rig's own noise."""
POSITION_RANGE = PASSIVE_RANGE
"""[rad] End of the range of the encoder."""
VELOCITY_RANGE = 10.0
"""[rad/s] End of the range of the velocity sensor: twice the largest velocity that is allowed."""
SPIKE_SIZE = np.array([0.3, 3.0, 50.0])
"""[rad, rad/s, N.m] Size of a spike of position, velocity and torque."""
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
        self._torque_stuck_at: float | None = None
        self._position = self._last_torque = 0.0

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
        self._hold(shown, faults)
        shown[:, 0] += faults.encoder_slip
        self._spike(shown, faults)
        if faults.velocity_stuck:
            shown[:, 1] = 0.0
        if faults.torque_dead:
            shown[:, 2] = self._random.normal(0.0, TORQUE_NOISE, len(shown))
        if faults.torque_swings:
            size = SWING_SIZE * faults.torque_swings
            shown[:, 2] = size * np.sin(2 * math.pi * SWING_FREQUENCY * time)
        self._put_at_the_end(shown, faults)
        self._position, self._last_torque = float(samples[-1, 0]), float(samples[-1, 2])
        return shown

    def _hold(self, shown: np.ndarray, faults: Faults) -> None:
        """Let position and torque stay where they were when their switch was set."""
        if not faults.encoder_stuck:
            self._stuck_at = None
        elif self._stuck_at is None:
            self._stuck_at = self._position
        if self._stuck_at is not None:
            shown[:, 0], shown[:, 1] = self._stuck_at, 0.0
        if not faults.torque_stuck:
            self._torque_stuck_at = None
        elif self._torque_stuck_at is None:
            self._torque_stuck_at = self._last_torque
        if self._torque_stuck_at is not None:
            shown[:, 2] = self._torque_stuck_at

    def _spike(self, shown: np.ndarray, faults: Faults) -> None:
        parts = (faults.encoder_spikes, faults.velocity_spikes, faults.torque_spikes)
        for column, part in enumerate(parts):
            if part:
                spikes = self._random.random(len(shown)) < part
                shown[spikes, column] += SPIKE_SIZE[column]

    @staticmethod
    def _put_at_the_end(shown: np.ndarray, faults: Faults) -> None:
        """Saturate channels, or make them no numbers."""
        ends = (
            (faults.position_saturated, POSITION_RANGE),
            (faults.velocity_saturated, VELOCITY_RANGE),
            (faults.torque_saturated, TORQUE_RANGE),
            (faults.position_nan, math.nan),
            (faults.velocity_nan, math.nan),
            (faults.torque_nan, math.nan),
        )
        for number, (switched_on, value) in enumerate(ends):
            if switched_on:
                shown[:, number % 3] = value
        if faults.nan:
            shown[:] = math.nan
