"""The activity of each muscle now: high-passed, rectified, smoothed EMG.

    activity = low-pass( | high-pass(EMG) | )                                        [V]

The high-pass is that of the reflex' measurement (20 Hz, van 't Veld et al. 2018, section III-B.3):
an electrode's offset is no activity.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import signal

from emg_driver.rectification import Rectifier

HIGHPASS, HIGHPASS_ORDER = 20.0, 2
"""[Hz] Cut-off and order of the high-pass, as those of the EMG processor."""
SMOOTHING = 1.0
"""[Hz] Cut-off frequency of a first-order low-pass: rectified noise then scatters by a tenth of its
mean, and a window of activity can be held."""


class MuscleActivity:
    """Follows the EMG of some channels.

    Parameters
    ----------
    names
        Names of the channels.

    Attributes
    ----------
    values
        Activity by channel [V]; empty before the first whole block.
    """

    def __init__(self, names: tuple[str, ...]) -> None:
        self._names = names
        self._rate = 0.0
        self._rectifier: Rectifier | None = None
        self._low: tuple[np.ndarray, np.ndarray] = np.empty(0), np.empty(0)
        self._memory = np.empty(0)
        self._fresh = np.empty(0, dtype=bool)
        self.values: dict[str, float] = {}

    def feed(self, samples: np.ndarray, rate: float) -> None:
        """Process EMG [V], shape (n, channels), sampled at a rate [Hz].

        What is not finite, and what follows it until the filter has settled, is left out.
        """
        if not len(samples) or rate <= 2.0 * HIGHPASS:
            return
        channels = samples.shape[1]
        if self._rectifier is None or rate != self._rate or channels != len(self._fresh):
            self._rate = rate
            self._rectifier = Rectifier(rate, channels, HIGHPASS, HIGHPASS_ORDER)
            pole = math.exp(-2.0 * math.pi * SMOOTHING / rate)
            self._low = np.array([1.0 - pole]), np.array([1.0, -pole])
            self._memory, self._fresh = np.zeros(channels), np.full(channels, True)
        rectified = self._rectifier.run(samples)
        for channel, name in zip(range(channels), self._names, strict=False):
            good = rectified[np.isfinite(rectified[:, channel]), channel]
            if not len(good):
                continue
            if self._fresh[channel]:
                self._fresh[channel] = False
                self._memory[channel] = self._low[1][1] * -good.mean()
            smooth, memory = signal.lfilter(
                *self._low, good, zi=self._memory[channel : channel + 1]
            )
            self._memory[channel] = memory[0]
            self.values = {**self.values, name: float(smooth[-1])}
