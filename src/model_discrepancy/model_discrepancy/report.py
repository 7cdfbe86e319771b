"""``report.html``: the diagnosis for people, one file without network."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from model_discrepancy.ceiling import unexplainable_power
from model_discrepancy.pictures import before_and_after, ladder, path_diagram, residual_picture

if TYPE_CHECKING:
    from model_discrepancy.diagnose import Diagnosis

_STYLE = """body{font:15px/1.5 system-ui,sans-serif;max-width:64rem;margin:2rem auto;padding:0 1rem;color:#222}
h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:2rem}img{max-width:100%}
table{border-collapse:collapse}td,th{padding:.2rem .8rem;border-bottom:1px solid #ddd;text-align:left}"""


def headline(diagnosis: Diagnosis) -> str:
    """The verdict in one sentence."""
    verdict = diagnosis.verdict
    fit = verdict.fit
    if verdict.verdict == "bad_recording":
        return f"This recording cannot be used: {verdict.reasons[0]}."
    numbers = f"{fit['baseline_vaf_holdout']:.1f} % of the torque on unseen data (explainable: about {fit['ceiling_vaf']:.1f} %)"
    if verdict.verdict == "no_mismatch":
        return f"The base model is enough: it explains {numbers}, and no structure is left."
    names = ", ".join(e["name"].replace("_", " ") for e in verdict.effects)
    if verdict.verdict == "unexplained":
        partly = f" {names} account for a part of it only." if names else ""
        return f"The base model explains {numbers}; what is missing is not in the library.{partly}"
    return f"The base model leaves out {names}: it explains {numbers}, with them {fit['augmented_vaf_holdout']:.1f} %."


def write_report(diagnosis: Diagnosis, path: Path) -> None:
    """Write the report."""
    parts = [f"<h1>{escape(headline(diagnosis))}</h1>", f"<p>{escape(_about(diagnosis))}</p>"]
    if diagnosis.found is not None:
        parts += _sections(diagnosis)
    parts += ["<h2>Remarks</h2>", _list(diagnosis.verdict.reasons)]
    title = escape(diagnosis.recording.name)
    head = f"<meta charset='utf-8'><title>{title}</title><style>{_STYLE}</style>"
    text = f"<!doctype html><html lang='en'>{head}<body>{''.join(parts)}</body></html>"
    path.write_text(text, encoding="utf-8")


def _about(diagnosis: Diagnosis) -> str:
    r = diagnosis.recording
    more = [
        name
        for name, there in (("velocity", r.velocity is not None), ("reference", r.reference is not None), ("EMG", bool(r.emg)))
        if there
    ]
    return f"{r.name}: {r.duration:.0f} s at {r.rate:g} Hz; position, torque{''.join(', ' + m for m in more)}."


def _sections(d: Diagnosis) -> list[str]:
    assert d.fitter is not None
    assert d.found is not None
    assert d.base_map is not None
    assert d.final_map is not None
    assert d.base_held_out is not None
    assert d.final_held_out is not None
    noise = unexplainable_power(d.fitter.columns, d.found.final) ** 0.5
    effects = d.verdict.effects
    parts = [
        "<h2>Torque around the movements</h2>",
        _image(before_and_after(d.fitter, d.base_map, d.base_held_out, d.final_held_out, noise)),
    ]
    if effects:
        parts += ["<h2>What was left out</h2>", _list([_effect_line(e) for e in effects])]
        parts += [_image(path_diagram({e["location"] for e in effects}))]
    parts += ["<h2>Where the residual sits</h2>", _image(residual_picture(d.base_map, d.final_map)), _localisation(d.verdict.localisation)]
    if d.found.effects:
        parts += ["<h2>What each term buys</h2>", _image(ladder(d.found))]
        parts += ["<h2>Base parameters before and after</h2>", _parameters(d.verdict.parameters)]
    if d.verdict.alternatives:
        rows = [[a["name"], a["instead_of"] or "in addition", f"{a['delta_score']:.0f}"] for a in d.verdict.alternatives]
        parts += ["<h2>Other terms</h2>", _table(["term", "instead of", "change of BIC (negative: worse)"], rows)]
    rows = [
        [f"{1000 * w[0]:.0f} to {1000 * w[1]:.0f} ms", f"{value:.1f}", f"{d.final_held_out.windows.get(w, float('nan')):.1f}"]
        for w, value in d.base_held_out.windows.items()
    ]
    rows += [[f"{b[0]:g} to {b[1]:g} Hz", f"{value:.1f}", f"{d.final_held_out.bands[b]:.1f}"] for b, value in d.base_held_out.bands.items()]
    parts += ["<h2>Variance accounted for on unseen data [%]</h2>", _table(["where", "base model", "with the new physics"], rows)]
    return parts


def _effect_line(effect: dict[str, Any]) -> str:
    values = ", ".join(f"{key} = {v:.4g}" + (f" ± {e:.2g}" if e is not None else "") for key, (v, e) in effect["parameters"].items())
    rivals = [name.replace("_", " ") for name in effect["set"][1:]]
    doubt = f" Not excluded: {', '.join(rivals)}." if rivals else ""
    mark = " (tentative)" if effect["tentative"] else ""
    return f"{effect['name'].replace('_', ' ')}{mark}, {effect['location']}: {effect['sentence']} {values}.{doubt}"


def _localisation(found: dict[str, Any]) -> str:
    return _table(["", ""], [[key, str(value)] for key, value in found.items()]) if found else ""


def _parameters(table: dict[str, dict[str, Any]]) -> str:
    rows = []
    for key, entry in table.items():
        change = 100.0 * (entry["base"] / entry["augmented"] - 1.0) if entry["augmented"] else float("nan")
        error = f" ± {entry['standard_error']:.2g}" if entry["standard_error"] is not None else ""
        rows.append([key, f"{entry['base']:.4g}", f"{entry['augmented']:.4g}{error}", f"{change:+.0f} %"])
    return _table(["parameter", "base model", "with the new physics", "error of the base model"], rows)


def _image(data: str) -> str:
    return f"<img alt='' src='data:image/png;base64,{data}'>"


def _list(lines: list[str]) -> str:
    return "<ul>" + "".join(f"<li>{escape(line)}</li>" for line in lines) + "</ul>"


def _table(head: list[str], rows: list[list[str]]) -> str:
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><tr>{top}</tr>{body}</table>"
