"""The diagnosis as a page, ``report.html``: one file that needs no network."""

from __future__ import annotations

import math
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ankle_interfaces.value_text import three_digits, with_error, with_unit
from model_discrepancy.criticism.ceiling import unexplainable_power
from model_discrepancy.report.effect_section import (
    effect_sections,
    equations,
    exclusions,
    is_stated,
    likely_names,
)
from model_discrepancy.report.page import html_list, html_table, image, write_page
from model_discrepancy.report.pictures import (
    angle_error_picture,
    before_and_after,
    block_picture,
    cells_picture,
    channels_picture,
    dependence_picture,
    ladder,
    path_diagram,
    residual_picture,
    stiffness_picture,
)
from model_discrepancy.report.plain_words import (
    location_rows,
    sentence,
    vaf_text,
    variability_rows,
    words,
)
from model_discrepancy.report.stiffness_in_time import changes_stiffness
from model_discrepancy.report.verdict import Verdict, repetition, separating_measurements

if TYPE_CHECKING:
    from model_discrepancy.diagnose import Diagnosis

# Of what the terms leave: less may be chance, and something else speaks against them.
_LEFT_THAT_SPEAKS_AGAINST = 0.01


def headline(diagnosis: Diagnosis) -> str:
    """Return the verdict in one sentence or two."""
    verdict = diagnosis.verdict
    if verdict.verdict == "bad_recording":
        return f"This recording cannot be used: {verdict.reasons[0]}."
    if verdict.verdict == "no_mismatch":
        return "The base model is enough: no structure is left."
    missing = "Physics is missing in the base model"
    if verdict.verdict == "unexplained" and not verdict.effects:
        return f"{missing}, and no term of the library accounts for it."
    names = likely_names(verdict.effects)
    said = f"Found: {names}." if is_stated(verdict.effects) else f"Likeliest: {names}."
    if verdict.verdict == "unexplained":
        return f"{missing}, and the library's terms do not account for all of it. {said}"
    return f"{missing}: {names}." if is_stated(verdict.effects) else f"{missing}. {said}"


def why_unexplained(verdict: Verdict) -> str:
    """Return how much of the gap the found terms close, and why this explains nothing all the same;
    nothing for other verdicts, and where no term was found.

    Parameters
    ----------
    verdict
        On a recording.
    """
    closed = verdict.fit.get("gap_closed")
    if verdict.verdict != "unexplained" or not verdict.effects or not closed:
        return ""
    left = verdict.fit["remaining_predictable_share"]
    against = (
        f"{100 * left:.1f} % of what it leaves can still be predicted from the movement"
        if left >= _LEFT_THAT_SPEAKS_AGAINST
        else "what speaks against it stands below, under 'Other terms' and 'Remarks'"
    )
    return (
        f"What was found closes {100 * closed:.1f} % of the gap between the base model and what "
        f"the movement predicts. It does not count as the explanation: {against}."
    )


def explained(fit: dict[str, Any]) -> str:
    """Return in one sentence how much of the torque both models explain.

    Parameters
    ----------
    fit
        As the verdict holds it; empty where the recording was not fitted.
    """
    if not fit:
        return ""
    base, augmented = fit["baseline_vaf_holdout"], fit["augmented_vaf_holdout"]
    found = f", with what was found {vaf_text(augmented)} %" if augmented != base else ""
    return (
        f"On data that were not used for the fit, the base model explains {vaf_text(base)} % of "
        f"the torque's variance{found}. About {vaf_text(fit['ceiling_vaf'])} % can be explained at "
        "all."
    )


