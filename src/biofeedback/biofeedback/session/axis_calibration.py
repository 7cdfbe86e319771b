"""The screen's axes, from the subject's own baseline.

People differ by a factor of two in K and more in G, so the scale of the feedback is the subject's
own: zero to a multiple of what the relaxed ankle has. The torque axis counts from the torque at
rest, which holds the foot's weight and the sensor's offset.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from biofeedback.errors import CommandError
from biofeedback.session.protocol import UNITS

AXIS_END_RATIO = 2.2
"""Upper end of the feedback axis, as a multiple of the baseline: protocols ask for 0.4 to 1.7
baselines, and the cursor must have room beyond."""
MIN_AXIS_DEVIATIONS = 8.0
"""Least number of standard deviations that the axis has above the baseline: noise of the estimate
must not fill the screen."""
TORQUE_AXIS_HALF_WIDTHS = 3.0
"""Number of half widths of the torque band that the torque axis shows beyond the outermost targets.
"""
LEAST_ROWS = 20
"""Least number of readings for a baseline: for fewer a median absolute deviation says nothing."""
SMALLEST_BASELINE = {"K": 5.0, "G": 0.5}
"""[N.m/rad], [N.m.s/rad] Scale for a subject who has less (a reflex of nearly zero is common):
levels of it would be noise.
"""
DEFAULT_AXES = {"K": (0.0, 200.0), "G": (0.0, 20.0), "reflex": (0.0, 3.0)}
"""[N.m/rad], [N.m.s/rad], [µV.s] Before there is a baseline: the range of the paper's simulations
(K 50 to 150, G 5 to 15, section III-A); a reflex burst of 150 µV over the 20 ms of its window."""


@dataclass(frozen=True)
class Baseline:
    """Holds the impedance and torque of the relaxed ankle.

    Attributes
    ----------
    K, G
        Medians [N.m/rad], [N.m.s/rad].
    K_spread, G_spread
        Standard deviations of the estimates, from the median absolute deviation.
    torque
        The subject's mean torque at rest [N.m].
    """

    K: float
    G: float
    K_spread: float
    G_spread: float
    torque: float

    def of(self, symbol: str) -> float:
        """Return the scale of ``K`` or ``G``: the median, at least `SMALLEST_BASELINE`."""
        return max(self.K if symbol == "K" else self.G, SMALLEST_BASELINE[symbol])

    def axis(self, symbol: str) -> tuple[float, float]:
        """Return the ends of the feedback axis for ``K`` or ``G``."""
        unit, spread = self.of(symbol), self.K_spread if symbol == "K" else self.G_spread
        return 0.0, max(AXIS_END_RATIO * unit, unit + MIN_AXIS_DEVIATIONS * spread)

    def region(self, symbol: str, level: float, half_width: float) -> tuple[float, float]:
        """Return the region of ``K`` or ``G`` about a level; level and half width in baselines."""
        unit = self.of(symbol)
        return max((level - half_width) * unit, 0.0), max((level + half_width) * unit, 0.0)

    def details(self) -> dict[str, float]:
        """Return what a session event says of the baseline."""
        measured = {f"{symbol}[{unit}]": self.of(symbol) for symbol, unit in UNITS.items()}
        return {
            name: round(value, 4)
            for name, value in {**measured, "torque[N.m]": self.torque}.items()
        }


class BaselineCollector:
    """Gathers estimates and torque while the subject is relaxed."""

    def __init__(self) -> None:
        self._rows: list[tuple[float, float, float]] = []

    def add(self, K: float, G: float, torque: float) -> None:
        """Add one valid estimate and the subject's torque beside it."""
        if np.isfinite([K, G, torque]).all():
            self._rows.append((K, G, torque))

    def __len__(self) -> int:
        return len(self._rows)

    def baseline(self) -> Baseline:
        """Return the baseline of what was gathered.

        Raises
        ------
        CommandError
            Too few readings.
        """
        if len(self._rows) < LEAST_ROWS:
            raise CommandError(
                f"a baseline needs {LEAST_ROWS} readings with valid estimates; there were "
                f"{len(self._rows)}"
            )
        rows = np.array(self._rows)
        middle = np.median(rows, axis=0)
        # 1.4826: median absolute deviation to standard deviation of a normal distribution.
        spread = 1.4826 * np.median(np.abs(rows - middle), axis=0)
        return Baseline(
            *(float(v) for v in (middle[0], middle[1], spread[0], spread[1], rows[:, 2].mean()))
        )


def torque_axis(targets: Sequence[float], half_width: float) -> tuple[float, float]:
    """Return the ends of the torque axis [N.m], with room around every target of the session.

    They are the same in all blocks, so that the screen does not jump.
    """
    return min(targets) - (1.0 + TORQUE_AXIS_HALF_WIDTHS) * half_width, max(targets) + (
        1.0 + TORQUE_AXIS_HALF_WIDTHS
    ) * half_width
