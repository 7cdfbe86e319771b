"""Errors of models and terms. Each message names the value, its unit and the allowed range."""

from ankle_interfaces.errors import UserError


class ModelError(UserError, ValueError):
    """Reports a model file or a parameter value that cannot be used."""
