"""The recording itself bounds how much of the torque any model of the movement can explain.

Lower end: what model and generic bank together predict on unseen rows. Upper end: pairs of moments
far apart in time with a similar history of movement; as far as their residuals differ even where
the histories agree, no function of the movement can explain them.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from model_discrepancy.criticism.remainder import Remainder
from model_discrepancy.fit.columns import Columns
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.halves import STRETCH_S

# History that shapes the torque: the movement, a reflex delay of 40 ms and a response of 0.3 s.
HISTORY_S = (0.0, 0.01, 0.02, 0.03, 0.045, 0.06, 0.08, 0.11, 0.15, 0.2, 0.27, 0.36)
# Rows between moments that are compared: neighbouring rows are nearly the same moment.
_ROW_SPACING = 4
_NEIGHBOURS = 12
# Pairs of moments with a similar history that a straight line needs.
_FEWEST_PAIRS = 20


def ceiling_vaf(
    columns: Columns, final: Fit, held_out_vaf: float, remainder: Remainder
) -> tuple[float, float]:
    """Return lower and upper end of the VAF [%] that is explainable.

    Parameters
    ----------
    columns
        Of the recording.
    final
        The best model.
    held_out_vaf
        Of that model [%].
    remainder
        What the bank predicts of its residual.
    """
    lower = 100.0 - (100.0 - held_out_vaf) * (1.0 - max(remainder.plain_share, 0.0))
    noise = unexplainable_power(columns, final)
    total = float(np.var(columns.rows.plain(columns.target)[columns.rows.used]))
    upper = 100.0 * (1.0 - noise / total)
    return min(lower, upper), max(lower, upper)


def unexplainable_power(columns: Columns, fit: Fit) -> float:
    """Return the power [N.m^2] of the residual that no history of movement determines.

    It differs between moments with the same history; 0 where no history comes again.
    """
    rows, m = columns.rows, columns.motion
    position = rows.plain(rows.spectrum(m.position))
    velocity = rows.plain(rows.spectrum(m.velocity))
    lags = np.round(np.array(HISTORY_S) * rows.rate).astype(int)
    index = np.flatnonzero(rows.used)[::_ROW_SPACING]
    history = np.concatenate(
        [
            position[index[:, None] - lags] / position.std(),
            velocity[index[:, None] - lags] / velocity.std(),
        ],
        axis=1,
    )
    distance, neighbour = cKDTree(history).query(history, k=_NEIGHBOURS + 1)
    residual = fit.plain[index]
    apart = np.abs(rows.time[index][neighbour] - rows.time[index][:, None]) > STRETCH_S
    squared = 0.5 * (residual[neighbour] - residual[:, None]) ** 2
    near, half = distance[apart] ** 2, squared[apart]
    if len(near) < _FEWEST_PAIRS:
        return 0.0
    # Squared differences grow with the squared distance; the nearer half is extrapolated to zero by
    # a straight line.
    chosen = near <= np.median(near)
    slope, start = np.polyfit(near[chosen], half[chosen], 1)
    mean = float(np.mean(half[chosen]))
    return float(min(max(start if slope > 0 else mean, 0.0), np.var(residual)))
