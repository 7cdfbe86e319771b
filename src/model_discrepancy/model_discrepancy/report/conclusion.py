"""The verdict on a recording, put together from what the stages of a diagnosis found."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ankle_physics.impedance import OperatingPoint
from ankle_physics.model import Model
from ankle_physics.term import ModelValues
from model_discrepancy.criticism.criticism import Criticism
from model_discrepancy.criticism.judgement import criticised
from model_discrepancy.criticism.missing_block import MissingBlock
from model_discrepancy.criticism.remainder import Remainder
from model_discrepancy.criticism.stated_fit import stated_fit
from model_discrepancy.fit.base_model import ALIGNMENT, is_alignment, reflex_at_bound
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.rows import WHITENING_ORDER, autoregression
from model_discrepancy.problem import Problem
from model_discrepancy.recording.channel_gains import Finding
from model_discrepancy.recording.recording import Recording
from model_discrepancy.report.effect_size import size_of
from model_discrepancy.report.friction_at_rest import stiffness_of_friction_at_rest
from model_discrepancy.report.operating_point import (
    equation_misfit,
    operating_point,
    stated_impedance,
    with_model_error,
)
from model_discrepancy.report.plain_words import rounded_vaf
from model_discrepancy.report.verdict import (
    MIN_STATED_PROBABILITY,
    Standing,
    Verdict,
    alternatives,
    before_and_after,
    effect_entry,
    finding_entry,
    on_impedance,
    separating_measurements,
)
from model_discrepancy.search.exchange import REFINEMENT
from model_discrepancy.search.found import Found, place_of

LOOP_SENTENCE = (
    "no command was recorded and the servo gives way under load: what is left of the torque may "
    "have moved the plate itself, so that it is no sign of missing physics"
)
UNKNOWN_LOOP_SENTENCE = (
    "no command was recorded and the plate was never held still, so that nobody knows whether the "
    "servo gives way: what is left of the torque may have moved the plate itself, and is no sign "
    "of missing physics"
)
LEAKED_SENTENCE = (
    "no quantity of the movement predicts that alone, only several that cancel the movement: it is "
    "what torque did to the plate, of which it is known only roughly how it gives way, and no "
    "sign of missing physics"
)
PLAIN_SENTENCE = (
    "much is missing: the values follow from a fit to the plain torque, which large movements "
    "decide, and not from the whitened one"
)
REFLEX_SENTENCE = (
    "doubt G: the reflex's delay, frequency or damping ended at the bound of its range, so that "
    "the reflex stands in for something else"
)
TIME_SENTENCE = (
    "a term follows the time since the recording began, of which one half tells nothing about the "
    "other: unseen data are stretches of 5 s that alternate with those of the fit"
)
EMG_SENTENCE = "the activation of the muscles follows from their EMG, scaled to the slow torque"


def conclude(
    recording: Recording,
    problem: Problem,
    found: Found,
    criticism: Criticism,
    findings: list[Finding],
    baseline: Model | None,
) -> Verdict:
    """Return the verdict on a recording.

    Parameters
    ----------
    recording
        As it was read.
    problem, found, criticism
        What the stages before have found.
    findings
        What the channels themselves show.
    baseline
        The model that replaces the paper's as the baseline; None for the paper's.
    """
    verdict = _verdict(problem.fitter, found, criticism, findings, baseline)
    verdict.variability = criticism.varies.content()
    verdict.rig = _rig(problem)
    if problem.in_a_loop:
        unknown = problem.compliance is None
        verdict.reasons.append(UNKNOWN_LOOP_SENTENCE if unknown else LOOP_SENTENCE)
    if criticism.after.leaked and criticism.after.criticises:
        verdict.reasons.append(LEAKED_SENTENCE)
    if problem.activation_by_emg:
        verdict.reasons.append(EMG_SENTENCE)
    verdict.recording = _conditions(recording, problem.fitter, found.final)
    if verdict.verdict == "unexplained":
        verdict.reasons.append(criticism.missing)
        if criticism.block is not None:
            _describe_missing(verdict, criticism.block)
    return verdict


def _verdict(
    fitter: Fitter,
    found: Found,
    criticism: Criticism,
    findings: list[Finding],
    baseline: Model | None,
) -> Verdict:
    word, after, base_map = criticism.verdict, criticism.after, criticism.base_map
    base, final, closed = criticism.base_held_out, criticism.final_held_out, criticism.closed
    named = found.effects if word != "no_mismatch" else []
    # What is not named is not in the model either.
    held = found
    if named != found.effects:
        # It may hold all the same, so that K and G with it are part of their errors.
        held = Found(found.base, criticism.stated, near=found.near, other_models=[found.final])
        final, after = base, criticism.before
    standing = standing_of(word, found, after)
    effects = [
        effect_entry(
            effect,
            found,
            criticism.stated,
            size_of(fitter, criticism.stated, effect.trial.name, base_map.onsets),
            place == 0,
            standing,
        )
        for place, effect in enumerate(named)
    ]
    effects += [finding_entry(finding) for finding in findings]
    reasons = [*criticism.varies.unusual, *criticism.varies.unsteady]
    reasons += separating_measurements(effects)
    reasons += [f"{name} ended at the bound of its range" for name in held.final.at_bounds]
    if reflex_at_bound(held.final):
        reasons.append(REFLEX_SENTENCE)
    reasons += [
        f"base model: {name} ran into its bound, a sign that it hides something else"
        for name in found.base.at_bounds
    ]
    reasons.append(
        f"{100 * max(after.share, 0.0):.1f} % of what the model leaves unexplained can still be "
        "predicted from the movement, on data that were not used for the fit"
    )
    if named and criticism.alternating:
        reasons.append(TIME_SENTENCE)
    if named == found.effects and criticism.stated is not found.final:
        reasons.append(PLAIN_SENTENCE)
    at = operating_point(fitter.motion, base_map.onsets)
    if named != found.effects:
        reasons.append(_unused_names(found, at))
    if held.refinements:
        names = ", ".join(effect.trial.name for effect in held.refinements)
        reasons.append(
            f"the model holds {names} too: less than {100 * REFINEMENT:g} % of the mismatch each, "
            "corrections to the rest"
        )
    if is_alignment(fitter, held.final):
        reasons.append(
            f"torque and position are apart by {1000 * held.final.values[ALIGNMENT]['skew']:.2f} "
            "ms, less than half a sample"
        )
    if word == "unexplained" and after.significant:
        strongest = max(after.by_input, key=lambda key: after.by_input[key])
        reasons.append(
            f"no known effect explains it; what is missing follows {strongest} most "
            f"({100 * after.by_input[strongest]:.0f} %)"
        )
    if baseline is not None:
        reasons.append(_given_model(fitter, baseline))
    fit = {
        "baseline_vaf_holdout": rounded_vaf(base.vaf),
        "augmented_vaf_holdout": rounded_vaf(final.vaf),
        "ceiling_vaf": rounded_vaf(0.5 * sum(criticism.ceiling)),
        "ceiling_vaf_interval": [rounded_vaf(c) for c in criticism.ceiling],
        "baseline_vaf_both_ways": [rounded_vaf(v) for v in base.both],
        "augmented_vaf_both_ways": [rounded_vaf(v) for v in final.both],
        "whitened_error_cut": round(found.cut, 4),
        "gap_closed": None if np.isnan(closed) else round(closed, 3),
        "remaining_predictable_share": round(max(after.share, 0.0), 4),
    }
    unexplained = word == "unexplained"
    missing = unexplained and after.significant
    tentative = [
        (entry["set_probability"], effect.without)
        for effect, entry in zip(named, effects, strict=False)
        if entry["set_probability"] < MIN_STATED_PROBABILITY
    ]
    stated = with_model_error(
        stated_impedance(criticism.stated, at),
        held,
        at,
        unexplained,
        missing,
        tentative,
        equation_misfit(held, after),
        stiffness_of_friction_at_rest(fitter, held.final, at.step),
    )
    for effect, entry in zip(named, effects, strict=False):
        without = stated_fit(fitter, effect.without, after)
        entry["on_impedance"] = on_impedance(stated_impedance(without, at), stated)
    place = place_of(found.effects[0].trial.name).value if found.effects else _likely_place(after)
    localisation = base_map.summary(place) if word != "no_mismatch" else {}
    return Verdict(
        word,
        effects,
        localisation,
        fit,
        alternatives(found),
        reasons,
        before_and_after(stated_impedance(found.base, at), stated),
    )


def _unused_names(found: Found, at: OperatingPoint) -> str:
    names = ", ".join(effect.trial.name for effect in found.effects)
    there = stated_impedance(replace(found.final, draws={}), at)
    values = ", ".join(f"{key} {there[key][0]:.3g}" for key in there if key[:2] in ("K[", "G["))
    return (
        f"{names} would improve the fit a little, and predict no torque, or next to none, on data "
        f"that were not used for it; the errors allow for the values with it ({values})"
    )


def standing_of(word: str, found: Found, after: Remainder) -> Standing:
    """Return what the data hold against the augmented model.

    Parameters
    ----------
    word
        The verdict.
    found
        What the search found.
    after
        What generic regressors predict of its residual.
    """
    if word == "unexplained":
        return Standing.UNEXPLAINED
    if after.exceeds_chance:
        return Standing.INCOMPLETE
    return Standing.CRITICISED if criticised(found, after) else Standing.COMPLETE


def _likely_place(after: Remainder) -> str:
    """Return where an unexplained mismatch probably sits, from the inputs that predict it."""
    strongest = max(after.by_input, key=lambda key: after.by_input[key])
    return (
        "reflex dynamics"
        if "rectified" in strongest
        else "torque sensor"
        if strongest == "acceleration"
        else "intrinsic"
    )


def _given_model(fitter: Fitter, baseline: Model) -> str:
    """Return how the given model does without any refit."""
    values: ModelValues = {
        e.term.name: dict(e.values) for e in baseline.entries if e.term.name != "voluntary_torque"
    }
    given: Fit = fitter.evaluate(values)
    used = fitter.rows.used
    share = 1.0 - float(np.var(given.plain[used]) / np.var(fitter.plain_target[used]))
    return (
        f"the given model as it stands explains {100 * share:.1f} % of the torque's variance; "
        "refitted it is the baseline"
    )


def _rig(problem: Problem) -> dict[str, Any]:
    """Return how the servo follows its command and how far it gives way."""
    found: dict[str, Any] = {}
    if problem.servo is not None:
        found["position_per_command[1]"] = list(problem.servo.following)
    if problem.compliance is not None and problem.compliance.significant:
        value, error = problem.compliance.magnitude
        found["servo_stiffness[N.m/rad]"] = [1.0 / value, error / value**2]
    return found


def _conditions(recording: Recording, fitter: Fitter, final: Fit) -> dict[str, Any]:
    """Return the values that a second recording must be compared with.

    They are length, size of the movements, background torque, and the residual's spectrum.
    """
    position = fitter.columns.motion.position
    low, high = np.percentile(position, [1.0, 99.0])
    return {
        "rate[Hz]": recording.rate,
        "duration[s]": recording.duration,
        "movement[rad]": float(high - low),
        "movement_rms[rad]": float(np.std(position)),
        "background_torque[N.m]": float(np.mean(recording.torque)),
        "whitening_rate[Hz]": fitter.rows.rate,
        "whitening[1/N.m]": autoregression(final.plain[fitter.rows.used], WHITENING_ORDER).tolist(),
    }


def _describe_missing(verdict: Verdict, block: MissingBlock) -> None:
    """Put the missing block into the verdict; without effects its place is the place of the
    mismatch.
    """
    verdict.localisation["missing_block"] = block.content()
    if not verdict.effects:
        verdict.localisation["path"] = block.place
