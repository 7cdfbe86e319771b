"""Surface EMG of four muscles is simulated while the ankle is perturbed.

``e = X (s(t) n(t)) + artefact + hum + amplifier noise + offset``

- ``n``: noise with the spectrum of surface EMG, one stream a muscle: motor units fire out of step,
  so their sum is coloured noise whose standard deviation s is the muscle's activity (Hogan & Mann
  1980, IEEE Trans. Biomed. Eng. 27, 382).
- ``s = background (1 + drift) + burst``: the burst is the stretch velocity of the muscle, `LATENCY`
  later, spread over the length of an action potential, times the reflex drive and a factor that is
  drawn for each stretch.
- ``X``: cross-talk from muscle to electrode.
- artefact: cables and electrodes move with the leg, low frequencies that follow the plate's
  velocity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfilt

from ankle_physics.linear_dynamics import Delay, FirstOrder

CHANNELS = ("SOL", "TA", "GL", "GM")
STRETCHED_BY = (1.0, -1.0, 1.0, 1.0)
"""Direction of the movement that stretches each muscle."""
_GROUPS = {
    direction: [k for k, own in enumerate(STRETCHED_BY) if own == direction]
    for direction in (1.0, -1.0)
}
BAND = (30.0, 180.0)
"""[Hz] Second-order band-pass for n: median frequency 112 Hz; surface EMG has 70 to 130 Hz (De Luca
1997).
"""
LATENCY = 0.035
"""[s] Stretch to EMG: soleus 35 to 45 ms; 5 ms ahead of the paper's 40 ms for torque, which adds
excitation-contraction coupling.
"""
ACTION_POTENTIAL_TIME = 0.003
"""[s] Time constant that spreads a volley over the length of an action potential and of conduction.
"""
MIN_STRETCH_VELOCITY = 0.05
"""[rad/s] Stretch velocity from which a stretch counts as a new one."""
DRIFT_TIME = 1.0
"""[s] Correlation time of the background's fluctuation: common drive and force corrections below 1
Hz.
"""
ARTEFACT_TIME = 0.015
"""[s] Time constant of the artefact: electrodes and cables follow below 10 Hz."""
# labels the random streams, so that they differ from those of terms and sensors for the same seed
_EMG_STREAM = 9_127


@dataclass(frozen=True)
class Electrodes:
    """Describes the part of the EMG that is not muscle.

    Sources: input noise and hum of a Porti-class amplifier; cross-talk De Luca & Merletti 1988 (5
    to 17 %).

    Attributes
    ----------
    noise
        Of skin and amplifier, white, rms [V].
    hum
        Amplitude of the 50 Hz hum [V].
    hum_frequency
        [Hz].
    artefact
        Per plate velocity [V.s/rad].
    offset
        Half-cell potential [V].
    crosstalk
        Share that reaches an electrode from a neighbour in the same group (calf), [1].
    crosstalk_across
        Share between shin and calf [1].
    """

    noise: float = 1.5e-6
    hum: float = 1.0e-6
    hum_frequency: float = 50.0
    artefact: float = 4.0e-6
    offset: float = 2.0e-4
    crosstalk: float = 0.10
    crosstalk_across: float = 0.05

    def mixing(self) -> np.ndarray:
        """Return X, shape (4, 4)."""
        calf = np.array(STRETCHED_BY) > 0
        mixing = np.where(calf[:, None] == calf[None, :], self.crosstalk, self.crosstalk_across)
        np.fill_diagonal(mixing, 1.0)
        return mixing


@dataclass(frozen=True)
class Variability:
    """Holds coefficients of variation.

    Attributes
    ----------
    drift
        Of the background within a contraction: 10 % (steady isometric contractions, after smoothing
        over a second).
    stretch_common
        Of the reflex from stretch to stretch, in all muscles alike: excitability of the pool.
    stretch_own
        The same for each muscle by itself. Together 30 %, as stretch reflexes of the soleus (20 to
        40 %).
    """

    drift: float = 0.10
    stretch_common: float = 0.20
    stretch_own: float = 0.22


class SurfaceEmg:
    """Makes EMG sample by sample; the same for a seed whatever the size of the stretches.

    Parameters
    ----------
    rate
        Of the samples [Hz].
    seed
        Of all random draws.
    electrodes, variability
        The defaults are used where they are None.
    """

    def __init__(
        self,
        rate: float,
        seed: int,
        electrodes: Electrodes | None = None,
        variability: Variability | None = None,
    ) -> None:
        self.rate = rate
        self.electrodes = electrodes or Electrodes()
        self.variability = variability or Variability()
        self._random = [
            [np.random.default_rng([_EMG_STREAM, seed, channel, use]) for use in range(3)]
            for channel in range(4)
        ]
        self._stretches = {
            direction: np.random.default_rng([_EMG_STREAM, seed, 4, int(direction > 0)])
            for direction in _GROUPS
        }
        self._sections = butter(2, BAND, "bandpass", fs=rate, output="sos")
        self._scale = 1.0 / _noise_gain(self._sections)
        self._coloured = np.zeros((self._sections.shape[0], 2, 4))
        decay = math.exp(-1.0 / (DRIFT_TIME * rate))
        self._drift_filter = np.array([[math.sqrt(1.0 - decay**2), 0.0, 0.0, 1.0, -decay, 0.0]])
        self._drifts = np.zeros((1, 2, 4))
        self._delays = [Delay(rate, LATENCY) for _ in CHANNELS]
        self._spreads = [FirstOrder(rate) for _ in CHANNELS]
        self._artefact = FirstOrder(rate)
        self._mixing = self.electrodes.mixing()
        self._phases = np.random.default_rng([_EMG_STREAM, seed, 5]).uniform(0.0, 2.0 * math.pi, 4)
        self._factors = np.ones(4)
        self._moving = dict.fromkeys(_GROUPS, False)
        self._count = 0

    def run(self, velocity: np.ndarray, background: np.ndarray, reflex: np.ndarray) -> np.ndarray:
        """Return the next samples.

        Parameters
        ----------
        velocity
            Of the plate [rad/s], shape (n,).
        background
            Rms of each muscle's background activity [V], shape (4,).
        reflex
            Rms of each muscle's burst per stretch velocity [V.s/rad], shape (4,).

        Returns
        -------
        np.ndarray
            EMG [V], shape (n, 4), muscles in the order of `CHANNELS`.
        """
        n = len(velocity)
        volleys = self._volleys(velocity)
        white, wander, own = (
            np.column_stack([streams[use].standard_normal(n) for streams in self._random])
            for use in range(3)
        )
        coloured, self._coloured = sosfilt(
            self._sections, self._scale * white, axis=0, zi=self._coloured
        )
        slow, self._drifts = sosfilt(self._drift_filter, wander, axis=0, zi=self._drifts)
        sources = (
            background * np.maximum(1.0 + self.variability.drift * slow, 0.0) + reflex * volleys
        ) * coloured
        out = sources @ self._mixing.T
        time = (self._count + np.arange(n)) / self.rate
        self._count += n
        e = self.electrodes
        out += (e.offset + e.artefact * self._artefact.run(velocity, ARTEFACT_TIME))[:, None]
        out += e.hum * np.sin(2.0 * math.pi * e.hum_frequency * time[:, None] + self._phases)
        out += e.noise * own
        return out

    def _volleys(self, velocity: np.ndarray) -> np.ndarray:
        """Return stretch velocity as the motor units of each muscle answer it [rad/s], with the
        factor of each stretch, shape (n, 4).
        """
        out = np.empty((len(velocity), 4))
        for direction, members in _GROUPS.items():
            stretch = np.maximum(direction * velocity, 0.0)
            moving = np.concatenate([[self._moving[direction]], stretch > MIN_STRETCH_VELOCITY])
            self._moving[direction] = bool(moving[-1])
            begins = np.flatnonzero(moving[1:] & ~moving[:-1])
            for start, stop in zip([0, *begins], [*begins, len(velocity)], strict=True):
                if start in begins:
                    self._factors[members] = self._draw(direction, len(members))
                out[start:stop, members] = stretch[start:stop, None] * self._factors[members]
        for channel in range(4):
            delayed = self._delays[channel].run(out[:, channel], LATENCY)
            out[:, channel] = self._spreads[channel].run(delayed, ACTION_POTENTIAL_TIME)
        return out

    def _draw(self, direction: float, muscles: int) -> np.ndarray:
        """Return factors of one stretch for the muscles of a group: log-normal with mean 1, in part
        common to them.
        """
        variances = (
            math.log1p(self.variability.stretch_common**2),
            math.log1p(self.variability.stretch_own**2),
        )
        common, *own = self._stretches[direction].standard_normal(1 + muscles)
        return np.exp(
            math.sqrt(variances[0]) * common
            + math.sqrt(variances[1]) * np.array(own)
            - 0.5 * sum(variances)
        )


def _noise_gain(sections: np.ndarray) -> float:
    """Return the standard deviation that the filter gives to white noise of 1."""
    impulse = np.zeros(4096)
    impulse[0] = 1.0
    return float(np.sqrt(np.sum(sosfilt(sections, impulse) ** 2)))
