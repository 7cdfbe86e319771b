"""Pictures of a diagnosis, each as a PNG in base64 for a report that is one file."""

from __future__ import annotations

import base64
import io

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ankle_physics.joint_profile import joint_in_force
from model_discrepancy.criticism.locate import Cell, ResidualMap
from model_discrepancy.criticism.missing_block import MissingBlock
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.held_out import HeldOut
from model_discrepancy.fit.movements import Onsets
from model_discrepancy.recording.recording import Recording
from model_discrepancy.report.angle_error import angle_curve
from model_discrepancy.report.stiffness_in_time import stiffness_in_time
from model_discrepancy.search.found import Found

matplotlib.use("Agg")

_BLOCKS = (
    "actuator and reference",
    "coupling between footplate and foot",
    "intrinsic",
    "reflex input",
    "reflex dynamics",
    "activation",
    "torque sensor",
    "position sensor",
)
_DIRECTION_NAMES = {"up": "dorsiflexion", "down": "plantarflexion"}
_DIRECTIONS = ((1.0, "dorsiflexion"), (-1.0, "plantarflexion"))
# A response, and rest before it.
BEFORE_S, AFTER_S = 0.05, 0.4
# Single waves of a perturbation of 1 to 20 Hz can be told in so much of it.
STRETCH_S = 3.0
_GREY, _BLUE, _RED = "0.35", "#1f6fb4", "#c8372d"


