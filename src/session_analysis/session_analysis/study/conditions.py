"""What was measured in each recording of a study: side, posture, knee angle and more."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ankle_interfaces.value_text import with_unit
from session_analysis.recording_page import VERDICT_SENTENCES
from session_analysis.study.layout import Study
from session_analysis.study.recording_results import RESULTS_FILE, Row
from session_analysis.study.visit_values import LEG_MARK, recording_of

COMPARED_KEYS = ("posture", "knee_angle[deg]")
"""What changes stiffness and reflexes of an unchanged ankle (the knee stretches the gastrocnemius):
visits that differ in it are not the same measurement."""
CONDITION_KEYS = (
    "side", *COMPARED_KEYS, "mvc_plantarflexion[N.m]", "mvc_dorsiflexion[N.m]", "body_mass[kg]",
    "recorded",
)  # fmt: skip
"""Keys of a sidecar file that the report shows, in this order."""
NOT_STATED = "not stated"


@dataclass(frozen=True)
class About:
    """Holds what is known about a recording beside its numbers.

    Attributes
    ----------
    stated
        By the keys of a sidecar file; measures of the visit's check list among them.
    assumed
        What was not stated and had to be assumed, one sentence each.
    verdict
        Of the diagnosis, as a sentence; empty where there is none.
    reports
        Title and file of each page about it, relative to the folder of results.
    """

    stated: Mapping[str, Any] = field(default_factory=dict)
    assumed: Sequence[str] = ()
    verdict: str = ""
    reports: Sequence[tuple[str, str]] = ()


EMPTY_ABOUT = About()
"""It stands for a recording about which nothing is known."""


def read_about(study: Study) -> dict[str, About]:
    """Return what is known about each recording of a study, by its name.

    Raises
    ------
    AnalysisError
        A sidecar file is not readable.
    """
    found = {}
    for entry in study.entries():
        folder = study.derived(entry)
        held = _content(folder / RESULTS_FILE)
        word = str(_content(folder / "diagnosis" / "verdict.json").get("verdict", ""))
        pages = (("estimates", "report.html"), ("diagnosis", "diagnosis/report.html"))
        found[entry.name] = About(
            {**held.get("measured", {}), **entry.stated()},
            held.get("assumed", ()),
            VERDICT_SENTENCES.get(word, word),
            [(title, f"{entry.name}/{page}") for title, page in pages if (folder / page).exists()],
        )
    return found


def _content(path: Path) -> dict[str, Any]:
    """Return the content of a JSON file; empty where it is absent or was cut off."""
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError):
        return {}


def legs_apart(rows: Sequence[Row], about: Mapping[str, About]) -> list[Row]:
    """Return the rows with the leg beside the subject, where both legs of a subject were measured.

    Parameters
    ----------
    rows
        Of the table of results.
    about
        What is known about each recording.
    """
    sides = {
        name: about.get(name, EMPTY_ABOUT).stated.get("side") for name in map(recording_of, rows)
    }
    of_subject: dict[str, set[str]] = {}
    for row in rows:
        if sides[recording_of(row)]:
            of_subject.setdefault(row.subject, set()).add(str(sides[recording_of(row)]))
    out = []
    for row in rows:
        if len(of_subject.get(row.subject, ())) > 1:
            side = sides[recording_of(row)]
            leg = f"{side} leg" if side else f"side {NOT_STATED}"
            out.append(replace(row, subject=f"{row.subject}{LEG_MARK}{leg}"))
        else:
            out.append(row)
    return out


def condition_rows(rows: Sequence[Row], about: Mapping[str, About]) -> list[list[str]]:
    """Return what was measured, one line a recording; the first row names the columns.

    Parameters
    ----------
    rows
        Of one subject.
    about
        What is known about each recording.

    Returns
    -------
    list[list[str]]
        Only what is stated of at least one recording; empty where nothing is.
    """
    recordings = {(row.visit, row.run): recording_of(row) for row in rows}
    stated = {key: about.get(name, EMPTY_ABOUT).stated for key, name in recordings.items()}
    shown = [key for key in CONDITION_KEYS if any(key in one for one in stated.values())]
    if not shown:
        return []
    out = [["visit, run", *map(with_unit, shown)]]
    for visit, run in sorted(stated):
        own = stated[visit, run]
        out.append([f"{visit}, {run}", *(_text(own.get(key)) for key in shown)])
    return out


def difference(rows: Sequence[Row], first: int, last: int, about: Mapping[str, About]) -> str:
    """Return in what two visits of a subject differ, such as ``posture (sitting, lying)``.

    Parameters
    ----------
    rows
        Of one subject.
    first, last
        The visits.
    about
        What is known about each recording.

    Returns
    -------
    str
        Empty where they do not differ.
    """
    out = []
    for key in COMPARED_KEYS:
        before, after = (_values(rows, visit, key, about) for visit in (first, last))
        if before != after:
            out.append(f"{with_unit(key)} ({' and '.join(before)}; then {' and '.join(after)})")
    return ", ".join(out)


def _values(rows: Sequence[Row], visit: int, key: str, about: Mapping[str, About]) -> list[str]:
    names = {recording_of(row) for row in rows if row.visit == visit}
    return sorted({_text(about.get(name, EMPTY_ABOUT).stated.get(key)) for name in names})


def _text(value: Any) -> str:
    if value is None:
        return NOT_STATED
    return f"{value:g}" if isinstance(value, (int, float)) else str(value)
