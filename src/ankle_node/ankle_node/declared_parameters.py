"""A node's parameters as ROS shows them, made from the quantities that it declares."""

from __future__ import annotations

import copy
import math

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor

from ankle_interfaces.quantity import Quantity

RCLPY_PARAMETERS = ("use_sim_time", "start_type_description_service")
"""Parameters that rclpy declares itself; a running node cannot change them, because samples of two
clocks in one stream would contradict each other."""
OVERRIDES_OF_RCLPY = "qos_overrides."


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