def encoded(figure: Figure) -> str:
    """Return the figure as base64 PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110, bbox_inches="tight")
    return base64.b64encode(buffer.getvalue()).decode()


def before_and_after(
    fitter: Fitter, base_map: ResidualMap, base: HeldOut, final: HeldOut | None, noise: float
) -> str:
    """Draw the mean torque around movements: recorded, and predicted on unseen data; the band is
    what no model explains. `final` None: base only. Of a continuous movement the torque in time is
    drawn, where the base model predicts it worst.
    """
    rows = fitter.rows
    figure = Figure(figsize=(10, 3.6))
    shown = after_movements(base_map.onsets, rows.rate, rows.count)
    for number, (word, segments) in enumerate(shown.items()):
        axes = figure.add_subplot(1, len(shown), number + 1)
        time, band = (segments[0] - segments[0, 0]) / rows.rate - BEFORE_S, noise**2 / len(segments)
        _draw_torque(axes, fitter, 1000.0 * time, segments, base, final, band**0.5)
        axes.axvline(0.0, color="0.8", lw=0.8)
        axes.set_title(f"after {word} ({len(segments)} movements)")
        axes.set_xlabel("time after onset [ms]")
    if not shown:
        stretch = worst_stretch(np.where(rows.used, base.residual, 0.0), rows.rate)
        axes = figure.add_subplot()
        _draw_torque(axes, fitter, rows.time[stretch], stretch[None, :], base, final, noise)
        axes.set_title("where the base model predicts it worst")
        axes.set_xlabel("time into the recording [s]")
    return encoded(figure)


def after_movements(onsets: Onsets, rate: float, count: int) -> dict[str, np.ndarray]:
    """Return the rows from `BEFORE_S` before to `AFTER_S` after each movement, by direction and of
    shape (movements, n); no direction in which the plate does not begin to move.

    Parameters
    ----------
    onsets
        Of the movements.
    rate
        Rows per second [Hz].
    count
        Of the rows that there are.
    """
    reach = np.arange(-int(BEFORE_S * rate), int(AFTER_S * rate))
    found = {}
    for sign, word in _DIRECTIONS:
        index = np.round(onsets.time[onsets.direction == sign] * rate).astype(int)
        index = index[(index + reach[0] >= 0) & (index + reach[-1] < count)]
        if len(index):
            found[word] = index[:, None] + reach
    return found


def worst_stretch(left: np.ndarray, rate: float) -> np.ndarray:
    """Return the rows of the `STRETCH_S` seconds in which most is left.

    Parameters
    ----------
    left
        [N.m], shape (n,).
    rate
        Rows per second [Hz].
    """
    length = min(int(STRETCH_S * rate), len(left) - 1)
    summed = np.cumsum(left**2)
    first = int(np.argmax(summed[length:] - summed[:-length]))
    return np.arange(first, first + length)


def _draw_torque(
    axes: Axes,
    fitter: Fitter,
    time: np.ndarray,
    segments: np.ndarray,
    base: HeldOut,
    final: HeldOut | None,
    band: float,
) -> None:
    """Draw the mean torque of segments of rows, shape (segments, n), over n times."""
    recorded = fitter.plain_target[segments].mean(axis=0)
    axes.fill_between(
        time,
        recorded - 2 * band,
        recorded + 2 * band,
        color="0.85",
        label="not explainable (2 standard errors)",
    )
    axes.plot(time, recorded, color="k", lw=2, label="recorded")
    axes.plot(time, recorded - base.residual[segments].mean(axis=0), color=_RED, label="base model")
    if final is not None:
        axes.plot(
            time,
            recorded - final.residual[segments].mean(axis=0),
            color=_BLUE,
            label="with the new physics",
        )
    axes.set_ylabel("torque [N.m]")
    axes.legend(fontsize=8)


def path_diagram(marked: set[str]) -> str:
    """Draw the signal path with the guilty blocks in red."""
    figure = Figure(figsize=(10, 1.5))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.axis("off")
    for number, name in enumerate(_BLOCKS):
        guilty = name in marked
        text = (
            name.replace(" and ", "\nand ")
            .replace(" between ", "\nbetween ")
            .replace("footplate and", "footplate\nand")
        )
        style = {
            "boxstyle": "round,pad=0.5",
            "fc": "#f7d6d3" if guilty else "#eef2f6",
            "ec": _RED if guilty else _GREY,
            "lw": 2.2 if guilty else 1.0,
        }
        axes.text(
            (number + 0.5) / len(_BLOCKS),
            0.5,
            text,
            ha="center",
            va="center",
            fontsize=8,
            bbox=style,
            transform=axes.transAxes,
        )
    return encoded(figure)


def residual_picture(
    base: ResidualMap, final: ResidualMap | None, label: str = "base model"
) -> str:
    """Draw the residual by time after onset and direction (where the plate moves from rest), and
    its share of torque by frequency band, before and after (where there is an after).
    """
    shown = [(base, _RED, label)] + (
        [(final, _BLUE, "with the new physics")] if final is not None else []
    )
    moved = [k for k, (sign, _) in enumerate(_DIRECTIONS) if (base.onsets.direction == sign).any()]
    figure = Figure(figsize=(10, 3.4))
    for number, k in enumerate(moved):
        axes = figure.add_subplot(1, len(moved) + 1, number + 1)
        for found, color, label in shown:
            axes.plot(1000 * found.responses[0], found.responses[k + 1], color=color, label=label)
        axes.axhline(0.0, color="0.8", lw=0.8)
        axes.set_title(f"mean unexplained torque, {_DIRECTIONS[k][1]}", fontsize=10)
        axes.set_xlabel("time after onset [ms]")
        axes.set_ylabel("unexplained [N.m]")
        axes.legend(fontsize=7)
    axes = figure.add_subplot(1, len(moved) + 1, len(moved) + 1)
    place = np.arange(len(base.share))
    for number, (found, color, label) in enumerate(shown):
        axes.bar(
            place + 0.4 * (number - 0.5 * (len(shown) - 1)),
            [100 * s for s in found.share.values()],
            0.4,
            color=color,
            label=label,
        )
    if not moved:
        axes.legend(fontsize=7)
    axes.set_xticks(place, [f"{low:g}-{high:g}" for low, high in base.share], fontsize=7)
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel("unexplained, % of torque")
    figure.tight_layout()
    return encoded(figure)


def ladder(found: Found) -> str:
    """Draw by how much each term lowers the whitened error."""
    figure = Figure(figsize=(7, 0.6 + 0.4 * max(len(found.effects), 1)))
    axes = figure.add_subplot()
    names = [effect.trial.name.replace("_", " ") for effect in found.effects]
    axes.barh(names, [100 * effect.trial.gain for effect in found.effects], color=_BLUE)
    axes.invert_yaxis()
    axes.set_xlabel("share of the unexplained torque that comes back without the effect [%]")
    figure.tight_layout()
    return encoded(figure)


def cells_picture(base: ResidualMap, final: ResidualMap | None, label: str = "base model") -> str:
    """Draw the mean residual by direction and size (rows) and window (columns) with its 95 % band;
    bold where the band excludes zero.
    """
    shown = [(base, label)] + ([(final, "with the new physics")] if final is not None else [])
    groups = list(dict.fromkeys((c.direction, c.size) for c in base.cells))
    windows = list(dict.fromkeys(c.window for c in base.cells))
    figure = Figure(figsize=(5.2 * len(shown) + 1.5, 0.9 + 0.5 * max(len(groups), 1)))
    largest = max((abs(c.mean) for c in base.cells), default=1.0) or 1.0
    for number, (found, title) in enumerate(shown):
        axes = figure.add_subplot(1, len(shown), number + 1)
        by_place = {((c.direction, c.size), c.window): c for c in found.cells}
        means = np.array([[_mean(by_place.get((g, w))) for w in windows] for g in groups]).reshape(
            len(groups), len(windows)
        )
        axes.imshow(means, cmap="RdBu_r", vmin=-largest, vmax=largest, aspect="auto")
        for (group, window), cell in by_place.items():
            text = f"{cell.mean:+.2f}\n{cell.low:+.2f} to {cell.high:+.2f}"
            dark = abs(cell.mean) > 0.6 * largest
            weight = "bold" if cell.significant else "normal"
            place = (windows.index(window), groups.index(group))
            axes.text(
                *place,
                text,
                ha="center",
                va="center",
                fontsize=6.5,
                weight=weight,
                color="w" if dark else "k",
            )
        axes.set_xticks(
            range(len(windows)),
            [f"{1000 * low:.0f} to {1000 * high:.0f}" for low, high in windows],
            fontsize=7,
        )
        names = [f"{_DIRECTION_NAMES[direction]}, {size}" for direction, size in groups]
        axes.set_yticks(
            range(len(groups)), names if number == 0 else [""] * len(groups), fontsize=8
        )
        axes.set_xlabel("window after onset [ms]", fontsize=8)
        axes.set_title(f"mean unexplained torque [N.m], {title}", fontsize=10)
    figure.tight_layout()
    return encoded(figure)


def _mean(cell: Cell | None) -> float:
    return np.nan if cell is None else cell.mean


def dependence_picture(base: ResidualMap) -> str:
    """Draw the coherence of the residual with each input by frequency, and what the size of the
    misfit depends on.
    """
    columns = 2 if base.dependence else 1
    figure = Figure(figsize=(5 * columns, 2.8))
    axes = figure.add_subplot(1, columns, 1)
    values = np.array([list(row.values()) for row in base.coherent.values()])
    axes.imshow(values, cmap="Greys", vmin=0.0, vmax=1.0, aspect="auto")
    for (row, column), value in np.ndenumerate(values):
        axes.text(
            column,
            row,
            f"{value:.2f}",
            ha="center",
            va="center",
            fontsize=8,
            color="w" if value > 0.5 else "k",
        )
    bands = next(iter(base.coherent.values()))
    axes.set_xticks(range(len(bands)), [f"{low:g}-{high:g}" for low, high in bands], fontsize=8)
    axes.set_yticks(range(len(base.coherent)), list(base.coherent), fontsize=8)
    axes.set_xlabel("frequency [Hz]")
    axes.set_title("coherence of the unexplained torque with", fontsize=10)
    if base.dependence:
        _draw_dependence(figure.add_subplot(1, columns, 2), base)
    figure.tight_layout()
    return encoded(figure)


def _draw_dependence(axes: Axes, base: ResidualMap) -> None:
    """Draw what the size of the misfit after a movement depends on."""
    names = list(base.dependence)
    axes.barh(
        [f"{name} (p = {p:.2g})" for name, (_, p) in base.dependence.items()],
        [r for r, _ in base.dependence.values()],
        color=[_RED if base.dependence[name][1] < 0.001 else "0.7" for name in names],
    )
    axes.axvline(0.0, color="0.5", lw=0.8)
    axes.set_xlim(-1.0, 1.0)
    axes.invert_yaxis()
    axes.tick_params(labelsize=8)
    axes.set_title("rank correlation of the misfit with (red: p < 0.001)", fontsize=10)


def block_picture(block: MissingBlock) -> str:
    """Draw static curve and impulse response of the missing block with their 95 % bands."""
    figure = Figure(figsize=(9, 3.2))
    left, right = figure.subplots(1, 2)
    for axes, x, (low, middle, high) in (
        (left, block.levels, block.curve),
        (right, 1000 * block.lags, block.response),
    ):
        axes.fill_between(x, low, high, color="0.85", label="95 % band")
        axes.plot(x, middle, "o-", color=_RED, ms=3)
        axes.axhline(0.0, color="0.7", lw=0.8)
    left.set_xlabel(f"{block.input} [{block.unit}]")
    left.set_ylabel("output, largest = 1")
    left.set_title("static curve", fontsize=10)
    left.legend(fontsize=8)
    right.set_xlabel("lag [ms]")
    right.set_ylabel("torque per second of input [N.m/s]")
    right.set_title("followed by these dynamics (impulse response)", fontsize=10)
    figure.tight_layout()
    return encoded(figure)


def angle_error_picture(fitter: Fitter, fit: Fit) -> str:
    """Draw the error of the measured angle with its 95 % band, and how often each angle was
    held.
    """
    angles, error, spread = angle_curve(fitter, fit)
    figure = Figure(figsize=(7, 3.2))
    axes = figure.add_subplot()
    often = axes.twinx()
    often.hist(fitter.motion.position, bins=angles[::3].tolist(), color="0.9")
    often.set_yticks([])
    axes.set_zorder(often.get_zorder() + 1)
    axes.patch.set_visible(False)
    low, high = 1000 * (error - 1.96 * spread), 1000 * (error + 1.96 * spread)
    axes.fill_between(angles, low, high, color=_RED, alpha=0.2, lw=0, label="95 % band")
    axes.plot(angles, 1000 * error, color=_RED, lw=1.5, label="error")
    axes.axhline(0.0, color="0.5", lw=0.8)
    axes.set_xlim(angles[0], angles[-1])
    axes.set_xlabel("measured angle [rad]; grey: how often it was held")
    axes.set_ylabel("plate less measured angle [mrad]")
    axes.legend(fontsize=8)
    figure.tight_layout()
    return encoded(figure)


def stiffness_picture(fitter: Fitter, fit: Fit) -> str:
    """Draw the stiffness in the course of the recording, and its mean."""
    stiffness = stiffness_in_time(fitter, fit)
    used = fitter.motion.time >= fitter.rows.time[fitter.rows.used][0]
    figure = Figure(figsize=(10, 2.8))
    axes = figure.add_subplot()
    axes.plot(fitter.motion.time[used], stiffness[used], color=_BLUE, lw=1.0, label="stiffness")
    axes.axhline(float(np.mean(stiffness[used])), color="0.5", lw=0.8, ls="--", label="mean")
    axes.set_xlabel("time [s]")
    axes.set_ylabel(f"stiffness [{joint_in_force().in_units('N.m/rad')}]")
    axes.legend(fontsize=8)
    figure.tight_layout()
    return encoded(figure)


def channels_picture(recording: Recording) -> str:
    """Draw every channel as it was recorded, for a recording that cannot be used."""
    channels = {"position [rad]": recording.position, "torque [N.m]": recording.torque}
    if recording.velocity is not None:
        channels["velocity [rad/s]"] = recording.velocity
    # More points than a screen shows would only take time.
    step = max(1, len(recording.position) // 20000)
    figure = Figure(figsize=(10, 1.8 * len(channels)))
    for number, (name, values) in enumerate(channels.items()):
        axes = figure.add_subplot(len(channels), 1, number + 1)
        axes.plot(recording.time[::step], values[::step], color=_GREY, lw=0.6)
        axes.set_ylabel(name)
    axes.set_xlabel("time [s]")
    figure.tight_layout()
    return encoded(figure)
