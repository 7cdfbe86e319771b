"""The account of the messages of one topic, which carry no time of their own.

They are counted by their publisher's numbers, where the topic has one publisher only, because the
numbers do not say whose they are.
"""

from __future__ import annotations

from collections.abc import Collection

SETTLING_TIME = 2.0
"""[s] Time for which a jump in the message numbers waits for a verdict. A second publisher is known
to the graph within a second; the messages of both look like loss until then."""


class MessageNumbers:
    """Counts the messages of one topic by their publisher's numbers.

    Numbers of several publishers cannot be distinguished, so a topic that ever had more than one is
    not judged; a jump in the numbers therefore waits until the graph would show a second one.

    Attributes
    ----------
    lost
        Messages that are lost for certain.
    """

    def __init__(self) -> None:
        self.lost = 0
        self._last: int | None = None
        self._publishers: frozenset[str] = frozenset()
        self._several = False
        self._waiting: list[tuple[float, int]] = []

    def set_publishers(self, publishers: Collection[str]) -> None:
        """State who publishes the topic now, by any names that identify a publisher."""
        now = frozenset(publishers)
        if len(now) > 1:
            self._several = True
        if now and self._publishers and now != self._publishers:
            # Another publisher counts anew; what the change itself looked like is no loss.
            self._last = None
            self._waiting.clear()
        self._publishers = now or self._publishers

    def add(self, number: int, now: float) -> None:
        """Count a message.

        Parameters
        ----------
        number
            What its publisher counted it as.
        now
            [s] of any clock that only goes forward.
        """
        jump = 0 if self._last is None else number - self._last - 1
        if jump > 0:
            self._waiting.append((now, jump))
        self._last = number

    def settle(self, now: float) -> int:
        """Decide on jumps that waited for `SETTLING_TIME`.

        Parameters
        ----------
        now
            As for `add`; infinite decides on all.

        Returns
        -------
        int
            Messages that are now known to be lost and were not before.
        """
        if self._several:
            self._waiting.clear()
            return 0
        due = sum(jump for at, jump in self._waiting if now - at >= SETTLING_TIME)
        self._waiting = [(at, jump) for at, jump in self._waiting if now - at < SETTLING_TIME]
        self.lost += due
        return due
