"""The parameters of a fit on the scale 0...1 of their ranges."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.joint_profile import joint_in_force
from ankle_physics.term import ModelValues, Parameter, term_library
from model_discrepancy.fit.signal_path import FOOT_IMPEDANCE, Column

Start = Mapping[str, Mapping[str, float]]
# Ranges that span more than this ratio are searched on a logarithmic scale.
_LOG_RATIO = 8.0
# Of numerical derivatives, in units of the scaled range 0...1.
UNIT_STEP = 1e-4
# Of "at the bound", in units of the scaled range 0...1: what a search of this tolerance leaves.
_BOUND_MARGIN = 2e-3
# The same of an amplitude, which is solved for: rounding.
_AMPLITUDE_MARGIN = 1e-9


def plausible(name: str, parameter: Parameter) -> Parameter:
    """Return a parameter of a term with the range that a fit keeps to.

    The inertia stays plausible for the joint: neither a part that swings beside the foot nor a
    mode of the sensor may take the foot's place.
    """
    if name != "inertia":
        return parameter
    lowest, _ = joint_in_force().inertia_range
    return replace(parameter, lower=lowest)


def nonlinear(names: Sequence[str]) -> list[tuple[str, Parameter]]:
    """Return the nonlinear fitted parameters of these terms, with the term's name."""
    return [
        (name, p)
        for name in names
        for p in term_library()[name].parameters
        if p.fitted and not p.linear
    ]


def searched(names: Sequence[str]) -> list[tuple[str, Parameter]]:
    """Return the parameters that a fit searches for.

    They are the nonlinear ones, and the foot's impedance where a compliant fixation filters by it.
    """
    coupled = any(issubclass(term_library()[name], CompliantCoupling) for name in names)
    foot = [
        (name, plausible(name, p))
        for name in names
        if coupled and name in FOOT_IMPEDANCE
        for p in term_library()[name].parameters
        if p.linear
    ]
    return nonlinear(names) + foot


def to_unit(parameter: Parameter, value: float) -> float:
    """Return a parameter on the scale 0...1 of its range."""
    if parameter.lower > 0 and parameter.upper / parameter.lower > _LOG_RATIO:
        return float(np.log(value / parameter.lower) / np.log(parameter.upper / parameter.lower))
    return (value - parameter.lower) / (parameter.upper - parameter.lower)


def from_unit(parameter: Parameter, unit: float) -> float:
    """Invert `to_unit`; values outside 0...1 are brought to the bounds."""
    unit = min(max(unit, 0.0), 1.0)
    if parameter.lower > 0 and parameter.upper / parameter.lower > _LOG_RATIO:
        return float(parameter.lower * (parameter.upper / parameter.lower) ** unit)
    return parameter.lower + unit * (parameter.upper - parameter.lower)


def ranges(columns: Iterable[Column]) -> tuple[np.ndarray, np.ndarray]:
    """Return lower and upper ends of the linear parameters of these columns."""
    parameters = [
        plausible(name, term_library()[name].parameter(symbol)) for name, symbol in columns
    ]
    return np.array([p.lower for p in parameters]), np.array([p.upper for p in parameters])


def stretch(parameter: Parameter, value: float) -> float:
    """Return the derivative of a parameter by its scaled value."""
    unit = to_unit(parameter, value)
    low, high = max(unit - UNIT_STEP, 0.0), min(unit + UNIT_STEP, 1.0)
    return (from_unit(parameter, high) - from_unit(parameter, low)) / (high - low)


def with_unit(values: Start, name: str, parameter: Parameter, unit: float) -> ModelValues:
    """Return the values with one parameter at another place of its scaled range."""
    changed = {n: dict(v) for n, v in values.items()}
    changed[name][parameter.symbol] = from_unit(parameter, unit)
    return changed


def absent_parts(values: Start) -> tuple[str, ...]:
    """Return the names of fitted amplitudes that are 0 beside others of the same term that are not:
    the part of a sum, as the bonds of one reach, that a joint does not have.
    """
    found = []
    for name, given in values.items():
        parts = [
            p for p in term_library()[name].parameters if p.fitted and p.linear and p.lower == 0.0
        ]
        absent = [p.symbol for p in parts if given[p.symbol] <= _AMPLITUDE_MARGIN * p.upper]
        if len(absent) < len(parts):
            found += [f"{name}.{symbol}" for symbol in absent]
    return tuple(found)


def at_bounds(values: Start) -> tuple[str, ...]:
    """Return the names of fitted parameters at a bound of their range, but for `absent_parts`."""
    absent = absent_parts(values)
    return tuple(label for label, _ in _bounded(values) if label not in absent)


def limit_cases(values: Start) -> tuple[str, ...]:
    """Return the names of those that are at a bound at which the term is as simple as it can be
    (`Parameter.limit_case`).
    """
    found = []
    for label, end in _bounded(values):
        name, symbol = label.split(".")
        if term_library()[name].parameter(symbol).limit_case == end:
            found.append(label)
    return tuple(found)


def _bounded(values: Start) -> Iterator[tuple[str, str]]:
    """Return the names of fitted parameters at a bound of their range, and which end it is."""
    for name, given in values.items():
        for stated in term_library()[name].parameters:
            if not stated.fitted:
                continue
            p = plausible(name, stated)
            value = given[p.symbol]
            unit = to_unit(p, value) if p.lower <= value <= p.upper else float(value > p.upper)
            width = _AMPLITUDE_MARGIN if p.linear else _BOUND_MARGIN
            if unit <= width or unit >= 1.0 - width:
                yield f"{name}.{p.symbol}", "lower" if unit <= width else "upper"
