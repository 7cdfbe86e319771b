"""How much the inertia seems to change in the course of a recording.

A body's inertia does not: where it seems to, and slowly, the gain of the torque channel changes, or
what carries the foot loosens.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import f as f_distribution

from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter

# Long against the whitening filter, short against the warming of an amplifier.
_PIECE_S = 2.0
# Half and whole waves over the recording: what changes faster is no drift.
_WAVES = 4
# Pieces beside each wave: their scatter about the drift says how much is chance.
_FEWEST_PIECES = 4 * _WAVES
# One recording in ten thousand shows as much by chance.
_CHANCE = 1e-4
_TERMS = (("inertia", "I"), ("viscosity", "B"), ("stiffness", "K"), ("reflex", "G"))


def inertia_course(fitter: Fitter, fit: Fit) -> tuple[float, float] | None:
    """Return the standard deviation of a slow drift of the inertia as a share of it, with its
    standard error.

    Each piece of the recording tells its own inertia beside its own viscosity, stiffness and
    reflex. Their drift is a sum of four cosines of half a wave over the recording and its
    multiples, weighted by what each piece knows.

    Parameters
    ----------
    fitter, fit
        A model and its residual.

    Returns
    -------
    tuple or None
        Both 0 where the drift is no more than chance makes of the scatter of the pieces. None
        without inertia, and where the pieces are too few.
    """
    if fit.values.get("inertia", {"I": 0.0})["I"] <= 0.0:
        return None
    shown = _shown(fitter, fit)
    if len(shown) < _FEWEST_PIECES:
        return None
    time, size, information = shown.T
    weight = np.sqrt(information)
    waves = np.cos(np.pi * np.outer(time, np.arange(_WAVES + 1)))
    found, *_ = np.linalg.lstsq(waves * weight[:, None], size * weight, rcond=None)
    scatter = float(np.sum(information * (size - waves @ found) ** 2)) / (len(size) - _WAVES - 1)
    mean = float(np.average(size, weights=information))
    drifts = float(np.sum(information * (waves @ found - mean) ** 2)) / _WAVES
    if scatter <= 0.0 or drifts < scatter * f_distribution.isf(
        _CHANCE, _WAVES, len(size) - _WAVES - 1
    ):
        return 0.0, 0.0
    # What chance adds to the square of each wave is taken off.
    square = _WAVES * (drifts - scatter) / float(np.sum(information))
    error = float(np.sqrt(scatter / np.sum(information)))
    return float(np.sqrt(square)), error


def _shown(fitter: Fitter, fit: Fit) -> np.ndarray:
    """Return what each piece shows, shape (pieces, 3): its time [shares of the recording], the
    change of the inertia [shares of the inertia], and what it knows of that.
    """
    rows = fitter.rows
    spectra = fitter.columns.spectra(fit.values)
    own = np.column_stack(
        [
            rows.whitened(spectra[column] * fit.values[column[0]][column[1]])
            for column in _TERMS
            if column in spectra
        ]
    )
    length = int(_PIECE_S * rows.rate)
    shown = []
    for first in range(0, rows.count - length + 1, length):
        piece = slice(first, first + length)
        used = rows.used[piece]
        mass, *others = own[piece][used].T
        left = fit.residual[piece][used]
        basis, _ = np.linalg.qr(np.column_stack([*others, np.ones(len(left))]))
        alone = mass - basis @ (basis.T @ mass)
        # Less than a third of the piece tells of nothing but its edges.
        if used.sum() > length / 3 and (power := float(alone @ alone)) > 0.0:
            shown.append(((first + 0.5 * length) / rows.count, float(alone @ left) / power, power))
    return np.reshape(shown, (-1, 3))
