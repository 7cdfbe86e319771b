"""The names that a first recording leaves open, and what a further recording by itself says of
them.
"""

from __future__ import annotations

from ankle_physics.joint_profile import joint_in_force
from ankle_physics.rig_file import RigFile
from model_discrepancy.diagnose import Diagnosis
from model_discrepancy.fit.base_model import bic, is_alignment, without_alignment
from model_discrepancy.problem import Problem, prepare
from model_discrepancy.recording.channel_gains import channel_findings, trusted
from model_discrepancy.recording.motion import motion_step
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.servo import identify_servo
from model_discrepancy.search.screening import with_term
from model_discrepancy.tools.movement_ranking import percent
from model_discrepancy.tools.open_set import OpenSet, remaining, stretch_errors


def open_sets(first: Diagnosis) -> list[OpenSet]:
    """Return the effects that the first recording names and for which other names would do.

    What a search found and the verdict does not name, since it predicts no torque on unseen data or
    the movement may hold it, is no effect: what stands in for noise in one movement is excluded by
    the next one, whatever its name. Nor is an alignment of the channels within half a sample, which
    each recording has of its own (`OpenSet.fitted`).

    Parameters
    ----------
    first
        Diagnosis of a usable recording.
    """
    assert first.found is not None
    assert first.problem is not None
    final = first.found.final
    aligned = is_alignment(first.problem.fitter, final)
    named = {effect["name"] for effect in first.verdict.effects}
    sets = []
    for effect in first.found.effects:
        if effect.trial.name in named and effect.rivals:
            scores = {effect.trial.name: first.found.compared.score}
            scores |= {t.name: t.fit.score for t in effect.rivals}
            models = {effect.trial.name: final.values}
            models |= {t.name: t.fit.values for t in effect.rivals}
            best = min(scores.values())
            excess = {name: [score / best - 1.0] for name, score in scores.items()}
            if aligned:
                models = {name: without_alignment(values) for name, values in models.items()}
            sets.append(OpenSet(effect.trial.name, models, excess))
    return sets


def judge_alone(
    sets: list[OpenSet],
    recording: Recording,
    rig: RigFile | None,
    known: Problem | None = None,
) -> str:
    """Fit every name that is left to a new recording, exclude what all recordings so far exclude,
    and return what was found, in one sentence.

    Parameters
    ----------
    sets
        Open ones, which are changed.
    recording
        The new one.
    rig
        A calibrated one; None: nothing is known of the rig.
    known
        Another recording of the rig, which may tell how far the servo gives way and what the torque
        sensor does.
    """
    findings = channel_findings(recording, identify_servo(recording, motion_step(recording)))
    usable, terms = trusted(recording, findings), joint_in_force().terms
    compliance, reading = (known.told_compliance, known.reading) if known else (None, None)
    problem = prepare(usable, terms, rig=rig, compliance=compliance, reading=reading)
    fitter = problem.fitter
    said = []
    for one in sets:
        scores, criterion = {}, {}
        for name in one.left:
            fit = one.fitted(fitter, name)
            scores[name], criterion[name] = fit.score, bic(fitter, fit)
            one.errors.setdefault(name, []).append(stretch_errors(fit))
            # The next movement is designed with what this recording made of each name, and not
            # with the alignment of its channels.
            terms_of_name = with_term(list(one.model(name)), name)
            one.models[name] = {term: fit.values[term] for term in terms_of_name}
        preferred = min(scores, key=lambda name: scores[name])
        best = scores[preferred]
        one.without.append(one.fitted_without(fitter, preferred).score / best - 1.0)
        for name, score in scores.items():
            one.excess.setdefault(name, []).append(score / best - 1.0)
            less_likely = 0.5 * (criterion[name] - min(criterion.values()))
            one.evidence[name] = one.evidence.get(name, 0.0) + less_likely
        one.left = remaining(one, list(scores))
        out = [name for name in scores if name not in one.left]
        said.append(
            f"{' or '.join(one.left)} is left"
            + (f", {', '.join(out)} excluded" if out else ", nothing excluded")
            + f" ({', '.join(f'{n} {percent(s / best - 1.0)} %' for n, s in scores.items())}"
            f" more error than the best; without any of them {percent(one.without[-1])} %)"
        )
    return ("; ".join(said) + ".").replace("_", " ")
