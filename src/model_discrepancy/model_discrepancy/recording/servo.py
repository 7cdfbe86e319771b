"""The servo's response to its command and its compliance under load are estimated here.

``position = H reference - C torque``: H is how the drive follows its command, C [rad/N.m] its
compliance. Both are linear and are fitted to the recording itself by least squares. What the joint
does to the torque without any movement (voluntary torque, tremor, a reflex that varies) moves the
plate by ``-C`` times itself, and therefore stands in the measured position. A fit that regresses
torque on that position would explain such torque by the movement that it made (a closed loop, Ljung
1999, System Identification, section 13.4). The command does not contain it: it is the instrument.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.signal import lfilter

from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.spectrum import Spectrum, low_pass, signal_share

# A drive of 20 Hz has settled within 0.1 s; slower parts (an integrator) are in the slow poles.
FOLLOWING_S = 0.1
# Between two lags of H: an edge of 11 ms holds nothing above 120 Hz, and each lag costs precision.
# A step that nothing but the drive makes smooth holds more, and needs a lag at each sample.
LAGS_S = (0.004, 0.0)
# The reference may be stamped somewhat later than the motion that it caused.
EARLIEST_S = 0.01
# Low-passes of the compliance: pole [s], from a stiff current loop to an integrator, and how many
# of them are in series. Several in series (Laguerre) make the resonance of the drive's mass on its
# stiffness, at 15 to 60 Hz.
COMPLIANCE_LOW_PASSES = (
    (0.005, 1),
    (0.005, 2),
    (0.005, 3),
    (0.005, 4),
    (0.015, 1),
    (0.05, 1),
    (0.2, 1),
    (1.0, 1),
)
# Poles of the slow part of H [s].
SLOW_POLES_S = (0.03, 0.1, 0.4, 1.5)
# Relative to the largest eigenvalue: keeps frequencies that the command does not hold at zero.
_RIDGE = 1e-11
# The filters start from rest and the rig did not.
_SKIP_S = 1.2
_FADE_S = 0.4
# Torque acts on the plate from below this frequency [Hz]; what is faster the drive's mass holds.
_TORQUE_HZ = 60.0
# Lines of the mains in the torque are pick-up of the sensor's cable [Hz], which moves no plate: a
# movement that held it would predict it. Half the width of what is left out [Hz].
_MAINS_HZ, _MAINS_WIDTH_HZ = (50.0, 60.0), 1.0
# Of the torque's power, above which it acts: where its sensor's noise is more than a tenth of it,
# that noise would be put into the movement, and a fit would find it there and in the torque.
_ACTING_SHARE = 0.9
# Reflexes, tremor and voluntary torque lie below [Hz].
_LOWEST_TORQUE_HZ = 20.0
# The plate counts as held below this share of its highest speed, after the servo has settled, and
# where that lasts long enough for torque to change.
_STILL_SHARE = 0.1
_SETTLED_S = 0.1
_HELD_S = 0.08
_MARGIN_S = 0.03
_FEWEST_HOLDS = 24
# A hold lasts some tenths of a second and loses its level and slope: slower low-passes than the
# first so many look alike.
_HELD_LOW_PASSES = 6
# Relative to the trace: low-passes of 5 and 15 ms differ little in what tremor and reflexes hold.
_HELD_RIDGE = 1e-6
# Standard errors of the compliance at rest by which it must differ from zero, so that what torque
# did to the plate can be taken out of the movement: to a twentieth.
_PRECISE_ERRORS = 20.0
# Stretches that the standard errors are taken from.
_STRETCHES = 8


@dataclass(frozen=True)
class Compliance:
    """Describes how far the servo gives way under load.

    Attributes
    ----------
    rate
        Of the samples that it was fitted at [Hz].
    weights
        Of the direct path and of each of `COMPLIANCE_LOW_PASSES` [rad/N.m], shape (9,).
    at_rest
        Their sum with its standard error [rad/N.m].
    limit
        Highest frequency at which torque acts on the plate [Hz].
    """

    rate: float
    weights: np.ndarray
    at_rest: tuple[float, float]
    limit: float = _TORQUE_HZ

    @property
    def significant(self) -> bool:
        """Tell whether it differs from zero by three standard errors and is positive."""
        value, error = self.at_rest
        return value > 3.0 * error

    @property
    def precise(self) -> bool:
        """Tell whether it is known so well, at each frequency, that the movement that torque made
        can be taken out.
        """
        value, error = self.at_rest
        return np.count_nonzero(self.weights) > 1 and value > _PRECISE_ERRORS * error

    def response(self, frequency: np.ndarray) -> np.ndarray:
        """Return the compliance at each frequency [Hz], complex [rad/N.m]."""
        return compliance_response(self.weights, frequency, self.rate, self.limit)


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
        What the command alone explains of it, without a load [rad], shape (n,).
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

    @property
    def information(self) -> float:
        """Return Schwarz's criterion per sample (1978, Ann. Statist. 6, 461), lower is better."""
        left = max(1.0 - self.share, math.ulp(1.0))
        return math.log(left) + self.uncertainty * math.log(len(self.position))

    def unloaded(self) -> Servo:
        """Return the servo as the command alone moves it."""
        return replace(self, position=self.commanded, unexplained=np.zeros(len(self.commanded)))


