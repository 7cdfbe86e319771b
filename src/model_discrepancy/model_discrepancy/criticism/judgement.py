"""Whether a recording holds a mismatch, and whether what was found explains it."""

from __future__ import annotations

from dataclasses import dataclass

from model_discrepancy.criticism.remainder import Remainder
from model_discrepancy.criticism.variability import Variability
from model_discrepancy.recording.channel_gains import Finding
from model_discrepancy.search.found import Found

# Effects that together take off less of the whitened error are no mismatch, and beside another
# finding their names are not sure: slow torque or the size of reflexes may have followed the
# movement by accident. Of seven such recordings four had no mismatch, and one name was right; of 36
# names above this share with nothing else against them 34 were.
LEAST_CUT = 0.05
# The same where torque does not move the plate, or not in what is fitted: slow torque does not
# follow the movement there. Of 360 recordings without a mismatch two had a name there, of 1.8 % at
# most (a third one, of 3.4 %, where torque moved the plate); of 108 recordings of two engines that
# were searched since, none had a name at all. Names that were dropped in eleven recordings of a
# third engine took off 1.6 to 7 %. In two a wrong name stood beside the right one.
LEAST_CUT_WHERE_HELD = 0.015
# Names that take off more are a mismatch, however little they raise the VAF: of recordings without
# one, torque that moved the plate took off up to 51 % so, and effects 67 to 90 %.
LARGEST_CUT_BY_LEAKAGE = 0.6
# Nor are they leakage where the base model leaves so much of its whitened residual predictable and
# they leave next to nothing (`LARGEST_BESIDE_NAMES`). Torque that moved the plate made up to 0.59
# of it predictable in 59 recordings without a mismatch (two engines, servos that give way, no
# command), and no name takes that away. A lag of the sensor beside much voluntary torque took off
# 0.59 of the error, and 0.98 was predictable before.
LARGEST_PREDICTABLE_BY_LEAKAGE = 0.8
# Named effects must close most of the gap between the base model and what is predictable at all:
# ten per cent may stay open, where a servo holds the plate even if what is predictable is little
# torque. Right names closed 96 % and more in 25 recordings with one effect, names of terms that
# stood in for another 88 % and more.
GAP_CLOSED = 0.9
# A model of the right shape leaves no residual of which the movement predicts more than a half.
LARGEST_PREDICTABLE = 0.5
# Right names leave up to this share of the whitened residual predictable (8 % at most on the
# independent rig), where the movement holds no torque that no movement causes.
LARGEST_BESIDE_NAMES = 0.1
# No leakage reaches this share: right names left up to 33 % of the whitened residual, others 42 %
# and more.
LARGEST_PREDICTABLE_IN_LOOP = 0.4
# Nor does leakage, or a reflex that varies, let the motion predict this share of the torque in both
# directions: of 480 recordings without a mismatch none left more than 0.0065. In one of an
# independent engine, inputs that cancel the movement (`Remainder.leaked`) predicted 0.027.
LARGEST_TORQUE_BY_LEAKAGE = 0.012
# That is missing physics beside names that close less of the mismatch, or none.
GAP_CLOSED_BESIDE_LEAKAGE = 0.5
# Where torque does not move the plate, right names left up to 20 % of the whitened residual
# predictable, those that stood in for another effect 31 and 32 %, however little torque that was.
LARGEST_PREDICTABLE_WITHOUT_LOOP = 0.25
# Beyond what chance predicts. Recordings without a mismatch left at most 8.5 % there (201 of three
# engines, servos that give way among them; the second 6 %); with an effect that was not named 21 to
# 35 %, chance included.
LARGEST_WITHOUT_NAMES = 0.1
# The same of the plain torque, to which the whitened residual's highest frequencies add little:
# names that close less of its gap describe something else. Right names closed 86 % and more, those
# that stood in for another effect 27 and 64 %.
GAP_CLOSED_IN_TORQUE = 0.75
# Names that let the plain torque be predicted better by less than this share of what is missing
# explain nothing by themselves.
MIN_GAP_SHARE = 0.1
# They are no mismatch where they take off less of the whitened error, too: without a mismatch such
# names took off up to 0.39, and of 219 recordings with effects that were explained, none was so.
LEAST_USEFUL_CUT = 0.4
# Names that predict no plain torque, change nothing that matters in the final model
# (`Found.immaterial`) and take off less than this share of the whitened error are no mismatch.
# Friction of 0.02 N.m took off 0.07 where there was none; right names that raised the VAF as little
# took off 0.13 and more.
LEAST_CUT_WITHOUT_TORQUE = 0.1
# Where torque may have moved the plate and no command tells, what generic regressors predict is not
# called missing physics. Neither are names that close less than this share of the same gap, of the
# plain torque on unseen data. Right names closed 55 % and more, names in a recording without a
# mismatch 16 %.
GAP_CLOSED_WITHOUT_COMMAND = 0.4
# Neither are names there that take off less of the whitened error: those of a recording without a
# mismatch took off 0.31 together, right names 0.54 and more.
LEAST_CUT_WITHOUT_COMMAND = 0.4
# So many names with something against them stand in for physics that the library lacks as often as
# not: of development recordings with one effect, with two, and with one that the library lacks,
# that were called explained, 3 of 63, 8 of 43 and 5 of 10 had so many names.
MANY_NAMES = 3

