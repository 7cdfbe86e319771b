"""Backlash between shaft and encoder is found from position and velocity.

Position then follows the integrated velocity only beyond a gap.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import minimize_scalar
from scipy.signal import butter, sosfiltfilt

from ankle_physics.memory_elements import BacklashOperator
from model_discrepancy.recording.recording import Recording

# Below this frequency position is trusted, above it the integrated velocity, whose drift ends
# there.
CROSSOVER_HZ = 0.5
# Worn couplings and joints: up to a degree.
LARGEST_GAP = 0.03
# Gaps below drown in the noise of an encoder (0.1 mrad in the recorded trials).
SMALLEST_GAP = 3e-4
# Backlash must leave less than this share of the disagreement, also of what a wrong gain would
# leave, both beyond what the two together leave: the integrated noise of the velocity.
LEAST_CUT = 0.5

Measure = Callable[[np.ndarray, np.ndarray], float]


def motion_without_backlash(recording: Recording) -> np.ndarray:
    """Return the position [rad], shape (n,): slowly the measured one, otherwise the integrated
    velocity.
    """
    assert recording.velocity is not None
    travelled = cumulative_trapezoid(recording.velocity, dx=1.0 / recording.rate, initial=0.0)
    return (
        recording.position
        - _fast(recording.position, recording.rate)
        + _fast(travelled, recording.rate)
    )


def encoder_gap(recording: Recording) -> tuple[float, float] | None:
    """Return the width of the gap with its standard error [rad], or None where position and
    velocity agree without one.
    """
    if recording.velocity is None:
        return None
    moved, read = motion_without_backlash(recording), _fast(recording.position, recording.rate)
    plain = _fast(moved, recording.rate)
    apart = _left(read, plain)
    scaled = _left_by_gain(read, plain)
    gap, left = _best_gap(moved, read, recording.rate)
    if gap < SMALLEST_GAP or left > LEAST_CUT * apart:
        return None
    _, together = _best_gap(moved, read, recording.rate, _left_by_gain)
    if left - together > LEAST_CUT * (scaled - together):
        return None
    middle = len(read) // 2
    parts = [
        _best_gap(moved[part], read[part], recording.rate)[0]
        for part in (slice(0, middle), slice(middle, None))
    ]
    return gap, abs(parts[0] - parts[1]) / 2.0


def _best_gap(
    moved: np.ndarray, read: np.ndarray, rate: float, left: Measure | None = None
) -> tuple[float, float]:
    """Return the gap that brings position nearest to the reading, and the variance that it leaves,
    or another measure of what is left.
    """
    measure = left or _left

    def apart(gap: float) -> float:
        return measure(read, _fast(BacklashOperator().run(moved, gap), rate))

    found = minimize_scalar(
        apart, bounds=(0.0, LARGEST_GAP), method="bounded", options={"xatol": 1e-5}
    )
    return float(found.x), float(found.fun)


def _left(read: np.ndarray, other: np.ndarray) -> float:
    """Return the variance between the reading and another position."""
    return float(np.var(read - other))


def _left_by_gain(read: np.ndarray, other: np.ndarray) -> float:
    """Return the variance that the best gain leaves between the reading and another position."""
    return _left(read, other * (read @ other) / (other @ other))


def _fast(signal: np.ndarray, rate: float) -> np.ndarray:
    return sosfiltfilt(
        butter(2, CROSSOVER_HZ, "highpass", fs=rate, output="sos"), signal - signal.mean()
    )
