"""Torque that a model of rig and joint predicts while an estimator follows K, B, I and G.

Every parameter comes from before the sample that it predicts: the held terms from a calibration on
other data, K, B, I and G from the newest estimate that is at least `LEAD` old. A value that an
estimate knows worse than to a third stays the calibrated one, and the inertia stays near it. Of a
change since the calibration only the share is followed that its standard error does not explain
(`_shrunk`). So the prediction is one on unseen data, although the estimator goes on learning.

Behind a compliant fixation the foot's motion is simulated; the measured torque does not take part
in its own prediction.

Predicted and measured torque pass the same zero-phase filters as those of the other offline methods
(`torque_prediction.working_signals`), so the variances accounted for can be compared. They pass
them in the end: play and friction of a motion that was filtered are not those of the motion.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import signal

from ankle_physics.model import Entry, Model
from ankle_physics.signals import Signals
from impedance_estimator.estimator import ESTIMATE_COLUMNS
from impedance_estimator.known_physics import (
    LARGEST_GAIN_ERROR,
    REFLEX_WITH_GAIN,
    RELATIVE_INERTIA_CHANGE,
    KnownPhysics,
)
from impedance_estimator.offline.torque_prediction import (
    FILTER_ORDER,
    LOWPASS,
    checked_signals,
    decimation,
    without_drift,
)

LEAD = 1.0
"""[s] An estimate predicts torque that is at least this much newer: more than two reflex responses,
so that nothing which it has seen is among what it predicts."""
SETTLING_TIME = 1.0
"""[s] Left out at both ends, where filters and delays still settle."""
SKEW, SPONTANEOUS = "channel_skew", "voluntary_torque"
"""Undone in the frequency domain, for either sign; and left out, as no movement causes it."""
MOTION_LOWPASS = 2.0 * LOWPASS
"""[Hz] Keeps the noise of a differentiated position small and leaves alone what is judged. At
`LOWPASS` itself the filter takes a fifth of the motion at 43 Hz, and up to 1.5 points of the VAF of
human trials."""
LARGEST_CUTOFF = 0.4
"""Share of the sampling rate [1]; a digital low-pass needs room below a half."""
INTRINSIC = {
    "stiffness": ("K", "K[N.m/rad]"),
    "viscosity": ("B", "B[N.m.s/rad]"),
    "inertia": ("I", "I[kg.m^2]"),
}
"""Intrinsic terms that the estimator follows: their parameter, and its column. The reflex and what
shapes it follow the estimated G in proportion."""
GAIN = "G[N.m.s/rad]"


class ModelPrediction(NamedTuple):
    """Holds predicted and measured torque within the band that is judged.

    Attributes
    ----------
    time
        Since the first sample [s], shape (n,).
    torque
        Predicted [N.m], shape (n,).
    measured
        [N.m], shape (n,).
    """

    time: np.ndarray
    torque: np.ndarray
    measured: np.ndarray

    @property
    def vaf(self) -> float:
        """Return the variance of the measured torque that is accounted for [%]."""
        return 100.0 * (1.0 - float(np.var(self.measured - self.torque) / np.var(self.measured)))


def predict_with_model(
    rate: float,
    known: KnownPhysics,
    position: np.ndarray,
    torque: np.ndarray,
    rows: np.ndarray | None = None,
    velocity: np.ndarray | None = None,
) -> ModelPrediction:
    """Predict the torque along a recording under a calibrated model.

    Parameters
    ----------
    rate
        Sampling rate [Hz], at least 250.
    known
        Rig and subject; their model has K, B, I and a reflex.
    position, torque
        [rad], [N.m], shape (n,).
    rows
        Estimates of an online estimator on this recording that knows the same physics, columns
        `ESTIMATE_COLUMNS`, times since the first sample; None: the model's own K, B, I and G hold.
    velocity
        [rad/s], shape (n,), where it was measured; otherwise position is differentiated.

    Raises
    ------
    ValueError
        As `torque_prediction.checked_signals`.
    ankle_physics.errors.ModelError
        The model lacks one of `INTRINSIC`.
    """
    position, checked, velocity = checked_signals(rate, position, torque, velocity)
    assert checked is not None
    zero = known.rig.zero_position if known.rig is not None else 0.0
    motion = _motion(rate, position - zero, velocity)
    followed = _followed(known, motion[0], checked, rows, rate)
    model = _with_gains(known.model, followed, float(motion[0].mean()))
    predicted = model.start(rate).torque(Signals(rate, *motion))
    if known.model.has(SKEW):
        skew = float(known.model.entry(SKEW).values["skew"])
        predicted = _shifted(predicted, skew * rate)
    # The ends go first: derivatives that are held there would ring in the high-pass for seconds.
    inside = slice(round(SETTLING_TIME * rate), -round(SETTLING_TIME * rate))
    every = decimation(rate)
    time = (np.arange(len(position)) / rate)[inside][::every]
    return ModelPrediction(
        time,
        *(
            without_drift(_below(LOWPASS, torque, rate)[inside], rate)[::every]
            for torque in (predicted, checked)
        ),
    )


def _below(cutoff: float, values: np.ndarray, rate: float) -> np.ndarray:
    """Return what of a signal is slower than a cutoff [Hz], without delay."""
    lowpass = signal.butter(FILTER_ORDER, cutoff, fs=rate, output="sos")
    return np.asarray(signal.sosfiltfilt(lowpass, values))


def _motion(
    rate: float, position: np.ndarray, velocity: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return position, velocity and acceleration below `MOTION_LOWPASS`."""
    cutoff = min(MOTION_LOWPASS, LARGEST_CUTOFF * rate)
    x = _below(cutoff, position, rate)
    v = _derivative(x, rate) if velocity is None else _below(cutoff, velocity, rate)
    return x, v, _derivative(v, rate)


