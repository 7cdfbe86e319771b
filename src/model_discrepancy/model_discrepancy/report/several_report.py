"""``report.html`` of several recordings that were diagnosed together."""

from __future__ import annotations

from html import escape
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ankle_physics.term import Owner
from model_discrepancy.report.page import html_list, html_table, image, write_page
from model_discrepancy.report.pictures import encoded
from model_discrepancy.report.plain_words import vaf_text
from model_discrepancy.search.found import REFINEMENT
from model_discrepancy.tools.shared_effects import SharedEffect, Together


def write_several(found: Together, path: Path) -> None:
    """Write the report."""
    names = [m.name for m in found.members]
    parts = [f"<h1>{escape(_headline(found))}</h1>", f"<p>{escape(', '.join(names))}</p>"]
    if found.effects:
        parts += ["<h2>What was left out</h2>", html_list([_line(e) for e in found.named])]
        refining = [e.name.replace("_", " ") for e in found.effects if e.refines]
        if refining:
            parts.append(
                f"<p>The models hold {escape(', '.join(refining))} too: less than "
                f"{100 * REFINEMENT:g} % of what all of them take off the error each, which "
                "corrects the equation of a larger one.</p>"
            )
        parts += ["<h2>The same in all recordings?</h2>"]
        parts += [image(encoded(_values_picture(effect, names))) for effect in found.effects]
    rows = [
        [
            m.name,
            vaf_text(m.base.vaf) if m.base else "",
            vaf_text(m.final.vaf) if m.final else "",
            f"{100 * max(m.after.share, 0.0):.0f}" if m.after else "",
        ]
        for m in found.members
    ]
    head = [
        "recording",
        "base model: variance accounted for on unseen data [%]",
        "with the new physics [%]",
        "of the rest still predictable [%]",
    ]
    parts += ["<h2>How well the models do</h2>", html_table(head, rows)]
    write_page("several recordings", parts, path)


def _headline(found: Together) -> str:
    if found.verdict == "no_mismatch":
        return f"The base model is enough for all {len(found.members)} recordings."
    rig = [e.name.replace("_", " ") for e in found.named if e.shared]
    subject = [e.name.replace("_", " ") for e in found.named if e.belongs_to is Owner.SUBJECT]
    rest = [
        e.name.replace("_", " ") for e in found.named if e.belongs_to is Owner.RIG and not e.shared
    ]
    said = [
        f"{owner}: {', '.join(names)}"
        for owner, names in (
            ("of the rig", rig),
            ("of the subject", subject),
            ("of the rig by its place, but not the same in all recordings", rest),
        )
        if names
    ]
    if found.verdict == "unexplained":
        said.append("something in one recording at least is not in the library")
    return f"The base model leaves out, {'; '.join(said)}."


def _line(effect: SharedEffect) -> str:
    return f"{effect.name.replace('_', ' ')}: {effect.sentence}"


def _values_picture(effect: SharedEffect, names: list[str]) -> Figure:
    """Draw each parameter of a term with its error, recording by recording."""
    figure = Figure(figsize=(3.2 * max(len(effect.values), 2), 2.6), layout="constrained")
    axes = np.atleast_1d(figure.subplots(1, len(effect.values)))
    for axis, (key, pairs) in zip(axes, effect.values.items(), strict=True):
        values = np.array(pairs, dtype=float)
        axis.errorbar(
            range(len(names)), values[:, 0], 1.96 * np.nan_to_num(values[:, 1]), fmt="o", capsize=3
        )
        axis.set_xticks(range(len(names)), names, rotation=20, fontsize=7)
        axis.set_title(f"{effect.name.replace('_', ' ')}: {key}, 95 %", fontsize=8)
    return figure