def write_report(diagnosis: Diagnosis, path: Path) -> None:
    """Write the report."""
    verdict = diagnosis.verdict
    lines = (explained(verdict.fit), why_unexplained(verdict), _about(diagnosis))
    parts = [f"<h1>{escape(headline(diagnosis))}</h1>"]
    parts += [f"<p>{escape(line)}</p>" for line in lines if line]
    if diagnosis.found is not None:
        parts += _sections(diagnosis)
    else:
        parts += ["<h2>What was recorded</h2>", image(channels_picture(diagnosis.recording))]
    next_steps = what_next(diagnosis)
    said = [*next_steps, *_said_above(diagnosis)]
    remarks = [reason for reason in verdict.reasons if reason not in said]
    parts += ["<h2>What to measure next</h2>", html_list([sentence(step) for step in next_steps])]
    if remarks:
        parts += ["<h2>Remarks</h2>", html_list([sentence(remark) for remark in remarks])]
    write_page(diagnosis.recording.name, parts, path)


def _said_above(diagnosis: Diagnosis) -> list[str]:
    """Return the reasons that headline and sections state: why a recording is bad, and what the
    missing block is.
    """
    if diagnosis.verdict.verdict == "bad_recording":
        return diagnosis.verdict.reasons[:1]
    criticism = diagnosis.criticism
    block = criticism.block if criticism is not None else None
    return [block.sentence] if block is not None else []


def what_next(diagnosis: Diagnosis) -> list[str]:
    """Return what to record to settle what this recording leaves open, one sentence each."""
    verdict = diagnosis.verdict
    if verdict.verdict == "bad_recording":
        return ["The same movement, once the rig is mended."]
    found = separating_measurements(verdict.effects)
    if found:
        found.append(
            "'ankle design-experiment' on this folder proposes the perturbation that tells them "
            "apart."
        )
    found += repetition(verdict.effects)
    if diagnosis.criticism is not None and diagnosis.criticism.block is not None:
        found.append(_probe(diagnosis.criticism.block.input))
    return found or ["Nothing: no question is left open that another perturbation would answer."]


def _probe(name: str) -> str:
    """Describe a recording that shows the missing block better."""
    if name == "position":
        way = "steps of several sizes, held for two seconds and more, from several positions"
    elif name == "acceleration":
        way = (
            "the same perturbation with the empty footplate, and with the foot strapped more "
            "tightly"
        )
    elif "flexion" in name:
        way = (
            "stretches of several speeds and intervals in that direction, with EMG of calf and shin"
        )
    else:
        way = "movements of one size with several rise times"
    return f"To see the missing block more clearly ({name}): {way}."


def _about(diagnosis: Diagnosis) -> str:
    r = diagnosis.recording
    more = [
        name
        for name, there in (
            ("velocity", r.velocity is not None),
            ("reference", r.reference is not None),
            ("EMG", bool(r.emg)),
        )
        if there
    ]
    return (
        f"{r.name}: {r.duration:.0f} s at {r.rate:g} Hz; position, "
        f"torque{''.join(', ' + m for m in more)}."
    )


