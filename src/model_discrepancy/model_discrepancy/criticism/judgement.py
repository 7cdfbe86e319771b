"""Whether a recording holds a mismatch, and whether what was found explains it."""

from __future__ import annotations

from dataclasses import dataclass

from model_discrepancy.criticism.remainder import Remainder
from model_discrepancy.criticism.variability import Variability
from model_discrepancy.recording.channel_gains import Finding
from model_discrepancy.search.found import Found

# Named effects must close most of the gap between the base model and what is predictable at all:
# fifteen per cent may stay open, and ten where a servo holds the plate and a tenth of the residual
# is predictable, however little torque it is.
GAP_CLOSED, GAP_CLOSED_OF_RESIDUAL = 0.85, 0.9
# A model of the right shape leaves no residual of which the movement predicts more than a half.
LARGEST_PREDICTABLE = 0.5
# Torque that moves a plate whose servo gives way lets the motion predict up to this share of the
# whitened residual (5 to 8 % on the independent rig, servos of 2000 to 3000 N.m/rad). What is more
# is missing physics where the named effects also close less than this share of the gap.
LARGEST_LEAKAGE, GAP_CLOSED_IN_LOOP = 0.1, 0.6
# The same of the plain torque, to which the whitened residual's highest frequencies add little:
# names that close less than half of its gap describe something else.
GAP_CLOSED_IN_TORQUE = 0.5
# Names that let the plain torque be predicted better by less than this share of what is missing
# explain nothing by themselves.
MIN_GAP_SHARE = 0.1


@dataclass(frozen=True)
class Scores:
    """Holds the VAF on unseen data [%]: base model, augmented model, that with generic regressors,
    and the upper end of what is explainable.
    """

    base: float
    augmented: float
    generic: float
    ceiling: float


def judge(
    found: Found,
    remainder: Remainder,
    findings: list[Finding],
    varies: Variability,
    scores: Scores,
) -> tuple[str, float]:
    """Return the verdict, and the share of the predictable mismatch that the effects close (NaN
    without a mismatch).

    Parameters
    ----------
    found
        What the search found.
    remainder
        What generic regressors predict of the residual that is left.
    findings
        What the signals themselves show.
    varies
        What no movement predicts.
    scores
        VAF on unseen data.
    """
    left, unusual = max(remainder.share, 0.0), varies.unusual
    predictable = remainder.significant
    if not found.effects:
        if predictable or unusual:
            return "unexplained", 0.0
        return ("explained", 1.0) if findings else ("no_mismatch", float("nan"))
    if scores.augmented <= scores.base and not (predictable or unusual or findings):
        # Names that predict no torque on unseen data follow torque that moved the plate.
        return "no_mismatch", float("nan")
    cut = 1.0 - found.final.score / found.base_score
    closed = cut / (cut + (1.0 - cut) * left)
    # Of the torque that the movement predicts at all; the generic regressors are its lower bound.
    gained = scores.augmented - scores.base
    gains_little = gained < MIN_GAP_SHARE * (scores.ceiling - scores.base)
    leaves_most = gained < GAP_CLOSED_IN_TORQUE * (scores.generic - scores.base)
    predictable_residual = remainder.held and remainder.criticises and left > LARGEST_LEAKAGE
    beyond_leakage = remainder.exceeds_chance and left > LARGEST_LEAKAGE
    unexplained = (
        (predictable and (closed < GAP_CLOSED or leaves_most or left > LARGEST_PREDICTABLE))
        or (predictable_residual and closed < GAP_CLOSED_OF_RESIDUAL)
        or (beyond_leakage and closed < GAP_CLOSED_IN_LOOP)
        or (gains_little and (predictable or bool(unusual)))
        or (remainder.exceeds_chance and bool(unusual))
        or bool(varies.unusual_reflex)
    )
    return ("unexplained" if unexplained else "explained"), closed
