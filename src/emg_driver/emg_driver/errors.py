"""Errors of the EMG driver. Each message names stream, channel, value and what was expected."""


class StreamRefused(ValueError):  # noqa: N818 - it is the stream that is refused, as /diagnostics says
    """A stream whose data would not be EMG in volts of the wanted muscles at a known rate."""
