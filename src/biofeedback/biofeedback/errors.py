"""Errors of the package."""

from ankle_interfaces.errors import UserError


class ProtocolError(UserError, ValueError):
    """Reports a session protocol that cannot be used; names file, key, value and range."""


class CommandError(UserError, ValueError):
    """Reports a command that is well formed but refused; the sender receives the reason."""


class MalformedMessageError(UserError, ValueError):
    """Reports something that none of our pages sends. The sender is disconnected."""


class AccessError(UserError, ValueError):
    """Reports settings under which the pages would be open to strangers."""


class SessionError(UserError, RuntimeError):
    """Reports a scripted session that cannot go on; names the command or check that failed."""
