"""The report of a study: each subject against their own earlier visits, and how well measures
repeat.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ankle_interfaces.value_text import three_digits, with_unit
from session_analysis.html_page import bullets, heading, page, paragraph, table
from session_analysis.study.conditions import About, difference, legs_apart
from session_analysis.study.detectable_change import (
    EMPTY_SCATTER,
    detectable_change,
    detectable_changes,
    scatter,
)
from session_analysis.study.recording_results import Row
from session_analysis.study.reliability import Reliability, reliability
from session_analysis.study.subject_part import SHOWN_QUANTITIES, subject_parts
from session_analysis.study.visit_values import (
    LEG_MARK,
    left_out_sentence,
    subject_of,
    visit_table,
)

PAPER_ANKLE = {
    "K[N.m/rad]": "100 (0 to 200)",
    "G[N.m.s/rad]": "10 (0 to 20)",
    "B[N.m.s/rad]": "0.63",
    "I[kg.m^2]": "0.0137",
}
"""The ankle of the simulations of van 't Veld et al. 2018, section II-D, and the ranges that its
random ankles were drawn from. Absolute values of its subjects are not stated there."""


def write_study_report(
    rows: Sequence[Row],
    failures: Mapping[str, str],
    path: Path,
    title: str,
    subject: str = "",
    about: Mapping[str, About] | None = None,
) -> Path:
    """Write the report as one HTML file.

    Parameters
    ----------
    rows
        Of the table of results.
    failures
        Why a recording gave no result, by its name.
    path
        The file to write.
    title
        Title of the page.
    subject
        Only this subject's part, which names no recording of another one; the reliability is that
        of the whole study.
    about
        What is known about each recording, by its name.
    """
    about = about or {}
    rows = legs_apart(rows, about)
    names = sorted({row.subject for row in rows if subject in ("", subject_of(row.subject))})
    parts = [paragraph(_overview(rows, names), "answer")]
    parts += _reliability_parts(rows, subject, about)
    detectable = {quantity: _detectable(rows, quantity) for quantity in SHOWN_QUANTITIES[:2]}
    for one in names:
        own = {quantity: found.get(one, np.nan) for quantity, found in detectable.items()}
        parts += subject_parts([row for row in rows if row.subject == one], one, own, about)
    parts += _paper_parts(rows, names, subject)
    failed = [
        f"{name}: {why}"
        for name, why in failures.items()
        if not subject or name.startswith(f"sub-{subject}_")
    ]
    parts += [heading("Recordings without a result"), bullets(failed, "loss", "None.")]
    path.write_text(page(title, parts), encoding="utf-8")
    return path


def _paper_parts(rows: Sequence[Row], subjects: Sequence[str], whose: str) -> list[str]:
    """Return the values of the subjects beside those of the paper, apart from their own visits."""
    body = []
    for quantity, stated in PAPER_ANKLE.items():
        names, _, values = visit_table(rows, quantity, without_doubt=True)
        own = [values[names.index(one)] for one in subjects if one in names]
        chosen = [np.nanmean(row) for row in own if np.isfinite(row).any()]
        if chosen:
            low, middle, high = (
                three_digits(value) for value in np.percentile(chosen, (0, 50, 100))
            )
            span = f" ({low} to {high})" if len(chosen) > 1 else ""
            count = str(len(chosen))
            body.append([with_unit(quantity), f"{middle}{span}", count, stated])
    head = ["", "median of the subjects (range)", "from", "simulated ankle of the paper (range)"]
    parts = [heading("Beside the paper"), table([head, *body])] if body else []
    own_rows = [row for row in rows if row.subject in subjects]
    left_out = left_out_sentence(own_rows, tuple(PAPER_ANKLE), whose)
    parts += [paragraph(left_out, "loss")] if body and left_out else []
    if body:
        parts.append(
            paragraph(
                "van 't Veld et al. 2018 state absolute values of their simulated ankle only; a "
                "subject is compared with their own earlier visits above. Correlations with EMG "
                "beside those of the paper's table III: 'ankle validate'."
            )
        )
    return parts


def _overview(rows: Sequence[Row], names: Sequence[str]) -> str:
    own = [row for row in rows if row.subject in names]
    runs = {(row.subject, row.visit, row.run) for row in own}
    visits = {(subject_of(row.subject), row.visit) for row in own}
    subjects = {subject_of(name) for name in names}
    legs = " Left and right leg of a subject are compared apart." * (len(names) > len(subjects))
    return f"{len(subjects)} subject(s), {len(visits)} visit(s), {len(runs)} recording(s).{legs}"


def _detectable(rows: Sequence[Row], quantity: str) -> dict[str, float]:
    """Return the minimal detectable change of each subject from their first to their last visit."""
    subjects, visits, values = visit_table(rows, quantity)
    sure = visit_table(rows, quantity, without_doubt=True)[2]
    return dict(zip(subjects, detectable_changes(visits, values, sure).tolist(), strict=True))


def _reliability_parts(rows: Sequence[Row], whose: str, about: Mapping[str, About]) -> list[str]:
    head = [
        "",
        "ICC(2,1)",
        "standard error of measurement",
        "ICC and error from",
        "minimal detectable change, first to last visit",
        "change from",
    ]
    body = []
    for quantity in SHOWN_QUANTITIES:
        names, visits, values = visit_table(rows, quantity, without_doubt=True)
        there = np.isfinite(values).any(axis=0) if len(visits) else np.zeros(0, dtype=bool)
        numbers, values = np.array(visits)[there], values[:, there]
        found = reliability(values)
        if found is not None:
            of_change = np.isfinite(values).sum(axis=1) > 1
            used = values[of_change]
            all_of_them = sum((scatter(numbers, row) for row in used), EMPTY_SCATTER)
            detectable = detectable_change(all_of_them, float(numbers[-1] - numbers[0]))
            whole = [name for name, row in zip(names, values, strict=True)
                     if np.isfinite(row).all()]  # fmt: skip
            changed = [name for name, of in zip(names, of_change, strict=True) if of]
            body.append([with_unit(quantity), *_reliability_cells(found),
                         _count(whole, f"{found.visits} visits"), three_digits(detectable),
                         _count(changed, f"{int(np.isfinite(used).sum())} values")])  # fmt: skip
    left_out = left_out_sentence(rows, SHOWN_QUANTITIES, whose)
    told = [paragraph(left_out, "loss")] if left_out else []
    if not body:
        few = (
            "How well measures repeat is not known: that takes a subject with at least two visits "
            "whose estimates are not doubtful."
        )
        return [paragraph(few), *told]
    return [
        heading("How well measures repeat"),
        table([head, *body]),
        *told,
        *_unlike_parts(rows, whose, about),
        paragraph(
            "An ankle that has not changed differs by more than the minimal detectable change in "
            "about 3 of 100 cases; that neighbouring visits resemble each other is allowed for. A "
            "subject is compared with the change that is detectable from the visits of the other "
            "subjects; where there are none, from their own earlier visits. Visits between which "
            "an ankle was trained make it too large: it then hides what the training did. For ICC "
            "and standard error only subjects with every visit count."
        ),
    ]


def _unlike_parts(rows: Sequence[Row], whose: str, about: Mapping[str, About]) -> list[str]:
    """Return which visits were not measured alike, though the table above takes them as equal."""
    unlike = []
    for name in sorted({row.subject for row in rows}):
        own = [row for row in rows if row.subject == name]
        visits = sorted({row.visit for row in own})
        if any(difference(own, visits[0], visit, about) for visit in visits[1:]):
            unlike.append(name)
    if not unlike:
        return []
    named = f": {'; '.join(unlike)}" if not whose else ""
    return [
        paragraph(
            f"Posture or knee angle differ between visits of {len(unlike)} subject(s){named}. What "
            "that does to the values counts here as if measures did not repeat.",
            "loss",
        )
    ]


def _reliability_cells(found: Reliability) -> list[str]:
    return [
        f"{found.icc:.2f}" if np.isfinite(found.icc) else "needs two subjects",
        three_digits(found.sem),
    ]


def _count(names: Sequence[str], of_each: str) -> str:
    """Return from whom a measure comes; legs are counted where both of a subject were measured."""
    subjects = {subject_of(name) for name in names}
    legs = f"{len(names)} legs of " if any(LEG_MARK in name for name in names) else ""
    return f"{legs}{len(subjects)} subject(s), {of_each}"
