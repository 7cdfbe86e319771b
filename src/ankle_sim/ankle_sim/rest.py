"""A simulated plate that stops when it is asked to, as a rig does, whatever the reference says.

    x = x0 + w(t) (r - x0),    w = 6 s^5 - 15 s^4 + 10 s^3  of the time, or one less that

With w from 1 to 0 the plate leaves the reference r at its position x0 of that moment and comes to
rest there; with w from 0 to 1 it joins the reference again. Path, velocity and acceleration are
continuous where the plate rests or follows wholly before.
"""

from __future__ import annotations

import numpy as np

STOP_TIME = 0.1
"""[s] From the paper's largest velocity of about 3 rad/s this needs 100 rad/s^2 and 0.1 rad."""
START_TIME = 2.0
"""[s] A subject who is surprised by the first stretch pushes against it; a rig's driver has a soft
start of the same kind."""
RUNNING, ARMED, READY = "running", "armed", "ready"


class Rest:
    """Lets a reference through, or not.

    Parameters
    ----------
    at_rest
        Whether the plate rests until it is armed and started, as a rig's does.

    Attributes
    ----------
    state
        `RUNNING` (follows), `ARMED` or `READY` (at rest), by the words of a rig's driver.
    """

    def __init__(self, at_rest: bool = False) -> None:
        self.state = READY if at_rest else RUNNING
        self._weight = self._goal = self._from = 0.0 if at_rest else 1.0
        self._began = 0.0
        self._base: float | None = None
        self._changed = at_rest

    def arm(self) -> str:
        """Hold the plate and allow a start; return the answer to the operator."""
        self.state = ARMED
        self._go(0.0)
        return "armed"

    def start(self) -> str | None:
        """Follow the reference again; None where it was not armed."""
        if self.state != ARMED:
            return None
        self.state = RUNNING
        self._go(1.0)
        return "running"

    def stop(self) -> str:
        """Come to rest; from any state."""
        self.state = READY
        self._go(0.0)
        return "at rest"

    def _go(self, goal: float) -> None:
        if goal != self._goal:
            self._goal, self._changed = goal, True

    def motion(self, time: np.ndarray, reference: np.ndarray) -> np.ndarray:
        """Return the motion that the plate is asked for.

        Parameters
        ----------
        time
            Times of the samples [s], shape (n,).
        reference
            Position [rad], and where known velocity [rad/s] and acceleration [rad/s^2]; shape
            (n, 1) or (n, 3).

        Returns
        -------
        np.ndarray
            Of the same shape.
        """
        if not len(time):
            return reference
        if self._changed:
            self._changed = False
            self._from, self._began = self._weight, float(time[0])
            if self._base is None:
                self._base = float(reference[0, 0])
        if self._weight == self._goal == 1.0:
            self._base = None
            return reference
        return self._shape(time, reference)

    def _shape(self, time: np.ndarray, reference: np.ndarray) -> np.ndarray:
        span = START_TIME if self._goal else STOP_TIME
        s = np.clip((time - self._began) / span, 0.0, 1.0)
        change = self._goal - self._from
        w = self._from + change * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        first = change * 30.0 * s**2 * (1.0 - s) ** 2 / span
        second = change * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / span**2
        self._weight = float(w[-1]) if s[-1] < 1.0 else self._goal
        assert self._base is not None
        beside = reference[:, 0] - self._base
        columns = [self._base + w * beside]
        if reference.shape[1] == 3:
            velocity, acceleration = reference[:, 1], reference[:, 2]
            columns.append(first * beside + w * velocity)
            columns.append(second * beside + 2.0 * first * velocity + w * acceleration)
        return np.column_stack(columns)