def _derivative(values: np.ndarray, rate: float) -> np.ndarray:
    """Return the derivative of fourth order, the ends held."""
    padded = np.pad(values, 2, mode="edge")
    return (8.0 * (padded[3:-1] - padded[1:-3]) - padded[4:] + padded[:-4]) * rate / 12.0


def _followed(
    known: KnownPhysics,
    position: np.ndarray,
    torque: np.ndarray,
    rows: np.ndarray | None,
    rate: float,
) -> dict[str, np.ndarray]:
    """Return K, B and I by term and the reflex' factor at every sample, each of shape (n,)."""
    count = len(position)
    own = {
        term: np.full(count, float(known.model.entry(term).values[symbol]))
        for term, (symbol, _) in INTRINSIC.items()
    }
    own["reflex"] = np.ones(count)
    if rows is None:
        return own
    valid = rows[rows[:, ESTIMATE_COLUMNS.index("valid[1]")] > 0.0]
    newest = np.searchsorted(valid[:, 0], np.arange(count) / rate - LEAD, side="right") - 1
    there = newest >= 0
    at = float(position.mean()), float(torque.mean()), 0.5 * count / rate
    for term, (_, column) in INTRINSIC.items():
        held = known.added_stiffness(*at) if term == "stiffness" else 0.0
        followed, told = _newest(valid[newest[there]], column, own[term][0] + held)
        followed = followed - held
        if term == "inertia":
            # A foot becomes neither lighter nor heavier.
            change = RELATIVE_INERTIA_CHANGE * own[term][0]
            followed = np.clip(followed, own[term][0] - change, own[term][0] + change)
        own[term][there] = np.where(told, followed, own[term][there])
    gain = known.calibrated_gain + known.added_gain(*at)
    if gain > 0.0:
        followed, told = _newest(valid[newest[there]], GAIN, gain)
        own["reflex"][there] = np.where(told, followed / gain, 1.0)
    return own


def _newest(rows: np.ndarray, column: str, calibrated: float) -> tuple[np.ndarray, np.ndarray]:
    """Return what to follow of the estimates in a column, and which of them tell enough about a
    change: those that know their value to `LARGEST_GAIN_ERROR`.
    """
    values = rows[:, ESTIMATE_COLUMNS.index(column)]
    errors = rows[:, ESTIMATE_COLUMNS.index(f"se_{column}")]
    told = errors <= LARGEST_GAIN_ERROR * np.abs(values)
    return calibrated + _shrunk(values - calibrated, errors), told


def _shrunk(change: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Return changes without the share that their standard errors explain (the positive part of
    James & Stein 1961, Proc. 4th Berkeley Symp., 361): none that is smaller than its error.
    """
    share = np.divide(error, change, out=np.full(len(change), np.inf), where=change != 0.0)
    return np.asarray(np.where(share**2 < 1.0, (1.0 - np.minimum(share**2, 1.0)) * change, 0.0))


def _with_gains(model: Model, followed: dict[str, np.ndarray], middle: float) -> Model:
    """Return the model with changing K, B, I and reflex, and its spring about the mean angle: a
    change of K then adds no offset.
    """
    entries = []
    for entry in model.entries:
        name = entry.term.name
        if name in (SKEW, SPONTANEOUS):
            continue
        values = dict(entry.values)
        if name in INTRINSIC:
            values[INTRINSIC[name][0]] = followed[name]
        if name in REFLEX_WITH_GAIN:
            values |= {
                p.symbol: values[p.symbol] * followed["reflex"]
                for p in entry.term.parameters
                if p.linear
            }
        if name == "stiffness":
            values["x0"] = middle
        entries.append(Entry(entry.term, values))
    return Model(entries)


def _shifted(values: np.ndarray, samples: float) -> np.ndarray:
    """Return a signal later by so many samples, also a part of one."""
    at = np.arange(len(values)) - samples
    return np.interp(at, np.arange(len(values)), values)
