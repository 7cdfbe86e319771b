"""A quantity: what a parameter of a node, of a physical term or of a method is.

Node parameters, term parameters and settings are all declared as `Quantity`, so that each has a
unit, a range, a default and a reason, and every refusal reads the same::

    parameter 'K' = 5000.0 N.m/rad is refused; allowed: 0 to 1000 N.m/rad
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Union

from ankle_interfaces.errors import QuantityError

Value = Union[bool, int, float, str]


@dataclass(frozen=True)
class Quantity:
    """Declares one quantity: its symbol, unit, allowed range, default and reason.

    Attributes
    ----------
    symbol
        Symbol as in the equation (``K``), or name as in ``ros2 param set NODE name value``.
    unit
        SI unit, ``1`` for a pure number, empty for text and switches.
    lower, upper
        Inclusive limits of a number.
    default
        The value where nothing else is given. Its type (bool, int, float or str) is the type of
        the quantity; a float quantity takes whole numbers too.
    source
        Where the range and the default come from.
    description
        One sentence that says what the quantity is.
    choices
        The allowed texts; empty allows any text.
    start_only
        True where a running node cannot change the quantity.
    """

    symbol: str
    unit: str = ""
    lower: float = -math.inf
    upper: float = math.inf
    default: Value = 0.0
    source: str = ""
    description: str = ""
    choices: tuple[str, ...] = ()
    start_only: bool = False

    @property
    def name(self) -> str:
        """Return the symbol, as the name of a node parameter or a setting."""
        return self.symbol

    @property
    def key(self) -> str:
        """Return the symbol with its unit, as files write it: ``K[N.m/rad]``."""
        return f"{self.symbol}[{self.unit}]"

    @property
    def explanation(self) -> str:
        """Return what the quantity is and where its range comes from, as far as both are stated,
        in sentences.
        """
        reason = _with_full_stop(f"{self.source[:1].upper()}{self.source[1:]}")
        if self.description and reason:
            return f"{_with_full_stop(self.description)} Source: {reason}"
        return _with_full_stop(self.description) or reason

    @property
    def allowed(self) -> str:
        """Return the allowed values in words, as ``0 to 1000 N.m/rad``."""
        if isinstance(self.default, bool):
            return "true or false"
        if isinstance(self.default, str):
            return "one of " + ", ".join(self.choices) if self.choices else "any text"
        if isinstance(self.default, int) and math.isfinite(self.upper - self.lower):
            return f"whole number {self.lower:.0f} to {self.upper:.0f}{self._unit_after_number}"
        return f"{self.lower:g} to {self.upper:g}{self._unit_after_number}"

    def check(self, value: object) -> Value:
        """Return the value in the quantity's type.

        Parameters
        ----------
        value
            What somebody wants to set.

        Returns
        -------
        bool, int, float or str
            The same value; whole numbers as float where the quantity is a float.

        Raises
        ------
        QuantityError
            Wrong type, not finite, out of range or not among the choices. The message names the
            quantity, the value, the unit and what is allowed.
        """
        if isinstance(self.default, bool):
            if isinstance(value, bool):
                return value
        elif isinstance(self.default, str):
            if isinstance(value, str) and (not self.choices or value in self.choices):
                return value
        elif _is_number(value) and self.lower <= value <= self.upper:  # type: ignore[operator]
            if isinstance(self.default, float):
                return float(value)  # type: ignore[arg-type]
            if isinstance(value, numbers.Integral):
                return int(value)
        raise self.refusal(value)

    def refusal(self, value: object, allowed: str = "") -> QuantityError:
        """Return the error that refuses a value.

        Parameters
        ----------
        value
            The refused value.
        allowed
            What is allowed instead, where that is more than the declared range, as ``after
            'reflex_start' = 0.04 s``.

        Returns
        -------
        QuantityError
            To be raised by the caller.
        """
        shown = str(value) if isinstance(value, numbers.Real) else repr(value)
        unit = "" if isinstance(value, str) else self._unit_after_number
        return QuantityError(
            f"parameter '{self.symbol}' = {shown}{unit} is refused; "
            f"allowed: {allowed or self.allowed}"
        )

    @property
    def _unit_after_number(self) -> str:
        return f" {self.unit}" if self.unit not in ("", "1") else ""


def _with_full_stop(text: str) -> str:
    ended = text.rstrip()
    return f"{ended}." if ended and ended[-1] not in ".!?" else ended


def _is_number(value: object) -> bool:
    return isinstance(value, numbers.Real) and not isinstance(value, bool)


def number(default: float, unit: str, lower: float, upper: float, source: str) -> Any:
    """Return a field of a settings dataclass that holds a number.

    Parameters
    ----------
    default, unit, lower, upper, source
        As in `Quantity`; the field's name becomes the symbol.

    Returns
    -------
    dataclasses.Field
        For the right side of the field's annotation.
    """
    quantity = Quantity("", unit, lower, upper, default, source)
    return field(default=default, metadata={"quantity": quantity})


def choice(default: str, choices: tuple[str, ...], source: str) -> Any:
    """Return a field of a settings dataclass that holds one of a few words.

    Parameters
    ----------
    default, choices, source
        As in `Quantity`; the field's name becomes the symbol.

    Returns
    -------
    dataclasses.Field
        For the right side of the field's annotation.
    """
    quantity = Quantity("", default=default, choices=choices, source=source)
    return field(default=default, metadata={"quantity": quantity})


def quantities(settings: type | object) -> Mapping[str, Quantity]:
    """Return the quantities of a settings dataclass (or of an instance), by field name.

    Fields that were not declared with `number` or `choice` are left out.
    """
    return {
        entry.name: replace(entry.metadata["quantity"], symbol=entry.name)
        for entry in fields(settings)  # type: ignore[arg-type]
        if "quantity" in entry.metadata
    }


def check_settings(settings: object) -> None:
    """Check every quantity of a settings dataclass, in its ``__post_init__``.

    Raises
    ------
    QuantityError
        A value that its quantity refuses.
    """
    for name, quantity in quantities(settings).items():
        quantity.check(getattr(settings, name))