# One name alone explains nothing where the movement predicts more than `LARGEST_BESIDE_NAMES` of
# the whitened residual and so many times what it predicts by chance: another term stands in for
# what is missing as often as not. Of 202 development recordings in which one name was called
# explained, 18 of 190 right ones left so much, and 8 of the 12 that stood in for a term the library
# lacked.
CRITICISED_RATIO = 5.0


@dataclass(frozen=True)
class Scores:
    """Holds the VAF on unseen data [%]: base model, augmented model, and the upper end of what is
    explainable; and what generic regressors predict of the base model's whitened residual [1].
    """

    base: float
    augmented: float
    ceiling: float
    predictable: float = 0.0


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
    left = max(remainder.share, 0.0)
    closed = found.cut / (found.cut + (1.0 - found.cut) * left) if found.effects else 0.0
    predictable = remainder.significant or (
        closed < GAP_CLOSED_BESIDE_LEAKAGE
        and not remainder.leaked
        and remainder.worst > 0.0
        and remainder.torque_share > LARGEST_TORQUE_BY_LEAKAGE
    )
    # Torque that moves the plate makes a stiffness that varies.
    unsteady = remainder.judged and bool(varies.unsteady)
    unusual = bool(varies.unusual)
    if not found.effects:
        # More than noise lets the movement predict.
        beyond_chance = left - max(remainder.by_chance, 0.0)
        predicts_residual = (
            remainder.held and remainder.criticises and beyond_chance > LARGEST_WITHOUT_NAMES
        )
        if predictable or unusual or unsteady or predicts_residual or found.reflex_stands_in:
            return "unexplained", 0.0
        return ("explained", 1.0) if findings else ("no_mismatch", float("nan"))
    # Without its names a recording is described by the base model.
    stands_in = found.reflex_stands_in or found.base_reflex_stands_in
    resolved = (
        scores.predictable > LARGEST_PREDICTABLE_BY_LEAKAGE
        and left < LARGEST_BESIDE_NAMES
        and found.cut > LEAST_USEFUL_CUT
    )
    large = found.cut > LARGEST_CUT_BY_LEAKAGE or resolved
    gained = scores.augmented - scores.base
    gains_little = gained < MIN_GAP_SHARE * (scores.ceiling - scores.base)
    leaked = not remainder.judged and remainder.torque_share <= LARGEST_TORQUE_BY_LEAKAGE
    # Torque that moved the plate takes off more.
    little = found.cut < LEAST_USEFUL_CUT or leaked
    useless = not large and (gained <= 0.0 or (gains_little and little))
    if (useless or found.cut < LEAST_CUT) and (unsteady or stands_in):
        return "unexplained", closed
    least = LEAST_CUT_WHERE_HELD if remainder.held else LEAST_CUT
    # Names that predict no torque on unseen data follow torque that moved the plate.
    leak = useless and not remainder.held
    immaterial = useless and found.immaterial and found.cut < LEAST_CUT_WITHOUT_TORQUE
    if (leak or immaterial or found.cut < least) and not (predictable or unusual or findings):
        return "no_mismatch", float("nan")
    # Of the torque that the movement predicts at all.
    leaves_torque = gained < GAP_CLOSED_IN_TORQUE * (gained + 100.0 * remainder.torque_share)
    predictable_residual = remainder.held and remainder.criticises and left > LARGEST_BESIDE_NAMES
    closes_little = gained < GAP_CLOSED_WITHOUT_COMMAND * (scores.ceiling - scores.base)
    # Names that predict more torque than leakage ever did are no leakage, however much is noise.
    little_torque = gained <= 100.0 * LARGEST_TORQUE_BY_LEAKAGE
    cuts_little = found.cut < LEAST_CUT_WITHOUT_COMMAND and little_torque
    in_doubt = (closes_little or cuts_little) and not remainder.judged and not large
    unexplained = (
        (predictable and (closed < GAP_CLOSED or leaves_torque or left > LARGEST_PREDICTABLE))
        or (predictable_residual and closed < GAP_CLOSED)
        or (remainder.exceeds_chance and left > LARGEST_PREDICTABLE_IN_LOOP)
        or (remainder.criticises and left > _largest_predictable(remainder) and large)
        or ((found.contradicted or found.ends_at_bounds) and not in_doubt)
        or (remainder.judged and len(found.effects) >= MANY_NAMES and criticised(found, remainder))
        or (len(found.effects) == 1 and remainder.judged and strongly_criticised(remainder))
        or (gains_little and (predictable or unusual))
        or (remainder.exceeds_chance and unusual)
        or bool(varies.unexplainable)
    )
    if unexplained or (in_doubt and stands_in):
        return "unexplained", closed
    if in_doubt and not (unusual or findings):
        return "no_mismatch", float("nan")
    return "explained", closed


def _largest_predictable(remainder: Remainder) -> float:
    """Return the share of the whitened residual that stays predictable beside right names at most,
    however little torque it is.
    """
    without_loop = remainder.held or remainder.judged
    return LARGEST_PREDICTABLE_WITHOUT_LOOP if without_loop else LARGEST_PREDICTABLE_IN_LOOP


def criticised(found: Found, remainder: Remainder) -> bool:
    """Say whether anything stands against the names: something more than chance is predictable,
    further terms correct their shape, or they take off next to nothing.
    """
    return found.shape_corrected or remainder.criticises or found.cut < LEAST_CUT


def strongly_criticised(remainder: Remainder) -> bool:
    """Say whether far more of the whitened residual is predictable than by leakage or by chance,
    however little torque it is.
    """
    least = max(LARGEST_BESIDE_NAMES, CRITICISED_RATIO * remainder.by_chance)
    return remainder.criticises and remainder.share > least
