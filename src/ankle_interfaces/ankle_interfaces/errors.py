"""Errors of what a user gives, and of the block format. Each names value and range."""


class UserError(Exception):
    """Reports what a user gave and can change: an option, a parameter, a file, a recording.

    Every error class of the packages inherits it beside a built-in one. Any other exception is an
    error of the program.
    """


class BlockError(UserError, ValueError):
    """Reports a message whose layout contradicts its data or misses a column."""


class UnitError(BlockError):
    """Reports a unit that is unknown or does not fit the quantity."""


class QuantityError(UserError, ValueError):
    """Reports a value that a quantity refuses; names the quantity, the value, its unit and the
    range.
    """


class SamplingError(UserError, ValueError):
    """Reports times or a sampling rate at which signals cannot be processed."""
