"""The subject's own torque: the measured torque without what the perturbation adds to it.

    voluntary = low-pass( torque - K position - G max(velocity, 0) delayed )           [N.m]

The paper shows low-pass filtered torque (van 't Veld et al. 2018, figure 8). Its perturbation of
0.04 rad makes an ankle of K = 100 push back by 4 N.m, at random times. For a simulated subject who
pushes 5 N.m, the low-pass alone shows 7.4 +- 1.8 N.m, more than the target band is wide; with what
the present estimates of K and G (5 % wrong) explain taken off first, 4.9 +- 0.1 N.m. What B and I
add is below 0.1 N.m after the low-pass: velocity and acceleration of a movement from rest to rest
have no mean.

The subject's own torque has the opposite sign of the measured one: pushing the toes down
(plantarflexion, negative) needs a dorsiflexing torque of the rig to hold the foot.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import signal

CUTOFF = 1.0
"""[Hz] Cut-off frequency of a second-order Butterworth filter: it delays by 0.23 s, about a
reaction time, and leaves the perturbation a fifth of what it adds."""
REFLEX_LAG = 0.116
"""[s] Mean delay of the reflex torque behind the stretch: 40 ms of nerve and 2 z / w = 76 ms of
muscle (paper, figure 1 and section III-A: w = 21 rad/s, z = 0.8)."""


class VoluntaryTorque:
    """Follows the samples of one rig.

    Parameters
    ----------
    cutoff
        Cut-off frequency of the low-pass [Hz].

    Attributes
    ----------
    value
        The subject's torque [N.m], plantarflexion negative; NaN before the first sample.
    """

    def __init__(self, cutoff: float = CUTOFF) -> None:
        self._cutoff = cutoff
        self._rate = 0.0
        self._sos = np.empty((0, 6))
        self._memory: np.ndarray | None = None
        self._stretches = np.empty(0)
        self.value = math.nan

    def feed(self, samples: np.ndarray, rate: float, K: float, G: float) -> None:
        """Process samples.

        Parameters
        ----------
        samples
            Position [rad], velocity [rad/s], torque [N.m], shape (n, 3); rows that are not finite
            are left out.
        rate
            Sampling rate [Hz].
        K, G
            Present estimates [N.m/rad], [N.m.s/rad]; NaN takes nothing off.
        """
        samples = samples[np.isfinite(samples).all(axis=1)]
        if not len(samples):
            return
        position, velocity, torque = samples.T
        K, G = (value if math.isfinite(value) else 0.0 for value in (K, G))
        started = self._memory is None or rate != self._rate
        if started:
            self._stretches = np.zeros(round(REFLEX_LAG * rate))
        stretches = np.concatenate([self._stretches, np.maximum(velocity, 0.0)])
        self._stretches = stretches[len(samples) :]
        left = torque - K * position - G * stretches[: len(samples)]
        if started:
            self._rate = rate
            self._sos = signal.butter(2, self._cutoff, fs=rate, output="sos")
            self._memory = signal.sosfilt_zi(self._sos) * left[0]
        smooth, self._memory = signal.sosfilt(self._sos, left, zi=self._memory)
        self.value = -float(smooth[-1])
