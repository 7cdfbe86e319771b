"""The diagnosis as a page, ``report.html``: one file that needs no network."""

from __future__ import annotations

import sys
from html import escape
from inspect import getdoc
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ankle_physics.joint_profile import joint_in_force
from ankle_physics.term import term_library
from model_discrepancy.criticism.ceiling import unexplainable_power
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

_STYLE = """body{font:15px/1.5 system-ui,sans-serif;max-width:64rem;margin:2rem auto;\
padding:0 1rem;color:#222}
h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:2rem}img{max-width:100%}
body{overflow-wrap:break-word}.wide{overflow-x:auto}
table{border-collapse:collapse;overflow-wrap:normal}td,th{padding:.2rem .8rem;\
border-bottom:1px solid #ddd;text-align:left}
@media(max-width:30rem){h1{font-size:1.2rem}td,th{padding:.2rem .35rem;font-size:.85rem;\
min-width:5rem}.wide img{max-width:44rem;width:auto}}"""


# Names in the headline; the table below holds all of them.
_NAMES_IN_HEADLINE = 3


def headline(diagnosis: Diagnosis) -> str:
    """Return the verdict in one sentence."""
    verdict = diagnosis.verdict
    if verdict.verdict == "bad_recording":
        return f"This recording cannot be used: {verdict.reasons[0]}."
    if verdict.verdict == "no_mismatch":
        return "The base model is enough: no structure is left."
    if verdict.verdict == "unexplained":
        partly = (
            f" {_listed(verdict.effects)} would explain a part of it only."
            if verdict.effects
            else ""
        )
        return f"Physics is missing in the base model that is not in the library.{partly}"
    return f"Physics is missing in the base model: {_listed(verdict.effects)}."


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


def _listed(effects: list[dict[str, Any]]) -> str:
    """Return the first few names with their probabilities, and how many more there are."""
    names = [_stated(effect) for effect in effects[:_NAMES_IN_HEADLINE]]
    more = len(effects) - len(names)
    return "; ".join([*names, *([f"{more} more below"] if more else [])])


def _stated(effect: dict[str, Any]) -> str:
    """Return the name, or the family and its likeliest member where the members could not be told
    apart, with its probability.
    """
    name, stated = (effect[key].replace("_", " ") for key in ("name", "stated"))
    if stated == name:
        return f"{name} (probability {effect['probability']:.2f})"
    return f"{stated} such as {name} (probability {effect['family_probability']:.2f})"


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


def write_page(title: str, parts: list[str], path: Path) -> None:
    """Write one HTML file without network from its parts, in the style of all reports."""
    head = (
        "<meta charset='utf-8'><meta name='viewport' content='width=device-width'>"
        f"<title>{escape(title)}</title><style>{_STYLE}</style>"
    )
    text = f"<!doctype html><html lang='en'>{head}<body>{''.join(parts)}</body></html>"
    path.write_text(joint_in_force().in_units(text), encoding="utf-8")


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
        parts += ["<h2>What was left out</h2>", html_list([_effect_line(e) for e in effects])]
        parts += _consequences(effects) + _equations(effects) + _excluded(effects)
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


def _effect_line(effect: dict[str, Any]) -> str:
    values = ", ".join(
        f"{key} = {v:.4g}" + (f" ± {e:.2g}" if e is not None else "")
        for key, (v, e) in effect["parameters"].items()
    )
    rivals = [name.replace("_", " ") for name in effect["set"][1:]]
    doubt = f" Not excluded: {', '.join(rivals)}." if rivals else ""
    mark = " (tentative)" if effect["tentative"] else ""
    return (
        f"{_stated(effect)}{mark}, {effect['location']}, a property of the {effect['belongs_to']}: "
        f"{effect['name'].replace('_', ' ')}: {effect['sentence']} "
        f"{values}.{doubt}"
    )


def _consequences(effects: list[dict[str, Any]]) -> list[str]:
    """Return what each effect does to K and G, as a table."""
    rows = []
    for effect in effects:
        for key, (without, value, error) in effect.get("on_impedance", {}).items():
            spread = f" ± {error:.2g}" if error is not None else ""
            name = effect["name"].replace("_", " ")
            rows.append([name, key, f"{without:.4g}", f"{value:.4g}{spread}"])
    if not rows:
        return []
    head = ["effect", "", "in a model without it", "in the whole model"]
    return ["<h2>What it does to stiffness and reflex gain</h2>", html_table(head, rows)]


def _equations(effects: list[dict[str, Any]]) -> list[str]:
    """Return equation and source of each term that is named, as its file states them."""
    rows = []
    for effect in effects:
        term = term_library().get(effect["name"])
        if term is not None:
            equation = getdoc(sys.modules[term.__module__]) or ""
            text = f"{equation} {getdoc(term) or ''}".replace("``", "").replace("`", "")
            rows.append([effect["name"].replace("_", " "), " ".join(text.split())])
    return ["<h2>Equations and sources</h2>", html_table(["", ""], rows)] if rows else []


def _excluded(effects: list[dict[str, Any]]) -> list[str]:
    """Return what would not do instead of each effect, and why."""
    rows = [
        [effect["name"].replace("_", " "), other.replace("_", " "), why]
        for effect in effects
        for other, why in effect.get("excluded", {}).items()
    ]
    head = ["instead of", "excluded", "because"]
    return ["<h2>What was excluded, and by what</h2>", html_table(head, rows)] if rows else []


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
        error = f" ± {entry['standard_error']:.2g}" if entry["standard_error"] is not None else ""
        rows.append(
            [key, f"{entry['base']:.4g}", f"{entry['augmented']:.4g}{error}", f"{change:+.0f} %"]
        )
    return html_table(
        ["parameter", "base model", "with the new physics", "error of the base model"], rows
    )


def image(data: str) -> str:
    """Return a picture in base64 PNG as an element, which scrolls where the screen is narrow."""
    return f"<div class='wide'><img alt='' src='data:image/png;base64,{data}'></div>"


def html_list(lines: list[str]) -> str:
    """Return plain sentences as a list."""
    return "<ul>" + "".join(f"<li>{escape(line)}</li>" for line in lines) + "</ul>"


def html_table(head: list[str], rows: list[list[str]]) -> str:
    """Return plain texts as a table, which scrolls where the screen is narrow."""
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in row) + "</tr>" for row in rows
    )
    return f"<div class='wide'><table><tr>{top}</tr>{body}</table></div>"
