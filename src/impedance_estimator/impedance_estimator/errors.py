"""Errors of offline estimation. Each message names the recording or signal and what it lacks."""

from ankle_interfaces.errors import UserError


class EstimateError(UserError, ValueError):
    """Reports a recording or a signal from which nothing can be estimated or predicted."""
