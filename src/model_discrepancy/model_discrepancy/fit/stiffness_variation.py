"""How much the stiffness varies in the course of a recording, from the residual of a fit."""

from __future__ import annotations

import numpy as np

from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.reflex_variation import ReflexVariation, spread_beyond_noise

# Muscles that stiffen after a startle, or let go, do so within a quarter of a second (Brown et al.,
# Brain 114 (1991) 1891): pieces of the recording that are shorter follow them.
_PIECE_S = 0.1
_FEWEST_PIECES = 50


def stiffness_variation(
    fitter: Fitter, fit: Fit, reflex: ReflexVariation, mean: float
) -> tuple[float, float] | None:
    """Return the standard deviation of the stiffness over short pieces of a recording, beyond what
    noise makes, as a share of its mean, with its standard error.

    Parameters
    ----------
    fitter, fit
        A model with stiffness, and its residual.
    reflex
        How its reflex varies. Where responses overlap, what that leaves is not known well enough.
    mean
        Stiffness of the base model [N.m/rad]: beside terms that act like a spring a model's own may
        be next to nothing.

    Returns
    -------
    tuple or None
        None where responses overlap, and without stiffness.
    """
    if not reflex.apart or mean <= 0.0 or "stiffness" not in fit.values:
        return None
    rows = fitter.rows
    spectrum = fitter.columns.spectra(fit.values)[("stiffness", "K")]
    torque = rows.whitened(mean * spectrum)
    length = int(_PIECE_S * rows.rate)
    kept = rows.count // length * length
    whole = rows.used[:kept].reshape(-1, length).all(axis=1)
    own, left = (signal[:kept].reshape(-1, length)[whole] for signal in (torque, reflex.residual))
    power = np.sum(own**2, axis=1)
    if np.count_nonzero(power) < _FEWEST_PIECES:
        return None
    own, left, power = own[power > 0.0], left[power > 0.0], power[power > 0.0]
    size = np.sum(own * left, axis=1) / power
    noise = float(np.mean(reflex.residual[rows.used] ** 2))
    return spread_beyond_noise(size - np.average(size, weights=power), power, noise)
