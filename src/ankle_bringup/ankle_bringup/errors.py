"""Errors that the user reads at the command line as one line."""

from ankle_interfaces.errors import UserError


class GraphError(UserError, ValueError):
    """Reports a graph description or a setting that cannot be used."""


class RunError(UserError, RuntimeError):
    """Reports a process of the graph that failed or did not do its part in time."""
