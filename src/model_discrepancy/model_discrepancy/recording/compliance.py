"""How far the servo gives way under load: its response, and what the holds tell of it.

While a command is held, the position is ``x = n - C torque``: C [rad/N.m] is the compliance and n
the drive's own vibration. The joint answers that vibration by its intrinsic impedance Z, so that
the torque is ``Z x + d``. Only d, which no present movement causes (reflexes, voluntary torque,
tremor), tells C from 1 / Z: it is the instrument (Söderström & Stoica 1983, Instrumental Variable
Methods for System Identification). Where the command was recorded, `servo` finds the same response
together with how the drive follows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import rfft, rfftfreq
from scipy.signal import lfilter

from model_discrepancy.recording.drive_mode import STARTS, DriveMode, least_point, mode_at
from model_discrepancy.recording.spectrum import Spectrum, low_pass

# Poles of the slow part of the compliance [s]: an integrator, or what else settles. What is faster
# is the drive's mode.
COMPLIANCE_POLES_S = (0.05, 0.2, 1.0)
# Reflexes, tremor and voluntary torque lie about this frequency, at which a compliance is stated. A
# controller with an integrator does not give way at rest, and does there.
STATED_HZ = 3.0
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
# What no movement causes, behind these modes, tells the drive's mode.
_INSTRUMENTS = [DriveMode(frequency, 0.7) for frequency in (8.0, 14.0, 24.0, 40.0, 70.0)]
# Of the position during holds: where what no movement causes explains less of it, it does not tell
# the mode.
_LEAST_TOLD = 0.5
# Reflexes of one shape tell a slow, ringing drive hardly from a fast one. What is left open so far
# is not told apart, and a mode that is an octave from the usual has to leave a tenth less:
# controllers are tuned to 20 to 60 Hz and a damping of 0.5 to 1.
_UNDECIDED_SHARE, _COST_OF_OCTAVE = 0.002, 0.1
_USUAL_MODE = np.log([35.0, 0.8])
# Standard errors of the stated compliance by which it must differ from zero, so that what torque
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
        Of the direct path and of a low-pass with each of `COMPLIANCE_POLES_S` [rad/N.m], shape
        (4,).
    magnitude
        Of the response to torque of `STATED_HZ`, before the drive's mass acts, with its standard
        error [rad/N.m].
    limit
        Highest frequency at which torque acts on the plate [Hz].
    lines
        Frequencies at which it is pick-up [Hz].
    mode
        Of the drive's mass, which follows all of these; None where it is not known.
    """

    rate: float
    weights: np.ndarray
    magnitude: tuple[float, float]
    limit: float = TORQUE_HZ
    lines: tuple[float, ...] = ()
    mode: DriveMode | None = None

    @property
    def significant(self) -> bool:
        """Tell whether its magnitude is positive by three standard errors."""
        value, error = self.magnitude
        return value > 3.0 * error

    @property
    def precise(self) -> bool:
        """Tell whether it is known so well, at each frequency, that the movement that torque made
        can be taken out.
        """
        value, error = self.magnitude
        return self.mode is not None and value > _PRECISE_ERRORS * error

    def response(self, frequency: np.ndarray) -> np.ndarray:
        """Return the compliance at each frequency [Hz], complex [rad/N.m]."""
        total = _path_responses(frequency, self.rate) @ self.weights
        mode = 1.0 if self.mode is None else self.mode.response(frequency)
        return np.asarray(total * mode * _acting_gain(frequency, self.limit, self.lines))


def _path_responses(frequency: np.ndarray, rate: float) -> np.ndarray:
    """Return the response of each weighted path, complex, shape (frequencies, 4)."""
    z = np.exp(-2j * np.pi * frequency / rate)
    decays = [np.exp(-1.0 / (rate * pole)) for pole in COMPLIANCE_POLES_S]
    slow = [(1.0 - decay) / (1.0 - decay * z) for decay in decays]
    return np.column_stack([np.ones(len(frequency)), *slow])


