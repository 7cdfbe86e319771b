"""A node whose parameters are quantities, checked at the start and at each change."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import rclpy
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.node import Node

from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Quantity, Value
from ankle_node import declared_parameters
from ankle_node.given_parameters import check_given, shared_names, unknown


class NodeWithParameters(Node):
    """Declares parameters, and refuses values that their quantities do not allow.

    Parameters
    ----------
    name
        Name of the node.
    parameters
        Every parameter of the node; a refused start value raises `QuantityError`.

    Attributes
    ----------
    ignored
        A warning for each parameter given to every node that the node does not have.
    """

    arguments: ClassVar[Sequence[str]] = ()
    """Command line of the process, from which rclpy takes the start values."""

    def __init__(self, name: str, parameters: Sequence[Quantity]) -> None:
        self._declared = {parameter.name: parameter for parameter in parameters}
        super().__init__(name)
        shared = shared_names(self.arguments, self.get_name())
        self.ignored = check_given(self._parameter_overrides, self._declared, shared)
        for parameter in parameters:
            self.declare_parameter(
                parameter.name, parameter.default, declared_parameters.declaration(parameter)
            )
            parameter.check(self.get_parameter(parameter.name).value)
        self.add_on_set_parameters_callback(self._check_parameters)

    def describe_parameter(self, name: str) -> ParameterDescriptor:
        """Return what ``ros2 param describe`` shows, range and ``read_only`` included."""
        descriptor = super().describe_parameter(name)
        declared = self._declared.get(name)
        return declared_parameters.describe(descriptor, declared) if declared else descriptor

    def set_parameters(self, parameter_list: list[rclpy.Parameter]) -> list[SetParametersResult]:
        """Set each parameter; see `rclpy.node.Node.set_parameters`.

        An unknown one is refused with the name that may be meant. A value that is already there is
        accepted for every parameter, so that a node loads what it has dumped.
        """
        return [self.set_parameters_atomically([parameter]) for parameter in parameter_list]

    def set_parameters_atomically(
        self, parameter_list: list[rclpy.Parameter]
    ) -> SetParametersResult:
        """Set all of the parameters or none; see `set_parameters`."""
        changes = []
        for parameter in parameter_list:
            if not self.has_parameter(parameter.name):
                reason = unknown(parameter.name, self._declared)
                self.get_logger().error(reason)
                return SetParametersResult(successful=False, reason=reason)
            present = self.get_parameter(parameter.name).value
            fixed = parameter.name in declared_parameters.RCLPY_PARAMETERS
            if not fixed or parameter.value != present:
                changes.append(parameter)
        if not changes:
            return SetParametersResult(successful=True)
        return super().set_parameters_atomically(changes)

    def value(self, name: str) -> Value:
        """Return the present value of a declared parameter, in its declared type."""
        return self._declared[name].check(self.get_parameter(name).value)

    def number(self, name: str) -> float:
        """Return the present value of a float or int parameter."""
        return float(self.value(name))

    def text(self, name: str) -> str:
        """Return the present value of a text parameter."""
        return str(self.value(name))

    def parameters_changed(self, values: dict[str, Value]) -> None:
        """React to accepted new values before they are stored.

        A subclass raises `QuantityError` to refuse them.
        """

    def _check_parameters(self, changes: list[rclpy.Parameter]) -> SetParametersResult:
        accepted: dict[str, Value] = {}
        try:
            for change in changes:
                declared = self._declared.get(change.name)
                if change.name in declared_parameters.RCLPY_PARAMETERS:
                    raise QuantityError(f"parameter '{change.name}' can be set at start only")
                if declared is None:
                    continue
                value = declared.check(change.value)
                if not declared.start_only:
                    accepted[change.name] = value
                elif value != self.value(change.name):
                    raise QuantityError(f"parameter '{declared.name}' can be set at start only")
            if accepted:
                self.parameters_changed(accepted)
        except QuantityError as error:
            self.get_logger().error(str(error))
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)
