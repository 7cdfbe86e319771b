"""Units in which columns can be an ankle's angle and torque, where the file states none."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from session_recorder.importing.laboratory_units import to_si
from session_recorder.importing.plausibility import (
    INERTIA_RANGE,
    LARGEST_POSITION,
    LARGEST_SPREAD,
    LARGEST_TORQUE,
    MIN_SIGN_SIGNIFICANCE,
    Intrinsic,
    intrinsic,
)

_MIN_MOVEMENT = 1e-3
"""[rad] Movements that show an ankle's mechanics are larger; position noise alone is below."""
_POSITION_UNITS = ("deg", "rad", "mrad")
TORQUE_UNITS = ("N.m", "mN.m", "N.mm", "N.cm")
_SAME_CORRELATION, _SAME_GAIN = 0.9, (0.8, 1.25)
"""Two columns that correlate and vary alike in the same numbers are one angle twice, commanded and
measured, not an angle and a torque."""


def readings(
    position: np.ndarray,
    torque: np.ndarray,
    position_unit: str | None,
    torque_unit: str | None,
    rate: float,
) -> Iterator[tuple[Intrinsic, str, str]]:
    """Return units of position and torque in which an ankle is possible."""
    fit = intrinsic(rate, position, torque)
    if fit is None or abs(fit.inertia) < MIN_SIGN_SIGNIFICANCE * fit.inertia_error:
        return
    for angle in (position_unit,) if position_unit else _POSITION_UNITS:
        for force in (torque_unit,) if torque_unit else TORQUE_UNITS:
            inertia = abs(fit.inertia) * to_si(force)[1] / to_si(angle)[1]
            if not INERTIA_RANGE[0] <= inertia <= INERTIA_RANGE[1]:
                continue
            if (
                possible_angle(position, angle)
                and largest(torque) * to_si(force)[1] <= LARGEST_TORQUE
            ):
                yield fit, angle, force


def same_quantity(one: np.ndarray, other: np.ndarray) -> bool:
    """Return whether two columns, shape (n,), are one quantity twice, as an angle commanded and
    measured.
    """
    good = np.isfinite(one) & np.isfinite(other)
    if good.sum() < 2:
        return False
    a, b = one[good] - one[good].mean(), other[good] - other[good].mean()
    spread_a, spread_b = float(np.sqrt(a @ a)), float(np.sqrt(b @ b))
    if spread_a == 0.0 or spread_b == 0.0:
        return False
    low, high = _SAME_GAIN
    return bool(
        a @ b > _SAME_CORRELATION * spread_a * spread_b and low < spread_b / spread_a < high
    )


def largest(values: np.ndarray) -> float:
    """Return the largest finite absolute value; 0 without one."""
    finite = values[np.isfinite(values)]
    return float(np.max(np.abs(finite))) if len(finite) else 0.0


def possible_angle(values: np.ndarray, unit: str) -> bool:
    """Return whether values in a unit are angles that an ankle takes and moves through."""
    factor = to_si(unit)[1]
    finite = values[np.isfinite(values)]
    return bool(
        not len(finite)
        or (
            np.ptp(finite) * factor <= LARGEST_SPREAD
            and np.ptp(finite) * factor >= _MIN_MOVEMENT
            and largest(finite) * factor <= LARGEST_POSITION
        )
    )
