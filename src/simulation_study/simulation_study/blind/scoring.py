"""Diagnoses are scored against the truth once the seal is open.

Every rate comes with its counts. A verdict's named set is, for each effect that it states, the
effect's name with its ``set``: the names that fit about equally well. A set counts when it holds at
most three names. Where only the family is right (place and signature), that is counted apart. What
varies in every subject is looked for under ``variability`` and not among the effects. A tentative
name that is wrong does not make a right one beside it wrong; alone it does.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from ankle_physics.term import term_library
from blind_rig.strength import STRENGTHS
from simulation_study.blind.acceptance import ANSWERS, VARIABILITY, Answer

# The rule by which a sealed study judges is stated here and not taken from the diagnosis that it
# judges: a diagnosis with longer sets or another threshold must not change its own score.
# Most names that a set may hold in order to count.
LARGEST_SET = 3
# A name with at least this probability is a statement, under whichever verdict it stands.
STATED_PROBABILITY = 0.7
# Edges of the bins of stated probabilities: finer where verdicts state most.
PROBABILITY_BINS = (0.0, 0.5, 0.7, 0.85, 0.95, 1.0)
VERDICTS = ("no_mismatch", "explained", "unexplained", "bad_recording")
NO_VERDICT = "no_verdict"
# Right answers by kind of case; known effects and pairs are judged by names.
RIGHT_VERDICT = {"null": "no_mismatch", "unknown": "unexplained", "broken": "bad_recording"}


class CaseScore(NamedTuple):
    """Holds the score of one case.

    Attributes
    ----------
    case, kind, hidden
        From the truth.
    strength
        Of a single hidden effect, else empty.
    verdict
        One of `VERDICTS`, or `NO_VERDICT`.
    stated
        Names that the verdict states, most probable first.
    outcome
        ``right``, ``set``, ``family``, ``partial`` (one of two), ``wrong_name``, or the wrong
        verdict's name.
    gap_closed
        (augmented - base) / (ceiling - base) of the verdict's VAF; None where it says nothing.
    parameter_errors
        Relative errors of parameters that mean the same on both sides, by ``term.parameter``.
    base_errors
        Relative errors of I, B, K, G and delay in the augmented model.
    standard_scores
        Errors of the verdict's K and G in units of their standard errors, by name with unit.
    probabilities
        (stated probability, whether the name was right) of each stated effect.
    """

    case: str
    kind: str
    hidden: tuple[str, ...]
    strength: str
    verdict: str
    stated: tuple[str, ...]
    outcome: str
    gap_closed: float | None
    parameter_errors: dict[str, float]
    base_errors: dict[str, float]
    standard_scores: dict[str, float]
    probabilities: tuple[tuple[float, bool], ...]


def _number(value: Any) -> float | None:
    """Return a parameter as ``verdict.json`` writes it, [value, standard error] or a mapping or a
    number; None where it is none of them.
    """
    if isinstance(value, dict):
        value = value.get("value")
    if isinstance(value, (list, tuple)) and value:
        value = value[0]
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    return float(value) if math.isfinite(value) else None


def stated_effects(verdict: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the effects of a verdict, most probable first; none unless it says ``explained``."""
    if verdict.get("verdict") != "explained":
        return []
    return sorted(
        verdict.get("effects", []), key=lambda effect: -(_number(effect.get("probability")) or 0.0)
    )


def named_set(effect: dict[str, Any]) -> set[str]:
    """Return the effect's name and the rivals that the verdict could not exclude."""
    return {str(effect.get("name")), *map(str, effect.get("set", []))}


def _accepts(hidden: str, name: str) -> bool:
    return name in ANSWERS[hidden].names


def _outcome(kind: str, hidden: tuple[str, ...], said: str, verdict: dict[str, Any]) -> str:
    """Return the judgement of one verdict, as `CaseScore.outcome`."""
    if kind in RIGHT_VERDICT:
        if said != RIGHT_VERDICT[kind]:
            return said
        # What was never in the library cannot be named; a confident name or family there is wrong.
        confident = any(
            (_number(effect.get(key)) or 0.0) >= STATED_PROBABILITY
            for effect in verdict.get("effects", [])
            for key in ("probability", "family_probability")
        )
        return "wrong_name" if kind == "unknown" and confident else "right"
    measured = {h for h in hidden if VARIABILITY.get(h) in verdict.get("variability", {})}
    if measured and said in ("no_mismatch", "explained"):
        hidden = tuple(h for h in hidden if h not in measured)
        if not hidden:
            return "wrong_name" if stated_effects(verdict) else "right"
    if said != "explained":
        return said
    effects = stated_effects(verdict)
    names = [str(effect.get("name")) for effect in effects]
    found = [h for h in hidden if any(_accepts(h, name) for name in names)]
    foreign = [
        str(e.get("name"))
        for e in effects
        if not e.get("tentative") and not any(_accepts(h, str(e.get("name"))) for h in hidden)
    ]
    if len(found) == len(hidden) and not foreign:
        return "right"
    sets = [s for s in (named_set(effect) for effect in effects) if len(s) <= LARGEST_SET]
    in_set = [h for h in hidden if h in found or any(_accepts(h, name) for s in sets for name in s)]
    wrong = [
        e
        for e in effects
        if not e.get("tentative") and not any(_accepts(h, n) for h in hidden for n in named_set(e))
    ]
    if len(in_set) == len(hidden) and not wrong:
        return "set"
    kin = {_family(name) for name in names}
    if len(in_set) < len(hidden) and all(
        kin & {_family(name) for name in ANSWERS[h].names} for h in hidden
    ):
        return "family"
    return "partial" if in_set else "wrong_name"


