"""Why estimates are not valid or doubted: what an estimator says, moment by moment, and for how
much of a recording.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Judgement:
    """Holds in words what the estimator said of its estimates at one moment.

    Attributes
    ----------
    time
        Of the newest sample [s].
    not_valid
        Why the estimate was not valid; empty where it was.
    doubts
        Why a valid estimate was doubted; empty where it was not.
    """

    time: float
    not_valid: str
    doubts: str


@dataclass(frozen=True)
class ShareOfTime:
    """Holds a reason and how long it held.

    Attributes
    ----------
    reason
        In words.
    share
        Of the recording's time, 0 to 1.
    """

    reason: str
    share: float

    def __str__(self) -> str:
        """Say both, as ``12 % of the time: samples are missing``."""
        percent = "less than 1" if self.share < 0.01 else f"{100 * self.share:.0f}"
        return f"{percent} % of the time: {self.reason}"


def shares_of_invalid_time(judgements: Sequence[Judgement]) -> list[ShareOfTime]:
    """Return why estimates were not valid and how long, the longest first.

    Parameters
    ----------
    judgements
        Of a whole recording, evenly spaced.
    """
    return _shares([[judgement.not_valid] for judgement in judgements])


def shares_of_doubted_time(judgements: Sequence[Judgement]) -> list[ShareOfTime]:
    """Return why valid estimates were doubted and how long, the longest first.

    Parameters
    ----------
    judgements
        Of a whole recording, evenly spaced. Two reasons may hold at one time.
    """
    return _shares([judgement.doubts.split("; ") for judgement in judgements])


def _shares(reasons: Sequence[Sequence[str]]) -> list[ShareOfTime]:
    counts = Counter(reason for some in reasons for reason in some if reason)
    return [ShareOfTime(reason, count / len(reasons)) for reason, count in counts.most_common()]