def _sections(d: Diagnosis) -> list[str]:
    assert d.problem is not None
    assert d.found is not None
    assert d.criticism is not None
    fitter, left = d.problem.fitter, d.criticism
    noise = unexplainable_power(fitter.columns, d.found.final) ** 0.5
    effects = d.verdict.effects
    # Names that are too small to be stated are in no model.
    augmented = bool(d.found.effects) and d.verdict.verdict != "no_mismatch"
    parts = [
        "<h2>Torque, recorded and predicted</h2>",
        image(
            before_and_after(
                fitter,
                left.base_map,
                left.base_held_out,
                left.final_held_out if augmented else None,
                noise,
            )
        ),
    ]
    if effects:
        parts += effect_sections(effects) + equations(effects) + exclusions(effects)
    if augmented and "uneven_angle" in d.found.final.terms:
        parts += [
            "<h2>The error of the measured angle</h2>",
            "<p>The torque shows that the plate does not turn by what the sensor says. An error of "
            "constant slope would be a wrong gain, which torque does not show.</p>",
            image(angle_error_picture(fitter, d.found.final)),
        ]
    if augmented and changes_stiffness(d.found.final.terms):
        parts += [
            "<h2>The stiffness in the course of the recording</h2>",
            image(stiffness_picture(fitter, d.found.final)),
        ]
    marked = {e["location"] for e in effects} | (
        {left.block.place} if left.block is not None else set()
    )
    parts += ["<h2>The signal path</h2>", image(path_diagram(marked)), _path_line(marked)]
    if d.verdict.variability:
        parts += [
            "<h2>What every subject has</h2>",
            "<p>Variability of the subject is measured and is no mismatch.</p>",
            html_table(["", "value ± standard error"], variability_rows(d.verdict.variability)),
        ]
    if left.block is not None:
        parts += [
            "<h2>The missing block</h2>",
            f"<p>{escape(left.block.sentence)}</p>",
            image(block_picture(left.block)),
        ]
    final_map = left.final_map if augmented else None
    parts += [
        "<h2>Where the model misses torque</h2>",
        image(residual_picture(left.base_map, final_map)),
    ]
    if left.base_map.cells:
        parts.append(image(cells_picture(left.base_map, final_map)))
    parts += [image(dependence_picture(left.base_map)), _localisation(d.verdict.localisation)]
    if augmented:
        parts += ["<h2>What each effect explains</h2>", image(ladder(d.found))]
        parts += ["<h2>Base parameters before and after</h2>", _parameters(d.verdict.parameters)]
    else:
        parts += ["<h2>The base model's parameters</h2>", _values(d.verdict.parameters)]
    if d.verdict.alternatives and (augmented or not d.found.effects):
        parts += ["<h2>Other terms</h2>", other_terms(d.verdict.alternatives)]
    rows = [
        [
            f"{1000 * w[0]:.0f} to {1000 * w[1]:.0f} ms",
            vaf_text(value),
            vaf_text(left.final_held_out.windows.get(w, math.nan)),
        ]
        for w, value in left.base_held_out.windows.items()
    ]
    rows += [
        [f"{b[0]:g} to {b[1]:g} Hz", vaf_text(value), vaf_text(left.final_held_out.bands[b])]
        for b, value in left.base_held_out.bands.items()
    ]
    columns = 3 if augmented else 2
    head = ["where", "base model", "with the new physics"][:columns]
    parts += [
        "<h2>Variance accounted for on unseen data [%]</h2>",
        html_table(head, [row[:columns] for row in rows]),
    ]
    return parts


def other_terms(alternatives: list[dict[str, Any]]) -> str:
    """Return what other terms would do to the fit, as a table.

    Parameters
    ----------
    alternatives
        Of a verdict.
    """
    rows = []
    for other in alternatives:
        replaced = other["instead_of"]
        how = f"instead of {words(replaced)}" if replaced else "in addition"
        rows.append([words(other["name"]), how, f"{-other['delta_score']:+.0f}"])
    head = ["term", "how", "change of BIC with it (below 0: it fits better)"]
    return html_table(head, rows)


def _path_line(marked: set[str]) -> str:
    return "" if marked else "<p>No block is marked: nothing was found missing.</p>"


def _localisation(found: dict[str, Any]) -> str:
    rows = location_rows(found)
    return html_table(["", ""], rows) if rows else ""


def _values(table: dict[str, dict[str, Any]]) -> str:
    """Return the parameters with their standard errors, as a table."""
    rows = []
    for key, entry in table.items():
        error = entry["standard_error"]
        text = with_error((entry["augmented"], math.nan if error is None else error))
        rows.append([with_unit(key), text])
    return html_table(["parameter", "value ± standard error"], rows)


def _parameters(table: dict[str, dict[str, Any]]) -> str:
    rows = []
    for key, entry in table.items():
        change = (
            100.0 * (entry["base"] / entry["augmented"] - 1.0)
            if entry["augmented"]
            else float("nan")
        )
        error = entry["standard_error"]
        augmented = with_error((entry["augmented"], math.nan if error is None else error))
        # A change that rounds to nothing has no sign.
        shown = "0 %" if abs(change) < 0.5 else f"{change:+.0f} %"
        rows.append([with_unit(key), three_digits(entry["base"]), augmented, shown])
    return html_table(
        ["parameter", "base model", "with the new physics", "error of the base model"], rows
    )
