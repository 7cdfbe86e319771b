"""Errors that a person at the command line reads as one line."""


class GraphError(ValueError):
    """A graph description or a setting that cannot be used."""


class RunError(RuntimeError):
    """A process of the graph that failed or did not do its part in time."""
