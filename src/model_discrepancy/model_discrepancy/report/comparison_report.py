"""The result of ``compare`` as files: ``compare.json``, and a report as one HTML file."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from model_discrepancy.recording.recording import Recording
from model_discrepancy.report.page import html_list, html_table, image, write_page
from model_discrepancy.report.pictures import (
    BEFORE_S,
    after_movements,
    block_picture,
    cells_picture,
    dependence_picture,
    encoded,
    path_diagram,
    residual_picture,
    worst_stretch,
)
from model_discrepancy.tools.comparison import compare
from model_discrepancy.tools.comparison_result import (
    SIGNIFICANT,
    Comparison,
    Side,
    base_parameters,
)

_SIMULATED, _RECORDED, _DIFFERENCE = "#1f6fb4", "k", "#c8372d"
_LABEL = "recorded minus simulated"


def compare_bags(
    simulated: str | Path,
    recorded: str | Path,
    out: str | Path,
    progress: Callable[[str], None] = lambda _: None,
) -> Comparison:
    """Compare two bags and write ``compare.json`` and ``report.html``.

    Parameters
    ----------
    simulated, recorded
        Paths of the bags.
    out
        Folder to write to.
    progress
        Called with one line for each step.

    Raises
    ------
    BagError, DiagnosisError
        A bag that cannot be read.
    """
    progress("reading")
    result = compare(Recording.from_bag(simulated), Recording.from_bag(recorded), progress)
    progress("writing the report")
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    result.save(folder / "compare.json")
    write_comparison(result, folder / "report.html")
    return result


def write_comparison(result: Comparison, path: Path) -> None:
    """Write the report."""
    parts = [f"<h1>{escape(result.headline)}</h1>"]
    if result.sides is not None and result.where is not None:
        parts += _sections(result, result.sides)
    if result.reasons:
        parts += ["<h2>Remarks</h2>", html_list(result.reasons)]
    write_page(f"{result.names[0]} and {result.names[1]}", parts, path)


def _sections(result: Comparison, sides: tuple[Side, Side]) -> list[str]:
    assert result.where is not None
    parts = [
        f"<p>{escape(result.method[0].upper() + result.method[1:])}.</p>",
        "<h2>Torque, recorded and simulated</h2>",
        image(_torques(result, sides[1])),
        "<h2>The signal path</h2>",
        image(path_diagram({result.place} if result.place else set())),
        "<h2>What makes the difference</h2>",
        html_table(
            [
                "term",
                "place",
                "torque that changes [N.m rms]",
                "of the recorded torque [%]",
                "simulated, recorded (standard errors apart)",
                "significant",
            ],
            _terms(result),
        ),
        f"<p>{escape(SIGNIFICANT)}</p>",
    ]
    if result.block is not None:
        parts += [
            "<h2>What no term explains</h2>",
            f"<p>{escape(result.block.sentence)}</p>",
            image(block_picture(result.block)),
        ]
    parts += [
        "<h2>Where the difference sits</h2>",
        image(residual_picture(result.where, None, _LABEL)),
    ]
    if result.where.cells:
        parts.append(image(cells_picture(result.where, None, _LABEL)))
    parts += [
        image(dependence_picture(result.where)),
        "<h2>The base model fitted to each bag</h2>",
        html_table(
            ["parameter", "simulated", "recorded", "difference in standard errors"],
            _base_rows(sides),
        ),
        "<h2>Rig</h2>",
        html_table(["", "simulated", "recorded"], _rig_rows(sides)),
    ]
    if all(s.following is not None for s in sides):
        parts += [
            image(_following(sides)),
            html_list(result.actuator) if result.actuator else "<p>The actuators agree.</p>",
        ]
    else:
        parts.append("<p>Not both bags hold a reference: the actuators cannot be compared.</p>")
    return parts


def _torques(result: Comparison, recorded: Side) -> str:
    """Draw the mean recorded torque after movements, and what is left of it when the difference is
    taken off; of a continuous movement in time, where the difference is largest.
    """
    assert result.where is not None
    # The difference lies on the rows that both bags share.
    rate, torque = recorded.fitter.rows.rate, recorded.fitter.plain_target
    count = min(len(torque), len(result.difference))
    figure = Figure(figsize=(10, 3.4))

    def draw(axes: Axes, time: np.ndarray, segments: np.ndarray) -> None:
        mean, left = torque[segments].mean(axis=0), result.difference[segments].mean(axis=0)
        axes.plot(time, mean, color=_RECORDED, lw=2, label="recorded")
        axes.plot(time, mean - left, color=_SIMULATED, label="simulated")
        axes.plot(time, left, color=_DIFFERENCE, lw=1, label=_LABEL)
        axes.legend(fontsize=8)
        axes.set_ylabel("torque [N.m]")

    shown = after_movements(result.where.onsets, rate, count)
    for number, (word, segments) in enumerate(shown.items()):
        axes = figure.add_subplot(1, len(shown), number + 1)
        draw(axes, 1000.0 * ((segments[0] - segments[0, 0]) / rate - BEFORE_S), segments)
        axes.set_title(f"after {word} ({len(segments)} movements)", fontsize=10)
        axes.set_xlabel("time after onset [ms]")
    if not shown:
        stretch = worst_stretch(result.difference[:count], rate)
        axes = figure.add_subplot()
        draw(axes, stretch / rate, stretch[None, :])
        axes.set_title("where the difference is largest", fontsize=10)
        axes.set_xlabel("time into the recording [s]")
    figure.tight_layout()
    return encoded(figure)


def _terms(result: Comparison) -> list[list[str]]:
    rows = []
    for c in result.contributions:
        values = "; ".join(
            f"{key}: {a:.4g}, {b:.4g} ({z:+.1f})" for key, (a, b, z) in c.parameters.items()
        ).replace("nan", "-")
        name = c.name.replace("_", " ") + (f" ({c.only} only)" if c.only else "")
        rows.append([name, c.place, f"{c.torque:.3f}", f"{100 * c.share:.1f}", values, c.verdict])
    return rows


def _base_rows(sides: tuple[Side, Side]) -> list[list[str]]:
    rows = []
    for key, ((a, a_error), (b, b_error)) in base_parameters(sides).items():
        apart = (b - a) / np.hypot(a_error, b_error)
        rows.append(
            [
                key,
                f"{a:.4g} ± {a_error:.2g}",
                f"{b:.4g} ± {b_error:.2g}",
                f"{apart:+.1f}" if np.isfinite(apart) else "at a bound",
            ]
        )
    return rows


def _rig_rows(sides: tuple[Side, Side]) -> list[list[str]]:
    rows = [
        ["sampling rate [Hz]", *(f"{s.recording.rate:g}" for s in sides)],
        ["length [s]", *(f"{s.recording.duration:.1f}" for s in sides)],
    ]
    for key in dict.fromkeys(key for s in sides for key in s.noise):
        quantity, unit = key.rstrip("]").split("[")
        rows.append(
            [
                f"noise of {quantity} [{unit} rms]",
                *(f"{s.noise[key]:.2g}" if key in s.noise else "not recorded" for s in sides),
            ]
        )
    for label, attribute, factor in (
        ("actuator: gain of held positions", "slow_gain", 1.0),
        ("actuator: bandwidth [Hz]", "bandwidth", 1.0),
        ("actuator: delay [ms]", "delay", 1000.0),
    ):
        values = [None if s.following is None else getattr(s.following, attribute) for s in sides]
        rows.append(
            [
                label,
                *("not known" if value is None else f"{factor * value:.3g}" for value in values),
            ]
        )
    return rows


def _following(sides: tuple[Side, Side]) -> str:
    """Draw gain and phase from reference to position."""
    figure = Figure(figsize=(10, 2.8))
    left, right = figure.subplots(1, 2)
    for side, color, label in zip(
        sides, (_SIMULATED, _RECORDED), ("simulated", "recorded"), strict=True
    ):
        if side.following is not None:
            left.loglog(side.following.frequency, side.following.gain, color=color, label=label)
            right.semilogx(side.following.frequency, np.degrees(side.following.phase), color=color)
    left.set_ylabel("gain from reference to position")
    right.set_ylabel("phase [deg]")
    for axes in (left, right):
        axes.set_xlabel("frequency [Hz]")
    left.legend(fontsize=8)
    figure.tight_layout()
    return encoded(figure)
