"""Errors of the EMG driver. Each message names stream, channel, value and what was expected."""

from ankle_interfaces.errors import UserError


class StreamRefused(UserError, ValueError):  # noqa: N818 - it is the stream that is refused, as /diagnostics says
    """Reports a stream that is no EMG in volts of the wanted muscles at a known rate."""