def stated_magnitude(weights: np.ndarray, rate: float) -> np.ndarray:
    """Return what is stated of a compliance [rad/N.m], as `Compliance.magnitude`.

    Parameters
    ----------
    weights
        As `Compliance.weights`, shape (..., 4).
    rate
        Of the samples that it was fitted at [Hz].
    """
    return np.asarray(weights @ _path_responses(np.array([STATED_HZ]), rate)[0].real)


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
    torque: np.ndarray,
    rate: float,
    limit: float,
    lines: tuple[float, ...],
    mode: DriveMode | None = None,
) -> np.ndarray:
    """Return torque [N.m] as it acts on the plate, alone and behind a low-pass with each of
    `COMPLIANCE_POLES_S`, shape (n, 4).

    Parameters
    ----------
    torque
        As it was measured, shape (n,).
    rate
        Of its samples [Hz].
    limit, lines, mode
        As those of `Compliance`.
    """
    # Fast torque is noise and what the movement's inertia makes; the drive's own mass holds it.
    spectrum = Spectrum(torque, rate, 1)
    gain = _acting_gain(spectrum.frequency, limit, lines)
    acting = spectrum.read(gain if mode is None else gain * mode.response(spectrum.frequency))
    slow = [low_passed(acting, rate, pole) for pole in COMPLIANCE_POLES_S]
    return np.column_stack([acting, *slow])


def low_passed(signal: np.ndarray, rate: float, pole: float) -> np.ndarray:
    """Return a signal behind a low-pass with a pole [s], settled at its first value."""
    decay = np.exp(-1.0 / (rate * pole))
    settled = [decay * signal[0]]
    return np.asarray(lfilter([1.0 - decay], [1.0, -decay], signal, zi=settled)[0])


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
    load, instrument = torque - torque.mean(), not_intrinsic - not_intrinsic.mean()
    moved = [_held(position[:, None], [run])[:, 0] for run in runs]

    def at_each(limit: float, mode: DriveMode | None) -> Compliance:
        acting, instruments = (
            compliance_columns(signal, rate, limit, lines, mode)[:, :1]
            for signal in (load, instrument)
        )
        products = []
        for run, distance in zip(runs, moved, strict=True):
            told = _held(instruments, [run])[:, 0]
            products.append((told @ _held(acting, [run])[:, 0], told @ distance))
        # The jackknife over stretches (Künsch 1989), as for a servo whose command was recorded.
        stretches = np.array_split(np.array(products), STRETCHES)
        sums = np.array([stretch.sum(axis=0) for stretch in stretches])
        whole = sums.sum(axis=0)
        drawn = [-(whole - part)[1] / (whole - part)[0] for part in sums]
        weights = np.zeros(1 + len(COMPLIANCE_POLES_S))
        weights[0] = -whole[1] / whole[0]
        error = float(np.sqrt((STRETCHES - 1) * np.var(drawn)))
        return Compliance(rate, weights, (float(weights[0]), error), limit, lines, mode)

    mode = _held_mode(position, load, instrument, runs, rate, lines)
    if mode is not None and mode.likely:
        by_frequency = at_each(TORQUE_HZ, mode)
        if by_frequency.precise:
            return by_frequency
    # What is not known well has no course over frequency that is worth anything.
    return at_each(HELD_HZ, None)


def _held_mode(
    position: np.ndarray,
    load: np.ndarray,
    instrument: np.ndarray,
    runs: Sequence[tuple[int, int]],
    rate: float,
    lines: tuple[float, ...],
) -> DriveMode | None:
    """Return the mode of the drive that explains best what the instrument makes of the position in
    these holds (two-stage least squares; Söderström & Stoica 1983); None where that is little.
    """
    made = [
        compliance_columns(instrument, rate, TORQUE_HZ, lines, mode)[:, :1]
        for mode in (None, *_INSTRUMENTS)
    ]
    basis = np.linalg.qr(_held(np.column_stack(made), runs))[0]
    held = _held(position[:, None], runs)[:, 0]
    wanted = basis.T @ held
    if wanted @ wanted < _LEAST_TOLD * (held @ held):
        return None

    def left(point: np.ndarray) -> float:
        acting = compliance_columns(load, rate, TORQUE_HZ, lines, mode_at(point))[:, :1]
        offered = basis.T @ _held(acting, runs)[:, 0]
        left_open = 1.0 - (offered @ wanted) ** 2 / ((offered @ offered) * (wanted @ wanted))
        octaves = (point - _USUAL_MODE) / np.log(2.0)
        return float(
            (max(left_open, 0.0) + _UNDECIDED_SHARE) * np.exp(_COST_OF_OCTAVE * (octaves @ octaves))
        )

    return mode_at(least_point(left, STARTS))


def _held(columns: np.ndarray, runs: Sequence[tuple[int, int]]) -> np.ndarray:
    """Return columns (n, p) during the holds, each without level and slope: a servo settles slowly;
    shape (samples held, p).
    """
    parts = []
    for begin, end in runs:
        time = np.linspace(-1.0, 1.0, end - begin)
        part = columns[begin:end] - columns[begin:end].mean(axis=0)
        parts.append(part - np.outer(time, time @ part / (time @ time)))
    return np.concatenate(parts)
