"""Table III of the paper: correlation of K with background EMG and of G with reflex EMG, by muscle
and torque target.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emg_driver.muscles import MUSCLES
from session_analysis.correlation import Correlation, correlate, z_scores
from session_analysis.hold_measures import HoldMeasures

PATHWAYS = ("intrinsic", "reflexive")

PAPER = {
    ("intrinsic", 0.0, "SOL"): Correlation(0.93, 0.85, 0.97, 33),
    ("intrinsic", 0.0, "TA"): Correlation(0.88, 0.78, 0.95, 33),
    ("intrinsic", 0.0, "GL"): Correlation(0.91, 0.83, 0.96, 33),
    ("intrinsic", 0.0, "GM"): Correlation(0.80, 0.56, 0.92, 33),
    ("intrinsic", -5.0, "SOL"): Correlation(0.70, 0.44, 0.87, 22),
    ("intrinsic", -5.0, "TA"): Correlation(0.70, 0.19, 0.87, 22),
    ("intrinsic", -5.0, "GL"): Correlation(0.36, -0.18, 0.69, 22),
    ("intrinsic", -5.0, "GM"): Correlation(0.65, 0.32, 0.82, 22),
    ("reflexive", 0.0, "SOL"): Correlation(0.78, 0.62, 0.87, 33),
    ("reflexive", 0.0, "TA"): Correlation(0.55, 0.27, 0.75, 33),
    ("reflexive", 0.0, "GL"): Correlation(0.75, 0.58, 0.85, 33),
    ("reflexive", 0.0, "GM"): Correlation(0.82, 0.67, 0.90, 33),
    ("reflexive", -5.0, "SOL"): Correlation(0.57, 0.20, 0.77, 22),
    ("reflexive", -5.0, "TA"): Correlation(0.18, -0.11, 0.45, 22),
    ("reflexive", -5.0, "GL"): Correlation(0.56, 0.21, 0.76, 22),
    ("reflexive", -5.0, "GM"): Correlation(0.46, 0.13, 0.67, 22),
}
"""van 't Veld et al. 2018, table III, by pathway, torque target [N.m] and muscle."""


@dataclass(frozen=True)
class Cell:
    """Holds one entry of the table with the data behind it.

    Attributes
    ----------
    pathway
        ``intrinsic`` (K, background) or ``reflexive`` (G, reflex).
    target
        Torque target [N.m].
    muscle
        As in `MUSCLES`.
    correlation
        Of the z-scores.
    subjects
        Of each pair, shape (n,).
    impedance, emg
        Absolute values, shape (n,).
    impedance_z, emg_z
        Z-scores by subject, shape (n,).
    """

    pathway: str
    target: float
    muscle: str
    correlation: Correlation
    subjects: np.ndarray
    impedance: np.ndarray
    emg: np.ndarray
    impedance_z: np.ndarray
    emg_z: np.ndarray


def table3(measures: Sequence[HoldMeasures], seed: int = 0) -> list[Cell]:
    """Compute all cells, targets in descending order.

    z-scores are taken within each subject and torque target: a target changes slope and intercept
    too, and the paper correlates each target by itself.
    """
    cells = []
    for pathway in PATHWAYS:
        for target in sorted({one.hold.target for one in measures}, reverse=True):
            chosen = [one for one in measures if one.hold.target == target]
            subjects = np.array([one.subject for one in chosen])
            impedance = np.array([one.K if pathway == "intrinsic" else one.G for one in chosen])
            for index, muscle in enumerate(MUSCLES):
                emg = np.array(
                    [
                        (one.background if pathway == "intrinsic" else one.reflex)[index]
                        for one in chosen
                    ]
                )
                # A pair counts as a whole: an impedance without its EMG must not shift the others'
                # z-scores.
                paired = np.where(np.isfinite(emg), impedance, np.nan)
                impedance_z, emg_z = z_scores(paired, subjects), z_scores(emg, subjects)
                found = correlate(impedance_z, emg_z, seed)
                cells.append(
                    Cell(pathway, target, muscle, found, subjects, paired, emg, impedance_z, emg_z)
                )
    return cells


def as_text(found: Correlation) -> str:
    """Return ``0.93 [0.85, 0.97]``, or a dash where there is none."""
    if not np.isfinite(found.r):
        return "-"
    return f"{found.r:.2f} [{found.low:.2f}, {found.high:.2f}]"
