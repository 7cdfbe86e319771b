"""Results are remembered by what they depend on, the latest ones only."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

Result = TypeVar("Result")


class RecentResults(Generic[Result]):
    """Remembers the results that were asked for last; several threads may ask at the same time.

    Parameters
    ----------
    size
        Number of results that are kept.
    """

    def __init__(self, size: int) -> None:
        self._size = size
        self._known: OrderedDict[Hashable, Result] = OrderedDict()
        self._lock = threading.Lock()

    def of(self, key: Hashable, make: Callable[[], Result]) -> Result:
        """Return the result of this key; it is made if it is not remembered.

        Parameters
        ----------
        key
            All that the result depends on.
        make
            Makes it. Other results may be asked for meanwhile.
        """
        with self._lock:
            if key in self._known:
                self._known.move_to_end(key)
                return self._known[key]
        result = make()
        with self._lock:
            self._known[key] = result
            if len(self._known) > self._size:
                self._known.popitem(last=False)
        return result
