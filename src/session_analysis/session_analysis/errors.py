"""Errors of the analysis. Each message names the recording and what is missing."""


class AnalysisError(ValueError):
    """Reports recordings from which the question cannot be answered."""