def _family(name: str) -> str:
    """Return the family of a name of the library; a name without one is its own."""
    terms = term_library()
    return terms[name].family or name if name in terms else name


def _standard_scores(truth: dict[str, Any], verdict: dict[str, Any]) -> dict[str, float]:
    """Return errors of the stated K and G in units of their standard errors."""
    scores = {}
    for key in ("K[N.m/rad]", "G[N.m.s/rad]"):
        entry = (verdict.get("parameters") or {}).get(key) or {}
        value, error = (_number(entry.get(k)) for k in ("augmented", "standard_error"))
        if value is not None and error and truth["base"].get(key):
            scores[key] = (value - truth["base"][key]) / error
    return scores


def _gap_closed(verdict: dict[str, Any]) -> float | None:
    fit = verdict.get("fit") or {}
    base, augmented, ceiling = (
        _number(fit.get(key))
        for key in ("baseline_vaf_holdout", "augmented_vaf_holdout", "ceiling_vaf")
    )
    if base is None or augmented is None or ceiling is None or ceiling <= base:
        return None
    return (augmented - base) / (ceiling - base)


def _parameter_errors(truth: dict[str, Any], verdict: dict[str, Any]) -> dict[str, float]:
    errors = {}
    for about in truth["effects"]:
        for path, (term, key, factor) in ANSWERS.get(about["name"], Answer(())).parameters.items():
            for effect in stated_effects(verdict):
                value = (
                    _number((effect.get("parameters") or {}).get(key))
                    if effect.get("name") == term
                    else None
                )
                true = about.get("parameters", {}).get(path)
                if value is not None and true:
                    errors[f"{term}.{key}"] = value / (factor * true) - 1.0
    return errors


def _base_errors(truth: dict[str, Any], model: dict[str, Any] | None) -> dict[str, float]:
    """Return relative errors of the base parameters in an augmented model, as a list of
    terms (docs/physics.md).
    """
    errors = {}
    for term in (model or {}).get("terms", []):
        for key, true in truth["base"].items():
            value = (
                _number(term.get(key))
                if term.get("term") in ("inertia", "viscosity", "stiffness", "reflex")
                else None
            )
            if value is not None:
                errors[key] = value / true - 1.0
    return errors


def score_case(
    truth: dict[str, Any], verdict: dict[str, Any] | None, model: dict[str, Any] | None = None
) -> CaseScore:
    """Judge one verdict.

    Parameters
    ----------
    truth
        As `cases.make_case` returns.
    verdict
        Content of ``verdict.json``; None where there is none.
    model
        Content of ``model.yaml``; None where there is none.
    """
    verdict = verdict or {}
    said = verdict.get("verdict", NO_VERDICT)
    said = said if said in VERDICTS else NO_VERDICT
    kind, hidden = truth["kind"], tuple(about["name"] for about in truth["effects"])
    effects = stated_effects(verdict)
    nameable = hidden if kind in ("known", "pair") else ()
    probabilities = tuple(
        (p, any(_accepts(h, str(effect.get("name"))) for h in nameable))
        for effect in effects
        if (p := _number(effect.get("probability"))) is not None
    )
    strengths = {about.get("strength", "") for about in truth["effects"]}
    return CaseScore(
        truth["case"],
        kind,
        hidden,
        strengths.pop() if len(strengths) == 1 else "",
        said,
        tuple(str(effect.get("name")) for effect in effects),
        _outcome(kind, hidden, said, verdict),
        _gap_closed(verdict),
        _parameter_errors(truth, verdict),
        _base_errors(truth, model) if kind != "broken" else {},
        _standard_scores(truth, verdict) if kind != "broken" else {},
        probabilities,
    )


