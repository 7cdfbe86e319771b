"""The simulated ankle on the emulated rig, and sensors that can fail."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ankle_sim.live_rig import LiveRig, Setup
from rig_emulator.faults import Faults
from rig_emulator.faulty_sensors import FaultySensors


class EmulatedAnkle:
    """Simulates the rig that `ankle_sim` runs, with the controller's command as its reference.

    Parameters
    ----------
    setup
        Rig, subject and sensors that are emulated.
    rate
        Of the servo [Hz].
    noisy
        Whether the samples have sensor noise.
    tell
        Called with a sentence when something happens that the operator should know.

    Attributes
    ----------
    faults
        Switches; only those of the sensors count here.
    """

    def __init__(self, setup: Setup, rate: float, noisy: bool, tell: Callable[[str], None]) -> None:
        self.faults = Faults()
        self._rig = LiveRig(setup, tell, noisy)
        self._sensors = FaultySensors(rate, setup.seed)
        self._rate = rate
        self._count = 0
        self._rig.noise_deviations(rate)

    def run(self, command: np.ndarray) -> np.ndarray:
        """See `emulated_device.Plant`; at least two samples at the first call."""
        time = np.arange(self._count, self._count + len(command)) / self._rate
        self._count += len(command)
        samples = np.concatenate([stretch.samples for stretch in self._rig.take(time, command)])
        return self._sensors.change(samples, self.faults)