def compliance_response(
    weights: np.ndarray, frequency: np.ndarray, rate: float, limit: float = _TORQUE_HZ
) -> np.ndarray:
    """Return the frequency response of a sum of `COMPLIANCE_LOW_PASSES`.

    Parameters
    ----------
    weights
        Of the direct path and of each low-pass [rad/N.m].
    frequency
        [Hz].
    rate
        At which the low-passes run [Hz].
    limit
        Highest frequency at which torque acts [Hz].
    """
    z = np.exp(-2j * np.pi * frequency / rate)
    total = np.full(len(frequency), weights[0], dtype=complex)
    for weight, (pole, times) in zip(weights[1:], COMPLIANCE_LOW_PASSES, strict=True):
        decay = np.exp(-1.0 / (rate * pole))
        total += weight * ((1.0 - decay) / (1.0 - decay * z)) ** times
    return total * acting_gain(frequency, limit)


def acting_gain(frequency: np.ndarray, limit: float) -> np.ndarray:
    """Return the gain with which torque acts on the plate at each frequency [Hz], below a limit
    [Hz]: zero at the mains' own.
    """
    gain = low_pass(frequency, limit, 4)
    for line in _MAINS_HZ:
        gain *= 1.0 - low_pass(np.abs(frequency - line), _MAINS_WIDTH_HZ, 4)
    return np.asarray(gain)


def identify_servo(recording: Recording, step: int) -> Servo | None:
    """Identify the servo of a recording; None where no command was recorded or it does not move.

    Parameters
    ----------
    recording
        With its reference.
    step
        Samples of the recording for one sample of the fit.
    """
    if recording.reference is None or np.std(recording.reference) == 0.0:
        return None
    rate = recording.rate / step
    x, torque, command = (
        _thinned(signal, recording.rate, step)
        for signal in (recording.position, recording.torque, recording.reference)
    )
    limit = _acting_limit(recording)
    giving = _compliance_columns(torque, rate, limit)
    best: tuple[Servo, np.ndarray] | None = None
    for between in sorted({max(1, round(lag * rate)) for lag in LAGS_S}, reverse=True):
        following = _following_columns(command, rate, between)
        servo = _fitted(x, following, giving, rate, limit)
        if servo is not None and (best is None or servo.information < best[0].information):
            best = servo, following
    if best is None or best[0].compliance.significant:
        return None if best is None else best[0]
    # A compliance that is not there would only carry the torque's noise into the position.
    return _fitted(x, best[1], np.zeros((len(x), 0)), rate, limit)


def _acting_limit(recording: Recording) -> float:
    """Return the highest frequency [Hz] at which the torque is hardly noise, and acts."""
    spectrum = Spectrum(recording.torque, recording.rate, 1)
    clear = signal_share(spectrum.values, spectrum.frequency) > _ACTING_SHARE
    inside = spectrum.frequency[clear & (spectrum.frequency < _TORQUE_HZ)]
    return max(float(inside[-1]) if len(inside) else 0.0, _LOWEST_TORQUE_HZ)


def _fitted(
    x: np.ndarray, following: np.ndarray, giving: np.ndarray, rate: float, limit: float
) -> Servo | None:
    """Solve least squares with standard errors; None where the recording is too short for it."""
    columns = np.column_stack([following, giving])
    inner = np.zeros(len(x), dtype=bool)
    inner[int(_SKIP_S * rate) : -int(0.5 * rate)] = True
    if inner.sum() < 4 * columns.shape[1]:
        return None
    scale = np.linalg.norm(columns[inner], axis=0)
    scale[scale == 0.0] = 1.0
    parts = np.array_split(np.flatnonzero(inner), _STRETCHES)
    grams = np.array([(columns[p] / scale).T @ (columns[p] / scale) for p in parts])
    rights = np.array([(columns[p] / scale).T @ x[p] for p in parts])
    weights = _solved(grams.sum(axis=0), rights.sum(axis=0)) / scale
    count = following.shape[1]
    # The jackknife over stretches (Künsch 1989): each draw leaves one of them out.
    drawn = np.array(
        [
            _solved(grams.sum(axis=0) - g, rights.sum(axis=0) - r) / scale
            for g, r in zip(grams, rights, strict=True)
        ]
    )
    at_rest = np.column_stack([drawn[:, :count].sum(axis=1), -drawn[:, count:].sum(axis=1)])
    spread = np.sqrt((_STRETCHES - 1) * at_rest.var(axis=0))
    position = columns @ weights
    return Servo(
        rate,
        position,
        following @ weights[:count],
        (x - position) * _fade(inner, rate),
        Compliance(
            rate,
            -weights[count:] if giving.shape[1] else np.zeros(1 + len(COMPLIANCE_LOW_PASSES)),
            (float(-weights[count:].sum()), float(spread[1])),
            limit,
        ),
        (float(weights[:count].sum()), float(spread[0])),
        1.0 - float(np.var((x - position)[inner]) / np.var(x[inner])),
        columns.shape[1] / float(inner.sum()),
    )


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
    return np.column_stack(columns + [_low_passed(command, rate, pole) for pole in SLOW_POLES_S])


