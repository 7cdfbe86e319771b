"""The report of one recording's estimates: a page, a table, a picture."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from ankle_interfaces.value_text import with_error, with_unit
from impedance_estimator.estimator import ESTIMATE_COLUMNS, TORQUE_COLUMNS
from impedance_estimator.simultaneous.doubt import DOUBT_THRESHOLD
from session_analysis.colours import COLOURS
from session_analysis.estimate_answer import QUANTITIES, Answer
from session_analysis.html_page import (
    bullets,
    figure,
    heading,
    page,
    paragraph,
    table,
)

MAX_POINTS = 4000
"""Largest number of points of a line on the page; more are averaged in groups, which no screen
shows."""
MAX_TORQUE_POINTS = 40_000
"""Largest number of points of the torque that are kept, so that a single response can be looked at.
"""
MAX_SPANS = 200
"""Largest number of shaded times; shorter ones than the two hundred longest would be thinner than a
pixel."""
INVALID_COLOUR, DOUBTFUL_COLOUR = "#888888", "#e69f00"
"""Shades of times without a valid estimate, and with a doubtful one."""
FREQUENCY_TICKS = (0.5, 1, 2, 5, 10, 20, 50)
"""[Hz] Marks of the frequency, which have room beside one another on a phone."""
INTERVAL = 1.96
"""Half width of a 95 % interval in standard errors."""
DOUBTS = (
    "Doubtful means: the torque shows more than inertia, viscosity, stiffness and one reflex can "
    "explain, so K and G may be off by more than their errors say. 'ankle diagnose' looks for what "
    "is missing."
)
BASE_VALUES = (
    "These are the values that the online estimator tracks, as medians over the recording. 'ankle "
    "diagnose' fits one model to the whole recording and states K and G at its mean position and "
    "torque, without what has memory; the two differ where the joint changed during the recording "
    "or has physics that the estimator's model lacks."
)


def write_estimates(found: Answer, folder: Path) -> Path:
    """Write ``report.html``, ``estimates.csv`` and ``estimates.png``.

    Parameters
    ----------
    found
        The estimates to show.
    folder
        An existing folder.

    Returns
    -------
    Path
        The page.
    """
    with (folder / "estimates.csv").open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(ESTIMATE_COLUMNS)
        writer.writerows([[f"{value:.9g}" for value in row] for row in found.rows])
    _picture(found, folder / "estimates.png")
    path = folder / "report.html"
    path.write_text(page(f"Joint impedance of {found.bag.name}", _parts(found)), encoding="utf-8")
    return path


def value_rows(found: Answer) -> list[list[str]]:
    """Return median, error and second opinion of each quantity, as text.

    The first row names the columns.
    """
    rows = [["", "median ± standard error", "second opinion"]]
    for quantity in QUANTITIES:
        name = quantity.partition("[")[0]
        offline = None if found.opinion is None else {"K": found.opinion.K, "G": found.opinion.G}
        other = "" if offline is None or name not in offline else with_error(offline[name])
        rows.append([with_unit(quantity), with_error(found.median(quantity)), other])
    return rows


def _parts(found: Answer) -> list[str]:
    valid, doubtful = found.valid, found.doubtful
    share = f"{valid.sum()} of {len(valid)} estimates are valid"
    if "doubt[1]" in ESTIMATE_COLUMNS:
        share += f", {doubtful.sum()} of them doubtful (doubt of {DOUBT_THRESHOLD:g} and more)"
    parts = [
        paragraph(f"{share}. Estimator: {found.algorithm}.", "answer"),
        *(paragraph(f"In doubt: {sentence}.", "loss") for sentence in found.saturated),
        table(value_rows(found)),
        paragraph(BASE_VALUES),
        *_reasons(found),
        heading("What the recording lacks"),
        bullets(found.losses.sentences(), "loss", "Nothing is missing."),
        heading("K, B, I and G over time"),
        figure(_quantities(found)),
        paragraph(
            "Bands are 95 % intervals. Grey: the estimate is not valid. Orange: it is doubtful."
        ),
    ]
    if len(found.torques):
        parts += [heading("Prediction against measurement"), figure(_torque(found))]
        parts.append(
            paragraph(
                "Move the window below the curves to see other times; click a name to show or hide "
                "its curve."
            )
        )
    parts += [heading("Second opinion")]
    if found.opinion is None:
        parts.append(paragraph(f"None: {found.no_opinion}"))
    else:
        parts += _opinion(found)
    parts += [
        heading("Remarks"),
        bullets(found.notes),
        paragraph(f"Settings: {found.settings.partition('(')[2].rstrip(')') or found.settings}"),
    ]
    return parts


def _reasons(found: Answer) -> list[str]:
    """Return why estimates are doubtful or not valid, in the words of ``/diagnostics``."""
    parts = []
    if found.doubtful.any():
        parts += [
            paragraph(DOUBTS, "loss"),
            heading("Why estimates are doubtful"),
            bullets([str(share) for share in found.doubts], nothing="For moments only."),
        ]
    if found.not_valid:
        parts += [
            heading("Why estimates are not valid"),
            bullets([str(share) for share in found.not_valid]),
        ]
    return parts


def _opinion(found: Answer) -> list[str]:
    opinion = found.opinion
    assert opinion is not None
    head = ["", "K [N·m/rad]", "G [N·m·s/rad]", "cascade's K", "cascade's G"]
    rows = [[*head, "its VAF of the other half [%]"]]
    for half, (name, K, G, vaf) in enumerate(
        zip(
            ("first half", "second half"),
            opinion.halves_K,
            opinion.halves_G,
            reversed(opinion.held_out_vaf),
            strict=True,
        )
    ):
        own = [with_error(found.median(q, half)) for q in ("K[N.m/rad]", "G[N.m.s/rad]")]
        rows.append([name, *own, with_error(K), with_error(G), f"{vaf:.1f}"])
    own = [with_error(found.median(quantity)) for quantity in ("K[N.m/rad]", "G[N.m.s/rad]")]
    rows.append(["whole recording", *own, with_error(opinion.K), with_error(opinion.G), ""])
    how = (
        "The reference is the instrument: torque that moves a compliant servo does not enter."
        if opinion.response.instrument
        else "No reference was recorded: torque that moves a compliant servo enters the response."
    )
    return [
        paragraph(
            "The second opinion is the parallel cascade, which assumes no inertia, viscosity and "
            "stiffness but two free responses. It is fitted to the whole recording and to each "
            "half; errors are from the scatter of stretches of 6 to 10 s. "
            "Its reflex response lasts 0.4 s and can stand in for a part of the stiffness: of an "
            "ankle without reflexes it says K up to 10 % too low and G up to 3 N·m·s/rad. Its "
            "prediction of the other half is what a linear joint with one reflex can explain."
        ),
        table(rows),
        heading("From position to torque"),
        figure(_frequency(found)),
        paragraph(
            "Gain and phase say how large the torque is and how far ahead of the position, by "
            "frequency. Coherence is the share of the torque that follows the motion: 1 is all of "
            f"it, and where it is low, gain and phase say little. {how}"
        ),
    ]


def _spans(time: np.ndarray, wanted: np.ndarray) -> list[tuple[float, float]]:
    """Return times in which `wanted` holds, as (start, end); the longest `MAX_SPANS` of them."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], wanted.astype(int), [0]])))
    last = len(time) - 1
    spans = sorted(edges.reshape(-1, 2).tolist(), key=lambda span: span[0] - span[1])
    return [(float(time[start]), float(time[min(stop, last)])) for start, stop in spans[:MAX_SPANS]]


