"""The part of a study's report about one subject: what was measured, values, changes, trends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ankle_interfaces.value_text import three_digits, with_error, with_unit
from session_analysis.colours import COLOURS
from session_analysis.html_page import (
    bullets,
    figure,
    heading,
    linked_bullets,
    paragraph,
    table,
)
from session_analysis.study.conditions import EMPTY_ABOUT, About, condition_rows, difference
from session_analysis.study.recording_results import Row
from session_analysis.study.visit_values import (
    is_doubtful,
    name_and_unit,
    recording_of,
    visit_table,
)

SHOWN_QUANTITIES = ("K[N.m/rad]", "G[N.m.s/rad]", "B[N.m.s/rad]", "I[kg.m^2]")
QUALITY = ("valid[%]", "missing_samples[1]", "held_out_vaf[%]", "mean_torque[N.m]")
EFFECT = "effect:"
"""Begins the quantity of a row that holds how probable an effect is."""
NORMAL_95 = 1.96
"""Standard errors that 19 of 20 differences of normal errors stay within."""
MIN_PAIRS = 4
"""Least number of recordings from which a relation with the mean torque is drawn; fewer lie on a
line by themselves."""


def subject_parts(
    rows: Sequence[Row],
    subject: str,
    detectable: Mapping[str, float],
    about: Mapping[str, About],
) -> list[str]:
    """Return the pieces of HTML about one subject, or about one leg of a subject.

    Parameters
    ----------
    rows
        Of this subject.
    subject
        The heading; tells the leg where both were measured.
    detectable
        Minimal detectable change of each quantity whose change is stated; NaN where not known.
    about
        What is known about each recording.
    """
    parts = [heading(f"Subject {subject}")]
    for found in (value_rows(rows), quality_rows(rows), relative_rows(rows)):
        if found:
            parts.append(table(found))
    parts += [bullets(_changes(rows, detectable, about), nothing="One visit: no change to state.")]
    stated = condition_rows(rows, about)
    parts += [paragraph("What was measured:"), table(stated)] if stated else []
    findings = _findings(rows, about)
    parts += [paragraph("Diagnosis and pages:"), linked_bullets(findings)] if findings else []
    assumed = _assumed(rows, about)
    parts += [paragraph("Not stated of an imported file:"), bullets(assumed, "loss")] * bool(
        assumed
    )
    if len({row.visit for row in rows}) > 1:
        parts.append(figure(_trend(rows, detectable)))
    by_torque = _torque_figure(rows)
    if by_torque is not None:
        parts += [paragraph("K and G against the mean torque of each recording:")]
        parts.append(figure(by_torque))
    return parts


def value_rows(rows: Sequence[Row]) -> list[list[str]]:
    """Return the values of each recording, how much of it is doubtful first; the first row names
    the columns.
    """
    shown = [one for one in SHOWN_QUANTITIES if any(row.quantity == one for row in rows)]
    out = [["visit, run", "doubtful", *map(with_unit, shown)]]
    for key, own in _by_recording(rows):
        doubt = own["K[N.m/rad]"].doubt if "K[N.m/rad]" in own else float("nan")
        share = f"{100 * doubt:.0f} %" if np.isfinite(doubt) else ""
        out.append([key, share, *(_text(own.get(quantity)) for quantity in shown)])
    return out


def quality_rows(rows: Sequence[Row]) -> list[list[str]]:
    """Return what the values of each recording rest on; the first row names the columns."""
    return _table(rows, [one for one in QUALITY if any(row.quantity == one for row in rows)])


def relative_rows(rows: Sequence[Row]) -> list[list[str]]:
    """Return values by the largest torque and by body mass; the first row names the columns."""
    quantities = sorted({row.quantity for row in rows if "_of_mvc" in row.quantity})
    quantities += sorted({row.quantity for row in rows if "_by_mass" in row.quantity})
    return _table(rows, quantities)


def _table(rows: Sequence[Row], quantities: Sequence[str]) -> list[list[str]]:
    if not quantities:
        return []
    out = [["visit, run", *map(with_unit, quantities)]]
    for key, own in _by_recording(rows):
        out.append([key, *(_text(own.get(quantity)) for quantity in quantities)])
    return out


def _by_recording(rows: Sequence[Row]) -> list[tuple[str, dict[str, Row]]]:
    """Return visit and run as text, and the rows by quantity, of each recording."""
    return [
        (
            f"{visit}, {run}",
            {row.quantity: row for row in rows if (row.visit, row.run) == (visit, run)},
        )
        for visit, run in sorted({(row.visit, row.run) for row in rows})
    ]


def _findings(
    rows: Sequence[Row], about: Mapping[str, About]
) -> list[tuple[str, Sequence[tuple[str, str]]]]:
    """Return verdict, named effects and pages of each recording that has one of them."""
    out = []
    for key, own in _by_recording(rows):
        known = about.get(recording_of(next(iter(own.values()))), EMPTY_ABOUT)
        effects = [
            f"{name.removeprefix(EFFECT).partition('[')[0].replace('_', ' ')} "
            f"(probability {row.value:.2f})"
            for name, row in own.items()
            if name.startswith(EFFECT)
        ]
        vaf = own.get("diagnosis_augmented_vaf_holdout[%]")
        said = [known.verdict, "; ".join(effects)]
        if vaf is not None:
            said.append(f"the whole model predicts {three_digits(vaf.value)} % of new torque")
        words = ". ".join(one for one in said if one)
        if words or known.reports:
            out.append((f"Visit and run {key}: {words or 'no diagnosis'}.", known.reports))
    return out


def _assumed(rows: Sequence[Row], about: Mapping[str, About]) -> list[str]:
    return [
        f"visit and run {key}: assumed: {sentence}"
        for key, own in _by_recording(rows)
        for sentence in about.get(recording_of(next(iter(own.values()))), EMPTY_ABOUT).assumed
    ]


def _text(row: Row | None) -> str:
    return "-" if row is None else with_error((row.value, row.error))


def _changes(
    rows: Sequence[Row], detectable: Mapping[str, float], about: Mapping[str, About]
) -> list[str]:
    """Return the last visit against the first one.

    A change counts where it is beyond the minimal detectable one and beyond what the errors of both
    estimates explain; where the estimates are doubtful, or the visits were not measured alike, the
    sentence says so.
    """
    sentences = []
    for quantity, least in detectable.items():
        _, visits, values = visit_table(rows, quantity)
        if len(visits) < 2:
            continue
        name, unit = name_and_unit(quantity)
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
        if any(map(is_doubtful, ends)):
            sentence += "; the estimates are doubtful"
        differs = difference(rows, visits[0], visits[-1], about)
        if differs:
            sentence += f". The two visits are not alike, which may be the reason: {differs}"
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


def _trend(rows: Sequence[Row], detectable: Mapping[str, float]) -> Any:
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
