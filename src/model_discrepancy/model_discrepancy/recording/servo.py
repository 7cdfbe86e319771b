"""The servo's response to its command and its compliance under load are estimated here.

``position = H reference - C (torque + friction)``: H is how the drive follows its command, C
[rad/N.m] its compliance, and friction that of its own bearings (`drive_mode`). All are fitted to
the recording itself by least squares. What the joint
does to the torque without any movement (voluntary torque, tremor, a reflex that varies) moves the
plate by ``-C`` times itself, and therefore stands in the measured position. A fit that regresses
torque on that position would explain such torque by the movement that it made (a closed loop, Ljung
1999, System Identification, section 13.4). The command does not contain it: it is the instrument.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from hashlib import blake2b

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from model_discrepancy.recording.compliance import (
    COMPLIANCE_POLES_S,
    STRETCHES,
    TORQUE_HZ,
    Compliance,
    compliance_columns,
    low_passed,
    pick_up,
    stated_magnitude,
)
from model_discrepancy.recording.drive_mode import best_mode, friction_column
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.spectrum import Spectrum, signal_share

# A drive of 20 Hz has settled within 0.1 s; slower parts (an integrator) are in the slow poles.
FOLLOWING_S = 0.1
# Between two lags of H: an edge of 11 ms holds nothing above 120 Hz, and each lag costs precision.
# A step that nothing but the drive makes smooth holds more, and needs a lag at each sample.
LAGS_S = (0.004, 0.0)
# The reference may be stamped somewhat later than the motion that it caused.
EARLIEST_S = 0.01
# Poles of the slow part of H [s].
SLOW_POLES_S = (0.03, 0.1, 0.4, 1.5)
# Relative to the largest eigenvalue: keeps frequencies that the command does not hold at zero.
_RIDGE = 1e-11
# The filters start from rest and the rig did not.
_SKIP_S = 1.2
_SKIP_END_S = 0.5
_FADE_S = 0.4
# Of the torque's power, above which it acts: where its sensor's noise is more than a tenth of it,
# that noise would be put into the movement, and a fit would find it there and in the torque.
_ACTING_SHARE = 0.9
# Of the position's variance, which the command explains by itself. A plate that a command
# moves follows it to nine tenths and more; the command of another recording explains nothing.
_LEAST_COMMANDED = 0.3
# Reflexes, tremor and voluntary torque lie below [Hz].
_LOWEST_TORQUE_HZ = 20.0


@dataclass(frozen=True)
class Servo:
    """Describes the servo of one recording.

    Attributes
    ----------
    rate
        Of the samples that it was fitted at [Hz].
    position
        What the command and the torque explain of the position [rad], shape (n,), about its mean.
    commanded
        What the command and the drive's own friction explain of it, without a load [rad], shape
        (n,).
    unexplained
        The rest of the position [rad], shape (n,), faded out at both ends: the encoder's noise,
        and what is not linear.
    compliance
        Under load.
    following
        Gain of position against command at rest without load, with its standard error [1].
    share
        Share of the position's variance that is explained, 0...1.
    uncertainty
        Power of the error of `position` as a share of that of `unexplained`: weights per sample.
    """

    rate: float
    position: np.ndarray
    commanded: np.ndarray
    unexplained: np.ndarray
    compliance: Compliance
    following: tuple[float, float]
    share: float
    uncertainty: float

    def __post_init__(self) -> None:
        # The result is shared by all who ask for the same recording's servo.
        for series in (self.position, self.commanded, self.unexplained):
            series.setflags(write=False)

    @property
    def information(self) -> float:
        """Return Schwarz's criterion per sample (1978, Ann. Statist. 6, 461), lower is better."""
        left = max(1.0 - self.share, math.ulp(1.0))
        return math.log(left) + self.uncertainty * math.log(len(self.position))

    def unloaded(self) -> Servo:
        """Return the servo as the command alone moves it."""
        return replace(self, position=self.commanded, unexplained=np.zeros(len(self.commanded)))


