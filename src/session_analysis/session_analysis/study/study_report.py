"""The report of a study: each subject against their own earlier visits, and how well measures
repeat.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from session_analysis.html_page import (
    COLOURS,
    bullets,
    figure,
    heading,
    page,
    paragraph,
    table,
)
from session_analysis.study.detectable_change import (
    EMPTY_SCATTER,
    detectable_change,
    detectable_changes,
    scatter,
)
from session_analysis.study.recording_results import Row
from session_analysis.study.reliability import Reliability, reliability
from session_analysis.values import three_digits, with_error, with_unit

SHOWN_QUANTITIES = ("K[N.m/rad]", "G[N.m.s/rad]", "B[N.m.s/rad]", "I[kg.m^2]")
QUALITY = ("valid[%]", "missing_samples[1]", "held_out_vaf[%]", "mean_torque[N.m]")
PAPER_ANKLE = {
    "K[N.m/rad]": "100 (0 to 200)",
    "G[N.m.s/rad]": "10 (0 to 20)",
    "B[N.m.s/rad]": "0.63",
    "I[kg.m^2]": "0.0137",
}
"""The ankle of the simulations of van 't Veld et al. 2018, section II-D, and the ranges that its
random ankles were drawn from. Absolute values of its subjects are not stated there."""
NORMAL_95 = 1.96
"""Standard errors that 19 of 20 differences of normal errors stay within."""
DOUBTFUL_SHARE = 0.5
"""Share of doubtful estimates from which the values of a visit are called doubtful."""
MIN_PAIRS = 4
"""Least number of recordings from which a relation with the mean torque is drawn; fewer lie on a
line by themselves."""


def visit_table(rows: Sequence[Row], quantity: str) -> tuple[list[str], list[int], np.ndarray]:
    """Return the means over the runs of each visit.

    Returns
    -------
    tuple[list[str], list[int], np.ndarray]
        Subjects, visits, and values of shape (subjects, visits), NaN where there is none.
    """
    chosen = [row for row in rows if row.quantity == quantity and np.isfinite(row.value)]
    subjects = sorted({row.subject for row in chosen})
    visits = sorted({row.visit for row in chosen})
    values = np.full((len(subjects), len(visits)), np.nan)
    for i, subject in enumerate(subjects):
        for k, visit in enumerate(visits):
            own = [row.value for row in chosen if (row.subject, row.visit) == (subject, visit)]
            if own:
                values[i, k] = float(np.mean(own))
    return subjects, visits, values


def write_study_report(
    rows: Sequence[Row], failures: dict[str, str], path: Path, title: str, subject: str = ""
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
        Only this subject's part; the reliability is that of the whole study.
    """
    subjects = [subject] if subject else sorted({row.subject for row in rows})
    parts = [paragraph(_overview(rows, subjects), "answer"), *_reliability_parts(rows)]
    detectable = {quantity: _detectable(rows, quantity) for quantity in SHOWN_QUANTITIES[:2]}
    for one in subjects:
        own = {quantity: found.get(one, np.nan) for quantity, found in detectable.items()}
        parts += _subject_parts([row for row in rows if row.subject == one], one, own)
    parts += _paper_parts(rows, subjects)
    parts += [
        heading("Recordings without a result"),
        bullets([f"{name}: {why}" for name, why in failures.items()], "loss", "None."),
    ]
    path.write_text(page(title, parts), encoding="utf-8")
    return path


def _paper_parts(rows: Sequence[Row], subjects: Sequence[str]) -> list[str]:
    """Return the values of the subjects beside those of the paper, apart from their own visits."""
    body = []
    for quantity, stated in PAPER_ANKLE.items():
        names, _, values = visit_table(rows, quantity)
        chosen = [np.nanmean(values[names.index(one)]) for one in subjects if one in names]
        if chosen:
            low, middle, high = (
                three_digits(value) for value in np.percentile(chosen, (0, 50, 100))
            )
            span = f" ({low} to {high})" if len(chosen) > 1 else ""
            body.append([with_unit(quantity), f"{middle}{span}", stated])
    if not body:
        return []
    head = ["", "median of the subjects (range)", "simulated ankle of the paper (range)"]
    return [
        heading("Beside the paper"),
        table([head, *body]),
        paragraph(
            "van 't Veld et al. 2018 state absolute values of their simulated ankle only; a "
            "subject is compared with their own earlier visits above. Correlations with EMG beside "
            "those of the paper's table III: 'ankle validate'."
        ),
    ]


