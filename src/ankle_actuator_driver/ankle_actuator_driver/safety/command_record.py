"""The commanded position at any time of the last second: the path of what was sent."""

from __future__ import annotations

from collections import deque

import numpy as np

from ankle_actuator_driver.safety.interpolated_path import positions_at

KEPT_TIME = 1.0
"""[s] Time before the present that is kept: longer than every window of the supervision."""


class CommandRecord:
    """Records the path of what was sent."""

    def __init__(self) -> None:
        self._parts: deque[tuple[np.ndarray, np.ndarray]] = deque()
        self._held = 0.0

    def hold(self, position: float) -> None:
        """Note that the plate is held at a position [rad] until a stretch is sent."""
        self._parts.clear()
        self._held = position

    def add(self, time: np.ndarray, motion: np.ndarray, ros: float) -> None:
        """Remember a stretch that is sent.

        Parameters
        ----------
        time
            ROS times [s], shape (n,), later than those sent before.
        motion
            Position, velocity, acceleration, shape (n, 3).
        ros
            ROS time now [s].
        """
        self._parts.append((time, motion))
        while len(self._parts) > 1 and self._parts[1][0][0] < ros - KEPT_TIME:
            self._parts.popleft()

    def positions(self, time: np.ndarray) -> np.ndarray:
        """Return the commanded positions [rad] at ROS times [s], shape (n,)."""
        if not self._parts:
            return np.full(len(time), self._held)
        parts = self._parts_around(float(time.min()), float(time.max()))
        times = np.concatenate([part[0] for part in parts])
        motion = np.concatenate([part[1] for part in parts])
        return positions_at(times, motion, time)

    def _parts_around(self, first: float, last: float) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return the stretches between two times [s], with the one before and the one after."""
        found: list[tuple[np.ndarray, np.ndarray]] = []
        for part in reversed(self._parts):
            if part[0][0] > last:
                found = [part]
                continue
            found.append(part)
            if part[0][-1] <= first:
                break
        return found[::-1]

    def to_come(self, ros: float) -> np.ndarray:
        """Return the motion that was sent and is not due yet at a ROS time [s], shape (n, 3)."""
        parts = [motion[time > ros] for time, motion in self._parts]
        return np.concatenate(parts) if parts else np.empty((0, 3))
