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
from model_discrepancy.report.stiffness_in_time import changes_stiffness
from model_discrepancy.report.verdict import repetition, separating_measurements

if TYPE_CHECKING:
    from model_discrepancy.diagnose import Diagnosis


def headline(diagnosis: Diagnosis) -> str:
    """Return the verdict in one sentence."""
    verdict = diagnosis.verdict
    if verdict.verdict == "bad_recording":
        return f"This recording cannot be used: {verdict.reasons[0]}."
    if verdict.verdict == "no_mismatch":
        return "The base model is enough: no structure is left."
    if verdict.verdict == "unexplained":
        partly = (
            f" {likely_names(verdict.effects)}: they would explain a part of it only."
            if verdict.effects
            else ""
        )
        return f"Physics is missing in the base model that is not in the library.{partly}"
    return f"Physics is missing in the base model: {likely_names(verdict.effects)}."


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
    found = f", with what was found {augmented:.1f} %" if augmented != base else ""
    return (
        f"On data that were not used for the fit, the base model explains {base:.1f} % of the "
        f"torque's variance{found}. About {fit['ceiling_vaf']:.1f} % can be explained at all."
    )


def write_report(diagnosis: Diagnosis, path: Path) -> None:
    """Write the report."""
    lines = (explained(diagnosis.verdict.fit), _about(diagnosis))
    parts = [f"<h1>{escape(headline(diagnosis))}</h1>"]
    parts += [f"<p>{escape(line)}</p>" for line in lines if line]
    if diagnosis.found is not None:
        parts += _sections(diagnosis)
    else:
        parts += ["<h2>What was recorded</h2>", image(channels_picture(diagnosis.recording))]
    next_steps = what_next(diagnosis)
    remarks = [reason for reason in diagnosis.verdict.reasons if reason not in next_steps]
    parts += ["<h2>What to measure next</h2>", html_list(next_steps)]
    if remarks:
        parts += ["<h2>Remarks</h2>", html_list(remarks)]
    write_page(diagnosis.recording.name, parts, path)


def what_next(diagnosis: Diagnosis) -> list[str]:
    """Return what to record to settle what this recording leaves open, one sentence each."""
    verdict = diagnosis.verdict
    if verdict.verdict == "bad_recording":
        return [
            f"Mend the rig and record again: {reason}." for reason in diagnosis.verdict.reasons[:1]
        ]
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
    augmented = bool(d.found.effects)
    parts = [
        "<h2>Torque around the movements</h2>",
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
            html_table(["", ""], _flat(d.verdict.variability)),
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
    if d.verdict.alternatives:
        rows = [
            [a["name"], a["instead_of"] or "in addition", f"{a['delta_score']:.0f}"]
            for a in d.verdict.alternatives
        ]
        parts += [
            "<h2>Other terms</h2>",
            html_table(["term", "instead of", "how much worse with it (difference of BIC)"], rows),
        ]
    rows = [
        [
            f"{1000 * w[0]:.0f} to {1000 * w[1]:.0f} ms",
            f"{value:.1f}",
            f"{left.final_held_out.windows.get(w, float('nan')):.1f}",
        ]
        for w, value in left.base_held_out.windows.items()
    ]
    rows += [
        [f"{b[0]:g} to {b[1]:g} Hz", f"{value:.1f}", f"{left.final_held_out.bands[b]:.1f}"]
        for b, value in left.base_held_out.bands.items()
    ]
    columns = 3 if augmented else 2
    head = ["where", "base model", "with the new physics"][:columns]
    parts += [
        "<h2>Variance accounted for on unseen data [%]</h2>",
        html_table(head, [row[:columns] for row in rows]),
    ]
    return parts


def _flat(found: dict[str, dict[str, Any]]) -> list[list[str]]:
    """Return the variability as rows of a table: what, and its numbers with standard errors."""
    rows = []
    for name, entry in found.items():
        for key, value in entry.items():
            numbers = value if isinstance(value, list) else [value]
            text = " ± ".join(f"{number:.3g}" for number in numbers)
            rows.append([f"{name.replace('_', ' ')}, {key}", text])
    return rows


def _path_line(marked: set[str]) -> str:
    return "" if marked else "<p>No block is marked: nothing was found missing.</p>"


def _localisation(found: dict[str, Any]) -> str:
    plain = [[key, str(value)] for key, value in found.items() if not isinstance(value, dict)]
    return html_table(["", ""], plain) if plain else ""


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
        rows.append([with_unit(key), three_digits(entry["base"]), augmented, f"{change:+.0f} %"])
    return html_table(
        ["parameter", "base model", "with the new physics", "error of the base model"], rows
    )
