"""K, B, I, G and the effective stiffness of a fitted model at the recording's operating point.

They mean what `ankle_physics.impedance` defines, whatever parameters the model holds. Their
standard errors follow from draws of the recording's stretches, which carry the correlations between
parameters.
"""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from ankle_physics.impedance import OperatingPoint, impedance
from model_discrepancy.fit.fitter import Fit
from model_discrepancy.fit.movements import Onsets
from model_discrepancy.recording.motion import Motion
from model_discrepancy.report.fitted_model import to_model

UNITS = {
    "K": "N.m/rad",
    "B": "N.m.s/rad",
    "I": "kg.m^2",
    "G": "N.m.s/rad",
    "K_effective": "N.m/rad",
}
# Of a standard error: small against what makes the model bend, large against rounding.
_STEP = 0.2


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
        there = _values(moved, at)
        for name in UNITS:
            total[name] = total[name] + (there[name] - here[name]) / step * drawn
    return {
        f"{name}[{unit}]": (here[name], float(np.std(total[name])) if fit.draws else None)
        for name, unit in UNITS.items()
    }


def _values(values: dict[str, dict[str, float]], at: OperatingPoint) -> dict[str, float]:
    return asdict(impedance(to_model(values, "at an operating point"), at))
