"""Errors of the block format. Each message names the value and what was expected."""


class BlockError(ValueError):
    """Reports a message whose layout contradicts its data or misses a column."""


class UnitError(BlockError):
    """Reports a unit that is unknown or does not fit the quantity."""


class QuantityError(ValueError):
    """Reports a value that a quantity refuses; names the quantity, the value, its unit and the
    range.
    """
