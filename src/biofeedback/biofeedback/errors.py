"""Errors of the package."""


class ProtocolError(ValueError):
    """A session protocol that cannot be used; names file, key, value and range."""


class CommandError(ValueError):
    """A command that is well formed but refused; it says why, and the sender receives it."""


class MalformedMessageError(ValueError):
    """Something that none of our pages sends. The sender is disconnected."""


class AccessError(ValueError):
    """Settings under which the pages would be open to strangers."""
