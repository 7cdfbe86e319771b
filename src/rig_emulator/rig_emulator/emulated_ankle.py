"""The simulated ankle on the emulated rig, and sensors that can fail."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ankle_sim.live_rig import LiveRig, Setup
from rig_emulator.faults import Faults

TORQUE_RANGE = 100.0
"""[N.m] End of the range of the torque sensor: beyond what a seated person's ankle can do."""


class EmulatedAnkle:
    """The rig that `ankle_sim` runs, with the controller's command as its reference.

    Parameters
    ----------
    setup
        Rig, subject, sensors.
    rate
        Of the servo [Hz].
    noisy
        Whether the samples have sensor noise.
    tell
        Called with a sentence when something happens that a person should know.

    Attributes
    ----------
    faults
        Switches; only those of the sensors count here.
    """

    def __init__(self, setup: Setup, rate: float, noisy: bool, tell: Callable[[str], None]) -> None:
        self.faults = Faults()
        self._rig = LiveRig(setup, tell, noisy)
        self._rate = rate
        self._count = 0
        self._stuck_at: float | None = None
        self._position = 0.0
        self._rig.noise_deviations(rate)

    def run(self, command: np.ndarray) -> np.ndarray:
        """See `emulated_device.Plant`; at least two samples at the first call."""
        time = np.arange(self._count, self._count + len(command)) / self._rate
        self._count += len(command)
        samples = np.concatenate([stretch.samples for stretch in self._rig.take(time, command)])
        if not self.faults.encoder_stuck:
            self._stuck_at = None
        elif self._stuck_at is None:
            self._stuck_at = self._position
        if self._stuck_at is not None:
            samples[:, 0], samples[:, 1] = self._stuck_at, 0.0
        if self.faults.torque_saturated:
            samples[:, 2] = TORQUE_RANGE
        self._position = float(samples[-1, 0])
        return samples
