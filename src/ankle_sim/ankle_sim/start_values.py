"""Start values of parameters on which the declaration of others depends: the model file and the
subject's number.
"""

from __future__ import annotations

from rclpy.node import Node

from ankle_interfaces.quantity import Quantity, Value


def start_value(node: str, parameter: Quantity) -> Value:
    """Return a parameter's start value, read by a short-lived node of the same name.

    The defaults of the node's other parameters come from the model, so it must be known before they
    are declared.

    Raises
    ------
    QuantityError
        A value that is refused.
    """
    probe = Node(node, start_parameter_services=False, enable_rosout=False)
    try:
        value = probe.declare_parameter(parameter.name, parameter.default).value
    finally:
        probe.destroy_node()
    return parameter.check(value)