def _rate(hits: Iterable[bool]) -> dict[str, float | int | None]:
    values = list(hits)
    return {
        "hits": sum(values),
        "of": len(values),
        "rate": sum(values) / len(values) if values else None,
    }


def _median(values: Iterable[float]) -> float | None:
    listed = list(values)
    return float(np.median(listed)) if listed else None


def calibration(probabilities: list[tuple[float, bool]]) -> dict[str, Any]:
    """Return reliability of stated probabilities: per bin the mean statement and the share that was
    right; Brier score.
    """
    p = np.array([statement for statement, _ in probabilities])
    right = np.array([was_right for _, was_right in probabilities], dtype=float)
    bins = []
    for low, high in pairwise(PROBABILITY_BINS):
        inside = (p >= low) & ((p < high) | (high == 1.0)) if len(p) else np.zeros(0, bool)
        if inside.any():
            bins.append(
                {
                    "from": low,
                    "to": high,
                    "count": int(inside.sum()),
                    "stated": float(p[inside].mean()),
                    "right": float(right[inside].mean()),
                }
            )
    return {
        "bins": bins,
        "brier": float(np.mean((p - right) ** 2)) if len(p) else None,
        "count": len(p),
    }


def confusion(scores: list[CaseScore]) -> dict[str, dict[str, int]]:
    """Return hidden (rows) against answered (columns): counts.

    A pair counts under both names joined, an answer by its most probable name.
    """
    table: dict[str, Counter[str]] = {}
    for score in scores:
        row = " + ".join(score.hidden) if score.hidden else "nothing"
        answer = score.stated[0] if score.stated else score.verdict
        table.setdefault(row, Counter())[answer] += 1
    return {row: dict(columns) for row, columns in sorted(table.items())}


def summarise(scores: list[CaseScore]) -> dict[str, Any]:
    """Return all scores of the study, JSON-ready."""
    of = {
        kind: [s for s in scores if s.kind == kind]
        for kind in ("null", "known", "pair", "unknown", "broken")
    }
    named = [s for s in (*of["known"], *of["pair"]) if s.outcome in ("right", "set")]
    by_strength = {}
    for strength in STRENGTHS:
        group = [s for s in of["known"] if s.strength == strength]
        by_strength[strength] = {
            "exact": _rate(s.outcome == "right" for s in group),
            "family": _rate(s.outcome in ("right", "set", "family") for s in group),
            "exact_or_set": _rate(s.outcome in ("right", "set") for s in group),
            "confident_wrong_name": _rate(s.outcome == "wrong_name" for s in group),
        }
    errors: dict[str, list[float]] = {}
    base_errors: dict[str, list[float]] = {}
    for score in scores:
        for key, value in score.parameter_errors.items():
            errors.setdefault(key, []).append(abs(value))
        if score.outcome in ("right", "set"):
            for key, value in score.base_errors.items():
                base_errors.setdefault(key, []).append(abs(value))
    return {
        "cases": len(scores),
        "verdicts": dict(Counter(s.verdict for s in scores)),
        "false_alarms": _rate(s.outcome != "right" for s in of["null"]),
        "known": by_strength,
        # Effects that the drawn subject and protocol did not let show; they count in no rate.
        "known_invisible": sum(s.strength == "invisible" for s in of["known"]),
        "pairs": {
            "both": _rate(s.outcome in ("right", "set") for s in of["pair"]),
            "at_least_one": _rate(s.outcome in ("right", "set", "partial") for s in of["pair"]),
        },
        "unexplained_recall": _rate(
            s.outcome == "right" for s in of["unknown"] if s.strength != "invisible"
        ),
        "unknown_by_strength": {
            strength: _rate(s.outcome == "right" for s in of["unknown"] if s.strength == strength)
            for strength in STRENGTHS
        },
        "bad_recordings_caught": _rate(s.outcome == "right" for s in of["broken"]),
        "good_recordings_called_bad": _rate(
            s.verdict == "bad_recording" for s in scores if s.kind != "broken"
        ),
        "gap_closed_median_named": _median(s.gap_closed for s in named if s.gap_closed is not None),
        "parameter_error_median": {
            key: {"median": _median(v), "count": len(v)} for key, v in sorted(errors.items())
        },
        "base_parameter_error_median_when_right": {
            key: {"median": _median(v), "count": len(v)} for key, v in sorted(base_errors.items())
        },
        "within_two_standard_errors": {
            key: _rate(
                abs(s.standard_scores[key]) <= 2.0 for s in scores if key in s.standard_scores
            )
            for key in ("K[N.m/rad]", "G[N.m.s/rad]")
        },
        "calibration": calibration([p for s in scores for p in s.probabilities]),
        "confusion": confusion(scores),
    }
