"""K and G of each hold by an offline method, beside what the estimator said during the session.

The parallel cascade sees the whole hold at once and has no parametric form; it arbitrates where the
online values are doubted. Its prediction of one half of the hold from the other says how much of
the torque a linear joint with one reflex explains.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impedance_estimator.estimator import ESTIMATE_COLUMNS
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.recording.recording import Recording
from session_analysis.holds import Hold
from session_analysis.recorded_session import RecordedSession
from session_analysis.second_opinion import SecondOpinion, second_opinion
from session_recorder.errors import BagError
from session_recorder.sample_account import Gap

LONGEST_GAP = 0.4
"""[s] Longest gap in the samples of a hold that is bridged: a reflex response lasts as long."""
LARGEST_LOST_SHARE = 0.02
"""Largest share of the samples of a hold that may be missing; more spoils the filters."""


@dataclass(frozen=True)
class HoldOpinion:
    """Holds the values of one hold by both methods.

    Attributes
    ----------
    subject
        Whose.
    hold
        When, at which torque target.
    K, G
        Means of the valid online estimates, and the means of their standard errors [N.m/rad],
        [N.m.s/rad]; NaN where none is valid.
    opinion
        Of the offline method; None where it is impossible.
    reason
        Why it is impossible; empty where it is not.
    """

    subject: str
    hold: Hold
    K: tuple[float, float]
    G: tuple[float, float]
    opinion: SecondOpinion | None
    reason: str = ""


def hold_opinions(
    session: RecordedSession, progress: Callable[[float], None] | None = None
) -> list[HoldOpinion]:
    """Fit the parallel cascade to every complete hold of a session.

    Parameters
    ----------
    session
        With its holds and estimates.
    progress
        Called with the fraction done.

    Returns
    -------
    list[HoldOpinion]
        One for each complete hold, in the order of time.
    """
    if not session.holds:
        return []
    recording, reason = None, ""
    try:
        recording = Recording.from_bag(session.path)
    except (BagError, DiagnosisError) as error:
        reason = str(error)
    found = []
    for number, hold in enumerate(session.holds, 1):
        opinion, why = (None, reason) if recording is None else _judge(recording, session, hold)
        K, G = (_online(session.estimates, hold, name) for name in ("K[N.m/rad]", "G[N.m.s/rad]"))
        found.append(HoldOpinion(session.subject, hold, K, G, opinion, why))
        if progress:
            progress(number / len(session.holds))
    return found


def _judge(
    recording: Recording, session: RecordedSession, hold: Hold
) -> tuple[SecondOpinion | None, str]:
    """Return the opinion on a hold, or why there is none."""
    if lost := _too_much_lost(session.gaps, hold):
        return None, lost
    try:
        return second_opinion(_part(recording, hold)), ""
    except ValueError as error:
        return None, str(error)


def _too_much_lost(gaps: Sequence[Gap], hold: Hold) -> str:
    """Return what is missing from a hold, where it is too much to fit what is left."""
    lost = [min(gap.end, hold.end) - max(gap.start, hold.start) for gap in gaps if gap.missing]
    lost = [seconds for seconds in lost if seconds > 0.0]
    share = sum(lost) / (hold.end - hold.start)
    if not lost or (max(lost) <= LONGEST_GAP and share <= LARGEST_LOST_SHARE):
        return ""
    return (
        f"{100 * share:.1f} % of its samples are missing, at most {max(lost):.2f} s at once; "
        f"allowed: {100 * LARGEST_LOST_SHARE:g} %, {LONGEST_GAP:g} s"
    )


def _part(recording: Recording, hold: Hold) -> Recording:
    """Return the samples of a hold."""
    first, last = (round((t - recording.start) * recording.rate) for t in (hold.start, hold.end))
    rows = slice(max(first, 0), max(last, 0))

    def cut(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else values[rows]

    return replace(
        recording,
        position=recording.position[rows],
        torque=recording.torque[rows],
        velocity=cut(recording.velocity),
        reference=cut(recording.reference),
        emg={},
        start=hold.start,
        faults=(),
    )


def _online(estimates: np.ndarray, hold: Hold, name: str) -> tuple[float, float]:
    during = estimates[(estimates[:, 0] >= hold.start) & (estimates[:, 0] <= hold.end)]
    valid = during[during[:, ESTIMATE_COLUMNS.index("valid[1]")] > 0]
    if not len(valid):
        return float("nan"), float("nan")
    error = valid[:, ESTIMATE_COLUMNS.index(f"se_{name}")]
    return (
        float(np.mean(valid[:, ESTIMATE_COLUMNS.index(name)])),
        float(np.mean(error[np.isfinite(error)])) if np.isfinite(error).any() else float("nan"),
    )
