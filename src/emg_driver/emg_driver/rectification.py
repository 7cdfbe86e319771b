"""High-pass and rectification of EMG, block by block: ``r = |H(z) e|``, H a Butterworth high-pass.

Source: van 't Veld et al. 2018, section III-B.3 (20 Hz). The filter is causal, because it runs
online; at the 50 to 400 Hz where EMG has its power a second-order 20 Hz filter delays by less than
1 ms.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import butter, sosfilt, sosfilt_zi

from ankle_interfaces.errors import QuantityError

# Time constants of the cut-off after which a fresh filter counts as settled: exp(-6) = 0.2 % of a
# step is left.
SETTLING_TIME_CONSTANTS = 6.0


class Rectifier:
    """Rectifies EMG of m channels; the result does not depend on the size of the blocks.

    A channel's filter starts afresh behind a gap and behind samples that are not finite, and its
    output is NaN until it has
    settled: a damaged sample never reaches a later one.

    Parameters
    ----------
    rate
        Sampling rate [Hz].
    channels
        Number of channels m.
    cutoff
        Of the high-pass [Hz], below half the rate.
    order
        Order of the high-pass.

    Raises
    ------
    QuantityError
        A cut-off that the rate does not allow.
    """

    def __init__(self, rate: float, channels: int, cutoff: float, order: int) -> None:
        if not 0 < cutoff < rate / 2:
            raise QuantityError(
                f"high-pass cut-off {cutoff:g} Hz is outside 0 to {rate / 2:g} Hz (half the "
                "sampling rate)"
            )
        self._sections = butter(order, cutoff, "highpass", fs=rate, output="sos")
        self._rest = sosfilt_zi(self._sections)
        self._states = np.zeros((*self._rest.shape, channels))
        self._to_settle = math.ceil(SETTLING_TIME_CONSTANTS * rate / (2 * math.pi * cutoff))
        self._fresh = np.full(channels, True)
        self._unsettled = np.zeros(channels, dtype=int)

    def restart(self) -> None:
        """Begin afresh with the next sample, as behind a gap."""
        self._fresh[:] = True

    def run(self, emg: np.ndarray) -> np.ndarray:
        """Return rectified EMG of shape (n, m) for EMG of shape (n, m), both in V."""
        return np.abs(self.highpass(emg))

    def highpass(self, emg: np.ndarray) -> np.ndarray:
        """Return high-passed EMG of shape (n, m), NaN where it is not known."""
        if not self._fresh.any() and not self._unsettled.any() and np.isfinite(emg).all():
            whole, self._states = sosfilt(self._sections, emg, axis=0, zi=self._states)
            return np.asarray(whole)
        out = np.full(emg.shape, np.nan)
        for channel in range(emg.shape[1]):
            good = np.isfinite(emg[:, channel])
            if good.all():
                self._segment(emg, out, channel, 0, len(emg))
                continue
            edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
            for start, stop in edges.reshape(-1, 2):
                if start > 0:
                    self._fresh[channel] = True
                self._segment(emg, out, channel, int(start), int(stop))
            self._fresh[channel] |= not good[-1]
        return out

    def _segment(
        self, emg: np.ndarray, out: np.ndarray, channel: int, start: int, stop: int
    ) -> None:
        if stop <= start:
            return
        values = emg[start:stop, channel]
        if self._fresh[channel]:
            self._states[..., channel] = self._rest * values[0]
            self._fresh[channel], self._unsettled[channel] = False, self._to_settle
        filtered, self._states[..., channel] = sosfilt(
            self._sections, values, zi=self._states[..., channel]
        )
        unknown = min(int(self._unsettled[channel]), stop - start)
        self._unsettled[channel] -= unknown
        out[start + unknown : stop, channel] = filtered[unknown:]