def _compliance_columns(torque: np.ndarray, rate: float, limit: float = _TORQUE_HZ) -> np.ndarray:
    # Fast torque is noise and what the movement's inertia makes; the drive's own mass holds it.
    spectrum = Spectrum(torque, rate, 1)
    smooth = spectrum.read(acting_gain(spectrum.frequency, limit))
    return np.column_stack(
        [smooth, *(_low_passed(smooth, rate, *stages) for stages in COMPLIANCE_LOW_PASSES)]
    )


def _low_passed(signal: np.ndarray, rate: float, pole: float, times: int = 1) -> np.ndarray:
    """Return a signal behind so many low-passes with a pole [s] in series, settled at its first
    value.
    """
    decay = np.exp(-1.0 / (rate * pole))
    for _ in range(times):
        settled = [decay * signal[0]]
        signal = lfilter([1.0 - decay], [1.0, -decay], signal, zi=settled)[0]
    return np.asarray(signal)


def _solved(gram: np.ndarray, right: np.ndarray) -> np.ndarray:
    regular = gram + _RIDGE * np.trace(gram) * np.eye(len(gram))
    return np.asarray(cho_solve(cho_factor(regular), right))


def held_compliance(
    position: np.ndarray, velocity: np.ndarray, torque: np.ndarray, rate: float
) -> Compliance | None:
    """Return the compliance where no command was recorded, from the moments at which it stands
    still.

    While the command is held, whatever the position does is what torque makes of it.

    Parameters
    ----------
    position, velocity, torque
        Without the encoder's noise [rad, rad/s, N.m], each of shape (n,).
    rate
        Of them [Hz].

    Returns
    -------
    Compliance | None
        None where the plate is hardly ever held.
    """
    moving = np.abs(velocity) > _STILL_SHARE * np.percentile(np.abs(velocity), 99.0)
    settling = np.convolve(moving, np.ones(int(_SETTLED_S * rate)))[: len(moving)] > 0.5
    edges = np.flatnonzero(np.diff(np.concatenate([[1], settling.astype(int), [1]])))
    # The zero-phase filters of the movement reach back from the next edge.
    margin = int(_MARGIN_S * rate)
    runs = [
        (begin, end - margin)
        for begin, end in zip(edges[::2], edges[1::2], strict=True)
        if end - margin - begin > _HELD_S * rate
    ]
    if len(runs) < _FEWEST_HOLDS:
        return None
    columns = _compliance_columns(torque - torque.mean(), rate)[:, : 1 + _HELD_LOW_PASSES]
    products = [_held_products(position[b:e], columns[b:e]) for b, e in runs]
    parts = np.array_split(np.arange(len(runs)), _STRETCHES)
    grams, rights = (
        np.array([np.sum([products[i][k] for i in part], axis=0) for part in parts]) for k in (0, 1)
    )
    by_frequency = _held_weights(grams, rights, rate)
    # What is not known well has no course over frequency that is worth anything.
    if by_frequency.precise:
        return by_frequency
    return _held_weights(grams[:, :1, :1], rights[:, :1], rate)


def _held_weights(grams: np.ndarray, rights: np.ndarray, rate: float) -> Compliance:
    """Return the compliance from products of the torque's columns with each other, shape
    (stretches, p, p), and with the position, shape (stretches, p), at a rate [Hz].
    """
    gram, right = grams.sum(axis=0), rights.sum(axis=0)
    ridge = _HELD_RIDGE * np.trace(gram) * np.eye(len(gram))
    found = -np.linalg.solve(gram + ridge, right)
    # The jackknife over stretches (Künsch 1989), as for a servo whose command was recorded.
    drawn = [
        -np.linalg.solve(gram - g + ridge, right - r).sum()
        for g, r in zip(grams, rights, strict=True)
    ]
    error = float(np.sqrt((_STRETCHES - 1) * np.var(drawn)))
    weights = np.zeros(1 + len(COMPLIANCE_LOW_PASSES))
    weights[: len(found)] = found
    return Compliance(rate, weights, (float(found.sum()), error))


def _held_products(position: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the products of the torque's columns (n, p) with each other, shape (p, p), and with
    the position (n,), shape (p,), during one hold, without level and slope: a servo settles slowly.
    """
    time = np.linspace(-1.0, 1.0, len(position))
    basis, _ = np.linalg.qr(np.column_stack([np.ones(len(time)), time]))
    moved, load = (signal - basis @ (basis.T @ signal) for signal in (position, columns))
    return load.T @ load, load.T @ moved