def identify_servo(recording: Recording, step: int) -> Servo | None:
    """Identify the servo of a recording; None where no command was recorded, where it does not
    move, and where it does not move the plate.

    Parameters
    ----------
    recording
        With its reference.
    step
        Samples of the recording for one sample of the fit.
    """
    if recording.reference is None or np.std(recording.reference) == 0.0:
        return None
    return _identified(
        _Signals(recording.position, recording.torque, recording.reference, recording.rate, step)
    )


class _Signals:
    """Holds what a servo is identified from; equal where all of it is."""

    def __init__(
        self,
        position: np.ndarray,
        torque: np.ndarray,
        command: np.ndarray,
        rate: float,
        step: int,
    ) -> None:
        self.position, self.torque, self.command = position, torque, command
        self.rate, self.step = rate, step
        digest = blake2b(repr((rate, step)).encode(), digest_size=16)
        for signal in (position, torque, command):
            digest.update(np.asarray(signal, dtype=float).tobytes())
        self._digest = digest.digest()

    def __hash__(self) -> int:
        return hash(self._digest)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Signals) and self._digest == other._digest


# A diagnosis prepares one recording with several models, and its servo stays the same; a set of
# recordings is seldom larger.
@lru_cache(maxsize=8)
def _identified(signals: _Signals) -> Servo | None:
    rate = signals.rate / signals.step
    x, torque, command = (
        _thinned(signal, signals.rate, signals.step)
        for signal in (signals.position, signals.torque, signals.command)
    )
    limit, lines = _acting_limit(signals.torque, signals.rate), pick_up(torque, rate)
    load = Compliance(rate, np.zeros(1 + len(COMPLIANCE_POLES_S)), (0.0, 0.0), limit, lines)
    lags = sorted({max(1, round(lag * rate)) for lag in LAGS_S}, reverse=True)
    followings = [_following_columns(command, rate, between) for between in lags]
    giving = partial(compliance_columns, torque, rate, limit, lines)
    nothing = np.zeros((len(x), 0))
    rough = _fitted(x, followings[0], nothing, giving(None), load)
    if rough is None:
        return None
    velocity = np.gradient(rough.commanded) * rate
    inner = _inner(len(x), rate)
    mode, turning = best_mode(x, followings[0], giving, velocity, rate, limit, inner)
    loaded, load = giving(mode), replace(load, mode=mode)
    friction = friction_column(velocity, turning, rate, mode)[:, None]
    tried = [
        (servo, following)
        for following in followings
        for dry in (nothing, friction)
        for servo in [_fitted(x, following, dry, loaded, load)]
        if servo is not None
    ]
    if not tried:
        return None
    best, following = min(tried, key=lambda one: one[0].information)
    alone = _fitted(x, following, nothing, nothing, replace(load, mode=None))
    if alone is None or alone.share < _LEAST_COMMANDED:
        return None
    # A compliance that is not there would only carry the torque's noise into the position.
    return best if best.compliance.significant else alone


def _acting_limit(torque: np.ndarray, rate: float) -> float:
    """Return the highest frequency [Hz] at which the torque is hardly noise, and acts."""
    spectrum = Spectrum(torque, rate, 1)
    clear = signal_share(spectrum.values, spectrum.frequency) > _ACTING_SHARE
    inside = spectrum.frequency[clear & (spectrum.frequency < TORQUE_HZ)]
    return max(float(inside[-1]) if len(inside) else 0.0, _LOWEST_TORQUE_HZ)


def _inner(samples: int, rate: float) -> np.ndarray:
    """Return the samples that are fitted, bool, shape (n,)."""
    inner = np.zeros(samples, dtype=bool)
    inner[int(_SKIP_S * rate) : -int(_SKIP_END_S * rate)] = True
    return inner


