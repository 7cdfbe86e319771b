"""How much the reflex varies from stretch to stretch, from the residual of a fit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ankle_physics.term import Place, term_library
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter

# After the plate's last movement the joint is at rest again.
REST_S = 0.3
# A pulse stays at its level for 40 ms (van 't Veld et al. 2018, section II-B), and a margin for
# slow ramps.
_LONGEST_PULSE_S = 0.1
# Rows at rest that give a ratio of powers to 10 %.
LEAST_ROWS = 200
# Stretch reflexes at rest vary by 10 to 40 % from one stretch to the next, habituation included
# (Kearney & Chan 1979; Stein & Kearney 1995); beyond this they do something else.
USUAL_REFLEX_VARIATION = 0.5
# The response of one stretch, from the reflex' delay on.
_RESPONSE_S = 0.3
_FEWEST_STRETCHES = 10
# Family of terms that answer by themselves, each after a delay of its own.
FURTHER_ARCS = "further reflex arc"
# Responses that overlap more than this (a multisine's) do not tell which stretch differs in what.
_LEAST_COMPLETE = 0.9
# Of the highest velocity, at which a stretch begins.
_STRETCH_SHARE = 0.15


@dataclass(frozen=True)
class ReflexVariation:
    """Describes how the reflex differs from stretch to stretch.

    Attributes
    ----------
    spread
        Standard deviation of its size as a share of the mean size, with its standard error; None
        where the reflex is too small or stretches are too few.
    residual
        Whitened residual without what each stretch's own size makes of it, shape (rows.count,).
    torque
        That part as plain torque [N.m], shape (rows.count,).
    serial
        Correlation of the sizes of successive stretches, with its standard error; None where they
        vary by no more than noise makes them, or responses overlap.
    timing
        Standard deviation of its time [s], with its standard error; None where responses overlap.
    apart
        Whether the responses lie apart, so that `residual` is what each of them leaves.
    """

    spread: tuple[float, float] | None
    residual: np.ndarray
    torque: np.ndarray
    serial: tuple[float, float] | None = None
    timing: tuple[float, float] | None = None
    apart: bool = False


def reflex_variation(fitter: Fitter, fit: Fit) -> ReflexVariation:
    """Return how the reflex differs from stretch to stretch.

    Parameters
    ----------
    fitter, fit
        A model with a reflex, and its residual.
    """
    none = ReflexVariation(None, fit.residual, np.zeros(fitter.rows.count))
    reflex = fit.values.get("reflex")
    if reflex is None or reflex["G"] <= 0.0:
        return none
    rows = fitter.rows
    torque = _stretch_reflex(fitter, fit)
    response, plain = rows.whitened(torque), rows.plain(torque)
    later = -rows.rate * np.gradient(response)  # by one second
    residual, varying = fit.residual.copy(), np.zeros(rows.count)
    found = []
    for first, last in _responses(fitter, reflex["delay"]):
        own, shift, left = response[first:last], later[first:last], residual[first:last]
        power = float(own @ own)
        if power == 0.0:
            continue
        size = float(own @ left) / power
        shift = shift - float(own @ shift) / power * own
        left = left - size * own
        timing_power = float(shift @ shift)
        time = float(shift @ left) / max(timing_power, 1e-30)
        found.append((size, power, time, timing_power, last - first))
        residual[first:last] = left
        varying[first:last] = size * plain[first:last]
    if len(found) < _FEWEST_STRETCHES:
        return none
    size, power, time, timing_power, length = np.array(found).T
    noise = _level_at_rest(fitter, fit.residual)
    spread = spread_beyond_noise(size, power, noise)
    if spread is None or np.sqrt(len(size) * noise / power.sum()) > USUAL_REFLEX_VARIATION:
        return none
    if np.median(length) < _LEAST_COMPLETE * int(_RESPONSE_S * rows.rate):
        return ReflexVariation(spread, residual, varying)
    timing = spread_beyond_noise(time - np.average(time, weights=timing_power), timing_power, noise)
    return ReflexVariation(
        spread, residual, varying, _serial(size, power, noise), timing, apart=True
    )


def _stretch_reflex(fitter: Fitter, fit: Fit) -> np.ndarray:
    """Return the spectrum of the torque of the reflex and of what changes its gain.

    A term that follows activation or position takes a part of the reflex' own gain, so that what is
    left of that alone is no measure of the reflex.
    """
    library = term_library()
    parts = [
        fit.values[name][symbol] * spectrum
        for (name, symbol), spectrum in fitter.columns.spectra(fit.values).items()
        if library[name].place is Place.REFLEX_DYNAMICS and library[name].family != FURTHER_ARCS
    ]
    return np.sum(parts, axis=0)


def _responses(fitter: Fitter, delay: float) -> Iterator[tuple[int, int]]:
    """Yield the first row and the one behind the last of each stretch's response."""
    rows = fitter.rows
    starts = _stretch_times(fitter) + delay
    length = int(_RESPONSE_S * rows.rate)
    for begin, following in zip(starts, [*starts[1:], np.inf], strict=True):
        first = int(begin * rows.rate)
        last = min(first + length, int(min(following, 1e9) * rows.rate), rows.count)
        if last - first >= length // 3 and rows.used[first:last].all():
            yield first, last


