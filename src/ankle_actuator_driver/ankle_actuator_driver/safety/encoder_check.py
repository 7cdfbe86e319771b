"""A check whether the position sensor still follows the commanded position."""

from __future__ import annotations

from collections import deque

LEAST_COMMANDED_MOVEMENT = 1e-3
"""[rad] Movement of the command that the encoder has to show: a fortieth of the paper's
perturbation, four times what an encoder's noise of 4.5e-5 rad spans in a window."""
LEAST_FOLLOWED_SHARE = 0.3
"""Least part of the command's movement that the measured position shows. A 30 Hz servo shows all of
it, one that gives way to the torque of a stiff ankle more than half."""
RESPONSE = 0.03
"""[s] Time after which the plate has begun to follow: twice the delay of a 30 Hz servo and of the
sensor's filter."""
WINDOW = 0.15
"""[s] Length of the window that is compared; short against the 200 ms within which a sensor's fault
has to stop the rig."""


class EncoderCheck:
    """Compares command and measurement, both at the same times."""

    def __init__(self) -> None:
        self._entries: deque[tuple[float, float, float]] = deque()

    def stuck(self, time: float, commanded: float, measured: float) -> bool:
        """Return whether the encoder fails to follow the command, after another pair of positions.

        Parameters
        ----------
        time
            Times of the samples [s], increasing.
        commanded, measured
            Positions [rad].
        """
        entries = self._entries
        entries.append((time, commanded, measured))
        while entries[0][0] < time - WINDOW:
            entries.popleft()
        wanted = [entry[1] for entry in entries if entry[0] <= time - RESPONSE]
        if not wanted:
            return False
        asked = max(wanted) - min(wanted)
        seen = [entry[2] for entry in entries]
        return (
            asked > LEAST_COMMANDED_MOVEMENT
            and max(seen) - min(seen) < LEAST_FOLLOWED_SHARE * asked
        )

    def forget(self) -> None:
        """Forget the samples so far: the check begins again."""
        self._entries.clear()
