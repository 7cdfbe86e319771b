"""How far the servo gives way under load: its response, and what the holds tell of it.

While a command is held, the position is ``x = n - C torque``: C [rad/N.m] is the compliance and n
the drive's own vibration. The joint answers that vibration by its intrinsic impedance Z, so that
the torque is ``Z x + d``. Only d, which no present movement causes (reflexes, voluntary torque,
tremor), tells C from 1 / Z: it is the instrument (Söderström & Stoica 1983, Instrumental Variable
Methods for System Identification). Where the command was recorded, `servo` finds the same response
together with how the drive follows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import rfft, rfftfreq
from scipy.signal import lfilter

from model_discrepancy.recording.spectrum import Spectrum, low_pass

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
# Torque acts on the plate from below this frequency [Hz]; what is faster the drive's mass holds.
TORQUE_HZ = 60.0
# Where the holds tell the compliance only roughly, it is that of slow torque: reflexes, tremor and
# voluntary torque. Continued to 60 Hz, it gave two human trials of one rig movements that the plate
# never made: their channels seemed to be 2.3 and 0.9 ms apart. With 20 Hz it is 1.0 ms in both.
HELD_HZ = 20.0
# Lines of the mains in the torque are pick-up of the sensor's cable [Hz], which moves no plate: a
# movement that held it would predict it. Half the width of what is left out [Hz], for the mains
# keep their frequency so well; and its power over that of the surroundings [Hz].
_MAINS_HZ, _MAINS_WIDTH_HZ = (50.0, 60.0), 0.15
_LEAST_LINE, _AROUND_HZ = 20.0, 2.0
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
STRETCHES = 8


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
    lines
        Frequencies at which it is pick-up [Hz].
    """

    rate: float
    weights: np.ndarray
    at_rest: tuple[float, float]
    limit: float = TORQUE_HZ
    lines: tuple[float, ...] = ()

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
        z = np.exp(-2j * np.pi * frequency / self.rate)
        total = np.full(len(frequency), self.weights[0], dtype=complex)
        for weight, (pole, times) in zip(self.weights[1:], COMPLIANCE_LOW_PASSES, strict=True):
            decay = np.exp(-1.0 / (self.rate * pole))
            total += weight * ((1.0 - decay) / (1.0 - decay * z)) ** times
        return total * _acting_gain(frequency, self.limit, self.lines)


def _acting_gain(frequency: np.ndarray, limit: float, lines: tuple[float, ...]) -> np.ndarray:
    """Return the gain with which torque acts on the plate at each frequency [Hz]: below a limit,
    and not at lines of pick-up [Hz].
    """
    gain = low_pass(frequency, limit, 4)
    for line in lines:
        gain *= 1.0 - low_pass(np.abs(frequency - line), _MAINS_WIDTH_HZ, 8)
    return np.asarray(gain)


def pick_up(torque: np.ndarray, rate: float) -> tuple[float, ...]:
    """Return the frequencies of the mains [Hz] whose line stands out of the torque.

    Parameters
    ----------
    torque
        As it was measured [N.m], shape (n,).
    rate
        Of its samples [Hz].
    """
    power = np.abs(rfft((torque - torque.mean()) * np.hanning(len(torque)))) ** 2
    frequency = rfftfreq(len(torque), 1.0 / rate)

    def stands_out(line: float) -> bool:
        away = np.abs(frequency - line)
        inside, around = away < _MAINS_WIDTH_HZ, away < _AROUND_HZ
        if not inside.any():
            return False
        return bool(power[inside].max() > _LEAST_LINE * power[around & ~inside].mean())

    return tuple(line for line in _MAINS_HZ if stands_out(line))


