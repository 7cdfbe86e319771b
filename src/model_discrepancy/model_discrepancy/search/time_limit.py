"""A search that has to end in time: when its time is over, it adds nothing more.

A person waits for the diagnosis while a session is calibrated. What was found by then is weighed,
compared with its rivals and criticised as ever, so that a model that lacks something is called
unexplained. A search without a limit gives the same result on every computer; one with a limit may
find less on a slower one, and says so.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

from ankle_interfaces.quantity import Quantity

AT_MOST = Quantity(
    "at-most",
    "min",
    0.5,
    120.0,
    10.0,
    description="After this time a diagnosis adds no further terms",
    source="as measured on two cores: a recording of a person takes up to ten minutes, one with "
    "physics that no term resembles up to half an hour; half a minute finds the first term",
)


@dataclass
class TimeLimit:
    """Holds when a search has to end.

    Attributes
    ----------
    minutes
        That the search may take [min].
    end
        When they are over, on the monotonic clock [s].
    left_something_out
        Whether the search would have gone on.
    """

    minutes: float
    end: float
    left_something_out: bool = False

    @property
    def reason(self) -> str:
        """Return what a verdict says of it."""
        return (
            f"the search was ended after {self.minutes:g} min, as asked: it would have gone on, so "
            "more may be found without this limit"
        )


_in_force: ContextVar[TimeLimit | None] = ContextVar("time_limit", default=None)


@contextmanager
def time_limit(minutes: float | None) -> Iterator[TimeLimit | None]:
    """Return a context in which a search ends after some time.

    Parameters
    ----------
    minutes
        From now on [min]; None for no limit.

    Raises
    ------
    ankle_interfaces.errors.QuantityError
        They are out of range.
    """
    limit = None
    if minutes is not None:
        limit = TimeLimit(minutes, time.monotonic() + 60.0 * float(AT_MOST.check(minutes)))
    token = _in_force.set(limit)
    try:
        yield limit
    finally:
        _in_force.reset(token)


def time_is_over() -> bool:
    """Say whether a search has to end, which would go on otherwise."""
    limit = _in_force.get()
    if limit is None or time.monotonic() < limit.end:
        return False
    limit.left_something_out = True
    return True