def _thinned(columns: Sequence[np.ndarray], most: int) -> list[np.ndarray]:
    """Return means of groups of equal size, so that at most `most` points are left."""
    size = max(1, -(-len(columns[0]) // most))
    if size == 1:
        return list(columns)
    count = len(columns[0]) // size * size
    return [column[:count].reshape(-1, size).mean(axis=1) for column in columns]


def _quantities(found: Answer) -> Any:
    from plotly.graph_objects import Scatter
    from plotly.subplots import make_subplots

    names = [*QUANTITIES, "vaf_total[%]"]
    drawn = make_subplots(rows=len(names), shared_xaxes=True, vertical_spacing=0.02)
    time = found.column("t[s]") - found.losses.origin
    for row, name in enumerate(names, 1):
        value = np.where(found.valid, found.column(name), np.nan)
        colour = COLOURS[row - 1]
        if name in QUANTITIES:
            error = INTERVAL * found.column(f"se_{name}")
            t, low, high = _thinned([time, value - error, value + error], MAX_POINTS)
            band = {"mode": "lines", "line": {"width": 0}, "hoverinfo": "skip", "showlegend": False}
            drawn.add_trace(Scatter(x=t, y=high, **band), row, 1)
            drawn.add_trace(
                Scatter(x=t, y=low, fill="tonexty", fillcolor=_pale(colour), **band), row, 1
            )
        t, shown = _thinned([time, value], MAX_POINTS)
        line = Scatter(x=t, y=shown, mode="lines", line={"color": colour}, showlegend=False)
        line.name = name
        drawn.add_trace(line, row, 1)
        shown_name = "VAF [%]" if name not in QUANTITIES else with_unit(name)
        drawn.update_yaxes(title_text=shown_name.replace(" [", "<br>["), row=row, col=1)
    for wanted, colour in ((~found.valid, INVALID_COLOUR), (found.doubtful, DOUBTFUL_COLOUR)):
        for start, end in _spans(time, wanted):
            drawn.add_vrect(start, end, fillcolor=colour, opacity=0.25, line_width=0)
    drawn.update_xaxes(title_text="time in the recording [s]", row=len(names), col=1)
    drawn.update_layout(height=170 * len(names))
    return drawn


def _pale(colour: str) -> str:
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return f"rgba({red},{green},{blue},0.25)"


def _torque(found: Answer) -> Any:
    from plotly.graph_objects import Figure as Drawing
    from plotly.graph_objects import Scatter

    time = found.torques[:, 0] - found.losses.origin
    measured, intrinsic, reflex = (
        found.torques[:, TORQUE_COLUMNS.index(name)]
        for name in ("torque[N.m]", "intrinsic_torque[N.m]", "reflex_torque[N.m]")
    )
    drawn = Drawing()
    for name, values, colour in (
        ("measured", measured, "#444444"),
        ("predicted", intrinsic + reflex, COLOURS[1]),
        ("intrinsic part", intrinsic, COLOURS[0]),
        ("reflex part", reflex, COLOURS[2]),
    ):
        t, shown = _thinned([time, values], MAX_TORQUE_POINTS)
        drawn.add_trace(
            Scatter(x=t, y=shown.astype("float32"), name=name, mode="lines",
                    line={"width": 1.2, "color": colour},
                    visible=True if name in ("measured", "predicted") else "legendonly")
        )  # fmt: skip
    middle = float(np.median(time))
    drawn.update_xaxes(
        title_text="time in the recording [s]",
        range=[middle, middle + 5.0],
        rangeslider_visible=True,
    )
    drawn.update_yaxes(title_text="torque [N·m],<br>filtered as the estimator sees it")
    drawn.update_layout(height=480)
    return drawn


def _frequency(found: Answer) -> Any:
    from plotly.graph_objects import Scatter
    from plotly.subplots import make_subplots

    assert found.opinion is not None
    response = found.opinion.response
    drawn = make_subplots(rows=3, shared_xaxes=True, vertical_spacing=0.03)
    for row, part in ((1, np.abs), (2, _phase)):
        for name, values, colour in (
            ("measured", response.measured, "#444444"),
            ("fitted", response.model, COLOURS[1]),
        ):
            trace = Scatter(x=response.frequency, y=part(values), name=name, mode="lines")
            trace.line = {"color": colour}
            trace.showlegend = row == 1
            drawn.add_trace(trace, row, 1)
    coherence = Scatter(x=response.frequency, y=response.coherence, mode="lines", showlegend=False)
    coherence.line = {"color": COLOURS[0]}
    drawn.add_trace(coherence, 3, 1)
    for row, label in enumerate(("gain [N·m/rad]", "phase [deg]", "coherence"), 1):
        drawn.update_yaxes(title_text=label, row=row, col=1)
    drawn.update_yaxes(type="log", dtick=1, row=1, col=1)
    drawn.update_yaxes(range=[0, 1.02], row=3, col=1)
    drawn.update_xaxes(type="log", tickvals=FREQUENCY_TICKS)
    drawn.update_xaxes(title_text="frequency [Hz]", row=3, col=1)
    drawn.update_layout(height=640)
    return drawn


def _phase(response: np.ndarray) -> np.ndarray:
    """Return the phase [deg] from -120 to 240: an ankle's goes from 0, of its stiffness, to 180, of
    its inertia, and a jump in between would be one of the noise.
    """
    return (np.degrees(np.angle(response)) + 120.0) % 360.0 - 120.0


def _picture(found: Answer, path: Path) -> None:
    drawn = Figure(figsize=(9.0, 8.0), layout="constrained")
    axes = drawn.subplots(len(QUANTITIES), 1, sharex=True)
    time = found.column("t[s]") - found.losses.origin
    for axis, name, colour in zip(axes, QUANTITIES, COLOURS, strict=False):
        value = np.where(found.valid, found.column(name), np.nan)
        error = INTERVAL * found.column(f"se_{name}")
        t, shown, low, high = _thinned([time, value, value - error, value + error], MAX_POINTS)
        axis.fill_between(t, low, high, color=colour, alpha=0.25, lw=0)
        axis.plot(t, shown, color=colour, lw=1.2)
        for wanted, shade in ((~found.valid, INVALID_COLOUR), (found.doubtful, DOUBTFUL_COLOUR)):
            for start, end in _spans(time, wanted):
                axis.axvspan(start, end, color=shade, alpha=0.2, lw=0)
        axis.set_ylabel(with_unit(name).replace(" [", "\n["))
    axes[-1].set_xlabel("time in the recording [s]")
    axes[0].set_title(f"Joint impedance of {found.bag.name}")
    patches = [
        Patch(color=colour, alpha=0.3, label=label)
        for colour, label, shown in (
            (COLOURS[0], "95 % interval", True),
            (INVALID_COLOUR, "not valid", not found.valid.all()),
            (DOUBTFUL_COLOUR, "doubtful", found.doubtful.any()),
        )
        if shown
    ]
    drawn.legend(handles=patches, loc="outside lower center", ncols=len(patches), frameon=False)
    drawn.savefig(path, dpi=110)
