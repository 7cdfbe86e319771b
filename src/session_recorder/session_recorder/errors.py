"""Errors of bags. Each message names the file or value and what was expected."""

from ankle_interfaces.errors import UserError


class BagError(UserError, ValueError):
    """Reports a bag that is missing, damaged, not a bag, or cannot be written."""


class ImportRefused(UserError, ValueError):  # noqa: N818 - the recording is refused, nothing failed
    """Reports a recording whose data contradict what was stated about them."""
