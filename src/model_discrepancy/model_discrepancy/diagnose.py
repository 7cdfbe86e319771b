"""The whole diagnosis of one recording: checks, base fit, search, map, ceiling, verdict, report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ankle_physics.joint_profile import JointProfile, joint_in_force
from ankle_physics.model import Model
from ankle_physics.rig_file import RigFile
from model_discrepancy.criticism.ceiling import ceiling_vaf
from model_discrepancy.criticism.generic_bank import Remainder
from model_discrepancy.criticism.locate import ResidualMap, residual_map
from model_discrepancy.criticism.missing_block import MissingBlock, missing_block
from model_discrepancy.criticism.variability import Variability, variability
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.fit.fitter import Fit, Fitter
from model_discrepancy.fit.held_out import HeldOut, held_out
from model_discrepancy.fit.rows import WHITENING_ORDER, autoregression
from model_discrepancy.problem import Problem, prepare, surrogate_activation
from model_discrepancy.recording.channel_gains import Finding, channel_findings, trusted
from model_discrepancy.recording.motion import motion_step
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.recording_checks import faults
from model_discrepancy.recording.servo import identify_servo
from model_discrepancy.report.fitted_model import fitted_model
from model_discrepancy.report.html_report import write_report
from model_discrepancy.report.operating_point import operating_point, stated_impedance
from model_discrepancy.report.verdict import (
    Scores,
    Verdict,
    alternatives,
    before_and_after,
    effect_entry,
    finding_entry,
    kind,
    on_impedance,
    separating_measurements,
)
from model_discrepancy.search.effect_size import size_of
from model_discrepancy.search.null import Null
from model_discrepancy.search.term_search import (
    ALIGNMENT,
    REFINEMENT,
    Found,
    Progress,
    is_alignment,
    place_of,
    search,
)
from model_discrepancy.tools.resimulation import AUGMENTED_FILE, BASE_FILE, RIG_FILE

LOOP_SENTENCE = (
    "no command was recorded and the servo gives way under load: what generic regressors predict "
    "of the rest may be torque that moved the plate, and is no sign of missing physics"
)
EMG_SENTENCE = "the activation of the muscles follows from their EMG, scaled to the slow torque"


@dataclass
class Diagnosis:
    """Holds everything that a diagnosis found; `verdict` alone where the recording is bad."""

    recording: Recording
    verdict: Verdict
    fitter: Fitter | None = None
    found: Found | None = None
    base_map: ResidualMap | None = None
    final_map: ResidualMap | None = None
    base_held_out: HeldOut | None = None
    final_held_out: HeldOut | None = None
    before: Remainder | None = None
    after: Remainder | None = None
    ceiling: tuple[float, float] = (float("nan"), float("nan"))
    block: MissingBlock | None = None


def diagnose(
    source: Recording | str | Path,
    out: str | Path | None = None,
    model: str | Path | Model | None = None,
    library: Sequence[str] | None = None,
    progress: Progress = lambda _: None,
    joint: JointProfile | None = None,
    rig: RigFile | str | Path | None = None,
) -> Diagnosis:
    """Diagnose a recording or a bag.

    Parameters
    ----------
    source
        A recording, or a bag's path.
    out
        Folder for ``verdict.json``, ``base.yaml``, ``model.yaml`` and ``report.html``; None writes
        nothing.
    model
        A model (or its file) that replaces the paper's as the baseline.
    library
        Terms that may be named; None for all.
    progress
        Called with one line for each step.
    joint
        Whose ranges, units and base model hold; None: those in force, which are an ankle's.
    rig
        A calibrated rig (or its file), which is taken as known: its zeros, delays and terms.

    Raises
    ------
    BagError
        No such bag.
    ModelError
        The model cannot be read.
    """
    with (joint or joint_in_force()).in_force():
        known = RigFile.load(rig) if isinstance(rig, str | Path) else rig
        return _diagnose_and_report(source, out, model, library, progress, known)


def _diagnose_and_report(
    source: Recording | str | Path,
    out: str | Path | None,
    model: str | Path | Model | None,
    library: Sequence[str] | None,
    progress: Progress,
    rig: RigFile | None,
) -> Diagnosis:
    """Diagnose a recording or a bag by the ranges and units in force, and write what was found."""
    progress("reading")
    try:
        recording = source if isinstance(source, Recording) else Recording.from_bag(source)
    except DiagnosisError as error:
        recording = Recording.unreadable(str(source), str(error))
    baseline = Model.load(model) if isinstance(model, str | Path) else model
    progress("checking the channels")
    reasons = faults(recording)
    if reasons:
        diagnosis = Diagnosis(recording, Verdict("bad_recording", reasons=reasons))
    else:
        diagnosis = _diagnose(recording, baseline, library, progress, rig)
    diagnosis.verdict.reasons += list(recording.notes)
    if rig is not None:
        diagnosis.verdict.rig["known"] = rig.title
        diagnosis.verdict.reasons.append(
            f"the rig '{rig.title}', calibrated {rig.calibrated:%Y-%m-%d}, is taken as known"
        )
    if out is not None:
        progress("writing the report")
        folder = Path(out)
        folder.mkdir(parents=True, exist_ok=True)
        diagnosis.verdict.save(folder / "verdict.json")
        if diagnosis.found is not None:
            fitted_model(
                diagnosis.found.base, f"{recording.name}: base model, fitted by diagnosis"
            ).save(folder / BASE_FILE)
            augmented_model(diagnosis).save(folder / AUGMENTED_FILE)
        if rig is not None:
            rig.save(folder / RIG_FILE)
        write_report(diagnosis, folder / "report.html")
    return diagnosis


def augmented_model(diagnosis: Diagnosis) -> Model:
    """Return the fitted model, with the missing block as a term where the recording is unexplained.

    Parameters
    ----------
    diagnosis
        Of a usable recording.
    """
    assert diagnosis.found is not None
    assert diagnosis.fitter is not None
    final = diagnosis.found.final
    if diagnosis.block is not None:
        # What the block and the other terms share is divided anew.
        fitter = diagnosis.fitter
        block = diagnosis.block.term_values(fitter.columns.mean_angle)
        values = {**final.values, "missing_block": block}
        final = fitter.with_errors(fitter.fit(list(values), values, evaluations=10))
    return fitted_model(final, f"{diagnosis.recording.name}: fitted by diagnosis")


def _diagnose(
    recording: Recording,
    baseline: Model | None,
    library: Sequence[str] | None,
    progress: Progress,
    rig: RigFile | None = None,
) -> Diagnosis:
    channels = channel_findings(recording, identify_servo(recording, motion_step(recording)))
    terms = (
        joint_in_force().terms
        if baseline is None
        else tuple(e.term.name for e in baseline.entries if e.term.name != "voluntary_torque")
    )
    problem = prepare(trusted(recording, channels), terms, progress, rig)
    fitter, base, bank, parts = problem.fitter, problem.base, problem.bank, problem.parts
    null = Null.of(problem.noise, fitter.rows.time, fitter.rows.used)
    progress("asking what chance finds in this recording's noise")
    before = bank.remainder(fitter, base.residual, base.plain, parts, null.noise)
    base_map = residual_map(fitter.columns, base)
    found = search(fitter, base, null, library, progress, surrogate_activation(problem, null))
    progress("scoring on unseen data")
    after = bank.remainder(fitter, found.final.residual, found.final.plain, parts, null.noise)
    if problem.in_a_loop:
        after = replace(after, judged=False)
    final_map = residual_map(fitter.columns, found.final)
    base_scored = held_out(fitter, found.base)
    final_scored = held_out(fitter, found.final) if found.effects else base_scored
    ceiling = ceiling_vaf(fitter.columns, found.final, final_scored.vaf, after)
    varies = variability(fitter, found.final)
    verdict = _conclude(
        fitter,
        found,
        after,
        channels,
        varies,
        base_map,
        base_scored,
        final_scored,
        ceiling,
        baseline,
    )
    verdict.variability = varies.content()
    verdict.rig = _rig(problem)
    if problem.in_a_loop:
        verdict.reasons.append(LOOP_SENTENCE)
    if problem.activation_by_emg:
        verdict.reasons.append(EMG_SENTENCE)
    verdict.recording = _conditions(recording, fitter, found.final)
    block = None
    if verdict.verdict == "unexplained":
        progress("describing what is missing")
        block = missing_block(fitter, found.final, base_map.onsets)
        _describe_missing(verdict, block)
    return Diagnosis(
        recording,
        verdict,
        fitter,
        found,
        base_map,
        final_map,
        base_scored,
        final_scored,
        before,
        after,
        ceiling,
        block,
    )


def _rig(problem: Problem) -> dict[str, Any]:
    """Return how the servo follows its command and how far it gives way."""
    found: dict[str, Any] = {}
    if problem.servo is not None:
        found["position_per_command[1]"] = list(problem.servo.following)
    if problem.compliance is not None and problem.compliance.significant:
        value, error = problem.compliance.at_rest
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
        "background_torque[N.m]": float(np.mean(recording.torque)),
        "whitening_rate[Hz]": fitter.rows.rate,
        "whitening[1/N.m]": autoregression(final.plain[fitter.rows.used], WHITENING_ORDER).tolist(),
    }


def _describe_missing(verdict: Verdict, block: MissingBlock | None) -> None:
    """Put the missing block into the verdict; without effects its place is the place of the
    mismatch.
    """
    if block is None:
        verdict.reasons.append(
            "the recording is too short to describe the missing block (six stretches of 5 s are "
            "needed)"
        )
        return
    verdict.localisation["missing_block"] = block.content()
    verdict.reasons.append(block.sentence)
    if not verdict.effects:
        verdict.localisation["path"] = block.place


def _conclude(
    fitter: Fitter,
    found: Found,
    after: Remainder,
    findings: list[Finding],
    varies: Variability,
    base_map: ResidualMap,
    base: HeldOut,
    final: HeldOut,
    ceiling: tuple[float, float],
    baseline: Model | None,
) -> Verdict:
    word, closed = kind(
        found, after, findings, varies.unusual, Scores(base.vaf, final.vaf, *ceiling)
    )
    named = found.effects if word != "no_mismatch" else []
    effects = [
        effect_entry(
            effect,
            found.final,
            size_of(fitter, found.final, effect.trial.name, base_map.onsets),
            place == 0,
            word == "explained" and not after.significant,
            bool(found.refinements) or (after.exceeds_chance and not after.judged),
        )
        for place, effect in enumerate(named)
    ]
    effects += [finding_entry(finding) for finding in findings]
    reasons = separating_measurements(effects)
    reasons += [f"{name} ended at the bound of its range" for name in found.final.at_bounds]
    reasons += [
        f"base model: {name} ran into its bound, a sign that it hides something else"
        for name in found.base.at_bounds
    ]
    reasons.append(
        f"generic regressors still predict {100 * max(after.share, 0.0):.1f} % of the whitened "
        "residual on unseen data"
    )
    reasons += varies.unusual
    if named != found.effects:
        names = ", ".join(effect.trial.name for effect in found.effects)
        reasons.append(
            f"{names} would take something off the whitened error, and predict no torque on "
            "unseen data"
        )
    if found.refinements:
        names = ", ".join(effect.trial.name for effect in found.refinements)
        reasons.append(
            f"the model holds {names} too: less than {100 * REFINEMENT:g} % of the mismatch each, "
            "corrections to the rest"
        )
    if is_alignment(fitter, found.final):
        reasons.append(
            f"torque and position are apart by {1000 * found.final.values[ALIGNMENT]['skew']:.2f} "
            "ms, less than half a sample"
        )
    if word == "unexplained" and after.significant:
        strongest = max(after.by_input, key=lambda key: after.by_input[key])
        reasons.append(
            f"no term of the library explains it; regressors of {strongest} predict most of it "
            f"({100 * after.by_input[strongest]:.0f} %)"
        )
    if baseline is not None:
        reasons.append(_given_model(fitter, baseline))
    fit = {
        "baseline_vaf_holdout": round(base.vaf, 2),
        "augmented_vaf_holdout": round(final.vaf, 2),
        "ceiling_vaf": round(0.5 * sum(ceiling), 2),
        "ceiling_vaf_interval": [round(c, 2) for c in ceiling],
        "baseline_vaf_both_ways": [round(v, 2) for v in base.both],
        "augmented_vaf_both_ways": [round(v, 2) for v in final.both],
        "whitened_error_cut": round(1.0 - found.final.score / found.base_score, 4),
        "gap_closed": None if np.isnan(closed) else round(closed, 3),
        "remaining_predictable_share": round(max(after.share, 0.0), 4),
    }
    at = operating_point(fitter.motion, base_map.onsets)
    stated = stated_impedance(found.final, at)
    for effect, entry in zip(named, effects, strict=False):
        entry["on_impedance"] = on_impedance(stated_impedance(effect.without, at), stated)
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
    values: dict[str, dict[str, float]] = {
        e.term.name: dict(e.values) for e in baseline.entries if e.term.name != "voluntary_torque"
    }
    given: Fit = fitter.evaluate(values)
    used = fitter.rows.used
    share = 1.0 - float(np.var(given.plain[used]) / np.var(fitter.plain_target[used]))
    return (
        f"the given model as it stands explains {100 * share:.1f} % of the torque's variance; "
        "refitted it is the baseline"
    )