def _overview(rows: Sequence[Row], subjects: Sequence[str]) -> str:
    own = [row for row in rows if row.subject in subjects]
    runs = {(row.subject, row.visit, row.run) for row in own}
    visits = {(row.subject, row.visit) for row in own}
    return f"{len(subjects)} subject(s), {len(visits)} visit(s), {len(runs)} recording(s)."


def _detectable(rows: Sequence[Row], quantity: str) -> dict[str, float]:
    """Return the minimal detectable change of each subject from their first to their last visit."""
    subjects, visits, values = visit_table(rows, quantity)
    return dict(zip(subjects, detectable_changes(visits, values).tolist(), strict=True))


def _reliability_parts(rows: Sequence[Row]) -> list[str]:
    head = [
        "",
        "ICC(2,1)",
        "standard error of measurement",
        "minimal detectable change, first to last visit",
        "from",
    ]
    body = []
    for quantity in SHOWN_QUANTITIES:
        _, visits, values = visit_table(rows, quantity)
        found = reliability(values)
        if found is not None:
            all_of_them = sum((scatter(np.array(visits), row) for row in values), EMPTY_SCATTER)
            detectable = detectable_change(all_of_them, visits[-1] - visits[0])
            body.append([with_unit(quantity), *_reliability_cells(found, detectable)])
    if not body:
        return [paragraph("Fewer than two visits: nothing is known of how well measures repeat.")]
    return [
        heading("How well measures repeat"),
        table([head, *body]),
        paragraph(
            "An ankle that has not changed differs by more than the minimal detectable change in "
            "about 3 of 100 cases; that neighbouring visits resemble each other is allowed for. A "
            "subject is compared with the change that is detectable from the visits of the other "
            "subjects; where there are none, from their own earlier visits. Visits between which "
            "an ankle was trained make it too large: it then hides what the training did. For ICC "
            "and standard error only subjects with every visit count."
        ),
    ]


def _reliability_cells(found: Reliability, detectable: float) -> list[str]:
    return [
        f"{found.icc:.2f}" if np.isfinite(found.icc) else "needs two subjects",
        f"{found.sem:.3g}",
        f"{detectable:.3g}",
        f"{found.subjects} subject(s), {found.visits} visits",
    ]


def _subject_parts(rows: Sequence[Row], subject: str, detectable: dict[str, float]) -> list[str]:
    parts = [heading(f"Subject {subject}"), table(_visit_rows(rows))]
    parts += [bullets(_changes(rows, detectable), nothing="One visit: no change to state.")]
    if len({row.visit for row in rows}) > 1:
        parts.append(figure(_trend(rows, detectable)))
    by_torque = _torque_figure(rows)
    if by_torque is not None:
        parts += [paragraph("K and G against the mean torque of each recording:")]
        parts.append(figure(by_torque))
    return parts


def _visit_rows(rows: Sequence[Row]) -> list[list[str]]:
    quantities = [
        q for q in (*SHOWN_QUANTITIES, *QUALITY) if any(row.quantity == q for row in rows)
    ]
    quantities += sorted({row.quantity for row in rows if "_of_mvc" in row.quantity})
    quantities += sorted({row.quantity for row in rows if "_by_mass" in row.quantity})
    out = [["visit, run", *map(with_unit, quantities), "doubtful"]]
    for visit, run in sorted({(row.visit, row.run) for row in rows}):
        own = {row.quantity: row for row in rows if (row.visit, row.run) == (visit, run)}
        doubt = own["K[N.m/rad]"].doubt if "K[N.m/rad]" in own else float("nan")
        out.append(
            [
                f"{visit}, {run}",
                *(_text(own.get(quantity)) for quantity in quantities),
                f"{100 * doubt:.0f} %" if np.isfinite(doubt) else "",
            ]
        )
    return out


def _text(row: Row | None) -> str:
    return "-" if row is None else with_error((row.value, row.error))


