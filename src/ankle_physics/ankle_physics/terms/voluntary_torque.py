"""Torque that the subject makes at will: a level, and a slow random drift about it.

``torque = level + rms * n(t)``, n a Gaussian process of variance 1: white noise through a
fourth-order Butterworth filter with the given cut-off.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from scipy.linalg import expm, solve_continuous_lyapunov
from scipy.signal import buttap

from ankle_physics.quintic import quintic_positions
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values

ORDER = 4
# Knots per period of the cut-off frequency. Between knots a fifth-order polynomial meets the
# process, its velocity and its acceleration; with 16 the spectrum follows the filter's down to -90
# dB.
KNOTS_PER_PERIOD = 16


class VoluntaryTorque(Term):
    """Adds the torque and counts it as muscle activation.

    The drift is drawn at knots that follow the cut-off and not the sampling rate: the same seed
    gives the same drift at every rate and in blocks of every size. The first sample is drawn from
    the stationary distribution.
    """

    name = "voluntary_torque"
    place = Place.ACTIVATION
    searched = False
    sentence = "The subject pushes or pulls with a torque that drifts slowly."
    parameters = (
        Parameter(
            "level",
            "N.m",
            -40.0,
            40.0,
            0.0,
            "van 't Veld et al. 2018, section III-B: targets 0 and -5 N.m; limit: weak contraction",
            description="It is the mean of the torque that the subject makes at will.",
            linear=True,
        ),
        Parameter(
            "rms",
            "N.m",
            0.0,
            10.0,
            0.5,
            "assumed: a tenth of the 5 N.m target of van 't Veld et al. 2018, section III-B",
            description="It is the root mean square of the slow drift about the level.",
            linear=True,
        ),
        Parameter(
            "cutoff",
            "Hz",
            0.01,
            5.0,
            0.3,
            "assumed: corrections at the pace of visual feedback; voluntary tracking ends near 2 "
            "Hz",
            description="It is the frequency above which the drift dies away.",
        ),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {"drift": _Drift(rate, seed)}

    def transform(self, signals: Signals, values: Values, state: State) -> None:
        state["noise"] = state["drift"].run(len(signals.position), float(values["cutoff"]))
        signals.activation = signals.activation + values["level"] + values["rms"] * state["noise"]

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        return {"level": np.ones(len(signals.position)), "rms": state["noise"]}


class _Drift:
    """Draws the process n(t) of variance 1, sample by sample."""

    def __init__(self, rate: float, seed: int) -> None:
        self._rate = rate
        self._random = np.random.default_rng(seed)
        transition, self._spread, stationary = _knot_process()
        self._transition = transition
        self._last = stationary @ self._random.standard_normal(ORDER)
        self._knots = self._last[None, :3]
        self._place = 0.0  # of the next sample, in knots from self._knots[0]

    def run(self, count: int, cutoff: float) -> np.ndarray:
        """Return the next samples, shape (count,); the cut-off [Hz] may differ from call to
        call.
        """
        step = KNOTS_PER_PERIOD * cutoff / self._rate
        needed = int(self._place + (count - 1) * step) + 2
        self._extend(needed - len(self._knots))
        out = quintic_positions(self._knots, self._place, step, count)
        end = self._place + count * step
        # The next sample may fall just behind the last knot that was needed so far.
        passed = min(int(end), len(self._knots) - 1)
        self._knots = self._knots[passed:].copy()
        self._place = end - passed
        return out

    def _extend(self, count: int) -> None:
        if count <= 0:
            return
        fresh = np.empty((count, 3))
        for k, draw in enumerate(self._random.standard_normal((count, ORDER))):
            self._last = self._transition @ self._last + self._spread @ draw
            fresh[k] = self._last[:3]
        self._knots = np.concatenate([self._knots, fresh])


@cache
def _knot_process() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the transition from knot to knot, factor of the noise between knots, factor of the
    stationary covariance; each (4, 4).

    The state is the process and its first three derivatives, by the interval between knots.
    """
    _, poles, _ = buttap(ORDER)
    interval = 2.0 * math.pi / KNOTS_PER_PERIOD  # at a cut-off of 1 rad/s
    system = np.zeros((ORDER, ORDER))
    system[:-1, 1:] = np.eye(ORDER - 1)
    system[-1] = -np.real(np.poly(poles * interval))[:0:-1]
    drive = np.zeros((ORDER, ORDER))
    drive[-1, -1] = 1.0
    covariance = solve_continuous_lyapunov(system, -drive)
    covariance /= covariance[0, 0]
    transition = expm(system)
    gained = covariance - transition @ covariance @ transition.T
    return transition, np.linalg.cholesky(gained), np.linalg.cholesky(covariance)
