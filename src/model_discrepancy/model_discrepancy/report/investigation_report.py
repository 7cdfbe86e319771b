"""``report.html`` of an investigation: its story, round by round."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ankle_interfaces.value_text import three_digits, with_error, with_unit
from ankle_physics.term import term_library
from model_discrepancy.report.page import html_list, html_table, image, write_page
from model_discrepancy.report.pictures import encoded
from model_discrepancy.report.several_report import write_several
from model_discrepancy.tools.investigation import FIRST_FOLDER, TOGETHER_FOLDER, Investigation
from model_discrepancy.tools.movement_ranking import percent
from model_discrepancy.tools.open_set import LEAST_APART, OpenSet


def write_investigation(story: Investigation, path: Path) -> None:
    """Write the story, and the report of all recordings that were searched together beside their
    models; the first diagnosis' own report lies in ``first``.
    """
    parts = [
        f"<h1>{escape(_headline(story))}</h1>",
        f"<p>{escape(story.ended)}</p>",
        "<h2>How it began</h2>",
        f"<p><a href='{FIRST_FOLDER}/report.html'>The first recording</a> left open: "
        + escape("; ".join(_plain(" or ".join(s.names)) for s in story.sets) or "nothing")
        + ".</p>",
        *_meanings(story.sets),
    ]
    for number, one in enumerate(story.rounds, start=1):
        recorded = f"{one.duration:.0f} s" if one.duration else "not recorded"
        parts += [
            f"<h2>Round {number}</h2>",
            html_list(
                [
                    f"Question: {one.question}?",
                    f"Plan: {one.proposal}",
                    f"Recorded: {one.title}, {recorded}.",
                    f"Answer: {one.answer}",
                ]
            ),
        ]
    if story.together:
        parts += ["<h2>All recordings together</h2>", f"<p>{escape(story.together)}</p>"]
    judged = [s for s in story.sets if s.evidence]
    if judged:
        parts += ["<h2>What excludes what</h2>", image(encoded(_excess_picture(judged)))]
        rows = []
        for asked in judged:
            apart = asked.above_likeliest
            rows += [
                [
                    _plain(name),
                    _percent(asked.excess.get(name, [])),
                    f"{asked.evidence.get(name, float('nan')):.0f}",
                    f"{apart[name]:.1f}" if name in apart else "",
                    "left" if name in asked.left else "excluded" if asked.left else "withdrawn",
                ]
                for name in asked.models
            ]
            if asked.without:
                without = _percent(asked.without)
                rows.append(["without any of them (designed recordings)", without, "", "", ""])
        head = [
            "name",
            "error beyond the best of its set, recording by recording [%]",
            "how much less likely (ln)",
            f"standard errors above the likeliest ({LEAST_APART:g} exclude)",
            "",
        ]
        parts.append(html_table(head, rows))
    parts += _models(story)
    write_page("investigation", parts, path)
    if story.found is not None:
        write_several(story.found, path.parent / TOGETHER_FOLDER / "report.html")


def _models(story: Investigation) -> list[str]:
    """Return where the models lie, and the impedance that the first recording gave."""
    links = ", ".join(f"<a href='{escape(file)}'>{escape(file)}</a>" for file in story.models)
    parts = ["<h2>Models</h2>"]
    if story.found is None:
        parts.append(f"<p>The model of the first recording: {links}.</p>")
    else:
        parts.append(
            "<p>One model of each recording, all with the same terms: "
            f"{links} (<a href='{TOGETHER_FOLDER}/report.html'>report</a>).</p>"
        )
    rows = [
        [
            with_unit(key),
            with_error((found["augmented"], found.get("standard_error") or math.nan)),
            three_digits(found["base"]),
        ]
        for key, found in story.first.verdict.parameters.items()
    ]
    if rows:
        head = ["quantity", "with what was found (± standard error)", "base model"]
        parts += [
            "<h2>Impedance of the first recording</h2>",
            "<p>By the names that its own diagnosis preferred. Where other names are left now, "
            "read K and G with them from the models above.</p>"
            if story.found is not None
            else "<p>By its own diagnosis.</p>",
            html_table(head, rows),
        ]
    return parts


def _headline(story: Investigation) -> str:
    if not story.names and story.sets:
        return "No name is confirmed by all recordings."
    if not story.names:
        return f"Nothing was left to ask: {story.first.verdict.verdict.replace('_', ' ')}."
    return f"The base model leaves out {_plain(', '.join(story.names))}."


def _meanings(sets: Sequence[OpenSet]) -> list[str]:
    """Return what each name of the sets stands for."""
    library = term_library()
    names = dict.fromkeys(name for one in sets for name in (*one.names, *one.models))
    rows = [[_plain(name), library[name].sentence] for name in names if name in library]
    return [html_table(["name", "what it does"], rows)] if rows else []


def _percent(shares: Sequence[float]) -> str:
    return ", ".join(percent(share) for share in shares)


def _plain(text: str) -> str:
    return text.replace("_", " ").replace("/", " or ")


def _excess_picture(sets: list[OpenSet]) -> Figure:
    """Draw the error of each name beyond the best of its set, by recording."""
    figure = Figure(figsize=(4.5 * len(sets), 3.0), layout="constrained")
    axes = np.atleast_1d(figure.subplots(1, len(sets)))
    for axis, one in zip(axes, sets, strict=True):
        for name, excess in one.excess.items():
            axis.plot(range(1, len(excess) + 1), 100 * np.array(excess), "o-", label=_plain(name))
        axis.xaxis.set_major_locator(MaxNLocator(integer=True))
        axis.set_xlabel("recording")
        axis.set_ylabel("error beyond the best [%]")
        axis.legend(fontsize=7)
    return figure
