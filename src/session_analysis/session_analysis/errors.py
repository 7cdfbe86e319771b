"""Errors of the analysis. Each message names the recording and what is missing."""

from ankle_interfaces.errors import UserError


class AnalysisError(UserError, ValueError):
    """Reports recordings from which the question cannot be answered."""