def spread_beyond_noise(
    value: np.ndarray, power: np.ndarray, noise: float
) -> tuple[float, float] | None:
    """Return the standard deviation of values beyond what noise makes, and its standard error.

    A stretch with a small response says little about its size and much about the noise, so that
    its weight is the power of its regressor.

    Parameters
    ----------
    value
        Of each stretch, without their mean, shape (n,).
    power
        Sum of squares of each stretch's regressor, shape (n,).
    noise
        Power of the noise beside it.

    Returns
    -------
    tuple or None
        None where no regressor has any power.
    """
    total = float(power.sum())
    if total <= 0.0:
        return None
    chance = len(value) * noise / total
    variance = float(power @ value**2) / total - chance
    error = np.sqrt(2.0 / len(value)) * (max(variance, 0.0) + chance)
    spread = float(np.sqrt(max(variance, 0.0)))
    return spread, float(error / (2.0 * max(spread, np.sqrt(error))))


def _serial(size: np.ndarray, power: np.ndarray, noise: float) -> tuple[float, float] | None:
    """Return the correlation of successive sizes, without what noise adds to their variance."""
    weight = np.sqrt(power)
    deviation = weight * (size - np.average(size, weights=power))
    total = float(deviation @ deviation)
    beyond = total - len(size) * noise
    if beyond < 0.5 * total:
        return None
    correlation = float(deviation[1:] @ deviation[:-1]) / beyond
    return correlation, float(total / beyond / np.sqrt(len(size)))


def _stretch_times(fitter: Fitter) -> np.ndarray:
    """Return when each stretch of the calf begins [s], also right after another movement."""
    motion = fitter.motion
    fast = motion.velocity > _STRETCH_SHARE * np.percentile(motion.velocity, 99.5)
    return np.flatnonzero(np.diff(fast.astype(int)) == 1) / motion.rate


def since_movement(fitter: Fitter) -> np.ndarray:
    """Return the time of each row since the plate moved last [s]; infinite before the first
    movement.
    """
    moving, last = _last_moving(fitter)
    return np.where(last >= 0, fitter.rows.time - moving[np.maximum(last, 0)], np.inf)


def moved_from_rest(fitter: Fitter) -> np.ndarray:
    """Return whether the joint was at rest before the plate's last movement, for each row, so that
    no earlier response reaches into this one. A pulse, which goes back at once, is one movement.
    """
    moving, last = _last_moving(fitter)
    still = np.diff(moving, prepend=-np.inf)
    begins = still > _LONGEST_PULSE_S
    from_rest = (still[begins] > REST_S)[np.cumsum(begins) - 1]
    return (last >= 0) & from_rest[np.maximum(last, 0)]


def _last_moving(fitter: Fitter) -> tuple[np.ndarray, np.ndarray]:
    """Return the times at which the plate moves [s], and for each row which of them was last; -1
    before the first one.
    """
    motion = fitter.motion
    speed = np.abs(motion.velocity)
    moving = np.flatnonzero(speed > _STRETCH_SHARE * np.percentile(speed, 99.5)) / motion.rate
    return moving, np.searchsorted(moving, fitter.rows.time, side="right") - 1


def _level_at_rest(fitter: Fitter, residual: np.ndarray) -> float:
    """Return the power of the whitened residual at rest; of all of it without any rest."""
    used = fitter.rows.used
    rest = used & (since_movement(fitter) > REST_S)
    return float(np.mean(residual[rest if rest.sum() >= LEAST_ROWS else used] ** 2))
