"""Errors of models and terms. Each message names the value, its unit and the allowed range."""


class ModelError(ValueError):
    """Reports a model file or a parameter value that cannot be used."""
