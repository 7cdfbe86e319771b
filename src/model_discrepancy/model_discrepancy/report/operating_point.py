"""K, B, I, G and the effective stiffness of a fitted model at the recording's operating point.

They mean what `ankle_physics.impedance` defines, whatever parameters the model holds. Their
standard errors follow from draws of the recording's stretches, which carry the correlations between
parameters.
"""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from ankle_physics.impedance import OperatingPoint, impedance, shapes_effective_stiffness
from ankle_physics.term import term_library
from model_discrepancy.fit.fitter import Fit
from model_discrepancy.fit.movements import Onsets
from model_discrepancy.recording.motion import Motion
from model_discrepancy.report.fitted_model import to_model
from model_discrepancy.search.exchange import ODDS_SCALE
from model_discrepancy.search.found import Found

UNITS = {
    "K": "N.m/rad",
    "B": "N.m.s/rad",
    "I": "kg.m^2",
    "G": "N.m.s/rad",
    "K_effective": "N.m/rad",
}
# Of a standard error: small against what makes the model bend, large against rounding.
_STEP = 0.2
# An equation of the library is right to about this share of what it changes in K and G, by the 34
# recordings with hidden effects of the study of verdicts.
EQUATION_SHARE = 0.15
# By which the equations of two engines of the same joint differ, as a share of K and of G: the
# scatter that 39 recordings without mismatch left beside their standard errors.
ENGINE_SHARE = {"K": 0.003, "G": 0.015}
# Odds of a term that gains on unseen rows, but too little torque to be accepted.
_NEAR_ODDS = 0.5


def operating_point(motion: Motion, onsets: Onsets) -> OperatingPoint:
    """Return a recording's mean angle, torque and activation, its middle and its steps."""
    usual = OperatingPoint()
    apart = np.diff(onsets.time)
    return OperatingPoint(
        position=float(np.mean(motion.position)),
        torque=float(np.mean(motion.torque)),
        activation=float(np.mean(motion.activation)),
        time=0.5 * len(motion.position) / motion.rate,
        step=float(np.median(onsets.size)) if len(onsets.size) else usual.step,
        pause=max(float(np.median(apart)), 2.0 * usual.rise) if len(apart) else usual.pause,
    )


def stated_impedance(fit: Fit, at: OperatingPoint) -> dict[str, tuple[float, float | None]]:
    """Return the impedance of a fitted model with standard errors.

    Parameters
    ----------
    fit
        With its draws (`Fitter.with_errors`); without them there are no errors.
    at
        The operating point.

    Returns
    -------
    dict[str, tuple[float, float | None]]
        Value and standard error by ``K[N.m/rad]`` and so on.
    """
    here = _values(fit.values, at)
    total: dict[str, np.ndarray | float] = dict.fromkeys(UNITS, 0.0)
    for (term, symbol), drawn in fit.draws.items():
        step = _STEP * float(np.std(drawn))
        if step == 0.0:
            continue
        moved = {name: dict(given) for name, given in fit.values.items()}
        moved[term][symbol] += step
        shaping = shapes_effective_stiffness(term_library()[term]())
        there = _values(moved, at, None if shaping else here["K_effective"])
        for name in UNITS:
            total[name] = total[name] + (there[name] - here[name]) / step * drawn
    return {
        f"{name}[{unit}]": (here[name], float(np.std(total[name])) if fit.draws else None)
        for name, unit in UNITS.items()
    }


def with_model_error(
    stated: dict[str, tuple[float, float | None]],
    found: Found,
    at: OperatingPoint,
) -> dict[str, tuple[float, float | None]]:
    """Return an impedance with standard errors that hold where the model is not quite right.

    The bootstrap knows how far the numbers scatter if the equations are those of the joint. What is
    added here is what the numbers owe to the choice of equations: a share of what the found terms
    changed, and how far the rivals and near misses would move them (model averaging; Buckland,
    Burnham & Augustin 1997, Biometrics 53, 603).

    Parameters
    ----------
    stated
        Of the final model, by `stated_impedance`.
    found
        What the search found.
    at
        The operating point.

    Returns
    -------
    dict[str, tuple[float, float | None]]
        The same values with wider standard errors; None stays None.
    """
    base = _values(found.base.values, at)
    others = [
        (float(np.exp(-max(t.fit.score / found.final.score - 1.0, 0.0) / ODDS_SCALE)), t)
        for effect in found.effects
        for t in effect.rivals
    ] + [(_NEAR_ODDS, t) for t in found.near if t.criticises]
    moved = [(odds, _values(t.fit.values, at)) for odds, t in others]
    total = 1.0 + sum(odds for odds, _ in moved)
    wider: dict[str, tuple[float, float | None]] = {}
    for key, (value, error) in stated.items():
        name = key.split("[")[0]
        if error is None:
            wider[key] = (value, None)
            continue
        variance = error**2 + (EQUATION_SHARE * (value - base[name])) ** 2
        variance += (ENGINE_SHARE.get(name, 0.0) * value) ** 2
        variance += sum(odds * (there[name] - value) ** 2 for odds, there in moved) / total
        wider[key] = (value, float(np.sqrt(variance)))
    return wider


def _values(
    values: dict[str, dict[str, float]], at: OperatingPoint, effective: float | None = None
) -> dict[str, float]:
    return asdict(impedance(to_model(values, "at an operating point"), at, effective))
