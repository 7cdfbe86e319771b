"""Two halves of a recording, interleaved in stretches, for training and scoring."""

from __future__ import annotations

import numpy as np

from model_discrepancy.fit.rows import Rows

# Long against the reflex (0.5 s) and the whitening filter (0.2 s), short against drifts (tens of
# seconds).
STRETCH_S = 5.0
# Rows next to the other half are in neither: the model's and the filters' memory reaches across.
GUARD_S = 0.5


def interleaved(rows: Rows) -> tuple[np.ndarray, np.ndarray]:
    """Return the masks of alternating stretches of 5 s, each bool of shape (rows.count,)."""
    place = rows.time / STRETCH_S
    inside = (place % 1.0) * STRETCH_S >= GUARD_S
    odd = place.astype(int) % 2 == 1
    return rows.used & inside & ~odd, rows.used & inside & odd


def first_and_second(rows: Rows) -> tuple[np.ndarray, np.ndarray]:
    """Return masks of the first and the second half in time, each bool of shape (rows.count,)."""
    middle = 0.5 * (rows.time[rows.used][0] + rows.time[rows.used][-1])
    return rows.used & (rows.time < middle - 0.5 * GUARD_S), rows.used & (
        rows.time > middle + 0.5 * GUARD_S
    )
