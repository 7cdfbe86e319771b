"""A node's parameters as ROS shows them, made from the quantities that it declares."""

from __future__ import annotations

import copy
import difflib
import math
from collections.abc import Collection, Iterable, Mapping

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor

from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Quantity

RCLPY_PARAMETERS = ("use_sim_time", "start_type_description_service")
"""Parameters that rclpy declares itself; a running node cannot change them, because samples of two
clocks in one stream would contradict each other."""
OVERRIDES_OF_RCLPY = "qos_overrides."
SIMILARITY = 0.8
"""Least similarity of two names, by difflib, with which one is suggested: one letter left out of
five is a typing error; ``rate`` and ``lead`` are two names."""


def declaration(quantity: Quantity) -> ParameterDescriptor:
    """Return the descriptor with which a quantity is declared to rclpy.

    Neither range nor ``read_only`` are there: rclpy would check them before the quantity does, and
    answer without the unit, or refuse a value that is the present one. `describe` adds them.
    """
    unit = f" [{quantity.unit}]" if quantity.unit else ""
    descriptor = ParameterDescriptor(
        description=f"{quantity.explanation}{unit}", dynamic_typing=True
    )
    descriptor.additional_constraints = f"allowed: {quantity.allowed}" + (
        "; at start only" if quantity.start_only else ""
    )
    return descriptor


def describe(descriptor: ParameterDescriptor, quantity: Quantity) -> ParameterDescriptor:
    """Return what ``ros2 param describe`` shows: the declaration with range and ``read_only``."""
    described = copy.deepcopy(descriptor)
    described.read_only = quantity.start_only
    if not math.isfinite(quantity.upper - quantity.lower):
        return described
    if isinstance(quantity.default, float):
        described.floating_point_range = [
            FloatingPointRange(from_value=float(quantity.lower), to_value=float(quantity.upper))
        ]
    elif isinstance(quantity.default, int):
        described.integer_range = [
            IntegerRange(from_value=int(quantity.lower), to_value=int(quantity.upper))
        ]
    return described


def unknown(name: str, known: Collection[str]) -> str:
    """Return the sentence about an unknown parameter, with the name that may be meant."""
    close = difflib.get_close_matches(name, known, n=1, cutoff=SIMILARITY)
    # Letters that changed places count twice for difflib.
    close = close or [other for other in known if sorted(other) == sorted(name)]
    hint = f"did you mean '{close[0]}'?" if close else f"known: {', '.join(sorted(known))}"
    return f"parameter '{name}' is unknown; {hint}"


def check_overrides(given: Iterable[str], declared: Mapping[str, Quantity]) -> list[str]:
    """Look through the parameters that were given at the start, on the command line or in a file.

    Parameters
    ----------
    given
        Names of the parameters that were given.
    declared
        Quantities of the node by name.

    Returns
    -------
    list of str
        A warning for each that the node does not have. A parameter file that several nodes share
        may hold such names.

    Raises
    ------
    QuantityError
        A name that the node does not have and that resembles one that it has: a typing error must
        not leave a limit at its default.
    """
    warnings = []
    for name in given:
        if name in declared or name in RCLPY_PARAMETERS or name.startswith(OVERRIDES_OF_RCLPY):
            continue
        sentence = unknown(name, declared)
        if "did you mean" in sentence:
            raise QuantityError(sentence)
        warnings.append(f"{sentence}; it is ignored")
    return warnings
