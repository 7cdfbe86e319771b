"""Rows that are fitted are made from columns at the model's rate.

All of it is one linear operator on the spectrum, applied alike to torque and to every model column,
so that filtering changes neither the parameters of a linear joint nor which model is right.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq
from scipy.linalg import solve_toeplitz

from model_discrepancy.recording.spectrum import low_pass

# Slower torque is voluntary; a perturbation says nothing there.
HIGH_PASS_HZ = 0.1
# Above this, position noise of the recorded human trials hides what a second derivative could tell.
LOW_PASS_HZ = 80.0
# Magnitude of a 4th-order Butterworth filter run forwards and backwards.
LOW_PASS_ORDER = 8
# Half of it holds the band up to 80 Hz and the skirt of the low-pass.
ROW_RATE_HZ = 200.0
# The model starts from rest and the joint did not; the longest reflex response lasts 0.6 s.
SKIP_START_S = 1.5
SKIP_END_S = 0.5
# Falls to 1/166 between the limit of 80 Hz and the end of the rows at 100 Hz.
EDGE_ORDER = 24
# 0.2 s of past: resolves a tremor peak of 5 Hz width, and voluntary torque as a slope.
WHITENING_ORDER = 40

# Transforms that together make the one of a column.
_PARTS = 4


# The sum may be taken in any order, so that the processor adds several values at once.
@njit(cache=True, nogil=True, fastmath={"reassoc"})
def _padded(column: np.ndarray, length: int) -> np.ndarray:
    """Return a column (n,) without its mean and with zeros up to a length, each sample beside the
    next three, shape (length / 4, 4).
    """
    total = 0.0
    for k in range(column.size):
        total += column[k]
    mean = total / column.size
    padded = np.empty(length)
    for k in range(column.size):
        padded[k] = column[k] - mean
    padded[column.size :] = 0.0
    return padded.reshape(-1, _PARTS)


@njit(cache=True, nogil=True)
def _joined(parts: np.ndarray, later: np.ndarray) -> np.ndarray:
    """Return the lowest values of the spectrum of a signal of which every fourth sample was
    transformed, from each of the first four on.

    Parameters
    ----------
    parts
        The transforms, shape (length / 8 + 1, 4), of parts of even length.
    later
        The factor by which a delay of one sample changes the spectrum, shape (values wanted,).
    """
    last = parts.shape[0] - 1
    found = np.empty(later.size, dtype=np.complex128)
    # The spectrum of a part repeats, and its second half is the first one mirrored.
    for start in range(0, later.size, 2 * last):
        for k in range(start, min(start + last + 1, later.size)):
            p, z = parts[k - start], later[k]
            found[k] = p[0] + z * (p[1] + z * (p[2] + z * p[3]))
        for k in range(start + last + 1, min(start + 2 * last, later.size)):
            p, z = parts[start + 2 * last - k], later[k].conjugate()
            found[k] = (p[0] + z * (p[1] + z * (p[2] + z * p[3]))).conjugate()
    return found


class Rows:
    """Selects and whitens the rows of recordings of n samples.

    Parameters
    ----------
    samples
        N, of the columns.
    rate
        Of the columns [Hz].
    limit
        Highest frequency that is fitted [Hz]; half the power is left there.

    Attributes
    ----------
    limit
        As given [Hz].
    count
        Rows of a recording.
    rate
        Of the rows [Hz].
    time
        Of the rows since the first sample [s], shape (count,).
    used
        Rows that are fitted (without the ends), bool, shape (count,).
    """

    def __init__(self, samples: int, rate: float, limit: float = LOW_PASS_HZ) -> None:
        self._samples = samples
        self._rate = rate
        self.limit = limit
        # Each part has an even length.
        even = 2 * _PARTS
        least = samples + int(SKIP_START_S * rate)
        self._length = even * next_fast_len(-(-least // even), real=True)
        # The rows' grid has the same period as the columns'.
        self._short = 2 * next_fast_len(round(0.5 * self._length * ROW_RATE_HZ / rate), real=True)
        self.rate = self._short * rate / self._length
        self.count = int(samples * self.rate / rate)
        self.time = np.arange(self.count) / self.rate
        self.used = (self.time >= SKIP_START_S) & (self.time < samples / rate - SKIP_END_S)
        inside = np.flatnonzero(self.used)
        self.fitted = slice(int(inside[0]), int(inside[-1]) + 1) if len(inside) else slice(0, 0)
        self.frequency = rfftfreq(self._length, 1.0 / rate)[: self._short // 2 + 1]
        high = (self.frequency / HIGH_PASS_HZ) ** 4
        self._later_by_one = np.exp(-2j * np.pi * self.frequency / rate)
        self.band = high / (1.0 + high) * low_pass(self.frequency, limit, LOW_PASS_ORDER)
        self._whitening = self.band.astype(complex)
        self._scale = self._short / self._length
        # Beyond the limit the whitening must not lift what the low-pass took away.
        self._edge = low_pass(self.frequency, limit, EDGE_ORDER)

    def unwhitened(self) -> Rows:
        """Return the same operator without a whitening filter."""
        return Rows(self._samples, self._rate, self.limit)

    @property
    def independent(self) -> int:
        """Return the number of independent values in the fitted rows: they hold no more than twice
        the limit each second.
        """
        return int(self.used.sum() * min(2.0 * self.limit / self.rate, 1.0))

    def spectrum(self, column: np.ndarray) -> np.ndarray:
        """Return the spectrum of a column (n,) up to half the row rate, without its mean.

        Every fourth sample is transformed, from each of the first four on, in one call: the
        processor transforms them side by side, and each fits its cache. That takes two thirds of
        the time of one long transform.
        """
        column = np.ascontiguousarray(column, dtype=float)
        parts = rfft(_padded(column, self._length), axis=0)
        return np.asarray(_joined(parts, self._later_by_one))

    def slow(self, spectrum: np.ndarray, cutoff: float) -> np.ndarray:
        """Return what lies below a cutoff [Hz], at the columns' rate, shape (n,)."""
        return self.torque(spectrum * low_pass(self.frequency, cutoff, 4))

    def torque(self, spectrum: np.ndarray) -> np.ndarray:
        """Return a spectrum's part below half the row rate, at the columns' rate, shape (n,)."""
        whole = np.zeros(self._length // 2 + 1, dtype=complex)
        whole[: len(spectrum)] = spectrum
        return irfft(whole, self._length)[: self._samples]

    def plain(self, spectrum: np.ndarray) -> np.ndarray:
        """Return the band-passed rows, shape (count,)."""
        return self.filtered(spectrum, self.band)

    def filtered(self, spectrum: np.ndarray, gain: np.ndarray) -> np.ndarray:
        """Return the rows behind a filter of this gain at each of `frequency`, shape (count,)."""
        rows: np.ndarray = irfft(spectrum * gain, self._short, overwrite_x=True)[: self.count]
        rows *= self._scale
        return rows

    def whitened(self, spectrum: np.ndarray) -> np.ndarray:
        """Return the band-passed and whitened rows, shape (count,)."""
        return self.filtered(spectrum, self._whitening)

    def whiten_by(self, residual: np.ndarray) -> None:
        """Take the whitening filter from plain residual rows, shape (count,): the inverse of their
        autoregressive model.
        """
        self.whiten_with(autoregression(residual[self.used], WHITENING_ORDER))

    def whiten_with(self, coefficients: np.ndarray) -> None:
        """Take the whitening filter from prediction-error coefficients, as `autoregression` returns
        them.
        """
        angle = 2.0 * np.pi * self.frequency / self.rate
        self._whitening = (
            self._edge
            * self.band
            * (np.exp(-1j * np.outer(angle, np.arange(len(coefficients)))) @ coefficients)
        )

    def gain(self) -> np.ndarray:
        """Return the magnitude of the whitening at each of `frequency`."""
        return np.abs(self._whitening)


def selection(mask: np.ndarray) -> slice | np.ndarray:
    """Return the rows of a mask as a slice, which copies nothing, where they follow each other."""
    inside = np.flatnonzero(mask)
    if len(inside) == 0 or inside[-1] - inside[0] + 1 > len(inside):
        return mask
    return slice(int(inside[0]), int(inside[-1]) + 1)


def autoregression(series: np.ndarray, order: int) -> np.ndarray:
    """Return the prediction-error filter by Yule-Walker, scaled to unit variance of its output.

    Parameters
    ----------
    series
        Shape (n,).
    order
        Number p of past values.

    Returns
    -------
    np.ndarray
        ``[1, -a1, ... -ap]`` over the spread of the prediction error, shape (order + 1,).
    """
    series = series - series.mean()
    n = len(series)
    size = next_fast_len(2 * n, real=True)
    power = irfft(np.abs(rfft(series, size)) ** 2, size)[: order + 1] / n
    # A floor of -60 dB keeps the equations solvable where the low-pass leaves nothing.
    power[0] *= 1.0 + 1e-6
    a = solve_toeplitz(power[:-1], power[1:])
    spread = np.sqrt(max(power[0] - a @ power[1:], 1e-12 * power[0]))
    return np.concatenate([[1.0], -a]) / spread
