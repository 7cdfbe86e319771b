"""Node parameters as data: name, default, unit, range and description in one place."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Union

Value = Union[bool, int, float, str]


class ParameterError(ValueError):
    """A parameter value that is refused. The message names parameter, value, unit and range."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of a node.

    Attributes
    ----------
    name
        As in ``ros2 param set NODE name value``.
    default
        Its type is the parameter's type; a float parameter takes whole numbers too.
    unit
        SI, ``1`` for a pure number, empty for text and switches.
    description
        One sentence; says where the default comes from.
    lower, upper
        Inclusive limits of a number.
    choices
        The allowed texts; empty means any.
    fixed
        Can be set at start only.
    """

    name: str
    default: Value
    unit: str
    description: str
    lower: float = -math.inf
    upper: float = math.inf
    choices: tuple[str, ...] = ()
    fixed: bool = False

    @property
    def allowed(self) -> str:
        """The allowed values in words."""
        if isinstance(self.default, bool):
            return "true or false"
        if isinstance(self.default, str):
            return "one of " + ", ".join(self.choices) if self.choices else "any text"
        unit = f" {self.unit}" if self.unit not in ("", "1") else ""
        kind = "whole number " if isinstance(self.default, int) else ""
        return f"{kind}{self.lower:g} to {self.upper:g}{unit}"

    def check(self, value: object) -> Value:
        """The value in the parameter's type.

        Raises
        ------
        ParameterError
            Wrong type, not finite, out of range or not among the choices.
        """
        if isinstance(self.default, bool):
            if isinstance(value, bool):
                return value
        elif isinstance(self.default, int):
            if (
                isinstance(value, int)
                and not isinstance(value, bool)
                and self.lower <= value <= self.upper
            ):
                return value
        elif isinstance(self.default, float):
            if (
                isinstance(value, (int, float))
                and not isinstance(value, bool)
                and self.lower <= value <= self.upper
            ):
                return float(value)
        elif isinstance(value, str) and (not self.choices or value in self.choices):
            return value
        unit = f" {self.unit}" if self.unit not in ("", "1") and not isinstance(value, str) else ""
        raise ParameterError(
            f"parameter '{self.name}' = {value!r}{unit} is refused; allowed: {self.allowed}"
        )
