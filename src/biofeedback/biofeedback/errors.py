"""Errors of the package."""


class ProtocolError(ValueError):
    """Reports a session protocol that cannot be used; names file, key, value and range."""


class CommandError(ValueError):
    """Reports a command that is well formed but refused; the sender receives the reason."""


class MalformedMessageError(ValueError):
    """Reports something that none of our pages sends. The sender is disconnected."""


class AccessError(ValueError):
    """Reports settings under which the pages would be open to strangers."""