def _fitted(
    x: np.ndarray,
    following: np.ndarray,
    friction: np.ndarray,
    giving: np.ndarray,
    load: Compliance,
) -> Servo | None:
    """Solve least squares with standard errors; None where the recording is too short for it, or
    friction would drive the plate.

    Parameters
    ----------
    x
        Position [rad], shape (n,).
    following, friction, giving
        What command, friction and load may make of it, of shapes (n, p), (n, 0 or 1) and (n, 0 or
        4).
    load
        How the load acts; its weights are found.
    """
    columns = np.column_stack([following, friction, giving])
    rate, inner = load.rate, _inner(len(x), load.rate)
    if inner.sum() < 4 * columns.shape[1]:
        return None
    scale = np.linalg.norm(columns[inner], axis=0)
    scale[scale == 0.0] = 1.0
    parts = np.array_split(np.flatnonzero(inner), STRETCHES)
    grams = np.array([(columns[p] / scale).T @ (columns[p] / scale) for p in parts])
    rights = np.array([(columns[p] / scale).T @ x[p] for p in parts])
    weights = _solved(grams.sum(axis=0), rights.sum(axis=0)) / scale
    count, drives = following.shape[1], following.shape[1] + friction.shape[1]
    if np.any(weights[count:drives] > 0.0):
        return None
    # The jackknife over stretches (Künsch 1989): each draw leaves one of them out.
    drawn = np.array(
        [
            _solved(grams.sum(axis=0) - g, rights.sum(axis=0) - r) / scale
            for g, r in zip(grams, rights, strict=True)
        ]
    )
    spread = _spread(drawn[:, :count].sum(axis=1))
    position = columns @ weights
    compliance = load
    if giving.shape[1]:
        compliance = replace(
            load,
            weights=-weights[drives:],
            magnitude=(
                float(stated_magnitude(-weights[drives:], rate)),
                _spread(stated_magnitude(-drawn[:, drives:], rate)),
            ),
        )
    return Servo(
        rate,
        position,
        columns[:, :drives] @ weights[:drives],
        (x - position) * _fade(inner, rate),
        compliance,
        (float(weights[:count].sum()), spread),
        1.0 - float(np.var((x - position)[inner]) / np.var(x[inner])),
        columns.shape[1] / float(inner.sum()),
    )


def _spread(drawn: np.ndarray) -> float:
    """Return the standard error of what was drawn by leaving out one stretch at a time."""
    return float(np.sqrt((STRETCHES - 1) * drawn.var()))


def _fade(inner: np.ndarray, rate: float) -> np.ndarray:
    """Return a window: 1 inside and 0 outside, with edges that do not ring."""
    edge = np.hanning(2 * int(0.5 * _FADE_S * rate) + 1)
    return np.asarray(np.convolve(inner, edge / edge.sum(), mode="same"))


def _thinned(signal: np.ndarray, rate: float, step: int) -> np.ndarray:
    spectrum = Spectrum(signal - signal.mean(), rate, step)
    return spectrum.read(spectrum.anti_alias())


def _following_columns(command: np.ndarray, rate: float, between: int) -> np.ndarray:
    """Return the command at each lag, so many samples apart, and behind the slow poles.

    H is straight between two lags: one that is made of pulses would answer a step by a staircase.
    """
    flat = np.full(between, 1.0 / between)
    weights = np.convolve(flat, flat)
    held = np.pad(command, between - 1, mode="edge")
    smooth = np.convolve(held, weights, mode="valid")
    lags = range(-int(EARLIEST_S * rate), int(FOLLOWING_S * rate), between)
    columns = [np.roll(smooth, lag) for lag in lags]
    return np.column_stack(columns + [low_passed(command, rate, pole) for pole in SLOW_POLES_S])


def _solved(gram: np.ndarray, right: np.ndarray) -> np.ndarray:
    regular = gram + _RIDGE * np.trace(gram) * np.eye(len(gram))
    return np.asarray(cho_solve(cho_factor(regular), right))
