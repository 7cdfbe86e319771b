"""Who publishes the reference, who reads it, and whether it comes."""

from __future__ import annotations

import math
from collections.abc import Sequence

START_PATIENCE = 0.5
"""[s] Longest time from the start to the first block of the reference; the plate is held meanwhile.
Also the largest age of the newest block at a start: a reference that does not come by then is
waiting for something itself."""


class ReferenceSources:
    """Keeps the names of the nodes that publish and that read the reference."""

    def __init__(self) -> None:
        self._names: tuple[str, ...] = ()
        self._readers: tuple[str, ...] = ()
        self._came = -math.inf

    def note(self, names: Sequence[str], readers: Sequence[str]) -> None:
        """Note the full names of the nodes that publish and of those that read."""
        self._names, self._readers = tuple(sorted(names)), tuple(sorted(readers))

    def came(self, now: float) -> None:
        """Note that a block of the reference came, at a time [s]."""
        self._came = now

    @property
    def several(self) -> bool:
        """Tell whether more than one node publishes the reference."""
        return len(self._names) > 1

    def silent(self, now: float) -> bool:
        """Tell whether no block has come for `START_PATIENCE`."""
        return now - self._came > START_PATIENCE

    def silence(self) -> str:
        """Return why no reference comes, as far as it is known."""
        if not self._names:
            return "no node publishes the reference"
        readers = ", ".join(self._readers) or "nobody"
        return (
            f"{self._names[0]} publishes the reference but has sent nothing for "
            f"{START_PATIENCE:g} s; it is read by {readers}: see its parameter wait_for_readers, "
            "and its health on /diagnostics"
        )

    def conflict(self) -> str:
        """Return the sentence for more than one source."""
        return (
            f"{len(self._names)} nodes publish the reference ({', '.join(self._names)}); end "
            "all but one (one that was killed is still listed for up to 20 s)"
        )
