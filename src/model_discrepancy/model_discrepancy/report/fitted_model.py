"""A fitted model as the content of a model file."""

from __future__ import annotations

from collections.abc import Mapping

from ankle_physics.model import Model
from ankle_physics.term import term_library
from model_discrepancy.fit.fit_result import Fit


def to_model(values: Mapping[str, Mapping[str, float]], title: str) -> Model:
    """Return the model of these values, each within its range.

    Parameters
    ----------
    values
        By term and symbol.
    title
        Free text.
    """
    return Model.of(
        {
            name: {symbol: _inside(name, symbol, value) for symbol, value in given.items()}
            for name, given in values.items()
        },
        title,
    )


def _inside(name: str, symbol: str, value: float) -> float:
    parameter = term_library()[name].parameter(symbol)
    return min(max(value, parameter.lower), parameter.upper)


def fitted_model(fit: Fit, title: str) -> Model:
    """Return a fit's model with its standard errors."""
    model = to_model(fit.values, title)
    for entry in model.entries:
        entry.standard_errors = dict(fit.errors.get(entry.term.name, {}))
    return model
