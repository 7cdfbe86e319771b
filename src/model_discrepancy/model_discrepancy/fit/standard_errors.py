"""Standard errors of a fit: those of whitened least squares, or of disjoint stretches of data."""

from __future__ import annotations

import numpy as np

from ankle_physics.term import ModelValues, term_library
from model_discrepancy.fit.block_bootstrap import bootstrap_changes
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.parameter_scale import stretch

# Of the largest eigenvalue: below it the data say nothing about a sum of parameters.
_SMALLEST_SHARE = 1e-12


def with_errors(fitter: Fitter, fit: Fit) -> Fit:
    """Return the fit with standard errors; parameters at bounds and absent ones are held.

    The errors are those of whitened least squares or of stretches, whichever are larger, and no
    larger than the range of a parameter: a stop that a foot never reaches may lie anywhere in it.
    """
    matrix, labels = fitter.derivatives(fit)
    used = fitter.rows.used
    held = {*fit.at_bounds, *fit.absent}
    free = [k for k, (name, symbol) in enumerate(labels) if f"{name}.{symbol}" not in held]
    part = matrix[used][:, free]
    scale = np.linalg.norm(part, axis=0)
    scale[scale == 0] = 1.0
    information = (part / scale).T @ (part / scale)
    variance = fit.score / max(int(used.sum()) - len(free), 1)
    root = _inverse_root(information) * np.sqrt(variance) / scale[:, None]
    changes = bootstrap_changes(matrix[:, free], fit.residual, used, fitter.rows.rate)
    drawn = np.std(changes, axis=0, ddof=1)
    errors: ModelValues = {name: {} for name in fit.terms}
    spreads = np.fmax(np.linalg.norm(root, axis=1), drawn)
    for place, (k, spread) in enumerate(zip(free, spreads, strict=True)):
        name, symbol = labels[k]
        parameter = term_library()[name].parameter(symbol)
        unit = 1.0 if parameter.linear else stretch(parameter, fit.values[name][symbol])
        errors[name][symbol] = float(min(spread * unit, parameter.upper - parameter.lower))
        if np.isfinite(drawn[place]) and drawn[place] > 0.0:
            fit.draws[name, symbol] = changes[:, place] * unit
            fit.spreads[name, symbol] = root[place] * unit
    fit.errors = errors
    return fit


def _inverse_root(information: np.ndarray) -> np.ndarray:
    """Return R of the pseudo-inverse ``R R^T`` of a symmetric matrix, shape (p, p)."""
    values, vectors = np.linalg.eigh(information)
    kept = values > _SMALLEST_SHARE * values.max(initial=0.0)
    roots = np.zeros_like(values)
    roots[kept] = 1.0 / np.sqrt(values[kept])
    return vectors * roots
