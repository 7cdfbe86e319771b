"""Whether the position sensor still tells the truth, seen from what the plate was told."""

from __future__ import annotations

from collections import deque

COMMANDED = 0.005
"""[rad] A command that has moved by this much has to be seen: an eighth of the paper's
perturbation.
"""
SEEN = 1e-6
"""[rad] Least change of a living encoder while the plate moves: a SinCos encoder resolves that."""
RESPONSE = 0.03
"""[s] After which the plate has begun to follow: twice the delay of a 30 Hz servo and of the
sensor's filter.
"""
WINDOW = 0.15
"""[s] Looked back; short against the 250 ms within which a fault has to stop the rig."""


class EncoderCheck:
    """Follows command and measurement, both at the same times."""

    def __init__(self) -> None:
        self._entries: deque[tuple[float, float, float]] = deque()

    def stuck(self, time: float, commanded: float, measured: float) -> bool:
        """Whether the encoder has not moved though the plate was told to, after a further pair of
        positions.

        Parameters
        ----------
        time
            [s], increasing.
        commanded, measured
            Positions [rad].
        """
        entries = self._entries
        entries.append((time, commanded, measured))
        while entries[0][0] < time - WINDOW:
            entries.popleft()
        seen = [entry[2] for entry in entries]
        if max(seen) - min(seen) >= SEEN:
            return False
        told = [entry[1] for entry in entries if entry[0] <= time - RESPONSE]
        return bool(told) and max(told) - min(told) > COMMANDED

    def forget(self) -> None:
        """Begin again."""
        self._entries.clear()
