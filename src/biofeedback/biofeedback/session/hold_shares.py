"""How much of a hold the estimates were valid, and how much the cursor was in the target."""

from __future__ import annotations

import math

HIT_SHARE = 0.5
"""Least share of a hold with the cursor in the target that makes it a hit: by chance alone a target
of 0.3 baselines on an axis of 2.2 is met for a seventh of the time."""


class HoldShares:
    """Adds up the time of one hold.

    Attributes
    ----------
    valid, in_target
        Shares of the hold's time; NaN before any.
    """

    def __init__(self) -> None:
        self.valid = self.in_target = math.nan
        self._time = self._valid_time = self._target_time = 0.0

    def add(self, passed: float, valid: bool, in_target: bool) -> None:
        """Add `passed` [s] of the hold."""
        self._time += passed
        self._valid_time += passed * valid
        self._target_time += passed * in_target
        self.valid = self._valid_time / self._time
        self.in_target = self._target_time / self._time

    @property
    def is_hit(self) -> bool:
        """Tell whether the hold was in the target for at least `HIT_SHARE`."""
        return self.in_target >= HIT_SHARE

    def details(self) -> dict[str, float]:
        """Return the shares [%] as the end of a hold states them; none before any time."""
        shares = {"valid[%]": self.valid, "in_target[%]": self.in_target}
        return {name: round(100.0 * x, 1) for name, x in shares.items() if math.isfinite(x)}
