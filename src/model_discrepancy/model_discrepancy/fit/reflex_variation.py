"""How much the reflex varies from stretch to stretch, from the residual of a fit."""

from __future__ import annotations

import numpy as np

from model_discrepancy.fit.fitter import Fit, Fitter

# After the plate's last movement the joint is at rest again.
REST_S = 0.3
# Rows at rest that give a ratio of powers to 10 %.
LEAST_ROWS = 200
# Stretch reflexes at rest vary by 10 to 40 % from one stretch to the next, habituation included
# (Kearney & Chan 1979; Stein & Kearney 1995); beyond this they do something else.
USUAL_REFLEX_VARIATION = 0.5
# The response of one stretch, from the reflex' delay on.
_RESPONSE_S = 0.3
_FEWEST_STRETCHES = 10
# Of the highest velocity, at which a stretch begins.
_STRETCH_SHARE = 0.15


def varying_reflex_torque(fitter: Fitter, fit: Fit) -> np.ndarray:
    """Return the torque by which each stretch's reflex differs from the mean one.

    Parameters
    ----------
    fitter, fit
        Of the base model.

    Returns
    -------
    np.ndarray
        Plain rows [N.m], shape (rows.count,); zero where the reflex is too small to tell.
    """
    return reflex_variation(fitter, fit)[2]


def reflex_variation(
    fitter: Fitter, fit: Fit
) -> tuple[tuple[float, float] | None, np.ndarray, np.ndarray]:
    """Return the relative spread of the reflex with its standard error, the whitened residual
    without what each stretch's own size makes of it, and that part as plain torque.
    """
    residual = fit.residual.copy()
    varying = np.zeros(fitter.rows.count)
    reflex = fit.values.get("reflex")
    if reflex is None or reflex["G"] <= 0.0:
        return None, residual, varying
    rows = fitter.rows
    spectra = fitter.columns.spectra(fit.values)
    torque = reflex["G"] * spectra["reflex", "G"]
    response, plain = rows.whitened(torque), rows.plain(torque)
    starts = _stretch_times(fitter) + reflex["delay"]
    length = int(_RESPONSE_S * rows.rate)
    sizes, powers = [], []
    for begin, following in zip(starts, [*starts[1:], np.inf], strict=True):
        first = int(begin * rows.rate)
        last = min(first + length, int(min(following, 1e9) * rows.rate), rows.count)
        if last - first < length // 3 or not rows.used[first:last].all():
            continue
        own, left = response[first:last], residual[first:last]
        power = float(own @ own)
        if power > 0.0:
            sizes.append(float(own @ left) / power)
            powers.append(power)
            residual[first:last] = left - sizes[-1] * own
            varying[first:last] = sizes[-1] * plain[first:last]
    if len(sizes) < _FEWEST_STRETCHES:
        return None, fit.residual, varying
    noise = _level_at_rest(fitter, fit.residual)
    size, weight = np.array(sizes), np.array(powers)
    # A stretch with a small response says little about its size and much about the noise.
    total = float(weight.sum())
    chance = len(size) * noise / total
    variance = float(weight @ size**2) / total - chance
    error = np.sqrt(2.0 / len(size)) * (max(variance, 0.0) + chance)
    if np.sqrt(chance) > USUAL_REFLEX_VARIATION:
        return None, fit.residual, np.zeros(fitter.rows.count)
    spread = float(np.sqrt(max(variance, 0.0)))
    return (spread, float(error / (2.0 * max(spread, np.sqrt(error))))), residual, varying


def _stretch_times(fitter: Fitter) -> np.ndarray:
    """Return when each stretch of the calf begins [s], also right after another movement."""
    motion = fitter.motion
    fast = motion.velocity > _STRETCH_SHARE * np.percentile(motion.velocity, 99.5)
    return np.flatnonzero(np.diff(fast.astype(int)) == 1) / motion.rate


def since_movement(fitter: Fitter) -> np.ndarray:
    """Return the time of each row since the plate moved last [s]; infinite before the first
    movement.
    """
    motion, rows = fitter.motion, fitter.rows
    speed = np.abs(motion.velocity)
    moving = np.flatnonzero(speed > _STRETCH_SHARE * np.percentile(speed, 99.5))
    last = np.searchsorted(moving / motion.rate, rows.time, side="right") - 1
    return np.where(last >= 0, rows.time - moving[np.maximum(last, 0)] / motion.rate, np.inf)


def _level_at_rest(fitter: Fitter, residual: np.ndarray) -> float:
    """Power of the whitened residual at rest, or everywhere where the joint is never at rest."""
    used = fitter.rows.used
    rest = used & (since_movement(fitter) > REST_S)
    return float(np.mean(residual[rest if rest.sum() >= LEAST_ROWS else used] ** 2))
