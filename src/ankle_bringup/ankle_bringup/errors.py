"""Errors that the user reads at the command line as one line."""


class GraphError(ValueError):
    """A graph description or a setting that cannot be used."""


class RunError(RuntimeError):
    """A process of the graph that failed or did not do its part in time."""
