"""A sum of sines on a grid of frequencies: x(t) = a Σ cos(2π f_k t + φ_k), f_k = k / period, φ_k
random.

All of the power is at known frequencies, so that noise and nonlinearity show between them. Source:
Pintelon and Schoukens, System Identification: A Frequency Domain Approach, 2nd ed. 2012, chapter 2
(random-phase multisine).
"""

from __future__ import annotations

import math

import numpy as np

from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Quantity, Value
from perturbation_generator.edge_train import EdgeTrain
from perturbation_generator.edges import Extremes, Polynomial
from perturbation_generator.settings import Settings
from perturbation_generator.signal import Signal

# Points per period of the highest frequency when the peak is looked for; the peak between points is
# bounded exactly.
POINTS = 32


class Multisine(Signal):
    """Sums sines of equal amplitude and random phase, scaled so that the position never passes the
    amplitude.

    On one side (``dorsiflexing``, ``plantarflexing``) the position stays between rest and the
    amplitude, with ``both`` between plus and minus the amplitude. Start, end and changes of the
    amplitude are 5th-order fades, one after the other. A change that could not be completed before
    the final fade is left out. The period is rounded to a whole number of samples.
    """

    name = "multisine"
    parameters = (
        Quantity(
            "multisine.period",
            "s",
            0.5,
            120.0,
            10.0,
            description="Period; its inverse is the distance of the frequencies.",
            start_only=True,
        ),
        Quantity(
            "multisine.lowest",
            "Hz",
            0.01,
            200.0,
            0.1,
            description="Lowest frequency.",
            start_only=True,
        ),
        # The ankle's own resonance under contraction lies below 20 Hz: √(200 / 0.0137) / 2π = 19 Hz
        # at K = 200 N·m/rad.
        Quantity(
            "multisine.highest",
            "Hz",
            0.01,
            200.0,
            20.0,
            description="Highest frequency.",
            start_only=True,
        ),
        # Ten stretch-reflex delays of 40 ms and more: slow against everything that the signal asks
        # about.
        Quantity(
            "multisine.fade",
            "s",
            0.1,
            60.0,
            1.0,
            description="Time to fade in, out and between amplitudes.",
            start_only=True,
        ),
    )

    def __init__(self, settings: Settings, **own: Value) -> None:
        super().__init__(settings, **own)
        rate = settings.rate
        length = round(float(self.own["period"]) * rate)
        # A frequency within a millionth of a grid line is on it.
        first = max(1, math.ceil(float(self.own["lowest"]) * length / rate - 1e-6))
        last = math.floor(float(self.own["highest"]) * length / rate + 1e-6)
        if last < first:
            raise QuantityError(
                f"no frequency of the grid of {rate / length:.4g} Hz lies between "
                f"'multisine.lowest' = {self.own['lowest']:g} Hz "
                f"and 'multisine.highest' = {self.own['highest']:g} Hz"
            )
        self._harmonics = np.arange(first, last + 1)
        phases = np.random.default_rng(settings.seed).uniform(0, 2 * math.pi, last)[first - 1 :]
        lines = np.exp(1j * phases)
        peak = self._peak(self._wave(lines, POINTS * last), last)
        omega = 2 * math.pi * self._harmonics * rate / length
        self._bounds = [1.0] + [
            self._peak(self._wave(lines * (1j * omega) ** k, POINTS * last), last) / peak
            for k in (1, 2)
        ]
        self._table = (
            np.column_stack([self._wave(lines * (1j * omega) ** k, length) for k in range(3)])
            / peak
        )
        if len(settings.sides) == 1:
            self._table *= settings.sides[0] / 2
            self._table[:, 0] += settings.sides[0] / 2
            self._bounds[1:] = [bound / 2 for bound in self._bounds[1:]]
        self._fade = max(float(self.own["fade"]), settings.ramp_in)
        if settings.end < 2 * self._fade:
            raise QuantityError(
                f"parameter 'duration' = {settings.duration:g} s is refused; fading in and out "
                f"takes {2 * self._fade:g} s"
            )
        self._envelope = EdgeTrain(Polynomial(self._fade), rate)
        self._envelope.add(0.0, self.amplitude)
        self._faded = self._fade
        self._final = settings.end - self._fade

    @property
    def frequencies(self) -> np.ndarray:
        """Return the frequencies of the sines [Hz], shape (m,)."""
        return self._harmonics * self.settings.rate / len(self._table)

    def extremes(self, amplitude: float) -> Extremes:
        """See `Signal.extremes`: of the product of signal and fade."""
        fade = Polynomial(self._fade).extremes(amplitude, self._fade, self.settings.rate)
        _, velocity, acceleration = self._bounds
        return Extremes(
            amplitude,
            amplitude * velocity + fade.velocity,
            amplitude * acceleration + 2 * fade.velocity * velocity + fade.acceleration,
        )

    def _samples(self, first: int, n: int) -> np.ndarray:
        self._change(first, n)
        envelope, rise, bend = self._envelope.samples(first, n).T
        wave, velocity, acceleration = self._table[np.arange(first, first + n) % len(self._table)].T
        return np.column_stack(
            [
                envelope * wave,
                envelope * velocity + rise * wave,
                envelope * acceleration + 2 * rise * velocity + bend * wave,
            ]
        )

    def _change(self, first: int, n: int) -> None:
        rate = self.settings.rate
        start = max(first / rate, self._faded)
        if (
            self.amplitude != self._envelope.level
            and start < (first + n) / rate
            and start + self._fade <= self._final
        ):
            self._envelope.add(start, self.amplitude)
            self._faded = start + self._fade
        if self._final < (first + n) / rate:
            self._envelope.add(self._final, 0.0)
            self._final = math.inf
            self._faded = math.inf

    def _wave(self, lines: np.ndarray, points: int) -> np.ndarray:
        """Return Σ Re(lines_k e^(i 2π k j / points)) for j = 0 ... points - 1."""
        spectrum = np.zeros(points // 2 + 1, dtype=complex)
        spectrum[self._harmonics] = lines * points / 2
        return np.fft.irfft(spectrum, points)

    @staticmethod
    def _peak(wave: np.ndarray, highest: int) -> float:
        """Return a bound of |x| that holds between the points, too: a trigonometric polynomial of
        degree n keeps within max|x_j| / cos(π n / N) for N equally spaced points (Ehlich and Zeller
        1964).
        """
        return float(np.abs(wave).max()) / math.cos(math.pi * highest / len(wave))
