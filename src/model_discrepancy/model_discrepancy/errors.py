"""Errors of the diagnosis. Each message names the value, its unit and the allowed range."""

from ankle_interfaces.errors import UserError


class DiagnosisError(UserError, ValueError):
    """Reports a recording or a request that cannot be diagnosed at all (a bad recording is a
    verdict, not an error).
    """