def _changes(rows: Sequence[Row], detectable: dict[str, float]) -> list[str]:
    """Return the last visit against the first one.

    A change counts where it is beyond the minimal detectable one and beyond what the errors of both
    estimates explain; where the estimates are doubtful, the sentence says so.
    """
    sentences = []
    for quantity, least in detectable.items():
        _, visits, values = visit_table(rows, quantity)
        if len(visits) < 2:
            continue
        name, unit = with_unit(quantity).rstrip("]").split(" [")
        change = float(values[0, -1] - values[0, 0])
        ends = [
            row for row in rows if row.quantity == quantity and row.visit in (visits[0], visits[-1])
        ]
        explained = NORMAL_95 * _error_of_change(ends)
        sentence = (
            f"{name} changed by {change:+.3g} {unit} from visit {visits[0]} to visit {visits[-1]}, "
        )
        if np.isnan(least):
            sentence += (
                "and what change is detectable is not known: there is no other subject with two "
                "visits, and no third visit"
            )
        else:
            beyond = "more" if abs(change) > least else "not more"
            sentence += f"{beyond} than the minimal detectable change of {least:.3g} {unit}"
        if least < abs(change) <= explained:
            sentence += f", but not more than their errors explain ({explained:.3g} {unit})"
        if any(row.doubt >= DOUBTFUL_SHARE for row in ends):
            sentence += "; the estimates are doubtful"
        sentences.append(sentence)
    return sentences


def _error_of_change(rows: Sequence[Row]) -> float:
    """Return the standard error of the difference of two visits' means; errors that are not known
    count as none.
    """
    variance = 0.0
    for visit in {row.visit for row in rows}:
        own = np.array([row.error for row in rows if row.visit == visit])
        variance += float(np.nansum(own**2)) / len(own) ** 2
    return float(np.sqrt(variance))


def _trend(rows: Sequence[Row], detectable: dict[str, float]) -> Any:
    from plotly.graph_objects import Scatter
    from plotly.subplots import make_subplots

    drawn = make_subplots(rows=2, shared_xaxes=True, vertical_spacing=0.05)
    for line, (quantity, least) in enumerate(detectable.items(), 1):
        _, visits, values = visit_table(rows, quantity)
        if not visits:
            continue
        trace = Scatter(x=visits, y=values[0], mode="lines+markers", showlegend=False)
        trace.line = {"color": COLOURS[line - 1]}
        drawn.add_trace(trace, line, 1)
        if np.isfinite(least):
            low, high = (float(values[0, 0]) + sign * least for sign in (-1, 1))
            # After the trace: nothing is drawn into a panel that is still empty.
            drawn.add_hrect(
                low, high, row=line, col=1, fillcolor="#888888", opacity=0.2, line_width=0
            )
            drawn.update_yaxes(range=_range_with(values[0], low, high), row=line, col=1)
        drawn.update_yaxes(title_text=with_unit(quantity), row=line, col=1)
    drawn.update_xaxes(tick0=1, dtick=max(1, -(-len({row.visit for row in rows}) // 20)))
    drawn.update_xaxes(title_text="visit; grey: within the detectable change", row=2, col=1)
    drawn.update_layout(height=480)
    return drawn


def _range_with(values: np.ndarray, low: float, high: float) -> list[float]:
    """Return the ends of an axis that shows values and band with a margin."""
    low, high = min(low, float(np.nanmin(values))), max(high, float(np.nanmax(values)))
    margin = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
    return [low - margin, high + margin]


def _torque_figure(rows: Sequence[Row]) -> Any:
    """Return K and G over the mean torque; None with too few recordings or without a range of
    torque.
    """
    from plotly.graph_objects import Scatter
    from plotly.subplots import make_subplots

    at = {(row.visit, row.run): row.value for row in rows if row.quantity == "mean_torque[N.m]"}
    if len(at) < MIN_PAIRS or np.ptp(list(at.values())) == 0:
        return None
    drawn = make_subplots(cols=2)
    for column, quantity in enumerate(SHOWN_QUANTITIES[:2], 1):
        own = [row for row in rows if row.quantity == quantity and (row.visit, row.run) in at]
        trace = Scatter(
            x=[at[row.visit, row.run] for row in own],
            y=[row.value for row in own],
            mode="markers",
            showlegend=False,
        )
        trace.marker = {"color": COLOURS[column - 1]}
        drawn.add_trace(trace, 1, column)
        drawn.update_yaxes(title_text=with_unit(quantity), row=1, col=column)
        drawn.update_xaxes(title_text="mean torque [N·m]", row=1, col=column)
    return drawn