def compliance_columns(
    torque: np.ndarray, rate: float, limit: float, lines: tuple[float, ...]
) -> np.ndarray:
    """Return torque [N.m] as it acts on the plate, alone and behind each of
    `COMPLIANCE_LOW_PASSES`, shape (n, 9).

    Parameters
    ----------
    torque
        As it was measured, shape (n,).
    rate
        Of its samples [Hz].
    limit, lines
        As those of `Compliance`.
    """
    # Fast torque is noise and what the movement's inertia makes; the drive's own mass holds it.
    spectrum = Spectrum(torque, rate, 1)
    smooth = spectrum.read(_acting_gain(spectrum.frequency, limit, lines))
    return np.column_stack(
        [smooth, *(low_passed(smooth, rate, *stages) for stages in COMPLIANCE_LOW_PASSES)]
    )


def low_passed(signal: np.ndarray, rate: float, pole: float, times: int = 1) -> np.ndarray:
    """Return a signal behind so many low-passes with a pole [s] in series, settled at its first
    value.
    """
    decay = np.exp(-1.0 / (rate * pole))
    for _ in range(times):
        settled = [decay * signal[0]]
        signal = lfilter([1.0 - decay], [1.0, -decay], signal, zi=settled)[0]
    return np.asarray(signal)


def held_compliance(
    position: np.ndarray,
    velocity: np.ndarray,
    torque: np.ndarray,
    not_intrinsic: np.ndarray,
    rate: float,
) -> Compliance | None:
    """Return the compliance where no command was recorded, from the moments at which it stands
    still.

    Parameters
    ----------
    position, velocity, torque
        Without the encoder's noise [rad, rad/s, N.m], each of shape (n,).
    not_intrinsic
        The torque without what the joint's intrinsic part makes of the movement [N.m], shape (n,):
        the instrument.
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
    lines = pick_up(torque, rate)

    def at_each(limit: float, count: int) -> Compliance:
        load, instruments = (
            compliance_columns(signal - signal.mean(), rate, limit, lines)[:, :count]
            for signal in (torque, not_intrinsic)
        )
        products = [_held_products(position[b:e], load[b:e], instruments[b:e]) for b, e in runs]
        parts = np.array_split(np.arange(len(runs)), STRETCHES)
        grams, rights = (
            np.array([np.sum([products[i][k] for i in part], axis=0) for part in parts])
            for k in (0, 1)
        )
        return _held_weights(grams, rights, rate, limit, lines)

    by_frequency = at_each(TORQUE_HZ, 1 + _HELD_LOW_PASSES)
    if by_frequency.precise:
        return by_frequency
    # What is not known well has no course over frequency that is worth anything.
    return at_each(HELD_HZ, 1)


def _held_weights(
    grams: np.ndarray, rights: np.ndarray, rate: float, limit: float, lines: tuple[float, ...]
) -> Compliance:
    """Return the compliance from products of the instrument's columns with those of the torque,
    shape (stretches, p, p), and with the position, shape (stretches, p), at a rate [Hz], below a
    limit [Hz] and without lines of pick-up [Hz].
    """
    gram, right = grams.sum(axis=0), rights.sum(axis=0)
    ridge = _HELD_RIDGE * np.trace(gram) * np.eye(len(gram))
    found = -np.linalg.solve(gram + ridge, right)
    # The jackknife over stretches (Künsch 1989), as for a servo whose command was recorded.
    drawn = [
        -np.linalg.solve(gram - g + ridge, right - r).sum()
        for g, r in zip(grams, rights, strict=True)
    ]
    error = float(np.sqrt((STRETCHES - 1) * np.var(drawn)))
    weights = np.zeros(1 + len(COMPLIANCE_LOW_PASSES))
    weights[: len(found)] = found
    return Compliance(rate, weights, (float(found.sum()), error), limit, lines)


def _held_products(
    position: np.ndarray, load: np.ndarray, instruments: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the products of the instrument's columns (n, p) with those of the torque, shape
    (p, p), and with the position (n,), shape (p,), during one hold, without level and slope: a
    servo settles slowly.
    """
    time = np.linspace(-1.0, 1.0, len(position))
    basis, _ = np.linalg.qr(np.column_stack([np.ones(len(time)), time]))
    moved, load, instruments = (
        signal - basis @ (basis.T @ signal) for signal in (position, load, instruments)
    )
    return instruments.T @ load, instruments.T @ moved
